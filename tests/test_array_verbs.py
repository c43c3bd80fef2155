"""What verbs do with a design file that states an array: those that take one beam of it say so."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analytic import parts
from analytic.decode import decode, decoder
from analytic.hall import field_at, means_over_plates, plates_of
from analytic.surroundings import IronPlane
from geometry.array_design import ArrayDesign
from geometry.design import paper
from studies.cli import commands, main
from studies.inputs.option_groups import SourceOfLoad
from studies.sensing.disturbed_loads import loads_of
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
