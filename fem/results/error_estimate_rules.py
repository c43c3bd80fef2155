"""Rules for the relative error of an answer, from its relative difference to that of a coarser mesh.

The constants come from the study `magtip accuracy --out results/accuracy`, which compares solutions of twelve designs
at levels quick, standard and fine with much finer meshes (1766 states in results/accuracy/accuracy.csv). m, p and q
are chosen so that half of the differences in the study exceed the usual one; c and s are about the least that cover
95 % of the true errors. For glued and gripped shears, the presses before them and small shears, p, q and s are those
of some round values with which most estimates are sharp, and c covers 97 %. Constants from other states, or copied
from another rule, are listed beside the table.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from geometry.design import Design
from geometry.loads import Magnet

LoadCase = Literal[
    "press",
    "deep",
    "pressed",
    "stick",
    "far",
    "grip",
    "friction",
    "tilted press",
    "tilted stick",
    "tilted friction",
    "solid",
    "solid press",
]
TangentQuantity = Literal[
    "critical depth", "critical force", "stiffness", "shift", "tilt", "frequency", "pressed frequency"
]

VibrationQuantity = Literal["force", "shift", "reading", "base"]

LEAST_SHARE = 0.2
"""Lower bound of the actual difference, over the usual one: two meshes may agree by chance. Of the 2920 differences
in the study 11 % are smaller."""


@dataclass(frozen=True, slots=True)
class ErrorRule:
    """Relative error of one quantity from its relative difference d to the coarser mesh.

    With the edge length h of the mesh, and a base b that measures how hard the state is to resolve (see the tables),

        usual difference    u = m (h / D)^p / b^q
        expected error      c u^(1 - s) max(d, LEAST_SHARE u)^s

    Where a contact ends between two integration points is random, which causes errors of either sign. u is therefore
    often a better measure of the error than d, and s is small.

    Attributes
    ----------
    m : usual difference at an edge length of D and a base of 1.
    p : order with which the usual difference decreases with the edge length.
    q : power of the base with which it decreases; negative where it grows.
    c : expected error over the usual difference, where the actual difference is the usual one.
    s : weight of the actual difference in the expected error, as an exponent: from 0 (only u) to 1 (only d).
    """

    m: float
    p: float
    q: float
    c: float
    s: float

    def usual(self, edge: float, base: float) -> float:
        """Return the usual difference u at an edge length over D."""
        return self.m * math.pow(edge, self.p) / math.pow(base, self.q)

    def expected(self, usual: float, difference: float) -> float:
        """Return the expected error from the usual difference u and the actual difference d.

        >>> ErrorRule(m=1.0, p=2.0, q=0.0, c=2.0, s=0.5).expected(usual=0.25, difference=1.0)
        1.0
        """
        return self.c * math.pow(usual, 1 - self.s) * math.pow(max(difference, LEAST_SHARE * usual), self.s)


@dataclass(frozen=True, slots=True)
class ResponseRules:
    """Rules of one load case: for the vectors of force, shift and tilt, and for the force along the shear alone.

    The base is the contact radius over D, at least LEAST_RADIUS. For the force along the shear it is the share of
    that component in the whole force: slip depends on the normal force, beside which the component may be small.
    """

    force: ErrorRule
    shift: ErrorRule
    tilt: ErrorRule
    sideways: ErrorRule | None = None


_TILTED_PRESS = ResponseRules(
    force=ErrorRule(m=0.08, p=1.5, q=0.0, c=1.7, s=0.3),
    shift=ErrorRule(m=0.09, p=1.5, q=0.0, c=1.6, s=0.3),
    tilt=ErrorRule(m=0.25, p=1.5, q=0.0, c=1.5, s=0.3),
)
_TILTED_STICK = ResponseRules(
    force=ErrorRule(m=0.08, p=1.5, q=0.0, c=3.4, s=0.3),
    shift=ErrorRule(m=0.15, p=1.5, q=0.0, c=3.2, s=0.3),
    tilt=ErrorRule(m=0.5, p=1.5, q=0.0, c=2.4, s=0.3),
    sideways=ErrorRule(m=0.016, p=1.5, q=1.0, c=5.0, s=0.3),
)
_TILTED_FRICTION = ResponseRules(
    force=ErrorRule(m=0.08, p=1.5, q=0.0, c=1.7, s=0.3),
    shift=ErrorRule(m=0.15, p=1.5, q=0.0, c=1.6, s=0.3),
    tilt=ErrorRule(m=0.5, p=1.5, q=0.0, c=1.2, s=0.3),
    sideways=ErrorRule(m=0.016, p=1.5, q=1.0, c=3.0, s=0.3),
)
RESPONSE_RULES: dict[tuple[LoadCase, Magnet], ResponseRules] = {
    ("press", "rigid"): ResponseRules(
        force=ErrorRule(m=0.0278, p=1.75, q=0.75, c=1.95, s=0.0),
        shift=ErrorRule(m=0.00959, p=1.75, q=1.25, c=1.95, s=0.1),
        tilt=ErrorRule(m=0.00959, p=1.75, q=1.25, c=1.95, s=0.1),
    ),
    ("press", "ignored"): ResponseRules(
        force=ErrorRule(m=0.00607, p=1.75, q=1.5, c=1.85, s=0.3),
        shift=ErrorRule(m=0.00919, p=2.0, q=1.5, c=2.3, s=0.1),
        tilt=ErrorRule(m=0.00919, p=2.0, q=1.5, c=2.3, s=0.1),
    ),
    ("deep", "rigid"): ResponseRules(
        force=ErrorRule(m=0.0377, p=1.25, q=-1.0, c=2.48, s=0.0),
        shift=ErrorRule(m=0.0335, p=1.75, q=-0.5, c=2.32, s=0.2),
        tilt=ErrorRule(m=0.0335, p=1.75, q=-0.5, c=2.32, s=0.2),
    ),
    ("deep", "ignored"): ResponseRules(
        force=ErrorRule(m=0.00938, p=1.25, q=0.0, c=2.47, s=0.1),
        shift=ErrorRule(m=0.00842, p=1.75, q=0.5, c=2.08, s=0.3),
        tilt=ErrorRule(m=0.00842, p=1.75, q=0.5, c=2.08, s=0.3),
    ),
    ("pressed", "rigid"): ResponseRules(
        force=ErrorRule(m=0.000256, p=0.5, q=0.0, c=3.82, s=0.0),
        shift=ErrorRule(m=0.000216, p=0.5, q=0.0, c=3.79, s=0.3),
        tilt=ErrorRule(m=0.000216, p=0.5, q=0.0, c=3.79, s=0.3),
    ),
    ("pressed", "ignored"): ResponseRules(
        force=ErrorRule(m=0.00591, p=1.5, q=0.0, c=1.5, s=0.0),
        shift=ErrorRule(m=0.0512, p=2.0, q=0.0, c=2.24, s=0.0),
        tilt=ErrorRule(m=0.0512, p=2.0, q=0.0, c=2.24, s=0.0),
    ),
    ("stick", "rigid"): ResponseRules(
        force=ErrorRule(m=0.0208, p=0.5, q=-1.5, c=1.66, s=0.3),
        shift=ErrorRule(m=0.0202, p=1.0, q=-1.0, c=1.25, s=0.3),
        tilt=ErrorRule(m=0.0917, p=1.0, q=-1.5, c=0.901, s=0.4),
        sideways=ErrorRule(m=0.0127, p=0.5, q=0.0, c=0.977, s=0.5),
    ),
    ("stick", "ignored"): ResponseRules(
        force=ErrorRule(m=0.0805, p=1.5, q=-1.0, c=1.75, s=0.0),
        shift=ErrorRule(m=0.738, p=2.0, q=-1.5, c=1.49, s=0.1),
        tilt=ErrorRule(m=0.0943, p=2.0, q=0.0, c=0.753, s=0.0),
        sideways=ErrorRule(m=0.0119, p=0.5, q=0.0, c=1.34, s=0.1),
    ),
    ("far", "rigid"): ResponseRules(
        force=ErrorRule(m=0.0529, p=0.5, q=0.0, c=0.713, s=0.4),
        shift=ErrorRule(m=0.0615, p=1.5, q=0.0, c=0.691, s=0.1),
        tilt=ErrorRule(m=0.285, p=2.0, q=0.0, c=1.23, s=0.4),
        sideways=ErrorRule(m=0.788, p=2.0, q=0.0, c=0.77, s=0.1),
    ),
    ("far", "ignored"): ResponseRules(
        force=ErrorRule(m=0.0529, p=0.5, q=0.0, c=0.713, s=0.4),
        shift=ErrorRule(m=0.0615, p=1.5, q=0.0, c=0.691, s=0.1),
        tilt=ErrorRule(m=0.285, p=2.0, q=0.0, c=1.23, s=0.4),
        sideways=ErrorRule(m=0.788, p=2.0, q=0.0, c=0.77, s=0.1),
    ),
    ("grip", "rigid"): ResponseRules(
        force=ErrorRule(m=0.0078, p=1.0, q=0.0, c=1.27, s=0.0),
        shift=ErrorRule(m=0.00194, p=1.0, q=0.0, c=2.2, s=0.2),
        tilt=ErrorRule(m=0.00113, p=1.0, q=0.0, c=2.76, s=0.0),
        sideways=ErrorRule(m=0.0078, p=1.0, q=0.0, c=1.27, s=0.0),
    ),
    ("grip", "ignored"): ResponseRules(
        force=ErrorRule(m=0.0226, p=1.5, q=0.0, c=1.25, s=0.1),
        shift=ErrorRule(m=0.00175, p=1.0, q=0.0, c=2.14, s=0.1),
        tilt=ErrorRule(m=0.019, p=2.0, q=0.0, c=2.02, s=0.6),
        sideways=ErrorRule(m=0.0226, p=1.5, q=0.0, c=1.25, s=0.1),
    ),
    ("friction", "rigid"): ResponseRules(
        force=ErrorRule(m=0.0545, p=1.5, q=0.0, c=1.22, s=0.3),
        shift=ErrorRule(m=0.00558, p=0.5, q=0.0, c=1.59, s=0.2),
        tilt=ErrorRule(m=0.118, p=1.5, q=0.0, c=0.824, s=0.1),
        sideways=ErrorRule(m=0.285, p=2.0, q=0.5, c=1.02, s=0.1),
    ),
    ("friction", "ignored"): ResponseRules(
        force=ErrorRule(m=0.0545, p=1.5, q=0.0, c=1.22, s=0.3),
        shift=ErrorRule(m=0.00558, p=0.5, q=0.0, c=1.59, s=0.2),
        tilt=ErrorRule(m=0.118, p=1.5, q=0.0, c=0.824, s=0.1),
        sideways=ErrorRule(m=0.285, p=2.0, q=0.5, c=1.02, s=0.1),
    ),
    ("tilted press", "rigid"): _TILTED_PRESS,
    ("tilted press", "ignored"): _TILTED_PRESS,
    ("tilted stick", "rigid"): _TILTED_STICK,
    ("tilted stick", "ignored"): _TILTED_STICK,
    ("tilted friction", "rigid"): _TILTED_FRICTION,
    ("tilted friction", "ignored"): _TILTED_FRICTION,
    ("solid", "rigid"): ResponseRules(
        force=ErrorRule(m=0.0168, p=1.0, q=0.0, c=3.4, s=0.1),
        shift=ErrorRule(m=0.0219, p=1.0, q=0.0, c=2.9, s=0.1),
        tilt=ErrorRule(m=0.0279, p=1.0, q=0.0, c=1.85, s=0.1),
        sideways=ErrorRule(m=0.0437, p=1.0, q=0.0, c=1.85, s=0.1),
    ),
    ("solid", "ignored"): ResponseRules(
        force=ErrorRule(m=0.00993, p=1.0, q=0.0, c=3.4, s=0.1),
        shift=ErrorRule(m=0.0193, p=1.0, q=0.0, c=1.4, s=0.1),
        tilt=ErrorRule(m=0.0121, p=1.0, q=0.0, c=2.5, s=0.0),
        sideways=ErrorRule(m=0.0332, p=1.0, q=0.0, c=1.26, s=0.1),
    ),
    ("solid press", "rigid"): ResponseRules(
        force=ErrorRule(m=0.045, p=1.0, q=0.7, c=0.9, s=0.1),
        shift=ErrorRule(m=0.188, p=1.0, q=0.0, c=1.16, s=0.1),
        tilt=ErrorRule(m=0.0279, p=1.0, q=0.0, c=1.85, s=0.1),
    ),
    ("solid press", "ignored"): ResponseRules(
        force=ErrorRule(m=0.025, p=1.0, q=0.0, c=4.2, s=0.1),
        shift=ErrorRule(m=0.053, p=1.0, q=0.0, c=2.0, s=0.1),
        tilt=ErrorRule(m=0.0121, p=1.0, q=0.0, c=2.5, s=0.0),
    ),
}
"""Rules by load case (`fem.results.error_estimates.load_case`) and by whether the magnet is rigid.

On sections: "press" and "deep" are frictionless presses above and below the first depth of `press_limits`. "stick"
and "far" are shears of a glued plate up to STICK_SHEAR and beyond. "pressed" is a press on the path of such a shear,
whose mesh is refined where the contact ends. "grip" is a shear of a grip, whose force is all along the shear.
"friction" is any state with Coulomb friction, where the coarser solve also takes longer load steps. "solid" are
tetrahedra refined where the contact ends, "solid press" those that are not, as in an upright press.

"tilted press", "tilted stick" and "tilted friction" are presses and shears, glued or with Coulomb friction, of a
tilted plate on sections. They are not in the study: their constants come from solves of the twelve designs,
alternately with a rigid magnet and without, under tilts of 2 to 20 degrees at depths of about D/10. Presses at quick
and standard were compared with two to three orders more on a mesh with edges of 0.065 D, and all three at quick with
tetrahedra (`magtip crosscheck`).

Upright presses have no tilt; for presses, the rule of the shift is used for it. "friction" and "far" were determined
with a rigid magnet and are also used for the beam without. Tetrahedra with Coulomb friction are not in the study; for
the force along the shear they use the rule of "friction".

Two meshes of tetrahedra agree by chance more often than other meshes, so d is a weak indicator: s is small, and c is
such that the estimate holds for each mesh with each coarser one. The rules of "solid" come from all nine pairs of
three meshes and three coarser ones in each of 24 states (designs 0 and 3, levels quick and standard), with a margin
of 4 to 17 %; they were checked at quick on shears to 0.3 D and after the deepest presses. The rules of "solid press"
come from presses of seven designs at quick to three depths each, and from some on several meshes, at standard, or
deeper; that of the shift was raised by 16 % for the states of the study. The rules of "solid" for the force along the
shear come from those 24 states with one coarser mesh each, and a margin of 15 %. Designs 2, 3 and 7, with large
magnets, determine the power of the contact radius."""

TANGENT_RULES: dict[tuple[TangentQuantity, Magnet], ErrorRule] = {
    ("critical depth", "rigid"): ErrorRule(m=0.217, p=0.5, q=-2.0, c=1.92, s=0.0),
    ("critical depth", "ignored"): ErrorRule(m=0.217, p=0.5, q=-2.0, c=3.45, s=0.0),
    ("critical force", "rigid"): ErrorRule(m=1.77, p=0.5, q=-3.0, c=1.82, s=0.2),
    ("critical force", "ignored"): ErrorRule(m=1.77, p=0.5, q=-3.0, c=3.11, s=0.2),
    ("stiffness", "rigid"): ErrorRule(m=0.194, p=2.0, q=-1.0, c=7.49, s=0.4),
    ("stiffness", "ignored"): ErrorRule(m=0.0699, p=1.5, q=-0.5, c=5.28, s=0.0),
    ("shift", "rigid"): ErrorRule(m=0.0159, p=1.0, q=-1.5, c=1.96, s=0.2),
    ("shift", "ignored"): ErrorRule(m=0.0905, p=2.0, q=-1.5, c=5.88, s=0.5),
    ("tilt", "rigid"): ErrorRule(m=0.00189, p=0.5, q=-1.0, c=3.06, s=0.2),
    ("tilt", "ignored"): ErrorRule(m=0.645, p=2.0, q=-1.5, c=1.67, s=0.1),
    ("frequency", "rigid"): ErrorRule(m=0.000158, p=0.5, q=0.0, c=6.05, s=0.0),
    ("frequency", "ignored"): ErrorRule(m=0.000163, p=0.5, q=0.0, c=3.8, s=0.1),
    ("pressed frequency", "rigid"): ErrorRule(m=0.0073, p=1.5, q=-0.5, c=5.2, s=0.3),
    ("pressed frequency", "ignored"): ErrorRule(m=0.00273, p=1.0, q=0.0, c=5.47, s=0.1),
}
"""Rules for single numbers computed from the tangent about a press.

These are critical depth and force, a small shear of a glued plate, and frequencies of the unpressed and of the
pressed sensor. The base of a critical state is its depth over D, at least LEAST_DEPTH. The base of a small shear is
the contact radius over D, at least LEAST_RADIUS. The base of a frequency is 1 / (omega D (rho / E)^(1/2)). The rules
come from all such states of the study: the twelve designs with their magnet, the six even-numbered ones without. The
study has no guided tips."""

VIBRATION_RULES: dict[tuple[VibrationQuantity, str, Literal["press", "shear"]], ErrorRule] = {
    ("force", "z", "press"): ErrorRule(m=0.00951, p=1.0, q=0.0, c=4.4, s=0.1),
    ("force", "z", "shear"): ErrorRule(m=0.0126, p=0.5, q=0.0, c=1.99, s=0.1),
    ("force", "x", "press"): ErrorRule(m=0.0699, p=2.0, q=0.0, c=5.26, s=0.1),
    ("force", "x", "shear"): ErrorRule(m=0.0396, p=1.0, q=0.0, c=1.55, s=0.1),
    ("shift", "z", "press"): ErrorRule(m=0.000364, p=0.5, q=0.0, c=8.36, s=0.4),
    ("shift", "z", "shear"): ErrorRule(m=0.00052, p=0.5, q=0.0, c=4.08, s=0.4),
    ("shift", "x", "press"): ErrorRule(m=0.047, p=2.0, q=0.0, c=6.86, s=0.2),
    ("shift", "x", "shear"): ErrorRule(m=0.0887, p=1.5, q=0.0, c=1.59, s=0.0),
    ("reading", "z", "press"): ErrorRule(m=0.000367, p=0.5, q=0.0, c=8.27, s=0.4),
    ("reading", "z", "shear"): ErrorRule(m=0.000709, p=0.5, q=0.0, c=3.91, s=0.5),
    ("reading", "x", "press"): ErrorRule(m=0.047, p=2.0, q=0.0, c=10.3, s=0.4),
    ("reading", "x", "shear"): ErrorRule(m=0.137, p=2.0, q=0.0, c=7.82, s=0.2),
    ("base", "z", "press"): ErrorRule(m=0.000168, p=0.5, q=0.0, c=8.23, s=0.3),
    ("base", "x", "press"): ErrorRule(m=0.000416, p=0.5, q=0.0, c=2.61, s=0.1),
}
"""Rules for the gains of a vibration, by motion and by whether the state at rest is sheared, tilted or held.

"force" is the force over the motion, "shift" and "reading" the magnet's shift and the reading of an element over the
force, and "base" the shift over that of the base of the free sensor. The errors are those of a gain away from
resonances; `studies.simulation.vibration_estimates` has the factor by which resonances amplify them. The constants
come from `python -m studies.validation.vibration_errors results/vibration` (the twelve designs with a rigid magnet:
frictionless and glued presses, glued shears, free), such that 95 % of the errors over all frequencies are at most the
estimates. Tilted plates, Coulomb friction, grips and beams without a rigid magnet are not in it, and use them too."""

LEAST_RADIUS = 0.06
"""Contact radius over D below which the usual difference no longer grows. The lightest presses of the study have
0.07; below, the mesh is graded to the contact (`fem.solve.depth_ranges`)."""
LEAST_DEPTH = 0.15
"""Critical depth over D below which the usual difference no longer decreases: slender beams buckle at smaller depths
than the study has, whose smallest is 0.12."""
SURE_SHARE = 0.25
"""Least estimated error over the actual difference: a mesh that converges with order 4, faster than the meshes here,
has the error d / (COARSER^4 - 1) = 0.25 d."""
UNUSUAL = 8.0
"""Actual over usual difference above which a state is unlike those of the study, where 1.5 % of 2920 differences are
larger. The excess counts as error."""

PRESS_DEPTH, PRESS_SHARE = 0.25, 0.3
"""Largest depth of "press", over D and over the silicone above the magnet (or the base), whichever depth is less. Up
to this depth the error decreases as the contact grows (q > 0); beyond, it hardly decreases, or grows."""
DEEP_RATIO, DEEP_SHARE = 3.3, 0.45
"""Largest depth of "deep", over that of "press" and over the silicone on the axis: the deepest presses of the
study."""
STICK_SHEAR, FAR_SHEAR, FRICTION_SHEAR = 0.15, 0.6, 0.25
"""Largest shears over D of "stick" (and "grip"), "far" and "friction": the largest of the study."""
ON_LIMIT = 1.001
"""Load over such a limit up to which it counts as on the limit: the loads of the study are rounded to four digits."""
ORDER_POWER = 5.0
"""Power of the number of orders with which errors under a tilted plate decrease, for a load that has fewer orders
than it needs (`fem.solve.depth_ranges.orders_needed`). On the paper's sensor under 40 degrees at D/40, which needs
11, forces with 4, 5, 6 and 8 orders were off by 22, 13, 7 and about 1 %."""
DEPTH_POWER = 1.5
"""Power of the depth with which errors are expected to grow beyond the deepest presses of the study. At four times
the largest depth of "press" (`magtip solve paper --depth 3.6`) the force at level standard differs from that at fine
by five times what its rule expects, and 4^1.5 = 8. Beyond the largest shears errors are expected to grow in
proportion to the shear."""


def press_limits(design: Design, magnet: Magnet) -> tuple[float, float]:
    """Return the largest depths of the rules "press" and "deep", mm.

    >>> from geometry.design import paper
    >>> [round(depth, 9) for depth in press_limits(paper(), "rigid")]
    [0.9, 2.97]
    """
    rigid = magnet == "rigid"
    first = min(PRESS_DEPTH * design.D, PRESS_SHARE * (design.R - design.magnet_height / 2 if rigid else design.L))
    silicone = design.L - design.magnet_height if rigid else design.L
    return first, min(DEEP_RATIO * first, DEEP_SHARE * silicone)
