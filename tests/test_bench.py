"""The bench at a reduced size: choice of meshes, decks, missing peers, one solve in a process of its own."""

import ast
import itertools
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import skfem

from fem.accuracy import STANDARD
from fem.equilibrium import trace
from geometry.design import paper
from geometry.loads import Load
from studies.validation import bench

ROOT = Path(__file__).resolve().parent.parent
DAT = """
 total force (fx,fy,fz) for set BASE and time  0.5000000E+00

        2.445689E-16 -1.599861E-02  7.0E-01

 total force (fx,fy,fz) for set BASE and time  0.1000000E+01

       -6.317646E-16 -4.357604E-02  1.461206E+00
"""


def answer(error, cpu, status="ok"):
    return {"status": status, "message": "", "cpu_s": cpu, "forces_N": [(0, 0, 1 + error / 100)]}


def cube():
    """A second-order mesh of the cube (0, 2)^3 with the half model's boundaries, its tip the face z = 2."""
    flat = skfem.MeshTet.init_tensor(*[np.linspace(0, 2, 3)] * 3)
    mesh = skfem.MeshTet2.from_mesh(flat)
    return mesh.with_boundaries(
        {"base": lambda x: x[2] < 1e-9, "skin": lambda x: x[2] > 2 - 1e-9, "symmetry": lambda x: x[1] < 1e-9}
    )


def numbers(deck, keyword):
    """The data lines that follow a keyword line."""
    lines = deck.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(keyword)) + 1
    found = []
    for line in lines[start:]:
        if line.startswith("*"):
            break
        found.append([float(v) for v in line.split(",")])
    return np.array(found)


# Figures


def test_medians_tell_a_failure_and_an_error_beyond_tolerance_is_said():
    runs = [answer(0.4, cpu) for cpu in (1.0, 9.0, 2.0)]
    found = bench.median(runs)
    assert (found["cpu_s"], found["runs"]) == (2.0, 3)
    assert bench.median([*runs, answer(0, 1.0, "failed")])["status"] == "failed"
    truth = [(0, 0, 1.0)]
    assert bench.judged(found, truth, 0.5)["error_percent"] == pytest.approx(0.4)
    beyond = bench.judged(found, truth, 0.3)
    assert (beyond["status"], "0.4 %" in beyond["message"]) == ("inaccurate", True)


# CalculiX


def test_a_deck_has_the_mesh_in_the_order_of_calculix_presses_the_tip_and_holds_the_rest():
    deck = bench.deck(cube(), {"E": 2.0, "nu": 0.49, "L": 2.0, "R": 2.0, "depth": 0.5})
    points = numbers(deck, "*NODE, NSET=BODY")[:, 1:]
    cells = numbers(deck, "*ELEMENT, TYPE=C3D10")[:, 1:].astype(int) - 1
    assert len(points) == cube().doflocs.shape[1]
    x = points[cells]
    np.testing.assert_allclose(np.linalg.det(x[:, 1:4] - x[:, :1]).sum() / 6, 8)
    assert (np.linalg.det(x[:, 1:4] - x[:, :1]) > 0).all()
    for k, (a, b) in enumerate([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)], 4):
        np.testing.assert_allclose(x[:, k], (x[:, a] + x[:, b]) / 2, atol=1e-12)
    lines = deck.splitlines()
    start = lines.index("*SURFACE, NAME=TIP, TYPE=ELEMENT") + 1
    faces = [line.split(", S") for line in lines[start : lines.index("*SURFACE, NAME=LOWER, TYPE=ELEMENT")]]
    corners = [cells[int(i) - 1, list(bench.FACES[int(side) - 1])] for i, side in faces]
    assert len(faces) > 2
    np.testing.assert_allclose(points[corners][..., 2], 2)
    base, symmetry = (numbers(deck, f"*NSET, NSET={name}").ravel().astype(int) - 1 for name in ("BASE", "SYMMETRY"))
    assert set(base) == set(np.flatnonzero(points[:, 2] == 0))
    assert set(symmetry) == set(np.flatnonzero((points[:, 1] == 0) & (points[:, 2] > 0)))
    plate = numbers(deck, "*NODE, NSET=PLATE")[:, 1:]
    assert plate[:4, 2] == pytest.approx(2.0)
    assert "PLATE, 3, 3, -0.5" in lines


def test_force_is_the_last_one_of_both_halves():
    assert bench.force(DAT) == pytest.approx((1.0, 2 * 1.461206))
    with pytest.raises(ValueError, match="no force"):
        bench.force("*ERROR")
    assert bench.iterations(" increment 1 attempt 1\n iteration 1\n iteration 2\n") == 2


# FElupe


def test_section_mesh_for_felupe():
    given = bench.section_arrays(paper(), 0.12, 1.0, 0.25)
    points = given["points"]
    assert given["cells"].shape[1] == 6
    assert np.ptp(points[given["base"], 1]) == np.ptp(points[given["axis"], 0]) == 0
    skin = points[given["edges"]].reshape(-1, 2)
    dome = skin[skin[:, 1] > 5]
    np.testing.assert_allclose(np.hypot(dome[:, 0], dome[:, 1] - 5), 4, rtol=1e-12)


def test_scripts_of_peers_and_magtip_do_not_import_each_other():
    def imports(path):
        nodes = list(ast.walk(ast.parse(path.read_text("utf-8"))))
        names = [n.module or "" for n in nodes if isinstance(n, ast.ImportFrom)]
        names += [a.name for n in nodes if isinstance(n, ast.Import) for a in n.names]
        return {name.split(".")[0] for name in names}

    packages = ("geometry", "fem", "analytic", "studies")
    script = ROOT / "studies" / "validation" / "peer_felupe.py"
    assert not imports(script) & set(packages)
    others = [path for package in packages for path in (ROOT / package).rglob("*.py") if path != script]
    assert not [path for path in others if "felupe" in path.read_text("utf-8") and "felupe" in imports(path)]


# Processes


def test_a_solve_in_a_process_of_its_own_gives_the_same_force():
    accuracy = {"section_size": 0.12}
    begin = time.perf_counter()
    found = bench.magtip(bench.task({"magnet": "ignored", "loads": [{"depth": 0.5}]}, {"accuracy": accuracy}))
    whole = time.perf_counter() - begin
    here = trace(paper(), [Load(depth=0.5)], replace(STANDARD, **accuracy), magnet="ignored", estimate=False)
    assert found["status"] == "ok", found
    assert found["forces_N"][0] == pytest.approx(here[0].response.force, rel=1e-9)
    assert 0.001 < found["cpu_s"] < 20
    # the imports are a part of the life of the process
    assert found["import_s"] > 0.05
    assert found["import_s"] + found["cpu_s"] < whole
    assert 40 < found["base_MB"] <= found["peak_MB"] < 2000


def test_a_task_in_a_process_of_its_own_and_a_solve_that_raises():
    for task in ({"task": "modes", "count": 1}, {"task": "field", "points": 9}):
        found = bench.magtip(task)
        assert found["status"] == "ok", found["message"]
        assert found["cpu_s"] > 0
    found = bench.magtip(bench.task({"magnet": "ignored", "loads": [{"depth": 20.0}]}, {}))
    assert found["status"] == "failed"
    assert "depth must be less than" in found["message"]


def test_memory_is_that_of_the_child_alone_and_a_process_beyond_its_limit_is_stopped():
    ballast = np.ones(20_000_000)
    assert bench.measure([sys.executable, "-I", "-S", "-c", "pass"]).peak_MB < 40
    assert ballast[0] == 1
    begin = time.perf_counter()
    ended = bench.measure([sys.executable, "-c", "import time; time.sleep(60)"], limit=0.3)
    assert time.perf_counter() - begin < 10
    assert ended.exit != 0
    assert "0.3 s" in ended.err


# The command

CASES = {case["key"]: case for case in bench.CASES}


def of_magtip(monkeypatch, answer):
    """Let a function answer the tasks of magtip."""
    monkeypatch.setattr(bench, "magtip", lambda task: dict(answer(task)))


def test_missing_peers_are_rows_that_say_how_to_install_them(monkeypatch, run, strict, tmp_path):
    of_magtip(monkeypatch, lambda task: answer(0, 0.1) | {"forces_N": [(0, 0, 1.0)] * len(task["loads"])})
    options = ("--peers", "nowhere", "--ccx", "no-such-ccx", "--cases", "press-curve,half-press")
    status, out, err = run("validate", "bench", *options, "--json", "--out", "found")
    rows = [row for row in strict(out) if row["program"] != "magtip"]
    assert (status, [row["program"] for row in rows]) == (3, ["FElupe", "CalculiX", "CalculiX"])
    assert [(row["status"], row["met"]) for row in rows] == [("not installed", None)] * 3
    assert "nowhere/bin/pip install felupe" in rows[0]["message"]
    assert "calculix-ccx" in err
    text = (tmp_path / "found" / "BENCH.md").read_text("utf-8")
    assert "1 of 6 goals are met" in text
    assert "times faster), promises missed: no data" in text
    assert (tmp_path / "found" / "bench.csv").read_text("utf-8").count("\n") == 6


def test_only_the_chosen_cases_run_and_the_help_names_all(monkeypatch, run, refusal, strict):
    assert all(name in run("validate", "bench", "--help")[1] for name in CASES)
    of_magtip(monkeypatch, lambda task: answer(0, 0.1))
    out = run("validate", "bench", "--cases", "field, modes", "--json")[1]
    assert [row["case"][:5] for row in strict(out)] == ["first", "field", "field"]
    assert "modes, field; got fields" in refusal("validate", "bench", "--cases", "fields")


@pytest.mark.parametrize(("cpu", "met"), [(0.2, True), (0.4, False)])
def test_goals_are_judged_and_misses_said(monkeypatch, run, strict, cpu, met):
    of_magtip(monkeypatch, lambda task: answer(0.1, cpu) | {"dofs": 9, "peak_MB": 50.0})
    own = CASES["press-curve"]
    monkeypatch.setattr(bench, "CASES", [own | {"runs": own["runs"][:1]}])
    status, out, err = run("validate", "bench", "--quick", "--json")
    assert (status, strict(out)[0]["met"]) == (0 if met else 3, met)
    assert ("press curve to 3 mm (at most 0.3 s, within 0.5 %), promises missed: 1" in err) is not met


@pytest.mark.parametrize(
    ("key", "seconds", "met"),
    [
        ("small-shear", (0.35, 0.54), True),
        ("small-shear", (0.35, 0.56), False),
        ("modes", (0.4,), True),
        ("modes", (0.6,), False),
        ("tilted-plate", (1.0, 2.0), True),
        ("tilted-plate", (1.0, 4.0), False),
        ("shear", (1.0, 12.0), True),
        ("shear", (1.0, 9.0), False),
        ("field", (1.0, 5.0), True),
        ("field", (1.0, 3.0), False),
        ("modes", (None,), False),
        ("field", (1.0, None), False),
    ],
)
def test_runs_that_take_turns_are_held_against_the_first(monkeypatch, key, seconds, met):
    answers = itertools.cycle(answer(0, s) if s else {"status": "failed", "message": "lost"} for s in seconds)
    of_magtip(monkeypatch, lambda task: next(answers))
    monkeypatch.setattr(bench.importlib.util, "find_spec", lambda name: name)
    rows = bench.measured(CASES[key], bench.Bench(True, Path("nowhere"), "no-such-ccx"))
    assert rows[-1]["met"] is met
    assert rows[-1]["faster"] == (seconds[1] / seconds[0] if key in ("shear", "field") and seconds[-1] else None)
