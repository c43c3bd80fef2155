"""Shear of the pressed beam, whose contact area is glued to the plate, level by level.

Level column is Timoshenko's cantilever of length L with a free tip, delta = Q [L^3/(3 E I) + L/S], S = k G A,
k = 6 (1 + nu)/(7 + 6 nu) (Cowper 1966); all other levels are a column with shear deformation under the
press force P, whose tip is restrained against rotation. Along the column (0 to l), with the rotation psi of the
section and its shear gamma = (Q + P psi)/S (Haringx 1948), q^2 = P f/B, f = 1 + P/S:

    w' = psi + gamma,    B psi'' = -Q - P w',    psi(0) = w(0) = 0,
    psi = -Q (f/B) s^2 C(q s) + beta s sin(q s)/(q s),    C(x) = (1 - cos x)/x^2.

Above the column all is rigid and rotates by omega = psi + gamma/2, up to the contact area of radius a. Its
compliance is Mindlin's 1/k_t = (2 - nu)/(8 G a) plus 0.1/(G R) for the shear of the dome, its rotational stiffness
k_r = 8 G a^3/(3 (1 - nu)):

    delta = w + (e + R - a^2/(5 R)) omega + Q/k_t,    B psi'(l) = -k_r omega + Q (e + R - above) + P (delta - w).

a^2/(5 R) is the mean height of the pole above the contact area (weighted with Hertz's pressure); e is the height from
the end of the column to the dome's centre: 0, or with a rigid magnet h/2. The magnet's shift is w + e omega. In the
sheared column a magnet of height h and diameter 2a rotates like a rigid spheroid of aspect ratio r = h/(2a) in an
incompressible medium (Jeffery 1922): tilt = omega + gamma/2 (r^2 - 1)/(r^2 + 1); without a magnet, tilt = omega.

Level finite uses the column as the press has deformed it, with stretch lambda: B = E I (lambda^2 + 2/lambda) /
(3 lambda^2) and S = k G A lambda, from a neo-Hookean column of the remaining length. An inclined tip is lower by
kappa delta^2/2 with kappa = -dk/dP (k = Q/delta; from the energy), so that the press force decreases to that of the
depth d - kappa delta^2/2. The dome rolls on the plate: a increases by |omega| R/4.
The constants 0.1 and 1/4 are fitted to the shear force of finite elements at small shear and at 0.3 D; `magtip
ladder` tabulates the errors on other designs. Level finite is worst for a light press with a large shear: at depth
0.06 D, shear 0.3 D and L/D near 1.1 it underestimates the press force, and overestimates the sinking of the magnet by
up to a half. Units mm, N, MPa, rad.
"""

import functools
import math
from dataclasses import dataclass, replace

from analytic import buckling
from analytic.press_terms import Press, Terms, false_position, floor, press
from geometry.design import Design

DOME, ROLLS, PATCH = 0.1, 0.25, 1 / 5
"""Constants above: shear compliance of the dome times G R, growth of a over |omega| R, and the 1/5 of a^2/(5 R)."""


@dataclass(frozen=True, slots=True)
class ShearState:
    """Response to a shear: force along it and press force (N), shift, sinking (mm) and tilt (rad) of the magnet.

    `stable` tells whether the press force is below the buckling load of the column with a guided tip.
    """

    force: float
    press: float
    shift: float
    sinking: float
    tilt: float
    stable: bool = True


@dataclass(frozen=True, slots=True)
class Column:
    """A column under shear and press with its tip: lengths, stiffnesses and contact radius (`patch`)."""

    length: float
    offset: float
    bending: float
    shearing: float
    arm: float
    reach: float
    patch: float
    glued: bool


@dataclass(frozen=True, slots=True)
class Bent:
    """Response per mm of shear: force, deflection w and rotation omega at the end of the column, gamma, beta."""

    force: float
    w: float
    omega: float
    gamma: float
    beta: float
    stable: bool


def _cantilever(design: Design, shear: float, pressed: Press) -> ShearState:
    L, H, B, S = design.L, design.H, buckling.bending_stiffness(design), buckling.shear_stiffness(design)
    Q = shear * buckling.sideways_stiffness(design)
    shift = Q * (H**2 * (3 * L - H) / (6 * B) + H / S)
    turn = Q * (H * (2 * L - H) / (2 * B) + 1 / (2 * S))
    return ShearState(Q, pressed.force, shift, pressed.below, turn)


def shear_response(
    design: Design, depth: float, shear: float, terms: Terms, pressed: Press, grip: float | None = None
) -> ShearState:
    """Solve for a shear at a depth, whose press is `pressed`, or of a grip of the topmost part of the tip; in mm."""
    if not terms.tip:
        return _cantilever(design, shear, pressed)
    column = _column(design, pressed, terms, grip)
    if terms.finite and grip is None:
        column, bent, P, sink = _inclined(design, column, depth, shear, pressed, terms)
    else:
        bent, P, sink = bend(design, column, pressed.force), pressed.force, pressed.below
    ratio = design.magnet_height / design.magnet_diameter if terms.magnet and design.magnet_diameter else 1.0
    tilt = bent.omega + bent.gamma / 2 * (ratio**2 - 1) / (ratio**2 + 1)
    shift = bent.w + column.offset * bent.omega
    return ShearState(bent.force * shear, P, shift * shear, sink, tilt * shear, bent.stable)


def _inclined(
    design: Design, column: Column, depth: float, shear: float, pressed: Press, terms: Terms
) -> tuple[Column, Bent, float, float]:
    """The column with the rolled contact, its response, the remaining press force, and the sinking of the magnet."""

    @functools.cache
    def follow(P: float) -> tuple[Column, Bent, Press]:
        bent, now = bend(design, column, P), column
        for _ in range(4):
            now = replace(column, patch=column.patch + ROLLS * abs(bent.omega * shear) * design.R)
            bent = bend(design, now, P)
        # dk/dP by a difference over a small part of the press force
        more = 1e-4 * pressed.force
        lean = max((bent.force - bend(design, now, P + more).force) / more, 0.0) * shear**2 / 2
        return now, bent, press(design, max(depth - lean, 0.0), terms)

    # the press force P must equal that of the depth which P itself leaves; it is at most that of the upright beam
    P = false_position(lambda P: P - follow(P)[2].force, 0.0, pressed.force, 1e-10 * pressed.force)
    now, bent, there = follow(P)
    return now, bent, P, there.below + _lowering(now, bent, P, shear)


def bend(design: Design, column: Column, P: float) -> Bent:
    """Response of the column to a shear of 1 mm under the press force P."""
    G, R = design.E_now / (2 * (1 + design.nu)), design.R
    B, S, s = column.bending, column.shearing, column.length
    f = 1 + P / S
    x = s * math.sqrt(P * f / B)
    sine, c, t = trigonometric_ratios(x)
    give = (2 - design.nu) / (8 * G * column.patch) + DOME / (G * R)
    hold = 8 * G * column.patch**3 / (3 * (1 - design.nu)) if column.glued else 0.0
    # psi, w and omega are linear in Q and beta: pairs hold their factors
    psi = (-f / B * s**2 * c, s * sine)
    w = (-(f**2) / B * s**3 * t + s / S, f * s**2 * c)
    omega = tuple(turn * (1 + P / (2 * S)) + sheared for turn, sheared in zip(psi, (1 / (2 * S), 0.0), strict=True))
    a = [shift + column.reach * turn for shift, turn in zip(w, omega, strict=True)]
    a[0] += give
    b = [hold * turn + P * shift for shift, turn in zip(w, omega, strict=True)]
    b[0] -= f * s * sine + column.arm
    b[1] += B * math.cos(x)
    # a . (Q, beta) = 1 and b . (Q, beta) = P
    determinant = a[0] * b[1] - a[1] * b[0]
    Q, beta = (b[1] - P * a[1]) / determinant, (P * a[0] - b[0]) / determinant
    turned = psi[0] * Q + psi[1] * beta
    return Bent(
        force=Q,
        w=w[0] * Q + w[1] * beta,
        omega=omega[0] * Q + omega[1] * beta,
        gamma=(Q + P * turned) / S,
        beta=beta,
        stable=determinant > 0 and x < 2 * math.pi,
    )


def softening(design: Design) -> float:
    """Return -dk/dP at P = 0, 1/mm: how a press lowers the stiffness against a shear, by level finite at D/8."""
    terms = Terms(tip=True, magnet=True, finite=True)
    pressed = press(design, design.D / 8, terms)
    column, more = _column(design, pressed, terms, None), 1e-4 * pressed.force
    return (bend(design, column, 0.0).force - bend(design, column, more).force) / more


def trigonometric_ratios(x: float) -> tuple[float, float, float]:
    """sin(x)/x, (1 - cos x)/x^2 and (x - sin x)/x^3; near 0 by their series."""
    if x < 0.03:
        return 1 - x**2 / 6 + x**4 / 120, 0.5 - x**2 / 24 + x**4 / 720, 1 / 6 - x**2 / 120 + x**4 / 5040
    return math.sin(x) / x, 2 * (math.sin(x / 2) / x) ** 2, (x - math.sin(x)) / x**3


def _column(design: Design, pressed: Press, terms: Terms, grip: float | None) -> Column:
    R, stretch = design.R, pressed.stretch
    length, offset = floor(design, terms), design.H - floor(design, terms)
    patch, arm, reach = pressed.contact_radius, R - pressed.above, R - PATCH * pressed.contact_radius**2 / R
    if grip is not None:
        held = min(grip, R)
        patch, arm, reach = math.sqrt(held * (2 * R - held)), R - grip / 2, R - grip / 2
    return Column(
        length=length - (pressed.below if terms.finite else 0.0),
        offset=offset,
        bending=buckling.bending_stiffness(design) * (stretch**2 + 2 / stretch) / (3 * stretch**2),
        shearing=buckling.shear_stiffness(design) * stretch,
        arm=arm + offset,
        reach=reach + offset,
        patch=patch,
        glued=grip is None,
    )


def _lowering(column: Column, bent: Bent, P: float, shear: float) -> float:
    """Lowering of the magnet by the inclination of the column: integral of psi w' - psi^2/2, by Simpson's rule."""
    S, B = column.shearing, column.bending
    f, pieces = 1 + P / S, 8
    total = 0.0
    for i in range(pieces + 1):
        s = column.length * i / pieces
        sine, c, _ = trigonometric_ratios(s * math.sqrt(P * f / B))
        psi = shear * (-bent.force * f / B * s**2 * c + bent.beta * s * sine)
        slope = psi * f + shear * bent.force / S
        total += (psi * slope - psi**2 / 2) * (1 if i in (0, pieces) else 4 if i % 2 else 2)
    return total * column.length / (3 * pieces) + column.offset * (bent.omega * shear) ** 2 / 2
