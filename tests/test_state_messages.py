"""Facts in words: where a solve stopped, why, what to try, what to beware of."""

from dataclasses import replace
from typing import get_args

import pytest

from fem.accuracy import QUICK, STANDARD
from fem.equilibrium import solve
from fem.results import diagnostics, state_messages
from fem.solution import Facts, Remark
from fem.solve.inertia import STABLE, UNKNOWN, Stability
from fem.solve.newton import STOPPED
from geometry.design import paper
from geometry.loads import Load


@pytest.fixture(scope="module")
def told():
    """The text of facts that a pressed state might have, under another load than its own if one is given."""
    pressed = solve(paper(), Load(depth=1.0), QUICK)

    def text(facts, load=None):
        status = diagnostics.classify(facts)
        return state_messages.describe(
            replace(pressed, facts=facts, status=status, load=load or pressed.load), paper()
        )

    return text


def test_where_all_is_well_there_is_nothing_to_say(told):
    assert told(Facts(stability=STABLE)) == ""


def test_where_the_stability_is_unknown_that_is_said(told):
    assert (
        told(Facts(stability=UNKNOWN)) == "whether this equilibrium is stable is not known (its pivots do not tell)"
    )
    assert diagnostics.classify(Facts(stability=UNKNOWN, remark="guided_unknown")) == "ok"


def test_an_onset_that_is_past_is_told(told):
    assert "past it now" in told(Facts(stability=STABLE, onset="shear", onset_mm=(0.0, 0.4)))


@pytest.mark.parametrize("stop", [kind for kind in STOPPED if kind])
def test_a_stop_says_where_why_and_what_to_try(told, stop):
    facts = Facts(stop, Stability(1), "depth", (0.5, 0.6))
    text = told(facts, Load(depth=0.75, shear_x=0.3, shear_y=0.4, friction="stick"))
    assert text.startswith(f"stopped at depth 0.75 mm, shear 0.5 mm: {STOPPED[stop]}; try a smaller load")
    assert "unstable since a depth between 0.5 and 0.6 mm" in text


def test_each_remark_is_a_sentence_of_its_own(told):
    texts = [told(Facts(stability=STABLE, remark=remark)) for remark in get_args(Remark)]
    assert all(texts)
    assert len(set(texts)) == len(texts)


def test_what_is_inside_out_is_told_of_a_state_of_any_status(told):
    for facts in (Facts(), Facts("no_convergence"), Facts(stability=Stability(1))):
        assert "0.002 % of the silicone is inverted (J <= 0)" in told(replace(facts, inverted_share=2e-5))
        assert "is inverted" not in told(replace(facts, inverted_share=1e-7))


def test_silicone_that_is_inside_out_is_told():
    assert "of the silicone is inverted" in solve(paper(), Load(depth=3.6), STANDARD).message


def test_a_touch_that_needs_more_harmonics_than_a_model_has_is_told(told):
    assert "needs 3 harmonics more" in told(Facts(harmonics_missing=3))
