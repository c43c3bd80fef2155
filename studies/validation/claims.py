"""Answers to the paper's claims: reproduced, refuted or not decidable, with figures computed in the run.

The finite elements have no error that matters here (below 1 %), but they are a model: neo-Hookean silicone, elastic
but for the claim on hysteresis, a rigid bonded magnet, and a plate whose friction the paper does not give. The words
of the answers are in templates/claims.toml. An answer has claim and paper's value in a few words, `computed` figures
in one cell, verdict, text with the reasons, commands that show parts of it, and its figures.
"""

from __future__ import annotations

import functools
import math
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd

from geometry.design import paper
from geometry.messages import Progress
from studies.output import records
from studies.output.result import Result, Table
from studies.simulation.compare import part
from studies.simulation.comparison_findings import spans
from studies.validation import claim_errors, claim_figures, pages, sensor_figures
from studies.validation.claim_errors import (
    BOUND,
    CLAIMED,
    FRICTION,
    MODULI,
    PUBLISHED,
    Extent,
    Press,
    States,
    formula,
)
from studies.validation.pages import Row

WORDS = pages.TEMPLATES / "claims.toml"
FILES = (
    *("CLAIMS.md", "claims.csv", "heights.csv", "presses.csv", "shears.csv", "parts.csv", "modulus_and_height.png"),
    *("figure_6.png", "figure_8.png", "figure_9.png", "figure_11.png", "figure_12.png"),
)
PERCENT = 100 * BOUND
ROUNDED_N = 0.5
"""Largest difference between a force and the whole number of newtons that the paper gives for it."""
LARGE = 10.0
"""Error in % above which an error counts as much larger than the 5 % that the paper claims for presses."""
NEAR = 0.05
"""Relative difference up to which two frequencies count as the same."""
FREQUENCY, BAND = 970.0, 600.0
"""The paper's natural frequency, and the highest frequency at which it used its sensor, Hz (section V.C)."""
HALF_POWER = 0.5**0.5
"""Share of its slow reading to which a sensor's reading falls at the end of its band, as is usual."""
NEODYMIUM = (1.0, 1.4)
"""Polarisations of neodymium magnets, T."""
LOSSES, FULL_SCALE = (0.01, 0.5), 10.0
"""Loss factors from resilient silicones to those that are made to damp; the paper's bound of the hysteresis, %."""
CONSTANTS: dict[str, Any] = {
    "moduli": MODULI,
    "published": PUBLISHED,
    "friction": FRICTION,
    "entries": sensor_figures.table_entries(),
    "claimed": FREQUENCY,
    "band": BAND,
    "half_power": HALF_POWER,
    "losses": LOSSES,
    "neodymium": NEODYMIUM,
    "vibration_depth": sensor_figures.VIBRATION_DEPTH,
    "factor": sensor_figures.FACTOR,
    "depth": sensor_figures.CYCLE_DEPTH,
    "speed": sensor_figures.CYCLE_SPEED,
}
"""What the words of all answers may name; the paper gives neither its plate's friction nor the speed of a loading."""
Verdict = Literal["reproduced", "refuted", "not decidable"]
PRINTED = ["claim", "paper", "computed", "verdict"]
"""Columns of the printed table and of claims.csv."""
SHEARS = ["tip", "shear_mm", "fem_force_x_N", "fem_force_N", "fem_shift_x_mm", "fem_tilt_rad"]
PRESSES = ["magnet_height_mm", "depth_mm", "fem_force_N", "fem_shift_z_mm"]


def run(progress: Progress, store: Path | None = None, *, quick: bool = False) -> Result:
    """Test the paper's claims; states are taken from the store (default: the user's), and added to it."""
    extent = claim_errors.QUICK_EXTENT if quick else Extent()
    states = claim_errors.solve(extent, store, part(progress, 0.0, 0.85))
    heights = pd.DataFrame([claim_errors.height_row(press) for press in states.presses])
    conditions = [rows for _, rows in states.sheared.groupby("tip", sort=False)]
    tips = pd.DataFrame([claim_errors.tip_row(rows) for rows in conditions])
    stuck = [rows for rows in conditions if rows.magnet.iloc[0] == "rigid" and rows.depth_mm.iloc[0]]
    splits = [claim_errors.split(rows) for rows in stuck]
    told = [part(progress, *ends) or progress for ends in ((0.85, 0.88), (0.88, 0.97), (0.97, 1.0))]
    modes = sensor_figures.mode_rows(extent.accuracy, told[0])
    layouts = pd.DataFrame(sensor_figures.layout_rows(extent.layouts, told[1]))
    costs = sensor_figures.cost_rows(extent.reference, told[2])
    factor = sensor_figures.factor_figures()
    best_E = float(heights.best_E_MPa[heights.magnet_height_mm == states.preset.height].iloc[0])
    answers = [
        at_each_depth(heights),
        of_largest(heights, states),
        voltage(heights, states.preset.height),
        shear_force(tips, best_E),
        tilt_as_cause(splits),
        uniqueness(layouts),
        largest_forces(states),
        frequency(modes, sensor_figures.formula_frequencies()),
        band(modes, sensor_figures.response_figures(extent.accuracy)),
        hysteresis(sensor_figures.loop_figures()),
        hall_factor(factor),
        offset(factor),
        cost(costs),
    ]
    printed = [{name: each[name] for name in PRINTED} for each in answers]
    estimates = [press.error_estimate for press in states.presses if np.isfinite(press.force).any()]
    page = {
        "answers": answers,
        "verdicts": printed,
        "heights": pages.records(heights.drop(columns="message")),
        "tips": pages.records(tips),
        "estimate": 100 * float(np.max(estimates or [math.nan])),
        "unknown": pages.records(heights[heights.status != "ok"]),
    }
    tables = {"heights": heights, "presses": states.pressed[PRESSES], "shears": states.sheared[SHEARS]}
    tables["parts"] = pd.concat(splits)
    return Result(
        title="The paper's claims",
        records=answers,
        shown=[Table(title="The paper's claims", rows=printed, first=("claim", "verdict"))],
        tables={"claims": printed} | {name: pages.records(table) for name, table in tables.items()},
        files=claim_figures.pictures(states, best_E),
        pages={"CLAIMS.md": pages.rendered("claims.md.j2", **page)},
    )


def verdict(*, holds: bool, holds_for_other_values: bool = False, figures: Any = ()) -> Verdict:
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
    if not len(figures) or np.isnan(figures).any():
        return "not decidable"
    if holds:
        return "reproduced"
    return "not decidable" if holds_for_other_values else "refuted"


def answer(claim: str, found: Verdict, figures: Mapping[str, float], **values: Any) -> Row:
    """Return the answer to a claim of WORDS, whose templates get CONSTANTS, figures and these values."""
    words = _words()[claim]

    def said(text: str) -> str:
        return " ".join(pages.filled(text, time=_time, **(CONSTANTS | dict(figures) | values)).split())

    return {
        "claim": words["claim"],
        "paper": words["paper"],
        "computed": said(words["computed"]),
        "verdict": found,
        "text": said(words["text"]),
        "commands": [said(command) for command in words["commands"]],
        "figures": {name: getattr(value, "item", lambda value=value: value)() for name, value in figures.items()},
    }


@functools.cache
def _words() -> dict[str, Any]:
    return tomllib.loads(WORDS.read_text("utf-8"))


def _time(seconds: float) -> str:
    """Return a time with two digits in a fitting unit.

    >>> _time(3.2e-6), _time(0.0384), _time(2.0)
    ('3.2 µs', '38 ms', '2 s')
    """
    for factor, unit in ((1.0, "s"), (1e3, "ms")):
        if seconds * factor >= 1:
            return f"{seconds * factor:.2g} {unit}"
    return f"{seconds * 1e6:.2g} µs"


# Presses


def at_each_depth(heights: pd.DataFrame) -> Row:
    """Answer the claim on F_N, with the error taken relative to the force of the same depth."""
    known = heights.dropna(subset="worst_error_percent")
    errors, begins = known.worst_error_percent.abs(), known.each_depth_from_mm.dropna()
    first = (begins if len(begins) else known.reached_mm).min()
    at = known.worst_at_mm.iloc[0] if len(known) else math.nan
    found = verdict(holds=(errors < PERCENT).all(), holds_for_other_values=(begins <= at).any(), figures=errors)
    figures = {"least_worst_error_percent": errors.min(), "largest_worst_error_percent": errors.max()}
    return answer("each_depth", found, figures | {"each_depth_from_mm": first}, at=at)


def of_largest(heights: pd.DataFrame, states: States) -> Row:
    """Answer the claim on F_N, with the error taken relative to the largest force."""
    preset, rubbed = states.preset, states.rubbed
    fitting, at_one = heights.dropna(subset="E_from_MPa"), heights.error_percent_of_largest.dropna()
    own = heights[heights.magnet_height_mm == preset.height].iloc[0]
    published = fitting[(fitting.E_from_MPa <= PUBLISHED[1]) & (fitting.E_to_MPa >= PUBLISHED[0])].magnet_height_mm
    ends = pages.records(fitting.iloc[[0, -1]]) if len(fitting) else []
    at_ends = [row["magnet_height_mm"] for row in ends]
    known = heights.magnet_height_mm[at_one.index]
    return answer(
        "of_largest",
        verdict(holds=(at_one < PERCENT).all(), holds_for_other_values=bool(ends), figures=at_one),
        {
            f"{name}_at_{row['magnet_height_mm']:g}_mm": row[name]
            for name in ("E_from_MPa", "E_to_MPa")
            for row in pages.records(fitting)
        },
        least=at_one.min(),
        most=at_one.max(),
        ends=ends,
        some_meets=(at_one < PERCENT).any(),
        own=own,
        own_between=math.isfinite(own.E_from_MPa) and own.magnet_height_mm not in at_ends,
        taller=known[known > at_ends[-1]].tolist() if ends else [],
        tallest=published.max() if len(published) else None,
        rubbing=100 * (rubbed.force[-1] / preset.force[-1] - 1),
        deepest=preset.depth[-1],
    )


def voltage(heights: pd.DataFrame, own_height: float) -> Row:
    """Answer the claim on the voltage of S1 against F_N."""
    own = heights[heights.magnet_height_mm == own_height].iloc[0]
    figures = {
        "S1_error_percent": own.S1_error_percent,
        "least_S1_error_percent": heights.least_S1_error_percent.min(),
        "least_S1_error_any_gain_percent": heights.least_S1_error_any_gain_percent.min(),
    }
    error, _, free = figures.values()
    with_force = heights[heights.E_from_MPa.notna() & (heights.magnet_height_mm > 0)]
    found = verdict(holds=error < PERCENT, holds_for_other_values=free < PERCENT, figures=[error, free])
    both = with_force.best_E_S1_error_any_gain_percent.min()
    return answer("voltage", found, figures, own=own, with_force=len(with_force), both=both)


def largest_forces(states: States) -> Row:
    """Answer the claim on the largest force with an error below 5 %, for three moduli."""
    bare = next((press for press in states.presses if not press.height), states.preset)
    depths = np.linspace(0.0, 3.0, 601)
    by_formula = formula(depths)
    forces: list[Row] = []
    figures: dict[str, float] = {}
    for E, force in CLAIMED:
        depth = float(np.interp(force / E, by_formula, depths))
        at = [float(np.interp(depth, press.depth, press.relative_errors)) for press in (bare, states.preset)]
        figures |= {f"depth_mm_at_{force:g}_N": depth, f"error_percent_at_{force:g}_N": at[0]}
        figures[f"error_percent_at_{force:g}_N_with_magnet"] = at[1]
        forces.append({"E": E, "force": force, "depth": depth, "errors": at})
    reaches = [_largest_force_within(press) for press in states.presses if press.complete]
    as_claimed = [all(abs(E * each - force) <= ROUNDED_N for E, force in CLAIMED) for each in reaches]
    return answer(
        "largest_forces",
        verdict(holds=all(as_claimed), holds_for_other_values=any(as_claimed), figures=reaches),
        figures | {"largest_force_N_at_1_MPa": _largest_force_within(bare)},
        forces=forces,
        runs=_spans_within(bare),
        never_with_magnet=np.abs(states.preset.relative_errors).min() > PERCENT,
    )


def _spans_within(press: Press) -> list[tuple[float, float]]:
    """Return the depths between which the formula with E = 1 MPa is within 5 % of the press, mm."""
    return spans(list(zip(press.depth.tolist(), press.relative_errors.tolist(), strict=True)), PERCENT)


def _largest_force_within(press: Press) -> float:
    """Return the largest force, N, at which the formula with E = 1 MPa is within 5 % of the press; 0 without one."""
    runs = _spans_within(press)
    return float(np.interp(runs[-1][1], press.depth, press.force)) if runs else 0.0


# Shears and readings


def shear_force(tips: pd.DataFrame, best_E: float) -> Row:
    """Answer the claim that the error of F_mu is large; `best_E` fits the press forces best, MPa."""
    is_stuck = tips.tip.str.contains("stuck")
    stuck, gripped = tips[is_stuck], pages.records(tips[~is_stuck])
    worst = stuck.worst_error_percent.abs()
    return answer(
        "shear_force",
        verdict(holds=worst.min() > LARGE, figures=worst),
        {"least_worst_error_percent": worst.min(), "largest_worst_error_percent": worst.max()},
        tips=pages.records(tips),
        gripped=next(iter(gripped), None),
        needed=stuck.best_E_MPa.dropna().tolist(),
        best_E=best_E,
    )


def tilt_as_cause(splits: Sequence[pd.DataFrame]) -> Row:
    """Answer the claim that the ignored tilt causes the error of F_mu."""
    # a condition of the tip without a sheared state has an unknown share, and leaves the claim open
    shares = [claim_errors.share(rows, "tilt_N") for rows in splits]
    least, largest = (pick(shares) if shares else math.nan for pick in (np.nanmin, np.nanmax))
    figures = {"least_tilt_share_percent": least, "largest_tilt_share_percent": largest}
    known = [pages.records(rows)[-1] for rows in splits if len(rows)]
    return answer("tilt", verdict(holds=bool(least > 50), figures=shares), figures, known=known)


def uniqueness(layouts: pd.DataFrame) -> Row:
    """Answer the claim that the readings are unique to each location."""
    place = ["magnet_height_mm", "c_mm"]
    shares = layouts.ambiguous_percent
    own = (layouts[place] == layouts[place].iloc[0]).all(axis=1)
    failing = pages.records(layouts[shares > 0])
    unique = len(layouts) - len(failing)
    found = verdict(holds=not failing, holds_for_other_values=bool(unique), figures=shares)
    figures = {"unique_cases": unique, "cases": len(layouts)}
    return answer("uniqueness", found, figures, failing=failing, holds_here=not shares[own].any())


# Frequencies and losses


def frequency(rows: Sequence[Row], formulas: dict[str, float]) -> Row:
    """Answer the claim on the natural frequency."""
    free, bare = (
        next(row for row in rows if row["magnet"] == magnet and not row["depth_mm"])
        for magnet in ("rigid", "ignored")
    )
    pressed = max((row for row in rows if row["magnet"] == "rigid"), key=lambda row: row["depth_mm"])
    figures = {"bending_Hz": free["bending_Hz"], "axial_Hz": free["axial_Hz"]}
    figures |= {f"{shape}_without_magnet_Hz": bare[f"{shape}_Hz"] for shape in ("bending", "axial")}
    figures |= {
        "spring_mass_Hz": formulas["third_of_silicone"],
        "spring_mass_with_magnet_Hz": formulas["with_magnet"],
    }
    found = verdict(holds=abs(free["bending_Hz"] / FREQUENCY - 1) <= NEAR, figures=[free["bending_Hz"]])
    return answer("frequency", found, figures, free=free, bare=bare, pressed=pressed, **formulas)


def band(rows: Sequence[Row], vibration: Row) -> Row:
    """Answer the claim that the sensor is usable to 600 Hz and above."""
    by_depth = {row["depth_mm"]: row for row in rows if row["magnet"] == "rigid"}
    deepest = max(by_depth)
    free, pressed = by_depth[0.0]["bending_Hz"], by_depth[deepest]["bending_Hz"]
    # an undamped oscillator amplifies a slow load by 5 % at this frequency
    slow = free * (1 - 1 / 1.05) ** 0.5
    along_z, along_x, accurate = vibration["along_z"], vibration["along_x"], vibration["accurate_Hz"]
    figures = {"accurate_to_Hz": slow, "bending_Hz": free, "pressed_bending_Hz": pressed}
    figures |= {"loss_factor": vibration["loss_factor"], "relative_reading_z_at_600": along_z}
    figures |= {"relative_reading_x_at_600": along_x, "accurate_with_loss_to_Hz": accurate}
    figures |= records.known({"resonance_Hz": vibration["resonance_Hz"], "resonance_Q": vibration["Q"]})
    found = verdict(
        holds=min(slow, accurate) >= BAND,
        holds_for_other_values=not min(along_z, along_x) < HALF_POWER,
        figures=[slow, accurate, along_z, along_x],
    )
    return answer("band", found, figures, pressed_depth=deepest, inside=min(free, pressed) < BAND, **vibration)


def hysteresis(figures: Row) -> Row:
    """Answer the claim on hysteresis."""
    loss_factor = figures["loss_factor"]
    allowed, sine = (FULL_SCALE * loss_factor / figures[name] for name in ("fem_percent", "sine_percent"))
    bounds = {"holds": min(allowed, sine) >= LOSSES[1], "holds_for_other_values": max(allowed, sine) >= LOSSES[0]}
    own = {"loss_factor": loss_factor, "gap_percent": figures["fem_percent"]}
    own |= {"allowed_loss_factor": allowed, "allowed_loss_factor_sine": sine}
    return answer("hysteresis", verdict(**bounds, figures=[allowed, sine]), own, **figures)


# Magnet and cost


def hall_factor(figures: Row) -> Row:
    """Answer the claim on the conversion factor of a Hall element."""
    polarisation = figures["polarisation_T"]
    found = verdict(holds=NEODYMIUM[0] <= polarisation <= NEODYMIUM[1], figures=[polarisation])
    return answer("hall_factor", found, {name: figures[name] for name in ("polarisation_T", "rest_V", "face_V")})


def offset(figures: Row) -> Row:
    """Answer the claim on the offset of S1."""
    pairs = figures["pairs"]
    below = sum(l0 > paper().H for _, l0 in pairs)
    own = {f"l0_mm_at_{height:g}_mm": l0 for height, l0 in pairs} | {"rest_mT": figures["rest_mT"]}
    found = verdict(holds=below > 0, figures=[l0 for _, l0 in pairs])
    return answer("offset", found, own, pairs=pairs, below=below)


def cost(rows: Sequence[Row]) -> Row:
    """Answer the claim that the model is simple and faster than finite elements."""
    formulas, *others = rows
    fastest = min((row for row in rows if row["model"].startswith("finite elements")), key=lambda row: row["seconds"])
    ratio = fastest["seconds"] / formulas["seconds"]
    figures = {f"{row['model'].replace(', level ', '_').replace(' ', '_')}_s": row["seconds"] for row in rows}
    values = {"rows": rows, "paper": formulas, "fastest": fastest, "ratio": ratio}
    values["finite"] = next(row for row in others if row["model"].endswith("finite"))
    return answer("cost", verdict(holds=ratio > 1, figures=[ratio]), figures, **values)
