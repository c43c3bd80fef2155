"""Where laws are stable in homogeneous stretches, and the stretches that solves come to."""

import numpy as np
import pytest

from fem import equilibrium
from fem.accuracy import STANDARD
from fem.model import elements
from fem.results import silicone_limits
from fem.scene import Scene
from geometry.design import paper
from geometry.loads import Load
from studies.simulation import law_regression as work
from studies.simulation.law_regression import nominal_stress


@pytest.mark.parametrize(("name", "numbers"), [("neo-hookean", ()), ("mooney-rivlin", (0.7,))])
def test_laws_that_are_stable_everywhere(name, numbers):
    assert set(work.ranges(name, numbers).values()) == {work.RANGE}


def test_stability_ends_where_the_nominal_stress_of_a_softening_law_is_largest():
    numbers = (-0.08, 0.0)
    stretch = np.linspace(1, 4, 30001)
    peak = stretch[np.argmax(nominal_stress("yeoh", numbers, stretch))]
    low, high = work.ranges("yeoh", numbers)["uniaxial"]
    assert 0.98 * peak < high <= peak
    assert 0.3 < low < 1


def test_a_compression_along_one_axis_is_a_tension_along_two():
    """The same states, but for the direction in which the nominal stress has to rise: both say Drucker's limit."""
    found = work.ranges("yeoh", (-0.02, -0.005))
    assert found["equibiaxial"][1] == pytest.approx(found["uniaxial"][0] ** -0.5, rel=0.1)


@pytest.mark.parametrize("stretch", [[1.0, 2.0], [0.6, 1.0], [0.8, 1.5], [1.5, 5.0]])
def test_in_every_mode_principal_stretches_stay_within_those_of_the_test(stretch):
    test = np.array(stretch)
    had = np.concatenate([test, test**-0.5, [1.0]])
    found = work.ranges_of_test(test)
    for mode, strains in work.MODES.items():
        for end in found[mode]:
            principal = end ** np.array(strains)
            assert had.min() * (1 - 1e-12) <= principal.min()
            assert principal.max() <= had.max() * (1 + 1e-12)
            # and one of them is at its end
            assert min(abs(principal.min() / had.min() - 1), abs(principal.max() / had.max() - 1)) < 1e-12
    low, high = found["uniaxial"]
    assert low <= min(stretch) * (1 + 1e-12)
    assert high >= max(stretch) * (1 - 1e-12)


def visited(depth):
    """Logarithms of principal stretches (n, 3) and volumes (n,) at points of integration of the paper's sensor."""
    load = Load(depth=depth)
    path = equilibrium.start_path(Scene(paper(), (load,), STANDARD))
    reached = path.advance(path.rest, np.array([depth / paper().D, 0, 0]))
    assert not reached.stop
    e, u = reached.state.d.system.elements, reached.state.u
    return silicone_limits.logarithmic_strains(e, slice(None), u), elements.volumes(e, slice(None)).ravel()


def most(h, volumes, share):
    """Stretches of each mode that all but a share of the silicone stays within, points counting for the next mode."""
    ways = np.array([[1.0, -0.5, -0.5], [0.5, 0.5, -1.0], [1.0, 0.0, -1.0]])
    near = np.argmax(h @ (ways / np.linalg.norm(ways, axis=1)[:, None]).T, axis=1)

    def end(mode, axis):
        size = np.where(near == mode, np.abs(h[:, axis]), 0.0)
        order = np.argsort(-size)
        return np.exp(size[order[np.searchsorted(np.cumsum(volumes[order]), share * volumes.sum())]])

    tension, compression = end(0, 0), 1 / end(1, 2)
    return {
        "uniaxial": (compression, tension),
        "equibiaxial": (tension**-0.5, compression**-0.5),
        "planar": (1 / end(2, 2), end(2, 0)),
    }


def test_the_range_of_solves_is_that_of_a_press_to_three_eighths_of_the_diameter():
    h, volumes = visited(3.0)
    found = most(h, volumes, 1e-3)
    for mode, ends in found.items():
        np.testing.assert_allclose(ends, work.SOLVE[mode], rtol=0.025)
    # single points at the magnet's edge go much further
    assert np.exp(h.max()) == pytest.approx(4.3, rel=0.03)
    assert np.exp(h.min()) == pytest.approx(0.18, rel=0.03)


def test_a_press_to_a_quarter_of_the_diameter_stays_within_what_is_stated():
    h, volumes = visited(2.0)
    found = most(h, volumes, 1e-3)
    for mode, ends in {"uniaxial": (0.52, 1.18), "equibiaxial": (0.92, 1.38), "planar": (0.59, 1.64)}.items():
        np.testing.assert_allclose(found[mode], ends, rtol=0.025)
    assert np.exp(h.max()) == pytest.approx(2.7, rel=0.03)
    assert np.exp(h.min()) == pytest.approx(0.33, rel=0.03)


def test_a_press_to_an_eighth_of_the_diameter_leaves_most_of_the_silicone_within_a_quarter():
    h, volumes = visited(1.0)
    inside = np.abs(np.exp(h) - 1).max(axis=1) <= 0.265
    assert volumes[inside].sum() / volumes.sum() > 0.99
