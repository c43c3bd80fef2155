"""The harmonic model beside tetrahedra; the two meet in test_equilibrium too."""

from dataclasses import replace

import pytest

from fem.accuracy import QUICK
from fem.equilibrium import solve
from fem.scene import turns
from geometry.design import paper
from geometry.loads import Load
from studies.validation import crosscheck

STOPPED = {"design": 0, "magnet": "rigid", "depth_mm": 1.0, "shear_mm": 1.0, "status": "not_converged"}
STOPPED |= {"message": "half: stopped", "agree": False, "tilt_deg": 0.0, "shear_y_mm": 0.0, "friction": "stick"}


@pytest.fixture(scope="module")
def solutions():
    load = Load(depth=0.8, shear_x=0.4, friction="stick")
    level = replace(QUICK, section_size=0.16, section_patch=0.03)
    return [solve(paper(), load, replace(level, harmonics=n)) for n in (2, 1, 3)]


@pytest.mark.parametrize("name", crosscheck.QUANTITIES)
def test_answers_agree_within_both_estimates(solutions, name):
    difference = crosscheck.difference(name, *solutions)
    both = difference["harmonic_estimate_percent"] + difference["half_estimate_percent"]
    assert difference["agree"] == (difference["difference_percent"] <= both)
    assert 0 < difference["one_harmonic_more_percent"] < 1


def test_answers_of_other_loads_do_not_agree(solutions):
    one, other, richer = solutions
    far = replace(other, response=replace(other.response, tilt=2 * other.response.tilt))
    difference = crosscheck.difference("tilt", one, far, richer)
    assert not difference["agree"]
    assert difference["difference_percent"] == pytest.approx(100, rel=0.1)


def test_designs_that_disagree_are_told(monkeypatch, run, tmp_path):
    monkeypatch.setattr(crosscheck, "compare", lambda *_: STOPPED)
    status, _, err = run("validate", "crosscheck", "--count", 2, "--out", tmp_path)
    assert status == 3
    assert "2 of 2 designs disagree: design 0, design 0" in err
    assert "0 of 2 designs agree" in (tmp_path / "CROSSCHECK.md").read_text()


def test_a_tilted_plate_is_compared_with_tetrahedra():
    """Two coarse meshes: their answers agree within their estimates."""
    coarse = replace(QUICK, section_size=0.25, solid_size=0.6, solid_patch=0.2)
    result = crosscheck.compare(1, "ignored", coarse, Load(depth=1.0, plate_tilt=0.15))
    assert (result["status"], result["agree"]) == ("ok", True)
    assert "sideways_agree" not in result
    report = crosscheck.result([result]).pages["CROSSCHECK.md"]
    assert "1 of 1 loads agree" in report
    assert report.count("| 1 | ignored | 1 | 0 | 0 | 8.594 | none | ok |") == 3


def test_loads_of_tilted_plates_cover_every_kind():
    loads = [crosscheck.tilted_load(*case) for case in crosscheck.TILTED]
    assert {load.friction for load in loads} == {"none", "stick", 0.4}
    assert {case[0] for case in crosscheck.TILTED} == set(range(12))
    assert [turns([load]) for load in loads].count(True) == 2


def test_tilted_plates_are_solved_on_request(monkeypatch, run):
    monkeypatch.setattr(crosscheck, "compare", lambda *_: STOPPED | {"tilt_deg": 5.0})
    status, _, err = run("validate", "crosscheck", "--count", 1, "--tilted")
    assert status == 3
    assert "3 of 3 loads disagree" in err


@pytest.mark.parametrize("count", [0, 13])
def test_a_count_out_of_range_is_a_sentence(run, count):
    status, out, err = run("validate", "crosscheck", "--count", count)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "between 1 and 12" in err
