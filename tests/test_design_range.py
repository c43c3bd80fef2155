"""The study of the range: its samples reach the ends, its rows say what is wrong, it goes on where it stopped."""

import json
from dataclasses import asdict, replace

import pytest

from geometry.design import Design
from studies.output import goals
from studies.validation import design_range, design_range_steps
from studies.validation.design_range_steps import DesignResult


def test_samples_reach_the_ends_and_stay_the_same():
    found = design_range.samples(design_range.COUNT)
    assert len(found) >= 60
    assert design_range.samples(5) == found[:5]
    D = [one.D for one in found]
    assert (min(D), max(D)) == (1, 50)
    assert min(one.L - one.D / 2 for one in found) == pytest.approx(design_range.LEAST_STEM)
    assert max(one.L / one.D for one in found) == pytest.approx(10, rel=1e-3)
    assert min(one.magnet_diameter for one in found) == design_range.LEAST_DIAMETER
    ratios = [one.magnet_height / one.magnet_diameter for one in found]
    assert 0.0999 < min(ratios) < max(ratios) < 4.001


def test_the_largest_magnets_leave_the_wall():
    made = [
        Design(**asdict(design_range._sample([x, y, 1.0, z, 0.0])))
        for x in (0.5, 1)
        for y in (0.6, 1)
        for z in (0, 0.5)
    ]
    for design in made:
        assert design_range.WALL - 1e-9 <= design.shape.wall < design_range.WALL + 0.01 * design.D


@pytest.fixture
def quick(monkeypatch):
    """Rows without work; every third design fails."""
    done = []

    def examine(number, sample, cache):
        done.append(number)
        status = "failed" if number % 3 == 2 else "ok"
        sizes = sample.D, sample.L, sample.magnet_diameter, sample.magnet_height, sample.magnet_edge_radius
        return DesignResult(number, *sizes, status=status, tetrahedra=10 * number)

    monkeypatch.setattr(design_range_steps, "examine", examine)
    return done


def test_a_stopped_run_goes_on(quick, run, tmp_path, strict):
    assert run("validate", "range", "--count", 2, "--out", "out")[0] == 0
    status, out, err = run("validate", "range", "--count", 4, "--out", "out", "--json")
    assert quick == [0, 1, 2, 3]
    assert [row["design"] for row in strict(out)] == [0, 1, 2, 3]
    assert status == 3
    assert "designs that fail (design 2): 1, goal at most 0" in err
    store = tmp_path / "out" / "rows.jsonl"
    lines = store.read_text().splitlines()
    store.write_text("\n".join([lines[0], json.dumps(json.loads(lines[1]) | {"code": "old"}), lines[2][:-9]]))
    run("validate", "range", "--count", 3, "--out", "out")
    assert quick == [0, 1, 2, 3, 1, 2]
    text = (tmp_path / "out" / "RANGE.md").read_text()
    assert "Of 3 designs, 2 are good, 0 are impossible and 1 failed" in text
    assert "| tetrahedra | 0 | 10 | 20 |" in text
    assert len((tmp_path / "out" / "range.csv").read_text().splitlines()) == 4


def test_bad_counts(run):
    for count in (0, -1, 5000):
        status, out, err = run("validate", "range", "--count", count)
        assert (status, out, err.count("\n")) == (2, "", 1)


def test_without_a_possible_design_nothing_is_shown():
    impossible = DesignResult(0, 8.0, 3.0, 4.0, 2.0, 0.2, status="impossible")
    assert goals.missed(design_range.goals([impossible]))
    assert not goals.missed(design_range.goals([replace(impossible, status="ok")]))
