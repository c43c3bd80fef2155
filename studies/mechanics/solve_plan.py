"""The answers of a study's models to its problems: from the store, and the solves of what it lacks.

Before the first solve all models are asked for all problems of the study, so that each path is solved once, to all
states that the study needs and the store lacks. What a model needs only after an answer, such as a finer accuracy, is
solved in a further round. Memory grows with the number of distinct problems, not with the number of cases.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

from geometry.design import BadInput
from geometry.messages import Progress
from studies.inputs.study_input import needs_load
from studies.mechanics import path_solver
from studies.mechanics.model import Model
from studies.mechanics.path_solver import KINDS, Answer, Kind, Place, Task, impossible, solve_task
from studies.mechanics.store import Position, State, Store
from studies.mechanics.study_cases import Batch, Cases, Plan, Recent
from studies.mechanics.tasks import Finished, finished, opened
from studies.quantities import stored_values

if TYPE_CHECKING:
    from studies.mechanics.tasks import Executor

AT_ONCE = 8192
"""Problems that are looked at at a time."""
MOST_WORKERS = 1024
"""Largest number of processes; a larger one is taken for a mistake."""


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


Asked = Mapping[str, list[Answer | Place]]
"""Answers to the problems of a batch, or what is lacking for them, by the models' names, and by quantities that are
paths of their own."""


class Solves:
    """What the models of a study answer, in the order of its cases, and the solves of missing states.

    Workers solve these, and they are written to the store as they arrive. Paths are numbered from 1, in the order of
    the rows.

    store : None for a study that does not solve.
    """

    def __init__(
        self, plan: Plan, cases: Cases, store: Store | None, processes: Processes, progress: Progress | None
    ) -> None:
        self.plan, self.cases, self.processes, self.progress = plan, cases, processes, progress
        # critical depths and modes alone need no state under a load
        first: Kind = "states" if needs_load(plan.quantities) else KINDS[plan.quantities[0]]
        self.asks: dict[str, tuple[Model, Kind]] = {model.name: (model, first) for model in plan.models}
        if plan.reference is not None:
            self.asks |= {name: (plan.reference, KINDS[name]) for name in plan.quantities if name in KINDS}
        self.values = stored_values(plan.quantities)
        self.numbers: dict[str, int] = {}
        self._answers: Recent[Answer] = Recent()
        self._stored: Recent[Mapping[Position, tuple[Answer, bool]]] = Recent()
        self._places: dict[str, Place] = {}
        self._solved: set[tuple[str, Position]] = set()
        self._open: set[str] = set()
        self._finished: Generator[Finished[Task, list[State]]] | None = None
        self.count = 0
        if plan.solves:
            assert store is not None
            self.store = store
            self._begin()

    def answers(self, batch: Batch, before: Asked | None = None) -> Asked:
        """Return what is asked of the problems of a batch; `before`: what was known of the same batch."""
        return {name: self._asked(name, batch, (before or {}).get(name)) for name in self.asks}

    def _asked(self, name: str, batch: Batch, before: list[Answer | Place] | None) -> list[Answer | Place]:
        model, kind = self.asks[name]
        answers: list[Any] = list(before or (self._answers.values.get((name, code)) for code in batch.codes))
        lacking = [
            k
            for k, each in enumerate(answers)
            if each is None or (isinstance(each, Place) and each.key not in self._open)
        ]
        found = model.answers([batch.problems[k] for k in lacking], self._found, kind)
        for k, answer in zip(lacking, found, strict=True):
            answers[k] = answer
            if isinstance(answer, Answer):
                self._answers.add((name, batch.codes[k]), answer)
        return answers

    def _found(self, place: Place) -> Answer | None:
        """Return what the store has at a place, unless it lacks what the study asks for."""
        answer, is_whole = self._stored.get(place.key, lambda: self._read(place)).get(place.at, (None, False))
        if (place.key, place.at) not in self._solved:
            return answer if is_whole else None
        if answer is None:
            raise BadInput(
                f"states have been removed from the store {str(self.store.file)!r} while the sweep was running: give "
                "the same command again"
            )
        return answer

    def _read(self, place: Place) -> dict[Position, tuple[Answer, bool]]:
        """Return the stored answers of a path by their positions, and whether they have all that is asked for."""
        edge = place.scene.accuracy.section_size
        return {
            at: (replace(path_solver.answer(state, edge), path=place.key), not self._lacks(place, state))
            for at, state in self.store.states(place.content).items()
        }

    def _lacks(self, place: Place, state: State) -> bool:
        again = self.processes.retry_failed and state.outcome == "transient"
        return again or path_solver.lacks(state, self.values if place.kind == "states" else ())

    def _begin(self) -> None:
        """Ask for all problems of the study, and begin to solve what is lacking."""
        wanted: dict[str, dict[Position, None]] = {}
        self._places = {}
        for place in self._lacking():
            self._places.setdefault(place.key, place)
            wanted.setdefault(place.key, {})[place.at] = None
        tasks = []
        for number, (key, place) in enumerate(self._places.items(), 1):
            states = self.store.states(place.content)
            reached = sorted(at for at, state in states.items() if state.outcome == "ok")
            ratios = place.kind == "states" and "sideways_stiffness_ratio" in self.values
            tasks.append(path_solver.task(number, place, sorted(wanted[key]), reached, ratios=ratios))
        report, words = self.progress, "solves"
        if self.count and (shown := self.progress):
            # the bar does not fall back
            report, words = lambda _, text: shown(1.0, text), "further solves"
        self._keys, self._open = list(self._places), set(self._places)
        self.count += len(tasks)
        by = self.processes.workers, self.processes.scheduler
        self._finished = finished(tasks, solve_task, *by, cost=cost, progress=report, words=words)

    def _lacking(self) -> Iterator[Place]:
        """Yield what the store lacks, in the order of the cases."""
        solving = [name for name, (model, _) in self.asks.items() if model.solves]
        firsts = self.cases.distinct_problems()
        for start in range(0, len(firsts), AT_ONCE):
            batch = self.cases.batch(firsts[start : start + AT_ONCE])
            found = [self._asked(name, batch, None) for name in solving]
            for k in batch.problem.tolist():
                yield from (each[k] for each in found if isinstance(each[k], Place))

    def wait(self, place: Place) -> None:
        """Wait until a place is solved; the states of all tasks that finish until then go to the store."""
        if place.key not in self._open:
            for key in list(self._open):
                self._wait(key)
            self._begin()
        self._wait(place.key)

    def _wait(self, key: str) -> None:
        try:
            while key in self._open and self._finished is not None:
                done = next(self._finished)
                solved = self._keys[done.task.number - 1]
                states = path_solver.unsolved(done.task, done.reason) if done.answer is None else done.answer
                self.store.add(self._places[solved].content, states)
                self._stored.values.pop(solved, None)
                self._solved |= {(solved, state.position) for state in states}
                self._open.discard(solved)
        except KeyboardInterrupt:
            count = self.count - len(self._open)
            said = "nothing new is solved yet: the same command starts from the beginning"
            if count:
                file = self.store.file
                said = f"{count} of {self.count} solves are kept in {file}; the same command continues from there"
            raise KeyboardInterrupt(said) from None

    def answered(self, part: Batch, asked: Asked) -> tuple[dict[str, list[Answer]], list[int]]:
        """Return the answers to the cases of a part, and the number of the reference's path of each problem, 0 for
        none; what other problems of its batch lack is left empty."""
        numbers = [0] * len(part.problems)
        for k in dict.fromkeys(part.problem.tolist()):
            for name, answers in asked.items():
                if path := cast("Answer", answers[k]).path:
                    number = self.numbers.setdefault(path, len(self.numbers) + 1)
                    numbers[k] = number if self.plan.reference and name == self.plan.reference.name else numbers[k]
        empty = impossible("")
        whole = {name: [empty if isinstance(each, Place) else each for each in of] for name, of in asked.items()}
        return whole, numbers

    def close(self) -> None:
        """Stop the workers."""
        if self._finished is not None:
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
