"""The points of a front by finite elements: responses of their beams, ranks, failures and differences."""

import dataclasses

import numpy as np
import pytest
from stores import temporary

from fem.accuracy import QUICK
from fem.equilibrium import trace
from geometry.design import paper
from geometry.loads import Load
from studies.mechanics.path_solver import Answer
from studies.mechanics.solve_plan import Processes, Solver
from studies.sizing.candidate_performance import LEAST, Performance
from studies.sizing.catalogues import catalogues_of
from studies.sizing.front_search import Effort
from studies.sizing.front_solves import FemBeams, FrontPoint, _point, checked, largest_differences, ranked, spread
from studies.sizing.requirements import Requirements
from studies.sizing.variant_search import islands, searched

NAMES = [spec.name for spec in dataclasses.fields(Performance) if spec.name != "margins"]


def points(rows, **solved):
    """Points with the given ranges, resolutions and sizes, and their performance."""
    values = {name: np.ones(len(rows)) for name in NAMES} | {"shears": np.ones((len(rows), 3))}
    values["range_z"], values["resolution_z"], values["outer_size"] = np.array(rows, dtype=float).T
    values["resolution_x"] = values["resolution_z"] / 2
    performance = Performance(**(values | {"margins": {}} | solved))
    made = []
    for k in range(len(rows)):
        one = performance.one(k)
        made.append(FrontPoint(k + 1, None, one, one, {}, {}, "ok", ""))
    return made, performance


def test_ends_of_a_front_are_solved_first():
    F = np.column_stack([np.linspace(0, 1, 11), np.linspace(1, 0, 11) ** 2])
    assert spread(F, 2).tolist() == [0, 10]
    assert spread(F, 11).tolist() == list(range(11))
    chosen = spread(F, 5)
    assert {0, 10} <= set(chosen.tolist())
    assert np.diff(chosen).max() <= 4


def test_the_weights_decide_the_ranks():
    made, solved = points([(10, 0.01, 20), (5, 0.001, 20), (5, 0.01, 10)])
    for weights, best in (((1, 0, 0), 1), ((0, 1, 0), 2), ((0, 0, 1), 3)):
        names = dict(zip(("weight_range", "weight_resolution", "weight_size"), map(float, weights), strict=True))
        order = ranked(made, solved, Requirements(force_z=5.0, **names))
        assert order[0].number == best
        assert order[0].rank == 1
        assert order[0].score == pytest.approx(1.0)


def test_failed_points_come_last_without_a_rank():
    made, solved = points([(10, 0.001, 10), (5, 0.01, 20)])
    made[0] = dataclasses.replace(made[0], status="failed", reason="largest_strain is missed by 3 %")
    order = ranked(made, solved, Requirements(force_z=5.0))
    assert [(point.number, point.rank) for point in order] == [(2, 1), (1, 0)]


def test_differences_are_relative_to_finite_elements():
    made, _ = points([(10, 0.01, 20), (5, 0.01, 20)])
    predicted = dict(made[0].predicted, range_z=11.0)
    made[0] = dataclasses.replace(made[0], predicted=predicted)
    row = largest_differences(made)["range_z"]
    assert row["largest_percent"] == pytest.approx(10.0)
    assert row["median_percent"] == pytest.approx(5.0)


def test_front_is_checked_at_more_poses_before_it_is_solved():
    needed = Requirements(force_z=5.0, force_x=1.0, D_low=9.0, D_high=11.0)
    parts = catalogues_of(needed)
    _, variants = searched(islands(needed, parts)[:1], Effort(16, 2))
    tight = dataclasses.replace(needed, resolution_z=0.3)
    kept, F = checked(variants, tight)
    assert 0 < len(kept) < len(variants)
    assert (F[:, 1] <= np.log(0.3)).all()
    # none is confirmed: all are returned
    assert len(checked(variants, dataclasses.replace(needed, resolution_z=1e-6))[0]) == len(variants)


def test_a_point_whose_sideways_force_is_not_known_fails():
    _, said = points([(10, 0.01, 20)], margins={"force_x": np.array([0.1])})
    solved = dataclasses.replace(said, range_x=np.array([np.nan]), margins={"force_x": np.array([LEAST])})
    point = _point(0, None, said, said, solved)
    assert (point.status, point.rank) == ("failed", 0)
    assert point.reason == "finite elements did not reach range_x; force_x is not known"


def test_half_widths_are_the_differences_to_the_worse_ends():
    _, said = points([(10, 0.01, 20)])
    worse = dataclasses.replace(said, resolution_z=np.array([0.012]))
    assert _point(0, None, said, worse, said).predicted["resolution_z_half_width"] == pytest.approx(0.002)


def test_infinite_critical_depths_are_not_compared():
    made, _ = points([(10, 0.01, 20)], critical=np.array([np.inf]))
    assert largest_differences(made)["critical"]["points"] == 0


def test_a_critical_depth_that_only_one_source_finds_is_counted():
    made, _ = points([(10, 0.01, 20)], critical=np.array([np.inf]))
    row = largest_differences([dataclasses.replace(made[0], solved=made[0].solved | {"critical": 0.2})])["critical"]
    assert (row["points"], row["of_one_source"], row["largest_percent"]) == (0, 1, None)


class Stability:
    """Answers of the search for a critical depth: status, critical depth, depth that is known as stable, message."""

    accuracy = QUICK

    def __init__(self, *found):
        self.found = found

    def answers(self, scenes, kind):
        assert kind == "critical depth"
        names = ("critical_depth_over_D", "stable_to_over_D")
        return [
            [Answer(8.0, 1.0, None, status, text, np.nan, 0.0, values=dict(zip(names, values, strict=False)))]
            for status, text, *values in self.found
        ]


def test_a_search_that_stopped_early_is_stable_no_deeper_than_it_came():
    stopped = ("ok", "the press does not converge beyond 1.6 mm; it is stable up to there", None, 0.2)
    answers = Stability(("ok", "", 0.31, 0.309), ("ok", "", None, 0.45), stopped, ("not_converged", "it stopped"))
    beams = FemBeams([paper()] * 4, answers)
    assert beams.critical_depth().value == pytest.approx([0.31, np.inf, np.nan, np.nan], nan_ok=True)
    assert beams.stable_to(0.0) == pytest.approx([0.31, 0.45, 0.2, np.nan], nan_ok=True)


@pytest.fixture(scope="module")
def sheared():
    """Shears of the paper's sensor: in falling order, and one without a depth because its press has failed."""
    depth, shear = np.array([[0.1, 0.1, np.nan]]), np.array([[0.1, 0.05, 0.1]])
    with temporary() as memory:
        yield FemBeams([paper()], Solver(memory, Processes(0), None, QUICK)).shear(depth, shear)


def test_a_load_without_a_depth_has_no_response(sheared):
    assert np.isnan(sheared["force_x"].value).tolist() == [[False, False, True]]


def test_shears_are_those_of_one_path_whatever_their_order(sheared):
    loads = [Load(depth=0.8, shear_x=shear, friction="stick") for shear in (0.4, 0.8)]
    near, far = (state.response for state in trace(paper(), loads, QUICK, model="harmonic"))
    assert sheared["force_x"].value[0, :2] * 64 == pytest.approx([far.force[0], near.force[0]], rel=1e-6)
    assert sheared["shift_z"].value[0, :2] * 8 == pytest.approx([-far.shift[2], -near.shift[2]], rel=1e-6)
