"""Sparse indefinite systems, symmetric or nearly so: a pattern filled again and again, and its factorisation.

PARDISO (through pypardiso, the extra `fast`) reuses its symbolic phase; SuperLU gives
the same answers otherwise, after METIS has ordered the unknowns by nested dissection.
"""

from __future__ import annotations

import copy
import ctypes
import functools
import importlib.metadata
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

FEW = 10_000
"""Unknowns up to which PARDISO takes one thread, and orders by minimum degree: half the time of nested dissection."""

CHUNK = 1 << 16
"""Entries of element matrices whose places are found at a time, so that they stay in the processor's cache."""


class SingularMatrixError(ArithmeticError):
    """The factorisation met a pivot it could not divide by."""


@dataclass(frozen=True, slots=True)
class Side:
    """Rows or columns of a group of m element matrices, each in s pieces of k unknowns that lie in b blocks.

    Attributes
    ----------
    unknowns : (m, s, k) their numbers; -1 marks an eliminated one.
    blocks : (m, b) numbers of the blocks, which are coupled whole.
    local : (k,) which of the b blocks an unknown lies in.
    """

    unknowns: Index
    blocks: Index
    local: Index

    @classmethod
    def pieces(cls, numbers: Index, cells: Index, fields: Index, first: int = 0) -> Side:
        """A piece for each of some `fields`.

        Parameters
        ----------
        numbers : (nodes, fields) of the unknowns.
        cells : (m, a) nodes.
        first : block of the first node.
        """
        return cls(np.swapaxes(numbers[cells][..., fields], 1, 2), first + cells, np.arange(cells.shape[1]))

    @classmethod
    def whole(cls, numbers: Index, cells: Index, first: int = 0) -> Side:
        """One piece of all fields, the fields first, as `pieces`."""
        (m, a), fields = cells.shape, numbers.shape[1]
        unknowns = np.swapaxes(numbers[cells], 1, 2).reshape(m, 1, fields * a)
        return cls(unknowns, first + cells, np.tile(np.arange(a), fields))

    def beside(self, other: Side) -> Side:
        """These unknowns and after them others, whose one element belongs to all."""
        m, b = self.blocks.shape
        unknowns = np.broadcast_to(other.unknowns, (m, 1, other.unknowns.shape[2]))
        blocks = np.broadcast_to(other.blocks, (m, other.blocks.shape[1]))
        return Side(
            np.concatenate([self.unknowns, unknowns], axis=2),
            np.hstack([self.blocks, blocks]),
            np.append(self.local, b + other.local),
        )


class Pattern:
    """The upper triangle of a symmetric sparse matrix assembled from dense element matrices.

    Where the rows of a piece are its columns, its upper triangle counts; of any other piece all counts, on this side
    of the diagonal or the other.

    Parameters
    ----------
    groups : rows and columns of each group of elements.
    sizes : (blocks,) numbers of unknowns of the blocks, which are numbered one block after the other.
    """

    def __init__(self, groups: list[tuple[Side, Side]], sizes: Index) -> None:
        count, first = len(sizes), np.cumsum(sizes) - sizes
        pairs = [_pair_keys(row.blocks[:, :, None], column.blocks[:, None, :], count) for row, column in groups]
        keys = np.concatenate([np.arange(count) * (count + 1), *map(np.ravel, pairs)])
        unique, inverse = np.unique(keys, return_inverse=True)
        rows, columns = np.divmod(unique, count)
        begin, width = np.searchsorted(rows, np.arange(count)), sizes[columns]
        start = np.cumsum(width) - width
        # where a pair of blocks begins in the first row of its block
        offset = (start - start[begin[rows]])[inverse]
        block = np.repeat(np.arange(count), sizes)
        inside = np.arange(len(block)) - first[block]
        length = np.add.reduceat(width, begin)[block] - inside
        ends = np.cumsum(length)
        # the rows of a block share their columns, less those below the diagonal
        shared = np.repeat(first[columns] - start, width) + np.arange(int(width.sum()))
        place = np.repeat(start[begin[block]] + inside - ends + length, length) + np.arange(int(length.sum()))
        self.size = len(block)
        columns, pointers = shared[place].astype(np.int32), np.append(0, ends).astype(np.int32)
        self._empty = sp.csr_matrix((np.zeros(len(columns)), columns, pointers), shape=(self.size, self.size))
        self._places: list[Index] = []
        entries, done, diagonal = [], count, ends - length - inside
        for (row, column), pair in zip(groups, pairs, strict=True):
            m, b, c = pair.shape
            own = offset[done : done + pair.size].reshape(m, b * c)
            done += pair.size
            local = row.local[:, None] * c + column.local
            same = np.zeros(row.unknowns.shape[1], dtype=bool)
            if row.unknowns.shape == column.unknowns.shape:
                same = (row.unknowns == column.unknowns).all(axis=(0, 2))
            entries_each = len(same) * local.size
            step, places = max(CHUNK // max(entries_each, 1), 1), []
            for at in range(0, m, step):
                i, k = row.unknowns[at : at + step, :, :, None], column.unknowns[at : at + step, :, None, :]
                above = k >= i
                wanted = (above | ~same[:, None, None]) & (i >= 0) & (k >= 0)
                entry = np.where(above, diagonal[i] + inside[k], inside[i] + diagonal[k])
                entry += own[at : at + step].take(local.ravel(), axis=1).reshape(len(i), 1, *local.shape)
                places.append(at * entries_each + np.flatnonzero(wanted))
                entries.append(entry[wanted])
            self._places.append(np.concatenate(places) if places else np.zeros(0, dtype=np.int64))
        self._entries = np.concatenate(entries)

    def assemble(self, blocks: list[Array | None]) -> sp.csr_matrix:
        """Sum element matrices, one array (m, s, k, l) per group, None for zeros, into the upper triangle."""
        values = np.concatenate(
            [
                np.zeros(len(at)) if block is None else block.ravel()[at]
                for block, at in zip(blocks, self._places, strict=True)
            ]
        )
        found = copy.copy(self._empty)  # it shares the structure; to make it anew is what would take longest
        found.data = np.bincount(self._entries, weights=values, minlength=self._empty.nnz)
        return found

    def unfolded(self, upper: sp.csr_matrix, last: Array) -> sp.csr_matrix:
        """All of the matrix whose upper triangle is given, where the last group's element matrices are unsymmetric.

        Parameters
        ----------
        last : (m, k, k) matrices of the last group, whose rows and columns are the same.
        """
        source, below, columns, pointers = self._mirror
        skew = (np.swapaxes(last, 1, 2) - last).ravel()[self._places[-1]]
        excess = np.bincount(self._entries[len(self._entries) - len(skew) :], weights=skew, minlength=len(upper.data))
        data = upper.data[source]
        data[below] += excess[source[below]]
        return sp.csr_matrix((data, columns, pointers), shape=upper.shape)

    @functools.cached_property
    def _mirror(self) -> tuple[Index, NDArray[np.bool_], NDArray[np.int32], NDArray[np.int32]]:
        """Of the whole matrix: its entries' places in the upper triangle, which are below the diagonal, structure."""
        upper = copy.copy(self._empty)
        upper.data = np.arange(1, upper.nnz + 1)
        whole = (upper + sp.triu(upper, 1, format="csr").T).tocsr()
        whole.sort_indices()
        rows = np.repeat(np.arange(self.size), np.diff(whole.indptr))
        return whole.data.astype(np.int64) - 1, rows > whole.indices, whole.indices, whole.indptr


def _pair_keys(a: Index, b: Index, count: int) -> Index:
    """One number for each unordered pair of numbers below `count`."""
    return np.asarray(np.minimum(a, b) * count + np.maximum(a, b))


def have_pardiso() -> bool:
    """Whether the extra `fast` is installed and its library loads."""
    return _mkl() is not None


@functools.cache
def _mkl() -> Any:
    """MKL, with what it loads itself at its first call; None if it is not installed."""
    for part in _files("mkl"):
        # pypardiso would search the whole environment's tree for it, 0.3 s for every solver
        if "mkl_rt" in part.name:
            os.environ.setdefault("PYPARDISO_MKL_RT", str(part.locate()))
    if "1" in (os.environ.get("MKL_NUM_THREADS"), os.environ.get("OMP_NUM_THREADS")):
        os.environ.setdefault("MKL_THREADING_LAYER", "SEQUENTIAL")  # loads in half the time
    try:
        import pypardiso

        found = pypardiso.PyPardisoSolver().libmkl
    except ImportError:
        return None
    found.MKL_Get_Max_Threads()
    return found


def _files(package: str) -> list[importlib.metadata.PackagePath]:
    try:
        return importlib.metadata.files(package) or []
    except importlib.metadata.PackageNotFoundError:
        return []


class Solver:
    """Factorises matrices that share one pattern, upper triangles or with slipping contact all of it, and solves."""

    def __init__(self, *, pardiso: bool | None = None) -> None:
        self._use_pardiso = have_pardiso() if pardiso is None else pardiso
        self._handles: dict[bool, _Pardiso] = {}
        self._symmetric = True
        self._order: Index | None = None

    def factorise(self, matrix: sp.csr_matrix, *, symmetric: bool = True) -> None:
        """Factorise an upper triangle, or all of an unsymmetric matrix; raises SingularMatrixError."""
        if not np.isfinite(matrix.data).all():
            raise SingularMatrixError("the stiffness has entries that are not finite")
        self._symmetric = symmetric
        if self._use_pardiso:
            held = self._handles.get(symmetric)
            if held is None:
                held = self._handles[symmetric] = _Pardiso(matrix, symmetric=symmetric, match=not symmetric)
            held.factorise(matrix)
            if held.iparm[12] == 0 and held.iparm[13] > 0:  # pivots were perturbed: match as well
                held.close()
                held = self._handles[symmetric] = _Pardiso(matrix, symmetric=symmetric, match=True)
                held.factorise(matrix)
            return
        full = (matrix + sp.triu(matrix, 1, format="csr").T).tocsr() if symmetric else matrix
        if self._order is None:
            self._order = _nested_dissection(full)
        permuted = full[self._order][:, self._order].tocsc()
        try:
            self._lu = spla.splu(
                permuted, permc_spec="NATURAL", diag_pivot_thresh=0.01, options={"SymmetricMode": True}
            )
        except RuntimeError as error:
            raise SingularMatrixError(str(error)) from error

    def negative(self) -> int | None:
        """Number of negative eigenvalues of the factorised matrix (Sylvester).

        None if its pivots do not tell, as those of an unsymmetric matrix.
        """
        if not self._symmetric:
            return None
        if self._use_pardiso:
            return int(self._handles[True].iparm[22])
        if not np.array_equal(self._lu.perm_r, self._lu.perm_c):
            return None
        return int(np.count_nonzero(self._lu.U.diagonal() < 0))

    def solve(self, b: Array) -> Array:
        """Solve with the last factorisation; b and the answer have shape (n,) or (n, m)."""
        if not self._use_pardiso:
            x = np.empty_like(b)
            x[self._order] = self._lu.solve(b[self._order])
            return x
        return self._handles[self._symmetric].solve(b)

    def close(self) -> None:
        """Give the factorisations' memory back."""
        while self._handles:
            self._handles.popitem()[1].close()


class _Pardiso:
    """PARDISO for symmetric indefinite matrices (upper triangles) of one pattern, or for unsymmetric ones.

    It is called as MKL's reference has it, because pypardiso, which finds MKL, copies the structure for every call.

    Parameters
    ----------
    matrix : with the pattern.
    match : scale rows and bring large entries to the diagonal first. That takes most of the symbolic phase, and
        displacements and pressures need it only where elements differ by orders of magnitude and pivots with them.

    Attributes
    ----------
    iparm : (64,) MKL's parameters, the first at 0.
    """

    def __init__(self, matrix: sp.csr_matrix, *, symmetric: bool, match: bool) -> None:
        self._mkl = _mkl()
        self._pardiso = self._mkl["pardiso"]
        self._pardiso.argtypes, self._pardiso.restype = [ctypes.c_void_p] * 16, None
        size = matrix.shape[0]
        # Newton's method corrects what a solve leaves, so it is refined only where PARDISO had to perturb pivots
        order, perturb = 0 if size < FEW else 2, 8 if symmetric else 13
        self.iparm = np.zeros(64, dtype=np.int32)
        for i, value in {1: 1, 2: order, 10: perturb, 11: int(match), 13: int(match), 21: 1, 35: 1}.items():
            self.iparm[i - 1] = value
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
        """Give the factorisation's memory back."""
        nothing = np.zeros(0)
        self._call(-1, nothing, nothing)

    def _call(self, phase: int, b: Array, x: Array) -> None:
        numbers = self._numbers
        numbers[3], numbers[5], numbers[7] = phase, b.shape[1] if b.ndim == 2 else 1, 0
        # threads that wait for each other cost a small system more than they save
        own = self._mkl.MKL_Set_Num_Threads_Local(int(numbers[4] < FEW))
        values = _address(self._values)
        self._pardiso(*self._before, values, *self._between, _address(b), _address(x), self._error)
        self._mkl.MKL_Set_Num_Threads_Local(own)
        if numbers[7]:
            raise SingularMatrixError(f"PARDISO error {numbers[7]}")


def _address(array: NDArray[Any]) -> int:
    return int(array.__array_interface__["data"][0])


def _nested_dissection(matrix: sp.csr_matrix) -> Index:
    """Order of the unknowns of a symmetric matrix that keeps its factors sparse."""
    import pymetis

    rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    beside = rows != matrix.indices
    starts = np.append(0, np.cumsum(np.bincount(rows[beside], minlength=matrix.shape[0])))
    graph = pymetis.CSRAdjacency(starts.astype(np.int32), matrix.indices[beside].astype(np.int32))
    order, _ = pymetis.nested_dissection(adjacency=graph)
    return np.asarray(order, dtype=np.int64)
