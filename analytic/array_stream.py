"""Decoding of an array's frames one after the other: all beams jointly, each with a time series of its own.

A frame starts from the poses of the one before. Beams for which these do not lead to poses with the readings start
anew: each by itself, then less what its neighbours add in the poses so found, then all together. Beams that have no
reading, or no pose by themselves, stay where they were last seen, and the others are decoded beside them. Where an
ambient field is unknown, beams whose readings contradict the others' are left out in the same way.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analytic import beam_arrays
from analytic.beam_arrays import BeamArray, Coders
from analytic.decode import Status, rows_of, state
from analytic.hall import at_rail
from analytic.time_series import TimeSeries
from geometry.arrays import Array


class Frame(NamedTuple):
    """Result of one frame of n beams; NaN where there is no pose. Units as in `analytic.decode.Decoded`.

    own : what each beam reads of its own magnet, as one that lies as the design's, shape (n, k), T: the readings with
        the zero, less what the other magnets add.
    """

    status: list[Status]
    shift: Array
    tilt: Array
    force: Array
    load: Array
    own: Array


class ArrayStream:
    """Decoder of a time series of frames.

    coder : of one beam, or those of all beams, whose readings at a rail are NaN already. array : all of them.
    jitter : of `analytic.time_series.RowChecks`.
    """

    def __init__(self, coder: Coders, array: BeamArray, jitter: float = 0.0) -> None:
        self.coders, self.array, self._jitter = coder, array, jitter
        each = beam_arrays.coders_of(coder, len(array))
        self.coder, self._tolerance = each[0], np.array([one.goal.tolerance for one in each])
        self.offset = np.zeros(self._tolerance.shape)
        self._last = np.zeros((len(array), 3))
        self._past: TimeSeries | None = None

    def zero(self, fields: Array) -> None:
        """Take frames of readings (m, n, k), T, for those of the array at rest, where it has relaxed."""
        rest = beam_arrays.readings_of_array(self.array, np.zeros((1, len(self.array), 3)))[0]
        self.offset, self._past = np.asarray(rest - np.nanmean(fields, axis=0)), None

    def step(self, fields: Array, time: float | None = None) -> Frame:
        """Decode a frame of readings (n, k), T; `time`, s, is as in `analytic.stream.Stream.step`."""
        fields = rows_of(self.coder, fields)
        full = np.asarray(at_rail(self.coder.forward.elements, fields.T).any(axis=0) & (self.coders is self.coder))
        lost = np.asarray(full | ~np.isfinite(fields).all(axis=1))
        rows = np.where(lost[:, None], np.nan, fields + self.offset)
        shift, total, own = self._poses(rows)
        found, fits = np.asarray(np.isfinite(shift[:, 2])), self._fits(rows - total)
        shift[~fits] = np.nan
        known = found & fits
        self._last = np.where(known[:, None], shift, self._last)
        tilt, force, load = self._states(shift)
        force[~known], load[~known], tilt[~known] = np.nan, np.nan, np.nan
        pressed = np.asarray(np.isfinite(force[:, 2]) | (self.coder.mechanics is None))
        flags = (full, np.isfinite(rows).all(axis=1), found, fits, pressed)
        status = [_word(*each) for each in zip(*(flag.tolist() for flag in flags), strict=True)]
        if time is not None:
            self._past = self._past or TimeSeries(self.coder, self._jitter, len(self.array))
            status, force = self._past.step(time, rows, status, force, load)
        return Frame(status, shift, tilt, force, load, (rows - total + own) * self.array.poles[:, None])

    def _poses(self, rows: Array) -> tuple[Array, Array, Array]:
        """Return what `analytic.beam_arrays.decoded_with_readings` finds for readings (n, k), some of them NaN."""
        readings, last, given = rows[None], self._last[None], np.isfinite(rows).all(axis=1)
        found, total, own = beam_arrays.decoded_with_readings(self.coders, self.array, readings, last)
        known = np.isfinite(found[0, :, 0]) & self._fits(rows - total[0])
        if known[given].all():
            return found[0], total[0], own[0]
        # the others by themselves, with neighbours where they are or were last, and again with those found
        last, searched = np.where(known[:, None], found, last), np.where(known[:, None], np.nan, rows)
        for _ in range(2):
            alone = beam_arrays.shifts_alone(self.coders, self.array, searched[None], last)
            last = np.where(np.isfinite(alone), alone, last)
        held = np.where((known | np.isfinite(alone[0, :, 0]))[:, None], rows, np.nan)
        found, total, own = beam_arrays.decoded_with_readings(self.coders, self.array, held[None], last)
        if self.array.ambient and not (fits := self._fits(rows - total[0]))[np.isfinite(held[:, 0])].all():
            held = np.where(fits[:, None], held, np.nan)
            found, total, own = beam_arrays.decoded_with_readings(self.coders, self.array, held[None], last)
        return found[0], total[0], own[0]

    def _states(self, shift: Array) -> tuple[Array, Array, Array]:
        """Return tilt (n, 2), force and load (n, 3) of all beams at shifts (n, 3)."""
        if self.coders is self.coder:
            tilt, force, load, _ = (values.T for values in state(self.coder, np.ascontiguousarray(shift.T)))
            return tilt, force, load
        each = beam_arrays.coders_of(self.coders, len(shift))
        found = [state(one, np.ascontiguousarray(at[:, None]))[:3] for one, at in zip(each, shift, strict=True)]
        tilt, force, load = (np.hstack(values).T for values in zip(*found, strict=True))
        return tilt, force, load

    def _fits(self, misfit: Array) -> NDArray[np.bool_]:
        """Return whether misfits (n, k), T, of more than three readings are within their bounds; not for NaN."""
        if misfit.shape[1] == 3:
            return np.asarray(np.isfinite(misfit).all(axis=1))
        return np.asarray((np.abs(misfit) <= self._tolerance).all(axis=1))


def _word(full: bool, given: bool, found: bool, fits: bool, pressed: bool) -> Status:
    if not given:
        return "saturated" if full else "not_finite"
    if not found:
        return "out_of_workspace"
    if not fits:
        return "inconsistent"
    return "ok" if pressed else "tension"
