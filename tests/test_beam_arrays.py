"""Arrays of beams: fields and forces of neighbours in closed form, joint decoding, and the verb."""

import contextlib
import io
import json
import math
from collections import Counter
from dataclasses import replace

import magpylib
import numpy as np
import pandas as pd
import pytest

from analytic import beam_arrays, buckling, parts
from analytic.array_stream import ArrayStream
from analytic.beam_arrays import beam_array, magnet_forces, readings_of_array, slopes_of_array
from analytic.decode import decode, decoder
from analytic.hall import field_at
from analytic.inverse.forward_model import model, readings_at, readings_with_slopes
from analytic.magnet import repulsion
from geometry.array_design import POLARITIES, ArrayDesign, grid_array, poles_of
from geometry.base import Base, plan
from geometry.design import BadInput, paper
from studies.cli import main
from studies.sensing import crosstalk, decode_readings
from studies.sensing.array_readings import FAR_ERROR, ArrayDecoder, Grid, frame_status, with_reaches
from studies.sensing.disturbed_loads import loads_of
from studies.sensitivity.decode_tolerances import frame_statuses

DESIGN = paper()
STILL = model(DESIGN)
LEANING = model(DESIGN, (np.array([[0.04, 0.01], [0.002, 0.0]]), -0.2, 0.2))
"""The magnet tilts by 40 mrad for each mm along the base, and more where it is pressed."""
CODER = decoder(DESIGN)


def shifts(frames, beams, seed=3):
    """Random shifts (frames, beams, 3), mm, well inside the workspace."""
    return np.random.default_rng(seed).uniform([-0.5, -0.5, -2.0], [0.5, 0.5, 0.0], (frames, beams, 3))


def slope_of(function, shift, beam, axis, step=1e-4):
    up, down = shift.copy(), shift.copy()
    up[..., beam, axis] += step
    down[..., beam, axis] -= step
    return (function(up) - function(down)) / (2 * step)


# Fields


def test_the_field_of_a_far_neighbour_falls_by_the_cube_and_its_gradient_by_the_fourth_power():
    pair = beam_array(STILL, 1, 2, 12.0, "up")
    near, far = (replace(pair, pitch=factor * DESIGN.D) for factor in (1000, 2000))
    rest = np.zeros((1, 2, 3))
    fields = [np.abs(readings_of_array(each, rest, own=False)).max() for each in (near, far)]
    gradients = [np.abs(slopes_of_array(each, rest)[1][0, 0, :, 1]).max() for each in (near, far)]
    assert np.log2(fields[0] / fields[1]) == pytest.approx(3, abs=0.01)
    assert np.log2(gradients[0] / gradients[1]) == pytest.approx(4, abs=0.01)


def test_laws_far_away_have_pitches_at_which_no_array_is_built():
    assert len(Grid(1, 16, 12.0).array(CODER, 20 * DESIGN.D, "rows")) == 16


def test_a_beam_reads_its_own_magnet_as_a_single_sensor():
    shift = shifts(2, 4)
    alone = replace(beam_array(LEANING, 2, 2, 12.0, "up"), reach=0.0)
    values, slopes = slopes_of_array(alone, shift)
    one, along = readings_with_slopes(LEANING, shift[1, 2][:, None])
    assert values[1, 2] - alone.far[2] == pytest.approx(one[:, 0], rel=1e-12)
    assert slopes[1, 2, :, 2] == pytest.approx(along[:, :, 0].T, rel=1e-9, abs=1e-12)
    assert not slopes[1, 2, :, 1].any()


def test_a_magnet_beyond_the_reach_counts_as_at_rest():
    array, shift = beam_array(LEANING, 1, 3, 12.0, "checkerboard"), shifts(1, 3)
    near, still = replace(array, reach=12.0), shift * [[[1], [1], [0]]]
    assert readings_of_array(near, shift)[0, 0] == pytest.approx(readings_of_array(array, still)[0, 0], rel=1e-12)
    assert readings_of_array(near, shift)[0, 1] == pytest.approx(readings_of_array(array, shift)[0, 1], rel=1e-12)
    assert readings_of_array(near, 0 * shift) == pytest.approx(readings_of_array(array, 0 * shift), rel=1e-12)


def test_slopes_of_all_readings_are_those_of_differences():
    array, shift = beam_array(LEANING, 1, 3, 9.0, "checkerboard"), shifts(1, 3)
    _, slopes = slopes_of_array(array, shift)
    for beam, axis in ((0, 0), (1, 2), (2, 1)):
        found = slope_of(lambda s: readings_of_array(array, s), shift, beam, axis)
        assert slopes[..., beam, axis] == pytest.approx(found, abs=1e-7 * np.abs(slopes).max())


def test_all_magnets_reversed_reverse_all_readings():
    array, shift = beam_array(STILL, 2, 2, 10.0, "rows"), shifts(1, 4)
    reversed_ = replace(array, poles=-array.poles)
    assert readings_of_array(reversed_, shift) == pytest.approx(-readings_of_array(array, shift), rel=1e-12)


# Decoding


@pytest.mark.parametrize("polarity", POLARITIES)
def test_joint_decoding_returns_the_poses_of_random_loads(polarity):
    array, shift = beam_array(CODER.forward, 3, 3, 8.5, polarity), shifts(4, 9)
    readings = readings_of_array(array, shift)
    first = beam_arrays.at_rest_where_unknown(beam_arrays.decoded_alone(CODER, array, readings), shift.shape)
    assert beam_arrays.decoded_jointly(CODER, array, readings, first) == pytest.approx(shift, abs=1e-9)


def test_joint_decoding_has_the_noise_of_a_single_sensor():
    chips = decoder(replace(DESIGN, hall_layout="tle493d-w2b6", chip_noise=5e-5))
    array, shift = beam_array(chips.forward, 2, 2, 20.0, "up"), shifts(32, 4)
    noise = chips.sigma * np.random.default_rng(1).normal(size=shift.shape)
    errors = []
    for each in (array, replace(array, reach=0.0)):
        found = beam_arrays.decoded_jointly(chips, each, readings_of_array(each, shift) + noise, shift)
        errors.append(float(np.sqrt(np.nanmean((found - shift) ** 2))))
    assert errors[0] == pytest.approx(errors[1], rel=0.05)
    assert errors[0] > 1e-4


@pytest.mark.parametrize("reject", [False, True])
def test_of_more_readings_than_unknowns_the_misfit_of_noise_is_least(reject):
    """No small motion of any beam, and no field, makes the weighted misfit of all readings smaller."""
    chips = decoder(replace(DESIGN, hall_layout="tle493d-w2b6", chip_count=3, chip_x=5.0, chip_noise=5e-5))
    array, shift = beam_array(chips.forward, 1, 3, 16.0, "up"), shifts(1, 3)
    noise = chips.sigma * np.random.default_rng(1).normal(size=(1, 3, 9))
    readings = readings_of_array(array, shift) + noise
    (found,), total, _ = beam_arrays.decoded_with_readings(chips, replace(array, ambient=reject), readings, shift)
    left, (_, slopes) = readings - total, slopes_of_array(array, found[None])
    gradient = np.einsum("fia,fiajc->jc", left, slopes)
    assert np.abs(gradient).max() < 1e-9 * np.abs(left).max() * np.abs(slopes).max()
    by_field = np.abs(np.einsum("fia,ac->c", left, [e.direction for e in chips.forward.elements])).max()
    assert (by_field < 1e-9 * np.abs(left).max()) == reject
    assert np.abs(left).max() > chips.sigma.max() / 2


def test_subtracting_the_neighbours_brings_the_poses_nearer():
    array, shift = beam_array(CODER.forward, 1, 3, 20.0, ("up", "down", "up")), shifts(4, 3)
    readings = readings_of_array(array, shift)
    stray = readings_of_array(array, 0 * shift, own=False)
    first = beam_arrays.decoded_alone(CODER, array, readings - stray).shift.reshape(shift.shape)
    second = beam_arrays.less_neighbours(CODER, array, readings, first).shift.reshape(shift.shape)
    assert np.abs(second - shift).max() < np.abs(first - shift).max() / 10


@pytest.fixture(scope="module")
def chips():
    """Of a design with a 3-axis chip, by level finite."""
    design = replace(DESIGN, hall_layout="tle493d-w2b6", chip_noise=5e-5)
    return decoder(design, decode_readings.of_level(design, "finite"))


def test_the_reach_of_many_beams_makes_the_error_that_is_said(chips):
    many = ArrayDecoder(grid_array(chips.forward.design, 5, 6, 20.0), chips, lambda frame: frame.status)
    near = many.stream.array
    assert 20.0 < near.reach < 60.0
    (said,) = many.said
    assert f"of 30 beams, magnets farther than {near.reach:.3g} mm count as at rest" in said
    loads, full, _ = loads_of(chips, None)
    ((_, stated),), _ = with_reaches(chips, replace(near, reach=math.inf), [FAR_ERROR])
    assert f"{stated:.2g} N, {100 * stated / full:.1g} %" in said
    _, shift = crosstalk.random_loads(chips, loads, 240)
    frames = shift.reshape(8, 30, 3)
    readings = readings_of_array(replace(near, reach=math.inf), frames)
    found, force = (
        crosstalk._forces(chips, each)
        for each in (beam_arrays.decoded_jointly(chips, near, readings, frames), frames)
    )
    off = np.linalg.norm(found - force, axis=-1).max()
    assert stated / 10 < off < stated < FAR_ERROR * full
    distances, errors = beam_arrays.errors_by_reach(chips, near, loads.poses.shift)
    assert len(distances) == len(errors)
    assert (np.diff(errors) <= 0).all()
    assert errors[-1] == 0


def test_all_magnets_of_few_beams_count(chips):
    few = ArrayDecoder(grid_array(chips.forward.design, 4, 4, 20.0), chips, lambda frame: frame.status)
    assert (few.stream.array.reach, few.said) == (math.inf, [])


def test_a_frame_that_no_poses_have_is_unknown():
    array = beam_array(CODER.forward, 1, 2, 12.0, "up")
    assert np.isnan(beam_arrays.decoded_jointly(CODER, array, np.full((1, 2, 3), 10.0), np.zeros((1, 2, 3)))).all()


# Forces


def test_two_magnets_side_by_side_repel_as_the_closed_form_says():
    force, _ = magnet_forces(beam_array(STILL, 1, 2, 9.0, "up"), np.zeros((2, 3)))
    expected = repulsion(DESIGN.magnet_diameter / 2, DESIGN.magnet_height, DESIGN.remanence_now, 9.0)
    assert force[:, 0] == pytest.approx([-expected, expected], rel=1e-6)
    opposite, _ = magnet_forces(beam_array(STILL, 1, 2, 9.0, ("up", "down")), np.zeros((2, 3)))
    assert opposite == pytest.approx(-force)


def test_magpylib_agrees_on_the_force_of_a_moved_magnet():
    shift = shifts(1, 2)[0]
    force, _ = magnet_forces(beam_array(STILL, 1, 2, 9.0, ("up", "down")), shift)
    size, up = 1e-3 * np.array([DESIGN.magnet_diameter, DESIGN.magnet_height]), [0, 0, -DESIGN.polarisation]
    first, second = (
        magpylib.magnet.Cylinder(polarization=pole * np.array(up), dimension=size, position=1e-3 * place)
        for pole, place in zip((1, -1), shift + np.array([[-4.5, 0, 0], [4.5, 0, 0]]), strict=True)
    )
    found, _ = magpylib.getFT(first, second, pivot="centroid", meshing=2000)
    assert found == pytest.approx(force[1], rel=2e-4)


def test_magnets_act_on_each_other_alike():
    """No force in sum, reciprocal slopes as of an energy, and no trace on any magnet (Earnshaw)."""
    force, slopes = magnet_forces(beam_array(STILL, 2, 3, 9.0, "checkerboard"), shifts(1, 6)[0])
    size = np.abs(slopes).max()
    assert force.sum(axis=0) == pytest.approx([0, 0, 0], abs=1e-6 * np.abs(force).max())
    whole = slopes.reshape(18, 18)
    assert whole == pytest.approx(whole.T, abs=1e-6 * size)
    assert np.einsum("iaia->i", slopes) == pytest.approx(np.zeros(6), abs=1e-9 * size)


def test_slopes_of_forces_are_those_of_differences():
    array, shift = beam_array(STILL, 1, 3, 9.0, "up"), shifts(1, 3)[0]
    _, slopes = magnet_forces(array, shift)
    found = slope_of(lambda s: magnet_forces(array, s)[0], shift, 1, 2)
    assert slopes[:, :, 1, 2] == pytest.approx(found, abs=1e-6 * np.abs(slopes).max())


def test_far_magnets_are_dipoles():
    assert beam_arrays.dipole_share(DESIGN, 400.0) == pytest.approx(1, abs=1e-3)


def test_a_beam_at_rest_shifts_by_the_force_over_its_stiffness_where_that_is_large():
    array = beam_array(STILL, 1, 2, 30.0, "up")
    found = beam_arrays.rest(array)
    assert found.shift[:, 0] == pytest.approx(found.force[:, 0] / beam_arrays.stiffness(DESIGN)[0], rel=1e-3)


def test_a_force_at_half_the_height_meets_more_than_twice_the_stiffness():
    """A column that only sheared would have twice, one that only bent eight times."""
    half, tip = (buckling.sideways_stiffness(DESIGN, height) for height in (DESIGN.L / 2, None))
    assert 2 < half / tip < 8


def test_soft_neighbours_snap_together_below_the_critical_pitch():
    assert np.isnan(beam_arrays.critical_pitch(beam_array(STILL, 3, 3, 20.0, "rows")))
    soft = model(replace(DESIGN, E=0.02))
    critical = beam_arrays.critical_pitch(beam_array(soft, 3, 3, 20.0, "rows"))
    assert critical > DESIGN.D
    margins = [beam_arrays.rest(beam_array(soft, 3, 3, share * critical, "rows")).margin for share in (0.999, 1.001)]
    assert margins[0] < 0 < margins[1]
    assert np.isnan(beam_arrays.rest(beam_array(soft, 3, 3, 0.999 * critical, "rows")).shift).all()


def test_the_poles_of_rows():
    assert poles_of("rows", 2, 2).tolist() == [1, 1, -1, -1]
    with pytest.raises(
        BadInput, match="polarity must be up, checkerboard, rows, or a list of up and down; got 'left'"
    ):
        poles_of("left", 2, 2)


def test_an_element_inside_a_neighbour_is_named():
    high = model(replace(DESIGN, c=4.0))
    assert beam_array(high, 1, 2, 8.5, "up").obstructed() == "S2"
    assert beam_array(high, 1, 2, 9.5, "up").obstructed() == ""


# The study and its verb


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The verb's study of two beams, 12 mm apart, by a design file and options above it: record, folder, messages."""
    path, out, err = tmp_path_factory.mktemp("array") / "pads.toml", io.StringIO(), io.StringIO()
    grid = '[array]\nrows = 1\ncolumns = 3\npitch = "12 mm"\npolarity = ["up", "down", "up"]\n'
    path.write_text(grid + '[fabrication]\nprocess = "sla"\n', "utf-8")
    words = [str(path), "--columns", "2", "--polarity", "up,down", "--level", "finite", "--out", str(path.parent)]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        assert main(["array", *words, "--json"]) == 0
    return json.loads(out.getvalue()), path.parent, err.getvalue()


@pytest.fixture(scope="module")
def record(study):
    return study[0]


@pytest.fixture(scope="module")
def pitches(study):
    return pd.read_csv(study[1] / "pitches.csv").to_dict("records")


def test_errors_by_decoder(record):
    assert record["jointly_N"] < 1e-9 < record["subtracting_N"] < record["ignoring_N"]
    assert record["jointly_no_force_percent"] == 0


def test_polarities_with_the_same_poles_have_their_rows_once(pitches):
    # rows reverse none of two beams in a row, and checkerboard is the list that is asked for
    errors = {row["polarity"]: row["ignoring_N"] for row in pitches if row["pitch_mm"] == 12.0}
    assert list(errors) == ["up", "up,down"]
    assert errors["up"] != errors["up,down"]
    assert Grid(2, 2, polarity=("up", "up", "down", "down")).polarities[-1] == ("up", "up", "down", "down")
    assert len(Grid(2, 2, polarity=("up", "up", "down", "down")).polarities) == 3
    assert len(Grid(2, 2, polarity=("up", "up", "up", "down")).polarities) == 4


def test_powers_far_away(record):
    for law in record["laws"]:
        assert law["field_power"] == pytest.approx(3, abs=0.05)
        assert law["by_shift_power"] == pytest.approx(4, abs=0.2)
        assert 3 < law["error_power"] < 4.2


def test_the_smallest_pitch_has_the_error_that_is_asked_for(record, pitches):
    smallest = next(each for each in record["smallest_pitch"] if each["decoder"] == "neighbours ignored")
    pitches = [row for row in pitches if row["polarity"] == smallest["polarity"]]
    near, far = (
        max((row for row in pitches if row["pitch_mm"] < smallest["smallest_pitch_mm"]), key=lambda r: r["pitch_mm"]),
        min((row for row in pitches if row["pitch_mm"] > smallest["smallest_pitch_mm"]), key=lambda r: r["pitch_mm"]),
    )
    assert far["ignoring_percent"] < 1.0 < near["ignoring_percent"]


def test_the_matrix_has_a_row_for_each_reading_and_beam(study):
    assert len(pd.read_csv(study[1] / "crosstalk.csv")) == 2 * 3 * 2
    assert study[0]["cross_talk"][0]["decoded_percent"] == pytest.approx(100, rel=1e-9)


def test_reaches_that_hold_all_beams_are_left_out(record):
    assert record["sparse"] == []


def test_single_bases_are_as_wide_as_the_process_of_the_design_file_makes_them(study):
    resin, filament = (2 * plan(DESIGN, Base(), process).half for process in ("sla", "fdm"))
    assert f"{resin:.3g}" != f"{filament:.3g}"
    assert f"single bases are {resin:.3g} mm wide: at a pitch of 12 mm" in study[2]


def test_a_design_file_states_its_array_and_options_stand_above_it(study):
    record, folder, _ = study
    assert [record[name] for name in ("rows", "columns", "pitch_mm", "polarity")] == [1, 2, 12.0, "up,down"]
    assert {path.name for path in folder.iterdir()} >= set(crosstalk.FILES)
    assert (folder / "ARRAY.md").read_text("utf-8").startswith("# How the beams of an array")


REFUSALS = {
    "--pitch 8": "beams overlap: the pitch must exceed D = 8 mm; got 8 mm",
    "--polarity up,down": "polarity lists 2 magnets, and 3 x 3 beams have 9: give one for each, row by row",
    "--polarity left": "polarity must be up, checkerboard, rows, or a list of up and down; got 'left'",
    "--polarity chekerboard": "list of up and down; got 'chekerboard': did you mean checkerboard?",
    "--rows 1 --columns 1": "an array has two beams or more; got 1 x 1: raise rows or columns",
    "--rows 17": "rows of an array must lie between 1 and 16; got 17",
    "--pitch 8.5 --set c=4 --level finite": "S2 lies inside the beam of a neighbour at a pitch of 8.5 mm",
    "--reject-ambient --level finite": "27 readings do not tell: take two chips",
    "--error 0": "--error must be above 0 and below 100 percent; got 0",
    "--set E=0.02 --pitch 8.5 --polarity rows --level finite": "take more than 9.631 mm, another polarity",
}


@pytest.mark.parametrize("words", REFUSALS)
def test_refusals(run, words):
    status, out, err = run("array", "paper", *words.split())
    assert (status, out) == (2, "")
    assert REFUSALS[words] in err


# One array as one sensor

PADS = '[array]\nrows = 2\ncolumns = 2\npitch = 12\npolarity = "checkerboard"\n'
PLACES = '[array]\nplaces = ["0,0", "12,0", "6,11"]\npolarity = ["up", "down", "up"]\n'


def test_elements_of_an_array_read_the_fields_of_all_its_magnets_together():
    """By superposition of single sensors' fields at places in common; one of three magnets lies the other way up."""
    array = ArrayDesign(DESIGN, np.array([[0.0, 0.0], [12.0, 0.0], [6.0, 11.0]]), np.array([1.0, -1.0, 1.0]))
    shift, tilt = shifts(1, 3)[0], np.array([[0.0, 0.1], [0.05, -0.02], [0.0, 0.0]])
    elements = parts.of_design(array)
    assert parts.columns(elements)[:4] == ["b1_S1", "b1_S2", "b1_S3", "b2_S1"]
    points = np.array([element.position for element in elements])
    B = sum(
        pole * field_at(points - [*place, 0.0], DESIGN, shift=s, tilt=t)
        for place, pole, s, t in zip(array.places, array.poles, shift, tilt, strict=True)
    )
    expected = (B * [element.direction for element in elements]).sum(axis=1).reshape(3, 3)
    whole, own = beam_arrays.readings_in_poses(array, shift, tilt)
    assert whole == pytest.approx(expected, rel=1e-9)
    alone = field_at(points[3:4] - [12.0, 0.0, 0.0], DESIGN, shift=shift[1], tilt=tilt[1])[0]
    assert own[1, 0] == pytest.approx(-alone @ elements[3].direction, rel=1e-9)


def test_a_stream_of_frames_follows_its_beams_and_knows_those_without_readings():
    array, shift = beam_array(CODER.forward, 2, 2, 10.0, "checkerboard"), shifts(6, 4)
    readings = readings_of_array(array, shift)
    stream = ArrayStream(CODER, array)
    for k in (0, 1):
        assert stream.step(readings[k]).shift == pytest.approx(shift[k], abs=1e-9)
    # a beam without readings stays where it was last: there its neighbours have their poses still
    held = np.array([shift[2][0], shift[1][1], shift[2][2], shift[2][3]])
    lost = readings_of_array(array, held[None])[0]
    lost[1, 2] = np.nan
    frame = stream.step(lost)
    assert frame.status == ["ok", "not_finite", "ok", "ok"]
    assert frame.shift[[0, 2, 3]] == pytest.approx(held[[0, 2, 3]], abs=1e-9)
    assert np.isnan(frame.shift[1]).all()
    # one that no pose explains does not hide the others either
    lost[1] = 0.06
    frame = stream.step(lost)
    assert frame.status == ["ok", "out_of_workspace", "ok", "ok"]
    assert frame.shift[[0, 2, 3]] == pytest.approx(held[[0, 2, 3]], abs=1e-9)
    # what each beam reads of its own magnet, and a zero that takes drifts off
    assert frame.own[0] == pytest.approx(readings_with_slopes(CODER.forward, held[0][:, None])[0][:, 0], abs=1e-12)
    drift = np.random.default_rng(1).normal(0, 1e-3, (4, 3))
    stream.zero(readings_of_array(array, np.zeros((2, 4, 3))) + drift)
    assert stream.step(readings[3] + drift).shift == pytest.approx(shift[3], abs=1e-9)


def test_beams_at_rest_do_not_hide_that_another_one_is_loaded(chips):
    """Noise at rest may be the tolerances of a built sensor: of all beams together only where none is loaded."""
    pads = ArrayDesign(chips.forward.design, np.array([[0.0, 0.0], [16.0, 0.0], [0.0, 16.0]]), np.ones(3))
    pressed, noise = np.zeros((3, 3)), chips.sigma * np.random.default_rng(1).normal(size=(20, 3, 3))
    pressed[1, 2] = -0.8
    seen, (deviation,) = [], decode(chips, readings_at(chips.forward, np.zeros((3, 1))).T).noise_N
    for shift in (pressed, np.zeros((3, 3))):
        decoding = ArrayDecoder(pads, chips, frame_statuses(chips))
        fields = readings_of_array(decoding.stream.array, shift[None]) + noise
        rows = [dict(zip(decoding.columns, decoding.row(frame, None), strict=True)) for frame in fields]
        seen.append(Counter(row["status"] for row in rows))
        assert Counter(row["b1_status"] for row in rows).keys() == {"ok", "uncalibrated"}
        # a force at rest is no failure, and as small as noise makes it
        assert (np.abs([[row[f"b1_force_{axis}_N"] for axis in "xyz"] for row in rows]) < 4 * deviation).all()
    assert seen[0] == {"ok": 20}
    assert seen[1]["uncalibrated"] > 10
    assert frame_status(["ok", "not_finite", "jump"], np.ones((3, 3))) == "not_finite"
    assert frame_status(["ok", "uncalibrated", "jump"], np.ones((3, 3))) == "jump"


def test_an_array_rejects_a_uniform_field_with_two_chips_a_beam_also_where_a_beam_reads_nonsense():
    chips = decoder(replace(DESIGN, hall_layout="tle493d-w2b6", chip_count=2, chip_x=5.0, chip_noise=5e-5))
    array, shift = replace(beam_array(chips.forward, 1, 3, 20.0, "checkerboard"), ambient=True), shifts(1, 3)
    by_field = np.array([element.direction for element in chips.forward.elements]) @ [3e-4, -2e-4, 4e-4]
    readings, stream = readings_of_array(array, shift)[0] + by_field, ArrayStream(chips, array)
    found = stream.step(readings)
    assert found.shift == pytest.approx(shift[0], abs=1e-7)
    # what a beam reads of its own magnet has no field
    assert found.own[0] == pytest.approx(readings_with_slopes(chips.forward, shift[0, 0][:, None])[0][:, 0], abs=1e-9)
    readings[1] += [0.0, 0.02, 0.0, 0.0, 0.0, -0.02]
    found = stream.step(readings)
    assert [word == "ok" for word in found.status] == [True, False, True]
    assert found.shift[[0, 2]] == pytest.approx(shift[0, [0, 2]], abs=1e-5)


def test_beams_that_are_made_otherwise_are_read_and_decoded_by_their_own_models():
    """A magnet that is larger, stronger, displaced and tilted, and an element off its place, in one of two beams."""
    other = replace(DESIGN, magnet_diameter=4.2, remanence=1.3)
    moved = [replace(e, position=tuple(np.add(e.position, [0.1, -0.2, 0.05]))) for e in parts.of_design(other)]
    mount = np.array([0.1, 0.05, -0.1]), np.array([0.03, -0.02])
    coders = [CODER, decoder(other, elements=moved, mount=mount)]
    array, shift = beam_array(CODER.forward, 1, 2, 12.0, "up"), shifts(1, 2)
    array = replace(array, made=tuple(coder.forward for coder in coders))
    (values,) = readings_of_array(array, shift)
    places = shift[0] + [[0.0, 0.0, 0.0], mount[0]]
    fields = [
        field_at(
            np.add([e.position for e in moved], [12.0 * step, 0.0, 0.0]),
            design, shift=places[k], tilt=[(0.0, 0.0), mount[1]][k],
        )
        for k, (design, step) in enumerate([(DESIGN, 1), (other, 0)])
    ]  # fmt: skip
    expected = (sum(fields) * [e.direction for e in moved]).sum(axis=1)
    assert values[1] == pytest.approx(expected, rel=1e-9)
    found = ArrayStream(coders, array).step(values)
    assert found.shift == pytest.approx(shift[0], abs=1e-8)


def test_a_design_file_with_an_array_is_read_decoded_and_streamed_as_one_sensor(run, tmp_path):
    path = tmp_path / "pads.toml"
    path.write_text(PADS, "utf-8")
    read = json.loads(run("readings", path, "--shift=0.1,0,-0.6", "--beam", "2", "--json")[1])
    assert [beam["north"] for beam in read["beams"]] == ["down", "up", "up", "down"]
    assert read["beams"][0]["shift_mm"] == [0, 0, 0]
    words = ("--level", "paper", "--json", "--readings=" + ",".join(map(str, read["readings_V"])))
    status, out, err = run("decode", path, *words)
    assert status == 0, err
    record = json.loads(out)
    # level paper does not tilt the magnet, as --shift alone
    assert [beam["shift_mm"] for beam in record["beams"]] == [
        pytest.approx(each, abs=1e-6) for each in ([0, 0, 0], [0.1, 0, -0.6], [0, 0, 0], [0, 0, 0])
    ]
    assert record["force_N"] == pytest.approx(np.sum([beam["force_N"] for beam in record["beams"]], axis=0))
    table = tmp_path / "rows.csv"
    rest = json.loads(run("readings", path, "--json")[1])
    frames = [rest["readings_V"]] * 3 + [read["readings_V"]] * 3
    rows = pd.DataFrame(frames, columns=[f"{name}_V" for name in read["elements"]])
    rows.insert(0, "time_s", 0.1 * np.arange(6))
    rows.to_csv(table, index=False)
    status, _, err = run(
        "decode", path, "--file", table, "--zero", "0.25", "--level", "paper", "--out", "decoded.csv"
    )
    assert status == 0, err
    status, _, err = run("stream", path, "--port", table, "--speed", 0, "--level", "paper", "--out", "streamed.csv")
    assert status == 0, err
    decoded, streamed = (pd.read_csv(name) for name in ("decoded.csv", "streamed.csv"))
    force = [f"b{k}_force_{axis}_N" for k in range(1, 5) for axis in "xyz"]
    assert streamed[force].to_numpy() == pytest.approx(decoded[force].to_numpy(), abs=1e-9)
    assert decoded["force_z_N"].to_numpy() == pytest.approx(decoded[force[2::3]].sum(axis=1).to_numpy())
    assert decoded["b2_shift_z_mm"].iloc[-1] == pytest.approx(-0.6, abs=1e-6)
    (tmp_path / "places.toml").write_text(PLACES, "utf-8")
    three = json.loads(run("readings", "places.toml", "--json")[1])
    assert [beam["place_mm"] for beam in three["beams"]] == [[0, 0], [12, 0], [6, 11]]


ARRAYS = {
    'places = ["0,0", "30,0", "9,0", "30,0"]': "places 2 and 4 are 0 mm apart: beams overlap, so set them more",
    'places = ["0,0", "1e6,0"]': "an array may be 1000 mm wide from its first to its last beam; got 1e+06 mm",
    'places = ["0,0", "12"]': "places of an array are X,Y in mm, such as '12,0'; got '12'",
    'places = ["0,0", "12,0"]\npolarity = "rows"': "an array of places has no rows: give its polarity as a list",
    'places = ["0,0", "12,0"]\nrows = 2': "places of an array stand in place of rows: leave one of them out",
}


@pytest.mark.parametrize("table", ARRAYS)
def test_arrays_that_cannot_be(run, tmp_path, table):
    (tmp_path / "pads.toml").write_text(f"[array]\n{table}\n", "utf-8")
    status, out, err = run("readings", "pads.toml")
    assert (status, out) == (2, "")
    assert ARRAYS[table] in err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("readings pads.toml --beam 5", "--beam must lie between 1 and 4; got 5"),
        ("readings paper --beam 1", "--beam works with the table [array] of a design file: leave it out"),
        ("readings pads.toml --depth 1", "the readings of an array take --shift, --tilt and --beam"),
        (
            "decode pads.toml --readings 1,2,3 --level paper",
            "--readings takes 12 numbers, S1,S2,S3 of each of 4",
        ),
        (
            "decode pads.toml --calibration c.json --readings 1,2,3",
            "c.json is no calibration, since it states no format",
        ),
        ("decode pads.toml --readings 1,2,3 --units T", "an array is decoded in the elements' unit"),
        ("firmware pads.toml --out o --ros2", "--ros2 writes a node for one sensor: leave it out"),
        (
            "stream pads.toml --port rows.csv --calibration c.json",
            "c.json is no calibration, since it states no format",
        ),
        (
            "decode pads.toml --readings 1,2,3 --reject-ambient",
            "which 12 readings do not tell: take two chips of three axes or more",
        ),
    ],
)
def test_what_an_array_does_not_take(run, tmp_path, words, sentence):
    (tmp_path / "pads.toml").write_text(PADS, "utf-8")
    (tmp_path / "rows.csv").write_text("time_s\n0\n", "utf-8")
    (tmp_path / "c.json").write_text("{}", "utf-8")
    status, out, err = run(*words.split())
    assert (status, out) == (2, "")
    assert sentence in err.replace("\n", " ")
