"""Loading cycles of a case as a path of the store with a single state: its key, its solve.

A field `speed` of the load is a triangle with this speed of the plate, mm/s, a field `frequency` a sine with so many
cycles per second, Hz. Inertia is neglected, so that a cycle depends on the times of the silicone's branches over the
duration of a cycle: designs that are similar with the same product share a path.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from fem.physics_version import PHYSICS
from fem.scene import Scene
from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED
from geometry.relaxation import range_sentence, relaxation_of
from studies.mechanics.plate_motion import PlateMotion
from studies.mechanics.response_paths import branches

if TYPE_CHECKING:
    from studies.mechanics.cycle_motion import Motion

CYCLES = 3
"""Number of cycles; the last one counts, as in `magtip cycle`."""
TOLERANCE = 1e-3
"""Permitted error of the force from the time steps, over the largest force."""


def cycle_of(scene: Scene, motion: PlateMotion) -> Motion:
    """Return the cycles of a scene whose load is in its canonical form, with a shear along x only."""
    from studies.mechanics.cycle_motion import Motion, frequency_of

    (load,) = scene.loads
    if load.grip is not None or load.plate_tilt or load.imperfection or load.shear_y:
        raise BadInput(
            "a cycle needs an upright plate and a shear along x: leave out grip, plate tilt and imperfection"
        )
    if motion.frequency is None and motion.speed is None:
        raise BadInput("a cycle needs a rate: give the field speed in mm/s or frequency in Hz")
    frequency = frequency_of(motion.speed, motion.frequency, 2 * load.shear_x or load.depth)
    # without a shear a plate that sticks is frictionless
    friction = "none" if load.friction == "stick" and not load.shear_x else load.friction
    cycle = Motion(
        load.depth, load.shear_x, friction, frequency, "sine" if motion.speed is None else "triangle", CYCLES
    )
    sentence = range_sentence(relaxation_of(scene.design), frequencies=[frequency])
    if sentence:
        raise BadInput(f"{sentence}: change loss_low or loss_high, or the rate")
    return cycle


def content(scene: Scene, motion: PlateMotion) -> dict[str, Any]:
    """Return everything on which the cycles of a scene depend."""
    cycle = cycle_of(scene, motion)
    values = scene.dimensionless()
    (first,) = values.pop("loads")
    relaxation = relaxation_of(scene.design)
    load = {
        "depth": first["depth"],
        "shear_x": first["shear"][0],
        "friction": cycle.friction,
        "branches": branches(relaxation, cycle.frequency),
        "modulus": scene.design.modulus if relaxation.times else "long-term",
        "waveform": cycle.waveform,
        "cycles": CYCLES,
    }
    return values | {"quantity": "cycle", "load": load, "physics": PHYSICS["cycle"]}


def fields_of(load: Mapping[str, Any], design: Design) -> Design:
    """Return a design with the branches of a path's content, for a cycle of 1 s."""
    if not load["branches"]:
        return replace(design, loss_factor=0.0)
    # the marks say that the branches speak for 1 Hz
    return replace(design, prony=f"{load['branches']} 0:1e-6 0:1e6", modulus=load["modulus"])


def motion_of(load: Mapping[str, Any], D: float) -> PlateMotion:
    """Return the motion of a path's content for a cycle of 1 s."""
    if load["waveform"] == "sine":
        return PlateMotion(frequency=1.0)
    return PlateMotion(speed=2 * D * (2 * load["shear_x"] or load["depth"]))


def solve(scene: Scene, motion: PlateMotion) -> dict[str, Any]:
    """Follow the cycles.

    Returns
    -------
    Of the last loop: "gap_percent" at mid-stroke, in percent of full scale; "area_over_ED3"; "largest_over_ED2", the
    largest force along the motion. "error_estimate": relative, of the force. "status" and "message" of the path.
    Rounding hides that the loop of an elastic sensor is not quite closed.

    Raises
    ------
    SolveFailed
        A state was not reached.
    """
    from studies.mechanics.loading_cycles import Static, run

    design, cycle = scene.design, cycle_of(scene, motion)
    cycles = run(
        design, cycle, "prony", Static(None, None), scene.accuracy.name, scene.magnet, TOLERANCE, lambda *_: None
    )
    if cycles.status not in ANSWERED or len(cycles.loops) < CYCLES:
        raise SolveFailed(f"{cycles.status}: {cycles.message}")
    last, unit = cycles.loops[-1], design.E * design.D**2
    return {
        "gap_percent": round(last["gap_percent"], 6),
        "area_over_ED3": round(last["area_mJ"] / (unit * design.D), 12),
        "largest_over_ED2": last["largest_N"] / unit,
        "error_estimate": cycles.time_error,
        "status": cycles.status,
        "message": cycles.message,
    }
