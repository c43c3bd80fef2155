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
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

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
    """Force of sensors whose silicone relaxes, from the forces of slow loading at their poses, row by row.

    Parameters
    ----------
    design : its loss factor or branches, and which modulus E is.
    branches : others than those of the design.
    sensors : numbers of them in the axes before the last one of all forces and shears; () for one sensor.

    Attributes
    ----------
    slow : force of slow loading over that of the design's E.
    """

    def __init__(self, design: Design, branches: Relaxation | None = None, sensors: tuple[int, ...] = ()) -> None:
        branches = relaxation_of(design) if branches is None else branches
        self._times, self._grown = np.array(branches.times), np.array(branches.shares) / branches.rest
        self.slow, self._softening = moduli(design)[1] / design.E_now, softening(design)
        self._time, self._last = np.full(sensors, math.nan), np.zeros((*sensors, 3))
        self._parts = np.zeros((*sensors, len(self._times), 3))
        self._least, self._most = np.zeros((2, *sensors, 3))

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
        slow, leaning = self.slow * np.asarray(force, dtype=float), np.zeros(np.shape(force))
        leaning[..., :2] = self._softening * np.asarray(shear)
        return slow + leaning * slow[..., 2:], leaning

    def step(self, time: float, force: Array, shear: Array) -> Array:
        """Return the force (..., 3) at a time, s.

        Parameters
        ----------
        time : not before that of the last step; a change within no time is elastic. NaN where it is not known: the
            force is that of slow loading, from which it may differ by `reach`.
        force, shear : force (..., 3) by the design's E without relaxation, and shear (..., 2) of the plate; NaN where
            they are not known, which gives NaN and is bridged by a straight line.
        """
        resisted, leaning = self._resisted(force, shear)
        known = np.asarray(np.isfinite(resisted).all(axis=-1))
        each = known[..., None]
        # without NaN
        self._least, self._most = np.fmin(self._least, resisted), np.fmax(self._most, resisted)
        if math.isnan(time):
            return np.where(each, self.slow * np.asarray(force, dtype=float), math.nan)
        # NaN before the first row
        x = (np.maximum(time - self._time, INSTANT))[..., None] / self._times
        gained = self._grown * -np.expm1(-x) / x
        parts = np.exp(-x)[..., None] * self._parts + gained[..., None] * (resisted - self._last)[..., None, :]
        self._parts = np.where((known & ~np.isnan(self._time))[..., None, None], parts, self._parts)
        self._time = np.where(known, time, self._time)
        self._last = np.where(each, resisted, self._last)
        now = resisted + self._parts.sum(axis=-2)
        return np.where(each, now - leaning * now[..., 2:], math.nan)


def least_jumps(coder: Decoder) -> Array:
    """Return the changes (k,) of readings, T, from which one is a jump whatever the rows before: above noise, and a
    share of the readings' range in the workspace."""
    places = np.stack(np.meshgrid(*np.linspace(coder.low, coder.high, 3).T)).reshape(3, -1)
    spans = np.ptp(readings_with_slopes(coder.forward, places)[0], axis=1)
    return np.asarray(np.maximum(10 * coder.sigma, LEAST_JUMP * spans))


class RowChecks:
    """What is wrong with rows of readings beside the rows before them.

    Parameters
    ----------
    elements : of the readings, whose noise counts.
    least : (k,) changes of readings below which none is a jump.
    jitter : how much later than it was measured a row may come, s, where its time is that of its arrival.
    sensors : number of them, whose rows come together.
    """

    def __init__(self, elements: Sequence[Element], least: Array, jitter: float = 0.0, sensors: int = 1) -> None:
        # only a noise that moves the converter tells a value at rest from one that is repeated for ever
        self._dithered = np.array([e.noise > 0 and e.noise >= e.step for e in elements])
        size = (sensors, len(least))
        self._least, self._repeats = least, np.zeros(size, dtype=int)
        # the row before, and the last one that was no jump
        self._rows = np.full((2, *size), np.nan)
        # the newest last; NaN while there are less than these
        self._changes, self._intervals = np.full((RECENT, *size), np.nan), np.full((RECENT, sensors), np.nan)
        self._time, self._jitter = math.nan, jitter

    def words(self, time: float, rows: Array) -> list[Status]:
        """Return the statuses of rows (n, k), T, at a time, s, by those before: frozen, after_gap, jump or ok.

        time : NaN where it is not known: then rows that are missing are not seen.
        """
        interval = time - self._time
        self._repeats = np.where(rows == self._rows[0], self._repeats + 1, 0)
        frozen = np.asarray((self._dithered & (self._repeats >= REPEATS - 1)).any(axis=1))
        full = np.isfinite(self._changes[0, :, 0])
        # NaN comes last
        known = np.sort(self._intervals, axis=0)
        middle = known[np.isfinite(known).sum(axis=0) // 2, np.arange(len(rows))]
        late = np.asarray(full & (interval - self._jitter > LATE * middle))
        # a single wrong row is a jump, but neither the way back from it nor a row that stays where a jump led
        changes = np.abs(rows - self._rows)
        apart = (changes > np.maximum(JUMP * self._changes.max(axis=0), self._least)).any(axis=2)
        jumps = np.asarray(apart.all(axis=0))
        change = np.where((apart[0] & ~jumps)[:, None], changes[1], changes[0])
        usual = ~jumps & np.isfinite(change).all(axis=1)
        _replace_oldest(self._changes, change, usual)
        if math.isfinite(interval):
            _replace_oldest(self._intervals, interval, usual)
        self._rows[0], self._rows[1, ~jumps] = rows, rows[~jumps]
        self._time = time
        flags = zip(frozen.tolist(), late.tolist(), jumps.tolist(), strict=True)
        return ["frozen" if f else "after_gap" if g else "jump" if j else "ok" for f, g, j in flags]


def _replace_oldest(recent: Array, values: Array | float, some: NDArray[np.bool_]) -> None:
    """Put further values (n, ...) of `some` sensors (n,) behind recent ones (RECENT, n, ...), whose oldest go."""
    if some.all():
        recent[:-1], recent[-1] = recent[1:], values
    elif some.any():
        recent[:-1, some], recent[-1, some] = recent[1:, some], np.broadcast_to(values, recent.shape[1:])[some]


class TimeSeries:
    """Statuses and forces of decoded rows, by the rows before them; see `RowChecks` and `RelaxingForce`.

    sensors : number of them, whose rows come together.
    """

    def __init__(self, coder: Decoder, jitter: float = 0.0, sensors: int = 1) -> None:
        self._checks = RowChecks(coder.forward.elements, least_jumps(coder), jitter, sensors)
        self._force = RelaxingForce(coder.forward.design, sensors=(sensors,))
        self._lost = [False] * sensors

    def step(
        self, time: float, rows: Array, statuses: Sequence[Status], force: Array, load: Array
    ) -> tuple[list[Status], Array]:
        """Return statuses and forces (n, 3) of rows (n, k), T, at a time, s, from what their readings alone gave.

        A frozen reading gives no force; a row after some without a force is `after_gap`, as one after missing rows. A
        row whose time is not known (NaN) has the force of slow loading, and is `untimed` if its silicone relaxes.
        """
        words, lost = self._checks.words(time, rows), self._lost
        frozen = np.array([word == "frozen" for word in words])
        slow = np.where(frozen[:, None], math.nan, force)
        total = self._force.step(time, slow, load[:, 1:])
        untimed = math.isnan(time) and self._force.relaxes
        self._lost = [untimed or missing for missing in np.asarray(np.isnan(total).any(axis=1)).tolist()]
        return [_told(*each, untimed=untimed) for each in zip(words, lost, statuses, strict=True)], total


def _told(word: Status, lost: bool, status: Status, *, untimed: bool) -> Status:
    """Return the status of a row from what the rows before it say, and its readings alone."""
    if word == "frozen":
        return word
    if lost and word == "ok":
        word = "after_gap"
    if untimed and word != "jump":
        word = "untimed"
    return word if word != "ok" and status in ("ok", "uncalibrated") else status


def over_time(
    coder: Decoder, times: Array, rows: Array, statuses: Sequence[Status], force: Array, load: Array
) -> tuple[list[Status], Array]:
    """Return statuses and forces of rows of one sensor that follow each other, as `TimeSeries` does."""
    past, found, total = TimeSeries(coder), list(statuses), np.empty(force.shape)
    for k, time in enumerate(times.tolist()):
        one = slice(k, k + 1)
        found[one], total[one] = past.step(time, rows[one], found[one], force[one], load[one])
    return found, total


def zeroed(coder: Decoder, offset: Array) -> Decoder:
    """Return a decoder of readings (k,), T, with this offset, whose rails have moved with them."""
    return replace(coder, goal=coder.goal._replace(rails=coder.goal.rails + offset[:, None]))


def zero_offset(coder: Decoder, fields: Array) -> Array:
    """Return what to add to readings (k,), T, from rows of them at rest (n, k); NaN in a row counts in no mean."""
    rest = readings_with_slopes(coder.forward, np.zeros((3, 1)))[0][:, 0]
    return np.asarray(rest - np.nanmean(fields, axis=0))
