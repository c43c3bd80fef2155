"""One Newton loop for every model: contact settles within a step (`active_set`), searches keep every J positive."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fem.contact.plate_contact import Plate, watched
from fem.discretisation.nonlinear_system import Assembly, State, System
from fem.solvers.active_set import settled
from fem.solvers.direct_solver import SingularMatrixError, Solver
from fem.solvers.nonlinear_elimination import patch
from geometry.arrays import Array

TOLERANCE = 1e-9
MOST_ITERATIONS = 30
NOTHING = 1e-18
"""Reactions over E D^2 and displacements over D below which the body is at rest."""
CHORD, CHORDS = 0.02, 3
"""A step that leaves less of the residual than this, or after which so many more like it will do, is followed by one
with the same factorisation."""
PATIENCE = 6
"""Full steps after which one that does not halve the residual is compared with shorter ones."""
LOCAL, MOST_LOCAL = 1e-3, 12
"""Tolerance, and most iterations, for cells that are balanced by themselves."""

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
    n = system.n_free + system.n_rigid
    unstable: int | None = None
    state = system.admissible(q)
    if state is None:
        state = system.state(q)
        return Equilibrium(state, _empty(system), 0, "guess_inverted")
    frozen = plate if plate is None or pressed is None else replace(plate, pressed=pressed)
    assembly = system.assemble(state, frozen)
    force, volume = _sizes(assembly, n)
    rate = 1.0
    for iteration in range(most):
        reference, reach = _length(assembly.forces[system.eliminated]), float(np.abs(state.u).max(initial=0.0))
        left = max(force / max(reference, NOTHING), volume / max(reach, NOTHING))
        own = iteration > 0 or frozen is plate
        plate, held = watched(system.surface, state.u, plate)
        try:
            if left <= tolerance and own and not held:
                if unstable:  # the tangent that told so may be that of an iterate far from here
                    here = assembly if assembly.matrix is not None else system.assemble(state, plate)
                    unstable = _unstable(system, solver, here)
                return Equilibrium(state, assembly, iteration, "", unstable)
            if assembly.matrix is not None:
                unstable = _unstable(system, solver, assembly)
            step = solver.solve(assembly.residual)
            if assembly.matrix is not None:
                step = settled(system, solver, state, step, plate, pressed if iteration == 0 else None)
        except SingularMatrixError:
            return Equilibrium(state, assembly, iteration, "singular")
        trial = _search(system, state, step)
        if trial is None:
            return Equilibrium(state, assembly, iteration, "step_inverted")
        scale = reference or 1.0, reach or 1.0
        before, step = _merit(force, volume, scale), state.q - trial.q
        # Newton's method squares the rate: where that will do, the tangent is formed only if it proves wrong
        likely = rate**2
        fresh = not _goes_on(likely, likely * left, tolerance)
        state, assembly = trial, system.assemble(trial, plate, tangent=fresh)
        force, volume = _sizes(assembly, n)
        rate = _merit(force, volume, scale) / before if before else 0.0
        relaxed = None if _goes_on(rate, rate * left, tolerance) else _relaxed(system, state, assembly, plate, n)
        if relaxed is not None:
            (state, assembly), fresh = relaxed, False
            force, volume = _sizes(assembly, n)
            rate = _merit(force, volume, scale) / before if before else 0.0
        if not fresh and not _goes_on(rate, rate * left, tolerance):
            assembly = system.assemble(state, plate)
        if iteration >= PATIENCE and rate > 1 / 2:
            state, assembly = _damped(system, plate, state, assembly, step, n, scale)
            force, volume = _sizes(assembly, n)
    return Equilibrium(state, assembly, most, "no_convergence")


def _unstable(system: System, solver: Solver, assembly: Assembly) -> int | None:
    """Factorise a tangent; the number of its unstable directions, None where that is not known."""
    solver.factorise(assembly.tangent, symmetric=assembly.symmetric)
    negative = solver.negative()
    return None if negative is None else negative - system.n_pressure


def _goes_on(rate: float, left: float, tolerance: float) -> bool:
    """Whether steps that leave a share `rate` of the residual `left` are worth more than a new factorisation."""
    return rate <= CHORD or rate**CHORDS * left <= tolerance


def _length(x: Array) -> float:
    """Euclidean norm of numbers (n,), as `numpy.linalg.norm` but quicker for few."""
    return math.sqrt(x @ x)


def _sizes(assembly: Assembly, n: int) -> tuple[float, float]:
    """Norms of the residual forces, the first n, and of the residual volumes."""
    return _length(assembly.residual[:n]), _length(assembly.residual[n:])


def _merit(force: float, volume: float, scale: tuple[float, float]) -> float:
    """Residual forces and volumes over those that count, the same before and after a step."""
    return force / scale[0] + volume / scale[1]


def _relaxed(
    system: System, state: State, assembly: Assembly, plate: Plate | None, n: int
) -> tuple[State, Assembly] | None:
    """State and residual once the few cells that the residual hangs on are in balance; None if that leads nowhere."""
    part = patch(system, state, assembly, plate)
    if part is None:
        return None
    solver = Solver()
    try:
        local = newton(part.system, solver, part.q, part.plate, most=MOST_LOCAL, tolerance=LOCAL)
    finally:
        solver.close()
    calmer = system.admissible(part.into(system, state, local.state)) if local.converged else None
    if calmer is None:
        return None
    after = system.assemble(calmer, plate, tangent=False)
    return (calmer, after) if _sizes(after, n)[0] < _sizes(assembly, n)[0] else None


def _damped(
    system: System,
    plate: Plate | None,
    state: State,
    assembly: Assembly,
    step: Array,
    n: int,
    scale: tuple[float, float],
) -> tuple[State, Assembly]:
    """The best of a full step and of its half and quarter, by the residual."""
    tried = [(_merit(*_sizes(assembly, n), scale), state)]
    for back in (0.5, 0.75):
        shorter = system.admissible(state.q + back * step)
        if shorter is not None:
            there = system.assemble(shorter, plate, tangent=False)
            tried.append((_merit(*_sizes(there, n), scale), shorter))
    best = min(tried, key=lambda one: one[0])[1]
    return best, assembly if best is state else system.assemble(best, plate)


def _search(system: System, state: State, step: Array) -> State | None:
    """The longest of 1, 1/2, ... 1/64 of the step that keeps every J positive."""
    scale = 1.0
    for _ in range(7):
        trial = system.admissible(state.q - scale * step)
        if trial is not None:
            return trial
        scale /= 2
    return None


def _empty(system: System) -> Assembly:
    zero = system.state(np.zeros(system.size))
    return system.assemble(zero, None)
