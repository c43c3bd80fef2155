"""Accuracy levels, and the rules by which the error of a solution is estimated from that of a coarser companion.

The numbers here are set with `magtip accuracy`, which holds levels and estimates against much finer meshes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from fem.solution import coulomb, slides
from geometry.scene import Load, Response


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

RULES = {
    "press": ((1.0, 0.00473, 1.5, 1.5), (0.7, 0.0185, 2.0, 1.5), (0.7, 0.0185, 2.0, 1.5)),
    "pressed": ((1.2, 0.207, 2.5, 0.0), (1.2, 0.00171, 1.0, 0.5), (1.2, 0.00171, 1.0, 0.5)),
    "stick": ((0.3, 0.00369, 0.5, 0.0), (0.6, 0.00422, 0.5, 0.0), (0.3, 2.28, 3.0, 0.0)),
    "grip": ((1.2, 0.0203, 1.0, 0.0), (3.0, 0.523, 3.0, 0.0), (1.5, 0.0704, 2.5, 0.0)),
    "friction": ((0.7, 0.27, 1.5, 0.0), (0.5, 0.28, 1.5, 0.0), (0.5, 0.28, 1.5, 0.0)),
    "solid": ((1.0, 0.05, 1.0, 0.0), (1.0, 0.05, 1.0, 0.0), (2.0, 0.0315, 1.0, 0.0)),
}
"""How the errors of force, shift and tilt are estimated on a section, by the load ("pressed" is the press before a
stick shear, whose mesh is fine where the contact ends), and on tetrahedra. With numbers (k, c, p, q) the estimate is
k times the difference to the companion, but at least c (edge length / D)^p / (contact radius / D)^q: the difference
may vanish by chance, and a press errs with the number of elements across its contact. With Coulomb friction, where
the companion takes longer steps too, the numbers are wide ones that no study has held against true errors yet."""
LEAST_RADIUS = 0.06
"""Contact radius over D below which the mesh shrinks with it."""
COARSER = 1.5
"""Edge lengths of the companion that the error is estimated with, over those of the solution."""
NOTHING = 1e-12
"""Tilts (rad) below this are rounding, which no error is relative to; forces and shifts are small at small loads."""


def coarser(accuracy: Accuracy) -> Accuracy:
    """That of the companion."""
    sizes = ("section_size", "solid_size", "section_patch", "solid_patch", "rub")
    changed = {size: COARSER * getattr(accuracy, size) for size in sizes}
    return replace(accuracy, harmonics=max(accuracy.harmonics - 1, 1), **changed)


def estimates(
    one: Response, other: Response, load: Load, loads: Sequence[Load], accuracy: Accuracy, model: str, D: float
) -> tuple[float | None, float | None, float | None]:
    """Relative errors of force, shift and tilt from the mesh, by RULES, from a response and its companion's.

    The load is one of the path's `loads`; D, mm, is the design's.
    """
    scene, edge = "press", accuracy.section_size
    if coulomb(loads) is not None:
        scene = "friction"
    elif any(map(slides, loads)):
        scene = "pressed" if not slides(load) else "stick" if load.grip is None else "grip"
    if model in ("half", "full"):
        scene, edge = "solid", accuracy.solid_size
    radius = max(one.contact_radius / D, LEAST_RADIUS)
    pairs = (one.force, other.force), (one.shift, other.shift), ((one.tilt, one.tilt_y), (other.tilt, other.tilt_y))
    force, shift, tilt = (
        _estimate(*pair, factor, least * edge**p / radius**q, nothing)
        for pair, (factor, least, p, q), nothing in zip(pairs, RULES[scene], (0.0, 0.0, NOTHING), strict=True)
    )
    return force, shift, tilt


def _estimate(
    one: Sequence[float], other: Sequence[float], factor: float, least: float, nothing: float
) -> float | None:
    """Relative difference of two vectors times a factor, at least `least`; None where there is nothing."""
    size = math.hypot(*one)
    return max(factor * math.dist(one, other) / size, least) if size > nothing else None
