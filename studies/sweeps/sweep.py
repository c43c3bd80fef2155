"""Sweeps: a study's cases by finite elements and formulas, with as few solves as possible, row after row.

The cases are resolved batch by batch (`study_cases`). All their places in the store are known before the first solve,
so that each path is solved once, to all states that the study needs and the store lacks (`path_solver`). Workers
solve the paths in the order of the cases (`workers`), this process alone writes the store, and a batch of rows is
computed as soon as its paths are solved (`study_rows`). Memory grows with the number of distinct problems, not with
the number of rows.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geometry.design import BadInput
from geometry.messages import Progress
from studies.mechanics.path_solver import KINDS, Answer
from studies.mechanics.solve_plan import IMPOSSIBLE, Paths, Processes, Solves, Target, surrogate_answers
from studies.mechanics.store import Store
from studies.mechanics.study_cases import Batch, Cases, Columns, Plan
from studies.output import table_files
from studies.sweeps.study_rows import Rows, Solved

MOST_CASES = 100_000_000
"""Largest number of cases of a study; more are taken for a mistake."""
BATCH = 8192
"""Rows that are computed at a time."""
LARGE = 20_000
"""Number of rows from which on a sweep writes Parquet in place of CSV."""


def run(
    plan: Plan,
    folder: Path | None,
    store: Store,
    *,
    processes: Processes = Processes(),
    progress: Progress | None = None,
) -> Iterator[Columns]:
    """Yield the rows of a study in batches, as tables of columns, as soon as their paths are solved.

    At the end write sweep.csv (sweep.parquet if there are many rows) and the pictures into the folder.

    Parameters
    ----------
    folder : existing output folder; None writes nothing.
    store : supplies known states and receives new ones.
    processes : what solves.

    Returns
    -------
    Tables in the order of the cases, the last factor fastest; see `study_rows`. A case that cannot be solved has a
    row with NaN for its results, a status and a message. `solve` is the number of the path that a row comes from
    (0: none). `seconds` is the time of its solve from the previous state to the row's; rows that share a state have
    the same.

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
    return _run(plan, folder, store, processes, progress)


def _run(
    plan: Plan, folder: Path | None, store: Store, processes: Processes, progress: Progress | None
) -> Iterator[Columns]:
    cases = Cases(plan)
    paths = Paths(plan, cases)
    name, other = ("sweep.parquet", "sweep.csv") if plan.count > LARGE else ("sweep.csv", "sweep.parquet")
    with contextlib.ExitStack() as stack:
        solves = stack.enter_context(contextlib.closing(Solves(paths.paths, store, processes, progress)))
        batches = _batches(plan, cases, paths, solves)
        if folder is None:
            yield from (table for table, _ in batches)
            return
        from studies.sweeps import sweep_pictures

        write = stack.enter_context(table_files.writer(folder / name))
        pictures = sweep_pictures.Collected(plan)
        for table, indices in batches:
            write(table)
            pictures.add(table, indices)
            yield table
    # the table of an earlier sweep in this folder would be taken for this one's
    (folder / other).unlink(missing_ok=True)
    if progress is not None:
        progress(1.0, f"{name} and sweep.png")
    pictures.draw(folder / "sweep.png")


def _batches(plan: Plan, cases: Cases, paths: Paths, solves: Solves) -> Iterator[tuple[Columns, NDArray[np.int64]]]:
    """Yield tables with the indices of their cases; a batch ends before a case whose path is not solved yet."""
    rows = Rows(plan)
    for first in range(0, plan.count, BATCH):
        indices = np.arange(first, min(first + BATCH, plan.count))
        batch = cases.batch(indices)
        targets = [paths.targets(code, problem) for code, problem in zip(batch.codes, batch.problems, strict=True)]
        done = 0
        while done < len(indices):
            # the first case whose path is not solved, in the order of the cases
            ready = np.array([all(solves.is_solved(t.key) for t in kinds.values() if t.key) for kinds in targets])
            waiting = np.flatnonzero(~ready[batch.problem[done:]])
            end = done + int(waiting[0]) if len(waiting) else len(indices)
            if end > done:
                part = batch.part(done, end)
                yield rows.columns(part, _solved(plan, part, targets, paths, solves)), indices[done:end]
                done = end
            else:
                solves.wait(next(t.key for t in targets[batch.problem[done]].values() if not solves.is_solved(t.key)))


def _solved(
    plan: Plan, batch: Batch, targets: Sequence[Mapping[str, Target]], paths: Paths, solves: Solves
) -> Solved:
    """Return the answers to all problems of a batch; problems without a case in it have any."""
    present = set(np.unique(batch.problem).tolist())

    def of(name: str) -> list[Answer]:
        return [
            solves.answer(targets[k][name], problem) if k in present else IMPOSSIBLE
            for k, problem in enumerate(batch.problems)
        ]

    reference = plan.reference
    chosen = [kinds[reference.name] for kinds in targets] if reference and reference.tolerance else []
    numbers = [paths.number(kinds[reference.name].key) if reference else 0 for kinds in targets]
    return Solved(
        states={
            model.name: surrogate_answers(batch.problems) if model.surrogate else of(model.name) for model in plan.fem
        },
        numbers=numbers,
        chosen=[(target.choice.name, target.choice.bound) if target.choice else ("", math.nan) for target in chosen],
        others={name: of(name) for name in KINDS if name in plan.quantities},
    )
