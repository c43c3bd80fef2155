"""Figures of the report as plain data, which the page's script draws: axes, panels, series, cells.

A figure holds all its numbers, so that its CSV is whole; `drawn` names the points that are drawn where there are too
many of them. A missing number is None, since JSON has no NaN.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

MOST_MARKS = 1200
"""Largest number of marks of a figure: beyond that the pointer finds no single mark and the page becomes slow."""
MOST_POINTS = 20_000
"""Largest number of points of a figure, those of lines without markers included."""
MOST_LINE_MARKS = 40
"""Number of points of a line beyond which its points have no markers of their own."""

ERROR_EDGES = (-50.0, -20.0, -10.0, -5.0, 5.0, 10.0, 20.0, 50.0)
"""Bounds of the classes of signed errors in maps, %; within 5 and 10 % is what the paper and the studies ask for."""


@dataclass(frozen=True, slots=True)
class Axis:
    """An axis of a figure.

    Attributes
    ----------
    label : name with its unit, such as "depth (mm)".
    log : whether its scale is logarithmic.
    categories : names at the positions 0, 1, 2 ...; empty for a scale of numbers.
    """

    label: str
    log: bool = False
    categories: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Series:
    """Points of one kind in a panel.

    Attributes
    ----------
    x, y : coordinates; on an axis with categories their numbers.
    line, mark : whether a line joins the points, and whether points have markers.
    low, high : ends of the interval of each y, or x; empty where there are none.
    names : name of each point that the readout shows; empty where there are none.
    labels : short name of each point that stands beside it, where there is room; empty where there are none.
    style : number of colour and marker; the same number means the same thing in all panels.
    dash : number of the line's pattern: 0 solid, 1 dashed, 2 dotted, 3 both.
    across : whether `low` and `high` are the ends of x.
    drawn : indices of the points that are drawn; None for all.
    """

    name: str
    x: tuple[float | None, ...]
    y: tuple[float | None, ...]
    line: bool = True
    mark: bool = True
    low: tuple[float | None, ...] = ()
    high: tuple[float | None, ...] = ()
    names: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()
    style: int = 0
    dash: int = 0
    across: bool = False
    drawn: tuple[int, ...] | None = None


@dataclass(frozen=True, slots=True)
class Guide:
    """A straight line across a figure at a value of one axis, "x" or "y", such as a bound."""

    axis: str
    at: float
    label: str = ""


@dataclass(frozen=True, slots=True)
class Panel:
    """One pair of axes of a figure, with series or, in a map, with cells.

    Attributes
    ----------
    cells : value of each cell of a map, rows of y from below, None where there is none.
    x : label of its own horizontal axis; "" where it is that of the figure.
    """

    title: str = ""
    series: tuple[Series, ...] = ()
    cells: tuple[tuple[float | None, ...], ...] = ()
    x: str = ""


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure with everything that the page says about it.

    Attributes
    ----------
    kind : "plot" of series, or "map" of cells over two axes with categories.
    caption : what is seen, in sentences.
    value, edges : name of a map's values and the bounds of their classes.
    shared : whether all panels have the same scales, so that heights compare.
    columns : greatest number of panels side by side.
    source : name of the file that holds its numbers.
    replaces : pictures in the folder that show the same.
    """

    title: str
    caption: str
    x: Axis
    y: Axis
    panels: tuple[Panel, ...]
    kind: str = "plot"
    guides: tuple[Guide, ...] = ()
    value: str = ""
    edges: tuple[float, ...] = ()
    shared: bool = True
    columns: int = 3
    source: str = ""
    replaces: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=())

    @property
    def empty(self) -> bool:
        """Whether nothing would be drawn."""
        return not any(
            any(value is not None for value in [*series.y]) for panel in self.panels for series in panel.series
        ) and not any(value is not None for panel in self.panels for row in panel.cells for value in row)

    def data(self) -> dict[str, Any]:
        """Return the figure as the page's script takes it, without captions, which are text of the page."""
        kept = ("title", "kind", "x", "y", "panels", "guides", "value", "edges", "shared", "columns")
        return {name: plain(getattr(self, name)) for name in kept}


def plain(value: Any) -> Any:
    """Convert dataclasses to what JSON can hold, without empty fields."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        named = {spec.name: getattr(value, spec.name) for spec in dataclasses.fields(value)}
        return {name: plain(part) for name, part in named.items() if part not in ((), "", None)}
    if isinstance(value, (list, tuple)):
        return [plain(part) for part in value]
    return value


def numbers(values: Iterable[Any]) -> tuple[float | None, ...]:
    """Return numbers to six digits, None for NaN and infinity.

    >>> numbers([0.12345678, float("nan"), 3])
    (0.123457, None, 3.0)
    """
    return tuple(float(f"{value:.6g}") if math.isfinite(value) else None for value in map(float, values))


def series(name: str, x: Any, y: Any, style: int = 0, **more: Any) -> Series:
    """Return a series of the points that have both coordinates, in the order of x where a line joins them.

    Parameters
    ----------
    x, y : coordinates, shape (n,).
    more : fields of `Series`; `low`, `high` and `names` have shape (n,).
    """
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    rows = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if more.get("line", True):
        rows = rows[np.argsort(x[rows], kind="stable")]
        more.setdefault("mark", len(rows) <= MOST_LINE_MARKS)
    for end in ("low", "high"):
        if len(more.get(end, ())):
            more[end] = numbers(np.asarray(more[end], dtype=float)[rows])
    for texts in ("names", "labels"):
        if len(more.get(texts, ())):
            more[texts] = tuple(str(more[texts][row]) for row in rows)
    return Series(name, numbers(x[rows]), numbers(y[rows]), style=style, **more)


def thinned(figure: Figure) -> Figure:
    """Return a figure that draws at most `MOST_MARKS` points, evenly chosen, with a sentence that says so."""
    counts = [len(one.x) for panel in figure.panels for one in panel.series]
    # a line without markers is one mark however many points it has
    marks = [len(one.x) for panel in figure.panels for one in panel.series if one.mark or not one.line]
    if sum(marks) <= MOST_MARKS and sum(counts) <= MOST_POINTS:
        return figure
    share = MOST_MARKS / sum(counts)
    panels = tuple(
        dataclasses.replace(panel, series=tuple(_every(one, share) for one in panel.series))
        for panel in figure.panels
    )
    drawn = sum(len(one.x if one.drawn is None else one.drawn) for panel in panels for one in panel.series)
    note = f"{drawn} of {sum(counts)} points are drawn, evenly chosen from each series; the CSV has all of them."
    return dataclasses.replace(figure, panels=panels, notes=(*figure.notes, note))


def _every(one: Series, share: float) -> Series:
    """Return a series of which a share of the points is drawn, the first, the last and the extremes among them."""
    count = max(4, math.floor(share * len(one.x)))
    if count >= len(one.x):
        return one
    values = np.array([math.nan if y is None else y for y in one.y])
    chosen = set(np.linspace(0, len(one.x) - 1, count - 2).round().astype(int).tolist())
    chosen |= {int(np.nanargmin(values)), int(np.nanargmax(values))}
    return dataclasses.replace(one, drawn=tuple(sorted(chosen)))


def error_guides(*bounds: float) -> tuple[Guide, ...]:
    """Return lines at zero and at plus and minus some errors in %."""
    ends = [sign * bound for bound in bounds for sign in (1, -1)]
    return (Guide("y", 0.0), *(Guide("y", end, f"{end:+g} %".replace("-", "\N{MINUS SIGN}")) for end in ends))


def grouped(keys: Sequence[Any]) -> Mapping[Any, list[int]]:
    """Return the rows of each different key, in the order in which the keys appear."""
    groups: dict[Any, list[int]] = {}
    for row, key in enumerate(keys):
        groups.setdefault(key, []).append(row)
    return groups
