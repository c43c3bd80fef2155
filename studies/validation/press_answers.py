"""Answers to the paper's claims: the rule that makes a verdict, and the answers about presses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from studies.output import records
from studies.output.records import FlatRow
from studies.simulation.comparison_findings import spans
from studies.validation.claim_errors import (
    BOUND,
    MODULI,
    PUBLISHED,
    HeightRow,
    formula,
    relative_errors,
)
from studies.validation.claim_states import FRICTION, Press, States

Verdict = Literal["reproduced", "refuted", "not decidable"]


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to one claim.

    Attributes
    ----------
    claim : the claim in a few words.
    paper : the paper's value.
    computed : our figures, in one cell of a table.
    verdict : whether the figures reproduce or refute the claim, or why neither is possible: the claim depends on
        something that the paper does not state or that the models leave out.
    text : the reasons, in sentences.
    commands : command lines that show parts of the answer.
    figures : the figures under names with units.
    """

    claim: str
    paper: str
    computed: str
    verdict: Verdict
    text: str
    commands: tuple[str, ...]
    figures: dict[str, float]

    def row(self) -> FlatRow:
        """Return the row for JSON."""
        return records.flat(self)

    def printed(self) -> FlatRow:
        """Return the columns of the printed table and of claims.csv."""
        return {"claim": self.claim, "paper": self.paper, "computed": self.computed, "verdict": self.verdict}


def verdict(*, holds: bool, holds_for_other_values: bool = False, figures: Sequence[float] = ()) -> Verdict:
    """Return the verdict on a claim that depends on values which the paper does not give.

    Parameters
    ----------
    holds : whether the claim holds for all values that the paper leaves open.
    holds_for_other_values : whether it holds for some of them.
    figures : those that the other two compare; the claim is not decidable if one is unknown, or if there is none.

    >>> verdict(holds=False, holds_for_other_values=True, figures=[3.0])
    'not decidable'
    >>> verdict(holds=False, figures=[3.0]), verdict(holds=False, figures=[float("nan")]), verdict(holds=True)
    ('refuted', 'not decidable', 'not decidable')
    """
    if not figures or any(math.isnan(figure) for figure in figures):
        return "not decidable"
    if holds:
        return "reproduced"
    return "not decidable" if holds_for_other_values else "refuted"


def least(figures: Iterable[float]) -> float:
    """Return the least figure that is known; NaN if none is."""
    return min((figure for figure in figures if math.isfinite(figure)), default=math.nan)


def most(figures: Iterable[float]) -> float:
    """Return the largest figure that is known; NaN if none is."""
    return max((figure for figure in figures if math.isfinite(figure)), default=math.nan)


PERCENT = 100 * BOUND
CLAIMED = ((1.0, 3.0), (5.0, 9.0), (10.0, 18.0))
"""Moduli, MPa, and the largest forces that the paper gives for them, N (section VI)."""
ROUNDED_N = 0.5
"""Largest difference between a force and the whole number of newtons that the paper gives for it."""


def at_each_depth(rows: Sequence[HeightRow]) -> Answer:
    """Answer the claim on F_N, with the error taken relative to the force of the same depth."""
    complete = [row for row in rows if math.isfinite(row.worst_error_percent)]
    begins = [row.each_depth_from_mm for row in complete if math.isfinite(row.each_depth_from_mm)]
    first = least(begins or [row.reached_mm for row in complete])
    errors = [abs(row.worst_error_percent) for row in complete]
    shallowest = complete[0].worst_at_mm if complete else math.nan
    holds = all(error < PERCENT for error in errors)
    anywhere = any(begin <= shallowest for begin in begins)
    text = (
        f"Relative to the force of the same depth, the formula is off by {least(errors):.0f} to {most(errors):.0f} % "
        f"at {shallowest:g} mm for E = 1 MPa, over all heights of the magnet that reach 3 mm. No modulus changes "
        "this: force (5) with area (7) begins as d^2, that of a round tip as d^1.5 (Hertz), so the relative error "
        f"tends to -100 % at first touch. One modulus keeps every depth within 5 % only from {first:g} mm on, at the "
        "best height."
    )
    return Answer(
        claim="F_N by (5) and (7) against measurement, at each depth to 3 mm",
        paper="error < 5 %",
        computed=f"{least(errors):.0f} to {most(errors):.0f} % at {shallowest:g} mm; within 5 % from {first:g} mm on",
        verdict=verdict(holds=holds, holds_for_other_values=anywhere, figures=errors),
        text=text,
        commands=("magtip compare paper", "magtip compare paper --set E=0.6"),
        figures={
            "least_worst_error_percent": least(errors),
            "largest_worst_error_percent": most(errors),
            "each_depth_from_mm": first,
        },
    )


def of_largest(rows: Sequence[HeightRow], states: States) -> Answer:
    """Answer the claim on F_N, with the error taken relative to the largest force."""
    fitting = [row for row in rows if math.isfinite(row.E_from_MPa)]
    own = next(row for row in rows if row.magnet_height_mm == states.preset.height)
    published = [row for row in fitting if row.E_from_MPa <= PUBLISHED[1] and row.E_to_MPa >= PUBLISHED[0]]
    at_one = [row.error_percent_of_largest for row in rows if math.isfinite(row.error_percent_of_largest)]
    holds = all(error < PERCENT for error in at_one)
    text = (
        f"Relative to the largest force, the error for the paper's E = 1 MPa is {least(at_one):.1f} % without a "
        f"magnet and {own.error_percent_of_largest:.0f} % with one {own.magnet_height_mm:g} mm high: no height "
        "meets 5 %. "
    )
    if any(error < PERCENT for error in at_one):
        text = "Relative to the largest force, some heights of the magnet meet 5 % for the paper's E = 1 MPa. "
    text += _where_it_would_hold(rows, own)
    if published:
        tallest = max(row.magnet_height_mm for row in published)
        text += (
            f" Published moduli of Dragon Skin 30 are {PUBLISHED[0]:g} to {PUBLISHED[1]:g} MPa; they allow magnets "
            f"up to about {tallest:g} mm high. The paper gives neither a test of its silicone nor the magnet's "
            "height, so the agreement may be real or a wrong modulus that makes up for a wrong law."
        )
    text += _friction(states)
    return Answer(
        claim="the same, relative to the largest force",
        paper="error < 5 %",
        computed=f"{least(at_one):.1f} to {most(at_one):.0f} % for E = 1 MPa; {_bands(fitting)}",
        verdict=verdict(holds=holds, holds_for_other_values=bool(fitting), figures=at_one),
        text=text,
        commands=("magtip compare paper --set E=0.6", "magtip compare paper --set magnet_height=3 --set l0=8.4"),
        figures={f"E_from_MPa_at_{row.magnet_height_mm:g}_mm": row.E_from_MPa for row in fitting}
        | {f"E_to_MPa_at_{row.magnet_height_mm:g}_mm": row.E_to_MPa for row in fitting},
    )


def _where_it_would_hold(rows: Sequence[HeightRow], own: HeightRow) -> str:
    """Return in which range of E and of the magnet's height the claim would be true."""
    fitting = [row for row in rows if math.isfinite(row.E_from_MPa)]
    if not fitting:
        return f"It would be true for no modulus from {MODULI[0]:g} to {MODULI[1]:g} MPa."
    low, high = fitting[0], fitting[-1]
    line = (
        f"It would be true in a narrow band: for E from {low.E_from_MPa:.3g} to {low.E_to_MPa:.3g} MPa "
        f"{_with(low.magnet_height_mm)}, falling to {high.E_from_MPa:.3g} to {high.E_to_MPa:.3g} MPa "
        f"{_with(high.magnet_height_mm)}"
    )
    if math.isfinite(own.E_from_MPa) and own not in (low, high):
        line += f" ({own.E_from_MPa:.3g} to {own.E_to_MPa:.3g} MPa {_with(own.magnet_height_mm)})"
    taller = [row.magnet_height_mm for row in rows if row.magnet_height_mm > high.magnet_height_mm]
    return f"{line}; no modulus makes it true with a magnet of {min(taller):g} mm or more." if taller else f"{line}."


def _with(height: float) -> str:
    return f"with a magnet {height:g} mm high" if height else "without a magnet"


def _bands(fitting: Sequence[HeightRow]) -> str:
    if not fitting:
        return "for no E within 5 %"
    shown = [fitting[0], fitting[-1]]
    return "within 5 % for " + ", ".join(
        f"E {row.E_from_MPa:.3g} to {row.E_to_MPa:.3g} MPa at h = {row.magnet_height_mm:g} mm" for row in shown
    )


def _friction(states: States) -> str:
    """Return how much the plate's friction, which the paper does not give, changes the force."""
    preset, rubbed = states.preset, states.rubbed
    change = 100 * (rubbed.force[-1] / preset.force[-1] - 1)
    if not math.isfinite(change):
        return ""
    return (
        f" A plate with a friction coefficient of {FRICTION:g} raises the force at {preset.depth[-1]:g} mm by "
        f"{change:.0f} %, which shifts the band of E by as much."
    )


def voltage(rows: Sequence[HeightRow], own_height: float) -> Answer:
    """Answer the claim on the voltage of S1 against F_N."""
    own = next(row for row in rows if row.magnet_height_mm == own_height)
    best = least(row.least_S1_error_percent for row in rows)
    free = least(row.least_S1_error_any_gain_percent for row in rows)
    with_force = [row for row in rows if math.isfinite(row.E_from_MPa) and row.magnet_height_mm]
    both = [row.best_E_S1_error_any_gain_percent for row in with_force]
    text = (
        f"At equal force and for E = 1 MPa, the voltage of the formulas is off by {own.S1_error_percent:.0f} % "
        "of its "
        f"largest change with the magnet {own_height:g} mm high, up to the formula's force at 3 mm. With the E that "
        f"fits the forces best it is off by {own.best_E_S1_error_percent:.0f} %: the formula lets the magnet sink by "
        f"d H/L from the first touch on, while a round tip takes most of the first depth itself. No E from "
        f"{MODULI[0]:g} to {MODULI[1]:g} MPa and no height brings the error below {best:.1f} %; if the gain of "
        f"S1 is fitted as well, as a calibration would, below {free:.1f} %"
        f"{f' ({least(both):.1f} % with an E that fits the forces)' if both else ''}. "
        "The paper does not give l_t, the deformed distance from the tip to the magnet; that of a uniform bar is "
        "assumed."
    )
    return Answer(
        claim="voltage of S1 against F_N",
        paper="error < 5 % of the maximum",
        computed=f"{own.S1_error_percent:.0f} % for E = 1 MPa; at best {best:.1f} %, with any gain {free:.1f} %",
        verdict=verdict(
            holds=own.S1_error_percent < PERCENT,
            holds_for_other_values=free < PERCENT,
            figures=[own.S1_error_percent, free],
        ),
        text=text,
        commands=("magtip compare paper", "magtip compare paper --set E=0.6"),
        figures={
            "S1_error_percent": own.S1_error_percent,
            "least_S1_error_percent": best,
            "least_S1_error_any_gain_percent": free,
        },
    )


def largest_forces(states: States) -> Answer:
    """Answer the claim on the largest force with an error below 5 %, for three moduli."""
    bare = next((press for press in states.presses if not press.height), states.preset)
    depths = np.linspace(0.0, 3.0, 601)
    by_formula = formula(depths)
    lines: list[str] = []
    figures: dict[str, float] = {}
    for E, force in CLAIMED:
        depth = float(np.interp(force / E, by_formula, depths))
        at = [float(np.interp(depth, press.depth, relative_errors(press))) for press in (bare, states.preset)]
        figures |= {f"depth_mm_at_{force:g}_N": depth, f"error_percent_at_{force:g}_N": at[0]}
        figures[f"error_percent_at_{force:g}_N_with_magnet"] = at[1]
        lines.append(f"{force:g} N at E = {E:g} MPa is {depth:.2f} mm deep, error {at[0]:.0f} % ({at[1]:.0f} %)")
    runs, reach = _spans_within(bare), _largest_force_within(bare)
    reaches = [_largest_force_within(press) for press in states.presses if press.complete]
    as_claimed = [all(abs(E * each - force) <= ROUNDED_N for E, force in CLAIMED) for each in reaches]
    figures["largest_force_N_at_1_MPa"] = reach
    within = (
        f"Without a magnet the formula is within 5 % from {runs[-1][0]:g} to {runs[-1][1]:g} mm, so up to "
        f"{reach:.0f}, {5 * reach:.0f} and {10 * reach:.0f} N for 1, 5 and 10 MPa"
        if runs
        else "Without a magnet the formula is within 5 % at none of the depths"
    )
    own = relative_errors(states.preset)
    with_magnet = (
        "the preset's magnet never lets it come so close"
        if np.abs(own).min() > PERCENT
        else "with the preset's magnet it comes as close somewhere, too"
    )
    text = (
        "In every elastic model with fixed shape, the paper's own (5) included, forces at equal depth are "
        "proportional "
        "to E, and relative errors do not depend on it: 3 N at 1 MPa means 15 and 30 N at 5 and 10 MPa, not 9 and "
        f"18 N. By (5), without the magnet (with it): {'; '.join(lines)}. {within}; {with_magnet}."
    )
    return Answer(
        claim="largest force with error < 5 % for E = 1, 5, 10 MPa",
        paper="3, 9, 18 N",
        computed=f"proportional to E; {reach:.0f}, {5 * reach:.0f}, {10 * reach:.0f} N without a magnet, none with it"
        if runs and np.abs(own).min() > PERCENT
        else "proportional to E",
        verdict=verdict(holds=all(as_claimed), holds_for_other_values=any(as_claimed), figures=reaches),
        text=text,
        commands=("magtip sweep paper --axis E=1,5,10 --axis depth=0.85,1.13,2,3",),
        figures=figures,
    )


def _spans_within(press: Press) -> list[tuple[float, float]]:
    """Return the depths between which the formula with E = 1 MPa is within 5 % of the press, mm."""
    return spans(list(zip(press.depth.tolist(), relative_errors(press).tolist(), strict=True)), PERCENT)


def _largest_force_within(press: Press) -> float:
    """Return the largest force, N, at which the formula with E = 1 MPa is within 5 % of the press; 0 without one."""
    runs = _spans_within(press)
    return float(np.interp(runs[-1][1], press.depth, press.force)) if runs else 0.0
