"""Checks of a store: pages, links, contents, answers, positions, physics versions; states solved again."""

from __future__ import annotations

import json
import math
import random
import sqlite3
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from fem.accuracy import Accuracy
from fem.scene import Scene
from geometry.design import BadInput, Design
from geometry.loads import Load
from geometry.messages import Progress
from studies.mechanics import path_solver, store, store_actions
from studies.mechanics.store import Content, State
from studies.mechanics.timed_quantities import PlateMotion
from studies.output.records import FlatRow
from studies.quantities import shown

MOST_NAMED = 3
"""Number of errors that a message quotes."""
SOLVE_AGAIN = "magtip store prune --damaged --yes removes them, and the next study solves them again"
SOLVED_OTHERWISE = "remove them by magtip store prune; if the models have changed, raise fem.physics_version"
NEW_FILE = "export what can be read, move the file away, and let the next study make a new one"
Found = tuple[int, Sequence[str]]
"""How many things were checked, and a sentence for each that is wrong."""
Place = tuple[int, float, float]
"""Path, depth and shear of a state."""
ROUNDING = 1e-6
"""Relative difference that machines and versions of packages make; estimates of the error may be smaller."""
WITHOUT_ESTIMATE = 0.01
"""Relative difference that is allowed where a state has no estimate of its error: that between tetrahedral meshes of
different processors."""


def checks(file: Path, repeated: int = 0, seed: int = 0, progress: Progress | None = None) -> Iterator[FlatRow]:
    """Yield a row for each check of a store, which is not changed.

    `repeated`: number of states, chosen at random by `seed`, that are solved again and compared.

    "check": what is checked. "status": ok or failed. "checked": number of things that were checked. "message": what
    is wrong and what to do, empty if nothing is.
    """
    with store_actions.reading(file) as connection:
        for name, (found, remedy) in CHECKS.items():
            try:
                count, errors = found(connection)
                yield _check(name, count, errors, remedy)
            except sqlite3.Error as error:
                yield _check(name, 0, [f"the file cannot be read there ({error})"], NEW_FILE)
        if repeated:
            states = chosen(connection, repeated, seed)
            errors = list(differences(connection, states, progress))
            yield _check("states that are solved again", len(states), errors, SOLVED_OTHERWISE)


def _check(name: str, count: int, errors: Sequence[str], remedy: str) -> FlatRow:
    more = f" and {len(errors) - MOST_NAMED} more" if len(errors) > MOST_NAMED else ""
    message = f"{'; '.join(errors[:MOST_NAMED])}{more}: {remedy}" if errors else ""
    return {"check": name, "status": "failed" if errors else "ok", "checked": count, "message": message}


def _pages(connection: sqlite3.Connection) -> Found:
    (count,) = connection.execute("PRAGMA page_count").fetchone()
    return count, [text for (text,) in connection.execute("PRAGMA integrity_check") if text != "ok"]


def _links(connection: sqlite3.Connection) -> Found:
    (count,) = connection.execute("SELECT COUNT(*) FROM state").fetchone()
    return count, [f"a {of} has no {to}" for of, _, to, _ in connection.execute("PRAGMA foreign_key_check")]


def _contents(connection: sqlite3.Connection) -> Found:
    paths = connection.execute("SELECT id, CAST(key AS BLOB), CAST(content AS BLOB) FROM path").fetchall()
    return len(paths), [f"path {number} is damaged" for number, *row in paths if store_actions.damaged_path(*row)]


def _answers(connection: sqlite3.Connection) -> Found:
    count, errors = 0, list[str]()
    query = f"SELECT path, CAST(key AS BLOB), {store.READ} FROM state JOIN path ON path.id = state.path ORDER BY path"
    for number, key, *row in connection.execute(query):
        count += 1
        if store.stored(key.decode("utf-8", "replace"), row) is None:
            errors.append(f"a state of path {number} is damaged")
    return count, errors


def _physics(connection: sqlite3.Connection) -> Found:
    paths = store_actions.paths(connection)
    paths = paths[paths.model != store_actions.DAMAGED]
    # older physics versions are in order
    unknown = ~(paths.physics.where(store_actions.ages(paths) <= 0, 0) >= 1)
    kinds = unknown.groupby([store_actions.solved(paths), paths.physics.fillna("unknown")]).sum()
    return len(kinds), [
        f"{count} of {solved} with physics version {physics}" for (solved, physics), count in kinds.items() if count
    ]


CHECKS: dict[str, tuple[Callable[[sqlite3.Connection], Found], str]] = {
    "pages of the file": (_pages, NEW_FILE),
    "links of states to paths": (_links, NEW_FILE),
    "contents of paths belong to their keys": (_contents, SOLVE_AGAIN),
    "answers and positions of states": (_answers, SOLVE_AGAIN),
    "physics versions": (
        _physics,
        "this version of magtip knows no such version and uses none of these paths; update magtip",
    ),
}


# States solved again


def chosen(connection: sqlite3.Connection, count: int, seed: int) -> list[Place]:
    """Return states, chosen at random among the solved ones of the physics versions of today.

    Those of stores of magtip 0.2 do not say what was solved, and a deformed skin has no numbers to compare.
    """
    states = store_actions.states(connection)
    today = (store_actions.ages(states) == 0) & (states.quantity != "skin")
    states = states[today & (states.outcome == "ok")]
    states = store_actions.with_answers(connection, states, [])
    known = [(int(path), *position) for path, *position in states.index[~states.damaged]]
    return random.Random(seed).sample(known, min(count, len(known)))


def differences(connection: sqlite3.Connection, rows: Sequence[Place], progress: Progress | None) -> Iterator[str]:
    """Solve states again, and yield a sentence for each that differs by more than the estimates of its error."""
    for done, (number, depth, shear) in enumerate(rows):
        if progress is not None:
            progress(done / len(rows), f"state {done + 1} of {len(rows)}")
        key, content, *row = connection.execute(
            f"SELECT key, content, {store.READ} FROM state JOIN path ON id = path"
            " WHERE path = ? AND depth = ? AND shear = ?",
            (number, depth, shear),
        ).fetchone()
        stored = store.stored(key, row)
        assert stored is not None
        if reason := _difference(key, json.loads(content), stored):
            yield f"the state of path {number} at depth {depth:g} D and shear {shear:g} D {reason}"


def _difference(key: str, content: Content, stored: State) -> str:
    try:
        place = problem(content, stored)
    except (BadInput, KeyError, TypeError) as error:
        return f"cannot be solved by this version ({error})"
    if store.key(place.content) != key:
        return "has a content that this version does not know"
    (again,) = path_solver.solve_task(path_solver.task(1, place, [stored.position]))
    if again.outcome != "ok":
        return f"is now {again.status} ({again.answer['message']})"
    difference = _largest(_numbers(stored.answer), _numbers(again.answer))
    estimates = [state.answer["error_estimate"] or WITHOUT_ESTIMATE for state in (stored, again)]
    allowed = max(ROUNDING, *estimates)
    if difference <= allowed:
        return ""
    return f"differs by {shown(difference, 'percent', 2)} (estimated error {shown(allowed, 'percent', 2)})"


def problem(content: Content, state: State) -> path_solver.Place:
    """Return what was solved for a state of a path."""
    fields = state.answer["solved"]
    name = store_actions.accuracy_name(json.dumps(content["accuracy"])) or ""
    scene = Scene(
        Design(**fields["design"]),
        (Load(**fields["load"]),),
        Accuracy(name=name, **content["accuracy"]),
        content["magnet"],
        content["model"],
    )
    motion, options = PlateMotion(**fields["motion"]), fields.get("options")
    return path_solver.place(scene, content["quantity"], motion, options)


def _numbers(answer: Mapping[str, Any]) -> list[list[float]]:
    """Return the results of an answer as vectors, each of one unit; without small ones that have no meaning alone."""
    response = answer["response"]
    if response is not None:
        return [response["force"], response["shift"]]
    # a stored answer has its values in alphabetical order
    values = [value if isinstance(value, list) else [value] for _, value in sorted(answer["values"].items())]
    return [value for value in values if all(isinstance(part, int | float) for part in value)]


def _largest(first: list[list[float]], second: list[list[float]]) -> float:
    if [len(vector) for vector in first] != [len(vector) for vector in second]:
        return math.inf
    pairs = zip(first, second, strict=True)
    return max((math.dist(a, b) / size for a, b in pairs if (size := math.hypot(*a))), default=0.0)
