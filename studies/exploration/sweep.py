"""Both models over a grid of designs and depths, one row per case, with as few finite-element solves as possible.

The finite elements work with lengths over D and stresses over E, so cases that differ only in E, f or scale are one
problem: they share a solve, a path over all their depths over D, and the force is scaled by E D^2 and lengths by D.

The Hall elements stay where the base design has them: when D or L moves the magnet's centre at rest from H to H', l0
becomes l0 + H' - H. The magnet keeps its size, so a case that it does not fit into stays a row with status bad_input.
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
from studies.simulation.compare import part
from studies.simulation.comparison_rows import NAN

MOST_CASES = 20_000
SILENCE = 2.0
"""Seconds after which it is said how many rows there are."""


@dataclass(frozen=True, slots=True)
class Problem:
    """Cases that are one path of presses.

    Attributes
    ----------
    number : of the solve, from 1.
    scene : presses of the first of them to the depths of all, rising.
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
    """All combinations of the axes, each as soon as it is solved; at the end sweep.csv and sweep.png are written.

    Parameters
    ----------
    axes : values of any of D, L, f, E and depth; the first axis is that of the plot.
    folder : where to, an existing one; None writes nothing.
    kept : the store of solved states, which is asked first and takes what is solved; None keeps nothing.
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
    rows: list[SweepRow] = []
    said = time.monotonic()

    def say(fraction: float, text: str) -> None:
        nonlocal said
        said = time.monotonic()
        if progress is not None:
            progress(fraction, text)

    for case, solved in zip(cases, _solve(cases, magnet, accuracy, say, kept), strict=True):
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


def _solve(
    cases: Sequence[Case], magnet: Magnet, accuracy: Accuracy, progress: Progress | None, kept: Store | None
) -> Iterator[Solved]:
    """The state of each case, in order: one path for each group of cases that are the same problem."""
    problems = _problems(cases, magnet, accuracy)
    of = {id(case): problem for problem in problems for case in problem.members}
    known: dict[int, dict[Position, Answer]] = {}
    for case in cases:
        if case.design is None:
            yield Solved(None, "bad_input", case.message, NAN, 0, 0.0)
            continue
        problem = of[id(case)]
        number = problem.number
        if number not in known:
            low, high = (number - 1) / len(problems), number / len(problems)
            share = part(progress, low, high, f"solve {number} of {len(problems)}")
            try:
                known[number], trouble = answers(problem.scene, kept, share)
            except KeyboardInterrupt:
                done = sum(len(problem.members) for problem in problems if problem.number in known)
                raise KeyboardInterrupt(_left(done, len(cases), kept)) from None
            if trouble:
                console.warn(f"{trouble}; the next sweep takes it in")
        answer = known[number][_position(case)].of(case.values["D"], case.values["E"])
        yield Solved(answer.response, answer.status, answer.message, answer.error_estimate, number, answer.seconds)


def _problems(cases: Sequence[Case], magnet: Magnet, accuracy: Accuracy) -> list[Problem]:
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
    """Presses of the first of similar cases to the depths of all."""
    first = members[0].design
    assert first is not None
    depths: dict[Position, float] = {}
    for case in members:
        depths.setdefault(_position(case), case.depth * (first.D / case.values["D"]))
    return Scene(first, tuple(Load(depth=depths[at]) for at in sorted(depths)), accuracy, magnet)


def _position(case: Case) -> Position:
    return store.position(case.depth / case.values["D"], 0.0)


def _left(done: int, count: int, kept: Store | None) -> str:
    """What an interruption leaves."""
    if not done or kept is None:
        return "no case is solved yet: the same command starts from the beginning"
    return f"{done} of {count} cases are kept in {kept.file}; the same command continues from there"
