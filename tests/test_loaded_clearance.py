"""Gaps of a loaded beam to Hall elements, posts and screws beside it."""

import dataclasses
import math

import numpy as np
import pytest

from geometry.base import Base, plan
from geometry.design import paper
from geometry.fabrication import hall_elements
from studies.mechanics import store as stores
from studies.mechanics import store_check
from studies.simulation import loaded_clearance as clearance


@pytest.fixture(scope="module", name="store")
def _store(tmp_path_factory):
    with stores.opened(tmp_path_factory.mktemp("skins") / "states.sqlite") as store:
        yield store


def gap_of(design, store, forces=None, base=Base(), **options):
    return clearance.least_gap(design, plan(design, base), store, forces, **options)


def test_a_beam_that_hardly_moves_keeps_the_gap_of_its_rest(store):
    """S2 and S3 of the paper's sensor stand 0.5 mm from the skin; at rest their corners are no nearer."""
    gap = gap_of(paper(), store, (0.01, 0.0))
    assert gap.value == pytest.approx(0.5, abs=0.02)
    assert gap.obstacle in ("S2", "S3")
    assert clearance.warning(gap) == []


def test_the_deepest_usual_load_presses_the_beam_into_its_elements(store):
    """Checked by hand: at 3 mm with 1 mm of shear the skin of the paper's beam bulges from 4 to some 4.97 mm."""
    gap = gap_of(paper(), store)
    assert gap.value == pytest.approx(4.5 - 4.97, abs=0.03)
    (said,) = clearance.warning(gap)
    assert said.startswith(
        "under a press of 3 mm with a shear of 1 mm towards it the beam reaches 0.47 +-0.1 mm into S"
    )
    assert "lower c or raise f" in said


def test_screws_beside_the_beam_have_heads(store):
    """A square base of a chip has only screws beside the beam, which stand on the diagonals."""
    design = dataclasses.replace(paper(), hall_layout="tle493d-p2b6", l0=6.4, c=0.0)
    found = clearance.obstacles(design, plan(design, Base()))
    assert set(found) == {f"the head of screw {k}" for k in (1, 2, 3, 4)}
    assert {block.sides for block in found.values()} == {(4.0, 4.0, 1.6)}
    assert gap_of(design, store, (0.01, 0.0), Base(shape="round")) is None


@pytest.mark.parametrize(
    ("value", "said"), [(0.2, None), (0.05, "may touch S2"), (-0.05, "may touch S2"), (-0.2, "reaches 0.2")]
)
def test_a_gap_within_its_error_is_no_verdict(value, said):
    found = clearance.warning(clearance.Gap(value, 0.1, "a press", "S2"))
    assert (said in found[0]) if said else found == []


def test_the_gap_beside_an_unstable_beam_is_unknown(store):
    slender = dataclasses.replace(paper(), L=40.0, l0=38.2)
    gap = gap_of(slender, store, (20.0, 0.0))
    assert math.isnan(gap.value)
    assert math.isnan(gap.error)


def test_what_no_model_answers_is_unknown(store):
    gap = gap_of(paper(), store, (-1.0, 0.0))
    assert math.isnan(gap.value)
    (said,) = clearance.warning(gap)
    assert said.startswith("whether the beam touches what stands beside it under -1 N is not known: ")


def test_a_shear_is_turned_towards_the_obstacle():
    points = np.array([[1.0, 0.0, 2.0], [0.0, 1.0, 0.0]])
    assert clearance._turned(points, (0.0, 3.0)) == pytest.approx(np.array([[0.0, 1.0, 2.0], [-1.0, 0.0, 0.0]]))


def test_a_stored_skin_answers_for_other_places_of_the_elements(store):
    """Elements beside the skin gain as much room as they are moved; another beam is another skin."""
    gap_of(paper(), store)
    near, far = (gap_of(dataclasses.replace(paper(), f=f), store, solve=False) for f in (6.0, 6.5))
    assert far.value - near.value == pytest.approx(0.5, abs=0.01)
    (said,) = clearance.room(far)
    words = "Under a press of 3 mm with a shear of 1 mm the beam keeps"
    assert said.startswith(f"{words} {far.value:.2g} +-0.1 mm of room to {far.obstacle}, by finite elements")
    assert gap_of(dataclasses.replace(paper(), L=9.5), store, solve=False).why == clearance.UNSOLVED


def test_design_says_the_gap_that_is_stored_and_how_to_solve_for_another(run, strict, store, monkeypatch):
    found = gap_of(paper(), store)
    monkeypatch.setenv(stores.VARIABLE, str(store.file))
    (record,) = strict(run("design", "paper", "--json")[1])
    assert record["derived"]["loaded_gap_mm"] == pytest.approx(found.value)
    assert record["derived"]["loaded_gap_error_mm"] == pytest.approx(found.error)
    assert clearance.warning(found)[0] in record["warnings"]
    words = "under a press of 3 mm with a shear of 1 mm is not solved yet: add --loaded."
    assert words in " ".join(run("design", "paper", "--set", "nu=0.49")[1].split())


def test_a_check_of_the_store_solves_no_skin_again(store):
    gap_of(paper(), store)
    assert [row["status"] for row in store_check.checks(store.file, 5, 0)] == 6 * ["ok"]


def test_boxes_of_elements_are_those_of_their_solids():
    for design in (paper(), dataclasses.replace(paper(), hall_layout="tle493d-p2b6", l0=6.4, c=0.0)):
        boxes = hall_elements.boxes(design)
        for name, solid in hall_elements.bodies(design).items():
            low, high = (tuple(corner) for corner in (solid.bounding_box().min, solid.bounding_box().max))
            assert boxes[name].corner == pytest.approx(low, abs=1e-6)
            assert np.add(boxes[name].corner, boxes[name].sides) == pytest.approx(high, abs=1e-6)
