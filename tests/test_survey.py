"""The workspace: its survey, force resolution and clearances, against differences, searches and samples of noise."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from analytic import clearance, decode, parts, survey
from analytic.clearance import magnet_gaps, wall_gaps, warnings
from analytic.force_resolution import at_shifts, force_resolution
from analytic.inverse import forward_model, pose_search
from geometry.design import BadInput, Design, paper
from studies.sensing import decode_readings

FOLDED = Design(magnet_height=4.0, l0=6.0, c=2.5, hall_low=0, hall_null=50, hall_high=100)


def prepared(design, level="paper", **options):
    elements, _ = parts.with_noise(parts.of_design(design))
    return decode.decoder(design, decode_readings.of_level(design, level), elements=elements, **options)


@pytest.mark.parametrize("level", ["paper", "finite"])
@pytest.mark.parametrize("layout", ["three", "tmag5273a1"])
def test_condition_sign_and_noise_are_those_of_differences(level, layout):
    coder = prepared(Design(hall_layout=layout), level)
    seen = survey.survey(coder, (3, 3, 4), multiplicity=False)
    step = 1e-5
    numeric = np.array(
        [
            (
                forward_model.readings_at(coder.forward, seen.shift + e)
                - forward_model.readings_at(coder.forward, seen.shift - e)
            )
            / (2 * step)
            for e in step * np.eye(3)[:, :, None]
        ]
    )
    jacobians = np.moveaxis(numeric, 2, 0).swapaxes(1, 2)
    assert (np.sign(np.linalg.det(jacobians)) == seen.sign).all()
    assert_allclose(seen.condition, np.linalg.cond(jacobians), rtol=1e-5)
    covariance = np.linalg.inv(jacobians) @ np.diag(coder.sigma**2) @ np.linalg.inv(jacobians).swapaxes(1, 2)
    assert_allclose(seen.noise_mm, np.sqrt(np.linalg.eigvalsh(covariance)[:, -1]), rtol=1e-5)


def exhaustive(coder, field):
    """All poses of one set of readings, from starts all over the workspace."""
    field = np.ascontiguousarray(field)
    axes = [np.linspace(a + 0.01, b - 0.01, n) for a, b, n in zip(coder.low, coder.high, (11, 11, 6), strict=True)]
    starts = np.stack(np.meshgrid(*axes, indexing="ij")).reshape(3, -1).T
    goal = coder.goal._replace(floor=coder.low - 0.5, roof=coder.high + 0.5)
    ends = [
        pose_search.newton(start, np.inf, field, coder.forward.kernel, goal) for start in np.ascontiguousarray(starts)
    ]
    found = np.array([shift[0] if end == pose_search.POSE else np.full(3, np.nan) for end, shift, _ in ends])
    inside = (found > coder.low - 1e-6).all(axis=1) & (found < coder.high + 1e-6).all(axis=1)
    distinct = []
    for pose in found[inside]:
        if all(np.abs(pose - other).max() > 2e-5 for other in distinct):
            distinct.append(pose)
    return np.array(distinct)


def test_multiplicity_is_that_of_an_exhaustive_search():
    coder = prepared(FOLDED)
    seen = survey.survey(coder, (5, 5, 4))
    assert {-1, 1} <= set(seen.sign)
    several = np.flatnonzero(seen.multiplicity > 1)
    single = np.flatnonzero(seen.multiplicity == 1)
    assert min(len(several), len(single)) > 10
    for k in (*several[::2], *single[::8]):
        every = exhaustive(coder, seen.readings[:, k])
        assert len(every) == seen.multiplicity[k]
        assert np.linalg.norm(every - seen.shift[:, k], axis=1).max() == pytest.approx(seen.alike_mm[k], abs=1e-5)


def test_shares_are_of_the_workspace():
    """By the trapezoidal rule: of three layers the outer ones weigh a quarter each."""
    seen = survey.survey(prepared(paper()), (3, 3, 3), multiplicity=False)
    assert seen.weight.sum() == pytest.approx(1)
    assert seen.share(seen.shift[0] > 0) == pytest.approx(0.25)
    assert seen.share(seen.shift[0] >= 0) == pytest.approx(0.75)
    assert not seen.folded


def test_what_is_in_the_way():
    coder = prepared(Design(l0=5.2, c=2.0, f=4.5))
    seen = survey.survey(coder, (9, 9, 4), multiplicity=False)
    for k in (0, 100, 200, 300):
        shift, tilt = seen.shift[:, k][None], seen.tilt[:, k][None]
        for i, element in enumerate(coder.forward.elements):
            gap = clearance.magnet_gaps(coder.forward.design, element.position, shift, tilt)[0]
            assert seen.magnet_hits[i, k] == (gap == 0)
            wall = clearance.wall_gaps(coder.forward.design, element.position, shift)[0] < 0
            assert seen.wall_hits[i, k] == (wall and element.position[2] >= 0)
    assert seen.wall_hits.any()
    assert not seen.grounded.any()
    assert not seen.usable[seen.blocked].any()


def test_only_what_the_mechanics_know_counts():
    coder = prepared(paper(), "finite")
    seen = survey.survey(coder, (9, 9, 6), multiplicity=False)
    x, y, z = seen.shift[:, seen.weight > 0]
    assert np.hypot(x, y).max() <= coder.mechanics.reach * (1 + 1e-9)
    assert z.max() < 0
    flat = prepared(paper(), "finite", ignore_tilt=True)
    assert survey.known(flat, seen.shift).all()
    with pytest.raises(BadInput, match="the tilt is not known at any pose"):
        survey.at_poses(coder, np.array([[0.0], [0.0], [0.1]]), np.ones(1), (1, 1, 1))


NOISE = np.array([0.01, 0.02, 0.03])


def slopes(n, m, seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, m, 3)), rng.normal(size=(n, 3, 3))


@pytest.mark.parametrize("m", [3, 5])
def test_is_the_spread_of_weighted_least_squares(m):
    """Samples of the noise, decoded one by one: 1e5 samples give the spread to 0.7 % (three standard errors)."""
    (J,), (K,) = slopes(1, m)
    noise = np.linspace(0.01, 0.05, m)
    errors = noise * np.random.default_rng(1).standard_normal((100_000, m))
    q = np.linalg.lstsq(J / noise[:, None], (errors / noise).T, rcond=None)[0]
    assert_allclose(force_resolution(J[None], K[None], noise)[0], (K @ q).std(axis=1), rtol=7e-3)


def test_coordinates_of_the_pose_do_not_matter():
    J, K = slopes(20, 4)
    change = np.random.default_rng(2).normal(size=(3, 3)) @ np.diag([1.0, 1e-3, 1e4])
    noise = np.full(4, 0.1)
    assert_allclose(force_resolution(J @ change, K @ change, noise), force_resolution(J, K, noise), rtol=1e-9)


def test_what_the_readings_do_not_determine_is_infinite_and_nothing_else():
    """No reading changes along y: a reading more for x and z, and F_y alone changes along y."""
    J = np.array([[1.0, 0, 0], [0, 0, 1.0], [1.0, 0, 1.0]])
    rest = force_resolution(J[None], np.diag([1.0, 1.0, 2.0])[None], NOISE)[0]
    assert np.isinf(rest[1])
    assert np.isfinite(rest[[0, 2]]).all()
    mixed = force_resolution(J[None], np.array([[[1.0, 0.5, 0], [0, 0, 0], [0, 0, 1.0]]]), NOISE)[0]
    assert np.isinf(mixed[0])
    assert mixed[1] == 0


def test_no_slope_at_all_and_no_pose():
    J, K = slopes(2, 3)
    J[0], J[1, 0, 0] = 0, np.nan
    answer = force_resolution(J, K, NOISE)
    assert_array_equal(np.isinf(answer), [[True] * 3, [False] * 3])
    assert_array_equal(np.isnan(answer), [[False] * 3, [True] * 3])


@pytest.mark.parametrize(("m", "noise", "words"), [(2, [1, 1], "m of at least 3"), (3, [1, 0, 1], "above 0; got 0")])
def test_too_few_readings_and_no_noise_are_refused(m, noise, words):
    with pytest.raises(BadInput, match=words):
        force_resolution(np.ones((1, m, 3)), np.ones((1, 3, 3)), np.array(noise))


def test_resolution_at_shifts_is_the_noise_that_the_decoder_states():
    design = Design(hall_noise=1e-3)
    law = decode_readings.of_level(design, "finite")
    coder = decode.decoder(design, law)
    shift = np.array([[0.5, -0.3, -0.6], [0.0, 0.0, -0.2]])
    fields = forward_model.readings_with_slopes(coder.forward, shift.T)[0].T
    sigma = at_shifts(coder.forward, law, shift)
    assert_allclose(sigma, decode.decode(coder, fields).noise_N, rtol=1e-4)
    quiet = forward_model.model(paper(), law.tilt)
    assert np.isnan(at_shifts(quiet, law, shift)).all()
    limited = forward_model.model(Design(hall_noise=1e-3, hall_high=2.6), law.tilt)
    assert np.isinf(at_shifts(limited, law, shift)).any()


REST = (0.0, 0.0, 0.0)


def magnet_gap(design, point, shift, tilt):
    return magnet_gaps(design, point, np.array([shift]), np.array([tilt]))[0]


def wall_gap(design, point, shift):
    return wall_gaps(design, point, np.array([shift]))[0]


def test_gaps_at_rest():
    s1, s2 = (0, 0, -2.2), (5, 0, -0.2)
    assert magnet_gap(paper(), s1, REST, (0, 0)) == pytest.approx(7.2 - 1)
    assert magnet_gap(paper(), s2, REST, (0, 0)) == pytest.approx(math.hypot(3, 4.2))
    assert wall_gap(paper(), s2, REST) == pytest.approx(1)
    assert wall_gap(paper(), s1, REST) == math.inf


def test_the_column_keeps_its_volume():
    """The mean of 6 t (1 - t) is 1, and its greatest 1.5."""
    widest = 50 - wall_gap(Design(L=24.0), (50.0, 0.0, -1.0), (0, 0, -1))
    assert widest**2 == pytest.approx(16 * (1 + 1.5 * (20 / 19 - 1)), rel=1e-3), "half way up"


@pytest.mark.parametrize(
    ("design", "shift", "words"),
    [
        (paper(), REST, []),
        (paper(), (2.0, 0.0, -0.5), ["the beam's wall extends over S2 by about"]),
        (Design(l0=4.0, f=3.0), REST, ["S3", "the beam's wall overlaps S2 by", "S1"]),
        (paper(), (0.0, 0.0, -6.5), ["2.5 mm below the base plane", "S1 touches or overlaps the magnet"]),
        (paper(), (0.0, 0.0, -60.0), ["the magnet's lowest point is 56 mm below the base plane: no press reaches"]),
    ],
)
def test_what_is_in_the_way_is_said(design, shift, words):
    found = warnings(design, shift, (0, 0))
    assert [word in text for word, text in zip(words, found, strict=True)] == [True] * len(words)


def test_a_wall_that_is_not_known_is_said_to_be_so():
    """A long magnet that lies on its side fits where it could not stand."""
    long = Design(L=9.0, magnet_diameter=1.0, magnet_height=6.0)
    found = warnings(long, (0.0, 0.0, -3.0), (1.2, 0.0))
    for name in ("S2", "S3"):
        assert any(f"whether the beam's wall touches {name} is not known" in text for text in found)
    assert not any("is not known" in text for text in warnings(long, (0.0, 0.0, -1.0), (1.2, 0.0)))


def test_on_a_fold_the_noise_is_infinite():
    """Where two of three elements are one, no reading tells a direction of the pose."""
    spread = np.full((3, 3, 2), np.inf)
    spread[:, :, 1] = np.diag([1.0, 2.0, 3.0])
    assert survey._largest_singular_value(spread).tolist() == [np.inf, 3.0]


@pytest.mark.filterwarnings("error")
def test_the_wall_ends_where_the_magnet_stands_on_the_base():
    """At H + z = h/2; a beam stretched beyond the estimate still has one."""
    s2 = (5.0, 0.0, -0.2)
    assert math.isfinite(wall_gap(paper(), s2, (0.0, 0.0, -4.0)))
    assert math.isnan(wall_gap(paper(), s2, (0.0, 0.0, -4.001)))
    assert wall_gap(paper(), (paper().f, 0.0, 1.0), (0.0, 0.0, 1e9)) > 0
