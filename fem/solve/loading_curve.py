"""The force along one motion, a press or a shear, and the search for the state in which it is a wanted one.

    curve = LoadingCurve([at_rest], move, power=3 / 2, most=0.4)
    found = curve.find(force, guess)

States are solved where the search needs them, each from the last one before it and never backwards, so that the force
over the motion is that of a monotone loading; with Coulomb friction that matters. Between two states that bracket the
force the root is found by Brent's method, in a variable in which the beginning of the curve is straight: Hertz's
contact grows like the depth to the power 3/2. Motions are over D, forces over E D^2.
"""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from fem.solution import Stop
from fem.solve.path_state import PathState

FORCE_TOLERANCE = 1e-4
"""Relative difference from the wanted force at which a search ends. The error estimates of level fine are larger, and
the search converges so fast that a looser tolerance would save less than one state."""
SHARED_TOLERANCE = 1e-3
"""The same where two states bracket the wanted force without room for another one between them: with Coulomb friction
the force depends a little on the increments before it."""
LEAST_APART = 1e-3
"""Least relative distance of two motions between which a power of the force is measured: that is far above the
tolerance of Newton's method."""


@dataclass(frozen=True, slots=True)
class CurvePoint:
    """A solved state of a loading curve.

    motion, force : depth or shear over D, and force along it over E D^2.
    stop : why the path ended here; empty if it did not.
    iterations : Newton iterations from the state before.
    before : the point from which it was reached; None for the first one.
    """

    motion: float
    force: float
    state: PathState
    stop: Stop = ""
    iterations: int = 0
    before: CurvePoint | None = None

    def has(self, force: float, tolerance: float = FORCE_TOLERANCE) -> bool:
        """Return whether the force is the wanted one."""
        return abs(self.force - force) <= tolerance * force


@dataclass(frozen=True, slots=True)
class NotReached:
    """Why no state of a curve has the wanted force.

    point : the state with the largest force, or the one before a jump of the force; the first one, at motion 0, if
        that has a larger force already, such as the force along a tilted plate.
    last : the last state of the curve.
    beyond : the state after the jump; None where the force is too large.
    fell : whether the force of `last` is below that of `point`, which a curve must not do.
    """

    point: CurvePoint
    last: CurvePoint
    beyond: CurvePoint | None = None
    fell: bool = False


Move = Callable[[PathState, float], CurvePoint]
"""Returns the point at a motion, or where the path stops before it, from the state of an earlier point."""
Watch = Callable[[float], None]
"""Is called before each solve with its motion."""


@dataclass(slots=True)
class LoadingCurve:
    """The solved states along one motion, in its order; at first only that at motion 0.

    move : leads to the next ones.
    power : power of the motion with which the force grows at first.
    most : largest motion.
    ended : whether no further motion increases the force.
    growth : largest ratio of a motion to the last one: a larger one may lead into loads that no solve reaches, a
        smaller one would creep where the curve is flat.
    falls : whether the curve may fall; where not, it ends there, since a load in newtons does not follow it.
    iterations : Newton iterations of all states.
    """

    points: list[CurvePoint]
    move: Move
    power: float
    most: float
    ended: Callable[[PathState], bool] = lambda _: False
    growth: float = 1.5
    falls: bool = True
    iterations: int = 0

    def reach(self, motion: float, watch: Watch = lambda _: None) -> CurvePoint:
        """Return the state at a motion, or the one at which the path stops before it."""
        after = bisect.bisect_right(self.points, motion * (1 + 1e-12), key=lambda point: point.motion)
        before = self.points[after - 1]
        if math.isclose(before.motion, motion, rel_tol=1e-12):
            return before
        watch(motion)
        point = replace(self.move(before.state, motion), before=before)
        self.iterations += point.iterations
        bisect.insort(self.points, point, key=lambda point: point.motion)
        return point

    def find(self, force: float, guess: float, watch: Watch = lambda _: None) -> CurvePoint | NotReached:
        """Return the first state with a force: a root of the curve between two states that bracket it.

        It is not reached where the path stops, or its motion ends, before the force; or the force jumps past it.

        guess : first motion to try on an empty curve.
        """
        # deferred: a press to a depth needs no root search
        from scipy.optimize import brentq

        after = self._bracket(force, guess, watch)
        if isinstance(after, NotReached):
            return after
        ends = self.points[max(after - 1, 0)], self.points[after]
        for point in ends:
            if point.has(force):
                return point
        # a force that rises by more than FORCE_TOLERANCE within so short a motion jumps: it rises 1 / FORCE_TOLERANCE
        # times as fast as the motion
        narrow = FORCE_TOLERANCE**2 * ends[1].motion
        # brentq wraps its function in a cycle: what it must not keep alive is an argument
        brentq(_excess_at, *(end.motion for end in ends), args=(self, force, watch), xtol=narrow)
        point = min(self.points, key=lambda point: abs(point.force - force))
        if point.has(force, SHARED_TOLERANCE):
            return point
        after = next(k for k, each in enumerate(self.points) if each.force >= force)
        return NotReached(self.points[after - 1], self.points[-1], self.points[after])

    def _bracket(self, force: float, guess: float, watch: Watch) -> int | NotReached:
        """Return the number of the first state that has at least the force, or as good as that.

        The states are extrapolated in the variable of `excess`, in which the beginning of a curve is straight.
        """
        while True:
            after = next((k for k, point in enumerate(self.points) if self.excess(point, force) >= 0), None)
            fallen = next(
                (k for k, (one, next_) in enumerate(itertools.pairwise(self.points)) if _falls(one, next_)), None
            )
            if not self.falls and fallen is not None and (after is None or after > fallen):
                return NotReached(self.points[fallen], self.points[fallen + 1], fell=True)
            first, last = self.points[0], self.points[-1]
            if after == 0 and not first.has(force):
                return NotReached(first, last)
            if after is not None:
                return after
            if last.has(force):
                return len(self.points) - 1
            if last.stop or self.ended(last.state) or last.motion >= self.most:
                return NotReached(max(self.points, key=lambda point: point.force), last)
            motion = min(self._next_motion(force, guess), self.most)
            point = self.reach(motion, watch)
            # a path to a larger motion may stop before a state that a shorter way has reached
            if point.stop and point.motion < last.motion:
                return NotReached(max(self.points, key=lambda point: point.force), point)

    def _next_motion(self, force: float, guess: float) -> float:
        """Return a motion at which the force is expected, from the last two states."""
        if len(self.points) == 1:
            return guess
        before, last = self.points[-2:]
        rise = self.excess(last, force) - self.excess(before, force)
        ahead = -self.excess(last, force) * (last.motion - before.motion) / rise if rise > 0 else math.inf
        return last.motion * min(max(1 + ahead / last.motion, 1.001), self.growth)

    def power_at(self, point: CurvePoint) -> float:
        """Return the power of the motion with which the force grows near a point; `power` where no other one is near.

        >>> states = [CurvePoint(motion, motion**1.5, None) for motion in (0.0, 1.0, 2.0)]
        >>> round(LoadingCurve(states, None, power=1.0, most=3.0).power_at(states[2]), 9)
        1.5
        """
        others = [one for one in self.points if one.force > 0 and one.motion > 0]
        apart = [abs(math.log(one.motion / point.motion)) for one in others]
        near = min(((gap, k) for k, gap in enumerate(apart) if gap > LEAST_APART), default=None)
        if near is None:
            return self.power
        other = others[near[1]]
        return math.log(other.force / point.force) / math.log(other.motion / point.motion)

    def excess(self, point: CurvePoint, force: float) -> float:
        """Return the force of a state over the wanted one, to the power at which it is proportional to the motion."""
        share = point.force / force
        return math.copysign(abs(share) ** (1 / self.power), share) - 1


def _falls(point: CurvePoint, after: CurvePoint) -> bool:
    """Return whether the force falls from one point to the next one, farther than searches tell forces apart."""
    return after.force < point.force - SHARED_TOLERANCE * max(abs(point.force), abs(after.force))


def _excess_at(motion: float, curve: LoadingCurve, force: float, watch: Watch) -> float:
    point = curve.reach(motion, watch)
    # a root exactly: the search ends here
    return 0.0 if point.has(force) else curve.excess(point, force)
