"""Uniaxial tests in a CSV file: stretch and nominal stress, checked at the door."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geometry.design import BadInput, nearest
from studies import readers

Array = NDArray[np.float64]

STRETCH = {"stretch": (0.0, 1.0), "strain": (1.0, 1.0), "strain_percent": (1.0, 0.01)}
"""Columns of the deformation: stretch = first number + second number * value."""

STRESS = {"nominal_stress_MPa": 1.0, "nominal_stress_kPa": 1e-3, "nominal_stress_Pa": 1e-6}
"""Columns of the force over the first cross-section, and their unit in MPa."""

LEAST_POINTS = 5
LOWEST, HIGHEST, MOST_STRESS = 0.05, 20.0, 1e5


@dataclass(frozen=True, slots=True)
class Specimen:
    """Points of a uniaxial test, in the file's order: stretch, shape (n,), and nominal stress, shape (n,), MPa.

    `column` is the file's name of the stress.
    """

    stretch: Array
    stress: Array
    column: str = "nominal_stress_MPa"


def read(path: str) -> Specimen:
    """The test in a CSV file: a header with one column of `STRETCH` and one of `STRESS`; # begins a comment.

    Raises
    ------
    BadInput
        The file cannot be read, a column is missing or ambiguous, a value is no number or not possible, or there
        are too few points.
    """
    rows = [(line, [cell.strip() for cell in row]) for line, row in readers.csv_rows(Path(path), comments=True)]
    line, header = rows.pop(0) if rows else (1, [])
    if not header:
        raise BadInput(f"{path!r} is empty: give a header, such as stretch,nominal_stress_MPa, and points")
    along, across = _column(path, line, header, tuple(STRETCH)), _column(path, line, header, tuple(STRESS))
    offset, factor = STRETCH[header[along]]
    stretch, stress = [], []
    for line, row in rows:
        value = offset + factor * _value(path, line, header, row, along)
        if not LOWEST <= value <= HIGHEST:
            raise BadInput(
                f"{path!r}, line {line}, column {header[along]}: the stretch must lie between {LOWEST:g} and "
                f"{HIGHEST:g}; got {value:g}: check the column's unit"
            )
        force = STRESS[header[across]] * _value(path, line, header, row, across)
        if not abs(force) <= MOST_STRESS:
            raise BadInput(
                f"{path!r}, line {line}, column {header[across]}: the stress must lie within "
                f"{MOST_STRESS:g} MPa; got {force:g} MPa: check the column's unit"
            )
        stretch.append(value)
        stress.append(force)
    if len(stretch) < LEAST_POINTS:
        raise BadInput(f"{path!r} has {len(stretch)} points: a fit needs {LEAST_POINTS} or more below its header")
    for name, values in ((header[along], stretch), (header[across], stress)):
        if min(values) == max(values):
            raise BadInput(f"{path!r}, column {name}: all {len(values)} values are the same: give a curve")
    return Specimen(np.array(stretch), np.array(stress), header[across])


def _column(path: str, line: int, header: list[str], wanted: tuple[str, ...]) -> int:
    """Place of the one column with a wanted name."""
    found = [k for k, name in enumerate(header) if name in wanted]
    if len(found) > 1:
        names = " and ".join(header[k] for k in found)
        raise BadInput(f"{path!r}, line {line}: columns {names} say the same: keep one of them")
    if found:
        return found[0]
    for name in header:
        units = [other for other in wanted if name and other.casefold().startswith(f"{name.casefold()}_")]
        if units:
            raise BadInput(f"{path!r}, line {line}: the column {name!r} lacks its unit: name it {' or '.join(units)}")
        remedy = nearest(name, wanted)
        if name and remedy.startswith("did"):
            raise BadInput(f"{path!r}, line {line}: there is no column {name!r}: {remedy}")
    raise BadInput(
        f"{path!r}, line {line}: the header needs a column {' or '.join(wanted)}; got {', '.join(header)!r:.80}"
    )


def _value(path: str, line: int, header: list[str], row: list[str], column: int) -> float:
    readers.check_length(Path(path), line, header, row)
    value = readers.number(row[column])
    if value is None or not math.isfinite(value):
        raise BadInput(
            f"{path!r}, line {line}, column {header[column]}: must be a finite number; got {row[column]!r:.40}"
            f"{readers.comma_remedy(row[column])}"
        )
    return value
