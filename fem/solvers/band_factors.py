"""Factors of a small symmetric matrix in a band, by compiled loops: half the time of PARDISO at 400 unknowns.

Sections without harmonics have so few unknowns. At 3000 unknowns a factorisation takes twice the time of PARDISO's,
but order and layout are found in an eighth of the time of its symbolic phase, which pays for the first few matrices.
The matrix is indefinite, because of the pressures, but pivots are not exchanged: L D L^T exists in any order for
compressible silicone, and D has the signs of the eigenvalues. Where a pivot is too small after all, the caller takes
PARDISO or SuperLU.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from geometry import compiled
from geometry.arrays import Array, Ints

SMALL_UNKNOWNS, SMALL_WORK = 2500, 1.5e7
"""Limits of small matrices: unknowns, and multiplications of a factorisation, beyond which PARDISO is faster over the
five or so matrices of a path."""
MOST_UNKNOWNS, MOST_WORK, MOST_TURNS = 3500, 4.5e7, 2
"""Limits of all matrices: beyond these PARDISO is faster even for one matrix of a pattern, and beyond those of small
matrices from the matrix after MOST_TURNS on."""
LEAST_WIDTH = 4.5
"""Mean length of the rows of a band over that of the rows of the matrix, at least: 4.8 to 10 on sections. A band that
is too long is recognised without its order, which takes longest."""
DENSE = 4
"""An unknown with DENSE times as many neighbours as the mean is not part of the band: the motion of the magnet."""
MOST_DENSE = 2
"""Largest number of such unknowns: shift and tilt of the magnet."""
SMALLEST = 1e-10
"""Least pivot over the largest entry of its row."""


class BandFactors:
    """Factors of matrices of one pattern.

    Attributes
    ----------
    negative : number of negative eigenvalues of the last matrix.
    turns : number of matrices of the pattern after which PARDISO is faster.
    border : two or more unknowns that are not part of the band; None for fewer, which `factors` contain.
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
        self.work = float(np.sum((end - np.arange(rows) + 1.0) ** 2)) / 2 if len(rest) <= MOST_DENSE else np.inf
        small = n <= SMALL_UNKNOWNS and self.work <= SMALL_WORK
        self.turns = math.inf if small else MOST_TURNS
        self._count, self._order = len(order), np.append(order, rest)
        self._position = np.full(n, rows)
        self._position[order] = np.arange(len(order))
        self._workspace: tuple[Array, Array] | None = None
        self._rows = start, end
        edge = rows + 1 if len(rest) == 1 else 0
        self._values = np.empty(size), np.empty(rows), np.empty(edge), np.empty(rows)
        self.border = Border(matrix, order, rest) if len(rest) > 1 else None
        if self.border:
            self._places = self._places[self.border.inside]

    def factorise(self, matrix: sp.csr_matrix) -> bool:
        """Factorise a matrix; return whether its pivots allow it."""
        U, inverse, edge, solved = self._values
        border = self.border
        entries = matrix.data if border is None else matrix.data[border.inside]
        self.negative = self._kernels.factorise(
            entries, self._places, *self._rows, self._count, SMALLEST, U, inverse, edge, solved
        )
        if border and self.negative >= 0:
            added = border.factorise(matrix.data, self._solve_band)
            self.negative = -1 if added is None else self.negative + added
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
        x = self._solve_band(right)
        if self.border:
            self.border.complete(right, x)
        return x.reshape(b.shape)

    def _solve_band(self, right: Array) -> Array:
        """Solve for right sides (n, m), without the border; its unknowns are then undefined."""
        x = np.empty(right.shape)
        U, inverse, edge, solved = self._values
        order = self._order[: self._count] if self.border else self._order
        self._kernels.solve(U, *self._rows, inverse, edge, solved, order, right, x)
        return x


class Border:
    """Rows and columns of a few unknowns beside the band, eliminated after it.

    With the unknowns of the band b and the others r, the Schur complement is S = K_rr - K_rb K_bb^-1 K_br.

    Parameters
    ----------
    matrix : upper triangle of a matrix of the pattern.
    order, rest : numbers of the unknowns in the band and of the others.

    Attributes
    ----------
    inside : (e,) positions of the entries in the band.
    """

    def __init__(self, matrix: sp.csr_matrix, order: Ints, rest: Ints) -> None:
        n, columns = matrix.shape[0], matrix.indices
        rows = np.repeat(np.arange(n), np.diff(matrix.indptr))
        number = np.full(n, -1)
        number[rest] = np.arange(len(rest))
        by_row, by_column = number[rows] >= 0, number[columns] >= 0
        self.inside = np.flatnonzero(~(by_row | by_column))
        self._shape, self._band, self._rest = (len(rest), n), order, rest
        # an entry of two of these unknowns belongs to the rows of both
        self._entries = [np.flatnonzero(by_row), np.flatnonzero(by_column & (rows != columns))]
        self._places = [
            (number[rows[self._entries[0]]], columns[self._entries[0]]),
            (number[columns[self._entries[1]]], rows[self._entries[1]]),
        ]

    def factorise(self, entries: Array, solve_band: Callable[[Array], Array]) -> int | None:
        """Eliminate these unknowns; return how many eigenvalues are negative, None where one is too small.

        solve_band : solves for right sides (n, m) with the factors of the band.
        """
        self._edge = np.zeros(self._shape)
        for own, places in zip(self._entries, self._places, strict=True):
            np.add.at(self._edge, places, entries[own])
        self._solved = solve_band(np.ascontiguousarray(self._edge.T))
        corner, band = self._edge[:, self._rest], self._band
        self._schur = corner - self._edge[:, band] @ self._solved[band]
        values = np.linalg.eigvalsh(self._schur)
        if not np.abs(values).min() > SMALLEST * np.abs(self._edge).max():
            return None
        return int(np.count_nonzero(values < 0))

    def complete(self, right: Array, x: Array) -> None:
        """Complete the solution x (n, m) of the band for the right sides (n, m)."""
        band, rest = self._band, self._rest
        last = np.linalg.solve(self._schur, right[rest] - self._edge[:, band] @ x[band])
        x[band] -= self._solved[band] @ last
        x[rest] = last


def band_factors(matrix: sp.csr_matrix) -> BandFactors | None:
    """Return an object that factorises matrices of this pattern (upper triangles), or None where that is slower."""
    n = matrix.shape[0]
    if n > MOST_UNKNOWNS or (LEAST_WIDTH * matrix.nnz) ** 2 > 2 * n * MOST_WORK or not compiled.available():
        return None
    factors = BandFactors(matrix)
    return factors if factors.work <= MOST_WORK else None
