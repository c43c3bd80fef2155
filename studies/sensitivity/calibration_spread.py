"""How much do the calibrations of made sensors differ, and which force errors follow?

For each axis and sensor:

- the sensitivity is the change of the reading over the force range, over the range;
- the offset is the reading without a force on this axis;
- the force error is the largest one over the range, in magnitude, if the nominal sensor's calibration is used;
- the zeroed error is the same after the offset was corrected without a force;
- the recalibrated error is the same after the offset and the gain were corrected, the gain at the largest force.

A calibration is the nominal sensor's curve of reading over force, and beyond its ends a line with its mean slope.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array
from geometry.design import Design
from studies.sensitivity.calibration_curves import Curves, curves, sensitivity_errors
from studies.sensitivity.made_sensors import MadeSensors, made_sensors
from studies.sensitivity.tolerances import Tolerances
from studies.sensitivity.varied_inputs import Press


@dataclass(frozen=True, slots=True, eq=False)
class AxisSpread:
    """Calibrations of n made sensors along one axis; NaN where a sensor has failed.

    Attributes
    ----------
    force_range : from the least to the largest force, N.
    nominal_sensitivity, nominal_offset : of the nominal sensor, V/N and V, or T/N and T for a chip.
    model_error : half width of the model's 90 % interval of the nominal sensitivity, relative; 0 if it states none.
    sensitivity, offset : of the made sensors, shape (n,).
    error, zeroed_error, recalibrated_error : largest error of the force over the range, shape (n,), N.
    refusals : why a sensor has failed, "" where it has not.
    message : why the axis cannot be calibrated at all, "" if it can.
    """

    force_range: tuple[float, float]
    nominal_sensitivity: float
    nominal_offset: float
    model_error: float
    sensitivity: Array
    offset: Array
    error: Array
    zeroed_error: Array
    recalibrated_error: Array
    refusals: tuple[str, ...]
    message: str


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationSpread:
    """Made sensors, and the spread of their calibrations by the axis."""

    sensors: MadeSensors
    axes: Mapping[str, AxisSpread]

    @property
    def refusals(self) -> tuple[str, ...]:
        """Why each sensor has failed on any axis, "" where it has not."""
        every = zip(*(axis.refusals for axis in self.axes.values()), strict=True)
        return tuple(next((reason for reason in one if reason), "") for one in every)


def calibration_spread(
    design: Design,
    load: Press,
    tolerances: Tolerances = Tolerances(),
    count: int = 1000,
    seed: int = 0,
    model: str = "surrogate",
) -> CalibrationSpread:
    """Return the spread of the calibrations of made sensors.

    The force range is that of the design itself: the press force at the depth, and the force of the shear to both
    sides there.

    Raises
    ------
    BadInput
        The model refuses the design itself under this load, or the draws are impossible.
    """
    sensors = made_sensors(design, tolerances, count, seed)
    pairs = curves(model, sensors, load)
    errors = sensitivity_errors(model, design, load)
    return CalibrationSpread(sensors, {name: _spread(*pair, name, errors[name]) for name, pair in pairs.items()})


def _spread(nominal: Curves, made: Curves, name: str, model_error: float) -> AxisSpread:
    """Return the spread of the sensors' curves along an axis."""
    force, truth = nominal.force, nominal.reading[0]
    count = len(made.refusals)
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
    reading = np.where(failed[:, None], np.nan, made.reading)
    rest = np.where(failed, np.nan, made.rest)
    span, change = force[-1] - force[0], truth[-1] - truth[0]
    # offset and gain as in the nominal sensor at rest and at the largest force
    gain = (truth[-1] - nominal.rest[0]) / (reading[:, -1] - rest)
    zeroed = nominal.rest[0] + reading - rest[:, None]
    recalibrated = nominal.rest[0] + (reading - rest[:, None]) * gain[:, None]
    none = np.full(count, np.nan)
    return AxisSpread(
        force_range=(float(force[0]), float(force[-1])),
        nominal_sensitivity=float(change / span),
        nominal_offset=float(nominal.rest[0]),
        model_error=model_error,
        sensitivity=(reading[:, -1] - reading[:, 0]) / span,
        offset=rest,
        error=none if message else _largest_error(force, truth, reading),
        zeroed_error=none if message else _largest_error(force, truth, zeroed),
        recalibrated_error=none if message else _largest_error(force, truth, recalibrated),
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


def failure_reasons(refusals: Sequence[str]) -> dict[str, int]:
    """Return how many sensors have failed for each reason, the most frequent first.

    Reasons that differ in their numbers only are one, and the first of them is named.

    >>> failure_reasons(["", "rail", "1 mm deep", "rail", "2.5e-3 mm deep", "rail"])
    {'rail': 3, '1 mm deep': 2}
    """
    groups: dict[str, list[str]] = {}
    for reason in filter(None, refusals):
        groups.setdefault(re.sub(r"-?\d[\d.]*(e[+-]?\d+)?", "#", reason), []).append(reason)
    return {group[0]: len(group) for group in sorted(groups.values(), key=len, reverse=True)}
