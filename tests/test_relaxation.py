"""Prony branches and the constant loss factor; branches, moduli and refused times and frequencies of a design."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from geometry.design import BadInput, Design
from geometry.relaxation import (
    Relaxation,
    branches_text,
    check_range,
    constant_loss,
    moduli,
    parse_branches,
    relaxation_notes,
)

SERIES = Relaxation((0.2, 0.1, 0.25), (0.01, 0.5, 20.0))
MEASURED = Design(prony="0.1:0.1 0.2:10")


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


def test_measured_branches_refuse_what_their_data_do_not_cover():
    assert check_range(MEASURED, times=[0.1, 3.0, 10.0], frequencies=[0.1, 1.0]) == []
    with pytest.raises(BadInput) as raised:
        check_range(MEASURED, times=[5.0, 20.0, 40.0], frequencies=[600.0])
    assert str(raised.value) == (
        "the branches speak for 0.1 to 10 s (0.0159 to 1.59 Hz), not for 20 to 40 s and 600 Hz: measure further, and "
        "mark the shortest and the longest time of the test in prony by entries 0:LOW 0:HIGH, or allow such values "
        "(extrapolate), which marks the results"
    )


def test_values_outside_the_range_are_marked_on_request():
    (warning,) = check_range(MEASURED, frequencies=[600.0], beyond=True)
    assert warning.endswith("not for 600 Hz: the results are an extrapolation")


def test_an_assumed_loss_factor_speaks_for_its_band():
    design = Design(loss_low=0.1, loss_high=100.0)
    assert check_range(design, frequencies=[0.1, 100.0]) == []
    with pytest.raises(BadInput, match="not for 600 Hz: change loss_low or loss_high, or allow"):
        check_range(design, frequencies=[600.0])


@pytest.mark.parametrize(
    ("fields", "parts"),
    [
        (
            {},
            [
                "E = 1 MPa is the long-term modulus (the default); the instantaneous",
                "13 Prony branches of a constant loss",
            ],
        ),
        ({"loss_factor": 0.0}, ["the silicone is elastic (loss_factor is 0): E = 1 MPa at every rate"]),
        (
            {"prony": "0.5:1", "modulus": "instantaneous"},
            [
                "E = 1 MPa is the instantaneous modulus; the long-term modulus is 0.5 MPa",
                "1 Prony branch from the field",
            ],
        ),
    ],
)
def test_notes_name_the_modulus_and_the_source_of_the_branches(fields, parts):
    notes = relaxation_notes(Design(**fields))
    assert [note[: len(part)] for note, part in zip(notes, parts, strict=True)] == parts


def test_moduli_at_rest_and_after_a_step():
    prony = "0.2:0.01 0.2:1"
    assert moduli(Design(E=0.6, prony=prony)) == pytest.approx((1.0, 0.6))
    assert moduli(Design(E=0.6, prony=prony, modulus="instantaneous")) == pytest.approx((0.6, 0.36))
