"""Results of one model in the cases of a batch, as arrays, and the names of the model's columns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array
from geometry.loads import Response
from studies.mechanics.study_cases import Batch, Plan

NAN = math.nan


@dataclass(frozen=True, slots=True)
class Results:
    """Results of one model in the cases of a batch: force, N, shift, mm, (n, 3); rotation vector, rad, (n, 2);
    contact radius, mm, (n,); NaN where the model has none.
    """

    force: Array
    shift: Array
    rotation: Array
    contact_radius: Array


def prefixes(plan: Plan) -> dict[str, str]:
    """Return the first part of the columns of each model by the model's name."""
    fem = {
        model.name: f"{model.name}_"
        if model.tolerance or model.surrogate
        else _prefix("fem", model.name, sum(not one.surrogate for one in plan.fem))
        for model in plan.fem
    }
    return fem | {level: _prefix("analytic", level, len(plan.formulas)) for level in plan.formulas}


def _prefix(kind: str, name: str, count: int) -> str:
    """Return the first part of a model's columns."""
    return f"{kind}_" if count == 1 else f"{kind}_{name.replace('-', '_')}_"


def error_prefix(plan: Plan, name: str) -> str:
    """Return the first part of an error's column: none if the study has one model besides the reference."""
    return "" if len(plan.fem) + len(plan.formulas) <= 2 else prefixes(plan)[name]


def spread(batch: Batch, responses: Sequence[Response | None]) -> Results:
    """Return the results of all cases from the responses of the distinct problems: forces are proportional to E.

    A case whose sensor is impossible has no results, although its mechanics may be those of others.
    """
    none = (NAN, NAN, NAN)
    force = np.array([none if r is None else r.force for r in responses])[batch.problem]
    own = np.array([NAN if p.design is None else p.design.E for p in batch.problems])[batch.problem]
    # 1 for a possible sensor, else NaN, which every product keeps
    possible = np.array([NAN if design is None else 1.0 for design in batch.sensors])[batch.sensor]
    each = possible[:, None]
    return Results(
        force=force * (batch.E / own)[:, None] * each + 0.0,
        shift=np.array([none if r is None else r.shift for r in responses])[batch.problem] * each + 0.0,
        rotation=np.array([none[:2] if r is None else r.rotation for r in responses])[batch.problem] * each,
        contact_radius=np.array([NAN if r is None else r.contact_radius for r in responses])[batch.problem]
        * possible,
    )


def percents(model: Array, truth: Array) -> Array:
    """Return relative errors in %; NaN where the reference is 0 or unknown.

    >>> percents(np.array([1.5, 1.0]), np.array([1.0, 0.0]))
    array([50., nan])
    """
    return 100 * (ratio(model, truth) - 1)


def ratio(one: Array, other: Array) -> Array:
    """Return one / other; NaN where the other is 0."""
    zero = other == 0
    return np.asarray(np.where(zero, NAN, one / np.where(zero, 1.0, other)))
