"""Viscoelastic laws at one point: closed forms of a block, second order, energy, and frame invariance."""

import numpy as np
import pytest

from fem.model import material, viscoelasticity
from fem.model.viscoelasticity import History, PointState, ViscousLaw
from geometry.arrays import Array
from geometry.relaxation import Relaxation

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


def _dissipation_rate(viscous: Array, now: PointState, mu: float, tau: float) -> float:
    """Return the dissipation per volume and time of one branch of the law "finite", with C_i (6, 1, 1, 1)."""
    Cbar, Ci = (X[viscoelasticity.PLACES].reshape(3, 3) for X in (now.J ** (-2 / 3) * now.C, viscous))
    M = Cbar @ np.linalg.inv(Ci)
    return float(mu / (2 * tau) * (np.trace(M @ M) - np.trace(M) ** 2 / 3))


def _follow(law: ViscousLaw, motion: list[Array], dt: float) -> tuple[History, list[Array]]:
    """Return the last history and all stresses S (6,) on the way."""
    history, stresses = viscoelasticity.at_rest(law, BRANCHES, (1, 1, 1)), []
    for F in motion:
        now = _point(F)
        history = history.advance(now, dt)
        stresses.append(history.stress(now).ravel())
    return history, stresses


@pytest.mark.parametrize("law", ["prony", "finite"])
def test_held_block_of_small_shear_relaxes_like_the_branches(law: ViscousLaw) -> None:
    history = viscoelasticity.at_rest(law, BRANCHES, (1, 1, 1)).advance(_point(_shear(1e-4)), 0.0)
    history = history.advance(_point(_shear(1e-4)), 0.7)
    relaxed = float(BRANCHES.modulus(0.7))
    assert history.stress(_point(_shear(1e-4))).ravel()[4] == pytest.approx(1e-4 * relaxed, rel=1e-7)


@pytest.mark.parametrize("law", ["prony", "finite"])
def test_cyclic_shear_has_the_complex_modulus(law: ViscousLaw) -> None:
    omega, steps, size = 2.0, 100, 1e-3
    dt = 2 * np.pi / omega / steps
    times = dt * np.arange(1, 6 * steps + 1)
    _, stresses = _follow(law, [_shear(size * np.sin(omega * t)) for t in times], dt)
    last = np.array([S[4] for S in stresses[-steps:]]) / size
    wave = np.exp(-1j * omega * times[-steps:])
    # stress = Im(G exp(i omega t))
    measured = 2j * (last * wave).mean()
    assert measured == pytest.approx(complex(BRANCHES.complex_modulus(omega)), rel=2e-3)


@pytest.mark.parametrize("law", ["prony", "finite"])
def test_steps_are_of_second_order(law: ViscousLaw) -> None:
    def last(steps: int) -> Array:
        times = np.arange(1, steps + 1) / steps
        return _follow(law, [_shear(np.sin(2 * t)) for t in times], 1.0 / steps)[1][-1]

    coarse, middle, fine = last(10), last(20), last(40)
    order = np.log2(np.linalg.norm(coarse - middle) / np.linalg.norm(middle - fine))
    assert order == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("dt", [1e-9, 1e9])
@pytest.mark.parametrize("law", ["prony", "finite"])
def test_fast_and_slow_limits_are_elastic(law: ViscousLaw, dt: float) -> None:
    F = _shear(0.8)
    _, stresses = _follow(law, [F], dt)
    modulus = 1.0 if dt < 1 else BRANCHES.rest
    assert stresses[-1] == pytest.approx(modulus * _point(F).S.ravel(), abs=1e-7)


def test_work_on_the_finite_law_is_stored_or_dissipated() -> None:
    steps = 800
    times = np.arange(1, steps + 1) / steps
    history: History = viscoelasticity.at_rest("finite", BRANCHES, (1, 1, 1))
    before, stress, work, lost = _point(np.eye(3)), np.zeros((6, 1, 1, 1)), 0.0, 0.0
    rate = 0.0
    for t in times:
        now = _point(_shear(np.sin(6 * t)))
        history = history.advance(now, 1 / steps)
        after = history.stress(now)
        work += float(viscoelasticity.contract(stress + after, now.C - before.C).item()) / 4
        faster = sum(
            _dissipation_rate(Ci, now, share, tau)
            for Ci, share, tau in zip(history.internal, BRANCHES.shares, BRANCHES.times, strict=True)
        )
        assert faster >= 0
        lost += (rate + faster) / 2 / steps
        before, stress, rate = now, after, faster
    assert history.stored(before) + lost == pytest.approx(work, rel=2e-4)


@pytest.mark.parametrize("x", [1e-8, 9e-3, 1.1e-2, 3.0])
def test_curvature_weight_is_the_integral_that_a_linear_stress_leaves_out(x: float) -> None:
    s, weights = np.polynomial.legendre.leggauss(20)
    s = (s + 1) / 2
    exact = float(weights / 2 @ (np.exp(-x * (1 - s)) * (s - 0.5))) * x**2
    assert float(viscoelasticity.curvature_weight(np.array(x))) == pytest.approx(exact, rel=1e-4)
