"""Figures: one description, an Altair chart with its table, for the picture of a verb (PNG) and the page of a report.

`plot` draws numbers over numbers or over names, `studies.output.maps` cells of two axes. Both take a table with a row
for each point or cell, whose columns have the names of the axes with their units, such as "depth (mm)", and some of
these:

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
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.arrays import Array
from studies.output.atomic_files import atomic

if TYPE_CHECKING:
    import altair as alt
    import pandas as pd

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Colours of Okabe and Ito, which readers with any colour vision tell apart."""
SHAPES = ("circle", "square", "triangle-up", "diamond", "triangle-down", "cross", "triangle-right")
DASHES = ([1, 0], [7, 4], [2, 3], [8, 3, 2, 3], [12, 4])
WIDTH = 640
"""Width of all panels of a figure, pixels of the page; with its axes a figure fills a column of text."""
HALF = 290
"""Width of all panels of a figure beside another one: both and the axes of the second one have the same width."""
BETWEEN = 60
"""Room between panels whose axes have numbers of their own, pixels."""
MOST_STACKED = 2
"""Number of figures beyond which those of few panels stand side by side in a picture, so that it fits a page."""
SCALE = 2.5
"""Pixels of a picture for each pixel of the page: 250 pixels per inch at a width of 7 in."""
MOST_MARKS = 1200
"""Largest number of marks of a figure: beyond that the pointer finds no single mark and the page becomes slow."""
MOST_POINTS = 20_000
"""Largest number of points of a figure, those of lines without markers included."""
MOST_LINE_MARKS = 40
"""Number of points of a line beyond which its points have no markers of their own."""
WIDE = 30.0
"""Ratio of the greatest to the least value from which the colours of a map are logarithmic."""
MOST_LABELS = 30
"""Number of points beyond which texts beside them would lie on each other."""
SIDES: dict[str, dict[str, Any]] = {
    "right": {"dx": 9, "dy": 0, "align": "left"}, "left": {"dx": -9, "dy": 0, "align": "right"},
    "above": {"dx": 0, "dy": -12, "align": "center"}, "below": {"dx": 0, "dy": 12, "align": "center"},
}  # fmt: skip
"""Places of the label of a point, best first."""
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
    half : makes the chart with half the width, to stand beside another one in a picture; None if it needs all.
    """

    title: str
    caption: str
    chart: alt.TopLevelMixin
    data: pd.DataFrame
    notes: tuple[str, ...] = ()
    source: str = ""
    half: Callable[[], alt.TopLevelMixin] | None = None

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
    bars : whether intervals are bars where lines join the points, too.
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
    bars: bool = False
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Place:
    """Columns of the axes of a plot, and the size of a panel and the width of all, pixels."""

    x: str
    y: str
    width: int
    height: int
    whole: int


def plot(title: str, caption: str, data: pd.DataFrame, x: str, y: str, look: Look = Look()) -> Figure:
    """Return points, or lines, over numbers or names; see the module for the columns of the table."""
    import altair as alt

    counted = [name for name in (x, y) if not is_named(data, name)]
    known = np.isfinite(data[counted].astype(float)).all(axis=1)
    if "failed" in data:
        known |= data["failed"].astype(bool)
    data = data[known].reset_index(drop=True)
    drawn, notes = _thinned(data, y, look)
    notes += _shades(look.guides)
    if "model" in data and look.line:
        # Vega-Lite joins the legends of scales of one domain, and would show broken markers
        drawn = drawn.assign(dash=drawn["model"] + " ")
    shown = drawn[drawn["drawn"]] if "drawn" in drawn else drawn
    panels = list(dict.fromkeys(data["panel"])) if "panel" in data else []
    columns = 2 if len(panels) == 4 else min(look.columns, len(panels)) or 1
    groups = [name for name in ("panel", y) if name in data]
    side_by_side = is_named(data, y) and "series" in data and bool(data.duplicated(groups).any())

    def chart(whole: int = WIDTH) -> Any:
        width = (whole - (14 if look.shared else BETWEEN) * (columns - 1)) // columns
        height = (300, 240, 190, 150)[min(columns, 4) - 1] if whole == WIDTH else 180
        height = height if len(panels) <= columns else min(height, 160)
        base = alt.Chart().encode(
            x=channel(alt.X, drawn, x, look, width, max(3, width // 60)),
            y=channel(alt.Y, drawn, y, look, height, max(3, height // 45)),
        )
        if side_by_side:
            base = base.encode(yOffset=alt.YOffset("series:N", sort=None))
        place = Place(x, y, width, height, whole)
        points = shown
        if "label" in shown and len(shown) <= MOST_LABELS:
            points = shown.assign(side=_sides(shown, place, look))
        layers = [*_guides(points, place, look), *_marks(base, points, place, look)]
        room: Any = alt.Step(11) if side_by_side else alt.Step(20) if is_named(data, y) else height
        made = alt.layer(*layers).properties(width=width, height=room)
        return faceted(made, points if "side" in points else drawn, panels, columns, shared=look.shared)

    half = partial(chart, HALF) if len(panels) <= 2 and look.shared else None
    return Figure(title, caption, chart(), data, notes, half=half)


def save(path: str | Path, figures: Sequence[Figure], *, notes: Sequence[str] = ()) -> None:
    """Write figures into a picture (PNG), many of them in two columns, with sentences at its foot."""
    import altair as alt
    import vl_convert
    from PIL import Image

    said = [*notes, *(note for figure in figures for note in figure.notes)]
    apart: Any = dict.fromkeys(("color", "shape", "strokeDash"), "independent")
    blocks = [
        alt.concat(*(one.half().properties(title=one.title) for one in block if one.half), columns=2)
        .resolve_scale(**apart)
        .properties(spacing={"row": 24, "column": 30})
        if len(block) > 1
        else block[0].chart.properties(title=block[0].title)
        for block in _blocks(figures)
    ]
    sheet = alt.vconcat(*blocks).resolve_scale(**apart)
    if said:
        sheet = sheet.properties(title=foot(said))
    picture = vl_convert.vegalite_to_png({**_spec(sheet), "config": THEME}, scale=SCALE)
    with atomic(path) as temporary:
        # without transparency, and packed better, it has a quarter of the bytes
        Image.open(io.BytesIO(picture)).convert("RGB").save(temporary, "PNG")


def foot(notes: Sequence[str]) -> Any:
    """Return sentences at the foot of a chart, in place of its title, each once."""
    import altair as alt

    lines = [line for note in dict.fromkeys(notes) for line in textwrap.wrap(note, 105)]
    return alt.TitleParams(text=lines, orient="bottom", fontSize=11, fontWeight="normal", color="#555555", offset=14)


def _blocks(figures: Sequence[Figure]) -> list[list[Figure]]:
    """Return the figures of a picture in blocks: of many, those that need half the width form two columns."""
    many = len(figures) > MOST_STACKED
    blocks: list[list[Figure]] = []
    for narrow, group in itertools.groupby(figures, lambda figure: many and figure.half is not None):
        block = list(group)
        blocks += [block] if narrow else [[figure] for figure in block]
    return blocks


def picture(
    path: str | Path, rows: Iterable[Mapping[str, Any]], draw: Callable[[pd.DataFrame], list[Figure]]
) -> None:
    """Write the figures of the rows of a table into a picture."""
    save(path, draw(table_of(rows)))


def bands(*errors: float) -> tuple[Guide, ...]:
    """Return shades up to plus and minus some errors in %, which a note of the figure names, and the line at zero."""
    return (*(Guide("y", -error, to=error) for error in sorted(errors, reverse=True)), Guide("y", 0.0))


def _shades(guides: Sequence[Guide]) -> tuple[str, ...]:
    """Return the sentence on shades of errors: labels in the panels would lie on the data and on each other."""
    ends = sorted(guide.to for guide in guides if guide.to is not None and guide.at == -guide.to and not guide.label)
    return (f"Shades: errors within {' and '.join(f'{end:g}' for end in ends)} %.",) if ends else ()


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


def is_named(data: pd.DataFrame, column: str) -> bool:
    return data[column].dtype.kind not in "fiub"


def wrapped(title: str, size: float) -> str | list[str]:
    """Return the title of an axis, or its lines if it is longer than the axis, pixels, and would lie on others."""
    lines = textwrap.wrap(title, max(12, int(size / LETTER)))
    return lines if len(lines) > 1 else title


def channel(kind: Any, data: pd.DataFrame, name: str, look: Look, size: float, ticks: int) -> Any:
    """Return the channel of an axis, `size` pixels long, with about so many ticks."""
    import altair as alt

    way, field = kind.__name__.lower(), escaped(name)
    if is_named(data, name):
        title = None if way == "y" else wrapped(name, size)
        return kind(field=field, type="nominal", sort=None, title=title, axis=alt.Axis(labelLimit=420))
    scale, axis = _numbers(data, name, way, look)
    return kind(
        field=field,
        type="quantitative",
        scale=scale,
        axis=alt.Axis(tickCount=ticks, **axis),
        title=wrapped(name, size),
    )


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


def _styles(
    data: pd.DataFrame, look: Look, whole: int, *, marked: bool
) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    """Return the encodings of series by colour, of models by dashes, and of either by markers, if these are seen."""
    import altair as alt

    alone, dash = "model" not in data, None if look.dashed else alt.StrokeDash
    leader = "series" if alone else "model"

    def style(kind: Any, column: str, values: Sequence[Any] = (), *, named: bool = True) -> Any:
        present = [str(name) for name in dict.fromkeys(data[column])]
        first = [f"{name} " if column == "dash" else name for name in look.names if column != "series" or alone]
        names = [*first, *(name for name in present if name not in first)]
        more = {"range": [values[k % len(values)] for k in range(len(names))]} if values else {}
        columns = max(1, int(whole / (LETTER * max(map(len, present), default=1) + 34)))
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


def _marks(base: Any, data: pd.DataFrame, place: Place, look: Look) -> list[Any]:
    import altair as alt

    x, y = place.x, place.y
    layers = []
    groups = [name for name in ("panel", "series", "model") if name in data]
    longest = int(data.groupby(groups, sort=False).size().max()) if groups and len(data) else len(data)
    few = longest <= MOST_LINE_MARKS or not look.line
    drawn = base.transform_filter("datum.drawn") if "drawn" in data else base
    colour, dashes, shape = _styles(data, look, place.whole, marked=few or "joined" in data)
    if "low" in data and look.across:
        layers.append(drawn.mark_rule().encode(x=alt.X("low:Q", title=wrapped(x, place.width)), x2="high", **colour))
    elif "low" in data:
        interval = drawn.mark_area(opacity=0.18) if look.line and not look.bars else drawn.mark_rule()
        layers.append(interval.encode(y=alt.Y("low:Q", title=wrapped(y, place.height)), y2="high", **colour))
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
                x=alt.X("limit:Q", title=wrapped(x, place.width)), **colour
            )
        )
    columns = ["panel", "point", "series", "model", x, y, "low", "high"]
    tooltip = readout(data, [name for name in columns if name in data])
    points = drawn.transform_filter("!datum.joined") if "joined" in data else drawn
    visible = few or "joined" in data
    filled = points.transform_filter("!datum.open") if "open" in data else points
    layers.append(filled.mark_point(opacity=1 if visible else 0).encode(tooltip=tooltip, **colour, **shape))
    if "open" in data:
        # the legend shows the marks of the first layer
        empty = points.transform_filter("datum.open").mark_point(filled=False, fill="white", strokeWidth=1.6)
        layers.append(empty.encode(tooltip=tooltip, **colour, **shape))
    if "label" in data and len(data) <= MOST_LABELS:
        for side in filter(None, dict.fromkeys(data["side"])):
            named = drawn.transform_filter(f"datum.side == {side!r}")
            layers.append(named.mark_text(style="label", aria=False, **SIDES[side]).encode(text="label:N"))
    if "failed" in data:
        lost = base.transform_filter("datum.failed").mark_point(shape="cross", angle=45, style="failed")
        layers.append(lost.encode(y=alt.value("height"), **colour))
    return layers


def _fractions(values: Array, *, log: bool) -> Array:
    """Return where values lie on an axis, from about 0 at its beginning to about 1 at its end."""
    values = np.log(np.where(values > 0, values, np.nan)) if log else values
    low, high = np.nanmin(values, initial=np.inf), np.nanmax(values, initial=-np.inf)
    return np.asarray((values - low) / (high - low if high > low else 1.0))


def _sides(data: pd.DataFrame, place: Place, look: Look) -> list[str]:
    """Return on which side of its point each label stands; "" for one that would lie on others on every side."""
    numbers = (data[name].to_numpy(dtype=float) for name in (place.x, place.y))
    x, y = (_fractions(values, log=way in look.log) for way, values in zip("xy", numbers, strict=True))
    across, up = x * place.width, (1 - y) * place.height
    panels = data["panel"] if "panel" in data else np.zeros(len(data))
    taken = [(panel, a - 5, b - 5, a + 5, b + 5) for panel, a, b in zip(panels, across, up, strict=True)]
    sides = []
    for panel, a, b, label in zip(panels, across, up, data["label"], strict=True):
        chosen = ""
        for side, how in SIDES.items() if label else ():
            wide = LETTER * len(label)
            left = a + how["dx"] - {"left": 0.0, "right": wide, "center": wide / 2}[how["align"]]
            box = (left, b + how["dy"] - 6, left + wide, b + how["dy"] + 6)
            # beside the points there is room for the longest label
            inside = side in ("left", "right") or (box[1] > 0 and box[3] < place.height)
            if inside and not any(
                panel == other and box[0] < c and box[2] > o and box[1] < d and box[3] > p
                for other, o, p, c, d in taken
            ):
                taken.append((panel, *box))
                chosen = side
                break
        sides.append(chosen)
    return sides


def _guides(data: pd.DataFrame, place: Place, look: Look) -> list[Any]:
    import altair as alt

    layers: list[Any] = []
    for guide in look.guides:
        one = alt.Chart(alt.Data(values=[{}]))
        if guide.to is not None:
            ends = {guide.axis: alt.datum(guide.at), f"{guide.axis}2": alt.datum(guide.to)}
            layers.append(one.mark_rect(style="band", aria=False).encode(**ends))
        else:
            layers.append(one.mark_rule(style="guide", aria=False).encode(**{guide.axis: alt.datum(guide.at)}))
        if guide.label:
            # above the frame, where no data are
            where = {"x": alt.datum(guide.at), "y": alt.value(-7)}
            if guide.axis == "y":
                end = alt.datum(guide.at if guide.to is None else guide.to)
                where = {"x": alt.value(0 if guide.left else "width"), "y": end}
            right = not guide.left
            if guide.axis == "x":
                # a label right of a line near the right end would leave the frame
                reach = np.append(data[place.x].to_numpy(dtype=float), guide.at)
                share = _fractions(reach, log="x" in look.log)[-1]
                right = share * place.width + LETTER * len(guide.label) > place.width
            shift = {"dx": -4 if right else 4, "align": "right" if right else "left", "dy": 7 * (guide.axis == "y")}
            layers.append(one.mark_text(text=guide.label, style="guide-label", aria=False, **shift).encode(**where))
    return layers


def readout(data: pd.DataFrame, columns: Sequence[str]) -> list[Any]:
    import altair as alt

    return [
        alt.Tooltip(field=escaped(name), type="nominal", title=name)
        if is_named(data, name)
        else alt.Tooltip(field=escaped(name), type="quantitative", format=".4~g", title=name)
        for name in columns
    ]


def faceted(chart: Any, data: pd.DataFrame, panels: Sequence[str], columns: int, *, shared: bool) -> Any:
    import altair as alt

    if len(panels) < 2 and not any(panels):
        return chart.properties(data=data)
    facet = alt.Facet("panel:N", title=None, sort=list(panels))
    # without the room of their axes, which differ, panels stand in line
    room: Any = {} if shared else {"bounds": "flush", "spacing": {"row": 84, "column": BETWEEN}}
    chart = chart.facet(data=data, facet=facet, columns=columns, **room)
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
    numbers = np.arange(len(data)) if is_named(data, y) else data[y].to_numpy(dtype=float)
    for rows in members:
        count = max(4, math.floor(share * len(rows)))
        drawn[rows[np.linspace(0, len(rows) - 1, min(count - 2, len(rows))).round().astype(int)]] = True
        known = rows[np.isfinite(numbers[rows])]
        if len(known):
            drawn[known[[numbers[known].argmin(), numbers[known].argmax()]]] = True
    note = (
        f"{drawn.sum()} of {len(data)} points are drawn, evenly chosen from each series; the table has all of them."
    )
    return data.assign(drawn=drawn), (note,)
