"""Readings of many poses at once, with their slopes: the forward model that the decoder inverts.

A pose is a shift s of the magnet's centre and a tilt. The tilt is a function of the shift: the sensor is a body of
revolution, so a magnet shifted along e = (s_x, s_y)/rho leans towards e, by the angle t = tau rho with
tau(rho^2, s_z) in rad/mm. Hence

    m = (sin(t) e, cos(t)),    B = -B_magnet(x; m),    x = p - (0, 0, H) - s,

with m the magnet's axis (its polarisation is -J m, with J < 0 if the north pole points up) and p a point of an
element. With G = grad B, which is symmetric, and g = G n, the slope of a reading B.n along s_j is
-g_j + (dm/ds_j).[(B x n - x x g) x m].

Arrays have the poses in their last axis. Lengths in mm, B in T, angles in rad.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analytic.hall import Mode, plates
from analytic.inverse.polynomials import polynomial
from analytic.magnet import cylinder_field, cylinder_field_jacobian
from analytic.parts import Element, of_design
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import rotation_of

NO_TILT: Array = np.zeros((1, 1))
"""Coefficients of tau = 0: the magnet does not tilt."""
SMALL = 1e-6
"""t^2, rad^2, below which the slope of sin(t)/t is taken from its series: the closed form is 0/0 at t = 0."""


@dataclass(frozen=True, slots=True, eq=False)
class Forward:
    """A design's elements, and the tilt of its magnet as a function of its shift.

    Attributes
    ----------
    elements : k elements.
    tau : coefficients c[i, j] of tau = sum c[i, j] rho^(2i) s_z^j, rad/mm.
    mode : "component" (readings B.n) or "magnitude" (readings |B|), as in `analytic.hall.readings`.
    points, normals : points at which the elements sample the field, mm, and directions n, shape (m, 3).
    owners : index of the element of each point, ascending, shape (m,).
    """

    design: Design
    elements: tuple[Element, ...]
    tau: Array
    mode: Mode
    points: Array
    normals: Array
    owners: NDArray[np.int64]


def model(
    design: Design,
    tau: Array = NO_TILT,
    *,
    elements: Sequence[Element] | None = None,
    mode: Mode = "component",
) -> Forward:
    """Return the forward model of a design.

    Parameters
    ----------
    tau : coefficients as in `Forward`; `NO_TILT` ignores the tilt, as the paper does.
    elements, mode : as in `analytic.hall.readings`.

    Raises
    ------
    BadInput
        The design has no magnet, there are fewer than three elements, or one of them lies inside the beam.
    """
    if not design.shape.has_magnet:
        raise BadInput(
            "this design has no magnet (magnet_diameter is 0), so there is no pose to decode: give it a magnet"
        )
    chosen = of_design(design) if elements is None else tuple(elements)
    if len(chosen) < 3:
        raise BadInput(f"a pose needs at least three readings; got {len(chosen)} elements: add elements")
    for element in chosen:
        x, y, z = element.position
        if 0 < z < design.L and x * x + y * y < design.R**2 - max(z - design.H, 0.0) ** 2:
            way = "larger l0 or f, smaller c" if design.hall_layout == "three" else "larger l0 or chip_x"
            raise BadInput(f"{element.name} lies inside the beam, at ({x:g}, {y:g}, {z:g}) mm: move it out ({way})")
    points, owners = plates(chosen)
    normals = np.array([element.direction for element in chosen], dtype=np.float64)[owners]
    return Forward(design, chosen, np.asarray(tau, dtype=np.float64), mode, points, normals, owners)


def readings_with_slopes(forward: Forward, shift: Array) -> tuple[Array, Array]:
    """Return the readings at shifts of the magnet, and their slopes.

    Parameters
    ----------
    shift : shape (3, n), mm.

    Returns
    -------
    values : B.n, or |B|, of each element, shape (k, n), T.
    slopes : slope of element k's reading along s_j at [j, k, n], shape (3, k, n), T/mm.
    """
    n = shift.shape[1]
    m, axis_slopes, x, radial, local = _positions(forward, shift)
    shape = radial.shape[1:]
    # the field at a point of the meridian (rho, 0, zeta) gives it everywhere: the magnet is a body of revolution
    b, slope = cylinder_field_jacobian(local, *_magnet(forward.design))
    b_r, b_z = (b[:, k].reshape(shape) for k in (0, 2))
    rr, ring, rz, zz = (slope[:, i, j].reshape(shape) for i, j in ((0, 0), (1, 1), (0, 2), (2, 2)))
    B = b_r * radial + b_z * m
    normal = _normal(forward, B)
    along, out = _dot(normal, m), _dot(normal, radial)
    g = ring * normal + ((rr - ring) * out + rz * along) * radial + ((zz - ring) * along + rz * out) * m
    slopes = -g
    if axis_slopes is not None:
        turn = cross(cross(B, normal) - cross(x, g), m)
        for j in range(3):
            slopes[j] += _dot(axis_slopes[j][:, None, :], turn)
    values, slopes = _mean(forward, b_r * out + b_z * along, 0), _mean(forward, slopes, 1)
    return values.reshape(len(forward.elements), n), slopes


def readings_at(forward: Forward, shift: Array) -> Array:
    """Return the readings of `readings_with_slopes` alone, shape (k, n), T."""
    m, _, _, radial, local = _positions(forward, shift)
    b = cylinder_field(local, *_magnet(forward.design))
    B = b[:, 0].reshape(radial.shape[1:]) * radial + b[:, 2].reshape(radial.shape[1:]) * m
    return _mean(forward, _dot(_normal(forward, B), B), 0)


def _positions(forward: Forward, shift: Array) -> tuple[Array, Array | None, Array, Array, Array]:
    """Return the positions of the elements' points relative to the magnet.

    Returns
    -------
    m : magnet's axis, shape (3, 1, n).
    axis_slopes : dm_i/ds_j at [j, i, n], 1/mm; None if the magnet does not tilt.
    x, radial : points relative to the magnet's centre, mm, and their unit vectors across the axis, shape (3, m, n).
    local : cylindrical coordinates (rho, 0, zeta) of the points in the magnet's frame, shape (m n, 3), mm.
    """
    tilted = bool(forward.tau.any())
    axis, axis_slopes = tilt_axis(forward.tau, shift) if tilted else (np.array([[0.0], [0.0], [1.0]]), None)
    m = axis[:, None, :]
    x = forward.points.T[:, :, None] - shift[:, None, :]
    x[2] -= forward.design.H
    zeta = _dot(m, x)
    radial = x - zeta * m
    rho = np.sqrt(_dot(radial, radial))
    radial /= np.where(rho > 0, rho, 1.0)
    local = np.zeros((rho.size, 3))
    local[:, 0], local[:, 2] = rho.ravel(), zeta.ravel()
    return m, axis_slopes, x, radial, local


def _magnet(design: Design) -> tuple[float, float, float]:
    """Return the magnet's radius and height, mm, and its polarisation along m, T."""
    return design.magnet_diameter / 2, design.magnet_height, -design.polarisation


def _normal(forward: Forward, B: Array) -> Array:
    """Return the directions n of the readings; in mode magnitude n = B/|B|, since then B.n = |B|."""
    if forward.mode == "component":
        return forward.normals.T[:, :, None]
    size = np.sqrt(_dot(B, B))
    return np.asarray(B / np.where(size > 0, size, 1.0))


def _mean(forward: Forward, values: Array, axis: int) -> Array:
    """Return the mean over the points of each element, along `axis`."""
    if len(forward.owners) == len(forward.elements):
        return values
    starts = np.searchsorted(forward.owners, np.arange(len(forward.elements)))
    return np.asarray(np.add.reduceat(values, starts, axis=axis) / np.bincount(forward.owners)[:, None])


def tilt_axis(tau: Array, shift: Array) -> tuple[Array, Array]:
    """Return the magnet's axis m, shape (3, n), and its slopes dm_i/ds_j at [j, i, n], 1/mm, at shifts (3, n), mm."""
    # m = (k x, k y, cos t) with k = sin(t)/rho = tau sinc(t): no division by rho, so the axis rho = 0 needs no case
    x, y, z = shift
    u = x * x + y * y
    t, t_u, t_z = polynomial(tau, u, z)
    square = t * t * u
    angle = np.sqrt(square)
    sinc, cos = np.sinc(angle / np.pi), np.cos(angle)
    sinc_slope = np.where(
        square > SMALL, (cos - sinc) / (2 * np.where(square > SMALL, square, 1.0)), square / 60 - 1 / 6
    )
    tau_slopes = (2 * x * t_u, 2 * y * t_u, t_z)
    u_slopes = (2 * x, 2 * y, 0.0)
    k = sinc * t
    slopes = np.empty((3, 3, shift.shape[1]))
    for j in range(3):
        d_square = 2 * t * u * tau_slopes[j] + t * t * u_slopes[j]
        d_k = sinc * tau_slopes[j] + t * sinc_slope * d_square
        slopes[j, 0], slopes[j, 1], slopes[j, 2] = x * d_k, y * d_k, -sinc / 2 * d_square
    slopes[0, 0] += k
    slopes[1, 1] += k
    return np.stack([k * x, k * y, cos]), slopes


def rotation(tau: Array, shift: Array) -> Array:
    """Return the tilt at shifts (3, n), mm, as rotation vectors (rx, ry) of `analytic.hall.field_at`, (2, n), rad."""
    x, y, z = shift
    t = polynomial(tau, x * x + y * y, z)[0]
    return np.stack(rotation_of(t * x, t * y))


def _dot(a: Array, b: Array) -> Array:
    """Return the scalar products of vectors whose components are in the first axis."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def cross(a: Array, b: Array) -> Array:
    """Return the vector products of vectors whose components are in the first axis."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
