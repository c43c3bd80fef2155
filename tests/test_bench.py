"""The bench at a reduced size: medians and goals, a missing library, one solve in a process of its own."""

import itertools
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fem.accuracy import STANDARD
from fem.equilibrium import trace
from geometry.design import paper
from geometry.loads import Load
from studies.validation.bench import speed

ROOT = Path(__file__).resolve().parent.parent


def answer(error, cpu, status="ok"):
    return {"status": status, "message": "", "cpu_s": cpu, "forces_N": [(0, 0, 1 + error / 100)]}


# Figures


def test_medians_tell_a_failure_and_an_error_beyond_tolerance_is_said():
    runs = [answer(0.4, cpu) for cpu in (1.0, 9.0, 2.0)]
    found = speed.median(runs)
    assert (found["cpu_s"], found["runs"]) == (2.0, 3)
    assert speed.median([*runs, answer(0, 1.0, "failed")])["status"] == "failed"
    truth = [(0, 0, 1.0)]
    assert speed.judged(found, truth, 0.5)["error_percent"] == pytest.approx(0.4)
    beyond = speed.judged(found, truth, 0.3)
    assert (beyond["status"], "0.4 %" in beyond["message"]) == ("inaccurate", True)


# Processes


def test_a_solve_in_a_process_of_its_own_gives_the_same_force():
    accuracy = {"section_size": 0.12}
    begin = time.perf_counter()
    found = speed.magtip(speed.task({"magnet": "ignored", "loads": [{"depth": 0.5}]}, {"accuracy": accuracy}))
    whole = time.perf_counter() - begin
    here = trace(paper(), [Load(depth=0.5)], replace(STANDARD, **accuracy), magnet="ignored", estimate=False)
    assert found["status"] == "ok", found
    assert found["forces_N"][0] == pytest.approx(here[0].response.force, rel=1e-9)
    assert 0.001 < found["cpu_s"] < 20
    # the imports are a part of the life of the process
    assert found["import_s"] > 0.05
    assert found["import_s"] + found["cpu_s"] < whole
    assert 40 < found["base_MB"] <= found["peak_MB"] < 2000


def test_a_task_in_a_process_of_its_own_and_a_solve_that_raises():
    for task in ({"task": "modes", "count": 1}, {"task": "field", "points": 9}):
        found = speed.magtip(task)
        assert found["status"] == "ok", found["message"]
        assert found["cpu_s"] > 0
    found = speed.magtip(speed.task({"magnet": "ignored", "loads": [{"depth": 20.0}]}, {}))
    assert found["status"] == "failed"
    assert "depth must be less than" in found["message"]


def test_memory_is_that_of_the_child_alone_and_a_process_beyond_its_limit_is_stopped():
    ballast = np.ones(20_000_000)
    assert speed.measure([sys.executable, "-I", "-S", "-c", "pass"]).peak_MB < 40
    assert ballast[0] == 1
    begin = time.perf_counter()
    ended = speed.measure([sys.executable, "-c", "import time; time.sleep(60)"], limit=0.3)
    assert time.perf_counter() - begin < 10
    assert ended.exit != 0
    assert "0.3 s" in ended.err


# The command

CASES = {case["key"]: case for case in speed.CASES}


def of_magtip(monkeypatch, answer):
    """Let a function answer the tasks of magtip."""
    monkeypatch.setattr(speed, "magtip", lambda task: dict(answer(task)))


def test_a_library_that_is_not_installed_is_a_row_that_says_how_to_install_it(monkeypatch, run, strict, tmp_path):
    of_magtip(monkeypatch, lambda task: answer(0, 0.1))
    monkeypatch.setattr(speed, "installed", lambda one: "program" not in one)
    status, out, err = run("validate", "bench", "--cases", "field", "--json", "--out", "found")
    _, row = strict(out)
    assert (status, row["program"], row["status"], row["met"]) == (3, "magpylib", "not installed", None)
    assert "pip install 'magpylib" in row["message"]
    assert row["message"] in err
    text = (tmp_path / "found" / "BENCH.md").read_text("utf-8")
    assert "Nothing" not in text
    assert "times faster), promises missed: no data" in text
    assert (tmp_path / "found" / "bench.csv").read_text("utf-8").count("\n") == 3


def test_only_the_chosen_cases_run_and_the_help_names_all(monkeypatch, run, refusal, strict):
    assert all(name in run("validate", "bench", "--help")[1] for name in CASES)
    of_magtip(monkeypatch, lambda task: answer(0, 0.1))
    out = run("validate", "bench", "--cases", "field, modes", "--json")[1]
    assert [row["case"][:5] for row in strict(out)] == ["first", "field", "field"]
    assert "modes, field; got fields" in refusal("validate", "bench", "--cases", "fields")


@pytest.mark.parametrize(("cpu", "met"), [(0.2, True), (0.4, False)])
def test_goals_are_judged_and_misses_said(monkeypatch, run, strict, cpu, met):
    of_magtip(monkeypatch, lambda task: answer(0.1, cpu) | {"dofs": 9, "peak_MB": 50.0})
    own = CASES["press-curve"]
    monkeypatch.setattr(speed, "CASES", [own | {"runs": own["runs"][:1]}])
    status, out, err = run("validate", "bench", "--quick", "--json")
    assert (status, strict(out)[0]["met"]) == (0 if met else 3, met)
    assert ("press curve to 3 mm (at most 0.3 s, within 0.5 %), promises missed: 1" in err) is not met


@pytest.mark.parametrize(
    ("key", "seconds", "met"),
    [
        ("small-shear", (0.35, 0.54), True),
        ("small-shear", (0.35, 0.56), False),
        ("modes", (0.4,), True),
        ("modes", (0.6,), False),
        ("tilted-plate", (1.0, 2.0), True),
        ("tilted-plate", (1.0, 4.0), False),
        ("shear", (1.0, 12.0), True),
        ("shear", (1.0, 9.0), False),
        ("field", (1.0, 5.0), True),
        ("field", (1.0, 3.0), False),
        ("modes", (None,), False),
        ("field", (1.0, None), False),
    ],
)
def test_runs_that_take_turns_are_held_against_the_first(monkeypatch, key, seconds, met):
    answers = itertools.cycle(answer(0, s) if s else {"status": "failed", "message": "lost"} for s in seconds)
    of_magtip(monkeypatch, lambda task: next(answers))
    monkeypatch.setattr(speed, "installed", lambda one: True)
    rows = speed.measured(CASES[key], quick=True)
    assert rows[-1]["met"] is met
    assert rows[-1]["faster"] == (seconds[1] / seconds[0] if key in ("shear", "field") and seconds[-1] else None)
