"""The section's edge length by a quadtree: the least that any source requires."""

import numpy as np
import pytest

from geometry import compiled

pytest.importorskip("numba", reason="the quadtree needs the extra `fast`")
BEAM, SIZE = np.array([0.5, 0.9, 0.2, 0.1, 0.0, 1.0]), 0.09


def sources(seed):
    """Sources of three growths, many of them close together, first the tip (0, 1.4)."""
    rng = np.random.default_rng(seed)
    spread = np.repeat([[0.5, 1.4], [1e-3, 1e-3]], 40, axis=0)
    at = rng.random((80, 2)) * spread + np.where(spread < 0.1, 0.25, 0.0)
    at[0] = 0.0, 1.4
    growth = rng.choice([0.2, 0.4, 0.8], 80)
    return np.column_stack([at, 10 ** rng.uniform(-4, -1.1, 80), growth, 1 / growth])


@pytest.mark.parametrize("seed", range(4))
def test_edge_lengths_are_those_of_all_sources(seed):
    assert compiled.prepare()
    kernels = compiled.load("geometry.meshing.quadtree_compiled")
    source = sources(seed)
    tree = kernels.quadtree(BEAM, source, SIZE)
    x = np.random.default_rng(seed + 10).random((2000, 2)) * [0.5, 1.4]
    distance = np.linalg.norm(x[:, None] - source[:, :2], axis=2)
    expected = np.minimum(SIZE, (distance * source[:, 3] + source[:, 2]).min(axis=1))
    each = [kernels.length_in(tree, kernels.cell_of(tree, r, z), SIZE, r, z) for r, z in x]
    np.testing.assert_allclose(each, expected, rtol=1e-13)
    assert np.count_nonzero(expected < SIZE) > 500
    # points between two corners of a rectangle
    t = np.linspace(0, 1, 16)[:, None]
    lines, space, lengths = [(1 - t) * a + t * b for a, b in x.reshape(-1, 2, 2)], np.empty((160, 4)), np.empty(16)
    for line in lines:
        kernels.edge_lengths(tree, SIZE, line, 0, 15, space, lengths)
        distance = np.linalg.norm(line[:, None] - source[:, :2], axis=2)
        every = np.minimum(SIZE, (distance * source[:, 3] + source[:, 2]).min(axis=1))
        np.testing.assert_allclose(lengths, every, rtol=1e-13)
