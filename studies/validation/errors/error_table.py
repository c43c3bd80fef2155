"""True errors of states: answers of a model beside those of a reference, error estimates, and statistics of both.

A table of states has a row for each state and model: its place (scene, magnet, depth_mm, level and model), its
status, and for each quantity the true error and its estimate, `NAME_error` and `NAME_estimate`, both relative; NaN
where there is none. Goals, pages and the rules of fem/results/error_rules.csv follow from such a table.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import product

import numpy as np
import pandas as pd
from scipy.stats import binomtest

from fem.physics_version import PHYSICS
from fem.results.error_estimates import ANY, NUMBERS, scene_of_rules, table_rows
from studies.mechanics.model_choice import rounded_up
from studies.output import provenance
from studies.output.goals import Goal
from studies.validation import pages
from studies.validation.pages import Row

RESPONSES = {
    "force": ("force_x_N", "force_z_N"),
    "shift": ("shift_x_mm", "shift_z_mm"),
    "tilt": ("tilt_rad",),
    "sideways": ("force_x_N",),
}
"""Columns of the quantities of a response; loads are along x."""
QUANTITIES = (*RESPONSES, *NUMBERS, "depth", "stiffness", "frequency")
"""Quantities of a state, and of tangents."""
GOALS = {"quick": 0.03, "standard": 0.01, "fine": 0.003}
WIDER = {
    "critical": {"quick": 0.05, "standard": 0.04, "fine": 0.01},
    "small shear": {"quick": 0.03, "standard": 0.02, "fine": 0.01},
}
"""Largest true errors of the levels, and wider ones of two scenes; the page gives the reasons."""
COVERAGE, SHARPNESS, SHARP, CLEAR = 0.95, 0.5, 3.0, 3e-4
"""Goals of coverage and sharpness; an estimate is sharp up to SHARP true errors, or up to CLEAR in any case."""
TESTED = ("odd", "unseen")
"""Parts of the states that are shown apart: random ones on which no constant rests, and odd ones of the designs."""
LEAST_STATES, COMPARED = 8, 50.0
"""Coverage and sharpness of fewer states are not compared with their goals; least share of compared states, %."""
NOTHING = 1e-6
"""Shift in mm, tilt in rad or force along the shear in N below which a relative error has no meaning."""
UNSTABLE = ("unstable", "stable")
"""Statuses of a path beyond its instability, and of a search that found none: no error can be measured."""


def relative_errors(
    found: pd.DataFrame, truth: pd.DataFrame, components: Mapping[str, Sequence[str]], nothing: float = NOTHING
) -> pd.DataFrame:
    """Return the length of the difference from the truth over that of the truth, by quantity.

    It is NaN where the truth is `nothing` or less.

    components : columns of the components of each quantity, in both tables, whose rows are the same states.
    """
    errors = {}
    for name, columns in components.items():
        a, b = (table[list(columns)].to_numpy(dtype=float) for table in (found, truth))
        size = np.linalg.norm(b, axis=1)
        errors[name] = np.linalg.norm(a - b, axis=1) / np.where(size > nothing, size, np.nan)
    return pd.DataFrame(errors, index=found.index)


def errors_of(states: pd.DataFrame) -> pd.DataFrame:
    """Return a row for each known true error of a quantity in the states that ended well at a level.

    An estimate is NaN if it is unknown.
    """
    own = states[(states.status == "ok") & states.level.isin(list(GOALS))]
    part_of = own.part if "part" in own else np.where(own.odd.astype(bool), "odd", "even")
    place = own[["level", "scene", "magnet", "depth_mm"]].assign(part=part_of)
    place = place.assign(model=np.where(own.model == "half", "half", "section"))
    parts = [
        place.assign(quantity=name, error=own[f"{name}_error"], estimate=own[f"{name}_estimate"])
        for name in QUANTITIES
        if f"{name}_error" in own
    ]
    # the quantities of a state stand together
    frame = pd.concat(parts).sort_index(kind="stable") if parts else place.assign(quantity="", error=[], estimate=[])
    quantity = pd.Categorical(frame.quantity, QUANTITIES, ordered=True)
    # a number of a scene without a rule is said to be unknown, and promises nothing
    open_ended = frame.quantity.isin(NUMBERS) & frame.estimate.isna()
    return frame.assign(quantity=quantity)[np.isfinite(frame.error) & ~open_ended]


def statistics(errors: pd.DataFrame, *by: str) -> list[Row]:
    """Return statistics of true errors and estimates in groups, in the order of their first rows.

    `coverage` is the share of the states whose true error is at most the estimate, `sharpness` the share of those
    whose estimate is at most SHARP times the true error, or at most CLEAR.
    """
    percent, sharp = 100 * errors.error, errors.estimate <= np.maximum(SHARP * errors.error, CLEAR)
    rows = errors.assign(percent=percent, covered=errors.error <= errors.estimate, sharp=sharp)
    groups = rows.astype({"quantity": str}).groupby([*by, "quantity"], sort=False)
    table = groups.agg(
        states=("percent", "size"),
        median_percent=("percent", "median"),
        p95_percent=("percent", partial(pages.percentile, percent=95)),
        max_percent=("percent", "max"),
        coverage=("covered", "mean"),
        sharpness=("sharp", "mean"),
    )
    # the share of a coverage that a like number of other states would have, with a probability of 95 %
    hits = (table.coverage * table.states).round().astype(int)
    bounds = [binomtest(int(k), int(n)).proportion_ci(0.95) for k, n in zip(hits, table.states, strict=True)]
    table["coverage_low"], table["coverage_high"] = [b.low for b in bounds], [b.high for b in bounds]
    return pages.records(table.reset_index())


def summary(states: pd.DataFrame) -> list[Row]:
    table = statistics(errors_of(states), "level", "model", "scene")
    for row in table:
        promised = row["quantity"] not in NUMBERS
        row["goal_percent"] = 100 * WIDER.get(row["scene"], GOALS)[row["level"]] if promised else math.nan
        row["met"] = _goal(row).met if promised else None
    return table


def _goal(row: Row) -> Goal:
    name = f"{row['model']} {row['scene']}, {row['quantity']}, {row['level']}, largest error"
    return Goal(name, row["max_percent"], row["goal_percent"], row["states"], "%")


def shares(states: pd.DataFrame) -> list[Row]:
    """Return the statistics of each scene and quantity over all levels, for all states and for those of TESTED."""
    errors, place = errors_of(states), ("model", "scene", "quantity")
    parts = statistics(errors[errors.part.isin(TESTED)], *place[:2], "part")
    tested = {tuple(row[name] for name in place): row for row in parts}
    rows = []
    for row in statistics(errors, *place[:2]):
        first = {name: row[name] for name in place}
        other = tested.get(tuple(first.values()))
        own = {"all": row} | ({other["part"]: other} if other else {})
        rows += [
            first | {"designs": designs} | {key: value for key, value in each.items() if key != "part"}
            for designs, each in own.items()
        ]
    return rows


def goals(states: pd.DataFrame) -> list[Goal]:
    return goals_of_estimates(states) + [_goal(row) for row in summary(states) if row["met"] is not None]


def goals_of_estimates(states: pd.DataFrame) -> list[Goal]:
    """Return the goals of coverage and, for the response and tangents, of sharpness."""
    lost = int((~states.status.isin(["ok", *UNSTABLE])).sum())
    compared = 100 * float((states.status == "ok").mean()) if len(states) else None
    posed = [
        Goal("states without a comparison", lost, 0, len(states)),
        # unstable states are none, but of them alone no error is known
        Goal("states that are compared", compared, COMPARED, len(states), "%", at_least=True),
    ]
    judged = (
        ("true errors that are at most the estimate", "coverage", COVERAGE),
        (f"estimates that are at most {SHARP:g} times the true error", "sharpness", SHARPNESS),
    )
    known = (row for row in shares(states) if row["designs"] == "all" and row["states"] >= LEAST_STATES)
    for row, (name, column, bound) in product(known, judged):
        if column == "sharpness" and row["quantity"] in NUMBERS:
            continue
        name = f"{row['model']} {row['scene']}, {row['quantity']}, {name}"
        posed.append(Goal(name, 100 * row[column], 100 * bound, row["states"], "%", at_least=True))
    return posed


def rules(states: pd.DataFrame) -> list[Row]:
    """Return the rows of fem/results/error_rules.csv, with c so wide that each covers COVERAGE of its states.

    States of the part "unseen" are left out, because they test the rules. Rows with states in the study get today's
    versions and commit; the others stay. An estimate that is unknown or 0
    covers no error, whatever c is, and misses its goal: c does not follow from it.
    """
    errors = errors_of(states)
    errors = errors[(errors.estimate > 0) & (errors.part != "unseen")]
    scene = errors.scene.where(errors.model != "half", np.where(errors.scene == "press", "solid press", "solid"))
    scene = pd.Series(scene, index=errors.index, dtype=object).map(scene_of_rules)
    kinds = {(row["scene"], row["variant"]) for row in table_rows()}
    pooled = np.array([(each, ANY) in kinds for each in scene], dtype=bool)
    variant = errors.magnet.where(~pooled, ANY)
    pressed = (errors.quantity == "frequency") & (errors.depth_mm > 0)
    quantity = errors.quantity.astype(str).where(~pressed, "pressed frequency")
    needed = (
        (errors.error / errors.estimate)
        .groupby([scene, variant, quantity])
        .agg(pages.percentile, percent=100 * COVERAGE)
    )
    today: dict[str, int] = dict(PHYSICS.items())
    rows = []
    for row in table_rows():
        factor = needed.get((row["scene"], row["variant"], row["quantity"]))
        if factor is not None:
            c = float(row["c"]) if factor <= 1 else rounded_up(factor * float(row["c"]), 3)
            row |= {"c": f"{c:g}", "version": str(today[row["model"]]), "commit": provenance.commit() or ""}
        rows.append(row)
    return rows
