"""Accuracy: true errors of the finite elements and their error estimates, against much finer meshes.

templates/accuracy.md.j2 defines the errors and the goals. States of a path of loads are a table of cases for the one
engine, at their level and on the reference; critical depths, small shears and frequencies, which no store keeps with
their estimates, are analysed here. A row of accuracy.csv is a state: design, load and status, its numbers and those
of the reference, then error and estimate of each quantity.
"""

import math
import tomllib
from collections.abc import Sequence
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from fem import equilibrium
from fem.accuracy import LEVELS, Accuracy
from fem.analyses import modes, small_shear, stability
from fem.physics_version import PHYSICS
from fem.scene import Model, Scene
from geometry.bad_input import SolveFailed
from geometry.loads import Load
from geometry.messages import Progress
from studies.cases import FemModel
from studies.output.figures import picture
from studies.output.result import Result, Table
from studies.simulation.compare import part
from studies.validation import error_study_cases, pages
from studies.validation.error_study_cases import TANGENT_SCENES, Trial, answers_of
from studies.validation.errors.error_table import RESPONSES, UNSTABLE, goals, relative_errors, rules, shares, summary
from studies.validation.pages import Row
from studies.web import verdict_figures

FILES = ("ACCURACY.md", "accuracy.csv", "errors.png", "error_rules.csv")
PLAN: Row = tomllib.loads(Path(__file__).with_name("accuracy_plan.toml").read_text("utf-8"))
FINE_SHEARS = range(4)
"""Designs that are sheared, and whose tangents are solved, at level fine."""
SIZES = ("D", "L", "nu", "magnet_diameter", "magnet_height", "magnet_edge_radius")
COUNT = 8
"""Number of natural frequencies of each trial."""


class Task(NamedTuple):
    """A trial at one level, and the accuracy of its reference."""

    trial: Trial
    level: Accuracy
    reference: Accuracy


def tasks(*, quick: bool = False) -> list[Task]:
    """Return all tasks of PLAN, the fast ones first; if quick, with coarser references."""
    every: Row = {"levels": ["quick", "standard"], "magnets": ["rigid"], "model": "auto"}
    every["designs"] = range(error_study_cases.DESIGNS)
    found = []
    for row in (every | one for one in PLAN["quick" if quick else "full"]):
        for scene, level, magnet, number in product(*(row[k] for k in ("scenes", "levels", "magnets", "designs"))):
            usual, finer = (error_study_cases.reference(scene, k) for k in ((0, 1) if quick else (1, 2)))
            pair = (usual, finer) if level == "reference" else (LEVELS[level], usual)
            if level != "fine" or scene in ("press", "deep") or number in FINE_SHEARS:
                found.append(Task(error_study_cases.trial(number, magnet, scene, row["model"]), *pair))
    return found


def run(progress: Progress, *, quick: bool = False, store: Path | None = None) -> Result:
    """Compare error estimates and accuracy levels with much finer meshes; exit status 3 if a goal is missed.

    Presses and shears are by tetrahedra; `magtip validate errors estimates` has those of sections. The store keeps
    them, so that a run that was stopped continues there; critical depths, small shears and frequencies, some minutes,
    are solved again.

    Parameters
    ----------
    quick
        Use tangents of one design at accuracy quick and a coarser reference: some seconds instead of half an hour.
    store
        File of solved states; default: that of the user.
    """
    chosen = tasks(quick=quick)
    paths = [(one, load) for one in chosen if one.trial.scene not in TANGENT_SCENES for load in one.trial.loads]
    tangents = [one for one in chosen if one.trial.scene in TANGENT_SCENES]
    rows = []
    for k, one in enumerate(tangents):
        progress(0.5 * k / len(tangents), f"{one.trial.name}, {one.level.name}")
        rows += [row for load in one.trial.loads for row in tangent_rows(one, load)]
    # a quick run has no paths
    compared = [compare(paths, *solved(paths, store, part(progress, 0.5, 1.0)))] if paths else []
    return result(pd.concat([*compared, pd.DataFrame(rows)], ignore_index=True), quick=quick)


# States of a path of loads


def solved(
    paths: Sequence[tuple[Task, Load]], store: Path | None = None, progress: Progress | None = None
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the answers to the states of paths, by their level and by their reference."""
    # the section model resolves the same state on a far finer mesh than tetrahedra can
    sections: list[Model] = ["auto" if one.trial.scene in ("press", "deep") else "harmonic" for one, _ in paths]
    of_level = [
        FemModel(one.level.name, one.level, "half" if one.trial.model == "half" else model)
        for (one, _), model in zip(paths, sections, strict=True)
    ]
    of_reference = [
        FemModel("reference", one.reference, model) for (one, _), model in zip(paths, sections, strict=True)
    ]
    halves = part(progress, 0.0, 0.5), part(progress, 0.5, 1.0)
    return _answers(paths, of_level, store, halves[0]), _answers(paths, of_reference, store, halves[1])


def _answers(
    paths: Sequence[tuple[Task, Load]], models: Sequence[FemModel], store: Path | None, progress: Progress | None
) -> pd.DataFrame:
    begins = np.array([one.trial.loads[-1].shears_tip and not load.shears_tip for one, load in paths], dtype=bool)
    rows = np.flatnonzero(~begins).tolist()
    asked = [(one.trial.design, load, one.trial.magnet) for one, load in (paths[row] for row in rows)]
    of_rows = [models[row] for row in rows]
    answers = answers_of(asked, of_rows, ["force", "shift", "tilt"], progress, store=store).set_axis(rows)
    # a press that may be unstable is the exact answer of a tip that is held on the axis
    held = answers["status"].isin(("unstable", "unknown")) & np.array([model.model == "auto" for model in of_rows])
    answers.loc[held, ["status", "message"]] = "ok", ""
    answers = answers.rename(columns={"force_N": "force_z_N", "error_estimate": "force_error_estimate"})
    firsts = {row: _begin(paths[row][0].trial, models[row]) for row in np.flatnonzero(begins).tolist()}
    return pd.concat([answers, pd.DataFrame.from_dict(firsts, orient="index")]).sort_index()


@cache
def _begin(trial: Trial, model: FemModel) -> Row:
    """Return the press before the shears of a trial, on their mesh; the store has presses on meshes of their own."""
    scene = Scene(trial.design, trial.loads, model.accuracy, trial.magnet, model.model)
    first = next(equilibrium.walk(scene, estimate=model.name != "reference"))
    (x, _, z), (sideways, _, sinking) = first.response.force, first.response.shift
    estimates = {f"{name}_error_estimate": getattr(first.estimates, name) for name in RESPONSES}
    values: Row = {"force_x_N": x, "force_z_N": z, "shift_x_mm": sideways, "shift_z_mm": sinking}
    values |= {"tilt_rad": first.response.tilt, "status": first.status, "message": first.message}
    return values | {name: math.nan if value is None else value for name, value in estimates.items()}


def compare(paths: Sequence[tuple[Task, Load]], level: pd.DataFrame, reference: pd.DataFrame) -> pd.DataFrame:
    """Return a row for each state with its status, true errors and estimates; NaN where there is none.

    `scene` is the group of the statistics, in which the press before a shear is a scene of its own, "pressed";
    `path` is the scene of the whole path. There is no error where the reference is (nearly) zero.
    """
    table = pd.DataFrame(place(one, load) for one, load in paths)
    said = zip(level.message, reference.message, strict=True)
    states = [status(*each) for each in zip(level.status, reference.status, said, strict=True)]
    table["status"], table["message"] = zip(*states, strict=True) if states else ((), ())
    columns = list(dict.fromkeys(column for names in RESPONSES.values() for column in names))
    values, true = (
        answers[columns].reset_index(drop=True).where(table.status == "ok") for answers in (level, reference)
    )
    errors = relative_errors(values, true, RESPONSES)
    # without a shear there is no force along it
    errors["sideways"] = errors["sideways"].where(table.shear_mm > 0)
    judged: Row = {}
    for name, error in errors.items():
        estimate = level[f"{name}_error_estimate"].reset_index(drop=True)
        judged |= {f"{name}_error": error, f"{name}_estimate": estimate.where(error.notna())}
    return pd.concat([table, values, true.add_prefix("reference_"), pd.DataFrame(judged)], axis=1)


def place(one: Task, load: Load) -> Row:
    trial, tangent = one.trial, one.trial.scene in TANGENT_SCENES
    pressed = trial.scene == "stick" and not load.shear_x
    section = "axisymmetric" if tangent or trial.scene in ("press", "deep") else "harmonic"
    return {
        "design": trial.number,
        "odd": trial.odd,
        "magnet": trial.magnet,
        "scene": "pressed" if pressed else trial.scene,
        "path": trial.scene,
        "model": "half" if trial.model == "half" else section,
        "level": one.level.name,
        "depth_mm": load.depth,
        "shear_mm": 0.0 if tangent else load.shear_x,
    }


def status(level: str, reference: str, messages: tuple[str, str]) -> tuple[str, str]:
    """Return status and message of a state from those of its solves.

    It disagrees if it is stable, or has an answer, by one of them only.

    >>> status("ok", "unstable", ("", "since 1 mm"))
    ('disagrees', 'reference: since 1 mm')
    """
    solves = zip(("level", "reference"), (level, reference), messages, strict=True)
    bad = [(each, f"{name}: {message}") for name, each, message in solves if each != "ok"]
    if not bad:
        return "ok", ""
    found = "disagrees" if bad[0][0] in UNSTABLE and level != reference else bad[0][0]
    return found, "; ".join(said for _, said in bad)


# Critical depths, small shears and frequencies


def tangent_rows(one: Task, load: Load) -> list[Row]:
    (level, why), (truth, why_not) = (
        analysed(one.trial, load.depth, accuracy, accuracy is one.level) for accuracy in (one.level, one.reference)
    )
    ends = [state if isinstance(state, str) else "ok" for state in (level, truth)]
    reached, message = status(ends[0], ends[1], (why, why_not))
    row = place(one, load) | {"status": reached, "message": message}
    if reached != "ok":
        return [row]
    if one.trial.scene != "modes":
        names = ("depth", "force") if one.trial.scene == "critical" else ("stiffness", "shift", "tilt")
        for name in names:
            row |= judged(name, getattr(level, name), getattr(truth, name), getattr(level.estimates, name))
        return [row]
    # frequencies of one shape are paired in rising order, because modes of different shapes may swap places
    left: dict[str, list[float]] = {}
    for frequency, shape in zip(truth.frequency, truth.shape, strict=True):
        left.setdefault(shape, []).append(frequency)
    return [
        row | {"shape": shape} | judged("frequency", value, left[shape].pop(0), estimate)
        for value, shape, estimate in zip(level.frequency, level.shape, level.estimates, strict=True)
        if left.get(shape)
    ]


@cache
def analysed(trial: Trial, depth: float, accuracy: Accuracy, estimate: bool) -> tuple[Any, str]:
    design, magnet = trial.design, trial.magnet
    options: dict[str, Any] = {"accuracy": accuracy, "estimate": estimate}
    try:
        if trial.scene == "small shear":
            return small_shear.small_shear(design, depth, magnet, **options), ""
        if trial.scene == "modes":
            return modes.modes(design, magnet, COUNT, depth=depth, **options), ""
        critical = stability.critical(design, magnet, deepest=depth, **options)
    except SolveFailed as error:
        return "failed", str(error)
    if critical.depth is None:
        return "stable", f"{critical.message or 'no instability'} down to {critical.stable_to:.4g} mm"
    return critical, ""


def judged(quantity: str, value: float, reference: float, estimate: float | None) -> Row:
    """Return the columns of a quantity: values of its solves, relative error, estimate (NaN if it is unknown)."""
    return {
        quantity: value,
        f"reference_{quantity}": reference,
        f"{quantity}_error": abs(value / reference - 1),
        f"{quantity}_estimate": math.nan if estimate is None else estimate,
    }


# Page


def references(states: pd.DataFrame) -> list[Row]:
    """Return the differences between the reference and a finer mesh, percent; NaN where a value is zero."""
    own = states[(states.level == "reference") & (states.status == "ok")]
    errors = 100 * own.reindex(columns=[f"{name}_error" for name in RESPONSES])
    errors.columns = [f"{name}_percent" for name in RESPONSES]
    return pages.records(own[["design", "scene", "depth_mm", "shear_mm"]].join(errors))


def result(states: pd.DataFrame, *, quick: bool) -> Result:
    estimates, levels, rows = shares(states), summary(states), pages.records(states)
    scenes = (("press", "press"), ("stick and grip", "stick"), ("friction", "friction"), ("tangents", "modes"))
    page = {
        "states": rows,
        "estimates": estimates,
        "levels": levels,
        "references": references(states),
        "meshes": [f"{name}: `{error_study_cases.reference(scene, 0 if quick else 1)}`" for name, scene in scenes],
        "designs": [
            {"design": k} | {name: getattr(error_study_cases.designs()[k], name) for name in SIZES}
            for k in sorted(set(states.design))
        ],
        "physics": ", ".join(f"{name} {number}" for name, number in PHYSICS.items()),
    }
    tables = {"Estimates": estimates, "Levels": levels}
    first = ("scene", "quantity", "states", "median_percent", "coverage")
    more: Row = {"records": [*estimates, *levels], "goals": goals(states), "digits": 9}
    more["run"] = "quick" if quick else "full"
    more["tables"] = {"accuracy": rows, "error_rules": rules(states)}
    more["shown"] = [Table(title=title, rows=table, first=first) for title, table in tables.items()]
    files = {"errors.png": partial(picture, rows=rows, draw=verdict_figures.accuracy)}
    return pages.study("accuracy", "Accuracy", rows, page, files=files, **more)
