"""One mass on one spring: the ladder of formulas beside the vibration of the finite elements.

A force F on a mass m on a spring k (1 + ...) moves it by x,

    x / F = 1 / (k g - m omega^2),        x k / F = 1 / (g - (f / f0)^2),        f0 = (k / m)^(1/2) / 2 pi,

with k the slow stiffness and g = G*(omega) / G(infinity) the complex modulus over the long-term one:

1. undamped, g = 1: the paper's oscillator (section IV.C), which it drives up to 600 Hz with f0 of about 970 Hz;
2. constant loss factor eta, g = 1 + i eta: the half-power width of its resonance is eta f0;
3. Prony oscillator: g from the branches of the silicone, whose storage modulus also rises with the frequency.

A rod clamped at its base counts with a third of its mass (Rayleigh).
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.cad import beam_volume, magnet_volume
from geometry.design import Design


def receptance(frequency: ArrayLike, natural: float, modulus: ArrayLike = 1.0) -> NDArray[np.complex128]:
    """Return x k / F of the oscillator at frequencies, Hz; 1 for a slow load.

    natural : f0, Hz. modulus : g at these frequencies; 1 without damping, 1 + i eta for a constant loss factor.

    The paper's sensor at 600 Hz, with its natural frequency of 970 Hz and no damping:

    >>> round(abs(complex(receptance(600.0, 970.0))), 2)
    1.62
    """
    ratio = np.asarray(frequency, dtype=np.float64) / natural
    return np.asarray(1 / (np.asarray(modulus) - ratio**2), dtype=np.complex128)


def natural_frequency(stiffness: float, mass: float) -> float:
    """Return f0, Hz, of a stiffness, N/mm, and a mass, g.

    >>> round(natural_frequency(10.0, 0.25))
    1007
    """
    return math.sqrt(stiffness * 1e6 / mass) / (2 * math.pi)


def moving_mass(design: Design) -> float:
    """Return the mass of the magnet and a third of that of the silicone, g.

    >>> from geometry.design import paper
    >>> round(moving_mass(paper()), 3)
    0.318
    """
    volume, core = beam_volume(design.shape), magnet_volume(design.shape)
    return 1e-6 * (design.density * (volume - core) / 3 + design.magnet_density * core)


def spring_mass(design: Design) -> tuple[float, float]:
    """Return the frequencies of a mass on an axial spring, Hz, without and with the magnet's mass.

    The frequency is sqrt(k / m) / 2 pi with k = E A / L and a third of the silicone's mass (Rayleigh's rod). Without
    the magnet it is the paper's "approximately 970 Hz" (section IV.C), as we read it.
    """
    stiffness = design.E_now * math.pi * design.R**2 / design.L
    silicone = 1e-6 * design.density * beam_volume(design.shape) / 3
    return natural_frequency(stiffness, silicone), natural_frequency(stiffness, moving_mass(design))
