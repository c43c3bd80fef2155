"""Field of a cylinder magnet with uniform axial magnetisation: exact, by the paper's equation (3), and as a dipole.

Lengths in mm (the field depends on their ratios only, so any one unit works), J and B in T. J = mu0 M is the magnet's
polarisation. The cylinder has sharp edges; an edge radius is ignored. Points and fields are in the magnet's frame:
origin at its centre, z along the magnetisation.

The exact field has one implementation, `analytic.cylinder`.

Sources: Derby & Olbert, Am. J. Phys. 78 (2010) 229; Bulirsch, Numer. Math. 13 (1969) 305; Chathuranga et al.,
IEEE Sensors Journal 2016, equations (1) to (3).
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from analytic import cylinder
from geometry.arrays import Array
from geometry.cad import magnet_volume
from geometry.design import BadInput, Design

__all__ = ["cylinder_field", "dipole_field", "paper_field"]

MU_0 = 4e-7 * math.pi
"""Vacuum permeability, T m/A."""


def cylinder_field(points: ArrayLike, radius: float, height: float, J: float, *, refuse: bool = True) -> Array:
    """Return B of the magnet, inside and outside it.

    The error is below 1e-12 of |B| for height/radius from 1e-6 (discs) to 1e3 (needles) and distances up to 1e6
    radii, even 1e-12 radii from a face, the hull or the rim.

    Parameters
    ----------
    points : shape (n, 3), mm.
    radius, height : radius and height of the cylinder, mm.
    J : polarisation mu0 M, T.
    refuse : False for NaN at points on a rim and at those that are not finite.

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
    check_magnet(radius, height, J)
    x = _points(points)
    B, bad = cylinder.computed(x, float(radius), float(height) / 2, float(J))
    if bad >= 0 and refuse:
        if not np.isfinite(x[bad]).all():
            raise BadInput("points must be finite; got a NaN or an infinity")
        where = ", ".join(f"{v + 0.0:g}" for v in x[bad])
        raise BadInput(
            f"the field is infinite on the magnet's rim (r = radius, |z| = height/2), where ({where}) mm lies in the "
            "magnet's frame: move the point off it"
        )
    return B


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
    rho: ArrayLike, Z: ArrayLike, radius: float, height: float, J: float, *, printed: bool = False
) -> tuple[Array, Array]:
    """Return B by the paper's equation (3), a quadrature over the two charged end faces, outside the magnet.

    With dp^2 = R^2 + rho^2 - 2 R rho cos(alpha) + (h/2 - Z)^2, and dm^2 the same with (h/2 + Z):

        B_Z   = -(J/4 pi) int_0^2pi int_0^a [ R (h/2 - Z)/dp^3 + R (h/2 + Z)/dm^3 ] dR dalpha
        B_rho = -(J/4 pi) int_0^2pi int_0^a [ -R (rho - R cos(alpha))/dp^3 + R (rho - R cos(alpha))/dm^3 ] dR dalpha

    This form agrees with `cylinder_field`, but for the quadrature's error: 1e-14 of |B| at 1 radius from the surface,
    1e-11 at 1/2, 1e-6 at 1/4 and 10 % at 1/20. The printed equation has + 2 R rho cos(alpha) in the first denominator
    of B_rho. Off the axis this misprint causes errors of 10 to 50 % of |B| at the paper's elements. Inside the magnet
    equation (3) would give mu0 H, so points there are refused.

    Parameters
    ----------
    rho, Z : shape (n,) or scalars, mm: distance from the axis and height above the centre, along the magnetisation.
    radius, height : a and h, mm.
    J : polarisation mu0 M, T; a positive J gives B_Z > 0 on the axis above the magnet.
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
    n_alpha, (nodes, weights) = 32, np.polynomial.legendre.leggauss(16)
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


def _points(points: ArrayLike) -> Array:
    x = np.ascontiguousarray(points, dtype=np.float64)
    if x.ndim != 2 or x.shape[1] != 3:
        raise BadInput(f"points must have shape (n, 3); got {x.shape}")
    return x


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

    Far away it is that of two dipoles, 3 mu0 m^2 / (4 pi s^4):

    >>> m = 1.2 / MU_0 * math.pi * 3.0**2 * 3.0 * 1e-9
    >>> round(repulsion(3.0, 3.0, 1.2, 500.0) / (3 * MU_0 * m**2 / (4 * math.pi * 0.5**4)), 3)
    1.0
    """
    if not distance > 2 * radius:
        raise BadInput(f"distance must exceed the magnets' diameter = {2 * radius:g} mm; got {distance:g} mm")
    # so many points that the force of magnets that nearly touch is exact to 1e-4, else to 1e-7
    (nodes, weights), angles = np.polynomial.legendre.leggauss(16), 24
    # half of the face: B_x is the same at y and -y, and on the lower face it has the opposite sign
    r, turn = radius * (nodes + 1) / 2, math.pi * (np.arange(angles) + 0.5) / angles
    area = np.repeat(r * weights * radius / 2, angles) * math.pi / angles
    x, y = distance + np.outer(r, np.cos(turn)).ravel(), np.outer(r, np.sin(turn)).ravel()
    upper = cylinder_field(np.column_stack([x, y, np.full(len(x), height / 2)]), radius, height, J)[:, 0]
    return float(4e-6 * J / MU_0 * area @ upper)


def holding_force(radius: float, height: float, J: float) -> float:
    """Return about the force that parts two equal magnets in line that touch, or one from a thick plate of iron, N.

    Maxwell's stress B^2/(2 mu_0) over the face, with B on the axis of a magnet of twice the height, at its middle:
    B = J h / (h^2 + a^2)^(1/2). A long magnet has J^2 A / (2 mu_0), which is exact.

    >>> round(holding_force(2.0, 2000.0, 1.2) / (1.2**2 * math.pi * 4e-6 / (2 * MU_0)), 4)
    1.0
    """
    return J**2 * height**2 / (height**2 + radius**2) * math.pi * radius**2 * 1e-6 / (2 * MU_0)


def weight(design: Design) -> float:
    """Return the weight of a design's magnet, N."""
    return 1e-9 * magnet_volume(design.shape) * design.magnet_density * 9.81


def resting_distance(design: Design) -> float | None:
    """Return the distance of the axes from which two such magnets, side by side with like poles up, stay put, mm.

    From there on they push each other by no more than 0.3 of their weight, a common friction on the floor of a
    pocket. None without a magnet.
    """
    from scipy.optimize import brentq

    if not design.shape.has_magnet:
        return None
    radius, height = design.magnet_diameter / 2, design.magnet_height

    def excess(log_distance: float) -> float:
        """Return the logarithm of the repulsion over its limit: nearly linear, so that few steps find its root."""
        return math.log(repulsion(radius, height, design.remanence, math.exp(log_distance)) / (0.3 * weight(design)))

    near = math.log(2 * radius * (1 + 1e-6))
    if excess(near) <= 0:
        return math.exp(near)
    return math.exp(brentq(excess, near, math.log(1e3 * (radius + height)), xtol=1e-9))
