"""Laws of the silicone against closed forms, finite differences and invariance."""

import numpy as np
import pytest

from fem.material import kinematics, lame, neo_hookean, pressure_terms

RNG = np.random.default_rng(1)


def rotation(axis, angle):
    axis = np.asarray(axis) / np.linalg.norm(axis)
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def law(G, p=0.7):
    k = kinematics(G)
    W, P, A = neo_hookean(k, 1.3)
    Pp, Ap, C = pressure_terms(k, np.full(G.shape[:-2], p))
    return W + p * k.Jm1, P + Pp, A + Ap, C


def test_volume_change_keeps_its_digits_at_tiny_strain():
    G = 1e-12 * RNG.normal(size=(3, 3))
    assert kinematics(G).Jm1 == pytest.approx(np.trace(G), rel=1e-10)


def test_inverse_transpose():
    G = 0.3 * RNG.normal(size=(5, 3, 3))
    np.testing.assert_allclose(kinematics(G).H, np.swapaxes(np.linalg.inv(G + np.eye(3)), 1, 2), rtol=1e-12)


def test_stress_is_the_derivative_of_the_energy():
    G, step = 0.3 * RNG.normal(size=(3, 3)), 1e-6
    P = law(G)[1]
    for i in range(3):
        for j in range(3):
            E = np.zeros((3, 3))
            E[i, j] = step
            slope = (law(G + E)[0] - law(G - E)[0]) / (2 * step)
            assert slope == pytest.approx(P[i, j], rel=1e-7, abs=1e-8)


def test_tangent_is_the_derivative_of_the_stress():
    G, step = 0.3 * RNG.normal(size=(3, 3)), 1e-6
    A = law(G)[2]
    for column in range(9):
        E = np.zeros(9)
        E[column] = step
        slope = (law(G + E.reshape(3, 3))[1] - law(G - E.reshape(3, 3))[1]).ravel() / (2 * step)
        np.testing.assert_allclose(slope, A[:, column], rtol=1e-6, atol=1e-7)


def test_pressure_derivative_of_the_stress():
    G = 0.2 * RNG.normal(size=(3, 3))
    np.testing.assert_allclose(law(G, 1.7)[1] - law(G, 0.7)[1], law(G)[3], rtol=1e-12, atol=1e-12)


def test_a_rotation_stores_no_energy_and_gives_no_stress():
    G = rotation([1, 2, 3], 1.1) - np.eye(3)
    W, P, _, _ = law(G, p=0.0)
    assert abs(W) < 1e-14
    np.testing.assert_allclose(P, 0, atol=1e-14)


def test_stress_turns_with_the_body():
    Q, F = rotation([3, 1, 2], 0.8), np.eye(3) + 0.3 * RNG.normal(size=(3, 3))
    np.testing.assert_allclose(law(Q @ F - np.eye(3))[1], Q @ law(F - np.eye(3))[1], rtol=1e-12, atol=1e-13)


def test_uniaxial_incompressible_nominal_stress():
    """P = mu (s - s^-2) with the pressure that frees the sides."""
    for s in (0.4, 0.9, 1.5, 3.0):
        k = kinematics(np.diag([s**-0.5, s**-0.5, s]) - np.eye(3))
        P = neo_hookean(k, 2.0)[1]
        cof = pressure_terms(k, np.ones(()))[2]
        P = P - P[0, 0] / cof[0, 0] * cof
        assert P[2, 2] == pytest.approx(2.0 * (s - s**-2), rel=1e-12)


def test_small_strain_tangent_is_hookes_law():
    mu, inverse_K = lame(2.0, 0.3)
    k = kinematics(np.zeros((3, 3)))
    A = neo_hookean(k, mu)[2] + 1 / inverse_K * np.outer(np.eye(3).ravel(), np.eye(3).ravel())
    strain = np.diag([-0.3, -0.3, 1.0])
    np.testing.assert_allclose((A @ strain.ravel()).reshape(3, 3), np.diag([0, 0, 2.0]), atol=1e-12)
