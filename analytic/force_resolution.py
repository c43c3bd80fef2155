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

A body of revolution has the same response to a shear in every direction. Let u and w be the lateral and the vertical
shift, t the tilt, F_t and F_n the forces, under a depth d and a shear s along e(phi) = (cos phi, sin phi). A further
shear across e turns the response: d(u e)/ds_across = (u/s) e_across, likewise for t and F_t. From one response in the
plane, `turned` returns poses, forces and slopes for any direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analytic.hall import ELEMENTS, at_rail, batch_readings
from analytic.inverse import forward_model, response_surface
from analytic.inverse.forward_model import Forward
from analytic.inverse.response_surface import Mechanics
from geometry.arrays import Array
from geometry.design import BadInput, Design

SINGULAR = 1e-9
"""Singular value of the scaled slopes, over the largest, up to which the readings do not determine a direction: above
the rounding of slopes by differences, and a millionth of what a useful layout has."""
STEP = 1e-4
"""Half of the distance over which readings are differenced, over D. The field varies over lengths of about D, so that
the relative error of the slopes is about 1e-8 from the curvature, and 1e-9 from rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Loaded:
    """Poses and forces under n loads, with their slopes along q = (depth, shear_x, shear_y) at [n, i, j].

    Attributes
    ----------
    shift, tilt : shift of the magnet, shape (n, 3), mm, and rotation vector (rx, ry), shape (n, 2), rad.
    force : (F_x, F_y, F_n), shape (n, 3), N.
    shift_slopes, tilt_slopes : shape (n, 3, 3), 1, and (n, 2, 3), rad/mm.
    force_slopes : shape (n, 3, 3), N/mm.
    """

    shift: Array
    tilt: Array
    force: Array
    shift_slopes: Array
    tilt_slopes: Array
    force_slopes: Array


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
        A shape is wrong, or a noise is not positive.

    Examples
    --------
    Each reading changes with one coordinate: 2 V/mm and 0.5 N/mm turn a noise of 0.01 V into 0.0025 N.

    >>> force_resolution(np.diag([2.0, 2.0, 4.0])[None], np.diag([0.5, 0.5, 4.0])[None], [0.01, 0.01, 0.01]).tolist()
    [[0.0025, 0.0025, 0.01]]
    """
    J, K = np.asarray(jacobian_readings, dtype=np.float64), np.asarray(jacobian_force, dtype=np.float64)
    if J.ndim != 3 or J.shape[2] != 3 or J.shape[1] < 3:
        raise BadInput(f"the slopes of the readings must have shape (n, m, 3) with m of at least 3; got {J.shape}")
    if K.shape != (len(J), 3, 3):
        raise BadInput(f"the slopes of the force must have shape ({len(J)}, 3, 3); got {K.shape}")
    deviation = np.asarray(noise, dtype=np.float64)
    if deviation.shape not in (J.shape[1:2], J.shape[:2]):
        raise BadInput(f"the noise must have shape {J.shape[1:2]} or {J.shape[:2]}; got {deviation.shape}")
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
    """Return the force resolution at shifts of the magnet, shape (n, 3), N, with q the shift; NaN without noise.

    Parameters
    ----------
    forward : elements, each with a noise above 0, and the tilt; saturated elements do not change with the pose.
    mechanics : force as a function of the shift.
    shift : shape (n, 3), mm.
    """
    noise = np.array([element.noise_T for element in forward.elements])
    if not noise.all():
        return np.full(shift.shape, np.nan)
    values, slopes = forward_model.readings_with_slopes(forward, np.ascontiguousarray(shift.T))
    slopes[:, at_rail(forward.elements, values)] = 0.0
    force_slopes = response_surface.forces(mechanics, shift.T)[1]
    return force_resolution(slopes.transpose(2, 1, 0), force_slopes.transpose(2, 1, 0), noise)


def reading_slopes(designs: Sequence[Design], owner: NDArray[np.int64], loaded: Loaded) -> Array:
    """Return the slopes of the flux densities B.n along (depth, shear_x, shear_y), shape (n, 3, 3), T/mm.

    They are central differences of `analytic.hall.batch_readings` along the poses' slopes. A saturated reading does
    not change with the pose: its slopes are 0.

    Parameters
    ----------
    designs, owner : row i belongs to the design `designs[owner[i]]`; owner has shape (n,).
    loaded : the poses; NaN for no pose, which gives NaN.
    """
    n = len(owner)
    half = STEP * np.array([design.D for design in designs])[owner]
    # one call for all six neighbours of each pose: a call of the field costs far more than its points
    signs, columns = np.repeat([1.0, -1.0], 3), np.tile(np.arange(3), 2)
    step = (signs[:, None] * half)[:, :, None]
    shift = loaded.shift + step * loaded.shift_slopes[:, :, columns].transpose(2, 0, 1)
    tilt = loaded.tilt + step * loaded.tilt_slopes[:, :, columns].transpose(2, 0, 1)
    answer = batch_readings(designs, np.tile(owner, 6), shift.reshape(-1, 3), tilt.reshape(-1, 2))
    forward, back = answer.field_T.reshape(2, 3, n, ELEMENTS)
    slopes = ((forward - back) / (2 * half)[:, None]).transpose(1, 2, 0)
    saturated = np.asarray(answer.saturated.reshape(6, n, ELEMENTS).any(axis=0))
    return np.asarray(np.where(saturated[:, :, None], 0.0, slopes))


def turned(plane: Array, depth_slopes: Array, shear_slopes: Array, shear: Array, azimuth: Array) -> Loaded:
    """Return poses, forces and slopes under shears in any direction from responses in the plane of the shear.

    Parameters
    ----------
    plane : lateral shift u, vertical shift w (negative when the magnet sinks), tilt t towards the shear, tangential
        force F_t and normal force F_n, shape (n, 5), in mm, mm, rad, N and N.
    depth_slopes, shear_slopes : slopes of these along the depth and along the shear, shape (n, 5), 1/mm.
    shear : amount of the shear, shape (n,), mm; 0 for a press, where the slopes across the shear are those along it.
    azimuth : direction of the shear from x towards y, shape (n,), rad.
    """
    e = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)], axis=1)
    across = np.stack([-e[:, 1], e[:, 0], e[:, 2]], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    sheared = shear[:, None] > 0
    ratio = np.where(sheared, plane / np.where(sheared, shear[:, None], 1.0), shear_slopes)

    def vectors(lateral: int, vertical: int | None) -> tuple[Array, Array]:
        """Return the vectors of two columns, shape (n, 3), and their slopes, shape (n, 3, 3)."""

        def vector(values: Array) -> Array:
            plumb = 0.0 if vertical is None else values[:, [vertical]] * up
            return np.asarray(values[:, [lateral]] * e + plumb)

        along_shear, across_shear = vector(shear_slopes), ratio[:, [lateral]] * across
        # from (along, across) to (x, y): d/dx = cos d/dalong - sin d/dacross
        columns = [along_shear * e[:, [k]] + across_shear * across[:, [k]] for k in (0, 1)]
        return vector(plane), np.stack([vector(depth_slopes), *columns], axis=2)

    shift, shift_slopes = vectors(0, 1)
    lean, lean_slopes = vectors(2, None)
    force, force_slopes = vectors(3, 4)
    # the rotation vector (rx, ry) of a lean (x, y) is (-y, x), see `geometry.loads.rotation_of`
    tilt = np.stack([-lean[:, 1], lean[:, 0]], axis=1)
    tilt_slopes = np.stack([-lean_slopes[:, 1], lean_slopes[:, 0]], axis=1)
    return Loaded(shift, tilt, force, shift_slopes, tilt_slopes, force_slopes)
