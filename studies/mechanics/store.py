"""Solved states of all studies in one SQLite file, so that no case is solved twice.

A *path* stands for all states that differ only in the position of plate or grip. Its content is everything else on
which the finite elements depend, in dimensionless form (lengths over D, stresses over E), and the physics version of
the model. Its key is a digest of this content as canonical JSON, with numbers written by `float.hex`. A *state*
belongs to a path, has a position (depth, shear), both over D and rounded to `DIGITS`, and holds its answer as JSON.

An outcome is "ok" (solved), "failed" (the solve stops for a numerical or physical reason and would stop again) or
"transient" (the process died or ran out of memory, and another attempt may succeed).

The file is in write-ahead mode: any number of processes can read while one writes. Each transaction is on the disk
when `add` returns (synchronous = FULL), so a killed process loses nothing that it has added. Transactions of several
writers wait for each other, up to `PATIENCE` of `store_file`, which has the tables. SQLite's locks fail on many
network file systems, so keep the store on a local disk. Nothing in the file is executed or unpickled.
"""

from __future__ import annotations

import contextlib
import datetime
import hashlib
import json
import math
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from geometry.design import BadInput
from studies.mechanics import store_file
from studies.output import atomic_files

DIGITS = 12
"""Decimal places of lengths over D: positions that agree to these are equal. Rounding errors are about 1e-16."""
VARIABLE = "MAGTIP_STORE"
"""Environment variable with the path of a store that replaces the user's own."""

Outcome = Literal["ok", "failed", "transient"]
Content = Mapping[str, Any]
Position = tuple[float, float]


@dataclass(frozen=True, slots=True)
class State:
    """A stored state at one position of a path.

    Attributes
    ----------
    depth, shear : of plate or grip, over D.
    outcome, status : kind of result, and status of the solve.
    answer : values that JSON can hold.
    seconds : time of the solve from the previous state, s.
    versions : of Python, the packages and the source that solved it.
    """

    depth: float
    shear: float
    outcome: Outcome
    status: str
    answer: dict[str, Any]
    seconds: float
    versions: str

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (self.depth, self.shear, self.seconds))):
            raise ValueError("depth, shear and seconds of a stored state must be finite")

    @property
    def position(self) -> Position:
        """Depth and shear over D, rounded."""
        return position(self.depth, self.shear)


READ = "depth, shear, seconds, " + ", ".join(
    f"CAST(state.{name} AS BLOB)" for name in ("outcome", "status", "answer", "versions", "added", "digest")
)
"""SQL of the columns that `stored` takes. Texts are read as bytes, because those of a damaged file may be none."""


def digest(path: str, numbers: Sequence[float], texts: Sequence[bytes]) -> str:
    """Return the digest of a state: that of the key of its path and of all that its row holds."""
    parts = [path.encode(), *(float.hex(number).encode() for number in numbers), *texts]
    return hashlib.sha256(b"".join(b"%d:%s" % (len(part), part) for part in parts)).hexdigest()[:32]


def stored(path: str, row: Sequence[Any]) -> State | None:
    """Return the state in a row of `READ` of the path with a key; None if it is not what was written."""
    depth, shear, seconds, *texts, written = row
    numbers = (depth, shear, seconds)
    if not all(isinstance(number, float) for number in numbers) or digest(path, numbers, texts).encode() != written:
        return None
    outcome, status, answer, versions, _ = (text.decode() for text in texts)
    return State(depth, shear, outcome, status, json.loads(answer), seconds, versions)


def position(depth: float, shear: float) -> Position:
    """Return a position as the store compares it: rounded, without negative zeros.

    >>> position(0.1 + 0.2, 0.0)
    (0.3, 0.0)
    """
    return round(depth, DIGITS) + 0.0, round(shear, DIGITS) + 0.0


def key(content: Content | Sequence[Content]) -> str:
    """Return the digest of a path's content: 32 hexadecimal digits, equal on all machines.

    >>> key({"nu": 0.5, "law": "yeoh"}) == key({"law": "yeoh", "nu": 0.5})
    True
    >>> key({"nu": 0.5}) == key({"nu": 0.5000000000000001})
    False
    """
    return hashlib.sha256(json.dumps(_exact(content), sort_keys=True).encode()).hexdigest()[:32]


def _exact(value: Any) -> Any:
    """Convert numbers to texts that keep every bit; an integer and the equal float have the same text."""
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return value
    if isinstance(value, int | float):
        return float(value).hex()
    if isinstance(value, Mapping):
        return {str(name): _exact(part) for name, part in value.items()}
    if isinstance(value, Sequence):
        return [_exact(part) for part in value]
    raise TypeError(f"a path's content holds plain values only; got {type(value).__name__}")


class Store:
    """An open store, see `opened`.

    Attributes
    ----------
    file : of the store.
    """

    def __init__(self, file: Path, connection: sqlite3.Connection) -> None:
        self.file, self._connection = file, connection

    def states(self, content: Content) -> dict[Position, State]:
        """Return all states of a path by their positions."""
        path = key(content)
        with store_file.refusals(self.file):
            rows = self._connection.execute(
                f"SELECT {READ} FROM state JOIN path ON path.id = state.path WHERE path.key = ?", (path,)
            ).fetchall()
        states = [stored(path, row) for row in rows]
        if None in states:
            raise BadInput(
                f"a state in the store {str(self.file)!r} is damaged, since its digest does not match what it holds: "
                "magtip store check says what to do"
            )
        return {state.position: state for state in states if state is not None}

    def add(self, content: Content, states: Iterable[State]) -> None:
        """Add states of a path, see `add_many`; a file on a disk takes some ms for each call."""
        self.add_many([(content, states)])

    def add_many(self, paths: Iterable[tuple[Content, Iterable[State]]]) -> None:
        """Add states of several paths in one transaction; they are on the disk afterwards.

        A state replaces the stored one at the same position.

        Raises
        ------
        BadInput
            The file cannot take them: its disk is full, it is damaged, or another process has locked it for too long.
        """
        now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        with store_file.refusals(self.file), self._connection as connection:
            # take the write lock first: SQLite does not wait when a transaction that has read begins to write
            connection.execute("BEGIN IMMEDIATE")
            for content, states in paths:
                path = key(content)
                connection.execute(
                    "INSERT OR IGNORE INTO path (key, content, added) VALUES (?, ?, ?)", (path, _json(content), now)
                )
                (number,) = connection.execute("SELECT id FROM path WHERE key = ?", (path,)).fetchone()
                rows = [
                    (*s.position, s.seconds, s.outcome, s.status, _json(s.answer), s.versions, now) for s in states
                ]
                connection.executemany(
                    "INSERT OR REPLACE INTO state (path, depth, shear, seconds, outcome, status, answer, versions,"
                    " added, digest) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                    [(number, *row, digest(path, row[:3], [text.encode() for text in row[3:]])) for row in rows],
                )

    def counts(self) -> tuple[int, int]:
        """Return the number of paths and the number of states."""
        with store_file.refusals(self.file):
            (paths,) = self._connection.execute("SELECT COUNT(*) FROM path").fetchone()
            (states,) = self._connection.execute("SELECT COUNT(*) FROM state").fetchone()
        return paths, states


def _json(value: Mapping[str, Any]) -> str:
    """Return canonical JSON; numbers that JSON cannot hold are null."""
    return json.dumps(atomic_files.clean(value), sort_keys=True, separators=(",", ":"), allow_nan=False)


def default() -> Path:
    """Return the user's store: the file that MAGTIP_STORE names, or one in the user's folder for application data."""
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named)
    import platformdirs

    return platformdirs.user_data_path("magtip", appauthor=False) / "states.sqlite"


@contextlib.contextmanager
def opened(file: Path) -> Iterator[Store]:
    """Open a store; a file that does not exist is made.

    Raises
    ------
    BadInput
        The file is no store, is damaged, has a newer version, or cannot be read, made or written.
    """
    with store_file.writable(file) as connection:
        yield Store(file, connection)
