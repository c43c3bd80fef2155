"""Cost and error of every model on designs over the whole range; templates/trade.md.j2 describes the measurements.

A state is a row of trade.csv: one state of a path by one
model, with its true errors and those of its reference, and CPU seconds and memory of the whole path.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from analytic import buckling, hall
from fem.accuracy import LEVELS
from geometry.design import BadInput, Design
from geometry.loads import Load, Response
from geometry.messages import Progress
from studies.output import checkpoint
from studies.validation import trade_cases, trade_solves
from studies.validation.error_study import SolvedState
from studies.validation.error_study_cases import Trial
from studies.validation.pages import Row
from studies.validation.trade_cases import KINDS, MODELS, SECTION, SHIPPED, Fineness, Kind
from studies.validation.trade_solves import Run, Solved
from studies.validation.verify import richardson

SOLIDS = ("half", "full")
"""Models of tetrahedra."""
QUICK_KINDS: tuple[Kind, ...] = ("press", "glued shear")
"""Kinds of a quick study: a reference with friction takes a minute."""


QUANTITIES = ("force", "shift", "tilt", "sideways", "along", "readings")
"""Quantities whose errors are measured; sideways is the force along the shear alone, a part of `force`, relative to
itself; along is the same force, relative to the larger one of itself and that of the unpressed beam."""
LEAST_ORDER = 0.8
"""Least observed order for an extrapolation: a lower one multiplies the last difference by more than three."""
NOTHING = 1e-6
"""Shift in mm, tilt in rad, force in N or flux density in T below which a relative error has no meaning."""
CLEAR = 3.0
"""A reference judges an error clearly if its bar is at most a third of the error."""

Components = dict[str, tuple[float, ...]]
"""Components of each quantity; mm, N, rad and T."""


@dataclass(frozen=True, slots=True)
class Reference:
    """Reference of one state.

    Attributes
    ----------
    values : components of each quantity.
    bars : error bar of each component.
    orders : observed orders of the components that were extrapolated.
    """

    values: Components
    bars: Components
    orders: tuple[float, ...]


def components(design: Design, load: Load, response: Response) -> Components:
    """Return the components of each quantity in one state; without tilt and sideways where nothing shears the tip."""
    values: Components = {"force": response.force, "shift": response.shift}
    if load.shears_tip:
        values |= {"tilt": (response.tilt,), "sideways": response.force[:1]}
    if design.shape.has_magnet:
        # there is no reading where the magnet has reached an element
        with contextlib.suppress(BadInput):
            values["readings"] = hall.readings(design, response).B_T
    return values


def extrapolate(sizes: Sequence[float], answers: Sequence[Components]) -> Reference:
    """Return the reference from the answers of three meshes.

    Parameters
    ----------
    sizes : edge lengths of the meshes, in decreasing order.
    """
    values, bars, orders = Components(), Components(), []
    for name in set.intersection(*(set(answer) for answer in answers)):
        limits, widths = [], []
        for column in zip(*(answer[name] for answer in answers), strict=True):
            limit, order = richardson([1 / size for size in sizes], column)
            if order >= LEAST_ORDER:
                orders.append(order)
                limits.append(limit)
                widths.append(abs(limit - column[-1]))
            else:
                limits.append(column[-1])
                widths.append(max(column) - min(column))
        values[name], bars[name] = tuple(limits), tuple(widths)
    return Reference(values, bars, tuple(orders))


def full_scales(design: Design, references: Sequence[Reference]) -> tuple[float, ...]:
    """Return the full scale of each element, T: its largest change from rest on a path; S2 and S3 share theirs."""
    readings = [one.values["readings"] for one in references if "readings" in one.values]
    if not readings:
        return ()
    rest = hall.readings(design, Response((0.0,) * 3, (0.0,) * 3, 0.0, 0.0)).B_T
    first, second, third = (
        max(abs(value - still) for value in column)
        for column, still in zip(zip(*readings, strict=True), rest, strict=True)
    )
    return first, max(second, third), max(second, third)


def true_errors(
    answer: Components, reference: Reference, scales: Sequence[float], unpressed_N: float = 0.0
) -> dict[str, tuple[float, float]]:
    """Return the errors of an answer against the reference of its state, with the reference's error bars, percent.

    They are relative to the quantity or, for readings, to full scale; there is none where the reference is nearly 0.

    Parameters
    ----------
    scales : full scale of each element, T.
    unpressed_N : force along the same shear of the unpressed beam.
    """
    errors = {}
    for name in QUANTITIES:
        if name not in answer or name not in reference.values:
            continue
        value, bar = reference.values[name], reference.bars[name]
        differences = [a - b for a, b in zip(answer[name], value, strict=True)]
        size = math.hypot(*value)
        if name != "readings" and size > NOTHING:
            errors[name] = 100 * math.hypot(*differences) / size, 100 * math.hypot(*bar) / size
        elif name == "readings" and min(scales, default=0.0) > NOTHING:
            errors[name] = 100 * _largest(differences, scales), 100 * _largest(bar, scales)
    if "sideways" in answer and "sideways" in reference.values:
        ((own,), (true,)), (width,) = (answer["sideways"], reference.values["sideways"]), reference.bars["sideways"]
        size = max(abs(true), unpressed_N)
        errors["along"] = 100 * abs(own - true) / size, 100 * width / size
    return errors


def _largest(values: Sequence[float], scales: Sequence[float]) -> float:
    """Return the largest size of a value over its scale; NaN if one is unknown."""
    return float(np.max(np.abs(values) / np.array(scales)))


def is_clear(percent: float, bar_percent: float) -> bool:
    """Return whether the bar of the reference is at most a third of an error."""
    return CLEAR * bar_percent <= percent


def errors_of(state: Row) -> dict[str, tuple[float, float]]:
    """Return the true errors of a state by quantity, with the error bars of the reference, percent."""
    names = (name for name in QUANTITIES if state[f"{name}_error_percent"] is not None)
    return {name: (state[f"{name}_error_percent"], state[f"{name}_bar_percent"]) for name in names}


def with_errors(state: Row, errors: Mapping[str, tuple[float, float]]) -> Row:
    """Return a state with errors and error bars; None where there is none."""
    columns = {f"{name}_{kind}_percent": None for name in QUANTITIES for kind in ("error", "bar")}
    for name, (percent, bar) in errors.items():
        columns |= {f"{name}_error_percent": percent, f"{name}_bar_percent": bar}  # type: ignore[dict-item]
    return state | columns


def load_of(state: Row) -> Load:
    """Return the load of a state."""
    return Load(depth=state["depth_mm"], shear_x=state["shear_mm"], friction=state["friction"])


@dataclass(frozen=True, slots=True)
class Plan:
    """The runs of a study.

    Attributes
    ----------
    confirming : whether these are the random designs.
    references : runs of the reference of each design and kind, coarse mesh first.
    runs : runs whose cost and errors are measured.
    """

    confirming: bool
    references: Mapping[tuple[int, Kind], tuple[Run, Run, Run]]
    runs: tuple[Run, ...]


def plan(count: int = trade_cases.STUDIED, *, quick: bool = False, solids: bool = True) -> Plan:
    """Return the runs of the chosen designs: section models first, tetrahedra last.

    Parameters
    ----------
    count : number of designs.
    quick : presses and glued shears by the section models at level quick only, with coarser references.
    solids : run the models of tetrahedra as well.
    """
    references: dict[tuple[int, Kind], tuple[Run, Run, Run]] = {}
    runs: list[Run] = []
    levels = ("quick",) if quick else tuple(LEVELS)
    for kind in QUICK_KINDS if quick else KINDS:
        fine = trade_cases.runs_on(kind, SECTION[kind], "fine", count) if kind == "glued shear" else []
        for number in trade_cases.runs_on(kind, SECTION[kind], "quick", count):
            fineness: Fineness = "rough" if quick else "finer" if number in fine else _fineness(number)
            references[number, kind] = _references(number, kind, fineness)
            runs += _calculated(number, kind)
        models = (SECTION[kind],) if quick else MODELS[kind]
        for model in models if solids else [m for m in models if m not in SOLIDS]:
            for level in levels:
                for number in trade_cases.runs_on(kind, model, level, count):
                    runs.append(Run(trade_cases.trial(number, kind, model), LEVELS[level]))
    return Plan(False, references, tuple(sorted(runs, key=lambda one: one.model in SOLIDS)))


def confirming_plan(*, quick: bool = False) -> Plan:
    """Return the runs of the random designs: all that the rule can choose for them."""
    references, runs = {}, []
    for kind in QUICK_KINDS if quick else KINDS:
        levels = ("quick",) if quick else ("quick", "standard") if kind == "friction" else tuple(LEVELS)
        for number in trade_cases.CONFIRMING[kind][: 2 if quick else None]:
            fineness: Fineness = "rough" if quick else "coarser"
            references[number, kind] = _references(number, kind, fineness, confirm=True)
            runs += _calculated(number, kind, confirm=True)
            trial = trade_cases.trial(number, kind, SECTION[kind], confirm=True)
            runs += [Run(trial, LEVELS[level]) for level in levels]
    return Plan(True, references, tuple(runs))


def _fineness(number: int) -> Fineness:
    """Return the fineness of the references of a chosen design."""
    design = trade_cases.designs()[number]
    slender = design.L > trade_cases.SLENDER * design.D
    return "coarser" if slender or number >= trade_cases.COMMON else "usual"


def _references(number: int, kind: Kind, fineness: Fineness, *, confirm: bool = False) -> tuple[Run, Run, Run]:
    trial = trade_cases.trial(number, kind, SECTION[kind], confirm=confirm)
    first, second, third = trade_cases.references(kind, fineness)
    return Run(trial, first), Run(trial, second), Run(trial, third)


def _calculated(number: int, kind: Kind, *, confirm: bool = False) -> list[Run]:
    """Return the runs of all formulas and, without Coulomb friction, of the surrogate."""
    trial = trade_cases.trial(number, kind, "auto", confirm=confirm)
    levels = trade_cases.FORMULAS if kind == "friction" else (*trade_cases.FORMULAS, SHIPPED)
    return [Run(trial, level) for level in levels]


def run(planned: Plan, folder: Path | None, progress: Progress | None = None) -> list[Row]:
    """Return all states with costs and errors; solves that the folder's solves.jsonl holds are not repeated."""
    # the key of a run holds the version of its model's physics
    store = checkpoint.opened(None if folder is None else folder / "solves.jsonl", "trade 2")
    runs = [*(one for three in planned.references.values() for one in three), *planned.runs]
    needed = {one.key: one for one in runs}
    solves = {}
    for i, (key, one) in enumerate(needed.items()):
        answer = store.known.get(key)
        if answer is None:
            if progress is not None:
                progress(i / len(needed), one.name)
            answer = trade_solves.measure(one)
            if trade_solves.is_kept(one, answer):
                store.keep(key, answer)
        solves[key] = trade_solves.solved(one.trial, answer, store.commits.get(key) or checkpoint.commit())
    return list(_states(planned, solves))


def _states(planned: Plan, solves: Mapping[str, Solved]) -> Iterator[Row]:
    """Yield the states of all runs with their errors.

    `message` is the reason why a formula is outside its range, or why a model has no answer; `cost` are CPU seconds
    over those of the section model at level standard on the same path, None if one is not known.
    """
    references = {place: _reference(three, solves) for place, three in planned.references.items()}
    for one in planned.runs:
        trial, solved = one.trial, solves[one.key]
        truths = references[trial.number, one.kind]
        unit = solves.get(Run(replace(trial, model=SECTION[one.kind]), LEVELS["standard"]).key)
        cost = math.nan if unit is None else solved.cpu_s / unit.cpu_s
        run: Row = {"design": trial.number, "confirming": planned.confirming, "kind": one.kind}
        run |= {"model": one.model, "level": one.level}
        paid = {"cpu_s": solved.cpu_s, "peak_MB": solved.peak_MB, "cost": cost if math.isfinite(cost) else None}
        scales = full_scales(trial.design, [truth for truth in truths if truth is not None])
        for i, load in enumerate(trial.loads):
            place = {"depth_mm": load.depth, "shear_mm": load.shear_x, "friction": load.friction}
            status, message, along, errors = _judged(trial, solved.states, i, truths[i], scales)
            state = with_errors(run | place | {"status": status}, errors)
            yield state | {"along_N": along} | paid | {"message": message, "commit": solved.commit}


def _judged(
    trial: Trial, solved: Sequence[SolvedState], i: int, truth: Reference | None, scales: Sequence[float]
) -> tuple[str, str, float | None, dict[str, tuple[float, float]]]:
    """Return status, message, force along the shear and errors of the i-th load; no errors without a reference."""
    # the last state of a path that stopped holds the reason
    answer, load = solved[min(i, len(solved) - 1)], trial.loads[i]
    if i >= len(solved) or answer.status != "ok" or answer.response is None:
        return "lost" if i >= len(solved) else answer.status, answer.message, None, {}
    if truth is None:
        return "no_reference", "a mesh of the reference has no stable answer", None, {}
    values = components(trial.design, load, answer.response)
    unpressed = buckling.sideways_stiffness(trial.design) * load.shear
    along = values["sideways"][0] if "sideways" in values else None
    return "ok", answer.message, along, true_errors(values, truth, scales, unpressed)


def _reference(three: Sequence[Run], solves: Mapping[str, Solved]) -> list[Reference | None]:
    """Return the reference of each state of a path; None where a mesh has no answer or an unstable one."""
    references: list[Reference | None] = []
    trial = three[0].trial
    for i, load in enumerate(trial.loads):
        answers: list[Components] = []
        for one in three:
            states = solves[one.key].states
            state = states[i] if i < len(states) else None
            if state is not None and state.status == "ok" and state.response is not None:
                answers.append(components(trial.design, load, state.response))
        sizes = [one.method.section_size for one in three if not isinstance(one.method, str)]
        references.append(extrapolate(sizes, answers) if len(answers) == len(three) else None)
    return references
