"""The verb sensitivity on the command line: its tables, files, pictures and refusals."""

import csv
import re

import pytest

FAST = ("--model", "finite", "--count", "16", "--sensors", "20", "--trajectories", "2", "--accuracy", "quick")


def test_all_methods_write_their_tables_pictures_and_the_page(run, tmp_path, strict):
    status, out, _ = run(
        *("sensitivity", "paper", "--depth", "0.5", "--methods", "sobol,morris,montecarlo", "--vary", "E=0.8:1.2"),
        *("--vary", "hall_gain=30:32", *FAST, "--out", "o", "--json"),
    )
    rows = strict(out)
    assert status == 0
    assert {row["method"] for row in rows} == {"sobol", "morris", "montecarlo"}
    text = (tmp_path / "o" / "SENSITIVITY.md").read_text("utf-8")
    for heading in ("## Sobol indices", "## Morris' effects", "## Made sensors", "Made with `magtip sensitivity"):
        assert heading in text
    # the gain of the elements has no effect on the force
    assert re.search(r"^- force \(N\) varies with E \d+ %\.$", text, flags=re.M)
    assert "- Along z 95 % of the sensors that have not failed err by at most" in text
    for name in ("sobol", "morris", "montecarlo"):
        assert (tmp_path / "o" / f"{name}.png").stat().st_size > 10_000
        with open(tmp_path / "o" / f"{name}.csv", newline="", encoding="utf-8") as file:
            table = list(csv.DictReader(file))
        assert len(table) == {"sobol": 10, "morris": 10, "montecarlo": 20}[name]
    first = next(row for row in rows if row["method"] == "sobol")
    assert first["total_order"] == pytest.approx(1.0, abs=0.2)


def test_files_of_methods_that_are_not_requested_again_do_not_stay(run, tmp_path):
    common = ("sensitivity", "paper", "--depth", "0.5", *FAST, "--out", "o")
    assert run(*common, "--methods", "sobol")[0] == 0
    assert run(*common, "--methods", "montecarlo")[0] == 0
    names = {path.name for path in (tmp_path / "o").glob("[!.]*")}
    assert names == {"SENSITIVITY.md", "montecarlo.csv", "montecarlo.png", "percentiles.csv"}


def test_failures_are_said_and_end_with_3_if_nothing_succeeds(run):
    common = ("sensitivity", "paper", "--depth", "0.1", "--methods", "sobol", "--count", "16")
    status, _, err = run(*common, "--vary", "L=30:36")
    assert status == 0
    assert "have failed" in err
    status, _, err = run(*common, "--vary", "L=36:40")
    assert status == 3
    assert "48 of 48 have failed (100 %)" in err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--methods", "sobel"), "--methods: there is no method 'sobel': did you mean sobol?"),
        (("--model", "surogate"), "--model: there is no model 'surogate': did you mean surrogate?"),
        (("--seed", "-1"), "--seed must be 0 or more; got -1"),
        (("--methods", "montecarlo", "--vary", "E=1:2"), "--vary works with the methods sobol and morris"),
        (("--tolerance", "Ee=1"), "--tolerance: there is no key 'Ee'"),
        (("--store", "x.sqlite"), "--store works with the method morris only"),
        (("--count", "100"), "need a power of 2, 8 or more, as count; got 100"),
        (("--methods", "sobol,morris", "--trajectories", "1"), "from 2 to 1000 trajectories; got 1"),
        (("--sensors", "0"), "the number of made sensors must be from 1 to 1000000; got 0"),
        (
            ("--vary", "friction=0.1:0.5"),
            "--vary friction: only fields of the design, depth and shear can vary: leave it out",
        ),
        (("--vary", "depth=1:9", "--model", "paper", "--vary", "law=1:2"), "its values are names"),
    ],
)
def test_impossible_studies_are_refused_in_a_sentence(run, options, message):
    status, out, err = run("sensitivity", "paper", "--depth", "1", *options)
    assert (status, out) == (2, "")
    assert message in err
