"""The decoder and its forward model: round trips, all poses, few states, streams, and readings that no pose gives."""

import contextlib
import dataclasses
import math
import time

import numpy as np
import pytest
from numpy.polynomial.polynomial import polyder, polyval2d
from numpy.testing import assert_allclose

from analytic import beam, decode, hall, stream
from analytic.inverse import ambient_field, forward_model, pose_search, response_surface
from analytic.inverse.forward_model import slopes_at
from analytic.parts import Element
from geometry.design import BadInput, Design, paper
from geometry.loads import Load, Response
from studies.sensing import decode_readings

TILT = np.array([[0.1, 0.01], [0.002, 0.001]]), 0.08, 0.12
CHIPS = Design(hall_layout="tmag5273a1", chip_x=3.0, chip_count=3, l0=7.5)
FOLDED = Design(l0=6.0, c=2.5, hall_low=0, hall_null=50, hall_high=100)


def fitted(solve, depth, shear):
    """Mechanics through the answers of a model to loads up to a depth and a shear."""
    samples = []
    for d, s in zip(*response_surface.loads_between(depth, shear), strict=True):
        with contextlib.suppress(BadInput):
            load = Load(float(d), float(s), friction="stick")
            samples.append((load, solve(load)))
    return response_surface.of_samples(samples)


def tilting(design, per_mm=0.1):
    """Mechanics of the paper's formulas with a tilt that grows with the shift."""

    def solve(load):
        found = beam.solve(design, load)
        return dataclasses.replace(found, tilt=per_mm * found.shift[0], tilt_y=per_mm * found.shift[1])

    return fitted(solve, 4.0, 5.0)


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
        ahead, behind = (forward_model.readings_at(model, shift + way * e) for way in (1, -1))
        assert_allclose(slopes[j], (ahead - behind) / (2 * step), atol=1e-8 * np.abs(slopes).max())


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


def test_load_and_force_come_back(coder):
    load = Load(depth=1.3, shear_x=0.8, shear_y=-0.5, friction="stick")
    response = beam.solve(paper(), load)
    x, y, z = response.shift
    field = hall.readings(paper(), shift=(x, y, z), tilt=(-0.1 * y, 0.1 * x)).B_T
    found = decode.decode(coder, [field])
    assert_allclose(found.force[0], response.force, rtol=1e-8)
    assert_allclose(found.load[0], [1.3, 0.8, -0.5], rtol=1e-8)


def test_ambiguous_streams_follow_one_branch():
    coder = decode.decoder(FOLDED)
    shift, field = poses(coder, 4000)
    found = decode.decode(coder, field.T)
    assert {found.status[k] for k in np.flatnonzero(found.multiplicity > 1)} == {"ambiguous"}
    k = max(np.flatnonzero(found.multiplicity > 1), key=lambda k: np.linalg.norm(shift[:, k] - found.shift[k]))
    assert np.linalg.norm(shift[:, k] - found.shift[k]) > 0.1
    path = shift[:, k : k + 1] * np.linspace(0.97, 1, 5)
    # the first reading has no warm start
    later = decode.decode(coder, forward_model.readings_at(coder.forward, path).T, near=path[:, 0], follow=True)
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


REJECTING = {"hall_layout": "tle493d-w2b6", "chip_count": 3, "chip_x": 5.0, "chip_noise": 5e-5}


@pytest.fixture(scope="module")
def rejecting():
    design = Design(**REJECTING)
    return decode.decoder(design, tilting(design), reject_ambient=True)


def test_a_rejected_field_changes_no_pose_and_is_found(rejecting):
    shift, field = poses(rejecting, 200)
    ambient = np.random.default_rng(2).uniform(-1e-3, 1e-3, (200, 3))
    rows = field.T + ambient @ ambient_field.directions(rejecting.forward.elements).T
    found, row_by_row = decode.decode(rejecting, rows), stream.Stream(rejecting)
    assert set(found.status) == {"ok"}
    assert_allclose(found.shift, shift.T, atol=1e-6)
    assert_allclose(decode.ambient_of(rejecting, rows, found.shift)[0], ambient, atol=1e-9)
    # a zero in a field takes it off: what is found is what came since
    row_by_row.zero(forward_model.readings_at(rejecting.forward, np.zeros((3, 1))).T + rows[:1] - field.T[:1])
    sample = row_by_row.step(tuple(rows[1]))
    since = decode.ambient_of(row_by_row.coder, rows[1:2] + row_by_row.offset, np.array([sample.shift]))[0][0]
    assert_allclose(sample.shift, shift[:, 1], atol=1e-6)
    assert_allclose(since, ambient[1] - ambient[0], atol=1e-9)


def test_the_noise_of_a_rejecting_decoder_is_that_of_a_sample(rejecting):
    at = np.array([[0.8], [-0.4], [-1.0]])
    field = forward_model.readings_at(rejecting.forward, at).T
    noise = rejecting.sigma * np.random.default_rng(5).standard_normal((2000, 9))
    many, one = decode.decode(rejecting, field + noise), decode.decode(rejecting, field)
    plain = decode.decode(decode.decoder(rejecting.forward.design, rejecting.mechanics), field)
    assert_allclose(many.shift.std(axis=0), one.noise_mm[0], rtol=0.06)
    assert_allclose(many.force.std(axis=0), one.noise_N[0], rtol=0.06)
    assert (one.noise_N > plain.noise_N).all()
    spread = decode.ambient_of(rejecting, field + noise, many.shift)[0].std(axis=0)
    assert_allclose(spread, decode.ambient_of(rejecting, field, one.shift)[1][0], rtol=0.06)


def test_a_gradient_is_no_uniform_field_and_its_effect_is_proportional_to_it(rejecting):
    """B = g (x, -y, 0) / mm at the chips: what it moves a pose by grows with g, and a mean field would be found."""
    field = forward_model.readings_at(rejecting.forward, np.array([[0.2], [0.1], [-0.8]])).T
    elements = rejecting.forward.elements
    of_gradient = np.array([np.dot(e.direction, np.multiply(e.position, [1, -1, 0])) for e in elements])
    still, *moved = (decode.decode(rejecting, field + g * of_gradient).shift[0] for g in (0.0, 1e-6, 2e-6))
    assert_allclose(moved[1] - still, 2 * (moved[0] - still), rtol=0.01)
    assert np.linalg.norm(moved[0] - still) > 1e-5


def test_two_chips_and_one_axis_elements_do_not_tell_a_field_from_a_pose():
    for design in (paper(), Design(**REJECTING | {"chip_count": 2})):
        with pytest.raises(BadInput, match="do not tell from a pose: take three chips"):
            decode.decoder(design, reject_ambient=True)


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


def test_the_residual_tells_a_built_sensor_from_the_nominal_one_and_a_wrong_reading_from_both():
    """Gains that differ by some percent are no noise; with their deviation stated, they are what the sensor is."""
    nominal = decode.decoder(paper(), elements=FOUR)
    shift, field = poses(nominal, 300)
    rng = np.random.default_rng(4)
    deviation = 0.04 / np.sqrt(3) * np.abs(field).mean(axis=1)
    built = decode.decoder(paper(), elements=FOUR, deviation=deviation)
    read = field * (1 + rng.uniform(-0.04, 0.04, len(FOUR)))[:, None]
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


POSES = [((0.0, 0.0, 0.0), (0.0, 0.0)), ((0.7, 0.0, -0.5), (0.0, 0.2)), ((-0.3, 0.4, -0.2), (0.0, -0.1))]


@pytest.mark.parametrize("design", [paper(), Design(hall_plate=0.5)], ids=["points", "plates"])
@pytest.mark.parametrize(("shift", "tilt"), POSES)
def test_slopes_are_those_of_the_readings(design, shift, tilt):
    by_shift, by_rotation = slopes_at(design, shift, tilt)
    step = 1e-4
    # rotations about one axis add up, so that about y can be differenced at any tilt about y
    for slopes, change in (*zip(by_shift.T, np.eye(5)[:3], strict=True), (by_rotation[:, 1], np.eye(5)[4])):
        ends = []
        for way in (1, -1):
            pose = np.array([*shift, *tilt]) + way * step * change
            ends.append(hall.readings(design, shift=tuple(pose[:3]), tilt=tuple(pose[3:])).B_T)
        assert slopes == pytest.approx(np.subtract(*ends) / (2 * step), rel=1e-6, abs=1e-9)


CHIP = Design(
    D=4, L=4.8, E=0.442, magnet_diameter=3, remanence=1.395, l0=4, hall_average=256, hall_layout="tle493d-p2b6"
)
"""A small sensor whose chip lies close to the magnet: a tilt that is not held folds a sixth of the workspace."""
MANY_FOLDS = Design(D=21.1, L=29.5, f=21.8, c=16.4, l0=22, magnet_diameter=8, magnet_height=5)
"""A sensor with two or three poses for most readings."""


@pytest.mark.parametrize(
    ("design", "level", "several"),
    [(paper(), "finite", 0), (CHIP, "finite", 5), (MANY_FOLDS, "paper", 250)],
    ids=["paper", "chip", "folded"],
)
def test_every_pose_is_found_from_its_readings_and_none_twice(design, level, several, monkeypatch):
    # also with tilts far beyond those of the samples
    monkeypatch.setattr(decode_readings, "MISFIT", math.inf)
    law = decode_readings.of_level(design, level)
    coder = decode.decoder(design, dataclasses.replace(law, lean=(-math.inf, math.inf)))
    shift, field = poses(coder, 400, seed=0)
    shifts, found = shift.T, decode.decode(coder, field.T)
    seen = np.array([status != "saturated" for status in found.status])
    errors = [np.abs(found.poses[found.owner == k] - shift).max(axis=1) for k, shift in enumerate(shifts)]
    own = np.array([error.min(initial=np.inf) for error in errors])
    slopes = forward_model.readings_with_slopes(coder.forward, shifts.T.copy())[1]
    # right on a fold, rounding decides whether two poses or none have the readings
    apart = seen & (decode.condition(slopes) < 1e4)
    assert apart.sum() > 350
    assert own[apart].max() < 1e-6
    assert (found.multiplicity[seen] > 1).sum() >= several
    for row in range(100):
        distinct = found.poses[found.owner == row]
        distance = np.abs(distinct[:, None] - distinct).max(axis=2) + np.eye(len(distinct))
        assert distance.min(initial=1) > pose_search.SAME * design.D


SHEARS = (0.5, 1.0, 1.5, 2.0, 2.5)
DEPTHS = (0.5, 1.0, 1.5, 2.0, 2.5)
FEW = {
    "a press, and shears at its end": [(d, 0.0) for d in DEPTHS] + [(2.5, s) for s in SHEARS],
    "a press, and shears at one depth": [(d, 0.0) for d in DEPTHS] + [(1.0, s) for s in SHEARS],
    "a press under a small shear, and shears at its end": [(d, 0.5) for d in DEPTHS] + [(2.5, s) for s in SHEARS],
    "shears at two depths": [(d, s) for d in (0.5, 2.5) for s in SHEARS],
    "shears at one depth": [(2.5, s) for s in SHEARS],
}


def bent(load):
    return beam.solve(paper(), load, "finite")


@pytest.mark.parametrize("name", FEW)
def test_few_states_make_no_fold_and_no_tension_between_them(name):
    states = [
        (load, bent(load))
        for load in (Load(depth=d, shear_x=s, friction="stick" if s else "none") for d, s in FEW[name])
    ]
    law = response_surface.of_samples(states)
    assert law.errors[2] < 0.002 * max(found.force[2] for _, found in states)
    corners = np.array([(0.0, 0.0), *((found.shift[0], found.shift[2]) for _, found in states)])
    rng = np.random.default_rng(0)
    of = np.array([rng.choice(len(corners), 2, replace=False) for _ in range(1000)])
    u, w = np.einsum("ni,nij->jn", rng.dirichlet(np.ones(2), len(of)), corners[of])
    normal, slope = polyval2d(u * u, w, law.normal), polyval2d(u * u, w, polyder(law.normal, axis=1))
    assert normal.min() > 0
    assert slope.max() < 0
    assert polyval2d(u * u, np.cbrt(-w), polyder(law.depth, axis=1)).min() > 0


def test_a_plate_does_not_pull():
    pairs = FEW["shears at two depths"]
    law = response_surface.of_samples(
        [(load, bent(load)) for load in (Load(d, s, friction="stick") for d, s in pairs)]
    )
    # normal = -10 w - 20 U: beyond the samples, far aside and hardly sunk, it would be a tension
    law = dataclasses.replace(law, tau=np.zeros((1, 1)), normal=np.array([[0.0, -10.0], [-20.0, 0.0]]))
    coder = decode.decoder(paper(), law)
    shift = np.array([[0.0, 0.0, -0.5], [0.6, 0.6, -0.05], [0.0, 0.0, 0.05], [0.0, 0.0, 0.0], [0.005, 0.0, 0.0]]).T
    field = forward_model.readings_with_slopes(coder.forward, shift)[0].T
    found = decode.decode(coder, field)
    assert found.status == ["ok", "tension", "ok", "ok", "ok"]
    assert_allclose(found.shift, shift.T, atol=1e-7)
    assert np.isnan(found.force[1]).all()
    assert np.isnan(found.load[1]).all()
    # 0.005 mm aside it is -0.0005 N, less than the fit's error
    assert_allclose(np.delete(found.force[:, 2], 1), [5, 0, 0, 0], atol=1e-5)
    follower = stream.Stream(coder)
    samples = [follower.step(tuple(row)) for row in field.tolist()]
    assert [sample.status for sample in samples] == found.status
    assert_allclose([sample.force for sample in samples], found.force, atol=1e-6)


def test_mechanics_of_a_contact_and_of_few_states():
    """A Hertz contact on a linear column with a stuck, tilting tip: F = k w, depth = w + (F/h)^(2/3)."""

    def contact(load):
        from scipy.optimize import brentq

        w = brentq(lambda w: w + (3 * w / 5) ** (2 / 3) - load.depth, 0, load.depth) if load.depth else 0.0
        return Response((0.8 * load.shear_x, 0, 3 * w), (0.5 * load.shear_x, 0, -w), 0.06 * load.shear_x, 1.0)

    law = fitted(contact, 3.0, 3.0)
    assert law.errors[0] < 1e-10
    assert law.errors[2] < 1e-10
    assert law.errors[3] < 0.02
    states = [(load, contact(load)) for load in (Load(1.0), Load(2.0), Load(2.0, 1.0, friction="stick"))]
    few = response_surface.of_samples(states)
    assert max(few.errors) < 1e-6


@pytest.mark.parametrize("level", ["paper", "finite"])
def test_forces_have_shifts_within_the_mechanics_only(level):
    law = fitted(lambda load: beam.solve(paper(), load, level), 2.0, 2.0)
    low, high = response_surface.workspace(paper(), law)
    normal, tangential = (v.ravel() for v in np.meshgrid(np.linspace(0.5, 3, 6), np.linspace(0, 0.6, 5)))
    u, w = response_surface.shifts_of_forces(law, low, high, tangential, normal)
    force, _ = response_surface.forces(law, np.stack([u, np.zeros_like(u), w]))
    assert_allclose(force[0], tangential, atol=1e-7)
    assert_allclose(force[2], normal, atol=1e-7)
    assert (w < 0).all()
    # at rest and beyond
    shifts = response_surface.shifts_of_forces(
        law, low, high, np.array([0.0, 50.0, 0.0]), np.array([0.0, 1.0, 500.0])
    )
    assert_allclose(np.array(shifts)[:, 0], 0, atol=1e-9)
    assert np.isnan(np.array(shifts)[:, 1:]).all()


@pytest.mark.parametrize("level", ["paper", "finite"])
def test_loads_of_a_plate_have_shifts_within_the_mechanics_only(level):
    law = fitted(lambda load: beam.solve(paper(), load, level), 2.0, 2.0)
    depth, shear = (v.ravel() for v in np.meshgrid(np.linspace(0.01, 1.9, 9), np.linspace(0, 1.5, 5)))
    u, w = response_surface.shifts_of_loads(law, *response_surface.workspace(paper(), law), depth, shear)
    load = response_surface.force_and_load(law, np.stack([u, np.zeros_like(u), w]), contact=False)[1]
    assert_allclose(load[:2], [depth, shear], atol=1e-9)
    assert (w < 0).all()
    # a plate that does not touch, and loads beyond the samples
    shifts = response_surface.shifts_of_loads(
        law, *response_surface.workspace(paper(), law), np.array([0.0, 4.0, 1.0]), np.array([1.0, 0.0, 9.0])
    )
    assert np.array(shifts)[:, 0].tolist() == [0.0, 0.0]
    assert np.isnan(np.array(shifts)[:, 1:]).all()


def test_beyond_its_samples_a_tilt_stays_near_their_range():
    """Without the range, the polynomial turns this magnet by 60 rad at the upper corner of the workspace."""
    design = Design(D=6.7, L=7.1, magnet_diameter=5, magnet_height=3, l0=4.9, hall_layout="tle493d-p2b6")
    law = fitted(lambda load: beam.solve(design, load, "finite"), 2.5, 2.5)
    shift = np.random.default_rng(0).uniform(*response_surface.workspace(design, law), (1000, 3)).T
    shift[:, 0] = response_surface.workspace(design, law)[1]
    least, most = law.lean
    held = np.hypot(*forward_model.rotation(law.tilt, shift)) / np.hypot(*shift[:2])
    free = polyval2d((shift[:2] ** 2).sum(axis=0), shift[2], law.tau)
    assert held.max() <= (2 * most - least) * (1 + 1e-12)
    assert free.max() > 10 * most
    inside = (least <= free) & (free <= most)
    assert inside.sum() > 100
    assert_allclose(held[inside], free[inside], rtol=1e-10)


# Readings one at a time give what the decoder gives for all of them.


THIN = Design(D=6.7, L=7.1, magnet_diameter=5, magnet_height=3, l0=4.9, hall_layout="tle493d-p2b6")
"""Beyond its samples the polynomial of this sensor's tilt exceeds 100 rad."""
LEAST_RATE = 2000
"""Readings a second of processor time."""


@pytest.mark.parametrize(
    "design",
    [paper(), FOLDED, Design(hall_layout="tmag5273a1"), Design(hall_plate=0.5), THIN],
    ids=["paper", "folded", "chip", "plates", "thin layer"],
)
def test_a_stream_is_the_decoder_and_fast(design):
    law = decode_readings.of_level(design, "finite") if design == THIN else tilting(design)
    coder, t = decode.decoder(design, law), np.linspace(0, 10, 400)
    # presses and shears through the workspace, from rest on
    path = 0.7 * np.array(coder.high)[:, None] * np.stack([np.sin(1.1 * t), np.sin(1.7 * t), 0 * t])
    path[2] = 0.45 * coder.low[2] * (1 - np.cos(0.6 * t))
    field = forward_model.readings_at(coder.forward, path).T
    field[7], field[11], field[13] = 1.0, np.nan, 0.0
    rows, follower = list(map(tuple, field.tolist())), stream.Stream(coder)
    follower.step(rows[0])
    # this compiles, in a new installation, what a stream needs
    expected = decode.decode(coder, rows, follow=True)
    begin = time.process_time()
    found = [follower.step(row) for row in rows]
    assert len(rows) / (time.process_time() - begin) > LEAST_RATE
    assert [sample.status for sample in found] == expected.status
    assert [sample.multiplicity for sample in found] == expected.multiplicity.tolist()
    for name in ("shift", "tilt", "force"):
        assert_allclose([getattr(sample, name) for sample in found], getattr(expected, name), atol=2e-8)


PRESSES = [(load, bent(load)) for load in map(Load, DEPTHS)]
ASIDE = [(load, bent(load)) for load in (Load(1.0, s, friction="stick") for s in SHEARS)]
SLID = dataclasses.replace(ASIDE[0][0], friction=0.3), ASIDE[0][1]
HELD = Load(shear_x=0.5, grip=1.0), ASIDE[0][1]
CROSSED = Load(1, 1, friction="stick"), Response((1, 0, 1), (0.5, 0.5, -1), 0, 1)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: decode.decoder(Design(magnet_diameter=0, magnet_height=0)), "no magnet"),
        (lambda: forward_model.slopes_at(Design(magnet_diameter=0, magnet_height=0), (0,) * 3, (0, 0)), "no magnet"),
        (lambda: decode.decoder(Design(l0=3.0, c=0.0)), "inside the beam"),
        (lambda: decode.decoder(paper(), elements=()), "three readings"),
        (lambda: decode.decoder(paper(), workspace=([0, 0, 0], [1, 1, 0])), "positive size"),
        (lambda: decode.decoder(paper(), workspace=([0, 0, np.nan], [1, 1, 0])), "positive size"),
        (lambda: stream.Stream(decode.decoder(paper())).step((0.01, 0.01)), "readings must have shape"),
        (lambda: response_surface.of_samples(PRESSES), "both presses and shears"),
        (lambda: response_surface.of_samples([CROSSED]), "along the shear"),
        (lambda: response_surface.of_samples([*PRESSES, *ASIDE, SLID]), r"one friction; got 0\.3 and stick"),
        (lambda: response_surface.of_samples([*PRESSES, HELD]), "no grip"),
    ],
)
def test_designs_readings_and_states_that_make_no_decoder_are_refused(call, words):
    with pytest.raises(BadInput, match=words):
        call()
