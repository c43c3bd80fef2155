"""What is done with a store's states: their table, filters and lists, its export, their removal.

A state is a row, and every value that is stored a column: of the content of its path, of its own row, and of its
answer. Lengths are over D, forces over E D^2. Contents and answers are JSON, of which SQLite extracts the values.
"""

from __future__ import annotations

import contextlib
import datetime
import functools
import json
import math
import re
import sqlite3
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fem import physics_version
from fem.accuracy import LEVELS
from geometry.bad_input import nearest
from geometry.design import BadInput
from geometry.messages import Progress
from studies.inputs.option_groups import Selection
from studies.mechanics import store
from studies.mechanics.timed_quantities import TIMED
from studies.output import atomic_files, provenance, table_files
from studies.output.records import FlatRow

TOLERANCE = 1e-9
"""Difference up to which a number equals the value of a filter: stored numbers have 12 digits."""
AXES = "xyz"
NAMES = {
    **{name: name for name in ("quantity", "model", "physics", "estimates", "accuracy", "magnet")},
    "law[0]": "law",
    **{f"law[{k}]": f"law_number_{k}" for k in (1, 2, 3)},
    "nu": "nu",
    **{f"shape.{name}": f"{name}_over_D" for name in ("L", "magnet_diameter", "magnet_height", "magnet_edge_radius")},
    "load.friction": "friction",
    "load.grip": "grip_over_D",
    "load.plate_tilt": "plate_tilt_rad",
    "load.imperfection": "imperfection_over_E_D2",
    "load.sheared_at_depth": "sheared_at_depth_over_D",
    **{f"load.direction[{k}]": f"direction_{AXES[k]}" for k in (0, 1)},
    "load.depth": "modes_at_depth_over_D",
    "load.density_ratio": "density_ratio",
    "load.shear_x": "at_shear_over_D",
    "load.lowest": "response_from_2pi_f_D_sqrt_rho_over_E",
    "load.highest": "response_to_2pi_f_D_sqrt_rho_over_E",
    **{f"load.{name}": name for name in ("branches", "modulus", "waveform", "cycles")},
    **{name: f"{name}_over_D" for name in ("depth", "shear")},
    **{name: name for name in ("outcome", "status")},
    **{f"response.force[{k}]": f"force_{AXES[k]}_over_E_D2" for k in range(3)},
    **{f"response.shift[{k}]": f"shift_{AXES[k]}_over_D" for k in range(3)},
    **{f"response.{name}": f"{name}_rad" for name in ("tilt", "tilt_y")},
    "response.contact_radius": "contact_radius_over_D",
    "values.critical_depth_over_D": "critical_depth_over_D",
    "values.critical_force_over_ED2": "critical_force_over_E_D2",
    "values.stable_to_over_D": "stable_to_over_D",
    **{f"values.frequency[{k}]": f"frequency_{k + 1}_D_sqrt_rho_over_E" for k in range(6)},
    "values.bandwidth": "bandwidth_2pi_f_D_sqrt_rho_over_E",
    "values.resonance": "resonance_2pi_f_D_sqrt_rho_over_E",
    "values.Q": "resonance_Q",
    "values.gap_percent": "loop_gap_percent",
    "values.area_over_ED3": "loop_area_over_E_D3",
    "values.largest_over_ED2": "loop_largest_force_over_E_D2",
    **{name: name for name in ("error_estimate", "seconds")},
    **{name: f"solved_{name}" for name in ("D_mm", "E_MPa")},
    **{name: name for name in ("message", "versions", "added")},
}
"""Columns that every export has, in their order, by the places of their values as SQLite writes them. Whatever
else is stored has a column too, see `named`."""
TEXTS = {
    *("quantity", "model", "accuracy", "magnet", "law", "branches", "modulus", "waveform"),
    *("outcome", "status", "message", "versions", "added"),
}
"""Columns of `NAMES` that hold texts; friction holds texts and numbers."""
OF_CONTENT = ("quantity", "model", "physics", "estimates", "accuracy", "magnet", "law", "nu", "shape", "load")
"""Parts of a path's content that `NAMES` has."""
ROW = ("depth", "shear", "outcome", "status", "seconds", "versions", "added")
"""Values in the row of a state; others are of its answer."""
UNNAMED = ("shape.D", "load.count")
"""Values that are no columns: D over D, and the number of modes."""
PLACE = re.compile(
    r"\$\.(?P<place>(?!solved\.|accuracy\.|solution\.|reached\.|values\.sensor\.)(?P<name>[\w.]+)(\[(?P<index>\d+)\])?)",
    re.ASCII,
)
"""Place of a value that can be a column: that of a problem, of an accuracy, of a solution in its own units, or of
the small systems of a vibration, is none."""
LONGEST = 6
"""Largest number of values in a list that are columns; a longer list is a curve."""
DAMAGED = "damaged"
"""Status of a state that is not as it was written, and model of a path whose content is no JSON."""
CONTENT = "contents.content"
ANSWER = "iif(json_valid(state.answer), state.answer, '{}')"
"""SQL of what the columns are extracted from."""
CONTENTS = (
    "CREATE TEMPORARY VIEW contents AS SELECT id, key, CAST(content AS BLOB) AS written, iif(json_valid(content)"
    f" AND ltrim(content) LIKE '{{%', content, '{{\"model\": \"{DAMAGED}\"}}') AS content FROM main.path"
)
KIND = ", ".join(f"json_extract(content, '$.{name}')" for name in ("quantity", "model", "physics"))
"""SQL of what a path is of."""
IS_DAMAGED = f"is_damaged(CAST(contents.key AS BLOB), contents.written, {store.READ})"
"""Condition on `state` joined with its `contents`."""
CHOSEN = (
    "CREATE TEMPORARY TABLE chosen (path, depth, shear, outcome, seconds, added, unknown,"
    " PRIMARY KEY (path, depth, shear)) WITHOUT ROWID"
)
"""The states that meet the filters, without answers; or of which this is unknown."""
STATES = (
    "(SELECT path, depth, shear FROM chosen{}) CROSS JOIN main.state USING (path, depth, shear)"
    " JOIN contents ON contents.id = state.path"
)
"""The chosen states with answers and contents, in their order or in another."""
BATCH = 10_000
"""States that are read and written at once."""


# Columns


class Column(NamedTuple):
    """SQL of a column on `state` and `contents`, and whether it holds texts."""

    sql: str
    of_texts: bool


@functools.cache
def named(place: str) -> str:
    """Return the column of a place in a content, a state or an answer.

    >>> named("response.force[2]"), named("values.largest_strain"), named("estimates.shift"), named("values.shape[0]")
    ('force_z_over_E_D2', 'largest_strain', 'estimates_shift', 'shape_1')
    """
    head, _, index = place.removesuffix("]").partition("[")
    name = head.removeprefix("values.").replace(".", "_")
    return NAMES.get(place, f"{name}_{int(index) + 1}" if index else name)


def _column(place: str, source: str, *, of_texts: bool) -> Column:
    name, sql = named(place), f"json_extract({source}, '$.{place}')"
    D, E = (f" / json_extract({ANSWER}, '$.{value}')" for value in ("D_mm", "E_MPa"))
    if place in ROW:
        sql = f"CAST(state.{place} AS {'TEXT' if of_texts else 'REAL'})"
    elif name == "accuracy":
        sql = f"accuracy_name({sql})"
    elif place.startswith("response.") and name.endswith("_over_E_D2"):
        sql += D + D + E
    elif place.startswith("response.") and name.endswith("_over_D"):
        sql += D
    elif place.startswith("values.frequency"):
        # f D (rho / E)^(1/2) is stored in mm, MPa and kg/m^3
        sql += " * 1e-6"
    return Column(sql, of_texts)


COLUMNS = {
    name: _column(place, CONTENT if place.startswith(OF_CONTENT) else ANSWER, of_texts=name in TEXTS)
    for place, name in NAMES.items()
}
"""The columns of `NAMES`."""


def other_columns(connection: sqlite3.Connection, states: str) -> dict[str, Column]:
    """Return the columns that have values in some states, but those of `NAMES`; `states`: a table in SQL."""
    columns = {}
    of_contents = f"contents, json_tree(content) WHERE contents.id IN (SELECT path FROM {states}) AND"
    for source, tables in ((CONTENT, of_contents), (ANSWER, f"{states}, json_tree({ANSWER}) WHERE")):
        found = connection.execute(f"SELECT DISTINCT fullkey, type = 'text' FROM {tables} atom IS NOT NULL")
        places = [(match, text) for key, text in found if (match := PLACE.fullmatch(key.replace('"', "")))]
        texts = {match["place"] for match, text in places if text}
        curves = {match["name"] for match, _ in places if int(match["index"] or 0) >= LONGEST}
        for match, _ in places:
            place = match["place"]
            if place not in NAMES and place not in UNNAMED and match["name"] not in curves:
                columns[named(place)] = _column(place, source, of_texts=place in texts)
    return columns


@functools.cache
def accuracy_name(values: str | None) -> str | None:
    """Return the name of the accuracy level with these values (JSON), or other."""
    if values is None:
        return None
    wanted = {"coarseness": 1.0, "tolerance_factor": 1.0} | json.loads(values)
    return next((name for name, level in LEVELS.items() if asdict(level) == wanted | {"name": name}), "other")


# Reading


@contextlib.contextmanager
def reading(file: Path) -> Iterator[sqlite3.Connection]:
    """Connect to a store, to read it as it is now."""
    with store.readable(file) as connection:
        prepare(connection)
        connection.execute("BEGIN")
        yield connection


def prepare(connection: sqlite3.Connection) -> None:
    """Make the functions and the tables that SQL of this file calls known to a connection."""
    for function, count in ((accuracy_name, 1), (is_damaged, 11), (age, 1)):
        connection.create_function(function.__name__, count, function, deterministic=True)
    connection.execute("PRAGMA temp_store = MEMORY")
    connection.execute(CONTENTS)
    connection.execute(CHOSEN)


@functools.lru_cache(maxsize=1000)
def damaged_path(key: bytes, content: bytes) -> bool:
    """Return whether a path's content is no JSON or does not belong to its key."""
    try:
        return store.key(json.loads(content)).encode() != key
    except (ValueError, TypeError, OverflowError, RecursionError):
        return True


def is_damaged(key: bytes, content: bytes, *row: Any) -> bool:
    """Return whether a state or its path is not as it was written."""
    return damaged_path(key, content) or store.stored(key.decode("utf-8", "replace"), row) is None


def age(content: str) -> int | None:
    """Return -1 for a path of older physics or estimates than the program's, 1 for newer, 0 for the same.

    None if a version is unknown. The program's version of an unknown model is 0. Vibrations and cycles have no
    estimates, and older paths lack their version.
    """
    values = json.loads(content)
    quantity, model, physics, estimates = map(values.get, ("quantity", "model", "physics", "estimates"))
    if estimates is None:
        estimates = physics_version.ESTIMATES if quantity in TIMED else 1
    # a quantity with a version of its own comes before the model that computes it
    versions = {str(name): version for name, version in physics_version.PHYSICS.items()}
    today = versions.get(str(quantity), versions.get(str(model), 0))
    signs = {
        (version > now) - (version < now) if isinstance(version, int | float) else None
        for version, now in ((physics, today), (estimates, physics_version.ESTIMATES))
    }
    return next((sign for sign in (1, -1, None) if sign in signs), 0)


# Filters


def choose(connection: sqlite3.Connection, selection: Selection) -> None:
    """Fill the table of chosen states with those that meet the filters."""
    sql: list[str] = []
    values: list[str | float] = []
    for option, date, sign in (("--since", selection.since, ">="), ("--before", selection.before, "<")):
        if date is not None:
            sql.append(f"state.added {sign} ?")
            values.append(_utc(option, date))
    if outcomes := [name for name in ("failed", "transient") if getattr(selection, name)]:
        sql.append(f"state.outcome IN ({', '.join('?' * len(outcomes))})")
        values += outcomes
    if selection.older_physics:
        sql.append("state.path IN (SELECT id FROM contents WHERE age(content) < 0)")
    if selection.damaged:
        sql.append(IS_DAMAGED)
    unknown = "0"
    if filters := [_parsed(text) for text in selection.where or []]:
        columns = COLUMNS
        if not columns.keys() >= {name for name, _ in filters}:
            columns = COLUMNS | other_columns(connection, "main.state")
        wheres = [_meeting(columns, *where) for where in filters]
        met = " AND ".join(condition for condition, _ in wheres)
        answered = " OR NOT json_valid(state.answer)" if ANSWER in met else ""
        unknown = f"(json_extract(content, '$.model') IS '{DAMAGED}'{answered})"
        sql.append(f"({met} OR {unknown})")
        values += [value for _, of_filter in wheres for value in of_filter]
    meeting = " AND ".join(sql) or "1"
    # an index has all columns that are needed but for those; SQLite would read the answers too
    index = "" if re.search("answer|versions", meeting) else " INDEXED BY state_listing"
    connection.execute(
        "INSERT INTO chosen SELECT state.path, depth, shear, CAST(outcome AS TEXT), CAST(seconds AS REAL),"
        f" CAST(state.added AS TEXT), {unknown} FROM main.state{index} JOIN contents ON contents.id = state.path"
        f" WHERE {meeting}",
        values,
    )
    (damaged,) = connection.execute("SELECT COUNT(*) FROM chosen WHERE unknown").fetchone()
    if damaged:
        raise BadInput(
            f"{damaged} states are not as they were written, so whether they meet --where is not known: magtip store "
            "check says what to do"
        )


def _parsed(text: str) -> tuple[str, str]:
    name, sign, value = (part.strip() for part in text.partition("="))
    if not (name and sign and value):
        raise BadInput(f"--where must be NAME=VALUE, NAME=a,b or NAME=low:high, such as nu=0.45:0.5; got {text!r}")
    return name, value


def _meeting(columns: Mapping[str, Column], name: str, value: str) -> tuple[str, list[str | float]]:
    """Return SQL of the states that have one of the values of a filter, or one in its range; and its parameters."""
    if name not in columns:
        raise BadInput(f"--where: there is no field {name!r}: {nearest(name, COLUMNS)}")
    column = columns[name]
    low, colon, high = value.partition(":")
    # SQLite takes a text for larger than every number
    between = f"{column.sql} BETWEEN ? AND ?"
    values: list[str | float]
    if colon and not column.of_texts:
        least = _number(name, low) if low.strip() else -math.inf
        most = _number(name, high) if high.strip() else math.inf
        if least > most:
            raise BadInput(f"--where: the range of {name} is empty, {value}: give the lower bound first")
        sql, values = between, [least - TOLERANCE, most + TOLERANCE]
    else:
        words = [word.strip() for word in value.split(",")]
        texts = [word for word in words if column.of_texts or (name == "friction" and word.isalpha())]
        numbers = [_number(name, word) for word in words if word not in texts]
        sql = " OR ".join([f"CAST({column.sql} AS TEXT) = ?"] * len(texts) + [between] * len(numbers))
        values = [*texts, *(x for n in numbers for x in (n - TOLERANCE, n + TOLERANCE))]
    of_path = "state." not in sql
    return f"state.path IN (SELECT id FROM contents WHERE {sql})" if of_path else f"({sql})", values


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


# Lists

LISTED = (
    *("quantity", "model", "accuracy", "magnet", "law", "nu", "L_over_D", "friction", "depth_over_D", "shear_over_D"),
    *("status", "force_z_over_E_D2", "force_x_over_E_D2", "critical_depth_over_D", "frequency_1_D_sqrt_rho_over_E"),
    *("error_estimate", "seconds", "added", "message"),
)
"""Columns of a list of states."""
PATH_COLUMNS = (
    *("quantity", "model", "physics", "accuracy", "magnet", "law", "nu", "L_over_D"),
    *("magnet_diameter_over_D", "magnet_height_over_D", "friction"),
)
"""Columns of a list of paths that come from their contents; others come from their states."""


def listing(selection: Selection, limit: int, *, of_paths: bool = False) -> tuple[FlatRow, list[FlatRow]]:
    """Return the summary of a store and its newest states, or its newest paths, that meet the filters.

    `limit`: largest number of rows; 0 for all. SQLite counts to 2**63 - 1.
    """
    file = selection.store or store.default()
    with reading(file) as connection:
        choose(connection, selection)
        rows = (_paths if of_paths else _states)(connection, min(limit, 2**63 - 1) or -1)
        return summary(file, connection), rows


def summary(file: Path, connection: sqlite3.Connection) -> FlatRow:
    """Return how many states of an open store are chosen.

    "size_MB" of the file and its write-ahead log. "solving_s": time that these solves took, s. "states_by_model":
    number of states for each model, or quantity of another kind, and physics version.
    """
    (in_store,) = connection.execute("SELECT COUNT(*) FROM state").fetchone()
    outcomes = dict(connection.execute("SELECT outcome, COUNT(*) FROM chosen GROUP BY outcome"))
    of_paths = "(SELECT path, COUNT(*) AS states FROM chosen GROUP BY path)"
    kinds = connection.execute(
        f"SELECT {KIND}, SUM(states), COUNT(*) FROM {of_paths} JOIN contents ON id = path GROUP BY 1, 2, 3"
    ).fetchall()
    return {
        "file": str(file),
        "size_MB": size_MB(file),
        "paths": sum(paths for *_, paths in kinds),
        "states": sum(outcomes.values()),
        "states_in_store": in_store,
        **{name: outcomes.get(name, 0) for name in ("ok", "failed", "transient")},
        "solving_s": math.fsum(seconds for (seconds,) in connection.execute("SELECT seconds FROM chosen")),
        "states_by_model": tuple(
            f"{solved(quantity, model)} (physics {physics}): {states}"
            for quantity, model, physics, states, _ in kinds
        ),
    }


def solved(quantity: str | None, model: str | None) -> str:
    """Return the name of what is solved: the model of states along a path, or another quantity."""
    return f"force, {model}" if quantity == "force" else str(model if quantity in ("states", None) else quantity)


def size_MB(file: Path) -> float:
    """Return the size of a store's file with its write-ahead log, MB."""
    parts = (file, file.with_name(f"{file.name}-wal"))
    return sum(part.stat().st_size for part in parts if part.exists()) / 1e6


def _position(column: str, place: str, found: str = "NULL") -> str:
    """Return SQL of a position; that of vibrations, cycles and modes, 0 as a state, stands in their content.

    found : SQL of the one to which wanted forces have led.
    """
    return (
        f"CASE {column} WHEN 0 THEN coalesce(json_extract(content, '$.load.{place}'), {found}, 0) ELSE {column} END"
    )


def _found(name: str) -> str:
    return f"json_extract({ANSWER}, '$.values.{name}_mm') / json_extract({ANSWER}, '$.D_mm')"


def _states(connection: sqlite3.Connection, limit: int) -> list[FlatRow]:
    places = {"depth": "depth", "shear": "shear_x"}
    at = {f"{name}_over_D": _position(f"state.{name}", place, _found(name)) for name, place in places.items()}
    sql = ", ".join(at.get(name, COLUMNS[name].sql) for name in LISTED)
    newest = STATES.format(" ORDER BY added DESC, path DESC, depth, shear LIMIT ?")
    query = f"SELECT {sql}, {IS_DAMAGED} FROM {newest} ORDER BY state.added DESC, path DESC, depth, shear"
    without_answer = {name: None for name in LISTED if ANSWER in COLUMNS[name].sql} | {"status": DAMAGED}
    return [
        dict(zip(LISTED, row, strict=True)) | (without_answer if damaged else {})
        for *row, damaged in connection.execute(query, (limit,))
    ]


def _paths(connection: sqlite3.Connection, limit: int) -> list[FlatRow]:
    totals = (
        "SELECT path, COUNT(*) AS states, SUM(outcome != 'ok') AS not_ok, MIN(depth) AS least,"
        " MAX(depth) AS greatest, MAX(shear) AS shear, SUM(seconds) AS seconds, MAX(added) AS added"
        " FROM chosen GROUP BY path"
    )
    found = connection.execute(
        f"SELECT {', '.join(f'{COLUMNS[name].sql} AS {name}' for name in PATH_COLUMNS)}, states, not_ok,"
        f" {_position('least', 'depth')} AS least_depth_over_D,"
        f" {_position('greatest', 'depth')} AS greatest_depth_over_D,"
        f" {_position('shear', 'shear_x')} AS greatest_shear_over_D, seconds, added, key"
        f" FROM ({totals}) JOIN contents ON contents.id = path ORDER BY added DESC, path DESC LIMIT ?",
        (limit,),
    )
    names = [name for name, *_ in found.description]
    return [dict(zip(names, row, strict=True)) for row in found]


# Export

SUFFIXES = (".csv", ".parquet", ".jsonl")
DIGITS = 12
"""Significant digits in a CSV file."""


def export(selection: Selection, out: Path, progress: Progress) -> int:
    """Write the states that meet the filters to a file, in the order of their paths, and return their number."""
    atomic_files.check_output_file(out, *SUFFIXES)
    file = selection.store or store.default()
    written = 0
    with reading(file) as connection:
        choose(connection, selection)
        states = STATES.format("")
        count, damaged = connection.execute(f"SELECT COUNT(*), SUM({IS_DAMAGED}) FROM {states}").fetchone()
        if not count:
            raise BadInput(f"no state of the store {str(file)!r} meets the filters, so {out.name} is not written")
        if damaged:
            raise BadInput(
                f"{damaged} of {count} states of the store {str(file)!r} are not as they were written, so {out.name} "
                "is not written: magtip store check says what to do"
            )
        columns = COLUMNS | other_columns(connection, "chosen CROSS JOIN main.state USING (path, depth, shear)")
        sql = ", ".join(column.sql for column in columns.values())
        rows = connection.execute(f"SELECT {sql} FROM {states} ORDER BY path, depth, shear")
        with atomic_files.sole_writer(out), _writer(out, file, columns) as write:
            while batch := rows.fetchmany(BATCH):
                write(batch)
                written += len(batch)
                progress(written / count, f"{count} states")
    return written


@contextlib.contextmanager
def _writer(
    out: Path, file: Path, columns: Mapping[str, Column]
) -> Iterator[Callable[[list[tuple[Any, ...]]], None]]:
    if out.suffix.lower() == ".jsonl":
        with atomic_files.atomic(out) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as stream:
            yield lambda rows: stream.writelines(
                atomic_files.json_line(dict(zip(columns, row, strict=True))) + "\n" for row in rows
            )
        return
    about = {"store": str(file), "versions": provenance.versions()}
    with table_files.writer(out, digits=DIGITS, about=about) as write:
        yield lambda rows: write(
            {
                name: np.array([None if value is None else str(value) for value in values], dtype=object)
                if column.of_texts or name == "friction"
                else np.array(values, dtype=float)  # NULL is NaN
                for (name, column), values in zip(columns.items(), zip(*rows, strict=True), strict=True)
            }
        )


# Removal


def prune(selection: Selection, *, yes: bool) -> FlatRow:
    """Remove the states that meet the filters, and paths without states; without `yes` only count them.

    "states" and "paths": numbers of states, and of paths of which no state stays. "solving_s": time that the solves
    of the states took, s. "size_MB" of the file before, and "freed_MB", an estimate while nothing is removed.
    """
    if not any(value for name, value in asdict(selection).items() if name != "store"):
        raise BadInput(
            "prune needs a filter, such as --failed, --older-physics, --before 2026-11-05 or --where nu=0.45; "
            "to remove everything, delete the file"
        )
    file = selection.store or store.default()
    with reading(file) as connection:
        choose(connection, selection)
        before = summary(file, connection)
        (paths,) = connection.execute(
            "SELECT COUNT(*) FROM (SELECT path, COUNT(*) AS n FROM chosen GROUP BY path) AS gone"
            " WHERE n = (SELECT COUNT(*) FROM state WHERE state.path = gone.path)"
        ).fetchone()
    states, in_store, size = (before[name] for name in ("states", "states_in_store", "size_MB"))
    if yes and states:
        with store.writable(file) as connection, store.refusals(file):
            prepare(connection)
            connection.execute("BEGIN IMMEDIATE")
            with connection:
                # what another process has solved meanwhile stays
                choose(connection, selection)
                gone = "(SELECT path, depth, shear FROM chosen)"
                connection.execute(f"DELETE FROM main.state WHERE (path, depth, shear) IN {gone}")
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
