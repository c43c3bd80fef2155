"""Maps: cells of two axes of which a value is shown by colours (`heat`), and points with such colours (`spots`).

Tables have the columns that `studies.output.figures` names.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.output.figures import (
    HALF,
    LETTER,
    WIDE,
    WIDTH,
    Figure,
    Look,
    channel,
    escaped,
    faceted,
    is_named,
    readout,
    short,
    wrapped,
)

if TYPE_CHECKING:
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

    x, y = axes
    wide, high = (len(data[name].unique()) for name in axes)
    panels = list(dict.fromkeys(data["panel"])) if "panel" in data else []
    columns = 2 if len(panels) == 4 else min(columns, len(panels)) or 1
    known = data[value].notna() if is_named(data, value) else np.isfinite(data[value].astype(float))
    cells = _with_edges(data, axes)
    if edges:
        cells = cells.assign(shade=_classes(cells, known, value, edges))

    def chart(whole: int = WIDTH) -> Any:
        width = min(whole / columns - 20, 60.0 * wide)
        height = min(max(120.0, min(300.0, 26.0 * high)), 300.0 if whole == WIDTH else 180.0)
        size = width / wide, height / high
        base = alt.Chart().encode(tooltip=readout(data, [name for name in ("panel", x, y, value) if name in data]))
        area = base.encode(**_cell(cells, axes, size, edges=True))
        middle = base.encode(**_cell(cells, axes, size))
        valid = f"isValid(datum[{value!r}])"
        layers = [
            area.transform_filter(valid).mark_rect().encode(color=_colour(data[known], value, edges, colours, whole))
        ]
        if "failed" in data:
            layers.append(area.transform_filter("datum.failed").mark_rect(color="#bbbbbb"))
            layers.append(middle.transform_filter("datum.failed").mark_text(text="\u00d7", style="label", aria=False))
        if "doubted" in data:
            # in a corner of the cell, beside its number
            dots = middle.transform_filter("datum.doubted").mark_circle(
                size=16, opacity=1, stroke="white", strokeWidth=0.8, aria=False,
                xOffset=0.4 * size[0], yOffset=-0.3 * size[1],
            )  # fmt: skip
            layers.append(dots.encode(color=alt.value("#1b1f24")))
        if not colours and size[0] >= (32 if edges else 44) and size[1] >= 14:
            numbered = middle.transform_filter(valid).mark_text(fontSize=11, aria=False)
            number = alt.Text(field=escaped(value), type="quantitative", format=".2~r" if edges else ".3~r")
            dark = _dark(data.loc[known, value], value, edges)
            ink = alt.condition(dark, alt.value("white"), alt.value("#1b1f24"))
            layers.append(numbered.encode(text=number, color=ink))
        made = alt.layer(*layers).properties(width=width, height=height, view=alt.ViewBackground(strokeOpacity=0))
        return faceted(made, cells, panels, columns, shared=True)

    notes = [note for name, note in marked.items() if name in data and bool(data[name].any())]
    half = partial(chart, HALF) if len(panels) <= 2 else None
    return Figure(title, caption, chart(), data, tuple(notes), half=half)


def spots(
    title: str, caption: str, data: pd.DataFrame, axes: tuple[str, str], value: str, edges: Sequence[float]
) -> Figure:
    """Return points over two axes of numbers, whose colours are the classes of a value."""
    import altair as alt

    known = np.isfinite(data[value].astype(float))
    points = data[known].assign(shade=_classes(data[known], known[known], value, edges))
    colour = _colour(points, value, edges, {}, WIDTH)
    x, y = axes
    chart = alt.Chart(points).mark_point(stroke="#555555", strokeWidth=0.6, size=60).encode(
        x=channel(alt.X, points, x, Look(), WIDTH * 0.75, 8),
        y=channel(alt.Y, points, y, Look(), 300, 6),
        color=colour, tooltip=readout(points, [x, y, value]),
    )  # fmt: skip
    return Figure(title, caption, chart.properties(width=WIDTH * 0.75, height=300), data[known])


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


def _cell(data: pd.DataFrame, axes: tuple[str, str], size: tuple[float, float], *, edges: bool = False) -> Any:
    """Return the channels of the cells of a map: their `edges`, or their middle; `size` in pixels."""
    import altair as alt

    channels: dict[str, Any] = {}
    for way, kind, name in (("x", alt.X, axes[0]), ("y", alt.Y, axes[1])):
        low, high = f"{name} low", f"{name} high"
        if low not in data:
            channels[way] = kind(**_cell_axis(data, name, size["xy".index(way)], descending=way == "y"))
            continue
        ends = [float(data[low].min()), float(data[high].max())]
        pixels = size[way == "y"] * len(np.unique(data[name]))
        channels[way] = kind(
            field=escaped(low if edges else name),
            type="quantitative",
            scale=alt.Scale(domain=ends, nice=False, zero=False),
            axis=alt.Axis(tickCount=max(3, int(pixels / (60 if way == "x" else 30))), grid=False),
            title=wrapped(name, pixels),
        )
        if edges:
            channels[f"{way}2"] = (alt.X2 if way == "x" else alt.Y2)(field=escaped(high))
    return channels


def _cell_axis(data: pd.DataFrame, name: str, size: float, *, descending: bool) -> dict[str, Any]:
    import altair as alt

    # cells without a value have a place, too
    values = list(dict.fromkeys(data[name])) if is_named(data, name) else np.unique(data[name]).tolist()
    texts = {} if is_named(data, name) else {"labelExpr": "format(datum.value, '.4~g')"}
    axis = alt.Axis(labelAngle=0, labelOverlap=True, ticks=False, **texts)
    scale = alt.Scale(domain=values[::-1] if descending else values)
    title = wrapped(name, size * len(values))
    return {"field": escaped(name), "type": "ordinal", "scale": scale, "sort": None, "axis": axis, "title": title}


def _dark(values: pd.Series, value: str, edges: Sequence[float]) -> str:
    """Return Vega's expression for dark cells: both ends of the classes, and the lower half of gradual colours."""
    if edges:
        return f"datum[{value!r}] < {edges[1]} || datum[{value!r}] >= {edges[-1]}"
    kind, low, top = _gradual(values)
    return f"datum[{value!r}] < {math.sqrt(low * top) if kind == 'log' else (low + top) / 2}"


def _names(edges: Sequence[float]) -> list[str]:
    """Return the names of the classes of a value, from below the first edge to above the last."""
    ends = [short(edge).replace("-", "\N{MINUS SIGN}") for edge in edges]
    return [f"below {ends[0]}", *map(" to ".join, itertools.pairwise(ends)), f"above {ends[-1]}"]


def _classes(data: pd.DataFrame, known: Any, value: str, edges: Sequence[float]) -> list[str | None]:
    """Return the class of each value that is known."""
    names, numbers = _names(edges), np.searchsorted(edges, data[value].astype(float), side="right")
    return [names[k] if some else None for k, some in zip(numbers, known, strict=True)]


def _colour(data: pd.DataFrame, value: str, edges: Sequence[float], colours: Mapping[str, str], whole: int) -> Any:
    """Return the colours of known values, that of their class if there are `edges`, with a legend `whole` wide."""
    import altair as alt

    if not edges and not colours:
        kind, low, high = _gradual(data[value])
        scale = alt.Scale(type=kind, scheme="cividis", domain=[low, high if high > low else low + (abs(low) or 1.0)])
        legend = alt.Legend(title=value, gradientLength=220)
        return alt.Color(field=escaped(value), type="quantitative", scale=scale, legend=legend)
    names, shades = (list(colours), list(colours.values())) if colours else (_names(edges), list(ERROR_COLOURS))
    columns = max(1, int(whole / (LETTER * max(map(len, names)) + 34)))
    # the class around zero is nearly white
    legend = alt.Legend(columns=columns, title=value, symbolStrokeColor="#999999", symbolStrokeWidth=1)
    scale = alt.Scale(domain=names, range=shades)
    return alt.Color(
        field=escaped(value if colours else "shade"), type="nominal", scale=scale, legend=legend, sort=None
    )


def _gradual(values: pd.Series) -> tuple[Any, float, float]:
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    return "log" if low > 0 and high > WIDE * low else "linear", low, high
