"""Sweeps: finite elements and formulas over a grid of designs and depths, with as few solves as possible.

The finite elements use lengths over D and stresses over E. Cases that differ only in E, f or scale are therefore one
problem and share a solve: one press to all their depths over D, whose forces scale with E D^2 and lengths with D.

The Hall elements keep the places that they have in the base design: if D or L moves the undeformed magnet's centre
from H to H', l0 becomes l0 + H' - H. The magnet keeps its size; a case whose beam is too small for it gets a row with
status bad_input.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fem.accuracy import STANDARD, Accuracy
from fem.scene import Scene
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, check_load
from geometry.messages import Progress
from studies.exploration import store
from studies.exploration.solved_paths import Answer, answers, content
from studies.exploration.store import Position, Store
from studies.exploration.sweep_rows import FIELDS, Case, Solved, SweepRow, sweep_row
from studies.output import console
from studies.output.csv_tables import write_table
from studies.output.records import FlatRow
from studies.simulation.compare import part
from studies.simulation.comparison_rows import NAN

MOST_CASES = 20_000
SILENCE = 2.0
"""Time without progress after which the number of rows is shown, s."""


@dataclass(frozen=True, slots=True)
class Problem:
    """Cases that share one path of presses.

    Attributes
    ----------
    number : number of the solve, from 1.
    members : the cases.
    scene : presses of the first member's design to the depths of all members, in rising order.
    """

    number: int
    members: list[Case]
    scene: Scene


def run(
    design: Design,
    axes: Mapping[str, Sequence[float]],
    folder: Path | None,
    *,
    depth: float,
    magnet: Magnet = "rigid",
    accuracy: Accuracy = STANDARD,
    progress: Progress | None = None,
    kept: Store | None = None,
) -> Iterator[SweepRow]:
    """Yield a row for each combination of the axes as soon as it is solved; write sweep.csv and sweep.png at the end.

    Parameters
    ----------
    axes : values of any of D, L, f, E and depth; the first one that changes the force is the plot's horizontal axis.
    folder : existing output folder; None writes nothing.
    depth : depth of the press if depth is not an axis, mm.
    magnet : model of the magnet; a design without a magnet is always solved as all silicone.
    kept : store of solved states, which supplies known states and receives new ones; None solves all of them.

    Returns
    -------
    A row for each case; the last axis varies fastest. A case that cannot be solved has a row with NaN for its
    results, a status and a message. `solve` is the number of the solve that a row comes from (0: none). `seconds` is
    the time of that solve from the previous state to the row's; rows that share a state have the same value.

    Raises
    ------
    BadInput
        An axis is unknown or there are too many cases; raised before the first row.
    KeyboardInterrupt
        The sweep was interrupted; the text states how many cases are in the store.
    """
    unknown = [name for name in axes if name != "depth" and name not in FIELDS]
    if unknown or not axes:
        raise BadInput(f"the axes of a sweep must be D, L, f, E or depth; got {', '.join(unknown) or 'none'}")
    count = math.prod(len(values) for values in axes.values())
    if count > MOST_CASES:
        raise BadInput(f"a sweep may have at most {MOST_CASES} cases; these axes give {count}: take fewer values")
    magnet = magnet if design.shape.has_magnet else "ignored"
    cases = list(_cases(design, axes, depth, magnet))
    return _rows(design, cases, axes, folder, magnet, accuracy, progress, kept)


def _rows(
    base: Design,
    cases: Sequence[Case],
    axes: Mapping[str, Sequence[float]],
    folder: Path | None,
    magnet: Magnet,
    accuracy: Accuracy,
    progress: Progress | None,
    kept: Store | None,
) -> Iterator[SweepRow]:
    """Yield the rows, report progress, and write the files."""
    rows: list[SweepRow] = []
    last_report = time.monotonic()

    def report(fraction: float, text: str) -> None:
        nonlocal last_report
        last_report = time.monotonic()
        if progress is not None:
            progress(fraction, text)

    for case, solved in zip(cases, _solve(cases, magnet, accuracy, report, kept), strict=True):
        rows.append(sweep_row(base, case, solved))
        yield rows[-1]
        # cases of one solve report no progress of their own, yet the formulas of many rows take time
        if time.monotonic() - last_report > SILENCE:
            report(len(rows) / len(cases), f"row {len(rows)} of {len(cases)}")
    if folder is not None:
        report(1.0, "sweep.csv and sweep.png")
        table = [row.row() for row in rows]
        write_table(folder / "sweep.csv", table)
        _draw(folder / "sweep.png", table, axes)


def _draw(path: Path, table: Sequence[FlatRow], axes: Mapping[str, Sequence[float]]) -> None:
    """Draw the press force and its error."""
    from studies.exploration import sweep_plot

    columns = {name: np.array([row[name] for row in table]) for name in table[0]}
    named = {"E_MPa" if name == "E" else f"{name}_mm": values for name, values in axes.items()}
    models = {"FEM": "fem_force_N", "paper": "analytic_force_N"}
    force = sweep_plot.Shown("press force", "N", models, {"paper": "force_error_percent"})
    sweep_plot.draw(path, columns, named, [force])


def _cases(base: Design, axes: Mapping[str, Sequence[float]], depth: float, magnet: Magnet) -> Iterator[Case]:
    """Yield the cases of the grid; an impossible one has no design but a message."""
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
    """Return the base design with other D, L, f or E; its Hall elements keep their places.

    >>> from geometry.design import paper
    >>> varied(paper(), {"L": 11.0}).l0
    9.2
    """
    # check the fields themselves first: their errors are clearer than those of the l0 that follows from them
    dataclasses.replace(base, **fields)  # type: ignore[arg-type]
    height = fields.get("L", base.L) - fields.get("D", base.D) / 2
    changed: dict[str, Any] = {**fields, "l0": base.l0 + height - base.H}
    if not changed["l0"] > base.magnet_height / 2:
        raise BadInput("S1 keeps its place in the base and would touch the magnet: take a larger L or a smaller D")
    return dataclasses.replace(base, **changed)


def _solve(
    cases: Sequence[Case], magnet: Magnet, accuracy: Accuracy, progress: Progress | None, kept: Store | None
) -> Iterator[Solved]:
    """Yield the state of each case, in order; cases of one problem share a path, which their first case solves."""
    problems = _problems(cases, magnet, accuracy)
    problem_of = {id(case): problem for problem in problems for case in problem.members}
    known: dict[int, dict[Position, Answer]] = {}
    for case in cases:
        if case.design is None:
            yield Solved(None, "bad_input", case.message, NAN, 0, 0.0)
            continue
        problem = problem_of[id(case)]
        number = problem.number
        if number not in known:
            low, high = (number - 1) / len(problems), number / len(problems)
            share = part(progress, low, high, f"solve {number} of {len(problems)}")
            try:
                known[number], trouble = answers(problem.scene, kept, share)
            except KeyboardInterrupt:
                done = sum(len(problem.members) for problem in problems if problem.number in known)
                raise KeyboardInterrupt(_interruption_text(done, len(cases), kept)) from None
            if trouble:
                console.warn(trouble)
        answer = known[number][_position(case)].of(case.values["D"], case.values["E"])
        yield Solved(answer.response, answer.status, answer.message, answer.error_estimate, number, answer.seconds)


def _problems(cases: Sequence[Case], magnet: Magnet, accuracy: Accuracy) -> list[Problem]:
    """Group the cases that share a path, which are those with the same content of a press alone."""
    groups: dict[str, list[Case]] = {}
    for case in cases:
        if case.design is not None:
            alone = Scene(case.design, (Load(depth=case.depth),), accuracy, magnet)
            groups.setdefault(store.key(content(alone)), []).append(case)
    return [
        Problem(number, members, _scene(members, magnet, accuracy))
        for number, members in enumerate(groups.values(), start=1)
    ]


def _scene(members: Sequence[Case], magnet: Magnet, accuracy: Accuracy) -> Scene:
    """Return the presses of the first of similar cases to the depths of all of them."""
    first = members[0].design
    assert first is not None
    depths: dict[Position, float] = {}
    for case in members:
        depths.setdefault(_position(case), case.depth * (first.D / case.values["D"]))
    return Scene(first, tuple(Load(depth=depths[at]) for at in sorted(depths)), accuracy, magnet)


def _position(case: Case) -> Position:
    """Return the position of a case's press over D."""
    return store.position(case.depth / case.values["D"], 0.0)


def _interruption_text(done: int, count: int, kept: Store | None) -> str:
    """State in a sentence what an interrupted sweep has stored."""
    if not done or kept is None:
        return "no case is solved yet: the same command starts from the beginning"
    return f"{done} of {count} cases are kept in {kept.file}; the same command continues from there"
