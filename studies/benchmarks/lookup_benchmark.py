"""The paper's look-up table, read by its nearest entry: coarse ones in memory, the whole one from its file."""

from __future__ import annotations

import resource
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analytic import lookup
from analytic.inverse import forward_model
from analytic.inverse.forward_model import Forward
from geometry.arrays import Array
from geometry.design import BadInput, paper
from studies.sensing import lookup_table

STEPS = (0.5, 0.25, 0.125)
"""Of the coarse tables, mm."""


@dataclass(frozen=True, slots=True)
class TableFigures:
    """Cost and error of a look-up table that is read by its nearest entry.

    Attributes
    ----------
    build_s : CPU seconds to make it.
    query_us : time of one query.
    median_mm, worst_mm : distance of the entry that is read from the true shift.
    """

    step_mm: float
    entries: int
    MB: float
    build_s: float
    query_us: float
    median_mm: float
    worst_mm: float


@dataclass(frozen=True, slots=True)
class WholeTable:
    """The whole table in its file.

    Attributes
    ----------
    slabs, same : slabs that were made again, and how many of them are the same.
    index_s, index_MB : time and size of the index of its blocks.
    blocks : blocks that a query reads, on average.
    peak_MB : most memory of the process, with pages of the mapped file.
    """

    figures: TableFigures
    slabs: int
    same: int
    index_s: float
    index_MB: float
    blocks: float
    peak_MB: float


def steps(count: int = 2000) -> list[TableFigures]:
    """The paper's table at several steps, read by its nearest entry."""
    from scipy.spatial import KDTree

    model, shift, field = _asked(count)
    tables = []
    for step in STEPS:
        grid = lookup.Grid(3.0, 3.0, step)
        begin = time.process_time()
        entries = np.stack([lookup.slab(model, grid, i) for i in range(grid.shape[0])]).reshape(-1, 3)
        built = time.process_time() - begin
        tree = KDTree(entries)
        begin = time.process_time()
        nearest = tree.query(field.T)[1]
        asked = time.process_time() - begin
        axes = grid.axes()
        i, j, k = np.unravel_index(nearest, grid.shape)
        error = np.linalg.norm(np.stack([axes[0][i], axes[1][j], axes[2][k]]) - shift, axis=0)
        tables.append(
            TableFigures(
                step_mm=step,
                entries=len(entries),
                MB=entries.nbytes / 1e6,
                build_s=built,
                query_us=1e6 * asked / count,
                median_mm=float(np.median(error)),
                worst_mm=float(error.max()),
            )
        )
    return tables


def whole(path: Path, count: int = 2000, again: int = 12) -> WholeTable:
    """The table in a file, read by its nearest entry; and some of its slabs made again, which must be the same.

    Raises
    ------
    BadInput
        It is no table of the paper's sensor without tilt.
    """
    table, about = lookup_table.read(path, paper())
    grid = lookup.Grid(3.0, 3.0, float(about["step_mm"]))
    if table.shape != (*grid.shape, 3) or np.any(about["tau"]):
        raise BadInput(
            f"{str(path)!r} is no table of the paper's sensor without tilt: make it by magtip table paper --out "
            "FILE.npy"
        )
    model, shift, field = _asked(count)
    slabs = np.linspace(0, len(table) - 1, again).astype(int).tolist()
    begin = time.process_time()
    same = [np.array_equal(lookup.slab(model, grid, i), table[i]) for i in slabs]
    built = (time.process_time() - begin) / again * len(table)
    begin = time.perf_counter()
    index = lookup.block_index(table)
    indexed = time.perf_counter() - begin
    begin = time.perf_counter()
    answers = [lookup.nearest(index, b) for b in field.T]
    asked = time.perf_counter() - begin
    axes = grid.axes()
    places = np.array([[axis[n] for axis, n in zip(axes, place, strict=True)] for place, _ in answers])
    error = np.linalg.norm(places - shift.T, axis=1)
    figures = TableFigures(
        step_mm=grid.step,
        entries=table.size // 3,
        MB=table.nbytes / 1e6,
        build_s=built,
        query_us=1e6 * asked / count,
        median_mm=float(np.median(error)),
        worst_mm=float(error.max()),
    )
    return WholeTable(
        figures,
        slabs=again,
        same=sum(same),
        index_s=indexed,
        index_MB=(index.low.nbytes + index.high.nbytes + index.corner.nbytes) / 1e6,
        blocks=float(np.mean([n for _, n in answers])),
        peak_MB=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    )


def _asked(count: int) -> tuple[Forward, Array, Array]:
    """The paper's sensor without tilt, shifts (3, n), mm, drawn from the table's range, and what is read there, T."""
    model = forward_model.model(paper())
    shift = np.random.default_rng(3).uniform([-3.0, -3.0, -3.0], [3.0, 3.0, 0.0], (count, 3)).T.copy()
    return model, shift, forward_model.readings_at(model, shift)
