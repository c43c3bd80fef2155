"""The surrogate of the finite elements (`studies.beam.surrogate_response`) as a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fem.accuracy import STANDARD, Accuracy
from studies.mechanics.model import Model

if TYPE_CHECKING:
    from studies.mechanics.model import Found, Problem
    from studies.mechanics.path_solver import Answer, Kind


@dataclass(frozen=True, slots=True)
class Surrogate(Model):
    """The surrogate, whose error estimates are half widths of 90 % intervals."""

    names = ("surrogate",)
    words = "the surrogate of the finite elements"
    states_errors = True
    half_widths = ("90 % intervals of the surrogate",)

    @property
    def order(self) -> tuple[float, ...]:
        """Place before the finite elements."""
        return (0.0,)

    def accuracy_of(self, kind: Kind = "states") -> Accuracy:
        """Return the accuracy of the finite elements that it stands for."""
        return STANDARD

    def answers(self, problems: Sequence[Problem], found: Found, kind: Kind = "states") -> list[Answer]:
        """Return the answers, computed together."""
        from studies.beam import surrogate_response
        from studies.mechanics.path_solver import Answer, impossible

        possible = [(k, (p.design, p.load, p.magnet)) for k, p in enumerate(problems) if p.design and p.load]
        answers = [impossible(problem.message) for problem in problems]
        estimates = surrogate_response.respond_all([case for _, case in possible])
        for (k, (design, _, _)), estimate in zip(possible, estimates, strict=True):
            if isinstance(estimate, str):
                answers[k] = impossible(estimate)
                continue
            errors, values = dict(estimate.errors), {"largest_strain": estimate.strain}
            force = errors.pop("force")
            assert force is not None
            answers[k] = Answer(
                design.D, design.E_now, estimate.response, "ok", estimate.message, force, 0.0, errors, values
            )
        return answers
