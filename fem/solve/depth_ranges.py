"""Division of a path into parts that share a mesh, and the depth to which each mesh is graded.

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

from fem.scene import MOST_HARMONICS, Scene
from fem.solve.path_state import FIRST_TOUCH
from geometry.loads import Load

OFF_AXIS = 3.0
"""Additional harmonics over sin t sqrt(R / d), see `orders_needed`. At standard the force of a press on the paper's
sensor then differs from its limit by 0.05 % under 8 degrees at a tenth of D (4 orders), 0.3 % under 20 degrees (6)
and 0.6 % under 40 degrees (8), and at D/40 by 0.1 % under 8 degrees (6) and under 20 degrees (8)."""
SHALLOW, SPAN, SAME_DEPTH = 0.025, 1.25, 1e-9
"""SHALLOW: depth over D beyond which all presses share one mesh, graded to this depth (0.2 mm for the paper's
sensor). SPAN: ratio of the bounds of the shallower ranges, whose meshes are graded to their lower bounds. SAME_DEPTH:
relative difference from a bound up to which a depth is on the bound; depths over D of similar designs differ by
rounding."""


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
    parts: list[list[Load]] = []
    present: tuple[float, int] | None = None
    deepest = 0.0
    path_dependent = scene.coulomb is not None
    straight = not scene.solid and scene.grip is None
    for load in scene.loads:
        straight = straight and not (path_dependent and load.depth < deepest)
        depth = load.depth / D
        graded = mesh_range(scene, depth) if depth > FIRST_TOUCH else present
        if parts and (not straight or graded == present or not present):
            parts[-1].append(load)
        else:
            parts.append([load])
        present, deepest = graded, load.depth
        straight = straight and not (path_dependent and load.shears_tip)
    return [tuple(part) for part in parts]


def mesh_range(scene: Scene, depth: float) -> tuple[float, int]:
    """Return what two depths over D share if they share a mesh: its graded depth, and its number of harmonics."""
    return graded_depth(depth), harmonics_at(scene, depth)


def harmonics_at(scene: Scene, depth: float) -> int:
    """Return the number of harmonics for a load at a depth over D, at most MOST_HARMONICS.

    >>> from geometry.design import paper
    >>> scene = Scene(paper(), (Load(depth=0.8, plate_tilt=0.14),))
    >>> harmonics_at(scene, 0.1), harmonics_at(scene, 0.02)
    (4, 6)
    """
    least, needed = scene.accuracy.harmonics, orders_needed(scene, depth)
    return max(least, min(needed, MOST_HARMONICS))


def harmonics_missing(scene: Scene, depth: float) -> int:
    """Return how many harmonics a load at a depth over D needs beyond the most that a model has.

    >>> from geometry.design import paper
    >>> scene = Scene(paper(), (Load(depth=0.05, plate_tilt=0.7),))
    >>> harmonics_missing(scene, 0.1), harmonics_missing(scene, 0.00625)
    (0, 9)
    """
    return orders_needed(scene, depth) - min(
        orders_needed(scene, depth), max(scene.accuracy.harmonics, MOST_HARMONICS)
    )


def orders_needed(scene: Scene, depth: float) -> int:
    """Return the number of harmonics that a load at a depth over D needs: those of the accuracy, more off the axis.

    A plate tilted by an angle t touches the dome at R sin t from the axis. There a contact of radius a = sqrt(R d)
    fills an angle of about a / (R sin t) to each side, so the number of orders that resolve it grows like x = sin t
    sqrt(R / d), see OFF_AXIS.
    """
    least = scene.accuracy.harmonics
    if not scene.plate_tilt or depth <= FIRST_TOUCH:
        return least
    away = math.sin(abs(scene.plate_tilt)) * math.sqrt(scene.shape.R / depth)
    return least + math.ceil(OFF_AXIS * away)


def graded_depth(depth: float) -> float:
    """Return the depth to which the mesh of a press is graded, both over D.

    >>> graded_depth(0.4), graded_depth(0.025), graded_depth(0.0249)
    (0.025, 0.025, 0.02)
    """
    if depth >= SHALLOW:
        return SHALLOW
    below = math.log(SHALLOW / depth) / math.log(SPAN)
    return SHALLOW / SPAN ** math.ceil(below - SAME_DEPTH)
