"""The paper's look-up table, which `magtip table` writes as a NumPy file that can be read by memory mapping.

The table is written slab by slab to a hidden file (.FILE.part) in the same folder. A note beside the hidden file
identifies the table and counts the finished slabs, so that the same command continues after an interruption. The
complete table is renamed to FILE, and FILE.json describes its contents.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import math
import os
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from analytic import lookup
from analytic.inverse import forward_model, response_surface
from analytic.inverse.forward_model import Forward
from analytic.inverse.response_surface import Mechanics
from analytic.lookup import Grid
from geometry import design_digest
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.output import atomic_files, console, own_files
from studies.output.bounded_files import json_object
from studies.output.records import FlatRow

NOTE_EVERY = 8
"""Number of slabs between two notes: an interruption loses the work of at most so many slabs."""


def target(out: Path, inputs: Sequence[str | Path | None]) -> Path:
    """Return the path of the table after checking that it can be written; only an older table may be replaced."""
    file = atomic_files.check_output_file(out, ".npy")
    about = file.with_suffix(".json")
    atomic_files.check_apart([file, about], inputs)
    own_files.check_file(about)
    return file


def plan(design: Design, step: float, law: Mechanics | None) -> tuple[Forward, Grid]:
    """Return the forward model and the grid of a table; without mechanics the magnet does not tilt."""
    if not step > 0:
        raise BadInput(f"step must be more than 0 mm; got {step:g}")
    tau = forward_model.NO_TILT if law is None else law.tilt
    model = forward_model.model(design, tau)
    low, _ = response_surface.workspace(design, law)
    if step > min(-low[0], -low[2]):
        raise BadInput(
            f"step must be at most {min(-low[0], -low[2]):g} mm, the size of the workspace; got {step:g} mm"
        )
    # the largest grid of whole steps within the workspace; 1e-6 keeps a length that is a multiple despite rounding
    side, sink = (step * int(-length / step + 1e-6) for length in (low[0], low[2]))
    return model, lookup.Grid(side, sink, step)


def write(model: Forward, grid: Grid, out: Path, level: str, progress: Progress) -> FlatRow:
    """Write the table of three dimensions, or continue it, and return its record (see `_record`)."""
    shape = (*grid.shape, len(model.elements))
    about = _about(model, grid, shape)
    firsts = (("x_mm", -grid.side, grid.step), ("y_mm", -grid.side, grid.step), ("z_mm", 0.0, -grid.step))
    about["axes"] = [
        {"name": name, "first": first, "step": step, "count": count}
        for (name, first, step), count in zip(firsts, shape, strict=False)
    ]
    about["axes"].append({"name": "B_T", "columns": [element.name for element in model.elements]})
    size = 8 * math.prod(shape)
    part, note = out.with_name(f".{out.name}.part"), out.with_name(f".{out.name}.part.json")
    key = hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()
    done, offset = _resume(part, note, key, size // shape[0])
    room = shutil.disk_usage(out.parent).free + (part.stat().st_size if part.exists() else 0)
    if size > room:
        raise BadInput(
            f"the table needs {size / 1e6:.0f} MB, but the disk has only {room / 1e6:.0f} MB free: raise --step"
        )
    with _keep_part(part, note, key, shape[0], size // shape[0]), part.open("r+b" if done else "w+b") as stream:
        if not done:
            header = {"descr": "<f8", "fortran_order": False, "shape": shape}
            np.lib.format.write_array_header_1_0(stream, header)
            offset = stream.tell()
        stream.seek(offset + done * (size // shape[0]))
        for i in range(done, shape[0]):
            progress(i / shape[0], f"{size / 1e6:.0f} MB")
            stream.write(lookup.slab(model, grid, i).astype("<f8", copy=False).tobytes())
            if (i + 1) % NOTE_EVERY == 0:
                stream.flush()
                atomic_files.write_json(note, {"key": key, "done": i + 1, "offset": offset})
        stream.truncate()
    _replace_pair(part, out, about)
    note.unlink(missing_ok=True)
    return _record(out, size // 8 // shape[3], size, done, level)


def write_plane(model: Forward, grid: Grid, out: Path, level: str) -> FlatRow:
    """Write the table of two dimensions, B_rho and B_z over (rho, Z), and return its record (see `_record`)."""
    if model.tau[0].any():
        raise BadInput("--plane needs a magnet without tilt: leave out --level and --responses")
    table, first = lookup.meridian_table(model, grid)
    about = _about(model, grid, table.shape)
    about["axes"] = [
        {"name": "rho_mm", "first": 0.0, "step": grid.step, "count": table.shape[0]},
        {"name": "Z_mm", "first": first, "step": grid.step, "count": table.shape[1]},
        {"name": "B_T", "columns": ["B_rho", "B_z"]},
    ]
    part = out.with_name(f".{out.name}.part")
    with part.open("wb") as stream:
        np.save(stream, table)
    _replace_pair(part, out, about)
    return _record(out, table.size // 2, table.nbytes, 0, level)


def _replace_pair(part: Path, out: Path, about: dict[str, Any]) -> None:
    """Rename a complete table to FILE.npy, and describe it in FILE.json.

    The old description goes first: a process that is killed here leaves a table without a description, which `read`
    refuses, never one with that of another table.
    """
    out.with_suffix(".json").unlink(missing_ok=True)
    own_files.note(out.parent, {out.name: part})
    os.replace(part, out)
    atomic_files.write_json(out.with_suffix(".json"), about)


def _record(out: Path, poses: int, size: int, resumed: int, level: str) -> FlatRow:
    """Return the record of a table; `resumed` slabs of it were written by an interrupted command before."""
    size_MB = size / 1e6
    return {"status": "ok", "file": str(out), "poses": poses, "size_MB": size_MB, "resumed": resumed, "level": level}


def _made_for(design: Design, tau: Any) -> design_digest.Fields:
    readings = design_digest.of_readings(design)
    return design_digest.of_mechanics(design) | readings if np.any(tau) else readings


def _about(model: Forward, grid: Grid, shape: tuple[int, ...]) -> dict[str, Any]:
    """Return the description of a table for FILE.json, without its axes.

    The mechanics matter to it only through the tilt.
    """
    return {
        "design": dataclasses.asdict(model.design),
        **design_digest.label(_made_for(model.design, model.tau[0])),
        "mode": model.mode,
        "tau": model.tau[0].tolist(),
        "tau_range": model.tau[1:],
        "step_mm": grid.step,
        "shape": list(shape),
        "dtype": "<f8",
    }


@contextlib.contextmanager
def _keep_part(part: Path, note: Path, key: str, count: int, slab: int) -> Iterator[None]:
    """On an interruption, name the file of the finished slabs in the message; remove it if no slab is finished."""
    try:
        yield
    except KeyboardInterrupt:
        done, _ = _resume(part, note, key, slab)
        if not done:
            part.unlink(missing_ok=True)
            note.unlink(missing_ok=True)
            raise
        size = part.stat().st_size / 1e6
        raise KeyboardInterrupt(
            f"{done} of {count} slabs are kept in {str(part)!r} ({size:.3g} MB); the same command continues from "
            "there"
        ) from None


def _resume(part: Path, note: Path, key: str, slab: int) -> tuple[int, int]:
    """Return the number of finished slabs of the table with this key, and the byte offset of the first slab."""
    try:
        progress = json_object(note)
        done, offset = int(progress["done"]), int(progress["offset"])
        # after a power failure the note may be on the disk, but not all slabs that it counts
        if progress["key"] == key and part.stat().st_size >= offset + done * slab:
            return done, offset
    except (FileNotFoundError, ValueError, KeyError, TypeError):
        pass
    return 0, 0


def read(file: Path, design: Design) -> tuple[Array, dict[str, Any]]:
    """Return the table in a file, memory-mapped, and its description from FILE.json.

    A table without a label of its sensor is accepted with a warning.
    """
    try:
        about = json_object(file.with_suffix(".json"))
        table = np.load(file, mmap_mode="r")
        tilts = np.array(about.get("tau"), dtype=np.float64)  # None is NaN, other things are no numbers
        fits = about.get("shape") == list(table.shape) and bool(np.isfinite(tilts).all())
    except (OSError, ValueError, TypeError, EOFError):
        fits = False
    if not fits:
        raise BadInput(
            f"{str(file)!r} is not a table of magtip, or its .json file belongs to another table: "
            "make it with magtip table"
        )
    if not design_digest.check(about, _made_for(design, about["tau"]), str(file)):
        console.warn(
            f"{file} does not say for which sensor it was made, so a mismatch with this design cannot be detected"
        )
    return table, about
