"""Force over the motion of a plate along a path, and the first state on it that has a wanted force.

The motion is the depth of a press, or the shear after it. Every new state is reached from the last solved one before
it, never backwards, so the curve is that of a monotone loading; with Coulomb friction that matters. Lengths are over
D, forces over E D^2.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from fem.solve.newton import Stop
from fem.solve.path_state import PathState

FORCE_TOLERANCE = 1e-4
"""Relative difference from the wanted force at which a search ends. The error estimates of level fine are larger, and
the search converges so fast that a looser tolerance would save less than one state."""
SHARED_TOLERANCE = 1e-3
"""The same where two states bracket the wanted force without room for another one between them: with Coulomb friction
the force depends a little on the increments before it."""
LONGEST_RATIO, SHORTEST_RATIO = 1.5, 1.001
"""Largest and least ratio of a motion to the one before, until two states bracket the force. A larger one may lead
into loads that no solve reaches; a smaller one would creep towards a force at which the curve is flat."""
RESOLUTION = 1e-7
"""Width of the bracket, over its upper end, at which the force jumps between its two ends."""


@dataclass(frozen=True, slots=True)
class CurvePoint:
    """A solved state of a loading curve.

    Attributes
    ----------
    motion : depth, or shear, over D.
    force : force along the motion, over E D^2.
    stop : why the path ended here; empty if it did not.
    """

    motion: float
    force: float
    state: PathState
    stop: Stop = ""


class ForceNotReached(Exception):
    """No state of a curve has the wanted force.

    Attributes
    ----------
    point : the state with the largest force, or the one before a jump of the force; the first one, at motion 0, if
        that has a larger force already, such as the force along a tilted plate.
    last : the last state of the curve.
    beyond : the state after the jump; None where the force is too large.
    """

    def __init__(self, point: CurvePoint, last: CurvePoint, beyond: CurvePoint | None = None) -> None:
        super().__init__(point, last, beyond)
        self.point, self.last, self.beyond = point, last, beyond


class Movable(Protocol):
    """A path with a present state, which may return to an earlier one."""

    @property
    def state(self) -> PathState: ...
    def restart(self, state: PathState) -> None: ...


class LoadingCurve:
    """The solved states of a path along one motion, in its order.

    Parameters
    ----------
    path : path whose present state is the first one of the curve, at motion 0.
    move : moves the path to a motion; returns why it stopped on the way.
    measure : returns motion and force of a state.
    power : power of the motion with which the force grows at first.
    most : largest motion.
    ended : whether no further motion increases the force.

    Attributes
    ----------
    points : the states.
    """

    def __init__(
        self,
        path: Movable,
        move: Callable[[float], Stop],
        measure: Callable[[PathState], tuple[float, float]],
        *,
        power: float,
        most: float,
        ended: Callable[[PathState], bool] = lambda _: False,
    ) -> None:
        self._path, self._move, self._measure, self._power = path, move, measure, power
        self.most, self.ended = most, ended
        self.points = [CurvePoint(*measure(path.state), path.state)]

    def reach(self, motion: float) -> CurvePoint:
        """Return the state at a motion, or the one at which the path stops before it."""
        after = bisect.bisect_right(self.points, motion * (1 + 1e-12), key=lambda point: point.motion)
        before = self.points[after - 1]
        if math.isclose(before.motion, motion, rel_tol=1e-12):
            return before
        self._path.restart(before.state)
        stop = self._move(motion)
        point = CurvePoint(*self._measure(self._path.state), self._path.state, stop)
        bisect.insort(self.points, point, key=lambda point: point.motion)
        return point

    def find(self, force: float, guess: float) -> CurvePoint:
        """Return the first state with a force.

        Parameters
        ----------
        guess : first motion to try on an empty curve.

        Raises
        ------
        ForceNotReached
            The path stops, or its motion ends, before the force; or the force jumps past it.
        """
        low, high = self._bracket(force, guess)
        for point in (low, high):
            if _close(point, force, FORCE_TOLERANCE):
                return point
        self._bisect(force, low, high)
        point = min(self.points, key=lambda point: abs(point.force - force))
        if not _close(point, force, SHARED_TOLERANCE):
            after = next(k for k, each in enumerate(self.points) if each.force >= force)
            raise ForceNotReached(self.points[after - 1], self.points[-1], self.points[after])
        return point

    def _bracket(self, force: float, guess: float) -> tuple[CurvePoint, CurvePoint]:
        """Return neighbouring states between which the force is reached first; the second one has at least the force.

        The states are extrapolated in the variable of `_excess`, in which the beginning of a curve is straight.
        """
        while True:
            after = next((k for k, point in enumerate(self.points) if self._excess(point, force) >= 0), None)
            if after:
                return self.points[after - 1], self.points[after]
            first = self.points[0]
            if after == 0 and not _close(first, force, FORCE_TOLERANCE):
                raise ForceNotReached(first, self.points[-1])
            if after == 0:
                return first, first
            last = self.points[-1]
            if _close(last, force, FORCE_TOLERANCE):
                return last, last
            if last.stop or self.ended(last.state) or last.motion >= self.most:
                raise ForceNotReached(max(self.points, key=lambda point: point.force), last)
            self.reach(min(self._next_motion(force, guess), self.most))

    def _next_motion(self, force: float, guess: float) -> float:
        """Return a motion at which the force is expected, from the last two states."""
        if len(self.points) == 1:
            return guess
        before, last = self.points[-2:]
        rise = self._excess(last, force) - self._excess(before, force)
        ahead = -self._excess(last, force) * (last.motion - before.motion) / rise if rise > 0 else math.inf
        return last.motion * min(max(1 + ahead / last.motion, SHORTEST_RATIO), LONGEST_RATIO)

    def _bisect(self, force: float, low: CurvePoint, high: CurvePoint) -> None:
        """Solve for states between two until one has the force, or they are as close as RESOLUTION."""
        # deferred: a press to a depth needs no root search
        from scipy.optimize import brentq

        def excess(motion: float) -> float:
            point = self.reach(motion)
            # a root exactly: the search ends here
            return 0.0 if _close(point, force, FORCE_TOLERANCE) else self._excess(point, force)

        brentq(excess, low.motion, high.motion, xtol=RESOLUTION * high.motion)

    def _excess(self, point: CurvePoint, force: float) -> float:
        """Return the force of a state over the wanted one, to the power at which it is proportional to the motion."""
        share = point.force / force
        return math.copysign(abs(share) ** (1 / self._power), share) - 1


def _close(point: CurvePoint, force: float, tolerance: float) -> bool:
    """Return whether the force of a state is the wanted one."""
    return abs(point.force - force) <= tolerance * force
