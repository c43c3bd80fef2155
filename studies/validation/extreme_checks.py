"""Checks of the cases of `extremes`: each measures one number of a case's states, which must not exceed a bound.

Some checks are independent of the solver: Hertz's F = 4/3 E / (1 - nu^2) sqrt(R) d^1.5 at first touch; the work of
the applied force, the integral of F ds by Simpson's rule, against the energy gained; the uniform bar by which a long
slender beam exceeds a short one. Others compare two solves: similarity, the order of stiffness, the limit of nu,
another path or model to the same state.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from fem.accuracy import Accuracy
from fem.equilibrium import trace
from fem.scene import Model
from fem.solution import Solution
from geometry.design import LEAST_WALL, Design, Shape, paper
from geometry.loads import Load, Magnet

LENGTHS = ("D", "L", "f", "l0", "c", "magnet_diameter", "magnet_height", "magnet_edge_radius")
"""Fields of a design that are lengths, for similarity."""
HEIGHTS = (0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
"""Heights of the smaller magnets beside the largest, mm."""
WIDE = 3.0
"""Factor by which the inverted share on a finer grid of points may exceed the share that the state reports."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """One measurement of a case.

    Attributes
    ----------
    solution : the case's last state; None if the case is refused.
    check : measured quantity, or the reason why there is no measurement.
    measured : the measured number; None if there is none.
    bound : its largest allowed value; None for the case's own bound.
    """

    solution: Solution | None
    check: str
    measured: float | None
    bound: float | None = None


@dataclass(frozen=True, slots=True)
class Case:
    """One extreme case: a path of loads on a design, its check and its expected statuses.

    Attributes
    ----------
    loads : the path; the last load is the extreme one.
    changes : fields that differ from the paper's design.
    measure : check of the states, used if the path reaches its last load.
    bound : largest value that the check allows.
    ends : expected statuses. If the path stops, or becomes unstable although "ok" is not expected, the last state is
        checked instead (`stopped`, `onset`).
    """

    name: str
    loads: tuple[Load, ...]
    measure: Measure
    bound: float
    accuracy: Accuracy
    changes: Mapping[str, float] = field(default_factory=dict)
    magnet: Magnet = "rigid"
    model: Model = "auto"
    ends: tuple[str, ...] = ("ok",)

    @property
    def design(self) -> Design:
        return replace(paper(), **self.changes)  # type: ignore[arg-type]


Measure = Callable[[Case, Sequence[Solution]], Measurement]


def press(*depths: float) -> tuple[Load, ...]:
    """Return a path of presses to these depths, mm."""
    return tuple(Load(depth=depth) for depth in depths)


class StoppedError(Exception):
    """A path did not reach its last load; `solution` is its last state."""

    def __init__(self, solution: Solution) -> None:
        super().__init__(solution.message)
        self.solution = solution


def path(case: Case) -> list[Solution]:
    """Solve the case's own path, to its last load or to the state where it stopped."""
    return trace(case.design, case.loads, case.accuracy, magnet=case.magnet, model=case.model, estimate=False)


def follow(case: Case, loads: Sequence[Load] | None = None, **other: object) -> list[Solution]:
    """Solve a path to compare with, which differs from the case in loads, changes, magnet or model.

    Raises
    ------
    StoppedError
        The path stopped before its last load.
    """
    states = path(replace(case, loads=tuple(loads or case.loads), **other))  # type: ignore[arg-type]
    if states[-1].status not in ("ok", "unstable"):
        raise StoppedError(states[-1])
    return states


def force(solution: Solution) -> float:
    """Return the normal force, N."""
    return solution.response.force[2]


def off(value: float, reference: float) -> float:
    """Return the magnitude of the relative difference; infinite for a reference of 0 or without a finite value."""
    error = abs(value / reference - 1) if reference else math.inf
    return error if math.isfinite(error) else math.inf


def hertz(case: Case, states: Sequence[Solution]) -> Measurement:
    """Compare the force at first touch with Hertz's."""
    last, design = states[-1], case.design
    reference = 4 / 3 * design.E / (1 - design.nu**2) * math.sqrt(design.R) * last.load.depth**1.5
    return Measurement(last, "force against Hertz 1882", off(force(last), reference))


def work(case: Case, states: Sequence[Solution]) -> Measurement:
    """Compare the work of the applied force between first and last state with the energy gained."""
    if case.loads[0].shear_x == case.loads[-1].shear_x:
        travel, forces = [s.load.depth for s in states], [force(s) for s in states]
    else:
        travel, forces = [s.load.shear_x for s in states], [s.response.force[0] for s in states]
    gained = states[-1].energy - states[0].energy
    return Measurement(states[-1], "work of the force against energy gained", off(simpson(travel, forces), gained))


def cone(_: Case, states: Sequence[Solution]) -> Measurement:
    """Check the friction cone: tangential force over mu times the normal force is 1 at full slip, and never more."""
    last = states[-1]
    x, y, normal = last.response.force
    ratio = math.hypot(x, y) / (float(last.load.friction) * normal) if normal > 0 else math.inf
    short = last.slip_share == 1 and ratio < 1
    check = "tangential force / (mu times normal force), difference from 1"
    return Measurement(last, check, 1 - ratio if short else max(ratio - 1, 0.0))


def simpson(travel: Sequence[float], forces: Sequence[float]) -> float:
    """Integrate forces over travel by Simpson's rule, through an odd number of evenly spaced states.

    >>> simpson([0, 1, 2], [0, 1, 8])
    4.0
    """
    weights = np.array([1.0, *[4.0, 2.0] * (len(travel) // 2)])
    weights[-1] = 1.0
    return float(weights @ np.asarray(forces)) * (travel[-1] - travel[0]) / (len(travel) - 1) / 3


def similarity(case: Case, states: Sequence[Solution]) -> Measurement:
    """Compare force / (E D^2), shift / D and tilt with those of a similar design with the paper's E and D."""
    last, (one, other) = states[-1], (case.design, paper())
    ratio = other.D / one.D
    loads = [replace(load, depth=load.depth * ratio, shear_x=load.shear_x * ratio) for load in case.loads]
    changes = {key: value for key, value in case.changes.items() if key not in (*LENGTHS, "E")}
    match = follow(case, loads, changes=changes)[-1]
    a = np.array([*last.response.force, *last.response.shift, last.response.tilt])
    b = np.array([*match.response.force, *match.response.shift, match.response.tilt])
    b *= [one.E / other.E / ratio**2] * 3 + [1 / ratio] * 3 + [1]
    return Measurement(last, "force / (E D^2) and pose / D against the paper's sensor", _largest_difference(a, b))


def _largest_difference(a: np.ndarray, b: np.ndarray) -> float:
    """Return the largest relative difference of two vectors' components, without those that are 0 in both."""
    pairs = [(x, y) for x, y in zip(a, b, strict=True) if x or y]
    return float(np.max([off(float(x), float(y)) for x, y in pairs]))


def incompressible(case: Case, states: Sequence[Solution]) -> Measurement:
    """Compare the force, which is smooth in 1 - 2 nu, with the straight line through nu = 0.4998 and 0.5."""
    last = states[-1]
    near, limit = (force(follow(case, changes={**case.changes, "nu": nu})[-1]) for nu in (0.4998, 0.5))
    share = (1 - 2 * case.design.nu) / (1 - 2 * 0.4998)
    reference = limit + share * (near - limit)
    return Measurement(last, "force against the line through nu 0.4998 and 0.5", off(force(last), reference))


def bar(case: Case, states: Sequence[Solution]) -> Measurement:
    """Compare a slender beam with its upper half in series with a uniform bar in place of the lower half.

    The stretch s of the bar follows from the force F and the area A by the incompressible neo-Hookean law,
    F / A = E / 3 (s^-2 - s). The upper half, at the remaining depth, must have the same force.
    """
    from scipy.optimize import brentq

    last, design = states[-1], case.design
    stress, half = force(last) / (math.pi * design.R**2), design.L / 2
    s = brentq(lambda s: design.E / 3 * (s**-2 - s) - stress, 0.1, 1.0)
    load = Load(depth=last.load.depth - half * (1 - s))
    shorter = follow(case, [load], changes={**case.changes, "L": half})[-1]
    return Measurement(
        last, "force against half the beam in series with a uniform bar", off(force(shorter), force(last))
    )


def ordered(case: Case, states: Sequence[Solution]) -> Measurement:
    """Check that the force grows with the magnet's height: none, HEIGHTS, then the case's own."""
    softest = force(follow(case, magnet="ignored")[-1])
    smaller = [follow(case, changes={**case.changes, "magnet_height": height})[-1] for height in HEIGHTS]
    forces = [softest, *map(force, smaller), force(states[-1])]
    largest = float(np.max([a / b for a, b in pairwise(forces)]))
    check = f"largest ratio of forces, a magnet over the next larger one, from none to the last of {len(HEIGHTS) + 1}"
    return Measurement(states[-1], check, largest)


def beyond_and_back(case: Case, states: Sequence[Solution]) -> Measurement:
    """Compare force and energy with those of a path that first goes 0.5 mm beyond the last load."""
    return _other_path(case, states, [case.loads[-1].depth + 0.5])


def many_steps(step: float, case: Case, states: Sequence[Solution]) -> Measurement:
    """Compare force and energy with those of a path in steps of this length, mm."""
    first, last = case.loads[0].depth, case.loads[-1].depth
    return _other_path(case, states, [first + step * i for i in range(round((last - first) / step))])


def _other_path(case: Case, states: Sequence[Solution], depths: Sequence[float]) -> Measurement:
    """Compare force and energy with those of a path by other depths to the same last load on the same mesh."""
    other = follow(case, [*press(*depths), case.loads[-1]])[-1]
    check = f"force and energy against a path of {len(depths) + 1} loads"
    return Measurement(states[-1], check, apart(states[-1], other))


def apart(one: Solution, other: Solution) -> float:
    """Return the larger relative difference of two states in force and in energy."""
    forces = (math.hypot(*state.response.force) for state in (one, other))
    return float(np.maximum(off(*forces), off(one.energy, other.energy)))


def alone(case: Case, states: Sequence[Solution]) -> Measurement:
    """Compare the last force of a path with that of its last load alone, on a mesh adapted to this load."""
    last = states[-1]
    other = follow(case, case.loads[-1:])[-1]
    return Measurement(last, "force against that of the last load alone", off(force(last), force(other)))


def half_model(case: Case, states: Sequence[Solution]) -> Measurement:
    """Compare the normal force with that of the half model on tetrahedra."""
    last = states[-1]
    solid = follow(case, model="half")[-1]
    return Measurement(last, "force against the half model", off(force(last), force(solid)))


def folded(_: Case, states: Sequence[Solution]) -> Measurement:
    """Check that the inverted share (J <= 0) at 45 points of each triangle is at most WIDE times the reported one."""
    last = states[-1]
    beyond = folded_share(last) - WIDE * last.facts.inverted_share
    return Measurement(last, f"inverted share, less {WIDE:g} times the reported one", max(beyond, 0.0))


def folded_share(solution: Solution) -> float:
    """Return the share of the undeformed volume that is inverted (J = det F <= 0); section meshes only.

    In the section, det F is the ratio of the Jacobians of the deformed and the undeformed triangle times r / R.
    """
    import skfem

    mesh, nodes = solution.field.mesh, np.asarray(solution.field.mesh.dofs.element_dofs)
    n = 8
    points = np.array([(i / n, j / n) for i in range(n + 1) for j in range(n + 1 - i)]).T
    basis = [skfem.ElementTriP2().lbasis(points, i) for i in range(6)]
    values = np.array([value * np.ones(points.shape[1]) for value, _ in basis])
    slopes = np.array([np.broadcast_to(slope, points.shape) for _, slope in basis])

    def radius_and_area(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        J = np.einsum("cne,njq->cjqe", x[:, nodes], slopes)
        return np.einsum("ne,nq->qe", x[0, nodes], values), J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]

    R, before = radius_and_area(mesh.doflocs)
    r, after = radius_and_area(mesh.doflocs + solution.field.u.T)
    inside_out = (after / before <= 0) | ((r < 0) & (R > 0))
    volume = R * np.abs(before)
    return float(volume[inside_out].sum() / volume.sum())


def largest_height(changes: Mapping[str, float]) -> float:
    """Return the height of the tallest magnet of the design's diameter that leaves the least wall, mm, or 0."""
    values = {name: changes.get(name, getattr(paper(), name)) for name in LENGTHS}
    low, high = 2 * values["magnet_edge_radius"], values["D"]
    for _ in range(60):
        middle = (low + high) / 2
        shape = Shape(values["D"], values["L"], values["magnet_diameter"], middle, values["magnet_edge_radius"])
        low, high = (middle, high) if shape.wall >= LEAST_WALL else (low, middle)
    return low if low > 2 * values["magnet_edge_radius"] else 0.0


# Cases that do not end with status "ok": stopped, unstable, without contact, or refused

SHORT = 0.02
"""Largest share of the load by which a new path to the last converged state may stop before it."""
SAME = 1e-6
"""Largest relative difference of force and energy between the last converged state and a new path to it."""
RUBBED, RUBBED_SHORT = 1e-2, 0.05
"""SAME and SHORT with Coulomb friction, where force and last state depend on the increments of the path."""
FINER, ONSET = 0.7, 0.1
"""Edge length of the finer mesh on which an onset is computed again, over the case's, and the largest relative
difference of the two onsets."""


def stopped(case: Case, end: Solution) -> Measurement:
    """Check the last state of a path that does not end with status "ok"."""
    if end.status == "not_converged":
        return last_good(case, end)
    if end.status == "unstable":
        symmetric = follow(case, [end.load], model="axisymmetric")[-1]
        return Measurement(end, "energy / energy of the symmetric press", end.energy / symmetric.energy, 1.0)
    # without contact: the message recommends the axisymmetric model, whose force at first touch is Hertz's
    touch = hertz(case, follow(case, [end.load], model="axisymmetric"))
    return replace(touch, solution=end, check=f"model that the message recommends: {touch.check}")


def last_good(case: Case, end: Solution) -> Measurement:
    """Compare the last converged state with the end of a new path to its load."""
    before = [load for load in case.loads if _travel(load) < _travel(end.load)]
    check = "last converged state against a new path to it"
    try:
        again = follow(case, [*before, end.load])[-1]
    except StoppedError as stop:
        short = 1 - _travel(stop.solution.load) / _travel(end.load)
        bound = SHORT if end.slip_share is None else RUBBED_SHORT
        return Measurement(end, f"{check}: share of the load by which this stopped before it", short, bound)
    return Measurement(end, check, apart(end, again), SAME if end.slip_share is None else RUBBED)


def refused(case: Case) -> Measurement:
    """Check a refused design: even the tallest magnet that fits must be shorter than its own."""
    largest = largest_height({**case.changes})
    check = "height of the tallest magnet that fits / height of this one"
    return Measurement(None, check, largest / float(case.changes.get("magnet_height", paper().magnet_height)), 1.0)


def onset(case: Case, end: Solution, why: str) -> Measurement:
    """Compare the onset of an instability with that on a finer mesh.

    Beyond the onset there are several equilibria, so that states on two meshes may differ although both are right.

    Parameters
    ----------
    why : check and measurement of the case that did not pass.
    """
    finer = replace(case.accuracy, section_size=FINER * case.accuracy.section_size)
    other = path(replace(case, accuracy=finer))[-1]
    (low, high), there = end.facts.onset_mm or (math.nan, math.nan), other.facts.onset_mm
    check = f"{end.facts.onset} of the onset against a mesh with {FINER:g} times the edge length ({why})"
    if there is None and _travel(other.load) < high:
        return Measurement(end, f"{check}: the path on that mesh stops before it", None)
    gap = math.inf if there is None else max(there[0] - high, low - there[1], 0.0) / high
    return Measurement(end, check, gap, ONSET)


def _travel(load: Load) -> float:
    """Return depth plus shear of a load, mm, which orders the loads of a path."""
    return load.depth + abs(load.shear_x)
