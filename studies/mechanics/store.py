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
import dataclasses
import datetime
import glob
import hashlib
import json
import math
import os
import sqlite3
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from geometry.design import BadInput
from studies.mechanics import store_file
from studies.output import atomic_files

DIGITS = 12
"""Decimal places of lengths over D: positions that agree to these are equal. Rounding errors are about 1e-16."""
IMPATIENCE = 1.0
"""Time that transactions wait for another process once one has waited `PATIENCE`, s."""
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
    """An open store, see `opened` and `in_memory`.

    Attributes
    ----------
    file : of the store; None for a store in memory.
    from_journal : number of states that were in journals when the store was opened.
    """

    def __init__(self, file: Path | None, connection: sqlite3.Connection) -> None:
        self.file, self._connection = file, connection
        self.from_journal = 0

    @property
    def journals(self) -> list[Path]:
        """Files of states that the store could not take; `opened` adds them and deletes the files."""
        return [] if self.file is None else journals(self.file)

    def states(self, content: Content) -> dict[Position, State]:
        """Return all states of a path by their positions."""
        path = key(content)
        with self._refusals():
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

    def add(self, content: Content, states: Iterable[State]) -> str:
        """Add states of a path, see `add_many`; a file on a disk takes some ms for each call."""
        return self.add_many([(content, states)])

    def add_many(self, paths: Iterable[tuple[Content, Iterable[State]]]) -> str:
        """Add states of several paths in one transaction; they are on the disk afterwards.

        A state replaces the stored one at the same position.

        Returns
        -------
        An empty text, or a warning that the store could not take the states and which file beside it has them.

        Raises
        ------
        BadInput
            That file cannot be written either, so the states are lost.
        """
        batch = [(content, list(states)) for content, states in paths]
        try:
            self._insert(batch)
        except sqlite3.Error as error:
            if self.file is None:
                raise
            # a process that has blocked the store for so long may block it for hours
            self._connection.execute(f"PRAGMA busy_timeout = {1000 * IMPATIENCE:.0f}")
            return _write_journal(self.file, batch, str(error))
        return ""

    def counts(self) -> tuple[int, int]:
        """Return the number of paths and the number of states."""
        with self._refusals():
            (paths,) = self._connection.execute("SELECT COUNT(*) FROM path").fetchone()
            (states,) = self._connection.execute("SELECT COUNT(*) FROM state").fetchone()
        return paths, states

    def _refusals(self) -> contextlib.AbstractContextManager[None]:
        """Turn an error of SQLite into a refusal of the file."""
        return contextlib.nullcontext() if self.file is None else store_file.refusals(self.file)

    def _insert(self, paths: Iterable[tuple[Content, Iterable[State]]]) -> None:
        """Insert states, and their paths if they are new, in one transaction."""
        now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        with self._connection as connection:
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

    def _read_journals(self) -> None:
        """Move the states in journals into the store; another process may do the same at the same time."""
        for journal in self.journals:
            with contextlib.suppress(FileNotFoundError):
                paths = read_journal(journal)
                self._insert(paths)
                self.from_journal += sum(len(states) for _, states in paths)
                journal.unlink()


def journals(file: Path) -> list[Path]:
    """Return the files of states that a store could not take."""
    return sorted(file.parent.glob(f"{glob.escape(file.name)}.journal-*.json"))


def read_journal(journal: Path) -> list[tuple[Content, list[State]]]:
    """Return the paths and states in a journal; raise BadInput if it is damaged."""
    try:
        record = json.loads(journal.read_text("utf-8"))
        if record["digest"] != key(record["paths"]):
            raise ValueError("its digest does not match what it holds")
        paths: list[tuple[Content, list[State]]] = [
            (dict(path["content"]), [State(**state) for state in path["states"]]) for path in record["paths"]
        ]
        if not {state.outcome for _, states in paths for state in states} <= set(get_args(Outcome)):
            raise ValueError("an outcome is unknown")
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError) as error:
        raise BadInput(f"the journal {str(journal)!r} of the store is damaged ({error}): move it away") from None
    return paths


def _write_journal(file: Path, paths: Sequence[tuple[Content, Sequence[State]]], cause: str) -> str:
    """Write states to a file beside the store, and return a warning with the cause; raise BadInput if that fails."""
    # a file of its own for each batch, written whole: no process reads it half, or deletes it with more in it
    journal = file.with_name(f"{file.name}.journal-{uuid.uuid4().hex}.json")
    record = [{"content": content, "states": list(map(dataclasses.asdict, states))} for content, states in paths]
    try:
        whole = atomic_files.clean(record)
        atomic_files.write_json(journal, {"paths": whole, "digest": key(whole)}, listed=False)
    except OSError as error:
        count = sum(len(states) for _, states in paths)
        raise BadInput(
            f"neither the store {str(file)!r} ({cause}) nor a journal beside it ({error.strerror or error}) can be "
            f"written, so the last solved states ({count}) are lost: make space on the disk, or name another file by "
            "--store"
        ) from None
    return (
        f"the store {str(file)!r} cannot be written ({cause}): {journal.name} beside it has the solved states, and "
        "the next sweep adds them to the store"
    )


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
def in_memory() -> Iterator[Store]:
    """Make a store that ends with the context and writes no file.

    >>> with in_memory() as store:
    ...     store.counts()
    (0, 0)
    """
    with store_file.writable(None) as connection:
        yield Store(None, connection)


@contextlib.contextmanager
def opened(file: Path) -> Iterator[Store]:
    """Open a store; a file that does not exist is made, and states in journals beside it are moved into it.

    Raises
    ------
    BadInput
        The file is no store, is damaged, has a newer version, or cannot be read, made or written; or a journal is
        damaged.
    """
    with store_file.writable(file) as connection:
        store = Store(file, connection)
        with store_file.refusals(file):
            store._read_journals()
        yield store
