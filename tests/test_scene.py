"""A scene: what it refuses when it is made, which model it chooses, and what it is without dimensions."""

import json
import math
from dataclasses import replace

import pytest

from fem.accuracy import FINE, QUICK, coarser
from fem.equilibrium import trace, walk
from fem.scene import Scene, choose_model
from geometry.design import BadInput, Design, paper
from geometry.loads import Load

SHEAR = Load(depth=1.0, shear_x=1.0, friction="stick")


@pytest.mark.parametrize(
    ("loads", "model", "text"),
    [
        ([Load(depth=7.0)], "auto", "silicone"),
        ([Load(depth=1, shear_x=1, friction="stick")], "axisymmetric", "shear"),
        ([Load(depth=1, plate_tilt=0.1)], "axisymmetric", "tilted"),
        ([Load(depth=1, plate_tilt=0.1, shear_y=0.1, friction="stick")], "half", "one plane"),
        ([Load(depth=1)], "solid", "model must be"),
        ([Load(shear_x=1, friction="stick")], "auto", "in contact"),
        ([Load(depth=1, shear_x=1, friction="stick"), Load(depth=2, friction="stick")], "auto", "has stuck"),
        ([], "auto", "at least one"),
    ],
)
def test_loads_that_cannot_be_answered(loads, model, text):
    with pytest.raises(BadInput, match=text):
        Scene(paper(), tuple(loads), QUICK, model=model)


def test_a_scene_with_a_rigid_magnet_needs_one():
    bare = Design(magnet_diameter=0, magnet_height=0, magnet_edge_radius=0)
    with pytest.raises(BadInput, match="no magnet"):
        Scene(bare, (Load(depth=1.0),))
    assert Scene(bare, (Load(depth=1.0),), magnet="ignored").model == "axisymmetric"


def test_a_grip_that_the_mesh_would_miss_is_refused():
    with pytest.raises(BadInput, match="grip must be at least"):
        Scene(paper(), (Load(grip=1e-3, shear_x=0.1),), QUICK, model="half")
    with pytest.raises(BadInput, match=r"grip must be at least D/10000 = 0\.0008 mm; got 1e-09 mm"):
        Scene(paper(), (Load(grip=1e-9, shear_x=1.0),), QUICK)


def test_a_grip_that_only_the_companions_mesh_would_miss_is_solved_without_estimates():
    """2 (2 * 0.03)^2 D^2 / R / 4 = 0.0288 mm on the mesh itself, 2.25 times that on one coarser by 1.5."""
    scene = Scene(paper(), (Load(grip=0.04, shear_x=0.1),), QUICK, model="half")
    assert scene.coarser() is None
    assert replace(scene, loads=(Load(grip=0.07, shear_x=0.1),)).coarser() is not None
    (state,) = walk(replace(scene, accuracy=replace(QUICK, solid_size=0.4)))
    assert (state.status, state.estimates.force) == ("ok", None)


def test_the_first_solve_waits_for_the_first_state_but_bad_loads_do_not():
    with pytest.raises(BadInput, match="has stuck"):
        walk(Scene(paper(), (SHEAR, replace(SHEAR, depth=2.0)), QUICK))
    walk(Scene(paper(), (SHEAR,), QUICK))


def test_the_conveniences_make_the_same_checks():
    with pytest.raises(BadInput, match="at least one"):
        trace(paper(), [], QUICK)


@pytest.mark.parametrize(
    ("loads", "model"),
    [
        ((Load(depth=1.0),), "axisymmetric"),
        ((Load(depth=1.0), SHEAR), "harmonic"),
        ((Load(depth=1.0, imperfection=1e-3),), "harmonic"),
        ((Load(depth=1.0, plate_tilt=0.1),), "harmonic"),
        ((SHEAR, replace(SHEAR, shear_y=1.0)), "harmonic"),
        ((replace(SHEAR, plate_tilt=0.1, shear_y=1.0),), "harmonic"),
    ],
)
def test_the_smallest_model_is_chosen(loads, model):
    loads = tuple(replace(load, friction=loads[-1].friction) for load in loads)
    assert Scene(paper(), loads).model == model == choose_model(loads, "auto")


@pytest.mark.parametrize(
    ("loads", "direction"),
    [
        ((replace(SHEAR, shear_x=0.6, shear_y=0.8),), (0.6, 0.8)),
        ((replace(SHEAR, shear_x=0.6, shear_y=0.8, plate_tilt=0.1),), None),
        ((replace(SHEAR, plate_tilt=0.1),), (1.0, 0.0)),
        ((SHEAR, replace(SHEAR, shear_y=1.0)), None),
        ((replace(SHEAR, shear_x=0.0, shear_y=1.0, imperfection=1e-3),), None),
    ],
)
def test_loads_without_a_plane_of_symmetry_need_the_users_axes(loads, direction):
    scene = Scene(paper(), tuple(replace(load, imperfection=loads[0].imperfection) for load in loads))
    assert scene.turns is (direction is None)
    assert scene.direction == pytest.approx(direction or (1.0, 0.0))


def test_parts_and_companions_of_a_scene_keep_its_model():
    pressed = replace(SHEAR, shear_x=0.0)
    scene = Scene(paper(), (pressed, SHEAR), QUICK)
    part = replace(scene, loads=(pressed,))
    assert part.model == "harmonic"
    assert part.sheared is None
    assert replace(scene, accuracy=coarser(QUICK)).model == "harmonic"


def test_loads_in_a_list_become_a_tuple():
    assert Scene(paper(), [SHEAR]).loads == (SHEAR,)


def test_lengths_are_over_the_diameter_and_forces_over_E_D2():
    design = Design(E=2.0)
    scene = Scene(design, (Load(grip=2.0, shear_x=1.0),))
    assert scene.grip == 0.25
    assert (scene.shape.D, scene.shape.L) == (1.0, 1.125)
    assert Scene(design, (Load(depth=1.0, imperfection=0.064),)).push == pytest.approx(0.064 / 128)


def test_the_direction_is_that_of_the_first_shear_but_x_for_tetrahedra_of_the_whole():
    loads = (Load(depth=1.0, friction="stick"), replace(SHEAR, shear_x=-3.0, shear_y=4.0))
    assert Scene(paper(), loads).direction == (0.6, -0.8)
    assert Scene(paper(), loads, model="full").direction == (1.0, 0.0)


def similar(design, E, factor):
    """A design of another modulus, `factor` times as large."""
    names = ("D", "L", "magnet_diameter", "magnet_height", "magnet_edge_radius", "l0")
    return replace(design, E=E, **{name: factor * getattr(design, name) for name in names})


@pytest.mark.parametrize(("E", "factor"), [(1.0, 1.0), (0.3, 1.0), (1.0, 1.3), (7.0, 0.37)])
def test_designs_that_differ_in_E_f_and_scale_are_one_dimensionless_problem(E, factor):
    load = Load(depth=1.0, shear_y=0.3, friction="stick", imperfection=1e-3)
    other = replace(
        load,
        depth=factor * load.depth,
        shear_y=factor * load.shear_y,
        imperfection=E / paper().E * factor**2 * load.imperfection,
    )
    one = Scene(paper(), (load,), QUICK, model="full")
    two = Scene(
        replace(similar(paper(), E, factor), f=2 * paper().f, magnet_north="up"), (other,), QUICK, model="full"
    )
    assert one.dimensionless() == two.dimensionless()
    assert json.loads(json.dumps(one.dimensionless())) == one.dimensionless()


@pytest.mark.parametrize(
    "changed",
    [
        {"design": Design(nu=0.45)},
        {"design": Design(L=13.0)},
        {"design": Design(magnet_height=1.0)},
        {"design": Design(law="yeoh", yeoh_2=0.3)},
        {"loads": (Load(depth=1.1),)},
        {"loads": (Load(depth=1.0, friction=0.3),)},
        {"loads": (Load(depth=1.0, plate_tilt=math.radians(1)),)},
        {"accuracy": FINE},
        {"magnet": "ignored"},
    ],
    ids=lambda changed: ",".join(changed),
)
def test_what_changes_an_answer_changes_the_dimensionless_problem(changed):
    values = {"design": paper(), "loads": (Load(depth=1.0),), "accuracy": QUICK, "magnet": "rigid"}
    assert Scene(**values).dimensionless() != Scene(**values | changed).dimensionless()


def test_a_magnet_that_is_ignored_is_no_part_of_the_dimensionless_problem():
    one, other = (
        Scene(design, (Load(depth=1.0),), QUICK, "ignored") for design in (paper(), Design(magnet_height=1.0))
    )
    assert one.dimensionless() == other.dimensionless()
