"""What verbs do with a design file that states an array: those that take one beam of it say so."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analytic import parts
from analytic.beam_arrays import readings_in_poses
from analytic.decode import decode, decoder
from analytic.hall import field_at, means_over_plates, plates_of
from analytic.inverse.forward_model import rotation
from analytic.inverse.response_surface import force_and_load
from analytic.surroundings import IronPlane
from geometry.array_design import ArrayDesign
from geometry.design import paper
from studies.calibration import calibration_study, press_plan, simulated_bench
from studies.cli import commands, main
from studies.inputs.option_groups import SourceOfLoad
from studies.inputs.user_input import read_design
from studies.parts.part_tolerances import tolerances
from studies.sensing.array_readings import stated_array
from studies.sensing.disturbed_loads import loads_of
from studies.sensitivity.made_sensors import made_sensors
from studies.simulation import mechanics_sources

DESIGN = paper()
CODER = decoder(DESIGN, mechanics_sources.source_of(DESIGN, SourceOfLoad(level="paper")).law)
ARRAY = (
    'base = "paper"\nhall_noise = 0.001\n[array]\nrows = 1\ncolumns = 2\npitch = 20.0\npolarity = ["up", "down"]\n'
)


@pytest.fixture
def pair(tmp_path):
    file = tmp_path / "pair.toml"
    file.write_text(ARRAY)
    return file


def said(capsys, *words):
    """Standard output of a command that succeeds, and the sentences beside it that tell of one beam."""
    assert main([*map(str, words)]) == 0
    printed, beside = capsys.readouterr()
    return printed, [line for line in beside.splitlines() if "one of its beams" in line]


def test_a_verb_of_one_beam_says_so_once_and_answers_as_without_the_table(pair, tmp_path, capsys):
    beam = tmp_path / "beam.toml"
    beam.write_text(ARRAY.partition("[array]")[0])
    for words in (["analytic", "--depth", "1"], ["sweep", "--axis", "D=8,9", "--depth", "1", "--models", "paper"]):
        verb, *options = words
        of_array, sentences = said(capsys, verb, pair, *options, "--json")
        of_beam, none = said(capsys, verb, beam, *options, "--json")
        assert of_array == of_beam
        assert (len(sentences), none) == (1, [])


def test_a_verb_that_takes_arrays_does_not_say_so(pair, capsys):
    assert said(capsys, "readings", pair)[1] == []


def test_verbs_that_read_the_table_are_those_declared_to_take_arrays():
    sources = [file.read_text() for file in Path(commands.__file__).parent.glob("*_commands.py")]
    found = [part for source in sources for part in re.split(r"^(?=@verb\b)", source, flags=re.MULTILINE)[1:]]
    reads = {part for part in found if "stated_array" in part or "grid_of" in part}
    assert {part for part in found if "arrays=True" in part} == reads
    assert len(reads) > 5


# disturb


def test_beams_far_apart_are_disturbed_as_a_single_sensor(tmp_path, capsys):
    apart, single = tmp_path / "apart.toml", tmp_path / "single.toml"
    apart.write_text(ARRAY.replace("20.0", "300.0"))
    single.write_text(ARRAY.partition("[array]")[0])
    for file in (apart, single):
        assert main(["disturb", str(file), "--level", "paper", "--out", str(tmp_path / file.stem)]) == 0
    tables = [
        pd.read_csv(tmp_path / name / "disturbances.csv").set_index("disturbance") for name in ("apart", "single")
    ]
    array, one = (table.error_N for table in tables)
    for name in ("uniform field", "iron plane below", "iron object"):
        assert array[name] == pytest.approx(one[name], rel=1e-3)
    beams = pd.read_csv(tmp_path / "apart" / "beams.csv").pivot(index="disturbance", columns="beam", values="error_N")
    assert beams.max(axis=1).to_dict() == array.to_dict()
    # iron beside the second beam is far from the first
    assert beams.loc["iron plane beside", 1] < 1e-3 * beams.loc["iron plane beside", 2]
    assert tables[0].error_beams_median_N["iron plane beside"] == pytest.approx(
        beams.loc["iron plane beside"].mean(), rel=1e-5
    )
    assert "Errors are those of all 2 beams" in (tmp_path / "apart" / "DISTURB.md").read_text("utf-8")


def test_iron_has_an_image_of_each_magnet():
    array = ArrayDesign(DESIGN, np.array([[0.0, 0.0], [12.0, 0.0]]), np.array([1.0, -1.0]))
    loads, _, _ = loads_of(CODER, None, array)
    plane = IronPlane(DESIGN, np.array([0.0, 0.0, -8.0]), np.array([0.0, 0.0, 1.0]))
    elements = parts.of_design(array)
    points, owners = plates_of(elements)
    images = [
        pole * field_at(points - [*place, 0.0], DESIGN, shift=(0.0, 0.0, -16.0 - 2 * DESIGN.H))
        for place, pole in zip(array.places, array.poles, strict=True)
    ]
    expected = 999 / 1001 * means_over_plates(sum(images), elements, owners)[0]
    assert loads.change(plane)[0] == pytest.approx(expected, rel=1e-9)
    # each beam has all loads, and in no frame but the first those of its neighbour
    frames = loads.force.reshape(-1, 2, 3)
    assert sorted(map(tuple, frames[:, 0])) == sorted(map(tuple, frames[:, 1]))
    assert (frames[1:, 0] != frames[1:, 1]).any(axis=1).all()


def test_a_field_in_common_costs_less_noise_than_one_of_each_beam():
    design = replace(DESIGN, hall_layout="tle493d-w2b6", chip_count=3, chip_x=5.0, chip_noise=5e-5)
    array = ArrayDesign(design, np.array([[0.0, 0.0], [400.0, 0.0]]), np.ones(2))
    coder = decoder(design, CODER.mechanics)
    loads, _, _ = loads_of(coder, None, array, reject_ambient=True)
    # far apart the noise is that of single sensors
    own = decode(coder, loads.readings(loads.poses.shift.T).reshape(-1, 9)).noise_N
    alone, common = (loads.noise(coder, ambient=ambient) for ambient in (False, True))
    assert alone == pytest.approx(own**2, rel=1e-3, abs=1e-9)
    rejecting = decoder(design, CODER.mechanics, reject_ambient=True)
    by_itself = decode(rejecting, loads.readings(loads.poses.shift.T).reshape(-1, 9)).noise_N ** 2
    assert (alone <= common * (1 + 1e-9)).all()
    assert (common <= by_itself * (1 + 1e-3) + 1e-9).all()
    assert common.mean() < (alone + by_itself).mean() / 2
    assert loads.price(coder) == pytest.approx(np.sqrt(np.median(common / alone)))


def test_an_array_of_one_chip_a_beam_cannot_reject_a_field(pair, capsys):
    words = ["--level", "paper", "--reject-ambient", "--set", "hall_layout=tle493d-w2b6"]
    assert main(["disturb", str(pair), *words]) == 2
    assert (
        "three more unknowns beside the 6 of 2 poses, which 6 readings do not tell: take two"
        in capsys.readouterr().err
    )


# bench and calibrate

PAIR = (
    'base = "paper"\nhall_noise = 0.0002\n[array]\nrows = 1\ncolumns = 2\npitch = 14.0\npolarity = ["up", "down"]\n'
)
ROWS = 11


@pytest.fixture(scope="module")
def made_pair(tmp_path_factory):
    """Two made sensors: presses on each, frames with both loaded, rest first, their forces, and the mechanics."""
    folder = tmp_path_factory.mktemp("pair")
    (folder / "pair.toml").write_text(PAIR)
    design = read_design(str(folder / "pair.toml"))
    array = stated_array(str(folder / "pair.toml"), design)
    law, rng = mechanics_sources.of_surrogate(design).law, np.random.default_rng(2)
    beams = simulated_bench.beams_of(array, made_sensors(design, tolerances(), 2, 11))

    def states(count, beam):
        w, angle = -law.sink * rng.uniform(0.1, 0.8, count), rng.uniform(0, 2 * np.pi, count)
        u = law.reach * rng.uniform(0, 0.7, count) * np.sqrt(-w / law.sink)
        shift = np.stack([u * np.cos(angle), u * np.sin(angle), w], axis=1)
        shift[0] = 0.0
        force = force_and_load(law, shift.T.copy())[0].T * beam.designs[0].E / design.E
        return simulated_bench.States(force, shift, rotation(law.tilt, shift.T.copy()).T)

    columns, stand, tables = simulated_bench.columns(array), simulated_bench.Stand(0.005), []
    rest = simulated_bench.States(*(np.zeros((ROWS, size)) for size in (3, 3, 2)))
    for k, beam in enumerate(beams):
        pressed = states(ROWS, beam)
        read = simulated_bench.readings_of_beams(
            beams, [pressed if j == k else rest for j in range(2)], array.places, stand, rng
        )
        felt = pressed.force + stand.force_noise * rng.normal(size=(ROWS, 3))
        table = pd.DataFrame(np.hstack([read, felt]), columns=[*columns, "Fx_N", "Fy_N", "Fz_N"])
        tables.append(table.assign(beam=[0, *[k + 1] * (ROWS - 1)]))
    pd.concat(tables).to_csv(folder / "bench.csv", index=False)
    both = [states(15, beam) for beam in beams]
    frames = simulated_bench.readings_of_beams(beams, both, array.places, stand, rng)
    still, element = readings_in_poses(array, np.zeros((2, 3)), np.zeros((2, 2)))[0], parts.of_design(design)[0]
    tared = frames - frames[0] + element.null + element.gain * still.ravel()
    for name, read in (("frames", frames), ("tared", tared)):
        pd.DataFrame(read, columns=columns).to_csv(folder / f"{name}.csv", index=False)
    return folder, np.stack([one.force for one in both], axis=1), law


def test_beams_of_an_array_are_calibrated_in_turn_and_decoded_jointly(made_pair, monkeypatch, capsys):
    folder, force, law = made_pair
    monkeypatch.setattr(calibration_study, "mechanics_of", lambda *_: (law, "surrogate", 0.01))
    # no learning curve
    monkeypatch.setattr(calibration_study, "SIZES", ())
    file, out = str(folder / "pair.toml"), folder / "out"
    assert (
        main(["calibrate", file, str(folder / "bench.csv"), "--out", str(out), "--json", "--force-noise", "0.005"])
        == 0
    )
    found = json.loads(capsys.readouterr().out)
    errors = {row["beam"]: row["rmse_N"] for row in found["held_out"] if row["method"] == "calibration"}
    assert sorted(errors) == [1, 2]
    decoded = {}
    for name, words in (
        ("frames", ["--calibration", str(out / "calibration.json")]),
        ("tared", ["--level", "surrogate"]),
    ):
        table = folder / f"{name}_decoded.csv"
        assert main(["decode", file, "--file", str(folder / f"{name}.csv"), "--out", str(table), *words]) == 0
        decoded[name] = pd.read_csv(table)

    def of_beams(name, what):
        names = [f"b{k}_{what}_{axis}_N" for k in (1, 2) for axis in "xyz"]
        return decoded[name][names].to_numpy().reshape(-1, 2, 3)

    off = {name: of_beams(name, "force") - force for name in decoded}
    error = {name: np.sqrt((each**2).sum(axis=2).mean(axis=0)) for name, each in off.items()}
    # within the intervals, and far below a decoder that is tared and knows the design only
    assert (error["frames"] < error["tared"] / 8).all()
    assert (np.abs(off["frames"]) <= of_beams("frames", "half_width")).mean() > 0.85
    assert max(errors.values()) < 0.1
    # one frame, and a calibration that is not this array's
    one = pd.read_csv(folder / "frames.csv").iloc[3].tolist()
    words = ["--calibration", str(out / "calibration.json"), "--json", "--readings", ",".join(map(repr, one))]
    capsys.readouterr()
    assert main(["decode", file, *words]) == 0
    beams = json.loads(capsys.readouterr().out)["beams"]
    assert [beam["force_N"][2] for beam in beams] == pytest.approx(
        decoded["frames"].loc[3, ["b1_force_z_N", "b2_force_z_N"]]
    )
    assert all(np.isfinite(beam["half_width_N"]).all() for beam in beams)
    (folder / "wider.toml").write_text(PAIR.replace("14.0", "15.0"))
    assert main(["decode", str(folder / "wider.toml"), *words]) == 2
    assert "is the calibration of an array with other places or polarity" in capsys.readouterr().err
    assert main(["decode", "paper", "--set", "hall_noise=0.0002", *words]) == 2
    assert "is the calibration of an array: give its design file" in capsys.readouterr().err
    assert main(["firmware", file, "--calibration", str(out / "calibration.json"), "--out", str(folder / "c")]) == 2
    assert "the decoder in C has one for all" in capsys.readouterr().err


WRONG = {
    "has no column beam": lambda rows: rows.drop(columns="beam"),
    "beam must be a number from 1 to 2, or 0 at rest; got 3": lambda rows: rows.replace({"beam": {2: 3}}),
    "names no beam, but has a force of": lambda rows: rows.replace({"beam": {2: None}}),
    "no row presses beam 2": lambda rows: rows[rows.beam != 2],
    "temperatures of an array's bench are not used yet": lambda rows: rows.assign(temperature_C=20.0),
}


@pytest.mark.parametrize("sentence", WRONG)
def test_a_bench_of_an_array_that_cannot_be_used_is_one_sentence(sentence, made_pair, tmp_path, capsys):
    rows = WRONG[sentence](pd.read_csv(made_pair[0] / "bench.csv"))
    rows.to_csv(tmp_path / "bench.csv", index=False)
    assert main(["calibrate", str(made_pair[0] / "pair.toml"), str(tmp_path / "bench.csv")]) == 2
    assert sentence in capsys.readouterr().err.replace("\n", " ")


def test_the_plan_of_an_array_presses_each_beam_with_the_same_loads(made_pair, monkeypatch):
    folder, _, law = made_pair
    design = read_design(str(folder / "pair.toml"))
    array = stated_array(str(folder / "pair.toml"), design)
    monkeypatch.setattr(calibration_study, "mechanics_of", lambda *_: (law, "surrogate", 0.01))
    plan = press_plan.plan(design, tolerances(), None, count=4)
    table = pd.DataFrame(simulated_bench.rows_of_array(plan, array))
    assert table.beam.tolist() == [0, *[1] * 4, *[2] * 4]
    assert list(table.columns[-10:]) == [*simulated_bench.columns(array), "Fx_N", "Fy_N", "Fz_N", "depth_mm"]
    planned = [name for name in table if name.startswith("planned")]
    assert (table.loc[table.beam == 1, planned].to_numpy() == table.loc[table.beam == 2, planned].to_numpy()).all()
