"""Published and closed-form problems as functions of a mesh size, which `verify` and the tests solve.

Each function takes the number n of elements along a side (unless its docstring says otherwise) and returns the
published quantities. Stresses are in units of the shear or Young's modulus and lengths in units of the body, unless
stated otherwise. If displacements are prescribed and a closed form exists, Newton's method starts from that
displacement field and solves for the pressures and for balance of forces.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence

import numpy as np
import skfem
from numpy.typing import NDArray

from fem.model import angular_fields, elements, material
from fem.model.elements import Elements
from fem.model.material import lame
from fem.model.nonlinear_system import System
from fem.solve.direct_solver import Solver
from fem.solve.newton import STOPPED, Equilibrium, newton
from geometry.arrays import Array
from geometry.bad_input import SolveFailed

Mask = NDArray[np.bool_]

SKIN = 1e-9
"""Nodes nearer than this to a face lie on it."""


class NotSolvedError(SolveFailed):
    """Newton's method did not converge on a problem."""


def body(
    e: Elements, fixed: Mask, mu: float, inverse_K: float, *, dead: Array | None = None, moved: Array | None = None
) -> System:
    """Return a system without magnet and plate.

    Parameters
    ----------
    fixed : degrees of freedom with prescribed displacement, shape (nodes, fields).
    mu, inverse_K : shear modulus, and inverse of the bulk modulus.
    dead : nodal dead loads, shape (nodes, fields).
    moved : prescribed displacements, shape (nodes, fields).
    """
    return System(e, None, mu, inverse_K, fixed, dead=dead, prescribed=moved)


def solve(system: System, u: Array | None = None, q: Array | None = None) -> Equilibrium:
    """Solve by Newton's method from nodal displacements u (nodes, dim) without pressure, or from unknowns q.

    Raises
    ------
    NotSolvedError
        Newton's method does not converge.
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
    """Solve under dead loads (nodes, dim) times each level in turn; start from the extrapolated last two states."""
    answers: list[Equilibrium] = []
    before, last, now = 0.0, np.zeros(system.size), np.zeros(system.size)
    reached = 0.0
    for level in levels:
        system.dead = level * dead
        guess = now + (now - last) * ((level - reached) / (reached - before) if answers else 0.0)
        # an extrapolation may invert elements (J <= 0); the last state does not
        if system.admissible(guess) is None:
            guess = now
        answers.append(solve(system, q=guess))
        before, reached, last, now = reached, level, now, answers[-1].state.q
    return answers


def facet_loads(mesh: skfem.Mesh, e: Elements, name: str, traction: Sequence[float]) -> Array:
    """Return nodal forces (nodes, fields) of a uniform dead traction (3,) along x, y, z on a named boundary.

    A section without harmonics is treated as plane strain.
    """
    s = elements.surface(mesh, name, e, axisymmetric=e.angles.harmonics > 0, order=4)
    dead = np.zeros((len(e.nodes), e.angles.fields))
    np.add.at(dead, s.nodes, np.einsum("kq,qa,qif,i->kaf", s.weights, s.shape, s.E, traction))
    return dead


def square(n: int, move: Callable[[Array], Array] | None = None) -> skfem.MeshTri2:
    """Return the unit square in 2 n^2 triangles; `move` maps the coordinates (2, nodes) of its vertices."""
    grid = np.linspace(0, 1, n + 1)
    flat = skfem.MeshTri.init_tensor(grid, grid)
    return skfem.MeshTri2.from_mesh(flat if move is None else skfem.MeshTri(move(flat.p), flat.t))


def cook(n: int) -> tuple[float]:
    """Return the tip deflection u_y(48, 60), mm, of Cook's membrane in plane strain.

    E = 3 MPa, incompressible, dead traction of 0.05 MPa upwards on the right edge; n x n quadrilaterals, each cut in
    two triangles.
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
    """Return the apparent modulus E_a / E of an incompressible disc bonded to two plates.

    The disc has radius R = 1, height 2 h and shape factor S = R / (4 h). The strain is small (1e-6). The section of
    the upper half has n x n rectangles, cut in two, which become smaller towards plate and rim.
    """
    h, press = 1 / (4 * S), 1e-6
    mesh = square(n, lambda x: np.stack([1 - (1 - x[0]) ** 1.6, h * (1 - (1 - x[1]) ** 1.6)]))
    e = elements.build(mesh, axisymmetric=True)
    top = e.nodes[:, 1] > h - SKIN
    fixed = np.stack([(e.nodes[:, 0] < SKIN) | top, (e.nodes[:, 1] < SKIN) | top], axis=1)
    moved = np.zeros(e.nodes.shape)
    moved[top, 1] = -press * h
    answer = solve(body(e, fixed, *lame(1.0, 0.5), moved=moved))
    return (float(-answer.assembly.forces[top, 1].sum()) / math.pi / press,)


@functools.cache
def reese_block(
    n: int, levels: tuple[int, ...], *, mirrored: bool = False, order: int | None = None, own_energy: bool = False
) -> tuple[float, ...]:
    """Return the compression, %, at a block's centre under dead pressures p/p0 (p0 = 4 MPa) on the middle of its top.

    By symmetry a quarter of the block is solved, as n^3 bricks of six tetrahedra each, n a multiple of 4; the load
    covers three quarters of the bricks along an edge. mu = 80.194, lambda = 400889.806 MPa. The top does not move
    sideways, so that a dead load and a pressure that follows the surface are the same.

    Parameters
    ----------
    levels : pressures p/p0, multiples of 20.
    mirrored : cut the bricks along the diagonals that fall from the middle of the block instead of those that rise.
    order : order of the elements' quadrature; default: that of `fem`.
    own_energy : use Reese's energy, mu/2 (I1 - 3 - 2 ln J) + lambda/2 (J - 1)^2, instead of the isochoric law.
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


def _coupled(
    G: Array, Jm1: Array, Hm1: Array, mu: Array, p: Array, W: Array, P: Array, A: Array, /, *,
    step: int = 1,
) -> None:  # fmt: skip
    """Write energy W, stress P and tangent A of Reese's law, with the energy p (J - 1) added: a
    `fem.model.material.Law`.

    W = mu/2 (I1 - 3 - 2 ln J): P = mu (F - F^-T), dP_iJ/dF_kL = mu (delta_ik delta_JL + H_iL H_kJ), H = F^-T.
    """
    W[:] = mu / 2 * (2 * G[::4].sum(axis=0) + np.square(G).sum(axis=0) - 2 * np.log1p(Jm1))
    P[:] = mu * (G - Hm1)
    if A.shape[2]:
        H = Hm1.reshape(3, 3, -1) + np.eye(3)[..., None]
        A[:] = mu * (np.eye(9)[..., None] + np.einsum("iLn,kJn->iJkLn", H, H).reshape(A.shape))
    material.add_pressure(Jm1, Hm1, p, W, P, A, step)


def thick_sphere(n: int, stretches: Sequence[float]) -> tuple[float, ...]:
    """Return the pressure p / mu that expands the hole of an incompressible sphere, radii 1 and 2, by each stretch.

    The quarter section has n elements through the wall and 2 n around, on curved edges. The nodes of the hole are
    displaced radially; the pressure is the radial sum of their reactions over half the area of the hole.
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
        answer = solve(body(e, fixed, *lame(3.0, 0.5), moved=exact), exact)
        radial = float(np.sum(answer.assembly.forces[hole] * e.nodes[hole]))
        pressures.append(radial / (2 * math.pi * stretch**2))
    return tuple(pressures)


def sphere_pressure(stretch: float) -> float:
    """Return the closed form of `thick_sphere`: Bower, solidmechanics.org, section 4.2.

    >>> [round(sphere_pressure(stretch), 7) for stretch in (1.25, 2.0)]
    [0.5518685, 0.8069266]
    """
    outer = np.cbrt(1 + (stretch**3 - 1) / 8)
    return float((4 / outer + outer**-4 - 4 / stretch - stretch**-4) / 2)


def stretched_cube(stretch: float, mode: str) -> tuple[float]:
    """Return the nominal stress P_xx / mu of an incompressible unit cube of tetrahedra with three symmetry planes.

    The cube is stretched along x and free along z. Along y it is free (uniaxial), stretched as along x (equibiaxial)
    or held (planar).
    """
    mesh = skfem.MeshTet2.from_mesh(skfem.MeshTet.init_tensor(*[np.linspace(0, 1, 2)] * 3))
    e = elements.build(mesh, axisymmetric=False)
    along = {"uniaxial": stretch**-0.5, "equibiaxial": stretch, "planar": 1.0}[mode]
    exact = e.nodes * (np.array([stretch, along, 1 / (stretch * along)]) - 1)
    end = e.nodes > 1 - SKIN
    fixed = (e.nodes < SKIN) | (end & [True, mode != "uniaxial", False])
    answer = solve(body(e, fixed, *lame(3.0, 0.5), moved=exact), exact)
    return (float(answer.assembly.forces[end[:, 0], 0].sum()),)


def stretched_cylinder(stretch: float) -> tuple[float]:
    """Return the nominal stress P_zz / mu of an incompressible cylinder, two triangles, stretched along its axis."""
    e = elements.build(square(1), axisymmetric=True)
    exact = e.nodes * (np.array([stretch**-0.5, stretch]) - 1)
    end = e.nodes[:, 1] > 1 - SKIN
    fixed = e.nodes < SKIN
    fixed[end, 1] = True
    answer = solve(body(e, fixed, *lame(3.0, 0.5), moved=exact), exact)
    return (float(answer.assembly.forces[end, 1].sum()) / math.pi,)


def turned_cylinder(stretch: float, angle: float, harmonics: int = 2) -> tuple[float, float]:
    """Return energy per volume over mu, and the largest nodal force, of a cylinder stretched along x, rotated about
    y.

    The Fourier elements have no pressure; volumes are preserved. The affine map A = Q U has the fields w_-1 = A_xz z,
    w_0 = ((A_xx + A_yy) / 2 - 1) r, w_-2 = (A_xx - A_yy) r / 2, z_0 = (A_zz - 1) z, z_1 = A_zx r.
    """
    e = elements.build(square(2), axisymmetric=True, harmonics=harmonics)
    c, s = math.cos(angle), math.sin(angle)
    A = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ np.diag([stretch, stretch**-0.5, stretch**-0.5])
    k, (r, z) = list(angular_fields.orders(harmonics)), e.nodes.T
    u = np.zeros((len(r), e.angles.fields))
    u[:, k.index(-1)], u[:, k.index(0)] = A[0, 2] * z, ((A[0, 0] + A[1, 1]) / 2 - 1) * r
    u[:, k.index(-2)], u[:, len(k)], u[:, len(k) + 1] = (A[0, 0] - A[1, 1]) / 2 * r, (A[2, 2] - 1) * z, A[2, 0] * r
    system = body(e, np.zeros(u.shape, dtype=bool), 1.0, 0.0)
    q = np.zeros(system.size)
    q[: system.n_free] = u[system.free]
    assembly = system.assemble(system.state(q), None)
    return assembly.energy / math.pi, float(np.abs(assembly.forces).max())


def sheared_cube(shear: float) -> tuple[float, float]:
    """Return sigma_xz and sigma_xx - sigma_zz over mu of a unit cube with u_x = shear z on its faces.

    The mean stresses follow from the nodal forces, V sigma_ij = sum f_i x_j. A small 1/K > 0 determines p.
    """
    mesh = skfem.MeshTet2.from_mesh(skfem.MeshTet.init_tensor(*[np.linspace(0, 1, 3)] * 3))
    e = elements.build(mesh, axisymmetric=False)
    exact = np.zeros(e.nodes.shape)
    exact[:, 0] = shear * e.nodes[:, 2]
    sides = np.asarray(((e.nodes < SKIN) | (e.nodes > 1 - SKIN)).any(axis=1))
    fixed = np.repeat(sides[:, None], 3, axis=1)
    answer = solve(body(e, fixed, 1.0, 1e-3, moved=exact), exact)
    sigma = answer.assembly.forces.T @ (e.nodes + answer.state.u)
    return float(sigma[0, 2]), float(sigma[0, 0] - sigma[2, 2])
