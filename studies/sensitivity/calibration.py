"""Calibrations of made sensors: readings over the force, how much they differ, and which force errors follow.

Axis z is read by the first element in a press. Axes x and y are read by the second and the third in shears to both
sides, at the depth where the press force is the largest; of several chips the mean of all counts. Each sensor is
pressed and sheared to the same forces, which a stiffer one reaches earlier. The states between are found by monotone
cubic interpolation. For each axis and sensor:

- the sensitivity is the change of the reading over the force range, over the range;
- the offset is the reading without a force on this axis;
- the force error is the largest one over the range, in magnitude, if the nominal sensor's calibration is used;
- the zeroed error is the same after the offset was corrected without a force;
- the recalibrated error is the same after the offset and the gain were corrected, the gain at the largest force.

A calibration is the nominal sensor's curve of reading over force, and beyond its ends a line with its mean slope.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from geometry.design import BadInput, Design
from studies.beam.beam_model import Motions, mirrored
from studies.sensitivity.beam_motions import SURROGATE, Press, motions, poses, readings
from studies.sensitivity.made_sensors import MadeSensors, made_readings, nominal_sensor

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

    A nominal sensor that the model refuses under this load is refused.
    """
    nominal = nominal_sensor(sensors.nominal)
    depth = load.depth * np.linspace(0, 1, STATES) ** 2
    pressed = _pressed(model, nominal, depth)
    if not np.isfinite(pressed.values["force_z"][0, -1]):
        raise BadInput(f"the sensor itself cannot be calibrated: {_reason(pressed, 0)}")
    press, shear = np.linspace(0, pressed.values["force_z"][0, -1], FORCES), None
    if load.shear:
        at = np.full((1, 1), load.depth)
        sheared = motions(model, nominal.designs, at, np.full((1, 1), load.shear))
        if not np.isfinite(sheared.values["force_x"][0, 0]):
            raise BadInput(f"the sensor itself cannot be calibrated in shear: {_reason(sheared, 0)}")
        shear = sheared.values["force_x"][0, 0] * np.linspace(-1, 1, FORCES)
    one, other = (_axis_curves(model, each, load, press, shear) for each in (nominal, sensors))
    return {name: (one[name], other[name]) for name in one}


def sensitivity_errors(model: str, design: Design, load: Press) -> dict[str, float]:
    """Return the model's 90 % half width of the nominal sensitivity along each axis, relative; NaN if it states none.

    The errors of force and reading at the largest force add up as independent ones.
    """
    states = np.array([[0.0, load.shear]]) if load.shear else np.zeros((1, 1))
    moved = motions(model, [design], np.full_like(states, load.depth), states)
    read, width = readings([design], moved)
    rest = read[0, 0].copy()
    none = np.zeros((1, 1, 3))
    rest[::3] = made_readings(nominal_sensor(design), none, none[..., :2]).output[0, 0, ::3]

    def relative(element: int, state: int, force: str) -> float:
        of_force = moved.half_widths[force][0, state] / moved.values[force][0, state]
        of_reading = width[0, state, element::3].mean() / (read[0, state] - rest)[element::3].mean()
        return float(np.hypot(of_force, of_reading))

    errors = {"z": relative(0, 0, "force_z")}
    # by symmetry the axes x and y of the nominal sensor have the same error
    return errors | ({name: relative(1, 1, "force_x") for name in AXES[1:]} if load.shear else {})


def _pressed(model: str, sensors: MadeSensors, depth: Array) -> Motions:
    count = len(sensors)
    moved = motions(model, sensors.designs, np.tile(depth[1:], (count, 1)), np.zeros((count, len(depth) - 1)))
    # a model may lack the shallowest presses, but every sensor that it has is at rest without one
    at_rest = np.where(np.isfinite(moved.values["force_z"]).any(axis=1), 0.0, np.nan)[:, None]
    values = {name: np.hstack([at_rest, column]) for name, column in moved.values.items()}
    nothing = np.array([[reason] for reason in sensors.refusals], dtype=object)
    return Motions(values, moved.half_widths, np.hstack([nothing, moved.refusals]))


def _axis_curves(
    model: str, sensors: MadeSensors, load: Press, press: Array, shear: Array | None
) -> dict[str, Curves]:
    """Return the curves of the axes over the forces of presses and of shears, None for no shears."""
    steps = np.linspace(0, 1, STATES)
    depths, shears = REACH * load.depth * steps**2, REACH * load.shear * steps
    moved = _pressed(model, sensors, depths)
    found = {"z": _curves(sensors, moved, "force_z", press, 0)}
    if shear is None:
        return found
    depth = np.array([_over(reached, depths, press[-1:]) for reached in moved.values["force_z"]])
    moved = motions(model, sensors.designs, np.tile(depth, STATES), np.tile(shears, (len(sensors), 1)))
    other = mirrored(moved.values)
    values = {name: np.hstack([other[name][:, :0:-1], column]) for name, column in moved.values.items()}
    both = Motions(values, {}, np.hstack([moved.refusals[:, :0:-1], moved.refusals]))
    return found | {name: _curves(sensors, both, "force_x", shear, k) for k, name in enumerate(AXES) if k}


def _curves(sensors: MadeSensors, moved: Motions, along: str, force: Array, axis: int) -> Curves:
    """Return the curves of an axis over given forces; of several chips, the reading is the mean."""
    read = made_readings(sensors, *poses(moved.values, towards_y=axis == 2))
    output, rail = read.output[..., axis::3].mean(axis=-1), read.saturated[..., axis::3].any(axis=-1)
    reached, rest = moved.values[along], STATES - 1 if axis else 0
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


def _reason(moved: Motions, k: int) -> str:
    """Return why a sensor lacks states, of its largest loads if there are several reasons, "" if it has all."""
    return next((reason for reason in reversed(moved.refusals[k].tolist()) if reason), "")


@dataclass(frozen=True, slots=True, eq=False)
class AxisSpread:
    """Calibrations of n made sensors along one axis.

    Attributes
    ----------
    force_range : from the least to the largest force, N.
    nominal : sensitivity and offset of the nominal sensor, V/N and V, or T/N and T for a chip, and force errors of 0.
    model_error : half width of the model's 90 % interval of the nominal sensitivity, relative; NaN if it states none.
    made : the same quantities of the made sensors, shape (n,), force errors in N; NaN where a sensor has failed.
    refusals : why a sensor has failed, "" where it has not.
    message : why the axis cannot be calibrated at all, "" if it can.
    """

    force_range: tuple[float, float]
    nominal: Mapping[str, float]
    model_error: float
    made: Mapping[str, Array]
    refusals: tuple[str, ...]
    message: str


def refusals_of(axes: Mapping[str, AxisSpread]) -> tuple[str, ...]:
    """Return why each sensor has failed on any axis, "" where it has not."""
    every = zip(*(axis.refusals for axis in axes.values()), strict=True)
    return tuple(next(filter(None, reasons), "") for reasons in every)


def spread_of(sensors: MadeSensors, load: Press, model: str = SURROGATE) -> dict[str, AxisSpread]:
    """Return the spread of the calibrations of made sensors by the axis.

    The force range is that of the design itself: the press force at the depth, and the force of the shear to both
    sides there.
    """
    errors = sensitivity_errors(model, sensors.nominal, load)
    return {name: _spread(*pair, name, errors[name]) for name, pair in curves(model, sensors, load).items()}


def _spread(nominal: Curves, made: Curves, name: str, model_error: float) -> AxisSpread:
    force, truth = nominal.force, nominal.reading[0]
    rising = np.diff(truth)
    message = ""
    if not ((rising > 0).all() or (rising < 0).all()):
        message = f"the reading of axis {name} does not change throughout the force range in one sense"
    elif nominal.saturated[0]:
        message = f"the reading of axis {name} of the design itself lies at a rail"
    refusals = tuple(
        message or reason or ("its reading lies at a rail" if rail else "")
        for reason, rail in zip(made.refusals, made.saturated, strict=True)
    )
    failed = np.array([bool(reason) for reason in refusals])
    reading, rest = np.where(failed[:, None], np.nan, made.reading), np.where(failed, np.nan, made.rest)
    span, change = force[-1] - force[0], truth[-1] - truth[0]
    # offset and gain as in the nominal sensor at rest and at the largest force
    above = reading - rest[:, None]
    corrected = {
        "force_error": reading,
        "zeroed_force_error": nominal.rest[0] + above,
        "recalibrated_force_error": nominal.rest[0] + above * ((truth[-1] - nominal.rest[0]) / above[:, -1:]),
    }
    none = np.full(len(failed), np.nan)
    errors = {name: none if message else _largest_error(force, truth, each) for name, each in corrected.items()}
    return AxisSpread(
        force_range=(float(force[0]), float(force[-1])),
        nominal={"sensitivity": float(change / span), "offset": float(nominal.rest[0])} | dict.fromkeys(errors, 0.0),
        model_error=model_error,
        made={"sensitivity": (reading[:, -1] - reading[:, 0]) / span, "offset": rest} | errors,
        refusals=refusals,
        message=message,
    )


def _largest_error(force: Array, truth: Array, reading: Array) -> Array:
    """Return the largest error of the forces that the nominal calibration gives, shape (n,), N."""
    slope = (force[-1] - force[0]) / (truth[-1] - truth[0])
    order = np.argsort(truth)
    inside = np.interp(reading, truth[order], force[order])
    low, high = truth[order][[0, -1]]
    beyond = slope * (np.minimum(reading - low, 0.0) + np.maximum(reading - high, 0.0))
    return np.asarray(np.abs(inside + beyond - force).max(axis=1))


LEVEL = 0.95
"""Confidence of the intervals."""


def percentile(values: Array, share: float) -> tuple[float, float, float]:
    """Return the quantile of the values, shape (n,), and its confidence interval; NaN marks a failed member.

    The interval lies between two order statistics, whose ranks are binomial; it needs no distribution. Its lower end
    counts failed members as lowest, its upper end as highest. An end beyond the sample is infinite; without any value
    the quantile is NaN.

    >>> percentile(np.arange(101.0), 0.5)
    (50.0, 40.0, 60.0)
    """
    from scipy.stats import binom

    known = np.sort(values[np.isfinite(values)])
    count, failed = len(values), len(values) - len(known)
    if not len(known):
        return np.nan, -np.inf, np.inf
    tail = (1 - LEVEL) / 2
    low_rank, high_rank = (int(binom.ppf(one, count, share)) for one in (tail, 1 - tail))
    # with the failed ones lowest, the known values have the ranks from `failed` on
    low = known[low_rank - 1 - failed] if low_rank > failed else -np.inf
    high = known[high_rank] if high_rank < len(known) else np.inf
    return float(np.quantile(known, share)), float(low), float(high)
