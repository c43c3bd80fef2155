"""Force resolution: standard deviation of the decoded force, axis by axis, that the noise of the readings causes.

Let q be three coordinates of the pose, such as (depth, shear_x, shear_y) or the magnet's shift, r(q) the m >= 3
readings and f(q) the force. Let J = dr/dq (m, 3) and K = df/dq (3, 3), and let the errors of the readings be
independent with standard deviations s_i. Weighted least squares with W = diag(1/s_i^2) decode q, and to first order

    cov(q) = (J' W J)^-1,   cov(f) = K cov(q) K',   sigma_j = sqrt(cov(f)_jj).

The singular values of W^(1/2) J S = U diag(v) V' give sigma_j^2 = sum_k (K S V)_jk^2 / v_k^2, where the diagonal S
scales the columns to length 1. Hence sigma does not depend on the choice of q, nor on its units. For m = 3 it is the
error of the exact solution, whatever the weights. Where v_k = 0 the readings do not change along a direction of q:
every force component that changes along it has sigma = inf, and the other components keep a finite one.

Limits: errors small against the curvature of r and f; one pose for the readings (see `analytic.survey` for ambiguous
ones); no error of the model itself. At first touch, J and K both vanish along the depth: take a small depth instead.
"""

import numpy as np
from numpy.typing import ArrayLike

from analytic.hall import at_rail
from analytic.inverse import forward_model, response_surface
from analytic.inverse.forward_model import Forward
from analytic.inverse.response_surface import Mechanics
from geometry.arrays import Array
from geometry.design import BadInput

SINGULAR = 1e-9
"""Singular value of the scaled slopes, over the largest, up to which the readings do not determine a direction: above
the rounding of slopes by differences, and a millionth of what a useful layout has."""


def force_resolution(jacobian_readings: ArrayLike, jacobian_force: ArrayLike, noise: ArrayLike) -> Array:
    """Return the standard deviations of the decoded force components at n poses; the equations are above.

    Parameters
    ----------
    jacobian_readings : dr_i/dq_j at [n, i, j], shape (n, m, 3), in units of the readings over those of q.
    jacobian_force : df_i/dq_j at [n, i, j], shape (n, 3, 3), N over units of q.
    noise : standard deviation of each reading, shape (m,), or (n, m) if it differs from pose to pose; above 0.

    Returns
    -------
    shape (n, 3), N. inf where the readings do not determine a component, NaN where a slope or a noise is NaN.

    Raises
    ------
    BadInput
        There are fewer than three readings, or a noise is not positive.

    Each reading changes with one coordinate: 2 V/mm and 0.5 N/mm turn a noise of 0.01 V into 0.0025 N.

    >>> force_resolution(np.diag([2.0, 2.0, 4.0])[None], np.diag([0.5, 0.5, 4.0])[None], [0.01, 0.01, 0.01]).tolist()
    [[0.0025, 0.0025, 0.01]]
    """
    J, K = np.asarray(jacobian_readings, dtype=np.float64), np.asarray(jacobian_force, dtype=np.float64)
    if J.ndim != 3 or J.shape[2] != 3 or J.shape[1] < 3:
        raise BadInput(f"the slopes of the readings must have shape (n, m, 3) with m of at least 3; got {J.shape}")
    deviation = np.asarray(noise, dtype=np.float64)
    if (deviation <= 0).any():
        raise BadInput(f"the noise of every reading must be above 0; got {np.nanmin(deviation):g}")
    weighted = J / np.broadcast_to(deviation, J.shape[:2])[:, :, None]
    sigma = np.full((len(J), 3), np.nan)
    known = np.isfinite(weighted).all(axis=(1, 2)) & np.isfinite(K).all(axis=(1, 2))
    sigma[known] = _deviations(weighted[known], K[known])
    return sigma


def _deviations(weighted: Array, K: Array) -> Array:
    """Return sigma, shape (n, 3), N; `weighted` are the slopes of the readings over their noise, (n, m, 3), finite.

    A column of zeros keeps its scale of 1, and its singular value is 0.
    """
    length = np.linalg.norm(weighted, axis=1)
    scale = np.where(length > 0, length, 1.0)[:, None, :]
    _, values, turn = np.linalg.svd(weighted / scale, full_matrices=False)
    lost = (values <= SINGULAR * values[:, :1])[:, None, :]
    # the force's slopes along the singular directions; rounding in them must not make a determined component infinite
    along = np.einsum("nij,nkj->nik", K / scale, turn)
    size = np.linalg.norm(along, axis=2, keepdims=True)
    along = np.where(np.abs(along) > SINGULAR * size, along, 0.0)
    undetermined = ((along != 0) & lost).any(axis=2)
    spread = np.where(lost, 0.0, along) / np.where(lost, 1.0, values[:, None, :])
    return np.asarray(np.where(undetermined, np.inf, np.linalg.norm(spread, axis=2)))


def at_shifts(forward: Forward, mechanics: Mechanics, shift: Array) -> Array:
    """Return the force resolution, shape (n, 3), N, at shifts of the magnet (n, 3), mm, as q; NaN without noise.

    forward : elements, each with a noise above 0, and the tilt; saturated elements do not change with the pose.
    """
    noise = np.array([element.noise_T for element in forward.elements])
    if not noise.all():
        return np.full(shift.shape, np.nan)
    values, slopes = forward_model.readings_with_slopes(forward, np.ascontiguousarray(shift.T))
    slopes[:, at_rail(forward.elements, values)] = 0.0
    force_slopes = response_surface.forces(mechanics, shift.T)[1]
    return force_resolution(slopes.transpose(2, 1, 0), force_slopes.transpose(2, 1, 0), noise)
