"""Table and chart of cost and error."""

import dataclasses
import math

import pytest

from geometry.loads import Load
from studies.validation import trade_report
from studies.validation.trade_reference import TrueError
from studies.validation.trade_rule import Confirmation
from studies.validation.trade_study import TradeState


def state(percent, model, level, *, design=0, outside="", cpu=1.0, bar=0.1):
    errors = {name: TrueError(percent, bar) for name in ("force", "shift")}
    return TradeState(
        design, False, "press", model, level, Load(depth=0.4), "ok", outside, errors, cpu, 30.0, cpu / 0.5
    )


STATES = [
    *(state(p, "axisymmetric", "quick", design=i) for i, p in enumerate((0.2, 0.5, 1.0))),
    *(state(p, "axisymmetric", "standard", design=i, cpu=2.0) for i, p in enumerate((0.1, 0.2, 0.3))),
    *(state(p, "formula", "finite", cpu=1e-3) for p in (2.0, 4.0)),
    state(70.0, "formula", "finite", outside="nu = 0.4 is below 0.49", cpu=1e-3),
    *(state(p, "surrogate", "shipped", cpu=6e-3) for p in (0.4, 0.8)),
    dataclasses.replace(state(0.0, "surrogate", "shipped", cpu=1e-5), status="refused", errors={}),
]


def test_a_cell_holds_median_percentile_and_largest_error():
    cell = next(c for c in trade_report.cells(STATES) if c.name == "axisymmetric quick")
    assert cell.errors["force"] == (0.5, 1.0, 1.0)
    assert (cell.designs, cell.solved, cell.cost) == (3, 3, 2.0)
    assert cell.unclear == pytest.approx(1 / 3)
    assert math.isnan(cell.errors["tilt"][0])


def test_a_formula_counts_inside_its_range_only():
    cell = next(c for c in trade_report.cells(STATES) if c.name == "formula finite")
    assert (cell.solved, cell.states, cell.worst[2]) == (2, 3, 4.0)


def test_the_surrogate_counts_inside_its_range_only_in_errors_and_cost():
    cell = next(c for c in trade_report.cells(STATES) if c.name == "surrogate shipped")
    assert (cell.solved, cell.states, cell.worst[2]) == (2, 3, 0.8)
    assert (cell.cpu_s, cell.cost) == pytest.approx((6e-3, 0.012))


def test_the_report_names_model_errors_confirmation_and_command(tmp_path):
    results = [Confirmation("press", 0, 0.4, 0.0, 0.01, "axisymmetric quick", "exceeded", 0.01, 0.012)]
    trade_report.write(tmp_path, STATES, [], results, "on Python", "magtip validate trade --out out/trade")
    page = (tmp_path / "TRADE.md").read_text("utf-8")
    assert {path.name for path in tmp_path.glob("[!.]*")} == set(trade_report.FILES)
    assert "| axisymmetric | quick | 3 | 3 of 3 | 0.5 / 1 |" in page
    assert "error 1.2 %" in page
    assert page.endswith("Made with `magtip validate trade --out out/trade`, on Python.\n")
