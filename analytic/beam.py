"""The paper's mechanics: force and displacement of the magnet from the motion of the tip, in closed form.

Chathuranga et al., IEEE Sensors Journal 2016, equations (5) to (7). Lengths in mm, E in MPa, forces in N.
"""

from __future__ import annotations

import math

from geometry.design import BadInput, Design
from geometry.scene import Load, Response, check_load

LEVELS = ("paper",)
"""The models that `solve` knows."""


def solve(design: Design, load: Load, level: str = "paper") -> Response:
    """How the sensor answers a load, by a formula.

    Level "paper", with d the depth and delta the sideways motion of the tip, for x and y alike:

        (5)  F_N  = E A d / L
        (6)  F_mu = 3 E I delta / L^3,    I = pi D^4 / 64
        (7)  A    = pi [(D/2)^2 - (D/2 - d)^2] = pi (D d - d^2)

    The magnet, at the distance e = D/2 below the tip at rest and l_t in the deformed beam, moves by

        dz = l_t + d - e    downwards,    dx = delta [(L - d) - l_t] / (L - d)    sideways.

    The paper leaves l_t open. Assumed here, because (5) is a uniform bar: l_t = e (1 - d/L); hence dz = d H/L and
    dx = delta H/L with H = L - D/2. The magnet is taken as silicone, and its tilt as 0, as in the paper.

    Notes
    -----
    (7) is the cross-section of the hemisphere at the plate's level. It reaches the beam's own section at d = D/2,
    and would fall beyond. (5) is a secant law: taken as a tangent, dF = (E A/L) dd, the same stiffness gives
    9.42 N rather than 15.71 N for the paper's sensor at d = 3 mm.

    A plate with friction "none" slides: no sideways force or shift. With "stick" all the shear reaches the tip, even
    at depth 0, where the force (6) needs no press. A Coulomb coefficient mu limits the force (6) to mu F_N; the tip
    then follows by no more than that force bends the beam. A grip shears at d = 0, whatever its height.

    Parameters
    ----------
    load : depth up to D/2.
    level : one of `LEVELS`.

    Returns
    -------
    Response
        Force (F_x, F_y, F_N), F_N positive in compression; shift (dx, dy, -dz); tilt 0; contact radius sqrt(A/pi).

    Raises
    ------
    BadInput
        Unknown level, depth above D/2, or a load that `check_load` refuses.
    """
    if level not in LEVELS:
        raise BadInput(f"level must be one of {', '.join(LEVELS)}; got {level!r}")
    check_load(design, load, magnet="ignored")
    if not load.depth <= design.R:
        raise BadInput(
            f"depth must not exceed the tip radius D/2 = {design.R:g} mm, where the contact area (7) ends; "
            f"got {load.depth:g} mm: press less or take the finite elements"
        )
    area = math.pi * (design.D * load.depth - load.depth**2)
    normal = design.E * area * load.depth / design.L
    stiffness = shear_stiffness(design)
    share = _share_that_sticks(load, normal, stiffness)
    tip_x, tip_y = share * load.shear_x, share * load.shear_y
    ratio = design.H / design.L
    return Response(
        force=(stiffness * tip_x, stiffness * tip_y, normal),
        shift=(ratio * tip_x, ratio * tip_y, -ratio * load.depth),
        tilt=0.0,
        contact_radius=math.sqrt(area / math.pi),
    )


def shear_stiffness(design: Design) -> float:
    """3 E I / L^3 of equation (6), N/mm.

    >>> from geometry.design import paper
    >>> round(shear_stiffness(paper()), 3)
    0.827
    """
    return 3 * design.E * (math.pi * design.D**4 / 64) / design.L**3


def _share_that_sticks(load: Load, normal: float, stiffness: float) -> float:
    """How much of the plate's or the grip's sideways motion the tip follows, 0 to 1."""
    if load.grip is not None or load.friction == "stick":
        return 1.0
    if isinstance(load.friction, str):
        return 0.0
    full = stiffness * math.hypot(load.shear_x, load.shear_y)
    limit = load.friction * normal
    return 1.0 if full <= limit else limit / full
