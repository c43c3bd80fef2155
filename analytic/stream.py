"""Decoding of one row of readings at a time, for a real-time loop: `analytic.decode` without what only a study needs.

Of several poses the stream chooses the one nearest to the last pose.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from analytic import decode
from analytic.decode import Decoder, Status

__all__ = ["Sample", "Stream"]

Vector = tuple[float, float, float]


class Sample(NamedTuple):
    """Result of one row of readings; NaN where there is no pose. Units as in `analytic.decode.Decoded`."""

    status: Status
    shift: Vector
    tilt: tuple[float, float]
    force: Vector
    multiplicity: int


NAN3 = (np.nan, np.nan, np.nan)
"""A vector without a value."""


class Stream:
    """Decoder of a time series, one row at a time; of several poses it chooses the one nearest to the last.

    Parameters
    ----------
    coder : as returned by `analytic.decode.decoder`.
    """

    def __init__(self, coder: Decoder) -> None:
        self.coder = coder
        self.last: Vector = (0.0, 0.0, 0.0)

    def step(self, field: tuple[float, ...]) -> Sample:
        """Decode one row of readings, B.n of each element, T.

        Raises
        ------
        BadInput
            The number of readings differs from the number of elements.
        """
        poses = decode.find(self.coder, [field], np.array(self.last))
        (status,), (chosen,), (many,) = poses.status, poses.chosen.tolist(), poses.multiplicity.tolist()
        if chosen < 0:
            return Sample(status, NAN3, (np.nan, np.nan), NAN3, 0)
        shift = poses.shift[:, [chosen]]
        tilt, force, _, _ = decode.state(self.coder, shift)
        if status == "ok" and self.coder.mechanics is not None and np.isnan(force[2, 0]):
            status = "tension"
        self.last = x, y, z = shift[:, 0].tolist()
        (rx, ry), (f_x, f_y, f_n) = tilt[:, 0].tolist(), force[:, 0].tolist()
        return Sample(status, (x, y, z), (rx, ry), (f_x, f_y, f_n), many)
