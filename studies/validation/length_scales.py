"""Length scales and nugget of a Gaussian process, by maximum likelihood.

With the outputs' variances and trends at their best values, the logarithm of the restricted likelihood is, up to a
constant (Rasmussen and Williams 2006, section 2.7),

    -2 l = sum_q (N - m) log s_q^2 + q (log det K + log det H^T K^-1 H),   s_q^2 = y_q P y_q / (N - m),

with P the precision of `GaussianProcess.inverse` and m the number of coefficients of the trend.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg, optimize

from geometry.arrays import Array
from studies.surrogate.gaussian_process import ROOT5, GaussianProcess, with_constant

LENGTHS, NUGGETS = (0.05, 50.0), (1e-8, 1e-2)
"""Bounds of the length scales, over the spread of the input, and of the nugget."""


def fitted(x: Array, y: Array, start: Array | None = None) -> GaussianProcess:
    """Return the process whose length scales and nugget are the most likely ones for points (N, p), outputs (N, q).

    Parameters
    ----------
    start : length scales and nugget to begin from, shape (p + 1,).
    """
    scale = x.std(axis=0)
    begin = np.append(2 * scale, 1e-5) if start is None else start
    bounds = [(np.log(LENGTHS[0] * s), np.log(LENGTHS[1] * s)) for s in scale]
    bounds.append((np.log(NUGGETS[0]), np.log(NUGGETS[1])))
    # outputs of different size count alike
    unit = (y - y.mean(axis=0)) / y.std(axis=0)
    best = optimize.minimize(
        _misfit, np.log(begin), args=(x, unit), jac=True, bounds=bounds, method="L-BFGS-B", options={"maxiter": 60}
    )
    return GaussianProcess(x, y, np.exp(best.x[:-1]), float(np.exp(best.x[-1])))


def _misfit(logs: Array, x: Array, y: Array) -> tuple[float, Array]:
    """Return -l / (N q) and its derivatives by the logarithms of length scales and nugget."""
    lengths, nugget = np.exp(logs[:-1]), np.exp(logs[-1])
    (count, outputs), terms = y.shape, x.shape[1] + 1
    process = GaussianProcess(x, y, lengths, float(nugget))
    P = process.inverse
    Py = P @ y
    power = np.einsum("nq,nq->q", y, Py)
    whitened = linalg.solve_triangular(process.factor, with_constant(x), lower=True)
    determinant = 2 * np.log(np.diag(process.factor)).sum() + np.linalg.slogdet(whitened.T @ whitened)[1]
    value = (count - terms) * np.log(power).sum() + outputs * determinant
    # d(-2 l) = outputs tr(P dK) - (N - m) sum_q Py_q dK Py_q / power_q
    S = outputs * P - (count - terms) * (Py / power) @ Py.T
    scaled = x / lengths
    distance = np.sqrt(np.maximum(((scaled[:, None] - scaled[None]) ** 2).sum(axis=2), 0.0))
    a = ROOT5 * distance
    # c'(r) / r = -5/3 (1 + a) exp(-a), so dK by log l_i is 5/3 (1 + a) exp(-a) times the squared difference in x_i
    common = S * (5 / 3) * (1 + a) * np.exp(-a)
    slopes = [float((common * (scaled[:, i, None] - scaled[None, :, i]) ** 2).sum()) for i in range(len(lengths))]
    slopes.append(float(nugget * np.trace(S)))
    return float(value) / (2 * count * outputs), np.array(slopes) / (2 * count * outputs)
