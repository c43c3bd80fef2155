"""The verb layout: its record, its files, the search, the claim of uniqueness, resolution over loads, bad input."""

import csv
import itertools
import re
import shlex

import numpy as np
import pytest
from numpy.testing import assert_allclose

from analytic import decode
from geometry.design import Design
from studies.inputs.option_groups import Basis
from studies.output import figures
from studies.sensing import decode_readings, force_range, layout_metrics, layout_search, layout_uniqueness

FOLDED = ("--level", "paper", "--set", "magnet_height=4", "--set", "l0=6", "--set", "c=4")


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Coarse grids: what is said of them is tested, not how fine they are."""
    monkeypatch.setattr(decode, "CELLS", (12, 12, 6))
    monkeypatch.setattr(figures, "SCALE", 0.5)
    monkeypatch.setattr(layout_metrics, "COUNTS", (7, 7, 5))
    monkeypatch.setattr(force_range, "COUNTS", (4, 3, 4))
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


def test_the_paper_is_unique_and_its_shares_add_up(run, strict):
    status, out, err = run("layout", "paper", "--level", "paper", "--json")
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


def test_a_folded_layout_says_what_fails(run, strict):
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


def test_the_map_is_a_table_with_units_and_a_picture(run, tmp_path):
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
    assert "magtip layout paper --level paper --out map --set magnet_height=4 --set l0=6 --set c=4" in text
    assert "infinite" in text or "worst" in text
    verdict = text.splitlines()[2]
    assert re.match(
        r"[\d.]+ % of the workspace is ambiguous: poses up to [\d.]+ mm apart give the same readings[;.]", verdict
    )


def test_search_ranks_and_its_options_give_what_it_says(run, strict):
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


def test_layouts_that_reject_a_field_are_ranked_by_the_noise_of_the_force_with_its_price(run, strict, tmp_path):
    chips = [word for text in ("hall_layout=tle493d-w2b6", "chip_count=3", "chip_noise=0.00005", "chip_x=5")
             for word in ("--set", text)]  # fmt: skip
    search = ("--search", "--count", 3, "--range", "chip_x=5", "--range", "l0=5.6,7")
    (record,) = strict(run("layout", "paper", *chips, *search, "--reject-ambient", "--json", "--out", tmp_path)[1])
    given, *found = record["search"]
    assert [row["noise_worst_N"] for row in found] == sorted(row["noise_worst_N"] for row in found)
    assert given["noise_factor"] == record["noise_factor"]
    (plain,) = strict(run("layout", "paper", *chips, "--json")[1])
    assert 1 < record["noise_factor"] < 1.1
    assert 1 < record["noise_median_N"] / plain["noise_median_N"] < 1.1
    assert "| factor |" in (tmp_path / "LAYOUT.md").read_text("utf-8")
    # nearer to the axis the field of the magnet is more like a uniform one
    (near,) = strict(run("layout", "paper", *chips[:-1], "chip_x=3", "--reject-ambient", "--json")[1])
    assert near["noise_factor"] > 2 * record["noise_factor"] - 1


def test_search_keeps_to_its_ranges(run, strict):
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


def test_the_claim_and_where_it_fails(run, strict, tmp_path):
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


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ("--set magnet_diameter=0 --set magnet_height=0", "no magnet"),
        ("--mode magnitude --set hall_layout=tmag5273a1", "chip"),
        ("--claim --set hall_layout=tmag5273a1", "three elements"),
        ("--clearance -1", "--clearance"),
        ("--range f=5", "--range sets the range of a search: add --search"),
        ("--search --range f=6,5", "order"),
        ("--reject-ambient", "take three chips of three axes or more"),
        ("--reject-ambient --mode magnitude", "leave --mode magnitude or --reject-ambient out"),
        ("--search --range l0=0.1,5", "l0"),
        ("--search --count 0", "--count"),
        ("--force-range 5", "takes 2 numbers"),
        ("--force-range 0,2", "the normal force must be above 0"),
        ("--force-range 5,-1", "the tangential force 0 or more"),
    ],
)
def test_bad_input_is_a_sentence(refusal, options, sentence):
    assert sentence in refusal("layout", "paper", *options.split())


# Resolution over a range of loads


def coder_of(design):
    law = decode_readings.of_level(design, "finite")
    return layout_metrics.prepare(design, law, Basis(), cells=(8, 8, 4))[0]


@pytest.fixture(scope="module")
def coder():
    return coder_of(Design(hall_noise=1e-3))


def evaluated(coder, normal=4.0, tangential=1.0):
    source = decode_readings.Source("finite", coder.mechanics, "it is asked for")
    return force_range.evaluate(coder, force_range.loads(coder, normal, tangential), normal, tangential, source)


def test_readings_of_the_loads_decode_to_the_loads(coder):
    grid = force_range.loads(coder, 4.0, 1.0)
    pressed = grid.reached & (grid.force[2] > 0)
    assert pressed.sum() == 3 * 3 * 4
    decoded = decode.decode(coder, grid.poses.readings[:, pressed].T)
    assert_allclose(decoded.force.T, grid.force[:, pressed], atol=1e-6)
    assert_allclose(decoded.noise_N.T, grid.poses.axis_noise_N[:, pressed], rtol=1e-4)


def test_the_worst_load_is_a_row_of_the_table(coder):
    answer = evaluated(coder)
    rows = force_range.table(force_range.loads(coder, 4.0, 1.0)).to_dict("records")
    assert len(rows) == answer["loads"] == 4 * (1 + 2 * 4)
    for k, axis in enumerate("xyz"):
        column = [row[f"resolution_{axis}_N"] for row in rows if row["usable"]]
        assert answer["worst_N"][k] == max(column)
        (at,) = [row for row in rows if row[f"resolution_{axis}_N"] == answer["worst_N"][k]][:1]
        assert [at[f"force_{name}_N"] for name in "xyz"] == answer["worst_at_N"][k]
        assert_allclose(
            at[f"resolution_{axis}_N_per_N"], answer["worst_N"][k] / np.linalg.norm(answer["worst_at_N"][k])
        )
    assert answer["worst_N_per_N"] == [answer["worst_N"][0] / 1, answer["worst_N"][1] / 1, answer["worst_N"][2] / 4]


def test_a_saturated_element_is_named():
    answer = evaluated(coder_of(Design(hall_noise=1e-3, hall_high=2.9)))
    assert answer["saturated_elements"] == ["S1"]
    assert 0 < answer["saturated_percent"] < 100
    assert "S1 saturates" in answer["message"]
    assert answer["full_load_N"] is None


def test_loads_beyond_the_formulas_are_counted(coder):
    answer = evaluated(coder, 90.0, 1.0)
    assert 0 < answer["reached_percent"] < 50
    assert "of the loads are within the mechanics" in answer["message"]
    assert answer["full_load_N"] is None


def test_loads_outside_the_range_of_level_finite_are_a_warning(coder):
    assert evaluated(coder, 4.0, 0.5)["warnings"] == []
    (warning,) = evaluated(coder, 4.0, 2.0)["warnings"]
    assert "shear is above 0.3 D" in warning


def test_the_level_is_that_of_decode_and_is_said(run, strict):
    words = ("--force-range", "60,30", "--json")
    status, out, err = run("layout", "foot", *words)
    assert status == 0
    (record,) = strict(out)
    (decoded,) = strict(run("decode", "foot", "--readings", "0,0,0", "--json")[1])
    assert record["mechanics"] == decoded["level"] == "surrogate"
    assert record["mechanics_reason"] == decoded["level_reason"]
    # level paper, which bends a third as stiff, would say that some of these loads saturate the chip
    assert record["force_range"]["saturated_elements"] == []
    assert "% of the loads lie beyond the surrogate, where the plate needs a friction of" in err


def test_the_verb_reports_the_range(run, strict, tmp_path):
    command = ("layout", "paper", "--level", "finite", "--force-range", "4,1")
    status, out, err = run(*command)
    assert status == 0
    assert "warning" not in err
    assert "Range of loads" in out
    (record,) = strict(run(*command, "--json", "--out", "map")[1])
    forces = record["force_range"]
    assert forces["message"].startswith("0 to 4 N normal and 0 to 1 N tangential: resolution ")
    assert record["noise_worst_axes_N"][2] <= record["noise_worst_N"] * (1 + 1e-9)
    with open(tmp_path / "map" / "force_range.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == forces["loads"]
    assert all(0 <= float(a["force_z_N"]) <= float(b["force_z_N"]) <= 4 for a, b in itertools.pairwise(rows))
    assert "## Resolution over the range of loads" in (tmp_path / "map" / "LAYOUT.md").read_text("utf-8")
