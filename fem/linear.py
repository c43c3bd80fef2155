"""Sparse symmetric indefinite systems: a pattern filled again and again, and its factorisation.

PARDISO (through pypardiso, the extra `fast`) reuses its symbolic phase; SuperLU gives
the same answers otherwise, after METIS has ordered the unknowns by nested dissection.
"""

from __future__ import annotations

import functools
import importlib.metadata
import os
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class SingularMatrixError(ArithmeticError):
    """The factorisation met a pivot it could not divide by."""


class Pattern:
    """The upper triangle of a symmetric sparse matrix assembled from dense element matrices.

    Parameters
    ----------
    groups : for each group of elements the indices of its rows (m, k) and columns (m, l); -1 marks an eliminated one.
    size : number of unknowns.
    """

    def __init__(self, groups: list[tuple[Index, Index]], size: int) -> None:
        keys = []
        self._masks = []
        for row, column in groups:
            shape = (*row.shape, column.shape[1])
            rows = np.broadcast_to(row[:, :, None], shape)
            columns = np.broadcast_to(column[:, None, :], shape)
            mask = (rows >= 0) & (columns >= rows)
            keys.append(rows[mask] * size + columns[mask])
            self._masks.append(mask)
        diagonal = np.arange(size, dtype=np.int64) * (size + 1)
        unique, inverse = np.unique(np.concatenate([diagonal, *keys]), return_inverse=True)
        self._inverse = inverse[size:]
        self._columns = (unique % size).astype(np.int32)
        self._pointers = np.searchsorted(unique, np.arange(size + 1, dtype=np.int64) * size).astype(np.int32)
        self.size = size

    def assemble(self, blocks: list[Array]) -> sp.csr_matrix:
        """Sum element matrices, one array (m, k, l) per group, into the upper triangle."""
        values = np.concatenate([block[mask] for block, mask in zip(blocks, self._masks, strict=True)])
        data = np.bincount(self._inverse, weights=values, minlength=len(self._columns))
        return sp.csr_matrix((data, self._columns, self._pointers), shape=(self.size, self.size))


@functools.cache
def have_pardiso() -> bool:
    """Whether the extra `fast` is installed and its library loads."""
    _locate_mkl()
    try:
        import pypardiso  # noqa: F401
    except ImportError:
        return False
    return True


def _locate_mkl() -> None:
    """Tell pypardiso where MKL is: it would search the whole environment's tree, 0.3 s for every solver."""
    try:
        parts = importlib.metadata.files("mkl") or []
    except importlib.metadata.PackageNotFoundError:
        return
    for part in parts:
        if "mkl_rt" in part.name:
            os.environ.setdefault("PYPARDISO_MKL_RT", str(part.locate()))
            return


class Solver:
    """Factorises upper triangles that share one pattern and solves with them."""

    def __init__(self, *, pardiso: bool | None = None) -> None:
        self._pardiso: Any = None
        if have_pardiso() if pardiso is None else pardiso:
            import pypardiso

            self._pardiso = pypardiso.PyPardisoSolver(mtype=-2)
            for i, value in {1: 1, 2: 2, 8: 2, 10: 8, 11: 1, 13: 1, 21: 1}.items():
                self._pardiso.set_iparm(i, value)
        self._analysed = False
        self._order: Index | None = None

    def factorise(self, upper: sp.csr_matrix) -> None:
        """Factorise; raises SingularMatrixError."""
        if not np.isfinite(upper.data).all():
            raise SingularMatrixError("the stiffness has entries that are not finite")
        if self._pardiso is None:
            full = (upper + sp.triu(upper, 1, format="csr").T).tocsr()
            if self._order is None:
                self._order = _nested_dissection(full)
            permuted = full[self._order][:, self._order].tocsc()
            try:
                self._lu = spla.splu(
                    permuted, permc_spec="NATURAL", diag_pivot_thresh=0.01, options={"SymmetricMode": True}
                )
            except RuntimeError as error:
                raise SingularMatrixError(str(error)) from error
            return
        self._upper = upper
        self._call(22 if self._analysed else 12, np.zeros(upper.shape[0]))
        self._analysed = True

    def negative(self) -> int | None:
        """Number of negative eigenvalues of the factorised matrix (Sylvester), or None if its pivots do not tell."""
        if self._pardiso is not None:
            return int(self._pardiso.get_iparm(23))
        if not np.array_equal(self._lu.perm_r, self._lu.perm_c):
            return None
        return int(np.count_nonzero(self._lu.U.diagonal() < 0))

    def solve(self, b: Array) -> Array:
        """Solve with the last factorisation; b and the answer have shape (n,)."""
        if self._pardiso is None:
            x = np.empty_like(b)
            x[self._order] = self._lu.solve(b[self._order])
            return x
        return self._call(33, b)

    def _call(self, phase: int, b: Array) -> Array:
        import pypardiso.pardiso_wrapper as wrapper

        self._pardiso.set_phase(phase)
        try:
            return np.asarray(self._pardiso._call_pardiso(self._upper, np.ascontiguousarray(b)))
        except wrapper.PyPardisoError as error:
            raise SingularMatrixError(f"PARDISO error {error.value}") from error

    def close(self) -> None:
        """Give the factorisation's memory back."""
        if self._pardiso is not None and self._analysed:
            self._pardiso.set_phase(-1)
            self._pardiso._call_pardiso(self._upper, np.zeros(self._upper.shape[0]))
            self._analysed = False


def _nested_dissection(matrix: sp.csr_matrix) -> Index:
    """Order of the unknowns of a symmetric matrix that keeps its factors sparse."""
    import pymetis

    rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    beside = rows != matrix.indices
    starts = np.append(0, np.cumsum(np.bincount(rows[beside], minlength=matrix.shape[0])))
    graph = pymetis.CSRAdjacency(starts.astype(np.int32), matrix.indices[beside].astype(np.int32))
    order, _ = pymetis.nested_dissection(adjacency=graph)
    return np.asarray(order, dtype=np.int64)
