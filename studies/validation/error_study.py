"""True errors of the finite elements and their error estimates, compared with much finer meshes (verb accuracy).

ABOUT, which the report prints, defines the errors and the goals.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from fem import equilibrium
from fem.accuracy import LEVELS, QUICK, Accuracy, coarser
from fem.results.error_estimates import estimate_response
from fem.scene import Model, Scene
from geometry.loads import Load, Magnet, Response
from geometry.messages import Progress
from studies.output import checkpoint
from studies.output.provenance import ROOT
from studies.validation import error_study_cases, error_study_tangents
from studies.validation.error_study_cases import Trial
from studies.validation.error_study_records import (
    ROLES,
    TANGENTS,
    ErrorState,
    Judged,
    PathSolve,
    SolvedState,
    error_state,
    nan_if_none,
    restored,
)

ABOUT = """\
The answers of the finite elements at each accuracy level, and their error estimates, are compared with solutions on
much finer meshes (the reference).

The true error of a state is the norm of the difference between its vector (force; shift of the magnet; tilt) and that
of the reference, over the norm of the reference's vector. `sideways` is the error of the force along the shear alone,
which is a small part of the force under a plate. `coverage` is the share of states whose true error is at most the
estimate; its goal is 95 %. `sharpness` is the share of states whose estimate is at most three times the true error,
or so small (0.03 %) that the reference itself is hardly better; its goal is 50 %.

Critical depths and forces, small shears of a glued plate and natural frequencies are compared in the same way. The
goals of critical states and small shears are wider. A deep critical state depends on the silicone that touches the
base beside the clamp, which is only one or two elements wide. A small shear depends on where the glued contact area
ends.

States without a comparison are listed below. They miss a goal, unless all three solves call the state unstable, or
find no instability. An estimate that is unknown counts as too small.
"""

RESPONSES = ("force", "shift", "tilt", "sideways")
QUANTITIES = (*RESPONSES, "depth", "stiffness", "frequency")
"""Quantities that are compared: first those of a path of loads, then those that follow from a tangent."""
GOALS = {"quick": 0.03, "standard": 0.01, "fine": 0.003}
WIDER = {
    "critical": {"quick": 0.05, "standard": 0.04, "fine": 0.01},
    "small shear": {"quick": 0.03, "standard": 0.02, "fine": 0.01},
}
"""Largest true errors of the levels, and wider ones of two scenes; ABOUT gives the reasons."""
COVERAGE, SHARPNESS, SHARP, CLEAR = 0.95, 0.5, 3.0, 3e-4
"""Goals of coverage and sharpness; an estimate is sharp up to SHARP true errors, or up to CLEAR in any case."""
REPEATS, NUDGE = 3, 1e-4
"""Number of meshes of tetrahedra for each state, and relative change of their size from one to the next: even a tiny
change makes fTetWild generate another mesh."""
FINE_SHEARS = (0, 1, 2, 3)
FAR_SHEARS: dict[Magnet, Sequence[int]] = {"rigid": range(error_study_cases.DESIGNS), "ignored": range(2)}
SOLIDS, PRESSED, CHECKED, UNHELD = (0, 3), (0, 3, 7), (0, 6), range(0, error_study_cases.DESIGNS, 2)
"""Designs of the parts of the study: FINE_SHEARS are also sheared at level fine and FAR_SHEARS are sheared far;
SOLIDS are sheared and PRESSED are pressed with tetrahedra; the reference of CHECKED is compared with a finer one; the
tangents of UNHELD are also solved without a magnet. Design 7 has little silicone above its magnet."""
ESTIMATING = ("fem/accuracy.py", "fem/results/error_estimates.py", "fem/results/error_estimate_rules.py")
"""Paths of modules that no kept solve depends on, because the study solves without estimates."""
NOTHING = 1e-6
"""Shift in mm, tilt in rad or force along the shear in N below which a relative error has no meaning."""


@dataclasses.dataclass(frozen=True, slots=True)
class Task:
    """A trial at one level, at the coarser level of its estimate, and on the reference; or reference and finer mesh.

    Attributes
    ----------
    repeat : number of the mesh, for tetrahedra.
    fineness : of the reference, as in `error_study_cases.reference`.
    """

    trial: Trial
    level: Accuracy
    repeat: int = 0
    fineness: int = 1

    @property
    def solves(self) -> dict[str, tuple[Trial, Accuracy]]:
        """Trial and accuracy of each solve, by ROLES: the level, its coarser level, the reference."""
        trial, level = self.trial, replace(self.level, solid_size=self.level.solid_size * (1 + NUDGE * self.repeat))
        # the section model resolves the same state on a far finer mesh than tetrahedra can
        reference = replace(trial, model="auto") if trial.model == "half" else trial
        check = level.name == "reference"
        return {
            "": (trial, level),
            "companion_": (trial, level if check else coarser(level)),
            "reference_": (reference, error_study_cases.reference(trial.scene, 2 if check else self.fineness)),
        }


def tasks(*, quick: bool = False) -> list[Task]:
    """Return all tasks, the fast ones first; if quick, two designs at level quick and a coarser reference."""
    if quick:
        chosen = [_task(n, "rigid", scene, "quick") for scene in ("press", "stick") for n in (0, 1)]
        chosen += [Task(error_study_tangents.trial(0, "rigid", scene), LEVELS["quick"]) for scene in TANGENTS]
        return [replace(task, fineness=0) for task in chosen]
    names, numbers, repeats = ("quick", "standard", "fine"), range(error_study_cases.DESIGNS), range(REPEATS)
    magnets: Sequence[Magnet] = ("rigid", "ignored")
    chosen = [_task(n, m, s, name) for s in ("press", "deep") for name in names for m in magnets for n in numbers]
    checked = [error_study_cases.trial(n, "rigid", scene, "auto") for scene in ("press", "stick") for n in CHECKED]
    chosen += [Task(trial, error_study_cases.reference(trial.scene)) for trial in checked]
    chosen += [_task(n, "rigid", "friction", name) for n in numbers for name in names[:2]]
    for magnet in magnets:
        chosen += [_task(n, magnet, s, name) for s in ("stick", "grip") for n in numbers for name in names[:2]]
        chosen += [_task(n, magnet, "far", name) for n in FAR_SHEARS[magnet] for name in names[:2]]
        chosen += [_task(n, magnet, s, "fine") for s in ("stick", "grip") for n in FINE_SHEARS]
        for scene, solids in (("press", PRESSED), ("stick", SOLIDS)):
            chosen += [
                _task(n, magnet, scene, name, "half", i) for name in names[:2] for n in solids for i in repeats
            ]
    return chosen + [
        Task(trial, LEVELS[name]) for trial, name in error_study_tangents.chosen(numbers, FINE_SHEARS, UNHELD)
    ]


def _task(number: int, magnet: Magnet, scene: str, level: str, model: Model = "auto", repeat: int = 0) -> Task:
    return Task(error_study_cases.trial(number, magnet, scene, model), LEVELS[level], repeat)


def run(
    *, quick: bool = False, folder: Path | None = None, minutes: float = math.inf, progress: Progress | None = None
) -> list[ErrorState]:
    """Return all states with their errors; solves in the folder's solves.jsonl by the same code are not repeated.

    No further solve begins after `minutes`: states whose solves are incomplete have the status not_run.
    """
    end = time.monotonic() + 60 * minutes
    chosen = tasks(quick=quick)
    store = checkpoint.opened(None if folder is None else folder / "solves.jsonl", code())
    needed = {key(*solve): solve for task in chosen for solve in task.solves.values()}
    for i, (name, (trial, accuracy)) in enumerate(needed.items()):
        if name in store.known:
            continue
        if time.monotonic() > end:
            break
        if progress is not None:
            progress(i / len(needed), f"{trial.name}, {accuracy.name}")
        solve = error_study_tangents.follow if trial.scene in TANGENTS else follow
        store.keep(name, [state.kept() for state in solve(trial, accuracy)])
    known = {
        name: [restored(trial.scene, answer) for answer in store.known[name]]
        for name, (trial, _) in needed.items()
        if name in store.known
    }
    return [
        replace(state, commit=store.commits_of(key(*solve) for solve in task.solves.values()))
        for task in chosen
        for state in states_of(task, known)
    ]


def follow(trial: Trial, accuracy: Accuracy) -> list[SolvedState]:
    """Return the states of a trial, without estimates; an exception becomes the last state, its text the message."""
    states, begin = [], time.process_time()
    try:
        scene = Scene(trial.design, trial.loads, accuracy, trial.magnet, trial.model)
        for s in equilibrium.walk(scene, estimate=False):
            spent, begin = time.process_time() - begin, time.process_time()
            states.append(SolvedState(s.status, s.message, s.model, s.dofs, s.newton_iterations, spent, s.response))
    except Exception as error:
        # the study goes on: a crash is one of its results
        states.append(SolvedState("crashed", f"{type(error).__name__}: {error}"))
    return states


def key(trial: Trial, accuracy: Accuracy) -> str:
    """Return all that a solve depends on beside the code, as text.

    Numbers of the accuracy that the trial does not use are set to 0, so that levels that differ only in these share a
    solve. QUICK.section_size belongs to the key because the contact radius is determined on sections of level quick.
    """
    used = replace(accuracy, name="")
    used = replace(used, section_patch=0) if trial.scene == "friction" else replace(used, friction_step_factor=0)
    if trial.model == "auto":
        used = replace(used, solid_size=0, solid_patch=0)
    if trial.scene in ("press", "deep"):
        used = replace(used, harmonics=0, section_patch=0)
    if trial.scene in TANGENTS:
        used = replace(used, harmonics=0)
    loads = [dataclasses.astuple(load) for load in trial.loads]
    tangent = trial.scene in TANGENTS
    kind = [trial.scene, _digest(error_study_tangents.MODULES)] if tangent else trial.model
    numbers = dataclasses.astuple(used), QUICK.section_size
    return json.dumps([trial.magnet, kind, dataclasses.astuple(trial.design), *loads, *numbers])


def code() -> str:
    """Return a digest of the modules that solve a path of loads.

    New rules of the estimates or new levels do not change it and do not invalidate kept solves. The key of a solve
    holds the rest: the numbers of `fem.accuracy`, and a digest of the modules that only tangents use.
    """
    apart = (*ESTIMATING, *error_study_tangents.MODULES)
    return checkpoint.digest(checkpoint.modules("geometry", "fem", apart=apart))


@functools.cache
def _digest(names: tuple[str, ...]) -> str:
    return checkpoint.digest(ROOT / name for name in names)


def states_of(task: Task, known: Mapping[str, Sequence[SolvedState]]) -> list[ErrorState]:
    """Return a state with its errors for each load of a task, or for each of its natural frequencies.

    Parameters
    ----------
    known : the solved states by `key`.
    """
    trial, not_run = task.trial, [SolvedState("not_run", "no time")]
    paths = {role: known.get(key(*task.solves[role]), not_run) for role in ROLES}
    if trial.scene in TANGENTS:
        return error_study_tangents.states_of(trial, task.level, paths)
    states = []
    for i, load in enumerate(trial.loads):
        # the last state of a path that stopped holds the reason
        solved = {role: path[min(i, len(path) - 1)] for role, path in paths.items()}
        lost = any(i >= len(path) for path in paths.values())
        state = error_state(trial, task.level, load, solved, repeat=task.repeat, lost=lost)
        states.append(_with_errors(task, load, state, solved) if state.status == "ok" else state)
    return states


def _with_errors(task: Task, load: Load, state: ErrorState, solved: Mapping[str, SolvedState]) -> ErrorState:
    """Return the state with the numbers of its three solves, its true errors and its estimates."""
    responses = [solved[role].response for role in ROLES]
    one, other, truth = (response for response in responses if response is not None)
    level, companion, reference = (
        _path_solve(solved[role], response) for role, response in zip(ROLES, (one, other, truth), strict=True)
    )
    judged = _judged(task, state.model, load, one, other, truth)
    return replace(state, solve=level, companion=companion, reference=reference, judged=tuple(judged))


def _path_solve(state: SolvedState, response: Response) -> PathSolve:
    (force_x, _, force_z), (shift_x, _, shift_z) = response.force, response.shift
    return PathSolve(force_x, force_z, shift_x, shift_z, response.tilt, state.dofs, state.iterations, state.cpu_s)


def _judged(task: Task, model: str, load: Load, one: Response, other: Response, truth: Response) -> Iterator[Judged]:
    """Yield true errors and estimates; NaN where the reference is (nearly) zero."""
    trial = task.trial
    scene = Scene(trial.design, trial.loads, task.level, trial.magnet, trial.model)
    estimates = estimate_response(one, other, load, scene, model)
    sideways = truth.force[0] if load.shear_x else 0.0
    vectors = (
        ("force", one.force, truth.force, estimates.force),
        ("shift", one.shift, truth.shift, estimates.shift),
        ("tilt", (one.tilt,), (truth.tilt,), estimates.tilt),
        ("sideways", (one.force[0],), (sideways,), estimates.sideways),
    )
    for name, a, b, estimate in vectors:
        if name == "force" or math.hypot(*b) > NOTHING:
            yield Judged(name, math.dist(a, b) / math.hypot(*b), nan_if_none(estimate))
        else:
            yield Judged(name, math.nan, math.nan)
