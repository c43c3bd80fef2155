"""Figures of studies that judge: verification, robustness, friction, accuracy, cost and error, stability."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geometry.arrays import Array
from studies.report.folder_contents import Table
from studies.report.report_figures import Axis, Figure, Guide, Panel, grouped, series

LEAST_SHARE = 1e-6
"""Smallest share of a bound that is drawn: errors of rounding would stretch the axis."""
ACCURACIES = ("quick", "standard", "fine")
PASSED, MISSED = 0, 1
"""Styles of passed and of missed checks."""


def shares(
    table: Table, names: Sequence[str], measured: Array, bound: Array, passed: Sequence[bool], title: str, what: str
) -> list[Figure]:
    """Return the share of its bound that each check takes, a line of the figure for each check."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(measured == 0, 0.0, np.abs(measured) / np.abs(bound))
    known = np.isfinite(share)
    place = np.arange(len(names))[::-1].astype(float)
    good = np.asarray(passed, dtype=bool)
    parts = []
    for style, label, rows in ((PASSED, "passed", good & known), (MISSED, "missed", ~good & known)):
        if rows.any():
            x = np.maximum(share[rows], LEAST_SHARE)
            own = [names[row] for row in np.flatnonzero(rows).tolist()]
            parts.append(series(label, x, place[rows], style, line=False, names=own))
    missed = int((~good).sum())
    caption = (
        f"{len(good) - missed} of {len(good)} checks passed{'' if missed else ', none is missed'}. A point left of "
        f"the line at 1 is within its bound; values below {LEAST_SHARE:g} stand at the left edge."
    )
    notes = () if known.all() else (f"{int((~known).sum())} checks have no number; the table names them.",)
    return [
        Figure(
            title,
            caption,
            Axis(what, log=True),
            Axis("", categories=tuple(reversed(names))),
            (Panel("", tuple(parts)),),
            guides=(Guide("x", 1.0, "bound"),),
            source=table.name,
            notes=notes,
        )
    ]


def verification(table: Table) -> list[Figure]:
    """Return the errors of `magtip validate verify` as shares of their tolerances."""
    names = [f"{one}: {two}" for one, two in zip(table.texts("target"), table.texts("quantity"), strict=True)]
    measured, bound = table.floats("error_percent"), table.floats("tolerance_percent")
    # a goal such as an order of convergence has a verdict and no error
    order = ~np.isfinite(measured) | (bound == 0)
    measured = np.where(order, np.nan, measured)
    passed = [text == "True" for text in table.texts("passed")]
    title = "Verification: error over tolerance"
    return shares(table, names, measured, bound, passed, title, "error / tolerance")


def robustness(table: Table) -> list[Figure]:
    """Return what `magtip validate extremes` measured as shares of the bounds."""
    passed = [text == "pass" for text in table.texts("verdict")]
    names = table.texts("scene")
    title = "Robustness: measured value over bound"
    return shares(table, names, table.floats("measured"), table.floats("bound"), passed, title, "measured / bound")


def friction(table: Table) -> list[Figure]:
    """Return the deviations of `magtip validate friction` as shares of their bounds."""
    names = [f"{one}: {two}" for one, two in zip(table.texts("check"), table.texts("quantity"), strict=True)]
    passed = [text == "True" for text in table.texts("passed")]
    title = "Coulomb friction: deviation over bound"
    return shares(table, names, table.floats("off"), table.floats("bound"), passed, title, "deviation / bound")


def crosscheck(table: Table) -> list[Figure]:
    """Return the differences between harmonics and tetrahedra over both error estimates together."""
    names, measured, bound, passed = [], [], [], []
    loads = [f"design {one}" for one in table.texts("design")]
    if table.has("tilt_deg"):
        tilts = table.floats("tilt_deg")
        loads = [f"{one}, tilt {tilt:g}" if tilt else one for one, tilt in zip(loads, tilts, strict=True)]
    # a frictionless press has no force along a shear; `shares` leaves it out
    for quantity in ("force", "shift", "tilt", "sideways"):
        difference = np.abs(table.floats(f"{quantity}_difference_percent"))
        both = table.floats(f"{quantity}_harmonic_estimate_percent") + table.floats(
            f"{quantity}_half_estimate_percent"
        )
        names += [f"{one}: {quantity}" for one in loads]
        measured += difference.tolist()
        bound += both.tolist()
        passed += [text == "True" for text in table.texts(f"{quantity}_agree")]
    title = "Harmonic model against tetrahedra"
    what = "difference / sum of both error estimates"
    return shares(table, names, np.array(measured), np.array(bound), passed, title, what)


def accuracy(table: Table) -> list[Figure]:
    """Return true errors over their estimates."""
    panels, covered, count = [], 0, 0
    for quantity in ("force", "shift", "tilt", "sideways", "depth", "frequency"):
        error, estimate = np.abs(table.floats(f"{quantity}_error")), table.floats(f"{quantity}_estimate")
        # rows of the references themselves have no accuracy level
        known = np.isfinite(error) & np.isfinite(estimate) & (error > 0) & (estimate > 0)
        known &= np.isin(table.texts("level"), ACCURACIES)
        if not known.any():
            continue
        covered, count = covered + int((error[known] <= estimate[known]).sum()), count + int(known.sum())
        parts = []
        for style, level in enumerate(ACCURACIES):
            rows = known & np.array([text == level for text in table.texts("level")])
            names = [
                f"design {one}, {two}" for one, two in zip(table.texts("design"), table.texts("scene"), strict=True)
            ]
            if rows.any():
                own = [names[row] for row in np.flatnonzero(rows).tolist()]
                parts.append(series(level, 100 * estimate[rows], 100 * error[rows], style, line=False, names=own))
        ends = [100 * estimate[known].min(), 100 * estimate[known].max()]
        parts.append(series("error = estimate", ends, ends, 6, mark=False, dash=1))
        panels.append(Panel(quantity, tuple(parts)))
    if not count:
        return []
    caption = (
        f"{100 * covered / count:.1f} % of {count} errors are at most as large as their estimate: points below the "
        "dashed line."
    )
    x, y = Axis("estimated error (%)", log=True), Axis("true error (%)", log=True)
    return [
        Figure(
            "True errors over their estimates",
            caption,
            x,
            y,
            tuple(panels),
            source=table.name,
            replaces=("errors.png",),
        )
    ]


def trade(table: Table) -> list[Figure]:
    """Return median and 95th percentile of the error of the force over the cost, for every model and level."""
    own = np.array([text != "True" for text in table.texts("confirming")], dtype=bool) & table.ok
    # a formula has a message only outside the range of its level, where TRADE.md does not count it either
    remarks = table.texts("message")
    own &= np.array([text != "formula" for text in table.texts("model")]) | np.array([not text for text in remarks])
    panels = []
    kinds, models = table.texts("kind"), table.texts("model")
    names = [f"{one} {two}" for one, two in zip(models, table.texts("level"), strict=True)]
    cost, error = table.floats("cost"), table.floats("force_error_percent")
    styles = {name: k for k, name in enumerate(dict.fromkeys(models))}
    for kind, rows in grouped(kinds).items():
        parts = []
        for model, members in grouped([models[row] for row in rows]).items():
            points = []
            for name, few in grouped([names[rows[k]] for k in members]).items():
                at = np.array([rows[members[k]] for k in few])
                at = at[own[at] & np.isfinite(error[at]) & (cost[at] > 0)]
                if len(at):
                    spread = np.percentile(error[at], [50, 95])
                    level = name.rpartition(" ")[2]
                    points.append((float(np.median(cost[at])), *spread.tolist(), f"{name}, {len(at)} states", level))
            if points:
                x, y, high, text, label = zip(*points, strict=True)
                low = y
                parts.append(
                    series(model, x, y, styles[model], line=False, low=low, high=high, names=text, labels=label)
                )
        if parts:
            panels.append(Panel(kind, tuple(parts)))
    if not panels:
        return []
    caption = (
        "Markers are medians over all designs and loads, bars reach to the 95th percentile; formulas and the "
        "surrogate count inside their range. Left is cheap and low is exact; cost 1 is the section model at level "
        "standard."
    )
    return [
        Figure(
            "Error of the force over cost",
            caption,
            Axis("cost (ratio to level standard)", log=True),
            Axis("error of the force (%)", log=True),
            tuple(panels),
            columns=2,
            source=table.name,
            replaces=("trade.png",),
        )
    ]


def stability(table: Table) -> list[Figure]:
    """Return critical depths over slenderness, beside the formulas of buckling."""
    columns = {
        "critical_depth_mm": "finite elements, tip free to slide",
        "guided_critical_depth_mm": "finite elements, guided tip",
        "euler_depth_mm": "Euler",
        "engesser_depth_mm": "Engesser",
        "haringx_depth_mm": "Haringx",
    }
    x = table.floats("L_over_D")
    parts = [
        series(name, x, table.floats(column), style, dash=min(style, 1) if style > 1 else 0)
        for style, (column, name) in enumerate(columns.items())
        if np.isfinite(table.floats(column)).any()
    ]
    free = table.floats("critical_depth_mm")
    known = np.flatnonzero(np.isfinite(free))
    caption = "No beam of the table gives way sideways."
    if len(known):
        least = known[free[known].argmin()]
        caption = (
            f"The tip gives way sideways at the least depth, {free[least]:.3g} mm, at L/D = {x[least]:g}. Beams "
            "without a point have no critical depth in the range of the study."
        )
    return [
        Figure(
            "Critical depth over slenderness",
            caption,
            Axis("L/D"),
            Axis("critical depth (mm)", log=True),
            (Panel("", tuple(parts)),),
            source=table.name,
            replaces=("stability.png",),
        )
    ]


def field(table: Table) -> list[Figure]:
    """Return errors of the magnet's field in each region."""
    panels = []
    for region, rows in grouped(table.texts("region")).items():
        x = table.floats("height_per_radius")[rows]
        parts = [
            series(name, x, table.floats(name)[rows], style)
            for style, name in enumerate(("NumPy", "compiled", "magpylib"))
        ]
        panels.append(Panel(region, tuple(parts)))
    return [
        Figure(
            "Error of the magnet's field",
            "Relative error against 60 digits, over the magnet's height, in each region around it.",
            Axis("height / radius", log=True),
            Axis("relative error", log=True),
            tuple(panels),
            source=table.name,
        )
    ]


def ladder(table: Table) -> list[Figure]:
    """Return the errors of each level of the formulas over the depth."""
    panels = []
    inside = table.ok & np.array([not text or text == "nan" for text in table.texts("outside")])
    levels = list(dict.fromkeys(table.texts("level")))
    for column, title in (
        ("press_force_error", "press force"),
        ("shear_force_error", "shear force"),
        ("sinking_error", "sinking"),
        ("shift_error", "sideways shift"),
        ("tilt_error", "tilt"),
    ):
        parts = []
        for style, level in enumerate(levels):
            rows = inside & np.array([text == level for text in table.texts("level")])
            x = np.where(table.floats("shear_over_D") > 0, table.floats("shear_over_D"), table.floats("depth_over_D"))
            one = series(level, x[rows], 100 * np.abs(table.floats(column)[rows]), style, line=False)
            parts += [one] if one.y else []
        panels.append(Panel(title, tuple(parts)))
    return [
        Figure(
            "Errors of the formulas' levels inside their range",
            "Each point is one state of one design, at its shear over D where there is one, else at its depth.",
            Axis("depth/D or shear/D"),
            Axis("error (%)", log=True),
            tuple(panels),
            source=table.name,
            replaces=("ladder.png",),
        )
    ]
