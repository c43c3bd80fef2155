"""The verbs stability, modes, response and cycle: numbers, files, doubts and refusals."""

import csv
import dataclasses
import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from analytic import hall
from analytic.oscillator import receptance
from analytic.relaxation_loops import loop
from fem.accuracy import QUICK
from fem.analyses.timed_path import TimedState
from fem.analyses.vibration import vibrating_sensor
from fem.equilibrium import trace
from fem.solution import Solution
from geometry.design import BadInput, paper
from geometry.loads import Load, Response
from geometry.relaxation import Relaxation, relaxation_of
from studies.mechanics.cycle_motion import Motion, frequency_of, stops
from studies.mechanics.loading_cycles import Cycles, CycleState, Static, loops_of
from studies.mechanics.resonance_peaks import bandwidth, flat_to, peaks
from studies.simulation import response_curves, vibration_report
from studies.simulation.cycle_findings import doubts


def test_stability_says_when_and_how_stiff(run, strict):
    status, out, _ = run("stability", "paper", "--set", "L=24", "--depth", 0.5, "--accuracy", "quick", "--json")
    assert status == 0
    (record,) = strict(out)
    assert 0.8 < record["critical_depth_mm"] < 0.95
    assert record["guided_critical_depth_mm"] is None or record["guided_critical_depth_mm"] > 1.5
    assert record["stiffness_N_per_mm"] > 0
    assert 0 < record["shift_per_mm"] < 1
    assert 0 < record["tilt_rad_per_mm"] < 0.2


def test_modes_are_named_and_judged(run, strict):
    status, out, _ = run("modes", "paper", "--count", 4, "--accuracy", "quick", "--json")
    assert status == 0
    (record,) = strict(out)
    assert record["shape"] == ["bending", "torsion", "axial", "bending"]
    assert record["frequency_Hz"] == sorted(record["frequency_Hz"])
    assert "bending" in record["message"]


def test_bad_modes_are_a_sentence(refusal):
    for tokens in (
        ("modes", "paper", "--count", 0),
        ("modes", "paper", "--depth", 8),
        ("stability", "paper", "--depth", 0),
    ):
        refusal(*tokens)


def test_a_press_that_stops_is_a_failed_solve_that_keeps_what_was_found(run, strict, monkeypatch):
    from fem.analyses import modes, small_shear, stability

    def stops(*_, **__):
        raise BadInput("the press stops at depth 6.2 mm: take a smaller depth")

    monkeypatch.setattr(stability, "critical", lambda *_, **__: stability.Critical(0.9, 1.0, 0.89, ""))
    monkeypatch.setattr(small_shear, "small_shear", stops)
    monkeypatch.setattr(modes, "modes", stops)
    for verb, kept in (("stability", "critical_depth_mm"), ("modes", "spring_mass_Hz")):
        status, out, err = run(verb, "paper", "--depth", 6.99, "--json")
        (record,) = strict(out)
        assert (status, record["status"] != "ok") == (3, True)
        assert record[kept] > 0
        assert "take a smaller depth" in record["message"]
        assert "take a smaller depth" in err


def test_stiffness_beyond_the_critical_depth_says_so(monkeypatch):
    from fem.analyses import small_shear, stability
    from fem.solution import Estimates
    from geometry.design import paper
    from studies.simulation import critical_depths

    estimates = Estimates(depth=0.01, force=0.02)
    found = {
        False: stability.Critical(0.9, 1.0, 0.9, "", estimates),
        True: stability.Critical(None, None, 3.5, ""),
    }
    monkeypatch.setattr(stability, "critical", lambda *_, guided=False, **__: found[guided])
    monkeypatch.setattr(small_shear, "small_shear", lambda *_, **__: small_shear.SmallShear(1.0, 0.5, 0.1, 1.0, 1.0))
    below, beyond = (
        critical_depths.at_design(paper(), "rigid", "quick", depth, lambda *_: None) for depth in (0.5, 2.0)
    )
    (record,) = below.records
    assert record["message"] == ""
    assert (record["critical_depth_error_estimate"], record["critical_force_error_estimate"]) == (0.01, 0.02)
    assert record["guided_critical_depth_error_estimate"] is None
    assert "unstable" in beyond.records[0]["message"]
    assert below.shown[0].rows[0]["guided_critical_depth_mm"] == "none up to 3.5"


def test_a_search_that_stops_or_a_tip_that_gives_way_is_not_ok(monkeypatch):
    from fem.analyses import small_shear, stability
    from geometry.design import paper
    from studies.simulation import critical_depths

    def status(message, depth=None, stiffness=0.5):
        found = stability.Critical(None, None, 3.5, message)
        monkeypatch.setattr(stability, "critical", lambda *_, **__: found)
        shear = small_shear.SmallShear(stiffness, 0.5, 0.1, 1.0, 1.0)
        monkeypatch.setattr(small_shear, "small_shear", lambda *_, **__: shear)
        (record,) = critical_depths.at_design(paper(), "rigid", "quick", depth, lambda *_: None).records
        return record["status"], record["message"]

    assert status("")[0] == "ok"
    stopped = "the press does not converge beyond 3.5 mm"
    assert status(stopped) == ("unknown", stopped)
    assert [status("", depth)[0] for depth in (3.0, 4.0)] == ["ok", "unknown"]
    assert status("", 3.0, -0.5)[0] == "unstable"


# Response


COARSE = ("--accuracy", "quick", "--count", 20)


def test_response_reports_both_motions_and_writes_their_files(run, strict, tmp_path):
    out = tmp_path / "response"
    status, text, _ = run("response", "paper", "--depth", 1, *COARSE, "--out", out, "--json")
    along_z, along_x = strict(text)
    assert status == 0
    assert (along_z["motion"], along_x["motion"]) == ("z", "x")
    assert {path.name for path in out.glob("[!.]*")} == {
        "response.csv", "ladder.csv", "response_z.png", "response_x.png", "run.json"
    }  # fmt: skip
    rows = list(csv.DictReader((out / "response.csv").open()))
    # the resonances come in addition to the 20 frequencies
    (peak,) = [row for row in rows if row["motion"] == "x" and not row["mesh_difference"]]
    assert float(peak["frequency_Hz"]) == pytest.approx(along_x["resonance_per_N_Hz"][0], rel=1e-8)
    assert [row["motion"] for row in rows] == ["z"] * 20 + ["x"] * 21
    assert float(rows[0]["force_N_per_mm"]) == pytest.approx(along_z["stiffness_N_per_mm"], rel=1e-8)
    # the first bending resonance under a force is damped by the assumed loss factor
    assert along_x["resonance_per_N_Q"][0] == pytest.approx(10, rel=0.3)
    assert along_x["reading_V_per_mm"][0] is None  # S1 on the axis does not see a motion along x at first order
    assert along_z["lift_amplitude_mm"] > along_z["kept_amplitude_mm"] > 0
    assert 0 < along_z["mesh_difference"] < 0.01
    assert 1e-3 < along_z["error_estimate"] < 0.02
    assert float(rows[0]["reading_error_estimate"]) > 0


def test_a_sliding_plate_moves_along_z_only_and_a_free_sensor_has_no_force(run, strict):
    (sliding,) = strict(run("response", "paper", "--friction", "none", *COARSE, "--json")[1])
    assert "transmits nothing" in " ".join(sliding["notes"])
    free = strict(run("response", "paper", "--depth", 0, *COARSE, "--json")[1])
    assert [record["stiffness_N_per_mm"] for record in free] == [None, None]
    assert free[1]["resonance_per_mm_Hz"][0] > free[1]["undamped_Hz"][0]  # the silicone stiffens with the frequency


def test_frequencies_without_data_are_refused_or_marked(run, refusal, strict):
    beyond = ("response", "paper", *COARSE, "--frequencies", "1:1500")
    assert "(extrapolate)" in refusal(*beyond)
    status, out, _ = run(*beyond, "--extrapolate", "--json")
    assert status == 0
    assert "extrapolation" in strict(out)[0]["warnings"][0]


@pytest.mark.parametrize(
    "options",
    [
        ("--frequencies", "0:10"),
        ("--frequencies", "10"),
        ("--count", 1),
        ("--depth", 0, "--shear", 1),
        ("--shear", 1, "--friction", "none"),
        ("--shear", 1, "--friction", "0"),
        ("--friction", "nan"),
        ("--grip", 0),
        ("--plate-tilt", 90),
        ("--plate-tilt", 5, "--shear-y", 0.1),
        ("--frequencies", "1:9000", "--extrapolate"),
    ],
)
def test_bad_input_is_one_sentence(refusal, options):
    refusal("response", "paper", "--accuracy", "quick", *options)


def test_a_state_that_is_unstable_is_a_failed_solve(run, strict):
    status, out, err = run("response", "paper", "--set", "L=32", "--depth", 6, *COARSE, "--json")
    (record,) = strict(out)
    assert (status, record["status"]) == (3, "failed")
    assert "take a smaller depth" in err


def test_a_sensor_that_gives_way_under_a_force_says_so(run, strict):
    status, out, _ = run("response", "paper", "--depth", 3.5, *COARSE, "--json")
    along_x = strict(out)[1]
    assert (status, along_x["status"]) == (3, "unstable")
    assert "gives way under a force" in along_x["message"]


def test_an_elastic_sensor_has_resonances_without_a_quality_factor(run, strict):
    along_x = strict(run("response", "paper", "--set", "loss_factor=0", *COARSE, "--json")[1])[1]
    assert along_x["resonance_per_mm_Hz"][0] == pytest.approx(along_x["undamped_Hz"][0], rel=1e-6)
    assert set(along_x["resonance_per_mm_Q"]) == {None}


def test_a_response_beyond_buckling_has_the_status_and_the_message_of_a_solve(run, strict):
    sensor = ("paper", "--set", "L=24", "--magnet", "ignored", "--depth", "3", "--accuracy", "quick")
    told = "a beam whose tip slides freely on the plate buckles sideways"
    status, out, err = run("response", *sensor, "--count", "5", "--json")
    assert status == 3
    assert told in err
    assert {row["status"] for row in strict(out)} == {"unstable"}
    status, out, err = run("modes", *sensor, "--count", "2", "--json")
    assert (status, strict(out)[0]["status"]) == (3, "unstable")
    assert told in err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--depth", "2"), "depth must be 0; got 2 mm"),
        (("--friction", "none"), "--friction has no meaning with --grip"),
        (("--plate-tilt", "5"), "plate tilt must be 0; got 5 degrees"),
    ],
)
def test_a_grip_refuses_what_belongs_to_a_plate(refusal, options, message):
    assert message in refusal("response", "paper", "--grip", "1", "--shear", "0.1", *options)


# Lines of a motion on the screen


# Readings of a vibrating sensor


BAND = (0.1, 100.0)


def curves(design, load, frequencies):
    return response_curves.evaluator(design, vibrating_sensor(design, load, BAND, QUICK))(np.array(frequencies))


def test_a_slow_motion_of_the_plate_changes_the_readings_as_two_presses_do():
    design, step = replace(paper(), loss_factor=0.0), 0.02
    slow = curves(design, Load(depth=1.0), [0.1])["z"]
    volts = [
        np.array(hall.readings(design, state.response).V)
        for state in trace(design, [Load(depth=1 - step), Load(depth=1 + step)], QUICK, estimate=False)
    ]
    expected = (volts[1] - volts[0]) / (2 * step)
    assert slow.per_mm[0].real == pytest.approx(expected, rel=0.03)  # the meshes differ, and the contact is frozen
    assert slow.per_N[0] == pytest.approx(slow.per_mm[0] / slow.force[0], rel=1e-12)


def test_rows_hold_gains_and_phases():
    one = curves(paper(), Load(depth=1.0, friction="stick"), [1.0, 10.0])["x"]
    rows = response_curves.rows(one, None, None)
    assert rows[1]["S2_V_per_N"] == pytest.approx(abs(one.per_N[1, 1]))
    assert rows[1]["force_phase_deg"] == pytest.approx(np.degrees(np.angle(one.force[1])))
    assert rows[1]["S1_V_per_N"] is None  # forbidden by symmetry
    assert rows[1]["shift_z_mm_per_mm"] is None


def test_a_prony_oscillator_without_branches_is_the_undamped_one():
    sensor = vibrating_sensor(replace(paper(), loss_factor=0.0), Load(depth=1.0), BAND, QUICK)
    models = vibration_report.oscillators(paper(), "x", 1.0, sensor.relaxation)
    (natural, one), (_, other) = models.values()
    f = np.array([0.1, 0.5 * natural])
    assert one(f) == pytest.approx(other(f), rel=1e-12)
    rungs = vibration_report.rungs("x", models, one, BAND)
    assert [rung["natural_Hz"] for rung in rungs] == [natural, natural, None]
    assert all(rung["peak_Hz"] is None for rung in rungs)  # an undamped resonance has no height


def test_an_oscillator_takes_its_loss_factor_where_the_branches_speak():
    measured = Relaxation((0.2, 0.1), (0.1, 1.0), (0.01, 10.0))
    end = 1 / (2 * np.pi * 0.01)
    models = vibration_report.oscillators(paper(), "x", 1.0, measured)
    name = next(iter(models))
    natural, response = models[name]
    assert natural > end
    assert name.endswith("as at 15.9 Hz")
    loss = float(measured.loss_factor(2 * np.pi * end))
    assert np.abs(response(np.array([natural]))) == pytest.approx([1 / loss], rel=1e-12)


# Peaks and bandwidths of oscillators with known ones


def oscillator(natural, loss):
    return lambda f: np.abs(receptance(f, natural, 1 + 1j * loss))


@pytest.mark.parametrize("loss", [0.001, 0.02, 0.1])
def test_a_peak_of_a_constant_loss_factor(loss):
    (peak,) = peaks(oscillator(340.0, loss), 1.0, 1000.0)
    assert peak.frequency == pytest.approx(340.0, rel=1e-6)
    assert peak.gain == pytest.approx(1 / loss, rel=1e-6)
    # half power at (f / f0)^2 = 1 -+ loss
    width = 340.0 * ((1 + loss) ** 0.5 - (1 - loss) ** 0.5)
    assert peak.width == pytest.approx(width, rel=1e-6)
    assert pytest.approx(340.0 / width, rel=1e-6) == peak.Q


def test_a_peak_without_both_half_power_points_has_no_width():
    (peak,) = peaks(oscillator(340.0, 0.1), 1.0, 345.0)
    assert peak.width is None
    assert peak.Q is None


def test_two_peaks_are_found_in_rising_order():
    def gain(f):
        return oscillator(50.0, 0.05)(f) + oscillator(400.0, 0.05)(f)

    assert [round(peak.frequency, -1) for peak in peaks(gain, 1.0, 1000.0)] == [50.0, 400.0]


def test_the_bandwidth_of_a_low_pass():
    def gain(f):
        return 1 / np.sqrt(1 + (f / 80.0) ** 2)

    level = gain(1.0) * 0.5**0.5
    assert bandwidth(gain, 1.0, 1000.0) == pytest.approx(80.0 * (level**-2 - 1) ** 0.5, rel=1e-9)
    assert bandwidth(gain, 1.0, 50.0) is None


def test_the_flat_range_of_an_undamped_oscillator():
    end = flat_to(oscillator(970.0, 0.0), 0.05, 0.01, 600.0)
    assert end == pytest.approx(970.0 * (1 - 1 / 1.05) ** 0.5, rel=1e-6)
    assert flat_to(oscillator(970.0, 0.0), 0.05, 0.01, 200.0) is None


# Cycle


ROUGH = ("--accuracy", "quick", "--magnet", "ignored")
LOOP = {"cycle": 1, "area_mJ": 0.3, "material_mJ": 0.3, "friction_mJ": 0.0}


def test_loop_of_a_press_is_near_that_of_a_linear_spring(run, strict, tmp_path):
    words = ("--depth", 0.5, "--speed", 0.5, "--cycles", 2, "--json", "--out", tmp_path / "o")
    status, out, _ = run("cycle", "paper", *words, *ROUGH)
    (record,) = strict(out)
    last = record["loops"][-1]
    spring = 100 * loop(relaxation_of(paper()), 0.5).hysteresis
    assert status == 0
    assert last["gap_percent"] == pytest.approx(spring, rel=0.2)
    assert 0 < last["area_mJ"] < 1.2 * last["material_mJ"]
    assert last["friction_mJ"] == 0
    assert record["drift_percent"] < 0
    assert max(record["time_error"], record["balance_error"]) < 1e-3
    assert "long-term modulus (the default)" in record["notes"][0]
    table = pd.read_csv(tmp_path / "o" / "cycle.csv")
    assert table["depth_mm"].max() == 0.5
    assert table["S1_V"].nunique() > 10
    assert (tmp_path / "o" / "cycle.png").is_file()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--speed 0", "--speed must be above 0 mm/s"),
        ("--frequency 1e6", "the branches speak for"),
        ("--speed 1 --hold 100", "not for 100 s"),
        ("--speed 1 --shear 0.5 --friction 0", "give stick or a coefficient above 0; got 0"),
        ("--speed 1 --shear 1000", "got 1000 mm"),
        ("--speed 1 --tolerance 2", "--tolerance must be at least 1e-07 and below 1"),
        ("--speed 1 --gap 0", "--gap must be above 0 and below 100 percent of full scale; got 0"),
        ("--speed 0.5 --depth 99", "depth must be less than 7 mm, the silicone on the axis above and below"),
    ],
)
def test_impossible_cycles_are_refused_before_a_solve(words, message, refusal):
    assert message in refusal("cycle", "paper", *words.split())


def test_a_gap_is_searched_for_only_where_no_branches_are_measured(refusal):
    assert "the design has measured branches" in refusal(
        "cycle", "paper", "--speed", 1, "--gap", 5, "--set", "prony=0:0.01 0.2:1 0:100"
    )


def test_a_gap_that_no_loss_factor_has_is_told(run):
    rough = ("--cycles", 1, "--depth", 0.2, "--tolerance", 0.02)
    status, _, err = run("cycle", "paper", "--speed", 0.5, "--gap", 90, *rough, *ROUGH)
    assert status == 3
    assert "no loss factor up to 1 has a gap of 90 %" in err


def test_a_fast_cycle_is_warned_of_inertia_and_is_not_yet_steady(run):
    words = ("--depth", 0.2, "--frequency", 400, "--cycles", 1, "--accuracy", "quick")
    status, out, err = run("cycle", "paper", *words)
    assert status == 0
    assert "1.2 times the lowest natural frequency of the free sensor, 343 Hz" in err
    assert "the loop of cycle 1, the first one and not yet steady (--cycles), has a gap of" in out


def test_a_cycle_beyond_buckling_is_unstable_and_keeps_its_loops(run, strict):
    words = ("--set", "L=24", "--depth", 2, "--speed", 1, "--cycles", 1, "--json")
    status, out, err = run("cycle", "paper", *words, *ROUGH)
    (record,) = strict(out)
    assert (status, record["status"], len(record["loops"])) == (3, "unstable", 1)
    assert "a beam whose tip slides freely on the plate buckles sideways" in err
    assert 0.8 < float(record["message"].rsplit("first at ", 1)[1].removesuffix(" s")) < 1.1


# Sentences that say when loops should not be trusted


def cycles(force_out=1.0, loop=LOOP):
    states = []
    for stop in stops(Motion(1.0, 0.0, "none", 1.0, cycles=1)):
        z = force_out if stop.phase == "out" else 1.0
        response = Response(force=(0.0, 0.0, z), shift=(0.0, 0.0, 0.0), tilt=0.0, contact_radius=1.0)
        state = TimedState(
            stop.timed.time,
            Solution(stop.timed.load, response, 0.0, "axisymmetric", 1, 1, 0.0, None),
            0.0,
            0.0,
            0.0,
            1,
        )
        states.append(CycleState(stop, state, True, (0.0, 0.0, 0.0), 0.0, 0.0))
    return Cycles("prony", "ok", "", states, [loop], "V", 1.0)


@pytest.mark.parametrize(
    ("stop", "loops", "said"),
    [
        ("", cycles(), []),
        ("stopped at depth 5.7 mm", cycles(), ["does not reach the end of the stroke (stopped at depth 5.7 mm)"]),
        ("", cycles(loop=LOOP | {"material_mJ": -0.1}), ["the silicone gains 0.1 mJ in cycle 1, which no"]),
        ("", cycles(force_out=0.0), ["does not touch the plate at mid-stroke on the way out"]),
    ],
)
def test_loops_that_should_not_be_trusted_are_told(stop, loops, said):
    texts = doubts(Static(None, 0.001, stop), loops)
    assert len(texts) == len(said)
    assert all(part in text for part, text in zip(said, texts, strict=True))


# Loads and phases of a motion, and its refusals


def test_triangle_passes_mid_stroke_and_holds_at_both_ends():
    path = stops(Motion(1.0, 0.0, "none", 0.5, cycles=1, hold=2.0))
    assert [stop.timed.time for stop in path] == [0.5, 1.0, 3.0, 3.5, 4.0, 6.0]
    assert [stop.timed.load.depth for stop in path] == [0.5, 1.0, 1.0, 0.5, 0.0, 0.0]
    assert [stop.phase for stop in path] == ["in", "in", "hold", "out", "out", "hold"]


def test_sine_is_exact_at_mid_stroke_and_at_its_ends():
    path = stops(Motion(2.0, 0.0, "none", 1.0, "sine", cycles=2))
    named = [value for stop in path if stop.place for value in (stop.timed.time, stop.timed.load.depth)]
    assert named == pytest.approx(
        [0.25, 1.0, 0.5, 2.0, 0.75, 1.0, 1.0, 0.0, 1.25, 1.0, 1.5, 2.0, 1.75, 1.0, 2.0, 0.0]
    )


def test_shear_follows_the_press_and_begins_each_cycle_at_its_end():
    path = stops(Motion(1.0, 0.5, "stick", 0.5, cycles=1))
    assert [(stop.timed.load.depth, stop.timed.load.shear_x) for stop in path] == [
        (1.0, 0.0), (1.0, 0.5), (1.0, 0.0), (1.0, -0.5), (1.0, 0.0), (1.0, 0.5)
    ]  # fmt: skip
    assert [stop.cycle for stop in path] == [0, 0, 1, 1, 1, 1]


@pytest.mark.parametrize(("speed", "frequency"), [(None, None), (1.0, 1.0), (0.0, None)])
def test_speed_and_frequency_that_define_no_motion_are_refused(speed, frequency):
    with pytest.raises(BadInput, match="--speed"):
        frequency_of(speed, frequency, 1.0)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"depth": 0.0}, "--depth of a cycle must be above 0 mm"),
        ({"depth": math.inf}, "--depth of a cycle must be above 0 mm and finite; got inf"),
        ({"frequency": -1.0}, "--frequency of a cycle must be above 0 Hz"),
        ({"cycles": 0}, "--cycles must be between 1 and 1000"),
        ({"hold": -1.0}, "--hold must be a finite time of 0 s or more"),
        ({"shear": 1.0}, "a shear needs friction"),
    ],
)
def test_impossible_motions_are_refused(values, message):
    with pytest.raises(BadInput, match=message):
        Motion(**({"depth": 1.0, "shear": 0.0, "friction": "none", "frequency": 1.0} | values))


def state_at(stop) -> TimedState:
    load = stop.timed.load
    response = Response(
        force=(load.shear_x, 0.0, 1.0), shift=(load.shear_x, 0.0, -0.3), tilt=0.1 * load.shear_x, contact_radius=1.0
    )
    return TimedState(
        stop.timed.time, Solution(load, response, 0.0, "axisymmetric", 1, 1, 0.0, None), 0.0, 0.0, 0.0, 1
    )


@pytest.mark.parametrize("shear", [0.2, -0.2])
def test_a_force_that_lags_has_a_gap_above_zero_whatever_the_direction(shear):
    motion = Motion(0.5, shear, "stick", 1.0, cycles=1)
    states = []
    for stop in stops(motion):
        state = state_at(stop)
        lag = 0.01 * np.sign(shear) * {"in": 1, "out": -1}.get(stop.phase, 0)
        force = (stop.timed.load.shear_x + lag, 0.0, 1.0)
        response = dataclasses.replace(state.solution.response, force=force)
        state = dataclasses.replace(state, solution=dataclasses.replace(state.solution, response=response))
        states.append(CycleState(stop, state, True, np.zeros(3), np.nan, np.nan))
    (row,) = loops_of(motion, states)
    assert row["gap_N"] == pytest.approx(0.02)
    assert row["gap_percent"] > 0
