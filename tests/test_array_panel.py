"""Forces of an array on the live page: readings and decoded forces are those of the verbs, and what is refused."""

import dataclasses

import numpy as np
import pytest

from geometry.design import BadInput, Design
from studies.inputs.option_groups import Pose
from studies.inputs.user_input import read_design
from studies.mechanics import store
from studies.sensing import array_readings
from studies.sensing.array_readings import ArrayDecoder, Grid
from studies.web import array_answers, state_exports
from studies.web.explorer_state import array_fields, request_of
from studies.web.panels import Memory

STATED = Grid(2, 2, 12.0, "checkerboard")


@pytest.fixture(scope="module")
def memory(tmp_path_factory):
    with store.opened(tmp_path_factory.mktemp("array") / "solved.sqlite") as kept:
        yield Memory(kept)


def asked(array=None, load=None, stated=STATED, **state):
    """The request of a page."""
    content = {"load": load or {}, "array": array or {}, "level": "quick", **state}
    return dataclasses.replace(request_of({"state": content}), stated=stated)


def answer(memory, *args, **state):
    """The data of the panel."""
    ((_, data),) = array_answers.array_panel(asked(*args, **state), "quick", memory)
    return data


def forces(data, name):
    return np.array(data["picture"]["forces"][name])


def test_readings_are_those_of_the_verb_and_their_forces_those_of_the_joint_decoder(memory):
    data = answer(memory, {"beam": "3"}, {"depth": 1.0, "shear": 0.5, "direction": 120})
    request = asked({"beam": "3"}, {"depth": 1.0, "shear": 0.5, "direction": 120})
    coder, _ = array_answers.coder_of(Design())
    array = STATED.design(Design())
    decoder = ArrayDecoder(array, coder, lambda found: found.status)
    sensor = array_answers.Sensor(array, coder, decoder.stream.array, "")
    shift, tilt, _ = array_answers.poses_of(sensor, array_answers.loads_of(request.state, 4))
    assert not shift[[0, 1, 3]].any()
    assert shift[2, 1] / shift[2, 0] == pytest.approx(np.tan(np.radians(120)))
    pose = Pose(shift=",".join(map(str, shift[2])), tilt=",".join(map(str, tilt[2])))
    record = array_readings.read(array, pose, 3).records[0]
    beam, rows = record["beams"][2], data["tables"]["array_readings"]["rows"]
    assert [row["value"] for row in rows] == pytest.approx(beam["readings_V"], rel=1e-9)
    added = np.array([row["beside"] for row in rows]) / Design().hall_gain
    assert added == pytest.approx(np.array(beam["by_neighbours_T"]), rel=1e-6)
    found, words = decoder.frame(np.array(record["readings_T"]).reshape(4, -1), None)
    assert words == ["ok"] * 4
    assert forces(data, "jointly") == pytest.approx(found.force, abs=1e-9)
    assert forces(data, "set") == pytest.approx(found.force, abs=1e-9)


def test_ignored_neighbours_err_where_their_load_changes(memory):
    loads = {"beam": "1", "beam_loads": "2:1.5,0.5,90", "pitch": 9}
    data = answer(memory, loads, {"depth": 0.5})
    error = np.linalg.norm(forces(data, "ignoring") - forces(data, "set"), axis=1)
    rows = data["tables"]["array_errors"]["rows"]
    assert [row["beside"][1] for row in rows] == pytest.approx(error, nan_ok=True)
    assert f"{np.nanmax(error):.2g} N (beam {np.nanargmax(error) + 1})" in data["tables"]["array_forces"]["message"]
    # tared at rest, unpressed neighbours add nothing
    still = answer(memory, {"beam": "1", "pitch": 9}, {"depth": 0.5})
    assert forces(still, "ignoring")[0] == pytest.approx(forces(still, "set")[0], abs=1e-9)
    assert np.nanmax(np.linalg.norm(forces(still, "ignoring")[1:], axis=1)) > 0.05


def test_a_design_that_the_surrogate_refuses_has_formulas(memory):
    data = answer(memory, {}, {"depth": 0.5}, design={"nu": 0.4})
    assert "formulas of level finite (" in data["tables"]["array_forces"]["message"]


@pytest.mark.parametrize(
    ("array", "load", "more", "words"),
    [
        ({"beam": "5"}, {"depth": 1}, {}, "There is no beam 5: the array has 4 beams"),
        ({"beam_loads": "9:1"}, {}, {}, "There is no beam 9"),
        ({"beam_loads": "2:4"}, {}, {}, "Beam 2: a press of 4 mm"),
        ({}, {"depth": 1, "plate_tilt": 5}, {}, "set the plate tilt to 0"),
        ({}, {"depth": 1, "shear": 0.2, "friction": 0.5}, {}, "friction to stick or none"),
        ({"pitch": 7}, {"depth": 1}, {}, "the pitch must exceed D = 8 mm"),
        ({}, {"depth": 1}, {"magnet": "ignored"}, "rigid magnets"),
    ],
)
def test_what_an_array_cannot_bear_is_said_in_its_panel(memory, array, load, more, words):
    data = answer(memory, array, load, **more)
    assert (data["rows"], words in data["message"]) == ([], True), data["message"]


@pytest.mark.parametrize("text", ["2", "2:much", "x:1", "2:1,0,0,0", "2:-1"])
def test_loads_that_are_none_are_refused(text):
    with pytest.raises(BadInput, match=r"beam|BEAM"):
        asked({"beam_loads": text})


@pytest.mark.parametrize("beam", ["nan", 1e400, "1.5", -1])
def test_a_beam_that_is_no_number_of_one_is_refused(beam):
    with pytest.raises(BadInput, match="beam must be a whole number of 1 or more"):
        asked({"beam": beam})


def test_an_exported_design_is_the_array_of_the_page(tmp_path):
    for stated in (STATED, Grid(polarity=("up", "down"), places=((0.0, 0.0), (9.1234567, -3.0)))):
        request = asked({"pitch": 15.5, "polarity": "rows"} if stated is STATED else {}, stated=stated)
        file = tmp_path / "design.toml"
        file.write_text(state_exports.design_file(request))
        wanted = Grid(2, 2, 15.5, "rows") if stated is STATED else stated
        assert array_readings.stated_grid(str(file)) == wanted
        assert read_design(str(file)) == Design()
        assert [field["name"] for field in array_fields(stated)][-1] == "polarity"
    assert array_fields(None) == []
