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

import functools
from dataclasses import dataclass, field, replace

import numpy as np

from fem.model import coulomb_friction, plate_contact, viscoelasticity
from fem.model.viscoelasticity import History, PointState
from fem.results.postprocess import tip_force
from fem.solve.active_set import KeptTangent
from fem.solve.load_increments import Reached, extrapolate, find_equilibrium, path_at
from fem.solve.path_state import PathState
from geometry.arrays import Array, Mask, read_only

CERTAINTY = 2.0
"""Estimated error over its leading term: points of the skin that touch within a step add terms beyond it, up to half
of it in presses of the paper's sensor."""
PAST = 3
"""Earlier states that the first guess is extrapolated from, with the present one: a polynomial of degree 3."""


@functools.lru_cache(maxsize=4)
def product_weights(times: tuple[float, ...], first: int) -> Array:
    """Return w_ab = int L_a dL_b/dt dt from sample `first` to the last one, with Lagrange's polynomials of the times.

    For k increasing times it is (k, k), and exact for polynomials of degree k - 1.

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
    return read_only(np.asarray((powers @ lagrange).T @ (half * weights[:, None] * (slopes @ lagrange))))


@dataclass(frozen=True, slots=True)
class PastStep:
    """A state of a smooth motion, as the next ones need it.

    time : s.
    q, overlap : unknowns, and overlap of the skin.
    S : elastic stress at the integration points.
    pairs : X and Y of the integrals int X dY that are the work of the plate, and that of the isochoric stresses.
    """

    time: float
    q: Array
    overlap: Array
    S: Array
    pairs: tuple[tuple[Array, Array], tuple[Array, Array]]


@dataclass(frozen=True)
class ViscousState:
    """One state of a path in time.

    path : position, unknowns and contact.
    history, points : viscous history, strain and elastic stress at the integration points.
    errors : (b,) error of the force along the axis that each branch carries.
    time : s.
    step : number of time steps so far.
    force : (3,) force along depth and shear x, y, over E D^2.
    works : (2,) work of the plate, and of the isochoric stresses, since the beginning, over E D^3.
    works_before : the same at the beginning of the smooth motion.
    elastic : energy of the pressures and of the plate's springs.
    axis : (3,) direction of the last motion, up to its sign.
    strain : (6, t, m, q) derivative of C/2 by the motion along the axis; None before any motion.
    largest : largest force along the axis so far.
    past : earlier states of the smooth motion, oldest first.
    """

    path: PathState
    history: History
    points: PointState
    errors: Array
    time: float = 0.0
    step: int = 0
    force: Array = field(default_factory=lambda: np.zeros(3))
    works: Array = field(default_factory=lambda: np.zeros(2))
    works_before: Array = field(default_factory=lambda: np.zeros(2))
    elastic: float = 0.0
    axis: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    strain: Array | None = None
    largest: float = 0.0
    past: tuple[PastStep, ...] = ()

    @property
    def error(self) -> float:
        """Estimated error of the force along the last motion from the time steps, over E D^2."""
        return CERTAINTY * float(np.abs(self.errors).sum())

    @functools.cached_property
    def as_past(self) -> PastStep:
        """What the next states of a smooth motion need of this one."""
        # half the stress times the volumes of the points, whose product with dC is energy
        halves = viscoelasticity.TWICE[:, None, None, None] / 2 * self.points.weights
        absorbed = halves * self.history.stress(self.points), self.points.C
        pairs = (self.force, self.path.position), absorbed
        return PastStep(self.time, self.path.q, self.path.overlap, self.points.S, pairs)


def measure(path: PathState, u: Array) -> PointState:
    """Return strain and elastic stress at the integration points for nodal fields u."""
    system = path.d.system
    return viscoelasticity.measure(system.elements, system.law, system.mu, u)


def raised(state: ViscousState, path: PathState) -> ViscousState:
    """Return the state with the path state of a model that may have harmonics, before a shear."""
    angles, before = len(path.d.elements.angles.theta), state.points.J.shape[0]
    history = state.history if angles == before else state.history.revolve(angles)
    return replace(state, path=path, history=history, points=measure(path, path.u), past=(), strain=None)


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


def advance(tangent: KeptTangent, state: ViscousState, position: Array, dt: float) -> Reached[ViscousState]:
    """Move to a position (3,) in a time dt, s; `tangent` is that of an earlier step."""
    path, overstress = state.path, state.history.overstress(dt)
    stepped = replace(path, d=replace(path.d, system=path.d.system.with_viscous(overstress)))
    plate, iterations = path.plate_at(position), 0
    for guess, pressed in _guesses(state, dt):
        if path.friction is not None:
            moved = plate_contact.displacements_along_plate(path.skin, path.d.system.state(guess).u, plate)
            plate = replace(plate, friction=coulomb_friction.expect_motion(path.friction, moved))
        # under a grip nothing touches, and friction keeps a stiffness of its own
        keeps = pressed is not None and plate.friction is None and path.stability.is_stable
        if not (state.past and keeps):
            tangent.drop()
        # the step before, of the same motion, had nearly this tangent
        near = bool(state.past) and (keeps or plate.friction is not None)
        answer = find_equilibrium(tangent, stepped, guess, plate, pressed, keeps_long=near)
        iterations += answer.iterations
        if answer.converged:
            break
    if not answer.converged:
        return Reached(replace(state, past=()), answer.reason, iterations)
    points = measure(path, answer.state.u)
    viscous = overstress.energy(points.C, points.J, points.mu)
    elastic = answer.assembly.energy - points.integral(overstress.factor * points.W + viscous)
    return Reached(_accept(state, path_at(path, answer, position, plate), points, dt, elastic), "", iterations)


def with_error_of_first(before: ViscousState, first: ViscousState, second: ViscousState) -> ViscousState:
    """Return the first state of a smooth motion with its error, which only a second, equal step can tell."""
    decay = np.exp((before.time - first.time) / before.history.times)
    gained = (second.errors - decay**2 * before.errors) / (1 + decay)
    return replace(first, errors=decay * before.errors + gained)


def _guesses(state: ViscousState, dt: float) -> list[tuple[Array, Mask | None]]:
    """Return first guesses of the unknowns and of the points in contact: extrapolated in time, and the last state."""
    path, guess = state.path, state.path.q
    overlap = None if path.grip else path.overlap
    # at a corner of the path the last state is the best guess, first with its contact
    if state.past and dt:
        times = [*(past.time for past in state.past), state.time]
        guess = extrapolate(times, [*(past.q for past in state.past), path.q], state.time + dt)
        last = state.past[-1]
        if overlap is not None:
            overlap = overlap + dt / (state.time - last.time) * (overlap - last.overlap)
    return [(guess, None if overlap is None else overlap > 0), (path.q, None)]


def _accept(state: ViscousState, path: PathState, points: PointState, dt: float, elastic: float) -> ViscousState:
    history, moved = state.history.advance(points, dt), path.position - state.path.position
    x, y, z = tip_force(path)
    force, along = np.array([z, x, y]), float(moved @ state.axis)
    after = replace(
        state,
        path=path,
        history=history,
        points=points,
        time=state.time + dt,
        step=state.step + 1,
        force=force,
        elastic=elastic,
        strain=(points.C - state.points.C) / (2 * along) if along else state.strain,
        largest=max(state.largest, abs(float(force @ state.axis))),
    )
    if dt == 0:  # a jump is elastic: nothing is dissipated but by slip
        gained = after.history.stored(points) - state.history.stored(state.points)
        slip = path.dissipated - state.path.dissipated
        return replace(after, works=state.works + np.array([gained + elastic - state.elastic + slip, gained]))
    # while all states of a motion are kept, all of it is integrated again
    again = len(state.past) < PAST
    before = state.works_before if state.past else state.works
    past = (*state.past, state.as_past)[-PAST:]
    return replace(
        after,
        works=(before if again else state.works) + _gained((*past, after.as_past), 0 if again else -2),
        works_before=before,
        errors=_carry_errors(state, after, dt),
        past=past,
    )


def _gained(states: tuple[PastStep, ...], first: int) -> Array:
    """Return both works (2,) from the state number `first` to the last one."""
    weights, count = product_weights(tuple(state.time for state in states), first % len(states)), len(states)
    pairs = [state.pairs for state in states]
    return np.array(
        [
            sum(weights[a, b] * np.vdot(pairs[a][k][0], pairs[b][k][1]) for a, b in np.ndindex(count, count))
            for k in (0, 1)
        ]
    )


def _carry_errors(before: ViscousState, after: ViscousState, dt: float) -> Array:
    times, moduli = before.history.times, before.history.moduli
    decayed = np.exp(-dt / times) * before.errors
    if not before.past or after.strain is None:
        return decayed
    last = before.past[-1]
    first, rate = before.time - last.time, (after.points.S - before.points.S) / dt
    curved = 2 * (rate - (before.points.S - last.S) / first) / (dt + first)
    force = after.points.integral(viscoelasticity.contract(curved, after.strain))

    def gained(step: float) -> Array:
        return np.asarray(moduli * times**2 * viscoelasticity.curvature_weight(step / times) * force)

    # the curvature of the first step of a motion is known only after the second one
    earlier = np.exp(-dt / times) * gained(first) if len(before.past) == 1 else 0.0
    return np.asarray(decayed + gained(dt) + earlier)
