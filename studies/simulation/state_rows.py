"""The rows of solved states and of the formulas, under the names that `magtip solve` and `magtip analytic` print.

Columns of a load: `friction` is "none", "stick" or a coefficient, None for a grip; `grip_mm` is the height of the
gripped skin, None under a plate. Columns of a response: force and shift are vectors (x, y, z), and the rotation is
the vector about x and y; all are None for an unsolved state. `dissipated_mJ` is what slip on the plate has dissipated
since the start of the path. `digest` and `made_for` label the sensor, so that a reader of the row can refuse another.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry import design_digest
from geometry.design import Design
from geometry.loads import Load, Magnet, Response
from studies.answers import STATED
from studies.inputs import study_input
from studies.inputs.study_input import OF_STATES
from studies.output.records import FlatRow
from studies.quantities import derived_columns, estimate_column, response_columns, stored_parts

if TYPE_CHECKING:
    from analytic.hall import Readings
    from fem.solution import Facts, Solution
    from studies.mechanics.path_solver import Answer

FACTS = (
    "stop",
    "remark",
    "stability",
    "unstable_directions",
    "onset_depth_from_mm",
    "onset_depth_to_mm",
    "onset_shear_from_mm",
    "onset_shear_to_mm",
    "unstable_stretches",
    "inside_out_share",
    "critical_depth_mm_estimate",
    "crease_ratio",
)
"""Columns of what the message puts in words (see `fem.solution.Facts`); None for a fact that is unknown. The onset is
the interval of the depth, or of the shear, whichever grew, in which the path became unstable."""

ESTIMATED = {
    "force": "force_N",
    "shift": "shift_mm",
    "tilt": "rotation_rad",
    "sideways": "",
    "contact_radius": "contact_radius_mm",
    "dissipated": "dissipated_mJ",
    "slip_share": "slip_share",
    "crease_ratio": "crease_ratio",
    "depth": "",
    "shear": "",
}
"""Names of estimated errors, and the columns of the numbers that they are of, beside those of `stored_columns`. They
are relative, but for the share that slips. Models with errors state those of `STATED`; those of depth and shear are
of motions that wanted forces have led to."""


def state_row(
    design: Design, magnet: Magnet, load: Load, response: Response | None, model: str, **known: Any
) -> FlatRow:
    """Return the row of one state of a path, whose response is None where it was not solved.

    known : values of other columns; the others are those of a state without a solve by finite elements.
    """
    row: FlatRow = {
        "status": "ok",
        "message": "",
        "model": model,
        **_load_columns(load),
        **_response_columns(response),
        "slip_share": None,
        "dissipated_mJ": None,
        "contact_radius_from": None,
        **{estimate_column(name): None for name in ESTIMATED},
        "dofs": 0,
        "newton_iterations": 0,
        "seconds": 0.0,
        **dict.fromkeys(FACTS),
        **stored_columns({}, {}, 1.0, 1.0),
    }
    return _with_derived(row | known, design, magnet, load, response)


def solved_row(design: Design, magnet: Magnet, state: Solution) -> FlatRow:
    """Return the row of a state by finite elements."""
    facts, estimates = asdict(state.facts), asdict(state.estimates)
    return state_row(
        design,
        magnet,
        state.load,
        state.response,
        state.model,
        status=state.status,
        message=state.message,
        slip_share=state.slip_share,
        dissipated_mJ=state.dissipated,
        contact_radius_from=state.radius_from,
        **{estimate_column(name): estimates[name.removesuffix("_ratio")] for name in ESTIMATED},
        dofs=state.dofs,
        newton_iterations=state.newton_iterations,
        seconds=state.seconds,
        **_fact_columns(state.facts),
        **stored_columns(facts, estimates, design.E_now, design.D),
    )


def answered_row(design: Design, magnet: Magnet, load: Load, answer: Answer, model: str, seconds: float) -> FlatRow:
    """Return the row of an answer by a model that solves nothing; of the surrogate its error estimates are the half
    widths of its 90 % intervals.
    """
    force = None if math.isnan(answer.error_estimate) else answer.error_estimate
    estimates: FlatRow = {**answer.estimates, "force": force}
    return state_row(
        design,
        magnet,
        load,
        answer.response,
        model,
        message=answer.message,
        **{estimate_column(name): estimates.get(name) for name in STATED},
        seconds=seconds,
        **stored_columns(answer.values, {}, answer.E, answer.D),
    )


def formula_row(
    design: Design,
    load: Load,
    response: Response,
    readings: Readings | None,
    *,
    level: str,
    message: str,
    warnings: list[str],
) -> FlatRow:
    """Return the row of the formulas of a level, with one value for each Hall element; None without a magnet."""
    output = None if readings is None else list(readings.output)
    volts = readings is not None and set(readings.units) == {"V"}
    row: FlatRow = {
        "status": "ok",
        "message": message,
        "level": level,
        **_load_columns(load),
        **_response_columns(response),
        "readings_T": readings and list(readings.B_T),
        "readings_V": output if volts else None,
        "output_T": None if volts else output,
        "saturated": readings and list(readings.saturated),
        "warnings": warnings,
    }
    return _with_derived(row, design, "ignored" if readings is None else "rigid", load, response)


def _load_columns(load: Load) -> FlatRow:
    row = {column: getattr(load, spec.name) for column, spec in OF_STATES.items()}
    return row | ({} if load.grip is None else {"friction": None})


def _response_columns(response: Response | None) -> FlatRow:
    return {
        "force_N": response and list(response.force),
        "shift_mm": response and list(response.shift),
        "tilt_rad": response and response.tilt,
        "tilt_y_rad": response and response.tilt_y,
        "rotation_rad": response and list(response.rotation),
        "contact_radius_mm": response and response.contact_radius,
    }


def _with_derived(row: FlatRow, design: Design, magnet: Magnet, load: Load, response: Response | None) -> FlatRow:
    """Return a row with what is derived from its fields and answers, None where it is unknown, and with the label."""
    given = {study_input.column(name): value for name, value in study_input.values_of(load).items()}
    numbers = (math.nan,) * 9 if response is None else response.numbers
    of = {**study_input.columns_of(design), **row, **given, **response_columns(numbers)}
    found = derived_columns({name: np.array([math.nan if value is None else value]) for name, value in of.items()})
    derived = {name: None if math.isnan(value) else float(value) for name, (value,) in found.items()}
    return row | derived | design_digest.label(design_digest.of_mechanics(design, magnet))


def _fact_columns(facts: Facts) -> FlatRow:
    first, last = facts.onset_mm or (None, None)
    onset = {f"onset_{facts.onset}_from_mm": first, f"onset_{facts.onset}_to_mm": last} if facts.onset else {}
    return {
        "stop": facts.stop or None,
        "remark": facts.remark,
        "stability": facts.verdict,
        "unstable_directions": facts.stability.directions,
        **onset,
        "unstable_stretches": None if facts.weak_at is None else list(facts.weak_at),
        "inside_out_share": facts.inverted_share,
        "critical_depth_mm_estimate": facts.critical_depth,
        "crease_ratio": facts.crease_ratio,
    }


def stored_columns(values: Mapping[str, Any], estimates: Mapping[str, Any], E: float, D: float) -> FlatRow:
    """Return the columns of what a state of a sensor with this E, MPa, and D, mm, holds beside its response.

    values, estimates : by their names in `fem.solution.Facts` and `Estimates`; one that is missing is unknown.
    """
    row: FlatRow = {}
    for part in stored_parts():
        for column, name in ((part.column, part.stored), (f"{part.column}_half_width", part.half_width)):
            value = values.get(name)
            row |= {column: None if value is None else part.scaled(float(value), E, D)} if name else {}
        if part.estimate:
            row[part.estimate_column] = estimates.get(part.estimate)
    return row


def estimated_numbers() -> dict[str, str]:
    """Return the columns of error estimates, and those of the numbers that they are of."""
    response = {estimate_column(name): number for name, number in ESTIMATED.items() if number}
    return response | {part.estimate_column: part.column for part in stored_parts() if part.estimate}
