"""The plot of a sweep: panels in columns and rows for two axes, and colours for a third one.

The horizontal axis is the first axis that changes the force. Of the other axes, the one with the most values has a
colour for each value, the next one a column of panels, and the last one a row of panels. An axis that changes neither
the force nor its error, such as f, is not shown. If an axis has more values than the plot can show, some are drawn
and a note gives their number.
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

Quantity = Callable[[SweepRow], float]
"""A function that returns a quantity of a row, NaN if the row has none."""


def fem_force(row: SweepRow) -> float:
    """Return the press force by finite elements, N."""
    return row.fem.force_N


def formula_force(row: SweepRow) -> float:
    """Return the press force by the formulas, N."""
    return row.analytic.force_N


def force_error(row: SweepRow) -> float:
    """Return the error of the formulas' press force, %."""
    return row.force_error_percent


FORCE: tuple[Quantity, ...] = (fem_force, formula_force)
ERROR: tuple[Quantity, ...] = (force_error,)

MOST_LINES, MOST_PANELS = 6, 3
"""Greatest numbers of colours, and of columns or rows of panels, that stay legible."""

MOST_MARKED = 25
"""Greatest number of points of a line with markers; on a denser line they would overlap."""

MARKERS = "os^Dv<"
GREY = "#555555"
LINE_WIDTH = 78
"""Characters of a line of notes below the plot."""


@dataclass(frozen=True, slots=True)
class View:
    """How the axes of a sweep are shown; an empty text means that there is no such axis.

    Attributes
    ----------
    x : horizontal axis.
    colour, across, down : axes whose values are lines, columns of panels and rows of panels.
    fixed : axes that are shown at one value only.
    idle : axes that change neither the force nor its error.
    """

    x: str
    colour: str
    across: str
    down: str
    fixed: tuple[str, ...]
    idle: tuple[str, ...]


def view(rows: Sequence[SweepRow], axes: Mapping[str, Sequence[float]]) -> View:
    """Choose how the axes of a sweep are shown."""
    effective = [name for name in axes if has_effect(rows, axes, name, FORCE + ERROR)]
    x = effective[0] if effective else next(iter(axes))
    others = sorted((name for name in effective if name != x), key=lambda name: -len(set(axes[name])))
    colour, across, down, *_ = [*others, "", "", ""]
    idle = tuple(name for name in axes if name not in (x, *others) and _is_idle(rows, axes, name))
    return View(x, colour, across, down, tuple(others[3:]), idle)


def has_effect(
    rows: Sequence[SweepRow], axes: Mapping[str, Sequence[float]], name: str, figures: Sequence[Quantity]
) -> bool:
    """Return whether any of the quantities changes along an axis with the others fixed; NaN is ignored.

    Values are compared to seven digits, so that rounding errors of scaled results do not count as a change.
    """
    return any(len({text for _, text in values}) > 1 for values in _along(rows, axes, name, figures))


def _is_idle(rows: Sequence[SweepRow], axes: Mapping[str, Sequence[float]], name: str) -> bool:
    """Return whether the results are equal at all values of an axis; False if only one value has a result."""
    places = _along(rows, axes, name, FORCE + ERROR)
    compared = any(len({value for value, _ in values}) > 1 for values in places)
    return compared and not has_effect(rows, axes, name, FORCE + ERROR)


def _along(
    rows: Sequence[SweepRow], axes: Mapping[str, Sequence[float]], name: str, figures: Sequence[Quantity]
) -> Iterable[set[tuple[float, str]]]:
    """Return the values along an axis with the quantity there, for each quantity and point of the other axes."""
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
    """Return the values of an axis that are drawn: all, or `most` of them, evenly spread with both ends.

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
    """Draw the force by both models, and the error of the formulas below, into a file."""
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
    """Return the rows of one line, in order of x.

    Rows that differ only in an idle axis have the same x; the first one with a result is drawn.
    """
    wanted = {axis: value for axis, value in place.items() if axis}
    at: dict[float, SweepRow] = {}
    for row in rows:
        if all(row.on_axis(axis) == value for axis, value in wanted.items()):
            x = row.on_axis(look.x)
            if x not in at or math.isnan(fem_force(at[x])):
                at[x] = row
    return [at[x] for x in sorted(at)]


def _curve(
    panel: Any, line: Sequence[SweepRow], axis: str, figures: Sequence[Quantity], colour: str, marker: str
) -> None:
    """Draw finite elements or the error as a full line with markers, the formulas as a dashed line."""
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
    blocks: Sequence[tuple[Sequence[Quantity], float]],
    columns: Sequence[float],
    look: View,
    *,
    apart: bool,
) -> None:
    """Add labels and titles, and give all panels of errors the same range."""
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
    """Return the entries of the legend."""
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
    """State in sentences what the plot does not show."""
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
