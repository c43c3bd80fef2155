"""Paths of loads within a tolerance: one model for all states, refined until they meet it."""

from __future__ import annotations

import time
from collections.abc import Generator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, Magnet
from geometry.messages import Progress
from studies.answers import STATED
from studies.inputs.option_groups import Method, Wanted
from studies.inputs.user_input import AccuracyName, parse_tolerance
from studies.mechanics import model_choice
from studies.mechanics.model import Model, Problem
from studies.mechanics.model_choice import UNMET, Choice
from studies.mechanics.path_solver import Answer
from studies.mechanics.timed_quantities import STILL
from studies.models.finite_elements import FemModel
from studies.models.tolerance import model_of, until_met
from studies.output import console
from studies.output.records import FlatRow
from studies.quantities import estimate_column, shown
from studies.simulation import load_cases, state_rows

if TYPE_CHECKING:
    from fem.analyses.force_targets import ForceTarget


def columns_of(choice: Choice) -> FlatRow:
    """Return the columns that a tolerance adds to every row."""
    return {"chosen_model": choice.name, "tolerance": choice.tolerance, "expected_error": choice.bound}


def say(choice: Choice) -> None:
    """Print on standard error which model is chosen, and why."""
    model = model_of(choice)
    name = model.title(model.name)
    console.say(f"magtip: tolerance {shown(choice.tolerance, 'percent', 2)}: {name}, because {choice.reason}")


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

    The model for a tolerance with targets is chosen for their loads at accuracy quick: it would otherwise depend on
    the depth that it has to find.
    """
    options: dict[str, Any] = {
        "out": out,
        "picture": picture,
        "progress": progress,
        "targets": targets,
    }
    model: type[Model] = FemModel
    if method.wanted.tolerance is None:
        rows = load_cases.solve(design, loads, method, **options)
    else:
        tolerance = check(method)
        if targets:
            loads = load_cases.loads_at_quick(design, targets, method, progress)
        # neither formulas nor the surrogate compute a deformed body, or find a force
        formulas = not (targets or out or picture)
        choice = model_choice.choose(design, loads, tolerance, method.magnet, formulas=formulas)
        say(choice)
        model, rows = type(model_of(choice)), solve(design, loads, method, choice, **options)
    title = model.title(model.head or model.names[0]).capitalize()
    return title, load_cases.with_targets(rows, targets) if targets else rows


def check_alone(options: dict[str, Any]) -> None:
    """Refuse options that --tolerance decides; `options` holds their values by name, None where one is not used."""
    for name, value in options.items():
        if value is not None:
            raise BadInput(
                f"--tolerance chooses model and accuracy and excludes {name} {value}: give only one of them"
            )


def check(method: Method) -> float:
    """Return the tolerance of a method, a fraction; refuse options that it decides."""
    model = None if method.model == "auto" else method.model
    check_alone(
        {
            "--accuracy": method.wanted.accuracy,
            "--model": model,
            "--harmonics": method.harmonics,
            "--mesh": method.mesh,
        }
    )
    return parse_tolerance(method.wanted.tolerance or "")


def solve(design: Design, loads: list[Load], method: Method, choice: Choice, **options: Any) -> Generator[FlatRow]:
    """Yield the rows of the states by the chosen model, each with the columns of the choice.

    The rows of finite elements come when the whole path is solved, because its error estimates may require another
    one; `options` are those of `load_cases.solve`.
    """
    if not model_of(choice).solves:
        for load in loads:
            yield _answered_row(design, load, method.magnet, choice) | columns_of(choice)
        return

    def rows_by(choice: Choice) -> list[FlatRow]:
        accuracy = cast(AccuracyName, choice.level_or_accuracy)
        states = load_cases.solve(design, loads, replace(method, wanted=Wanted(accuracy=accuracy)), **options)
        return [_checked(row, design, loads[0], choice) for row in states]

    choice, rows = until_met(choice, rows_by, unmet, partial(finer, design, [loads], method.magnet))
    for row in rows:
        yield row | columns_of(choice)


def unmet(rows: Sequence[FlatRow], _: Choice) -> str:
    """Return why some row is not known to meet the tolerance, "" if all are."""
    return next((row["message"] for row in rows if row["status"] == UNMET), "")


def finer(
    design: Design, paths: Sequence[Sequence[Load]], magnet: Magnet, choice: Choice, reason: str
) -> Choice | None:
    """Return the choice at the next finer accuracy, for all paths; say why it is needed."""
    found = [model_choice.finer(design, path, choice, magnet) for path in paths]
    known = [each for each in found if each is not None]
    if len(known) < len(paths):
        return None
    accuracy = known[0].level_or_accuracy
    console.say(f"magtip: at accuracy {choice.level_or_accuracy} {reason}: solved again at accuracy {accuracy}")
    return max(known, key=lambda each: each.bound)


def _checked(row: FlatRow, design: Design, like: Load, choice: Choice) -> FlatRow:
    """Return the row of a solved state, with status UNMET and the reason if it is not known to meet the tolerance."""
    load = replace(like, depth=row["depth_mm"], shear_x=row["shear_mm"], shear_y=row["shear_y_mm"])
    return checked(row, row["force_N"], design, load, choice)


def checked(row: FlatRow, force: Sequence[float] | None, design: Design, load: Load, choice: Choice) -> FlatRow:
    """Return a row with its estimates, with status UNMET and the reason if it is not known to meet the tolerance."""
    if row["status"] not in ANSWERED or force is None:
        return row
    x, y = load.direction
    estimates = {name: row[estimate_column(name)] for name in STATED}
    reason = model_choice.unmet(choice, design, load, x * force[0] + y * force[1], estimates)
    return row | {"status": UNMET, "message": "; ".join(filter(None, (row["message"], reason)))} if reason else row


def _answered_row(design: Design, load: Load, magnet: Magnet, choice: Choice) -> FlatRow:
    """Return the row of a state by a model that solves nothing."""
    begin = time.perf_counter()
    (answer,) = model_of(choice).answers([Problem(design, load, magnet, "", STILL)], lambda _: None)
    assert isinstance(answer, Answer)
    return state_rows.answered_row(design, magnet, load, answer, choice.name, time.perf_counter() - begin)


def choose_accuracy(design: Design, paths: Sequence[Sequence[Load]], text: str) -> Choice:
    """Return the coarsest accuracy of the finite elements that meets a tolerance on several paths of loads."""
    tolerance = parse_tolerance(text)
    magnet: Magnet = "rigid" if design.shape.has_magnet else "ignored"
    choices = [model_choice.choose(design, path, tolerance, magnet, formulas=False) for path in paths]
    names: list[str] = ["quick", *model_choice.FINER.values()]
    # both paths are solved at one accuracy: the path that needs the finer one, or has the larger errors, decides
    return max(choices, key=lambda choice: (names.index(choice.level_or_accuracy), choice.bound))
