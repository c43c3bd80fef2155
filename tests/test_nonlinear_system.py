"""The discrete system: blocks with known answers, residual and tangent against finite differences."""

from dataclasses import replace

import numpy as np
import pytest
import skfem

from fem.model import angular_fields, elements, rigid_inclusion
from fem.model.material import lame
from fem.model.nonlinear_system import NONE, System
from fem.model.plate_contact import Bond, Plate
from fem.model.symmetry_models import MeshSpecification
from fem.solve.direct_solver import Solver
from fem.solve.newton import newton
from geometry.design import Design
from geometry.section import section

RNG = np.random.default_rng(2)


def cylinder(nu=0.4998, n=2):
    """A block of radius 1 and height 1 on (r, z), free to slip on its base, skin = top."""
    mesh = skfem.MeshTri2.from_mesh(skfem.MeshTri.init_tensor(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1)))
    mesh = mesh.with_boundaries({"skin": lambda x: x[1] > 1 - 1e-9})
    e = elements.build(mesh, axisymmetric=True)
    fixed = np.stack([e.nodes[:, 0] < 1e-9, e.nodes[:, 1] < 1e-9], axis=1)
    skin = elements.surface(mesh, "skin", e, axisymmetric=True, order=5)
    return System(e, skin, lame(1.0, nu), fixed)


def cube(nu=0.4998):
    """A unit cube with three mirror planes, skin = top."""
    mesh = skfem.MeshTet2.from_mesh(skfem.MeshTet.init_tensor(*[np.linspace(0, 1, 2)] * 3))
    mesh = mesh.with_boundaries({"skin": lambda x: x[2] > 1 - 1e-9})
    e = elements.build(mesh, axisymmetric=False)
    skin = elements.surface(mesh, "skin", e, axisymmetric=False, order=4)
    return System(e, skin, lame(1.0, nu), e.nodes < 1e-9)


def half_ball():
    """Silicone y >= 0 around a rigid core at the centre of a cube; skin = top."""
    grid = np.linspace(-1, 1, 5)
    mesh = skfem.MeshTet.init_tensor(grid, np.linspace(0, 1, 3), grid)
    middle = mesh.p[:, mesh.t].mean(axis=1)
    mesh = mesh.remove_elements(np.flatnonzero(np.abs(middle).max(axis=0) < 0.5))
    mesh = skfem.MeshTet2.from_mesh(mesh).with_boundaries({"skin": lambda x: x[2] > 1 - 1e-9})
    e = elements.build(mesh, axisymmetric=False)
    fixed = np.zeros(e.nodes.shape, dtype=bool)
    fixed[e.nodes[:, 2] < -1 + 1e-9] = True
    fixed[e.nodes[:, 1] < 1e-9, 1] = True
    core = np.flatnonzero(np.abs(e.nodes).max(axis=1) < 0.5 + 1e-9)
    skin = elements.surface(mesh, "skin", e, axisymmetric=False, order=4)
    return System(e, skin, lame(1.0, 0.49), fixed, (core, rigid_inclusion.of_solid(e.nodes[core], 3)))


def sensor(harmonics=0):
    return (
        MeshSpecification(
            Design().shape.scaled(1 / 8), 0.4998, "rigid", 0.16, 0.08, rim=(0.2, 0.04), harmonics=harmonics
        )
        .build()
        .system
    )


PRESS = {"cylinder": 1.0, "cube": 1.0, "half ball": 1.0, "sensor": 1.125, "one harmonic": 1.125, "harmonics": 1.125}
SCENES = {
    "cylinder": cylinder,
    "cube": cube,
    "half ball": half_ball,
    "sensor": sensor,
    "one harmonic": lambda: sensor(1),
    "harmonics": lambda: sensor(3),
}


def plate(name, depth, shear=0.0, tilt=0.0):
    system = SCENES[name]()
    return system, Plate(PRESS[name] - depth, 50.0, np.array([shear, 0.0]), tilt)


def smooth(system):
    """Unknowns of a smooth displacement that inverts no element, and random pressures."""
    x = system.elements.nodes
    wave = 0.001 * np.sin(x @ RNG.normal(size=(x.shape[1], system.fixed.shape[1])) + 1)
    if system.elements.angles.harmonics:
        wave *= 3 * x[:, :1] * x[:, 1:]
    q = 0.1 * RNG.normal(size=system.size)
    q[: system.n_free] = wave[system.free]
    q[system.n_free : system.n_free + system.n_rigid] = 0.001
    return q


@pytest.mark.parametrize("make", [cylinder, cube])
@pytest.mark.parametrize("depth", [1e-6, 0.2, 0.5])
def test_uniaxial_press_of_a_block_has_its_closed_form(make, depth):
    """Nominal stress mu (s - s^-2) of an incompressible block; the plate's penalty is part of the answer."""
    system = make(nu=0.5)
    spring = 1e6
    flat = Plate(1 - depth, spring, np.zeros(2))
    answer = newton(system, Solver(), np.zeros(system.size), flat, np.ones(system.surface.weights.shape, bool))
    assert answer.converged
    shortening = -answer.state.u[:, -1].min()
    s = 1 - shortening
    force = answer.assembly.forces[system.elements.nodes[:, -1] < 1e-9, -1].sum()
    expected = shortening * (1 + s + s**2) / s**2 / 3 * system.surface.weights.sum()
    assert force == pytest.approx(expected, rel=1e-8)


def test_compressible_uniaxial_block():
    """nu = 0.3: the free lateral stretch of P_rr = 0, solved by a scalar equation."""
    from scipy.optimize import brentq

    mu, inverse_K = lame(1.0, 0.3)

    def stress(t, s):
        J = t * t * s
        I1 = 2 * t * t + s * s
        W = mu * J ** (-2 / 3)
        return [W * (x - I1 / 3 / x) + (J - 1) / inverse_K * J / x for x in (t, s)]

    system = cylinder(nu=0.3)
    flat = Plate(0.7, 1e7, np.zeros(2))
    answer = newton(system, Solver(), np.zeros(system.size), flat, np.ones(system.surface.weights.shape, bool))
    s = 1 + answer.state.u[:, 1].min()
    t = brentq(lambda x: stress(x, s)[0], 1.0, 1.5)
    assert answer.state.u[:, 0].max() == pytest.approx(t - 1, rel=1e-9)
    force = 1e7 * (s - 0.7) * np.pi
    assert force == pytest.approx(-stress(t, s)[1] * np.pi, rel=1e-6)


@pytest.mark.parametrize("name", SCENES)
def test_residual_is_the_derivative_of_the_energy_and_tangent_of_the_residual(name):
    system, flat = plate(name, 0.1, 0.05, 0.2 if SCENES[name]().n_rigid != 1 and name != "cylinder" else 0.0)
    tied = RNG.random(system.surface.weights.shape) < 0.3
    flat = replace(flat, bond=Bond(tied, system.surface.points[..., :2]))
    q = smooth(system)
    direction, step = RNG.normal(size=system.size), 1e-7
    if system.elements.angles.harmonics:
        # gradients of fields that do not vanish towards the axis grow like 1/r
        radius = np.broadcast_to(system.elements.nodes[:, :1], system.fixed.shape)
        direction[: system.n_free] *= radius[system.free]
    here = system.assemble(system.state(q), flat)
    ahead = system.assemble(system.state(q + step * direction), flat)
    behind = system.assemble(system.state(q - step * direction), flat)
    assert (ahead.energy - behind.energy) / (2 * step) == pytest.approx(here.residual @ direction, rel=1e-6)
    upper = here.tangent
    full = upper + upper.T
    full.setdiag(upper.diagonal())
    slope = (ahead.residual - behind.residual) / (2 * step)
    np.testing.assert_allclose(full @ direction, slope, atol=2e-5 * np.abs(slope).max())


def test_rigid_body_motion_gives_no_forces():
    mesh = skfem.MeshTet2.from_mesh(skfem.MeshTet())
    e = elements.build(mesh, axisymmetric=False)
    system = System(e, None, lame(1.0, 0.4998), np.zeros(e.nodes.shape, bool))
    u = rigid_inclusion.of_solid(e.nodes - 0.3, 6).displacement(np.array([0.2, -0.1, 0.3, 2.0, -0.7, 0.4]))
    q = np.zeros(system.size)
    q[: system.n_free] = u.ravel()
    here = system.assemble(system.state(q), None)
    assert np.abs(here.residual).max() < 1e-14
    assert abs(here.energy) < 1e-14


@pytest.mark.parametrize("kind", ["axial", "torsion", "harmonic", "planar", "spatial"])
def test_rigid_motion_derivatives(kind):
    body = {
        "axial": lambda: rigid_inclusion.of_section(RNG.normal(size=(4, 2)), angular_fields.fourier_fields(0)),
        "torsion": lambda: rigid_inclusion.of_section(RNG.normal(size=(4, 2)), angular_fields.torsion_fields()),
        "harmonic": lambda: rigid_inclusion.of_section(RNG.normal(size=(4, 2)), angular_fields.fourier_fields(2)),
        "planar": lambda: rigid_inclusion.of_solid(RNG.normal(size=(4, 3)), 3),
        "spatial": lambda: rigid_inclusion.of_solid(RNG.normal(size=(4, 3)), 6),
    }[kind]()
    q, force, step = RNG.normal(size=body.size), RNG.normal(size=body.fields.shape[1:]), 1e-6
    for i in range(body.size):
        e = step * np.eye(body.size)[i]
        slope = (body.displacement(q + e) - body.displacement(q - e)) / (2 * step)
        np.testing.assert_allclose(body.derivative(q)[..., i], slope, atol=1e-8)
        curve = np.einsum("ni,nir->r", force, (body.derivative(q + e) - body.derivative(q - e)) / (2 * step))
        np.testing.assert_allclose(body.curvature(q, force)[i], curve, atol=1e-8)


def stiff_or_rigid(magnet, angles, depth):
    """The paper's sensor, pressed: the magnet rigid ("hole") or silicone 1e5 times stiffer ("meshed"), one mesh."""
    shape = Design().shape.scaled(1 / 8)
    mu, inverse_K = lame(1.0, 0.4998)
    mesh = section(shape, 0.1, tip_size=0.05, magnet=magnet)
    e = elements.build(mesh, axisymmetric=True, angles=angles)
    fixed = np.zeros((len(e.nodes), e.angles.fields), dtype=bool)
    fixed[elements.boundary_nodes(mesh, "base")] = True
    fixed[elements.boundary_nodes(mesh, "axis"), :-1] = True
    skin = elements.surface(mesh, "skin", e, axisymmetric=True, order=5)
    stiff = np.ones(len(e.cells))
    if magnet == "meshed":
        stiff[mesh.subdomains["magnet"]] = 1e5
    glued = elements.boundary_nodes(mesh, "magnet") if magnet == "hole" else NONE
    body = (glued, rigid_inclusion.of_section(e.nodes[glued] - [0, shape.H], e.angles)) if magnet == "hole" else None
    system = System(e, skin, (mu * stiff, inverse_K / stiff), fixed, body)
    q = np.zeros(system.size)
    for press in np.linspace(0.1, depth, round(depth / 0.1)):
        flat = Plate(shape.L - press, 5000.0, np.zeros(2))
        guess = skin.points[..., 2] >= shape.L - press / 2 if press == 0.1 else None
        answer = newton(system, Solver(), q, flat, guess)
        assert answer.converged
        q = answer.state.q
    return system, answer


def test_rigid_magnet_equals_a_very_stiff_one():
    forces, shifts = [], []
    for magnet in ("hole", "meshed"):
        system, answer = stiff_or_rigid(magnet, angular_fields.fourier_fields(0), 0.1)
        nodes, shape = system.elements.nodes, Design().shape.scaled(1 / 8)
        forces.append(answer.assembly.forces[system.fixed[:, 1], 1].sum())
        centre = np.argmin(np.hypot(nodes[:, 0] - shape.magnet_diameter / 2, nodes[:, 1] - shape.H))
        shifts.append(answer.state.u[centre, 1])
    assert forces[0] == pytest.approx(forces[1], rel=2e-3)
    assert shifts[0] == pytest.approx(shifts[1], rel=2e-3)


def test_a_press_softens_torsion_around_a_rigid_magnet_as_around_a_very_stiff_one():
    """Torsional compliance, pressed over at rest: 1.07. The second-order part of the magnet's turn belongs to it."""
    ratios = []
    for magnet in ("hole", "meshed"):
        system, answer = stiff_or_rigid(magnet, angular_fields.torsion_fields(), 0.2)
        nodes, top = system.elements.nodes, (Design().H + Design().magnet_height / 2) / 8 + 1e-6
        torque = np.zeros(system.fixed.shape)
        torque[:, 1] = np.where(nodes[:, 1] > top, nodes[:, 0], 0.0)
        load = system.unknowns(torque, answer.state.p * 0, np.zeros(system.n_rigid))
        compliance = []
        for state in (system.state(np.zeros(system.size)), answer.state):
            solver = Solver()
            solver.factorise(system.assemble(state, None).tangent)
            compliance.append(load @ solver.solve(load))
        ratios.append(compliance[1] / compliance[0])
    assert ratios[0] == pytest.approx(ratios[1], rel=2e-3)


def test_a_magnet_that_turns_about_its_axis_keeps_its_distances():
    arms = np.abs(RNG.normal(size=(4, 2)))
    u = rigid_inclusion.of_section(arms, angular_fields.torsion_fields()).displacement(np.array([0.3, 2.0]))
    np.testing.assert_allclose(np.hypot(arms[:, 0] + u[:, 0], u[:, 1]), arms[:, 0], rtol=1e-14)
