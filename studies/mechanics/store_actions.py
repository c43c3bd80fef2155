"""What is done with a store's states: lists of them, their export as a table, their removal."""

from __future__ import annotations

import contextlib
import itertools
import sqlite3
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from geometry.design import BadInput
from geometry.messages import Progress
from studies.inputs.option_groups import Selection
from studies.mechanics import store, store_fields, store_file
from studies.mechanics.store_fields import FIELDS, Condition, Kind
from studies.output import atomic_files
from studies.output.records import FlatRow

STATES = ("states", "path", None)
"""Quantities of paths whose states are answers to loads; format 1 had none."""
DAMAGED = "damaged"
"""Shown as the status of a state that is not as it was written."""
COLUMNS = (
    "quantity",
    "model",
    "accuracy",
    "magnet",
    "law",
    "nu",
    "L_over_D",
    "friction",
    "depth_over_D",
    "shear_over_D",
    "status",
    "force_z_over_E_D2",
    "force_x_over_E_D2",
    "critical_depth_over_D",
    "frequency_1_D_sqrt_rho_over_E",
    "error_estimate",
    "seconds",
    "added",
    "message",
)
"""Columns of a list of states."""


def of_path(column: str, place: str) -> str:
    """Return SQL for a position: vibrations, cycles and modes have one of their path, and one of 0 of their state."""
    return f"CASE WHEN {column} = 0 THEN ifnull(json_extract(path.content, '$.load.{place}'), 0.0) ELSE {column} END"


PLACES = {
    "depth_over_D": of_path("state.depth", "depth"),
    "shear_over_D": of_path("state.shear", "shear_x"),
}
"""SQL of the columns that are positions."""
PATH_COLUMNS = (
    "quantity",
    "model",
    "physics",
    "accuracy",
    "magnet",
    "law",
    "nu",
    "L_over_D",
    "magnet_diameter_over_D",
    "magnet_height_over_D",
    "friction",
)
"""Columns of a list of paths that come from their contents."""
TOTALS = (
    "states",
    "not_ok",
    "least_depth_over_D",
    "greatest_depth_over_D",
    "greatest_shear_over_D",
    "seconds",
    "added",
    "key",
)
"""Columns of a list of paths that come from their states, and their key."""
SUFFIXES = (".csv", ".parquet", ".jsonl")
BATCH = 10_000
"""Rows that are read and written at once; they take some 20 MB."""
DIGITS = 12
"""Significant digits in a CSV file."""
StateRows = list[tuple[Any, ...]]


# Lists


def listing(selection: Selection, limit: int, *, of_paths: bool = False) -> tuple[FlatRow, list[FlatRow]]:
    """Return the summary of a store and its newest states, or its newest paths, that meet the filters.

    Parameters
    ----------
    limit : largest number of rows; 0 for all. SQLite counts to 2**63 - 1.

    Raises
    ------
    BadInput
        There is no such store, it cannot be read, or a filter is wrong.
    """
    condition = store_fields.condition(selection)
    file = selection.store or store.default()
    with store_file.readable(file) as connection:
        store_fields.register(connection)
        states = chosen(connection, condition)
        rows = (_paths if of_paths else _states)(connection, states, min(limit, 2**63 - 1) or -1)
        return summary(file, connection, states), rows


def chosen(connection: sqlite3.Connection, condition: Condition) -> str:
    """Return the name of a table with the states that meet the conditions: their columns but the answers."""
    if not condition.limits:
        # the index has all the columns that are needed; SQLite would read the answers too
        return "main.state INDEXED BY state_listing"
    connection.execute("PRAGMA temp_store = MEMORY")
    connection.execute(
        "CREATE TEMPORARY TABLE chosen AS SELECT path, depth, shear, outcome, seconds, added FROM state"
        f" WHERE {condition.sql}",
        condition.values,
    )
    return "chosen"


def summary(file: Path, connection: sqlite3.Connection, states: str) -> FlatRow:
    """Return how many states of an open store meet the filters; `states` is the table of `chosen`.

    Returns
    -------
    "size_MB" of the file and its write-ahead log. "solving_s": time that these solves took, s. "states_by_model":
    number of states for each model, or quantity of another kind, and physics version.
    """
    groups = connection.execute(
        "SELECT quantity, model, physics, COUNT(DISTINCT path), COUNT(*), SUM(seconds), SUM(outcome = 'ok'),"
        f" SUM(outcome = 'failed'), SUM(outcome = 'transient') FROM {states} JOIN listed ON id = path"
        " GROUP BY quantity, model, physics"
    ).fetchall()
    totals = [sum(column) for column in list(zip(*groups, strict=True))[3:]] or [0] * 6
    paths, count, seconds, ok, failed, transient = totals
    (in_store,) = connection.execute("SELECT COUNT(*) FROM state").fetchone()
    return {
        "file": str(file),
        "size_MB": size_MB(file),
        "paths": paths,
        "states": count,
        "states_in_store": in_store,
        "ok": ok,
        "failed": failed,
        "transient": transient,
        "solving_s": seconds,
        "states_by_model": tuple(
            f"{named(quantity, model)} (physics {physics}): {states_of_group}"
            for quantity, model, physics, _, states_of_group, *_ in groups
        ),
    }


def named(quantity: str | None, model: str) -> str:
    """Return the name of what is solved: the model of states along a path, or another quantity.

    >>> named("states", "harmonic"), named("critical depth", "axisymmetric")
    ('harmonic', 'critical depth')
    """
    return model if quantity in STATES else str(quantity)


def size_MB(file: Path) -> float:
    """Return the size of a store's file with its write-ahead log, MB."""
    parts = (file, file.with_name(f"{file.name}-wal"))
    return sum(part.stat().st_size for part in parts if part.exists()) / 1e6


def _states(connection: sqlite3.Connection, states: str, limit: int) -> list[FlatRow]:
    columns = ", ".join(PLACES.get(name, FIELDS[name].sql) for name in COLUMNS)
    newest = f"SELECT path, depth, shear FROM {states} ORDER BY added DESC, path DESC, depth, shear LIMIT ?"
    checked = (
        f"SELECT state.*, {store_fields.DAMAGED} AS damaged FROM ({newest})"
        " JOIN main.state USING (path, depth, shear) JOIN path ON path.id = state.path"
    )
    shown = (
        f"SELECT path, depth, shear, iif(damaged, '{DAMAGED}', status) AS status,"
        " iif(damaged, NULL, answer) AS answer, seconds, added FROM checked"
    )
    rows = connection.execute(
        f"WITH checked AS MATERIALIZED ({checked}), state AS ({shown}) SELECT {columns} FROM state"
        " JOIN path ON path.id = state.path JOIN listed USING (id)"
        " ORDER BY state.added DESC, state.path DESC, state.depth, state.shear",
        (limit,),
    )
    return [dict(zip(COLUMNS, row, strict=True)) for row in rows]


def _paths(connection: sqlite3.Connection, states: str, limit: int) -> list[FlatRow]:
    columns = ", ".join(FIELDS[name].sql for name in PATH_COLUMNS)
    newest = (
        "SELECT path, COUNT(*) AS states, SUM(outcome != 'ok') AS not_ok, MIN(depth) AS depth,"
        " MAX(depth) AS greatest_depth, MAX(shear) AS shear, SUM(seconds) AS seconds, MAX(added) AS added"
        f" FROM {states} GROUP BY path ORDER BY MAX(added) DESC, path DESC LIMIT ?"
    )
    rows = connection.execute(
        f"SELECT {columns}, states, not_ok, {of_path('depth', 'depth')}, {of_path('greatest_depth', 'depth')},"
        f" {of_path('shear', 'shear_x')}, seconds, newest.added, key"
        f" FROM ({newest}) AS newest JOIN path ON path.id = newest.path JOIN listed USING (id)"
        " ORDER BY newest.added DESC, path.id DESC",
        (limit,),
    )
    return [dict(zip((*PATH_COLUMNS, *TOTALS), row, strict=True)) for row in rows]


# Export


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
def _writer(out: Path, file: Path) -> Iterator[Callable[[StateRows], None]]:
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


# Removal


def prune(selection: Selection, *, yes: bool) -> FlatRow:
    """Remove the states that meet the filters, and paths without states; without `yes` only count them.

    Returns
    -------
    "states" and "paths": numbers of states, and of paths of which no state stays. "solving_s": time that the solves
    of the states took, s. "size_MB" of the file before, and "freed_MB", an estimate while nothing is removed.

    Raises
    ------
    BadInput
        There are no filters, there is no such store, or it cannot be written.
    """
    condition = store_fields.condition(selection)
    if not condition.limits:
        raise BadInput(
            "prune needs a filter, such as --failed, --older-physics, --before 2026-11-05 or --where nu=0.45; "
            "to remove everything, delete the file"
        )
    file = selection.store or store.default()
    with store_file.readable(file) as connection:
        store_fields.register(connection)
        before = summary(file, connection, chosen(connection, condition))
        (paths,) = connection.execute(
            "SELECT COUNT(*) FROM (SELECT path, COUNT(*) AS n FROM chosen GROUP BY path) AS gone"
            " WHERE n = (SELECT COUNT(*) FROM state WHERE state.path = gone.path)"
        ).fetchone()
    states, in_store, size = (before[name] for name in ("states", "states_in_store", "size_MB"))
    if yes and states:
        with store_file.writable(file) as connection, store_file.refusals(file):
            store_fields.register(connection)
            _remove(connection, condition)
    return {
        "file": str(file),
        "removed": yes,
        "states": states,
        "paths": paths,
        "states_left": in_store - states,
        "solving_s": before["solving_s"],
        "size_MB": size,
        "freed_MB": size - size_MB(file) if yes else size * (states / in_store if in_store else 0.0),
    }


def _remove(connection: sqlite3.Connection, condition: Condition) -> None:
    connection.execute("BEGIN IMMEDIATE")
    with connection:
        connection.execute(f"DELETE FROM state WHERE {condition.sql}", condition.values)
        connection.execute("DELETE FROM path WHERE id NOT IN (SELECT path FROM state)")
    connection.execute("VACUUM")
    # a process that reads keeps the old pages: the file shrinks later, without a wait here
    connection.execute("PRAGMA busy_timeout = 0")
    connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
