"""The search for variants: fronts, resolution, determinism, and a random search that finds nothing better."""

import dataclasses

import numpy as np
import pytest

from studies.sizing.candidate_performance import performance
from studies.sizing.catalogues import catalogues_of
from studies.sizing.front_solves import scores, steps
from studies.sizing.requirements import Requirements
from studies.sizing.sensor_arrays import sensors_of
from studies.sizing.variant_search import (
    RESOLUTION,
    Effort,
    Rating,
    dominated,
    first_candidates,
    front_of,
    objectives,
    searched,
    spaces,
    spread,
    whole_front,
)

NEEDED = Requirements(
    force_z=5.0,
    force_x=1.5,
    outer_size=30.0,
    D_low=8.0,
    D_high=12.0,
    magnets=("5x3 N45", "4x4 N45"),
    silicones=("Smooth-Sil 940", "Dragon Skin 30"),
    hall_parts=("DRV5055A2", "TLE493D-P2B6"),
)
PARTS = catalogues_of(NEEDED)
BRIEF = Effort(48, 8)


@pytest.fixture(scope="module")
def found():
    return searched(NEEDED, PARTS, BRIEF)


def test_ends_of_a_front_are_chosen_first():
    F = np.column_stack([np.linspace(0, 1, 11), np.linspace(1, 0, 11) ** 2])
    assert spread(F, 2).tolist() == [0, 10]
    assert spread(F, 11).tolist() == list(range(11))
    assert {0, 10} <= set(spread(F, 5).tolist())


def test_points_of_one_box_are_one_and_none_dominates_another():
    F = np.random.default_rng(0).random((500, 3))
    kept = front_of(F)
    assert not dominated(F[kept]).any()
    # a point within the resolution of another one is left out
    assert len(front_of(np.vstack([F, F[kept] + 1e-6]))) == len(kept)


def test_one_axis_parts_and_chips_are_searched_apart():
    one_axis, chips = spaces(NEEDED, PARTS)
    names = [part.name for part in one_axis.parts.hall_parts]
    assert [names[slice(*space.choices[2])] for space in (one_axis, chips)] == [["DRV5055A2"], ["TLE493D-P2B6"]]


def test_every_combination_of_parts_is_among_the_first_candidates():
    space = spaces(NEEDED, PARTS)[0]
    assert len(np.unique(first_candidates(space, 16, 0).choices, axis=0)) == 4


def test_variants_of_a_front_meet_the_requirements(found):
    front, _ = whole_front(found)
    assert len(front) > 5
    sensors = sensors_of(front)
    result = performance(sensors, sensors.beams(), NEEDED)
    assert all((margin >= 0).all() for margin in result.margins.values())


def test_the_seed_fixes_the_front(found):
    again = whole_front(searched(NEEDED, PARTS, BRIEF))[0]
    assert again.keys() == whole_front(found)[0].keys()


def random_objectives(needed, parts, count):
    """Objectives of those of `count` random candidates of each kind, parts and lengths evenly, that meet all."""
    random, rating, rows = np.random.default_rng(5), Rating(needed), []
    for space in spaces(needed, parts):
        choices = random.integers(*np.array(space.choices).T, size=(count, 3))
        F, violation = rating(space.candidates(choices, random.random((count, 5))), 0.0)
        rows.append(F[violation == 0])
    return np.concatenate(rows)


def test_a_random_search_of_ten_times_the_evaluations_finds_nothing_better():
    """Neither is a random candidate beyond the best by more than 2 %, nor does one extend an end by more."""
    needed = dataclasses.replace(NEEDED, hall_parts=("TLE493D-P2B6",), magnets=("4x4 N45",))
    parts = catalogues_of(needed)
    pools = searched(needed, parts, Effort(64, 10))
    front = whole_front(pools)[1]
    F = random_objectives(needed, parts, 10 * sum(pool.rated for pool in pools))
    assert len(F) > 50
    best = front[scores(steps(front), needed).argmax()]
    no_worse = (best + RESOLUTION >= F).all(axis=1)
    # differences of logarithms
    assert (best - F[no_worse]).max(initial=0.0) < 0.02
    assert (front.min(axis=0) - F.min(axis=0)).max() < 0.02


def test_a_tighter_requirement_gives_no_longer_front(found):
    _, F = whole_front(found)
    tight = dataclasses.replace(NEEDED, outer_size=float(np.exp(F[:, 2]).min()) - 0.3)
    pools = searched(tight, PARTS, BRIEF)
    assert not any((pool.violation == 0).any() for pool in pools)


def test_objectives_that_are_capped_do_not_differ():
    values = {"range_z": np.array([15.0, 15.0]), "resolution_z": np.array([0.1, 0.2])}
    values |= {"resolution_x": np.array([0.05, np.nan]), "outer_size": np.array([20.0, 20.0])}
    F = objectives(values, NEEDED)
    assert F[0, 0] == F[1, 0] == -np.log(3)
    assert F[1, 1] - F[0, 1] == pytest.approx(np.log(2))
