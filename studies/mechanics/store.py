"""Solved states of all studies in one SQLite file, so that no case is solved twice.

A *path* stands for all states that differ only in the position of plate or grip. Its content is everything else on
which the finite elements depend, in dimensionless form (lengths over D, stresses over E), and the versions of the
model's physics and of the error estimates. Its key is a digest of this content as canonical JSON, with numbers
written by `float.hex`. A *state* belongs to a path, has a position (depth, shear), both over D and rounded to
`DIGITS`, and holds its answer as JSON.
The digest of a state belongs to its path and to all that its row holds: what was changed in the file is noticed where
it is read.

An outcome is "ok" (solved), "failed" (the solve stops for a numerical or physical reason and would stop again) or
"transient" (the process died or ran out of memory, and another attempt may succeed).

The file is in write-ahead mode: any number of processes can read while one writes. Each transaction is on the disk
when `add` returns (synchronous = FULL), so a killed process loses nothing that it has added. Transactions of several
writers wait for each other, up to `PATIENCE`. SQLite's locks fail on many network file systems, so keep the store on
a local disk. Nothing in the file is executed or unpickled.

Where the user's own store cannot be written (a read-only home, a full disk), what it holds is read, and what is added
is forgotten with the process, with a warning. A file that was named must take what is solved.
"""

from __future__ import annotations

import contextlib
import datetime
import hashlib
import json
import math
import os
import queue
import sqlite3
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from geometry.design import BadInput
from studies.output import atomic_files, console

DIGITS = 12
"""Decimal places of lengths over D: positions that agree to these are equal. Rounding errors are about 1e-16."""
VARIABLE = "MAGTIP_STORE"
"""Environment variable with the path of a store that replaces the user's own."""
OLDEST, FORMAT = 3, 4
"""Versions of the tables that can be read, and that of a new file. Formats 1 and 2 had no digests and kept errors of
magtip as failures; 3 had a table more."""
PATIENCE = 30.0
"""Time that a transaction waits for that of another process, s."""
LARGEST_CHECKED = 50_000_000
"""Size of the largest file whose pages are all checked when it is opened, bytes; this takes up to 0.5 s. Damage of a
larger file is noticed where it is read, or by `magtip store check`."""
TABLES = (
    "CREATE TABLE about (name TEXT PRIMARY KEY, value TEXT NOT NULL)",
    f"INSERT INTO about VALUES ('format', '{FORMAT}')",
    """CREATE TABLE path (
    id INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE, content TEXT NOT NULL, added TEXT NOT NULL)""",
    """CREATE TABLE state (
    path INTEGER NOT NULL REFERENCES path (id) ON DELETE CASCADE, depth REAL NOT NULL, shear REAL NOT NULL,
    outcome TEXT NOT NULL CHECK (outcome IN ('ok', 'failed', 'transient')), status TEXT NOT NULL,
    answer TEXT NOT NULL, seconds REAL NOT NULL, versions TEXT NOT NULL, added TEXT NOT NULL, digest TEXT NOT NULL,
    PRIMARY KEY (path, depth, shear)) WITHOUT ROWID""",
    "CREATE INDEX state_listing ON state (added, outcome, status, seconds)",
)
"""Statements that make the tables of an empty file."""
OTHER = "name another file by `store`"
"""The remedy that always helps."""
READ_ONLY = "is read-only: make the file and its folder writable, or " + OTHER
UNWRITABLE = (sqlite3.SQLITE_READONLY, sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_FULL, sqlite3.SQLITE_PERM)
"""Codes of SQLite for a file that is in order, but cannot be made or written."""
Outcome = Literal["ok", "failed", "transient"]
Content = Mapping[str, Any]
Position = tuple[float, float]


@dataclass(frozen=True, slots=True)
class State:
    """A stored state at one position of a path.

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


COLUMNS = ("path", "depth", "shear", "seconds", "outcome", "status", "answer", "versions", "added", "digest")
ADD = (
    f"INSERT INTO state ({', '.join(COLUMNS)}) VALUES ({', '.join('?' * len(COLUMNS))})"
    " ON CONFLICT (path, depth, shear) DO UPDATE SET "
    + ", ".join(f"{name} = excluded.{name}" for name in COLUMNS[3:])
    + " WHERE excluded.outcome != 'transient' OR state.outcome = 'transient'"
)
"""SQL that adds a state."""


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


def as_stored(state: State) -> State:
    """Return a state with the answer that the store gives back: plain values, NaN and infinity as None."""
    return replace(state, answer=json.loads(_json(state.answer)))


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
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, int | float):
        return float(value).hex()
    if isinstance(value, Mapping):
        return {str(name): _exact(part) for name, part in value.items()}
    if isinstance(value, Sequence):
        return [_exact(part) for part in value]
    raise TypeError(f"a path's content holds plain values only; got {type(value).__name__}")


class Unwritable(BadInput):
    """A store is in order, but cannot be made or written."""


class Store:
    """An open store, see `opened`.

    file : of the store.
    connections : one to read and write, then others with more states, to read.
    optional : whether what cannot be written is forgotten with this process, with a warning.
    """

    def __init__(self, file: Path, *connections: sqlite3.Connection, optional: bool = False) -> None:
        self.file, self._connections, self._optional = file, connections, optional

    def states(self, content: Content, at: Iterable[Position] | None = None) -> dict[Position, State]:
        """Return states of a path by their positions, default: all; those that are damaged are left out, with a
        warning."""
        path = key(content)
        query = f"SELECT {READ} FROM state JOIN path ON path.id = state.path WHERE path.key = ?"
        queries: list[tuple[str, tuple[Any, ...]]] = [(query, (path,))]
        if at is not None:
            queries = [(f"{query} AND depth = ? AND shear = ?", (path, *position)) for position in at]
        with refusals(self.file):
            rows = [
                row
                for each in self._connections[::-1]
                for query in queries
                for row in each.execute(*query).fetchall()
            ]
        states = [stored(path, row) for row in rows]
        if None in states:
            console.warn(
                f"a state in the store {str(self.file)!r} is damaged, since its digest does not match what it holds: "
                "it is solved again where it is needed (magtip store check says what else is damaged)"
            )
        return {state.position: state for state in states if state is not None}

    def reached(self, content: Content) -> list[Position]:
        """Return the positions of a path at which a state was reached."""
        query = "SELECT depth, shear FROM state JOIN path ON path.id = path WHERE key = ? AND outcome = 'ok'"
        with refusals(self.file):
            return [
                position(*row)
                for each in self._connections
                for row in each.execute(query, (key(content),)).fetchall()
            ]

    def add(self, content: Content, states: Iterable[State]) -> None:
        """Add states of a path, see `add_many`; a file on a disk takes some ms for each call."""
        self.add_many([(content, states)])

    def add_many(self, paths: Iterable[tuple[Content, Iterable[State]]]) -> None:
        """Add states of several paths in one transaction; they are on the disk afterwards.

        A state replaces the stored one at the same position; a transient one replaces transient ones only, since
        another process may have solved the state meanwhile.
        """
        paths = [(content, [*states]) for content, states in paths]
        try:
            self._write(paths)
        except Unwritable as error:
            if not self._optional:
                raise
            _say_unkept(error)
            self._connections, self._optional = (_in_memory(), *self._connections), False
            self._write(paths)

    def _write(self, paths: Iterable[tuple[Content, Iterable[State]]]) -> None:
        now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
        with refusals(self.file), self._connections[0] as connection:
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
                    ADD,
                    [(number, *row, digest(path, row[:3], [text.encode() for text in row[3:]])) for row in rows],
                )

    def counts(self) -> tuple[int, int]:
        """Return the number of paths and the number of states."""
        query = "SELECT (SELECT COUNT(*) FROM path), (SELECT COUNT(*) FROM state)"
        with refusals(self.file):
            paths, states = self._connections[0].execute(query).fetchone()
        return paths, states


def _json(value: Mapping[str, Any]) -> str:
    return json.dumps(atomic_files.clean(value), sort_keys=True, separators=(",", ":"), allow_nan=False)


def default() -> Path:
    """Return the user's store: the file that MAGTIP_STORE names, or one in the user's folder for application data."""
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named)
    import platformdirs

    return platformdirs.user_data_path("magtip", appauthor=False) / "states.sqlite"


class WrittenLater(Store):
    """A store that a thread writes: who adds a state waits neither for the disk nor for another process."""

    def __init__(self, file: Path, connection: sqlite3.Connection, *, optional: bool) -> None:
        super().__init__(file, connection, optional=optional)
        self._added: dict[str, dict[Position, State]] = {}
        self._queue: queue.SimpleQueue[tuple[Content, list[State]] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._write_all, daemon=True)
        self._thread.start()

    def states(self, content: Content, at: Iterable[Position] | None = None) -> dict[Position, State]:
        """Return states of a path, those too that are not yet written."""
        places = None if at is None else set(at)
        added = self._added.get(key(content), {})
        added = {at: state for at, state in added.items() if places is None or at in places}
        return super().states(content, None if places is None else places - added.keys()) | added

    def add_many(self, paths: Iterable[tuple[Content, Iterable[State]]]) -> None:
        """Add states of several paths, which are soon on the disk."""
        for content, states in paths:
            added = [as_stored(state) for state in states]
            self._added.setdefault(key(content), {}).update({state.position: state for state in added})
            self._queue.put((content, added))

    def close(self) -> None:
        """Wait until all is written."""
        self._queue.put(None)
        self._thread.join()

    def _write_all(self) -> None:
        try:
            with writable(self.file) as connection:
                store = Store(self.file, connection, optional=self._optional)
                for content, states in iter(self._queue.get, None):
                    store.add(content, states)
        except BadInput as error:
            _say_unkept(error)


@contextlib.contextmanager
def opened(file: Path | str | None, *, later: bool = False, said: bool = False) -> Iterator[Store]:
    """Open a store, default: the user's; a file that does not exist is made.

    Where the user's cannot be written, a warning says so, and it is read only.

    later : a thread writes what is added (`WrittenLater`).
    said : the user knows already that it cannot be written.
    """
    path = Path(file or default())
    with contextlib.ExitStack() as stack:
        try:
            connection = stack.enter_context(writable(path))
        except Unwritable as error:
            if file is not None:
                raise
            if not said:
                _say_unkept(error)
            connections = [stack.enter_context(contextlib.closing(_in_memory()))]
            if os.path.exists(path):
                with contextlib.suppress(Unwritable):
                    connections.append(stack.enter_context(readable(path)))
            yield Store(path, *connections)
            return
        if later:
            yield stack.enter_context(contextlib.closing(WrittenLater(path, connection, optional=file is None)))
        else:
            yield Store(path, connection, optional=file is None)


def _say_unkept(error: BadInput) -> None:
    console.warn(f"{error}; what is solved here is not kept")


def _in_memory() -> sqlite3.Connection:
    """Return an empty store that ends with its process."""
    connection = sqlite3.connect(":memory:", isolation_level=None)
    _make(connection)
    return connection


# The file


@contextlib.contextmanager
def writable(file: Path) -> Iterator[sqlite3.Connection]:
    """Connect to a store, to read and to write; a file that does not exist is made."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        # SQLite opens a file that it cannot write to read, and says so at the first change only
        if file.exists() and not os.access(file, os.W_OK, effective_ids=os.access in os.supports_effective_ids):
            raise Unwritable(f"the store {str(file)!r} {READ_ONLY}")
        connection = sqlite3.connect(file, timeout=PATIENCE, isolation_level=None)
    except (OSError, sqlite3.Error) as error:
        raise Unwritable(f"the store {str(file)!r} cannot be opened ({error}): {OTHER}") from None
    with contextlib.closing(connection):
        with refusals(file):
            _prepare(file, connection)
        connection.text_factory = _legible
        yield connection


@contextlib.contextmanager
def readable(file: Path) -> Iterator[sqlite3.Connection]:
    """Connect to a store that exists, to read only, even where neither the file nor its folder can be written."""
    if not file.exists():
        raise BadInput(f"there is no store {str(file)!r}: magtip sweep makes one, or {OTHER}")
    with refusals(file), contextlib.closing(_connect_to_read(file)) as connection:
        _check_format(file, connection)
        connection.text_factory = _legible
        yield connection


def _legible(text: bytes) -> str:
    """Return a text as it can be shown; the digest says that one of another program or a damaged page is damaged."""
    return text.decode("utf-8", "replace")


def _connect_to_read(file: Path) -> sqlite3.Connection:
    address = file.absolute().as_uri() + "?mode=ro"
    connection = sqlite3.connect(address, uri=True, timeout=PATIENCE, isolation_level=None)
    try:
        connection.execute("SELECT COUNT(*) FROM sqlite_master")
    except sqlite3.OperationalError as error:
        connection.close()
        unmerged = file.with_name(f"{file.name}-wal")
        # SQLite makes a file beside each store that it reads; where it cannot, nobody can write the store either
        if error.sqlite_errorcode & 0xFF not in (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY) or (
            unmerged.exists() and unmerged.stat().st_size
        ):
            raise
        connection = sqlite3.connect(f"{address}&immutable=1", uri=True, isolation_level=None)
    return connection


@contextlib.contextmanager
def refusals(file: Path) -> Iterator[None]:
    """Turn an error of SQLite into a BadInput that says what is wrong with the file, and what to do."""
    try:
        yield
    except sqlite3.Error as error:
        kind = Unwritable if _code(error) in UNWRITABLE else BadInput
        raise kind(_refusal(file, error)) from None
    except UnicodeDecodeError:
        # a name in the file, of which a message of SQLite consists, is none
        raise BadInput(_refusal(file, sqlite3.DatabaseError("its schema is no text"))) from None


def _code(error: sqlite3.Error) -> int:
    # the codes of SQLite's C interface; extended codes hold the primary one in the lowest byte
    return int(getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT)) & 0xFF


def _refusal(file: Path, error: sqlite3.Error) -> str:
    code = _code(error)
    store = f"the store {str(file)!r}"
    if code in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
        return f"{store} is locked by another process for more than {PATIENCE:g} s: wait until it ends, or {OTHER}"
    if code == sqlite3.SQLITE_READONLY:
        return f"{store} {READ_ONLY}"
    if code == sqlite3.SQLITE_NOTADB:
        return f"{str(file)!r} is not a store of magtip: {OTHER}"
    if code == sqlite3.SQLITE_FULL:
        return f"the disk of {store} is full: make space there, or {OTHER}"
    # an error of SQL in statements of magtip: a part of the tables or of their JSON is not as it was written
    if code in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_ERROR) or not isinstance(error, sqlite3.OperationalError):
        return f"{store} is damaged ({error}): move it away, so that the next study makes a new one, or {OTHER}"
    return f"{store} cannot be used ({error}): make the file and its folder readable and writable, or {OTHER}"


def _prepare(file: Path, connection: sqlite3.Connection) -> None:
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = FULL")
    connection.execute("PRAGMA foreign_keys = ON")
    connection.execute("BEGIN IMMEDIATE")
    with connection:
        if not connection.execute("SELECT 1 FROM sqlite_master").fetchone():
            _make(connection)
        _check_format(file, connection)
    if file.stat().st_size <= LARGEST_CHECKED:
        ((verdict,),) = connection.execute("PRAGMA quick_check(1)").fetchall()
        if verdict != "ok":
            raise sqlite3.DatabaseError(verdict)


def _make(connection: sqlite3.Connection) -> None:
    for statement in TABLES:
        connection.execute(statement)


def _check_format(file: Path, connection: sqlite3.Connection) -> None:
    tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if not {"about", "path", "state"} <= tables:
        raise BadInput(f"{str(file)!r} is not a store of magtip: {OTHER}")
    versions = connection.execute("SELECT CAST(value AS BLOB) FROM about WHERE name = 'format'").fetchall()
    version = versions[0][0].decode("utf-8", "replace") if versions else ""
    if not version.isdecimal():
        raise sqlite3.DatabaseError(f"its format is {version!r}")
    if int(version) > FORMAT:
        raise BadInput(
            f"the store {str(file)!r} has format {version}, and this version of magtip knows format {FORMAT}: "
            f"update magtip, or {OTHER}"
        )
    if int(version) < OLDEST:
        raise BadInput(
            f"the store {str(file)!r} has format {version} of an earlier version of magtip, which kept errors of the "
            "program as failures and has no digests of answers: move it away, so that the next study solves anew, "
            f"or {OTHER}"
        )
