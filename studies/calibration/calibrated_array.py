"""Decoding of an array by its calibration: all beams jointly, each by its own sensor, with intervals of its forces.

A beam was calibrated in the field of its neighbours at rest, as the design has it. So its readings count less that
field, and with that of the calibrated neighbours, whose motions then do what they do. An interval is that of the
beam's own calibration: what a neighbour's error makes of it is some percent of the neighbour's interval, and is left
out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from analytic.array_stream import ArrayStream
from analytic.beam_arrays import readings_of_array, standing
from analytic.decode import field_of, state
from analytic.inverse.forward_model import model
from analytic.time_series import RelaxingForce
from geometry.array_design import ArrayDesign
from geometry.arrays import Array
from studies.calibration import calibrated_forces
from studies.calibration.array_calibration import stray_outputs
from studies.calibration.calibration_file import ArrayFit, at_rails
from studies.sensing import decode_readings
from studies.sensing.array_readings import FOUND, NET, ArrayDecoder, frame_status

if TYPE_CHECKING:
    from analytic.array_stream import Frame
    from analytic.decode import Status

HALF = ("half_width_x_N", "half_width_y_N", "half_width_z_N")


class CalibratedArray(ArrayDecoder):
    """Decodes frames of an array by its calibration; the columns of each beam also have half of its 90 % interval."""

    def __init__(
        self, array: ArrayDesign, found: ArrayFit, jitter: float = 0.0, *, reject_ambient: bool = False
    ) -> None:
        coders = [calibrated_forces.coder_of(fit, warm=True) for fit in found.beams]
        self._fits, self._coders, self._stray = found.beams, coders, stray_outputs(array)
        beams = replace(
            standing(model(array.design), array, ambient=reject_ambient),
            # the magnet of each calibrated sensor lies as it does in the array
            poles=np.ones(len(array)),
            made=tuple(coder.forward for coder in coders),
        )
        self.stream, self._zeroed = ArrayStream(coders, beams, jitter), False
        self.stream.offset = readings_of_array(beams, np.zeros((1, len(array), 3)), own=False)[0]
        self._design, self._growth = array.design, decode_readings.most_growth(array.design)
        self.said, self._shape = [], (len(array), len(self._stray[0]))
        self._rest()
        self.columns = (*NET, *(f"b{k}_{name}" for k in range(1, len(array) + 1) for name in (*FOUND, *HALF)))

    def _rest(self) -> None:
        """Begin with a silicone that has relaxed."""
        doubted = decode_readings.doubted_branches(self._design)
        self._doubted = [RelaxingForce(self._design, each, self._shape[:1]) for each in doubted]

    def fields(self, readings: Array) -> Array:
        """Return the fields (f, n, k), T, without those of neighbours at rest, of frames of readings (f, n k), in the
        elements' unit; infinite where an element is at a rail."""
        rows, found = readings.reshape(-1, *self._shape), np.empty((len(readings), *self._shape))
        for k, (fit, coder) in enumerate(zip(self._fits, self._coders, strict=True)):
            fields = field_of(coder.forward.elements, rows[:, k] - self._stray[k])
            found[:, k] = np.where(at_rails(fit.sensor.design, rows[:, k]), np.inf, fields)
        return found

    def zero(self, fields: Array) -> None:
        """Take frames of fields (m, n, k), T, for those of the array at rest."""
        self.stream.zero(np.where(np.isinf(fields), np.nan, fields))
        self._zeroed = True
        self._rest()

    def frame(self, fields: Array, time: float | None) -> tuple[Frame, list[Status]]:
        """Decode a frame of fields (n, k), T, and return the statuses of its beams."""
        found = self.stream.step(fields, time)
        full = [bool(np.isinf(row).any()) for row in fields]
        return found, ["saturated" if at_rail else word for at_rail, word in zip(full, found.status, strict=True)]

    def half_widths(self, shift: Array) -> Array:
        """Return half of the 90 % intervals (f, n, 3), N, of forces at shifts (f, n, 3), mm."""
        half = np.full_like(shift, np.nan)
        for k, fit in enumerate(self._fits):
            known = np.isfinite(shift[:, k, 2])
            (half[known, k],) = calibrated_forces.intervals(
                fit, [fit.covariance], shift[known, k], np.zeros(int(known.sum())), zeroed=self._zeroed
            )
        return half

    def rows(self, fields: Array, times: Sequence[float | None]) -> list[tuple[Any, ...]]:
        """Return the columns of frames of fields (f, n, k), T."""
        frames = [self.frame(*each) for each in zip(fields, times, strict=True)]
        shift = np.array([found.shift for found, _ in frames]).reshape(-1, len(self._fits), 3)
        half, rows = self.half_widths(shift), []
        slow = np.stack([state(each, shift[:, k].T.copy())[1].T for k, each in enumerate(self._coders)], axis=1)
        for (found, words), wide, force, time in zip(frames, half, slow, times, strict=True):
            if time is not None:
                wide = self._over_time(time, found, force, wide)
            wide = np.where(np.isfinite(found.force), wide, np.nan)
            beams = zip(words, found.force.tolist(), found.shift.tolist(), wide.tolist(), strict=True)
            each = [value for word, *numbers in beams for value in (word, *(v for row in numbers for v in row))]
            rows.append((frame_status(words, found.force), *found.force.sum(axis=0).tolist(), *each))
        return rows

    def _over_time(self, time: float, found: Frame, slow: Array, half: Array) -> Array:
        """Return half of the intervals (n, 3) of a silicone that relaxes, from those of slow forces (n, 3)."""
        shear = found.load[:, 1:]
        others = [law.step(time, slow, shear) for law in self._doubted]
        off = np.max([np.linalg.norm(each - found.force, axis=1) for each in others] or [np.zeros(len(slow))], axis=0)
        return calibrated_forces.relaxing_half_width(half, slow, found.force, off, self._growth)
