"""Cases of a sweep, and their rows: results and readings of S1 and S2 by finite elements and by formulas."""

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
"""Fields of a design that can be axes; the depth of the press is the fifth axis."""


@dataclass(frozen=True, slots=True)
class Case:
    """One point of the grid.

    Attributes
    ----------
    values : D, L, f, E and depth, whether they are axes or not.
    design : None if the design is impossible; `message` then gives the reason.
    """

    values: dict[str, float]
    design: Design | None
    message: str

    @property
    def depth(self) -> float:
        """Depth of the press, mm."""
        return self.values["depth"]


@dataclass(frozen=True, slots=True)
class Solved:
    """Result of the finite elements for a case; `number` is that of the solve, 0 for none."""

    response: Response | None
    status: str
    message: str
    error_estimate: float
    number: int
    seconds: float


@dataclass(frozen=True, slots=True)
class PressAnswer:
    """Results of one model for a press; NaN if the model has no result."""

    force_N: float
    shift_z_mm: float
    contact_radius_mm: float


@dataclass(frozen=True, slots=True)
class SweptReading:
    """Reading of one Hall element by both models.

    Attributes
    ----------
    element : name of the element in columns.
    unit : last part of the output column's name, V or output_mT.
    error_percent_of_change : error of the formulas, in percent of the change of the field from rest.
    """

    element: str
    unit: str
    fem: Reading
    analytic: Reading
    error_percent_of_change: float


def _reading_columns(readings: Sequence[SweptReading]) -> FlatRow:
    """Return the columns of the readings, element by element."""
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
    D_mm, L_mm, f_mm, E_MPa, depth_mm : values of the case.
    fem, analytic : results of the finite elements and of the formulas.
    force_error_percent, shift_error_percent, contact_radius_error_percent : errors of the formulas.
    readings : readings of the first two elements.
    l0_mm : of the case's design; NaN if the design is impossible.
    error_estimate : estimated relative error of the finite elements' force.
    solve : number of the solve that the row comes from, 0 for none.
    seconds : time of this solve from the previous state to the row's, s.
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
        """Return the flat row of tables, CSV files and JSON."""
        return records.flat(self)

    def on_axis(self, axis: str) -> float:
        """Return the value of an axis in this case."""
        values = {"D": self.D_mm, "L": self.L_mm, "f": self.f_mm, "E": self.E_MPa, "depth": self.depth_mm}
        return values[axis]


def sweep_row(base: Design, case: Case, solved: Solved) -> SweepRow:
    """Return the row of a case: `solved` has the finite elements' results, the formulas are evaluated here."""
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
    """Return the main results of a response; NaN without one."""
    return PressAnswer(pose.force[2], pose.shift[2], pose.contact_radius) if pose else PressAnswer(NAN, NAN, NAN)


def _readings(
    base: Design, design: Design | None, fem: Response | None, formula: Response | None
) -> tuple[SweptReading, ...]:
    """Return the readings of S1 and S2; NaN if the design is impossible."""
    names, unit = columns(base)
    if design is None:
        unknown = Reading(NAN, NAN)
        return tuple(SweptReading(name, unit, unknown, unknown, NAN) for name in names[:2])
    rest, by_fem, by_formula = at_rest(design), element_readings(design, fem), element_readings(design, formula)
    return tuple(
        SweptReading(
            name,
            unit,
            solved,
            computed,
            percent(computed.field_mT - start.field_mT, solved.field_mT - start.field_mT),
        )
        for name, start, solved, computed in list(zip(names, rest, by_fem, by_formula, strict=True))[:2]
    )
