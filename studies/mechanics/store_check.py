"""Checks of a store: pages, links, contents, answers, positions, physics versions, journals."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from geometry.design import BadInput
from geometry.messages import Progress
from studies.mechanics import store, store_fields, store_file, store_listing
from studies.mechanics.store_file import EXTRACTED, LISTED
from studies.output import records
from studies.output.records import FlatRow

MOST_NAMED = 3
"""Number of errors that a message quotes."""
SOLVE_AGAIN = "magtip store prune --damaged --yes removes them, and the next study solves them again"
SOLVED_OTHERWISE = "remove them by magtip store prune; if the models have changed, raise fem.physics_version"
NEW_FILE = "export what can be read, move the file away, and let the next study make a new one"


Errors = tuple[int, Sequence[str], str]
"""Number of things that were checked, what is wrong with which, and what to do."""


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


def checks(file: Path, repeated: int = 0, seed: int = 0, progress: Progress | None = None) -> Iterator[Check]:
    """Yield the result of each check of a store, which is not changed.

    Parameters
    ----------
    repeated : number of states, chosen at random by `seed`, that are solved again and compared.

    Raises
    ------
    BadInput
        There is no such store, or it is damaged so much that nothing can be read.
    """
    with store_file.readable(file) as connection:
        store_fields.register(connection)
        for name, check in CHECKS.items():
            try:
                yield _check(name, *check(connection))
            except sqlite3.Error as error:
                yield Check(name, "failed", 0, f"the file cannot be read there ({error}): {NEW_FILE}")
        if repeated:
            from studies.mechanics import repeated_solves

            chosen = repeated_solves.chosen(connection, repeated, seed)
            errors = list(repeated_solves.differences(connection, chosen, progress))
            yield _check("states that are solved again", len(chosen), errors, SOLVED_OTHERWISE)
    journals = store.journals(file)
    damaged = list(_damaged_journals(journals))
    yield _check("journals beside the store", len(journals), damaged, "move them away")


def _check(name: str, count: int, errors: Sequence[str], remedy: str) -> Check:
    """Return the result of a check with these errors."""
    if not errors:
        return Check(name, "ok", count, "")
    more = f" and {len(errors) - MOST_NAMED} more" if len(errors) > MOST_NAMED else ""
    return Check(name, "failed", count, f"{'; '.join(errors[:MOST_NAMED])}{more}: {remedy}")


def _pages(connection: sqlite3.Connection) -> Errors:
    """Check the structure of all pages and indices."""
    errors = [text for (text,) in connection.execute("PRAGMA integrity_check") if text != "ok"]
    return _number(connection, "PRAGMA page_count"), errors, NEW_FILE


def _links(connection: sqlite3.Connection) -> Errors:
    """Check that each state has its path, and each path its row in `listed` with its values."""
    errors = [f"a {table} has no {parent}" for table, _, parent, _ in connection.execute("PRAGMA foreign_key_check")]
    unlisted = "SELECT id FROM path WHERE id NOT IN (SELECT id FROM listed)"
    errors += [f"path {number} is not listed" for (number,) in connection.execute(unlisted)]
    otherwise = (
        f"SELECT id FROM path JOIN listed USING (id) WHERE json_valid(content)"
        f" AND ({', '.join(LISTED)}) IS NOT ({EXTRACTED})"
    )
    errors += [f"path {number} is listed with other values" for (number,) in connection.execute(otherwise)]
    return _number(connection, "SELECT COUNT(*) FROM state"), errors, NEW_FILE


def _contents(connection: sqlite3.Connection) -> Errors:
    """Check that the key of each path is that of its content."""
    damaged = connection.execute(f"SELECT id FROM path WHERE {store_fields.DAMAGED_PATH}")
    errors = [f"path {number} is damaged" for (number,) in damaged]
    return _number(connection, "SELECT COUNT(*) FROM path"), errors, SOLVE_AGAIN


def _answers(connection: sqlite3.Connection) -> Errors:
    """Check that the digest of each state is that of what it holds."""
    damaged = connection.execute(
        "SELECT path FROM state JOIN path ON path.id = state.path"
        f" WHERE damaged_state(CAST(path.key AS BLOB), {store.READ})"
    )
    errors = [f"a state of path {number} is damaged" for (number,) in damaged]
    return _number(connection, "SELECT COUNT(*) FROM state"), errors, SOLVE_AGAIN


def _physics(connection: sqlite3.Connection) -> Errors:
    """Check that the program knows the physics version of each path; older ones are in order."""
    known = f"COALESCE(physics >= 1 AND NOT {store_fields.current_physics('>')}, 0)"
    groups = connection.execute(
        f"SELECT quantity, model, physics, COUNT(*), {known} FROM listed GROUP BY quantity, model, physics"
    ).fetchall()
    errors = [
        f"{count} of {store_listing.named(quantity, model)} with physics version {physics}"
        for quantity, model, physics, count, is_known in groups
        if not is_known
    ]
    return (
        len(groups),
        errors,
        "this version of magtip knows no such version and uses none of these paths; update magtip",
    )


def _number(connection: sqlite3.Connection, query: str) -> int:
    """Return the result of a query for one number."""
    (number,) = connection.execute(query).fetchone()
    return int(number)


CHECKS: dict[str, Callable[[sqlite3.Connection], Errors]] = {
    "pages of the file": _pages,
    "links of states to paths": _links,
    "contents of paths belong to their keys": _contents,
    "answers and positions of states": _answers,
    "physics versions": _physics,
}
"""Checks of the file by their names."""


def _damaged_journals(journals: Iterable[Path]) -> Iterator[str]:
    """Yield an error for each journal that cannot be taken in."""
    for journal in journals:
        try:
            store.read_journal(journal)
        except (BadInput, OSError) as error:
            yield str(error)
