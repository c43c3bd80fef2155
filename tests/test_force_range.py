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


def test_full_load_and_rest_are_those_of_single_loads(coder):
    answer, grid = evaluated(coder), force_range.loads(coder, 4.0, 1.0)
    full = (grid.force[2] == 4) & np.isclose(np.hypot(*grid.force[:2]), 1)
    assert full.sum() == 4
    assert answer["full_load_N"] == grid.poses.axis_noise_N[:, full].max(axis=1).tolist()
    assert_allclose(answer["full_load_N_per_N"], np.array(answer["full_load_N"]) / 17**0.5)
    assert_allclose(answer["rest_N"], grid.poses.axis_noise_N[:, 0])


def test_axes_x_and_y_are_alike_in_the_papers_layout(coder):
    x, y, _ = evaluated(coder)["worst_N"]
    assert_allclose(x, y, rtol=1e-6)


def test_averaging_divides_the_resolution():
    one, many = (evaluated(coder_of(Design(hall_noise=1e-3, hall_average=n))) for n in (1, 16))
    assert_allclose(many["worst_N"], np.array(one["worst_N"]) / 4, rtol=1e-9)
    assert many["message"] != one["message"]


def test_a_reversed_magnet_has_the_same_resolution(coder):
    assert_allclose(
        evaluated(coder_of(Design(hall_noise=1e-3, magnet_north="up")))["worst_N"], evaluated(coder)["worst_N"]
    )


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


def test_a_range_without_tangential_forces_has_one_direction(coder):
    answer = evaluated(coder, 4.0, 0.0)
    assert answer["loads"] == 4
    assert answer["worst_N_per_N"][:2] == [None, None]
    assert answer["worst_N"][2] > 0


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
        ("inf,1", "--force-range"),
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


def test_a_level_that_underestimates_the_force_is_a_warning(run):
    status, _, err = run("layout", "paper", "--force-range", "4,1")
    assert status == 0
    assert "add --level finite" in err


def test_states_give_the_range_too(run, strict, tmp_path):
    states = [
        run("analytic", "paper", "--level", "finite", "--depth", depth, "--shear", shear, "--json")[1]
        for depth in (0.3, 0.6, 0.9, 1.2)
        for shear in (0.0, 0.5, 1.0)
    ]
    (tmp_path / "states.jsonl").write_text("".join(states), encoding="utf-8")
    (record,) = strict(run("layout", "paper", "--responses", "states.jsonl", "--force-range", "3,0.3", "--json")[1])
    (formula,) = strict(run("layout", "paper", "--level", "finite", "--force-range", "3,0.3", "--json")[1])
    assert_allclose(record["force_range"]["median_N"], formula["force_range"]["median_N"], rtol=0.05)
    assert record["force_range"]["warnings"] == []
    (far,) = strict(run("layout", "paper", "--responses", "states.jsonl", "--force-range", "3,3", "--json")[1])
    (warning,) = far["force_range"]["warnings"]
    assert warning.endswith("of the loads lie beyond the states: solve deeper or farther sideways")
