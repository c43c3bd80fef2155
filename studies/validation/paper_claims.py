"""Answers to the paper's claims: reproduced, refuted or not decidable, with figures computed in the run.

The finite elements have no error that matters here (below 1 %), but they are a model: neo-Hookean silicone, elastic
but for the claim on hysteresis, a rigid bonded magnet, and a plate whose friction the paper does not give.
"""

from __future__ import annotations

from dataclasses import dataclass

from geometry.messages import Progress
from studies.exploration.store import Store
from studies.simulation.compare import part
from studies.validation import other_answers, press_answers, sensor_figures, shear_errors
from studies.validation.claim_answers import Answer
from studies.validation.claim_states import Extent, States, solve
from studies.validation.press_errors import HeightRow, height_row
from studies.validation.shear_errors import SplitRow, TipRow


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
    tips = [shear_errors.tip_row(sheared) for sheared in states.sheared]
    stuck = [each for each in states.sheared if each.magnet == "rigid" and each.depth]
    splits = [(each.tip, shear_errors.split(each)) for each in stuck]
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
