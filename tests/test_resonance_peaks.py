"""Peaks and bandwidths of oscillators with known ones."""

import numpy as np
import pytest

from analytic.oscillator import receptance
from studies.mechanics.resonance_peaks import bandwidth, flat_to, peaks


def oscillator(natural, loss):
    return lambda f: np.abs(receptance(f, natural, 1 + 1j * loss))


@pytest.mark.parametrize("loss", [0.001, 0.02, 0.1])
def test_a_peak_of_a_constant_loss_factor(loss):
    (peak,) = peaks(oscillator(340.0, loss), 1.0, 1000.0)
    assert peak.frequency == pytest.approx(340.0, rel=1e-6)
    assert peak.gain == pytest.approx(1 / loss, rel=1e-6)
    # half power at (f / f0)^2 = 1 -+ loss
    width = 340.0 * ((1 + loss) ** 0.5 - (1 - loss) ** 0.5)
    assert peak.width == pytest.approx(width, rel=1e-6)
    assert pytest.approx(340.0 / width, rel=1e-6) == peak.Q


def test_a_peak_without_both_half_power_points_has_no_width():
    (peak,) = peaks(oscillator(340.0, 0.1), 1.0, 345.0)
    assert peak.width is None
    assert peak.Q is None


def test_two_peaks_are_found_in_rising_order():
    def gain(f):
        return oscillator(50.0, 0.05)(f) + oscillator(400.0, 0.05)(f)

    assert [round(peak.frequency, -1) for peak in peaks(gain, 1.0, 1000.0)] == [50.0, 400.0]


def test_a_monotone_gain_has_no_peak():
    assert peaks(lambda f: 1 / (1 + f), 1.0, 100.0) == []


def test_the_bandwidth_of_a_low_pass():
    def gain(f):
        return 1 / np.sqrt(1 + (f / 80.0) ** 2)

    level = gain(1.0) * 0.5**0.5
    assert bandwidth(gain, 1.0, 1000.0) == pytest.approx(80.0 * (level**-2 - 1) ** 0.5, rel=1e-9)
    assert bandwidth(gain, 1.0, 50.0) is None


def test_the_flat_range_of_an_undamped_oscillator():
    end = flat_to(oscillator(970.0, 0.0), 0.05, 0.01, 600.0)
    assert end == pytest.approx(970.0 * (1 - 1 / 1.05) ** 0.5, rel=1e-6)
    assert flat_to(oscillator(970.0, 0.0), 0.05, 0.01, 200.0) is None


def test_rounding_errors_make_no_peak():
    assert peaks(lambda f: 1 + 1e-9 * np.sin(50 * np.log(f)), 1.0, 100.0) == []
