"""Field of a cylinder magnet with uniform axial magnetisation: exact, by the paper's equation (3), and as a dipole.

Lengths in mm (the field depends on their ratios only, so any one unit works), J and B in T. J = mu0 M is the magnet's
polarisation. The cylinder has sharp edges; an edge radius is ignored. Points and fields are in the magnet's frame:
origin at its centre, z along the magnetisation.

The exact field is computed in NumPy (`analytic.field.cylinder_numpy`) for fewer than `MIN_COMPILED_POINTS` points in
a call. Larger calls, and `meridian_field` for loops over single points, use the same formulas compiled by numba
(`analytic.field.cylinder_compiled`). Both agree to 1e-13 of |B|. The
number of points in a call alone selects the implementation, so that a repeated call returns identical digits. Calls
with 40 000 points or more use all cores (`geometry.compiled.threads`).

Sources: Derby & Olbert, Am. J. Phys. 78 (2010) 229; Bulirsch, Numer. Math. 13 (1969) 305; Chathuranga et al.,
IEEE Sensors Journal 2016, equations (1) to (3).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analytic.field import cylinder_pointwise
from analytic.field.cylinder_numpy import cylinder_moments, distance_to_hull, face_moments, unit_field
from geometry import compiled as compilation
from geometry.arrays import Array
from geometry.cad import magnet_volume
from geometry.design import BadInput, Design

__all__ = ["cylinder_field", "cylinder_field_jacobian", "dipole_field", "meridian_field", "paper_field"]

Pair = tuple[Array, Array]

MIN_COMPILED_POINTS = 2000
"""Smallest number of points in a call for which the compiled kernel is used, in a tenth of NumPy's time. Loading it
takes about a second, once in a process: a single decoding, with fewer points in a call, does not wait for that."""
MU_0 = 4e-7 * math.pi
"""Vacuum permeability, T m/A."""
GRAVITY, GRIP = 9.81, 0.3
"""Acceleration, m/s^2, and friction of a magnet on the floor of its pocket over its weight, a common value."""
FACE_RADII, FACE_ANGLES = 16, 48
"""Points of the integrals over a face: the force of magnets that nearly touch is exact to 1e-4, else to 1e-7."""
THREAD_POINTS = 20_000
"""Number of points for each thread: they take 1 ms, ten times the time to start a thread."""


def cylinder_field(points: ArrayLike, radius: float, height: float, J: float) -> Array:
    """Return B of the magnet, inside and outside it.

    The error is below 1e-12 of |B| for height/radius from 1e-6 (discs) to 1e3 (needles) and distances up to 1e6
    radii, even 1e-12 radii from a face, the hull or the rim.

    Parameters
    ----------
    points : shape (n, 3), mm.
    radius, height : radius and height of the cylinder, mm.
    J : polarisation mu0 M, T.

    Returns
    -------
    shape (n, 3), T. Inside the magnet too this is B, not mu0 H. On the hull (r = radius) B_z jumps by J; the result
    there is the mean of both sides. B is continuous across a face.

    Raises
    ------
    BadInput
        A point lies exactly on one of the two rims (r = radius, |z| = height/2), where |B| grows as J/2pi times the
        logarithm of the distance; a point is not finite; radius or height is not positive.
    """
    return _exact(points, radius, height, J, slope=False)[0]


def cylinder_field_jacobian(points: ArrayLike, radius: float, height: float, J: float) -> Pair:
    """Return B as `cylinder_field` does, and its Jacobian in closed form.

    Returns
    -------
    B : shape (n, 3), T.
    jacobian : dB_i/dx_j at [n, i, j], shape (n, 3, 3), T/mm; symmetric, with trace 0. On the hull, where B_z jumps,
        it does not include the jump.

    Raises
    ------
    BadInput
        As `cylinder_field`.
    """
    return _exact(points, radius, height, J, slope=True)


def compiled() -> ModuleType | None:
    """Return the compiled kernel; None if numba is not installed or not usable.

    The first call after an installation compiles the kernel in several seconds and stores it in a file; later
    processes load it in about a second. Call this function to choose when that happens; no result depends on it.
    """
    return compilation.load("analytic.field.cylinder_compiled") if compilation.available() else None


def prepare() -> bool:
    """Load the compiled kernels, or compile them once after an installation; return whether they are usable."""
    if compiled() is None:
        return False
    cylinder_field(np.zeros((MIN_COMPILED_POINTS, 3)), 1.0, 1.0, 1.0)
    meridian_field(1.0, 1.0, 1.0)(0.0, 0.0)
    return True


def meridian_field(radius: float, height: float, J: float) -> Callable[[float, float], tuple[float, ...]]:
    """Return a function that computes the field of one magnet at one point (rho, z), mm.

    It returns B_r and B_z, T, and dB_r/dr, B_r/r, dB_r/dz and dB_z/dz, T/mm, in a tenth of the time that
    `cylinder_field_jacobian` needs for a single point. It is compiled if numba is installed, else plain Python.

    Raises
    ------
    BadInput
        As `cylinder_field`; for a point when the returned function is called.
    """
    check_magnet(radius, height, J)
    half = height / 2
    moments, faces = cylinder_moments(half / radius), face_moments()
    kernel = compiled()
    meridian = cylinder_pointwise.meridian if kernel is None else kernel.meridian
    # plain Python indexes lists faster than arrays; compiled code needs arrays
    series = (moments.tolist(), faces.tolist()) if kernel is None else (moments, faces)

    def field(rho: float, z: float) -> tuple[float, ...]:
        defined, *values = meridian(rho, z, radius, half, J, *series)
        if not defined:
            raise _undefined(np.array([rho, 0.0, z]))
        return tuple(values)

    return field


def dipole_field(points: ArrayLike, radius: float, height: float, J: float) -> Array:
    """Return B of a dipole at the magnet's centre, with its moment: [3 (m.x) x/d^2 - m]/d^3, m = J radius^2 height/4.

    The relative error is of the order of (size/d)^2, and of (size/d)^4 for height = sqrt(3) radius. Parameters and
    result as in `cylinder_field`.

    Raises
    ------
    BadInput
        A point lies at the centre or is not finite; radius or height is not positive.
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
    """Return B by the paper's equation (3), a quadrature over the two charged end faces, outside the magnet.

    With dp^2 = R^2 + rho^2 - 2 R rho cos(alpha) + (h/2 - Z)^2, and dm^2 the same with (h/2 + Z):

        B_Z   = -(J/4 pi) int_0^2pi int_0^a [ R (h/2 - Z)/dp^3 + R (h/2 + Z)/dm^3 ] dR dalpha
        B_rho = -(J/4 pi) int_0^2pi int_0^a [ -R (rho - R cos(alpha))/dp^3 + R (rho - R cos(alpha))/dm^3 ] dR dalpha

    This form agrees with `cylinder_field`. The printed equation has + 2 R rho cos(alpha) in the first denominator of
    B_rho. Off the axis this misprint causes errors of 10 to 50 % of |B| at the paper's elements. Inside the magnet
    equation (3) would give mu0 H, so points there are refused.

    Parameters
    ----------
    rho, Z : shape (n,) or scalars, mm: distance from the axis and height above the centre, along the magnetisation.
    radius, height : a and h, mm.
    J : polarisation mu0 M, T; a positive J gives B_Z > 0 on the axis above the magnet.
    n_alpha, n_R : number of Gauss-Chebyshev points in cos(alpha) and of Gauss-Legendre points in R. The
        defaults leave an error of 1e-14 of |B| at a distance of 1 radius from the surface, 1e-11 at 1/2, 1e-6 at
        1/4, and 10 % at 1/20: take more points there.
    printed : use the printed equation, with its misprint.

    Returns
    -------
    B_Z, B_rho : shape to which rho and Z broadcast, T.

    Raises
    ------
    BadInput
        A point lies inside the magnet or on its surface; radius or height is not positive.
    """
    check_magnet(radius, height, J)
    rho, Z = np.broadcast_arrays(np.asarray(rho, dtype=np.float64), np.asarray(Z, dtype=np.float64))
    if not ((np.abs(rho) > radius) | (np.abs(Z) > height / 2)).all():
        raise BadInput("equation (3) of the paper holds outside the magnet only; got a point in it or on its surface")
    nodes, weights = np.polynomial.legendre.leggauss(n_R)
    R = (nodes * radius + radius) / 2
    # the integrand is even and periodic in alpha: equal steps over 0..pi are Gauss-Chebyshev
    cos = np.cos(np.pi * (np.arange(n_alpha) + 0.5) / n_alpha)[:, None]
    across = np.asarray(rho)[..., None, None] - R * cos
    flat = across**2 + R**2 * (1 - cos**2)
    up, down = (height / 2 - Z)[..., None, None], (height / 2 + Z)[..., None, None]
    dp3, dm3 = (flat + up**2) ** -1.5, (flat + down**2) ** -1.5
    # - 2 R rho cos(alpha) becomes + 2 R rho cos(alpha)
    misprint = 4 * np.asarray(rho)[..., None, None] * R * cos if printed else 0.0
    dp3_rho = (flat + up**2 + misprint) ** -1.5
    area = R * weights * (radius / 2) * (2 * np.pi / n_alpha)
    B_Z = -J / (4 * np.pi) * ((up * dp3 + down * dm3) * area).sum(axis=(-2, -1))
    B_rho = -J / (4 * np.pi) * ((dm3 - dp3_rho) * across * area).sum(axis=(-2, -1))
    return np.asarray(B_Z), np.asarray(B_rho)


def check_magnet(radius: float, height: float, J: float) -> None:
    """Check that radius and height are positive and J is finite."""
    for name, value in (("radius", radius), ("height", height)):
        if not 0 < value < math.inf:
            raise BadInput(f"the magnet's {name} must be a positive number of mm; got {value:g}")
    if not math.isfinite(J):
        raise BadInput(f"J must be a finite number of T; got {J:g}")


def on_rim(points: Array, radius: float, height: float) -> NDArray[np.bool_]:
    """Return whether each point (n, 3), mm, lies on a rim, where `cylinder_field` is not defined; shape (n,)."""
    rim = np.abs(points[:, 2]) == height / 2
    if rim.any():
        x = points[rim]
        rim[rim] = distance_to_hull(x, np.hypot(x[:, 0], x[:, 1]), radius) == 0
    return np.asarray(rim)


def _exact(points: ArrayLike, radius: float, height: float, J: float, *, slope: bool) -> Pair:
    """Return B and, with `slope`, its Jacobian (else shape (0, 3, 3)), by NumPy or the compiled kernel."""
    check_magnet(radius, height, J)
    x = _points(points)
    kernel = compiled() if len(x) >= MIN_COMPILED_POINTS else None
    if kernel is None:
        return numpy_field(x, float(radius), height / 2, float(J), slope=slope)
    threads = compilation.threads()
    return compiled_field(kernel, x, float(radius), height / 2, float(J), slope=slope, threads=threads)


def _points(points: ArrayLike) -> Array:
    """Return the points as a contiguous array of floats, shape (n, 3)."""
    x = np.ascontiguousarray(points, dtype=np.float64)
    if x.ndim != 2 or x.shape[1] != 3:
        raise BadInput(f"points must have shape (n, 3); got {x.shape}")
    return x


def _undefined(point: Array) -> BadInput:
    """Return the error for a point (3,), mm, that has no field: on the rim, or not finite."""
    if np.isfinite(point).all():
        where = ", ".join(f"{v + 0.0:g}" for v in point)
        return BadInput(
            f"the field is infinite on the magnet's rim (r = radius, |z| = height/2), where ({where}) mm lies in the "
            "magnet's frame: move the point off it"
        )
    return BadInput("points must be finite; got a NaN or an infinity")


def compiled_field(
    kernel: ModuleType, x: Array, radius: float, half: float, J: float, *, slope: bool, threads: int = 1
) -> Pair:
    """Return what `_exact` returns, by the compiled kernel; x are the points, `half` is half the height.

    At most `threads` threads share the points, one for every `THREAD_POINTS`. The digits do not depend on their
    number: each thread computes whole batches.
    """
    B, jacobian = np.empty_like(x), np.empty((len(x) if slope else 0, 3, 3))
    series = cylinder_moments(half / radius), face_moments()
    count = min(threads, len(x) // THREAD_POINTS)
    share = math.ceil(len(x) / max(count, 1) / kernel.POINTS) * kernel.POINTS

    def fill(start: int) -> int:
        part = slice(start, start + share)
        bad = kernel.fill(x[part], radius, half, J, *series, B[part], jacobian[part])
        return start + int(bad) if bad >= 0 else len(x)

    if count < 2:
        bad = fill(0)
    else:
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(count) as pool:
            bad = min(pool.map(fill, range(0, len(x), share)))
    if bad < len(x):
        raise _undefined(x[bad])
    return B, jacobian


def numpy_field(x: Array, radius: float, half: float, J: float, *, slope: bool) -> Pair:
    """Return what `_exact` returns, by NumPy; x are the points, `half` is half the height."""
    if not np.isfinite(x).all():
        raise _undefined(x[~np.isfinite(x).all(axis=1)][0])
    # all lengths in radii; the gaps to hull and faces come from mm, because rounding of r and z would spoil them
    across, z = x[:, :2] / radius, x[:, 2] / radius
    rho = np.hypot(x[:, 0], x[:, 1])
    r, gap = rho / radius, distance_to_hull(x, rho, radius)
    up, down = (x[:, 2] - half) / radius, (x[:, 2] + half) / radius
    on_rim = (gap == 0) & ((up == 0) | (down == 0))
    if on_rim.any():
        raise _undefined(x[on_rim][0])
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


def repulsion(radius: float, height: float, J: float, distance: float) -> float:
    """Return the force with which two equal magnets side by side, like poles up, push each other apart, N.

    The faces of one carry the charges +-M in the field of the other: F = (J / mu0) (int B_x dA over its upper face
    less that over its lower face). The integrals take Gauss points over the radius and equal angles.

    Parameters
    ----------
    radius, height, J : of both magnets, as in `cylinder_field`.
    distance : of their axes, mm; more than their diameter.

    Raises
    ------
    BadInput
        The magnets would overlap.

    Examples
    --------
    Far away it is that of two dipoles, 3 mu0 m^2 / (4 pi s^4):

    >>> m = 1.2 / MU_0 * math.pi * 3.0**2 * 3.0 * 1e-9
    >>> round(repulsion(3.0, 3.0, 1.2, 500.0) / (3 * MU_0 * m**2 / (4 * math.pi * 0.5**4)), 3)
    1.0
    """
    if not distance > 2 * radius:
        raise BadInput(f"distance must exceed the magnets' diameter = {2 * radius:g} mm; got {distance:g} mm")
    nodes, weights = np.polynomial.legendre.leggauss(FACE_RADII)
    r, turn = radius * (nodes + 1) / 2, 2 * math.pi * np.arange(FACE_ANGLES) / FACE_ANGLES
    area = np.repeat(r * weights * radius / 2, FACE_ANGLES) * 2 * math.pi / FACE_ANGLES
    x, y = distance + np.outer(r, np.cos(turn)).ravel(), np.outer(r, np.sin(turn)).ravel()
    upper, lower = (
        cylinder_field(np.column_stack([x, y, np.full(len(x), z)]), radius, height, J)[:, 0]
        for z in (height / 2, -height / 2)
    )
    return float(1e-6 * J / MU_0 * area @ (upper - lower))


def weight(design: Design) -> float:
    """Return the weight of a design's magnet, N."""
    return 1e-9 * magnet_volume(design.shape) * design.magnet_density * GRAVITY


def resting_distance(design: Design) -> float | None:
    """Return the distance of the axes from which two such magnets, side by side with like poles up, stay put, mm.

    From there on they push each other by no more than GRIP of their weight. None without a magnet.
    """
    from scipy.optimize import brentq

    if not design.shape.has_magnet:
        return None
    radius, height = design.magnet_diameter / 2, design.magnet_height

    def excess(distance: float) -> float:
        return repulsion(radius, height, design.remanence, distance) - GRIP * weight(design)

    near = 2 * radius * (1 + 1e-6)
    return near if excess(near) <= 0 else float(brentq(excess, near, 1e3 * (radius + height), rtol=1e-6))
