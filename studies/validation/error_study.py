"""How far the error estimates of `fem` and its accuracy levels can be trusted: both against much finer meshes.

ABOUT, which the report prints, says how.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from fem import equilibrium
from fem.accuracy import LEVELS, QUICK, Accuracy, coarser
from fem.equilibrium import Model
from fem.error_estimates import estimate_response
from geometry.loads import Load, Magnet, Response
from studies.output import result_store
from studies.output.provenance import ROOT
from studies.validation import error_study_cases, error_study_tangents
from studies.validation.error_study_cases import Trial

ABOUT = """\
How far the error estimates of `fem` and its accuracy levels can be trusted: both against much finer meshes.

The true error of a state is the length of the difference of its vector (force; shift of the magnet; tilt) to that of
the reference, over the length of the reference's; `sideways` is that of the force along the shear alone, a small part
of the force's vector under a plate. `coverage` is the share of states whose true error is at most the estimate,
`sharpness` the share whose estimate is at most three times the true error, or so small that the reference itself is
not much better. Critical depths and forces, small shears of a glued plate and natural frequencies are judged in the
same way. Their goals are wider: a deep critical state depends on the skin that lies on the base beside the clamp, no
more than an element or two, and a small shear on where the glued patch ends.
States that did not end well, or whose error exceeds JUMP, are listed and left out of the statistics.
"""

Progress = Callable[[float, str], None]
Row = dict[str, Any]
State = dict[str, Any]

RESPONSES = ("force", "shift", "tilt", "sideways")
QUANTITIES = (*RESPONSES, "depth", "stiffness", "frequency")
"""What is judged in the states of a path, and after them what a tangent tells."""
GOALS = {"quick": 0.03, "standard": 0.01, "fine": 0.003}
WIDER = {
    "critical": {"quick": 0.05, "standard": 0.04, "fine": 0.01},
    "small shear": {"quick": 0.03, "standard": 0.02, "fine": 0.01},
}
COVERAGE, SHARPNESS, SHARP, CLEAR = 0.95, 0.5, 3.0, 3e-4
JUMP = 0.25
REPEATS, NUDGE = 3, 1e-4
"""Meshes of tetrahedra for each state, and the relative change of their size from one to the next: the least change
makes fTetWild come to another mesh."""
FINE_SHEARS = (0, 1, 2, 3)
FAR_SHEARS: dict[Magnet, Sequence[int]] = {"rigid": range(error_study_cases.DESIGNS), "ignored": range(2)}
SOLIDS, PRESSED, CHECKED, UNHELD = (0, 3), (0, 3, 7), (0, 6), range(0, error_study_cases.DESIGNS, 2)
"""Designs that are sheared at level fine too, those sheared far, those sheared and those pressed with tetrahedra,
those whose reference is checked, and those whose tangents are looked at without a magnet too. Design 7 has little
silicone above its magnet."""
ESTIMATING = ("fem/accuracy.py", "fem/error_estimates.py", "fem/error_estimate_rules.py")
"""Modules whose code no solve depends on, by their path in the project: the study asks for no estimates."""
NOTHING = 1e-6
"""Shift in mm, tilt in rad or force along the shear in N, below which there is no relative error."""


@dataclasses.dataclass(frozen=True, slots=True)
class Task:
    """A trial at one level, the companion of that level, and the reference; or the reference against a finer one."""

    trial: Trial
    level: Accuracy
    repeat: int = 0
    fineness: int = 1

    @property
    def solves(self) -> dict[str, tuple[Trial, Accuracy]]:
        """What has to be solved: the level, its companion, the reference."""
        trial, level = self.trial, replace(self.level, solid_size=self.level.solid_size * (1 + NUDGE * self.repeat))
        judge = replace(trial, model="auto") if trial.model == "half" else trial
        check = level.name == "reference"
        return {
            "": (trial, level),
            "companion_": (trial, level if check else coarser(level)),
            "reference_": (judge, error_study_cases.reference(trial.scene, 2 if check else self.fineness)),
        }


def tasks(*, quick: bool = False) -> list[Task]:
    """All of them, the cheap ones first; if quick, two designs at level quick and against a rougher reference."""
    if quick:
        made = [_task(n, "rigid", scene, "quick") for scene in ("press", "stick") for n in (0, 1)]
        made += [
            Task(error_study_tangents.trial(0, "rigid", scene), LEVELS["quick"])
            for scene in error_study_tangents.SCENES
        ]
        return [replace(task, fineness=0) for task in made]
    names, numbers, repeats = ("quick", "standard", "fine"), range(error_study_cases.DESIGNS), range(REPEATS)
    magnets: Sequence[Magnet] = ("rigid", "ignored")
    found = [_task(n, m, s, name) for s in ("press", "deep") for name in names for m in magnets for n in numbers]
    checked = [error_study_cases.trial(n, "rigid", scene, "auto") for scene in ("press", "stick") for n in CHECKED]
    found += [Task(trial, error_study_cases.reference(trial.scene)) for trial in checked]
    found += [_task(n, "rigid", "friction", name) for n in numbers for name in names[:2]]
    for magnet in magnets:
        found += [_task(n, magnet, s, name) for s in ("stick", "grip") for n in numbers for name in names[:2]]
        found += [_task(n, magnet, "far", name) for n in FAR_SHEARS[magnet] for name in names[:2]]
        found += [_task(n, magnet, s, "fine") for s in ("stick", "grip") for n in FINE_SHEARS]
        for scene, solids in (("press", PRESSED), ("stick", SOLIDS)):
            found += [_task(n, magnet, scene, name, "half", i) for name in names[:2] for n in solids for i in repeats]
    return found + [
        Task(trial, LEVELS[name]) for trial, name in error_study_tangents.chosen(numbers, FINE_SHEARS, UNHELD)
    ]


def _task(number: int, magnet: Magnet, scene: str, level: str, model: Model = "auto", repeat: int = 0) -> Task:
    return Task(error_study_cases.trial(number, magnet, scene, model), LEVELS[level], repeat)


def run(
    *, quick: bool = False, folder: Path | None = None, minutes: float = math.inf, progress: Progress | None = None
) -> list[Row]:
    """One row for each state; solves in the folder's solves.jsonl that the same code made are not done again.

    After `minutes` no further solve is begun: states that miss one have the status not_run.
    """
    end = time.monotonic() + 60 * minutes
    chosen = tasks(quick=quick)
    store = result_store.opened(None if folder is None else folder / "solves.jsonl", code())
    needed = {key(*solve): solve for task in chosen for solve in task.solves.values()}
    for i, (name, (trial, accuracy)) in enumerate(needed.items()):
        if name in store.known:
            continue
        if time.monotonic() > end:
            break
        if progress is not None:
            progress(i / len(needed), f"{trial.name}, {accuracy.name}")
        store.keep(
            name,
            error_study_tangents.follow(trial, accuracy)
            if trial.scene in error_study_tangents.SCENES
            else follow(trial, accuracy),
        )
    return [row for task in chosen for row in rows_of(task, store.known)]


def follow(trial: Trial, accuracy: Accuracy) -> list[State]:
    """The states of a trial, without estimates; an exception is the last state, with its text as the message."""
    states, begin = [], time.process_time()
    try:
        for s in equilibrium.walk(
            trial.design, trial.loads, accuracy, magnet=trial.magnet, model=trial.model, estimate=False
        ):
            spent, begin = time.process_time() - begin, time.process_time()
            states.append(
                {"status": s.status, "message": s.message, "model": s.model, "dofs": s.dofs}
                | {"iterations": s.newton_iterations, "cpu_s": spent, "response": dataclasses.asdict(s.response)}
            )
    except Exception as error:
        # whatever goes wrong with a mesh is a finding of this study
        states.append({"status": "crashed", "message": f"{type(error).__name__}: {error}"})
    return states


def key(trial: Trial, accuracy: Accuracy) -> str:
    """What a solve depends on beside the code, as text; the end of a contact is found on sections of level quick."""
    unused: dict[str, Any] = {"name": ""}
    unused |= {"section_patch": 0} if trial.scene == "friction" else {"rub": 0}
    unused |= {"solid_size": 0, "solid_patch": 0} if trial.model == "auto" else {}
    unused |= {"harmonics": 0, "section_patch": 0} if trial.scene in ("press", "deep") else {}
    if trial.scene in error_study_tangents.SCENES:
        unused |= {"harmonics": 0}
    loads = [dataclasses.astuple(load) for load in trial.loads]
    used = dataclasses.astuple(replace(accuracy, **unused))
    kind = (
        [trial.scene, _digest(error_study_tangents.MODULES)]
        if trial.scene in error_study_tangents.SCENES
        else trial.model
    )
    return json.dumps([trial.magnet, kind, dataclasses.astuple(trial.design), *loads, used, QUICK.section_size])


def code() -> str:
    """A digest of the modules that solve a path of loads, so that new rules or levels do not void what is solved.

    What else a solve depends on is in its key: the numbers of `fem.accuracy`, and a digest of the modules that only a
    tangent needs.
    """
    apart = (*ESTIMATING, *error_study_tangents.MODULES)
    return result_store.digest(result_store.modules("geometry", "fem", apart=apart))


@functools.cache
def _digest(names: tuple[str, ...]) -> str:
    return result_store.digest(ROOT / name for name in names)


def rows_of(task: Task, known: dict[str, list[State]]) -> list[Row]:
    """A row for each load of a task."""
    none = [{"status": "not_run", "message": "no time"}]
    paths = {role: known.get(key(*solve), none) for role, solve in task.solves.items()}
    if task.trial.scene in error_study_tangents.SCENES:
        return [_leap(row) for row in error_study_tangents.rows_of(task.trial, task.level, paths)]
    return [
        _row(
            task,
            i,
            {role: path[min(i, len(path) - 1)] for role, path in paths.items()},
            i >= min(map(len, paths.values())),
        )
        for i in range(len(task.trial.loads))
    ]


def _row(task: Task, i: int, found: dict[str, State], lost: bool) -> Row:
    trial, load = task.trial, task.trial.loads[i]
    bad = {role: state for role, state in found.items() if state["status"] != "ok"}
    row: Row = {
        "design": trial.number,
        "odd": trial.odd,
        "magnet": trial.magnet,
        "scene": "pressed" if trial.scene == "stick" and not load.shear_x else trial.scene,
        "path": trial.scene,
        "model": found[""].get("model", trial.model),
        "level": task.level.name,
        "repeat": task.repeat,
        "depth_mm": load.depth,
        "shear_mm": load.shear_x,
        "status": next((state["status"] for state in bad.values()), "lost" if lost else "ok"),
        "message": "; ".join(f"{role.strip('_') or 'level'}: {state['message']}" for role, state in bad.items()),
    }
    if row["status"] != "ok":
        return row
    for role, state in found.items():
        row |= _numbers(role, state)
    row |= _errors(task, row["model"], load, {role: _response(state) for role, state in found.items()})
    return _leap(row)


def _leap(row: Row) -> Row:
    """The row, with another status if an error is none of the mesh."""
    if any(row.get(f"{name}_error", 0.0) > JUMP for name in QUANTITIES):
        row |= {"status": "jump", "message": f"an error exceeds {JUMP:g}"}
    return row


def _response(state: State) -> Response:
    given = state["response"]
    return Response(**given | {name: tuple(given[name]) for name in ("force", "shift")})


def _numbers(role: str, state: State) -> Row:
    r = _response(state)
    return {
        f"{role}force_x_N": r.force[0],
        f"{role}force_z_N": r.force[2],
        f"{role}shift_x_mm": r.shift[0],
        f"{role}shift_z_mm": r.shift[2],
        f"{role}tilt_rad": r.tilt,
        f"{role}dofs": state["dofs"],
        f"{role}iterations": state["iterations"],
        f"{role}cpu_s": state["cpu_s"],
    }


def _errors(task: Task, model: str, load: Load, found: dict[str, Response]) -> Row:
    """True errors and estimates, NaN where there is nothing to be relative to."""
    one, other, truth = found[""], found["companion_"], found["reference_"]
    trial = task.trial
    estimates = estimate_response(one, other, load, trial.loads, task.level, model, trial.magnet, trial.design)
    pairs = [
        (one.force, truth.force),
        (one.shift, truth.shift),
        ((one.tilt,), (truth.tilt,)),
        ((one.force[0],), (truth.force[0] if load.shear_x else 0.0,)),
    ]
    row: Row = {}
    for name, (a, b) in zip(RESPONSES, pairs, strict=True):
        estimate = getattr(estimates, name)
        some = name == "force" or math.hypot(*b) > NOTHING
        row[f"{name}_error"] = math.dist(a, b) / math.hypot(*b) if some else math.nan
        row[f"{name}_estimate"] = estimate if some and estimate is not None else math.nan
    return row
