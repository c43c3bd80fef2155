"""Published and closed-form problems as functions of a mesh size: what `verify` and the tests solve.

Each takes the number n of elements along a side (or what it says) and returns the quantities that are published.
Stresses are in units of the shear or Young's modulus where nothing else is said, lengths in units of the body.
Where displacements are prescribed, Newton's method starts from those of the closed form, if there is one, and has to
find the pressures and that the forces balance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import skfem
from numpy.typing import NDArray

from fem import elements
from fem.elements import Elements
from fem.equilibrium import LEVELS, trace
from fem.linear import Solver
from fem.material import lame
from fem.newton import Equilibrium, newton
from fem.system import System
from geometry.design import paper
from geometry.scene import Load

Array = NDArray[np.float64]
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
        raise NotSolvedError(answer.reason)
    return answer


def ramp(system: System, dead: Array, levels: Sequence[float]) -> list[Equilibrium]:
    """Equilibria under dead loads (nodes, dim) times each level in turn, each guessed from the last two."""
    answers: list[Equilibrium] = []
    before, last, now = 0.0, np.zeros(system.size), np.zeros(system.size)
    reached = 0.0
    for level in levels:
        system.dead = level * dead
        guess = now + (now - last) * ((level - reached) / (reached - before) if answers else 0.0)
        if system.least_J(system.state(guess)) <= 0:
            guess = now
        answers.append(find(system, q=guess))
        before, reached, last, now = reached, level, now, answers[-1].state.q
    return answers


def facet_loads(mesh: skfem.Mesh, e: Elements, name: str, traction: Sequence[float]) -> Array:
    """Nodal forces (nodes, dim) of a uniform dead traction on a named boundary; not for sections of revolution."""
    s = elements.surface(mesh, name, e, axisymmetric=False, order=4)
    dead = np.zeros(e.nodes.shape)
    np.add.at(dead, s.nodes, (s.weights @ s.shape)[..., None] * np.asarray(traction))
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
    last = ramp(system, facet_loads(mesh, e, "right", (0, 0.05)), [0.5, 1.0])[-1]
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


def reese_block(n: int, levels: Sequence[int]) -> tuple[float, ...]:
    """Compression, %, of a block's corner under dead pressures p/p0 (p0 = 4 MPa) on the inner quarter of its top.

    Quarter of the block as n^3 bricks of tetrahedra, n a multiple of 4, with three quarters of the bricks along an
    edge under the load; mu = 80.194, lambda = 400889.806 MPa. The top does not move sideways.
    """
    mu, bulk = 80.194, 400889.806 + 2 / 3 * 80.194
    inner = 3 * n // 4
    side = np.append(np.linspace(0, 0.5, inner + 1), np.linspace(0.5, 1, n - inner + 1)[1:])
    mesh = skfem.MeshTet2.from_mesh(skfem.MeshTet.init_tensor(side, side, np.linspace(0, 1, n + 1))).with_boundaries(
        {"pressed": lambda x: (x[2] > 1 - SKIN) & (x[0] < 0.5) & (x[1] < 0.5)}
    )
    e = elements.build(mesh, axisymmetric=False)
    fixed = e.nodes < SKIN
    fixed[e.nodes[:, 2] > 1 - SKIN, :2] = True
    system = body(e, fixed, mu, 1 / bulk)
    steps = [float(level) for level in range(10, max(levels) + 1, 10)]
    answers = dict(zip(steps, ramp(system, facet_loads(mesh, e, "pressed", (0, 0, -4.0)), steps), strict=True))
    corner = np.argmin(np.linalg.norm(e.nodes - [0, 0, 1], axis=1))
    return tuple(float(-100 * answers[level].state.u[corner, 2]) for level in levels)


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


def hertz(level: str) -> tuple[float, ...]:
    """Force over Hertz's 4/3 E / (1 - nu^2) sqrt(R) d^1.5 at d = 1e-6, 1e-5, 1e-4 mm, and the slope of log F.

    The paper's beam without its magnet, on meshes of an accuracy (quick, standard, fine).
    """
    design, depths = paper(), (1e-6, 1e-5, 1e-4)
    ratios = []
    for depth in depths:
        state = trace(design, [Load(depth=depth)], LEVELS[level], magnet="ignored", estimate=False)[0]
        if state.status != "ok":
            raise NotSolvedError(state.message)
        constant = 4 / 3 * design.E / (1 - design.nu**2) * math.sqrt(design.R)
        ratios.append(state.response.force[2] / (constant * depth**1.5))
    slope = 1.5 + math.log(ratios[-1] / ratios[0]) / math.log(depths[-1] / depths[0])
    return (*ratios, slope)


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
