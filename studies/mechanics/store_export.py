"""Stored states as a table: CSV, Parquet, or JSON lines; read and written batch by batch."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from geometry.design import BadInput
from geometry.messages import Progress
from studies.inputs.option_groups import Selection
from studies.mechanics import store, store_fields, store_file
from studies.mechanics.store_fields import FIELDS, Kind
from studies.output import atomic_files

SUFFIXES = (".csv", ".parquet", ".jsonl")
BATCH = 10_000
"""Rows that are read and written at once; they take some 20 MB."""
DIGITS = 12
"""Significant digits in a CSV file."""
Rows = list[tuple[Any, ...]]


def export(selection: Selection, out: Path, progress: Progress) -> int:
    """Write the states that meet the filters to a file, in the order in which their paths were added.

    Returns
    -------
    The number of states.

    Raises
    ------
    BadInput
        The file's name has another suffix, no state meets the filters, or the store cannot be read.
    """
    atomic_files.check_output_file(out, *SUFFIXES)
    condition = store_fields.condition(selection)
    file = selection.store or store.default()
    written = 0
    with store_file.readable(file) as connection:
        store_fields.register(connection)
        (count,) = connection.execute(
            f"SELECT COUNT(*) FROM state WHERE {condition.sql}", condition.values
        ).fetchone()
        (damaged,) = connection.execute(
            f"SELECT COUNT(*) FROM state JOIN path ON path.id = state.path WHERE {condition.sql}"
            f" AND {store_fields.DAMAGED}",
            condition.values,
        ).fetchone()
        if damaged:
            raise BadInput(
                f"{damaged} of {count} states of the store {str(file)!r} are not as they were written, so {out.name} "
                "is not written: magtip store check says what to do"
            )
        if not count:
            raise BadInput(f"no state of the store {str(file)!r} meets the filters, so {out.name} is not written")
        rows = connection.execute(
            f"SELECT {', '.join(field.sql for field in FIELDS.values())} FROM state JOIN path ON path.id = state.path"
            f" JOIN listed USING (id) WHERE {condition.sql} ORDER BY state.path, state.depth, state.shear",
            condition.values,
        )
        with atomic_files.sole_writer(out), _writer(out, file) as write:
            for batch in itertools.takewhile(len, (rows.fetchmany(BATCH) for _ in itertools.count())):
                write(batch)
                written += len(batch)
                progress(written / count, f"{count} states")
    return written


@contextlib.contextmanager
def _writer(out: Path, file: Path) -> Iterator[Callable[[Rows], None]]:
    """Yield a function that appends rows to a file, which replaces `out` when the context ends without an error."""
    if out.suffix.lower() == ".jsonl":
        with atomic_files.atomic(out) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as stream:
            yield lambda rows: stream.writelines(
                atomic_files.json_line(dict(zip(FIELDS, row, strict=True))) + "\n" for row in rows
            )
        return
    from studies.output import provenance, table_files

    about = {"store": str(file), "versions": provenance.versions()}
    with table_files.writer(out, digits=DIGITS, about=about) as write:
        yield lambda rows: write(
            {
                name: _array(values, field.kind)
                for (name, field), values in zip(FIELDS.items(), zip(*rows, strict=True), strict=True)
            }
        )


def _array(values: tuple[Any, ...], kind: Kind) -> Any:
    """Return a column as an array, shape (n,); NULL is NaN or None."""
    import numpy as np

    if kind in ("text", "text or number"):
        return np.array([value if value is None else str(value) for value in values], dtype=object)
    # NULL is NaN in an array of floats
    return np.array(values, dtype=float)
