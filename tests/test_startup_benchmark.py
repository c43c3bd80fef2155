"""The bench of the start: what it reads, and its page."""

import sys

import pytest

from studies.benchmarks import startup_benchmark as bench


@pytest.fixture(scope="module")
def measured():
    return bench.measured({bench.SOLVE: ("--version",)}, runs=1)


def test_imports_are_part_of_what_a_command_takes(measured):
    start = measured[0][0]
    assert (start.command, start.runs) == (bench.SOLVE, 1)
    assert start.imports_s > 0
    assert start.cpu_s > 0
    assert start.clock_s > 0
    assert start.modules > len(sys.builtin_module_names)


def test_modules_are_sorted_by_their_own_time(measured):
    modules = measured[1]
    times = [module.own_ms for module in modules]
    assert times == sorted(times, reverse=True)
    assert {"cyclopts", "geometry.design"} <= {module.module for module in modules}
    assert sum(times) == pytest.approx(1e3 * measured[0][0].imports_s, rel=1e-9)
    assert sum(bench.libraries(modules).values()) == pytest.approx(sum(times), rel=1e-9)


def test_the_page_says_whether_goals_are_met():
    starts = [bench.Start(name, 3, 0.3, 700, 0.3, 0.3, 0.1) for name in bench.COMMANDS]
    page = bench.report(starts, [bench.ModuleImport("numpy", 12.0)], {"machine": "one"})
    assert "| imports of a solve at most 0.4 s | 0.30 s | yes |" in page
    assert "| list of verbs at most 0.25 s of CPU | 0.30 s | **no** |" in page
    assert page.count("| `numpy` | 12.0 |") == 2
    assert "- machine: one" in page


def test_children_keep_compiled_modules(monkeypatch, tmp_path):
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    child = bench.environment(tmp_path)
    assert "PYTHONDONTWRITEBYTECODE" not in child
    assert (child["PYTHONPYCACHEPREFIX"], child["OMP_NUM_THREADS"]) == (str(tmp_path), "1")
