"""A tolerance as a model, which wraps the others: the cheapest one whose measured error meets it answers.

Finite elements whose own error estimates exceed the tolerance, or are unknown, are solved again at the next finer
accuracy; if there is none, the answer has the status UNMET. Every verb that takes a tolerance uses `until_met`.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from fem.accuracy import LEVELS, STANDARD, Accuracy
from geometry.design import BadInput
from geometry.loads import ANSWERED
from studies.inputs.user_input import parse_tolerance
from studies.mechanics.model import Model
from studies.models.finite_elements import FemModel
from studies.models.formulas import Formula
from studies.models.surrogate import Surrogate
from studies.quantities import shown

if TYPE_CHECKING:
    from studies.mechanics.model import Found, Problem
    from studies.mechanics.model_choice import Choice
    from studies.mechanics.path_solver import Answer, Kind, Place

Answers = TypeVar("Answers")


def until_met(
    choice: Choice,
    solve: Callable[[Choice], Answers],
    unmet: Callable[[Answers, Choice], str],
    finer: Callable[[Choice, str], Choice | None],
) -> tuple[Choice, Answers]:
    """Return the answers by the first choice that is known to meet its tolerance, or by the finest, and that choice.

    Parameters
    ----------
    unmet : returns why answers are not known to meet the tolerance, "" if they are.
    finer : returns the next finer choice, None if there is none.
    """
    while True:
        answers = solve(choice)
        reason = unmet(answers, choice)
        following = finer(choice, reason) if reason else None
        if following is None:
            return choice, answers
        choice = following


@dataclass(frozen=True, slots=True)
class Tolerance(Model):
    """The cheapest model that is known to meet a tolerance, for each case."""

    tolerance: float = math.nan

    names = ("chosen",)
    known = ("tolerance:1%",)
    words = "for each case the cheapest model that is known to meet a tolerance"
    solves = True
    states_errors = True
    half_widths = (*FemModel.half_widths, *Surrogate.half_widths)
    columns: ClassVar[Mapping[str, Any]] = {"chosen_model": "", "expected_error": math.nan}

    @classmethod
    def named(cls, name: str) -> Tolerance | None:
        """Return the model of a name such as tolerance:1%."""
        kind, _, text = name.partition(":")
        return cls(*cls.names, parse_tolerance(text)) if kind == "tolerance" else None

    @classmethod
    def title(cls, name: str) -> str:
        """Return the name in a legend."""
        return "chosen model"

    @property
    def order(self) -> tuple[float, ...]:
        """Place behind the surrogate."""
        return (1.0,)

    def check_beside(self, others: Sequence[Model]) -> None:
        """Refuse finite elements beside a tolerance, which chooses them."""
        if solved := [model.name for model in others if model.solves]:
            raise BadInput(
                f"a tolerance chooses the finite elements, which are given too ({solved[0]}): leave one out"
            )

    def accuracy_of(self, kind: Kind = "states") -> Accuracy | None:
        """Return the accuracy of quantities that are paths of their own; states have that which is chosen."""
        return None if kind == "states" else STANDARD

    def answers(self, problems: Sequence[Problem], found: Found, kind: Kind = "states") -> Sequence[Answer | Place]:
        """Return the answers of the chosen models, each refined until the tolerance is met."""
        if kind != "states":
            return FemModel(self.name, STANDARD).answers(problems, found, kind)
        return [self._answer(problem, found) for problem in problems]

    def _answer(self, problem: Problem, found: Found) -> Answer | Place:
        from studies.mechanics import model_choice
        from studies.mechanics.path_solver import Place, impossible

        design, load, magnet = problem.design, problem.load, problem.magnet
        if design is None or load is None:
            return impossible(problem.message)
        try:
            first = model_choice.choose(design, [load], self.tolerance, magnet)
        except BadInput as error:
            return impossible(str(error))

        def unmet(answer: Answer | Place, choice: Choice) -> str:
            if isinstance(answer, Place) or not model_of(choice).solves:
                return ""
            if answer.response is None or answer.status not in ANSWERED:
                return ""
            estimates = {"force": answer.error_estimate, **answer.estimates}
            return model_choice.unmet(
                choice, design, load, model_choice.along_shear(load, answer.response), estimates
            )

        choice, answer = until_met(
            first,
            lambda choice: model_of(choice).answers([problem], found)[0],
            unmet,
            lambda choice, _: model_choice.finer(design, [load], choice, magnet),
        )
        if isinstance(answer, Place):
            return answer
        columns = {"chosen_model": choice.name, "expected_error": choice.bound}
        if model_of(choice).decodes:
            return replace(answer, error_estimate=choice.bound, columns=columns)
        if reason := unmet(answer, choice):
            said = "; ".join(filter(None, (answer.message, reason)))
            answer = replace(answer, status=model_choice.UNMET, message=said)
        return replace(answer, columns=columns)

    def remarks(self, rows: Counter[Any], count: int) -> list[str]:
        """Return which models were chosen in how many cases."""
        wanted = f"tolerance {shown(self.tolerance, 'percent', 2)}"
        chosen = ", ".join(f"{name} in {number}" for name, number in rows.items() if name)
        if not chosen:
            return [f"{wanted}: no model is known to meet it in any of {count} cases"]
        why = "each the cheapest model whose measured errors for that kind of load meet it"
        return [f"{wanted}: {chosen} of {count} cases, {why}"]


def model_of(choice: Choice) -> Model:
    """Return the model that is chosen."""
    if choice.model == "formula":
        return Formula(choice.level_or_accuracy)
    if choice.model in Surrogate.names:
        return Surrogate(choice.model)
    return FemModel(choice.name, LEVELS[choice.level_or_accuracy])
