"""Answers of models to cases, by model and quantity as arrays, and their views: a wide table and a tidy one.

`Answers.wide` is the table that `studies.cases.answer` and `magtip sweep` give, a row for each case; `Answers.tidy`
has a row for each case, model, quantity and part. What is derived (`Quantity.derive`) is computed when it is read,
and so are errors and half widths.

`SweepColumns` says how the columns of the wide table are named. Columns of a model begin with `fem_` or `analytic_`;
if a study has several models of a kind, with their names too: `fem_quick_`, `analytic_finite_`. Those of other kinds
(`studies.models`) begin with the model's name: `surrogate_`, `chosen_`. Errors against the reference have the model's
beginning if the study has more than one model besides the reference. Quantities that are paths of their own, such as
critical depths, stand without a model's name.
"""

from __future__ import annotations

import itertools
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from geometry.design import BadInput
from studies.inputs import study_input
from studies.inputs.user_input import Value
from studies.mechanics.model import Model
from studies.mechanics.study_cases import Columns, Plan
from studies.models import kind_of, kinds
from studies.quantities import QUANTITIES, Part, Quantity, estimate_column, reading_parts

if TYPE_CHECKING:
    import pandas as pd

NAN = math.nan
STATED = ("force", "shift", "tilt", "sideways")
"""Estimated errors that a table states of each model that has some: the last two where loads act sideways."""
READING = re.compile(r"(S\d|chip\d*_(?:-z|x|y))_mT")
"""Columns of fields at the elements, without the model's name."""
RESISTS = {
    "gave_way": "the beam gave way: its force does not oppose the shear, and no error along the shear is stated",
    "unknown": "the error of the force along the shear is unknown, and so is whether the beam gave way",
}
"""Messages of `error_status`."""


def prefixes(plan: Plan) -> dict[str, str]:
    """Return the first part of the columns of each model by the model's name."""
    count = Counter(model.head for model in plan.models)
    return {model.name: _prefix(model.head, model.name, alone=count[model.head] == 1) for model in plan.models}


def _prefix(head: str, name: str, *, alone: bool = False) -> str:
    return f"{head}_" if head and alone else "".join(f"{each}_" for each in (head, name.replace("-", "_")) if each)


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
    def of_frame(cls, table: pd.DataFrame) -> SweepColumns:
        """Return the columns of a table that `answer` gave, by its attributes; by its names if it has lost them."""
        record = table.attrs.get("columns")
        if not isinstance(record, Mapping):
            return cls.of_table(table.columns)
        return cls.of_record({**record, "axes": [name for name in record["axes"] if name in table]}, table.columns)

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
        known = {kind.head: _prefix(kind.head, "", alone=True) for kind in kinds() if kind.head}
        known |= {name: _prefix(kind.head, name) for kind in kinds() for name in kind.names}
        found = {}
        for column in names:
            # the longest beginning: fem_half_quick_ also begins with fem_
            fitting = [name for name, prefix in known.items() if column.startswith(prefix)]
            found.update({name: known[name] for name in sorted(fitting, key=lambda name: -len(known[name]))[:1]})
        # those that solve stand coarsest first
        solved = [name for name, prefix in found.items() if kind_of(name, prefix).solves]
        return cls(axes, found, solved[-1] if solved else "")

    def kind(self, model: str) -> type[Model]:
        """Return the kind of a model; of "" that of the reference."""
        name = model or self.reference
        return kind_of(name, self.models.get(name, ""))

    def title(self, model: str) -> str:
        """Return the name of a model in a legend; of "" that of the reference.

        >>> columns = SweepColumns((), {}, "quick")
        >>> [columns.title(name) for name in ("", "finite", "paper", "surrogate")]
        ['finite elements, quick', 'formula, level finite', "the paper's formula", 'surrogate']
        """
        return self.kind(model).title(model or self.reference)

    def answers(self, quantity: str, present: Iterable[object]) -> dict[str, str]:
        """Return those columns of a quantity that are present, by the model; "" has one without a model's name."""
        names = set(map(str, present))
        own = {name: f"{prefix}{quantity}" for name, prefix in self.models.items()}
        return {name: column for name, column in ({"": quantity} | own).items() if column in names}

    def column(self, model: str, quantity: Quantity, part: str) -> str:
        """Return the column of a part of a quantity, of which `part` is the column without the model's name."""
        if quantity.path:
            return part
        if quantity.name != "decoded_force_error":
            return f"{self.models[model]}{part}"
        several = sum(self.kind(each).decodes for each in self.models) > 1
        return part.replace("decoded_", f"decoded_{model}_", 1) if several else part

    def estimate(self, model: str, name: str) -> str:
        """Return the column of an estimated error of a response, such as error_estimate or shift_error_estimate: of a
        single model that has some it stands without the model's name.
        """
        several = sum(self.kind(each).states_errors for each in self.models) > 1
        return f"{self.models[model] if several else ''}{estimate_column(name)}"

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


@dataclass(slots=True)
class Answers:
    """Answers of models to n cases.

    Attributes
    ----------
    columns : names of the models, and what the table's columns are.
    quantities : names of those that were asked for; `value` may have more, from which these are derived.
    cases : fields of each case by their columns, shape (n,).
    sideways : whether any case is loaded sideways; else a table has the first part of a response only.
    value : by model and quantity, shape (n, parts), in the units of the parts; NaN where the model has no answer.
    half_width : by model and quantity of values that state one, shape (n, parts), in the units of the parts.
    estimate : estimated relative errors by model and the name of the estimate (`fem.solution.Estimates`), shape (n,).
    status : of each model's states, shape (n,); "" has that of the row.
    message : of the row, shape (n,).
    direction : unit vector of the shear, shape (n, 2); NaN where nothing shears the tip.
    parts : those of a quantity that are there, where these are not all that it has.
    change : by model and quantity change from rest, shape (n, parts), whose errors are stated.
    words : columns of texts that belong to a quantity.
    late : columns of fields that follow from others, behind the answers.
    fixed : values of fields that all cases share, by their columns, from which answers may be derived.
    solves : columns that say how a row was solved.
    """

    columns: SweepColumns
    quantities: tuple[str, ...]
    cases: Columns
    sideways: bool
    value: dict[tuple[str, str], Array] = field(default_factory=dict)
    half_width: dict[tuple[str, str], Array] = field(default_factory=dict)
    estimate: dict[tuple[str, str], Array] = field(default_factory=dict)
    status: dict[str, NDArray[Any]] = field(default_factory=dict)
    message: NDArray[Any] = field(default_factory=lambda: np.zeros(0, dtype=object))
    direction: Array | None = None
    parts: dict[str, tuple[Part, ...]] = field(default_factory=dict)
    change: dict[tuple[str, str], Array] = field(default_factory=dict)
    words: dict[str, Columns] = field(default_factory=dict)
    late: Columns = field(default_factory=dict)
    fixed: Mapping[str, Value] = field(default_factory=dict)
    solves: Columns = field(default_factory=dict)
    _errors: dict[str, dict[tuple[str, str], Array]] = field(default_factory=dict)

    @classmethod
    def of_table(cls, table: pd.DataFrame) -> Answers:
        """Return the answers that a table of `answer` states, or some of its rows and columns."""
        names, status = SweepColumns.of_frame(table), table["status"].to_numpy()
        fields = {study_input.column(name) for name in study_input.AXES}
        found = cls(names, (), {name: table[name].to_numpy() for name in table if name in fields}, sideways=True)
        found.message = table["message"].to_numpy() if "message" in table else np.full(len(table), "", object)
        found.status = {"": status}
        for model in names.models:
            found.status[model] = table[own].to_numpy() if (own := names.status(model)) in table else status
        solved = [name for name in names.models if names.kind(name).solves]
        for quantity in QUANTITIES.values():
            models = solved[-1:] if quantity.path else list(names.models)
            parts = found._reading_parts(table) if quantity.name == "readings" else quantity.parts
            heads = {model: [names.column(model, quantity, part.column) for part in parts] for model in models}
            there = tuple(part for k, part in enumerate(parts) if any(each[k] in table for each in heads.values()))
            if there:
                found.quantities += (quantity.name,)
                found.parts[quantity.name] = there
                for model in models:
                    found._read(table, model, quantity)
        return found

    def _read(self, table: pd.DataFrame, model: str, quantity: Quantity) -> None:
        """Take the values of a model from a table, with their errors."""
        names, key, parts = self.columns, (model, quantity.name), self.parts[quantity.name]
        columns = [names.column(model, quantity, part.column) for part in parts]
        if quantity.derive or set(columns) & set(table):
            self.value[key] = _numbers(table, columns)
        errors = [f"{names.error_prefix(model)}{part.error_column}" for part in parts]
        # the errors of decoded forces are values
        if names.reference not in ("", model) and quantity.name != "decoded_force_error" and set(errors) & set(table):
            self._errors.setdefault(names.reference, {})[key] = _numbers(table, errors)
        if f"{columns[0]}_half_width" in table:
            self.half_width[key] = _numbers(table, [f"{column}_half_width" for column in columns])
        for part in parts:
            column = names.column(model, quantity, part.estimate_column)
            # of a single model of finite elements those of a response have no name in front
            column = column if column in table else part.estimate_column
            if part.estimate and column in table and names.kind(model).states_errors:
                self.estimate[model, part.estimate] = table[column].to_numpy(dtype=float)

    def _reading_parts(self, table: pd.DataFrame) -> tuple[Part, ...]:
        columns = [str(name).removeprefix(prefix) for prefix in self.columns.models.values() for name in table]
        elements = dict.fromkeys(found[1] for name in columns if (found := READING.fullmatch(name)))
        return tuple(part for name in elements for part in reading_parts([name], "V" if name[0] == "S" else "T"))

    def __len__(self) -> int:
        return len(self.status[""])

    def __getitem__(self, key: tuple[str, str]) -> Array:
        """Return the values of a model and a quantity, shape (n, parts)."""
        quantity = QUANTITIES[key[1]]
        if key not in self.value and quantity.derive:
            of = {name: np.full(len(self), value) for name, value in self.fixed.items()} | self.late | self.cases
            for (model, name), values in self.value.items():
                if model == key[0]:
                    of |= {part.column: column for part, column in zip(self.parts_of(name), values.T, strict=True)}
            self.value[key] = quantity.derived(of)[:, None]
        return self.value[key]

    def parts_of(self, name: str) -> tuple[Part, ...]:
        """Return the parts of a quantity that `value` has."""
        return self.parts.get(name, QUANTITIES[name].parts)

    def models_of(self, name: str) -> list[str]:
        """Return the models that answer a quantity."""
        derived = QUANTITIES[name].derive is not None
        return [model for model in self.columns.models if derived or (model, name) in self.value]

    def half_widths(self, model: str, name: str) -> Array:
        """Return the half widths of the errors of a model's values, shape (n, parts), NaN where none is estimated.

        An estimate is a relative error of the vector whose component a part is: that of the press force or of the
        magnet's motion is of its magnitude, that of a force along the shear of the force along the plate. Models of
        formulas, and readings, have none.
        """
        if (model, name) in self.half_width:
            return self.half_width[model, name]
        values, parts = self[model, name], self.parts_of(name)
        found = np.full(values.shape, NAN)
        for k, part in enumerate(parts):
            estimate = self.estimate.get((model, part.estimate)) if part.estimate else None
            if estimate is not None:
                # of the press force the estimate is that of the whole vector
                of = [each.estimate == part.estimate if k else bool(each.estimate) for each in parts]
                found[:, k] = estimate * np.linalg.norm(values[:, of], axis=1)
        return found

    def half_width_of(self, model: str, column: str) -> Array:
        """Return the half widths of a column without the model's name, shape (n,); "" is the model of a path."""
        for name in self.quantities:
            columns, models = [part.column for part in self.parts_of(name)], self.models_of(name)
            if column in columns and (model in models or (not model and QUANTITIES[name].path)):
                return np.asarray(self.half_widths(model or models[-1], name)[:, columns.index(column)])
        return np.full(len(self), NAN)

    def errors(self, reference: str = "") -> dict[tuple[str, str], Array]:
        """Return the errors against a reference, default: the table's, by model and quantity, shape (n, parts), %.

        Those of readings are errors of their change from rest. NaN where the reference is 0 or unknown, and along the
        shear where the beam gave way.
        """
        reference = reference or self.columns.reference
        if reference and reference not in self._errors:
            gave_way, found = self.resists(reference) == "gave_way", {}
            for name in self.quantities:
                models = self.models_of(name)
                along = np.array([part.along_shear for part in self.parts_of(name)], dtype=bool)
                for model in models if reference in models else ():
                    if model != reference:
                        both = [self.change.get(key, self[key]) for key in ((model, name), (reference, name))]
                        stated = percents(*both)
                        found[model, name] = np.where(gave_way[:, None] & along, NAN, stated)
            self._errors[reference] = found
        return self._errors.get(reference, {})

    def resists(self, reference: str) -> NDArray[Any]:
        """Return `gave_way` where a model's force along a shear is not known to oppose it, `unknown` where its error
        is, else `ok`, shape (n,).
        """
        direction, along = self.direction, np.full(len(self), NAN)
        if direction is not None:
            force = self[reference, "force"]
            along = direction[:, 0] * force[:, 1] + direction[:, 1] * force[:, 2]
        # a formula says exactly what it says
        error = self.estimate.get((reference, "sideways"), np.zeros(len(self)))
        known = [np.isnan(along), ~(along > 0), np.isnan(error), error < 1]
        return np.select(known, ["ok", "gave_way", "unknown", "ok"], "gave_way").astype(object)

    def wide(self) -> Columns:
        """Return the table: a column of each field, answer, error and status, shape (n,)."""
        names = self.columns
        table = self.cases | dict(self._columns()) | self.late
        table |= {names.estimate(*key): values for key, values in self.estimate.items() if key[1] in STATED}
        table |= self.solves
        if len(names.models) > 1:
            table |= {names.status(model): self.status[model] for model in names.models}
        message = self.message
        if names.reference and self.sideways and len(names.models) > 1:
            answered = np.isfinite(self[names.reference, "force"][:, 0])
            resists = np.where(answered, self.resists(names.reference), "")
            table["error_status"], message = resists, np.array(message)
            for row in np.flatnonzero(answered & (resists != "ok")).tolist():
                message[row] = "; ".join(filter(None, (message[row], RESISTS[resists[row]])))
        return table | {"status": self.status[""], "message": message}

    def _columns(self) -> Iterator[tuple[str, Array]]:
        """Yield the columns of answers and of their errors."""
        names, asked = self.columns, [QUANTITIES[name] for name in self.quantities]
        judged = [model for model in names.models if names.reference and model != names.reference]
        shown = slice(None if self.sideways else 1)
        compared = [(each, k) for each in asked if each.compared for k in range(len(each.parts[shown]))]
        for model in names.models:
            yield from (self._value(model, each, k) for each, k in compared)
        yield from (self._error(model, each, k) for model in judged for each, k in compared)
        for each in asked:
            if each.of_states and not each.compared:
                yield from self._stated(each)
        readings = QUANTITIES["readings"]
        for k in range(0, len(self.parts.get("readings", ())), 2):
            for at in (k, k + 1):
                yield from (self._value(model, readings, at) for model in names.models)
            yield from (self._error(model, readings, k) for model in judged)
        for model, name in self.value:
            # the forces that a level decodes stand together
            if name == "decoded_force_error":
                yield from (self._value(model, QUANTITIES[name], k) for k in range(len(self.parts_of(name))))
        for _, name in self.value:
            if QUANTITIES[name].path:
                yield from self._stated(QUANTITIES[name])
                yield from self.words.get(name, {}).items()

    def _value(self, model: str, quantity: Quantity, k: int) -> tuple[str, Array]:
        part = self.parts_of(quantity.name)[k]
        return self.columns.column(model, quantity, part.column), self[model, quantity.name][:, k]

    def _error(self, model: str, quantity: Quantity, k: int) -> tuple[str, Array]:
        column = self.columns.error_prefix(model) + self.parts_of(quantity.name)[k].error_column
        return column, self.errors()[model, quantity.name][:, k]

    def _stated(self, quantity: Quantity) -> Iterator[tuple[str, Array]]:
        """Yield the columns of a quantity that is stored, with those of its errors."""
        models = self.models_of(quantity.name)
        for k, part in enumerate(self.parts_of(quantity.name)):
            yield from (self._value(model, quantity, k) for model in models)
            if part.estimate:
                for model in models:
                    column = self.columns.column(model, quantity, part.estimate_column)
                    yield column, self.estimate[model, part.estimate]
            if part.half_width:
                for model in models:
                    column = self.columns.column(model, quantity, f"{part.column}_half_width")
                    yield column, self.half_width[model, quantity.name][:, k]

    def tidy(self) -> pd.DataFrame:
        """Return a row for each model, quantity, part and case, see `tidy`; the index numbers the cases from 0."""
        import pandas as pd

        errors, n = self.errors(), len(self)
        blocks = [(model, name) for name in self.quantities for model in self.models_of(name)]
        rows = [(model, name, part) for model, name in blocks for part in self.parts_of(name)]

        def stacked(arrays: Iterable[Array]) -> Array:
            # transposed: the cases of a part stand together
            return np.concatenate([np.zeros(0), *(each.T.ravel() for each in arrays)])

        def repeated(labels: Iterable[str]) -> pd.Categorical:
            codes, names = pd.factorize(np.array(list(labels), dtype=object))
            return pd.Categorical.from_codes(np.repeat(codes, n), names)

        statuses = [np.zeros(0, dtype=object), *(self.status[model] for model, _, _ in rows)]
        table = {
            "model": repeated(model for model, _, _ in rows),
            "quantity": repeated(name for _, name, _ in rows),
            "part": repeated(part.name for _, _, part in rows),
            "value": stacked(self[key] for key in blocks),
            "half_width": stacked(self.half_widths(*key) for key in blocks),
            "unit": repeated(part.unit for _, _, part in rows),
            "error_percent": stacked(errors.get(key, np.full(self[key].shape, NAN)) for key in blocks),
            "status": pd.Categorical(np.concatenate(statuses)),
        }
        return pd.DataFrame(table, index=np.tile(np.arange(n), len(rows)))


def tidy(answers: pd.DataFrame) -> pd.DataFrame:
    """Return answers in long form, a row for each case, model, quantity and part, with half widths and errors.

    Parameters
    ----------
    answers : table that `answer` returned, or some of its rows and columns, `status` among them.

    Returns
    -------
    A table whose index has the labels of the cases, so that `.join(answers[["L_mm"]])` adds a field. Columns are

    - `model`, `quantity`, `part`, such as quick, force, force_x; names of models are those in
      `answers.attrs["columns"]`;
    - `value`, its `half_width` and their `unit`: the half width is the estimated error of finite elements or half the
      90 % interval of the surrogate, NaN where none is known (formulas, readings);
    - `error_percent`, relative to the reference of the table, of readings to the change of the reference's from rest;
      NaN for the reference itself, and where no error is stated;
    - `status` of the model: ok, unstable, not_converged, bad_input and so on.

    Names and units are categories. Models, quantities and parts come one after the other, all cases of each together.

    Raises
    ------
    BadInput
        The table is not one of `answer`.

    Examples
    --------
    >>> import pandas as pd
    >>> from studies.cases import answer
    >>> presses = pd.DataFrame({"L_mm": [8.0, 10.0], "depth_mm": 1.0})
    >>> found = tidy(answer(presses, ["surrogate", "finite"], reference="finite", quantities=["force"]))
    >>> found[["model", "part", "value", "unit", "status"]].round(1)
           model   part  value unit status
    0  surrogate  force    4.9    N     ok
    1  surrogate  force    3.7    N     ok
    0     finite  force    4.8    N     ok
    1     finite  force    3.6    N     ok
    """
    check_table(answers)
    found = Answers.of_table(answers).tidy()
    return found.set_index(answers.index[found.index])


def check_table(answers: object) -> None:
    """Refuse what is no table that `answer` returned."""
    import pandas as pd

    if not isinstance(answers, pd.DataFrame):
        raise BadInput(f"answers must be the table that answer returns; got {type(answers).__name__}")
    if "status" not in answers:
        raise BadInput("the answers have no column status: hand on the table that answer returned")


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


def flat_rows(table: Mapping[str, NDArray[Any]]) -> Iterator[dict[str, Any]]:
    """Yield the rows of a table as records with Python's own numbers and texts."""
    names = list(table)
    for values in zip(*(table[name].tolist() for name in names), strict=True):
        yield dict(zip(names, values, strict=True))


def _numbers(table: pd.DataFrame, columns: Iterable[str]) -> Array:
    """Return columns as floats, shape (n, columns); NaN for those that a table lacks."""
    return np.asarray(table.reindex(columns=list(columns)).to_numpy(dtype=float))
