"""Checks of cases of `extremes` that do not end with status "ok": stopped, unstable, without contact, or refused."""

from __future__ import annotations

import math
from dataclasses import replace

from fem.solution import Solution
from geometry.design import paper
from geometry.loads import Load
from studies.validation import robustness_checks
from studies.validation.robustness_checks import (
    Case,
    Measurement,
    StoppedError,
    apart,
    follow,
    hertz,
    largest_height,
)

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
    other = robustness_checks.path(replace(case, accuracy=finer))[-1]
    (low, high), there = end.facts.onset_mm or (math.nan, math.nan), other.facts.onset_mm
    check = f"{end.facts.onset} of the onset against a mesh with {FINER:g} times the edge length ({why})"
    if there is None and _travel(other.load) < high:
        return Measurement(end, f"{check}: the path on that mesh stops before it", None)
    gap = math.inf if there is None else max(there[0] - high, low - there[1], 0.0) / high
    return Measurement(end, check, gap, ONSET)


def _travel(load: Load) -> float:
    """Return depth plus shear of a load, mm, which orders the loads of a path."""
    return load.depth + abs(load.shear_x)
