"""The models that each kind of load case is followed with: press, glued plate, grip, Coulomb friction, tetrahedra."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import skfem

from fem.accuracy import QUICK
from fem.contact.contact_extent import find_contact_edge
from fem.discretisation.mesh_specification import MeshSpecification, specification
from fem.scene import Scene
from fem.solvers.depth_ranges import graded_depth
from fem.solvers.path_state import FIRST_TOUCH

TIP = 1.0
"""Edge length at the tip over that of the section, in radii at which the plate would cut the tip, over D."""
PRESS_FILLET = 0.5
"""Edge length at the magnet's fillet, over its radius, for a press: it goes deeper than what is sheared, and larger
elements are inverted there. A shear gains nothing by it."""


@dataclass(frozen=True, slots=True)
class PathModels:
    """The models of one path of loads.

    Attributes
    ----------
    first : the model that the path begins with.
    raised : model with harmonics on the same mesh that takes over when the shear begins; also the one in which the
        sideways stability of an axisymmetric press is looked at.
    predictor : model with one harmonic on the same mesh that goes ahead of one with more.
    glued_radius : undeformed radius over D of the patch that is glued when the shear begins; default: the radius of
        the contact.
    """

    first: MeshSpecification
    raised: MeshSpecification | None = None
    predictor: MeshSpecification | None = None
    glued_radius: float | None = None


def path_models(scene: Scene, mesh: skfem.MeshTet2 | None = None) -> PathModels:
    """The models for the loads of a scene; `mesh` holds tetrahedra in units of D to take instead of new ones."""
    if scene.solid:
        return tetrahedra(scene, mesh)
    if not scene.sideways:
        return press(scene)
    if scene.grip is not None:
        return grip(scene)
    return glued_plate(scene) if scene.coulomb is None else friction_plate(scene)


def press(scene: Scene) -> PathModels:
    """A press on a section: axisymmetric, or with harmonics where an imperfection pushes or they are asked for."""
    section = replace(_section(scene, scene.accuracy.section_size), fillet=PRESS_FILLET)
    if scene.model == "axisymmetric":
        return PathModels(section, raised=replace(section, harmonics=1))
    high = _harmonic(scene, section)
    return PathModels(high, predictor=_predictor(high) if scene.coulomb is None else None)


def glued_plate(scene: Scene) -> PathModels:
    """A plate that is glued after the press, on a section that is fine where the contact ends."""
    radius = _glued_radius(scene)
    section = _fine_at(scene, radius)
    high = _harmonic(scene, section)
    if scene.push:  # the patch is no circle then: it is glued where it is found
        return PathModels(high, predictor=_predictor(high))
    return PathModels(section, raised=high, predictor=_predictor(high), glued_radius=radius)


def grip(scene: Scene) -> PathModels:
    """A grip that shears the tip, on a section that is fine where the gripped skin ends."""
    high = _harmonic(scene, _fine_at(scene, _gripped_radius(scene)))
    return PathModels(high, predictor=_predictor(high))


def friction_plate(scene: Scene) -> PathModels:
    """A plate with Coulomb friction: an axisymmetric press, then a model with all harmonics, without a predictor."""
    section = _section(scene, scene.accuracy.section_size)
    return PathModels(section, raised=replace(section, harmonics=scene.accuracy.harmonics))


def tetrahedra(scene: Scene, mesh: skfem.MeshTet2 | None) -> PathModels:
    """Any load on a solid, which is fine where a patch of known radius ends, or else at the tip."""
    size, patch = scene.accuracy.solid_size, scene.accuracy.solid_patch
    body: Literal["half", "full"] = "half" if scene.model == "half" else "full"
    solid = replace(specification(scene, size, size / 2), body=body, push=scene.push, mesh=mesh)
    radius = None if mesh is not None else _sheared_radius(scene)
    if radius is None:
        fine = scene.sideways or scene.plate_tilt
        return PathModels(replace(solid, tip_size=patch) if fine else solid)
    return PathModels(
        replace(solid, rim=(radius, min(patch, radius / 3))), glued_radius=None if scene.push else radius
    )


def _section(scene: Scene, size: float) -> MeshSpecification:
    """A section whose tip is as fine as the lightest touch of the path asks for."""
    D = scene.design.D
    depths = [graded_depth(load.depth / D) for load in scene.loads if load.depth > FIRST_TOUCH * D]
    tip = TIP * math.sqrt(scene.shape.R * min(depths, default=1.0))
    return specification(scene, size, min(tip, 1.0) * size)


def _fine_at(scene: Scene, radius: float) -> MeshSpecification:
    """The section of a shear, fine at a radius over D."""
    accuracy = scene.accuracy
    return replace(_section(scene, accuracy.section_size), rim=(radius, min(accuracy.section_patch, radius / 4)))


def _harmonic(scene: Scene, section: MeshSpecification) -> MeshSpecification:
    """The section with the harmonics of the scene's accuracy."""
    return replace(section, harmonics=scene.accuracy.harmonics, push=scene.push)


def _predictor(high: MeshSpecification) -> MeshSpecification | None:
    """The model that goes ahead of one with several harmonics, on the same points of the skin."""
    return replace(high, harmonics=1, skin_harmonics=high.harmonics) if high.harmonics > 1 else None


def _sheared_radius(scene: Scene) -> float | None:
    """Undeformed radius over D of the patch that shears the tip, None where it is not known or all of the dome."""
    if not scene.sideways:
        return None
    if scene.grip is not None:
        radius = _gripped_radius(scene)
        return None if radius == scene.shape.R else radius
    return None if scene.plate_tilt or scene.coulomb is not None else _glued_radius(scene)


def _gripped_radius(scene: Scene) -> float:
    """Radius over D at which the gripped skin ends: on the dome, or R where the grip reaches the cylinder."""
    height, R = scene.grip, scene.shape.R
    assert height is not None
    return math.sqrt(height * (2 * R - height)) if height < R else R


def _glued_radius(scene: Scene) -> float:
    """Undeformed radius over D at which the contact ends when the plate is glued, from presses on rough sections."""
    sheared = scene.sheared
    assert sheared is not None
    rough = _section(scene, max(scene.accuracy.section_size, QUICK.section_size))
    return find_contact_edge(rough, scene.accuracy.section_patch, sheared.depth / scene.design.D)
