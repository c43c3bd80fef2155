"""The loop of force over stroke of a viscoelastic spring: its gap at mid-stroke and its area, in closed form.

The spring has the stiffness k(t) = k0 (rest + sum g_i exp(-t / tau_i)) and moves to and fro over the stroke X, for so
long that each cycle is like the one before. The gap is the difference of its forces at mid-stroke, on the way up and
on the way down. Full scale is the difference of its forces at both ends of the stroke.

Sine of frequency f, w = 2 pi f, G* = G' + i G'' relative to k0:

    gap = X k0 G'',   full scale = X k0 G',   gap / full scale = tan(delta),   area = pi/4 X^2 k0 G''.

Triangle with the half period h = 1 / (2 f), z_i = h / (2 tau_i):

    gap        = X k0 sum g_i (1 - 1 / cosh(z_i)) / z_i,
    full scale = X k0 (rest + sum g_i tanh(z_i) / z_i),
    area       = X^2 k0 sum g_i (1 - tanh(z_i) / z_i) / z_i.

A fast stroke (z -> 0) and a slow one (z -> inf) both have no gap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.loads import Waveform
from geometry.prony import Relaxation


@dataclass(frozen=True, slots=True)
class Loop:
    """The loop of force over stroke, relative to the instantaneous stiffness k0 and the stroke X.

    Attributes
    ----------
    gap : difference of the forces at mid-stroke, over k0 X.
    full_scale : difference of the forces at the ends of the stroke, over k0 X.
    area : work that a cycle dissipates, over k0 X^2.
    """

    gap: float
    full_scale: float
    area: float

    @property
    def hysteresis(self) -> float:
        """The gap over full scale: tan(delta) for a sine."""
        return self.gap / self.full_scale


def loop(relaxation: Relaxation, frequency: float, waveform: Waveform = "triangle") -> Loop:
    """Return the loop of a viscoelastic spring that is moved at a frequency, Hz.

    >>> round(loop(Relaxation((0.5,), (1.0,)), 0.5 / np.pi, "sine").hysteresis, 12) == round(0.25 / 0.75, 12)
    True
    """
    if waveform == "sine":
        modulus = complex(relaxation.complex_modulus(2 * np.pi * frequency))
        return Loop(modulus.imag, modulus.real, np.pi / 4 * modulus.imag)
    g, z = np.array(relaxation.shares), 1 / (4 * frequency * np.array(relaxation.times))
    # 1 / cosh without overflow; 1 - 1 / cosh and 1 - tanh(z) / z without cancellation for small z
    sech = 2 * np.exp(-z) / (1 + np.exp(-2 * z))
    rise = 2 * np.sinh(np.minimum(z, 300.0) / 2) ** 2 * sech
    rise = np.where(z > 20, 1 - sech, rise)
    left = np.where(z < 1e-2, z**2 / 3 - 2 * z**4 / 15, 1 - np.tanh(z) / z)
    return Loop(
        gap=float(np.sum(g * rise / z)),
        full_scale=relaxation.rest + float(np.sum(g * np.tanh(z) / z)),
        area=float(np.sum(g * left / z)),
    )
