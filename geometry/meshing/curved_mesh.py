"""From a straight mesh to one of second order on the exact surfaces.

Vertices are put on the surfaces, nodes in the middle of edges too, and then these are moved off again by as much as
the quadratic facets around them stray from the surface in the mean: the volume between facets and surface vanishes to
first order, where facets through points of the surface alone would leave out some 1e-4 of a coarsely meshed body.
A sharp edge that stands for a small fillet is drawn in until the magnet has its volume.
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
from geometry.meshing.exact_surfaces import Masks

About = Callable[[Array, Shape], exact_surfaces.Near]

LEAST_JACOBIAN = 0.05
"""Least ratio in a cell of the least to the greatest Jacobian at the quadrature points of order 4."""
LEAST_SHAPE = 0.02
"""Least shape of a straight cell: three times its inscribed over its circumscribed radius."""
ROUNDS, VOLUME = 10, 1e-5
"""Most rounds of fitting facets and relaxing cells, and the share of a volume that may be missing in the end."""


def labelled(mesh: MeshTet1, tolerance: float, half: bool) -> MeshTet1:
    """The straight mesh with its boundaries, found from where the facets lie and how they face."""
    first, second = mesh.f2t
    outer = np.flatnonzero(second < 0)
    corners = mesh.p[:, mesh.facets[:, outer]]
    normal = normals(mesh, outer)
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


def normals(mesh: MeshTet1, facets: Ints) -> Array:
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
    """The mesh with quadratic cells on the exact surfaces; None if that fails.

    It fails if a cell folds or flattens, if a facet lies on both sides of the ring, or if a volume is missed.
    sizes : those it was meshed with. true : the body, whose magnet may have been meshed enlarged.
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
        p[:, top] = 0, 0, shape.L  # what a plate touches first
    p = mended(p, mesh.t, {name: mask[:n] for name, mask in on.items()})
    if shapes(p[:, mesh.t]).min() < LEAST_SHAPE:
        return None
    x = exact_surfaces.project(MeshTet2.from_mesh(replace(mesh, doflocs=p)).doflocs, on, shape, at_ring)
    x[:, :n] = p
    kept = on.get("ring", np.zeros(x.shape[1], dtype=bool))
    half = 0.5 if "symmetry" in on else 1.0
    fits = [_Fit(facet_nodes(mesh, mesh.boundaries["skin"]), exact_surfaces.skin, 0.0, half * cad.beam_volume(true))]
    if "magnet" in on:
        magnet = facet_nodes(mesh, mesh.boundaries["magnet"])
        fits.append(_Fit(magnet, exact_surfaces.magnet, true.H, half * cad.magnet_volume(true)))
    for k in range(ROUNDS):
        for fit in fits:
            if fit.about is exact_surfaces.magnet and "edge" in on:
                x = x if k else _around(x, magnet[:, ~lid], exact_surfaces.side, shape, kept)
                x = _drawn_in(x, fit, on["edge"])
            else:
                x = _leveled(_around(x, fit.nodes, fit.about, shape, kept), fit, shape, kept)
        found = _relaxed(mesh, x, on)
        if found is None or not found[1].any():
            break
        x, kept = found[0].doflocs.copy(), kept | found[1]
    if found is None:
        return None
    inner = fits[1].volume if "magnet" in on else 0.0
    right = {"silicone": fits[0].volume - inner, "magnet": inner}
    # by the cells, since facets that fold over would deceive a sum over facets
    if any(abs(volume - right[name]) > VOLUME * right[name] for name, volume in volumes(found[0]).items()):
        return None
    return found[0]


def volumes(mesh: MeshTet2) -> dict[str, float]:
    """The volume of each region, by its curved cells."""
    weights = get_quadrature(ElementTetP2().refdom, 4)[1]
    cells = weights @ determinants(mesh.doflocs, mesh.dofs.element_dofs)[4:]
    return {name: float(cells[index].sum()) for name, index in mesh.subdomains.items()}


def mended(p: Array, t: Ints, on: Masks) -> Array:
    """The vertices p, shape (3, n), where cells are flat moved to where the worst cell around them is best.

    fTetWild leaves flat cells at a magnet's edge, between three vertices of it and one beside, and putting vertices
    on the surfaces flattens some more. Only vertices inside and on the plane of symmetry move, and none if no cell is
    too flat.
    """
    if shapes(p[:, t]).min() >= LEAST_SHAPE:
        return p
    p, ways = p.copy(), np.stack(np.meshgrid(*3 * [[-1.0, 0.0, 1.0]])).reshape(3, -1)
    fixed = on["base"] | on["skin"] | on.get("magnet", False)
    for reach in np.repeat([0.2, 0.1, 0.05, 0.2, 0.1, 0.05], 3):
        flat = np.flatnonzero(shapes(p[:, t]) < 3 * LEAST_SHAPE)
        for vertex in np.setdiff1d(t[:, flat], np.flatnonzero(fixed)):
            cells = t[:, (t == vertex).any(axis=0)]
            step = reach * np.linalg.norm(p[:, cells] - p[:, [vertex], None], axis=0).max()
            places = p[:, [vertex]] + step * ways
            if "symmetry" in on and on["symmetry"][vertex]:
                places[1] = 0
            around = np.repeat(p[:, cells, None], ways.shape[1], axis=3)
            around = np.where(cells[None, :, :, None] == vertex, places[:, None, None], around)
            worst = shapes(around.reshape(3, 4, -1)).reshape(cells.shape[1], -1).min(axis=0)
            p[:, vertex] = places[:, worst.argmax()]
    return p


@dataclass(frozen=True, slots=True)
class _Fit:
    """A surface's facets and what they have to enclose, with planes through a pole on the axis.

    Attributes
    ----------
    nodes : of the facets, shape (6, n).
    about : the surface.
    pole : its height; the body is star-shaped about it.
    volume : wanted.
    """

    nodes: Ints
    about: About
    pole: float
    volume: float

    def missing(self, x: Array) -> float:
        """Volume that the facets leave out, by the divergence theorem; planes through the pole add nothing."""
        points, areas = patches(x, self.nodes)
        points[2] -= self.pole
        return self.volume - float(np.abs((points * areas).sum(axis=0)).sum()) / 3


def facet_nodes(mesh: MeshTet1, facets: Ints) -> Ints:
    """Nodes of quadratic facets, shape (6, n): corners, then the middles of the edges 01, 12 and 02."""
    corners = mesh.facets[:, facets].astype(np.int64)
    ends = np.sort(corners[[[0, 1], [1, 2], [0, 2]]], axis=1)
    low, high = np.sort(mesh.edges, axis=0).astype(np.int64)
    keys = low * mesh.nvertices + high
    order = np.argsort(keys)
    edge = order[np.searchsorted(keys, ends[:, 0] * mesh.nvertices + ends[:, 1], sorter=order)]
    return np.vstack([corners, mesh.nvertices + edge])


def patches(x: Array, nodes: Ints) -> tuple[Array, Array]:
    """Points of quadratic facets and their shares of area as normal vectors, both of shape (3, points, facets)."""
    element = ElementTriP2()
    at, weights = get_quadrature(element.refdom, 6)
    values, slopes = zip(*(element.lbasis(at, k) for k in range(6)), strict=True)
    points = np.einsum("ikf,kq->iqf", x[:, nodes], np.stack(values), optimize=True)
    along = np.einsum("ikf,kjq->jiqf", x[:, nodes], np.stack(slopes), optimize=True)
    return points, np.cross(along[0], along[1], axis=0) * weights[:, None]


def _around(x: Array, nodes: Ints, about: About, shape: Shape, kept: NDArray[np.bool_]) -> Array:
    """Middle nodes that are not `kept`, moved until the volume between the facets around and the surface vanishes."""
    x = x.copy()
    middles = np.unique(nodes[3:])
    middles = middles[~kept[middles]]
    for _ in range(3):
        points, areas = patches(x, nodes)
        near = about(points, shape)
        area = np.abs((areas * near.normal).sum(axis=0))
        volume = area * near.distance * (1 - near.curvature * near.distance / 2)
        out, whole = (
            np.bincount(nodes[3:].ravel(), np.tile(share.sum(axis=0), 3))[middles] for share in (volume, area)
        )
        x[:, middles] -= out / whole * about(x[:, middles], shape).normal
    return x


def _leveled(x: Array, fit: _Fit, shape: Shape, kept: NDArray[np.bool_]) -> Array:
    """Middle nodes that are not `kept`, all moved by the same, until the volume is right."""
    x = x.copy()
    middles = np.unique(fit.nodes[3:])
    middles = middles[~kept[middles]]
    for _ in range(2):
        area = np.linalg.norm(patches(x, fit.nodes)[1].sum(axis=1), axis=0)
        share = np.bincount(fit.nodes[3:].ravel(), np.tile(area, 3))[middles].sum() / 3
        x[:, middles] += fit.missing(x) / share * fit.about(x[:, middles], shape).normal
    return x


def _drawn_in(x: Array, fit: _Fit, edge: NDArray[np.bool_]) -> Array:
    """A magnet with sharp edges, those moved inwards until its volume is that with the fillets."""
    inwards = np.zeros_like(x)
    inwards[:2, edge] = -x[:2, edge] / np.hypot(*x[:2, edge])
    inwards[2, edge] = np.sign(fit.pole - x[2, edge])
    areas = np.linalg.norm(patches(x, fit.nodes)[1].sum(axis=1), axis=0)
    slope = areas[edge[fit.nodes[3:]].any(axis=0)].sum() / 3
    depth = 0.0
    for _ in range(3):
        depth -= fit.missing(x + depth * inwards) / slope
    return x + depth * inwards


def _relaxed(mesh: MeshTet1, x: Array, on: Masks) -> tuple[MeshTet2, NDArray[np.bool_]] | None:
    """The mesh with the nodes x, and which of its middle nodes had to move back because a cell was too distorted."""
    n = mesh.nvertices
    straight = MeshTet2.from_mesh(replace(mesh, doflocs=np.ascontiguousarray(x[:, :n])))
    nodes = straight.dofs.element_dofs
    bend = _spread(x - straight.doflocs, nodes[4:], on)
    share = np.ones(x.shape[1])
    for _ in range(20):
        now = straight.doflocs + share * bend
        det = determinants(now, nodes)
        bad = (det <= 0).any(axis=0) | (det[4:].min(axis=0) < LEAST_JACOBIAN * det[4:].max(axis=0))
        if not bad.any():
            made = MeshTet2(now, straight.t, _boundaries=mesh.boundaries, _subdomains=mesh.subdomains)
            return made, (share < 1) & bend.any(axis=0)
        share[nodes[4:, bad]] *= 0.75
    return None


def _spread(bend: Array, middles: Ints, on: Masks) -> Array:
    """Shifts of nodes, shape (3, n), of which those inside follow those on the surfaces.

    middles : nodes in the middle of the edges of each cell, shape (6, cells).
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
    """Jacobian determinants at the corners and quadrature points of order 4, shape (points, cells)."""
    element = ElementTetP2()
    points = np.hstack([element.refdom.p, get_quadrature(element.refdom, 4)[0]])
    slopes = np.stack([element.lbasis(points, k)[1] for k in range(10)])
    jacobian = np.einsum("ikc,kjq->qcij", x[:, nodes], slopes, optimize=True)
    return np.asarray(np.linalg.det(jacobian))


def shapes(corners: Array) -> Array:
    """`radius_ratios`, negative for cells that are turned inside out; corners of shape (3, 4, cells)."""
    a, b, c = (corners[:, k] - corners[:, 0] for k in (1, 2, 3))
    return np.asarray(np.sign((a * np.cross(b, c, axis=0)).sum(axis=0)) * radius_ratios(corners))


def radius_ratios(corners: Array) -> Array:
    """Three times the inscribed over the circumscribed radius, 0 where two corners are one.

    Parameters
    ----------
    corners : of shape (3, 4, cells).
    """
    a, b, c = (corners[:, k] - corners[:, 0] for k in (1, 2, 3))
    ab, bc, ca = (np.cross(u, v, axis=0) for u, v in ((a, b), (b, c), (c, a)))
    six = np.abs((a * bc).sum(axis=0))
    area = sum(np.linalg.norm(side, axis=0) for side in (ab, bc, ca, ab + bc + ca))
    centre = (a**2).sum(axis=0) * bc + (b**2).sum(axis=0) * ca + (c**2).sum(axis=0) * ab
    size = area * np.linalg.norm(centre, axis=0)
    return np.asarray(np.divide(6 * six**2, size, out=np.zeros_like(size), where=size > 0))
