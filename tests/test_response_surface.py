"""Forces between a few states of a model: no fold, no tension, what the states must have, and shifts under forces."""

import dataclasses

import numpy as np
import pytest
from numpy.polynomial.polynomial import polyder, polyval2d
from numpy.testing import assert_allclose

from analytic import beam, decode, stream
from analytic.inverse import forward_model, response_surface
from geometry.design import BadInput, Design, paper
from geometry.loads import Load, Response

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

    law = response_surface.of_formula(contact, 3.0, 3.0)
    assert law.errors[0] < 1e-10
    assert law.errors[2] < 1e-10
    assert law.errors[3] < 0.02
    states = [(load, contact(load)) for load in (Load(1.0), Load(2.0), Load(2.0, 1.0, friction="stick"))]
    few = response_surface.of_samples(states)
    assert max(few.errors) < 1e-6
    with pytest.raises(BadInput, match="both presses and shears"):
        response_surface.of_samples(states[:2])
    with pytest.raises(BadInput, match="along the shear"):
        response_surface.of_samples([(Load(1, 1, friction="stick"), Response((1, 0, 1), (0.5, 0.5, -1), 0, 1))])


def test_shears_of_unlike_contact_make_no_law():
    press = [(Load(depth=d), bent(Load(depth=d))) for d in DEPTHS]
    shears = [(load, bent(load)) for load in (Load(1.0, s, friction="stick") for s in SHEARS)]
    slid = (dataclasses.replace(shears[0][0], friction=0.3), shears[0][1])
    held = (Load(shear_x=0.5, grip=1.0), shears[0][1])
    with pytest.raises(BadInput, match=r"one friction; got 0\.3 and stick"):
        response_surface.of_samples([*press, *shears, slid])
    with pytest.raises(BadInput, match="no grip"):
        response_surface.of_samples([*press, held])


@pytest.fixture(scope="module", params=["paper", "finite"])
def level_law(request):
    return response_surface.of_formula(lambda load: beam.solve(paper(), load, request.param), 2.0, 2.0)


def test_forces_come_back(level_law):
    low, high = response_surface.workspace(paper(), level_law)
    normal, tangential = (v.ravel() for v in np.meshgrid(np.linspace(0.5, 3, 6), np.linspace(0, 0.6, 5)))
    u, w = response_surface.shifts_of_forces(level_law, low, high, tangential, normal)
    force, _ = response_surface.forces(level_law, np.stack([u, np.zeros_like(u), w]))
    assert_allclose(force[0], tangential, atol=1e-7)
    assert_allclose(force[2], normal, atol=1e-7)
    assert (w < 0).all()


def test_no_force_is_rest(level_law):
    low, high = response_surface.workspace(paper(), level_law)
    shifts = response_surface.shifts_of_forces(level_law, low, high, np.array([0.0, 0.0]), np.array([0.0, 1.0]))
    assert_allclose(np.array(shifts)[:, 0], 0, atol=1e-9)


def test_forces_beyond_the_mechanics_have_no_shift(level_law):
    low, high = response_surface.workspace(paper(), level_law)
    u, w = response_surface.shifts_of_forces(
        level_law, low, high, np.array([0.0, 50.0, 0.0]), np.array([1.0, 1.0, 500.0])
    )
    assert np.isfinite([u[0], w[0]]).all()
    assert np.isnan([u[1:], w[1:]]).all()


def test_shears_at_few_depths_do_not_oscillate_between_them():
    depths = [Load(depth) for depth in (0.2, 0.4, 0.7, 0.9, 1.0, 1.3)]
    shears = [Load(depth, shear, friction="stick") for depth in (0.4, 0.8, 1.2) for shear in (0.3, 0.7, 1.2)]
    law = response_surface.of_samples((load, beam.solve(paper(), load, "finite")) for load in (*depths, *shears))
    truth = beam.solve(paper(), Load(1.0, 0.5, friction="stick"), "finite")
    force, *_ = response_surface.force_and_load(law, np.array([truth.shift]).T)
    assert_allclose(force[0, 0], truth.force[0], rtol=0.02)


def test_beyond_its_samples_a_tilt_stays_near_their_range():
    """Without the range, the polynomial turns this magnet by 60 rad at the upper corner of the workspace."""
    design = Design(D=6.7, L=7.1, magnet_diameter=5, magnet_height=3, l0=4.9, hall_layout="tle493d-p2b6")
    law = response_surface.of_formula(lambda load: beam.solve(design, load, "finite"), 2.5, 2.5)
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
