"""Press of the beam by a flat plate, level by level: force, sinking of the magnet, contact radius.

The dome above its centre and the column below act in series: they share the depth d under one force F
(E* = E/(1 - nu^2), A = pi R^2, H = L - R, eps = F/(E A)):

    d = above + below,    F = 4/3 E* sqrt(R) above^1.5 [1 + 1.133 x + 1.283 x^2 + 0.769 x^3 + 0.0975 x^4],
    below = R C eps,      x = sqrt(R above)/t.

The bracket describes a sphere on a bonded incompressible layer of thickness t (Dimitriadis et al., Biophys. J. 82
(2002) 2798). To first order the layer reduces Hertz's depth by 1.335 (R/t) R eps, so that a layer is characterised by
1.335 R/t.

column : Hertz on a half-space (t infinite), C = H/R.
tip    : the dome is not a half-space. A sphere between two plates gives R/t = 0.75/1.335 (Tatara, J. Eng. Mater.
         Technol. 113 (1991) 285: the field of the opposite pole raises this one). The centre sinks deeper than the
         mean of its section, and the clamped foot cannot spread: C = H/R + 0.18 [1 - exp(-(g/R)^2)], g = H.
magnet : rigid, radius a, height h; silicone of thickness R - h/2 lies above it and g = H - h/2 below. The share
         s = 1 - (1 + (a/(R - h/2))^2)^-1.5 of the load (Boussinesq) passes through its top face, and
         1.335 R/t = (1 - s) 0.75 + s 1.335 R/(R - h/2). C decreases by 1.55 [a^2 h/R^3]^(2/3), to at least 0.4 g/R.
finite : the layer thins to t exp(-1.4 above/R), and below = R C (1 - lambda) with the stretch of a neo-Hookean
         column, 1/lambda^2 - lambda = 3 eps.

Four constants are fitted to finite elements: 0.18 (sinking of silicone beams at 0.03 D), 1.55 and 0.4 (sinking with
magnets) and 1.4 (force at D/4). All others are quoted or derived. `magtip validate formulas ladder` tabulates
the errors on other designs. Without a magnet, level magnet equals level tip. Units mm, N, MPa.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from geometry.design import Design

THIN, SPHERE, CENTRE, INCLUSION, LEAST_COLUMN, THINNING = 1.335, 0.75, 0.18, 1.55, 0.4, 1.4
"""Constants above: of a bonded layer and of a sphere, and those of C and of the thinning layer."""


@dataclass(frozen=True, slots=True)
class Terms:
    """The terms that a level includes."""

    tip: bool = False
    magnet: bool = False
    finite: bool = False


@dataclass(frozen=True, slots=True)
class Press:
    """State of a press.

    Attributes
    ----------
    force : N.
    above, below : parts of the depth above and below the magnet's centre, mm; the centre sinks by `below`.
    contact_radius : of a Hertz contact under the force, mm.
    stretch : of the column; 1 at small strain.
    """

    force: float
    above: float
    below: float
    contact_radius: float
    stretch: float


def press(design: Design, depth: float, terms: Terms) -> Press:
    """Solve for the press to a depth of 0 or more, mm.

    >>> from geometry.design import paper
    >>> round(press(paper(), 1.0, Terms(tip=True, magnet=True, finite=True)).force, 2)
    4.08
    """
    dome, column = _dome(design, terms), _column(design, terms)

    def excess(above: float) -> float:
        return above + column(dome(above))[0] - depth

    # to the last digits: a tolerance would show in derivatives by differences
    above = false_position(excess, 0.0, depth, 1e-15 * depth)
    force = dome(above)
    below, stretch = column(force)
    contact = math.cbrt(3 * force * design.R / (4 * effective_modulus(design)))
    return Press(force, above, below, contact, stretch)


def false_position(function: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    """Return the root of a growing function between `low`, where it is below 0, and `high` (Illinois method).

    It ends where the function is at most the tolerance, or the interval has no inner number; at an end that has no
    root beyond it. In plain Python, for SciPy's import would cost more than all formulas together.
    """
    under, over, last = function(low), function(high), 0.0
    middle = high if over <= 0 else low
    while under < 0 < over:
        middle = high - over * (high - low) / (over - under)
        off = function(middle)
        if abs(off) <= tolerance or not low < middle < high:
            break
        if off < 0:
            low, under, over = middle, off, over / 2 if last < 0 else over
        else:
            high, over, under = middle, off, under / 2 if last > 0 else under
        last = off
    return middle


def effective_modulus(design: Design) -> float:
    """E* = E/(1 - nu^2) of silicone on a rigid plate, MPa."""
    return design.E_now / (1 - design.nu**2)


def floor(design: Design, terms: Terms) -> float:
    """Height of the silicone below the rigid part of the beam, mm: H, or H - h/2 with the magnet."""
    return design.H - (design.magnet_height / 2 if terms.magnet else 0.0)


def _dome(design: Design, terms: Terms) -> Callable[[float], float]:
    """Return the force that flattens the dome above the centre, N, as a function of the flattening, mm."""
    R = design.R
    hertz = 4 / 3 * effective_modulus(design) * math.sqrt(R)
    if not terms.tip:
        return lambda above: hertz * above**1.5
    stiffer = SPHERE
    if terms.magnet:
        over = R - design.magnet_height / 2
        share = 1 - (1 + (design.magnet_diameter / 2 / over) ** 2) ** -1.5
        stiffer = (1 - share) * SPHERE + share * THIN * R / over
    layer = THIN * R / stiffer

    def force(above: float) -> float:
        thickness = layer * math.exp(-THINNING * above / R) if terms.finite else layer
        x = math.sqrt(R * above) / thickness
        sphere: float = hertz * above**1.5
        return sphere * (1 + x * (1.133 + x * (1.283 + x * (0.769 + x * 0.0975))))

    return force


def _column(design: Design, terms: Terms) -> Callable[[float], tuple[float, float]]:
    """Return the sinking of the centre, mm, and the stretch of the column, as a function of the force, N."""
    R = design.R
    stiffness = design.E_now * math.pi * R**2
    if not terms.tip:
        return lambda force: (design.H * (force / stiffness), 1.0)
    gap = floor(design, terms) / R
    length = design.H / R + CENTRE * (1 - math.exp(-(gap**2)))
    if terms.magnet:
        length -= INCLUSION * ((design.magnet_diameter / 2) ** 2 * design.magnet_height / R**3) ** (2 / 3)
    effective = R * max(length, LEAST_COLUMN * gap)
    if not terms.finite:
        return lambda force: (effective * (force / stiffness), 1.0)

    def sinking(force: float) -> tuple[float, float]:
        short = neo_hookean_shortening(force / stiffness)
        return effective * short, 1 - short

    return sinking


def neo_hookean_shortening(strain: float) -> float:
    """1 - lambda of a column under the force F = E A strain: 1/lambda^2 - lambda = 3 strain, strain >= 0.

    >>> round(neo_hookean_shortening((1 / 0.8**2 - 0.8) / 3), 12)
    0.2
    """
    # with 1/lambda = 1 + u no digit is lost at small strain; Newton's method approaches the root from above
    u, rest, triple = 2 * strain, 1 - strain, 3 * strain
    for _ in range(200):
        step = (u**3 + 3 * u**2 + 3 * u * rest - triple) / (3 * (1 + u) ** 2 - triple)
        u -= step
        if abs(step) <= 1e-15 * u:
            break
    return u / (1 + u)
