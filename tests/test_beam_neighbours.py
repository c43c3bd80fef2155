"""Candidates as beams of an array: room, cross-talk and magnets' forces as estimated, as proved, and as written."""

import dataclasses
import json

import numpy as np
import pytest

from geometry import base
from geometry.array_design import grid_array
from geometry.base import WEB
from geometry.design import BadInput, Design
from studies.parts.catalogues import catalogues_of
from studies.parts.requirements import Requirements, read_requirements, stated_requirements
from studies.sensing import crosstalk
from studies.sensing.array_readings import stated_grid
from studies.sizing import beam_neighbours, conflicts, sizing_export
from studies.sizing.candidate_performance import LEAST, performance
from studies.sizing.candidate_variables import Space
from studies.sizing.front_solves import FrontPoint, _in_array
from studies.sizing.sensor_arrays import sensors_of, sensors_of_variant
from studies.sizing.variant_search import sorted_parts

NEEDED = Requirements(force_z=3.0, pitch=10.0, cross_talk=0.01, process="sla", bandwidth=10.0, samples=64, chips=3)
PARTS = sorted_parts(catalogues_of(NEEDED), NEEDED.chips)


def candidate(needed=NEEDED, chips=1, silicone="Dragon Skin 20", wider=0.0):
    names = [[each.name for each in kind] for kind in (PARTS.magnets, PARTS.silicones)]
    part = [(each.name, each.count) for each in PARTS.hall_parts].index(("TMAG5170A1", chips))
    choices = [names[0].index("3x3 N48"), names[1].index(silicone), part]
    return Space(needed, PARTS).rounded(np.array([choices]), np.array([[5.0, 5.8, 0.0, wider, 0.0]]))


def reached(needed=NEEDED, **options):
    sensors = sensors_of(candidate(needed, **options))
    return performance(sensors, sensors.beams(), needed)


def of_pitch(pitch, **options):
    values = reached(dataclasses.replace(NEEDED, pitch=pitch), **options).values
    return {name: float(value[0]) for name, value in values.items()}


def test_errors_fall_with_the_pitch_as_dipoles_have_it():
    near, far = of_pitch(50.0), of_pitch(100.0)
    names = ("neighbours_ignoring", "neighbours_subtracting", "magnets")
    power = {name: np.log2(near[name] / far[name]) for name in names}
    # presses shift along z, of which part of (l0/p)^4 cancels; the second pass has its square
    assert 3.9 < power["neighbours_ignoring"] < 5.1
    assert 7 < power["neighbours_subtracting"] < 10.2
    assert power["magnets"] == pytest.approx(5, rel=1e-9)
    assert near["neighbours_jointly"] == 0


def test_stronger_magnets_change_forces_between_them_and_no_share_of_the_readings():
    sensors = sensors_of(candidate())
    stronger = dataclasses.replace(sensors, remanence=0.9 * sensors.remanence)
    whole, less = (performance(each, each.beams(), NEEDED).values for each in (sensors, stronger))
    assert less["neighbours_subtracting"] == pytest.approx(whole["neighbours_subtracting"], rel=1e-6)
    assert less["magnets"] == pytest.approx(0.81 * whole["magnets"], rel=1e-9)


def test_the_free_polarity_is_the_best_of_all():
    def total(polarity):
        values = reached(dataclasses.replace(NEEDED, polarity=polarity)).values
        return values["neighbours_subtracting"][0] + values["magnets"][0]

    each = {polarity: total(polarity) for polarity in ("up", "checkerboard", "rows")}
    assert total("any") == min(each.values())
    assert len(set(each.values())) == 3


def test_the_estimate_is_near_what_array_proves():
    said, row = reached().values, beam_neighbours.proved(candidate().variant(0).design, NEEDED)
    assert 0.6 < said["neighbours_ignoring"][0] / row["ignoring_N"] < 1.5
    # of second order, and three presses are more alike than random ones
    assert 0.25 < said["neighbours_subtracting"][0] / row["subtracting_N"] < 1.5
    assert row["jointly_N"] < 1e-9
    assert 0.4 < said["magnets"][0] / row["magnets_change_N"] < 2


@pytest.mark.parametrize(("chips", "wider"), [(1, 0.0), (2, 0.4), (3, 0.0)])
def test_room_is_where_the_base_of_an_array_begins(chips, wider):
    made = candidate(chips=chips, wider=wider)
    variant, room = made.variant(0), float(made.room()[0])
    assert sensors_of_variant(variant, NEEDED).room[0] == pytest.approx(room, abs=1e-9)
    plan = base.plan(variant.design, NEEDED.base, NEEDED.process)
    gaps = [min(base._gaps(grid_array(variant.design, 3, 3, each), plan)) for each in (room, 1.01 * room)]
    # chips of two rows may lie beside each other, which the room does not count on
    assert gaps[0] >= WEB - 1e-9
    assert gaps[1] > gaps[0]
    if chips == 1:
        assert gaps[0] == pytest.approx(WEB, abs=1e-9)


def test_pressed_beams_take_more_room_than_those_at_rest():
    sensors = sensors_of(candidate())
    bare = dataclasses.replace(sensors, room=0 * sensors.room)
    light, hard = (
        performance(bare, bare.beams(), dataclasses.replace(NEEDED, force_z=force)).values["room"][0]
        for force in (0.5, 2.5)
    )
    assert 5 < light < hard < 6.5
    # parts and recess decide here
    assert reached().values["room"][0] == sensors.room[0] > hard


def test_beams_that_are_decoded_jointly_have_one_field_in_common_from_two_chips_on():
    needed = dataclasses.replace(NEEDED, decoder="jointly", reject_ambient=True, ambient_error=0.02)
    assert (needed.fewest_chips, dataclasses.replace(needed, decoder="subtracting").fewest_chips) == (2, 3)
    one, two = (reached(needed, chips=chips, wider=0.4 * (chips - 1)) for chips in (1, 2))
    assert two.values["ambient"][0] == 0 < one.values["ambient"][0]
    # joint decoding finds the poses in a field that it does not know, of all frames
    row = beam_neighbours.proved(candidate(chips=2, wider=0.4).variant(0).design, needed)
    assert row["jointly_N"] < 1e-6
    assert row["jointly_no_force_percent"] == 0


@pytest.mark.parametrize(("chips", "how", "rejects"), [(3, "subtracting", "always"), (2, "jointly", "jointly")])
def test_array_tells_of_the_winner_what_the_sizing_proved(tmp_path, run, monkeypatch, chips, how, rejects):
    # fewer pitches, and times of one size
    monkeypatch.setattr(crosstalk, "STEPS", 2)
    monkeypatch.setattr(crosstalk, "SIZES", (4,))
    needed = dataclasses.replace(NEEDED, decoder=how, reject_ambient=True, ambient_error=0.02)
    variant = candidate(chips=chips, wider=0.4 * (chips == 2)).variant(0)
    row = beam_neighbours.proved(variant.design, needed)
    sizing_export.write_design(variant, needed, tmp_path, polarity=row["polarity"])
    status, out, _ = run("array", str(tmp_path / "winner.toml"), "--json")
    told = json.loads(out)
    assert (status, told["rejects_ambient"], row["rejects_ambient"]) == (0, rejects, rejects)
    same = [name for name in row if name.endswith(("_N", "_percent")) and not name.startswith("jointly")]
    assert {name: told[name] for name in same} == pytest.approx({name: row[name] for name in same}, rel=1e-6)
    assert max(told["jointly_N"], row["jointly_N"]) < 1e-6


def test_a_pitch_that_no_beam_fits_is_impossible_at_once():
    (said,) = conflicts.impossible(dataclasses.replace(NEEDED, pitch=3.0, D_low=2.0), catalogues_of(NEEDED))
    assert said.startswith("pitch of 3 mm is impossible: the least is")


def test_one_axis_parts_have_no_base_in_an_array():
    left = {part.name: part.refusal(NEEDED) for part in catalogues_of(NEEDED).left_out}
    assert "made for chips" in left["DRV5055A2"]
    assert not any(part.layout == "three" for part in PARTS.hall_parts)


def test_a_point_whose_magnets_snap_together_fails_with_the_reason():
    variant, values = candidate().variant(0), reached().one(0)
    point = FrontPoint(1, variant, values, values, {}, [], "", "")
    near = _in_array(point, NEEDED)
    assert near.reason == ""
    assert near.array["polarity"] in ("up", "checkerboard", "rows")
    assert near.margins["cross_talk"] == pytest.approx(
        1 - (near.array["subtracting_N"] + near.array["magnets_change_N"]) / 0.03
    )
    soft = dataclasses.replace(variant, design=dataclasses.replace(variant.design, E=0.02, remanence=1.45))
    lost = _in_array(dataclasses.replace(point, variant=soft), dataclasses.replace(NEEDED, pitch=5.1, force_z=0.1))
    assert "snap together" in lost.reason
    assert lost.margins["cross_talk"] == LEAST


def test_the_design_file_states_the_array_and_how_it_is_decoded(tmp_path):
    needed = dataclasses.replace(NEEDED, decoder="ignoring")
    sizing_export.write_design(candidate().variant(0), needed, tmp_path, polarity="rows")
    file = str(tmp_path / "winner.toml")
    grid = stated_grid(file)
    assert (grid.rows, grid.columns, grid.pitch, grid.polarity) == (3, 3, 10.0, "rows")
    stated = stated_requirements(file)
    assert (stated.pitch, stated.cross_talk, stated.decoder) == (10.0, 0.01, "ignoring")
    assert isinstance(grid.design(candidate().variant(0).design).design, Design)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('cross_talk = "1 %"', "cross_talk is that of an array, and needs its pitch"),
        ('pitch = "8 mm"\npolarity = "down"', "polarity"),
        ('pitch = "8 mm"\nD = "9 mm"', "beams overlap: pitch must exceed the diameter D = 9 mm; got 8 mm"),
        ('pitch = "8 mm"\ndecoder = "jointly"\nreject_ambient = true', "needs 2 chips .* set chips = 2"),
        ('pitch = "0 mm"', "pitch must lie between 0.5 and 500 mm; got 0 mm"),
    ],
)
def test_arrays_that_cannot_be_are_refused(tmp_path, text, said):
    file = tmp_path / "needed.toml"
    file.write_text(f"force_z = 3\n{text}\n", encoding="utf-8")
    with pytest.raises(BadInput, match=said):
        read_requirements(str(file))
