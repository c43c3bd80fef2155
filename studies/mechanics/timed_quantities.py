"""Quantities of a case that depend on time, each a path of the store with a single state: its key and its solve.

**Vibration.** What is stored is the dynamic stiffness Z(f), the force of the plate over the shift of the magnet along
the motion, on a grid of frequencies: along x under a shear, else along z. Z is smooth where its inverse, the gain,
has peaks, so a spline through the grid gives the gain at every frequency. Frequencies are over
`fem.analyses.modes.frequency_unit`, and the times of the branches times it, of the design at rest
(`fem.scene.relaxed`): similar designs share a path. The readings of a press are proportional to the
shift along z, so their gain is this gain; under a shear they depend on the tilt as well, and `magtip response` has
them.

**Cycle.** A field `speed` of the load is a triangle with this speed of the plate, mm/s, a field `frequency` a sine
with so many cycles per second, Hz. Inertia is neglected, so that a cycle depends on the times of the silicone's
branches over the duration of a cycle: designs that are similar with the same product share a path.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np

from fem.accuracy import Accuracy
from fem.physics_version import ESTIMATES, PHYSICS
from fem.scene import Scene, relaxed
from geometry.arrays import Array
from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED
from geometry.messages import Progress
from geometry.relaxation import Relaxation, range_sentence, relaxation_of
from studies.mechanics.cycle_motion import Motion, frequency_of
from studies.mechanics.stored_solutions import recorded_sensor

TIMED = ("response", "cycle")
"""Quantities that depend on time."""


@dataclass(frozen=True, slots=True)
class PlateMotion:
    """How fast the plate moves: at a frequency, Hz, or with a speed, mm/s; None where the case has no such value."""

    frequency: float | None = None
    speed: float | None = None


STILL = PlateMotion()
"""No motion: what static quantities have."""


def motion_of(values: Mapping[str, Any]) -> PlateMotion:
    """Return the motion in the fields of a load.

    >>> motion_of({"depth": 1.0, "frequency": 2.0})
    PlateMotion(frequency=2.0, speed=None)
    """
    return PlateMotion(values.get("frequency"), values.get("speed"))


def check_motion(names: Collection[str], quantities: Collection[str]) -> None:
    """Refuse fields of the motion that contradict each other or the quantities of a study."""
    if "frequency" in names and "speed" in names:
        raise BadInput("frequency and speed both say how fast the plate moves: leave one of them out")
    if "frequency" in names and not set(TIMED) & set(quantities):
        raise BadInput(f"frequency has no effect on these quantities: add the quantity {' or '.join(TIMED)}")
    if "speed" in names and "cycle" not in quantities:
        raise BadInput("speed has no effect on these quantities: add the quantity cycle")
    if "cycle" in quantities and not {"frequency", "speed"} & set(names):
        raise BadInput(
            "quantity cycle needs the rate of the motion: add a speed (mm/s) or a frequency (Hz) to the load"
        )


# Vibration

LOWEST = 1.0
"""Frequency to which gains refer, Hz, where the branches speak for it: that of `magtip response`."""
LOWEST_ELASTIC = 1e-3
"""The same over the frequency unit, without branches: the response is then flat at low frequencies."""
GRID = 300
"""Frequencies at which the stiffness is stored: the spline is then within 1e-4 of the gain at a peak with Q = 10."""


def rest_scene(scene: Scene, frequency: float | None = None) -> Scene:
    """Return the scene that is solved: the design with its modulus at rest, and a model that its load chooses.

    A frequency, Hz, must lie in its band.
    """
    from fem.analyses.vibration import check_vibration

    design, (load,) = scene.design, scene.loads
    if load.grip is not None or load.plate_tilt or load.coulomb is not None or load.shear_y:
        raise BadInput(
            "the response of a sweep needs an upright plate with friction none or stick and a shear along x: leave "
            "out grip, plate_tilt, a friction coefficient and shear_y (magtip response takes them)"
        )
    at_rest = replace(relaxed(design, relaxation_of(design)), modulus="long-term")
    low, high = band(at_rest, scene.accuracy)
    check_vibration(at_rest, load, (low, high), scene.accuracy)
    if frequency is not None and not low <= frequency <= high:
        beyond = "change loss_low or loss_high, or the accuracy"
        remedy = f"take {low:.4g} Hz or more" if frequency < low <= LOWEST else beyond
        raise BadInput(
            f"the response is known from {low:.4g} to {high:.4g} Hz, for which the silicone's branches speak and "
            f"the mesh is fine enough; got {frequency:g} Hz: {remedy}"
        )
    return replace(scene, design=at_rest, model="auto")


def band(at_rest: Design, accuracy: Accuracy) -> tuple[float, float]:
    """Return the lowest and the highest frequency of a design at rest, Hz: those of branches and mesh."""
    from fem.analyses.vibration import highest_frequency

    relaxation = relaxation_of(at_rest)
    least, most = relaxation.speaks_for_frequencies
    carried = highest_frequency(at_rest, accuracy)
    low = max(LOWEST, least) if relaxation.times else LOWEST_ELASTIC * unit_of(at_rest)
    if not low < min(most, carried):
        raise BadInput(
            f"the branches speak for frequencies up to {most:.3g} Hz and the mesh carries {carried:.3g} Hz, but a "
            f"response begins at {low:.3g} Hz: raise loss_high or take a finer accuracy"
        )
    return low, min(most, carried)


def unit_of(at_rest: Design) -> float:
    """Return the unit of frequencies of a design at rest, Hz."""
    from fem.analyses.modes import frequency_unit

    return frequency_unit(at_rest)


def sensor_scene(scene: Scene) -> Scene:
    """Return the scene of a vibrating sensor with any load, in the direction of its shear."""
    from fem.analyses.vibration import vibrating_scene

    at_rest = vibrating_scene(scene.design, scene.loads[0], scene.accuracy, scene.magnet)
    return replace(at_rest, design=replace(at_rest.design, modulus="long-term"))


def response_content(scene: Scene, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return everything on which the response of a scene at rest depends; without options the shear is along x."""
    design, unit = scene.design, unit_of(scene.design)
    low, high = (options["lowest"], options["highest"]) if options else band(design, scene.accuracy)
    ratio = design.magnet_density / design.density if scene.magnet == "rigid" else 0.0
    load = {
        "density_ratio": float(f"{ratio:.12g}"),
        "branches": branches(relaxation_of(design), unit),
        "lowest": float(f"{low / unit:.12g}"),
        "highest": float(f"{high / unit:.12g}"),
    }
    if options:
        load |= scene.dimensionless()["loads"][0]
        return _content(scene, "response", load) | {"estimates": ESTIMATES}
    return _content(scene, "response", load)


def _content(scene: Scene, quantity: Literal["response", "cycle"], load: Mapping[str, Any]) -> dict[str, Any]:
    values = scene.dimensionless()
    (first,) = values.pop("loads")
    own = {"depth": first["depth"], "shear_x": first["shear"][0], "friction": first["friction"], **load}
    return values | {"quantity": quantity, "load": own, "physics": PHYSICS[quantity]}


def branches(relaxation: Relaxation, rate: float) -> str:
    """Return branches as text, their times multiplied by a rate, 1/s."""
    pairs = zip(relaxation.shares, relaxation.times, strict=True)
    return " ".join(f"{g:.12g}:{tau * rate:.12g}" for g, tau in pairs)


def solve_response(scene: Scene, options: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Solve for the vibration of a scene at rest.

    With options "sensor" is what `stored_solutions.recorded_sensor` returns, with that of a coarser mesh. Else
    "stiffness_real" and "stiffness_imag": Z over |Z| at the lowest frequency, on the grid; "bandwidth", "resonance":
    frequency at which the gain 1 / |Z| is first 3 dB below that at the lowest one, and of its first peak, over the
    unit, None beyond the band; "Q" of this peak, None without branches; "status" and "message" of the state at rest.
    """
    from fem.analyses.vibration import vibrating_sensor
    from studies.mechanics import resonance_peaks

    (load,) = scene.loads
    low, high = (options["lowest"], options["highest"]) if options else band(scene.design, scene.accuracy)
    prepare = partial(vibrating_sensor, scene.design, load, (low, high), scene.accuracy, magnet=scene.magnet)
    if options:
        sensor = prepare(check=False, estimate=True)
        at_rest = {"status": sensor.state.status, "message": sensor.state.message}
        stiffnesses = [*sensor.static_stiffness().values()]
        return {"sensor": recorded_sensor(sensor), "stiffness": stiffnesses, **at_rest}
    sensor = prepare()
    axis = "x" if load.shears_tip else "z"

    def stiffness(f: Array) -> Any:
        vibration = sensor.at(f)
        k, along = vibration.motions.index(axis), ("x", "z").index(axis)
        return vibration.force[:, k, along] / vibration.shift[:, k, along]

    def gain(f: Array) -> Array:
        return np.asarray(1 / np.abs(stiffness(f)))

    unit, branched = unit_of(scene.design), bool(relaxation_of(scene.design).times)
    Z = stiffness(np.geomspace(low, high, GRID))
    # the magnet may move against the force, as it does along z; only changes count
    Z /= math.copysign(abs(Z[0]), Z[0].real)
    width = resonance_peaks.bandwidth(gain, low, high)
    first = next(iter(resonance_peaks.peaks(gain, low, high)), None)
    return {
        "stiffness_real": [float(f"{value:.9g}") for value in Z.real],
        "stiffness_imag": [float(f"{value:.9g}") for value in Z.imag],
        "bandwidth": None if width is None else width / unit,
        "resonance": None if first is None else first.frequency / unit,
        "Q": first.Q if first is not None and branched else None,
        "status": sensor.state.status,
        "message": sensor.state.message,
    }


def gain_at(values: Mapping[str, Any], band: tuple[float, float], frequency: float) -> complex:
    """Return the gain at a frequency over that at the lowest one, as a complex number whose angle is its phase.

    Parameters
    ----------
    values : of `solve_response`.
    band : lowest and highest frequency of the grid, in the unit of `frequency`.
    """
    from scipy.interpolate import CubicSpline

    Z = np.array(values["stiffness_real"]) + 1j * np.array(values["stiffness_imag"])
    return complex(1 / CubicSpline(np.log(np.geomspace(*band, GRID)), Z)(math.log(frequency)))


# Cycle

CYCLES = 3
"""Number of cycles; the last one counts, as in `magtip cycle`."""
TOLERANCE = 1e-3
"""Permitted error of the force from the time steps, over the largest force."""


def cycle_of(scene: Scene, motion: PlateMotion) -> Motion:
    """Return the cycles of a scene whose load is in its canonical form, with a shear along x only."""
    (load,) = scene.loads
    if unknown := load.beyond("depth", "shear_x", "friction"):
        raise BadInput(f"a cycle needs an upright plate and a shear along x: leave out {', '.join(unknown)}")
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


def cycle_content(scene: Scene, motion: PlateMotion, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return everything on which the cycles of a scene depend; with the options of all states, design and time have
    their units."""
    relaxation = relaxation_of(scene.design)
    if options:
        own = {"branches": branches(relaxation, 1.0), "modulus": scene.design.modulus, **units(scene.design)}
        return _content(scene, "cycle", own | dict(options))
    cycle = cycle_of(scene, motion)
    load = {
        "friction": cycle.friction,
        "branches": branches(relaxation, cycle.frequency),
        "modulus": scene.design.modulus if relaxation.times else "long-term",
        "waveform": cycle.waveform,
        "cycles": CYCLES,
    }
    return _content(scene, "cycle", load)


def units(design: Design) -> dict[str, float]:
    """Return what the content of a path has whose states are in the units of a design."""
    return {"D_mm": design.D, "E_MPa": design.E_now}


def slow_content(scene: Scene) -> dict[str, Any]:
    """Return everything on which the curve of slow loading to the load of a scene depends."""
    content = _content(scene, "cycle", units(scene.design))
    return content | {"quantity": "slow loading", "physics": PHYSICS[scene.model]}


def solve_cycle(scene: Scene, motion: PlateMotion, options: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Follow the cycles; with options return what `loading_cycles.follow_motion` does.

    Else, of the last loop: "gap_percent" at mid-stroke, in percent of full scale; "area_over_ED3";
    "largest_over_ED2", the largest force along the motion. "error_estimate": relative, of the force. "status" and
    "message" of the path. Rounding hides that the loop of an elastic sensor is not quite closed. A state that is not
    reached raises SolveFailed.
    """
    from studies.mechanics.loading_cycles import Static, follow_motion, run

    if options:
        (load,), given = scene.loads, dict(options)
        tolerance = given.pop("tolerance")
        whole = Motion(load.depth, load.shear_x, load.friction, **given)
        return follow_motion(scene.design, whole, scene.accuracy.name, scene.magnet, tolerance, progress)
    design, cycle = scene.design, cycle_of(scene, motion)
    cycles = run(design, cycle, Static(), scene.accuracy.name, scene.magnet, TOLERANCE, progress)
    if cycles.status not in ANSWERED or len(cycles.loops) < CYCLES:
        raise SolveFailed(f"{cycles.status}: {cycles.message}")
    last, unit = cycles.loops[-1], design.E_now * design.D**2
    return {
        "gap_percent": round(last["gap_percent"], 6),
        "area_over_ED3": round(last["area_mJ"] / (unit * design.D), 12),
        "largest_over_ED2": last["largest_N"] / unit,
        "error_estimate": cycles.time_error,
        "status": cycles.status,
        "message": cycles.message,
    }
