"""Presses that are planned before the first one, and a bench of any design that is simulated for rehearsal."""

import dataclasses
import json
from pathlib import Path

import magpylib
import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from analytic import parts
from analytic.hall import field_at
from geometry.design import paper
from studies.calibration import (
    bench_file,
    calibrated_forces,
    calibration_file,
    calibration_study,
    press_plan,
    sensor_fit,
    simulated_bench,
)
from studies.parts.part_tolerances import tolerances
from studies.parts.requirements import Requirements
from studies.sensing import decode_readings
from studies.sensitivity.made_sensors import made_sensors

pytestmark = pytest.mark.calibrates

NEEDED = Requirements(force_z=6.0, force_x=0.6, press_with_shear=1.5)
CHIPS = {"chip_x": 3.0, "chip_count": 3, "hall_layout": "tmag5170a1"}


@pytest.fixture(scope="module")
def plan():
    return press_plan.plan(paper(), tolerances(), NEEDED)


def test_a_plan_stays_within_the_loads_and_tells_more_than_evenly_spread_presses(plan):
    # at rest
    assert not plan.force[0].any()
    assert not plan.load[0].any()
    force, load = plan.force[1:], plan.load[1:]
    aside = np.hypot(force[:, 0], force[:, 1])
    assert force[:, 2].max() == pytest.approx(6.0)
    assert aside.max() == pytest.approx(0.6)
    assert (aside[force[:, 2] < 1.5] == 0).all()
    assert len({tuple(row) for row in force.round(6).tolist()}) == 12
    # by direction, in each with rising forces
    key = list(zip(np.nan_to_num(plan.angle[1:], nan=-1.0), force[:, 2].round(9), strict=True))
    assert key == sorted(key)
    # the mechanics have these forces under these loads
    _, _, found = calibrated_forces.poses_of(plan.sensor, load)
    assert found == pytest.approx(force, abs=1e-4)
    # three depths in four directions, and no more presses
    top = load[np.lexsort((aside, force[:, 2]))[-1]]
    share, turn = np.repeat([1 / 3, 2 / 3, 1.0], 4), np.radians(90 * np.tile(range(4), 3))
    depth, shear = top[0] * share, np.hypot(*top[1:]) * share
    even, _, _ = calibrated_forces.poses_of(
        plan.sensor, np.stack([depth, shear * np.cos(turn), shear * np.sin(turn)], axis=1)
    )
    other = calibrated_forces.planned(plan.sensor, even)
    assert plan.error(plan.after) < plan.error(other) < 0.1 * plan.error(plan.before)


@pytest.mark.parametrize("design", [paper(hall_plate=0.4), paper(**CHIPS)])
def test_readings_of_a_made_sensor_are_those_of_an_independent_field_code(design):
    made = made_sensors(design, tolerances(), 1, 3)
    rng = np.random.default_rng(1)
    states = simulated_bench.States(np.zeros((3, 3)), rng.uniform(-0.5, 0.5, (3, 3)), rng.uniform(-0.1, 0.1, (3, 2)))

    def by_magpylib(points, of, shift, turn):
        found = np.empty_like(points)
        for k, (point, at, way) in enumerate(zip(points, shift, turn, strict=True)):
            magnet = magpylib.magnet.Cylinder(
                polarization=(0, 0, -of.polarisation), dimension=(of.magnet_diameter, of.magnet_height)
            )
            magnet.position, magnet.orientation = at + np.array([0, 0, of.H]), Rotation.from_rotvec([*way, 0])
            found[k] = magnet.getB(point)
        return found

    ours, theirs = (
        simulated_bench.readings(made, states, simulated_bench.Stand(0.02, 0.0, field=code), np.random.default_rng(0))
        for code in (field_at, by_magpylib)
    )
    step = max(element.step for element in simulated_bench.elements_of(made))
    assert ours == pytest.approx(theirs, abs=1e-9 + step)
    # parts that are displaced and rounded readings are read
    still = simulated_bench.readings(
        dataclasses.replace(made, magnet_offset=0 * made.magnet_offset), states,
        simulated_bench.Stand(0.02, 0.0), np.random.default_rng(0),
    )  # fmt: skip
    assert np.abs(still - ours).max() > 10 * step


def test_a_rehearsal_goes_from_plan_to_decoded_forces(run, monkeypatch, tmp_path):
    monkeypatch.setattr(simulated_bench, "STATES", 4)
    options = ("--set", "hall_layout=tmag5170a1")
    status, text, err = run("bench", "paper", *options, "--simulate", "--out", "bench", "--json")
    assert status == 0, err
    record = json.loads(text)
    assert len(record["presses"]) == 1 + press_plan.PRESSES
    assert record["made"]["E_MPa"] != 1.0
    assert {path.name for path in (tmp_path / "bench").glob("[!.]*")} == {
        "plan.csv", "bench.csv", "recording.csv", "run.json",
    }  # fmt: skip
    status, text, err = run("calibrate", "paper", *options, "bench/bench.csv", "--out", "found", "--json")
    assert status == 0, err
    status, _, err = run(
        "decode", "paper", *options, "--calibration", "found/calibration.json",
        "--file", "bench/recording.csv", "--out", "forces.csv",
    )  # fmt: skip
    assert status == 0, err
    table = pd.read_csv("forces.csv").iloc[simulated_bench.AT_REST :]
    off, half = (np.array([table[f"{name}_{axis}_N"] for axis in "xyz"]).T for name in ("force", "half_width"))
    off -= table[simulated_bench.TRUE].to_numpy()
    assert (np.abs(off) < 2 * half).all()
    assert half[-1].max() < 0.1 * record["force_z_N"]
    # no bench of this sensor stays beside the plan of another one
    assert run("bench", "paper", "--out", "bench")[0] == 0
    assert {path.name for path in (tmp_path / "bench").glob("[!.]*")} == {"plan.csv", "run.json"}


def test_three_chips_are_pressed_and_fitted_and_reject_a_field(run):
    design, made = paper(**CHIPS), tolerances()
    plan = press_plan.plan(design, made, None, count=6)
    one = made_sensors(design, made, 1, 2)
    table = simulated_bench.bench(plan, one, simulated_bench.Stand(0.01), 2, lambda share, text: None)
    measured = np.hstack([table.iloc[:, :12].to_numpy(), np.full((7, 3), np.nan)])
    found = sensor_fit.fit(plan.sensor, measured, np.zeros(7))
    decoded = calibrated_forces.decode(found, measured[:, :9], np.zeros(7))
    off = np.abs(decoded.force - table[simulated_bench.TRUE].to_numpy())
    assert (off < 2 * decoded.half_width).all()
    assert off.max() < 0.03 * plan.needed.force_z
    # the robot turns after the bench
    names, field = list(table.columns[:9]), np.array([6e-5, -4e-5, 8e-5])
    by_field = np.array([e.direction for e in parts.of_design(design)]) @ field
    rejecting = dataclasses.replace(found, rejects_ambient=True)
    fooled, right = (calibrated_forces.decode(f, measured[:, :9] + by_field, np.zeros(7)) for f in (found, rejecting))
    assert np.abs(fooled.force - decoded.force).max() > np.abs(right.force - decoded.force).max()
    off = np.abs(right.force - table[simulated_bench.TRUE].to_numpy())
    assert (off < 2 * right.half_width).all()
    # what was found without the field is that of the bench, and noise
    still = calibrated_forces.decode(rejecting, measured[:, :9], np.zeros(7))
    # by gains that are known to about a percent
    assert np.allclose((right.ambient - still.ambient)[:, :3], 1e6 * field, rtol=0.03)
    assert (np.abs(still.ambient[:, :3]) < 2 * still.ambient[:, 3:]).all()
    # files, streams and lines of one reading say the same
    Path("calibration.json").write_text(calibration_file.as_text(rejecting, plan.mechanics_source, None), "utf-8")
    pd.DataFrame({"time_s": np.arange(7.0)} | dict(zip(names, (measured[:, :9] + by_field).T, strict=True))).to_csv(
        "rows.csv", index=False
    )
    options = [text for key, value in CHIPS.items() for text in ("--set", f"{key}={value}")]
    options += ["--calibration", "calibration.json", "--reject-ambient"]
    for words in (["decode", "--file"], ["stream", "--speed", "0", "--port"]):
        status, _, err = run(words[0], "paper", *words[1:], "rows.csv", *options, "--out", f"{words[0]}.csv")
        assert status == 0, err
        read = pd.read_csv(f"{words[0]}.csv")[decode_readings.AMBIENT_COLUMNS].to_numpy()
        assert read == pytest.approx(right.ambient, rel=1e-4)
    one = run("decode", "paper", "--readings", ",".join(map(str, measured[2, :9] + by_field)), *options, "--json")
    assert json.loads(one[1])["ambient_uT"] == pytest.approx(right.ambient[2, :3])


def test_a_plan_that_is_filled_in_is_a_bench(run, tmp_path):
    assert run("bench", "paper", "--out", "plan")[0] == 0
    filled = pd.read_csv("plan/plan.csv")
    empty = [name for name in filled if filled[name].isna().all()]
    assert empty == ["S1_V", "S2_V", "S3_V", "Fx_N", "Fy_N", "Fz_N", "depth_mm"]
    plan = press_plan.plan(paper(), tolerances(), None)
    shift, _, _ = calibrated_forces.poses_of(plan.sensor, plan.load)
    rows = plan.sensor.predict(plan.sensor.unknowns.mean, shift, np.zeros(len(shift)))[:, :7]
    filled[empty] = rows + 1e-3 * np.random.default_rng(1).normal(size=rows.shape)
    filled.to_csv("plan/plan.csv", index=False)
    read = sensor_fit.measured_of(bench_file.read([tmp_path / "plan" / "plan.csv"], paper()))
    assert read[:, :7] == pytest.approx(filled[empty].to_numpy())
    # what was filled in is not lost
    assert run("bench", "paper", "--out", "plan")[0] == 2
    assert pd.read_csv("plan/plan.csv").S1_V.notna().all()


def test_the_number_of_presses_is_refused_before_anything_is_solved(monkeypatch, refusal):
    monkeypatch.delattr(calibration_study, "mechanics_of")
    assert "must lie between 4 and 48; got -3" in refusal("bench", "paper", "--presses", "-3")


@pytest.mark.parametrize(
    ("text", "options", "sentence"),
    [
        ("", ["--simulate"], "--simulate writes bench.csv and recording.csv: add --out FOLDER"),
        ("", ["--force-noise", "0"], "--force-noise must be above 0 N"),
        ("", ["--simulate", "--out", "o", "--seed", "-1"], "--seed must be 0 or more; got -1"),
        (
            "",
            ["--simulate", "--out", "o", "--reading-noise", "-1"],
            "--reading-noise must be a finite number, 0 or mo",
        ),
        (
            # light presses with a shear, which are within the mechanics, make no bench of it
            "[requirements]\nforce_z = 500\nforce_x = 1",
            [],
            "a press of 500 N is beyond the mechanics of this design, which reach 1",
        ),
        ("[requirements]\nforce_z = 'much'", [], "requirements: force_z must be a number in N"),
        ("[requirements]\nforce_x = 1", [], "requirements: requirements need force_z"),
        ("[requirements]\nforce_zz = 1", [], "requirements: there is no key 'force_zz': did you mean force_z?"),
        ("requirements = 5", [], "requirements must be a table: write [requirements]"),
    ],
)
def test_a_bench_that_cannot_be_planned_is_one_sentence(text, options, sentence, toml, refusal, tmp_path):
    assert sentence in refusal("bench", toml(text), *options)
    assert not (tmp_path / "o").exists()
