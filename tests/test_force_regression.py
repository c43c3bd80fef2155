"""Forces by regressions: scikit-learn, coverage and range on random sensors, files, verbs, and the header in C."""

import dataclasses
import json
import math

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler
from test_firmware import needs, run_sketch

from geometry.design import BadInput, Design, paper
from studies.calibration import (
    bench_file,
    calibration_file,
    calibration_study,
    force_regression,
    regression_study,
    sensor_fit,
)
from studies.firmware import regression_export
from studies.firmware.decoder_export import STATUSES
from studies.inputs.option_groups import Streaming
from studies.parts.part_tolerances import tolerances
from studies.streaming import live_stream
from studies.validation.devices import firmware_check
from studies.validation.devices.calibration_check import FORCE_NOISE, READING_NOISE

pytestmark = pytest.mark.calibrates

NAMES = ["S1_V", "S2_V", "S3_V"]
FORCES = ["Fx_N", "Fy_N", "Fz_N"]


@pytest.fixture(scope="module")
def sensor():
    """The paper's sensor with its priors."""
    law, _, error = calibration_study.mechanics_of(paper(), None)
    table = pd.DataFrame({name: np.ones(4) for name in ("S1", "S2", "S3", "Fz_N")} | {"run": "a"})
    made = bench_file.Bench(table, ("S1", "S2", "S3"), [])
    un = sensor_fit.unknowns_of(paper(), made, tolerances(), model_error=error)
    return sensor_fit.Sensor(paper(), law, un, np.full(3, READING_NOISE), FORCE_NOISE)


def presses(sensor, theta, count, rng, deepest=0.8, rest=0):
    """Readings and measured forces (n, 6) of presses and shears of a sensor, the first ones at rest."""
    law = sensor.mechanics
    w, angle = -law.sink * rng.uniform(0.03, deepest, count), rng.uniform(0, 2 * np.pi, count)
    u = law.reach * rng.uniform(0, 0.6, count) * np.sqrt(-w / law.sink)
    shift = np.stack([u * np.cos(angle), u * np.sin(angle), w], axis=1)
    shift[:rest] = 0
    rows = sensor.predict(theta, shift, np.zeros(count))[:, :6]
    return rows + np.repeat([READING_NOISE, FORCE_NOISE], 3) * rng.normal(size=rows.shape)


def bench_of(sensor, theta, count, runs, rng, **kinds):
    """A bench of a sensor, its rows in some runs."""
    rows = pd.DataFrame(presses(sensor, theta, count, rng, **kinds), columns=[*NAMES, *FORCES])
    return rows.assign(run=np.arange(count) * runs // count)


def compared(table, design=None, **more):
    made = table.rename(columns=dict(zip(NAMES, ("S1", "S2", "S3"), strict=True)))
    recorded = calibration_study.rows_of(design or paper(), bench_file.Bench(made, ("S1", "S2", "S3"), []))
    return regression_study.compared(design or paper(), recorded, FORCE_NOISE, **more)


@pytest.fixture(scope="module")
def taught(sensor):
    """A bench of 40 rows in four runs, the first four at rest, and its regression."""
    rng = np.random.default_rng(2)
    table = bench_of(sensor, sensor.unknowns.mean, 40, 4, rng, rest=4).assign(temperature_C=21.0)
    return table, compared(table).found


@pytest.fixture
def written(taught, tmp_path):
    """The file of a regression."""
    path = tmp_path / "calibration.json"
    path.write_text(calibration_file.regression_text(taught[1], None), "utf-8")
    return path


@pytest.mark.parametrize("degree", [1, 2])
def test_force_and_leverage_are_those_of_scikit_learn(taught, degree):
    X, F = taught[0][NAMES].to_numpy(), taught[0][FORCES].to_numpy()
    law = force_regression.fit(X, F, degree)
    terms = make_pipeline(StandardScaler(), PolynomialFeatures(degree, include_bias=False)).fit(X)
    known = Ridge(alpha=law.penalty).fit(terms.transform(X), F)
    asked = X + 0.01
    assert_allclose(law.force(asked), known.predict(terms.transform(asked)), rtol=1e-8)
    # the variance of a prediction over that of a row, with a prior of the weights of variance 1 / penalty
    T = terms.transform(X) - terms.transform(X).mean(axis=0)
    t = terms.transform(asked) - terms.transform(X).mean(axis=0)
    A = np.linalg.inv(T.T @ T + law.penalty * np.eye(T.shape[1]))
    assert_allclose(law.leverage(asked), 1 / 40 + np.einsum("ni,ij,nj->n", t, A, t), rtol=1e-6)
    assert law.freedom == pytest.approx(39 - np.trace(T @ A @ T.T), rel=1e-8)


@pytest.mark.parametrize(("count", "runs"), [(16, 1), (60, 3)])
def test_intervals_hold_on_rows_of_random_sensors_and_rows_beyond_the_bench_have_none(sensor, count, runs):
    un, rng = sensor.unknowns, np.random.default_rng(7)
    inside, stated, beyond, within = [], [], [], []
    for _ in range(20):
        theta = un.mean + un.deviation * rng.normal(size=len(un.mean))
        one = compared(bench_of(sensor, theta, count, runs, rng))
        rows = presses(sensor, theta, 200, rng)
        words, force, half = one.found.decode(rows[:, :3], np.full(200, np.nan))
        known = np.array(words) == "ok"
        within.append(known.mean())
        assert (np.isfinite(half).all(axis=1) == known).all()
        inside.append((np.abs(force - rows[:, 3:]) <= half)[known].mean(axis=0))
        stated.append(one.rows[one.found.law.degree - 1]["inside_percent"] / 100)
        deep = presses(sensor, theta, 50, rng, deepest=0.999)
        far = deep[:, 5] > 1.1 * one.found.forces[1, 2]
        words, _, half = one.found.decode(deep[far, :3], np.full(far.sum(), np.nan))
        beyond += words
        assert np.isnan(half[np.array(words) == "out_of_range"]).all()
    # without leverage, or with a normal quantile, those of 16 rows hold for 78 and 84 %
    assert (np.abs(np.mean(inside, axis=0) - 0.9) < 0.06).all()
    # those of parts of a few rows are wide
    assert 0.85 < np.mean(stated) < 0.97
    assert np.mean(within) > 0.7
    assert len(beyond) > 50
    assert beyond.count("out_of_range") > 0.95 * len(beyond)


def test_rest_is_out_of_range_of_a_rough_bench_without_rest_and_its_own_rows_are_within(taught):
    pressed = taught[0][taught[0].Fz_N > 2.5]
    # so rough that the interval at rest reaches the lightest press
    off = 0.5 * np.random.default_rng(0).normal(size=(len(pressed), 3))
    found = compared(pressed.assign(**dict(zip(FORCES, (pressed[FORCES] + off).to_numpy().T, strict=True)))).found
    still = taught[0][NAMES].to_numpy()[:4]
    (words, force, _), half = found.decode(still, np.full(4, 21.0)), found.half_widths(still)
    assert (force[:, 2] + half[:, 2] > found.forces[0, 2]).all()
    assert (found.distance(still) < found.farthest).all()
    assert words == ["out_of_range"] * 4
    assert set(found.decode(pressed[NAMES].to_numpy(), np.full(len(pressed), 21.0))[0]) == {"ok"}


def test_a_file_gives_the_same_decoder_and_other_shapes_are_refused(taught, written):
    found, readings = taught[1], taught[0][NAMES].to_numpy()
    nowhere = np.full(len(readings), np.nan)
    back = calibration_file.read_any(written)
    own, same = found.decode(readings, nowhere), back.decode(readings, nowhere)
    assert own[0] == same[0]
    assert_allclose(own[1:], same[1:], rtol=1e-12)
    record = json.loads(written.read_text())

    def refused(**changes):
        changed = record | changes
        signed = changed | {"digest": calibration_file.digest_of(changed)} if changes else changed | {"rows": 41}
        written.write_text(json.dumps(signed))
        with pytest.raises(BadInput) as error:
            calibration_file.read_any(written)
        return str(error.value)

    assert "was edited, since its digest does not match" in refused()
    for name in ("decoder", "degree", "rows", "penalty", "farthest", *force_regression.SHAPES):
        for value in ("a", None, [], {}, [[1.0]], math.inf, 0.5, [None, None]):
            if (name, value) not in [("penalty", 0.5), ("farthest", 0.5), ("temperature_C", [None, None])]:
                assert "is no calibration" in refused(**{name: value}), (name, value)
    assert "constant, covariance, held_out and forces must be" in refused(held_out=[None, 0.1, 0.1])


def test_a_component_that_was_not_measured_stays_unknown_and_rows_without_a_force_tell_nothing(taught, tmp_path):
    table = taught[0].drop(columns=["Fx_N", "Fy_N"])
    found = compared(table).found
    (tmp_path / "calibration.json").write_text(calibration_file.regression_text(found, None))
    back = calibration_file.read_any(tmp_path / "calibration.json")
    words, force, half = back.decode(table[NAMES].to_numpy(), np.full(40, np.nan))
    assert words == ["ok"] * 40
    assert np.isnan(force[:, :2]).all()
    assert np.isnan(half[:, :2]).all()
    assert np.isfinite(force[:, 2]).all()
    assert np.isfinite(half[:, 2]).all()
    none = force_regression.fit(table[NAMES].to_numpy(), np.full((40, 3), np.nan), 1)
    assert np.isnan(none.force(table[NAMES].to_numpy())).all()


def test_a_bench_becomes_a_regression_for_decode_and_stream(taught, sensor, run, strict, tmp_path, monkeypatch):
    monkeypatch.setattr(calibration_study, "SIZES", ())
    table, out, path = taught[0], tmp_path / "out", tmp_path / "bench.csv"
    table.assign(run=np.arange(40) // 20).to_csv(path, index=False)
    status, text, err = run("calibrate", "paper", path, "--decoder", "regression", "--out", out, "--json")
    assert status == 0, err
    (record,) = strict(text)
    assert (record["decoder"], record["rows"], record["runs"]) == ("regression", 40, 2)
    errors = {row["method"]: row for row in record["decoders"]}
    assert [row["written"] for row in record["decoders"]].count("yes") == 1
    assert errors["calibration"]["rmse_z_N"] < errors["quadratic ridge"]["rmse_z_N"]
    assert "the model of the sensor decodes held-out rows" in err
    page = (out / "CALIBRATION.md").read_text("utf-8")
    assert f"magtip calibrate paper {path} --out {out}" in page
    assert "| calibration | 40 |" in page
    file = out / "calibration.json"
    # a drift of the elements is removed by a zero; a row at a rail, one without a reading, one beyond the bench
    rows = presses(sensor, sensor.unknowns.mean, 30, np.random.default_rng(5), rest=6)
    late = rows[:, :3] + [0.02, -0.01, 0.01]
    late[10, 0], late[12, 1], late[14] = 5.0, np.nan, late[14] + 0.2
    times = np.arange(30.0)
    columns = pd.DataFrame(late, columns=NAMES).assign(time_s=times, temperature_C=np.where(times == 20, 40.0, 21.5))
    columns.to_csv(tmp_path / "rows.csv", index=False)
    words = ("--calibration", file, "--file", tmp_path / "rows.csv", "--zero", "0,5", "--out", tmp_path / "f.csv")
    status, _, err = run("decode", "paper", *words)
    assert status == 0, err
    assert "what the silicone relaxes is not known" in err
    decoded = pd.read_csv(tmp_path / "f.csv")
    good = decoded.status.to_numpy() == "ok"
    assert good.sum() > 15
    assert decoded.status[[10, 12, 14, 20]].tolist() == ["saturated", "not_finite", "out_of_range", "out_of_range"]
    off = np.abs(decoded[["force_x_N", "force_y_N", "force_z_N"]].to_numpy() - rows[:, 3:])
    half = decoded[["half_width_x_N", "half_width_y_N", "half_width_z_N"]].to_numpy()
    assert (off <= half)[good].mean() > 0.8
    assert np.isnan(half[[10, 12, 14, 20]]).all()
    assert np.isfinite(decoded.force_z_N[[14, 20]]).all()
    assert decoded[["shift_z_mm", "relaxing_z_N", "law_error_N"]].isna().all(axis=None)
    # row by row alike
    live = live_stream.Live(paper(), Streaming(port=str(tmp_path / "rows.csv"), calibration=file, rest=5.5))
    source = live_stream.source_of(paper(), Streaming(port=str(tmp_path / "rows.csv"), speed=0.0))
    arrived = [row for batch in source.rows() for row in live.rows(batch)]
    assert [row["status"] for row in arrived] == decoded.status[6:].tolist()
    assert_allclose([row["half_width_x_N"] for row in arrived], half[6:, 0], rtol=1e-9)
    assert "temperature" not in " ".join(live.remarks)
    # one reading, without a temperature
    text, err = run("decode", "paper", "--calibration", file, "--readings", "2.95,2.85,2.85", "--json")[1:]
    assert strict(text)[0]["shift_mm"] == [None] * 3
    assert "temperature of 1 of 1 rows is not known: their intervals hold from 21 to 21 C" in err
    words = ("firmware", "paper", "--calibration", file, "--out", tmp_path / "library")
    (record,) = strict(run(*words, "--json")[1])
    assert record["held_out_N"] == pytest.approx([errors["quadratic ridge"][f"rmse_{axis}_N"] for axis in "xyz"])
    assert "--flash 2k is too small: this regression takes" in run(*words, "--flash", "2k")[2]


def test_what_a_regression_does_not_know_is_refused_or_said(taught, written, sensor, refusal, run, tmp_path):
    for words in (["readings"], ["cycle", "--depth", "1", "--speed", "1"], ["explore"]):
        assert "holds a regression, which knows neither" in refusal(
            words[0], "paper", *words[1:], "--calibration", written
        )
    assert "another design, whose D" in refusal(
        "decode", "paper", "--calibration", written, "--readings", "3,3,3", "--set", "D=9"
    )
    bare = dataclasses.replace(taught[1], rest=np.full(3, np.nan))
    written.write_text(calibration_file.regression_text(bare, None))
    taught[0].assign(time_s=np.arange(40.0))[["time_s", *NAMES]].to_csv(tmp_path / "rows.csv", index=False)
    sentence = "a regression whose bench has no row at rest"
    words = ("--calibration", written, "--zero")
    assert sentence in refusal("decode", "paper", "--file", tmp_path / "rows.csv", *words, "0,3")
    assert sentence in refusal("stream", "paper", "--port", tmp_path / "rows.csv", *words, "3")
    # a zero of a pressed sensor
    pressed = taught[0][NAMES].to_numpy()[taught[0].Fz_N > 5]
    assert "N along z, more than the interval" in taught[1].zero_doubts(taught[1].zero_offset(pressed))[0]
    assert taught[1].zero_doubts(taught[1].zero_offset(taught[0][NAMES].to_numpy()[:4])) == []


@pytest.mark.parametrize(
    ("rows", "sentence"),
    [
        (slice(4, 9), "5 rows with all readings and measured forces are too few for a linear regression of 3"),
        (slice(0, 13), "without 0, of 13 rows 3 are left for a regression"),
    ],
)  # fmt: skip
def test_too_few_rows_are_one_sentence(taught, rows, sentence):
    with pytest.raises(BadInput, match=sentence):
        compared(taught[0].iloc[rows])


def test_the_errors_of_one_run_are_those_of_its_parts_which_is_said(taught):
    one = compared(taught[0].assign(run="a").iloc[:20])
    found = regression_study.result(one, "no mechanics", "magtip calibrate", calibration_study.figures)
    assert found.warnings[0] == regression_study.ONE_RUN
    # which no decoded force shows, so that decode does not repeat it
    assert "one run" not in found.files["calibration.json"].keywords["text"]
    assert "the model of the sensor does not decode these rows: no mechanics" in found.pages["CALIBRATION.md"]


def chips(rng):
    """A linear regression of the nine readings of three chips, whose bench had no rest and no temperatures."""
    design = Design(hall_layout="tmag5273a1", chip_count=3, chip_x=3)
    X = 0.01 * rng.normal(size=(60, 9))
    F = X @ rng.normal(size=(9, 3)) * [50, 50, 200] + 0.05 * rng.normal(size=(60, 3))
    parts = [
        (str(k), np.flatnonzero(np.arange(60) % 3 != k), np.flatnonzero(np.arange(60) % 3 == k)) for k in range(3)
    ]
    nothing = np.full(60, np.nan)
    return force_regression.regression(
        design, X, F, force_regression.held_out(X, F, parts, 1), np.zeros(60, dtype=bool), nothing
    )


def with_header(found, folder):
    made, told = regression_export.texts(found, "magtip firmware")
    (folder / "magtip_decoder.h").write_text(made["src/magtip_decoder.h"], "utf-8")
    return made, told


@needs("gcc")
@pytest.mark.parametrize("kind", ["quadratic", "nine linear"])
def test_the_header_in_c_answers_as_python(taught, kind, tmp_path):
    rng = np.random.default_rng(3)
    found = taught[1] if kind == "quadratic" else chips(rng)
    assert found.words.split()[0] == kind.split()[-1]
    made, told = with_header(found, tmp_path)
    assert "double" not in made["src/magtip_decoder.h"]
    assert [line for line in made["src/magtip_decoder.h"].splitlines() if len(line) > 120] == []
    assert told["force_percent"] < 0.01
    program = firmware_check.compiled(tmp_path, "gcc", [*firmware_check.STRICT, "-O0"])
    readings = regression_export.readings_near(found, 600, rng)
    readings[:3] = [[5.0] * len(found.rest), [np.nan] * len(found.rest), found.law.centre]
    celsius = np.where(np.arange(600) % 4, 21.0, np.where(np.arange(600) % 8, np.nan, 30.0))
    warm = celsius if found.is_thermal else None
    expected = regression_export.reference(found, readings, None, warm)
    answer = firmware_check.answers(program, readings, None, warm)
    words = np.array(expected["status"])
    assert (np.array(STATUSES)[answer["status"]] == words).all()
    assert set(words) == {"ok", "out_of_range", "saturated", "not_finite"}
    assert_allclose(answer["force"], expected["force"], atol=1e-4 * np.abs(found.forces).max())
    assert_allclose(answer["half_width"], expected["half_width"], rtol=1e-3)
    # a series with gaps, a wrong row, an element that repeats
    series, seconds = found.law.centre + 0.02 * np.outer(np.sin(np.arange(90) / 9), np.ptp(found.span, axis=0)), 0.01
    series[40], series[60, 0] = series[40] + 0.3 * np.ptp(found.span, axis=0), np.nan
    series[65:] = series[65]
    times = seconds * np.arange(90) + 0.5 * (np.arange(90) >= 30)
    timed = regression_export.reference(found, series, times, np.full(90, 21.0))
    steps = np.diff(times, prepend=0.0)
    answer = firmware_check.answers(program, series, steps, np.full(90, 21.0) if found.is_thermal else None)
    assert (np.array(STATUSES)[answer["status"]] == np.array(timed["status"])).all()
    assert {"after_gap", "jump"} <= set(timed["status"])


@needs("g++")
def test_the_self_test_of_the_library_agrees(taught, tmp_path):
    for file, text in regression_export.texts(taught[1], "magtip firmware")[0].items():
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text(text)
    assert run_sketch(tmp_path, "SelfTest").startswith("wrong statuses: 0,")
    assert "zero: " in run_sketch(tmp_path, "AnalogElements")


@needs("arm-none-eabi-gcc", "qemu-system-arm")
def test_the_header_takes_the_flash_and_ram_that_it_states(taught, tmp_path):
    _, told = with_header(taught[1], tmp_path)
    program, flash, ram = firmware_check.for_target(tmp_path)
    assert told["table_bytes"] < flash <= told["table_bytes"] + told["code_bytes"]
    assert told["state_bytes"] <= ram
    readings = regression_export.readings_near(taught[1], 20, np.random.default_rng(1))
    answer = firmware_check.answers(program, readings, None, np.full(20, 21.0))
    assert answer["stack"].max() < 512
    expected = regression_export.reference(taught[1], readings)
    assert (np.array(STATUSES)[answer["status"]] == np.array(expected["status"])).all()
