"""Decoding of one row of readings at a time, for a real-time loop: the results of `analytic.decode`, sooner.

Both find the poses by `analytic.inverse.pose_search`. A NumPy operation takes microseconds even for arrays of three
numbers, so the rest of a row's result is computed from Python's floats here. Of several poses the stream chooses the
one nearest to the last pose.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from analytic.decode import Decoder, Status, check_count
from analytic.hall import rail_slack
from analytic.inverse.pose_search import polynomial
from analytic.inverse.response_surface import ZERO_DEPTH, ZERO_FORCE
from geometry.loads import rotation_of

__all__ = ["Sample", "Stream"]

Vector = tuple[float, float, float]


class Sample(NamedTuple):
    """Result of one row of readings; NaN where there is no pose. Units as in `analytic.decode.Decoded`."""

    status: Status
    shift: Vector
    tilt: tuple[float, float]
    force: Vector
    multiplicity: int


NAN3 = (math.nan, math.nan, math.nan)
"""A vector without a value."""


class Stream:
    """Decoder of a time series, one row at a time; of several poses it chooses the one nearest to the last.

    Parameters
    ----------
    coder : as returned by `analytic.decode.decoder`.
    """

    def __init__(self, coder: Decoder) -> None:
        self.coder, law = coder, coder.mechanics
        self.last: Vector = (0.0, 0.0, 0.0)
        self.tau = np.ascontiguousarray(coder.forward.tau)
        surfaces = () if law is None else (law.lateral, law.normal, law.depth)
        self.surfaces = [np.ascontiguousarray(surface) for surface in surfaces]

    def step(self, field: tuple[float, ...]) -> Sample:
        """Decode one row of readings, B.n of each element, T.

        Raises
        ------
        BadInput
            The number of readings differs from the number of elements.
        """
        check_count(self.coder, len(field))
        if not all(map(math.isfinite, field)):
            return _without_pose("not_finite")
        for element, b in zip(self.coder.forward.elements, field, strict=True):
            output, slack = element.null + element.gain * b, rail_slack(element)
            if not element.low + slack < output < element.high - slack:
                return _without_pose("saturated")
        shifts, _, misfit = self.coder.search(np.array(field, dtype=np.float64))
        poses = [(x, y, z) for x, y, z in shifts.tolist()]
        if not poses:
            return _without_pose("inconsistent" if misfit else "out_of_workspace")
        self.last = x, y, z = min(poses, key=lambda pose: math.dist(pose, self.last))
        turn = polynomial(self.tau, x * x + y * y, z)[0]
        force = self._force(self.last) if self.surfaces else NAN3
        # with mechanics, the force is NaN only where the plate would have to pull
        pulls = bool(self.surfaces) and math.isnan(force[2])
        status: Status = "ambiguous" if len(poses) > 1 else "tension" if pulls else "ok"
        return Sample(status, self.last, rotation_of(turn * x, turn * y), force, len(poses))

    def _force(self, shift: Vector) -> Vector:
        """Return the force on the tip, N, as `analytic.inverse.response_surface.force_and_load` does."""
        law = self.coder.mechanics
        assert law is not None
        x, y, w = shift
        u = x * x + y * y
        lateral, normal, depth = self.surfaces
        k, n = polynomial(lateral, u, w)[0], polynomial(normal, u, w)[0]
        least = law.errors[2] + ZERO_FORCE
        if w < 0 and n < -least:
            return NAN3
        if (w >= 0 or n <= least) and polynomial(depth, u, math.cbrt(max(-w, 0.0)))[0] <= ZERO_DEPTH:
            return 0.0, 0.0, 0.0
        return x * k, y * k, max(n, 0.0)


def _without_pose(status: Status) -> Sample:
    return Sample(status, NAN3, (math.nan, math.nan), NAN3, 0)
