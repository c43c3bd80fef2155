"""Resolution over a range of loads: loads come back, the worst is the worst, noise scales, and bad input."""

import csv
import itertools

import numpy as np
import pytest
from numpy.testing import assert_allclose

from analytic import decode
from geometry.design import BadInput, Design
from studies.inputs.option_groups import Basis
from studies.sensing import decode_readings, force_range, layout_metrics

COUNTS = (4, 3, 4)


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Coarse grids: what is reported of them is tested, not how fine they are."""
    monkeypatch.setattr(force_range, "COUNTS", COUNTS)
    monkeypatch.setattr(layout_metrics, "COUNTS", (5, 5, 4))


def coder_of(design):
    law = decode_readings.of_level(design, "finite")
    return layout_metrics.prepare(design, law, Basis(), cells=(8, 8, 4))[0]


@pytest.fixture(scope="module")
def coder():
    return coder_of(Design(hall_noise=1e-3))


def evaluated(coder, normal=4.0, tangential=1.0):
    return force_range.evaluate(coder, force_range.loads(coder, normal, tangential), normal, tangential, "finite")


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
    assert "of the loads are within the formulas or states" in answer["message"]
    assert answer["full_load_N"] is None


def test_loads_outside_the_range_of_level_finite_are_a_warning(coder):
    assert evaluated(coder, 4.0, 0.5)["warnings"] == []
    (warning,) = evaluated(coder, 4.0, 2.0)["warnings"]
    assert "shear is above 0.3 D" in warning


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("5", "takes 2 numbers"),
        ("0,2", "the normal force must be above 0"),
        ("5,-1", "the tangential force 0 or more"),
        ("5,a", "--force-range"),
    ],
)
def test_bad_ranges_are_a_sentence(text, words):
    with pytest.raises(BadInput, match=words):
        force_range.parse(text)


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
