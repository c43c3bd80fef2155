"""The magnetic field at the points of a table (`magtip field`), and the reader of tables with named columns."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from geometry.design import BadInput, Design
from studies.inputs import table_input
from studies.inputs.option_groups import FieldLevel, Pose
from studies.output import atomic_files
from studies.sensing.field_readings import pose_of

if TYPE_CHECKING:
    from geometry.arrays import Array


POINT_COLUMNS = ["x_mm", "y_mm", "z_mm"]
"""Columns of a table of points."""
FIELD_COLUMNS = ["Bx_T", "By_T", "Bz_T"]
"""Columns that `add_field` adds."""


def add_field(design: Design, points: Path, pose: Pose, level: FieldLevel, out: Path | None) -> None:
    """Write the table of points with the columns `FIELD_COLUMNS` added, to a file or to standard output.

    Numbers are written with all digits, so that reading them back gives the same bits.

    Raises
    ------
    BadInput
        A file cannot be read or written, is not a table of points, or the field at a point is unknown.
    """
    from analytic import hall

    target = None if out is None else atomic_files.check_output_file(out, ".csv")
    shift, tilt = pose_of(pose)
    head, rows, places = read_points(points)
    try:
        b = hall.field_at(places, design, shift, tilt, field=level)
    except BadInput as error:
        raise BadInput(f"{points}: {error}") from None
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*head, *FIELD_COLUMNS])
    writer.writerows([*row, *map(repr, values)] for row, values in zip(rows, (b + 0.0).tolist(), strict=True))
    if target is None:
        print(text.getvalue(), end="", flush=True)
    else:
        atomic_files.write_text(target, text.getvalue())


def read_points(path: Path) -> tuple[list[str], list[list[str]], Array]:
    """Return head and rows of a table as text, and its points, shape (n, 3), mm."""
    return read_rows(path, POINT_COLUMNS, FIELD_COLUMNS)


def read_rows(
    path: Path,
    wanted: list[str],
    added: list[str],
    *,
    holes: bool = False,
    instead: Mapping[str, list[str]] | None = None,
) -> tuple[list[str], list[list[str]], Array]:
    """Return head and rows of a table as text, and the numbers in the wanted columns, shape (n, len(wanted)).

    Parameters
    ----------
    added : columns that the caller will add, so that the table must not contain them.
    holes : read an empty cell or a NaN as NaN; default: refuse it.
    instead : for each option, the columns that it would read instead; a message suggests the option.
    """
    import numpy as np

    rows = table_input.csv_rows(path)
    if not rows:
        raise BadInput(f"{path} is empty: its first line must name the columns {','.join(wanted)}")
    head = [name.strip() for name in rows.pop(0)[1]]
    _check_head(path, head, wanted, added, instead or {})
    table_input.check_rows(path, rows)
    columns = [head.index(name) for name in wanted]
    values = np.empty((len(rows), len(wanted)))
    for k, (line, row) in enumerate(rows):
        table_input.check_length(path, line, head, row)
        for j, column in enumerate(columns):
            cell = row[column]
            value = table_input.number("nan" if holes and not cell.strip() else cell)
            if value is None or not (math.isfinite(value) or (holes and math.isnan(value))):
                unit = wanted[j].rpartition("_")[2]
                raise BadInput(
                    f"{path}, line {line}: {wanted[j]} must be a finite number of {unit}; got {cell!r}"
                    f"{table_input.comma_remedy(cell)}"
                )
            values[k, j] = value
    return head, [row for _, row in rows], values


def _check_head(
    path: Path, head: list[str], wanted: list[str], added: list[str], instead: Mapping[str, list[str]]
) -> None:
    """Refuse a head that lacks a wanted column, repeats or reorders one, or already has an added one."""
    names = ",".join(wanted)
    missing = [name for name in wanted if name not in head]
    if missing:
        for option, alternatives in instead.items():
            if all(name in head for name in alternatives):
                raise BadInput(f"{path}: the columns are {','.join(alternatives)}, not {names}: add {option}")
        raise BadInput(
            f"{path}: column {missing[0]} is missing: the first line must name {names}; got {','.join(head)}"
        )
    if [name for name in head if name in wanted] != wanted:
        raise BadInput(f"{path}: the columns must stand once each in the order {names}; got {','.join(head)}")
    existing = [name for name in added if name in head]
    if existing:
        raise BadInput(f"{path}: column {existing[0]} exists already and would be added again: remove it")
