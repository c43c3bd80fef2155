"""Force of a rigid sphere on a viscoelastic half space: Lee and Radok for a growing contact, Ting for its release.

The half space is incompressible (nu = 0.5) and linear, with the shear relaxation G(t) = G0 (rest + sum g_i
exp(-t / tau_i)); the sphere of radius R is smooth, and its depth delta(t) small against R. While the depth grows
(Lee and Radok 1960), and up to the largest contact at t_m,

    P(t) = 16/3 sqrt(R) int_0^t G(t - s) d(delta^1.5)(s),    a(t) = sqrt(R delta(t)).

While it falls (Ting 1966), the contact at t is the one that the growing contact had at an earlier time t1(t) < t_m:

    int_t1^t G(t - s) delta'(s) ds = 0,
    P(t) = 16/3 sqrt(R) int_0^t1 G(t - s) d(delta^1.5)(s),    a(t) = a(t1),

and the sphere leaves the half space when no t1 > 0 is left, before the depth is 0 again. A step of the depth at t = 0
is a rise within no time. Without branches both are
Hertz's force 16/3 sqrt(R) G delta^1.5. With mm and MPa, forces are in N.

The depth is linear between given times. On a piece of rising depth, delta = v u, the integral of a branch has the
closed form

    int exp(-(u1 - u) / tau) d(u^1.5) = 1.5 tau^1.5 [F(x1) - exp(-(x1 - x0)) F(x0)],  x = u / tau,
    F(x) = int_0^x exp(-(x - y)) sqrt(y) dy = sqrt(x) - D(sqrt(x)),

D is Dawson's function.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array
from geometry.design import BadInput
from geometry.relaxation import Relaxation


@dataclass(frozen=True, slots=True)
class _Path:
    """Depth of the sphere over time, linear in between, and its material; times and depths have shape (n,)."""

    relaxation: Relaxation
    times: Array
    depths: Array

    def integral(self, begin: float, end: float, t: float, power: float) -> float:
        """Return int G(t - s) / G0 d(delta^power)(s) from one time to another, mm^power; for a power of 1.5 the depth
        must not fall."""
        tau = np.array(self.relaxation.times)
        shares = np.array([self.relaxation.rest, *self.relaxation.shares])
        inner = self.times[(self.times > begin) & (self.times < end)]
        at = np.concatenate([[begin], inner, [end]]) if end > begin else np.array([end])
        depth, total = np.interp(at, self.times, self.depths), 0.0
        for (t0, d0), (t1, d1) in itertools.pairwise(zip(at, depth, strict=True)):
            v = (d1 - d0) / (t1 - t0)
            if power == 1:
                relaxed = v * np.append(t1 - t0, -tau * np.expm1(-(t1 - t0) / tau))
            elif v > 0:
                x0, x1 = d0 / v / tau, d1 / v / tau
                decayed = 1.5 * tau**1.5 * (_half_power(x1) - np.exp(-(x1 - x0)) * _half_power(x0))
                relaxed = v**1.5 * np.append((d1 / v) ** 1.5 - (d0 / v) ** 1.5, decayed)
            else:
                continue
            total += float(relaxed @ (shares * np.exp(-np.append(0.0, 1 / tau) * (t - t1))))
        return total


def _half_power(x: Array) -> Array:
    """Return F(x) = sqrt(x) - D(sqrt(x)) of the module's text."""
    from scipy.special import dawsn

    w = np.sqrt(x)
    # near 0 the difference cancels: F = 2/3 x^1.5 (1 - 2/5 x + 4/35 x^2 - ...)
    series = 2 / 3 * x**1.5 * (1 - 2 / 5 * x + 4 / 35 * x**2 - 8 / 315 * x**3)
    return np.asarray(np.where(x < 1e-3, series, w - dawsn(w)))


def indentation(
    relaxation: Relaxation, shear_modulus: float, radius: float, times: Array, depths: Array
) -> tuple[Array, Array]:
    """Return the force on a rigid sphere, N, and the radius of its contact, mm, at the given times, both (n,).

    Parameters
    ----------
    shear_modulus : instantaneous shear modulus G0, MPa.
    radius : of the sphere, mm.
    times : rising, s, shape (n,).
    depths : mm, linear between the times, shape (n,); a depth above 0 at the first time is a step. They grow or stay
        up to their largest value, and then fall or stay.

    Raises
    ------
    BadInput
        The times do not rise, or the depths are negative or have a second maximum.
    """
    times, depths = np.asarray(times, dtype=float), np.asarray(depths, dtype=float)
    if not (len(times) > 1 and (np.diff(times) > 0).all()):
        raise BadInput("the times of an indentation must rise, and be two or more")
    top = int(np.argmax(depths))
    if not ((depths >= 0).all() and (np.diff(depths[: top + 1]) >= 0).all() and (np.diff(depths[top:]) <= 0).all()):
        raise BadInput("the depths of an indentation must be 0 or more, grow to one maximum, and then fall")
    path = _Path(relaxation, times, depths)
    contacts = [_contact(path, top, k) for k in range(len(times))]
    begin, reached = float(times[0]), np.array([depth for _, depth in contacts])
    # the step to the first depth, of which a release within the step takes back a part, and what follows it
    stepped = np.where([t1 > begin for t1, _ in contacts], depths[0], reached) ** 1.5 * relaxation.modulus(
        times - begin
    )
    after = [path.integral(begin, t1, float(t), 1.5) for (t1, _), t in zip(contacts, times, strict=True)]
    return 16 / 3 * np.sqrt(radius) * shear_modulus * (stepped + after), np.sqrt(radius * reached)


def _contact(path: _Path, top: int, k: int) -> tuple[float, float]:
    """Return the time t1 at which the growing contact was as large as at time k, and its depth then, mm."""
    from scipy.optimize import brentq

    times, t = path.times, float(path.times[k])
    # a hold at the largest depth belongs to the growing contact
    last = int(np.flatnonzero(path.depths == path.depths[top])[-1])
    if k <= last:
        return t, float(path.depths[k])
    begin = float(times[0])
    moved = path.integral(begin, t, t, 1)
    if moved <= 0:
        # the contact is as large as at some depth of the step at the beginning, or gone
        return begin, max(float(path.depths[0]) + moved / float(path.relaxation.modulus(t - begin)), 0.0)
    t1 = float(
        brentq(lambda each: path.integral(each, t, t, 1), begin, times[last], xtol=1e-14 * (t - begin), rtol=1e-14)
    )
    return t1, float(np.interp(t1, times, path.depths))
