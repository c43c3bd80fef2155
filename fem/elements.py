"""Taylor-Hood elements (quadratic displacement, linear continuous pressure) on curved second-order meshes.

Everything is stored as arrays over elements: the operator B maps the displacements of an element's nodes to the
components of G = grad u that can differ from zero, so that the axisymmetric and the solid element share one
assembly. Axisymmetric: coordinates (r, z), components rr, rz, zr, zz and u_r / r, weights with 2 pi r.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import skfem
from numpy.typing import NDArray
from skfem.quadrature import get_quadrature

Array = NDArray[np.float64]
Index = NDArray[np.int64]

AXISYMMETRIC = np.array([0, 2, 6, 8, 4])
"""Positions of rr, rz, zr, zz, tt in a row-major 3 x 3 tensor over (r, theta, z)."""
SOLID = np.arange(9)


@dataclass(frozen=True, slots=True)
class Elements:
    """Silicone as elements.

    Attributes
    ----------
    nodes : (n, dim) coordinates of all displacement nodes, corner nodes first.
    cells : (m, a) nodes of each element, corners first; pressures live on the first dim + 1.
    components : (g,) positions of the rows of B in a row-major 3 x 3 gradient.
    B : (m, q, g, a dim) gradient operator; degree of freedom of node a in direction i is a dim + i.
    weights : (m, q) quadrature weights times the Jacobian (and 2 pi r).
    pressure_shape : (q, dim + 1).
    """

    nodes: Array
    cells: Index
    components: Index
    B: Array
    weights: Array
    pressure_shape: Array

    @property
    def dim(self) -> int:
        return int(self.nodes.shape[1])

    @property
    def corners(self) -> Index:
        return self.cells[:, : self.dim + 1]


@dataclass(frozen=True, slots=True)
class Surface:
    """Quadrature points on outer facets.

    Attributes
    ----------
    nodes : (k, f) the nodes of each facet: corners, then the middles of its edges (01 or 01, 12, 02).
    shape : (q, f) their shape functions.
    weights : (k, q) with 2 pi r where axisymmetric.
    points : (k, q, dim) reference positions.
    """

    nodes: Index
    shape: Array
    weights: Array
    points: Array


_FACET_NODES = {
    2: np.array([[1, 2, 4], [0, 2, 5], [0, 1, 3]]),
    3: np.array([[1, 2, 3, 5, 9, 8], [0, 2, 3, 6, 9, 7], [0, 1, 3, 4, 8, 7], [0, 1, 2, 4, 5, 6]]),
}
"""Local nodes of the facet opposite to each corner; edges are numbered 01, 12, 02 and 03, 13, 23."""


def bases(dim: int) -> tuple[skfem.Element, skfem.Element]:
    return (skfem.ElementTriP2(), skfem.ElementTriP1()) if dim == 2 else (skfem.ElementTetP2(), skfem.ElementTetP1())


def build(mesh: skfem.Mesh, *, axisymmetric: bool, order: int = 2) -> Elements:
    """Elements of a second-order triangle mesh (axisymmetric or plane strain) or tetrahedral mesh.

    Order 2 (3 points a triangle, 4 a tetrahedron) costs a third of order 4; on the press of the paper's sensor it is
    also a little nearer to the converged force.
    """
    dim = mesh.p.shape[0]
    quadratic, linear = bases(dim)
    basis = skfem.Basis(mesh, quadratic, intorder=order)
    pressure = basis.with_element(linear)
    grad = np.stack([np.moveaxis(np.asarray(b[0].grad), 0, -1) for b in basis.basis], axis=2)  # (m, q, a, dim)
    m, q, a, _ = grad.shape
    weights = np.array(basis.dx)
    if dim == 3:
        B = np.zeros((m, q, 9, 3 * a))
        for i in range(3):
            for j in range(3):
                B[:, :, 3 * i + j, i::3] = grad[..., j]
        components = SOLID
    else:
        B = np.zeros((m, q, 5 if axisymmetric else 4, 2 * a))
        for i in range(2):
            for j in range(2):
                B[:, :, 2 * i + j, i::2] = grad[..., j]
        components = AXISYMMETRIC if axisymmetric else AXISYMMETRIC[:4]
    if axisymmetric:
        radius = np.asarray(basis.global_coordinates())[0]
        shape = np.stack([np.broadcast_to(np.asarray(b[0]), (m, q)) for b in basis.basis], axis=2)
        B[:, :, 4, 0::2] = shape / radius[..., None]
        weights = weights * 2 * np.pi * radius
    return Elements(
        nodes=np.ascontiguousarray(basis.doflocs.T),
        cells=np.ascontiguousarray(basis.element_dofs.T).astype(np.int64),
        components=components,
        B=B,
        weights=weights,
        pressure_shape=np.stack([np.broadcast_to(np.asarray(b[0]), (m, q))[0] for b in pressure.basis], axis=1),
    )


def surface(mesh: skfem.Mesh, name: str, elements: Elements, *, axisymmetric: bool, order: int) -> Surface:
    """Quadrature points on the named boundary of a mesh."""
    dim = elements.dim
    facets = np.asarray(mesh.boundaries[name])
    cell = np.asarray(mesh.f2t)[0, facets]
    corners = np.asarray(mesh.facets)[:, facets].T
    own = elements.cells[cell]
    opposite = np.argmin((own[:, : dim + 1, None] == corners[:, None, :]).any(axis=2), axis=1)
    nodes = np.take_along_axis(own, _FACET_NODES[dim][opposite], axis=1)
    reference, w = get_quadrature(skfem.refdom.RefLine if dim == 2 else skfem.refdom.RefTri, order)
    quadratic = skfem.ElementLineP2() if dim == 2 else skfem.ElementTriP2()
    basis = [quadratic.lbasis(reference, i) for i in range(nodes.shape[1])]
    shape = np.stack([np.ravel(value) for value, _ in basis], axis=1)
    slope = np.stack([np.reshape(grad, (dim - 1, -1)).T for _, grad in basis], axis=1)  # (q, f, dim - 1)
    X = elements.nodes[nodes]
    points = shape @ X
    tangents = np.einsum("qfs,kfi->kqis", slope, X)
    normal = tangents[..., 0] if dim == 2 else np.cross(tangents[..., 0], tangents[..., 1])
    weights = np.linalg.norm(normal, axis=-1) * w
    if axisymmetric:
        weights = weights * 2 * np.pi * points[..., 0]
    return Surface(nodes=nodes, shape=shape, weights=weights, points=points)


def boundary_nodes(mesh: skfem.Mesh, name: str) -> Index:
    """All displacement nodes (corners and mid-edges) on the named boundary, numbered as in `Elements.nodes`."""
    quadratic, _ = bases(mesh.p.shape[0])
    return np.asarray(skfem.CellBasis(mesh, quadratic, intorder=1).get_dofs(name).flatten(), dtype=np.int64)


def interpolation(elements: Elements, point: Array) -> tuple[Index, Array, Array]:
    """Where a point lies: nodes (a,), shape functions (a,) and their gradients (a, dim) there.

    Edges are taken as straight, which holds away from curved boundaries.
    """
    dim = elements.dim
    X = elements.nodes[elements.corners]
    T = np.swapaxes(X[:, 1:] - X[:, :1], 1, 2)
    local = np.linalg.solve(T, (point - X[:, 0])[..., None])[..., 0]
    inside = np.minimum(local.min(axis=1), 1 - local.sum(axis=1))
    e = int(np.argmax(inside))
    quadratic, _ = bases(dim)
    slopes = np.linalg.inv(T[e])
    values, grads = np.empty(len(elements.cells[e])), np.empty((len(elements.cells[e]), dim))
    for i in range(len(values)):
        value, grad = quadratic.lbasis(local[e][:, None], i)
        values[i] = np.ravel(value)[0]
        grads[i] = slopes.T @ np.asarray([np.ravel(g)[0] for g in grad])
    return elements.cells[e], values, grads
