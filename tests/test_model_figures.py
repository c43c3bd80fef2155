from pathlib import Path

import numpy as np
import pytest

from studies.report import folder_contents, model_figures

DEMO = Path(__file__).resolve().parent.parent / "results" / "demo"


@pytest.fixture(scope="module")
def press():
    return folder_contents.csv_table(DEMO / "press.csv")


def test_press_force_has_the_numbers_of_all_models(press):
    force = model_figures.press(press)[0]
    assert [one.name.split(",")[0] for one in force.panels[0].series] == [
        "finite elements",
        "finite elements",
        "the paper's formulas",
    ]
    np.testing.assert_allclose(force.panels[0].series[0].y, press.floats("fem_force_N"), rtol=1e-5)
    assert "27.2 N" in force.caption
    assert "-42 %" in force.caption
    assert force.replaces == ("press.png",)


def test_errors_have_lines_at_the_bounds(press):
    errors = model_figures.press(press)[1]
    assert {guide.at for guide in errors.guides} == {0, 5, -5, 10, -10}
    assert "0 of 12 states within 5 %, largest error -64 %" in errors.caption


def test_shear_has_readings_of_all_elements():
    figures = model_figures.shear(folder_contents.csv_table(DEMO / "shear.csv"))
    assert [panel.title for panel in figures[-1].panels] == ["S1", "S2", "S3"]
    assert len(figures) == 5
    assert "depth of 1 mm" in figures[0].title


def test_states_are_grouped_by_depth(tmp_path):
    lines = [
        f'{{"depth_mm": {d}, "shear_mm": {s}, "status": "ok", "force_N": [{s}, 0, {d}], "shift_mm": [0, 0, 0]}}'
        for d in (1, 2)
        for s in (0, 1, 2)
    ]
    (tmp_path / "states.jsonl").write_text("\n".join(lines))
    force, _ = model_figures.states(folder_contents.states_table(tmp_path / "states.jsonl"))
    assert [one.name for one in force.panels[0].series] == ["depth 1 mm", "depth 2 mm"]
    assert force.panels[0].series[0].y == (0, 1, 2)
