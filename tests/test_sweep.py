import csv
import dataclasses
import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from analytic import beam, hall
from fem import equilibrium
from fem.accuracy import QUICK
from fem.physics_version import PHYSICS
from fem.scene import Scene
from geometry.design import BadInput, Design, paper
from geometry.loads import Load, Response
from studies.exploration import solved_paths, store, sweep, sweep_request, sweep_rows

BARE = Design(magnet_diameter=0.0, magnet_height=0.0)


def run(*args, **options):
    """The flat rows of a sweep."""
    return [row.row() for row in sweep.run(*args, **options)]


@pytest.fixture
def traced(monkeypatch):
    """Counts the solves."""
    calls = []
    real = equilibrium.trace

    def counted(*args, **kwargs):
        calls.append(args)
        return real(*args, **kwargs)

    monkeypatch.setattr(equilibrium, "trace", counted)
    return calls


def test_every_combination_is_a_row_in_order_and_alike_problems_share_a_solve(traced, tmp_path):
    axes = {"D": [4.0, 8.0], "L": [4.5, 9.0], "E": [1.0, 3.0], "depth": [0.25, 0.5]}
    rows = run(BARE, axes, tmp_path, depth=9.9, magnet="ignored", accuracy=QUICK)
    columns = ("D_mm", "L_mm", "E_MPa", "depth_mm")
    assert [tuple(row[name] for name in columns) for row in rows] == list(itertools.product(*axes.values()))
    assert {row["status"] for row in rows} == {"ok"}
    # (4, 4.5) and (8, 9) are similar
    assert len(traced) == 3
    assert {row["solve"] for row in rows} == {1, 2, 3}
    similar = {row["solve"] for row in rows if row["L_mm"] / row["D_mm"] == 9 / 8}
    assert len(similar) == 1
    with open(tmp_path / "sweep.csv", newline="", encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    assert len(table) == len(rows)
    assert float(table[5]["fem_force_N"]) == pytest.approx(rows[5]["fem_force_N"], rel=1e-5)
    assert (tmp_path / "sweep.png").stat().st_size > 10_000
    assert sorted(path.name for path in tmp_path.iterdir()) == ["sweep.csv", "sweep.png"]


def test_what_a_solve_lends_to_a_similar_case_is_what_that_case_gives_itself(traced):
    big = Design(D=16.0, L=18.0, E=2.5, magnet_diameter=8.0, magnet_height=4.0, magnet_edge_radius=0.2, l0=14.4, f=9)
    depths = [1.0, 2.0]
    own = equilibrium.trace(big, [Load(depth=depth) for depth in depths], QUICK)
    del traced[:]
    case = sweep_rows.Case({"D": 16.0, "L": 18.0, "f": 9.0, "E": 2.5, "depth": 2.0}, big, "")
    small = sweep_rows.Case({"D": 8.0, "L": 9.0, "f": 5.0, "E": 1.0, "depth": 0.5}, paper(), "")
    solved = list(sweep._solve([small, case], "rigid", QUICK, None, None))
    assert len(traced) == 1
    for got, want in ((solved[1].response, own[1].response),):
        assert got.force == pytest.approx(want.force, rel=1e-9)
        assert got.shift == pytest.approx(want.shift, rel=1e-9)
        assert got.contact_radius == pytest.approx(want.contact_radius, rel=1e-9)
    assert solved[0].response.force[2] * 2.5 * 4 == pytest.approx(own[0].response.force[2], rel=1e-9)


def test_E_and_f_need_one_solve_and_the_figures_follow_them(traced):
    rows = run(paper(), {"E": [0.5, 2.0], "f": [5.0, 6.0]}, None, depth=1.0, accuracy=QUICK)
    assert len(traced) == 1
    soft, soft_far, hard, _ = rows
    assert hard["fem_force_N"] == pytest.approx(4 * soft["fem_force_N"], rel=1e-12)
    assert hard["analytic_force_N"] == pytest.approx(4 * soft["analytic_force_N"], rel=1e-12)
    assert hard["force_error_percent"] == pytest.approx(soft["force_error_percent"], rel=1e-9)
    for name in ("fem_shift_z_mm", "fem_S1_mT", "fem_S2_mT", "analytic_S1_V"):
        assert hard[name] == soft[name]
    assert soft_far["fem_S1_mT"] == soft["fem_S1_mT"]
    assert soft_far["fem_S2_mT"] != soft["fem_S2_mT"]
    pose = equilibrium.solve(paper(), Load(depth=1.0), QUICK).response
    seen, formula = hall.readings(paper(), pose), beam.solve(paper(), Load(depth=1.0))
    assert soft["fem_S1_mT"] == pytest.approx(1e3 * seen.B_T[0], rel=1e-9)
    assert soft["fem_S1_V"] == pytest.approx(seen.V[0], rel=1e-9)
    assert soft["force_error_percent"] == pytest.approx(100 * (formula.force[2] / pose.force[2] - 1), rel=1e-9)


def test_the_hall_elements_stay_where_they_are():
    base = paper()
    for fields in ({"L": 11.0}, {"D": 7.0}, {"D": 10.0, "L": 9.5}):
        before, after = hall.elements(base)[0], hall.elements(sweep.varied(base, fields))[0]
        assert np.allclose(before, after, atol=1e-12)


def test_a_refusal_speaks_of_what_was_given():
    for fields, reason in (({"D": 50.0}, "L must exceed"), ({"D": 8.0, "L": 4.5}, "S1")):
        with pytest.raises(BadInput, match=reason):
            sweep.varied(replace(BARE, l0=2.0), fields)


def test_cases_that_cannot_be_solved_stay_rows():
    axes = {"D": [3.0, 8.0], "depth": [1.0, 7.0]}
    rows = run(paper(), axes, None, depth=1.0, accuracy=QUICK)
    assert [row["status"] for row in rows] == ["bad_input", "bad_input", "ok", "bad_input"]
    assert "magnet" in rows[0]["message"]
    assert "depth" in rows[3]["message"]
    for row in (rows[0], rows[3]):
        assert row["solve"] == 0
        assert all(
            math.isnan(row[name]) for name in ("fem_force_N", "analytic_force_N", "fem_S1_mT", "error_estimate")
        )


def test_the_formulas_end_at_the_tip_radius():
    rows = run(BARE, {"depth": [1.0, 4.2]}, None, depth=0.0, magnet="ignored", accuracy=QUICK)
    assert [row["status"] for row in rows] == ["ok", "ok"]
    assert math.isfinite(rows[1]["fem_force_N"])
    assert math.isnan(rows[1]["analytic_force_N"])
    assert math.isnan(rows[1]["force_error_percent"])
    assert "D/2" in rows[1]["message"]


def test_a_solve_that_stops_keeps_what_it_reached(monkeypatch):
    real = equilibrium.trace

    def stops(design, loads, *args, **kwargs):

        found = real(design, loads[:2], *args, **kwargs)
        return [found[0], dataclasses.replace(found[1], status="not_converged", message="stopped at depth 0.7 mm")]

    monkeypatch.setattr(equilibrium, "trace", stops)
    rows = run(BARE, {"depth": [1.5, 0.5, 1.0]}, None, depth=0.0, magnet="ignored", accuracy=QUICK)
    assert [row["status"] for row in rows] == ["not_converged", "ok", "not_converged"]
    assert math.isnan(rows[0]["fem_force_N"])
    assert math.isfinite(rows[0]["analytic_force_N"])
    assert "stopped" in rows[0]["message"]


def test_unknown_axes_are_refused():
    for axes in ({}, {"nu": [0.4]}):
        with pytest.raises(BadInput, match="axes"):
            run(paper(), axes, None, depth=1.0)


def test_progress_never_falls_and_stays_within_its_range():
    seen = []
    axes = {"L": [9.0, 10.0]}
    run(BARE, axes, None, depth=0.5, magnet="ignored", accuracy=QUICK, progress=lambda f, _: seen.append(f))
    assert seen == sorted(seen)
    assert 0 <= seen[0] <= seen[-1] <= 1


def test_designs_of_different_laws_do_not_share_a_solve():
    keys = {
        store.key(solved_paths.content(Scene(design, (Load(depth=0.5),), QUICK)))
        for design in (
            paper(),
            Design(E=2.0),
            Design(yeoh_2=1.0),
            Design(law="yeoh"),
            Design(law="yeoh", yeoh_2=1.0),
            Design(law="yeoh", yeoh_3=1.0),
        )
    }
    assert len(keys) == 4


def test_a_sweep_of_too_many_cases_is_refused_before_it_starts():
    many = [0.5 + k / 1e4 for k in range(200)]
    with pytest.raises(BadInput, match="40000"):
        run(paper(), {"D": many, "depth": many}, None, depth=1.0)


AXES = {"L": [9.0, 10.0], "depth": [0.5, 1.0]}
GIVEN = {"depth": 0.0, "magnet": "ignored", "accuracy": QUICK}


@pytest.fixture
def kept(tmp_path):
    with store.opened(tmp_path / "store" / "solved.sqlite") as states:
        yield states


def interrupted(*args, **kwargs):
    raise KeyboardInterrupt


def test_a_sweep_that_was_interrupted_continues(traced, kept, monkeypatch):
    going = sweep.run(BARE, AXES, None, **GIVEN, kept=kept)
    reached = [next(going), next(going)]
    with monkeypatch.context() as patch:
        patch.setattr(equilibrium, "trace", interrupted)
        with pytest.raises(KeyboardInterrupt, match=r"2 of 4 cases are kept in .*solved.sqlite; the same command"):
            next(going)
    again = run(BARE, AXES, None, **GIVEN, kept=kept)
    assert len(traced) == 2
    assert str(again[:2]) == str([row.row() for row in reached])


def test_a_sweep_takes_from_the_store_what_it_has_and_solves_what_is_missing(traced, kept):
    first = run(BARE, AXES, None, **GIVEN, kept=kept)
    # another order, another length, another depth: of the beam of 10 mm only the depth of 1.5 mm is missing
    other = run(BARE, {"L": [10.0, 9.5], "depth": [0.5, 1.5, 1.0]}, None, **GIVEN, kept=kept)
    assert [len(args[1]) for args in traced] == [2, 2, 1, 3]
    figures = [name for name in first[0] if name not in ("solve", "seconds")]
    assert [str(other[2][name]) for name in figures] == [str(first[3][name]) for name in figures]


def test_a_state_of_a_path_does_not_depend_on_the_other_depths_of_its_solve(kept):
    alone = run(BARE, {"depth": [1.5]}, None, **GIVEN, kept=kept)
    among = run(BARE, {"depth": [0.5, 1.0, 1.5]}, None, **GIVEN)
    assert alone[0]["fem_force_N"] == pytest.approx(among[2]["fem_force_N"], rel=1e-8)


def test_a_sweep_that_was_interrupted_before_its_first_solve_claims_nothing(kept, monkeypatch):
    monkeypatch.setattr(equilibrium, "trace", interrupted)
    with pytest.raises(KeyboardInterrupt, match=r"^no case is solved yet: the same command starts"):
        run(BARE, AXES, None, **GIVEN, kept=kept)
    assert kept.counts() == (0, 0)


def test_a_case_that_fails_is_kept_and_not_tried_again(kept, traced):
    """This law loses its stability under a small press."""
    deep, softening = {"depth": [0.1, 2.0]}, replace(BARE, law="yeoh", yeoh_2=-5.0)
    first = run(softening, deep, None, **GIVEN, kept=kept)
    assert [row["status"] for row in first] == ["ok", "not_converged"]
    again = run(softening, deep, None, **GIVEN, kept=kept)
    assert len(traced) == 1
    assert str(again) == str(first)


def test_another_physics_version_is_solved_again(kept, traced, monkeypatch):
    run(BARE, {"depth": [0.5]}, None, **GIVEN, kept=kept)
    monkeypatch.setitem(PHYSICS, "axisymmetric", PHYSICS["axisymmetric"] + 1)
    run(BARE, {"depth": [0.5]}, None, **GIVEN, kept=kept)
    assert len(traced) == 2


@pytest.mark.parametrize("load", [Load(depth=0.5, shear_x=1.0, friction="stick"), Load(depth=0.5, friction=0.3)])
def test_only_frictionless_presses_are_stored(load):
    """States of other paths depend on more than a position."""
    with pytest.raises(ValueError, match="only frictionless presses"):
        solved_paths.content(Scene(paper(), (load,), QUICK))


def test_sweeps_in_different_folders_share_the_user_s_store(run, tmp_path):
    command = ("sweep", "paper", "--magnet", "ignored", "--accuracy", "quick", "--axis", "depth=0.5", "--json")
    first = run(*command, "--out", "one")
    assert run(*command, "--out", "two")[1] == first[1]
    assert run(*command, "--store", "own.sqlite", "--out", "three")[0] == 0
    with store.opened(tmp_path / "own.sqlite") as own:
        assert own.counts() == (1, 1)
    assert run(*command, "--store", "one/sweep.csv")[0] == 2


def test_another_accuracy_or_magnet_is_another_solve(traced, kept):
    axes = {"depth": [0.5]}
    for change in ({}, {"accuracy": replace(QUICK, section_size=0.2)}, {"magnet": "rigid"}):
        run(paper(), axes, None, **GIVEN | change, kept=kept)
    assert len(traced) == 3


def test_a_scaled_answer_keeps_both_tilts():
    """A state solved at D = 8 mm and E = 1 MPa, at twice the size and half the modulus."""
    pose = Response((0.2, 0.4, 3.0), (0.1, 0.3, -0.5), 0.02, 1.0, 0.06)
    answer = solved_paths.Answer(8.0, 1.0, pose, "ok", "", 0.01, 1.0).of(16.0, 0.5)
    assert answer.response == Response((0.4, 0.8, 6.0), (0.2, 0.6, -1.0), 0.02, 2.0, 0.06)


def cases(axes, **figures):
    """Rows of a sweep whose figures are functions of the case."""
    names = {"D": "D_mm", "f": "f_mm", "E": "E_MPa", "depth": "depth_mm"}
    for point in itertools.product(*axes.values()):
        case = dict(zip(axes, point, strict=True))
        row = {"status": "ok", "solve": len(case), "seconds": sum(point), "fem_force_N": 1.0, "fem_S2_mT": math.nan}
        yield row | {names[name]: value for name, value in case.items()} | {k: v(case) for k, v in figures.items()}


def test_an_axis_that_changes_nothing_is_named():
    axes = {"D": [6.0, 8.0], "f": [5.0, 6.0], "E": [1.0]}
    rows = list(cases(axes, fem_force_N=lambda case: case["D"]))
    assert sweep_request.idle_axes(rows, axes, whole=True) == [("f", "the results are the same for all its values")]
    rows = list(cases(axes, fem_force_N=lambda case: case["D"], fem_S2_mT=lambda case: case["f"]))
    assert sweep_request.idle_axes(rows, axes, whole=True) == []
    assert sweep_request.idle_axes(rows, axes, whole=False) == [
        ("f", "it changes only columns that --wide, --json and --out show")
    ]
    # a single case tells nothing, nor do cases that failed
    assert sweep_request.idle_axes(rows[:1], axes, whole=True) == sweep_request.idle_axes([], axes, whole=True) == []
    failed = [row | {"status": "bad_input", "fem_S2_mT": 0.0} for row in rows]
    assert sweep_request.idle_axes(failed, axes, whole=True) == []


def test_a_sweep_over_f_of_a_chip_says_that_f_changes_nothing(run):
    sweep_f = ("sweep", "paper", "--axis", "f=5,6", "--depth", 0.3, "--accuracy", "quick")
    lines = run(*sweep_f, "--set", "hall_layout=tmag5273a1", "--json")[2].splitlines()
    assert lines == ["magtip: warning: axis f has no effect: the results are the same for all its values"]
    assert run(*sweep_f, "--json")[2] == ""
    assert "axis f has no effect: it changes only columns that --wide, --json and --out show" in run(*sweep_f)[2]


def test_reasons_name_the_axes_that_vary_in_the_whole_table(run):
    axes = ("--axis", "D=8,100", "--axis", "E=0.5,1", "--axis", "depth=1")
    err = run("sweep", "paper", *axes, "--magnet", "ignored", "--accuracy", "quick", "--json")[2]
    assert "magtip: D 100 mm, E 0.5 MPa; D 100 mm, E 1 MPa: L must exceed the tip radius D/2 = 50 mm" in err
