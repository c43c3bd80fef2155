"""Accuracy levels of the finite elements, which `magtip accuracy` holds against much finer meshes."""

from __future__ import annotations

from dataclasses import dataclass, replace


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

COARSER = 1.5
"""Edge lengths (and lengths of the steps with friction) of the companion that an error is estimated with, over those
of the solution: the companion has less than half of the unknowns, and is close enough to err in the same way."""


def coarser(accuracy: Accuracy) -> Accuracy:
    """The accuracy of the companion: one harmonic less, but beside a single harmonic, which a shear needs, two.

    >>> coarser(STANDARD).harmonics, coarser(STANDARD).rub
    (2, 1.5)
    """
    sizes = ("section_size", "solid_size", "section_patch", "solid_patch", "rub")
    changed = {size: COARSER * getattr(accuracy, size) for size in sizes}
    return replace(accuracy, harmonics=accuracy.harmonics - 1 if accuracy.harmonics > 1 else 2, **changed)
