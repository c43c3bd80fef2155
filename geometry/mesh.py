"""The curved second-order tetrahedral mesh of the beam with its magnet, made by fTetWild through pytetwild.

fTetWild meshes the inside of surfaces of triangles and may deviate from them by an envelope. Then the nodes of the
outer surfaces and of the interface, middle nodes included, are moved to the exact base, symmetry plane, side, dome
and magnet.

fTetWild crashes or hangs on bad input. So the input is checked, and fTetWild runs in a child process
(`geometry.meshing.tetwild_process`), which also fixes its seed: on one machine the same request always gives the same
mesh, to the last bit. Another processor, or another version of a library, may round differently. A difference in the
last bit is enough for fTetWild to make another mesh, with a few percent more or fewer cells.

Meshes are kept in `geometry.meshing.mesh_cache` in units of D, so that similar shapes share one mesh.
"""

from __future__ import annotations

import functools
import hashlib
import math
import subprocess
import sys
import tempfile
from dataclasses import astuple, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTet1, MeshTet2

from geometry import cad
from geometry.arrays import Array, Ints
from geometry.bad_input import MeshError
from geometry.design import BadInput, Shape
from geometry.meshing import (
    curved_mesh,
    edge_lengths,
    edge_singularity,
    exact_surfaces,
    mesh_cache,
    surface_triangulation,
)
from geometry.meshing import mesh_magnification as zooming
from geometry.meshing.edge_lengths import Sizes
from geometry.meshing.mesh_magnification import Zoom
from geometry.messages import warn_once

Parts = Literal["regions", "hole", "none"]

WORK_DIAMETER = 8.0
"""Diameter of the beam while fTetWild meshes it: at very small scales fTetWild does not return."""

TRIES = (1.0, 0.97, 0.94, 0.9, 0.8, 0.7)
"""Factors of the sizes in successive attempts, until a mesh can be curved."""

PASSES = 10
"""Most passes of fTetWild's optimisation: beyond a few passes the worst cells hardly improve but take time."""

CHILD = Path(__file__).parent / "meshing" / "tetwild_process.py"
"""The program that runs fTetWild in a child process."""

UNSEEDED = "fTetWild's seed cannot be fixed on this platform: meshes of tetrahedra differ from run to run"


def tetrahedra(
    shape: Shape,
    size: float,
    *,
    half: bool = True,
    magnet: Parts = "regions",
    tip_size: float | None = None,
    rim: tuple[float, float] | None = None,
    timeout: float = 300,
) -> MeshTet2:
    """Mesh the beam in the unit of `shape`, with the base at z = 0 and cells curved to the exact surfaces.

    Parameters
    ----------
    size : edge length in the bulk; edges are shorter near the magnet's edges, at the clamped rim and in thin layers.
    half : True to mesh the part y >= 0 only.
    magnet : "regions" meshes the magnet too, with a conforming interface; "hole" leaves it out; "none" fills its
        place with silicone.
    tip_size : edge length in the zone of contact at the tip; default: half of `size`.
    rim : radius of a ring on the dome around the axis, and edge length on the ring. Edges follow the ring, so that
        every facet of the dome lies either inside or outside it.
    timeout : time limit of one run of fTetWild, s.

    Returns
    -------
    Mesh with boundaries "base", "skin" (side and dome), "symmetry" (half only) and "magnet" (its surface), and
    subdomains "silicone" and "magnet".

    Raises
    ------
    BadInput
        A size is not a positive number, the ring is not on the dome, or the magnet is missing or not inside the beam.
    MeshError
        fTetWild failed or exceeded its time limit, or none of six meshes could be curved and had edges on the ring.
    """
    lengths = {"size": size, "tip_size": tip_size, "the edge length at the rim": rim and rim[1]}
    for name, value in lengths.items():
        if value is not None and not 0 < value < math.inf:
            raise BadInput(f"{name} must be a positive finite length; got {value:g}")
    if rim is not None and not rim[1] <= rim[0] <= 0.99 * shape.R:
        raise BadInput(
            f"the rim's radius must lie between its edge length {rim[1]:g} and 0.99 R = {0.99 * shape.R:g}; "
            f"got {rim[0]:g}"
        )
    if magnet == "none":
        shape = shape.without_magnet()
    elif not shape.has_magnet:
        raise BadInput('this shape has no magnet (its diameter is 0): choose magnet="none"')
    if not shape.wall > 0:
        raise BadInput(f"the magnet must lie inside the beam; got a wall of {shape.wall:.3g}: take a smaller magnet")
    unit = Shape(*(_rounded(value / shape.D) for value in astuple(shape)))
    least = None if tip_size is None else _rounded(tip_size / shape.D)
    ring = None if rim is None else (_rounded(rim[0] / shape.D), _rounded(rim[1] / shape.D))
    zoom = Zoom.of(unit)
    sizes = Sizes.of(zoom.shape, _rounded(size / shape.D), least, ring, zoom.centre)
    name = mesh_cache.key(shape=astuple(unit), sizes=astuple(sizes), half=half, magnet=magnet, made_by=_makers())
    arrays = mesh_cache.load(name)
    mesh = _built(unit, sizes, half, magnet, timeout) if arrays is None else _unpacked(arrays)
    if arrays is None:
        mesh_cache.store(name, _packed(mesh))
    return replace(mesh, doflocs=mesh.doflocs * shape.D)


def _rounded(value: float) -> float:
    """Round to twelve digits, so that similar shapes have equal numbers in units of D, and so share a mesh."""
    return float(f"{value:.11e}")


def _built(unit: Shape, sizes_D: Sizes, half: bool, magnet: Parts, timeout: float) -> MeshTet2:
    """Make a new mesh for D = 1."""
    sizes, shape = sizes_D.scaled(WORK_DIAMETER), unit.scaled(WORK_DIAMETER)
    zoom = Zoom.of(shape)
    for factor in TRIES:
        attempt = sizes.finer(factor)
        straight = _raw(attempt, half, timeout)
        if magnet == "hole":
            straight = straight.restrict(straight.subdomains["silicone"])
            del straight.subdomains["magnet"]
        straight = replace(straight, doflocs=zoom.back(straight.p))
        mesh = curved_mesh.curved(straight, attempt, shape)
        if mesh is not None:
            return replace(mesh, doflocs=mesh.doflocs / WORK_DIAMETER)
    raise MeshError(
        f"the mesh of size {sizes_D.bulk:g} D has folded or flat cells, or a wrong volume, on the exact surfaces"
        + (" or has no edges along its rim: try a smaller size there" if sizes_D.ring else ": try a smaller size")
    )


# The cache


@functools.cache
def _makers() -> list[str]:
    """Return what determines a mesh besides the request: versions of libraries, and a hash of the code of meshing."""
    code = hashlib.sha256()
    used = (cad, curved_mesh, edge_singularity, exact_surfaces, edge_lengths, surface_triangulation, zooming)
    for file in (Path(__file__), CHILD, *(Path(str(module.__file__)) for module in used)):
        code.update(file.read_bytes())
    versions = [f"{name} {version(name)}" for name in ("pytetwild", "scikit-fem", "numpy", "scipy")]
    return [*versions, code.hexdigest()]


def _packed(mesh: MeshTet2) -> dict[str, NDArray[Any]]:
    """Return the mesh as named arrays; `_unpacked` is the inverse."""
    named = {f"boundary {name}": facets for name, facets in mesh.boundaries.items()}
    named |= {f"subdomain {name}": cells for name, cells in mesh.subdomains.items()}
    return {"doflocs": mesh.doflocs, "t": mesh.t, **named}


def _unpacked(arrays: dict[str, NDArray[Any]]) -> MeshTet2:
    """Return the mesh of named arrays."""
    parts: dict[str, dict[str, NDArray[Any]]] = {"boundary": {}, "subdomain": {}}
    for name, array in arrays.items():
        kind, _, part = name.partition(" ")
        if part:
            parts[kind][part] = array
    return MeshTet2(
        arrays["doflocs"], arrays["t"], _boundaries=parts["boundary"], _subdomains=parts["subdomain"], sort_t=False
    )


# Running fTetWild


def _raw(sizes: Sizes, half: bool, timeout: float) -> MeshTet1:
    """Return fTetWild's straight mesh with its subdomains and boundaries."""
    points, faces = surface_triangulation.body(sizes, half)
    inner, inner_faces = (
        surface_triangulation.magnet(sizes, half) if sizes.shape.has_magnet else (points[:0], faces[:0])
    )
    epsilon = surface_triangulation.envelope(sizes)
    soup, soup_faces = np.vstack([points, inner]), np.vstack([faces, inner_faces + len(points)])
    surface_triangulation.check_surface(soup, soup_faces, epsilon, sizes.wall)
    if sizes.ring:
        strip, strip_faces = surface_triangulation.fin(sizes, half)
        soup_faces = np.vstack([soup_faces, strip_faces + len(soup)])
        soup = np.vstack([soup, strip])
    field = edge_lengths.background(sizes, half)
    p, t = _tetwild(soup, soup_faces, sizes.bulk, epsilon, field, timeout, around=sizes.ring > 0)
    if sizes.ring:  # the strip is open, so fTetWild cannot separate inside from outside: it fills a box
        t = t[surface_triangulation.in_body(p[t].mean(axis=1), sizes, half)]
        used, t = np.unique(t, return_inverse=True)
        p, t = p[used], t.reshape(-1, 4)
    parts = {"silicone": np.arange(len(t))}
    if sizes.shape.has_magnet:
        inside = surface_triangulation.in_magnet(p[t].mean(axis=1), sizes, half)
        parts = {"silicone": np.flatnonzero(~inside), "magnet": np.flatnonzero(inside)}
    mesh = MeshTet1(np.ascontiguousarray(p.T), np.ascontiguousarray(t.T), _subdomains=parts)
    return curved_mesh.name_boundaries(mesh, 4 * epsilon, half)


def _tetwild(
    points: Array,
    faces: Ints,
    size: float,
    epsilon: float,
    field: tuple[Array, Ints, Array],
    timeout: float,
    *,
    around: bool = False,
) -> tuple[Array, Ints]:
    """Run fTetWild in a child process; return points (n, 3) and cells (m, 4), lengths in the unit of `points`.

    Parameters
    ----------
    points, faces : surface, shapes (n, 3) and (m, 3).
    size, epsilon : edge length in the bulk, and size of the envelope.
    field : points, tetrahedra and edge lengths of the background grid.
    timeout : time limit, s.
    around : True to keep the cells outside the surface too, in a box around it.
    """
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    with tempfile.TemporaryDirectory() as folder:
        input_file, output_file = Path(folder, "input.npz"), Path(folder, "output.npz")
        np.savez(
            input_file,
            points=points,
            faces=faces.astype(np.int32),
            size=size,
            epsilon=epsilon / diagonal,
            grid=field[0],
            tets=field[1].astype(np.int32),
            values=field[2],
            around=around,
            passes=PASSES,
        )
        # -P: otherwise the child could import modules of this folder in place of libraries of the same name
        command = [sys.executable, "-P", str(CHILD), str(input_file), str(output_file)]
        try:
            process = subprocess.run(
                command,
                cwd=folder,
                capture_output=True,
                encoding="utf-8",
                errors="replace",
                timeout=timeout,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise MeshError(f"fTetWild did not finish within {timeout:g} s: try a larger size") from None
        if process.returncode or not output_file.exists():
            cause = (process.stderr.strip().splitlines() or ["no message"])[-1]
            raise MeshError(f"fTetWild failed with exit code {process.returncode} ({cause}): try another size")
        with np.load(output_file) as arrays:
            p, t = arrays["points"].astype(np.float64), arrays["cells"].astype(np.int64)
            if not arrays["seeded"]:
                warn_once(UNSEEDED)
    if not len(t) or not np.isfinite(p).all():
        raise MeshError("fTetWild returned an empty mesh: try another size")
    return p, t
