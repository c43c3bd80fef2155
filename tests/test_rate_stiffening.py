"""Forces at a rate by superposition: limits, the closed form of a linear spring, and what is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest

from geometry.design import BadInput, paper
from geometry.relaxation import relaxation_of
from studies.simulation import rate_stiffening

ONE = replace(paper(), prony="0.5:2 0:1e-9 0:1e9", modulus="long-term")
TRAVEL = np.array([0.5, 1.0, 2.0])


def test_fast_and_slow_presses_have_both_moduli():
    force = TRAVEL**1.5
    assert rate_stiffening.factors(ONE, TRAVEL, force, None, 1e9) == pytest.approx(2, rel=1e-6)
    assert rate_stiffening.factors(ONE, TRAVEL, force, None, 1e-9) == pytest.approx(1, rel=1e-6)
    stiff = replace(ONE, modulus="instantaneous")
    assert rate_stiffening.factors(stiff, TRAVEL, force, None, 1e-9) == pytest.approx(0.5, rel=1e-6)


def test_a_linear_spring_has_its_closed_form():
    t = TRAVEL / 0.5
    wanted = (0.5 + 0.5 * 2 / t * (1 - np.exp(-t / 2))) / 0.5
    assert rate_stiffening.factors(ONE, TRAVEL, 3 * TRAVEL, None, 0.5) == pytest.approx(wanted, rel=1e-12)


def test_a_frequency_has_the_storage_modulus():
    G = relaxation_of(ONE).complex_modulus(2 * math.pi * 0.3)
    assert rate_stiffening.factors(ONE, TRAVEL, TRAVEL, 0.3, None) == pytest.approx(G.real / 0.5, rel=1e-12)


def test_rows_without_a_force_have_none_at_a_rate():
    rows = [{"depth_mm": d, "fem_force_N": f} for d, f in ((0.5, 1.0), (1.0, math.nan), (2.0, 4.0))]
    one, lost, last = rate_stiffening.with_rate(ONE, "press", rows, None, 1.0)
    assert math.isnan(lost["fem_force_at_rate_N"])
    assert last["fem_force_at_rate_N"] > 4
    assert one["fem_force_at_rate_change_percent"] == pytest.approx(100 * (one["fem_force_at_rate_N"] - 1))
    assert rate_stiffening.with_rate(ONE, "press", rows, None, None) == rows
    assert "2 mm" in rate_stiffening.rate_sentence(ONE, [one, lost, last], None, 1.0)


@pytest.mark.parametrize(
    ("rate", "part"),
    [
        ((1.0, 1.0), "leave one"),
        ((0.0, None), "above 0 Hz"),
        ((None, -1.0), "above 0 mm/s"),
        ((5e3, None), "not for 5000 Hz"),
    ],
)
def test_impossible_rates_are_refused(rate, part):
    with pytest.raises(BadInput, match=part):
        rate_stiffening.check_rate(paper(), 3.0, *rate)
