"""Figures of studies that judge: verification, robustness, friction, accuracy, cost and error, stability."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.loads import ANSWERED
from studies.output.figures import (
    LOG,
    Figure,
    beside,
    labels,
    long,
    numbers,
    panels,
    rule,
    styles,
    texts,
    thinned,
)

if TYPE_CHECKING:
    import pandas as pd

LEAST_SHARE = 1e-6
"""Smallest share of a bound that is drawn: errors of rounding would stretch the axis."""
ACCURACIES = ("quick", "standard", "fine")
EQUAL = "error = estimate"
"""Name of the line on which errors are as large as their estimates."""


def shares(title: str, what: str, names: Any, measured: Any, bound: Any, passed: Any) -> list[Figure]:
    """Return the share of its bound that each check takes, a line of the figure for each check.

    Parameters
    ----------
    what : label of the share.
    names, measured, bound, passed : of each check, shape (n,).
    """
    import altair as alt
    import pandas as pd

    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(np.equal(measured, 0), 0.0, np.abs(measured) / np.abs(bound))
    good = np.asarray(passed, dtype=bool)
    data = pd.DataFrame({what: np.maximum(share, LEAST_SHARE), "check": np.asarray(names, dtype=object)})
    data["series"] = np.where(good, "passed", "missed")
    data = data[np.isfinite(share)]
    missed, unknown = int((~good).sum()), int((~np.isfinite(share)).sum())
    caption = (
        f"{len(good) - missed} of {len(good)} checks passed{'' if missed else ', none is missed'}. A point left of "
        f"the line at 1 is within its bound; values below {LEAST_SHARE:g} stand at the left edge."
    )
    if unknown:
        caption += f" {unknown} checks have no number; the table names them."
    points = alt.Chart().mark_point().encode(
        x=alt.X(what, **LOG), y=alt.Y("check", sort=None), **styles(("passed", "missed"))
    )  # fmt: skip
    chart = alt.layer(*rule("x", 1.0, "bound"), points, data=data).properties(height=alt.Step(15))
    return [Figure(title, caption, chart, data)]


def verification(table: pd.DataFrame) -> list[Figure]:
    """Return the errors of `magtip validate verify` as shares of their tolerances."""
    names = texts(table, "target") + ": " + texts(table, "quantity")
    bound = numbers(table, "tolerance_percent")
    # a goal such as an order of convergence has a verdict and no error
    measured = numbers(table, "error_percent").where(bound != 0)
    passed = texts(table, "passed") == "True"
    return shares("Verification: error over tolerance", "error / tolerance", names, measured, bound, passed)


def robustness(table: pd.DataFrame) -> list[Figure]:
    """Return what `magtip validate verify extremes` measured as shares of the bounds."""
    measured, bound = numbers(table, "measured"), numbers(table, "bound")
    passed = texts(table, "verdict") == "pass"
    title = "Robustness: measured value over bound"
    return shares(title, "measured / bound", texts(table, "scene"), measured, bound, passed)


def friction(table: pd.DataFrame) -> list[Figure]:
    """Return the deviations of `magtip validate verify friction` as shares of their bounds."""
    names = texts(table, "check") + ": " + texts(table, "quantity")
    measured, bound = numbers(table, "off"), numbers(table, "bound")
    title = "Coulomb friction: deviation over bound"
    return shares(title, "deviation / bound", names, measured, bound, texts(table, "passed") == "True")


def disturbances(table: pd.DataFrame) -> list[Figure]:
    """Return the errors of the force that surroundings make, before and after taring, a line for each of them."""
    import altair as alt
    import pandas as pd

    error, times = (
        "largest error of the force (% of the range)",
        {"error_percent": "untared", "tared_percent": "tared"},
    )
    size = texts(table, "size").str.removesuffix(", under loads of its own")
    names = texts(table, "disturbance") + ", " + size
    columns = {word: numbers(table, key) for key, word in times.items()}
    data = pd.concat(
        [pd.DataFrame({error: each, "surroundings": names, "series": word}) for word, each in columns.items()]
    )
    data = data[data[error] > 0].reset_index(drop=True)
    points = alt.Chart(data).mark_point().encode(
        x=alt.X(error, **LOG), y=alt.Y("surroundings", sort=names.tolist(), title=None), **styles(times.values())
    )  # fmt: skip
    caption = (
        "Largest error of the decoded force over loads of the range, tared in free air, and tared at rest beside the "
        "disturbance. Surroundings in which most readings give no force have no point."
    )
    chart = points.properties(height=alt.Step(15))
    return [Figure("Error of the force by the surroundings", caption, chart, data)]


def crosscheck(table: pd.DataFrame) -> list[Figure]:
    """Return the differences between harmonics and tetrahedra over both error estimates together."""
    import pandas as pd

    tilts = numbers(table, "tilt_deg").fillna(0.0)
    loads = "design " + texts(table, "design") + [f", tilt {tilt:g}" if tilt else "" for tilt in tilts]
    # a frictionless press has no force along a shear; `shares` leaves it out
    parts = [
        pd.DataFrame({
            "name": loads + f": {quantity}",
            "difference": numbers(table, f"{quantity}_difference_percent").abs(),
            "both": numbers(table, f"{quantity}_harmonic_estimate_percent")
            + numbers(table, f"{quantity}_half_estimate_percent"),
            "agree": texts(table, f"{quantity}_agree") == "True",
        })
        for quantity in ("force", "shift", "tilt", "sideways")
    ]  # fmt: skip
    rows = pd.concat(parts, ignore_index=True)
    title, what = "Harmonic model against tetrahedra", "difference / sum of both error estimates"
    return shares(title, what, rows["name"], rows["difference"], rows["both"], rows["agree"])


def accuracy(table: pd.DataFrame) -> list[Figure]:
    """Return true errors over their estimates."""
    import altair as alt
    import pandas as pd

    x, y = "estimated error (%)", "true error (%)"
    parts = []
    for quantity in ("force", "shift", "tilt", "sideways", "depth", "frequency"):
        part = pd.DataFrame({
            x: 100 * numbers(table, f"{quantity}_estimate"),
            y: 100 * numbers(table, f"{quantity}_error").abs(),
            "panel": quantity,
            "series": texts(table, "level"),
            "point": "design " + texts(table, "design") + ", " + texts(table, "scene"),
            "joined": False,
        })  # fmt: skip
        # rows of the references themselves have no accuracy level
        part = part[(part[x] > 0) & (part[y] > 0) & part["series"].isin(ACCURACIES)]
        if len(part):
            ends = [part[x].min(), part[x].max()]
            equal = {"panel": quantity, "series": EQUAL, "point": EQUAL, "joined": True}
            parts += [part, pd.DataFrame({x: ends, y: ends}).assign(**equal)]
    if not parts:
        return []
    data = pd.concat(parts, ignore_index=True)
    judged = data[~data["joined"]]
    caption = (
        f"{100 * (judged[y] <= judged[x]).mean():.1f} % of {len(judged)} errors are at most as large as their "
        "estimate: points below the line."
    )
    names = (*ACCURACIES, EQUAL)
    base = alt.Chart().encode(x=alt.X(x, **LOG), y=alt.Y(y, **LOG))
    line = base.transform_filter("datum.joined").mark_line().encode(**styles(names, "color"))
    points = base.transform_filter("!datum.joined").mark_point().encode(**styles(names, lines=(EQUAL,)))
    chart = panels(alt.layer(points, line), data)
    return [Figure("True errors over their estimates", caption, chart, data)]


def trade(table: pd.DataFrame) -> list[Figure]:
    """Return median and 95th percentile of the error of the force over the cost, for every model and level."""
    import altair as alt

    model = texts(table, "model")
    y, compared = "error of the force (%)", numbers(table, "cost").notna().any()
    # a quick run does without the level to which costs are related
    x, column = ("cost (ratio to level standard)", "cost") if compared else ("CPU time (s)", "cpu_s")
    rows = table.assign(**{x: numbers(table, column), y: numbers(table, "force_error_percent")})
    # a formula has a message only outside the range of its level, where TRADE.md does not count it either
    counted = (texts(table, "confirming") != "True") & table["status"].isin(ANSWERED)
    counted &= (model != "formula") | (texts(table, "message") == "")
    rows = rows[counted & rows[y].notna() & (rows[x] > 0)]
    groups = rows.groupby(["kind", "model", "level"], sort=False)
    data = groups[[x, y]].median().assign(
        low=groups[y].median(), high=groups[y].quantile(0.95), count=groups.size()
    ).reset_index()  # fmt: skip
    data["point"] = [
        f"{one} {level}, {n} states"
        for one, level, n in zip(data["model"], data["level"], data["count"], strict=True)
    ]
    data = data.rename(columns={"kind": "panel", "model": "series", "level": "label"}).drop(columns="count")
    caption = (
        "Markers are medians over all designs and loads, bars reach to the 95th percentile; formulas and the "
        "surrogate count inside their range. Left is cheap and low is exact."
    )
    if compared:
        caption += " Cost 1 is the section model at level standard."
    axes = alt.Chart().encode(x=alt.X(x, **LOG))
    bars = axes.mark_rule().encode(y=alt.Y("low", title=y, **LOG), y2="high", **styles(model, "color"))
    medians = axes.encode(y=alt.Y(y, **LOG))
    points = medians.mark_point().encode(**styles(model))
    chart = panels(alt.layer(bars, points, *labels(medians)), beside(data, x, y, "xy"), columns=2)
    return [Figure("Error of the force over cost", caption, chart, data)]


def field(table: pd.DataFrame) -> list[Figure]:
    """Return errors of the magnet's field in each region."""
    import altair as alt

    names = {name: name for name in ("NumPy", "compiled", "magpylib")}
    x, y = "height / radius", "relative error"
    data = long(table, ("height_per_radius", x), y, names, panel=texts(table, "region"))
    caption = "Relative error against 60 digits, over the magnet's height, in each region around it."
    lines = alt.Chart().mark_line(point=True).encode(x=alt.X(x, **LOG), y=alt.Y(y, **LOG), **styles(names))
    return [Figure("Error of the magnet's field", caption, panels(lines, data), data)]


def ladder(table: pd.DataFrame) -> list[Figure]:
    """Return the errors of each level of the formulas over the depth."""
    import altair as alt

    inside = table[table["status"].isin(ANSWERED) & (texts(table, "outside") == "")]
    shear = numbers(inside, "shear_over_D")
    inside = inside.assign(load=shear.where(shear > 0, numbers(inside, "depth_over_D")))
    names = {
        "press_force_error": "press force",
        "shear_force_error": "shear force",
        "sinking_error": "sinking",
        "shift_error": "sideways shift",
        "tilt_error": "tilt",
    }
    x, y = "depth/D or shear/D", "error (%)"
    data = long(inside, ("load", x), y, names, "panel", series=texts(inside, "level"))
    data[y] = 100 * data[y].abs()
    drawn, note = thinned(data, y)
    points = alt.Chart().transform_filter("datum.drawn").mark_point().encode(
        x=x, y=alt.Y(y, **LOG), **styles(texts(table, "level"))
    )  # fmt: skip
    return [
        Figure(
            "Errors of the formulas' levels inside their range",
            "Each point is one state of one design, at its shear over D where there is one, else at its depth.",
            panels(points, drawn),
            data,
            note,
        )
    ]
