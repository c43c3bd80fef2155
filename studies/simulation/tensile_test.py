"""Read and check uniaxial tests in CSV files: stretch and nominal stress."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from geometry.bad_input import closest
from geometry.design import SILICONE_E, BadInput
from studies.inputs import table_input

STRETCH = {"stretch": (0.0, 1.0), "strain": (1.0, 1.0), "strain_percent": (1.0, 0.01)}
"""Columns of the deformation: stretch = first number + second number * value."""

SAME_WORD = {"strain": "strain_percent", "strain_percent": "strain"}
"""Columns that are easily taken for each other: 0.1 and 10 are one strain."""

STRESS = {"nominal_stress_MPa": 1.0, "nominal_stress_kPa": 1e-3, "nominal_stress_Pa": 1e-6}
"""Columns of the force over the first cross-section, and their unit in MPa."""

LOWEST, HIGHEST, MOST_STRESS = 0.05, 20.0, 1e5

WRONG_SIGN = 0.2
"""Stress over the largest that may have the other sign than the strain: friction, preload and permanent set stay
below, a compression with a positive stress does not."""


@dataclass(frozen=True, slots=True)
class Specimen:
    """Points of a uniaxial test, in the file's order: stretch, shape (n,), and nominal stress, shape (n,), MPa.

    `column` is the name of the stress in the file.
    """

    stretch: Array
    stress: Array
    column: str = "nominal_stress_MPa"

    @property
    def telling(self) -> NDArray[np.bool_]:
        """Points with a stretch other than 1: at 1 every law has the stress 0, shape (n,)."""
        return np.asarray(self.stretch != 1)

    @property
    def least_strain(self) -> float:
        """Smallest absolute value of a strain other than 0."""
        return float(np.abs(self.stretch[self.telling] - 1).min())

    def near(self, strain: float) -> NDArray[np.bool_]:
        """Return the points with strains up to this size; if there are none, those with the smallest, shape (n,)."""
        limit = max(strain, self.least_strain)
        return np.asarray(self.telling & (np.abs(self.stretch - 1) <= limit * (1 + 1e-9)))


def read(path: str) -> Specimen:
    """Read the test in a CSV file: a header with one column of `STRETCH` and one of `STRESS`; # begins a comment.

    Raises
    ------
    BadInput
        The file cannot be read, a column is missing or ambiguous, a value is no number or not possible, or there
        are too few points.
    """
    rows = [(line, [cell.strip() for cell in row]) for line, row in table_input.csv_rows(Path(path), comments=True)]
    line, header = rows.pop(0) if rows else (1, [])
    if not header:
        raise BadInput(f"{path!r} is empty: give a header, such as stretch,nominal_stress_MPa, and points")
    along, across = column_of(path, line, header, tuple(STRETCH)), column_of(path, line, header, tuple(STRESS))
    table_input.check_rows(path, rows)
    offset, factor = STRETCH[header[along]]
    stretch, stress = [], []
    for line, row in rows:
        value = offset + factor * value_of(path, line, header, row, along)
        if not LOWEST <= value <= HIGHEST:
            raise BadInput(
                f"{path!r}, line {line}, column {header[along]}: the stretch must lie between {LOWEST:g} and "
                f"{HIGHEST:g}; got {value:g}: check the column's unit"
            )
        force = STRESS[header[across]] * value_of(path, line, header, row, across)
        if not abs(force) <= MOST_STRESS:
            raise BadInput(
                f"{path!r}, line {line}, column {header[across]}: the stress must lie within "
                f"{MOST_STRESS:g} MPa; got {force:g} MPa: check the column's unit"
            )
        stretch.append(value)
        stress.append(force)
    _check_curve(path, (header[along], header[across]), stretch, stress, [line for line, _ in rows])
    check_strain(path, header[along], np.array(stretch), np.array(stress))
    return Specimen(np.array(stretch), np.array(stress), header[across])


def _check_curve(
    path: str, names: tuple[str, str], stretch: list[float], stress: list[float], lines: list[int]
) -> None:
    if all(value == 1 for value in stretch):
        raise BadInput(f"{path!r} has no data at a stretch other than 1: a fit needs at least one point")
    for name, values in zip(names, (stretch, stress), strict=True):
        if len(values) > 1 and min(values) == max(values):
            raise BadInput(f"{path!r}, column {name}: all {len(values)} values are equal: give a curve")
    largest = max(map(abs, stress))
    wrong = [(x - 1) * y < 0 for x, y in zip(stretch, stress, strict=True)]
    for line, x, y, bad in zip(lines, stretch, stress, wrong, strict=True):
        if bad and not all(wrong) and abs(y) > WRONG_SIGN * largest:
            raise BadInput(
                f"{path!r}, line {line}: at a stretch of {x:g} the nominal stress is {y:g} MPa: tension must be "
                "positive and compression negative in both columns"
            )


def check_strain(path: str, column: str, stretch: Array, stress: Array) -> None:
    """Refuse strains that give the modulus of no silicone, but would give one if they were fractions or percent.

    The modulus is that of the neo-Hookean law through all points: stress = E / 3 (stretch - stretch^-2).

    Parameters
    ----------
    column : name of the column of which the stretches are.
    stretch, stress : shape (n,) each; stress in MPa.
    """
    if column not in SAME_WORD:
        return
    offset, factor = STRETCH[column]
    otherwise = offset + STRETCH[SAME_WORD[column]][1] / factor * (stretch - offset)
    if not (otherwise > 0).all():
        return
    stated, other = (_slope((at - at**-2.0) / 3, stress) for at in (stretch, otherwise))
    low, high = SILICONE_E
    if not low <= stated <= high and low <= other <= high:
        raise BadInput(
            f"{path!r}, column {column}: with these strains E would be about {stated:.3g} MPa, beyond the range of "
            f"silicones, {low:g} to {high:g} MPa, and about {other:.3g} MPa if they were those of a column "
            f"{SAME_WORD[column]}: call the column strain if 0.1 is 10 %, strain_percent if 10 is 10 %, or give a "
            "column stretch"
        )


def _slope(x: Array, y: Array) -> float:
    """Return the slope of the best line through the origin."""
    return float(x @ y / (x @ x))


def column_of(path: str, line: int, header: list[str], wanted: tuple[str, ...]) -> int:
    """Return the index of the only column with a wanted name."""
    found = [k for k, name in enumerate(header) if name in wanted]
    if len(found) > 1:
        names = " and ".join(header[k] for k in found)
        raise BadInput(f"{path!r}, line {line}: columns {names} give the same quantity: keep one of them")
    if found:
        return found[0]
    for name in header:
        if "%" in name and SAME_WORD["strain"] in wanted and name.casefold().startswith("strain"):
            raise BadInput(f"{path!r}, line {line}: there is no column {name!r}: did you mean strain_percent?")
        same = [other for other in wanted if name.casefold() == other.casefold()]
        if same:
            raise BadInput(f"{path!r}, line {line}: there is no column {name!r}: did you mean {same[0]}?")
        units = [other for other in wanted if name and other.casefold().startswith(f"{name.casefold()}_")]
        if units:
            raise BadInput(
                f"{path!r}, line {line}: the name of column {name!r} has no unit: call it {' or '.join(units)}"
            )
        meant = closest(name, wanted) if name else None
        if meant:
            raise BadInput(f"{path!r}, line {line}: there is no column {name!r}: did you mean {meant}?")
    names = ", ".join(filter(None, header))
    raise BadInput(f"{path!r}, line {line}: the header needs a column {' or '.join(wanted)}; got {names!r:.80}")


def value_of(path: str, line: int, header: list[str], row: list[str], column: int) -> float:
    table_input.check_length(Path(path), line, header, row)
    value = table_input.number(row[column])
    if value is None or not math.isfinite(value):
        raise BadInput(
            f"{path!r}, line {line}, column {header[column]}: must be a finite number; got {row[column]!r:.40}"
            f"{table_input.comma_remedy(row[column])}"
        )
    return value
