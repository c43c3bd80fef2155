"""Answers to the cases of a study: results of all models in each case, the readings they give, and their statuses.

Everything is computed for a batch of cases at once: responses for each distinct problem, scaled to the E of each
case; readings for all cases in one call (`analytic.hall.batch_readings`). Where the reference's force along a shear
is not positive, or within its own error of 0, the beam gave way: no error along the shear is stated, and
`error_status` is `gave_way`, as in `studies.validation.formulas.assumption`. It is `unknown` where that error is.

Each of several models has a status of its own in each row: `ok`, `unstable` and so on of finite elements, `ok` or
`bad_input` of formulas and of the surrogate. The row's `status` is that of the reference, and of the quantities that
are paths of their own; without finite elements it is `ok` where any model answers.
"""

from __future__ import annotations

import cmath
import contextlib
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.hall import batch_readings
from analytic.parts import element_names
from fem.scene import relaxed
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, rotation_of
from geometry.relaxation import relaxation_of
from studies.answers import NAN, STATED, Answers, SweepColumns, ratio
from studies.inputs import study_input
from studies.mechanics import timed_quantities
from studies.mechanics.model import Problem
from studies.mechanics.path_solver import Answer, frequency_unit
from studies.mechanics.study_cases import Batch, Columns, Plan, Recent
from studies.quantities import QUANTITIES, Part, Quantity, reading_parts, shown

FIRST_AXES = ("D", "L", "f", "E", "depth")
"""Axes whose columns every table has, first."""
MOST_DECODERS = 16
"""Number of decoders that are kept, some MB each."""


Given = Mapping[str, Sequence[Answer]]
"""Answers to the distinct problems of a batch, for their own D, E and direction of the shear, by the models' names
and by quantities that are paths of their own; the status is "bad_input" where a problem is impossible."""


class Rows:
    """Computes the answers to batches of one study."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self._decoders: Recent[Any] = Recent(MOST_DECODERS)
        self._columns = SweepColumns.of_plan(plan)
        self._paths = [name for name in plan.quantities if QUANTITIES[name].path]

    def answers(self, batch: Batch, given: Given, numbers: Sequence[int]) -> Answers:
        """Return the answers to a batch; `numbers`: of the path of the reference's answer to each problem."""
        plan, states = self.plan, {model.name: given[model.name] for model in self.plan.models}
        stating = {model.name: states[model.name] for model in plan.models if model.states_errors}
        found = Answers(self._columns, plan.quantities, self._axis_columns(batch), plan.loads_sideways)
        unloaded = {study_input.column(name): 0.0 for name in study_input.NUMBERS}
        found.fixed = study_input.columns_of(plan.design) | unloaded
        for model, answers in states.items():
            _add_responses(found, batch, model, answers)
        for model, answers in stating.items():
            found.estimate[model, "force"] = _of_answers(batch, [answer.error_estimate for answer in answers])
            for name in STATED[1 : 4 if plan.loads_sideways else 2]:
                found.estimate[model, name] = _of_answers(batch, [answer.estimates.get(name) for answer in answers])
        for name in plan.quantities:
            for model, answers in stating.items() if QUANTITIES[name].of_states else ():
                _add_stored(found, batch, model, QUANTITIES[name], answers)
        if plan.loads_sideways:
            loads = [problem.load for problem in batch.problems]
            ways = [load.direction if load is not None and load.shears_tip else (NAN, NAN) for load in loads]
            found.direction = np.reshape(ways, (-1, 2))[batch.problem]
        if "readings" in plan.quantities:
            self._add_readings(found, batch)
        if "decoded_force_error" in plan.quantities:
            self._add_decoded(found, batch)
        for name in self._paths:
            assert plan.reference is not None
            _add_stored(found, batch, plan.reference.name, QUANTITIES[name], given[name])
            if name in PATHS:
                PATHS[name](found, plan.reference.name, plan, batch, given[name])
        if "l0" not in plan.fields:
            found.late["l0_mm"] = _of_sensors(batch, lambda design: design.l0)
        found.solves = self._solve_columns(batch, states, numbers)
        self._add_verdicts(found, batch, states, {name: given[name] for name in self._paths})
        return found

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

    def _solve_columns(self, batch: Batch, states: Given, numbers: Sequence[int]) -> Columns:
        """Return the further columns of the models, and numbers and times of solves."""
        table: Columns = {}
        for model in self.plan.models:
            for column, none in model.columns.items():
                values = [answer.columns.get(column, none) for answer in states[model.name]]
                kind = object if isinstance(none, str) else float
                table[column] = np.array(values, dtype=kind)[batch.problem]
        reference = self.plan.reference
        seconds = [answer.seconds for answer in states[reference.name]] if reference else [0.0] * len(batch.problems)
        table["solve"] = np.array(numbers, dtype=int)[batch.problem]
        table["seconds"] = np.array(seconds, dtype=float)[batch.problem]
        return table

    def _add_verdicts(self, found: Answers, batch: Batch, states: Given, paths: Given) -> None:
        """Add the status of each model, and status and message of the row."""
        found.status = {name: _texts(batch, [a.status for a in each]) for name, each in states.items()}
        rows = [self._state(states, paths, k, problem) for k, problem in enumerate(batch.problems)]
        status = found.status[""] = _texts(batch, [status for status, _ in rows])
        message = found.message = _texts(batch, [message for _, message in rows])
        read = "readings" in self.plan.quantities and {"magnet_diameter", "magnet_height"} & set(self.plan.fields)
        for k, design in enumerate(batch.sensors):
            if design is None:
                rows_of = (batch.sensor == k) & (status != "bad_input")
                message[rows_of] = batch.sensor_messages[k]
                for each in found.status.values():
                    each[rows_of] = "bad_input"
            elif read and not design.shape.has_magnet:
                for row in np.flatnonzero((batch.sensor == k) & (status != "bad_input")).tolist():
                    texts = (message[row], "without a magnet there are no readings")
                    message[row] = "; ".join(filter(None, texts))

    def _state(self, states: Given, paths: Given, k: int, problem: Problem) -> tuple[str, str]:
        if problem.design is None:
            return "bad_input", problem.message
        others = [each[k] for each in paths.values()]
        # the reference first, then what states errors, finest first
        stating = [model for model in reversed(self.plan.models) if model.states_errors]
        stating.sort(key=lambda model: model is not self.plan.reference)
        ranked = [*stating, *(model for model in self.plan.models if not model.states_errors)]
        models = [states[model.name][k] for model in ranked]
        texts = [answer.message for answer in (*models, *others)]
        judged = [models[0], *others] if self.plan.reference else models
        if self.plan.reference:
            status = next((answer.status for answer in judged if answer.status != "ok"), "ok")
        else:
            status = next((answer.status for answer in judged if answer.status in ANSWERED), "bad_input")
        buckled = ""
        if "critical_depth" in paths:
            status, buckled = with_critical(status, paths["critical_depth"][k], problem)
        return status, "; ".join(filter(None, dict.fromkeys([*texts, buckled])))

    # Readings of the Hall elements, and forces that the formulas decode from them

    def _add_readings(self, found: Answers, batch: Batch) -> None:
        """Add fields and outputs of the elements by all models, and the changes of the fields from rest.

        If the layout varies, the parts of one layout are empty in the rows of another.
        """
        rest = self._read(batch, np.zeros((len(batch), 3)), np.zeros((len(batch), 2)))[0]
        own = [(design.hall_layout, design.chip_count) if design else None for design in batch.sensors]
        # place of a part's element, factor on its output, and where the case has another layout
        places: list[tuple[int, float, NDArray[np.bool_]]] = []
        for (names, unit), layouts in self._layouts().items():
            shown = names if self.plan.loads_sideways or len(names) > 3 else names[:2]
            found.parts["readings"] = (*found.parts.get("readings", ()), *reading_parts(shown, unit))
            other = np.array([each not in layouts for each in own], dtype=bool)[batch.sensor]
            places += [(k, 1.0 if unit == "V" else 1e3, other) for k in range(len(shown))]
        for model in found.columns.models:
            field, output = self._read(batch, found.value[model, "shift"], found.value[model, "tilt"])
            values, changes = list[Array](), list[Array]()
            for k, size, other in places:
                values += [np.where(other, NAN, each) for each in (1e3 * field[:, k], size * output[:, k])]
                changes += [np.where(other, NAN, field[:, k] - rest[:, k])] * 2
            found.value[model, "readings"] = np.array(values).T
            found.change[model, "readings"] = np.array(changes).T

    def _layouts(self) -> dict[tuple[tuple[str, ...], str], list[tuple[str, float]]]:
        """Return names of elements and unit of their outputs, with the study's layouts and numbers of chips that
        have them."""
        base = self.plan.design

        def values(name: str) -> list[Any]:
            given = [dict(zip(f.names, f.values, strict=True)).get(name, ()) for f in self.plan.factors]
            return list(dict.fromkeys(value for each in given for value in each)) or [getattr(base, name)]

        groups: dict[tuple[tuple[str, ...], str], list[tuple[str, float]]] = {}
        for layout, count in itertools.product(values("hall_layout"), values("chip_count")):
            groups.setdefault(element_names(layout, int(count)), []).append((layout, count))
        return groups

    def _read(self, batch: Batch, shift: Array, tilt: Array) -> tuple[Array, Array]:
        """Return fields, T, and outputs of the elements at poses as `Answers.value` has them, shape (n, elements)."""
        count = max(len(names) for names, _ in self._layouts())
        if not any(design is not None and design.shape.has_magnet for design in batch.sensors):
            return np.full((len(batch), count), NAN), np.full((len(batch), count), NAN)
        shift = shift[:, [1, 2, 0]] * _of_sensors(batch, lambda design: 1.0)[:, None]
        designs = [design or self.plan.design for design in batch.sensors]
        readings = batch_readings(designs, batch.sensor, shift, np.stack(rotation_of(*tilt.T), axis=1))
        missing = ((0, 0), (0, count - readings.output.shape[1]))
        field, output = (np.pad(each, missing, constant_values=NAN) for each in (readings.field_T, readings.output))
        return field, output

    def _add_decoded(self, found: Answers, batch: Batch) -> None:
        """Add the forces that each formula level decodes from the reference's readings, and their errors."""
        reference = self.plan.reference
        assert reference is not None
        true = found.value[reference.name, "force"][:, [1, 2, 0]]
        output = self._read(batch, found.value[reference.name, "shift"], found.value[reference.name, "tilt"])[1]
        magnets = _texts(batch, [problem.magnet for problem in batch.problems])
        for level in self.plan.levels:
            force = np.full((len(batch), 3), NAN)
            for (k, design), magnet in itertools.product(enumerate(batch.sensors), ("rigid", "ignored")):
                rows = np.flatnonzero((batch.sensor == k) & (magnets == magnet) & np.isfinite(output).all(axis=1))
                decoder = self._decoder(level, design, magnet) if design is not None and len(rows) else None
                if decoder is not None:
                    from analytic.decode import decode, field_of

                    force[rows] = decode(decoder, field_of(decoder.forward.elements, output[rows])).force
            force = force * (batch.E / _of_sensors(batch, lambda design: design.E_now))[:, None]
            difference, size = np.linalg.norm(force - true, axis=1), np.linalg.norm(true, axis=1)
            decoded = [force[:, 2], difference, 100 * ratio(difference, size)]
            found.value[level, "decoded_force_error"] = np.array(decoded).T

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
        off = "with an unknown error" if math.isnan(error) else f"+- {shown(error, 'percent', 2)}"
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


# Responses and stored values


def _add_responses(found: Answers, batch: Batch, model: str, answers: Sequence[Answer]) -> None:
    """Add force, pose and contact of one model from the answers to the distinct problems.

    A case whose sensor is impossible has no results, NaN, although its mechanics may be those of others.
    """
    responses = [answer.response for answer in answers]
    rows = [(NAN,) * 9 if response is None else response.numbers for response in responses]
    # 1 for a possible sensor, else NaN, which every product keeps
    each = np.reshape(rows, (-1, 9))[batch.problem].T * _of_sensors(batch, lambda design: 1.0)
    each[:3] *= batch.E / _of_problems(batch, lambda design: design.E_now)
    each += 0.0
    for name, quantity in QUANTITIES.items():
        if quantity.response:
            found.value[model, name] = each[list(quantity.response)].T


def _add_stored(found: Answers, batch: Batch, model: str, quantity: Quantity, answers: Sequence[Answer]) -> None:
    """Add a quantity's stored parts from the answers to the distinct problems of a batch."""
    parts = [part for part in quantity.parts if part.stored]
    if not parts:
        return
    D = _of_problems(batch, lambda design: design.D)

    def scaled(part: Part, name: str) -> Array:
        stored = _of_answers(batch, [answer.values.get(name) for answer in answers])
        return part.scaled(stored, batch.E, D)

    found.value[model, quantity.name] = np.array([scaled(part, part.stored) for part in parts]).T
    halves = [scaled(part, part.half_width) for part in parts if part.half_width]
    if halves:
        found.half_width[model, quantity.name] = np.array(halves).T
    for name in {part.estimate for part in parts} - {""}:
        errors = [answer.error_estimate if quantity.path else answer.estimates.get(name) for answer in answers]
        found.estimate[model, name] = _of_answers(batch, errors)


# Critical depths, modes, vibrations, cycles


def critical_verdict(critical: Answer) -> str:
    """Return whether a press buckles sideways, or is stable to the end of the search; a search that ended before, or
    failed, leaves it unknown.
    """
    if critical.values.get("critical_depth_over_D") is not None:
        return "buckles"
    whole = critical.values.get("stable_to_over_D") is not None and not critical.message
    return "stable" if whole else "unknown"


def _add_critical(found: Answers, model: str, plan: Plan, batch: Batch, answers: Sequence[Answer]) -> None:
    verdicts = _texts(batch, [critical_verdict(answer) for answer in answers])
    found.words["critical_depth"] = {"critical_depth_verdict": verdicts}


def _add_modes(found: Answers, model: str, plan: Plan, batch: Batch, answers: Sequence[Answer]) -> None:
    scale = _of_problems(batch, lambda design: frequency_unit(design.D, 1.0, design.density)) * np.sqrt(batch.E)
    values = [(answer.values.get("frequency") or [None] * 3)[:3] for answer in answers]
    frequencies = np.reshape(np.array(values, dtype=float), (-1, 3))[batch.problem]
    found.value[model, "modes"] = frequencies * scale[:, None]
    shapes = [(answer.values.get("shape") or [None])[0] for answer in answers]
    found.words["modes"] = {"mode1_shape": _texts(batch, shapes)}


def _add_vibrations(found: Answers, model: str, plan: Plan, batch: Batch, answers: Sequence[Answer]) -> None:
    """Add -3 dB bandwidth, first resonance and its Q; with a frequency also gain and phase there, degrees."""
    names = ("response_gain", "response_phase", "response_bandwidth", "response_resonance", "response_Q")
    at = 0 if "frequency" in {*plan.load, *plan.axes} else 2
    values = [_vibration(plan, problem, answer) for problem, answer in zip(batch.problems, answers, strict=True)]
    found.value[model, "response"] = np.reshape(values, (-1, 5))[batch.problem][:, at:]
    found.parts["response"] = tuple(part for part in QUANTITIES["response"].parts if part.name in names[at:])


def _vibration(plan: Plan, problem: Problem, answer: Answer) -> tuple[float, ...]:
    """Return gain, phase, bandwidth, resonance and Q of a problem; NaN for what it does not have."""
    values, design = answer.values, problem.design
    accuracy = plan.reference.accuracy_of("response") if plan.reference else None
    if not values or design is None or accuracy is None:
        return (NAN,) * 5
    at_rest, frequency = relaxed(design, relaxation_of(design)), problem.motion.frequency
    unit = timed_quantities.unit_of(at_rest)
    gain = complex(NAN, NAN)
    if frequency is not None:
        gain = timed_quantities.gain_at(values, timed_quantities.band(at_rest, accuracy), frequency)
    bandwidth, resonance, Q = (
        NAN if values[name] is None else values[name] for name in ("bandwidth", "resonance", "Q")
    )
    return abs(gain), math.degrees(cmath.phase(gain)), bandwidth * unit, resonance * unit, Q


PATHS: dict[str, Callable[[Answers, str, Plan, Batch, Sequence[Answer]], None]] = {
    "critical_depth": _add_critical,
    "modes": _add_modes,
    "response": _add_vibrations,
}
"""What adds the answers of quantities that are paths of their own, where these are not stored as parts."""


def _of_answers(batch: Batch, values: Sequence[float | None]) -> Array:
    return np.array([NAN if value is None else value for value in values], dtype=float)[batch.problem]


def _texts(batch: Batch, values: Sequence[str | None]) -> NDArray[Any]:
    return np.array(values, dtype=object)[batch.problem]
