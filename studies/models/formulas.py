"""The levels of the formulas (`analytic.beam`) as models, which state no errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from analytic import beam
from geometry.design import BadInput
from studies.mechanics.model import Model

if TYPE_CHECKING:
    from studies.mechanics.model import Found, Problem
    from studies.mechanics.path_solver import Answer, Kind


@dataclass(frozen=True, slots=True)
class Formula(Model):
    """A level of the formulas."""

    names = beam.LEVELS
    words = "levels of the formulas"
    head = "analytic"
    decodes = True

    @classmethod
    def title(cls, name: str) -> str:
        """Return the name of a level in a legend; analytic is a level that a table does not tell."""
        return {cls.head: "formula", "paper": "the paper's formula"}.get(name, f"formula, level {name}")

    @property
    def order(self) -> tuple[float, ...]:
        """Place among the levels."""
        return (beam.LEVELS.index(self.name),)

    def answers(self, problems: Sequence[Problem], found: Found, kind: Kind = "states") -> list[Answer]:
        """Return the response to each problem, from its own formulas."""
        return [self._answer(problem) for problem in problems]

    def _answer(self, problem: Problem) -> Answer:
        from studies.mechanics.path_solver import NAN, Answer, impossible

        design = problem.design
        if design is None or problem.load is None:
            return impossible(problem.message)
        try:
            response = beam.solve(design, problem.load, self.name)
        except BadInput as error:
            return impossible(f"no formula: {error}")
        unknown = f"the formulas use E and nu only, not the law {design.law}"
        return Answer(
            design.D, design.E_now, response, "ok", "" if design.law == "neo-hookean" else unknown, NAN, 0.0
        )
