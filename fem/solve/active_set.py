"""Contact within one step of Newton's method: the set of touching points is solved for on the linearised body.

A plain step treats the springs of the points that touch as given. Where other points touch after the step, or some of
these have separated, their springs switch. Stiff springs keep switching: the edge of a sheared tip's contact took six
or seven steps to settle. Here the linear complementarity problem of the step,

    K dq + r + sum_i s_i <g_i> B_i = 0,    g = g(q) + B dq,

is solved completely. K and r are the stiffness and residual of the body without the springs; s_i is the stiffness of
a point's spring and g_i its overlap with the plate. Springs that switch act as forces on the factorised body. With K'
the tangent including the springs of the points in contact so far, the compliance G = B K'^-1 B^T and the overlaps g0
after the plain step, g = g0 + G e, where e = s g for a spring that is removed and e = -s g for one that is added. The
set of pressed points is replaced by the set with g > 0 until the two agree (Hintermueller, Ito and Kunisch, SIAM J.
Optim. 13, 2003: a primal-dual active set). Where that cycles, one point at a time is exchanged, which always ends
(block principal pivoting: Judice and Pires, Comput. Oper. Res. 21, 1994).

Many points may depend on few unknowns: those of a section's facet, at all angles, on the unknowns of its three nodes.
The compliance S of these unknowns is then computed, and G = C S C^T with the derivatives C of the points' overlaps by
them. All systems of equations have the size of S.

With friction the tangential springs depend on the pressure; plain steps are then taken.

The tangent may be that of an earlier iterate, or of an earlier state of a path. Its springs are those of other points
then: the residual is written with the springs of the tangent, and the contact of the whole step is settled about it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fem.model import plate_contact
from fem.model.nonlinear_system import Assembly, State, System
from fem.model.plate_contact import Plate
from fem.solution import UNKNOWN, Stability
from fem.solve.direct_solver import Solver
from geometry.arrays import Array, Ints, Mask

MOST_POINTS, MOST_SOLID, MOST_ROUNDS, MOST_EXCHANGES, BLOCK_EXCHANGES = 600, 50, 4, 100, 3
"""Limits: points that may switch on sections (MOST_POINTS), where under a tilted plate the points at all angles
switch one by one and plain steps do not settle; and in tetrahedra (MOST_SOLID), where solving for them costs as much
as one or two plain steps; rounds, and exchanges of the set in each round; and exchanges of all wrong points that do
not reduce their number before one point at a time is exchanged."""
UNDAMPED = 6
"""Full steps of Newton's method before steps that do not halve the residual are compared with shorter ones. In the
first steps the contact still changes, and a residual that grows once is no sign of divergence."""
AT_STATE, NEAR_GUESS = 1e-4, 0.1
"""Largest differences of displacements, over the largest one, between the state of a tangent and one whose stability
it tells, if both have the same contact; and a first guess from which it serves for a step."""


@dataclass(frozen=True, slots=True)
class _Compliance:
    """Displacements by unit forces that span the pressures on all points that may switch.

    by_unknown : whether the forces act on single unknowns; otherwise each is the pressure on one point.
    forces : (r,) numbers of these unknowns or points.
    Z : (n, r) displacements by the forces.
    S : (r, r) work of each force along the displacements by each.
    C : (m, r) pressures on the points, in terms of the forces.
    """

    by_unknown: bool
    forces: Ints
    Z: Array
    S: Array
    C: Array


@dataclass(slots=True)
class Switches:
    """Points (m,) of the skin that may switch, in the order in which they were added, and their compliance."""

    points: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    compliance: _Compliance | None = None


@dataclass(slots=True)
class KeptTangent:
    """A solver with a factorised tangent, which states of a path that change little may keep.

    displacements, plate : those of the state that it is of; None without one.
    pressed : (k, q) mask of the points whose springs the tangent has; None without one.
    switches : other points, with their compliance by this tangent.
    stability : that of the tangent.
    """

    solver: Solver = field(default_factory=Solver)
    displacements: Array | None = None
    plate: Plate | None = None
    pressed: Mask | None = None
    switches: Switches = field(default_factory=Switches)
    stability: Stability = UNKNOWN

    def drop(self) -> None:
        self.displacements, self.plate, self.pressed = None, None, None
        self.switches, self.stability = Switches(), UNKNOWN

    def is_within(self, share: float, displacements: Array) -> bool:
        """Return whether it is that of a state with nearly these displacements, up to a share of the largest one."""
        own = self.displacements
        if own is None or own.shape != displacements.shape:
            return False
        return bool(np.abs(own - displacements).max() <= share * np.abs(displacements).max())

    def is_near(self, guess: State, plate: Plate) -> bool:
        """Return whether it serves for a step from a first guess, under a plate that has moved sideways at most."""
        last = self.plate
        if last is None or last.friction is not None or last.bond is not plate.bond:
            return False
        return last.stiffness == plate.stiffness and self.is_within(NEAR_GUESS, guess.u)


class ActiveSet:
    """The steps of `fem.solve.newton.iterate` with the active set of the module docstring, settled in each step.

    Coulomb friction without it being condensed (tetrahedra) takes plain steps.

    tangent : solver with the tangent of an earlier state near the first guess, which serves for the first step, or
        with nothing. A tangent serves only if it is known to have no unstable direction: a body that lost its
        stability meanwhile would not converge with it along that direction.
    plate, pressed : see `fem.solve.newton.newton`.
    keeps_long : whether the tangent of an earlier state is kept for long.
    """

    def __init__(
        self, system: System, tangent: KeptTangent, plate: Plate | None, pressed: Mask | None, *, keeps_long: bool
    ) -> None:
        self.system, self._tangent, self._plate, self._first = system, tangent, plate, pressed
        self._keeps_long, self._has_tangent = keeps_long, tangent.stability.is_stable

    @property
    def stability(self) -> Stability:
        """Stability that the last tangent tells, as far as it is known."""
        return self._tangent.stability

    @property
    def keeps(self) -> bool:
        """Whether the factorisation of an earlier state near this one is kept for long."""
        return self._keeps_long and self.stability.is_stable

    @property
    def confirms(self) -> bool:
        """Whether only the residual after a last step tells that the contact is settled."""
        return self._plate is not None and self._plate.friction is not None

    def knows(self, state: State) -> bool:
        """Return whether a factorisation serves for a step from a state."""
        del state
        return self._has_tangent

    def assemble(self, state: State, *, tangent: bool) -> Assembly:
        plate, chosen = self._plate, self._first
        if plate is not None and chosen is not None and tangent:
            plate = replace(plate, pressed=chosen)
        return self.system.assemble(state, plate, tangent=tangent)

    def is_settled(self, state: State) -> bool:
        """Return whether the contact in the residual is that of the state itself."""
        self._plate, held = plate_contact.hold_reversing_points(self.system.surface, state.u, self._plate)
        # an iterate whose contact points were only a guess cannot be the solution yet
        return not held and (self._first is None or self._has_tangent)

    def factorise(self, state: State, assembly: Assembly) -> None:
        tangent, system = self._tangent, self.system
        tangent.drop()
        tangent.solver.factorise(assembly.tangent, symmetric=assembly.symmetric, single=True)
        tangent.stability = tangent.solver.stability(system.n_pressure)
        tangent.displacements, tangent.plate, tangent.pressed = state.u, self._plate, assembly.pressed
        self._has_tangent = True

    def step(self, state: State, assembly: Assembly) -> Array:
        """Return the unknowns after a step with its contact settled."""
        tangent, plate, residual = self._tangent, self._plate, assembly.residual
        self._first = None
        if plate is None or plate.height is None or plate.friction is not None:
            return state.q - tangent.solver.solve(residual)
        if assembly.matrix is None:
            residual = self._with_springs_of_tangent(state, assembly)
        return settle_contact(self.system, tangent, state.q - tangent.solver.solve(residual), plate)

    def final_stability(self, state: State, assembly: Assembly | None = None, *, passed: bool = False) -> Stability:
        # a tangent that steps in time keep is not replaced by that of each state, and a state that is only passed
        # needs no verdict of its own: both are asked again only where they know nothing or seem unstable
        serves = self.knows(state) and (passed or self.keeps) and not self.stability.is_unstable
        if not serves and not self._is_of(state):
            known = assembly if assembly is not None and assembly.matrix is not None else None
            self.factorise(state, known or self.assemble(state, tangent=True))
        return self.stability

    def _is_of(self, state: State) -> bool:
        """Return whether the tangent tells the stability of a state: one that is stable is that of all close by."""
        tangent, plate = self._tangent, self._plate
        if tangent.displacements is state.u or not tangent.stability.is_stable:
            return tangent.displacements is state.u
        if not tangent.is_within(AT_STATE, state.u):
            return False
        if plate is None or tangent.pressed is None:
            return True
        tied = False if plate.bond is None else plate.bond.tied
        here = plate_contact.overlap(self.system.skin, state.u, plate) > 0
        return np.array_equal(here | tied, tangent.pressed | tied)

    def _with_springs_of_tangent(self, state: State, assembly: Assembly) -> Array:
        """Return the residual with the springs of the points whose springs the tangent has."""
        system, surface, plate, pressed = self.system, self.system.skin, self._plate, self._tangent.pressed
        assert plate is not None
        assert pressed is not None
        assert assembly.pressed is not None
        if np.array_equal(assembly.pressed, pressed):
            return assembly.residual
        of_tangent, acting = (
            plate_contact.assemble_springs(surface, state.u, springs, tangent=False)[0]
            for springs in (replace(plate, pressed=pressed), plate)
        )
        residual = assembly.residual.copy()
        residual[: system.n_free] += surface.add_up(of_tangent - acting, len(state.u))[system.free]
        return residual


def settle_contact(system: System, tangent: KeptTangent, plain: Array, plate: Plate) -> Array:
    """Return the unknowns (n,) that a plain step leads to, with its contact settled.

    They stay as they are where the problem is too large to pay off, or has no solution.

    tangent : of the step; points whose compliance is needed are added to its `switches`.
    """
    surface, known = system.skin, tangent.switches
    assert tangent.pressed is not None
    acting = tangent.pressed.ravel()
    loose = np.ones(len(acting), dtype=bool) if plate.bond is None else ~plate.bond.tied.ravel()
    spring_stiffness = (plate.stiffness * surface.weights).ravel()
    before = plate_contact.overlap(surface, system.state(plain).u, plate).ravel()
    settled, now = plain, before
    most = MOST_SOLID if system.elements.dim == 3 else MOST_POINTS
    for turn in range(MOST_ROUNDS):
        # tied points keep their springs; a point that switched before is already in the set
        flips = loose & ((now > 0) != acting)
        switched = turn == 0 and bool(flips[known.points].any())
        flips[known.points] = False
        new = np.flatnonzero(flips)
        if not len(new) and not switched:
            break
        if len(known.points) + len(new) > most:
            return plain
        if len(new):
            known.points = np.append(known.points, new)
            known.compliance = _extend(known.compliance, system, tangent.solver, known.points, plate)
        assert known.compliance is not None
        points, S, C = known.points, known.compliance.S, known.compliance.C
        force = _exchange(S, C, before[points], acting[points], spring_stiffness[points], now[points] > 0)
        if force is None:
            return plain
        settled = plain + known.compliance.Z @ force
        now = plate_contact.overlap(surface, system.state(settled).u, plate).ravel()
    return settled


def _extend(before: _Compliance | None, system: System, solver: Solver, points: Ints, plate: Plate) -> _Compliance:
    """Return the compliance of points (m,), which begin with those of `before`."""
    unknowns, rows = normal_displacements(system, points, plate)
    if before is None:
        before = _Compliance(len(unknowns) < len(points), points[:0], np.empty((system.size, 0)), rows[:0], rows[:0])
    forces, done = unknowns if before.by_unknown else points, len(before.forces)
    if done:
        forces = np.concatenate([before.forces, np.setdiff1d(forces, before.forces)])
    count = len(forces)
    right = np.zeros((system.size, count - done), order="F")
    if before.by_unknown:
        right[forces[done:], np.arange(count - done)] = 1
    else:
        right[unknowns] = rows[done:].T
    # the unknowns of the new points may all be among those of earlier ones
    Z = before.Z if count == done else np.hstack([before.Z, solver.solve(right)]) if done else solver.solve(right)
    if before.by_unknown:
        return _Compliance(True, forces, Z, Z[forces], rows[:, np.searchsorted(unknowns, forces)])
    return _Compliance(False, forces, Z, rows @ Z[unknowns], np.eye(count))


def _exchange(S: Array, C: Array, plain: Array, acting: Mask, spring_stiffness: Array, pressed: Mask) -> Array | None:
    """Return the unit forces (r,) that replace the springs that switch.

    None if the set does not settle, or the body would be unstable without the springs that are removed.

    S, C : see `_Compliance`; the points' compliance is G = C S C^T.
    plain : (m,) overlaps after the plain step.
    acting : (m,) mask of the springs in the factorised tangent.
    spring_stiffness : (m,) stiffness of the springs.
    pressed : (m,) mask of the points that are pressed at first.
    """
    spring, least, exchanges = np.where(acting, spring_stiffness, -spring_stiffness), len(plain) + 1, BLOCK_EXCHANGES
    for _ in range(MOST_EXCHANGES):
        flips = spring * (pressed != acting)
        # the forces f = C^T e of e = flips g on the points, where g = plain + C S f
        weighted = C.T * flips
        try:
            force = np.linalg.solve(np.eye(len(S)) - weighted @ C @ S, weighted @ plain)
        except np.linalg.LinAlgError:
            return None
        after = plain + C @ (S @ force) > 0
        wrong = np.flatnonzero(after != pressed)
        if not len(wrong):
            return np.asarray(force)
        # all wrong points at once mostly settle in a few exchanges, but may cycle; one at a time never does
        exchanges = BLOCK_EXCHANGES if len(wrong) < least else exchanges - 1
        least = min(least, len(wrong))
        if exchanges >= 0:
            pressed = after
        else:
            pressed = pressed.copy()
            pressed[wrong[-1]] ^= True
    return None


def normal_displacements(system: System, points: Ints, plate: Plate) -> tuple[Ints, Array]:
    """Return the unknowns (s,), rising, on which displacements of points (m,) along the normal depend, and the
    derivatives (m, s) by them.
    """
    s = system.skin
    facet, point = np.divmod(points, s.weights.shape[1])
    along = s.shape[point][:, :, None] * (plate.frame[2] @ s.E[point])[:, None, :]
    where, along = system.unknown_numbers[s.nodes[facet]].reshape(len(points), -1), along.reshape(len(points), -1)
    row, column = np.nonzero((where >= 0) & (along != 0))
    used = np.zeros(system.n_free, dtype=bool)
    used[where[row, column]] = True
    unknowns = np.flatnonzero(used)
    derivatives = np.zeros((len(points), len(unknowns)))
    derivatives[row, np.searchsorted(unknowns, where[row, column])] = along[row, column]
    return unknowns, derivatives
