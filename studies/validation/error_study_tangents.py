"""Trials of quantities that follow from a tangent: critical depths, small shears of a glued plate, frequencies.

Like the paths of `accuracy` they are solved at a level, at the coarser level of its estimate and on a much finer
mesh.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from fem.accuracy import Accuracy
from fem.analyses import modes, small_shear, stability
from fem.analyses.modes import Modes
from fem.analyses.small_shear import SmallShear
from fem.analyses.stability import Critical
from fem.results.error_estimate_rules import PRESS_DEPTH, press_limits
from fem.scene import Scene
from geometry.design import BadInput
from geometry.loads import Load, Magnet
from studies.validation.error_study_cases import Trial, designs, rounded
from studies.validation.error_study_records import (
    ROLES,
    TANGENTS,
    ErrorState,
    Judged,
    SolvedState,
    Tangent,
    TangentSolve,
    error_state,
    nan_if_none,
)

MODULES = ("fem/analyses/stability.py", "fem/analyses/small_shear.py", "fem/analyses/modes.py")
"""Modules of `fem` that only the scenes of this module use."""
SHALLOW = 0.1 / PRESS_DEPTH
"""Smaller depth of a small shear, over the larger one."""
COUNT = 8
"""Number of natural frequencies of each trial."""


def trial(number: int, magnet: Magnet, scene: str) -> Trial:
    """Return the trial of a scene on a design; its loads are depths, for scene critical the deepest of the search."""
    design = designs()[number]
    first, _ = press_limits(design, magnet)
    room = design.L - (design.magnet_height if magnet == "rigid" else 0.0)
    depths = {
        "critical": (stability.DEEPEST * room,),
        "small shear": (SHALLOW * first, first),
        "modes": (0.0, first),
    }
    return Trial(number, design, magnet, scene, "auto", tuple(Load(depth=rounded(d)) for d in depths[scene]))


def follow(trial: Trial, accuracy: Accuracy) -> list[SolvedState]:
    """Return the state at each depth of a trial, without estimates; a failure is a state as well."""
    return [_state(trial, load.depth, accuracy) for load in trial.loads]


def _state(trial: Trial, depth: float, accuracy: Accuracy) -> SolvedState:
    begin = time.process_time()
    try:
        tangent = _solved(trial, depth, accuracy)
    except Exception as error:
        # the study goes on: a crash is one of its results
        status = "failed" if isinstance(error, BadInput) else "crashed"
        return SolvedState(status, f"{type(error).__name__}: {error}")
    spent = time.process_time() - begin
    if isinstance(tangent, Critical) and tangent.depth is None:
        message = f"{tangent.message or 'no instability'} down to {tangent.stable_to:.4g} mm"
        return SolvedState("stable", message, cpu_s=spent)
    return SolvedState("ok", "", cpu_s=spent, tangent=tangent)


def _solved(trial: Trial, depth: float, accuracy: Accuracy) -> Tangent:
    design, magnet = trial.design, trial.magnet
    if trial.scene == "critical":
        return stability.critical(design, magnet, accuracy=accuracy, deepest=depth, estimate=False)
    if trial.scene == "small shear":
        return small_shear.small_shear(design, depth, magnet, accuracy=accuracy, estimate=False)
    return modes.modes(design, magnet, COUNT, depth=depth, accuracy=accuracy, estimate=False)


def states_of(trial: Trial, level: Accuracy, paths: Mapping[str, Sequence[SolvedState]]) -> list[ErrorState]:
    """Return a state with its errors for each depth of a trial, or for each natural frequency.

    Parameters
    ----------
    paths : solved states by ROLES.
    """
    states = []
    for i, load in enumerate(trial.loads):
        solved = {role: path[min(i, len(path) - 1)] for role, path in paths.items()}
        state = error_state(trial, level, load, solved)
        if state.status != "ok":
            states.append(state)
            continue
        level_solve, companion, reference = (TangentSolve(solved[role].cpu_s) for role in ROLES)
        state = replace(state, solve=level_solve, companion=companion, reference=reference)
        one, other, truth = (solved[role].tangent for role in ROLES)
        scene = Scene(trial.design, (load,), level, trial.magnet)
        if isinstance(one, Modes) and isinstance(other, Modes) and isinstance(truth, Modes):
            estimates = modes.estimate_frequencies(one, other, scene)
            judged = _judged_frequencies(replace(one, estimates=estimates), truth)
            states += [replace(state, shape=shape, judged=(frequency,)) for shape, frequency in judged]
        else:
            states.append(replace(state, judged=_judged(scene, one, other, truth)))
    return states


def _judged(scene: Scene, one: Tangent | None, other: Tangent | None, truth: Tangent | None) -> tuple[Judged, ...]:
    """Return errors and estimates of a critical state or a small shear; a user gets the same estimates."""
    if isinstance(one, Critical) and isinstance(other, Critical) and isinstance(truth, Critical):
        critical = stability.estimate_critical(one, other, scene)
        return (
            judged("depth", one.depth, truth.depth, critical.depth, other.depth),
            judged("force", one.force, truth.force, critical.force, other.force),
        )
    assert isinstance(one, SmallShear)
    assert isinstance(other, SmallShear)
    assert isinstance(truth, SmallShear)
    small = small_shear.estimate_small_shear(one, other, scene)
    return (
        judged("stiffness", one.stiffness, truth.stiffness, small.stiffness, other.stiffness),
        judged("shift", one.shift, truth.shift, small.shift, other.shift),
        judged("tilt", one.tilt, truth.tilt, small.tilt, other.tilt),
    )


def _judged_frequencies(solved: Modes, truth: Modes) -> Iterator[tuple[str, Judged]]:
    """Yield shape and frequency of each mode that the reference also has.

    Frequencies of one shape are paired in rising order, because modes of different shapes may swap places.
    """
    left: dict[str, list[float]] = {}
    for frequency, name in zip(truth.frequency, truth.shape, strict=True):
        left.setdefault(name, []).append(frequency)
    for value, name, estimate in zip(solved.frequency, solved.shape, solved.estimates, strict=True):
        if left.get(name):
            yield name, judged("frequency", value, left[name].pop(0), estimate)


def judged(
    quantity: str,
    value: float | None,
    reference: float | None,
    estimate: float | None,
    companion: float | None = None,
) -> Judged:
    """Return a quantity with its relative error and its estimate; states with status "ok" have both values."""
    assert value is not None
    assert reference is not None
    return Judged(quantity, abs(value / reference - 1), nan_if_none(estimate), value, reference, companion)


def chosen(numbers: Sequence[int], fine: Sequence[int], ignored: Sequence[int]) -> list[tuple[Trial, str]]:
    """Return trials and the names of their levels.

    Parameters
    ----------
    numbers, fine, ignored : designs of the study; those also solved at level fine; those also solved without magnet.
    """
    trials: list[tuple[Trial, str]] = []
    for scene in TANGENTS:
        magnets: tuple[tuple[Magnet, Sequence[int]], ...] = (("rigid", numbers), ("ignored", ignored))
        for magnet, these in magnets:
            trials += [(trial(n, magnet, scene), name) for n in these for name in ("quick", "standard")]
            trials += [(trial(n, magnet, scene), "fine") for n in these if n in fine]
    return trials
