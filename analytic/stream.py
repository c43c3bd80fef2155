"""Decoding of one row of readings at a time, for a real-time loop: thousands of rows per second."""

from __future__ import annotations

from typing import NamedTuple

from analytic.decode import Decoder, Status, decode

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
        found = decode(self.coder, [field], near=self.last)
        (status,), (many,) = found.status, found.multiplicity.tolist()
        (x, y, z), (rx, ry), (f_x, f_y, f_n) = (v[0].tolist() for v in (found.shift, found.tilt, found.force))
        if many:
            self.last = x, y, z
        return Sample(status, (x, y, z), (rx, ry), (f_x, f_y, f_n), many)
