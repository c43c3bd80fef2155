"""Pattern of a sparse symmetric matrix that is repeatedly assembled from element matrices.

The positions of all entries are computed once. The unknowns are numbered in blocks, those of a node or of the rigid
magnet, and all unknowns of two coupled blocks are coupled. The pattern follows from pairs of blocks, of which there
are far fewer than pairs of unknowns.
"""

from __future__ import annotations

import copy
import functools
import math

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from geometry.arrays import Array, Ints, Mask

Places = NDArray[np.int32]
"""Positions of entries; -1 for those that are not stored."""


class Pattern:
    """Upper triangle of a symmetric sparse matrix that compiled loops assemble from element matrices.

    Its entries are stored row by row, and in each row block by block: entry (i, k), i <= k, of the j-th pair of
    blocks has the position `diagonal[i] + offset[j] + inside[k]`.

    Parameters
    ----------
    groups : (m, b) and (m, c) blocks of the rows and of the columns of each group of m elements.
    sizes : (blocks,) numbers of unknowns of the blocks, which are numbered consecutively.
    skin : (m, a, f) numbers of the unknowns of the last group's elements, -1 where eliminated: their matrices may be
        unsymmetric, see `unfold`.

    Attributes
    ----------
    entries : number of entries of the upper triangle.
    inside : (n,) number of an unknown within its block.
    diagonal : (n,) position where the diagonal block of a row would begin if it were full.
    offsets : (m, b, c) start of each pair of blocks from the diagonal block of its first row, for each group.
    """

    def __init__(self, groups: list[tuple[Ints, Ints]], sizes: Ints, skin: Ints | None = None) -> None:
        count, first = len(sizes), np.cumsum(sizes) - sizes
        ends_of_pairs = [(rows[:, :, None], columns[:, None, :]) for rows, columns in groups]
        # one number for each unordered pair of blocks
        pairs = [np.minimum(a, b) * count + np.maximum(a, b) for a, b in ends_of_pairs]
        # every block is coupled with itself, so that no row of the matrix is empty
        keys = np.concatenate([np.arange(count) * (count + 1), *map(np.ravel, pairs)])
        # sorted keys are rows of blocks, and in each row the columns in rising order
        coupled, inverse = np.unique(keys, return_inverse=True)
        rows, columns = np.divmod(coupled, count)
        begin, width = np.searchsorted(rows, np.arange(count)), sizes[columns]
        start = np.cumsum(width) - width
        offset = (start - start[begin[rows]])[inverse]
        block = np.repeat(np.arange(count), sizes)
        self.inside = np.arange(len(block)) - first[block]
        length = np.add.reduceat(width, begin)[block] - self.inside
        ends = np.cumsum(length)
        self.diagonal = ends - length - self.inside
        # the rows of a block have the same columns, except those below the diagonal
        shared = np.repeat(first[columns] - start, width) + np.arange(int(width.sum()))
        place = np.repeat(start[begin[block]] - self.diagonal, length) + np.arange(int(length.sum()))
        # PARDISO and SuperLU take 32-bit structures
        indices, pointers = shared[place].astype(np.int32), np.append(0, ends).astype(np.int32)
        self._empty = sp.csr_matrix((np.zeros(len(indices)), indices, pointers), shape=(len(block), len(block)))
        self.entries = len(indices)
        groups_end = count + np.cumsum([pair.size for pair in pairs])
        self.offsets: list[Ints] = [
            offset[end - pair.size : end].reshape(pair.shape) for pair, end in zip(pairs, groups_end, strict=True)
        ]
        self._skin = skin

    def with_data(self, data: Array) -> sp.csr_matrix:
        """Return the upper triangle with entries (nnz,)."""
        upper = copy.copy(self._empty)  # the structure is shared: building it again would take longest
        upper.data = data
        return upper

    def unfold(self, upper: sp.csr_matrix, last: Array) -> sp.csr_matrix:
        """Return the whole matrix from its upper triangle, where the matrices of the last group are unsymmetric.

        upper : upper triangle, with the upper triangles of the last group.
        last : matrices of the last group, (m, k, k) or with k as nodes and fields; rows and columns are the same.
        """
        source, below, columns, pointers = self._mirror
        # `upper` mirrors their upper triangles; below the diagonal the difference lower - upper is added
        last = last.reshape(len(last), math.isqrt(last[0].size), -1)
        skew, stored = (np.swapaxes(last, 1, 2) - last).ravel(), self.skin_places >= 0
        excess = np.bincount(self.skin_places[stored], weights=skew[stored], minlength=len(upper.data))
        data = upper.data[source]
        data[below] += excess[source[below]]
        return sp.csr_matrix((data, columns, pointers), shape=upper.shape)

    def places(self, group: int, rows: Ints, columns: Ints, part: slice = slice(None)) -> Places:
        """Return the positions of entries of a group's elements, (m, b, c, ...); -1 where an unknown is eliminated.

        rows, columns : numbers of the unknowns, of shapes that fit this one. Below the diagonal an entry has the
            position of its mirror image.
        """
        offset = self.offsets[group][part]
        low, high = np.minimum(rows, columns), np.maximum(rows, columns)
        # clipped, which is faster than checked: of eliminated unknowns the place does not matter
        place = self.diagonal.take(low, mode="clip") + self.inside.take(high, mode="clip")
        place += offset.reshape(*offset.shape, *(1,) * (low.ndim - 3))
        return np.where(low >= 0, place, -1).astype(np.int32)

    def block_places(self, group: int, unknowns: Ints) -> Places:
        """Return the positions (m, a, f, a, f) of the upper triangles of matrices of unknowns (m, a, f)."""
        i, k = unknowns[:, :, None, :, None], unknowns[:, None, :, None]
        return np.where(k >= i, self.places(group, i, k), -1).swapaxes(2, 3)

    @functools.cached_property
    def skin_places(self) -> Places:
        """Positions of the entries of the last group's matrices, in a row."""
        assert self._skin is not None
        return self.block_places(-1, self._skin).ravel()

    @functools.cached_property
    def _mirror(self) -> tuple[Ints, Mask, NDArray[np.int32], NDArray[np.int32]]:
        """Structure of the whole matrix: positions of its entries in the upper triangle, mask of those below the
        diagonal, column numbers and row pointers.
        """
        upper = copy.copy(self._empty)
        # entries are numbered from 1, because a sparse sum may drop zeros
        upper.data = np.arange(1, upper.nnz + 1)
        full = (upper + sp.triu(upper, 1, format="csr").T).tocsr()
        full.sort_indices()
        rows = np.repeat(np.arange(len(self.inside)), np.diff(full.indptr))
        return full.data.astype(np.int64) - 1, rows > full.indices, full.indices, full.indptr


def nested_dissection(matrix: sp.csr_matrix) -> Ints:
    """Return an order of the unknowns of a symmetric matrix, both triangles of it, that keeps its factors sparse."""
    import pymetis

    rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    beside = rows != matrix.indices
    starts = np.append(0, np.cumsum(np.bincount(rows[beside], minlength=matrix.shape[0])))
    graph = pymetis.CSRAdjacency(starts.astype(np.int32), matrix.indices[beside].astype(np.int32))
    order, _ = pymetis.nested_dissection(adjacency=graph)
    return np.asarray(order, dtype=np.int64)
