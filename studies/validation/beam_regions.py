"""Regions in which a formula stays within 5 % or 10 %, and the best level of the formulas in each region."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from studies.simulation.beam_cells import QUANTITIES, Body, Bools, Cells, Columns, Kind, all_errors

BOUNDS = (5.0, 10.0)
"""Errors that bound a region, %."""


@dataclass(frozen=True, slots=True)
class Block:
    """Neighbouring lengths and loads: first and last index of each."""

    first_load: int
    last_load: int
    first_length: int
    last_length: int

    @property
    def count(self) -> int:
        """Number of cells."""
        return (self.last_load - self.first_load + 1) * (self.last_length - self.first_length + 1)


@dataclass(frozen=True, slots=True)
class ShareRow:
    """Share of the judged cells of a body in which a level is within the bounds, and its typical and largest error.

    Attributes
    ----------
    leaning_of_these_percent : share of the cells within 10 % that are deeper than the critical depth of a free tip.
    within_5_block, within_10_block : the largest block of neighbouring cells within the bound, in words.
    """

    quantity: str
    level: str
    magnet_height_over_D: float
    nu: float
    cells: int
    within_5_percent: float
    within_10_percent: float
    leaning_of_these_percent: float
    median_error_percent: float
    largest_error_percent: float
    within_5_block: str
    within_10_block: str


@dataclass(frozen=True, slots=True)
class BestRow:
    """The level of least root mean square error in a region, beside the paper's.

    Attributes
    ----------
    best_in_percent : share of the region's cells in which this level has the least error of all levels.
    """

    quantity: str
    region: str
    cells: int
    best_level: str
    rms_error_percent: float
    within_10_percent: float
    best_in_percent: float
    paper_rms_error_percent: float
    paper_within_10_percent: float


def share(error: Array, bound: float) -> float:
    """Return the share of the known errors that are within a bound, %; NaN without any.

    >>> share(np.array([-3.0, 7.0, np.nan, 20.0, 1.0]), 5.0)
    50.0
    """
    known = np.isfinite(error)
    return 100 * float((np.abs(error[known]) <= bound).mean()) if known.any() else math.nan


def largest_block(inside: Bools) -> Block | None:
    """Return the largest block of neighbouring cells that are all inside; None if no cell is.

    Among equally large blocks the one with more lengths is taken.
    """
    best: Block | None = None
    loads, lengths = inside.shape
    for first in range(loads):
        # columns that are inside in all rows from the first to the last one
        whole = np.ones(lengths, dtype=np.bool_)
        for last in range(first, loads):
            whole &= inside[last]
            for begin, end in _runs(whole):
                block = Block(first, last, begin, end)
                if best is None or (block.count, end - begin) > (best.count, best.last_length - best.first_length):
                    best = block
    return best


def _runs(flags: Bools) -> Iterable[tuple[int, int]]:
    """Yield first and last index of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(begin), int(end) - 1) for begin, end in zip(edges[::2], edges[1::2], strict=True)]


def block_text(grid: Cells, block: Block | None) -> str:
    """Return a block in words, such as "L/D 2 to 6, d/D 0.08 to 0.2"; "nowhere" for none."""
    if block is None:
        return "nowhere"
    slender = _span(grid.slenderness[block.first_length], grid.slenderness[block.last_length])
    first, last = grid.loads[block.first_load], grid.loads[block.last_load]
    if grid.kind == "press":
        return f"L/D {slender}, d/D {_span(first[0], last[0])}"
    if first[0] == last[0]:
        return f"L/D {slender}, d/D {first[0]:.3g}, shear/D {_span(first[1], last[1])}"
    states = f"from d/D {first[0]:.3g}, shear/D {first[1]:.3g} to d/D {last[0]:.3g}, shear/D {last[1]:.3g}"
    return f"L/D {slender}, {states}"


def _span(low: float, high: float) -> str:
    return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"


def share_rows(table: Columns, grids: Sequence[Cells]) -> list[ShareRow]:
    """Return a row for each quantity, level and body."""
    rows = []
    for grid in grids:
        for quantity in QUANTITIES[grid.kind]:
            for level, error in all_errors(table, grid, quantity).items():
                known = error[np.isfinite(error)]
                if not len(known):
                    continue
                blocks = [block_text(grid, largest_block(np.abs(error) <= bound)) for bound in BOUNDS]
                shares = [share(error, bound) for bound in BOUNDS]
                largest = float(known[np.abs(known).argmax()])
                typical = float(np.median(np.abs(known)))
                body = grid.body
                near = np.abs(error) <= BOUNDS[-1]
                leaning = 100 * float(grid.leans[near].mean()) if near.any() else math.nan
                figures = (len(known), shares[0], shares[1], leaning, typical, largest)
                rows.append(ShareRow(quantity, level, body.height, body.nu, *figures, blocks[0], blocks[1]))
    return rows


# Best level

SLENDER: dict[str, Callable[[float], bool]] = {
    "L/D below 1.1": lambda ratio: ratio < 1.1,
    "L/D 1.1 to 2": lambda ratio: 1.1 <= ratio <= 2,
    "L/D above 2": lambda ratio: ratio > 2,
}
DEPTHS: dict[str, Callable[[float], bool]] = {
    "d/D to 0.06": lambda depth: depth <= 0.06,
    "d/D 0.06 to 0.2": lambda depth: 0.06 < depth <= 0.2,
    "d/D above 0.2": lambda depth: depth > 0.2,
}
BODIES: dict[str, Callable[[Body], bool]] = {
    "no magnet": lambda body: not body.height,
    "magnet to 0.25 D": lambda body: 0 < body.height <= 0.25,
    "taller magnet": lambda body: body.height > 0.25,
}


def best_rows(table: Columns, grids: Sequence[Cells]) -> list[BestRow]:
    """Return the best level in each region: body, slenderness and depth; regions without a cell are left out."""
    rows = []
    kinds: tuple[Kind, ...] = ("press", "shear")
    for kind in kinds:
        for quantity in QUANTITIES[kind]:
            for body_name, of_body in BODIES.items():
                own = [
                    (grid, all_errors(table, grid, quantity))
                    for grid in grids
                    if grid.kind == kind and of_body(grid.body)
                ]
                for slender_name, slender in SLENDER.items():
                    for depth_name, deep in DEPTHS.items():
                        picked = [_picked(grid, errors, slender, deep) for grid, errors in own]
                        region = f"{body_name}, {slender_name}, {depth_name}"
                        rows += best_row(quantity, region, picked)
    return rows


def _picked(
    grid: Cells, errors: Mapping[str, Array], slender: Callable[[float], bool], deep: Callable[[float], bool]
) -> dict[str, Array]:
    """Return the errors of all levels in the cells of a region that every level answers, shape (cells,)."""
    chosen = np.outer([deep(depth) for depth in grid.loads[:, 0]], [slender(ratio) for ratio in grid.slenderness])
    return {level: error[chosen] for level, error in errors.items()}


def best_row(quantity: str, region: str, picked: Sequence[Mapping[str, Array]]) -> list[BestRow]:
    """Return the row of a region from the errors of its bodies, or nothing without a cell."""
    if not picked:
        return []
    errors = {level: np.concatenate([each[level] for each in picked]) for level in picked[0]}
    stacked = np.array(list(errors.values()))
    known = np.isfinite(stacked).all(axis=0)
    if not known.any():
        return []
    stacked = stacked[:, known]
    rms = np.sqrt((stacked**2).mean(axis=1))
    best, names = int(rms.argmin()), list(errors)
    winner = np.abs(stacked).argmin(axis=0)
    paper = names.index("paper")
    return [
        BestRow(
            quantity,
            region,
            int(known.sum()),
            names[best],
            float(rms[best]),
            share(stacked[best], 10.0),
            100 * float((winner == best).mean()),
            float(rms[paper]),
            share(stacked[paper], 10.0),
        )
    ]


def best_levels(errors: Mapping[str, Array]) -> tuple[NDArray[np.int64], Array]:
    """Return the index of the level of least error in each cell, -1 without any, and the size of that error, %."""
    sizes = np.abs(np.array(list(errors.values())))
    known = np.isfinite(sizes).any(axis=0)
    filled = np.where(np.isfinite(sizes), sizes, np.inf)
    return np.where(known, filled.argmin(axis=0), -1), np.where(known, filled.min(axis=0), np.nan)
