"""Which models each kind of load case is followed with."""

from dataclasses import replace

import pytest

from fem.accuracy import QUICK, STANDARD
from fem.model.symmetry_models import specification
from fem.scene import Scene
from fem.solve import load_case_models
from fem.solve.load_case_models import PRESS_FILLET, path_models
from geometry.design import paper
from geometry.loads import Load


def scene(*loads, accuracy=QUICK, model="auto"):
    return Scene(paper(), loads, accuracy, model=model)


@pytest.fixture
def end_at(monkeypatch):
    """Contacts end at 0.2 D, without a press that finds it."""
    monkeypatch.setattr(load_case_models, "find_press", lambda section, edge_length, depth: (0.2, None))


def test_a_press_begins_axisymmetric_with_one_harmonic_at_hand():
    models = path_models(scene(Load(depth=1.0)))
    assert (models.first.harmonics, models.first.fillet) == (0, PRESS_FILLET)
    assert models.raised == replace(models.first, harmonics=1)
    assert (models.predictor, models.glued_radius) == (None, None)


def test_an_imperfect_press_begins_with_all_harmonics():
    models = path_models(scene(Load(depth=1.0, imperfection=1e-3), accuracy=STANDARD))
    assert models.first.harmonics == STANDARD.harmonics
    assert models.first.push == pytest.approx(1e-3 / (paper().E * 64))
    assert models.raised is None
    assert models.predictor == replace(models.first, harmonics=1, skin_harmonics=STANDARD.harmonics)


def test_the_lightest_touch_of_a_path_grades_its_tip():
    light, deep = (path_models(scene(Load(depth=d), Load(depth=1.0))).first for d in (0.01, 0.5))
    assert light.tip_size < deep.tip_size < deep.size


def test_a_plate_that_sticks_is_glued_where_the_contact_ends(end_at):
    models = path_models(scene(Load(depth=1.0, shear_x=1.0, friction="stick"), accuracy=STANDARD))
    assert models.glued_radius == 0.2
    assert models.first.rim == (0.2, STANDARD.section_patch)
    assert models.raised == replace(models.first, harmonics=STANDARD.harmonics)
    assert models.predictor == replace(models.first, harmonics=1, skin_harmonics=STANDARD.harmonics)


def test_a_single_harmonic_needs_no_predictor(end_at):
    load = Load(depth=1.0, shear_x=1.0, friction="stick")
    assert path_models(scene(load, accuracy=replace(QUICK, harmonics=1))).predictor is None


def test_a_plate_that_sticks_to_a_leaning_tip_is_glued_where_it_is_found(end_at):
    models = path_models(scene(Load(depth=1.0, shear_x=1.0, friction="stick", imperfection=1e-3)))
    assert (models.raised, models.glued_radius) == (None, None)
    assert models.first.rim is not None


@pytest.mark.parametrize(("height", "radius"), [(1.0, 7**0.5 / 8), (4.0, 0.5), (6.0, 0.5)])
def test_a_gripped_section_is_fine_where_the_grip_ends(height, radius):
    models = path_models(scene(Load(grip=height, shear_x=1.0)))
    assert models.first.rim == pytest.approx((radius, QUICK.section_patch))
    assert models.first.harmonics == QUICK.harmonics


def test_a_grip_has_no_plate_to_rub_on():
    load = Load(grip=1.0, shear_x=1.0)
    assert path_models(scene(replace(load, friction=0.3))) == path_models(scene(load))


def test_a_rubbing_plate_has_no_predictor():
    models = path_models(scene(Load(depth=1.0, shear_x=1.0, friction=0.3)))
    assert models.raised == replace(models.first, harmonics=QUICK.harmonics)
    assert (models.first.rim, models.predictor) == (None, None)


@pytest.mark.parametrize(
    ("load", "tip_size"),
    [
        (Load(depth=1.0), QUICK.solid_size / 2),
        (Load(depth=1.0, plate_tilt=0.1), QUICK.solid_patch),
        (Load(depth=1.0, shear_x=1.0, friction=0.3), QUICK.solid_patch),
        (Load(grip=4.0, shear_x=1.0), QUICK.solid_patch),
    ],
)
def test_tetrahedra_are_fine_at_the_tip_where_no_patch_ends(load, tip_size):
    models = path_models(scene(load, model="half"))
    assert (models.first.body, models.first.rim, models.first.tip_size) == ("half", None, tip_size)


def test_tetrahedra_are_fine_where_a_patch_ends(end_at):
    models = path_models(scene(Load(depth=1.0, shear_x=1.0, friction="stick"), model="full"))
    assert models.first.body == "full"
    assert models.first.rim == pytest.approx((0.2, QUICK.solid_patch))
    assert models.glued_radius == 0.2


def test_a_specification_builds_the_model_that_it_describes():
    section = specification(scene(Load(depth=1.0)), 0.2, 0.1)
    low, high = section.build(), replace(section, harmonics=2).build()
    assert (low.model, high.model) == ("axisymmetric", "harmonic")
    assert low.mesh is high.mesh
    assert low.shape == section.shape
