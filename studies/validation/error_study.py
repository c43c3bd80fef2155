"""True errors of the finite elements and their error estimates, compared with much finer meshes.

templates/accuracy.md.j2 defines the errors and the goals. A state is a row of accuracy.csv: design, load and
status, then forces, motions and cost of its three solves, then value, error and estimate of each quantity.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fem import equilibrium
from fem.accuracy import LEVELS, QUICK, Accuracy, coarser
from fem.analyses import modes, small_shear, stability
from fem.analyses.modes import Modes
from fem.analyses.small_shear import SmallShear
from fem.analyses.stability import Critical
from fem.results.error_estimates import estimate_response
from fem.scene import Model, Scene
from geometry.design import BadInput
from geometry.loads import Load, Magnet, Response
from geometry.messages import Progress
from studies.output import checkpoint, records
from studies.output.provenance import ROOT
from studies.validation import error_study_cases
from studies.validation.error_study_cases import TANGENT_SCENES, Trial
from studies.validation.pages import Row

RESPONSES = ("force", "shift", "tilt", "sideways")
QUANTITIES = (*RESPONSES, "depth", "stiffness", "frequency")
"""Quantities that are compared: first those of a path of loads, then those that follow from a tangent."""
GOALS = {"quick": 0.03, "standard": 0.01, "fine": 0.003}
WIDER = {
    "critical": {"quick": 0.05, "standard": 0.04, "fine": 0.01},
    "small shear": {"quick": 0.03, "standard": 0.02, "fine": 0.01},
}
"""Largest true errors of the levels, and wider ones of two scenes; the page gives the reasons."""
COVERAGE, SHARPNESS, SHARP, CLEAR = 0.95, 0.5, 3.0, 3e-4
"""Goals of coverage and sharpness; an estimate is sharp up to SHARP true errors, or up to CLEAR in any case."""
REPEATS, NUDGE = 3, 1e-4
"""Number of meshes of tetrahedra for each state, and relative change of their size from one to the next: even a tiny
change gives another section."""
FINE_SHEARS = (0, 1, 2, 3)
FAR_SHEARS: dict[Magnet, Sequence[int]] = {"rigid": range(error_study_cases.DESIGNS), "ignored": range(2)}
SOLIDS, PRESSED, CHECKED, UNHELD = (0, 3), (0, 3, 7), (0, 6), range(0, error_study_cases.DESIGNS, 2)
"""Designs of the parts of the study: FINE_SHEARS are also sheared at level fine and FAR_SHEARS are sheared far;
SOLIDS are sheared and PRESSED are pressed with tetrahedra; the reference of CHECKED is compared with a finer one; the
tangents of UNHELD are also solved without a magnet. Design 7 has little silicone above its magnet."""
ESTIMATING = ("fem/accuracy.py", "fem/results/error_estimates.py")
"""Paths of modules that no kept solve depends on, because the study solves without estimates."""
TANGENT_MODULES = ("fem/analyses/stability.py", "fem/analyses/small_shear.py", "fem/analyses/modes.py")
"""Modules of `fem` that only the scenes of tangents use."""
NOTHING = 1e-6
"""Shift in mm, tilt in rad or force along the shear in N below which a relative error has no meaning."""
COUNT = 8
"""Number of natural frequencies of each trial."""
Tangent = Critical | SmallShear | Modes
TANGENTS: dict[str, type[Critical] | type[SmallShear] | type[Modes]] = dict(
    zip(TANGENT_SCENES, (Critical, SmallShear, Modes), strict=True)
)
"""Type of the result of each scene that follows from a tangent."""
ROLES = ("", "companion_", "reference_")
"""Prefixes of the columns of a state's three solves: its level, the coarser level of its estimate, the reference."""
NAMES = {"": "level", "companion_": "coarser level", "reference_": "reference"}
"""Names of ROLES in messages."""
UNSTABLE = ("unstable", "stable")
"""Statuses of a path beyond its instability, and of a search that found none: no error can be measured."""
DISAGREES = "disagrees"
"""Status of a state that is stable, or has an answer, by some of its three solves only."""


@dataclass(frozen=True, slots=True)
class SolvedState:
    """One solved state, without estimates; None where the solve failed or has no such value.

    Attributes
    ----------
    response : response of a state on a path of loads.
    tangent : critical state, small shear or modes about a press.
    """

    status: str
    message: str
    model: str | None = None
    dofs: int | None = None
    iterations: int | None = None
    cpu_s: float | None = None
    response: Response | None = None
    tangent: Tangent | None = None

    def kept(self) -> Row:
        """Return the state as a row of solves.jsonl, which `restored` reads."""
        row = records.flat(self)
        row["response"] = None if self.response is None else dataclasses.asdict(self.response)
        row["found"] = None if self.tangent is None else dataclasses.asdict(self.tangent)
        del row["tangent"]
        return records.known(row)


def restored(scene: str, answer: Mapping[str, Any]) -> SolvedState:
    """Return the solved state of a scene from its row in solves.jsonl."""
    values = dict(answer)
    response, tangent = values.pop("response", None), values.pop("found", None)
    return SolvedState(
        **values,
        response=None if response is None else Response.restored(response),
        tangent=None if tangent is None else TANGENTS[scene](**_without_estimates(tangent)),
    )


def _without_estimates(values: Mapping[str, Any]) -> Row:
    """Return the values of a tangent, with tuples in place of JSON's lists."""
    tuples = {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
    return {name: value for name, value in tuples.items() if name != "estimates"}


@dataclass(frozen=True, slots=True)
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
    def solves(self) -> dict[str, tuple[Trial, Accuracy] | tuple[Trial, Accuracy, Accuracy]]:
        """Trial and accuracy of each solve, by ROLES: the level, its coarser level, the reference.

        The coarser level of a small shear and of modes has a third value: the level that locates the edge of its
        contact, as for the estimates that a user gets.
        """
        trial, level = self.trial, replace(self.level, solid_size=self.level.solid_size * (1 + NUDGE * self.repeat))
        # the section model resolves the same state on a far finer mesh than tetrahedra can
        reference = replace(trial, model="auto") if trial.model == "half" else trial
        check, located = level.name == "reference", trial.scene in ("small shear", "modes")
        return {
            "": (trial, level),
            "companion_": (trial, coarser(level), level) if located else (trial, level if check else coarser(level)),
            "reference_": (reference, error_study_cases.reference(trial.scene, 2 if check else self.fineness)),
        }


def tasks(*, quick: bool = False) -> list[Task]:
    """Return all tasks, the fast ones first; if quick, two designs at level quick and a coarser reference."""
    if quick:
        chosen = [_task(n, "rigid", scene, "quick") for scene in ("press", "stick") for n in (0, 1)]
        chosen += [_task(0, "rigid", scene, "quick") for scene in TANGENTS]
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
    held: tuple[tuple[Magnet, Sequence[int]], ...] = (("rigid", numbers), ("ignored", UNHELD))
    for scene in TANGENTS:
        for magnet, these in held:
            chosen += [_task(n, magnet, scene, name) for n in these for name in names[:2]]
            chosen += [_task(n, magnet, scene, "fine") for n in these if n in FINE_SHEARS]
    return chosen


def _task(number: int, magnet: Magnet, scene: str, level: str, model: Model = "auto", repeat: int = 0) -> Task:
    return Task(error_study_cases.trial(number, magnet, scene, model), LEVELS[level], repeat)


def run(
    progress: Progress, *, quick: bool = False, folder: Path | None = None, minutes: float = math.inf
) -> list[Row]:
    """Return all states with their errors; solves in the folder's solves.jsonl by the same code are not repeated.

    No further solve begins after `minutes`: states whose solves are incomplete have the status not_run.
    """
    end = time.monotonic() + 60 * minutes
    chosen = tasks(quick=quick)
    store = checkpoint.opened(None if folder is None else folder / "solves.jsonl", code())
    needed = {key(*solve): solve for task in chosen for solve in task.solves.values()}
    for i, (name, solve) in enumerate(needed.items()):
        trial, accuracy, *_ = solve
        if name in store.known:
            continue
        if time.monotonic() > end:
            break
        progress(i / len(needed), f"{trial.name}, {accuracy.name}")
        store.keep(name, [state.kept() for state in follow(*solve)])
    known = {
        name: [restored(trial.scene, answer) for answer in store.known[name]]
        for name, (trial, *_) in needed.items()
        if name in store.known
    }
    return [
        state | {"commit": store.commits_of(key(*solve) for solve in task.solves.values())}
        for task in chosen
        for state in states_of(task, known)
    ]


def follow(trial: Trial, accuracy: Accuracy, located: Accuracy | None = None) -> list[SolvedState]:
    """Return the states of a trial, without estimates; an exception becomes the last state, its text the message.

    Parameters
    ----------
    located : accuracy at which the edge of the contact is located, see `fem.analyses.modes.modes`.
    """
    if trial.scene in TANGENTS:
        return [_tangent_state(trial, load.depth, accuracy, located) for load in trial.loads]
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


def _tangent_state(trial: Trial, depth: float, accuracy: Accuracy, located: Accuracy | None) -> SolvedState:
    """Return the state at a depth of a trial of tangents; a failure is a state as well."""
    begin = time.process_time()
    try:
        tangent = _tangent(trial, depth, accuracy, located)
    except Exception as error:
        # the study goes on: a crash is one of its results
        status = "failed" if isinstance(error, BadInput) else "crashed"
        return SolvedState(status, f"{type(error).__name__}: {error}")
    spent = time.process_time() - begin
    if isinstance(tangent, Critical) and tangent.depth is None:
        message = f"{tangent.message or 'no instability'} down to {tangent.stable_to:.4g} mm"
        return SolvedState("stable", message, cpu_s=spent)
    return SolvedState("ok", "", cpu_s=spent, tangent=tangent)


def _tangent(trial: Trial, depth: float, accuracy: Accuracy, located: Accuracy | None) -> Tangent:
    design, magnet = trial.design, trial.magnet
    if trial.scene == "critical":
        return stability.critical(design, magnet, accuracy=accuracy, deepest=depth, estimate=False)
    if trial.scene == "small shear":
        return small_shear.small_shear(design, depth, magnet, accuracy=accuracy, located=located, estimate=False)
    return modes.modes(design, magnet, COUNT, depth=depth, accuracy=accuracy, located=located, estimate=False)


def key(trial: Trial, accuracy: Accuracy, located: Accuracy | None = None) -> str:
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
    kind = [trial.scene, _digest(TANGENT_MODULES)] if tangent else trial.model
    edges = [] if located is None else [located.section_size, located.section_patch]
    numbers = dataclasses.astuple(used), QUICK.section_size, *edges
    return json.dumps([trial.magnet, kind, dataclasses.astuple(trial.design), *loads, *numbers])


def code() -> str:
    """Return a digest of the modules that solve a path of loads.

    New rules of the estimates or new levels do not change it and do not invalidate kept solves. The key of a solve
    holds the rest: the numbers of `fem.accuracy`, and a digest of the modules that only tangents use.
    """
    apart = (*ESTIMATING, *TANGENT_MODULES)
    return checkpoint.digest(checkpoint.modules("geometry", "fem", apart=apart))


@functools.cache
def _digest(names: tuple[str, ...]) -> str:
    return checkpoint.digest(ROOT / name for name in names)


def states_of(task: Task, known: Mapping[str, Sequence[SolvedState]]) -> list[Row]:
    """Return a row with its errors for each load of a task, or for each of its natural frequencies.

    Parameters
    ----------
    known : the solved states by `key`.
    """
    trial, not_run = task.trial, [SolvedState("not_run", "no time")]
    paths = {role: known.get(key(*task.solves[role]), not_run) for role in ROLES}
    tangent, rows = trial.scene in TANGENTS, []
    for i, load in enumerate(trial.loads):
        # the last state of a path that stopped holds the reason
        solved = {role: path[min(i, len(path) - 1)] for role, path in paths.items()}
        lost = not tangent and any(i >= len(path) for path in paths.values())
        row = without_errors(trial, task.level, load, solved, repeat=task.repeat, lost=lost)
        if row["status"] != "ok":
            rows.append(row)
        elif tangent:
            rows += _tangent_rows(task, load, row, solved)
        else:
            rows.append(_with_errors(task, load, row, solved))
    return rows


def without_errors(
    trial: Trial,
    level: Accuracy,
    load: Load,
    states: Mapping[str, SolvedState],
    *,
    repeat: int = 0,
    lost: bool = False,
) -> Row:
    """Return design, load, and status of the three solves of a state.

    `scene` is the group of the statistics, in which the press before a shear is a scene of its own, "pressed";
    `path` is the scene of the whole path.

    Parameters
    ----------
    states : the three solves by ROLES.
    lost : whether a path stopped before this load.
    """
    bad = {role: state for role, state in states.items() if state.status != "ok"}
    status = next((state.status for state in bad.values()), "lost" if lost else "ok")
    if status in UNSTABLE and len({state.status for state in states.values()}) > 1:
        status = DISAGREES
    return {
        "design": trial.number,
        "odd": trial.odd,
        "magnet": trial.magnet,
        "scene": "pressed" if trial.scene == "stick" and not load.shear_x else trial.scene,
        "path": trial.scene,
        "model": "axisymmetric" if trial.scene in TANGENTS else states[""].model or trial.model,
        "level": level.name,
        "repeat": repeat,
        "depth_mm": load.depth,
        "shear_mm": 0.0 if trial.scene in TANGENTS else load.shear_x,
        "status": status,
        "message": "; ".join(f"{NAMES[role]}: {state.message}" for role, state in bad.items()),
    }


def _with_errors(task: Task, load: Load, row: Row, solved: Mapping[str, SolvedState]) -> Row:
    """Return the row with the numbers of its three solves, its true errors and its estimates.

    Errors are NaN where the reference is (nearly) zero.
    """
    for role, state in solved.items():
        assert state.response is not None
        (force_x, _, force_z), (shift_x, _, shift_z) = state.response.force, state.response.shift
        values = {"force_x_N": force_x, "force_z_N": force_z, "shift_x_mm": shift_x, "shift_z_mm": shift_z}
        values |= {"tilt_rad": state.response.tilt}
        cost = {"dofs": state.dofs, "iterations": state.iterations, "cpu_s": state.cpu_s}
        row |= {f"{role}{name}": value for name, value in records.known(values | cost).items()}
    one, other, truth = (solved[role].response for role in ROLES)
    assert one is not None
    assert other is not None
    assert truth is not None
    trial = task.trial
    scene = Scene(trial.design, trial.loads, task.level, trial.magnet, trial.model)
    estimates = estimate_response(one, other, load, scene, row["model"])
    sideways = truth.force[0] if load.shear_x else 0.0
    vectors: dict[str, tuple[Sequence[float], Sequence[float]]] = {
        "force": (one.force, truth.force),
        "shift": (one.shift, truth.shift),
        "tilt": ((one.tilt,), (truth.tilt,)),
        "sideways": ((one.force[0],), (sideways,)),
    }
    for name, (a, b) in vectors.items():
        size = math.hypot(*b)
        known = name == "force" or size > NOTHING
        row[f"{name}_error"] = math.dist(a, b) / size if known else math.nan
        row[f"{name}_estimate"] = nan_if_none(getattr(estimates, name)) if known else math.nan
    return row


def _tangent_rows(task: Task, load: Load, row: Row, solved: Mapping[str, SolvedState]) -> Iterator[Row]:
    """Yield the row of a critical state or a small shear with its errors, or one for each natural frequency.

    A user gets the same estimates.
    """
    row |= {f"{role}cpu_s": state.cpu_s for role, state in solved.items()}
    one, other, truth = (solved[role].tangent for role in ROLES)
    scene = Scene(task.trial.design, (load,), task.level, task.trial.magnet)
    if isinstance(one, Modes) and isinstance(other, Modes) and isinstance(truth, Modes):
        # frequencies of one shape are paired in rising order, because modes of different shapes may swap places
        left: dict[str, list[float]] = {}
        for frequency, shape in zip(truth.frequency, truth.shape, strict=True):
            left.setdefault(shape, []).append(frequency)
        estimated = modes.estimate_frequencies(one, other, scene)
        for value, shape, estimate in zip(one.frequency, one.shape, estimated, strict=True):
            if left.get(shape):
                yield row | {"shape": shape, **judged("frequency", value, left[shape].pop(0), estimate)}
        return
    names: tuple[str, ...] = ("stiffness", "shift", "tilt")
    estimates: Any
    if isinstance(one, Critical) and isinstance(other, Critical):
        names, estimates = ("depth", "force"), stability.estimate_critical(one, other, scene)
    else:
        assert isinstance(one, SmallShear)
        assert isinstance(other, SmallShear)
        estimates = small_shear.estimate_small_shear(one, other, scene)
    for name in names:
        value, coarse, true = (getattr(tangent, name) for tangent in (one, other, truth))
        row |= judged(name, value, true, getattr(estimates, name), coarse)
    yield row


def judged(
    quantity: str, value: float, reference: float, estimate: float | None, companion: float | None = None
) -> Row:
    """Return the columns of a quantity: values of its solves, relative error, estimate (NaN if it is unknown)."""
    columns = {quantity: value, f"reference_{quantity}": reference, f"{quantity}_error": abs(value / reference - 1)}
    return records.known(
        columns | {f"{quantity}_estimate": nan_if_none(estimate), f"companion_{quantity}": companion}
    )


def nan_if_none(estimate: float | None) -> float:
    """Return an estimate, or NaN for None."""
    return math.nan if estimate is None else estimate
