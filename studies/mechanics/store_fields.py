"""Fields of stored states by which they are filtered, and which lists and exports have as columns.

Lengths are over D, forces over E D^2. A path's content and a state's answer are JSON, of which SQLite extracts the
fields; a field that a state does not have is NULL.
"""

from __future__ import annotations

import datetime
import functools
import json
import math
import sqlite3
from dataclasses import asdict, dataclass
from typing import Any, Literal

from geometry.bad_input import nearest
from geometry.design import BadInput
from studies.inputs.option_groups import Selection
from studies.mechanics import store
from studies.mechanics.store_file import LISTED

Kind = Literal["text", "number", "whole number", "text or number"]
Table = Literal["listed", "path", "state"]
PER_LENGTH = " / json_extract(state.answer, '$.D_mm')"
PER_FORCE = PER_LENGTH * 2 + " / json_extract(state.answer, '$.E_MPa')"
TOLERANCE = 1e-9
"""Difference up to which a number equals the value of a filter: stored numbers have 12 digits."""


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a stored state.

    Attributes
    ----------
    table : of the store
    sql : expression of SQLite.
    kind : of the values.
    """

    table: Table
    sql: str
    kind: Kind = "number"


def _listed(name: str, kind: Kind = "text") -> Field:
    assert name in LISTED
    return Field("listed", f"listed.{name}", kind)


def _content(place: str, kind: Kind = "number") -> Field:
    return Field("path", f"json_extract(path.content, '$.{place}')", kind)


def _column(name: str, kind: Kind = "number") -> Field:
    return Field("state", f"state.{name}", kind)


def _answer(place: str, unit: str = "", kind: Kind = "number") -> Field:
    return Field("state", f"json_extract(state.answer, '$.{place}'){unit}", kind)


FIELDS: dict[str, Field] = {
    "quantity": _listed("quantity"),
    "model": _listed("model"),
    "physics": _listed("physics", "whole number"),
    "accuracy": Field("path", "accuracy_name(json_extract(path.content, '$.accuracy'))", "text"),
    "magnet": _listed("magnet"),
    "law": _listed("law"),
    "law_number_1": _content("law[1]"),
    "law_number_2": _content("law[2]"),
    "law_number_3": _content("law[3]"),
    "nu": _listed("nu", "number"),
    "L_over_D": _listed("L_over_D", "number"),
    "magnet_diameter_over_D": _content("shape.magnet_diameter"),
    "magnet_height_over_D": _content("shape.magnet_height"),
    "magnet_edge_radius_over_D": _content("shape.magnet_edge_radius"),
    "friction": _listed("friction", "text or number"),
    "grip_over_D": _content("load.grip"),
    "plate_tilt_rad": _content("load.plate_tilt"),
    "imperfection_over_E_D2": _content("load.imperfection"),
    "sheared_at_depth_over_D": _content("load.sheared_at_depth"),
    "direction_x": _content("load.direction[0]"),
    "direction_y": _content("load.direction[1]"),
    "modes_at_depth_over_D": _content("load.depth"),
    "density_ratio": _content("load.density_ratio"),
    "at_shear_over_D": _content("load.shear_x"),
    "response_from_2pi_f_D_sqrt_rho_over_E": _content("load.lowest"),
    "response_to_2pi_f_D_sqrt_rho_over_E": _content("load.highest"),
    "branches": _content("load.branches", "text"),
    "modulus": _content("load.modulus", "text"),
    "waveform": _content("load.waveform", "text"),
    "cycles": _content("load.cycles", "whole number"),
    "depth_over_D": _column("depth"),
    "shear_over_D": _column("shear"),
    "outcome": _column("outcome", "text"),
    "status": _column("status", "text"),
    "force_x_over_E_D2": _answer("response.force[0]", PER_FORCE),
    "force_y_over_E_D2": _answer("response.force[1]", PER_FORCE),
    "force_z_over_E_D2": _answer("response.force[2]", PER_FORCE),
    "shift_x_over_D": _answer("response.shift[0]", PER_LENGTH),
    "shift_y_over_D": _answer("response.shift[1]", PER_LENGTH),
    "shift_z_over_D": _answer("response.shift[2]", PER_LENGTH),
    "tilt_rad": _answer("response.tilt"),
    "tilt_y_rad": _answer("response.tilt_y"),
    "contact_radius_over_D": _answer("response.contact_radius", PER_LENGTH),
    "critical_depth_over_D": _answer("values.critical_depth_over_D"),
    "critical_force_over_E_D2": _answer("values.critical_force_over_ED2"),
    "stable_to_over_D": _answer("values.stable_to_over_D"),
    # stored as f D (rho / E)^(1/2) in mm, MPa and kg/m^3
    **{f"frequency_{k + 1}_D_sqrt_rho_over_E": _answer(f"values.frequency[{k}]", " * 1e-6") for k in range(6)},
    "bandwidth_2pi_f_D_sqrt_rho_over_E": _answer("values.bandwidth"),
    "resonance_2pi_f_D_sqrt_rho_over_E": _answer("values.resonance"),
    "resonance_Q": _answer("values.Q"),
    "loop_gap_percent": _answer("values.gap_percent"),
    "loop_area_over_E_D3": _answer("values.area_over_ED3"),
    "loop_largest_force_over_E_D2": _answer("values.largest_over_ED2"),
    "error_estimate": _answer("error_estimate"),
    "seconds": _column("seconds"),
    "solved_D_mm": _answer("D_mm"),
    "solved_E_MPa": _answer("E_MPa"),
    "message": _answer("message", kind="text"),
    "versions": _column("versions", "text"),
    "added": _column("added", "text"),
}
"""All fields, in the order of the columns of an export."""


def register(connection: sqlite3.Connection) -> None:
    """Make the functions that the fields' SQL calls known to a connection."""
    connection.create_function("accuracy_name", 1, accuracy_name, deterministic=True)
    connection.create_function("damaged_path", 2, damaged_path, deterministic=True)
    connection.create_function("damaged_state", 10, damaged_state, deterministic=True)


@functools.cache
def accuracy_name(values: str | None) -> str | None:
    """Return the name of the accuracy level with these values (JSON), or other."""
    from fem.accuracy import LEVELS

    if values is None:
        return None
    wanted = json.loads(values)
    return next((name for name, level in LEVELS.items() if asdict(level) == wanted | {"name": name}), "other")


DAMAGED_PATH = "damaged_path(CAST(path.key AS BLOB), CAST(path.content AS BLOB))"
"""Condition on `path`."""
DAMAGED = f"(damaged_state(CAST(path.key AS BLOB), {store.READ}) OR {DAMAGED_PATH})"
"""Condition on `state` joined with its `path`."""


def damaged_path(key: bytes, content: bytes) -> bool:
    """Return whether a path's content is no JSON or does not belong to its key."""
    try:
        return store.key(json.loads(content)).encode() != key
    except (ValueError, TypeError, OverflowError, RecursionError):
        return True


def damaged_state(key: bytes, *row: Any) -> bool:
    """Return whether a state's row is not what was written for the path with this key."""
    return store.stored(key.decode("utf-8", "replace"), row) is None


@dataclass(frozen=True, slots=True)
class Condition:
    """Conditions on states in SQL, joined by AND; a table without conditions has "1".

    Attributes
    ----------
    listed, path, state : conditions on each of the tables.
    values : values of their parameters, in this order.
    """

    listed: str
    path: str
    state: str
    values: tuple[str | float, ...]

    @property
    def sql(self) -> str:
        """All conditions as one on `state`."""
        conditions = [
            f"state.path IN (SELECT id FROM {table} WHERE {where})"
            for table, where in (("listed", self.listed), ("path", self.path))
            if where != "1"
        ]
        return " AND ".join([*conditions, self.state])

    @property
    def limits(self) -> bool:
        """Whether there are any conditions."""
        return self.sql != "1"


def condition(selection: Selection) -> Condition:
    """Return the conditions that the options mean.

    Raises
    ------
    BadInput
        A filter is not NAME=VALUE, its field or number is not known, or a date is none.
    """
    parts: dict[Table, list[tuple[str, tuple[str | float, ...]]]] = {"listed": [], "path": [], "state": []}
    for text in selection.where or []:
        table, sql, values = _parsed(text)
        parts[table].append((sql, values))
    for option, date, sign in (("--since", selection.since, ">="), ("--before", selection.before, "<")):
        if date is not None:
            parts["state"].append((f"state.added {sign} ?", (_utc(option, date),)))
    if outcomes := [name for name in ("failed", "transient") if getattr(selection, name)]:
        parts["state"].append((f"state.outcome IN ({', '.join('?' * len(outcomes))})", tuple(outcomes)))
    if selection.damaged:
        damaged = f"SELECT 1 FROM path WHERE path.id = state.path AND {DAMAGED}"
        parts["state"].append((f"EXISTS ({damaged})", ()))
    if selection.older_physics:
        parts["listed"].append((current_physics("<"), ()))
    where = {table: " AND ".join(sql for sql, _ in each) or "1" for table, each in parts.items()}
    return Condition(
        **where, values=tuple(value for each in parts.values() for _, values in each for value in values)
    )


def _parsed(text: str) -> tuple[Table, str, tuple[str | float, ...]]:
    """Return the table, the SQL and the values of a filter NAME=VALUE, NAME=a,b or NAME=low:high."""
    name, sign, value = (part.strip() for part in text.partition("="))
    if not (name and sign and value):
        raise BadInput(f"--where must be NAME=VALUE, NAME=a,b or NAME=low:high, such as nu=0.45:0.5; got {text!r}")
    if name not in FIELDS:
        raise BadInput(f"--where: there is no field {name!r}: {nearest(name, FIELDS)}")
    field = FIELDS[name]
    low, colon, high = value.partition(":")
    if colon and field.kind != "text":
        # SQLite takes a text for larger than every number
        bounds = {
            ">=": _number(name, low) if low.strip() else -math.inf,
            "<=": _number(name, high) if high.strip() else math.inf,
        }
        if bounds[">="] > bounds["<="]:
            raise BadInput(f"--where: the range of {name} is empty, {value}: give the lower bound first")
        between = f"{field.sql} BETWEEN ? AND ?"
        return field.table, between, (bounds[">="] - TOLERANCE, bounds["<="] + TOLERANCE)
    words = [word.strip() for word in value.split(",")]
    texts = [word for word in words if field.kind == "text" or (field.kind == "text or number" and word.isalpha())]
    numbers = [_number(name, word) for word in words if word not in texts]
    conditions = [f"CAST({field.sql} AS TEXT) = ?"] * len(texts) + [f"{field.sql} BETWEEN ? AND ?"] * len(numbers)
    limits = tuple(x for n in numbers for x in (n - TOLERANCE, n + TOLERANCE))
    return field.table, f"({' OR '.join(conditions)})", (*texts, *limits)


def _number(name: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise BadInput(f"--where: {name} must be a number, several as a,b, or a range low:high; got {text!r}")
    return number


def _utc(option: str, text: str) -> str:
    """Return a date or time as the store writes it; one without a time zone is UTC.

    >>> _utc("--since", "2026-11-05")
    '2026-11-05T00:00:00+00:00'
    """
    try:
        time = datetime.datetime.fromisoformat(text)
    except ValueError:
        raise BadInput(
            f"{option} must be a date or time such as 2026-11-05 or 2026-11-05T14:30; got {text!r}"
        ) from None
    zoned = time if time.tzinfo else time.replace(tzinfo=datetime.UTC)
    return zoned.astimezone(datetime.UTC).isoformat(timespec="seconds")


def current_physics(sign: Literal["<", "=", ">"]) -> str:
    """Return a condition on `listed`: its physics version against the program's, which is 0 for an unknown model."""
    from fem.physics_version import PHYSICS

    # a quantity with a version of its own comes before the model that computes it
    cases = [f"WHEN {column} = '{name}' THEN {PHYSICS[name]}" for column in ("quantity", "model") for name in PHYSICS]
    return f"physics {sign} CASE {' '.join(cases)} ELSE 0 END"
