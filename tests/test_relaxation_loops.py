"""Loops of a viscoelastic spring in closed form against their Fourier series and their limits."""

import numpy as np
import pytest

from analytic.relaxation_loops import loop
from geometry.relaxation import Relaxation, constant_loss

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


@pytest.mark.parametrize("loss", [1e-3, 0.05])
def test_the_gap_over_full_scale_is_the_sine_of_the_loss_angle_for_a_sine_and_three_quarters_of_it_for_a_triangle(
    loss,
):
    silicone = constant_loss(loss, 1e-3, 1e5)
    assert loop(silicone, 1.0, "sine").hysteresis == pytest.approx(np.sin(np.arctan(loss)), rel=2e-3)
    # 8 / pi^2 (1 - 1/9 + 1/25 - ...) in the limit of a small loss, in which all harmonics have one storage modulus
    assert loop(silicone, 1.0).hysteresis == pytest.approx(8 / np.pi**2 * CATALAN * loss, rel=2e-3 + 0.5 * loss)


@pytest.mark.parametrize("waveform", ["sine", "triangle"])
@pytest.mark.parametrize("hold", [0.0, 0.02, 3.0])
@pytest.mark.parametrize("half", [0.01, 1.0])
def test_strokes_with_rests_are_the_sum_of_their_harmonics(waveform, hold, half):
    # one period as a discrete Fourier series, of which every harmonic meets G*
    count, period = 2**16, 2 * (half + hold)
    time = np.arange(count) * period / count
    back = time >= half + hold
    share = np.clip((time - np.where(back, half + hold, 0)) / half, 0, 1)
    way = share if waveform == "triangle" else (1 - np.cos(np.pi * share)) / 2
    way[back] = 1 - way[back]
    omega = 2 * np.pi * np.arange(count // 2 + 1) / period
    force = np.fft.irfft(np.fft.rfft(way) * SERIES.complex_modulus(omega), count)
    up, down = np.interp([half / 2, half + hold + half / 2], time, force)
    result = loop(SERIES, 1 / (2 * half), waveform, hold)
    area = np.sum((np.roll(force, -1) + force) / 2 * (np.roll(way, -1) - way))
    expected = (up - down, np.ptp(force), area)
    assert (result.gap, result.full_scale, result.area) == pytest.approx(expected, abs=3e-4)


@pytest.mark.parametrize("waveform", ["sine", "triangle"])
def test_after_long_rests_a_fast_stroke_relaxes_anew(waveform):
    result = loop(SERIES, 1e4, waveform, hold=1e3)
    assert result.gap == pytest.approx(sum(SERIES.shares), rel=1e-2)


@pytest.mark.parametrize("waveform", ["sine", "triangle"])
def test_fast_and_slow_strokes_have_no_gap(waveform):
    fast, slow = (loop(SERIES, frequency, waveform) for frequency in (1e7, 1e-7))
    assert (fast.gap, slow.gap) == pytest.approx((0, 0), abs=1e-5)
    assert (fast.area, slow.area) == pytest.approx((0, 0), abs=1e-5)
    assert (fast.full_scale, slow.full_scale) == pytest.approx((1.0, SERIES.rest), rel=1e-5)
