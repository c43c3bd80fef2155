"""Study accuracy: statistics of the states of `error_study` by level, scene and quantity, goals, rules, its page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fem.physics_version import PHYSICS
from fem.results.error_estimates import table_rows
from geometry.design import BadInput
from geometry.messages import Progress
from studies.output.checkpoint import solved_at
from studies.output.figures import picture
from studies.output.goals import Goal, failures, page_lines
from studies.output.result import Result, Table
from studies.report import verdict_figures
from studies.simulation.model_choice import rounded_up
from studies.validation import error_study, error_study_cases, pages
from studies.validation.error_study import (
    CLEAR,
    COVERAGE,
    GOALS,
    QUANTITIES,
    RESPONSES,
    SHARP,
    SHARPNESS,
    UNSTABLE,
    WIDER,
)
from studies.validation.pages import Row

FILES = ("ACCURACY.md", "accuracy.csv", "errors.png", "error_rules.csv")
"""Files that `write` writes into a folder."""
LEAST_STATES = 8
"""Coverage and sharpness of fewer states are not compared with their goals."""


Frame = Any
"""A DataFrame with a row for each known true error of a quantity in a state."""


def run(
    progress: Progress, *, quick: bool = False, folder: Path | None = None, minutes: float | None = None
) -> Result:
    """Compare all states with their references; no further solve begins after `minutes`."""
    if minutes is not None and not minutes >= 0:
        raise BadInput(f"--minutes must be 0 or more; got {minutes:g}")
    most = math.inf if minutes is None else minutes
    return result(error_study.run(progress, quick=quick, folder=folder, minutes=most), quick=quick)


def result(states: Sequence[Row], *, quick: bool) -> Result:
    """Return the result of states: its tables are all states, and the rules that hold in them."""
    estimates, levels, posed = shares(states), summary(states), goals(states)
    scenes = (("press", "press"), ("stick and grip", "stick"), ("friction", "friction"), ("tangents", "modes"))
    names = ("D", "L", "nu", "magnet_diameter", "magnet_height", "magnet_edge_radius")
    designs = error_study_cases.designs()
    first = ("scene", "quantity", "states", "median_percent", "coverage")
    page = pages.rendered(
        "accuracy.md.j2",
        states=states,
        verdict=page_lines(posed),
        estimates=estimates,
        levels=levels,
        noise=noise(states),
        references=references(states),
        meshes=[f"{name}: `{error_study_cases.reference(scene, 0 if quick else 1)}`" for name, scene in scenes],
        designs=[
            {"design": i} | {name: getattr(designs[i], name) for name in names}
            for i in sorted({state["design"] for state in states})
        ],
        physics=", ".join(f"{name} {number}" for name, number in PHYSICS.items()),
        solved_at=solved_at(state["commit"] for state in states if state.get("commit")),
    )
    return Result(
        title="Accuracy",
        records=[*estimates, *levels],
        shown=[
            Table(title="Estimates", rows=estimates, first=first),
            Table(title="Levels", rows=levels, first=first),
        ],
        tables={"accuracy": states, "error_rules": rules(states)},
        digits=9,
        files={"errors.png": partial(picture, rows=states, draw=verdict_figures.accuracy)},
        pages={"ACCURACY.md": page},
        failures=failures(posed),
    )


def errors_of(states: Sequence[Row]) -> Frame:
    """Return true error and estimate (NaN if unknown) of each quantity in the states that ended well at a level."""
    import pandas as pd

    columns = ("level", "scene", "design", "odd", "magnet", "depth_mm", "commit", "quantity", "error", "estimate")
    rows = [
        {name: state.get(name) for name in columns}
        | {"model": _model(state), "quantity": name, "error": state[f"{name}_error"]}
        | {"estimate": state[f"{name}_estimate"]}
        for state in states
        if state["status"] == "ok" and state["level"] in GOALS
        for name in QUANTITIES
        if f"{name}_error" in state and math.isfinite(state[f"{name}_error"])
    ]
    frame = pd.DataFrame(rows, columns=[*columns, "model"])
    return frame.assign(quantity=pd.Categorical(frame.quantity, QUANTITIES, ordered=True))


def _model(state: Row) -> str:
    return "half" if state["model"] == "half" else "section"


def _groups(frame: Frame, *by: str) -> list[tuple[Row, Frame]]:
    """Return the groups of some columns, in the order of their first rows, each with its quantities in order."""
    return [
        (dict(zip(by, place, strict=True)) | {"quantity": str(quantity)}, own)
        for place, group in frame.groupby(list(by), sort=False)
        for quantity, own in group.groupby("quantity", observed=True)
    ]


def summary(states: Sequence[Row]) -> list[Row]:
    """Return the statistics of each level, model, scene and quantity, with the goal of the largest error."""
    table = []
    for place, own in _groups(errors_of(states), "level", "model", "scene"):
        goal = 100 * WIDER.get(place["scene"], GOALS)[place["level"]]
        row = place | _statistics(own) | {"goal_percent": goal}
        table.append(row | {"met": _goal(row).met})
    return table


def _goal(row: Row) -> Goal:
    name = f"{row['model']} {row['scene']}, {row['quantity']}, {row['level']}, largest error"
    return Goal(name, row["max_percent"], row["goal_percent"], row["states"], "%")


def shares(states: Sequence[Row]) -> list[Row]:
    """Return the statistics of each scene and quantity over all levels, for all designs and for the odd ones."""
    return [
        place | {"designs": designs} | _statistics(chosen)
        for place, own in _groups(errors_of(states), "model", "scene")
        for designs, chosen in (("all", own), ("odd", own[own.odd.astype(bool)]))
        if len(chosen)
    ]


def _statistics(own: Frame) -> Row:
    """Return the statistics of true errors and estimates.

    `coverage` is the share of the states whose true error is at most the estimate, `sharpness` the share of those
    whose estimate is at most SHARP times the true error, or at most CLEAR.
    """
    true, estimate = np.sort(own.error.to_numpy()), own.estimate.to_numpy(dtype=float)
    return {
        "states": len(own),
        "median_percent": 100 * float(np.median(true)),
        "p95_percent": 100 * float(true[math.ceil(0.95 * len(true)) - 1]),
        "max_percent": 100 * float(true[-1]),
        "coverage": float((own.error.to_numpy() <= estimate).mean()),
        "sharpness": float((estimate <= np.maximum(SHARP * own.error.to_numpy(), CLEAR)).mean()),
    }


def references(states: Sequence[Row]) -> list[Row]:
    """Return the differences between the reference and a finer mesh, percent; NaN where a value is zero."""
    where = ("design", "scene", "depth_mm", "shear_mm")
    return [
        {name: state[name] for name in where} | {f"{q}_percent": 100 * state[f"{q}_error"] for q in RESPONSES}
        for state in states
        if state["level"] == "reference" and state["status"] == "ok"
    ]


def goals(states: Sequence[Row]) -> list[Goal]:
    """Return the goals of the study: states compared, coverage and sharpness, largest error of each level."""
    lost = sum(state["status"] not in ("ok", *UNSTABLE) for state in states)
    posed = [Goal("states without a comparison", lost, 0, len(states))]
    for row in shares(states):
        if row["designs"] != "all" or row["states"] < LEAST_STATES:
            continue
        where = f"{row['model']} {row['scene']}, {row['quantity']}"
        for name, column, bound in (
            ("true errors that are at most the estimate", "coverage", COVERAGE),
            (f"estimates that are at most {SHARP:g} times the true error", "sharpness", SHARPNESS),
        ):
            share = 100 * row[column]
            posed.append(Goal(f"{where}, {name}", share, 100 * bound, row["states"], "%", at_least=True))
    return posed + [_goal(row) for row in summary(states)]


def noise(states: Sequence[Row]) -> list[Row]:
    """Return the spread of the half model's answers over meshes of practically the same size.

    It is their relative standard deviation, percent: mean and maximum over the states.
    """
    import pandas as pd

    half = pd.DataFrame([state for state in states if state["model"] == "half" and state["status"] == "ok"])
    where = ["level", "scene", "design", "magnet", "depth_mm", "shear_mm"]
    vectors = {"force": ["force_x_N", "force_z_N"], "shift": ["shift_x_mm", "shift_z_mm"]}
    vectors |= {"tilt": ["tilt_rad"], "sideways": ["force_x_N"]}
    spreads = []
    for (level, scene, *_), repeats in half.groupby(where, sort=False) if len(half) else ():
        for name, columns in vectors.items():
            # a press has neither; a relative deviation would divide by mesh noise
            if len(repeats) < 2 or (scene in ("press", "pressed") and name in ("tilt", "sideways")):
                continue
            values = repeats[columns].astype(float)
            spread = 100 * math.hypot(*values.std()) / math.hypot(*values.mean())
            spreads.append({"level": level, "scene": scene, "quantity": name, "spread": spread})
    if not spreads:
        return []
    found = pd.DataFrame(spreads).groupby(["level", "scene", "quantity"], sort=False)["spread"]
    table = found.agg(states="size", mean_percent="mean", max_percent="max").reset_index()
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def rules(states: Sequence[Row]) -> list[Row]:
    """Return the rows of fem/results/error_rules.csv, with c so wide that each covers COVERAGE of its states.

    Rows with states in the study get today's versions and the commits of their solves; the others stay. An estimate
    that is unknown or 0 covers no error, whatever c is, and misses its goal: c does not follow from it.
    """
    frame = errors_of(states)
    frame = frame[frame.estimate > 0]
    scene, variant, quantity = (
        zip(*map(_rule_of, frame.to_dict("records")), strict=True) if len(frame) else ((), (), ())
    )
    groups = dict(list(frame.groupby([list(scene), list(variant), list(quantity)]))) if len(frame) else {}
    today: dict[str, int] = dict(PHYSICS.items())
    rows = []
    for row in table_rows():
        own = groups.get((row["scene"], row["variant"], row["quantity"]))
        if own is not None:
            needed = float(np.sort(own.error / own.estimate)[math.ceil(COVERAGE * len(own)) - 1])
            c = float(row["c"]) if needed <= 1 else rounded_up(needed * float(row["c"]), 3)
            commits = " - ".join(sorted(set(own.commit)))
            row |= {"c": f"{c:g}", "version": str(today[row["model"]]), "commit": commits}
        rows.append(row)
    return rows


def _rule_of(row: Row) -> tuple[str, str, str]:
    """Return scene, magnet and quantity by which a state's rule is found, see `fem.results.error_estimates`."""
    scene, quantity = row["scene"], str(row["quantity"])
    if row["model"] == "half":
        return "solid press" if scene == "press" else "solid", row["magnet"], quantity
    return scene, row["magnet"], "pressed frequency" if quantity == "frequency" and row["depth_mm"] else quantity
