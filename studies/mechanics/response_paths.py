"""The steady vibration of a case as a path of the store with a single state: its key, its solve, and what is read.

What is stored is the dynamic stiffness Z(f), the force of the plate over the shift of the magnet along the motion, on
a grid of frequencies: along x under a shear, else along z. Z is smooth where its inverse, the gain, has peaks, so a
spline through the grid gives the gain at every frequency. Frequencies are over `fem.analyses.modes.frequency_unit`,
and the times of the branches times it, of the design at rest (`fem.analyses.vibration.relaxed`): similar designs
share a path.

The readings of a press are proportional to the shift along z, so their gain is this gain; under a shear they depend
on the tilt as well, and `magtip response` has them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fem.accuracy import Accuracy
from fem.physics_version import PHYSICS
from fem.scene import Scene
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.relaxation import Relaxation, relaxation_of

LOWEST = 1.0
"""Frequency to which gains refer, Hz, where the branches speak for it: that of `magtip response`."""
LOWEST_ELASTIC = 1e-3
"""The same over the frequency unit, without branches: the response is then flat at low frequencies."""
GRID = 300
"""Frequencies at which the stiffness is stored: the spline is then within 1e-4 of the gain at a peak with Q = 10."""


def rest_scene(scene: Scene) -> Scene:
    """Return the scene that is solved: the design with its modulus at rest, and a model that its load chooses."""
    from fem.analyses.vibration import check_vibration, relaxed

    design, (load,) = scene.design, scene.loads
    if load.grip is not None or load.plate_tilt or load.coulomb is not None or load.shear_y:
        raise BadInput(
            "the response of a sweep needs an upright plate with friction none or stick and a shear along x: leave "
            "out grip, plate_tilt, a friction coefficient and shear_y (magtip response takes them)"
        )
    at_rest = replace(relaxed(design, relaxation_of(design)), modulus="long-term")
    check_vibration(at_rest, scene.loads[0], band(at_rest, scene.accuracy), scene.accuracy)
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


def check_frequency(scene: Scene, frequency: float | None) -> None:
    """Refuse a frequency, Hz, outside the band of a scene at rest."""
    low, high = band(scene.design, scene.accuracy)
    if frequency is not None and not low <= frequency <= high:
        beyond = "change loss_low or loss_high, or the accuracy"
        remedy = f"take {low:.4g} Hz or more" if frequency < low <= LOWEST else beyond
        raise BadInput(
            f"the response is known from {low:.4g} to {high:.4g} Hz, for which the silicone's branches speak and "
            f"the mesh is fine enough; got {frequency:g} Hz: {remedy}"
        )


def content(scene: Scene) -> dict[str, Any]:
    """Return everything on which the response of a scene at rest depends; the shear is along x."""
    values = scene.dimensionless()
    (first,) = values.pop("loads")
    design, unit = scene.design, unit_of(scene.design)
    relaxation = relaxation_of(design)
    low, high = band(design, scene.accuracy)
    ratio = design.magnet_density / design.density if scene.magnet == "rigid" else 0.0
    load = {
        "depth": first["depth"],
        "shear_x": first["shear"][0],
        "friction": first["friction"],
        "density_ratio": _digits(ratio),
        "branches": branches(relaxation, unit),
        "lowest": _digits(low / unit),
        "highest": _digits(high / unit),
    }
    return values | {"quantity": "response", "load": load, "physics": PHYSICS["response"]}


def branches(relaxation: Relaxation, rate: float) -> str:
    """Return branches as text, their times multiplied by a rate, 1/s."""
    pairs = zip(relaxation.shares, relaxation.times, strict=True)
    return " ".join(f"{g:.12g}:{tau * rate:.12g}" for g, tau in pairs)


def fields_of(load: Mapping[str, Any], design: Design) -> Design:
    """Return a design with the branches and the band of a path's content; its D, E and density give the unit."""
    if not load["branches"]:
        return replace(design, loss_factor=0.0)
    unit = unit_of(design)
    pairs = [word.split(":") for word in load["branches"].split()]
    words = [f"{g}:{float(tau) / unit!r}" for g, tau in pairs]
    words += [f"0:{1 / (2 * math.pi * load[end] * unit)!r}" for end in ("highest", "lowest")]
    return replace(design, prony=" ".join(words))


def _digits(value: float) -> float:
    """Return a number with the digits of a key."""
    return float(f"{value:.12g}")


def solve(scene: Scene) -> dict[str, Any]:
    """Solve for the vibration of a scene at rest.

    Returns
    -------
    "stiffness_real" and "stiffness_imag": Z over |Z| at the lowest frequency, on the grid; "bandwidth", "resonance":
    frequency at which the gain 1 / |Z| is first 3 dB below that at the lowest one, and of its first peak, over the
    unit, None beyond the band; "Q" of this peak, None without branches; "status" and "message" of the state at rest.
    """
    from fem.analyses.vibration import vibrating_sensor
    from studies.mechanics import resonance_peaks

    (load,) = scene.loads
    low, high = band(scene.design, scene.accuracy)
    sensor = vibrating_sensor(scene.design, load, (low, high), scene.accuracy, magnet=scene.magnet)
    axis = "x" if load.shears_tip else "z"

    def stiffness(f: Array) -> Any:
        vibration = sensor.at(f)
        k, along = vibration.motions.index(axis), ("x", "z").index(axis)
        return vibration.force[:, k, along] / vibration.shift[:, k, along]

    def gain(f: Array) -> Array:
        return np.asarray(1 / np.abs(stiffness(f)))

    unit = unit_of(scene.design)
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
        "Q": first.Q if first is not None and relaxation_of(scene.design).times else None,
        "status": sensor.state.status,
        "message": sensor.state.message,
    }


def gain_at(values: Mapping[str, Any], band: tuple[float, float], frequency: float) -> complex:
    """Return the gain at a frequency over that at the lowest one, as a complex number whose angle is its phase.

    Parameters
    ----------
    values : of `solve`.
    band : lowest and highest frequency of the grid, in the unit of `frequency`.
    """
    from scipy.interpolate import CubicSpline

    Z = np.array(values["stiffness_real"]) + 1j * np.array(values["stiffness_imag"])
    return complex(1 / CubicSpline(np.log(np.geomspace(*band, GRID)), Z)(math.log(frequency)))
