"""Forces of a silicone that relaxes against exact solutions and finite elements in time; rows that are suspicious."""

import csv
import dataclasses
import math

import numpy as np
import pytest
from conftest import ROUGH
from numpy.testing import assert_allclose

from analytic.decode import decoder
from analytic.inverse.forward_model import readings_with_slopes
from analytic.stream import Stream
from analytic.time_series import RelaxingForce, TimeSeries, over_time, zero_offset
from fem.analyses.timed_path import TimeControl, TimedLoad, follow
from fem.equilibrium import solve
from geometry.design import Design
from geometry.loads import Load
from studies.sensing.decode_readings import of_level

BRANCH = Design(prony="0.4:2", modulus="long-term")


def forces(design, times, slow, shear=(0.0, 0.0)):
    law = RelaxingForce(design)
    return np.array(
        [law.step(time, np.array(force), np.array(shear)) for time, force in zip(times, slow, strict=True)]
    )


def test_a_ramp_of_one_branch_is_exact_in_steps_of_any_length():
    """F = v t + v g / rest tau (1 - exp(-t / tau))."""
    for times in (np.linspace(0, 3, 2), np.geomspace(0.01, 3, 40)):
        times = np.unique(np.append(0, times))
        found = forces(BRANCH, times, np.outer(times, [0, 0, 5.0]))
        exact = 5 * times + 5 * 0.4 / 0.6 * 2 * (1 - np.exp(-times / 2))
        assert_allclose(found[:, 2], exact, rtol=1e-12)


def test_limits_are_the_slow_and_the_fast_modulus():
    slow, fast = (forces(BRANCH, [0, time], [[0, 0, 0], [0, 0, 3.0]])[-1, 2] for time in (1e9, 1e-9))
    assert_allclose([slow, fast], [3, 3 / 0.6], rtol=1e-6)
    assert_allclose(forces(BRANCH, [0, 0], [[0, 0, 0], [0, 0, 3.0]])[-1, 2], 3 / 0.6, rtol=1e-9)
    instantaneous = dataclasses.replace(BRANCH, modulus="instantaneous")
    assert_allclose(forces(instantaneous, [0, 1e-9], [[0, 0, 0], [0, 0, 3.0]])[-1, 2], 3, rtol=1e-6)
    elastic = Design(loss_factor=0.0)
    assert_allclose(forces(elastic, [0, 1], [[0, 0, 0], [1, 0, 3.0]], (0.5, 0))[-1], [1, 0, 3], rtol=1e-12)


def test_a_row_without_a_force_is_bridged_and_old_errors_are_forgotten():
    bridged = forces(BRANCH, [0, 1, 2], [[0, 0, 0], [math.nan] * 3, [0, 0, 2.0]])
    assert np.isnan(bridged[1]).all()
    assert_allclose(bridged[2], forces(BRANCH, [0, 2], [[0, 0, 0], [0, 0, 2.0]])[1], rtol=1e-12)
    wrong = forces(BRANCH, [0, 1, 2, 60], [[0, 0, 0], [0, 0, 9.0], [0, 0, 2.0], [0, 0, 2.0]])
    assert_allclose(wrong[-1, 2], 2, rtol=1e-9)


def test_press_and_shear_of_finite_elements_in_time():
    """The slow forces at the same places give those of a fast press and shear of a long beam, which lean most."""
    design, depth, shear = Design(L=14.0, l0=12.2), 0.8, 0.7
    loads = [Load(depth), Load(depth, shear, friction="stick")]
    path = [TimedLoad(0.1, dataclasses.replace(loads[0], friction="stick")), TimedLoad(0.2, loads[1])]
    reached = list(follow(design, path, ROUGH, steps=TimeControl(1e-2), every_step=True))
    depths = np.linspace(0, depth, 6)
    presses = [0.0, *(solve(design, Load(each), ROUGH).response.force[2] for each in depths[1:])]
    sheared = solve(design, loads[1], ROUGH).response.force
    law, missed = RelaxingForce(design), []
    law.step(0.0, np.zeros(3), np.zeros(2))
    for state in reached:
        share = state.solution.load.shear_x / shear
        pressed = np.array([0.0, 0.0, np.interp(state.solution.load.depth, depths, presses)])
        slow = pressed + (sheared - pressed) * [share, 0, share**2] if share else pressed
        found = law.step(state.time, slow, np.array([state.solution.load.shear_x, 0.0]))
        missed.append(np.abs(found - state.solution.response.force))
    largest = np.abs([state.solution.response.force for state in reached]).max(axis=0)
    assert (np.max(missed, axis=0)[[0, 2]] < 0.03 * largest[[0, 2]]).all()
    # slow loading misses much more, also along the shear
    assert largest[2] > 1.3 * presses[-1]
    assert largest[0] > 1.3 * sheared[0]


def coder_of(**fields):
    design = Design(**fields)
    return decoder(design, of_level(design, "finite"))


def rows_at(coder, depth):
    return readings_with_slopes(coder.forward, np.array([np.zeros_like(depth), np.zeros_like(depth), -depth]))[0].T


def words(coder, times, rows):
    past = TimeSeries(coder)
    rest = np.zeros((1, 3))
    return [past.step(time, row[None], ["ok"], rest, rest)[0][0] for time, row in zip(times, rows, strict=True)]


def test_rows_that_repeat_are_missing_or_jump_are_marked():
    coder, times = coder_of(hall_noise=0.002), np.arange(400) / 100
    noise = np.random.default_rng(3).normal(0, coder.sigma, (400, 3))
    rows = rows_at(coder, 0.3 * np.sin(2 * np.pi * times) ** 2) + noise
    assert set(words(coder, times, rows)) == {"ok"}
    repeated = rows.copy()
    repeated[100:, 1] = rows[100, 1]
    found = words(coder, times, repeated)
    assert found[:119] == ["ok"] * 119
    assert set(found[119:]) == {"frozen"}
    late = times + 0.05 * (times > 2)
    assert [k for k, word in enumerate(words(coder, late, rows)) if word != "ok"] == [201]
    jumped = rows.copy()
    jumped[250:] += 0.01
    assert [k for k, word in enumerate(words(coder, times, jumped)) if word == "jump"] == [250]


def test_a_row_after_one_without_a_force_says_so():
    past, times = TimeSeries(coder_of()), (0.0, 0.1, 0.2, 0.3)
    found = []
    for time, force in zip(times, (0.0, math.nan, 1.0, 1.0), strict=True):
        status = "saturated" if math.isnan(force) else "ok"
        found += past.step(time, np.full((1, 3), 0.01 + time), [status], np.full((1, 3), force), np.zeros((1, 3)))[0]
    assert found == ["ok", "saturated", "after_gap", "ok"]


def test_a_stream_with_times_is_the_table_and_zero_removes_an_offset(run, tmp_path):
    coder = coder_of()
    times = np.linspace(0, 1, 21)
    fields = rows_at(coder, 0.25 * np.clip(times - 0.2, 0, 1)) + np.array([0.001, -0.002, 0.0005])
    # moved by the zero, it would be no rail any more
    fields[-1, 0] = coder.goal.rails[0, 1]
    path, out = tmp_path / "rows.csv", tmp_path / "found.csv"
    rows_of = list(zip(times.tolist(), fields.tolist(), strict=True))
    path.write_text("time_s,S1_T,S2_T,S3_T\n" + "".join(f"{t!r},{x!r},{y!r},{z!r}\n" for t, (x, y, z) in rows_of))
    tokens = ("--level", "finite", "--units", "T", "--zero", "0,0.2", "--out", out)
    status, _, err = run("decode", "paper", "--file", path, *tokens)
    assert status == 3
    assert "loss factor of 0.1 is an assumption" in err
    with out.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    stream = Stream(coder)
    stream.zero(fields[:5])
    found = [stream.step(tuple(row), time) for time, row in rows_of]
    columns = [[float(row[f"force_{axis}_N"] or "nan") for axis in "xyz"] for row in rows]
    assert_allclose(columns, [sample.force for sample in found], atol=1e-9)
    assert [rows[-1]["status"], found[-1].status] == ["saturated"] * 2
    assert abs(found[4].force[2]) < 1e-6
    last = rows[-2]
    assert float(last["force_z_N"]) > float(last["relaxing_z_N"]) > float(last["law_error_N"]) > 0
    assert_allclose(zero_offset(coder, fields[:5]), [-0.001, 0.002, -0.0005], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "tokens", "words"),
    [
        ("time_s,S1_V,S2_V,S3_V\n1,3,3,3\n0,3,3,3\n", (), "row 2: time_s must be a number of s, not below"),
        ("time_s,S1_V,S2_V,S3_V\n0,3,3,3\n1,3,3,3\n", ("--zero", "2,3"), "no row with readings lies in this time"),
        ("time_s,S1_V,S2_V,S3_V\n0,3,3,3\n1,3,3,3\n", ("--zero", "1,2,3"), "takes times FROM,TO"),
        ("time_s,S1_V,S2_V,S3_V\n0,3,3,3\n1,3,3,3\n", ("--zero", "0"), "takes no row for rest, since the first one"),
        ("S1_V,S2_V,S3_V\n3,3,3\n", ("--zero", "0,1"), "has no column time_s"),
    ],
)
def test_bad_times_are_a_sentence(refusal, tmp_path, text, tokens, words):
    path = tmp_path / "rows.csv"
    path.write_text(text, encoding="utf-8")
    assert words in refusal("decode", "paper", "--file", path, *tokens)


def test_the_slow_force_of_a_row_without_a_time_misses_its_force_by_its_reach_at_most():
    """Whatever the speed, after any motion."""
    rng = np.random.default_rng(4)
    design = Design(prony="0.2:0.01 0.3:1 0.1:100")
    for _ in range(20):
        law, time, closest = RelaxingForce(design), 0.0, 0.0
        law.step(time, np.zeros(3), np.zeros(2))
        for _ in range(30):
            time += 10 ** rng.uniform(-6, 4)
            force, shear = rng.normal(size=3), 0.3 * rng.normal(size=2)
            off = np.linalg.norm(law.step(time, force, shear) - law.slow * force)
            assert off <= law.reach(force, shear) * (1 + 1e-9)
            closest = max(closest, off / law.reach(force, shear))
        assert closest > 0.3
        assert law.step(math.nan, force, shear).tolist() == (law.slow * force).tolist()


def test_rows_without_times_are_checked_and_the_next_one_is_after_a_gap():
    coder = decoder(Design())
    rng, rest = np.random.default_rng(1), np.array([0.01, 0.02, 0.03])
    past, rows = TimeSeries(coder), rest + 1e-6 * rng.normal(size=(20, 3))
    rows[15] += 0.02
    times = [*[math.nan] * 17, 0.0, 0.1, 0.2]
    rows, force, load = rows[:, None], np.ones((1, 3)), np.zeros((1, 3))
    found = [past.step(time, row, ["ok"], force, load)[0][0] for time, row in zip(times, rows, strict=True)]
    assert found == [*["untimed"] * 15, "jump", "untimed", "after_gap", "ok", "ok"]


def test_rows_of_sensors_that_come_together_are_those_of_each_alone():
    coder, rng = decoder(Design(hall_noise=0.002)), np.random.default_rng(2)
    rows = np.array([0.01, 0.02, 0.03]) + coder.sigma * rng.normal(size=(60, 3, 3))
    times, force = np.arange(60) / 100 + 0.1 * (np.arange(60) > 50), np.cumsum(rng.normal(size=(60, 3, 3)), axis=0)
    rows[20, 0] += 0.05
    rows[30:, 1] = rows[30, 1]
    force[40, 2] = math.nan
    statuses, load = ["ok"] * 3, 0.1 * force
    together = TimeSeries(coder, sensors=3)
    found = [together.step(times[k], rows[k], statuses, force[k], load[k]) for k in range(60)]
    assert {"jump", "frozen", "after_gap"} <= {word for words, _ in found for word in words}
    for k in range(3):
        words, total = over_time(coder, times, rows[:, k], ["ok"] * 60, force[:, k], load[:, k])
        assert words == [words_of[k] for words_of, _ in found]
        assert_allclose(total, [total_of[k] for _, total_of in found])
