"""Margin of a unique decoding: the smallest difference between the readings of two poses that lie far apart."""

from __future__ import annotations

import numpy as np

from analytic import survey
from analytic.decode import Decoder
from analytic.inverse import forward_model
from analytic.survey import Survey
from geometry.arrays import Array


def least_difference(coder: Decoder, surveyed: Survey, apart: float, tries: int = 4) -> float:
    """Return the smallest difference of readings between two poses that lie at least `apart` from each other.

    The difference is the 2-norm of the readings' differences, each over its noise. Sequential quadratic programming
    starts from the best pairs of the survey's grid. It finds local minima, so the result is an upper bound.

    Parameters
    ----------
    surveyed : a survey of the decoder's workspace; only its known poses count.
    apart : smallest distance of the two poses, mm.
    tries : number of pairs of the grid to start from.
    """
    known = surveyed.weight > 0
    s, r = surveyed.shift[:, known].T, (surveyed.readings / coder.sigma[:, None])[:, known].T
    pairs: list[tuple[float, int, int]] = []
    for i in range(len(s) - 1):
        far = ((s[i + 1 :] - s[i]) ** 2).sum(axis=1) >= apart**2
        if far.any():
            square = np.where(far, ((r[i + 1 :] - r[i]) ** 2).sum(axis=1), np.inf)
            j = int(square.argmin())
            pairs.append((float(square[j]), i, i + 1 + j))
    best = [(s[i], s[j]) for _, i, j in sorted(pairs)[:tries]]
    return min(_minimised(coder, first, second, apart) for first, second in best)


def _minimised(coder: Decoder, first: Array, second: Array, apart: float) -> float:
    """Minimise the difference from a pair of poses (3,), mm; return infinity if only unknown poses result."""
    from scipy.optimize import minimize

    def squared_difference(pair: Array) -> tuple[float, Array]:
        """Return the square of the difference of readings, and its gradient (6,), 1/mm."""
        values, slopes = forward_model.readings_with_slopes(coder.forward, np.ascontiguousarray(pair.reshape(2, 3).T))
        difference = (values[:, 0] - values[:, 1]) / coder.sigma
        rows = 2 * np.einsum("jkn,k->nj", slopes / coder.sigma[:, None], difference)
        return float((difference**2).sum()), np.concatenate([rows[0], -rows[1]])

    def constraint(pair: Array) -> float:
        """Return a value that is 0 or more for poses at least `apart` from each other."""
        return float(((pair[:3] - pair[3:]) ** 2).sum() / apart**2 - 1)

    def constraint_gradient(pair: Array) -> Array:
        direction = 2 * (pair[:3] - pair[3:]) / apart**2
        return np.concatenate([direction, -direction])

    def allowed(pair: Array) -> bool:
        return constraint(pair) >= -1e-6 and bool(
            survey.known(coder, np.ascontiguousarray(pair.reshape(2, 3).T)).all()
        )

    # a pair of the grid is farther apart than required; moved together to `apart`, its readings mostly differ less
    half = (second - first) * (apart / np.linalg.norm(second - first)) / 2
    centre = (first + second) / 2
    pairs = [np.concatenate([first, second]), np.concatenate([centre - half, centre + half])]
    start = min(pairs, key=lambda pair: squared_difference(pair)[0])
    # the solver's tolerance is absolute, so the objective is scaled to 1 at the start
    size = max(squared_difference(start)[0], 1e-300)
    optimum = minimize(
        lambda pair: tuple(v / size for v in squared_difference(pair)),
        start,
        jac=True,
        bounds=list(zip(np.tile(coder.low, 2), np.tile(coder.high, 2), strict=True)),
        constraints={"type": "ineq", "fun": constraint, "jac": constraint_gradient},
        method="SLSQP",
        options={"maxiter": 50},
    )
    # the solver may stop at a worse or forbidden pair, so both starting pairs compete with its result
    return min((float(np.sqrt(squared_difference(p)[0])) for p in (*pairs, optimum.x) if allowed(p)), default=np.inf)
