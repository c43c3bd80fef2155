"""Functions that tests hand to worker processes, which import this module by its name."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from studies.fabrication.sensor_parts import fabricated
from studies.mechanics import executor
from studies.output import atomic_files
from studies.web import explorer_workers


def echo(task):
    return task


def process(task):
    return os.getpid()


def environment(name):
    return os.environ[name]


def noted(folder):
    """Note this process in a folder, and sleep."""
    Path(folder, str(os.getpid())).touch()
    time.sleep(60)


def ends(*setup):
    """Begin a process that ends while it loads."""
    os._exit(5)


LOADS = "MAGTIP_TEST_LOADS"
"""Environment variable with a folder in which processes that load note themselves."""


def killed_four_times(*setup):
    """Begin a process, the first four of which are killed while they load."""
    folder = Path(os.environ[LOADS])
    (folder / str(os.getpid())).touch()
    if len(list(folder.iterdir())) < 5:
        os.kill(os.getpid(), signal.SIGKILL)
    executor.begin(*setup)


def with_child(folder):
    """Note a process that this one starts in a folder, and wait for it; without a folder do nothing."""
    if folder:
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
        Path(folder, str(child.pid)).touch()
        child.wait()


def counted(task):
    """Count the call of a task (file, kind) in its file; kind "kill" kills this process."""
    file, kind = task
    with Path(file).open("a") as lines:
        lines.write("x")
    if kind == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.05)
    return kind


SOLVES = "MAGTIP_TEST_SOLVES"
"""Environment variable with the file in which solves note that they begin."""


def noted_solve(task):
    """Note the length over D of a solve, by a single write, which is never mixed with others, and solve it."""
    with open(os.environ[SOLVES], "ab", 0) as log:
        log.write(f"{task.scene.design.L / task.scene.design.D!r}\n".encode())
    from studies.mechanics import path_solver

    return path_solver.solve_task(task)


def fabricated_or_waits(job):
    """Begin to write a variant, and finish that of L = 9 mm only."""
    with atomic_files.filled(job[2]) as folder, atomic_files.staged(folder) as stage:
        atomic_files.write_text(stage / "README.md", "recipe")
        time.sleep(0 if job[1]["L"] == 9 else 60)
    return fabricated("ok", "", job[2])


def fabricated_or_dies(job):
    """Say that a variant is made, but end the process at L = 9 mm."""
    if job[1]["L"] == 9:
        os._exit(7)
    return fabricated("ok", "", job[2])


def raises(kind):
    errors = {
        "exit": SystemExit(3),
        "interrupt": KeyboardInterrupt(),
        "odd": OddError(1, 2),
        "bug": ValueError("a bug"),
    }
    raise errors[kind]


def fails_at_depth(job):
    """Fail in another way at each depth of a job of the explorer; between and after them say that it is done."""
    depth = round(10 * job.request.state.load.depth)
    if depth == 1:
        import numpy as np

        raise np.linalg.LinAlgError("Singular matrix\nof rank 1")
    if depth in (2, 3):
        raises("odd" if depth == 2 else "exit")
    explorer_workers._talks[-1].say(json.dumps({"number": job.request.number}))
    if depth == 4:
        os._exit(7)


class OddError(Exception):
    """An exception that cannot be unpickled."""

    def __init__(self, first, second):
        super().__init__(f"{first} and {second}")


def until(condition, seconds=20.0):
    """Wait for a condition; returns whether it came true in time."""
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()


def gone(process):
    """Whether a process has ended; one that nobody has waited for is a zombie then."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


def children(pid):
    """Processes whose parent is a process, without the one that removes semaphores for Python."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            is_tracker = b"resource_tracker" in (folder / "cmdline").read_bytes()
            if int((folder / "stat").read_text().rpartition(")")[2].split()[1]) == pid and not is_tracker:
                found.append(int(folder.name))
    return found
