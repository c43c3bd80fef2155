"""Answers to the paper's claims: reproduced, refuted or not decidable, with figures computed in the run.

The finite elements have no error that matters here (below 1 %), but they are a model: neo-Hookean silicone, elastic
but for the claim on hysteresis, a rigid bonded magnet, and a plate whose friction the paper does not give.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geometry.messages import Progress
from studies.exploration.store import Store
from studies.output import records
from studies.output.atomic_files import write_text
from studies.output.csv_tables import write_table
from studies.output.markdown_tables import markdown
from studies.output.provenance import made
from studies.output.records import FlatRow
from studies.simulation.compare import part
from studies.validation import claim_errors, claim_figures, other_answers, press_answers, sensor_figures
from studies.validation.claim_errors import HeightRow, SplitRow, TipRow, height_row
from studies.validation.claim_states import Extent, States, solve
from studies.validation.press_answers import Answer


@dataclass(frozen=True, slots=True)
class Claims:
    """The answers, and what they were computed from.

    Attributes
    ----------
    splits : parts of the decoded shear force's error, by condition of the tip.
    """

    answers: list[Answer]
    states: States
    heights: list[HeightRow]
    tips: list[TipRow]
    splits: list[tuple[str, list[SplitRow]]]


def run(extent: Extent, store: Store, progress: Progress | None = None) -> Claims:
    """Test the paper's claims.

    Parameters
    ----------
    extent : loads and heights of the magnet.
    store : solved states; it supplies what it has, and receives the others.
    """
    show = progress or _silent
    states = solve(extent, store, part(show, 0.0, 0.85))
    heights = [height_row(press) for press in states.presses]
    tips = [claim_errors.tip_row(sheared) for sheared in states.sheared]
    stuck = [each for each in states.sheared if each.magnet == "rigid" and each.depth]
    splits = [(each.tip, claim_errors.split(each)) for each in stuck]
    modes = sensor_figures.mode_rows(extent.accuracy, part(show, 0.85, 0.88) or _silent)
    layouts = sensor_figures.layout_rows(extent.layouts, part(show, 0.88, 0.97) or _silent)
    costs = sensor_figures.cost_rows(extent.reference, part(show, 0.97, 1.0) or _silent)
    factor = sensor_figures.factor_figures()
    own = next(row for row in heights if row.magnet_height_mm == states.preset.height)
    answers = [
        press_answers.at_each_depth(heights),
        press_answers.of_largest(heights, states),
        press_answers.voltage(heights, own.magnet_height_mm),
        other_answers.shear_force(tips, own.best_E_MPa),
        other_answers.tilt_as_cause(splits),
        other_answers.uniqueness(layouts),
        press_answers.largest_forces(states),
        other_answers.frequency(modes, sensor_figures.formula_frequencies()),
        other_answers.band(modes, sensor_figures.response_figures(extent.accuracy)),
        other_answers.hysteresis(sensor_figures.loop_figures()),
        other_answers.hall_factor(factor),
        other_answers.offset(factor),
        other_answers.cost(costs),
    ]
    return Claims(answers, states, heights, tips, splits)


def _silent(fraction: float, text: str) -> None:
    """Ignore the progress."""


FILES = (
    *("CLAIMS.md", "claims.csv", "heights.csv", "presses.csv", "shears.csv", "parts.csv", "modulus_and_height.png"),
    *("figure_6.png", "figure_8.png", "figure_9.png", "figure_11.png", "figure_12.png"),
)
"""Files that `write` writes into a folder."""

INTRODUCTION = """\
The claims are those of Chathuranga et al., IEEE Sensors Journal 2016, on a beam of D = 8 mm, L = 9 mm and E = 1 MPa
with a magnet of 4 mm diameter. The measured curves of the paper exist as pictures only, so finite elements take the
place of the measurement. They are a model, too: neo-Hookean silicone, elastic but for the claim on hysteresis, a
rigid and bonded magnet, a frictionless plate in presses. By comparison with a coarser mesh their forces are uncertain
by {estimate}.

- *reproduced*: our figures agree with the claim.
- *refuted*: they contradict it, for all values that the paper leaves open.
- *not decidable*: the answer depends on something that the paper does not give, or that the models leave out.

The paper gives neither the height h of the magnet, nor its distance l0 from S1, nor the height c of the other
elements. Here h varies, and l0 follows from the 2.87 V that S1 reads at rest."""

PICTURES = {
    "modulus_and_height.png": """\
Which modulus of the silicone and which height of the magnet would make the claims on F_N and on the voltage of S1
true: between the black lines for F_N, nowhere for S1. The formula keeps E = 1 MPa. Where its force at 3 mm is more
than 5 % below that of the press, the voltage has no answer (grey).""",
    "figure_6.png": """\
Figure 6: |B| at S1 and S2 for displacements of the tip of +-3 mm, pressed by 1 mm. The formulas are (3), without its
misprint, and (4) with the geometry of a uniform bar; the finite elements have the tip stuck to the plate, and their
magnet tilts. S3 shows what S2 does, with x and y swapped.""",
    "figure_8.png": "Figure 8: press force over depth, and the error of (5) at each depth (grey: 5 and 10 %).",
    "figure_9.png": "Figure 9: press force over the change of the voltage of S1.",
    "figure_11.png": "Figure 11: shear force over the displacement of the tip, under four conditions of the tip.",
    "figure_12.png": """\
Figure 12: press force over depth for three moduli; below, the same enlarged. Markers: the largest forces that the
paper gives, on its own curve.""",
}
"""Pictures of CLAIMS.md, and the text below each."""


def write(folder: Path, claims: Claims, origin: str, command: str) -> None:
    """Write CLAIMS.md, the tables and the figures into an existing folder."""
    heights = [records.flat(row) for row in claims.heights]
    tips = [records.flat(row) for row in claims.tips]
    parts = [{"tip": tip} | records.flat(row) for tip, rows in claims.splits for row in rows]
    write_table(folder / "claims.csv", [answer.printed() for answer in claims.answers])
    write_table(folder / "heights.csv", heights)
    write_table(folder / "presses.csv", press_table(claims))
    write_table(folder / "shears.csv", shear_table(claims))
    write_table(folder / "parts.csv", parts)
    own = claims.states.preset.height
    best = next(row.best_E_MPa for row in claims.heights if row.magnet_height_mm == own)
    claim_figures.draw(folder, claims.states, best)
    write_text(folder / "CLAIMS.md", document(claims, heights, tips, made(command, origin)))


def document(claims: Claims, heights: Sequence[FlatRow], tips: Sequence[FlatRow], origin: str) -> str:
    """Return the text of CLAIMS.md."""
    reached = [press.error_estimate for press in claims.states.presses if np.isfinite(press.force).any()]
    largest = 100 * float(np.max(reached or [math.nan]))
    estimate = f"at most {largest:.1f} %" if math.isfinite(largest) else "an unknown amount"
    blocks = ["# The paper's claims, tested", INTRODUCTION.format(estimate=estimate), "## Verdicts"]
    blocks.append(markdown([answer.printed() for answer in claims.answers]))
    blocks.append("## Reasons")
    blocks += [paragraph(answer) for answer in claims.answers]
    blocks += ["## The paper's figures, from both models"]
    blocks += [f"![{name.removesuffix('.png')}]({name})\n\n{text}" for name, text in PICTURES.items()]
    blocks += ["## Heights of the magnet", markdown(heights), "heights.csv; presses.csv has the forces."]
    blocks += ["## Conditions of the tip", markdown(tips), "shears.csv has the forces, parts.csv the decoded force."]
    return "\n\n".join([*blocks, origin]) + "\n"


def paragraph(answer: Answer) -> str:
    """Return the heading, the reasons and the commands of one claim."""
    shown = "" if not answer.commands else f" ({', '.join(f'`{command}`' for command in answer.commands)})"
    claim = answer.claim[0].upper() + answer.claim[1:]
    return f"### {claim}: {answer.verdict}\n\n{answer.text}{shown}"


def press_table(claims: Claims) -> list[FlatRow]:
    """Return a row for each press, with the force for E = 1 MPa; NaN where it was not reached."""
    return [
        {"magnet_height_mm": press.height, "depth_mm": depth, "fem_force_N": force, "fem_shift_z_mm": -sinking}
        for press in claims.states.presses
        for depth, force, sinking in zip(
            *(a.tolist() for a in (press.depth, press.force, press.sinking)), strict=True
        )
    ]


def shear_table(claims: Claims) -> list[FlatRow]:
    """Return a row for each shear under each condition of the tip."""
    rows = []
    for sheared in claims.states.sheared:
        for shear, response in zip(sheared.shear, sheared.responses, strict=True):
            values = (np.nan,) * 4 if response is None else (*response.force[::2], response.shift[0], response.tilt)
            names = ("fem_force_x_N", "fem_force_N", "fem_shift_x_mm", "fem_tilt_rad")
            rows.append({"tip": sheared.tip, "shear_mm": shear} | dict(zip(names, values, strict=True)))
    return rows
