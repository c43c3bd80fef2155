"""Cost and error of every model on designs over the whole range (verb trade).

ABOUT, which the report prints, describes the measurements.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from analytic import buckling
from fem.accuracy import LEVELS
from geometry.loads import Load
from geometry.messages import Progress
from studies.output import checkpoint, records
from studies.output.records import FlatRow
from studies.validation import trade_cases, trade_reference, trade_solves
from studies.validation.error_study import SolvedState
from studies.validation.error_study_cases import Trial
from studies.validation.trade_cases import KINDS, MODELS, SECTION, SHIPPED, Fineness, Kind
from studies.validation.trade_reference import QUANTITIES, Components, Reference, TrueError
from studies.validation.trade_solves import Run, Solved

ABOUT = """\
Every model follows the same paths of loads: four presses (one of them deep), three shears of a glued plate, and a
press and two slides with Coulomb friction. Depths and shears are in proportion to the design. Each solve runs in a
process of its own on one thread, without error estimates. `cpu_s` are the CPU seconds of a whole path without
imports, the mesher of tetrahedra included; `peak_MB` is the memory beyond that of the imported modules. Other
programs ran on the same machine, which inflates CPU seconds; `cost` is therefore the ratio to the press or shear of
the same design by the section model at level standard, in the same run.

The true error of force, shift and tilt is the norm of the difference between the vector and that of the reference,
over the norm of the reference; `sideways` is the force along the shear alone, and `along` its error over the larger
one of this force and that of the unpressed beam, because the force vanishes where the press buckles. The error of
the readings is the largest of S1, S2 and S3, in percent of full scale: the largest change from rest of the element
on the path, for S2 and S3 together. The reference is extrapolated from three meshes of the section, each finer by
sqrt(2), with harmonics in step. Each component is extrapolated by itself, if an order of at least 0.8 is observed;
its error bar is the last step of the extrapolation. Otherwise the reference is the finest mesh, and the bar is the
spread of the three meshes.
Formulas count inside the range of their level only (`analytic.beam.outside`; level paper states none), and so does
the surrogate, which refuses what lies outside (`studies.surrogate.surrogate_response`). Its cost is that of calls for
one load after the other, without the 50 ms in which a process reads it; for many designs at once a call costs far
less each (results/surrogate/SURROGATE.md). `unclear` is the share of errors that are less than three bars of their
reference: these errors may be those of the reference.
"""

SOLIDS = ("half", "full")
"""Models of tetrahedra."""
QUICK_KINDS: tuple[Kind, ...] = ("press", "glued shear")
"""Kinds of a quick study: a reference with friction takes a minute."""


@dataclass(frozen=True, slots=True)
class TradeState:
    """One state of a path by one model.

    Attributes
    ----------
    confirming : whether the design is one of those that confirm the rule.
    model, level : finite-element model and accuracy, "formula" and its level, or "surrogate" and "shipped".
    outside : reason why a formula is outside its range, or why a model has no answer; else empty.
    errors : true errors by quantity; none where the model or the reference has no answer.
    cpu_s, peak_MB : of the whole path; NaN if the process was lost.
    cost : CPU seconds over those of the section model at level standard on the same path; None if one is not known.
    commit : that of the code that solved it.
    along_N : force along the shear; None without a shear.
    """

    design: int
    confirming: bool
    kind: Kind
    model: str
    level: str
    load: Load
    status: str
    outside: str
    errors: Mapping[str, TrueError]
    cpu_s: float
    peak_MB: float
    cost: float | None = None
    commit: str = ""
    along_N: float | None = None

    def row(self) -> FlatRow:
        """Return the columns of trade.csv."""
        row: FlatRow = {
            "design": self.design,
            "confirming": self.confirming,
            "kind": self.kind,
            "model": self.model,
            "level": self.level,
            "depth_mm": self.load.depth,
            "shear_mm": self.load.shear_x,
            "friction": self.load.friction,
            "status": self.status,
        }
        for name in QUANTITIES:
            error = self.errors.get(name)
            row[f"{name}_error_percent"] = None if error is None else error.percent
            row[f"{name}_bar_percent"] = None if error is None else error.bar_percent
        costs = {"cpu_s": self.cpu_s, "peak_MB": self.peak_MB, "cost": self.cost}
        return row | {"along_N": self.along_N} | costs | {"message": self.outside, "commit": self.commit}


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


def run(planned: Plan, folder: Path | None, progress: Progress | None = None) -> list[TradeState]:
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


def _states(planned: Plan, solves: Mapping[str, Solved]) -> Iterator[TradeState]:
    """Yield the states of all runs with their errors."""
    references = {place: _reference(three, solves) for place, three in planned.references.items()}
    for one in planned.runs:
        truths = references[one.trial.number, one.kind]
        unit = solves.get(Run(_by_section(one.trial, one.kind), LEVELS["standard"]).key)
        state = TradeState(
            design=one.trial.number,
            confirming=planned.confirming,
            kind=one.kind,
            model=one.model,
            level=one.level,
            load=one.trial.loads[0],
            status="ok",
            outside="",
            errors={},
            cpu_s=solves[one.key].cpu_s,
            peak_MB=solves[one.key].peak_MB,
            cost=None if unit is None else _finite(solves[one.key].cpu_s / unit.cpu_s),
            commit=solves[one.key].commit,
        )
        scales = trade_reference.full_scales(one.trial.design, [truth for truth in truths if truth is not None])
        for i, load in enumerate(one.trial.loads):
            yield _with_errors(replace(state, load=load), one.trial, solves[one.key].states, i, truths[i], scales)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _with_errors(
    state: TradeState,
    trial: Trial,
    solved: Sequence[SolvedState],
    i: int,
    truth: Reference | None,
    scales: Sequence[float],
) -> TradeState:
    """Return the state of the i-th load with its errors; without errors if it has no answer or no reference."""
    # the last state of a path that stopped holds the reason
    answer = solved[min(i, len(solved) - 1)]
    if i >= len(solved) or answer.status != "ok" or answer.response is None:
        return replace(state, status="lost" if i >= len(solved) else answer.status, outside=answer.message)
    if truth is None:
        return replace(state, status="no_reference", outside="a mesh of the reference has no stable answer")
    values = trade_reference.components(trial.design, state.load, answer.response)
    unpressed = buckling.sideways_stiffness(trial.design) * state.load.shear
    errors = trade_reference.true_errors(values, truth, scales, unpressed)
    state = replace(state, along_N=values["sideways"][0] if "sideways" in values else None)
    return replace(state, outside=answer.message, errors=errors)


def _by_section(trial: Trial, kind: Kind) -> Trial:
    """Return the trial by the section model, whose cost is the unit."""
    return replace(trial, model=SECTION[kind])


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
                answers.append(trade_reference.components(trial.design, load, state.response))
        sizes = [one.method.section_size for one in three if not isinstance(one.method, str)]
        references.append(trade_reference.extrapolate(sizes, answers) if len(answers) == len(three) else None)
    return references


def trade_rows(states: Sequence[TradeState]) -> list[FlatRow]:
    """Return the rows of trade.csv."""
    return [records.known(state.row()) for state in states]
