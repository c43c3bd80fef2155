"""The exact surfaces of beam and magnet, and the quality of a mesh against them: volumes, gaps, shapes, Jacobians.

All lengths are in the unit of the `Shape` that is passed in. Points have shape (3, ...).
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import skfem
from skfem.quadrature import get_quadrature

from geometry import cad
from geometry.arrays import Array, Ints
from geometry.design import Shape


def quality(mesh: skfem.MeshTet2, shape: Shape) -> dict[str, Any]:
    """Return the quality of a mesh that `geometry.mesh.tetrahedra` made for `shape`.

    Returns
    -------
    cells, nodes : counts; the nodes include the middle nodes of edges.
    volumes : volume of each region, in the cube of the mesh's unit.
    volume_errors : relative error of each volume against the exact body.
    base_error : relative error of the area of the base.
    gap : greatest distance of side, dome and interface from the exact surfaces, in the mesh's unit.
    least_shape, mean_shape : three times the inscribed over the circumscribed radius of straight cells; 1 is best.
    least_jacobian : ratio of the least to the greatest Jacobian determinant of a cell, at the quadrature points of
        order 4; the least ratio of all cells. 1 is a straight cell, 0 a folded one.
    """
    part = 0.5 if "symmetry" in mesh.boundaries else 1.0
    exact = {"silicone": part * cad.beam_volume(shape)}
    if "magnet" in mesh.boundaries:
        exact["magnet"] = part * cad.magnet_volume(shape)
        exact["silicone"] -= exact["magnet"]
    det = determinants(mesh)[4:]
    cells = get_quadrature(skfem.ElementTetP2().refdom, 4)[1] @ np.abs(det)
    volumes = {name: float(cells[index].sum()) for name, index in mesh.subdomains.items()}
    shapes = radius_ratios(mesh.doflocs[:, mesh.t])
    area = float(np.linalg.norm(_facets(mesh, "base")[1], axis=0).sum())
    curved = [(name, at) for name, at in (("skin", skin), ("magnet", magnet)) if name in mesh.boundaries]
    return {
        "cells": mesh.nelements,
        "nodes": mesh.doflocs.shape[1],
        "volumes": volumes,
        "volume_errors": {name: value / exact[name] - 1 for name, value in volumes.items()},
        "base_error": area / (part * math.pi * shape.R**2) - 1,
        "gap": max((float(np.abs(at(_facets(mesh, name)[0], shape)[0]).max()) for name, at in curved), default=0.0),
        "least_shape": float(shapes.min()),
        "mean_shape": float(shapes.mean()),
        "least_jacobian": float((det.min(axis=0) / det.max(axis=0)).min()),
    }


def with_exact_volumes(mesh: skfem.MeshTet2, shape: Shape) -> skfem.MeshTet2:
    """Return the mesh with the middle nodes of skin and magnet moved along the normal, by one distance for each.

    Quadratic facets through points of a curved surface miss the volume by some 1e-4 on a coarse mesh. The divergence
    theorem turns the volume of a body into an integral over facets, x . n / 3 with the origin at a pole on the axis:
    base and plane of symmetry contain it, so they add nothing. The cell behind a facet tells on which side the body
    lies: at a fillet of the magnet, a small facet of an imported mesh may face the pole.
    """
    x, part = mesh.doflocs.copy(), 0.5 if "symmetry" in mesh.boundaries else 1.0
    bodies = (("skin", skin, 0.0, cad.beam_volume(shape)), ("magnet", magnet, shape.H, cad.magnet_volume(shape)))
    for name, surface, pole, volume in bodies:
        if name not in mesh.boundaries:
            continue
        nodes = mesh.dofs.get_facet_dofs(mesh.boundaries[name]).all()
        middles, sense = nodes[nodes >= mesh.nvertices], senses(mesh, mesh.boundaries[name])
        for _ in range(2):
            points, areas = _facets(replace(mesh, doflocs=x), name)
            points[2] -= pole
            # the facets of a hole face the pole, all of them
            missing = part * volume - abs(float(((points * areas).sum(axis=(0, 1)) * sense).sum())) / 3
            # the shape functions of a facet's three middle nodes add up to its area
            distance = missing / np.linalg.norm(areas, axis=0).sum()
            x[:, middles] += distance * surface(x[:, middles], shape)[1]
    return replace(mesh, doflocs=x)


def senses(mesh: skfem.MeshTet1, facets: Ints) -> Array:
    """Return 1 for facets whose corners a, b, c turn (b - a) x (c - a) outward, -1 for others, shape (n,).

    The facets of the magnet's surface are seen from the magnet, or from the silicone if the magnet is a hole.
    """
    inner = np.isin(mesh.f2t[0, facets], mesh.subdomains.get("magnet", facets[:0]))
    cell = np.where(inner | (mesh.f2t[1, facets] < 0), mesh.f2t[0, facets], mesh.f2t[1, facets])
    a, b, c = np.moveaxis(mesh.p[:, mesh.facets[:, facets]], 1, 0)
    centre = mesh.p[:, mesh.t[:, cell]].mean(axis=1)
    return np.asarray(np.sign((np.cross(b - a, c - a, axis=0) * (a - centre)).sum(axis=0)))


def _facets(mesh: skfem.MeshTet2, name: str) -> tuple[Array, Array]:
    """Return quadrature points on the quadratic facets of a boundary and their area vectors, both (3, q, n)."""
    # skfem.FacetBasis would find the points in the cells by Newton's method, which does not end in tiny cells
    facets, element = mesh.boundaries[name], skfem.ElementTriP2()
    nodes = mesh.doflocs[:, np.vstack([mesh.facets[:, facets], mesh.nvertices + mesh.f2e[:, facets]])]
    at, weights = get_quadrature(element.refdom, 6)
    values, slopes = zip(*(element.lbasis(at, k) for k in range(6)), strict=True)
    along = np.einsum("ikf,kjq->jiqf", nodes, np.stack(slopes))
    areas = np.cross(along[0], along[1], axis=0) * weights[:, None]
    return np.einsum("ikf,kq->iqf", nodes, np.stack(values)), areas


def determinants(mesh: skfem.MeshTet2) -> Array:
    """Return the Jacobian determinants at corners and quadrature points of order 4, shape (points, cells)."""
    reference = skfem.ElementTetP2().refdom
    points = np.hstack([reference.p, get_quadrature(reference, 4)[0]])
    return np.asarray(mesh.mapping().detDF(points)).T


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


def skin(x: Array, shape: Shape) -> tuple[Array, Array]:
    """Return signed distances of points from side and dome of the beam, positive outside, and outward normals."""
    arm = np.stack([x[0], x[1], np.maximum(x[2] - shape.H, 0)])
    length = np.linalg.norm(arm, axis=0)
    return length - shape.R, arm / np.where(length > 0, length, 1.0)  # points on the axis have no normal


def magnet(x: Array, shape: Shape) -> tuple[Array, Array]:
    """Return signed distances of points from the magnet with its rounded edges, and outward normals."""
    # a point is closer by rho to the rounded cylinder than to a sharp cylinder that is smaller by rho on all sides
    rho = shape.magnet_edge_radius
    r, up = np.hypot(x[0], x[1]), x[2] - shape.H
    dr, dz = r - (shape.magnet_diameter / 2 - rho), np.abs(up) - (shape.magnet_height / 2 - rho)
    out = np.hypot(np.maximum(dr, 0), np.maximum(dz, 0))
    divisor = np.where(out > 0, out, 1.0)
    normal_r = np.where(out > 0, np.maximum(dr, 0) / divisor, dr > dz)
    normal_z = np.where(out > 0, np.maximum(dz, 0) / divisor, dr <= dz) * np.where(up < 0, -1, 1)
    across = normal_r / np.where(r > 0, r, 1.0)
    return out + np.minimum(np.maximum(dr, dz), 0) - rho, np.stack([x[0] * across, x[1] * across, normal_z])
