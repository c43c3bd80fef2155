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
from dataclasses import asdict, astuple, dataclass, replace
from pathlib import Path
from typing import Literal

from geometry.design import BadInput, Design
from studies.output import records, result_store
from studies.output.atomic_files import write_text
from studies.output.provenance import made
from studies.output.records import FlatRow

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
Outcome = Literal["ok", "impossible", "failed"]

SEED, COUNT = 1960, 64
WALL, LEAST_STEM = 0.15, 0.05
"""Silicone that the largest magnet leaves, and the least L - D/2, mm."""
LEAST_DIAMETER, LEAST_HEIGHT, SLENDER = 0.2, 0.1, (0.1, 4.0)
"""Of a magnet, mm, and its height over its diameter."""
END = 0.1
"""Share of the samples at each end of each quantity."""
VOLUME, BASE, CACHED_S = 1e-5, 1e-4, 0.1
"""Largest errors of volumes and of the base, and longest time of a mesh from the cache, s."""


@dataclass(frozen=True, slots=True)
class Sample:
    """Fields of a sampled design, mm."""

    D: float
    L: float
    magnet_diameter: float
    magnet_height: float
    magnet_edge_radius: float
    l0: float


@dataclass(frozen=True, slots=True)
class DesignResult:
    """One sampled design, and what its steps measured; None where a step was not done or did not end well.

    Attributes
    ----------
    status : of the whole design; it is impossible where the design itself is refused.
    message : why a step, or the design, is impossible or failed.
    wall_mm : thickness of the silicone around the magnet.
    solids, section, solid_mesh : outcomes of the steps.
    section_volume_error, silicone_volume_error, magnet_volume_error, base_error : relative.
    """

    design: int
    D_mm: float
    L_mm: float
    magnet_diameter_mm: float
    magnet_height_mm: float
    magnet_edge_radius_mm: float
    status: Outcome = "ok"
    message: str = ""
    wall_mm: float | None = None
    solids: Outcome | None = None
    solids_s: float | None = None
    section: Outcome | None = None
    section_ms: float | None = None
    triangles: int | None = None
    section_volume_error: float | None = None
    least_angle_rad: float | None = None
    solid_mesh: Outcome | None = None
    tetrahedra: int | None = None
    mesh_s: float | None = None
    mesh_cpu_s: float | None = None
    cached_ms: float | None = None
    silicone_volume_error: float | None = None
    magnet_volume_error: float | None = None
    base_error: float | None = None
    gap_over_D: float | None = None
    least_jacobian: float | None = None
    least_shape: float | None = None
    mean_shape: float | None = None

    def row(self) -> FlatRow:
        """Its columns in range.csv, in JSON and in the kept rows."""
        return records.flat(self)


Step = Callable[[Design, DesignResult], DesignResult]
"""Adds what it measures to the result."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Least, median and greatest magnitude of a measured quantity over the designs that have it."""

    quantity: str
    least: float
    median: float
    greatest: float

    def row(self) -> FlatRow:
        """Its columns in the printed table."""
        return records.flat(self)


def samples(count: int) -> list[Sample]:
    """The sampled designs; the first of them are the same for any count."""
    from scipy.stats import qmc

    points = qmc.Sobol(5, seed=SEED).random_base2(math.ceil(math.log2(max(count, 2))))
    return [_sample([min(max((float(x) - END) / (1 - 2 * END), 0.0), 1.0) for x in point]) for point in points][
        :count
    ]


def _sample(x: list[float]) -> Sample:
    """The design at a point of the unit cube: D, stem L - D/2, magnet's diameter, its height over that, its edge."""
    D = _down(50 ** x[0])
    stem = _down(LEAST_STEM * (9.5 * D / LEAST_STEM) ** x[1])
    ratio = SLENDER[0] * (SLENDER[1] / SLENDER[0]) ** x[3]
    least = max(LEAST_DIAMETER, LEAST_HEIGHT / ratio)
    most = min(2 * (D / 2 - WALL) / math.hypot(1, ratio), 2 * (stem - WALL) / ratio)
    wide = _down(least * (max(most, least) / least) ** x[2])
    tall = _down(ratio * wide)
    return Sample(
        D=D,
        L=round(D / 2 + stem, 6),
        magnet_diameter=wide,
        magnet_height=tall,
        magnet_edge_radius=_down(x[4] * min(wide, tall) / 4) if x[4] else 0.0,
        l0=round(D / 2 + stem + 1, 6),
    )


def _down(value: float) -> float:
    """Four digits, rounded down unless that is only rounding."""
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return float(f"{math.floor(value / step + 1e-9) * step:.6g}")


def run(count: int, folder: Path | None, progress: Progress) -> Iterator[DesignResult]:
    """A result for each design as it ends; those in the folder's rows.jsonl by the same code are not done again."""
    store = result_store.opened(None if folder is None else folder / "rows.jsonl", code())
    with tempfile.TemporaryDirectory() as cache:
        for number, sample in enumerate(samples(count)):
            progress(number / count, f"design {number}")
            name = json.dumps([number, *astuple(sample)])
            if name not in store.known:
                store.keep(name, examine(number, sample, Path(cache)).row())
            yield DesignResult(**store.known[name])


@functools.cache
def code() -> str:
    """A digest of what is studied, and of this study."""
    return result_store.digest([*result_store.modules("geometry"), Path(__file__)])


def examine(number: int, sample: Sample, cache: Path) -> DesignResult:
    """The result of one design. An exception that is no refusal is a failure, with its text as the message."""
    result = DesignResult(
        design=number,
        D_mm=sample.D,
        L_mm=sample.L,
        magnet_diameter_mm=sample.magnet_diameter,
        magnet_height_mm=sample.magnet_height,
        magnet_edge_radius_mm=sample.magnet_edge_radius,
    )
    try:
        design = Design(**asdict(sample))
    except BadInput as refusal:
        return replace(result, status="impossible", message=str(refusal))
    result = replace(result, wall_mm=design.shape.wall)
    steps: dict[str, Step]
    steps = {"solids": _solids, "section": _section, "solid_mesh": functools.partial(_solid_mesh, cache=cache)}
    for name, step in steps.items():
        try:
            result = step(design, result)
        except BadInput as refusal:
            result = replace(result, message=str(refusal), **{name: "impossible"})  # type: ignore[arg-type]
        except Exception as error:
            # any way to end that nobody meant is what this table is there to find
            message = f"{name}: {type(error).__name__}: {error}"
            result = replace(result, status="failed", message=message, **{name: "failed"})  # type: ignore[arg-type]
    return result


def _solids(design: Design, result: DesignResult) -> DesignResult:
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
    return replace(result, solids="ok", solids_s=time.perf_counter() - begin)


def _section(design: Design, result: DesignResult) -> DesignResult:
    """The (r, z) section with the magnet as a hole: its volume of revolution, and its angles."""
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
    return replace(
        result,
        section="ok",
        section_ms=1e3 * seconds,
        triangles=mesh.nelements,
        section_volume_error=error,
        least_angle_rad=float(np.abs(angles).min()),
    )


def _solid_mesh(design: Design, result: DesignResult, cache: Path) -> DesignResult:
    """Tetrahedra of the half body with its magnet, made anew and then read from the cache."""
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
    measured = quality(mesh, design.shape)
    worst = max(map(abs, measured.volume_errors.values()))
    right = worst < VOLUME and abs(measured.base_error) < BASE and measured.least_jacobian >= 0.9 * LEAST_JACOBIAN
    if not (right and cached < CACHED_S):
        raise RuntimeError(f"{measured}, {cached:.2g} s from the cache")
    return replace(
        result,
        solid_mesh="ok",
        tetrahedra=measured.cells,
        mesh_s=seconds,
        mesh_cpu_s=sum(now[k] - spent[k] for k in range(4)),
        cached_ms=1e3 * cached,
        silicone_volume_error=measured.volume_errors["silicone"],
        magnet_volume_error=measured.volume_errors["magnet"],
        base_error=measured.base_error,
        gap_over_D=measured.gap / design.D,
        least_jacobian=measured.least_jacobian,
        least_shape=measured.least_shape,
        mean_shape=measured.mean_shape,
    )


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


MEASURED = (
    *("wall_mm", "solids_s", "section_ms", "triangles", "section_volume_error", "least_angle_rad", "tetrahedra"),
    *("mesh_s", "mesh_cpu_s", "cached_ms", "silicone_volume_error", "magnet_volume_error", "base_error"),
    *("gap_over_D", "least_jacobian", "least_shape", "mean_shape"),
)
"""Fields of a result that hold a measured number."""


def summary(results: Sequence[DesignResult]) -> list[Spread]:
    """Spreads of what was measured, of errors the magnitudes."""
    spreads = []
    for name in MEASURED:
        values = [abs(value) for result in results if (value := getattr(result, name)) is not None]
        if values:
            spreads.append(Spread(name, min(values), statistics.median(values), max(values)))
    return spreads


def write(folder: Path, results: Sequence[DesignResult], origin: str, command: str) -> None:
    """range.csv with all columns, RANGE.md to read."""
    from studies.output.csv_tables import write_table

    write_table(folder / "range.csv", [result.row() for result in results], digits=6)
    good, impossible, failed = (
        sum(result.status == status for result in results) for status in ("ok", "impossible", "failed")
    )
    counts = f"Of {len(results)} designs {good} are good, {impossible} impossible, {failed} failed."
    lines = ["# Range of designs", "", counts, "", *ABOUT.splitlines(), ""]
    lines += ["Least, median and greatest, of errors the magnitudes:", ""]
    lines += ["| quantity | least | median | greatest |", "|---|---|---|---|"]
    for spread in summary(results):
        numbers = " | ".join(f"{value:.3g}" for value in (spread.least, spread.median, spread.greatest))
        lines.append(f"| {spread.quantity.replace('_', ' ')} | {numbers} |")
    heads = ["design", "D", "L", "magnet", "wall", "status", "tetrahedra", "s", "least Jacobian", "message"]
    lines += ["", f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for result in results:
        magnet = f"{result.magnet_diameter_mm:g} x {result.magnet_height_mm:g}"
        cells = [str(result.design), f"{result.D_mm:g}", f"{result.L_mm:g}", magnet, _text(result.wall_mm)]
        cells += [result.status, _text(result.tetrahedra, 6), _text(result.mesh_s), _text(result.least_jacobian)]
        lines.append(f"| {' | '.join([*cells, result.message])} |")
    write_text(folder / "RANGE.md", "\n".join([*lines, "", made(command, origin)]) + "\n")


def _text(value: float | None, digits: int = 3) -> str:
    return "" if value is None else f"{value:.{digits}g}"
