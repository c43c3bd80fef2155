"""Solid bodies of harmonic solutions: volume, exact motions, pressures, no seams, and the user's frame."""

import math

import numpy as np
import pytest
import skfem

from fem.accuracy import QUICK
from fem.equilibrium import trace
from fem.model import angular_fields
from fem.results import revolved_body
from fem.solution import Field
from geometry.cad import beam_volume, magnet_volume
from geometry.design import paper
from geometry.loads import Load
from geometry.section import section


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
