"""Answers to the claims about shears, readings, frequencies, hysteresis, the Hall factor and cost."""

from __future__ import annotations

import math
from collections.abc import Sequence

from geometry.design import paper
from studies.validation.claim_errors import PUBLISHED, SplitRow, TipRow, share
from studies.validation.press_answers import Answer, least, most, verdict
from studies.validation.sensor_figures import (
    CYCLE_DEPTH,
    CYCLE_SPEED,
    FACTOR,
    VIBRATION_DEPTH,
    CostRow,
    FactorFigures,
    LayoutRow,
    LoopFigures,
    ModeRow,
    ResponseFigures,
    table_entries,
)

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


def shear_force(tips: Sequence[TipRow], best_E: float) -> Answer:
    """Answer the claim that the error of F_mu is large.

    Parameters
    ----------
    best_E : modulus that fits the press forces best, MPa.
    """
    stuck = [tip for tip in tips if "stuck" in tip.tip]
    gripped = next((tip for tip in tips if tip not in stuck), None)
    worst = [abs(tip.worst_error_percent) for tip in stuck if math.isfinite(tip.worst_error_percent)]
    text = "; ".join(
        f"{tip.tip}: {tip.stiffness_N_per_mm:.2f} N/mm at first, error {tip.first_error_percent:+.0f} % there and "
        f"{tip.last_error_percent:+.0f} % at the last shear"
        for tip in tips
    )
    text = f"Formula (6) has a stiffness of 0.827 N/mm. By finite elements, tip {text}. "
    if gripped is not None and abs(gripped.worst_error_percent) <= 5:
        text += (
            "So (6) holds within 5 % for the free cantilever of which it speaks; it ignores the press, which "
            "bends the "
            "beam further as a compressed column, and the plate, which gives way in the contact. "
        )
    needed = [tip.best_E_MPa for tip in stuck if math.isfinite(tip.best_E_MPa)]
    if needed:
        text += (
            f"Under a plate (6) with its E = 1 MPa fits silicone of {min(needed):.1f} to {max(needed):.1f} MPa best, "
            f"while (5) fits silicone of {best_E:.2f} MPa with the preset's magnet: no one silicone makes both "
            "formulas true."
        )
    return Answer(
        claim="F_mu by (6) against measurement, delta to 3.1 mm",
        paper="error much larger than expected",
        computed=f"{least(worst):.0f} to {most(worst):.0f} % under a plate"
        + (f", {abs(gripped.worst_error_percent):.0f} % in a grip" if gripped else ""),
        verdict=verdict(holds=least(worst) > LARGE, figures=[tip.worst_error_percent for tip in stuck]),
        text=text,
        commands=("magtip compare paper", "magtip solve paper --grip 1 --shear 3 --steps 5"),
        figures={"least_worst_error_percent": least(worst), "largest_worst_error_percent": most(worst)},
    )


def tilt_as_cause(splits: Sequence[tuple[str, Sequence[SplitRow]]]) -> Answer:
    """Answer the claim that the ignored tilt causes the error of F_mu."""
    known = [(tip, rows) for tip, rows in splits if rows]
    shares = [share(rows, "tilt_N") for _, rows in known]
    lines = []
    for tip, rows in known:
        last = rows[-1]
        lines.append(
            f"tip {tip}: at {last.shear_mm:g} mm the decoded force is off by {last.error_N:+.2f} N of "
            f"{last.fem_force_x_N:.2f} N, of which {last.tilt_N:+.2f} N by the tilt, {last.geometry_N:+.2f} N by the "
            f"geometry of a uniform bar and {last.force_law_N:+.2f} N by (6)"
        )
    text = (
        "The paper's Figure 11 compares (6) at a displacement seen by a camera with the force of a load cell: the "
        "magnet does not enter, so its tilt cannot be the cause there. Where the paper's sensor decodes the force "
        "from its readings, the tilt matters less than the mechanics: "
        f"{'; '.join(lines)}. Over all shears the tilt has {least(shares):.0f} to {most(shares):.0f} % of the sizes "
        "of the three parts. Geometry and (6) err in opposite directions, so that the decoded force can be right for "
        "wrong reasons."
    )
    return Answer(
        claim="the ignored tilt of the magnet causes most of it",
        paper="named as the main cause",
        computed=f"tilt {least(shares):.0f} to {most(shares):.0f} % of the error's parts, mechanics the rest",
        verdict=verdict(holds=least(shares) > 50, figures=shares),
        text=text,
        commands=("magtip compare paper",),
        figures={"least_tilt_share_percent": least(shares), "largest_tilt_share_percent": most(shares)},
    )


def uniqueness(rows: Sequence[LayoutRow]) -> Answer:
    """Answer the claim that the readings are unique to each location."""
    own = [row for row in rows if (row.magnet_height_mm, row.c_mm) == (rows[0].magnet_height_mm, rows[0].c_mm)]
    failing = [row for row in rows if row.ambiguous_percent > 0]
    holds_here = not any(row.ambiguous_percent for row in own)
    cases = "; ".join(
        f"{row.readings} with h = {row.magnet_height_mm:g} mm, l0 = {row.l0_mm:.2f} mm, c = {row.c_mm:g} mm: "
        f"{row.ambiguous_percent:.2g} % of the poses, up to {row.apart_mm:.2g} mm apart"
        for row in failing
    )
    text = (
        f"The paper's table has {table_entries():,} entries. "
        f"For the preset's layout {'no' if holds_here else 'some'} two poses have the same readings. "
        f"{f'Other layouts that the paper does not exclude fail: {cases}. ' if failing else ''}"
        "The paper does not give the magnet's height nor the heights of the elements, and concludes from a plot for "
        "one depth. [LAYOUT.md](../layout/LAYOUT.md) has the range of c in which the claim holds."
    )
    return Answer(
        claim="look-up table unique to each location",
        paper="unique",
        computed=f"{len(rows) - len(failing)} of {len(rows)} layouts and forms of the readings are unique",
        verdict=verdict(
            holds=not failing,
            holds_for_other_values=len(failing) < len(rows),
            figures=[row.ambiguous_percent for row in rows],
        ),
        text=text,
        commands=("magtip layout paper --claim --out out/layout", "magtip table paper --step 0.05 --out table.npy"),
        figures={"unique_cases": float(len(rows) - len(failing)), "cases": float(len(rows))},
    )


def frequency(rows: Sequence[ModeRow], formulas: dict[str, float]) -> Answer:
    """Answer the claim on the natural frequency."""
    free = next(row for row in rows if row.magnet == "rigid" and not row.depth_mm)
    bare = next(row for row in rows if row.magnet == "ignored" and not row.depth_mm)
    pressed = max((row for row in rows if row.magnet == "rigid"), key=lambda row: row.depth_mm)
    near = abs(free.bending_Hz / FREQUENCY - 1) <= NEAR
    text = (
        f"A third of the silicone's mass on a spring EA/L gives {formulas['third_of_silicone']:.0f} Hz (Rayleigh's "
        f"rod), and {formulas['with_magnet']:.0f} Hz with the magnet's mass: the paper's value is that of an axial "
        f"spring without the magnet. By finite elements the axial mode is at {bare.axial_Hz:.0f} Hz without the "
        "magnet "
        f"and at {free.axial_Hz:.0f} Hz with it, {abs(100 * (FREQUENCY / bare.axial_Hz - 1)):.0f} and "
        f"{abs(100 * (FREQUENCY / free.axial_Hz - 1)):.0f} % from the paper's value. But the lowest mode is bending, "
        f"at {bare.bending_Hz:.0f} and {free.bending_Hz:.0f} Hz; with the tip stuck to a plate at "
        f"{pressed.depth_mm:g} mm these modes are at {pressed.bending_Hz:.0f} and {pressed.axial_Hz:.0f} Hz. All are "
        "undamped, with E as the long-term modulus: a silicone with losses is stiffer at these frequencies. All "
        f"scale with the root of E: {PUBLISHED[0]:g} MPa lowers them by "
        f"{100 * (1 - PUBLISHED[0] ** 0.5):.0f} %."
    )
    return Answer(
        claim="natural frequency",
        paper="about 970 Hz",
        computed=f"bending {free.bending_Hz:.0f} Hz, axial {free.axial_Hz:.0f} Hz; without the magnet "
        f"{bare.bending_Hz:.0f} and {bare.axial_Hz:.0f} Hz",
        verdict=verdict(holds=near, figures=[free.bending_Hz]),
        text=text,
        commands=("magtip modes paper", "magtip modes paper --magnet ignored"),
        figures={
            "bending_Hz": free.bending_Hz,
            "axial_Hz": free.axial_Hz,
            "bending_without_magnet_Hz": bare.bending_Hz,
            "axial_without_magnet_Hz": bare.axial_Hz,
            "spring_mass_Hz": formulas["third_of_silicone"],
            "spring_mass_with_magnet_Hz": formulas["with_magnet"],
        },
    )


def band(rows: Sequence[ModeRow], vibration: ResponseFigures) -> Answer:
    """Answer the claim that the sensor is usable to 600 Hz and above."""
    by_depth = {row.depth_mm: row for row in rows if row.magnet == "rigid"}
    free, pressed = by_depth[0.0], by_depth[max(by_depth)]
    slow = free.bending_Hz * (1 - 1 / 1.05) ** 0.5
    inside = min(free.bending_Hz, pressed.bending_Hz) < BAND
    where = "inside" if inside else "above"
    peak = (
        "" if vibration.resonance_Hz is None else f", where the magnet resonates at {vibration.resonance_Hz:.0f} Hz"
    )
    if peak and vibration.Q is not None:
        peak += f" with Q = {vibration.Q:.2g}"
    text = (
        f"The bending mode lies {where} the band: {free.bending_Hz:.0f} Hz free and {pressed.bending_Hz:.0f} Hz with "
        f"the tip stuck to a plate at {pressed.depth_mm:g} mm. Without damping, a slow load is read to 5 % up to "
        f"{slow:.0f} Hz only. The paper reports that the sensor senses vibrations to 600 Hz, not with which "
        "error, and "
        "resonance does not prevent sensing. "
        f"With a constant loss factor of {vibration.loss_factor:g}, an assumption, and a plate that sticks to the "
        f"tip at {VIBRATION_DEPTH:g} mm, S1 reads {vibration.along_z:.3g} times as much per N along z at {BAND:.0f} "
        f"Hz as at 1 Hz, and S2 {vibration.along_x:.3g} times as much per N along x{peak}. Both change by less than "
        f"5 % up to {vibration.accurate_Hz:.2g} Hz, because this silicone stiffens with the frequency. The claim "
        "would be reproduced if the reading stayed within 5 % to the end of the band with and without damping, and "
        f"refuted if it fell below {HALF_POWER:.2f} times that at 1 Hz."
    )
    falls = min(vibration.along_z, vibration.along_x) < HALF_POWER
    return Answer(
        claim="usable to 600 Hz and above",
        paper="senses vibrations to 600 Hz",
        computed=f"bending mode at {free.bending_Hz:.0f} to {pressed.bending_Hz:.0f} Hz; accurate to 5 % up to "
        f"{slow:.0f} Hz without damping; at {BAND:.0f} Hz {vibration.along_z:.2g} (z) and {vibration.along_x:.2g} "
        f"(x) times the reading per N at 1 Hz with a loss factor of {vibration.loss_factor:g}",
        verdict=verdict(
            holds=min(slow, vibration.accurate_Hz) >= BAND,
            holds_for_other_values=not falls,
            figures=[slow, vibration.accurate_Hz, vibration.along_z, vibration.along_x],
        ),
        text=text,
        commands=(
            "magtip modes paper",
            "magtip modes paper --depth 1",
            f"magtip response paper --depth {VIBRATION_DEPTH:g}",
        ),
        figures={
            "accurate_to_Hz": slow,
            "bending_Hz": free.bending_Hz,
            "pressed_bending_Hz": pressed.bending_Hz,
            "loss_factor": vibration.loss_factor,
            "relative_reading_z_at_600": vibration.along_z,
            "relative_reading_x_at_600": vibration.along_x,
            "accurate_with_loss_to_Hz": vibration.accurate_Hz,
        }
        | ({} if vibration.resonance_Hz is None else {"resonance_Hz": vibration.resonance_Hz})
        | ({} if vibration.Q is None else {"resonance_Q": vibration.Q}),
    )


def hysteresis(figures: LoopFigures) -> Answer:
    """Answer the claim on hysteresis."""
    parts = figures.fem_percent, figures.sine_percent
    allowed, sine = (FULL_SCALE * figures.loss_factor / part for part in parts)
    return Answer(
        claim="hysteresis along z",
        paper="< 10 % of full scale",
        computed=f"{figures.fem_percent:.1f} % for an assumed loss factor of {figures.loss_factor:g}",
        verdict=verdict(
            holds=min(allowed, sine) >= LOSSES[1],
            holds_for_other_values=max(allowed, sine) >= LOSSES[0],
            figures=[allowed, sine],
        ),
        text="The paper gives neither a viscoelastic measurement of its silicone nor the speed of its loading. With "
        f"a constant loss factor of {figures.loss_factor:g}, an assumption, a press at {CYCLE_SPEED:g} mm/s has a "
        f"gap at mid-stroke of {figures.fem_percent:.1f} % of full scale in its second cycle, and a viscoelastic "
        f"spring {figures.spring_percent:.1f} %; the gap is nearly proportional to the loss factor. So the claim "
        f"holds if the silicone's loss factor is below about {allowed:.2f}, or {sine:.2f} if the plate moved like a "
        f"sine and the sensor like a spring; those of silicones lie between about {LOSSES[0]:g} and {LOSSES[1]:g}.",
        commands=(f"magtip cycle paper --depth {CYCLE_DEPTH:g} --speed {CYCLE_SPEED:g} --cycles 2 --accuracy quick",),
        figures={
            "loss_factor": figures.loss_factor,
            "gap_percent": figures.fem_percent,
            "allowed_loss_factor": allowed,
            "allowed_loss_factor_sine": sine,
        },
    )


def hall_factor(figures: FactorFigures) -> Answer:
    """Answer the claim on the conversion factor of a Hall element."""
    text = (
        f"With the magnetisation M = 1 of its Table II, the paper's factor of {FACTOR:.4g} V/Wb is an SS495A (31.25 "
        f"V/T) beside a magnet of {1e3 * figures.polarisation_T:.0f} mT; neodymium magnets have "
        f"{1e3 * NEODYMIUM[0]:.0f} to {1e3 * NEODYMIUM[1]:.0f} mT. "
        f"S1 would then rest {1e3 * figures.rest_V:.0f} mV above its null, and {1e3 * figures.face_V:.0f} mV if it "
        "touched the magnet's face, instead of 370 mV. V/Wb is no unit of a flux density either. The factor can only "
        "be a fitted gain that makes up for M = 1."
    )
    return Answer(
        claim="Hall factor",
        paper="6.463e5 V/Wb",
        computed=f"equals 31.25 V/T for a magnet of {1e3 * figures.polarisation_T:.0f} mT",
        verdict=verdict(
            holds=NEODYMIUM[0] <= figures.polarisation_T <= NEODYMIUM[1], figures=[figures.polarisation_T]
        ),
        text=text,
        commands=("magtip readings paper",),
        figures={"polarisation_T": figures.polarisation_T, "rest_V": figures.rest_V, "face_V": figures.face_V},
    )


def offset(figures: FactorFigures) -> Answer:
    """Answer the claim on the offset of S1."""
    pairs = ", ".join(f"h = {height:g} mm with l0 = {l0:.2f} mm" for height, l0 in figures.pairs)
    below = [l0 > paper().H for _, l0 in figures.pairs]
    return Answer(
        claim="offset of S1",
        paper="2.87 V",
        computed=f"{figures.rest_mT:.1f} mT at S1; {len(figures.pairs)} of many (h, l0)",
        verdict=verdict(holds=any(below), figures=[l0 for _, l0 in figures.pairs]),
        text=f"An SS495A (2.5 V, 31.25 V/T) puts out 2.87 V at {figures.rest_mT:.2f} mT. A magnet of J = 1.2 T gives "
        f"this for a whole curve of sizes and distances: {pairs}. S1 lies below the base at {sum(below)} of these "
        f"{len(below)} distances. The offset is {'' if any(below) else 'not '}plausible; it determines one of the "
        "two missing lengths from the other.",
        commands=("magtip readings paper",),
        figures={f"l0_mm_at_{height:g}_mm": l0 for height, l0 in figures.pairs} | {"rest_mT": figures.rest_mT},
    )


def cost(rows: Sequence[CostRow]) -> Answer:
    """Answer the claim that the model is simple and faster than finite elements."""
    paper, *others = rows
    finite = next(row for row in others if row.model.endswith("finite"))
    elements = [row for row in rows if row.model.startswith("finite elements")]
    fastest = min(elements, key=lambda row: row.seconds)
    ratio = fastest.seconds / paper.seconds
    text = (
        "CPU time of a press to 1 mm, and largest error of the force to 3 mm: "
        + "; ".join(f"{row.model} {_time(row.seconds)}, {row.worst_error_percent:+.2g} %" for row in rows)
        + f". The paper's formulas are {ratio:,.0f} times as fast as finite elements, which take "
        f"{_time(fastest.seconds)}; "
        f"level finite of the formulas takes {_time(finite.seconds)} and needs no finite elements either. Times "
        "are of "
        "the machine that made this page."
    )
    return Answer(
        claim="simple and faster than a finite element model",
        paper="faster",
        computed=f"{_time(paper.seconds)} against {_time(fastest.seconds)}; error {paper.worst_error_percent:+.0f} % "
        f"against {fastest.worst_error_percent:+.1f} %",
        verdict=verdict(holds=ratio > 1, figures=[ratio]),
        text=text,
        commands=("magtip analytic paper --depth 1", "magtip solve paper --depth 1 --accuracy quick"),
        figures={f"{row.model.replace(', level ', '_').replace(' ', '_')}_s": row.seconds for row in rows},
    )


def _time(seconds: float) -> str:
    """Return a time with two digits in a fitting unit.

    >>> _time(3.2e-6), _time(0.0384), _time(2.0)
    ('3.2 µs', '38 ms', '2 s')
    """
    for factor, unit in ((1.0, "s"), (1e3, "ms"), (1e6, "µs")):
        if seconds * factor >= 1:
            return f"{seconds * factor:.2g} {unit}"
    return f"{seconds * 1e6:.2g} µs"
