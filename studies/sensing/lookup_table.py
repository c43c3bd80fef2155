"""What `magtip table` writes: the paper's look-up table as a file of NumPy that can be read by memory mapping.

The table is written slab by slab under a hidden name beside its own, with a note of what it is and how far it is;
the same command goes on from there. A complete table takes its name, and FILE.json says what is in it.
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
from typing import TYPE_CHECKING, Any

from geometry import design_digest
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.output import atomic_files, console

if TYPE_CHECKING:
    from analytic.inverse.forward_model import Forward
    from analytic.lookup import Grid
    from geometry.arrays import Array


NOTE_EVERY = 8
"""Slabs between two notes."""


MAGIC = b"\x93NUMPY"
"""How a file of NumPy begins."""
KEYS = ("design", "step_mm", "shape", "axes")
"""Of what stands beside a table that this program wrote."""


def target(out: Path, inputs: Sequence[str | Path | None]) -> Path:
    """The table's file, fit to be written; an older table in its place is replaced, nothing else.

    Raises
    ------
    BadInput
        It cannot be written, is an input, or there is a file already that is no table of this program.
    """
    file = atomic_files.check_output_file(out, ".npy")
    about = file.with_suffix(".json")
    atomic_files.check_apart([file, about], inputs)
    for path, whose in ((file, _is_table(file)), (about, _is_about(about))):
        if path.exists() and not whose:
            raise BadInput(
                f"{str(path)!r} was not written by magtip table and would be overwritten: choose another name"
            )
    return file


def _is_about(file: Path) -> bool:
    """Whether a file is what stands beside a table."""
    try:
        found = json.loads(file.read_text("utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(found, dict) and set(KEYS) <= set(found)


def _is_table(file: Path) -> bool:
    """Whether a file is one of NumPy, beside one that says what a table is."""
    try:
        with file.open("rb") as stream:
            begin = stream.read(len(MAGIC))
    except OSError:
        return False
    return begin == MAGIC and _is_about(file.with_suffix(".json"))


def plan(design: Design, step: float, level: str | None, responses: Path | None) -> tuple[Forward, Grid]:
    """The forward model and the grid of a table; without a level or responses the magnet does not tilt.

    Raises
    ------
    BadInput
        The design has no magnet, the step does not fit, or the mechanics cannot be used.
    """
    from analytic import lookup
    from analytic.inverse import forward_model, response_surface
    from studies.sensing import decode_readings

    if not step > 0:
        raise BadInput(f"step must be more than 0 mm; got {step:g}")
    law = decode_readings.mechanics_of(design, level, responses) if level or responses else None
    tau = forward_model.NO_TILT if law is None else law.tau
    model = forward_model.model(design, tau)
    low, _ = response_surface.workspace(design, law)
    if step > min(-low[0], -low[2]):
        raise BadInput(
            f"step must be at most {min(-low[0], -low[2]):g} mm, the size of the workspace; got {step:g} mm"
        )
    # whole steps that fit into the workspace
    side, sink = (step * int(-length / step + 1e-6) for length in (low[0], low[2]))
    return model, lookup.Grid(side, sink, step)


def write(model: Forward, grid: Grid, out: Path, progress: Progress) -> dict[str, Any]:
    """Write the table of three dimensions, and return what FILE.json says.

    Raises
    ------
    BadInput
        The disk has no room for it.
    """
    import numpy as np

    from analytic import lookup, magnet

    shape = (*grid.shape, len(model.elements))
    about = _about(model, grid, shape)
    about["axes"] = [
        {"name": "x_mm", "first": -grid.side, "step": grid.step, "count": shape[0]},
        {"name": "y_mm", "first": -grid.side, "step": grid.step, "count": shape[1]},
        {"name": "z_mm", "first": 0.0, "step": -grid.step, "count": shape[2]},
        {"name": "B_T", "columns": [element.name for element in model.elements]},
    ]
    size = 8 * math.prod(shape)
    part, note = out.with_name(f".{out.name}.part"), out.with_name(f".{out.name}.part.json")
    key = hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()
    done, offset = _resume(part, note, key, size // shape[0])
    room = shutil.disk_usage(out.parent).free + (part.stat().st_size if part.exists() else 0)
    if size > room:
        raise BadInput(
            f"the table needs {size / 1e6:.0f} MB, but the disk has only {room / 1e6:.0f} MB free: raise --step"
        )
    # from the start, or the kernel would be loaded on the way, and a table that went on would differ in its last bits
    magnet.compiled()
    with _kept(part, note, key, shape[0], size // shape[0]), part.open("r+b" if done else "w+b") as stream:
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
    atomic_files.write_json(out.with_suffix(".json"), about)
    os.replace(part, out)
    note.unlink(missing_ok=True)
    return {"status": "ok", "file": str(out), "poses": size // 8 // shape[3], "size_MB": size / 1e6, "resumed": done}


def write_plane(model: Forward, grid: Grid, out: Path) -> dict[str, Any]:
    """Write the table of two dimensions, and return what is to be said of it.

    Raises
    ------
    BadInput
        The magnet tilts.
    """
    import numpy as np

    from analytic import lookup

    if model.tau.any():
        raise BadInput("--plane needs a magnet without tilt: leave out --level and --responses")
    table, first = lookup.meridian_table(model, grid)
    about = _about(model, grid, table.shape)
    about["axes"] = [
        {"name": "rho_mm", "first": 0.0, "step": grid.step, "count": table.shape[0]},
        {"name": "Z_mm", "first": first, "step": grid.step, "count": table.shape[1]},
        {"name": "B_T", "columns": ["B_rho", "B_z"]},
    ]
    with atomic_files.atomic(out) as temporary:
        np.save(temporary, table)
    atomic_files.write_json(out.with_suffix(".json"), about)
    return {"status": "ok", "file": str(out), "poses": table.size // 2, "size_MB": table.nbytes / 1e6, "resumed": 0}


def _made_for(design: Design, *, tilted: bool) -> design_digest.Fields:
    """What a table depends on beside its grid; the mechanics enter by the tilt alone."""
    seen = design_digest.of_readings(design)
    return design_digest.of_mechanics(design) | seen if tilted else seen


def _about(model: Forward, grid: Grid, shape: tuple[int, ...]) -> dict[str, Any]:
    return {
        "design": dataclasses.asdict(model.design),
        **design_digest.label(_made_for(model.design, tilted=bool(model.tau.any()))),
        "mode": model.mode,
        "tau": model.tau.tolist(),
        "step_mm": grid.step,
        "shape": list(shape),
        "dtype": "<f8",
    }


@contextlib.contextmanager
def _kept(part: Path, note: Path, key: str, count: int, slab: int) -> Iterator[None]:
    """An interruption says where the part that is made lies; one that is too small to go on from is removed."""
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
    """How many slabs of this very table are there already, and where the first begins."""
    try:
        found = json.loads(note.read_text("utf-8"))
        done, offset = int(found["done"]), int(found["offset"])
        # a machine that lost its power may have kept the note and not the slabs
        if found["key"] == key and part.stat().st_size >= offset + done * slab:
            return done, offset
    except (OSError, ValueError, KeyError, TypeError):
        pass
    return 0, 0


def read(file: Path, design: Design) -> tuple[Array, dict[str, Any]]:
    """The table of a design in a file, by memory mapping, and what FILE.json says of it.

    One that does not say for which sensor it was made is taken, with a warning.

    Raises
    ------
    BadInput
        It cannot be read, is no table of this program, or was made for another sensor.
    """
    import numpy as np

    try:
        about = json.loads(file.with_suffix(".json").read_text("utf-8"))
        table = np.load(file, mmap_mode="r")
        tilted, shape = bool(np.any(about["tau"])), tuple(about["shape"])
    except (OSError, ValueError, KeyError, TypeError):
        tilted, shape, table = False, (), None
    if table is None or table.shape != shape:
        raise BadInput(
            f"{str(file)!r} is not a table of magtip, or its .json file belongs to another table: "
            "make it with magtip table"
        )
    if not design_digest.check(about, _made_for(design, tilted=tilted), str(file)):
        console.warn(
            f"{file} does not say for which sensor it was made, so a mismatch with this design cannot be detected"
        )
    return table, about
