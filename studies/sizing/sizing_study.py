"""The study of `magtip size`: from requirements to a ranked front that finite elements confirm, and to its yield.

Solved states are in the store, and the seed fixes the search: the same command gives the same result after any
interruption, and solves no state again.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from geometry.messages import Progress
from studies.sizing.front_search import Effort

if TYPE_CHECKING:
    from fem.accuracy import Accuracy
    from studies.exploration.needed_paths import Processes
    from studies.sizing.catalogues import Catalogues
    from studies.sizing.conflicts import Conflict
    from studies.sizing.front_solves import FrontPoint
    from studies.sizing.front_yield import Yield
    from studies.sizing.requirements import Requirements

SEARCHED, SOLVED = 0.35, 0.9
"""Shares of the progress at which the search, and the finite elements, end."""


@dataclass(frozen=True, slots=True)
class Settings:
    """How long to search, and how the front is solved.

    Attributes
    ----------
    points : largest number of points of the front that are solved.
    sensors : number of made sensors of the yield.
    """

    effort: Effort
    accuracy: Accuracy
    processes: Processes
    store: Path | None
    points: int
    sensors: int


@dataclass(frozen=True, slots=True)
class Sizing:
    """The result of a sizing.

    Attributes
    ----------
    front : points of the front, the ranked ones first; empty if no candidate meets all requirements.
    front_size : number of variants on the front of the search.
    winner_yield : yield of the best point; None if there is none.
    conflict : why there is no candidate; None if there is one, or if the search has only missed it.
    """

    requirements: Requirements
    catalogues: Catalogues
    effort: Effort
    front_size: int
    front: list[FrontPoint]
    winner_yield: Yield | None
    conflict: Conflict | None

    @property
    def winner(self) -> FrontPoint | None:
        """The best point that finite elements confirm."""
        return self.front[0] if self.front and self.front[0].status == "ok" else None

    @property
    def message(self) -> str:
        """Why there is no winner, in a sentence; "" if there is one."""
        if self.winner is not None:
            return ""
        if self.front:
            reasons = self.front[0].reason
            return (
                f"all {len(self.front)} points of the front fail by finite elements, the first because {reasons}: "
                "leave more room in that requirement"
            )
        if self.conflict is not None:
            return self.conflict.sentence()
        return (
            "the search found no variant that meets all requirements, and no set of them that conflicts: search "
            "longer with --generations, or loosen one"
        )


def run(requirements: Requirements, settings: Settings, progress: Progress) -> Sizing:
    """Search for variants, solve the front by finite elements, and return the result.

    Raises
    ------
    BadInput
        A catalogue or the store cannot be used, or a limit of the program rejects every candidate.
    """
    from studies.exploration import store as stores
    from studies.exploration.needed_paths import Solver
    from studies.sizing import conflicts, front_solves, front_yield
    from studies.sizing.catalogues import catalogues_of
    from studies.sizing.variant_search import check_rated, islands, searched

    catalogues = catalogues_of(requirements)
    groups = islands(requirements, catalogues)
    first = functools.partial(_part, progress, 0.0, SEARCHED)
    # a store that cannot be used is refused before the search
    with stores.opened(settings.store or stores.default()) as store:
        lasts, variants = searched(groups, settings.effort, first)
        if not variants:
            check_rated(groups)
            conflict = conflicts.conflict_of(groups, lasts, functools.partial(_part, progress, SEARCHED, 1.0))
            return Sizing(requirements, catalogues, settings.effort, 0, [], None, conflict)
        solver = Solver(
            store, settings.processes, functools.partial(_part, progress, SEARCHED, SOLVED), settings.accuracy
        )
        front = front_solves.solved_front(variants, requirements, solver, most=settings.points)
    made = None
    if front[0].status == "ok":
        progress(SOLVED, f"{settings.sensors} made sensors")
        made = front_yield.yield_of(front[0].variant, requirements, settings.sensors, requirements.seed)
    return Sizing(requirements, catalogues, settings.effort, len(variants), front, made, None)


def _part(progress: Progress, low: float, high: float, share: float, text: str) -> None:
    """Report the progress of a part of the study."""
    progress(low + (high - low) * share, text)
