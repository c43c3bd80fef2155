"""Integrals over the elements: derivatives for every law, batches, matrices without pressures."""

import math

import numpy as np
import pytest
import skfem
from scipy import sparse
from test_nonlinear_system import RNG, SCENES, plate, smooth

from fem.model import angular_fields, element_assembly, elements, gradient_recovery, material

LAWS = {
    "neo-hookean": (),
    "mooney-rivlin": (0.3,),
    "yeoh": (0.1, 0.02),
    "ogden": (1.3, -2.0, 0.3),
}
REL = 1e-12


def whole(upper):
    """A symmetric matrix from its upper triangle."""
    full = upper + upper.T
    full.setdiag(upper.diagonal())
    return full


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", ["half ball", "sensor", "one harmonic"])
def test_every_law_has_consistent_derivatives_on_every_kind_of_element(name, law):
    system, flat = plate(name, 0.02, shear=0.003)
    system.law = material.law(law, LAWS[law])
    q, direction, step = smooth(system), RNG.normal(size=system.size), 1e-7
    if system.elements.angles.harmonics:
        radius = np.broadcast_to(system.elements.nodes[:, :1], system.fixed.shape)
        direction[: system.n_free] *= radius[system.free]
    here = system.assemble(system.admissible(q), flat)
    ahead, behind = (system.assemble(system.admissible(q + way * step * direction), flat) for way in (1, -1))
    assert (ahead.energy - behind.energy) / (2 * step) == pytest.approx(here.residual @ direction, rel=1e-6)
    slope = (ahead.residual - behind.residual) / (2 * step)
    np.testing.assert_allclose(whole(here.tangent) @ direction, slope, atol=2e-5 * np.abs(slope).max())


@pytest.mark.parametrize("name", ["sensor", "harmonics", "half ball"])
def test_results_do_not_depend_on_the_size_of_batches(name, monkeypatch):
    system, flat = plate(name, 0.02)
    q = smooth(system)
    first = system.assemble(system.admissible(q), flat)
    monkeypatch.setattr(element_assembly, "BATCH", 100)
    cut, _ = plate(name, 0.02)
    second = cut.assemble(cut.admissible(q), flat)
    assert len(cut._loops._batches) > 5
    assert second.energy == pytest.approx(first.energy, rel=REL)
    scale = np.abs(first.forces).max()
    np.testing.assert_allclose(second.residual, first.residual, rtol=REL, atol=REL * scale)
    scale = np.sqrt(np.abs(first.matrix.diagonal()))
    difference = np.abs(second.matrix - first.matrix).tocoo()
    assert (difference.data <= REL * np.maximum(scale[difference.row] * scale[difference.col], 1)).all()


def dense_matrix(system, matrices):
    """The matrix of the unknowns from matrices (m, f, a, f, a): the fields of all nodes, then the constraints."""
    cells, (nodes, fields) = system.elements.cells, system.fixed.shape
    places = (fields * cells[:, None] + np.arange(fields)[:, None]).reshape(len(cells), -1)
    rows, columns = (places.repeat(places.shape[1], axis=1), np.tile(places, places.shape[1]))
    full = sparse.coo_array((matrices.ravel(), (rows.ravel(), columns.ravel())), shape=(nodes * fields,) * 2)
    follow = sparse.lil_array((nodes * fields, system.size))
    follow[np.flatnonzero(system.free), np.arange(system.n_free)] = 1.0
    if system.rigid:
        rows = np.zeros(system.fixed.shape, dtype=bool)
        rows[system.glued] = True
        motion = system.rigid.derivative(np.zeros(system.n_rigid)).reshape(-1, system.n_rigid)
        follow[rows.ravel(), system.n_free : system.n_free + system.n_rigid] = motion
    return (follow.T @ full.tocsr() @ follow.tocsr()).toarray()


@pytest.mark.parametrize("name", ["cube", "half ball", "cylinder", "one harmonic"])
def test_the_mass_is_that_of_a_dense_matrix(name):
    system = SCENES[name]()
    expected = dense_matrix(system, element_assembly.mass(system.elements, 2.0))
    magnet = np.arange(1.0, 7.0)
    at = np.arange(system.n_free, system.n_free + system.n_rigid)
    expected[at, at] += magnet[system.components]
    mass = whole(system.mass(2.0, magnet)).toarray()
    np.testing.assert_allclose(mass, expected, atol=REL * np.abs(expected).max())


def test_the_mass_of_a_cube_that_moves_as_a_whole_is_its_own():
    system = SCENES["cube"]()
    matrices = element_assembly.mass(system.elements, 2.0)
    assert matrices[:, 2, :, 2].sum() == pytest.approx(2.0, rel=1e-12)
    assert abs(matrices[:, 0, :, 2]).max() < 1e-15


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


def wave(X):
    x, y, z = X.T
    return np.stack([np.sin(2 * x + z), y * np.cos(x - z), np.exp(x) * np.cos(3 * y) * z], axis=1)


def block(n, *, half, place=lambda x: x):
    """n cubes along x and z, over (-1, 1) x (0 or -1, 1) x (-0.3, 1.2), moved by a map."""
    sides = np.linspace(-1, 1, n + 1), np.linspace(0 if half else -1, 1, n // (2 if half else 1) + 1)
    mesh = skfem.MeshTet.init_tensor(*sides, np.linspace(-0.3, 1.2, n + 1))
    return elements.build(skfem.MeshTet2.from_mesh(skfem.MeshTet(place(mesh.p), mesh.t)), axisymmetric=False)


def uneven(x):
    return x + 0.04 * np.stack([np.sin(5 * x[1] + x[2]), np.sin(3 * np.pi * x[1]), np.cos(4 * x[0] - 3 * x[2])])


def section(n):
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
    e = section(8) if body == "section" else block(6, half=body == "half", place=uneven)
    u = fields_of(cubic, e) if body == "section" else cubic(e.nodes)
    value, gradient = gradient_recovery.build_recovery(e, HEIGHT, mirrored=body == "half")(u)
    np.testing.assert_allclose(value, cubic(np.array([[0, 0, HEIGHT]]))[0], atol=1e-12)
    np.testing.assert_allclose(gradient, cubic_gradient(), atol=1e-11)


@pytest.mark.parametrize("body", ["half", "section"])
def test_orders_of_convergence(body):
    """At least 4 of the value and 3 of the gradient in the mean edge length, on an uneven mesh too."""
    c, s, z = math.cos(HEIGHT), math.sin(HEIGHT), HEIGHT
    found = []
    for n in (12, 24):
        e = section(n) if body == "section" else block(n, half=True, place=uneven)
        u = fields_of(wave, e) if body == "section" else wave(e.nodes)
        value, gradient = gradient_recovery.build_recovery(e, HEIGHT, mirrored=True)(u)
        errors = np.abs(value - [s, 0, z]).max(), np.abs(gradient - [[2 * c, 0, c], [0, c, 0], [z, 0, 1]]).max()
        found.append([gradient_recovery.mean_edge_length(e, HEIGHT), *errors])
    edge, value, gradient = np.log(found[0]) - np.log(found[1])
    assert value / edge > 3.85
    assert gradient / edge > 2.85


def test_half_a_body_gives_what_the_whole_does():
    half = block(6, half=True)
    flat = skfem.MeshTet(half.nodes[: half.corners.max() + 1].T, half.corners.T)
    other = skfem.MeshTet(flat.p * [[1], [-1], [1]], flat.t)
    whole = elements.build(skfem.MeshTet2.from_mesh(flat + other), axisymmetric=False)
    one = gradient_recovery.build_recovery(half, HEIGHT, mirrored=True)(wave(half.nodes))
    both = gradient_recovery.build_recovery(whole, HEIGHT, mirrored=False)(wave(whole.nodes))
    np.testing.assert_allclose(one[0], both[0], atol=1e-12)
    np.testing.assert_allclose(one[1], both[1], atol=1e-11)


def test_a_patch_of_few_nodes_grows():
    rng = np.random.default_rng(5)
    points = rng.uniform(-1, 1, (200, 3))
    near, weights = gradient_recovery.fit(points, 0.1)
    found = weights @ cubic(points[near] + np.array([0, 0, HEIGHT]))
    np.testing.assert_allclose(found[0], CUBIC[:, 0], atol=1e-12)
    np.testing.assert_allclose(found[1:].T, cubic_gradient(), atol=1e-11)
