"""Curves of answers over an axis, as layers of an Altair chart: for the figures of a sweep and for `magtip.plot`.

Columns of the table beside those of the axes, if there are some:

- series: what has colours and, without `model`, markers; model: what has markers and dashes;
- low, high: interval of a point, a bar, or a band behind a line;
- failed: whether the case has no answer: a cross at the lower edge;
- open: whether the marker is open, for a state that is doubted;
- limit: where on x a dotted line of the series stands; drawn: whether the point is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from geometry.arrays import Array
from studies.output.figures import (
    CROSS,
    FREE,
    HALF,
    LETTER,
    LOG,
    by_model,
    escaped,
    is_named,
    markers,
    readout,
    styles,
)

if TYPE_CHECKING:
    import altair as alt
    import pandas as pd

NEAR = 0.35
"""Ratio of the ends of a range up to which its axis shows the zero."""


class Axes(NamedTuple):
    """How curves are drawn.

    line : whether lines join the points.
    log : axes with a logarithmic scale: "", "x", "y" or "xy".
    span : ends of the vertical axis, at which values beyond them stand; None for the range of the values.
    bars : whether intervals are bars where lines join the points, too.
    titled : whether the horizontal axis has a title; panels over axes of their own are titled by these.
    """

    line: bool = True
    log: str = ""
    span: tuple[float, float] | None = None
    bars: bool = False
    titled: bool = True


def drawable(data: pd.DataFrame, x: str, y: str) -> pd.DataFrame:
    """Return the rows that have both coordinates, or failed."""
    known = data[x].notna() & data[y].notna()
    return data[known | data["failed"] if "failed" in data else known].reset_index(drop=True)


def curves(data: pd.DataFrame, x: str, y: str, how: Axes = Axes(), names: Sequence[str] = ()) -> list[alt.Chart]:
    """Return the layers of answers over an axis, without their data.

    Parameters
    ----------
    names : all models, or series without models, in the order of their styles; empty for those of the table.
    """
    import altair as alt

    across = alt.X(escaped(x), title=x if how.titled else None, **_across(data[x], how, named=is_named(data, x)))
    up = alt.Y(escaped(y), title=y, type="quantitative", **_up(data[y], how))
    base, looks = alt.Chart().encode(x=across, y=up), _looks(data, names)
    colour = {"color": looks["color"]} if "color" in looks else {}
    layers = []
    if "low" in data:
        interval = base.mark_area(opacity=0.18) if how.line and not how.bars else base.mark_rule()
        # models of one colour have shades of their own
        of_model = {"detail": "model:N"} if "model" in data else {}
        layers.append(interval.encode(y=alt.Y("low:Q", title=y), y2="high:Q", **colour, **of_model))
    if how.line:
        layers.append(base.mark_line(clip=True).encode(**{k: looks[k] for k in looks if k != "shape"}))
    if "limit" in data:
        ends = alt.Chart().transform_filter("isValid(datum.limit)")
        ends = ends.transform_aggregate(limit="min(limit)", groupby=[name for name in ("series",) if name in data])
        dotted = ends.mark_rule(strokeDash=[2, 3], strokeWidth=1.5, aria=False)
        layers.append(dotted.encode(x=alt.X("limit:Q", title=x), **colour))
    points = base.transform_filter("datum.drawn") if "drawn" in data else base
    points = points.encode(
        **{k: looks[k] for k in looks if k != "strokeDash"}, tooltip=[alt.Tooltip(**one) for one in readout(data)]
    )
    filled = points.transform_filter("!datum.open") if "open" in data else points
    layers.append(filled.mark_point(opacity=1 if not how.line or markers(data) is True else 0))
    if "open" in data:
        # the legend shows the marks of the first layer
        doubted = points.transform_filter("datum.open")
        layers.append(doubted.mark_point(filled=False, fill="white", strokeWidth=1.6))
    if "failed" in data:
        lost = base.transform_filter("datum.failed")
        crosses = lost.mark_point(shape=CROSS, filled=False, strokeWidth=2, style="failed")
        layers.append(crosses.encode(y=alt.value("height"), **colour))
    return layers


def _looks(data: pd.DataFrame, names: Sequence[str]) -> dict[str, Any]:
    """Return the channels of series and models: colours, markers and dashes."""
    series = list(data["series"]) if "series" in data else []
    if "model" not in data:
        return styles([*names, *series]) if series else {}
    return by_model([*names, *data["model"]]) | (styles(series, "color") if series else {})


def _across(values: pd.Series, how: Axes, *, named: bool) -> dict[str, Any]:
    """Return type, scale and axis of the horizontal axis."""
    if named:
        names = list(dict.fromkeys(map(str, values)))
        upright = sum(map(len, names)) * LETTER < HALF
        return {"type": "nominal", "sort": None, "axis": {"labelAngle": 0 if upright else -90}}
    # at a single value Vega would round the number of its only tick
    scale = LOG if "x" in how.log else FREE if values.nunique() > 1 else {"scale": {"zero": True}}
    return {"type": "quantitative", **scale}


def _up(values: pd.Series, how: Axes) -> dict[str, Any]:
    """Return scale and axis of the vertical axis."""
    if "y" in how.log:
        return LOG
    if how.span:
        return {"scale": {"domain": list(how.span), "clamp": True, "nice": False, "zero": False}}
    return _linear(values.to_numpy(dtype=float))


def _linear(numbers: Array) -> dict[str, Any]:
    """Return the scale of numbers: a range that begins or ends near zero, or has one number, shows the zero."""
    low, high = np.nanmin(numbers, initial=np.inf), np.nanmax(numbers, initial=-np.inf)
    return {} if 0 <= low < NEAR * high or 0 >= high > NEAR * low or low == high else FREE
