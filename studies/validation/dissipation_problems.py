"""The sign of the dissipation of a point in cycles of large strain, for both viscoelastic laws.

A point of an incompressible neo-Hookean silicone with one branch, g = 0.5, is sheared and stretched in a sine wave. A
step of time dissipates dD = S : dC/2 - dW, with the stored energy W of `fem.model.viscoelasticity`. By the
law "finite" no step has dD < 0. By the law "prony" W is exact at small strain only: quick motions of large strain
have steps of dD < 0, while a closed cycle in steady motion, in which W returns to its value, dissipates.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fem.analyses.timed_path import ViscousLaw
from fem.model import viscoelasticity
from fem.model.viscoelasticity import Branches, History, PointState
from geometry.arrays import Array

SHEARS = (0.1, 0.5, 1.5)
"""Largest shears of the cycles."""
STRETCHES = (0.05, 0.3, 0.7)
"""Largest logarithmic strains of the cycles along one axis, without a change of volume."""
RATES = (0.1, 1.0, 10.0)
"""Angular frequencies times the time of the branch."""
CYCLES = 4


def deformed(wave: float) -> PointState:
    """Return the state of all points, (6, 1, shears and stretches, 1), at a share of their largest strains."""
    a, e = wave * np.array(SHEARS), wave * np.array(STRETCHES)
    C = np.zeros((6, 1, len(a) + len(e), 1))
    # F = 1 + a e_x e_z, and F = diag(exp(-e/2), exp(-e/2), exp(e))
    C[:3, 0, : len(a), 0] = np.ones_like(a), np.ones_like(a), 1 + a**2
    C[4, 0, : len(a), 0] = a
    C[:3, 0, len(a) :, 0] = np.exp(-e), np.exp(-e), np.exp(2 * e)
    one, unit = np.ones(C.shape[1:]), np.zeros(C.shape)
    unit[:3] = 1.0
    # a branch that has not flown is the neo-Hookean law
    W, S = viscoelasticity.branch_stress(unit, np.zeros(C.shape[1:]), C, one, one)
    return PointState(C, one, W, S, one, one)


def cycle(law: ViscousLaw, rate: float, n: int) -> tuple[Array, Array]:
    """Return work and dissipation (steps, points) in n steps of the last cycle; rate: angular frequency times tau."""
    branches = Branches(np.array([0.5]), np.array([1.0]), 1.0)
    point = deformed(0.0)
    history = viscoelasticity.at_rest(law, branches, point.J.shape)
    work, stored = [], [_stored(history, point)]
    stress = history.stress(point)
    for i in range(1, CYCLES * n + 1):
        after = deformed(math.sin(2 * math.pi * i / n))
        history = history.advance(after, 2 * math.pi / (rate * n))
        reached = history.stress(after)
        work.append(viscoelasticity.contract(stress + reached, after.C - point.C).ravel() / 4)
        stored.append(_stored(history, after))
        point, stress = after, reached
    return np.array(work)[-n:], np.array(work)[-n:] - np.diff(stored, axis=0)[-n:]


def _stored(history: History, point: PointState) -> Array:
    """Return the stored energy of each point."""
    alone = np.eye(point.J.size).reshape(-1, *point.J.shape)
    return np.array([history.stored(replace(point, weights=weights)) for weights in alone])


def signs(law: ViscousLaw, n: int) -> tuple[Array, Array]:
    """Return the least work of a cycle over its moved work, and the least dissipation of a step over the most work.

    Returns
    -------
    tuple
        Two (points,), over all `RATES`.
    """
    cycles = [cycle(law, rate, n) for rate in RATES]
    closed = [work.sum(axis=0) / np.abs(work).sum(axis=0) for work, _ in cycles]
    steps = [lost.min(axis=0) / np.abs(work).max(axis=0) for work, lost in cycles]
    return np.min(closed, axis=0), np.min(steps, axis=0)


def negative_dissipation(n: int) -> tuple[float, ...]:
    """Return 1 less the negative parts: of closed cycles by both laws, and of steps by the law "finite"."""
    (linear, _), (finite, steps) = signs("prony", n), signs("finite", n)
    return tuple(1 - float(max(0.0, -values.min())) for values in (linear, finite, steps))
