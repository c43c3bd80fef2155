"""The field of a cylinder magnet, homogeneously magnetised along its axis: exact, as the paper has it, as a dipole.

Lengths in mm (any one unit would do: the field knows only their ratios), J and B in T. J = mu0 M is the magnet's
polarisation; the sharp-edged cylinder is taken, an edge radius is ignored. Points and fields are in the magnet's
frame: origin at its centre, z along the magnetisation.

The exact field is computed in NumPy (`analytic.field.cylinder_numpy`) for fewer than `MIN_COMPILED_POINTS` points in
a call. Larger calls, and `meridian_field` for loops over single points, use the same formulas compiled by numba
(`analytic.field.cylinder_compiled`) if numba is installed (the extra `fast`). Without numba, larger calls use NumPy
and `meridian_field` uses plain Python (`analytic.field.cylinder_pointwise`). All of them agree to 1e-13 of |B|. The
number of points in a call alone selects the implementation, so that a repeated call returns identical digits.

Sources: Derby & Olbert, Am. J. Phys. 78 (2010) 229; Bulirsch, Numer. Math. 13 (1969) 305; Chathuranga et al.,
IEEE Sensors Journal 2016, equations (1) to (3).
"""

from __future__ import annotations

import contextlib
import functools
import math
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from types import ModuleType

import numpy as np
from numpy.typing import ArrayLike

from analytic.field import cylinder_pointwise
from analytic.field.cylinder_numpy import cylinder_moments, distance_to_hull, face_moments, unit_field
from geometry.arrays import Array
from geometry.design import BadInput

Pair = tuple[Array, Array]

MIN_COMPILED_POINTS = 2000
"""Points of a call from which on it is compiled, in a third of NumPy's time: more than one decoding asks for, less
than a batch or a map. Loading the kernel takes about a second, once in a process."""

_plain: ContextVar[bool] = ContextVar("plain", default=False)


def cylinder_field(points: ArrayLike, radius: float, height: float, J: float) -> Array:
    """B of the magnet, inside and outside it.

    The error is below 1e-12 of |B| for discs down to height/radius = 1e-6, needles up to 1e3 and distances up to
    1e6 radii; 1e-12 radii from a face, the hull or the rim too.

    Parameters
    ----------
    points : shape (n, 3), mm.
    radius, height : of the cylinder, mm.
    J : polarisation mu0 M, T.

    Returns
    -------
    shape (n, 3), T. This is B (not mu0 H) inside as well. On the hull (r = radius) B_z jumps by J; there it is the
    mean of both sides. Across a face B is continuous.

    Raises
    ------
    BadInput
        A point lies exactly on one of the two rims (r = radius, |z| = height/2), where |B| grows as J/2pi times the
        logarithm of the distance; a point is not finite; radius or height is not positive.
    """
    return _exact(points, radius, height, J, slope=False)[0]


def cylinder_field_jacobian(points: ArrayLike, radius: float, height: float, J: float) -> Pair:
    """B as by `cylinder_field`, and its Jacobian in closed form.

    Returns
    -------
    B : shape (n, 3), T.
    jacobian : dB_i/dx_j at [n, i, j], shape (n, 3, 3), T/mm; symmetric and without trace. On the hull, where B_z
        jumps, the jump is left out.

    Raises
    ------
    BadInput
        As `cylinder_field`.
    """
    return _exact(points, radius, height, J, slope=True)


def compiled() -> ModuleType | None:
    """The compiled kernel; None where numba is not installed or cannot be used.

    The first time after an installation it is compiled, which takes several seconds; it is kept in a file. Later a
    process loads it in about a second; who cares when that is calls this first. No answer depends on it.
    """
    return None if _plain.get() else _loaded()


@functools.cache
def _loaded() -> ModuleType | None:
    try:
        from analytic.field import cylinder_compiled
    except (ImportError, RuntimeError):
        # not installed, not for this NumPy, or without a folder to keep compiled code in
        return None
    return cylinder_compiled


@contextlib.contextmanager
def uncompiled() -> Iterator[None]:
    """Within this context all runs in NumPy and plain Python, as without numba."""
    token = _plain.set(True)
    try:
        yield
    finally:
        _plain.reset(token)


def meridian_field(radius: float, height: float, J: float) -> Callable[[float, float], tuple[float, ...]]:
    """The field of one magnet as a function of one point (rho, z), mm, for loops that wait for each.

    It gives B_r and B_z, T, and dB_r/dr, B_r/r, dB_r/dz, dB_z/dz, T/mm, in a tenth of the time of a call of
    `cylinder_field_jacobian`; compiled where numba is installed, else in plain Python.

    Raises
    ------
    BadInput
        As `cylinder_field`, here or when the function is called.
    """
    check_magnet(radius, height, J)
    half = height / 2
    moments, faces = cylinder_moments(half / radius), face_moments()
    kernel = compiled()
    meridian = cylinder_pointwise.meridian if kernel is None else kernel.meridian
    given = (moments.tolist(), faces.tolist()) if kernel is None else (moments, faces)

    def field(rho: float, z: float) -> tuple[float, ...]:
        good, *found = meridian(rho, z, radius, half, J, *given)
        if not good:
            raise _refuse(np.array([rho, 0.0, z]))
        return tuple(found)

    return field


def dipole_field(points: ArrayLike, radius: float, height: float, J: float) -> Array:
    """B of a dipole of the magnet's moment at its centre, [3 (m.x) x/d^2 - m]/d^3 with m = J radius^2 height/4.

    It leaves out terms of the order of (size/d)^2; the first of them vanishes where height = sqrt(3) radius.

    Raises
    ------
    BadInput
        A point lies at the centre; or as `cylinder_field`.
    """
    check_magnet(radius, height, J)
    x = _points(points)
    d = np.linalg.norm(x, axis=1)[:, None]
    if not (np.isfinite(d) & (d > 0)).all():
        raise BadInput("points must be finite and off the dipole at the magnet's centre: move the point away")
    unit, moment = x / d, np.array([0.0, 0.0, J * radius**2 * height / 4])
    return np.asarray((3 * (unit @ moment)[:, None] * unit - moment) / d**3)


def paper_field(
    rho: ArrayLike,
    Z: ArrayLike,
    radius: float,
    height: float,
    J: float,
    n_alpha: int = 32,
    n_R: int = 16,
    *,
    printed: bool = False,
) -> Pair:
    """The paper's equation (3), by quadrature over the two charged end faces; outside the magnet.

    With dp^2 = R^2 + rho^2 - 2 R rho cos(alpha) + (h/2 - Z)^2, and dm^2 the same with (h/2 + Z):

        B_Z   = -(J/4 pi) int_0^2pi int_0^a [ R (h/2 - Z)/dp^3 + R (h/2 + Z)/dm^3 ] dR dalpha
        B_rho = -(J/4 pi) int_0^2pi int_0^a [ -R (rho - R cos(alpha))/dp^3 + R (rho - R cos(alpha))/dm^3 ] dR dalpha

    This form agrees with `cylinder_field`. The printed one has + 2 R rho cos(alpha) in the first denominator of
    B_rho, which off the axis is wrong by 10 to 50 % of |B| at the paper's elements. Inside the magnet it would give
    mu0 H, so points there are refused.

    Parameters
    ----------
    rho, Z : shape (n,) or scalars, mm: distance from the axis and height above the centre, along the magnetisation.
    radius, height : a and h, mm.
    J : polarisation mu0 M, T; a positive J gives B_Z > 0 on the axis above the magnet.
    n_alpha, n_R : number of Gauss-Chebyshev points in cos(alpha) and of Gauss-Legendre points in R. The
        defaults leave an error of 1e-14 of |B| at a distance of one radius from the surface, 1e-11 at a half, 1e-6 at
        a quarter, and 10 % at a twentieth: take more there.
    printed : take the equation with its misprint.

    Returns
    -------
    B_Z, B_rho : shape of rho and Z together, T.

    Raises
    ------
    BadInput
        A point lies in the magnet or on its surface.
    """
    check_magnet(radius, height, J)
    rho, Z = np.broadcast_arrays(np.asarray(rho, dtype=np.float64), np.asarray(Z, dtype=np.float64))
    if not ((np.abs(rho) > radius) | (np.abs(Z) > height / 2)).all():
        raise BadInput("equation (3) of the paper holds outside the magnet only; got a point in it or on its surface")
    nodes, weights = np.polynomial.legendre.leggauss(n_R)
    R = (nodes * radius + radius) / 2
    cos = np.cos(np.pi * (np.arange(n_alpha) + 0.5) / n_alpha)[:, None]
    across = np.asarray(rho)[..., None, None] - R * cos
    flat = across**2 + R**2 * (1 - cos**2)
    up, down = (height / 2 - Z)[..., None, None], (height / 2 + Z)[..., None, None]
    dp3, dm3 = (flat + up**2) ** -1.5, (flat + down**2) ** -1.5
    misprint = 4 * np.asarray(rho)[..., None, None] * R * cos if printed else 0.0
    dp3_rho = (flat + up**2 + misprint) ** -1.5
    area = R * weights * (radius / 2) * (2 * np.pi / n_alpha)
    B_Z = -J / (4 * np.pi) * ((up * dp3 + down * dm3) * area).sum(axis=(-2, -1))
    B_rho = -J / (4 * np.pi) * ((dm3 - dp3_rho) * across * area).sum(axis=(-2, -1))
    return np.asarray(B_Z), np.asarray(B_rho)


def check_magnet(radius: float, height: float, J: float) -> None:
    """Refuse a magnet that is none."""
    for name, value in (("radius", radius), ("height", height)):
        if not 0 < value < math.inf:
            raise BadInput(f"the magnet's {name} must be a positive number of mm; got {value:g}")
    if not math.isfinite(J):
        raise BadInput(f"J must be a finite number of T; got {J:g}")


def _exact(points: ArrayLike, radius: float, height: float, J: float, *, slope: bool) -> Pair:
    check_magnet(radius, height, J)
    x = _points(points)
    kernel = compiled() if len(x) >= MIN_COMPILED_POINTS else None
    if kernel is None:
        return numpy_field(x, float(radius), height / 2, float(J), slope=slope)
    return compiled_field(kernel, x, float(radius), height / 2, float(J), slope=slope)


def _points(points: ArrayLike) -> Array:
    x = np.ascontiguousarray(points, dtype=np.float64)
    if x.ndim != 2 or x.shape[1] != 3:
        raise BadInput(f"points must have shape (n, 3); got {x.shape}")
    return x


def _refuse(point: Array) -> BadInput:
    if np.isfinite(point).all():
        where = ", ".join(f"{v + 0.0:g}" for v in point)
        return BadInput(
            f"the field is infinite on the magnet's rim (r = radius, |z| = height/2), where ({where}) mm lies in the "
            "magnet's frame: move the point off it"
        )
    return BadInput("points must be finite; got a NaN or an infinity")


def compiled_field(kernel: ModuleType, x: Array, radius: float, half: float, J: float, *, slope: bool) -> Pair:
    """B and, with `slope`, its Jacobian (else shape (0, 3, 3)), compiled; x as `cylinder_field`, half the height."""
    B, jacobian = np.empty_like(x), np.empty((len(x) if slope else 0, 3, 3))
    bad = kernel.fill(x, radius, half, J, cylinder_moments(half / radius), face_moments(), B, jacobian)
    if bad >= 0:
        raise _refuse(x[bad])
    return B, jacobian


def numpy_field(x: Array, radius: float, half: float, J: float, *, slope: bool) -> Pair:
    """The same in NumPy."""
    if not np.isfinite(x).all():
        raise _refuse(x[~np.isfinite(x).all(axis=1)][0])
    across, z = x[:, :2] / radius, x[:, 2] / radius
    rho = np.hypot(x[:, 0], x[:, 1])
    r, gap = rho / radius, distance_to_hull(x, rho, radius)
    up, down = (x[:, 2] - half) / radius, (x[:, 2] + half) / radius
    on_rim = (gap == 0) & ((up == 0) | (down == 0))
    if on_rim.any():
        raise _refuse(x[on_rim][0])
    lean, along, *slopes = unit_field(r, gap, z, up, down, half / radius, slope=slope)
    B = np.empty_like(x)
    B[:, :2] = (J * lean)[:, None] * across
    B[:, 2] = J * along
    if not slope:
        return B, np.empty((0, 3, 3))
    lean_z, along_z = slopes
    jacobian = np.empty((len(x), 3, 3))
    # div B = 0 gives d(B_r/r)/dr = -(dB_z/dz + 2 B_r/r)/r, which goes to 0 on the axis
    bend = -np.divide(along_z + 2 * lean, r * r, out=np.zeros_like(r), where=r > 1e-150)
    jacobian[:, :2, :2] = bend[:, None, None] * (across[:, :, None] * across[:, None, :])
    jacobian[:, 0, 0] += lean
    jacobian[:, 1, 1] += lean
    jacobian[:, :2, 2] = jacobian[:, 2, :2] = lean_z[:, None] * across
    jacobian[:, 2, 2] = along_z
    return B, jacobian * (J / radius)
