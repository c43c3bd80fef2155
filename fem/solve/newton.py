"""The Newton loop of all models.

Contact is settled within a step (`active_set`), and a line search keeps every J positive.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fem.model.nonlinear_system import Assembly, State, System
from fem.model.plate_contact import Plate, hold_reversing_points
from fem.solve.active_set import settle_contact
from fem.solve.direct_solver import Solver
from fem.solve.inertia import UNKNOWN, Stability
from fem.solve.nonlinear_elimination import find_patch
from fem.solve.pardiso import SingularMatrixError
from geometry.arrays import Array
from geometry.bad_input import BadInput, SolveFailed

TOLERANCE = 1e-9
"""Tolerance of the residual over reactions and displacements: small beside the discretisation error also where two
answers are subtracted, as for error estimates."""
MOST_ITERATIONS = 30
"""Several times the iterations from a good first guess; beyond them two increments of half the length are cheaper."""
NOTHING = 1e-18
"""Reactions over E D^2 and displacements over D below which the body is at rest: below their rounding errors."""
CHORD, CHORDS = 0.02, 3
"""The factorisation is reused for the next step if a step leaves less than the share CHORD of the residual, or if
CHORDS more steps at the same rate reach the tolerance."""
PATIENCE = 6
"""Full steps before steps that do not halve the residual are compared with shorter ones. In the first steps the
contact still changes, and a residual that grows once is no sign of divergence."""
LOCAL, MOST_LOCAL = 1e-3, 30
"""Tolerance and most iterations of cells that are balanced separately. More accuracy is of no use while the body
around them is not in balance. Some cells at the edge of a glued area take 25 iterations; together these cost less
than one step of the body, which would take several short ones otherwise."""

Stop = Literal["", "no_convergence", "guess_inverted", "step_inverted", "singular"]
STOPPED: dict[Stop, str] = {
    "": "",
    "no_convergence": f"no convergence in {MOST_ITERATIONS} iterations",
    "guess_inverted": "the first guess inverts an element (J <= 0)",
    "step_inverted": "an element is about to be inverted (J <= 0)",
    "singular": "the stiffness is singular",
}
"""Why Newton's method stopped, in words."""


class NoStateError(BadInput, SolveFailed):
    """The state about which something is asked is not reached, or is unstable; a smaller load may be answered."""


@dataclass(frozen=True, slots=True)
class Equilibrium:
    """Result of Newton's method.

    Attributes
    ----------
    state, assembly : the last state, and its residual or, see `newton`, that of the state before.
    iterations : number of linear solves.
    reason : why it stopped, a key of STOPPED; empty when converged.
    stability : that of the last tangent.
    """

    state: State
    assembly: Assembly
    iterations: int
    reason: Stop
    stability: Stability = UNKNOWN

    @property
    def converged(self) -> bool:
        return not self.reason


def newton(
    system: System,
    solver: Solver,
    q: Array,
    plate: Plate | None,
    pressed: NDArray[np.bool_] | None = None,
    *,
    most: int = MOST_ITERATIONS,
    tolerance: float = TOLERANCE,
    confirm: bool = True,
) -> Equilibrium:
    """Solve residual(q) = 0 from a first guess.

    It has converged when the residual forces are below `tolerance` times the reactions, and the residual volumes
    below `tolerance` times the largest displacement (times the unit area: lengths are over D).

    While a step reduces the residual fast enough (see CHORD), the next one reuses the factorisation and only the
    residual is recomputed.

    Parameters
    ----------
    q : (n,) first guess.
    plate : the plate, or None.
    pressed : (k, q) points that are in contact in the first iteration; default: those with a positive overlap. A
        guess that overlaps the plate slightly would otherwise activate many springs, which each step then has to
        settle.
    most : largest number of iterations.
    tolerance : see above.
    confirm : compute the residual after the last step. Otherwise that step is not assembled where it leaves at most
        the share of the step before, and this reaches the tolerance; the assembly is then that before the step.
    """
    stability = UNKNOWN
    state = system.admissible(q)
    if state is None:
        state = system.state(q)
        return Equilibrium(state, assemble_at_rest(system), 0, "guess_inverted")
    first = plate if plate is None or pressed is None else replace(plate, pressed=pressed)
    assembly = system.assemble(state, first)
    rate = 1.0
    for iteration in range(most):
        size = reference_size(system, state, assembly)
        left = size.share(assembly)
        # an iterate whose contact points were only a guess (`pressed`) cannot be the solution yet
        balanced = left <= tolerance and (iteration > 0 or first is plate)
        plate, held = hold_reversing_points(system.surface, state.u, plate)
        try:
            if balanced and not held:
                # not known yet, or from an earlier iterate, which may be far from here
                if not iteration or stability.is_unstable:
                    here = assembly if assembly.matrix is not None else system.assemble(state, plate)
                    stability = _factorise(system, solver, here)
                return Equilibrium(state, assembly, iteration, "", stability)
            if assembly.matrix is not None:
                stability = _factorise(system, solver, assembly)
            step = solver.solve(assembly.residual)
            # contact can be settled only about a tangent of this very iterate
            if assembly.matrix is not None:
                step = settle_contact(system, solver, state, step, plate, pressed if iteration == 0 else None)
        except SingularMatrixError:
            return Equilibrium(state, assembly, iteration, "singular")
        trial = backtrack(system, state, step)
        if trial is None:
            return Equilibrium(state, assembly, iteration, "step_inverted")
        if not confirm and not stability.is_unstable and iteration > 1 and _reaches(rate, left, tolerance, plate):
            return Equilibrium(trial, assembly, iteration + 1, "", stability)
        full, before = state.q - trial.q, size.merit(assembly)
        state, assembly, rate = _evaluate_step(system, plate, trial, size, before, rate, left, tolerance)
        if iteration >= PATIENCE and rate > 1 / 2:
            state, assembly = _damp_step(system, plate, state, assembly, full, size)
    return Equilibrium(state, assembly, most, "no_convergence")


@dataclass(frozen=True, slots=True)
class ReferenceSize:
    """Reference sizes that residuals at an iterate are compared with.

    Attributes
    ----------
    n : number of residual forces; the residual volumes follow them.
    reaction, reach : norm of the reactions over E D^2, and largest displacement over D.
    """

    n: int
    reaction: float
    reach: float

    def share(self, assembly: Assembly) -> float:
        """Return the larger share of residual to reference, of forces and volumes."""
        force, volume = _norms(assembly, self.n)
        return max(force / max(self.reaction, NOTHING), volume / max(self.reach, NOTHING))

    def merit(self, assembly: Assembly) -> float:
        """Return forces and volumes as one number, with the same weights before and after a step."""
        force, volume = _norms(assembly, self.n)
        return force / (self.reaction or 1.0) + volume / (self.reach or 1.0)


def reference_size(system: System, state: State, assembly: Assembly) -> ReferenceSize:
    """Return the reference sizes at a state, from the forces of its assembly."""
    reaction = _norm(assembly.forces[system.eliminated])
    reach = float(np.abs(state.u).max(initial=0.0))
    return ReferenceSize(system.n_free + system.n_rigid, reaction, reach)


def _evaluate_step(
    system: System,
    plate: Plate | None,
    trial: State,
    size: ReferenceSize,
    before: float,
    rate: float,
    left: float,
    tolerance: float,
) -> tuple[State, Assembly, float]:
    """Return the state, its residual (with a tangent if needed), and the share of the merit that is left.

    Parameters
    ----------
    before : merit of the residual before the step.
    rate : share of the merit that the last step left.
    left : residual before the step, see `ReferenceSize.share`.
    """

    def share(after: Assembly) -> float:
        return size.merit(after) / before if before else 0.0

    # Newton's method squares the rate: where that is enough, the tangent is assembled only if this proves wrong
    likely = rate**2
    fresh = not keeps_factorisation(likely, likely * left, tolerance)
    state, assembly = trial, system.assemble(trial, plate, tangent=fresh)
    rate = share(assembly)
    relaxed = (
        None
        if keeps_factorisation(rate, rate * left, tolerance)
        else _relax_patch(system, state, assembly, plate, size.n)
    )
    if relaxed is not None:
        (state, assembly), fresh = relaxed, False
        rate = share(assembly)
    if not fresh and not keeps_factorisation(rate, rate * left, tolerance):
        assembly = system.assemble(state, plate)
    return state, assembly, rate


def _factorise(system: System, solver: Solver, assembly: Assembly) -> Stability:
    """Factorise a tangent; return the stability that it tells."""
    solver.factorise(assembly.tangent, symmetric=assembly.symmetric, order=system.pattern.elimination_order)
    return solver.stability(system.n_pressure)


def keeps_factorisation(rate: float, left: float, tolerance: float) -> bool:
    """Return whether to reuse the factorisation for steps that leave a share `rate` of the residual `left`."""
    return rate <= CHORD or rate**CHORDS * left <= tolerance


def _reaches(rate: float, left: float, tolerance: float, plate: Plate | None) -> bool:
    """Return whether a step from a residual `left` reaches the tolerance if it leaves the last step's share `rate`.

    The factorisation is that of the step before or a newer one, so the share does not grow. Friction may hold points
    that reverse, which only the next residual shows.
    """
    # the rate holds once the contact is settled: steps that leave more than CHORD may still change it
    return rate <= CHORD and rate * left <= tolerance and (plate is None or plate.friction is None)


def _norm(x: Array) -> float:
    """Return the Euclidean norm of (n,) numbers: `numpy.linalg.norm`, but faster for few."""
    return math.sqrt(x @ x)


def _norms(assembly: Assembly, n: int) -> tuple[float, float]:
    """Return the norms of the residual forces, the first n, and of the residual volumes."""
    return _norm(assembly.residual[:n]), _norm(assembly.residual[n:])


def _relax_patch(
    system: System, state: State, assembly: Assembly, plate: Plate | None, n: int
) -> tuple[State, Assembly] | None:
    """Balance the few cells that carry most of the residual; return the new state and residual.

    None if there are no such cells, or balancing them does not reduce the residual.
    """
    part = find_patch(system, state, assembly, plate)
    if part is None:
        return None
    solver = Solver()
    try:
        local = newton(part.system, solver, part.q, part.plate, most=MOST_LOCAL, tolerance=LOCAL)
    finally:
        solver.close()
    calmer = system.admissible(part.merge_into(system, state, local.state)) if local.converged else None
    if calmer is None:
        return None
    after = system.assemble(calmer, plate, tangent=False)
    return (calmer, after) if _norms(after, n)[0] < _norms(assembly, n)[0] else None


def _damp_step(
    system: System, plate: Plate | None, state: State, assembly: Assembly, step: Array, size: ReferenceSize
) -> tuple[State, Assembly]:
    """Return the best of a full step, its half and its quarter, by the merit of the residual."""
    tried = [(size.merit(assembly), state)]
    for back in (0.5, 0.75):
        shorter = system.admissible(state.q + back * step)
        if shorter is not None:
            tried.append((size.merit(system.assemble(shorter, plate, tangent=False)), shorter))
    best = min(tried, key=lambda one: one[0])[1]
    return best, assembly if best is state else system.assemble(best, plate)


def backtrack(system: System, state: State, step: Array) -> State | None:
    """Return the state after the longest of 1, 1/2, ... 1/64 of the step that keeps every J positive."""
    scale = 1.0
    for _ in range(7):
        trial = system.admissible(state.q - scale * step)
        if trial is not None:
            return trial
        scale /= 2
    return None


def assemble_at_rest(system: System) -> Assembly:
    """Return the assembly of the undeformed body without a plate, in place of one that an inverted state has not."""
    zero = system.state(np.zeros(system.size))
    return system.assemble(zero, None)
