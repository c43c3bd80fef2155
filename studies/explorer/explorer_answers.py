"""The answers to a request of the page, part by part, in the order in which they are ready.

The picture comes first, then everything that takes longer than it: error estimates, the decoded load, the 3D figure,
curves and stability. What depends on the design alone is kept while only the load changes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from fem.solution import Solution
from geometry.design import BadInput, Design
from studies.explorer import state_answers, surface_data
from studies.explorer.explorer_state import ExplorerState, Request
from studies.explorer.kept_paths import KeptPaths

Data = dict[str, Any]
Answer = tuple[str, str, Data]
"""A part, its level and its data."""
MOST = 8
"""Most results that depend on the design alone and are kept: the parts of two designs side by side."""


class SlowLoad(BadInput):
    """A load whose solve takes minutes, which only a request that allows it starts."""


TETRAHEDRA = (
    "this load is solved by tetrahedra, which takes minutes: press Solve, or use the command line that is shown"
)


class Answers:
    """Computes parts in one process, and keeps paths and what depends on the design alone."""

    def __init__(self) -> None:
        self.paths = KeptPaths()
        self._kept: dict[Any, Any] = {}

    def all_of(self, request: Request, level: str) -> Iterator[Answer]:
        """Yield the parts of a request at a level.

        Raises
        ------
        SlowLoad
            The solve takes minutes, and the request does not allow that.
        """
        state = request.state
        if not {"state", "sensor3d"}.isdisjoint(request.parts):
            if state_answers.scene_of(state, level).solid and not request.on_request:
                raise SlowLoad(TETRAHEDRA)
            yield from self._solved(state, level, request.parts)

    def _solved(self, state: ExplorerState, level: str, parts: tuple[str, ...]) -> Iterator[Answer]:
        """Yield the parts that belong to one solution: the state, again with its error estimates, and the figure."""
        solution = state_answers.solve(self.paths, state, level)
        if "state" in parts:
            yield "state", level, state_answers.answer(state, solution)
        if "sensor3d" in parts:
            yield "sensor3d", level, surface_data.surface(solution)
        if "state" in parts:
            solution = state_answers.solve_with_estimates(self.paths, state, level)
            yield "state", level, self._with_decoder(state, solution)

    def _with_decoder(self, state: ExplorerState, solution: Solution) -> Data:
        design = state.design
        decoder = None
        if design.shape.has_magnet:
            decoder = self.keep(("decoder", design), lambda: state_answers.build_decoder(design))
        return state_answers.answer(state, solution, decoder)

    def keep(self, key: tuple[str, Design, *tuple[Any, ...]], compute: Callable[[], Any]) -> Any:
        """Return a kept result, or compute and keep it."""
        if key in self._kept:
            self._kept[key] = self._kept.pop(key)
        else:
            result = compute()
            while len(self._kept) >= MOST:
                self._kept.pop(next(iter(self._kept)))
            self._kept[key] = result
        return self._kept[key]
