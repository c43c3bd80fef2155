"""Factorisation of sparse indefinite matrices that share one pattern (`sparse_pattern`), symmetric or not.

PARDISO (of MKL, the extra `fast`) takes all matrices. Without it qdldl takes the symmetric ones, and gives their
inertia too; SuperLU the unsymmetric ones, and the symmetric ones that need other pivots, whose inertia is then
unknown.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from fem.model.sparse_pattern import nested_dissection
from fem.solve.inertia import UNKNOWN, Stability, count_negative
from fem.solve.pardiso import FEW, Pardiso, SingularMatrixError, have_pardiso
from geometry.arrays import Array, Ints

LARGEST_BACKWARD_ERROR = 1e-12
"""Largest residual of a known solution over the entries of the matrix and of the solution, up to which pivots without
exchanges serve. Sections of nu 0 to 0.5, before and beyond an onset of instability, have at most 2e-15."""


class Solver:
    """Factorises matrices that share one pattern, and solves with the last one.

    A matrix is the upper triangle of a symmetric one, or a whole unsymmetric one (slipping contact).

    Attributes
    ----------
    kept : numbers of the unknowns that `condense` kept the last time; empty before the first.
    schur : their Schur complement, for which `forward` and `backward` solve; None where there is none.
    """

    def __init__(self, *, pardiso: bool | None = None) -> None:
        self._use_pardiso = have_pardiso() if pardiso is None else pardiso
        self._handles: dict[bool, Pardiso] = {}
        self._symmetric = True
        self._order: Ints | None = None
        self._ldl: Ldl | None = None
        self._inside: Ldl | None = None
        self.kept: Ints = np.zeros(0, dtype=np.int64)
        self.schur: Array | None = None
        self._condensing: Pardiso | None = None

    def factorise(
        self, matrix: sp.csr_matrix, *, symmetric: bool = True, order: Callable[[], Ints] | None = None
    ) -> None:
        """Factorise an upper triangle, or a whole unsymmetric matrix; raises SingularMatrixError.

        order : for steps of Newton's method, which need no more than single precision: factors of large symmetric
            matrices are then computed in it, in two thirds of the time, if it is accurate enough. Returns the order
            (n,) in which PARDISO eliminates the unknowns of a large matrix; called at most once. Default: PARDISO's
            own order, and double precision.
        """
        self._symmetric = symmetric
        if not np.isfinite(matrix.data).all():
            raise SingularMatrixError("the stiffness has entries that are not finite")
        if self._use_pardiso:
            self._factorise_by_pardiso(matrix, order if symmetric and matrix.shape[0] >= FEW else None)
            return
        if symmetric:
            self._ldl = self._ldl or Ldl(matrix)
            if self._ldl.factorise(matrix):
                return
        # SuperLU has no symmetric indefinite factorisation: it gets the whole matrix, in an order computed once
        full = (matrix + sp.triu(matrix, 1, format="csr").T).tocsr() if symmetric else matrix
        if self._order is None:
            self._order = nested_dissection(full)
        self._lu = _superlu(full[self._order][:, self._order])

    def _factorise_by_pardiso(self, matrix: sp.csr_matrix, order: Callable[[], Ints] | None) -> None:
        """Factorise by PARDISO; `order` for a large matrix in single precision."""
        symmetric = self._symmetric
        handle = self._handles.get(symmetric)
        if handle is None:
            own, single = (None, False) if order is None else (order(), True)
            # pairs of pivots are rarely needed: factors in single precision are checked anyway
            handle = Pardiso(
                matrix, symmetric=symmetric, match=not symmetric, order=own, single=single, pairs=not single
            )
        handle.factorise(matrix)
        if not handle.is_accurate(matrix):
            handle.close()
            handle = Pardiso(matrix, symmetric=True, match=False, order=handle.order)
            handle.factorise(matrix)
        if handle.iparm[12] == 0 and handle.iparm[13] > 0:  # pivots were perturbed: matching is needed
            handle.close()
            handle = Pardiso(matrix, symmetric=symmetric, match=True)
            handle.factorise(matrix)
        self._handles[symmetric] = handle

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
            if self._condensing is None or not same:
                self._close_condensing()
                self._condensing = Pardiso(matrix, symmetric=True, match=False, kept=kept)
            upper = np.zeros((len(kept), len(kept)))
            self._condensing.factorise(matrix, upper)
            if self._condensing.iparm[13]:  # pivots were perturbed
                return None
            self.schur = np.triu(upper) + np.triu(upper, 1).T
            return self.schur
        inner = np.setdiff1d(np.arange(matrix.shape[0]), kept)
        inside = matrix[inner][:, inner]
        if self._inside is None or not same:
            self._inside, self._inner = Ldl(inside), inner
        if not self._inside.factorise(inside):
            return None
        parts, corner = (matrix[inner][:, kept], matrix[kept][:, inner].T), matrix[kept][:, kept].toarray()
        self._coupling = parts[0] + parts[1]
        rows = np.concatenate([part.tocoo().row for part in parts])
        self.schur = corner + np.triu(corner, 1).T - self._inside.condense(self._coupling.toarray(), rows)
        return self.schur

    def forward(self, b: Array) -> Array:
        """Return b (n,) with the entries of the unknowns kept replaced by b_c - K_ci K_ii^-1 b_i, for `backward`."""
        if self._condensing is not None:
            return self._condensing.solve(b, phase=331)
        assert self._inside is not None
        y = b.copy()
        y[self.kept] -= self._coupling.T @ self._inside.solve(b[self._inner])
        return y

    def backward(self, y: Array, x_kept: Array) -> Array:
        """Return the solution x (n,) whose kept unknowns are `x_kept`, after `y` = `forward(b)`."""
        x = y.copy()
        x[self.kept] = x_kept
        if self._condensing is not None:
            return self._condensing.solve(x, phase=333)
        assert self._inside is not None
        x[self._inner] = self._inside.solve(y[self._inner] - self._coupling @ x_kept)
        return x

    def stability_with(self, schur: Array, added: Array, pressures: int) -> Stability:
        """Return the stability with a stiffness (c, c) added to the unknowns kept, from the complement of `condense`.

        Haynsworth: the inertia of the whole matrix is that of K_ii and that of its Schur complement.
        """
        if self._condensing is not None:
            inside: int | None = int(self._condensing.iparm[22]) - count_negative(schur)
        else:
            assert self._inside is not None
            inside = self._inside.negative
        if inside is None:
            return UNKNOWN
        return Stability.counted(inside + count_negative(schur + added), pressures)

    def stability(self, pressures: int) -> Stability:
        """Return the stability of a body with a number of pressures, from the factorised matrix."""
        return Stability.counted(self._negative(), pressures) if self._symmetric else UNKNOWN

    def _negative(self) -> int | None:
        """Return the number of negative eigenvalues of the symmetric matrix; None where its pivots do not tell."""
        if self._use_pardiso:
            iparm = self._handles[True].iparm
            # a perturbed pivot may have either sign
            return None if iparm[13] else int(iparm[22])
        assert self._ldl is not None
        return self._ldl.negative

    def solve(self, b: Array) -> Array:
        """Solve with the last factorisation; b and the result have shape (n,) or (n, m)."""
        if not self._use_pardiso:
            if self._symmetric and self._ldl is not None and self._ldl.sound:
                return self._ldl.solve(b)
            x = np.empty_like(b)
            x[self._order] = self._lu.solve(b[self._order])
            return x
        return self._handles[self._symmetric].solve(b)

    def close(self) -> None:
        """Free the memory of the factorisations."""
        while self._handles:
            self._handles.popitem()[1].close()
        self._close_condensing()

    def _close_condensing(self) -> None:
        if self._condensing is not None:
            self._condensing.close()
            self._condensing = None


class Ldl:
    """L D L^T by qdldl, in an order of minimum degree, of symmetric matrices of one pattern: upper triangles.

    Pivots are not exchanged. Such factors exist in any order for a saddle point whose two diagonal blocks are
    definite (Vanderbei 1995), but need not beyond an onset of instability: a known solution checks each matrix.

    Attributes
    ----------
    sound : whether the last matrix has factors without exchanges that reproduce it.
    """

    def __init__(self, matrix: sp.csr_matrix) -> None:
        import qdldl  # only here, for with PARDISO it is not used

        self._start, n = qdldl.Solver, matrix.shape[0]
        rows = np.repeat(np.arange(n), np.diff(matrix.indptr))
        # qdldl wants every diagonal entry; those that the pattern lacks are numbered 0
        numbers = np.append(np.arange(1, matrix.nnz + 1), np.zeros(n, dtype=np.int64))
        entries = np.append(rows, np.arange(n)), np.append(matrix.indices, np.arange(n))
        columns = sp.coo_matrix((numbers, entries), shape=(n, n)).tocsc()
        self._places, self.sound = columns.data, False
        self._columns = columns.astype(np.float64)
        self._factors: Any = None
        self._reach: Ints | None = None

    def factorise(self, matrix: sp.csr_matrix) -> bool:
        """Factorise a matrix of the pattern; return whether it is sound."""
        self._columns.data = np.append(0.0, matrix.data)[self._places]
        try:
            if self._factors is None:
                self._factors = self._start(self._columns, upper=True)
            else:
                self._factors.update(self._columns, upper=True)
        except RuntimeError:  # a pivot is 0; an update leaves the later ones as they were without a word
            self._factors, self.sound = None, False
            return False
        ones = np.ones(matrix.shape[0])
        x = self.solve(_multiply(matrix, ones))
        error = np.abs(_multiply(matrix, ones - x)).max()
        self.sound = bool(error <= LARGEST_BACKWARD_ERROR * np.abs(matrix.data).max() * np.abs(x).max())
        return self.sound

    @property
    def negative(self) -> int | None:
        """Number of negative eigenvalues; None where the factors are not sound."""
        if not self.sound:
            return None
        pivots = self._pivots()[1]
        return int(np.count_nonzero(pivots < 0))

    def solve(self, b: Array) -> Array:
        """Solve for b (n,) or (n, m)."""
        if b.ndim == 1:
            return np.asarray(self._factors.solve(b))
        return np.stack([self._factors.solve(column) for column in np.ascontiguousarray(b.T)], axis=1)

    def condense(self, b: Array, rows: Ints) -> Array:
        """Return b^T K^-1 b = y^T D^-1 y (c, c) with y = L^-1 b for b (n, c).

        rows : rows of b that are not 0, the same for each matrix. Only the unknowns that L couples them to are
            solved for: a third of those of a section, so that a dense matrix of them is ten times as fast as L.
        """
        L, D, order = self._pivots()
        if self._reach is None:
            # with -1 for all entries of L nothing cancels
            ones = sp.csr_matrix((np.full(L.nnz, -1.0), L.indices, L.indptr), shape=L.shape).T.tocsr()
            start = np.isin(order, rows).astype(np.float64)
            self._reach = np.flatnonzero(spla.spsolve_triangular(ones, start, lower=True, unit_diagonal=True))
        coupled = self._reach
        dense = L[coupled][:, coupled].toarray()
        y = scipy.linalg.solve_triangular(dense, b[order][coupled], lower=True, unit_diagonal=True)
        return np.asarray(y.T @ (y / D[coupled, None]))

    def _pivots(self) -> tuple[sp.csc_matrix, Array, Ints]:
        """Return L without its diagonal, D, and the order of the unknowns."""
        L, D, order = self._factors.factors()
        return L, D, order


def _multiply(upper: sp.csr_matrix, x: Array) -> Array:
    """Return the product (n,) of a symmetric matrix, given as its upper triangle, with x (n,)."""
    return np.asarray(upper @ x + upper.T @ x - upper.diagonal() * x)


def _superlu(ordered: sp.csr_matrix) -> Any:
    """Factorise a matrix whose unknowns are ordered; raises SingularMatrixError."""
    # pivots stay on the diagonal unless they are small: otherwise the factors fill up
    try:
        return spla.splu(
            ordered.tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.01, options={"SymmetricMode": True}
        )
    except RuntimeError as error:
        raise SingularMatrixError(str(error)) from error
