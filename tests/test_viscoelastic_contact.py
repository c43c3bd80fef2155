"""A sphere on a viscoelastic half space: limits, held depths, quadrature of Lee-Radok's and Ting's integrals."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from analytic.viscoelastic_contact import indentation
from geometry.design import BadInput
from geometry.relaxation import Relaxation

SERIES = Relaxation((0.1, 0.2, 0.15), (0.02, 0.3, 5.0))
ELASTIC = Relaxation((), ())
G0, R = 0.3, 4.0
TIMES = np.array([0.0, 0.2, 0.5, 1.0, 1.2, 1.5, 1.8, 2.0])
DEPTHS = np.array([0.0, 0.1, 0.5, 1.0, 1.0, 0.7, 0.3, 0.0])


def hertz(modulus, depth):
    return 16 / 3 * np.sqrt(R) * modulus * depth**1.5


def pieces(end):
    """Pieces of rising or falling depth up to a time: begin, end, speed, depth at the begin."""
    for t0, t1, d0, d1 in zip(TIMES, TIMES[1:], DEPTHS, DEPTHS[1:], strict=False):
        if t0 < end:
            yield t0, min(t1, end), (d1 - d0) / (t1 - t0), d0


def lee_radok(end, t):
    """The integral of G(t - s) d(delta^1.5)(s) up to a time, by quadrature, as a force."""
    return (
        16
        / 3
        * np.sqrt(R)
        * G0
        * sum(
            quad(lambda s, v=v, t0=t0, d0=d0: SERIES.modulus(t - s) * 1.5 * np.sqrt(d0 + v * (s - t0)) * v, t0, t1)[0]
            for t0, t1, v, d0 in pieces(end)
        )
    )


def moved(begin, t):
    """Ting's integral of G(t - s) delta'(s) from a time on, by quadrature."""
    return sum(
        quad(lambda s, v=v: SERIES.modulus(t - s) * v, max(t0, begin), t1)[0]
        for t0, t1, v, _ in pieces(t)
        if t1 > begin
    )


def test_without_branches_the_force_is_that_of_hertz_both_ways():
    force, contact_radius = indentation(ELASTIC, G0, R, TIMES, DEPTHS)
    assert force == pytest.approx(hertz(G0, DEPTHS), rel=1e-9, abs=1e-12)
    assert contact_radius == pytest.approx(np.sqrt(R * DEPTHS), rel=1e-9, abs=1e-9)


def test_a_growing_contact_is_the_integral_of_lee_and_radok():
    force, _ = indentation(SERIES, G0, R, TIMES, DEPTHS)
    for k in range(1, 5):
        assert force[k] == pytest.approx(lee_radok(TIMES[k], TIMES[k]), rel=1e-7)


@pytest.mark.parametrize("k", [5, 6])
def test_a_release_is_the_integral_of_ting(k):
    force, contact_radius = indentation(SERIES, G0, R, TIMES, DEPTHS)
    t1 = brentq(lambda begin: moved(begin, TIMES[k]), 1e-9, 1.0, xtol=1e-13)
    assert contact_radius[k] ** 2 / R == pytest.approx(np.interp(t1, TIMES, DEPTHS), rel=1e-7)
    assert force[k] == pytest.approx(lee_radok(t1, TIMES[k]), rel=1e-6)


def test_the_sphere_leaves_before_its_depth_is_zero():
    times = np.concatenate([TIMES[:5], np.linspace(1.21, 2.0, 80)])
    depths = np.interp(times, TIMES, DEPTHS)
    force, _ = indentation(SERIES, G0, R, times, depths)
    first = 1 + int(np.argmax(force[1:] == 0))
    assert depths[first] > 0.05
    assert (force[1:first] > 0).all()
    assert (force[first:] == 0).all()


def test_a_step_that_is_held_relaxes_as_the_modulus():
    times = np.array([0.0, 0.1, 1.0, 10.0])
    force, _ = indentation(SERIES, G0, R, times, np.full(4, 0.6))
    assert force == pytest.approx(hertz(G0, 0.6) * SERIES.modulus(times), rel=1e-12)


def test_fast_and_slow_presses_have_the_instantaneous_and_the_long_term_modulus():
    for duration, modulus in ((1e-7, G0), (1e7, G0 * SERIES.rest)):
        force, _ = indentation(SERIES, G0, R, duration * TIMES[:4], DEPTHS[:4])
        assert force == pytest.approx(hertz(modulus, DEPTHS[:4]), rel=1e-5)


def test_a_step_is_the_limit_of_a_fast_rise():
    times = np.array([0.0, 0.3, 0.31, 0.6])
    step, step_radius = indentation(SERIES, G0, R, times, np.array([0.6, 0.6, 0.5, 0.2]))
    rise, rise_radius = indentation(
        SERIES, G0, R, np.concatenate([[-1e-7], times]), np.array([0.0, 0.6, 0.6, 0.5, 0.2])
    )
    assert rise[1:] == pytest.approx(step, rel=1e-5)
    assert rise_radius[1:] == pytest.approx(step_radius, rel=1e-5)


@pytest.mark.parametrize(
    ("times", "depths", "message"),
    [
        ([0.0, 0.0], [0.0, 1.0], "the times of an indentation must rise"),
        ([0.0, 1.0], [0.0, -1.0], "grow to one maximum, and then fall"),
        ([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 0.5, 0.8], "grow to one maximum, and then fall"),
    ],
)
def test_other_paths_are_refused(times, depths, message):
    with pytest.raises(BadInput, match=message):
        indentation(SERIES, G0, R, np.array(times), np.array(depths))
