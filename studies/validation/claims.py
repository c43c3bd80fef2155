"""Answers to the paper's claims: reproduced, refuted or not decidable, with figures computed in the run.

The finite elements have no error that matters here (below 1 %), but they are a model: neo-Hookean silicone, elastic
but for the claim on hysteresis, a rigid bonded magnet, and a plate whose friction the paper does not give. The words
of the answers are in templates/claims.toml. An answer has claim and paper's value in a few words, `computed` figures
in one cell, verdict, text with the reasons, commands that show parts of it, and its figures.
"""

import dataclasses
import functools
import math
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import pandas as pd

from analytic import beam
from analytic.magnet import cylinder_field
from analytic.relaxation_loops import loop
from fem import equilibrium
from fem.accuracy import LEVELS, QUICK, STANDARD, Accuracy
from fem.analyses.modes import modes, spring_mass
from geometry.design import Design, paper
from geometry.loads import Load, Magnet
from geometry.messages import Progress
from geometry.relaxation import relaxation_of
from studies.mechanics import loading_cycles
from studies.mechanics.cycle_motion import Motion
from studies.output import records
from studies.output.result import Result
from studies.sensing import layout_uniqueness
from studies.simulation import vibration_report
from studies.simulation.compare import part
from studies.simulation.comparison_rows import spans
from studies.validation import claim_errors, claim_figures, pages
from studies.validation.claim_errors import BOUND, CLAIMED, EXTENTS, VALUES, WORDS, Press, States, formula
from studies.validation.pages import Row

FILES = (
    *("CLAIMS.md", "claims.csv", "heights.csv", "presses.csv", "shears.csv", "parts.csv", "modulus_and_height.png"),
    *("figure_6.png", "figure_8.png", "figure_9.png", "figure_11.png", "figure_12.png"),
)
PERCENT = 100 * BOUND
MU0 = 4e-7 * math.pi
"""Permeability of air in the paper's Table II; with its magnetisation M = 1 it is also the polarisation mu0 M, T."""
Verdict = Literal["reproduced", "refuted", "not decidable"]
PRINTED = ["claim", "paper", "computed", "verdict"]
"""Columns of the printed table and of claims.csv."""
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
    vibrations = mode_rows(accuracy, told[0])
    layouts = pd.DataFrame(layout_rows(extent["layouts"], told[1]))
    costs = cost_rows(LEVELS[extent["reference"]], told[2])
    factor, (light, heavy) = factor_figures(), spring_mass(paper())
    # all of the silicone as a free mass, in place of a third of it as in Rayleigh's rod
    springs = {"third_of_silicone": light, "with_magnet": heavy, "all_silicone": light / math.sqrt(3)}
    best_E = float(heights.best_E_MPa[heights.magnet_height_mm == states.preset.height].iloc[0])
    answers = [
        at_each_depth(heights),
        of_largest(heights, states),
        voltage(heights, states.preset.height),
        shear_force(tips, best_E),
        tilt_as_cause(splits),
        uniqueness(layouts),
        largest_forces(states),
        frequency(vibrations, springs),
        band(vibrations, response_figures(accuracy)),
        hysteresis(loop_figures()),
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
    return pages.study(
        "claims",
        "The paper's claims",
        printed,
        page,
        look={"first": ("claim", "verdict")},
        records=answers,
        tables={"claims": printed} | {name: pages.records(table) for name, table in tables.items()},
        files=claim_figures.pictures(states, best_E),
    )


def verdict(*, holds: bool, holds_for_other_values: bool = False, figures: Any = ()) -> Verdict:
    """Return the verdict on a claim that holds for all values which the paper leaves open, or for some of them.

    It is not decidable if one of the figures that are compared is unknown, or if there is none.

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
    """Return the answer to a claim of WORDS, whose templates get VALUES, figures and these values."""
    words = WORDS[claim]

    def said(text: str) -> str:
        return " ".join(pages.filled(text, time=_time, **(VALUES | dict(figures) | values)).split())

    return {
        "claim": words["claim"],
        "paper": words["paper"],
        "computed": said(words["computed"]),
        "verdict": found,
        "text": said(words["text"]),
        "commands": [said(command) for command in words["commands"]],
        "figures": {name: getattr(value, "item", lambda value=value: value)() for name, value in figures.items()},
    }


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
    low, high = VALUES["published"]
    published = fitting[(fitting.E_from_MPa <= high) & (fitting.E_to_MPa >= low)].magnet_height_mm
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
    as_claimed = [all(abs(E * each - force) <= VALUES["rounded_N"] for E, force in CLAIMED) for each in reaches]
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
        verdict(holds=worst.min() > VALUES["large"], figures=worst),
        {"least_worst_error_percent": worst.min(), "largest_worst_error_percent": worst.max()},
        tips=pages.records(tips),
        gripped=next(iter(gripped), None),
        needed=stuck.best_E_MPa.dropna().tolist(),
        best_E=best_E,
    )


def tilt_as_cause(splits: Sequence[pd.DataFrame]) -> Row:
    # a condition of the tip without a sheared state has an unknown share, and leaves the claim open
    shares = [claim_errors.share(rows, "tilt_N") for rows in splits]
    least, largest = (pick(shares) if shares else math.nan for pick in (np.nanmin, np.nanmax))
    figures = {"least_tilt_share_percent": least, "largest_tilt_share_percent": largest}
    known = [pages.records(rows)[-1] for rows in splits if len(rows)]
    return answer("tilt", verdict(holds=bool(least > 50), figures=shares), figures, known=known)


def uniqueness(layouts: pd.DataFrame) -> Row:
    place = ["magnet_height_mm", "c_mm"]
    shares = layouts.ambiguous_percent
    own = (layouts[place] == layouts[place].iloc[0]).all(axis=1)
    failing = pages.records(layouts[shares > 0])
    unique = len(layouts) - len(failing)
    found = verdict(holds=not failing, holds_for_other_values=bool(unique), figures=shares)
    figures = {"unique_cases": unique, "cases": len(layouts)}
    return answer("uniqueness", found, figures, failing=failing, holds_here=not shares[own].any())


# Frequencies and losses


def frequency(rows: Sequence[Row], formulas: Mapping[str, float]) -> Row:
    """Answer the claim on the natural frequency; `formulas` are those of a mass on an axial spring EA/L, Hz."""
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
    found = verdict(
        holds=abs(free["bending_Hz"] / VALUES["claimed"] - 1) <= VALUES["near"], figures=[free["bending_Hz"]]
    )
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
        holds=min(slow, accurate) >= VALUES["band"],
        holds_for_other_values=not min(along_z, along_x) < VALUES["half_power"],
        figures=[slow, accurate, along_z, along_x],
    )
    return answer(
        "band", found, figures, pressed_depth=deepest, inside=min(free, pressed) < VALUES["band"], **vibration
    )


def hysteresis(figures: Row) -> Row:
    loss_factor = figures["loss_factor"]
    allowed, sine = (VALUES["full_scale"] * loss_factor / figures[name] for name in ("fem_percent", "sine_percent"))
    bounds = {
        "holds": min(allowed, sine) >= VALUES["losses"][1],
        "holds_for_other_values": max(allowed, sine) >= VALUES["losses"][0],
    }
    own = {"loss_factor": loss_factor, "gap_percent": figures["fem_percent"]}
    own |= {"allowed_loss_factor": allowed, "allowed_loss_factor_sine": sine}
    return answer("hysteresis", verdict(**bounds, figures=[allowed, sine]), own, **figures)


# Magnet and cost


def hall_factor(figures: Row) -> Row:
    polarisation = figures["polarisation_T"]
    found = verdict(holds=VALUES["neodymium"][0] <= polarisation <= VALUES["neodymium"][1], figures=[polarisation])
    return answer("hall_factor", found, {name: figures[name] for name in ("polarisation_T", "rest_V", "face_V")})


def offset(figures: Row) -> Row:
    pairs = figures["pairs"]
    below = sum(l0 > paper().H for _, l0 in pairs)
    own = {f"l0_mm_at_{height:g}_mm": l0 for height, l0 in pairs} | {"rest_mT": figures["rest_mT"]}
    found = verdict(holds=below > 0, figures=[l0 for _, l0 in pairs])
    return answer("offset", found, own, pairs=pairs, below=below)


def cost(rows: Sequence[Row]) -> Row:
    formulas, *others = rows
    fastest = min((row for row in rows if row["model"].startswith("finite elements")), key=lambda row: row["seconds"])
    ratio = fastest["seconds"] / formulas["seconds"]
    figures = {f"{row['model'].replace(', level ', '_').replace(' ', '_')}_s": row["seconds"] for row in rows}
    values = {"rows": rows, "paper": formulas, "fastest": fastest, "ratio": ratio}
    values["finite"] = next(row for row in others if row["model"].endswith("finite"))
    return answer("cost", verdict(holds=ratio > 1, figures=[ratio]), figures, **values)


# Figures of the claims that do not concern the beam's forces: readings, frequencies, Hall factor, and cost


def layout_rows(layouts: Sequence[tuple[float, float]], progress: Progress) -> list[Row]:
    """Return the share of poses whose readings another pose gives too, for each layout and form of the readings.

    A layout is a height of the magnet, and a height c of S2 and S3, mm; l0 follows from what S1 reads at rest.
    """
    rows = []
    for k, ((height, c), form) in enumerate(product(layouts, layout_uniqueness.FORMS)):
        progress(
            k / len(layouts) / len(layout_uniqueness.FORMS), f"readings of a magnet {height:g} mm high, c = {c:g} mm"
        )
        design = dataclasses.replace(claim_errors.with_magnet(height), c=c)
        figures = layout_uniqueness.alike_figures(design, form)
        place = {"magnet_height_mm": height, "l0_mm": design.l0, "c_mm": c, "readings": form}
        rows.append(place | {"ambiguous_percent": figures["alike_percent"], "apart_mm": figures["alike_apart_mm"]})
    return rows


def loop_figures() -> Row:
    """Return the gap at mid-stroke over full scale of a slow loading cycle, percent, with the preset's loss factor.

    It is that of the second cycle of a press by viscoelastic finite elements at level quick, and that of the steady
    cycle of a viscoelastic spring, of a triangle and of a sine.
    """
    design = paper()
    motion = Motion(VALUES["depth"], 0.0, "none", VALUES["speed"] / (2 * VALUES["depth"]), cycles=2)
    static = loading_cycles.Static(None, None)
    cycles = loading_cycles.run(design, motion, "prony", static, "quick", "rigid", 1e-3, lambda *_: None)
    relaxation = relaxation_of(design)
    spring, sine = (loop(relaxation, motion.frequency, form).hysteresis for form in ("triangle", "sine"))
    found = {"loss_factor": design.loss_factor, "fem_percent": cycles.loops[-1]["gap_percent"]}
    return found | {"spring_percent": 100 * spring, "sine_percent": 100 * sine}


def mode_rows(accuracy: Accuracy, progress: Progress) -> list[Row]:
    """Return the frequencies of the paper's sensor, free and pressed by 1 mm, with and without the magnet."""
    rows, magnets = [], get_args(Magnet)
    for k, (depth, magnet) in enumerate(product((0.0, 1.0), magnets)):
        progress(k / 4, "frequencies")
        result = modes(paper(), magnet, 6, depth=depth, accuracy=accuracy)
        first = {f"{name}_Hz": result.frequency[result.shape.index(name)] for name in ("bending", "axial")}
        rows.append({"magnet": magnet, "depth_mm": depth, **first})
    return rows


def response_figures(accuracy: Accuracy) -> Row:
    """Return what `magtip response` says of the paper's sensor with the loss factor of the preset.

    along_z and along_x are readings per N at 600 Hz over those at 1 Hz: of S1 by a force along z, of S2 by one along
    x. The resonance is that of the magnet under a force along x, None if there is none. Up to accurate_Hz both change
    by less than 5 %.
    """
    design, load, band = paper(), Load(VALUES["vibration_depth"], friction="stick"), tuple(VALUES["vibration_band"])
    result = vibration_report.run(design, load, (band[0], band[1]), 2, "rigid", accuracy.name, [], lambda *_: None)
    z, x = (next(one for one in result.records if one["motion"] == axis) for axis in "zx")
    read = [(z, z["element"].index("S1")), (x, x["element"].index("S2"))]
    gains = [motion["relative_reading_at_600"][k] or math.nan for motion, k in read]
    flat = [motion["accurate_per_N_Hz"][k] for motion, k in read]
    return {
        "loss_factor": design.loss_factor,
        "along_z": gains[0],
        "along_x": gains[1],
        "resonance_Hz": next(iter(x["resonance_per_N_Hz"]), None),
        "Q": next(iter(x["resonance_per_N_Q"]), None),
        "accurate_Hz": min((one for one in flat if one is not None), default=band[1]),
    }


def factor_figures() -> Row:
    """Return what the paper's factor and its magnetisation M = 1 imply.

    rest_mT is the flux density at S1 that 2.87 V mean for an SS495A, polarisation_T that of a magnet whose field
    gives an SS495A the voltages of the factor. rest_V and face_V are the change of S1's voltage by the factor at the
    preset's distance, and if S1 touched the magnet's face; pairs are heights of the magnet and distances l0 that give
    2.87 V for J = 1.2 T, mm.
    """
    design = paper()

    def by_factor(distance: float) -> float:
        point = np.array([[0.0, 0.0, distance]])
        return float(
            VALUES["factor"] * cylinder_field(point, design.magnet_diameter / 2, design.magnet_height, MU0)[0, 2]
        )

    return {
        "rest_mT": 1e3 * (VALUES["S1_at_rest"] - design.hall_null) / design.hall_gain,
        "polarisation_T": VALUES["factor"] * MU0 / design.hall_gain,
        "rest_V": by_factor(design.l0),
        "face_V": by_factor(design.magnet_height / 2),
        "pairs": [(height, claim_errors.with_magnet(height).l0) for height in (1.0, 2.0, 3.0, 4.0)],
    }


def cost_rows(reference: Accuracy, progress: Progress) -> list[Row]:
    """Measure the formulas and two levels of the finite elements, without error estimates, on this machine.

    A row has the median CPU time of a press to 1 mm, and the error of the force at several depths that is largest in
    magnitude, %, against forces at an accuracy `reference`.
    """
    design, loads = paper(), [Load(depth) for depth in VALUES["cost_depths"]]
    progress(0.0, "cost of the models")
    exact = _forces(design, loads, reference)
    rows: list[Row] = []

    def add(model: str, seconds: float, forces: list[float]) -> None:
        worst = max((100 * (force / true - 1) for force, true in zip(forces, exact, strict=True)), key=abs)
        rows.append({"model": model, "seconds": seconds, "worst_error_percent": worst})

    for level in beam.LEVELS:
        forces = [beam.solve(design, load, level).force[2] for load in loads]
        seconds = _cpu(functools.partial(beam.solve, design, Load(1.0), level), calls=200)
        add(f"formulas, level {level}", seconds, forces)
    for accuracy in (QUICK, STANDARD):
        progress(0.5, f"cost of the finite elements, level {accuracy.name}")
        forces = _forces(design, loads, accuracy)
        seconds = _cpu(functools.partial(_forces, design, [Load(1.0)], accuracy), calls=1)
        add(f"finite elements, level {accuracy.name}", seconds, forces)
    return rows


def _forces(design: Design, loads: list[Load], accuracy: Accuracy) -> list[float]:
    return [state.response.force[2] for state in equilibrium.trace(design, loads, accuracy, estimate=False)]


def _cpu(call: Callable[[], object], calls: int) -> float:
    """Return the median CPU time of one call, s, from three measurements of some calls each."""
    times = []
    for _ in range(3):
        begin = time.process_time()
        for _ in range(calls):
            call()
        times.append((time.process_time() - begin) / calls)
    return statistics.median(times)
