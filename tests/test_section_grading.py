"""The target edge length of sections: the shortcuts for speed do not change a bit of it."""

import numpy as np
import pytest

from geometry.meshing.section_grading import BLOCK, Grading

SIZE = 0.2


def random_grading(seed, count=60):
    rng = np.random.default_rng(seed)
    source = rng.random(count) + 1j * rng.random(count)
    least, growth = 10 ** rng.uniform(-4, -0.7, count), rng.choice([0.1, 0.3, 0.8], count)
    again = rng.integers(count, size=10)
    return Grading(
        SIZE, np.append(source, source[again]), np.append(least, least[again]), np.append(growth, growth[again])
    )


def line(seed, count):
    """Return points on a line, dense at both ends."""
    start, end = np.random.default_rng(seed).random((2, 2)) @ [1, 1j]
    t = np.geomspace(1e-10, 0.5, count // 2)
    return start + (end - start) * np.concatenate([t, 1 - t[::-1]])


def test_least_and_growth():
    x = np.array([0, 0.1j, 0.5, 1.0])
    grading = Grading(SIZE, np.array([0j, 1 + 0j]), np.array([0.01, 0.05]), np.array([0.3, 0.4]))
    np.testing.assert_allclose(grading(x), [0.01, 0.04, 0.16, 0.05], rtol=1e-15)


@pytest.mark.parametrize("seed", range(10))
def test_sources_without_effect_are_left_out(seed):
    grading = random_grading(seed)
    reduced = grading.reduced()
    x = np.random.default_rng(seed).uniform(-1, 2, (5000, 2)) @ [1, 1j]
    assert len(reduced.source) < len(grading.source)
    assert (reduced.source[0], reduced.least[0]) == (grading.source[0], grading.least[0])
    np.testing.assert_array_equal(reduced(x), grading(x))


@pytest.mark.parametrize("count", [2, BLOCK, 5 * BLOCK + 6])
@pytest.mark.parametrize("seed", range(10))
def test_lengths_along_a_line_equal_those_at_single_points(seed, count):
    grading = random_grading(seed)
    x = np.concatenate([line(100 * seed + k, count) for k in range(5)] + [np.full(count, 9 + 9j)])
    assert len(np.unique(grading(x))) > 1
    np.testing.assert_array_equal(grading.along(x), grading(x))
