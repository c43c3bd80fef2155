"""The rules as a table: every load has one, and they say what their formula says."""

from typing import get_args

import pytest

from fem.physics_version import PHYSICS
from fem.results.error_estimates import (
    LEAST_SHARE,
    ErrorRule,
    LoadCase,
    VibrationQuantity,
    error_rules,
    press_limits,
    table_rows,
)
from geometry.loads import Magnet
from studies.validation import error_study_cases

PRESSES = ("press", "deep", "pressed", "solid press", "tilted press")
NUMBERS = {
    "critical": ("depth", "force"),
    "small shear": ("stiffness", "shift", "tilt"),
    "modes": ("frequency", "pressed frequency"),
}


def test_every_kind_of_load_and_every_number_has_a_rule_with_and_without_magnet():
    """Loads that shear have a rule for the force along the shear too, and presses have none."""
    quantities = {
        case: ("force", "shift", "tilt", *(["sideways"] * (case not in PRESSES))) for case in get_args(LoadCase)
    }
    static = {
        (scene, m, name)
        for scene, names in (quantities | NUMBERS).items()
        for m in get_args(Magnet)
        for name in names
    }
    shears = {("vibrating shear", way, name) for way in "xz" for name in ("force", "shift", "reading")}
    presses = {("vibrating press", way, name) for way in "xz" for name in get_args(VibrationQuantity)}
    assert set(error_rules()) == static | shears | presses
    assert len(table_rows()) == len(error_rules())


def test_rules_rest_on_the_answers_of_today():
    assert {row["model"] for row in table_rows()} == set(PHYSICS) - {"full", "cycle"}
    assert all(error_rules().values())


@pytest.fixture
def changed_modes(monkeypatch):
    """A version of the natural frequencies on which no rule rests."""
    error_rules.cache_clear()
    monkeypatch.setitem(PHYSICS, "modes", PHYSICS["modes"] + 1)
    yield
    error_rules.cache_clear()


def test_rules_of_another_version_of_the_answers_are_none(changed_modes):
    unknown = {key for key, rule in error_rules().items() if rule is None}
    assert unknown == {key for key in error_rules() if key[0] == "modes"}


def test_errors_fall_with_the_edge_length():
    """A rule whose error grew on a finer mesh would be a slip of the pen."""
    for rule in error_rules().values():
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
