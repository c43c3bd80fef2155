"""What `magtip solve`, `analytic`, `compare`, `sweep` and `demo` make of their options, call and print."""

import importlib
import math
import re
import sys
import types
from pathlib import Path
from typing import get_args

import pytest

from analytic import beam
from geometry import design_digest
from geometry.bad_input import MeshError
from geometry.design import paper
from geometry.loads import Load
from studies.inputs import option_groups
from studies.inputs.option_groups import Method, Motion
from studies.simulation import load_cases

QUICK = ("--magnet", "ignored", "--accuracy", "quick")


def test_a_press_has_its_state_as_json(run, strict):
    status, out, err = run("solve", "paper", "--depth", 1, "--json", *QUICK)
    assert (status, err) == (0, "")
    (state,) = strict(out)
    assert (state["status"], state["model"], state["depth_mm"], state["shear_mm"]) == ("ok", "axisymmetric", 1.0, 0.0)
    assert [len(state[key]) for key in ("force_N", "shift_mm")] == [3, 3]
    assert state["force_N"][2] > 0 > state["shift_mm"][2]
    assert 0 < state["contact_radius_mm"] < 4
    assert 0 < state["error_estimate"] < 0.2
    assert [state[key] for key in ("stop", "remark", "onset_depth_from_mm", "inside_out_share")] == [None] * 3 + [0.0]


@pytest.mark.parametrize("flag", [("--depth", 1, "--steps", 2), ("--depths", "0.5,1")])
def test_states_are_lines(run, flag, strict):
    status, out, _ = run("solve", "paper", *flag, "--json", *QUICK)
    assert status == 0
    assert [state["depth_mm"] for state in strict(out)] == [0.5, 1.0]


def test_harmonics_replace_those_of_the_accuracy(run, strict):
    dofs = []
    for count in (1, 2, 3):
        flags = ("--grip", 2, "--shear", 0.1, "--harmonics", count, "--json", *QUICK)
        status, out, _ = run("solve", "paper", *flags)
        (state,) = strict(out)
        assert (status, state["status"], state["model"]) == (0, "ok", "harmonic")
        dofs.append(state["dofs"])
    # displacement and pressure fields: 2 N + 1 in the plane (one more if N = 1), N + 1 along z, N + 1 pressures
    assert dofs[0] < dofs[1] < dofs[2]
    assert (dofs[2] - dofs[1]) / dofs[1] == pytest.approx(3 / 8, rel=0.05)


def test_unstable_state_says_since_when(run, strict):
    # a slender beam buckles under a frictionless plate, the later the larger the patch that holds its tip
    flags = ("--model", "harmonic", "--harmonics", 1, "--set", "L=32", "--json", *QUICK)
    status, out, err = run("solve", "paper", "--depths", "0.4,0.8", *flags)
    assert status == 3
    stable, unstable = strict(out)
    assert (stable["status"], unstable["status"], unstable["depth_mm"]) == ("ok", "unstable", 0.8)
    low, high = re.search(r"depth between (\S+) and (\S+) mm", unstable["message"]).groups()
    assert 0.4 <= float(low) < float(high) <= 0.8
    assert unstable["message"] in err


def test_a_table_of_states_ends_with_their_messages(run):
    status, out, _ = run("solve", "paper", "--set", "L=24", "--depths", "0.0005,2,3", *QUICK)
    assert status == 3
    assert "depth 2, 3 mm: a beam whose tip slides freely" in out.split(" 0.0005 ")[1]
    assert " 0.0005 " in out


@pytest.mark.parametrize("verb", [("sweep", "--axis", "depth=0.5"), ("compare",)], ids=lambda verb: verb[0])
def test_a_design_without_a_magnet_is_all_silicone(run, monkeypatch, strict, verb):
    from studies.simulation import compare

    if verb[0] == "compare":
        full = compare.run
        short = {"depths": (0.5,), "shears": (0.0,), "shear_depth": 0.5}
        monkeypatch.setattr(compare, "run", lambda *args, **options: full(*args, **options, **short))
    none = ("--set", "magnet_diameter=0", "--set", "magnet_height=0")
    status, out, err = run(verb[0], "paper", *verb[1:], *none, "--accuracy", "quick", "--json")
    assert status == 0
    (found,) = strict(out)
    row = found["press"][0] if "press" in found else found
    assert row["fem_force_N"] > 0
    assert err.splitlines() == [
        "magtip: the design has no magnet (magnet_diameter is 0): it is solved as all silicone"
    ]


def test_failed_solve_keeps_its_states(run, tmp_path, strict):
    flags = ("--json", "--out", "last.vtu", *QUICK)
    status, out, err = run("solve", "paper", "--depths", "1,8.9", *flags)
    assert status == 3
    reached, last = strict(out)
    assert reached["status"] == "ok"
    assert last["status"] == "not_converged"
    assert 1 < last["depth_mm"] < 8.9
    assert last["message"] in err
    assert err.count("\n") == 1
    assert [path.name for path in tmp_path.glob("[!.]*")] == ["last.vtu"]


def test_a_mesh_that_cannot_be_made_is_a_failed_solve(run, monkeypatch, strict):
    from fem import equilibrium

    (good,) = strict(run("solve", "paper", "--depth", 1, "--json", *QUICK)[1])

    def fail(*_, **__):
        raise MeshError("the section's outline could not be meshed: take a smaller size")

    monkeypatch.setattr(equilibrium, "path_models", fail)
    status, out, err = run("solve", "paper", "--depth", 1, "--json")
    assert (status, err) == (3, "magtip: the section's outline could not be meshed: take a smaller size\n")
    (state,) = strict(out)
    assert set(state) == set(good)
    assert (state["status"], state["force_N"]) == ("not_converged", None)


@pytest.mark.parametrize("shear", [0.0, -0.5])
def test_analytic_json(run, shear, strict):
    status, out, err = run("analytic", "paper", "--depth", 2, "--shear", shear, "--json")
    assert (status, err) == (0, "")
    (record,) = strict(out)
    expected = beam.solve(paper(), Load(depth=2.0, shear_x=shear, friction="stick"))
    assert tuple(record["force_N"]) == expected.force
    assert tuple(record["shift_mm"]) == expected.shift
    assert len(record["readings_T"]) == len(record["readings_V"]) == 3
    assert (record["status"], record["level"], record["shear_mm"]) == ("ok", "paper", shear)


def test_analytic_states_say_for_which_sensor_they_are(run, refusal, strict, tmp_path):
    """As those of a solve do: they are read without a warning for their design, and refused for another one."""
    lines = [run("analytic", "paper", "--depth", depth, "--level", "finite", "--json")[1] for depth in (1, 2)]
    (tmp_path / "states.jsonl").write_text("".join(lines))
    (record,) = strict(lines[0])
    assert record["made_for"] == design_digest.of_mechanics(paper())
    status, out, err = run("readings", "paper", "--responses", "states.jsonl", "--json")
    assert (status, err) == (0, "")
    assert strict(out)[0]["readings_T"] == record["readings_T"]
    assert "made for another sensor" in refusal(
        "readings", "paper", "--set", "E=0.6", "--responses", "states.jsonl", "--json"
    )
    assert "made_for" not in run("analytic", "paper", "--depth", 1)[1].replace(" ", "_")


@pytest.mark.parametrize(
    ("given", "loads"),
    [
        ({"depth": 1.0}, [Load(1.0)]),
        ({"depth": 1.0, "steps": 2}, [Load(0.5), Load(1.0)]),
        ({"depths": "1,2"}, [Load(1.0), Load(2.0)]),
        ({"depth": 1.0, "shear": -0.5}, [Load(1.0, -0.5, friction="stick")]),
        ({"depth": 1.0, "shear": 1.0, "friction": "none"}, [Load(1.0, 1.0)]),
        ({"depth": 1.0, "shear": 1.0, "friction": "0.5"}, [Load(1.0, 1.0, friction=0.5)]),
        (
            {"depth": 1.0, "shear": 1.0, "steps": 2},
            [Load(1.0, 0.5, friction="stick"), Load(1.0, 1.0, friction="stick")],
        ),
        ({"grip": 2.0, "shear": 1.0}, [Load(0.0, 1.0, grip=2.0)]),
        ({"depth": 1.0, "shear_y": 0.5}, [Load(1.0, 0.0, 0.5, friction="stick")]),
        ({"depth": 1.0, "plate_tilt": 90 / math.pi}, [Load(1.0, plate_tilt=0.5)]),
    ],
)
def test_options_as_loads(given, loads):
    assert load_cases.loads_of(Motion(**given)) == loads


def test_choices_match_the_solver():
    from fem import accuracy as accuracy_levels
    from fem import scene
    from studies.inputs.user_input import AccuracyName

    assert get_args(option_groups.Model) == get_args(scene.Model)
    assert set(get_args(AccuracyName)) == set(accuracy_levels.LEVELS)


@pytest.fixture
def fake(monkeypatch):
    """Replace the `run` of a study by one that notes its arguments and gives an answer."""

    def replace(name, answer):
        calls = []

        def pretend(*args, progress, **options):
            progress(0.5, "half way")
            calls.append((*args, options))
            return answer

        package, _, stem = f"studies.{name}".rpartition(".")
        module = types.ModuleType(f"studies.{name}")
        module.run, module.FILES, module.WRITTEN = pretend, (), ()
        monkeypatch.setitem(sys.modules, f"studies.{name}", module)
        monkeypatch.setattr(importlib.import_module(package), stem, module, raising=False)
        return calls

    return replace


def test_demo_writes_where_told(run, fake, tmp_path):
    summary = {"sentences": ["The formula holds nowhere."]}
    calls = fake("demo", {"status": "ok", "message": "", "summary": summary})
    status, out, _ = run("demo")
    assert status == 0
    assert summary["sentences"][0] in out
    assert calls[0][0].resolve() == tmp_path / "out" / "demo"


def test_demo_that_lost_a_state_says_so(run, fake):
    fake("demo", {"status": "not_converged", "message": "stopped at 2 mm", "summary": {"sentences": []}})
    status, _, err = run("demo")
    assert status == 3
    assert "stopped at 2 mm" in err


def test_formulas_say_what_is_in_the_way(run, strict):
    status, out, err = run("analytic", "paper", "--depth", 3, "--shear", 2.8, "--set", "c=3", "--json")
    (record,) = strict(out)
    assert status == 0
    assert any("wall overlaps S2" in text for text in record["warnings"])
    assert err.count("warning: ") == len(record["warnings"])
    (full,) = strict(run("analytic", "paper", "--depth", 3, "--set", "l0=5", "--json")[1])
    assert full["saturated"] == [True, False, False]
    assert "S1 is saturated" in full["warnings"]
    _, out, err = run("analytic", "paper", "--depth", 3, "--set", "l0=5")
    assert "S1 is saturated" in err


@pytest.mark.parametrize(
    ("motion", "method", "options"),
    [
        ({"depth": 1.0, "friction": "stick"}, {}, ["--friction stick"]),
        ({"depth": 1.0, "friction": "stick", "shear_y": 1.0}, {}, []),
        ({"depth": 1.0, "friction": "0.5"}, {}, []),
        ({"depth": 1.0}, {"mesh": Path("m.vtu"), "accuracy": "fine"}, ["--accuracy"]),
        ({"depth": 1.0}, {"mesh": Path("m.vtu")}, []),
        ({"depth": 1.0}, {"accuracy": "fine"}, []),
    ],
)
def test_options_of_a_solve_that_another_makes_useless(motion, method, options):
    assert [option for option, _ in load_cases.ineffective_options(Motion(**motion), Method(**method))] == options


def test_options_in_vain_are_said(run):
    err = run("solve", "paper", "--depth", 0.5, "--friction", "stick", "--json", *QUICK)[2]
    assert err == (
        "magtip: warning: --friction stick has no effect: it acts only during a shear, and this load has none\n"
    )
    err = run("analytic", "paper", "--depth", 1, "--set", "law=yeoh", "--json")[2]
    assert err == "magtip: warning: law has no effect: level paper uses E only\n"
