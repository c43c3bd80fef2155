"""Many variants of a design as things to make, each in a folder of its own; several at a time."""

from __future__ import annotations

import contextlib
import itertools
import multiprocessing
import os
import shutil
import signal
import threading
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from geometry.design import BadInput, Design
from studies import files, inputs
from studies.console import Progress
from studies.workshop import Making, build

ENDING_S = 10.0
"""Time that a process which is ended gets to be gone, so that its locks are."""


def axes_of(texts: Sequence[str]) -> dict[str, list[float]]:
    """The axes of a batch from texts NAME=a,b,c; none without."""
    axes = inputs.parse_axes(texts) if texts else {}
    if "depth" in axes:
        raise BadInput("there is no axis 'depth' of what is made: choose from D, L, f, E")
    return axes


def idle(design: Design, axes: Mapping[str, Sequence[float]]) -> list[tuple[str, str]]:
    """Axes that change no solid, and why."""
    reasons = {"E": "the solids are the same, only the drawing names E"} | design.idle()
    return [(name, reasons[name]) for name, values in axes.items() if name in reasons and len(values) > 1]


def batch(
    design: Design,
    axes: Mapping[str, Sequence[float]],
    out: Path,
    progress: Progress,
    making: Making = Making(),
    workers: int | None = None,
) -> Iterator[dict[str, Any]]:
    """`build` for every combination of values, each in a folder of its own named after them; records in order.

    As in a sweep the Hall elements stay where they are in the base. A combination that is impossible gives a record
    with status bad_input and the reason. Folders of a batch have drawings, but no picture.

    Parameters
    ----------
    workers : processes that share the work; as many as there are processors by default.
    """
    points = [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]
    jobs = [
        (design, point, out / "_".join(f"{key}{value:g}" for key, value in point.items()), making) for point in points
    ]
    count = min(workers or os.cpu_count() or 1, len(jobs))
    with files.filled(out), _swept([folder for _, _, folder, _ in jobs]), contextlib.ExitStack() as stack:
        work: Iterator[dict[str, Any]] = map(made, jobs)
        if count > 1:
            work = stack.enter_context(_pool(count)).map(made, jobs)
        for k, (point, record) in enumerate(zip(points, work, strict=True)):
            progress((k + 1) / len(jobs), record["folder"].name)
            yield {**point, **record}


@contextlib.contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that import the CAD kernel once, in the server that they are forked from."""
    known = multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("forkserver" if "forkserver" in known else "spawn")
    if "forkserver" in known:
        context.set_forkserver_preload(["build123d", "trimesh"])
        from multiprocessing import forkserver

        with _uninterrupted():
            forkserver.ensure_running()
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_end_with_parent) as pool:
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            children = multiprocessing.active_children()
            for process in children:
                process.terminate()
            for process in children:
                process.join(ENDING_S)
            raise


def _end_with_parent() -> None:
    """Let this process end when the one that shares out the work is gone, be it killed: its locks would bind."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Processes that are started meanwhile are not interrupted together with this one, but ended by it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def _swept(folders: Sequence[Path]) -> Iterator[None]:
    """What processes that were ended had not yet finished is removed."""
    try:
        yield
    except BaseException:
        for folder in (folder for folder in folders if folder.is_dir()):
            # a folder that another process fills is left alone
            with contextlib.suppress(BadInput), files.filled(folder):
                for stage in folder.glob(f"{files.WRITING}*"):
                    shutil.rmtree(stage, ignore_errors=True)
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise


def made(job: tuple[Design, dict[str, float], Path, Making]) -> dict[str, Any]:
    """One design of a batch."""
    from studies.sweep import varied

    design, fields, folder, making = job
    try:
        return build(varied(design, fields), folder, silent, making, picture=False)
    except BadInput as error:
        failed = {"status": "bad_input", "message": str(error), "folder": folder}
        return {**failed, "parts": [], "checks": [], "assembled_size_mm": None, "warnings": []}


def silent(fraction: float, text: str) -> None:
    """No progress."""
