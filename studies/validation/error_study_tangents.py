"""Trials of what the tangent about a press tells: critical depths, small shears of a glued plate, frequencies.

They are solved at a level, by its companion and on a much finer mesh, as the paths of `accuracy` are.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from fem import modes, stability
from fem.accuracy import Accuracy
from fem.error_estimate_rules import PRESS_DEPTH, press_limits
from fem.modes import Modes
from fem.stability import Critical, CriticalEstimates, SmallShear, SmallShearEstimates
from geometry.design import BadInput
from geometry.loads import Load, Magnet
from studies.validation.error_study_cases import Trial, designs, rounded

Row = dict[str, Any]
State = dict[str, Any]
Found = Critical | SmallShear | Modes

SCENES: dict[str, tuple[str, ...]] = {
    "critical": ("depth", "force"),
    "small shear": ("stiffness", "shift", "tilt"),
    "modes": ("frequency",),
}
"""What is judged in each scene."""
MODULES = ("fem/stability.py", "fem/modes.py")
"""Modules of `fem` that only these scenes use."""
KINDS: dict[str, Callable[..., Found]] = {"critical": Critical, "small shear": SmallShear, "modes": Modes}
SHALLOW = 0.1 / PRESS_DEPTH
"""Lesser depth of a small shear, over the deepest of the other presses, at which the modes are looked at too."""
COUNT = 8
"""Natural frequencies of each trial."""


def trial(number: int, magnet: Magnet, scene: str) -> Trial:
    """A scene of a design; its loads are the depths that are looked at, or down to which one looks."""
    design = designs()[number]
    first, _ = press_limits(design, magnet)
    room = design.L - (design.magnet_height if magnet == "rigid" else 0.0)
    depths = {
        "critical": (stability.DEEPEST * room,),
        "small shear": (SHALLOW * first, first),
        "modes": (0.0, first),
    }
    return Trial(number, design, magnet, scene, "auto", tuple(Load(depth=rounded(d)) for d in depths[scene]))


def follow(trial: Trial, accuracy: Accuracy) -> list[State]:
    """What is found at each depth of a trial, without estimates; what fails is a finding too."""
    return [_state(trial, load.depth, accuracy) for load in trial.loads]


def _state(trial: Trial, depth: float, accuracy: Accuracy) -> State:
    begin = time.process_time()
    try:
        found = _solved(trial, depth, accuracy)
    except Exception as error:
        # whatever goes wrong with a mesh is a finding of this study
        status = "failed" if isinstance(error, BadInput) else "crashed"
        return {"status": status, "message": f"{type(error).__name__}: {error}"}
    spent = time.process_time() - begin
    if isinstance(found, Critical) and found.depth is None:
        said = f"{found.message or 'no instability'} down to {found.stable_to:.4g} mm"
        return {"status": "stable", "message": said, "cpu_s": spent}
    return {"status": "ok", "message": "", "cpu_s": spent, "found": dataclasses.asdict(found)}


def _solved(trial: Trial, depth: float, accuracy: Accuracy) -> Found:
    design, magnet = trial.design, trial.magnet
    if trial.scene == "critical":
        return stability.critical(design, magnet, accuracy=accuracy, deepest=depth, estimate=False)
    if trial.scene == "small shear":
        return stability.small_shear(design, depth, magnet, accuracy=accuracy, estimate=False)
    return modes.modes(design, magnet, COUNT, depth=depth, accuracy=accuracy, estimate=False)


def rows_of(trial: Trial, level: Accuracy, paths: dict[str, list[State]]) -> list[Row]:
    """A row for each depth of a trial, or for each natural frequency, with true errors and estimates.

    Parameters
    ----------
    paths : the states of the level (""), of its companion ("companion_") and of the reference ("reference_").
    """
    rows = []
    for i, load in enumerate(trial.loads):
        states = {role: path[min(i, len(path) - 1)] for role, path in paths.items()}
        bad = {role: state for role, state in states.items() if state["status"] != "ok"}
        head: Row = {
            "design": trial.number,
            "odd": trial.odd,
            "magnet": trial.magnet,
            "scene": trial.scene,
            "path": trial.scene,
            "model": "axisymmetric",
            "level": level.name,
            "repeat": 0,
            "depth_mm": load.depth,
            "shear_mm": 0.0,
            "status": next((state["status"] for state in bad.values()), "ok"),
            "message": "; ".join(f"{role.strip('_') or 'level'}: {s['message']}" for role, s in bad.items()),
        }
        if bad:
            rows.append(head)
            continue
        one, other, truth = (_restored(trial.scene, states[role]) for role in ("", "companion_", "reference_"))
        spent = {f"{role}cpu_s": state["cpu_s"] for role, state in states.items()}
        rows += [head | spent | pair for pair in _pairs(trial, load.depth, level, one, other, truth)]
    return rows


def _restored(scene: str, state: State) -> Found:
    """What was solved, without estimates."""
    values = {name: tuple(value) if isinstance(value, list) else value for name, value in state["found"].items()}
    return KINDS[scene](**{name: value for name, value in values.items() if name != "estimates"})


def _pairs(trial: Trial, depth: float, level: Accuracy, one: Found, other: Found, truth: Found) -> list[Row]:
    """Errors and estimates, as a user would get them."""
    if isinstance(one, Modes) and isinstance(other, Modes) and isinstance(truth, Modes):
        estimates = modes.estimate_frequencies(one, other, trial.design, trial.magnet, level, depth)
        return _modes(replace(one, estimates=estimates), truth)
    judged: CriticalEstimates | SmallShearEstimates
    if isinstance(one, Critical) and isinstance(other, Critical):
        judged = stability.estimate_critical(one, other, trial.magnet, level, trial.design.D)
    else:
        assert isinstance(one, SmallShear)
        assert isinstance(other, SmallShear)
        judged = stability.estimate_small_shear(one, other, trial.magnet, level, trial.design.D)
    row: Row = {}
    for name in SCENES[trial.scene]:
        row |= _pair(name, getattr(one, name), getattr(truth, name), getattr(judged, name))
        row |= {f"companion_{name}": getattr(other, name)}
    return [row]


def _modes(judged: Modes, truth: Modes) -> list[Row]:
    """One row for each mode that the reference has too: the first, second, ... of a shape belong together."""
    left: dict[str, list[float]] = {}
    for frequency, name in zip(truth.frequency, truth.shape, strict=True):
        left.setdefault(name, []).append(frequency)
    rows = []
    for value, name, error in zip(judged.frequency, judged.shape, judged.estimates, strict=True):
        if left.get(name):
            rows.append({"shape": name} | _pair("frequency", value, left[name].pop(0), error))
    return rows


def _pair(name: str, value: float, true: float, estimate: float | None) -> Row:
    nothing = float("nan")
    return {
        name: value,
        f"reference_{name}": true,
        f"{name}_error": abs(value / true - 1),
        f"{name}_estimate": nothing if estimate is None else estimate,
    }


def chosen(numbers: Sequence[int], fine: Sequence[int], ignored: Sequence[int]) -> list[tuple[Trial, str]]:
    """Trials and the names of their levels.

    Parameters
    ----------
    numbers, fine, ignored : designs that are looked at, those at level fine too, and those without magnet.
    """
    found: list[tuple[Trial, str]] = []
    for scene in SCENES:
        magnets: tuple[tuple[Magnet, Sequence[int]], ...] = (("rigid", numbers), ("ignored", ignored))
        for magnet, these in magnets:
            found += [(trial(n, magnet, scene), name) for n in these for name in ("quick", "standard")]
            found += [(trial(n, magnet, scene), "fine") for n in these if n in fine]
    return found
