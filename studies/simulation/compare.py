"""Compare the paper's formulas with finite elements in a press and in a sheared press: tables, plots and findings.

Three mechanics are compared: finite elements with the rigid magnet ("fem"), finite elements of a beam that is all
silicone ("fem_homogeneous", which isolates the beam assumption from the magnet), and the formulas ("analytic"). One
field model gives the readings of all poses, so that differences between readings come from the mechanics alone.
"untilted" is the FEM's pose without its tilt, to which the paper attributes its errors. A design without a magnet has
the same beam under both names and no readings. `comparison_rows` says what the columns are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

from analytic import beam
from fem.accuracy import STANDARD, Accuracy
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, Response
from geometry.messages import Progress
from studies.mechanics.model_choice import Choice
from studies.mechanics.path_solver import LoadOutcome, follow
from studies.output.figures import picture
from studies.output.records import FlatRow
from studies.output.result import Block, Result, failure_of
from studies.simulation import comparison_figures
from studies.simulation.comparison_rows import (
    Kind,
    check_rate,
    findings,
    rate_sentence,
    row,
    with_rate,
    with_reading_errors,
)
from studies.simulation.within_tolerance import beyond, columns_of
from studies.sweeps import sweep

FILES = ("press.csv", "shear.csv", "press.png", "shear.png")
"""Files of a comparison."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """Rows of both tables, their summary, and the outcomes of the finite elements with the magnet, one for each row.

    A state that is not reached keeps its row, with NaN, a status and a message.
    """

    press: list[FlatRow]
    shear: list[FlatRow]
    summary: dict[str, Any]
    pressed: list[LoadOutcome]
    sheared: list[LoadOutcome]


def run(
    design: Design,
    *,
    accuracy: Accuracy = STANDARD,
    progress: Progress | None = None,
    depths: Sequence[float] | None = None,
    shears: Sequence[float] | None = None,
    shear_depth: float | None = None,
    frequency: float | None = None,
    speed: float | None = None,
) -> Comparison:
    """Compare in a press and in a shear.

    Parameters
    ----------
    depths : of the press, mm; by default 12 steps up to 3 D/8, or to 0.6 of the silicone on the axis if that is less.
    shears : shears of the plate, which sticks to the tip, mm; by default 0 to 3 D/8 in 6 steps.
    shear_depth : depth of the press under the shear, mm; by default a third of the deepest default of the press.
    frequency, speed : of the motion, Hz or mm/s, at which the rows have the finite elements' force too.
    """
    loads = default_loads(design, depths, shears, shear_depth)
    check_rate(design, max(max(load.depth, load.shear_x) for part in loads for load in part), frequency, speed)
    pressed = _both(design, loads[0], accuracy, part(progress, 0.0, 0.08, "press"))
    sheared = _both(design, loads[1], accuracy, part(progress, 0.08, 1.0, "shear"))
    found = [*rows_of("press", design, loads[0], *pressed), *rows_of("shear", design, loads[1], *sheared)]
    found = with_reading_errors(design, found)
    press, shear = found[: len(loads[0])], found[len(loads[0]) :]
    summary = findings(design, press, shear)
    press = with_rate(design, "press", press, frequency, speed)
    shear = with_rate(design, "shear", shear, frequency, speed)
    if frequency is not None or speed is not None:
        summary["rate_sentence"] = rate_sentence(design, press, frequency, speed)
    return Comparison(press, shear, summary, pressed[0], sheared[0])


def result_of(design: Design, comparison: Comparison, chosen: Choice | None = None) -> Result:
    """Return tables, pictures and sentences of a comparison."""
    press, shear, summary = comparison.press, comparison.shear, comparison.summary
    rows = [*press, *shear]
    places = ("shear_mm", "depth_mm")
    shown: list[Block] = [
        replace(sweep.table(part, title, places), places=places)
        for title, part in (("Press", press), ("Shear", shear))
    ]
    if "rate_sentence" in summary:
        shown.append(f"{summary['rate_sentence']}.")
    lost = beyond(rows, chosen.tolerance) if chosen else []
    return Result(
        title="Comparison",
        records=[{"press": press, "shear": shear, "summary": summary, **(columns_of(chosen) if chosen else {})}],
        shown=shown,
        tables={"press": press, "shear": shear},
        files={
            "press.png": partial(picture, rows=press, draw=comparison_figures.press),
            "shear.png": partial(picture, rows=shear, draw=comparison_figures.shear),
        },
        failures=[*lost, *failure_of([row for row in rows if row["status"] not in ANSWERED])],
        design=asdict(design),
    )


def default_loads(
    design: Design,
    depths: Sequence[float] | None = None,
    shears: Sequence[float] | None = None,
    shear_depth: float | None = None,
) -> tuple[list[Load], list[Load]]:
    """Return the loads of press and shear, with the defaults of `run`."""
    deepest = min(3 * design.D / 8, 0.6 * (design.L - design.magnet_height))
    press = [Load(depth=d) for d in ([deepest * k / 12 for k in range(1, 13)] if depths is None else depths)]
    under = deepest / 3 if shear_depth is None else shear_depth
    shears = [design.D * k / 16 for k in range(7)] if shears is None else shears
    return press, [Load(depth=under, shear_x=value, friction="stick") for value in shears]


def part(progress: Progress | None, low: float, high: float, name: str = "") -> Progress | None:
    """Return the progress of a step that takes the whole from `low` to `high`."""
    if progress is None:
        return None
    return lambda fraction, text: progress(low + (high - low) * fraction, f"{name}: {text}" if name else text)


# Finite elements


def _both(
    design: Design, loads: Sequence[Load], accuracy: Accuracy, progress: Progress | None
) -> tuple[list[LoadOutcome], list[LoadOutcome]]:
    if not design.shape.has_magnet:
        bare = follow(design, loads, accuracy, "ignored", progress)
        return bare, bare
    rigid = follow(design, loads, accuracy, "rigid", part(progress, 0.0, 0.58, "rigid magnet"))
    return rigid, follow(design, loads, accuracy, "ignored", part(progress, 0.58, 1.0, "all silicone"))


def rows_of(
    kind: Kind, design: Design, loads: Sequence[Load], rigid: Sequence[LoadOutcome], bare: Sequence[LoadOutcome]
) -> list[FlatRow]:
    """Return one row for each load, without the errors of the readings.

    The error estimates are relative errors of the force as a vector, and in a shear of its part along it.
    """
    rows = []
    for load, fem, homogeneous in zip(loads, rigid, bare, strict=True):
        formula, remark = formulas(design, load)
        poses = {"fem": fem.response, "fem_homogeneous": homogeneous.response, "analytic": formula}
        estimates = {
            "error_estimate": fem.error(),
            "homogeneous_error_estimate": homogeneous.error(),
            "sideways_error_estimate": fem.error("sideways"),
            "homogeneous_sideways_error_estimate": homogeneous.error("sideways"),
        }
        status, message = _verdict(fem, homogeneous, remark)
        rows.append(
            row(kind, design, load, poses)
            | {name: value for name, value in estimates.items() if kind == "shear" or "sideways" not in name}
            | {"status": status, "message": message}
        )
    return rows


def formulas(design: Design, load: Load) -> tuple[Response | None, str]:
    """Return the response by the paper's formulas, or None and the reason."""
    try:
        return beam.solve(design, load), ""
    except BadInput as error:
        return None, f"no formula: {error}"


def _verdict(fem: LoadOutcome, homogeneous: LoadOutcome, remark: str) -> tuple[str, str]:
    both = sorted((fem, homogeneous), key=lambda outcome: (outcome.status in ANSWERED, outcome.status == "ok"))
    texts = dict.fromkeys(text for text in (fem.message, homogeneous.message, remark) if text)
    return both[0].status, "; ".join(texts)
