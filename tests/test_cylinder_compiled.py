"""NumPy and the compiled kernel give the same field, and the size of a call decides between them."""

import contextlib
import subprocess
import sys

import numpy as np
import pytest

from analytic import magnet
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
    return np.vstack([around, beside, axis, hull])


@pytest.mark.parametrize("flatness", [1e-6, 1e-2, 0.3, 1.0, 2.0, 30.0, 1e3])
def test_kernel_and_numpy_agree(flatness):
    a, h, J = 1.7, 1.7 * flatness, 1.2
    x = places(a, h)
    (B, jacobian), kernel = magnet.numpy_field(x, a, h / 2, J, slope=True), magnet.compiled()
    B_too, jacobian_too = magnet.compiled_field(kernel, x, a, h / 2, J, slope=True)
    size = np.linalg.norm(B, axis=1)
    assert (np.linalg.norm(B_too - B, axis=1) / size).max() < 1e-13
    steepness = np.linalg.norm(jacobian, axis=(1, 2)) + size / np.linalg.norm(x, axis=1)
    assert (np.linalg.norm(jacobian_too - jacobian, axis=(1, 2)) / steepness).max() < 1e-12
    for alone in (
        magnet.compiled_field(kernel, x, a, h / 2, J, slope=False)[0],
        magnet.numpy_field(x, a, h / 2, J, slope=False)[0],
    ):
        assert (np.linalg.norm(alone - B, axis=1) / size).max() < 1e-13


@pytest.mark.parametrize("flatness", [1e-3, 0.3, 1.0, 2.0, 30.0])
@pytest.mark.parametrize("how", [compiled.uncompiled, contextlib.nullcontext])
def test_one_point_in_a_loop_is_the_same(flatness, how):
    a, h, J = 1.7, 1.7 * flatness, -1.2
    rho, z = np.abs(RNG.normal(size=(2, 40))) * a * 10.0 ** RNG.uniform(-1, 2, 40)
    rho[0] = 0
    B, jacobian = magnet.numpy_field(np.column_stack([rho, 0 * rho, z]), a, h / 2, J, slope=True)
    with how():
        field = magnet.meridian_field(a, h, J)
    found = np.array([field(*point) for point in zip(rho.tolist(), z.tolist(), strict=True)])
    expected = np.column_stack([B[:, 0], B[:, 2], *(jacobian[:, i, j] for i, j in ((0, 0), (1, 1), (0, 2), (2, 2)))])
    size = np.repeat([np.linalg.norm(B, axis=1), np.linalg.norm(jacobian, axis=(1, 2))], [2, 4], axis=0).T
    assert (np.abs(found - expected) / size).max() < 1e-12
    with pytest.raises(BadInput, match="infinite on the magnet's rim"):
        field(a, h / 2)


def test_kernel_refuses_the_same():
    for point, text in (((2, 0, 1), "infinite on the magnet's rim"), ((0, np.nan, 1), "points must be finite")):
        with pytest.raises(BadInput, match=text):
            magnet.cylinder_field([(1, 1, 1)] * magnet.MIN_COMPILED_POINTS + [point], 2, 2, 1.2)


def test_the_size_of_a_call_alone_decides():
    """Below MIN_COMPILED_POINTS points it is NumPy's to the last digit, from there on the kernel's."""
    x = places(2.0, 2.0, magnet.MIN_COMPILED_POINTS)[: magnet.MIN_COMPILED_POINTS]
    few, many = magnet.cylinder_field(x[1:], 2, 2, 1.2), magnet.cylinder_field(x, 2, 2, 1.2)
    np.testing.assert_array_equal(few, magnet.numpy_field(x[1:], 2.0, 1.0, 1.2, slope=False)[0])
    np.testing.assert_array_equal(many, magnet.compiled_field(magnet.compiled(), x, 2.0, 1.0, 1.2, slope=False)[0])
    assert not np.array_equal(few, many[1:])


def test_the_number_of_threads_changes_no_digit(monkeypatch):
    x = places(2.0, 2.0, 8000)
    assert len(x) > 30_000
    one, two = (by_threads(monkeypatch, count, x) for count in (1, 2))
    np.testing.assert_array_equal(one[0], two[0])
    np.testing.assert_array_equal(one[1], two[1])
    # the first of the points without a field is the one that the message names
    x[-1], x[-2] = np.nan, (2.0, 0.0, 1.0)
    with pytest.raises(BadInput, match=r"where \(2, 0, 1\) mm lies"):
        by_threads(monkeypatch, 2, x)


def by_threads(monkeypatch, count, x):
    """B and its Jacobian computed by a number of threads."""
    monkeypatch.setattr(magnet, "THREAD_POINTS", 10_000)
    monkeypatch.setattr(compiled, "cores", lambda: count)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    assert compiled.threads() == count
    return magnet.cylinder_field_jacobian(x, 2, 2, 1.2)


def test_a_call_has_the_same_digits_whatever_was_called_before():
    """In a process of its own: first of all, after 1200 other calls, and after the kernel was loaded and used."""
    ended = subprocess.run([sys.executable, "-c", HISTORY], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["True"] * 4


HISTORY = """
import numpy as np
from analytic import magnet
x = np.random.default_rng(1).normal(size=(300, 3)) * 5
def call():
    loop = magnet.meridian_field(2.0, 2.0, 1.2)
    return magnet.cylinder_field(x, 2, 2, 1.2).tobytes(), repr([loop(abs(r), z) for r, _, z in x.tolist()])
first = call()
for _ in range(1200):
    magnet.cylinder_field(x[:1], 2, 2, 1.2)
print(*[a == b for a, b in zip(first, call())])
magnet.compiled()
magnet.cylinder_field(np.ones((300_000, 3)), 2, 2, 1.2)
print(*[a == b for a, b in zip(first, call())])
"""
