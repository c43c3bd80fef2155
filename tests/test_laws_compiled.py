"""Compiled laws against those of `fem.material`, at large, equal and tiny stretches."""

import numpy as np
import pytest
from test_element_loops import LAWS

from fem import material

pytest.importorskip("numba", reason="the laws need the extra `fast`")
RNG = np.random.default_rng(5)
STATES = {
    "large": 0.3 * RNG.normal(size=(3, 3, 20)),
    "equal stretches": np.einsum("ij,n->ijn", np.eye(3), np.linspace(-0.3, 0.5, 9)),
    "two equal stretches": np.einsum("ij,n->ijn", np.diag([0.4, 0.4, -0.3]), np.linspace(-0.5, 1, 9)),
    "tiny": 1e-10 * RNG.normal(size=(3, 3, 20)),
    "rest": np.zeros((3, 3, 3)),
}


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("law", LAWS)
def test_energy_stress_and_tangent(law, state):
    from fem import laws_compiled

    G = STATES[state]
    G = G[:, :, np.linalg.det(np.moveaxis(G, -1, 0) + np.eye(3)) > 0.1]
    n, function = G.shape[2], material.law(law, LAWS[law])
    mu, p = RNG.uniform(1, 2, n), RNG.normal(size=n) * np.abs(G).max()
    expected = function(material.kinematics(material.strain(G)), mu, p)
    Jm1, Hm1, W, P, A = np.empty(n), np.empty((9, n)), np.empty(n), np.empty((9, n)), np.empty((9, 9, n))
    G = np.ascontiguousarray(G.reshape(9, n))
    laws_compiled.kinematics(G, Jm1, Hm1)
    laws_compiled.stress(*material.numbered(function), G, Jm1, Hm1, mu, p, W, P, A, tangent=True)
    # energies of the second order in G are differences of numbers of the first order
    for own, other, rounding in zip((W, P, A), expected, (1e-15 * np.abs(G).max(), 0.0, 0.0), strict=True):
        other = other.reshape(own.shape)
        np.testing.assert_allclose(own, other, rtol=1e-12, atol=1e-12 * np.abs(other).max() + rounding)


def test_eigenvectors_of_nearly_equal_eigenvalues():
    from fem import laws_compiled

    S = np.diag([1.0, 1.0 + 1e-13, 2.0]) + 1e-14
    values, N = np.empty(3), np.empty((3, 3))
    laws_compiled.eigenvectors(S.copy(), values, N)
    np.testing.assert_allclose(N.T @ N, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(N @ np.diag(values) @ N.T, S, atol=1e-14)
