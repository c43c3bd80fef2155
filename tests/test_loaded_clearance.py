"""Gaps of a loaded beam to Hall elements, posts and screws beside it."""

import dataclasses
import math

import numpy as np
import pytest

from geometry.base import Base, plan
from geometry.design import paper
from geometry.fabrication import hall_elements
from studies.fabrication import loaded_clearance as clearance


def gap_of(design, forces=None, base=Base()):
    return clearance.least_gap(design, plan(design, base), hall_elements.bodies(design), forces)


def test_a_beam_that_hardly_moves_keeps_the_gap_of_its_rest():
    """S2 and S3 of the paper's sensor stand 0.5 mm from the skin; at rest their corners are no nearer."""
    gap = gap_of(paper(), (0.01, 0.0))
    assert gap.value == pytest.approx(0.5, abs=0.02)
    assert gap.obstacle in ("S2", "S3")
    assert clearance.warning(gap) == []


def test_the_deepest_usual_load_presses_the_beam_into_its_elements():
    """Checked by hand: at 3 mm with 1 mm of shear the skin of the paper's beam bulges from 4 to some 4.97 mm."""
    gap = gap_of(paper())
    assert gap.value == pytest.approx(4.5 - 4.97, abs=0.03)
    (said,) = clearance.warning(gap)
    assert said.startswith(
        "under a press of 3 mm with a shear of 1 mm towards it the beam reaches 0.47 +-0.1 mm into S"
    )
    assert "lower c or raise f" in said


def test_screws_beside_the_beam_have_heads():
    """A square base of a chip has only screws beside the beam, which stand on the diagonals."""
    design = dataclasses.replace(paper(), hall_layout="tle493d-p2b6", l0=6.4, c=0.0)
    found = clearance.obstacles(design, plan(design, Base()), hall_elements.bodies(design))
    assert set(found) == {f"the head of screw {k}" for k in (1, 2, 3, 4)}
    assert {block.sides for block in found.values()} == {(4.0, 4.0, 1.6)}
    assert gap_of(design, (0.01, 0.0), Base(shape="round")) is None


@pytest.mark.parametrize(
    ("value", "said"), [(0.2, None), (0.05, "may touch S2"), (-0.05, "may touch S2"), (-0.2, "reaches 0.2")]
)
def test_a_gap_within_its_error_is_no_verdict(value, said):
    found = clearance.warning(clearance.Gap(value, 0.1, "S2", "a press"))
    assert (said in found[0]) if said else found == []


def test_the_gap_beside_an_unstable_beam_is_unknown():
    slender = dataclasses.replace(paper(), L=40.0, l0=38.2)
    gap = gap_of(slender, (20.0, 0.0))
    assert math.isnan(gap.value)
    assert math.isnan(gap.error)


def test_what_no_model_answers_is_unknown():
    gap = gap_of(paper(), (-1.0, 0.0))
    assert math.isnan(gap.value)
    (said,) = clearance.warning(gap)
    assert said.startswith("whether the beam touches what stands beside it under -1 N is not known: ")


def test_a_shear_is_turned_towards_the_obstacle():
    points = np.array([[1.0, 0.0, 2.0], [0.0, 1.0, 0.0]])
    assert clearance._turned(points, (0.0, 3.0)) == pytest.approx(np.array([[0.0, 1.0, 2.0], [-1.0, 0.0, 0.0]]))
