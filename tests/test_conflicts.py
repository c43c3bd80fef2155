"""Contradictory requirements: problems whose smallest conflicting sets and gives are known in closed form."""

import itertools
import math

import numpy as np
import pytest

from studies.sizing.conflicts import (
    SENSES,
    Bound,
    bounds_of,
    find_conflict,
    least_give,
    rounded_up,
    smallest_conflicts,
)
from studies.sizing.requirements import LIMITS, Requirements

LENGTH, STIFFEST = 10.0, 4.0
RANGE, STRAIN = Bound("force_z", 20.0, "N", "at least"), Bound("largest_strain", 0.4, "1", "at most")


def spring_margins(stiffness, force):
    """Margins of a spring, length 10 mm: the range is the force, the strain force/(stiffness length)."""
    return np.stack([force - RANGE.value, STRAIN.value - force / (stiffness * LENGTH)], axis=-1)


def springs(count):
    stiffness, share = np.meshgrid(np.linspace(1, STIFFEST, count), np.linspace(0.1, 1, count))
    return spring_margins(stiffness.ravel(), share.ravel() * RANGE.value)


def best_spring(column, others):
    """The stiffest spring, at the force of the full range, or at that of the full strain."""
    force = STRAIN.value * STIFFEST * LENGTH if column == 0 and others else RANGE.value
    return spring_margins(np.array(STIFFEST), np.array(force))


def half_planes(points):
    """Margins of x >= 1, y >= 1 and x + y <= 1.5: each two can be met, all three cannot."""
    x, y = points.T
    return np.stack([x - 1, y - 1, 1.5 - x - y], axis=1)


NAMES = [Bound(name, 1.0, "mm", "at least") for name in "abc"]
POINTS = np.array(list(itertools.product(np.arange(0, 2.01, 0.25), repeat=2)))


def test_two_requirements_conflict_and_each_gives_what_mechanics_says():
    """At 20 N the stiffest spring has a strain of 50 %; at 40 % it carries 16 N."""
    conflict = find_conflict([RANGE, STRAIN], springs(10))
    assert conflict.members == (RANGE, STRAIN)
    assert conflict.gives == pytest.approx((4.0, 0.1))
    assert conflict.sentence() == (
        "no variant meets force_z of at least 20 N together with largest_strain of at most 40 %: either force_z "
        "falls by 4 N to 16 N, or largest_strain rises by 10 percentage points to 50 %"
    )


def test_a_search_makes_gives_exact():
    coarse = springs(4)[springs(4)[:, 1] > -0.3]
    assert find_conflict([RANGE, STRAIN], coarse).gives[0] > 4.1
    assert find_conflict([RANGE, STRAIN], coarse, best_spring).gives == pytest.approx((4.0, 0.1))


def test_three_requirements_of_which_any_two_can_be_met():
    conflict = find_conflict(NAMES, half_planes(POINTS))
    assert conflict.members == tuple(NAMES)
    assert conflict.gives == (0.5, 0.5, 0.5)


def test_a_requirement_that_nothing_meets_is_alone():
    margins = np.column_stack([half_planes(POINTS), np.full(len(POINTS), -3.0)])
    conflict = find_conflict([*NAMES, RANGE], margins)
    assert (conflict.members, conflict.gives) == ((RANGE,), (3.0,))
    assert "unless force_z falls by 3 N to 17 N; further requirements conflict too" in conflict.sentence()


def test_gives_of_all_count_every_requirement():
    """With x <= 0.25 added, x >= 1 conflicts with it; the triple remains a conflict whatever x >= 1 gives."""
    margins = np.column_stack([half_planes(POINTS), 0.25 - POINTS[:, 0]])
    conflict = find_conflict([*NAMES, RANGE], margins)
    assert (conflict.members, conflict.gives) == ((NAMES[0], RANGE), (0.75, 0.75))
    assert conflict.gives_of_all == (0.75, math.inf)
    assert "further" not in conflict.sentence()


def test_no_conflict():
    assert find_conflict(NAMES, half_planes(POINTS) + 1) is None


def test_a_search_may_dissolve_a_conflict():
    def best(column, others):
        return np.zeros(3)

    assert find_conflict(NAMES, half_planes(POINTS), best) is None


def test_a_search_is_repeated_for_a_new_set_only():
    """The first search shows that a and b can be met together, so that a and c remain; nothing is searched twice."""
    tasks = []

    def best(column, others):
        tasks.append((column, others))
        return np.array([1.0, 1.0, -1.0])

    margins = np.array([[1.0, -1.0, -1.0], [-1.0, 1.0, 1.0]])
    assert find_conflict(NAMES, margins, best).members == (NAMES[0], NAMES[2])
    assert len(tasks) == len(set(tasks)) == 7


def test_a_search_without_an_answer_keeps_the_samples():
    conflict = find_conflict([RANGE, STRAIN], springs(10), lambda column, others: None)
    assert conflict.gives == pytest.approx((4.0, 0.1))


def test_all_smallest_sets_are_named():
    margins = np.array([[1.0, -1.0, -1.0], [-1.0, 1.0, 1.0]])
    assert smallest_conflicts(margins) == [(0, 1), (0, 2)]
    assert find_conflict(NAMES, margins).others == (("a", "c"),)


@pytest.mark.parametrize("seed", range(5))
def test_a_smallest_set_is_minimal(seed):
    margins = np.random.default_rng(seed).normal(0.3, 1, (12, 8))
    margins[:, 0] = np.where((margins[:, 1:] >= 0).sum(axis=1) > 3, -1.0, margins[:, 0])
    sets = smallest_conflicts(margins)
    assert sets
    for columns in sets:
        assert not (margins[:, columns] >= 0).all(axis=1).any()
        for subset in itertools.combinations(columns, len(columns) - 1):
            assert (margins[:, subset] >= 0).all(axis=1).any()


def test_the_unknown_is_not_met():
    margins = np.array([[np.nan, 1.0], [1.0, -2.0]])
    assert smallest_conflicts(margins) == [(0, 1)]
    assert least_give(margins, 0, [1]) == math.inf
    assert least_give(margins, 1, [0]) == 2.0


def test_a_requirement_that_is_met_gives_nothing():
    assert least_give(np.array([[1.0, 2.0]]), 0, [1]) == 0.0


def test_bounds_are_the_requirements_that_are_set():
    every = Requirements(
        force_z=5.0, force_x=2.0, resolution_z=1e-3, resolution_x=1e-3, largest_strain=0.4, first_mode=50.0
    )
    names = [bound.name for bound in bounds_of(every)]
    assert names == [name for name in SENSES if name not in ("outer_size", "height")]
    assert set(SENSES) - set(LIMITS) == {"no_saturation", "unique_decoding"}


def test_a_switch_is_left_out():
    margins = np.array([[1.0, -0.2], [-4.0, 0.1]])
    conflict = find_conflict([RANGE, Bound("no_saturation", 1.0, "1", "switch")], margins)
    assert conflict.sentence().endswith(
        "no_saturation: either force_z falls by 4 N to 16 N, or no_saturation is left out"
    )


@pytest.mark.parametrize(
    ("bound", "give", "text"),
    [
        (Bound("resolution_z", 0.005, "N", "at most"), 0.00211, "resolution_z rises by 2.2 mN to 7.2 mN"),
        (Bound("outer_size", 10.0, "mm", "at most"), 1.301, "outer_size rises by 1.4 mm to 11.4 mm"),
        (Bound("first_mode", 100.0, "Hz", "at least"), 12.3, "first_mode falls by 13 Hz to 87 Hz"),
        (Bound("stability_margin", 1.2, "1", "at least"), 0.1, "stability_margin falls by 0.1 to 1.1"),
        (Bound("force_z", 5.0, "N", "at least"), math.inf, "force_z gives more than the search covers"),
    ],
)
def test_text_of_a_give(bound, give, text):
    assert bound.relaxed(give) == text


@pytest.mark.parametrize("value", [0.1, 0.0011, 3.0000001, 99.9, 12345.0])
def test_rounding_up_never_falls_short(value):
    assert value <= rounded_up(value) <= 1.1 * value


def test_too_many_requirements_are_refused(refused):
    with refused("among at most 16 requirements; got 17"):
        smallest_conflicts(np.ones((1, 17)))


def test_rows_leave_out_what_is_unknown():
    (row,) = find_conflict([RANGE], np.array([[np.nan]])).rows()
    assert (row["requirement"], row["gives"]) == ("force_z", None)
