"""Newton's method on a section under Coulomb friction: each step linearises the body, but not the contact.

The overlap and the slip of a skin point are linear in the displacements, so the plate's forces f are known functions
of the displacements z of the skin near the contact, however its points stick, slip, touch or lift off. The equations
of a step of the linearised body,

    K dq + r + P^T f(z + P dq) = 0,

with stiffness K and residual r of the body without the plate, are condensed to these few unknowns: with the Schur
complement S of K and the condensed residual s, S y + s + f(z + y) = 0. This problem is small and dense. Its own
Newton iteration (semi-smooth, because the return map of `fem.model.coulomb_friction` has kinks) settles stick and
slip before the body is assembled again, so that the body takes the few iterations of a smooth problem. The
equilibrium is that of the whole equations. Plain steps, which linearise both, took twice as many.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem.model import coulomb_friction, plate_contact
from fem.model.elements import Surface
from fem.model.nonlinear_system import Assembly, State, System
from fem.model.plate_contact import Plate, Springs
from fem.solve.direct_solver import Solver
from fem.solve.inertia import UNKNOWN, Stability
from fem.solve.newton import (
    MOST_ITERATIONS,
    TOLERANCE,
    Equilibrium,
    assemble_at_rest,
    backtrack,
    keeps_factorisation,
    reference_size,
)
from fem.solve.pardiso import SingularMatrixError
from geometry.arrays import Array, Ints

Mask = NDArray[np.bool_]

RINGS = 3
"""Facets on each side of the contact whose unknowns are kept, so that the contact can grow; one is the least."""
MOST_SETTLING, SETTLED = 60, 1e-12
"""Most iterations of the condensed problem, and its tolerance over the forces on its unknowns."""
MOST_KEPT = 4
"""Steps with the stiffness of an earlier state that cost as much as its condensation."""
PATIENCE = 6
"""Full steps of the condensed problem before steps that do not halve its residual are compared with shorter ones."""


@dataclass(frozen=True, slots=True)
class ContactZone:
    """Facets at and around the contact, and their c unknowns.

    Attributes
    ----------
    facets : (k,) mask of these facets.
    surface : the same facets, with nodes numbered from 0.
    nodes : (n,) numbers of these nodes in the whole mesh.
    unknowns : (c,) numbers of their unknowns, increasing.
    local : (n, fields) position of each nodal field in `unknowns`; c where it is no unknown.
    """

    facets: Mask
    surface: Surface
    nodes: Ints
    unknowns: Ints
    local: Ints

    def restrict(self, plate: Plate) -> Plate:
        """Return the plate with the points of these facets only."""
        f, own = plate.friction, self.facets
        assert f is not None
        friction = replace(
            f,
            displacement=f.displacement[own],
            traction=f.traction[own],
            pressure=f.pressure[own],
            slipping=f.slipping[own],
            anchor=None if f.anchor is None else f.anchor[own],
            slip_direction=None,
        )
        return replace(plate, pressed=None if plate.pressed is None else plate.pressed[own], friction=friction)

    def springs(self, u: Array, y: Array, plate: Plate) -> Springs:
        """Return the plate's springs after the change y (c,) of nodal displacements u (n, fields)."""
        return plate_contact.springs(self.surface, u + np.append(y, 0.0)[self.local], plate)

    def forces(self, springs: Springs) -> Array:
        """Return the derivative (c,) of the springs' energy by the unknowns."""
        at = self.local[self.surface.nodes].ravel()
        forces = self.surface.forces(springs.traction).ravel()
        return np.asarray(np.bincount(at, weights=forces, minlength=len(self.unknowns) + 1)[:-1], dtype=np.float64)

    def stiffness(self, springs: Springs, plate: Plate) -> Array:
        """Return the derivative (c, c) of these forces."""
        blocks, c = self.surface.stiffness(springs.stiffness, plate.frame), len(self.unknowns) + 1
        at = np.swapaxes(self.local[self.surface.nodes], 1, 2).reshape(len(blocks), -1)
        pairs = (at[:, :, None] * c + at[:, None, :]).ravel()
        whole = np.bincount(pairs, weights=blocks.ravel(), minlength=c * c).reshape(c, c)
        return np.asarray(whole[:-1, :-1], dtype=np.float64)


@dataclass(frozen=True, slots=True)
class _Residual:
    """The whole residual, with the stiffness of the body alone, and the residual of the body alone."""

    whole: Assembly
    body: Array


def newton_with_friction(
    system: System,
    solver: Solver,
    q: Array,
    plate: Plate,
    pressed: Mask | None = None,
    *,
    most: int = MOST_ITERATIONS,
    tolerance: float = TOLERANCE,
    near: bool = False,
) -> Equilibrium | None:
    """Solve residual(q) = 0 on a section under a plate with Coulomb friction, as `fem.solve.newton.newton` does.

    None where Newton's method does not solve a condensed problem, or its body needs other pivots: plain steps may
    still succeed.

    Parameters
    ----------
    near : start with the stiffness that the solver condensed for an earlier state near this one, and keep it while
        MOST_KEPT more steps at the same rate reach the tolerance.
    """
    state = system.admissible(q)
    if state is None:
        return Equilibrium(system.state(q), assemble_at_rest(system), 0, "guess_inverted")
    zone, schur, rate = None, np.zeros((0, 0)), 1.0
    if near and solver.schur is not None:
        known = _choose_zone(system, solver, state, plate, pressed)
        if np.array_equal(known.unknowns, solver.kept):
            zone, schur = known, solver.schur
    near = zone is not None
    now = _assemble(system, state, plate, tangent=not near)
    for iteration in range(most):
        size = reference_size(system, state, now.whole)
        left, before = size.share(now.whole), size.merit(now.whole)
        try:
            if left <= tolerance and zone is not None:
                return _finish(system, solver, plate, zone, schur, state, now.whole, iteration)
            if zone is None or now.whole.matrix is not None:
                zone = _choose_zone(system, solver, state, plate, pressed)
                complement = solver.condense(now.whole.tangent, zone.unknowns)
                if complement is None:
                    return None
                schur = complement
        except SingularMatrixError:
            return Equilibrium(state, now.whole, iteration, "singular")
        half = solver.forward(-now.body)
        y = settle(schur, half[zone.unknowns], zone, state.u[zone.nodes], plate, pressed if iteration == 0 else None)
        if y is None:
            return None
        trial = backtrack(system, state, -solver.backward(half, y))
        if trial is None:
            return Equilibrium(state, now.whole, iteration, "step_inverted")
        # as in the plain method, the stiffness is computed only where the last one is not good enough
        near = near and now.whole.matrix is None
        keeps = keeps_longer if near else keeps_factorisation
        likely = 0.0 if near else rate**2
        fresh = not keeps(likely, likely * left, tolerance) or not _covers(system, zone, trial, plate)
        state, now = trial, _assemble(system, trial, plate, tangent=fresh)
        rate = size.merit(now.whole) / before if before else 0.0
        if not fresh and not keeps(rate, rate * left, tolerance):
            now = _assemble(system, state, plate)
    return Equilibrium(state, now.whole, most, "no_convergence")


def settle(
    schur: Array, load: Array, zone: ContactZone, u: Array, plate: Plate, pressed: Mask | None = None
) -> Array | None:
    """Solve S y + f(u + y) = b for the change y (c,) of the unknowns near the contact; None if that fails.

    Parameters
    ----------
    schur, load : S (c, c) and b (c,).
    u : (n, fields) displacements of the zone's nodes.
    pressed : (k, q) points of the whole skin that are in contact in the first iteration, as in Newton's method.
    """
    plate = zone.restrict(replace(plate, pressed=pressed))
    y: Array = np.zeros(len(load))
    step, last = y, math.inf
    for iteration in range(MOST_SETTLING):
        springs = zone.springs(u, y, plate)
        force = zone.forces(springs)
        residual = schur @ y + force - load
        now = _norm(residual)
        friction = springs.friction
        assert friction is not None
        if plate.pressed is None and not friction.held and now <= SETTLED * (_norm(force) + _norm(load)):
            return y
        if iteration > PATIENCE and now > last / 2:
            y, springs, residual = _shorten(schur, load, zone, u, plate, y, step)
            now = _norm(residual)
        last = now
        try:
            step = np.asarray(np.linalg.solve(schur + zone.stiffness(springs, plate), residual))
        except np.linalg.LinAlgError:
            return None
        y = y - step
        assert plate.friction is not None
        plate = replace(
            plate, pressed=None, friction=coulomb_friction.hold_reversing_points(plate.friction, friction)
        )
    return None


def contact_zone(system: System, touching: Mask, rings: int = RINGS) -> ContactZone:
    """Return the facets that touch, by a mask (k,), and `rings` of neighbours around them."""
    s, facets = _skin(system), touching
    for _ in range(rings):
        inside = np.zeros(len(system.elements.nodes), dtype=bool)
        inside[s.nodes[facets]] = True
        facets = np.asarray(inside[s.nodes].any(axis=1))
    nodes, own = np.unique(s.nodes[facets], return_inverse=True)
    surface = replace(s, nodes=own.reshape(-1, s.nodes.shape[1]), weights=s.weights[facets], points=s.points[facets])
    numbers = system.unknown_numbers[nodes]
    unknowns = np.unique(numbers[numbers >= 0])
    local = np.where(numbers >= 0, np.searchsorted(unknowns, numbers), len(unknowns))
    return ContactZone(facets, surface, nodes, unknowns, local)


def _skin(system: System) -> Surface:
    assert system.surface is not None
    return system.surface


def _touching(system: System, state: State, plate: Plate) -> Mask:
    """Return the mask (k,) of the facets that touch the plate; the nearest one where none does."""
    g = plate_contact.overlap(_skin(system), state.u, plate).max(axis=1)
    return np.asarray(g >= min(g.max(), 0.0))


def _choose_zone(system: System, solver: Solver, state: State, plate: Plate, pressed: Mask | None) -> ContactZone:
    """Return the zone of a state: that of the last condensation while it is wide enough and not much too wide."""
    touching = _touching(system, state, plate)
    if plate.friction is not None:
        touching = touching | plate.friction.touching.any(axis=1)
    if pressed is not None:
        touching = touching | pressed.any(axis=1)
    kept = np.zeros(system.size + 1, dtype=bool)
    kept[solver.kept] = kept[-1] = True
    known = np.asarray(kept[system.unknown_numbers[_skin(system).nodes]].all(axis=(1, 2)))
    wanted = contact_zone(system, touching)
    if known[contact_zone(system, touching, rings=1).facets].all() and len(solver.kept) <= 2 * len(wanted.unknowns):
        return contact_zone(system, known, rings=0)
    return wanted


def keeps_longer(rate: float, left: float, tolerance: float) -> bool:
    """Return whether to keep the stiffness of an earlier state, see `newton_with_friction`."""
    return rate**MOST_KEPT * left <= tolerance


def _covers(system: System, zone: ContactZone, state: State, plate: Plate) -> bool:
    """Return whether all points that touch at a state lie in the zone."""
    return bool(zone.facets[_touching(system, state, plate)].all())


def _assemble(system: System, state: State, plate: Plate, *, tangent: bool = True) -> _Residual:
    """Return the residual at a state, and with `tangent` the stiffness of the body without the plate."""
    s = _skin(system)
    # a plate that touches no point: the base, which has springs too, belongs to the body
    away = replace(plate, pressed=np.zeros(s.weights.shape, dtype=bool), friction=None)
    body = system.assemble(state, away, tangent=tangent)
    springs = plate_contact.springs(s, state.u, plate)
    forces = np.zeros(body.forces.shape)
    np.add.at(forces, s.nodes, s.forces(springs.traction))
    residual = body.residual.copy()
    residual[: system.n_free] += forces[system.free]
    whole = Assembly(residual, body.energy + springs.energy, body.forces + forces, body.matrix)
    return _Residual(whole, body.residual)


def _shorten(
    schur: Array, load: Array, zone: ContactZone, u: Array, plate: Plate, y: Array, step: Array
) -> tuple[Array, Springs, Array]:
    """Return the best of a full step to y, its half and its quarter, with springs and residual there."""
    tried = []
    for back in (0.0, 0.5, 0.75):
        shorter = y + back * step
        springs = zone.springs(u, shorter, plate)
        tried.append((shorter, springs, schur @ shorter + zone.forces(springs) - load))
    return min(tried, key=lambda one: _norm(one[2]))


def _finish(
    system: System,
    solver: Solver,
    plate: Plate,
    zone: ContactZone,
    schur: Array,
    state: State,
    assembly: Assembly,
    iteration: int,
) -> Equilibrium:
    """Return the equilibrium with its stability."""
    stability = _measure_stability(system, solver, plate, zone, schur, state)
    if stability.is_unstable:  # counted with an earlier stiffness of the body, which may be far from here
        tangent = _assemble(system, state, plate).whole.tangent
        complement = solver.condense(tangent, zone.unknowns)
        stability = (
            UNKNOWN if complement is None else _measure_stability(system, solver, plate, zone, complement, state)
        )
    return Equilibrium(state, assembly, iteration, "", stability)


def _measure_stability(
    system: System, solver: Solver, plate: Plate, zone: ContactZone, schur: Array, state: State
) -> Stability:
    """Return the stability of a state; unknown where a point slips, for then its stiffness is unsymmetric."""
    here = zone.restrict(plate)
    springs = zone.springs(state.u[zone.nodes], np.zeros(len(zone.unknowns)), here)
    if springs.friction is None or springs.friction.slipping.any():
        return UNKNOWN
    return solver.stability_with(schur, zone.stiffness(springs, here), system.n_pressure)


def _norm(x: Array) -> float:
    return math.sqrt(x @ x)
