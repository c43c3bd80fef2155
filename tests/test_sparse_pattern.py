"""Sparse matrices summed from element matrices, against dense ones."""

import numpy as np

from fem.solvers.sparse_pattern import Pattern, Side

RNG = np.random.default_rng(2)


def summed(shape, rows, columns, values):
    """A dense matrix of values that are added wherever row and column are unknowns."""
    dense = np.zeros(shape)
    rows, columns = np.broadcast_arrays(rows, columns)
    kept = (rows >= 0) & (columns >= 0)
    np.add.at(dense, (rows[kept], columns[kept]), values[kept])
    return dense


def test_a_pattern_sums_pieces_of_elements_like_dense_matrices():
    """Two elements with three nodes of two fields; a field's own piece is symmetric, the other belongs to both."""
    numbers = np.array([[0, 1], [-1, 2], [3, 4], [5, -1]])  # two fields are eliminated
    cells = np.array([[0, 1, 2], [3, 2, 1]])
    first, second = Side.pieces(numbers, cells, np.array([0, 0, 1])), Side.pieces(numbers, cells, np.array([0, 1, 1]))
    pattern = Pattern([(first, second)], (numbers >= 0).sum(axis=1))
    K = RNG.normal(size=(2, 3, 3, 3))
    K[:, [0, 2]] += np.swapaxes(K[:, [0, 2]], 2, 3)
    dense = np.zeros((6, 6))
    for cell, pieces in zip(cells, K, strict=True):
        for (f, g), piece in zip([(0, 0), (0, 1), (1, 1)], pieces, strict=True):
            part = summed(dense.shape, numbers[cell, f][:, None], numbers[cell, g], piece)
            dense += part if f == g else part + part.T
    np.testing.assert_allclose(pattern.assemble([K]).toarray(), np.triu(dense), atol=1e-14)


def test_a_pattern_is_filled_anew_with_every_sum():
    numbers, cells = np.array([[0], [1], [2]]), np.array([[0, 1], [1, 2]])
    side = Side.whole(numbers, cells)
    pattern = Pattern([(side, side)], np.ones(3, dtype=np.int64))
    first = pattern.assemble([np.ones((2, 1, 2, 2))])
    second = pattern.assemble([None])
    np.testing.assert_array_equal(first.toarray(), [[1, 1, 0], [0, 2, 1], [0, 0, 1]])
    np.testing.assert_array_equal(second.toarray(), np.zeros((3, 3)))


def test_unsymmetric_matrices_of_the_last_group_are_summed_whole():
    """Both groups couple the same unknowns, as a body and its skin do; one unknown is eliminated."""
    numbers = np.array([[0, 1], [2, -1], [3, 4]])
    cells, facets = np.array([[0, 1, 2]]), np.array([[2, 0], [1, 2]])
    body, skin = Side.whole(numbers, cells), Side.whole(numbers, facets)
    pattern = Pattern([(body, body), (skin, skin)], (numbers >= 0).sum(axis=1))
    K, S = RNG.normal(size=(1, 6, 6)), RNG.normal(size=(2, 4, 4))
    K += np.swapaxes(K, 1, 2)
    dense = np.zeros((5, 5))
    for nodes, matrices in ((cells, K), (facets, S)):
        for cell, matrix in zip(nodes, matrices, strict=True):
            unknowns = numbers[cell].T.ravel()  # the fields first
            dense += summed(dense.shape, unknowns[:, None], unknowns, matrix)
    whole = pattern.unfold(pattern.assemble([K, S]), S)
    np.testing.assert_allclose(whole.toarray(), dense, atol=1e-14)
