"""Published problems at a reduced size. Meshes are coarse: each tolerance is the mesh's, checked by refinement."""

import numpy as np
import pytest
import skfem

from fem import elements
from fem.contact import Plate
from fem.linear import Solver
from fem.material import lame
from fem.newton import newton
from fem.system import System

NONE = np.empty(0, dtype=np.int64)


def facet_loads(mesh, e, name, traction, *, axisymmetric=False):
    """Nodal forces of a dead traction (dim,) on a named boundary."""
    s = elements.surface(mesh, name, e, axisymmetric=axisymmetric, order=4)
    dead = np.zeros(e.nodes.shape)
    np.add.at(dead, s.nodes, (s.weights @ s.shape)[..., None] * np.asarray(traction))
    return dead


def ramp(system, dead, steps):
    """Solve under growing dead loads; returns the last state."""
    solver, q = Solver(), np.zeros(system.size)
    for factor in np.linspace(0, 1, steps + 1)[1:]:
        system.dead = factor * dead
        answer = newton(system, solver, q, None)
        assert answer.converged, answer.reason
        q = answer.state.q
    return answer.state


def cook(n):
    """Tip deflection of Cook's membrane: plane strain, E = 3 MPa, incompressible, 0.05 MPa upwards on the right."""
    square = skfem.MeshTri.init_tensor(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    x, y = square.p
    mesh = skfem.MeshTri(np.stack([48 * x, 44 * x + y * (44 - 28 * x)]), square.t)
    mesh = skfem.MeshTri2.from_mesh(mesh).with_boundaries(
        {"left": lambda x: x[0] < 1e-9, "right": lambda x: x[0] > 48 - 1e-9}
    )
    e = elements.build(mesh, axisymmetric=False)
    fixed = np.repeat((e.nodes[:, 0] < 1e-9)[:, None], 2, axis=1)
    system = System(e, None, *lame(3.0, 0.5), fixed, NONE, np.zeros(2))
    state = ramp(system, facet_loads(mesh, e, "right", (0, 0.05)), 2)
    corner = np.argmin(np.hypot(e.nodes[:, 0] - 48, e.nodes[:, 1] - 60))
    return state.u[corner, 1]


def test_cooks_membrane():
    """u_y(48, 60) = 4.701 to 0.2 %: Elmer's test after Mueller 2015. The clamped corner sets the order, about 1.3."""
    coarse, middle, fine = cook(8), cook(16), cook(32)
    ratio = (middle - coarse) / (fine - middle)
    assert 1.0 < np.log2(ratio) < 1.6
    assert fine + (fine - middle) / (ratio - 1) == pytest.approx(4.701, rel=2e-3)


@pytest.mark.parametrize(("S", "ratio"), [(0.25, 1.1963), (1.0, 2.955), (4.0, 32.36)])
def test_bonded_cylinder(S, ratio):
    """Apparent modulus E_a / E of an incompressible disc, radius R, height 2 h, glued to two plates, S = R / 2h."""
    h, n = 1 / (4 * S), 16
    r = 1 - (1 - np.linspace(0, 1, n + 1)) ** 1.6
    mesh = skfem.MeshTri2.from_mesh(skfem.MeshTri.init_tensor(r, h * r)).with_boundaries(
        {"skin": lambda x: x[1] > h - 1e-9}
    )
    e = elements.build(mesh, axisymmetric=True)
    top = e.nodes[:, 1] > h - 1e-9
    fixed = np.stack([(e.nodes[:, 0] < 1e-9) | top, e.nodes[:, 1] < 1e-9], axis=1)
    skin = elements.surface(mesh, "skin", e, axisymmetric=True, order=5)
    system = System(e, skin, *lame(1.0, 0.5), fixed, NONE, np.zeros(2))
    press, spring = 1e-6 * h, 1e8
    every = np.ones(skin.weights.shape, dtype=bool)
    answer = newton(system, Solver(), np.zeros(system.size), Plate(h - press, spring, np.zeros(1)), every)
    force = answer.assembly.forces[e.nodes[:, 1] < 1e-9, 1].sum()
    shortening = -answer.state.u[top, 1].mean()
    assert force / np.pi / (shortening / h) == pytest.approx(ratio, rel=2e-3)


def test_reese_block():
    """Quarter of a block, dead pressure on the inner quarter of its top, p/p0 = 20, 40: 22, 42.5 % compression."""
    mu, bulk = 80.194, 400889.806 + 2 / 3 * 80.194
    grid = np.linspace(0, 1, 5)
    mesh = skfem.MeshTet2.from_mesh(skfem.MeshTet.init_tensor(grid, grid, grid)).with_boundaries(
        {"pressed": lambda x: (x[2] > 1 - 1e-9) & (x[0] < 0.5) & (x[1] < 0.5)}
    )
    e = elements.build(mesh, axisymmetric=False)
    fixed = e.nodes < 1e-9
    fixed[e.nodes[:, 2] > 1 - 1e-9, :2] = True
    system = System(e, None, mu, 1 / bulk, fixed, NONE, np.zeros(3))
    dead = facet_loads(mesh, e, "pressed", (0, 0, -4.0))
    corner = np.argmin(np.linalg.norm(e.nodes - [0, 0, 1], axis=1))
    for level, compression in ((20, 0.2200), (40, 0.4256)):
        state = ramp(system, level * dead, level // 5)
        assert -state.u[corner, 2] == pytest.approx(compression, abs=0.01)
