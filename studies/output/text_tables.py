"""Tables and records as lines of text of a limited width, in which no value is truncated.

A table shows its most important columns and hides the columns that do not fit. If the needed columns do not fit, each
record is upright: one value to a line.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from studies.output.literals import in_markdown, one_line

UNITS = {
    "mm": ("mm", 1.0),
    "mm3": ("mm³", 1.0),
    "um": ("µm", 1.0),
    "N": ("N", 1.0),
    "rad": ("rad", 1.0),
    "MPa": ("MPa", 1.0),
    "T": ("mT", 1e3),
    "mT": ("mT", 1.0),
    "V": ("V", 1.0),
    "Hz": ("Hz", 1.0),
    "mJ": ("mJ", 1.0),
    "s": ("s", 1.0),
    "MB": ("MB", 1.0),
    "deg": ("°", 1.0),
    "percent": ("%", 1.0),
}
"""The last word of a key, the unit in which its values are shown, and the factor to that unit."""
TURNS = {
    "tilt_rad": "tilt towards x",
    "tilt_y_rad": "tilt towards y",
    "rotation_rad": "rotation vector rx, ry",
}
"""Names of the magnet's rotations: tilt of its axis towards x or y, or the rotation vector (-tilt_y, tilt)."""
MISFITS = {
    "fit_error_rad": ("error of the decoder's polynomials, tilt", UNITS["rad"][0]),
    "fit_error_N": ("error of the decoder's polynomials, force", UNITS["N"][0]),
    "table_error_mm": ("error of the tables, shift", UNITS["mm"][0]),
    "table_error_N": ("error of the tables, force", UNITS["N"][0]),
    "fit_error_percent": ("error of the polynomials, over full scale", UNITS["percent"][0]),
    "full_scale": ("full scale is", ""),
    "table_error_percent": ("error of the tables, force over full scale", UNITS["percent"][0]),
}
"""Names of the decoder's errors: differences of its polynomials from the fitted states or formulas, and of tables."""
GAP = "  "
"""Space between columns."""
LEFTMOST = 2
"""Number of columns that a table must show if a verb does not name the columns that it needs."""
LEAST_TEXT = 20
"""Least width of a column of texts, characters, unless a word is longer; texts are broken between words only."""
MOST_LINES = 4
"""Greatest number of lines of a value beside its name; a longer value is printed below the name."""
VECTOR = 3
"""Greatest number of items in a list that is not broken over lines: a vector in space."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table.

    `breaks`: whether cells may be broken between words.
    """

    head: str
    cells: tuple[str, ...]
    breaks: bool = False

    @property
    def least(self) -> int:
        """Least width, characters."""
        width = max(map(len, self.cells), default=0)
        if self.breaks:
            width = max(min(width, LEAST_TEXT), _longest_word(self.cells))
        return max(width, _longest_word([self.head]), 1)


def column(key: str, values: Sequence[Any]) -> Column:
    """Return the column of a key and its values.

    >>> column("field_T", [0.01, None])
    Column(head='field (mT)', cells=('10', '-'), breaks=False)
    """
    lists = [value for value in values if isinstance(value, (list, tuple))]
    breaks = any(isinstance(value, (str, Mapping)) for value in values)
    breaks |= any(len(value) > VECTOR or any(isinstance(item, str) for item in value) for value in lists)
    return Column(titled(key), tuple(shown(key, value, 4) for value in values), breaks)


def fitting(columns: Mapping[str, Column], first: Sequence[str], room: int | None) -> list[str] | None:
    """Return the keys of the columns that fit into a line, or None if those that a table must show do not.

    Parameters
    ----------
    first : keys that the table must show, the most important first; default: the leftmost `LEFTMOST`.
    room : characters of a line; None for no limit.

    >>> fitting({key: Column(key * width, ()) for key, width in (("a", 5), ("b", 9), ("c", 3))}, ["a"], 12)
    ['a', 'c']
    """
    needed = [key for key in first if key in columns] or list(columns)[:LEFTMOST]
    taken: list[str] = []
    for key in dict.fromkeys((*needed, *columns)):
        if room is None or sum(columns[k].least for k in (*taken, key)) + len(GAP) * len(taken) <= room:
            taken.append(key)
        elif key in needed:
            return None
    return [key for key in columns if key in taken]


def spread(columns: Sequence[Column], room: int | None) -> list[int]:
    """Return the width of each column; texts that would be broken get the unused characters of the line."""
    widths = [column.least for column in columns]
    spare = None if room is None else room - sum(widths) - len(GAP) * (len(widths) - 1)
    for k, column in enumerate(columns):
        more = max(map(len, column.cells), default=0) - widths[k]
        if more > 0:
            more = more if spare is None else min(more, spare)
            widths[k] += more
            spare = None if spare is None else spare - more
    return widths


def headed(heads: Sequence[str], widths: Sequence[int]) -> list[str]:
    """Return the lines of the heads, broken between words and aligned at the bottom, and a rule."""
    broken = [wrapped(head, width) for head, width in zip(heads, widths, strict=True)]
    high = max(map(len, broken))
    lines = _side_by_side([[""] * (high - len(parts)) + parts for parts in broken], widths)
    return [*lines, "─" * (sum(widths) + len(GAP) * (len(widths) - 1))]


def row(cells: Sequence[str], widths: Sequence[int]) -> list[str]:
    """Return the lines of a row."""
    return _side_by_side([wrapped(cell, width) for cell, width in zip(cells, widths, strict=True)], widths)


def _side_by_side(broken: Sequence[Sequence[str]], widths: Sequence[int]) -> list[str]:
    high = max(map(len, broken))
    padded = [[*parts, *[""] * (high - len(parts))] for parts in broken]
    return [
        GAP.join(part.ljust(width) for part, width in zip(parts, widths, strict=True)).rstrip()
        for parts in zip(*padded, strict=True)
    ]


def table(columns: Sequence[Column], room: int | None) -> list[str]:
    """Return the lines of a table with all columns side by side."""
    widths = spread(columns, room)
    cells = zip(*(column.cells for column in columns), strict=True)
    return [
        *headed([column.head for column in columns], widths),
        *(line for each in cells for line in row(each, widths)),
    ]


def upright(record: Mapping[str, Any], room: int | None, digits: int = 5) -> list[str]:
    """Return a record as lines, each with a name, its value and unit."""
    parts = [(*heading(key), shown(key, value, digits)) for key, value in record.items()]
    return named([(name, f"{text} {unit}".strip()) for name, unit, text in parts], room)


def named(rows: Sequence[tuple[str, str]], room: int | None) -> list[str]:
    """Return lines of names and values; a value that is too long stands below its name.

    >>> named([("law", "yeoh"), ("numbers", "yeoh_2=-0.00674683")], 20)
    ['law      yeoh', 'numbers', '  yeoh_2=-0.00674683']
    """
    width = max((len(name) for name, _ in rows), default=0)
    space = None if room is None else room - width - len(GAP)
    lines = []
    for name, value in rows:
        if space is None or (_longest_word([value]) <= space and len(value) <= MOST_LINES * space):
            lines += _side_by_side([[name], wrapped(value, space)], [width, 0])
        else:
            lines += wrapped(name, room)
            lines += [GAP + part for part in wrapped(value, (room or 0) - len(GAP))]
    return lines


def wrapped(text: str, width: int | None) -> list[str]:
    """Break a text into lines of a width, between words; only a word longer than a line is broken.

    >>> wrapped("0.5, 0, 4.149", 8)
    ['0.5, 0,', '4.149']
    """
    # a path may contain control characters, which would disturb the table
    clean = one_line(text)
    if width is None or len(clean) <= width:
        return [clean]
    return textwrap.wrap(clean, max(width, 1), break_on_hyphens=False) or [""]


def titled(key: str) -> str:
    """Return the name of a key with the unit of its values.

    >>> titled("stiffness_N_per_mm")
    'stiffness (N/mm)'
    """
    return with_unit(*heading(key))


def with_unit(name: str, unit: str) -> str:
    """Return a name with the unit of its values; pure numbers, of unit "1" or "", have none.

    >>> with_unit("force", "N"), with_unit("gain", "1")
    ('force (N)', 'gain')
    """
    return name if unit in ("", "1") else f"{name} ({unit})"


def heading(key: str) -> tuple[str, str]:
    """Return the name of a key, and the unit in which its values are shown.

    >>> heading("stiffness_N_per_mm"), heading("shift_per_mm"), heading("gain_drift_per_K"), heading("depth_mm")
    (('stiffness', 'N/mm'), ('shift', 'mm/mm'), ('gain drift', '1/K'), ('depth', 'mm'))
    """
    if key in TURNS:
        return TURNS[key], UNITS["rad"][0]
    if key in MISFITS:
        return MISFITS[key]
    name, _, last = key.rpartition("_")
    if name.endswith("_per"):
        above, unit = heading(name.removesuffix("_per"))
        # a motion over a length is one of the same unit
        return above, f"{unit or ('1' if last == 'K' else last)}/{last}"
    if name and last in UNITS:
        return in_words(name), UNITS[last][0]
    return in_words(key), ""


def in_words(key: str) -> str:
    """Return a key without its unit as words; a frequency at its end has its unit.

    >>> in_words("relative_at_600"), in_words("magnet_height_over_D")
    ('relative at 600 Hz', 'magnet height/D')
    """
    words = (key.removesuffix("_over_D") + "/D" if key.endswith("_over_D") else key).replace("_", " ")
    return f"{words} Hz" if key.rpartition("_at_")[2].isdigit() else words


def shown(key: str, value: Any, digits: int = 5) -> str:
    """Return a value as text, in the unit of the key's heading."""
    factor = UNITS.get(key.rpartition("_")[2], ("", 1.0))[1]
    if isinstance(value, (list, tuple)):
        return ", ".join(shown(key, item, digits) for item in value)
    if isinstance(value, Mapping):
        parts = [(*heading(name), shown(name, part, digits)) for name, part in value.items()]
        return ", ".join(f"{name} {text} {unit}".strip() for name, unit, text in parts)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float) and value == value:
        return f"{factor * value + 0.0:.{digits}g}"
    return "-" if value is None or value == "" or value != value else str(value)


def _longest_word(texts: Iterable[str]) -> int:
    return max((len(word) for text in texts for word in text.split()), default=0)


# Markdown


def markdown(
    rows: Sequence[Mapping[str, Any]], heads: Mapping[str, str] | None = None, digits: int = 3, nothing: str = ""
) -> str:
    """Return a Markdown table of rows, or the text for none.

    `heads`: columns that are shown, in order, with their heads; default: all columns of the first row.

    >>> print(markdown([{"tip": "free", "E_MPa": 0.59871, "met": True}, {"tip": "held", "E_MPa": None}]))
    | tip | E_MPa | met |
    |---|---|---|
    | free | 0.599 | yes |
    | held |  |  |
    """
    if not rows:
        return nothing
    heads = heads or {name: name for name in rows[0]}
    lines = [
        list(map(in_markdown, heads.values())),
        *([cell(row.get(name), digits) for name in heads] for row in rows),
    ]
    first, *rest = (f"| {' | '.join(line)} |" for line in lines)
    return "\n".join([first, f"|{'---|' * len(heads)}", *rest])


def cell(value: Any, digits: int = 3) -> str:
    """Return a value as a cell: no number is empty, a missed yes or no is bold."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    if isinstance(value, bool):
        return "yes" if value else "**no**"
    return f"{value:.{digits}g}" if isinstance(value, float) else in_markdown(value)


AXIS_UNITS = {
    "V_per_T": "V/T", "V_per_sqrtHz": "V/√Hz", "kg_per_m3": "kg/m³", "mm_per_s": "mm/s", "N_per_mm": "N/mm",
    "MPa": "MPa", "mm": "mm", "um": "µm", "deg": "°", "rad": "rad", "percent": "%", "mT": "mT", "T": "T",
    "mN": "mN", "N": "N", "V": "V", "Hz": "Hz", "K": "K", "s": "s",
}  # fmt: skip
"""Units of axes by the last part of a column's name."""


def quantity_name(column: str) -> str:
    """Return the name of a column with its unit, in which its numbers are.

    >>> quantity_name("magnet_height_mm"), quantity_name("nu"), quantity_name("speed_mm_per_s")
    ('magnet height (mm)', 'nu', 'speed (mm/s)')
    """
    for end, unit in AXIS_UNITS.items():
        if column.endswith(f"_{end}"):
            return f"{column.removesuffix(f'_{end}').replace('_', ' ')} ({unit})"
    return in_words(column)
