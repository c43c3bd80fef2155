"""PARDISO of MKL (the extra `fast`): factors of sparse matrices that share one pattern."""

from __future__ import annotations

import ctypes
import functools
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from geometry.arrays import Array, Ints
from geometry.bad_input import SolveFailed
from geometry.compiled import threads

FEW = 10_000
"""Unknowns up to which PARDISO uses one thread and minimum-degree ordering, half the time of nested dissection, and
double precision."""
SEQUENTIAL = 1
"""MKL's number of its layer without threads."""
LARGEST_ERROR = 1e-2
"""Relative error of a known solution up to which factors in single precision serve. Newton's method corrects it with
the next step; the paper's sensor has 1e-5 to 1e-4, and the error grows with the condition of the matrix."""
CHECKED = 4
"""The error is computed for each of so many matrices of a path, whose condition changes slowly."""


class SingularMatrixError(SolveFailed):
    """The factorisation met a zero or undefined pivot."""


def have_pardiso() -> bool:
    """Return whether the extra `fast` is installed and its library loads."""
    return _mkl() is not None


@functools.cache
def _mkl() -> Any:
    """Return the MKL library, initialised by a first call; None if it is not installed."""
    library = _library()
    if library is None:
        return None
    try:
        mkl = ctypes.CDLL(str(library))
    except OSError:
        return None
    if threads() == 1:
        mkl.MKL_Set_Threading_Layer(SEQUENTIAL)  # initialised in half the time
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


class Pardiso:
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
    pairs : whether pivots may be pairs of unknowns, whose search takes a sixth of the time; where small pivots of
        single unknowns were perturbed instead, iparm[13] is their number.

    Attributes
    ----------
    order, single, pairs : as above.
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
        pairs: bool = True,
    ) -> None:
        self._mkl, self.order, self.single, self.pairs = _mkl(), order, single, pairs
        self._pardiso = self._mkl["pardiso"]
        self._pardiso.argtypes, self._pardiso.restype = [ctypes.c_void_p] * 16, None
        size = matrix.shape[0]
        # Newton's method corrects small errors of a solve, so solutions are refined only where pivots were perturbed
        method, perturb = 0 if size < FEW else 2, 8 if symmetric else 13
        self.iparm = np.zeros(64, dtype=np.int32)
        settings = {1: 1, 2: method, 10: perturb, 11: int(match), 13: int(match), 21: int(pairs), 35: 1}
        for i, value in settings.items():
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
