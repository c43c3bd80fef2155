"""What is asked, and what answers it: the problems of a study's cases, and models.

A kind of models is a class of `Model` in a file of `studies.models`. Its file imports what computes in the functions
that use it, so that the names of models cost no time.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    from fem.accuracy import Accuracy
    from geometry.design import Design
    from geometry.loads import Load, Magnet
    from studies.mechanics.path_solver import Answer, Kind, Place
    from studies.mechanics.timed_quantities import PlateMotion

    Found = Callable[[Place], "Answer | None"]
    """What the store has at a place, for the design that was solved; None if it lacks it."""


@dataclass(frozen=True, slots=True)
class Problem:
    """What the mechanics depend on in a case, or the reason why it is impossible.

    `design`, `load`: None if the case is impossible; `message` then gives the reason. The design is that which all
    models solve (`geometry.design.Design.for_mechanics`). Its E and its temperature are those of the base design,
    unless the study has an imperfection or a quantity that depends on time.
    """

    design: Design | None
    load: Load | None
    magnet: Magnet
    message: str
    motion: PlateMotion


@dataclass(frozen=True, slots=True)
class Model:
    """What answers problems. A kind of models is a class of its own, in a file of `studies.models`.

    name : by which a study tells its models apart.

    Attributes
    ----------
    names : of the models of the kind in tables.
    known : what a study may write for them; default: the same.
    words : the kind in the help of models.
    head : first part of the columns of the kind, as fem in fem_force_N; its models have their names behind it if a
        study has several. Columns of a kind without one begin with the model's name.
    solves : whether answers need solves, and so a store.
    states_errors : whether answers state errors, stability, and what is stored beside a response.
    half_widths : what its half widths are, in words of a figure; none where it states no errors.
    decodes : whether the model is a level of the formulas by which readings can be decoded.
    columns : names of further columns of the kind, and their values where there is no answer.
    """

    name: str
    names: ClassVar[tuple[str, ...]] = ()
    known: ClassVar[tuple[str, ...]] = ()
    words: ClassVar[str] = ""
    head: ClassVar[str] = ""
    solves: ClassVar[bool] = False
    states_errors: ClassVar[bool] = False
    half_widths: ClassVar[tuple[str, ...]] = ()
    decodes: ClassVar[bool] = False
    columns: ClassVar[Mapping[str, Any]] = {}

    @classmethod
    def named(cls, name: str) -> Model | None:
        """Return the model of the kind that a name of a study means; None if it is not of the kind."""
        return cls(name) if name in cls.names else None

    @classmethod
    def title(cls, name: str) -> str:
        """Return the name of a model in a legend."""
        return name

    @property
    def order(self) -> tuple[float, ...]:
        """Place among the models of a study that state errors, or of those that do not; rising, coarsest first."""
        return (math.inf,)

    def answers(self, problems: Sequence[Problem], found: Found, kind: Kind = "states") -> Sequence[Answer | Place]:
        """Return the answer to each problem, or a place whose state it needs and the store lacks.

        kind : what is asked of a model that solves.
        """
        raise NotImplementedError

    def accuracy_of(self, kind: Kind = "states") -> Accuracy | None:
        """Return the accuracy of all answers; None if there is none, or each has its own."""
        return None

    def check_beside(self, others: Sequence[Model]) -> None:
        """Refuse other models of the same study, with BadInput."""

    def remarks(self, rows: Counter[Any], count: int) -> list[str]:
        """Return what is said beside a table of `count` rows; `rows` counts them by their first further column."""
        return []
