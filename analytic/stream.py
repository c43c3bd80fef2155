"""Decoding of one row of readings at a time, for a real-time loop: thousands of rows per second."""

from math import isnan, nan
from typing import NamedTuple

import numpy as np

from analytic.decode import Decoder, Status, nearest_of, rows_of, state
from analytic.inverse.pose_search import poses_of

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
    """

    def __init__(self, coder: Decoder) -> None:
        self.coder = coder
        self.last = np.zeros(3)

    def step(self, field: tuple[float, ...]) -> Sample:
        """Decode one row of readings, B.n of each element, T.

        Raises
        ------
        BadInput
            The number of readings differs from the number of elements.
        """
        (row,) = rows_of(self.coder, [field])
        status, poses, _ = poses_of(row, self.coder.forward, self.coder.table, self.coder.goal)
        if not len(poses):
            return Sample(status, (nan,) * 3, (nan,) * 2, (nan,) * 3, 0)
        self.last = poses[nearest_of(poses, self.last)]
        tilt, force, _, _ = state(self.coder, self.last[:, None])
        pulls = status == "ok" and self.coder.mechanics is not None and isnan(force[2, 0])
        (x, y, z), (rx, ry), (f_x, f_y, f_n) = (values.ravel().tolist() for values in (self.last, tilt, force))
        return Sample("tension" if pulls else status, (x, y, z), (rx, ry), (f_x, f_y, f_n), len(poses))
