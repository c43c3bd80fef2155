"""A table of cases in, a table of answers out: `answer`, the one way to ask finite elements, formulas and surrogate.

    from studies import cases

    table = pandas.DataFrame({"L_mm": [8, 10, 12], "depth_mm": 1.0})
    cases.answer(table, ["fem", "paper"]).plot("L_mm", ["fem_force_N", "analytic_force_N"])

A row is a sensor and a load; columns are fields of `geometry.design.Design` and of the load with their units in the
name, the rest is the base design's. Rows that differ only in what the mechanics do not depend on (f, the elements,
the remanence, E without an imperfection) share a solve, and solved states are kept for all tables of a user
(`studies.exploration.store`).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from geometry.bad_input import nearest
from geometry.design import BadInput, Design, paper
from geometry.messages import Progress
from studies.exploration import store as stores
from studies.exploration import sweep
from studies.exploration.needed_paths import Processes
from studies.exploration.plate_motion import check_motion
from studies.exploration.study_cases import DEFAULT_QUANTITIES, Plan, check_quantities, model_name, models_of
from studies.inputs import study_axes, study_input
from studies.inputs.study_axes import AXES, Factor

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["answer"]


def answer(
    cases: pd.DataFrame,
    models: Sequence[str] = ("fem", "paper"),
    *,
    base: Design | None = None,
    quantities: Sequence[str] = (),
    reference: str = "",
    store: Path | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    retry_failed: bool = False,
    progress: Progress | None = None,
) -> pd.DataFrame:
    """Return the answers of models to a table of cases, a row for each row.

    Parameters
    ----------
    cases : a row for each case. Columns are fields of the design (`D_mm`, `L_mm`, `f_mm`, `E_MPa`, `nu`, ...), of the
        load (`depth_mm`, `shear_mm`, `shear_y_mm`, `plate_tilt_deg`, `grip_mm`, `friction`, `imperfection_N`,
        `frequency_Hz`, `speed_mm_per_s`; NaN as `grip_mm` means no grip) and `magnet` (rigid or ignored), with the
        names that `magtip sweep` writes; `depth_mm` or `grip_mm` must be there. Any number of rows: a
        million rows of formulas, or of stored states, take a minute if they share a few thousand problems, and some
        seven minutes if the mechanics of all differ.
    models : names of models: `fem` (accuracy standard), `fem:quick`, `fem:fine`, `fem:half-quick` and so on;
        `tolerance:2%` (for each case the cheapest model that is known to meet it); `surrogate`; levels of the
        formulas: paper, column, tip, magnet, finite.
    base : what the columns do not say; default: the paper's sensor. Its Hall elements keep their places in the base
        where L or D vary, unless `l0_mm` is a column.
    quantities : any of force, shift, tilt, contact_radius, strain, readings, decoded_force_error, critical_depth,
        modes, response, cycle; default: force, shift, contact_radius, readings (with a magnet), and tilt with loads
        to the side.
    reference : name of the model that errors are relative to; default: the finest finite elements.
    store : file that keeps all solved states; default: the user's.
    workers : number of processes that solve; default: one for each core, none if all solves take only seconds.
    scheduler : address of a Dask scheduler whose workers solve.
    retry_failed : solve again the cases whose process died.
    progress : called with the share that is done and a text.

    Returns
    -------
    A table with the index of `cases`: its fields, then for each model force (N), shift (mm), tilt (rad), contact
    radius (mm), readings (mT and V) and so on under the column names of `magtip sweep`, such as `fem_force_N`,
    `analytic_paper_shift_z_mm`, `surrogate_force_N`; errors against the reference in %; estimated relative errors
    (half widths of 90 % intervals for the surrogate); `status` (ok, unstable, not_converged, bad_input, ...) and
    `message`. What a model cannot answer is NaN, and an impossible case has the status bad_input with its reason.

    Raises
    ------
    BadInput
        A column, a model or a quantity is unknown, or none of the columns presses the sensor.
    """
    import pandas as pd

    base = base or paper()
    names = [_axis(str(column)) for column in cases.columns]
    if twice := [name for name in dict.fromkeys(names) if names.count(name) > 1]:
        raise BadInput(f"the column {study_axes.column(twice[0])} stands twice in the cases: leave one of them out")
    if not names or not {"depth", "grip"} & set(names):
        raise BadInput("the cases have neither depth_mm nor grip_mm: add the depth of the press in mm as a column")
    if not models:
        raise BadInput("no model is given: name some, such as fem and paper")
    fem, formulas = models_of(models)
    asked = study_input.checked_quantities(tuple(quantities))
    factor = Factor(tuple(names), tuple(_values(cases[column]) for column in cases.columns), sampled=True)
    magnet = "rigid" if base.shape.has_magnet else "ignored"
    plan = Plan(
        base, (factor,), {}, cast("Any", magnet), fem, formulas, asked, model_name(reference) if reference else ""
    )
    if not asked:
        readings = base.shape.has_magnet or {"magnet_diameter", "magnet_height"} & set(names)
        usual = [name for name in DEFAULT_QUANTITIES if name != "readings" or readings]
        asked = study_input.checked_quantities((*usual, *(["tilt"] if plan.loads_sideways else [])))
        plan = dataclasses.replace(plan, quantities=asked)
    check_quantities(asked, fem, formulas)
    check_motion(names, asked)
    if reference and plan.truth not in (*(model.name for model in fem), *formulas):
        raise BadInput(f"the reference {reference!r} is not among the models: add it to them")
    processes = Processes(workers, scheduler, retry_failed)
    with stores.opened(store or stores.default()) as states:
        parts = [pd.DataFrame(part) for part in sweep.run(plan, None, states, processes=processes, progress=progress)]
    if not parts:
        return cases.iloc[:0].assign(status="", message="")
    return pd.concat(parts, ignore_index=True).set_axis(cases.index)


def _axis(column: str) -> str:
    """Return the field of a column."""
    known = {study_axes.column(name): name for name in AXES}
    if column in known:
        return known[column]
    remedy = f"did you mean {study_axes.column(column)}?" if column in AXES else nearest(column, known)
    raise BadInput(f"there is no field {column!r} of a design or a load: {remedy}")


def _values(column: pd.Series) -> np.ndarray[Any, Any]:
    """Return the cells of a column: floats, or texts and floats where some are names; NaN where there is neither."""
    if column.dtype.kind == "b":
        raise BadInput(f"the column {column.name} holds truth values: give numbers")
    if column.dtype.kind in "iuf":
        return np.asarray(column.to_numpy(dtype=float, na_value=math.nan))
    cells = [cell if isinstance(cell, str) else _number(cell) for cell in column]
    return np.array(cells, dtype=object if any(isinstance(cell, str) for cell in cells) else float)


def _number(cell: Any) -> float:
    return (
        float(cell)
        if isinstance(cell, (int, float, np.integer, np.floating)) and not isinstance(cell, bool)
        else math.nan
    )
