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


class Pattern:
    """Upper triangle of a symmetric sparse matrix that compiled loops assemble from element matrices.

    Its entries are stored row by row, and in each row block by block: entry (i, k), i <= k, of the j-th pair of
    blocks has the position `diagonal[i] + offset[j] + inside[k]`.

    Parameters
    ----------
    groups : (m, b) and (m, c) blocks of the rows and of the columns of each group of m elements.
    sizes : (blocks,) numbers of unknowns of the blocks, which are numbered consecutively.
    skin : (m, k) numbers of the unknowns of the last group's elements, node by node, -1 where eliminated: their
        matrices may be unsymmetric, see `unfold`.

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
        places, positions = self._skin_places
        last = last.reshape(len(last), math.isqrt(last[0].size), -1)
        skew = (np.swapaxes(last, 1, 2) - last).ravel()[places]
        excess = np.bincount(positions, weights=skew, minlength=len(upper.data))
        data = upper.data[source]
        data[below] += excess[source[below]]
        return sp.csr_matrix((data, columns, pointers), shape=upper.shape)

    @functools.cached_property
    def _skin_places(self) -> tuple[Ints, Ints]:
        """Entries of the last group's matrices in the upper triangle, and their positions there."""
        skin, offset = self._skin, self.offsets[-1]
        assert skin is not None
        i, k = skin[:, :, None], skin[:, None, :]
        node = np.repeat(np.arange(offset.shape[1]), skin.shape[1] // offset.shape[1])
        place = self.diagonal[i] + offset[:, node[:, None], node] + self.inside[k]
        upper = (i >= 0) & (k >= i)
        return np.flatnonzero(upper), place[upper]

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
