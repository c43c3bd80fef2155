"""Errors of vibrations against a finer mesh, and their estimates."""

import numpy as np
import pytest

from fem.accuracy import QUICK
from fem.scene import Scene
from geometry.design import paper
from geometry.loads import Load
from studies.output import goals
from studies.simulation import response_curves
from studies.simulation.response_curves import Curves
from studies.validation.errors import vibration_check

SCENE = Scene(paper(), (Load(1.0),), QUICK, "rigid", "axisymmetric")
FREQUENCIES = np.geomspace(1.0, 100.0, 21)


@pytest.fixture(scope="module")
def judged():
    return vibration_check.run(lambda *_: None, quick=True).records


def curves(force, frequency=FREQUENCIES):
    shift = np.ones((len(frequency), 2), dtype=complex)
    return Curves("z", frequency, force, None, shift, shift[:, 0], ("S1",), ("V",), shift[:, :1], shift[:, :1], None)


def test_estimates_hold_on_the_first_design_and_the_page_has_a_row_for_each_quantity(judged):
    assert {one["quantity"] for one in judged} == set(vibration_check.QUANTITIES)
    assert all(one["holds"] == 1 for one in judged)
    assert all(0 < one["static_error"] < one["static_estimate"] < 0.01 for one in judged)
    text = vibration_check.result(judged).pages["VIBRATION_ERRORS.md"]
    assert all(f"| {name} |" in text for name in vibration_check.QUANTITIES)


def test_errors_of_forces_follow_differences_and_resonances_and_are_never_nothing():
    force = np.full(21, 5.0 + 1.0j)
    # meshes that agree by chance
    assert (response_curves.force_errors(curves(force), curves(force), SCENE) > 1e-3).all()
    assert (response_curves.force_errors(curves(force), curves(1.5 * force), SCENE) > 0.25).all()
    resonant = curves(1 - (FREQUENCIES / 30) ** 2 + 0.1j)
    errors = response_curves.force_errors(resonant, resonant, SCENE)
    assert errors.max() > 4 * errors[0]
    assert FREQUENCIES[errors.argmax()] == pytest.approx(30, rel=0.2)
    # a frequency that the coarser mesh lacks is interpolated
    coarse = curves(1.1 * force[::2], FREQUENCIES[::2])
    errors = response_curves.force_errors(curves(force), coarse, SCENE)
    assert np.allclose(errors, errors[0])


def test_a_case_without_an_answer_misses_the_goals(judged):
    assert vibration_check.goals(judged)[0].met
    case = vibration_check.cases(quick=True)[1]
    some = {"z": curves(np.full(21, 5.0 + 0j))}
    lost = vibration_check.judge(case, QUICK, some, {}, some)
    assert [one["quantity"] for one in lost] == list(vibration_check.QUANTITIES[:3])
    assert len(goals.missed(vibration_check.goals([*judged, *lost]))) == 2
    assert len(vibration_check.judge(case, QUICK, {}, {}, {})) == 3
    assert len(goals.missed(vibration_check.goals([]))) == 2
    # motions are in one order whatever the hash seed
    some["x"] = some["z"]
    lost = vibration_check.judge(case, QUICK, some, {}, dict(reversed(some.items())))
    assert [one["motion"] for one in lost] == ["x"] * 3 + ["z"] * 3
