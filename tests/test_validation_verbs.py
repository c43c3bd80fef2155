"""Verbs of validation: results of several parts, parts that cannot run, and what is known to be missed."""

import tomllib

import pytest

from geometry.bad_input import BadInput
from studies.cli import validation_commands
from studies.output import result
from studies.output.result import Interrupted, Result
from studies.validation import pages
from studies.validation.pages import Check


def study(name, *failures):
    return lambda progress: Result(
        title=name, records=[{"name": name}], tables={name: [{"name": name}]}, failures=failures
    )


def test_parts_are_printed_and_written_one_after_the_other_and_one_that_cannot_run_says_so(tmp_path, capsys):
    def refused(progress):
        raise BadInput("gcc is not installed: install it")

    studies = {"one": study("one"), "two": refused, "three": study("three", "1 of 1 are missed")}
    said = []
    found = pages.report(lambda share, text: said.append(share), studies)
    here = result.Destination(as_json=True)
    assert result.show(found, here) == result.FAILED
    out, err = capsys.readouterr()
    assert [line.split('"')[3] for line in out.splitlines()] == ["one", "three"]
    assert err.splitlines() == ["magtip: two: gcc is not installed: install it", "magtip: 1 of 1 are missed"]
    result.write(found, tmp_path, "magtip validate verify")
    assert {path.name for path in tmp_path.glob("[!.]*")} == {"one.csv", "three.csv"} == set(result.names(found))
    assert result.show(pages.report(lambda *_: None, {"one": study("one")}), here) == result.GOOD


def test_parts_that_are_complete_outlive_an_interrupt():
    def stopped(progress):
        raise KeyboardInterrupt

    with pytest.raises(Interrupted, match="1 parts are complete") as raised:
        pages.report(lambda *_: None, {"one": study("one"), "two": stopped, "three": study("three")})
    assert [part.title for part in raised.value.result.parts] == ["one"]


def test_a_check_is_relative_to_what_is_expected_unless_that_is_nothing():
    assert Check("force", 2.1, 2.0, 0.05).off == pytest.approx(0.05)
    assert Check("force at rest", -0.1, 0.0, 0.2).passed
    assert not Check("unknown", float("nan"), 1.0, 1e9).passed


def test_known_misses_are_those_of_studies_and_every_part_has_a_quick_run():
    expected = tomllib.loads((pages.TEMPLATES.parent / "expected_misses.toml").read_text("utf-8"))
    written = {path.name.partition(".")[0] for path in pages.TEMPLATES.glob("*.md.j2")}
    assert set(expected) <= written
    assert {run for runs in expected.values() for run in runs} <= {"quick", "full"}
    for verb in ("bench", "devices", "errors", "formulas", "surrogate", "verify"):
        parts = validation_commands.parts_of(__import__(f"studies.validation.{verb}", fromlist=["FILES"]))
        options = {name: [one.name for one in validation_commands.arguments(part)] for name, part in parts.items()}
        assert [name for name, own in options.items() if "quick" not in own] == []
