"""Tables in Markdown, for the pages of results."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any


def markdown(
    rows: Sequence[Mapping[str, Any]], heads: Mapping[str, str] | None = None, digits: int = 3, nothing: str = ""
) -> str:
    """Return a Markdown table of rows, or the text for none.

    Parameters
    ----------
    heads : columns that are shown, in order, with their heads; default: all columns of the first row.
    digits : significant digits of floats.

    >>> print(markdown([{"tip": "free", "E_MPa": 0.59871, "met": True}, {"tip": "held", "E_MPa": None}]))
    | tip | E_MPa | met |
    |---|---|---|
    | free | 0.599 | yes |
    | held |  |  |
    """
    if not rows:
        return nothing
    heads = heads or {name: name for name in rows[0]}
    lines = [list(heads.values()), *([cell(row.get(name), digits) for name in heads] for row in rows)]
    first, *rest = (f"| {' | '.join(line)} |" for line in lines)
    return "\n".join([first, f"|{'---|' * len(heads)}", *rest])


def cell(value: Any, digits: int = 3) -> str:
    """Return a value as a cell: no number is empty, a missed yes or no is bold."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    if isinstance(value, bool):
        return "yes" if value else "**no**"
    return f"{value:.{digits}g}" if isinstance(value, float) else str(value).replace("|B|", "\\|B\\|")
