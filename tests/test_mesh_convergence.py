"""The verb converge: orders and limits of known sequences, a sheared press from end to end, and bad input."""

import csv
import math

import pytest

from fem.accuracy import FINE, QUICK
from geometry.design import paper
from geometry.loads import Load
from studies.output import figures
from studies.simulation import mesh_convergence


@pytest.mark.parametrize(("power", "counted"), [(1.0, 1.0), (1.7, 1.7), (3.0, 2.0)])
def test_a_sequence_of_known_order_has_its_limit_within_the_bar(power, counted):
    values = [2.0 + 0.1 * 1.5 ** (-power * k) for k in range(5)]
    row = mesh_convergence._order("force_z_N", values, 1.5, [{"mesh": "quick", "force_z_N": 2.2}])
    assert row["order"] == pytest.approx(power)
    assert row["limit"] == pytest.approx(2.0)
    assert row["bar"] == pytest.approx(1.25 * (values[3] - values[4]) / (1.5**counted - 1))
    assert abs(values[4] - 2.0) < row["bar"]
    assert row["quick_percent"] == pytest.approx(10.0)


@pytest.mark.parametrize("last", [(1.0, 1.1, 1.05), (1.0, 1.1, 1.3), (1.0, 1.0, 1.0), (1.0, 1.1, math.nan)])
def test_meshes_that_do_not_settle_have_no_limit(last):
    row = mesh_convergence._order("force_z_N", [3.0, *last], 2.0, [{"mesh": "fine", "force_z_N": 1.2}])
    assert all(math.isnan(row[name]) for name in ("order", "limit", "bar", "bar_percent"))
    assert row["differences_from"] == "finest mesh"
    assert row["message"]
    if math.isfinite(last[-1]):
        assert row["scatter_percent"] == pytest.approx(100 * (max(last) - min(last)) / last[-1])


def test_all_edge_lengths_have_one_ratio_from_those_of_quick_on():
    meshes = mesh_convergence.sequence(4, 1.3)
    assert list(meshes) == ["quick", "standard", "fine", "1", "2", "3", "4"]
    for size in mesh_convergence.SIZES:
        lengths = [getattr(meshes[str(k)], size) for k in range(1, 5)]
        assert lengths == pytest.approx([getattr(QUICK, size) / 1.3**k for k in range(4)])
    assert {meshes[str(k)].harmonics for k in range(1, 5)} == {FINE.harmonics}


def test_a_sheared_press_from_end_to_end(run, strict, tmp_path):
    words = ("--depth", 0.5, "--shear", 0.3, "--levels", 4, "--ratio", 1.2, "--magnet", "ignored")
    status, out, _ = run("converge", "paper", *words, "--out", tmp_path / "out", "--json")
    (record,) = strict(out)
    assert (status, record["status"], record["shear_mm"]) == (0, "ok", 0.3)
    meshes = {row["mesh"]: row for row in record["meshes"]}
    assert meshes["4"]["unknowns"] > meshes["1"]["unknowns"]
    assert all(row["cpu_s"] > 0 for row in meshes.values())
    found = {row["quantity"]: row for row in record["convergence"]}
    assert list(found) == [
        "force_x_N", "force_z_N", "shift_x_mm", "shift_z_mm", "tilt_rad", "contact_radius_mm", "energy_mJ"
    ]  # fmt: skip
    for name, row in found.items():
        assert row["finest"] == meshes["4"][name]
        assert (row["limit"] is None) == (row["bar"] is None) == (row["differences_from"] == "finest mesh")
        assert abs(row["standard_percent"]) < 3
    assert {file.name for file in (tmp_path / "out").iterdir()} >= set(mesh_convergence.FILES)
    with (tmp_path / "out" / "converge.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["mesh"] for row in rows] == list(meshes)
    (figure,) = mesh_convergence.figures(figures.table_of(rows))
    assert figure.data["panel"].nunique() == len(found)


def test_a_mesh_without_an_answer_is_a_row_and_no_number():
    solved = [{"mesh": str(k), "force_z_N": 1 + 0.5**k, "status": "ok", "message": ""} for k in range(1, 4)]
    lost = {"mesh": "4", "section_size_over_D": 0.02, "status": "failed", "message": "it folds"}
    result = mesh_convergence._result([*solved, lost], paper(), Load(depth=1.0), 2.0)
    (order,) = result.records[0]["convergence"]
    assert (result.failures, result.records[0]["status"]) == (["it folds"], "failed")
    assert math.isnan(order["limit"])
    assert math.isnan(order["finest"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--depth 1 --levels 3", "--levels must be a whole number between 4 and 8; got 3"),
        ("--depth 1 --ratio 1", "--ratio must lie between 1.2 and 4; got 1"),
        ("--depth 1 --ratio nan", "--ratio must lie between 1.2 and 4; got nan"),
        ("--depth 1 --levels 8 --ratio 2", "take fewer --levels or a smaller --ratio"),
        ("--force 1", "converge solves for a depth"),
        ("--depth 7.5", "depth must be less than 7 mm"),
    ],
)
def test_bad_requests_are_a_sentence(words, said, refusal):
    assert said in refusal("converge", "paper", *words.split())
