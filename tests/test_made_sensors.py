"""Made sensors: tolerances, draws that are reproducible, readings of displaced parts, and what calibrations leave."""

import dataclasses
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import PchipInterpolator

from analytic import beam, decode, hall, parts
from analytic.parts import of_design
from analytic.reading_noise import of_average
from fem.accuracy import QUICK
from fem.equilibrium import trace
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from studies.inputs.user_input import read_design
from studies.parts.part_tolerances import SPECS, batches_of, parse_tolerances, parts_of, tolerances, tolerances_of
from studies.sensing import decode_readings
from studies.sensitivity import decode_tolerances
from studies.sensitivity.beam_motions import Press
from studies.sensitivity.calibration import curves, percentile, refusals_of, spread_of
from studies.sensitivity.made_sensors import (
    made_readings,
    made_sensors,
    nominal_sensor,
    share_with_error,
)


def test_every_tolerance_names_unit_distribution_and_source():
    for name, spec in SPECS.items():
        assert spec["shape"] in ("normal", "uniform")
        assert spec["unit"] in ("percent", "mm", "deg", "V", "T", "1")
        assert spec["meaning"]
        assert spec["source"]
        assert tolerances()[name] == float(spec["default"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("E=-1", "tolerance E must be a number of percent from 0 to 90; got -1"),
        ("nu=2", "tolerance nu must be a number from 0 to 1; got 2"),
        ("E=ten", "tolerance E must be a finite number; got 'ten'"),
        ("magnet_w=1", "did you mean magnet_"),
    ],
)
def test_impossible_tolerances_are_refused(text, message):
    with pytest.raises(BadInput, match=message.replace("(", r"\(")):
        parse_tolerances([text])


def test_tolerances_of_a_winner_are_those_of_its_parts_process_and_file(toml):
    file = toml('silicone = "Smooth-Sil 950"\nE = 2.46\nremanence = 1.45\nhall_low = 0.3\nhall_high = 4.7\n'
                '[fabrication]\nprocess = "sla"\n[tolerances]\nmagnet_x = 0.3\n')  # fmt: skip
    design = read_design(file, [])
    found, usual = parse_tolerances(["magnet_tilt=1"], design, file), tolerances()
    assert found["E"] == pytest.approx(100 * (3.21 / 2.46 - 1))  # 1.88 to 3.21 MPa
    assert found["remanence"] == pytest.approx(100 * 0.03 / 1.45)  # N52: 1.42 to 1.48 T
    assert (found["magnet_diameter"], found["hall_gain"]) == (0.1, 5.0)  # 4x2 N52, A1325
    assert (found["hall_x"], usual["hall_x"], found["hall_z"]) == (0.05, 0.1, usual["hall_z"])
    assert (found["magnet_x"], found["magnet_tilt"]) == (0.3, 1.0)
    # without a name nothing is known of the parts
    unnamed = dataclasses.replace(design, silicone="")
    assert tolerances_of(unnamed) == usual
    assert made_sensors(unnamed, usual, 200, parts=parts_of(unnamed)).fields["E"].max() <= 1.1 * 2.46
    E = made_sensors(design, tolerances_of(design), 200, parts=parts_of(design)).fields["E"]
    low, high = batches_of(design)["E"]
    assert low == 1.88 < E.min() < 2.0
    assert 3.0 < E.max() < high == 3.21


NONE = dict.fromkeys(SPECS, 0.0)


def test_a_seed_gives_the_same_sensors_again_and_another_seed_others():
    one, same, other = (made_sensors(paper(), count=20, seed=seed).fields["E"] for seed in (1, 1, 2))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def test_a_sensor_is_the_same_in_a_longer_draw_and_batches_leave_its_other_deviations():
    design = Design(silicone="Dragon Skin 30", E=0.75)
    sizes, made_of = tolerances_of(design), parts_of(design)
    few, many = (made_sensors(design, sizes, count, 5, parts=made_of) for count in (3, 40))
    plain = made_sensors(design, sizes, 3, 5)
    assert all(np.array_equal(few.fields[name], many.fields[name][:3]) for name in few.fields)
    assert not np.isclose(few.fields["E"], plain.fields["E"]).any()
    assert np.array_equal(few.gain_factor, plain.gain_factor)
    # a tolerance of one's own is one about the design
    mine = made_sensors(design, {**sizes, "E": 3.0}, 40, 5, parts=made_of)
    assert np.abs(mine.fields["E"] / design.E - 1).max() <= 0.03


def test_a_tolerance_leaves_the_deviations_of_the_others():
    both, alone = (made_sensors(paper(), tolerances(magnet_x=size), 50, 4) for size in (0.15, 0.0))
    assert not alone.magnet_offset[:, 0].any()
    assert np.array_equal(both.magnet_offset[:, 1:], alone.magnet_offset[:, 1:])
    assert np.array_equal(both.fields["E"], alone.fields["E"])


def test_impossible_sensors_are_kept_with_their_reason():
    sensors = made_sensors(Design(magnet_diameter=7.58), tolerances(**NONE | {"magnet_diameter": 0.2}), 200, 6)
    impossible = [k for k, design in enumerate(sensors.designs) if design is None]
    assert 20 < len(impossible) < 180
    assert all("leaves" in sensors.refusals[k] for k in impossible)
    assert (sensors.fields["magnet_diameter"][impossible] > 7.58).all()
    assert [k for k, reason in enumerate(sensors.refusals) if reason] == impossible


def test_the_interval_of_a_share_covers_its_truth_at_the_stated_level():
    draws = np.random.default_rng(7).binomial(200, 0.9, 2000)
    covered = np.mean([low <= 0.9 <= high for _, low, high in (share_with_error(int(k), 200) for k in draws)])
    assert 0.94 < covered < 0.99
    assert share_with_error(10, 10)[2] == 1.0
    assert share_with_error(0, 10)[1] == 0.0


SHIFT, TILT = np.array([0.4, -0.1, -0.8]), np.array([0.02, 0.06])


def states(count, shift=SHIFT, tilt=TILT):
    """The same pose for each of some sensors, in one state."""
    return np.tile(shift, (count, 1, 1)), np.tile(tilt, (count, 1, 1))


@pytest.mark.parametrize(("layout", "count"), [("three", 1), ("tmag5273a1", 1), ("tmag5273a1", 4)])
def test_without_deviations_the_readings_are_those_of_the_design(layout, count):
    design = Design(hall_layout=layout, chip_x=3.0, chip_count=count)
    made = made_readings(nominal_sensor(design), *states(1))
    truth = hall.readings(design, shift=tuple(SHIFT), tilt=tuple(TILT))
    exact = [dataclasses.replace(element, step=0.0) for element in parts.of_design(design)]
    output = hall.readings(design, shift=tuple(SHIFT), tilt=tuple(TILT), elements=exact).output
    assert made.output[0, 0] == pytest.approx(output, rel=1e-12)
    assert made.field_T[0, 0] == pytest.approx(truth.B_T, rel=1e-12)
    assert made.saturated[0, 0].tolist() == list(truth.saturated)


def test_each_of_four_chips_has_a_place_and_keeps_the_deviations_of_the_rest():
    three, four = (
        made_sensors(Design(hall_layout="tmag5273a1", chip_x=4.0, chip_count=count), count=5, seed=2)
        for count in (3, 4)
    )
    assert four.element_offset.shape == (5, 12, 3)
    assert (four.element_offset[:, ::3] == four.element_offset[:, 2::3]).all()
    assert len({tuple(place) for place in four.element_offset[0]}) == 4
    assert (four.element_offset[:, :9] == three.element_offset).all()
    assert (four.magnet_offset == three.magnet_offset).all()
    assert all((four.fields[name] == three.fields[name]).all() for name in four.fields)


def test_each_element_reads_at_its_own_place_with_its_own_gain_and_null():
    sensors = made_sensors(paper(), tolerances(hall_x=0.5, hall_z=0.5), 4, 1)
    moved = made_readings(sensors, *states(4)).output
    for k, design in enumerate(sensors.designs):
        elements = [
            dataclasses.replace(
                element,
                position=tuple(np.add(element.position, sensors.element_offset[k, j])),
                gain=element.gain * sensors.gain_factor[k, j],
                null=element.null + sensors.null_shift[k, j],
            )
            for j, element in enumerate(parts.of_design(design))
        ]
        pose = SHIFT + hall.rotated(sensors.magnet_offset[k], TILT)
        truth = hall.readings(design, shift=tuple(pose), tilt=tuple(TILT + sensors.magnet_tilt[k]), elements=elements)
        assert moved[k, 0] == pytest.approx(truth.output, rel=1e-11)


# Noise of a reading: limits, both series of the rounding bias, and samples through a converter.


@pytest.mark.parametrize("noise", [0.02, 0.15, 0.3, 0.6])
@pytest.mark.parametrize("count", [1, 8])
def test_is_the_error_of_rounded_samples(noise, count):
    """Outputs anywhere within a step, with their noise, rounded and averaged; 2e5 averages give 0.5 %."""
    rng = np.random.default_rng(7)
    true = rng.uniform(0, 1, 200_000)
    samples = np.round(true + noise * rng.standard_normal((count, len(true))))
    error = math.sqrt(((samples.mean(axis=0) - true) ** 2).mean())
    assert_allclose(of_average(noise, 1.0, count=count), error, rtol=5e-3)


# Calibrations of made sensors


def test_the_ends_of_the_nominal_curves_are_the_readings_under_the_load():
    made = made_sensors(paper(), tolerances(**NONE), 1)
    axes = curves("finite", made, Press(1.0, 0.3))
    pressed, sheared = (beam.solve(paper(), Load(1.0, s, friction="stick"), "finite") for s in (0.0, 0.3))
    nominal, _ = axes["z"]
    assert nominal.force[-1] == pytest.approx(pressed.force[2])
    assert nominal.rest[0] == pytest.approx(hall.readings(paper()).V[0])
    assert nominal.reading[0, -1] == pytest.approx(hall.readings(paper(), pressed).V[0], rel=1e-6)
    along_x, _ = axes["x"]
    assert along_x.force[[0, -1]] == pytest.approx([-sheared.force[0], sheared.force[0]])
    assert along_x.reading[0, -1] == pytest.approx(hall.readings(paper(), sheared).V[1], rel=1e-6)
    assert axes["y"][0].reading == pytest.approx(along_x.reading, rel=1e-12)


def test_a_sensor_of_twice_the_modulus_is_pressed_less_for_the_same_force():
    made = made_sensors(paper(), tolerances(**NONE), 1)
    stiff = dataclasses.replace(made, designs=(Design(E=2.0),))
    nominal, curve = curves("finite", stiff, Press(1.0))["z"]
    soft_at_half = np.interp(nominal.force[-1] / 2, nominal.force, nominal.reading[0])
    assert curve.reading[0, -1] == pytest.approx(soft_at_half, rel=1e-4)


def test_a_load_that_the_model_refuses_for_the_design_itself_is_bad_input():
    made = made_sensors(paper(), count=2)
    with pytest.raises(BadInput, match="the sensor itself cannot be calibrated: depth must be less than 7 mm"):
        curves("finite", made, Press(8.0))
    with pytest.raises(BadInput, match="the sensor itself cannot be calibrated in shear: the surrogate"):
        curves("surrogate", made, Press(1.0, 8.0))


def spread(design=paper(), load=Press(1.0, 0.3), count=4, seed=1, **sizes):
    """Made sensors, and the spread of their calibrations by the axis."""
    sensors = made_sensors(design, tolerances(**NONE | sizes), count, seed)
    return sensors, spread_of(sensors, load, "finite")


def test_without_tolerances_all_sensors_are_the_nominal_one():
    for axis in spread(count=2)[1].values():
        assert axis.made["force_error"] == pytest.approx([0, 0], abs=1e-12)
        assert axis.made["recalibrated_force_error"] == pytest.approx([0, 0], abs=1e-12)
        assert axis.made["sensitivity"] == pytest.approx([axis.nominal["sensitivity"]] * 2)
        assert axis.refusals == ("", "")


def test_a_wrong_null_is_corrected_by_zeroing():
    sensors, axes = spread(hall_null=0.02, count=20)
    axis, null = axes["z"], sensors.null_shift[:, 0]
    assert axis.made["offset"] == pytest.approx(axis.nominal["offset"] + null)
    assert axis.made["zeroed_force_error"] == pytest.approx(np.zeros(20), abs=1e-9)
    # beyond the curve's upper end it goes on with its mean slope
    up = null > 0
    assert (axis.made["force_error"][up] >= null[up] / axis.nominal["sensitivity"] - 1e-9).all()
    assert axis.made["force_error"][up] == pytest.approx(null[up] / axis.nominal["sensitivity"], rel=0.5)


def test_a_reading_at_a_rail_fails_the_sensor_and_an_axis_whose_reading_folds_fails_all():
    railed = spread(Design(hall_high=2.91))[1]["z"]
    assert (
        railed.message == "the reading of axis z of the design itself lies at a rail" or "one sense" in railed.message
    )
    assert np.isnan(railed.made["force_error"]).all()
    folded = spread(Design(f=3.0, c=0.0), Press(1.0, 2.5))[1]["x"]
    assert "one sense" in folded.message
    assert all(folded.refusals)


def test_the_surrogate_predicts_the_spread_of_finite_elements():
    """Three sensors solved one by one: the surrogate's sensitivities differ by its stated error, equally for all."""
    sensors = made_sensors(paper(), count=3, seed=3)
    axis = spread_of(sensors, Press(1.0))["z"]
    loads, force = tuple(map(Load, (0.8, 0.95, 1.1, 1.25))), axis.force_range[1]
    ratios = []
    for k, design in enumerate(sensors.designs):
        states = trace(design, loads, QUICK, estimate=False)
        forces, shifts = np.array([(one.response.force[2], one.response.shift[2]) for one in states]).T
        sunk = np.zeros((len(sensors), 2, 3))
        sunk[k, 1, 2] = PchipInterpolator(forces, shifts)(force)
        rest, loaded = made_readings(sensors, sunk, np.zeros((len(sensors), 2, 2))).output[k, :, 0]
        ratios.append(axis.made["sensitivity"][k] / ((loaded - rest) / force))
    assert ratios == pytest.approx([1.0] * 3, abs=axis.model_error)
    assert np.ptp(ratios) < 0.005
    assert np.ptp(axis.made["sensitivity"]) > 0.03 * axis.nominal["sensitivity"]


@pytest.mark.parametrize("layout", ["tle493d-p2b6", "tmag5273a1"])
def test_the_steps_of_a_chip_fail_no_sensor(layout):
    """Within the range of a shear the reading of a chip stays on some of its steps for several forces."""
    _, axes = spread(Design(hall_layout=layout), Press(1.0, 0.5), chip_gain=5.0)
    assert [axis.message for axis in axes.values()] == ["", "", ""]
    assert refusals_of(axes) == ("",) * 4
    for axis in axes.values():
        assert axis.made["recalibrated_force_error"] == pytest.approx(np.zeros(4), abs=1e-9)


@pytest.mark.parametrize("share", [0.05, 0.95])
def test_intervals_cover_the_truth_at_their_level(share):
    samples = np.random.default_rng(1).random((1000, 200))
    covered = np.mean([low <= share <= high for _, low, high in (percentile(one, share) for one in samples)])
    assert 0.935 < covered < 0.98


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
def test_the_ends_of_an_interval_have_the_ranks_of_the_binomial_distribution(share):
    """Beyond each end lies the truth in 2.5 % of all samples at most, and in more if the end moves one rank in."""
    from scipy.stats import binom

    _, low, high = percentile(np.arange(1.0, 301.0), share)
    assert binom.cdf(low - 1, 300, share) <= 0.025 < binom.cdf(low, 300, share)
    assert binom.sf(high - 1, 300, share) <= 0.025 < binom.sf(high - 2, 300, share)
    # failed members count as lowest for the lower end, as highest for the upper one
    _, other_low, other_high = percentile(np.append(np.arange(1.0, 291.0), [np.nan] * 10), share)
    assert other_low == (low - 10 if low > 10 else -np.inf)
    assert other_high == (high if high <= 290 else np.inf)


# Decoded readings of built sensors


def field_of(sensors, shift, tilt):
    """What sensors read in a pose, as the decoder of the nominal sensor understands it, shape (n, 3), T."""
    poses = np.broadcast_to(shift, (len(sensors), 1, 3)), np.broadcast_to(tilt, (len(sensors), 1, 2))
    return decode.field_of(of_design(paper()), made_readings(sensors, *poses).output[:, 0])


@pytest.fixture(scope="module")
def coder():
    return decode.decoder(paper(), decode_readings.of_level(paper(), "finite"))


def checked(coder, field):
    return decode_tolerances.check(coder, field, decode.decode(coder, field))


def test_nineteen_of_twenty_built_sensors_at_rest_are_told_to_be_so(coder):
    # other sensors than those of the check
    field = field_of(made_sensors(paper(), count=400, seed=9), np.zeros(3), np.zeros(2))
    found = checked(coder, field)
    assert 0.9 < (found.rest_probability >= decode_tolerances.DOUBTFUL).mean() < 0.98
    told = [status == "uncalibrated" for status in found.status]
    nominal = decode.decode(coder, field)
    with_force = (np.linalg.norm(nominal.force, axis=1) > 0) & (np.array(nominal.status) == "ok")
    assert with_force.sum() > 100
    assert told == (with_force & (found.rest_probability >= decode_tolerances.DOUBTFUL)).tolist()
    (sentence,) = found.warnings(nominal.force)
    assert "of 400 rows may be those of a sensor at rest" in sentence


def test_a_deep_press_is_not_a_sensor_at_rest_and_its_force_has_the_spread_of_built_ones(coder):
    response = beam.solve(paper(), Load(depth=2.0), "finite")
    pose = response.shift, np.zeros(2)
    nominal = field_of(nominal_sensor(paper()), *pose)
    found = checked(coder, nominal)
    assert (found.rest_probability[0], found.status) == (0, ["ok"])
    assert found.warnings(decode.decode(coder, nominal).force) == []
    # independent sensors scatter as much as the check says, where they have a force
    force = decode.decode(coder, field_of(made_sensors(paper(), count=400, seed=9), *pose)).force
    force = force[np.isfinite(force[:, 2])]
    spread = np.sqrt(((force - decode.decode(coder, nominal).force) ** 2).mean(axis=0))
    assert_allclose(found.tolerance_N, spread, rtol=0.2)


def test_the_verb_tells_forces_that_tolerances_explain(run, strict, tmp_path):
    """A press of 0.3 mm may be a built sensor at rest; with parts as good as a calibration makes them it is not."""
    (load,) = strict(run("analytic", "paper", "--depth", 0.3, "--level", "finite", "--json")[1])
    text = ",".join(map(repr, load["readings_V"]))
    command = ("decode", "paper", "--level", "finite", "--json")
    status, out, _ = run(*command, "--readings", text)
    (record,) = strict(out)
    assert (status, record["status"]) == (0, "uncalibrated")
    assert record["message"].endswith("calibrate the sensor")
    assert_allclose(record["tolerance_N_per_N"], np.array(record["tolerance_N"]) / np.linalg.norm(record["force_N"]))
    assert record["tolerance_N_per_N"][2] > 1
    exact = [word for name in SPECS for word in ("--tolerance", f"{name}=1e-5")]
    (record,) = strict(run(*command, "--readings", text, *exact)[1])
    assert (record["status"], record["message"], record["warnings"], record["rest_probability"]) == ("ok", "", [], 0)
    assert record["tolerance_N_per_N"][2] < 1e-3
    (tmp_path / "r.csv").write_text(f"S1_V,S2_V,S3_V\n{text}\n2.973987,2.903726,2.853713\n")
    status, out, err = run(*command, "--file", "r.csv")
    assert (status, [row["status"] for row in strict(out)]) == (0, ["uncalibrated", "ok"])
    assert "magtip: 1 of 2 rows uncalibrated: the force may be one of the tolerances" in err
    assert run(*command, "--readings", text, "--tolerance", "hall_gain=-1")[0] == 2
