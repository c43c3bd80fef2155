"""What 1e5 different solves take on a cluster of 100 cores, on paper with measured sizes and times.

Measured are the pickled sizes of a task and of its answer, the size of a stored state, the time to store a path, the
overhead of a task by the workers and by a Dask scheduler, and the time and memory of planning.
"""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

from studies.benchmarks.sweep_report import Figure
from studies.exploration import store, sweep_request
from studies.exploration.needed_paths import Paths, Processes, Solves
from studies.exploration.solved_paths import missing, solve_task, task
from studies.exploration.store import State
from studies.exploration.study_cases import Cases
from studies.exploration.workers import finished
from studies.output.provenance import ROOT

SOLVES, CORES = 100_000, 100
KINDS = {"press": ("depth=0.2,0.4,0.6,0.8,1", None), "shear": ("shear=0.2,0.4,0.6,0.8", 1.0)}
"""Axis and depth of the two kinds of solves."""
PATHS = 2_000
"""Paths that are written to measure the store."""
PLANNED = 10_000
"""Solves of the study whose planning is measured."""
TASKS = 300
"""Tasks without work, by which the overhead of a task is measured."""


def figures(folder: Path, seconds: Mapping[str, float], planned: int = PLANNED, tasks: int = TASKS) -> list[Figure]:
    """Return measured sizes and times, and the estimates that follow.

    Parameters
    ----------
    folder : for the store that is measured.
    seconds : time of a solve of each kind on one core, s.
    planned, tasks : numbers of the measurements, see `PLANNED` and `TASKS`.
    """
    alone, own = overhead(tasks, None)
    planning = _planning(planned)
    measured = [
        Figure("workers", "start of a worker process", alone, "s"),
        Figure("workers", "overhead of a task", 1e3 * own, "ms"),
        Figure("planning", "time of a solve with five depths", 1e6 * planning["seconds"] / planned, "us"),
        Figure("planning", "memory of a solve with five depths", 1e3 * planning["MB"] / planned, "kB"),
    ]
    dask = _dask_overhead(tasks)
    measured += (
        [] if dask is None else [Figure("workers", "overhead of a task by a Dask scheduler", 1e3 * dask, "ms")]
    )
    for kind, solve in seconds.items():
        measured += _of_kind(
            folder, kind, solve + (dask or own), planning["seconds"] / planned, planning["MB"] / planned
        )
    return measured


def _of_kind(folder: Path, kind: str, solve: float, plan: float, memory: float) -> list[Figure]:
    """Return sizes of one kind of solve, and its estimate.

    Parameters
    ----------
    solve : time of a solve with the overhead of its task, s.
    plan, memory : time, s, and memory, MB, of planning for each solve.
    """
    sent, received, states = _sizes(kind)
    single, together, size = _stored(folder / f"{kind}.sqlite", kind, states)
    case, total = f"{SOLVES} solves ({kind}) on {CORES} cores", SOLVES * len(states)
    compute, write, planned = SOLVES * solve / CORES, SOLVES * single, SOLVES * plan
    return [
        Figure(f"sizes ({kind})", "task", sent, "bytes"),
        Figure(f"sizes ({kind})", f"answer with {len(states)} states", received, "bytes"),
        Figure(f"sizes ({kind})", "store for each state", size, "bytes"),
        Figure(f"sizes ({kind})", "writing a path in a transaction of its own", 1e3 * single, "ms"),
        Figure(f"sizes ({kind})", "writing a path in one transaction with all others", 1e3 * together, "ms"),
        Figure(case, "time of the solves", compute / 60, "min"),
        Figure(case, "time of planning before the first solve", planned / 60, "min"),
        Figure(case, "time of writing, a transaction for each path", write / 60, "min"),
        Figure(case, "time of writing, one transaction", SOLVES * together / 60, "min"),
        Figure(case, "answers that the parent can store", 1 / single, "per s"),
        Figure(case, "answers that the workers give", CORES / solve, "per s"),
        Figure(case, "time in all, workers waiting for the parent", (planned + max(compute, write)) / 60, "min"),
        Figure(case, "traffic to and from the scheduler", SOLVES * (sent + received) / 1e6, "MB"),
        Figure(case, "size of the store", total * size / 1e6, "MB"),
        Figure(case, "memory of the parent for planning", SOLVES * memory, "MB"),
    ]


def _sizes(kind: str) -> tuple[int, int, list[State]]:
    """Return the pickled sizes of a task and its answer, bytes, and the states of the answer."""
    axis, depth = KINDS[kind]
    options = sweep_request.Options(["L=13", axis], depth=depth, accuracy="quick")
    plan = sweep_request.plan_of("paper", options)
    (path,) = Paths(plan, Cases(plan)).paths.values()
    with store.in_memory() as empty:
        one = task(1, path.place, missing(path.place, list(path.wanted), empty, retry=False)[0])
    states = solve_task(one)
    return len(pickle.dumps((solve_task, one))), len(pickle.dumps((states, None, 0.1))), states


def _stored(file: Path, kind: str, states: list[State]) -> tuple[float, float, float]:
    """Return the time of writing a path alone and among others, s, and the size of the store per state, bytes."""
    axis, depth = KINDS[kind]
    plan = sweep_request.plan_of("paper", sweep_request.Options(["L=13", axis], depth=depth))
    (path,) = Paths(plan, Cases(plan)).paths.values()
    contents = [path.place.content | {"nu": 0.3 + k / 1e6} for k in range(2 * PATHS)]
    with store.opened(file) as kept:
        begin = time.perf_counter()
        for content in contents[:PATHS]:
            kept.add(content, states)
        middle = time.perf_counter()
        kept.add_many([(content, states) for content in contents[PATHS:]])
        end = time.perf_counter()
    return (middle - begin) / PATHS, (end - middle) / PATHS, file.stat().st_size / (2 * PATHS * len(states))


def overhead(count: int, scheduler: str | None) -> tuple[float, float]:
    """Return the time until the first task without work is done, and then for each task, s."""
    times = []
    begin = time.perf_counter()
    for _ in finished([-1.0] * (count + 1), abs, workers=0 if scheduler else 1, scheduler=scheduler):
        times.append(time.perf_counter() - begin)
    return times[0], (times[-1] - times[0]) / count


def _dask_overhead(count: int) -> float | None:
    """Return the overhead of a task by a scheduler with one worker on this machine, s; None without Dask."""
    try:
        from distributed import LocalCluster
    except ImportError:
        return None
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
    ) as cluster:
        return overhead(count, cluster.scheduler_address)[1]


def _planning(solves: int) -> dict[str, float]:
    """Return the time and memory of planning a study, measured in a process of its own."""
    command = [sys.executable, "-m", "studies.benchmarks.cluster_estimate", str(solves)]
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    answer: dict[str, float] = json.loads(subprocess.run(command, env=env, check=True, capture_output=True).stdout)
    return answer


def plan_study(solves: int) -> dict[str, float]:
    """Plan a study of so many different presses with an empty store; return CPU time, s, and memory, MB."""
    axes = [f"L=lin:12:17:{solves}", KINDS["press"][0]]
    plan = sweep_request.plan_of("paper", sweep_request.Options(axes))
    before, begin = _peak_MB(), time.process_time()
    with store.in_memory() as empty:
        paths = Paths(plan, Cases(plan))
        needed = Solves(paths.paths, empty, Processes(workers=0), None)
        assert needed.count == solves
        needed.close()
    return {"seconds": time.process_time() - begin, "MB": _peak_MB() - before}


def _peak_MB() -> float:
    """Return the largest memory of this process, MB; that of `resource` begins with the memory of its parent."""
    lines = Path("/proc/self/status").read_text("utf-8").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


if __name__ == "__main__":
    print(json.dumps(plan_study(int(sys.argv[1]))))
