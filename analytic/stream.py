"""Decoding of one row of readings at a time, for a real-time loop: thousands of rows per second."""

from math import isnan, nan
from typing import NamedTuple

import numpy as np

from analytic.decode import Decoder, Status, nearest_of, rows_of, state
from analytic.inverse.pose_search import poses_of
from analytic.time_series import TimeSeries, zero_offset, zeroed
from geometry.arrays import Array

__all__ = ["Sample", "Stream"]

Vector = tuple[float, float, float]


class Sample(NamedTuple):
    """Result of one row of readings; NaN where there is no pose. Units as in `analytic.decode.Decoded`."""

    status: Status
    shift: Vector
    tilt: tuple[float, float]
    force: Vector
    multiplicity: int


class Stream:
    """Decoder of a time series, one row at a time; of several poses it chooses the one nearest to the last.

    coder : as returned by `analytic.decode.decoder`.
    jitter : of `analytic.time_series.RowChecks`.
    """

    def __init__(self, coder: Decoder, jitter: float = 0.0) -> None:
        self.coder, self._jitter, self._nominal = coder, jitter, coder
        self.last = np.zeros(3)
        self.offset = np.zeros(len(coder.sigma))
        self._past: TimeSeries | None = None

    def zero(self, fields: Array) -> None:
        """Take rows of readings (n, k), T, at any moment for those of the sensor at rest, where it has relaxed."""
        self.offset, self._past = zero_offset(self.coder, fields), None
        self.coder = zeroed(self._nominal, self.offset)

    def step(self, field: tuple[float, ...], time: float | None = None) -> Sample:
        """Decode one row of readings, B.n of each element, T.

        Parameters
        ----------
        time : of the row, s: the row is compared with those before it, and the force is that of a silicone that
            relaxes (`analytic.time_series`). Without times, or where one is not known (NaN, status untimed), it is
            that of slow loading.

        Raises
        ------
        BadInput
            The number of readings differs from the number of elements.
        """
        (row,) = rows_of(self.coder, [field]) + self.offset
        status: Status
        status, poses, _ = poses_of(row, self.coder.forward, self.coder.table, self.coder.goal)
        if len(poses):
            self.last = poses[nearest_of(poses, self.last)]
        shift = self.last if len(poses) else np.full(3, nan)
        tilt, force, load, _ = state(self.coder, shift[:, None])
        if status == "ok" and self.coder.mechanics is not None and isnan(force[2, 0]):
            status = "tension"
        if time is not None:
            self._past = self._past or TimeSeries(self.coder, self._jitter)
            (status,), force = self._past.step(time, row[None], [status], force.T, load.T)
        (x, y, z), (rx, ry), (f_x, f_y, f_n) = (values.ravel().tolist() for values in (shift, tilt, force))
        return Sample(status, (x, y, z), (rx, ry), (f_x, f_y, f_n), len(poses))
