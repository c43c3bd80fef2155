"""Names of the columns of a sweep: which are axes, and which are answers and errors of which model.

Columns of a model begin with `fem_` or `analytic_`; if a study has several models of a kind, with their names too:
`fem_quick_`, `analytic_finite_`. The surrogate and the model that a tolerance chooses have their own names. Errors
against the reference have the model's beginning if the study has more than one model besides the reference.
Quantities that are paths of their own, such as critical depths, stand without a model's name.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from analytic.beam import LEVELS as FORMULAS
from fem.accuracy import LEVELS
from geometry.design import BadInput
from studies.inputs import study_input
from studies.mechanics.study_cases import FEM_MODELS, Plan

FEM, FORMULA = "fem", "analytic"
"""Kinds of models, with which columns begin; also names of models whose accuracy or level a table does not tell."""
TITLES = {
    "surrogate": "surrogate", "chosen": "chosen model", FEM: "finite elements", FORMULA: "formula",
    "paper": "the paper's formula",
}  # fmt: skip
"""Names of models in legends; others are an accuracy of the finite elements or a level of the formulas."""


def prefixes(plan: Plan) -> dict[str, str]:
    """Return the first part of the columns of each model by the model's name."""
    solved = sum(not model.surrogate for model in plan.fem)
    fem = {
        model.name: f"{model.name}_" if model.tolerance or model.surrogate else _prefix(FEM, model.name, solved)
        for model in plan.fem
    }
    return fem | {level: _prefix(FORMULA, level, len(plan.formulas)) for level in plan.formulas}


def _prefix(kind: str, name: str, count: int) -> str:
    return f"{kind}_" if count == 1 else f"{kind}_{name.replace('-', '_')}_"


def status_columns(plan: Plan) -> dict[str, str]:
    """Return the column of each model's status by the model's name; none if the study has a single model."""
    names = prefixes(plan)
    return {name: f"{prefix}status" for name, prefix in names.items()} if len(names) > 1 else {}


@dataclass(frozen=True, slots=True)
class SweepColumns:
    """What the columns of a sweep's table are.

    Attributes
    ----------
    axes : columns of what varies.
    models : first part of the columns of each model, by the model's name.
    reference : name of the model that errors are relative to; "" if there is none.
    """

    axes: tuple[str, ...]
    models: Mapping[str, str]
    reference: str = ""

    @classmethod
    def of_plan(cls, plan: Plan) -> SweepColumns:
        """Return the columns of a study that runs."""
        return cls(tuple(map(study_input.column, plan.axes)), prefixes(plan), plan.truth)

    @property
    def record(self) -> dict[str, Any]:
        """The same as a JSON object, which `of_record` reads."""
        return {"axes": list(self.axes), "models": dict(self.models), "reference": self.reference}

    @classmethod
    def of_record(cls, record: Mapping[str, Any], columns: Iterable[object]) -> SweepColumns:
        """Return the columns that a record names, or raise BadInput if the table does not have its axes."""
        axes, models, reference = (record.get(name) for name in ("axes", "models", "reference"))
        if not (isinstance(axes, list) and isinstance(models, Mapping) and isinstance(reference, str)):
            raise BadInput(
                "run.json does not say which columns of the sweep are axes and answers: run the sweep again"
            )
        present = set(map(str, columns))
        if missing := [name for name in map(str, axes) if name not in present]:
            raise BadInput(f"its axis {missing[0]}, which run.json names, is missing")
        return cls(tuple(map(str, axes)), {str(name): str(prefix) for name, prefix in models.items()}, reference)

    @classmethod
    def of_table(cls, columns: Iterable[object]) -> SweepColumns:
        """Return the columns of a table without a record, as far as the names tell: a level may stay unknown.

        >>> names = ("D_mm", "L_mm", "L_over_D", "fem_force_N", "analytic_tip_force_N", "l0_mm", "status")
        >>> SweepColumns.of_table(names).record
        {'axes': ['D_mm', 'L_over_D'], 'models': {'fem': 'fem_', 'tip': 'analytic_tip_'}, 'reference': 'fem'}
        """
        names = list(map(str, columns))
        fields = {study_input.column(name): study_input.field_of(name) for name in study_input.AXES}
        first = list(itertools.takewhile(fields.__contains__, names))
        over_D = {fields[name] for name in first if name.endswith("_over_D")}
        axes = tuple(name for name in first if name.endswith("_over_D") or fields[name] not in over_D)
        solved = [*LEVELS, *(f"{model}-{level}" for model in FEM_MODELS for level in LEVELS)]
        known = {
            **{name: f"{name}_" for name in ("surrogate", "chosen", FEM)},
            **{name: _prefix(FEM, name, 2) for name in solved},
            FORMULA: f"{FORMULA}_",
            **{name: _prefix(FORMULA, name, 2) for name in FORMULAS},
        }
        found = {}
        for column in names:
            # the longest beginning: fem_half_quick_ also begins with fem_
            fitting = [name for name, prefix in known.items() if column.startswith(prefix)]
            found.update({name: known[name] for name in sorted(fitting, key=lambda name: -len(known[name]))[:1]})
        fem = [name for name in found if name not in ("surrogate", FORMULA, *FORMULAS)]
        # the surrogate stands before the finite elements, coarsest first, and the formulas after them
        return cls(axes, found, fem[-1] if fem else "")

    def is_formula(self, model: str) -> bool:
        """Return whether a model is a level of the formulas."""
        return model in (FORMULA, *FORMULAS)

    def title(self, model: str) -> str:
        """Return the name of a model in a legend; of "" that of the reference.

        >>> columns = SweepColumns((), {}, "quick")
        >>> [columns.title(name) for name in ("", "finite", "paper", "surrogate")]
        ['finite elements, quick', 'formula, level finite', "the paper's formula", 'surrogate']
        """
        name = model or self.reference
        kind = "formula, level" if self.is_formula(name) else "finite elements,"
        return TITLES.get(name, f"{kind} {name}")

    def answers(self, quantity: str, present: Iterable[object]) -> dict[str, str]:
        """Return those columns of a quantity that are present, by the model; "" has one without a model's name."""
        names = set(map(str, present))
        own = {name: f"{prefix}{quantity}" for name, prefix in self.models.items()}
        return {name: column for name, column in ({"": quantity} | own).items() if column in names}

    def error_prefix(self, model: str) -> str:
        """Return the first part of an error's column: none if the study has one model besides the reference."""
        return "" if len(self.models) <= 2 else self.models[model]

    def errors(self, error: str, present: Iterable[object]) -> dict[str, str]:
        """Return those columns of an error that are present, by the model."""
        names = set(map(str, present))
        own = {name: f"{self.error_prefix(name)}{error}" for name in self.models if name != self.reference}
        return {name: column for name, column in own.items() if self.reference and column in names}

    def status(self, model: str) -> str:
        """Return the column of a model's own status, which a table of a single model does not have."""
        return f"{self.models[model]}status" if model in self.models else "status"
