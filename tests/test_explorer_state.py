"""States of the explorer: what they mean, the commands that reproduce them, and the controls of the page."""

import contextlib
import dataclasses
import io
import json
import math
import shlex

import pytest

from analytic import beam
from fem.accuracy import LEVELS
from fem.equilibrium import solve
from fem.solution import Estimates
from geometry.design import PRESETS, BadInput, Design, paper
from geometry.hall_chips import CHIPS
from geometry.loads import Load
from studies.cli import commands
from studies.inputs.user_input import changed_fields
from studies.mechanics import store
from studies.web.explorer_state import RATES, components, explorer_fields, request_of, state_of, wrong_field
from studies.web.state_exports import address_fields, python, shell

STATES = [
    {"load": {"depth": 1}, "level": "quick"},
    {"design": {"D": 10, "law": "yeoh", "yeoh_2": 0.1}, "load": {"depth": 0.8, "friction": "none"}, "level": "quick"},
    {"load": {"depth": 0.7, "shear": -0.3, "direction": 30}, "level": "quick"},
    {"design": {"magnet_diameter": 0, "magnet_height": 0}, "magnet": "ignored", "load": {"depth": 0.9}},
]


@pytest.mark.parametrize("content", STATES, ids=["press", "law", "shear", "silicone"])
def test_commands_reproduce_the_state(content, capsys):
    state = state_of(content)
    force = solve(state.design, state.load, LEVELS[state.level], magnet=state.magnet).response.force
    program, *words = shlex.split(shell(state))
    assert program == "magtip"
    assert commands.run([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["force_N"] == pytest.approx(force, rel=1e-9, abs=1e-12)
    names = {}
    with contextlib.redirect_stdout(io.StringIO()):
        exec(python(state), names)
    assert names["state"].response.force == pytest.approx(force, rel=1e-9, abs=1e-12)


def test_shear_along_an_axis_has_no_component_across():
    for direction, expected in ((0, (2, 0)), (90, (0, 2)), (-90, (0, -2)), (180, (-2, 0)), (450, (0, 2))):
        assert components(2.0, direction) == expected
    x, y = components(2.0, 30)
    assert (x, y) == pytest.approx((3**0.5, 1))


def test_defaults_are_those_of_the_command_line():
    assert state_of({"load": {"depth": 1}}).load.friction == "none"
    assert state_of({"load": {"depth": 1, "shear": 1}}).load.friction == "stick"
    assert state_of({"load": {"depth": 1, "shear": 1, "friction": 0.4}}).load.friction == 0.4


def test_address_and_overrides_name_changed_fields_only():
    state = state_of({"design": {"D": 8, "E": 2, "magnet_north": "up"}})
    assert changed_fields(state.design) == {"E": 2.0, "magnet_north": "up"}
    assert address_fields(state.design) == {"preset": "paper", "E": "2", "magnet_north": "up"}


def test_wrong_field_is_the_one_without_which_the_state_is_accepted():
    assert wrong_field({"state": {"design": {"D": 9, "L": 3}, "load": {"depth": 1}}}) == "L"
    assert wrong_field({"state": {"design": {"D": 9}, "load": {"depth": 1, "shear": 99}}}) == "shear"
    assert wrong_field({"state": {"level": "none"}}) is None


@pytest.mark.parametrize(
    ("message", "words"),
    [
        ({"side": "c"}, "side must be one of a, b"),
        ({"state": {"design": {"d": 8}}}, "did you mean D?"),
        ({"state": {"load": {"grip": 1}}}, "there is no key 'grip'"),
        ({"state": {"load": {"depth": True}}}, "depth must be a finite number"),
        ({"state": {"load": {"depth": 1, "shear": 1, "direction": float("nan")}}}, "finite number of degrees"),
        ({"state": {"load": {"depth": 1, "frequency": -1}}}, "frequency must be 0 Hz or more"),
        ({"state": {"level": "fine"}}, "level must be one of quick, standard"),
    ],
)
def test_impossible_requests_are_refused(message, words):
    with pytest.raises(BadInput, match=words.replace("?", r"\?")):
        request_of(message)


FIELDS = explorer_fields(paper())
NUMBERS = [field for field in FIELDS if field["kind"] in ("number", "logarithmic")]


def test_every_field_of_a_design_has_one_control():
    names = [field["name"] for field in FIELDS if field["scope"] == "design"]
    assert sorted(names) == sorted(spec.name for spec in dataclasses.fields(Design))


@pytest.mark.parametrize("field", NUMBERS, ids=lambda field: field["name"])
def test_slider_lies_in_the_range_and_holds_the_value_of_the_paper(field):
    low, high = field["slider"]
    assert field["low"] <= low <= field["value"] <= high <= field["high"]
    assert 0 < field["step"] <= (high - low) / (2 if field["name"] == "chip_count" else 5)


def test_values_are_those_of_the_design():
    design = Design(D=10, L=14, law="yeoh", yeoh_2=0.1)
    values = {field["name"]: field["value"] for field in explorer_fields(design) if field["scope"] == "design"}
    assert Design(**values) == design


def test_fields_without_effect_name_the_choice_that_they_need():
    needs = {field["name"]: field["needs"] for field in FIELDS}
    assert set(needs) - {"depth", "shear", "direction", "friction", "plate_tilt", *RATES, "magnet"} >= set(
        paper().unused_fields()
    )
    assert needs["yeoh_2"] == {"law": ["yeoh"]}
    assert needs["chip_x"] == {"hall_layout": [*CHIPS, "chip"]}
    assert all(needs[name] for name in paper().unused_fields() if name != "hall_bandwidth")


def test_largest_plate_tilt_is_a_possible_load():
    tilt = next(field for field in FIELDS if field["name"] == "plate_tilt")
    assert Load(plate_tilt=math.radians(tilt["high"])).plate_tilt > 0


def test_grades_of_the_remanence_are_those_of_the_catalogue():
    fields = {field["name"]: field for field in FIELDS}
    grades = {name: sets["remanence"] for name, sets in fields["grade"]["sets"].items()}
    assert grades["N35"] < grades["N42"] < grades["N52"] <= fields["remanence"]["slider"][1]


def test_every_part_of_the_catalogue_makes_a_design():
    for field in (one for one in FIELDS if one["scope"] == "part"):
        assert len(field["sets"]) >= (len(PRESETS) if field["name"] == "preset" else 7)
        for sets in field["sets"].values():
            state_of({"design": {"D": 20, "L": 30, "f": 20, "l0": 25, **sets}})


# The verb sweep: its store, what it says of its axes, and models chosen by a tolerance.


def test_sweeps_in_different_folders_share_the_user_s_store(run, tmp_path):
    command = ("sweep", "paper", "--magnet", "ignored", "--accuracy", "quick", "--axis", "depth=0.5", "--json")
    first = run(*command, "--out", "one")
    assert run(*command, "--out", "two")[1] == first[1]
    assert run(*command, "--store", "own.sqlite", "--out", "three")[0] == 0
    with store.opened(tmp_path / "own.sqlite") as own:
        assert own.counts() == (1, 1)
    assert run(*command, "--store", "one/sweep.csv")[0] == 2


def test_a_sweep_over_f_of_a_chip_says_that_f_changes_nothing(run):
    sweep_f = ("sweep", "paper", "--axis", "f=5,6", "--depth", 0.3, "--accuracy", "quick")
    lines = run(*sweep_f, "--set", "hall_layout=tmag5273a1", "--json")[2].splitlines()
    assert lines == ["magtip: warning: axis f has no effect: the results are the same for all its values"]
    assert run(*sweep_f, "--json")[2] == ""
    assert "axis f has no effect: it changes only columns that --wide, --json and --out show" in run(*sweep_f)[2]


def test_reasons_name_the_axes_that_vary_in_the_whole_table(run):
    axes = ("--axis", "D=8,100", "--axis", "E=0.5,1", "--axis", "depth=1")
    status, _, err = run("sweep", "paper", *axes, "--magnet", "ignored", "--accuracy", "quick", "--json")
    assert status == 3
    assert "magtip: D 100 mm, E 0.5 MPa; D 100 mm, E 1 MPa: L must exceed the tip radius D/2 = 50 mm" in err


def test_unstable_cases_are_counted_beside_the_table(run):
    long = ("--set", "L=24", "--set", "l0=20", "--magnet", "ignored", "--accuracy", "quick")
    status, _, err = run("sweep", "paper", *long, "--axis", "depth=0.5,2", "--json")
    assert status == 3
    assert "magtip: 1 of 2 cases are unstable" in err


def test_a_tolerance_chooses_the_model_of_each_case(run, strict):
    command = ("sweep", "paper", "--tolerance", "20%", "--axis", "depth=0.4,2", "--set", "nu=0.3", "--json")
    status, out, err = run(*command)
    light, deep = strict(out)
    for row in (light, deep):
        assert row["expected_error"] <= 0.2
        assert row["force_error_percent"] == pytest.approx(
            100 * (row["analytic_force_N"] / row["chosen_force_N"] - 1), rel=1e-9
        )
    # formulas are calibrated for nearly incompressible silicone
    assert {light["chosen_model"], deep["chosen_model"]} == {"axisymmetric quick"}
    assert (status, "axisymmetric quick in 2 of 2 cases" in err) == (0, True)
    light, deep = strict(run(*command[:-3], "--json")[1])
    assert (light["chosen_model"], light["solve"]) == ("formula finite", 0)
    own = beam.solve(paper(), Load(depth=0.4), "finite").force[2]
    assert light["chosen_force_N"] == pytest.approx(own, rel=1e-12)


@pytest.mark.parametrize(
    ("finer", "status", "model", "said"),
    [(0.01, "ok", "axisymmetric standard", ""), (0.04, "beyond_tolerance", "axisymmetric fine", "4 %, exceeds")],
)
def test_cases_whose_estimates_exceed_the_tolerance_are_solved_again_finer(
    run, strict, traced, monkeypatch, finer, status, model, said
):
    """Those that need it are solved together: a path of both depths at each accuracy."""

    def estimates(one, other, scene):
        value = 0.04 if scene.accuracy.name == "quick" else finer
        return Estimates(force=value, shift=value, tilt=None, sideways=None)

    monkeypatch.setattr("fem.equilibrium.estimate_state", estimates)
    command = ("sweep", "paper", "--set", "magnet_edge_radius=0.4", "--axis", "depth=0.4,0.5", "--tolerance", "2%")
    found, out, err = run(*command, "--json")
    rows = strict(out)
    assert [(row["status"], row["chosen_model"]) for row in rows] == [(status, model)] * 2
    assert [row["error_estimate"] for row in rows] == [finer] * 2
    assert all(said in row["message"] for row in rows)
    assert [row["solve"] for row in rows] == [1, 1]
    names = ["quick", "standard", "fine"]
    assert [scene.accuracy.name for scene in traced] == names[: names.index(model.split()[1]) + 1]
    assert all(len(scene.loads) == 2 for scene in traced)
    assert found == (0 if status == "ok" else 3)
    assert ("2 cases are not known to meet the tolerance" in err) == (status != "ok")
    # what is in the store needs no solve
    assert strict(run(*command, "--json")[1]) == rows
    assert len(traced) == names.index(model.split()[1]) + 1
