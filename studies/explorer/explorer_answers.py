"""The answers to a request of the page, part by part, in the order in which they are ready.

The picture comes first, and everything else when no newer request has come for a moment: the sensor in 3D, error
estimates, the decoded load, the curve, stability, vibration and loop. What depends on the
design alone is kept while only the load changes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any

from geometry.bad_input import SolveFailed
from geometry.design import OF_TIME, BadInput, Design
from studies.explorer import (
    design_answers,
    explorer_exports,
    state_answers,
    state_pictures,
    time_answers,
)
from studies.explorer.explorer_state import ExplorerState, Request
from studies.explorer.kept_paths import KeptPaths

Data = dict[str, Any]
Answer = tuple[str, str, Data]
"""A part, its level and its data."""
MOST = 12
"""Most results that depend on the design alone and are kept: decoder, curves and stability of two designs."""


class Answers:
    """Computes parts in one process, and keeps paths and what depends on the design alone."""

    def __init__(self) -> None:
        self.paths = KeptPaths()
        self._kept: dict[Any, Any] = {}
        self._design: dict[str, Any] = {}
        self._vibrating: tuple[Any, time_answers.Vibrating] | None = None

    def all_of(self, request: Request, level: str) -> Iterator[Answer | None]:
        """Yield the parts of a request at a level; None stands before what can wait for a hand that rests."""
        state, parts = request.state, request.parts
        if not {"state", "sensor3d", "field_lines"}.isdisjoint(parts):
            yield from self._solved(state, level, parts)
        yield None
        # what depends on the design alone is not sent in a coarse form again while only the load changes
        shown = mechanics(state.design), state.magnet, state.formula_level
        if level == state.level or self._design.get(request.side) != shown:
            if "curve" in parts:
                yield "curve", level, self._curve(state, level)
            if "stability" in parts:
                yield from self._stability(state, level)
            self._design[request.side] = shown
        if "vibration" in parts and level == state.level:
            yield "vibration", level, self._vibration(state, level)
        if "loop" in parts:
            yield from self._loop(state, level)

    def export(self, name: str, state: ExplorerState) -> bytes:
        """Return a file of a state at its own level."""
        if name == "curve.csv":
            return explorer_exports.of_curve(self._curve(state, state.level))
        solution = state_answers.solve_with_estimates(self.paths, state, state.level)
        return explorer_exports.of_solution(name, state, solution)

    def forget(self) -> None:
        """Free everything that is kept."""
        self.paths = KeptPaths()
        self._kept.clear()
        self._design.clear()
        self._vibrating = None

    def _solved(self, state: ExplorerState, level: str, parts: tuple[str, ...]) -> Iterator[Answer | None]:
        """Yield the parts that belong to one solution: the state, again with its error estimates, and the figures."""
        decoder = self._kept.get(("decoder", state.design))
        solution = state_answers.solve(self.paths, state, level)
        if "state" in parts:
            yield "state", level, state_answers.answer(state, solution, decoder)
        yield None
        if "field_lines" in parts:
            yield "field_lines", level, state_pictures.field_lines(state.design, solution)
        if "sensor3d" in parts:
            yield "sensor3d", level, state_pictures.surface(solution)
        if "state" in parts:
            solution = state_answers.solve_with_estimates(self.paths, state, level)
            yield "state", level, state_answers.answer(state, solution, decoder)
            if decoder is None and state.design.shape.has_magnet:
                yield None
                yield "state", level, state_answers.answer(state, solution, self._decoder(state.design))

    def _curve(self, state: ExplorerState, level: str) -> Data:
        """Return the curve; at level quick its error estimates follow only if it is not refined."""
        design, magnet, estimate = state.design, state.magnet, level == state.level
        key = ("curve", mechanics(design), magnet, level, estimate)
        data = self._keep(key, lambda: design_answers.curve(design, magnet, level, estimate=estimate))
        return design_answers.with_formulas(data, design, state.formula_level)

    def _stability(self, state: ExplorerState, level: str) -> Iterator[Answer]:
        """Yield the stability by the surrogate, and by finite elements at the level of the state."""
        design, magnet = state.design, state.magnet
        key = ("stability", mechanics(design), magnet, level)
        if key not in self._kept and level == "quick":
            data = design_answers.by_surrogate(design, magnet)
            if data is not None:
                yield "stability", "surrogate", data
        if level == state.level:
            compute = design_answers.by_finite_elements
            yield "stability", level, self._keep(key, lambda: compute(design, magnet, level))

    def _vibration(self, state: ExplorerState, level: str) -> Data:
        """Return the vibration about a state; its systems stay for other frequencies, those of one state only."""
        if not state.frequency:
            return time_answers.refusal("a frequency above 0 Hz gives the vibration about this state")
        key = state.design, state.vibrating_load, state.magnet, level
        try:
            if self._vibrating is None or self._vibrating[0] != key:
                self._vibrating = None
                self._vibrating = key, time_answers.prepare(*key)
            return time_answers.vibration(self._vibrating[1], state.frequency)
        except (BadInput, SolveFailed) as error:
            return time_answers.refusal(str(error))

    def _loop(self, state: ExplorerState, level: str) -> Iterator[Answer]:
        """Yield the loop of a linear spring first, and by finite elements at the level of the state."""
        if not state.speed:
            yield "loop", level, time_answers.refusal("a speed above 0 mm/s gives the loop of a loading cycle")
            return
        try:
            motion = time_answers.motion_of(state)
        except BadInput as error:
            yield "loop", level, time_answers.refusal(str(error))
            return
        key = ("loop", state.design, state.magnet, motion)
        if key not in self._kept:
            yield "loop", "linear", time_answers.linear_loop(state, motion)
        if level == state.level:
            yield "loop", level, self._keep(key, lambda: time_answers.loop(state, motion))

    def _decoder(self, design: Design) -> Any:
        """Return the decoder of a design."""
        return self._keep(("decoder", design), lambda: state_answers.build_decoder(design))

    def _keep(self, key: tuple[Any, ...], compute: Callable[[], Any]) -> Any:
        """Return a kept result, or compute and keep it."""
        result = self._kept.pop(key) if key in self._kept else compute()
        while len(self._kept) >= MOST:
            self._kept.pop(next(iter(self._kept)))
        self._kept[key] = result
        return result


def mechanics(design: Design) -> tuple[Any, ...]:
    """Return the fields of a design on which its curve and its stability depend."""
    names = [spec.name for spec in dataclasses.fields(design) if not spec.name.startswith(("hall_", "chip_"))]
    idle = ("f", "c", "l0", "remanence", "magnet_north", *OF_TIME)
    return tuple(getattr(design, name) for name in names if name not in idle)
