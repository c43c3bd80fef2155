"""Cases at the limits of the input ranges, each with a verdict: a correct result, or a clear status.

Each case measures one number of its states, which must not exceed a bound. Some checks are independent of the solver:
Hertz's F = 4/3 E / (1 - nu^2) sqrt(R) d^1.5 at first touch; the work of the applied force, the integral of F ds by
Simpson's rule, against the energy gained; the uniform bar by which a long slender beam exceeds a short one. Others
compare two solves: similarity, the order of stiffness, the limit of nu, another path or model to the same state.
"""

from __future__ import annotations

import csv
import functools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import skfem
from scipy.integrate import simpson
from scipy.optimize import brentq

from fem.accuracy import QUICK, STANDARD, Accuracy
from fem.equilibrium import trace
from fem.scene import Model
from fem.solution import Solution
from geometry.design import LEAST_WALL, BadInput, Design, Shape, paper
from geometry.loads import Load, Magnet
from geometry.messages import Progress
from studies.output.result import Result, collected
from studies.validation import pages
from studies.validation.pages import Row

NAN = math.nan
FILES = ("EXTREMES.md", "extremes.csv")
CASES = Path(__file__).with_name("extreme_cases.csv")
"""All cases: loads, check and bound, changes of the paper's design, expected statuses. Samples combine extremes at
random; every second of their magnets is the largest that fits."""
BOUNDS = {
    "quick": {"hertz": 0.02, "bar": 0.01, "mesh": 0.03, "shear": 0.01},
    "standard": {"hertz": 0.005, "bar": 0.005, "mesh": 0.01, "shear": 0.005},
}
"""Bounds of the checks that depend on the mesh, by accuracy level."""
NO_MAGNET = {"magnet_diameter": 0.0, "magnet_height": 0.0, "magnet_edge_radius": 0.0}
LENGTHS = ("D", "L", "f", "l0", "c", *NO_MAGNET)
"""Fields of a design that are lengths, for similarity."""
HARMONICS = replace(QUICK, section_size=0.2, harmonics=8)
HEIGHTS = (0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
"""Heights of the smaller magnets beside the largest, mm."""
WIDE, SHORT, SAME = 3.0, 0.02, 1e-6
RUBBED, RUBBED_SHORT = 1e-2, 0.05
"""Factor by which the inverted share on a finer grid of points may exceed that of the state; share of the load by
which a new path to the last state may stop before it, and difference of force and energy; both with friction."""
FINER, ONSET = 0.7, 0.1
"""Edge length of the mesh on which an onset is computed again, over the case's, and how far it may differ."""


class Measurement(NamedTuple):
    """What was measured, or the reason why nothing was (`measured` is NaN); `bound` replaces the case's own."""

    check: str
    measured: float = NAN
    bound: float = NAN

    @property
    def text(self) -> str:
        known = not math.isnan(self.measured)
        return f"{self.check} {self.measured:.3g}, at most {self.bound:.3g}" if known else self.check


@dataclass(frozen=True, slots=True)
class Case:
    """A path of loads, of which the last one is extreme, on a design that differs from the paper's by `changes`.

    `measure` checks the states if the path reaches its last load; `bound` is the largest value it allows. `ends` are
    the expected statuses: if the path stops, or becomes unstable although "ok" is not expected, the last state is
    checked instead (`stopped`, `onset`).
    """

    name: str
    loads: tuple[Load, ...]
    measure: Callable[[Case, Sequence[Solution]], Measurement]
    bound: float
    accuracy: Accuracy
    changes: Mapping[str, float] = field(default_factory=dict)
    magnet: Magnet = "rigid"
    model: Model = "auto"
    ends: tuple[str, ...] = ("ok",)

    @property
    def design(self) -> Design:
        return replace(paper(), **self.changes)  # type: ignore[arg-type]

    def judged(self, found: Measurement, status: str) -> tuple[str, Measurement]:
        """Return the verdict on status and measurement, which must both be right, and the measurement's bound."""
        if math.isnan(found.measured):
            return "not judged" if status in self.ends else "fail", found._replace(bound=NAN)
        found = found._replace(bound=self.bound if math.isnan(found.bound) else found.bound)
        return "pass" if status in self.ends and found.measured <= found.bound else "fail", found


def press(*depths: float) -> tuple[Load, ...]:
    return tuple(Load(depth=depth) for depth in depths)


def cases(*, quick: bool = False) -> list[Case]:
    level = QUICK if quick else STANDARD
    with CASES.open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file, delimiter=";") if not (quick and row["run"] == "full")]
    accuracies = {"": level, "quick": QUICK, "harmonics": HARMONICS}
    found = []
    for row in rows:
        check, *numbers = row["check"].split()
        loads = _loads(*row["loads"].split(), steps=4 if quick else 8)
        measure = functools.partial(globals()[check], *map(float, numbers))
        bound = BOUNDS[level.name].get(row["bound"]) or float(row["bound"])
        more: Any = _changes(row["changes"]), row["magnet"], row["model"], tuple(row["ends"].split())
        found.append(Case(row["scene"], loads, measure, bound, accuracies[row["accuracy"]], *more))
    return found


def _loads(kind: str, *words: str, steps: int) -> tuple[Load, ...]:
    """Return a path of loads in words: depths of presses; or, before the shear, height of a grip, depth, friction."""
    numbers = [float(word) for word in words]
    if kind == "press":
        return press(*numbers)
    if kind == "rub":
        mu, depth, shear = numbers
        return tuple(Load(depth=depth, shear_x=x, friction=mu) for x in (0.0, shear))
    first, farthest = numbers
    shears = (farthest * i / steps for i in range(steps + 1))
    if kind == "grip":
        return tuple(Load(grip=first, shear_x=x) for x in shears)
    return tuple(Load(depth=first, shear_x=x, friction="stick") for x in shears)


def _changes(words: str) -> dict[str, float]:
    """Return the fields that differ from the paper's design; some words stand for several."""
    changes = {name: float(value) for name, value in (word.split("=") for word in words.split())}
    if factor := changes.pop("all_lengths", None):
        changes |= {name: getattr(paper(), name) * factor for name in LENGTHS}
    if changes.pop("no_magnet", None):
        changes |= NO_MAGNET
    if changes.pop("largest_magnet", None):
        changes["magnet_height"] = largest_height({})
    return changes


def run(progress: Progress, *, quick: bool = False) -> Result:
    """Solve cases at the limits of the input ranges; exit status 3 if one ends in a wrong result or status.

    A case that yields no measurement is listed separately; it is no pass either.

    Parameters
    ----------
    quick
        Use accuracy quick and skip the slow cases: one minute.
    """
    chosen = pages.told(progress, cases(quick=quick), lambda case: case.name)
    return collected(map(examine, chosen), functools.partial(result, run="quick" if quick else "full"))


def result(rows: Sequence[Row], run: str = "full") -> Result:
    """Return the result of cases; one that could not be measured is a miss without a value."""
    failed, lost = ([row["scene"] for row in rows if row["verdict"] == name] for name in ("fail", "not judged"))
    page = {"rows": rows, "failed": len(failed), "lost": len(lost)}
    misses = {row["scene"]: row["measured"] for row in rows if not row["passed"]}
    lines = [line(row) for row in rows]
    return pages.study("extremes", "Extremes", rows, page, misses=misses, run=run, shown=lines, digits=9)


def examine(case: Case) -> Row:
    begin = time.perf_counter()
    end, found, status = None, Measurement("none"), "crashed"
    try:
        end, found = measure(case)
        status, message = end.status, end.message
    except BadInput as error:
        # even the tallest magnet that fits must be shorter than its own
        share = largest_height(case.changes) / case.changes.get("magnet_height", paper().magnet_height)
        found = Measurement("height of the tallest magnet that fits / height of this one", share, 1.0)
        status, message = "bad_input", str(error)
    except Exception as error:
        # the study exists to find unforeseen failures, so that every exception becomes a row
        message = f"{type(error).__name__}: {error}"
    verdict, (check, measured, bound) = case.judged(found, status)
    row: Row = {"scene": case.name, "verdict": verdict, "status": status, "message": message}
    row |= {"seconds": time.perf_counter() - begin, "check": check, "measured": measured, "bound": bound}
    row |= {"passed": verdict == "pass", "ends": " ".join(case.ends), "model": end.model if end else case.model}
    row |= {"accuracy": case.accuracy.name, "magnet": case.magnet}
    row |= {"depth_mm": end.load.depth if end else NAN, "shear_mm": end.load.shear_x if end else NAN}
    x, _, z = end.response.force if end else (NAN, NAN, NAN)
    share = folded_share(end) if end and end.model == "axisymmetric" else NAN
    changes = " ".join(f"{name}={value:.9g}" for name, value in case.changes.items())
    return row | {"force_x_N": x, "force_z_N": z, "inside_out_share": share, "changes": changes}


def measure(case: Case) -> tuple[Solution, Measurement]:
    """Return the last state of a case and its measurement: its own check if the path ends well, else of the end."""
    states = path(case)
    end = states[-1]
    reached = end.status == "ok" or (end.status == "unstable" and "ok" in case.ends)
    try:
        found = case.measure(case, states) if reached else stopped(case, end)
    except StoppedError as stop:
        found = Measurement(f"no comparison: the other solve {stop.args[0]}")
    verdict, judged = case.judged(found, end.status)
    # beyond the onset of an instability a failed check proves nothing: the path may have taken another branch
    if end.status in case.ends and verdict != "pass" and end.facts.onset is not None:
        return end, onset(case, end, judged.text)
    return end, found


def line(row: Row) -> str:
    """Return a row as a line of text: `pass  deep: ok in 0.5 s; force 0.0002, at most 0.005`."""
    verdict = "FAIL" if row["verdict"] == "fail" else row["verdict"]
    text = "; ".join(filter(None, [Measurement(row["check"], row["measured"], row["bound"]).text, row["message"]]))
    return f"{verdict}  {row['scene']}: {row['status']} in {row['seconds']:.1f} s; {text}"


# Checks


class StoppedError(Exception):
    """A path did not reach its last load; its arguments are message and last state."""


def path(case: Case) -> list[Solution]:
    return trace(case.design, case.loads, case.accuracy, magnet=case.magnet, model=case.model, estimate=False)


def follow(case: Case, loads: Sequence[Load] | None = None, **other: object) -> Solution:
    last = path(replace(case, loads=tuple(loads or case.loads), **other))[-1]  # type: ignore[arg-type]
    if last.status not in ("ok", "unstable"):
        raise StoppedError(last.message, last)
    return last


def force(solution: Solution) -> float:
    return solution.response.force[2]


def off(value: float, reference: float) -> float:
    """Return the magnitude of the relative difference; infinite for a reference of 0 or without a finite value."""
    error = abs(value / reference - 1) if reference else math.inf
    return error if math.isfinite(error) else math.inf


def apart(one: Solution, other: Solution) -> float:
    forces = (math.hypot(*state.response.force) for state in (one, other))
    return float(np.maximum(off(*forces), off(one.energy, other.energy)))


def hertz(case: Case, states: Sequence[Solution]) -> Measurement:
    last, design = states[-1], case.design
    reference = 4 / 3 * design.E / (1 - design.nu**2) * math.sqrt(design.R) * last.load.depth**1.5
    return Measurement("force against Hertz 1882", off(force(last), reference))


def work(case: Case, states: Sequence[Solution]) -> Measurement:
    if case.loads[0].shear_x == case.loads[-1].shear_x:
        travel, forces = [s.load.depth for s in states], [force(s) for s in states]
    else:
        travel, forces = [s.load.shear_x for s in states], [s.response.force[0] for s in states]
    gained = states[-1].energy - states[0].energy
    return Measurement("work of the force against energy gained", off(float(simpson(forces, x=travel)), gained))


def cone(_: Case, states: Sequence[Solution]) -> Measurement:
    """Check the friction cone: tangential force over mu times the normal force is 1 at full slip, and never more."""
    last = states[-1]
    x, y, normal = last.response.force
    ratio = math.hypot(x, y) / (float(last.load.friction) * normal) if normal > 0 else math.inf
    off_by = 1 - ratio if last.slip_share == 1 and ratio < 1 else max(ratio - 1, 0.0)
    return Measurement("tangential force / (mu times normal force), difference from 1", off_by)


def similarity(case: Case, states: Sequence[Solution]) -> Measurement:
    one, other = case.design, paper()
    ratio = other.D / one.D
    loads = [replace(load, depth=load.depth * ratio, shear_x=load.shear_x * ratio) for load in case.loads]
    changes = {key: value for key, value in case.changes.items() if key not in (*LENGTHS, "E")}
    pair = (states[-1].response, follow(case, loads, changes=changes).response)
    a, b = (np.array([*found.force, *found.shift, found.tilt]) for found in pair)
    b *= [one.E / other.E / ratio**2] * 3 + [1 / ratio] * 3 + [1]
    # components that are 0 in both do not count
    differences = [off(float(x), float(y)) for x, y in zip(a, b, strict=True) if x or y]
    return Measurement("force / (E D^2) and pose / D against the paper's sensor", float(np.max(differences)))


def incompressible(case: Case, states: Sequence[Solution]) -> Measurement:
    near, limit = (force(follow(case, changes={**case.changes, "nu": nu})) for nu in (0.4998, 0.5))
    share = (1 - 2 * case.design.nu) / (1 - 2 * 0.4998)
    reference = limit + share * (near - limit)
    return Measurement("force against the line through nu 0.4998 and 0.5", off(force(states[-1]), reference))


def bar(case: Case, states: Sequence[Solution]) -> Measurement:
    """Compare a slender beam with its upper half in series with a uniform bar in place of the lower half.

    The stretch s of the bar follows from the force F and the area A by the incompressible neo-Hookean law,
    F / A = E / 3 (s^-2 - s). The upper half, at the remaining depth, must have the same force.
    """
    last, design = states[-1], case.design
    stress, half = force(last) / (math.pi * design.R**2), design.L / 2
    s = brentq(lambda s: design.E / 3 * (s**-2 - s) - stress, 0.1, 1.0)
    load = Load(depth=last.load.depth - half * (1 - s))
    shorter = follow(case, [load], changes={**case.changes, "L": half})
    return Measurement("force against half the beam in series with a uniform bar", off(force(shorter), force(last)))


def ordered(case: Case, states: Sequence[Solution]) -> Measurement:
    smaller = [follow(case, changes={**case.changes, "magnet_height": height}) for height in HEIGHTS]
    forces = map(force, [follow(case, magnet="ignored"), *smaller, states[-1]])
    largest = float(np.max([a / b for a, b in pairwise(forces)]))
    check = f"largest ratio of forces, a magnet over the next larger one, from none to the last of {len(HEIGHTS) + 1}"
    return Measurement(check, largest)


def other_path(beyond: float, step: float, case: Case, states: Sequence[Solution]) -> Measurement:
    """Compare force and energy with those of a path that first goes beyond the last load, or has small steps, mm."""
    first, last = case.loads[0].depth, case.loads[-1].depth
    depths = [last + beyond] if beyond else [first + step * i for i in range(round((last - first) / step))]
    other = follow(case, [*press(*depths), case.loads[-1]])
    return Measurement(f"force and energy against a path of {len(depths) + 1} loads", apart(states[-1], other))


def alone(case: Case, states: Sequence[Solution]) -> Measurement:
    other = force(follow(case, case.loads[-1:]))
    return Measurement("force against that of the last load alone", off(force(states[-1]), other))


def half_model(case: Case, states: Sequence[Solution]) -> Measurement:
    return Measurement("force against the half model", off(force(states[-1]), force(follow(case, model="half"))))


def folded(_: Case, states: Sequence[Solution]) -> Measurement:
    """Check that the inverted share (J <= 0) at 45 points of each triangle is at most WIDE times the reported one."""
    last = states[-1]
    beyond = folded_share(last) - WIDE * (last.facts.inverted_share or 0.0)
    return Measurement(f"inverted share, less {WIDE:g} times the reported one", max(beyond, 0.0))


def folded_share(solution: Solution) -> float:
    """Return the share of the undeformed volume that is inverted (J = det F <= 0); section meshes only.

    In the section, det F is the ratio of the Jacobians of the deformed and the undeformed triangle times r / R.
    """
    mesh, nodes = solution.body.mesh, np.asarray(solution.body.mesh.dofs.element_dofs)
    n = 8
    points = np.array([(i / n, j / n) for i in range(n + 1) for j in range(n + 1 - i)]).T
    basis = [skfem.ElementTriP2().lbasis(points, i) for i in range(6)]
    values = np.array([value * np.ones(points.shape[1]) for value, _ in basis])
    slopes = np.array([np.broadcast_to(slope, points.shape) for _, slope in basis])

    def radius_and_area(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        J = np.einsum("cne,njq->cjqe", x[:, nodes], slopes)
        return np.einsum("ne,nq->qe", x[0, nodes], values), J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]

    R, before = radius_and_area(mesh.doflocs)
    r, after = radius_and_area(mesh.doflocs + solution.body.u.T)
    inside_out = (after / before <= 0) | ((r < 0) & (R > 0))
    volume = R * np.abs(before)
    return float(volume[inside_out].sum() / volume.sum())


def largest_height(changes: Mapping[str, float]) -> float:
    """Return the height of the tallest magnet of the design's diameter that leaves the least wall, mm, or 0."""
    D, L, diameter, edge = (
        changes.get(name, getattr(paper(), name)) for name in ("D", "L", "magnet_diameter", "magnet_edge_radius")
    )
    low, high = 2 * edge, D
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if Shape(D, L, diameter, middle, edge).wall >= LEAST_WALL else (low, middle)
    return low if low > 2 * edge else 0.0


# Cases that do not end with status "ok": stopped, unstable, or without contact


def stopped(case: Case, end: Solution) -> Measurement:
    if end.status == "not_converged":
        return last_good(case, end)
    symmetric = follow(case, [end.load], model="axisymmetric")
    if end.status == "unstable":
        return Measurement("energy / energy of the symmetric press", end.energy / symmetric.energy, 1.0)
    # without contact: the message recommends the axisymmetric model, whose force at first touch is Hertz's
    touch = hertz(case, [symmetric])
    return touch._replace(check=f"model that the message recommends: {touch.check}")


def last_good(case: Case, end: Solution) -> Measurement:
    before = [load for load in case.loads if _travel(load) < _travel(end.load)]
    check, rubs = "last converged state against a new path to it", end.slip_share is not None
    try:
        again = follow(case, [*before, end.load])
    except StoppedError as stop:
        short = 1 - _travel(stop.args[1].load) / _travel(end.load)
        check += ": share of the load by which this stopped before it"
        return Measurement(check, short, RUBBED_SHORT if rubs else SHORT)
    return Measurement(check, apart(end, again), RUBBED if rubs else SAME)


def onset(case: Case, end: Solution, why: str) -> Measurement:
    """Compare the onset of an instability with that on a finer mesh, and say `why`: what the case did not pass.

    Beyond the onset there are several equilibria, so that states on two meshes may differ although both are right.
    """
    finer = replace(case.accuracy, section_size=FINER * case.accuracy.section_size)
    other = path(replace(case, accuracy=finer))[-1]
    (low, high), there = end.facts.onset_mm or (math.nan, math.nan), other.facts.onset_mm
    check = f"{end.facts.onset} of the onset against a mesh with {FINER:g} times the edge length ({why})"
    if there is None and _travel(other.load) < high:
        return Measurement(f"{check}: the path on that mesh stops before it")
    gap = math.inf if there is None else max(there[0] - high, low - there[1], 0.0) / high
    return Measurement(check, gap, ONSET)


def _travel(load: Load) -> float:
    return load.depth + abs(load.shear_x)
