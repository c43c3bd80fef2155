"""The verb fit with relaxation tests and dynamic tests: records, files, and the design that follows."""

import csv

import numpy as np
import pytest

from geometry.relaxation import Relaxation, check_range, moduli, relaxation_of
from studies.inputs.user_input import read_design

SERIES = Relaxation((0.15, 0.2), (0.05, 5.0))
TIMES = np.geomspace(0.01, 60, 40)


@pytest.fixture
def step(tmp_path):
    """A relaxation test at a stretch of 1.2: E = 0.8 MPa after the step, with noise."""
    noise = 1e-4 * np.random.default_rng(0).normal(size=40)
    stress = 0.8 * SERIES.modulus(TIMES) * (1.2 - 1.2**-2) / 3 + noise
    return table(tmp_path / "step.csv", "time_s,nominal_stress_MPa", TIMES, stress)


@pytest.fixture
def dynamic(tmp_path):
    frequencies = np.geomspace(0.01, 30, 25)
    g = 0.8 * SERIES.complex_modulus(2 * np.pi * frequencies)
    return table(
        tmp_path / "dma.csv", "frequency_Hz,storage_modulus_MPa,loss_modulus_MPa", frequencies, g.real, g.imag
    )


def table(file, header, *columns):
    np.savetxt(file, np.column_stack(columns), delimiter=",", header=header, comments="")
    return file


def test_a_relaxation_test_becomes_a_design_that_reads_back(run, strict, step, tmp_path):
    line = ("fit", step, "--stretch", 1.2, "--ramp", 0, "--nu", 0.5, "--out", "made", "--json")
    status, out, err = run(*line)
    records = strict(out)
    assert (status, err) == (0, "")
    (chosen,) = [record for record in records if record["chosen"]]
    assert [record["rank"] for record in records] == list(range(1, len(records) + 1))
    assert [record["AICc"] for record in records] == sorted(record["AICc"] for record in records)
    assert chosen["times_s"] == pytest.approx(SERIES.times, rel=0.05)
    design = read_design(str(tmp_path / "made" / "design.toml"))
    assert design.prony == chosen["prony"]
    assert (design.E, design.modulus) == (pytest.approx(chosen["E_MPa"], rel=1e-5), "long-term")
    assert moduli(design) == pytest.approx((0.8, 0.8 * SERIES.rest), rel=0.01)
    assert relaxation_of(design).speaks_for == pytest.approx((0.01, 60.0))
    assert check_range(design, times=[0.01, 60.0], frequencies=chosen["covered_Hz"]) == []
    assert sorted(path.name for path in (tmp_path / "made").glob("[!.]*")) == ["design.toml", "fit.csv", "fit.png"]
    with open(tmp_path / "made" / "fit.csv", newline="", encoding="utf-8") as lines:
        assert [row["branches"] for row in csv.DictReader(lines)] == [str(record["branches"]) for record in records]
    assert (tmp_path / "made" / "fit.png").is_file()


def test_a_dynamic_test_prints_tables_and_the_lines_of_a_design(run, dynamic):
    status, out, err = run("fit", dynamic, "--out", "made", "--law", "yeoh", "--stretch", 1.1)
    assert status == 0
    assert '  prony = "0:0.00530516 0.15:0.05 0.2:5 0:15.9155"' in out
    assert "  E = 0.52" in out
    assert "The branches speak for 0.00531 to 15.9 s (0.01 to 30 Hz)." in out
    assert "--law has no effect: " in err
    assert "--stretch has no effect: " in err


def test_what_a_relaxation_test_leaves_open_is_said(run, step):
    status, out, err = run("fit", step)
    assert status == 0
    assert "no ramp time is stated: the stretch is taken to rise at once" in err
    assert "no held stretch: E is unknown" in err
    assert "E = " not in out
    late = run("fit", step, "--ramp", 0.0105, "--stretch", 1.2)[2]
    assert "the first time, 0.01 s, is shorter than the ramp of 0.0105 s" in late


def test_a_branch_beyond_the_test_is_said(run, tmp_path):
    slow = Relaxation((0.2, 0.3), (0.1, 100.0))
    file = table(tmp_path / "slow.csv", "time_s,youngs_modulus_MPa", TIMES, slow.modulus(TIMES))
    assert "relaxation goes on beyond the test" in run("fit", file, "--ramp", 0)[2]


def test_without_relaxation_or_with_an_impossible_E_there_is_no_design(run, tmp_path):
    flat = 0.5 + 1e-3 * np.random.default_rng(3).normal(size=40)
    file = table(tmp_path / "flat.csv", "time_s,youngs_modulus_MPa", TIMES, flat)
    status, _, err = run("fit", file, "--ramp", 0, "--out", "made")
    assert (status, (tmp_path / "made" / "design.toml").exists()) == (3, False)
    assert "the test shows no relaxation above its noise" in err
    stiff = table(tmp_path / "stiff.csv", "time_s,youngs_modulus_MPa", TIMES, 1e5 * SERIES.modulus(TIMES))
    status, _, err = run("fit", stiff, "--ramp", 0)
    assert status == 3
    assert "check that the column youngs_modulus_MPa is in the unit of its name" in err


def ramped(ramp):
    """Modulus of SERIES at TIMES after a linear rise of the stretch: the mean of G(t - s) over the elapsed ramp."""
    s = (np.arange(400) + 0.5) / 400
    elapsed = np.minimum(TIMES, ramp)
    return elapsed / ramp * SERIES.modulus(TIMES[:, None] - s * elapsed[:, None]).mean(axis=1)


def test_a_forgotten_ramp_is_named(run, tmp_path):
    file = table(tmp_path / "ramp.csv", "time_s,youngs_modulus_MPa", TIMES, ramped(0.5))
    status, out, err = run("fit", file)
    assert (status, out, len(err.splitlines())) == (2, "", 1)
    assert "the values rise from 0.01 s to 0.5" in err
    assert "state the time of the rise by --ramp" in err
    assert run("fit", file, "--ramp", 0.5)[0] == 0


def test_branches_of_a_ramp_that_is_too_long_are_no_design(run, tmp_path):
    file = table(tmp_path / "ramp.csv", "time_s,youngs_modulus_MPa", TIMES, ramped(0.5))
    status, out, err = run("fit", file, "--ramp", 1)
    assert (status, "Lines for a design file" in out) == (3, False)
    assert "a wrong --ramp does so" in err


def test_a_ramp_that_the_values_contradict_is_refused(run, step):
    status, out, err = run("fit", step, "--stretch", 1.2, "--ramp", 0.5)
    assert (status, out, len(err.splitlines())) == (2, "", 1)
    assert "cannot within the ramp of 0.5 s" in err


def test_branches_that_miss_the_test_are_no_design(run, tmp_path):
    jumping = 0.5 + 0.15 * (-1.0) ** np.arange(40)
    file = table(tmp_path / "jumping.csv", "time_s,youngs_modulus_MPa", TIMES, jumping)
    status, out, err = run("fit", file, "--ramp", 0)
    assert status == 3
    assert "Lines for a design file" not in out
    assert "no relaxation above its noise of 23 % (rms)" in err


@pytest.mark.parametrize(("tau", "warned"), [(5.0, True), (30.0, False)])
def test_a_branch_at_the_first_time_is_said_to_be_perhaps_shorter(run, strict, tmp_path, tau, warned):
    at = np.linspace(20, 24, 600)
    table(tmp_path / "late.csv", "time_s,youngs_modulus_MPa", at, 1 + 0.5 * np.exp(-at / tau))
    status, out, err = run("fit", "late.csv", "--ramp", 0, "--nu", 0.5, "--json")
    chosen = next(record for record in strict(out) if record["chosen"])
    assert (status, chosen["branches"]) == (0, 1)
    assert ("a branch is as short as the first time of the test, 20 s" in err) == warned
