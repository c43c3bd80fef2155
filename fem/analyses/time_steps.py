"""One time step of a viscoelastic body under a plate or a grip, in units of D and E.

A step is one equilibrium of an elastic body with another modulus and a known stress (`fem.model.viscoelasticity`), so
contact and friction are those of `load_increments`. It starts from the polynomial in time through the last states of
a smooth motion. The plate's springs keep one stiffness, so that they store what they take.

Error of a step: the laws integrate a stress S_iso that is linear in time. Its curvature S'' leaves the error
g_i tau_i^2 c(dt / tau_i) S'' in the overstress of branch i (`viscoelasticity.curvature_weight`), which decays with
tau_i afterwards. By virtual work, an error dS of the stress changes the force along a motion s of the plate by
int dS : (1/2) dC/ds dV, to first order. So each branch carries one number, its error of the force.

Work of the plate, int F dx, and of the stresses, int S : dC/2 dV, are integrated by the same rule, of third order in
the steps: X and Y of int X dY follow the polynomial in time of degree 3 through the last four states of a smooth
motion, of a lower degree at its beginning. In a body of small strain both sides have the same errors, since each
state is in equilibrium; so what remains of their difference comes from large strain, and from points of the skin
that touch within a step.
"""

from __future__ import annotations

import copy
import functools
import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fem.model import coulomb_friction, plate_contact, viscoelasticity
from fem.model.nonlinear_system import System
from fem.model.plate_contact import Plate
from fem.model.viscoelasticity import History, PointState
from fem.results.postprocess import tip_force
from fem.solve.active_set import KeptTangent
from fem.solve.load_increments import find_equilibrium, path_at
from fem.solve.newton import Equilibrium, Stop
from fem.solve.path_state import FIRST_TOUCH, PathState
from geometry.arrays import Array

CERTAINTY = 2.0
"""Estimated error over its leading term: points of the skin that touch within a step add terms beyond it, up to half
of it in presses of the paper's sensor."""
PAST = 3
"""Earlier states that the first guess is extrapolated from, with the present one: a polynomial of degree 3."""


@dataclass(frozen=True, slots=True)
class TimeIntegral:
    """An integral int X dY over time.

    Attributes
    ----------
    samples : time, s, X and Y at the last states of a smooth motion, oldest first.
    base : the integral up to the first sample while all samples of the motion are kept; None later.
    total : the integral up to the last sample.
    """

    samples: tuple[tuple[float, Array, Array], ...]
    base: float | None
    total: float

    def add(self, time: float, x: Array, y: Array) -> TimeIntegral:
        """Return the integral with one sample more, at a later time."""
        samples = (*self.samples[-PAST:], (time, x, y))
        base = self.base if len(self.samples) <= PAST else None
        weights = product_weights(tuple(t for t, _, _ in samples), 0 if base is not None else len(samples) - 2)
        gained = sum(
            weights[a, b] * float(np.vdot(X, Y))
            for a, (_, X, _) in enumerate(samples)
            for b, (_, _, Y) in enumerate(samples)
        )
        return TimeIntegral(samples, base, (self.total if base is None else base) + gained)


def begin(time: float, x: Array, y: Array, total: float = 0.0) -> TimeIntegral:
    """Return an integral at the beginning of a smooth motion, with what it was before."""
    return TimeIntegral(((time, x, y),), total, total)


@functools.lru_cache(maxsize=4)
def product_weights(times: tuple[float, ...], first: int) -> Array:
    """Return w_ab = int L_a dL_b/dt dt from sample `first` to the last one, with Lagrange's polynomials of the times.

    Parameters
    ----------
    times : k times, increasing.

    Returns
    -------
    Array
        (k, k); exact for polynomials of degree k - 1.

    >>> product_weights((0.0, 2.0), 0).tolist()
    [[-0.5, 0.5], [-0.5, 0.5]]
    """
    at = (np.array(times) - times[0]) / (times[-1] - times[0])
    # coefficients (power, a) of the polynomials
    lagrange = np.linalg.inv(np.vander(at, increasing=True))
    points, weights = np.polynomial.legendre.leggauss(len(at))
    start, half = at[first], (1 - at[first]) / 2
    x = start + half * (1 + points)
    powers = np.vander(x, len(at), increasing=True)
    slopes = np.zeros_like(powers)
    slopes[:, 1:] = powers[:, :-1] * np.arange(1, len(at))
    return np.asarray((powers @ lagrange).T @ (half * weights[:, None] * (slopes @ lagrange)))


@dataclass(frozen=True, slots=True)
class PastStep:
    """An earlier state of a smooth motion: time, unknowns, overlap of the skin, and elastic stress."""

    time: float
    q: Array
    overlap: Array
    S: Array


@dataclass(frozen=True, slots=True)
class ViscousState:
    """One state of a path in time.

    Attributes
    ----------
    path : position, unknowns and contact.
    history, points : viscous history, strain and elastic stress at the integration points.
    time : s.
    force : (3,) force along depth and shear x, y, over E D^2.
    work, absorbed : work of the plate, and of the isochoric stresses, since the beginning, over E D^3.
    elastic : energy of the pressures and of the plate's springs.
    axis : (3,) direction of the last motion, up to its sign.
    strain : (6, t, m, q) derivative of C/2 by the motion along the axis; None before any motion.
    errors : (b,) error of the force along the axis that each branch carries.
    largest : largest force along the axis so far.
    past : earlier states of the smooth motion, oldest first.
    iterations : Newton iterations of the last step.
    """

    path: PathState
    history: History
    points: PointState
    time: float
    force: Array
    errors: Array
    work: TimeIntegral
    absorbed: TimeIntegral
    elastic: float = 0.0
    axis: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    strain: Array | None = None
    largest: float = 0.0
    past: tuple[PastStep, ...] = ()
    iterations: int = 0

    @property
    def error(self) -> float:
        """Estimated error of the force along the last motion from the time steps, over E D^2."""
        return CERTAINTY * float(np.abs(self.errors).sum())


def measure(system: System, u: Array) -> PointState:
    """Return strain and elastic stress at the integration points for nodal fields u."""
    return viscoelasticity.measure(system.elements, system.law, system.mu, u)


def _first_measure(path: PathState) -> PointState:
    """Return `measure` of the first state of a system, which prepares the compiled loops that all steps share."""
    path.d.system.admissible(path.q)
    return measure(path.d.system, path.u)


def at_rest(path: PathState, history: History) -> ViscousState:
    """Return the state at time 0 of a path at rest."""
    points = _first_measure(path)
    errors, none = np.zeros(len(history.branches.times)), begin(0.0, np.zeros(3), np.zeros(3))
    return ViscousState(path, history, points, 0.0, np.zeros(3), errors, work=none, absorbed=none)


def raised(state: ViscousState, path: PathState) -> ViscousState:
    """Return the state with the path state of a model that may have harmonics, before a shear."""
    angles, before = len(path.d.elements.angles.theta), state.points.J.shape[0]
    history = state.history if angles == before else state.history.revolve(angles)
    return replace(state, path=path, history=history, points=_first_measure(path), past=(), strain=None)


def with_stiffness(path: PathState, stiffness: float) -> PathState:
    """Return a path state whose plate has this stiffness at its present depth."""
    radius = path.d.shape.R if path.grip else math.sqrt(path.d.shape.R * max(path.position[0], FIRST_TOUCH))
    return replace(path, kappa=stiffness * radius)


def begin_motion(state: ViscousState, direction: Array) -> ViscousState:
    """Return the state before a motion that does not continue the last one, along (3,) or at rest (zeros)."""
    path, size = state.path, float(np.linalg.norm(direction))
    if path.friction is not None and size:
        path = replace(path, friction=coulomb_friction.expect_sticking(path.friction))
    state = replace(state, path=path, past=())
    axis = direction / size if size else state.axis
    if abs(float(axis @ state.axis)) > 1 - 1e-9:
        return state
    return replace(state, axis=axis, strain=None, errors=np.zeros_like(state.errors), largest=0.0)


def advance(
    tangent: KeptTangent, state: ViscousState, position: Array, dt: float, stiffness: float
) -> ViscousState | Stop:
    """Return the state at a position (3,) after a time dt, s, or why there is none.

    Parameters
    ----------
    tangent : tangent of an earlier step.
    stiffness : of the plate's springs, over E / D.
    """
    path = state.path
    overstress = state.history.overstress(dt)
    system = copy.copy(path.d.system)
    system.viscous = overstress
    stepped = replace(path, d=replace(path.d, system=system))
    plate = replace(path.plate_at(position), stiffness=stiffness)
    iterations = 0
    for guess, pressed in _guesses(state, position, dt):
        if path.friction is not None:
            moved = plate_contact.displacements_along_plate(path.skin, system.state(guess).u, plate)
            plate = replace(plate, friction=coulomb_friction.expect_motion(path.friction, moved))
        answer = _solve(tangent, stepped, guess, plate, pressed, near=bool(state.past))
        iterations += answer.iterations
        if answer.converged:
            break
    if not answer.converged:
        return answer.reason
    after = with_stiffness(path_at(path, answer, position, plate), stiffness)
    points = measure(path.d.system, answer.state.u)
    viscous = overstress.energy(points.C, points.J, points.mu)
    elastic = answer.assembly.energy - points.integral(overstress.factor * points.W + viscous)
    return _accept(state, after, points, dt, elastic, iterations)


def with_error_of_first(before: ViscousState, first: ViscousState, second: ViscousState) -> ViscousState:
    """Return the first state of a smooth motion with its error, which only a second, equal step can tell."""
    decay = np.exp((before.time - first.time) / before.history.branches.times)
    gained = (second.errors - decay**2 * before.errors) / (1 + decay)
    return replace(first, errors=decay * before.errors + gained)


def _solve(
    tangent: KeptTangent,
    path: PathState,
    guess: Array,
    plate: Plate,
    pressed: NDArray[np.bool_] | None,
    *,
    near: bool,
) -> Equilibrium:
    """Return the equilibrium of a step; `near`: the step before, of the same motion, had nearly its tangent."""
    # under a grip nothing touches, and friction keeps a stiffness of its own
    keeps = pressed is not None and plate.friction is None and path.stability.is_stable
    if not (near and keeps):
        tangent.drop()
    near = near and (keeps or plate.friction is not None)
    return find_equilibrium(tangent.solver, path, guess, plate, pressed, tangent=tangent if near else None)


def _guesses(state: ViscousState, position: Array, dt: float) -> list[tuple[Array, NDArray[np.bool_] | None]]:
    """Return first guesses of the unknowns and of the points in contact: extrapolated in time, and the last state."""
    path = state.path
    if not state.past or dt == 0:
        # at a corner of the path the last state is the best guess, first with its contact
        return [(path.q, None)] if path.grip else [(path.q, path.overlap > 0), (path.q, None)]
    times = np.array([*(past.time for past in state.past), state.time])
    shares = [np.prod([(state.time + dt - b) / (a - b) for b in times if b != a]) for a in times]
    guess = sum(share * q for share, q in zip(shares, (*(past.q for past in state.past), path.q), strict=True))
    if path.grip:
        return [(np.asarray(guess), None), (path.q, None)]
    last = state.past[-1]
    overlap = path.overlap + dt / (state.time - last.time) * (path.overlap - last.overlap)
    return [(np.asarray(guess), overlap > 0), (path.q, None)]


def _accept(
    state: ViscousState, path: PathState, points: PointState, dt: float, elastic: float, iterations: int
) -> ViscousState:
    if not state.past:
        state = _sampled(state)
    history, moved = state.history.advance(points, dt), path.position - state.path.position
    x, y, z = tip_force(path)
    force, change = np.array([z, x, y]), points.C - state.points.C
    time = state.time + dt
    along = float(moved @ state.axis)
    strain = change / (2 * along) if along else state.strain
    after = replace(
        state,
        path=path,
        history=history,
        points=points,
        time=time,
        force=force,
        elastic=elastic,
        strain=strain,
        largest=max(state.largest, abs(float(force @ state.axis))),
        iterations=iterations,
    )
    if dt == 0:
        return _jumped(state, after)
    past = PastStep(state.time, state.path.q, state.path.overlap, state.points.S)
    return replace(
        after,
        work=state.work.add(time, force, path.position),
        absorbed=state.absorbed.add(time, _total_stress(after), points.C),
        errors=_carry_errors(state, after, dt),
        past=(*state.past, past)[-PAST:],
    )


def _sampled(state: ViscousState) -> ViscousState:
    """Return the state at the beginning of a smooth motion, from which work and stress are integrated."""
    return replace(
        state,
        work=begin(state.time, state.force, state.path.position, state.work.total),
        absorbed=begin(state.time, _total_stress(state), state.points.C, state.absorbed.total),
    )


def _total_stress(state: ViscousState) -> Array:
    """Return half the isochoric stress times the volumes of the points, whose product with dC is energy."""
    return viscoelasticity.TWICE[:, None, None, None] / 2 * state.points.weights * state.history.stress(state.points)


def _jumped(before: ViscousState, after: ViscousState) -> ViscousState:
    """Return the state after a jump, which is elastic: nothing is dissipated but by slip."""
    slip = after.path.dissipated - before.path.dissipated
    gained = after.history.stored(after.points) - before.history.stored(before.points)
    return replace(
        after,
        absorbed=replace(after.absorbed, total=before.absorbed.total + gained),
        work=replace(after.work, total=before.work.total + gained + after.elastic - before.elastic + slip),
    )


def _carry_errors(before: ViscousState, after: ViscousState, dt: float) -> Array:
    branches = before.history.branches
    decayed = np.exp(-dt / branches.times) * before.errors
    if not before.past or after.strain is None:
        return decayed
    last = before.past[-1]
    first, rate = before.time - last.time, (after.points.S - before.points.S) / dt
    curved = 2 * (rate - (before.points.S - last.S) / first) / (dt + first)
    force = after.points.integral(viscoelasticity.contract(curved, after.strain))

    def gained(step: float) -> Array:
        weight = viscoelasticity.curvature_weight(step / branches.times)
        return np.asarray(branches.instantaneous * branches.shares * branches.times**2 * weight * force)

    # the curvature of the first step of a motion is known only after the second one
    earlier = np.exp(-dt / branches.times) * gained(first) if len(before.past) == 1 else 0.0
    return np.asarray(decayed + gained(dt) + earlier)
