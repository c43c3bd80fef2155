"""Fabrication of many variants of a design, each in a folder of its own, by several processes."""

from __future__ import annotations

import contextlib
import itertools
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from geometry.compiled import cores
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.fabrication.sensor_parts import build, fabricated
from studies.fabrication.sensor_solids import FabricationChoices
from studies.inputs import study_input
from studies.mechanics.executor import WorkerDied, Workers
from studies.output import atomic_files, console
from studies.output.records import FlatRow

Job = tuple[Design, dict[str, float], Path, FabricationChoices, str]
"""Base design, the fields that the variant replaces, its folder, the fabrication choices, and the command line."""


AXES = ("D", "L", "f", "E")
"""Axes of a batch."""


def axes_of(texts: Sequence[str]) -> dict[str, list[float]]:
    """Return the axes of a batch from texts NAME=a,b,c; no texts give no axes."""
    axes = study_input.parse_axes(texts) if texts else {}
    for name in axes:
        if name not in AXES:
            raise BadInput(f"magtip cad takes axes of shape only, not {name}: choose from {', '.join(AXES)}")
    return {name: [float(value) for value in values] for name, values in axes.items()}


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
) -> Iterator[FlatRow]:
    """Call `build` for every combination of the axes' values and yield the rows in order.

    Each combination has a folder of its own, named after its values. The Hall elements keep their places in the base,
    as in a sweep. A combination that is impossible gives a row with status bad_input and the reason. Folders of a
    batch have drawings, but no picture.

    Parameters
    ----------
    workers : number of worker processes; default: the number of cores that this process may use.
    command : command line that the recipes name as their origin.
    """
    points = [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]
    names = ["_".join(f"{key}{value:g}" for key, value in point.items()) for point in points]
    for k, name in enumerate(names):
        if name in names[:k]:
            raise BadInput(f"two variants would have the folder {name!r}: give values that differ in six digits")
    jobs: list[Job] = [
        (design, point, out / name, choices, command) for point, name in zip(points, names, strict=True)
    ]
    count = min(workers or cores(), len(jobs))
    with atomic_files.filled(out), _clean_up([out / name for name in names]), contextlib.ExitStack() as stack:
        rows: Iterator[FlatRow] = map(fabricate, jobs)
        if count > 1:
            executor = Workers(count, tries=1)
            stack.callback(executor.end)
            rows = _rows(jobs, executor)
        for k, (point, row) in enumerate(zip(points, rows, strict=True)):
            progress((k + 1) / len(jobs), row["folder"].name)
            yield point | row


def sentences_of(rows: Sequence[FlatRow]) -> list[str]:
    """Return each warning and each reason of a failure once, with the folders of the variants that have it."""
    warned = [(row, text) for row in rows for text in dict.fromkeys(row["warnings"])]
    failed = [(row, row["message"]) for row in rows if row["status"] != "ok"]
    sentences = [f"warning: {text}" for text in _named(warned)] + _named(failed)
    return [*sentences, f"{len(failed)} of {len(rows)} variants failed"] if failed else sentences


def _named(texts: Sequence[tuple[FlatRow, str]]) -> list[str]:
    return console.remarks([{"variant": row["folder"].name, "message": text} for row, text in texts], ("variant",))


def _rows(jobs: Sequence[Job], executor: Workers) -> Iterator[FlatRow]:
    """Yield the rows of jobs in order; an exception of a worker process is raised here."""
    futures = [executor.submit(fabricate, job) for job in jobs]
    for job, future in zip(jobs, futures, strict=True):
        try:
            row, error, _ = future.result()
        except WorkerDied as death:
            # the CAD kernel can crash a process, and the system can kill it when memory runs out
            yield fabricated("failed", f"its process ended with {death}: make this variant by itself", job[2])
            continue
        if error is not None:
            raise error
        yield row


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


def fabricate(job: Job) -> FlatRow:
    """Fabricate one variant of a batch; an impossible one gives a row with status bad_input."""
    from studies.mechanics.study_cases import varied

    design, fields, folder, choices, command = job
    try:
        return build(varied(design, fields), folder, lambda *_: None, choices, picture=False, command=command)
    except BadInput as error:
        return fabricated("bad_input", str(error), folder)
