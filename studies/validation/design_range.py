"""The whole range of designs, sampled: solids, mould and meshes of each, or what makes it impossible.

ABOUT, which the report prints, says how.
"""

from __future__ import annotations

import contextlib
import functools
import json
import math
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from geometry.design import BadInput, Design
from studies.output import result_store
from studies.output.atomic_files import write_text
from studies.output.provenance import made

ABOUT = """\
The whole range of designs, sampled: solids, mould and meshes of each, or what makes it impossible.

Sobol's sequence over D, L, the magnet's size, its height over diameter and its edge radius. D spans 1 to 50 mm and L
D/2 + 0.05 mm to 10 D; the magnet spans a disc of 0.2 mm to one that leaves 0.15 mm of wall, a tenth to four times as
high as wide. All are spaced logarithmically (the edge radius evenly, from 0 to half the most there can be), and a
tenth of the samples lies at each end of each, so that the extremes meet. The section is that of level standard with
the magnet as a hole; tetrahedra are those of level quick, the half body with its magnet, made anew, then read back
from a cache. A design is good where each step of it is good, or impossible for a reason that the message names; mesh
steps are good with volumes right to 1e-5, the base to 1e-4 and no Jacobian below 0.05.
"""

Progress = Callable[[float, str], None]
Row = dict[str, Any]

SEED, COUNT = 1960, 64
WALL, LEAST_STEM = 0.15, 0.05
"""Silicone that the largest magnet leaves, and the least L - D/2, mm."""
LEAST_DIAMETER, LEAST_HEIGHT, SLENDER = 0.2, 0.1, (0.1, 4.0)
"""Of a magnet, mm, and its height over its diameter."""
END = 0.1
"""Share of the samples at each end of each quantity."""
VOLUME, BASE, CACHED_S = 1e-5, 1e-4, 0.1
"""Largest errors of volumes and of the base, and longest time of a mesh from the cache, s."""


def samples(count: int) -> list[dict[str, float]]:
    """What the sampled designs have, mm; the first of them are the same for any count."""
    from scipy.stats import qmc

    points = qmc.Sobol(5, seed=SEED).random_base2(math.ceil(math.log2(max(count, 2))))
    return [_sample([min(max((float(x) - END) / (1 - 2 * END), 0.0), 1.0) for x in point]) for point in points][
        :count
    ]


def _sample(x: list[float]) -> dict[str, float]:
    D = _down(50 ** x[0])
    stem = _down(LEAST_STEM * (9.5 * D / LEAST_STEM) ** x[1])
    ratio = SLENDER[0] * (SLENDER[1] / SLENDER[0]) ** x[3]
    least = max(LEAST_DIAMETER, LEAST_HEIGHT / ratio)
    most = min(2 * (D / 2 - WALL) / math.hypot(1, ratio), 2 * (stem - WALL) / ratio)
    wide = _down(least * (max(most, least) / least) ** x[2])
    tall = _down(ratio * wide)
    return {
        "D": D,
        "L": round(D / 2 + stem, 6),
        "magnet_diameter": wide,
        "magnet_height": tall,
        "magnet_edge_radius": _down(x[4] * min(wide, tall) / 4) if x[4] else 0.0,
        "l0": round(D / 2 + stem + 1, 6),
    }


def _down(value: float) -> float:
    """Four digits, rounded down unless that is only rounding."""
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return float(f"{math.floor(value / step + 1e-9) * step:.6g}")


def run(count: int, folder: Path | None, progress: Progress) -> Iterator[Row]:
    """A row for each design as it ends; those in the folder's rows.jsonl by the same code are not done again."""
    store = result_store.opened(None if folder is None else folder / "rows.jsonl", code())
    with tempfile.TemporaryDirectory() as cache:
        for number, values in enumerate(samples(count)):
            progress(number / count, f"design {number}")
            name = json.dumps([number, *values.values()])
            if name not in store.known:
                store.keep(name, examine(number, values, Path(cache)))
            yield store.known[name]


@functools.cache
def code() -> str:
    """A digest of what is studied, and of this study."""
    return result_store.digest([*result_store.modules("geometry"), Path(__file__)])


def examine(number: int, values: dict[str, float], cache: Path) -> Row:
    """The row of one design. An exception that is no refusal is a failure, with its text as the message."""
    row: Row = {"design": number} | {f"{name}_mm": value for name, value in values.items() if name != "l0"}
    row |= dict.fromkeys(COLUMNS, None) | {"status": "ok", "message": ""}
    try:
        design = Design(**values)  # type: ignore[arg-type]
    except BadInput as refusal:
        return row | {"status": "impossible", "message": str(refusal)}
    row["wall_mm"] = design.shape.wall
    steps: dict[str, Callable[[Design], Row]]
    steps = {"solids": _solids, "section": _section, "solid_mesh": functools.partial(_solid_mesh, cache=cache)}
    for name, step in steps.items():
        try:
            row |= {name: "ok"} | step(design)
        except BadInput as refusal:
            row |= {name: "impossible", "message": str(refusal)}
        except Exception as error:
            # any way to end that nobody meant is what this table is there to find
            row |= {name: "failed", "status": "failed", "message": f"{name}: {type(error).__name__}: {error}"}
    return row


def _solids(design: Design) -> Row:
    """The three bodies against their volumes, and the mould with its checks."""
    from geometry import cad, mold
    from geometry.fabrication import mold_checks, mold_solids

    begin = time.perf_counter()
    shape, choices = design.shape, mold.Mold()
    beam, magnet = cad.beam_volume(shape), cad.magnet_volume(shape)
    bodies = ((cad.beam(design), beam), (cad.magnet(design), magnet), (cad.silicone(design), beam - magnet))
    for body, volume in bodies:
        if not (body.is_valid and abs(float(body.volume) / volume - 1) < 1e-9):
            raise RuntimeError(f"a solid of {body.volume:.9g} mm3 is not valid or has the wrong volume")
    checks = mold_checks.checks(design, choices, *mold_solids.parts(design, choices))
    failed = [check.name for check in checks if not check.passed]
    if failed:
        raise RuntimeError(f"the mould fails its check '{failed[0]}'")
    return {"solids_s": time.perf_counter() - begin}


def _section(design: Design) -> Row:
    import numpy as np
    import skfem

    from fem.accuracy import STANDARD
    from geometry import cad
    from geometry.section import section

    shape = design.shape
    begin = time.perf_counter()
    mesh = section(shape, STANDARD.section_size * shape.D)
    seconds = time.perf_counter() - begin
    basis = skfem.Basis(mesh, skfem.ElementTriP2(), intorder=6)
    volume = 2 * math.pi * float((basis.global_coordinates()[0] * basis.dx).sum())
    error = volume / (cad.beam_volume(shape) - cad.magnet_volume(shape)) - 1
    corners = mesh.doflocs[0, mesh.t] + 1j * mesh.doflocs[1, mesh.t]
    angles = np.angle((np.roll(corners, 1, axis=0) - corners) / (np.roll(corners, -1, axis=0) - corners))
    if not (abs(error) < VOLUME and angles.min() > 0):
        raise RuntimeError(f"a volume error of {error:.2g}, a least angle of {angles.min():.2g} rad")
    return {
        "section_ms": 1e3 * seconds,
        "triangles": mesh.nelements,
        "section_volume_error": error,
        "least_angle_rad": float(np.abs(angles).min()),
    }


def _solid_mesh(design: Design, cache: Path) -> Row:
    from fem.accuracy import QUICK
    from geometry.mesh import tetrahedra
    from geometry.meshing.curved_mesh import LEAST_JACOBIAN
    from geometry.meshing.mesh_quality import quality

    size = QUICK.solid_size * design.D
    with _kept_in(cache):
        begin, spent = time.perf_counter(), os.times()
        mesh = tetrahedra(design.shape, size)
        seconds, now = time.perf_counter() - begin, os.times()
        begin = time.perf_counter()
        tetrahedra(design.shape, size)
        cached = time.perf_counter() - begin
    found = quality(mesh, design.shape)
    worst = max(map(abs, found.volume_errors.values()))
    right = worst < VOLUME and abs(found.base_error) < BASE and found.least_jacobian >= 0.9 * LEAST_JACOBIAN
    if not (right and cached < CACHED_S):
        raise RuntimeError(f"{found}, {cached:.2g} s from the cache")
    return {
        "tetrahedra": found.cells,
        "mesh_s": seconds,
        "mesh_cpu_s": sum(now[k] - spent[k] for k in range(4)),
        "cached_ms": 1e3 * cached,
        "silicone_volume_error": found.volume_errors["silicone"],
        "magnet_volume_error": found.volume_errors["magnet"],
        "base_error": found.base_error,
        "gap_over_D": found.gap / design.D,
        "least_jacobian": found.least_jacobian,
        "least_shape": found.least_shape,
        "mean_shape": found.mean_shape,
    }


@contextlib.contextmanager
def _kept_in(folder: Path) -> Iterator[None]:
    """Meshes are kept in this folder meanwhile."""
    from geometry.meshing.mesh_cache import VARIABLE

    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = str(folder)
    try:
        yield
    finally:
        os.environ.pop(VARIABLE)
        if before is not None:
            os.environ[VARIABLE] = before


COLUMNS = (
    "status",
    "message",
    "wall_mm",
    *("solids", "solids_s", "section", "section_ms", "triangles", "section_volume_error", "least_angle_rad"),
    *("solid_mesh", "tetrahedra", "mesh_s", "mesh_cpu_s", "cached_ms", "silicone_volume_error"),
    *("magnet_volume_error", "base_error", "gap_over_D", "least_jacobian", "least_shape", "mean_shape"),
)


def summary(rows: Sequence[Row]) -> list[Row]:
    """Least, median and greatest of what was measured."""
    found = []
    for name in COLUMNS:
        values = [abs(row[name]) for row in rows if isinstance(row[name], (int, float))]
        if values:
            numbers = {"least": min(values), "median": statistics.median(values), "greatest": max(values)}
            found.append({"quantity": name} | numbers)
    return found


def write(folder: Path, rows: Sequence[Row], origin: str, command: str) -> None:
    """range.csv with all columns, RANGE.md to read."""
    from studies.output.csv_tables import write_table

    write_table(folder / "range.csv", rows, digits=6)
    count = {status: sum(row["status"] == status for row in rows) for status in ("ok", "impossible", "failed")}
    lines = ["# Range of designs", "", f"Of {len(rows)} designs {count['ok']} are good, "]
    lines[-1] += f"{count['impossible']} impossible, {count['failed']} failed."
    lines += [
        "",
        *ABOUT.splitlines(),
        "",
        "Least, median and greatest, of errors the magnitudes:",
        "",
    ]
    lines += ["| quantity | least | median | greatest |", "|---|---|---|---|"]
    for row in summary(rows):
        cells = [f"{row[name]:.3g}" for name in ("least", "median", "greatest")]
        lines.append(f"| {row['quantity'].replace('_', ' ')} | {' | '.join(cells)} |")
    heads = ["design", "D", "L", "magnet", "wall", "status", "tetrahedra", "s", "least Jacobian", "message"]
    lines += ["", f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for row in rows:
        magnet = f"{row['magnet_diameter_mm']:g} x {row['magnet_height_mm']:g}"
        cells = [str(row["design"]), f"{row['D_mm']:g}", f"{row['L_mm']:g}", magnet, _text(row["wall_mm"])]
        cells += [row["status"], _text(row["tetrahedra"], 6), _text(row["mesh_s"]), _text(row["least_jacobian"])]
        lines.append(f"| {' | '.join([*cells, row['message']])} |")
    write_text(folder / "RANGE.md", "\n".join([*lines, "", made(command, origin)]) + "\n")


def _text(value: float | None, digits: int = 3) -> str:
    return "" if value is None else f"{value:.{digits}g}"
