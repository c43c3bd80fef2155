"""Published and closed-form problems of equilibrium: blocks, membranes, spheres, clamped cylinders, contact.

verify_problems.toml describes them, and names what each function returns. It takes the number n of elements along a
side, unless that table says otherwise. Stresses are in units of the shear or Young's modulus and lengths in units of
the body, unless stated otherwise. If displacements are prescribed and a closed form exists, Newton's method
starts from that displacement field and solves for the pressures and for balance of forces.
"""

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq

from analytic.magnet import cylinder_field
from fem.accuracy import LEVELS
from fem.analyses.modes import eigen
from fem.equilibrium import trace
from fem.model import angular_fields, elements, material, plate_contact
from fem.model.elements import Elements
from fem.model.nonlinear_system import State, System
from fem.model.plate_contact import SECTION_KAPPA
from fem.model.symmetry_models import MeshSpecification, on_axis
from fem.solve.direct_solver import Solver
from fem.solve.load_stepping import Path, PathModels
from fem.solve.newton import STOPPED, Equilibrium, newton
from geometry.arrays import Array
from geometry.bad_input import SolveFailed
from geometry.design import paper
from geometry.loads import Load, Magnet
from geometry.relaxation import lame

Mask = NDArray[np.bool_]

SKIN = 1e-9
"""Nodes nearer than this to a face lie on it."""


def body(
    e: Elements, fixed: Mask, mu: float, inverse_K: float, *, dead: Array | None = None, moved: Array | None = None
) -> System:
    """Return a system without magnet and plate.

    `fixed` displacements are prescribed, as `moved` says; `dead` are nodal loads; all have shape (nodes, fields).
    """
    return System(e, None, (mu, inverse_K), fixed, dead=dead, prescribed=None if moved is None else (moved, None))


def solve(system: System, u: Array | None = None, q: Array | None = None) -> Equilibrium:
    """Solve by Newton's method from nodal displacements u (nodes, dim) without pressure, or from unknowns q."""
    start = np.zeros(system.size) if q is None else q
    if u is not None:
        start[: system.n_free] = u[system.free]
    answer = newton(system, Solver(), start, None)
    if not answer.converged:
        raise SolveFailed(STOPPED[answer.reason])
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
    grid = np.linspace(0, 1, n + 1)
    flat = skfem.MeshTri.init_tensor(grid, grid)
    return skfem.MeshTri2.from_mesh(flat if move is None else skfem.MeshTri(move(flat.p), flat.t))


def cook(n: int) -> tuple[float]:
    mesh = square(n, lambda x: np.stack([48 * x[0], 44 * x[0] + x[1] * (44 - 28 * x[0])]))
    mesh = mesh.with_boundaries({"right": lambda x: x[0] > 48 - SKIN})
    e = elements.build(mesh, axisymmetric=False)
    fixed = np.repeat((e.nodes[:, 0] < SKIN)[:, None], 2, axis=1)
    system = body(e, fixed, *lame(3.0, 0.5))
    last = ramp(system, facet_loads(mesh, e, "right", (0, 0, 0.05)), [0.5, 1.0])[-1]
    corner = np.argmin(np.hypot(e.nodes[:, 0] - 48, e.nodes[:, 1] - 60))
    return (float(last.state.u[corner, 1]),)


def bonded_cylinder(n: int, S: float) -> tuple[float]:
    """Return the apparent modulus E_a / E of an incompressible disc bonded to two plates."""
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
    """Return the compression, %, of a block's centre under dead pressures p/p0 (p0 = 4 MPa) on mid-top."""
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
    system = System(e, None, (mu, 1 / bulk), fixed, law=law)
    steps = [float(level) for level in range(20, max(levels) + 1, 20)]
    answers = dict(zip(steps, ramp(system, facet_loads(mesh, e, "pressed", (0, 0, -4.0)), steps), strict=True))
    corner = np.argmin(np.linalg.norm(e.nodes - [0, 0, 1], axis=1))
    return tuple(float(-100 * answers[level].state.u[corner, 2]) for level in levels)


def _coupled(strain: material.Arrays, mu: Array, p: Array, out: material.Arrays, /) -> None:
    """Write energy W, stress P and tangent A of Reese's law, with the energy p (J - 1) added (`material.Law`).

    W = mu/2 (I1 - 3 - 2 ln J): P = mu (F - F^-T), dP_iJ/dF_kL = mu (delta_ik delta_JL + H_iL H_kJ), H = F^-T.
    """
    (G, Jm1, Hm1), (W, P, A) = strain, out
    W[:] = mu / 2 * (2 * G[::4].sum(axis=0) + np.square(G).sum(axis=0) - 2 * np.log1p(Jm1))
    P[:] = mu * (G - Hm1)
    if A.shape[2]:
        H = Hm1.reshape(3, 3, -1) + np.eye(3)[..., None]
        A[:] = mu * (np.eye(9)[..., None] + np.einsum("iLn,kJn->iJkLn", H, H).reshape(A.shape))
    material.add_pressure(Jm1, Hm1, p, W, P, A)


def mirrored_reese_block(n: int, levels: tuple[int, ...]) -> list[float]:
    one, other = (reese_block(n, levels, mirrored=way) for way in (False, True))
    return [b / a for a, b in zip(one, other, strict=True)]


def reese_formulations(n: int) -> list[float]:
    levels = (20, 40, 60, 80)
    others = (reese_block(n, levels, order=4), reese_block(n, levels, own_energy=True))
    return [values[-1] / reese_block(n, levels)[-1] for values in others]


def thick_sphere(n: int, stretches: Sequence[float]) -> tuple[float, ...]:
    """Return the pressure p / mu that widens the hole of an incompressible sphere, radii 1 and 2, by each stretch."""

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


def homogeneous_states(_: int) -> tuple[float, ...]:
    stretch, e = 2.0, tetrahedra(1)
    stresses = []
    for along, free in ((stretch**-0.5, True), (stretch, False), (1.0, False)):
        exact, end = e.nodes * (np.array([stretch, along, 1 / (stretch * along)]) - 1), e.nodes > 1 - SKIN
        fixed = (e.nodes < SKIN) | (end & [True, not free, False])
        answer = solve(body(e, fixed, *lame(3.0, 0.5), moved=exact), exact)
        stresses.append(float(answer.assembly.forces[end[:, 0], 0].sum()))
    e = elements.build(square(1), axisymmetric=True)
    exact, top = e.nodes * (np.array([stretch**-0.5, stretch]) - 1), e.nodes[:, 1] > 1 - SKIN
    fixed = e.nodes < SKIN
    fixed[top, 1] = True
    answer = solve(body(e, fixed, *lame(3.0, 0.5), moved=exact), exact)
    stresses.append(float(answer.assembly.forces[top, 1].sum()) / math.pi)
    return (*stresses, *sheared_cube(0.8), turned_cylinder(2.0, 1.0)[0])


def tetrahedra(n: int) -> Elements:
    return elements.build(
        skfem.MeshTet2.from_mesh(skfem.MeshTet.init_tensor(*[np.linspace(0, 1, n + 1)] * 3)), axisymmetric=False
    )


def faces(e: Elements) -> Mask:
    """Return the degrees of freedom (nodes, 3) on the faces of the unit cube."""
    outer = np.asarray(((e.nodes < SKIN) | (e.nodes > 1 - SKIN)).any(axis=1))
    return np.repeat(outer[:, None], 3, axis=1)


def sheared(amount: float, e: Elements) -> Array:
    u = np.zeros(e.nodes.shape)
    u[:, 0] = amount * e.nodes[:, 2]
    return u


def turned_cylinder(stretch: float, angle: float, harmonics: int = 2) -> tuple[float, float]:
    """Return energy per volume over mu, and largest nodal force, of a cylinder stretched along x, rotated about y.

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
    e = tetrahedra(2)
    exact = sheared(shear, e)
    answer = solve(body(e, faces(e), 1.0, 1e-3, moved=exact), exact)
    sigma = answer.assembly.forces.T @ (e.nodes + answer.state.u)
    return float(sigma[0, 2]), float(sigma[0, 0] - sigma[2, 2])


# Clamped cylinders: large deflection (elastica), small deflection and vibration (Timoshenko's beam)
#
# The cylinders consist of Fourier elements with two harmonics on a rectangular section; these represent rigid
# rotations of a cross-section exactly. Diameter and Young's modulus are 1. The load is a uniform dead traction along
# x on the flat end. Rows of rectangles become thinner towards the clamp.

HARMONICS = 2
AREA, INERTIA = math.pi / 4, math.pi / 64
"""Area and second moment of area of the cross-section, D = 1."""
GRADING = 1.5
"""Row i of n ends at (i / n)^GRADING of the length."""
SMALL = 1e-7
"""Tip force F of the linear problems, as F / (E D^2) (L / D)^2: small enough for linear strain."""


def elastica(slenderness: int, loads: tuple[float, ...]) -> tuple[float, ...]:
    system, e = cylinder(slenderness, 0.0, across=2, along=slenderness)
    unit = system.dead * INERTIA / slenderness**2
    steps = sorted({*np.linspace(0, max(loads), 9)[1:], *loads})
    answers = dict(zip(steps, ramp(system, unit, steps), strict=True))
    motions = [tip_motion(e, answers[load].state) for load in loads]
    return tuple(value / slenderness for w, u in motions for value in (w, -u))


def tip_stiffness(n: int, nu: float, *, slenderness: int = 0, bonded: bool = True) -> float:
    """Return the tip stiffness at small strain over Timoshenko's 1 / (L^3 / (3 E I) + L / (kappa G A))."""
    rows, slenderness = (n, slenderness) if slenderness else (4, n)
    system, e = cylinder(slenderness, nu, across=rows, along=rows * slenderness, bonded=bonded)
    force = SMALL / slenderness**2
    system.dead = force * system.dead
    deflection = tip_motion(e, solve(system).state)[0]
    return force / deflection * compliance(slenderness, nu)


def vibration(rows: int, slenderness: int, nu: float, count: int) -> list[float]:
    system, _ = cylinder(slenderness, nu, across=rows, along=rows * slenderness)
    K = system.assemble(system.state(np.zeros(system.size)), None).tangent
    # three times as many modes, since torsion and extension lie between the bending frequencies
    values, vectors = eigen(K, system.mass(1.0), 3 * count)
    sideways = np.abs([*angular_fields.orders(HARMONICS), *range(HARMONICS + 1)]) == 1
    bends = np.broadcast_to(sideways, system.free.shape)[system.free]
    shapes = np.abs(vectors[: system.n_free]).T
    bending = [float(value) for value, x in zip(values, shapes, strict=True) if x[bends].max() > x[~bends].max()]
    return [math.sqrt(a) / b for a, b in zip(bending, frequencies(slenderness, nu, count), strict=False)]


def frequencies(slenderness: float, nu: float, count: int) -> list[float]:
    """Return the angular frequencies of Timoshenko's clamped and free beam, D = E = rho = 1.

    Along the beam w' = phi + g, phi' = m, m' = -omega^2 phi - kappa G A g / I and g' = -omega^2 w / (kappa G), with
    w = phi = 0 at the clamp and m = g = 0 at the end. The first frequency of a slender beam is 3.516 sqrt(I / A) /
    L^2:

    >>> round(frequencies(100.0, 0.3, 1)[0] * 1e4 / math.sqrt(INERTIA / AREA), 3)
    3.516
    """
    kappa_G = 6 * (1 + nu) / (7 + 6 * nu) / (2 * (1 + nu))
    stiff = kappa_G * AREA / INERTIA

    def residual(omega: float) -> float:
        # the determinant of the end conditions m = g = 0 vanishes at a frequency
        A = np.array([[0, 1, 0, 1], [0, 0, 1, 0], [0, -(omega**2), 0, -stiff], [-(omega**2) / kappa_G, 0, 0, 0]])
        return float(np.linalg.det(expm(slenderness * A)[2:, 2:]))

    # the step is less than a third of the first frequency, so that no two roots share an interval
    step = math.sqrt(INERTIA / AREA) / slenderness**2
    roots: list[float] = []
    omega = step
    while len(roots) < count:
        if residual(omega) * residual(omega + step) < 0:
            roots.append(float(brentq(residual, omega, omega + step, rtol=1e-12)))
        omega += step
    return roots


def compliance(slenderness: float, nu: float) -> float:
    """Return Timoshenko's tip deflection under a unit load, D = E = 1; kappa = 6 (1 + nu) / (7 + 6 nu), Cowper 1966.

    >>> round(compliance(1e3, 0.5) * 3 * INERTIA / 1e9, 5)
    1.0
    """
    kappa, G = 6 * (1 + nu) / (7 + 6 * nu), 1 / (2 * (1 + nu))
    return slenderness**3 / (3 * INERTIA) + slenderness / (kappa * G * AREA)


def cylinder(
    slenderness: float, nu: float, *, across: int, along: int, bonded: bool = True
) -> tuple[System, Elements]:
    """Return a cylinder of given L / D, clamped at z = 0, under a unit load at the end.

    The section has `across` rectangles along the radius and `along` along the axis.
    """
    rows = slenderness * np.linspace(0, 1, along + 1) ** GRADING
    flat = skfem.MeshTri.init_tensor(np.linspace(0, 0.5, across + 1), rows)
    mesh = skfem.MeshTri2.from_mesh(flat).with_boundaries(
        {"end": lambda x: x[1] > slenderness - SKIN, "base": lambda x: x[1] < SKIN}
    )
    e = elements.build(mesh, axisymmetric=True, harmonics=HARMONICS)
    base, axis = e.nodes[:, 1] < SKIN, e.nodes[:, 0] < SKIN
    fixed = np.repeat(base[:, None], e.angles.fields, axis=1)
    load = facet_loads(mesh, e, "end", (1 / AREA, 0, 0))
    if not bonded:
        load += facet_loads(mesh, e, "base", (-1 / AREA, 0, 0))
        fixed[base & ~axis, : len(angular_fields.orders(HARMONICS))] = False
    fixed[np.ix_(axis, ~on_axis(HARMONICS))] = True
    return body(e, fixed, *lame(1.0, nu), dead=load), e


def tip_motion(e: Elements, state: State) -> tuple[float, float]:
    """Return the displacement along x and z of the node where the axis meets the end: the fields w_-1 and z_0."""
    tip = int(np.argmax(e.nodes[:, 1] - 1e3 * e.nodes[:, 0]))
    k = list(angular_fields.orders(HARMONICS))
    return float(state.u[tip, k.index(-1)]), float(state.u[tip, len(k)])


# The paper's sensor: Hertz's limit, the error of the plate's penalty, the field of the magnet

LEVEL = tuple(LEVELS.values())
"""Accuracy levels quick, standard and fine by the mesh numbers 1, 2 and 3, less 1."""


def magnet_field(_: int) -> Array:
    return np.asarray(1e3 * cylinder_field([[0, 0, z] for z in (5.0, 6.0, 7.0, 8.0)], 2.0, 4.0, 1.2)[:, 2])


def hertz(n: int) -> tuple[float, ...]:
    """Return the force over Hertz's 4/3 E / (1 - nu^2) sqrt(R) d^1.5 at d = 1e-6, 1e-5, 1e-4 mm, and its exponent."""
    design, depths = paper(), (1e-6, 1e-5, 1e-4)
    ratios = []
    for depth in depths:
        state = trace(design, [Load(depth=depth)], LEVEL[n - 1], magnet="ignored", estimate=False)[0]
        if state.status != "ok":
            raise SolveFailed(state.message)
        constant = 4 / 3 * design.E / (1 - design.nu**2) * math.sqrt(design.R)
        ratios.append(state.response.force[2] / (constant * depth**1.5))
    slope = 1.5 + math.log(ratios[-1] / ratios[0]) / math.log(depths[-1] / depths[0])
    return (*ratios, slope)


def penalty(n: int, depth: float, magnet: Magnet, kappa: float = SECTION_KAPPA) -> float:
    """Return the force on the paper's sensor at level n with the penalty kappa over that on a rigid plate."""
    design, size = paper(), LEVEL[n - 1].section_size
    shape = design.shape.scaled(1 / design.D)
    tip = min(size, math.sqrt(shape.R * depth) * size / 2)
    path = Path(PathModels(MeshSpecification(shape, design.nu, magnet, size, tip), kappa=kappa))
    forces, factors, solver = [], np.array([1.0, 3.0, 10.0]), Solver()
    reached = path.advance(path.rest, np.array([depth, 0.0, 0.0]))
    reason, state = reached.stop, reached.state
    system, q, plate, skin = state.d.system, state.q, state.plate, state.skin
    for factor in factors:
        harder = replace(plate, stiffness=factor * plate.stiffness)
        pressed = plate_contact.overlap(skin, system.state(q).u, plate) > 0
        answer = newton(system, solver, q, harder, pressed)
        reason = reason or answer.reason
        q = answer.state.q
        pushed = plate_contact.springs(skin, answer.state.u, harder).traction[..., 2]
        forces.append(float(np.sum(skin.weights * pushed)))
    if reason:
        raise SolveFailed(STOPPED[reason])
    return forces[0] / float(np.polynomial.Polynomial.fit(1 / factors, forces, 1)(0.0))
