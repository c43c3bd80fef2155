"""The Newton loop of all models, for two ways to find a step with its contact.

A step is that of the linearised body with its contact settled: `active_set` for contact without friction,
`condensed_friction`, with the same methods, for Coulomb friction on sections. A line search keeps every J positive.
While a step reduces the residual fast enough, the next one reuses its factorisation, and assembles no tangent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem.model.nonlinear_system import Assembly, State, System
from fem.model.plate_contact import Plate
from fem.solution import UNKNOWN, Stability, Stop
from fem.solve.active_set import UNDAMPED, ActiveSet, KeptTangent
from fem.solve.condensed_friction import CondensedFriction
from fem.solve.direct_solver import SingularMatrixError, Solver, norm
from geometry.arrays import Array, Mask
from geometry.bad_input import BadInput, SolveFailed

Contact = ActiveSet | CondensedFriction

TOLERANCE = 1e-9
"""Tolerance of the residual over reactions and displacements: small beside the discretisation error also where two
answers are subtracted, as for error estimates."""
MOST_ITERATIONS = 30
"""Several times the iterations from a good first guess; beyond them two increments of half the length are cheaper."""
ROUNDING = 1e-18
"""Reactions over E D^2 and displacements over D below which the body is at rest: below their rounding errors."""
MOST_REUSED = 2
"""A factorisation is reused while so many more steps reach the tolerance, if each leaves the share of the residual
that the last one left: a new one costs as much as two to four steps. With 3 a press curve takes 6 % longer, and
friction 3 % less."""
SETTLED = 0.1
"""Largest share of the residual that the step before a last one that is not confirmed has left: a step that leaves
more may still change the contact."""

STOPPED: dict[Stop, str] = {
    "": "",
    "no_convergence": f"no convergence in {MOST_ITERATIONS} iterations",
    "guess_inverted": "the first guess inverts an element (J <= 0)",
    "step_inverted": "an element is about to be inverted (J <= 0)",
    "singular": "the stiffness is singular",
    "force_lost": "no depth near there holds the normal force",
}
"""Why Newton's method, or the search for a depth that holds a force, stopped, in words."""


class NoStateError(BadInput, SolveFailed):
    """The state about which something is asked is not reached, or is unstable; a smaller load may be answered."""


@dataclass(frozen=True, slots=True)
class Equilibrium:
    """Result of Newton's method.

    Attributes
    ----------
    state, assembly : the last state, and its residual or, see `iterate`, that of the state before.
    iterations : number of linear solves.
    reason : why it stopped, a key of STOPPED; empty when converged.
    stability : see `iterate`.
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
    pressed: Mask | None = None,
    *,
    tolerance: float = TOLERANCE,
    confirm: bool = True,
) -> Equilibrium:
    """Solve residual(q) = 0 from a first guess with the active set of `fem.solve.active_set`.

    Parameters
    ----------
    q, tolerance, confirm : see `iterate`.
    plate : the plate, or None.
    pressed : (k, q) points that are in contact in the first iteration; default: those with a positive overlap. A
        guess that overlaps the plate slightly would otherwise activate many springs, which each step then has to
        settle.
    """
    contact = ActiveSet(system, KeptTangent(solver), plate, pressed, keeps_long=False)
    return iterate(contact, q, tolerance=tolerance, confirm=confirm)


def iterate(contact: Contact, q: Array, *, tolerance: float = TOLERANCE, confirm: bool = True) -> Equilibrium:
    """Solve residual(q) = 0 from a first guess.

    It has converged when the residual forces are below `tolerance` times the reactions, and the residual volumes
    below `tolerance` times the largest displacement (times the unit area: lengths are over D). The stability is then
    that of the returned state (`ActiveSet.final_stability`); a state that is only passed, with a tolerance above
    TOLERANCE, has that of the last tangent unless this has unstable directions.

    q : (n,) first guess.
    tolerance : see above.
    confirm : compute the residual after the last step. Otherwise that step is not assembled where it leaves at most
        the share of the step before, and this reaches the tolerance; the assembly is then that before the step.
    """
    system, passed = contact.system, tolerance > TOLERANCE
    state = system.admissible(q)
    if state is None:
        rest = system.assemble(system.state(np.zeros(system.size)), None)
        return Equilibrium(system.state(q), rest, 0, "guess_inverted")
    assembly, rate = contact.assemble(state, tangent=not contact.knows(state)), 1.0
    for iteration in range(MOST_ITERATIONS):
        size = reference_size(system, state, assembly)
        left = size.share(assembly)
        settled = contact.is_settled(state)
        try:
            if settled and left <= tolerance:
                return Equilibrium(
                    state, assembly, iteration, "", contact.final_stability(state, assembly, passed=passed)
                )
            if assembly.matrix is not None:
                contact.factorise(state, assembly)
            after = contact.step(state, assembly)
        except SingularMatrixError:
            return Equilibrium(state, assembly, iteration, "singular")
        if after is None:
            return Equilibrium(state, assembly, iteration, "no_convergence")
        trial = backtrack(system, state, after)
        if trial is None:
            return Equilibrium(state, assembly, iteration, "step_inverted")
        if not confirm and iteration > 1 and _reaches(contact, rate, left, tolerance):
            try:
                stability = contact.stability if passed else contact.final_stability(trial)
            except SingularMatrixError:
                return Equilibrium(trial, assembly, iteration + 1, "singular")
            return Equilibrium(trial, assembly, iteration + 1, "", stability)
        full, before = state.q - trial.q, size.merit(assembly)
        state, assembly = _evaluate(contact, trial, iteration, size, (before, rate, left), tolerance)
        rate = size.merit(assembly) / before if before else 0.0
        if iteration >= UNDAMPED and rate > 1 / 2:
            state, assembly = _damp_step(contact, state, assembly, full, size)
    return Equilibrium(state, assembly, MOST_ITERATIONS, "no_convergence")


@dataclass(frozen=True, slots=True)
class ReferenceSize:
    """Reference sizes that residuals at an iterate are compared with.

    n : number of residual forces; the residual volumes follow them.
    reaction, reach : norm of the reactions over E D^2, and largest displacement over D.
    """

    n: int
    reaction: float
    reach: float

    def share(self, assembly: Assembly) -> float:
        """Return the larger share of residual to reference, of forces and volumes."""
        force, volume = norm(assembly.residual[: self.n]), norm(assembly.residual[self.n :])
        return max(force / max(self.reaction, ROUNDING), volume / max(self.reach, ROUNDING))

    def merit(self, assembly: Assembly) -> float:
        """Return forces and volumes as one number, with the same weights before and after a step."""
        force, volume = norm(assembly.residual[: self.n]), norm(assembly.residual[self.n :])
        return force / (self.reaction or 1.0) + volume / (self.reach or 1.0)


def reference_size(system: System, state: State, assembly: Assembly) -> ReferenceSize:
    """Return the reference sizes at a state, from the forces of its assembly."""
    reaction = norm(assembly.forces[system.eliminated])
    reach = float(np.abs(state.u).max(initial=0.0))
    return ReferenceSize(system.n_free + system.n_rigid, reaction, reach)


def _evaluate(
    contact: Contact,
    trial: State,
    iteration: int,
    size: ReferenceSize,
    last: tuple[float, float, float],
    tolerance: float,
) -> tuple[State, Assembly]:
    """Return a trial state and its residual, with a tangent where the last one is not good enough.

    last : merit before the step, share that the step before left, and residual before the step.
    """
    before, rate, left = last

    def keeps(rate: float) -> bool:
        # the first step also settles the contact, which says nothing about the tangent
        return (contact.keeps and not iteration) or rate ** (MOST_REUSED + 1) * left <= tolerance

    # Newton's method squares the rate: where that is enough, the tangent is assembled only if this proves wrong
    fresh = not (contact.knows(trial) and keeps(0.0 if contact.keeps else rate**2))
    assembly = contact.assemble(trial, tangent=fresh)
    if not fresh and not keeps(size.merit(assembly) / before if before else 0.0):
        assembly = contact.assemble(trial, tangent=True)
    return trial, assembly


def _reaches(contact: Contact, rate: float, left: float, tolerance: float) -> bool:
    """Return whether a step from a residual `left` reaches the tolerance if it leaves the last step's share `rate`.

    The factorisation is that of the step before or a newer one, so the share does not grow.
    """
    predicts = not contact.confirms and not contact.stability.is_unstable
    return predicts and rate <= SETTLED and rate * left <= tolerance


def _damp_step(
    contact: Contact, state: State, assembly: Assembly, step: Array, size: ReferenceSize
) -> tuple[State, Assembly]:
    """Return the best of a full step, its half and its quarter, by the merit of the residual."""
    tried = [(size.merit(assembly), state)]
    for back in (0.5, 0.75):
        shorter = contact.system.admissible(state.q + back * step)
        if shorter is not None:
            tried.append((size.merit(contact.assemble(shorter, tangent=False)), shorter))
    best = min(tried, key=lambda trial: trial[0])[1]
    return best, assembly if best is state else contact.assemble(best, tangent=True)


def backtrack(system: System, state: State, after: Array) -> State | None:
    """Return the state after the longest of 1, 1/2, ... 1/64 of the step to `after` that keeps every J positive."""
    for _ in range(7):
        trial = system.admissible(after)
        if trial is not None:
            return trial
        after = (state.q + after) / 2
    return None
