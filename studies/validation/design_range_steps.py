"""Steps of the study of the input ranges for one design: solids and mould, section mesh, mesh of tetrahedra."""

from __future__ import annotations

import contextlib
import functools
import math
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal

from geometry.design import BadInput, Design
from studies.output import records
from studies.output.records import FlatRow

Outcome = Literal["ok", "impossible", "failed"]

VOLUME, BASE, CACHED_S = 1e-5, 1e-4, 0.1
"""Largest relative errors of volumes and of the base, and longest time to read a mesh from the cache, s."""


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
    """One sampled design and the measurements of its steps; None where a step was not reached or did not pass.

    Attributes
    ----------
    status : outcome of the whole design; "impossible" if the design itself is refused.
    message : reason why the design or a step is impossible or failed.
    wall_mm : thickness of the silicone around the magnet.
    solids, section, solid_mesh : outcomes of the steps.
    section_volume_error, silicone_volume_error, magnet_volume_error, base_error : relative errors.
    commit : that of the code that made it.
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
    commit: str = ""

    def row(self) -> FlatRow:
        """Return the result as columns of range.csv, JSON and rows.jsonl."""
        return records.flat(self)


Step = Callable[[Design, DesignResult], DesignResult]
"""A step returns the result with its own measurements added."""


def examine(number: int, sample: Sample, cache: Path) -> DesignResult:
    """Return the result of one design; an exception other than BadInput is a failure, with its text as message."""
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
            # the study exists to find unforeseen failures, so that every exception becomes a row
            message = f"{name}: {type(error).__name__}: {error}"
            result = replace(result, status="failed", message=message, **{name: "failed"})  # type: ignore[arg-type]
    return result


def _solids(design: Design, result: DesignResult) -> DesignResult:
    """Compare the volumes of the three bodies with their closed forms, and run the checks of the mould."""
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
    """Mesh the (r, z) section with the magnet as a hole; check its volume of revolution and its angles."""
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
    """Mesh the half body with its magnet by tetrahedra, first without the cache and then from it."""
    from fem.accuracy import QUICK
    from geometry.mesh import tetrahedra
    from geometry.meshing.curved_mesh import LEAST_JACOBIAN
    from geometry.meshing.mesh_quality import quality

    size = QUICK.solid_size * design.D
    with _cache_in(cache):
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
def _cache_in(folder: Path) -> Iterator[None]:
    """Let the mesh cache use this folder inside the `with` block."""
    from geometry.meshing.mesh_cache import VARIABLE

    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = str(folder)
    try:
        yield
    finally:
        os.environ.pop(VARIABLE)
        if before is not None:
            os.environ[VARIABLE] = before
