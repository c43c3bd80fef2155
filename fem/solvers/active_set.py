"""Contact within one step of Newton's method: which points touch is settled on the linearised body.

A plain step takes the springs of the points that touch as given. Where others touch after it, or some of these hang,
their springs flip, and stiff springs go on flipping: the edge of a sheared tip's contact took six or seven steps to
settle. Here the linear complementarity problem of the step,

    K dq + r + sum_i s_i <g_i> B_i = 0,    g = g(q) + B dq,

is solved whole, with K and r those of the body without the springs, s_i of a point's spring and its overlap g_i with
the plate. Springs that flip are forces on the factorised body: with K' the tangent with the springs of the points in
contact so far, compliance G = B K'^-1 B^T and overlaps g0 after the plain step, g = g0 + G e, where e = s g for a
spring that goes and e = -s g for one that comes. The set of pressed points is exchanged for that of g > 0 until they
are the same (Hintermueller, Ito and Kunisch, SIAM J. Optim. 13, 2003: a primal-dual active set).

With friction the tangential springs depend on the pressure, and plain steps are taken.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem.contact import plate_contact
from fem.contact.plate_contact import Plate
from fem.discretisation.nonlinear_system import State, System
from fem.solvers.direct_solver import Solver
from geometry.arrays import Array

MOST_POINTS, MOST_SOLID, MOST_ROUNDS, MOST_EXCHANGES = 160, 50, 4, 50
"""Points that may flip on sections, and in tetrahedra, where so many right-hand sides cost as much as a plain step
or two; rounds, and exchanges in each."""


def settle_contact(
    system: System,
    solver: Solver,
    state: State,
    step: Array,
    plate: Plate | None,
    pressed: NDArray[np.bool_] | None = None,
) -> Array:
    """A step (n,) from a state q to q - step with contact settled; `step` itself where that does not pay or come out.

    Parameters
    ----------
    solver : with the tangent at the state factorised, in which the springs of the points `pressed` (k, q) act, by the
        overlap if not told.
    step : the plain one.
    """
    if plate is None or plate.height is None or plate.friction is not None:
        return step
    surface = system.surface
    assert surface is not None
    was = (plate_contact.overlap(surface, state.u, plate) > 0 if pressed is None else pressed).ravel()
    loose = np.ones(len(was), dtype=bool) if plate.tied is None else ~plate.tied.ravel()
    hard = (plate.stiffness * surface.weights).ravel()
    plain = plate_contact.overlap(surface, system.state(state.q - step).u, plate).ravel()
    points, B, Z = np.empty(0, dtype=np.int64), np.empty((0, len(step))), np.empty((len(step), 0))
    better, now = step, plain
    for _ in range(MOST_ROUNDS):
        flips = loose & ((now > 0) != was)
        flips[points] = False
        new = np.flatnonzero(flips)
        if not len(new):
            break
        if len(points) + len(new) > (MOST_POINTS if system.elements.dim == 2 else MOST_SOLID):
            return step
        rows = system.normal_displacement_rows(new, plate)
        points, B, Z = np.append(points, new), np.vstack([B, rows]), np.hstack([Z, solver.solve(rows.T)])
        own = B.any(axis=0)
        force = _exchange(B[:, own] @ Z[own], plain[points], was[points], hard[points])
        if force is None:
            return step
        better = step - Z @ force
        now = plate_contact.overlap(surface, system.state(state.q - better).u, plate).ravel()
    return better


def _exchange(G: Array, plain: Array, was: NDArray[np.bool_], hard: Array) -> Array | None:
    """Forces e (m,) of the springs that flip, from the compliance (m, m).

    None if the set goes on changing, or the body would give way without the springs that go.
    """
    pressed, spring = plain > 0, np.where(was, hard, -hard)
    for _ in range(MOST_EXCHANGES):
        flips = spring * (pressed != was)
        try:
            overlap = np.linalg.solve(np.eye(len(plain)) - G * flips, plain)
        except np.linalg.LinAlgError:
            return None
        after = overlap > 0
        if np.array_equal(after, pressed):
            return np.asarray(flips * overlap)
        pressed = after
    return None
