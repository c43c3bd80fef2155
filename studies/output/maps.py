"""Maps: cells of two axes of which a value is shown by colours (`heat`), and points with such colours (`spots`).

Columns of tables: those of the axes and of the value, and `panel`, `failed` (a grey cell with a cross) and `doubted`
(a cell with a dot) if there are some.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.output.figures import FREE, WIDTH, Figure, escaped, is_named, panels
from studies.quantities import shown

if TYPE_CHECKING:
    import altair as alt
    import pandas as pd

ERROR_EDGES = (-50.0, -20.0, -10.0, -5.0, 5.0, 10.0, 20.0, 50.0)
"""Bounds of the classes of signed errors in maps, %; within 5 and 10 % is what the paper and the studies ask for."""
ERROR_COLOURS = (
    *("#08519c", "#3182bd", "#74add1", "#c6dcef", "#fbfaf5"),
    *("#fde3c2", "#fdae61", "#e06a1b", "#993404"),
)
"""Colours of these classes: blue below, orange above, readable with any colour vision."""
MOST_CELLS = 6
"""Number of evenly spaced values beyond which an axis of a map has round numbers in place of those of the cells."""
WIDE = 30.0
"""Ratio of the greatest to the least value from which colours, and the axes of a sweep, are logarithmic."""
EVEN = 0.02
"""Relative difference of steps up to which values are evenly spaced, because tables round them."""


def heat(
    title: str,
    caption: str,
    data: pd.DataFrame,
    axes: tuple[str, str],
    value: str,
    *,
    edges: Sequence[float] = (),
    colours: Mapping[str, str] = {},
    marked: Mapping[str, str] = {},
    columns: int = 3,
) -> Figure:
    """Return a map of a value over two axes: a cell for each row of the table.

    Parameters
    ----------
    axes : columns of the horizontal and of the vertical axis; numbers stand in rising order.
    edges : bounds of the classes of values, each with its colour; empty for colours that change gradually.
    colours : colours of values that are names.
    marked : what the marks of cells mean: "failed" (crosses) and "doubted" (dots) are columns of flags.
    """
    import altair as alt

    wide, high = (data[name].nunique() for name in axes)
    count = data["panel"].nunique() if "panel" in data else 1
    width = min(WIDTH / (2 if count == 4 else min(columns, count) or 1) - 20, 60.0 * wide)
    height = min(max(120.0, 26.0 * high), 300.0)
    across, up = width / (wide or 1), height / (high or 1)
    known = data[value].notna() if is_named(data, value) else np.isfinite(data[value].astype(float))
    cells = _with_edges(data, axes)
    if edges:
        cells = cells.assign(shade=_classes(cells, known, value, edges))
    base = alt.Chart()
    middle = base.encode(**_cell(cells, axes))
    area = base.encode(**_cell(cells, axes, edges=True)).mark_rect()
    valid = f"isValid(datum[{value!r}])"
    layers = [area.transform_filter(valid).encode(color=_colour(data[known], value, edges, colours))]
    if "failed" in data:
        layers.append(area.transform_filter("datum.failed").encode(color=alt.value("#bbbbbb")))
        layers.append(middle.transform_filter("datum.failed").mark_text(text="\u00d7", style="label", aria=False))
    if "doubted" in data:
        # in a corner of the cell, beside its number
        dots = middle.transform_filter("datum.doubted").mark_circle(
            size=16, opacity=1, stroke="white", strokeWidth=0.8, aria=False, xOffset=0.4 * across, yOffset=-0.3 * up
        )  # fmt: skip
        layers.append(dots.encode(color=alt.value("#1b1f24")))
    if numbered := not colours and across >= (32 if edges else 44) and up >= 14:
        digits = alt.Text(field=escaped(value), type="quantitative", format=".2~r" if edges else ".3~r")
        dark = _dark(data.loc[known, value], value, edges)
        ink = alt.when(dark).then(alt.value("white")).otherwise(alt.value("#1b1f24"))
        layers.append(
            middle.transform_filter(valid).mark_text(fontSize=11, aria=False).encode(text=digits, color=ink)
        )
    map_ = alt.layer(*layers).properties(width=width, height=height, view=alt.ViewBackground(strokeOpacity=0))
    notes = [note for name, note in marked.items() if name in data and bool(data[name].any())]
    # numbers and dots need the size that they were placed for
    fixed = numbered or "doubted" in data
    return Figure(title, caption, panels(map_, cells, columns), data, tuple(notes), wide=fixed)


def spots(
    title: str, caption: str, data: pd.DataFrame, axes: tuple[str, str], value: str, edges: Sequence[float]
) -> Figure:
    """Return points over two axes of numbers, whose colours are the classes of a value."""
    import altair as alt

    known = np.isfinite(data[value].astype(float))
    points = data[known].assign(shade=_classes(data[known], known[known], value, edges))
    x, y = axes
    chart = alt.Chart(points).mark_point(stroke="#555555", strokeWidth=0.6, size=60).encode(
        x=alt.X(x, **FREE), y=alt.Y(y, **FREE), color=_colour(points, value, edges, {})
    )  # fmt: skip
    return Figure(title, caption, chart.properties(width=WIDTH * 0.75), data[known], wide=True)


def _with_edges(data: pd.DataFrame, axes: tuple[str, str]) -> pd.DataFrame:
    """Return the table with the edges of the cells along those axes whose values are many and evenly spaced.

    Such an axis has round numbers: those of all cells would be long and lie on each other.
    """
    for name in axes:
        values = np.unique(data[name]) if not is_named(data, name) else np.zeros(0)
        steps = np.diff(values)
        if len(values) > MOST_CELLS and np.ptp(steps) <= EVEN * steps.mean():
            # a little overlap, or the background shines through between cells
            step = steps.mean()
            data = data.assign(**{f"{name} low": data[name] - 0.55 * step, f"{name} high": data[name] + 0.55 * step})
    return data


def _cell(data: pd.DataFrame, axes: tuple[str, str], *, edges: bool = False) -> dict[str, Any]:
    """Return the channels of the cells of a map: their `edges`, or their middle."""
    import altair as alt

    channels: dict[str, Any] = {}
    for way, kind, name in (("x", alt.X, axes[0]), ("y", alt.Y, axes[1])):
        low, high = f"{name} low", f"{name} high"
        if low not in data:
            channels[way] = kind(**_cell_axis(data, name, descending=way == "y"))
            continue
        ends = [float(data[low].min()), float(data[high].max())]
        scale, axis = alt.Scale(domain=ends, nice=False, zero=False), alt.Axis(grid=False)
        field = escaped(low if edges else name)
        channels[way] = kind(field=field, type="quantitative", scale=scale, axis=axis, title=name)
        if edges:
            channels[f"{way}2"] = (alt.X2 if way == "x" else alt.Y2)(field=escaped(high))
    return channels


def _cell_axis(data: pd.DataFrame, name: str, *, descending: bool) -> dict[str, Any]:
    import altair as alt

    # cells without a value have a place, too
    values = list(dict.fromkeys(data[name])) if is_named(data, name) else np.unique(data[name]).tolist()
    texts = {} if is_named(data, name) else {"labelExpr": "format(datum.value, '.4~g')"}
    axis = alt.Axis(labelAngle=0, labelOverlap=True, ticks=False, **texts)
    scale = alt.Scale(domain=values[::-1] if descending else values)
    return {"field": escaped(name), "type": "ordinal", "scale": scale, "sort": None, "axis": axis, "title": name}


def _dark(values: pd.Series, value: str, edges: Sequence[float]) -> str:
    """Return Vega's expression for dark cells: both ends of the classes, and the lower half of gradual colours."""
    if edges:
        return f"datum[{value!r}] < {edges[1]} || datum[{value!r}] >= {edges[-1]}"
    kind, low, top = _gradual(values)
    return f"datum[{value!r}] < {math.sqrt(low * top) if kind == 'log' else (low + top) / 2}"


def _names(edges: Sequence[float]) -> list[str]:
    """Return the names of the classes of a value, from below the first edge to above the last."""
    ends = [shown(edge, digits=4).replace("-", "\N{MINUS SIGN}") for edge in edges]
    return [f"below {ends[0]}", *map(" to ".join, itertools.pairwise(ends)), f"above {ends[-1]}"]


def _classes(data: pd.DataFrame, known: Any, value: str, edges: Sequence[float]) -> list[str | None]:
    """Return the class of each value that is known."""
    names, numbers = _names(edges), np.searchsorted(edges, data[value].astype(float), side="right")
    return [names[k] if some else None for k, some in zip(numbers, known, strict=True)]


def _colour(data: pd.DataFrame, value: str, edges: Sequence[float], colours: Mapping[str, str]) -> alt.Color:
    """Return the colours of known values, those of their classes if there are `edges`."""
    import altair as alt

    if not edges and not colours:
        kind, low, high = _gradual(data[value])
        scale = alt.Scale(type=kind, scheme="cividis", domain=[low, high if high > low else low + (abs(low) or 1.0)])
        legend = alt.Legend(title=value, gradientLength=220)
        return alt.Color(field=escaped(value), type="quantitative", scale=scale, legend=legend)
    names, shades = (list(colours), list(colours.values())) if colours else (_names(edges), list(ERROR_COLOURS))
    # all classes, also those without a cell; that around zero is nearly white
    legend = alt.Legend(values=names, title=value, symbolStrokeColor="#999999", symbolStrokeWidth=1)
    scale, field = alt.Scale(domain=names, range=shades), escaped(value if colours else "shade")
    return alt.Color(field=field, type="nominal", scale=scale, legend=legend, sort=None)


def _gradual(values: pd.Series) -> tuple[Any, float, float]:
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    return "log" if low > 0 and high > WIDE * low else "linear", low, high
