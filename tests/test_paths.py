"""Paths: increments of the load, presses and small shears about them, and what a path that stops has reached."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import ROUGH

from fem.accuracy import QUICK, STANDARD, longer_edges
from fem.analyses import small_shear
from fem.analyses.modes import modes
from fem.equilibrium import solve, trace
from fem.model import rigid_inclusion
from fem.model.symmetry_models import MeshSpecification
from fem.results.postprocess import read_pose
from fem.solve import load_increments, press
from fem.solve.active_set import KeptTangent
from fem.solve.load_increments import apply_increment, follow_segment
from fem.solve.newton import TOLERANCE, NoStateError
from fem.solve.path_state import at_rest
from geometry.design import BadInput, Design, paper
from geometry.loads import Load

SHAPE = paper().shape.without_magnet().scaled(1 / 8)


def section(harmonics=0):
    return MeshSpecification(SHAPE, 0.4998, "ignored", 0.25, 0.125, harmonics=harmonics).build()


@pytest.mark.parametrize("mu", [None, 0.3])
def test_an_increment_can_be_made_again_and_one_that_fails_leaves_the_state_before(mu):
    before = follow_segment(KeptTangent(), at_rest(section(), mu=mu), np.array([0.06, 0.0, 0.0])).state
    q, traction = before.q.copy(), before.friction and before.friction.traction.copy()
    once, again = (
        apply_increment(KeptTangent(), before, np.array([0.07, 0.0, 0.0]), TOLERANCE, accept=True) for _ in range(2)
    )
    assert once.stop == again.stop == ""
    np.testing.assert_array_equal(once.state.q, again.state.q)
    np.testing.assert_array_equal(before.q, q)
    if mu:
        np.testing.assert_array_equal(once.state.friction.traction, again.state.friction.traction)
        np.testing.assert_array_equal(before.friction.traction, traction)
    tried = apply_increment(KeptTangent(), before, np.array([2 * SHAPE.L, 0.0, 0.0]), TOLERANCE, accept=True)
    assert tried.stop
    assert tried.state.position is before.position


# Paths do not depend on the steps that they take; their predictor saves increments and changes no answer.


def test_a_press_does_not_depend_on_the_length_of_its_steps(monkeypatch):
    """On this mesh a folded element balances too, at a force lower by 2 %: a plain Newton method may end there."""
    sensor = Design(
        D=5.12, L=6.93, nu=0.49893, magnet_diameter=2.38, magnet_height=1.05, magnet_edge_radius=0.153, l0=6.93
    )
    loads = [Load(depth=depth) for depth in (0.07326, 0.2442, 0.6105)]
    forces = []
    for longest in (load_increments.LONGEST, 0.03):
        monkeypatch.setattr(load_increments, "LONGEST", longest)
        forces.append(trace(sensor, loads, QUICK, estimate=False)[-1].response.force[2])
    assert forces[0] == pytest.approx(forces[1], rel=1e-8)


STUCK = Load(depth=1.0, shear_x=1.0, friction="stick")


@pytest.mark.parametrize(
    ("before", "load"),
    [
        (Load(depth=1e-6), Load(depth=2.0)),
        (Load(depth=0.5), Load(depth=2.0)),
        (replace(STUCK, depth=1e-4, shear_x=0.0), STUCK),
        (Load(depth=1e-4, friction=0.3), Load(depth=0.5, friction=0.3)),
    ],
    ids=["a light touch", "half of it", "a glued shear", "friction"],
)
def test_a_state_does_not_depend_on_the_others_of_its_path(before, load):
    alone, company = (trace(paper(), way, ROUGH, estimate=False)[-1] for way in ([load], [before, load]))
    assert (alone.status, company.status) == ("ok", "ok")
    assert company.response.force == pytest.approx(alone.response.force, rel=1e-9)


def test_neither_order_nor_interruption_of_a_list_decides_its_states():
    """Above a wide flat magnet the skin creases beyond 1.95 mm, and the press has an onset and several branches."""
    sensor = replace(paper(), L=6.4, magnet_diameter=6.4, magnet_height=0.8, magnet_edge_radius=0.2)
    rough = replace(QUICK, section_size=0.25)

    def press(*depths):
        return trace(sensor, [Load(depth=depth) for depth in depths], rough, estimate=False)

    alone = {depth: press(depth)[0] for depth in (0.9, 1.8, 1.9, 2.05, 2.2)}
    assert [state.facts.onset for state in alone.values()] == [None, None, None, None, "depth"]
    mixed = np.random.default_rng(1).permutation([*alone]).tolist()
    for depths in ([*alone], mixed, mixed[2:]):
        for found in press(*depths):
            one = alone[found.load.depth]
            assert (found.status, found.facts.onset_mm, found.message) == (
                one.status,
                one.facts.onset_mm,
                one.message,
            )
            assert found.response.force == pytest.approx(one.response.force, rel=1e-8)


def test_a_press_that_crushes_silicone_is_no_state_to_analyse(monkeypatch):
    """With a bound that every deformation breaks; the true one lets 5 mm pass and not 6.5 mm."""
    monkeypatch.setattr(press, "FOLDED", 1.0)
    with pytest.raises(NoStateError, match=r"crushes silicone to [0-9.]+ % of its volume"):
        modes(paper(), depth=1.0, accuracy=QUICK, estimate=False)


# Small shear of a glued plate about a press.


@pytest.mark.parametrize("magnet", ["rigid", "ignored"])
def test_small_shear_is_the_start_of_a_finite_one(magnet):
    level = replace(QUICK, section_size=0.1, section_patch=0.01)
    small = small_shear.small_shear(paper(), 1.0, magnet, accuracy=level)
    way = 0.01
    state = trace(paper(), [Load(depth=1.0, shear_x=way, friction="stick")], level, magnet=magnet, estimate=False)[0]
    force, shift, tilt = state.response.force[0], state.response.shift[0], state.response.tilt
    np.testing.assert_allclose((shift / way, tilt / way), (small.shift, small.tilt), rtol=0.01)
    assert force / way == pytest.approx(small.stiffness, rel=0.01)


@pytest.mark.parametrize("depth", [0.0, -1.0, 50.0])
def test_depths_that_mean_nothing(depth):
    with pytest.raises(BadInput, match="depth"):
        small_shear.small_shear(paper(), depth)


def test_estimates_of_a_small_shear_hold_against_a_finer_mesh():
    finer = replace(STANDARD, section_size=0.035, section_patch=0.001)
    small, true = (small_shear.small_shear(paper(), 1.0, accuracy=level) for level in (QUICK, finer))
    for name in ("stiffness", "shift", "tilt"):
        error = abs(getattr(small, name) / getattr(true, name) - 1)
        assert error <= getattr(small.estimates, name) < 0.03


@pytest.mark.parametrize("model", ["full", "half", "harmonic"])
def test_a_body_that_turns_tilts_by_that_angle(model):
    shape = paper().shape.scaled(1 / 8)
    motion = np.array([0.1, -0.2, 0.3])
    if model == "harmonic":
        d = MeshSpecification(shape, 0.4998, "ignored", 0.16, 0.16, harmonics=2).build()
        u = rigid_inclusion.of_section(d.elements.nodes - [0, shape.H], d.elements.angles).displacement(motion)
    else:
        d = MeshSpecification(shape, 0.4998, "ignored", 0.3, 0.3, body="half" if model == "half" else "full").build()
        u = rigid_inclusion.of_solid(d.elements.nodes - [0, 0, shape.H], 3).displacement(motion)
    shift, tilt = read_pose(d, u, np.zeros(d.system.size))
    np.testing.assert_allclose(shift, [0.1, 0, -0.2], atol=1e-12)
    np.testing.assert_allclose(tilt, [0.3, 0], atol=1e-11)


def test_a_shear_that_a_stopped_press_never_began_is_not_in_its_load(monkeypatch):
    """The plate is glued after the press: a press that stops leaves the tip where the shear is 0."""
    real = load_increments.find_equilibrium

    def stubborn(tangent, state, guess, plate, *more, **options):
        answer = real(tangent, state, guess, plate, *more, **options)
        return answer if plate.height is None or plate.height > 1.1 else replace(answer, reason="no_convergence")

    monkeypatch.setattr(load_increments, "find_equilibrium", stubborn)
    load = Load(depth=1.0, shear_x=0.5, friction="stick")
    (state,) = trace(paper(), [load], QUICK, magnet="ignored", estimate=False)
    assert (state.status, state.load.shear_x) == ("not_converged", 0.0)
    assert "shear" not in state.message.partition(":")[0]


def test_a_small_shear_beyond_the_guided_critical_depth_is_unstable(monkeypatch):
    """Its stiffness may be positive again; where two meshes disagree nothing is known."""
    long = replace(paper(), L=32.0)
    stable, beyond = (small_shear.small_shear(long, depth, accuracy=QUICK, estimate=False) for depth in (3.7, 9.9))
    assert (stable.status, beyond.status) == ("ok", "unstable")
    assert beyond.stiffness > 0 > stable.stiffness
    found = {QUICK: stable, longer_edges(QUICK): beyond}
    monkeypatch.setattr(small_shear, "_solve_small_shear", lambda scene, edge: found[scene.accuracy])
    assert small_shear.small_shear(long, 3.7, accuracy=QUICK).status == "unknown"


def test_a_press_of_a_model_with_harmonics_follows_its_predictor_up_to_the_onset():
    """Just beyond the onset both models halved the same increments: 67 iterations in all."""
    load = Load(depth=0.88)
    beyond, straight = (
        solve(replace(paper(), L=24.0, l0=21.2), load, QUICK, model=model) for model in ("harmonic", "axisymmetric")
    )
    assert (beyond.status, beyond.facts.stability.directions) == ("unstable", 1)
    assert beyond.energy == pytest.approx(straight.energy, rel=1e-4)
    assert beyond.newton_iterations < 50
