"""Laws of the silicone against closed forms, finite differences and invariance."""

import functools

import numpy as np
import pytest

from fem.model.material import eigenvectors, evaluate, lame, law, neo_hookean, ogden, strains

RNG = np.random.default_rng(1)


def rotation(axis, angle):
    axis = np.asarray(axis) / np.linalg.norm(axis)
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def both(G, p=0.7):
    F = G + np.eye(3)
    return *evaluate(neo_hookean, G, 1.3, p), np.linalg.det(F) * np.linalg.inv(F).T


def inverse_transpose(G):
    """F^-T - 1."""
    return strains(G.reshape(9, 1))[1].reshape(3, 3)


def test_volume_change_keeps_its_digits_at_tiny_strain():
    G = 1e-12 * RNG.normal(size=(3, 3))
    assert strains(G.reshape(9, 1))[0] == pytest.approx(np.trace(G), rel=1e-10)


def test_inverse_transpose_keeps_its_digits_at_tiny_strain():
    G = 1e-12 * RNG.normal(size=(3, 3))
    np.testing.assert_allclose(inverse_transpose(G), -G.T, rtol=1e-10)


def test_pressure_derivative_of_the_stress():
    G = 0.2 * RNG.normal(size=(3, 3))
    np.testing.assert_allclose(both(G, 1.7)[1] - both(G, 0.7)[1], both(G)[3], rtol=1e-12, atol=1e-12)


def test_small_strain_tangent_is_hookes_law():
    mu, inverse_K = lame(2.0, 0.3)
    A = evaluate(neo_hookean, np.zeros((3, 3)), mu)[2] + 1 / inverse_K * np.outer(
        np.eye(3).ravel(), np.eye(3).ravel()
    )
    stretched = np.diag([-0.3, -0.3, 1.0])
    np.testing.assert_allclose((A @ stretched.ravel()).reshape(3, 3), np.diag([0, 0, 2.0]), atol=1e-12)


CASES = {
    "neo-hookean": (),
    "mooney-rivlin": (0.3,),
    "yeoh": (0.4, 0.2),
    "ogden": (4.5, -3.0, 0.35),
}
STATES = {
    "rest": np.zeros((3, 3)),
    "generic": 0.3 * np.random.default_rng(5).normal(size=(3, 3)),
    "uniaxial": np.diag([1.8**-0.5, 1.8**-0.5, 1.8]) - np.eye(3),
    "equibiaxial": np.diag([1.4, 1.4, 1.4**-2]) - np.eye(3),
    "nearly equal": np.diag([1.4, 1.4 + 1e-9, 0.6]) - np.eye(3) + 1e-10,
    "turned": rotation([1, 2, 3], 0.9) @ np.diag([1.3, 1.3, 0.7]) @ rotation([3, 1, 1], 0.4) - np.eye(3),
    "swollen": 0.2 * np.eye(3),
}


def isochoric(name, G, mu=1.3):
    return evaluate(law(name, CASES[name]), G, mu)


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("name", CASES)
def test_each_law_is_consistent(name, state):
    G, step = STATES[state], 1e-5
    _, P, A = isochoric(name, G)
    np.testing.assert_allclose(A, A.T, atol=1e-12)
    for column in range(9):
        E = np.zeros(9)
        E[column] = step
        up, down = (isochoric(name, G + sign * E.reshape(3, 3)) for sign in (1, -1))
        assert (up[0] - down[0]) / (2 * step) == pytest.approx(P.flat[column], rel=1e-8, abs=1e-8)
        np.testing.assert_allclose((up[1] - down[1]).ravel() / (2 * step), A[:, column], rtol=1e-7, atol=2e-8)


@pytest.mark.parametrize("name", CASES)
def test_each_law_is_objective_isotropic_and_isochoric(name):
    Q, F = rotation([3, 1, 2], 0.8), np.eye(3) + STATES["generic"]
    W, P, A = isochoric(name, F - np.eye(3))
    turned = isochoric(name, Q @ F - np.eye(3))
    assert turned[0] == pytest.approx(W, rel=1e-12)
    np.testing.assert_allclose(turned[1], Q @ P, rtol=1e-11, atol=1e-12)
    R = np.kron(Q, np.eye(3))
    np.testing.assert_allclose(turned[2], R @ A @ R.T, rtol=1e-10, atol=1e-11)
    np.testing.assert_allclose(isochoric(name, F @ Q - np.eye(3))[1], P @ Q, rtol=1e-11, atol=1e-12)
    assert np.sum(P * F) == pytest.approx(0, abs=1e-12)
    assert isochoric(name, 1.3 * F - np.eye(3))[0] == pytest.approx(W, rel=1e-11)


@pytest.mark.parametrize("name", CASES)
def test_each_law_works_on_many_points_at_once(name):
    G, mu = 0.2 * np.random.default_rng(8).normal(size=(3, 3, 4, 5)), np.arange(1.0, 5.0)[:, None]
    many = evaluate(law(name, CASES[name]), G, mu)
    for found, want in zip(many, isochoric(name, G[:, :, 2, 3], 3.0), strict=True):
        np.testing.assert_allclose(found[..., 2, 3], want, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("name", CASES)
def test_each_law_keeps_its_digits_at_tiny_strain(name):
    G = 1e-12 * RNG.normal(size=(3, 3))
    small = (G + G.T) / 2
    want = 2 * 1.3 * (small - np.trace(small) / 3 * np.eye(3))
    np.testing.assert_allclose(isochoric(name, G)[1], want, rtol=1e-9, atol=1e-21)


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize(("name", "values"), [("mooney-rivlin", (0,)), ("yeoh", (0, 0)), ("ogden", (2, -2, 0))])
def test_each_law_reduces_to_neo_hookean(name, values, state):
    G = STATES[state]
    for found, want in zip(evaluate(law(name, values), G, 1.3), evaluate(neo_hookean, G, 1.3), strict=True):
        np.testing.assert_allclose(found, want, rtol=1e-12, atol=3e-14)


def closed_form(name, F, mu):
    """First Piola-Kirchhoff stress but for the pressure term: 2 W1 F + 2 W2 (I1 F - F C), or by stretches."""
    C = F.T @ F
    I1, numbers = np.trace(C), CASES[name]
    if name == "ogden":
        squares, N = np.linalg.eigh(C)
        a1, a2, share = numbers
        slope = [2 * mu * ((1 - share) / a1 * s**a1 + share / a2 * s**a2) for s in np.sqrt(squares)]
        return F @ N @ np.diag(slope / squares) @ N.T
    if name == "mooney-rivlin":
        W1, W2 = mu / 2 * (1 - numbers[0]), mu / 2 * numbers[0]
    else:
        c2, c3 = numbers if name == "yeoh" else (0, 0)
        W1, W2 = mu / 2 * (1 + 2 * c2 * (I1 - 3) + 3 * c3 * (I1 - 3) ** 2), 0
    return 2 * W1 * F + 2 * W2 * (I1 * F - F @ C)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("mode", ["uniaxial", "equibiaxial", "planar", "simple shear"])
def test_incompressible_closed_forms(name, mode):
    """With the pressure that frees the third direction, as in the textbooks."""
    for s in (0.4, 0.8, 1.5, 3.0):
        F = {
            "uniaxial": np.diag([s, s**-0.5, s**-0.5]),
            "equibiaxial": np.diag([s, s, s**-2]),
            "planar": np.diag([s, 1, 1 / s]),
            "simple shear": np.array([[1, s, 0], [0, 1, 0], [0, 0, 1]]),
        }[mode]
        found = []
        for P in (isochoric(name, F - np.eye(3), 2.0)[1], closed_form(name, F, 2.0)):
            H = np.linalg.inv(F).T
            found.append(P - P[2, 2] / H[2, 2] * H)
        np.testing.assert_allclose(found[0], found[1], rtol=1e-10, atol=1e-10)
    if mode == "uniaxial" and name == "mooney-rivlin":
        s = 3.0
        assert found[0][0, 0] == pytest.approx(2 * (s - s**-2) * (0.7 + 0.3 / s), rel=1e-10)


def test_a_law_with_the_wrong_numbers_is_refused():
    with pytest.raises(ValueError, match="there is no law yeoh with 1 numbers"):
        law("yeoh", (1.0,))


def test_an_ogden_law_of_three_terms_is_the_sum_of_its_terms():
    alphas, shares, G = (1.3, 5.0, -2.0), (0.6, 0.1, 0.3), STATES["turned"]
    whole = evaluate(functools.partial(ogden, alphas=alphas, shares=shares), G, 1.3)
    terms = [
        evaluate(functools.partial(ogden, alphas=(alpha,), shares=(1.0,)), G, share * 1.3)
        for alpha, share in zip(alphas, shares, strict=True)
    ]
    for found, parts in zip(whole, zip(*terms, strict=True), strict=True):
        np.testing.assert_allclose(found, sum(parts), rtol=1e-12, atol=1e-13)


def test_eigenvectors_of_nearly_equal_eigenvalues():
    S = np.diag([1.0, 1.0 + 1e-13, 2.0]) + 1e-14
    values, N = np.empty(3), np.empty((3, 3))
    eigenvectors(S.copy(), values, N)
    np.testing.assert_allclose(N.T @ N, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(N @ np.diag(values) @ N.T, S, atol=1e-14)
