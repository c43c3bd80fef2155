"""Loading cycles as a quantity of sweeps: keys of similar designs, answers, and what is refused."""

from dataclasses import replace

import pytest
from stores import temporary

from analytic.relaxation_loops import loop
from fem.accuracy import QUICK
from fem.physics_version import PHYSICS
from fem.scene import Scene
from geometry.design import BadInput, paper
from geometry.loads import Load
from geometry.relaxation import relaxation_of
from studies.inputs.study_axes import Factor
from studies.mechanics.path_keys import place
from studies.mechanics.plate_motion import PlateMotion
from studies.mechanics.solve_plan import Processes
from studies.mechanics.study_cases import FemModel, Plan
from studies.sweeps import sweep
from studies.sweeps.study_rows import flat_rows

BRANCHES = replace(paper(), prony="0.1:0.05 0.1:0.5 0:1e-3 0:1e3", modulus="instantaneous")


def content_of(design, load, motion):
    """What the answer to a cycle depends on."""
    return place(Scene(design, (load,), QUICK, "rigid"), "cycle", motion).content


def test_similar_designs_with_the_same_product_of_time_and_rate_share_a_cycle():
    load = Load(0.5, 0.3, 0.4, friction="stick")
    slow = replace(BRANCHES, prony="0.1:0.5 0.1:5 0:1e-3 0:1e3")
    assert content_of(BRANCHES, load, PlateMotion(speed=1.0)) == content_of(slow, load, PlateMotion(speed=0.1))
    stiff = replace(BRANCHES, E=3.0, density=900.0)
    assert content_of(BRANCHES, load, PlateMotion(2.0)) == content_of(stiff, load, PlateMotion(2.0))
    assert content_of(BRANCHES, load, PlateMotion(2.0)) != content_of(slow, load, PlateMotion(2.0))
    assert content_of(BRANCHES, load, PlateMotion(2.0)) != content_of(BRANCHES, load, PlateMotion(None, 2.0))
    relaxed = replace(BRANCHES, modulus="long-term")
    assert content_of(BRANCHES, load, PlateMotion(2.0)) != content_of(relaxed, load, PlateMotion(2.0))


def test_a_sweep_has_the_loops_of_a_cycle():
    """The sine's gap is near that of a linear spring, and E scales forces and areas; one path serves both."""
    points = (Factor(("E",), ((1.0, 3.0),)),)
    load = {"depth": 0.5, "frequency": 2.0}
    plan = Plan(BRANCHES, points, load, "rigid", (FemModel("quick", QUICK),), (), ("force", "cycle"))
    with temporary() as kept:
        soft, hard = (row for t in sweep.run(plan, None, kept, processes=Processes(0)) for row in flat_rows(t))
        assert kept.counts() == (2, 2), "the static path and the cycles"
    linear = 100 * loop(relaxation_of(BRANCHES), 2.0, "sine").hysteresis
    assert PHYSICS["cycle"] == 3, "write the answer of the new version here"
    assert soft["loop_gap_percent"] == pytest.approx(linear, rel=0.3)
    assert soft["frequency_Hz"] == 2.0
    assert 0.8 * soft["fem_force_N"] < soft["loop_largest_force_N"] < soft["fem_force_N"]
    for name in ("loop_area_mJ", "loop_largest_force_N"):
        assert hard[name] == pytest.approx(3 * soft[name], rel=1e-9)


@pytest.mark.parametrize(
    ("load", "motion", "part"),
    [
        (Load(depth=0.5), PlateMotion(), "needs a rate"),
        (Load(depth=0.5), PlateMotion(frequency=1e6), "speak for"),
        (Load(depth=0.5, plate_tilt=0.1), PlateMotion(1.0), "upright plate"),
        (Load(shear_x=0.5, grip=1.0), PlateMotion(1.0), "upright plate"),
    ],
)
def test_what_makes_no_cycle_is_refused(load, motion, part):
    with pytest.raises(BadInput, match=part):
        content_of(BRANCHES, load, motion)
