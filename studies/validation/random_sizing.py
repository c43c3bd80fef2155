"""A random search against which the search of `magtip size` is held, over the same parts and by the same surrogate.

`python -m studies.validation.random_sizing REQUIREMENTS.toml` draws ten times as many candidates as the search rated,
parts and lengths evenly, and says how far the best of them are beyond the front: exit status 3 if by more than 2 %,
or if none of them meets the requirements, which shows nothing.
"""

import sys

import numpy as np

from geometry.arrays import Array
from geometry.bad_input import BadInput
from studies.output.result import BAD, FAILED, GOOD
from studies.sizing.catalogues import Catalogues, catalogues_of
from studies.sizing.front_solves import scores, steps
from studies.sizing.requirements import Requirements, read_requirements
from studies.sizing.variant_search import RESOLUTION, Effort, Rating, searched, spaces, whole_front

ALLOWED = 0.02
"""How far a random candidate may be beyond the front, relative."""
DRAWN = 8192
"""Candidates that are drawn at a time."""


def random_objectives(needed: Requirements, parts: Catalogues, count: int, seed: int = 5) -> Array:
    """Return the objectives, shape (n, 3), of those of `count` random candidates that meet the requirements, of
    one-axis parts and as many of chips."""
    random, rating, rows = np.random.default_rng(seed), Rating(needed), [np.zeros((0, 3))]
    for space in spaces(needed, parts):
        first, end = np.array(space.choices).T
        for start in range(0, count, DRAWN):
            n = min(DRAWN, count - start)
            choices = random.integers(first, end, size=(n, 3))
            F, violation = rating(space.candidates(choices, random.random((n, 5))), 0.0)
            rows.append(F[violation == 0])
    return np.concatenate(rows)


def gains(front: Array, F: Array, needed: Requirements) -> tuple[float, float]:
    """Return how far points F are beyond the best one of a front without a loss in another objective, and beyond its
    ends, as differences of logarithms."""
    best = front[scores(steps(front), needed).argmax()]
    no_worse = (best + RESOLUTION >= F).all(axis=1)
    least = F.min(axis=0) if len(F) else np.full(3, np.inf)
    return float((best - F[no_worse]).max(initial=0.0)), float((front.min(axis=0) - least).max())


def held(needed: Requirements, effort: Effort, times: int = 10) -> tuple[bool, str]:
    """Return whether the front holds against `times` as many random candidates, and a sentence."""
    parts = catalogues_of(needed)
    found = searched(needed, parts, effort)
    rated = sum(pool.rated for pool in found)
    F = random_objectives(needed, parts, times * rated)
    if not any((pool.violation == 0).any() for pool in found):
        return not len(F), f"none of {rated} candidates, and {len(F)} of {times} times as many random ones, meet all"
    drawn = f"{times * rated} random candidates of each kind"
    if not len(F):
        return False, f"none of {drawn} meets all requirements: nothing is shown"
    beyond, longer = gains(whole_front(found)[1], F, needed)
    said = f"{len(F)} of {drawn} meet all requirements; the best of them is {100 * beyond:.2g} % beyond the best "
    said += f"variant, and {100 * longer:.2g} % beyond an end of the front"
    return max(beyond, longer) < ALLOWED, said


if __name__ == "__main__":
    try:
        if len(sys.argv) != 2:
            raise BadInput("random_sizing takes one file of requirements")
        holds, text = held(read_requirements(sys.argv[1]), Effort())
    except BadInput as error:
        print(error, file=sys.stderr)
        sys.exit(BAD)
    print(text)
    sys.exit(GOOD if holds else FAILED)
