"""Specification of a mesh and its model, in units of D: callers vary its fields and then build the model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import skfem

from fem.model import symmetry_models
from fem.model.material import Law
from fem.model.symmetry_models import Discretisation
from fem.scene import Scene
from geometry.design import Shape
from geometry.loads import Magnet
from geometry.section import FILLET


@dataclass(frozen=True, slots=True)
class MeshSpecification:
    """A section of revolution or a solid of tetrahedra, its material and its loads. Lengths are over D.

    Attributes
    ----------
    shape, nu, magnet, law : shape of the beam, Poisson's ratio, "rigid" or "ignored", and the law with stresses over
        E.
    size, tip_size : edge lengths of the mesh, and at its tip.
    body : "section", or tetrahedra of "half" the solid (y >= 0) or of the "full" solid.
    fillet : edge length at the magnet's fillet over the fillet's radius, on a section.
    rim : undeformed radius at which the contact area will end, and edge length there; None for no refinement.
    glued : whether the area inside the rim will be glued, see `geometry.section.section`; that of a solid always is.
    push : dead force along x, distributed over the dome, over E D^2.
    harmonics : number of harmonics on a section; 0 is axisymmetric.
    skin_harmonics : number of harmonics that the skin's angles must integrate, if larger than `harmonics`.
    sines : whether the harmonics include sine orders, for a load without a plane of symmetry.
    mesh : tetrahedral mesh in units of D to use instead of a new one; sizes and rim are then ignored.
    """

    shape: Shape
    nu: float
    magnet: Magnet
    law: Law
    size: float
    tip_size: float
    body: Literal["section", "half", "full"] = "section"
    fillet: float = FILLET
    rim: tuple[float, float] | None = None
    glued: bool = False
    push: float = 0.0
    harmonics: int = 0
    skin_harmonics: int = 0
    sines: bool = False
    mesh: skfem.MeshTet2 | None = None

    def build(self) -> Discretisation:
        """Build the model; specifications with equal sizes share one mesh."""
        of_beam = self.shape, self.nu, self.magnet, self.size, self.tip_size, self.law
        if self.body == "section":
            return symmetry_models.section(
                *of_beam,
                harmonics=self.harmonics,
                sines=self.sines,
                rim=self.rim,
                push=self.push,
                around=self.skin_harmonics,
                fillet=self.fillet,
                glued=self.glued,
            )
        half = self.body == "half"
        return symmetry_models.solid(*of_beam, half=half, rim=self.rim, push=self.push, mesh=self.mesh)


def specification(scene: Scene, size: float, tip_size: float) -> MeshSpecification:
    """Return the specification of a section of a scene's beam with these edge lengths over D."""
    return MeshSpecification(scene.shape, scene.design.nu, scene.magnet, scene.law, size, tip_size)
