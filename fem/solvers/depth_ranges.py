"""Which loads of a path are followed on one mesh, and to which depth that mesh is graded.

The edge length of a section at the tip follows from the radius of the contact, so that a light touch is resolved
too. Elements that small have no place in a deep press: the plate's springs may be softer than they are, and then
their skin loses stability under a large pressure although the body is stable (see `fem.contact.plate_contact`). And a
light touch needs a mesh that is graded to it, or the force scatters by a percent with the place where the contact
ends in an element. So depths are divided into ranges with a mesh each: narrow ones for light touches, and one for all
deeper presses. The bounds are the same for every path, so that no state depends on what else a path is asked for.
"""

from __future__ import annotations

import math

from fem.scene import Scene
from fem.solvers.path_state import FIRST_TOUCH
from geometry.loads import Load

SHALLOW, SPAN, SAME_DEPTH = 0.025, 1.25, 1e-9
"""Depth over D from which on presses share a mesh, graded to it (0.2 mm for the paper's sensor); ratio of the bounds
of the ranges below, whose meshes are graded to the lower one. Depths that miss a bound by a share SAME_DEPTH, as
those of similar designs may by rounding, count as on it."""


def split_by_mesh(scene: Scene) -> list[tuple[Load, ...]]:
    """The loads of a scene in a row that one path on one mesh follows, each part from the unloaded state on.

    A press without friction, also one before a glued plate shears, can be reached straight from the unloaded state.
    With Coulomb friction that is so as long as the plate has only come down. Such presses begin a new part where
    their mesh is another one; tetrahedra are not graded to the depth.

    >>> from geometry.design import paper
    >>> scene = Scene(paper(), tuple(Load(depth=d) for d in (0.05, 0.1, 1, 2)), model="harmonic")
    >>> [[load.depth for load in part] for part in split_by_mesh(scene)]
    [[0.05], [0.1], [1, 2]]
    """
    D = scene.design.D
    found: list[list[Load]] = []
    present = deepest = 0.0
    remembers = scene.coulomb is not None
    straight = not scene.solid and scene.grip is None
    for load in scene.loads:
        straight = straight and not (remembers and load.depth < deepest)
        graded = graded_depth(load.depth / D) if load.depth > FIRST_TOUCH * D else present
        if found and (not straight or graded == present or not present):
            found[-1].append(load)
        else:
            found.append([load])
        present, deepest = graded, load.depth
        straight = straight and not (remembers and load.shears_tip)
    return [tuple(part) for part in found]


def graded_depth(depth: float) -> float:
    """The depth that the mesh of a press is graded to, both over D.

    >>> graded_depth(0.4), graded_depth(0.025), graded_depth(0.0249)
    (0.025, 0.025, 0.02)
    """
    if depth >= SHALLOW:
        return SHALLOW
    below = math.log(SHALLOW / depth) / math.log(SPAN)
    return SHALLOW / SPAN ** math.ceil(below - SAME_DEPTH)
