"""The pattern of sparse matrices that are summed from element matrices."""

import numpy as np
import scipy.sparse as sp

from fem.model.sparse_pattern import Pattern

RNG = np.random.default_rng(2)


def test_places_of_entries_are_those_of_the_matrix():
    """Two elements with three nodes of two fields; two fields are eliminated."""
    numbers = np.array([[0, 1], [-1, 2], [3, 4], [5, -1]])
    cells = np.array([[0, 1, 2], [3, 2, 1]])
    pattern = Pattern([(cells, cells)], (numbers >= 0).sum(axis=1))
    places = {}
    for element, cell in enumerate(cells):
        for a, first in enumerate(cell):
            for b, second in enumerate(cell):
                for i in numbers[first][numbers[first] >= 0]:
                    for k in numbers[second][numbers[second] >= i]:
                        place = pattern.diagonal[i] + pattern.offsets[0][element, a, b] + pattern.inside[k]
                        assert places.setdefault((int(i), int(k)), place) == place
    data = np.zeros(pattern.entries)
    for (i, k), place in places.items():
        data[place] = 10 * i + k + 1
    matrix = pattern.with_data(data).toarray()
    assert {(i, k): matrix[i, k] for i, k in places} == {(i, k): 10 * i + k + 1 for i, k in places}
    # every pair of unknowns of an element has a place
    assert np.count_nonzero(matrix) == len(places) == pattern.entries


def test_unsymmetric_matrices_of_the_last_group_are_summed_whole():
    """Both groups couple the same unknowns, as a body and its skin do; one unknown is eliminated."""
    numbers = np.array([[0, 1], [2, -1], [3, 4]])
    cells, facets = np.array([[0, 1, 2]]), np.array([[2, 0], [1, 2]])
    unknowns = numbers[facets].reshape(2, -1)
    pattern = Pattern([(cells, cells), (facets, facets)], (numbers >= 0).sum(axis=1), unknowns)
    S = RNG.normal(size=(2, 4, 4))
    dense = np.zeros((5, 5))
    for own, matrix in zip(unknowns, S, strict=True):
        kept = own >= 0
        dense[np.ix_(own[kept], own[kept])] += matrix[np.ix_(kept, kept)]
    # as the compiled loops do: the upper triangles are summed, each entry at its place
    places = sp.coo_matrix(pattern.with_data(np.arange(1.0, pattern.entries + 1)))
    data = np.zeros(pattern.entries)
    upper = np.triu(np.ones((5, 5), dtype=bool))
    for i, k, number in zip(places.row, places.col, places.data.astype(int), strict=True):
        data[number - 1] = dense[i, k] if upper[i, k] else 0.0
    np.testing.assert_allclose(pattern.unfold(pattern.with_data(data), S).toarray(), dense, atol=1e-14)
