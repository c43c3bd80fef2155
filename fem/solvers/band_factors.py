"""Factors of a small symmetric matrix in a band, by compiled loops: half the time of PARDISO at 400 unknowns.

Sections without harmonics have so few unknowns. The matrix is indefinite, because of the pressures, but pivots are
not exchanged: L D L^T exists in any order for compressible silicone, and D has the signs of the eigenvalues. Where a
pivot is too small after all, the caller takes PARDISO or SuperLU.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from geometry import compiled
from geometry.arrays import Array, Ints

MOST_UNKNOWNS, MOST_WORK = 2500, 1.5e7
"""Limits of matrices: unknowns, and multiplications of a factorisation, beyond which PARDISO is faster over the five
or so matrices of a path."""
SAVING_S = 1e-4
"""CPU time that a factorisation saves, s."""
DENSE = 4
"""An unknown with DENSE times as many neighbours as the mean is not part of the band: the motion of the magnet."""
SMALLEST = 1e-10
"""Least pivot over the largest entry of its row."""


class BandFactors:
    """Factors of matrices of one pattern.

    Attributes
    ----------
    negative : number of negative eigenvalues of the last matrix.
    """

    def __init__(self, matrix: sp.csr_matrix) -> None:
        from fem.solvers import band_compiled

        self._kernels, self.negative = band_compiled, 0
        pointers, columns = matrix.indptr, matrix.indices
        n = len(pointers) - 1
        dense = DENSE * 2 * len(columns) // n
        order = band_compiled.order_unknowns(pointers, columns, dense)
        # a pattern need not hold every diagonal entry: pressures have none where nu = 0.5
        stiffest = int(np.argmax(np.abs(matrix.diagonal())))
        # springs of the contact come last, so that forces on them change few rows (`active_set`)
        if 2 * int(np.argmax(order == stiffest)) < len(order):
            order = np.ascontiguousarray(order[::-1])
        rest = np.setdiff1d(np.arange(n), order, assume_unique=True)
        rows = -(-len(order) // band_compiled.PANEL) * band_compiled.PANEL
        end, start, self._places = (np.empty(size, dtype=np.int64) for size in (rows, rows, len(columns)))
        size = band_compiled.lay_out(pointers, columns, order, end, start, self._places)
        # half the square of each row's length
        self.work = float(np.sum((end - np.arange(rows) + 1.0) ** 2)) / 2 if len(rest) <= 1 else np.inf
        self._count, self._order = len(order), np.append(order, rest)
        self._position = np.full(n, rows)
        self._position[order] = np.arange(len(order))
        self._workspace: tuple[Array, Array] | None = None
        self._rows = start, end
        self._values = np.empty(size), np.empty(rows), np.empty(rows + 1 if len(rest) else 0), np.empty(rows)

    def factorise(self, matrix: sp.csr_matrix) -> bool:
        """Factorise a matrix; return whether its pivots allow it."""
        U, inverse, edge, solved = self._values
        self.negative = self._kernels.factorise(
            matrix.data, self._places, *self._rows, self._count, SMALLEST, U, inverse, edge, solved
        )
        return self.negative >= 0

    @property
    def factors(self) -> tuple[Ints, Ints, Ints, Array, Array, Array, Array]:
        """Rows (n,) of the unknowns, and start, end, U, inverse, edge and solved of `band_compiled.factorise`."""
        return self._position, *self._rows, *self._values

    def workspace(self, most: int) -> tuple[Array, Array]:
        """Return arrays (most, rows) and (most, most) to work in."""
        if self._workspace is None:
            self._workspace = np.empty((most, len(self._rows[0]))), np.empty((most, most))
        return self._workspace

    def solve(self, b: Array) -> Array:
        """Solve for b (n,) or (n, m)."""
        right = b.reshape(len(b), -1)
        x = np.empty(right.shape)
        U, inverse, edge, solved = self._values
        self._kernels.solve(U, *self._rows, inverse, edge, solved, self._order, right, x)
        return x.reshape(b.shape)


def band_factors(matrix: sp.csr_matrix) -> BandFactors | None:
    """Return an object that factorises matrices of this pattern (upper triangles), or None where that is slower."""
    if matrix.shape[0] > MOST_UNKNOWNS or not compiled.worthwhile(SAVING_S):
        return None
    if compiled.load("fem.solvers.band_compiled") is None:
        return None
    factors = BandFactors(matrix)
    return factors if factors.work <= MOST_WORK else None
