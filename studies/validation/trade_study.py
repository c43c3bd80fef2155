"""Cost and error of every model on designs over the whole range; templates/trade.md.j2 describes the measurements.

Twenty-four chosen designs span the range: the paper's, L/D from 0.6 to 6, magnets from none to the largest that
fits, nu from 0.45 to 0.4999, four laws; six of them lie inside the range of the formulas. The rule of
`studies.mechanics.model_choice` follows from them. Further designs, drawn at random in the same range, confirm the
rule.

A state is a row of trade.csv: one state of a path by one model, with its true errors and those of its reference, and
CPU seconds and memory of the whole path. The answers are those of the one engine; what a path costs is measured by
itself, for finite elements in a process of its own.
"""

import contextlib
import math
import time
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd

from analytic import beam, buckling, hall
from fem.accuracy import LEVELS, Accuracy
from fem.scene import Model, press_limits
from geometry.arrays import Array
from geometry.design import BadInput
from geometry.loads import Load, Magnet, Response
from geometry.messages import Progress
from studies import cases
from studies.cases import FemModel
from studies.mechanics import surrogate_response
from studies.simulation.compare import part
from studies.validation import bench
from studies.validation.error_study_cases import Trial, answers_by, designs, rounded
from studies.validation.pages import Row
from studies.validation.verify import richardson

Kind = Literal["press", "glued shear", "friction"]
PLAN: dict[Any, Any] = tomllib.loads(Path(__file__).with_name("trade_plan.toml").read_text("utf-8"))
CHOSEN: dict[str, Any] = PLAN.pop("designs")
KINDS: tuple[Kind, ...] = tuple(PLAN)
QUICK_KINDS = KINDS[:2]
"""Kinds of a quick study: a reference with friction takes a minute."""
SURROGATE, SHIPPED = "surrogate", "shipped"
"""Name of the surrogate among the models, and of its one level."""
CALCULATED = ("formula", SURROGATE)
"""Models without a mesh: they are evaluated in the study's own process, and count inside their ranges only."""
SOLIDS = ("half", "full")
"""Models of tetrahedra."""
STUDIED = 24
"""Number of chosen designs."""
DRAWN, DRAWS = 26, 3
"""Random designs of a draw, and draws, with L/D from 0.6 to 6, nu from 0.45 and walls of 0.06 D or more. Of the first
draw 20 and of the others 6 designs lie anywhere in the range, the rest inside that of the formulas. The rule was
corrected after each draw but the last."""
CONFIRMED = DRAWN * DRAWS
"""Number of random designs."""


def runs_on(kind: Kind, model: Model, level: str, count: int) -> list[int]:
    """Return the numbers of the chosen designs on which a model is run."""
    chosen = [number for number in CHOSEN["order"] if number < count]
    counts = dict(zip(LEVELS, PLAN[kind]["runs"].get(model, [count] * len(LEVELS)), strict=True))
    return sorted(chosen[: counts[level]])


def trial(number: int, kind: Kind, model: Model, *, confirm: bool = False) -> Trial:
    """Return the path of loads of a kind on a design, in proportion to the design."""
    design = designs("trade_random" if confirm else "trade")[number]
    magnet: Magnet = "rigid" if design.shape.has_magnet else "ignored"
    friction: Any = "stick"
    own, under, D = PLAN[kind], CHOSEN["under"], design.D
    first, most = press_limits(design, magnet)
    depth = rounded(min(under[number % len(under)] * D, first))
    if kind == "press":
        depths = [share * first for share in own["presses"]] + [first + own["deep"] * (most - first)]
        loads = [Load(depth=rounded(each)) for each in depths]
    else:
        if kind == "friction":
            friction = own["coefficients"][number % len(own["coefficients"])]
        loads = [Load(depth=depth, shear_x=rounded(x * D), friction=friction) for x in own["shears"]]
    return Trial(number, design, magnet, own["scene"], model, tuple(loads))


# States, references and costs

READINGS = ["S1_mT", "S2_mT", "S3_mT"]
COMPONENTS = {
    "force": ["force_x_N", "force_y_N", "force_N"],
    "shift": ["shift_x_mm", "shift_y_mm", "shift_z_mm"],
    "tilt": ["tilt_rad"],
    "sideways": ["sideways_N"],
    "along": ["sideways_N"],
    "readings": READINGS,
}
"""Columns of the components of each quantity whose errors are measured. `sideways` is the force along the shear
alone, a part of `force`, relative to itself; `along` is the same force, relative to the larger one of itself and that
of the unpressed beam."""
QUANTITIES = tuple(COMPONENTS)
COLUMNS = list(dict.fromkeys(column for columns in COMPONENTS.values() for column in columns))
LEAST_ORDER = 0.8
"""Least observed order for an extrapolation: a lower one multiplies the last difference by more than three."""
NOTHING = 1e-6
"""Shift in mm, tilt in rad, force in N or flux density in mT below which a relative error has no meaning."""
NO_REFERENCE = ("no_reference", "a mesh of the reference has no stable answer")
"""Status and message of a state with an answer whose reference has none."""
CLEAR = 3.0
"""A reference judges an error clearly if its bar is at most a third of the error."""
REPEATS = {"formula": 50, SURROGATE: 10}
"""Number of evaluations for the cost of one, which is too short to be measured."""
STATE = ["design", "kind", "depth_mm", "shear_mm"]
"""Columns that tell the states of a model apart."""


class Run(NamedTuple):
    """One path of loads by one model: finite elements at an accuracy, a level of the formulas, or the surrogate."""

    kind: Kind
    trial: Trial
    model: str
    level: str
    accuracy: Accuracy | None = None
    """Of a reference; None for that of the level."""

    @property
    def model_of_cases(self) -> str | FemModel:
        if self.model in CALCULATED:
            return self.level if self.model == "formula" else SURROGATE
        return FemModel(self.level, self.accuracy or LEVELS[self.level], self.trial.model)


def plan(
    count: int = STUDIED, *, quick: bool = False, confirm: bool = False
) -> tuple[list[Run], dict[tuple[int, Kind], str]]:
    """Return all runs on the first `count` designs, and the fineness of the reference of each design and kind.

    If `quick`, these are presses and glued shears by the section models at level quick, with coarser references; to
    `confirm` the rule, all that it can choose for the random designs.
    """
    finenesses: dict[tuple[int, Kind], str] = {}
    runs: list[Run] = []
    for kind in QUICK_KINDS if quick else KINDS:
        section = PLAN[kind]["section"]
        levels = ("quick",) if quick else tuple(LEVELS)
        if confirm:
            chosen = PLAN[kind].get("confirming", range(CONFIRMED))[: 2 if quick else None]
            levels = levels[:2] if kind == "friction" else levels
            numbers = {(section, level): chosen for level in levels}
        else:
            models = (section,) if quick else PLAN[kind]["models"]
            numbers = {(m, level): runs_on(kind, m, level, count) for m in models for level in levels}
            chosen = runs_on(kind, section, "quick", count)
        calculated = [("formula", level) for level in beam.LEVELS]
        calculated += [] if kind == "friction" else [(SURROGATE, SHIPPED)]
        for (model, level), own in (dict.fromkeys(calculated, chosen) | numbers).items():
            name: Any = "auto" if model in CALCULATED else model
            runs += [Run(kind, trial(n, kind, name, confirm=confirm), model, level) for n in own]
        fine = runs_on(kind, section, "fine", count) if kind == "glued shear" and not confirm else []
        for number in chosen:
            design = designs("trade")[0 if confirm else number]
            coarser = confirm or CHOSEN["slender"] * design.D < design.L or number >= CHOSEN["common"]
            usual = "finer" if number in fine else "coarser" if coarser else "usual"
            finenesses[number, kind] = "rough" if quick else usual
    return runs, finenesses


def run(progress: Progress, count: int, *, quick: bool, confirm: bool = False) -> pd.DataFrame:
    """Return all states with their errors, and with costs but for the random designs."""
    runs, finenesses = plan(count, quick=quick, confirm=confirm)
    truth = references(finenesses, confirm, part(progress, 0.0, 0.5, "references"))
    table = judged(runs, answers(runs, part(progress, 0.5, 0.8)), truth, confirm=confirm)
    costs: list[tuple[float, float]] = []
    for k, one in enumerate(runs):
        progress(0.8 + 0.2 * k / len(runs), f"cost of design {one.trial.number}, {one.kind}, {one.model} {one.level}")
        costs += [(math.nan, math.nan) if confirm else cost(one)] * len(one.trial.loads)
    table[["cpu_s", "peak_MB"]] = costs
    section = (table.model == table.kind.map(lambda kind: PLAN[kind]["section"])) & (table.level == "standard")
    unit = table.cpu_s.where(section).groupby([table.design, table.kind]).transform("first")
    return table.assign(cost=table.cpu_s / unit)


def answers(runs: Sequence[Run], progress: Progress | None = None, store: Path | None = None) -> pd.DataFrame:
    """Return a row for each load of each run: its place, COLUMNS (NaN where there is none), status and message.

    A press has neither tilt nor a force along a shear, a design without a magnet no readings.
    """
    states = [(one, load) for one in runs for load in one.trial.loads]
    asked = cases.table((one.trial.design, load, one.trial.magnet) for one, load in states)
    # without shear_mm the engine would leave out what is zero by symmetry
    asked["shear_mm"] = [load.shear_x for _, load in states]
    quantities = ["force", "shift", "tilt", "readings"]
    found = answers_by([one.model_of_cases for one, _ in states], asked, quantities, store, progress)
    names = ["design", "kind", "model", "level", "depth_mm", "shear_mm", "friction"]
    place = pd.DataFrame(
        [
            (one.trial.number, one.kind, one.model, one.level, load.depth, load.shear_x, load.friction)
            for one, load in states
        ],
        columns=names,
    )
    table = pd.concat([place, found.reindex(columns=[*COLUMNS, "status", "message"])], axis=1)
    upright = table.shear_mm == 0
    # an unstable press is the exact answer of a tip that is held on the axis
    table.loc[(table.status == "unstable") & upright, ["status", "message"]] = "ok", ""
    table.loc[upright, "tilt_rad"] = math.nan
    table.loc[asked.magnet == "ignored", READINGS] = math.nan
    return table.assign(sideways_N=found.force_x_N.where(~upright))


def references(finenesses: Mapping[tuple[int, Kind], str], confirm: bool, progress: Progress | None) -> pd.DataFrame:
    """Return the references of the states of each path, by STATE, as `extrapolated` does."""
    runs = []
    names = ("section_size", "section_patch", "harmonics", "friction_step_factor")
    for (number, kind), fineness in finenesses.items():
        own, begin = trial(number, kind, PLAN[kind]["section"], confirm=confirm), PLAN[kind]["begin"][fineness]
        for step in PLAN[kind]["steps"][begin : begin + 3]:
            mesh = replace(LEVELS["fine"], name=f"reference {step[0]:g}", **dict(zip(names, step, strict=True)))
            runs.append(Run(kind, own, "reference", mesh.name, mesh))
    found = answers(runs, progress)
    sizes = [one.accuracy.section_size for one in runs if one.accuracy for _ in one.trial.loads]
    truth = extrapolated(found.assign(size=sizes))
    at_rest = Response((0.0,) * 3, (0.0,) * 3, 0.0, 0.0)
    designs = {one.trial.number: one.trial.design for one in runs if one.trial.magnet == "rigid"}
    rest = {number: 1e3 * np.array(hall.readings(one, at_rest).B_T) for number, one in designs.items()}
    return truth.join(full_scales(truth, rest))


def extrapolated(found: pd.DataFrame) -> pd.DataFrame:
    """Return the limits of COLUMNS in each state, with error bars (`NAME_bar`), from the answers of three meshes.

    `size` is the edge length of a mesh, in decreasing order. States that a mesh does not answer, or finds unstable,
    are left out.
    """
    rows = {}
    for place, own in found.groupby(STATE, sort=False):
        if not (own.status == "ok").all():
            continue
        row: Row = {}
        for name in COLUMNS:
            values = own[name].tolist()
            if not np.isfinite(values).all():
                continue
            limit, order = richardson((1 / own["size"]).tolist(), values)
            known = order >= LEAST_ORDER
            row[name] = limit if known else values[-1]
            row[f"{name}_bar"] = abs(limit - values[-1]) if known else max(values) - min(values)
        rows[place] = row
    index = pd.MultiIndex.from_tuples(list(rows), names=STATE)
    return pd.DataFrame(list(rows.values()), index=index, columns=[*COLUMNS, *(f"{name}_bar" for name in COLUMNS)])


def full_scales(truth: pd.DataFrame, rest: Mapping[int, Array]) -> pd.DataFrame:
    """Return the full scale of each element in each state, `NAME_scale`, mT: its largest change from rest on a path.

    S2 and S3 share theirs; `rest` are the readings of the unloaded designs with a magnet by their numbers.
    """
    unloaded = np.array([rest.get(number, (math.nan,) * 3) for number in truth.index.get_level_values("design")])
    changes = (truth[READINGS] - unloaded.reshape(-1, 3)).abs().groupby(["design", "kind"]).transform("max")
    for name in READINGS[1:]:
        changes[name] = changes[READINGS[1:]].max(axis=1)
    return changes.add_suffix("_scale")


def true_errors(found: pd.DataFrame, truth: pd.DataFrame, unpressed_N: Array) -> pd.DataFrame:
    """Return the errors of answers against the references in the same rows, with the references' error bars, percent.

    They are relative to the quantity or, for readings, to the full scales of the elements; NaN where the reference is
    nearly 0. `unpressed_N` is the force along the same shear of the unpressed beam.
    """
    errors = {}
    for name, columns in COMPONENTS.items():
        true = truth[columns].to_numpy(dtype=float)
        off, bar = (
            found[columns].to_numpy(dtype=float) - true,
            truth[[f"{c}_bar" for c in columns]].to_numpy(dtype=float),
        )
        size, order = np.linalg.norm(true, axis=1), 2.0
        if name == "along":
            size = np.maximum(size, unpressed_N)
        elif name == "readings":
            scales = truth[[f"{column}_scale" for column in columns]].to_numpy(dtype=float)
            size, order = np.where(scales.min(axis=1) > NOTHING, 1.0, math.nan), math.inf
            off, bar = off / scales, bar / scales
        known = (size > NOTHING) & np.isfinite(off).all(axis=1)
        for kind, vectors in (("error", off), ("bar", bar)):
            lengths = 100 * np.linalg.norm(vectors, order, axis=1) / np.where(known, size, 1.0)
            errors[f"{name}_{kind}_percent"] = np.where(known, lengths, math.nan)
    return pd.DataFrame(errors, index=found.index)


def judged(runs: Sequence[Run], found: pd.DataFrame, truth: pd.DataFrame, *, confirm: bool) -> pd.DataFrame:
    """Return the states of runs with their errors.

    `message` is the reason why a formula is outside its range, or why a model has no answer.
    """
    states = [(one, load) for one in runs for load in one.trial.loads]
    answered, calculated = np.isfinite(found.force_N), found.model.isin(CALCULATED)
    found.loc[calculated, "status"] = np.where(answered[calculated], "ok", "refused")
    found.loc[calculated & answered, "message"] = [
        beam.outside(one.trial.design, load, one.level) if one.model == "formula" else ""
        for (one, load), known in zip(states, calculated & answered, strict=True)
        if known
    ]
    true = truth.reindex(pd.MultiIndex.from_frame(found[STATE])).set_axis(found.index)
    found.loc[(found.status == "ok") & true.force_N.isna(), ["status", "message"]] = NO_REFERENCE
    unpressed = np.array([buckling.sideways_stiffness(one.trial.design) * load.shear for one, load in states])
    good = found.status == "ok"
    errors = true_errors(found, true, unpressed).where(good)
    place = found[["design", "kind", "model", "level", "depth_mm", "shear_mm", "friction", "status"]]
    place.insert(1, "confirming", confirm)
    return place.join(errors).assign(along_N=found.sideways_N.where(good), message=found.message)


def cost(one: Run) -> tuple[float, float]:
    """Return CPU seconds of a path, and its memory beyond that of the imported modules, MB; NaN if it fails.

    Formulas and the surrogate take too little memory to be measured. Their first evaluation, in which the surrogate
    is read and factorized, does not count, as imports do not.
    """
    trial = one.trial
    if one.model in CALCULATED:

        def evaluate() -> None:
            for load in trial.loads:
                with contextlib.suppress(BadInput):
                    if one.model == SURROGATE:
                        surrogate_response.respond(trial.design, load, trial.magnet)
                    else:
                        beam.solve(trial.design, load, one.level)
                        beam.outside(trial.design, load, one.level)

        evaluate()
        begin = time.process_time()
        for _ in range(REPEATS[one.model]):
            evaluate()
        return (time.process_time() - begin) / REPEATS[one.model], 0.0
    accuracy = {name: value for name, value in asdict(LEVELS[one.level]).items() if name != "name"}
    task: Row = {"task": "trace", "model": trial.model, "magnet": trial.magnet, "accuracy": accuracy}
    task |= {"loads": [asdict(load) for load in trial.loads], "design": asdict(trial.design)}
    found = bench.magtip(task)
    return found.get("cpu_s", math.nan), found.get("peak_MB", math.nan) - found.get("base_MB", math.nan)
