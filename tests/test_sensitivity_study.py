"""The study of sensitivity: closed forms, finite elements through the store, the verb with its files and refusals."""

import csv
import math
import re

import numpy as np
import pytest

from analytic import beam
from fem import equilibrium
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from studies.sensitivity import sensitivity_study
from studies.sensitivity.beam_motions import Press
from studies.sensitivity.made_sensors import tolerances
from studies.sensitivity.sensitivity_study import Request, monte_carlo, ranges_of, sobol, substitutes

BARE = Design(magnet_diameter=0.0, magnet_height=0.0)


@pytest.fixture
def morris(tmp_path):
    """Morris' effects of a design without a magnet, solved in this process and kept in a store of the test."""

    def run(ranges, load=Press(1.0), trajectories=2):
        request = Request(
            design=BARE,
            ranges=ranges,
            load=load,
            methods=("morris",),
            model="finite",
            accuracy="quick",
            trajectories=trajectories,
            store=tmp_path / "solved.sqlite",
            workers=0,
        )
        return sensitivity_study.morris(request)

    return run


def study_of(ranges, load=Press(1.0), **options):
    return Request(design=paper(), ranges=ranges, load=load, **options)


def test_sobol_indices_of_the_papers_press_have_their_closed_form():
    """F = E g(d) with (5) and (7): the variance of a product of independent factors."""
    rows = sobol(study_of({"E": (0.5, 1.5), "depth": (0.5, 1.5)}, model="paper", seed=1)).rows
    d = np.linspace(0.5, 1.5, 100_001)
    g = math.pi * (8 * d - d**2) * d / 9
    of_E, of_g = (1 / 12) * g.mean() ** 2, g.var()
    whole = of_E + of_g + g.var() / 12
    first = [row["first_order"] for row in rows if row["output"] == "force_N"]
    total = [row["total_order"] for row in rows if row["output"] == "force_N"]
    assert first == pytest.approx([of_E / whole, of_g / whole], abs=0.02)
    assert total == pytest.approx([1 - of_g / whole, 1 - of_E / whole], abs=0.02)
    on_shift = [row["total_order"] for row in rows if row["output"] == "shift_z_mm"]
    assert on_shift == pytest.approx([0.0, 1.0], abs=0.02)


def test_refused_points_are_counted_and_widen_the_intervals():
    """The surrogate ends at L/D = 4: a quarter of the lengths is refused. No beam buckles under so light a press."""
    study = sobol(study_of({"L": (20.0, 36.0), "E": (0.9, 1.1)}, Press(0.1), points=64))
    row = study.rows[0]
    assert row["failed"] == sum(study.reasons.values())
    assert row["failed_percent"] == pytest.approx(25, abs=8)
    assert "L/D" in next(iter(study.reasons))
    assert row["total_order_high"] - row["total_order_low"] > 0.3


def test_the_error_of_the_surrogate_does_not_depend_on_the_modulus():
    rows = sobol(study_of({"E": (0.9, 1.1), "L": (8.0, 12.0)}, points=64)).rows
    (of_shift,) = (row for row in rows if (row["output"], row["input"]) == ("shift_z_mm", "E"))
    assert (of_shift["total_order"], of_shift["total_order_high"]) == (0.0, 0.0)
    assert of_shift["model_error_over_deviation"] > 0


def test_morris_on_finite_elements_finds_that_force_is_proportional_to_the_modulus(morris, traced):
    study = morris({"E": (0.5, 1.5)})
    (force, *_) = (row for row in study.rows if row["output"] == "force_N")
    assert force["mu_star"] == pytest.approx(study.each[0]["fem_force_N"] / study.each[0]["E_MPa"], rel=1e-5)
    assert force["sigma"] == pytest.approx(0.0, abs=1e-6)
    assert force["effect_unit"] == "N per full range"
    assert len(traced) == 1


def test_morris_that_was_interrupted_continues_from_the_store(morris, traced, monkeypatch):
    ranges = {"L": (9.0, 12.0), "depth": (0.3, 0.6)}
    real, allowed = equilibrium.trace, 2

    def interrupted(*args, **kwargs):
        if len(traced) >= allowed:
            raise KeyboardInterrupt
        return real(*args, **kwargs)

    with monkeypatch.context() as patch:
        patch.setattr(equilibrium, "trace", interrupted)
        with pytest.raises(KeyboardInterrupt, match="2 of 4 solves are kept in"):
            morris(ranges)
    study = morris(ranges)
    assert all(case["status"] == "ok" for case in study.each)
    again = morris(ranges)
    assert len(traced) == 4
    assert [row["mu_star"] for row in again.rows] == [row["mu_star"] for row in study.rows]


def test_failed_cases_of_morris_are_counted_and_bounded(morris):
    study = morris({"L": (3.0, 9.0)}, Press(0.3), 4)
    failed = [case for case in study.each if case["status"] != "ok"]
    row = study.rows[0]
    assert row["failed"] == len(failed) > 0
    assert row["mu_star_high"] > row["mu_star"] >= row["mu_star_low"]
    assert next(iter(study.reasons)).startswith("bad_input: L must exceed the tip radius")


def test_unstable_cases_of_morris_keep_their_numbers_and_are_said(morris):
    study = morris({"L": (24.0, 32.0)}, Press(3.0), 4)
    assert not study.reasons
    assert {case["status"] for case in study.each} == {"unstable"}
    count = len(study.each)
    assert f"{count} of {count} states are unstable, the first one because a beam whose tip slides" in study.doubt


def test_a_fast_model_answers_in_place_of_failed_cases():
    points, failed = np.array([[0.5], [1.0], [9.0]]), np.array([False, True, True])
    other = substitutes(study_of({"depth": (0.5, 9.0)}, model="finite"), points, failed)
    assert np.isnan(other["force_N"][[0, 2]]).all()
    assert other["force_N"][1] == beam.solve(paper(), Load(1.0), "finite").force[2]


def test_a_monte_carlo_has_percentiles_of_each_axis_and_a_row_for_each_sensor():
    study = monte_carlo(study_of({}, Press(1.0, 0.3), methods=("montecarlo",), sensors=30, seed=2))
    assert {(row["axis"], row["percentile"]) for row in study.rows} == {(a, p) for a in "zxy" for p in (5, 50, 95)}
    assert len(study.each) == 30
    assert {"E_MPa", "z_sensitivity_V_per_N", "x_force_error_N", "element2_gain_factor"} <= study.each[0].keys()
    for row in study.rows:
        assert row["low"] is None or row["low"] <= row["value"]
        assert row["high"] is None or row["high"] >= row["value"]


FAST = ("--model", "finite", "--count", "16", "--sensors", "20", "--trajectories", "2", "--accuracy", "quick")


def test_all_methods_write_their_tables_pictures_and_the_page(run, tmp_path, strict):
    status, out, _ = run(
        *("sensitivity", "paper", "--depth", "0.5", "--methods", "sobol,morris,montecarlo", "--vary", "E=0.8:1.2"),
        *("--vary", "hall_gain=30:32", *FAST, "--out", "o", "--json"),
    )
    rows = strict(out)
    assert status == 0
    assert {row["method"] for row in rows} == {"sobol", "morris", "montecarlo"}
    text = (tmp_path / "o" / "SENSITIVITY.md").read_text("utf-8")
    for heading in ("## Sobol indices", "## Morris' effects", "## Made sensors", "Made with `magtip sensitivity"):
        assert heading in text
    # the gain of the elements has no effect on the force
    assert re.search(r"^- force \(N\) varies with E \d+ %\.$", text, flags=re.M)
    assert "- Along z 95 % of the sensors that have not failed err by at most" in text
    for name in ("sobol", "morris", "montecarlo"):
        assert (tmp_path / "o" / f"{name}.png").is_file()
        with open(tmp_path / "o" / f"{name}.csv", newline="", encoding="utf-8") as file:
            table = list(csv.DictReader(file))
        assert len(table) == {"sobol": 10, "morris": 10, "montecarlo": 20}[name]
    first = next(row for row in rows if row["method"] == "sobol")
    assert first["total_order"] == pytest.approx(1.0, abs=0.2)


def test_files_of_methods_that_are_not_requested_again_do_not_stay(run, tmp_path):
    common = ("sensitivity", "paper", "--depth", "0.5", *FAST, "--out", "o")
    assert run(*common, "--methods", "sobol")[0] == 0
    assert run(*common, "--methods", "montecarlo")[0] == 0
    names = {path.name for path in (tmp_path / "o").glob("[!.]*")}
    assert names == {"SENSITIVITY.md", "montecarlo.csv", "montecarlo.png", "percentiles.csv"}


def test_failures_are_said_and_end_with_3_if_nothing_succeeds(run):
    common = ("sensitivity", "paper", "--depth", "0.1", "--methods", "sobol", "--count", "16")
    status, _, err = run(*common, "--vary", "L=30:36")
    assert status == 0
    assert "have failed" in err
    status, _, err = run(*common, "--vary", "L=36:40")
    assert status == 3
    assert "48 of 48 have failed (100 %)" in err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--methods", "sobel"), "--methods: there is no method 'sobel': did you mean sobol?"),
        (("--model", "surogate"), "--model: there is no model 'surogate': did you mean surrogate?"),
        (("--seed", "-1"), "--seed must be 0 or more; got -1"),
        (("--methods", "montecarlo", "--vary", "E=1:2"), "--vary works with the methods sobol and morris"),
        (("--tolerance", "Ee=1"), "--tolerance: there is no key 'Ee'"),
        (("--store", "x.sqlite"), "--store works with the method morris only"),
        (("--count", "100"), "need a power of 2, 8 or more, as count; got 100"),
        (("--methods", "sobol,morris", "--trajectories", "1"), "from 2 to 1000 trajectories; got 1"),
        (("--sensors", "0"), "the number of made sensors must be from 1 to 1000000; got 0"),
        (
            ("--vary", "friction=0.1:0.5"),
            "--vary friction: only fields of the design, depth and shear can vary: leave it out",
        ),
        (("--vary", "depth=1:9", "--model", "paper", "--vary", "law=1:2"), "its values are names"),
    ],
)
def test_impossible_studies_are_refused_in_a_sentence(run, options, message):
    status, out, err = run("sensitivity", "paper", "--depth", "1", *options)
    assert (status, out) == (2, "")
    assert message in err


def test_ranges_of_the_tolerances_lie_about_the_design_and_below_their_bounds():
    ranges = ranges_of(paper(), [], ["sobol"], tolerances(E=20.0, nu=0.001, magnet_height=0.0))
    assert ranges["E"] == pytest.approx((0.8, 1.2))
    assert ranges["nu"] == pytest.approx((0.4988, 0.5))
    assert ranges["magnet_diameter"] == pytest.approx((3.95, 4.05))
    assert "magnet_height" not in ranges


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("E=1", "--vary E takes low:high, such as E=1:2; got '1'"),
        ("E=2:1", "--vary E takes low:high with low < high; got '2:1'"),
        ("E=1:1e9", "every value of axis E must lie between"),
        ("E=a:b", "each value of axis E must be a finite number; got 'a'"),
        ("law=1:2", "--vary law: its values are names"),
        ("hall_average=1:9", "--vary hall_average: it is a whole number of samples"),
        ("EE=1:2", "there is no axis 'EE'"),
        ("E", "--vary takes KEY=VALUE, such as E=0.6:1; got 'E'"),
    ],
)
def test_impossible_ranges_are_refused(text, message):
    with pytest.raises(BadInput) as error:
        ranges_of(paper(), [text], ["sobol"], tolerances())
    assert message in str(error.value)
