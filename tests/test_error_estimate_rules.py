"""The rules as a table: every load has one, and they say what their formula says."""

from typing import get_args

import pytest

from fem.results.error_estimate_rules import (
    LEAST_SHARE,
    RESPONSE_RULES,
    TANGENT_RULES,
    ErrorRule,
    LoadCase,
    TangentQuantity,
    press_limits,
)
from geometry.loads import Magnet
from studies.validation import error_study_cases


def test_every_kind_of_load_and_every_number_has_a_rule_with_and_without_magnet():
    magnets = get_args(Magnet)
    assert set(RESPONSE_RULES) == {(case, magnet) for case in get_args(LoadCase) for magnet in magnets}
    assert set(TANGENT_RULES) == {(name, magnet) for name in get_args(TangentQuantity) for magnet in magnets}


def test_loads_that_shear_have_a_rule_for_the_force_along_the_shear_and_presses_have_none():
    for (case, _), rules in RESPONSE_RULES.items():
        assert (rules.sideways is None) is (case in ("press", "deep", "pressed", "solid press", "tilted press"))


def test_errors_fall_with_the_edge_length():
    """A rule whose error grew on a finer mesh would be a slip of the pen."""
    responses = [rule for r in RESPONSE_RULES.values() for rule in (r.force, r.shift, r.tilt, r.sideways) if rule]
    for rule in [*responses, *TANGENT_RULES.values()]:
        assert rule.usual(0.045, 0.2) < rule.usual(0.09, 0.2)
        assert min(rule.m, rule.p, rule.c) > 0
        assert 0 <= rule.s <= 1


def test_the_usual_difference_has_the_order_of_the_mesh_and_the_power_of_the_base():
    rule = ErrorRule(m=0.5, p=2.0, q=1.5, c=1.0, s=0.3)
    assert rule.usual(1.0, 1.0) == 0.5
    assert rule.usual(0.1, 1.0) == pytest.approx(0.5e-2)
    assert rule.usual(1.0, 4.0) == pytest.approx(0.5 / 8)


def test_the_expected_error_lies_between_the_usual_difference_and_the_one_found():
    rule = ErrorRule(m=1.0, p=1.0, q=0.0, c=2.0, s=0.25)
    assert rule.expected(1e-2, 1e-2) == pytest.approx(2e-2)
    assert rule.expected(1e-2, 16e-2) == pytest.approx(4e-2)
    assert rule.expected(1e-2, 0.0) == rule.expected(1e-2, LEAST_SHARE * 1e-2) > 0


@pytest.mark.parametrize("magnet", get_args(Magnet))
def test_deep_presses_lie_between_the_others_and_the_silicone(magnet):
    for design in error_study_cases.designs():
        first, deepest = press_limits(design, magnet)
        assert 0 < first < deepest < design.L - design.magnet_height * (magnet == "rigid")
