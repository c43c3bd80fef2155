"""Pattern of a sparse symmetric matrix that is repeatedly assembled from element matrices.

The positions of all entries are computed once; each assembly is then one weighted count (`numpy.bincount`). The
unknowns are numbered in blocks, those of a node or of the rigid magnet, and all unknowns of two coupled blocks are
coupled. The pattern follows from pairs of blocks, of which there are far fewer than pairs of unknowns.
"""

from __future__ import annotations

import copy
import functools
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from geometry.arrays import Array, Ints

CHUNK = 1 << 16
"""Entries of element matrices whose positions are computed at a time, so that they stay in the processor's cache."""

MOST_LISTED = 3000
"""Blocks up to which all their pairs are listed, in up to 45 MB."""


@dataclass(frozen=True, slots=True)
class Side:
    """Rows or columns of m element matrices: s pieces of k unknowns, which lie in b blocks.

    Attributes
    ----------
    unknowns : (m, s, k) numbers of the unknowns; -1 for an eliminated one.
    blocks : (m, b) numbers of the blocks.
    local : (k,) which of the b blocks an unknown lies in.
    """

    unknowns: Ints
    blocks: Ints
    local: Ints

    @classmethod
    def pieces(cls, numbers: Ints, cells: Ints, fields: Ints, first: int = 0) -> Side:
        """Return a side with one piece for each of some `fields`.

        Parameters
        ----------
        numbers : (nodes, fields) numbers of the unknowns.
        cells : (m, a) nodes of the elements.
        first : number of the first node's block.
        """
        return cls(np.swapaxes(numbers[cells][..., fields], 1, 2), first + cells, np.arange(cells.shape[1]))

    @classmethod
    def whole(cls, numbers: Ints, cells: Ints, first: int = 0) -> Side:
        """Return a side with one piece of all fields, fields first; parameters as of `pieces`."""
        (m, a), fields = cells.shape, numbers.shape[1]
        unknowns = np.swapaxes(numbers[cells], 1, 2).reshape(m, 1, fields * a)
        return cls(unknowns, first + cells, np.tile(np.arange(a), fields))

    def beside(self, other: Side) -> Side:
        """Return this side with the unknowns of `other` appended to every element; `other` has one element."""
        m, b = self.blocks.shape
        unknowns = np.broadcast_to(other.unknowns, (m, 1, other.unknowns.shape[2]))
        blocks = np.broadcast_to(other.blocks, (m, other.blocks.shape[1]))
        return Side(
            np.concatenate([self.unknowns, unknowns], axis=2),
            np.hstack([self.blocks, blocks]),
            np.append(self.local, b + other.local),
        )


@dataclass(frozen=True, slots=True)
class _Layout:
    """Positions of the entries of an upper triangle, row by row, and in each row block by block.

    Entry (i, k), i <= k, of the j-th pair of blocks has the position `diagonal[i] + offset[j] + inside[k]`.

    Attributes
    ----------
    empty : the matrix with zeros.
    offset : (pairs,) start of each pair of blocks, counted from the diagonal block of its first row.
    inside : (n,) number of an unknown within its block.
    diagonal : (n,) position where the diagonal block of a row would begin if it were full.
    pairs : coupled pairs of blocks, see `_pair_keys`.
    """

    empty: sp.csr_matrix
    offset: Ints
    inside: Ints
    diagonal: Ints
    pairs: Ints


def _build_layout(keys: Ints, sizes: Ints) -> _Layout:
    """Return the layout of a matrix whose coupled pairs of blocks are `keys`, see `_pair_keys`."""
    count, first = len(sizes), np.cumsum(sizes) - sizes
    # sorted keys are rows of blocks, and in each row the columns in rising order
    unique, inverse = _number(keys, count)
    rows, columns = np.divmod(unique, count)
    begin, width = np.searchsorted(rows, np.arange(count)), sizes[columns]
    start = np.cumsum(width) - width
    offset = (start - start[begin[rows]])[inverse]
    block = np.repeat(np.arange(count), sizes)
    inside = np.arange(len(block)) - first[block]
    length = np.add.reduceat(width, begin)[block] - inside
    ends = np.cumsum(length)
    # the rows of a block have the same columns, except those below the diagonal
    shared = np.repeat(first[columns] - start, width) + np.arange(int(width.sum()))
    place = np.repeat(start[begin[block]] + inside - ends + length, length) + np.arange(int(length.sum()))
    # PARDISO and SuperLU take 32-bit structures
    indices, pointers = shared[place].astype(np.int32), np.append(0, ends).astype(np.int32)
    empty = sp.csr_matrix((np.zeros(len(indices)), indices, pointers), shape=(len(block), len(block)))
    return _Layout(empty, offset, inside, ends - length - inside, unique)


def _number(keys: Ints, count: int) -> tuple[Ints, Ints]:
    """Return the different keys in rising order, and the number of each key among them."""
    if count > MOST_LISTED:
        return np.unique(keys, return_inverse=True)
    # a list of all pairs takes less time than sorting those that occur
    occurs = np.zeros(count**2, dtype=np.bool_)
    occurs[keys] = True
    unique = np.flatnonzero(occurs)
    number = np.empty(count**2, dtype=np.int32)
    number[unique] = np.arange(len(unique))
    return unique, number[keys].astype(np.int64)


class Pattern:
    """Upper triangle of a symmetric sparse matrix assembled from dense element matrices.

    A piece with equal rows and columns is symmetric: only its upper triangle is added. All entries of any other piece
    are added, and those below the diagonal of the matrix are mirrored to the upper triangle.

    Parameters
    ----------
    groups : rows and columns of each group of elements.
    sizes : (blocks,) numbers of unknowns of the blocks, which are numbered consecutively.

    Attributes
    ----------
    size, entries : numbers of unknowns, and of entries of the upper triangle.
    diagonal, inside : see `_Layout`.
    offsets : (m, b, c) start of each pair of blocks, for each group, see `_Layout`.
    """

    def __init__(self, groups: list[tuple[Side, Side]], sizes: Ints) -> None:
        count = len(sizes)
        pairs = [_pair_keys(row.blocks[:, :, None], column.blocks[:, None, :], count) for row, column in groups]
        # every block is coupled with itself, so that no row of the matrix is empty
        layout = _build_layout(np.concatenate([np.arange(count) * (count + 1), *map(np.ravel, pairs)]), sizes)
        self._empty, self.size, self.entries = layout.empty, len(layout.inside), layout.empty.nnz
        self.diagonal, self.inside = layout.diagonal, layout.inside
        ends = count + np.cumsum([pair.size for pair in pairs])
        self.offsets = [
            layout.offset[end - pair.size : end].reshape(pair.shape) for pair, end in zip(pairs, ends, strict=True)
        ]
        self._layout, self._groups, self._sizes = layout, groups, sizes

    def elimination_order(self) -> Ints:
        """Return an order (n,) of the unknowns that keeps factors sparse, with those of a block together.

        The graph of the blocks has several times fewer vertices than that of the unknowns.
        """
        first, second = np.divmod(self._layout.pairs, len(self._sizes))
        graph = sp.csr_matrix((np.ones(len(first)), (first, second)), shape=(len(self._sizes),) * 2)
        blocks = nested_dissection((graph + sp.triu(graph, 1).T).tocsr())
        start = np.cumsum(self._sizes) - self._sizes
        return np.concatenate([np.arange(start[b], start[b] + self._sizes[b]) for b in blocks])

    @functools.cached_property
    def _placed(self) -> list[tuple[Ints, Ints]]:
        """Which entries of each group's element matrices are added, and where; compiled loops need neither."""
        return [
            _place_entries(row, column, offset, self._layout)
            for (row, column), offset in zip(self._groups, self.offsets, strict=True)
        ]

    @functools.cached_property
    def _last_placed(self) -> tuple[Ints, Ints]:
        """`_placed` of the last group alone."""
        return _place_entries(*self._groups[-1], self.offsets[-1], self._layout)

    @functools.cached_property
    def _positions(self) -> Ints:
        """Positions of the entries of all groups, in one array."""
        return np.concatenate([positions for _, positions in self._placed])

    def with_data(self, data: Array) -> sp.csr_matrix:
        """Return the upper triangle with entries (nnz,)."""
        upper = copy.copy(self._empty)  # the structure is shared: building it again would take longest
        upper.data = data
        return upper

    def assemble(self, blocks: list[Array | None]) -> sp.csr_matrix:
        """Assemble element matrices, one array (m, s, k, l) per group or None for zeros, into the upper triangle."""
        values = np.concatenate(
            [
                np.zeros(len(at)) if block is None else block.ravel()[at]
                for block, (at, _) in zip(blocks, self._placed, strict=True)
            ]
        )
        data = np.bincount(self._positions, weights=values, minlength=self.entries)
        return self.with_data(np.asarray(data, dtype=np.float64))

    def unfold(self, upper: sp.csr_matrix, last: Array) -> sp.csr_matrix:
        """Return the whole matrix from its upper triangle, where the matrices of the last group are unsymmetric.

        Parameters
        ----------
        upper : as of `assemble`.
        last : (m, k, k) matrices of the last group, whose rows and columns are the same.
        """
        source, below, columns, pointers = self._mirror
        # `upper` mirrors their upper triangles; below the diagonal the difference lower - upper is added
        places, positions = self._last_placed
        skew = (np.swapaxes(last, 1, 2) - last).ravel()[places]
        excess = np.bincount(positions, weights=skew, minlength=len(upper.data))
        data = upper.data[source]
        data[below] += excess[source[below]]
        return sp.csr_matrix((data, columns, pointers), shape=upper.shape)

    @functools.cached_property
    def _mirror(self) -> tuple[Ints, NDArray[np.bool_], NDArray[np.int32], NDArray[np.int32]]:
        """Structure of the whole matrix: positions of its entries in the upper triangle, mask of those below the
        diagonal, column numbers and row pointers.
        """
        upper = copy.copy(self._empty)
        # entries are numbered from 1, because a sparse sum may drop zeros
        upper.data = np.arange(1, upper.nnz + 1)
        whole = (upper + sp.triu(upper, 1, format="csr").T).tocsr()
        whole.sort_indices()
        rows = np.repeat(np.arange(self.size), np.diff(whole.indptr))
        return whole.data.astype(np.int64) - 1, rows > whole.indices, whole.indices, whole.indptr


def _place_entries(row: Side, column: Side, offset: Ints, layout: _Layout) -> tuple[Ints, Ints]:
    """Return which entries of a group's element matrices are added, and to which positions.

    Parameters
    ----------
    offset : (m, b, c) start of each pair of blocks, see `_Layout`.
    """
    m, b, c = offset.shape
    offset = offset.reshape(m, b * c)
    local = row.local[:, None] * c + column.local
    same = np.zeros(row.unknowns.shape[1], dtype=bool)
    if row.unknowns.shape == column.unknowns.shape:
        same = (row.unknowns == column.unknowns).all(axis=(0, 2))
    entries_each = len(same) * local.size
    step = max(CHUNK // max(entries_each, 1), 1)
    places, entries = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for at in range(0, m, step):
        i, k = row.unknowns[at : at + step, :, :, None], column.unknowns[at : at + step, :, None, :]
        above = k >= i
        # of a symmetric piece one triangle is enough; -1 marks eliminated unknowns
        wanted = (above | ~same[:, None, None]) & (i >= 0) & (k >= 0)
        # an entry below the diagonal is that of its transpose
        entry = np.where(above, layout.diagonal[i] + layout.inside[k], layout.inside[i] + layout.diagonal[k])
        entry += offset[at : at + step].take(local.ravel(), axis=1).reshape(len(i), 1, *local.shape)
        places.append(at * entries_each + np.flatnonzero(wanted))
        entries.append(entry[wanted])
    return np.concatenate(places), np.concatenate(entries)


def _pair_keys(a: Ints, b: Ints, count: int) -> Ints:
    """Return one number for each unordered pair of numbers below `count`."""
    return np.asarray(np.minimum(a, b) * count + np.maximum(a, b))


def nested_dissection(matrix: sp.csr_matrix) -> Ints:
    """Return an order of the unknowns of a symmetric matrix, both triangles of it, that keeps its factors sparse."""
    import pymetis

    rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    beside = rows != matrix.indices
    starts = np.append(0, np.cumsum(np.bincount(rows[beside], minlength=matrix.shape[0])))
    graph = pymetis.CSRAdjacency(starts.astype(np.int32), matrix.indices[beside].astype(np.int32))
    order, _ = pymetis.nested_dissection(adjacency=graph)
    return np.asarray(order, dtype=np.int64)
