"""Readings of made sensors whose magnets are in given poses.

The magnet's offset turns with the silicone around it, and its tilt adds to that of the state. An element that is
displaced reads as if the magnet were displaced the other way, so each element's offset enters as a shift of the pose.
Outputs are those before the converter rounds them: a step of a chip is no deviation of a sensor, and would hide in
which sense its reading changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analytic.batch_readings import batch_readings
from analytic.hall import converted, rotated
from analytic.parts import common_values
from geometry.arrays import Array
from studies.sensitivity.made_sensors import ELEMENTS, MadeSensors


@dataclass(frozen=True, slots=True, eq=False)
class MadeReadings:
    """Readings of n made sensors in k states; NaN, and not saturated, where there is no pose or no sensor.

    Attributes
    ----------
    field_T : flux density that each element measures, shape (n, k, 3), T.
    output : output of each element within the rails, not rounded, shape (n, k, 3), V, or T for a chip.
    saturated : whether the output lies at a rail, shape (n, k, 3).
    """

    field_T: Array
    output: Array
    saturated: NDArray[np.bool_]


def made_readings(sensors: MadeSensors, shift: Array, tilt: Array) -> MadeReadings:
    """Return the readings of each sensor in its states.

    Parameters
    ----------
    shift : displacement of the magnet by the load, shape (n, k, 3), mm.
    tilt : rotation vector (rx, ry) of the magnet by the load, shape (n, k, 2), rad.
    """
    count, states = shift.shape[:2]
    # None stands for an impossible sensor: any design may take its place, since its rows have no pose
    designs = [design or sensors.nominal for design in sensors.designs]
    possible = np.array([design is not None for design in sensors.designs])
    shift = np.where(possible[:, None, None], shift, np.nan)
    # rotation vectors add up to a turn about z, which moves the axis of the magnet by a third-order angle only
    turn = tilt + sensors.magnet_tilt[:, None]
    moved = shift + rotated(sensors.magnet_offset[:, None], tilt)
    relative = moved[:, :, None] - sensors.element_offset[:, None]
    owner = np.repeat(np.arange(count), states * ELEMENTS)
    poses = np.repeat(turn.reshape(-1, 2), ELEMENTS, axis=0)
    rows = batch_readings(designs, owner, relative.reshape(-1, 3), poses)
    # row j of a state has the offset of element j: only the reading of this element is right
    field = np.diagonal(rows.field_T.reshape(count, states, ELEMENTS, ELEMENTS), axis1=2, axis2=3)
    gain, null, low, high, *_ = common_values(sensors.nominal)
    raw = null + sensors.null_shift[:, None] + gain * sensors.gain_factor[:, None] * field
    output, saturated = converted(raw, np.array(low), np.array(high), np.array(0.0))
    return MadeReadings(field, output, saturated)
