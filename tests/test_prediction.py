"""The shipped surrogate: its range, its limits, its errors against finite elements, its speed."""

import json
import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import optimize

from fem.accuracy import STANDARD
from fem.analyses.modes import modes
from fem.analyses.stability import critical
from fem.equilibrium import solve, trace
from fem.physics_version import PHYSICS
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from studies.mechanics import model_choice, prediction, surrogate_file, surrogate_range, surrogate_response
from studies.mechanics.path_solver import frequency_unit
from studies.mechanics.surrogate_file import GaussianProcess, correlation, with_constant
from studies.mechanics.surrogate_response import respond
from studies.validation import surrogate_fit
from studies.validation.surrogate_training import random_beams

PAPER = (np.array([1.125]), np.array([0.5]), np.array([0.25]), np.array([0.4998]))


def beams(count, seed=4):
    b = random_beams(count, seed)
    smaller = np.minimum(b.diameter, b.height)
    return prediction.beams(b.L, b.diameter, b.height, b.nu, b.edge * smaller)


def test_a_press_of_the_papers_sensor_is_that_of_finite_elements():
    """Three times the 90 % interval: a wrong form or unit would be far outside."""
    state = solve(paper(), Load(depth=1.0), STANDARD)
    predicted = prediction.beams(*PAPER).press(np.array([[1.0 / 8]]))
    found = {
        "force": state.response.force[2] / 64,
        "shift": -state.response.shift[2] / 8,
        "contact_radius": state.response.contact_radius / 8,
        "strain": state.facts.largest_strain,
        "sideways_ratio": state.facts.sideways_stiffness_ratio,
    }
    for name, value in found.items():
        quantity = predicted[name]
        assert abs(quantity.value[0, 0] - value) < 3 * quantity.half_width[0, 0], name


def test_a_glued_shear_of_the_papers_sensor_is_that_of_finite_elements():
    state = trace(paper(), [Load(depth=1.0, shear_x=1.5, friction="stick")], STANDARD)[-1]
    predicted = prediction.beams(*PAPER).shear(np.array([[1.0 / 8]]), np.array([[1.5 / 8]]))
    response = state.response
    found = {
        "force_x": response.force[0] / 64,
        "force_z": response.force[2] / 64,
        "shift_x": response.shift[0] / 8,
        "shift_z": -response.shift[2] / 8,
        "tilt": response.tilt,
        "contact_radius": response.contact_radius / 8,
        "strain": state.facts.largest_strain,
    }
    for name, value in found.items():
        quantity = predicted[name]
        assert abs(quantity.value[0, 0] - value) < 3 * quantity.half_width[0, 0], name


def test_the_critical_depth_is_that_of_finite_elements():
    slender = Design(L=20.0, l0=18.2)
    state = critical(slender, estimate=False)
    quantity = prediction.beams(np.array([2.5]), *PAPER[1:]).critical_depth()
    assert abs(quantity.value[0] - state.depth / 8) < 3 * quantity.half_width[0]


def test_the_first_mode_is_that_of_finite_elements():
    design = paper()
    first = modes(design, count=1, estimate=False).frequency[0]
    quantity = prediction.beams(*PAPER).first_mode(np.array([design.magnet_density / design.density]))
    unit = frequency_unit(design.D, design.E, design.density)
    assert abs(quantity.value[0] - first / unit) < 3 * quantity.half_width[0]


def test_a_shear_that_vanishes_is_a_press():
    b = beams(50)
    depth = np.maximum(0.9 * b.stable_to(), surrogate_range.SHALLOWEST_SHEAR)[:, None]
    press, shear = b.press(depth), b.shear(depth, np.zeros_like(depth))
    assert shear["force_z"].value == pytest.approx(press["force"].value, rel=1e-12)
    assert shear["shift_z"].value == pytest.approx(press["shift"].value, rel=1e-12)
    assert np.abs(shear["force_x"].value).max() == np.abs(shear["tilt"].value).max() == 0


def test_the_force_rises_with_the_depth_and_the_side_force_with_the_shear():
    b = beams(300)
    share = np.linspace(0, 1, 12)
    depth = surrogate_range.SHALLOWEST + share * (b.deepest[:, None] - surrogate_range.SHALLOWEST)
    assert (np.diff(b.press(depth)["force"].value, axis=1) > 0).all()


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({0: 0.6}, "L/D within 0.75 and 4; got 0.6"),
        ({1: 0.1}, "magnet_diameter/D within 0.2 and 0.8; got 0.1"),
        ({2: 0.85}, "magnet_height/D within 0.1 and 0.8; got 0.85"),
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


@pytest.mark.parametrize(("depth", "shear"), [(0.005, 0.1), (0.36, 0.1), (0.1, 0.4), (0.1, -0.1), (0.02, 0.1)])
def test_a_load_outside_the_range_has_no_answer(depth, shear):
    b = prediction.beams(*PAPER)
    assert math.isnan(b.shear(np.array([[depth]]), np.array([[shear]]))["tilt"].value[0, 0])


def test_ten_thousand_designs_a_second_on_one_core():
    """Press, shear, critical depth and mode of 4000 designs; the bound leaves room for a busy machine."""
    surrogate_file.shipped()
    beams(1).shear(np.array([[0.1]]), np.array([[0.1]]))
    b = beams(4000)
    begin = time.process_time()
    b.press(0.5 * b.deepest[:, None])
    b.shear(0.5 * b.deepest[:, None], 0.5 * b.farthest[:, None])
    b.critical_depth()
    b.first_mode(np.full(len(b.L), 7.0))
    assert time.process_time() - begin < 4.0


def test_the_file_is_small_and_holds_no_objects():
    assert surrogate_file.FILE.stat().st_size < 5e6
    with np.load(surrogate_file.FILE, allow_pickle=False) as archive:
        assert all(archive[name].dtype.kind in "fiU" for name in archive.files)


def test_a_file_comes_back_as_it_was_written(tmp_path):
    shipped = surrogate_file.shipped()
    surrogate_file.write(tmp_path / "copy.npz", shipped)
    copy = surrogate_file.read(tmp_path / "copy.npz")
    x = shipped.groups["press"].process.x[:3] * 1.01
    assert np.array_equal(copy.groups["press"].process.predict(x)[0], shipped.groups["press"].process.predict(x)[0])
    assert copy.groups["shear"].quantities == prediction.POSE


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


def test_other_verbs_run_beside_an_older_surrogate(monkeypatch):
    """A developer raises a version: the surrogate refuses in a sentence, and `--tolerance` takes finite elements."""
    monkeypatch.setitem(PHYSICS, "harmonic", PHYSICS["harmonic"] + 1)
    cached = surrogate_file.shipped, model_choice.statements, model_choice.outdated, model_choice.versions
    for function in cached:
        function.cache_clear()
    try:
        sentence = surrogate_response.refusal(paper(), Load(depth=1.0), "rigid")
        assert sentence.endswith("build it again with `magtip validate surrogate`, or take finite elements")
        assert model_choice.choose(paper(), [Load(depth=1.0)], 0.05).model_kind != "surrogate"
        with pytest.raises(BadInput, match="was trained on version"):
            prediction.beams(*PAPER)
    finally:
        for function in cached:
            function.cache_clear()


def test_another_accuracy_is_not_shipped(tmp_path, monkeypatch):
    monkeypatch.setattr(surrogate_file, "FILE", altered(tmp_path, accuracy="quick"))
    surrogate_file.shipped.cache_clear()
    try:
        with pytest.raises(BadInput, match="was trained at accuracy quick, and magtip ships standard"):
            surrogate_file.shipped()
    finally:
        surrogate_file.shipped.cache_clear()


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


def test_an_unknown_critical_depth_has_no_interval():
    """It lies anywhere below: a press is known to be stable as far as the stiffness is known to be positive."""
    b = prediction.beams(*PAPER)
    critical = b.critical_depth()
    assert math.isinf(critical.value[0])
    assert math.isnan(critical.half_width[0])
    assert 0.8 * b.deepest[0] < b.stable_to()[0] <= b.deepest[0]
    assert b.stable_to(50.0)[0] < b.stable_to()[0]


@pytest.mark.parametrize("content", [b"", b"not an archive"])
def test_another_file_is_refused_in_a_sentence(tmp_path, content):
    file = Path(tmp_path / "other.npz")
    file.write_bytes(content)
    with pytest.raises(ValueError, match="is no surrogate"):
        surrogate_file.read(file)


def test_a_press_is_stable_no_deeper_than_the_surrogate_knows():
    """A stocky beam has no critical depth in the range: it is stable to the end of the range, and not beyond."""
    made = prediction.beams(*np.array([[1.1, 4.0, 9.0], [0.5, 0.5, 0.5], [0.25, 0.25, 0.25], [0.4998] * 3]))
    critical, known, surely = made.critical_depth(), made.stable_to(0.0), made.stable_to(1.0)
    assert np.isinf(critical.value[0])
    assert known[0] == made.deepest[0]
    assert known[1] == pytest.approx(critical.value[1], rel=2e-3)
    assert surely[1] < known[1] - 0.9 * critical.half_width[1]
    assert np.isnan(surely[2])


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


def test_left_out_predictions_are_those_of_training_without_the_point():
    mean, spread = PROCESS.left_out()
    for k in (0, 7, 39):
        others = np.arange(40) != k
        without = GaussianProcess(X[others], Y[others], PROCESS.lengths, PROCESS.nugget)
        own, width = without.predict(X[[k]])
        assert mean[k] == pytest.approx(own[0], rel=1e-5)
        assert spread[k] == pytest.approx(width[0], rel=1e-4)


def test_the_slopes_of_the_likelihood_are_those_of_differences():
    logs = np.log([0.5, 0.9, 1e-4])
    slope = surrogate_fit._misfit(logs, X, Y)[1]
    assert slope == pytest.approx(optimize.approx_fprime(logs, lambda z: surrogate_fit._misfit(z, X, Y)[0]), rel=1e-3)


def test_an_input_without_effect_gets_a_long_length_scale():
    y = np.sin(4 * X[:, :1])
    process = surrogate_fit.fitted(X, y)
    assert process.lengths[1] > 5 * process.lengths[0]
    x = RNG.random((200, 2))
    assert np.abs(process.predict(x)[0] - np.sin(4 * x[:, :1])).max() < 0.02


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


def test_a_frictionless_plate_that_moves_sideways_is_a_press():
    assert respond(paper(), Load(depth=1.0, shear_x=1.0)) == respond(paper(), Load(depth=1.0))


@pytest.mark.parametrize(
    ("design", "load", "reason"),
    [
        (paper(), Load(depth=0.05), "depths of 0.08 to 2.8 mm here; got 0.05 mm"),
        (paper(), Load(depth=2.9), "depths of 0.08 to 2.8 mm"),
        (paper(), Load(depth=1.0, shear_x=3.1, friction="stick"), "shears to 3 mm here; got 3.1 mm"),
        (paper(), Load(depth=1.0, shear_x=1.0, friction=0.5), "does not know Coulomb friction"),
        (paper(), Load(shear_x=0.5, grip=1.0), "does not know grips"),
        (paper(), Load(depth=0.5, plate_tilt=0.1), "does not know tilted plates"),
        (paper(), Load(depth=0.5, imperfection=0.001), "does not know imperfections"),
        (replace(paper(), law="ogden"), Load(depth=0.5), "law neo-hookean only; got ogden"),
        (replace(paper(), nu=0.4), Load(depth=0.5), "nu within 0.45 and 0.5; got 0.4"),
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


def test_a_design_without_a_magnet_is_refused():
    with pytest.raises(BadInput, match="rigid magnet only"):
        respond(replace(paper(), magnet_diameter=0.0, magnet_height=0.0), Load(depth=0.5), "ignored")
