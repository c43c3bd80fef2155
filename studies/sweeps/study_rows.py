"""Columns of a study's rows: results of all models in each case, the readings they give, and the models' errors.

Everything is computed for a batch of cases at once: responses for each distinct problem, scaled to the E of each
case; readings for all cases in one call (`analytic.batch_readings`). Errors are those of a model against the
reference, the last finite-element model of the study, in %.

Columns of a model begin with `fem_` or `analytic_`; if a study has several models of a kind, with their names too:
`fem_quick_`, `analytic_finite_`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic import beam
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Response
from studies.inputs import study_axes
from studies.mechanics.path_solver import Answer, frequency_unit
from studies.mechanics.study_cases import Batch, Columns, Plan, Problem, Recent
from studies.sweeps import time_columns
from studies.sweeps.model_results import NAN, Results, error_prefix, percents, prefixes, spread
from studies.sweeps.study_readings import StudyReadings

FIRST_AXES = ("D", "L", "f", "E", "depth")
"""Axes whose columns every table has, first."""
MECHANICS = ("force", "shift", "tilt", "contact_radius")
"""Quantities of a response."""


@dataclass(frozen=True, slots=True)
class Solved:
    """Answers of the finite elements for the distinct problems of a batch.

    Attributes
    ----------
    states : for each model, by its name, the answer of each problem, for the problem's own D, E and direction of the
        shear; its status is "bad_input" where the problem is impossible.
    numbers : number of the reference's path of each problem, 0 for none.
    critical, modes, response, cycle : answers of the other kinds, if the study asks for them.
    chosen : for each problem the model that a tolerance has chosen, and the bound of its relative error.
    """

    states: Mapping[str, Sequence[Answer]]
    numbers: Sequence[int]
    critical: Sequence[Answer] = ()
    modes: Sequence[Answer] = ()
    response: Sequence[Answer] = ()
    cycle: Sequence[Answer] = ()
    chosen: Sequence[tuple[str, float]] = ()


class Rows:
    """Computes the columns of batches of one study."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self._formulas: Recent[tuple[Response | None, str]] = Recent()
        self._readings = StudyReadings(plan)
        self.prefixes = prefixes(plan)

    def columns(self, batch: Batch, solved: Solved) -> Columns:
        """Return the table of a batch."""
        plan = self.plan
        remarks: list[list[str]] = [[] for _ in batch.problems]
        results = {name: spread(batch, [a.response for a in answers]) for name, answers in solved.states.items()}
        for level in plan.formulas:
            responses = []
            for k, code in enumerate(batch.codes):
                response, remark = self._formula(level, code, batch.problems[k])
                responses.append(response)
                remarks[k] += [remark] if remark and remark not in remarks[k] else []
            results[level] = spread(batch, responses)
        if "readings" in plan.quantities and {"magnet_diameter", "magnet_height"} & set(plan.axes):
            for k, problem in enumerate(batch.problems):
                if problem.design is not None and not problem.design.shape.has_magnet:
                    remarks[k].append("without a magnet there are no readings")
        table = self._axis_columns(batch)
        table |= self._mechanics(results)
        if "strain" in plan.quantities:
            table |= self._strains(batch, solved)
        if "readings" in plan.quantities:
            table |= self._readings.columns(batch, results)
        if "decoded_force_error" in plan.quantities:
            table |= self._readings.decoded(batch, results)
        if "critical_depth" in plan.quantities:
            table |= _critical_columns(batch, solved.critical)
        if "modes" in plan.quantities:
            table |= _mode_columns(batch, solved.modes)
        if "response" in plan.quantities:
            table |= time_columns.response(plan, batch, solved.response)
        if "cycle" in plan.quantities:
            table |= time_columns.cycle(batch, solved.cycle)
        if "l0" not in plan.axes:
            table["l0_mm"] = _of_sensors(batch, lambda design: design.l0)
        table |= self._verdict(batch, solved, remarks)
        if not plan.fem:
            # without finite elements a case without any formula has no result at all
            without = np.all([np.isnan(result.force[:, 2]) for result in results.values()], axis=0)
            table["status"][without] = "bad_input"
        return table

    def _axis_columns(self, batch: Batch) -> Columns:
        """Return the columns of the axes, and of D, L, f, E and the depth in any case."""
        base, n = self.plan.design, len(batch)
        fixed: dict[str, Any] = {name: getattr(base, name) for name in FIRST_AXES if name != "depth"}
        fixed |= {"depth": self.plan.load.get("depth", 0.0)}
        fixed |= {name: value for name, value in self.plan.load.items() if name != "depth"}
        table: Columns = {}
        for name in dict.fromkeys((*FIRST_AXES, *self.plan.axes, *fixed)):
            values = batch.axes[name] if name in batch.axes else np.full(n, fixed[name])
            table[study_axes.column(name)] = _as_column(values)
        return table

    def _mechanics(self, results: Mapping[str, Results]) -> Columns:
        """Return force, shift, tilt and contact radius by all models, then the errors."""
        plan = self.plan
        asked = [name for name in plan.quantities if name in MECHANICS]
        parts = [part for quantity in asked for part in self._parts(quantity)]
        table: Columns = {}
        for name, result in results.items():
            table |= {f"{self.prefixes[name]}{column}": read(result) for column, read, _ in parts}
        if not plan.truth:
            return table
        truth = results[plan.truth]
        for name, result in results.items():
            if name != plan.truth:
                before = error_prefix(plan, name)
                table |= {
                    f"{before}{error}_error_percent": percents(read(result), read(truth))
                    for _, read, error in parts
                    if error
                }
        return table

    def _strains(self, batch: Batch, solved: Solved) -> Columns:
        """Return the largest strain of the silicone in % by each finite-element model; formulas have none."""
        return {
            f"{self.prefixes[name]}largest_strain_percent": 100
            * np.array([_number(answer.values.get("largest_strain")) for answer in answers])[batch.problem]
            for name, answers in solved.states.items()
        }

    def _parts(self, quantity: str) -> list[tuple[str, Callable[[Results], Array], str]]:
        """Return the columns of a quantity: name, how it is read, and the name of its error, "" for none."""
        sideways = self.plan.loads_sideways
        if quantity == "contact_radius":
            return [("contact_radius_mm", lambda r: r.contact_radius, "contact_radius")]
        if quantity == "tilt":
            # a rotation vector (rx, ry) is a lean of (ry, -rx)
            lean = [("tilt_rad", lambda r: r.rotation[:, 1], "tilt")]
            return [*lean, ("tilt_y_rad", lambda r: -r.rotation[:, 0] + 0.0, "tilt_y")] if sideways else lean
        if quantity == "force":
            parts = [("force_N", lambda r: r.force[:, 2], "force")]
            more = [
                ("force_x_N", lambda r: r.force[:, 0], "force_x"),
                ("force_y_N", lambda r: r.force[:, 1], "force_y"),
            ]
        else:
            parts = [("shift_z_mm", lambda r: r.shift[:, 2], "shift")]
            more = [
                ("shift_x_mm", lambda r: r.shift[:, 0], "shift_x"),
                ("shift_y_mm", lambda r: r.shift[:, 1], "shift_y"),
            ]
        return parts + more if sideways else parts

    def _formula(self, level: str, code: int, problem: Problem) -> tuple[Response | None, str]:
        """Return the response of a formula to a problem, or None and the reason."""

        def make() -> tuple[Response | None, str]:
            if problem.design is None or problem.load is None:
                return None, ""
            try:
                return beam.solve(problem.design, problem.load, level), ""
            except BadInput as error:
                return None, f"no formula: {error}"

        return self._formulas.get((level, code), make)

    def _verdict(self, batch: Batch, solved: Solved, remarks: Sequence[Sequence[str]]) -> Columns:
        """Return error estimates, number and time of the solve, status and message of each case."""
        table: Columns = {}
        several = len(self.plan.fem) > 1
        for name, answers in solved.states.items():
            column = f"{self.prefixes[name]}error_estimate" if several else "error_estimate"
            table[column] = np.array([answer.error_estimate for answer in answers])[batch.problem]
            for part in ("shift", "tilt", "sideways") if self.plan.loads_sideways else ("shift",):
                estimates = [_number(answer.estimates.get(part)) for answer in answers]
                table[column.replace("error", f"{part}_error")] = np.array(estimates)[batch.problem]
        reference = solved.states[self.plan.reference.name] if self.plan.reference is not None else ()
        zeros = [0] * len(batch.problems)
        if solved.chosen:
            names, bounds = zip(*solved.chosen, strict=True)
            table["chosen_model"] = np.array(names, dtype=object)[batch.problem]
            table["expected_error"] = np.array(bounds, dtype=float)[batch.problem]
        table["solve"] = np.array(solved.numbers or zeros)[batch.problem]
        table["seconds"] = np.array([a.seconds for a in reference] or zeros, dtype=float)[batch.problem]
        status, message = zip(
            *(self._state(solved, k, remarks[k], p) for k, p in enumerate(batch.problems)), strict=True
        )
        table["status"] = np.array(status, dtype=object)[batch.problem]
        table["message"] = np.array(message, dtype=object)[batch.problem]
        for k in (k for k, design in enumerate(batch.sensors) if design is None):
            rows = (batch.sensor == k) & (table["status"] != "bad_input")
            table["status"][rows], table["message"][rows] = "bad_input", batch.sensor_messages[k]
        return table

    def _state(self, solved: Solved, k: int, remarks: Sequence[str], problem: Problem) -> tuple[str, str]:
        """Return status and message of a problem: those of the reference, else of the first model that failed."""
        if problem.design is None:
            return "bad_input", problem.message
        answers = [solved.states[model.name][k] for model in reversed(self.plan.fem)]
        answers += [
            answers_of[k]
            for answers_of in (solved.critical, solved.modes, solved.response, solved.cycle)
            if answers_of
        ]
        worst = next((answer for answer in answers if answer.status != "ok"), None)
        texts = [answer.message for answer in answers if answer.message]
        return worst.status if worst else "ok", "; ".join(dict.fromkeys([*texts, *remarks]))


def _as_column(values: NDArray[Any]) -> NDArray[Any]:
    """Return the values of an axis as a column: numbers, or texts if some values are names."""
    if values.dtype.kind not in "OU":
        return values
    return np.array([v if isinstance(v, str) else f"{v:.12g}" for v in values.tolist()], dtype=object)


def _of_sensors(batch: Batch, value: Callable[[Design], float]) -> Array:
    """Return a number of each case's sensor; NaN for an impossible one."""
    return np.array([NAN if design is None else value(design) for design in batch.sensors])[batch.sensor]


def _critical_columns(batch: Batch, answers: Sequence[Answer]) -> Columns:
    """Return the critical depth, mm, and force, N, and the depth up to which a press is stable, mm."""
    D = np.array([NAN if p.design is None else p.design.D for p in batch.problems])[batch.problem]
    depth, force, stable = (
        np.array([_number(answer.values.get(name)) for answer in answers])[batch.problem]
        for name in ("critical_depth_over_D", "critical_force_over_ED2", "stable_to_over_D")
    )
    return {"critical_depth_mm": depth * D, "critical_force_N": force * batch.E * D**2, "stable_to_mm": stable * D}


def _mode_columns(batch: Batch, answers: Sequence[Answer]) -> Columns:
    """Return the lowest frequencies, Hz, and the shape of the first one."""
    table: Columns = {}
    unit = np.array(
        [NAN if p.design is None else frequency_unit(p.design.D, 1.0, p.design.density) for p in batch.problems]
    )
    scale = unit[batch.problem] * np.sqrt(batch.E)
    for k in range(3):
        values = [_number((answer.values.get("frequency") or [None] * 3)[k]) for answer in answers]
        table[f"mode{k + 1}_Hz"] = np.array(values)[batch.problem] * scale
    shapes = [(answer.values.get("shape") or [None])[0] for answer in answers]
    return table | {"mode1_shape": np.array(shapes, dtype=object)[batch.problem]}


def _number(value: float | None) -> float:
    return NAN if value is None else value


def flat_rows(table: Mapping[str, NDArray[Any]]) -> Iterator[dict[str, Any]]:
    """Yield the rows of a table as records with Python's own numbers and texts."""
    names = list(table)
    for values in zip(*(table[name].tolist() for name in names), strict=True):
        yield dict(zip(names, values, strict=True))
