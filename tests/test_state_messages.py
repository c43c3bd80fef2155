"""Facts in words: where a solve stopped, why, what to try, what to beware of."""

from dataclasses import replace

import pytest

from fem.accuracy import STANDARD
from fem.equilibrium import solve
from fem.results import diagnostics, state_messages
from fem.solution import Facts
from fem.solvers.newton import STOPPED
from geometry.design import paper
from geometry.loads import Load, Response

RESPONSE = Response((0.0, 0.0, 1.0), (0.0, 0.0, -0.1), 0.0, 1.0)


def said(known: Facts, load: Load | None = None) -> str:
    return state_messages.sentence(known, paper(), load or Load(depth=1.0), RESPONSE, None, "axisymmetric")


def test_an_onset_that_is_past_is_told():
    assert "past it now" in said(Facts(unstable_directions=0, onset="shear", onset_mm=(0.0, 0.4)))


@pytest.mark.parametrize("stop", [kind for kind in STOPPED if kind])
def test_a_stop_says_where_why_and_what_to_try(stop):
    known = Facts(stop, 1, "depth", (0.5, 0.6))
    text = said(known, Load(depth=0.75, shear_x=0.3, shear_y=0.4, friction="stick"))
    assert diagnostics.status(known) == "not_converged"
    assert text.startswith(f"stopped at depth 0.75 mm, shear 0.5 mm: {STOPPED[stop]}; try a smaller load")
    assert "unstable since a depth between 0.5 and 0.6 mm" in text


def test_what_is_inside_out_is_told_of_a_state_of_any_status():
    for known in (Facts(), Facts("no_convergence"), Facts(unstable_directions=1)):
        assert "2e-05 of the silicone is inside out" in said(replace(known, inside_out_share=2e-5))
        assert "inside out" not in said(replace(known, inside_out_share=1e-7)).partition("first guess")[0]


def test_silicone_that_is_inside_out_is_told():
    assert "of the silicone is inside out" in solve(paper(), Load(depth=3.6), STANDARD).message
