"""The search for a Pareto front: known fronts, choices, and reproducibility."""

import numpy as np
import pytest
from pymoo.problems.multi.bnh import BNH
from pymoo.problems.multi.osy import OSY

from studies.sizing.front_search import Effort, Variable, search


def variables_of(problem):
    return [Variable(f"x{k}", low, high) for k, (low, high) in enumerate(zip(problem.xl, problem.xu, strict=True))]


def evaluator(problem):
    def evaluate(X):
        return tuple(problem.evaluate(X, return_values_of=["F", "G"]))

    return evaluate


def distances(points, front):
    """The distance of each point from the front, in widths of the front."""
    width = np.ptp(front, axis=0)
    return np.linalg.norm((points[:, None] - front) / width, axis=2).min(axis=1)


def osy_front():
    """Osyczka and Kundu's front in five segments; x4 = x6 = 0 on all of them (Deb et al. 2002, section VI)."""
    t = np.linspace(0, 1, 200)
    one, zero = np.ones_like(t), np.zeros_like(t)
    segments = [
        (5 * one, one, 1 + 4 * t, zero, 5 * one, zero),
        (5 * one, one, 1 + 4 * t, zero, one, zero),
        (4.056 + 0.944 * t, (4.056 + 0.944 * t - 2) / 3, one, zero, one, zero),
        (zero, 2 * one, 1 + 2.732 * t, zero, one, zero),
        (t, 2 - t, one, zero, one, zero),
    ]
    return OSY().evaluate(np.concatenate([np.column_stack(segment) for segment in segments]), return_values_of=["F"])


@pytest.mark.parametrize(
    ("problem", "front", "effort"),
    # NSGA-II can miss one of the five separate segments of OSY's front, with every fifth seed or so
    [(BNH(), BNH().pareto_front(400), Effort(60, 40)), (OSY(), osy_front(), Effort(100, 150, seed=2))],
    ids=["BNH", "OSY"],
)
def test_published_fronts(problem, front, effort):
    last = search(variables_of(problem), evaluator(problem), effort)
    points = last.F[last.front]
    assert np.quantile(distances(points, front), 0.9) < 0.02
    # the whole front, not one part of it
    assert distances(front, points).max() < 0.15


def mixed(X):
    """Two objectives of a number and a choice of 7; choice 3 alone meets the constraint."""
    x, choice = X[:, 0], X[:, 1]
    return np.column_stack([x**2, (x - 1) ** 2]), np.abs(choice - 3)[:, None]


MIXED = [Variable("x", -2.0, 2.0), Variable("choice", choices=7)]


def test_choice_that_is_feasible():
    last = search(MIXED, mixed, Effort(20, 15))
    front = last.X[last.front]
    assert len(front) > 10
    assert set(front[:, 1]) == {3.0}
    assert front[:, 0].min() > -0.05
    assert front[:, 0].max() < 1.05


def test_no_feasible_candidate_leaves_an_empty_front():
    last = search([Variable("x")], lambda X: (np.column_stack([X, -X]), np.ones((len(X), 1))), Effort(8, 3))
    assert len(last.front) == 0
    assert len(last.X) == 8


def same(one, other):
    names = ("X", "F", "G", "rank", "crowding")
    return all(np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True) for name in names)


def test_seed_fixes_the_result():
    assert same(search(MIXED, mixed, Effort(12, 4, seed=5)), search(MIXED, mixed, Effort(12, 4, seed=5)))
    assert not same(search(MIXED, mixed, Effort(12, 4, seed=5)), search(MIXED, mixed, Effort(12, 4, seed=6)))
