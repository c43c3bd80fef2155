"""What `magtip cycle` reports: the loops of a motion, and what they say, assume and leave out, in sentences."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from analytic.relaxation_loops import loop
from fem.accuracy import LEAST_TOLERANCE, QUICK
from fem.scene import Scene, relaxed
from geometry.bad_input import OutOfReach, SolveFailed
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, check_load
from geometry.messages import Progress
from geometry.relaxation import check_range, moduli, relaxation_notes, relaxation_of
from studies.inputs.option_groups import Cycle, Elements
from studies.mechanics import loading_cycles
from studies.mechanics import store as stores
from studies.mechanics.cycle_motion import Motion, frequency_of
from studies.mechanics.loading_cycles import BEYOND, CURVE, Cycles, Made, MotionInterrupted, Static, StaticCurve
from studies.mechanics.path_solver import frequency_unit, place
from studies.mechanics.store import Store
from studies.mechanics.stored_answers import asked
from studies.output import page_templates
from studies.output.figures import picture
from studies.output.records import FlatRow
from studies.output.result import Interrupted, Result, Table, failure_of
from studies.simulation import time_figures

FILES = ("cycle.csv", "loops.csv", "cycle.png")
"""Files that a folder of results holds, beside run.json."""
FAST = 0.1
"""Frequency over the lowest natural frequency from which inertia changes forces by 1 % or more."""
GAINED = 1e-2
"""Energy that a closed cycle may gain, over the area of its loop: above the errors of time steps and mesh."""
LAW: FlatRow = {"law": "prony"}
"""Column of the law by which the silicone relaxes, see `fem.model.viscoelasticity`."""
sentences = partial(page_templates.sentences, Path(__file__).with_name("templates") / "cycle.j2")


def study(design: Design, options: Cycle, made: Made | None = None) -> Callable[[Progress], Result]:
    """Return the study of `magtip cycle` after a check of its options; `made` is a calibrated sensor of it."""
    shear, hold = options.shear, options.hold
    # a word of another kind is refused with the load
    contact: Any = options.friction
    if contact is None:
        contact = "stick" if shear else "none"
    frequency = frequency_of(options.speed, options.frequency, abs(2 * shear) or options.depth)
    motion = Motion(options.depth, shear, contact, frequency, options.waveform, options.cycles, hold)
    if not LEAST_TOLERANCE <= options.tolerance < 1:
        raise BadInput(f"--tolerance must be at least {LEAST_TOLERANCE:g} and below 1; got {options.tolerance:g}")
    if options.gap is not None:
        loading_cycles.check_gap(design, options.gap)
    # a load that is impossible comes first: its stroke decides the frequency
    check_load(design, motion.largest, options.elements.magnet)
    holds = [hold] if hold else []
    warnings = check_range(design, times=holds, frequencies=[motion.frequency], beyond=options.extrapolate)
    return partial(run, design, motion, options, warnings, made)


def run(
    design: Design,
    motion: Motion,
    options: Cycle,
    warnings: Sequence[str],
    made: Made | None,
    progress: Progress,
) -> Result:
    """Follow a motion, and search for the loss factor of a gap, percent, if one is wanted.

    The result repeats `warnings`, those of the options. Ctrl-C leaves the loops of the cycles that are complete.
    """
    elements, gap = options.elements, options.gap
    cycles, static = None, Static()
    try:
        with stores.opened(elements.store) as store:
            progress(0.0, "the lowest natural frequency")
            lowest = lowest_frequency(design, elements.magnet, store)
            progress(0.0, "the curve of slow loading")
            static = replace(static_curve(design, motion, elements, store), made=made)

            def follow(sensor: Design) -> Cycles:
                return kept_cycles(sensor, motion, static, elements, options.tolerance, store, progress)

            cycles = follow(design)
            found = {} if gap is None else _loss_factor(design, motion, gap, follow)
    except KeyboardInterrupt as stopped:
        # a run of the search for a gap has another loss factor: its loops are not those of the design
        if cycles is None and isinstance(stopped, MotionInterrupted):
            cycles = loading_cycles.cycles_of(design, motion, static, stopped.followed)
        raise _interrupted(cycles, motion) from None
    warned = [*warnings, *inertia(motion, lowest), *doubts(static, cycles)]
    return _result(design, cycles, found, notes(design, motion, static, cycles, lowest), warned, motion)


def _result(
    design: Design, cycles: Cycles, found: FlatRow, said: list[str], warned: list[str], motion: Motion
) -> Result:
    states = [LAW | {name: row[name] for name in row if name != "place"} for row in cycles.rows]
    # energy that is stored before a loop may be released in it
    releases = any(row["material_mJ"] + row["friction_mJ"] > 1.01 * row["area_mJ"] for row in cycles.loops)
    findings = sentences("findings", cycles=cycles, releases=releases) if cycles.loops else []
    record = LAW | cycles.record() | found
    return Result(
        title="Loops",
        records=[record | {"frequency_Hz": motion.frequency, "warnings": warned, "notes": said}],
        shown=[
            _table(cycles),
            *(f"{text}." for text in (*findings, *([found["sentence"]] if found else []), *said)),
        ],
        tables={"cycle": states, "loops": [LAW | row for row in cycles.loops]},
        digits=9,
        files={"cycle.png": partial(picture, rows=states, draw=time_figures.cycle)},
        warnings=warned,
        failures=failure_of([cycles.record(), *([found] if found else [])]),
        design=asdict(design),
    )


def _table(cycles: Cycles) -> Table:
    return Table(title=f"Loops, {time_figures.LAWS['prony']}", rows=cycles.loops)


def _interrupted(cycles: Cycles | None, motion: Motion) -> Interrupted:
    complete = [cycles] if cycles and cycles.loops else []
    records = [LAW | {"loops": one.loops} for one in complete]
    text = f"{len(cycles.loops) if cycles else 0} of {motion.cycles} cycles are complete, and no file is written"
    return Interrupted(text, Result(title="Loops", records=records, shown=[_table(one) for one in complete]))


def _loss_factor(design: Design, motion: Motion, gap: float, follow: Callable[[Design], Cycles]) -> FlatRow:
    try:
        factor, row = loading_cycles.loss_factor_of_gap(design, motion, gap, follow)
    except OutOfReach as error:
        return {"status": "failed", "message": str(error), "sentence": str(error)}
    said = (
        f"a gap of {gap:g} % of full scale in cycle {row['cycle']} belongs to a constant loss factor of {factor:.3f}"
    )
    return {"gap_percent": row["gap_percent"], "loss_factor_of_gap": factor, "sentence": said}


def static_curve(design: Design, motion: Motion, elements: Elements, store: Store) -> Static:
    """Return force and outputs of slow loading along the motion; a shear sticks to the plate.

    Poses do not depend on the modulus, so the relaxed forces are those of E times the long-term modulus over E.
    """
    end = Load(motion.depth, motion.shear, friction="stick" if motion.shear else "none")
    answer = asked(place(Scene(design, (end,), elements.level, elements.magnet), "slow loading"), store)
    if not answer.values:
        raise SolveFailed(answer.message)
    if answer.values["stop"]:
        return Static(None, None, answer.values["stop"])
    relaxed = moduli(design)[1] / design.E
    ways = np.linspace(0, 1, CURVE + 1) * motion.shear
    force, shift, tilt = (np.array(answer.values[name]) for name in ("force", "shift", "tilt"))
    load = np.column_stack([np.zeros((CURVE + 1, 2)), ways])
    load[1:, :2] = relaxed * force[:, [0, 2]]
    shift, tilt = np.vstack([np.zeros(3), shift]), np.append(0.0, tilt)
    if motion.shear:
        # at shear 0 the pressed sensor is between both sides, which are mirror images
        shift[0], load[0, 1] = (0.0, 0.0, 2 * shift[1, 2] - shift[2, 2]), 2 * load[1, 1] - load[2, 1]
        mirror = shift[:0:-1] * [-1, 1, 1]
        load, shift, tilt = (
            np.concatenate([load[:0:-1] * [-1, 1, -1], load]),
            np.concatenate([mirror, shift]),
            np.concatenate([-tilt[:0:-1], tilt]),
        )
    # in a fast motion the magnet can go a little further than in slow loading to the same end: straight on
    share = BEYOND * CURVE
    load, shift, tilt = (np.concatenate([v, [v[-1] + share * (v[-1] - v[-2])]]) for v in (load, shift, tilt))
    if motion.shear:
        load, shift, tilt = (np.concatenate([[v[0] + share * (v[0] - v[1])], v]) for v in (load, shift, tilt))
    outputs = loading_cycles.outputs_of(design, shift, tilt)
    known = bool(np.isfinite(outputs).all())
    curve = StaticCurve(load, outputs, 0 if motion.shear else 1) if known else None
    return Static(curve, answer.values["mesh_error"])


def kept_cycles(
    design: Design,
    motion: Motion,
    static: Static,
    elements: Elements,
    tolerance: float,
    store: Store,
    progress: Progress,
) -> Cycles:
    """Return the cycles of a motion, whose states come from the store or are kept there."""
    scene = Scene(design, (motion.largest,), elements.level, elements.magnet)
    options = {name: getattr(motion, name) for name in ("frequency", "waveform", "cycles", "hold")}
    answer = asked(place(scene, "cycle", options=options | {"tolerance": tolerance}), store, progress=progress)
    if not answer.values:
        raise SolveFailed(answer.message)
    followed = {**answer.values, "status": answer.status, "message": answer.message}
    return loading_cycles.cycles_of(design, motion, static, followed)


def lowest_frequency(design: Design, magnet: Magnet, store: Store) -> float:
    """Return the lowest natural frequency of the free sensor, Hz, undamped, with the long-term modulus, at quick."""
    at_rest = relaxed(design, relaxation_of(design))
    answer = asked(place(Scene(at_rest, (Load(),), QUICK, magnet), "modes", options={"count": 1}), store)
    if not answer.values:
        raise SolveFailed(answer.message)
    (lowest,) = answer.values["frequency"]
    return float(lowest) * frequency_unit(at_rest.D, at_rest.E_now, at_rest.density)


def inertia(motion: Motion, lowest: float) -> list[str]:
    """Return a sentence if the motion is too fast for a model without inertia."""
    # below a natural frequency inertia changes a response by about (frequency / natural frequency)^2
    share = (motion.frequency / lowest) ** 2
    return sentences("inertia", motion=motion, lowest=lowest, share=share) if share > FAST**2 else []


def notes(design: Design, motion: Motion, static: Static, cycles: Cycles, lowest: float) -> list[str]:
    """Return what the numbers assume and how accurate they are, in sentences."""
    relaxation = relaxation_of(design)
    linear = loop(relaxation, motion.frequency, motion.waveform, motion.hold).hysteresis
    return sentences(
        "notes",
        motion=motion,
        static=static,
        cycles=cycles,
        lowest=lowest,
        relaxation=relaxation,
        relaxation_notes=relaxation_notes(design),
        linear=linear,
    )


def doubts(static: Static, cycles: Cycles) -> list[str]:
    """Return in sentences why the loops should not be trusted, if they should not."""
    gained = [row for row in cycles.loops if row["material_mJ"] < -GAINED * abs(row["area_mJ"])]
    # ways of the last complete cycle on which the plate touches nothing at mid-stroke
    last = cycles.loops[-1]["cycle"] if cycles.loops else None
    middle = [row for row in cycles.rows if (row["cycle"], row["place"]) == (last, "middle")]
    away = [row["phase"] for row in middle if row["force_z_N"] <= 0]
    return sentences("doubts", static=static, cycles=cycles, gained=gained, away=away)
