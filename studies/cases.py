"""A table of cases in, a table of answers out: `answer`, the one way to ask finite elements, formulas and surrogate.

    import magtip

    table = pandas.DataFrame({"L_mm": [8, 10, 12], "depth_mm": 1.0})
    answers = magtip.answer(table, ["fem", "paper"])
    magtip.plot(answers, x="L_mm", y="force_N").save("force.svg")

A row is a sensor and a load; columns are fields of `geometry.design.Design` and of the load with their units in the
name, the rest is the base design's. Rows that differ only in what the mechanics do not depend on (f, the elements,
the remanence, E without an imperfection) share a solve, and solved states are kept for all tables of a user
(`studies.mechanics.store`).
"""

from __future__ import annotations

import dataclasses
import decimal
import math
import numbers
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fem.accuracy import Accuracy
from fem.physics_version import ESTIMATES, PHYSICS
from fem.scene import Model as Section
from geometry.bad_input import closest
from geometry.design import BadInput, Design, paper
from geometry.loads import Load, Magnet
from geometry.messages import Progress
from studies.answers import SweepColumns, status_columns
from studies.inputs import study_input, user_input
from studies.inputs.study_input import AXES, Factor
from studies.mechanics import store as stores
from studies.mechanics.model import Model
from studies.mechanics.solve_plan import Processes
from studies.mechanics.study_cases import Columns, Plan, completed
from studies.models import models_of, named
from studies.models.finite_elements import FemModel
from studies.output import console, provenance
from studies.sweeps import sweep

if TYPE_CHECKING:
    import pandas as pd

    from studies.mechanics.tasks import Executor

__all__ = ["FemModel", "FiniteElements", "answer", "table"]
Values = np.ndarray[Any, Any]


class FiniteElements(NamedTuple):
    """Finite elements of an accuracy, and how `answer` solves and stores: its other arguments."""

    accuracy: Accuracy
    options: Mapping[str, Any]

    def answers(
        self, cases: Sequence[tuple[Design, Load]], quantities: Sequence[str], model: Section = "auto"
    ) -> pd.DataFrame:
        """Return the answers to designs and loads, at least one, with a rigid magnet."""
        asked, fem = table((design, load, "rigid") for design, load in cases), FemModel("fem", self.accuracy, model)
        return answer(asked, [fem], base=cases[0][0], quantities=quantities, **self.options)


def table(cases: Iterable[tuple[Design, Load, Magnet]]) -> pd.DataFrame:
    """Return a table for `answer` from designs, loads, and models of the magnet.

    Its columns are the fields of the load, `magnet`, and the fields in which some design differs from the paper's.
    """
    import pandas as pd

    given = list(cases)
    base = paper()
    rows = [
        {name: getattr(design, name) for name in study_input.DESIGN}
        | study_input.values_of(load)
        | {"grip": math.nan if load.grip is None else load.grip, "magnet": magnet}
        for design, load, magnet in given
    ]
    usual = {name: getattr(base, name) for name in study_input.DESIGN}
    usual |= {name: 0.0 for name in study_input.NUMBERS if name != "depth"}
    frame = pd.DataFrame(rows)
    kept = [name for name in frame if name not in usual or (frame[name] != usual[name]).any()]
    if "l0" not in kept and {"D", "L"} & set(kept):
        # without its column the elements would stay in the base of the paper's sensor
        kept.append("l0")
    return frame[kept].rename(columns={name: study_input.column(name) for name in kept})


def answer(
    cases: pd.DataFrame,
    models: Sequence[str | Model] = ("fem", "paper"),
    *,
    base: Design | None = None,
    quantities: Sequence[str] = (),
    reference: str = "",
    store: stores.Store | Path | str | None = None,
    workers: int | Executor | None = None,
    scheduler: str | None = None,
    retry_failed: bool = False,
    progress: Progress | bool | None = None,
) -> pd.DataFrame:
    """Return the answers of models to a table of cases, a row for each row.

    Parameters
    ----------
    cases : a row for each case, any number of them. Columns are fields of the design (`D_mm`, `L_mm`, `f_mm`,
        `E_MPa`, `nu`, ...), of the load (`depth_mm`, `shear_mm`, `shear_y_mm`, `plate_tilt_deg`, `grip_mm`,
        `friction`, `imperfection_N`, `frequency_Hz`, `speed_mm_per_s`; NaN as `grip_mm` means no grip) and `magnet`
        (rigid, or ignored: silicone, for all models), with the names that `magtip sweep` writes; lengths also over D
        (`L_over_D`, `depth_over_D`). A depth or a grip must be there unless only critical depths, or modes of the
        unloaded sensor, are asked for. A million rows take seconds if they share a few thousand stored problems, some
        seven minutes if the mechanics of all differ. A cell that is no number, or out of its field's bounds, makes
        its row a bad_input. Columns of your own, such as measured forces, are handed on; one whose name is nearly
        that of a field is refused as a mistake.
    models : names of models: `fem` (accuracy standard), `fem:quick`, `fem:fine`, `fem:half-quick` and so on;
        `tolerance:2%` (for each case the cheapest model that is known to meet it); `surrogate`; levels of the
        formulas: paper, column, tip, magnet, finite; or a `FemModel` with an accuracy and a name of its own.
    base : what the columns do not say; default: the paper's sensor. Its Hall elements keep their places in the base
        where L or D vary, unless `l0_mm` is a column.
    quantities : names of `studies.quantities.QUANTITIES`, such as force, strain, readings, critical_depth. Critical
        depth, modes, response and cycle are of the finest finite elements, and their columns have no model's name in
        front; critical depths are those of frictionless presses, whatever the loads: `critical_depth_mm`,
        `critical_depth_verdict` (buckles; stable down to `stable_to_mm`, where the search ends; or unknown) etc.
        Default: force, shift, contact_radius, readings (with a magnet), tilt (loads sideways).
    reference : name of the model that errors are relative to; default: the finest finite elements.
    store : file that keeps all solved states, a path, or an open store; default: the user's.
    workers, scheduler : number of processes that solve (default: as many as pay), an executor that several calls
        share (of `with studies.mechanics.solve_plan.Processes().opened()`), or address of a Dask scheduler; with
        `retry_failed` cases whose process died are solved again.
    progress : True shows a bar on standard error; or a function, called with the share that is done and a text.

    Returns
    -------
    A table with the index of `cases`: its fields, then for each model force (N), shift (mm), tilt (rad), contact
    radius (mm), readings (mT and V) and so on under the column names of `magtip sweep`, such as `fem_force_N`;
    errors against the reference in %; estimated relative errors (half widths of 90 % intervals for the surrogate);
    of several models a status of each (`fem_status`, `surrogate_status`, `analytic_status`: ok, unstable,
    not_converged, bad_input, ...); `status` of the row and `message`; then columns of your own. What a model cannot
    answer is NaN. The row's status is that of the finest finite elements, and of critical depths, modes and so on
    where these are asked for; without finite elements it is ok where any model answers.

    Its `attrs` say what it rests on: `versions` (of magtip, packages, physics and error estimates), `accuracies`
    (mesh sizes over D of the finite elements, by model) and `columns` (axes, models and the reference).
    `magtip.tidy(answers)` has the same in long form: a row for each case, model, quantity and part, with half widths
    and errors.

    Raises
    ------
    BadInput
        A column, a model or a quantity is unknown, an argument is of a wrong kind, or no column presses the sensor.

    Examples
    --------
    >>> import pandas as pd
    >>> presses = pd.DataFrame({"D_mm": [8.0, 10.0], "depth_mm": 1.0, "specimen": ["a", "b"]})
    >>> answers = answer(presses, ["surrogate", "finite"], quantities=["force"])
    >>> answers[["specimen", "D_mm", "surrogate_force_N", "analytic_force_N", "status"]].round(1)
      specimen  D_mm  surrogate_force_N  analytic_force_N status
    0        a   8.0                4.2               4.1     ok
    1        b  10.0                5.0               4.9     ok
    >>> answers.attrs["versions"]["physics"] == PHYSICS
    True
    """
    _check_kinds(cases, models, base, quantities, reference, progress)
    processes = Processes(workers, scheduler, retry_failed)
    asked = study_input.checked_quantities(tuple(quantities))
    is_own = np.array([_axis(str(column)) is None for column in cases.columns], dtype=bool)
    fields, reasons = _fields(cases.loc[:, ~is_own], needs_load=study_input.needs_load(asked))
    possible = np.flatnonzero(reasons == "")
    factor = Factor(tuple(fields), tuple(values[possible] for values in fields.values()), sampled=True)
    plan = _plan(base or paper(), factor, models, asked, reference)
    none, own = sweep.without_rows(plan), cases.loc[:, is_own]
    if twice := [str(name) for name in own if name in none]:
        raise BadInput(f"the column {twice[0]} has the name of an answer: rename it, or leave it out")
    with (
        sweep.store_of(plan, store) as states,
        console.chosen_progress(progress) as report,
    ):
        parts = list(sweep.run(plan, None, states, processes=processes, progress=report)) if len(possible) else []
    answers = _joined(fields, parts or [none], plan, reasons).set_axis(cases.index)
    return _with_origin(answers, own, plan)


def _with_origin(answers: pd.DataFrame, own: pd.DataFrame, plan: Plan) -> pd.DataFrame:
    """Return the answers with columns of the user's own, and with what they rest on as attributes."""
    import pandas as pd

    answers = pd.concat([answers, own], axis=1) if len(own.columns) else answers
    answers.attrs = {
        "versions": provenance.packages() | {"physics": dict(PHYSICS), "error estimates": ESTIMATES},
        "accuracies": {
            model.name: dataclasses.asdict(accuracy)
            for model in plan.models
            if (accuracy := model.accuracy_of()) is not None
        },
        "columns": SweepColumns.of_plan(plan).record,
    }
    return answers


def _fields(cases: pd.DataFrame, *, needs_load: bool) -> tuple[dict[str, Values], Values]:
    names = [name for column in cases.columns if (name := _axis(str(column)))]
    plain = [study_input.field_of(name) for name in names]
    if twice := [name for name in plain if plain.count(name) > 1]:
        both = [str(column) for column, name in zip(cases.columns, plain, strict=True) if name == twice[0]]
        raise BadInput(f"{twice[0]} is given twice, as columns {' and '.join(both)}: leave one of them out")
    if not names or (needs_load and not {"depth", "grip"} & set(plain)):
        raise BadInput("the cases have neither depth_mm nor grip_mm: add the depth of the press in mm as a column")
    columns = [_cells(name, cases[column]) for name, column in zip(names, cases, strict=True)]
    refusals = zip(*(reasons for _, reasons in columns), strict=True)
    reasons = np.array(["; ".join(filter(None, each)) for each in refusals], dtype=object)
    return {name: values for name, (values, _) in zip(names, columns, strict=True)}, reasons


def _plan(
    base: Design, factor: Factor, models: Sequence[str | Model], asked: tuple[str, ...], reference: str
) -> Plan:
    chosen = models_of(models)
    names = [model.name for model in chosen]
    magnet: Magnet = "rigid" if base.shape.has_magnet else "ignored"
    meant = named(reference) if reference and reference not in names else None
    truth = meant.name if meant else reference
    plan = Plan(base, (factor,), {}, magnet, chosen, asked, truth)
    readings = base.shape.has_magnet or {"magnet_diameter", "magnet_height"} & set(plan.fields)
    plan = completed(plan, without=() if readings else ("readings",))
    if reference and plan.truth not in names:
        raise BadInput(f"the reference {reference!r} is not among the models: add it to them")
    return plan


def _joined(given: Mapping[str, Any], parts: Sequence[Columns], plan: Plan, reasons: Values) -> pd.DataFrame:
    """Return the answers of the possible cases, and the reasons of the others, in the order of the cases."""
    import pandas as pd

    refused = reasons != ""
    fields = pd.DataFrame({study_input.column(name): values for name, values in given.items()})
    answers = pd.concat([pd.DataFrame(part) for part in parts], ignore_index=True)
    if not refused.any():
        return answers
    answers = answers.set_axis(np.flatnonzero(~refused)).reindex(range(len(refused)))
    for column in fields:
        answers[column] = fields[column]
    answers.loc[refused, [*status_columns(plan).values(), "status"]] = "bad_input"
    answers.loc[refused, "message"] = reasons[refused]
    return answers


def _check_kinds(
    cases: object, models: object, base: object, quantities: object, reference: object, progress: object
) -> None:
    import pandas as pd

    if not isinstance(cases, pd.DataFrame):
        raise BadInput(f"the cases must be a pandas DataFrame; got {type(cases).__name__}")
    if base is not None and not isinstance(base, Design):
        raise BadInput(f"base must be a geometry.design.Design; got {base!r:.60}")
    for name, value, kinds in (("models", models, (str, Model)), ("quantities", quantities, (str,))):
        listed = isinstance(value, Sequence) and not isinstance(value, str)
        if not listed or not all(isinstance(one, kinds) for one in value):  # type: ignore[attr-defined]
            example = f", such as [{value!r:.60}]" if isinstance(value, str) else ""
            raise BadInput(f"{name} must be a list of names{example}; got {value!r:.60}")
    if not models:
        raise BadInput("no model is given: name some, such as fem and paper")
    if not isinstance(reference, str):
        raise BadInput(f"reference must be the name of a model; got {reference!r:.60}")
    if not (progress is None or isinstance(progress, bool) or callable(progress)):
        raise BadInput(f"progress must be True, or a function of a share and a text; got {progress!r:.60}")


def _axis(column: str) -> str | None:
    """Return the field of a column; None for a column of the user's own, whose name is unlike that of any field."""
    known = {study_input.column(name): name for name in AXES}
    if column in known:
        return known[column]
    if column in user_input.FIELDS and column not in AXES:
        raise BadInput(f"{column} is a text of the design, which no case can change: state it in base")
    close = study_input.column(column) if column in AXES else closest(column, known)
    if close:
        raise BadInput(
            f"there is no field {column!r} of a design or a load: did you mean {close}, or is it a column of your "
            "own, which then needs another name?"
        )
    return None


def _cells(name: str, column: pd.Series) -> tuple[Values, list[str]]:
    """Return the cells of a column, floats or texts, and for each why it is refused, "" if it is not.

    The bounds are those of the field; what depends on other fields is checked where designs and loads are made.
    """
    if column.dtype.kind in "iuf":
        values = np.asarray(column.to_numpy(dtype=float, na_value=math.nan))
        low, high = AXES[name].low, AXES[name].high
        known = AXES[name].is_number & (low <= values) & (values <= high) & np.isfinite(values)
        reasons = [""] * len(values)
        for k in np.flatnonzero(~known).tolist():
            reasons[k] = _refusal(name, float(values[k]))
        return values, reasons
    cells = [cell if isinstance(cell, str) else _number(cell) for cell in column]
    # a number beyond all floats is told as inf: it may have thousands of digits
    told = [None if cell in (math.inf, -math.inf) else given for cell, given in zip(cells, column, strict=True)]
    reasons = [_refusal(name, cell, given) for cell, given in zip(cells, told, strict=True)]
    return np.array(cells, dtype=object if any(isinstance(cell, str) for cell in cells) else float), reasons


def _refusal(name: str, cell: str | float, given: object = None) -> str:
    """Return why a cell is refused, "" if it is not; `given` is what stood there if that is no float."""
    import pandas as pd

    if name == "grip" and cell != cell and (given is None or given is pd.NA or str(given).lower() == "nan"):
        return ""
    wrong = study_input.fault(name, cell, given, open_low=True)
    return f"{study_input.column(name)} {wrong}" if wrong else ""


def _number(cell: Any) -> float:
    known = isinstance(cell, (numbers.Real, decimal.Decimal)) and not isinstance(cell, (bool, np.bool_))
    try:
        return float(cell) if known else math.nan
    except ValueError:
        # a signalling NaN
        return math.nan
    except OverflowError:
        return math.inf if cell > 0 else -math.inf
