"""Responses over a force range: states under loads, slopes, and nothing beyond what was evaluated."""

from dataclasses import dataclass

import numpy as np
import pytest

from studies.sizing.beam_curves import depths_between, pressed_curves, with_shears

DEEPEST = np.array([0.3, 0.2])
STIFFNESS = np.array([1.0, 3.0])
LOW, HIGH = np.array([0.04, 0.05]), np.array([0.25, 0.19])


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
            "strain": Exact(2 * root * np.exp(shear**2)),
        }


@pytest.fixture(scope="module", params=[(0.5, 1.0), (0.2, 0.5, 0.8, 1.0)])
def curves(request):
    farthest = np.full((2, 5), 0.3)
    return with_shears(pressed_curves(KnownBeams(), DEEPEST), KnownBeams(), LOW, HIGH, farthest, request.param)


DEPTH, SHEAR = np.array([[0.06, 0.2], [0.07, 0.13]]), np.array([[0.05, 0.15], [0.02, 0.12]])


def test_between_depths_and_shears(curves):
    values, slopes, along = curves.sheared(DEPTH, SHEAR)
    step = 1e-6
    for k, name in enumerate(("shift_x", "shift_z", "tilt", "force_x", "force_z", "strain")):
        exact = KnownBeams().shear(DEPTH, SHEAR)[name].value
        assert values[..., k] == pytest.approx(exact, rel=2e-3), name
        for way, slope in ((0, slopes), (1, along)):
            if name == "strain":
                continue
            moved = [curves.sheared(DEPTH + s * (1 - way), SHEAR + s * way)[0][..., k] for s in (step, -step)]
            assert slope[..., k] == pytest.approx((moved[0] - moved[1]) / (2 * step), rel=1e-4, abs=1e-7), name


def test_a_state_has_both_forces(curves):
    exact = KnownBeams().shear(DEPTH, SHEAR)
    state = curves.states(exact["force_z"].value, exact["force_x"].value)
    assert state.depth == pytest.approx(DEPTH, rel=2e-3)
    assert state.shear == pytest.approx(SHEAR, rel=5e-3)
    assert state.strain == pytest.approx(exact["strain"].value, rel=5e-3)
    assert state.plane[..., 3] == pytest.approx(exact["force_x"].value, rel=1e-4)


def test_a_press_alone_is_the_press(curves):
    force = KnownBeams().press(DEPTH)["force"].value
    state = curves.states(force, np.zeros_like(force))
    assert state.depth == pytest.approx(DEPTH, rel=1e-3)
    assert state.strain == pytest.approx(2 * np.sqrt(DEPTH), rel=2e-3)
    assert (state.shear == 0).all()


def test_nothing_is_extrapolated(curves):
    """A press beyond the deepest, a shear beyond the farthest, and one under too light a press have no state."""
    force = KnownBeams().press(np.array([[0.31], [0.21]]))["force"].value
    assert np.isnan(curves.states(force, 0 * force).depth).all()
    far = KnownBeams().shear(DEPTH, np.full((2, 2), 0.31))
    assert np.isnan(curves.states(far["force_z"].value, far["force_x"].value).strain).all()
    light = KnownBeams().shear(np.full((2, 1), 0.03), np.full((2, 1), 0.05))
    assert np.isnan(curves.states(light["force_z"].value, light["force_x"].value).depth).all()


def test_softer_curves_deform_more(curves):
    exact = KnownBeams().shear(DEPTH, SHEAR)
    loads = exact["force_z"].value, exact["force_x"].value
    soft, stiff = (curves.softer(way).states(*loads) for way in (1.0, -1.0))
    for name in ("depth", "shear", "strain"):
        assert (getattr(soft, name) > getattr(stiff, name)).all(), name


def test_missing_states_leave_no_answer():
    class Failing(KnownBeams):
        def press(self, depth):
            answer = super().press(depth)
            answer["force"].value[0, 3:] = np.nan
            return answer

    depth = pressed_curves(Failing(), DEEPEST).depth_of_force(np.full((2, 1), 0.01))
    assert np.isnan(depth[0, 0])
    assert depth[1, 0] > 0


def test_depths_of_the_shears_rise_between_their_ends():
    depth = depths_between(LOW, HIGH, 4)
    assert (np.diff(depth, axis=1) > 0).all()
    assert depth[:, [0, -1]] == pytest.approx(np.stack([LOW, HIGH], axis=1))
