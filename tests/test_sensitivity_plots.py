"""Pictures of a sensitivity study: their texts are whole and apart."""

import csv
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from studies.sensitivity import sensitivity_plots
from tests.picture_texts import check_texts, legend, saved_figures

RESULTS = Path(__file__).parents[1] / "results" / "sensitivity"


def rows(name):
    """The rows of a table of results, numbers as numbers."""
    texts = ("method", "output", "input", "unit", "effect_unit", "model")
    with open(RESULTS / name, newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            yield SimpleNamespace(**{k: v if k in texts else float(v) if v else None for k, v in row.items()})


@pytest.mark.parametrize("method", ["sobol", "morris"])
def test_texts_of_nine_outputs_and_six_inputs_are_apart(method, monkeypatch, tmp_path):
    figures = saved_figures(monkeypatch)
    getattr(sensitivity_plots, method)(tmp_path / f"{method}.png", list(rows(f"{method}.csv")))
    check_texts(figures[0])
    names = legend(figures[0])
    assert names == (
        ["first order", "total order"] if method == "sobol"
        else ["E", "magnet height", "nu", "remanence", "l0", "L"]
    )  # fmt: skip


def test_texts_of_histograms_are_apart(monkeypatch, tmp_path):
    figures = saved_figures(monkeypatch)
    values = 0.012 + 1e-3 * np.random.default_rng(1).standard_normal(200)
    made = {"sensitivity": values, "zeroed_force_error": values**2, "recalibrated_force_error": 100 * values}
    axis = SimpleNamespace(made=made, nominal={"sensitivity": 0.012})
    sensitivity_plots.monte_carlo(tmp_path / "montecarlo.png", {"z": axis, "x": axis}, "V/N")
    check_texts(figures[0])
    assert legend(figures[0]) == ["nominal design"]
