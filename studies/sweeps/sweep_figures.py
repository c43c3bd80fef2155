"""Figures of a sweep's table: quantities over its axes by all models, with their errors, for picture and page.

The axes are the columns before the first result. The longest axis of numbers is horizontal, the next one has colours,
or is the vertical axis of maps if it has many values; up to two more make panels. Axes without effect are named, and
what would need too many panels is shown by its extremes. Sampled points are shown over each axis. Of a study with
more than some ten thousand cases every k-th value of its longest axes is drawn, and a note says so.
"""

from __future__ import annotations

import csv
import itertools
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from geometry.loads import ANSWERED
from studies.inputs import study_input
from studies.mechanics.path_solver import KINDS
from studies.mechanics.study_cases import Columns, Plan
from studies.output import figures
from studies.output.figures import ERROR_EDGES, Figure, Guide, Look, short
from studies.output.text_tables import quantity_name

if TYPE_CHECKING:
    import pandas as pd

MODELS = ("fem", "analytic", "chosen", "surrogate")
"""Beginnings of the columns of results; the name of an accuracy or of a level may follow."""
PLAIN = ("response", "loop", "critical", "mode1")
"""Beginnings of the columns of results that the finite elements alone have."""
with Path(__file__).with_name("sweep_quantities.csv").open(encoding="utf-8", newline="") as _file:
    QUANTITIES = {row["quantity"]: row for row in csv.DictReader(_file)}
"""Quantities that are drawn: names of their axes, and columns and names of their errors, in %."""
OTHER_ENDS = ("force", "shift", "tilt", "contact", "radius", "critical", "decoded")
"""Last words of what stands before the name of a quantity in a column of another quantity."""
MOST_COLOURS = 6
"""Greatest number of values of an axis that are told apart by colours."""
MOST_PANELS = 12
SAME = 1e-6
"""Relative difference up to which two results are the same, because scaled results have rounding errors."""
SAME_RATIO = 0.15
"""Relative spread of the ratios of neighbouring values up to which they are log-spaced; 1, 2, 5, 10 is beyond it."""
LEAST_RATIO = 8.0
"""Ratio of the last to the first value from which a logarithmic axis is of use."""
BEYOND = 5.0
"""Ratio to the error that 90 % of the cases do not exceed beyond which a plot does not show errors."""
SHADES = (Guide("y", -10.0, to=10.0), Guide("y", -5.0, to=5.0), Guide("y", 0.0))
"""Shades of errors within 5 and 10 %, which the axis names: labels in the panels would lie on the data."""
BINS = 8
"""Number of parts of an axis between whose means the effect of the axis is measured."""
MOST_NOTED = 100
"""Number of letters beyond which the reason of failed cases is not continued by its next clause."""


class View(NamedTuple):
    """What each axis does: horizontal, colours (or vertical in maps), panels, or shown by its extremes (folded)."""

    x: str
    second: str = ""
    panels: tuple[str, ...] = ()
    folded: tuple[str, ...] = ()
    maps: bool = False


def sweep(table: pd.DataFrame, quantities: Sequence[str] = tuple(QUANTITIES)) -> list[Figure]:
    """Return the figures of rows of sweep.csv, those of a quantity and of its errors one after the other."""
    over = {f"{name.removesuffix('_over_D')}_mm" for name in map(str, table.columns) if name.endswith("_over_D")}
    # an axis over D stands for its length
    table, notes = _grouped_axes(table.drop(columns=[name for name in over if name in table]))
    axes = axes_of(table)
    present = [quantity for quantity in quantities if models_of(table, quantity)]
    if not axes or not present or not len(table):
        return []
    answered = table["status"].isin(ANSWERED)
    gave_way = table["error_status"] == "gave_way" if "error_status" in table else False
    table = table.assign(failed=~answered, open=answered & (table["status"] != "ok"), gave_way=gave_way)
    notes = [*notes, *failures(table)]
    draw = _scattered if is_sampled(table, axes) else _over_grid
    drawn = [figure for quantity in present for figure in draw(table, axes, quantity)]
    return [replace(drawn[0], notes=(*drawn[0].notes, *notes)), *drawn[1:]] if drawn else []


def axes_of(table: pd.DataFrame) -> list[str]:
    """Return the columns of the axes: those before the results that have several values, else the first one."""
    names = []
    for name in table.columns:
        if name.split("_")[0] in (*MODELS, *PLAIN) or name in ("status", "failed"):
            break
        names.append(str(name))
    return [name for name in names if table[name].nunique() > 1] or names[:1]


def is_sampled(table: pd.DataFrame, axes: Sequence[str]) -> bool:
    """Return whether the points fill the space of the axes without a grid."""
    return len(table) > 8 and all(table[name].nunique() > 0.5 * len(table) for name in axes) and len(axes) > 1


def models_of(table: pd.DataFrame, end: str) -> list[str]:
    """Return the columns of a quantity, finite elements first."""
    found = [str(name) for name in table.columns if name == end or name.endswith(f"_{end}")]
    words = {name: name.removesuffix(f"_{end}").split("_") for name in found}
    exact = [n for n, each in words.items() if n == end or (each[0] in MODELS and each[-1] not in OTHER_ENDS)]
    known = [name for name in exact if table[name].dtype.kind in "fiu"]
    return sorted(known, key=lambda name: not name.startswith("fem"))


def model_name(column: str, end: str) -> str:
    """Return a model's name as a legend has it.

    >>> model_name("analytic_finite_force_N", "force_N"), model_name("fem_force_N", "force_N")
    ('formula, level finite', 'finite elements')
    """
    if column == end:
        return "the formula" if "error" in end else "finite elements"
    kind, _, level = column.removesuffix(end).strip("_").partition("_")
    names = {"fem": "finite elements", "analytic": "formula", "chosen": "chosen model", "surrogate": "surrogate"}
    base = names.get(kind, "formula")
    if kind == "analytic" and not level:
        return "the paper's formula"
    return f"{base}, {'level ' if kind == 'analytic' else ''}{level}" if level else base


def value_of(column: str, value: Any, D: float | None = None) -> str:
    """Return a value of an axis with its name, of L and depth also over a diameter D, mm.

    >>> value_of("L_mm", 9.0), value_of("L_mm", 9.0, 6.0), value_of("L_over_D", 1.5, 6.0)
    ('L = 9 mm', 'L = 9 mm (L/D = 1.5)', 'L/D = 1.5')
    """
    if isinstance(value, str) and " = " in value:  # axes that vary together have their names in their values
        return value
    name, _, unit = quantity_name(column).partition(" (")
    over = f" ({name}/D = {value / D:.3g})" if D is not None and column in ("L_mm", "depth_mm", "shear_mm") else ""
    return f"{name} = {short(value)} {unit.rstrip(')')}".strip() + over


def _diameter(table: pd.DataFrame) -> float | None:
    """Return the diameter of all beams of a table, mm; None if it varies or is unknown."""
    known = table["D_mm"].dropna().unique() if "D_mm" in table else []
    return float(known[0]) if len(known) == 1 else None


def log_spaced(values: Array) -> bool:
    """Return whether rising values are rather log-spaced than evenly spaced.

    >>> log_spaced(np.array([0.1, 0.3, 1.0, 3.0])), log_spaced(np.array([1.0, 2.0, 3.0]))
    (True, False)
    """
    if len(values) < 3 or not values[0] > 0 or values[-1] / values[0] < LEAST_RATIO:
        return False
    steps = np.diff(np.log(values))
    return bool(np.ptp(steps) <= SAME_RATIO * steps.mean())


def failures(table: pd.DataFrame) -> list[str]:
    """State in a sentence how many cases failed and why."""
    lost = table[~table["status"].isin(ANSWERED)]
    if not len(lost):
        return []
    kinds = Counter(lost["status"])
    causes = ", ".join(f"{count} {status}" if len(kinds) > 1 else status for status, count in kinds.most_common(3))
    text = f"{len(lost)} of {len(table)} cases failed ({causes})"
    reasons = Counter(message for message in lost.get("message", ()) if isinstance(message, str) and message)
    for reason, _ in reasons.most_common(1):
        first, *others = reason.split("; ")
        for clause in others:
            if len(first) + len(clause) > MOST_NOTED:
                break
            first += f"; {clause}"
        # a long clause ends with a colon and the remedy
        text += f"; most often: {first if len(first) <= MOST_NOTED else first.rpartition(': ')[0] or first}"
    return [text.rstrip(".") + "."]


def _grouped_axes(table: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """Return the table with one axis for each group of axes that vary together, and sentences on them.

    The axis with the most values stands for its group; if its values repeat, the axis has the values of all as texts.
    """
    notes: list[str] = []
    axes = axes_of(table)
    if is_sampled(table, axes):
        return table, notes
    for first, second in ((a, b) for k, a in enumerate(axes) for b in axes[k + 1 :]):
        if first not in table or second not in table:
            continue
        leader, other = sorted((first, second), key=lambda name: -table[name].nunique())
        pairs = len(table[[leader, other]].drop_duplicates())
        if pairs == table[leader].nunique():
            notes.append(f"{in_words(other)} varies together with {in_words(leader)}.")
            table = table.drop(columns=other)
        elif pairs < table[leader].nunique() * table[other].nunique():
            texts = [
                f"{value_of(first, a)}, {value_of(second, b)}"
                for a, b in zip(table[first], table[second], strict=True)
            ]
            place = list(table.columns).index(first)
            table = table.drop(columns=[first, second])
            table.insert(place, f"{in_words(first)}, {in_words(second)}", texts)
            return _grouped_axes(table)
    return table, notes


def in_words(column: str) -> str:
    """Return the name of an axis without its unit."""
    return quantity_name(column).partition(" (")[0]


def _spread(table: pd.DataFrame, axes: Sequence[str], axis: str, columns: Sequence[str]) -> tuple[float, bool]:
    """Return how far an axis spreads columns, over the whole spread of each, and whether it changes any of them.

    A value of the axis for which all cases failed changes them, too.
    """
    others = [name for name in axes if name != axis]
    solved = table[~table["failed"]]
    size, changes = 0.0, solved[axis].nunique() < table[axis].nunique() and len(solved) > 0
    for column in columns:
        values = solved[column] if not others else solved.groupby(others, sort=False, dropna=False)[column]
        most, least = np.atleast_1d(values.max()), np.atleast_1d(values.min())
        apart, magnitude = most - least, np.maximum(abs(most), abs(least))
        changes |= bool((apart > SAME * magnitude).any())
        whole = float(solved[column].max() - solved[column].min())
        size += float(np.nanmean(apart)) / whole if whole > 0 and np.isfinite(apart).any() else 0.0
    return size, changes


def view(table: pd.DataFrame, axes: Sequence[str], columns: Sequence[str]) -> View:
    """Choose what each axis does for some columns of results; axes without effect do nothing."""
    effects = {axis: _spread(table, axes, axis, columns) for axis in axes}
    count = {axis: table[axis].nunique() for axis in axes}
    names = (
        [axis for axis in axes if effects[axis][1]] or [axis for axis in axes if count[axis] > 1] or list(axes[:1])
    )
    numbers = [axis for axis in names if table[axis].dtype.kind in "fiu"] or names
    long = [axis for axis in numbers if count[axis] > MOST_COLOURS]
    # the load's axes make curves that a reader knows; among equals the axis with the most values
    x = min(long or numbers, key=lambda axis: (axis.partition("_")[0] not in ("depth", "shear"), -count[axis]))
    second, *rest = [*sorted((axis for axis in names if axis != x), key=lambda axis: -count[axis]), ""]
    panels, folded = [axis for axis in rest if axis], list[str]()
    while math.prod(count[axis] for axis in panels) > MOST_PANELS:
        folded.append(min(panels, key=lambda axis: effects[axis][0]))
        panels.remove(folded[-1])
    maps = bool(second) and count[second] > MOST_COLOURS and table[x].dtype.kind in "fiu"
    return View(x, second, tuple(panels), tuple(folded), maps)


def _over_grid(table: pd.DataFrame, axes: Sequence[str], quantity: str) -> Iterator[Figure]:
    columns = models_of(table, quantity)
    solved = table[~table["failed"]]
    columns = [name for name in columns if solved[name].notna().any()] or columns
    label = QUANTITIES[quantity]["label"]
    look, words = view(table, axes, columns), in_words(label)
    used = {look.x, look.second, *look.panels, *look.folded}
    idle = [in_words(a) for a in axes if table[a].nunique() > 1 and a not in used]
    notes = [f"{_list(idle)} {'changes' if len(idle) == 1 else 'change'} nothing in the {words}."]
    models = {column: model_name(column, quantity) for column in columns}
    unit = label.partition("(")[2].rstrip(")")
    stable = solved[~solved["open"]]
    ends = [
        f"{name} from {stable[column].min():.3g} to {stable[column].max():.3g} {unit}".strip()
        for column, name in models.items()
        if stable[column].notna().any()
    ]
    which = "all stable cases" if solved["open"].any() else "all cases"
    caption = (
        f"Over {which}: {'; '.join(ends)}." if ends else "No case is stable." if len(solved) else "Every case failed."
    )
    title = f"{_capital(words)} over {in_words(look.x)}"
    shown = {columns[0]: models[columns[0]]} if look.maps else models
    styles = tuple(models.values())
    yield from _drawn((title, caption), table, look, label, shown, notes if idle and len(solved) else [], styles)
    error, name = QUANTITIES[quantity]["error"], QUANTITIES[quantity]["error_of"]
    errors = [column for column in (models_of(table, error) if error else []) if solved[column].notna().any()]
    if not errors:
        return
    own = view(table, axes, errors)
    # an error's column without a prefix is that of the only formula
    others = [name for name in models.values() if name != "finite elements"]
    names = {column: others[-1] if column == error and others else model_name(column, error) for column in errors}
    for part in [{column: text} for column, text in names.items()] if own.maps else [names]:
        caption = " ".join(_share(solved, column, text) for column, text in part.items())
        by = f", {next(iter(part.values()))}" if len(part) == 1 else ""
        yield from _drawn((f"Error of the {name}{by}", caption), table, own, "error (%)", part, [], styles)


def _drawn(
    words: tuple[str, str],
    table: pd.DataFrame,
    look: View,
    label: str,
    names: dict[str, str],
    notes: Sequence[str],
    styles: tuple[str, ...],
) -> Iterator[Figure]:
    """Yield lines or maps of some columns, whose axes without effect and folded axes take their extremes."""
    import pandas as pd

    error = label.startswith("error")
    keys = [axis for axis in (look.x, look.second, *look.panels) if axis]
    long = []
    if error:
        table = table.assign(failed=table["failed"] | table["gave_way"])
    for column, name in names.items():
        known = ~table["failed"] & table[column].notna()
        # a formula knows no stability: in a figure of errors the reference's counts
        doubted = table["open"] & known & (error or not column.startswith("analytic"))
        groups = table.assign(value=table[column].where(known), open=doubted).groupby(keys, sort=False)
        low, high = groups["value"].min(), groups["value"].max()
        part = pd.DataFrame({label: high.where(high.abs() >= low.abs(), low), "low": low, "high": high})
        part["failed"], part["open"] = groups["failed"].any(), groups["open"].any()
        if look.x in ("depth_mm", "depth_over_D") and "critical_depth_mm" in table:
            part["limit"] = groups["critical_depth_mm"].min()
            if look.x == "depth_over_D":
                part["limit"] /= groups["D_mm"].min()
        long.append(part.reset_index().assign(model=name))
    # texts keep the order of the study
    rising = [axis for axis in keys if table[axis].dtype.kind in "fiu"]
    data = pd.concat(long, ignore_index=True)
    data = data.sort_values(rising, kind="stable", ignore_index=True) if rising else data
    if look.folded:
        how = "the value of greatest magnitude" if look.maps else "lines at the greatest magnitude, shades over all"
        values = _list([in_words(axis) for axis in look.folded])
        notes = [*notes, f"{_capital(in_words(label))} over all values of {values}: {how}."]
    notes = [*notes, *_marked(table, data, error=error, maps=look.maps)]
    diameter = _diameter(table)
    flags = {name: data[name] for name in ("failed", "open") if data[name].any()}
    shown = pd.DataFrame({quantity_name(look.x): data[look.x], label: data[label], **flags})
    if look.panels:
        shown["panel"] = [
            ", ".join(value_of(a, value, diameter) for a, value in zip(look.panels, row, strict=True))
            for row in zip(*(data[a] for a in look.panels), strict=True)
        ]
    if look.maps:
        shown = shown.rename(columns={"open": "doubted"})
        shown[quantity_name(look.second)] = data[look.second]
        across = (quantity_name(look.x), quantity_name(look.second))
        figure = figures.heat(*words, shown, across, label, edges=ERROR_EDGES if error else ())
        yield replace(figure, notes=(*figure.notes, *notes))
        return
    if look.folded:
        shown = shown.assign(low=data["low"], high=data["high"])
    if "limit" in data and not look.folded:
        # a line far beyond the depths would squeeze them
        inside = data["limit"].between(data[look.x].min(), data[look.x].max())
        shown["limit"] = data["limit"].where(inside)
        notes = [
            *notes,
            *(["Dotted lines across: depth at which the press buckles sideways."] if inside.any() else []),
        ]
    if look.second:
        shown["series"] = [value_of(look.second, value, diameter) for value in data[look.second]]
    if not look.second or len(styles) > 1:
        shown["model" if look.second else "series"] = data["model"]
    numeric = table[look.x].dtype.kind in "fiu"
    log = "x" if numeric and log_spaced(np.unique(table[look.x])) else ""
    span, guides = None, tuple[Guide, ...]()
    if error:
        guides = SHADES
        notes = [*notes, "Shades: errors within 5 and 10 %."]
        span, said = _limits(data[label])
        notes = [*notes, *said]
    elif log and data[label].min() > 0 and data[label].max() > figures.WIDE * data[label].min():
        log += "y"
    drawn = Look(line=numeric, log=log, guides=guides, span=span, names=styles)
    figure = figures.plot(*words, shown, quantity_name(look.x), label, drawn)
    yield replace(figure, notes=(*figure.notes, *notes))


def _limits(errors: pd.Series) -> tuple[tuple[float, float] | None, list[str]]:
    """Return the range of errors that is drawn, without few far beyond the others, and a sentence on these."""
    numbers = np.append(errors[np.isfinite(errors)].to_numpy(), [-10.0, 10.0])
    inside = numbers[abs(numbers) <= BEYOND * float(np.percentile(abs(numbers), 90))]
    beyond = numbers[(numbers < inside.min()) | (numbers > inside.max())]
    if not len(beyond):
        return None, []
    what = "1 error stands" if len(beyond) == 1 else f"{len(beyond)} errors stand"
    ends = " to ".join(dict.fromkeys(f"{value:.0f} %" for value in (beyond.min(), beyond.max())))
    room = 0.06 * (inside.max() - inside.min())
    return (float(inside.min() - room), float(inside.max() + room)), [f"{what} at the edge: {ends}."]


def _marked(table: pd.DataFrame, data: pd.DataFrame, *, error: bool, maps: bool) -> list[str]:
    """Return what the marks of a figure mean; `table` has the cases, `data` the marks."""
    said = []
    if data["open"].any():
        count = int(table["open"].sum())
        what = "1 case is" if count == 1 else f"{count} cases are"
        mark = "dots" if maps else "open markers"
        said.append(
            f"{_capital(mark)}: {what} unstable, or not known to be stable; a real sensor may leave such a state."
        )
    if error and table["gave_way"].any():
        count = int(table["gave_way"].sum())
        said.append(f"Crosses: in {count} of {len(table)} cases the beam gave way or failed, and no error is stated.")
    return said


def _share(solved: pd.DataFrame, column: str, model: str) -> str:
    """Return which shares of the stable cases have small errors; what is not known to be stable does not count."""
    judged, doubted = (solved.loc[rows, column].dropna() for rows in (~solved["open"], solved["open"]))
    if not len(judged):
        return f"No stable case has an error of {model}."
    of, left = "cases", ""
    if len(doubted):
        of = f"{len(judged)} stable cases"
        left = f" {len(doubted)} cases that are not known to be stable do not count."
    return (
        f"Error of {model} against finite elements: {100 * (judged.abs() <= 10).mean():.0f} % of the {of} are "
        f"within 10 %, {100 * (judged.abs() <= 5).mean():.0f} % within 5 %; the errors lie between "
        f"{judged.min():+z.0f} and {judged.max():+z.0f} %.{left}"
    )


def effect(x: Array, y: Array) -> float:
    """Return the share of the variance of y that the means over parts of x explain, 0 to 1."""
    some = np.isfinite(y)
    x, y = x[some], y[some]
    if len(y) < 2 or not y.std() > 0:
        return 0.0
    parts = np.array_split(y[np.argsort(x, kind="stable")], min(BINS, len(y)))
    between = sum(len(part) * (part.mean() - y.mean()) ** 2 for part in parts)
    return float(between / (len(y) * y.var()))


def _scattered(table: pd.DataFrame, axes: Sequence[str], quantity: str) -> Iterator[Figure]:
    import pandas as pd

    error, name = QUANTITIES[quantity]["error"], QUANTITIES[quantity]["error_of"]
    errors = models_of(table, error) if error else []
    solved = table[~table["failed"]]
    numeric = [axis for axis in axes if table[axis].dtype.kind in "fiu"]
    label = QUANTITIES[quantity]["label"]

    def by_effect(column: str) -> list[str]:
        return sorted(numeric, key=lambda axis: -effect(*(solved[k].to_numpy(float) for k in (axis, column))))

    for columns, end, unit in (
        (models_of(table, quantity), quantity, label),
        (errors, error, f"error of the {name} (%)"),
    ):
        if not columns or not solved[columns].notna().any(axis=None) or not numeric:
            continue
        parts = [
            table[["failed"]].assign(
                open=table["open"] & (unit != label or not column.startswith("analytic")),
                **{"value of the axis": table[axis], unit: table[column].where(~table["failed"])},
                panel=quantity_name(axis),
                series=model_name(column, end),
            )
            for axis in by_effect(max(columns, key=lambda column: float(solved[column].std())))
            for column in columns
        ]
        data = pd.concat(parts, ignore_index=True)
        look = Look(line=False, shared=False, guides=SHADES if unit != label else ())
        caption = f"Each of the {len(solved)} points is one case; every panel shows the same cases over another axis."
        title = f"{_capital(in_words(unit))} of the sampled cases"
        notes = _marked(table, data, error=unit != label, maps=False)
        notes += ["Shades: errors within 5 and 10 %."] if unit != label else []
        if unit != label:
            caption += " " + " ".join(_share(solved, column, model_name(column, end)) for column in columns)
        data = data.drop(columns=[name for name in ("failed", "open") if not data[name].any()])
        figure = figures.plot(title, caption, data, "value of the axis", unit, look)
        yield replace(figure, notes=(*figure.notes, *notes))
    pair = by_effect(errors[0])[:2] if errors else []
    for column in errors if len(pair) == 2 else []:
        cells = pd.DataFrame({quantity_name(a): solved[a] for a in pair} | {"error (%)": solved[column]})
        title = f"Error of the {name}, {model_name(column, error)}, over the two most effective axes"
        names = (quantity_name(pair[0]), quantity_name(pair[1]))
        yield figures.spots(title, "", cells, names, "error (%)", ERROR_EDGES)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _list(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


# Pictures of a sweep: which rows and which quantities they show


MOST_DRAWN = 20_000
"""Largest number of cases that are drawn: more marks than a picture has room for."""
LARGE = 1000
"""Number of cases from which on the pictures leave out axes whose effect on the shown quantities is known."""


class Collected:
    """The rows of a sweep that its pictures show."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self._fixed = _fixed(plan)
        counts = [factor.count for factor in plan.factors]
        self._drawn = [1 if k in self._fixed else count for k, count in enumerate(counts)]
        while math.prod(self._drawn) > MOST_DRAWN:
            longest = self._drawn.index(max(self._drawn))
            self._drawn[longest] = (self._drawn[longest] + 1) // 2
        self._chosen = [
            np.isin(np.arange(count), self._fixed.get(k, np.round(np.linspace(0, count - 1, few))))
            for k, (count, few) in enumerate(zip(counts, self._drawn, strict=True))
        ]
        self._parts: list[Columns] = []

    def add(self, table: Columns, indices: NDArray[np.int64]) -> None:
        """Keep those rows of a table that are drawn."""
        rows = np.ones(len(indices), dtype=bool)
        stride = self.plan.count
        for factor, chosen in zip(self.plan.factors, self._chosen, strict=True):
            stride //= factor.count
            rows &= chosen[indices // stride % factor.count]
        if rows.any():
            self._parts.append({name: values[rows] for name, values in table.items()})

    def draw(self, path: Path) -> list[Path]:
        """Draw the pictures, one for each quantity, and return their files.

        The second one and further ones end in -2, -3 ... before the suffix; older files of such names are deleted.
        """
        import pandas as pd

        columns = {name: np.concatenate([part[name] for part in self._parts]) for name in self._parts[0]}
        idle = {study_input.column(name) for k in self._fixed for name in self.plan.factors[k].names}
        table = pd.DataFrame({name: values for name, values in columns.items() if name not in idle})
        names = (path if k == 1 else path.with_stem(f"{path.stem}-{k}") for k in itertools.count(1))
        files = []
        for quantity in self._quantities(table):
            drawn = sweep(table, [quantity])
            if drawn:
                files.append(next(names))
                figures.save(files[-1], drawn, notes=self._notes())
        for old in itertools.takewhile(Path.is_file, names):
            old.unlink()
        return files

    def _quantities(self, table: pd.DataFrame) -> list[str]:
        sheared = self.plan.loads_sideways and ("shear" in self.plan.fields or bool(self.plan.load.get("shear")))
        present = [name for name in QUANTITIES if models_of(table, name)]
        present.sort(key=lambda name: (sheared and name != "force_x_N", not name.startswith("force")))
        more = any(name in self.plan.quantities for name in KINDS)
        return present if more else present[:1]

    def _notes(self) -> list[str]:
        notes = []
        for k, point in self._fixed.items():
            factor = self.plan.factors[k]
            if "E" in factor.names:
                E = factor.values[factor.names.index("E")][point]
                notes.append(f"Forces are proportional to E: drawn for E = {E:g} MPa.")
            others = [name for name in factor.names if name != "E"]
            if others:
                verb = "has" if len(others) == 1 else "have"
                notes.append(f"{', '.join(others)} {verb} no effect on what is shown.")
        return notes + [
            f"Of {factor.count} values of {factor.names[0]}, {few} are drawn; the table has all."
            for k, (factor, few) in enumerate(zip(self.plan.factors, self._drawn, strict=True))
            if few < factor.count and k not in self._fixed
        ]


def _fixed(plan: Plan) -> dict[int, int]:
    """Return the factors of a large study that the pictures show at one point only, with the number of this point.

    Forces do not depend on the Hall elements and the remanence, and are proportional to E.
    """
    matter = plan.matters("problems")
    idle = [k for k, factor in enumerate(plan.factors) if k not in matter and factor.count > 1]
    if "modes" in plan.quantities or "critical_depth" in plan.quantities:
        idle = [k for k in idle if "E" not in plan.factors[k].names]
    if plan.count < LARGE or len(idle) == len(plan.factors):
        return {}
    fixed = {}
    for k in idle:
        names, values = plan.factors[k].names, plan.factors[k].values
        E = [float(value) for value in values[names.index("E")]] if "E" in names else [plan.design.E]
        fixed[k] = min(range(len(E)), key=lambda point: abs(E[point] - plan.design.E))
    return fixed
