"""The paths that a study needs: where the answers to its cases are stored, and the solves of what is missing.

All places are known before the first solve, so that each path is solved once, to all states that the study needs and
the store lacks. Memory grows with the number of distinct problems, not with the number of cases.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from analytic import beam
from fem.accuracy import LEVELS
from fem.scene import Scene
from geometry.design import BadInput
from geometry.loads import ANSWERED
from geometry.messages import Progress
from studies.inputs.study_input import needs_load
from studies.mechanics import path_solver
from studies.mechanics import store as store_module
from studies.mechanics.model_choice import UNMET, Choice, along_shear, choose, unmet
from studies.mechanics.path_solver import KINDS, NAN, Answer, Kind, Place, Task, solve_task
from studies.mechanics.store import Position, Store
from studies.mechanics.study_cases import Cases, FemModel, Plan, Problem, Recent
from studies.mechanics.tasks import finished, opened
from studies.quantities import stored_values

if TYPE_CHECKING:
    from studies.mechanics.tasks import Executor

AT_ONCE = 8192
"""Problems that are looked at at a time."""
MOST_WORKERS = 1024
"""Largest number of processes; a larger one is taken for a mistake."""
IMPOSSIBLE = Answer(1.0, 1.0, None, "bad_input", "", NAN, 0.0)
"""Stands for the answer to an impossible problem."""


@dataclass(frozen=True, slots=True)
class Processes:
    """What solves: processes of this machine (None: as many as pay), or the workers of a Dask scheduler.

    `workers` may also be an executor that several studies share. `retry_failed`: what failed because a process
    died is solved again.
    """

    workers: int | Executor | None = None
    scheduler: str | None = None
    retry_failed: bool = False

    def __post_init__(self) -> None:
        if self.workers is not None and self.scheduler is not None:
            raise BadInput(
                "`workers` is for processes on this machine and `scheduler` for a cluster: give one of them"
            )
        is_executor = self.workers is None or hasattr(self.workers, "submit")
        if not is_executor and not (isinstance(self.workers, int) and 0 <= self.workers <= MOST_WORKERS):
            raise BadInput(f"`workers` must be a whole number from 0 to {MOST_WORKERS}; got {self.workers!r}")

    def opened(self) -> AbstractContextManager[Executor]:
        """Yield the executor, for several studies; its workers end with the context."""
        return opened(self.workers, self.scheduler)


@dataclass(frozen=True, slots=True)
class Target:
    """Where the answer of a problem by one model is.

    key, at, direction : key of its path, position there, direction of the shear; the key of an impossible problem, or
        of one that a formula or the surrogate answers, is empty.
    formula : the answer of a level of the formulas, or of the surrogate.
    """

    key: str
    at: Position = (0.0, 0.0)
    direction: tuple[float, float] = (1.0, 0.0)
    message: str = ""
    formula: Answer | None = None
    choice: Choice | None = None


def surrogate_answers(problems: Sequence[Problem]) -> list[Answer]:
    """Return the surrogate's answers; their error estimates are half widths of 90 % intervals."""
    from studies.beam import surrogate_response

    possible = [(k, (p.design, p.load, p.magnet)) for k, p in enumerate(problems) if p.design and p.load]
    answers = [replace(IMPOSSIBLE, message=problem.message) for problem in problems]
    estimates = surrogate_response.respond_all([case for _, case in possible])
    for (k, (design, _, _)), estimate in zip(possible, estimates, strict=True):
        if isinstance(estimate, str):
            answers[k] = replace(IMPOSSIBLE, message=estimate)
            continue
        errors, values = dict(estimate.errors), {"largest_strain": estimate.strain}
        force = errors.pop("force")
        assert force is not None
        answers[k] = Answer(
            design.D, design.E_now, estimate.response, "ok", estimate.message, force, 0.0, errors, values
        )
    return answers


class Solves:
    """The paths that a study needs, in the order of its cases, and their missing states.

    Workers solve these, and they are written to the store as they arrive. Paths are numbered from 1.
    """

    def __init__(
        self, plan: Plan, cases: Cases, store: Store, processes: Processes, progress: Progress | None
    ) -> None:
        self.plan, self.store = plan, store
        self.paths: dict[str, Place] = {}
        self._targets: Recent[dict[str, Target]] = Recent()
        self._answers: Recent[dict[Position, Answer]] = Recent()
        tasks, keys = [], list[str]()
        for number, (key, wanted) in enumerate(self._wanted(cases).items(), 1):
            states, again = store.states(self.paths[key].content), ("transient",) if processes.retry_failed else ()
            reached = sorted(at for at, state in states.items() if state.outcome == "ok")
            values = stored_values(plan.quantities) if self.paths[key].kind == "states" else ()
            lacking = {
                at
                for at in wanted
                if at not in states or states[at].outcome in again or path_solver.lacks(states[at], values)
            }
            if lacking:
                tasks.append(
                    path_solver.task(
                        number, self.paths[key], sorted(lacking), reached, ratios="sideways_stiffness_ratio" in values
                    )
                )
                keys.append(key)
        self.numbers = {key: number for number, key in enumerate(self.paths, 1)}
        self._keys, self._open, self.count = list(self.paths), set(keys), len(tasks)
        by = processes.workers, processes.scheduler
        self._finished = finished(tasks, solve_task, *by, cost=cost, progress=progress)

    def _wanted(self, cases: Cases) -> dict[str, dict[Position, None]]:
        """Note the first place of each path, and return the positions that the study needs on it."""
        wanted: dict[str, dict[Position, None]] = {}
        firsts = cases.distinct_problems()
        for start in range(0, len(firsts), AT_ONCE):
            batch = cases.batch(firsts[start : start + AT_ONCE])
            for k in batch.problem.tolist():
                for target, stored in self._places(batch.problems[k]).values():
                    if stored is not None:
                        self.paths.setdefault(target.key, stored)
                        wanted.setdefault(target.key, {})[target.at] = None
        return wanted

    def targets(self, code: int, problem: Problem) -> Mapping[str, Target]:
        """Return where the answers to a problem are, by the names of the models and other quantities."""
        return self._targets.get(code, lambda: {name: target for name, (target, _) in self._places(problem).items()})

    def _places(self, problem: Problem) -> dict[str, tuple[Target, Place | None]]:
        # critical depths and modes alone need no state under a load
        first: Kind = "states" if needs_load(self.plan.quantities) else KINDS[self.plan.quantities[0]]
        kinds = {model.name: (model, first) for model in self.plan.fem if not model.surrogate}
        if self.plan.reference is not None:
            kinds |= {name: (self.plan.reference, KINDS[name]) for name in self.plan.quantities if name in KINDS}
        return {name: self._place(problem, *kind) for name, kind in kinds.items()}

    @staticmethod
    def _place(problem: Problem, model: FemModel, kind: Kind) -> tuple[Target, Place | None]:
        if problem.design is None or problem.load is None:
            return Target("", message=problem.message), None
        choice = None
        try:
            if model.tolerance is not None and kind == "states":
                choice = choose(problem.design, [problem.load], model.tolerance, problem.magnet)
                if choice.model_kind != "fem":
                    if choice.model_kind == "formula":
                        response = beam.solve(problem.design, problem.load, choice.level_or_accuracy)
                        found = Answer(problem.design.D, problem.design.E_now, response, "ok", "", choice.bound, 0.0)
                    else:
                        (found,) = surrogate_answers([problem])
                    return Target("", formula=found, choice=choice), None
                model = FemModel(model.name, LEVELS[choice.level_or_accuracy], model.model)
            scene = Scene(problem.design, (problem.load,), model.accuracy, problem.magnet, model.model)
            stored = path_solver.place(scene, kind, problem.motion)
        except BadInput as error:
            return Target("", message=str(error)), None
        key = store_module.key(stored.content)
        return Target(key, stored.at, stored.direction, choice=choice), stored

    def is_solved(self, key: str) -> bool:
        """Return whether all states of a path that the study needs are solved, or have failed."""
        return key not in self._open

    def wait(self, key: str) -> None:
        """Wait until a path is solved; the states of all tasks that finish until then go to the store."""
        try:
            while key in self._open:
                done = next(self._finished)
                solved = self._keys[done.task.number - 1]
                states = path_solver.unsolved(done.task, done.reason) if done.answer is None else done.answer
                self.store.add(self.paths[solved].content, states)
                self._open.discard(solved)
        except KeyboardInterrupt:
            count = self.count - len(self._open)
            said = "nothing new is solved yet: the same command starts from the beginning"
            if count:
                file = self.store.file
                said = f"{count} of {self.count} solves are kept in {file}; the same command continues from there"
            raise KeyboardInterrupt(said) from None

    def answer(self, target: Target, problem: Problem) -> Answer:
        """Return the answer to a problem, for its own design; its status says if it may be beyond the tolerance."""
        if target.formula is not None:
            return target.formula
        if problem.design is None or problem.load is None or not target.key:
            return Answer(1.0, 1.0, None, "bad_input", target.message, NAN, 0.0)
        stored = self.answers(target.key)
        if target.at not in stored:
            raise BadInput(
                f"states have been removed from the store {str(self.store.file)!r} while the sweep was running: give "
                "the same command again"
            )
        answer = stored[target.at].of(problem.design.D, problem.design.E_now, target.direction)
        if target.choice is None or answer.response is None or answer.status not in ANSWERED:
            return answer
        estimates = {"force": answer.error_estimate, **answer.estimates}
        along = along_shear(problem.load, answer.response)
        reason = unmet(target.choice, problem.design, problem.load, along, estimates)
        if not reason:
            return answer
        return replace(answer, status=UNMET, message="; ".join(filter(None, (answer.message, reason))))

    def answers(self, key: str) -> Mapping[Position, Answer]:
        """Return the stored answers of a path, by their positions."""
        path = self.paths[key]
        edge = path.scene.accuracy.section_size
        return self._answers.get(
            key,
            lambda: {at: path_solver.answer(state, edge) for at, state in self.store.states(path.content).items()},
        )

    def close(self) -> None:
        """Stop the workers."""
        self._finished.close()


def cost(task: Task) -> float:
    """Return the expected time of a task on one core, s, right within a factor of about three.

    Measured on the paper's sensor; what counts is the ratio between tasks.
    """
    scene = task.scene
    loads = 1 + 0.2 * len(scene.loads)
    size = math.pow(0.09 / scene.accuracy.section_size, 1.5)
    if task.kind != "states":
        return size * {"response": 2.0, "cycle": 7.0}.get(task.kind, 1.0) * (6.0 if scene.sideways else 1.0)
    if scene.solid:
        alone = 20.0 if scene.model == "half" else 60.0
        return alone * loads * math.pow(0.14 / scene.accuracy.solid_size, 3.0)
    slides = scene.coulomb is not None and scene.sideways
    harmonics = scene.harmonics_at(max(scene.loads[0].depth / scene.design.D, 0.01)) / 3 if scene.plate_tilt else 1.0
    fields = (2.0 if scene.turns else 1.0) * max(harmonics, 1.0)
    return size * loads * fields**2 * (6.0 if slides else 0.8 if scene.model == "harmonic" else 0.15)
