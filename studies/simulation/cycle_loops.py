"""States of a loading cycle with readings and decoded force, and the measures of each loop.

Gap and full scale of a loop are those of the paper's Figure 13: the difference of the forces on both ways at
mid-stroke, over the difference of the largest and the least force. The decoded force is read from the outputs by the
sensor's static inverse: the point nearest to them on the curve of outputs that slow, fully relaxed loading passes
through, and the force there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from analytic.batch_readings import batch_readings
from fem.analyses.timed_path import TimedState
from geometry.arrays import Array
from geometry.design import Design
from studies.output import records
from studies.output.records import FlatRow
from studies.simulation.cycle_motion import Motion, Phase, Stop


@dataclass(frozen=True, slots=True)
class CycleState:
    """A state with its place in the cycle, the elements' outputs (V, or T for a chip), and the decoded force."""

    stop: Stop
    state: TimedState
    at_stop: bool
    outputs: Array
    decoded: float

    def row(self, unit: str) -> FlatRow:
        """Return the row of cycle.csv."""
        s, r = self.state, self.state.response
        row: FlatRow = {
            "time_s": s.time,
            "cycle": self.stop.cycle,
            "phase": self.stop.phase,
            "depth_mm": s.load.depth,
            "shear_mm": s.load.shear_x,
        }
        row |= {f"force_{axis}_N": value for axis, value in zip("xyz", r.force, strict=True)}
        row |= {f"shift_{axis}_mm": value for axis, value in zip("xyz", r.shift, strict=True)}
        row |= {"tilt_rad": r.tilt, "contact_radius_mm": r.contact_radius}
        row |= {f"S{i}_{unit}": float(value) for i, value in enumerate(self.outputs, 1)}
        return row | {
            "decoded_force_N": self.decoded,
            "time_error": s.time_error,
            "work_mJ": s.work,
            "stored_mJ": s.stored,
            "dissipated_mJ": s.dissipated,
            "friction_dissipated_mJ": s.friction_dissipated,
        }


@dataclass(frozen=True, slots=True)
class LoopRow:
    """The loop of one cycle.

    Attributes
    ----------
    largest_N, full_scale_N : largest force along the motion, and its difference to the least one.
    gap_N, gap_percent : difference of the forces at mid-stroke, in and out, also in percent of full scale.
    area_mJ : work of the plate in the cycle, the area of the loop.
    material_mJ, friction_mJ : what silicone and friction dissipated in it; the rest was stored, or, if negative,
        stored before and released.
    decoded_gap_percent : gap of the decoded force, in percent of its full scale; None without a magnet.
    decoded_error_percent : largest difference of the decoded force and the force, in percent of full scale.
    """

    cycle: int
    largest_N: float
    full_scale_N: float
    gap_N: float
    gap_percent: float
    area_mJ: float
    material_mJ: float
    friction_mJ: float
    decoded_gap_percent: float | None
    decoded_error_percent: float | None

    def row(self) -> FlatRow:
        """Return the flat row for tables and JSON."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class StaticCurve:
    """Forces (n,) along the motion of slow loading, and the outputs (n, 3) of the elements; None without a magnet."""

    forces: Array
    outputs: Array

    def decode(self, outputs: Array) -> Array:
        """Return the forces (m,) of outputs (m, 3): those of the nearest points of the curve."""
        begin, along = self.outputs[:-1], np.diff(self.outputs, axis=0)
        length = np.maximum((along**2).sum(axis=1), 1e-300)
        share = np.clip(np.einsum("mnk,nk->mn", outputs[:, None] - begin, along) / length, 0, 1)
        off = ((outputs[:, None] - begin - share[..., None] * along) ** 2).sum(axis=2)
        best = off.argmin(axis=1)
        part = share[np.arange(len(outputs)), best]
        return np.asarray(self.forces[best] + part * np.diff(self.forces)[best])


def outputs_of(design: Design, shifts: Array, tilts: Array) -> Array:
    """Return the outputs (n, 3) of the elements for shifts (n, 3), mm, and tilts (n,) towards x, rad."""
    rotations = np.stack([np.zeros(len(tilts)), tilts], axis=1)
    return batch_readings([design], np.zeros(len(shifts), dtype=np.int64), shifts, rotations).output


def with_readings(
    design: Design, passed: Sequence[tuple[Stop, TimedState, bool]], curve: StaticCurve | None
) -> list[CycleState]:
    """Return the states with their outputs and decoded forces."""
    shifts = np.array([state.response.shift for _, state, _ in passed])
    outputs = outputs_of(design, shifts, np.array([state.response.tilt for _, state, _ in passed]))
    decoded = np.full(len(passed), np.nan) if curve is None else curve.decode(outputs)
    # the curve is that of the strokes: it knows no press before a shear
    decoded[[stop.phase == "press" and not state.load.shear_x for stop, state, _ in passed]] = np.nan
    return [
        CycleState(stop, state, at_stop, one, float(force))
        for (stop, state, at_stop), one, force in zip(passed, outputs, decoded, strict=True)
    ]


def loops(motion: Motion, states: Sequence[CycleState]) -> list[LoopRow]:
    """Return the loops of all complete cycles."""
    rows = []
    for cycle in range(1, motion.cycles + 1):
        own = [one for one in states if one.stop.cycle == cycle]
        ends = [one for one in own if one.at_stop and one.stop.place == "end"]
        if len(ends) == 2:
            rows.append(_loop(motion, cycle, own, _before(states, own)))
    return rows


def _before(states: Sequence[CycleState], own: Sequence[CycleState]) -> TimedState | None:
    """Return the state before a cycle; None at rest."""
    at = states.index(own[0])
    return states[at - 1].state if at else None


def _loop(motion: Motion, cycle: int, own: Sequence[CycleState], before: TimedState | None) -> LoopRow:
    axis, last = 0 if motion.shear else 2, own[-1].state
    # forces count along the first way of the plate
    way = -1.0 if motion.shear < 0 else 1.0
    force = way * np.array([one.state.response.force[axis] for one in own])
    decoded = way * np.array([one.decoded for one in own])
    # a shear passes its ends outside of a cycle too
    gap, scale = _gap(own, force), _scale(force, None if before is None else way * before.response.force[axis])
    known = bool(np.isfinite(decoded).all())
    start = (0.0, 0.0, 0.0) if before is None else (before.work, before.dissipated, before.friction_dissipated)
    most = max(abs(one.state.work) for one in own)
    return LoopRow(
        cycle=cycle,
        largest_N=float(np.abs(force).max()),
        full_scale_N=scale,
        gap_N=_rounded(gap, scale),
        gap_percent=100 * _rounded(gap, scale) / scale if scale else 0.0,
        area_mJ=_rounded(last.work - start[0], most),
        material_mJ=_rounded(last.dissipated - start[1], most),
        friction_mJ=_rounded(last.friction_dissipated - start[2], most),
        decoded_gap_percent=100 * _rounded(_gap(own, decoded), scale) / float(np.ptp(decoded))
        if known and np.ptp(decoded)
        else None,
        decoded_error_percent=100 * float(np.abs(decoded - force).max()) / scale if known and scale else None,
    )


def _rounded(value: float, scale: float) -> float:
    """Return a value rounded to a millionth of a scale: far below the errors, but in sight where it should be 0."""
    return round(value, 5 - math.floor(math.log10(scale))) + 0.0 if scale else value


def _gap(own: Sequence[CycleState], force: Iterable[float]) -> float:
    """Return the difference of the forces at mid-stroke, on the way in and on the way out."""
    middle: dict[Phase, float] = {
        one.stop.phase: float(value)
        for one, value in zip(own, force, strict=True)
        if one.at_stop and one.stop.place == "middle"
    }
    return middle["in"] - middle["out"]


def _scale(force: Array, before: float | None) -> float:
    """Return the difference of the largest and the least force of a cycle, with that before it."""
    return float(np.ptp(force if before is None else np.append(force, before)))
