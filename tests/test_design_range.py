"""The study of the range: its samples reach the ends, its rows say what is wrong."""

import pytest

from geometry.design import Design
from studies.output import goals
from studies.validation import design_range


def test_samples_reach_the_ends_and_stay_the_same():
    found = design_range.samples(64)
    assert len(found) >= 60
    assert design_range.samples(5) == found[:5]
    D = [one["D"] for one in found]
    assert (min(D), max(D)) == (1, 50)
    assert min(one["L"] - one["D"] / 2 for one in found) == pytest.approx(design_range.LEAST_STEM)
    assert max(one["L"] / one["D"] for one in found) == pytest.approx(10, rel=1e-3)
    assert min(one["magnet_diameter"] for one in found) == design_range.LEAST_DIAMETER
    ratios = [one["magnet_height"] / one["magnet_diameter"] for one in found]
    assert 0.0999 < min(ratios) < max(ratios) < 4.001


def test_the_largest_magnets_leave_the_wall():
    made = [Design(**design_range._sample([x, y, 1.0, z, 0.0])) for x in (0.5, 1) for y in (0.6, 1) for z in (0, 0.5)]
    for design in made:
        assert design_range.WALL - 1e-9 <= design.shape.wall < design_range.WALL + 0.01 * design.D


def row(number):
    sizes = {f"{name}_mm": 1.0 for name in design_range.SIZES}
    steps = dict.fromkeys(design_range.COLUMNS) | dict.fromkeys(design_range.STEPS, "ok")
    return {"design": number, **sizes, "status": "ok", "message": "", **steps}


def test_a_design_that_fails_is_told(monkeypatch, run, refusal, tmp_path, strict):
    """Rows without work; every third design fails."""

    def examine(number, sample):
        return row(number) | {"status": "failed" if number % 3 == 2 else "ok", "tetrahedra": 10 * number}

    monkeypatch.setattr(design_range, "examine", examine)
    status, out, err = run("validate", "range", "--count", 4, "--out", "out", "--json")
    assert [row["design"] for row in strict(out)] == [0, 1, 2, 3]
    assert status == 3
    assert "designs that fail (design 2): 1, goal at most 0" in err
    text = (tmp_path / "out" / "RANGE.md").read_text()
    assert "Of 4 designs, 3 are good, 0 are impossible and 1 failed" in text
    assert "| tetrahedra | 0 | 15 | 30 |" in text
    assert len((tmp_path / "out" / "range.csv").read_text().splitlines()) == 5
    for count in (0, -1, 5000):
        refusal("validate", "range", "--count", count)


def test_without_a_possible_design_nothing_is_shown():
    assert goals.missed(design_range.goals([row(0) | {"status": "impossible"}]))
    assert not goals.missed(design_range.goals([row(0)]))
    few = design_range.goals([row(k) | {"status": "impossible" if k else "ok"} for k in range(5)])
    assert [goal.name for goal in goals.missed(few)] == ["designs that are possible"]


@pytest.mark.parametrize("step", design_range.STEPS)
def test_a_step_that_every_design_is_refused_misses_its_goal(step):
    (lost,) = goals.missed(design_range.goals([row(k) | {step: "impossible"} for k in range(9)]))
    assert (lost.value, lost.name) == (0, f"possible designs with a {design_range.STEPS[step]}")
    assert not goals.missed(design_range.goals([row(k) | {step: "ok" if k else "impossible"} for k in range(10)]))


@pytest.mark.parametrize(("number", "ending"), [(3, "impossible"), (20, "ok"), (21, "ok")])
def test_some_designs(number, ending):
    """A stem too short for its magnet, a small disc in a beam of 50 mm, one close to the base."""
    result = design_range.examine(number, design_range.samples(number + 1)[number])
    assert result["status"] == ending
    if ending == "impossible":
        assert "needs at least 0.1 mm: take a smaller magnet" in result["message"]
        return
    assert (result["section"], result["solid_mesh"]) == ("ok", "ok")
    assert result["solids"] == "ok" or result["message"]
    assert result["least_jacobian"] > 0.04


def test_a_step_that_fails_is_told_and_the_others_go_on(monkeypatch):
    def broken(design):
        raise ZeroDivisionError("of the test")

    monkeypatch.setattr(design_range, "_solids", broken)
    monkeypatch.setattr(design_range, "_solid_mesh", lambda design: {"tetrahedra": 7})
    result = design_range.examine(18, design_range.samples(19)[18])
    outcome = (result["status"], result["solids"], result["section"], result["tetrahedra"])
    assert outcome == ("failed", "failed", "ok", 7)
    assert result["message"] == "solids: ZeroDivisionError: of the test"
