"""How accurately readings determine a pose: condition number of dB/ds, and noise of the decoded pose."""

from __future__ import annotations

import numpy as np

from analytic.inverse.damped_newton import inverse_normal
from analytic.inverse.forward_model import cross
from geometry.arrays import Array


def condition(A: Array) -> Array:
    """Return the condition numbers, in the 2-norm, of slopes dB/ds (3, k, n), shape (n,); infinite on a fold."""
    if A.shape[1] == 3:
        # singular values a >= b >= c give ab, ac and bc for the cofactors and abc = |det|: (a)(ab)/(abc) = a/c.
        # This form is vectorised over the poses.
        cofactors = np.stack([cross(A[1], A[2]), cross(A[2], A[0]), cross(A[0], A[1])])
        det = np.abs((A[0] * cofactors[0]).sum(axis=0))
        return np.asarray(np.divide(_norm(A) * _norm(cofactors), det, out=np.full_like(det, np.inf), where=det > 0))
    values = np.linalg.svd(np.moveaxis(A, 2, 0), compute_uv=False)
    with np.errstate(divide="ignore"):
        return np.asarray(values[:, 0] / values[:, 2])


def _norm(A: Array) -> Array:
    """Return the largest singular values of A (3, 3, n), shape (n,).

    Their squares are the largest roots of the characteristic cubic of A A', by the trigonometric formula.
    """
    a, b, c = ((row * row).sum(axis=0) for row in A)
    d, e, f = ((A[i] * A[j]).sum(axis=0) for i, j in ((0, 1), (0, 2), (1, 2)))
    mean = (a + b + c) / 3
    a, b, c = a - mean, b - mean, c - mean
    size = np.sqrt((a * a + b * b + c * c + 2 * (d * d + e * e + f * f)) / 6)
    det = a * (b * c - f * f) - d * (d * c - e * f) + e * (d * f - b * e)
    cube = np.where(size > 0, size**3, 1.0)
    angle = np.arccos(np.clip(det / (2 * cube), -1.0, 1.0)) / 3
    return np.asarray(np.sqrt(mean + 2 * size * np.cos(angle)))


def spread(sigma: Array, A: Array) -> Array:
    """Return the error of the pose from one standard deviation of each reading's noise; NaN without noise.

    The pose's covariance is S S' with S the result at one pose.

    Parameters
    ----------
    sigma : standard deviation of each reading, shape (k,), T.
    A : slopes dB/ds, shape (3, k, n), T/mm.

    Returns
    -------
    shape (3, k, n), mm.
    """
    if not sigma.any():
        return np.full_like(A, np.nan)
    weights = (sigma.min() / sigma if sigma.all() else np.ones_like(sigma))[:, None]
    inverse = inverse_normal(weights * A)
    return np.asarray(np.einsum("ijn,jkn->ikn", inverse, weights**2 * A) * sigma[:, None])
