"""A small magnet is enlarged, and the map back to the true body restores it without folded cells."""

import numpy as np
import pytest

from geometry.design import Shape
from geometry.meshing.mesh_magnification import CORE, Zoom

SMALL = Shape(50, 60, 0.2, 0.2, 0.02)
LOW = Shape(50, 25.5, 0.4, 0.2, 0.02)


def test_large_magnets_are_not_enlarged():
    zoom = Zoom.of(Shape(8, 9, 4, 2, 0.1))
    assert (zoom.shape, zoom.centre, zoom.factor) == (Shape(8, 9, 4, 2, 0.1), 5, 1)
    points = np.random.default_rng(0).random((3, 5))
    assert zoom.back(points) is points
    assert Zoom.of(SMALL.without_magnet()).factor == 1


@pytest.mark.parametrize("shape", [SMALL, LOW])
def test_the_map_restores_the_magnet(shape):
    zoom = Zoom.of(shape)
    assert zoom.factor > 4
    assert zoom.shape.magnet_diameter == pytest.approx(zoom.factor * shape.magnet_diameter)
    a, b = zoom.shape.magnet_diameter / 2, zoom.shape.magnet_height / 2
    rim = np.array([[a, 0, a], [0, a, 0], [zoom.centre + b, zoom.centre - b, zoom.centre]])
    small = zoom.back(rim)
    assert np.hypot(small[0], small[1]) == pytest.approx(np.full(3, shape.magnet_diameter / 2))
    assert small[2] - shape.H == pytest.approx([shape.magnet_height / 2, -shape.magnet_height / 2, 0])


@pytest.mark.parametrize("shape", [SMALL, LOW])
def test_the_outside_does_not_move_and_nothing_folds(shape):
    zoom = Zoom.of(shape)
    side = np.array([[shape.R, 0, 3], [0, 0, 2], [shape.H, shape.L, 0]], dtype=float)
    moved = zoom.back(side)
    np.testing.assert_allclose(moved[:, :2], side[:, :2], rtol=1e-12)
    assert moved[2, 2] == 0
    s = np.linspace(0, 1.2 * zoom.room, 400)
    line = np.array([s, 0 * s, zoom.pole + 0 * s])
    rho = zoom.back(line)[0]
    assert (np.diff(rho) > 0).all()
    assert np.diff(rho).max() < 4 * np.diff(s).max()
    core = s < CORE * zoom.room
    np.testing.assert_allclose(rho[core], s[core] / zoom.factor, rtol=1e-12)


def test_similar_shapes_are_enlarged_alike():
    one, other = Zoom.of(SMALL), Zoom.of(SMALL.scaled(0.1))
    assert other.factor == pytest.approx(one.factor)
    assert other.centre == pytest.approx(0.1 * one.centre)


def test_a_magnet_near_the_base_is_enlarged_until_cells_double():
    """The design of `magtip validate range` whose magnet of D/100 lies D/15 over the base."""
    zoom = Zoom.of(Shape(50, 28.337, 0.5046, 1.122, 0.006252))
    assert zoom.factor == pytest.approx(zoom.room / zoom.core)
    assert zoom.factor == pytest.approx(1.96, abs=0.01)
