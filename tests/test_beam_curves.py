"""Responses over a force range: interpolation in depth and shear, inversion, and slopes."""

from dataclasses import dataclass

import numpy as np
import pytest

from studies.sizing.beam_curves import press_curves, shear_curves

DEEPEST = np.array([0.3, 0.2])
STIFFNESS = np.array([1.0, 3.0])


@dataclass
class Exact:
    value: np.ndarray

    @property
    def half_width(self):
        return 0.01 * self.value


class KnownBeams:
    """Beams with responses in closed form: powers of the root of the depth, and of the shear."""

    def press(self, depth):
        k = STIFFNESS[:, None]
        return {
            "force": Exact(k * depth**1.5 * (1 + depth)),
            "shift": Exact(0.6 * depth),
            "strain": Exact(2 * np.sqrt(depth)),
        }

    def shear(self, depth, shear):
        k, root = STIFFNESS[:, None], np.sqrt(depth)
        press = self.press(depth)
        return {
            "force_x": Exact(k * shear * (0.4 + 0.3 * root + 0.2 * shear**2)),
            "force_z": Exact(press["force"].value - 0.1 * k * shear**2 * (root + shear**2)),
            "shift_x": Exact(shear * (0.7 - 0.2 * shear**2)),
            "shift_z": Exact(press["shift"].value + shear**2 * 0.3 * root),
            "tilt": Exact(shear * (0.5 + root)),
            "strain": Exact(2 * root + shear),
        }


def curves():
    beams, press = KnownBeams(), press_curves(KnownBeams(), DEEPEST)
    low, high = np.array([0.04, 0.05]), np.array([0.25, 0.15])
    return beams, press, shear_curves(beams, press, low, high, 0.1 * STIFFNESS, np.full(2, 0.375))


def test_press_between_its_depths():
    beams, press, _ = curves()
    depth = np.array([[0.02, 0.11, 0.29], [0.013, 0.1, 0.19]])
    for name, exact in beams.press(depth).items():
        assert press.at(name, depth) == pytest.approx(exact.value, rel=2e-4)


def test_depth_of_a_force_inverts_the_press():
    beams, press, _ = curves()
    depth = np.array([[0.02, 0.11, 0.3], [0.013, 0.1, 0.2]])
    assert press.depth_of_force(beams.press(depth)["force"].value) == pytest.approx(depth, rel=1e-3)


def test_force_beyond_the_range_has_the_largest_depth():
    _, press, _ = curves()
    assert press.depth_of_force(np.full((2, 1), 1e3))[:, 0] == pytest.approx(DEEPEST)


@pytest.mark.parametrize("name", ["force_x", "force_z", "shift_x", "shift_z", "tilt"])
def test_shear_between_its_depths_and_shears(name):
    beams, press, shear = curves()
    depth, amount = np.array([[0.06, 0.2], [0.07, 0.13]]), np.array([[0.05, 0.15], [0.0, 0.12]])
    exact = beams.shear(depth, amount)[name].value
    assert shear.at(press, name, depth, amount)[0] == pytest.approx(exact, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("name", ["force_x", "force_z", "shift_x", "shift_z", "tilt"])
def test_slopes_are_those_of_the_values(name):
    _, press, shear = curves()
    depth, amount, step = np.array([[0.06, 0.2], [0.07, 0.13]]), np.array([[0.05, 0.15], [0.02, 0.12]]), 1e-6
    _, by_depth, by_shear = shear.at(press, name, depth, amount)

    def difference(d, s):
        ahead, behind = (shear.at(press, name, depth + w * d, amount + w * s)[0] for w in (1, -1))
        return (ahead - behind) / (2 * step)

    assert by_depth == pytest.approx(difference(step, 0), rel=1e-5, abs=1e-8)
    assert by_shear == pytest.approx(difference(0, step), rel=1e-5, abs=1e-8)


def test_shear_of_a_force_inverts_the_shear():
    beams, _, shear = curves()
    depth, amount = np.array([[0.06, 0.2], [0.07, 0.13]]), np.array([[0.05, 0.15], [0.0, 0.12]])
    force = beams.shear(depth, amount)["force_x"].value
    assert shear.shear_of_force(force, depth) == pytest.approx(amount, rel=2e-3, abs=1e-9)


def test_missing_press_states_leave_no_depth():
    class Failing(KnownBeams):
        def press(self, depth):
            answer = super().press(depth)
            answer["force"].value[0, 3:] = np.nan
            return answer

    depth = press_curves(Failing(), DEEPEST).depth_of_force(np.full((2, 1), 0.01))
    assert np.isnan(depth[0, 0])
    assert depth[1, 0] > 0
