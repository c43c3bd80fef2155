"""Figures of sensitivity and of tolerances (`magtip sensitivity`): Sobol indices, Morris' effects, made sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from geometry.loads import ANSWERED
from studies.output.figures import FREE, Figure, numbers, panels, rule, styles, texts
from studies.output.text_tables import name_and_unit, quantity_name, with_unit

if TYPE_CHECKING:
    import pandas as pd

MADE = {
    "sensitivity": "sensitivity",
    "zeroed_force_error_N": "force error after zeroing (N)",
    "recalibrated_force_error_N": "force error after recalibration (N)",
}
"""Quantities of made sensors that are drawn, by the middle of their columns' names."""
VALUE, BELOW = "sensitivity or force error", "sensors below (%)"
ORDERS = ("first order", "total order")
MOST_STEPS = 200
"""Number of points of a distribution: a curve needs no more."""


def sobol(table: pd.DataFrame) -> list[Figure]:
    """Return the indices of first and total order of each input, a panel for each output."""
    import altair as alt
    import pandas as pd

    known = table[numbers(table, "total_order").notna()]
    index = "index (share of the variance)"
    orders = [
        pd.DataFrame({
            index: numbers(known, order.replace(" ", "_")),
            "input": texts(known, "input").str.replace("_", " "),
            "panel": texts(known, "output").map(quantity_name),
            "series": order,
            "low": numbers(known, f"{order} low".replace(" ", "_")),
            "high": numbers(known, f"{order} high".replace(" ", "_")),
        })
        for order in ORDERS
    ]  # fmt: skip
    data = pd.concat(orders, ignore_index=True)
    sentences = []
    for output, rows in orders[1].groupby("panel", sort=False):
        largest = rows.loc[rows[index].idxmax()]
        sentences.append(f"{output.partition(' (')[0]} {largest['input']} ({largest[index]:.2f})")
    caption = (
        f"Largest total index: {'; '.join(sentences[:6])}. Bars are 95 % intervals; {_lost(table)}, which "
        "the intervals include. A total index above the first-order one means that inputs interact."
    )
    doubtful = texts(table, "output")[numbers(table, "model_error_over_deviation") > 1]
    if len(doubtful):
        names = dict.fromkeys(name_and_unit(output)[0] for output in doubtful)
        caption += f" Do not read those of {', '.join(names)}: the model's error exceeds the variation."
    orders_of = alt.Chart().encode(y=alt.Y("input", sort=None), yOffset=alt.YOffset("series:N", sort=None))
    bars = orders_of.mark_rule().encode(x=alt.X("low", title=index), x2="high", **styles(ORDERS, "color"))
    points = orders_of.mark_point().encode(x=index, **styles(ORDERS))
    chart = alt.layer(*rule("x", 0.0), bars, points).properties(height=alt.Step(11))
    return [Figure("Sobol indices", caption, panels(chart, data), data)]


def _lost(table: pd.DataFrame) -> str:
    failed, points = (int(numbers(table, name)[:1].fillna(0).sum()) for name in ("failed", "points"))
    return f"{failed} of {points} points failed"


def morris(table: pd.DataFrame) -> list[Figure]:
    """Return sigma over mu* of each input, a panel for each output."""
    import altair as alt
    import pandas as pd

    known = table[numbers(table, "mu_star").notna()]
    star, sigma = "\N{GREEK SMALL LETTER MU}*", "\N{GREEK SMALL LETTER SIGMA}"
    names = [name_and_unit(output)[0] for output in texts(known, "output")]
    data = pd.DataFrame({
        star: numbers(known, "mu_star"),
        sigma: numbers(known, "sigma"),
        "panel": [with_unit(name, unit) for name, unit in zip(names, texts(known, "effect_unit"), strict=True)],
        "series": texts(known, "input").str.replace("_", " "),
        "low": numbers(known, "mu_star_low"),
        "high": numbers(known, "mu_star_high"),
    })  # fmt: skip
    caption = (
        "Right: inputs that matter. Up: inputs whose effect depends on the others or is not linear. "
        f"{star} and {sigma} have the unit that stands over their panel. Bars are 95 % intervals; {_lost(table)}."
    )
    inputs = list(data["series"])
    bars = alt.Chart().mark_rule().encode(x=alt.X("low", title=star), x2="high", y=sigma, **styles(inputs, "color"))
    points = alt.Chart().mark_point().encode(x=star, y=sigma, **styles(inputs))
    chart = alt.layer(bars, points)
    return [Figure("Morris' effects by finite elements", caption, panels(chart, data, own="xy"), data)]


def made_sensors(table: pd.DataFrame) -> list[Figure]:
    """Return the distribution of sensitivity and force errors of made sensors, a line for each axis."""
    import altair as alt
    import pandas as pd

    parts, sentences = [], []
    for middle, title in MADE.items():
        for way in "zxy":
            name = next((name for name in table.columns if name.startswith(f"{way}_{middle}")), "")
            values = np.sort(numbers(table, name).dropna()) if name else np.zeros(0)
            if not len(values):
                continue
            unit = name.partition("sensitivity_")[2].replace("_per_", "/")
            # failed sensors are never below a value: the curve then ends below 100 %
            share = 100 * np.arange(1, len(values) + 1) / len(table)
            shown = np.unique(np.linspace(0, len(values) - 1, min(len(values), MOST_STEPS)).round().astype(int))
            part = pd.DataFrame({VALUE: values[shown], BELOW: share[shown]})
            parts.append(part.assign(panel=with_unit(title, unit), series=f"axis {way}"))
            if middle.startswith("zeroed"):
                sentences.append(f"{way} {np.quantile(values, 0.95):.3g} N")
    failed = int((~table["status"].isin(ANSWERED)).sum())
    caption = (
        f"Share of {len(table)} made sensors below a value; {failed} failed and count as above every value. 95 % of "
        f"the sensors that work have a force error after zeroing of at most: {', '.join(sentences)}."
    )
    data = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame({VALUE: [], BELOW: [], "series": []})
    # each point is a step of one sensor: lines have no markers
    lines = alt.Chart().mark_line(point="transparent").encode(
        x=alt.X(VALUE, **FREE), y=BELOW, **styles(data["series"], "color", "strokeDash")
    )  # fmt: skip
    chart = panels(alt.layer(*rule("y", 95.0, "95 %"), lines), data, own="xy")
    return [Figure("Sensors made within their tolerances", caption, chart, data)]
