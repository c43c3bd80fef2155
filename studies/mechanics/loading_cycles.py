"""Loading cycles of a viscoelastic sensor: the motion followed in time, its readings, and the measures of each loop.

Gap and full scale of a loop are those of the paper's Figure 13: the difference of the forces on both ways at
mid-stroke, over the difference of the largest and the least force. The decoded force is read from the outputs by the
sensor's static inverse: the point nearest to them on the curve of outputs that slow, fully relaxed loading passes
through, and the force there. The observed force adds what the silicone relaxes (`analytic.time_series`).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from analytic.hall import batch_readings
from analytic.relaxation_loops import loop
from analytic.time_series import RelaxingForce
from fem.accuracy import LEVELS
from fem.scene import Scene
from geometry.arrays import Array
from geometry.bad_input import OutOfReach
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, Magnet, check_load
from geometry.messages import Progress
from geometry.relaxation import relaxation_of
from studies.mechanics.cycle_motion import Motion, Stop, stops
from studies.output.records import FlatRow

if TYPE_CHECKING:
    from fem.analyses.timed_path import TimedState

STEPS = 32
"""Least number of time steps of a stroke, so that the area of its loop is accurate to some tenths of a percent."""
CURVE, BEYOND = 24, 0.25
"""States of the static curve, and the share of its way by which it goes on straight beyond its end."""
SEARCHES, GAP_TOLERANCE = 6, 0.05
"""Most runs of the search for a loss factor, and the difference from the wanted gap at which it ends, percentage
points."""
EXPECTED = ("part_slips", "full_slip", "idle_stick", "touch_lost")
"""Remarks on single states of a motion that limit nothing."""
MOST_LOSS = 1.0
"""Largest loss factor of the search, the bound of the design's field."""


# States and loops

Loop = dict[str, Any]
"""The loop of one cycle, a row of loops.csv: largest force along the motion and its difference to the least one
(full scale); gap of the forces at mid-stroke, in and out; area, the work of the plate; what silicone and friction
dissipated (the rest was stored, or, if negative, stored before and released); gap of the decoded force, and largest
difference of the decoded and of the observed force from the force, percent of full scale, None without a magnet."""


@dataclass(frozen=True, slots=True)
class StaticCurve:
    """States of slow loading along the motion.

    loads : force along x and along z, N, and shear, mm, shape (n, 3).
    outputs : of the elements, shape (n, 3).
    axis : column of the force along the motion in `loads`.
    """

    loads: Array
    outputs: Array
    axis: int

    def decode(self, outputs: Array) -> Array:
        """Return the loads (m, 3) of outputs (m, 3): those of the nearest points of the curve."""
        begin, along = self.outputs[:-1], np.diff(self.outputs, axis=0)
        length = np.maximum((along**2).sum(axis=1), 1e-300)
        share = np.clip(np.einsum("mnk,nk->mn", outputs[:, None] - begin, along) / length, 0, 1)
        off = ((outputs[:, None] - begin - share[..., None] * along) ** 2).sum(axis=2)
        best = off.argmin(axis=1)
        part = share[np.arange(len(outputs)), best]
        return np.asarray(self.loads[best] + part[:, None] * np.diff(self.loads, axis=0)[best])


@dataclass(frozen=True, slots=True, eq=False)
class MadeStates:
    """What a calibrated sensor answers in n states.

    force : (n, 3) of the plate, N.
    outputs : (n, k) of its elements.
    decoded, observed, half_width : (n, 3) force by its calibration as if loaded slowly, and with what the silicone
        relaxes, with half of the 90 % interval of this one, N.
    """

    force: Array
    outputs: Array
    decoded: Array
    observed: Array
    half_width: Array


Made = Callable[[Design, Array, Array, Array, Array], MadeStates]
"""Returns the answers of a calibrated sensor from a design with its branches, and times (n,), s, shifts (n, 3), mm,
tilts (n, 2), rad, and forces (n, 3), N, of its states."""


def outputs_of(design: Design, shifts: Array, tilts: Array) -> Array:
    """Return the outputs (n, 3) of the elements for shifts (n, 3), mm, and tilts (n,) towards x, rad."""
    rotations = np.stack([np.zeros(len(tilts)), tilts], axis=1)
    return batch_readings([design], np.zeros(len(shifts), dtype=np.int64), shifts, rotations).output


OF_TIME = ("time_error", "work_mJ", "stored_mJ", "dissipated_mJ", "friction_dissipated_mJ")
"""Columns of a state that the steps of time before it decide."""


def _state_row(stop: Stop, state: TimedState, *, at_stop: bool) -> FlatRow:
    """Return a state, at or on the way to a stop, as it is stored; it does not depend on the Hall elements."""
    solution, r = state.solution, state.solution.response
    energies = state.time_error, state.work, solution.energy, state.dissipated, solution.dissipated
    return {
        "time_s": state.time,
        "cycle": stop.cycle,
        "phase": stop.phase,
        "place": stop.place if at_stop else "",
        "depth_mm": solution.load.depth,
        "shear_mm": solution.load.shear_x,
        "force": list(r.force),
        "shift": list(r.shift),
        "rotation": list(r.rotation),
        "tilt_rad": r.tilt,
        "contact_radius_mm": r.contact_radius,
        **dict(zip(OF_TIME, energies, strict=True)),
    }


def rows_of(design: Design, passed: Sequence[FlatRow], static: Static) -> list[FlatRow]:
    """Return the rows of cycle.csv, each with the `place` of its stop, "" on the way to it.

    Outputs are in V, or T for a chip. A calibrated sensor has forces of its own, and the half width of the observed
    one's 90 % interval.
    """
    shifts, turned, force, times = (
        np.array([state[name] for state in passed]) for name in ("shift", "rotation", "force", "time_s")
    )
    half_width: Array | None = None
    if static.made is not None:
        found = static.made(design, times, shifts, turned, force)
        force, outputs = found.force, found.outputs
        axis = 0 if any(state["shear_mm"] for state in passed) else 2
        decoded, observed, half_width = (each[:, axis] for each in (found.decoded, found.observed, found.half_width))
    else:
        outputs = outputs_of(design, shifts, np.array([state["tilt_rad"] for state in passed]))
        decoded, observed = _decoded(design, passed, outputs, static.curve)
    unit, rows = "V" if design.hall_layout == "three" else "T", []
    for k, state in enumerate(passed):
        rows.append({
            **{name: state[name] for name in ("time_s", "cycle", "phase", "depth_mm", "shear_mm")},
            **{f"force_{axis}_N": value for axis, value in zip("xyz", force[k].tolist(), strict=True)},
            **{f"shift_{axis}_mm": value for axis, value in zip("xyz", state["shift"], strict=True)},
            **{name: state[name] for name in ("tilt_rad", "contact_radius_mm")},
            **{f"S{i}_{unit}": float(value) for i, value in enumerate(outputs[k], 1)},
            "decoded_force_N": float(decoded[k]),
            "observed_force_N": float(observed[k]),
            **({} if half_width is None else {"half_width_N": float(half_width[k])}),
            **{name: state[name] for name in (*OF_TIME, "place")},
        })  # fmt: skip
    return rows


def _decoded(
    design: Design, passed: Sequence[FlatRow], outputs: Array, curve: StaticCurve | None
) -> tuple[Array, Array]:
    """Return decoded and observed force along the motion, (n,) each; NaN without a curve."""
    loads, axis = (np.full((len(passed), 3), np.nan), 0) if curve is None else (curve.decode(outputs), curve.axis)
    # the curve is that of the strokes: it knows no press before a shear
    loads[[state["phase"] == "press" and not state["shear_mm"] for state in passed]] = np.nan
    law = RelaxingForce(design)
    law.step(0.0, np.zeros(3), np.zeros(2))
    observed = [
        law.step(state["time_s"], np.array([x, 0.0, z]) / law.slow, np.array([shear, 0.0]))[[0, 2]]
        for state, (x, z, shear) in zip(passed, loads, strict=True)
    ]
    return loads[:, axis], np.array(observed)[:, axis]


def loops_of(motion: Motion, rows: Sequence[FlatRow]) -> list[Loop]:
    """Return the loops of all complete cycles of `rows_of`."""
    loops = []
    for cycle in range(1, motion.cycles + 1):
        own = [k for k, row in enumerate(rows) if row["cycle"] == cycle]
        if sum(rows[k]["place"] == "end" for k in own) == 2:
            loops.append(_loop(motion, cycle, rows[own[0] : own[-1] + 1], rows[own[0] - 1] if own[0] else None))
    return loops


def _loop(motion: Motion, cycle: int, own: Sequence[FlatRow], before: FlatRow | None) -> Loop:
    along, last = f"force_{'x' if motion.shear else 'z'}_N", own[-1]
    # forces count along the first way of the plate
    way = -1.0 if motion.shear < 0 else 1.0
    force, decoded, observed = (
        way * np.array([row[name] for row in own]) for name in (along, "decoded_force_N", "observed_force_N")
    )
    # a shear passes its ends outside of a cycle too
    passed = force if before is None else np.append(force, way * before[along])
    gap, scale = _gap(own, force), float(np.ptp(passed))
    known = bool(np.isfinite(decoded).all())
    most = max(abs(row["work_mJ"]) for row in own)
    widths = [row["half_width_N"] for row in own if "half_width_N" in row]
    inside = np.abs(observed - force) <= widths if widths else np.zeros(0)
    interval = {"half_width_N": max(widths), "inside_percent": 100 * float(inside.mean())} if widths else {}
    errors = {
        f"{name}_error_percent": 100 * float(np.abs(values - force).max()) / scale if known and scale else None
        for name, values in (("decoded", decoded), ("observed", observed))
    }

    def since(name: str) -> float:
        return _rounded(last[name] - (before[name] if before else 0.0), most)

    return {
        "cycle": cycle,
        "largest_N": float(np.abs(force).max()),
        "full_scale_N": scale,
        "gap_N": _rounded(gap, scale),
        "gap_percent": 100 * _rounded(gap, scale) / scale if scale else 0.0,
        "area_mJ": since("work_mJ"),
        "material_mJ": since("dissipated_mJ"),
        "friction_mJ": since("friction_dissipated_mJ"),
        "decoded_gap_percent": 100 * _rounded(_gap(own, decoded), scale) / float(np.ptp(decoded))
        if known and np.ptp(decoded)
        else None,
        **errors,
        **interval,
    }


def _rounded(value: float, scale: float) -> float:
    """Return a value rounded to a millionth of a scale: far below the errors, but in sight where it should be 0."""
    return round(value, 5 - math.floor(math.log10(scale))) + 0.0 if scale else value


def _gap(own: Sequence[FlatRow], force: Iterable[float]) -> float:
    middle = {row["phase"]: float(value) for row, value in zip(own, force, strict=True) if row["place"] == "middle"}
    return middle["in"] - middle["out"]


# Motion in time


@dataclass(frozen=True, slots=True)
class Cycles:
    """The rows and loops of a motion by linear overstresses, the law "prony" of `fem.model.viscoelasticity`.

    status, message : "ok", "unstable" or "unknown" with the first such state, or why the path ended.
    rows : of `rows_of`.
    steps : number of time steps, and of degrees of freedom.
    seconds : of the processor.
    """

    status: str
    message: str
    rows: list[FlatRow]
    loops: list[Loop]
    steps: tuple[int, int] = (0, 0)
    seconds: float = 0.0

    @property
    def time_error(self) -> float:
        """Largest estimated error of the force from the time steps, over the largest force."""
        return max((row["time_error"] for row in self.rows), default=math.nan)

    @property
    def balance_error(self) -> float:
        """Largest work that is neither stored nor dissipated, an error of the time steps, over the largest work."""
        largest = max((row["work_mJ"] for row in self.rows), default=0.0)
        spent = ("stored_mJ", "dissipated_mJ", "friction_dissipated_mJ")
        lost = [row["work_mJ"] - row[spent[0]] - row[spent[1]] - row[spent[2]] for row in self.rows]
        return max(map(abs, lost)) / largest if largest > 0 else math.nan

    @property
    def drift_percent(self) -> float | None:
        """Change of the largest force from the first to the last cycle, percent; None for a single one."""
        if len(self.loops) < 2:
            return None
        return 100 * float(self.loops[-1]["largest_N"] / self.loops[0]["largest_N"] - 1)

    def record(self) -> FlatRow:
        """Return status, the loops and the errors for JSON."""
        return {
            "status": self.status,
            "message": self.message,
            "loops": self.loops,
            "drift_percent": self.drift_percent,
            "time_error": self.time_error if self.rows else None,
            "balance_error": self.balance_error if self.rows else None,
            "time_steps": self.steps[0],
            "dofs": self.steps[1],
            "seconds": self.seconds,
        }


@dataclass(frozen=True, slots=True)
class Static:
    """The slow, fully relaxed sensor.

    curve : its curve; None where it cannot be decoded or does not reach the end of the stroke.
    mesh_error : estimated relative error of the force at the end of the stroke, from the mesh.
    stop : why slow loading does not reach that end; empty if it does.
    made : a calibrated sensor, which answers and decodes in place of the curve.
    """

    curve: StaticCurve | None = None
    mesh_error: float | None = None
    stop: str = ""
    made: Made | None = None


def slow_loading(scene: Scene) -> dict[str, Any]:
    """Return the states of slow loading along a motion to the load of a scene, as they are stored; a shear sticks.

    "force", "shift" and "tilt" of each state; "mesh_error" as in `Static`; "stop", why they end before the load, and
    the states are then none.
    """
    from fem.equilibrium import trace

    (end,) = scene.loads
    way = end.shear_x or end.depth
    shares = np.linspace(0, 1, CURVE + 1)[1:]
    loads = [Load(end.depth, way * share, friction="stick") if end.shear_x else Load(way * share) for share in shares]
    solved = trace(scene.design, loads, scene.accuracy, magnet=scene.magnet, estimate=False)
    found: dict[str, Any] = {"force": [], "shift": [], "tilt": [], "mesh_error": None, "status": "ok", "message": ""}
    if len(solved) < CURVE or solved[-1].status not in ANSWERED:
        return found | {"stop": solved[-1].message.split(";")[0] or solved[-1].status}
    # estimated at the end alone, by a solve of its own: estimates at all loads would take twice as long as the curve
    estimates = trace(scene.design, loads[-1:], scene.accuracy, magnet=scene.magnet)[-1].estimates
    values = {name: [getattr(state.response, name) for state in solved] for name in ("force", "shift", "tilt")}
    return found | values | {"mesh_error": estimates.sideways if end.shear_x else estimates.force, "stop": ""}


class MotionInterrupted(KeyboardInterrupt):
    """Ctrl-C during a motion; `followed` is what `follow_motion` returns of the states that were reached."""

    def __init__(self, followed: dict[str, Any]) -> None:
        super().__init__()
        self.followed = followed


def follow_motion(
    design: Design, motion: Motion, accuracy: str, magnet: Magnet, tolerance: float, progress: Progress
) -> dict[str, Any]:
    """Follow a motion, and return the states that were reached, even if the path ends early, as they are stored.

    "states", with the force N, shift mm, energies mJ and so on of each; "status" and "message" of `Cycles`; "steps",
    numbers of time steps and of degrees of freedom; "processor_s". After Ctrl-C MotionInterrupted has them.
    """
    begin = time.process_time()
    passed: list[tuple[Stop, TimedState, bool]] = []

    def results() -> dict[str, Any]:
        status, message = _verdict([state for _, state, _ in passed])
        return {
            "states": [_state_row(stop, state, at_stop=at_stop) for stop, state, at_stop in passed],
            "steps": [passed[-1][1].step, passed[-1][1].solution.dofs],
            "processor_s": time.process_time() - begin,
            "status": status,
            "message": message,
        }

    try:
        passed.extend(_follow(design, motion, accuracy, magnet, tolerance, progress))
    except KeyboardInterrupt:
        if passed:
            raise MotionInterrupted(results()) from None
        raise
    return results()


def cycles_of(design: Design, motion: Motion, static: Static, followed: Mapping[str, Any]) -> Cycles:
    """Return the rows and loops of what `follow_motion` returns, with the readings of a design."""
    rows = rows_of(design, followed["states"], static)
    steps, dofs = followed["steps"]
    return Cycles(
        followed["status"], followed["message"], rows, loops_of(motion, rows), (steps, dofs), followed["processor_s"]
    )


def run(
    design: Design,
    motion: Motion,
    static: Static,
    accuracy: str,
    magnet: Magnet,
    tolerance: float,
    progress: Progress,
) -> Cycles:
    """Follow a motion, and return its cycles, also if the path ends early."""
    return cycles_of(design, motion, static, follow_motion(design, motion, accuracy, magnet, tolerance, progress))


def _verdict(states: Sequence[TimedState]) -> tuple[str, str]:
    solutions = [state.solution for state in states]
    if failed := [solution for solution in solutions if solution.status == "not_converged"]:
        return failed[0].status, failed[0].message
    for status in ("unstable", "unknown"):
        if found := [state for state in states if state.solution.status == status]:
            return status, f"{found[0].solution.message}, first at {found[0].time:.4g} s"
    # of stable states the one with the largest strain says what limits the use of all
    strained = max(solutions, key=lambda solution: solution.facts.largest_strain or 0.0)
    doubtful = strained.facts.remark not in EXPECTED or strained.facts.inverted_share
    return "ok", strained.message if doubtful else ""


def _follow(
    design: Design,
    motion: Motion,
    accuracy: str,
    magnet: Magnet,
    tolerance: float,
    progress: Progress,
) -> Iterator[tuple[Stop, TimedState, bool]]:
    """Yield each state with the stop of the motion to which it leads, and whether it has reached it."""
    from fem.analyses.timed_path import TimeControl, TimedLoad, follow

    path = stops(motion)
    check_load(design, motion.largest, magnet)
    ahead = iter(path)
    stop = next(ahead)
    longest = motion.half / STEPS if not motion.hold else max(motion.half / STEPS, motion.hold / STEPS)
    states = follow(
        design,
        [TimedLoad(one.time, one.load) for one in path],
        LEVELS[accuracy],
        steps=TimeControl(tolerance, longest),
        magnet=magnet,
        every_step=True,
    )
    for state in states:
        progress(state.time / path[-1].time, f"cycle {max(stop.cycle, 1)} of {motion.cycles}")
        reached = state.time >= stop.time and state.solution.status != "not_converged"
        yield stop, state, reached
        if reached and (following := next(ahead, None)) is not None:
            stop = following


def check_gap(design: Design, gap_percent: float) -> None:
    """Refuse a gap, percent of full scale, to which no loss factor of the design belongs."""
    if design.prony:
        raise BadInput(
            "--gap searches for a loss factor, but the design has measured branches (prony): empty that field"
        )
    if not 0 < gap_percent < 100:
        raise BadInput(f"--gap must be above 0 and below 100 percent of full scale; got {gap_percent:g}")


def loss_factor_of_gap(
    design: Design,
    motion: Motion,
    gap_percent: float,
    followed: Callable[[Design], Cycles],
) -> tuple[float, Loop]:
    """Return the constant loss factor with which the last loop has this gap, percent, and that loop, by secants.

    The first guess is that of a linear spring, whose gap is nearly proportional to the loss factor.

    `followed`: returns the cycles of a design in this motion. OutOfReach says that no loss factor has this gap, or
    that a motion ended early.
    """
    check_gap(design, gap_percent)
    known = relaxation_of(replace(design, loss_factor=0.1))
    tried: list[tuple[float, float]] = [(0.0, 0.0)]
    factor = 0.1 * gap_percent / (100 * loop(known, motion.frequency, motion.waveform, motion.hold).hysteresis)
    factor = min(factor, MOST_LOSS)
    for _ in range(SEARCHES):
        cycles = followed(replace(design, loss_factor=factor))
        if cycles.status not in ANSWERED or not cycles.loops:
            raise OutOfReach(f"with a loss factor of {factor:.3g} {cycles.message or 'the path ended early'}")
        last = cycles.loops[-1]
        if abs(last["gap_percent"] - gap_percent) < GAP_TOLERANCE:
            return factor, last
        if factor == MOST_LOSS and last["gap_percent"] < gap_percent:
            raise OutOfReach(
                f"no loss factor up to {MOST_LOSS:g} has a gap of {gap_percent:g} %: with {MOST_LOSS:g} the loop has "
                f"{last['gap_percent']:.3g} %"
            )
        tried.append((factor, last["gap_percent"]))
        (f0, g0), (f1, g1) = tried[-2:]
        factor = min(max(f1 + (gap_percent - g1) * (f1 - f0) / (g1 - g0), 0.1 * f1), MOST_LOSS)
    raise OutOfReach(f"no loss factor with a gap of {gap_percent:g} % was found in {SEARCHES} runs")
