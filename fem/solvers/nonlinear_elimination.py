"""A few cells brought to balance by themselves, with the rest of the body held.

At the end of a glued patch a step of Newton's method may overshoot in an element or two, and until these have settled
the steps of the whole body do little else. Where the residual hangs on so few nodes, the cells around them are solved
first, at a tenth of the cost of a step: nonlinear elimination (Lanzkron, Rose and Wilkes, SIAM J. Sci. Comput. 17,
1996; Cai and Li, SIAM J. Sci. Comput. 33, 2011).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem.contact.plate_contact import Plate
from fem.discretisation.nonlinear_system import Assembly, State, System
from geometry.arrays import Array

MOST_NODES, SHARE = 12, 0.9
"""So few nodes have to carry this share of the squared residual forces."""
LEAST_SIZE = 5000
"""Unknowns below which a body is not worth it."""


@dataclass(frozen=True, slots=True)
class Patch:
    """Cells around some nodes, as a scene of its own.

    Attributes
    ----------
    system : whose unknowns are displacements and pressures of those nodes and their next neighbours.
    plate : what is there of the plate's tied points.
    q : its unknowns at present.
    """

    system: System
    plate: Plate
    q: Array

    def merge_into(self, whole: System, state: State, part: State) -> Array:
        """Unknowns of the whole body at its state, with those of the patch from `part`."""
        u, p = state.u.copy(), _nodal_pressures(whole, state)
        u[self.system.free] = part.u[self.system.free]
        p[self.system.corner_nodes] = part.p
        return whole.unknowns(u, p[whole.corner_nodes], whole.motion(state.q))


def find_patch(system: System, state: State, assembly: Assembly, plate: Plate | None) -> Patch | None:
    """The patch of a solid body that its residual hangs on, if there is one; none with Coulomb friction."""
    e, s = system.elements, system.surface
    if e.dim == 2 or system.size < LEAST_SIZE or s is None or plate is None or plate.friction is not None:
        return None
    nodes = _worst_nodes(system, assembly)
    if nodes is None:
        return None
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
    """The nodes that carry SHARE of the squared residual forces, None if they are many."""
    forces = np.zeros(system.free.shape)
    forces[system.free] = assembly.residual[: system.n_free]
    squares = np.sum(forces**2, axis=1)
    order = np.argsort(-squares)[:MOST_NODES]
    enough = np.flatnonzero(np.cumsum(squares[order]) >= SHARE * squares.sum())
    return order[: enough[0] + 1] if len(enough) else None


def _nodal_pressures(system: System, state: State) -> Array:
    """Pressures at all nodes, shape (nodes, pressures), 0 where there is none."""
    p = np.zeros((len(system.elements.nodes), state.p.shape[1]))
    p[system.corner_nodes] = state.p
    return p
