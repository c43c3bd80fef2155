"""Compare the paper's formulas with finite elements in a press and in a sheared press: tables, plots and findings.

Three mechanics are compared: finite elements with the rigid magnet ("fem"), finite elements of a beam that is all
silicone ("fem_homogeneous", which isolates the beam assumption from the magnet), and the formulas ("analytic"). One
field model gives the readings of all poses, so that differences between readings come from the mechanics alone.
"untilted" is the FEM's pose without its tilt, to which the paper attributes its errors. A design without a magnet has
the same beam under both names and no readings. `comparison_rows` says what the columns are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial
from typing import TYPE_CHECKING

from fem.accuracy import LEVELS, STANDARD, Accuracy
from geometry.design import Design
from geometry.loads import ANSWERED, Load, Magnet
from geometry.messages import Progress
from studies import cases
from studies.mechanics.model_choice import Choice
from studies.models.finite_elements import FemModel
from studies.models.tolerance import until_met
from studies.output.figures import picture
from studies.output.records import FlatRow
from studies.output.result import Block, Result, failure_of
from studies.simulation import comparison_figures
from studies.simulation.comparison_rows import (
    findings,
    table,
    with_reading_errors,
)
from studies.simulation.within_tolerance import checked, columns_of, finer, unmet
from studies.sweeps import sweep

if TYPE_CHECKING:
    import pandas as pd

FILES = ("press.csv", "shear.csv", "press.png", "shear.png")
"""Files of a comparison."""
SOLVED = ("fem", "fem_homogeneous")
"""Mechanics by finite elements."""
Loads = tuple[Sequence[Load], Sequence[Load]]
"""Loads of the press and of the shear."""


def run(
    design: Design,
    loads: Loads | None = None,
    *,
    accuracy: Accuracy = STANDARD,
    progress: Progress | None = None,
    chosen: Choice | None = None,
) -> Result:
    """Compare in a press and in a shear; its record has the rows of both and a summary of findings.

    A state that is not reached keeps its row, with NaN, a status and a message.

    Parameters
    ----------
    loads : default: `default_loads`.
    chosen : the accuracy that a tolerance has chosen, and that tolerance; a finer one follows where it is not met.
    """
    press_loads, shear_loads = paths = loads or default_loads(design)
    magnet: Magnet = "rigid" if design.shape.has_magnet else "ignored"

    def answers_by(choice: Choice) -> dict[str, pd.DataFrame]:
        level = LEVELS[choice.level_or_accuracy]
        return _checked(_answers(design, [*press_loads, *shear_loads], level, progress), design, paths, choice)

    def lost(answers: dict[str, pd.DataFrame], choice: Choice) -> str:
        return unmet([row for name in SOLVED for row in answers[name].to_dict("records")], choice)

    if chosen is None:
        answers = _answers(design, [*press_loads, *shear_loads], accuracy, progress)
    else:
        chosen, answers = until_met(chosen, answers_by, lost, partial(finer, design, paths, magnet))
    count = len(press_loads)
    press = table("press", design, {name: frame[:count] for name, frame in answers.items()})
    shear = table("shear", design, {name: frame[count:] for name, frame in answers.items()})
    press, shear = with_reading_errors(design, press, shear)
    summary = findings(design, press, shear)
    return _result(design, press.to_dict("records"), shear.to_dict("records"), summary, chosen)


def _result(
    design: Design, press: list[FlatRow], shear: list[FlatRow], summary: FlatRow, chosen: Choice | None
) -> Result:
    places = ("shear_mm", "depth_mm")
    shown: list[Block] = [
        replace(sweep.table(rows, title, places), places=places)
        for title, rows in (("Press", press), ("Shear", shear))
    ]
    rows = [*press, *shear]
    return Result(
        title="Comparison",
        records=[{"press": press, "shear": shear, "summary": summary, **(columns_of(chosen) if chosen else {})}],
        shown=shown,
        tables={"press": press, "shear": shear},
        files={
            "press.png": partial(picture, rows=press, draw=comparison_figures.press),
            "shear.png": partial(picture, rows=shear, draw=comparison_figures.shear),
        },
        failures=failure_of([row for row in rows if row["status"] not in ANSWERED]),
        design=asdict(design),
    )


def default_loads(design: Design) -> Loads:
    """Return a press in 12 steps up to 3 D/8, or to 0.6 of the silicone on the axis if that is less, and 6 steps of a
    shear up to 3 D/8 at a third of the deepest depth, where the plate sticks to the tip.
    """
    deepest = min(3 * design.D / 8, 0.6 * (design.L - design.magnet_height))
    press = [Load(depth=deepest * k / 12) for k in range(1, 13)]
    return press, [Load(depth=deepest / 3, shear_x=design.D * k / 16, friction="stick") for k in range(7)]


def part(progress: Progress | None, low: float, high: float, name: str = "") -> Progress | None:
    """Return the progress of a step that takes the whole from `low` to `high`."""
    if progress is None:
        return None
    return lambda fraction, text: progress(low + (high - low) * fraction, f"{name}: {text}" if name else text)


def _checked(
    answers: dict[str, pd.DataFrame], design: Design, paths: Loads, choice: Choice
) -> dict[str, pd.DataFrame]:
    """Return the answers with the status of those by finite elements that are not known to meet the tolerance."""
    import pandas as pd

    def of(frame: pd.DataFrame) -> pd.DataFrame:
        rows = zip(frame.to_dict("records"), [load for path in paths for load in path], strict=True)
        return pd.DataFrame(
            [checked(row, (row["force_x_N"], row["force_y_N"]), design, load, choice) for row, load in rows]
        )

    return answers | {name: of(answers[name]) for name in SOLVED}


def _answers(
    design: Design, loads: Sequence[Load], accuracy: Accuracy, progress: Progress | None
) -> dict[str, pd.DataFrame]:
    """Return the answers to the loads by the prefixes of the mechanics, whose columns lack these."""
    import pandas as pd

    rows = pd.DataFrame({
        "depth_mm": [load.depth for load in loads],
        "shear_mm": [load.shear_x for load in loads],
        "friction": [load.friction for load in loads],
    })  # fmt: skip

    def by(model: str | FemModel, magnet: str, progress: Progress | None = None) -> pd.DataFrame:
        quantities = ("force", "shift", "tilt", "contact_radius")
        found = cases.answer(
            rows.assign(magnet=magnet), [model], base=design, quantities=quantities, progress=progress
        )
        return found.rename(columns=lambda name: name.removeprefix("fem_").removeprefix("analytic_"))

    fem = FemModel("fem", accuracy)
    formula = by("paper", "ignored")
    if not design.shape.has_magnet:
        bare = by(fem, "ignored", progress)
        return {"fem": bare, "fem_homogeneous": bare, "analytic": formula}
    rigid = by(fem, "rigid", part(progress, 0.0, 0.58, "rigid magnet"))
    bare = by(fem, "ignored", part(progress, 0.58, 1.0, "all silicone"))
    return {"fem": rigid, "fem_homogeneous": bare, "analytic": formula}
