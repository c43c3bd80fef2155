"""Vibrations and loading cycles as quantities of sweeps: keys of similar designs, answers, and what is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest
from stores import temporary

from analytic.relaxation_loops import loop
from fem.accuracy import QUICK
from fem.analyses.vibration import vibrating_sensor
from fem.physics_version import PHYSICS
from fem.scene import Scene
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from geometry.relaxation import relaxation_of
from studies.inputs.study_input import Factor, grid
from studies.mechanics import path_solver, store, store_check
from studies.mechanics.path_solver import place
from studies.mechanics.solve_plan import Processes
from studies.mechanics.study_cases import FemModel, Plan
from studies.mechanics.timed_quantities import PlateMotion
from studies.sweeps import sweep
from studies.sweeps.study_rows import flat_rows

ROUGH = replace(QUICK, name="rough", section_size=0.25, section_patch=0.03, harmonics=1)
LOSSY = replace(paper(), loss_high=2500.0)


def run(design, axes, load, kept, quantities=("response",), accuracy=ROUGH):
    """The flat rows of a sweep."""
    factors = axes if isinstance(axes, tuple) else grid(axes)
    plan = Plan(design, factors, load, "rigid", (FemModel("rough", accuracy),), (), quantities)
    return [row for table in sweep.run(plan, None, kept, processes=Processes(0)) for row in flat_rows(table)]


def gain_of(load, motion, at):
    """The magnet's shift along a motion over the force, over that at 1 Hz, as a complex number, without splines."""
    shaken = vibrating_sensor(LOSSY, load, (1.0, at), ROUGH).at([1.0, at])
    k, along = shaken.motions.index(motion), ("x", "z").index(motion)
    slow, fast = shaken.shift[:, k, along] / shaken.force[:, k, along]
    return fast / abs(slow) * np.sign(slow.real)


def test_gain_and_phase_are_those_of_the_vibration():
    with temporary() as kept:
        first, _, last = run(
            LOSSY, {"frequency": [600.0, 800.0, 1450.0]}, {"depth": 0.5}, kept, ("force", "response")
        )
        assert kept.counts() == (2, 2), "one static path, and one vibration for all frequencies"
    for row, frequency in ((first, 600.0), (last, 1450.0)):
        gain = gain_of(Load(depth=0.5), "z", frequency)
        assert row["response_gain"] == pytest.approx(abs(gain), rel=2e-4)
        assert row["response_phase_deg"] == pytest.approx(np.degrees(np.angle(gain)), abs=0.02)
    assert first["status"] == "ok"
    # the loss factor of 0.1 makes a resonance of Q = 10
    assert first["response_Q"] == pytest.approx(10, rel=0.1)
    assert np.isnan(first["response_bandwidth_Hz"]), "the mesh carries no frequency with a gain 3 dB lower"


def test_a_stored_vibration_is_solved_again_to_the_same_numbers():
    content = place(Scene(LOSSY, (Load(depth=0.5),), ROUGH, "rigid"), "response").content
    task = path_solver.Task(1, Scene(LOSSY, (Load(depth=0.5),), ROUGH, "rigid"), "response")
    (state,) = path_solver.solve_task(task)
    stored = json.loads(json.dumps(state.answer, sort_keys=True))
    assert store_check._difference(store.key(content), content, replace(state, answer=stored)) == ""


def test_similar_designs_share_a_vibration_that_scales():
    """Half the size, four times the modulus and half the density: frequencies are 2 (4 / 0.5)^(1/2) times as high."""
    sizes = ("magnet_diameter", "magnet_height", "magnet_edge_radius")
    names = ("D", "L", *sizes, "l0", "f", "density", "magnet_density")
    small = [getattr(paper(), name) * 0.5 for name in names]
    values = tuple(zip((*(getattr(paper(), name) for name in names), 1.0, 0.5), (*small, 4.0, 0.25), strict=True))
    points = (Factor((*names, "E", "depth"), values),)
    with temporary() as kept:
        one, other = run(replace(paper(), loss_factor=0.0), points, {}, kept)
        assert kept.counts() == (2, 2), "the static path and the vibration"
    scale = 2 * (4 / 0.5) ** 0.5
    assert other["response_resonance_Hz"] == pytest.approx(scale * one["response_resonance_Hz"], rel=1e-9)


def test_fields_of_time_leave_static_quantities_alone():
    axes = {"loss_factor": [0.0, 0.1, 0.2], "modulus": ["long-term", "instantaneous"]}
    with temporary() as kept:
        rows = run(paper(), axes, {"depth": 0.5}, kept, ("force",))
        assert kept.counts() == (1, 1)
    assert len({row["fem_force_N"] for row in rows}) == 1


def test_the_loss_factor_and_the_modulus_at_rest_change_the_vibration():
    axes = {"loss_factor": [0.1, 0.2], "modulus": ["long-term", "instantaneous"]}
    with temporary() as kept:
        rows = run(LOSSY, axes, {"depth": 0.5}, kept)
    assert [row["response_Q"] > 7 for row in rows] == [True, True, False, False]
    assert rows[1]["response_resonance_Hz"] < rows[0]["response_resonance_Hz"]
    # the larger loss factor stiffens the silicone by half between 1 Hz and the resonance
    assert 10 < rows[2]["response_bandwidth_Hz"] < 200


@pytest.mark.parametrize(
    ("load", "frequency", "part"),
    [
        (Load(depth=0.5), 5000.0, "known from 1 to"),
        (Load(depth=0.5), 0.5, "got 0.5 Hz: take 1 Hz or more"),
        (Load(depth=0.5, plate_tilt=0.1), None, "needs an upright plate"),
        (Load(depth=0.5, friction=0.3), None, "needs an upright plate"),
    ],
)
def test_what_cannot_vibrate_is_refused(load, frequency, part):
    with pytest.raises(BadInput, match=part):
        place(Scene(Design(), (load,), ROUGH, "rigid"), "response", PlateMotion(frequency))


def test_a_shear_in_any_direction_is_solved_along_x():
    one, other = (
        place(Scene(paper(), (Load(0.5, x, y, friction="stick"),), ROUGH, "rigid"), "response")
        for x, y in ((0.5, 0.0), (0.3, -0.4))
    )
    assert one.content == other.content


# Cycles

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
    with temporary() as kept:
        soft, hard = run(
            BRANCHES, {"E": [1.0, 3.0]}, {"depth": 0.5, "frequency": 2.0}, kept, ("force", "cycle"), QUICK
        )
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
