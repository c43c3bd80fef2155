"""The shipped surrogate against finite elements, what it refuses, and the choice of a model for a tolerance."""

import dataclasses
import json
from dataclasses import replace

import numpy as np
import pytest

from analytic import buckling
from fem.accuracy import STANDARD
from fem.analyses.stability import critical
from fem.equilibrium import trace
from fem.physics_version import PHYSICS
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from studies.beam import prediction, surrogate_file, surrogate_range, surrogate_response
from studies.beam.surrogate_file import GaussianProcess, correlation, with_constant
from studies.beam.surrogate_response import respond
from studies.mechanics import model_choice
from studies.mechanics.model_choice import Choice, Statement, choose, region, statements, unmet
from studies.validation.surrogate.surrogate_training import random_beams

PAPER = (np.array([1.125]), np.array([0.5]), np.array([0.25]), np.array([0.4998]))


def beams(count, seed=4):
    b = random_beams(count, seed)
    smaller = np.minimum(b.diameter, b.height)
    return prediction.beams(b.L, b.diameter, b.height, b.nu, b.edge * smaller)


@pytest.mark.parametrize("shear", [0.0, 1.5])
def test_press_and_glued_shear_of_the_papers_sensor_are_those_of_finite_elements(shear):
    """Three times the 90 % interval: a wrong form or unit would be far outside."""
    state = trace(paper(), [Load(depth=1.0, shear_x=shear, friction="stick" if shear else "none")], STANDARD)[-1]
    beam, depth, response = prediction.beams(*PAPER), np.array([[1.0 / 8]]), state.response
    found = {"contact_radius": response.contact_radius / 8, "strain": state.facts.largest_strain}
    if shear:
        predicted = beam.shear(depth, np.array([[shear / 8]]))
        found |= {"force_x": response.force[0] / 64, "force_z": response.force[2] / 64, "tilt": response.tilt}
        found |= {"shift_x": response.shift[0] / 8, "shift_z": -response.shift[2] / 8}
    else:
        predicted = beam.press(depth)
        found |= {"force": response.force[2] / 64, "shift": -response.shift[2] / 8}
        found |= {"sideways_ratio": state.facts.sideways_stiffness_ratio}
    for name, value in found.items():
        quantity = predicted[name]
        assert abs(quantity.value[0, 0] - value) < 3 * quantity.half_width[0, 0], name


def test_the_critical_depth_is_that_of_finite_elements():
    slender = Design(L=20.0, l0=18.2)
    state = critical(slender, estimate=False)
    quantity = prediction.beams(np.array([2.5]), *PAPER[1:]).critical_depth()
    assert abs(quantity.value[0] - state.depth / 8) < 3 * quantity.half_width[0]


def test_a_shear_that_vanishes_is_a_press():
    b = beams(50)
    depth = np.maximum(0.9 * b.stable_to(), surrogate_range.SHALLOWEST_SHEAR)[:, None]
    press, shear = b.press(depth), b.shear(depth, np.zeros_like(depth))
    assert shear["force_z"].value == pytest.approx(press["force"].value, rel=1e-12)
    assert shear["shift_z"].value == pytest.approx(press["shift"].value, rel=1e-12)
    assert np.abs(shear["force_x"].value).max() == np.abs(shear["tilt"].value).max() == 0


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({0: 0.6}, "L/D within 0.75 and 4; got 0.6"),
        ({0: 0.75, 2: 0.3}, "silicone below the magnet of at least 0.15; got 0.1"),
        ({3: 0.3}, "nu within 0.45 and 0.5; got 0.3"),
        ({1: 0.8, 2: 0.7}, "silicone around the magnet of at least 0.04; got -0.0"),
    ],
)
def test_a_beam_outside_the_range_is_refused(change, reason):
    values = [np.array([change.get(k, value[0])]) for k, value in enumerate(PAPER)]
    b = prediction.beams(*values)
    assert reason in b.outside[0]
    assert np.isnan(b.press(np.array([[0.1]]))["force"].value).all()
    assert np.isnan(b.critical_depth().value).all()
    assert np.isnan(b.first_mode(np.array([7.0])).value).all()


def altered(tmp_path, **changes):
    """Return a copy of the shipped file whose `about` is changed."""
    with np.load(surrogate_file.FILE, allow_pickle=False) as archive:
        arrays = dict(archive)
    about = json.loads(str(arrays["about"])) | changes
    np.savez(tmp_path / "copy.npz", **(arrays | {"about": np.array(json.dumps(about))}))
    return tmp_path / "copy.npz"


@pytest.mark.parametrize("name", surrogate_file.ANSWERS)
def test_a_surrogate_of_older_finite_elements_is_refused(tmp_path, name):
    older = {one: PHYSICS[one] for one in surrogate_file.ANSWERS} | {name: PHYSICS[name] - 1}
    sentence = rf"was trained on version {PHYSICS[name] - 1} of the finite elements \({name}\), and this magtip has"
    with pytest.raises(BadInput, match=sentence):
        surrogate_file.read(altered(tmp_path, physics=older))
    with pytest.raises(BadInput, match="was trained on version None"):
        surrogate_file.read(altered(tmp_path, physics={}))


def test_no_shear_is_known_beyond_the_depth_to_which_a_press_is_stable():
    b = prediction.beams(np.array([3.0, 1.125]), *(np.repeat(value, 2) for value in PAPER[1:]))
    critical, stable = b.critical_depth(), b.stable_to()
    assert stable[0] == pytest.approx(critical.value[0] - critical.half_width[0])
    assert b.stable_to(2.0)[0] == pytest.approx(critical.value[0] - 2 * critical.half_width[0])
    depth, shear = stable[:, None] * np.array([[0.99, 1.01]]), np.full((2, 2), 0.1)
    known = b.shear(depth, shear)["force_x"].value
    assert np.isfinite(known[0]).tolist() == [True, False]
    assert b.knows(depth, shear)[0].tolist() == b.knows(depth, 0 * shear)[0].tolist() == [True, False]
    assert np.isfinite(b.shear(depth, shear, beyond_stable=True)["force_x"].value[0]).all()
    # the upright equilibrium of a press goes on
    assert np.isfinite(b.press(depth)["force"].value[0]).all()


# Gaussian processes: interpolation, spread, errors of left-out points, likelihood.


RNG = np.random.default_rng(0)
X = RNG.random((40, 2))
Y = np.column_stack([np.sin(3 * X[:, 0]) + X[:, 1] ** 2, X[:, 0] * X[:, 1]])
PROCESS = GaussianProcess(X, Y, np.array([0.6, 0.8]), 1e-8)


def test_prediction_and_spread_are_those_of_the_block_matrix_of_kriging():
    """[K H; H' 0] [w; m] = [k; h]: the prediction is w Y, its variance c(0) - w k - m h."""
    x = RNG.random((5, 2))
    K = correlation(X / PROCESS.lengths, X / PROCESS.lengths) + 1e-8 * np.eye(len(X))
    H = with_constant(X)
    block = np.block([[K, H], [H.T, np.zeros((3, 3))]])
    k = correlation(x / PROCESS.lengths, X / PROCESS.lengths)
    right = np.hstack([k, with_constant(x)]).T
    w = np.linalg.solve(block, right)
    mean, spread = PROCESS.predict(x)
    assert mean == pytest.approx(w[:40].T @ Y, rel=1e-6)
    assert spread**2 == pytest.approx(1 + 1e-8 - (w * right).sum(axis=0), rel=1e-3, abs=1e-7)


# The surrogate's response to one load: units, direction, refusals.


STICK = Load(depth=1.0, shear_x=1.5, friction="stick")


def test_forces_scale_with_E_and_lengths_with_D():
    small = respond(paper(), STICK)
    big = Design(D=16, L=18, magnet_diameter=8, magnet_height=4, magnet_edge_radius=0.2, l0=14.4, E=3.0, f=9)
    large = respond(big, Load(depth=2.0, shear_x=3.0, friction="stick"))
    assert large.response.force == pytest.approx([12 * part for part in small.response.force])
    assert large.response.shift == pytest.approx([2 * part for part in small.response.shift])
    assert large.response.tilt == pytest.approx(small.response.tilt)
    assert (large.strain, large.errors["force"]) == pytest.approx((small.strain, small.errors["force"]))


def test_a_shear_in_another_direction_is_turned():
    along = respond(paper(), STICK).response
    turned = respond(paper(), Load(depth=1.0, shear_x=-0.9, shear_y=1.2, friction="stick")).response
    assert turned.force == pytest.approx((-0.6 * along.force[0], 0.8 * along.force[0], along.force[2]))
    assert turned.shift == pytest.approx((-0.6 * along.shift[0], 0.8 * along.shift[0], along.shift[2]))
    assert (turned.tilt, turned.tilt_y) == pytest.approx((-0.6 * along.tilt, 0.8 * along.tilt))


@pytest.mark.parametrize(
    ("design", "load", "reason"),
    [
        (paper(), Load(depth=0.05), "depths of 0.08 to 2.8 mm here; got 0.05 mm"),
        (paper(), Load(depth=1.0, shear_x=3.1, friction="stick"), "shears to 3 mm here; got 3.1 mm"),
        (paper(), Load(depth=1.0, shear_x=1.0, friction=0.5), "does not know Coulomb friction"),
        (paper(), Load(depth=0.5, plate_tilt=0.1), "does not know plate tilt = 5.73 deg"),
        (replace(paper(), law="ogden"), Load(depth=0.5), "law neo-hookean only; got ogden"),
        (
            replace(paper(), L=30.0, l0=28.2),
            Load(depth=2.0, shear_x=1, friction="stick"),
            "a press to stay stable to",
        ),
        (replace(paper(), L=30.0, l0=28.2), Load(depth=2.0), "mm here, and nothing deeper; got 2 mm: take finite"),
    ],
)
def test_what_it_does_not_know_is_refused_in_a_sentence(design, load, reason):
    with pytest.raises(BadInput, match=reason):
        respond(design, load)


# The rule that chooses a model for a tolerance


PRESS, SHEAR = Load(depth=0.4), Load(depth=0.8, shear_x=0.8, friction="stick")
RUB, TILTED = Load(depth=0.8, shear_x=0.8, friction=0.4), Load(depth=0.8, plate_tilt=0.1)
TOLERANCES = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)

WITHOUT = [each for each in statements() if each.model != "surrogate"]
"""The rule as it is without statements about the surrogate."""
PLACES = (
    ("press", "depth to 0.06 D"),
    ("press", "depth to D/4"),
    ("press", "deep"),
    ("glued shear", "shear to 0.15 D"),
)
RULE = [
    *WITHOUT,
    *(Statement(*place, "surrogate", "shipped", 9, 9, 0.02, 0.02, 0.02, 0.02, 0.02, 0.02) for place in PLACES),
]
"""The rule with bounds of 2 % for the surrogate."""
STUBBY = Design(L=8.0, l0=6.0, magnet_diameter=4.8, magnet_height=2.8)
"""L/D 1 and a large magnet: outside the range of the formulas."""


def allowed(load, **options):
    """The choices for all tolerances that are met, from the largest to the smallest."""
    choices = []
    for tolerance in reversed(TOLERANCES):
        try:
            choices.append(choose(paper(), [load], tolerance, **options))
        except BadInput:
            break
    return choices


@pytest.mark.parametrize("load", [PRESS, SHEAR, RUB])
def test_a_smaller_tolerance_never_chooses_a_less_accurate_model(load):
    choices = allowed(load)
    assert len(choices) >= 4
    bounds = [choice.bound for choice in choices]
    assert bounds == sorted(bounds, reverse=True)


@pytest.mark.parametrize(
    ("case", "options", "name"),
    [
        ((paper(), [PRESS], 0.2), {}, "formula finite"),
        ((Design(L=7.0, l0=6.0), [PRESS], 0.2), {}, "surrogate"),
        ((paper(), [PRESS], 0.2, "ignored"), {}, "axisymmetric"),
        ((paper(), [PRESS], 0.2), {"formulas": False}, "axisymmetric"),
        ((paper(), [SHEAR], 0.3), {"formulas": False}, "harmonic"),
        ((paper(), [PRESS], 0.2), {"rule": RULE}, "formula"),
        ((paper(), [PRESS], 0.05), {"rule": RULE}, "surrogate"),
        # a deformed body, and a rule that says nothing of the surrogate
        ((STUBBY, [PRESS], 0.05), {"rule": RULE, "formulas": False}, "axisymmetric"),
        ((STUBBY, [PRESS], 0.05), {"rule": WITHOUT}, "axisymmetric"),
        # outside the range of the surrogate
        ((dataclasses.replace(STUBBY, law="mooney-rivlin", mooney_share=0.2), [PRESS], 0.3), {"rule": RULE}, "axi"),
        ((dataclasses.replace(STUBBY, nu=0.44), [PRESS], 0.3), {"rule": RULE}, "axisymmetric"),
        ((STUBBY, [Load(depth=0.05)], 0.3), {"rule": RULE}, "axisymmetric"),
        ((STUBBY, [TILTED], 0.3), {"rule": RULE}, "harmonic"),
        ((STUBBY, [RUB], 0.3), {"rule": RULE}, "harmonic"),
    ],
)
def test_the_cheapest_model_that_knows_the_case_is_chosen(case, options, name):
    assert choose(*case, **options).name.startswith(name)


def test_the_tolerance_that_a_refusal_names_is_met():
    with pytest.raises(BadInput) as refusal:
        choose(paper(), [SHEAR], 1e-5)
    least = float(str(refusal.value).split(" is met is ")[1].split(" %")[0]) / 100
    assert choose(paper(), [SHEAR], least).bound <= least


@pytest.mark.parametrize(
    ("load", "words"),
    [
        (Load(grip=1.0, shear_x=0.5), "grip = 1 mm"),
        (TILTED, "plate tilt = "),
        (Load(depth=0.01), "depths below 0.01 D"),
    ],
)
def test_bounds_grow_beyond_the_study(load, words):
    place = region(paper(), load, "rigid")
    assert words in place.beyond
    assert place.growth > 1
    assert words in choose(paper(), [load], 0.5, formulas=False).reason


def test_the_shipped_rule_is_that_of_the_committed_results():
    results = model_choice.DATA.parents[2] / "results" / "errors" / "model_choice.json"
    assert model_choice.DATA.read_text("utf-8") == results.read_text("utf-8")


def test_the_shipped_rule_is_of_the_versions_of_today():
    """Fails when a model's answers have changed: then `magtip validate errors trade --confirm` must be made again."""
    assert model_choice.outdated() == ()
    assert len(statements()) == len(json.loads(model_choice.DATA.read_text("utf-8"))["statements"])


@pytest.fixture
def fresh():
    """Let the rule be read again, before and after a test."""
    cached = model_choice.statements, model_choice.outdated, model_choice.versions
    for function in cached:
        function.cache_clear()
    yield
    for function in cached:
        function.cache_clear()


@pytest.mark.usefixtures("fresh")
def test_statements_of_another_version_of_the_physics_do_not_count(monkeypatch):
    monkeypatch.setitem(PHYSICS, "harmonic", PHYSICS["harmonic"] + 1)
    assert model_choice.outdated() == ("harmonic",)
    assert {each.kind for each in statements()} == {"press"}
    assert "harmonic" not in {each.model for each in statements()}
    press = choose(paper(), [PRESS], 0.01, formulas=False)
    assert (press.model, "other versions of harmonic, which are left out" in press.reason) == ("axisymmetric", True)
    with pytest.raises(
        BadInput, match="no run of model harmonic for glued shear, and those of harmonic are of another"
    ):
        choose(paper(), [SHEAR], 0.01)


def test_the_half_widths_of_the_surrogate_must_meet_the_tolerance_too():
    small = {"force": 1e-6, "shift": 1e-6, "tilt": None, "readings": 1e-6, "sideways": None}
    exact = [dataclasses.replace(each, **small) for each in RULE]
    only = [each for each in exact if each.model == "surrogate"]
    widths = surrogate_response.respond(STUBBY, PRESS)
    widest = max(widths.errors["force"], widths.errors["shift"])
    assert choose(STUBBY, [PRESS], 0.5, rule=only).bound == pytest.approx(widest)
    with pytest.raises(BadInput, match="by model surrogate shipped"):
        choose(STUBBY, [PRESS], 0.9 * widest, rule=only)


def test_a_press_that_may_buckle_is_left_to_finite_elements():
    slender = Design(L=30.0, l0=28.2, magnet_diameter=4.0, magnet_height=2.0)
    critical = surrogate_response.beams_of([slender]).critical_depth()
    depth = 8.0 * float(critical.value[0])
    assert 0 < depth < 2.9
    assert choose(slender, [Load(depth=depth)], 0.05, rule=RULE).model == "axisymmetric"
    assert choose(slender, [Load(depth=0.7 * depth)], 0.05, rule=RULE).model == "surrogate"


CHOICE = Choice("standard", "harmonic", 0.004, "", 0.002, 0.005)
ESTIMATES = {"force": 0.001, "shift": 0.001, "tilt": 0.001, "sideways": 0.001}


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({}, ""),
        ({"sideways": 0.0094}, "error estimate of the force along the shear, 0.94 %, exceeds the tolerance 0.5 %"),
        ({"tilt": 0.006}, "error estimate of the tilt, 0.6 %, exceeds"),
        *(({name: None}, "is unknown") for name in ESTIMATES),
        ({"force": float("nan")}, "the error estimate of the force is unknown"),
    ],
)
def test_an_estimate_beyond_the_tolerance_or_unknown_does_not_meet_it(changed, words):
    along = buckling.sideways_stiffness(paper()) * SHEAR.shear_x
    reason = unmet(CHOICE, paper(), SHEAR, along, ESTIMATES | changed)
    assert words in reason
    assert bool(words) == bool(reason)
