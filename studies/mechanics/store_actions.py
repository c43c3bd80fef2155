"""What is done with a store's states: fields and filters, lists, their export as a table, their removal.

Lengths are over D, forces over E D^2. A path's content and a state's answer are JSON, of which SQLite extracts the
fields; a field that a state does not have is NULL.
"""

from __future__ import annotations

import contextlib
import csv
import datetime
import functools
import itertools
import json
import math
import sqlite3
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from fem import physics_version
from fem.accuracy import LEVELS
from geometry.bad_input import nearest
from geometry.design import BadInput
from geometry.messages import Progress
from studies.inputs.option_groups import Selection
from studies.mechanics import store
from studies.output import atomic_files, provenance, table_files
from studies.output.records import FlatRow

Kind = Literal["text", "number", "whole number", "text or number"]
TOLERANCE = 1e-9
"""Difference up to which a number equals the value of a filter: stored numbers have 12 digits."""
Condition = tuple[str, tuple[str | float, ...]]
"""Condition on `state` in SQL, "1" if there is none, and the values of its parameters."""


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a stored state: an expression of SQLite on `path` or `state`, and the kind of its values."""

    of_path: bool
    sql: str
    kind: Kind = "number"


def _field(row: Mapping[str, str]) -> Field:
    of_path = row["of"] == "content"
    source = "path.content" if of_path else "state.answer"
    sql = (
        f"state.{row['place']}"
        if row["of"] == "state"
        else f"json_extract({source}, '$.{row['place']}'){OVER[row['over']]}"
    )
    return Field(of_path, f"accuracy_name({sql})" if row["field"] == "accuracy" else sql, cast("Kind", row["kind"]))


D, E = (f" / json_extract(state.answer, '$.{name}')" for name in ("D_mm", "E_MPa"))
OVER = {"": "", "D": D, "E D2": D + D + E, "1e6": " * 1e-6"}
"""What values are divided by; stored frequencies are f D (rho / E)^(1/2) in mm, MPa and kg/m^3."""
with Path(__file__).with_name("store_fields.csv").open(encoding="utf-8", newline="") as _file:
    FIELDS = {row["field"]: _field(row) for row in csv.DictReader(_file)}
"""All fields, in the order of the columns of an export: their places in contents, answers or rows of states."""


def register(connection: sqlite3.Connection) -> None:
    """Make the functions that the fields' SQL calls known to a connection."""
    connection.create_function("accuracy_name", 1, accuracy_name, deterministic=True)
    connection.create_function("damaged_path", 2, damaged_path, deterministic=True)
    connection.create_function("damaged_state", 10, damaged_state, deterministic=True)
    connection.create_function("name_of", 2, named, deterministic=True)


@functools.cache
def accuracy_name(values: str | None) -> str | None:
    """Return the name of the accuracy level with these values (JSON), or other."""
    if values is None:
        return None
    wanted = {"coarseness": 1.0, "tolerance_factor": 1.0} | json.loads(values)
    return next((name for name, level in LEVELS.items() if asdict(level) == wanted | {"name": name}), "other")


DAMAGED_PATH = "damaged_path(CAST(path.key AS BLOB), CAST(path.content AS BLOB))"
"""Condition on `path`."""
DAMAGED = f"(damaged_state(CAST(path.key AS BLOB), {store.READ}) OR {DAMAGED_PATH})"
"""Condition on `state` joined with its `path`."""
OF_PATHS = "state.path IN (SELECT id FROM path WHERE {})"
"""Condition on `state`, of one on `path`."""
PATHS = '(SELECT id, iif(json_valid(content), content, \'{"model": "damaged"}\') AS content FROM path) AS path'
"""All paths; a content that is no JSON stands for none."""


def damaged_path(key: bytes, content: bytes) -> bool:
    """Return whether a path's content is no JSON or does not belong to its key."""
    try:
        return store.key(json.loads(content)).encode() != key
    except (ValueError, TypeError, OverflowError, RecursionError):
        return True


def damaged_state(key: bytes, *row: Any) -> bool:
    """Return whether a state's row is not what was written for the path with this key."""
    return store.stored(key.decode("utf-8", "replace"), row) is None


def condition(selection: Selection) -> Condition:
    """Return the condition that the options mean."""
    parts: list[Condition] = [_parsed(text) for text in selection.where or []]
    dates = (("--since", selection.since, ">="), ("--before", selection.before, "<"))
    parts += [(f"state.added {sign} ?", (_utc(option, date),)) for option, date, sign in dates if date is not None]
    if outcomes := [name for name in ("failed", "transient") if getattr(selection, name)]:
        parts.append((f"state.outcome IN ({', '.join('?' * len(outcomes))})", tuple(outcomes)))
    if selection.damaged:
        parts.append((f"EXISTS (SELECT 1 FROM path WHERE path.id = state.path AND {DAMAGED})", ()))
    if selection.older_physics:
        parts.append((OF_PATHS.format(current_physics("<")), ()))
    return " AND ".join(sql for sql, _ in parts) or "1", tuple(value for _, values in parts for value in values)


def _parsed(text: str) -> Condition:
    name, sign, value = (part.strip() for part in text.partition("="))
    if not (name and sign and value):
        raise BadInput(f"--where must be NAME=VALUE, NAME=a,b or NAME=low:high, such as nu=0.45:0.5; got {text!r}")
    if name not in FIELDS:
        raise BadInput(f"--where: there is no field {name!r}: {nearest(name, FIELDS)}")
    field = FIELDS[name]
    low, colon, high = value.partition(":")
    # SQLite takes a text for larger than every number
    between = f"{field.sql} BETWEEN ? AND ?"
    values: list[str | float]
    if colon and field.kind != "text":
        least = _number(name, low) if low.strip() else -math.inf
        most = _number(name, high) if high.strip() else math.inf
        if least > most:
            raise BadInput(f"--where: the range of {name} is empty, {value}: give the lower bound first")
        sql, values = between, [least - TOLERANCE, most + TOLERANCE]
    else:
        words = [word.strip() for word in value.split(",")]
        texts = [w for w in words if field.kind == "text" or (field.kind == "text or number" and w.isalpha())]
        numbers = [_number(name, word) for word in words if word not in texts]
        sql = " OR ".join([f"CAST({field.sql} AS TEXT) = ?"] * len(texts) + [between] * len(numbers))
        values = [*texts, *(x for n in numbers for x in (n - TOLERANCE, n + TOLERANCE))]
    return OF_PATHS.format(sql) if field.of_path else f"({sql})", tuple(values)


def _number(name: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise BadInput(f"--where: {name} must be a number, several as a,b, or a range low:high; got {text!r}")
    return number


def _utc(option: str, text: str) -> str:
    """Return a date or time as the store writes it; one without a time zone is UTC.

    >>> _utc("--since", "2026-11-05")
    '2026-11-05T00:00:00+00:00'
    """
    try:
        time = datetime.datetime.fromisoformat(text)
    except ValueError:
        raise BadInput(
            f"{option} must be a date or time such as 2026-11-05 or 2026-11-05T14:30; got {text!r}"
        ) from None
    zoned = time if time.tzinfo else time.replace(tzinfo=datetime.UTC)
    return zoned.astimezone(datetime.UTC).isoformat(timespec="seconds")


def current_physics(sign: Literal["<", "=", ">"]) -> str:
    """Return a condition on `path`: its physics version against the program's, which is 0 for an unknown model.

    The version of the estimates counts too, which vibrations and cycles do not have, and older paths lack.
    """
    # a quantity with a version of its own comes before the model that computes it
    names = [(FIELDS[column].sql, name) for column in ("quantity", "model") for name in physics_version.PHYSICS]
    cases = [f"WHEN {sql} = '{name}' THEN {physics_version.PHYSICS[name]}" for sql, name in names]
    physics = f"{FIELDS['physics'].sql} {sign} CASE {' '.join(cases)} ELSE 0 END"
    today = physics_version.ESTIMATES
    without = f"iif({FIELDS['quantity'].sql} IN ('response', 'cycle'), {today}, 1)"
    estimates = f"ifnull(json_extract(path.content, '$.estimates'), {without}) {sign} {today}"
    return f"({physics} {'AND' if sign == '=' else 'OR'} {estimates})"


# What lists show

CHANGED = "damaged"
"""Shown as the status of a state that is not as it was written."""
COLUMNS = (
    *("quantity", "model", "accuracy", "magnet", "law", "nu", "L_over_D", "friction", "depth_over_D", "shear_over_D"),
    *("status", "force_z_over_E_D2", "force_x_over_E_D2", "critical_depth_over_D", "frequency_1_D_sqrt_rho_over_E"),
    *("error_estimate", "seconds", "added", "message"),
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
    *("quantity", "model", "physics", "accuracy", "magnet", "law", "nu", "L_over_D"),
    *("magnet_diameter_over_D", "magnet_height_over_D", "friction"),
)
"""Columns of a list of paths that come from their contents; others come from their states."""
SUFFIXES = (".csv", ".parquet", ".jsonl")
OUTCOMES = ("ok", "failed", "transient")
BATCH = 10_000
"""Rows that are read and written at once; they take some 20 MB."""
DIGITS = 12
"""Significant digits in a CSV file."""
StateRows = list[tuple[Any, ...]]


# Lists


def listing(selection: Selection, limit: int, *, of_paths: bool = False) -> tuple[FlatRow, list[FlatRow]]:
    """Return the summary of a store and its newest states, or its newest paths, that meet the filters.

    `limit`: largest number of rows; 0 for all. SQLite counts to 2**63 - 1.
    """
    where = condition(selection)
    file = selection.store or store.default()
    with store.readable(file) as connection:
        register(connection)
        states = chosen(connection, where)
        rows = (_paths if of_paths else _states)(connection, states, min(limit, 2**63 - 1) or -1)
        return summary(file, connection, states), rows


def chosen(connection: sqlite3.Connection, condition: Condition) -> str:
    """Return the name of a table with the states that meet the condition: their columns but the answers."""
    sql, values = condition
    if sql == "1":
        # the index has all the columns that are needed; SQLite would read the answers too
        return "main.state INDEXED BY state_listing"
    connection.execute("PRAGMA temp_store = MEMORY")
    connection.execute(
        f"CREATE TEMPORARY TABLE chosen AS SELECT path, depth, shear, outcome, seconds, added FROM state WHERE {sql}",
        values,
    )
    return "chosen"


def summary(file: Path, connection: sqlite3.Connection, states: str) -> FlatRow:
    """Return how many states of an open store meet the filters; `states` is the table of `chosen`.

    "size_MB" of the file and its write-ahead log. "solving_s": time that these solves took, s. "states_by_model":
    number of states for each model, or quantity of another kind, and physics version.
    """
    kinds = ", ".join(FIELDS[name].sql for name in ("quantity", "model", "physics"))
    counted = ("COUNT(*) AS n", "SUM(seconds) AS t", *(f"SUM(outcome = '{name}') AS {name}" for name in OUTCOMES))
    groups = connection.execute(
        f"WITH sums AS (SELECT path, {', '.join(counted)} FROM {states} GROUP BY path)"
        f" SELECT {kinds}, COUNT(*), SUM(n), SUM(t), {', '.join(f'SUM({name})' for name in OUTCOMES)}"
        f" FROM sums JOIN {PATHS} ON path.id = sums.path GROUP BY 1, 2, 3"
    ).fetchall()
    totals = [sum(column) for column in list(zip(*groups, strict=True))[3:]] or [0] * 6
    (in_store,) = connection.execute("SELECT COUNT(*) FROM state").fetchone()
    return {
        "file": str(file),
        "size_MB": size_MB(file),
        "paths": totals[0],
        "states": totals[1],
        "states_in_store": in_store,
        **dict(zip(OUTCOMES, totals[3:], strict=True)),
        "solving_s": totals[2],
        "states_by_model": tuple(
            f"{named(quantity, model)} (physics {physics}): {count}"
            for quantity, model, physics, _, count, *_ in groups
        ),
    }


def named(quantity: str | None, model: str) -> str:
    """Return the name of what is solved: the model of states along a path, or another quantity.

    >>> named("states", "harmonic"), named("critical depth", "axisymmetric")
    ('harmonic', 'critical depth')
    """
    return model if quantity in ("states", None) else str(quantity)


def size_MB(file: Path) -> float:
    """Return the size of a store's file with its write-ahead log, MB."""
    parts = (file, file.with_name(f"{file.name}-wal"))
    return sum(part.stat().st_size for part in parts if part.exists()) / 1e6


def _rows(connection: sqlite3.Connection, query: str, limit: int) -> list[FlatRow]:
    found = connection.execute(query, (limit,))
    names = [name for name, *_ in found.description]
    return [dict(zip(names, row, strict=True)) for row in found]


def _named(columns: Sequence[str]) -> str:
    return ", ".join(f"{PLACES.get(name, FIELDS[name].sql)} AS {name}" for name in columns)


def _states(connection: sqlite3.Connection, states: str, limit: int) -> list[FlatRow]:
    newest = f"SELECT path, depth, shear FROM {states} ORDER BY added DESC, path DESC, depth, shear LIMIT ?"
    checked = (
        f"SELECT state.*, {DAMAGED} AS damaged FROM ({newest})"
        " JOIN main.state USING (path, depth, shear) JOIN path ON path.id = state.path"
    )
    shown = (
        f"SELECT path, depth, shear, iif(damaged, '{CHANGED}', status) AS status,"
        " iif(damaged, NULL, answer) AS answer, seconds, added FROM checked"
    )
    query = (
        f"WITH checked AS MATERIALIZED ({checked}), state AS ({shown}) SELECT {_named(COLUMNS)} FROM state"
        " JOIN path ON path.id = state.path ORDER BY state.added DESC, state.path DESC, state.depth, state.shear"
    )
    return _rows(connection, query, limit)


def _paths(connection: sqlite3.Connection, states: str, limit: int) -> list[FlatRow]:
    newest = (
        "SELECT path, COUNT(*) AS states, SUM(outcome != 'ok') AS not_ok, MIN(depth) AS depth,"
        " MAX(depth) AS greatest_depth, MAX(shear) AS shear, SUM(seconds) AS seconds, MAX(added) AS added"
        f" FROM {states} GROUP BY path ORDER BY MAX(added) DESC, path DESC LIMIT ?"
    )
    query = (
        f"SELECT {_named(PATH_COLUMNS)}, states, not_ok, {of_path('depth', 'depth')} AS least_depth_over_D,"
        f" {of_path('greatest_depth', 'depth')} AS greatest_depth_over_D,"
        f" {of_path('shear', 'shear_x')} AS greatest_shear_over_D, seconds, newest.added AS added, key"
        f" FROM ({newest}) AS newest JOIN path ON path.id = newest.path ORDER BY newest.added DESC, path.id DESC"
    )
    return _rows(connection, query, limit)


# Export


def export(selection: Selection, out: Path, progress: Progress) -> int:
    """Write the states that meet the filters to a file, in the order of their paths, and return their number."""
    atomic_files.check_output_file(out, *SUFFIXES)
    sql, values = condition(selection)
    file = selection.store or store.default()
    written = 0
    with store.readable(file) as connection:
        register(connection)
        found = f"FROM state JOIN path ON path.id = state.path WHERE {sql}"
        count, damaged = connection.execute(f"SELECT COUNT(*), SUM({DAMAGED}) {found}", values).fetchone()
        if damaged:
            raise BadInput(
                f"{damaged} of {count} states of the store {str(file)!r} are not as they were written, so {out.name} "
                "is not written: magtip store check says what to do"
            )
        if not count:
            raise BadInput(f"no state of the store {str(file)!r} meets the filters, so {out.name} is not written")
        rows = connection.execute(
            f"SELECT {', '.join(field.sql for field in FIELDS.values())} {found}"
            " ORDER BY state.path, state.depth, state.shear",
            values,
        )
        with atomic_files.sole_writer(out), _writer(out, file) as write:
            for batch in itertools.takewhile(len, (rows.fetchmany(BATCH) for _ in itertools.count())):
                write(batch)
                written += len(batch)
                progress(written / count, f"{count} states")
    return written


@contextlib.contextmanager
def _writer(out: Path, file: Path) -> Iterator[Callable[[StateRows], None]]:
    if out.suffix.lower() == ".jsonl":
        with atomic_files.atomic(out) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as stream:
            yield lambda rows: stream.writelines(
                atomic_files.json_line(dict(zip(FIELDS, row, strict=True))) + "\n" for row in rows
            )
        return
    about = {"store": str(file), "versions": provenance.versions()}
    with table_files.writer(out, digits=DIGITS, about=about) as write:
        yield lambda rows: write(
            {
                name: np.array([None if value is None else str(value) for value in values], dtype=object)
                if "text" in field.kind
                else np.array(values, dtype=float)  # NULL is NaN
                for (name, field), values in zip(FIELDS.items(), zip(*rows, strict=True), strict=True)
            }
        )


# Removal


def prune(selection: Selection, *, yes: bool) -> FlatRow:
    """Remove the states that meet the filters, and paths without states; without `yes` only count them.

    "states" and "paths": numbers of states, and of paths of which no state stays. "solving_s": time that the solves
    of the states took, s. "size_MB" of the file before, and "freed_MB", an estimate while nothing is removed.
    """
    where = condition(selection)
    if where[0] == "1":
        raise BadInput(
            "prune needs a filter, such as --failed, --older-physics, --before 2026-11-05 or --where nu=0.45; "
            "to remove everything, delete the file"
        )
    file = selection.store or store.default()
    with store.readable(file) as connection:
        register(connection)
        before = summary(file, connection, chosen(connection, where))
        (paths,) = connection.execute(
            "SELECT COUNT(*) FROM (SELECT path, COUNT(*) AS n FROM chosen GROUP BY path) AS gone"
            " WHERE n = (SELECT COUNT(*) FROM state WHERE state.path = gone.path)"
        ).fetchone()
    states, in_store, size = (before[name] for name in ("states", "states_in_store", "size_MB"))
    if yes and states:
        with store.writable(file) as connection, store.refusals(file):
            register(connection)
            connection.execute("BEGIN IMMEDIATE")
            with connection:
                connection.execute(f"DELETE FROM state WHERE {where[0]}", where[1])
                connection.execute("DELETE FROM path WHERE id NOT IN (SELECT path FROM state)")
            connection.execute("VACUUM")
            # a process that reads keeps the old pages: the file shrinks later, without a wait here
            connection.execute("PRAGMA busy_timeout = 0")
            connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
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
