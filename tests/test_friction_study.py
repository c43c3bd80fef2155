"""The study of Coulomb friction: its verdicts, its files, its verb. The physics: tests/test_contact.py."""

from dataclasses import replace

import numpy as np
import pytest

from geometry.bad_input import SolveFailed
from geometry.loads import Load
from studies.output import result
from studies.validation.verify import extremes, friction


@pytest.fixture(scope="module")
def states():
    """A press, then a shear to full slip."""
    loads = [Load(depth=0.5, shear_x=float(x), friction=0.1) for x in np.linspace(0, 0.6, 4)]
    return friction._follow(loads, friction.COARSE, "ignored")


def test_full_slip_is_told_from_a_wrong_coefficient_and_a_way_there_is_no_closed_loop(states, tmp_path):
    check = friction.full_slip(states)
    wrong = [replace(state, load=replace(state.load, friction=0.12)) for state in states]
    assert (check["passed"], friction.full_slip(wrong)["passed"]) == (True, False)
    assert not any(each["passed"] for each in friction.closed([*states, states[0]]))
    result.write(friction.result([check], [states], states), tmp_path, "magtip validate verify friction --quick")
    report = (tmp_path / "FRICTION.md").read_text()
    assert "1 of 1 checks pass" in report
    assert "`magtip validate verify friction --quick`" in report
    assert (tmp_path / "friction.png").is_file()
    assert (tmp_path / "friction.csv").read_text().startswith("check,quantity")


def test_the_verb_fails_when_a_check_does(run, strict, monkeypatch):
    check = friction._check("onset", "force", 1.1, 1.0, 0.01)
    monkeypatch.setattr(friction, "run", lambda progress, quick=False: friction.result([check], [], []))
    status, out, err = run("validate", "verify", "friction", "--json")
    assert status == 3
    assert strict(out) == [check]
    assert "1 of 1 are missed: force" in err


def test_the_judge_of_extremes_measures_the_cone():
    loads = tuple(Load(depth=0.5, shear_x=x, friction=0.1) for x in (0.0, 0.6))
    scene = extremes.Case("small", loads, extremes.cone, 0.01, friction.COARSE, magnet="ignored")
    states = extremes.path(scene)
    found = extremes.cone(scene, states)
    assert states[-1].slip_share == 1
    assert found.measured < scene.bound


def test_coulombs_law_holds_under_a_tilted_plate():
    rough = replace(friction.SOLID, solid_size=0.5, solid_patch=0.15, friction_step_factor=8.0)
    assert friction.tilted(rough, mu=0.05, depth=0.4, shear=0.25)["passed"]


def test_a_part_that_stops_is_a_missed_check(monkeypatch):
    def stopped(*args, **options):
        raise SolveFailed("stopped at depth 0.5 mm")

    passed = friction._check("onset", "share", 1.0, 1.0, 0.1)
    monkeypatch.setattr(friction, "onset", lambda level: [passed])
    monkeypatch.setattr(friction, "curve", stopped)
    monkeypatch.setattr(friction, "cycle", stopped)
    found = friction.run(lambda share, text: None, quick=True)
    checks = found.records
    assert [check["passed"] for check in checks] == [True, False, False, False, False, False]
    assert "no measurement: stopped at depth 0.5 mm" in checks[-1]["quantity"]
    assert "1 of 6 checks pass" in found.pages["FRICTION.md"]
