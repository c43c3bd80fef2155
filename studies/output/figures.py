"""Figures: one description, an Altair chart with its table, for the picture of a verb (PNG) and the page of a report.

`plot` draws numbers over numbers or over names, `heat` cells of two axes. Both take a table with a row for each point
or cell, whose columns have the names of the axes with their units, such as "depth (mm)", and some of these:

- panel: title of the panel; the order of the panels, as of all names, is that of the table;
- series: what has a colour and a marker; model: what has dashes and, in place of the series, the marker;
- point: name of a point in its readout; label: short text beside it;
- low, high: interval of the point, drawn as a bar, or as a band behind a line;
- failed: whether the case failed: a cross at the lower edge, or a grey cell;
- open: whether the marker is open, for a state that is doubted; limit: where on x a dotted line of the series stands;
- joined: whether a line joins the points, where not all are alike.
"""

from __future__ import annotations

import io
import itertools
import math
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.output.atomic_files import atomic

if TYPE_CHECKING:
    import altair as alt
    import pandas as pd

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Colours of Okabe and Ito, which readers with any colour vision tell apart."""
SHAPES = ("circle", "square", "triangle-up", "diamond", "triangle-down", "cross", "triangle-right")
DASHES = ([1, 0], [7, 4], [2, 3], [8, 3, 2, 3], [12, 4])
ERROR_EDGES = (-50.0, -20.0, -10.0, -5.0, 5.0, 10.0, 20.0, 50.0)
"""Bounds of the classes of signed errors in maps, %; within 5 and 10 % is what the paper and the studies ask for."""
ERROR_COLOURS = (
    *("#08519c", "#3182bd", "#74add1", "#c6dcef", "#fbfaf5"),
    *("#fde3c2", "#fdae61", "#e06a1b", "#993404"),
)
"""Colours of these classes: blue below, orange above, readable with any colour vision."""
WIDTH = 640
"""Width of all panels of a figure, pixels of the page; with its axes a figure fills a column of text."""
SCALE = 2.5
"""Pixels of a picture for each pixel of the page: 250 pixels per inch at a width of 7 in."""
MOST_MARKS = 1200
"""Largest number of marks of a figure: beyond that the pointer finds no single mark and the page becomes slow."""
MOST_POINTS = 20_000
"""Largest number of points of a figure, those of lines without markers included."""
MOST_LINE_MARKS = 40
"""Number of points of a line beyond which its points have no markers of their own."""
MOST_LABELS = 30
"""Number of points beyond which texts beside them would lie on each other."""
WIDE = 30.0
"""Ratio of the greatest to the least value from which the colours of a map are logarithmic."""
LETTER = 6.6
"""Mean width of a letter of the legend, pixels."""
THEME: dict[str, Any] = {
    "background": "white",
    "font": "Liberation Sans, Arial, sans-serif",
    "view": {"stroke": "#888888"},
    "range": {"category": list(COLOURS), "symbol": list(SHAPES)},
    "axis": {
        "gridColor": "#e4e4e4", "domain": False, "tickColor": "#888888", "labelFontSize": 12, "titleFontSize": 13,
        "titleFontWeight": "normal", "labelLimit": 260, "titleLimit": 400,
    },
    "legend": {
        "orient": "top", "title": None, "labelFontSize": 12, "titleFontSize": 12, "titleFontWeight": "normal",
        "labelLimit": 560, "titleLimit": 400, "symbolStrokeWidth": 2, "symbolSize": 70,
    },
    "header": {"labelFontSize": 12, "labelFontWeight": "bold", "labelAnchor": "start", "labelLimit": 620},
    "title": {"anchor": "start", "fontSize": 13, "subtitleFontSize": 12},
    "concat": {"spacing": 24},
    "facet": {"spacing": 14},
    "line": {"strokeWidth": 2, "strokeJoin": "round"},
    "point": {"filled": True, "size": 50, "opacity": 1},
    "style": {
        "guide": {"color": "#666666", "strokeDash": [3, 3]},
        "guide-label": {"color": "#555555", "fontSize": 11},
        "band": {"color": "#000000", "opacity": 0.07},
        "failed": {"color": "#555555", "size": 60},
        "label": {"color": "#333333", "fontSize": 11},
    },
}  # fmt: skip
"""Vega-Lite's configuration of all figures; the page of a report takes its colours from its own style."""


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure with everything that a page says about it.

    caption : what is seen, in sentences.
    data : all numbers of the figure; the chart may draw fewer, which a note says.
    source : name of the file that holds its numbers.
    """

    title: str
    caption: str
    chart: alt.TopLevelMixin
    data: pd.DataFrame
    notes: tuple[str, ...] = ()
    source: str = ""

    def spec(self) -> dict[str, Any]:
        """Return the figure in the language of Vega-Lite, without title and theme."""
        return _spec(self.chart)


@dataclass(frozen=True, slots=True)
class Guide:
    """A line at a value of one axis, "x" or "y", or with `to` a shade up to that value; `left` places its label."""

    axis: str
    at: float
    label: str = ""
    to: float | None = None
    left: bool = False


@dataclass(frozen=True, slots=True)
class Look:
    """How a plot is drawn.

    line : whether lines join the points of a series.
    log : axes with a logarithmic scale: "", "x", "y" or "xy".
    across : whether low and high are values of x.
    shared : whether all panels have the same scales, so that heights compare.
    columns : greatest number of panels side by side.
    ordered : whether a line follows the order of the table, as a loop does, and not that of x.
    dashed : whether each series has dashes, too, so that lines that lie on each other stay visible.
    span : ends of the axis y, at which values beyond them stand; None for the range of the values.
    names : all series, or models if there are any, in the order of their colours and markers; those that are absent
        from the table leave theirs to no other. Empty for those of the table.
    """

    line: bool = True
    log: str = ""
    guides: tuple[Guide, ...] = ()
    across: bool = False
    shared: bool = True
    columns: int = 3
    ordered: bool = False
    dashed: bool = False
    span: tuple[float, float] | None = None
    names: tuple[str, ...] = ()


def plot(title: str, caption: str, data: pd.DataFrame, x: str, y: str, look: Look = Look()) -> Figure:
    """Return points, or lines, over numbers or names; see the module for the columns of the table."""
    import altair as alt

    counted = [name for name in (x, y) if not _is_named(data, name)]
    known = np.isfinite(data[counted].astype(float)).all(axis=1)
    if "failed" in data:
        known |= data["failed"].astype(bool)
    data = data[known].reset_index(drop=True)
    drawn, notes = _thinned(data, y, look)
    if "model" in data and look.line:
        # Vega-Lite joins the legends of scales of one domain, and would show broken markers
        drawn = drawn.assign(dash=drawn["model"] + " ")
    shown = drawn[drawn["drawn"]] if "drawn" in drawn else drawn
    panels = list(dict.fromkeys(data["panel"])) if "panel" in data else []
    columns = 2 if len(panels) == 4 else min(look.columns, len(panels)) or 1
    width = (WIDTH - (14 if look.shared else 60) * (columns - 1)) // columns
    height = (300, 240, 190, 150)[min(columns, 4) - 1]
    base = alt.Chart().encode(
        x=_channel(alt.X, drawn, x, look, max(3, width // 60)),
        y=_channel(alt.Y, drawn, y, look, max(3, height // 45)),
    )
    groups = [name for name in ("panel", y) if name in data]
    side_by_side = _is_named(data, y) and "series" in data and bool(data.duplicated(groups).any())
    if side_by_side:
        base = base.encode(yOffset=alt.YOffset("series:N", sort=None))
    layers = [*_guides(look.guides), *_marks(base, shown, (x, y), look)]
    room: Any = alt.Step(11) if side_by_side else alt.Step(20) if _is_named(data, y) else height
    chart = alt.layer(*layers).properties(width=width, height=room)
    return Figure(title, caption, _faceted(chart, drawn, panels, columns, shared=look.shared), data, notes)


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
    width, height = min(WIDTH / columns - 20, 60.0 * wide), max(120.0, min(300.0, 26.0 * high))
    known = data[value].notna() if _is_named(data, value) else np.isfinite(data[value].astype(float))
    cells, shade = _shaded(data, known, value, edges, colours)
    base = alt.Chart().encode(
        x=alt.X(**_cell_axis(data, x)),
        y=alt.Y(**_cell_axis(data, y, "descending")),
        tooltip=_tooltip(data, [name for name in ("panel", x, y, value) if name in data]),
    )
    solved = base.transform_filter(f"isValid(datum[{value!r}])")
    layers = [solved.mark_rect().encode(color=shade)]
    if "failed" in data:
        layers.append(base.transform_filter("datum.failed").mark_rect(color="#bbbbbb"))
        layers.append(base.transform_filter("datum.failed").mark_text(text="\u00d7", style="label", aria=False))
    if "doubted" in data:
        # in a corner of the cell, beside its number
        dots = base.transform_filter("datum.doubted").mark_circle(
            size=16, opacity=1, stroke="white", strokeWidth=0.8, aria=False
        )
        corner = {"x": alt.X(**_cell_axis(data, x), bandPosition=0.9)}
        corner["y"] = alt.Y(**_cell_axis(data, y, "descending"), bandPosition=0.2)
        layers.append(dots.encode(color=alt.value("#1b1f24"), **corner))
    if not colours and width >= (32 if edges else 44) * wide and height >= 14 * high:
        # both ends of the classes are dark, and the lower half of the gradual colours
        if edges:
            dark = f"datum[{value!r}] < {edges[1]} || datum[{value!r}] >= {edges[-1]}"
        else:
            kind, low, top = _gradual(data.loc[known, value])
            dark = f"datum[{value!r}] < {math.sqrt(low * top) if kind == 'log' else (low + top) / 2}"
        number = alt.Text(field=escaped(value), type="quantitative", format=".2~r" if edges else ".3~r")
        ink = alt.condition(dark, alt.value("white"), alt.value("#1b1f24"))
        layers.append(solved.mark_text(fontSize=11, aria=False).encode(text=number, color=ink))
    chart = alt.layer(*layers).properties(width=width, height=height, view=alt.ViewBackground(strokeOpacity=0))
    notes = [note for name, note in marked.items() if name in data and bool(data[name].any())]
    return Figure(title, caption, _faceted(chart, cells, panels, columns, shared=True), data, tuple(notes))


def spots(
    title: str, caption: str, data: pd.DataFrame, axes: tuple[str, str], value: str, edges: Sequence[float]
) -> Figure:
    """Return points over two axes of numbers, whose colours are the classes of a value."""
    import altair as alt

    known = np.isfinite(data[value].astype(float))
    points, colour = _shaded(data[known], known[known], value, edges)
    x, y = axes
    chart = alt.Chart(points).mark_point(stroke="#555555", strokeWidth=0.6, size=60).encode(
        x=_channel(alt.X, points, x, Look(), 8), y=_channel(alt.Y, points, y, Look(), 6), color=colour,
        tooltip=_tooltip(points, [x, y, value]),
    )  # fmt: skip
    return Figure(title, caption, chart.properties(width=WIDTH * 0.75, height=300), data[known])


def save(path: str | Path, figures: Sequence[Figure], *, notes: Sequence[str] = ()) -> None:
    """Write figures below each other into a picture (PNG), with sentences at its foot."""
    import altair as alt
    import vl_convert
    from PIL import Image

    said = [*notes, *(note for figure in figures for note in figure.notes)]
    lines = [line for note in dict.fromkeys(said) for line in textwrap.wrap(note, 105)]
    charts = [figure.chart.properties(title=figure.title) for figure in figures]
    sheet = alt.vconcat(*charts).resolve_scale(color="independent", shape="independent", strokeDash="independent")
    if lines:
        foot = alt.TitleParams(
            text=lines, orient="bottom", fontSize=11, fontWeight="normal", color="#555555", offset=14
        )
        sheet = sheet.properties(title=foot)
    picture = vl_convert.vegalite_to_png({**_spec(sheet), "config": THEME}, scale=SCALE)
    with atomic(path) as temporary:
        # without transparency, and packed better, it has a quarter of the bytes
        Image.open(io.BytesIO(picture)).convert("RGB").save(temporary, "PNG")


def picture(
    path: str | Path, rows: Iterable[Mapping[str, Any]], draw: Callable[[pd.DataFrame], list[Figure]]
) -> None:
    """Write the figures of the rows of a table into a picture."""
    save(path, draw(table_of(rows)))


def bands(*errors: float) -> tuple[Guide, ...]:
    """Return shades up to plus and minus some errors in %, and the line at zero."""
    return (*(Guide("y", -error, f"\u00b1{error:g} %", to=error) for error in errors), Guide("y", 0.0))


def table_of(rows: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """Return flat rows, such as those of a CSV file, as a table."""
    import pandas as pd

    return pd.DataFrame(list(rows))


def numbers(table: pd.DataFrame, name: str) -> pd.Series:
    """Return a column as numbers: NaN where a cell is empty or a text, or the column is missing."""
    import pandas as pd

    if name not in table:
        return pd.Series(np.nan, index=table.index)
    return pd.to_numeric(table[name], errors="coerce")


def texts(table: pd.DataFrame, name: str) -> pd.Series:
    """Return a column as texts: empty where a cell is, or the column is missing."""
    import pandas as pd

    if name not in table:
        return pd.Series("", index=table.index)
    if table[name].dtype.kind in "iuf":
        return table[name].map("{:g}".format).astype(object).where(table[name].notna(), "")
    return table[name].astype(object).where(table[name].notna(), "").astype(str)


def long(
    table: pd.DataFrame, x: tuple[str, str], y: str, columns: Mapping[str, str], kind: str = "series"
) -> pd.DataFrame:
    """Return the table of a plot of several columns over another one.

    Parameters
    ----------
    x : column of the horizontal axis, and its label.
    columns : label of each column; those that are missing are left out.
    kind : column of the labels, "series" or "panel".
    """
    import pandas as pd

    parts = [
        pd.DataFrame({x[1]: numbers(table, x[0]), y: numbers(table, name), kind: label})
        for name, label in columns.items()
        if name in table
    ]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame({x[1]: [], y: [], kind: []})


def escaped(name: str) -> str:
    """Return the name of a column as a field of Vega-Lite, where dots and brackets have a meaning.

    >>> escaped("gain over that at 0.1 Hz")
    'gain over that at 0\\\\.1 Hz'
    """
    return re.sub(r"([.\[\]'\"\\])", r"\\\1", name)


def short(value: Any) -> str:
    """Return a number to four digits, or a text, as it stands at an axis.

    >>> short(0.123456), short("stick")
    ('0.1235', 'stick')
    """
    return f"{value:.4g}" if isinstance(value, (int, float, np.number)) else str(value)


def _spec(chart: Any) -> dict[str, Any]:
    import altair as alt

    with alt.data_transformers.enable("default", max_rows=None):
        # the tests compare all kinds of figures with Vega-Lite's schema, which takes most of the time
        spec: dict[str, Any] = chart.to_dict(validate=False)
    spec.pop("config", None)
    return spec


def _is_named(data: pd.DataFrame, column: str) -> bool:
    return data[column].dtype.kind not in "fiub"


def _cell_axis(data: pd.DataFrame, name: str, sort: str = "ascending") -> dict[str, Any]:
    import altair as alt

    # cells without a value have a place, too
    values = list(dict.fromkeys(data[name])) if _is_named(data, name) else np.unique(data[name]).tolist()
    texts = {} if _is_named(data, name) else {"labelExpr": "format(datum.value, '~g')"}
    axis = alt.Axis(labelAngle=0, labelOverlap=True, ticks=False, **texts)
    scale = alt.Scale(domain=values if sort == "ascending" else values[::-1])
    return {"field": escaped(name), "type": "ordinal", "scale": scale, "sort": None, "axis": axis, "title": name}


def _shaded(
    data: pd.DataFrame, known: Any, value: str, edges: Sequence[float], colours: Mapping[str, str] = {}
) -> tuple[pd.DataFrame, Any]:
    import altair as alt

    if colours:
        scale = alt.Scale(domain=list(colours), range=list(colours.values()))
        legend = alt.Legend(columns=6, title=value, symbolStrokeColor="#999999", symbolStrokeWidth=1)
        return data, alt.Color(field=escaped(value), type="nominal", scale=scale, legend=legend, sort=None)
    if edges:
        ends = [short(edge).replace("-", "\N{MINUS SIGN}") for edge in edges]
        names = [f"below {ends[0]}", *map(" to ".join, itertools.pairwise(ends)), f"above {ends[-1]}"]
        numbers = np.searchsorted(edges, data[value].astype(float), side="right")
        cells = data.assign(shade=[names[k] if some else None for k, some in zip(numbers, known, strict=True)])
        scale = alt.Scale(domain=names, range=list(ERROR_COLOURS))
        # the class around zero is nearly white
        legend = alt.Legend(columns=5, title=value, symbolStrokeColor="#999999", symbolStrokeWidth=1)
        return cells, alt.Color("shade:N", scale=scale, legend=legend, sort=None)
    kind, low, high = _gradual(data.loc[known, value])
    scale = alt.Scale(type=kind, scheme="cividis", domain=[low, high if high > low else low + (abs(low) or 1.0)])
    legend = alt.Legend(title=value, gradientLength=220)
    return data, alt.Color(field=escaped(value), type="quantitative", scale=scale, legend=legend)


def _gradual(values: pd.Series) -> tuple[Any, float, float]:
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    return "log" if low > 0 and high > WIDE * low else "linear", low, high


def _channel(kind: Any, data: pd.DataFrame, name: str, look: Look, ticks: int) -> Any:
    import altair as alt

    way, field = kind.__name__.lower(), escaped(name)
    if _is_named(data, name):
        title = None if way == "y" else name
        return kind(field=field, type="nominal", sort=None, title=title, axis=alt.Axis(labelLimit=420))
    scale, axis = _numbers(data, name, way, look)
    return kind(field=field, type="quantitative", scale=scale, axis=alt.Axis(tickCount=ticks, **axis), title=name)


def _numbers(data: pd.DataFrame, name: str, way: str, look: Look) -> tuple[Any, dict[str, Any]]:
    import altair as alt

    # pixels that names right of points, and those below guides, need between a value and the frame
    least = 16.0 * any(guide.label for guide in look.guides if guide.axis == "y") if way == "y" else 0.0
    if way == "x" and "label" in data and len(data) <= MOST_LABELS:
        least = 12 + LETTER * max(map(len, data["label"]), default=0)
    if way in look.log:
        return alt.Scale(type="log", nice=False, padding=max(8, least)), {"format": "~g"}
    if way == "y" and look.span:
        return alt.Scale(domain=list(look.span), clamp=True, nice=False, zero=False), {}
    numbers = data[name].to_numpy(dtype=float)
    numbers = np.concatenate([numbers, [guide.at for guide in look.guides if guide.axis == way and guide.to is None]])
    low, high = np.nanmin(numbers, initial=np.inf), np.nanmax(numbers, initial=-np.inf)
    # a range that begins or ends near zero shows the zero
    zero = bool(0 < low < 0.35 * high or 0 > high > 0.35 * low)
    most = max(abs(low), abs(high))
    # d3 writes many zeros before it turns to powers of ten
    powers = {"format": "~e"} if 0 < most < 1e-3 or 1e6 <= most < np.inf else {}
    # a margin below zero would show numbers that no value has
    padding = 0 if way == "y" and (zero or low == 0) else max(9, least if way == "x" else 0)
    return alt.Scale(zero=zero, padding=padding, nice=way == "y"), powers


def _styles(data: pd.DataFrame, look: Look, *, marked: bool) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    """Return the encodings of series by colour, of models by dashes, and of either by markers, if these are seen."""
    import altair as alt

    alone, dash = "model" not in data, None if look.dashed else alt.StrokeDash
    leader = "series" if alone else "model"

    def style(kind: Any, column: str, values: Sequence[Any] = (), *, named: bool = True) -> Any:
        present = [str(name) for name in dict.fromkeys(data[column])]
        first = [f"{name} " if column == "dash" else name for name in look.names if column != "series" or alone]
        names = [*first, *(name for name in present if name not in first)]
        more = {"range": [values[k % len(values)] for k in range(len(names))]} if values else {}
        columns = max(1, int(WIDTH / (LETTER * max(map(len, present), default=1) + 34)))
        # a symbol as long as two dashes tells the patterns apart; markers have their own size
        kept = {"symbolType": "stroke", "symbolSize": 600} if (look.dashed and not marked) or kind is dash else {}
        legend = (
            alt.Legend(columns=columns, values=present, symbolOpacity=1, **kept) if named and any(present) else None
        )
        return kind(field=column, type="nominal", scale=alt.Scale(domain=names, **more), legend=legend, sort=None)

    dashes = style(alt.StrokeDash, "dash", DASHES, named=not marked) if "dash" in data else None
    if look.dashed and "series" in data:
        dashes = style(alt.StrokeDash, "series", DASHES)
    return (
        {"color": style(alt.Color, "series")} if "series" in data else {},
        {"strokeDash": dashes} if dashes is not None else {},
        {"shape": style(alt.Shape, leader, SHAPES)} if leader in data and marked else {},
    )


def _marks(base: Any, data: pd.DataFrame, axes: tuple[str, str], look: Look) -> list[Any]:
    import altair as alt

    x, y = axes
    layers = []
    groups = [name for name in ("panel", "series", "model") if name in data]
    longest = int(data.groupby(groups, sort=False).size().max()) if groups and len(data) else len(data)
    few = longest <= MOST_LINE_MARKS or not look.line
    drawn = base.transform_filter("datum.drawn") if "drawn" in data else base
    colour, dashes, shape = _styles(data, look, marked=few or "joined" in data)
    if "low" in data and look.across:
        layers.append(drawn.mark_rule().encode(x=alt.X("low:Q", title=x), x2="high", **colour))
    elif "low" in data:
        interval = drawn.mark_area(opacity=0.18) if look.line else drawn.mark_rule()
        layers.append(interval.encode(y=alt.Y("low:Q", title=y), y2="high", **colour))
    if look.line:
        line = drawn.transform_filter("datum.joined") if "joined" in data else drawn
        order = {"order": alt.Order("order:Q")} if look.ordered else {}
        layers.append(line.mark_line(clip=True).encode(**colour, **dashes, **order))
    if "limit" in data:
        ends = (
            alt.Chart()
            .transform_filter("isValid(datum.limit)")
            .transform_aggregate(limit="min(limit)", groupby=[name for name in ("series",) if name in data])
        )
        layers.append(
            ends.mark_rule(strokeDash=[2, 3], strokeWidth=1.5, aria=False).encode(
                x=alt.X("limit:Q", title=x), **colour
            )
        )
    columns = ["panel", "point", "series", "model", x, y, "low", "high"]
    tooltip = _tooltip(data, [name for name in columns if name in data])
    points = drawn.transform_filter("!datum.joined") if "joined" in data else drawn
    visible = few or "joined" in data
    filled = points.transform_filter("!datum.open") if "open" in data else points
    layers.append(filled.mark_point(opacity=1 if visible else 0).encode(tooltip=tooltip, **colour, **shape))
    if "open" in data:
        # the legend shows the marks of the first layer
        empty = points.transform_filter("datum.open").mark_point(filled=False, fill="white", strokeWidth=1.6)
        layers.append(empty.encode(tooltip=tooltip, **colour, **shape))
    if "label" in data and len(data) <= MOST_LABELS:
        layers.append(drawn.mark_text(dx=9, align="left", style="label", aria=False).encode(text="label:N"))
    if "failed" in data:
        lost = base.transform_filter("datum.failed").mark_point(shape="cross", angle=45, style="failed")
        layers.append(lost.encode(y=alt.value("height"), **colour))
    return layers


def _guides(guides: Sequence[Guide]) -> list[Any]:
    import altair as alt

    layers: list[Any] = []
    for guide in guides:
        one = alt.Chart(alt.Data(values=[{}]))
        if guide.to is not None:
            ends = {guide.axis: alt.datum(guide.at), f"{guide.axis}2": alt.datum(guide.to)}
            layers.append(one.mark_rect(style="band", aria=False).encode(**ends))
        else:
            layers.append(one.mark_rule(style="guide", aria=False).encode(**{guide.axis: alt.datum(guide.at)}))
        if guide.label:
            where = {"x": alt.datum(guide.at), "y": alt.value(8)}
            if guide.axis == "y":
                end = alt.datum(guide.at if guide.to is None else guide.to)
                where = {"x": alt.value(0 if guide.left else "width"), "y": end}
            right = guide.axis == "y" and not guide.left
            shift = {"dx": -4 if right else 4, "align": "right" if right else "left", "dy": 7 * (guide.axis == "y")}
            layers.append(one.mark_text(text=guide.label, style="guide-label", aria=False, **shift).encode(**where))
    return layers


def _tooltip(data: pd.DataFrame, columns: Sequence[str]) -> list[Any]:
    import altair as alt

    return [
        alt.Tooltip(field=escaped(name), type="nominal", title=name)
        if _is_named(data, name)
        else alt.Tooltip(field=escaped(name), type="quantitative", format=".4~g", title=name)
        for name in columns
    ]


def _faceted(chart: Any, data: pd.DataFrame, panels: Sequence[str], columns: int, *, shared: bool) -> Any:
    import altair as alt

    if len(panels) < 2 and not any(panels):
        return chart.properties(data=data)
    facet = alt.Facet("panel:N", title=None, sort=list(panels))
    chart = chart.facet(data=data, facet=facet, columns=columns)
    if not shared:
        return chart.resolve_scale(x="independent", y="independent")
    # an axis below all columns would stand under a place without a panel, too
    return chart.resolve_axis(x="independent") if len(panels) % columns else chart


def _thinned(data: pd.DataFrame, y: str, look: Look) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return the table with the rows marked that are drawn, if there are too many, and a sentence that says so.

    Points are chosen evenly from each series, the first, the last and the extremes among them. A line without markers
    is one mark however many points it has.
    """
    if look.ordered:
        data = data.assign(order=np.arange(len(data)))
    groups = [name for name in ("panel", "series", "model") if name in data]
    sizes = data.groupby(groups, sort=False).size() if groups and len(data) else np.array([len(data)])
    plain = look.line and int(max(sizes, default=0)) > MOST_LINE_MARKS
    if len(data) <= (MOST_POINTS if plain else MOST_MARKS):
        return data, ()
    share = MOST_MARKS / len(data)
    drawn = np.zeros(len(data), dtype=bool)
    members = data.groupby(groups, sort=False).indices.values() if groups else [np.arange(len(data))]
    numbers = np.arange(len(data)) if _is_named(data, y) else data[y].to_numpy(dtype=float)
    for rows in members:
        count = max(4, math.floor(share * len(rows)))
        drawn[rows[np.linspace(0, len(rows) - 1, min(count - 2, len(rows))).round().astype(int)]] = True
        known = rows[np.isfinite(numbers[rows])]
        if len(known):
            drawn[known[[numbers[known].argmin(), numbers[known].argmax()]]] = True
    note = f"{drawn.sum()} of {len(data)} points are drawn, evenly chosen from each series; the CSV has all of them."
    return data.assign(drawn=drawn), (note,)
