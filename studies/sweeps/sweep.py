"""Sweeps: a study's cases by finite elements and formulas, with as few solves as possible, row after row.

The cases are resolved batch by batch (`study_cases`). All their places in the store are known before the first solve,
so that each path is solved once, to all states that the study needs and the store lacks (`path_solver`). Workers
solve the paths in the order of the cases (`workers`), this process alone writes the store, and a batch of rows is
computed as soon as its paths are solved (`study_rows`). Memory grows with the number of distinct problems, not with
the number of rows.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.design import LAWS, BadInput, Design, no_numbers
from geometry.loads import ANSWERED
from geometry.messages import Progress
from studies.answers import flat_rows, status_columns
from studies.inputs import study_input, user_input
from studies.inputs.user_input import Value
from studies.mechanics import store as stores
from studies.mechanics.model import Model
from studies.mechanics.model_choice import UNMET
from studies.mechanics.path_solver import Place
from studies.mechanics.solve_plan import Processes, Solves
from studies.mechanics.store import Store
from studies.mechanics.study_cases import Cases, Columns, Plan, completed
from studies.models import kinds, models_of
from studies.models.tolerance import Tolerance
from studies.output import atomic_files, console, table_files
from studies.output.records import FlatRow
from studies.output.result import Result, Table
from studies.quantities import QUANTITIES
from studies.sweeps.study_rows import Rows

if TYPE_CHECKING:
    from studies.inputs.option_groups import Sweep

FILES = ("sweep.csv", "sweep.parquet", "sweep.png", "sweep-*.png")
"""Files that a sweep may write into its folder."""
MOST_SHOWN = 1000
"""Largest number of rows of a table on the screen."""
MOST_LISTED = 6
"""Number of messages beyond which they are a table."""
MOST_CASES = 100_000_000
"""Largest number of cases of a study; more are taken for a mistake."""
BATCH = 8192
"""Rows that are computed at a time."""
LARGE = 20_000
"""Number of rows from which on a sweep writes Parquet in place of CSV."""


def run(
    plan: Plan,
    folder: Path | None,
    store: Store | None,
    *,
    processes: Processes = Processes(),
    progress: Progress | None = None,
) -> Iterator[Columns]:
    """Yield the rows of a study in batches, tables of columns that come as soon as their paths are solved.

    The last factor varies fastest; see `study_rows`. A case that cannot be solved has a row with NaN for its results,
    a status and a message. `solve` is the number of the path that a row comes from (0: none). `seconds` is the time
    of its solve from the previous state to the row's; rows that share a state have the same.

    Parameters
    ----------
    folder : existing folder into which sweep.csv (sweep.parquet if there are many rows) and the pictures are written
        at the end; None writes nothing.
    store : of solved states; None for a plan that does not solve.

    Raises
    ------
    BadInput
        There are too many cases; raised before the first row.
    KeyboardInterrupt
        The sweep was interrupted; the text states how many solves are in the store.
    """
    if plan.count > MOST_CASES:
        raise BadInput(
            f"a sweep may have at most {MOST_CASES} cases; these axes give {plan.count}: take fewer values"
        )
    cases = Cases(plan)
    name, other = ("sweep.parquet", "sweep.csv") if plan.count > LARGE else ("sweep.csv", "sweep.parquet")
    with contextlib.ExitStack() as stack:
        solves = stack.enter_context(contextlib.closing(Solves(plan, cases, store, processes, progress)))
        batches = _batches(plan, cases, solves)
        if folder is None:
            yield from (table for table, _ in batches)
            return
        from studies.sweeps import sweep_figures

        write = stack.enter_context(table_files.writer(folder / name))
        pictures = sweep_figures.Collected(plan)
        for table, indices in batches:
            write(table)
            pictures.add(table, indices)
            yield table
    # the table of an earlier sweep in this folder would be taken for this one's
    (folder / other).unlink(missing_ok=True)
    if progress is not None:
        progress(1.0, f"{name} and sweep.png")
    pictures.draw(folder / "sweep.png")


@contextlib.contextmanager
def opened(
    plan: Plan, out: Path | None, progress: Progress, processes: Processes, store: Path | None = None
) -> Iterator[Iterator[Columns]]:
    """Yield the batches of a sweep's rows, see `run`; `store` is the store's file, default: the user's."""
    with store_of(plan, store) as states, atomic_files.results(out) as folder:
        yield run(plan, folder, states, processes=processes, progress=progress)


def store_of(plan: Plan, store: Store | Path | str | None) -> contextlib.AbstractContextManager[Store | None]:
    """Open the store of a plan, default: the user's; None if nothing is solved. A store that is open stays open."""
    if isinstance(store, Store) or not plan.solves:
        return contextlib.nullcontext(store if isinstance(store, Store) else None)
    return stores.opened(store)


def without_rows(plan: Plan) -> Columns:
    """Return the columns of a plan that has no case."""
    names = [*(model.name for model in plan.models), *(name for name in plan.quantities if QUANTITIES[name].path)]
    return Rows(plan).answers(Cases(plan).batch(np.arange(0)), {name: [] for name in names}, []).wide()


def _batches(plan: Plan, cases: Cases, solves: Solves) -> Iterator[tuple[Columns, NDArray[np.int64]]]:
    """Yield tables with the indices of their cases; a batch ends before a case whose path is not solved yet."""
    rows = Rows(plan)
    for first in range(0, plan.count, BATCH):
        indices = np.arange(first, min(first + BATCH, plan.count))
        batch, done = cases.batch(indices), 0
        found = solves.answers(batch)
        while done < len(indices):
            # the first case that lacks a solve, in the order of the cases
            lacking = np.any([[isinstance(each, Place) for each in of] for of in found.values()], axis=0)
            waiting = np.flatnonzero(lacking[batch.problem[done:]])
            end = done + int(waiting[0]) if len(waiting) else len(indices)
            if end > done:
                part = batch.part(done, end)
                yield rows.answers(part, *solves.answered(part, found)).wide(), indices[done:end]
                done = end
            else:
                problem = batch.problem[done]
                solves.wait(next(of[problem] for of in found.values() if isinstance(of[problem], Place)))
                found = solves.answers(batch, found)


# A sweep as options and a study file ask for it


def plan_of(source: str | None, options: Sweep, sets: Sequence[str] = (), models: str | None = None) -> Plan:
    """Return the study of a file, or of a design with axes, ready to run; options, and names of models that commas
    part, replace the study's values."""
    study = _study(source, options)
    magnet = options.magnet or study.magnet or "rigid"
    design = study_input.study_design(study, sets, magnet=magnet)
    names = tuple(name for factor in study.factors for name in factor.names)
    _check_twice(names, options, sets, study)
    _check_laws(design, study.factors)
    load = _load(study, options)
    chosen = _models(options, models, study)
    asked = study.quantities if options.quantities is None else _parts(options.quantities)
    quantities = study_input.checked_quantities(asked)
    if study_input.needs_load(quantities) and not {"depth", "grip"} & {*map(study_input.field_of, names), *load}:
        raise BadInput("a sweep needs a depth: add --depth D in mm, or the axis depth=a,b,c")
    return completed(Plan(design, study.factors, load, magnet, chosen, quantities))


def _parts(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(","))


def _study(source: str | None, options: Sweep) -> study_input.Study:
    if source is not None and options.design is not None:
        raise BadInput(f"the design is given twice, {source!r} and --design {options.design!r}: give one of them")
    if source is not None and study_input.is_study(source):
        if options.axis:
            raise BadInput(f"the study {source!r} has its own axes: leave --axis out, or give a design instead")
        return study_input.read_study(source)
    if not options.axis:
        raise BadInput(
            "a sweep needs at least one axis: add --axis NAME=a,b,c, or give a study file with a table [axes]"
        )
    factors = study_input.grid(study_input.parse_axes(options.axis))
    return study_input.Study(source or options.design or "paper", {}, factors, {})


def _check_twice(names: Sequence[str], options: Sweep, sets: Sequence[str], study: study_input.Study) -> None:
    load, given = study.load, [text.partition("=")[0].strip() for text in options.load or ()]
    fields = [study_input.field_of(name) for name in names]
    if twice := [name for name in fields if fields.count(name) > 1]:
        raise BadInput(f"{twice[0]} is given twice, as axes {twice[0]} and {twice[0]}/D: leave one of them out")
    names = fields
    for name, _, value in (text.partition("=") for text in sets):
        if name.strip() in names:
            raise BadInput(f"{name.strip()} is both an axis and set to {value.strip()}: leave one of them out")
    if options.depth is not None and "depth" in given:
        raise BadInput("depth is given twice, by --depth and by --load: leave one of them out")
    if "depth" in names and (options.depth is not None or "depth" in load):
        raise BadInput(
            "depth is given twice, as an axis and as a single value (--depth or the study's): leave one of them out"
        )
    for name, where in [*((name, "by --load") for name in given), *((name, "in [load]") for name in load)]:
        if name in names:
            raise BadInput(f"{name} is given twice, as an axis and {where}: leave one of them out")
    if "magnet" in names and (options.magnet is not None or study.magnet is not None):
        where = "by --magnet" if options.magnet is not None else "alone in the study"
        raise BadInput(f"magnet is given twice, as an axis and {where}: leave one of them out")


def _check_laws(design: Design, factors: Sequence[study_input.Factor]) -> None:
    """Refuse an axis of laws with one that has no numbers: its rows would repeat those of the law neo-hookean."""
    values = {name: each for factor in factors for name, each in zip(factor.names, factor.values, strict=True)}
    for law in map(str, values.get("law", ())):
        if law != "neo-hookean" and not set(LAWS[law]) & set(values) and replace(design, law=law).is_neo_hookean:
            raise BadInput(f"{no_numbers(law)}, or leave it out of the axis law")


def _load(study: study_input.Study, options: Sweep) -> dict[str, Value]:
    load = dict(study.load)
    for name, text in user_input.pairs("--load", options.load or (), "shear=1").items():
        user_input.check_keys("--load", [name], study_input.LOAD)
        load[name] = study_input.parse(name, text)[0]
    if options.depth is not None:
        load["depth"] = study_input.checked("depth", [options.depth])[0]
    return load


def _models(options: Sweep, models: str | None, study: study_input.Study) -> tuple[Model, ...]:
    given = study.models if models is None else _parts(models)
    accuracy = options.wanted.accuracy or study.accuracy
    if given and accuracy:
        raise BadInput(
            f"models and accuracy both choose finite elements ({', '.join(given)}; {accuracy}): leave one of them out"
        )
    tolerance = user_input.parse_tolerance(options.wanted.tolerance) if options.wanted.tolerance else study.tolerance
    if tolerance is not None and accuracy:
        raise BadInput(f"a tolerance chooses the accuracy, which is given too ({accuracy}): leave one of them out")
    if tolerance is not None:
        return models_of([*(given or ("paper",)), Tolerance("chosen", tolerance)])
    return models_of(given or (accuracy or "standard", "paper"))


# What the screen shows

CASE = ("D_mm", "L_mm", "f_mm", "E_MPa", "shear_mm", "depth_mm")
"""Columns that identify the case of a row, in a comparison or a sweep over the usual axes."""


class Shown:
    """The first rows of a sweep, which the screen shows, and counts of all, unstable, doubtful and failed ones."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.case = tuple(dict.fromkeys((*CASE, *(study_input.column(name) for name in plan.axes))))
        self.count = self.unstable = self.doubtful = self.failed = self.beyond = 0
        # a case fails where finite elements of any accuracy do
        own = status_columns(plan)
        self.statuses = ("status", *(own[model.name] for model in plan.models if model.name in own and model.solves))
        self.rows: list[FlatRow] = []
        self.failures: list[FlatRow] = []
        self.counts: dict[str, Counter[Any]] = {model.name: Counter() for model in plan.models}

    def add(self, batch: Columns) -> Iterator[FlatRow]:
        """Count the rows of a batch, and yield them."""
        for row in flat_rows(batch):
            self.count += 1
            self.unstable += row["status"] == "unstable"
            self.doubtful += row["status"] == "unknown"
            self.beyond += row["status"] == UNMET
            for model in self.plan.models:
                self.counts[model.name][next((row[column] for column in model.columns), "")] += 1
            if any(row[name] not in ANSWERED for name in self.statuses):
                self.failed += 1
                self.failures += [row] if len(self.failures) < MOST_SHOWN else []
            self.rows += [row] if len(self.rows) < MOST_SHOWN else []
            yield row

    def result(self) -> Result:
        """Return the rows as a table with their remarks, or their number if there are many; without JSON."""
        blocks: list[Any] = []
        if self.count > MOST_SHOWN:
            many = f"{self.count} of {self.plan.count} rows"
            blocks = [f"{many}; --out FOLDER or --json has them, a table on the screen does not."]
        elif self.rows:
            answered = [row for row in self.rows if all(row[name] in ANSWERED for name in self.statuses)]
            said = console.messages(answered, self.case, self.rows)
            blocks = [table(self.rows, "Sweep", self.case)]
            if len(said) > MOST_LISTED:
                remarks = [{"cases": cases, "remark": message} for cases, message in said]
                blocks.append(Table(title="Messages", rows=remarks, first=("cases", "remark")))
            else:
                blocks += [f"{place}: {message}" for place, message in said]
        return Result(title="Sweep", records=[], shown=blocks)

    @property
    def is_good(self) -> bool:
        """Whether every case has the status ok, and there are any."""
        return self.count > 0 and not (self.unstable or self.doubtful or self.failed)

    def remarks(self) -> list[str]:
        """Return what the models say of the cases, and the reasons and numbers of failures."""
        said = [text for each in self.plan.models for text in each.remarks(self.counts[each.name], self.count)]
        if self.beyond:
            said.append(f"{self.beyond} cases are not known to meet the tolerance, even at the finest accuracy")
        reasons = console.remarks(self.failures, self.case, self.rows)
        said += reasons[:MOST_LISTED]
        if more := len(reasons) - MOST_LISTED:
            said += [f"{more} further reasons are in the column message (--json, --out)"] if more > 0 else []
        if self.unstable:
            said.append(
                f"{self.unstable} of {self.count} cases are unstable: their numbers are those of an equilibrium that "
                "a real sensor leaves"
            )
        if self.doubtful:
            said.append(
                f"{self.doubtful} of {self.count} cases are so near the critical depth that it is not known whether "
                "they are stable"
            )
        return [*said, f"{self.failed} of {self.count} cases failed"] if self.failed else said


def table(rows: Sequence[FlatRow], title: str, case: Sequence[str] = CASE) -> Table:
    """Return the table of the main results of both models; files and a wide table have all columns."""
    results, errors = _compared(rows[0])
    keys = _main_columns(rows[0], case)
    # what a model alone could not answer
    keys += tuple(
        key for key in rows[0] if key.endswith("_status") and any(row[key] != row["status"] for row in rows)
    )
    varying = [key for key in case if len({row.get(key) for row in rows}) > 1]
    alone = [key for kind in kinds() if kind.head and (key := f"{kind.head}_{results[0]}") in rows[0]]
    answers = alone or [key for key in rows[0] if key.endswith(f"_{results[0]}")][:1]
    first = ("status", *varying, *answers, errors[0])
    brief = [key for key in rows[0] if key not in keys]
    return Table(title=title, rows=rows, brief=brief, first=first)


def _compared(row: FlatRow) -> tuple[tuple[str, str], tuple[str, ...]]:
    sheared = any(key.endswith("force_x_N") for key in row)
    results = ("force_x_N", "shift_x_mm") if sheared else ("force_N", "shift_z_mm")
    return results, tuple(f"{name.rpartition('_')[0]}_error_percent" for name in results)


def _main_columns(row: FlatRow, case: Sequence[str]) -> tuple[str, ...]:
    results, errors = _compared(row)
    answers = [key for name in results for key in row if key.endswith(f"_{name}")]
    others = [key for key in row if key.startswith(("decoded_", "critical_", "mode1_", "response_", "loop_"))]
    own = [part.column for each in QUANTITIES.values() if each.of_states for part in each.parts]
    others += [key for column in own for key in row if key.endswith(f"_{column}")]
    judged = [key for error in errors for key in row if key.endswith(error)]
    said = [column for kind in kinds() for column, none in kind.columns.items() if isinstance(none, str)]
    return (*case, *answers, *judged, *others, "fem_tilt_rad", *said, "status")


def idle_axes(shown: Shown, *, whole: bool) -> list[tuple[str, str]]:
    """Return the axes that change no column, or, unless the `whole` table is shown, no main one, with the reason."""
    rows, plan = shown.rows, shown.plan
    if not rows or shown.count > MOST_SHOWN:
        return []
    # axes that vary together are judged together, by the first of them
    groups = [factor.names for factor in plan.factors if not factor.sampled]
    axes = {names[0]: names for names in groups if len(plan.factors) == len(groups)}
    idle = _idle(rows, axes, rows[0])
    reasons = [(name, "the results are the same for all its values") for name in idle]
    main = _main_columns(rows[0], shown.case)
    hidden = [] if whole else [name for name in _idle(rows, axes, main) if name not in idle]
    return reasons + [(name, "it changes only columns that --wide, --json and --out show") for name in hidden]


def _idle(rows: Sequence[FlatRow], axes: Mapping[str, Sequence[str]], keys: Iterable[str]) -> list[str]:
    own = {
        study_input.column(name) for names in axes.values() for name in (*names, *map(study_input.field_of, names))
    }
    figures = [key for key in keys if key not in (*own, "solve", "seconds")]
    answered = [row for row in rows if row.get("status") in ANSWERED]
    idle = []
    for name in axes:
        others = [study_input.column(axis) for axis in axes if axis != name]
        lines: dict[tuple[Any, ...], list[str]] = {}
        for row in answered:
            # compare texts, because a NaN differs from itself
            figure = repr([row.get(key) for key in figures])
            lines.setdefault(tuple(row.get(column) for column in others), []).append(figure)
        if max(map(len, lines.values()), default=0) > 1 and all(len(set(texts)) == 1 for texts in lines.values()):
            idle.append(name)
    return idle
