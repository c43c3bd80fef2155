"""Calibration of each axis: the reading of its element over the force, for many sensors at once.

Axis z is read by the first element in a press. Axes x and y are read by the second and the third in shears to both
sides, at the depth where the press force is the largest. Each sensor is pressed and sheared to the same forces, which
a stiffer one reaches earlier. The states between are found by monotone cubic interpolation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from geometry.design import BadInput, Design
from studies.sensitivity.beam_motions import Motions, motions, poses, readings
from studies.sensitivity.made_readings import made_readings
from studies.sensitivity.made_sensors import MadeSensors, nominal_sensor
from studies.sensitivity.varied_inputs import Press

AXES = ("z", "x", "y")
"""Axes in the order of the elements that read them."""
FORCES = 21
"""Number of forces of a calibration, from one end of its range to the other."""
STATES = 25
"""Number of states that are computed of each sensor and load, up to the reach."""
REACH = 1.4
"""Depth and shear up to which sensors are computed, over the nominal ones: softer sensors must be pressed deeper."""


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """Readings of n sensors over the force along one axis.

    Attributes
    ----------
    force : forces, rising, shape (FORCES,), N.
    reading : output of the axis' element at these forces, shape (n, FORCES), V, or T for a chip; NaN where the sensor
        does not reach the force.
    rest : the reading without a force on this axis, shape (n,).
    saturated : whether the element is at a rail at one of the forces, shape (n,).
    refusals : why a sensor has no curve, "" where it has one.
    """

    force: Array
    reading: Array
    rest: Array
    saturated: NDArray[np.bool_]
    refusals: tuple[str, ...]


def curves(model: str, sensors: MadeSensors, load: Press) -> dict[str, tuple[Curves, Curves]]:
    """Return the curves of the nominal sensor and of the made ones by the axis; x and y only with a shear.

    Raises
    ------
    BadInput
        The model refuses the nominal sensor under this load.
    """
    nominal = nominal_sensor(sensors.nominal)
    depth = load.depth * np.linspace(0, 1, STATES) ** 2
    pressed = _pressed(model, nominal, depth)
    if not np.isfinite(pressed.values["force_z"][0, -1]):
        raise BadInput(f"the sensor itself cannot be calibrated: {_reason(pressed, 0)}")
    press = np.linspace(0, pressed.values["force_z"][0, -1], FORCES)
    axes = {"z": tuple(_press_curves(model, each, load, press) for each in (nominal, sensors))}
    if load.shear:
        at = np.full((1, 1), load.depth)
        sheared = motions(model, nominal.designs, at, np.full((1, 1), load.shear))
        if not np.isfinite(sheared.values["force_x"][0, 0]):
            raise BadInput(f"the sensor itself cannot be calibrated in shear: {_reason(sheared, 0)}")
        shear = sheared.values["force_x"][0, 0] * np.linspace(-1, 1, FORCES)
        both = [_shear_curves(model, each, load, press[-1], shear) for each in (nominal, sensors)]
        axes |= {name: tuple(one[k] for one in both) for k, name in enumerate(AXES[1:])}
    return axes  # type: ignore[return-value]


def sensitivity_errors(model: str, design: Design, load: Press) -> dict[str, float]:
    """Return the model's 90 % half width of the nominal sensitivity along each axis, relative; 0 if it states none.

    The errors of force and reading at the largest force add up as independent ones.
    """
    states = np.array([[0.0, load.shear]]) if load.shear else np.zeros((1, 1))
    moved = motions(model, [design], np.full_like(states, load.depth), states)
    read, width = readings([design], moved)
    rest = read[0, 0].copy()
    none = np.zeros((1, 1, 3))
    rest[0] = made_readings(nominal_sensor(design), none, none[..., :2]).output[0, 0, 0]

    def relative(element: int, state: int, force: str) -> float:
        of_force = moved.half_widths[force][0, state] / moved.values[force][0, state]
        of_reading = width[0, state, element] / (read[0, state, element] - rest[element])
        return float(np.hypot(of_force, of_reading))

    errors = {"z": relative(0, 0, "force_z")}
    # by symmetry the axes x and y of the nominal sensor have the same error
    return errors | ({name: relative(1, 1, "force_x") for name in AXES[1:]} if load.shear else {})


def _pressed(model: str, sensors: MadeSensors, depth: Array) -> Motions:
    """Return presses of each sensor to these depths, of which the first is 0."""
    count = len(sensors)
    moved = motions(model, sensors.designs, np.tile(depth[1:], (count, 1)), np.zeros((count, len(depth) - 1)))
    # a model may lack the shallowest presses, but every sensor that it has is at rest without one
    at_rest = np.where(np.isfinite(moved.values["force_z"]).any(axis=1), 0.0, np.nan)[:, None]
    values = {name: np.hstack([at_rest, column]) for name, column in moved.values.items()}
    nothing = np.array([[reason] for reason in sensors.refusals], dtype=object)
    return Motions(values, moved.half_widths, np.hstack([nothing, moved.refusals]))


def _press_curves(model: str, sensors: MadeSensors, load: Press, force: Array) -> Curves:
    """Return the readings of the first element over the press force."""
    moved = _pressed(model, sensors, REACH * load.depth * np.linspace(0, 1, STATES) ** 2)
    read = made_readings(sensors, *moved.poses())
    return _curves(sensors, moved, moved.values["force_z"], read.output[..., 0], read.saturated[..., 0], force, 0)


def _shear_curves(model: str, sensors: MadeSensors, load: Press, press: float, force: Array) -> tuple[Curves, Curves]:
    """Return the readings of the second element over the force along x, and of the third along y."""
    depths = REACH * load.depth * np.linspace(0, 1, STATES) ** 2
    pressed = _pressed(model, sensors, depths).values["force_z"]
    depth = np.array([_at(one, depths, press) for one in pressed])
    shear = REACH * load.shear * np.linspace(0, 1, STATES)
    count = len(sensors)
    moved = motions(model, sensors.designs, np.tile(depth[:, None], len(shear)), np.tile(shear, (count, 1)))
    # the mirror image of a shear reverses what points along it
    signs = {"force_x": -1.0, "shift_x": -1.0, "tilt": -1.0}
    both = {
        name: np.hstack([signs.get(name, 1.0) * values[:, :0:-1], values]) for name, values in moved.values.items()
    }
    both_refusals = np.hstack([moved.refusals[:, :0:-1], moved.refusals])
    whole = Motions(both, {}, both_refusals)
    axes = []
    for element, towards_y in ((1, False), (2, True)):
        read = made_readings(sensors, *poses(both, towards_y))
        output, rail = read.output[..., element], read.saturated[..., element]
        axes.append(_curves(sensors, whole, both["force_x"], output, rail, force, len(shear) - 1))
    return axes[0], axes[1]


def _curves(
    sensors: MadeSensors,
    moved: Motions,
    reached: Array,
    output: Array,
    rail: NDArray[np.bool_],
    force: Array,
    rest: int,
) -> Curves:
    """Return the curves over given forces; `rest` is the index of the state without a force on this axis."""
    reading = np.array([_over(one, values, force) for one, values in zip(reached, output, strict=True)])
    inside = (reached >= force[0]) & (reached <= force[-1])
    lacking = np.isnan(reading).any(axis=1)
    refusals = [
        (sensors.refusals[k] or _reason(moved, k) or f"its force does not rise to {force[-1]:.3g} N")
        if lacking[k]
        else ""
        for k in range(len(sensors))
    ]
    return Curves(force, reading, output[:, rest], (rail & inside).any(axis=1), tuple(refusals))


def _over(reached: Array, values: Array, force: Array) -> Array:
    """Return values at given forces by monotone cubic interpolation; NaN beyond the forces that were reached.

    NaN everywhere if the force does not rise from state to state: then it belongs to several states.
    """
    from scipy.interpolate import PchipInterpolator

    known = np.isfinite(reached) & np.isfinite(values)
    x = reached[known]
    if len(x) < 2 or not (np.diff(x) > 0).all():
        return np.full(len(force), np.nan)
    # rounding must not cut off the ends of the range
    slack = 1e-9 * abs(force[-1])
    result = PchipInterpolator(x, values[known])(np.clip(force, x[0], x[-1]))
    return np.where((force >= x[0] - slack) & (force <= x[-1] + slack), result, np.nan)


def _at(reached: Array, depth: Array, force: float) -> float:
    """Return the depth at which a sensor is pressed with a force; NaN if it is not reached."""
    return float(_over(reached, depth, np.array([force]))[0])


def _reason(moved: Motions, k: int) -> str:
    """Return why a sensor lacks states, of its largest loads if there are several reasons, "" if it has all."""
    return next((reason for reason in reversed(moved.refusals[k].tolist()) if reason), "")
