"""The curved second-order tetrahedral mesh of the beam with its magnet, made by fTetWild through pytetwild.

fTetWild meshes the inside of faceted surfaces with an envelope; the mesh is then made exact: its outer and interface
nodes are put on the base, the symmetry plane, the side, the dome and the magnet, those in the middle of edges too.
fTetWild crashes or hangs on bad input, so the input is checked and the work is done in a child process; it is not
deterministic, so two meshes of one shape differ by some percent in their counts.
"""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from skfem import ElementTetP2, FacetBasis, MeshTet1, MeshTet2
from skfem.quadrature import get_quadrature

from geometry import surface
from geometry.design import BadInput, Shape
from geometry.surface import Floats, Ints, Sizes

Parts = Literal["regions", "hole", "none"]

WORK_DIAMETER = 8.0
"""Diameter of the beam while it is meshed: fTetWild does not return at very small scales."""

LEAST_JACOBIAN = 0.05
"""Least ratio in a cell of the least to the greatest Jacobian at the quadrature points of order 4."""

_CHILD = """
import sys, numpy, pytetwild
with numpy.load(sys.argv[1]) as given:
    points, cells = pytetwild.tetrahedralize(
        given["points"], given["faces"], edge_length_abs=float(given["size"]), epsilon=float(given["epsilon"]),
        num_threads=1, vtk_ordering=True, quiet=True, disable_filtering=bool(given["around"]),
        bg_vertices=given["grid"], bg_tets=given["tets"], bg_values=given["values"])
numpy.savez(sys.argv[2], points=points, cells=cells)
"""


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
    """Mesh of the beam in the unit of `shape`, base at z = 0, curved to the exact surfaces.

    Parameters
    ----------
    size : edge length in the bulk; near the magnet's edges, the clamped rim and in thin layers it is smaller.
    half : only the part y >= 0.
    magnet : "regions" meshes it, with an interface that conforms; "hole" leaves it out; "none" is all silicone.
    tip_size : edge length in the zone of contact at the tip; half of `size` by default.
    rim : radius of a ring around the axis on the dome, and the edge length there: edges follow it, so that every
        facet of the dome lies within it or without.
    timeout : time limit of one run of fTetWild, s.

    Returns
    -------
    Mesh with boundaries "base", "skin" (side and dome), "symmetry" (half only) and "magnet" (its surface), and
    subdomains "silicone" and "magnet".

    Raises
    ------
    BadInput
        A size is not a positive number, the ring is not on the dome, or the shape has no magnet to mesh or one that
        sticks out.
    RuntimeError
        fTetWild failed, ran out of time, or twice gave a mesh that cannot be curved or has no edges on the ring.
    """
    given = {"size": size, "tip_size": tip_size, "the edge length at the rim": rim and rim[1]}
    for name, value in given.items():
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
    factor = WORK_DIAMETER / shape.D
    work = shape.scaled(factor)
    ring = None if rim is None else (factor * rim[0], factor * rim[1])
    sizes = Sizes.of(work, factor * size, None if tip_size is None else factor * tip_size, ring)
    for finer in (1.0, 0.8):
        tried = sizes.finer(finer)
        straight = _raw(tried, half, timeout)
        if magnet == "hole":
            straight = straight.restrict(straight.subdomains["silicone"])
            del straight.subdomains["magnet"]
        mesh = _curved(straight, tried)
        if mesh is not None:
            return replace(mesh, doflocs=mesh.doflocs / factor)
    raise RuntimeError(
        f"the mesh of size {size:g} folds over when it is curved to the exact surfaces"
        + (": try a smaller size" if rim is None else " or has no edges along its rim: try a smaller size there")
    )


# Running fTetWild


def _raw(sizes: Sizes, half: bool, timeout: float) -> MeshTet1:
    """Straight mesh with its subdomains, as fTetWild gives it."""
    points, faces = surface.body(sizes, half)
    inner, inner_faces = surface.magnet(sizes, half) if sizes.shape.has_magnet else (points[:0], faces[:0])
    epsilon = surface.envelope(sizes)
    soup, soup_faces = np.vstack([points, inner]), np.vstack([faces, inner_faces + len(points)])
    surface.check_surface(soup, soup_faces, epsilon, sizes.shape.wall)
    if sizes.ring:
        strip, strip_faces = surface.fin(sizes, half)
        soup_faces = np.vstack([soup_faces, strip_faces + len(soup)])
        soup = np.vstack([soup, strip])
    field = surface.background(sizes, half)
    p, t = _tetwild(soup, soup_faces, sizes.bulk, epsilon, field, timeout, around=sizes.ring > 0)
    if sizes.ring:  # beside an open strip fTetWild does not know inside from outside
        t = t[surface.winding(p[t].mean(axis=1), points, faces) > 0.5]
        used, t = np.unique(t, return_inverse=True)
        p, t = p[used], t.reshape(-1, 4)
    inside = surface.winding(p[t].mean(axis=1), inner, inner_faces) > 0.5
    parts = {"silicone": np.flatnonzero(~inside)}
    if sizes.shape.has_magnet:
        parts["magnet"] = np.flatnonzero(inside)
    mesh = MeshTet1(np.ascontiguousarray(p.T), np.ascontiguousarray(t.T), _subdomains=parts)
    return _labelled(mesh, 4 * epsilon, half)


def _tetwild(
    points: Floats,
    faces: Ints,
    size: float,
    epsilon: float,
    field: tuple[Floats, Ints, Floats],
    timeout: float,
    *,
    around: bool = False,
) -> tuple[Floats, Ints]:
    """Points (n, 3) and cells (m, 4) from fTetWild in a child process; lengths in the unit of `points`.

    around : keep the cells outside too, out to a box.
    """
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    with tempfile.TemporaryDirectory() as folder:
        given, found = Path(folder, "given.npz"), Path(folder, "found.npz")
        np.savez(
            given,
            points=points,
            faces=faces.astype(np.int32),
            size=size,
            epsilon=epsilon / diagonal,
            grid=field[0],
            tets=field[1].astype(np.int32),
            values=field[2],
            around=around,
        )
        command = [sys.executable, "-c", _CHILD, str(given), str(found)]
        try:
            ended = subprocess.run(
                command,
                cwd=folder,
                capture_output=True,
                encoding="utf-8",
                errors="replace",
                timeout=timeout,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise RuntimeError(f"fTetWild did not end within {timeout:g} s: try a larger size or timeout") from None
        if ended.returncode or not found.exists():
            cause = (ended.stderr.strip().splitlines() or ["no message"])[-1]
            raise RuntimeError(f"fTetWild failed with exit code {ended.returncode} ({cause}): try another size")
        with np.load(found) as arrays:
            p, t = arrays["points"].astype(np.float64), arrays["cells"].astype(np.int64)
    if not len(t) or not np.isfinite(p).all():
        raise RuntimeError("fTetWild returned an empty mesh: try another size")
    return p, t


# Curving


def _labelled(mesh: MeshTet1, tolerance: float, half: bool) -> MeshTet1:
    """The straight mesh with its boundaries, found from where the facets lie and how they face."""
    first, second = mesh.f2t
    outer = np.flatnonzero(second < 0)
    corners = mesh.p[:, mesh.facets[:, outer]]
    normal = _normals(mesh, outer)
    flat = [(np.abs(corners[k]).max(axis=0) < tolerance) & (np.abs(normal[k]) > 0.7) for k in range(3)]
    base = flat[2]
    mirror = flat[1] & ~base & half
    found = {"base": outer[base], "skin": outer[~base & ~mirror]}
    if half:
        found["symmetry"] = outer[mirror]
    if "magnet" in mesh.subdomains:
        inside = np.zeros(mesh.nelements, dtype=bool)
        inside[mesh.subdomains["magnet"]] = True
        found["magnet"] = np.flatnonzero((second >= 0) & (inside[first] != inside[second]))
    return replace(mesh, _boundaries=found)


def _normals(mesh: MeshTet1, facets: Ints) -> Floats:
    """Unit normals of facets, shape (3, n), of either sign."""
    a, b, c = np.moveaxis(mesh.p[:, mesh.facets[:, facets]], 1, 0)
    normal = np.cross(b - a, c - a, axis=0)
    return np.asarray(normal / np.linalg.norm(normal, axis=0))


def _nodes_on(mesh: MeshTet1, facets: Ints) -> NDArray[np.bool_]:
    """Which vertices and edges, in this order, belong to the facets."""
    count = mesh.nvertices
    corners = np.sort(mesh.facets[:, facets], axis=0).astype(np.int64)
    on = np.zeros(count + mesh.nedges, dtype=bool)
    on[corners] = True
    pairs = np.concatenate(
        [corners[0] * count + corners[1], corners[0] * count + corners[2], corners[1] * count + corners[2]]
    )
    low, high = np.sort(mesh.edges, axis=0).astype(np.int64)
    on[count:] = np.isin(low * count + high, pairs)
    return on


def _ring(mesh: MeshTet1, sizes: Sizes) -> NDArray[np.bool_] | None:
    """Which vertices and edges, in this order, are on the ring; None if a facet lies on both its sides."""
    skin = mesh.boundaries["skin"]
    out = np.hypot(mesh.p[0], mesh.p[1])
    near = np.hypot(out - sizes.ring_radius, mesh.p[2] - sizes.ring_height) < 2 * surface.envelope(sizes)
    inside = ~near & (out < sizes.ring_radius) & (mesh.p[2] > sizes.shape.H)
    inner = inside[mesh.facets[:, skin]].any(axis=0)
    outer = (~inside & ~near)[mesh.facets[:, skin]].any(axis=0)
    if not inner.any() or (inner == outer).any():
        return None
    return _nodes_on(mesh, skin[inner]) & _nodes_on(mesh, skin[outer])


def _curved(mesh: MeshTet1, sizes: Sizes) -> MeshTet2 | None:
    """The mesh with quadratic cells on the exact surfaces; None if that folds a cell over or misses the ring."""
    on = {name: _nodes_on(mesh, facets) for name, facets in mesh.boundaries.items()}
    if sizes.ring:
        ring = _ring(mesh, sizes)
        if ring is None:
            return None
        on["ring"] = ring
    if "magnet" in on and not sizes.rounded:
        facets = mesh.boundaries["magnet"]
        lid = np.abs(_normals(mesh, facets)[2]) > 0.7
        on["edge"] = _nodes_on(mesh, facets[lid]) & _nodes_on(mesh, facets[~lid])
    n = mesh.nvertices
    p = surface.project(mesh.p, {name: mask[:n] for name, mask in on.items()}, sizes)
    top = p[2].argmax()
    if math.hypot(p[0, top], p[1, top]) < 0.01 * sizes.shape.R:
        p[:, top] = 0, 0, sizes.shape.L  # what a plate touches first
    straight = MeshTet2.from_mesh(replace(mesh, doflocs=p))
    x = surface.project(straight.doflocs, on, sizes)
    x[:, :n] = p
    nodes = straight.dofs.element_dofs
    share = np.ones(x.shape[1])
    share[:n] = 0
    for _ in range(20):
        now = straight.doflocs + share * (x - straight.doflocs)
        det = _determinants(now, nodes)
        bad = (det <= 0).any(axis=0) | (det[4:].min(axis=0) < LEAST_JACOBIAN * det[4:].max(axis=0))
        if not bad.any():
            return MeshTet2(now, straight.t, _boundaries=mesh.boundaries, _subdomains=mesh.subdomains)
        relax = np.zeros(len(share), dtype=bool)
        relax[nodes[:, bad]] = True
        share[relax] *= 0.75
    return None


def _determinants(x: Floats, nodes: Ints) -> Floats:
    """Jacobian determinants at the corners and quadrature points of order 4, shape (points, cells)."""
    element = ElementTetP2()
    points = np.hstack([element.refdom.p, get_quadrature(element.refdom, 4)[0]])
    slopes = np.stack([element.lbasis(points, k)[1] for k in range(10)])
    jacobian = np.einsum("ikc,kjq->qcij", x[:, nodes], slopes, optimize=True)
    return np.asarray(np.linalg.det(jacobian))


# Quality


@dataclass(frozen=True, slots=True)
class Quality:
    """What a mesh is worth.

    Attributes
    ----------
    cells, nodes : counts; the nodes include those in the middle of edges.
    volumes : volume of each region, in the cube of the mesh's unit.
    volume_errors : their relative errors against the exact bodies.
    base_error : relative error of the area of the base.
    least_shape, mean_shape : three times the inscribed over the circumscribed radius of straight cells; 1 is best.
    least_jacobian : least ratio in a cell of the least to the greatest Jacobian at the quadrature points of order 4;
        1 is straight, 0 is folded.
    """

    cells: int
    nodes: int
    volumes: dict[str, float]
    volume_errors: dict[str, float]
    base_error: float
    least_shape: float
    mean_shape: float
    least_jacobian: float


def quality(mesh: MeshTet2, shape: Shape) -> Quality:
    """The quality of a mesh that `tetrahedra` made for `shape`."""
    part = 0.5 if "symmetry" in mesh.boundaries else 1.0
    nodes = mesh.dofs.element_dofs
    det = _determinants(mesh.doflocs, nodes)
    weights = get_quadrature(ElementTetP2().refdom, 4)[1]
    cells = weights @ det[4:]
    volumes = {name: float(cells[index].sum()) for name, index in mesh.subdomains.items()}
    exact = {"silicone": part * surface.beam_volume(shape)}
    if "magnet" in mesh.boundaries:
        exact["magnet"] = part * surface.magnet_volume(shape)
        exact["silicone"] -= exact["magnet"]
    base = FacetBasis(mesh, ElementTetP2(), facets=mesh.boundaries["base"], intorder=4).dx.sum()
    shapes = _radius_ratios(mesh.doflocs[:, mesh.t])
    return Quality(
        cells=mesh.nelements,
        nodes=mesh.doflocs.shape[1],
        volumes=volumes,
        volume_errors={name: value / exact[name] - 1 for name, value in volumes.items()},
        base_error=float(base / (part * math.pi * shape.R**2) - 1),
        least_shape=float(shapes.min()),
        mean_shape=float(shapes.mean()),
        least_jacobian=float((det[4:].min(axis=0) / det[4:].max(axis=0)).min()),
    )


def _radius_ratios(corners: Floats) -> Floats:
    """Three times the inscribed over the circumscribed radius; corners of shape (3, 4, cells)."""
    a, b, c = (corners[:, k] - corners[:, 0] for k in (1, 2, 3))
    ab, bc, ca = (np.cross(u, v, axis=0) for u, v in ((a, b), (b, c), (c, a)))
    six = np.abs((a * bc).sum(axis=0))
    area = sum(np.linalg.norm(side, axis=0) for side in (ab, bc, ca, ab + bc + ca))
    centre = (a**2).sum(axis=0) * bc + (b**2).sum(axis=0) * ca + (c**2).sum(axis=0) * ab
    return np.asarray(6 * six**2 / (area * np.linalg.norm(centre, axis=0)))
