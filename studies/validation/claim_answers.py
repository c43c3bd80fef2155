"""The answer to one claim of the paper, and the rule that turns figures into a verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from studies.output import records
from studies.output.records import FlatRow

Verdict = Literal["reproduced", "refuted", "not decidable"]


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to one claim.

    Attributes
    ----------
    claim : the claim in a few words.
    paper : the paper's value.
    computed : our figures, in one cell of a table.
    verdict : whether the figures reproduce or refute the claim, or why neither is possible: the claim depends on
        something that the paper does not state or that the models leave out.
    text : the reasons, in sentences.
    commands : command lines that show parts of the answer.
    figures : the figures under names with units.
    """

    claim: str
    paper: str
    computed: str
    verdict: Verdict
    text: str
    commands: tuple[str, ...]
    figures: dict[str, float]

    def row(self) -> FlatRow:
        """Return the row for JSON."""
        return records.flat(self)

    def printed(self) -> FlatRow:
        """Return the columns of the printed table and of claims.csv."""
        return {"claim": self.claim, "paper": self.paper, "computed": self.computed, "verdict": self.verdict}


def verdict(*, holds: bool, holds_for_other_values: bool = False, figures: Sequence[float] = ()) -> Verdict:
    """Return the verdict on a claim that depends on values which the paper does not give.

    Parameters
    ----------
    holds : whether the claim holds for all values that the paper leaves open.
    holds_for_other_values : whether it holds for some of them.
    figures : those that the other two compare; the claim is not decidable if one is unknown, or if there is none.

    >>> verdict(holds=False, holds_for_other_values=True, figures=[3.0])
    'not decidable'
    >>> verdict(holds=False, figures=[3.0]), verdict(holds=False, figures=[float("nan")]), verdict(holds=True)
    ('refuted', 'not decidable', 'not decidable')
    """
    if not figures or any(math.isnan(figure) for figure in figures):
        return "not decidable"
    if holds:
        return "reproduced"
    return "not decidable" if holds_for_other_values else "refuted"


def least(figures: Iterable[float]) -> float:
    """Return the least figure that is known; NaN if none is."""
    return min((figure for figure in figures if math.isfinite(figure)), default=math.nan)


def most(figures: Iterable[float]) -> float:
    """Return the largest figure that is known; NaN if none is."""
    return max((figure for figure in figures if math.isfinite(figure)), default=math.nan)
