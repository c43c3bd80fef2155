"""Which loads of a path are followed on one mesh, and to which depth that mesh is graded.

The edge length of a section at the tip follows from the radius of the contact, so that a light touch is resolved too.
Elements that small have no place in a deep press: the plate's springs are softer than they are, and under a large
pressure their skin loses stability although the body is stable. Where in an element a contact ends is also felt in
the force, by up to a percent. So every light touch has a mesh of its own, on which it looks like any other, and all
deeper presses share one. Then no state depends on what else a path is asked for.
"""

from __future__ import annotations

from collections.abc import Sequence

from fem import models
from fem.path import FIRST_TOUCH
from fem.solution import coulomb, slides
from geometry.scene import Load

SHALLOW, SAME_DEPTH = 0.025, 1e-9
"""Depth over D from which on presses share a mesh, graded to it (0.2 mm for the paper's sensor). Depths that miss it by
a share SAME_DEPTH, as those of similar designs may by rounding, count as on it."""


def parts(loads: Sequence[Load], D: float, model: models.Model) -> list[list[Load]]:
    """The loads in a row that one path on one mesh follows, each part from the unloaded state on.

    A press without friction, also one before a glued plate shears, can be reached straight from the unloaded state.
    With Coulomb friction that is so as long as the plate has only come down. Such presses begin a new part where
    their mesh is another one; tetrahedra are not graded to the depth.

    >>> [[load.depth for load in part] for part in parts([Load(depth=d) for d in (0.05, 0.1, 1, 2)], 8.0, "harmonic")]
    [[0.05], [0.1], [1, 2]]
    """
    found: list[list[Load]] = []
    present = deepest = 0.0
    straight = model in ("axisymmetric", "harmonic") and loads[0].grip is None
    for load in loads:
        graded = graded_depth(load.depth / D) if load.depth > FIRST_TOUCH * D else present
        if found and (not straight or graded == present or not present):
            found[-1].append(load)
        else:
            found.append([load])
        present, deepest = graded, max(deepest, load.depth)
        # friction remembers where the plate has been
        straight = straight and (coulomb(loads) is None or (load.depth == deepest and not slides(load)))
    return found


def graded_depth(depth: float) -> float:
    """The depth that the mesh of a press is graded to, both over D.

    >>> graded_depth(1e-6), graded_depth(0.025), graded_depth(0.4)
    (1e-06, 0.025, 0.025)
    """
    return depth if depth < (1 - SAME_DEPTH) * SHALLOW else SHALLOW
