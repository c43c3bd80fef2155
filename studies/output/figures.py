"""Figures: Altair charts in the look of magtip, with their table, for the picture of a verb and the page of a report.

A figure is a chart as Altair's gallery writes it, of a table whose columns have the names of the axes with their
units, such as "depth (mm)". The look is one theme, `THEME`. `styles` tells series apart by colour, marker and dashes,
`rule` and `bands` are layers that mark values of an axis, `panels` makes panels. What depends on the room (sizes,
ticks, lines of titles, columns of legends) `Figure.spec` fits when a figure is written; `save` writes pictures.
"""

from __future__ import annotations

import io
import itertools
import math
import re
import textwrap
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

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
RANGES: dict[str, Sequence[Any]] = {"color": COLOURS, "shape": SHAPES, "strokeDash": DASHES}
"""What tells series apart, by Vega-Lite's names of the channels."""
CROSS = "M-1,-1L1,1M-1,1L1,-1"
"""Marker of a case without an answer, as a path."""
STRETCH = "M-1.6,-0.25L1.6,-0.25L1.6,0.25L-1.6,0.25Z"
"""What stands in the legend for a line without markers, as a path."""
LOG: dict[str, Any] = {"scale": {"type": "log", "nice": False, "padding": 12}, "axis": {"format": "~g"}}
"""Scale and axis of a logarithmic channel: `alt.X("cost (s)", **LOG)`."""
FREE: dict[str, Any] = {"scale": {"zero": False, "nice": False, "padding": 12}}
"""Scale of a channel that does not begin at zero, with room between the outermost points and the frame."""
POWERS = (
    "datum.value && (abs(datum.value) < 1e-4 || abs(datum.value) >= 1e6) ? format(datum.value, '~e') : datum.label"
)
"""Label of an axis, as Vega's expression: d3 writes many zeros before it turns to powers of ten."""
WIDTH = 640
"""Width of all panels of a figure, pixels of the page; with its axes a figure fills a column of text."""
HALF = 290
"""Width of all panels of a figure beside another one: both and the axes of the second one have the same width."""
HEIGHTS = (300, 240, 190, 150)
"""Heights of panels of which one, two, three, or more stand side by side, pixels."""
LOW = 180
"""Height of a figure of half the width, pixels."""
LOWEST = 160
"""Greatest height of panels that stand in several rows, pixels."""
TICKS = {"x": 60, "y": 45}
"""Least room between ticks, pixels."""
BETWEEN = {"row": 84, "column": 60}
"""Room between panels that have axes of their own, pixels."""
BELOW: dict[str, Any] = {"labelAnchor": "middle", "labelFontWeight": "normal", "labelFontSize": 13, "labelPadding": 4}
"""Look of the names of panels that are titles of their axes."""
MOST_STACKED = 2
"""Number of figures beyond which those of few panels stand side by side in a picture, so that it fits a page."""
SCALE = 2.5
"""Pixels of a picture for each pixel of the page: 250 pixels per inch at a width of 7 in."""
MOST_LINE_MARKS = 40
"""Number of points of a line beyond which its points have no markers of their own."""
MOST_MARKS = 1200
"""Largest number of marks of a figure: beyond that the pointer finds no single mark and the page becomes slow."""
LETTER = 6.6
"""Mean width of a letter of the legend, pixels."""
THEME: dict[str, Any] = {
    "background": "white",
    "font": "Liberation Sans, Arial, sans-serif",
    "view": {"stroke": "#888888"},
    "range": {"category": list(COLOURS), "symbol": list(SHAPES)},
    "axis": {
        "gridColor": "#e4e4e4", "domain": False, "tickColor": "#888888", "labelFontSize": 12, "titleFontSize": 13,
        "titleFontWeight": "normal", "labelLimit": 420, "titleLimit": 400,
    },
    "axisQuantitative": {"grid": True, "labelExpr": POWERS},
    "legend": {
        "orient": "top", "title": None, "labelFontSize": 12, "titleFontSize": 12, "titleFontWeight": "normal",
        "labelLimit": 560, "titleLimit": 400, "symbolStrokeWidth": 2, "symbolSize": 70, "symbolOpacity": 1,
    },
    "header": {"labelFontSize": 12, "labelFontWeight": "bold", "labelAnchor": "start", "labelLimit": 620},
    "title": {"anchor": "start", "fontSize": 13, "subtitleFontSize": 12},
    "concat": {"spacing": 24},
    "facet": {"spacing": 14},
    "line": {"strokeWidth": 2, "strokeJoin": "round", "color": COLOURS[0]},
    "point": {"filled": True, "size": 50, "opacity": 1, "color": COLOURS[0]},
    "tooltipFormat": {"numberFormat": ".4~g"},
    "style": {
        "guide": {"color": "#666666", "strokeDash": [3, 3]},
        "guide-label": {"color": "#555555", "fontSize": 11},
        "band": {"color": "#000000", "opacity": 0.07},
        "failed": {"color": "#555555", "size": 60},
        "label": {"color": "#333333", "fontSize": 11},
    },
}  # fmt: skip
"""Vega-Lite's configuration of all figures; the page of a report takes its colours from its own style."""
FLAGS = ("failed", "open", "doubted", "joined", "drawn", "limit", "label", "side", "order")
"""Columns of tables that say how a point is drawn, and are not read off."""


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure with everything that a page says about it.

    caption : what is seen, in sentences.
    chart : without a width, which is that of the page, or with the greatest one that it needs.
    data : all numbers of the figure; the chart may draw fewer, which a note says.
    source : name of the file that holds its numbers.
    wide : whether it needs the whole width of a picture.
    """

    title: str
    caption: str
    chart: alt.TopLevelMixin
    data: pd.DataFrame
    notes: tuple[str, ...] = ()
    source: str = ""
    wide: bool = False

    def spec(self, whole: int = WIDTH) -> dict[str, Any]:
        """Return the figure in the language of Vega-Lite, `whole` pixels wide, without title and theme."""
        import altair as alt

        with alt.data_transformers.enable("default", max_rows=None):
            # the tests compare all kinds of figures with Vega-Lite's schema, which takes most of the time
            spec: dict[str, Any] = self.chart.to_dict(validate=False)
        spec.pop("config", None)
        return _fitted(spec, self.data, whole)

    @property
    def narrow(self) -> bool:
        """Whether the figure may stand beside another one: it has few panels, and these share their axes."""
        import altair as alt

        if not isinstance(self.chart, alt.FacetChart):
            return not self.wide
        return not self.wide and self.chart["spacing"] is alt.Undefined and len(self.chart["facet"]["sort"]) <= 2


def save(path: str | Path, figures: Sequence[Figure], *, notes: Sequence[str] = ()) -> None:
    """Write figures into a picture (PNG), many of them in two columns, with sentences at its foot."""
    import vl_convert
    from PIL import Image

    said = [*notes, *(note for figure in figures for note in figure.notes)]
    sheet: dict[str, Any] = {"vconcat": [], "resolve": APART, "datasets": {}}
    many = len(figures) > MOST_STACKED
    for narrow, group in itertools.groupby(figures, lambda figure: many and figure.narrow):
        drawn = [figure.spec(HALF if narrow else WIDTH) | {"title": figure.title} for figure in group]
        for spec in drawn:
            sheet["datasets"] |= spec.pop("datasets")
        pairs = {"concat": drawn, "columns": 2, "spacing": {"row": 24, "column": 30}, "resolve": APART}
        sheet["vconcat"] += [pairs] if narrow and len(drawn) > 1 else drawn
    if said:
        sheet["title"] = foot(said)
    picture = vl_convert.vegalite_to_png({**sheet, "config": THEME}, scale=SCALE)
    with atomic(path) as temporary:
        # without transparency, and packed better, it has a quarter of the bytes
        Image.open(io.BytesIO(picture)).convert("RGB").save(temporary, "PNG")


def picture(
    path: str | Path, rows: Iterable[Mapping[str, Any]], draw: Callable[[pd.DataFrame], list[Figure]]
) -> None:
    """Write the figures of the rows of a table into a picture."""
    save(path, draw(table_of(rows)))


def foot(notes: Sequence[str]) -> dict[str, Any]:
    """Return sentences at the foot of a chart, in place of its title, each once."""
    lines = [line for note in dict.fromkeys(notes) for line in textwrap.wrap(note, 105)]
    look = {"fontSize": 11, "fontWeight": "normal", "color": "#555555", "offset": 14}
    return {"text": lines, "orient": "bottom", **look}


# Parts of charts


def styles(
    names: Iterable[str], *channels: str, column: str = "series", lines: Collection[str] = ()
) -> dict[str, Any]:
    """Return the channels that tell the series of a column apart, with one legend.

    Parameters
    ----------
    names : all series in the order of their styles; those that are absent from the table leave theirs to no other.
    channels : names of channels; none for colour and marker, "color" and "strokeDash" for lines without markers.
    lines : series that are lines without markers beside others with markers.
    """
    import altair as alt

    domain = list(dict.fromkeys(map(str, names)))
    kinds = {"color": alt.Color, "shape": alt.Shape, "strokeDash": alt.StrokeDash}
    # a symbol as long as two dashes tells the patterns apart; markers have their own size
    dashed = "strokeDash" in channels and "shape" not in channels
    legend = {"symbolType": "stroke", "symbolSize": 600} if dashed else {}
    made = {}
    for channel in channels or ("color", "shape"):
        looks = [RANGES[channel][k % len(RANGES[channel])] for k in range(len(domain))]
        if channel == "shape":
            looks = [STRETCH if name in lines else look for name, look in zip(domain, looks, strict=True)]
        scale, shown = alt.Scale(domain=domain, range=looks), alt.Legend(columns=_legend_columns(domain), **legend)
        made[channel] = kinds[channel](column, type="nominal", sort=None, scale=scale, legend=shown)
    return made


def by_model(names: Iterable[str]) -> dict[str, Any]:
    """Return the channels that tell the models of a column "model" apart where colours stand for something else."""
    names = list(dict.fromkeys(names))
    dashes = styles([*names, ""], "strokeDash", column="model")["strokeDash"]
    # with the domain of the markers the dashes would join their legend, and break the markers in it
    return styles(names, "shape", column="model") | {"strokeDash": dashes.legend(None)}


def markers(data: pd.DataFrame) -> bool | str:
    """Return the `point` of a line: markers, or transparent ones to be read off where a series has many points."""
    groups = [name for name in ("panel", "series", "model") if name in data]
    longest = data.groupby(groups, sort=False).size().max() if groups and len(data) else len(data)
    return True if longest <= MOST_LINE_MARKS else "transparent"


def rule(axis: str, at: float, label: str = "", *, left: bool = False) -> list[alt.Chart]:
    """Return the layers of a dashed line at a value of an axis, "x" or "y"; `left` places the label of one across."""
    import altair as alt

    one = alt.Chart(alt.Data(values=[{}]))
    layers = [one.mark_rule(style="guide", aria=False).encode(**{axis: alt.datum(at)})]
    if label and axis == "x":
        # above the frame, where no data are
        text = one.mark_text(text=label, style="guide-label", aria=False)
        layers.append(text.encode(x=alt.datum(at), y=alt.value(-7)))
    elif label:
        place = {"align": "left", "dx": 4} if left else {"align": "right", "dx": -4}
        text = one.mark_text(text=label, style="guide-label", aria=False, dy=7, **place)
        layers.append(text.encode(x=alt.value(0 if left else "width"), y=alt.datum(at)))
    return layers


SHADES = "Shades: errors within 5 and 10 %."
"""What `bands` are: labels in the panels would lie on the data and on each other."""


def bands() -> list[alt.Chart]:
    """Return the layers of shades up to errors of plus and minus 10 and 5 %, and of the line at zero."""
    import altair as alt

    one = alt.Chart(alt.Data(values=[{}])).mark_rect(style="band", aria=False)
    return [*(one.encode(y=alt.datum(-end), y2=alt.datum(end)) for end in (10.0, 5.0)), *rule("y", 0.0)]


def panels(
    chart: alt.Chart | alt.LayerChart, data: pd.DataFrame, columns: int = 3, *, own: Literal["", "x", "xy"] = ""
) -> Any:
    """Return a chart without data with those of a table, in panels if it has a column "panel".

    Parameters
    ----------
    columns : greatest number of panels side by side.
    own : axes of which each panel has its own scale; others compare. With "x" each panel is over an axis of its own.
    """
    import altair as alt

    names = list(dict.fromkeys(data["panel"])) if "panel" in data else []
    if len(names) < 2 and not any(names):
        return chart.properties(data=data)
    columns = 2 if len(names) == 4 else min(columns, len(names))
    facet = alt.Facet("panel", type="nominal", title=None, sort=names)
    if own:
        # without the room of their axes, which differ, panels stand in line
        spacing = BETWEEN
        if own == "x":
            # what the panels are over stands below them, as titles of their axes
            facet.header = alt.Header(labelOrient="bottom", **BELOW)
            spacing = BETWEEN | {"column": THEME["facet"]["spacing"]}
        made = chart.facet(data=data, facet=facet, columns=columns, bounds="flush", spacing=spacing)
        return made.resolve_scale(**dict.fromkeys(own, "independent"))
    made = chart.facet(data=data, facet=facet, columns=columns)
    # an axis below all columns would stand under a place without a panel, too
    return made.resolve_axis(x="independent") if len(names) % columns else made


def readout(data: pd.DataFrame) -> list[dict[str, str]]:
    """Return what the pointer reads off a mark: the columns of a table without its flags, names first."""
    first = [name for name in ("panel", "point", "series", "model") if name in data]
    names = [*first, *(name for name in data if name not in (*first, *FLAGS))]
    kinds = {name: "nominal" if is_named(data, name) else "quantitative" for name in names}
    return [{"field": escaped(name), "type": kind, "title": name} for name, kind in kinds.items()]


def thinned(data: pd.DataFrame, y: str) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return a table with a flag of the rows that are `drawn`, and a sentence if these are not all.

    Points are chosen evenly from each series of each panel, the first, the last and the extremes among them.
    """
    drawn = np.ones(len(data), dtype=bool)
    if len(data) <= MOST_MARKS:
        return data.assign(drawn=drawn), ()
    drawn[:] = False
    groups = [name for name in ("panel", "series", "model") if name in data]
    members = data.groupby(groups, sort=False).indices.values() if groups else [np.arange(len(data))]
    values = data[y].to_numpy(dtype=float)
    for rows in members:
        count = max(2, int(MOST_MARKS * len(rows) / len(data)) - 2)
        drawn[rows[np.linspace(0, len(rows) - 1, min(count, len(rows))).round().astype(int)]] = True
        known = rows[np.isfinite(values[rows])]
        if len(known):
            drawn[known[[values[known].argmin(), values[known].argmax()]]] = True
    note = (
        f"{drawn.sum()} of {len(data)} points are drawn, evenly chosen from each series; the table has all of them."
    )
    return data.assign(drawn=drawn), (note,)


SIDES: dict[str, dict[str, Any]] = {
    "right": {"dx": 9, "dy": 0, "align": "left"}, "left": {"dx": -9, "dy": 0, "align": "right"},
    "above": {"dx": 0, "dy": -12, "align": "center"}, "below": {"dx": 0, "dy": 12, "align": "center"},
}  # fmt: skip
"""Places of the label of a point, best first."""


def beside(data: pd.DataFrame, x: str, y: str, log: str = "") -> pd.DataFrame:
    """Return a table with the `side` of its point where each "label" covers no other one; "" if there is none.

    Figures of half the width are judged, whose room is least; `log` names the axes that are logarithmic. Bars from
    the points to a column "high" are not covered either.
    """
    ends = data["high"] if "high" in data else data[y]
    across = _places(data[x].to_numpy(dtype=float), HALF, log="x" in log)
    up, top = np.split(_places(np.concatenate([data[y], ends]), LOWEST, log="y" in log), 2)
    panel = data["panel"].tolist() if "panel" in data else [""] * len(data)
    taken = [(k, a - 5, b - 5, a + 5, b + 5) for k, a, b in zip(panel, across, up, strict=True)]
    taken += [(k, a - 1, b, a + 1, c) for k, a, b, c in zip(panel, across, up, top, strict=True)]
    sides = []
    for k, a, b, label in zip(panel, across, up, data["label"], strict=True):
        chosen = ""
        for side, how in SIDES.items() if label else ():
            wide = LETTER * len(label)
            left = a + how["dx"] - {"left": 0.0, "right": wide, "center": wide / 2}[how["align"]]
            box = (k, left, b - how["dy"] - 6, left + wide, b - how["dy"] + 6)
            inside = box[1] > 0 and box[3] < HALF and box[2] > 0 and box[4] < LOWEST
            if inside and not any(
                k == other and box[1] < c and box[3] > o and box[2] < d and box[4] > p for other, o, p, c, d in taken
            ):
                taken.append(box)
                chosen = side
                break
        sides.append(chosen)
    return data.assign(side=sides)


def _places(values: Array, size: float, *, log: bool) -> Array:
    """Return where values lie on an axis, pixels from its beginning."""
    values = np.log(np.where(values > 0, values, np.nan)) if log else values
    low, high = np.nanmin(values, initial=np.inf), np.nanmax(values, initial=-np.inf)
    rim = FREE["scale"]["padding"]
    return np.asarray(rim + (size - 2 * rim) * (values - low) / (high - low if high > low else 1.0))


def labels(base: alt.Chart) -> list[alt.Chart]:
    """Return the layers of the labels that `beside` has placed, over the axes of a chart without a mark."""
    return [
        base.transform_filter(f"datum.side == {side!r}")
        .mark_text(style="label", aria=False, **how)
        .encode(text="label:N")
        for side, how in SIDES.items()
    ]


def is_named(data: pd.DataFrame, column: str) -> bool:
    return data[column].dtype.kind not in "fiub"


# What depends on the room


APART = {"scale": dict.fromkeys(RANGES, "independent")}
"""Figures of a picture have legends of their own."""


def _fitted(spec: dict[str, Any], data: pd.DataFrame, whole: int) -> dict[str, Any]:
    """Return a description with what is read off, and what fits a width, pixels: sizes, titles of axes, legends."""
    view, names = spec.get("spec", spec), spec.get("facet", {}).get("sort", [])
    columns = spec.get("columns", 1) if names else 1
    gap = spec.get("spacing", {}).get("column", THEME["facet"]["spacing"])
    width = view["width"] = min(view.get("width", math.inf), (whole - gap * (columns - 1)) // columns)
    height = HEIGHTS[min(columns, len(HEIGHTS)) - 1] if whole == WIDTH else LOW
    height = min(height, LOWEST) if len(names) > columns else height
    parts = list(_units(view))
    named = any(part.get("encoding", {}).get("y", {}).get("type") == "nominal" for part in parts)
    if "height" not in view and not named:
        view["height"] = height
    elif isinstance(view.get("height"), (int, float)) and whole < WIDTH:
        view["height"] = min(view["height"], height)
    for part in parts:
        if _is_read(part.get("mark", {})):
            part["encoding"].setdefault("tooltip", readout(data))
        for way, channel in part.get("encoding", {}).items():
            if way in ("x", "y") and "field" in channel:
                _fit_axis(way, channel, width if way == "x" else height)
            elif way in RANGES and channel.get("type") == "nominal" and channel.get("legend", {}) is not None:
                channel["legend"] = _fitted_legend(channel, data, whole)
    return spec


def _units(view: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield a description and all its layers."""
    yield view
    for layer in view.get("layer", ()):
        yield from _units(layer)


def _is_read(mark: dict[str, Any]) -> bool:
    """Return whether a mark is a point, a cell or a line with points, and has a value."""
    kind = mark.get("type") in ("point", "rect") or "point" in mark
    return kind and mark.get("aria", True) and mark.get("style") != "failed"


def _fit_axis(way: str, channel: dict[str, Any], size: float) -> None:
    """Give an axis as many ticks as fit, and lines of a title longer than it; names along y stand for themselves."""
    named = way == "y" and channel["type"] == "nominal"
    title = channel.setdefault("title", None if named else re.sub(r"\\(.)", r"\1", channel["field"]))
    if isinstance(title, str):
        lines = textwrap.wrap(title, max(12, int(size / LETTER)))
        channel["title"] = lines if len(lines) > 1 else title
    if channel["type"] == "quantitative":
        channel["axis"] = {"tickCount": max(3, int(size / TICKS[way]))} | channel.get("axis", {})


def _fitted_legend(channel: dict[str, Any], data: pd.DataFrame, whole: int) -> dict[str, Any] | None:
    """Return the legend of names, those that the table has, in as many columns as fit; None without any."""
    names = list(channel.get("scale", {}).get("domain", ()))
    if channel["field"] in data:
        present = list(dict.fromkeys(data[channel["field"]]))
        names = [name for name in names if name in present] if names else present
    if not any(names):
        return None
    return {"values": names, **channel.get("legend", {}), "columns": _legend_columns(names, whole)}


def _legend_columns(names: Collection[Any], whole: int = WIDTH) -> int:
    """Return the number of columns in which names are not cut off."""
    return max(1, int(whole / (LETTER * max((len(str(name)) for name in names), default=1) + 34)))


# Tables of figures


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
    table: pd.DataFrame, x: tuple[str, str], y: str, columns: Mapping[str, str], kind: str = "series", **more: Any
) -> pd.DataFrame:
    """Return the table of a plot of several columns over another one, rows that have both numbers.

    Parameters
    ----------
    x : column of the horizontal axis, and its label.
    columns : label of each column; those that are missing are left out.
    kind : column of the labels, "series" or "panel".
    more : further columns, each a name or values of all rows.
    """
    import pandas as pd

    parts = [
        pd.DataFrame({x[1]: numbers(table, x[0]), y: numbers(table, name), kind: label, **more})
        for name, label in columns.items()
        if name in table
    ]
    if not parts:
        return pd.DataFrame({name: [] for name in (x[1], y, kind, *more)})
    return pd.concat(parts).dropna(subset=[x[1], y]).reset_index(drop=True)


def escaped(name: str) -> str:
    """Return the name of a column as a field of Vega-Lite, where dots and brackets have a meaning.

    >>> escaped("gain over that at 0.1 Hz")
    'gain over that at 0\\\\.1 Hz'
    """
    return re.sub(r"([.\[\]'\"\\])", r"\\\1", name)
