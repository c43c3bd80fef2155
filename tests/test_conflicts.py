"""Requirements without a variant: what a bound proves at once, and advice that holds."""

import dataclasses

import numpy as np
import pytest

from studies.sizing import conflicts
from studies.sizing.candidate_variables import Space
from studies.sizing.catalogues import catalogues_of
from studies.sizing.conflicts import Advice, Conflict, conflict_of, impossible
from studies.sizing.requirements import Requirements
from studies.sizing.variant_search import Effort, searched, sorted_parts

NEEDED = Requirements(
    force_z=5.0,
    force_x=1.5,
    largest_strain=0.3,
    D_low=8.0,
    D_high=12.0,
    magnets=("5x3 N45", "4x4 N45"),
    silicones=("Smooth-Sil 940", "Dragon Skin 30"),
    hall_parts=("DRV5055A2",),
)
PARTS = catalogues_of(NEEDED)
BRIEF = Effort(64, 6)


@pytest.mark.parametrize(("key", "bound"), [("outer_size", 9.0), ("height", 9.0), ("wall", 4.0)])
def test_what_is_impossible_by_a_bound_is_said_at_once(key, bound):
    needed = dataclasses.replace(NEEDED, **{key: bound})
    (text,) = impossible(needed, PARTS)
    assert "impossible" in text
    assert f"{bound:g} mm" in text


def test_no_candidate_is_beyond_a_bound():
    """A bound is a proof: no random candidate has a smaller base or a lower sensor."""
    needed = dataclasses.replace(NEEDED, D_low=None, D_high=None)
    space, random = Space(needed, sorted_parts(PARTS)), np.random.default_rng(2)
    drawn = space.candidates(random.integers([2, 2, 1], size=(4000, 3)), random.random((4000, 5)))
    size, height, _ = (each[drawn.outside() == ""] for each in drawn.sizes())
    for key, least in (("outer_size", size.min()), ("height", height.min())):
        assert not impossible(dataclasses.replace(needed, **{key: float(least)}), PARTS)


def test_possible_requirements_have_no_bound():
    assert impossible(dataclasses.replace(NEEDED, outer_size=30.0, height=40.0), PARTS) == ()


@pytest.fixture(scope="module")
def conflict():
    needed = dataclasses.replace(NEEDED, largest_strain=0.02)
    found = searched(needed, PARTS, BRIEF)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(conflicts, "LEAST_EFFORT", Effort(64, 6))
        patch.setattr(conflicts, "ADVICES", 1)
        points = []

        def solve(chosen, wanted):
            points.append((len(chosen), wanted))
            return []

        return needed, conflict_of(needed, PARTS, BRIEF, found, solve), points


def test_advice_without_finite_elements_is_not_given(conflict):
    """Each advice is searched again and solved: what no solve confirms is not said."""
    needed, found, points = conflict
    assert found.advices == ()
    assert "no requirement was found that could give alone" in found.sentence()
    assert found.sentence().startswith(f"none of {found.candidates} candidates meets all requirements")
    assert points[-1][1].largest_strain > needed.largest_strain


def test_a_looser_requirement_never_gives_a_larger_demand():
    """Of two resolutions the looser one needs no larger strain."""
    gives = []
    for resolution in (0.02, 0.05):
        needed = dataclasses.replace(NEEDED, largest_strain=0.02, resolution_z=resolution)
        pools = searched(needed, PARTS, BRIEF, free="largest_strain")
        gives.append(min(float(pool.F[pool.violation == 0, 0].min(initial=np.inf)) for pool in pools))
    assert gives[1] <= 1.005 * gives[0]


def test_sentence_and_rows():
    advice = Advice("outer_size", 12.0, "mm", 13.2)
    missed = ({"requirement": "largest_strain", "value": 0.4, "unit": "1"},)
    found = Conflict((), 1000, None, missed, (advice,))
    assert found.sentence().endswith("a variant was found where outer_size rises to 13.2 mm")
    first, second = found.rows()
    assert first["gives"] == pytest.approx(1.2)
    assert (second["requirement"], second["gives"]) == ("largest_strain", None)
