"""Critical loads of the beam as a clamped column of length H = L - R, pressed at its tip by a frictionless plate.

The dome rolls on the flat plate, so that the load always passes through the dome's centre at height H: the column is
clamped below and free above, P_E = (pi / 2H)^2 E I. Where the tip may rotate but not move sideways,
P_E = (4.4934 / H)^2 E I. Short columns shear as much as they bend: with the shear stiffness S = k G A,
k = 6 (1 + nu) / (7 + 6 nu) (Cowper 1966), Engesser (1889) takes the shear force normal to the bent axis, Haringx
(1948) along the rotated section, which is correct for a compressible column:

    Engesser P = P_E / (1 + P_E / S),        Haringx P (1 + P / S) = P_E.

Units mm, MPa, N. The column has no magnet, does not shorten and has a uniform section: accurate where H is several
diameters, and inaccurate for short beams, whose contact area restrains the tip.
"""

import math

from analytic.press_terms import effective_modulus
from geometry.design import Design

FREE, GUIDED = math.pi / 2, 4.493409457909064
"""Smallest roots of cos x = 0 (free tip) and tan x = x (tip that may rotate but not move sideways)."""


def bending_stiffness(design: Design) -> float:
    """E I of the section, N mm^2."""
    return design.E_now * math.pi * design.D**4 / 64


def euler(design: Design, end: float = FREE) -> float:
    """Euler's load (end / H)^2 E I, N.

    >>> from geometry.design import paper
    >>> round(euler(paper(), GUIDED) / euler(paper()), 3)
    8.183
    """
    return (end / design.H) ** 2 * bending_stiffness(design)


def shear_stiffness(design: Design) -> float:
    """k G A of the section, N."""
    nu = design.nu
    k = 6 * (1 + nu) / (7 + 6 * nu)
    return k * design.E_now / (2 * (1 + nu)) * math.pi * design.D**2 / 4


def sideways_stiffness(design: Design, height: float | None = None) -> float:
    """Stiffness of the unpressed beam against a force along x at a height, N/mm: Timoshenko's cantilever so long.

    height : mm; default: that of the tip, L.

    >>> from geometry.design import paper
    >>> round(sideways_stiffness(paper()), 3)
    0.554
    """
    length = design.L if height is None else height
    bending = length**3 / (3 * bending_stiffness(design))
    return 1 / (bending + length / shear_stiffness(design))


def engesser(design: Design) -> float:
    """Engesser's load P_E / (1 + P_E / S), N."""
    P = euler(design)
    return P / (1 + P / shear_stiffness(design))


def haringx(design: Design, end: float = FREE) -> float:
    """Haringx's load, the root of P (1 + P / S) = P_E, N."""
    S = shear_stiffness(design)
    return S / 2 * (math.sqrt(1 + 4 * euler(design, end) / S) - 1)


def depth(design: Design, force: float) -> float:
    """Depth of the press under a force, mm: Hertz contact of the dome in series with the column, F H / (E A)."""
    hertz = math.pow(3 * force / (4 * effective_modulus(design) * math.sqrt(design.R)), 2 / 3)
    return hertz + force * design.H / (design.E_now * math.pi * design.R**2)
