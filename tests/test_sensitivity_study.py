"""The verb sensitivity: Sobol indices, Morris' effects and made sensors against closed forms, files and refusals."""

import csv
import itertools
import math
import re

import numpy as np
import pytest

from analytic import beam, hall
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from studies.beam import surrogate_response
from studies.inputs.option_groups import Sampling, Solves
from studies.sensitivity import sensitivity_study
from studies.sensitivity.beam_motions import QUANTITIES, Press, motions, names, readings, sampled_outputs
from studies.sensitivity.global_sensitivity import (
    effects,
    indices,
    saltelli_points,
    sobol_of,
    squared_differences,
    trajectories,
    variances,
)
from studies.sensitivity.sensitivity_study import Request, sobol

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
            sampling=Sampling(model="finite", accuracy="quick", trajectories=trajectories),
            solves=Solves(store=tmp_path / "solved.sqlite", workers=0),
        )
        return sensitivity_study.morris(request)

    return run


def study_of(ranges, load=Press(1.0), **options):
    return Request(design=paper(), ranges=ranges, load=load, **options)


def test_the_finding_names_what_matters_most_and_is_unknown_where_intervals_overlap():
    def row(output, name, *numbers):
        return {"output": output, "input": name} | dict(
            zip(("total_order", "total_order_low", "total_order_high"), numbers, strict=True)
        )

    rows = [
        *(row("force_N", "E", 0.9, 0.8, 1.1), row("force_N", "nu", 0.1, 0.0, 0.7)),
        *(row("tilt_rad", "E", 0.5, 0.4, 0.6), row("tilt_rad", "nu", 0.45, 0.3, 0.5)),
        *(row("S1_V", "E", 0.0, 0.0, 0.0), row("S1_V", "nu", 0.0, 0.0, 0.0)),
        *(row("S2_V", "E", None, None, None), row("S2_V", "nu", None, None, None)),
    ]
    found = sensitivity_study.Found(rows=rows, count=8, reasons={})
    assert sensitivity_study.findings({"sobol": found}) == [
        (
            "Sobol: E matters most for force 90 % [80 to 100 %]; no input changes S1; unknown what matters most for "
            "tilt towards x (the intervals of E 50 % [40 to 60 %], nu 45 % [30 to 50 %] overlap), S2 (no result)"
        )
    ]


def test_sobol_indices_of_the_papers_press_have_their_closed_form():
    """F = E g(d) with (5) and (7): the variance of a product of independent factors."""
    rows = sobol(study_of({"E": (0.5, 1.5), "depth": (0.5, 1.5)}, sampling=Sampling(model="paper", seed=1))).rows
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


def test_morris_on_finite_elements_finds_that_force_is_proportional_to_the_modulus(morris, traced):
    study = morris({"E": (0.5, 1.5)})
    (force, *_) = (row for row in study.rows if row["output"] == "force_N")
    assert force["mu_star"] == pytest.approx(study.each[0]["fem_force_N"] / study.each[0]["E_MPa"], rel=1e-5)
    assert force["sigma"] == pytest.approx(0.0, abs=1e-6)
    assert force["effect_unit"] == "N per full range"
    assert len(traced) == 1


def test_failed_cases_of_morris_are_counted_and_bounded(morris):
    study = morris({"L": (3.0, 9.0)}, Press(0.3), 4)
    failed = [case for case in study.each if case["status"] != "ok"]
    row = study.rows[0]
    assert row["failed"] == len(failed) > 0
    assert row["mu_star_high"] > row["mu_star"] >= row["mu_star_low"]
    assert next(iter(study.reasons)).startswith("bad_input: L must exceed the tip radius")


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
    # an error that the model does not state is no error of 0
    names = ("model_error_over_deviation", "model_error_percent")
    assert {row[name] for row in rows for name in names if name in row} == {None}
    assert "points by model finite, which states no error" in text
    assert "the model states no error of its sensitivity" in text
    first = next(row for row in rows if row["method"] == "sobol")
    assert first["total_order"] == pytest.approx(1.0, abs=0.2)


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
        (("--seed", "-1"), "--seed must be 0 or more; got -1"),
        (("--methods", "montecarlo", "--vary", "E=1:2"), "--vary works with the methods sobol and morris"),
        (("--tolerance", "Ee=1"), "--tolerance: there is no key 'Ee'"),
        (("--store", "x.sqlite"), "--store works with the method morris only"),
        (("--methods", "sobol,morris", "--trajectories", "1"), "from 2 to 1000 trajectories; got 1"),
        (("--sensors", "0"), "the number of made sensors must be from 1 to 1000000; got 0"),
        (
            ("--vary", "friction=0.1:0.5"),
            "--vary friction: only fields of the design, depth and shear can vary: leave it out",
        ),
    ],
)
def test_impossible_studies_are_refused_in_a_sentence(run, options, message):
    status, out, err = run("sensitivity", "paper", "--depth", "1", *options)
    assert (status, out) == (2, "")
    assert message in err


# Sobol indices and Morris' effects of functions


ANGLES = dict.fromkeys(("x1", "x2", "x3"), (-math.pi, math.pi))
FIRST, TOTAL = [0.3139, 0.4424, 0.0], [0.5576, 0.4424, 0.2437]
"""Indices of Ishigami's function with a = 7 and b = 0.1, in closed form."""


def ishigami(x):
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def contains(result, first, total):
    truth = {"first_order": np.array(first), "total_order": np.array(total)}
    return [
        inside
        for order, values in truth.items()
        for inside in (result[f"{order}_low"] <= values) & (values <= result[f"{order}_high"])
    ]


def test_ishigami():
    result = sobol_of(ishigami, ANGLES, 4096, seed=1)
    assert result["first_order"].to_numpy() == pytest.approx(FIRST, abs=0.015)
    assert result["total_order"].to_numpy() == pytest.approx(TOTAL, abs=0.015)
    assert all(contains(result, FIRST, TOTAL))
    values = ishigami(saltelli_points(ANGLES, 4096, 1))
    assert values.mean() == pytest.approx(3.5, abs=0.05)
    assert values.var() == pytest.approx(49 / 8 + 0.1 * math.pi**4 / 5 + 0.01 * math.pi**8 / 18 + 0.5, rel=0.02)


def test_the_intervals_cover_the_truth_at_their_level():
    """Of 30 samples, 95 % of the intervals of six indices: not fewer than 0.88, where all six are equally covered."""
    covered = [contains(sobol_of(ishigami, ANGLES, 256, seed=seed), FIRST, TOTAL) for seed in range(30)]
    assert 0.88 < np.mean(covered) < 0.99


@pytest.mark.parametrize("share", [0.01, 0.1])
@pytest.mark.parametrize("where", ["at random", "in a corner", "where large"])
def test_with_failed_points_the_intervals_contain_the_truth(share, where):
    def failing(x):
        y = ishigami(x)
        rank = {
            "at random": np.random.default_rng(3).random(len(x)),
            "in a corner": x[:, 0] + x[:, 1],
            "where large": y,
        }
        return np.where(rank[where] > np.quantile(rank[where], 1 - share), np.nan, y)

    result = sobol_of(failing, ANGLES, 1024, seed=4)
    assert all(contains(result, FIRST, TOTAL))
    whole = sobol_of(ishigami, ANGLES, 1024, seed=4)
    assert (result["total_order_high"] - result["total_order_low"]).sum() > (
        whole["total_order_high"] - whole["total_order_low"]
    ).sum()


def test_the_stated_error_of_the_model_widens_the_intervals():
    values = ishigami(saltelli_points(ANGLES, 256, 5))
    exact = indices(ANGLES, values, seed=5)
    rough = indices(ANGLES, values, np.full_like(values, 2.0), seed=5)
    assert np.array_equal(exact["first_order"], rough["first_order"])
    assert (rough["first_order_low"] <= exact["first_order_low"]).all()
    assert (rough["total_order_high"] >= exact["total_order_high"]).all()
    width = [(one["first_order_high"] - one["first_order_low"]).sum() for one in (exact, rough)]
    assert width[1] > 1.2 * width[0]


def test_an_output_that_does_not_vary_or_always_fails_has_no_indices():
    constant, never = (sobol_of(lambda x, y=y: np.full(len(x), y), ANGLES, 8) for y in (2.0, np.nan))
    assert constant.isna().all(axis=None)
    assert never.isna().all(axis=None)


@pytest.mark.parametrize(
    ("ranges", "count", "message"),
    [
        (ANGLES, 1000, "need a power of 2, 8 or more, as count; got 1000: take 512"),
        (ANGLES, 4, "got 4: take 8"),
        (ANGLES, 2**19, "at most 2000000 points"),
    ],
)
def test_impossible_counts_are_refused(ranges, count, message):
    with pytest.raises(BadInput, match=message):
        saltelli_points(ranges, count, 0)


RANGES = {"a": (0.0, 2.0), "b": (-1.0, 1.0), "c": (10.0, 20.0)}


def morris_of(function, ranges, count=10, seed=0):
    points = trajectories(ranges, count, seed)
    return effects(ranges, points, function(points), seed=seed)


def linear(x):
    return 3 * x[:, 0] - 4 * x[:, 1] + 0.1 * x[:, 2]


def test_a_linear_function_has_its_slopes_over_the_ranges_as_effects():
    result = morris_of(linear, RANGES, 5)
    assert result["mu_star"].to_numpy() == pytest.approx([6.0, 8.0, 1.0], rel=1e-9)
    assert result["mu"].to_numpy() == pytest.approx([6.0, -8.0, 1.0], rel=1e-9)
    assert result["sigma"].to_numpy() == pytest.approx([0.0] * 3, abs=1e-9)


def test_another_model_replaces_failed_values_in_the_estimate():
    points = trajectories(RANGES, 10, 5)
    values = linear(points)
    lost = np.where(np.arange(len(values)) % 7 == 0, np.nan, values)
    assert effects(RANGES, points, lost, values)["mu_star"].to_numpy() == pytest.approx([6.0, 8.0, 1.0], rel=1e-9)
    assert effects(RANGES, points, lost, values)["mu_star_high"]["a"] > 6.1


def test_bounds_hold_for_every_filling_and_are_reached():
    one, other = np.array([0.3, np.nan, 0.9, np.nan]), np.array([0.7, 0.4, np.nan, np.nan])
    grid = np.linspace(0, 1, 11)
    differences, spread = [], []
    for a, b, c, d in itertools.product(grid, repeat=4):
        x, y = np.array([0.3, a, 0.9, b]), np.array([0.7, 0.4, c, d])
        differences.append((x - y) ** 2)
        spread.append(np.r_[x, y].var())
    least, most = squared_differences(one, other, 0.0, 1.0)
    assert least == pytest.approx(np.min(differences, axis=0), abs=1e-12)
    assert most == pytest.approx(np.max(differences, axis=0), abs=1e-12)
    low, high = variances(np.r_[one, other], 0.0, 1.0)
    assert low <= min(spread) < low + 1e-3
    assert high == pytest.approx(max(spread))


# Motions and outputs of many sensors


DEPTH, SHEAR = np.array([[0.5, 1.0], [0.4, 0.8]]), np.array([[0.0, 0.3], [0.0, -0.3]])
LONGER = Design(L=12.0, l0=10.2, E=0.5)


def test_formulas_answer_each_sensor_and_load():
    moved = motions("finite", [paper(), LONGER], DEPTH, SHEAR)
    truth = beam.solve(LONGER, Load(0.8, -0.3, friction="stick"), "finite")
    assert moved.values["force_x"][1, 1] == truth.force[0] < 0
    assert moved.values["force_z"][1, 1] == truth.force[2]
    assert moved.values["tilt"][1, 1] == truth.tilt
    assert moved.values["shift_z"][0, 0] == beam.solve(paper(), Load(0.5), "finite").shift[2]
    # formulas state no error, and none of the readings that follow
    assert np.isnan(moved.half_widths["force_z"]).all()
    assert np.isnan(readings([paper(), LONGER], moved)[1]).all()


def test_the_surrogate_refuses_beyond_buckling_as_everywhere():
    """A sheared slender beam gave a force against the shear, without a word."""
    slender, load = Design(L=24.0, l0=22.0), Load(depth=2.0, shear_x=0.5, friction="stick")
    moved = motions("surrogate", [slender, paper()], np.full((2, 2), 2.0), np.array([[0.5, 0.0], [0.5, -0.5]]))
    for name in QUANTITIES:
        assert np.isnan(moved.values[name][0]).all()
        assert np.isnan(moved.half_widths[name][0]).all()
    assert moved.refusals[0, 0] == surrogate_response.refusal(slender, load, "rigid")
    assert "knows a press to stay stable to" in moved.refusals[0, 1]
    assert moved.refusals[1].tolist() == ["", ""]
    assert moved.values["force_x"][1, 0] == -moved.values["force_x"][1, 1] > 0


RANGES_BEAM_MOTIONS = {"E": (0.5, 2.0), "depth": (0.5, 1.0)}
POINTS = np.array([[0.5, 1.0], [2.0, 0.5], [1.0, 0.001]])


def test_outputs_are_those_of_each_case():
    outputs, refusals = sampled_outputs("finite", paper(), RANGES_BEAM_MOTIONS, POINTS, Press(1.0, 0.2), sheared=True)
    assert tuple(outputs) == names(paper(), sheared=True)
    response = beam.solve(Design(E=2.0), Load(0.5, 0.2, friction="stick"), "finite")
    assert outputs["force_x_N"][0][1] == response.force[0]
    assert outputs["tilt_rad"][0][1] == response.tilt
    assert outputs["S2_V"][0][1] == pytest.approx(hall.readings(paper(), response).V[1])
    assert refusals == ("", "", "")


@pytest.mark.parametrize("load", [(0.0, 0.0), (float("nan"), 0.0), (1.0, -0.1), (1.0, float("inf"))])
def test_impossible_loads_are_refused(load):
    with pytest.raises(BadInput, match="must be a finite number of mm"):
        Press(*load)
