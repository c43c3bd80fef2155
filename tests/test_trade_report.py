"""Table and chart of cost and error."""

import math

import pytest

from studies.output import result
from studies.validation import trade
from studies.validation.trade_study import with_errors


def state(percent, model, level, *, design=0, outside="", cpu=1.0, bar=0.1):
    place = {"design": design, "confirming": False, "kind": "press", "model": model, "level": level}
    place |= {"depth_mm": 0.4, "shear_mm": 0.0, "friction": "none", "status": "ok", "along_N": None}
    paid = {"cpu_s": cpu, "peak_MB": 30.0, "cost": cpu / 0.5, "message": outside, "commit": ""}
    return with_errors(place | paid, dict.fromkeys(("force", "shift"), (percent, bar)))


def cell(model, level):
    return next(c for c in trade.cells(STATES) if (c["model"], c["level"]) == (model, level))


STATES = [
    *(state(p, "axisymmetric", "quick", design=i) for i, p in enumerate((0.2, 0.5, 1.0))),
    *(state(p, "axisymmetric", "standard", design=i, cpu=2.0) for i, p in enumerate((0.1, 0.2, 0.3))),
    *(state(p, "formula", "finite", cpu=1e-3) for p in (2.0, 4.0)),
    state(70.0, "formula", "finite", outside="nu = 0.4 is below 0.49", cpu=1e-3),
    *(state(p, "surrogate", "shipped", cpu=6e-3) for p in (0.4, 0.8)),
    with_errors(state(0.0, "surrogate", "shipped", cpu=1e-5) | {"status": "refused"}, {}),
]


def test_a_cell_holds_median_percentile_and_largest_error():
    found = cell("axisymmetric", "quick")
    names = ("force_median_percent", "force_p95_percent", "largest_percent")
    assert [found[name] for name in names] == [0.5, 1.0, 1.0]
    assert (found["designs"], found["solved"], found["cost"]) == (3, 3, 2.0)
    assert found["unclear_percent"] == pytest.approx(100 / 3)
    assert math.isnan(found["tilt_median_percent"])


def test_a_formula_counts_inside_its_range_only():
    found = cell("formula", "finite")
    assert (found["solved"], found["states"], found["largest_percent"]) == (2, 3, 4.0)


def test_the_surrogate_counts_inside_its_range_only_in_errors_and_cost():
    found = cell("surrogate", "shipped")
    assert (found["solved"], found["states"], found["largest_percent"]) == (2, 3, 0.8)
    assert (found["cpu_s"], found["cost"]) == pytest.approx((6e-3, 0.012))


def test_the_report_names_model_errors_confirmation_and_command(tmp_path):
    case = {"kind": "press", "design": 0, "depth_mm": 0.4, "shear_mm": 0.0, "tolerance": 0.01}
    case |= {"model": "axisymmetric quick", "status": "exceeded", "expected": 0.01, "error": 0.012}
    found = trade.result(STATES, [], [case], ["press"], "")
    result.write(found, tmp_path, "magtip validate trade --out out/trade")
    page = (tmp_path / "TRADE.md").read_text("utf-8")
    assert {path.name for path in tmp_path.glob("[!.]*")} == set(trade.FILES)
    assert "| axisymmetric | quick | 3 | 3 of 3 | 0.5 / 1 |" in page
    assert "error 1.2 %" in page
    assert "Made with `magtip validate trade --out out/trade`, on Python" in page
