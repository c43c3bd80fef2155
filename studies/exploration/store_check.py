"""Checks of a store: pages, links, contents, answers, positions, physics versions, journals."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from geometry.design import BadInput
from studies.exploration import store, store_fields, store_file, store_listing
from studies.output import records
from studies.output.records import FlatRow

MOST_NAMED = 3
"""Number of errors that a message quotes."""
SOLVE_AGAIN = "magtip store prune --damaged --yes removes them, and the next study solves them again"
NEW_FILE = "export what can be read, move the file away, and let the next study make a new one"


@dataclass(frozen=True, slots=True)
class Check:
    """Result of one check.

    Attributes
    ----------
    check : what is checked.
    status : ok or failed.
    checked : number of things that were checked.
    message : what is wrong and what to do; empty if nothing is.
    """

    check: str
    status: Literal["ok", "failed"]
    checked: int
    message: str

    def row(self) -> FlatRow:
        """Return the result as a flat row."""
        return records.flat(self)


def checks(file: Path) -> Iterator[Check]:
    """Yield the result of each check of a store, which is not changed.

    Raises
    ------
    BadInput
        There is no such store, or it is damaged so much that nothing can be read.
    """
    with store_file.readable(file) as connection:
        store_fields.register(connection)
        pages = [text for (text,) in connection.execute("PRAGMA integrity_check") if text != "ok"]
        (count,) = connection.execute("PRAGMA page_count").fetchone()
        yield _check("pages of the file", count, pages, NEW_FILE)
        yield _links(connection)
        yield _rows(
            connection,
            "contents of paths belong to their keys",
            "SELECT id FROM path WHERE damaged_path(key, content)",
            "path",
        )
        yield _rows(
            connection,
            "answers and positions of states",
            "SELECT path FROM state WHERE damaged_state(depth, shear, outcome, answer)",
            "state",
        )
        yield _physics(connection)
    journals = store.journals(file)
    damaged = list(_damaged_journals(journals))
    yield _check("journals beside the store", len(journals), damaged, "move them away")


def _check(name: str, count: int, errors: list[str], remedy: str) -> Check:
    """Return the result of a check with these errors."""
    if not errors:
        return Check(name, "ok", count, "")
    more = f" and {len(errors) - MOST_NAMED} more" if len(errors) > MOST_NAMED else ""
    return Check(name, "failed", count, f"{'; '.join(errors[:MOST_NAMED])}{more}: {remedy}")


def _links(connection: sqlite3.Connection) -> Check:
    """Check that each state has its path, and each path its row in `listed`."""
    errors = [f"a {table} has no {parent}" for table, _, parent, _ in connection.execute("PRAGMA foreign_key_check")]
    unlisted = "SELECT id FROM path WHERE id NOT IN (SELECT id FROM listed)"
    errors += [f"path {number} is not listed" for (number,) in connection.execute(unlisted)]
    (count,) = connection.execute("SELECT COUNT(*) FROM state").fetchone()
    return _check("links of states to paths", count, errors, NEW_FILE)


def _rows(connection: sqlite3.Connection, name: str, query: str, table: str) -> Check:
    """Check the rows of a table; the query yields a number for each damaged one."""
    errors = [
        f"{'path' if table == 'path' else 'a state of path'} {number} is damaged"
        for (number,) in connection.execute(query)
    ]
    (count,) = connection.execute(f"SELECT COUNT(*) FROM {table}").fetchone()
    return _check(name, count, errors, SOLVE_AGAIN)


def _physics(connection: sqlite3.Connection) -> Check:
    """Check that the program knows the physics version of each path; older ones are in order."""
    known = f"COALESCE(physics >= 1 AND NOT {store_fields.current_physics('>')}, 0)"
    groups = connection.execute(
        f"SELECT quantity, model, physics, COUNT(*), {known} FROM listed GROUP BY quantity, model, physics"
    ).fetchall()
    errors = [
        f"{count} of {store_listing.named(quantity, model)} with physics version {physics}"
        for quantity, model, physics, count, known in groups
        if not known
    ]
    remedy = "this version of magtip knows no such version and uses none of these paths; update magtip"
    return _check("physics versions", len(groups), errors, remedy)


def _damaged_journals(journals: Iterable[Path]) -> Iterator[str]:
    """Yield an error for each journal that cannot be taken in."""
    for journal in journals:
        try:
            store.read_journal(journal)
        except (BadInput, OSError) as error:
            yield str(error)
