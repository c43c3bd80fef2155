"""Solutions within a tolerance: the model that `model_choice` chooses, checked by its own error estimates.

Finite elements whose estimates exceed the tolerance, or are unknown, are solved again at the next finer accuracy. If
there is none, the states have the status UNMET, and exit status 3.
"""

from __future__ import annotations

import math
import time
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from geometry import design_digest
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, Magnet
from geometry.messages import Progress
from studies.inputs.option_groups import Method
from studies.inputs.user_input import AccuracyName, parse_tolerance
from studies.mechanics import model_choice
from studies.mechanics.model_choice import UNMET, Choice, percent
from studies.output import console
from studies.output.records import FlatRow
from studies.simulation import load_cases, state_rows

if TYPE_CHECKING:
    from fem.analyses.force_targets import ForceTarget

TITLES = {"formula": "Formulas", "surrogate": "Surrogate", "fem": "Finite elements"}
"""Titles of tables by the kind of the chosen model."""


@dataclass(frozen=True, slots=True)
class Chosen:
    """A tolerance and the model that is chosen for it; added to every row."""

    tolerance: float
    choice: Choice

    def row(self) -> FlatRow:
        """Return the columns that a tolerance adds."""
        return {
            "chosen_model": self.choice.name,
            "tolerance": self.tolerance,
            "expected_error": self.choice.bound,
        }

    def say(self) -> None:
        """Print on standard error which model is chosen, and why."""
        choice = self.choice
        names = {"formula": f"formulas of level {choice.level_or_accuracy}", "surrogate": "the surrogate"}
        name = names.get(choice.model_kind, choice.name)
        console.say(f"magtip: tolerance {percent(self.tolerance)}: {name}, because {choice.reason}")


def run(
    design: Design,
    loads: list[Load],
    method: Method,
    targets: Sequence[ForceTarget] = (),
    *,
    out: Path | None,
    picture: Path | None,
    progress: Progress,
) -> tuple[str, Generator[FlatRow]]:
    """Return the title of a table of states, and their rows, which are solved one after the other.

    Parameters
    ----------
    targets : forces that the states must have; `loads` are then of the same kind. The model for a tolerance is chosen
        for their loads at accuracy quick: it would otherwise depend on the depth that it has to find.
    """
    files = {"out": out, "picture": picture}
    if method.tolerance is None:
        states = load_cases.solve(design, loads, method, **files, progress=progress, targets=targets)
        title, rows = "Finite elements", states
    else:
        check(method)
        if targets:
            loads = load_cases.loads_at_quick(design, targets, method, progress)
        chosen = choose(design, loads, method, files=bool(targets) or any(files.values()))
        chosen.say()
        title = TITLES[chosen.choice.model_kind]
        rows = solve(design, loads, method, chosen, **files, progress=progress, targets=targets)
    return title, load_cases.with_targets(rows, targets) if targets else rows


def check_alone(options: dict[str, Any]) -> None:
    """Refuse options that --tolerance decides; `options` holds their values by name, None where one is not used."""
    for name, value in options.items():
        if value is not None:
            raise BadInput(
                f"--tolerance chooses model and accuracy and excludes {name} {value}: give only one of them"
            )


def choose(design: Design, loads: Sequence[Load], method: Method, *, files: bool) -> Chosen:
    """Return the choice for the loads of `magtip solve`.

    Parameters
    ----------
    files : whether the deformed body is to be written, which neither formulas nor the surrogate compute; or a force
        is searched for.
    """
    tolerance = check(method)
    return Chosen(tolerance, model_choice.choose(design, loads, tolerance, method.magnet, formulas=not files))


def check(method: Method) -> float:
    """Return the tolerance of a method, a fraction; refuse options that it decides."""
    assert method.tolerance is not None
    check_alone(
        {
            "--accuracy": method.accuracy,
            "--model": None if method.model == "auto" else method.model,
            "--harmonics": method.harmonics,
            "--mesh": method.mesh,
        }
    )
    return parse_tolerance(method.tolerance)


def solve(
    design: Design,
    loads: list[Load],
    method: Method,
    chosen: Chosen,
    *,
    out: Path | None,
    picture: Path | None,
    progress: Progress,
    targets: Sequence[ForceTarget] = (),
) -> Generator[FlatRow]:
    """Yield the rows of the states by the chosen model, each with the columns of `chosen`.

    The rows of finite elements come when the whole path is solved, because its error estimates may require another
    one.

    Parameters
    ----------
    targets : forces that the states must have, for finite elements; `loads` are then rough ones.
    """
    if chosen.choice.model_kind == "formula":
        for load in loads:
            yield _formula_row(design, load, method, chosen.choice) | chosen.row()
        return
    if chosen.choice.model_kind == "surrogate":
        for load in loads:
            yield _surrogate_row(design, load, method, chosen.choice) | chosen.row()
        return
    while True:
        accuracy = cast(AccuracyName, chosen.choice.level_or_accuracy)
        at_level = replace(method, accuracy=accuracy, tolerance=None)
        states = load_cases.solve(
            design, loads, at_level, out=out, picture=picture, progress=progress, targets=targets
        )
        rows = [_checked(row, design, loads[0], chosen) for row in states]
        lost = next((row["message"] for row in rows if row["status"] == UNMET), "")
        finer = model_choice.finer(design, loads, chosen.choice, method.magnet) if lost else None
        if finer is None:
            break
        console.say(f"magtip: at accuracy {accuracy} {lost}: solved again at accuracy {finer.level_or_accuracy}")
        chosen = replace(chosen, choice=finer)
    for row in rows:
        yield row | chosen.row()


def _checked(row: FlatRow, design: Design, like: Load, chosen: Chosen) -> FlatRow:
    """Return the row of a solved state, with status UNMET and the reason if it is not known to meet the tolerance.

    Parameters
    ----------
    like : a load of the same kind as that of the state.
    """
    force = row["force_N"]
    if row["status"] not in ANSWERED or force is None:
        return row
    load = replace(like, depth=row["depth_mm"], shear_x=row["shear_mm"], shear_y=row["shear_y_mm"])
    x, y = load.direction
    estimates = {
        "force": row["error_estimate"],
        **{name: row[f"{name}_error_estimate"] for name in ("shift", "tilt", "sideways")},
    }
    reason = model_choice.unmet(chosen.choice, chosen.tolerance, design, load, x * force[0] + y * force[1], estimates)
    return row | {"status": UNMET, "message": "; ".join(filter(None, (row["message"], reason)))} if reason else row


def _formula_row(design: Design, load: Load, method: Method, choice: Choice) -> FlatRow:
    from analytic import beam

    begin = time.perf_counter()
    response = beam.solve(design, load, choice.level_or_accuracy)
    seconds = time.perf_counter() - begin
    made_for = design_digest.of_mechanics(design, method.magnet)
    return state_rows.state_row(load, response, choice.name, made_for, seconds=seconds)


def _surrogate_row(design: Design, load: Load, method: Method, choice: Choice) -> FlatRow:
    from studies.mechanics import surrogate_response

    begin = time.perf_counter()
    estimate = surrogate_response.respond(design, load, method.magnet)
    seconds = time.perf_counter() - begin
    return state_rows.surrogate_row(
        load, estimate, choice.name, design_digest.of_mechanics(design, method.magnet), seconds
    )


def choose_accuracy(design: Design, paths: Sequence[Sequence[Load]], text: str) -> Chosen:
    """Return the coarsest accuracy of the finite elements that meets a tolerance on several paths of loads."""
    tolerance = parse_tolerance(text)
    magnet: Magnet = "rigid" if design.shape.has_magnet else "ignored"
    choices = [model_choice.choose(design, path, tolerance, magnet, formulas=False) for path in paths]
    names: list[str] = ["quick", *model_choice.FINER.values()]
    # both paths are solved at one accuracy: the path that needs the finer one, or has the larger errors, decides
    hardest = max(choices, key=lambda choice: (names.index(choice.level_or_accuracy), choice.bound))
    return Chosen(tolerance, hardest)


def beyond(rows: Sequence[Mapping[str, Any]], chosen: Chosen) -> list[str]:
    """Return which error estimates of the rows of a comparison exceed its tolerance, or are unknown."""
    lost = {}
    for row in rows:
        # without a shear there is no force along it
        upright = not row.get("shear_mm")
        for name in (key for key in row if key.endswith("error_estimate") and row["status"] in ANSWERED):
            if not (value := row[name]) <= chosen.tolerance and not (upright and "sideways" in name):
                size = "is unknown" if math.isnan(value) else f"of {percent(value)} exceeds it"
                lost[name] = f"{name} {size} at depth {row['depth_mm']:g} mm"
    return [f"tolerance {percent(chosen.tolerance)}: {text}" for text in lost.values()]
