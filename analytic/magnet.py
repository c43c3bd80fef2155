"""The field of a cylinder magnet, homogeneously magnetised along its axis: closed form, and the paper's quadrature.

Lengths in mm (any one unit would do: the field knows only their ratios), J and B in T. J = mu0 M is the magnet's
polarisation; the sharp-edged cylinder is taken, an edge radius is ignored.

Sources: Derby & Olbert, Am. J. Phys. 78 (2010) 229; Bulirsch, Numer. Math. 13 (1969) 305; Chathuranga et al.,
IEEE Sensors Journal 2016, equations (1) to (3).
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.design import BadInput

Array = NDArray[np.float64]
Pair = tuple[Array, Array]

FAR = 5.0
"""Beyond this many circumscribed radii the multipole series takes over: 5^-28 of the field is left out."""
THIN = 6.0
"""Beyond this many half heights from the rim 8 Gauss points over the height suffice (error about 12^-16)."""
ORDER = 27
"""Highest multipole."""


def cylinder_field(points: ArrayLike, radius: float, height: float, J: float) -> Array:
    """B of the magnet, inside and outside it.

    Three regimes, chosen point by point, keep the error below 1e-13 of |B| for discs and needles, close and far:
    multipoles beyond 5 circumscribed radii, Gauss points over the height where that is small against the distance
    to the rim, and between them the two charged end faces, each by Bulirsch's cel (Derby & Olbert 2010) or, beyond
    5 radii from the face, by its own multipoles, with J added inside.

    Parameters
    ----------
    points : shape (n, 3), mm, in the magnet's frame: origin at its centre, z along the magnetisation.
    radius, height : of the cylinder, mm.
    J : polarisation mu0 M, T.

    Returns
    -------
    shape (n, 3), T. This is B (not mu0 H) inside as well. On the hull (r = radius) B_z jumps by J; there it is the
    mean of both sides.

    Raises
    ------
    BadInput
        A point lies exactly on one of the two rims, where the field is infinite (logarithmically); a point is not
        finite; radius or height is not positive.
    """
    _check_magnet(radius, height, J)
    x = np.asarray(points, dtype=np.float64)
    if x.ndim != 2 or x.shape[1] != 3:
        raise BadInput(f"points must have shape (n, 3); got {x.shape}")
    if not np.isfinite(x).all():
        raise BadInput("points must be finite; got a NaN or an infinity")
    rho = np.hypot(x[:, 0], x[:, 1])
    b_r, b_z = _unit_field(rho / radius, x[:, 2] / radius, height / (2 * radius))
    outward = np.divide(x[:, :2], rho[:, None], out=np.zeros_like(x[:, :2]), where=rho[:, None] > 0)
    return J * np.column_stack([b_r[:, None] * outward, b_z])


def paper_field(
    rho: ArrayLike, Z: ArrayLike, radius: float, height: float, J: float, n_alpha: int = 32, n_R: int = 16
) -> Pair:
    """The paper's equation (3), by quadrature over the two charged end faces; outside the magnet.

    With dp^2 = R^2 + rho^2 - 2 R rho cos(alpha) + (h/2 - Z)^2, and dm^2 the same with (h/2 + Z):

        B_Z   = -(J/4 pi) int_0^2pi int_0^a [ R (h/2 - Z)/dp^3 + R (h/2 + Z)/dm^3 ] dR dalpha
        B_rho = -(J/4 pi) int_0^2pi int_0^a [ -R (rho - R cos(alpha))/dp^3 + R (rho - R cos(alpha))/dm^3 ] dR dalpha

    The printed equation has a stray factor and the sign of the term in cos(alpha) wrong; this is the form that
    agrees with `cylinder_field`. Inside the magnet it would give mu0 H, so points there are refused.

    Parameters
    ----------
    rho, Z : shape (n,) or scalars, mm: distance from the axis and height above the centre, along the magnetisation.
    radius, height : a and h, mm.
    J : polarisation mu0 M, T; a positive J gives B_Z > 0 on the axis above the magnet.
    n_alpha, n_R : number of Gauss-Chebyshev points in cos(alpha) and of Gauss-Legendre points in R. The
        defaults leave an error of 1e-14 of |B| at a distance of one radius from the surface, 1e-11 at a half, 1e-6 at
        a quarter, and 10 % at a twentieth: take more there.

    Returns
    -------
    B_Z, B_rho : shape of rho and Z together, T.

    Raises
    ------
    BadInput
        A point lies in the magnet or on its surface.
    """
    _check_magnet(radius, height, J)
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
    area = R * weights * (radius / 2) * (2 * np.pi / n_alpha)
    B_Z = -J / (4 * np.pi) * ((up * dp3 + down * dm3) * area).sum(axis=(-2, -1))
    B_rho = -J / (4 * np.pi) * ((dm3 - dp3) * across * area).sum(axis=(-2, -1))
    return np.asarray(B_Z), np.asarray(B_rho)


def _check_magnet(radius: float, height: float, J: float) -> None:
    for name, value in (("radius", radius), ("height", height)):
        if not 0 < value < math.inf:
            raise BadInput(f"the magnet's {name} must be a positive number of mm; got {value:g}")
    if not math.isfinite(J):
        raise BadInput(f"J must be a finite number of T; got {J:g}")


def _unit_field(r: Array, z: Array, z0: float) -> Pair:
    """B_r and B_z, shape (n,), of the magnet of radius 1, half height z0 and J = 1."""
    if ((r == 1) & (np.abs(z) == z0)).any():
        raise BadInput(
            "the field is infinite on the magnet's rim (r = radius, |z| = height/2): move the point off it"
        )
    span = math.hypot(1, z0)
    far = np.hypot(r, z) > FAR * span
    thin = ~far & (np.hypot(1 - r, z) > THIN * z0)
    near = ~far & ~thin
    b_r, b_z = np.empty_like(r), np.empty_like(r)
    if far.any():
        b_r[far], b_z[far] = _multipoles(r[far] / span, z[far] / span, _cylinder_moments(z0))
    if thin.any():
        b_r[thin], b_z[thin] = _thin(r[thin], z[thin], z0)
    if near.any():
        b_r[near], b_z[near] = _two_faces(r[near], z[near], z0)
    return b_r, b_z


def _two_faces(r: Array, z: Array, z0: float) -> Pair:
    """The end faces, charged +1 at z0 and -1 at -z0, give mu0 H; inside, J is added.

    The nearby form of a face leaves out a step of half sign(z) inside r = 1. All the steps are summed first, where
    they cancel without rounding.
    """
    within = 0.5 * (np.sign(1 - r) + 1)
    top_r, top_z, top_step = _face(r, z - z0)
    bottom_r, bottom_z, bottom_step = _face(r, z + z0)
    step = (np.sign(z + z0) - np.sign(z - z0)) / 2 + (top_step - bottom_step)
    return top_r - bottom_r, within * step + (top_z - bottom_z)


def _face(r: Array, z: Array) -> tuple[Array, Array, Array]:
    """Field of a disc of radius 1 at z = 0 with unit charge density, and the step to be added to h_z inside r = 1."""
    h_r, h_z = np.empty_like(r), np.empty_like(r)
    far = np.hypot(r, z) > FAR
    if far.any():
        h_r[far], h_z[far] = _multipoles(r[far], z[far], _face_moments())
    if not far.all():
        near = ~far
        h_r[near], h_z[near] = _face_near(r[near], z[near])
    return h_r, h_z, np.where(far, 0.0, np.sign(z) / 2)


def _face_near(r: Array, z: Array) -> Pair:
    """Half of Derby and Olbert's solenoid: -cel(k, 1, 1, -1)/(pi s) and -z cel(k, g^2, 1, g)/(pi (1 + r) s).

    With s^2 = z^2 + (1 + r)^2, k^2 = (z^2 + (1 - r)^2)/s^2 and g = (1 - r)/(1 + r). At r = 1 the second cel jumps;
    its mean there is K(k).
    """
    s = np.hypot(z, 1 + r)
    k = np.hypot(z, 1 - r) / s
    g = (1 - r) / (1 + r)
    one = np.ones_like(r)
    hull = g == 0
    second = _cel(k, np.where(hull, 1.0, np.abs(g)), one, np.where(hull, 1.0, g))
    return -_cel(k, one, one, -one) / (np.pi * s), -z * second / (np.pi * (1 + r) * s)


def _thin(r: Array, z: Array, z0: float) -> Pair:
    """The magnet as a stack of current rings, by 8 Gauss points over its height."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    b_r, b_z = np.zeros_like(r), np.zeros_like(r)
    for node, weight in zip(nodes, weights, strict=True):
        dz = z - z0 * node
        s = np.hypot(dz, 1 + r)
        k = np.hypot(dz, 1 - r) / s
        one = np.ones_like(r)
        b_r += weight * z0 / np.pi * dz / s**3 * _cel(k, k, -one, one)
        b_z += weight * z0 / np.pi / s**3 * _cel(k, k, 1 + r, 1 - r)
    return b_r, b_z


def _cel(kc: Array, q: Array, c: Array, s: Array) -> Array:
    """Bulirsch's complete elliptic integral cel(kc, p = q^2, c, s) for kc > 0 and q > 0, all shape (n,).

    The integral from 0 to pi/2 of (c cos^2 + s sin^2) / ((cos^2 + p sin^2) sqrt(cos^2 + kc^2 sin^2)).
    Convergence is quadratic; once an entry has converged, further steps leave it as it is to rounding.
    """
    k, m, p = kc, np.ones_like(kc), q
    s = s / q
    c, s = c + s / p, 2 * (s + c * k / p)
    p = p + k / p
    g, m, product = m, k + m, k
    while (np.abs(g - k) > 1e-8 * g).any():
        k = 2 * np.sqrt(product)
        product = k * m
        c, s = c + s / p, 2 * (s + c * product / p)
        p = p + product / p
        g, m = m, k + m
    return np.asarray(np.pi / 2 * (s + c * m) / (m * (m + p)))


def _multipoles(r: Array, z: Array, moments: tuple[float, ...]) -> Pair:
    """Field of the potential sum moments[n] P_n(cos theta) / d^(n+1), n to ORDER; r, z shape (n,), d > 0."""
    d = np.hypot(r, z)
    cos, sin = z / d, r / d
    p_last, p = np.zeros_like(d), np.ones_like(d)
    slope_last, slope = np.zeros_like(d), np.zeros_like(d)
    along, across = np.zeros_like(d), np.zeros_like(d)
    power = 1 / d**2
    for n, moment in enumerate(moments):
        if moment:
            along += moment * (n + 1) * p * power
            across += moment * sin * slope * power
        power = power / d
        p_last, p = p, ((2 * n + 1) * cos * p - n * p_last) / (n + 1)
        slope_last, slope = slope, slope_last + (2 * n + 1) * p_last
    return along * sin + across * cos, along * cos - across * sin


@lru_cache(maxsize=256)
def _face_moments() -> tuple[float, ...]:
    """Of the charged disc, from its potential on the axis, (sqrt(z^2 + 1) - z)/2."""
    moments = [0.0] * (ORDER + 1)
    binomial = 1.0
    for k in range(1, ORDER // 2 + 2):
        binomial *= (1.5 - k) / k
        moments[2 * k - 2] = binomial / 2
    return tuple(moments)


@lru_cache(maxsize=256)
def _cylinder_moments(z0: float) -> tuple[float, ...]:
    """Of the cylinder of radius 1 and half height z0 with J = 1, lengths in units of its circumscribed radius.

    1/2 sum_k (-1)^k C(n, k) C(2n - 2k, n) 2^-n z0^(n - 2k) [(1 + z0^2)^(k+1) - z0^(2k+2)] / (k + 1), n odd; the
    bracket is expanded, because its two terms cancel for needles.
    """
    span2 = 1 + z0 * z0
    x, a2 = z0 * z0 / span2, 1 / span2
    moments = [0.0] * (ORDER + 1)
    for n in range(1, ORDER + 1, 2):
        total = 0.0
        for k in range(n // 2 + 1):
            bracket = a2 * sum(x ** (k - j) for j in range(k + 1)) / (k + 1)
            total += (-1) ** k * math.comb(n, k) * math.comb(2 * n - 2 * k, n) * x ** (n / 2 - k) * bracket
        moments[n] = total / 2 ** (n + 1)
    return tuple(moments)
