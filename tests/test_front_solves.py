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
from studies.sizing.candidate_performance import FIGURES, LEAST
from studies.sizing.candidate_variables import Space
from studies.sizing.catalogues import catalogues_of
from studies.sizing.front_solves import (
    COMPARED,
    FemBeams,
    FrontPoint,
    _judged,
    largest_differences,
    ranked,
    solved_points,
)
from studies.sizing.requirements import Requirements


def points(rows, **solved):
    """Points with the given ranges, resolutions and sizes."""
    made = []
    for number, (range_z, resolution, size) in enumerate(rows, 1):
        values = dict.fromkeys(FIGURES, 1.0) | {f"{name}_half_width": 0.0 for name in COMPARED}
        values |= {"range_z": range_z, "resolution_z": resolution, "resolution_x": resolution / 2, "outer_size": size}
        values |= solved
        made.append(FrontPoint(number, None, None, values, values, {}, [], "ok", ""))
    return made


def test_the_weights_decide_the_ranks():
    made = points([(10, 0.01, 20), (5, 0.001, 20), (5, 0.01, 10)])
    for weights, best in (((1, 0, 0), 1), ((0, 1, 0), 2), ((0, 0, 1), 3)):
        names = dict(zip(("weight_range", "weight_resolution", "weight_size"), map(float, weights), strict=True))
        order = ranked(made, Requirements(force_z=5.0, **names))
        assert (order[0].number, order[0].rank) == (best, 1)
        assert order[0].score == pytest.approx(1.0)


def test_no_rank_rests_on_less_than_the_resolution():
    """Ranges that differ by rounding do not count, and resolution and size decide."""
    made = points([(15 * (1 + 1e-5), 0.01, 20), (15, 0.009, 20), (15, 0.0095, 18)])
    order = ranked(made, Requirements(force_z=5.0))
    assert order[0].number != 1
    assert {point.number for point in order} == {2, 3}


def test_no_rank_rests_on_less_than_the_error_of_the_finite_elements():
    """3 % more range dominates, but not where finite elements know a range within 10 %: then both share a rank."""
    rows = [(10.3, 0.01, 20), (10, 0.01, 20), (20, 0.02, 20)]
    sure, doubtful = (ranked(points(rows, range_z_half_width=w), Requirements(force_z=5.0)) for w in (0.0, 1.0))
    assert {point.number for point in sure} == {1, 3}
    assert [point.rank for point in sorted(doubtful, key=lambda point: point.number)][0:2] in ([1, 1], [2, 2])


def test_what_finite_elements_dominate_is_left_out():
    made = points([(10, 0.01, 20), (9, 0.011, 21), (12, 0.02, 20)])
    assert [point.number for point in ranked(made, Requirements(force_z=5.0))] in ([1, 3], [3, 1])


def test_failed_points_come_last_without_a_rank():
    made = points([(10, 0.001, 10), (5, 0.01, 20)])
    made[0] = dataclasses.replace(made[0], status="failed", reason="largest_strain is missed by 3 %")
    order = ranked(made, Requirements(force_z=5.0))
    assert [(point.number, point.rank) for point in order] == [(2, 1), (1, 0)]


def test_an_unknown_margin_is_missed():
    (made,) = points([(10, 0.01, 20)])
    failed = _judged(dataclasses.replace(made, margins={"force_x": LEAST, "height": 0.1, "outer_size": -0.02}))
    assert (failed.status, failed.reason) == ("failed", "force_x is not known; outer_size is missed by 2 %")


def test_differences_are_relative_to_finite_elements():
    made = points([(10, 0.01, 20), (5, 0.01, 20)])
    made[0] = dataclasses.replace(made[0], predicted=made[0].predicted | {"range_z": 11.0})
    row = largest_differences(made)["range_z"]
    assert (row["largest_percent"], row["median_percent"]) == pytest.approx((10.0, 5.0))


def test_a_critical_depth_that_only_one_source_finds_is_counted():
    (made,) = points([(10, 0.01, 20)], critical=np.inf)
    assert largest_differences([made])["critical"]["points"] == 0
    row = largest_differences([dataclasses.replace(made, solved=made.solved | {"critical": 0.2})])["critical"]
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


def test_a_force_that_no_press_reaches_is_missed():
    parts = {"magnets": ("5x3 N45",), "silicones": ("Dragon Skin 30",), "hall_parts": ("DRV5055A2",)}
    needed = Requirements(force_z=5000.0, **parts)
    drawn = Space(needed, catalogues_of(needed)).candidates(np.zeros((1, 3), dtype=int), np.full((1, 5), 0.5))
    with temporary() as memory:
        (point,) = solved_points(drawn, needed, Solver(memory, Processes(0), None, QUICK))
    assert point.reason.startswith("force_z is missed by 100 %")


def test_a_load_without_a_depth_has_no_response(sheared):
    assert np.isnan(sheared["force_x"].value).tolist() == [[False, False, True]]


def test_shears_are_those_of_one_path_whatever_their_order(sheared):
    loads = [Load(depth=0.8, shear_x=shear, friction="stick") for shear in (0.4, 0.8)]
    near, far = (state.response for state in trace(paper(), loads, QUICK, model="harmonic"))
    assert sheared["force_x"].value[0, :2] * 64 == pytest.approx([far.force[0], near.force[0]], rel=1e-6)
    assert sheared["shift_z"].value[0, :2] * 8 == pytest.approx([-far.shift[2], -near.shift[2]], rel=1e-6)
