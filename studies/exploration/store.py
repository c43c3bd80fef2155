"""Solved states of all studies in one SQLite file, so that no case is solved twice.

A *path* is what a family of states shares: everything that the finite elements depend on but the position of plate or
grip, in dimensionless form (lengths over D, stresses over E), and the physics version of the model that solves it.
Its key is a digest of that content as canonical JSON, in which numbers are written by `float.hex`. A *state* belongs
to a path at a position (depth, shear), both over D, rounded to `DIGITS`, and holds what was answered there as JSON.

Files
-----
`path`   : key (text, unique), content (JSON with decimal numbers, to be read and filtered), added (UTC).
`state`  : path, depth, shear (primary key), outcome, status, answer (JSON), seconds, versions, added (UTC).
`about`  : name, value; `format` is the version of this layout.

An outcome is "ok" (an answer), "failed" (the solve ends there for reasons of its own: it will do so again), or
"transient" (the process died or ran out of memory: worth another try, when asked for).

The file is in write-ahead mode: any number of processes read while one writes, each transaction is on the disk when
`add` returns (synchronous = FULL), and a process that is killed loses nothing that was added before. Transactions of
several writers wait for each other up to `PATIENCE`. SQLite's locks do not work on many network file systems: keep
the store on a local disk. Nothing in the file is executed or unpickled.
"""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import hashlib
import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from geometry.design import BadInput

FORMAT = 1
"""Version of the tables below; a file of a newer one is refused."""
DIGITS = 12
"""Decimal digits of lengths over D that must agree for two positions to be one."""
PATIENCE = 30.0
"""How long a transaction waits for that of another process, s."""
VARIABLE = "MAGTIP_STORE"
"""Environment variable that names another store than the user's own."""
NAME = b"SQLite format 3\x00"
TABLES = """
CREATE TABLE about (name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE path (
    id INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE, content TEXT NOT NULL, added TEXT NOT NULL);
CREATE TABLE state (
    path INTEGER NOT NULL REFERENCES path (id) ON DELETE CASCADE, depth REAL NOT NULL, shear REAL NOT NULL,
    outcome TEXT NOT NULL CHECK (outcome IN ('ok', 'failed', 'transient')), status TEXT NOT NULL,
    answer TEXT NOT NULL, seconds REAL NOT NULL, versions TEXT NOT NULL, added TEXT NOT NULL,
    PRIMARY KEY (path, depth, shear)) WITHOUT ROWID;
"""

Outcome = Literal["ok", "failed", "transient"]
Content = Mapping[str, Any]
Position = tuple[float, float]


@dataclass(frozen=True, slots=True)
class State:
    """What is known of one position of a path.

    Attributes
    ----------
    depth, shear : of plate or grip over D.
    answer : plain values, as JSON holds them.
    seconds : what it cost since the state before.
    versions : of Python, the packages and the source that gave it.
    """

    depth: float
    shear: float
    outcome: Outcome
    status: str
    answer: dict[str, Any]
    seconds: float
    versions: str

    @property
    def position(self) -> Position:
        return position(self.depth, self.shear)


def position(depth: float, shear: float) -> Position:
    """A position as the store knows it.

    >>> position(0.1 + 0.2, 0.0)
    (0.3, 0.0)
    """
    return round(depth, DIGITS) + 0.0, round(shear, DIGITS) + 0.0


def key(content: Content) -> str:
    """The digest of a path's content: 32 hexadecimal digits, the same on every machine.

    >>> key({"nu": 0.5, "law": "yeoh"}) == key({"law": "yeoh", "nu": 0.5})
    True
    >>> key({"nu": 0.5}) == key({"nu": 0.5000000000000001})
    False
    """
    return hashlib.sha256(json.dumps(_exact(content), sort_keys=True).encode()).hexdigest()[:32]


def _exact(value: Any) -> Any:
    """Numbers as texts that hold every bit; an integer is no other case than the same number as a float."""
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
    """An open store; see `opened`. `taken_in` is the number of states that came from its journal."""

    def __init__(self, file: Path, connection: sqlite3.Connection) -> None:
        self.file, self._connection = file, connection
        self.taken_in = 0

    @property
    def journal(self) -> Path:
        """Where states go that the store cannot take now: JSON lines, taken in when the store is opened again."""
        return self.file.with_name(f"{self.file.name}.journal.jsonl")

    def states(self, content: Content) -> dict[Position, State]:
        """All states of a path, by their positions."""
        rows = self._connection.execute(
            "SELECT depth, shear, outcome, status, answer, seconds, versions FROM state"
            " JOIN path ON path.id = state.path WHERE path.key = ?",
            (key(content),),
        )
        states = (
            State(d, s, outcome, status, json.loads(answer), seconds, made)
            for d, s, outcome, status, answer, seconds, made in rows
        )
        return {state.position: state for state in states}

    def add(self, content: Content, states: Iterable[State]) -> str:
        """Keep states of a path, in place of those at the same positions; on the disk when this returns.

        Returns
        -------
        Empty, or why the store could not take them: then they are in the journal.

        Raises
        ------
        OSError
            The journal cannot be written either.
        """
        batch = list(states)
        try:
            self._insert(content, batch)
        except sqlite3.Error as error:
            lines = [json.dumps({"content": content, "state": dataclasses.asdict(state)}) for state in batch]
            with self.journal.open("a", encoding="utf-8", newline="\n") as file:
                file.write("".join(f"{line}\n" for line in lines))
            return f"the store {str(self.file)!r} cannot be written ({error}): its journal {self.journal.name} holds"
        return ""

    def counts(self) -> tuple[int, int]:
        """Numbers of paths and of states."""
        (paths,) = self._connection.execute("SELECT COUNT(*) FROM path").fetchone()
        (states,) = self._connection.execute("SELECT COUNT(*) FROM state").fetchone()
        return paths, states

    def _insert(self, content: Content, states: Iterable[State]) -> None:
        now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        with self._connection as connection:
            # the lock is asked for at once: one that is only found needed later cannot be waited for
            connection.execute("BEGIN IMMEDIATE")
            connection.execute(
                "INSERT OR IGNORE INTO path (key, content, added) VALUES (?, ?, ?)",
                (key(content), json.dumps(content, sort_keys=True), now),
            )
            (number,) = connection.execute("SELECT id FROM path WHERE key = ?", (key(content),)).fetchone()
            connection.executemany(
                "INSERT OR REPLACE INTO state VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
                [
                    (number, *s.position, s.outcome, s.status, json.dumps(s.answer), s.seconds, s.versions, now)
                    for s in states
                ],
            )

    def _take_in(self) -> None:
        """Move what an earlier process had to leave in the journal into the store."""
        if not self.journal.exists():
            return
        for line in self.journal.read_text("utf-8").splitlines():
            with contextlib.suppress(ValueError, TypeError, KeyError):  # a line that was cut short
                record = json.loads(line)
                self._insert(record["content"], [State(**record["state"])])
                self.taken_in += 1
        self.journal.unlink()


def default() -> Path:
    """The user's store: what MAGTIP_STORE names, or a file in the folder that the system has for data of programs."""
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named)
    import platformdirs

    return platformdirs.user_data_path("magtip", appauthor=False) / "solved.sqlite"


@contextlib.contextmanager
def opened(file: Path) -> Iterator[Store]:
    """Open a store, made if there is none.

    Raises
    ------
    BadInput
        The file is no store, damaged, of a newer version, or cannot be read or made.
    """
    try:
        if file.exists() and file.stat().st_size and file.open("rb").read(len(NAME)) != NAME:
            raise BadInput(f"{str(file)!r} is not a store of magtip: name another file by --store")
        file.parent.mkdir(parents=True, exist_ok=True)
        connection = sqlite3.connect(file, timeout=PATIENCE, isolation_level=None)
    except (OSError, sqlite3.Error) as error:
        raise BadInput(f"the store {str(file)!r} cannot be opened ({error}): name another file by --store") from None
    with contextlib.closing(connection):
        try:
            _prepare(file, connection)
            store = Store(file, connection)
            store._take_in()
        except sqlite3.OperationalError as error:
            raise BadInput(
                f"the store {str(file)!r} cannot be used ({error}): make it writable, wait until other processes "
                "have ended, or name another file by --store"
            ) from None
        except sqlite3.DatabaseError as error:
            raise BadInput(
                f"the store {str(file)!r} is damaged ({error}): move it away, or name another file by --store"
            ) from None
        yield store


def _prepare(file: Path, connection: sqlite3.Connection) -> None:
    """Check a store's version and soundness, or make its tables."""
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = FULL")
    connection.execute("PRAGMA foreign_keys = ON")
    connection.execute("BEGIN IMMEDIATE")
    with connection:
        tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not tables:
            for statement in filter(str.strip, TABLES.split(";\n")):
                connection.execute(statement)
            connection.execute("INSERT INTO about VALUES ('format', ?)", (str(FORMAT),))
            return
        if "about" not in tables:
            raise BadInput(f"{str(file)!r} is not a store of magtip: name another file by --store")
        ((version,),) = connection.execute("SELECT value FROM about WHERE name = 'format'").fetchall()
    if int(version) > FORMAT:
        raise BadInput(
            f"the store {str(file)!r} has format {version}, and this version of magtip knows formats to {FORMAT}: "
            "update magtip, or name another file by --store"
        )
    ((sound,),) = connection.execute("PRAGMA quick_check(1)").fetchall()
    if sound != "ok":
        raise sqlite3.DatabaseError(sound)
