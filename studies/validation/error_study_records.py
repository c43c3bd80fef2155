"""Records of the study of error estimates: a solved state as it is stored, and a state with its true errors."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from fem.accuracy import Accuracy
from fem.analyses.modes import Modes
from fem.analyses.small_shear import SmallShear
from fem.analyses.stability import Critical
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
"""Type of the result of each scene that follows from a tangent."""
ROLES = ("", "companion_", "reference_")
"""Prefixes of the columns of a state's three solves: its level, the coarser level of its estimate, the reference."""
NAMES = {"": "level", "companion_": "coarser level", "reference_": "reference"}
"""Names of ROLES in messages."""
UNSTABLE = ("unstable", "stable")
"""Statuses of a path beyond its instability, and of a search that found none: no error can be measured."""
DISAGREES = "disagrees"
"""Status of a state that is stable, or has an answer, by some of its three solves only."""


@dataclass(frozen=True, slots=True)
class SolvedState:
    """One solved state, without estimates; None where the solve failed or has no such value.

    Attributes
    ----------
    response : response of a state on a path of loads.
    tangent : critical state, small shear or modes about a press.
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
        """Return the state as a row of solves.jsonl, which `restored` reads."""
        row = records.flat(self)
        row["response"] = None if self.response is None else dataclasses.asdict(self.response)
        row["found"] = None if self.tangent is None else dataclasses.asdict(self.tangent)
        del row["tangent"]
        return records.known(row)


def restored(scene: str, answer: Mapping[str, Any]) -> SolvedState:
    """Return the solved state of a scene from its row in solves.jsonl."""
    values = dict(answer)
    response, tangent = values.pop("response", None), values.pop("found", None)
    return SolvedState(
        **values,
        response=None if response is None else Response.restored(response),
        tangent=None if tangent is None else TANGENTS[scene](**_tuples(tangent)),
    )


def _tuples(values: Mapping[str, Any]) -> FlatRow:
    """Return the values without estimates, with tuples in place of JSON's lists."""
    return {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in values.items()
        if name != "estimates"
    }


@dataclass(frozen=True, slots=True)
class PathSolve:
    """Response and cost of one of the three solves of a state on a path of loads."""

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
    """True error and estimate of one quantity, relative; NaN where the reference is zero.

    Attributes
    ----------
    value, reference, companion : values of the three solves, if PathSolve does not hold them.
    """

    quantity: str
    error: float
    estimate: float
    value: float | None = None
    reference: float | None = None
    companion: float | None = None

    def row(self) -> FlatRow:
        """Return the columns of the quantity, which bear its name."""
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
    """One state of the study with its true errors; none if a solve failed.

    Attributes
    ----------
    odd : whether the design's number is odd.
    scene : group of the statistics; the press before a shear is a scene of its own, "pressed".
    path : scene of the whole path.
    shape : shape of a natural mode.
    judged : true errors and estimates, one for each quantity.
    commit : that of the code that solved it.
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
    commit: str = ""

    def row(self) -> FlatRow:
        """Return the state as columns of accuracy.csv."""
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
    """Return a state without its errors: design, load, and status of the three solves.

    Parameters
    ----------
    states : the three solves by ROLES.
    lost : whether a path stopped before this load.
    """
    bad = {role: state for role, state in states.items() if state.status != "ok"}
    status = next((state.status for state in bad.values()), "lost" if lost else "ok")
    if status in UNSTABLE and len({state.status for state in states.values()}) > 1:
        status = DISAGREES
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
        status=status,
        message="; ".join(f"{NAMES[role]}: {state.message}" for role, state in bad.items()),
    )


def nan_if_none(estimate: float | None) -> float:
    """Return an estimate, or NaN for None."""
    return math.nan if estimate is None else estimate
