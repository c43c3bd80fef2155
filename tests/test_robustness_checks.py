"""Checks of extreme cases: order of forces, largest magnet, Simpson's rule, inverted silicone."""

from dataclasses import replace

import numpy as np
import pytest

from fem.accuracy import QUICK
from fem.equilibrium import solve
from fem.solution import Facts
from geometry.design import LEAST_WALL, BadInput, Design, paper
from geometry.loads import Load
from studies.validation import robustness_cases, robustness_checks
from studies.validation.robustness_checks import Case, press

SMALL = Case("small", press(0.98, 0.99, 1.0), robustness_checks.work, 2e-3, QUICK)


@pytest.fixture(scope="module")
def pressed():
    return solve(paper(), Load(depth=1.0), QUICK)


def test_larger_magnets_take_larger_forces():
    for values, low, high in (((0.2,), 0.5, 1.0), ((4.0,), 1.0, 2.0)):
        scene = replace(SMALL, loads=press(1.0), changes={"magnet_height": 3.0})
        finding = robustness_checks.ordered("magnet_height", values)(scene, robustness_checks.path(scene))
        assert low < finding.measured < high


@pytest.mark.parametrize("changes", [{}, {"D": 20.0, "L": 12.0}, {"D": 1.0, "L": 2.0, "magnet_diameter": 0.5}])
def test_the_largest_magnet_is_the_largest(changes):
    height = robustness_checks.largest_height(changes)
    design = Design(**changes, magnet_height=height, l0=20.0)
    assert design.shape.wall == pytest.approx(LEAST_WALL, abs=1e-6)
    with pytest.raises(BadInput, match="silicone around it"):
        replace(design, magnet_height=height * 1.001)
    assert robustness_checks.largest_height({"L": 4.05}) == 0


def test_simpson_integrates_cubics():
    ways = np.linspace(1, 3, 5)
    assert robustness_checks.simpson(ways, ways**3) == pytest.approx(20, rel=1e-14)


def test_inverted_silicone_is_measured(pressed):
    assert robustness_checks.folded_share(pressed) == 0
    z = pressed.field.mesh.doflocs[1]
    mirrored = np.stack([0 * z, -2 * z], axis=1)
    assert robustness_checks.folded_share(
        replace(pressed, field=replace(pressed.field, u=mirrored))
    ) == pytest.approx(1)


@pytest.mark.parametrize("share", [0.0, 1e-7])
def test_inverted_silicone_that_the_state_does_not_report_fails_its_case(share):
    deep = solve(paper(), Load(depth=3.6), QUICK)
    assert robustness_checks.folded(SMALL, [deep]).measured == 0
    silent = replace(deep, facts=replace(deep.facts, inverted_share=share))
    assert robustness_checks.folded(SMALL, [silent]).measured > 0


# Cases that stop, become unstable or have no contact


def test_a_state_that_is_not_what_a_fresh_solve_gives_fails(pressed):
    stop = replace(pressed, status="not_converged", facts=Facts("no_convergence"))
    scene = replace(SMALL, loads=press(2.0))
    assert robustness_checks.stopped(scene, stop).measured < 1e-9
    assert robustness_checks.stopped(scene, replace(stop, energy=1.001 * stop.energy)).measured == pytest.approx(
        1e-3, rel=0.01
    )


def test_a_tip_that_gives_way_must_hold_less_energy(pressed):
    for factor in (0.5, 1.5):
        finding = robustness_checks.stopped(
            SMALL, replace(pressed, status="unstable", energy=factor * pressed.energy)
        )
        assert (finding.measured, finding.bound) == (pytest.approx(factor), 1.0)


def test_the_model_that_no_contact_points_to_is_tried(pressed):
    far = Case("far", press(1e-9), robustness_checks.work, 0.02, QUICK, magnet="ignored", ends=("no_contact",))
    silent = replace(pressed, status="no_contact", load=Load(depth=1e-9), facts=Facts(remark="no_touch"))
    finding = robustness_checks.stopped(far, silent)
    assert finding.solution is silent
    assert finding.measured < 0.02
    deep = robustness_checks.stopped(far, replace(silent, load=Load(depth=1.0)))
    assert deep.measured > 0.02


def test_samples_are_the_same_in_every_run_and_can_be_made():
    for one, other in zip(robustness_cases.cases(), robustness_cases.cases(), strict=True):
        assert (one.name, one.changes, one.loads) == (other.name, other.changes, other.loads)
        if one.name.startswith("sample"):
            assert 0 < one.loads[-1].depth < one.design.L - one.design.magnet_height
