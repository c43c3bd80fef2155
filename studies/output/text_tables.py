"""How tables say names, units and numbers, and tables in Markdown."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from studies.output.literals import in_markdown
from studies.quantities import FACTORS, UNITS, column_unit, shown

READ_IN = {"T": "mT"}
"""Units in which values of tables are read that are kept in another one."""
RELATIVE = ("error_estimate", "expected_error")
"""Ends of the keys of relative errors, which are read in percent, as is a tolerance of them."""
SYMBOLS = {column_unit(unit): UNITS[unit] for unit in sorted(UNITS, key=len, reverse=True) if UNITS[unit]}
"""Symbols of units by the last part of a key, the longest first: V_per_T ends with T."""
TURNS = {
    "tilt_rad": "tilt towards x",
    "tilt_y_rad": "tilt towards y",
    "rotation_rad": "rotation vector rx, ry",
}
"""Names of the magnet's rotations: tilt of its axis towards x or y, or the rotation vector (-tilt_y, tilt)."""
MISFITS = {
    "fit_error_rad": ("error of the decoder's polynomials, tilt", UNITS["rad"]),
    "fit_error_N": ("error of the decoder's polynomials, force", UNITS["N"]),
    "table_error_mm": ("error of the tables, shift", UNITS["mm"]),
    "table_error_N": ("error of the tables, force", UNITS["N"]),
    "fit_error_percent": ("error of the polynomials, over full scale", UNITS["percent"]),
    "full_scale": ("full scale is", ""),
    "table_error_percent": ("error of the tables, force over full scale", UNITS["percent"]),
}
"""Names of the decoder's errors: differences of its polynomials from the fitted states or formulas, and of tables."""
SPREADS = {
    "noise_um": ("noise of the shift", UNITS["um"]),
    "noise_N": ("noise of the force", UNITS["N"]),
    "noise_N_per_N": ("noise of the force over its size", ""),
    "noise_T": ("noise of the field", UNITS["mT"]),
    "noise_V": ("noise of the output", UNITS["V"]),
    "tolerance_N": ("tolerance of the force", UNITS["N"]),
    "tolerance_N_per_N": ("tolerance of the force over its size", ""),
}
"""Names of standard deviations of which a table has several: by noise, and over built sensors."""


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

    >>> heading("stiffness_N_per_mm"), heading("shift_per_mm"), heading("gain_drift_per_K"), heading("field_T")
    (('stiffness', 'N/mm'), ('shift', 'mm/mm'), ('gain drift', '1/K'), ('field', 'mT'))
    >>> heading("shift_error_estimate"), heading("expected_error"), heading("noise_um")
    (('shift error estimate', '%'), ('expected error', '%'), ('noise of the shift', 'µm'))
    """
    if key in TURNS:
        return TURNS[key], UNITS["rad"]
    if named := MISFITS.get(key) or SPREADS.get(key):
        return named
    name, unit = name_and_unit(key)
    return name, UNITS[other] if (other := _read_in(key, unit)) else unit


def _read_in(key: str, unit: str) -> str:
    """Return the name of the unit in which values of a key are read if that is another one than theirs, else ""."""
    return "percent" if key.endswith(RELATIVE) or key == "tolerance" else READ_IN.get(unit, "")


def name_and_unit(key: str) -> tuple[str, str]:
    """Return the name of a key, and the unit in which its values are, "" for none.

    >>> name_and_unit("density_kg_per_m3"), name_and_unit("S1_V_per_N"), name_and_unit("height_over_D")
    (('density', 'kg/m³'), ('S1', 'V/N'), ('height/D', ''))
    """
    for end, unit in SYMBOLS.items():
        if key.endswith(f"_{end}") and not key.endswith(f"_per_{end}"):
            return in_words(key.removesuffix(f"_{end}")), unit
    name, per, below = key.rpartition("_per_")
    if per and below in SYMBOLS:
        above, unit = name_and_unit(name)
        # a motion over a length is one of the same unit
        return above, f"{unit or ('1' if below == 'K' else below)}/{below}"
    return in_words(key), ""


def in_words(key: str) -> str:
    """Return a key without its unit as words; a frequency at its end has its unit.

    >>> in_words("relative_at_600"), in_words("magnet_height_over_D")
    ('relative at 600 Hz', 'magnet height/D')
    """
    words = (key.removesuffix("_over_D") + "/D" if key.endswith("_over_D") else key).replace("_", " ")
    return f"{words} Hz" if key.rpartition("_at_")[2].isdigit() else words


def in_unit(key: str, value: Any, digits: int = 5) -> str:
    """Return a value as text, in the unit of the key's heading.

    >>> in_unit("field_T", 0.01), in_unit("error_estimate", 0.005), in_unit("tolerance", 0.02)
    ('10', '0.5', '2')
    >>> in_unit("at", {"shift_mm": [0.1, 2.0]})
    'shift 0.1, 2 mm'
    """
    if isinstance(value, (list, tuple)):
        return ", ".join(in_unit(key, item, digits) for item in value)
    if isinstance(value, Mapping):
        return ", ".join(f"{heading(name)[0]} {with_its_unit(name, part, digits)}" for name, part in value.items())
    other = _read_in(key, name_and_unit(key)[1]) if isinstance(value, float) else ""
    return shown(FACTORS[other] * value if other else value, digits=digits)


def with_its_unit(key: str, value: Any, digits: int = 5) -> str:
    """Return a value as text with the unit of the key's heading, which a word, or no value, has not.

    >>> with_its_unit("error_estimate", 0.005), with_its_unit("grip_mm", None), with_its_unit("shift_mm", [1.0, None])
    ('0.5 %', '-', '1, - mm')
    """
    text = in_unit(key, value, digits)
    return f"{text} {heading(key)[1]}".strip() if any(map(str.isdigit, text)) else text


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
    if value is False:
        return "**no**"
    return in_markdown(shown(value, digits=digits, nothing="")) if value not in (math.inf, -math.inf) else ""


def quantity_name(column: str) -> str:
    """Return the name of a column with its unit, in which its numbers are.

    >>> quantity_name("magnet_height_mm"), quantity_name("nu"), quantity_name("speed_mm_per_s")
    ('magnet height (mm)', 'nu', 'speed (mm/s)')
    """
    return with_unit(*name_and_unit(column))
