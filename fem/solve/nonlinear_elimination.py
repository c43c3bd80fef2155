"""Equilibrium of a few cells with the rest of the body held fixed.

At the edge of a glued area a Newton step may overshoot in one or two elements, and until these have settled the steps
of the whole body do little else. Where the residual is concentrated on so few nodes, the cells around them are solved
first, at a tenth of the cost of a step: nonlinear elimination (Lanzkron, Rose and Wilkes, SIAM J. Sci. Comput. 17,
1996; Cai and Li, SIAM J. Sci. Comput. 33, 2011).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem.model.nonlinear_system import Assembly, State, System
from fem.model.plate_contact import Plate
from geometry.arrays import Array

MOST_NODES, SHARE = 24, 0.9
"""The residual is concentrated if at most MOST_NODES nodes carry the share SHARE of the squared residual forces."""
LEAST_SIZE = 5000
"""Number of unknowns below which a full step is too cheap for elimination to pay off."""


@dataclass(frozen=True, slots=True)
class Patch:
    """Cells around some nodes, as a system of their own.

    Attributes
    ----------
    system : its unknowns are displacements and pressures of these nodes and of their neighbours.
    plate : the plate, with the tied points of the patch.
    q : present unknowns of the patch.
    """

    system: System
    plate: Plate
    q: Array

    def merge_into(self, whole: System, state: State, part: State) -> Array:
        """Return the unknowns of the whole body at a state, with those of the patch replaced by `part`."""
        u, p = state.u.copy(), _nodal_pressures(whole, state)
        u[self.system.free] = part.u[self.system.free]
        p[self.system.corner_nodes] = part.p
        return whole.unknowns(u, p[whole.corner_nodes], whole.motion(state.q))


def find_patch(system: System, state: State, assembly: Assembly, plate: Plate | None) -> Patch | None:
    """Return the few cells of a solid that carry most of the residual; None if there are none, or with friction."""
    e, s = system.elements, system.surface
    if e.dim == 2 or system.size < LEAST_SIZE or s is None or plate is None or plate.friction is not None:
        return None
    nodes = _worst_nodes(system, assembly)
    if nodes is None:
        return None
    # all nodes of the cells around the worst nodes become unknowns; one more ring of cells holds them in place
    inside = np.zeros(len(e.nodes), dtype=bool)
    inside[nodes] = True
    inside[e.cells[inside[e.cells].any(axis=1)]] = True
    cells, facets = inside[e.cells].any(axis=1), inside[s.nodes].any(axis=1)
    p = _nodal_pressures(system, state)
    part = System(
        replace(e, cells=e.cells[cells], D=e.D[cells], weights=e.weights[cells]),
        replace(s, nodes=s.nodes[facets], weights=s.weights[facets], points=s.points[facets]),
        system.mu[cells, 0],
        system.inverse_K[cells, 0],
        ~(system.free & inside[:, None]),
        law=system.law,
        dead=system.dead,
        prescribed=state.u,
        held=np.where(inside[:, None], np.nan, p),
    )
    here = replace(
        plate,
        pressed=None,
        tied=None if plate.tied is None else plate.tied[facets],
        targets=None if plate.targets is None else plate.targets[facets],
        gap=None if plate.gap is None else plate.gap[facets],
    )
    return Patch(part, here, part.unknowns(state.u, p[part.corner_nodes], np.zeros(0)))


def _worst_nodes(system: System, assembly: Assembly) -> NDArray[np.int64] | None:
    """Return the nodes that carry SHARE of the squared residual forces; None if they are many."""
    forces = np.zeros(system.free.shape)
    forces[system.free] = assembly.residual[: system.n_free]
    squares = np.sum(forces**2, axis=1)
    order = np.argsort(-squares)[:MOST_NODES]
    enough = np.flatnonzero(np.cumsum(squares[order]) >= SHARE * squares.sum())
    return order[: enough[0] + 1] if len(enough) else None


def _nodal_pressures(system: System, state: State) -> Array:
    """Return the pressures at all nodes, shape (nodes, pressures); 0 at nodes without."""
    p = np.zeros((len(system.elements.nodes), state.p.shape[1]))
    p[system.corner_nodes] = state.p
    return p
