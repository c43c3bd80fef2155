"""Integrals over the elements: derivatives for every law, batches, matrices without pressures."""

import numpy as np
import pytest
from scipy import sparse
from test_nonlinear_system import RNG, SCENES, plate, smooth

from fem.model import element_assembly, material

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
    magnet = np.arange(1.0, 1 + system.n_rigid)
    at = np.arange(system.n_free, system.n_free + system.n_rigid)
    expected[at, at] += magnet
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
