"""What `magtip cycle` reports: the loops of a motion, and what they say, assume and leave out, in sentences."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING

from analytic.relaxation_loops import loop
from geometry.bad_input import OutOfReach
from geometry.design import Design
from geometry.loads import Magnet
from geometry.messages import Progress
from geometry.relaxation import relaxation_notes, relaxation_of
from studies.mechanics import loading_cycles
from studies.mechanics.cycle_motion import Motion
from studies.mechanics.loading_cycles import Cycles, Static
from studies.output.figures import picture
from studies.output.records import FlatRow
from studies.output.result import Interrupted, Result, Table, failure_of
from studies.simulation import time_figures

if TYPE_CHECKING:
    from fem.analyses.timed_path import ViscousLaw

FILES = ("cycle.csv", "loops.csv", "cycle.png")
"""Files that a folder of results holds, beside run.json."""

FAST = 0.1
"""Frequency over the lowest natural frequency from which inertia changes forces by 1 % or more."""
GAINED = 1e-2
"""Energy that a closed cycle may gain, over the area of its loop: above the errors of time steps and mesh."""


def study(
    design: Design,
    motion: Motion,
    laws: Sequence[ViscousLaw],
    gap: float | None,
    accuracy: str,
    magnet: Magnet,
    tolerance: float,
    warnings: Sequence[str],
    progress: Progress,
) -> Result:
    """Follow a motion by one law or two, and search for the loss factor of a gap, percent, if one is wanted.

    Parameters
    ----------
    warnings : those of the options, which the result repeats.

    Raises
    ------
    Interrupted
        After Ctrl-C, with the loops of the cycles that are complete.
    """
    followed: list[Cycles] = []
    interrupted: list[Cycles] = []
    try:
        progress(0.0, "the lowest natural frequency")
        lowest = lowest_frequency(design, magnet)
        progress(0.0, "the curve of slow loading")
        static = loading_cycles.static_curve(design, motion, accuracy, magnet)

        def follow(sensor: Design, law: ViscousLaw = "prony") -> Cycles:
            return loading_cycles.run(sensor, motion, law, static, accuracy, magnet, tolerance, progress, interrupted)

        for law in laws:
            followed.append(follow(design, law))
        found = {} if gap is None else _loss_factor(design, motion, gap, follow)
    except KeyboardInterrupt:
        # a run of the search for a gap has another loss factor: its loops are not those of the design
        if len(followed) < len(laws):
            followed += interrupted
        raise _interrupted(followed, motion) from None
    sentences = notes(design, motion, static, followed[0], lowest)
    record: FlatRow = followed[0].row() | found
    if len(followed) > 1:
        record["second_law"] = followed[1].row()
        if all(one.loops for one in followed):
            sentences.append(difference(*followed))
    warned = [
        *warnings,
        *inertia_warnings(motion, lowest),
        *(text for one in followed for text in doubts(static, one)),
    ]
    states = [{"law": one.law} | state.row(one.unit) for one in followed for state in one.states]
    said = [*findings(followed[0]), *([found["sentence"]] if found else []), *sentences]
    return Result(
        title="Loops",
        records=[record | {"frequency_Hz": motion.frequency, "warnings": warned, "notes": sentences}],
        shown=[*map(_table, followed), *(f"{sentence}." for sentence in said)],
        tables={
            "cycle": states,
            "loops": [{"law": one.law} | asdict(row) for one in followed for row in one.loops],
        },
        digits=9,
        files={"cycle.png": partial(picture, rows=states, draw=time_figures.cycle)},
        warnings=warned,
        failures=failure_of([*(one.row() for one in followed), *([found] if found else [])]),
        design=asdict(design),
    )


def _table(cycles: Cycles) -> Table:
    law = "linear overstresses" if cycles.law == "prony" else "law for large rates"
    return Table(title=f"Loops, {law}", rows=[asdict(row) for row in cycles.loops])


def _interrupted(followed: Sequence[Cycles], motion: Motion) -> Interrupted:
    """Return the interruption with the loops of the cycles that are complete."""
    complete = [one for one in followed if one.loops]
    records = [{"law": one.law, "loops": [asdict(row) for row in one.loops]} for one in complete]
    reached = len(followed[-1].loops) if followed else 0
    text = f"{reached} of {motion.cycles} cycles are complete, and no file is written"
    return Interrupted(text, Result(title="Loops", records=records, shown=[_table(one) for one in complete]))


def _loss_factor(design: Design, motion: Motion, gap: float, follow: Callable[[Design], Cycles]) -> FlatRow:
    """Return the loss factor with a gap, percent, its loop and a sentence, or why there is none."""
    try:
        factor, row = loading_cycles.loss_factor_of_gap(design, motion, gap, follow)
    except OutOfReach as error:
        return {"status": "failed", "message": str(error), "sentence": str(error)}
    return {
        "gap_percent": row.gap_percent,
        "loss_factor_of_gap": factor,
        "sentence": (
            f"a gap of {gap:g} % of full scale in cycle {row.cycle} belongs to a constant loss factor of {factor:.3f}"
        ),
    }


def lowest_frequency(design: Design, magnet: Magnet) -> float:
    """Return the lowest natural frequency of the free sensor, Hz, undamped, with the long-term modulus, at quick."""
    from fem.accuracy import QUICK
    from fem.analyses.modes import modes
    from fem.analyses.vibration import relaxed

    return modes(relaxed(design, relaxation_of(design)), magnet, 1, accuracy=QUICK, estimate=False).frequency[0]


def inertia_warnings(motion: Motion, lowest: float) -> list[str]:
    """Return a sentence if the motion is too fast for a model without inertia.

    Below a natural frequency inertia changes a response by about (frequency / natural frequency)^2.
    """
    if motion.frequency <= FAST * lowest:
        return []
    share = (motion.frequency / lowest) ** 2
    change = f"its forces by about {100 * share:.0f} %" if share < 0.5 else "its forces completely"
    return [
        (
            f"{motion.frequency:.4g} Hz is {motion.frequency / lowest:.2g} times the lowest natural frequency of the "
            f"free sensor, {lowest:.0f} Hz; a cycle leaves out inertia, which changes {change}; magtip response has "
            "it, for small amplitudes"
        )
    ]


def notes(design: Design, motion: Motion, static: Static, cycles: Cycles, lowest: float) -> list[str]:
    """Return what the numbers assume and how accurate they are, in sentences.

    Parameters
    ----------
    lowest : lowest natural frequency of the free sensor, Hz.
    """
    relaxation = relaxation_of(design)
    linear = loop(relaxation, motion.frequency, motion.waveform, motion.hold).hysteresis
    slip = (
        []
        if isinstance(motion.friction, str)
        else [
            (
                "the error of the time steps leaves out slip within a step, up to 0.2 % of the largest force in "
                "tests of two designs: compare with --tolerance 1e-4, which takes steps of half the length"
            )
        ]
    )
    dissipation = [
        "at large strain linear overstresses may gain energy for a while, but no closed cycle of verify does"
    ]
    relaxing = [
        "the decoded force is read by the curve of slow loading, so it misses the part of the force that relaxes"
    ]
    mesh = "not known" if static.mesh_error is None else f"about {100 * static.mesh_error:.1f} %"
    return [
        *relaxation_notes(design),
        (
            f"the motion has {motion.frequency:.4g} Hz and a stroke of {motion.stroke:g} mm in {motion.half:.4g} s; "
            f"inertia is neglected; the lowest natural frequency of the free sensor is {lowest:.0f} Hz"
        ),
        (
            f"error of the force: {mesh} from the mesh, {100 * cycles.time_error:.2g} % from the time steps; at most "
            f"{cycles.balance_error:.2g} of the largest work is neither stored nor dissipated, by errors of the time "
            "steps and of their integrals"
        ),
        *slip,
        *(dissipation if cycles.law == "prony" and relaxation.shares else []),
        f"a linear spring of this silicone has a gap of {100 * linear:.1f} % of full scale in steady cycles",
        *(relaxing if relaxation.shares else []),
    ]


def findings(cycles: Cycles) -> list[str]:
    """Return what the last loop says, in sentences."""
    if not cycles.loops:
        return []
    last = cycles.loops[-1]
    lost = last.material_mJ + last.friction_mJ
    share = f" ({100 * last.friction_mJ / lost:.1f} % by friction)" if lost and last.friction_mJ else ""
    begin = ", the first one and not yet steady (--cycles)," if last.gap_N else ""
    change = ""
    if len(cycles.loops) > 1:
        begin, change = (
            "",
            f" ({last.gap_percent - cycles.loops[-2].gap_percent:+z.1f} percentage points from the cycle before)",
        )
    # one digit: levels of accuracy differ by some tenths of a percentage point
    sentences = [
        (
            f"the loop of cycle {last.cycle}{begin} has a gap of {last.gap_percent:.1f} % of full scale at "
            f"mid-stroke{change}, and dissipates {lost:.4g} mJ{share}"
        )
    ]
    if any(row.material_mJ + row.friction_mJ > 1.01 * row.area_mJ for row in cycles.loops):
        sentences.append(
            "material and friction dissipate more than the area of a loop where energy stored before it is released"
        )
    if last.decoded_gap_percent is not None:
        sentences.append(
            f"the decoded force has a gap of {last.decoded_gap_percent:z.1f} %, and is off by up to "
            f"{last.decoded_error_percent:.1f} % of full scale"
        )
    if cycles.drift_percent is not None:
        sentences.append(
            f"the largest force drifts by {cycles.drift_percent:+z.2f} % from the first to the last cycle"
        )
    return sentences


def doubts(static: Static, cycles: Cycles) -> list[str]:
    """Return in sentences why the loops should not be trusted, if they should not."""
    texts = [cycles.message] if cycles.status == "ok" and cycles.message else []
    if static.stop:
        texts.append(
            f"slow loading does not reach the end of the stroke ({static.stop}): no force is decoded, and the error "
            "of the mesh is not known; take a smaller stroke"
        )
    gained = [row for row in cycles.loops if row.material_mJ < -GAINED * abs(row.area_mJ)]
    if gained:
        texts.append(
            f"the silicone gains {-gained[0].material_mJ:.3g} mJ in cycle {gained[0].cycle}, which no silicone can: "
            "linear overstresses do not hold at these strains; take a smaller stroke, or --second-law"
        )
    if cycles.loops and (away := _apart_at_middle(cycles)):
        texts.append(
            f"in cycle {cycles.loops[-1].cycle} the skin, which recovers slowly, does not touch the plate at "
            f"mid-stroke on the way {away}: the gap there does not measure the hysteresis; the area of the loop does"
        )
    return texts


def _apart_at_middle(cycles: Cycles) -> str:
    """Return on which ways of the last complete cycle the plate touches nothing at mid-stroke, in words."""
    ways = [
        one.stop.phase
        for one in cycles.states
        if one.stop.cycle == cycles.loops[-1].cycle
        and one.at_stop
        and one.stop.place == "middle"
        and one.state.response.force[2] <= 0
    ]
    return " and ".join(ways)


def difference(first: Cycles, second: Cycles) -> str:
    """Return how the last loops of both laws differ, in a sentence."""
    one, other = first.loops[-1], second.loops[-1]
    return (
        f"by the law for large rates the last loop has a gap of {other.gap_percent:.2f} % in place of "
        f"{one.gap_percent:.2f} %, an area of {other.area_mJ:.4g} in place of {one.area_mJ:.4g} mJ, and a largest "
        f"force of {other.largest_N:.4g} in place of {one.largest_N:.4g} N"
    )
