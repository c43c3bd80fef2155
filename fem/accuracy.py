"""Accuracy levels, and the rules by which the error of a solution is estimated from that of a coarser companion.

The numbers here are set with `magtip accuracy`, which holds levels and estimates against much finer meshes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from geometry.design import Design
from geometry.loads import Load, Magnet, Response


@dataclass(frozen=True, slots=True)
class Accuracy:
    """The finite elements' only knob.

    Attributes
    ----------
    name : quick, standard or fine.
    section_size, solid_size : edge lengths of the section and the tetrahedral mesh, in units of D.
    section_patch, solid_patch : edge lengths where the glued or gripped patch of skin ends (under a tilted plate at
        the tip); with coarse ones the tip shears too stiffly.
    harmonics : number of harmonics of the harmonic model.
    rub : length of the steps with Coulomb friction over their usual one.
    """

    name: str
    section_size: float
    solid_size: float
    section_patch: float
    solid_patch: float
    harmonics: int
    rub: float = 1.0


QUICK = Accuracy("quick", 0.16, 0.16, 0.012, 0.03, 2)
STANDARD = Accuracy("standard", 0.09, 0.14, 0.006, 0.015, 3)
FINE = Accuracy("fine", 0.045, 0.10, 0.002, 0.01, 4)
LEVELS = {level.name: level for level in (QUICK, STANDARD, FINE)}

Rule = tuple[float, float, float, float, float]
"""How the relative error of one quantity is estimated, see RULES."""

RULES: dict[tuple[str, Magnet], tuple[Rule, ...]] = {
    ("press", "rigid"): (
        (0.0278, 1.75, 0.75, 1.95, 0),
        (0.00959, 1.75, 1.25, 1.95, 0.1),
        (0.00959, 1.75, 1.25, 1.95, 0.1),
    ),
    ("press", "ignored"): (
        (0.00607, 1.75, 1.5, 1.85, 0.3),
        (0.00919, 2, 1.5, 2.3, 0.1),
        (0.00919, 2, 1.5, 2.3, 0.1),
    ),
    ("deep", "rigid"): (
        (0.0377, 1.25, -1, 2.48, 0),
        (0.0335, 1.75, -0.5, 2.32, 0.2),
        (0.0335, 1.75, -0.5, 2.32, 0.2),
    ),
    ("deep", "ignored"): (
        (0.00938, 1.25, 0, 2.47, 0.1),
        (0.00842, 1.75, 0.5, 2.08, 0.3),
        (0.00842, 1.75, 0.5, 2.08, 0.3),
    ),
    ("pressed", "rigid"): (
        (0.000251, 0.5, 0, 3.43, 0.4),
        (0.000263, 0.5, 0, 2.43, 0.2),
        (0.000263, 0.5, 0, 2.43, 0.2),
    ),
    ("pressed", "ignored"): ((0.00016, 0.5, 0, 1.88, 0.2), (0.0844, 2.5, 0, 1.45, 0.2), (0.0844, 2.5, 0, 1.45, 0.2)),
    ("stick", "rigid"): ((1.24, 2, -2, 2.08, 0.1), (0.0157, 0.75, -1, 2.16, 0.3), (0.0571, 1.5, -0.5, 1.17, 0.2)),
    ("stick", "ignored"): ((0.00823, 0.5, -1, 1.6, 0.4), (0.00288, 0.75, 0, 2.26, 0.2), (0.0705, 2, 0, 0.979, 0.1)),
    ("far", "rigid"): ((0.466, 1.5, 0, 0.64, 0.5), (0.061, 1.5, 0, 1.4, 0.2), (0.107, 1.5, 0, 1.45, 0.4)),
    ("far", "ignored"): ((0.466, 1.5, 0, 0.64, 0.5), (0.061, 1.5, 0, 1.4, 0.2), (0.107, 1.5, 0, 1.45, 0.4)),
    ("grip", "rigid"): ((0.00301, 0.5, 0, 2.36, 0.2), (0.0401, 2.5, 0, 4.98, 0.4), (0.00556, 2, 0, 7.01, 0.5)),
    ("grip", "ignored"): ((0.00245, 0.5, 0, 2.53, 0.1), (0.0433, 2.5, 0, 4.37, 0.3), (0.0721, 2.5, 0, 1.64, 0.2)),
    ("friction", "rigid"): ((0.0545, 1.5, 0, 1.22, 0.3), (0.00558, 0.5, 0, 1.59, 0.2), (0.118, 1.5, 0, 0.824, 0.1)),
    ("friction", "ignored"): ((0.0545, 1.5, 0, 1.22, 0.3), (0.00558, 0.5, 0, 1.59, 0.2), (0.118, 1.5, 0, 0.824, 0.1)),
    ("solid", "rigid"): ((0.0168, 1, 0, 3.4, 0.1), (0.0219, 1, 0, 2.9, 0.1), (0.0279, 1, 0, 1.85, 0.1)),
    ("solid", "ignored"): ((0.00993, 1, 0, 3.4, 0.1), (0.0193, 1, 0, 1.4, 0.1), (0.0121, 1, 0, 2.5, 0)),
    ("solid press", "rigid"): ((0.045, 1, 0.7, 0.9, 0.1), (0.188, 1, 0, 1.16, 0.1), (0.0279, 1, 0, 1.85, 0.1)),
    ("solid press", "ignored"): ((0.025, 1, 0, 4.2, 0.1), (0.053, 1, 0, 2.0, 0.1), (0.0121, 1, 0, 2.5, 0)),
}
"""How the errors of force, shift and tilt are estimated, by the load and by whether the magnet is rigid: with numbers
(m, p, q, c, s) the usual difference to the companion is u = m (edge length / D)^p / (contact radius / D)^q, the one
found is d, and the estimate c u^(1 - s) d^s, with d no less than LEAST_SHARE u: it may vanish by chance. Where
between two points of a mesh a contact ends is chance and makes for errors of either sign: u tells more of them than
d. Where d is far from usual, so is the scene from those of the study: the estimate is at least SURE_SHARE d, and what
d exceeds UNUSUAL u by.
"deep" are presses beyond DEEPEST and ROOM, "far" shears of a glued plate beyond SHEARED; "pressed" is the press
before a stick shear, whose mesh is fine where the contact ends. With Coulomb friction the companion takes longer
steps too; its numbers, and those of far shears, were found with a rigid magnet.
"solid" are tetrahedra that are fine where the contact ends, "solid press" those that are not, as in an upright press.
Two meshes of tetrahedra agree by chance more often than others, so that d tells little: s is small, and c such that
the estimate holds for each mesh with each companion. Those of "solid" were set from all nine pairs of three meshes
and three companions in each of 24 states (designs 0 and 3, levels quick and standard), with 4 to 17 % to spare, and
checked at quick on shears to 0.3 D and after the deepest of the presses; those of "solid press" from presses of
seven designs at quick to three depths each, of some with several meshes, at standard, or deeper; that of the shift
was raised by 16 % for the states of `magtip accuracy`. Designs 2, 3 and 7, with large magnets, ask for the power of
the contact radius. All other rules have about the least constants that cover 95 % of the states of that study."""
SIDEWAYS: dict[tuple[str, Magnet], Rule] = {
    ("stick", "rigid"): (0.0173, 0.5, 0, 1.46, 0.5),
    ("stick", "ignored"): (0.0898, 1.25, 0, 1.27, 0.4),
    ("far", "rigid"): (0.3, 1.5, 0, 1.38, 0.8),
    ("far", "ignored"): (0.3, 1.5, 0, 1.38, 0.8),
    ("grip", "rigid"): RULES["grip", "rigid"][0],
    ("grip", "ignored"): RULES["grip", "ignored"][0],
    ("friction", "rigid"): (0.285, 2, 0.5, 1.02, 0.1),
    ("friction", "ignored"): (0.285, 2, 0.5, 1.02, 0.1),
    ("solid", "rigid"): (0.0553, 1, 0, 2.65, 0.1),
    ("solid", "ignored"): (0.0402, 1, 0, 3.3, 0.1),
}
"""The same of the force along the shear alone, with its share of the whole force in place of the contact radius: what
slips is a matter of the normal force, and small beside it is a force that is small. That of a grip is all the force
there is. Tetrahedra with Coulomb friction, which the study does not hold, take its rule for sections."""
TANGENT: dict[tuple[str, Magnet], Rule] = {
    ("critical depth", "rigid"): (0.217, 0.5, -2, 1.92, 0),
    ("critical depth", "ignored"): (0.217, 0.5, -2, 3.45, 0),
    ("critical force", "rigid"): (1.77, 0.5, -3, 1.82, 0.2),
    ("critical force", "ignored"): (1.77, 0.5, -3, 3.11, 0.2),
    ("stiffness", "rigid"): (0.0703, 1, -1.5, 6.36, 0.6),
    ("stiffness", "ignored"): (0.0168, 0.5, -1, 3.32, 0),
    ("shift", "rigid"): (2.3e-05, 0.5, 1, 4.71, 0.3),
    ("shift", "ignored"): (0.0192, 1.5, -1.5, 2.23, 0.3),
    ("tilt", "rigid"): (0.00125, 0.5, -1, 4.95, 0.3),
    ("tilt", "ignored"): (1.87, 2.5, -2, 1.82, 0.2),
    ("frequency", "rigid"): (0.000158, 0.5, 0, 6.05, 0),
    ("frequency", "ignored"): (0.000163, 0.5, 0, 3.8, 0.1),
    ("pressed frequency", "rigid"): (0.0073, 1.5, -0.5, 5.2, 0.3),
    ("pressed frequency", "ignored"): (0.00273, 1, 0, 5.47, 0.1),
}
"""The same of single numbers that the tangent about a press tells. In place of the contact radius stands the critical
depth over D, at least LEAST_DEPTH; for the small shear of a glued plate it is the contact radius; for frequencies
1 / (omega D (rho / E)^(1/2)), and those of the unpressed sensor have a rule of their own.
They were set from all such states of `magtip accuracy`: the twelve designs with their magnet, the six even-numbered
ones without. Guided tips are not in the study."""
LEAST_DEPTH = 0.15
LEAST_SHARE, SURE_SHARE, UNUSUAL = 0.2, 0.25, 8.0
LEAST_RADIUS = 0.06
"""Contact radius over D below which the mesh shrinks with it."""
ROOM, DEEPEST, SHEARED, RUBBED = 0.3, 0.25, 0.15, 0.25
"""Loads at which the rules change: depths over the silicone above the magnet (or base) and over D; shears over D, of
a plate or grip that holds and of one with Coulomb friction."""
DEEP, SQUEEZED, FAR = 3.3, 0.45, 0.6
"""How far the study goes: presses so many times as deep as that, and no deeper than a share of the silicone on the
axis; shears of a glued plate over D."""
ROUNDED = 1.001
"""The study's loads are rounded to four digits."""
DEEPER = 1.5
"""Where the study does not go, errors are expected to grow like this power of the depth, and like the shear."""
COARSER = 1.5
"""Edge lengths of the companion that the error is estimated with, over those of the solution."""
NOTHING = 1e-12
"""Tilts (rad) below this are rounding, which no error is relative to; forces and shifts are small at small loads."""


def coarser(accuracy: Accuracy) -> Accuracy:
    """That of the companion; beside a single harmonic it has one more, as a shear needs one."""
    sizes = ("section_size", "solid_size", "section_patch", "solid_patch", "rub")
    changed = {size: COARSER * getattr(accuracy, size) for size in sizes}
    return replace(accuracy, harmonics=accuracy.harmonics - 1 if accuracy.harmonics > 1 else 2, **changed)


def estimates(
    one: Response,
    other: Response,
    load: Load,
    loads: Sequence[Load],
    accuracy: Accuracy,
    model: str,
    magnet: Magnet,
    design: Design,
) -> tuple[float | None, float | None, float | None, float | None]:
    """Relative errors of force, shift, tilt and the force along the shear, from a response and its companion's.

    They follow RULES and SIDEWAYS. The load is one of the path's `loads`. None where there is nothing to be in error.
    """
    scene, edge = "press", accuracy.section_size
    if loads[0].coulomb is not None:
        scene = "friction"
    elif any(load.slides for load in loads):
        scene = "pressed" if not load.slides else "stick" if load.grip is None else "grip"
    scene = _farther(scene, load, magnet, design)
    if model in ("half", "full"):
        fine = load.plate_tilt or any(load.slides for load in loads)
        scene, edge = "solid" if fine else "solid press", accuracy.solid_size
    radius = max(one.contact_radius / design.D, LEAST_RADIUS)
    beyond = _beyond(scene, load, loads, magnet, design)
    if load.imperfection and not load.slides and one.shift[0] * other.shift[0] < 0:
        other = _mirrored(other)
    # what a second harmonic changes is all missing from an answer with one
    sure = 1.0 if model == "harmonic" and accuracy.harmonics == 1 else SURE_SHARE
    pairs = (one.force, other.force), (one.shift, other.shift), ((one.tilt, one.tilt_y), (other.tilt, other.tilt_y))
    upright = not load.slides and not load.plate_tilt and not load.imperfection
    force, shift, tilt = (
        _estimate(*pair, rule, edge, radius, nothing, sure, beyond)
        for pair, rule, nothing in zip(pairs, RULES[scene, magnet], (0.0, 0.0, NOTHING), strict=True)
    )
    along, sideways = (_along(one, load), _along(other, load)) if load.slides else (0.0, 0.0), None
    if along[0]:
        rule = SIDEWAYS["friction" if loads[0].coulomb is not None else scene, magnet]
        share = abs(along[0]) / math.hypot(*one.force)
        sideways = _estimate(along[:1], along[1:], rule, edge, share, 0.0, sure, beyond)
    # what tetrahedra tilt by under an upright press is noise
    return force, shift, None if tilt is None or (upright and tilt > 1) else tilt, sideways


def of_number(
    name: str, magnet: Magnet, one: float, other: float | None, accuracy: Accuracy, base: float = 1.0
) -> float | None:
    """Relative error of a number by its rule in TANGENT, from the one and its companion's.

    None where there is nothing, or the companion has none.
    """
    if other is None:
        return None
    rule = TANGENT[name, magnet]
    return _estimate((one,), (other,), rule, accuracy.section_size, base, NOTHING, SURE_SHARE, 1.0)


def deepest(magnet: Magnet, design: Design) -> tuple[float, float]:
    """Depth beyond which a press is deep, and the greatest of the study, mm."""
    first = min(DEEPEST * design.D, ROOM * (design.R - design.magnet_height / 2 if magnet == "rigid" else design.L))
    silicone = design.L - design.magnet_height if magnet == "rigid" else design.L
    return first, min(DEEP * first, SQUEEZED * silicone)


def _farther(scene: str, load: Load, magnet: Magnet, design: Design) -> str:
    """The scene, or that of deep presses and far shears in place of it."""
    if scene == "press" and load.depth > ROUNDED * deepest(magnet, design)[0]:
        return "deep"
    if scene == "stick" and load.shear > ROUNDED * SHEARED * design.D:
        return "far"
    return scene


def _beyond(scene: str, load: Load, loads: Sequence[Load], magnet: Magnet, design: Design) -> float:
    """By how much more than usual to expect where a load lies beyond those of the study, see DEEPER."""
    first, most = deepest(magnet, design)
    deep = load.depth / (most if scene == "deep" else first)
    reach = FAR if scene == "far" else SHEARED if loads[0].coulomb is None else RUBBED
    far = load.shear / (reach * design.D) if load.slides else 0.0
    return math.pow(max(deep, 1.0), DEEPER) * max(far, 1.0)


def _mirrored(response: Response) -> Response:
    """The response that leans to the other side: an imperfect press may give way to either."""
    x, y, z = response.shift
    return replace(response, shift=(-x, -y, z), tilt=-response.tilt, tilt_y=-response.tilt_y)


def _along(response: Response, load: Load) -> float:
    """Component of the force along a load's shear, N."""
    return (response.force[0] * load.shear_x + response.force[1] * load.shear_y) / load.shear


def _estimate(
    one: Sequence[float],
    other: Sequence[float],
    rule: Rule,
    edge: float,
    base: float,
    nothing: float,
    sure: float,
    beyond: float,
) -> float | None:
    """By its rule, from the two vectors, the edge length over D and the base of the power q; None for nothing."""
    size = math.hypot(*one)
    if size <= nothing:
        return None
    usually, p, q, factor, share = rule
    usual, found = usually * math.pow(edge, p) / math.pow(base, q), math.dist(one, other) / size
    likely = factor * math.pow(usual, 1 - share) * math.pow(max(found, LEAST_SHARE * usual), share)
    return max(beyond * likely, sure * found, found - UNUSUAL * usual)
