"""Many variants of a design as things to make, each in a folder of its own; several at a time."""

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
from studies.fabrication.sensor_solids import Making
from studies.inputs import user_input
from studies.output import atomic_files, console, provenance

Job = tuple[Design, dict[str, float], Path, Making, str]
"""A design, the fields that differ in a variant, its folder, a maker's choices, and the command that asks for it."""

COMMAND = (sys.executable, "-P", "-m", "studies.fabrication.design_variants")
"""What does jobs: they come in, records go out. -P keeps modules in the user's folder out of what it imports."""


def axes_of(texts: Sequence[str]) -> dict[str, list[float]]:
    """The axes of a batch from texts NAME=a,b,c; none without."""
    axes = user_input.parse_axes(texts) if texts else {}
    if "depth" in axes:
        raise BadInput("cad has no axis 'depth': choose from D, L, f, E")
    return axes


def idle(design: Design, axes: Mapping[str, Sequence[float]]) -> list[tuple[str, str]]:
    """Axes that change no solid, and why."""
    reasons = {"E": "E changes the drawing only, not the solids"} | design.unused_fields()
    return [(name, reasons[name]) for name, values in axes.items() if name in reasons and len(values) > 1]


def batch(
    design: Design,
    axes: Mapping[str, Sequence[float]],
    out: Path,
    progress: Progress,
    making: Making = Making(),
    workers: int | None = None,
    command: str = "magtip cad",
) -> Iterator[FabricationRow]:
    """`build` for every combination of values, each in a folder of its own named after them; records in order.

    As in a sweep the Hall elements stay where they are in the base. A combination that is impossible gives a record
    with status bad_input and the reason. Folders of a batch have drawings, but no picture.

    Parameters
    ----------
    workers : processes that share the work; as many as there are processors by default.
    command : that this is run by, for the recipes.
    """
    points = [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]
    names = ["_".join(f"{key}{value:g}" for key, value in point.items()) for point in points]
    jobs: list[Job] = [
        (design, point, out / name, making, command) for point, name in zip(points, names, strict=True)
    ]
    count = min(workers or os.cpu_count() or 1, len(jobs))
    with atomic_files.filled(out), _swept([out / name for name in names]), contextlib.ExitStack() as stack:
        work: Iterator[FabricationRow] = map(fabricated, jobs)
        if count > 1:
            work = stack.enter_context(_makers(count))(jobs)
        for k, (point, row) in enumerate(zip(points, work, strict=True)):
            progress((k + 1) / len(jobs), row.folder.name)
            yield dataclasses.replace(row, variant=point)


def sentences_of(rows: Sequence[FabricationRow]) -> list[str]:
    """Warnings, and why variants failed, each once with the variants that it is of, by their folders' names."""
    warned = [(row, text) for row in rows for text in dict.fromkeys(row.warnings)]
    failed = [(row, row.message) for row in rows if row.status != "ok"]
    sentences = [f"warning: {text}" for text in _named(warned)] + _named(failed)
    return [*sentences, f"{len(failed)} of {len(rows)} variants failed"] if failed else sentences


def _named(texts: Sequence[tuple[FabricationRow, str]]) -> list[str]:
    """Texts with the variants that they are of."""
    return console.remarks([{"variant": row.folder.name, "message": text} for row, text in texts], ("variant",))


@contextlib.contextmanager
def _makers(count: int) -> Iterator[Callable[[Sequence[Job]], Iterator[FabricationRow]]]:
    """So many processes, and a function that has them do jobs; whatever ends this block ends them at once."""
    processes: list[subprocess.Popen[bytes]] = []
    idle: queue.SimpleQueue[subprocess.Popen[bytes]] = queue.SimpleQueue()
    threads = ThreadPoolExecutor(count)

    def done(job: Job) -> FabricationRow:
        process = idle.get()
        try:
            if process.poll() is not None:
                # the last job took it down
                processes.append(process := _started())
            return _sent(process, job)
        finally:
            idle.put(process)

    try:
        for _ in range(count):
            processes.append(_started())
            idle.put(processes[-1])
        yield lambda jobs: threads.map(done, jobs)
    finally:
        # before the threads, which wait for what the processes answer
        threads.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.kill()
        threads.shutdown()
        for process in processes:
            with contextlib.suppress(BrokenPipeError), process:
                pass


def _started() -> subprocess.Popen[bytes]:
    """A process that does jobs; in a session of its own, so that Ctrl-C reaches only the one that ends it."""
    paths = [str(provenance.ROOT), os.environ.get("PYTHONPATH", "")]
    return subprocess.Popen(
        COMMAND,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )


def _sent(process: subprocess.Popen[bytes], job: Job) -> FabricationRow:
    """The row that a process gives of a job; an error there is one here."""
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        pickle.dump(job, process.stdin)
        process.stdin.flush()
        answer: FabricationRow | Exception = pickle.load(process.stdout)
    except (EOFError, BrokenPipeError):
        # what is at work in it can take a process down, as the system does where memory is short
        message = f"its process ended with exit code {process.wait()}: make this variant by itself"
        return FabricationRow("failed", message, job[2])
    if isinstance(answer, Exception):
        raise answer
    return answer


@contextlib.contextmanager
def _swept(folders: Sequence[Path]) -> Iterator[None]:
    """What processes that were ended had not yet finished is removed."""
    try:
        yield
    except BaseException:
        for folder in (folder for folder in folders if folder.is_dir()):
            # a folder that another process fills is left alone
            with contextlib.suppress(BadInput), atomic_files.filled(folder):
                for stage in folder.glob(f"{atomic_files.WRITING}*"):
                    shutil.rmtree(stage, ignore_errors=True)
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise


def fabricated(job: Job) -> FabricationRow:
    """One design of a batch."""
    from studies.exploration.sweep import varied

    design, fields, folder, making, command = job
    try:
        return build(varied(design, fields), folder, silent, making, picture=False, command=command)
    except BadInput as error:
        return FabricationRow("bad_input", str(error), folder)


def silent(fraction: float, text: str) -> None:
    """No progress."""


def main() -> None:
    """Do the jobs that come in, one after the other, until no more can come.

    That is seen at once, whatever is at work: the process that sends them is gone, and locks held here would bind.
    """
    # what a library prints must not come between the records
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
            answer: FabricationRow | Exception = fabricated(jobs.get())
        except Exception as error:
            answer = error
        pickle.dump(answer, answers)
        answers.flush()


if __name__ == "__main__":
    main()
