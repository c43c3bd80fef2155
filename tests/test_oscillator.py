"""One mass on one spring: limits, half-power width, and the natural frequencies of
`fem.analyses.modes.spring_mass`."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from analytic.oscillator import moving_mass, natural_frequency, receptance
from fem.analyses.modes import spring_mass
from geometry.design import paper


def test_a_slow_load_moves_the_mass_by_force_over_stiffness():
    assert receptance(1e-6, 970.0)[()] == pytest.approx(1.0, rel=1e-15)


@pytest.mark.parametrize("loss", [0.001, 0.01])
def test_the_half_power_width_over_the_frequency_is_the_loss_factor(loss):
    def excess(f):
        return abs(receptance(f, 100.0, 1 + 1j * loss)) ** 2 - 0.5 / loss**2

    width = brentq(excess, 100.0, 110.0) - brentq(excess, 90.0, 100.0)
    assert width / 100.0 == pytest.approx(loss, rel=loss**2)


def test_a_passive_modulus_makes_the_motion_lag_the_force():
    phases = np.angle(receptance(np.array([10.0, 99.0, 101.0, 500.0]), 100.0, 1.2 + 0.1j))
    assert np.all((phases < 0) & (phases > -math.pi))


def test_the_moving_mass_gives_the_natural_frequency_of_the_axial_spring_with_the_magnet():
    design = replace(paper(), magnet_height=3.0, density=1100.0)
    stiffness = design.E * math.pi * design.R**2 / design.L
    assert natural_frequency(stiffness, moving_mass(design)) == pytest.approx(spring_mass(design)[1], rel=1e-12)
