"""What is measured of a case of `extremes` that does not end "ok": stopped, unstable, without contact, or refused."""

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
"""How far a fresh solve to a last good state may stop short of it, as a share of the load."""
SAME = 1e-6
"""Largest relative difference of force and energy between a last good state and a fresh solve to it."""
RUBBED, RUBBED_SHORT = 1e-2, 0.05
"""The same two with Coulomb friction, where the answer and the end depend on the steps of the way."""
FINER, ONSET = 0.7, 0.1
"""Edges of the mesh that an onset is looked for again on, over the case's, and how far off it may then be."""


def stopped(case: Case, end: Solution) -> Measurement:
    """The check of a state whose status is not "ok"."""
    if end.status == "not_converged":
        return last_good(case, end)
    if end.status == "unstable":
        symmetric = follow(case, [end.load], model="axisymmetric")[-1]
        return Measurement(end, "its energy over that of the symmetric press", end.energy / symmetric.energy, 1.0)
    # the state says that the axisymmetric model can: at first touch its force is known
    touch = hertz(case, follow(case, [end.load], model="axisymmetric"))
    return replace(touch, solution=end, check=f"the model that the message names: {touch.check}")


def last_good(case: Case, end: Solution) -> Measurement:
    """The last good state against a fresh path that ends there."""
    before = [load for load in case.loads if _way(load) < _way(end.load)]
    check = "last good state against a fresh solve to it"
    try:
        again = follow(case, [*before, end.load])[-1]
    except StoppedError as stop:
        short = 1 - _way(stop.solution.load) / _way(end.load)
        bound = SHORT if end.slip_share is None else RUBBED_SHORT
        return Measurement(end, f"{check}, which stopped short of it", short, bound)
    return Measurement(end, check, apart(end, again), SAME if end.slip_share is None else RUBBED)


def refused(case: Case) -> Measurement:
    """Of a design whose magnet does not fit: no smaller one that does would be refused with it."""
    largest = largest_height({**case.changes})
    check = "height of the largest magnet that fits over its own"
    return Measurement(None, check, largest / float(case.changes.get("magnet_height", paper().magnet_height)), 1.0)


def onset(case: Case, end: Solution, why: str) -> Measurement:
    """Of a state beyond the onset of an instability, where equilibria part: the onset itself, on a finer mesh.

    Parameters
    ----------
    why : how its state was to be judged, and what came of it.
    """
    finer = replace(case.accuracy, section_size=FINER * case.accuracy.section_size)
    other = robustness_checks.path(replace(case, accuracy=finer))[-1]
    (low, high), there = end.facts.onset_mm or (math.nan, math.nan), other.facts.onset_mm
    check = f"{end.facts.onset} of the onset on a mesh with edges of {FINER:g} ({why})"
    if there is None and _way(other.load) < high:
        return Measurement(end, f"{check}: the path on it stops before", None)
    apart = math.inf if there is None else max(there[0] - high, low - there[1], 0.0) / high
    return Measurement(end, check, apart, ONSET)


def _way(load: Load) -> float:
    return load.depth + abs(load.shear_x)
