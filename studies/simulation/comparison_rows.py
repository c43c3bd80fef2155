"""The rows of a comparison: a press and a sheared press by three mechanics, with the readings of the Hall elements.

Names of values: "fem" is the finite elements with the rigid magnet, "fem_homogeneous" those of a beam that is all
silicone, "analytic" the formulas, and "untilted" the pose of "fem" without its tilt.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from analytic import hall
from geometry.design import BadInput, Design
from geometry.loads import Response
from studies.output import records
from studies.output.records import FlatRow
from studies.sensing.field_readings import columns

NAN = math.nan


@dataclass(frozen=True, slots=True)
class Quantity:
    """A quantity by the three mechanics, and the formula's errors against both finite elements, %; NaN for none."""

    fem: float
    fem_homogeneous: float
    analytic: float
    error_percent: float = NAN
    homogeneous_error_percent: float = NAN


@dataclass(frozen=True, slots=True)
class Reading:
    """Reading of a Hall element: the field, mT, and its output, V, or mT for a chip."""

    field_mT: float
    output: float


@dataclass(frozen=True, slots=True)
class ElementReadings:
    """Readings of one Hall element by each model, and their errors against "fem" in % of full scale.

    Attributes
    ----------
    element : name of the element in columns.
    unit : suffix of the output's column, V or output_mT.
    untilted : None in a press, which has no tilt.
    """

    element: str
    unit: str
    fem: Reading
    analytic: Reading
    untilted: Reading | None = None
    analytic_error_percent_FS: float = NAN
    untilted_error_percent_FS: float = NAN


def _quantity_columns(column: str, error: str, quantity: Quantity) -> FlatRow:
    """Return the columns of a quantity, and of its errors if they have a name."""
    row: FlatRow = {
        f"fem_{column}": quantity.fem,
        f"fem_homogeneous_{column}": quantity.fem_homogeneous,
        f"analytic_{column}": quantity.analytic,
    }
    if error:
        row[f"{error}_error_percent"] = quantity.error_percent
        row[f"homogeneous_{error}_error_percent"] = quantity.homogeneous_error_percent
    return row


def _reading_columns(readings: Sequence[ElementReadings]) -> FlatRow:
    """Return the columns of readings: all fields, then all outputs, then all errors."""
    fields, outputs, errors = FlatRow(), FlatRow(), FlatRow()
    for r in readings:
        models = {"fem": r.fem, "untilted": r.untilted, "analytic": r.analytic}
        known = {model: reading for model, reading in models.items() if reading is not None}
        fields |= {f"{model}_{r.element}_mT": reading.field_mT for model, reading in known.items()}
        outputs |= {f"{model}_{r.element}_{r.unit}": reading.output for model, reading in known.items()}
        if r.untilted is not None:
            errors[f"untilted_{r.element}_error_percent_FS"] = r.untilted_error_percent_FS
        errors[f"analytic_{r.element}_error_percent_FS"] = r.analytic_error_percent_FS
    return fields | outputs | errors


def _compared(column: str, error: str = "") -> dict[str, Callable[[Quantity], FlatRow]]:
    """Return the metadata of a field that holds a quantity: the names of its columns."""
    return {"columns": functools.partial(_quantity_columns, column, error)}


@dataclass(frozen=True, slots=True)
class PressRow:
    """A press to one depth."""

    depth_mm: float
    force_N: Quantity = field(metadata=_compared("force_N", "force"))
    shift_z_mm: Quantity = field(metadata=_compared("shift_z_mm", "shift"))
    contact_radius_mm: Quantity = field(metadata=_compared("contact_radius_mm", "contact_radius"))
    readings: tuple[ElementReadings, ...] = field(metadata={"columns": _reading_columns})
    error_estimate: float
    homogeneous_error_estimate: float
    status: str
    message: str

    def row(self) -> FlatRow:
        """The flat row of tables, CSV files and JSON."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class ShearRow:
    """A press to one depth whose plate, stuck to the tip, has moved sideways.

    The error estimates are relative errors of the force as a vector, and of its part along the shear.
    """

    shear_mm: float
    depth_mm: float
    force_x_N: Quantity = field(metadata=_compared("force_x_N", "force_x"))
    force_z_N: Quantity = field(metadata=_compared("force_z_N", "force_z"))
    shift_x_mm: Quantity = field(metadata=_compared("shift_x_mm", "shift_x"))
    shift_z_mm: Quantity = field(metadata=_compared("shift_z_mm"))
    tilt_rad: Quantity = field(metadata=_compared("tilt_rad"))
    readings: tuple[ElementReadings, ...] = field(metadata={"columns": _reading_columns})
    error_estimate: float
    homogeneous_error_estimate: float
    sideways_error_estimate: float
    homogeneous_sideways_error_estimate: float
    status: str
    message: str

    def row(self) -> FlatRow:
        """The flat row of tables, CSV files and JSON."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class Answers:
    """Poses of the magnet by the three mechanics; None if one has no solution."""

    fem: Response | None
    fem_homogeneous: Response | None
    analytic: Response | None

    def quantity(self, value: Callable[[Response], float], *, judged: bool = True) -> Quantity:
        """Return a quantity of the poses by each mechanics; without errors if `judged` is False."""
        fem, bare, formula = (
            NAN if pose is None else value(pose) + 0.0 for pose in (self.fem, self.fem_homogeneous, self.analytic)
        )
        errors = (percent(formula, fem), percent(formula, bare)) if judged else (NAN, NAN)
        return Quantity(fem, bare, formula, *errors)

    def readings(self, design: Design, count: int, *, untilted: bool = False) -> tuple[ElementReadings, ...]:
        """Return the readings of the first `count` elements; `with_reading_errors` adds the errors."""
        names, unit = columns(design)
        fem, formula = element_readings(design, self.fem), element_readings(design, self.analytic)
        upright = None if self.fem is None else dataclasses.replace(self.fem, tilt=0.0)
        still = element_readings(design, upright) if untilted else (None,) * 3
        return tuple(
            ElementReadings(name, unit, a, b, c)
            for name, a, b, c in list(zip(names, fem, formula, still, strict=True))[:count]
        )


def percent(model: float, truth: float) -> float:
    """Return the relative error in %; NaN if the reference is 0 or unknown.

    >>> percent(1.5, 1.0), percent(1.0, 0.0)
    (50.0, nan)
    """
    return 100 * (model / truth - 1) if truth else NAN


def element_readings(design: Design, response: Response | None) -> tuple[Reading, Reading, Reading]:
    """Return the readings of the three elements at a pose; NaN without a pose, a magnet or a finite field."""
    unknown = Reading(NAN, NAN)
    if response is None or not design.shape.has_magnet:
        return unknown, unknown, unknown
    try:
        seen = hall.readings(design, response)
    except BadInput:
        return unknown, unknown, unknown
    sizes = [1.0 if unit == "V" else 1e3 for unit in seen.units]
    first, second, third = (
        Reading(1e3 * b, size * output) for b, output, size in zip(seen.B_T, seen.output, sizes, strict=True)
    )
    return first, second, third


def at_rest(design: Design) -> tuple[Reading, Reading, Reading]:
    """Return the readings without a load."""
    return element_readings(design, Response((0.0,) * 3, (0.0,) * 3, 0.0, 0.0))


def with_reading_errors(
    design: Design, press: Sequence[PressRow], shear: Sequence[ShearRow]
) -> tuple[list[PressRow], list[ShearRow]]:
    """Return the rows with the errors of the readings in % of full scale.

    Full scale is the largest change from rest of the "fem" readings in all rows. The second and the third element
    share one full scale, since a shear along y swaps them.
    """
    readings = [row.readings for row in press] + [row.readings for row in shear]
    scale = _full_scales(design, readings)
    return (
        [dataclasses.replace(row, readings=_judged(row.readings, scale)) for row in press],
        [dataclasses.replace(row, readings=_judged(row.readings, scale)) for row in shear],
    )


def _full_scales(design: Design, rows: Iterable[Sequence[ElementReadings]]) -> tuple[float, float, float]:
    rest, largest = at_rest(design), [0.0, 0.0]
    for readings in rows:
        for k, reading in enumerate(readings):
            change = abs(reading.fem.field_mT - rest[k].field_mT)
            # a NaN exceeds nothing
            if change > largest[min(k, 1)]:
                largest[min(k, 1)] = change
    first, other = (value or NAN for value in largest)
    return first, other, other


def _judged(readings: Sequence[ElementReadings], scale: Sequence[float]) -> tuple[ElementReadings, ...]:
    def error(reading: Reading | None, k: int) -> float:
        return NAN if reading is None else 100 * (reading.field_mT - readings[k].fem.field_mT) / scale[k]

    return tuple(
        dataclasses.replace(
            r, analytic_error_percent_FS=error(r.analytic, k), untilted_error_percent_FS=error(r.untilted, k)
        )
        for k, r in enumerate(readings)
    )
