"""Noise of a reading: white noise in a bandwidth, average of several samples, steps of the converter, 1/f noise.

One sample. A white noise of density e (V/sqrt(Hz)) passes a low-pass of noise bandwidth B (Hz) before the converter
and adds to an independent noise of standard deviation n (V), such as that of the converter:

    s = sqrt(n^2 + e^2 B).

A first-order low-pass of corner frequency f_c has B = pi/2 f_c.

Average of N samples. The converter rounds each sample to steps q. Let the true output lie anywhere within a step with
equal probability. The mean square error of one sample is then s^2 + q^2/12, of which

    b^2 = sum_{k>=1} q^2 / (2 pi^2 k^2) exp(-4 pi^2 k^2 s^2 / q^2)

is the bias: it is the same in all samples, because it depends on the true output alone. The average divides only the
rest by N. With the noise floor r of an average of any length,

    sigma^2 = r^2 + b^2 + (s^2 + q^2/12 - b^2) / N.

Without noise b^2 is q^2/12: all samples are equal, and averaging does not help. A noise of half a step or more
dithers the converter: b is below 0.002 q, and the steps average away as white noise does. Both limits, and all
between them, follow from the formula, which is exact for normally distributed noise.

Limits. The samples must be independent, taken at 2 B per second or slower; the average of N samples then has a noise
bandwidth of B/N. The floor r stands for 1/f noise and drift, which are taken as constant during one average. It does
not dither, and no averaging reduces it; its value depends on the time since the last zeroing. Errors of gain and
offset, the converter's nonlinearity and the rails are not included.
"""

import math


def of_sample(noise: float, density: float, bandwidth: float) -> float:
    """Return s of one sample before the converter: noise n, V (or T), density e, V/sqrt(Hz), bandwidth B, Hz.

    >>> of_sample(3e-4, 4e-5, 100.0)
    0.0005
    """
    return math.hypot(noise, density * math.sqrt(bandwidth))


def of_average(noise: float, step: float = 0.0, floor: float = 0.0, count: int = 1) -> float:
    """Return sigma of an average: noise s of one sample, V (or T), step q (0: none), floor r, count N of samples.

    Noise far above the step averages; noise far below it does not.

    >>> round(of_average(1e-2, 1e-3, count=100), 7), round(of_average(1e-5, 1e-3, count=100), 7)
    (0.0010004, 0.000279)
    """
    bias = rounding_bias(noise, step)
    error = math.hypot(noise, step / math.sqrt(12))
    return math.hypot(floor, math.sqrt(error**2 / count + bias**2 * (1 - 1 / count)))


def rounding_bias(noise: float, step: float) -> float:
    """Return b, the root mean square of the bias that rounding to steps leaves in an average of any length."""
    if not step:
        return 0.0
    ratio = noise / step
    if ratio < 0.1:
        # Poisson's summation turns the slowly converging series of small noise into this one, whose other terms are
        # below exp(-25); the 9 terms of the other series leave out less than exp(-39)
        return step * math.sqrt(1 / 12 - ratio / math.sqrt(math.pi) + ratio**2)
    terms = (math.exp(-((2 * math.pi * k * ratio) ** 2)) / (2 * math.pi**2 * k**2) for k in range(1, 10))
    return step * math.sqrt(math.fsum(terms))
