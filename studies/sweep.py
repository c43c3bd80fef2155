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
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fem.levels import STANDARD, Accuracy
from geometry.design import BadInput, Design
from geometry.scene import Load, Magnet, Response, check_load
from studies.compare import NAN, Outcome, Progress, Row, follow, formulas, part, percent, reading, write_table
from studies.fields import columns

DIGITS = 12
"""Decimal digits of lengths over D that must agree for two cases to be one problem."""

Key = tuple[float | str, ...]

UNITS = {"D": "mm", "L": "mm", "f": "mm", "E": "MPa"}
MOST_CASES = 20_000


@dataclass(frozen=True, slots=True)
class Case:
    """One point of the grid.

    Attributes
    ----------
    values : of every axis, and of D, L, f, E and the depth where they are no axis.
    design : None if it is refused, and `message` says why.
    """

    values: dict[str, float]
    design: Design | None
    message: str

    @property
    def depth(self) -> float:
        return self.values["depth"]


@dataclass(frozen=True, slots=True)
class Solved:
    """An outcome in the units of the case; `number` is that of the solve, 0 for none."""

    response: Response | None
    status: str
    message: str
    error_estimate: float
    number: int
    seconds: float


def run(
    design: Design,
    axes: Mapping[str, Sequence[float]],
    folder: Path | None,
    *,
    depth: float,
    magnet: Magnet = "rigid",
    accuracy: Accuracy = STANDARD,
    progress: Progress | None = None,
) -> list[dict[str, Any]]:
    """All combinations of the axes; writes sweep.csv and sweep.png into an existing folder.

    Parameters
    ----------
    axes : values of any of D, L, f, E and depth; the first axis is that of the plot.
    folder : where to; None writes nothing.
    depth : of the press where it is not an axis, mm.
    magnet : a design without one is solved as all silicone, whatever is asked for.

    Returns
    -------
    A row for each case, the last axis varying fastest. A case that cannot be solved keeps its row, with NaN for
    figures, a status and a message. `solve` numbers the solve that a row comes from (0: none), `seconds` is the time
    that solve took to get to the row's state; a state that several rows share is counted in each.
    """
    unknown = [name for name in axes if name != "depth" and name not in UNITS]
    if unknown or not axes:
        raise BadInput(f"the axes of a sweep must be among D, L, f, E and depth; got {', '.join(unknown) or 'none'}")
    count = math.prod(len(values) for values in axes.values())
    if count > MOST_CASES:
        raise BadInput(f"a sweep may have {MOST_CASES} cases; these axes make {count}: take fewer values")
    magnet = magnet if design.shape.has_magnet else "ignored"
    cases = list(_cases(design, axes, depth, magnet))
    solved = _solve(cases, magnet, accuracy, progress)
    rows = [_row(case, outcome, *columns(design)) for case, outcome in zip(cases, solved, strict=True)]
    if folder is not None:
        from studies import plots

        write_table(folder / "sweep.csv", rows)
        plots.sweep(folder / "sweep.png", rows, axes)
    return rows


def _cases(base: Design, axes: Mapping[str, Sequence[float]], depth: float, magnet: Magnet) -> Iterator[Case]:
    for point in itertools.product(*axes.values()):
        values = {name: getattr(base, name) for name in UNITS} | {"depth": depth}
        values |= dict(zip(axes, point, strict=True))
        try:
            design = varied(base, {name: values[name] for name in UNITS})
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
    height = fields.get("L", base.L) - fields.get("D", base.D) / 2
    changed: dict[str, Any] = {**fields, "l0": base.l0 + height - base.H}
    return dataclasses.replace(base, **changed)


def _key(design: Design, magnet: Magnet) -> Key:
    """What a dimensionless press depends on; accuracy and kind of magnet are the same for a whole sweep."""
    shape = design.shape if magnet == "rigid" else design.shape.without_magnet()
    scaled = dataclasses.astuple(shape.scaled(1 / design.D))
    return (*(round(length, DIGITS) for length in scaled), design.nu, design.law, *design.law_numbers)


def _solve(cases: Sequence[Case], magnet: Magnet, accuracy: Accuracy, progress: Progress | None) -> list[Solved]:
    """One path for each group of cases that are the same problem."""
    solved = [Solved(None, "bad_input", case.message, NAN, 0, 0.0) for case in cases]
    groups: dict[Key, list[int]] = {}
    for i, case in enumerate(cases):
        if case.design is not None:
            groups.setdefault(_key(case.design, magnet), []).append(i)
    for number, members in enumerate(groups.values(), start=1):
        share = part(progress, (number - 1) / len(groups), number / len(groups), f"solve {number} of {len(groups)}")
        first = cases[members[0]].design
        assert first is not None
        depths: dict[float, float] = {}
        for i in members:
            depths.setdefault(_relative_depth(cases[i]), cases[i].depth * (first.D / cases[i].values["D"]))
        path = sorted(depths)
        outcomes = follow(first, [Load(depth=depths[relative]) for relative in path], accuracy, magnet, share)
        for i in members:
            solved[i] = _scaled(outcomes[path.index(_relative_depth(cases[i]))], number, first, cases[i])
    return solved


def _relative_depth(case: Case) -> float:
    return round(case.depth / case.values["D"], DIGITS)


def _scaled(outcome: Outcome, number: int, first: Design, case: Case) -> Solved:
    """The outcome for `first` in the units of a case of the same problem."""
    seconds = outcome.solution.seconds if outcome.solution else 0.0
    message = outcome.message
    if outcome.response is None:
        if case.values["D"] != first.D:
            message = f"solved at D = {first.D:g} mm: {message}"
        return Solved(None, outcome.status, message, NAN, number, seconds)
    length = case.values["D"] / first.D
    force = case.values["E"] / first.E * length**2
    pose = outcome.response
    x, y, z = (length * value for value in pose.shift)
    fx, fy, fz = (force * value for value in pose.force)
    response = Response((fx, fy, fz), (x, y, z), pose.tilt, length * pose.contact_radius)
    return Solved(response, outcome.status, message, outcome.error_estimate, number, seconds)


def _row(case: Case, solved: Solved, names: Sequence[str], unit: str) -> Row:
    """The case's figures: FEM, formulas, and the formulas' errors, readings in % of their change from rest."""
    row: Row = {f"{name}_{unit}": case.values[name] for name, unit in UNITS.items()}
    row["depth_mm"] = case.depth
    design, fem = case.design, solved.response
    formula, remark = formulas(design, Load(depth=case.depth)) if design else (None, "")
    poses = {"fem": fem, "analytic": formula}
    for model, pose in poses.items():
        row[f"{model}_force_N"] = pose.force[2] if pose else NAN
        row[f"{model}_shift_z_mm"] = pose.shift[2] if pose else NAN
        row[f"{model}_contact_radius_mm"] = pose.contact_radius if pose else NAN
    for name, column in (("force", "force_N"), ("shift", "shift_z_mm"), ("contact_radius", "contact_radius_mm")):
        row[f"{name}_error_percent"] = percent(row[f"analytic_{column}"], row[f"fem_{column}"])
    none = ((NAN,) * 3, (NAN,) * 3)
    rest, seen, told = (
        reading(design, pose) if design else none
        for pose in (Response((0.0,) * 3, (0.0,) * 3, 0.0, 0.0), fem, formula)
    )
    for k, name in enumerate(names[:2]):
        row |= {f"fem_{name}_mT": seen[0][k], f"analytic_{name}_mT": told[0][k]}
        row |= {f"fem_{name}_{unit}": seen[1][k], f"analytic_{name}_{unit}": told[1][k]}
        row[f"{name}_error_percent_of_change"] = percent(told[0][k] - rest[0][k], seen[0][k] - rest[0][k])
    row |= {"l0_mm": design.l0 if design else NAN, "error_estimate": solved.error_estimate}
    row |= {"solve": solved.number, "seconds": solved.seconds, "status": solved.status}
    return row | {"message": "; ".join(text for text in (solved.message, remark) if text)}
