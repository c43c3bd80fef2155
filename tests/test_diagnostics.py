"""What is known of a state: facts and messages, the largest strain, and where the law of the silicone is lost."""

import functools
from dataclasses import replace

import numpy as np
import pytest
import skfem

from fem import equilibrium
from fem.accuracy import QUICK, STANDARD
from fem.equilibrium import solve, trace
from fem.model import elements
from fem.model.material import evaluate, law, ogden
from fem.model.symmetry_models import MeshSpecification
from fem.results import diagnostics, silicone_limits
from fem.results.lateral_stiffness import StabilityMargin
from fem.results.postprocess import read
from fem.results.silicone_limits import VOLUME_SHARE, largest_strain
from fem.scene import Scene
from fem.solution import STABLE, Facts, Stability
from fem.solve.load_case_models import path_models
from fem.solve.load_stepping import Path
from fem.solve.newton import STOPPED
from fem.solve.press import solve_press
from geometry.design import Design, paper
from geometry.loads import Load
from studies.simulation import state_rows

SCENE = Scene(paper(), (Load(depth=0.4),), QUICK, "ignored")


@pytest.fixture
def pressed():
    """The all-silicone beam on a coarse section, pressed by 0.4 mm."""
    section = MeshSpecification(paper().shape.without_magnet().scaled(1 / 8), 0.4998, "ignored", 0.25, 0.125)
    return solve_press(section, 0.05)[0]


def test_a_good_state_has_nothing_to_say_but_what_was_not_checked(pressed):
    unchecked = read(pressed, SCENE, SCENE.loads[0])
    assert (unchecked.status, unchecked.facts.verdict) == ("ok", "unknown")
    assert "would buckle sideways was not checked" in unchecked.message
    state = read(pressed, SCENE, SCENE.loads[0], margin=lambda state: StabilityMargin(0.9, None, STABLE))
    known = {
        "largest_strain": state.facts.largest_strain,
        "contact_pressure": state.facts.contact_pressure,
        "sideways_stiffness_ratio": 0.9,
        "crease_ratio": state.facts.crease_ratio,
    }
    assert (state.status, state.message, state.facts) == ("ok", "", Facts(stability=STABLE, **known))
    assert 1 < state.facts.crease_ratio < 1.2


def test_the_onset_is_a_fact_in_mm_and_a_sentence(pressed):
    unstable = replace(pressed, stability=Stability(2), onset=(np.array([0.025, 0, 0]), np.array([0.0375, 0, 0])))
    state = read(unstable, SCENE, SCENE.loads[0])
    assert (state.facts.onset, state.facts.onset_mm, state.facts.stability) == ("depth", (0.2, 0.3), Stability(2))
    assert state.status == "unstable"
    assert state.message.startswith("unstable since a depth between 0.2 and 0.3 mm (2 unstable directions)")
    row = state_rows.solved_row(paper(), "rigid", state)
    assert (row["onset_depth_from_mm"], row["onset_depth_to_mm"]) == (0.2, 0.3)
    assert row["onset_shear_from_mm"] is None
    # the skin has no creases here
    assert "it cannot be told whether the silicone or the mesh is unstable" in state.message
    sheared = replace(unstable, onset=(np.array([0.05, 0, 0]), np.array([0.05, -0.03, 0.04])))
    facts = read(sheared, SCENE, SCENE.loads[0]).facts
    assert (facts.onset, facts.onset_mm) == ("shear", pytest.approx((0.0, 0.4)))


@pytest.mark.parametrize(
    ("depth", "remark"),
    [(1.8, None), (2.6, "nearly_guided_only"), (2.87, "guided_doubtful"), (3.2, "guided_only")],
)
def test_a_press_says_how_near_it_is_to_giving_way_sideways(depth, remark):
    """The paper's sensor does so at 2.87 mm."""

    state = solve(paper(), Load(depth=depth))
    assert state.facts.remark == remark
    assert state.status == {"guided_only": "unstable", "guided_doubtful": "unknown"}.get(remark, "ok")
    if remark != "guided_doubtful":
        assert (state.facts.sideways_stiffness_ratio > 0) is (depth < 2.87)
    row = state_rows.solved_row(paper(), "rigid", state)
    assert row["critical_depth_mm_estimate"] == state.facts.critical_depth
    if remark is None:
        assert state.facts.sideways_stiffness_ratio > 0.4
    else:
        assert state.facts.critical_depth == pytest.approx(2.87, rel=0.07)
        assert (
            f"at a depth of about {state.facts.critical_depth:.3g} mm (+-10 %; now {depth:.4g} mm)" in state.message
        )


@pytest.mark.parametrize("harmonics", [0, 2, None])
def test_what_is_inside_out_is_counted(harmonics):
    """With u_z = - z^2 / (2 h) all that lies above h is inside out."""
    shape, h = paper().shape.without_magnet().scaled(1 / 8), 0.5
    if harmonics is None:
        d = MeshSpecification(shape, 0.4998, "ignored", 0.16, 0.16, body="half").build()
        along = 2
    else:
        d = MeshSpecification(shape, 0.4998, "ignored", 0.2, 0.2, harmonics=harmonics).build()
        along = d.elements.angles.fields - harmonics - 1
    u = np.zeros(d.system.fixed.shape)
    u[:, along] = -(d.elements.nodes[:, -1] ** 2) / (2 * h)
    above = (shape.H - h) / 4 + 2 / 3 / 8
    assert diagnostics.inverted_share(d, u) == pytest.approx(above / (shape.H / 4 + 2 / 3 / 8), abs=0.02)
    assert diagnostics.inverted_share(d, 0 * u) == 0
    assert diagnostics.inverted_share(d, 4 * u * h / d.elements.nodes[:, -1:].clip(1e-9)) == pytest.approx(
        1, abs=1e-9
    )


WIDE = Design(D=8.0, L=6.4, l0=6.4, magnet_diameter=6.4, magnet_height=0.8, magnet_edge_radius=0.2)
"""A thin magnet of 0.8 D: a deep press creases the skin beside it."""


@pytest.mark.parametrize("accuracy", [QUICK, STANDARD])
def test_creases_of_the_skin_begin_at_one_depth_on_all_meshes(accuracy):
    smooth, creased = trace(WIDE, [Load(depth=1.84), Load(depth=2.0)], accuracy, estimate=False)
    assert (smooth.status, creased.status) == ("ok", "unstable")
    assert smooth.facts.crease_ratio == pytest.approx(2.07, abs=0.1)
    assert creased.facts.crease_ratio > 2.6
    assert "the free skin creases" in creased.message


@pytest.mark.parametrize(("depth", "remark"), [(1.0, None), (3.45, "pushed_aside")])
def test_a_glued_shear_tells_that_the_press_before_it_would_have_buckled(depth, remark):
    """The paper's sensor buckles at 2.9 mm; beyond, the tip that the plate holds pushes along the shear."""
    state = solve(paper(), Load(depth=depth, shear_x=-0.5, friction="stick"), QUICK)
    assert (state.status, state.facts.remark) == ("ok", remark)
    assert (state.response.force[0] > 0) == (remark is not None)


@pytest.fixture(scope="module")
def sheared():
    """A state under a shear, whose facts tests replace."""
    load = Load(depth=0.75, shear_x=0.3, shear_y=0.4, friction="stick")
    return replace(solve(paper(), Load(depth=1.0), QUICK), load=load)


@pytest.mark.parametrize("stop", [kind for kind in STOPPED if kind])
def test_a_stop_says_where_why_and_what_to_try_whatever_else_is_known(sheared, stop):
    facts = Facts(stop, Stability(1), "depth", (0.5, 0.6), inverted_share=2e-5)
    text = diagnostics.describe(replace(sheared, facts=facts), paper())
    assert facts.status == "not_converged"
    assert text.startswith(f"stopped at depth 0.75 mm, shear 0.5 mm: {STOPPED[stop]}; try a smaller load")
    assert "unstable since a depth between 0.5 and 0.6 mm" in text
    assert "0.002 % of the silicone is inverted (J <= 0)" in text


@pytest.mark.parametrize(
    ("facts", "words"),
    [
        ({}, ""),
        ({"onset": "shear", "onset_mm": (0.0, 0.4)}, "past it now"),
        ({"harmonics_missing": 3}, "needs 3 harmonics more"),
        ({"inverted_share": 1e-7}, ""),
    ],
)
def test_a_stable_state_says_what_else_is_known(sheared, facts, words):
    text = diagnostics.describe(replace(sheared, facts=Facts(stability=STABLE, **facts)), paper())
    assert words in text
    assert bool(words) == bool(text)


SOFT = replace(paper(), law="yeoh", yeoh_2=-5.0)


@pytest.mark.parametrize(
    ("name", "numbers"), [("mooney-rivlin", (0.4,)), ("yeoh", (-0.3, 0.1)), ("ogden", (5.0, -3.0, 0.3))]
)
def test_stiffness_is_the_second_derivative_of_the_energy(name, numbers):
    silicone, h, step = law(name, numbers), np.array([0.3, 0.05, -0.35]), 1e-3
    ways = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0], [0.2, 0.5, -0.7]])

    def energy(at):
        return evaluate(silicone, np.diag(np.expm1(at)))[0]

    _, D = silicone_limits.stress_and_stiffness(silicone, h[None])
    for way in ways:
        bent = (energy(h + step * way) - 2 * energy(h) + energy(h - step * way)) / step**2
        assert way @ D[0] @ way == pytest.approx(bent, rel=1e-5)
        assert silicone_limits.least_stiffness(D)[0] <= bent / (way @ way) * (1 + 1e-5)


def test_a_yeoh_law_is_lost_where_its_energy_in_uniaxial_stretch_bends_down():
    """W = mu/2 (x + c x^2) has W'' = 0 by h somewhere before x = -1 / (2 c), where the stress vanishes."""
    silicone = law("yeoh", (-0.2, 0.0))
    h = np.linspace(0, 0.7, 2001)
    x = np.exp(2 * h) + 2 * np.exp(-h) - 3
    bent = np.gradient(np.gradient((x - 0.2 * x**2) / 2, h), h)
    way = h[:, None] * np.array([1.0, -0.5, -0.5])
    least = silicone_limits.least_stiffness(silicone_limits.stress_and_stiffness(silicone, way)[1])
    end = h[np.argmax(least <= 0)]
    assert end <= h[np.argmax(bent < 0)] + 1e-3
    assert 0 < np.exp(2 * end) + 2 * np.exp(-end) - 3 < 2.5


@pytest.mark.parametrize(("depth", "lost"), [(0.05, False), (0.16, True)])
def test_a_solve_that_stops_short_blames_its_law_only_where_it_is_lost(depth, lost):
    load = Load(depth=depth)
    scene = Scene(SOFT, (load,), QUICK)
    path = Path(path_models(scene))
    reached = path.advance(path.rest, scene.position(load))
    assert not reached.stop
    state = read(reached.state, scene, load, "no_convergence")
    assert state.status == "not_converged"
    assert ("the law yeoh with yeoh_2 = -5, yeoh_3 = 0 loses stability" in state.message) is lost
    assert ("another accuracy" in state.message) is not lost


@pytest.mark.parametrize(("depth", "lost"), [(0.13, False), (0.16, True)])
def test_a_good_state_says_where_it_is_beyond_its_law(depth, lost):
    """At 0.13 mm the law would be lost a tenth further on, which is no matter of a good state."""
    state = equilibrium.solve(SOFT, Load(depth=depth), accuracy=QUICK)
    assert state.status == "ok"
    assert (state.facts.weak_at is not None) is lost
    assert ("loses stability (Drucker) at principal stretches of 1.05, 1.05, 0.899" in state.message) is lost


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("neo-hookean", ()),
        ("mooney-rivlin", (0.3,)),
        ("mooney-rivlin", (1.0,)),
        ("yeoh", (0.0, 0.0)),
        ("yeoh", (0.2, 0.1)),
        ("yeoh", (-0.02, 0.0)),
        ("yeoh", (0.2, -0.01)),
        ("ogden", (0.5, -0.1, 0.5)),
        ("ogden", (12.0, -8.0, 0.3)),
    ],
)
def test_laws_that_are_called_always_stable_are_so_at_large_strains(name, numbers):
    silicone = law(name, numbers)
    h = np.random.default_rng(0).uniform(-2, 2, (2000, 3))
    _, D = silicone_limits.stress_and_stiffness(silicone, h - h.mean(axis=1, keepdims=True))
    stable = (silicone_limits.least_stiffness(D) > 0).all()
    assert silicone_limits.always_stable(silicone) == stable


def test_a_law_of_which_nothing_is_known_is_not_called_stable():
    """Ogden's law with a factor below 0 loses stability, and a law of another kind may."""
    assert not silicone_limits.always_stable(functools.partial(ogden, alphas=(2.0, -2.0), shares=(1.5, -0.5)))
    assert not silicone_limits.always_stable(lambda *values: None)


def cube(n=2):
    mesh = skfem.MeshTet.init_tensor(*(np.linspace(0, 1, n + 1),) * 3)
    return elements.build(skfem.MeshTet2.from_mesh(mesh), axisymmetric=False)


@pytest.mark.parametrize("F", [np.diag([1.3, 0.9, 0.8]), np.diag([1.3, 1.3, 0.6]), np.diag([0.7, 0.7, 0.7])])
def test_a_uniform_stretch_has_its_own_strain(F):
    e = cube()
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    u = e.nodes @ (turn @ F - np.eye(3)).T
    assert largest_strain(e, u) == pytest.approx(F.max() - 1, abs=1e-8)


def test_a_tenth_of_a_percent_of_the_volume_may_be_beyond():
    """Under u_x = x^2 / 2 the strain of the cube is x, and the share s of the volume stays below s."""
    e = cube(8)
    u = np.zeros_like(e.nodes)
    u[:, 0] = e.nodes[:, 0] ** 2 / 2
    assert largest_strain(e, u) == pytest.approx(VOLUME_SHARE, abs=0.02)


def test_the_strain_of_a_press_hardly_depends_on_the_mesh_or_on_the_model():
    load = Load(depth=1.0)
    quick, standard = (solve(paper(), load, accuracy) for accuracy in (QUICK, STANDARD))
    harmonic = solve(paper(), load, QUICK, model="harmonic")
    strains = [state.facts.largest_strain for state in (quick, harmonic)]
    assert strains == pytest.approx([standard.facts.largest_strain] * 2, rel=0.02)


def test_a_light_press_has_the_pressure_of_hertz():
    """p0 = (6 F E*^2 / (pi^3 R^2))^(1/3), E* = E / (1 - nu^2), on a solid beam; scale and modulus follow."""
    design = Design(D=10.0, L=15.0, E=2.0, magnet_diameter=0.0, magnet_height=0.0)
    (state,) = trace(design, [Load(depth=0.03)], "fine", magnet="ignored", estimate=False)
    stiff = design.E / (1 - design.nu**2)
    hertz = (6 * state.response.force[2] * stiff**2 / (np.pi**3 * 5.0**2)) ** (1 / 3)
    assert design.E * state.facts.contact_pressure == pytest.approx(hertz, rel=0.03)
    larger = replace(design, D=20.0, L=30.0, E=0.5)
    (similar,) = trace(larger, [Load(depth=0.06)], "fine", magnet="ignored", estimate=False)
    assert similar.facts.contact_pressure == pytest.approx(state.facts.contact_pressure, rel=1e-9)


def test_the_contact_pressure_does_not_move_with_the_mesh():
    pressures = [
        trace(paper(), [Load(depth=1.0)], level, estimate=False)[0].facts.contact_pressure
        for level in ("quick", "standard", "fine")
    ]
    assert pressures == pytest.approx([pressures[-1]] * 3, rel=2e-3)
    assert pressures[-1] == pytest.approx(0.475, rel=0.01)


def test_the_contact_pressure_of_a_shear_is_unknown():
    state = solve(paper(), Load(depth=0.5, shear_x=0.1, friction="stick"), QUICK)
    assert state.facts.contact_pressure is None
