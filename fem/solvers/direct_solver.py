"""Factorisation of sparse indefinite matrices that share one pattern (`sparse_pattern`), symmetric or not.

PARDISO (of MKL, the extra `fast`) reuses its symbolic phase. Without it SuperLU gives the same answers,
with the unknowns ordered by METIS nested dissection. Small symmetric matrices are factorised by compiled loops where
these are faster (`band_factors`).
"""

from __future__ import annotations

import ctypes
import functools
import math
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from fem.solvers.band_factors import BandFactors, band_factors
from fem.solvers.sparse_pattern import nested_dissection
from geometry.arrays import Array, Ints

FEW = 10_000
"""Unknowns up to which PARDISO uses one thread and minimum-degree ordering: half the time of nested dissection."""
SINGLE = 2_000
"""Unknowns from which single precision is worth its check."""
LARGEST_ERROR = 1e-2
"""Relative error of a known solution up to which factors in single precision serve. Newton's method corrects it with
the next step; the paper's sensor has 1e-5 to 1e-4, and the error grows with the condition of the matrix."""
CHECKED = 4
"""The error is computed for each of so many matrices of a path, whose condition changes slowly."""


class SingularMatrixError(ArithmeticError):
    """The factorisation met a zero or undefined pivot."""


def have_pardiso() -> bool:
    """Return whether the extra `fast` is installed and its library loads."""
    return _mkl() is not None


@functools.cache
def _mkl() -> Any:
    """Return the MKL library, initialised by a first call; None if it is not installed."""
    if "1" in (os.environ.get("MKL_NUM_THREADS"), os.environ.get("OMP_NUM_THREADS")):
        os.environ.setdefault("MKL_THREADING_LAYER", "SEQUENTIAL")  # loads in half the time
    library = _library()
    if library is None:
        return None
    try:
        mkl = ctypes.CDLL(str(library))
    except OSError:
        return None
    mkl.MKL_Get_Max_Threads()
    return mkl


def _library() -> Path | None:
    """MKL's library: where pip puts it, or else by the list of the package's files, None if there is none."""
    folder, pattern = ("Library/bin", "mkl_rt*.dll") if sys.platform == "win32" else ("lib", "libmkl_rt.so*")
    usual = sorted((Path(sys.prefix) / folder).glob(pattern))
    if usual:
        return usual[-1]
    # only here, for the module of package lists imports those of e-mail and sockets, a tenth of a press's imports
    from importlib import metadata

    try:
        files = metadata.files("mkl") or []
    except metadata.PackageNotFoundError:
        return None
    return next((Path(str(file.locate())) for file in files if "mkl_rt" in file.name), None)


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
        self._handles: dict[bool, _Pardiso] = {}
        self._symmetric = True
        self._order: Ints | None = None
        self._inner_order: Ints | None = None
        self.kept: Ints = np.zeros(0, dtype=np.int64)
        self.schur: Array | None = None
        self._condensing: _Pardiso | None = None

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
                handle = _Pardiso(matrix, symmetric=symmetric, match=not symmetric, order=own, single=single)
                self._handles[symmetric] = handle
            handle.factorise(matrix)
            if not handle.is_accurate(matrix):
                handle.close()
                handle = self._handles[symmetric] = _Pardiso(matrix, symmetric=True, match=False, order=handle.order)
                handle.factorise(matrix)
            if handle.iparm[12] == 0 and handle.iparm[13] > 0:  # pivots were perturbed: matching is needed
                handle.close()
                handle = self._handles[symmetric] = _Pardiso(matrix, symmetric=symmetric, match=True)
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
            if self._condensing is None or not same:
                if self._condensing is not None:
                    self._condensing.close()
                self._condensing = _Pardiso(matrix, symmetric=True, match=False, kept=kept)
            schur = np.zeros((len(kept), len(kept)))
            self._condensing.factorise(matrix, schur)
            if self._condensing.iparm[13] > 0:  # pivots were perturbed
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


class _Pardiso:
    """PARDISO for matrices of one pattern: upper triangles of symmetric indefinite matrices, or unsymmetric ones.

    MKL is called directly, as its reference describes: the package pypardiso copies the structure at each call, and
    its imports take some 50 ms.

    Parameters
    ----------
    matrix : a matrix with the pattern.
    match : scale rows and permute large entries to the diagonal first. This takes most of the symbolic phase; mixed
        displacement-pressure systems need it only where elements, and with them pivots, differ by orders of
        magnitude.
    kept : unknowns that are not eliminated, but left in a Schur complement.
    order : order in which the unknowns are eliminated; default: PARDISO's own. Without `match` or `kept`.
    single : whether to factorise and solve in single precision. Without `kept`.

    Attributes
    ----------
    order, single : as above.
    iparm : (64,) MKL's parameters, numbered from 0.
    """

    def __init__(
        self,
        matrix: sp.csr_matrix,
        *,
        symmetric: bool,
        match: bool,
        kept: Ints | None = None,
        order: Ints | None = None,
        single: bool = False,
    ) -> None:
        self._mkl, self.order, self.single = _mkl(), order, single
        self._pardiso = self._mkl["pardiso"]
        self._pardiso.argtypes, self._pardiso.restype = [ctypes.c_void_p] * 16, None
        size = matrix.shape[0]
        # Newton's method corrects small errors of a solve, so solutions are refined only where pivots were perturbed
        method, perturb = 0 if size < FEW else 2, 8 if symmetric else 13
        self.iparm = np.zeros(64, dtype=np.int32)
        for i, value in {1: 1, 2: method, 10: perturb, 11: int(match), 13: int(match), 21: 1, 35: 1}.items():
            self.iparm[i - 1] = value
        # MKL takes all arguments by address: these arrays hold them, and must stay where they are in memory
        self._numbers = np.array([1, 1, -2 if symmetric else 11, 0, size, 1, 0, 0], dtype=np.int32)
        memory, permutation = np.zeros(64, dtype=np.int64), np.zeros(size, dtype=np.int32)
        if kept is not None:
            permutation[kept], self.iparm[35] = 1, 2
        elif order is not None:
            permutation[:], self.iparm[4] = order, 1
        self.iparm[27] = int(single)
        self._kept = memory, permutation, matrix.indptr, matrix.indices
        first = _address(self._numbers)
        most, which, kind, phase, many, right, talk, error = range(first, first + 32, 4)
        structure = _address(matrix.indptr), _address(matrix.indices)
        self._before = _address(memory), most, which, kind, phase, many
        self._between = *structure, _address(permutation), right, _address(self.iparm), talk
        self._error = error
        self._values, self._known, self._negative, self._turn = matrix.data, False, -1, 0
        self._type = np.dtype(np.float32 if single else np.float64)

    def factorise(self, matrix: sp.csr_matrix, schur: Array | None = None) -> None:
        """Factorise a matrix of the pattern; raises SingularMatrixError.

        schur : (c, c) array for the upper triangle of the Schur complement, where unknowns are kept.
        """
        nothing = np.zeros(0)
        with np.errstate(over="ignore"):  # `error` shows what does not fit into single precision
            self._values = matrix.data.astype(self._type, copy=False)
        self._call(22 if self._known else 12, nothing, nothing if schur is None else schur)
        self._known = True

    def solve(self, b: Array, phase: int = 33) -> Array:
        """Solve for b (n,) or (n, m); phases 331 and 333 are the steps before and after a Schur complement."""
        b = np.asfortranarray(b, dtype=self._type)
        x = np.zeros_like(b)
        self._call(phase, b, x)
        return np.asarray(x, dtype=np.float64)

    def is_accurate(self, matrix: sp.csr_matrix) -> bool:
        """Return whether the factors of an upper triangle serve Newton's method, by a known solution.

        It is computed where the number of negative pivots has changed, and for each CHECKED-th matrix.
        """
        if not self.single:
            return True
        self._turn, before, self._negative = self._turn + 1, self._negative, int(self.iparm[22])
        known = self._negative == before and self._turn % CHECKED
        return self.iparm[13] == 0 and bool(known or self.error(matrix) <= LARGEST_ERROR)

    def error(self, matrix: sp.csr_matrix) -> float:
        """Return the root mean square error of the solution 1, 1, ... by the factors of an upper triangle."""
        ones = np.ones(matrix.shape[0])
        # the first entry of a row of an upper triangle is on the diagonal
        b = matrix @ ones + matrix.T @ ones - matrix.data[matrix.indptr[:-1]]
        return float(np.linalg.norm(self.solve(b) - ones) / math.sqrt(len(b)))

    def close(self) -> None:
        """Free the memory of the factorisation."""
        nothing = np.zeros(0)
        self._call(-1, nothing, nothing)

    def _call(self, phase: int, b: Array, x: Array) -> None:
        numbers = self._numbers
        numbers[3], numbers[5], numbers[7] = phase, b.shape[1] if b.ndim == 2 else 1, 0
        # in a small system, synchronising threads costs more than they save
        own = self._mkl.MKL_Set_Num_Threads_Local(int(numbers[4] < FEW))
        values = _address(self._values)
        self._pardiso(*self._before, values, *self._between, _address(b), _address(x), self._error)
        self._mkl.MKL_Set_Num_Threads_Local(own)
        if numbers[7]:
            raise SingularMatrixError(f"PARDISO error {numbers[7]}")


def _address(array: NDArray[Any]) -> int:
    return int(array.__array_interface__["data"][0])
