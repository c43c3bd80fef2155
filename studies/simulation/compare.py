"""The paper's formulas beside the finite elements, in a press and in a sheared press: tables, plots and findings.

Three mechanics meet here: finite elements with the rigid magnet ("fem"), finite elements of a beam that is all
silicone ("fem_homogeneous"; there the beam assumption can be judged apart from the magnet), and the formulas
("analytic"). All poses of the magnet go through the same field code, so that differences between readings come from
the mechanics alone. "untilted" is the FEM's pose with its tilt taken away: what the paper blames for its errors.

Errors are model against FEM with the rigid magnet, in %; those of a reading in % of its full scale (FS): the largest
change from rest that the FEM sees of it in both tables, for S2 and S3 together, since a shear along y swaps them. A
design without a magnet has the same beam under both names and no readings.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from analytic import beam, hall
from fem import equilibrium
from fem.accuracy import STANDARD, Accuracy
from fem.solution import Solution
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, Response, check_load
from studies.output.csv_tables import write_table
from studies.sensing.field_readings import columns
from studies.simulation import comparison_findings

Progress = Callable[[float, str], None]
Row = dict[str, Any]
NAN = math.nan

FILES = ("press.csv", "shear.csv", "press.png", "shear.png")
"""What is written into a folder."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one load: its solution, or None and why."""

    solution: Solution | None
    status: str
    message: str

    @property
    def response(self) -> Response | None:
        return None if self.solution is None else self.solution.response

    @property
    def error_estimate(self) -> float:
        """Relative error of the force, NaN where it was not estimated."""
        found = self.solution.estimates.force if self.solution else None
        return NAN if found is None else found


@dataclass(frozen=True, slots=True)
class Comparison:
    """Tables, findings, and the finite elements' states with the magnet, one for each row."""

    press: list[Row]
    shear: list[Row]
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
) -> dict[str, Any]:
    """Compare, and write the tables and plots of `write` into an existing folder, or nothing if it is None.

    Parameters
    ----------
    depths : of the press, mm; by default 12 steps up to 3 D/8, or to 0.6 of the silicone on the axis if that is less.
    shears : sideways motion of the plate, stuck to the tip, mm; by default 0 to 3 D/8 in 6 steps.
    shear_depth : depth of the press under the shear, mm; by default a third of the deepest default of the press.

    Returns
    -------
    "press" and "shear", a row for each state, and "summary" (see `report.findings`). A state that is not reached
    keeps its row, with NaN, a status and a message.
    """
    found = compare(design, accuracy, progress, depths, shears, shear_depth)
    if folder is not None:
        if progress is not None:
            progress(1.0, ", ".join(FILES))
        write(folder, design, found)
    return {"press": found.press, "shear": found.shear, "summary": found.summary}


def compare(
    design: Design,
    accuracy: Accuracy = STANDARD,
    progress: Progress | None = None,
    depths: Sequence[float] | None = None,
    shears: Sequence[float] | None = None,
    shear_depth: float | None = None,
) -> Comparison:
    """The comparison of `run`, nothing written."""
    deepest = min(3 * design.D / 8, 0.6 * (design.L - design.magnet_height))
    press = [Load(depth=d) for d in ([deepest * k / 12 for k in range(1, 13)] if depths is None else depths)]
    under = deepest / 3 if shear_depth is None else shear_depth
    shears = [design.D * k / 16 for k in range(7)] if shears is None else shears
    shear = [Load(depth=under, shear_x=value, friction="stick") for value in shears]
    pressed = _both(design, press, accuracy, part(progress, 0.0, 0.08, "press"))
    sheared = _both(design, shear, accuracy, part(progress, 0.08, 1.0, "shear"))
    rows = press_rows(design, press, *pressed), shear_rows(design, shear, *sheared)
    _fill_reading_errors(design, [*rows[0], *rows[1]])
    return Comparison(*rows, comparison_findings.findings(design, *rows), pressed[0], sheared[0])


def write(folder: Path, design: Design, found: Comparison) -> None:
    """Write press.csv, shear.csv, press.png and shear.png into an existing folder."""
    from studies.simulation import comparison_plots

    write_table(folder / "press.csv", found.press)
    write_table(folder / "shear.csv", found.shear)
    comparison_plots.press(folder / "press.png", design, found.press)
    comparison_plots.shear(folder / "shear.png", design, found.shear)


def part(progress: Progress | None, low: float, high: float, name: str = "") -> Progress | None:
    """The progress of a part of the work that takes it from `low` to `high`."""
    if progress is None:
        return None
    return lambda fraction, text: progress(low + (high - low) * fraction, f"{name}: {text}" if name else text)


# Finite elements


def follow(
    design: Design, loads: Sequence[Load], accuracy: Accuracy, magnet: Magnet, progress: Progress | None = None
) -> list[Outcome]:
    """What becomes of each load of a path; a load that is refused does not stop the others."""
    refused = [_refusal(design, load, magnet) for load in loads]
    possible = [load for load, reason in zip(loads, refused, strict=True) if not reason]
    try:
        found = equilibrium.trace(design, possible, accuracy, magnet=magnet, progress=progress) if possible else []
        failed = Outcome(None, found[-1].status, found[-1].message) if found else None
    except RuntimeError as error:
        found, failed = [], Outcome(None, "not_converged", str(error))
    states = iter(found)
    outcomes = []
    for reason in refused:
        state = None if reason else next(states, None)
        if reason or failed is None:
            outcomes.append(Outcome(None, "bad_input", reason))
        elif state is None:
            outcomes.append(failed)
        else:
            outcomes.append(Outcome(state if state.status == "ok" else None, state.status, state.message))
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

_PRESS: dict[str, Callable[[Response], float]] = {
    "force_N": lambda pose: pose.force[2],
    "shift_z_mm": lambda pose: pose.shift[2],
    "contact_radius_mm": lambda pose: pose.contact_radius,
}
_SHEAR: dict[str, Callable[[Response], float]] = {
    "force_x_N": lambda pose: pose.force[0],
    "force_z_N": lambda pose: pose.force[2],
    "shift_x_mm": lambda pose: pose.shift[0],
    "shift_z_mm": lambda pose: pose.shift[2],
    "tilt_rad": lambda pose: pose.tilt,
}


def press_rows(design: Design, loads: Sequence[Load], rigid: Sequence[Outcome], bare: Sequence[Outcome]) -> list[Row]:
    """One row for each depth; errors of readings are not filled in yet."""
    rows = []
    for load, fem, homogeneous in zip(loads, rigid, bare, strict=True):
        formula, remark = formulas(design, load)
        row: Row = {"depth_mm": load.depth}
        judged = {"force_N": "force", "shift_z_mm": "shift", "contact_radius_mm": "contact_radius"}
        row |= _mechanics(_PRESS, (fem.response, homogeneous.response, formula), judged)
        row |= _readings(design, {"fem": fem.response, "analytic": formula}, (1, 2))
        rows.append(row | _verdict(fem, homogeneous, remark))
    return rows


def shear_rows(design: Design, loads: Sequence[Load], rigid: Sequence[Outcome], bare: Sequence[Outcome]) -> list[Row]:
    """One row for each sideways motion of the plate; errors of readings are not filled in yet."""
    rows = []
    for load, fem, homogeneous in zip(loads, rigid, bare, strict=True):
        formula, remark = formulas(design, load)
        row: Row = {"shear_mm": load.shear_x, "depth_mm": load.depth}
        judged = {"force_x_N": "force_x", "force_z_N": "force_z", "shift_x_mm": "shift_x"}
        row |= _mechanics(_SHEAR, (fem.response, homogeneous.response, formula), judged)
        if not load.shear_x:
            row |= dict.fromkeys((name for name in row if "_x_error" in name), NAN)
        untilted = None if fem.response is None else replace(fem.response, tilt=0.0)
        row |= _readings(design, {"fem": fem.response, "untilted": untilted, "analytic": formula}, (1, 2, 3))
        rows.append(row | _verdict(fem, homogeneous, remark))
    return rows


def formulas(design: Design, load: Load) -> tuple[Response | None, str]:
    """The paper's answer, or None and the reason why there is none."""
    try:
        return beam.solve(design, load), ""
    except BadInput as error:
        return None, f"no formula: {error}"


def percent(model: float, truth: float) -> float:
    """Relative error in %; NaN where the truth is 0 or unknown.

    >>> percent(1.5, 1.0), percent(1.0, 0.0)
    (50.0, nan)
    """
    return 100 * (model / truth - 1) if truth else NAN


def reading(design: Design, response: Response | None) -> tuple[Sequence[float], Sequence[float]]:
    """Field in mT and output in V, or in mT of a chip, of the elements for a pose.

    NaN where there is none, or no magnet, or no field.
    """
    nothing = (NAN,) * 3
    if response is None or not design.shape.has_magnet:
        return nothing, nothing
    try:
        seen = hall.readings(design, response)
    except BadInput:
        return nothing, nothing
    sizes = [1.0 if unit == "V" else 1e3 for unit in seen.units]
    outputs = [size * value for size, value in zip(sizes, seen.output, strict=True)]
    return [1e3 * value for value in seen.B_T], outputs


def _mechanics(
    quantities: dict[str, Callable[[Response], float]], responses: Sequence[Response | None], judged: dict[str, str]
) -> Row:
    """Each quantity of the three models, and the formula's errors in those judged, under the names given there."""
    poses = dict(zip(("fem", "fem_homogeneous", "analytic"), responses, strict=True))
    row: Row = {}
    for name, value in quantities.items():
        row |= {f"{model}_{name}": NAN if pose is None else value(pose) + 0.0 for model, pose in poses.items()}
        if name in judged:
            for label, truth in (("", "fem"), ("homogeneous_", "fem_homogeneous")):
                error = percent(row[f"analytic_{name}"], row[f"{truth}_{name}"])
                row[f"{label}{judged[name]}_error_percent"] = error
    return row


def _readings(design: Design, poses: dict[str, Response | None], elements: Iterable[int]) -> Row:
    seen = {name: reading(design, response) for name, response in poses.items()}
    names, unit = columns(design)
    found = [(names[k - 1], k - 1) for k in elements]
    row = {f"{model}_{name}_mT": seen[model][0][k] for name, k in found for model in poses}
    row |= {f"{model}_{name}_{unit}": seen[model][1][k] for name, k in found for model in poses}
    return row | {f"{model}_{name}_error_percent_FS": NAN for name, _ in found for model in poses if model != "fem"}


def _verdict(fem: Outcome, homogeneous: Outcome, remark: str) -> Row:
    """Error estimates, and status and message: the first of the two solves that failed speaks for the row."""
    estimates = {"error_estimate": fem.error_estimate, "homogeneous_error_estimate": homogeneous.error_estimate}
    worst = homogeneous if fem.status == "ok" else fem
    texts = dict.fromkeys(text for text in (fem.message, homogeneous.message, remark) if text)
    return estimates | {"status": worst.status, "message": "; ".join(texts)}


def _fill_reading_errors(design: Design, rows: Iterable[Row]) -> None:
    rest = reading(design, Response((0.0,) * 3, (0.0,) * 3, 0.0, 0.0))[0]
    names, _ = columns(design)
    changes: dict[int, float] = {}
    for row in rows:
        for k, name in enumerate(names):
            change, alike = abs(row.get(f"fem_{name}_mT", NAN) - rest[k]), min(k, 1)
            if change > changes.get(alike, 0.0):
                changes[alike] = change
    for row in rows:
        for k, name in enumerate(names):
            for model in ("untilted", "analytic"):
                if (key := f"{model}_{name}_error_percent_FS") in row:
                    wrong = row[f"{model}_{name}_mT"] - row[f"fem_{name}_mT"]
                    row[key] = 100 * wrong / changes.get(min(k, 1), NAN)
