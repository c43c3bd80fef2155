"""The cases of a sweep, and a row of each: finite elements and formulas side by side, with what S1 and S2 read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from geometry.design import Design
from geometry.loads import Load, Response
from studies.output import records
from studies.output.records import FlatRow
from studies.sensing.field_readings import columns
from studies.simulation.compare import formulas
from studies.simulation.comparison_rows import NAN, Reading, at_rest, element_readings, percent

FIELDS = ("D", "L", "f", "E")
"""Fields of a design that can be axes, beside the depth."""


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


@dataclass(frozen=True, slots=True)
class PressAnswer:
    """A press by one model; NaN where it has no answer."""

    force_N: float
    shift_z_mm: float
    contact_radius_mm: float


@dataclass(frozen=True, slots=True)
class SweptReading:
    """What one Hall element reads by both models, and the formulas' error in % of the change from rest.

    Attributes
    ----------
    element : its name in columns.
    unit : the ending of its output's column, V or output_mT.
    """

    element: str
    unit: str
    fem: Reading
    analytic: Reading
    error_percent_of_change: float


def _reading_columns(readings: Sequence[SweptReading]) -> FlatRow:
    row: FlatRow = {}
    for r in readings:
        row |= {f"fem_{r.element}_mT": r.fem.field_mT, f"analytic_{r.element}_mT": r.analytic.field_mT}
        row |= {f"fem_{r.element}_{r.unit}": r.fem.output, f"analytic_{r.element}_{r.unit}": r.analytic.output}
        row[f"{r.element}_error_percent_of_change"] = r.error_percent_of_change
    return row


@dataclass(frozen=True, slots=True)
class SweepRow:
    """The row of a case.

    Attributes
    ----------
    D_mm, L_mm, f_mm, E_MPa, depth_mm : of the case, whether it can be solved or not.
    force_error_percent, shift_error_percent, contact_radius_error_percent : formulas against finite elements.
    readings : of the first two elements.
    l0_mm : of the case's design, NaN where that is refused.
    error_estimate : relative error of the finite elements' force.
    solve : number of the solve that the row comes from, 0 for none.
    seconds : that this solve took to get to the row's state.
    """

    D_mm: float
    L_mm: float
    f_mm: float
    E_MPa: float
    depth_mm: float
    fem: PressAnswer = field(metadata={"prefix": "fem_"})
    analytic: PressAnswer = field(metadata={"prefix": "analytic_"})
    force_error_percent: float
    shift_error_percent: float
    contact_radius_error_percent: float
    readings: tuple[SweptReading, ...] = field(metadata={"columns": _reading_columns})
    l0_mm: float
    error_estimate: float
    solve: int
    seconds: float
    status: str
    message: str

    def row(self) -> FlatRow:
        """The flat row of tables, CSV files and JSON."""
        return records.flat(self)

    def on_axis(self, axis: str) -> float:
        """The case's value of an axis."""
        places = {"D": self.D_mm, "L": self.L_mm, "f": self.f_mm, "E": self.E_MPa, "depth": self.depth_mm}
        return places[axis]


def sweep_row(base: Design, case: Case, solved: Solved) -> SweepRow:
    """The row of a case of a base design that has been solved, or refused."""
    design = case.design
    formula, remark = formulas(design, Load(depth=case.depth)) if design else (None, "")
    fem, analytic = _answer(solved.response), _answer(formula)
    return SweepRow(
        D_mm=case.values["D"],
        L_mm=case.values["L"],
        f_mm=case.values["f"],
        E_MPa=case.values["E"],
        depth_mm=case.depth,
        fem=fem,
        analytic=analytic,
        force_error_percent=percent(analytic.force_N, fem.force_N),
        shift_error_percent=percent(analytic.shift_z_mm, fem.shift_z_mm),
        contact_radius_error_percent=percent(analytic.contact_radius_mm, fem.contact_radius_mm),
        readings=_readings(base, case.design, solved.response, formula),
        l0_mm=design.l0 if design else NAN,
        error_estimate=solved.error_estimate,
        solve=solved.number,
        seconds=solved.seconds,
        status=solved.status,
        message="; ".join(text for text in (solved.message, remark) if text),
    )


def _answer(pose: Response | None) -> PressAnswer:
    return PressAnswer(pose.force[2], pose.shift[2], pose.contact_radius) if pose else PressAnswer(NAN, NAN, NAN)


def _readings(
    base: Design, design: Design | None, fem: Response | None, formula: Response | None
) -> tuple[SweptReading, ...]:
    """What S1 and S2 read; NaN for a case whose design is refused."""
    names, unit = columns(base)
    if design is None:
        unknown = Reading(NAN, NAN)
        return tuple(SweptReading(name, unit, unknown, unknown, NAN) for name in names[:2])
    rest, by_fem, by_formula = at_rest(design), element_readings(design, fem), element_readings(design, formula)
    return tuple(
        SweptReading(name, unit, b, c, percent(c.field_mT - a.field_mT, b.field_mT - a.field_mT))
        for name, a, b, c in list(zip(names, rest, by_fem, by_formula, strict=True))[:2]
    )
