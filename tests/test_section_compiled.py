"""The section's mesh by compiled functions and by NumPy: the same mesh."""

import math

import numpy as np
import pytest

from geometry import compiled
from geometry.design import Shape, paper
from geometry.section import section

pytest.importorskip("numba", reason="the compiled mesh needs the extra `fast`")
THIN = 0.0125


def both(shape, size, **choices):
    assert compiled.prepare()
    assert compiled.load("geometry.meshing.section_compiled"), "the compiled functions cannot be used"
    fast = section(shape, size, **choices)
    with compiled.uncompiled():
        return fast, section(shape, size, **choices)


def assert_equal(fast, slow, D):
    np.testing.assert_array_equal(fast.t, slow.t)
    np.testing.assert_allclose(fast.doflocs, slow.doflocs, rtol=0, atol=1e-12 * D)
    for table in ("facets", "t2f", "f2t"):
        np.testing.assert_array_equal(getattr(fast, table), getattr(slow, table))
    for groups in ("boundaries", "subdomains"):
        mine, other = getattr(fast, groups), getattr(slow, groups)
        assert list(mine) == list(other)
        for name in mine:
            np.testing.assert_array_equal(mine[name], other[name])


@pytest.mark.parametrize("magnet", ["hole", "meshed", "none"])
@pytest.mark.parametrize("size", [0.16, 0.09, 0.045])
def test_papers_section(size, magnet):
    shape = paper().shape
    for rim in (None, (0.9, 0.1)):
        glued = rim is not None and magnet == "hole"
        assert_equal(*both(shape, size * shape.D, rim=rim, magnet=magnet, glued=glued), shape.D)


def random_cases(count, seed):
    rng = np.random.default_rng(seed)
    cases = []
    while len(cases) < count:
        D, L = 10 ** rng.uniform(-1, 2), 0.5 + 10 ** rng.uniform(-1.6, 0.8)
        height, radius = 2 * 10 ** rng.uniform(-1.9, -0.4), rng.uniform(0.03, 0.4875)
        rho = rng.choice([0.0, 0.05, rng.random(), 1.0]) * min(radius, height / 2)
        shape = Shape(1.0, L, 2 * radius, height, rho)
        if shape.wall >= THIN:
            size = D * rng.choice([0.2, 0.16, 0.09, 0.06])
            rim = None if rng.random() < 0.5 else (D * rng.uniform(0.01, 0.5), D * 10 ** rng.uniform(-3, -1.2))
            tip = size * 10 ** rng.uniform(-3, 0)
            magnet = str(rng.choice(["hole", "meshed", "none"]))
            cases.append((shape.scaled(D), size, {"tip_size": tip, "rim": rim, "magnet": magnet}))
    return cases


def test_sections_of_random_designs():
    for shape, size, choices in random_cases(25, seed=11):
        assert_equal(*both(shape, size, **choices), shape.D)


@pytest.mark.parametrize("length", [1.0, 1.5, 2.0])
def test_a_tip_on_the_edge_of_a_cell(length):
    """The largest cells of the quadtree have side D / 2."""
    assert_equal(*both(Shape(1.0, length, 0.4, 0.3, 0.02), 0.12), 1.0)


def test_a_size_larger_than_the_beam():
    assert_equal(*both(paper().shape, 40.0), 8.0)


def test_volume_is_exact():
    shape = paper().shape
    fast, _ = both(shape, 0.09 * shape.D, magnet="none")
    import skfem

    basis = skfem.Basis(fast, skfem.ElementTriP2(), intorder=6)
    volume = 2 * math.pi * float((basis.global_coordinates()[0] * basis.dx).sum())
    assert volume == pytest.approx(math.pi * shape.R**2 * shape.H + 2 / 3 * math.pi * shape.R**3, rel=2e-6)
