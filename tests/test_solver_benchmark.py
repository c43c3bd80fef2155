"""The bench at a reduced size: fits, choice of meshes, decks, missing peers, one solve in a process of its own."""

import ast
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
from studies.validation import (
    benchmark_cases,
    benchmark_state,
    benchmark_statistics,
    benchmark_tables,
    earlier_commit,
    peer_calculix,
    peers,
    solver_benchmark,
)

ROOT = Path(__file__).resolve().parent.parent
DAT = """
 total force (fx,fy,fz) for set BASE and time  0.5000000E+00

        2.445689E-16 -1.599861E-02  7.0E-01

 total force (fx,fy,fz) for set BASE and time  0.1000000E+01

       -6.317646E-16 -4.357604E-02  1.461206E+00
"""


def answer(error, cpu, status="ok"):
    return {"status": status, "message": "", "cpu_s": cpu, "mesh_s": 0.0, "forces_N": [(0, 0, 1 + error / 100)]}


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


@pytest.mark.parametrize("p", [0.5, 1.0, 1.6])
def test_exponents_of_powers(p):
    sizes = (5_000, 20_000, 80_000)
    solve, mesh = [3e-6 * n**p for n in sizes], [1e-4 * n for n in sizes]
    answers = [
        {"dofs": n, "cpu_s": s + m, "mesh_s": m, "iterations": 5, "peak_MB": 90 + 0.02 * n, "base_MB": 90.0}
        for n, s, m in zip(sizes, solve, mesh, strict=True)
    ]
    found = benchmark_statistics.exponents(answers)
    assert found["CPU s"] == pytest.approx((3e-6, p))
    assert found["CPU s an iteration"] == pytest.approx((6e-7, p))
    assert found["mesher CPU s"] == pytest.approx((1e-4, 1))
    assert found["memory beyond imports, MB"] == pytest.approx((0.02, 1))


def test_the_cheapest_mesh_within_tolerance_is_chosen():
    ladder = {
        "coarse": answer(2, 1),
        "lucky": answer(-0.4, 5),
        "good": answer(0.3, 3),
        "lost": answer(0, 0.1, "failed"),
    }
    truth = [(0, 0, 1.0)]
    found = benchmark_statistics.candidates(ladder.get, ladder, truth, 0.5)
    assert [rung for rung, _ in found] == ["good", "lucky"], "the cheapest first"
    assert benchmark_statistics.candidates(ladder.get, ladder, truth, 0.1)[0][0] == "good", (
        "none is within: the most accurate"
    )
    assert benchmark_statistics.measured(ladder.get, ["lost"], truth, 0.5, 2)[1]["status"] == "failed"


@pytest.mark.parametrize(
    ("errors", "found"),
    [((0.4, 0.1, 0.2), ["same"]), ((2, 0.1, 0.2), ["cheap", "dear"]), ((2, 0.9, 0.8), ["dear"])],
    ids=["the same mesh", "others", "none within tolerance"],
)
def test_another_program_is_compared_at_the_same_error(errors, found):
    ladder = dict(zip(("same", "cheap", "dear"), map(answer, errors, (1, 3, 9)), strict=True))
    assert benchmark_statistics.matching_rungs(ladder.get, "same", ladder, [(0, 0, 1.0)], 0.5) == found


@pytest.mark.parametrize(
    ("errors", "message"),
    [
        ({0.1: 0.4}, "commit f83a532 needs section_size 0.1 D"),
        ({0.1: 0.7, 0.08: 0.4}, "commit f83a532 needs section_size 0.08 D"),
        ({0.1: 0.7, 0.08: 0.6}, "commit f83a532 has an error of 0.6 % on section_size 0.08 D, beyond the tolerance"),
    ],
    ids=["the first mesh", "misses on the first mesh", "misses on all"],
)
def test_the_earlier_commit_stays_within_the_tolerance_in_all_turns(monkeypatch, errors, message):
    """One solve may be within it by luck: the earlier commit's tetrahedra differ from run to run."""
    sizes = {size: {"section_size": size} for size in errors}
    monkeypatch.setattr(solver_benchmark, "matching_rungs", lambda *_: list(sizes.values()))
    monkeypatch.setattr(
        solver_benchmark,
        "beside_earlier",
        lambda bench, own, task, truth, least, other: replace(
            own, earlier_error_percent=errors[other["accuracy"]["section_size"]]
        ),
    )
    bench = benchmark_state.Bench(True, Path("none"), "ccx", None, earlier=Path("none"))
    own = benchmark_tables.BenchRow("press curve to 3 mm", "magtip", "", status="ok")
    case = next(case for case in solver_benchmark.CASES if case.key == "press-curve")
    found = solver_benchmark._beside_earlier_rung(bench, case, own, {"section_size": 0.16}, [(0, 0, 1.0)])
    assert found.message == message


def test_medians_keep_the_worst_error_and_a_failure():
    runs = [answer(0, cpu) | {"error_percent": e} for cpu, e in ((1.0, 0.1), (9.0, 0.4), (2.0, 0.2))]
    found = benchmark_statistics.median(runs)
    assert (found["cpu_s"], found["error_percent"], found["runs"]) == (2.0, 0.4, 3)
    assert benchmark_statistics.median([*runs, answer(0, 1.0, "failed")])["status"] == "failed"


def test_a_mesh_that_misses_in_one_run_is_passed_over():
    errors = {"noisy": iter([0.1, 0.1, 0.9]), "fine": iter([0.2, 0.2, 0.2])}
    cost = {"noisy": 1.0, "fine": 2.0}
    rung, found = benchmark_statistics.measured(
        lambda r: answer(next(errors[r]), cost[r]), errors, [(0, 0, 1.0)], 0.5, 2
    )
    assert (rung, found["status"], found["cpu_s"]) == ("fine", "ok", 2.0)


def test_an_error_beyond_tolerance_is_said():
    errors = iter([0.1, 0.1, 0.9])
    _, found = benchmark_statistics.measured(lambda _: answer(next(errors), 1.0), ["mesh"], [(0, 0, 1.0)], 0.5, 2)
    assert found["status"] == "inaccurate"
    assert "0.9 %" in found["message"]


# CalculiX


@pytest.fixture(scope="module")
def deck():
    return peer_calculix.deck(cube(), peer_calculix.Press(E=2.0, nu=0.49, L=2.0, R=2.0, depth=0.5))


def test_deck_has_the_mesh_in_the_order_of_calculix(deck):
    points = numbers(deck, "*NODE, NSET=BODY")[:, 1:]
    cells = numbers(deck, "*ELEMENT, TYPE=C3D10")[:, 1:].astype(int) - 1
    assert len(points) == cube().doflocs.shape[1]
    x = points[cells]
    np.testing.assert_allclose(np.linalg.det(x[:, 1:4] - x[:, :1]).sum() / 6, 8)
    assert (np.linalg.det(x[:, 1:4] - x[:, :1]) > 0).all()
    for k, (a, b) in enumerate([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)], 4):
        np.testing.assert_allclose(x[:, k], (x[:, a] + x[:, b]) / 2, atol=1e-12)


def test_deck_presses_the_tip_and_holds_base_and_symmetry(deck):
    points = numbers(deck, "*NODE, NSET=BODY")[:, 1:]
    cells = numbers(deck, "*ELEMENT, TYPE=C3D10")[:, 1:].astype(int) - 1
    lines = deck.splitlines()
    start = lines.index("*SURFACE, NAME=TIP, TYPE=ELEMENT") + 1
    faces = [line.split(", S") for line in lines[start : lines.index("*SURFACE, NAME=LOWER, TYPE=ELEMENT")]]
    corners = [cells[int(i) - 1, list(peer_calculix.FACES[int(side) - 1])] for i, side in faces]
    assert len(faces) > 2
    np.testing.assert_allclose(points[corners][..., 2], 2)
    base, symmetry = (numbers(deck, f"*NSET, NSET={name}").ravel().astype(int) - 1 for name in ("BASE", "SYMMETRY"))
    assert set(base) == set(np.flatnonzero(points[:, 2] == 0))
    assert set(symmetry) == set(np.flatnonzero((points[:, 1] == 0) & (points[:, 2] > 0)))
    plate = numbers(deck, "*NODE, NSET=PLATE")[:, 1:]
    assert plate[:4, 2] == pytest.approx(2.0)
    assert "PLATE, 3, 3, -0.5" in lines


def test_deck_has_the_moduli_of_the_material(deck):
    c10, d1 = numbers(deck, "*HYPERELASTIC")[0]
    assert (2 * c10, 2 / d1) == pytest.approx((2.0 / (2 * 1.49), 2.0 / (3 * 0.02)))


def test_force_is_the_last_one_of_both_halves():
    assert peer_calculix.force(DAT) == pytest.approx((1.0, 2 * 1.461206))
    with pytest.raises(ValueError, match="no force"):
        peer_calculix.force("*ERROR")
    assert peer_calculix.iterations(" increment 1 attempt 1\n iteration 1\n iteration 2\n") == 2


# FElupe


def test_section_mesh_for_felupe():
    given = peers.section_arrays(paper(), 0.12, 1.0, 0.25)
    points = given["points"]
    x = points[given["cells"]]
    assert x.shape[1:] == (6, 2)
    assert np.ptp(points[given["base"], 1]) == 0
    assert np.ptp(points[given["axis"], 0]) == 0
    skin = points[given["edges"]].reshape(-1, 2)
    dome = skin[skin[:, 1] > 5]
    np.testing.assert_allclose(np.hypot(dome[:, 0], dome[:, 1] - 5), 4, rtol=1e-12)


def test_scripts_of_peers_and_magtip_do_not_import_each_other():
    def imports(path):
        nodes = [
            n for n in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(n, (ast.Import, ast.ImportFrom))
        ]
        names = [n.module if isinstance(n, ast.ImportFrom) else a.name for n in nodes for a in n.names]
        return {name.split(".")[0] for name in names}

    script = ROOT / "studies" / "validation" / "peer_felupe.py"
    assert not imports(script) & {"geometry", "fem", "analytic", "studies"}
    others = [
        path for package in ("geometry", "fem", "analytic", "studies") for path in (ROOT / package).rglob("*.py")
    ]
    assert not [path for path in others if path != script and "felupe" in imports(path)]


# Processes


def test_a_solve_in_a_process_of_its_own_gives_the_same_force():
    accuracy = {"section_size": 0.12}
    begin = time.perf_counter()
    found = peers.magtip(solver_benchmark.spec("axisymmetric", "ignored", [{"depth": 0.5}], accuracy))
    whole = time.perf_counter() - begin
    here = trace(paper(), [Load(depth=0.5)], replace(STANDARD, **accuracy), magnet="ignored", estimate=False)
    assert found["status"] == "ok", found
    assert found["forces_N"][0] == pytest.approx(here[0].response.force, rel=1e-9)
    assert 0.001 < found["cpu_s"] < 20
    # the imports are a part of the life of the process
    assert found["import_s"] > 0.05
    assert found["import_s"] + found["cpu_s"] < whole
    assert 40 < found["base_MB"] <= found["peak_MB"] < 2000


def test_a_solve_that_raises_is_a_failed_row():
    found = peers.magtip(solver_benchmark.spec("axisymmetric", "ignored", [{"depth": 20.0}], {}))
    assert found["status"] == "failed"
    assert "depth must be less than" in found["message"]


def test_memory_is_that_of_the_child_alone():
    ballast = np.ones(20_000_000)
    assert peers.measure([sys.executable, "-I", "-S", "-c", "pass"]).peak_MB < 40
    assert ballast[0] == 1


def test_a_process_beyond_its_limit_is_stopped():
    begin = time.perf_counter()
    ended = peers.measure([sys.executable, "-c", "import time; time.sleep(60)"], limit=0.3)
    assert time.perf_counter() - begin < 10
    assert ended.exit != 0
    assert "0.3 s" in ended.err


# The command


@pytest.fixture
def alone(monkeypatch):
    """The bench without the solves of magtip."""
    monkeypatch.setattr(solver_benchmark, "CASES", ())
    for part in ("_small_shear", "_modes", "_first_call", "_growth"):
        monkeypatch.setattr(solver_benchmark, part, lambda _: None)
    for part in ("measure_machine", "compiled_functions", "section_meshes", "tilted_plate", "field_points"):
        monkeypatch.setattr(solver_benchmark, part, lambda _: None)
    monkeypatch.setattr(earlier_commit, "COMMIT", "no-such-commit")


def test_missing_peers_are_rows_that_say_how_to_install_them(alone, run, strict, tmp_path):
    status, out, err = run(
        "validate", "bench", "--peers", "nowhere", "--ccx", "no-such-ccx", "--json", "--out", "found"
    )
    assert status == 3
    rows = strict(out)
    assert [(row["program"], row["status"]) for row in rows] == [
        ("FElupe", "not installed"),
        ("CalculiX", "not installed"),
    ]
    assert "nowhere/bin/pip install felupe" in rows[0]["message"]
    assert "calculix-ccx" in err
    assert all(row["met"] is None for row in rows)
    text = (tmp_path / "found" / "BENCH.md").read_text("utf-8")
    assert "0 of 3 goals are met" in text
    assert "times faster), promises missed: no data" in text
    assert "the comparison with commit no-such-commit is left out" in text
    assert "numpy" in text
    assert (tmp_path / "found" / "bench.csv").read_text("utf-8").count("\n") == 3


def test_only_the_chosen_cases_run(alone, monkeypatch, run, strict):
    monkeypatch.setattr(solver_benchmark, "field_points", lambda bench: bench.rows.append(FIELD))
    status, out, _ = run("validate", "bench", "--cases", "field, modes", "--json")
    assert (status, [row["case"] for row in strict(out)]) == (0, ["field"])
    status, _, err = run("validate", "bench", "--cases", "fields")
    assert (status, "--cases takes compiled, press-curve" in err, "got fields" in err) == (2, True, True)


FIELD = solver_benchmark.row("field", "magtip", "one thread", {"cpu_s": 0.1})


def test_the_help_names_all_cases(run):
    _, out, _ = run("validate", "bench", "--help")
    assert all(name in out for name in solver_benchmark.names())


def test_goals_are_judged_and_misses_said(alone, monkeypatch, run, strict):
    fast, slow = answer(0.1, 0.2) | {"dofs": 9, "peak_MB": 50.0}, answer(0.1, 0.4) | {"dofs": 9, "peak_MB": 50.0}
    case = benchmark_cases.Case(
        "one", "quick one", "axisymmetric", "ignored", ({"depth": 1.0},), ({},), 0.5, ("axisymmetric", {}), 0.3
    )
    for found, met in ((fast, True), (slow, False)):
        monkeypatch.setattr(solver_benchmark, "CASES", (case,))
        monkeypatch.setattr(peers, "magtip", lambda spec, found=found, **_: dict(found))
        status, out, err = run("validate", "bench", "--quick", "--peers", "nowhere", "--ccx", "no-such-ccx", "--json")
        assert status == 3  # the peers are not installed
        assert strict(out)[0]["met"] is met
        assert ("one (at most 0.3 s, within 0.5 %), promises missed: 1" in err) is not met


@pytest.mark.parametrize(("shear", "modes", "met"), [(0.5, 0.4, [True, True]), (0.6, 0.6, [False, False])])
def test_what_follows_from_a_tangent_is_held_against_its_goals(monkeypatch, shear, modes, met):
    cost = {"trace": 0.35, "small shear": shear, "modes": modes}
    monkeypatch.setattr(peers, "magtip", lambda task: answer(0, cost[task["task"]]))
    found = solver_benchmark.Bench(True, Path("nowhere"), "no-such-ccx", None)
    solver_benchmark._small_shear(found)
    solver_benchmark._modes(found)
    assert [row.met for row in found.rows] == [None, *met]


def test_a_section_is_compared_with_the_half_model_of_its_scene():
    case = next(case for case in benchmark_cases.CASES if case.model == "harmonic" and case.reference is not None)
    found = solver_benchmark.Bench(True, Path("nowhere"), "no-such-ccx", None)
    assert solver_benchmark._over_half(found, case, answer(0, 1.5)) is None
    found.rows.append(solver_benchmark.row(case.name, "magtip", "solid_size 0.14 D", answer(0, 30.0)))
    assert solver_benchmark._over_half(found, case, answer(0, 1.5)) == 20


def test_tilt_counts_as_well_as_force():
    tilted = answer(0.1, 1.0) | {"tilts_rad": [(0.102,)]}
    assert benchmark_statistics.errors_percent(
        benchmark_statistics.compared(tilted), [(0, 0, 1.0), (0.1,)]
    ) == pytest.approx(2)


@pytest.mark.parametrize("task", [{"task": "small shear", "depth": 0.5}, {"task": "modes", "count": 1}])
def test_a_tangent_in_a_process_of_its_own(task):
    found = peers.magtip(task)
    assert found["status"] == "ok", found["message"]
    assert found["cpu_s"] > 0


def test_a_lost_reference_meets_no_goal(alone, monkeypatch, run, strict):
    case = benchmark_cases.Case(
        "one", "quick one", "axisymmetric", "ignored", ({"depth": 1.0},), ({},), 0.5, ("axisymmetric", {}), 9.0
    )
    monkeypatch.setattr(solver_benchmark, "CASES", (case,))
    monkeypatch.setattr(peers, "magtip", lambda spec, **_: {"status": "failed", "message": "lost"})
    _, out, _ = run("validate", "bench", "--quick", "--peers", "nowhere", "--ccx", "no-such-ccx", "--json")
    row = strict(out)[0]
    assert (row["status"], row["met"]) == ("no reference", False)


def test_faster_leaves_the_mesher_out():
    own = solver_benchmark.row("c", "magtip", "", {"status": "ok", "cpu_s": 3.0, "mesh_s": 2.0})
    peer = solver_benchmark.row("c", "CalculiX", "", {"status": "ok", "cpu_s": 5.0})
    found = solver_benchmark._beside(solver_benchmark.Bench(True, Path(), "", None, rows=[own]), peer)
    assert (found.faster, found.met) == (5.0, True)


def test_picture_of_growth(tmp_path):
    rows = [{"dofs": n, "cpu_s": 1e-3 * n, "mesh_s": 1e-4 * n, "peak_MB": 0.1 * n} for n in (1000, 4000, 9000)]
    benchmark_tables.draw_size(tmp_path / "size.png", rows)
    assert (tmp_path / "size.png").stat().st_size > 10_000


def test_machine_names_processor_and_versions():
    about = benchmark_tables.machine()
    assert "cores" in about["machine"]
    assert {"magtip", "numpy", "scipy"} <= set(about)
