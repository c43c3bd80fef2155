"""Both models over a grid of designs and depths, one row per case, with as few finite-element solves as possible.

The finite elements work with lengths over D and stresses over E, so cases that differ only in E, f or scale are one
problem: they share a solve, a path over all their depths over D, and the force is scaled by E D^2 and lengths by D.

The Hall elements stay where the base design has them: when D or L moves the magnet's centre at rest from H to H', l0
becomes l0 + H' - H. The magnet keeps its size, so a case that it does not fit into stays a row with status bad_input.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import json
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fem.accuracy import STANDARD, Accuracy
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, Response, check_load
from geometry.messages import Progress
from studies.exploration.sweep_rows import FIELDS, Case, Solved, SweepRow, sweep_row
from studies.output import result_store
from studies.output.csv_tables import write_table
from studies.output.result_store import Kept
from studies.simulation import compare
from studies.simulation.compare import follow, part
from studies.simulation.comparison_rows import NAN

DIGITS = 12
"""Decimal digits of lengths over D that must agree for two cases to be one problem."""

Key = tuple[float | str, ...]

MOST_CASES = 20_000
SILENCE = 2.0
"""Seconds after which it is said how many rows there are."""


@dataclass(frozen=True, slots=True)
class Problem:
    """Cases that are one path of presses.

    Attributes
    ----------
    number : of the solve, from 1.
    first : the design that is solved for all of them.
    path : depths over D, rising, and the same in mm of `first`.
    key : all that the path's states depend on, as text.
    """

    number: int
    first: Design
    members: list[Case]
    path: dict[float, float]
    key: str


def run(
    design: Design,
    axes: Mapping[str, Sequence[float]],
    folder: Path | None,
    *,
    depth: float,
    magnet: Magnet = "rigid",
    accuracy: Accuracy = STANDARD,
    progress: Progress | None = None,
) -> Iterator[SweepRow]:
    """All combinations of the axes, each as soon as it is solved; at the end sweep.csv and sweep.png are written.

    Parameters
    ----------
    axes : values of any of D, L, f, E and depth; the first axis is that of the plot.
    folder : where to, an existing one; None writes nothing. Solves are kept there as they are done, and those that
        the same code has kept there, in this sweep or another, are not done again.
    depth : of the press where it is not an axis, mm.
    magnet : a design without one is solved as all silicone, whatever is asked for.

    Returns
    -------
    A row for each case, the last axis varying fastest. A case that cannot be solved keeps its row, with NaN for
    figures, a status and a message. `solve` numbers the solve that a row comes from (0: none), `seconds` is the time
    that solve took to get to the row's state; a state that several rows share is counted in each.

    Raises
    ------
    BadInput
        At once, if an axis is unknown or there are too many cases.
    KeyboardInterrupt
        With a text that says how many cases are kept, if it is interrupted.
    """
    unknown = [name for name in axes if name != "depth" and name not in FIELDS]
    if unknown or not axes:
        raise BadInput(f"the axes of a sweep must be D, L, f, E or depth; got {', '.join(unknown) or 'none'}")
    count = math.prod(len(values) for values in axes.values())
    if count > MOST_CASES:
        raise BadInput(f"a sweep may have at most {MOST_CASES} cases; these axes give {count}: take fewer values")
    magnet = magnet if design.shape.has_magnet else "ignored"
    cases = list(_cases(design, axes, depth, magnet))
    return _rows(design, cases, axes, folder, magnet, accuracy, progress)


def _rows(
    base: Design,
    cases: Sequence[Case],
    axes: Mapping[str, Sequence[float]],
    folder: Path | None,
    magnet: Magnet,
    accuracy: Accuracy,
    progress: Progress | None,
) -> Iterator[SweepRow]:
    store = result_store.opened(None if folder is None else folder / "solves.jsonl", code())
    rows: list[SweepRow] = []
    said = time.monotonic()

    def say(fraction: float, text: str) -> None:
        nonlocal said
        said = time.monotonic()
        if progress is not None:
            progress(fraction, text)

    for case, solved in zip(cases, _solve(cases, magnet, accuracy, say, store), strict=True):
        rows.append(sweep_row(base, case, solved))
        yield rows[-1]
        # rows of one solve come without another word
        if time.monotonic() - said > SILENCE:
            say(len(rows) / len(cases), f"row {len(rows)} of {len(cases)}")
    if folder is not None:
        say(1.0, "sweep.csv and sweep.png")
        from studies.exploration import sweep_plot

        write_table(folder / "sweep.csv", [row.row() for row in rows])
        sweep_plot.draw(folder / "sweep.png", rows, axes)


@functools.cache
def code() -> str:
    """A digest of the modules that a solve and what is kept of it come from."""
    return result_store.digest([*result_store.modules("geometry", "fem"), Path(compare.__file__), Path(__file__)])


def _cases(base: Design, axes: Mapping[str, Sequence[float]], depth: float, magnet: Magnet) -> Iterator[Case]:
    for point in itertools.product(*axes.values()):
        values = {name: getattr(base, name) for name in FIELDS} | {"depth": depth}
        values |= dict(zip(axes, point, strict=True))
        try:
            design = varied(base, {name: values[name] for name in FIELDS})
            check_load(design, Load(depth=values["depth"]), magnet)
            yield Case(values, design, "")
        except BadInput as error:
            yield Case(values, None, str(error))


def varied(base: Design, fields: Mapping[str, float]) -> Design:
    """The base design with other D, L, f or E, its Hall elements left where they are.

    >>> from geometry.design import paper
    >>> varied(paper(), {"L": 11.0}).l0
    9.2
    """
    # what is wrong with these fields comes before what follows from them
    dataclasses.replace(base, **fields)  # type: ignore[arg-type]
    height = fields.get("L", base.L) - fields.get("D", base.D) / 2
    changed: dict[str, Any] = {**fields, "l0": base.l0 + height - base.H}
    if not changed["l0"] > base.magnet_height / 2:
        raise BadInput("S1 keeps its place in the base and would touch the magnet: take a larger L or a smaller D")
    return dataclasses.replace(base, **changed)


def _key(design: Design, magnet: Magnet) -> Key:
    """What a dimensionless press depends on; accuracy and kind of magnet are the same for a whole sweep."""
    shape = design.shape if magnet == "rigid" else design.shape.without_magnet()
    scaled = dataclasses.astuple(shape.scaled(1 / design.D))
    return (*(round(length, DIGITS) for length in scaled), design.nu, design.law, *design.law_numbers)


def _solve(
    cases: Sequence[Case], magnet: Magnet, accuracy: Accuracy, progress: Progress | None, store: Kept
) -> Iterator[Solved]:
    """What became of each case, in order: one path for each group of cases that are the same problem."""
    problems = _problems(cases, magnet, accuracy)
    of = {id(case): problem for problem in problems for case in problem.members}
    for case in cases:
        if case.design is None:
            yield Solved(None, "bad_input", case.message, NAN, 0, 0.0)
            continue
        problem = of[id(case)]
        if problem.key not in store.known:
            low, high = (problem.number - 1) / len(problems), problem.number / len(problems)
            share = part(progress, low, high, f"solve {problem.number} of {len(problems)}")
            try:
                store.keep(problem.key, _states(problem, accuracy, magnet, share))
            except KeyboardInterrupt:
                raise KeyboardInterrupt(_left(cases, problems, store)) from None
        yield _scaled(store.known[problem.key], problem, case)


def _problems(cases: Sequence[Case], magnet: Magnet, accuracy: Accuracy) -> list[Problem]:
    groups: dict[Key, list[Case]] = {}
    for case in cases:
        if case.design is not None:
            groups.setdefault(_key(case.design, magnet), []).append(case)
    problems = []
    for number, (key, members) in enumerate(groups.items(), start=1):
        first = members[0].design
        assert first is not None
        depths: dict[float, float] = {}
        for case in members:
            depths.setdefault(_relative_depth(case), case.depth * (first.D / case.values["D"]))
        path = dict(sorted(depths.items()))
        text = json.dumps([magnet, *key, list(path), dataclasses.astuple(accuracy)])
        problems.append(Problem(number, first, members, path, text))
    return problems


def _states(problem: Problem, accuracy: Accuracy, magnet: Magnet, progress: Progress | None) -> dict[str, Any]:
    """D and E of the design that is solved, mm and MPa, and what became of each depth of the path."""
    first = problem.first
    outcomes = follow(first, [Load(depth=depth) for depth in problem.path.values()], accuracy, magnet, progress)
    return {
        "D": first.D,
        "E": first.E,
        "states": [
            {
                "status": outcome.status,
                "message": outcome.message,
                "response": None if outcome.response is None else dataclasses.asdict(outcome.response),
                "error_estimate": None if math.isnan(outcome.error_estimate) else outcome.error_estimate,
                "seconds": outcome.solution.seconds if outcome.solution else 0.0,
            }
            for outcome in outcomes
        ],
    }


def _left(cases: Sequence[Case], problems: Sequence[Problem], store: Kept) -> str:
    """What an interruption leaves."""
    if store.file is None:
        return "nothing is kept: add --out DIR to keep solved cases"
    done = sum(len(problem.members) for problem in problems if problem.key in store.known)
    if not done:
        return "no case is solved yet: the same command starts from the beginning"
    return f"{done} of {len(cases)} cases are kept in {store.file}; the same command continues from there"


def _relative_depth(case: Case) -> float:
    return round(case.depth / case.values["D"], DIGITS)


def _scaled(kept: dict[str, Any], problem: Problem, case: Case) -> Solved:
    """A state of a path in the units of a case of the same problem."""
    state = kept["states"][list(problem.path).index(_relative_depth(case))]
    estimate = NAN if state["error_estimate"] is None else state["error_estimate"]
    about = state["status"], state["message"]
    if state["message"] and case.values["D"] != kept["D"]:
        about = state["status"], f"solved at D = {kept['D']:g} mm: {state['message']}"
    if state["response"] is None:
        return Solved(None, *about, NAN, problem.number, state["seconds"])
    length = case.values["D"] / kept["D"]
    force = case.values["E"] / kept["E"] * length**2
    response = Response(**state["response"]).scaled(length, force)
    return Solved(response, *about, estimate, problem.number, state["seconds"])
