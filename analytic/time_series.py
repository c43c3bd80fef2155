"""Rows of readings over time: rows that repeat, are missing or jump, and the force of a silicone that relaxes.

The pose follows from the readings of one moment; the force does not. With Prony branches (g_i, tau_i, rest;
`geometry.relaxation`) the slow, fully relaxed force M(t) at the poses so far gives

    F(t) = M(t) + sum_i h_i(t),     tau_i dh_i/dt + h_i = (g_i / rest) tau_i dM/dt,

and between two rows dt apart, with M straight over time and x = dt / tau_i,

    h_i <- exp(-x) h_i + (g_i / rest) (1 - exp(-x)) / x (M_new - M_old).

The state h decays between rows: errors of old readings are forgotten, and noise of the decoded force grows at most by
1 / rest. The sensor is taken to have rested at the first row.

A press P pushes a sheared column over, by kappa P times the shear s, and the silicone resists P by what P is now, not
by what it would be if press and shear had relaxed alike. So this part is taken out of M along the plate before, and
added after with the press of the moment: M = F_slow + kappa P_slow s, F = M + sum h - kappa P s, with kappa = -dk/dP
of level finite (`analytic.shear_terms.softening`). Without it, the force of a shear of 1 mm after a press of 1 mm on
the paper's sensor misses 5 % of its range, on one 14 mm long 12 %.

Exact for an incompressible silicone under small motions about a press, for any rate. Forces in N, lengths in mm, s.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analytic.decode import Decoder, Status
from analytic.inverse.forward_model import readings_with_slopes
from analytic.parts import Element
from analytic.shear_terms import softening
from geometry.arrays import Array
from geometry.design import Design
from geometry.relaxation import Relaxation, moduli, relaxation_of

REPEATS = 20
"""Rows with equal readings of an element from which it is frozen, if its noise is a step of its converter or more:
such a noise lets 38 % of all readings be equal at most, so that 20 are by chance once in 2e8."""
LATE = 1.5
"""Time between two rows, over the median of those before, from which rows are missing."""
JUMP, LEAST_JUMP = 10.0, 0.05
"""Change of a reading, over the largest of the RECENT rows before and over its range in the workspace, from which it
is a jump."""
RECENT = 8
INSTANT = 1e-12
"""Time, s, that a change within no time takes: that of the shortest branch that a design may have."""


class RelaxingForce:
    """Force of a sensor whose silicone relaxes, from the forces of slow loading at its poses, row by row.

    Parameters
    ----------
    design : its loss factor or branches, and which modulus E is.
    branches : others than those of the design.

    Attributes
    ----------
    slow : force of slow loading over that of the design's E.
    """

    def __init__(self, design: Design, branches: Relaxation | None = None) -> None:
        branches = relaxation_of(design) if branches is None else branches
        self._times, self._grown = np.array(branches.times), np.array(branches.shares) / branches.rest
        self.slow, self._softening = moduli(design)[1] / design.E_now, softening(design)
        self._time, self._last, self._parts = math.nan, np.zeros(3), np.zeros((len(self._times), 3))
        self._least, self._most = np.zeros(3), np.zeros(3)

    @property
    def relaxes(self) -> bool:
        """Whether the silicone relaxes, so that its force depends on time."""
        return bool(self._grown.any())

    def reach(self, force: Array, shear: Array) -> float:
        """Return the most that relaxation may add to the slow force of a row whose time is not known, N.

        By parts, h_i(t) = (g_i / rest) times a mean of M(t) - M(s) over the past, at most its largest change.
        """
        resisted, leaning = self._resisted(force, shear)
        change = np.linalg.norm(np.maximum(self._most - resisted, resisted - self._least))
        return float(self._grown.sum() * change * (1 + np.linalg.norm(leaning)))

    def _resisted(self, force: Array, shear: Array) -> tuple[Array, Array]:
        slow, leaning = self.slow * np.asarray(force, dtype=float), self._softening * np.append(shear, 0.0)
        return slow + leaning * slow[2], leaning

    def step(self, time: float, force: Array, shear: Array) -> Array:
        """Return the force (3,) at a time, s.

        Parameters
        ----------
        time : not before that of the last step; a change within no time is elastic. NaN where it is not known: the
            force is that of slow loading, from which it may differ by `reach`.
        force, shear : force (3,) by the design's E without relaxation, and shear (2,) of the plate; NaN where they
            are not known, which gives NaN and is bridged by a straight line.
        """
        resisted, leaning = self._resisted(force, shear)
        if not np.isfinite(resisted).all():
            return np.full(3, np.nan)
        self._least, self._most = np.minimum(self._least, resisted), np.maximum(self._most, resisted)
        if math.isnan(time):
            return self.slow * np.asarray(force, dtype=float)
        if not math.isnan(self._time):
            x = max(time - self._time, INSTANT) / self._times
            gained = self._grown * -np.expm1(-x) / x
            self._parts = np.exp(-x)[:, None] * self._parts + gained[:, None] * (resisted - self._last)
        self._time, self._last = time, resisted
        now: Array = resisted + self._parts.sum(axis=0)
        return np.asarray(now - leaning * now[2])


def least_jumps(coder: Decoder) -> Array:
    """Return the changes (k,) of readings, T, from which one is a jump whatever the rows before: above noise, and a
    share of the readings' range in the workspace."""
    places = np.stack(np.meshgrid(*np.linspace(coder.low, coder.high, 3).T)).reshape(3, -1)
    spans = np.ptp(readings_with_slopes(coder.forward, places)[0], axis=1)
    return np.asarray(np.maximum(10 * coder.sigma, LEAST_JUMP * spans))


class RowChecks:
    """What is wrong with a row of readings beside the rows before it.

    Parameters
    ----------
    elements : of the readings, whose noise counts.
    least : (k,) changes of readings below which none is a jump.
    jitter : how much later than it was measured a row may come, s, where its time is that of its arrival.
    """

    def __init__(self, elements: Sequence[Element], least: Array, jitter: float = 0.0) -> None:
        # only a noise that moves the converter tells a value at rest from one that is repeated for ever
        self._dithered = np.array([e.noise > 0 and e.noise >= e.step for e in elements])
        self._least = least
        self._repeats, self._row = np.zeros(len(self._least), dtype=int), np.full(len(self._least), np.nan)
        self._steady = self._row
        self._changes: deque[Array] = deque(maxlen=RECENT)
        self._intervals: deque[float] = deque(maxlen=RECENT)
        self._time, self._jitter = math.nan, jitter

    def word(self, time: float, row: Array) -> Status:
        """Return the status of a row (k,), T, at a time, s, by the rows before it: frozen, after_gap, jump or ok.

        time : NaN where it is not known: then rows that are missing are not seen.
        """
        interval, full = time - self._time, len(self._changes) == RECENT
        self._repeats = np.where(row == self._row, self._repeats + 1, 0)
        frozen = bool((self._dithered & (self._repeats >= REPEATS - 1)).any())
        known = sorted(self._intervals)
        late = full and bool(known) and interval - self._jitter > LATE * known[len(known) // 2]
        # a single wrong row is a jump, but neither the way back from it nor a row that stays where a jump led
        changes = np.abs(row - np.stack([self._row, self._steady]))
        least = np.maximum(JUMP * np.max(self._changes, axis=0), self._least) if full else np.inf
        apart = (changes > least).any(axis=1)
        jumps = bool(apart.all())
        change = changes[apart.argmin()]
        if not jumps:
            self._steady = row
            if np.isfinite(change).all():
                self._changes.append(change)
                if math.isfinite(interval):
                    self._intervals.append(interval)
        self._time, self._row = time, row
        return "frozen" if frozen else "after_gap" if late else "jump" if jumps else "ok"


class TimeSeries:
    """Status and force of decoded rows, by the rows before them; see `RowChecks` and `RelaxingForce`."""

    def __init__(self, coder: Decoder, jitter: float = 0.0) -> None:
        self._checks = RowChecks(coder.forward.elements, least_jumps(coder), jitter)
        self._force = RelaxingForce(coder.forward.design)
        self._lost = False

    def step(self, time: float, row: Array, status: Status, force: Array, load: Array) -> tuple[Status, Array]:
        """Return status and force (3,) of a row (k,), T, at a time, s, from what its readings alone gave.

        A frozen reading gives no force; a row after some without a force is `after_gap`, as one after missing rows. A
        row whose time is not known (NaN) has the force of slow loading, and is `untimed` if its silicone relaxes.
        """
        word, lost = self._checks.word(time, row), self._lost
        total = np.full(3, np.nan) if word == "frozen" else self._force.step(time, force, load[1:])
        untimed = math.isnan(time) and self._force.relaxes
        self._lost = untimed or bool(np.isnan(total).any())
        if word == "frozen":
            return word, total
        if lost and word == "ok":
            word = "after_gap"
        if untimed and word != "jump":
            word = "untimed"
        return (word if word != "ok" and status in ("ok", "uncalibrated") else status), total


def zeroed(coder: Decoder, offset: Array) -> Decoder:
    """Return a decoder of readings (k,), T, with this offset, whose rails have moved with them."""
    return replace(coder, goal=coder.goal._replace(rails=coder.goal.rails + offset[:, None]))


def zero_offset(coder: Decoder, fields: Array) -> Array:
    """Return what to add to readings (k,), T, from rows of them at rest (n, k); NaN in a row counts in no mean."""
    rest = readings_with_slopes(coder.forward, np.zeros((3, 1)))[0][:, 0]
    return np.asarray(rest - np.nanmean(fields, axis=0))
