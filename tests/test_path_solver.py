"""Scenes are answered from the store, and what it lacks is solved."""

from dataclasses import replace

import pytest

from fem.accuracy import QUICK
from fem.scene import Scene
from geometry.design import paper
from geometry.loads import Load
from studies.mechanics import path_solver


def test_a_scene_of_several_paths_is_answered_from_the_store(kept, traced):
    """A press, which needs the axisymmetric model, and shears along two axes, which are one path."""
    loads = (Load(depth=0.5), Load(0.5, 0.3, 0.0, "stick"), Load(0.5, 0.0, 0.3, "stick"))
    scene = Scene(paper(), tuple(replace(load, friction="stick") for load in loads), QUICK)
    for _ in range(2):
        (press, x, y), trouble = path_solver.solved(scene, kept)
        assert (press.response.force[0], trouble, len(traced)) == (0.0, "", 2)
        assert y.response.force[1] == pytest.approx(x.response.force[0], rel=1e-12)
