"""Sweeps: what is asked for, rows of all cases, shared solves, and what is solved or has failed is kept."""

import csv
import itertools
import math
import os
import signal
from dataclasses import replace
from pathlib import Path

import pytest
from conftest import ROUGH
from stores import temporary

from analytic import beam, hall
from fem import equilibrium
from fem.accuracy import FINE, QUICK, STANDARD
from fem.physics_version import ESTIMATES, PHYSICS
from geometry.bad_input import MeshError, SolveFailed
from geometry.design import Design, paper
from geometry.loads import Load
from studies.answers import flat_rows
from studies.inputs import study_input
from studies.inputs.option_groups import Sweep, Wanted
from studies.inputs.study_input import Factor, grid
from studies.mechanics import path_solver, solve_plan
from studies.mechanics.solve_plan import Processes
from studies.mechanics.study_cases import Plan
from studies.models import models_of
from studies.models.finite_elements import FemModel
from studies.sweeps import sweep
from studies.sweeps.sweep import Shown

BARE = Design(magnet_diameter=0.0, magnet_height=0.0)
PRESS = ("force", "shift", "contact_radius", "readings")
MODEL = (FemModel("rough", ROUGH),)


def plan_of(design, axes, load=None, *, magnet="rigid", fem=MODEL, formulas=("paper",), **more):
    """A study over a grid, or over factors."""
    factors = grid(axes) if isinstance(axes, dict) else axes
    return Plan(design, factors, load or {}, magnet, models_of([*fem, *formulas]), more.get("quantities", PRESS))


def run(design, axes, load=None, folder=None, kept=None, processes=Processes(0), **more):
    """The flat rows of a sweep."""
    plan = plan_of(design, axes, load, **more)
    if kept is not None:
        return [row for table in sweep.run(plan, folder, kept, processes=processes) for row in flat_rows(table)]
    with temporary() as memory:
        return run(design, axes, load, folder, memory, processes, **more)


def test_every_combination_is_a_row_in_order_and_alike_problems_share_a_solve(traced, tmp_path):
    axes = {"D": [4.0, 8.0], "L": [4.5, 9.0], "E": [1.0, 3.0], "depth": [0.25, 0.5]}
    rows = run(BARE, axes, folder=tmp_path, magnet="ignored")
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
    assert sorted(path.name for path in tmp_path.glob("[!.]*")) == ["sweep.csv", "sweep.png"]


def test_similar_designs_have_the_answers_of_their_own_solves(traced):
    """Twice the size: all lengths, and with them the magnet and the depth, vary together."""
    big = Design(D=16.0, L=18.0, E=2.5, magnet_diameter=8.0, magnet_height=4.0, magnet_edge_radius=0.2, l0=14.4, f=9)
    own = equilibrium.trace(big, [Load(depth=2.0)], ROUGH)[0].response
    del traced[:]
    names = ("D", "L", "magnet_diameter", "magnet_height", "magnet_edge_radius", "l0", "f", "E", "depth")
    small = [getattr(paper(), name) for name in names[:-1]]
    both = tuple(zip([*small, 1.0], [getattr(big, name) for name in names[:-1]] + [2.0], strict=True))
    one, other = run(paper(), (Factor(names, both),))
    assert len(traced) == 1
    assert other["fem_force_N"] == pytest.approx(own.force[2], rel=1e-9)
    assert other["fem_shift_z_mm"] == pytest.approx(own.shift[2], rel=1e-9)
    assert other["fem_contact_radius_mm"] == pytest.approx(own.contact_radius, rel=1e-9)
    assert one["fem_force_N"] * 2.5 * 4 == pytest.approx(own.force[2], rel=1e-9)


def test_lengths_over_D_are_axes(traced):
    rows = run(BARE, {"D": [4.0, 8.0], "L/D": [1.125], "depth/D": [0.05, 0.3]}, magnet="ignored", formulas=())
    assert len(traced) == 1
    assert [(row["L_over_D"], row["L_mm"]) for row in rows] == [(1.125, 4.5)] * 2 + [(1.125, 9.0)] * 2
    assert [(row["depth_over_D"], row["depth_mm"]) for row in rows[2:]] == [(0.05, 0.4), (0.3, 2.4)]
    assert rows[3]["fem_force_N"] == pytest.approx(4 * rows[1]["fem_force_N"], rel=1e-9)
    plan = plan_of(BARE, {"shear/D": [0.1]}, {"depth": 0.5})
    assert plan.loads_sideways
    axes = [name for name, _ in idle_axes(rows, plan_of(BARE, {"D": [4.0, 8.0], "L/D": [1.125]}), whole=True)]
    assert axes == []


def test_many_messages_are_a_table():
    plan = asked_plan(None, asked(["D=6,8"], depth=0.3))
    shown = Shown(plan)
    rows = [
        {"D_mm": float(k), "status": "ok", "fem_status": "ok", "fem_force_N": 1.0, "message": f"said {k}"}
        for k in range(9)
    ]
    shown.rows, shown.count = rows, len(rows)
    _, messages = shown.result().shown
    assert messages.rows[8] == {"cases": "D 8 mm", "remark": "said 8"}
    shown.rows = rows[:3]
    assert shown.result().shown[1:] == ["D 0 mm: said 0", "D 1 mm: said 1", "D 2 mm: said 2"]


def test_E_and_f_need_one_solve_and_the_figures_follow_them(traced):
    rows = run(paper(), {"E": [0.5, 2.0], "f": [5.0, 6.0]}, {"depth": 1.0})
    assert len(traced) == 1
    soft, soft_far, hard, _ = rows
    assert hard["fem_force_N"] == pytest.approx(4 * soft["fem_force_N"], rel=1e-12)
    assert hard["analytic_force_N"] == pytest.approx(4 * soft["analytic_force_N"], rel=1e-12)
    assert hard["force_error_percent"] == pytest.approx(soft["force_error_percent"], rel=1e-9)
    for name in ("fem_shift_z_mm", "fem_S1_mT", "fem_S2_mT", "analytic_S1_V"):
        assert hard[name] == soft[name]
    assert soft_far["fem_S1_mT"] == soft["fem_S1_mT"]
    assert soft_far["fem_S2_mT"] != soft["fem_S2_mT"]
    pose = equilibrium.solve(paper(), Load(depth=1.0), ROUGH).response
    seen, formula = hall.readings(paper(), pose), beam.solve(paper(), Load(depth=1.0))
    assert soft["fem_S1_mT"] == pytest.approx(1e3 * seen.B_T[0], rel=1e-9)
    assert soft["fem_S1_V"] == pytest.approx(seen.V[0], rel=1e-9)
    assert soft["force_error_percent"] == pytest.approx(100 * (formula.force[2] / pose.force[2] - 1), rel=1e-9)


def test_cases_that_cannot_be_solved_stay_rows():
    axes = {"D": [3.0, 8.0], "depth": [1.0, 7.0]}
    rows = run(paper(), axes)
    assert [row["status"] for row in rows] == ["bad_input", "bad_input", "ok", "bad_input"]
    assert "magnet" in rows[0]["message"]
    assert "depth" in rows[3]["message"]
    for row in (rows[0], rows[3]):
        assert row["solve"] == 0
        assert all(
            math.isnan(row[name]) for name in ("fem_force_N", "analytic_force_N", "fem_S1_mT", "error_estimate")
        )


AXES = {"L": [9.0, 10.0], "depth": [0.5, 1.0]}


def interrupted(*args, **kwargs):
    raise KeyboardInterrupt


def test_a_sweep_that_was_interrupted_continues(traced, kept, monkeypatch):
    batches = sweep.run(plan_of(BARE, AXES), None, kept, processes=Processes(0))
    reached = list(flat_rows(next(batches)))
    with monkeypatch.context() as patch:
        patch.setattr(equilibrium, "walk", interrupted)
        with pytest.raises(KeyboardInterrupt, match=r"1 of 2 solves are kept in .*solved.sqlite; the same command"):
            next(batches)
    again = run(BARE, AXES, kept=kept)
    assert len(traced) == 2
    assert str(again[:2]) == str(reached)


def test_a_sweep_takes_from_the_store_what_it_has_and_solves_what_is_missing(traced, kept):
    first = run(BARE, AXES, kept=kept)
    # another order, another length, another depth: of the beam of 10 mm only the depth of 1.5 mm is missing
    other = run(BARE, {"L": [10.0, 9.5], "depth": [0.5, 1.5, 1.0]}, kept=kept)
    assert [len(scene.loads) for scene in traced] == [2, 2, 1, 3]
    figures = [name for name in first[0] if name not in ("solve", "seconds")]
    assert [str(other[2][name]) for name in figures] == [str(first[3][name]) for name in figures]


def test_a_case_that_fails_is_kept_and_not_tried_again(kept, traced):
    """This law loses its stability under a small press, which starts from rest whatever was solved before."""
    softening = replace(BARE, law="yeoh", yeoh_2=-5.0)
    quick = {"fem": (FemModel("quick", QUICK),), "kept": kept}
    first = run(softening, {"depth": [1.0, 0.1]}, **quick)
    assert [row["status"] for row in first] == ["not_converged", "ok"]
    assert math.isnan(first[0]["fem_force_N"])
    assert math.isfinite(first[0]["analytic_force_N"])
    assert "0.2" in first[0]["message"]
    assert [[load.depth for load in scene.loads] for scene in traced] == [[0.1, 1.0]]
    again = run(softening, {"depth": [1.0, 0.1]}, **quick)
    assert len(traced) == 1
    assert str(again) == str(first)


def test_another_version_of_physics_or_estimates_is_solved_again(kept, traced, monkeypatch):
    run(BARE, {"depth": [0.5]}, kept=kept)
    monkeypatch.setattr(path_solver, "ESTIMATES", ESTIMATES + 1)
    run(BARE, {"depth": [0.5]}, kept=kept)
    monkeypatch.setitem(PHYSICS, "axisymmetric", PHYSICS["axisymmetric"] + 1)
    run(BARE, {"depth": [0.5]}, kept=kept)
    run(BARE, {"depth": [0.5]}, kept=kept)
    assert len(traced) == 3


SIDE = {"quantities": ("force", "shift", "tilt", "readings")}


def test_a_shear_is_solved_along_x_and_turned(traced):
    points = (Factor(("shear", "shear_y"), ((0.5, 0.0, -0.3, 0.0), (0.0, 0.5, 0.4, -0.5))),)
    x, y, oblique, back = run(paper(), points, {"depth": 0.5}, **SIDE)
    assert len(traced) == 1
    own = equilibrium.solve(paper(), Load(0.5, -0.3, 0.4, "stick"), ROUGH).response
    assert (oblique["fem_force_x_N"], oblique["fem_force_y_N"]) == pytest.approx(own.force[:2], rel=1e-6)
    assert (oblique["fem_shift_x_mm"], oblique["fem_shift_y_mm"]) == pytest.approx(own.shift[:2], rel=1e-6)
    assert (oblique["fem_tilt_rad"], oblique["fem_tilt_y_rad"]) == pytest.approx((own.tilt, own.tilt_y), rel=1e-6)
    assert (y["fem_force_y_N"], y["fem_force_x_N"]) == (x["fem_force_x_N"], 0.0)
    assert back["fem_tilt_y_rad"] == -x["fem_tilt_rad"]
    # S3 stands along y as S2 along x
    assert y["fem_S3_mT"] == pytest.approx(x["fem_S2_mT"], rel=1e-9)


def test_where_the_beam_gives_way_no_error_along_the_shear_is_stated():
    """A slender tip that sticks to the plate beyond its critical depth pushes along the shear."""
    slender = replace(BARE, L=32.0)
    rows = run(slender, {"depth": [0.2, 0.8]}, {"shear": 0.8}, magnet="ignored", **SIDE)
    assert [row["error_status"] for row in rows] == ["ok", "gave_way"]
    firm, gone = rows
    assert firm["fem_force_x_N"] > 0 > gone["fem_force_x_N"]
    own = 100 * (firm["analytic_force_x_N"] / firm["fem_force_x_N"] - 1)
    assert firm["force_x_error_percent"] == pytest.approx(own)
    assert math.isnan(gone["force_x_error_percent"])
    assert math.isnan(gone["tilt_error_percent"])
    assert math.isfinite(gone["force_error_percent"])
    assert "the beam gave way" in gone["message"]


def test_whether_a_beam_gave_way_is_unknown_where_the_error_of_its_force_is(monkeypatch):
    monkeypatch.setattr("fem.results.error_estimates.error_rule", lambda *_: None)
    (row,) = run(BARE, {"depth": [0.2]}, {"shear": 0.4}, magnet="ignored", **SIDE)
    assert math.isnan(row["sideways_error_estimate"])
    assert (row["status"], row["error_status"]) == ("ok", "unknown")
    assert "so is whether the beam gave way" in row["message"]


def test_a_sheared_path_solves_only_the_missing_shears(traced, kept):
    first = run(paper(), {"shear": [0.2, 0.4]}, {"depth": 0.5}, **SIDE, kept=kept)
    again = run(paper(), {"shear": [0.4, 0.0, 0.6]}, {"depth": 0.5}, **SIDE, kept=kept)
    solved = [[(load.depth, round(load.shear_x, 12)) for load in scene.loads] for scene in traced]
    # without a shear the plate does not stick: an axisymmetric press; it is the first row that lacks a solve
    assert solved == [[(0.5, 0.2), (0.5, 0.4)], [(0.5, 0.0)], [(0.5, 0.6)]]
    assert again[0]["fem_force_x_N"] == first[1]["fem_force_x_N"]
    assert again[1]["fem_force_x_N"] == 0.0


def test_loads_of_all_kinds_have_rows_of_their_own():
    cases = {
        "coulomb": {"depth": 0.3, "shear": 0.2, "friction": 0.3},
        "grip": {"grip": 2.0, "shear": 0.2},
        "imperfection": {"depth": 0.3, "imperfection": 0.001},
    }
    for load in cases.values():
        (row,) = run(paper(), {"E": [0.5]}, load, formulas=(), **SIDE)
        own_load = {"shear_x" if name == "shear" else name: value for name, value in load.items()}
        own = equilibrium.solve(replace(paper(), E=0.5), Load(**own_load), ROUGH).response
        assert row["status"] == "ok"
        assert [row["fem_force_x_N"], row["fem_force_N"]] == pytest.approx([own.force[0], own.force[2]], rel=1e-9)
        assert row["fem_tilt_rad"] == pytest.approx(own.tilt, rel=1e-9)


def test_critical_depth_and_modes_scale_with_the_design(traced, kept):
    from fem.analyses.modes import modes
    from fem.analyses.stability import critical

    slender = replace(BARE, L=24.0)
    quantities = {"quantities": ("critical_depth", "modes"), "magnet": "ignored"}
    small = replace(slender, D=4.0, L=12.0, l0=4.0, E=4.0, density=540.0)
    names = ("D", "L", "l0", "E", "density")
    values = [(getattr(slender, name), getattr(small, name)) for name in names]
    points = (Factor((*names, "depth"), (*values, (0.5, 0.25))),)
    one, other = run(slender, points, **quantities, kept=kept)
    depth = critical(slender, "ignored", accuracy=ROUGH).depth
    assert one["critical_depth_mm"] == pytest.approx(depth, rel=1e-9)
    assert other["critical_depth_mm"] == pytest.approx(depth / 2, rel=1e-9)
    assert other["critical_force_N"] == pytest.approx(one["critical_force_N"], rel=1e-9)
    own = modes(small, "ignored", 3, depth=0.25, accuracy=ROUGH)
    assert [other[f"mode{k}_Hz"] for k in (1, 2, 3)] == pytest.approx(own.frequency, rel=1e-6)
    assert (other["mode1_shape"], one["status"]) == (own.shape[0], "ok")
    # the critical state and the modes, each once, and no state of the press, which nothing needs
    assert kept.counts() == (2, 2)


def test_decoded_forces_follow_the_modulus():
    soft, hard = run(
        paper(), {"E": [0.5, 2.0]}, {"depth": 0.5}, formulas=("finite",), quantities=("force", "decoded_force_error")
    )
    assert hard["decoded_force_N"] == pytest.approx(4 * soft["decoded_force_N"], rel=1e-12)
    assert soft["decoded_force_error_percent"] == pytest.approx(
        100 * abs(soft["decoded_force_N"] / soft["fem_force_N"] - 1), rel=1e-2
    )
    assert soft["decoded_force_error_percent"] < 10


@pytest.mark.parametrize(("axis", "values"), [("l0", [0.6, 7.2]), ("hall_low", [3.0, 0.2])])
def test_impossible_hall_elements_spoil_only_their_own_cases(axis, values):
    wrong, right = run(paper(), {axis: values}, {"depth": 0.5})
    (alone,) = run(paper(), {axis: values[1:]}, {"depth": 0.5})
    assert (wrong["status"], axis in wrong["message"]) == ("bad_input", True)
    assert wrong[study_input.column(axis)] == values[0]
    assert (right["status"], right["message"]) == ("ok", "")
    assert right["fem_force_N"] == alone["fem_force_N"]
    assert right["fem_S1_mT"] == alone["fem_S1_mT"]


def dies(task):
    """A solve whose process dies for beams of 10 mm."""
    if task.scene.design.L == 10.0:
        os.kill(os.getpid(), signal.SIGKILL)
    from studies.mechanics.path_solver import solve_task

    return solve_task(task)


def test_a_case_that_kills_its_worker_is_a_row_and_is_retried_only_if_asked(kept, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(solve_plan, "solve_task", dies)
        patch.setenv("PYTHONPATH", f"{Path(__file__).parent}{os.pathsep}{Path(__file__).parent.parent}")
        rows = run(BARE, AXES, kept=kept, processes=Processes(2))
    assert [row["status"] for row in rows] == ["ok", "ok", "worker_died", "worker_died"]
    assert "signal 9" in rows[2]["message"]
    assert [row["status"] for row in run(BARE, AXES, kept=kept)] == ["ok", "ok", "worker_died", "worker_died"]
    again = run(BARE, AXES, kept=kept, processes=Processes(0, retry_failed=True))
    assert {row["status"] for row in again} == {"ok"}


KINDS = {
    "force": "fem.equilibrium.walk",
    "critical_depth": "fem.analyses.stability.critical",
    "modes": "fem.analyses.modes.modes",
    "response": "fem.analyses.vibration.vibrating_sensor",
    "cycle": "studies.mechanics.loading_cycles.run",
}
"""The function that solves for a quantity of each kind of path."""


@pytest.mark.parametrize("quantity", KINDS)
@pytest.mark.parametrize("error", [MeshError, ValueError])
def test_what_cannot_be_solved_is_kept_and_a_bug_ends_the_sweep(quantity, error, kept, monkeypatch):
    def fails(*args, **kwargs):
        raise error("why")

    monkeypatch.setattr(KINDS[quantity], fails)
    load = {"depth": 0.5, "frequency": 1.0} if quantity == "cycle" else {"depth": 0.5}
    # states alone are always solved too
    choices = {"quantities": (quantity,)}
    if issubclass(error, SolveFailed):
        (row,) = run(BARE, {"E": [1.0]}, load, kept=kept, **choices)
        assert row["status"] in ("failed", "not_converged")
        assert "why" in row["message"]
        return
    with pytest.raises(error, match="why"):
        run(BARE, {"E": [1.0]}, load, kept=kept, **choices)
    assert not any(outcome != "ok" for (outcome,) in kept._connections[0].execute("SELECT outcome FROM state"))


def fails_in_a_worker(task):
    raise ValueError("a bug in a worker")


def test_a_bug_in_a_worker_ends_the_sweep_and_is_stored_nowhere(kept, monkeypatch):
    monkeypatch.setattr(solve_plan, "solve_task", fails_in_a_worker)
    monkeypatch.setenv("PYTHONPATH", f"{Path(__file__).parent}{os.pathsep}{Path(__file__).parent.parent}")
    with pytest.raises(ValueError, match="a bug in a worker") as caught:
        run(BARE, AXES, kept=kept, processes=Processes(2))
    assert "in fails_in_a_worker" in "".join(caught.value.__notes__)
    assert kept.counts() == (0, 0)


def test_states_that_are_removed_during_a_sweep_are_solved_again(kept, traced):
    axes, load = {"L": [9.0, 10.0, 11.0], "depth": [0.5]}, {}
    batches = sweep.run(plan_of(BARE, axes, load), None, kept, processes=Processes(0))
    rows = list(flat_rows(next(batches)))
    kept._connections[0].execute("DELETE FROM state")
    rows += [row for table in batches for row in flat_rows(table)]
    assert len(traced) == len(rows) == 3
    assert [row["L_mm"] for row in run(BARE, axes, load, kept=kept)] == axes["L"]
    assert len(traced) == 4


def test_a_store_that_loses_states_ends_a_sweep_with_a_sentence(kept, monkeypatch, refused):
    monkeypatch.setattr(kept, "add", lambda *_: None)
    with refused("have been removed from the store", "give the same command again"):
        run(BARE, AXES, kept=kept)


# Readings

READ = ("force", "readings")


def test_layouts_have_columns_of_their_own():
    three, chip, finer = run(
        paper(), {"hall_layout": ["three", "tmag5273a1", "tle493d-p2b6"]}, {"depth": 0.5}, quantities=READ
    )
    assert math.isfinite(three["fem_S1_V"])
    assert math.isnan(three["fem_chip_-z_output_mT"])
    for row in (chip, finer):
        assert math.isnan(row["fem_S1_V"])
        # a chip sends whole steps
        assert row["fem_chip_-z_output_mT"] == pytest.approx(row["fem_chip_-z_mT"], abs=0.1)
    # both lie on the axis, below the magnet
    assert chip["fem_chip_-z_mT"] == three["fem_S1_mT"]


# A sweep as options and a study file ask for it: what is taken from where, and what contradicts what.


def asked(axis=None, sets=(), models=None, accuracy=None, tolerance=None, **more):
    return Sweep(axis=axis, wanted=Wanted(accuracy=accuracy, tolerance=tolerance), **more), sets, models


def asked_plan(source, options):
    return sweep.plan_of(source, *options)


def idle_axes(rows, plan, *, whole):
    shown = Shown(plan)
    shown.rows, shown.count = rows, len(rows)
    return sweep.idle_axes(shown, whole=whole)


STUDY = 'depth = 1\naccuracy = "fine"\nmagnet = "ignored"\n[axes]\nD = [3, 8]\n'


def test_a_study_file_gives_everything(toml):
    plan = asked_plan(toml(STUDY, "study.toml"), asked(sets=["E=2"]))
    assert (plan.design.E, plan.load, plan.magnet, plan.count) == (2.0, {"depth": 1.0}, "ignored", 2)
    assert [model.accuracy_of() for model in plan.models] == [FINE, None]
    assert (plan.levels, plan.quantities) == (("paper",), ("force", "shift", "contact_radius", "readings"))


def test_options_replace_the_values_of_a_study(toml):
    options = asked(depth=2.0, accuracy="quick", magnet="rigid", quantities="tilt,force")
    plan = asked_plan(toml(STUDY, "study.toml"), options)
    assert (plan.load, plan.magnet, plan.quantities) == ({"depth": 2.0}, "rigid", ("force", "tilt"))
    assert [model.accuracy_of() for model in plan.models] == [QUICK, None]


def test_models_are_ordered_from_coarse_to_fine():
    plan = asked_plan(None, asked(["depth=1"], models="half-quick,finite,standard,quick,paper"))
    assert [(model.name, model.model) for model in plan.models if isinstance(model, FemModel)] == [
        ("quick", "auto"),
        ("standard", "auto"),
        ("half-quick", "half"),
    ]
    assert plan.models[1].accuracy_of() == STANDARD
    assert plan.levels == ("paper", "finite")


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (asked(), ["a sweep needs at least one axis"]),
        (asked(["D=8"]), ["a sweep needs a depth"]),
        (asked(["depth/D=0.1"], depth=1.0), ["depth is given twice"]),
        (asked(["L=8,9", "L/D=1,2"], depth=1.0), ["L is given twice, as axes L and L/D"]),
        (asked(["L/D=0,2"], depth=1.0), ["every value of axis L/D must be more than 0; got 0"]),
        (
            asked(["law=neo-hookean,yeoh"], depth=1.0),
            ["yeoh without its numbers", "set yeoh_2 or yeoh_3, or leave it out"],
        ),
        (asked(["D=8"], depth=-1.0), ["axis depth must be more than 0 mm; got -1"]),
        (asked(["D=8"], depth=1.0, sets=["D=9"]), ["D is both an axis and set to 9"]),
        (asked(["depth=1"], depth=1.0), ["depth is given twice"]),
        (asked(["depth=1"], load=["depth=2"]), ["depth is given twice, as an axis and by --load"]),
        (asked(["depth=1"], models=""), ["there is no model ''"]),
        (asked(["depth=1"], load=["sheer=2"]), ["'sheer'", "did you mean shear"]),
        (asked(["magnet=rigid,ignored"], depth=1.0, magnet="rigid"), ["magnet is given twice"]),
        (asked(["depth=1"], accuracy="quick", models="standard"), ["models and accuracy both choose"]),
        (asked(["depth=1"], models="standrad"), ["there is no model 'standrad': did you mean standard?"]),
        (asked(["depth=1"], tolerance="1%", accuracy="quick"), ["a tolerance chooses the accuracy"]),
        (asked(["depth=1"], tolerance="200%"), ["the tolerance must be a percentage", "'200%'"]),
        (asked(["depth=1"], models="paper", quantities="modes"), ["quantity modes needs finite elements"]),
        (asked(["depth=1"], quantities="cycle"), ["quantity cycle needs the rate"]),
        (asked(["depth=1"], load=["frequency=2"]), ["frequency has no effect", "response"]),
        (asked(["depth=1"], load=["speed=2"], quantities="response"), ["speed has no effect"]),
        (asked(["speed=1,2"], depth=1.0, load=["frequency=2"], quantities="response"), ["leave one of them out"]),
        (asked(["frequency=0,2"], depth=1.0, quantities="response"), ["frequency must be more than 0 Hz", "got 0"]),
        (asked(["depth=1"], models="quick", quantities="decoded_force_error"), ["needs a level of the formulas"]),
    ],
)
def test_contradictions_are_refused(options, parts, refused):
    with refused(*parts):
        asked_plan(None, options)


def test_a_study_with_axes_of_its_own_takes_no_others(toml, refused):
    path = toml(STUDY, "study.toml")
    with refused("has its own axes"):
        asked_plan(path, asked(["E=1"]))
    with refused("the design is given twice"):
        asked_plan(path, asked(design="paper"))


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
    plan = asked_plan(None, asked(["D=6,8", "f=5,6", "E=1"], depth=0.3))
    assert idle_axes(rows, plan, whole=True) == [("f", "the results are the same for all its values")]
    rows = list(cases(axes, fem_force_N=lambda case: case["D"], fem_S2_mT=lambda case: case["f"]))
    assert idle_axes(rows, plan, whole=True) == []
    assert idle_axes(rows, plan, whole=False) == [("f", "it changes only columns that --wide, --json and --out show")]
    # a single case tells nothing, nor do cases that failed
    assert idle_axes(rows[:1], plan, whole=True) == idle_axes([], plan, whole=True) == []
    failed = [row | {"status": "bad_input", "fem_S2_mT": 0.0} for row in rows]
    assert idle_axes(failed, plan, whole=True) == []
