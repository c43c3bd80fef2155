"""Manufactured solutions at finite strain: body forces that make a chosen displacement and pressure exact.

The displacements are compositions of shears (and, for a body of revolution, of a stretch that keeps volumes), so
J = 1 everywhere and the pressure can be chosen freely, with 1/K = 0. The unit square or cube has the exact
displacement prescribed on its whole boundary but the upper face, which carries the exact dead traction. The body
force is b = -Div P, where P is the first Piola-Kirchhoff stress of the exact fields, mu = 1:

    b_i = - sum_J dP_iJ / dX_J,   revolution: b_r = ... - (P_rr - P_tt) / r,   b_z = ... - P_zr / r.

It is differentiated numerically (the displacement by complex steps, P by central differences) and integrated with a
rule of its own, so that only the solved problem uses the elements' operators. Expected orders in the L2 norm: 3 of
the displacement (P2), 2 of the pressure (P1).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import skfem
from numpy.typing import NDArray

from fem import elements, material
from fem.elements import Elements
from studies.problems import SKIN, body, find

Array = NDArray[np.float64]

ORDER = 6
"""Of the rule that integrates body forces and errors."""
TINY, STEP = 1e-30, 1e-5
"""Steps of the complex and of the central differences."""


@dataclass(frozen=True, slots=True)
class Case:
    """Exact fields: displacement (..., dim) of points (..., dim), for complex points too, and pressure (...)."""

    dim: int
    axisymmetric: bool
    displacement: Callable[[Array], Array]
    pressure: Callable[[Array], Array]


def _plane(X: Array) -> Array:
    x = X[..., 0] + 0.2 * np.sin(2 * X[..., 1])
    y = X[..., 1] + 0.15 * np.sin(2 * x)
    return np.stack([x, y], axis=-1) - X


def _revolution(X: Array) -> Array:
    r = X[..., 0] / np.sqrt(1 + 0.3 * np.cos(2 * X[..., 1]))
    z = X[..., 1] + 0.15 * np.sin(2 * X[..., 1]) + 0.2 * np.sin(r**2)
    return np.stack([r, z], axis=-1) - X


def _solid(X: Array) -> Array:
    x = X[..., 0] + 0.2 * np.sin(X[..., 1] + X[..., 2])
    y = X[..., 1] + 0.15 * np.sin(2 * x - X[..., 2])
    z = X[..., 2] + 0.15 * np.cos(x + 2 * y)
    return np.stack([x, y, z], axis=-1) - X


CASES = {
    "plane strain triangle": Case(2, False, _plane, lambda X: np.sin(X[..., 0] + 2 * X[..., 1])),
    "axisymmetric triangle": Case(2, True, _revolution, lambda X: np.sin(X[..., 0] ** 2 + 2 * X[..., 1])),
    "tetrahedron": Case(3, False, _solid, lambda X: np.sin(X.sum(axis=-1))),
}


def errors(name: str, n: int) -> tuple[float, float]:
    """Errors of displacement and pressure over their own size, in the L2 norm, on n elements along each side.

    Raises
    ------
    NotSolvedError
        Newton's method does not converge from the exact displacement.
    """
    case = CASES[name]
    mesh = _mesh(case.dim, n).with_boundaries({"loaded": lambda x: x[-1] > 1 - SKIN})
    e = elements.build(mesh, axisymmetric=case.axisymmetric)
    exact = case.displacement(e.nodes)
    rule = _rule(case, mesh, e)
    dead = _loads(case, mesh, e, rule)
    side = np.asarray((e.nodes[:, :-1] > 1 - SKIN).any(axis=1) | (e.nodes < SKIN).any(axis=1))
    fixed = np.repeat(side[:, None], case.dim, axis=1)
    if case.axisymmetric:
        fixed[(e.nodes[:, 0] < SKIN) & (e.nodes[:, 1] > SKIN), 1] = False
    system = body(e, fixed, 1.0, 0.0, dead=dead, moved=exact)
    state = find(system, exact).state
    p = np.zeros(len(e.nodes))
    p[system.corner_nodes] = state.p[:, 0]
    u_exact, p_exact = case.displacement(rule.points), case.pressure(rule.points)
    u_error = rule.quadratic @ state.u[e.cells] - u_exact
    p_error = (rule.linear @ p[e.corners][..., None])[..., 0] - p_exact
    return rule.norm(u_error) / rule.norm(u_exact), rule.norm(p_error[..., None]) / rule.norm(p_exact[..., None])


@dataclass(frozen=True, slots=True)
class _Rule:
    """Integration points (m, q, dim) with weights (m, q), and shape functions (q, a) there."""

    points: Array
    weights: Array
    quadratic: Array
    linear: Array

    def norm(self, values: Array) -> float:
        return float(np.sqrt(np.sum(self.weights[..., None] * values**2)))


def _mesh(dim: int, n: int) -> skfem.Mesh:
    """Unit square or cube whose inner vertices have left the regular grid."""
    grid = np.linspace(0, 1, n + 1)
    flat = (skfem.MeshTri if dim == 2 else skfem.MeshTet).init_tensor(*[grid] * dim)
    bump = 0.06 * np.prod(np.sin(np.pi * flat.p), axis=0) * np.cos(np.arange(1, dim + 1)[:, None] + 3 * flat.p)
    return (skfem.MeshTri2 if dim == 2 else skfem.MeshTet2).from_mesh(type(flat)(flat.p + bump, flat.t))


def _rule(case: Case, mesh: skfem.Mesh, e: Elements) -> _Rule:
    quadratic, linear = elements.bases(case.dim)
    basis = skfem.Basis(mesh, quadratic, intorder=ORDER)
    points = np.moveaxis(np.asarray(basis.global_coordinates()), 0, -1)
    weights = np.array(basis.dx)
    if case.axisymmetric:
        weights = weights * 2 * np.pi * points[..., 0]

    def shapes(b: skfem.Basis) -> Array:
        return np.stack([np.broadcast_to(np.asarray(f[0]), weights.shape)[0] for f in b.basis], axis=1)

    return _Rule(points, weights, shapes(basis), shapes(basis.with_element(linear)))


def _loads(case: Case, mesh: skfem.Mesh, e: Elements, rule: _Rule) -> Array:
    """Nodal forces (nodes, dim) of the body force and of the traction on the upper face."""
    dead = np.zeros(e.nodes.shape)
    force = rule.weights[..., None] * _body_force(case, rule.points)
    np.add.at(dead, e.cells, np.swapaxes(rule.quadratic, 0, 1) @ force)
    top = elements.surface(mesh, "loaded", e, axisymmetric=case.axisymmetric, order=ORDER)
    place = top.points if case.dim == 3 else top.points[..., [0, 2]]
    traction = top.weights[..., None] * _stress(case, place)[0][..., -1]
    np.add.at(dead, top.nodes, np.swapaxes(top.shape, 0, 1) @ traction)
    return dead


def _stress(case: Case, X: Array) -> tuple[Array, Array]:
    """P of the exact fields in the coordinates' own directions, (..., dim, dim), and its hoop component (...)."""
    inside = [0, 2] if case.dim == 2 else [0, 1, 2]
    G = np.zeros((*X.shape[:-1], 3, 3))
    for J in range(case.dim):
        moved = case.displacement(X + 1j * TINY * np.eye(case.dim)[J])
        G[..., inside, inside[J]] = np.imag(moved) / TINY
    if case.axisymmetric:
        G[..., 1, 1] = case.displacement(X)[..., 0] / X[..., 0]
    k = material.kinematics(G)
    P = material.neo_hookean(k, 1.0)[1] + material.pressure_terms(k, case.pressure(X))[0]
    return P[..., inside, :][..., inside], P[..., 1, 1]


def _body_force(case: Case, X: Array) -> Array:
    """-Div P of the exact fields, shape (..., dim)."""
    b = np.zeros(X.shape)
    for J in range(case.dim):
        step = STEP * np.eye(case.dim)[J]
        b -= (_stress(case, X + step)[0][..., J] - _stress(case, X - step)[0][..., J]) / (2 * STEP)
    if case.axisymmetric:
        P, hoop = _stress(case, X)
        b[..., 0] -= (P[..., 0, 0] - hoop) / X[..., 0]
        b[..., 1] -= P[..., 1, 0] / X[..., 0]
    return b
