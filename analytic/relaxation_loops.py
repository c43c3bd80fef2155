"""The loop of force over stroke of a viscoelastic spring: its gap at mid-stroke and its area, in closed form.

The spring has the stiffness k(t) = k0 (rest + sum g_i exp(-t / tau_i)). It moves over the stroke X in the time h,
rests for the time r, moves back and rests again, for so long that each cycle is like the one before. The gap is the
difference of its forces at mid-stroke, on the way up and on the way down. Full scale is the difference of its largest
and its least force, as in tables of measured and computed cycles.

The force of branch i over k0 X is q_i, with dq/dt + q / tau = g v / X. It changes its sign from stroke to stroke, so
that a stroke begins with q = -H q_end, H = exp(-r / tau). With E = exp(-h / tau), e = exp(-h / (2 tau)):

Triangle, z = h / (2 tau), v = X / h:

    q_end      = g / (2 z) (1 - E) / (1 + E H),
    gap        = sum g / z (1 - e) (1 - H e) / (1 + E H),
    full scale = rest + 2 sum q_end: the force is largest at the end of a stroke,
    area       = sum g / (2 z^2) (2 z - (1 - E) (1 + H) / (1 + E H)).

Sine, s = pi tau / h, v = X pi / (2 h) sin(pi t / h):

    q(t)       = g / 2 s / (1 + s^2) (sin(pi t / h) - s cos(pi t / h) + s (1 - H) / (1 + H E) exp(-t / tau)),
    gap        = sum g s / (1 + s^2) (1 + s e (1 - H) / (1 + H E)),
    full scale = twice the largest force of a stroke,
    area       = sum g pi / 4 s / (1 + s^2) + g / 2 (s^2 / (1 + s^2))^2 (1 - H) (1 + E) / (1 + H E).

Gap and full scale are over k0 X, the area over k0 X^2. Limits: a sine without rests has gap / full scale =
sin(delta), full scale |G*| and the area pi/4 G'' of its ellipse (G* = G' + i G'' over the instantaneous modulus);
fast and slow strokes without rests have no gap; after long rests fast strokes have the gap sum g_i.
"""

from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array
from geometry.loads import Waveform
from geometry.relaxation import Relaxation


@dataclass(frozen=True, slots=True)
class Loop:
    """The loop of force over stroke, relative to the instantaneous stiffness k0 and the stroke X.

    Attributes
    ----------
    gap : difference of the forces at mid-stroke, over k0 X.
    full_scale : difference of the largest and the least force, over k0 X.
    area : work that a cycle dissipates, over k0 X^2.
    """

    gap: float
    full_scale: float
    area: float

    @property
    def hysteresis(self) -> float:
        """The gap over full scale: sin(delta) for a sine without rests."""
        return self.gap / self.full_scale


def loop(relaxation: Relaxation, frequency: float, waveform: Waveform = "triangle", hold: float = 0.0) -> Loop:
    """Return the loop of a viscoelastic spring in steady cycles.

    frequency : cycles per second without the rests, Hz: 1 / (2 h). hold : rest at each end of the stroke, s.

    >>> half = Relaxation((0.5,), (1.0,))
    >>> round(loop(half, 0.5 / np.pi, "sine").hysteresis, 6), round(float(np.sin(np.arctan(0.25 / 0.75))), 6)
    (0.316228, 0.316228)
    """
    half = 1 / (2 * frequency)
    return _triangle(relaxation, half, hold) if waveform == "triangle" else _sine(relaxation, half, hold)


def _triangle(relaxation: Relaxation, half: float, hold: float) -> Loop:
    g, tau = np.array(relaxation.shares), np.array(relaxation.times)
    z, rest = half / (2 * tau), hold / tau
    held, decayed = np.exp(-rest), np.exp(-2 * z - rest)
    moved = -np.expm1(-2 * z)
    gap = g / z * np.expm1(-z) * np.expm1(-z - rest) / (1 + decayed)
    end = g / (2 * z) * moved / (1 + decayed)
    # (1 - E) (1 + H) / (1 + E H) = (1 - E) + (1 - E)^2 H / (1 + E H)
    # a series where 2 z - (1 - E) loses digits
    straight = np.where(z < 1e-2, 2 * z**2 - 4 * z**3 / 3 + 2 * z**4 / 3 - 4 * z**5 / 15, 2 * z - moved)
    area = g / (2 * z**2) * (straight - moved**2 * held / (1 + decayed))
    return Loop(float(gap.sum()), relaxation.rest + 2 * float(end.sum()), float(area.sum()))


def _sine(relaxation: Relaxation, half: float, hold: float) -> Loop:
    g, tau = np.array(relaxation.shares), np.array(relaxation.times)
    s, decayed = np.pi * tau / half, np.exp(-half / tau)
    rested = _rested(tau, half, hold)
    gap = g * s / (1 + s**2) * (1 + s * np.exp(-half / (2 * tau)) * rested)
    area = g * np.pi / 4 * s / (1 + s**2) + g / 2 * (s**2 / (1 + s**2)) ** 2 * (1 + decayed) * rested
    return Loop(float(gap.sum()), 2 * _largest_of_sine(relaxation, half, hold), float(area.sum()))


def _rested(tau: Array, half: float, hold: float) -> Array:
    """Return (1 - H) / (1 + H E): what a rest adds to a sine that never rests."""
    return np.asarray(-np.expm1(-hold / tau) / (1 + np.exp(-(hold + half) / tau)))


def _largest_of_sine(relaxation: Relaxation, half: float, hold: float) -> float:
    """Return the largest force of a stroke over k0 X; it comes before the end of the stroke."""
    if not hold:
        return abs(complex(relaxation.complex_modulus(np.pi / half))) / 2
    from scipy.optimize import minimize_scalar

    g, tau = np.array(relaxation.shares), np.array(relaxation.times)
    s = np.pi * tau / half

    def opposite(time: float) -> float:
        angle = np.pi * time / half
        branches = np.sin(angle) - s * np.cos(angle) + s * _rested(tau, half, hold) * np.exp(-time / tau)
        return float(relaxation.rest / 2 * np.cos(angle) - (g / 2 * s / (1 + s**2)) @ branches)

    found = minimize_scalar(opposite, bounds=(half / 2, half), method="bounded", options={"xatol": 1e-9 * half})
    return -float(found.fun)
