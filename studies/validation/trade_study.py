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
import functools
import itertools
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
from geometry.design import BadInput, Design, paper
from geometry.loads import Load, Magnet, Response
from geometry.messages import Progress
from studies import cases
from studies.cases import FemModel
from studies.mechanics import surrogate_response
from studies.simulation.compare import part
from studies.validation import bench, pages
from studies.validation.error_study_cases import Trial, answers_by, rounded, rows_of
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
DESIGNS = Path(__file__).with_name("trade_designs.csv")
"""The chosen designs after the paper's; those from the 18th on lie inside the range of the formulas."""


def runs_on(kind: Kind, model: Model, level: str, count: int) -> list[int]:
    """Return the numbers of the chosen designs on which a model is run."""
    chosen = [number for number in CHOSEN["order"] if number < count]
    counts = dict(zip(LEVELS, PLAN[kind]["runs"].get(model, [count] * len(LEVELS)), strict=True))
    return sorted(chosen[: counts[level]])


def trial(number: int, kind: Kind, model: Model, *, confirm: bool = False) -> Trial:
    """Return the path of loads of a kind on a design, in proportion to the design."""
    design = (confirming_designs() if confirm else designs())[number]
    magnet: Magnet = "rigid" if design.shape.has_magnet else "ignored"
    return Trial(number, design, magnet, PLAN[kind]["scene"], model, _loads(number, kind, design, magnet))


def _loads(number: int, kind: Kind, design: Design, magnet: Magnet) -> tuple[Load, ...]:
    own, under = PLAN[kind], CHOSEN["under"]
    first, most = press_limits(design, magnet)
    if kind == "press":
        depths = [share * first for share in own["presses"]] + [first + own["deep"] * (most - first)]
        return tuple(Load(depth=rounded(depth)) for depth in depths)
    D, depth = design.D, rounded(min(under[number % len(under)] * design.D, first))
    if kind == "glued shear":
        return tuple(Load(depth=depth, shear_x=rounded(x * D), friction="stick") for x in own["shears"])
    mu = own["coefficients"][number % len(own["coefficients"])]
    return tuple(Load(depth=depth, shear_x=rounded(x * D), friction=mu) for x in (0.0, *own["slides"]))


@functools.cache
def designs() -> tuple[Design, ...]:
    """Return the chosen designs, the paper's first; Hall elements lie as in the paper's sensor, over D."""
    found = [paper()]
    for row in rows_of(DESIGNS):
        D, wide, high = row["D"], row["magnet_diameter_over_D"], row["magnet_height_over_D"]
        L = rounded(row["L_over_D"] * D)
        magnet = {"magnet_diameter": wide * D, "magnet_height": high * D, "magnet_edge_radius": 0.1 * high * D}
        elements = {"l0": L - D / 2 + 0.275 * D, "f": 0.625 * D, "c": 0.25 * D}
        sizes: dict[str, Any] = {name: rounded(value) for name, value in (magnet | elements).items()}
        found.append(Design(D=D, L=L, nu=row["nu"], **sizes, **CHOSEN["laws"].get(row["law"], {})))
    return tuple(found)


@functools.cache
def confirming_designs() -> tuple[Design, ...]:
    """Return the random designs: L/D and 1/2 - nu uniform in their logarithm; a third has no magnet."""
    rows, laws = rows_of(DESIGNS.with_name("trade_random_designs.csv")), CHOSEN["laws"]
    return tuple(Design(**laws.get(row.pop("law"), {}), **row) for row in rows)


def meshes(kind: Kind, fineness: str) -> list[Accuracy]:
    """Return the three meshes of a reference, the coarse one first."""
    names = ("section_size", "section_patch", "harmonics", "friction_step_factor")
    begin = PLAN[kind]["begin"][fineness]
    steps = [dict(zip(names, step, strict=True)) for step in PLAN[kind]["steps"][begin : begin + 3]]
    return [replace(LEVELS["fine"], name=f"reference {step['section_size']:g}", **step) for step in steps]


# States, references and costs

COMPONENTS = {
    "force": ("force_x_N", "force_y_N", "force_N"),
    "shift": ("shift_x_mm", "shift_y_mm", "shift_z_mm"),
    "tilt": ("tilt_rad",),
    "sideways": ("force_x_N",),
    "readings": ("S1_mT", "S2_mT", "S3_mT"),
}
"""Columns of the components of each quantity in an answer."""
QUANTITIES = ("force", "shift", "tilt", "sideways", "along", "readings")
"""Quantities whose errors are measured; sideways is the force along the shear alone, a part of `force`, relative to
itself; along is the same force, relative to the larger one of itself and that of the unpressed beam."""
LEAST_ORDER = 0.8
"""Least observed order for an extrapolation: a lower one multiplies the last difference by more than three."""
NOTHING = 1e-6
"""Shift in mm, tilt in rad, force in N or flux density in mT below which a relative error has no meaning."""
CLEAR = 3.0
"""A reference judges an error clearly if its bar is at most a third of the error."""
REPEATS = {"formula": 50, SURROGATE: 10}
"""Number of evaluations for the cost of one, which is too short to be measured."""
Components = Mapping[str, Array]
"""Components of each quantity; N, mm, rad and mT."""


class Reference(NamedTuple):
    """Components of each quantity in one state, and the error bar of each."""

    values: Components
    bars: Components


class Run(NamedTuple):
    """One path of loads by one model: finite elements at an accuracy, a level of the formulas, or the surrogate."""

    kind: Kind
    trial: Trial
    model: str
    level: str

    @property
    def model_of_cases(self) -> str | FemModel:
        if self.model in CALCULATED:
            return self.level if self.model == "formula" else SURROGATE
        return FemModel(self.level, LEVELS[self.level], self.trial.model)


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
            design = designs()[0 if confirm else number]
            coarser = confirm or CHOSEN["slender"] * design.D < design.L or number >= CHOSEN["common"]
            usual = "finer" if number in fine else "coarser" if coarser else "usual"
            finenesses[number, kind] = "rough" if quick else usual
    return runs, finenesses


def run(
    progress: Progress, count: int, *, quick: bool, confirm: bool = False, store: Path | None = None
) -> pd.DataFrame:
    """Return all states with their errors, and with costs but for the random designs."""
    runs, finenesses = plan(count, quick=quick, confirm=confirm)
    truths = references(finenesses, confirm, store, part(progress, 0.0, 0.5, "references"))
    wanted = [(one.model_of_cases, one.trial) for one in runs]
    found = answers(wanted, store, part(progress, 0.5, 0.8))
    states: list[Row] = []
    for k, one in enumerate(runs):
        progress(0.8 + 0.2 * k / len(runs), f"cost of design {one.trial.number}, {one.kind}, {one.model} {one.level}")
        cpu_s, peak_MB = (math.nan, math.nan) if confirm else cost(one)
        rows = judged(one, found[k], truths[one.trial.number, one.kind], confirm)
        states += [row | {"cpu_s": cpu_s, "peak_MB": peak_MB} for row in rows]
    table = pd.DataFrame(states)
    section = (table.model == table.kind.map({kind: PLAN[kind]["section"] for kind in KINDS})) & (
        table.level == "standard"
    )
    unit = table.cpu_s.where(section).groupby([table.design, table.kind]).transform("first")
    return table.assign(cost=table.cpu_s / unit)


def answers(
    wanted: Sequence[tuple[str | FemModel, Trial]], store: Path | None, progress: Progress | None
) -> list[list[Row]]:
    """Return the answers of a model to the loads of a trial, for each pair."""
    states = [(model, trial, load) for model, trial in wanted for load in trial.loads]
    asked = cases.table((trial.design, load, trial.magnet) for _, trial, load in states)
    # without shear_mm the engine would leave out what is zero by symmetry
    asked["shear_mm"] = [load.shear_x for *_, load in states]
    quantities = ["force", "shift", "tilt", "readings"]
    table = answers_by([model for model, *_ in states], asked, quantities, store, progress)
    # an unstable press is the exact answer of a tip that is held on the axis
    table.loc[(table["status"] == "unstable") & (table["shear_mm"] == 0), ["status", "message"]] = "ok", ""
    rows = iter(pages.records(table))
    return [list(itertools.islice(rows, len(trial.loads))) for _, trial in wanted]


def components(design: Design, load: Load, answer: Row) -> Components:
    """Return the components of each quantity in one state; without tilt and sideways where nothing shears the tip."""
    left_out = () if load.shears_tip else ("tilt", "sideways")
    names = [name for name in COMPONENTS if name not in left_out and (name != "readings" or design.shape.has_magnet)]
    values = {name: np.array([answer[column] for column in COMPONENTS[name]], dtype=float) for name in names}
    # there is no reading where the magnet has reached an element
    return {name: each for name, each in values.items() if np.isfinite(each).all()}


def references(
    finenesses: Mapping[tuple[int, Kind], str], confirm: bool, store: Path | None, progress: Progress | None
) -> dict[tuple[int, Kind], list[Reference | None]]:
    """Return the reference of each state of each path; None where a mesh has no answer or an unstable one."""
    triples = {place: meshes(place[1], fineness) for place, fineness in finenesses.items()}
    trials = {(n, kind): trial(n, kind, PLAN[kind]["section"], confirm=confirm) for n, kind in finenesses}
    wanted: list[tuple[str | FemModel, Trial]] = [
        (FemModel(mesh.name, mesh, trials[place].model), trials[place])
        for place, three in triples.items()
        for mesh in three
    ]
    found = iter(answers(wanted, store, progress))
    truths = {}
    for place, three in triples.items():
        states = zip(trials[place].loads, *(next(found) for _ in three), strict=True)
        sizes = [mesh.section_size for mesh in three]
        truths[place] = [
            extrapolate(sizes, [components(trials[place].design, load, one) for one in own])
            if all(one["status"] == "ok" for one in own)
            else None
            for load, *own in states
        ]
    return truths


def extrapolate(sizes: Sequence[float], found: Sequence[Components]) -> Reference:
    """Return the reference from the answers of three meshes, with edge lengths in decreasing order."""
    values, bars = {}, {}
    for name in (name for name in COMPONENTS if all(name in one for one in found)):
        limits, widths = [], []
        for column in zip(*(one[name].tolist() for one in found), strict=True):
            limit, order = richardson([1 / size for size in sizes], column)
            known = order >= LEAST_ORDER
            limits.append(limit if known else column[-1])
            widths.append(abs(limit - column[-1]) if known else max(column) - min(column))
        values[name], bars[name] = np.array(limits), np.array(widths)
    return Reference(values, bars)


def full_scales(design: Design, truths: Sequence[Reference | None]) -> Array:
    """Return the full scale of each element, mT: its largest change from rest on a path; S2 and S3 share theirs."""
    readings = [one.values["readings"] for one in truths if one is not None and "readings" in one.values]
    if not readings:
        return np.zeros(0)
    rest = 1e3 * np.array(hall.readings(design, Response((0.0,) * 3, (0.0,) * 3, 0.0, 0.0)).B_T)
    first, *sideways = np.abs(np.array(readings) - rest).max(axis=0)
    return np.array([first, max(sideways), max(sideways)])


UNKNOWN = {f"{name}_{kind}_percent": math.nan for name in QUANTITIES for kind in ("error", "bar")}
"""Errors of a state, and error bars of its reference."""


def true_errors(answer: Components, truth: Reference, scales: Array, unpressed_N: float = 0.0) -> Row:
    """Return the errors of an answer against the reference of its state, with the reference's error bars, percent.

    They are relative to the quantity or, for readings, to the full `scales` of the elements, mT; there is none where
    the reference is nearly 0. `unpressed_N` is the force along the same shear of the unpressed beam.
    """
    errors: Row = dict(UNKNOWN)

    def add(name: str, off: Array, bar: Array, size: float) -> None:
        if size > NOTHING:
            for kind, vector in (("error", off), ("bar", bar)):
                errors[f"{name}_{kind}_percent"] = 100 * float(np.linalg.norm(vector)) / size

    for name in (name for name in COMPONENTS if name in answer and name in truth.values):
        off, bar, size = answer[name] - truth.values[name], truth.bars[name], np.linalg.norm(truth.values[name])
        if name != "readings":
            add(name, off, bar, float(size))
        elif len(scales) and scales.min() > NOTHING:
            add(name, np.abs(off / scales).max(), (bar / scales).max(), 1.0)
        if name == "sideways":
            add("along", off, bar, max(float(size), unpressed_N))
    return errors


def judged(one: Run, found: Sequence[Row], truths: Sequence[Reference | None], confirm: bool) -> list[Row]:
    """Return the states of a run with their errors.

    `message` is the reason why a formula is outside its range, or why a model has no answer.
    """
    design, rows = one.trial.design, []
    scales = full_scales(design, truths)
    for load, answer, truth in zip(one.trial.loads, found, truths, strict=True):
        status, message, errors, along = answer["status"], answer["message"], UNKNOWN, math.nan
        if one.model in CALCULATED:
            status = "ok" if math.isfinite(answer["force_N"]) else "refused"
            if status == "ok":
                message = beam.outside(design, load, one.level) if one.model == "formula" else ""
        if status == "ok" and truth is None:
            status, message = "no_reference", "a mesh of the reference has no stable answer"
        elif status == "ok" and truth is not None:
            values = components(design, load, answer)
            along = float(values["sideways"][0]) if "sideways" in values else math.nan
            errors = true_errors(values, truth, scales, buckling.sideways_stiffness(design) * load.shear)
        state: Row = {"design": one.trial.number, "confirming": confirm, "kind": one.kind, "model": one.model}
        state |= {"level": one.level, "depth_mm": load.depth, "shear_mm": load.shear_x, "friction": load.friction}
        rows.append(state | {"status": status} | errors | {"along_N": along, "message": message})
    return rows


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
