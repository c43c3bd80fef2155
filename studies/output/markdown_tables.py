"""Tables in Markdown, for the reports."""

from __future__ import annotations

from collections.abc import Sequence

from studies.output.records import FlatRow


def markdown(table: Sequence[FlatRow]) -> str:
    """Return a Markdown table; floats have three digits, and NaN is empty.

    >>> print(markdown([{"tip": "free", "E_MPa": 0.59871}, {"tip": "held", "E_MPa": float("nan")}]))
    | tip | E_MPa |
    |---|---|
    | free | 0.599 |
    | held |  |
    """
    if not table:
        return ""
    lines = [list(table[0]), ["---"] * len(table[0])]
    lines += [[_cell(value) for value in row.values()] for row in table]
    first, rule, *rest = lines
    return "\n".join(
        [f"| {' | '.join(first)} |", f"|{'|'.join(rule)}|", *(f"| {' | '.join(line)} |" for line in rest)]
    )


def _cell(value: object) -> str:
    if isinstance(value, float):
        return "" if value != value else f"{value:.3g}"
    return str(value).replace("|B|", "\\|B\\|")
