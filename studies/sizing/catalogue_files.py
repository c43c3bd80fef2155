"""Catalogues as TOML files: the shipped ones, and the user's in the same format.

A file holds any of the arrays of tables `[[grade]]`, `[[magnet]]`, `[[hall_part]]` and `[[silicone]]`; the shipped
files in this folder are the examples. A magnet stands for one part of each of its grades, such as "4x2 N35". A value
that a table leaves out has its default, and counts as assumed.

Input that cannot be used raises a `BadInput` here, whose message is one sentence with the remedy.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from analytic.parts import CHIPS
from geometry.bad_input import nearest
from geometry.design import HALL_LAYOUTS, BadInput
from studies.inputs.quantity_input import quantity
from studies.inputs.user_input import check_keys, toml_table
from studies.sizing.catalogue_entries import HallPartEntry, SiliconeEntry


@dataclass(frozen=True, slots=True)
class Key:
    """A key of a table: unit and range of its numbers, or text.

    Attributes
    ----------
    unit : one of `studies.inputs.quantity_input.UNITS`; "text" or "names" (a list of texts) for others.
    count : how many numbers, from low to high, or the three sides of a body.
    default : None where the key is needed.
    """

    unit: str
    low: float = 0.0
    high: float = 0.0
    count: int = 1
    default: Any = None


_COMMON = {"source": Key("text", default="the user's file"), "assumed": Key("names", default=())}
KEYS: dict[str, dict[str, Key]] = {
    "grade": {
        "name": Key("text"),
        "remanence": Key("T", 0.01, 2.0, 2),
        "largest_temperature": Key("C", 20, 600, default=80.0),
        "source": _COMMON["source"],
    },
    "magnet": {
        "name": Key("text", default=""),
        "diameter": Key("mm", 0.1, 200),
        "height": Key("mm", 0.1, 200),
        "edge_radius": Key("mm", 0, 100, default=0.1),
        "tolerance": Key("mm", 0, 10, default=0.1),
        "density": Key("kg/m3", 100, 25000, default=7500.0),
        "grades": Key("names"),
        **_COMMON,
    },
    "hall_part": {
        "name": Key("text"),
        "layout": Key("text", default="three"),
        "gain": Key("V/T", 1e-3, 1e6, default=0.0),
        "gain_tolerance": Key("1", 0, 1, default=0.05),
        "null": Key("V", 0, 100, default=2.5),
        "low": Key("V", 0, 100, default=0.2),
        "high": Key("V", 0, 100, default=4.8),
        "noise_density": Key("T/sqrt(Hz)", 0, 1e-3, default=130e-9),
        "bandwidth": Key("Hz", 1, 1e7, default=20e3),
        "plate": Key("mm", 0, 10, default=0.0),
        "body": Key("mm", 0.1, 100, 3, default=(4.06, 3.0, 1.57)),
        **_COMMON,
    },
    "silicone": {
        "name": Key("text"),
        "E": Key("MPa", 1e-4, 1e4, 3),
        "nu": Key("1", 0.3, 0.5, 3, default=(0.49, 0.4998, 0.4999)),
        "density": Key("kg/m3", 100, 25000, default=1080.0),
        "cure_temperature": Key("C", 0, 400, default=23.0),
        "cure_hours": Key("h", 0, 1000, default=24.0),
        "mixed": Key("text", default="by its data sheet"),
        **_COMMON,
    },
}
"""Keys of the tables. The defaults of Hall parts are those of an SS495A, with the noise of a DRV5055."""
ENDS = {2: "[low, high]", 3: "[low, typical, high]"}
"""How a key with several numbers is written."""


@dataclass(frozen=True, slots=True)
class CatalogueFile:
    """What a file holds, each entry by its name; magnets without the values of their grades."""

    path: str
    grades: dict[str, dict[str, Any]]
    magnets: dict[str, dict[str, Any]]
    hall_parts: dict[str, HallPartEntry]
    silicones: dict[str, SiliconeEntry]


def read_catalogue(path: str) -> CatalogueFile:
    """Read and check the entries of a file.

    Raises
    ------
    BadInput
        The file cannot be read or has no entry; a key, unit or name is unknown, missing or given twice; or a value is
        out of range.
    """
    table = toml_table(path, "file")
    check_keys(path, table, KEYS)
    if not any(table.get(name) for name in KEYS):
        raise BadInput(f"{path}: the catalogue is empty: add a table [[magnet]], [[hall_part]] or [[silicone]]")
    named = {name: _by_name(path, name, table.get(name, [])) for name in KEYS}
    return CatalogueFile(
        path,
        named["grade"],
        named["magnet"],
        {name: _hall_part(f"{path}: {name}", entry) for name, entry in named["hall_part"].items()},
        {name: _silicone(entry) for name, entry in named["silicone"].items()},
    )


def _by_name(path: str, array: str, tables: object) -> dict[str, dict[str, Any]]:
    """Return the checked tables of an array by their names."""
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise BadInput(f"{path}: {array} must be an array of tables: write [[{array}]]")
    named: dict[str, dict[str, Any]] = {}
    for number, table in enumerate(tables, 1):
        entry = _entry(path, array, table, number)
        if entry["name"] in named:
            raise BadInput(f"{path}: two tables [[{array}]] have the name {entry['name']!r}: rename or remove one")
        named[entry["name"]] = entry
    return named


def _entry(path: str, array: str, table: Mapping[str, Any], number: int) -> dict[str, Any]:
    """Return the values of a table in the units of magtip; `assumed` also names what the table leaves out."""
    keys, name = KEYS[array], table.get("name")
    where = f"{path}: {name}" if isinstance(name, str) and name else f"{path}: [[{array}]] number {number}"
    check_keys(where, table, keys)
    entry: dict[str, Any] = {}
    for key, kind in keys.items():
        if key in table:
            entry[key] = _value(f"{where}: {key}", table[key], kind)
        elif kind.default is None:
            raise BadInput(f"{where}: {key} is missing")
        else:
            entry[key] = kind.default
    if "assumed" in keys:
        check_keys(f"{where}: assumed", entry["assumed"], keys)
        left_out = [key for key in keys if key not in (*table, "name", "layout", "source", "assumed")]
        entry["assumed"] = (*entry["assumed"], *left_out)
    if array == "magnet":
        _check_magnet(where, entry)
        entry["name"] = entry["name"] or f"{entry['diameter']:g}x{entry['height']:g}"
    return entry


def _value(where: str, value: object, key: Key) -> Any:
    """Return a value that has been checked against its key."""
    if key.unit == "text":
        if not isinstance(value, str) or not value.strip():
            raise BadInput(f"{where} must be a text; got {value!r:.60}")
        return value
    if key.unit == "names":
        if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
            raise BadInput(f"{where} must be a list of names; got {value!r:.60}")
        return tuple(value)
    if key.count == 1:
        return quantity(where, value, key.unit, key.low, key.high)
    ends = ENDS[key.count] if not where.endswith("body") else "[width, height, thickness]"
    if not isinstance(value, list) or len(value) != key.count:
        raise BadInput(f"{where} must be {ends}; got {value!r:.60}")
    numbers = tuple(quantity(where, number, key.unit, key.low, key.high) for number in value)
    if list(numbers) != sorted(numbers) and not where.endswith("body"):
        raise BadInput(f"{where} must be {ends}, none above the next; got {', '.join(f'{n:g}' for n in numbers)}")
    return numbers


def _check_magnet(where: str, entry: Mapping[str, Any]) -> None:
    """Raise BadInput for a magnet without a grade, or with an edge that is wider than itself."""
    if not entry["grades"]:
        raise BadInput(f"{where}: grades is empty: name one or more, such as N35")
    widest = min(entry["diameter"], entry["height"]) / 2
    if not entry["edge_radius"] <= widest:
        raise BadInput(
            f"{where}: edge_radius must not exceed half the magnet's smaller side = {widest:g} mm; got "
            f"{entry['edge_radius']:g} mm"
        )


def _hall_part(where: str, entry: Mapping[str, Any]) -> HallPartEntry:
    """Return a Hall part; a chip has the range, step and noise of `analytic.parts`."""
    values = {key: value for key, value in entry.items() if key != "body"}
    if entry["layout"] not in HALL_LAYOUTS:
        raise BadInput(f"{where}: there is no layout {entry['layout']!r}: {nearest(entry['layout'], HALL_LAYOUTS)}")
    if entry["layout"] != "three":
        chip = CHIPS[entry["layout"]]
        values |= {"gain": 1.0, "null": 0.0, "low": -chip.range, "high": chip.range, "plate": 0.0}
        values |= dict.fromkeys(("noise_density", "bandwidth", "width", "height", "thickness"))
        assumed = tuple(name for name in entry["assumed"] if name == "gain_tolerance")
        return HallPartEntry(
            **values | {"noise": chip.noise, "step": chip.step, "assumed": (*assumed, "noise", "step")}
        )
    if not entry["gain"] > 0:
        raise BadInput(f"{where}: gain is missing")
    if not entry["low"] < entry["null"] < entry["high"]:
        raise BadInput(
            f"{where}: null must lie between low = {entry['low']:g} V and high = {entry['high']:g} V; got "
            f"{entry['null']:g} V"
        )
    width, height, thickness = entry["body"]
    body = {"width": width, "height": height, "thickness": thickness}
    return HallPartEntry(**values, **body, noise=None, step=0.0)


def _silicone(entry: Mapping[str, Any]) -> SiliconeEntry:
    """Return a silicone."""
    values = {key: value for key, value in entry.items() if key not in ("E", "nu")}
    E_low, E, E_high = entry["E"]
    nu_low, nu, nu_high = entry["nu"]
    return SiliconeEntry(**values, E_low=E_low, E=E, E_high=E_high, nu_low=nu_low, nu=nu, nu_high=nu_high)
