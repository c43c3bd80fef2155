"""Columns of a study's rows: results of all models in each case, the readings they give, and the models' errors.

Everything is computed for a batch of cases at once: responses for each distinct problem, scaled to the E of each
case; readings for all cases in one call (`analytic.hall.batch_readings`). Errors are those of a model against the
reference, the last finite-element model of the study, in % of the case's own value. Where the reference's force along
a shear is not positive, or within its own error of 0, the beam gave way: no error along the shear is stated, and
`error_status` is `gave_way`, as in `studies.validation.formulas.assumption`. It is `unknown` where that error is.

Columns are named as `studies.sweeps.sweep_columns` says.

Each of several models has a status of its own in each row: `ok`, `unstable` and so on of finite elements, `ok` or
`bad_input` of formulas and of the surrogate. The row's `status` is that of the reference, and of the quantities that
are paths of their own; without finite elements it is `ok` where any model answers.
"""

from __future__ import annotations

import cmath
import contextlib
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic import beam
from analytic.hall import batch_readings
from analytic.parts import element_names
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, Response, rotation_of
from geometry.relaxation import relaxation_of
from studies.inputs import study_input
from studies.mechanics import timed_quantities
from studies.mechanics.model_choice import along_shear
from studies.mechanics.path_solver import Answer, frequency_unit
from studies.mechanics.solve_plan import IMPOSSIBLE
from studies.mechanics.study_cases import Batch, Columns, Plan, Problem, Recent
from studies.quantities import QUANTITIES, Quantity
from studies.sweeps.sweep_columns import SweepColumns, prefixes, status_columns

NAN = math.nan
FIRST_AXES = ("D", "L", "f", "E", "depth")
"""Axes whose columns every table has, first."""
RESISTS = {
    "gave_way": "the beam gave way: its force does not oppose the shear, and no error along the shear is stated",
    "unknown": "the error of the force along the shear is unknown, and so is whether the beam gave way",
}
"""Messages of `error_status`."""
LAST = ("status", "message")
"""Last columns of a table."""
POSE = ("shift_x_mm", "shift_y_mm", "shift_z_mm", "tilt_rad", "tilt_y_rad")
"""Columns that place the magnet."""
MOST_DECODERS = 16
"""Number of decoders that are kept, some MB each."""


# Results of a model


def spread(batch: Batch, responses: Sequence[Response | None]) -> Columns:
    """Return the columns of force, pose and contact of one model from the responses of the distinct problems.

    A case whose sensor is impossible has no results, NaN, although its mechanics may be those of others.
    """
    rows = [(NAN,) * 9 if r is None else (*r.force, *r.shift, r.tilt, r.tilt_y, r.contact_radius) for r in responses]
    # 1 for a possible sensor, else NaN, which every product keeps
    each = np.reshape(rows, (-1, 9))[batch.problem].T * _of_sensors(batch, lambda design: 1.0)
    each[:3] *= batch.E / _of_problems(batch, lambda design: design.E_now)
    names = ("force_x_N", "force_y_N", "force_N", "shift_x_mm", "shift_y_mm", "shift_z_mm")
    return dict(zip((*names, "tilt_rad", "tilt_y_rad", "contact_radius_mm"), each + 0.0, strict=True))


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


# Rows


@dataclass(frozen=True, slots=True)
class Solved:
    """Answers of the finite elements for the distinct problems of a batch.

    Attributes
    ----------
    states : of each model by its name, for the problem's own D, E and direction of the shear; the status is
        "bad_input" where the problem is impossible.
    numbers : number of the reference's path, 0 for none; empty without a reference.
    others : of the quantities that are paths of their own.
    chosen : the model that a tolerance has chosen, and the bound of its relative error.
    """

    states: Mapping[str, Sequence[Answer]]
    numbers: Sequence[int]
    others: Mapping[str, Sequence[Answer]]
    chosen: Sequence[tuple[str, float]] = ()


class Rows:
    """Computes the columns of batches of one study."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self._formulas: Recent[Answer] = Recent()
        self._decoders: Recent[Any] = Recent(MOST_DECODERS)
        self.prefixes = prefixes(plan)
        self._named = SweepColumns.of_plan(plan)

    def columns(self, batch: Batch, solved: Solved) -> Columns:
        """Return the table of a batch."""
        plan = self.plan
        states = dict(solved.states)
        for level in plan.formulas:
            states[level] = [self._formula(level, *each) for each in zip(batch.codes, batch.problems, strict=True)]
        results = {name: spread(batch, [answer.response for answer in each]) for name, each in states.items()}
        table = self._axis_columns(batch)
        resists = _texts(batch, [self._resists(states, k, problem) for k, problem in enumerate(batch.problems)])
        stored = {name: self._stored(batch, answers) for name, answers in solved.states.items()}
        table |= self._mechanics(self._with_derived(table, results, stored), resists == "gave_way")
        for column in dict.fromkeys(itertools.chain(*stored.values())):
            table |= {f"{self.prefixes[name]}{column}": values[column] for name, values in stored.items()}
        if "readings" in plan.quantities:
            table |= self._reading_columns(batch, results)
        if "decoded_force_error" in plan.quantities:
            table |= self._decoded(batch, results)
        for name, answers in solved.others.items():
            table |= stored_columns(QUANTITIES[name], batch, answers)
            table |= OTHERS[name](plan, batch, answers) if name in OTHERS else {}
        if "l0" not in plan.fields:
            table["l0_mm"] = _of_sensors(batch, lambda design: design.l0)
        table |= self._estimates(batch, solved) | self._verdict(batch, solved, states)
        if self.plan.truth and self.plan.loads_sideways and len(results) > 1:
            answered = np.isfinite(results[self.plan.truth]["force_N"])
            table["error_status"] = np.where(answered, resists, "").astype(object)
            for row in np.flatnonzero(answered & (resists != "ok")).tolist():
                table["message"][row] = "; ".join(filter(None, (table["message"][row], RESISTS[resists[row]])))
        return {name: table[name] for name in (*(n for n in table if n not in LAST), *LAST)}

    def _resists(self, states: Mapping[str, Sequence[Answer]], k: int, problem: Problem) -> str:
        """Return `gave_way` where the reference's force along a shear is not known to oppose it, `unknown` where its
        error is, else `ok`."""
        answer = states[self.plan.truth][k] if self.plan.truth else None
        if answer is None or answer.response is None or problem.load is None or not problem.load.shears_tip:
            return "ok"
        # a formula says exactly what it says
        error = 0.0 if self.plan.truth in self.plan.formulas else answer.estimates.get("sideways")
        along = along_shear(problem.load, answer.response)
        if not along > 0:
            return "gave_way"
        return "unknown" if error is None or math.isnan(error) else "ok" if error < 1 else "gave_way"

    def _axis_columns(self, batch: Batch) -> Columns:
        base, n = self.plan.design, len(batch)
        fixed: dict[str, Any] = {name: getattr(base, name) for name in FIRST_AXES if name != "depth"}
        fixed |= {"depth": self.plan.load.get("depth", 0.0)}
        fixed |= {name: value for name, value in self.plan.load.items() if name != "depth"}
        table: Columns = {}
        for name in dict.fromkeys((*FIRST_AXES, *self.plan.fields, *self.plan.axes, *fixed)):
            values = batch.axes[name] if name in batch.axes else np.full(n, fixed[name])
            table[study_input.column(name)] = _as_column(values)
        return table

    def _stored(self, batch: Batch, answers: Sequence[Answer]) -> Columns:
        """Return the columns of what the states of one model hold beside their response, of the quantities asked."""
        asked = [QUANTITIES[name] for name in self.plan.quantities if not QUANTITIES[name].path]
        return {name: values for each in asked for name, values in stored_columns(each, batch, answers).items()}

    def _with_derived(
        self, fields: Columns, results: Mapping[str, Columns], stored: Mapping[str, Columns]
    ) -> dict[str, Columns]:
        """Return the columns of each model with those of the derived quantities that are asked for."""
        every = {name: dict(result) for name, result in results.items()}
        for name, result in every.items():
            for asked in self.plan.quantities:
                if derive := QUANTITIES[asked].derive:
                    with np.errstate(divide="ignore", invalid="ignore"):
                        found = derive(fields | result | stored.get(name, {}))
                    result[QUANTITIES[asked].parts[0].column] = np.where(np.isfinite(found), found, NAN)
        return every

    def _mechanics(self, results: Mapping[str, Columns], gave_way: NDArray[np.bool_]) -> Columns:
        plan = self.plan
        parts = [
            part
            for name in plan.quantities
            for part in QUANTITIES[name].parts[: None if plan.loads_sideways else 1]
            if all(part.column in result for result in results.values())
        ]
        table = {
            f"{self.prefixes[model]}{part.column}": result[part.column]
            for model, result in results.items()
            for part in parts
        }
        if plan.truth:
            for model in (model for model in results if model != plan.truth):
                for part in parts:
                    stated = percents(results[model][part.column], results[plan.truth][part.column])
                    error = f"{self._named.error_prefix(model)}{part.error_column}"
                    table[error] = np.where(gave_way & part.along_shear, NAN, stated)
        return table

    def _formula(self, level: str, code: int, problem: Problem) -> Answer:
        def make() -> Answer:
            if problem.design is None or problem.load is None:
                return replace(IMPOSSIBLE, message=problem.message)
            design = problem.design
            try:
                response = beam.solve(design, problem.load, level)
            except BadInput as error:
                return replace(IMPOSSIBLE, message=f"no formula: {error}")
            unknown = f"the formulas use E and nu only, not the law {design.law}"
            message = "" if design.law == "neo-hookean" else unknown
            return Answer(design.D, design.E_now, response, "ok", message, NAN, 0.0)

        return self._formulas.get((level, code), make)

    def _estimates(self, batch: Batch, solved: Solved) -> Columns:
        """Return the columns of error estimates, and of choices, numbers and times of solves."""
        table: Columns = {}
        several = len(self.plan.fem) > 1
        for name, answers in solved.states.items():
            column = f"{self.prefixes[name]}error_estimate" if several else "error_estimate"
            table[column] = _of_answers(batch, [answer.error_estimate for answer in answers])
            for part in ("shift", "tilt", "sideways") if self.plan.loads_sideways else ("shift",):
                estimates = [answer.estimates.get(part) for answer in answers]
                table[column.replace("error", f"{part}_error")] = _of_answers(batch, estimates)
        reference = solved.states[self.plan.reference.name] if self.plan.reference is not None else ()
        zeros = [0] * len(batch.problems)
        if self.plan.reference is not None and self.plan.reference.tolerance is not None:
            table["chosen_model"] = _texts(batch, [name for name, _ in solved.chosen])
            table["expected_error"] = np.array([bound for _, bound in solved.chosen], dtype=float)[batch.problem]
        table["solve"] = np.array(solved.numbers or zeros)[batch.problem]
        table["seconds"] = np.array([a.seconds for a in reference] or zeros, dtype=float)[batch.problem]
        return table

    def _verdict(self, batch: Batch, solved: Solved, states: Mapping[str, Sequence[Answer]]) -> Columns:
        """Return the status of each model, and status and message of the row; `states` are those of all models."""
        own = status_columns(self.plan)
        table = {own[name]: _texts(batch, [a.status for a in each]) for name, each in states.items() if name in own}
        rows = [self._state(solved, states, k, problem) for k, problem in enumerate(batch.problems)]
        table["status"] = _texts(batch, [status for status, _ in rows])
        table["message"] = _texts(batch, [message for _, message in rows])
        read = "readings" in self.plan.quantities and {"magnet_diameter", "magnet_height"} & set(self.plan.fields)
        for k, design in enumerate(batch.sensors):
            if design is None:
                rows_of = (batch.sensor == k) & (table["status"] != "bad_input")
                table["message"][rows_of] = batch.sensor_messages[k]
                for name in (*own.values(), "status"):
                    table[name][rows_of] = "bad_input"
            elif read and not design.shape.has_magnet:
                for row in np.flatnonzero((batch.sensor == k) & (table["status"] != "bad_input")).tolist():
                    texts = (table["message"][row], "without a magnet there are no readings")
                    table["message"][row] = "; ".join(filter(None, texts))
        return table

    def _state(
        self, solved: Solved, states: Mapping[str, Sequence[Answer]], k: int, problem: Problem
    ) -> tuple[str, str]:
        if problem.design is None:
            return "bad_input", problem.message
        others = [each[k] for each in solved.others.values()]
        # the reference is the last model that is no formula
        models = [
            states[name][k] for name in (*(model.name for model in reversed(self.plan.fem)), *self.plan.formulas)
        ]
        texts = [answer.message for answer in (*models, *others)]
        judged = [models[0], *others] if self.plan.reference else models
        if self.plan.reference:
            status = next((answer.status for answer in judged if answer.status != "ok"), "ok")
        else:
            status = next((answer.status for answer in judged if answer.status in ANSWERED), "bad_input")
        buckled = ""
        if "critical_depth" in solved.others:
            status, buckled = with_critical(status, solved.others["critical_depth"][k], problem)
        return status, "; ".join(filter(None, dict.fromkeys([*texts, buckled])))

    # Readings of the Hall elements, and forces that the formulas decode from them

    def _reading_columns(self, batch: Batch, results: Mapping[str, Columns]) -> Columns:
        """Return fields and outputs of the elements by all models, and errors in % of the change from rest.

        If the layout varies, the columns of one layout are empty in the rows of another.
        """
        rest = self._read(batch, dict.fromkeys(POSE, np.zeros(len(batch))))[0]
        read = {name: self._read(batch, result) for name, result in results.items()}
        table: Columns = {}
        for (names, unit), layouts in self._layouts().items():
            other = np.array([d is None or (d.hall_layout, d.chip_count) not in layouts for d in batch.sensors])
            table |= self._of_layout(names, unit, other[batch.sensor], rest, read)
        return table

    def _layouts(self) -> dict[tuple[tuple[str, ...], str], list[tuple[str, float]]]:
        """Return names of elements and unit of their outputs, with the study's layouts and numbers of chips that
        have them."""
        base = self.plan.design

        def values(name: str) -> list[Any]:
            given = [dict(zip(f.names, f.values, strict=True)).get(name, ()) for f in self.plan.factors]
            return list(dict.fromkeys(value for each in given for value in each)) or [getattr(base, name)]

        groups: dict[tuple[tuple[str, ...], str], list[tuple[str, float]]] = {}
        for layout, count in itertools.product(values("hall_layout"), values("chip_count")):
            names, unit = element_names(layout, int(count))
            key = tuple(name.replace(" ", "_") for name in names), unit if unit == "V" else "output_mT"
            groups.setdefault(key, []).append((layout, count))
        return groups

    def _of_layout(
        self,
        names: Sequence[str],
        unit: str,
        other: NDArray[np.bool_],
        rest: Array,
        read: Mapping[str, tuple[Array, Array]],
    ) -> Columns:
        """Return the columns of one layout; `other` marks the cases, shape (n,), that have another one."""
        size = 1.0 if unit == "V" else 1e3
        shown = names if self.plan.loads_sideways or len(names) > 3 else names[:2]
        table: Columns = {}
        for k, element in enumerate(shown):
            for name, (field, _) in read.items():
                table[f"{self.prefixes[name]}{element}_mT"] = np.where(other, NAN, 1e3 * field[:, k])
            for name, (_, output) in read.items():
                table[f"{self.prefixes[name]}{element}_{unit}"] = np.where(other, NAN, size * output[:, k])
            if not self.plan.truth:
                continue
            truth = read[self.plan.truth][0][:, k] - rest[:, k]
            for name, (field, _) in read.items():
                if name != self.plan.truth:
                    column = f"{self._named.error_prefix(name)}{element}_error_percent_of_change"
                    table[column] = np.where(other, NAN, percents(field[:, k] - rest[:, k], truth))
        return table

    def _read(self, batch: Batch, result: Columns) -> tuple[Array, Array]:
        count = max(len(names) for names, _ in self._layouts())
        if not any(design is not None and design.shape.has_magnet for design in batch.sensors):
            return np.full((len(batch), count), NAN), np.full((len(batch), count), NAN)
        x, y, z, tilt, tilt_y = (result[name] for name in POSE)
        shift = np.stack([x, y, z], axis=1) * _of_sensors(batch, lambda design: 1.0)[:, None]
        designs = [design or self.plan.design for design in batch.sensors]
        readings = batch_readings(designs, batch.sensor, shift, np.stack(rotation_of(tilt, tilt_y), axis=1))
        missing = ((0, 0), (0, count - readings.output.shape[1]))
        field, output = (np.pad(each, missing, constant_values=NAN) for each in (readings.field_T, readings.output))
        return field, output

    def _decoded(self, batch: Batch, results: Mapping[str, Columns]) -> Columns:
        """Return the forces that each formula level decodes from the reference's readings, and their errors."""
        table: Columns = {}
        reference = self.plan.reference
        assert reference is not None
        truth = results[reference.name]
        true = np.stack([truth[name] for name in ("force_x_N", "force_y_N", "force_N")], axis=1)
        output = self._read(batch, truth)[1]
        magnets = _texts(batch, [problem.magnet for problem in batch.problems])
        for level in self.plan.formulas:
            force = np.full((len(batch), 3), NAN)
            for (k, design), magnet in itertools.product(enumerate(batch.sensors), ("rigid", "ignored")):
                rows = np.flatnonzero((batch.sensor == k) & (magnets == magnet) & np.isfinite(output).all(axis=1))
                decoder = self._decoder(level, design, magnet) if design is not None and len(rows) else None
                if decoder is not None:
                    from analytic.decode import decode, field_of

                    force[rows] = decode(decoder, field_of(decoder.forward.elements, output[rows])).force
            force = force * (batch.E / _of_sensors(batch, lambda design: design.E_now))[:, None]
            difference = np.linalg.norm(force - true, axis=1)
            prefix = f"decoded_{level}_" if len(self.plan.formulas) > 1 else "decoded_"
            table[f"{prefix}force_N"] = force[:, 2]
            table[f"{prefix}force_error_N"] = difference
            size = np.linalg.norm(true, axis=1)
            table[f"{prefix}force_error_percent"] = 100 * ratio(difference, size)
        return table

    def _decoder(self, level: str, design: Design, magnet: str) -> Any:
        """Return the decoder of a sensor at the base design's E, or None if it cannot be made."""
        from analytic.decode import decoder
        from studies.sensing.decode_readings import of_level

        def make() -> Any:
            with contextlib.suppress(BadInput):
                return decoder(design, of_level(design.for_mechanics(magnet), level))
            return None

        return self._decoders.get((level, design, magnet), make)


def with_critical(status: str, critical: Answer, problem: Problem) -> tuple[str, str]:
    """Return the status of a press beside its critical depth, and what the one says of the other.

    The mesh of the critical depth is finer where the contact ends: it is the closer one, but a state that one of the
    two calls unstable is not called stable. Within the estimated error of the critical depth the status is unknown;
    an error that is unknown has no bound, so that every depth is within it.
    """
    if problem.design is None or problem.load is None or critical_verdict(critical) == "unknown":
        return status, ""
    D, load, depth = problem.design.D, problem.load, critical.values["critical_depth_over_D"]
    if depth is None:
        stable = critical.values["stable_to_over_D"] * D
        return status, f"no critical depth down to {stable:.4g} mm, where the search ends"
    # without a shear nothing is glued
    presses = load.depth > 0 and replace(load, friction="none") == Load(load.depth) and load.coulomb is None
    if not presses or status not in ANSWERED:
        return status, ""
    at, error = depth * D, critical.error_estimate
    if not abs(load.depth / at - 1) > error:
        off = "with an unknown error" if math.isnan(error) else f"+- {100 * error:.2g} %"
        where = f"the press buckles sideways at {at:.4g} mm {off}, now it is {load.depth:g} mm deep"
        return "unstable" if status == "unstable" else "unknown", where
    if load.depth > at:
        said = f"the press buckles sideways at {at:.4g} mm, now it is {load.depth:g} mm deep"
        return "unstable", "" if status == "unstable" else said
    said = f"on the finer mesh of the critical depth it is stable down to {at:.4g} mm"
    return ("ok", "") if status == "ok" else ("unstable" if status == "unstable" else "ok", said)


def _as_column(values: NDArray[Any]) -> NDArray[Any]:
    if values.dtype.kind not in "OU":
        return values
    return np.array([v if isinstance(v, str) else f"{v:.12g}" for v in values.tolist()], dtype=object)


def _of_sensors(batch: Batch, value: Callable[[Design], float]) -> Array:
    """Return a number of each case's sensor; NaN for an impossible one."""
    values = [NAN if design is None else value(design) for design in batch.sensors]
    return np.array(values, dtype=float)[batch.sensor]


def _of_problems(batch: Batch, value: Callable[[Design], float]) -> Array:
    """Return a number of the design whose mechanics each case shares; NaN for an impossible one."""
    values = [NAN if p.design is None else value(p.design) for p in batch.problems]
    return np.array(values, dtype=float)[batch.problem]


# Critical depths, modes, vibrations, cycles


def critical_verdict(critical: Answer) -> str:
    """Return whether a press buckles sideways, or is stable to the end of the search; a search that ended before, or
    failed, leaves it unknown.
    """
    if critical.values.get("critical_depth_over_D") is not None:
        return "buckles"
    whole = critical.values.get("stable_to_over_D") is not None and not critical.message
    return "stable" if whole else "unknown"


def stored_columns(quantity: Quantity, batch: Batch, answers: Sequence[Answer]) -> Columns:
    """Return the columns of a quantity's stored parts, from the answers to the distinct problems of a batch."""
    parts = [part for part in quantity.parts if part.stored]
    D = _of_problems(batch, lambda design: design.D) if parts else np.zeros(0)
    table: Columns = {}
    for part in parts:
        values = _of_answers(batch, [answer.values.get(part.stored) for answer in answers])
        table[part.column] = part.scaled(values, batch.E, D)
        if part.estimate:
            estimates = [
                answer.error_estimate if quantity.path else answer.estimates.get(part.estimate) for answer in answers
            ]
            table[part.estimate_column] = _of_answers(batch, estimates)
        if part.half_width:
            values = _of_answers(batch, [answer.values.get(part.half_width) for answer in answers])
            table[f"{part.column}_half_width"] = part.scaled(values, batch.E, D)
    return table


def _critical_columns(_: Plan, batch: Batch, answers: Sequence[Answer]) -> Columns:
    return {"critical_depth_verdict": _texts(batch, [critical_verdict(answer) for answer in answers])}


def _mode_columns(_: Plan, batch: Batch, answers: Sequence[Answer]) -> Columns:
    table: Columns = {}
    unit = _of_problems(batch, lambda design: frequency_unit(design.D, 1.0, design.density))
    scale = unit * np.sqrt(batch.E)
    for k in range(3):
        values = [(answer.values.get("frequency") or [None] * 3)[k] for answer in answers]
        table[f"mode{k + 1}_Hz"] = _of_answers(batch, values) * scale
    shapes = [(answer.values.get("shape") or [None])[0] for answer in answers]
    return table | {"mode1_shape": _texts(batch, shapes)}


def _response_columns(plan: Plan, batch: Batch, answers: Sequence[Answer]) -> Columns:
    """Return -3 dB bandwidth, first resonance and its Q; with a frequency also gain and phase there, degrees."""
    named = ("response_bandwidth_Hz", "response_resonance_Hz", "response_Q")
    at = ("response_gain", "response_phase_deg") if "frequency" in {*plan.load, *plan.axes} else ()
    found = [_vibration(plan, problem, answer) for problem, answer in zip(batch.problems, answers, strict=True)]
    numbers = np.reshape(found, (-1, 5))[batch.problem]
    columns = dict(zip((*at, *named), numbers.T[0 if at else 2 :], strict=True))
    return {name: np.ascontiguousarray(values) for name, values in columns.items()}


def _vibration(plan: Plan, problem: Problem, answer: Answer) -> tuple[float, ...]:
    """Return gain, phase, bandwidth, resonance and Q of a problem; NaN for what it does not have."""
    from fem.analyses.vibration import relaxed

    values, design = answer.values, problem.design
    if not values or design is None or plan.reference is None:
        return (NAN,) * 5
    at_rest, frequency = relaxed(design, relaxation_of(design)), problem.motion.frequency
    unit = timed_quantities.unit_of(at_rest)
    gain = complex(NAN, NAN)
    if frequency is not None:
        gain = timed_quantities.gain_at(values, timed_quantities.band(at_rest, plan.reference.accuracy), frequency)
    bandwidth, resonance, Q = (
        NAN if values[name] is None else values[name] for name in ("bandwidth", "resonance", "Q")
    )
    return abs(gain), math.degrees(cmath.phase(gain)), bandwidth * unit, resonance * unit, Q


OTHERS: dict[str, Callable[[Plan, Batch, Sequence[Answer]], Columns]] = {
    "critical_depth": _critical_columns,
    "modes": _mode_columns,
    "response": _response_columns,
}
"""Columns that are derived from what the paths of quantities of their own store."""


def _of_answers(batch: Batch, values: Sequence[float | None]) -> Array:
    return np.array([NAN if value is None else value for value in values], dtype=float)[batch.problem]


def _texts(batch: Batch, values: Sequence[str | None]) -> NDArray[Any]:
    return np.array(values, dtype=object)[batch.problem]


def flat_rows(table: Mapping[str, NDArray[Any]]) -> Iterator[dict[str, Any]]:
    """Yield the rows of a table as records with Python's own numbers and texts."""
    names = list(table)
    for values in zip(*(table[name].tolist() for name in names), strict=True):
        yield dict(zip(names, values, strict=True))
