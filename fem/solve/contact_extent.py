"""Radius at which the contact of a press ends on the undeformed skin, from presses on meshes refined there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fem.model import plate_contact
from fem.model.mesh_specification import MeshSpecification
from fem.model.symmetry_models import Discretisation
from fem.solve.load_stepping import Path
from fem.solve.path_state import PathState

EDGE_SHARE, SETTLED_RADIUS, MOST_PRESSES = 0.05, 0.05, 3
"""EDGE_SHARE: largest edge length at the edge of the contact, over the contact radius. SETTLED_RADIUS: relative
change of the radius at which the search ends. MOST_PRESSES: largest number of presses in a search."""


def find_contact_edge(section: MeshSpecification, edge_length: float, depth: float) -> float:
    """Return the undeformed radius at which the contact of a press ends, over D, from successively refined meshes.

    Each mesh is refined at the radius that the mesh before gave. The first estimate is the circle in which the plate
    cuts the undeformed dome.

    Parameters
    ----------
    section : mesh of the press; its own refinement (`rim`, `glued`) is replaced.
    edge_length : edge length at the edge of the contact, over D; at most EDGE_SHARE of the radius.
    depth : depth of the press, over D.
    """
    return find_press(section, edge_length, depth)[0]


def find_press(section: MeshSpecification, edge_length: float, depth: float) -> tuple[float, PathState]:
    """Return the radius of `find_contact_edge`, and the press from which it results."""
    radius = min(math.sqrt(depth / 2), 0.475)
    for _ in range(MOST_PRESSES):
        state = solve_press(
            replace(section, rim=(radius, min(edge_length, EDGE_SHARE * radius)), glued=False).build(), depth
        )
        end = measure_contact_edge(state)
        if not end:  # the press did not reach first touch: the press on the final mesh reports why
            break
        change, radius = end / radius - 1, end
        if abs(change) < SETTLED_RADIUS:
            break
    return radius, state


def solve_press(d: Discretisation, depth: float) -> PathState:
    """Solve a press to a depth over D; return its last state."""
    path = Path(d)
    try:
        path.go(depth, np.zeros(2))
        return path.state
    finally:
        path.close()


def measure_contact_edge(state: PathState) -> float:
    """Return the undeformed radius at which the contact of a solved press ends, over D."""
    radius = plate_contact.contact_radius(state.skin, state.u, state.plate)
    return plate_contact.undeformed_radius(state.skin, state.u, state.plate, radius)
