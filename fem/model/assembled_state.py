"""A trial state of a nonlinear system, and what is assembled there."""

from __future__ import annotations

from dataclasses import dataclass

import scipy.sparse as sp

from geometry.arrays import Array


@dataclass(frozen=True, slots=True)
class State:
    """Displacements and pressures of given unknowns.

    Attributes
    ----------
    q : (n,) unknowns.
    u : (nodes, fields) displacements.
    p : (corners, pressures) pressures; on the axis of a section those of the harmonics are 0.
    least_J : least volume ratio J at the integration points; 1 where not computed.
    """

    q: Array
    u: Array
    p: Array
    least_J: float = 1.0


@dataclass(frozen=True, slots=True)
class Assembly:
    """Residual, energy and tangent at a state; `forces` are the nodal ones before elimination.

    The tangent is the upper triangle of a symmetric matrix, or the whole unsymmetric matrix where the contact slips.
    `norms` are those of the reactions, and of the residual's forces and volumes, where the assembly knows them.
    """

    residual: Array
    energy: float
    forces: Array
    matrix: sp.csr_matrix | None
    symmetric: bool = True
    norms: tuple[float, float, float] | None = None

    @property
    def tangent(self) -> sp.csr_matrix:
        """The tangent; `assemble` must have been called with `tangent`."""
        assert self.matrix is not None
        return self.matrix
