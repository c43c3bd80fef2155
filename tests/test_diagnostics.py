"""What is known of a state: read off a path, told in words, printed as keys."""

from dataclasses import replace

import numpy as np
import pytest

from fem.discretisation import symmetry_models
from fem.results import diagnostics
from fem.results.diagnostics import Facts
from fem.solution import read
from fem.solvers import load_stepping
from fem.solvers.load_stepping import Path
from fem.solvers.newton import STOPPED
from geometry.design import paper
from geometry.loads import Load, Response
from studies.simulation import load_cases

RESPONSE = Response((0.0, 0.0, 1.0), (0.0, 0.0, -0.1), 0.0, 1.0)
X = np.array([1.0, 0.0])


def said(known: Facts, load: Load | None = None) -> str:
    return diagnostics.sentence(known, paper(), load or Load(depth=1.0), RESPONSE, None, "axisymmetric")


@pytest.fixture
def pressed():
    """The all-silicone beam on a coarse section, pressed by 0.4 mm."""
    p = Path(symmetry_models.section(paper().shape.without_magnet().scaled(1 / 8), 0.4998, "ignored", 0.25, 0.125))
    assert not p.go(0.05, np.zeros(2))
    yield p
    p.close()


def test_a_good_state_has_nothing_to_say(pressed):
    state = read(pressed, paper(), Load(depth=0.4), X, "", 0.0)
    assert (state.status, state.message, state.facts) == ("ok", "", Facts(unstable_directions=0))


def test_the_onset_is_a_fact_in_mm_and_a_sentence(pressed):
    pressed.unstable, pressed.onset = 2, (np.array([0.025, 0, 0]), np.array([0.0375, 0, 0]))
    state = read(pressed, paper(), Load(depth=0.4), X, "", 0.0)
    assert (state.facts.onset, state.facts.onset_mm, state.facts.unstable_directions) == ("depth", (0.2, 0.3), 2)
    assert state.status == "unstable"
    assert state.message.startswith("unstable since a depth between 0.2 and 0.3 mm (2 unstable directions)")
    record = load_cases.solution_record(state)
    assert [record[f"onset_depth_{end}_mm"] for end in ("from", "to")] == [0.2, 0.3]
    assert record["onset_shear_from_mm"] is None


def test_an_onset_under_a_shear_is_told_by_the_shear(pressed):
    pressed.unstable, pressed.onset = 0, (np.array([0.05, 0, 0]), np.array([0.05, -0.03, 0.04]))
    found = diagnostics.gather(pressed, 8.0, Load(depth=0.4), "", RESPONSE, None, watch=False)
    assert (found.onset, found.onset_mm) == ("shear", pytest.approx((0.0, 0.4)))
    assert "past it now" in said(found)


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


def test_a_shear_that_a_stopped_press_never_began_is_not_in_its_load(monkeypatch):
    """The plate is glued after the press: a press that stops leaves the tip where the shear is 0."""
    from fem.accuracy import QUICK
    from fem.equilibrium import trace

    real = load_stepping.newton

    def stubborn(system, solver, q, plate, *more, **options):
        answer = real(system, solver, q, plate, *more, **options)
        return answer if plate.height is None or plate.height > 1.1 else replace(answer, reason="no_convergence")

    monkeypatch.setattr(load_stepping, "newton", stubborn)
    load = Load(depth=1.0, shear_x=0.5, friction="stick")
    (state,) = trace(paper(), [load], QUICK, magnet="ignored", estimate=False)
    assert (state.status, state.load.shear_x) == ("not_converged", 0.0)
    assert "shear" not in state.message.partition(":")[0]


@pytest.mark.parametrize(("depth", "remark"), [(1.8, None), (2.65, "nearly_guided_only"), (3.1, "guided_only")])
def test_a_press_says_how_near_it_is_to_giving_way_sideways(depth, remark):
    """The paper's sensor does so at 2.87 mm."""
    from fem.equilibrium import solve

    state = solve(paper(), Load(depth=depth))
    assert state.facts.remark == remark
    assert (state.facts.sideways_stiffness_ratio > 0) is (depth < 2.87)
    record = load_cases.solution_record(state)
    assert record["critical_depth_mm_estimate"] == state.facts.critical_depth
    if remark is None:
        assert state.facts.sideways_stiffness_ratio > 0.4
    else:
        assert state.facts.critical_depth == pytest.approx(2.87, rel=0.07)
        assert (
            f"at about {state.facts.critical_depth:.3g} mm, give or take a tenth (now {depth:.4g} mm)"
            in state.message
        )
