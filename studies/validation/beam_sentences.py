"""What the study of the beam assumption says, in sentences made from its figures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from studies.simulation.beam_cells import Body, Cells, Columns, errors
from studies.validation.beam_regions import SLENDER, BestRow, ShareRow
from studies.validation.reading_split import PARTS, SplitMean

FORMULAS = {"press force": "formula (5)", "shear force": "formula (6)"}
SHORT = next(iter(SLENDER))
"""Range of the shortest beams."""
SHALLOW = 0.06
"""Depth over D up to which a press is called light."""


def sentences(
    table: Columns,
    grids: Sequence[Cells],
    shares: Sequence[ShareRow],
    best: Sequence[BestRow],
    means: Sequence[SplitMean],
) -> list[str]:
    """Return the findings: where the paper's formulas hold, which level is best, nu, readings, failures."""
    nu = max(grid.body.nu for grid in grids)
    main = [row for row in shares if row.nu == nu]
    lines = overall_sentences(main)
    for quantity in FORMULAS:
        lines += [range_sentence(row) for row in main if (row.quantity, row.level) == (quantity, "paper")]
    lines += light_press_sentence(table, [grid for grid in grids if grid.kind == "press" and grid.body.nu == nu])
    lines += shear_sign_sentence(table, [grid for grid in grids if grid.kind == "shear" and grid.body.nu == nu])
    for quantity in FORMULAS:
        lines += best_sentences([row for row in best if row.quantity == quantity])
    lines += nu_sentences(shares)
    lines += reading_sentences(means)
    lines += buckling_sentences(table, grids)
    return lines


def overall_sentences(rows: Sequence[ShareRow]) -> list[str]:
    """Return in which share of all cells the paper's formula, and level finite, are within 10 %."""
    lines = []
    for quantity, name in FORMULAS.items():
        parts = []
        for level in ("paper", "finite"):
            own = [row for row in rows if (row.quantity, row.level) == (quantity, level)]
            cells = sum(row.cells for row in own)
            if cells:
                share = sum(row.cells * row.within_10_percent for row in own) / cells
                parts.append(f"{name if level == 'paper' else 'level finite'} in {share:.0f} %")
        if parts:
            lines.append(f"{_capital(quantity)}, all bodies: within 10 % are {' and '.join(parts)} of the cells.")
    return lines


def range_sentence(row: ShareRow) -> str:
    """Return where the paper's formula holds for one body."""
    body = Body(row.magnet_height_over_D, row.nu).name
    name = FORMULAS[row.quantity]
    if not row.within_10_percent:
        return (
            f"{_capital(body)}, {row.quantity}: {name} is never within 10 %; its median error is "
            f"{row.median_error_percent:.0f} %."
        )
    five = f"within 5 % {_where(row.within_5_block)} ({row.within_5_percent:.0f} % of all cells)"
    return (
        f"{_capital(body)}, {row.quantity}: {name} is within 10 % {_where(row.within_10_block)} "
        f"({row.within_10_percent:.0f} % of all cells) and {five}; its median error is "
        f"{row.median_error_percent:.0f} %.{_leaning(row)}"
    )


def _leaning(row: ShareRow) -> str:
    """Return how many of the presses within 10 % a tip that slides freely would not reach."""
    if not row.leaning_of_these_percent > 0:
        return ""
    return (
        f" But {row.leaning_of_these_percent:.0f} % of the cells within 10 % are presses at which a tip that slides "
        "freely has buckled sideways."
    )


def _where(block: str) -> str:
    return block if block == "nowhere" else f"for {block}"


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def light_press_sentence(table: Columns, grids: Sequence[Cells]) -> list[str]:
    """Return the errors of formula (5) in light presses."""
    values = [errors(table, grid, "paper", "press force")[grid.loads[:, 0] <= SHALLOW].ravel() for grid in grids]
    known = np.concatenate(values) if values else np.empty(0)
    known = known[np.isfinite(known)]
    if not len(known):
        return []
    line = (
        f"In light presses (d/D to {SHALLOW:g}) formula (5) is off by {known.min():+.0f} to {known.max():+.0f} %: "
        "with its area (7) the whole beam is as narrow as its contact, which begins at a point."
    )
    return [line]


def shear_sign_sentence(table: Columns, grids: Sequence[Cells]) -> list[str]:
    """Return how often formula (6) is too stiff."""
    values = [errors(table, grid, "paper", "shear force").ravel() for grid in grids]
    known = np.concatenate(values) if values else np.empty(0)
    known = known[np.isfinite(known)]
    if not len(known):
        return []
    line = (
        f"Formula (6) is too stiff in {100 * (known > 0).mean():.0f} % of the shears: it ignores the compression by "
        "the press, the shear of a thick beam and the contact that gives way."
    )
    return [line]


def best_sentences(rows: Sequence[BestRow]) -> list[str]:
    """Return which level of the formulas is best in how many regions, and where the paper's is."""
    if not rows:
        return []
    quantity = rows[0].quantity
    names = sorted({row.best_level for row in rows}, key=lambda name: -sum(row.best_level == name for row in rows))
    counts = ", ".join(f"{name} in {sum(row.best_level == name for row in rows)}" for name in names)
    lines = [f"Best level for the {quantity}, of {len(rows)} regions (body, slenderness, depth): {counts}."]
    wins = [row.region for row in rows if row.best_level == "paper"]
    if wins:
        lines.append(f"The paper's formula is the best for the {quantity} only in: {'; '.join(wins)}.")
    good = [row for row in rows if row.rms_error_percent <= 10]
    poor = [row.region for row in rows if row.rms_error_percent > 10]
    lines.append(
        f"The best level has a root mean square error within 10 % in {len(good)} of these regions"
        + (f"; beyond that only finite elements help: {'; '.join(poor)}." if poor else ".")
    )
    return lines


def nu_sentences(shares: Sequence[ShareRow]) -> list[str]:
    """Return how the share within 10 % changes with Poisson's ratio."""
    lines = []
    heights = {row.magnet_height_over_D for row in shares}
    for height in sorted(heights):
        for quantity, name in FORMULAS.items():
            own = [
                row
                for row in shares
                if (row.quantity, row.level, row.magnet_height_over_D) == (quantity, "paper", height)
            ]
            if len(own) > 1 and any(row.within_10_percent for row in own):
                parts = ", ".join(f"{row.within_10_percent:.0f} % at nu = {row.nu:g}" for row in own)
                body = Body(height, own[0].nu).name
                lines.append(f"Poisson's ratio, {body}, {quantity}: {name} is within 10 % in {parts} of the cells.")
    return lines


def reading_sentences(means: Sequence[SplitMean]) -> list[str]:
    """Return which part of the error of the readings is largest, by kind of load and range of L/D."""
    lines = []
    for load in dict.fromkeys(row.load for row in means):
        for slenderness in dict.fromkeys(row.slenderness for row in means):
            own = [row for row in means if (row.load, row.slenderness) == (load, slenderness)]
            if not own:
                continue
            weights = [row.states for row in own]
            rms = {
                part: float(
                    np.sqrt(np.average([getattr(row, f"{part}_percent_FS") ** 2 for row in own], weights=weights))
                )
                for part in PARTS
            }
            lines.append(
                f"Readings in a {load}, {slenderness}: the paper's are off by {rms['total']:.0f} % of full scale "
                f"(rms). The mechanics contribute {rms['mechanics']:.0f} %, the ignored tilt {rms['tilt']:.0f} % and "
                f"the field (3) {rms['field']:.0f} %; a dipole in its place would add {rms['dipole']:.0f} %."
            )
    if any(row.slenderness == SHORT for row in means):
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
