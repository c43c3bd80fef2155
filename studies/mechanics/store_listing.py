"""What a store holds: its summary, its newest states, its newest paths."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass
from pathlib import Path

from studies.inputs.option_groups import Selection
from studies.mechanics import store, store_fields, store_file
from studies.mechanics.store_fields import FIELDS, Condition
from studies.output import records
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


@dataclass(frozen=True, slots=True)
class Summary:
    """A store, and how many of its states meet the filters.

    Attributes
    ----------
    size_MB : of the file and its write-ahead log.
    journals : number of files beside the store with states that it could not take.
    paths, states, ok, failed, transient : numbers, of those that meet the filters.
    states_in_store : number of all states.
    solving_s : time that these solves took, s.
    states_by_model : number of states for each model, or quantity of another kind, and physics version.
    """

    file: str
    size_MB: float
    journals: int
    paths: int
    states: int
    states_in_store: int
    ok: int
    failed: int
    transient: int
    solving_s: float
    states_by_model: tuple[str, ...]

    def row(self) -> FlatRow:
        """Return the summary as a flat row."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class Listing:
    """Summary and newest rows of a store."""

    summary: Summary
    rows: list[FlatRow]

    @property
    def damaged(self) -> int:
        """Number of states in the rows that are not as they were written; their answers are left out."""
        return sum(row.get("status") == DAMAGED for row in self.rows)


def listing(selection: Selection, limit: int, *, of_paths: bool = False) -> Listing:
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
        return Listing(summary(file, connection, states), rows)


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


def summary(file: Path, connection: sqlite3.Connection, states: str) -> Summary:
    """Return the summary of an open store; `states` is the table of `chosen`."""
    groups = connection.execute(
        "SELECT quantity, model, physics, COUNT(DISTINCT path), COUNT(*), SUM(seconds), SUM(outcome = 'ok'),"
        f" SUM(outcome = 'failed'), SUM(outcome = 'transient') FROM {states} JOIN listed ON id = path"
        " GROUP BY quantity, model, physics"
    ).fetchall()
    totals = [sum(column) for column in list(zip(*groups, strict=True))[3:]] or [0] * 6
    paths, count, seconds, ok, failed, transient = totals
    (in_store,) = connection.execute("SELECT COUNT(*) FROM state").fetchone()
    return Summary(
        file=str(file),
        size_MB=size_MB(file),
        journals=len(store.journals(file)),
        paths=paths,
        states=count,
        states_in_store=in_store,
        ok=ok,
        failed=failed,
        transient=transient,
        solving_s=seconds,
        states_by_model=tuple(
            f"{named(quantity, model)} (physics {physics}): {states_of_group}"
            for quantity, model, physics, _, states_of_group, *_ in groups
        ),
    )


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
    """Return the newest states."""
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
    """Return the newest paths with the number, the range and the time of their states."""
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
