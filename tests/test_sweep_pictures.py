"""What the pictures of a sweep show: which rows, which quantities, which note."""

import numpy as np
import pytest

from fem.accuracy import QUICK
from geometry.design import paper
from studies.inputs.study_input import grid
from studies.mechanics.study_cases import Cases, FemModel, Plan
from studies.output import figures
from studies.sweeps import sweep_pictures


def plan_of(factors, load=None, quantities=("force",)):
    return Plan(paper(), factors, load or {}, "rigid", (FemModel("quick", QUICK),), ("paper",), quantities)


def table_of(plan):
    """A table of all cases with made-up results."""
    batch = Cases(plan).batch(np.arange(plan.count))
    n = len(batch)
    units = {"D": "D_mm", "L": "L_mm", "depth": "depth_mm", "shear": "shear_mm"}
    table = {units[name]: values for name, values in batch.axes.items()}
    for name in ("force_N", "force_x_N", "shift_z_mm", "tilt_rad"):
        table |= {f"fem_{name}": np.arange(1.0, n + 1), f"analytic_{name}": np.arange(2.0, n + 2)}
        error = name.removesuffix("_N").removesuffix("_mm").removesuffix("_rad").removesuffix("_z")
        table[f"{error}_error_percent"] = np.linspace(-20, 20, n)
    full = np.full(n, None, dtype=object)
    return table | {"status": np.full(n, "ok", dtype=object), "message": full}


@pytest.fixture
def drawn(monkeypatch):
    """Figures and notes of each picture by its name."""
    calls = {}
    monkeypatch.setattr(figures, "save", lambda path, drawn, notes: calls.update({path.name: (drawn, notes)}))
    return calls


def collected(plan):
    pictures = sweep_pictures.Collected(plan)
    table = table_of(plan)
    # in two batches, the second one short
    cut = plan.count - 1
    for rows in (slice(0, cut), slice(cut, None)):
        pictures.add({name: values[rows] for name, values in table.items()}, np.arange(plan.count)[rows])
    return pictures


def test_all_rows_are_drawn(drawn, tmp_path):
    collected(plan_of(grid({"D": [6.0, 8.0], "depth": [0.5, 1.0, 1.5]}))).draw(tmp_path / "sweep.png")
    (force, error), notes = drawn["sweep.png"]
    own = force.data[force.data["model"] == "finite elements"]
    assert sorted(own["press force (N)"]) == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert set(force.data["model"]) == {"finite elements", "the paper's formula"}
    assert error.title == "Error of the press force, the paper's formula"
    assert notes == []


def test_a_shear_shows_the_shear_force(drawn, tmp_path):
    collected(plan_of(grid({"shear": [0.5, 1.0]}), {"depth": 1.0})).draw(tmp_path / "sweep.png")
    (force, _), _ = drawn["sweep.png"]
    assert force.title == "Force along the shear over shear"


def test_a_huge_study_is_thinned_with_a_note(drawn, monkeypatch, tmp_path):
    monkeypatch.setattr(sweep_pictures, "MOST_DRAWN", 12)
    axes = {"D": [6.0, 8.0], "depth": [0.1 * k for k in range(1, 12)]}
    collected(plan_of(grid(axes))).draw(tmp_path / "sweep.png")
    (force, *_), notes = drawn["sweep.png"]
    # both ends stay
    depths = sorted(set(force.data["depth (mm)"]))
    assert depths == pytest.approx([0.1, 0.3, 0.5, 0.7, 0.9, 1.1])
    assert notes == ["Of 11 values of depth, 6 are drawn; the table has all."]


def test_the_pictures_are_written_and_those_of_an_earlier_sweep_do_not_stay(tmp_path):
    (tmp_path / "sweep-2.png").touch()
    files = collected(plan_of(grid({"D": [6.0, 8.0], "depth": [0.5, 1.0]}))).draw(tmp_path / "sweep.png")
    assert files == [tmp_path / "sweep.png"]
    assert files[0].stat().st_size > 10_000
    assert list(tmp_path.glob("*.png")) == files


def test_a_large_study_shows_one_modulus_and_one_layout(drawn, monkeypatch, tmp_path):
    """Forces are proportional to E, and do not depend on f."""
    monkeypatch.setattr(sweep_pictures, "LARGE", 20)
    plan = plan_of(grid({"E": [0.5, 1.0, 2.0], "f": [5.0, 6.0], "D": [7.0, 8.0], "depth": [0.5, 1.0]}))
    pictures = sweep_pictures.Collected(plan)
    batch = Cases(plan).batch(np.arange(plan.count))
    axes = {f"{name}_{'MPa' if name == 'E' else 'mm'}": values for name, values in batch.axes.items()}
    forces = dict.fromkeys(("fem_force_N", "analytic_force_N", "force_error_percent"), batch.E)
    texts = {name: np.full(plan.count, "ok", dtype=object) for name in ("status", "message")}
    pictures.add(axes | forces | texts, np.arange(plan.count))
    pictures.draw(tmp_path / "sweep.png")
    (force, *_), notes = drawn["sweep.png"]
    assert len(force.data) == 2 * 4
    # the modulus that is nearest to that of the base design
    assert set(force.data["press force (N)"]) == {1.0}
    assert notes == [
        "Forces are proportional to E: drawn for E = 1 MPa.",
        "f has no effect on what is shown.",
    ]
