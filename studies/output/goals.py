"""Goals of a study: what was measured, and whether it keeps its bound; without data a goal is missed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Goal:
    """A measured value and its bound.

    value : None or NaN where nothing could be measured.
    bound : largest value, or least one if `at_least`.
    count : number of cases from which the value follows; without cases it says nothing.

    >>> Goal("largest error", 0.4, 1.0, 12, "%").met, Goal("largest error", math.nan, 1.0, 12, "%").met
    (True, False)
    >>> Goal("largest error", 0.0, 1.0, 0, "%").met
    False
    """

    name: str
    value: float | None
    bound: float
    count: int
    unit: str = ""
    at_least: bool = False

    def __post_init__(self) -> None:
        if not math.isfinite(self.bound):
            raise ValueError(f"a goal needs a finite bound; {self.name} has {self.bound}")

    @property
    def known(self) -> bool:
        """Whether there is a measured value."""
        return self.count > 0 and self.value is not None and not math.isnan(self.value)

    @property
    def met(self) -> bool:
        """Whether a value is known and keeps its bound."""
        if not self.known or self.value is None:
            return False
        return bool(self.value >= self.bound if self.at_least else self.value <= self.bound)

    def __str__(self) -> str:
        """Name, value and bound.

        >>> str(Goal("share within", 91.3, 95, 40, "%", at_least=True)), str(Goal("largest error", None, 3, 0, "%"))
        ('share within: 91.3 %, goal at least 95 %', 'largest error: no data, goal at most 3 %')
        """
        value = f"{self.value:.3g} {self.unit}".rstrip() if self.known else "no data"
        return f"{self.name}: {value}, goal {self.limit}"

    @property
    def limit(self) -> str:
        """The bound in words."""
        return f"at {'least' if self.at_least else 'most'} {self.bound:g} {self.unit}".rstrip()


def missed(goals: Sequence[Goal]) -> list[Goal]:
    """Return the goals that are missed."""
    return [goal for goal in goals if not goal.met]


def verdict(goals: Sequence[Goal]) -> str:
    """Return how many goals are met, in a sentence.

    >>> verdict([]), verdict([Goal("share", 1.0, 0.9, 3, at_least=True), Goal("error", None, 1.0, 0)])
    ('Nothing was measured: no goal is met.', '1 of 2 goals are met, 1 is missed.')
    """
    if not goals:
        return "Nothing was measured: no goal is met."
    lost = len(missed(goals))
    if not lost:
        return "All goals are met."
    return f"{len(goals) - lost} of {len(goals)} goals are met, {lost} {'is' if lost == 1 else 'are'} missed."


def failures(goals: Sequence[Goal]) -> list[str]:
    """Return the sentence of missed goals, for `Result.failures`; nothing if there are goals and all are met."""
    lost = missed(goals)
    return [] if goals and not lost else [f"{verdict(goals)} {'; '.join(map(str, lost))}".rstrip()]
