"""Factors of sparse matrices that share one pattern (`sparse_pattern`), and the stability that their pivots tell.

PARDISO (of MKL, the extra `fast`) takes all matrices. Without it qdldl takes the symmetric ones, and gives their
inertia too; SuperLU the unsymmetric ones, and the symmetric ones that need other pivots, whose inertia is then
unknown.

By Sylvester's law of inertia the pivots D of a symmetric matrix K = L D L^T have the signs of its eigenvalues. Each
pressure of a saddle point adds a negative eigenvalue; those beyond them are directions in which the body is unstable.
The count is unknown where the stiffness is unsymmetric (a slipping contact) or its pivots do not have these signs.
"""

from __future__ import annotations

import ctypes
import functools
import math
import sys
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from fem.model.sparse_pattern import nested_dissection
from fem.solution import UNKNOWN, Stability
from geometry.arrays import Array, Ints
from geometry.bad_input import SolveFailed
from geometry.compiled import compiled, threads

LARGEST_BACKWARD_ERROR = 1e-12
"""Largest residual of a known solution over the entries of the matrix and of the solution, up to which pivots without
exchanges serve. Sections of nu 0 to 0.5, before and beyond an onset of instability, have at most 2e-15."""
SINGLE, FEW = 4000, 10_000
"""Unknowns from which PARDISO uses single precision where that serves, and up to which one thread and minimum-degree
ordering, half the time of nested dissection."""
LARGEST_ERROR = 1e-2
"""Relative error of a known solution up to which factors in single precision serve. Newton's method corrects it with
the next step; the paper's sensor has 1e-5 to 1e-4, and the error grows with the condition of the matrix."""


class SingularMatrixError(SolveFailed):
    """The factorisation met a zero or undefined pivot."""


class Solver:
    """Factorises matrices that share one pattern, and solves with the last one.

    A matrix is the upper triangle of a symmetric one, or a whole unsymmetric one (slipping contact).

    outer : numbers of the unknowns that `condense` kept the last time; empty before the first.
    schur : their Schur complement, for which `forward` and `backward` solve; None where there is none.
    """

    def __init__(self, *, pardiso: bool | None = None) -> None:
        self._use_pardiso = have_pardiso() if pardiso is None else pardiso
        self._symmetric = True
        self._factors: dict[bool, Pardiso | PlainFactors] = {}
        self._condensed: PardisoCondensed | PlainCondensed | None = None
        self.outer: Ints = np.zeros(0, dtype=np.int64)
        self.schur: Array | None = None

    def factorise(self, matrix: sp.csr_matrix, *, symmetric: bool = True, single: bool = False) -> None:
        """Factorise an upper triangle, or a whole unsymmetric matrix; raises SingularMatrixError.

        single : whether single precision serves, as for steps of Newton's method: factors of symmetric matrices that
            are not small are then computed in it, in two thirds of the time, if it is accurate enough.
        """
        _check_finite(matrix)
        self._symmetric = symmetric
        if symmetric not in self._factors and self._use_pardiso:
            single = single and symmetric and matrix.shape[0] >= SINGLE
            self._factors[symmetric] = Pardiso(matrix, symmetric, single=single)
        elif symmetric not in self._factors:
            self._factors[symmetric] = PlainFactors(symmetric)
        self._factors[symmetric].factorise(matrix)

    def solve(self, b: Array) -> Array:
        """Solve with the last factorisation; b and the result have shape (n,) or (n, m)."""
        return self._factors[self._symmetric].solve(b)

    def stability(self, pressures: int) -> Stability:
        """Return the stability of a body with a number of pressures, from the factorised matrix."""
        return Stability.counted(self._factors[True].negative, pressures) if self._symmetric else UNKNOWN

    def condense(self, matrix: sp.csr_matrix, outer: Ints) -> Array | None:
        """Return the Schur complement (c, c) of some unknowns of a symmetric matrix, given as its upper triangle.

        With the unknowns kept, c, `outer` in rising order, and the others, i, it is S = K_cc - K_ci K_ii^-1 K_ic.
        None where pivots of K_ii would have to be exchanged with others; SingularMatrixError where it is singular.
        """
        _check_finite(matrix)
        if self._condensed is None or not np.array_equal(outer, self.outer):
            self._condensed = (PardisoCondensed if self._use_pardiso else PlainCondensed)(matrix, outer)
        self.outer, self.schur = outer, None
        self.schur = self._condensed.condense(matrix)
        return self.schur

    def forward(self, b: Array) -> Array:
        """Return b (n,) with the entries of the unknowns kept replaced by b_c - K_ci K_ii^-1 b_i, for `backward`."""
        assert self._condensed is not None
        return self._condensed.forward(b)

    def backward(self, y: Array, x_outer: Array) -> Array:
        """Return the solution x (n,) whose kept unknowns are `x_outer`, after `y` = `forward(b)`."""
        assert self._condensed is not None
        x = y.copy()
        x[self.outer] = x_outer
        return self._condensed.backward(x)

    def stability_with(self, schur: Array, added: Array, pressures: int) -> Stability:
        """Return the stability with a stiffness (c, c) added to the unknowns kept, from the complement of `condense`.

        Haynsworth: the inertia of the whole matrix is that of K_ii and that of its Schur complement.
        """
        assert self._condensed is not None
        inside = self._condensed.negative_inside(schur)
        return Stability.counted(None if inside is None else inside + _count_negative(schur + added), pressures)


def _check_finite(matrix: sp.csr_matrix) -> None:
    if not np.isfinite(matrix.data).all():
        raise SingularMatrixError("the stiffness has entries that are not finite")


def _count_negative(symmetric: Array) -> int:
    return int(np.count_nonzero(np.linalg.eigvalsh(symmetric) < 0))


def multiply(upper: sp.csr_matrix, x: Array) -> Array:
    """Return the product of a symmetric matrix, given as its upper triangle, with x, (n,) or (n, m)."""
    return np.asarray(upper @ x + upper.T @ x - (upper.diagonal() * x.T).T)


def norm(x: Array) -> float:
    """Return the Euclidean norm of (n,) numbers: `numpy.linalg.norm`, but faster for few."""
    return math.sqrt(x @ x)


class Ldl:
    """L D L^T by qdldl, in an order of minimum degree, of symmetric matrices of one pattern: upper triangles.

    Pivots are not exchanged. Such factors exist in any order for a saddle point whose two diagonal blocks are
    definite (Vanderbei 1995), but need not beyond an onset of instability: a known solution checks each matrix.
    """

    _factors: Any = None

    def factorise(self, matrix: sp.csr_matrix) -> bool:
        """Factorise a matrix of the pattern; return whether factors without exchanges reproduce it."""
        import qdldl  # only here, for with PARDISO it is not used

        try:
            if self._factors is None:
                self._factors = qdldl.Solver(matrix.tocsc(), upper=True)
            else:
                self._factors.update(matrix.tocsc(), upper=True)
        except RuntimeError:  # a pivot is 0; an update leaves the later ones as they were without a word
            self._factors = None
            return False
        ones = np.ones(matrix.shape[0])
        x = self.solve(multiply(matrix, ones))
        error = np.abs(multiply(matrix, ones - x)).max()
        return bool(error <= LARGEST_BACKWARD_ERROR * np.abs(matrix.data).max() * np.abs(x).max())

    @property
    def negative(self) -> int:
        return int(np.count_nonzero(self._factors.factors()[1] < 0))

    def solve(self, b: Array) -> Array:
        if b.ndim == 1:
            return np.asarray(self._factors.solve(b))
        return np.stack([self._factors.solve(column) for column in np.ascontiguousarray(b.T)], axis=1)

    def condense(self, b: Array) -> Array:
        """Return b^T K^-1 b = y^T D^-1 y (c, c) with y = L^-1 b for b (n, c)."""
        L, D, order = self._factors.factors()  # L without its diagonal
        y = b[order]
        _solve_lower(L.indptr, L.indices, L.data, y)
        return np.asarray(y.T @ (y / D[:, None]))


@compiled
def _solve_lower(starts: Ints, rows: Ints, values: Array, y: Array) -> None:
    """Replace y (n, c) by L^-1 y for a unit lower triangle by columns, in a third of the time of SciPy's solution."""
    for j in range(len(y)):
        if np.any(y[j]):
            for k in range(starts[j], starts[j + 1]):
                y[rows[k]] -= values[k] * y[j]


class PlainFactors:
    """Factors without MKL: by qdldl, or by SuperLU where that does not serve."""

    def __init__(self, symmetric: bool) -> None:
        self._ldl = Ldl() if symmetric else None
        self._order: Ints | None = None
        self._lu: Any = None

    def factorise(self, matrix: sp.csr_matrix) -> None:
        self._lu = None
        if self._ldl is not None:
            if self._ldl.factorise(matrix):
                return
            # SuperLU has no symmetric indefinite factorisation: it gets the whole matrix
            matrix = (matrix + sp.triu(matrix, 1, format="csr").T).tocsr()
        if self._order is None:
            self._order = nested_dissection(matrix)
        ordered = matrix[self._order][:, self._order].tocsc()
        # pivots stay on the diagonal unless they are small: otherwise the factors fill up
        options = {"permc_spec": "NATURAL", "diag_pivot_thresh": 0.01, "options": {"SymmetricMode": True}}
        try:
            self._lu = spla.splu(ordered, **options)
        except RuntimeError as error:
            raise SingularMatrixError(str(error)) from error

    @property
    def negative(self) -> int | None:
        return None if self._ldl is None or self._lu is not None else self._ldl.negative

    def solve(self, b: Array) -> Array:
        if self._lu is None:
            assert self._ldl is not None
            return self._ldl.solve(b)
        x = np.empty_like(b)
        x[self._order] = self._lu.solve(b[self._order])
        return x


class PlainCondensed:
    """Condensation by qdldl; see `Solver`."""

    def __init__(self, matrix: sp.csr_matrix, outer: Ints) -> None:
        self._outer, self._inner = outer, np.setdiff1d(np.arange(matrix.shape[0]), outer)
        self._inside, self._sound = Ldl(), False

    def condense(self, matrix: sp.csr_matrix) -> Array | None:
        outer, inner = self._outer, self._inner
        self._sound = self._inside.factorise(matrix[inner][:, inner])
        if not self._sound:
            return None
        corner = matrix[outer][:, outer].toarray()
        self._coupling = matrix[inner][:, outer] + matrix[outer][:, inner].T
        return np.asarray(corner + np.triu(corner, 1).T - self._inside.condense(self._coupling.toarray()))

    def forward(self, b: Array) -> Array:
        y = b.copy()
        y[self._outer] -= self._coupling.T @ self._inside.solve(b[self._inner])
        return y

    def backward(self, x: Array) -> Array:
        x[self._inner] = self._inside.solve(x[self._inner] - self._coupling @ x[self._outer])
        return x

    def negative_inside(self, schur: Array) -> int | None:
        del schur
        return self._inside.negative if self._sound else None


def have_pardiso() -> bool:
    """Whether the extra `fast` is installed and its library loads."""
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
        mkl.MKL_Set_Threading_Layer(1)  # its layer without threads, initialised in half the time
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
    its imports take some 50 ms. Factors are made with the least that serves, until a matrix needs more: in single
    precision, then in double precision, and then with rows scaled and large entries permuted to the diagonal first
    (`match`). That takes most of the symbolic phase; mixed displacement-pressure systems need it only where elements,
    and with them pivots, differ by orders of magnitude.

    outer : unknowns that are not eliminated, but left in a Schur complement.
    single : whether the first factors, and then the present ones, are in single precision.
    """

    def __init__(
        self,
        matrix: sp.csr_matrix,
        symmetric: bool,
        outer: Ints | None = None,
        *,
        single: bool = False,
    ) -> None:
        self._mkl, self._symmetric, self._outer = _mkl(), symmetric, outer
        self._pardiso = self._mkl["pardiso"]
        self._pardiso.argtypes, self._pardiso.restype = [ctypes.c_void_p] * 16, None
        self._start(matrix, match=not symmetric, single=single)

    def _start(self, matrix: sp.csr_matrix, *, match: bool, single: bool) -> None:
        size, self.single, self._match = matrix.shape[0], single, match
        # Newton's method corrects small errors of a solve, so solutions are refined only where pivots were perturbed
        method, perturb = 0 if size < FEW else 2, 8 if self._symmetric else 13
        self.iparm = np.zeros(64, dtype=np.int32)
        # the search for pairs of pivots takes a sixth of the time; single precision is checked anyway
        pairs = int(not single)
        settings = {1: 1, 2: method, 10: perturb, 11: int(match), 13: int(match), 21: pairs, 28: int(single), 35: 1}
        for i, value in settings.items():
            self.iparm[i - 1] = value
        # MKL takes all arguments by address: these arrays hold them, and must stay where they are in memory
        self._numbers = np.array([1, 1, -2 if self._symmetric else 11, 0, size, 1, 0, 0], dtype=np.int32)
        memory, permutation = np.zeros(64, dtype=np.int64), np.zeros(size, dtype=np.int32)
        if self._outer is not None:
            permutation[self._outer], self.iparm[35] = 1, 2
        nothing = np.zeros(0)
        first = _address(self._numbers)
        most, which, kind, phase, many, right, talk, error = range(first, first + 32, 4)
        structure = _address(matrix.indptr), _address(matrix.indices)
        self._before = _address(memory), most, which, kind, phase, many
        self._between = *structure, _address(permutation), right, _address(self.iparm), talk
        self._error, self._nothing = error, nothing
        self._values, self._known = matrix.data, False
        self._type = np.dtype(np.float32 if single else np.float64)
        arrays = self._numbers, memory, permutation, matrix.indptr, matrix.indices, self.iparm, nothing
        call = self._pardiso, *self._before, _address(nothing), *self._between, *[_address(nothing)] * 2, error
        # frees MKL's memory with the last reference to these factors, or when it is called
        self._free = weakref.finalize(self, _release, arrays, call)
        self._free.atexit = False

    def factorise(self, matrix: sp.csr_matrix) -> None:
        self._run(matrix)
        if self.single and not self._is_accurate(matrix):
            self._restart(matrix, match=False)
        if not self._match and self.iparm[13] > 0:  # pivots were perturbed: matching is needed
            self._restart(matrix, match=True)

    def _restart(self, matrix: sp.csr_matrix, *, match: bool) -> None:
        self._free()
        self._start(matrix, match=match, single=False)
        self._run(matrix)

    def _run(self, matrix: sp.csr_matrix, schur: Array | None = None) -> None:
        """Factorise a matrix, and write the upper triangle of the Schur complement (c, c) where unknowns are kept."""
        with np.errstate(over="ignore"):  # `_is_accurate` tells what does not fit into single precision
            self._values = matrix.data.astype(self._type, copy=False)
        self._call(22 if self._known else 12, self._nothing, self._nothing if schur is None else schur)
        self._known = True

    @property
    def negative(self) -> int | None:
        """Number of negative eigenvalues of the symmetric matrix; None where its pivots do not tell."""
        # a perturbed pivot may have either sign
        return None if self.iparm[13] else int(self.iparm[22])

    def solve(self, b: Array, phase: int = 33) -> Array:
        """Solve for b (n,) or (n, m); phases 331 and 333 are the steps before and after a Schur complement."""
        b = np.asfortranarray(b, dtype=self._type)
        x = np.zeros_like(b)
        self._call(phase, b, x)
        return np.asarray(x, dtype=np.float64)

    def _is_accurate(self, matrix: sp.csr_matrix) -> bool:
        """Return whether the factors of an upper triangle serve Newton's method, by a known solution."""
        if self.iparm[13]:
            return False
        ones = np.ones(matrix.shape[0])
        error = np.linalg.norm(self.solve(multiply(matrix, ones)) - ones) / math.sqrt(len(ones))
        return bool(error <= LARGEST_ERROR)

    def _call(self, phase: int, b: Array, x: Array) -> None:
        numbers = self._numbers
        numbers[3], numbers[5], numbers[7] = phase, b.shape[1] if b.ndim == 2 else 1, 0
        # in a small system, synchronising threads costs more than they save
        threads_before = self._mkl.MKL_Set_Num_Threads_Local(int(numbers[4] < FEW))
        values = _address(self._values)
        self._pardiso(*self._before, values, *self._between, _address(b), _address(x), self._error)
        self._mkl.MKL_Set_Num_Threads_Local(threads_before)
        if numbers[7]:
            raise SingularMatrixError(f"PARDISO error {numbers[7]}")


class PardisoCondensed(Pardiso):
    """Condensation by PARDISO; see `Solver`."""

    def __init__(self, matrix: sp.csr_matrix, outer: Ints) -> None:
        super().__init__(matrix, symmetric=True, outer=outer)

    def condense(self, matrix: sp.csr_matrix) -> Array | None:
        assert self._outer is not None
        upper = np.zeros((len(self._outer), len(self._outer)))
        self._run(matrix, upper)
        # pivots of K_ii may have been perturbed
        return None if self.iparm[13] else np.asarray(np.triu(upper) + np.triu(upper, 1).T)

    def forward(self, b: Array) -> Array:
        return self.solve(b, phase=331)

    def backward(self, x: Array) -> Array:
        return self.solve(x, phase=333)

    def negative_inside(self, schur: Array) -> int | None:
        """Return the number of negative eigenvalues of K_ii; PARDISO counts those of its complement too."""
        return int(self.iparm[22]) - _count_negative(schur)


def _release(arrays: tuple[NDArray[Any], ...], call: tuple[Any, ...]) -> None:
    arrays[0][3] = -1
    call[0](*call[1:])


def _address(array: NDArray[Any]) -> int:
    return int(array.__array_interface__["data"][0])
