"""The press that precedes an analysis, on a section that is refined where its contact ends."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fem.model import plate_contact
from fem.model.plate_contact import Plate
from fem.model.symmetry_models import MeshSpecification
from fem.scene import FIRST_TOUCH
from fem.solution import Stop
from fem.solve.load_stepping import Path, PathModels
from fem.solve.newton import STOPPED, NoStateError
from fem.solve.path_state import PathState, glue
from geometry.design import BadInput

EDGE_SHARE, SETTLED_RADIUS, MOST_PRESSES = 0.05, 0.05, 3
"""EDGE_SHARE: largest edge length at the edge of the contact, over the contact radius. SETTLED_RADIUS: relative
change of the radius at which the search ends. MOST_PRESSES: largest number of presses in a search."""
FOLDED = 0.04
"""Volume ratio J at an integration point below which a press is no state to analyse, because it folds elements. On
the paper's sensor `solve`, whose mesh is finer at the magnet's edge and has no such bound, stops at 5.68 mm with a J
of 0.135. Here J falls to 0.041 at 5.5 mm, where the frequencies of the levels still agree to 5 % (to 0.5 % at 5 mm,
with a J of 0.074); of most presses from 5.7 mm on it is 0.019 to 0.036. No other design was compared."""


@dataclass(frozen=True, slots=True)
class Press:
    """State of a press, and undeformed radius at which its contact ends, over D; None for the free sensor."""

    state: PathState
    edge: float | None

    def glue(self, state: PathState) -> Plate | None:
        """Return the plate with the contact area glued to it, in a model of the press; None for the free sensor."""
        return None if self.edge is None else glue(state, self.edge).plate


def find_press(section: MeshSpecification, edge_length: float, depth: float) -> float:
    """Return the undeformed radius at which the contact of a press ends, over D.

    Each mesh is refined at the radius that the mesh before gave. The first estimate is the circle in which the plate
    cuts the undeformed dome.

    section : mesh of the press; its own refinement (`rim`, `glued`) is replaced.
    edge_length : at the edge of the contact, over D; at most EDGE_SHARE of the radius.

    Raises
    ------
    BadInput
        The depth is lost in the rounding of lengths, so that no mesh has such a contact.
    """
    if not depth > FIRST_TOUCH:
        raise BadInput(f"the depth must be more than {FIRST_TOUCH:g} D, the rounding of lengths; got {depth:.3g} D")
    radius = min(math.sqrt(depth / 2), 0.475)
    for _ in range(MOST_PRESSES):
        rim = radius, min(edge_length, EDGE_SHARE * radius)
        state, _ = solve_press(replace(section, rim=rim, glued=False), depth)
        end = measure_contact_edge(state)
        if not end:  # the press did not reach first touch: the press on the final mesh reports why
            break
        change, radius = end / radius - 1, end
        if abs(change) < SETTLED_RADIUS:
            break
    return radius


def reach_press(section: MeshSpecification, edge: float | None, edge_length: float, depth: float, D: float) -> Press:
    """Return a press on a section refined where the contact ends; NoStateError if it stops or crushes the silicone.

    edge : undeformed radius at which the contact ends, over D, of `find_press`; None for the free sensor.
    edge_length, depth : at this edge, and of the press, over D; D, mm, is for the message.
    """
    if edge is not None:
        section = replace(section, rim=(edge, min(edge_length, edge / 4)))
    state, stop = solve_press(section, depth)
    if stop:
        raise NoStateError(
            f"the press stops at depth {state.position[0] * D:.4g} mm ({STOPPED[stop]}): take a smaller depth"
        )
    if state.least_J < FOLDED:
        raise NoStateError(
            f"the press to depth {depth * D:.4g} mm crushes silicone to {100 * state.least_J:.2g} % of its volume, "
            "which the mesh cannot follow: take a smaller depth"
        )
    return Press(state, edge)


def solve_press(section: MeshSpecification, depth: float) -> tuple[PathState, Stop]:
    """Return the last state of a press to a depth over D, and why it stopped before."""
    path = Path(PathModels(section))
    reached = path.advance(path.rest, np.array([depth, 0.0, 0.0]))
    return reached.state, reached.stop


def measure_contact_edge(state: PathState) -> float:
    """Return the undeformed radius at which the contact of a solved press ends, over D."""
    radius = plate_contact.contact_radius(state.skin, state.u, state.plate)
    return plate_contact.undeformed_radius(state.skin, state.u, state.plate, radius)
