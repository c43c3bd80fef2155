"""Answers to the paper's claims: reproduced, refuted or not decidable, with figures computed in the run.

The finite elements have no error that matters here (below 1 %), but they are a model: neo-Hookean silicone, elastic
but for the claim on hysteresis, a rigid bonded magnet, and a plate whose friction the paper does not give.
Each claim has a function that says on which figures its verdict rests and when it holds; templates/claims.toml has
their words, the values of the paper and the loads.
"""

import dataclasses
import functools
import math
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, cast, get_args

import numpy as np
import pandas as pd

from analytic import beam
from analytic.magnet import cylinder_field
from analytic.oscillator import spring_mass
from analytic.relaxation_loops import loop
from fem import equilibrium
from fem.accuracy import LEVELS, QUICK, STANDARD, Accuracy
from fem.analyses.modes import modes
from geometry.design import paper
from geometry.loads import Load, Magnet
from geometry.messages import Progress
from geometry.relaxation import relaxation_of
from studies.inputs.option_groups import Elements
from studies.inputs.user_input import AccuracyName
from studies.mechanics import loading_cycles
from studies.mechanics.cycle_motion import Motion
from studies.output import page_templates
from studies.output.records import known
from studies.output.result import Result
from studies.quantities import shown
from studies.sensing import layout_uniqueness
from studies.simulation import vibration_report
from studies.simulation.compare import part
from studies.simulation.comparison_rows import spans
from studies.validation import pages
from studies.validation.formulas import claim_errors, claim_figures
from studies.validation.formulas.claim_errors import BOUND, CLAIMED, EXTENTS, VALUES, WORDS, Press, States, formula
from studies.validation.pages import Row

FILES = (
    *("CLAIMS.md", "claims.csv", "heights.csv", "presses.csv", "shears.csv", "parts.csv", "modulus_and_height.png"),
    *("figure_6.png", "figure_8.png", "figure_9.png", "figure_11.png", "figure_12.png"),
)
PERCENT = 100 * BOUND
MU0 = 4e-7 * math.pi
"""Permeability of air in the paper's Table II; with its magnetisation M = 1 it is also the polarisation mu0 M, T."""
SHEARS = ["tip", "shear_mm", "fem_force_x_N", "fem_force_N", "fem_shift_x_mm", "fem_tilt_rad"]
PRESSES = ["magnet_height_mm", "depth_mm", "fem_force_N", "fem_shift_z_mm"]


def run(progress: Progress, store: Path | None = None, *, quick: bool = False) -> Result:
    """Test each claim of the paper: reproduced, refuted or not decidable, with figures and the paper's plots redrawn.

    Parameters
    ----------
    quick
        Use few loads and coarser meshes: some seconds instead of some minutes.
    store
        File of solved states, to which new ones are added; default: that of the user.
    """
    extent = EXTENTS["quick" if quick else "full"]
    accuracy = LEVELS[extent["accuracy"]]
    states = claim_errors.solve(extent, store, part(progress, 0.0, 0.85))
    heights = pd.DataFrame([claim_errors.height_row(press) for press in states.presses])
    conditions = [rows for _, rows in states.sheared.groupby("tip", sort=False)]
    tips = pd.DataFrame([claim_errors.tip_row(rows) for rows in conditions])
    stuck = [rows for rows in conditions if rows.magnet.iloc[0] == "rigid" and rows.depth_mm.iloc[0]]
    splits = [claim_errors.split(rows) for rows in stuck]
    told = [part(progress, *ends) or progress for ends in ((0.85, 0.88), (0.88, 0.97), (0.97, 1.0))]
    vibrations, factor = mode_rows(accuracy, told[0]), factor_figures()
    best_E = float(heights.best_E_MPa[heights.magnet_height_mm == states.preset.height].iloc[0])
    answers = [
        at_each_depth(heights),
        of_largest(heights, states),
        voltage(heights, states.preset.height),
        shear_force(tips, best_E),
        tilt_as_cause(splits),
        uniqueness(pd.DataFrame(layout_rows(extent["layouts"], told[1]))),
        largest_forces(states),
        frequency(vibrations),
        band(vibrations, response_figures(accuracy)),
        hysteresis(**loop_figures(extent["step_error"])),
        hall_factor(factor),
        offset(factor),
        cost(cost_rows(LEVELS[extent["reference"]], told[2])),
    ]
    printed = [{name: each[name] for name in ("claim", "paper", "computed", "verdict")} for each in answers]
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
    more: Row = {"tables": {"claims": printed} | {name: pages.records(table) for name, table in tables.items()}}
    more["tables"]["parts"] = pages.records(pd.concat(splits))
    more |= {"records": answers, "files": claim_figures.pictures(states, best_E, extent["points"])}
    return pages.study("claims", "The paper's claims", printed, page, look={"first": ("claim", "verdict")}, **more)


def verdict_of(rests_on: Sequence[Any], holds: bool, may_hold: bool = False) -> str:
    """Return whether a claim holds, from the figures on which that rests.

    It is not decidable if one of them is unknown, if there is none, or if the claim holds only for some of the values
    that the paper leaves open (`may_hold`).

    >>> verdict_of([1.0], True), verdict_of([1.0], False, may_hold=True), verdict_of([math.nan], True)
    ('reproduced', 'not decidable', 'not decidable')
    """
    figures = np.hstack([np.ravel(np.asarray(each, dtype=float)) for each in rests_on])
    if not figures.size or np.isnan(figures).any() or (may_hold and not holds):
        return "not decidable"
    return "reproduced" if holds else "refuted"


def answer(claim: str, verdict: str, more: Mapping[str, float] = {}, **values: Any) -> Row:
    """Return the answer to a claim of WORDS, whose templates get VALUES, these values and `more`.

    Its figures are those that WORDS names, and `more`.
    """
    words, given = WORDS[claim], VALUES | values | more

    def said(text: str) -> str:
        return " ".join(page_templates.filled(text, time=_time, **given).split())

    figures = known({name: given[name] for name in words.get("figures", ())} | dict(more))
    return {
        "claim": words["claim"],
        "paper": words["paper"],
        "computed": said(words["computed"]),
        "verdict": verdict,
        "text": said(words["text"]),
        "commands": [said(command) for command in words["commands"]],
        "figures": {name: getattr(value, "item", lambda value=value: value)() for name, value in figures.items()},
    }


def _time(seconds: float) -> str:
    """Return a time with two digits in a fitting unit.

    >>> _time(3.2e-6), _time(0.0384), _time(2.0)
    ('3.2 µs', '38 ms', '2 s')
    """
    return shown(seconds, "s" if seconds >= 1 else "ms" if seconds >= 1e-3 else "us", 2)


# Presses


def at_each_depth(heights: pd.DataFrame) -> Row:
    reached = heights.dropna(subset="worst_error_percent")
    errors, begins = reached.worst_error_percent.abs(), reached.each_depth_from_mm.dropna()
    at = reached.worst_at_mm.iloc[0] if len(reached) else math.nan
    # another modulus of the silicone may bring the error of every depth from there on within the bound
    other_modulus = bool((begins <= at).any())
    return answer(
        "each_depth",
        verdict_of([errors.max()], errors.max() < PERCENT, other_modulus),
        least_worst_error_percent=errors.min(),
        largest_worst_error_percent=errors.max(),
        each_depth_from_mm=(begins if len(begins) else reached.reached_mm).min(),
        at=at,
    )


def of_largest(heights: pd.DataFrame, states: States) -> Row:
    preset, fitting = states.preset, heights.dropna(subset="E_from_MPa")
    at_one = heights.error_percent_of_largest.dropna()
    own = heights[heights.magnet_height_mm == preset.height].iloc[0]
    low, high = VALUES["published"]
    published = fitting[(fitting.E_from_MPa <= high) & (fitting.E_to_MPa >= low)].magnet_height_mm
    ends = pages.records(fitting.iloc[[0, -1]]) if len(fitting) else []
    at_ends = [row["magnet_height_mm"] for row in ends]
    reached = heights.magnet_height_mm[at_one.index]
    return answer(
        "of_largest",
        verdict_of([at_one.max()], at_one.max() < PERCENT, bool(ends)),
        {
            f"{name}_at_{row['magnet_height_mm']:g}_mm": row[name]
            for name in ("E_from_MPa", "E_to_MPa")
            for row in pages.records(fitting)
        },
        least=at_one.min(),
        most=at_one.max(),
        ends=ends,
        own=own,
        own_between=math.isfinite(own.E_from_MPa) and own.magnet_height_mm not in at_ends,
        taller=reached[reached > at_ends[-1]].tolist() if ends else [],
        tallest=published.max() if len(published) else None,
        rubbing=100 * (states.rubbed.force[-1] / preset.force[-1] - 1),
        deepest=preset.depth[-1],
    )


def voltage(heights: pd.DataFrame, own_height: float) -> Row:
    own = heights[heights.magnet_height_mm == own_height].iloc[0]
    with_force = heights[heights.E_from_MPa.notna() & (heights.magnet_height_mm > 0)]
    error, least = own.S1_error_percent, heights.least_S1_error_any_gain_percent.min()
    return answer(
        "voltage",
        verdict_of([error, least], error < PERCENT, least < PERCENT),
        own=own,
        S1_error_percent=error,
        least_S1_error_percent=heights.least_S1_error_percent.min(),
        least_S1_error_any_gain_percent=least,
        with_force=len(with_force),
        both=with_force.best_E_S1_error_any_gain_percent.min(),
    )


def largest_forces(states: States) -> Row:
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
    as_claimed = [all(abs(E * each - force) <= VALUES["rounded_N"] for E, force in CLAIMED) for each in reaches]
    figures["largest_force_N_at_1_MPa"] = _largest_force_within(bare)
    never = np.abs(states.preset.relative_errors).min() > PERCENT
    verdict = verdict_of([reaches], all(as_claimed), any(as_claimed))
    given: Row = {"forces": forces, "runs": _spans_within(bare), "never_with_magnet": never}
    return answer("largest_forces", verdict, figures, **given)


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
        verdict_of([worst], worst.min() > VALUES["large"]),
        least_worst_error_percent=worst.min(),
        largest_worst_error_percent=worst.max(),
        tips=pages.records(tips),
        gripped=next(iter(gripped), None),
        needed=stuck.best_E_MPa.dropna().tolist(),
        best_E=best_E,
    )


def tilt_as_cause(splits: Sequence[pd.DataFrame]) -> Row:
    # a condition of the tip without a sheared state has an unknown share, and leaves the claim open
    shares = [claim_errors.share(rows, "tilt_N") for rows in splits]
    least, largest = (pick(shares) if shares else math.nan for pick in (np.nanmin, np.nanmax))
    last = [pages.records(rows)[-1] for rows in splits if len(rows)]
    ends = {"least_tilt_share_percent": least, "largest_tilt_share_percent": largest}
    return answer("tilt", verdict_of([shares], least > 50), ends, known=last)


def uniqueness(layouts: pd.DataFrame) -> Row:
    place = ["magnet_height_mm", "c_mm"]
    shares = layouts.ambiguous_percent
    own = (layouts[place] == layouts[place].iloc[0]).all(axis=1)
    failing = pages.records(layouts[shares > 0])
    counts = {"unique_cases": len(layouts) - len(failing), "cases": len(layouts)}
    verdict = verdict_of([shares], not failing, len(failing) < len(layouts))
    return answer("uniqueness", verdict, counts, failing=failing, holds_here=not shares[own].any())


def layout_rows(layouts: Sequence[tuple[float, float]], progress: Progress) -> list[Row]:
    """Return the share of poses whose readings another pose gives too, for each layout and form of the readings.

    A layout is a height of the magnet, and a height c of S2 and S3, mm; l0 follows from what S1 reads at rest.
    """
    rows, told = [], list(product(layouts, layout_uniqueness.FORMS))
    for k, ((height, c), form) in enumerate(told):
        progress(k / len(told), f"readings of a magnet {height:g} mm high, c = {c:g} mm")
        design = dataclasses.replace(claim_errors.with_magnet(height), c=c)
        figures = layout_uniqueness.alike_figures(design, form)
        place = {"magnet_height_mm": height, "l0_mm": design.l0, "c_mm": c, "readings": form}
        rows.append(place | {"ambiguous_percent": figures["alike_percent"], "apart_mm": figures["alike_apart_mm"]})
    return rows


# Frequencies and losses


def mode_rows(accuracy: Accuracy, progress: Progress) -> list[Row]:
    rows = []
    for k, (depth, magnet) in enumerate(product((0.0, 1.0), get_args(Magnet))):
        progress(k / 4, "frequencies")
        result = modes(paper(), magnet, 6, depth=depth, accuracy=accuracy)
        first = {f"{name}_Hz": result.frequency[result.shape.index(name)] for name in ("bending", "axial")}
        rows.append({"magnet": magnet, "depth_mm": depth, **first})
    return rows


def frequency(rows: Sequence[Row]) -> Row:
    free, bare = (
        next(row for row in rows if row["magnet"] == magnet and not row["depth_mm"])
        for magnet in ("rigid", "ignored")
    )
    pressed = max((row for row in rows if row["magnet"] == "rigid"), key=lambda row: row["depth_mm"])
    figures = {f"{shape}_Hz": free[f"{shape}_Hz"] for shape in ("bending", "axial")}
    figures |= {f"{shape}_without_magnet_Hz": bare[f"{shape}_Hz"] for shape in ("bending", "axial")}
    figures |= dict(zip(("spring_mass_Hz", "spring_mass_with_magnet_Hz"), spring_mass(paper()), strict=True))
    near = abs(free["bending_Hz"] / VALUES["claimed"] - 1) <= VALUES["near"]
    verdict = verdict_of([free["bending_Hz"]], near)
    return answer("frequency", verdict, figures, free=free, bare=bare, pressed=pressed)


def response_figures(accuracy: Accuracy) -> Row:
    """Return what `magtip response` says of the paper's sensor with the loss factor of the preset.

    The relative readings are those per N at 600 Hz over those at 1 Hz: of S1 by a force along z, of S2 by one along
    x. The resonance is that of the magnet under a force along x, None if there is none. Up to
    accurate_with_loss_to_Hz both readings change by less than 5 %.
    """
    design, load, band = paper(), Load(VALUES["vibration_depth"], friction="stick"), tuple(VALUES["vibration_band"])
    elements = Elements(accuracy=cast(AccuracyName, accuracy.name))
    result = vibration_report.run(design, load, (band[0], band[1]), 2, elements, [], lambda *_: None)
    z, x = (next(one for one in result.records if one["motion"] == axis) for axis in "zx")
    read = [(z, z["element"].index("S1")), (x, x["element"].index("S2"))]
    gains = [motion["relative_reading_at_600"][k] or math.nan for motion, k in read]
    flat = [motion["accurate_per_N_Hz"][k] for motion, k in read]
    found = {f"relative_reading_{axis}_at_600": gain for axis, gain in zip("zx", gains, strict=True)}
    found |= {f"resonance_{name}": next(iter(x[f"resonance_per_N_{name}"]), None) for name in ("Hz", "Q")}
    least = min((one for one in flat if one is not None), default=band[1])
    return found | {"loss_factor": design.loss_factor, "accurate_with_loss_to_Hz": least}


def band(rows: Sequence[Row], vibration: Row) -> Row:
    by_depth = {row["depth_mm"]: row["bending_Hz"] for row in rows if row["magnet"] == "rigid"}
    deepest, free = max(by_depth), by_depth[0.0]
    # an undamped oscillator amplifies a slow load by 5 % at this frequency
    slow = free * (1 - 1 / 1.05) ** 0.5
    places = {"bending_Hz": free, "pressed_bending_Hz": by_depth[deepest], "accurate_to_Hz": slow}
    ends = slow, vibration["accurate_with_loss_to_Hz"]
    read = [vibration[f"relative_reading_{axis}_at_600"] for axis in "zx"]
    holds, may_hold = min(ends) >= VALUES["band"], min(read) >= VALUES["half_power"]
    return answer("band", verdict_of([*ends, *read], holds, may_hold), **places, pressed_depth=deepest, **vibration)


def loop_figures(step_error: float) -> Row:
    """Return the gap at mid-stroke over full scale of a slow loading cycle, percent, with the preset's loss factor.

    It is that of the second cycle of a press by viscoelastic finite elements at level quick, and that of the steady
    cycle of a viscoelastic spring, of a triangle and of a sine; `step_error` is that of a time step.
    """
    design = paper()
    motion = Motion(VALUES["depth"], 0.0, "none", VALUES["speed"] / (2 * VALUES["depth"]), cycles=2)
    static = loading_cycles.Static()
    cycles = loading_cycles.run(design, motion, static, "quick", "rigid", step_error, lambda *_: None)
    relaxation = relaxation_of(design)
    spring, sine = (loop(relaxation, motion.frequency, form).hysteresis for form in ("triangle", "sine"))
    found = {"loss_factor": design.loss_factor, "gap_percent": cycles.loops[-1]["gap_percent"]}
    return found | {"spring_percent": 100 * spring, "sine_percent": 100 * sine}


def hysteresis(loss_factor: float, gap_percent: float, spring_percent: float, sine_percent: float) -> Row:
    allowed, sine = (VALUES["full_scale"] * loss_factor / percent for percent in (gap_percent, sine_percent))
    gaps: Row = {"loss_factor": loss_factor, "gap_percent": gap_percent, "spring_percent": spring_percent}
    least, most = VALUES["losses"]
    verdict = verdict_of([allowed, sine], min(allowed, sine) >= most, max(allowed, sine) >= least)
    return answer("hysteresis", verdict, **gaps, allowed_loss_factor=allowed, allowed_loss_factor_sine=sine)


# Magnet and cost


def factor_figures() -> Row:
    """Return what the paper's factor and its magnetisation M = 1 imply.

    rest_mT is the flux density at S1 that 2.87 V mean for an SS495A, polarisation_T that of a magnet whose field
    gives an SS495A the voltages of the factor. rest_V and face_V are the change of S1's voltage by the factor at the
    preset's distance, and if S1 touched the magnet's face; pairs are heights of the magnet and distances l0 that give
    2.87 V for J = 1.2 T, mm.
    """
    design, factor = paper(), VALUES["factor"]

    def by_factor(distance: float) -> float:
        magnet = design.magnet_diameter / 2, design.magnet_height, MU0
        return float(factor * cylinder_field(np.array([[0.0, 0.0, distance]]), *magnet)[0, 2])

    return {
        "rest_mT": 1e3 * (VALUES["S1_at_rest"] - design.hall_null) / design.hall_gain,
        "polarisation_T": factor * MU0 / design.hall_gain,
        "rest_V": by_factor(design.l0),
        "face_V": by_factor(design.magnet_height / 2),
        "pairs": [(height, claim_errors.with_magnet(height).l0) for height in (1.0, 2.0, 3.0, 4.0)],
    }


def hall_factor(figures: Row) -> Row:
    low, high = VALUES["neodymium"]
    polarisation = figures["polarisation_T"]
    return answer("hall_factor", verdict_of([polarisation], low <= polarisation <= high), **figures)


def offset(figures: Row) -> Row:
    pairs = figures["pairs"]
    lengths = {f"l0_mm_at_{height:g}_mm": l0 for height, l0 in pairs} | {"rest_mT": figures["rest_mT"]}
    below = sum(l0 > paper().H for _, l0 in pairs)
    verdict = verdict_of([[l0 for _, l0 in pairs]], below > 0)
    return answer("offset", verdict, lengths, pairs=pairs, below=below)


def cost_rows(reference: Accuracy, progress: Progress) -> list[Row]:
    """Measure the formulas and two levels of the finite elements, without error estimates, on this machine.

    A row has the median CPU time of a press to 1 mm, and the error of the force at several depths that is largest in
    magnitude, %, against forces at an accuracy `reference`.
    """
    design, loads = paper(), [Load(depth) for depth in VALUES["cost_depths"]]

    def by_formula(level: str, at: Sequence[Load]) -> list[float]:
        return [beam.solve(design, load, level).force[2] for load in at]

    def by_fem(accuracy: Accuracy, at: Sequence[Load]) -> list[float]:
        return [state.response.force[2] for state in equilibrium.trace(design, at, accuracy, estimate=False)]

    exact, rows = by_fem(reference, loads), []
    models: list[tuple[str, Callable[[Sequence[Load]], list[float]], int]] = [
        *((f"formulas, level {level}", functools.partial(by_formula, level), 200) for level in beam.LEVELS),
        *((f"finite elements, level {own.name}", functools.partial(by_fem, own), 1) for own in (QUICK, STANDARD)),
    ]
    for model, forces, calls in models:
        progress(0.5, f"cost of {model}")
        worst = max((100 * (force / true - 1) for force, true in zip(forces(loads), exact, strict=True)), key=abs)
        times = []
        for _ in range(3):
            begin = time.process_time()
            for _ in range(calls):
                forces([Load(1.0)])
            times.append((time.process_time() - begin) / calls)
        rows.append({"model": model, "seconds": statistics.median(times), "worst_error_percent": worst})
    return rows


def cost(rows: Sequence[Row]) -> Row:
    fastest = min((row for row in rows if row["model"].startswith("finite elements")), key=lambda row: row["seconds"])
    figures = {f"{row['model'].replace(', level ', '_').replace(' ', '_')}_s": row["seconds"] for row in rows}
    finite = next(row for row in rows if row["model"].endswith("level finite"))
    ratio = fastest["seconds"] / rows[0]["seconds"]
    given: Row = {"rows": rows, "formulas": rows[0], "fastest": fastest, "finite": finite, "ratio": ratio}
    return answer("cost", verdict_of([ratio], ratio > 1), figures, **given)
