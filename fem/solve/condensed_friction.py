"""Coulomb friction on a section, settled within each step of Newton's method.

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

from fem.model import plate_contact
from fem.model.coulomb_friction import Friction
from fem.model.elements import Surface
from fem.model.nonlinear_system import Assembly, State, System
from fem.model.plate_contact import Plate, Springs
from fem.solution import UNKNOWN, Stability
from fem.solve.active_set import UNDAMPED
from fem.solve.direct_solver import Solver, norm
from geometry.arrays import Array, Ints, Mask

RINGS = 3
"""Facets on each side of the contact whose unknowns are kept, so that the contact can grow; one is the least."""
MOST_SETTLING, SETTLED = 60, 1e-12
"""Most iterations of the condensed problem, and its tolerance over the forces on its unknowns."""


@dataclass(frozen=True, slots=True)
class ContactZone:
    """Facets at and around the contact, and their c unknowns.

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
        f, near = plate.friction, self.facets
        assert f is not None
        anchor = None if f.anchor is None else f.anchor[near]
        friction = Friction(f.mu, f.displacement[near], f.traction[near], f.pressure[near], f.slipping[near], anchor)
        return replace(plate, pressed=None if plate.pressed is None else plate.pressed[near], friction=friction)

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
        at = self.local[self.surface.nodes].reshape(len(blocks), -1)
        pairs = (at[:, :, None] * c + at[:, None, :]).ravel()
        matrix = np.bincount(pairs, weights=blocks.ravel(), minlength=c * c).reshape(c, c)
        return np.asarray(matrix[:-1, :-1], dtype=np.float64)


class CondensedFriction:
    """The steps of `fem.solve.newton.iterate` on a section under a plate with Coulomb friction.

    plate, pressed : see `fem.solve.newton.newton`.
    keeps_long : start with the stiffness that the solver condensed for an earlier state near this one, and keep it
        until one at a later iterate is needed.
    """

    confirms = True

    def __init__(
        self, system: System, solver: Solver, plate: Plate, pressed: Mask | None, *, keeps_long: bool
    ) -> None:
        self.system, self._solver, self._plate, self._first = system, solver, plate, pressed
        self.keeps, self.stability = keeps_long, UNKNOWN
        self._zone: ContactZone | None = None

    def knows(self, state: State) -> bool:
        if self._zone is None:
            if self.keeps and self._solver.schur is not None:
                zone = self._choose_zone(state)
                self._zone = zone if np.array_equal(zone.unknowns, self._solver.outer) else None
            self.keeps = self._zone is not None
            return self.keeps
        return bool(self._zone.facets[_touching(self.system, state, self._plate)].all())

    def assemble(self, state: State, *, tangent: bool) -> Assembly:
        """Return the whole residual, and with `tangent` the stiffness of the body without the plate."""
        s, plate = self.system.skin, self._plate
        # a plate that touches no point: the base, which has springs too, belongs to the body
        away = replace(plate, pressed=np.zeros(s.weights.shape, dtype=bool), friction=None)
        body = self.system.assemble(state, away, tangent=tangent)
        springs = plate_contact.springs(s, state.u, plate)
        forces = s.add_up(s.forces(springs.traction), len(body.forces))
        residual = body.residual.copy()
        residual[: self.system.n_free] += forces[self.system.free]
        energy = body.energy + springs.energy
        return Assembly(residual, energy, body.forces + forces, body.matrix, without_plate=body.residual)

    def is_settled(self, state: State) -> bool:
        del state
        return self._zone is not None

    def factorise(self, state: State, assembly: Assembly) -> None:
        self.keeps, self._zone = False, self._choose_zone(state)
        self._solver.condense(assembly.tangent, self._zone.unknowns)

    def step(self, state: State, assembly: Assembly) -> Array | None:
        """Return the unknowns after a step with its contact settled; None where that fails, or the body needs other
        pivots."""
        zone, solver, residual = self._zone, self._solver, assembly.without_plate
        assert zone is not None
        assert residual is not None
        if solver.schur is None:
            return None
        half, pressed, self._first = solver.forward(-residual), self._first, None
        y = settle(solver.schur, half[zone.unknowns], zone, state.u[zone.nodes], self._plate, pressed)
        return None if y is None else state.q + solver.backward(half, y)

    def final_stability(self, state: State, assembly: Assembly | None = None, *, passed: bool = False) -> Stability:
        del assembly
        stability = self._measure_stability(state)
        # counted with an earlier stiffness of the body, which may be far from here
        serves = stability.is_unknown or (stability.is_stable and (passed or self.keeps))
        if not serves:
            assert self._zone is not None
            self._solver.condense(self.assemble(state, tangent=True).tangent, self._zone.unknowns)
            stability = self._measure_stability(state)
        return stability

    def _measure_stability(self, state: State) -> Stability:
        """Return the stability of a state; unknown where a point slips, for then its stiffness is unsymmetric."""
        zone, schur = self._zone, self._solver.schur
        assert zone is not None
        here = zone.restrict(self._plate)
        springs = zone.springs(state.u[zone.nodes], np.zeros(len(zone.unknowns)), here)
        if schur is None or springs.friction is None or springs.friction.slipping.any():
            return UNKNOWN
        return self._solver.stability_with(schur, zone.stiffness(springs, here), self.system.n_pressure)

    def _choose_zone(self, state: State) -> ContactZone:
        """Return the zone of a state: that of the last condensation while it is wide enough and not much too wide."""
        system, outer_unknowns = self.system, self._solver.outer
        assert self._plate.friction is not None
        touching = _touching(system, state, self._plate) | self._plate.friction.touching.any(axis=1)
        if self._first is not None:
            touching = touching | self._first.any(axis=1)
        condensed = np.zeros(system.size + 1, dtype=bool)
        condensed[outer_unknowns] = condensed[-1] = True
        known = np.asarray(condensed[system.unknown_numbers[system.skin.nodes]].all(axis=(1, 2)))
        wanted = contact_zone(system, touching)
        wide = known[contact_zone(system, touching, rings=1).facets].all()
        if wide and len(outer_unknowns) <= 2 * len(wanted.unknowns):
            return contact_zone(system, known, rings=0)
        return wanted


def settle(
    schur: Array, load: Array, zone: ContactZone, u: Array, plate: Plate, pressed: Mask | None = None
) -> Array | None:
    """Solve S y + f(u + y) = b for the change y (c,) of the unknowns near the contact; None if that fails.

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
        now = norm(residual)
        friction = springs.friction
        assert friction is not None
        if plate.pressed is None and not friction.held and now <= SETTLED * (norm(force) + norm(load)):
            return y
        if iteration > UNDAMPED and now > last / 2:
            y, springs, residual = _shorten(schur, load, zone, u, plate, y, step)
            now = norm(residual)
        last = now
        try:
            step = np.asarray(np.linalg.solve(schur + zone.stiffness(springs, plate), residual))
        except np.linalg.LinAlgError:
            return None
        y = y - step
        assert plate.friction is not None
        # see `plate_contact.hold_reversing_points`
        plate = replace(plate, pressed=None, friction=replace(plate.friction, slip_direction=friction.direction))
    return None


def contact_zone(system: System, touching: Mask, rings: int = RINGS) -> ContactZone:
    """Return the facets that touch, by a mask (k,), and `rings` of neighbours around them."""
    s, facets = system.skin, touching
    for _ in range(rings):
        inside = np.zeros(len(system.elements.nodes), dtype=bool)
        inside[s.nodes[facets]] = True
        facets = np.asarray(inside[s.nodes].any(axis=1))
    nodes, numbers_here = np.unique(s.nodes[facets], return_inverse=True)
    surface = replace(
        s, nodes=numbers_here.reshape(-1, s.nodes.shape[1]), weights=s.weights[facets], points=s.points[facets]
    )
    numbers = system.unknown_numbers[nodes]
    unknowns = np.unique(numbers[numbers >= 0])
    local = np.where(numbers >= 0, np.searchsorted(unknowns, numbers), len(unknowns))
    return ContactZone(facets, surface, nodes, unknowns, local)


def _touching(system: System, state: State, plate: Plate) -> Mask:
    """Return the mask (k,) of the facets that touch the plate; the nearest one where none does."""
    g = plate_contact.overlap(system.skin, state.u, plate).max(axis=1)
    return np.asarray(g >= min(g.max(), 0.0))


def _shorten(
    schur: Array, load: Array, zone: ContactZone, u: Array, plate: Plate, y: Array, step: Array
) -> tuple[Array, Springs, Array]:
    """Return the best of a full step to y, its half and its quarter, with springs and residual there."""
    tried = []
    for back in (0.0, 0.5, 0.75):
        shorter = y + back * step
        springs = zone.springs(u, shorter, plate)
        tried.append((shorter, springs, schur @ shorter + zone.forces(springs) - load))
    return min(tried, key=lambda trial: norm(trial[2]))
