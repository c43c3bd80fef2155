"""The press of the formulas: exact to rounding, in few evaluations."""

import numpy as np
import pytest

from analytic import press_terms
from analytic.beam import TERMS
from geometry.design import Design

RNG = np.random.default_rng(7)


def random_press():
    D = 10 ** RNG.uniform(0, 1.5)
    design = Design(
        D=D,
        L=D * RNG.uniform(0.9, 6),
        E=10 ** RNG.uniform(-3, 3),
        nu=RNG.uniform(0.3, 0.5),
        l0=40,
        magnet_diameter=D * RNG.uniform(0.05, 0.6),
        magnet_height=D * RNG.uniform(0.05, 0.5),
        magnet_edge_radius=0,
    )
    return design, D * 10 ** RNG.uniform(-12, -0.31)


@pytest.mark.parametrize("level", TERMS)
def test_dome_and_column_share_the_depth_and_the_force_to_rounding(level):
    for _ in range(200):
        design, depth = random_press()
        pressed = press_terms.press(design, depth, TERMS[level])
        assert pressed.above + pressed.below == pytest.approx(depth, rel=1e-14)
        assert press_terms._dome(design, TERMS[level])(pressed.above) == pressed.force
