"""Round trips of the decoder, its second solutions against an exhaustive search, and readings that no pose gives."""

import dataclasses

import numpy as np
import pytest
from decode_oracle import exhaustive
from numpy.testing import assert_allclose

from analytic import beam, decode, hall
from analytic.inverse import (
    forward_model,
    response_surface,
)
from analytic.parts import Element
from geometry.design import BadInput, Design, paper
from geometry.loads import Load

TILT = np.array([[0.1, 0.01], [0.002, 0.001]]), 0.08, 0.12
CHIPS = Design(hall_layout="tmag5273a1", chip_x=3.0, chip_count=3, l0=7.5)
FOLDED = Design(l0=6.0, c=2.5, hall_low=0, hall_null=50, hall_high=100)


def tilting(design, per_mm=0.1):
    """Mechanics of the paper's formulas with a tilt that grows with the shift."""

    def solve(load):
        found = beam.solve(design, load)
        return dataclasses.replace(found, tilt=per_mm * found.shift[0], tilt_y=per_mm * found.shift[1])

    return response_surface.of_formula(solve, 4.0, 5.0)


def poses(coder, count, seed=1):
    rng = np.random.default_rng(seed)
    shift = rng.uniform(coder.low, coder.high, (count, 3)).T.copy()
    return shift, forward_model.readings_with_slopes(coder.forward, shift)[0]


@pytest.fixture(scope="module")
def coder():
    return decode.decoder(paper(), tilting(paper()))


@pytest.mark.parametrize("tau", [forward_model.NO_TILT, TILT])
@pytest.mark.parametrize("mode", ["component", "magnitude"])
@pytest.mark.parametrize(
    "design",
    [paper(), Design(hall_plate=0.5), Design(hall_layout="tmag5273a1"), Design(magnet_north="up"), CHIPS],
    ids=["three", "plates", "chip", "north up", "three chips"],
)
def test_forward_model_reads_as_the_elements_do(tau, mode, design):
    model = forward_model.model(design, tau, mode=mode)
    shift = np.random.default_rng(0).uniform([-3, -3, -3], [3, 3, 0], (6, 3)).T.copy()
    shift[:2, 0] = 0
    values, slopes = forward_model.readings_with_slopes(model, shift)
    turns = forward_model.rotation(tau, shift)
    for k in range(6):
        expected = hall.readings(design, shift=shift[:, k], tilt=turns[:, k], mode=mode).B_T
        assert_allclose(values[:, k], expected, rtol=1e-12)
    step = 1e-5
    for j, e in enumerate(step * np.eye(3)[:, :, None]):
        numeric = (
            forward_model.readings_with_slopes(model, shift + e)[0]
            - forward_model.readings_with_slopes(model, shift - e)[0]
        ) / (2 * step)
        assert_allclose(slopes[j], numeric, atol=1e-8 * np.abs(slopes).max())


@pytest.mark.parametrize("ignore_tilt", [False, True])
def test_round_trip(coder, ignore_tilt):
    coder = decode.decoder(Design(hall_high=3.8), coder.mechanics, ignore_tilt=ignore_tilt)
    shift, field = poses(coder, 2000)
    found = decode.decode(coder, field.T)
    seen = ~hall.at_rail(coder.forward.elements, field).any(axis=0)
    assert 0.9 < seen.mean() < 1
    assert {s for s, good in zip(found.status, seen, strict=True) if good} == {"ok"}
    assert {s for s, good in zip(found.status, seen, strict=True) if not good} == {"saturated"}
    assert np.abs(found.shift[seen] - shift.T[seen]).max() < 1e-7
    assert np.isnan(found.shift[~seen]).all()
    assert_allclose(found.tilt[:, 1][seen], 0 if ignore_tilt else 0.1 * shift[0][seen], atol=1e-7)


def test_three_chips_give_one_pose_with_less_noise_than_one_of_them(coder):
    three, one = (
        decode.decoder(design, coder.mechanics) for design in (CHIPS, dataclasses.replace(CHIPS, chip_count=1))
    )
    shift, field = poses(three, 200)
    found = decode.decode(three, field.T)
    assert set(found.status) == {"ok"}
    assert np.abs(found.shift - shift.T).max() < 1e-7
    alone = decode.decode(one, field[:3].T)
    seen = alone.multiplicity == 1
    assert (found.noise_mm[seen] < alone.noise_mm[seen]).all()
    wrong = field.T.copy()
    wrong[:, 4] += 2e-3
    assert set(decode.decode(three, wrong).status) <= {"inconsistent", "out_of_workspace"}


def test_load_and_force_come_back(coder):
    load = Load(depth=1.3, shear_x=0.8, shear_y=-0.5, friction="stick")
    response = beam.solve(paper(), load)
    x, y, z = response.shift
    field = hall.readings(paper(), shift=(x, y, z), tilt=(-0.1 * y, 0.1 * x)).B_T
    found = decode.decode(coder, [field])
    assert_allclose(found.force[0], response.force, rtol=1e-8)
    assert_allclose(found.load[0], [1.3, 0.8, -0.5], rtol=1e-8)


def test_second_poses_are_found_as_an_exhaustive_search_finds_them():
    coder = decode.decoder(FOLDED, tilting(FOLDED))
    shift, field = poses(coder, 4000)
    found = decode.decode(coder, field.T)
    several = np.flatnonzero(found.multiplicity > 1)
    assert len(several) > 20
    assert {found.status[k] for k in several} == {"ambiguous"}
    apart = [np.abs(found.poses[found.owner == k] - shift[:, k]).max(axis=1).min() for k in range(0, 4000, 7)]
    assert max(apart) < 1e-5
    for k in (*several[:4], *np.flatnonzero(found.multiplicity == 1)[:4]):
        expected = exhaustive(coder, field[:, k])
        own = found.poses[found.owner == k]
        assert len(own) == len(expected)
        assert all(np.abs(own - pose).max(axis=1).min() < 1e-5 for pose in expected)


def test_ambiguous_streams_follow_one_branch():
    coder = decode.decoder(FOLDED)
    shift, field = poses(coder, 4000)
    found = decode.decode(coder, field.T)
    k = max(np.flatnonzero(found.multiplicity > 1), key=lambda k: np.linalg.norm(shift[:, k] - found.shift[k]))
    assert np.linalg.norm(shift[:, k] - found.shift[k]) > 0.1
    path = shift[:, k : k + 1] * np.linspace(0.97, 1, 5)
    # the first reading has no warm start
    later = decode.decode(
        coder, forward_model.readings_with_slopes(coder.forward, path)[0].T, near=path[:, 0], follow=True
    )
    assert_allclose(later.shift, path.T, atol=1e-5)
    near = decode.decode(coder, field[:, k : k + 1].T, near=shift[:, k])
    assert_allclose(near.shift[0], shift[:, k], atol=1e-5)


def test_noise_is_that_of_a_sample():
    design = Design(hall_noise=2e-3)
    coder = decode.decoder(design, tilting(design))
    at = np.array([[0.8], [-0.4], [-1.0]])
    field = forward_model.readings_with_slopes(coder.forward, at)[0].T
    rng = np.random.default_rng(5)
    many = decode.decode(coder, field + 2e-3 / 31.25 * rng.standard_normal((4000, 3)))
    one = decode.decode(coder, field)
    assert_allclose(many.shift.std(axis=0), one.noise_mm[0], rtol=0.05)
    assert_allclose(many.force.std(axis=0), one.noise_N[0], rtol=0.05)
    assert np.isnan(decode.decode(decode.decoder(paper()), field).noise_mm).all()


PLACES = [
    ((0, 0, -2.2), (0, 0, -1)),
    ((5, 0, -0.2), (1, 0, 0)),
    ((0, 5, -0.2), (0, 1, 0)),
    ((-5, 0, -0.2), (1, 0, 0)),
]
FOUR = [
    Element(f"E{k}", position, direction, 31.25, 2.5, 0.2, 4.8, noise=1e-3)
    for k, (position, direction) in enumerate(PLACES)
]
AXES = ((0, 0, -1), (1, 0, 0), (0, 1, 0))
TWO_DIES = [
    Element(f"die {k} axis {j}", (2.5 * k, 0, -2.2), axis, 1.0, 0.0, -0.16, 0.16, noise=1e-4, average=100)
    for k in (-1, 1)
    for j, axis in enumerate(AXES)
]


def test_more_elements_than_three():
    coder = decode.decoder(paper(), elements=FOUR)
    shift, field = poses(coder, 500)
    found = decode.decode(coder, field.T)
    seen = np.array([status != "saturated" for status in found.status])
    assert np.abs(found.shift[seen] - shift.T[seen]).max() < 1e-7
    three = decode.decode(decode.decoder(dataclasses.replace(paper(), hall_noise=1e-3)), field[:3].T)
    assert (found.noise_mm[seen] <= three.noise_mm[seen] * (1 + 1e-9)).all()
    swapped = decode.decode(coder, field[[0, 3, 2, 1]].T)
    assert set(swapped.status) <= {"inconsistent", "out_of_workspace", "saturated"}
    assert np.isnan(swapped.shift).all()


@pytest.mark.parametrize("elements", [FOUR, TWO_DIES], ids=["four elements", "two dies"])
def test_the_residual_tells_a_built_sensor_from_the_nominal_one_and_a_wrong_reading_from_both(elements):
    """Gains that differ by some percent are no noise; with their deviation stated, they are what the sensor is."""
    nominal = decode.decoder(paper(), elements=elements)
    shift, field = poses(nominal, 300)
    rng = np.random.default_rng(4)
    deviation = 0.04 / np.sqrt(3) * np.abs(field).mean(axis=1)
    built = decode.decoder(paper(), elements=elements, deviation=deviation)
    read = field * (1 + rng.uniform(-0.04, 0.04, len(elements)))[:, None]
    inside = (np.abs(shift) < 0.7 * nominal.high.max()).all(axis=0) & (shift[2] < -0.3) & (shift[2] > -1.5)
    inside &= np.array([status == "ok" for status in decode.decode(nominal, field.T).status])
    assert inside.sum() > 50

    def statuses(coder, rows):
        return np.array(decode.decode(coder, rows[:, inside].T).status)

    assert (statuses(nominal, read) == "inconsistent").mean() > 0.9
    assert (statuses(built, read) == "ok").mean() > 0.95
    # a reading that is wrong by far more than parts differ
    wrong = read.copy()
    wrong[3] += 30 * deviation[3]
    assert not (statuses(built, wrong) == "ok").any()


def test_readings_that_no_pose_gives(coder):
    rest = forward_model.readings_with_slopes(coder.forward, np.zeros((3, 1)))[0][:, 0]
    high = forward_model.readings_with_slopes(coder.forward, np.array([[0.0], [0.0], [0.4]]))[0][:, 0]
    rows = [rest, np.zeros(3), -rest, rest[[1, 0, 2]] * [1, 3, 1], high, [np.nan, 0, 0], [np.inf, 0, 0], [0.08, 0, 0]]
    found = decode.decode(coder, rows)
    assert found.status == ["ok", *["out_of_workspace"] * 4, "not_finite", "not_finite", "saturated"]
    assert np.isnan(found.shift[1:]).all()
    assert np.isnan(found.force[1:]).all()
    assert (found.multiplicity == [1, 0, 0, 0, 0, 0, 0, 0]).all()
    assert decode.decode(coder, np.empty((0, 3))).status == []


@pytest.mark.parametrize(
    ("design", "options", "words"),
    [
        (Design(magnet_diameter=0, magnet_height=0), {}, "no magnet"),
        (Design(l0=3.0, c=0.0), {}, "inside the beam"),
        (paper(), {"elements": ()}, "three readings"),
        (paper(), {"workspace": ([0, 0, 0], [1, 1, 0])}, "positive size"),
        (paper(), {"workspace": ([0, 0, np.nan], [1, 1, 0])}, "positive size"),
    ],
)
def test_bad_designs_are_a_sentence(design, options, words):
    with pytest.raises(BadInput, match=words):
        decode.decoder(design, **options)


def test_mechanics_are_the_formulas():
    law = tilting(paper())
    assert max(law.errors) < 1e-9
    assert_allclose(law.tau[0, 0], 0.1)
    x, y, z = 0.4, -0.2, -0.9
    shift, e = np.array([[x], [y], [z]]), 1e-6
    slopes = response_surface.forces(law, shift)[1]
    for j in range(3):
        step = e * np.eye(3)[:, j : j + 1]
        numeric = (response_surface.forces(law, shift + step)[0] - response_surface.forces(law, shift - step)[0]) / (
            2 * e
        )
        assert_allclose(slopes[j], numeric, atol=1e-8)
    assert (response_surface.force_and_load(law, -shift, contact=False)[1][0] == 0).all()


def test_poses_outside_the_workspace_are_found_with_what_ends_it(coder):
    law = dataclasses.replace(coder.mechanics, reach=1.5, sink=1.2)
    near = decode.decoder(paper(), law)
    outside = np.array([[0, 0, -1.25], [1.2, 0.3, -2.8], [0, -2.0, -0.5], [0, 0, -3.4], [3.4, 0, -1], [0, 0, 0.12]])
    field = forward_model.readings_with_slopes(near.forward, outside.T.copy())[0].T
    assert set(decode.decode(near, field).status) == {"out_of_workspace"}
    found = decode.poses_outside(near, field)
    assert_allclose(found, outside, atol=1e-6)
    ends = ["depth", "depth", "shear", "workspace", "workspace", "workspace"]
    assert [decode.exceeded_limit(near, pose) for pose in found] == ends
    # the box of the design alone is ended by nothing else
    assert decode.exceeded_limit(decode.decoder(paper()), np.array([0, 0, -3.2])) == "workspace"
    (nowhere,) = decode.poses_outside(near, np.array([[-0.02, 0.03, 0.01]]))
    assert np.isnan(nowhere).all()
    assert decode.exceeded_limit(near, nowhere) is None
