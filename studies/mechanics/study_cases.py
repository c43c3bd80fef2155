"""Cases of a study: every combination of its factors' points, resolved batch by batch into designs and loads.

A study may have millions of cases, of which most differ only in values that the finite elements do not depend on
(E, the Hall elements, the remanence). So a batch of cases is resolved by its distinct *sensors* (all fields but E)
and its distinct *problems* (what the mechanics depend on). Both are found by integer codes: the position of a case's
point in those factors that matter. Results for E follow by proportion, except under a load that is a force, such as
an imperfection.

The Hall elements keep the places that they have in the base design: if D or L moves the undeformed magnet's centre
from H to H', l0 becomes l0 + H' - H, unless l0 itself varies. The magnet keeps its size.
"""

from __future__ import annotations

import dataclasses
import math
from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from geometry.design import OF_MODULUS, OF_READINGS, OF_TIME, BadInput, Design, modulus_at
from geometry.loads import Magnet, check_load
from studies.inputs import study_input
from studies.inputs.study_input import DESIGN, LOAD, LOADS, Factor, load_of
from studies.inputs.user_input import Value
from studies.mechanics.model import Model, Problem
from studies.mechanics.timed_quantities import STILL, TIMED, check_motion, motion_of
from studies.quantities import QUANTITIES

READING_FIELDS = frozenset({*OF_READINGS, *OF_TIME})
"""Fields of a design on which the static mechanics do not depend."""
FORCES = tuple(name for name, field in LOAD.items() if field.unit == "N")
"""Fields of a load that are forces, over which results are not in proportion to E."""
MOST_KEPT = 20_000
"""Number of resolved sensors, and of problems, that are kept for the next batch; it bounds the memory."""
Columns = dict[str, NDArray[Any]]
"""A table: columns of equal length by their names; NaN and None stand for values that do not exist."""
Kept = TypeVar("Kept")


@dataclass(frozen=True, slots=True)
class Plan:
    """A study that is ready to run.

    factors : what varies; the last factor varies fastest.
    magnet : model of the magnet where it is no axis.
    models : in the order of their columns (`studies.models.models_of`); the last one that solves is the reference.
    truth : name of the model that errors are taken against; default: the reference, if there is one.
    """

    design: Design
    factors: tuple[Factor, ...]
    load: Mapping[str, Value]
    magnet: Magnet
    models: tuple[Model, ...]
    quantities: tuple[str, ...]
    truth: str = ""

    def __post_init__(self) -> None:
        if not self.truth and self.reference is not None:
            object.__setattr__(self, "truth", self.reference.name)

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of all axes."""
        return tuple(name for factor in self.factors for name in factor.names)

    @property
    def fields(self) -> tuple[str, ...]:
        """Fields that vary, an axis over D among them by its length."""
        return tuple(study_input.field_of(name) for name in self.axes)

    @property
    def count(self) -> int:
        """Number of cases."""
        return math.prod(factor.count for factor in self.factors)

    @property
    def reference(self) -> Model | None:
        """The finest model that solves, which gives the status of a row; None if the study has none."""
        return next((model for model in reversed(self.models) if model.solves), None)

    @property
    def solves(self) -> bool:
        """Whether any model solves, and so needs a store."""
        return self.reference is not None

    @property
    def levels(self) -> tuple[str, ...]:
        """Names of the models that decode readings: levels of the formulas."""
        return tuple(model.name for model in self.models if model.decodes)

    @property
    def depends_on_time(self) -> bool:
        """Whether any quantity depends on the relaxation of the silicone, and so on E itself."""
        return any(name in self.quantities for name in TIMED)

    @property
    def reading_fields(self) -> frozenset[str]:
        """Fields of a design on which the mechanics of this study do not depend."""
        return READING_FIELDS - set(OF_TIME) if self.depends_on_time else READING_FIELDS

    @property
    def loads_sideways(self) -> bool:
        """Whether any case may have forces or shifts sideways."""
        names = [name for name, spec in LOADS.items() if spec.metadata["sideways"]]
        return any(self.load.get(name) or name in self.fields for name in names)

    def idle(self, kind: str) -> frozenset[str]:
        """Return the axes on which "sensors" or "problems" do not depend."""
        force = any(self.load.get(name) or name in self.axes for name in FORCES)
        own_E = kind == "problems" and (force or self.depends_on_time)
        idle = self.reading_fields if kind == "problems" else frozenset(LOAD)
        if not own_E:
            idle = idle | {*(OF_MODULUS if kind == "problems" else ("E",))}
        return idle | {f"{name}/D" for name in idle}

    def matters(self, kind: str) -> tuple[int, ...]:
        """Return the indices of the factors on which "sensors" or "problems" depend."""
        idle = self.idle(kind)
        return tuple(k for k, factor in enumerate(self.factors) if not set(factor.names) <= idle)


@dataclass(frozen=True, slots=True)
class Batch:
    """Some cases of a study.

    axes : values of each axis, shape (n,).
    E : Young's modulus of each case at its temperature, shape (n,), MPa.
    sensors, sensor : the distinct sensors, None where impossible, and the index of each case's sensor, shape (n,).
    codes, problems, problem : the distinct problems with their codes, and the index of each case's problem, (n,).
    """

    axes: Mapping[str, NDArray[Any]]
    E: Array
    sensors: Sequence[Design | None]
    sensor: NDArray[np.int64]
    sensor_messages: Sequence[str]
    codes: Sequence[int]
    problems: Sequence[Problem]
    problem: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.E)

    def part(self, first: int, last: int) -> Batch:
        """Return the cases from position `first` to before `last` of the batch."""
        cut = slice(first, last)
        return dataclasses.replace(
            self,
            axes={name: values[cut] for name, values in self.axes.items()},
            E=self.E[cut],
            sensor=self.sensor[cut],
            problem=self.problem[cut],
        )


class Recent(Generic[Kept]):
    """Values by keys, of which only those added last are kept."""

    def __init__(self, most: int = MOST_KEPT) -> None:
        self.most = most
        self.values: OrderedDict[Hashable, Kept] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], Kept]) -> Kept:
        """Return the value of a key; `make` computes one that is not kept."""
        if key not in self.values:
            self.add(key, make())
        return self.values[key]

    def add(self, key: Hashable, value: Kept) -> None:
        """Keep the value of a key."""
        self.values[key] = value
        if len(self.values) > self.most:
            self.values.popitem(last=False)


class Cases:
    """The cases of a study, resolved batch by batch."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self._counts = [factor.count for factor in plan.factors]
        self._values = [tuple(_array(values) for values in factor.values) for factor in plan.factors]
        self._codes = {kind: self._point_codes(kind) for kind in ("sensors", "problems")}
        self._sensors: Recent[Design | str] = Recent()
        self._problems: Recent[Problem] = Recent()

    def batch(self, cases: NDArray[np.int64]) -> Batch:
        """Return the cases of these indices, shape (n,)."""
        plan = self.plan
        points = np.unravel_index(cases, self._counts)
        axes = {
            name: values[point]
            for factor, columns, point in zip(plan.factors, self._values, points, strict=True)
            for name, values in zip(factor.names, columns, strict=True)
        }
        D = axes.get("D", plan.design.D)
        # 0.3 times 8 is 2.4000000000000004
        axes |= {study_input.field_of(n): np.round(axes[n] * D, 12) for n in plan.axes if n in study_input.OVER_D}
        sensor_codes, sensor_first, sensor = self._distinct("sensors", points)
        codes, problem_first, problem = self._distinct("problems", points)
        sensors = [
            self._sensors.get(code, lambda k=k: self._sensor(axes, k))  # type: ignore[misc]
            for code, k in zip(sensor_codes, sensor_first, strict=True)
        ]
        problems = [
            self._problems.get(code, lambda k=k: self._problem(axes, k))  # type: ignore[misc]
            for code, k in zip(codes, problem_first, strict=True)
        ]
        E, temperature = (axes.get(name, getattr(plan.design, name)) for name in OF_MODULUS)
        E = np.broadcast_to(np.asarray(modulus_at(E, temperature), dtype=float), len(cases))
        designs = [None if isinstance(one, str) else one for one in sensors]
        reasons = [one if isinstance(one, str) else "" for one in sensors]
        return Batch(axes, E, designs, sensor, reasons, codes, problems, problem)

    def distinct_problems(self) -> NDArray[np.int64]:
        """Return for each distinct problem of the study the index of its first case, in rising order."""
        firsts = np.zeros(1, dtype=np.int64)
        for k, codes in self._codes["problems"].items():
            # each point of a further factor follows the ones before, because later factors vary faster
            steps = np.sort(np.unique(codes, return_index=True)[1]) * math.prod(self._counts[k + 1 :])
            firsts = (firsts[:, None] + steps[None, :]).ravel()
        return firsts

    def _point_codes(self, kind: str) -> dict[int, NDArray[np.int64]]:
        """Return for each factor that matters the codes of its points: equal where all that matters is equal."""
        idle = self.plan.idle(kind)
        codes = {}
        for k in self.plan.matters(kind):
            factor, known = self.plan.factors[k], dict[tuple[Value, ...], int]()
            columns = [_keys(v) for name, v in zip(factor.names, self._values[k], strict=True) if name not in idle]
            # a table may have most of its rows more than once but for what is idle
            codes[k] = np.array(
                [known.setdefault(row, len(known)) for row in zip(*columns, strict=True)], dtype=np.int64
            )
        return codes

    def _distinct(
        self, kind: str, points: Sequence[NDArray[np.int64]]
    ) -> tuple[list[int], list[int], NDArray[np.int64]]:
        """Return distinct codes of a batch, the first case of each, and for each case the index of its code."""
        code = np.zeros(len(points[0]), dtype=np.int64)
        for k, codes_of_points in self._codes[kind].items():
            code = code * self.plan.factors[k].count + codes_of_points[points[k]]
        codes, firsts, inverse = np.unique(code, return_index=True, return_inverse=True)
        return codes.tolist(), firsts.tolist(), inverse.astype(np.int64)

    def _sensor(self, axes: Mapping[str, NDArray[Any]], k: int) -> Design | str:
        fields = {name: _value(axes[name][k]) for name in axes if name in DESIGN and name != "E"}
        try:
            return varied(self.plan.design, fields)
        except BadInput as error:
            return str(error)

    def _problem(self, axes: Mapping[str, NDArray[Any]], k: int) -> Problem:
        plan = self.plan
        magnet = cast("Magnet", str(axes["magnet"][k])) if "magnet" in axes else plan.magnet
        values = dict(plan.load) | {name: _value(axes[name][k]) for name in axes if name in LOAD}
        # cases with other Hall elements share the problem, so theirs must neither spoil nor change it
        fields = {name: _value(axes[name][k]) for name in axes if name in DESIGN and name not in plan.reading_fields}
        if "l0" in axes:
            fields["l0"] = DESIGN["l0"].high
        try:
            own_E = any(map(values.get, FORCES)) or plan.depends_on_time
            if not own_E:
                fields |= {name: getattr(plan.design, name) for name in OF_MODULUS}
            design = varied(plan.design, fields).for_mechanics(magnet)
            magnet = magnet if design.shape.has_magnet else "ignored"
            load = load_of(values)
            check_load(design, load, magnet)
        except BadInput as error:
            return Problem(None, None, magnet, str(error), STILL)
        return Problem(design, load, magnet, "", motion_of(values))


def varied(base: Design, fields: Mapping[str, Value]) -> Design:
    """Return the base design with other fields; its Hall elements keep their places unless l0 is among the fields.

    >>> from geometry.design import paper
    >>> varied(paper(), {"L": 11.0}).l0
    9.2
    """
    changed: dict[str, Any] = dict(fields)
    if "l0" in changed or not {"D", "L"} & changed.keys():
        return dataclasses.replace(base, **changed)
    # check the fields themselves first: their errors are clearer than those of the l0 that follows from them
    design = dataclasses.replace(base, **changed, l0=DESIGN["l0"].high)
    l0 = base.l0 + design.H - base.H
    if not l0 > design.magnet_height / 2:
        raise BadInput("S1 keeps its place in the base and would touch the magnet: take a larger L or a smaller D")
    return dataclasses.replace(design, l0=l0)


def _array(values: Sequence[Value] | NDArray[Any]) -> NDArray[Any]:
    if isinstance(values, np.ndarray):
        return values
    named = any(isinstance(value, str) for value in values)
    return np.array(values, dtype=object if named else float)


def _keys(values: NDArray[Any]) -> list[Any]:
    """Return values as keys: NaN, which stands for no grip, is None, because it differs from itself."""
    if values.dtype.kind != "f":
        return list(values.tolist())
    return [None if value != value else value for value in values.tolist()]


def _value(value: Any) -> Value:
    return value if isinstance(value, str) else float(value)


def completed(plan: Plan, without: Sequence[str] = ()) -> Plan:
    """Return a study with the usual quantities, but `without` some, if it names none; refuse what no model gives."""
    usual = ("always", "sideways") if plan.loads_sideways else ("always",)
    asked = plan.quantities or tuple(
        name for name, each in QUANTITIES.items() if each.usual in usual and name not in without
    )
    for each in (QUANTITIES[name] for name in asked):
        if (each.solved or each.path) and not plan.solves:
            raise BadInput(f"quantity {each.name} needs finite elements: add a model such as standard")
        if each.of_states and not each.derive and not any(model.states_errors for model in plan.models):
            raise BadInput(
                f"quantity {each.name} needs finite elements or the surrogate: add a model such as standard"
            )
    if "decoded_force_error" in asked and not plan.levels:
        raise BadInput("quantity decoded_force_error needs a level of the formulas: add a model such as finite")
    check_motion({*plan.axes, *plan.load}, asked)
    return dataclasses.replace(plan, quantities=asked)
