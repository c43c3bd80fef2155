"""The study of cost and error: its plan, a reduced run on two designs, and its files."""

import contextlib
import io
import json
import math

import numpy as np
import pandas as pd
import pytest

from analytic import buckling
from fem.physics_version import PHYSICS
from fem.scene import Scene
from studies.cli import entry_point
from studies.mechanics import model_choice
from studies.mechanics.model_choice import Statement
from studies.output import atomic_files, goals, result
from studies.validation.error_study_cases import designs
from studies.validation.errors import trade
from studies.validation.errors.trade import (
    COLUMNS,
    KINDS,
    PLAN,
    READINGS,
    Run,
    extrapolated,
    full_scales,
    trial,
    true_errors,
)

COMMAND = ("validate", "errors", "trade", "--quick", "--json")


def test_every_run_has_a_reference():
    for runs, finenesses in (trade.plan(), trade.plan(confirm=True), trade.plan(2, quick=True)):
        assert {(one.trial.number, one.kind) for one in runs} == set(finenesses)


def test_a_reduced_run_measures_errors_and_costs_and_writes_all_files(tmp_path, monkeypatch):
    """On two designs; the table of an earlier confirmation does not stay."""
    atomic_files.write_text(tmp_path / "confirm.csv", "kind")
    monkeypatch.setattr(trade, "REPEATS", dict.fromkeys(trade.REPEATS, 1))
    for own in map(PLAN.get, trade.QUICK_KINDS):
        size, patch, *others = own["steps"][0]
        # references coarser by one more step
        monkeypatch.setitem(own, "steps", [[1.4 * size, 1.4 * patch, *others], *own["steps"]])
    solve_apart, solved = trade.speed.magtip, []

    def once(task):
        """A process of its own for the first path; the others cost as much."""
        solved.append(solved[0] if solved else solve_apart(task))
        return solved[-1]

    monkeypatch.setattr(trade.speed, "magtip", once)
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert entry_point.main([*COMMAND, "--out", str(tmp_path)]) == 0
    rows = [json.loads(line) for line in out.getvalue().splitlines()]
    cell = next(row for row in rows if (row["kind"], row["model"]) == ("press", "axisymmetric"))
    assert 0 < cell["force_p95_percent"] < 3
    assert 0 < cell["cpu_s"] < 60
    assert 1 < cell["peak_MB"] < 2000
    calculated = [row for row in rows if row["model"] in trade.CALCULATED]
    assert all(0 < row["cpu_s"] < 1 and row["peak_MB"] == 0 for row in calculated)
    assert {path.name for path in tmp_path.glob("[!.]*")} == set(trade.FILES) - {"confirm.csv"}
    table = pd.read_csv(tmp_path / "trade.csv")
    assert set(table.model) == {"formula", "surrogate", "axisymmetric", "harmonic"}


# Designs, loads, models and references of the study of cost and error


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("confirm", [True, False])
def test_every_model_can_carry_the_loads_of_its_kind(kind, confirm):
    for number in range(trade.CONFIRMED if confirm else trade.STUDIED):
        for model in PLAN[kind]["models"]:
            one = trial(number, kind, model, confirm=confirm)
            assert Scene(one.design, one.loads, magnet=one.magnet, model=model).model == model


# References by extrapolation, and the true errors against them


def table(values, bars=(), scales=(math.nan,) * 3):
    """One state with some of COLUMNS, and as a reference their error bars and the full scales of the elements."""
    scaled = {f"{name}_scale": scale for name, scale in zip(READINGS, scales, strict=True)}
    row = dict.fromkeys(COLUMNS, math.nan) | values | {f"{name}_bar": dict(bars).get(name, 0.0) for name in COLUMNS}
    return pd.DataFrame([row | scaled])


def errors(answer, reference):
    """Error and bar of each quantity that has one."""
    (found,) = true_errors(table(answer), reference, np.zeros(1)).to_dict("records")
    pairs = {name: (found[f"{name}_error_percent"], found[f"{name}_bar_percent"]) for name in trade.QUANTITIES}
    return {name: pair for name, pair in pairs.items() if not math.isnan(pair[0])}


def with_errors(state, errors):
    unknown = {f"{name}_{kind}_percent": math.nan for name in trade.QUANTITIES for kind in ("error", "bar")}
    for name, (error, bar) in errors.items():
        unknown |= {f"{name}_error_percent": error, f"{name}_bar_percent": bar}
    return state | unknown


def statements(states):
    return trade.statements(pd.DataFrame(states))


def confirm(states, rule):
    return list(trade.confirmed(pd.DataFrame(states), rule))


def meshes(**values):
    """The reference of a press from answers of three meshes, of which these columns are known."""
    place = {"design": 0, "kind": "press", "depth_mm": 1.0, "shear_mm": 0.0, "status": "ok"}
    rows = pd.DataFrame({"size": (0.04, 0.02, 0.01)} | values).assign(**place)
    return extrapolated(rows.reindex(columns=[*rows, *(name for name in COLUMNS if name not in values)])).iloc[0]


def test_a_known_limit_and_order_are_recovered_and_without_steady_convergence_the_spread_is_the_bar():
    reference = meshes(force_N=[2.0 + 3.0 * h**2 for h in (0.04, 0.02, 0.01)], force_y_N=0.0)
    assert (reference.force_N, reference.force_N_bar) == pytest.approx((2.0, 3e-4))
    assert (reference.force_y_N, reference.force_y_N_bar) == (0.0, 0.0)
    assert math.isnan(reference.tilt_rad)
    for values in ((1.0, 1.2, 1.1), (1.0, 1.1, 1.25), (1.0, 1.1, 1.19)):
        reference = meshes(force_N=values)
        assert (reference.force_N, reference.force_N_bar) == (values[-1], pytest.approx(max(values) - min(values)))


def test_readings_are_relative_to_full_scale():
    true, answer = (dict(zip(READINGS, values, strict=True)) for values in ((1e-3, 2e-3, 2e-3), (1.1e-3, 2e-3, 2e-3)))
    assert errors(answer, table(true, scales=(1e-3, 2e-3, 2e-3)))["readings"][0] == pytest.approx(10.0)
    assert "readings" not in errors(answer, table(true))


# Table and chart of cost and error


def state(percent, model="axisymmetric", level="quick", **changes):
    """A light press of a chosen design, or of a random one, with equal errors of force and shift, percent."""
    place = {"design": 0, "confirming": False, "kind": "press", "model": model, "level": level, "shear_mm": 0.0}
    place |= {"friction": "none", "status": "ok", "message": "", "along_N": math.nan, "bar": 0.0}
    place |= {"cpu_s": 1.0, "peak_MB": 30.0, "cost": 0.5} | changes
    errors = dict.fromkeys(("force", "shift"), (percent, place.pop("bar")))
    depth = trade.trial(place["design"], place["kind"], "auto", confirm=place["confirming"]).loads[0].depth
    return with_errors({"depth_mm": depth} | place, place.pop("errors", errors))


def cell(model, level):
    return next(c for c in trade.cells(pd.DataFrame(STATES)) if (c["model"], c["level"]) == (model, level))


STATES = [
    *(state(p, design=i, bar=0.1) for i, p in enumerate((0.2, 0.5, 1.0))),
    *(state(p, level="standard", design=i, bar=0.1) for i, p in enumerate((0.1, 0.2, 0.3))),
    *(state(p, "formula", "finite") for p in (2.0, 4.0)),
    state(70.0, "formula", "finite", message="nu = 0.4 is below 0.49"),
    *(state(p, "surrogate", "shipped", cpu_s=6e-3, cost=0.012) for p in (0.4, 0.8)),
    state(0.0, "surrogate", "shipped", cpu_s=1e-5, cost=2e-5, status="refused", errors={}),
]


def test_a_cell_holds_median_percentile_and_largest_error_of_what_counts():
    """Formulas and the surrogate count inside their ranges only."""
    found = cell("axisymmetric", "quick")
    names = ("force_median_percent", "force_p95_percent", "largest_percent")
    assert [found[name] for name in names] == [0.5, 1.0, 1.0]
    assert (found["designs"], found["solved"], found["cost"]) == (3, 3, 0.5)
    assert found["unclear_percent"] == pytest.approx(100 / 3)
    assert math.isnan(found["tilt_median_percent"])
    found = cell("formula", "finite")
    assert (found["solved"], found["states"], found["largest_percent"]) == (2, 3, 4.0)
    found = cell("surrogate", "shipped")
    assert (found["solved"], found["states"], found["largest_percent"]) == (2, 3, 0.8)
    assert (found["cpu_s"], found["cost"]) == pytest.approx((6e-3, 0.012))


def test_the_report_names_model_errors_confirmation_and_command(tmp_path):
    case = {"kind": "press", "design": 0, "depth_mm": 0.4, "shear_mm": 0.0, "tolerance": 0.01}
    case |= {"model": "axisymmetric quick", "status": "exceeded", "expected": 0.01, "error": 0.012}
    found = trade.result(pd.DataFrame(STATES), [], [case], ["press"], "")
    result.write(found, tmp_path, "magtip validate errors trade --out out/trade")
    page = (tmp_path / "TRADE.md").read_text("utf-8")
    assert {path.name for path in tmp_path.glob("[!.]*")} == set(trade.FILES)
    assert "| axisymmetric | quick | 3 | 3 of 3 | 0.5 / 1 |" in page
    assert "error 1.2 %" in page
    assert "Made with `magtip validate errors trade --out out/trade`, on Python" in page


# The rule that follows from measured errors, and its confirmation


def levels(quick, standard):
    """States of two levels on ten designs, with constant errors; bounds are 1.1 times these."""
    names = (("quick", quick, 0.5), ("standard", standard, 1.0))
    pressed = (0, 2, 3, 5, 6, 7, 9, 10, 11, 13)
    return [state(p, level=name, cost=c, design=number) for name, p, c in names for number in pressed]


@pytest.mark.parametrize(
    ("states", "bound"),
    [
        ([state(float(p)) for p in range(1, 101)], 2 * 1.0),
        ([state(p) for p in [1.0] * 99 + [13.0]], 2 * 0.13),
        ([state(1.0, design=number) for number in (0, 3, 5, 10)], 1.25 * 0.01),
        ([state(0.1, bar=0.5)] * 20, 2 * 0.005),
        ([state(1.0, "half", design=number) for number in (0, 1)], 1.5 * 0.01),
    ],
    ids=["largest", "one large", "more designs", "bar of the reference", "tetrahedra"],
)
def test_a_bound_follows_from_the_largest_error(states, bound):
    (one,) = statements(states)
    assert one.force == pytest.approx(bound, rel=0.01)
    assert (one.region == "any") == (one.model == "half")


def test_a_formula_or_the_surrogate_has_no_bound_on_too_few_designs_else_one_for_each_region_that_is_read_back():
    for model, level in (("formula", "finite"), ("surrogate", "shipped")):
        assert statements([state(1.0, model=model, level=level, design=i) for i in (0, 3, 5)]) == []
    rule = statements([state(1.0, model="surrogate", level="shipped", design=i) for i in (0, 3, 9, 10)])
    assert [(one.model, one.level, one.region) for one in rule] == [("surrogate", "shipped", "depth to 0.06 D")]
    read = json.loads(trade.as_text(rule, "by hand"))
    assert [Statement(**each) for each in read["statements"]] == rule
    assert (read["made"], read["versions"]) == ("by hand", model_choice.versions())
    assert read["versions"]["harmonic"] == str(PHYSICS["harmonic"])


def test_the_rule_chooses_the_cheapest_level_that_meets_each_tolerance():
    rule = statements(levels(1.5, 0.4))
    results = confirm([state(1.4, confirming=True), state(0.3, level="standard", confirming=True)], rule)
    chosen = [each["model"].split()[-1] for each in results]
    assert chosen == ["standard", "standard", "quick", "quick", "quick", "quick"]
    assert {each["status"] for each in results} == {"within"}


def missed(results):
    """The missed goals of presses."""
    return [str(goal) for goal in goals.missed(trade.goals(results, ["press"]))]


def test_errors_beyond_the_tolerance_miss_both_goals():
    results = confirm([state(9.0, confirming=True)], statements(levels(1.5, 3.0)))
    assert "press, tolerance 2 %, cases within it: 0 %, goal at least 95 %" in missed(results)
    assert "press, tolerance 2 %, largest error over it: 4.5, goal at most 1.5" in missed(results)


def test_a_confirmation_without_a_judged_case_misses_its_goals():
    lost = {"kind": "press", "design": 60, "depth_mm": 0.4, "shear_mm": 0.0, "tolerance": 0.01}
    lost |= {"model": "axisymmetric quick", "status": "no_reference", "expected": 0.01, "error": None}
    for results in ([], [lost]):
        assert "press, cases within the tolerance: no data, goal at least 95 %" in missed(results)
    assert "press, cases without a judgement: 1, goal at most 0" in missed([lost])
    met = [lost | {"status": "within", "error": 0.005, "design": d} for d in (0, 60)]
    assert missed(met) == []
    # a kind that no case confirms is no success
    assert goals.missed(trade.goals(met))


def sheared(along, sideways, along_N, *, level="quick", confirming=True):
    """A glued shear with an error of the force along it, over the unpressed beam's and over itself, percent."""
    load = trade.trial(0, "glued shear", "auto", confirm=confirming).loads[0]
    errors = dict.fromkeys(("force", "shift", "tilt"), (0.1, 0.0))
    errors |= {"along": (along, 0.0), "sideways": (sideways, 0.0)}
    place = {"kind": "glued shear", "confirming": confirming, "along_N": along_N, "shear_mm": load.shear_x}
    cost = {"quick": 0.5, "standard": 1.0, "fine": 5.0}[level]
    return state(0.0, "harmonic", level, friction="stick", cost=cost, errors=errors, **place)


def sheared_rule():
    """Bounds 0.8, 0.4 and 0.2 % of the force along the shear, over that of the unpressed beam."""
    errors = {"quick": 0.4, "standard": 0.2, "fine": 0.1}
    return statements([sheared(e, e, 1.0, level=level, confirming=False) for level, e in errors.items()])


@pytest.mark.parametrize(
    ("share", "model", "status"),
    [
        (1.0, "harmonic quick", "within"),
        (0.6, "harmonic standard", "within"),
        (0.1, "", "refused"),
        (0.0, "", "refused"),
    ],
)
def test_a_force_along_a_shear_that_nearly_vanishes_asks_for_a_finer_model(share, model, status):
    design = designs("trade_random")[0]
    load = trade.trial(0, "glued shear", "auto", confirm=True).loads[0]
    along = share * buckling.sideways_stiffness(design) * load.shear_x
    states = [sheared(0.1, 0.1 / max(share, 1e-9), along, level=level) for level in ("quick", "standard", "fine")]
    (result,) = [each for each in confirm(states, sheared_rule()) if each["tolerance"] == 0.01]
    assert (result["model"], result["status"]) == (model, status)


# Costs


def test_what_formulas_and_surrogate_refuse_is_a_state(tmp_path):
    runs = [
        Run("friction", trial(0, "friction", "auto"), "formula", "finite"),
        Run("press", trial(1, "press", "auto"), "surrogate", "shipped"),
    ]
    found = trade.answers(runs, store=tmp_path / "s.sqlite")
    upright = found[found.shear_mm == 0]
    assert upright[["tilt_rad", "sideways_N"]].isna().all(axis=None)
    assert found[found.design == 1][READINGS].isna().all(axis=None)
    no_reference = extrapolated(found.iloc[:0].assign(size=[]))
    rows = trade.judged(runs, found, no_reference.join(full_scales(no_reference, {})), confirm=False)
    for _, last in rows.groupby("kind").last().iterrows():
        assert last.status == "refused"
        assert last.message
