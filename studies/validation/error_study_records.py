"""Records of the study of error estimates: a solved state as it is kept, and a state with its true errors."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from fem.accuracy import Accuracy
from fem.modes import Modes
from fem.small_shear import SmallShear
from fem.stability import Critical
from geometry.loads import Load, Magnet, Response
from studies.output import records
from studies.output.records import FlatRow
from studies.validation.error_study_cases import Trial

Tangent = Critical | SmallShear | Modes
TANGENTS: dict[str, type[Critical] | type[SmallShear] | type[Modes]] = {
    "critical": Critical,
    "small shear": SmallShear,
    "modes": Modes,
}
"""What the tangent tells in a scene."""
ROLES = ("", "companion_", "reference_")
"""Of the three solves of a state: its level, the level's companion, the reference; prefixes of their columns."""
JUMP = 0.25
"""True error beyond which a state is none of the mesh: another equilibrium."""


@dataclass(frozen=True, slots=True)
class SolvedState:
    """One state as a solve leaves it, without estimates; None where the solve failed or has no such number.

    Attributes
    ----------
    response : of a path of loads.
    tangent : what the tangent about a press tells.
    """

    status: str
    message: str
    model: str | None = None
    dofs: int | None = None
    iterations: int | None = None
    cpu_s: float | None = None
    response: Response | None = None
    tangent: Tangent | None = None

    def kept(self) -> FlatRow:
        """The state as solves.jsonl keeps it; `restored` reads it."""
        row = records.flat(self)
        row["response"] = None if self.response is None else dataclasses.asdict(self.response)
        row["found"] = None if self.tangent is None else dataclasses.asdict(self.tangent)
        del row["tangent"]
        return records.known(row)


def restored(scene: str, answer: Mapping[str, Any]) -> SolvedState:
    """A kept state of a scene."""
    values = dict(answer)
    response, tangent = values.pop("response", None), values.pop("found", None)
    return SolvedState(
        **values,
        response=None if response is None else Response(**_tuples(response)),
        tangent=None if tangent is None else TANGENTS[scene](**_tuples(tangent)),
    )


def _tuples(values: Mapping[str, Any]) -> FlatRow:
    """The values without estimates, with tuples in place of JSON's lists."""
    return {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in values.items()
        if name != "estimates"
    }


@dataclass(frozen=True, slots=True)
class PathSolve:
    """Answer and cost of one of the three solves of a state on a path of loads."""

    force_x_N: float
    force_z_N: float
    shift_x_mm: float
    shift_z_mm: float
    tilt_rad: float
    dofs: int | None
    iterations: int | None
    cpu_s: float | None


@dataclass(frozen=True, slots=True)
class TangentSolve:
    """Cost of one of the three solves of a tangent."""

    cpu_s: float | None


@dataclass(frozen=True, slots=True)
class Judged:
    """True error and estimate of one quantity; NaN where there is nothing to be relative to.

    Attributes
    ----------
    value, reference, companion : of the three solves, where the columns of the solves do not have them.
    """

    quantity: str
    error: float
    estimate: float
    value: float | None = None
    reference: float | None = None
    companion: float | None = None

    def row(self) -> FlatRow:
        """Its columns, named by the quantity."""
        name = self.quantity
        return records.known(
            {
                name: self.value,
                f"reference_{name}": self.reference,
                f"{name}_error": self.error,
                f"{name}_estimate": self.estimate,
                f"companion_{name}": self.companion,
            }
        )


@dataclass(frozen=True, slots=True)
class ErrorState:
    """One state of the study with the true errors of what it is judged by; none where a solve ended badly.

    Attributes
    ----------
    odd : whether the design's number is odd.
    scene : as the statistics group it: the press before a shear is a scene of its own.
    path : the scene of the whole path.
    shape : of a natural mode.
    """

    design: int
    odd: bool
    magnet: Magnet
    scene: str
    path: str
    model: str
    level: str
    repeat: int
    depth_mm: float
    shear_mm: float
    status: str
    message: str
    solve: PathSolve | TangentSolve | None = field(default=None, metadata={"prefix": ""})
    companion: PathSolve | TangentSolve | None = field(default=None, metadata={"prefix": "companion_"})
    reference: PathSolve | TangentSolve | None = field(default=None, metadata={"prefix": "reference_"})
    shape: str | None = None
    judged: tuple[Judged, ...] = ()

    def row(self) -> FlatRow:
        """Its columns in accuracy.csv."""
        row = records.known(records.flat(replace(self, judged=())))
        del row["judged"]
        for judged in self.judged:
            row |= judged.row()
        return row


def error_state(
    trial: Trial,
    level: Accuracy,
    load: Load,
    states: Mapping[str, SolvedState],
    *,
    repeat: int = 0,
    lost: bool = False,
) -> ErrorState:
    """A state before its errors are known: where it is, and how its solves ended.

    Parameters
    ----------
    states : by ROLES.
    lost : whether a path ended before this load.
    """
    bad = {role: state for role, state in states.items() if state.status != "ok"}
    return ErrorState(
        design=trial.number,
        odd=trial.odd,
        magnet=trial.magnet,
        scene="pressed" if trial.scene == "stick" and not load.shear_x else trial.scene,
        path=trial.scene,
        model="axisymmetric" if trial.scene in TANGENTS else states[""].model or trial.model,
        level=level.name,
        repeat=repeat,
        depth_mm=load.depth,
        shear_mm=0.0 if trial.scene in TANGENTS else load.shear_x,
        status=next((state.status for state in bad.values()), "lost" if lost else "ok"),
        message="; ".join(f"{role.strip('_') or 'level'}: {state.message}" for role, state in bad.items()),
    )


def without_jump(state: ErrorState) -> ErrorState:
    """The state, with another status if an error is none of the mesh."""
    if any(judged.error > JUMP for judged in state.judged):
        return replace(state, status="jump", message=f"an error exceeds {JUMP:g}")
    return state


def nan_if_none(estimate: float | None) -> float:
    """An estimate, NaN where there is none."""
    return math.nan if estimate is None else estimate
