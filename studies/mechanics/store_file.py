"""The SQLite file of the store of solved states: its tables, their versions, and the refusal of unusable files.

Tables
------
`path`   : id, key (text, unique), content (JSON with decimal numbers, to be read and filtered), added (UTC).
`state`  : path, depth, shear (primary key), outcome, status, answer (JSON), seconds, versions, added (UTC), digest.
`about`  : name, value; `format` is the version of this layout.

`listed` : id of a path, and those fields of its content by which most filters choose.

`listed` and an index of `state` serve lists and filters, which then need not read contents and answers. The digest of
a state (`store.digest`) belongs to its path and to all that the row holds: what was changed in the file is noticed
where it is read. Formats 1 and 2 had no digests and kept errors of magtip as failures, so they are refused.
"""

from __future__ import annotations

import contextlib
import os
import sqlite3
from collections.abc import Iterator
from pathlib import Path

from geometry.design import BadInput

FORMAT = 3
"""Version of the tables; a file with any other version is refused."""
PATIENCE = 30.0
"""Time that a transaction waits for that of another process, s."""
LARGEST_CHECKED = 50_000_000
"""Size of the largest file whose pages are all checked when it is opened, bytes; this takes up to 0.5 s. Damage of a
larger file is noticed where it is read, or by `magtip store check`."""
LISTED = {
    "quantity": "$.quantity",
    "model": "$.model",
    "physics": "$.physics",
    "magnet": "$.magnet",
    "law": "$.law[0]",
    "nu": "$.nu",
    "L_over_D": "$.shape.L",
    "friction": "$.load.friction",
}
"""Columns of the table `listed`, and their places in the content of a path."""
EXTRACTED = ", ".join(f"json_extract(content, '{place}')" for place in LISTED.values())
"""SQL of the values of these columns, from the content of a path."""
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
    f"CREATE TABLE listed (id INTEGER PRIMARY KEY REFERENCES path (id) ON DELETE CASCADE, {', '.join(LISTED)})",
    f"""CREATE TRIGGER list_path AFTER INSERT ON path BEGIN
    INSERT INTO listed SELECT id, {EXTRACTED} FROM path WHERE id = new.id; END""",
    "CREATE INDEX state_listing ON state (added, outcome, status, seconds)",
)
"""Statements that make the tables of an empty file."""
OTHER = "name another file by --store"
"""The remedy that always helps."""
READ_ONLY = "is read-only: make the file and its folder writable, or " + OTHER


@contextlib.contextmanager
def writable(file: Path) -> Iterator[sqlite3.Connection]:
    """Connect to a store, to read and to write; a file that does not exist is made.

    Raises
    ------
    BadInput
        The file is no store, is damaged, has a newer version, or cannot be read, made or written.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        # SQLite opens a file that it cannot write to read, and says so at the first change only
        if file.exists() and not os.access(file, os.W_OK, effective_ids=os.access in os.supports_effective_ids):
            raise BadInput(f"the store {str(file)!r} {READ_ONLY}")
        connection = sqlite3.connect(file, timeout=PATIENCE, isolation_level=None)
    except (OSError, sqlite3.Error) as error:
        raise BadInput(f"the store {str(file)!r} cannot be opened ({error}): {OTHER}") from None
    with contextlib.closing(connection):
        with refusals(file):
            _prepare(file, connection)
        yield connection


@contextlib.contextmanager
def readable(file: Path) -> Iterator[sqlite3.Connection]:
    """Connect to a store that exists, to read only, even where neither the file nor its folder can be written.

    Raises
    ------
    BadInput
        There is no such file, it is no store, is damaged, has a newer version, or cannot be read.
    """
    if not file.exists():
        raise BadInput(f"there is no store {str(file)!r}: magtip sweep makes one, or {OTHER}")
    with refusals(file), contextlib.closing(_connect_to_read(file)) as connection:
        _check_format(file, connection)
        # a text of another program, or of a damaged page, is shown as it can be; its digest says that it is damaged
        connection.text_factory = lambda text: text.decode("utf-8", "replace")
        yield connection


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
        raise BadInput(_refusal(file, error)) from None


def _refusal(file: Path, error: sqlite3.Error) -> str:
    # the codes of SQLite's C interface; extended codes hold the primary one in the lowest byte
    code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF
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
    """Check a store's version and pages; make its tables if it is empty."""
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = FULL")
    connection.execute("PRAGMA foreign_keys = ON")
    connection.execute("BEGIN IMMEDIATE")
    with connection:
        if not connection.execute("SELECT 1 FROM sqlite_master").fetchone():
            _make_tables(connection)
        _check_format(file, connection)
    if file.stat().st_size <= LARGEST_CHECKED:
        _check_pages(connection)


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
    if int(version) < FORMAT:
        raise BadInput(
            f"the store {str(file)!r} has format {version} of an earlier version of magtip, which kept errors of the "
            "program as failures and has no digests of answers: move it away, so that the next study solves anew, "
            f"or {OTHER}"
        )


def _check_pages(connection: sqlite3.Connection) -> None:
    ((verdict,),) = connection.execute("PRAGMA quick_check(1)").fetchall()
    if verdict != "ok":
        raise sqlite3.DatabaseError(verdict)


def _make_tables(connection: sqlite3.Connection) -> None:
    for statement in TABLES:
        connection.execute(statement)
