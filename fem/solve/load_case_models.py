"""The models for each kind of load case, and the loads of a path that share a mesh.

The edge length of a section at the tip follows from the radius of the contact, so that a light touch is resolved too.
Elements that small do not suit a deep press: the plate's springs may be softer than the elements, whose skin then
loses stability under a large pressure although the body is stable (see `fem.model.plate_contact`). A light touch in
turn needs a mesh graded to it; otherwise the force scatters by a percent, depending on where in an element the
contact ends. Depths are therefore divided into ranges with one mesh each: narrow ranges for light touches, and one
range for all deeper presses. The bounds are the same for every path, so a state does not depend on the other loads of
its path.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

from fem.accuracy import QUICK
from fem.model.elements import SAME_PLACE
from fem.model.symmetry_models import MeshSpecification, specification
from fem.scene import FIRST_TOUCH, Scene
from fem.solve.load_stepping import PathModels
from fem.solve.newton import TOLERANCE
from fem.solve.press import find_press
from geometry.loads import Load

RIM_SHARE = 0.25
"""Edge length where an area glued to a tilted plate ends, over the distance of its centre from the axis or over its
radius, whichever is less: the radius at which it ends changes around the axis by twice that distance."""
PRESS_FILLET = 0.5
"""Edge length at the magnet's fillet, over the fillet's radius, for a press. Presses go deeper than shears do, and
larger elements would be inverted there; a shear would gain nothing from smaller ones."""
SHALLOW, SPAN = 0.025, 1.25
"""SHALLOW: depth over D beyond which all presses share one mesh, graded to this depth (0.2 mm for the paper's
sensor). SPAN: ratio of the bounds of the shallower ranges, whose meshes are graded to their lower bounds."""


def path_models(scene: Scene) -> PathModels:
    """Return the models for the loads of a scene."""
    if scene.solid:
        models = tetrahedra(scene)
    elif scene.plate_tilt:
        models = tilted_plate(scene)
    elif not scene.sideways:
        models = press(scene)
    elif scene.grip is not None:
        high = _harmonic(scene, _fine_at(scene, _gripped_radius(scene)))
        models = PathModels(high, predictor=_predictor(high))
    elif scene.coulomb is None:
        models = glued_plate(scene)
    else:  # axisymmetric until the shear
        section = _section(scene, scene.accuracy.section_size)
        models = PathModels(section, raised=_harmonic(scene, section))
    factor, tolerance = scene.accuracy.friction_step_factor, scene.accuracy.tolerance_factor * TOLERANCE
    models = replace(models, grip=scene.grip, tilt=scene.plate_tilt, mu=scene.coulomb, tolerance=tolerance)
    return replace(models, friction_step_factor=factor)


def press(scene: Scene) -> PathModels:
    """Return the models of a press: axisymmetric, or with harmonics for an imperfection or on request."""
    section = replace(_section(scene, scene.accuracy.section_size), fillet=PRESS_FILLET)
    if scene.model == "axisymmetric":
        return PathModels(section)
    high = _harmonic(scene, section)
    return PathModels(high, predictor=_predictor(high) if scene.coulomb is None else None)


def tilted_plate(scene: Scene) -> PathModels:
    """Return the models of a tilted plate, which touches the tip off the axis: all harmonics from the start.

    The edge of a glued area lies at several radii, between |off - a| and off + a. The section is refined at the one
    that it has across the tilt.
    """
    section, sheared = _section(scene, scene.accuracy.section_size), scene.sheared
    if sheared is not None and scene.coulomb is None:
        R, depth = scene.shape.R, sheared.depth / scene.design.D
        off, a = R * math.sin(abs(scene.plate_tilt)), math.sqrt(R * depth)
        edge = max(scene.accuracy.section_patch, RIM_SHARE * min(off, a))
        section = replace(section, rim=(min(math.hypot(off, a), 0.95 * R), min(edge, section.size)))
    # one harmonic predicts too little of a contact off the axis to save time
    return PathModels(_harmonic(scene, section))


def glued_plate(scene: Scene) -> PathModels:
    """Return the models of a plate that is glued after the press: a section refined at the edge of the contact."""
    radius = _glued_radius(scene)
    section = _fine_at(scene, radius)
    high = _harmonic(scene, section)
    if scene.push:  # the contact is not a circle then: the points that touch are glued
        return PathModels(high, predictor=_predictor(high))
    return PathModels(section, raised=high, predictor=_predictor(high), glued_radius=radius)


def tetrahedra(scene: Scene) -> PathModels:
    """Return the models of any load on a solid, refined where the tied area ends, or else at the tip."""
    size, patch = scene.accuracy.solid_size, scene.accuracy.solid_patch
    body: Literal["half", "full"] = "half" if scene.model == "half" else "full"
    solid = replace(specification(scene, size), body=body, push=scene.push, mesh=scene.mesh)
    radius = None if scene.mesh is not None else _sheared_radius(scene)
    if radius is None:
        fine = scene.sideways or scene.plate_tilt
        return PathModels(replace(solid, tip_size=patch) if fine else solid)
    rim = radius, min(patch, radius / 3)
    return PathModels(replace(solid, rim=rim), glued_radius=None if scene.push else radius)


def _section(scene: Scene, size: float) -> MeshSpecification:
    """Return a section whose tip is fine enough for the lightest touch of the path."""
    D = scene.design.D
    depths = [graded_depth(load.depth / D) for load in scene.loads if load.depth > FIRST_TOUCH * D]
    # the radius at which the plate would cut the tip has as many elements as the diameter D
    tip = math.sqrt(scene.shape.R * min(depths, default=1.0))
    return specification(scene, size, min(tip, 1.0) * size)


def _fine_at(scene: Scene, radius: float) -> MeshSpecification:
    """Return the section of a shear, refined at a radius over D."""
    accuracy = scene.accuracy
    rim = radius, min(accuracy.section_patch, radius / 4)
    return replace(_section(scene, accuracy.section_size), rim=rim, glued=True)


def _harmonic(scene: Scene, section: MeshSpecification) -> MeshSpecification:
    depths = [load.depth / scene.design.D for load in scene.loads]
    harmonics = max(scene.harmonics_at(depth) for depth in depths)
    return replace(section, harmonics=harmonics, push=scene.push, sines=scene.turns)


def _predictor(high: MeshSpecification) -> MeshSpecification | None:
    """Return the predictor of a model with several harmonics, on the same skin points; None for one harmonic."""
    return replace(high, harmonics=1, skin_harmonics=high.harmonics) if high.harmonics > 1 else None


def _sheared_radius(scene: Scene) -> float | None:
    """Return the undeformed radius over D of the tied area; None where it is unknown or covers the whole dome."""
    if not scene.sideways:
        return None
    if scene.grip is not None:
        radius = _gripped_radius(scene)
        return None if radius == scene.shape.R else radius
    return None if scene.plate_tilt or scene.coulomb is not None else _glued_radius(scene)


def _gripped_radius(scene: Scene) -> float:
    """Return the radius over D at which the gripped skin ends: on the dome, or R if the grip reaches the cylinder."""
    height, R = scene.grip, scene.shape.R
    assert height is not None
    return math.sqrt(height * (2 * R - height)) if height < R else R


def _glued_radius(scene: Scene) -> float:
    """Return the undeformed radius over D at which the contact ends when the plate is glued, from a coarse press."""
    sheared = scene.sheared
    assert sheared is not None
    rough = _section(scene, max(scene.accuracy.section_size, QUICK.section_size))
    return find_press(rough, scene.accuracy.section_patch, sheared.depth / scene.design.D)


def split_by_mesh(scene: Scene) -> list[tuple[Load, ...]]:
    """Split the loads of a scene into parts that are each followed on one mesh, from the unloaded state on.

    A press without friction can be reached directly from the unloaded state, also one before a glued plate shears.
    With Coulomb friction that holds only while the plate has moved down without reversing. Such presses begin a new
    part where their mesh changes. Tetrahedra are not graded to the depth, so they have one part.

    >>> from geometry.design import paper
    >>> scene = Scene(paper(), tuple(Load(depth=d) for d in (0.05, 0.1, 1, 2)), model="harmonic")
    >>> [[load.depth for load in part] for part in split_by_mesh(scene)]
    [[0.05], [0.1], [1, 2]]
    """
    D = scene.design.D
    runs: list[list[Load]] = []
    present: tuple[float, int] | None = None
    deepest = 0.0
    path_dependent = scene.coulomb is not None
    straight = not scene.solid and scene.grip is None
    for load in scene.loads:
        straight = straight and not (path_dependent and load.depth < deepest)
        depth = load.depth / D
        graded = mesh_range(scene, depth) if depth > FIRST_TOUCH else present
        if runs and (not straight or graded == present or not present):
            runs[-1].append(load)
        else:
            runs.append([load])
        present, deepest = graded, load.depth
        straight = straight and not (path_dependent and load.shears_tip)
    return [tuple(run) for run in runs]


def mesh_range(scene: Scene, depth: float) -> tuple[float, int]:
    """Return what two depths over D share if they share a mesh: its graded depth, and its number of harmonics."""
    return graded_depth(depth), scene.harmonics_at(depth)


def graded_depth(depth: float) -> float:
    """Return the depth to which the mesh of a press is graded, both over D.

    >>> graded_depth(0.4), graded_depth(0.025), graded_depth(0.0249)
    (0.025, 0.025, 0.02)
    """
    if depth >= SHALLOW:
        return SHALLOW
    # depths over D of similar designs differ by rounding: on a bound they have one mesh
    below = math.log(SHALLOW / depth) / math.log(SPAN)
    return SHALLOW / SPAN ** math.ceil(below - SAME_PLACE)
