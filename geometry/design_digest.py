"""For which sensor a file was made: the fields of `Design` that its content depends on, and a digest of them.

States of a solve depend on what enters the mechanics, tables of readings on the magnet and the Hall elements too,
meshes on lengths alone. What does not enter is left out, so that it may differ: f and the other figures of the Hall
elements in a state, E and the law in a mesh. Keys carry units, as everywhere in files.

A file holds the fields as `made_for` beside their `digest`, which tells whether they were changed afterwards.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterable, Mapping
from typing import Any

from geometry.design import LAWS, BadInput, Design, Shape
from geometry.loads import Magnet

Fields = dict[str, float | str]

LENGTHS = ("D", "L")
MAGNET = ("magnet_diameter", "magnet_height", "magnet_edge_radius")
DIGITS = 12
"""Of a digest, hexadecimal: they fit into a whole number of 64 bits."""
PREFIX = "made_for_"
"""Of the names in files that hold numbers only."""
MOST_NAMED = 3
"""Of the fields that differ."""

_UNITS = {spec.name: spec.metadata["unit"] for spec in dataclasses.fields(Design)} | {"magnet": "1"}
KEYS = {name: name if unit == "1" else f"{name}_{unit}" for name, unit in _UNITS.items()}
"""Of the fields in files."""
_NAMES = {KEYS[name]: (name, "" if unit == "1" else f" {unit}") for name, unit in _UNITS.items()}


def of_mechanics(design: Design, magnet: Magnet = "rigid") -> Fields:
    """What force, shift and tilt depend on.

    >>> list(of_mechanics(Design(law="yeoh"), "ignored"))
    ['D_mm', 'L_mm', 'E_MPa', 'nu', 'law', 'yeoh_2', 'yeoh_3', 'magnet']
    """
    found = _fields(design, (*LENGTHS, "E", "nu", "law", *LAWS[design.law]))
    return found | {"magnet": magnet} | (_fields(design, MAGNET) if magnet == "rigid" else {})


def of_readings(design: Design) -> Fields:
    """What the flux densities at the Hall elements depend on for a pose of the magnet; edges count as sharp there."""
    places = ("f", "l0", "c", "hall_plate") if design.hall_layout == "three" else ("l0", "chip_x")
    magnet = ("magnet_diameter", "magnet_height", "remanence")
    return _fields(design, (*LENGTHS, *magnet, "hall_layout", *places))


def of_solid(shape: Shape, *, magnet: bool = True) -> Fields:
    """What a mesh depends on, beside the size of its cells; without the magnet, what its outside depends on."""
    plain = shape if shape.has_magnet else shape.without_magnet()
    return _fields(plain, (*LENGTHS, *MAGNET) if magnet else LENGTHS)


def _fields(owner: Design | Shape, names: Iterable[str]) -> Fields:
    # adding 0 takes the sign from a negative zero, which JSON written by others may not keep
    values = {name: getattr(owner, name) for name in names}
    return {KEYS[name]: value if isinstance(value, str) else value + 0.0 for name, value in values.items()}


def digest(fields: Mapping[str, Any]) -> str:
    """A short text that differs where the fields do; whole numbers count as floats, and the order does not matter."""
    plain = {key: float(v) if isinstance(v, int) and abs(v) < 2**53 else v for key, v in fields.items()}
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()[:DIGITS]


def label(fields: Fields) -> dict[str, Any]:
    """What a file says of itself: the fields and their digest."""
    return {"digest": digest(fields), "made_for": fields}


def as_numbers(fields: Fields) -> dict[str, float | int]:
    """A label without texts as named numbers, for files that hold numbers only; `from_numbers` turns it round."""
    numbers = {f"{PREFIX}{key}": value for key, value in fields.items() if not isinstance(value, str)}
    return {**numbers, f"{PREFIX}digest": int(digest(fields), 16)}


def from_numbers(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """The label in named numbers, or nothing.

    >>> from_numbers(as_numbers({"D_mm": 8.0})) == label({"D_mm": 8.0})
    True
    """
    found = {name.removeprefix(PREFIX): value for name, value in numbers.items() if name.startswith(PREFIX)}
    code = found.pop("digest", None)
    made = {key: float(value) for key, value in found.items()}
    return {"digest": f"{int(code):0{DIGITS}x}", "made_for": made} if code is not None else {}


def check(about: Mapping[str, Any], needed: Fields, what: str) -> bool:
    """Whether a file says for which sensor it was made.

    Parameters
    ----------
    about : what the file says of itself, with the keys of `label`, or without.
    needed : fields that must be there and the same; others may differ.
    what : the file, for messages.

    Raises
    ------
    BadInput
        It was made for another sensor, or what it says does not fit its digest.
    """
    if "made_for" not in about:
        return False
    made = about["made_for"]
    if not isinstance(made, Mapping) or about.get("digest") != digest(made):
        raise BadInput(
            f"{what}: the digest {about.get('digest')!r} does not match the fields in made_for, which were edited "
            f"afterwards: make the file again"
        )
    differing = [key for key, value in needed.items() if made.get(key) != value]
    if differing:
        # fields that the other sensor does not have, such as the numbers of another law, follow from those it has
        differing = [key for key in differing if key in made] or differing
        named = differing[:MOST_NAMED]
        more = f" (and {len(differing) - len(named)} more fields differ)" if len(differing) > len(named) else ""
        raise BadInput(
            f"{what} was made for another sensor, with {_shown(made, named)} where this design has "
            f"{_shown(needed, named)}{more}: use that design, or make the file again for this one"
        )
    return True


def _shown(fields: Mapping[str, Any], keys: Iterable[str]) -> str:
    texts = []
    for key in keys:
        (name, unit), value = _NAMES[key], fields.get(key)
        text = (
            "not given" if value is None else f"{value:.12g}{unit}" if isinstance(value, float | int) else str(value)
        )
        texts.append(f"{name} {text}")
    return ", ".join(texts)
