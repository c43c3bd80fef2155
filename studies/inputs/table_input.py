"""Readers of CSV tables, of JSON lines, and of solved states; the error of an unreadable file names file and line.

`Measured` is a table of measurements, whose heads have their unit as a suffix (S1_V, time_s) or in brackets (F_x
[N]): what a test stand, a tensile test, a scan or a recording leaves.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import design_digest
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load, Response
from studies.inputs.study_input import OF_STATES
from studies.output import console
from studies.output.bounded_files import LARGEST, MOST_ROWS, finite, json_in, text_of

SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "bars"}
"""Separators that spreadsheets and data loggers write between columns in place of commas."""
COLDEST, HOTTEST = -60.0, 160.0
"""Temperatures, C, that a chip or a magnet in use can have."""
Rows = list[tuple[int, list[str]]]
"""Number of each row's last line, from 1, and its cells as texts; a quoted cell may span several lines."""


def csv_rows(path: Path, *, comments: bool = False) -> Rows:
    """Return the rows of a CSV table that are not empty, the header first; an empty file gives no rows.

    `comments`: whether # begins a comment.
    """
    lines = io.StringIO(text_of(path, "CSV"), newline="")
    reader = csv.reader((line.partition("#")[0] if comments else line for line in lines), strict=True)
    rows: Rows = []
    before = 0
    try:
        for row in reader:
            before = reader.line_num
            _check_count(path, len(rows))
            if row and (len(row) > 1 or row[0].strip()):
                rows.append((reader.line_num, row))
    except csv.Error as error:
        raise BadInput(f"{str(path)!r}, line {before + 1} is not CSV ({error}): check its quotes") from None
    if rows:
        line, head = rows[0][0], ",".join(rows[0][1])
        for sign, name in SEPARATORS.items():
            if head.count(sign) > head.count(","):
                raise BadInput(
                    f"{str(path)!r}, line {line}: {name} separate its columns: save it with commas between columns "
                    "and a point before decimals"
                )
    return rows


def _check_count(path: Path, count: int) -> None:
    if count > MOST_ROWS:
        raise BadInput(f"{str(path)!r} has more than {MOST_ROWS} rows, the most that is read: give a part of it")


def check_rows(path: str | Path, rows: Rows) -> None:
    """Check that a table has rows below its header."""
    if not rows:
        raise BadInput(f"{str(path)!r} has a header but no rows: add a row of numbers below it")


def check_length(path: Path, line: int, head: list[str], row: list[str]) -> None:
    """Check that a row has one cell for each column."""
    if len(row) != len(head):
        # decimal commas double the number of cells: 1,5,2,75 under two columns
        halved = len(row) == 2 * len(head) and all(cell.strip().lstrip("+-").isdecimal() for cell in row)
        remedy = "write a point, no comma, before decimals" if halved else "give one value per column"
        raise BadInput(f"{str(path)!r}, line {line}: {len(row)} values for {len(head)} columns: {remedy}")


def number(cell: str) -> float | None:
    """Return the number in a cell, which may be NaN or infinite; None if the cell holds no number.

    >>> number(" 1.5"), number("1,5")
    (1.5, None)
    """
    try:
        return float(cell)
    except ValueError:
        return None


def comma_remedy(cell: str) -> str:
    """Return the remedy for a cell that is no number because of a decimal comma; for other cells an empty text.

    >>> comma_remedy("1,5")
    ': write a point, no comma, before decimals'
    """
    pointed = number(cell.replace(",", ".")) if cell.count(",") == 1 else None
    return "" if pointed is None else ": write a point, no comma, before decimals"


def split_head(head: str) -> tuple[str, str]:
    """Return name and unit of a head.

    >>> split_head("F_x [N]"), split_head("S1_mV"), split_head("S1")
    (('F_x', 'N'), ('S1', 'mV'), ('S1', ''))
    """
    text = head.strip()
    begin = min((at for at in map(text.find, "[(") if at >= 0), default=-1)
    if begin >= 0 and text[-1] in "])":
        return text[:begin].strip(), text[begin + 1 : -1].strip()
    name, _, unit = text.rpartition("_")
    return (name, unit) if name else (unit, "")


class Measured:
    """A table of measurements: its heads with their line, and its rows, texts, with theirs.

    `comments`: whether # begins a comment.
    """

    def __init__(self, path: str | Path, *, comments: bool = True) -> None:
        self.path, self.rows = str(path), csv_rows(Path(path), comments=comments)
        self.line, heads = self.rows.pop(0) if self.rows else (1, [])
        self.heads = [head.strip() for head in heads]
        self.where = f"{self.path!r}, line {self.line}"

    def cells(self, head: str) -> list[str]:
        """Return the texts of a column."""
        k = self.heads.index(head)
        for line, row in self.rows:
            check_length(Path(self.path), line, self.heads, row)
        return [row[k].strip() for _, row in self.rows]

    def numbers(self, head: str, *, holes: bool = False) -> Array:
        """Return the numbers of a column, shape (n,); with `holes` NaN for an empty cell, which is else refused."""
        found = np.empty(len(self.rows))
        for k, cell in enumerate(self.cells(head)):
            value = number(cell or "nan" if holes else cell)
            bound = "" if value is None or not math.isfinite(value) else f", at most {LARGEST:g} in size"
            if value is None or not (abs(value) <= LARGEST or (holes and math.isnan(value))):
                raise BadInput(
                    f"{self.path!r}, line {self.rows[k][0]}, column {head:.40}: must be a finite number"
                    f"{' or empty' if holes else ''}{bound}; got {cell!r:.40}{comma_remedy(cell)}"
                )
            found[k] = value
        return found

    def refuse(self, bad: NDArray[np.bool_], column: str, what: str, values: Array, after: str = "") -> None:
        """Raise BadInput for the first value that is bad, shape (n,)."""
        if bad.any():
            k = int(np.argmax(bad))
            raise BadInput(
                f"{self.path!r}, line {self.rows[k][0]}, column {column}: {what}; got {values[k]:g}{after}"
            )


def json_objects(path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield the number of each line that is not empty, and the JSON object in it."""
    for line, text in enumerate(text_of(path, "JSON lines").split("\n"), 1):
        if not text.strip():
            continue
        _check_count(path, line)
        try:
            record = json_in(text, finite)
        except BadInput as error:
            raise BadInput(f"{path}, line {line} {error}: give one JSON object per line") from None
        if not isinstance(record, dict):
            raise BadInput(f"{path}, line {line} must hold a JSON object, {{...}}; got {text.strip():.40}")
        yield line, record


# Solved states: one line of `solve --json` or `analytic --json` for each


@dataclass(frozen=True, slots=True)
class State:
    """One line of the file.

    `load`, `response`: None if the solve failed and the line has no pose.
    """

    line: int
    status: str
    message: str
    load: Load | None
    response: Response | None


def read_states(path: Path, design: Design) -> list[State]:
    """Read the states in a file, which must have been solved for this design with a rigid magnet.

    If a line does not name its sensor, this cannot be checked: the states are accepted with a warning.
    """
    expected = design_digest.of_mechanics(design)
    states, all_named = [], True
    for line, record in json_objects(path):
        where = f"{path}, line {line}"
        try:
            status, message = str(record["status"]), str(record.get("message") or "")
            known = status == "ok" or record.get("shift_mm") is not None
            states.append(State(line, status, message, *(_load_and_response(record) if known else (None, None))))
        except BadInput as error:
            raise BadInput(f"{where}: {error}") from None
        except (ValueError, KeyError, TypeError):
            raise BadInput(
                f"{where} is not a state printed by `magtip solve --json`: it must contain status, depth_mm, "
                "shear_mm, force_N, shift_mm and tilt_rad"
            ) from None
        all_named = design_digest.check(record, expected, where) and all_named
    if not all_named:
        console.warn(
            f"{path} does not say for which sensor its states were solved, so a mismatch with this "
            "design cannot be detected"
        )
    return states


def _load_and_response(record: dict[str, Any]) -> tuple[Load, Response]:
    """Return load and response of a record; keys that the formulas do not print count as 0.

    A record without `friction`, of a table made by hand or by magtip 0.2, is of a plate that sticks in a shear.
    """
    x, y, z = (float(v) for v in record["shift_mm"])
    f_x, f_y, f_n = (float(v) for v in record["force_N"])
    given = {name: record[name] for name in ("depth_mm", "shear_mm")}
    given |= {name: record[name] for name in OF_STATES if record.get(name) is not None}
    fields: dict[str, Any] = {
        OF_STATES[name].name: each if name == "friction" else float(each) for name, each in given.items()
    }
    load = Load(**({"friction": "none" if "grip" in fields else "stick"} | fields))
    tilt, tilt_y = float(record["tilt_rad"]), float(record.get("tilt_y_rad") or 0.0)
    radius = float(record.get("contact_radius_mm") or 0.0)
    numbers = (x, y, z, f_x, f_y, f_n, tilt, tilt_y)
    if not all(map(math.isfinite, numbers)):
        raise ValueError("not finite")
    return load, Response((f_x, f_y, f_n), (x, y, z), tilt, radius, tilt_y)


def numbers_of(name: str, value: Any, *shape: int | None, holes: bool = False) -> Array:
    """Return finite numbers of a shape, in which None stands for any length; with holes null is NaN.

    Raises
    ------
    ValueError, TypeError
        They are something else.
    """
    found = np.array(value, dtype=float)
    fits = len(found.shape) == len(shape) and all(n in (None, m) for n, m in zip(shape, found.shape, strict=True))
    known = np.isfinite(found) | (holes & np.isnan(found))
    if not (fits and found.size and known.all()):
        raise ValueError(f"{name} must hold finite numbers of another shape than {found.shape}")
    return found
