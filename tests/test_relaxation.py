"""A silicone that relaxes: branches and moduli, loops of strokes, contact of a sphere, and what is refused."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from analytic.relaxation_loops import loop
from analytic.viscoelastic_contact import indentation
from geometry.design import Design
from geometry.relaxation import Relaxation, branches_text, check_range, constant_loss, moduli, parse_branches

SERIES = Relaxation((0.2, 0.1, 0.25), (0.01, 0.5, 20.0))
MEASURED = Design(prony="0.1:0.1 0.2:10")


def test_fast_and_slow_limits():
    assert SERIES.rest == pytest.approx(0.45, rel=1e-15)
    assert SERIES.modulus([0.0, 1e9]) == pytest.approx([1.0, SERIES.rest], rel=1e-15)
    slow, fast = SERIES.complex_modulus([1e-12, 1e12])
    assert (slow, fast) == (pytest.approx(SERIES.rest, rel=1e-9), pytest.approx(1.0, rel=1e-9))


@pytest.mark.parametrize("omega", [0.03, 2.0, 100.0])
def test_complex_modulus_is_the_transform_of_the_relaxation(omega):
    # G*(w) = G(inf) + i w int_0^inf (G(t) - G(inf)) exp(-i w t) dt
    parts = [
        quad(lambda t: SERIES.modulus(t) - SERIES.rest, 0, np.inf, weight=weight, wvar=omega, limlst=5000)[0]
        for weight in ("cos", "sin")
    ]
    value = SERIES.rest + 1j * omega * complex(parts[0], -parts[1])
    assert SERIES.complex_modulus(omega) == pytest.approx(value, rel=1e-6)


def test_the_covered_range_is_that_of_the_branches_or_of_the_data():
    assert SERIES.speaks_for == (0.01, 20.0)
    assert SERIES.speaks_for_frequencies == pytest.approx((1 / (40 * math.pi), 1 / (0.02 * math.pi)))
    assert parse_branches("0.1:1 0.1:200 0:0.1 0:100").speaks_for == (0.1, 100.0)


def test_text_and_branches_are_inverse():
    assert parse_branches("0.2:0.01 0.25:20 0.1:0.5").shares == SERIES.shares
    for text in ("0.2:0.01 0.1:0.5 0.25:20", "0:0.001 0.2:0.01 0:3"):
        assert branches_text(parse_branches(text)) == text
    assert branches_text(Relaxation((), ())) == "" == Design().prony


@pytest.mark.parametrize("loss", [1e-6, 0.01, 0.1, 0.3, 1.0])
@pytest.mark.parametrize("band", [(0.01, 1000.0), (1.0, 2.0), (3e-3, 7.0)])
def test_loss_factor_is_constant_over_the_band(loss, band):
    relaxation = constant_loss(loss, *band)
    omega = 2 * math.pi * np.geomspace(*band, 997)
    assert relaxation.loss_factor(omega) == pytest.approx(np.full(997, loss), rel=0.02)
    assert relaxation.speaks_for_frequencies == pytest.approx(band, rel=1e-12)
    assert 0 < relaxation.rest < 1
    assert all(g > 0 for g in relaxation.shares)


def test_moduli_at_rest_and_after_a_step():
    prony = "0.2:0.01 0.2:1"
    assert moduli(Design(E=0.6, prony=prony)) == pytest.approx((1.0, 0.6))
    assert moduli(Design(E=0.6, prony=prony, modulus="instantaneous")) == pytest.approx((0.6, 0.36))


BRANCHES = Relaxation((0.1, 0.2, 0.15), (0.02, 0.3, 5.0))
CATALAN = 0.915965594177219


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
    force = np.fft.irfft(np.fft.rfft(way) * BRANCHES.complex_modulus(omega), count)
    up, down = np.interp([half / 2, half + hold + half / 2], time, force)
    result = loop(BRANCHES, 1 / (2 * half), waveform, hold)
    area = np.sum((np.roll(force, -1) + force) / 2 * (np.roll(way, -1) - way))
    expected = (up - down, np.ptp(force), area)
    assert (result.gap, result.full_scale, result.area) == pytest.approx(expected, abs=3e-4)


@pytest.mark.parametrize("waveform", ["sine", "triangle"])
def test_fast_and_slow_strokes_have_no_gap(waveform):
    fast, slow = (loop(BRANCHES, frequency, waveform) for frequency in (1e7, 1e-7))
    assert (fast.gap, slow.gap) == pytest.approx((0, 0), abs=1e-5)
    assert (fast.area, slow.area) == pytest.approx((0, 0), abs=1e-5)
    assert (fast.full_scale, slow.full_scale) == pytest.approx((1.0, BRANCHES.rest), rel=1e-5)


SILICONE = Relaxation((0.1, 0.2, 0.15), (0.02, 0.3, 5.0))
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

    def rate(s, t0, v, d0):
        return SILICONE.modulus(t - s) * 1.5 * np.sqrt(d0 + v * (s - t0)) * v

    return hertz(G0, 1.0) * sum(quad(rate, t0, t1, (t0, v, d0))[0] for t0, t1, v, d0 in pieces(end))


def moved(begin, t):
    """Ting's integral of G(t - s) delta'(s) from a time on, by quadrature."""
    later = ((max(t0, begin), t1, v) for t0, t1, v, _ in pieces(t) if t1 > begin)
    return sum(v * quad(lambda s: SILICONE.modulus(t - s), t0, t1)[0] for t0, t1, v in later)


def test_without_branches_the_force_is_that_of_hertz_both_ways():
    force, contact_radius = indentation(ELASTIC, G0, R, TIMES, DEPTHS)
    assert force == pytest.approx(hertz(G0, DEPTHS), rel=1e-9, abs=1e-12)
    assert contact_radius == pytest.approx(np.sqrt(R * DEPTHS), rel=1e-9, abs=1e-9)


def test_a_growing_contact_is_the_integral_of_lee_and_radok():
    force, _ = indentation(SILICONE, G0, R, TIMES, DEPTHS)
    for k in range(1, 5):
        assert force[k] == pytest.approx(lee_radok(TIMES[k], TIMES[k]), rel=1e-7)


@pytest.mark.parametrize("k", [5, 6])
def test_a_release_is_the_integral_of_ting(k):
    force, contact_radius = indentation(SILICONE, G0, R, TIMES, DEPTHS)
    t1 = brentq(lambda begin: moved(begin, TIMES[k]), 1e-9, 1.0, xtol=1e-13)
    assert contact_radius[k] ** 2 / R == pytest.approx(np.interp(t1, TIMES, DEPTHS), rel=1e-7)
    assert force[k] == pytest.approx(lee_radok(t1, TIMES[k]), rel=1e-6)


def test_a_step_that_is_held_relaxes_as_the_modulus():
    times = np.array([0.0, 0.1, 1.0, 10.0])
    force, _ = indentation(SILICONE, G0, R, times, np.full(4, 0.6))
    assert force == pytest.approx(hertz(G0, 0.6) * SILICONE.modulus(times), rel=1e-12)


def test_only_what_the_data_or_the_band_of_a_loss_factor_cover_is_answered_unless_asked():
    assumed = Design(loss_low=0.1, loss_high=100.0)
    assert check_range(MEASURED, times=[0.1, 3.0, 10.0], frequencies=[0.1, 1.0]) == []
    assert check_range(assumed, frequencies=[0.1, 100.0]) == []
    (warning,) = check_range(MEASURED, frequencies=[600.0], beyond=True)
    assert warning.endswith("not for 600 Hz: the results are an extrapolation")


def indented(times, depths):
    return indentation(SILICONE, G0, R, np.array(times), np.array(depths))


@pytest.mark.parametrize(
    ("call", "parts"),
    [
        (lambda: Design(prony="0.1"), ["prony must list branches g:tau", "such as 0.05:0.01", "got '0.1'"]),
        (lambda: Design(prony="0.1:1,0.2:3"), ["got '0.1:1,0.2:3'"]),
        (lambda: Design(prony="nan:1"), ["got 'nan:1'"]),
        (lambda: Design(prony="0.1:0"), ["tau of a branch must lie between 1e-12", "got 0 s"]),
        (lambda: Design(prony="0.1:-1"), ["got -1 s"]),
        (lambda: Design(prony="-0.1:1"), ["g of a branch must be at least 0 and less than 1; got -0.1"]),
        (lambda: Design(prony="1:1"), ["got 1"]),
        (lambda: Design(prony="0.5:1 0.5:2"), ["must add up to less than 1; got 1"]),
        (lambda: Design(prony="0.1:1 0.2:1.0"), ["tau = 1 s twice: give one branch with the sum"]),
        (lambda: Design(prony="0.1:1 0:2"), ["entries with g = 0 mark the covered times, so give two"]),
        (lambda: Design(prony="0:1 0:2"), ["no branch with a share g above 0", "loss_factor=0 makes an elastic"]),
        (lambda: constant_loss(0.1, 1e-6, 1e6), ["above 0 and at most 10 decades wide; got 1e-06"]),
        (lambda: constant_loss(0.1, 1.0, 1.0), ["got 1 to 1 Hz"]),
        (lambda: constant_loss(1.0, 1e-4, 1e4), ["leaves less than 0.0001 of the instantaneous"]),
        (lambda: constant_loss(50.0, 1.0, 100.0), ["lower loss_factor or narrow the band"]),
        (
            lambda: check_range(MEASURED, times=[20, 40], frequencies=[600]),
            ["0.1 to 10 s", "for 20 to 40 s and 600 Hz"],
        ),
        (lambda: check_range(Design(loss_high=100.0), frequencies=[600.0]), ["600 Hz: change loss_low or loss_high"]),
        (lambda: indented([0.0, 0.0], [0.0, 1.0]), ["the times of an indentation must rise"]),
        (lambda: indented([0.0, 1.0], [0.0, -1.0]), ["grow to one maximum, and then fall"]),
        (lambda: indented([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 0.5, 0.8]), ["grow to one maximum, and then fall"]),
    ],
)
def test_impossible_branches_losses_ranges_and_paths_are_refused(call, parts, refused):
    with refused(*parts):
        call()
