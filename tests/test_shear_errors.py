"""Errors of (6) and their parts, on shears whose parts are known."""

import dataclasses

import pytest

from analytic import beam
from geometry.design import paper
from geometry.loads import Response
from studies.validation import claim_errors
from studies.validation.claim_states import Sheared

approx = pytest.approx
STIFFNESS, LEVER = beam.cantilever_stiffness(paper()), paper().H / paper().L
SHEARS = (0.0, 1.0, 2.0, 3.0)


def sheared(stiffness=STIFFNESS, lever=LEVER, tilt=0.0):
    """Shears with a force, a shift and a tilt in proportion."""
    responses = [Response((stiffness * s, 0.0, 4.0), (lever * s, 0.0, -0.5), tilt * s, 2.0) for s in SHEARS]
    return Sheared("held", paper(), "rigid", 1.0, SHEARS, tuple(responses))


def test_a_stiffer_beam_needs_a_larger_modulus():
    row = claim_errors.tip_row(sheared(stiffness=STIFFNESS / 2))
    assert row["worst_error_percent"] == approx(100)
    assert row["best_E_MPa"] == approx(2)
    assert row["best_error_percent"] == approx(0, abs=1e-9)
    assert (row["within_5_percent_from_E_MPa"], row["within_5_percent_to_E_MPa"]) == approx((2 / 1.05, 2 / 0.95))


def test_states_that_were_not_reached_are_left_out():
    whole = sheared()
    short = dataclasses.replace(whole, responses=(*whole.responses[:2], None, None))
    assert claim_errors.tip_row(short)["last_error_percent"] == approx(0, abs=1e-9)
    assert [row["shear_mm"] for row in claim_errors.split(short)] == [1.0]


def test_the_papers_own_beam_has_no_error():
    for row in claim_errors.split(sheared()):
        assert row["error_N"] == approx(0, abs=1e-5)


@pytest.mark.parametrize(
    ("changed", "part"),
    [
        ({"stiffness": STIFFNESS / 2}, "force_law_N"),
        ({"lever": 0.8 * LEVER}, "geometry_N"),
        ({"tilt": 0.05}, "tilt_N"),
    ],
)
def test_each_cause_is_its_own_part(changed, part):
    rows = claim_errors.split(sheared(**changed))
    assert len(rows) == 3
    assert claim_errors.share(rows, part) == approx(100, abs=0.1)
    for row in rows:
        assert row["tilt_N"] + row["geometry_N"] + row["force_law_N"] == approx(row["error_N"])
