"""Plain Python and numba run the same functions for the field, with the same digits."""

import math
import subprocess
import sys

import numpy as np
import pytest

from analytic import cylinder, magnet
from geometry import compiled
from geometry.design import BadInput

RNG = np.random.default_rng(20100301)


def places(a, h, count=400):
    """Points in and around a magnet on every scale, and beside its hull, faces and rim."""
    size = np.hypot(a, h / 2)
    direction = RNG.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    around = direction * size * 10.0 ** RNG.uniform(-3, 6, count)[:, None]
    turn, angle = RNG.uniform(0, 2 * np.pi, (2, count))
    step = 10.0 ** RNG.uniform(-12, 0, count)
    rho = a * (1 + step * np.cos(angle))
    beside = np.column_stack([rho * np.cos(turn), rho * np.sin(turn), h / 2 + a * step * np.sin(angle)])
    axis = np.column_stack([0 * step, 0 * step, h * RNG.normal(size=count)])
    hull = np.column_stack([0 * step + a, 0 * step, h * RNG.uniform(0.6, 3, count)])
    special = [[a, 0, h / 2], [0, -a, -h / 2], [np.nan, 0, 0], [0, np.inf, 0], [1e200, 0, 1e200], [1e-300, 0, 0]]
    return np.vstack([around, beside, axis, hull, special])


def computed(monkeypatch, threads, x, a, h):
    """B in plain Python (no threads), or compiled in a number of threads."""
    if not threads:
        cylinder.compiled_functions.cache_clear()
    monkeypatch.setattr(cylinder, "MIN_COMPILED_POINTS", 0 if threads else 10**9)
    monkeypatch.setattr(cylinder, "THREAD_POINTS", 500)
    monkeypatch.setattr(compiled, "threads", lambda: threads)
    return cylinder.computed(x, a, h / 2, 1.2)


@pytest.mark.parametrize("flatness", [1e-6, 1e-2, 0.3, 1.0, 2.0, 30.0, 1e3])
def test_plain_and_compiled_functions_and_threads_have_the_same_digits(flatness, monkeypatch):
    a, h = 1.7, 1.7 * flatness
    x = places(a, h)
    plain, one, two = (computed(monkeypatch, threads, x, a, h) for threads in (0, 1, 2))
    for found in (one, two):
        np.testing.assert_array_equal(found[0], plain[0])
        assert found[1] == plain[1] == len(x) - 6
    assert np.isnan(plain[0][-6:-2]).all()
    assert np.isfinite(plain[0][:-6]).all()
    assert (plain[0][-2] == 0).all()


def test_every_method_computes_some_of_these_points():
    """Otherwise the test above would say nothing of it."""
    used = set()
    for z0 in (5e-7, 0.5, 15.0):
        for point in places(1.7, 3.4 * z0, 50)[:-6].tolist():
            place = r, gap, z, up, down = cylinder.lengths(*point, 1.7, 1.7 * z0)
            far, thin = math.hypot(r, z) > 7 * math.hypot(1, z0), math.hypot(gap, z) > 12 * z0
            rim = 12 in (cylinder._steps(r, gap, up), cylinder._steps(r, gap, down))
            used.add("far" if far else "thin" if thin else "near" if cylinder._is_near(place, z0) else ("faces", rim))
    assert used == {"far", "thin", "near", ("faces", False), ("faces", True)}


def test_the_first_of_the_points_without_a_field_is_named():
    for point, text in (((2, 0, 1), r"where \(2, 0, 1\) mm lies"), ((0, np.nan, 1), "points must be finite")):
        with pytest.raises(BadInput, match=text):
            magnet.cylinder_field([(1, 1, 1)] * cylinder.MIN_COMPILED_POINTS + [point, (-2, 0, 1)], 2, 2, 1.2)


def test_few_points_do_without_numba():
    """A process that needs a reading does not wait for numba, and gets the digits of one that has it."""
    code = """
import sys
import numpy as np
from analytic import magnet
x = np.random.default_rng(1).normal(size=(300, 3)) * 5
first = magnet.cylinder_field(x, 2, 2, 1.2).tobytes()
print("numba" in sys.modules)
magnet.cylinder_field(np.ones((3000, 3)), 2, 2, 1.2)
print("numba" in sys.modules, magnet.cylinder_field(x, 2, 2, 1.2).tobytes() == first)
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["False", "True", "True"]
