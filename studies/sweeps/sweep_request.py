"""A sweep as options and a study file ask for it, and the columns that its tables on the screen show."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry.design import BadInput
from geometry.loads import ANSWERED, Magnet
from geometry.messages import Progress
from studies.inputs import study_axes, study_input, user_input
from studies.inputs.user_input import Value
from studies.mechanics.timed_quantities import check_motion
from studies.output import atomic_files
from studies.output.records import FlatRow
from studies.output.result import Table

if TYPE_CHECKING:
    from studies.mechanics.solve_plan import Processes
    from studies.mechanics.study_cases import Columns, FemModel, Plan

FILES = ("sweep.csv", "sweep.parquet", "sweep.png", "sweep-*.png")
"""Files that a sweep may write into its folder."""


@dataclass(frozen=True, slots=True)
class Options:
    """Options of `magtip sweep` that replace values of a study; None where they are not given."""

    axes: Sequence[str] = ()
    design: str | None = None
    depth: float | None = None
    load: Sequence[str] = ()
    magnet: Magnet | None = None
    accuracy: str | None = None
    models: str | None = None
    quantities: str | None = None
    tolerance: str | None = None
    sets: Sequence[str] = ()


def plan_of(source: str | None, options: Options) -> Plan:
    """Return the study of a file, or of a design with axes, ready to run; options replace the study's values."""
    from studies.mechanics.study_cases import DEFAULT_QUANTITIES, Plan, check_quantities

    study = _study(source, options)
    magnet = options.magnet or study.magnet or "rigid"
    design = study_input.study_design(study, options.sets, magnet=magnet)
    names = tuple(name for factor in study.factors for name in factor.names)
    _check_twice(names, options, study)
    load = _load(study, options)
    fem, formulas = _models(options, study)
    asked = (
        tuple(part.strip() for part in options.quantities.split(","))
        if options.quantities is not None
        else study.quantities
    )
    quantities = study_input.checked_quantities(asked)
    if study_input.needs_load(quantities) and not {"depth", "grip"} & {*names, *load}:
        raise BadInput("a sweep needs a depth: add --depth D in mm, or the axis depth=a,b,c")
    plan = Plan(design, study.factors, load, magnet, fem, formulas, quantities)
    if not quantities:
        sideways = ("tilt",) if plan.loads_sideways else ()
        quantities = study_input.checked_quantities((*DEFAULT_QUANTITIES, *sideways))
    check_quantities(quantities, fem, formulas)
    check_motion({*names, *load}, quantities)
    return Plan(design, study.factors, load, magnet, fem, formulas, quantities)


def _study(source: str | None, options: Options) -> study_input.Study:
    if source is not None and options.design is not None:
        raise BadInput(f"the design is given twice, {source!r} and --design {options.design!r}: give one of them")
    if source is not None and study_input.is_study(source):
        if options.axes:
            raise BadInput(f"the study {source!r} has its own axes: leave --axis out, or give a design instead")
        return study_input.read_study(source)
    if not options.axes:
        raise BadInput(
            "a sweep needs at least one axis: add --axis NAME=a,b,c, or give a study file with a table [axes]"
        )
    factors = study_input.grid(study_input.parse_axes(options.axes))
    return study_input.Study(source or options.design or "paper", {}, factors, {})


def _check_twice(names: Sequence[str], options: Options, study: study_input.Study) -> None:
    load = study.load
    for name, _, value in (text.partition("=") for text in options.sets):
        if name.strip() in names:
            raise BadInput(f"{name.strip()} is both an axis and set to {value.strip()}: leave one of them out")
    if options.depth is not None and any(text.partition("=")[0].strip() == "depth" for text in options.load):
        raise BadInput("depth is given twice, by --depth and by --load: leave one of them out")
    if "depth" in names and (options.depth is not None or "depth" in load):
        raise BadInput(
            "depth is given twice, as an axis and as a single value (--depth or the study's): leave one of them out"
        )
    for name in (text.partition("=")[0].strip() for text in options.load):
        if name in names:
            raise BadInput(f"{name} is given twice, as an axis and by --load: leave one of them out")
    for name in load:
        if name in names:
            raise BadInput(f"{name} is given twice, as an axis and in [load]: leave one of them out")
    if "magnet" in names and (options.magnet is not None or study.magnet is not None):
        where = "by --magnet" if options.magnet is not None else "alone in the study"
        raise BadInput(f"magnet is given twice, as an axis and {where}: leave one of them out")


def _load(study: study_input.Study, options: Options) -> dict[str, Value]:
    load = dict(study.load)
    for name, text in user_input.pairs("--load", options.load, "shear=1").items():
        user_input.check_keys("--load", [name], study_axes.LOAD)
        load[name] = study_axes.parse(name, text)[0]
    if options.depth is not None:
        load["depth"] = study_axes.checked("depth", [options.depth])[0]
    return load


def _models(options: Options, study: study_input.Study) -> tuple[tuple[FemModel, ...], tuple[str, ...]]:
    from studies.mechanics.study_cases import models_of

    given = tuple(part.strip() for part in options.models.split(",")) if options.models is not None else study.models
    accuracy = options.accuracy or study.accuracy
    if given and accuracy:
        raise BadInput(
            f"models and accuracy both choose finite elements ({', '.join(given)}; {accuracy}): leave one of them out"
        )
    tolerance = user_input.parse_tolerance(options.tolerance) if options.tolerance else study.tolerance
    if tolerance is not None and accuracy:
        raise BadInput(f"a tolerance chooses the accuracy, which is given too ({accuracy}): leave one of them out")
    given = given or (("paper",) if tolerance is not None else (accuracy or "standard", "paper"))
    return models_of(given, tolerance)


@contextlib.contextmanager
def sweep(
    plan: Plan, out: Path | None, progress: Progress, processes: Processes, store: Path | None = None
) -> Iterator[Iterator[Columns]]:
    """Yield the batches of a sweep's rows, see `sweep.run`; `store` is the store's file, default: the user's."""
    from studies.mechanics import store as stores
    from studies.sweeps import sweep as sweep_study

    with stores.opened(store or stores.default()) as states, atomic_files.results(out) as folder:
        yield sweep_study.run(plan, folder, states, processes=processes, progress=progress)


class Choices:
    """Counts the models that a tolerance chooses in the batches of a sweep."""

    def __init__(self, plan: Plan) -> None:
        self.tolerance = plan.reference.tolerance if plan.reference else None
        self.counts: dict[str, int] = {}
        self.beyond = 0

    def add(self, table: Columns) -> None:
        """Count the rows of a batch."""
        if self.tolerance is None:
            return
        for name in table["chosen_model"].tolist():
            self.counts[name] = self.counts.get(name, 0) + 1
        from studies.mechanics.model_choice import UNMET

        self.beyond += int((table["status"] == UNMET).sum())

    def sentences(self) -> list[str]:
        """Return which models were chosen in how many cases, and why, and what did not meet the tolerance."""
        if self.tolerance is None:
            return []
        from studies.mechanics.model_choice import percent

        names = ", ".join(f"{name} in {count}" for name, count in self.counts.items() if name) or "no model in any"
        why = "each the cheapest model whose measured errors for that kind of load meet it"
        texts = [f"tolerance {percent(self.tolerance)}: {names} of {sum(self.counts.values())} cases, {why}"]
        if self.beyond:
            texts.append(f"{self.beyond} cases are not known to meet the tolerance: take a smaller one")
        return texts


CASE = ("D_mm", "L_mm", "f_mm", "E_MPa", "shear_mm", "depth_mm")
"""Columns that identify the case of a row, in a comparison or a sweep over the usual axes."""


def case_columns(plan: Plan) -> tuple[str, ...]:
    """Return the columns that identify the case of a row of a sweep."""
    return tuple(dict.fromkeys((*CASE, *(study_axes.column(name) for name in plan.axes))))


def table(rows: Sequence[FlatRow], title: str, case: Sequence[str] = CASE) -> Table:
    """Return the table of the main results of both models; files and a wide table have all columns."""
    results, errors = _compared(rows[0])
    keys = _main_columns(rows[0], case)
    varying = [key for key in case if len({row.get(key) for row in rows}) > 1]
    first = ("status", *varying, f"fem_{results[0]}", f"analytic_{results[0]}", errors[0])
    brief = [key for key in rows[0] if key not in keys]
    return Table(title=title, rows=rows, brief=brief, first=first)


def _compared(row: FlatRow) -> tuple[tuple[str, str], tuple[str, ...]]:
    sheared = any(key.endswith("force_x_N") for key in row)
    results = ("force_x_N", "shift_x_mm") if sheared else ("force_N", "shift_z_mm")
    return results, tuple(name.replace("_N", "_error_percent").replace("_mm", "_error_percent") for name in results)


def _main_columns(row: FlatRow, case: Sequence[str]) -> tuple[str, ...]:
    results, errors = _compared(row)
    answers = [key for name in results for key in row if key.endswith(f"_{name}")]
    others = [key for key in row if key.startswith(("decoded_", "critical_", "mode1_", "response_", "loop_"))]
    judged = [key for error in errors for key in row if key.endswith(error)]
    return (*case, *answers, *judged, *others, "fem_tilt_rad", "chosen_model", "status")


def idle_axes(
    rows: Sequence[FlatRow], plan: Plan, *, whole: bool, case: Sequence[str] = CASE
) -> list[tuple[str, str]]:
    """Return the axes of a sweep that change no column of the output, each with the reason.

    Parameters
    ----------
    whole : whether the output has all columns (files, JSON, a wide table) or the main ones.
    """
    if not rows:
        return []
    # axes that vary together are judged together, by the first of them
    groups = [factor.names for factor in plan.factors if not factor.sampled]
    axes = {names[0]: names for names in groups if len(plan.factors) == len(groups)}
    idle = _idle(rows, axes, rows[0])
    reasons = [(name, "the results are the same for all its values") for name in idle]
    main = _main_columns(rows[0], case)
    hidden = [] if whole else [name for name in _idle(rows, axes, main) if name not in idle]
    return reasons + [(name, "it changes only columns that --wide, --json and --out show") for name in hidden]


def _idle(rows: Sequence[FlatRow], axes: Mapping[str, Sequence[str]], keys: Iterable[str]) -> list[str]:
    """Return the axes along which none of the columns changes, from solved cases that differ in one axis only."""
    columns = {name: study_axes.column(name) for name in axes}
    own = {study_axes.column(name) for names in axes.values() for name in names}
    figures = [key for key in keys if key not in (*own, "solve", "seconds")]
    idle = []
    for name in axes:
        others = [column for axis, column in columns.items() if axis != name]
        lines: dict[tuple[Any, ...], list[str]] = {}
        for row in rows:
            if row.get("status") in ANSWERED:
                # compare texts, because a NaN differs from itself
                figure = repr([row.get(key) for key in figures])
                lines.setdefault(tuple(row.get(column) for column in others), []).append(figure)
        if max(map(len, lines.values()), default=0) > 1 and all(len(set(texts)) == 1 for texts in lines.values()):
            idle.append(name)
    return idle
