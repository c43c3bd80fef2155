"""Where the contact of a press ends on the undeformed skin, and a mesh that is fine there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fem.contact import plate_contact
from fem.discretisation.mesh_specification import MeshSpecification
from fem.discretisation.symmetry_models import Discretisation
from fem.solvers.load_stepping import Path
from fem.solvers.path_state import PathState

SHARE, NEAR, MOST_PRESSES = 0.05, 0.05, 3
"""Looking for the end of a contact: the edge length there over its radius, the relative change of the radius after
which it is found, and the most presses."""


def contact_end(section: MeshSpecification, edge_length: float, depth: float) -> float:
    """As `contact_edge`, by meshes that are fine where the contact ended before; at first where the dome is cut.

    Parameters
    ----------
    section : need not be fine where the contact ends; its rim does not count.
    edge_length : there, over D; at most SHARE of the radius.
    depth : of the press, over D.
    """
    radius = min(math.sqrt(depth / 2), 0.475)
    for _ in range(MOST_PRESSES):
        end = contact_edge(replace(section, rim=(radius, min(edge_length, SHARE * radius))).build(), depth)
        if not end:  # not even first touch was reached: the press on the final mesh says why
            break
        change, radius = end / radius - 1, end
        if abs(change) < NEAR:
            break
    return radius


def contact_edge(d: Discretisation, depth: float) -> float:
    """Undeformed radius at which the contact of a press ends, in units of D."""
    path = Path(d)
    try:
        path.go(depth, np.zeros(2))
        return end_of_contact(path.state)
    finally:
        path.close()


def end_of_contact(state: PathState) -> float:
    """Undeformed radius at which the contact of a press ends, in units of D."""
    radius = plate_contact.contact_radius(state.skin, state.u, state.plate)
    return plate_contact.material_radius(state.skin, state.u, state.plate, radius)
