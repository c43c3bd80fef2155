"""How near the readings of poses that are far apart come to each other: the margin of a unique decoding."""

from __future__ import annotations

import numpy as np

from analytic import survey
from analytic.decode import Decoder
from analytic.inverse import forward_model
from analytic.survey import Survey
from geometry.arrays import Array


def least_difference(coder: Decoder, seen: Survey, apart: float, tries: int = 4) -> float:
    """Least distance of the readings, over their noise, of two known poses at least so far apart, mm.

    From the nearest pairs of the survey's grid on by sequential quadratic programming, so that it is an upper bound.
    """
    known = seen.weight > 0
    s, r = seen.shift[:, known].T, (seen.readings / coder.sigma[:, None])[:, known].T
    pairs: list[tuple[float, int, int]] = []
    for i in range(len(s) - 1):
        far = ((s[i + 1 :] - s[i]) ** 2).sum(axis=1) >= apart**2
        if far.any():
            square = np.where(far, ((r[i + 1 :] - r[i]) ** 2).sum(axis=1), np.inf)
            j = int(square.argmin())
            pairs.append((float(square[j]), i, i + 1 + j))
    ends = [(s[i], s[j]) for _, i, j in sorted(pairs)[:tries]]
    return min(_nearer(coder, a, b, apart) for a, b in ends)


def _nearer(coder: Decoder, a: Array, b: Array, apart: float) -> float:
    """The distance, from a pair of poses on; infinite where the search ends at unknown poses."""
    from scipy.optimize import minimize

    def distance(pair: Array) -> tuple[float, Array]:
        """Square of the distance of the readings, and its slope."""
        values, slopes = forward_model.readings_with_slopes(coder.forward, np.ascontiguousarray(pair.reshape(2, 3).T))
        lack = (values[:, 0] - values[:, 1]) / coder.sigma
        rows = 2 * np.einsum("jkn,k->nj", slopes / coder.sigma[:, None], lack)
        return float((lack**2).sum()), np.concatenate([rows[0], -rows[1]])

    def gap(pair: Array) -> float:
        return float(((pair[:3] - pair[3:]) ** 2).sum() / apart**2 - 1)

    def gap_slope(pair: Array) -> Array:
        way = 2 * (pair[:3] - pair[3:]) / apart**2
        return np.concatenate([way, -way])

    def allowed(pair: Array) -> bool:
        return gap(pair) >= -1e-6 and bool(survey.known(coder, np.ascontiguousarray(pair.reshape(2, 3).T)).all())

    # a pair of the grid is further apart than asked for, which is rarely nearer in readings
    way = (b - a) * (apart / np.linalg.norm(b - a)) / 2
    pairs = [np.concatenate([a, b]), np.concatenate([(a + b) / 2 - way, (a + b) / 2 + way])]
    start = min(pairs, key=lambda pair: distance(pair)[0])
    size = max(distance(start)[0], 1e-300)
    found = minimize(
        lambda pair: tuple(v / size for v in distance(pair)),
        start,
        jac=True,
        bounds=list(zip(np.tile(coder.low, 2), np.tile(coder.high, 2), strict=True)),
        constraints={"type": "ineq", "fun": gap, "jac": gap_slope},
        method="SLSQP",
        options={"maxiter": 50},
    )
    return min((float(np.sqrt(distance(p)[0])) for p in (*pairs, found.x) if allowed(p)), default=np.inf)
