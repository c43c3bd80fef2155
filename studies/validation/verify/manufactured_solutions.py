"""Manufactured solutions at finite strain: body forces that make a chosen displacement and pressure exact.

The displacements are compositions of shears and, for a body of revolution, of a stretch that preserves volumes.
Therefore J = 1 everywhere, and the pressure can be chosen freely, with 1/K = 0. The exact displacement is prescribed
on the whole boundary of the unit square or cube except the upper face, which carries the exact dead traction. The
body force is b = -Div P, where P is the first Piola-Kirchhoff stress of the exact fields, mu = 1:

    b_i = - sum_J dP_iJ / dX_J,   revolution: b_r = ... - (P_rr - P_tt) / r,   b_z = ... - P_zr / r.

For the Fourier elements the exact fields are Cartesian and lie in the space of two harmonics: a stretch, then a
displacement along x by g(z), then one along z by a polynomial in x and y. The elements' integrals over the angle are
exact for J = 1.

The body force is differentiated numerically (the displacement by complex steps, P by central differences) and
integrated with a separate quadrature rule, so that only the solved problem uses the elements' operators. The expected
orders of convergence in the L2 norm are 3 for the displacement (P2) and 2 for the pressure (P1).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import skfem

from fem.model import angular_fields, elements, material
from fem.model.angular_fields import Angles
from fem.model.elements import Elements
from fem.model.symmetry_models import on_axis
from geometry.arrays import Array
from studies.validation.verify.static_problems import SKIN, body, solve

ORDER, ANGLES = 6, 8
"""Quadrature order on the section, and number of angles, of the rule that integrates body forces and errors."""
TINY, STEP = 1e-30, 1e-5
"""Step of the complex differentiation, and of the central differences."""


@dataclass(frozen=True, slots=True)
class Case:
    """Exact fields at points (..., dim): displacement (..., dim), also for complex points, and pressure (...).

    With harmonics the points belong to the solid, dim = 3, and the mesh is its section.
    """

    dim: int
    axisymmetric: bool
    displacement: Callable[[Array], Array]
    pressure: Callable[[Array], Array]
    harmonics: int = 0

    @property
    def hoop(self) -> bool:
        return self.axisymmetric and self.harmonics == 0


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


def _fourier(X: Array) -> Array:
    shrink, shift = 1 / np.sqrt(1 + 0.3 * np.cos(2 * X[..., 2])), 0.2 * np.sin(3 * X[..., 2])
    x, y = X[..., 0] * shrink + shift, X[..., 1] * shrink
    z = X[..., 2] + 0.15 * np.sin(2 * X[..., 2])
    z = z + 0.1 * (1 + x) * (x**2 + y**2) + 0.08 * (x**2 - y**2)
    return np.stack([1.1 * x, y / 1.1, z], axis=-1) - X


def _fourier_pressure(X: Array) -> Array:
    x, y, z = np.moveaxis(X, -1, 0)
    r2 = x**2 + y**2
    return np.asarray(0.3 * (np.sin(r2 + 2 * z) + x * np.cos(r2 - z) + (x**2 - y**2) * np.sin(r2 + z)))


CASES = {
    "plane strain triangle": Case(2, False, _plane, lambda X: np.sin(X[..., 0] + 2 * X[..., 1])),
    "axisymmetric triangle": Case(2, True, _revolution, lambda X: np.sin(X[..., 0] ** 2 + 2 * X[..., 1])),
    "tetrahedron": Case(3, False, _solid, lambda X: np.sin(X.sum(axis=-1))),
    "Fourier triangle, N = 2": Case(3, True, _fourier, _fourier_pressure, harmonics=2),
}


def errors(n: int, name: str) -> tuple[float, float]:
    """Return the relative L2 errors of displacement and pressure with n elements along each side."""
    case = CASES[name]
    mesh = _mesh(2 if case.axisymmetric else case.dim, n).with_boundaries({"loaded": lambda x: x[-1] > 1 - SKIN})
    e = elements.build(mesh, axisymmetric=case.axisymmetric, harmonics=case.harmonics)
    exact = _nodal(case, e)
    rule = _rule(case, mesh, e)
    # prescribed are all sides but the upper face, and on the axis the fields that must vanish there
    low, high, first = e.nodes < SKIN, e.nodes[:, :-1] > 1 - SKIN, 1 if case.axisymmetric else 0
    side = np.asarray(low[:, first:].any(axis=1) | high.any(axis=1))
    fixed = np.repeat(side[:, None], e.angles.fields, axis=1)
    if case.axisymmetric:
        fixed[np.ix_(low[:, 0], ~on_axis(case.harmonics))] = True
    system = body(e, fixed, 1.0, 0.0, dead=_loads(case, mesh, e, rule), moved=exact)
    state = solve(system, exact).state
    p = np.zeros((len(e.nodes), e.angles.pressures))
    p[system.corner_nodes] = state.p
    u_exact, p_exact = case.displacement(rule.points), case.pressure(rule.points)
    u_error = np.einsum("mqf,qif->mqi", rule.quadratic @ state.u[e.cells], rule.E) - u_exact
    p_error = np.einsum("mqn,qn->mq", rule.linear @ p[e.corners], rule.C) - p_exact
    return rule.norm(u_error) / rule.norm(u_exact), rule.norm(p_error[..., None]) / rule.norm(p_exact[..., None])


def _nodal(case: Case, e: Elements) -> Array:
    """Return the fields (nodes, fields) of the exact displacement: with harmonics, its Fourier coefficients."""
    if not case.harmonics:
        return case.displacement(e.nodes)
    turned, w = _turned(e.angles), e.angles.weights
    r, z = e.nodes.T[:, :, None]
    c, s = np.cos(e.angles.theta), np.sin(e.angles.theta)
    u = case.displacement(np.stack([r * c, r * s, np.broadcast_to(z, (len(r), len(c)))], axis=-1))
    return np.asarray(np.einsum("t,tif,nti->nf", w, turned, u) / np.einsum("t,tif->f", w, turned**2))


def _turned(angles: Angles) -> Array:
    """Return the displacement along x, y, z per unit of each field at the angles of a section, (t, 3, fields)."""
    c, s = np.cos(angles.theta)[:, None], np.sin(angles.theta)[:, None]
    r, t, z = np.swapaxes(angles.E, 0, 1)
    return np.stack([c * r - s * t, s * r + c * t, z], axis=1)


class _Rule(NamedTuple):
    """Quadrature points (m, q, dim), weights (m, q), shape functions (q, a), and directions of the fields."""

    points: Array
    weights: Array
    quadratic: Array
    linear: Array
    E: Array
    C: Array

    def norm(self, values: Array) -> float:
        return float(np.sqrt(np.sum(self.weights[..., None] * values**2)))


def _mesh(dim: int, n: int) -> skfem.Mesh:
    """Return the unit square or cube with its inner vertices off the regular grid, on which errors may cancel."""
    grid = np.linspace(0, 1, n + 1)
    flat = (skfem.MeshTri if dim == 2 else skfem.MeshTet).init_tensor(*[grid] * dim)
    bump = 0.06 * np.prod(np.sin(np.pi * flat.p), axis=0) * np.cos(np.arange(1, dim + 1)[:, None] + 3 * flat.p)
    return (skfem.MeshTri2 if dim == 2 else skfem.MeshTet2).from_mesh(type(flat)(flat.p + bump, flat.t))


def _rule(case: Case, mesh: skfem.Mesh, e: Elements) -> _Rule:
    quadratic, linear = elements.bases(e.dim)
    basis = skfem.Basis(mesh, quadratic, intorder=ORDER)
    points = np.moveaxis(np.asarray(basis.global_coordinates()), 0, -1)
    weights = np.array(basis.dx)
    if case.axisymmetric:
        weights = weights * 2 * np.pi * points[..., 0]

    def shapes(b: skfem.Basis) -> Array:
        return np.stack([np.broadcast_to(np.asarray(f[0]), weights.shape)[0] for f in b.basis], axis=1)

    N, N1 = shapes(basis), shapes(basis.with_element(linear))
    if not case.harmonics:
        one = np.ones((len(N), 1))
        return _Rule(points, weights, N, N1, np.repeat(np.eye(case.dim)[None], len(N), axis=0), one)
    a = angular_fields.fourier_fields(case.harmonics, ANGLES)
    c, s = np.cos(a.theta), np.sin(a.theta)
    r, z = np.moveaxis(points, -1, 0)[..., None]
    solid = np.stack([r * c, r * s, np.broadcast_to(z, (*z.shape[:-1], ANGLES))], axis=-1)
    around = (weights[..., None] / (2 * np.pi) * a.weights).reshape(len(points), -1)
    E, C = np.tile(_turned(a), (len(N), 1, 1)), np.tile(a.C, (len(N), 1))
    N, N1 = (np.repeat(each, ANGLES, axis=0) for each in (N, N1))
    return _Rule(solid.reshape(len(points), -1, 3), around, N, N1, E, C)


def _loads(case: Case, mesh: skfem.Mesh, e: Elements, rule: _Rule) -> Array:
    """Return nodal forces (nodes, fields) of the body force and of the traction on the upper face."""
    dead = np.zeros((len(e.nodes), e.angles.fields))
    force = np.einsum("mqi,qif->mqf", rule.weights[..., None] * _body_force(case, rule.points), rule.E)
    np.add.at(dead, e.cells, np.swapaxes(rule.quadratic, 0, 1) @ force)
    count = ANGLES if case.harmonics else None
    top = elements.surface(mesh, "loaded", e, axisymmetric=case.axisymmetric, order=ORDER, angles=count)
    inside = [0, 1, 2] if case.dim == 3 else [0, 2]
    traction = top.weights[..., None] * _stress(case, top.points[..., inside])[0][..., -1]
    np.add.at(dead, top.nodes, np.swapaxes(top.shape, 0, 1) @ np.einsum("kqi,qif->kqf", traction, top.E[:, inside]))
    return dead


def _stress(case: Case, X: Array) -> tuple[Array, Array]:
    """Return P of the exact fields along the coordinates, (..., dim, dim), and its hoop component (...)."""
    inside = [0, 2] if case.dim == 2 else [0, 1, 2]
    G = np.zeros((*X.shape[:-1], 3, 3))
    for J in range(case.dim):
        # the imaginary part is the exact derivative: there is no difference of nearly equal numbers
        shifted = case.displacement(X + 1j * TINY * np.eye(case.dim)[J])
        G[..., inside, inside[J]] = np.imag(shifted) / TINY
    if case.hoop:
        G[..., 1, 1] = case.displacement(X)[..., 0] / X[..., 0]
    _, P, _ = material.evaluate(
        material.neo_hookean, np.moveaxis(G, (-2, -1), (0, 1)), 1.0, case.pressure(X), tangent=False
    )
    P = np.moveaxis(P, (0, 1), (-2, -1))
    return P[..., inside, :][..., inside], P[..., 1, 1]


def _body_force(case: Case, X: Array) -> Array:
    b = np.zeros(X.shape)
    for J in range(case.dim):
        step = STEP * np.eye(case.dim)[J]
        b -= (_stress(case, X + step)[0][..., J] - _stress(case, X - step)[0][..., J]) / (2 * STEP)
    if case.hoop:
        P, hoop = _stress(case, X)
        b[..., 0] -= (P[..., 0, 0] - hoop) / X[..., 0]
        b[..., 1] -= P[..., 1, 0] / X[..., 0]
    return b
