"""Checks of extreme cases that stop, become unstable or have no contact."""

from dataclasses import replace

import pytest

from fem.accuracy import QUICK
from fem.equilibrium import solve
from fem.solution import Facts
from geometry.design import paper
from geometry.loads import Load
from studies.validation import robustness_checks, robustness_ends
from studies.validation.robustness_checks import Case, press

SMALL = Case("small", press(0.98, 0.99, 1.0), robustness_checks.work, 2e-3, QUICK)


@pytest.fixture(scope="module")
def pressed():
    return solve(paper(), Load(depth=1.0), QUICK)


def test_a_state_that_is_not_what_a_fresh_solve_gives_fails(pressed):
    stop = replace(pressed, status="not_converged", facts=Facts("no_convergence"))
    scene = replace(SMALL, loads=press(2.0))
    assert robustness_ends.stopped(scene, stop).measured < 1e-9
    assert robustness_ends.stopped(scene, replace(stop, energy=1.001 * stop.energy)).measured == pytest.approx(
        1e-3, rel=0.01
    )


def test_a_tip_that_gives_way_must_hold_less_energy(pressed):
    for factor in (0.5, 1.5):
        finding = robustness_ends.stopped(SMALL, replace(pressed, status="unstable", energy=factor * pressed.energy))
        assert (finding.measured, finding.bound) == (pytest.approx(factor), 1.0)


def test_the_model_that_no_contact_points_to_is_tried(pressed):
    far = Case("far", press(1e-9), robustness_checks.work, 0.02, QUICK, magnet="ignored", ends=("no_contact",))
    silent = replace(pressed, status="no_contact", load=Load(depth=1e-9), facts=Facts(remark="no_touch"))
    finding = robustness_ends.stopped(far, silent)
    assert finding.solution is silent
    assert finding.measured < 0.02
    deep = robustness_ends.stopped(far, replace(silent, load=Load(depth=1.0)))
    assert deep.measured > 0.02
