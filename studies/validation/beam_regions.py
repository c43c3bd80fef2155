"""Regions in which a formula stays within 5 % or 10 %, the best level in each region, and what follows from them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from studies.simulation.beam_cells import QUANTITIES, Body, Bools, Cells, Columns, Kind, all_errors, errors
from studies.validation.pages import Row
from studies.validation.reading_split import PARTS

BOUNDS = (5.0, 10.0)
"""Errors that bound a region, %."""


class Block(NamedTuple):
    """Neighbouring lengths and loads: first and last index of each."""

    first_load: int
    last_load: int
    first_length: int
    last_length: int

    @property
    def size(self) -> int:
        """Number of cells."""
        return (self.last_load - self.first_load + 1) * (self.last_length - self.first_length + 1)


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
                if best is None or (block.size, end - begin) > (best.size, best.last_length - best.first_length):
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


def share_rows(table: Columns, grids: Sequence[Cells]) -> list[Row]:
    """Return a row for each quantity, level and body: shares of the judged cells within the bounds, errors, blocks.

    `leaning_of_these_percent` is the share of the cells within 10 % that are deeper than the critical depth of a free
    tip; a block is the largest one of neighbouring cells within the bound, in words.
    """
    rows = []
    for grid in grids:
        for quantity in QUANTITIES[grid.kind]:
            for level, error in all_errors(table, grid, quantity).items():
                known = error[np.isfinite(error)]
                if not len(known):
                    continue
                near = np.abs(error) <= BOUNDS[-1]
                five, ten = (block_text(grid, largest_block(np.abs(error) <= bound)) for bound in BOUNDS)
                place = {"quantity": quantity, "level": level, "magnet_height_over_D": grid.body.height}
                row = place | {"nu": grid.body.nu, "cells": len(known)}
                row |= {"within_5_percent": share(error, BOUNDS[0]), "within_10_percent": share(error, BOUNDS[1])}
                row["leaning_of_these_percent"] = 100 * float(grid.leans[near].mean()) if near.any() else math.nan
                row["median_error_percent"] = float(np.median(np.abs(known)))
                row["largest_error_percent"] = float(known[np.abs(known).argmax()])
                rows.append(row | {"within_5_block": five, "within_10_block": ten})
    return rows


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


def best_rows(table: Columns, grids: Sequence[Cells]) -> list[Row]:
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


def best_row(quantity: str, region: str, picked: Sequence[Mapping[str, Array]]) -> list[Row]:
    """Return the row of a region from the errors of its bodies, or nothing without a cell.

    The best level has the least root mean square error; `best_in_percent` is the share of the region's cells in which
    it has the least error of all levels.
    """
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
    figures = {"quantity": quantity, "region": region, "cells": int(known.sum()), "best_level": names[best]}
    row = figures | {"rms_error_percent": float(rms[best]), "within_10_percent": share(stacked[best], 10.0)}
    row |= {"best_in_percent": 100 * float((winner == best).mean()), "paper_rms_error_percent": float(rms[paper])}
    return [row | {"paper_within_10_percent": share(stacked[paper], 10.0)}]


def best_levels(errors: Mapping[str, Array]) -> tuple[NDArray[np.int64], Array]:
    """Return the index of the level of least error in each cell, -1 without any, and the size of that error, %."""
    sizes = np.abs(np.array(list(errors.values())))
    known = np.isfinite(sizes).any(axis=0)
    filled = np.where(np.isfinite(sizes), sizes, np.inf)
    return np.where(known, filled.argmin(axis=0), -1), np.where(known, filled.min(axis=0), np.nan)


# Sentences

FORMULAS = {"press force": "formula (5)", "shear force": "formula (6)"}
SHORT = next(iter(SLENDER))
"""Range of the shortest beams."""
SHALLOW = 0.06
"""Depth over D up to which a press is called light."""


def sentences(table: Columns, grids: Sequence[Cells], shares: Sequence[Row], means: Sequence[Row]) -> list[str]:
    """Return the findings that the tables do not show: where the paper's formulas hold, readings, failures."""
    nu = max(grid.body.nu for grid in grids)
    main = [row for row in shares if row["nu"] == nu]
    presses, shears = ([g for g in grids if (g.kind, g.body.nu) == (kind, nu)] for kind in ("press", "shear"))
    lines = overall_sentences(main)
    for quantity in FORMULAS:
        lines += [range_sentence(row) for row in main if (row["quantity"], row["level"]) == (quantity, "paper")]
    lines += light_press_sentence(table, presses) + shear_sign_sentence(table, shears)
    return lines + reading_sentences(means) + buckling_sentences(table, grids)


def overall_sentences(rows: Sequence[Row]) -> list[str]:
    """Return in which share of all cells the paper's formula, and level finite, are within 10 %."""
    lines = []
    for quantity, name in FORMULAS.items():
        parts = []
        for level in ("paper", "finite"):
            own = [row for row in rows if (row["quantity"], row["level"]) == (quantity, level)]
            cells = sum(row["cells"] for row in own)
            if cells:
                share = sum(row["cells"] * row["within_10_percent"] for row in own) / cells
                parts.append(f"{name if level == 'paper' else 'level finite'} in {share:.0f} %")
        if parts:
            lines.append(f"{_capital(quantity)}, all bodies: within 10 % are {' and '.join(parts)} of the cells.")
    return lines


def range_sentence(row: Row) -> str:
    """Return where the paper's formula holds for one body."""
    body = Body(row["magnet_height_over_D"], row["nu"]).name
    name = FORMULAS[row["quantity"]]
    if not row["within_10_percent"]:
        return (
            f"{_capital(body)}, {row['quantity']}: {name} is never within 10 %; its median error is "
            f"{row['median_error_percent']:.0f} %."
        )
    five = f"within 5 % {_where(row['within_5_block'])} ({row['within_5_percent']:.0f} % of all cells)"
    return (
        f"{_capital(body)}, {row['quantity']}: {name} is within 10 % {_where(row['within_10_block'])} "
        f"({row['within_10_percent']:.0f} % of all cells) and {five}; its median error is "
        f"{row['median_error_percent']:.0f} %.{_leaning(row)}"
    )


def _leaning(row: Row) -> str:
    """Return how many of the presses within 10 % a tip that slides freely would not reach."""
    if not row["leaning_of_these_percent"] > 0:
        return ""
    return (
        f" But {row['leaning_of_these_percent']:.0f} % of the cells within 10 % are presses at which a tip that "
        "slides freely has buckled sideways."
    )


def _where(block: str) -> str:
    return block if block == "nowhere" else f"for {block}"


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def _known(values: Sequence[Array]) -> Array:
    """Return all finite values of several arrays, shape (n,)."""
    known = np.concatenate([np.empty(0), *(array.ravel() for array in values)])
    return np.asarray(known[np.isfinite(known)])


def light_press_sentence(table: Columns, grids: Sequence[Cells]) -> list[str]:
    """Return the errors of formula (5) in light presses."""
    known = _known([errors(table, grid, "paper", "press force")[grid.loads[:, 0] <= SHALLOW] for grid in grids])
    if not len(known):
        return []
    line = (
        f"In light presses (d/D to {SHALLOW:g}) formula (5) is off by {known.min():+.0f} to {known.max():+.0f} %: "
        "with its area (7) the whole beam is as narrow as its contact, which begins at a point."
    )
    return [line]


def shear_sign_sentence(table: Columns, grids: Sequence[Cells]) -> list[str]:
    """Return how often formula (6) is too stiff."""
    known = _known([errors(table, grid, "paper", "shear force") for grid in grids])
    if not len(known):
        return []
    line = (
        f"Formula (6) is too stiff in {100 * (known > 0).mean():.0f} % of the shears: it ignores the compression by "
        "the press, the shear of a thick beam and the contact that gives way."
    )
    return [line]


def reading_sentences(means: Sequence[Row]) -> list[str]:
    """Return which part of the error of the readings is largest, by kind of load and range of L/D."""
    lines = []
    for load in dict.fromkeys(row["load"] for row in means):
        for slenderness in dict.fromkeys(row["slenderness"] for row in means):
            own = [row for row in means if (row["load"], row["slenderness"]) == (load, slenderness)]
            if not own:
                continue
            weights = [row["states"] for row in own]
            rms = {
                part: float(np.sqrt(np.average([row[f"{part}_percent_FS"] ** 2 for row in own], weights=weights)))
                for part in PARTS
            }
            lines.append(
                f"Readings in a {load}, {slenderness}: the paper's are off by {rms['total']:.0f} % of full scale "
                f"(rms). The mechanics contribute {rms['mechanics']:.0f} %, the ignored tilt {rms['tilt']:.0f} % and "
                f"the field (3) {rms['field']:.0f} %; a dipole in its place would add {rms['dipole']:.0f} %."
            )
    if any(row["slenderness"] == SHORT for row in means):
        lines.append(
            f"In beams of {SHORT} the magnet lies just above the base and hardly sinks, so that full scale is small "
            "and errors exceed it; the paper's elements do not suit such beams."
        )
    return lines


def buckling_sentences(table: Columns, grids: Sequence[Cells]) -> list[str]:
    """Return what the finite elements did not reach, what gave way, and where a free tip would buckle."""
    presses, shears = ([grid for grid in grids if grid.kind == kind] for kind in ("press", "shear"))
    lines = []
    leaning, judged = (
        (
            sum(int(flags.sum()) for flags in each)
            for each in zip(*((g.leans & g.judged, g.judged) for g in presses), strict=True)
        )
        if presses
        else (0, 0)
    )
    if leaning:
        lines.append(
            f"{leaning} of {judged} presses are deeper than a tip that slides freely on the plate could go without "
            "buckling sideways; there the errors are those of a press that holds the tip on the axis."
        )
    given = sum(int(grid.gave_way.sum()) for grid in shears)
    if given:
        lines.append(
            f"In {given} of {sum(int(grid.answered.sum()) for grid in shears)} shears the pressed beam gives way: it "
            "no longer resists the shear, no formula error is stated, and the maps are hatched."
        )
    failed = sum(int((grid.possible & ~grid.answered).sum()) for grid in grids)
    impossible = sum(int((~grid.possible).sum()) for grid in grids)
    cells = sum(grid.row.size for grid in grids)
    lines.append(
        f"Of {cells} cells the finite elements did not reach {failed}, and {impossible} are impossible because the "
        "magnet does not fit the beam or leaves less silicone than the depth."
    )
    return lines
