"""Loops of a viscoelastic spring in closed form against their Fourier series and their limits."""

import numpy as np
import pytest

from analytic.relaxation_loops import loop
from geometry.prony import Relaxation, constant_loss

SERIES = Relaxation((0.1, 0.2, 0.15), (0.02, 0.3, 5.0))
CATALAN = 0.915965594177219


@pytest.mark.parametrize("frequency", [1e-3, 0.05, 1.0, 20.0, 1e3])
def test_a_triangle_is_the_sum_of_its_harmonics(frequency):
    # x = X/2 - 4 X / pi^2 sum cos(n w t) / n^2 over odd n, each of which meets G*(n w)
    n = np.arange(1, 400_001, 2.0)
    g = SERIES.complex_modulus(2 * np.pi * frequency * n)
    signs = np.where(n % 4 == 1, 1, -1)
    result = loop(SERIES, frequency)
    assert result.gap == pytest.approx(8 / np.pi**2 * np.sum(signs * g.imag / n**2), rel=1e-6)
    assert result.full_scale == pytest.approx(1 - 8 / np.pi**2 * np.sum((1 - g.real) / n**2), rel=1e-5)
    assert result.area == pytest.approx(16 / np.pi**3 * np.sum(g.imag / n**3), rel=1e-6)


def test_a_sine_encloses_the_area_of_its_ellipse():
    frequency, phase = 0.7, np.linspace(0, 2 * np.pi, 2001)
    g = SERIES.complex_modulus(2 * np.pi * frequency)
    stroke, force = 0.5 * np.sin(phase), 0.5 * (g * np.exp(1j * phase)).imag
    result = loop(SERIES, frequency, "sine")
    assert result.area == pytest.approx(np.trapezoid(force, stroke), rel=1e-5)
    assert result.gap == pytest.approx(force[0] - force[1000], rel=1e-12)
    assert result.full_scale == pytest.approx(force[500] - force[1500], rel=1e-12)


@pytest.mark.parametrize("loss", [1e-3, 0.05])
def test_the_gap_over_full_scale_is_the_loss_factor_for_a_sine_and_three_quarters_for_a_triangle(loss):
    silicone = constant_loss(loss, 1e-3, 1e5)
    assert loop(silicone, 1.0, "sine").hysteresis == pytest.approx(loss, rel=2e-3)
    # 8 / pi^2 (1 - 1/9 + 1/25 - ...) in the limit of a small loss, in which all harmonics have one storage modulus
    assert loop(silicone, 1.0).hysteresis == pytest.approx(8 / np.pi**2 * CATALAN * loss, rel=2e-3 + 0.5 * loss)


@pytest.mark.parametrize("waveform", ["sine", "triangle"])
def test_fast_and_slow_strokes_have_no_gap(waveform):
    fast, slow = (loop(SERIES, frequency, waveform) for frequency in (1e7, 1e-7))
    assert (fast.gap, slow.gap) == pytest.approx((0, 0), abs=1e-5)
    assert (fast.area, slow.area) == pytest.approx((0, 0), abs=1e-5)
    assert (fast.full_scale, slow.full_scale) == pytest.approx((1.0, SERIES.rest), rel=1e-5)
