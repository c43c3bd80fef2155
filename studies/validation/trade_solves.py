"""Solves of the study of cost and error with their CPU seconds and peak memory, finite elements in their own process.

A server process imports the modules once and starts a process for each solve. CPU seconds therefore contain no
imports, the memory of one solve is not mistaken for that of another, and a solve that crashes costs only itself.
"""

from __future__ import annotations

import contextlib
import functools
import math
import multiprocessing
import os
import resource
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from analytic import beam
from fem.accuracy import QUICK, Accuracy
from fem.physics_version import PHYSICS
from fem.scene import Scene
from geometry.design import BadInput
from studies.surrogate import surrogate_response
from studies.validation import error_study, trade_cases
from studies.validation.bench_programs import THREADS
from studies.validation.error_study import SolvedState, restored
from studies.validation.error_study_cases import Trial
from studies.validation.trade_cases import SHIPPED, SURROGATE, Kind

LIMIT_S = 900.0
"""Longest time of a solve on the clock; a longer one is stopped, and its states are missing."""
REPEATS, SURROGATE_REPEATS = 50, 10
"""Number of times that formulas and the surrogate are evaluated: one evaluation is too short to be measured."""
PRELOADED = "studies.validation.trade_solves"
"""Module that the server process imports."""


@dataclass(frozen=True, slots=True)
class Run:
    """One path of loads by one model.

    Attributes
    ----------
    method : accuracy of the finite elements, level of the formulas, or SHIPPED for the surrogate.
    """

    trial: Trial
    method: Accuracy | str

    @property
    def kind(self) -> Kind:
        """Kind of the scene."""
        return next(kind for kind, scene in trade_cases.SCENES.items() if scene == self.trial.scene)

    @property
    def model(self) -> str:
        """Finite-element model, "formula" or "surrogate"."""
        if self.method == SHIPPED:
            return SURROGATE
        return "formula" if isinstance(self.method, str) else self.trial.model

    @property
    def level(self) -> str:
        """Name of the accuracy, or level of the formulas or the surrogate."""
        return self.method if isinstance(self.method, str) else self.method.name

    @property
    def key(self) -> str:
        """All that the answer depends on, as text; for finite elements with the version of their physics."""
        if isinstance(self.method, str):
            return f"{self.model} {self.method}, {error_study.key(self.trial, QUICK)}"
        model = Scene(self.trial.design, self.trial.loads, self.method, self.trial.magnet, self.trial.model).model
        return f"{model} {PHYSICS[model]}, {error_study.key(self.trial, self.method)}"

    @property
    def name(self) -> str:
        """Text for the progress of the study."""
        return f"design {self.trial.number}, {self.kind}, {self.model} {self.level}"


@dataclass(frozen=True, slots=True)
class Solved:
    """States of a path, without error estimates, and what they cost.

    Attributes
    ----------
    cpu_s : CPU seconds of the whole path, mesher included, without imports; NaN if the process was lost.
    peak_MB : largest memory beyond that of the imported modules; NaN if the process was lost.
    commit : that of the code that solved it.
    """

    states: tuple[SolvedState, ...]
    cpu_s: float
    peak_MB: float
    commit: str = ""


def measure(run: Run) -> dict[str, Any]:
    """Return the answer of one run, as JSON; finite elements are solved in a process of their own."""
    if isinstance(run.method, str):
        return _measure_calculated(run.trial, run.method)
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([PRELOADED])
    here, there = context.Pipe(duplex=False)
    with _one_thread():
        process = context.Process(target=_solve, args=(there, run), daemon=True)
        process.start()
    there.close()
    try:
        if not here.poll(LIMIT_S):
            return _lost("not_finished", f"stopped after {LIMIT_S:g} s")
        answer: dict[str, Any] = here.recv()
    except EOFError:
        process.join()
        return _lost("crashed", f"the process ended with status {process.exitcode}")
    finally:
        process.kill()
        process.join()
        here.close()
    return answer


def solved(trial: Trial, answer: Mapping[str, Any], commit: str = "") -> Solved:
    """Return the states of an answer of `measure`."""
    states = tuple(restored(trial.scene, state) for state in answer["states"])
    return Solved(states, answer["cpu_s"], answer["peak_MB"], commit)


def is_kept(run: Run, answer: Mapping[str, Any]) -> bool:
    """Whether an answer may serve a later run: not that of a formula or surrogate, of a lost process, or of a crash.

    Formulas and the surrogate take milliseconds, and their code may change without a version that says so. A lost
    process may have met a busy machine, and a crash is a fault of the code.
    """
    crashed = any(state["status"] == "crashed" for state in answer["states"])
    return not isinstance(run.method, str) and math.isfinite(answer["cpu_s"]) and not crashed


def _lost(status: str, message: str) -> dict[str, Any]:
    return {"states": [SolvedState(status, message).kept()], "cpu_s": math.nan, "peak_MB": math.nan}


@contextlib.contextmanager
def _one_thread() -> Iterator[None]:
    """Let processes that start now compute on one thread."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


def _solve(connection: Connection, run: Run) -> None:
    """Solve a run and send its answer; runs in the solve's own process."""
    import signal

    from fem.solve import direct_solver

    # an interruption of the study reaches the parent, which then ends this process
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # loading the solver's library is an import
    direct_solver.have_pardiso()
    assert isinstance(run.method, Accuracy)
    base, begin = _peak(), _cpu()
    states = error_study.follow(run.trial, run.method)
    spent = _cpu() - begin
    connection.send({"states": [state.kept() for state in states], "cpu_s": spent, "peak_MB": _peak() - base})


def _measure_calculated(trial: Trial, level: str) -> dict[str, Any]:
    """Return the answer of formulas or of the surrogate; their memory is too little to be measured.

    The first evaluation, in which the surrogate is read and factorized, does not count, as imports do not.
    """
    follow = follow_surrogate if level == SHIPPED else functools.partial(follow_formula, level=level)
    repeats = SURROGATE_REPEATS if level == SHIPPED else REPEATS
    states, begin = follow(trial), time.process_time()
    for _ in range(repeats):
        follow(trial)
    spent = (time.process_time() - begin) / repeats
    return {"states": [state.kept() for state in states], "cpu_s": spent, "peak_MB": 0.0}


def follow_formula(trial: Trial, level: str) -> list[SolvedState]:
    """Return the states of a trial by the formulas of a level; a refused load has the status refused."""
    states = []
    for load in trial.loads:
        begin = time.process_time()
        try:
            response = beam.solve(trial.design, load, level)
        except BadInput as error:
            states.append(SolvedState("refused", str(error), level))
        else:
            outside, spent = beam.outside(trial.design, load, level), time.process_time() - begin
            states.append(SolvedState("ok", outside, level, cpu_s=spent, response=response))
    return states


def follow_surrogate(trial: Trial) -> list[SolvedState]:
    """Return the states of a trial by the surrogate; a load outside its range has the status refused."""
    states = []
    for load in trial.loads:
        begin = time.process_time()
        try:
            response = surrogate_response.respond(trial.design, load, trial.magnet).response
        except BadInput as error:
            states.append(SolvedState("refused", str(error), SURROGATE))
        else:
            spent = time.process_time() - begin
            states.append(SolvedState("ok", "", SURROGATE, cpu_s=spent, response=response))
    return states


def _cpu() -> float:
    """Return the CPU seconds of this process and of its children that have ended, such as the mesher."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def _peak() -> float:
    """Return the largest resident memory of this process and of its children so far, MB."""
    used = (resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return max(used) / (1e6 if sys.platform == "darwin" else 1e3)
