"""The discrete system: blocks with known answers, derivatives for all laws, batches, mass, recovered gradients."""

from dataclasses import replace

import numpy as np
import pytest
import skfem

from fem.model import angular_fields, elements, gradient_recovery, material, rigid_inclusion
from fem.model.nonlinear_system import NONE, System
from fem.model.plate_contact import Bond, Plate
from fem.model.symmetry_models import MeshSpecification
from fem.solve.direct_solver import Solver
from fem.solve.newton import newton
from geometry.bad_input import MeshError
from geometry.design import Design
from geometry.relaxation import lame
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


def stiff_or_rigid(magnet):
    """The paper's sensor, pressed: the magnet rigid ("hole") or silicone 1e5 times stiffer ("meshed"), one mesh."""
    shape = Design().shape.scaled(1 / 8)
    mu, inverse_K = lame(1.0, 0.4998)
    mesh = section(shape, 0.1, tip_size=0.05, magnet=magnet)
    e = elements.build(mesh, axisymmetric=True)
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
    flat = Plate(shape.L - 0.1, 5000.0, np.zeros(2))
    answer = newton(system, Solver(), np.zeros(system.size), flat, skin.points[..., 2] >= shape.L - 0.05)
    assert answer.converged
    return system, answer


def test_rigid_magnet_equals_a_very_stiff_one():
    forces, shifts = [], []
    for magnet in ("hole", "meshed"):
        system, answer = stiff_or_rigid(magnet)
        nodes, shape = system.elements.nodes, Design().shape.scaled(1 / 8)
        forces.append(answer.assembly.forces[system.fixed[:, 1], 1].sum())
        centre = np.argmin(np.hypot(nodes[:, 0] - shape.magnet_diameter / 2, nodes[:, 1] - shape.H))
        shifts.append(answer.state.u[centre, 1])
    assert forces[0] == pytest.approx(forces[1], rel=2e-3)
    assert shifts[0] == pytest.approx(shifts[1], rel=2e-3)


LAWS = {"neo-hookean": (), "mooney-rivlin": (0.3,), "yeoh": (0.1, 0.02), "ogden": (1.3, -2.0, 0.3)}


def whole(upper):
    """A symmetric matrix from its upper triangle."""
    full = upper + upper.T
    full.setdiag(upper.diagonal())
    return full


CASES = [(name, "neo-hookean") for name in SCENES]
CASES += [(name, law) for name in ("half ball", "sensor", "one harmonic") for law in LAWS if LAWS[law]]


@pytest.mark.parametrize(("name", "law"), CASES)
def test_residual_is_the_derivative_of_the_energy_and_tangent_of_the_residual(name, law):
    tilt = 0.2 if name in ("cube", "half ball", "one harmonic", "harmonics") else 0.0
    # laws of large stiffness fold elements under a deep plate
    depth, shear = (0.02, 0.003) if LAWS[law] else (0.1, 0.05)
    system, flat = plate(name, depth, shear, tilt)
    system.law = material.law(law, LAWS[law])
    tied = RNG.random(system.surface.weights.shape) < 0.3
    flat = replace(flat, bond=Bond(tied, system.surface.points[..., :2]))
    q, direction, step = smooth(system), RNG.normal(size=system.size), 1e-7
    if system.elements.angles.harmonics:
        # gradients of fields that do not vanish towards the axis grow like 1/r
        radius = np.broadcast_to(system.elements.nodes[:, :1], system.fixed.shape)
        direction[: system.n_free] *= radius[system.free]
    here, ahead, behind = (system.assemble(system.admissible(q + s * direction), flat) for s in (0, step, -step))
    assert (ahead.energy - behind.energy) / (2 * step) == pytest.approx(here.residual @ direction, rel=1e-6)
    slope = (ahead.residual - behind.residual) / (2 * step)
    np.testing.assert_allclose(whole(here.tangent) @ direction, slope, atol=2e-5 * np.abs(slope).max())


def test_strains_that_are_kept_are_those_of_the_state():
    """In whatever order states are checked and assembled, the results are those of a system without a past."""
    system, flat = plate("sensor", 0.02)
    q = smooth(system)
    one, other = system.admissible(q), system.admissible(0.7 * q)
    for state in (one, other, other, one):
        alone = plate("sensor", 0.02)[0].assemble(state, flat)
        np.testing.assert_array_equal(system.assemble(state, flat).residual, alone.residual)


@pytest.mark.parametrize("name", ["cylinder", "harmonics"])
def test_inverted_silicone_is_refused(name):
    system = SCENES[name]()
    q = np.zeros(system.size)
    q[: system.n_free] = 10 * smooth(system)[: system.n_free] / 0.001
    assert system.admissible(q) is None


def test_an_inverted_element_is_refused():
    mesh = section(Design().shape.scaled(1 / 8), 0.25)
    corner = mesh.t[0, 0]
    places = mesh.doflocs.copy()
    # beyond the opposite side
    places[:, corner] += 3 * (places[:, mesh.t[1:, 0]].mean(axis=1) - places[:, corner])
    with pytest.raises(MeshError, match=r"folded elements, and \d+ pairs of neighbours that overlap"):
        elements.build(type(mesh)(places, mesh.t), axisymmetric=True)
    straight = skfem.MeshTri(places[:, : mesh.nvertices], mesh.t)
    with pytest.raises(MeshError, match=r"has 0 folded elements, and [1-9]\d* pairs"):
        elements.build(skfem.MeshTri2.from_mesh(straight), axisymmetric=True)


def test_tiny_strains_keep_their_digits():
    system = SCENES["sensor"]()
    q, rest = smooth(system), system.assemble(system.state(np.zeros(system.size)), None)
    residual = system.assemble(system.state(1e-10 * q), None).residual
    linear = whole(rest.tangent) @ q
    np.testing.assert_allclose(residual / 1e-10, linear, rtol=0, atol=1e-8 * np.abs(linear).max())


# Recovered displacement and gradient: exact for cubics, orders of convergence, symmetries, rigid motion.


HEIGHT = 0.45
CUBIC = np.random.default_rng(4).uniform(-0.1, 0.1, (3, len(gradient_recovery.POWERS)))
CUBIC *= gradient_recovery.POWERS[:, 1] % 2 == np.array([0, 1, 0])[:, None]  # mirror images in y = 0


def cubic(X):
    """Displacement (n, 3) at X (n, 3), symmetric about y = 0."""
    return np.prod((X[:, None] - [0, 0, HEIGHT]) ** gradient_recovery.POWERS, axis=2) @ CUBIC.T


def cubic_gradient():
    powers = gradient_recovery.POWERS.tolist()
    return np.stack([CUBIC[:, powers.index(row)] for row in np.eye(3, dtype=int).tolist()], axis=1)


def block(n, *, half, place=lambda x: x):
    """n cubes along x and z, over (-1, 1) x (0 or -1, 1) x (-0.3, 1.2), moved by a map."""
    sides = np.linspace(-1, 1, n + 1), np.linspace(0 if half else -1, 1, n // (2 if half else 1) + 1)
    mesh = skfem.MeshTet.init_tensor(*sides, np.linspace(-0.3, 1.2, n + 1))
    return elements.build(skfem.MeshTet2.from_mesh(skfem.MeshTet(place(mesh.p), mesh.t)), axisymmetric=False)


def uneven(x):
    return x + 0.04 * np.stack([np.sin(5 * x[1] + x[2]), np.sin(3 * np.pi * x[1]), np.cos(4 * x[0] - 3 * x[2])])


def square(n):
    """n x n squares over (0, 1) x (-0.3, 1.2), with four harmonics."""
    mesh = skfem.MeshTri.init_tensor(np.linspace(0, 1, n + 1), np.linspace(-0.3, 1.2, n + 1))
    return elements.build(skfem.MeshTri2.from_mesh(mesh), axisymmetric=True, harmonics=4)


def fields_of(displacement, e):
    """The Fourier coefficients (n, fields) of a displacement that is symmetric about y = 0."""
    N, count = e.angles.harmonics, 32
    theta = 2 * np.pi * np.arange(count) / count
    r, z = e.nodes[:, :1], e.nodes[:, 1:]
    points = np.stack(np.broadcast_arrays(r * np.cos(theta), r * np.sin(theta), z), axis=-1)
    u = displacement(points.reshape(-1, 3)).reshape(points.shape)
    turned = (u[..., 0] + 1j * u[..., 1]) * np.exp(-1j * theta)
    w = [np.mean(turned * np.exp(-1j * k * theta), axis=1).real for k in angular_fields.orders(N)]
    rises = [np.mean(u[..., 2] * np.cos(n * theta), axis=1) * (1 if n == 0 else 2) for n in range(N + 1)]
    return np.stack(w + rises, axis=1)


@pytest.mark.parametrize("body", ["full", "half", "section"])
def test_cubic_displacements_are_recovered(body):
    e = square(8) if body == "section" else block(6, half=body == "half", place=uneven)
    u = fields_of(cubic, e) if body == "section" else cubic(e.nodes)
    value, gradient = gradient_recovery.build_recovery(e, HEIGHT, mirrored=body == "half")(u)
    np.testing.assert_allclose(value, cubic(np.array([[0, 0, HEIGHT]]))[0], atol=1e-12)
    np.testing.assert_allclose(gradient, cubic_gradient(), atol=1e-11)
