"""A scene: what it refuses when it is made, which model it chooses, and what it is without dimensions."""

import json
import math
from dataclasses import replace

import pytest

from fem.accuracy import FINE, QUICK
from fem.equilibrium import trace, walk
from fem.scene import Scene, choose_model
from geometry.design import BadInput, Design, paper
from geometry.loads import Load, check_load

SHEAR = Load(depth=1.0, shear_x=1.0, friction="stick")


BARE = Design(magnet_diameter=0, magnet_height=0, magnet_edge_radius=0)


def scene(*loads, design=None, **options):
    return Scene(design or paper(), loads, QUICK, **options)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: scene(Load(depth=7.0)), "silicone"),
        (lambda: scene(SHEAR, model="axisymmetric"), "shear"),
        (lambda: scene(Load(depth=1, plate_tilt=0.1), model="axisymmetric"), "tilted"),
        (lambda: scene(replace(SHEAR, shear_x=0, shear_y=1, plate_tilt=0.1), model="half"), "one plane"),
        (lambda: scene(Load(depth=1), model="solid"), "model must be"),
        (lambda: scene(replace(SHEAR, depth=0)), "in contact"),
        (lambda: scene(SHEAR, Load(depth=2, friction="stick")), "has stuck"),
        (lambda: walk(scene(SHEAR, replace(SHEAR, depth=2.0))), "has stuck"),
        (lambda: scene(), "at least one"),
        (lambda: trace(paper(), [], QUICK), "at least one"),
        (lambda: scene(Load(depth=1.0), design=BARE), "no magnet"),
        (lambda: scene(Load(grip=1e-3, shear_x=0.1), model="half"), "grip must be at least"),
        (lambda: scene(Load(grip=1e-9, shear_x=1.0)), r"at least D/10000 = 0\.0008 mm; got 1e-09 mm"),
        (lambda: Load(imperfection=math.nan), "imperfection"),
        (lambda: Load(imperfection=1.0, friction=0.3), "imperfection"),
        (lambda: Load(imperfection=1.0, grip=1.0), "imperfection"),
        (
            lambda: check_load(paper(), Load(grip=1e-3, shear_x=1.0)),
            r"not exceed 0\.5.* mm under a grip of 0\.001 mm",
        ),
    ],
)
def test_loads_that_cannot_be_answered_are_refused(call, text):
    with pytest.raises(BadInput, match=text):
        call()


@pytest.mark.parametrize(("change", "bound"), [({}, 2.2), ({"E": 2.0}, 4.4), ({"L": 32.0}, 0.071)])
def test_a_force_that_bends_the_beam_by_its_radius_is_no_imperfection(change, bound):
    """Its bound scales with E and, for similar beams, with their area; a beam that is slender bends more easily."""
    design = replace(paper(), **change)
    check_load(design, Load(depth=1.0, imperfection=0.95 * bound))
    with pytest.raises(
        BadInput, match=r"^imperfection must lie within .* enough to select the direction of buckling$"
    ):
        check_load(design, Load(depth=1.0, imperfection=-1.05 * bound))


def test_a_grip_that_only_the_companions_mesh_would_miss_is_solved_without_estimates():
    """2 (2 * 0.03)^2 D^2 / R / 4 = 0.0288 mm on the mesh itself, 2.25 times that on one coarser by 1.5."""
    found = Scene(paper(), (Load(grip=0.04, shear_x=0.1),), QUICK, model="half")
    assert found.coarser() is None
    assert replace(found, loads=(Load(grip=0.07, shear_x=0.1),)).coarser() is not None
    (state,) = walk(replace(found, accuracy=replace(QUICK, solid_size=0.4)))
    assert (state.status, state.estimates.force) == ("ok", None)


@pytest.mark.parametrize(
    ("loads", "model", "direction"),
    [
        ((Load(depth=1.0),), "axisymmetric", (1.0, 0.0)),
        ((Load(depth=1.0, imperfection=1e-3),), "harmonic", (1.0, 0.0)),
        ((replace(SHEAR, shear_x=0.6, shear_y=0.8),), "harmonic", (0.6, 0.8)),
        ((Load(depth=1.0, friction="stick"), replace(SHEAR, shear_x=-3.0, shear_y=4.0)), "harmonic", (0.6, -0.8)),
        ((replace(SHEAR, plate_tilt=0.1),), "harmonic", (1.0, 0.0)),
        ((replace(SHEAR, shear_x=0.6, shear_y=0.8, plate_tilt=0.1),), "harmonic", None),
        ((SHEAR, replace(SHEAR, shear_y=1.0)), "harmonic", None),
        ((replace(SHEAR, shear_x=0.0, shear_y=1.0, imperfection=1e-3),), "harmonic", None),
    ],
)
def test_the_smallest_model_is_chosen_and_without_a_plane_of_symmetry_it_has_the_users_axes(loads, model, direction):
    found = Scene(paper(), loads)
    assert found.model == model == choose_model(loads, "auto")
    assert found.turns is (direction is None)
    assert found.direction == pytest.approx(direction or (1.0, 0.0))


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


def test_an_ignored_magnet_is_no_part_of_the_dimensionless_problem():
    one, other = (scene(Load(depth=1.0), design=design, magnet="ignored") for design in (paper(), BARE))
    assert one.dimensionless() == other.dimensionless()
