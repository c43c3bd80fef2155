"""Factorisation of sparse indefinite matrices that share one pattern (`sparse_pattern`), symmetric or not.

PARDISO (of MKL, the extra `fast`) reuses its symbolic phase. Without it SuperLU gives the same answers,
with the unknowns ordered by METIS nested dissection. Small symmetric matrices are factorised by compiled loops where
these are faster (`band_factors`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from fem.solvers.band_factors import BandFactors, band_factors
from fem.solvers.pardiso import FEW, Pardiso, SingularMatrixError, have_pardiso
from fem.solvers.sparse_pattern import nested_dissection
from geometry.arrays import Array, Ints

SINGLE = 2_000
"""Unknowns from which single precision is worth its check."""


class Solver:
    """Factorises matrices that share one pattern, and solves with the last one.

    A matrix is the upper triangle of a symmetric one, or a whole unsymmetric one (slipping contact).

    Attributes
    ----------
    band : factors of the last matrix by compiled loops; None where a library has them.
    kept : numbers of the unknowns that `condense` kept the last time; empty before the first.
    schur : their Schur complement, for which `forward` and `backward` solve; None where there is none.
    """

    def __init__(self, *, pardiso: bool | None = None) -> None:
        self._use_pardiso = have_pardiso() if pardiso is None else pardiso
        # a library that is asked for by name takes all matrices
        self._try_band = pardiso is None
        self.band: BandFactors | None = None
        self._turns = 0
        self._handles: dict[bool, Pardiso] = {}
        self._symmetric = True
        self._order: Ints | None = None
        self._inner_order: Ints | None = None
        self.kept: Ints = np.zeros(0, dtype=np.int64)
        self.schur: Array | None = None
        self._condensing: Pardiso | None = None

    def factorise(
        self, matrix: sp.csr_matrix, *, symmetric: bool = True, order: Callable[[], Ints] | None = None
    ) -> None:
        """Factorise an upper triangle, or a whole unsymmetric matrix; raises SingularMatrixError.

        order : for steps of Newton's method, which need no more than single precision: factors of all but small
            symmetric matrices are then computed in it, in two thirds of the time, if it is accurate enough. Returns
            the order (n,) in which PARDISO eliminates the unknowns of a large matrix; called at most once. Default:
            PARDISO's own order, and double precision.
        """
        self._symmetric = symmetric
        # the band refuses pivots that are not finite
        if symmetric and self._factorise_band(matrix):
            return
        if not np.isfinite(matrix.data).all():
            raise SingularMatrixError("the stiffness has entries that are not finite")
        if self._use_pardiso:
            handle = self._handles.get(symmetric)
            if handle is None:
                size = matrix.shape[0]
                own = None if order is None or not symmetric or size < FEW else order()
                single = order is not None and symmetric and size >= SINGLE
                # pairs of pivots are rarely needed: factors in single precision are checked anyway
                handle = Pardiso(
                    matrix, symmetric=symmetric, match=not symmetric, order=own, single=single, pairs=not single
                )
                self._handles[symmetric] = handle
            handle.factorise(matrix)
            if not handle.is_accurate(matrix):
                handle.close()
                handle = self._handles[symmetric] = Pardiso(matrix, symmetric=True, match=False, order=handle.order)
                handle.factorise(matrix)
            if handle.iparm[12] == 0 and handle.iparm[13] > 0:  # pivots were perturbed: matching is needed
                handle.close()
                handle = self._handles[symmetric] = Pardiso(matrix, symmetric=symmetric, match=True)
                handle.factorise(matrix)
            return
        # SuperLU has no symmetric indefinite factorisation: it gets the whole matrix, in an order computed once
        full = (matrix + sp.triu(matrix, 1, format="csr").T).tocsr() if symmetric else matrix
        if self._order is None:
            self._order = nested_dissection(full)
        self.schur = None
        self._lu = _superlu(full[self._order][:, self._order])

    def _factorise_band(self, matrix: sp.csr_matrix) -> bool:
        """Factorise by compiled loops; return False where these are slower, or the pivots do not allow it."""
        if self._try_band and self.band is None:
            self.band = band_factors(matrix)
        self._turns += 1
        self._try_band = self.band is not None and self._turns <= self.band.turns and self.band.factorise(matrix)
        if not self._try_band:
            self.band = None
        return self._try_band

    def condense(self, matrix: sp.csr_matrix, kept: Ints) -> Array | None:
        """Return the Schur complement (c, c) of some unknowns of a symmetric matrix, given as its upper triangle.

        With the unknowns kept, c, and the others, i, it is S = K_cc - K_ci K_ii^-1 K_ic. None where the pivots of
        K_ii would have to be exchanged with others.

        Parameters
        ----------
        kept : (c,) numbers of the unknowns, increasing.

        Raises
        ------
        SingularMatrixError : entries are not finite, or K_ii is singular.
        """
        if not np.isfinite(matrix.data).all():
            raise SingularMatrixError("the stiffness has entries that are not finite")
        same, self.kept, self.schur = np.array_equal(kept, self.kept), kept, None
        if self._use_pardiso:
            schur = self._condense_by_pardiso(matrix, kept, same=same)
            if schur is None:
                return None
            upper = np.triu(schur)
            self.schur = upper + np.triu(upper, 1).T
            return self.schur
        full = (matrix + sp.triu(matrix, 1, format="csr").T).tocsr()
        inner = np.setdiff1d(np.arange(full.shape[0]), kept)
        if self._inner_order is None or not same:
            self._inner_order = inner[nested_dissection(full[inner][:, inner])]
        order = self._inner_order
        self._lu = _superlu(full[order][:, order])
        self._coupling = full[order][:, kept]
        inside = self._coupling.T @ self._lu.solve(self._coupling.toarray())
        self.schur = np.asarray(full[kept][:, kept].toarray() - inside)
        return self.schur

    def _condense_by_pardiso(self, matrix: sp.csr_matrix, kept: Ints, *, same: bool) -> Array | None:
        """Return the upper triangle (c, c) of the Schur complement; None where pivots were perturbed.

        Pairs of pivots are tried only where single ones were perturbed, and kept for the matrices after that.

        same : whether the unknowns `kept` are those of the last call.
        """
        for pairs in (False, True):
            if self._condensing is None or not same or pairs > self._condensing.pairs:
                if self._condensing is not None:
                    self._condensing.close()
                self._condensing = Pardiso(matrix, symmetric=True, match=False, kept=kept, pairs=pairs)
            schur = np.zeros((len(kept), len(kept)))
            self._condensing.factorise(matrix, schur)
            if self._condensing.iparm[13] == 0:
                return schur
            if self._condensing.pairs:
                break
        return None

    def forward(self, b: Array) -> Array:
        """Return b (n,) with the entries of the unknowns kept replaced by b_c - K_ci K_ii^-1 b_i, for `backward`."""
        if self._condensing is not None:
            return self._condensing.solve(b, phase=331)
        assert self._inner_order is not None
        y = b.copy()
        y[self.kept] -= self._coupling.T @ self._lu.solve(b[self._inner_order])
        return y

    def backward(self, y: Array, x_kept: Array) -> Array:
        """Return the solution x (n,) whose kept unknowns are `x_kept`, after `y` = `forward(b)`."""
        x = y.copy()
        x[self.kept] = x_kept
        if self._condensing is not None:
            return self._condensing.solve(x, phase=333)
        assert self._inner_order is not None
        x[self._inner_order] = self._lu.solve(y[self._inner_order] - self._coupling @ x_kept)
        return x

    def negative_inside(self, schur: Array) -> int | None:
        """Return the number of negative eigenvalues of K_ii, from the Schur complement of `condense`.

        Haynsworth: those of the whole matrix are those of K_ii and those of its Schur complement.
        """
        if self._condensing is not None:
            return int(self._condensing.iparm[22]) - count_negative(schur)
        return _negative_pivots(self._lu)

    def negative(self) -> int | None:
        """Return the number of negative eigenvalues of the factorised matrix (Sylvester's law of inertia).

        None where the pivots do not determine it, as for an unsymmetric matrix.
        """
        if not self._symmetric:
            return None
        if self.band is not None:
            return self.band.negative
        if self._use_pardiso:
            return int(self._handles[True].iparm[22])
        return _negative_pivots(self._lu)

    def solve(self, b: Array) -> Array:
        """Solve with the last factorisation; b and the result have shape (n,) or (n, m)."""
        if self._symmetric and self.band is not None:
            return self.band.solve(b)
        if not self._use_pardiso:
            x = np.empty_like(b)
            x[self._order] = self._lu.solve(b[self._order])
            return x
        return self._handles[self._symmetric].solve(b)

    def close(self) -> None:
        """Free the memory of the factorisations."""
        while self._handles:
            self._handles.popitem()[1].close()
        if self._condensing is not None:
            self._condensing.close()
            self._condensing = None


def count_negative(symmetric: Array) -> int:
    """Return the number of negative eigenvalues of a dense symmetric matrix (n, n)."""
    return int(np.count_nonzero(np.linalg.eigvalsh(symmetric) < 0))


def _superlu(ordered: sp.csr_matrix) -> Any:
    """Factorise a matrix whose unknowns are ordered; raises SingularMatrixError."""
    # pivots stay on the diagonal unless they are small: otherwise the factors fill up, and the pivots do not have
    # the signs of the eigenvalues
    try:
        return spla.splu(
            ordered.tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.01, options={"SymmetricMode": True}
        )
    except RuntimeError as error:
        raise SingularMatrixError(str(error)) from error


def _negative_pivots(lu: Any) -> int | None:
    """Return the number of negative pivots; None where they are not those of eigenvalues."""
    # once rows and columns are exchanged differently, the pivots' signs are no longer those of eigenvalues
    if not np.array_equal(lu.perm_r, lu.perm_c):
        return None
    return int(np.count_nonzero(lu.U.diagonal() < 0))
