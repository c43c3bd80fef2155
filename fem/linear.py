"""Sparse symmetric indefinite systems: a pattern filled again and again, and its factorisation.

PARDISO (through pypardiso, the extra `fast`) reuses its symbolic phase and counts negative pivots; SuperLU gives
the same answers otherwise.
"""

from __future__ import annotations

import ctypes
import functools
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
    groups : for each group of elements the indices (m, k) of its k unknowns; -1 marks an eliminated one.
    size : number of unknowns.
    """

    def __init__(self, groups: list[Index], size: int) -> None:
        keys = []
        self._masks = []
        for dofs in groups:
            m, k = dofs.shape
            rows = np.broadcast_to(dofs[:, :, None], (m, k, k))
            columns = np.broadcast_to(dofs[:, None, :], (m, k, k))
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
        """Sum element matrices, one array (m, k, k) per group, into the upper triangle."""
        values = np.concatenate([block[mask] for block, mask in zip(blocks, self._masks, strict=True)])
        data = np.bincount(self._inverse, weights=values, minlength=len(self._columns))
        return sp.csr_matrix((data, self._columns, self._pointers), shape=(self.size, self.size))


@functools.cache
def have_pardiso() -> bool:
    """Whether the extra `fast` is installed and its library loads."""
    try:
        import pypardiso  # noqa: F401
    except ImportError:
        return False
    return True


class Solver:
    """Factorises upper triangles that share one pattern and solves with them.

    `negative_pivots` is the number of negative eigenvalues of the last matrix, or None where the backend cannot tell.
    """

    def __init__(self, *, pardiso: bool | None = None) -> None:
        self.negative_pivots: int | None = None
        self._pardiso: Any = None
        if have_pardiso() if pardiso is None else pardiso:
            import pypardiso

            self._pardiso = pypardiso.PyPardisoSolver(mtype=-2)
            for i, value in {1: 1, 2: 2, 8: 2, 10: 8, 11: 1, 13: 1, 21: 1}.items():
                self._pardiso.set_iparm(i, value)
        self._analysed = False

    def factorise(self, upper: sp.csr_matrix) -> None:
        """Factorise; raises SingularMatrixError."""
        if not np.isfinite(upper.data).all():
            raise SingularMatrixError("the stiffness has entries that are not finite")
        if self._pardiso is None:
            full = (upper + sp.triu(upper, 1, format="csr").T).tocsc()
            try:
                self._lu = spla.splu(
                    full, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options={"SymmetricMode": True}
                )
            except RuntimeError as error:
                raise SingularMatrixError(str(error)) from error
            return
        self._upper = upper
        self._call(22 if self._analysed else 12, np.zeros(upper.shape[0]))
        self._analysed = True
        self.negative_pivots = int(self._pardiso.get_iparm(23))

    def solve(self, b: Array) -> Array:
        """Solve with the last factorisation; b and the answer have shape (n,)."""
        if self._pardiso is None:
            return np.asarray(self._lu.solve(b))
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


def set_threads(count: int) -> None:
    """Limit PARDISO's threads (no effect on SuperLU, which has one)."""
    if have_pardiso():
        import pypardiso

        pypardiso.PyPardisoSolver().libmkl.MKL_Set_Num_Threads(ctypes.c_int(count))
