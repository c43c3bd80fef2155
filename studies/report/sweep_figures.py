"""Figures of a sweep's table: quantities over the axes by all models, and maps of the formulas' errors.

The axes are the columns before the first result. The longest axis of numbers is horizontal, the next one has colours
or is a map's vertical axis, and the others make panels. A table of sampled points is shown as points over each axis.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.output.text_tables import in_words
from studies.report.folder_contents import Table
from studies.report.report_figures import (
    ERROR_EDGES,
    Axis,
    Figure,
    Panel,
    Series,
    error_guides,
    grouped,
    numbers,
    series,
)

TIMED = ("response", "loop")
"""Beginnings of the columns of results that depend on time, of the finite elements alone."""
MODELS = ("fem", "analytic", "chosen")
"""Beginnings of the columns of results; the name of an accuracy or of a level may follow."""
QUANTITIES = {
    "force_N": "press force (N)",
    "force_x_N": "force along the shear (N)",
    "shift_z_mm": "vertical motion of the magnet (mm)",
    "shift_x_mm": "sideways motion of the magnet (mm)",
    "tilt_rad": "tilt (rad)",
    "S1_V": "output of S1 (V)",
    "strain": "strain of 99.9 % of the silicone",
    "response_gain": "gain of the magnet's shift per N",
    "response_bandwidth_Hz": "-3 dB bandwidth per N (Hz)",
    "response_resonance_Hz": "first resonance per N (Hz)",
    "loop_gap_percent": "gap of the loop at mid-stroke (% of full scale)",
}
"""Quantities that are drawn, and the names of their axes."""
ERRORS = {
    "force_error_percent": "press force",
    "force_x_error_percent": "force along the shear",
    "shift_error_percent": "motion of the magnet",
    "tilt_error_percent": "tilt",
}
"""Errors that are mapped, in %."""
VALUES = {
    "force_error_percent": "force_N",
    "force_x_error_percent": "force_x_N",
    "shift_error_percent": "shift_z_mm",
    "tilt_error_percent": "tilt_rad",
}
"""The quantities of these errors."""
MOST_PANELS = 12
MOST_COLOURS = 6


@dataclass(frozen=True, slots=True)
class Grid:
    """The axes of a sweep, and which of them does what.

    Attributes
    ----------
    x, second : columns of the horizontal axis and of colours or the vertical axis; "" if there is none.
    others : columns of the axes that make panels.
    """

    x: str
    second: str
    others: tuple[str, ...]


def axes_of(table: Table) -> list[str]:
    """Return the columns of the axes that have several values."""
    names = []
    for name in table.columns:
        if name.split("_")[0] in (*MODELS, *TIMED):
            break
        if len(set(table.texts(name))) > 1:
            names.append(name)
    return names


def grid_of(table: Table) -> Grid:
    """Choose what each axis of a table does."""
    names = axes_of(table)
    count = {name: len(set(table.texts(name))) for name in names}
    numeric = [name for name in names if np.isfinite(table.floats(name)).all()]
    # the load's axes make curves that a reader knows; among equals the axis with the most values
    ranked = sorted(numeric, key=lambda name: (name not in ("depth_mm", "shear_mm"), -count[name]))
    longest = max(numeric, key=lambda name: count[name], default="")
    x = longest if longest and count[longest] > MOST_COLOURS else next(iter(ranked), "")
    rest = sorted((name for name in names if name != x), key=lambda name: -count[name])
    return Grid(x, rest[0] if rest else "", tuple(sorted(rest[1:], key=names.index)))


def sweep(table: Table) -> list[Figure]:
    """Return the figures of a sweep."""
    names = axes_of(table)
    if not names or not table.ok.any():
        return []
    sampled = all(len(set(table.texts(name))) > 0.5 * len(table) for name in names) and len(table) > 8
    if sampled:
        return list(_scattered(table, names))
    grid = grid_of(table)
    if not grid.x:
        return []
    figures = [figure for quantity in QUANTITIES for figure in _lines(table, grid, quantity)]
    maps = [figure for error in ERRORS for figure in _maps(table, grid, error)]
    failed = len(table) - int(table.ok.sum())
    count = f"{len(table)} cases" + (f", {failed} of them failed" if failed else ", none failed")
    return [
        _with_note(figure, f"The table has {count}.") if k == 0 else figure for k, figure in enumerate(figures)
    ] + maps


def _with_note(figure: Figure, note: str) -> Figure:
    from dataclasses import replace

    return replace(figure, notes=(*figure.notes, note))


def models_of(table: Table, end: str) -> list[str]:
    """Return the columns of a quantity, finite elements first."""
    if end.split("_")[0] in TIMED:
        return [end] if end in table.columns else []
    found = [name for name in table.columns if name.endswith(f"_{end}") and name.split("_")[0] in MODELS]
    exact = [name for name in found if _plain_model(name.removesuffix(f"_{end}"))]
    return sorted(exact, key=lambda name: not name.startswith("fem"))


def _plain_model(prefix: str) -> bool:
    """Return whether a prefix is a model alone, not a model and the beginning of another quantity."""
    return prefix.split("_")[-1] not in ("force", "shift", "tilt", "contact", "radius", "critical", "decoded")


def model_name(column: str, end: str) -> str:
    """Return a model's name as a legend has it.

    >>> model_name("analytic_finite_force_N", "force_N"), model_name("fem_force_N", "force_N")
    ('formula, level finite', 'finite elements')
    """
    if column == end:
        return "finite elements"
    kind, _, level = column.removesuffix(end).strip("_").partition("_")
    base = {"fem": "finite elements", "analytic": "formula", "chosen": "chosen model"}.get(kind, "formula")
    if kind == "analytic" and not level:
        return "the paper's formula"
    return f"{base}, {'level ' if kind == 'analytic' else ''}{level}" if level else base


def name_of(column: str) -> str:
    """Return an axis' name with its unit.

    >>> name_of("magnet_height_mm"), name_of("nu")
    ('magnet height (mm)', 'nu')
    >>> name_of("speed_mm_per_s")
    'speed (mm/s)'
    """
    for unit in ("mm", "MPa", "rad", "deg", "mN", "N", "V", "mT", "T", "Hz", "percent", "mm_per_s"):
        if column.endswith(f"_{unit}"):
            sign = {"percent": "%", "deg": "degrees", "mm_per_s": "mm/s"}.get(unit, unit)
            return f"{column.removesuffix(f'_{unit}').replace('_', ' ')} ({sign})"
    return in_words(column)


def value_of(column: str, value: Any) -> str:
    """Return a value of an axis with its name, such as "L = 9 mm"."""
    name, _, unit = name_of(column).partition(" (")
    number = _number(value)
    shown = str(value) if number is None else f"{number:.4g}"
    return f"{name} = {shown} {unit.rstrip(')')}".strip()


def _number(value: Any) -> float | None:
    try:
        return float(value)
    except (TypeError, ValueError):
        return None


def _panels(table: Table, grid: Grid, rows: NDArray[np.int64]) -> tuple[list[tuple[str, list[int]]], tuple[str, ...]]:
    """Return title and rows of each panel, and a sentence if not all combinations of the axes are drawn."""
    keys = list(zip(*(table.texts(name) for name in grid.others), strict=True)) or [()] * len(table)
    groups = list(grouped([keys[row] for row in rows]).items())
    note: tuple[str, ...] = ()
    if len(groups) > MOST_PANELS:
        chosen = np.unique(np.linspace(0, len(groups) - 1, MOST_PANELS).round().astype(int))
        note = (f"{len(chosen)} of {len(groups)} combinations of the other axes are drawn; the table has all.",)
        groups = [groups[k] for k in chosen]
    titles = [", ".join(value_of(n, v) for n, v in zip(grid.others, key, strict=False)) for key, _ in groups]
    return [(title, [int(rows[k]) for k in group]) for title, (_, group) in zip(titles, groups, strict=True)], note


def _lines(table: Table, grid: Grid, quantity: str) -> Iterator[Figure]:
    """Yield a quantity over the horizontal axis, with a colour for each value of the second axis."""
    columns = models_of(table, quantity)
    rows = np.flatnonzero(table.ok)
    if not columns or not any(np.ptp(np.nan_to_num(table.floats(name)[rows])) > 0 for name in columns):
        return
    panels, notes = _panels(table, grid, rows)
    seconds = sorted(
        set(table.texts(grid.second)), key=lambda text: (_number(text) is None, _number(text) or 0, text)
    )
    if len(seconds) > MOST_COLOURS:
        few = np.unique(np.linspace(0, len(seconds) - 1, MOST_COLOURS).round().astype(int))
        notes = (
            *notes,
            f"{len(few)} of {len(seconds)} values of {name_of(grid.second)} are drawn; the table has all.",
        )
        seconds = [seconds[k] for k in few]
    x, values = table.floats(grid.x), [table.floats(column) for column in columns[:4]]
    colours = table.texts(grid.second)
    drawn = []
    for title, members in panels:
        parts: list[Series] = []
        for k, second in enumerate(seconds if grid.second else [""]):
            own = [row for row in members if not grid.second or colours[row] == second]
            for dash, column in enumerate(columns[:4]):
                label = model_name(column, quantity)
                name = f"{value_of(grid.second, second)}, {label}" if grid.second else label
                style = k if grid.second else dash
                one = series(name, x[own], values[dash][own], style, dash=dash)
                parts += [one] if one.y else []
        drawn.append(Panel(title, tuple(parts)))
    title = QUANTITIES[quantity].partition(" (")[0]
    lines = "Solid lines are " + model_name(columns[0], quantity)
    others = [model_name(name, quantity) for name in columns[1:4]]
    patterns = ("dashed", "dotted", "dash-dotted")
    shown = "; ".join(f"{pattern}: {name}" for pattern, name in zip(patterns, others, strict=False))
    unit = QUANTITIES[quantity]
    caption = f"{lines}{'; ' + shown if shown else ''}. {_span(table, columns, quantity, rows)}"
    yield Figure(
        f"{title[:1].upper()}{title[1:]} over {name_of(grid.x).partition(' (')[0]}",
        caption,
        Axis(name_of(grid.x)),
        Axis(unit),
        tuple(drawn),
        source=table.name,
        notes=notes,
        replaces=("sweep.png",),
    )


def _span(table: Table, columns: Sequence[str], quantity: str, rows: NDArray[np.int64]) -> str:
    """Return between which values a quantity lies, in a sentence for all models."""
    unit = QUANTITIES[quantity].partition("(")[2].rstrip(")")
    parts = []
    for column in columns[:4]:
        values = table.floats(column)[rows]
        values = values[np.isfinite(values)]
        if len(values):
            parts.append(
                f"{model_name(column, quantity)} from {values.min():.3g} to {values.max():.3g} {unit}".strip()
            )
    return f"Over all cases: {'; '.join(parts)}."


def _maps(table: Table, grid: Grid, error: str) -> Iterator[Figure]:
    """Yield a map of the errors of each formula over the first two axes."""
    found = [name for name in table.columns if name == error or (name.endswith(f"_{error}"))]
    columns = [name for name in found if name == error or _plain_model(name.removesuffix(f"_{error}"))]
    if not grid.second or not columns:
        return
    rows = np.flatnonzero(table.ok)
    panels, notes = _panels(table, grid, rows)
    across, up = _values(table, grid.x), _values(table, grid.second)
    wide, high = ({text: k for k, text in enumerate(texts)} for texts in (across, up))
    places = [(high[b], wide[a]) for a, b in zip(table.texts(grid.x), table.texts(grid.second), strict=True)]
    for column in columns[:2]:
        values, over = table.floats(column), ""
        if not np.isfinite(values[rows]).any():
            continue
        if (differences := _over_the_largest(table, error, column, rows)) is not None:
            values, over = differences, f" of the largest {ERRORS[error]}"
        drawn = []
        for title, members in panels:
            cells = np.full((len(up), len(across)), np.nan)
            for row in members:
                cells[places[row]] = values[row]
            drawn.append(Panel(title, cells=tuple(numbers(line) for line in cells)))
        # an error's column without a prefix is that of the only formula
        model = "the formula" if column == error else model_name(column, error)
        judged = values[rows][np.isfinite(values[rows])]
        within = 100 * np.mean(np.abs(judged) <= 10)
        caption = (
            f"Error of {model} against finite elements: {within:.0f} % of the cases are within "
            f"10 %{over}, {100 * np.mean(np.abs(judged) <= 5):.0f} % within 5 %; the errors lie between "
            f"{judged.min():+z.0f} and {judged.max():+z.0f} %. Empty cells have no result."
        )
        yield Figure(
            f"Error of the {ERRORS[error]}, {model}",
            caption,
            Axis(name_of(grid.x), categories=tuple(_short(text) for text in across)),
            Axis(name_of(grid.second), categories=tuple(_short(text) for text in up)),
            tuple(drawn),
            kind="map",
            value=f"error (%{over})",
            edges=ERROR_EDGES,
            source=table.name,
            notes=notes,
            replaces=("sweep.png",),
        )


def _over_the_largest(table: Table, error: str, column: str, rows: NDArray[np.int64]) -> NDArray[np.float64] | None:
    """Return differences from the finite elements in % of their largest magnitude, where the models differ in sign.

    An error relative to a force of the other sign says too low of what is too high. None where no sign differs.
    """
    end = VALUES[error]
    model = f"{column.removesuffix(error) or 'analytic_'}{end}"
    truth = next((name for name in models_of(table, end) if name.startswith("fem")), "")
    if not table.has(model, truth):
        return None
    one, other = table.floats(model), table.floats(truth)
    largest = float(np.nanmax(np.abs(other[rows]), initial=0.0))
    if not (one[rows] * other[rows] < -((1e-6 * largest) ** 2)).any():
        return None
    return 100 * (one - other) / largest


def _values(table: Table, name: str) -> list[str]:
    """Return the different values of an axis, numbers in rising order."""
    return sorted(set(table.texts(name)), key=lambda text: (_number(text) is None, _number(text) or 0.0, text))


def _short(text: str) -> str:
    number = _number(text)
    return text if number is None else f"{number:.4g}"


def _scattered(table: Table, names: Sequence[str]) -> Iterator[Figure]:
    """Yield the results and errors of sampled points over each axis, one panel for each."""
    rows = np.flatnonzero(table.ok)
    for quantity, unit in (*QUANTITIES.items(), *((e, f"error of the {n} (%)") for e, n in ERRORS.items())):
        columns = models_of(table, quantity) or [quantity] * (quantity in table.columns)
        if not columns:
            continue
        panels = tuple(
            Panel(
                "",
                tuple(
                    series(
                        model_name(column, quantity),
                        table.floats(name)[rows],
                        table.floats(column)[rows],
                        k,
                        line=False,
                    )
                    for k, column in enumerate(columns[:4])
                ),
                x=name_of(name),
            )
            for name in names[:6]
        )
        title = unit.partition(" (")[0]
        yield Figure(
            f"{title[:1].upper()}{title[1:]} of the sampled cases",
            f"Each of the {len(rows)} points is one case; every panel shows the same cases over another axis.",
            Axis("value of the axis"),
            Axis(unit),
            panels,
            guides=error_guides(10) if "error" in quantity else (),
            shared=False,
            source=table.name,
            replaces=("sweep.png",),
        )
