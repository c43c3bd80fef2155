"""One Newton loop for every model: contact settles within a step (`active_set`), searches keep every J positive."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fem.contact.plate_contact import Plate, hold_reversing_points
from fem.discretisation.nonlinear_system import Assembly, State, System
from fem.solvers.active_set import settle_contact
from fem.solvers.direct_solver import SingularMatrixError, Solver
from fem.solvers.nonlinear_elimination import find_patch
from geometry.arrays import Array

TOLERANCE = 1e-9
"""Residual over reactions and displacements: small beside what the mesh costs also where answers are subtracted, as
those of two meshes are for an error estimate."""
MOST_ITERATIONS = 30
"""Several times what a good first guess takes: beyond them two increments of half the length are cheaper."""
NOTHING = 1e-18
"""Reactions over E D^2 and displacements over D below which the body is at rest: below their rounding."""
CHORD, CHORDS = 0.02, 3
"""A step that leaves less of the residual than this, or after which so many more like it will do, is followed by one
with the same factorisation."""
PATIENCE = 6
"""Full steps after which one that does not halve the residual is compared with shorter ones. Before, contact may
still be changing, and a residual that grows for a step is no bad sign."""
LOCAL, MOST_LOCAL = 1e-3, 12
"""Tolerance, and most iterations, for cells that are balanced by themselves: the body around them is not yet."""

Stop = Literal["", "no_convergence", "guess_inverted", "step_inverted", "singular"]
STOPPED: dict[Stop, str] = {
    "": "",
    "no_convergence": f"no convergence in {MOST_ITERATIONS} iterations",
    "guess_inverted": "the first guess inverts an element (J <= 0)",
    "step_inverted": "an element is about to be inverted (J <= 0)",
    "singular": "the stiffness is singular",
}
"""Why Newton's method stopped short, in words."""


@dataclass(frozen=True, slots=True)
class Equilibrium:
    """Where Newton's method ended.

    Attributes
    ----------
    state, assembly : the last state whose residual was formed.
    iterations : linear solves done.
    reason : why it stopped short, a key of STOPPED; empty when converged.
    unstable : number of directions in which the last tangent is unstable, None where that is not known.
    """

    state: State
    assembly: Assembly
    iterations: int
    reason: Stop
    unstable: int | None = None

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
) -> Equilibrium:
    """Solve residual(q) = 0 from a first guess; the first iteration takes the points `pressed` as those in contact.

    Without that, a guess that has sunk into the plate wakes springs by the dozen, which each step has to settle.

    While a step leaves less than CHORD of the residual, or so little that CHORDS more like it will end, the next one
    takes the same factorisation and only the residual is formed anew. Converged when the residual forces are below a
    tolerance of the reactions and the residual volumes below that of the largest displacement times the unit area
    (lengths are scaled by D before).
    """
    unstable: int | None = None
    state = system.admissible(q)
    if state is None:
        state = system.state(q)
        return Equilibrium(state, _assemble_at_rest(system), 0, "guess_inverted")
    first = plate if plate is None or pressed is None else replace(plate, pressed=pressed)
    assembly = system.assemble(state, first)
    rate = 1.0
    for iteration in range(most):
        size = _reference_size(system, state, assembly)
        left = size.share(assembly)
        # the points `pressed` are a guess, and those that friction held may slip: such a balance is none yet
        balanced = left <= tolerance and (iteration > 0 or first is plate)
        plate, held = hold_reversing_points(system.surface, state.u, plate)
        try:
            if balanced and not held:
                if unstable:  # the tangent that told so may be that of an iterate far from here
                    here = assembly if assembly.matrix is not None else system.assemble(state, plate)
                    unstable = _count_unstable(system, solver, here)
                return Equilibrium(state, assembly, iteration, "", unstable)
            if assembly.matrix is not None:
                unstable = _count_unstable(system, solver, assembly)
            step = solver.solve(assembly.residual)
            # flips of contact are settled about a tangent of this iterate only
            if assembly.matrix is not None:
                step = settle_contact(system, solver, state, step, plate, pressed if iteration == 0 else None)
        except SingularMatrixError:
            return Equilibrium(state, assembly, iteration, "singular")
        trial = _backtrack(system, state, step)
        if trial is None:
            return Equilibrium(state, assembly, iteration, "step_inverted")
        full, before = state.q - trial.q, size.merit(assembly)
        state, assembly, rate = _evaluate_step(system, plate, trial, size, before, rate, left, tolerance)
        if iteration >= PATIENCE and rate > 1 / 2:
            state, assembly = _damp_step(system, plate, state, assembly, full, size)
    return Equilibrium(state, assembly, most, "no_convergence")


@dataclass(frozen=True, slots=True)
class _ReferenceSize:
    """What residuals at an iterate are held against.

    Attributes
    ----------
    n : number of the residual forces; the residual volumes follow them.
    reaction, reach : norm of the reactions over E D^2, and the largest displacement over D.
    """

    n: int
    reaction: float
    reach: float

    def share(self, assembly: Assembly) -> float:
        """The residual over what it has to be small beside: the larger share of forces and volumes."""
        force, volume = _norms(assembly, self.n)
        return max(force / max(self.reaction, NOTHING), volume / max(self.reach, NOTHING))

    def merit(self, assembly: Assembly) -> float:
        """Forces and volumes in one number, with the same weights before and after a step."""
        force, volume = _norms(assembly, self.n)
        return force / (self.reaction or 1.0) + volume / (self.reach or 1.0)


def _reference_size(system: System, state: State, assembly: Assembly) -> _ReferenceSize:
    reaction, reach = _norm(assembly.forces[system.eliminated]), float(np.abs(state.u).max(initial=0.0))
    return _ReferenceSize(system.n_free + system.n_rigid, reaction, reach)


def _evaluate_step(
    system: System,
    plate: Plate | None,
    trial: State,
    size: _ReferenceSize,
    before: float,
    rate: float,
    left: float,
    tolerance: float,
) -> tuple[State, Assembly, float]:
    """State, residual and perhaps tangent after a step, and the share of the residual's merit that is left.

    Parameters
    ----------
    before : merit of the residual before the step.
    rate : share that the last step left.
    left : residual before the step, as `_ReferenceSize.share`.
    """

    def share(after: Assembly) -> float:
        return size.merit(after) / before if before else 0.0

    # Newton's method squares the rate: where that will do, the tangent is formed only if it proves wrong
    likely = rate**2
    fresh = not _keeps_factorisation(likely, likely * left, tolerance)
    state, assembly = trial, system.assemble(trial, plate, tangent=fresh)
    rate = share(assembly)
    relaxed = (
        None
        if _keeps_factorisation(rate, rate * left, tolerance)
        else _relax_patch(system, state, assembly, plate, size.n)
    )
    if relaxed is not None:
        (state, assembly), fresh = relaxed, False
        rate = share(assembly)
    if not fresh and not _keeps_factorisation(rate, rate * left, tolerance):
        assembly = system.assemble(state, plate)
    return state, assembly, rate


def _count_unstable(system: System, solver: Solver, assembly: Assembly) -> int | None:
    """Factorise a tangent; the number of its unstable directions, None where that is not known."""
    solver.factorise(assembly.tangent, symmetric=assembly.symmetric)
    negative = solver.negative()
    return None if negative is None else negative - system.n_pressure


def _keeps_factorisation(rate: float, left: float, tolerance: float) -> bool:
    """Whether steps that leave a share `rate` of the residual `left` are worth more than a new factorisation."""
    return rate <= CHORD or rate**CHORDS * left <= tolerance


def _norm(x: Array) -> float:
    """Euclidean norm of numbers (n,), as `numpy.linalg.norm` but quicker for few."""
    return math.sqrt(x @ x)


def _norms(assembly: Assembly, n: int) -> tuple[float, float]:
    """Norms of the residual forces, the first n, and of the residual volumes."""
    return _norm(assembly.residual[:n]), _norm(assembly.residual[n:])


def _relax_patch(
    system: System, state: State, assembly: Assembly, plate: Plate | None, n: int
) -> tuple[State, Assembly] | None:
    """State and residual once the few cells that the residual hangs on are in balance; None if that leads nowhere."""
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
    system: System, plate: Plate | None, state: State, assembly: Assembly, step: Array, size: _ReferenceSize
) -> tuple[State, Assembly]:
    """The best of a full step and of its half and quarter, by the residual."""
    tried = [(size.merit(assembly), state)]
    for back in (0.5, 0.75):
        shorter = system.admissible(state.q + back * step)
        if shorter is not None:
            tried.append((size.merit(system.assemble(shorter, plate, tangent=False)), shorter))
    best = min(tried, key=lambda one: one[0])[1]
    return best, assembly if best is state else system.assemble(best, plate)


def _backtrack(system: System, state: State, step: Array) -> State | None:
    """The longest of 1, 1/2, ... 1/64 of the step that keeps every J positive."""
    scale = 1.0
    for _ in range(7):
        trial = system.admissible(state.q - scale * step)
        if trial is not None:
            return trial
        scale /= 2
    return None


def _assemble_at_rest(system: System) -> Assembly:
    zero = system.state(np.zeros(system.size))
    return system.assemble(zero, None)
