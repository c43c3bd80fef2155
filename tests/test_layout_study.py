"""The verb layout: its record, its files, the search and what it finds, the claim of uniqueness, bad input."""

import csv
import re
import shlex

import pytest

from analytic import decode, survey
from geometry.design import paper
from studies.output import figures
from studies.sensing import (
    decode_readings,
    layout_metrics,
    layout_search,
    layout_uniqueness,
)

FOLDED = ("--set", "magnet_height=4", "--set", "l0=6", "--set", "c=4")


@pytest.fixture
def small(monkeypatch):
    """Coarse grids: what is said of them is tested, not how fine they are."""
    monkeypatch.setattr(decode, "CELLS", (12, 12, 6))
    monkeypatch.setattr(figures, "SCALE", 0.5)
    monkeypatch.setattr(layout_metrics, "COUNTS", (7, 7, 5))
    monkeypatch.setattr(layout_search, "GRID", {1: 5, 2: 4, 3: 3})
    monkeypatch.setattr(layout_search, "STARTS", 2)
    monkeypatch.setattr(layout_search, "HALVINGS", 2)
    monkeypatch.setattr(layout_search, "POSES", (5, 5, 4))
    monkeypatch.setattr(layout_search, "FINALISTS", 3)
    monkeypatch.setattr(layout_uniqueness, "STEP", 1 / 4)
    monkeypatch.setattr(layout_uniqueness, "HEIGHTS", (1.0,))
    monkeypatch.setattr(layout_uniqueness, "BISECTIONS", 1)
    monkeypatch.setattr(layout_uniqueness, "APART", (1 / 80, 1 / 8))
    monkeypatch.setattr(layout_uniqueness, "POSES", (5, 5, 4))


def test_the_paper_is_unique_and_its_shares_add_up(run, strict, small):
    status, out, err = run("layout", "paper", "--json")
    assert (status, err) == (0, "")
    (record,) = strict(out)
    assert record["message"] == "the readings are unique: no two poses in the workspace give the same readings"
    shares = [record[f"{name}_percent"] for name in ("unique", "ambiguous", "saturated", "blocked")]
    assert sum(shares) == pytest.approx(100)
    assert record["det_positive_percent"] + record["det_negative_percent"] == pytest.approx(100)
    assert (record["most_alike"], record["folded"], record["hits"]) == (1, False, [])
    assert 1 < record["condition_median"] < record["condition_worst"]
    assert 0 < record["noise_median_um"] < record["noise_worst_um"]
    assert 0 < record["noise_median_N"] < record["noise_worst_N"]
    assert "NI 9205" in record["noise_source"]


def test_a_folded_layout_says_what_fails(run, strict, small):
    status, out, err = run("layout", "paper", *FOLDED)
    assert status == 0
    assert "ambiguous" in out
    assert "the magnet" in err
    assert "S2" in err
    (record,) = strict(run("layout", "paper", *FOLDED, "--json")[1])
    assert record["ambiguous_percent"] > 10
    assert record["saturated_percent"] + record["blocked_percent"] > 10
    assert record["alike_apart_mm"] > 1
    assert record["most_alike"] > 1
    assert record["folded"] is (record["noise_worst_um"] is None)


def test_the_map_is_a_table_with_units_and_a_picture(run, small, tmp_path):
    status, _, err = run("layout", "paper", *FOLDED, "--out", "map")
    assert status == 0
    assert "layout.csv, layout.png, LAYOUT.md" in err
    assert sorted(p.name for p in (tmp_path / "map").glob("[!.]*")) == ["LAYOUT.md", "layout.csv", "layout.png"]
    with open(tmp_path / "map" / "layout.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 7 * 7 * 5
    plain = {"known", "blocked", "saturated", "det_sign", "condition", "multiplicity"}
    assert all(name in plain or name.endswith(("_mm", "_rad", "_mT", "_um", "_N")) for name in rows[0])
    assert {row["det_sign"] for row in rows} == {"-1", "1"}
    assert {row["multiplicity"] for row in rows if row["saturated"] == "1"} == {""}
    text = (tmp_path / "map" / "LAYOUT.md").read_text("utf-8")
    assert "magtip layout paper --out map --set magnet_height=4 --set l0=6 --set c=4" in text
    assert "infinite" in text or "worst" in text
    verdict = text.splitlines()[2]
    assert re.match(
        r"[\d.]+ % of the workspace is ambiguous: poses up to [\d.]+ mm apart give the same readings[;.]", verdict
    )


def test_search_ranks_and_its_options_give_what_it_says(run, strict, small):
    (record,) = strict(run("layout", "paper", "--search", "--count", 2, "--json")[1])
    given, best, *_ = record["search"]
    assert (given["rank"], best["rank"]) == (0, 1)
    assert given["noise_worst_um"] == pytest.approx(record["noise_worst_um"])
    assert best["unique_percent"] > 99.9
    assert best["noise_worst_um"] <= given["noise_worst_um"]
    (again,) = strict(run("layout", "paper", *shlex.split(best["settings"]), "--json")[1])
    for key in ("unique_percent", "blocked_percent", "noise_worst_um", "condition_worst"):
        assert again[key] == pytest.approx(best[key])
    (same,) = strict(run("layout", "paper", "--search", "--count", 2, "--json")[1])
    assert same["search"] == record["search"]


def test_search_keeps_to_its_ranges(run, strict, small):
    ranges = ("--range", "f=6", "--range", "l0=7,8")
    (record,) = strict(run("layout", "paper", "--search", *ranges, "--json")[1])
    for row in record["search"][1:]:
        assert row["f_mm"] == 6
        assert 7 <= row["l0_mm"] <= 8
    chip = ("--set", "hall_layout=tmag5273a1")
    (record,) = strict(run("layout", "paper", *chip, "--search", "--json")[1])
    rows = record["search"][1:]
    assert all(set(row) & {"f_mm", "l0_mm", "c_mm", "chip_x_mm"} == {"l0_mm", "chip_x_mm"} for row in rows)
    assert rows[0]["noise_worst_um"] < record["noise_worst_um"]
    (again,) = strict(run("layout", "paper", *chip, *shlex.split(rows[1]["settings"]), "--json")[1])
    assert again["chip_x_mm"] == rows[1]["chip_x_mm"]
    assert again["noise_worst_um"] == pytest.approx(rows[1]["noise_worst_um"])
    (record,) = strict(run("layout", "paper", *chip, "--search", "--range", "chip_x=0", "--json")[1])
    # under the axis a chip reads best as near as it may come without saturation
    clear = [row["l0_mm"] for row in record["search"][1:] if row["unique_percent"] > 99.99]
    assert clear == sorted(clear)
    assert len(clear) >= 2
    # the workspace is round about the axis, so any other place is farther from some of it
    (record,) = strict(run("layout", "paper", *chip, "--search", "--range", "l0=7.2", "--json")[1])
    rows = sorted(record["search"], key=lambda row: row["chip_x_mm"])
    worst = [row["noise_worst_um"] for row in rows]
    assert len(rows) >= 3
    assert worst == sorted(worst)


def test_the_claim_and_where_it_fails(run, strict, small, tmp_path):
    status, out, _ = run("layout", "paper", "--claim", "--out", "claim", "--json")
    assert status == 0
    (record,) = strict(out)
    claim = record["claim"]
    assert [row["alike_percent"] for row in claim["forms"]] == [0, 0, 0]
    for row in claim["forms"]:
        assert 0 < row["difference_at_0.1_mm_over_noise"] < row["difference_at_1_mm_over_noise"]
    assert max(row["alike_percent"] for row in claim["heights"] if row["readings"] == "B.n, no tilt") > 30
    text = (tmp_path / "claim" / "LAYOUT.md").read_text("utf-8")
    assert "the claim holds" in text
    assert "B.n, no tilt, over c: fails" in text
    names = {path.name for path in (tmp_path / "claim").glob("[!.]*")}
    assert {"claim.csv", "claim.png"} <= names


def test_least_difference_is_that_of_the_slopes_for_near_poses():
    """Nearby, readings differ by the distance over the noise of the pose there."""
    coder = layout_uniqueness.coder_of(paper(), "B.n, no tilt", decode_readings.of_level(paper(), "paper"))
    seen = survey.survey(coder, (9, 9, 6), multiplicity=False)
    least = survey.least_difference(coder, seen, 0.001)
    assert least == pytest.approx(0.001 / seen.noise_mm.max(), rel=0.05)


@pytest.mark.parametrize(
    ("tokens", "word"),
    [
        (("--set", "magnet_diameter=0", "--set", "magnet_height=0"), "no magnet"),
        (("--mode", "magnitude", "--set", "hall_layout=tmag5273a1"), "chip"),
        (("--claim", "--set", "hall_layout=tmag5273a1"), "three elements"),
        (("--clearance", "-1"), "--clearance"),
        (("--range", "f=5"), "--search"),
        (("--search", "--range", "f=6,5"), "order"),
        (("--search", "--range", "l0=0.1,5"), "l0"),
        (("--search", "--count", "0"), "--count"),
    ],
)
def test_bad_input_is_a_sentence(refusal, tokens, word):
    assert word in refusal("layout", "paper", *tokens)
