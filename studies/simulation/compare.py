"""Compare the paper's formulas with finite elements in a press and in a sheared press: tables, plots and findings.

Three mechanics are compared: finite elements with the rigid magnet ("fem"), finite elements of a beam that is all
silicone ("fem_homogeneous", which isolates the beam assumption from the magnet), and the formulas ("analytic"). One
field model gives the readings of all poses, so that differences between readings come from the mechanics alone.
"untilted" is the FEM's pose without its tilt, to which the paper attributes its errors.

Errors are model against FEM with the rigid magnet, in %; those of a reading in % of its full scale (FS): the largest
change from rest that the FEM sees of it in both tables, for S2 and S3 together, since a shear along y swaps them. A
design without a magnet has the same beam under both names and no readings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analytic import beam
from fem import equilibrium
from fem.accuracy import STANDARD, Accuracy
from fem.scene import Model
from fem.solution import Solution
from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, Magnet, Response, check_load
from geometry.messages import Progress
from studies.output.csv_tables import write_table
from studies.output.records import FlatRow
from studies.simulation import comparison_findings
from studies.simulation.comparison_rows import NAN, Answers, PressRow, ShearRow, with_reading_errors
from studies.simulation.rate_stiffening import check_rate, rate_sentence, with_rate

FILES = ("press.csv", "shear.csv", "press.png", "shear.png")
"""Files that `write` writes into a folder."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Outcome of one load: its solution, or None with a status and a message."""

    solution: Solution | None
    status: str
    message: str

    @property
    def response(self) -> Response | None:
        return None if self.solution is None else self.solution.response

    @property
    def error_estimate(self) -> float:
        """Estimated relative error of the force, a vector; NaN without an estimate."""
        estimate = self.solution.estimates.force if self.solution else None
        return NAN if estimate is None else estimate

    @property
    def sideways_error_estimate(self) -> float:
        """Estimated relative error of the force along the shear alone; NaN without an estimate."""
        estimate = self.solution.estimates.sideways if self.solution else None
        return NAN if estimate is None else estimate


@dataclass(frozen=True, slots=True)
class Comparison:
    """Tables, their summary, and the outcomes of the finite elements with the magnet, one for each row."""

    press: list[PressRow]
    shear: list[ShearRow]
    summary: dict[str, Any]
    pressed: list[Outcome]
    sheared: list[Outcome]


def run(
    design: Design,
    folder: Path | None,
    *,
    accuracy: Accuracy = STANDARD,
    progress: Progress | None = None,
    depths: Sequence[float] | None = None,
    shears: Sequence[float] | None = None,
    shear_depth: float | None = None,
    frequency: float | None = None,
    speed: float | None = None,
) -> dict[str, Any]:
    """Compare, and write the tables and plots of `write` into an existing folder, or nothing if it is None.

    Parameters
    ----------
    depths : of the press, mm; by default 12 steps up to 3 D/8, or to 0.6 of the silicone on the axis if that is less.
    shears : shears of the plate, which sticks to the tip, mm; by default 0 to 3 D/8 in 6 steps.
    shear_depth : depth of the press under the shear, mm; by default a third of the deepest default of the press.
    frequency, speed : of the motion, Hz or mm/s, at which the tables have the finite elements' force too (see
        `rate_stiffening`); by default neither.

    Returns
    -------
    "press" and "shear", a flat row for each state, and "summary" (see `comparison_findings.findings`). A state that
    is not reached keeps its row, with NaN, a status and a message.
    """
    loads = default_loads(design, depths, shears, shear_depth)
    check_rate(design, max(max(load.depth, load.shear_x) for part in loads for load in part), frequency, speed)
    comparison = compare(design, accuracy, progress, depths, shears, shear_depth)
    press, shear = tables(design, comparison, frequency, speed)
    if folder is not None:
        if progress is not None:
            progress(1.0, ", ".join(FILES))
        write(folder, design, comparison, frequency, speed)
    summary = dict(comparison.summary)
    if frequency is not None or speed is not None:
        summary["rate_sentence"] = rate_sentence(design, press, frequency, speed)
    return {"press": press, "shear": shear, "summary": summary}


def tables(
    design: Design, comparison: Comparison, frequency: float | None = None, speed: float | None = None
) -> tuple[list[FlatRow], list[FlatRow]]:
    """Return the flat rows of press and shear."""
    press, shear = ([row.row() for row in rows] for rows in (comparison.press, comparison.shear))
    return (
        with_rate(design, "press", press, frequency, speed),
        with_rate(design, "shear", shear, frequency, speed),
    )


def compare(
    design: Design,
    accuracy: Accuracy = STANDARD,
    progress: Progress | None = None,
    depths: Sequence[float] | None = None,
    shears: Sequence[float] | None = None,
    shear_depth: float | None = None,
) -> Comparison:
    """Return the comparison of `run` without writing files."""
    press, shear = default_loads(design, depths, shears, shear_depth)
    pressed = _both(design, press, accuracy, part(progress, 0.0, 0.08, "press"))
    sheared = _both(design, shear, accuracy, part(progress, 0.08, 1.0, "shear"))
    rows = with_reading_errors(design, press_rows(design, press, *pressed), shear_rows(design, shear, *sheared))
    return Comparison(*rows, comparison_findings.findings(design, *rows), pressed[0], sheared[0])


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


def write(
    folder: Path,
    design: Design,
    comparison: Comparison,
    frequency: float | None = None,
    speed: float | None = None,
) -> None:
    """Write press.csv, shear.csv, press.png and shear.png into an existing folder."""
    from studies.simulation import comparison_plots

    press, shear = tables(design, comparison, frequency, speed)
    write_table(folder / "press.csv", press)
    write_table(folder / "shear.csv", shear)
    comparison_plots.press(folder / "press.png", design, comparison.press)
    comparison_plots.shear(folder / "shear.png", design, comparison.shear)


def part(progress: Progress | None, low: float, high: float, name: str = "") -> Progress | None:
    """Return the progress of a step that takes the whole from `low` to `high`."""
    if progress is None:
        return None
    return lambda fraction, text: progress(low + (high - low) * fraction, f"{name}: {text}" if name else text)


# Finite elements


def follow(
    design: Design,
    loads: Sequence[Load],
    accuracy: Accuracy,
    magnet: Magnet,
    progress: Progress | None = None,
    *,
    model: Model = "auto",
) -> list[Outcome]:
    """Return the outcome of each load of a path; a refused load does not stop the others."""
    refused = [_refusal(design, load, magnet) for load in loads]
    possible = [load for load, reason in zip(loads, refused, strict=True) if not reason]
    try:
        states = (
            equilibrium.trace(design, possible, accuracy, magnet=magnet, model=model, progress=progress)
            if possible
            else []
        )
        failed = Outcome(None, states[-1].status, states[-1].message) if states else None
    except SolveFailed as error:
        states, failed = [], Outcome(None, "not_converged", str(error))
    remaining = iter(states)
    outcomes = []
    for reason in refused:
        state = None if reason else next(remaining, None)
        if reason or failed is None:
            outcomes.append(Outcome(None, "bad_input", reason))
        elif state is None:
            outcomes.append(failed)
        else:
            outcomes.append(Outcome(state if state.status in ANSWERED else None, state.status, state.message))
    return outcomes


def _refusal(design: Design, load: Load, magnet: Magnet) -> str:
    try:
        check_load(design, load, magnet)
    except BadInput as error:
        return str(error)
    return ""


def _both(
    design: Design, loads: Sequence[Load], accuracy: Accuracy, progress: Progress | None
) -> tuple[list[Outcome], list[Outcome]]:
    """Outcomes with the rigid magnet and of the homogeneous beam."""
    if not design.shape.has_magnet:
        bare = follow(design, loads, accuracy, "ignored", progress)
        return bare, bare
    rigid = follow(design, loads, accuracy, "rigid", part(progress, 0.0, 0.58, "rigid magnet"))
    return rigid, follow(design, loads, accuracy, "ignored", part(progress, 0.58, 1.0, "all silicone"))


# Rows


def press_rows(
    design: Design, loads: Sequence[Load], rigid: Sequence[Outcome], bare: Sequence[Outcome]
) -> list[PressRow]:
    """Return one row for each depth, without the errors of the readings."""
    rows = []
    for load, fem, homogeneous in zip(loads, rigid, bare, strict=True):
        formula, remark = formulas(design, load)
        answers = Answers(fem.response, homogeneous.response, formula)
        row = PressRow(
            load.depth,
            answers.quantity(lambda pose: pose.force[2]),
            answers.quantity(lambda pose: pose.shift[2]),
            answers.quantity(lambda pose: pose.contact_radius),
            answers.readings(design, 2),
            fem.error_estimate,
            homogeneous.error_estimate,
            *_verdict(fem, homogeneous, remark),
        )
        rows.append(row)
    return rows


def shear_rows(
    design: Design, loads: Sequence[Load], rigid: Sequence[Outcome], bare: Sequence[Outcome]
) -> list[ShearRow]:
    """One row for each sideways motion of the plate; errors of readings are not filled in yet."""
    rows = []
    for load, fem, homogeneous in zip(loads, rigid, bare, strict=True):
        formula, remark = formulas(design, load)
        answers = Answers(fem.response, homogeneous.response, formula)
        # without a shear, what there is along x is the solver's rounding
        moved = bool(load.shear_x)
        row = ShearRow(
            load.shear_x,
            load.depth,
            answers.quantity(lambda pose: pose.force[0], judged=moved),
            answers.quantity(lambda pose: pose.force[2]),
            answers.quantity(lambda pose: pose.shift[0], judged=moved),
            answers.quantity(lambda pose: pose.shift[2], judged=False),
            answers.quantity(lambda pose: pose.tilt, judged=False),
            answers.readings(design, 3, untilted=True),
            fem.error_estimate,
            homogeneous.error_estimate,
            fem.sideways_error_estimate,
            homogeneous.sideways_error_estimate,
            *_verdict(fem, homogeneous, remark),
        )
        rows.append(row)
    return rows


def formulas(design: Design, load: Load) -> tuple[Response | None, str]:
    """Return the response by the paper's formulas, or None and the reason."""
    try:
        return beam.solve(design, load), ""
    except BadInput as error:
        return None, f"no formula: {error}"


def _verdict(fem: Outcome, homogeneous: Outcome, remark: str) -> tuple[str, str]:
    """Return status and message of a row: those of the first solve that failed, or "ok"."""
    worst = homogeneous if fem.status == "ok" else fem
    texts = dict.fromkeys(text for text in (fem.message, homogeneous.message, remark) if text)
    return worst.status, "; ".join(texts)
