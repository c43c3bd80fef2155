"""What is done with a store's states: their table, filters and lists, its export, their removal.

A state is a row, and every value that is stored a column: of the content of its path, of its own row, and of its
answer. Lengths are over D, forces over E D^2. Answers, which are most of a file, are read only of the states that are
shown or written, or if a filter needs them.
"""

from __future__ import annotations

import contextlib
import datetime
import functools
import json
import math
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fem import physics_version
from fem.accuracy import LEVELS
from geometry.bad_input import nearest
from geometry.design import BadInput
from geometry.messages import Progress
from studies.inputs.option_groups import Selection
from studies.mechanics import store
from studies.mechanics.store import State
from studies.mechanics.timed_quantities import TIMED
from studies.output import atomic_files, provenance, table_files
from studies.output.records import FlatRow

if TYPE_CHECKING:
    import pandas as pd

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
    "depth": "depth_over_D",
    "shear": "shear_over_D",
    "outcome": "outcome",
    "status": "status",
    **{f"response.force[{k}]": f"force_{AXES[k]}_over_E_D2" for k in range(3)},
    **{f"response.shift[{k}]": f"shift_{AXES[k]}_over_D" for k in range(3)},
    "response.tilt": "tilt_rad",
    "response.tilt_y": "tilt_y_rad",
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
    "error_estimate": "error_estimate",
    "seconds": "seconds",
    "D_mm": "solved_D_mm",
    "E_MPa": "solved_E_MPa",
    **{name: name for name in ("message", "versions", "added")},
}
"""Columns that every export has, in their order, by the places of their values as SQLite writes them. Whatever
else is stored has a column too, see `named`."""
HEAD = tuple(NAMES.values())
TEXTS = {
    *("quantity", "model", "accuracy", "magnet", "law", "branches", "modulus", "waveform"),
    *("outcome", "status", "message", "versions", "added"),
}
"""Columns of `NAMES` that hold texts; friction holds texts and numbers."""
UNNAMED = ("shape.D", "load.count")
"""Values that are no columns: D over D, and the number of modes."""
LONGEST = 6
"""Largest number of values in a list that are columns; a longer list is a curve."""
DAMAGED = "damaged"
"""Status of a state that is not as it was written, and model of a path whose content is no JSON."""
KEY = ["path", "depth_over_D", "shear_over_D"]
"""Columns that tell states apart."""
# the index has all these columns; SQLite would read the answers too
STATES = (
    "SELECT path, depth AS depth_over_D, shear AS shear_over_D, CAST(outcome AS TEXT) AS outcome,"
    " CAST(status AS TEXT) AS status, CAST(seconds AS REAL) AS seconds, CAST(added AS TEXT) AS added"
    " FROM main.state INDEXED BY state_listing ORDER BY added DESC, path DESC, depth, shear"
)
"""The rows of all states without answers and versions, the newest first."""
ONE = (
    f"SELECT CAST(key AS BLOB), CAST(content AS BLOB), {store.READ} FROM state JOIN path ON path.id = state.path"
    " WHERE path = ? AND depth = ? AND shear = ?"
)
BATCH = 10_000
"""States that are read and written at once."""


# Columns


@functools.cache
def named(place: str) -> str:
    """Return the column of a place in a content, a state or an answer.

    >>> named("response.force[2]"), named("values.largest_strain"), named("estimates.shift"), named("values.shape[0]")
    ('force_z_over_E_D2', 'largest_strain', 'estimates_shift', 'shape_1')
    """
    head, _, index = place.removesuffix("]").partition("[")
    name = head.removeprefix("values.").replace(".", "_")
    return NAMES.get(place, f"{name}_{int(index) + 1}" if index else name)


def places(values: Any, at: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the places and the values of a content or an answer that are columns.

    >>> dict(places({"shape": {"D": 1.0, "L": 1.5}, "law": ["yeoh", 0.1], "grip": None}))
    {'shape.L': 1.5, 'law[0]': 'yeoh', 'law[1]': 0.1}
    """
    if isinstance(values, dict):
        for name, value in values.items():
            yield from places(value, f"{at}.{name}" if at else name)
    elif isinstance(values, list) and len(values) <= LONGEST:
        for k, value in enumerate(values):
            yield from places(value, f"{at}[{k}]")
    elif isinstance(values, str | int | float) and at not in UNNAMED:
        yield at, values


def content_columns(content: bytes) -> FlatRow:
    """Return the columns of a path's content; one that is no JSON is of the model "damaged"."""
    try:
        # int refuses the NaN and the Infinity of Python, which are no JSON
        values = dict(json.loads(content, parse_constant=int))
        if "accuracy" in values:
            values["accuracy"] = accuracy_name(json.dumps(values["accuracy"]))
        return {named(place): value for place, value in places(values)}
    except (ValueError, TypeError, RecursionError):
        return {"model": DAMAGED}


@functools.cache
def accuracy_name(values: str) -> str:
    """Return the name of the accuracy level with these values (JSON), or other."""
    wanted = {"coarseness": 1.0, "tolerance_factor": 1.0} | json.loads(values)
    return next((name for name, level in LEVELS.items() if asdict(level) == wanted | {"name": name}), "other")


def answer_columns(state: State | None) -> FlatRow:
    """Return the columns of a state's answer, and its status and versions; a damaged state has no answer."""
    if state is None:
        return {"status": DAMAGED}
    answer = {name: value for name, value in state.answer.items() if name != "solved"}
    D, E = answer.get("D_mm"), answer.get("E_MPa")
    columns = {named(place): _scaled(place, value, D, E) for place, value in places(answer)}
    return columns | {"status": state.status, "versions": state.versions}


def _scaled(place: str, value: Any, D: Any, E: Any) -> Any:
    """Return a value of an answer over the D or the E D^2 that were solved."""
    if place.startswith("response.") and named(place).endswith("_over_E_D2"):
        return value / D / D / E
    if place.startswith("response.") and named(place).endswith("_over_D"):
        return value / D
    # f D (rho / E)^(1/2) is stored in mm, MPa and kg/m^3
    return value * 1e-6 if place.startswith("values.frequency") else value


# Reading


@contextlib.contextmanager
def reading(file: Path) -> Iterator[sqlite3.Connection]:
    """Connect to a store, to read it as it is now."""
    with store.readable(file) as connection:
        connection.execute("BEGIN")
        yield connection


def paths(connection: sqlite3.Connection) -> pd.DataFrame:
    """Return the columns of the contents of all paths, by their numbers."""
    import pandas as pd

    found = connection.execute("SELECT id, CAST(content AS BLOB) FROM path")
    contents = {number: content_columns(content) for number, content in found}
    frame = pd.DataFrame(list(contents.values()), list(contents), dtype=object)
    return frame.reindex(columns=list(dict.fromkeys((*PATH_COLUMNS, *POSITIONS.values(), "estimates", *frame))))


def states(connection: sqlite3.Connection) -> pd.DataFrame:
    """Return the columns of all states, the newest first, but those of their answers."""
    import pandas as pd

    try:
        return pd.read_sql(STATES, connection).join(paths(connection), on="path", how="inner")
    except pd.errors.DatabaseError as error:
        raise error.__cause__ or error from None


def read(connection: sqlite3.Connection, chosen: pd.DataFrame) -> Iterator[State | None]:
    """Yield states as they were written; None for one that is damaged, or whose path is."""
    for at in chosen[KEY].itertuples(index=False, name=None):
        key, content, *row = connection.execute(ONE, at).fetchone()
        yield None if damaged_path(key, content) else store.stored(key.decode("utf-8", "replace"), row)


def answered(
    connection: sqlite3.Connection, found: pd.DataFrame, names: Iterable[str] = (), progress: Progress | None = None
) -> pd.DataFrame:
    """Return states with the columns of their answers too, or only those of these names that are stored."""
    import pandas as pd

    batches = []
    for begin in range(0, max(len(found), 1), BATCH):
        batch = found.iloc[begin : begin + BATCH]
        answers = pd.DataFrame(list(map(answer_columns, read(connection, batch))), batch.index, dtype=object)
        rows = batch.assign(**answers)
        batches.append(rows[[name for name in names if name in rows] or list(rows)])
        if progress is not None:
            progress((begin + len(batch)) / len(found), f"{len(found)} states")
    return pd.concat(batches)


@functools.lru_cache(maxsize=1000)
def damaged_path(key: bytes, content: bytes) -> bool:
    """Return whether a path's content is no JSON or does not belong to its key."""
    try:
        return store.key(json.loads(content)).encode() != key
    except (ValueError, TypeError, OverflowError, RecursionError):
        return True


def ages(rows: pd.DataFrame) -> pd.DataFrame:
    """Return versions of the physics and of the estimates less those of the program, of paths or states.

    An unknown version is NaN, and the program's version of an unknown model 0. Vibrations and cycles have no
    estimates, and older paths lack their version.
    """
    # a quantity with a version of its own comes before the model that computes it
    today = rows.quantity.map(physics_version.PHYSICS).fillna(rows.model.map(physics_version.PHYSICS)).fillna(0)
    without = rows.quantity.isin(TIMED).map({True: physics_version.ESTIMATES, False: 1})
    estimates = numbers(rows.estimates.fillna(without))
    return rows[["physics", "estimates"]].assign(
        physics=numbers(rows.physics) - today, estimates=estimates - physics_version.ESTIMATES
    )


def numbers(column: pd.Series) -> pd.Series:
    """Return a column with NaN where it holds no number."""
    import pandas as pd

    return pd.to_numeric(column, errors="coerce")


# Filters


def chosen(connection: sqlite3.Connection, selection: Selection) -> pd.DataFrame:
    """Return the states that meet the filters, the newest first, without their answers."""
    found = states(connection)
    if selection.since is not None:
        found = found[found.added >= _utc("--since", selection.since)]
    if selection.before is not None:
        found = found[found.added < _utc("--before", selection.before)]
    if outcomes := [name for name in ("failed", "transient") if getattr(selection, name)]:
        found = found[found.outcome.isin(outcomes)]
    if selection.older_physics:
        found = found[(ages(found) < 0).any(axis=1)]
    filters = [_parsed(text) for text in selection.where or []]
    columns = _columns([name for name, _ in filters], connection, found)
    for name, value in filters:
        found = found[_meeting(name, value, columns.loc[found.index, name])]
    return found[[state is None for state in read(connection, found)]] if selection.damaged else found


def _parsed(text: str) -> tuple[str, str]:
    name, sign, value = (part.strip() for part in text.partition("="))
    if not (name and sign and value):
        raise BadInput(f"--where must be NAME=VALUE, NAME=a,b or NAME=low:high, such as nu=0.45:0.5; got {text!r}")
    return name, value


def _columns(names: Sequence[str], connection: sqlite3.Connection, found: pd.DataFrame) -> pd.DataFrame:
    """Return columns of states; answers are read only if they are needed."""
    needed = dict.fromkeys((*names, "model", "status"))
    if not set(names) <= set(found):
        found = answered(connection, found, needed)
    if unknown := [name for name in names if name not in found and name not in HEAD]:
        raise BadInput(f"--where: there is no field {unknown[0]!r}: {nearest(unknown[0], HEAD)}")
    damaged = ((found.status == DAMAGED) | (found.model == DAMAGED)).sum()
    if names and damaged:
        raise BadInput(
            f"{damaged} of {len(found)} states are not as they were written, so whether they meet --where is not "
            "known: magtip store check says what to do"
        )
    return found.reindex(columns=list(needed))


def _meeting(name: str, value: str, column: pd.Series) -> pd.Series:
    """Return which states have one of the values of a filter, or one in its range."""
    found = numbers(column)
    low, colon, high = value.partition(":")
    if colon and not _of_texts(column):
        least = _number(name, low) if low.strip() else -math.inf
        most = _number(name, high) if high.strip() else math.inf
        if least > most:
            raise BadInput(f"--where: the range of {name} is empty, {value}: give the lower bound first")
        return found.between(least - TOLERANCE, most + TOLERANCE)
    words = [word.strip() for word in value.split(",")]
    texts = [word for word in words if _of_texts(column) or (name == "friction" and word.isalpha())]
    met = column.isin(texts)
    for number in (_number(name, word) for word in words if word not in texts):
        met |= found.between(number - TOLERANCE, number + TOLERANCE)
    return met


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

COLUMNS = (
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
POSITIONS = {"depth_over_D": "modes_at_depth_over_D", "shear_over_D": "at_shear_over_D"}
"""Columns of the position of a state, and of that about which a path vibrates."""


def listing(selection: Selection, limit: int, *, of_paths: bool = False) -> tuple[FlatRow, list[FlatRow]]:
    """Return the summary of a store and its newest states, or its newest paths, that meet the filters.

    `limit`: largest number of rows; 0 for all.
    """
    file = selection.store or store.default()
    with reading(file) as connection:
        found = chosen(connection, selection)
        rows = (_paths if of_paths else _states)(connection, found, limit or len(found))
        return summary(file, connection, found), rows.astype(object).where(rows.notna(), None).to_dict("records")


def summary(file: Path, connection: sqlite3.Connection, found: pd.DataFrame) -> FlatRow:
    """Return how many states of an open store are chosen.

    "size_MB" of the file and its write-ahead log. "solving_s": time that these solves took, s. "states_by_model":
    number of states for each model, or quantity of another kind, and physics version.
    """
    (in_store,) = connection.execute("SELECT COUNT(*) FROM state").fetchone()
    outcomes = found.outcome.value_counts()
    return {
        "file": str(file),
        "size_MB": size_MB(file),
        "paths": found.path.nunique(),
        "states": len(found),
        "states_in_store": in_store,
        **{name: int(outcomes.get(name, 0)) for name in ("ok", "failed", "transient")},
        "solving_s": math.fsum(found.seconds),
        "states_by_model": tuple(f"{name} (physics {physics}): {count}" for name, physics, count in counted(found)),
    }


def counted(rows: pd.DataFrame) -> list[tuple[str, str, int]]:
    """Return what paths or states are of, a model or else a quantity, with its physics version and their number."""
    kinds = rows[["quantity", "model", "physics"]].fillna("None").astype(str).value_counts().sort_index()
    return [
        (model if quantity in ("states", "None") else quantity, physics, count)
        for (quantity, model, physics), count in kinds.items()
    ]


def size_MB(file: Path) -> float:
    """Return the size of a store's file with its write-ahead log, MB."""
    parts = (file, file.with_name(f"{file.name}-wal"))
    return sum(part.stat().st_size for part in parts if part.exists()) / 1e6


def _states(connection: sqlite3.Connection, found: pd.DataFrame, limit: int) -> pd.DataFrame:
    newest = found.head(limit)
    rows = answered(connection, newest, COLUMNS).reindex(columns=COLUMNS)
    return rows.assign(**{name: _position(newest, name, newest[name]) for name in POSITIONS})


def _position(rows: pd.DataFrame, name: str, value: pd.Series) -> pd.Series:
    """Return a position; that of vibrations, cycles and modes, which is 0 as a state, stands in their content."""
    return value.mask(value == 0, rows[POSITIONS[name]].fillna(0.0))


def _paths(connection: sqlite3.Connection, found: pd.DataFrame, limit: int) -> pd.DataFrame:
    of_states = found.assign(not_ok=found.outcome != "ok", **{name: numbers(found[name]) for name in POSITIONS})
    totals = of_states.groupby("path").agg(
        states=("outcome", "size"),
        not_ok=("not_ok", "sum"),
        least_depth_over_D=("depth_over_D", "min"),
        greatest_depth_over_D=("depth_over_D", "max"),
        greatest_shear_over_D=("shear_over_D", "max"),
        seconds=("seconds", "sum"),
        added=("added", "max"),
    )
    rows = totals.join(paths(connection))
    for name in ("least_depth_over_D", "greatest_depth_over_D", "greatest_shear_over_D"):
        rows[name] = _position(rows, name.partition("_")[2], rows[name])
    rows["key"] = rows.index.map(dict(connection.execute("SELECT id, key FROM path").fetchall()))
    newest = rows.reset_index().sort_values(["added", "path"], ascending=False).head(limit)
    return newest[[*PATH_COLUMNS, *totals, "key"]]


# Export

SUFFIXES = (".csv", ".parquet", ".jsonl")
DIGITS = 12
"""Significant digits in a CSV file."""


def export(selection: Selection, out: Path, progress: Progress) -> int:
    """Write the states that meet the filters to a file, in the order of their paths, and return their number."""
    atomic_files.check_output_file(out, *SUFFIXES)
    file = selection.store or store.default()
    with reading(file) as connection:
        found = chosen(connection, selection).sort_values(KEY, key=numbers)
        if found.empty:
            raise BadInput(f"no state of the store {str(file)!r} meets the filters, so {out.name} is not written")
        rows = answered(connection, found, progress=progress)
    if damaged := int((rows.status == DAMAGED).sum()):
        raise BadInput(
            f"{damaged} of {len(rows)} states of the store {str(file)!r} are not as they were written, so {out.name} "
            "is not written: magtip store check says what to do"
        )
    others = [name for name in rows if name not in HEAD and name != "path" and rows[name].notna().any()]
    with atomic_files.sole_writer(out):
        _write(rows.reindex(columns=[*HEAD, *others]), out, file)
    return len(rows)


def _write(rows: pd.DataFrame, out: Path, file: Path) -> None:
    if out.suffix.lower() == ".jsonl":
        with atomic_files.atomic(out) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as stream:
            for values in rows.itertuples(index=False, name=None):
                stream.write(atomic_files.json_line(dict(zip(rows, values, strict=True))) + "\n")
        return
    about = {"store": str(file), "versions": provenance.versions()}
    texts = {name: name == "friction" or _of_texts(rows[name]) for name in rows}
    with table_files.writer(out, digits=DIGITS, about=about) as write:
        for begin in range(0, len(rows), BATCH):
            batch = rows.iloc[begin : begin + BATCH]
            write({name: _array(batch[name], of_texts=of_texts) for name, of_texts in texts.items()})


def _array(column: pd.Series, *, of_texts: bool) -> Any:
    """Return a column as texts, None where there is none, or as numbers, NaN where there is none."""
    if of_texts:
        return column.map(str, na_action="ignore").astype(object).where(column.notna(), None).to_numpy()
    return column.astype(float).to_numpy()


def _of_texts(column: pd.Series) -> bool:
    return column.name in TEXTS or (column.name not in HEAD and bool(column.map(type).eq(str).any()))


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
        gone = chosen(connection, selection)
        before = summary(file, connection, gone)
        of_paths = dict(connection.execute("SELECT path, COUNT(*) FROM state GROUP BY path").fetchall())
    states, in_store, size = (before[name] for name in ("states", "states_in_store", "size_MB"))
    if yes and states:
        _remove(file, selection)
    return {
        "file": str(file),
        "removed": yes,
        "states": states,
        "paths": sum(count == of_paths[path] for path, count in gone.path.value_counts().items()),
        "states_left": in_store - states,
        "solving_s": before["solving_s"],
        "size_MB": size,
        "freed_MB": size - size_MB(file) if yes else size * (states / in_store if in_store else 0.0),
    }


def _remove(file: Path, selection: Selection) -> None:
    with store.writable(file) as connection, store.refusals(file):
        connection.execute("BEGIN IMMEDIATE")
        with connection:
            # what another process has solved meanwhile stays
            gone = chosen(connection, selection)
            connection.executemany(
                "DELETE FROM state WHERE path = ? AND depth = ? AND shear = ?",
                gone[KEY].itertuples(index=False, name=None),
            )
            connection.execute("DELETE FROM path WHERE id NOT IN (SELECT path FROM state)")
        connection.execute("VACUUM")
        # a process that reads keeps the old pages: the file shrinks later, without a wait here
        connection.execute("PRAGMA busy_timeout = 0")
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
