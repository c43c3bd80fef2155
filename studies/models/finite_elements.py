"""Finite elements of an accuracy as a model, whose states come from the store."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

from fem.accuracy import LEVELS, Accuracy
from geometry.design import BadInput
from studies.mechanics.model import Model

if TYPE_CHECKING:
    from fem.scene import Model as Section
    from studies.mechanics.model import Found, Problem
    from studies.mechanics.path_solver import Answer, Kind, Place

SECTIONS = ("axisymmetric", "harmonic", "half", "full")
"""Models of finite elements that can stand before an accuracy, as in half-quick."""
DEFAULT = "standard"
"""Accuracy of the name fem alone."""


@dataclass(frozen=True, slots=True)
class FemModel(Model):
    """Finite elements: the model's name in the study, an accuracy and a model of the scene."""

    accuracy: Accuracy
    model: Section = "auto"

    names = (*LEVELS, *(f"{section}-{level}" for section in SECTIONS for level in LEVELS))
    known = (*LEVELS, "fem", "half-quick")
    words = "finite elements of an accuracy"
    head = "fem"
    solves = True
    states_errors = True
    half_widths = ("estimated errors of finite elements",)

    @classmethod
    def named(cls, name: str) -> FemModel | None:
        """Return the model of a name such as fem, quick, fem:quick or half-quick."""
        kind, _, text = name.partition(":")
        short = (text or DEFAULT) if kind == cls.head else name
        section, _, level = short.rpartition("-")
        if level not in LEVELS or section not in ("", *SECTIONS):
            return None
        return cls(short, LEVELS[level], cast("Any", section or "auto"))

    @classmethod
    def title(cls, name: str) -> str:
        """Return the name in a legend; fem is a model whose accuracy a table does not tell."""
        return "finite elements" if name == cls.head else f"finite elements, {name}"

    @property
    def order(self) -> tuple[float, ...]:
        """Place behind the surrogate: sections before bodies, coarsest first."""
        return (1.0, self.model in ("half", "full"), -self.accuracy.section_size)

    def accuracy_of(self, kind: Kind = "states") -> Accuracy:
        """Return the accuracy."""
        return self.accuracy

    def answers(self, problems: Sequence[Problem], found: Found, kind: Kind = "states") -> list[Answer | Place]:
        """Return stored answers, and the places of those that the store lacks."""
        return [self._answer(problem, found, kind) for problem in problems]

    def _answer(self, problem: Problem, found: Found, kind: Kind) -> Answer | Place:
        from fem.scene import Scene
        from studies.mechanics.path_solver import impossible, place

        design = problem.design
        if design is None or problem.load is None:
            return impossible(problem.message)
        try:
            scene = Scene(design, (problem.load,), self.accuracy, problem.magnet, self.model)
            at = place(scene, kind, problem.motion)
        except BadInput as error:
            return impossible(str(error))
        answer = found(at)
        return at if answer is None else answer.of(design.D, design.E_now, at.direction)
