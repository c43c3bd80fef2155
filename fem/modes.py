"""Natural frequencies and mode shapes about the unloaded or a pressed state.

(K - omega^2 M) x = 0 has the tangent K of the section model with two harmonics and the consistent mass M of silicone
and magnet. Pressures have no mass, so K is the symmetric indefinite matrix of the static problem. Two harmonics
contain the axial (0), bending (1) and ovalling (2) modes. Torsion (u_theta alone) is solved separately. Bending and
ovalling modes come in pairs that differ by a rotation about the axis; each pair is listed once.

The pressed state is that of the frictionless press; its contact area is then glued to the fixed plate, because
friction holds it at small amplitudes. There is no damping, and no mass of air or base.

Lengths are over D and stresses over E: omega = sqrt(lambda E / rho) / D, with the silicone's density rho.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from fem.accuracy import STANDARD, Accuracy, coarser
from fem.contact import plate_contact
from fem.contact.contact_extent import find_contact_edge
from fem.contact.plate_contact import Plate
from fem.discretisation import elements, rigid_inclusion
from fem.discretisation.mesh_specification import specification
from fem.discretisation.nonlinear_system import NONE, System
from fem.error_estimate_rules import TANGENT_RULES
from fem.error_estimates import estimate_number
from fem.material import lame
from fem.scene import Scene
from fem.solvers.direct_solver import Solver
from fem.solvers.load_stepping import Path
from fem.solvers.newton import STOPPED
from fem.solvers.path_state import PathState, with_harmonics
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet

SHAPES = ("axial", "bending", "ovalling")
"""Names of harmonics 0, 1, 2."""
MOST = 40
"""Largest number of modes that can be requested."""


@dataclass(frozen=True, slots=True)
class Modes:
    """Natural frequencies in rising order, Hz, and the names of their shapes.

    `estimates` are the estimated relative errors from the mesh, None where they were not estimated.
    """

    frequency: tuple[float, ...]
    shape: tuple[str, ...]
    estimates: tuple[float | None, ...] = ()


def modes(
    design: Design,
    magnet: Magnet = "rigid",
    count: int = 8,
    *,
    depth: float = 0.0,
    accuracy: Accuracy = STANDARD,
    estimate: bool = True,
) -> Modes:
    """Return the lowest modes about a press to a depth in mm; 0 is the free sensor.

    Parameters
    ----------
    estimate : estimate the errors from a second solve on a mesh coarser by COARSER.

    Raises
    ------
    BadInput
        The count or the depth is out of range, or the press does not reach the depth or is unstable there.
    """
    if not 1 <= count <= MOST:
        raise BadInput(f"count must be between 1 and {MOST}; got {count}")
    scene = Scene(design, (Load(depth=depth),), accuracy, magnet)
    lowest = _solve_modes(scene, count)
    if not estimate:
        return lowest
    try:
        coarse = _solve_modes(replace(scene, accuracy=coarser(accuracy)), count)
    except BadInput:  # the press may stop earlier or become unstable on the coarser mesh
        return lowest
    return replace(lowest, estimates=estimate_frequencies(lowest, coarse, scene))


def estimate_frequencies(one: Modes, other: Modes, scene: Scene) -> tuple[float | None, ...]:
    """Return the estimated errors of frequencies, from those on a mesh coarser by COARSER.

    The first, second, ... modes of each shape are compared.
    """
    left = {
        name: [f for f, s in zip(other.frequency, other.shape, strict=True) if s == name] for name in set(one.shape)
    }
    rule = TANGENT_RULES["pressed frequency" if scene.loads[0].depth else "frequency", scene.magnet]
    edge, unit = scene.accuracy.section_size, _frequency_unit(scene.design)
    errors = []
    for frequency, name in zip(one.frequency, one.shape, strict=True):
        coarse = left[name].pop(0) if left[name] else None
        errors.append(estimate_number(rule, frequency, coarse, edge, unit / frequency))
    return tuple(errors)


def _solve_modes(scene: Scene, count: int) -> Modes:
    """Return the lowest modes of a scene, without error estimates."""
    press = _solve_press(scene)
    eigenvalues = [*_solve_symmetric(press, scene, count), *_solve_torsion(press, scene, max(count // 3, 2))]
    depth = scene.loads[0].depth
    if min(eigenvalues)[0] < 0:
        raise BadInput(
            f"the press is unstable at depth {depth:g} mm, so it has no natural frequencies: take a smaller depth"
        )
    scale = _frequency_unit(scene.design)
    lowest = sorted(eigenvalues)[:count]
    frequencies = tuple(math.sqrt(value) * scale for value, _ in lowest)
    return Modes(frequencies, tuple(name for _, name in lowest), (None,) * len(lowest))


def _frequency_unit(design: Design) -> float:
    """Return the frequency at which omega D (rho / E)^(1/2) is 1, Hz; inputs in mm, MPa and kg/m^3."""
    return math.sqrt(1e6 * design.E / design.density) / (1e-3 * design.D) / (2 * math.pi)


def spring_mass(design: Design) -> tuple[float, float]:
    """Return the frequencies of a mass on an axial spring, Hz, without and with the magnet's mass.

    The frequency is sqrt(k / m) / 2 pi with k = E A / L and a third of the silicone's mass (Rayleigh's rod). Without
    the magnet it is the paper's "approximately 970 Hz" (section IV.C), as we read it.
    """
    area, volume = math.pi * design.R**2, math.pi * design.R**2 * (design.H + 2 / 3 * design.R)
    core = math.pi * design.magnet_diameter**2 / 4 * design.magnet_height
    k = 1e3 * design.E * area / design.L
    light, heavy = design.density * volume / 3, design.density * (volume - core) / 3 + design.magnet_density * core
    return math.sqrt(k / (light * 1e-9)) / (2 * math.pi), math.sqrt(k / (heavy * 1e-9)) / (2 * math.pi)


@dataclass(frozen=True, slots=True)
class _Press:
    """An axisymmetric press about which the sensor vibrates.

    Attributes
    ----------
    low, high : its state, without harmonics and with two.
    edge : undeformed radius at which the contact ends, over D; None for the free sensor.
    """

    low: PathState
    high: PathState
    edge: float | None


def _solve_press(scene: Scene) -> _Press:
    """Solve for the press, on a mesh refined where the contact ends."""
    size, patch, D = scene.accuracy.section_size, scene.accuracy.section_patch, scene.design.D
    depth, edge = scene.loads[0].depth / D, None
    section = specification(scene, size, size / 2)
    if depth:
        edge = find_contact_edge(section, patch, depth)
        section = replace(section, rim=(edge, min(patch, edge / 4)))
    path = Path(section.build())
    try:
        reason, state = path.go(depth, np.zeros(2)), path.state
    finally:
        path.close()
    if reason:
        raise BadInput(
            f"the press stops at depth {state.position[0] * D:.4g} mm ({STOPPED[reason]}): take a smaller depth"
        )
    return _Press(state, with_harmonics(state, replace(section, harmonics=2).build()), edge)


def _glue_plate(press: _Press, system: System, q: Array) -> Plate | None:
    """Return the plate with the contact area glued to it, in a model of the press; None for the free sensor."""
    if press.edge is None:
        return None
    assert system.surface is not None
    return plate_contact.glue(system.surface, system.state(q).u, press.low.plate, press.edge, press.low.d.shape.H)


def _inertia(scene: Scene) -> tuple[float, float, float]:
    """Return the magnet's mass and its moments of inertia across and along its axis, over those of silicone and D."""
    design = scene.design
    if scene.magnet != "rigid":
        return 0.0, 0.0, 0.0
    a, h = design.magnet_diameter / 2 / design.D, design.magnet_height / design.D
    m = design.magnet_density / design.density * math.pi * a**2 * h
    return m, m * (3 * a**2 + h**2) / 12, m * a**2 / 2


def _solve_symmetric(press: _Press, scene: Scene, count: int) -> list[tuple[float, str]]:
    """Return eigenvalues and names of the axial, bending and ovalling modes."""
    system, q = press.high.d.system, press.high.q
    m, across, _ = _inertia(scene)
    K = system.assemble(system.state(q), _glue_plate(press, system, q)).tangent
    M = system.mass(1.0, np.array([m, m, across])[: system.n_rigid])
    values, vectors = eigen(K, M, count)
    order = np.abs([*elements.orders(2), *range(3)])
    names = []
    for x in vectors.T:
        parts = _harmonic_energies(system, M, x, order)
        names.append(SHAPES[int(np.argmax(parts))])
    return list(zip(values.tolist(), names, strict=True))


def _harmonic_energies(system: System, M: sp.csr_matrix, x: Array, order: Array) -> Array:
    """Return the kinetic energy of harmonics 0, 1, 2 in a mode; the magnet moves with harmonics 0 and 1."""
    energy = []
    for n in range(3):
        part = np.zeros(len(x))
        fields = np.broadcast_to(order == n, system.free.shape)[system.free]
        part[: system.n_free][fields] = x[: system.n_free][fields]
        if system.n_rigid and n < 2:
            place = system.n_free + (np.array([1]) if n == 0 else np.array([0, 2]))
            part[place] = x[place]
        energy.append(float(part @ (M @ part + sp.triu(M, 1).T @ part)))
    return np.array(energy)


def _solve_torsion(press: _Press, scene: Scene, count: int) -> list[tuple[float, str]]:
    """Return the eigenvalues of the torsional modes, from the axisymmetric model with u_theta."""
    d, rigid = press.low.d, scene.magnet == "rigid"
    e = elements.build(d.mesh, axisymmetric=True, angles=elements.torsion_fields())
    fixed = np.zeros((len(e.nodes), 3), dtype=bool)
    fixed[elements.boundary_nodes(d.mesh, "base")] = True
    fixed[elements.boundary_nodes(d.mesh, "axis"), :2] = True
    skin = elements.surface(d.mesh, "skin", e, axisymmetric=True, order=5)
    glued = elements.boundary_nodes(d.mesh, "magnet") if rigid else NONE
    body = rigid_inclusion.section(e.nodes[glued] - [0, d.shape.H], e.angles) if rigid else None
    system = System(e, skin, *lame(1.0, scene.design.nu), fixed, glued, body, law=d.system.law)
    low = d.system.state(press.low.q)
    u = np.stack([low.u[:, 0], np.zeros(len(low.u)), low.u[:, 1]], axis=1)
    motion = np.append(d.system.motion(press.low.q), 0.0) if body else np.empty(0)
    q = system.unknowns(u, low.p, motion)
    m, _, along = _inertia(scene)
    K = system.assemble(system.state(q), _glue_plate(press, system, q)).tangent
    M = system.mass(1.0, np.array([m, along])[: system.n_rigid])
    # torsion does not couple to the other unknowns of this model, which are dropped
    twist = np.zeros(system.size, dtype=bool)
    twist[: system.n_free] = np.broadcast_to([False, True, False], system.free.shape)[system.free]
    if body:
        twist[system.n_free + 1] = True
    values, _ = eigen(K[twist][:, twist].tocsr(), M[twist][:, twist].tocsr(), count)
    return [(float(value), "torsion") for value in values]


def eigen(K: sp.csr_matrix, M: sp.csr_matrix, count: int) -> tuple[Array, Array]:
    """Return the eigenvalues nearest to zero of K x = lambda M x in rising order, and their vectors (n, count).

    K and M are upper triangles.
    """
    n = K.shape[0]
    solver = Solver()
    try:
        solver.factorise(K)
        whole = (M + sp.triu(M, 1).T).tocsr()
        inverse = spla.LinearOperator((n, n), matvec=lambda b: solver.solve(np.ravel(b)), dtype=np.float64)
        start = np.random.default_rng(0).normal(size=n)
        values, vectors = spla.eigsh(K, k=count, M=whole, sigma=0.0, OPinv=inverse, v0=start)
    finally:
        solver.close()
    order = np.argsort(values)
    return values[order], vectors[:, order]
