"""Published and closed-form problems as functions of a mesh size: what `verify` and the tests solve.

Each takes the number n of elements along a side (or what it says) and returns the quantities that are published.
Stresses are in units of the shear or Young's modulus where nothing else is said, lengths in units of the body.
Where displacements are prescribed, Newton's method starts from those of the closed form, if there is one, and has to
find the pressures and that the forces balance.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence

import numpy as np
import skfem
from numpy.typing import NDArray

from fem import material
from fem.discretisation import elements
from fem.discretisation.elements import Elements
from fem.discretisation.nonlinear_system import System
from fem.material import lame
from fem.solvers.direct_solver import Solver
from fem.solvers.newton import STOPPED, Equilibrium, newton
from geometry.arrays import Array

Mask = NDArray[np.bool_]

SKIN = 1e-9
"""Nodes nearer than this to a face lie on it."""


class NotSolvedError(ArithmeticError):
    """Newton's method gave up on a problem."""


def body(
    e: Elements, fixed: Mask, mu: float, inverse_K: float, *, dead: Array | None = None, moved: Array | None = None
) -> System:
    """A system without magnet and plate; `moved` are the prescribed displacements."""
    return System(e, None, mu, inverse_K, fixed, dead=dead, prescribed=moved)


def find(system: System, u: Array | None = None, q: Array | None = None) -> Equilibrium:
    """Newton's answer from nodal displacements u (nodes, dim) without pressure, or from unknowns q.

    Raises
    ------
    NotSolvedError
        It does not converge.
    """
    start = np.zeros(system.size) if q is None else q
    if u is not None:
        start[: system.n_free] = u[system.free]
    solver = Solver()
    try:
        answer = newton(system, solver, start, None)
    finally:
        solver.close()
    if not answer.converged:
        raise NotSolvedError(STOPPED[answer.reason])
    return answer


def ramp(system: System, dead: Array, levels: Sequence[float]) -> list[Equilibrium]:
    """Equilibria under dead loads (nodes, dim) times each level in turn, each guessed from the last two."""
    answers: list[Equilibrium] = []
    before, last, now = 0.0, np.zeros(system.size), np.zeros(system.size)
    reached = 0.0
    for level in levels:
        system.dead = level * dead
        guess = now + (now - last) * ((level - reached) / (reached - before) if answers else 0.0)
        if system.admissible(guess) is None:
            guess = now
        answers.append(find(system, q=guess))
        before, reached, last, now = reached, level, now, answers[-1].state.q
    return answers


def facet_loads(mesh: skfem.Mesh, e: Elements, name: str, traction: Sequence[float]) -> Array:
    """Nodal forces (nodes, fields) of a uniform dead traction (3,) along x, y, z on a named boundary.

    A section without harmonics is taken for one in plane strain.
    """
    s = elements.surface(mesh, name, e, axisymmetric=e.angles.harmonics > 0, order=4)
    dead = np.zeros((len(e.nodes), e.angles.fields))
    np.add.at(dead, s.nodes, np.einsum("kq,qa,qif,i->kaf", s.weights, s.shape, s.E, traction))
    return dead


def square(n: int, move: Callable[[Array], Array] | None = None) -> skfem.MeshTri2:
    """The unit square in 2 n^2 triangles, its corners moved by a map of coordinates (2, nodes)."""
    grid = np.linspace(0, 1, n + 1)
    flat = skfem.MeshTri.init_tensor(grid, grid)
    return skfem.MeshTri2.from_mesh(flat if move is None else skfem.MeshTri(move(flat.p), flat.t))


def cook(n: int) -> tuple[float]:
    """Tip deflection u_y(48, 60), mm, of Cook's membrane, plane strain.

    E = 3 MPa, incompressible, dead traction of 0.05 MPa upwards on the right edge; n x n squares cut in two.
    """
    mesh = square(n, lambda x: np.stack([48 * x[0], 44 * x[0] + x[1] * (44 - 28 * x[0])]))
    mesh = mesh.with_boundaries({"right": lambda x: x[0] > 48 - SKIN})
    e = elements.build(mesh, axisymmetric=False)
    fixed = np.repeat((e.nodes[:, 0] < SKIN)[:, None], 2, axis=1)
    system = body(e, fixed, *lame(3.0, 0.5))
    last = ramp(system, facet_loads(mesh, e, "right", (0, 0, 0.05)), [0.5, 1.0])[-1]
    corner = np.argmin(np.hypot(e.nodes[:, 0] - 48, e.nodes[:, 1] - 60))
    return (float(last.state.u[corner, 1]),)


def bonded_cylinder(n: int, S: float) -> tuple[float]:
    """Apparent modulus E_a / E of an incompressible disc, radius R, height 2 h, glued to two plates, S = R / 2h.

    Small strain (1e-6) on the upper half's section; n x n rectangles that shrink towards plate and rim, cut in two.
    """
    h, press = 1 / (4 * S), 1e-6
    mesh = square(n, lambda x: np.stack([1 - (1 - x[0]) ** 1.6, h * (1 - (1 - x[1]) ** 1.6)]))
    e = elements.build(mesh, axisymmetric=True)
    top = e.nodes[:, 1] > h - SKIN
    fixed = np.stack([(e.nodes[:, 0] < SKIN) | top, (e.nodes[:, 1] < SKIN) | top], axis=1)
    moved = np.zeros(e.nodes.shape)
    moved[top, 1] = -press * h
    answer = find(body(e, fixed, *lame(1.0, 0.5), moved=moved))
    return (float(-answer.assembly.forces[top, 1].sum()) / math.pi / press,)


@functools.cache
def reese_block(
    n: int, levels: tuple[int, ...], *, mirrored: bool = False, order: int | None = None, own_energy: bool = False
) -> tuple[float, ...]:
    """Compression, %, of a block's corner under dead pressures p/p0 (p0 = 4 MPa) on the inner quarter of its top.

    Quarter of the block as n^3 bricks of six tetrahedra, n a multiple of 4, with three quarters of the bricks along
    an edge under the load; mu = 80.194, lambda = 400889.806 MPa. The top does not move sideways, so a pressure that
    follows the surface does the same.

    Parameters
    ----------
    levels : pressures p/p0, multiples of 20.
    mirrored : cut the bricks along the diagonal that falls from the middle of the block, not the one that rises.
    order : of the elements' quadrature.
    own_energy : Reese's energy, mu/2 (I1 - 3 - 2 ln J) with lambda/2 (J - 1)^2, not the isochoric law.
    """
    mu, lam = 80.194, 400889.806
    inner = 3 * n // 4
    side = np.append(np.linspace(0, 0.5, inner + 1), np.linspace(0.5, 1, n - inner + 1)[1:])
    flat = skfem.MeshTet.init_tensor(side, side, np.linspace(0, 1, n + 1))
    if mirrored:
        flat = skfem.MeshTet(np.stack([flat.p[0], flat.p[1], 1 - flat.p[2]]), flat.t[[1, 0, 2, 3]])
    mesh = skfem.MeshTet2.from_mesh(flat).with_boundaries(
        {"pressed": lambda x: (x[2] > 1 - SKIN) & (x[0] < 0.5) & (x[1] < 0.5)}
    )
    e = elements.build(mesh, axisymmetric=False, order=order)
    fixed = e.nodes < SKIN
    fixed[e.nodes[:, 2] > 1 - SKIN, :2] = True
    law, bulk = (_coupled, lam) if own_energy else (material.neo_hookean, lam + 2 / 3 * mu)
    system = System(e, None, mu, 1 / bulk, fixed, law=law)
    steps = [float(level) for level in range(20, max(levels) + 1, 20)]
    answers = dict(zip(steps, ramp(system, facet_loads(mesh, e, "pressed", (0, 0, -4.0)), steps), strict=True))
    corner = np.argmin(np.linalg.norm(e.nodes - [0, 0, 1], axis=1))
    return tuple(float(-100 * answers[level].state.u[corner, 2]) for level in levels)


def _coupled(k: material.Kinematics, mu: Array | float, p: Array | float = 0.0) -> tuple[Array, Array, Array]:
    """W = mu/2 (I1 - 3 - 2 ln J): P = mu (F - F^-T), dP_iJ/dF_kL = mu (delta_ik delta_JL + H_iL H_kJ), H = F^-T.

    The energy p (J - 1) is added.
    """
    W = mu / 2 * (2 * np.einsum("ii...->...", k.G) + np.sum(k.G**2, axis=(0, 1)) - 2 * np.log1p(k.Jm1))
    P, A = material.pressure_terms(k, p)
    P = P + mu * (k.G - k.Hm1)
    if k.tangent:
        A = A + mu * np.einsum("iL...,kJ...->iJkL...", k.H, k.H).reshape(A.shape)
        np.einsum("ii...->i...", A)[...] += mu
    return W + p * k.Jm1, P, A


def thick_sphere(n: int, stretches: Sequence[float]) -> tuple[float, ...]:
    """Pressure p / mu that widens the hole of a sphere, radii 1 and 2, incompressible, by each stretch.

    Quarter section, n elements through the wall and 2 n around, on curved edges. The hole's nodes are moved
    radially; the pressure is the radial sum of their reactions over half the hole's area.
    """

    def polar(x: Array) -> Array:
        radius, angle = 1 + x[0], np.pi / 2 * x[1]
        return np.stack([radius * np.sin(angle), radius * np.cos(angle)])

    grid, around = np.linspace(0, 1, n + 1), np.linspace(0, 1, 2 * n + 1)
    mesh = skfem.MeshTri2.from_mesh(skfem.MeshTri.init_tensor(grid, around))
    e = elements.build(skfem.MeshTri2(polar(mesh.doflocs), mesh.t), axisymmetric=True)
    R = np.linalg.norm(e.nodes, axis=1)
    hole = R < 1 + SKIN
    fixed = (e.nodes < SKIN) | hole[:, None]
    pressures = []
    for stretch in stretches:
        exact = e.nodes * (np.cbrt(1 + (stretch**3 - 1) / R**3) - 1)[:, None]
        answer = find(body(e, fixed, *lame(3.0, 0.5), moved=exact), exact)
        radial = float(np.sum(answer.assembly.forces[hole] * e.nodes[hole]))
        pressures.append(radial / (2 * math.pi * stretch**2))
    return tuple(pressures)


def sphere_pressure(stretch: float) -> float:
    """Closed form of `thick_sphere`: Bower, solidmechanics.org, section 4.2.

    >>> [round(sphere_pressure(stretch), 7) for stretch in (1.25, 2.0)]
    [0.5518685, 0.8069266]
    """
    outer = np.cbrt(1 + (stretch**3 - 1) / 8)
    return float((4 / outer + outer**-4 - 4 / stretch - stretch**-4) / 2)


def stretched_cube(stretch: float, mode: str) -> tuple[float]:
    """Nominal stress P_xx / mu of an incompressible unit cube, its three mirror planes and five tetrahedra.

    Stretched along x; along y it is free (uniaxial), stretched alike (equibiaxial) or held (planar); z is free.
    """
    mesh = skfem.MeshTet2.from_mesh(skfem.MeshTet.init_tensor(*[np.linspace(0, 1, 2)] * 3))
    e = elements.build(mesh, axisymmetric=False)
    along = {"uniaxial": stretch**-0.5, "equibiaxial": stretch, "planar": 1.0}[mode]
    exact = e.nodes * (np.array([stretch, along, 1 / (stretch * along)]) - 1)
    end = e.nodes > 1 - SKIN
    fixed = (e.nodes < SKIN) | (end & [True, mode != "uniaxial", False])
    answer = find(body(e, fixed, *lame(3.0, 0.5), moved=exact), exact)
    return (float(answer.assembly.forces[end[:, 0], 0].sum()),)


def stretched_cylinder(stretch: float) -> tuple[float]:
    """Nominal stress P_zz / mu of an incompressible cylinder pulled along its axis, two triangles."""
    e = elements.build(square(1), axisymmetric=True)
    exact = e.nodes * (np.array([stretch**-0.5, stretch]) - 1)
    end = e.nodes[:, 1] > 1 - SKIN
    fixed = e.nodes < SKIN
    fixed[end, 1] = True
    answer = find(body(e, fixed, *lame(3.0, 0.5), moved=exact), exact)
    return (float(answer.assembly.forces[end, 1].sum()) / math.pi,)


def turned_cylinder(stretch: float, angle: float, harmonics: int = 2) -> tuple[float, float]:
    """Energy per volume over mu of a cylinder stretched along x and turned about y, and its largest nodal force.

    Fourier elements without pressure; volumes are kept. The affine map A = Q U has the fields w_-1 = A_xz z,
    w_0 = ((A_xx + A_yy) / 2 - 1) r, w_-2 = (A_xx - A_yy) r / 2, z_0 = (A_zz - 1) z, z_1 = A_zx r.
    """
    e = elements.build(square(2), axisymmetric=True, harmonics=harmonics)
    c, s = math.cos(angle), math.sin(angle)
    A = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ np.diag([stretch, stretch**-0.5, stretch**-0.5])
    k, (r, z) = list(elements.orders(harmonics)), e.nodes.T
    u = np.zeros((len(r), e.angles.fields))
    u[:, k.index(-1)], u[:, k.index(0)] = A[0, 2] * z, ((A[0, 0] + A[1, 1]) / 2 - 1) * r
    u[:, k.index(-2)], u[:, len(k)], u[:, len(k) + 1] = (A[0, 0] - A[1, 1]) / 2 * r, (A[2, 2] - 1) * z, A[2, 0] * r
    system = body(e, np.zeros(u.shape, dtype=bool), 1.0, 0.0)
    q = np.zeros(system.size)
    q[: system.n_free] = u[system.free]
    found = system.assemble(system.state(q), None)
    return found.energy / math.pi, float(np.abs(found.forces).max())


def sheared_cube(shear: float) -> tuple[float, float]:
    """Stresses sigma_xz and sigma_xx - sigma_zz over mu of a unit cube whose faces follow u_x = shear z.

    Mean stresses from the nodal forces, V sigma_ij = sum f_i x_j; 1/K is small, so that p is determined.
    """
    mesh = skfem.MeshTet2.from_mesh(skfem.MeshTet.init_tensor(*[np.linspace(0, 1, 3)] * 3))
    e = elements.build(mesh, axisymmetric=False)
    exact = np.zeros(e.nodes.shape)
    exact[:, 0] = shear * e.nodes[:, 2]
    sides = np.asarray(((e.nodes < SKIN) | (e.nodes > 1 - SKIN)).any(axis=1))
    fixed = np.repeat(sides[:, None], 3, axis=1)
    answer = find(body(e, fixed, 1.0, 1e-3, moved=exact), exact)
    sigma = answer.assembly.forces.T @ (e.nodes + answer.state.u)
    return float(sigma[0, 2]), float(sigma[0, 0] - sigma[2, 2])
