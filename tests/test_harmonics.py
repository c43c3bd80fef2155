"""Sections with Fourier orders: rotations of the load, orders that are added, and solid bodies made of them."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest
import skfem

from fem.accuracy import QUICK
from fem.equilibrium import trace
from fem.model import angular_fields, rigid_inclusion
from fem.model.plate_contact import KAPPA
from fem.model.symmetry_models import raise_harmonics
from fem.results import revolved_body
from fem.results.postprocess import read_pose, tip_force
from fem.scene import Scene
from fem.solution import Field
from fem.solve.load_case_models import PRESS_FILLET, path_models
from fem.solve.load_stepping import Path
from geometry.cad import beam_volume, magnet_volume
from geometry.design import paper
from geometry.loads import Load
from geometry.section import section

ROUGH = replace(QUICK, name="rough", section_size=0.4, section_patch=0.1, harmonics=1)
GLUED = Load(depth=0.6, plate_tilt=0.15, shear_x=0.5, friction="stick")
RUBBED = replace(GLUED, friction=0.4)
UPRIGHT = replace(GLUED, plate_tilt=0.0)


@functools.cache
def answer(load, *, sines):
    """Force and pose in the user's axes (8,), in units of D and E, with or without sine orders."""
    scene = Scene(paper(), (load,), ROUGH)
    models = path_models(scene)
    # one order is enough to see a symmetry
    first, raised = (
        model
        and replace(
            model, harmonics=min(model.harmonics, 1), sines=sines and model.harmonics > 0, fillet=PRESS_FILLET
        )
        for model in (models.first, models.raised)
    )
    models = replace(models, first=first, raised=raised, predictor=None, kappa=KAPPA)
    path = Path(models)
    reached = path.advance(path.rest, np.array([load.depth, *load.imposed_shear]) / 8)
    state = reached.state
    assert not reached.stop
    return np.concatenate([tip_force(state), *read_pose(state.d, state.u, state.q)])


def turned(values, angle):
    """Force and pose of a state that is rotated about z."""
    c, s = math.cos(angle), math.sin(angle)
    once = np.array([[c, -s], [s, c]])
    values = values.copy()
    for at in (0, 3, 6):
        values[at : at + 2] = once @ values[at : at + 2]
    return values


@pytest.mark.parametrize("load", [GLUED, RUBBED])
def test_sine_orders_leave_a_symmetric_load_as_it_is(load):
    np.testing.assert_allclose(answer(load, sines=True), answer(load, sines=False), atol=1e-10)


def test_a_quarter_turn_of_the_shear_turns_the_answer():
    other = answer(replace(UPRIGHT, shear_x=0.0, shear_y=0.5), sines=True)
    np.testing.assert_allclose(other, turned(answer(UPRIGHT, sines=True), math.pi / 2), atol=1e-10)


def test_half_a_turn_of_tilt_and_shear_turns_the_answer():
    load = replace(GLUED, shear_x=0.3, shear_y=0.4)
    other = answer(replace(load, plate_tilt=-0.15, shear_x=-0.3, shear_y=-0.4), sines=True)
    np.testing.assert_allclose(other, turned(answer(load, sines=True), math.pi), atol=1e-10)


def build(harmonics, sines):
    scene = Scene(paper(), (GLUED,), ROUGH)
    return replace(path_models(scene).first, harmonics=harmonics, sines=sines).build()


@pytest.mark.parametrize(("low", "high"), [((0, False), (1, False)), ((1, False), (2, True)), ((1, True), (2, True))])
def test_a_state_keeps_its_energy_with_more_orders(low, high):
    one, other = build(*low).system, build(*high).system
    # small, so that both numbers of angles integrate its energy
    q = 1e-7 * np.random.default_rng(1).normal(size=one.size)
    raised = raise_harmonics(one, other, q)
    energy = one.assemble(one.state(q), None, tangent=False).energy
    assert other.assemble(other.state(raised), None, tangent=False).energy == pytest.approx(energy, rel=1e-8)


@pytest.mark.parametrize("harmonics", [1, 2])
def test_the_magnet_moves_as_a_solid_does(harmonics):
    """Sine orders contain finite rotations about any axis."""
    angles = angular_fields.fourier_fields(harmonics, sines=True)
    arms, motion = np.array([[0.1, 0.2], [0.3, -0.1]]), 0.3 * np.arange(1, 7)
    fields = rigid_inclusion.of_section(arms, angles).displacement(motion)
    cartesian = np.einsum("ijt,tjf->tif", angular_fields.rotations(angles.theta), angles.E)
    moved = np.einsum("tif,nf->tni", cartesian, fields).reshape(-1, 3)
    c, s = np.cos(angles.theta)[:, None], np.sin(angles.theta)[:, None]
    places = np.stack([arms[:, 0] * c, arms[:, 0] * s, arms[:, 1] + 0 * c], axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(moved, rigid_inclusion.of_solid(places, 6).displacement(motion), atol=1e-12)


def field(N, w, z, p=lambda n, r, z: 0 * r, magnet="hole"):
    """A field of N harmonics on the paper's section, from functions w(k, r, z), z(n, r, z), p(n, r, z)."""
    mesh = section(paper().shape, 1.0, magnet=magnet)
    x = mesh.doflocs
    vertices = np.unique(mesh.dofs.element_dofs[:3])
    n = range(N + 1)
    u = np.stack([*(w(k, *x) for k in angular_fields.orders(N)), *(z(k, *x) for k in n)], axis=1)
    pressures = np.stack([p(k, *x[:, vertices]) for k in n], axis=1)
    return Field(mesh=mesh, u=u, p=pressures, vertices=vertices, angles=angular_fields.fourier_fields(N))


def rigid(N, phi, move):
    """Translation, and rotation by phi about y through the origin; see `fem.model.rigid_inclusion`."""

    def w(k, r, z):
        if k == -1:
            return move[0] + z * math.sin(phi)
        return r * (math.cos(phi) - 1) / 2 if k in (-2, 0) else 0 * r

    def rise(n, r, z):
        return (move[1] + z * (math.cos(phi) - 1), -r * math.sin(phi), 0 * r, 0 * r)[n]

    return field(N, w, rise)


@pytest.mark.parametrize("magnet", ["hole", "none"])
def test_volume_is_that_of_the_silicone(magnet):
    solid = revolved_body.revolve(field(2, lambda k, r, z: 0 * r, lambda n, r, z: 0 * r, magnet=magnet))
    dx = skfem.Basis(solid.mesh, skfem.ElementTetP2(), intorder=6).dx
    shape = paper().shape
    silicone = beam_volume(shape) - (magnet_volume(shape) if magnet == "hole" else 0.0)
    assert dx.min() > 0
    assert 2 * dx.sum() == pytest.approx(silicone, rel=1e-3)


@pytest.mark.parametrize("N", [1, 3])
def test_rigid_motions_are_exact(N):
    phi, move = 0.3, (0.7, -0.2)
    solid = revolved_body.revolve(rigid(N, phi, move))
    turn = np.array([[math.cos(phi), 0, math.sin(phi)], [0, 1, 0], [-math.sin(phi), 0, math.cos(phi)]])
    exact = solid.mesh.doflocs.T @ (turn - np.eye(3)).T + [move[0], 0, move[1]]
    assert np.abs(solid.u - exact).max() < 1e-12


def test_outer_faces_are_skin_base_magnet_or_the_plane_of_symmetry():
    """A seam, or a node that is there twice, would show as an outer face inside the silicone."""
    given = rigid(2, 0.0, (0.0, 0.0))
    mesh = revolved_body.revolve(given).mesh
    outer = mesh.p[:, mesh.facets[:, mesh.boundary_facets()]]
    x, y, z = outer[:, :, np.abs(outer[1]).max(axis=0) > 1e-9]
    edge = given.mesh.p[:, np.unique(given.mesh.facets[:, given.mesh.boundary_facets()])]
    distance = np.abs((np.hypot(x, y) + 1j * z)[..., None] - edge[0] - 1j * edge[1])
    assert distance.min(axis=2).max() < 1e-9


def test_body_lies_in_the_users_frame():
    load = Load(grip=2.0, shear_x=1.0, shear_y=-1.0)
    (solution,) = trace(paper(), [load], QUICK, magnet="ignored", estimate=False)
    assert solution.model == "harmonic"
    assert solution.load.direction == pytest.approx((math.sqrt(0.5), -math.sqrt(0.5)))
    solid = revolved_body.place(solution)
    top = np.argmax(solid.mesh.doflocs[2])
    assert solid.u[top, :2] == pytest.approx([1.0, -1.0], abs=2e-3)
    # the half that is kept lies on one side of the plane of the shear
    assert (solid.mesh.doflocs[:2].sum(axis=0)).min() > -1e-9
