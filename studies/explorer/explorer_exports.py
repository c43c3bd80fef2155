"""The files that the page exports: design, mould, numbers, commands and fields of a state.

Texts of a state are made in the server. Numbers and fields need its solution, which a worker process has. The mould
is that of `magtip cad`, made by a worker process that ends with the request: it loads a CAD library.
"""

from __future__ import annotations

import asyncio
import csv
import dataclasses
import io
import json
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry import design_digest
from geometry.design import BadInput, Design
from studies.exploration.worker_process import WorkerDied, processes
from studies.explorer import state_commands
from studies.explorer.explorer_state import ExplorerState

if TYPE_CHECKING:
    from fem.solution import Solution

TYPES = {
    "design.toml": "application/toml",
    "commands.json": "application/json",
    "mold.zip": "application/zip",
    "state.csv": "text/csv; charset=utf-8",
    "curve.csv": "text/csv; charset=utf-8",
    "fields.vtu": "application/vnd.vtk+xml",
}
"""Names of the exports, and the types of their files."""
OF_WORKER = ("state.csv", "curve.csv", "fields.vtu")
"""Exports for which a worker process solves."""
PATIENCE = 300.0
"""Longest time that the mould's process may take, s; it takes some 10 s."""


def text_of(name: str, state: ExplorerState) -> bytes:
    """Return an export that needs no solution."""
    if name == "design.toml":
        return design_text(state.design).encode()
    return (json.dumps(state_commands.commands(state), indent=1) + "\n").encode()


def design_text(design: Design) -> str:
    """Return a design file with every field that differs from the preset.

    >>> print(design_text(Design(D=10, law="yeoh")), end="")
    base = "paper"
    D = 10.0
    law = "yeoh"
    """
    lines = ['base = "paper"']
    for spec in dataclasses.fields(design):
        value = getattr(design, spec.name)
        if value != spec.default:
            lines.append(f'{spec.name} = "{value}"' if isinstance(value, str) else f"{spec.name} = {value!r}")
    return "\n".join(lines) + "\n"


async def mold(state: ExplorerState) -> bytes:
    """Return the archive of everything that `magtip cad` writes for a design, made by a process that ends with it.

    Raises
    ------
    BadInput
        The mould cannot be made; the sentence is that of the command.
    """
    command = state_commands.line("cad", state, {"--out": "mold"})
    with processes(1, tries=1) as executor:
        made = asyncio.wrap_future(executor.submit(_mold_archive, (state.design, command)))
        try:
            content, error, _ = await asyncio.wait_for(made, PATIENCE)
        except TimeoutError:
            raise BadInput(f"the mould took more than {PATIENCE:g} s: use magtip cad") from None
        except WorkerDied as death:
            raise BadInput(f"the process that made the mould ended with {death}: use magtip cad") from None
    if error is not None:
        raise error
    assert isinstance(content, bytes)
    return content


def _mold_archive(task: tuple[Design, str]) -> bytes:
    """Build a design's mould, in a worker process."""
    from studies.fabrication.sensor_parts import build

    design, command = task
    with tempfile.TemporaryDirectory(prefix="magtip-") as folder:
        row = build(design, Path(folder, "mold"), lambda share, text: None, command=command)
        if row.status != "ok":
            raise BadInput(row.message)
        return _zipped(row.folder)


def _zipped(folder: Path) -> bytes:
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                archive.write(path, path.relative_to(folder).as_posix())
    return target.getvalue()


def of_solution(name: str, state: ExplorerState, solution: Solution) -> bytes:
    """Return an export of a solution: the columns of `magtip solve --json` and readings, or the deformed body."""
    if name == "fields.vtu":
        from studies.output import vtk_files

        with tempfile.TemporaryDirectory(prefix="magtip-") as folder:
            path = Path(folder, name)
            vtk_files.write_field(path, solution)
            return path.read_bytes()
    from analytic import hall
    from studies.simulation import state_rows

    row = state_rows.solved_row(solution, design_digest.of_mechanics(state.design, state.magnet))
    made_for = row.pop("made_for", None)
    if state.design.shape.has_magnet:
        readings = hall.readings(state.design, solution.response)
        row |= {"readings_T": list(readings.B_T), "output": list(readings.output), "units": list(readings.units)}
    return table([row | (made_for if isinstance(made_for, dict) else {})])


def of_curve(data: Mapping[str, Any]) -> bytes:
    """Return the curve as a table."""
    widths, paper, level = data["estimates"], data["paper"], data["level"]
    columns = {
        "depth_mm": data["depth"],
        "force_N": data["force"],
        "force_half_width_N": widths["force"],
        "shift_mm": data["shift"],
        "shift_half_width_mm": widths["shift"],
        "paper_force_N": paper["force"],
        "paper_shift_mm": paper["shift"],
        f"{level['name']}_force_N": level["force"],
        f"{level['name']}_shift_mm": level["shift"],
        "status": data["status"],
    }
    names = list(columns)
    return table([dict(zip(names, row, strict=True)) for row in zip(*columns.values(), strict=True)])


def table(rows: list[dict[str, Any]]) -> bytes:
    """Return rows as CSV; a list becomes one column for each value, None an empty cell."""
    flat = [_columns(row) for row in rows]
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(flat[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(flat)
    return text.getvalue().encode()


def _columns(row: Mapping[str, Any]) -> dict[str, Any]:
    columns: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, (list, tuple)):
            columns |= {f"{name}_{k + 1}": one for k, one in enumerate(value)}
        else:
            columns[name] = value
    return columns
