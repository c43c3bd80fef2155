"""Rows of tables, CSV files and JSON: dicts whose keys are columns with their unit, such as `depth_mm`, `force_N`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

FlatRow = dict[str, Any]
"""Column's name with its unit -> value."""


def known(row: Mapping[str, Any]) -> FlatRow:
    """Return the row without the columns that hold None.

    >>> known({"depth_mm": 0.0, "force_N": None})
    {'depth_mm': 0.0}
    """
    return {name: value for name, value in row.items() if value is not None}
