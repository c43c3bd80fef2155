"""What is done with a store's states: their table, filters and lists, its export, their removal.

A state is a row, and every value that is stored a column: of the content of its path, of its own row, and of its
answer. Lengths are over D, forces over E D^2. Answers are read only for states of which they are needed.
"""

from __future__ import annotations

import contextlib
import datetime
import functools
import json
import math
import re
import sqlite3
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

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
"""Columns that every export has, in their order, by the places of their values. Whatever else is stored has a column
too, see `PLACE`."""
TEXTS = {
    *("quantity", "model", "accuracy", "magnet", "law", "branches", "modulus", "waveform"),
    *("outcome", "status", "message", "versions", "added"),
}
"""Columns of `NAMES` that hold texts; friction holds texts and numbers."""
COLUMNS = tuple(NAMES.values())
OF_CONTENT = ("quantity", "model", "physics", "estimates", "accuracy", "magnet", "law", "nu", "shape", "load")
"""Parts of a path's content that `NAMES` has."""
ROW = ("depth", "shear", "outcome", "status", "seconds", "added")
"""Values in the row of a state that are read with it."""
NO_COLUMNS = ("solved", "solution", "reached", "sensor")
"""Parts of an answer that are no columns: problem, solution in its own units, small system of a vibration."""
UNNAMED = ("shape.D", "load.count")
"""Values that are no columns: D over D, and the number of modes."""
PLACE = re.compile(r"(?P<name>[\w.]+)(\[(?P<index>\d+)\])?", re.ASCII)
"""Place of a value that can be a column: values.largest_strain is column largest_strain, values.shape[0] shape_1."""
LONGEST = 6
"""Largest number of values in a list that are columns; a longer list is a curve."""
DAMAGED = "damaged"
"""Status of a state that is not as it was written, and model of a path whose content is no JSON."""
BATCH = 5_000
"""Contents or answers that are held at once, beside the columns made of them."""


# The table


@contextlib.contextmanager
def reading(file: Path) -> Iterator[sqlite3.Connection]:
    """Connect to a store, to read it as it is now."""
    with store.readable(file) as connection:
        connection.execute("BEGIN")
        yield connection


def states(connection: sqlite3.Connection) -> pd.DataFrame:
    """Return the states by path, depth and shear, with all columns but those of their answers."""
    import pandas as pd

    # an index has all that is read here; SQLite would read the answers too
    rows = connection.execute(
        "SELECT path, depth, shear, CAST(outcome AS TEXT), CAST(status AS TEXT), CAST(seconds AS REAL),"
        " CAST(added AS TEXT) FROM state INDEXED BY state_listing ORDER BY path, depth, shear"
    )
    frame = pd.DataFrame(rows.fetchall(), columns=["path", *ROW]).set_index(["path", "depth", "shear"])
    at = {f"{name}_over_D": pd.to_numeric(frame.index.get_level_values(name), "coerce") for name in ROW[:2]}
    rows = frame.assign(**at).join(paths(connection), how="inner")
    return rows.assign(
        depth_over_D=_position(rows.depth_over_D, rows.modes_at_depth_over_D),
        shear_over_D=_position(rows.shear_over_D, rows.at_shear_over_D),
    )


def paths(connection: sqlite3.Connection) -> pd.DataFrame:
    """Return the columns of the contents of all paths, by the numbers of the paths."""
    import pandas as pd

    rows = connection.execute("SELECT id, CAST(content AS BLOB) FROM path")
    places = [place for place in NAMES if place.startswith(OF_CONTENT)]
    blocks = [_values([], pd.Index([], dtype=int, name="path"), places)]
    while block := rows.fetchmany(BATCH):
        numbers = pd.Index([path for path, _ in block], name="path")
        blocks.append(_values([_content(text) for _, text in block], numbers, places))
    return pd.concat(blocks)


def _content(text: bytes) -> dict[str, Any]:
    try:
        content = json.loads(text, parse_constant=int)  # there is no NaN in JSON: int refuses it
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict):
        return {"model": DAMAGED}
    return content | {"accuracy": accuracy_name(json.dumps(content.get("accuracy")))}


@functools.cache
def accuracy_name(values: str) -> str | None:
    """Return the name of the accuracy level with these values (JSON), or other."""
    if values == "null":
        return None
    wanted = {"coarseness": 1.0, "tolerance_factor": 1.0} | json.loads(values)
    return next((name for name, level in LEVELS.items() if asdict(level) == wanted | {"name": name}), "other")


def with_answers(
    connection: sqlite3.Connection,
    found: pd.DataFrame,
    columns: Iterable[str] | None = None,
    progress: Progress | None = None,
) -> pd.DataFrame:
    """Return states with columns of their answers, default: all; "damaged": whether it is not as it was written."""
    import pandas as pd

    blocks = []
    for start in range(0, len(found) or 1, BATCH):
        block = _answers(connection, found.index[start : start + BATCH])
        blocks.append(block if columns is None else block.filter(["damaged", *columns]))
        if progress is not None:
            progress(min(start + BATCH, len(found)) / len(found), f"{len(found)} states")
    answers = pd.concat(blocks)
    return found.join(answers[[name for name in answers if name not in found]])


def _answers(connection: sqlite3.Connection, at: pd.MultiIndex) -> pd.DataFrame:
    query = (
        f"SELECT CAST(key AS BLOB), CAST(content AS BLOB), {store.READ} FROM state JOIN path ON id = path"
        " WHERE path = ? AND depth = ? AND shear = ?"
    )
    found = [_stored(*connection.execute(query, (int(path), *position)).fetchone()) for path, *position in at]
    records = [{} if state is None else state.answer | {"versions": state.versions} for state in found]
    frame = _values(records, at, [place for place in NAMES if not place.startswith((*OF_CONTENT, *ROW))])
    D, E = frame.solved_D_mm, frame.solved_E_MPa
    for place, name in NAMES.items():
        if place.startswith("response.") and name.endswith("_over_E_D2"):
            frame[name] = frame[name] / D / D / E
        elif place.startswith("response.") and name.endswith("_over_D"):
            frame[name] /= D
        elif place.startswith("values.frequency"):
            # f D (rho / E)^(1/2) is stored in mm, MPa and kg/m^3
            frame[name] *= 1e-6
    return frame.assign(damaged=[state is None for state in found])


def _stored(key: bytes, content: bytes, *row: Any) -> store.State | None:
    return None if damaged_path(key, content) else store.stored(key.decode(), row)


@functools.lru_cache(maxsize=1000)
def damaged_path(key: bytes, content: bytes) -> bool:
    """Return whether a path's content is no JSON or does not belong to its key."""
    try:
        return store.key(json.loads(content)).encode() != key
    except (ValueError, TypeError, OverflowError, RecursionError):
        return True


def _values(records: Iterable[Any], index: pd.Index, places: list[str]) -> pd.DataFrame:
    """Return a table of records: a column for each of these places, and for each other one that can be a column."""
    import pandas as pd

    frame = pd.DataFrame([dict(_places(record)) for record in records], index, dtype=object)
    curves = {place.partition("[")[0] for place in frame if place.endswith(f"[{LONGEST}]")}
    columns = {NAMES[place]: place for place in places}
    for place in frame:
        match = PLACE.fullmatch(place)
        if match and place not in {*NAMES, *UNNAMED} and match["name"] not in curves:
            name = match["name"].removeprefix("values.").replace(".", "_")
            columns[f"{name}_{int(match['index']) + 1}" if match["index"] else name] = place
    return frame.reindex(columns=list(columns.values())).set_axis(list(columns), axis=1)


def _places(value: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of a record with their places, such as `response.force[2]`."""
    if isinstance(value, dict):
        for name, part in value.items():
            if name not in NO_COLUMNS:
                yield from _places(part, f"{place}.{name}" if place else name)
    elif isinstance(value, list):
        for index, part in enumerate(value[: LONGEST + 1]):
            if not isinstance(part, dict | list):
                yield from _places(part, f"{place}[{index}]")
    elif value is not None:
        yield place, int(value) if isinstance(value, bool) else value


def _plain(frame: pd.DataFrame) -> pd.DataFrame:
    """Return a table with None for no value."""
    return frame.astype(object).where(frame.notna(), None)


def solved(of_paths: pd.DataFrame) -> pd.Series[str]:
    """Return the name of what each path solves: the model of states along it, or another quantity."""
    quantity, model = of_paths.quantity, of_paths.model
    return quantity.mask(quantity.isna() | (quantity == "states"), model).mask(quantity == "force", "force, " + model)


def ages(of_paths: pd.DataFrame) -> pd.Series[float]:
    """Return -1 for each path of older physics or estimates than the program's, 1 for newer, 0 for the same.

    NaN if a version is unknown. The program's version of an unknown model is 0. Vibrations and cycles have no
    estimates, and older paths lack their version.
    """
    import pandas as pd

    quantity, model, physics, estimates = (of_paths[name] for name in ("quantity", "model", "physics", "estimates"))
    # a quantity with a version of its own comes before the model that computes it
    today = quantity.map(physics_version.PHYSICS).fillna(model.map(physics_version.PHYSICS)).fillna(0)
    estimates = estimates.fillna(quantity.isin(TIMED).map({True: physics_version.ESTIMATES, False: 1}))
    made = pd.DataFrame({"physics": physics, "estimates": estimates}).apply(pd.to_numeric, errors="coerce")
    later = made - pd.DataFrame({"physics": today.astype(float), "estimates": physics_version.ESTIMATES})
    cases = [(later > 0).any(axis=1), (later < 0).any(axis=1), later.isna().any(axis=1)]
    return pd.Series(np.select(cases, [1.0, -1.0, math.nan], 0.0), of_paths.index)


# Filters


def choose(connection: sqlite3.Connection, selection: Selection) -> pd.DataFrame:
    """Return the states that meet the filters, without their answers."""
    every = states(connection)
    meets = every.added.notna()
    if selection.since is not None:
        meets &= every.added >= _utc("--since", selection.since)
    if selection.before is not None:
        meets &= every.added < _utc("--before", selection.before)
    if outcomes := [name for name in ("failed", "transient") if getattr(selection, name)]:
        meets &= every.outcome.isin(outcomes)
    if selection.older_physics:
        meets &= ages(every) < 0
    filters = [_parsed(text) for text in selection.where or []]
    of_answers = {name for name, _ in filters} - {*every}
    table = with_answers(connection, every, of_answers) if of_answers or selection.damaged else every
    if selection.damaged:
        meets &= table.damaged
    unknown = meets & ((every.model == DAMAGED) | (table.damaged if of_answers else False)) & bool(filters)
    for name, value in filters:
        if name not in table:
            raise BadInput(f"--where: there is no field {name!r}: {nearest(name, COLUMNS)}")
        meets &= _meeting(table[name], value)
    if unknown.any():
        raise BadInput(
            f"{unknown.sum()} states are not as they were written, so whether they meet --where is not known: magtip "
            "store check says what to do"
        )
    return every[meets]


def _parsed(text: str) -> tuple[str, str]:
    name, sign, value = (part.strip() for part in text.partition("="))
    if not (name and sign and value):
        raise BadInput(f"--where must be NAME=VALUE, NAME=a,b or NAME=low:high, such as nu=0.45:0.5; got {text!r}")
    return name, value


def _of_texts(column: pd.Series[Any]) -> bool:
    name = column.name
    return name in TEXTS or (name not in COLUMNS and bool(column.map(lambda value: isinstance(value, str)).any()))


def _meeting(column: pd.Series[Any], value: str) -> pd.Series[bool]:
    """Return which states have one of the values of a filter, or one in its range."""
    import pandas as pd

    name, of_texts = str(column.name), _of_texts(column)
    numbers = pd.to_numeric(column, "coerce")
    low, colon, high = value.partition(":")
    if colon and not of_texts:
        least = _number(name, low) if low.strip() else -math.inf
        most = _number(name, high) if high.strip() else math.inf
        if least > most:
            raise BadInput(f"--where: the range of {name} is empty, {value}: give the lower bound first")
        return numbers.between(least - TOLERANCE, most + TOLERANCE)
    words = [word.strip() for word in value.split(",")]
    texts = [word for word in words if of_texts or (name == "friction" and word.isalpha())]
    meets = column.map(str, na_action="ignore").isin(texts)
    for number in [_number(name, word) for word in words if word not in texts]:
        meets |= numbers.between(number - TOLERANCE, number + TOLERANCE)
    return meets


def _number(name: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise BadInput(f"--where: {name} must be a number, several as a,b, or a range low:high; got {text!r}")
    return number


def _utc(option: str, text: str) -> str:
    """Return a date or time as the store writes it; one without a time zone is UTC."""
    try:
        time = datetime.datetime.fromisoformat(text)
    except ValueError:
        raise BadInput(
            f"{option} must be a date or time such as 2026-11-05 or 2026-11-05T14:30; got {text!r}"
        ) from None
    zoned = time if time.tzinfo else time.replace(tzinfo=datetime.UTC)
    return zoned.astimezone(datetime.UTC).isoformat(timespec="seconds")


# Lists

LISTED = [
    *("quantity", "model", "accuracy", "magnet", "law", "nu", "L_over_D", "friction", "depth_over_D", "shear_over_D"),
    *("status", "force_z_over_E_D2", "force_x_over_E_D2", "critical_depth_over_D", "frequency_1_D_sqrt_rho_over_E"),
    *("error_estimate", "seconds", "added", "message"),
]
"""Columns of a list of states."""
PATH_COLUMNS = [
    *("quantity", "model", "physics", "accuracy", "magnet", "law", "nu", "L_over_D"),
    *("magnet_diameter_over_D", "magnet_height_over_D", "friction"),
]
"""Columns of a list of paths that come from their contents; others come from their states."""


def listing(selection: Selection, limit: int, *, of_paths: bool = False) -> tuple[FlatRow, list[FlatRow]]:
    """Return the summary of a store and its newest states, or its newest paths, that meet the filters.

    `limit`: largest number of rows; 0 for all.
    """
    file = selection.store or store.default()
    with reading(file) as connection:
        found = choose(connection, selection)
        rows = (_paths if of_paths else _states)(connection, found, limit or len(found))
        return summary(file, connection, found), _plain(rows).to_dict("records")


def summary(file: Path, connection: sqlite3.Connection, found: pd.DataFrame) -> FlatRow:
    """Return how many states of an open store are chosen.

    "size_MB" of the file and its write-ahead log. "solving_s": time that these solves took, s. "states_by_model":
    number of states for each model, or quantity of another kind, and physics version.
    """
    (in_store,) = connection.execute("SELECT COUNT(*) FROM state").fetchone()
    return {
        "file": str(file),
        "size_MB": size_MB(file),
        "paths": found.index.unique("path").size,
        "states": len(found),
        "states_in_store": in_store,
        **{name: int((found.outcome == name).sum()) for name in ("ok", "failed", "transient")},
        "solving_s": math.fsum(found.seconds),
        "states_by_model": tuple(
            f"{name} (physics {version}): {count}"
            for (name, version), count in found.groupby([solved(found), found.physics.fillna("unknown")])
            .size()
            .items()
        ),
    }


def size_MB(file: Path) -> float:
    """Return the size of a store's file with its write-ahead log, MB."""
    parts = (file, file.with_name(f"{file.name}-wal"))
    return sum(part.stat().st_size for part in parts if part.exists()) / 1e6


def _position(at: pd.Series[Any], of_load: pd.Series[Any]) -> pd.Series[Any]:
    """Return positions over D; one that is 0 as a state stands in the load of a path or follows from a force."""
    return at.astype(object).where(at != 0, of_load.astype(object).fillna(0))


def _states(connection: sqlite3.Connection, found: pd.DataFrame, limit: int) -> pd.DataFrame:
    order = ["added", "path", "depth_over_D", "shear_over_D"]
    newest = found.sort_values(order, ascending=[False, False, True, True]).head(limit)
    rows = with_answers(connection, newest)
    rows = rows.reindex(columns=list(dict.fromkeys([*rows, "depth_mm", "shear_mm"])))
    D = rows.solved_D_mm
    return rows.assign(
        depth_over_D=_position(rows.depth_over_D, rows.depth_mm / D),
        shear_over_D=_position(rows.shear_over_D, rows.shear_mm / D),
        status=rows.status.mask(rows.damaged, DAMAGED),
    )[LISTED]


def _paths(connection: sqlite3.Connection, found: pd.DataFrame, limit: int) -> pd.DataFrame:
    keys = dict(connection.execute("SELECT id, key FROM path").fetchall())
    of_path = found.assign(not_ok=found.outcome != "ok").groupby("path")
    rows = of_path[PATH_COLUMNS].first().assign(states=of_path.size(), not_ok=of_path.not_ok.sum())
    return (
        rows.assign(
            least_depth_over_D=of_path.depth_over_D.min(),
            greatest_depth_over_D=of_path.depth_over_D.max(),
            greatest_shear_over_D=of_path.shear_over_D.max(),
            seconds=of_path.seconds.sum(),
            added=of_path.added.max(),
            key=rows.index.map(keys),
        )
        .sort_values(["added", "path"], ascending=False)
        .head(limit)
    )


# Export

SUFFIXES = (".csv", ".parquet", ".jsonl")
DIGITS = 12
"""Significant digits in a CSV file."""


def export(selection: Selection, out: Path, progress: Progress) -> int:
    """Write the states that meet the filters to a file, in the order of their paths, and return their number."""
    atomic_files.check_output_file(out, *SUFFIXES)
    file = selection.store or store.default()
    with reading(file) as connection:
        found = choose(connection, selection)
        if found.empty:
            raise BadInput(f"no state of the store {str(file)!r} meets the filters, so {out.name} is not written")
        table = with_answers(connection, found, progress=progress)
    if damaged := table.pop("damaged").sum():
        raise BadInput(
            f"{damaged} of {len(table)} states of the store {str(file)!r} are not as they were written, so "
            f"{out.name} is not written: magtip store check says what to do"
        )
    table = table[[*COLUMNS, *table.drop(columns=[*COLUMNS]).dropna(axis=1, how="all")]]
    with atomic_files.sole_writer(out):
        if out.suffix.lower() == ".jsonl":
            with atomic_files.atomic(out) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as stream:
                stream.writelines(atomic_files.json_line(row) + "\n" for row in table.to_dict("records"))
        else:
            about = {"store": str(file), "versions": provenance.versions()}
            with table_files.writer(out, digits=DIGITS, about=about) as write:
                write({name: _written(table[name]) for name in table})
    return len(table)


def _written(column: pd.Series[Any]) -> NDArray[Any]:
    if column.name == "friction" or _of_texts(column):
        column = column.map(str, na_action="ignore")
        return np.array(column, dtype=object)
    return np.array(column, dtype=float)


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
        found = choose(connection, selection)
        before = summary(file, connection, found)
        in_path = dict(connection.execute("SELECT path, COUNT(*) FROM state GROUP BY path"))
    gone = sum(count == in_path[path] for path, count in found.groupby("path").size().items())
    states, in_store, size = (before[name] for name in ("states", "states_in_store", "size_MB"))
    if yes and states:
        with store.writable(file) as connection, store.refusals(file):
            connection.execute("BEGIN IMMEDIATE")
            with connection:
                # what another process has solved meanwhile stays
                rows = [(int(path), *position) for path, *position in choose(connection, selection).index]
                connection.executemany("DELETE FROM state WHERE path = ? AND depth = ? AND shear = ?", rows)
                connection.execute("DELETE FROM path WHERE id NOT IN (SELECT path FROM state)")
            connection.execute("VACUUM")
            # a process that reads keeps the old pages: the file shrinks later, without a wait here
            connection.execute("PRAGMA busy_timeout = 0")
            connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    return {
        "file": str(file),
        "removed": yes,
        "states": states,
        "paths": gone,
        "states_left": in_store - states,
        "solving_s": before["solving_s"],
        "size_MB": size,
        "freed_MB": size - size_MB(file) if yes else size * (states / in_store if in_store else 0.0),
    }
