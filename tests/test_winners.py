"""Winners of `magtip size` on benches: from the design file to decoded newtons, and what the study counts."""

from pathlib import Path

import numpy as np
import pytest

from analytic.hall import field_at
from fem.accuracy import QUICK
from geometry.design import paper
from studies.simulation import mechanics_sources
from studies.validation.devices import winners

ROOT = Path(__file__).resolve().parent.parent


def test_a_sized_sensor_is_calibrated_within_its_promise(monkeypatch):
    """Its modulus is 8 % above the nominal one, its readings have steps and come from another code.

    It is short and wide: with the mechanics of the surrogate, its forces at rest and under light presses are 4 % of
    the largest one too high. Its own are those of few states on the meshes of the bench.
    """
    monkeypatch.setattr(mechanics_sources, "ACCURACY", QUICK)
    monkeypatch.setattr(mechanics_sources, "DEPTHS", np.linspace(0.06, 1.0, 5))
    monkeypatch.setattr(mechanics_sources, "SHEARS", (0.0, 0.5, 1.0))
    monkeypatch.setattr(winners, "TURNS", winners.TURNS[:2])
    row = winners.judged("foot", 12)
    assert row["refused"] == ""
    assert row["E_over_nominal"] > 1.05
    assert row["largest_percent"] < row["promised_percent"] < 5.0
    assert min(row[f"inside_{axis}_percent"] for axis in "xyz") >= 70.0  # of the rows of one sensor
    assert (row["rows"], row["lost"]) == (14, 0)
    assert row["regression_over_held_out"] > 1.5


def test_a_refusal_and_a_broken_promise_fail_the_study():
    good = {
        "winner": "a", "sensor": 0, "refused": "", "largest_percent": 1.0, "promised_percent": 2.0,
        **{f"inside_{axis}_percent": 90.0 for axis in "xyz"},
    }  # fmt: skip
    assert not winners.result([good], quick=False).failures
    refused = {"winner": "b", "sensor": 0, "refused": "a regression is better", "promised_percent": 2.0}
    assert "refused" in winners.result([good, refused], quick=False).failures[0]
    assert winners.result([good | {"largest_percent": 3.0}], quick=False).failures
    assert winners.result([good | {"inside_y_percent": 30.0}], quick=False).failures


def test_the_field_of_the_benches_is_that_of_magpylib():
    pytest.importorskip("magpylib")
    rng = np.random.default_rng(2)
    points = np.array([0.0, 0.0, paper().H - 7.0]) + rng.uniform(-1, 1, (5, 3))
    shift, turn = rng.uniform(-0.5, 0.5, (5, 3)), rng.uniform(-0.1, 0.1, (5, 2))
    ours, theirs = (code(points, paper(), shift, turn) for code in (field_at, winners.magpylib_field))
    assert theirs == pytest.approx(ours, rel=1e-6, abs=1e-9)
