"""Laws of the silicone, elastic and viscoelastic: closed forms, differences, invariance, second order, energy."""

import functools

import numpy as np
import pytest

from fem.analyses.time_steps import product_weights
from fem.model import material, viscoelasticity
from fem.model.material import evaluate, law, neo_hookean, ogden, strains
from fem.model.nonlinear_system import State, System
from fem.model.symmetry_models import MeshSpecification
from fem.model.viscoelasticity import History, PointState, ViscousLaw
from geometry.arrays import Array
from geometry.design import paper
from geometry.relaxation import Relaxation, lame

RNG = np.random.default_rng(1)


def rotation(axis, angle):
    axis = np.asarray(axis) / np.linalg.norm(axis)
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


CASES = {"neo-hookean": (), "mooney-rivlin": (0.3,), "yeoh": (0.4, 0.2), "ogden": (4.5, -3.0, 0.35)}
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
def test_each_law_is_hookes_and_keeps_its_digits_at_tiny_strain(name):
    G = 1e-12 * RNG.normal(size=(3, 3))
    small = (G + G.T) / 2
    want = 2 * 1.3 * (small - np.trace(small) / 3 * np.eye(3))
    np.testing.assert_allclose(isochoric(name, G)[1], want, rtol=1e-9, atol=1e-21)
    change, inverse_transpose = strains(G.reshape(9, 1))[:2]
    assert change == pytest.approx(np.trace(G), rel=1e-10)
    np.testing.assert_allclose(inverse_transpose.reshape(3, 3), -G.T, rtol=1e-10)


def test_a_pressure_adds_its_cofactor_to_the_stress_and_lame_gives_hookes_law():
    G = 0.2 * RNG.normal(size=(3, 3))
    F = G + np.eye(3)
    low, high = (evaluate(neo_hookean, G, 1.3, p)[1] for p in (0.7, 1.7))
    np.testing.assert_allclose(high - low, np.linalg.det(F) * np.linalg.inv(F).T, rtol=1e-12, atol=1e-12)
    mu, inverse_K = lame(2.0, 0.3)
    rest, one = evaluate(neo_hookean, np.zeros((3, 3)), mu)[2], np.eye(3).ravel()
    stress = (rest + np.outer(one, one) / inverse_K) @ np.diag([-0.3, -0.3, 1.0]).ravel()
    np.testing.assert_allclose(stress.reshape(3, 3), np.diag([0, 0, 2.0]), atol=1e-12)


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize(
    ("name", "values"), [("mooney-rivlin", (0.0,)), ("yeoh", (0.0, 0.0)), ("ogden", (2.0, -2.0, 0.0))]
)
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


BRANCHES = Relaxation((0.3, 0.2), (0.5, 2.0))


def _point(F: Array) -> PointState:
    """Return the state of one point of a neo-Hookean silicone with mu = 1."""
    G, H = (T[:, :, None, None, None] for T in (F - np.eye(3), np.linalg.inv(F).T))
    W, P, _ = material.evaluate(material.neo_hookean, G, tangent=False)
    S = np.stack([np.einsum("i...,i...->...", H[:, I], P[:, J]) for I, J in viscoelasticity.PAIRS])
    one = np.ones((1, 1, 1))
    return PointState(viscoelasticity.cauchy_green(G), np.linalg.det(F) * one, W, S, one, np.ones((1, 1)))


def _shear(amount: float) -> Array:
    F = np.eye(3)
    F[0, 2] = amount
    return F


def _follow(law: ViscousLaw, motion: list[Array], dt: float) -> tuple[History, list[Array]]:
    """Return the last history and all stresses S (6,) on the way."""
    history, stresses = viscoelasticity.at_rest(law, BRANCHES, (1, 1, 1)), []
    for F in motion:
        now = _point(F)
        history = history.advance(now, dt)
        stresses.append(history.stress(now).ravel())
    return history, stresses


@pytest.mark.parametrize("law", ["prony", "finite"])
def test_steps_are_of_second_order(law: ViscousLaw) -> None:
    def last(steps: int) -> Array:
        times = np.arange(1, steps + 1) / steps
        return _follow(law, [_shear(np.sin(2 * t)) for t in times], 1.0 / steps)[1][-1]

    coarse, middle, fine = last(10), last(20), last(40)
    order = np.log2(np.linalg.norm(coarse - middle) / np.linalg.norm(middle - fine))
    assert order == pytest.approx(2.0, abs=0.1)


TWO = Relaxation((0.2, 0.1), (0.5, 5.0))


def _system(harmonics: int) -> System:
    shape = paper().shape.scaled(1 / paper().D)
    return MeshSpecification(shape, 0.49, "rigid", 0.5, 0.5, harmonics=harmonics).build().system


def _deformed(system: System, seed: int, size: float = 2e-4) -> Array:
    return size * np.random.default_rng(seed).standard_normal(system.size)


def _in_step(system: System, law: ViscousLaw) -> System:
    """Return the system in a time step after another one."""
    e = system.elements
    points = len(e.angles.theta), *e.weights.shape
    history = viscoelasticity.at_rest(law, TWO, points, 1 / 0.7)
    before = system.state(_deformed(system, 1))
    history = history.advance(viscoelasticity.measure(e, system.law, system.mu, before.u), 0.3)
    system.viscous = history.overstress(0.4)
    return system


def _admissible(system: System, q: Array) -> State:
    state = system.admissible(q)
    assert state is not None
    return state


@pytest.mark.parametrize("law", ["prony", "finite"])
@pytest.mark.parametrize("harmonics", [0, 1])
def test_tangent_is_the_derivative_of_the_residual(law: ViscousLaw, harmonics: int) -> None:
    system = _in_step(_system(harmonics), law)
    q, along = _deformed(system, 2), _deformed(system, 3, 1.0)
    tangent = system.assemble(_admissible(system, q), None).tangent
    whole = tangent + tangent.T
    whole.setdiag(tangent.diagonal())
    here, ahead, back = (system.assemble(_admissible(system, q + h * along), None) for h in (0.0, 1e-6, -1e-6))
    slope = (ahead.residual - back.residual) / 2e-6
    assert whole @ along == pytest.approx(slope, rel=1e-5, abs=1e-6 * np.abs(slope).max())
    if law == "prony":
        assert here.residual @ along == pytest.approx((ahead.energy - back.energy) / 2e-6, rel=1e-6)


UNEVEN = (0.3, 0.5, 1.1, 1.2)


@pytest.mark.parametrize("degrees", [(0, 1), (1, 1), (1, 2), (2, 3), (3, 3)])
@pytest.mark.parametrize("first", [0, 2])
def test_polynomials_up_to_the_third_degree_are_exact(degrees: tuple[int, int], first: int) -> None:
    (a, b), times = degrees, np.array(UNEVEN)
    exact = b / (a + b) * (times[-1] ** (a + b) - times[first] ** (a + b))
    assert times**a @ product_weights(UNEVEN, first) @ times**b == pytest.approx(exact)
