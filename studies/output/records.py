"""Conversion of a study's typed records to the flat rows of tables, CSV files and JSON.

Each study has one frozen slotted dataclass for its rows. The fields are the columns, in order. A field has the name
of its column, with the unit: `depth_mm`, `force_N`. The metadata of a field cover three other cases:

- `column`: the column's name, where that is not an identifier;
- `prefix`: the field holds another record, whose columns stand in its place with this prefix, or None and no columns;
- `columns`: a function that converts the field's value to columns.


    @dataclass(frozen=True, slots=True)
    class Part:
        name: str
        step_error: float = field(metadata={"column": "STEP read back"})
        response: Motion | None = field(metadata={"prefix": "fem_"})

        def row(self) -> FlatRow:
            return records.flat(self)

Code that computes uses the fields (`part.step_error`, `part.response.force_N`); code that prints or writes uses
`row`. A study whose rows leave out columns without a value calls `records.known(records.flat(self))` in `row`. A
record of plain fields is read back from JSON by `Part(**answer)`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

FlatRow = dict[str, Any]
"""Column's name with its unit -> value."""


def flat(record: DataclassInstance) -> FlatRow:
    """Return the flat row of a record, with the columns in the order of the fields.

    >>> from dataclasses import dataclass, field
    >>> @dataclass(frozen=True, slots=True)
    ... class Press:
    ...     depth_mm: float
    ...     force_N: float | None
    >>> @dataclass(frozen=True, slots=True)
    ... class Case:
    ...     name: str = field(metadata={"column": "the case"})
    ...     press: Press | None = field(metadata={"prefix": "fem_"})
    >>> flat(Case("first", Press(0.5, None)))
    {'the case': 'first', 'fem_depth_mm': 0.5, 'fem_force_N': None}
    >>> flat(Case("second", None))
    {'the case': 'second'}
    """
    row: FlatRow = {}
    for field in dataclasses.fields(record):
        value = getattr(record, field.name)
        if "columns" in field.metadata:
            row |= field.metadata["columns"](value)
        elif "prefix" not in field.metadata:
            row[field.metadata.get("column", field.name)] = value
        elif value is not None:
            row |= {f"{field.metadata['prefix']}{name}": part for name, part in flat(value).items()}
    return row


def known(row: Mapping[str, Any]) -> FlatRow:
    """Return the row without the columns that hold None.

    >>> known({"depth_mm": 0.0, "force_N": None})
    {'depth_mm': 0.0}
    """
    return {name: value for name, value in row.items() if value is not None}
