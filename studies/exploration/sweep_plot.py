"""The picture of a sweep: small multiples over at most two axes, and a colour for each value of one more.

The horizontal axis is the first that changes the force; of the others, the one of most values gets colours, the next
columns of panels, the last rows of panels. An axis that changes neither the force nor its error, as f does not, gets
none. Where an axis has more values than a picture can show, some of them are drawn, and the picture says which part.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studies.exploration.sweep_rows import SweepRow
from studies.output import table_plots
from studies.output.table_plots import COLOURS

Figure = Callable[[SweepRow], float]
"""A figure of a row, NaN where there is none."""


def fem_force(row: SweepRow) -> float:
    """Press force by the finite elements, N."""
    return row.fem.force_N


def formula_force(row: SweepRow) -> float:
    """Press force by the formulas, N."""
    return row.analytic.force_N


def force_error(row: SweepRow) -> float:
    """Error of the formulas' press force, %."""
    return row.force_error_percent


FORCE: tuple[Figure, ...] = (fem_force, formula_force)
ERROR: tuple[Figure, ...] = (force_error,)

MOST_LINES, MOST_PANELS = 6, 3
"""Values of an axis that are drawn as colours, and as columns or rows of panels."""

MOST_MARKED = 25
"""Points of a line that get a marker each."""

MARKERS = "os^Dv<"
GREY = "#555555"
LINE_WIDTH = 78
"""Characters of a line of notes across the picture."""


@dataclass(frozen=True, slots=True)
class View:
    """Which axis is shown how; empty texts for none.

    Attributes
    ----------
    x : the horizontal axis.
    colour, across, down : a line, a column and a row of panels for each value that is drawn.
    fixed : axes that stay at one value.
    idle : axes that change nothing.
    """

    x: str
    colour: str
    across: str
    down: str
    fixed: tuple[str, ...]
    idle: tuple[str, ...]


def view(rows: Sequence[SweepRow], axes: Mapping[str, Sequence[float]]) -> View:
    """How the axes of a sweep are shown."""
    moving = [name for name in axes if has_effect(rows, axes, name, FORCE + ERROR)]
    x = moving[0] if moving else next(iter(axes))
    others = sorted((name for name in moving if name != x), key=lambda name: -len(set(axes[name])))
    colour, across, down, *_ = [*others, "", "", ""]
    idle = tuple(name for name in axes if name not in (x, *others) and _is_idle(rows, axes, name))
    return View(x, colour, across, down, tuple(others[3:]), idle)


def has_effect(
    rows: Sequence[SweepRow], axes: Mapping[str, Sequence[float]], name: str, figures: Sequence[Figure]
) -> bool:
    """Whether any of the figures changes along an axis, the others fixed; to seven digits, NaN left aside."""
    return any(len({text for _, text in values}) > 1 for values in _along(rows, axes, name, figures))


def _is_idle(rows: Sequence[SweepRow], axes: Mapping[str, Sequence[float]], name: str) -> bool:
    """Whether answers at several values of an axis are all the same; where there is but one, nothing is known."""
    places = _along(rows, axes, name, FORCE + ERROR)
    compared = any(len({value for value, _ in values}) > 1 for values in places)
    return compared and not has_effect(rows, axes, name, FORCE + ERROR)


def _along(
    rows: Sequence[SweepRow], axes: Mapping[str, Sequence[float]], name: str, figures: Sequence[Figure]
) -> Iterable[set[tuple[float, str]]]:
    """Values of an axis with those of a figure there, for each figure and each place on the other axes."""
    others = [other for other in axes if other != name]
    places: dict[tuple[Any, ...], set[tuple[float, str]]] = {}
    for row in rows:
        for figure in figures:
            value = figure(row)
            if not math.isnan(value):
                place = (figure, *(row.on_axis(other) for other in others))
                places.setdefault(place, set()).add((row.on_axis(name), f"{value:.6e}"))
    return places.values()


def drawn(axes: Mapping[str, Sequence[float]], name: str, most: int) -> list[float]:
    """The values of an axis that are drawn: all, or `most` of them from the least to the greatest.

    >>> drawn({"D": [1, 2, 3, 4, 5]}, "D", 3)
    [1, 3, 5]
    """
    if not name:
        return [math.nan]
    values = sorted(set(axes[name]))
    if len(values) <= most:
        return values
    return [values[round(k * (len(values) - 1) / (most - 1))] for k in range(most)]


def draw(path: str | Path, rows: Sequence[SweepRow], axes: Mapping[str, Sequence[float]]) -> None:
    """Force of both models, and the formula's error below."""
    look = view(rows, axes)
    colours, columns = drawn(axes, look.colour, MOST_LINES), drawn(axes, look.across, MOST_PANELS)
    downs = drawn(axes, look.down, MOST_PANELS)
    apart = bool(look.down) and has_effect(rows, axes, look.down, ERROR)
    blocks = [(FORCE, value) for value in downs] + [(ERROR, value) for value in (downs if apart else downs[:1])]
    fixed = {name: sorted(set(axes[name]))[len(set(axes[name])) // 2] for name in look.fixed}
    tinted = {
        figures: bool(look.colour) and has_effect(rows, axes, look.colour, figures) for figures in (FORCE, ERROR)
    }
    with table_plots.canvas(path, len(blocks), len(columns)) as (figure, panels):
        for k, panel in enumerate(panels):
            (figures, down), across = blocks[k // len(columns)], columns[k % len(columns)]
            place = fixed | {look.across: across, look.down: down}
            for n, colour in enumerate(colours if tinted[figures] else colours[:1]):
                line = _line(rows, look, place | ({look.colour: colour} if tinted[figures] else {}))
                _curve(panel, line, look.x, figures, COLOURS[n] if tinted[figures] else GREY, MARKERS[n])
        _finish(panels, blocks, columns, look, apart=apart)
        handles = _handles(colours if tinted[FORCE] else [], look)
        figure.legend(handles=handles, loc="outside upper center", ncols=min(4, len(handles)), frameon=False)
        notes = _notes(rows, axes, look, fixed, tinted=tinted[ERROR])
        if notes:
            text = "\n".join(part for note in notes for part in textwrap.wrap(note, LINE_WIDTH))
            figure.supxlabel(text, fontsize=10, color=GREY)


def _line(rows: Sequence[SweepRow], look: View, place: Mapping[str, float]) -> list[SweepRow]:
    """Rows of one line, in order of x; of several at one x, which differ in an idle axis, one that has an answer."""
    wanted = {axis: value for axis, value in place.items() if axis}
    at: dict[float, SweepRow] = {}
    for row in rows:
        if all(row.on_axis(axis) == value for axis, value in wanted.items()):
            x = row.on_axis(look.x)
            if x not in at or math.isnan(fem_force(at[x])):
                at[x] = row
    return [at[x] for x in sorted(at)]


def _curve(
    panel: Any, line: Sequence[SweepRow], axis: str, figures: Sequence[Figure], colour: str, marker: str
) -> None:
    """FEM or the error as a full line with markers, the formulas as dashes."""
    for figure, dashes in zip(figures, ("-", "--"), strict=False):
        marked = marker if dashes == "-" and len(line) <= MOST_MARKED else ""
        face = "white" if figures is ERROR else colour
        panel.plot(
            [row.on_axis(axis) for row in line],
            [figure(row) for row in line],
            color=colour,
            linestyle=dashes,
            marker=marked,
            markerfacecolor=face,
        )


def _finish(
    panels: Sequence[Any],
    blocks: Sequence[tuple[Sequence[Figure], float]],
    columns: Sequence[float],
    look: View,
    *,
    apart: bool,
) -> None:
    """Labels, titles, and the same range of all errors."""
    errors = [panel for k, panel in enumerate(panels) if blocks[k // len(columns)][0] is ERROR]
    for panel in errors:
        table_plots.bands(panel)
    limits = [panel.get_ylim() for panel in errors]
    for panel in errors:
        panel.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))
    for k, panel in enumerate(panels):
        (figures, down), column = blocks[k // len(columns)], k % len(columns)
        panel.locator_params(axis="both", nbins=5)
        if column == 0:
            name = "press force (N)" if figures is FORCE else "formula's error (%)"
            own = look.down and (figures is FORCE or apart)
            panel.set_ylabel(f"{name}\n{_text(look.down, down)}" if own else name)
        if k < len(columns) and look.across:
            name = "depth " if look.across == "depth" else ""
            panel.set_title(name + _text(look.across, columns[column]), fontsize=11)
        if k >= len(panels) - len(columns):
            panel.set_xlabel(f"{'depth ' if look.x == 'depth' else ''}{_symbol(look.x)} ({_unit(look.x)})")


def _handles(colours: Sequence[float], look: View) -> list[Any]:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=GREY, label="FEM"),
        Line2D([], [], color=GREY, linestyle="--", label="paper"),
    ]
    for value, colour, marker in zip(colours, COLOURS, MARKERS, strict=False):
        handles.append(Line2D([], [], color=colour, marker=marker, label=_text(look.colour, value)))
    return handles + table_plots.band_handles()


def _notes(
    rows: Sequence[SweepRow],
    axes: Mapping[str, Sequence[float]],
    look: View,
    fixed: Mapping[str, float],
    *,
    tinted: bool,
) -> list[str]:
    """What the picture leaves out, in sentences."""
    notes = [f"{_symbol(name)} changes neither the force nor its error." for name in look.idle]
    if look.colour and not tinted:
        notes.append(f"The error is the same for every {_symbol(look.colour)}.")
    for name, most in ((look.colour, MOST_LINES), (look.across, MOST_PANELS), (look.down, MOST_PANELS)):
        count = len(set(axes[name])) if name else 0
        if count > most:
            notes.append(f"Of {count} values of {_symbol(name)} {most} are drawn; sweep.csv has all.")
    notes += [f"Here {_text(name, value)}; sweep.csv has the others." for name, value in fixed.items()]
    lost = sum(math.isnan(fem_force(row)) for row in rows)
    return [*notes, f"{lost} of {len(rows)} cases have no FEM result."] if lost else notes


def _unit(axis: str) -> str:
    return "MPa" if axis == "E" else "mm"


def _symbol(axis: str) -> str:
    return "$d$" if axis == "depth" else f"${axis}$"


def _text(axis: str, value: float) -> str:
    return f"{_symbol(axis)} = {value:.4g} {_unit(axis)}"
