"""Factorisation of sparse indefinite matrices that share one pattern (`sparse_pattern`), symmetric or not.

PARDISO (of MKL, the extra `fast`) reuses its symbolic phase. Without it SuperLU gives the same answers,
with the unknowns ordered by METIS nested dissection.
"""

from __future__ import annotations

import ctypes
import functools
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from geometry.arrays import Array, Ints

FEW = 10_000
"""Unknowns up to which PARDISO uses one thread and minimum-degree ordering: half the time of nested dissection."""


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
    """

    def __init__(self, *, pardiso: bool | None = None) -> None:
        self._use_pardiso = have_pardiso() if pardiso is None else pardiso
        self._handles: dict[bool, _Pardiso] = {}
        self._symmetric = True
        self._order: Ints | None = None

    def factorise(self, matrix: sp.csr_matrix, *, symmetric: bool = True) -> None:
        """Factorise an upper triangle, or a whole unsymmetric matrix; raises SingularMatrixError."""
        if not np.isfinite(matrix.data).all():
            raise SingularMatrixError("the stiffness has entries that are not finite")
        self._symmetric = symmetric
        if self._use_pardiso:
            handle = self._handles.get(symmetric)
            if handle is None:
                handle = self._handles[symmetric] = _Pardiso(matrix, symmetric=symmetric, match=not symmetric)
            handle.factorise(matrix)
            if handle.iparm[12] == 0 and handle.iparm[13] > 0:  # pivots were perturbed: matching is needed
                handle.close()
                handle = self._handles[symmetric] = _Pardiso(matrix, symmetric=symmetric, match=True)
                handle.factorise(matrix)
            return
        # SuperLU has no symmetric indefinite factorisation: it gets the whole matrix, in an order computed once
        full = (matrix + sp.triu(matrix, 1, format="csr").T).tocsr() if symmetric else matrix
        if self._order is None:
            self._order = _nested_dissection(full)
        permuted = full[self._order][:, self._order].tocsc()
        # pivots stay on the diagonal unless they are small: otherwise the factors fill up, and the pivots do not have
        # the signs of the eigenvalues
        try:
            self._lu = spla.splu(
                permuted, permc_spec="NATURAL", diag_pivot_thresh=0.01, options={"SymmetricMode": True}
            )
        except RuntimeError as error:
            raise SingularMatrixError(str(error)) from error

    def negative(self) -> int | None:
        """Return the number of negative eigenvalues of the factorised matrix (Sylvester's law of inertia).

        None where the pivots do not determine it, as for an unsymmetric matrix.
        """
        if not self._symmetric:
            return None
        if self._use_pardiso:
            return int(self._handles[True].iparm[22])
        # once rows and columns are exchanged differently, the pivots' signs are no longer those of eigenvalues
        if not np.array_equal(self._lu.perm_r, self._lu.perm_c):
            return None
        return int(np.count_nonzero(self._lu.U.diagonal() < 0))

    def solve(self, b: Array) -> Array:
        """Solve with the last factorisation; b and the result have shape (n,) or (n, m)."""
        if not self._use_pardiso:
            x = np.empty_like(b)
            x[self._order] = self._lu.solve(b[self._order])
            return x
        return self._handles[self._symmetric].solve(b)

    def close(self) -> None:
        """Free the memory of the factorisations."""
        while self._handles:
            self._handles.popitem()[1].close()


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

    Attributes
    ----------
    iparm : (64,) MKL's parameters, numbered from 0.
    """

    def __init__(self, matrix: sp.csr_matrix, *, symmetric: bool, match: bool) -> None:
        self._mkl = _mkl()
        self._pardiso = self._mkl["pardiso"]
        self._pardiso.argtypes, self._pardiso.restype = [ctypes.c_void_p] * 16, None
        size = matrix.shape[0]
        # Newton's method corrects small errors of a solve, so solutions are refined only where pivots were perturbed
        order, perturb = 0 if size < FEW else 2, 8 if symmetric else 13
        self.iparm = np.zeros(64, dtype=np.int32)
        for i, value in {1: 1, 2: order, 10: perturb, 11: int(match), 13: int(match), 21: 1, 35: 1}.items():
            self.iparm[i - 1] = value
        # MKL takes all arguments by address: these arrays hold them, and must stay where they are in memory
        self._numbers = np.array([1, 1, -2 if symmetric else 11, 0, size, 1, 0, 0], dtype=np.int32)
        memory, permutation = np.zeros(64, dtype=np.int64), np.zeros(size, dtype=np.int32)
        self._kept = memory, permutation, matrix.indptr, matrix.indices
        first = _address(self._numbers)
        most, which, kind, phase, many, right, talk, error = range(first, first + 32, 4)
        structure = _address(matrix.indptr), _address(matrix.indices)
        self._before = _address(memory), most, which, kind, phase, many
        self._between = *structure, _address(permutation), right, _address(self.iparm), talk
        self._error = error
        self._values, self._known = matrix.data, False

    def factorise(self, matrix: sp.csr_matrix) -> None:
        """Factorise a matrix of the pattern; raises SingularMatrixError."""
        self._values, nothing = matrix.data, np.zeros(0)
        self._call(22 if self._known else 12, nothing, nothing)
        self._known = True

    def solve(self, b: Array) -> Array:
        """Solve for b of shape (n,) or (n, m)."""
        b = np.asfortranarray(b, dtype=np.float64)
        x = np.empty_like(b)
        self._call(33, b, x)
        return np.ascontiguousarray(x)

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


def _nested_dissection(matrix: sp.csr_matrix) -> Ints:
    """Return an order of the unknowns of a symmetric matrix that keeps its factors sparse."""
    import pymetis

    rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    beside = rows != matrix.indices
    starts = np.append(0, np.cumsum(np.bincount(rows[beside], minlength=matrix.shape[0])))
    graph = pymetis.CSRAdjacency(starts.astype(np.int32), matrix.indices[beside].astype(np.int32))
    order, _ = pymetis.nested_dissection(adjacency=graph)
    return np.asarray(order, dtype=np.int64)
