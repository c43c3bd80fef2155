from pathlib import Path

import numpy as np
import pytest

from studies.report import folder_contents, paper_figures

RESULTS = Path(__file__).resolve().parent.parent / "results"


@pytest.fixture(scope="module")
def sweep():
    return folder_contents.csv_table(RESULTS / "assumption" / "sweep.csv")


def test_maps_hold_the_errors_of_the_table(sweep):
    figures = paper_figures.assumption(sweep)
    assert len(figures) == 10
    force = figures[0]
    assert force.title == "Error of the press force, level paper"
    cells = [value for panel in force.panels for row in panel.cells for value in row if value is not None]
    own = (sweep.floats("nu") == 0.4998) & (sweep.floats("shear_mm") == 0)
    errors = sweep.floats("analytic_paper_force_error_percent")[own]
    # the errors of the map come from forces of six digits
    np.testing.assert_allclose(sorted(cells), sorted(errors[np.isfinite(errors)]), rtol=1e-5, atol=2e-3)


def test_maps_replace_the_pictures_of_the_study(sweep):
    replaced = {name for figure in paper_figures.assumption(sweep) for name in figure.replaces}
    assert {"press_force.png", "tilt.png"} <= replaced


def test_claims_have_presses_for_heights_of_the_magnet():
    (figure,) = paper_figures.presses(folder_contents.csv_table(RESULTS / "claims" / "presses.csv"))
    assert figure.panels[0].series[0].name == "no magnet"
    assert len(figure.panels[0].series) == 6


@pytest.mark.parametrize("name", ["heights", "shears"])
def test_other_tables_of_the_claims_are_drawn(name):
    (figure,) = getattr(paper_figures, name)(folder_contents.csv_table(RESULTS / "claims" / f"{name}.csv"))
    assert not figure.empty


def test_readings_have_a_panel_for_each_element():
    (figure,) = paper_figures.readings(folder_contents.csv_table(RESULTS / "assumption" / "readings.csv"))
    assert [panel.title for panel in figure.panels][:2] == ["S1", "S2"]
