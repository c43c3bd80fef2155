"""The study of the beam assumption on few cases: the verb, its files and its refusals; the shipped study is sound."""

import dataclasses
import math

import numpy as np
import pandas as pd
import pytest

from analytic import beam
from geometry.design import paper
from studies.inputs import study_input
from studies.validation.formulas import assumption
from studies.web import paper_figures

SMALL = assumption.QUICK.read_text("utf-8")


def test_the_verb(run, tmp_path):
    status, out, err = run("validate", "formulas", "assumption", "--quick", "--out", "out", "--workers", "0")
    assert status == 0, err
    assert "formula (5) is within 10 %" in out
    assert {path.name for path in (tmp_path / "out").glob("[!.]*")} == set(assumption.FILES)
    text = (tmp_path / "out" / "ASSUMPTION.md").read_text("utf-8")
    assert "No magnet, press force: formula (5) is within 10 % for L/D 1.12 to 2, d/D 0.3" in text
    assert "Made with `magtip validate formulas assumption --quick" in text
    assert all(f"]({name})" in text for name in assumption.FILES if name.endswith(".png"))


def test_sizes_of_the_magnet_may_be_fixed_and_the_page_names_the_design(tmp_path):
    changes = {'design = "paper"\n': "", "magnet_diameter = [0, 4]\n": "", "magnet_edge_radius = [0, 0.1]\n": ""}
    changes |= {"[0, 2]": "[1, 2]", "[9, 16]": "[10]", "[0.16, 2.4, 0.64]": "[0.16]", "[0, 0, 0.4]": "[0]"}
    text = SMALL + "[design]\nD = 10\nE = 0.6\nmagnet_diameter = 5\n"
    for old, new in changes.items():
        text = text.replace(old, new)
    (tmp_path / "own.toml").write_text(text)
    found = assumption.run(lambda share, text: None, study=tmp_path / "own.toml", store=tmp_path / "s")
    assert "D is 10 mm and E is 0.6 MPa" in found.pages["ASSUMPTION.md"]


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("L = [9, 16]", "L = [9, 16]\nE = [1, 2]", "has the axis E"),
        ("magnet_height = [0, 2]", "magnet_height = [2, 2]", "12 cases of 6 different"),
        ('"finite"', '"standard"', "one finite-element model and all levels"),
        ("nu = [0.4998, 0.4998]", "", "lacks the axis nu"),
        ('"tilt"', '"readings"', "quantities force, shift and tilt"),
    ],
)
def test_studies_that_lack_something_are_refused(refusal, tmp_path, old, new, reason):
    (tmp_path / "small.toml").write_text(SMALL.replace(old, new))
    assert reason in refusal("validate", "formulas", "assumption", "--study", "small.toml")


def test_the_shipped_study_covers_the_range():
    axes = study_input.read_study(str(assumption.STUDY)).axes
    plan = assumption.plan_of(assumption.STUDY)
    assert (min(axes["L"]) / 8, max(axes["L"]) / 8) == (0.6, 6)
    assert len(axes["L"]) >= 8
    assert min(axes["magnet_height"]) == 0
    presses = [depth for depth, shear in zip(axes["depth"], axes["shear"], strict=True) if not shear]
    assert (min(presses) / 8, max(presses) / 8) == pytest.approx((0.02, 0.35))
    assert len(set(axes["nu"])) >= 3
    assert plan.count == math.prod(len(axes[name]) for name in ("L", "nu", "depth"))


# Cells of the study of the beam assumption, and regions and sentences from them, on errors that are known


approx = pytest.approx
LENGTHS, DEPTHS, D = (0.6, 2.0, 4.0), (0.05, 0.1, 0.3), 8.0


def table(error, heights=(0.0,), shear=0.0, **columns):
    """A sweep in which level paper has the given errors, (depths, lengths), %, and the others ten times as much."""
    cases = [(h, i, j) for h in heights for i in range(len(DEPTHS)) for j in range(len(LENGTHS))]
    n = len(cases)
    off = np.array([error[i][j] for _, i, j in cases], dtype=float)
    values = {
        "D_mm": np.full(n, D),
        "L_mm": np.array([LENGTHS[j] * D for *_, j in cases]),
        "magnet_height_mm": np.array([h * D for h, *_ in cases]),
        "nu": np.full(n, 0.4998),
        "depth_mm": np.array([DEPTHS[i] * D for _, i, _ in cases]),
        "shear_mm": np.full(n, shear * D),
        "status": np.full(n, "ok", dtype=object),
    }
    for column in ("force_N", "shift_z_mm", "force_x_N", "shift_x_mm", "tilt_rad"):
        values[f"fem_{column}"] = np.full(n, 2.0)
        for level in beam.LEVELS:
            factor = 1 if level == "paper" else 10
            values[f"analytic_{level}_{column}"] = 2.0 * (1 + factor * off / 100)
    return pd.DataFrame(values | columns)


ERROR = [[-60.0, -80.0, -90.0], [-20.0, 4.0, 8.0], [12.0, -3.0, 9.0]]


def errors(values, quantity="press force", level="paper"):
    """The errors of a level, (depths, lengths)."""
    return paper_figures.errors(paper_figures.cells(values), quantity)[level].to_numpy().reshape(3, 3)


def test_errors_stand_at_their_length_and_load_and_cells_without_an_answer_have_none():
    mixed = table(ERROR).sample(frac=1.0, random_state=0)
    cells = paper_figures.cells(mixed)
    assert cells.slenderness.tolist() == list(LENGTHS) * 3
    assert cells.depth.unique().tolist() == list(DEPTHS)
    assert errors(mixed) == approx(np.array(ERROR))
    values = table(ERROR)
    values.loc[[4, 0], "fem_force_N"] = np.nan
    values.loc[[4, 0], "status"] = "not_converged", "bad_input"
    cells = paper_figures.cells(values)
    assert np.flatnonzero(~cells.answered).tolist() == [0, 4]
    assert np.flatnonzero(~cells.possible).tolist() == [0]
    assert np.isnan(errors(values)[1, 1])


def test_a_beam_that_does_not_resist_the_shear_is_not_judged():
    values = table(ERROR, shear=0.1)
    values.loc[8, "fem_force_x_N"] = -0.5
    assert np.flatnonzero(paper_figures.cells(values).gave_way).tolist() == [8]
    assert np.argwhere(np.isnan(errors(values, "shear force"))).tolist() == [[2, 2]]


# Regions


def test_shares_and_blocks_of_a_level_and_presses_that_a_free_tip_would_not_reach():
    """Four cells are within 10 %; the deepest row, which has two of them, lies beyond the critical depth."""
    cells = paper_figures.cells(table(ERROR, critical_depth_mm=[0.2 * D] * 9))
    assert np.flatnonzero(cells.leans).tolist() == [6, 7, 8]
    rows = assumption.share_rows(cells)
    row = next(row for row in rows if (row["quantity"], row["level"]) == ("press force", "paper"))
    shares = (row["within_5_percent"], row["within_10_percent"])
    assert (row["cells"], *shares) == (9, approx(100 * 2 / 9), approx(100 * 4 / 9))
    assert row["within_10_block"] == "L/D 2 to 4, d/D 0.1 to 0.3"
    assert row["within_5_block"] == "L/D 2, d/D 0.1 to 0.3"
    assert (row["largest_error_percent"], row["median_error_percent"]) == (approx(-90), approx(12))
    assert row["leaning_of_these_percent"] == approx(50)
    said = assumption.findings(cells, rows, [])
    assert any("But 50 % of the cells within 10 % are presses" in line for line in said)


# Errors of the readings: each part has its own cause, and their sum is the whole


def poses(tilt=0.0, aside=0.5, lower=0.4):
    """Two shears and a press of the paper's sensor: the finite elements' poses, and the formula's at (0.5, -0.4)."""
    moved = np.array([1.0, 2.0, 0.0])
    values = {"D_mm": 8.0, "L_mm": 9.0, "f_mm": 5.0, "l0_mm": 7.2, "magnet_diameter_mm": 4.0, "magnet_height_mm": 2.0}
    values |= {"magnet_edge_radius_mm": 0.1, "nu": 0.4998, "depth_mm": 1.0, "shear_mm": moved, "status": "ok"}
    values |= {"fem_force_N": 1.0, "fem_force_x_N": 1.0, "fem_shift_x_mm": aside * moved, "fem_shift_y_mm": 0.0}
    values |= {"fem_shift_z_mm": -lower, "fem_tilt_rad": tilt * moved, "fem_tilt_y_rad": 0.0}
    values |= {"analytic_paper_shift_x_mm": 0.5 * moved, "analytic_paper_shift_y_mm": 0.0}
    values |= {"analytic_paper_shift_z_mm": -0.4, "analytic_paper_tilt_rad": 0.0, "analytic_paper_tilt_y_rad": 0.0}
    return pd.DataFrame(values)


def split(values, design=paper()):
    return assumption.split_cells(paper_figures.cells(values), design).to_dict("records")


def cells(**pose):
    return split(poses(**pose))


def largest(rows, part):
    return max(abs(row[f"{part}_percent_FS"]) for row in rows)


def test_each_part_has_its_cause_and_they_add_up():
    rows = cells()
    assert len(rows) == 9
    assert largest(rows, "total") == approx(0, abs=1e-6)
    assert largest(rows, "dipole") > 1
    for pose, part, other in (({"tilt": 0.1}, "tilt", "mechanics"), ({"aside": 0.4}, "mechanics", "tilt")):
        rows = cells(**pose)
        assert largest(rows, part) > 1
        assert largest(rows, other) == approx(0, abs=1e-9)
    for row in cells(tilt=0.1, aside=0.4, lower=0.3):
        parts = row["mechanics_percent_FS"] + row["tilt_percent_FS"] + row["field_percent_FS"]
        assert row["total_percent_FS"] == approx(parts)


@pytest.mark.parametrize("column", ["fem_shift_x_mm", "fem_shift_z_mm", "analytic_paper_shift_x_mm", "fem_tilt_rad"])
def test_an_unknown_pose_is_no_motion(column):
    values = poses(aside=0.4)
    values[column] = np.where(values["shear_mm"] == 2.0, np.nan, values[column])
    rows, whole = split(values), cells(aside=0.4)
    for row in rows:
        assert math.isnan(row["total_percent_FS"]) == (row["shear_over_D"] == 0.25)
    assert assumption.split_means(pd.DataFrame(rows), ["load"])[1]["states"] == 1
    assert len(rows) == len(whole)


def test_the_sensor_is_that_of_the_study():
    """Its elements' height, and sizes of the magnet that no axis varies."""
    values = poses().drop(columns=["magnet_diameter_mm", "l0_mm"])
    own = dataclasses.replace(paper(), c=3.0, magnet_diameter=3.0)
    sensor = assumption.sensor(values, own)
    assert (sensor.c, sensor.magnet_diameter, sensor.l0) == (3.0, 3.0, pytest.approx(own.l0))
    by_c = [[row["dipole_percent_FS"] for row in split(values, dataclasses.replace(own, c=c))] for c in (2.0, 3.0)]
    assert by_c[0] != by_c[1]
