"""Solves of stored states again: do they come out as they are stored?"""

from __future__ import annotations

import json
import math
import random
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from fem.accuracy import Accuracy
from fem.scene import Scene
from geometry.design import LAWS, BadInput, Design, paper
from geometry.loads import Load
from geometry.messages import Progress
from studies.mechanics import cycle_paths, path_keys, path_solver, response_paths, store
from studies.mechanics.plate_motion import STILL, PlateMotion
from studies.mechanics.store import Content, Position, State
from studies.mechanics.store_fields import DAMAGED, accuracy_name, current_physics

Row = tuple[int, float, float]
"""Path, depth and shear of a state."""
ROUNDING = 1e-6
"""Relative difference that machines and versions of packages make; estimates of the error may be smaller."""
WITHOUT_ESTIMATE = 0.01
"""Relative difference that is allowed where a state has no estimate of its error: that between tetrahedral meshes of
different processors."""


def chosen(connection: sqlite3.Connection, count: int, seed: int) -> list[Row]:
    """Return states, chosen at random among the solved ones of the physics versions of today."""
    known = connection.execute(
        "SELECT state.path, depth, shear FROM state JOIN listed ON listed.id = state.path JOIN path USING (id)"
        f" WHERE outcome = 'ok' AND quantity NOT NULL AND {current_physics('=')} AND NOT {DAMAGED}"
        " ORDER BY state.path, depth, shear"
    ).fetchall()
    return random.Random(seed).sample(known, min(count, len(known)))


def differences(connection: sqlite3.Connection, rows: Sequence[Row], progress: Progress | None) -> Iterator[str]:
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
    """Solve a state again; return in which way it differs, empty if it does not."""
    try:
        place = path_keys.place(_scene(content, stored), content["quantity"], _motion(content, stored))
    except (BadInput, KeyError) as error:
        return f"cannot be solved by this version ({error})"
    if store.key(place.content) != key:
        return "has a content that this version does not know"
    (again,) = path_solver.solve_task(path_solver.task(1, place, [stored.position]))
    if again.outcome != "ok":
        return f"is now {again.status} ({again.answer['message']})"
    difference = _largest(_numbers(stored.answer), _numbers(again.answer))
    estimates = [state.answer["error_estimate"] or WITHOUT_ESTIMATE for state in (stored, again)]
    allowed = max(ROUNDING, *estimates)
    return (
        ""
        if difference <= allowed
        else f"differs by {100 * difference:.2g} % (estimated error {100 * allowed:.2g} %)"
    )


def _scene(content: Content, state: State) -> Scene:
    """Return the problem of a stored state, for the D and E of the design that was solved."""
    D, E = state.answer["D_mm"], state.answer["E_MPa"]
    name = accuracy_name(json.dumps(content["accuracy"])) or ""
    accuracy = Accuracy(name=name, **content["accuracy"])
    return Scene(
        _design(content, state.answer),
        (_load(content, state.position, D, E),),
        accuracy,
        content["magnet"],
        content["model"],
    )


def _design(content: Content, answer: Mapping[str, Any]) -> Design:
    """Return a design with this content; what the finite elements do not use is the paper's."""
    base, D, E = paper(), answer["D_mm"], answer["E_MPa"]
    law, *numbers = content["law"]
    lengths = {name: D * value for name, value in content["shape"].items()}
    # the elements below the beam keep their distance from the base, so that any length of beam is possible
    below = lengths["L"] - D / 2 - base.H
    design = replace(
        base,
        **lengths,
        E=E,
        nu=content["nu"],
        law=law,
        l0=base.l0 + below,
        **dict(zip(LAWS[law], numbers, strict=True)),
    )
    load = _of_load(content)
    ratio = load.get("density_ratio")
    design = replace(design, density=answer.get("density_kg_per_m3", design.density))
    design = design if not ratio else replace(design, magnet_density=ratio * design.density)
    fields = {"response": response_paths.fields_of, "cycle": cycle_paths.fields_of}.get(content["quantity"])
    return fields(load, design) if fields else design


def _motion(content: Content, state: State) -> PlateMotion:
    """Return the motion of the plate of a stored state."""
    return cycle_paths.motion_of(_of_load(content), state.answer["D_mm"]) if content["quantity"] == "cycle" else STILL


def _load(content: Content, at: Position, D: float, E: float) -> Load:
    """Return the load at a position of a path."""
    load = _of_load(content)
    if content["quantity"] in ("response", "cycle"):
        return Load(D * load["depth"], D * load["shear_x"], friction=load["friction"])
    if content["quantity"] != "states":
        return Load(depth=D * load.get("depth", 0.01))
    x, y = load["direction"] or (0.0, 0.0)
    grip = load["grip"]
    return Load(
        depth=D * at[0],
        shear_x=D * at[1] * x,
        shear_y=D * at[1] * y,
        friction=load["friction"],
        grip=None if grip is None else D * grip,
        plate_tilt=load["plate_tilt"],
        imperfection=load["imperfection"] * E * D**2,
    )


def _of_load(content: Content) -> Mapping[str, Any]:
    """Return what a path's content says of its loads; nothing for a critical depth."""
    values: Mapping[str, Any] = content.get("load", {})
    return values


def _numbers(answer: Mapping[str, Any]) -> list[list[float]]:
    """Return the results of an answer as vectors, each of one unit; without small ones that have no meaning alone."""
    response = answer["response"]
    if response is not None:
        return [response["force"], response["shift"]]
    # a stored answer has its values in alphabetical order
    values = [value for _, value in sorted(answer["values"].items())]
    return [value if isinstance(value, list) else [value] for value in values if _is_number(value)]


def _is_number(value: Any) -> bool:
    """Return whether a value is a number or a list of numbers."""
    return all(isinstance(part, int | float) for part in (value if isinstance(value, list) else [value]))


def _largest(first: list[list[float]], second: list[list[float]]) -> float:
    """Return the largest relative difference of vectors."""
    if [len(vector) for vector in first] != [len(vector) for vector in second]:
        return math.inf
    return max(
        (math.dist(a, b) / size for a, b in zip(first, second, strict=True) if (size := math.hypot(*a))), default=0.0
    )
