"""Fabrication of many variants of a design, each in a folder of its own, by several processes."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import os
import pickle
import queue
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.fabrication.fabrication_rows import FabricationRow
from studies.fabrication.sensor_parts import build
from studies.fabrication.sensor_solids import FabricationChoices
from studies.inputs import study_input
from studies.output import atomic_files, console, provenance

Job = tuple[Design, dict[str, float], Path, FabricationChoices, str]
"""Base design, the fields that the variant replaces, its folder, the fabrication choices, and the command line."""

COMMAND = (sys.executable, "-P", "-m", "studies.fabrication.design_variants")
"""Command line of a worker process. -P keeps it from importing modules of the user's current folder."""


def axes_of(texts: Sequence[str]) -> dict[str, list[float]]:
    """Return the axes of a batch from texts NAME=a,b,c; no texts give no axes."""
    axes = study_input.parse_axes(texts) if texts else {}
    if "depth" in axes:
        raise BadInput("cad has no axis 'depth': choose from D, L, f, E")
    return axes


def idle(design: Design, axes: Mapping[str, Sequence[float]]) -> list[tuple[str, str]]:
    """Return the axes that change no solid, each with the reason."""
    reasons = {"E": "E changes the drawing only, not the solids"} | design.unused_fields()
    return [(name, reasons[name]) for name, values in axes.items() if name in reasons and len(values) > 1]


def batch(
    design: Design,
    axes: Mapping[str, Sequence[float]],
    out: Path,
    progress: Progress,
    choices: FabricationChoices = FabricationChoices(),
    workers: int | None = None,
    command: str = "magtip cad",
) -> Iterator[FabricationRow]:
    """Call `build` for every combination of the axes' values and yield the rows in order.

    Each combination has a folder of its own, named after its values. The Hall elements keep their places in the base,
    as in a sweep. A combination that is impossible gives a row with status bad_input and the reason. Folders of a
    batch have drawings, but no picture.

    Parameters
    ----------
    workers : number of worker processes; default: the number of processors.
    command : command line that the recipes name as their origin.
    """
    points = [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]
    names = ["_".join(f"{key}{value:g}" for key, value in point.items()) for point in points]
    jobs: list[Job] = [
        (design, point, out / name, choices, command) for point, name in zip(points, names, strict=True)
    ]
    count = min(workers or os.cpu_count() or 1, len(jobs))
    with atomic_files.filled(out), _clean_up([out / name for name in names]), contextlib.ExitStack() as stack:
        rows: Iterator[FabricationRow] = map(fabricate, jobs)
        if count > 1:
            rows = stack.enter_context(_workers(count))(jobs)
        for k, (point, row) in enumerate(zip(points, rows, strict=True)):
            progress((k + 1) / len(jobs), row.folder.name)
            yield dataclasses.replace(row, variant=point)


def sentences_of(rows: Sequence[FabricationRow]) -> list[str]:
    """Return each warning and each reason of a failure once, with the folders of the variants that have it."""
    warned = [(row, text) for row in rows for text in dict.fromkeys(row.warnings)]
    failed = [(row, row.message) for row in rows if row.status != "ok"]
    sentences = [f"warning: {text}" for text in _named(warned)] + _named(failed)
    return [*sentences, f"{len(failed)} of {len(rows)} variants failed"] if failed else sentences


def _named(texts: Sequence[tuple[FabricationRow, str]]) -> list[str]:
    """Return each text once, with the folders of the variants that have it."""
    return console.remarks([{"variant": row.folder.name, "message": text} for row, text in texts], ("variant",))


@contextlib.contextmanager
def _workers(count: int) -> Iterator[Callable[[Sequence[Job]], Iterator[FabricationRow]]]:
    """Start worker processes and yield a function that has them do jobs; the processes end with the block.

    A thread for each process sends it one job at a time. A process that dies costs the job it had, no other.
    """
    processes: list[subprocess.Popen[bytes]] = []
    idle: queue.SimpleQueue[subprocess.Popen[bytes]] = queue.SimpleQueue()
    threads = ThreadPoolExecutor(count)

    def do(job: Job) -> FabricationRow:
        process = idle.get()
        try:
            if process.poll() is not None:
                # the CAD kernel or the system ended it during its last job
                processes.append(process := _start_worker())
            return _run_job(process, job)
        finally:
            idle.put(process)

    try:
        for _ in range(count):
            processes.append(_start_worker())
            idle.put(processes[-1])
        yield lambda jobs: threads.map(do, jobs)
    finally:
        # kill the processes before joining the threads: these wait for answers of the processes
        threads.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.kill()
        threads.shutdown()
        for process in processes:
            with contextlib.suppress(BrokenPipeError), process:
                pass


def _start_worker() -> subprocess.Popen[bytes]:
    """Start a worker process; it has a session of its own, so that Ctrl-C reaches only the process that ends it."""
    paths = [str(provenance.ROOT), os.environ.get("PYTHONPATH", "")]
    return subprocess.Popen(
        COMMAND,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )


def _run_job(process: subprocess.Popen[bytes], job: Job) -> FabricationRow:
    """Send a job to a process and return the row that it answers; an exception there is raised here."""
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        pickle.dump(job, process.stdin)
        process.stdin.flush()
        answer: FabricationRow | Exception = pickle.load(process.stdout)
    except (EOFError, BrokenPipeError):
        # the CAD kernel can crash a process, and the system can kill it when memory runs out
        message = f"its process ended with exit code {process.wait()}: make this variant by itself"
        return FabricationRow("failed", message, job[2])
    if isinstance(answer, Exception):
        raise answer
    return answer


@contextlib.contextmanager
def _clean_up(folders: Sequence[Path]) -> Iterator[None]:
    """Remove the temporary folders of unfinished variants if the block is left by an exception."""
    try:
        yield
    except BaseException:
        for folder in (folder for folder in folders if folder.is_dir()):
            # `filled` refuses a folder that another process is filling, and BadInput then leaves it alone
            with contextlib.suppress(BadInput), atomic_files.filled(folder):
                for stage in folder.glob(f"{atomic_files.WRITING}*"):
                    shutil.rmtree(stage, ignore_errors=True)
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise


def fabricate(job: Job) -> FabricationRow:
    """Fabricate one variant of a batch; an impossible one gives a row with status bad_input."""
    from studies.exploration.sweep import varied

    design, fields, folder, choices, command = job
    try:
        return build(varied(design, fields), folder, silent, choices, picture=False, command=command)
    except BadInput as error:
        return FabricationRow("bad_input", str(error), folder)


def silent(fraction: float, text: str) -> None:
    """Report no progress."""


def main() -> None:
    """Do the jobs that arrive on standard input, one after the other, until it closes.

    A closed input means that the process that sends the jobs is gone. The reading thread then ends this process at
    once, even during a job, so that no lock on a folder outlives the command.
    """
    # a library may print to standard output: that goes to standard error, and the answers to a copy of the handle
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    jobs: queue.SimpleQueue[Job] = queue.SimpleQueue()

    def read() -> None:
        try:
            while True:
                jobs.put(pickle.load(sys.stdin.buffer))
        finally:
            os._exit(1)

    threading.Thread(target=read, daemon=True).start()
    while True:
        try:
            answer: FabricationRow | Exception = fabricate(jobs.get())
        except Exception as error:
            answer = error
        pickle.dump(answer, answers)
        answers.flush()


if __name__ == "__main__":
    main()
