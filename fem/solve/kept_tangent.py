"""Newton's method with a tangent that is kept over the steps of a path, where these change little.

A step in time starts from an extrapolated state, and the tangent of some steps ago is nearly that of this one: an
iteration that costs a residual and a solve leaves about a twentieth of the residual. Where it leaves too much, the
tangent at the present iterate is factorised.

Springs of points that touch or leave the plate are much stiffer than the silicone, so a tangent K' with the springs
of other points would not do. The residual is therefore written with the springs of K', and `active_set` settles the
contact of the whole step about it, as about a new tangent. The compliance of the points that differ is kept too.

A tangent is kept only if it is known to have no unstable direction. A body that lost its stability meanwhile would
not converge with it along that direction.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fem.model import plate_contact
from fem.model.elements import Surface
from fem.model.nonlinear_system import Assembly, State, System
from fem.model.plate_contact import Plate
from fem.solve.active_set import Switches, settle_contact
from fem.solve.direct_solver import Solver
from fem.solve.inertia import UNKNOWN, Stability
from fem.solve.newton import TOLERANCE, Equilibrium, backtrack, reference_size
from fem.solve.pardiso import SingularMatrixError
from geometry.arrays import Array

Mask = NDArray[np.bool_]

MOST_ITERATIONS, MOST_FACTORISATIONS = 12, 2
"""Limits of one step; beyond them Newton's method is quicker."""
SLOW, MOST_LEFT = 0.3, 4
"""The tangent is factorised again where an iteration leaves more than the share SLOW of the residual, or MOST_LEFT
more of them would not reach the tolerance: a factorisation costs as much as four iterations."""
SURE = 3.0
"""Margin of the tolerance over the predicted residual after a last iteration that is not confirmed."""


@dataclass(slots=True)
class KeptTangent:
    """A solver with the factorised tangent of an earlier iterate.

    Attributes
    ----------
    pressed : (k, q) mask of the points whose springs the tangent has; None where nothing is kept.
    switches : other points, with their compliance by this tangent.
    stability : that of the tangent.
    """

    solver: Solver
    pressed: Mask | None = None
    switches: Switches = field(default_factory=Switches)
    stability: Stability = UNKNOWN

    def drop(self) -> None:
        """Forget the tangent."""
        self.pressed, self.switches = None, Switches()


def newton_near(
    kept: KeptTangent, system: System, q: Array, plate: Plate, pressed: Mask, *, tolerance: float = TOLERANCE
) -> Equilibrium | None:
    """Solve residual(q) = 0 under a plate without friction, as `fem.solve.newton.newton` does, with a kept tangent.

    None, with nothing kept, where that needs too many iterations, or the body may be unstable.

    Parameters
    ----------
    q : (n,) first guess.
    pressed : (k, q) points that are expected to touch.
    """
    state = system.admissible(q)
    before, factorisations = 0.0, 0
    for iteration in range(MOST_ITERATIONS):
        if state is None:
            break
        assembly = system.assemble(state, plate, tangent=False)
        left = reference_size(system, state, assembly).share(assembly)
        if left <= tolerance and iteration:
            return Equilibrium(state, assembly, iteration, "", kept.stability)
        rate = left / before if before else 0.0
        # the first step also settles the contact, which says nothing about the tangent
        slow = iteration > 1 and (rate > SLOW or rate**MOST_LEFT * left > tolerance)
        try:
            if kept.pressed is None or slow:
                factorisations += 1
                sound = _factorise(kept, system, state, plate, None if iteration else pressed)
                if factorisations > MOST_FACTORISATIONS or not sound:
                    break
            step = _settled_step(kept, system, state, assembly, plate)
        except SingularMatrixError:
            break
        state, last = backtrack(system, state, step), SURE * rate * left <= tolerance
        if state is not None and iteration > 1 and not slow and last:
            return Equilibrium(state, assembly, iteration + 1, "", kept.stability)
        before = left
    kept.drop()
    return None


def _factorise(kept: KeptTangent, system: System, state: State, plate: Plate, pressed: Mask | None) -> bool:
    """Factorise the tangent at a state, with the springs of the points `pressed`; default: those that overlap.

    Return whether it has no unstable direction.
    """
    kept.drop()
    own = plate_contact.overlap(_skin(system), state.u, plate) > 0 if pressed is None else pressed
    assembly = system.assemble(state, replace(plate, pressed=own))
    kept.solver.factorise(assembly.tangent, symmetric=assembly.symmetric, order=system.pattern.elimination_order)
    kept.pressed, kept.stability = own, kept.solver.stability(system.n_pressure)
    return kept.stability.is_stable


def _settled_step(kept: KeptTangent, system: System, state: State, assembly: Assembly, plate: Plate) -> Array:
    """Return a step (n,) from the state q to q - step, with the residual written with the springs of the tangent."""
    assert kept.pressed is not None
    s, residual = _skin(system), assembly.residual
    if not np.array_equal(plate_contact.overlap(s, state.u, plate) > 0, kept.pressed):
        forces = np.zeros(system.fixed.shape)
        for sign, one in ((1, replace(plate, pressed=kept.pressed)), (-1, plate)):
            np.add.at(forces, s.nodes, sign * plate_contact.assemble_springs(s, state.u, one, tangent=False)[0])
        residual = residual.copy()
        residual[: system.n_free] += forces[system.free]
    step = kept.solver.solve(residual)
    return settle_contact(system, kept.solver, state, step, plate, kept.pressed, kept.switches)


def _skin(system: System) -> Surface:
    assert system.surface is not None
    return system.surface
