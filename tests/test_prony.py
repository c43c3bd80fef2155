"""Prony branches: limits, sums, the text of a design, and the constant loss factor over its band."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from geometry.design import BadInput, Design
from geometry.prony import Relaxation, branches_of, branches_text, constant_loss, parse_branches

SERIES = Relaxation((0.2, 0.1, 0.25), (0.01, 0.5, 20.0))


def sentence(raised):
    text = str(raised.value)
    assert "\n" not in text
    return text


def test_fast_and_slow_limits():
    assert SERIES.rest == pytest.approx(0.45, rel=1e-15)
    assert SERIES.modulus([0.0, 1e9]) == pytest.approx([1.0, SERIES.rest], rel=1e-15)
    slow, fast = SERIES.complex_modulus([1e-12, 1e12])
    assert (slow, fast) == (pytest.approx(SERIES.rest, rel=1e-9), pytest.approx(1.0, rel=1e-9))


@pytest.mark.parametrize("omega", [0.03, 2.0, 100.0])
def test_complex_modulus_is_the_transform_of_the_relaxation(omega):
    # G*(w) = G(inf) + i w int_0^inf (G(t) - G(inf)) exp(-i w t) dt
    parts = [
        quad(lambda t: SERIES.modulus(t) - SERIES.rest, 0, np.inf, weight=weight, wvar=omega, limlst=5000)[0]
        for weight in ("cos", "sin")
    ]
    value = SERIES.rest + 1j * omega * complex(parts[0], -parts[1])
    assert SERIES.complex_modulus(omega) == pytest.approx(value, rel=1e-6)


def test_shapes_follow_the_argument_and_no_branches_are_elastic():
    assert SERIES.modulus(np.ones((2, 3))).shape == SERIES.loss_factor(np.ones((2, 3))).shape == (2, 3)
    elastic = Relaxation((), ())
    assert (elastic.rest, elastic.modulus(3.0), elastic.complex_modulus(3.0), elastic.loss_factor(3.0)) == (
        1,
        1,
        1,
        0,
    )
    assert elastic.speaks_for == elastic.speaks_for_frequencies == (0.0, math.inf)


def test_the_covered_range_is_that_of_the_branches_or_of_the_data():
    assert SERIES.speaks_for == (0.01, 20.0)
    assert SERIES.speaks_for_frequencies == pytest.approx((1 / (40 * math.pi), 1 / (0.02 * math.pi)))
    assert parse_branches("0.1:1 0.1:200 0:0.1 0:100").speaks_for == (0.1, 100.0)


def test_text_and_branches_are_inverse():
    assert parse_branches("0.2:0.01 0.25:20 0.1:0.5").shares == SERIES.shares
    for text in ("0.2:0.01 0.1:0.5 0.25:20", "0:0.001 0.2:0.01 0:3"):
        assert branches_text(parse_branches(text)) == text
    assert branches_text(Relaxation((), ())) == "" == Design().prony


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0.1", "prony must list branches g:tau with tau in s, such as 0.05:0.01 0.03:0.1; got '0.1'"),
        ("0.1:1,0.2:3", "got '0.1:1,0.2:3'"),
        ("nan:1", "got 'nan:1'"),
        ("0.1:0", "prony: the time tau of a branch must lie between 1e-12 and 1e+12 s; got 0 s"),
        ("0.1:-1", "got -1 s"),
        ("-0.1:1", "prony: the share g of a branch must be at least 0 and less than 1; got -0.1"),
        ("1:1", "got 1"),
        ("0.5:1 0.5:2", "prony: the shares g of all branches must add up to less than 1; got 1"),
        ("0.1:1 0.2:1.0", "prony lists the time tau = 1 s twice: give one branch with the sum of both shares"),
        ("0.1:1 0:2", "prony: entries with g = 0 mark the covered times, so give two, the shortest and the longest"),
        ("0:1 0:2", "prony lists no branch with a share g above 0: leave it empty; loss_factor=0 makes an elastic"),
    ],
)
def test_impossible_branches_are_refused_on_creation_of_a_design(text, message):
    with pytest.raises(BadInput) as raised:
        Design(prony=text)
    assert message in sentence(raised)


def test_branches_are_the_text_or_the_loss_factor():
    assert branches_of("0.2:0.01 0.1:0.5 0.25:20", 0.2, 1.0, 2.0).shares == SERIES.shares
    assert branches_of("", 0.2, 1.0, 20.0) == constant_loss(0.2, 1.0, 20.0)


@pytest.mark.parametrize("loss", [1e-6, 0.01, 0.1, 0.3, 1.0])
@pytest.mark.parametrize("band", [(0.01, 1000.0), (1.0, 2.0), (3e-3, 7.0)])
def test_loss_factor_is_constant_over_the_band(loss, band):
    relaxation = constant_loss(loss, *band)
    omega = 2 * math.pi * np.geomspace(*band, 997)
    assert relaxation.loss_factor(omega) == pytest.approx(np.full(997, loss), rel=0.02)
    assert relaxation.speaks_for_frequencies == pytest.approx(band, rel=1e-12)
    assert 0 < relaxation.rest < 1
    assert all(g > 0 for g in relaxation.shares)


def test_storage_rises_with_frequency_as_a_constant_phase_demands():
    # constant phase delta = atan(0.1): |G*| grows as w^(2 delta / pi)
    storage = np.abs(constant_loss(0.1, 0.01, 1000.0).complex_modulus(2 * math.pi * np.array([0.1, 100.0])))
    assert np.log(storage[1] / storage[0]) / np.log(1000) == pytest.approx(2 / math.pi * math.atan(0.1), rel=0.01)


def test_without_loss_nothing_relaxes():
    assert constant_loss(0.0, 0.01, 1000.0) == Relaxation((), ())
    small = constant_loss(1e-9, 0.01, 1000.0)
    assert 1 - small.rest == pytest.approx(0.0, abs=2e-8)


@pytest.mark.parametrize(
    ("loss", "band", "message"),
    [
        (
            0.1,
            (1e-6, 1e6),
            "the band of a constant loss factor must be above 0 and at most 10 decades wide; got 1e-06",
        ),
        (0.1, (1.0, 1.0), "got 1 to 1 Hz"),
        (1.0, (1e-4, 1e4), "a loss factor of 1 from 0.0001 to 10000 Hz leaves less than 0.0001 of the instantaneous"),
        (50.0, (1.0, 100.0), "lower loss_factor or narrow the band loss_low to loss_high"),
    ],
)
def test_impossible_constant_losses_are_refused(loss, band, message):
    with pytest.raises(BadInput) as raised:
        constant_loss(loss, *band)
    assert message in sentence(raised)
