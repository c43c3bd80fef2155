"""Removal of states from a store."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass

from geometry.design import BadInput
from studies.inputs.option_groups import Selection
from studies.mechanics import store, store_fields, store_file, store_listing
from studies.output import records
from studies.output.records import FlatRow


@dataclass(frozen=True, slots=True)
class Pruning:
    """What is removed from a store, or would be.

    Attributes
    ----------
    removed : whether the states are removed.
    states, paths : numbers of states, and of paths of which no state stays.
    states_left : number of states that stay.
    solving_s : time that the solves of the states took, s.
    size_MB : size of the file before.
    freed_MB : space that becomes free, MB; an estimate while nothing is removed.
    """

    file: str
    removed: bool
    states: int
    paths: int
    states_left: int
    solving_s: float
    size_MB: float
    freed_MB: float

    def row(self) -> FlatRow:
        """Return the numbers as a flat row."""
        return records.flat(self)


def prune(selection: Selection, *, yes: bool) -> Pruning:
    """Remove the states that meet the filters, and paths without states; without `yes` only count them.

    Raises
    ------
    BadInput
        There are no filters, there is no such store, or it cannot be written.
    """
    condition = store_fields.condition(selection)
    if not condition.limits:
        raise BadInput(
            "prune needs a filter, such as --failed, --older-physics, --before 2026-11-05 or --where nu=0.45; "
            "to remove everything, delete the file"
        )
    file = selection.store or store.default()
    with store_file.readable(file) as connection:
        store_fields.register(connection)
        states = store_listing.chosen(connection, condition)
        before = store_listing.summary(file, connection, states)
        (paths,) = connection.execute(
            "SELECT COUNT(*) FROM (SELECT path, COUNT(*) AS n FROM chosen GROUP BY path) AS gone"
            " WHERE n = (SELECT COUNT(*) FROM state WHERE state.path = gone.path)"
        ).fetchone()
    share = before.states / before.states_in_store if before.states_in_store else 0.0
    if yes and before.states:
        with store_file.writable(file) as connection, store_file.refusals(file):
            store_fields.register(connection)
            _remove(connection, condition)
    return Pruning(
        file=str(file),
        removed=yes,
        states=before.states,
        paths=paths,
        states_left=before.states_in_store - before.states,
        solving_s=before.solving_s,
        size_MB=before.size_MB,
        freed_MB=before.size_MB - store_listing.size_MB(file) if yes else before.size_MB * share,
    )


def _remove(connection: sqlite3.Connection, condition: store_fields.Condition) -> None:
    """Remove states and the paths that have none left, and give their space back."""
    connection.execute("BEGIN IMMEDIATE")
    with connection:
        connection.execute(f"DELETE FROM state WHERE {condition.sql}", condition.values)
        connection.execute("DELETE FROM path WHERE id NOT IN (SELECT path FROM state)")
    connection.execute("VACUUM")
    # a process that reads keeps the old pages: the file shrinks later, without a wait here
    connection.execute("PRAGMA busy_timeout = 0")
    connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
