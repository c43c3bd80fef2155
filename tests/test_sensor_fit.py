"""The estimator of made sensors: its unknowns, starts, intervals and decoder, and what rows say against it."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from analytic import parts
from geometry.design import Design, paper
from studies.calibration import (
    bench_file,
    calibrated_forces,
    calibration_study,
    force_regression,
    sensor_fit,
)
from studies.parts.part_tolerances import tolerances
from studies.simulation import mechanics_sources
from studies.validation.devices.calibration_check import FORCE_NOISE, READING_NOISE


@pytest.fixture(scope="module")
def simulated():
    """A sensor with unknowns drawn from its priors, the rows that it predicts, and their noise."""
    rng, design = np.random.default_rng(3), paper()
    law = mechanics_sources.of_surrogate(design).law
    table = pd.DataFrame({name: np.ones(40) for name in ("S1", "S2", "S3", "Fz_N")} | {"run": "a"})
    un = sensor_fit.unknowns_of(design, bench_file.Bench(table, ("S1", "S2", "S3"), []), tolerances())
    sensor = sensor_fit.Sensor(design, law, un, np.full(3, READING_NOISE), FORCE_NOISE)
    w, angle = -law.sink * rng.uniform(0.1, 0.8, 40), rng.uniform(0, 2 * np.pi, 40)
    u = law.reach * rng.uniform(0, 0.7, 40) * np.sqrt(-w / law.sink)
    return sensor, np.stack([u * np.cos(angle), u * np.sin(angle), w], axis=1), rng


def test_starts_lie_within_the_samples_of_the_mechanics(simulated):
    """In the corners of the workspace polynomials may have the forces and readings of other shifts."""
    sensor, law = simulated[0], simulated[0].mechanics
    corner = np.array([[law.reach, law.reach, -0.3 * law.sink]])
    start = sensor.starts(sensor.unknowns.mean, sensor.predict(sensor.unknowns.mean, corner, np.zeros(1)))
    assert 0.6 * law.reach < np.hypot(*start[0, :2]) <= law.reach * (1 + 1e-9)


def rows_of(sensor, theta, shift, rng, noise=1.0):
    rows = sensor.predict(theta, shift, np.zeros(len(shift)))
    rows[:, :3] += noise * READING_NOISE * rng.normal(size=(len(shift), 3))
    rows[:, 3:6] += noise * FORCE_NOISE * rng.normal(size=(len(shift), 3))
    rows[:, 6:] = np.nan
    return rows


def test_unknowns_scatter_as_their_covariance_says(simulated):
    sensor, shift, rng = simulated
    un, z = sensor.unknowns, []
    for _ in range(5):
        theta = un.mean + un.deviation * rng.normal(size=len(un.mean))
        found = sensor_fit.fit(sensor, rows_of(sensor, theta, shift, rng), np.zeros(len(shift)))
        z.append((found.theta - theta) / found.deviation)
        assert 0.6 < found.chi2 / found.freedom < 1.5
    inside = np.mean(np.abs(z) < sensor_fit.QUANTILE)
    assert 0.82 < inside < 0.97  # 0.9 of numbers that depend on each other


def test_a_sensor_far_from_its_priors_is_found():
    """Gains off by a quarter, a modulus by an eighth: exact readings lead from there into a wrong minimum."""
    lengths = {"D": 8.3, "L": 7.5, "f": 5.4, "magnet_diameter": 5.0, "magnet_height": 3.0, "l0": 4.6, "c": 1.25}
    design = paper(E=2.46, remanence=1.45, hall_gain=14.0, **lengths)
    law = mechanics_sources.of_surrogate(design).law
    names = ("S1", "S2", "S3")
    made = bench_file.Bench(pd.DataFrame({"run": ["a"] * 12}), names, [])
    un = sensor_fit.unknowns_of(design, made, tolerances(E=30.0, hall_gain=25.0))
    sensor, rng = sensor_fit.Sensor(design, law, un, np.full(3, 5e-5), 0.1), np.random.default_rng(3)
    theta = un.mean.copy()
    far = {"modulus": 0.88, "gain_S1": 0.9, "gain_S2": 0.75, "gain_S3": 1.24, "null_S1": -0.03, "null_S2": -0.03}
    for name, value in (far | {"null_S3": 0.06, "magnet_z": -0.07, "tilt_x": 0.016, "tilt_y": -0.03}).items():
        theta[un.names.index(name)] = value
    angle, w = np.tile([0.0, 2.1, 4.2], 4), -np.repeat([0.02, 0.07, 0.1, 0.16], 3)
    shift = np.stack([3 * -w * np.cos(angle), 3 * -w * np.sin(angle), w], axis=1)
    rows = sensor.predict(theta, shift, np.zeros(12)) + np.repeat([5e-5, 0.1, np.nan], 3) * rng.normal(size=(12, 9))
    found = sensor_fit.fit(sensor, rows, np.zeros(12))
    assert found.chi2 < 2 * found.freedom
    assert (np.abs(found.theta - theta) < 4 * found.deviation).all()


def test_a_single_chip_may_lie_beside_its_place():
    """The magnet's offset turns with the silicone and the chip's does not: no other unknown stands for both."""
    design = Design(D=5.1, L=5.2, E=1.81, l0=4.2, remanence=1.45, hall_layout="tmag5273a1", hall_average=1000.0)
    names = tuple(parts.columns(parts.of_design(design)))
    un = sensor_fit.unknowns_of(
        design, bench_file.Bench(pd.DataFrame({"run": ["a"]}), names, []), tolerances(chip_null=0.0)
    )
    law = mechanics_sources.of_surrogate(design).law
    sensor = sensor_fit.Sensor(design, law, un, np.full(3, 3e-6), 0.02)
    leaning = np.array([[-0.3, 0.2, -0.1], [0.0, 0.0, -0.1]])
    moved = np.zeros((2, len(un.names)))
    moved += un.mean
    moved[1, un.names.index("place_chip_x")] = moved[1, un.names.index("magnet_x")] = 0.05
    one, other = sensor.predict_all(moved, np.tile(leaning, (2, 1, 1)), np.zeros(2))[..., :3]
    assert np.abs(one[1] - other[1]).max() < 1e-9  # upright both are one
    assert np.abs(one[0] - other[0]).max() > 30e-6


def test_mechanics_of_a_calibration_follow_loads_that_friction_holds():
    """Sheared farther the press force falls, and polynomials that rise missed all of it: 22 % of the range here."""
    design = Design(D=5.1, L=5.2, E=1.81, l0=4.2, hall_layout="tmag5273a1")
    law = mechanics_sources.of_surrogate(design).law
    assert law.errors[2] < 0.01 * 5.0  # N, of 5 N required
    assert law.errors[1] < 0.01 * 1.5


def test_rows_never_make_a_sensor_less_known_than_its_parts(simulated):
    sensor, shift, rng = simulated
    un = sensor.unknowns
    theta = un.mean + un.deviation * rng.normal(size=len(un.mean))
    rows = rows_of(sensor, theta, shift[:12], rng, noise=20.0)
    found = sensor_fit.fit(sensor, rows, np.zeros(12))
    assert 150 < found.growth < 900
    assert (found.deviation <= un.deviation).all()
    assert (np.abs(found.theta - theta) < 4 * found.deviation).all()
    # and noise of readings counts as much larger in the intervals, beside what the mechanics miss
    none, at_rest = np.zeros_like(found.covariance), np.zeros((1, 3))
    missed = np.square(np.array(sensor.mechanics.errors[:3])[[1, 1, 2]] / 2)
    (wide,) = calibrated_forces.intervals(found, [none], at_rest, np.zeros(1))
    (usual,) = calibrated_forces.intervals(dataclasses.replace(found, chi2=0.0), [none], at_rest, np.zeros(1))
    squares = [np.square(half[0] / sensor_fit.QUANTILE) - missed for half in (wide, usual)]
    assert squares[0] == pytest.approx(found.growth * squares[1], rel=1e-6)


@pytest.mark.parametrize("name", ["modulus", "magnet_x", "place_S1_y", ""])
def test_a_prior_that_is_three_tolerances_off_is_named(simulated, name):
    sensor, shift, rng = simulated
    un = sensor.unknowns
    # parts beyond their tolerance are sorted out
    theta = un.mean + un.deviation * np.clip(rng.normal(size=len(un.mean)), -2, 2)
    if name:
        k = un.names.index(name)
        theta[k] = un.mean[k] + 6 * un.deviation[k]
    found = sensor_fit.fit(sensor, rows_of(sensor, theta, shift, rng), np.zeros(len(shift)))
    said = calibration_study.contradictions(found)
    assert len(said) == bool(name)
    if name:
        assert f"contradict the priors of {name} by" in said[0]


@pytest.mark.parametrize(
    ("presses", "noise", "stiffer", "cause"),
    [
        (8, 1.0, 0.0, "what 8 rows leave open of"),
        (40, 10.0, 0.0, "noise of the readings makes"),
        (40, 1.0, 0.2, "the model is off: measured forces miss it by"),
    ],
)
def test_a_model_that_is_worse_than_a_regression_says_why(simulated, presses, noise, stiffer, cause):
    sensor, shift, _ = simulated
    sensor, rng = dataclasses.replace(sensor, noise=noise * sensor.noise), np.random.default_rng(1)
    rows = rows_of(sensor, sensor.unknowns.mean, shift[:presses], rng)
    rows[:, :3] += (noise - 1) * READING_NOISE * rng.normal(size=(presses, 3))
    # a beam that is stiffer on one side
    rows[:, 5] *= 1 + stiffer * (shift[:presses, 0] > 0)
    found = sensor_fit.fit_with_noise(sensor, rows, np.zeros(presses))
    why, remedy = calibration_study.shortcoming(found, sensor, rows[:, 3:6], 90.0)
    assert why.startswith(cause)
    said = {"what": "press more often", "noise": "average more readings"}.get(why.split()[0], calibration_study.CHECK)
    assert remedy == said


def test_an_upside_down_magnet_is_named_and_shrunk_forces_are_not(simulated):
    sensor, shift, rng = simulated
    rows = rows_of(sensor, sensor.unknowns.mean, shift[:16], rng)
    upside_down, shuffled = rows.copy(), rows.copy()
    nulls = np.array([element.null for element in parts.of_design(paper())])
    upside_down[:, :3] = 2 * nulls - rows[:, :3]
    hint, better = calibration_study.mistaken(sensor, upside_down, np.zeros(16), ("S1", "S2", "S3"))
    assert hint.startswith("probably the magnet is upside down (set magnet_north to the other pole): the rows then")
    assert better > 1e3
    # forces of other rows belong to no unit, though small ones contradict the readings less
    shuffled[:, 3:6] = 3 + rng.permutation(rows[:, 3:6])
    assert " not in N" not in calibration_study.mistaken(sensor, shuffled, np.zeros(16), ("S1", "S2", "S3"))[0]


def test_held_out_runs_are_not_trained_on(simulated):
    sensor, shift, rng = simulated
    rows = rows_of(sensor, sensor.unknowns.mean, shift, rng)
    run = np.repeat(["a", "b", "c"], [20, 15, 5])
    # another load cell in run b, which no other row knows of
    rows[run == "b", 3:6] *= 2
    made = bench_file.Bench(pd.DataFrame({"run": run}), ("S1", "S2", "S3"), [])
    names, trained, tested = zip(*force_regression.folds(made, np.arange(2, 40)), strict=True)
    assert names == ("a", "b", "c")
    for train, test in zip(trained, tested, strict=True):
        assert len(set(run[test])) == 1
        assert set(run[train]).isdisjoint(run[test])
        assert sorted([*train, *test]) == list(range(2, 40))
    _, _, force = calibration_study.held_out(
        sensor, rows, np.zeros(40), made, np.flatnonzero(run != "c"), 9.0, lambda *_: None
    )
    assert force[run == "a", 2] == pytest.approx(2 * rows[run == "a", 5], rel=0.2)
    assert force[run == "b", 2] == pytest.approx(rows[run == "b", 5] / 2, rel=0.2)


@pytest.mark.parametrize("layout", ["three", "tmag5273a1"])
def test_the_decoder_of_an_estimated_sensor_inverts_what_it_predicts(layout):
    """Unknowns drawn from twice their priors; readings at another temperature."""
    chips = {"chip_count": 2, "chip_x": 3} if layout != "three" else {}
    design = dataclasses.replace(paper(), hall_layout=layout, **chips)
    rng = np.random.default_rng(4)
    law = mechanics_sources.of_surrogate(design).law
    names = parts.columns(parts.of_design(design))
    table = pd.DataFrame({name: np.ones(1) for name in (*names, "Fz_N", "temperature_C")} | {"run": "a"})
    un = sensor_fit.unknowns_of(design, bench_file.Bench(table, tuple(names), []), tolerances())
    sensor = sensor_fit.Sensor(design, law, un, np.full(len(names), READING_NOISE), FORCE_NOISE)
    theta = un.mean + 2 * un.deviation * rng.uniform(-1, 1, len(un.mean))
    found = sensor_fit.Fit(sensor, theta, 1e-12 * np.eye(len(theta)), np.zeros((0, 3)), np.zeros((0, 3)), 1.0, 1)
    w = -law.sink * rng.uniform(0.1, 0.8, 50)
    shift = np.column_stack([law.reach * rng.uniform(-0.4, 0.4, (2, 50)).T * np.sqrt(-w / law.sink)[:, None], w])
    warmer = rng.uniform(-10, 10, 50)
    predicted = sensor.predict(theta, shift, warmer)
    decoded = calibrated_forces.decode(found, predicted[:, : len(names)], warmer)
    known = np.array(decoded.status) == "ok"
    assert known.sum() > 40
    assert decoded.shift[known] == pytest.approx(shift[known], abs=1e-7)
    assert decoded.force[known] == pytest.approx(predicted[known, len(names) : len(names) + 3], abs=1e-6)


def test_remanence_and_gains_move_against_each_other_and_leave_the_force_alone(simulated):
    sensor, shift, rng = simulated
    un = sensor.unknowns
    wide = np.array([0.1 if name == "remanence" or name.startswith("gain") else 0.0 for name in un.names])
    sensor = dataclasses.replace(sensor, unknowns=dataclasses.replace(un, deviation=wide))
    found = sensor_fit.fit(sensor, rows_of(sensor, un.mean, shift, rng), np.zeros(len(shift)))
    assert (
        "these rows hardly tell remanence from gain_S1, gain_S2, gain_S3 (correlation 1.00 in size), but the decoded "
        "force does not depend on that"
    ) in calibration_study.sentences(found)
