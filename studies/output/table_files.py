"""Tables of any length, written batch by batch as CSV or Parquet.

A batch is a mapping from column names to arrays, shape (n,): numbers, with NaN for "no such number", booleans, or
texts (dtype object or str), with None for none. A missing value is an empty cell of a CSV file and a null of a
Parquet file. Memory does not grow with the number of rows.
"""

from __future__ import annotations

import contextlib
import csv
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from geometry.design import BadInput
from studies.output.atomic_files import atomic

Columns = Mapping[str, NDArray[Any]]
Write = Callable[[Columns], None]
ROW_GROUP = 50_000
"""Rows of a group of a Parquet file, which is held in memory until it is full: 40 columns of floats take 16 MB.
Smaller groups would make the file's list of groups grow with the number of batches."""


def write_table(path: Path, rows: Iterable[Mapping[str, Any]], digits: int = 6) -> None:
    """Write rows as CSV with a header; `digits` are significant, and a missing value is an empty cell."""
    import pandas as pd

    frame = pd.DataFrame(list(rows))
    with writer(path, digits=digits) as write:
        write({name: frame[name].to_numpy() for name in frame})


@contextlib.contextmanager
def writer(path: str | Path, *, digits: int = 6, about: Mapping[str, str] | None = None) -> Iterator[Write]:
    """Yield a function that appends a batch of columns to a table; the file replaces `path` when the context ends.

    If the context ends with an exception, no file is written, and one that exists stays as it is.

    Parameters
    ----------
    digits : significant digits of floats in a CSV file; a Parquet file holds them in full.
    about : texts by name, such as the command and the versions, kept in a Parquet file's metadata; a CSV file has no
        place for them.

    The yielded function raises ValueError or KeyError if the columns of a batch differ in length, or if it lacks one
    of the first batch.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in (".csv", ".parquet"):
        raise BadInput(f"the file {str(path)!r} must end in .csv or .parquet")
    with atomic(path) as temporary:
        append = _csv(temporary, digits) if suffix == ".csv" else _parquet(temporary, dict(about or {}))
        with append as write:
            yield write


@contextlib.contextmanager
def _csv(file: Path, digits: int) -> Iterator[Write]:
    with file.open("w", encoding="utf-8", newline="") as stream:
        lines, head = csv.writer(stream, lineterminator="\n"), list[str]()
        pattern = f"%.{digits}g"

        def cells(values: NDArray[Any]) -> list[str]:
            if values.dtype.kind == "f":
                # + 0.0: minus zero is zero
                return ["" if value != value else pattern % (value + 0.0) for value in values.tolist()]
            return ["" if value is None or value != value else str(value) for value in values.tolist()]

        def write(batch: Columns) -> None:
            if not head:
                head.extend(batch)
                lines.writerow(head)
            # column by column: one format for many values is ten times as fast as a choice for each cell
            lines.writerows(zip(*map(cells, (batch[name] for name in head)), strict=True))

        yield write


@contextlib.contextmanager
def _parquet(file: Path, about: dict[str, str]) -> Iterator[Write]:
    import pyarrow as pa
    from pyarrow import parquet

    with contextlib.ExitStack() as stack:
        sink: Any = None
        waiting: list[Any] = []

        def write(batch: Columns) -> None:
            nonlocal sink
            if sink is None:
                # the first batch fixes the types: all NaN makes a column of floats, all None one of texts
                kinds = {name: values.dtype for name, values in batch.items()}
                types = {
                    name: pa.string() if kind.kind in "OU" else pa.from_numpy_dtype(kind)
                    for name, kind in kinds.items()
                }
                schema = pa.schema(types.items(), metadata=about)
                sink = stack.enter_context(parquet.ParquetWriter(file, schema, compression="zstd"))
            # Arrow shares an array's memory where it can, and the caller may fill the array again: copy
            arrays = [pa.array(batch[column.name].copy(), column.type, from_pandas=True) for column in sink.schema]
            waiting.append(pa.Table.from_arrays(arrays, schema=sink.schema))
            if sum(map(len, waiting)) >= ROW_GROUP:
                flush()

        def flush() -> None:
            if waiting:
                sink.write_table(pa.concat_tables(waiting), row_group_size=ROW_GROUP)
                waiting.clear()

        yield write
        if sink is None:
            write({})
        flush()
