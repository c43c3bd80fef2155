"""Closed-form mechanics of the beam at five levels, from the paper's own formulas to finite strain.

Each level answers a load with the same `Response`; README.md has the table of levels, with what each is good for.
The terms are in `analytic.press_terms` and `analytic.shear_terms`. `magtip validate formulas ladder`
tabulates the error of each level over the design space. Lengths in mm, E in MPa, forces in N.

The paper: Chathuranga et al., IEEE Sensors Journal 2016, equations (5) to (7).
"""

import math

from analytic import buckling
from analytic.press_terms import Terms, press
from analytic.shear_terms import shear_response
from geometry.design import BadInput, Design
from geometry.loads import Load, Response, check_load

__all__ = ["LEVELS", "solve"]

TERMS = {
    "column": Terms(),
    "tip": Terms(tip=True),
    "magnet": Terms(tip=True, magnet=True),
    "finite": Terms(tip=True, magnet=True, finite=True),
}
LEVELS = ("paper", *TERMS)
"""The levels of `solve`, the paper's first."""
DEEPEST, FARTHEST = 0.25, 0.3
"""Largest depth and shear, over D, at which level finite was calibrated against finite elements."""


def solve(design: Design, load: Load, level: str = "paper") -> Response:
    """Solve for the response of the sensor to a load by closed-form formulas.

    A plate with friction "none" slides: sideways force and shift are zero. With "stick" the contact area follows the
    plate. A grip shears at d = 0.

    Parameters
    ----------
    load : upright plate or grip; `outside` returns the reasons why a level is not calibrated for it.
    level : one of `LEVELS`.

    Raises
    ------
    BadInput
        Unknown level, a tilted plate or another field that formulas do not know, or a load that the level cannot
        carry or `check_load` refuses. The paper's level carries depths up to D/2; the others no Coulomb friction, and
        no shear of a plate that touches nothing.
    """
    if level not in LEVELS:
        raise BadInput(f"level must be one of {', '.join(LEVELS)}; got {level!r}")
    if unknown := load.beyond("depth", "shear_x", "shear_y", "friction", "grip"):
        raise BadInput(f"the formulas cannot model {unknown[0]}: leave it out, or take finite elements")
    terms = TERMS.get(level)
    rigid = terms is not None and terms.magnet and design.shape.has_magnet
    check_load(design, load, magnet="rigid" if rigid else "ignored")
    return _paper(design, load) if terms is None else _above_paper(design, load, terms)


def outside(design: Design, load: Load, level: str) -> str:
    """Reasons why a load lies outside the range for which a level was calibrated; "" if it lies inside."""
    if level == "paper":
        return ""
    D, has_magnet = design.D, design.shape.has_magnet
    shear, rigid = load.shear if load.tip_is_held else 0.0, TERMS[level].magnet and has_magnet
    deepest, farthest = (DEEPEST, FARTHEST) if level == "finite" else (0.06, 0.05)
    within = {
        f"L/D = {design.L / D:.3g} is below 1.1": design.L >= 1.1 * D,
        f"L/D = {design.L / D:.3g} is above 4": design.L <= 4 * D,
        f"nu = {design.nu:g} is below 0.49": design.nu >= 0.49,
        f"the formulas use E and nu only, not the law {design.law}": design.law == "neo-hookean",
        "the level treats the magnet as silicone": TERMS[level].magnet or not has_magnet,
        "the magnet is wider than 0.7 D or higher than 0.5 D": not rigid
        or (design.magnet_diameter <= 0.7 * D and design.magnet_height <= 0.5 * D),
        "less than 0.35 D of silicone lies below the magnet": not rigid
        or design.H - design.magnet_height / 2 >= 0.35 * D,
        f"depth is above {deepest:g} D = {deepest * D:.3g} mm": load.depth <= deepest * D,
        f"shear is above {farthest:g} D = {farthest * D:.3g} mm": shear <= farthest * D,
        f"grip is above D/16 = {D / 16:.3g} mm": load.grip is None or load.grip <= D / 16,
    }
    reasons = [reason for reason, holds in within.items() if not holds]
    limits = [f"outside the range of level {level}: {', '.join(reasons)}"] if reasons else []
    return "; ".join([*limits, *_buckling_remarks(design, load, level)])


def _paper(design: Design, load: Load) -> Response:
    """Level paper, with d the depth and delta the sideways motion of the tip, for x and y alike:

        (5)  F_N  = E A d / L
        (6)  F_mu = 3 E I delta / L^3,    I = pi D^4 / 64
        (7)  A    = pi [(D/2)^2 - (D/2 - d)^2] = pi (D d - d^2)

    The magnet lies e = D/2 below the tip at rest and l_t below it in the deformed beam, and moves by

        dz = l_t + d - e    downwards,    dx = delta [(L - d) - l_t] / (L - d)    sideways.

    The paper does not give l_t. Since (5) is a uniform bar, l_t = e (1 - d/L) is assumed here; hence dz = d H/L and
    dx = delta H/L with H = L - D/2. As in the paper, the magnet counts as silicone and does not tilt.

    Notes
    -----
    (7) is the cross-section of the hemisphere at the height of the plate. It equals the section of the cylinder at
    d = D/2 and would decrease beyond; the contact radius is sqrt(A/pi). (5) is a secant law: integrated as a tangent
    law, dF = (E A/L) dd, it gives 9.42 N rather than 15.71 N for the paper's sensor at d = 3 mm.

    With "stick" the tip follows the whole shear, even at depth 0, since (6) does not depend on the press. A Coulomb
    coefficient mu limits the force (6) to mu F_N, and the tip moves by the deflection under that force.
    The height of a grip has no influence.
    """
    if not load.depth <= design.R:
        raise BadInput(
            f"depth must not exceed the tip radius D/2 = {design.R:g} mm, the limit of contact area (7); got "
            f"{load.depth:g} mm: take a smaller depth, or finite elements"
        )
    area = math.pi * (design.D * load.depth - load.depth**2)
    normal = design.E_now * area * load.depth / design.L
    stiffness = cantilever_stiffness(design)
    # the force that a fully sheared tip needs, and the largest one that friction carries
    full, limit = stiffness * load.shear, math.inf if load.tip_is_held else (load.coulomb or 0.0) * normal
    share = 1.0 if full <= limit else limit / full
    tip_x, tip_y = share * load.shear_x, share * load.shear_y
    ratio = design.H / design.L
    return Response(
        force=(stiffness * tip_x, stiffness * tip_y, normal),
        shift=(ratio * tip_x, ratio * tip_y, -ratio * load.depth),
        tilt=0.0,
        contact_radius=math.sqrt(area / math.pi),
    )


def cantilever_stiffness(design: Design) -> float:
    """3 E I / L^3 of equation (6), N/mm.

    >>> from geometry.design import paper
    >>> round(cantilever_stiffness(paper()), 3)
    0.827
    """
    return 3 * buckling.bending_stiffness(design) / design.L**3


def _above_paper(design: Design, load: Load, terms: Terms) -> Response:
    if load.coulomb is not None:
        raise BadInput(
            f"only level paper models Coulomb friction; got friction {load.coulomb:g}: "
            "choose level paper, or friction none or stick"
        )
    pressed = press(design, load.depth, terms)
    size = load.shear
    if not size or not load.tip_is_held:
        return Response((0.0, 0.0, pressed.force), (0.0, 0.0, -pressed.below), 0.0, pressed.contact_radius)
    if load.grip is None and not load.depth > 0:
        raise BadInput("a shear with friction stick needs a depth above 0 mm: at depth 0 nothing is in contact")
    answer = shear_response(design, load.depth, size, terms, pressed, load.grip)
    x, y = load.shear_x / size, load.shear_y / size
    return Response(
        force=(x * answer.force, y * answer.force, answer.press),
        shift=(x * answer.shift, y * answer.shift, -answer.sinking),
        tilt=x * answer.tilt,
        contact_radius=pressed.contact_radius,
        tilt_y=y * answer.tilt,
    )


def _buckling_remarks(design: Design, load: Load, level: str) -> list[str]:
    """Remarks on buckling: of a sliding tip at Haringx's load, of a sticking tip at the load of its own column."""
    terms = TERMS[level]
    pressed = press(design, load.depth, terms)
    if load.grip is not None or not load.depth > 0:
        return []
    if load.friction == "stick":
        if not terms.tip:
            return []
        answer = shear_response(design, load.depth, load.shear, terms, pressed)
        return [
            *([] if answer.stable else ["the beam would buckle sideways even if the tip stuck to the plate"]),
            *([] if answer.press > 0 else ["the tip leans so far that the press force vanishes"]),
        ]
    critical = buckling.haringx(design)
    if design.L < 2 * design.D or pressed.force <= critical:
        return []
    at = f"at about {critical:.3g} N (Haringx)"
    return [f"a beam whose tip slides freely buckles sideways {at}: this result is for the upright beam"]
