"""Rows beside the earlier commit and beside the floor."""

from dataclasses import replace
from pathlib import Path

import pytest

from studies.validation import benchmark_tables, peers, speed_comparison
from studies.validation.benchmark_state import Bench, row

EARLIER = Path("earlier")
TASK = {"task": "trace"}


def bench(**options):
    return Bench(True, Path("nowhere"), "no-such-ccx", None, **options)


@pytest.fixture
def magtip(monkeypatch):
    """Answers of the measured processes by task: first today's, then the earlier commit's, each list by turns."""
    answers = {}

    def turns(task, *, env=None, packages=None):
        given = answers[task["task"]][packages == EARLIER]
        return {"status": "ok", "message": "", **(given.pop(0) if len(given) > 1 else given[0])}

    monkeypatch.setattr(peers, "magtip", turns)
    return answers


def test_the_median_of_the_ratios_by_turns_counts(magtip):
    earlier = [{"cpu_s": s, "forces_N": [(0, 0, 1.01)]} for s in (0.5, 0.62, 0.2)]
    magtip["trace"] = [{"cpu_s": s} for s in (0.1, 0.2, 0.1)], earlier
    own = row("press", "magtip", "", {"cpu_s": 0.1})
    beside = speed_comparison.beside_earlier(bench(earlier=EARLIER), own, TASK, [(0, 0, 1.0)], 3.0)
    assert (beside.times_as_fast, beside.earlier_s, beside.met) == (pytest.approx(3.1), 0.5, True)
    assert beside.earlier_error_percent == pytest.approx(1)
    assert beside.goal == "3 times as fast as commit f83a532"


def test_a_goal_that_was_missed_stays_missed():
    own = row("press", "magtip", "", {"cpu_s": 0.1}, goal="at most 0.05 s")
    for met, times, both in ((False, 9.0, False), (True, 2.0, False), (True, 3.0, True)):
        assert speed_comparison.with_goal(replace(own, met=met, times_as_fast=times), 3.0).met is both


def test_without_the_earlier_commit_the_row_stays_as_it_is(magtip):
    own = row("press", "magtip", "", {"cpu_s": 0.1})
    assert speed_comparison.beside_earlier(bench(), own, TASK, None, 3.0) is own
    assert speed_comparison.beside_floor(bench(), own, TASK) is own


def test_a_failure_of_the_earlier_commit_is_said(magtip):
    magtip["trace"] = [{"cpu_s": 0.1}], [{"status": "failed", "message": "no module"}]
    own = row("press", "magtip", "", {"cpu_s": 0.1})
    beside = speed_comparison.beside_earlier(bench(earlier=EARLIER), own, TASK, None, 3.0)
    assert (beside.times_as_fast, beside.message) == (None, "commit f83a532: no module")


def test_the_floor_is_the_longer_of_operations_and_bytes(magtip):
    counts = {"factor_flops": 4e9, "factor_bytes": 1e9, "assembly_flops": 1e9, "assembly_bytes": 5e9}
    magtip["trace"] = [counts], []
    own = row("press", "magtip", "", {"cpu_s": 9.0})
    beside = speed_comparison.beside_floor(bench(flops_per_s=2e9, bytes_per_s=5e9), own, TASK)
    assert (beside.floor_s, beside.times_floor) == (3.0, 3.0)
    assert "| press |  | 3.00 | 9.00 | 3.00 |" in benchmark_tables.report([beside], {}, {}, "", "")


def test_sections_name_the_median_and_the_worst_design(magtip):
    now = [{"import_s": 0.1, "cpu_s": 0.01, "each_s": [0.01, 0.01, None, 0.02, 0.01, 0.01, 0.01]}]
    magtip["section"] = now, [{"each_s": [0.11, 0.13, 0.1, 0.1, *3 * [0.12]]}]
    found = bench(earlier=EARLIER)
    speed_comparison.section_meshes(found)
    assert [(line.times_as_fast, line.met) for line in found.rows] == [
        (pytest.approx(11), True),
        (pytest.approx(12), True),
        (pytest.approx(5), False),
    ]


def test_small_shear_counts_beyond_its_press(magtip):
    magtip["trace"], magtip["small shear"] = (
        ([{"cpu_s": 0.1}], [{"cpu_s": 0.2}]),
        ([{"cpu_s": 0.2}], [{"cpu_s": 0.6}]),
    )
    own = row("small shear", "magtip", "with stiffness and tilt", {"cpu_s": 0.2})
    alone = speed_comparison.small_shear_beyond(
        bench(earlier=EARLIER), own, {"task": "trace"}, {"task": "small shear"}, 3.0
    )
    assert (alone.cpu_s, alone.times_as_fast, alone.met) == (pytest.approx(0.1), pytest.approx(4), True)


def test_a_tilted_plate_is_held_against_a_shear(monkeypatch):
    def magtip(task):
        return {"status": "ok", "message": "", "cpu_s": 2.0 if task["loads"][0].get("plate_tilt") else 1.0}

    monkeypatch.setattr(peers, "magtip", magtip)
    found = bench()
    speed_comparison.tilted_plate(found)
    assert (found.rows[1].met, found.rows[1].message) == (True, "2.00 times the CPU s of the shear")


def test_the_field_runs_on_one_thread_and_on_two(monkeypatch):
    monkeypatch.setattr(speed_comparison, "POINTS", 50_000)
    monkeypatch.setattr(Bench, "runs", 1)
    found = bench()
    speed_comparison.field_points(found)
    assert [line.setting for line in found.rows[:2]] == ["one thread", "two threads"]
    assert all(line.cpu_s > 0 for line in found.rows[:2])
    assert found.rows[2].program == "magpylib"


def test_sections_in_a_process_of_its_own():
    found = peers.magtip({"task": "section", "size": 0.2, "designs": [{}, {"D": -1.0}]})
    paper_s, impossible = found["each_s"]
    assert 0 < paper_s < 5
    assert impossible is None
