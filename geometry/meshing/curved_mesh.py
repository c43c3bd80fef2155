"""Conversion of a straight mesh to a second-order mesh on the exact surfaces.

Vertices and middle nodes of edges are moved to the exact surfaces. A quadratic facet through points of a curved
surface still deviates from the surface between these points; on a coarse mesh the deviation would change the volume
by about 1e-4. So the middle nodes are moved along the normal until the mean deviation of the facets around each one
vanishes: then the volume between facets and surface vanishes to first order.

A small fillet of the magnet may be meshed as a sharp edge. This edge is moved inwards until the magnet has its exact
volume.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from skfem import ElementTetP2, ElementTriP2, MeshTet1, MeshTet2
from skfem.quadrature import get_quadrature

from geometry import cad
from geometry.arrays import Array, Ints
from geometry.design import Shape
from geometry.meshing import exact_surfaces, surface_triangulation
from geometry.meshing.edge_lengths import Sizes
from geometry.meshing.edge_singularity import SingularEdges
from geometry.meshing.exact_surfaces import Masks

About = Callable[[Array, Shape], exact_surfaces.Near]

LEAST_JACOBIAN = 0.05
"""Least allowed ratio, in a cell, of the least to the greatest Jacobian at the quadrature points of order 4; half of
that at a ring, where a graded cell with straight edges has 0.05 itself."""
LEAST_SHAPE = 0.02
"""Least allowed shape of a straight cell: three times its inscribed over its circumscribed radius."""
ROUNDS, VOLUME = 10, 1e-5
"""Most rounds of fitting facets and straightening cells; largest relative error of a volume at the end."""


def name_boundaries(mesh: MeshTet1, tolerance: float, half: bool) -> MeshTet1:
    """Return the straight mesh with named boundaries, determined from the positions and normals of the facets.

    tolerance : largest distance of a facet from the plane of base or symmetry. half : True for the part y >= 0.
    """
    first, second = mesh.f2t
    outer = np.flatnonzero(second < 0)
    corners = mesh.p[:, mesh.facets[:, outer]]
    normal = normals(mesh, outer)
    flat = [(np.abs(corners[k]).max(axis=0) < tolerance) & (np.abs(normal[k]) > 0.7) for k in range(3)]
    base = flat[2]
    mirror = flat[1] & ~base & half
    boundaries = {"base": outer[base], "skin": outer[~base & ~mirror]}
    if half:
        boundaries["symmetry"] = outer[mirror]
    if "magnet" in mesh.subdomains:
        inside = np.zeros(mesh.nelements, dtype=bool)
        inside[mesh.subdomains["magnet"]] = True
        boundaries["magnet"] = np.flatnonzero((second >= 0) & (inside[first] != inside[second]))
    return replace(mesh, _boundaries=boundaries)


def normals(mesh: MeshTet1, facets: Ints) -> Array:
    """Return unit normals of facets, shape (3, n), of arbitrary sign."""
    a, b, c = np.moveaxis(mesh.p[:, mesh.facets[:, facets]], 1, 0)
    normal = np.cross(b - a, c - a, axis=0)
    return np.asarray(normal / np.linalg.norm(normal, axis=0))


def _nodes_on(mesh: MeshTet1, facets: Ints) -> NDArray[np.bool_]:
    """Return a mask of the vertices and edges, in this order, that belong to the facets."""
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
    """Return a mask of the vertices and edges, in this order, on the ring; None if a facet crosses the ring."""
    skin = mesh.boundaries["skin"]
    out = np.hypot(mesh.p[0], mesh.p[1])
    near = np.hypot(out - sizes.ring_radius, mesh.p[2] - sizes.ring_height) < 2 * surface_triangulation.envelope(
        sizes
    )
    inside = ~near & (out < sizes.ring_radius) & (mesh.p[2] > sizes.shape.H)
    inner = inside[mesh.facets[:, skin]].any(axis=0)
    outer = (~inside & ~near)[mesh.facets[:, skin]].any(axis=0)
    if not inner.any() or (inner == outer).any():
        return None
    return _nodes_on(mesh, skin[inner]) & _nodes_on(mesh, skin[outer])


def curved(mesh: MeshTet1, sizes: Sizes, true: Shape) -> MeshTet2 | None:
    """Return the mesh with quadratic cells on the exact surfaces.

    The result is None if a cell folds or becomes flat, a facet crosses the ring, or a volume is wrong.

    Parameters
    ----------
    sizes : the sizes with which the mesh was made.
    true : the true body; `sizes.shape` may have an enlarged magnet.
    """
    on = {name: _nodes_on(mesh, facets) for name, facets in mesh.boundaries.items()}
    if sizes.ring:
        ring = _ring(mesh, sizes)
        if ring is None:
            return None
        on["ring"] = ring
    shape = true
    if "magnet" in on and not sizes.rounded:
        shape = replace(shape, magnet_edge_radius=0.0)
        facets = mesh.boundaries["magnet"]
        lid = np.abs(normals(mesh, facets)[2]) > 0.7
        on["edge"] = _nodes_on(mesh, facets[lid]) & _nodes_on(mesh, facets[~lid])
    n, at_ring = mesh.nvertices, (sizes.ring_radius, sizes.ring_height)
    p = exact_surfaces.project(mesh.p, {name: mask[:n] for name, mask in on.items()}, shape, at_ring)
    top = p[2].argmax()
    if math.hypot(p[0, top], p[1, top]) < max(0.01 * shape.R, 0.3 * sizes.tip):
        p[:, top] = 0, 0, shape.L  # a vertex exactly at the tip, which a plate touches first
    p = repair_flat_cells(p, mesh.t, {name: mask[:n] for name, mask in on.items()})
    if shapes(p[:, mesh.t]).min() < LEAST_SHAPE:
        return None
    x = exact_surfaces.project(MeshTet2.from_mesh(replace(mesh, doflocs=p)).doflocs, on, shape, at_ring)
    x[:, :n] = p
    singular = _singular_edges(mesh, on["ring"][:n]) if sizes.ring else None
    if singular is not None:
        singular.move(x)
        x = exact_surfaces.project(x, on, shape, at_ring)
        x[:, :n] = p
    # nodes of the ring stay on it; each round adds the nodes that a distorted cell has moved back
    kept = on.get("ring", np.zeros(x.shape[1], dtype=bool))
    half = 0.5 if "symmetry" in on else 1.0
    fits = [_Fit(facet_nodes(mesh, mesh.boundaries["skin"]), exact_surfaces.skin, 0.0, half * cad.beam_volume(true))]
    if "magnet" in on:
        magnet = facet_nodes(mesh, mesh.boundaries["magnet"])
        fits.append(_Fit(magnet, exact_surfaces.magnet, true.H, half * cad.magnet_volume(true)))
    for k in range(ROUNDS):
        for fit in fits:
            if fit.about is exact_surfaces.magnet and "edge" in on:
                x = x if k else _fit_locally(x, magnet[:, ~lid], exact_surfaces.side, shape, kept)
                x = _move_edges_in(x, fit, on["edge"])
            else:
                x = _match_volume(_fit_locally(x, fit.nodes, fit.about, shape, kept), fit, shape, kept)
        straightened = _straighten(mesh, x, on, singular)
        if straightened is None or not straightened[1].any():
            break
        x, kept = straightened[0].doflocs.copy(), kept | straightened[1]
    if straightened is None:
        return None
    inner = fits[1].volume if "magnet" in on else 0.0
    exact = {"silicone": fits[0].volume - inner, "magnet": inner}
    # volumes of cells, not of facets: a sum over facets that fold over may be right by chance
    if any(abs(volume - exact[name]) > VOLUME * exact[name] for name, volume in volumes(straightened[0]).items()):
        return None
    return straightened[0]


def volumes(mesh: MeshTet2) -> dict[str, float]:
    """Return the volume of each region, integrated over its curved cells."""
    weights = get_quadrature(ElementTetP2().refdom, 4)[1]
    cells = weights @ determinants(mesh.doflocs, mesh.dofs.element_dofs)[4:]
    return {name: float(cells[index].sum()) for name, index in mesh.subdomains.items()}


def repair_flat_cells(p: Array, t: Ints, on: Masks) -> Array:
    """Return vertices, shape (3, n), some of them moved to improve flat cells.

    fTetWild leaves flat cells at a magnet's edge, between three vertices of the edge and one next to it. Moving
    vertices to the exact surfaces makes a few more cells flat. A vertex of a flat cell moves to that point, of 27
    around it, where the worst of its cells has the best shape. Only vertices inside the body and on the plane of
    symmetry move, and none if every cell has at least `LEAST_SHAPE`.

    p, t : vertices, shape (3, n), and cells, shape (4, m). on : masks (n,) of the vertices on each boundary.
    """
    if shapes(p[:, t]).min() >= LEAST_SHAPE:
        return p
    p, steps = p.copy(), np.stack(np.meshgrid(*3 * [[-1.0, 0.0, 1.0]])).reshape(3, -1)
    fixed = on["base"] | on["skin"] | on.get("magnet", False)
    # large steps first, then small ones; the sequence is repeated because neighbours may have moved
    for reach in np.repeat([0.2, 0.1, 0.05, 0.2, 0.1, 0.05], 3):
        flat = np.flatnonzero(shapes(p[:, t]) < 3 * LEAST_SHAPE)
        for vertex in np.setdiff1d(t[:, flat], np.flatnonzero(fixed)):
            cells = t[:, (t == vertex).any(axis=0)]
            length = reach * np.linalg.norm(p[:, cells] - p[:, [vertex], None], axis=0).max()
            places = p[:, [vertex]] + length * steps
            if "symmetry" in on and on["symmetry"][vertex]:
                places[1] = 0
            around = np.repeat(p[:, cells, None], steps.shape[1], axis=3)
            around = np.where(cells[None, :, :, None] == vertex, places[:, None, None], around)
            worst = shapes(around.reshape(3, 4, -1)).reshape(cells.shape[1], -1).min(axis=0)
            p[:, vertex] = places[:, worst.argmax()]
    return p


@dataclass(frozen=True, slots=True)
class _Fit:
    """The facets of a surface, and the volume that they must enclose together with planes through a pole on the axis.

    Attributes
    ----------
    nodes : nodes of the facets, shape (6, n).
    about : function that returns the position of points relative to the exact surface.
    pole : height of the pole; the body is star-shaped about the pole.
    volume : exact volume.
    """

    nodes: Ints
    about: About
    pole: float
    volume: float

    def missing(self, x: Array) -> float:
        """Return the exact volume less that of the facets, for node coordinates x, shape (3, n).

        The divergence theorem turns the volume into an integral over facets. Base and plane of symmetry contain the
        pole, so they add nothing.
        """
        points, areas = patches(x, self.nodes)
        points[2] -= self.pole
        return self.volume - float(np.abs((points * areas).sum(axis=0)).sum()) / 3


def facet_nodes(mesh: MeshTet1, facets: Ints) -> Ints:
    """Return the nodes of quadratic facets, shape (6, n): corners, then middle nodes of the edges 01, 12 and 02."""
    corners = mesh.facets[:, facets].astype(np.int64)
    ends = np.sort(corners[[[0, 1], [1, 2], [0, 2]]], axis=1)
    low, high = np.sort(mesh.edges, axis=0).astype(np.int64)
    keys = low * mesh.nvertices + high
    order = np.argsort(keys)
    edge = order[np.searchsorted(keys, ends[:, 0] * mesh.nvertices + ends[:, 1], sorter=order)]
    return np.vstack([corners, mesh.nvertices + edge])


def patches(x: Array, nodes: Ints) -> tuple[Array, Array]:
    """Return quadrature points of quadratic facets and their area vectors, both of shape (3, points, facets)."""
    element = ElementTriP2()
    at, weights = get_quadrature(element.refdom, 6)
    values, slopes = zip(*(element.lbasis(at, k) for k in range(6)), strict=True)
    points = np.einsum("ikf,kq->iqf", x[:, nodes], np.stack(values), optimize=True)
    along = np.einsum("ikf,kjq->jiqf", x[:, nodes], np.stack(slopes), optimize=True)
    return points, np.cross(along[0], along[1], axis=0) * weights[:, None]


def _fit_locally(x: Array, nodes: Ints, about: About, shape: Shape, kept: NDArray[np.bool_]) -> Array:
    """Move each middle node that is not `kept` until the volume between its facets and the surface vanishes."""
    x = x.copy()
    middles = np.unique(nodes[3:])
    middles = middles[~kept[middles]]
    for _ in range(3):
        points, areas = patches(x, nodes)
        near = about(points, shape)
        area = np.abs((areas * near.normal).sum(axis=0))
        # volume between facet and surface; the second term accounts for the change of area along the normal
        volume = area * near.distance * (1 - near.curvature * near.distance / 2)
        out, whole = (
            np.bincount(nodes[3:].ravel(), np.tile(share.sum(axis=0), 3))[middles] for share in (volume, area)
        )
        x[:, middles] -= out / whole * about(x[:, middles], shape).normal
    return x


def _match_volume(x: Array, fit: _Fit, shape: Shape, kept: NDArray[np.bool_]) -> Array:
    """Move all middle nodes that are not `kept` by one common distance, so that the enclosed volume is exact."""
    x = x.copy()
    middles = np.unique(fit.nodes[3:])
    middles = middles[~kept[middles]]
    for _ in range(2):
        area = np.linalg.norm(patches(x, fit.nodes)[1].sum(axis=1), axis=0)
        share = np.bincount(fit.nodes[3:].ravel(), np.tile(area, 3))[middles].sum() / 3
        x[:, middles] += fit.missing(x) / share * fit.about(x[:, middles], shape).normal
    return x


def _move_edges_in(x: Array, fit: _Fit, edge: NDArray[np.bool_]) -> Array:
    """Move the sharp edges of a magnet inwards until its volume is that of the magnet with fillets."""
    inwards = np.zeros_like(x)
    inwards[:2, edge] = -x[:2, edge] / np.hypot(*x[:2, edge])
    inwards[2, edge] = np.sign(fit.pole - x[2, edge])
    areas = np.linalg.norm(patches(x, fit.nodes)[1].sum(axis=1), axis=0)
    slope = areas[edge[fit.nodes[3:]].any(axis=0)].sum() / 3
    depth = 0.0
    for _ in range(3):
        depth -= fit.missing(x + depth * inwards) / slope
    return x + depth * inwards


def _singular_edges(mesh: MeshTet1, ring: NDArray[np.bool_]) -> SingularEdges:
    """Return the edges with one end on the ring, whose vertices a mask (vertices,) tells."""
    a, b = mesh.edges.astype(np.int64)
    middle = np.flatnonzero(ring[a] != ring[b])
    a, b = a[middle], b[middle]
    return SingularEdges(np.where(ring[a], a, b), np.where(ring[a], b, a), mesh.nvertices + middle)


def _straighten(
    mesh: MeshTet1, x: Array, on: Masks, singular: SingularEdges | None
) -> tuple[MeshTet2, NDArray[np.bool_]] | None:
    """Return the mesh with nodes x, shape (3, n), and a mask of the middle nodes that had to be moved back.

    The middle nodes of a distorted cell are moved back, in steps, to where they lie on straight edges: in the middle
    or, on `singular` edges, nearer to the ring. The result is None if twenty steps are not enough.
    """
    n = mesh.nvertices
    straight = MeshTet2.from_mesh(replace(mesh, doflocs=np.ascontiguousarray(x[:, :n])))
    nodes = straight.dofs.element_dofs
    if singular is not None:
        singular.move(straight.doflocs)
    least = np.minimum(LEAST_JACOBIAN, _uniformity(determinants(straight.doflocs, nodes)[4:]) / 2)
    bend = _extend_inside(x - straight.doflocs, nodes[4:], on)
    share = np.ones(x.shape[1])
    for _ in range(20):
        moved = straight.doflocs + share * bend
        det = determinants(moved, nodes)
        bad = (det <= 0).any(axis=0) | (_uniformity(det[4:]) < least)
        if not bad.any():
            curved = MeshTet2(moved, straight.t, _boundaries=mesh.boundaries, _subdomains=mesh.subdomains)
            return curved, (share < 1) & bend.any(axis=0)
        share[nodes[4:, bad]] *= 0.75
    return None


def _uniformity(determinant: Array) -> Array:
    """Return the least over the greatest of the determinants (points, cells) in each cell."""
    return np.asarray(determinant.min(axis=0) / determinant.max(axis=0))


def _extend_inside(bend: Array, middles: Ints, on: Masks) -> Array:
    """Extend the shifts of the nodes on the surfaces to the middle nodes inside, shape (3, n).

    Each middle node inside gets the mean shift of the cells around it, in eight rounds: cells near a curved surface
    are then less distorted than with straight edges inside.

    middles : middle nodes of the edges of each cell, shape (6, cells).
    """
    held = on["base"] | on["skin"] | on.get("magnet", False)
    held[: middles.min()] = True
    count = np.maximum(np.bincount(middles.ravel(), minlength=len(held)), 1)
    for _ in range(8):
        cells = np.tile(bend[:, middles].mean(axis=1), 6)
        mean = np.stack([np.bincount(middles.ravel(), cell, len(held)) for cell in cells]) / count
        if "symmetry" in on:
            mean[1, on["symmetry"]] = 0
        bend = np.where(held, bend, mean)
    return bend


def determinants(x: Array, nodes: Ints) -> Array:
    """Return the Jacobian determinants at corners and quadrature points of order 4, shape (points, cells).

    x, nodes : coordinates, shape (3, n), and nodes of each cell, shape (10, cells).
    """
    element = ElementTetP2()
    points = np.hstack([element.refdom.p, get_quadrature(element.refdom, 4)[0]])
    slopes = np.stack([element.lbasis(points, k)[1] for k in range(10)])
    jacobian = np.einsum("ikc,kjq->qcij", x[:, nodes], slopes, optimize=True)
    return np.asarray(np.linalg.det(jacobian))


def shapes(corners: Array) -> Array:
    """Return `radius_ratios`, negative for inverted cells (J <= 0), of corners of shape (3, 4, cells)."""
    a, b, c = (corners[:, k] - corners[:, 0] for k in (1, 2, 3))
    return np.asarray(np.sign((a * np.cross(b, c, axis=0)).sum(axis=0)) * radius_ratios(corners))


def radius_ratios(corners: Array) -> Array:
    """Return three times the inscribed over the circumscribed radius of cells; 0 where two corners coincide.

    corners : coordinates of the corners, shape (3, 4, cells).
    """
    a, b, c = (corners[:, k] - corners[:, 0] for k in (1, 2, 3))
    ab, bc, ca = (np.cross(u, v, axis=0) for u, v in ((a, b), (b, c), (c, a)))
    six = np.abs((a * bc).sum(axis=0))
    area = sum(np.linalg.norm(side, axis=0) for side in (ab, bc, ca, ab + bc + ca))
    centre = (a**2).sum(axis=0) * bc + (b**2).sum(axis=0) * ca + (c**2).sum(axis=0) * ab
    size = area * np.linalg.norm(centre, axis=0)
    return np.asarray(np.divide(6 * six**2, size, out=np.zeros_like(size), where=size > 0))
