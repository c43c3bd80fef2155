"""Accuracy levels of the finite elements; `magtip validate errors accuracy` compares them with much finer meshes.

Quick is for looking around and for the live page, standard for answers (the surrogate is of its meshes), fine for
checking an answer of standard. They are no sequence: their lengths have no fixed ratio and their meshes do not nest.
In a press of the paper's sensor by 1 mm the forces of the three scatter within 0.15 %, and fine is not always nearer
to the limit than standard. Evidence of convergence is `magtip converge`, whose lengths have one ratio.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

__all__ = ["FINE", "LEVELS", "QUICK", "STANDARD", "Accuracy", "coarser", "level", "longer_edges"]


LEAST_TOLERANCE = 1e-7
"""Least permitted error of the force from the time steps: Newton's tolerance leaves errors near it, and the number of
steps grows like the inverse of its cube root."""


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Mesh sizes and harmonics of a solve.

    Attributes
    ----------
    name : quick, standard or fine.
    section_size, solid_size : edge length of the section's triangles and of the tetrahedra, over D.
    section_patch, solid_patch : edge length at the edge of the glued or gripped area (at the tip under a tilted
        plate), over D; coarser elements there make the tip too stiff in shear.
    harmonics : number of harmonics of the harmonic model.
    friction_step_factor : factor on the longest load increments with Coulomb friction.
    coarseness : factor on every edge length of a section, those at fillets, corners and in thin layers too.
    tolerance_factor : factor on Newton's tolerance (`fem.solve.newton.TOLERANCE`) of states without friction.
    """

    name: str
    section_size: float
    solid_size: float
    section_patch: float
    solid_patch: float
    harmonics: int
    friction_step_factor: float = 1.0
    coarseness: float = 1.0
    tolerance_factor: float = 1.0

    @property
    def estimates_only(self) -> bool:
        """Whether its states only estimate the errors of others (`coarser`), so that nobody reads their facts."""
        return self.tolerance_factor > 1


QUICK = Accuracy("quick", 0.16, 0.16, 0.012, 0.03, 2)
STANDARD = Accuracy("standard", 0.09, 0.14, 0.006, 0.02, 3)
FINE = Accuracy("fine", 0.045, 0.10, 0.002, 0.01, 4)
LEVELS = {level.name: level for level in (QUICK, STANDARD, FINE)}


def level(accuracy: Accuracy | str) -> Accuracy:
    """Return an accuracy as it is, or the level of this name.

    >>> level("quick") is QUICK
    True
    """
    found = LEVELS.get(accuracy) if isinstance(accuracy, str) else accuracy
    if not isinstance(found, Accuracy):
        names = ", ".join(LEVELS)
        raise TypeError(f"accuracy must be one of {names}, or an Accuracy of fem.accuracy; got {accuracy!r}")
    return found


COARSER = 1.5
"""Edge lengths, and load increments with friction, of the coarser mesh for error estimates, over those of the
solution. A section then has some four tenths of the unknowns, tetrahedra about half, and the mesh is still fine
enough for its errors to be of the same kind."""
ROUGH = 1e3
"""Factor on Newton's tolerance of the states on that mesh. They differ by 1e-4 or more from those that they are
compared with, and residuals of 1e-6 of the reactions change an estimate by less than 1e-3 of itself
(`tests/test_error_estimates.py`)."""


def coarser(accuracy: Accuracy) -> Accuracy:
    """Return the accuracy of the coarser mesh that errors are estimated with.

    All edges of a section are longer by COARSER, those at fillets, corners and in thin layers too. It has one
    harmonic less; a shear needs one harmonic, so the comparison for a single harmonic has two.

    >>> coarser(STANDARD).harmonics, coarser(STANDARD).coarseness, coarser(STANDARD).section_size
    (2, 1.5, 0.09)
    """
    return replace(_changed(accuracy, "coarseness", "solid_size", "solid_patch"), tolerance_factor=ROUGH)


def longer_edges(accuracy: Accuracy) -> Accuracy:
    """Return the accuracy of the mesh that errors of critical depths, small shears, modes and vibrations are
    estimated with, on which their rules rest.

    Its edges are longer by COARSER but for those that follow from a fillet, a corner or a thin layer.
    """
    return _changed(accuracy, "section_size", "section_patch", "solid_size", "solid_patch")


def _changed(accuracy: Accuracy, *sizes: str) -> Accuracy:
    longer = {size: COARSER * getattr(accuracy, size) for size in (*sizes, "friction_step_factor")}
    return replace(accuracy, harmonics=accuracy.harmonics - 1 if accuracy.harmonics > 1 else 2, **longer)
