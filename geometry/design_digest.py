"""The label of a file: the fields of `Design` on which its content depends, and a digest of them.

A label omits all other fields, so these may differ between the file and the design: f and the electrical fields of
the Hall elements for a state, E and the law for a mesh. The keys carry units, as everywhere in files.

A file stores the fields under `made_for` and their digest under `digest`. A digest that does not match the fields
shows that they were edited after the file was written. A field that `Design` got later stands in a label only if it
differs from its default, so that older files keep their labels.
"""

import dataclasses
import hashlib
import json
from collections.abc import Iterable, Mapping
from typing import Any

from geometry.design import LAWS, OF_MODULUS, BadInput, Design, Shape
from geometry.loads import Magnet

Fields = dict[str, float | str]

LENGTHS = ("D", "L")
MAGNET = ("magnet_diameter", "magnet_height", "magnet_edge_radius")
DIGITS = 12
"""Number of hexadecimal digits of a digest: 48 bits, which a double or an integer of 64 bits holds exactly."""
PREFIX = "made_for_"
"""Prefix of the field names in files that hold numbers only."""

_UNITS = {"magnet": "1", **{spec.name: spec.metadata["unit"] for spec in dataclasses.fields(Design)}}
KEYS = {name: name if unit == "1" else f"{name}_{unit.replace('/', '_per_')}" for name, unit in _UNITS.items()}
"""Key of each field in files: its name and its unit."""
LATER: dict[str, Any] = {
    key: spec.default
    for spec in dataclasses.fields(Design)
    if spec.metadata.get("later")
    for key in (spec.name, KEYS[spec.name])
}
"""Fields that labels got after the first ones were written, by name and key, with what older files mean."""
_NAMES = {KEYS[name]: (name, "" if unit == "1" else f" {unit}") for name, unit in _UNITS.items()}


def of_mechanics(design: Design, magnet: Magnet = "rigid") -> Fields:
    """Return the fields on which force, shift and tilt depend.

    >>> list(of_mechanics(Design(law="yeoh"), "ignored"))
    ['D_mm', 'L_mm', 'E_MPa', 'temperature_degC', 'nu', 'law', 'yeoh_2', 'yeoh_3', 'magnet']
    """
    fields = _fields(design, (*LENGTHS, *OF_MODULUS, "nu", "law", *LAWS[design.law]))
    return fields | {"magnet": magnet} | (_fields(design, MAGNET) if magnet == "rigid" else {})


def of_readings(design: Design) -> Fields:
    """Return the fields on which the flux densities at the Hall elements depend, for a given pose of the magnet.

    The formula of the magnetic field treats the magnet's edges as sharp, so `magnet_edge_radius` is not among them.
    """
    places = ("f", "l0", "c", "hall_plate") if design.hall_layout == "three" else ("l0", "chip_x", "chip_count")
    magnet = ("magnet_diameter", "magnet_height", "remanence", "remanence_drift", "magnet_north", "temperature")
    return _fields(design, (*LENGTHS, *magnet, "hall_layout", *places))


def of_solid(shape: Shape, *, magnet: bool = True) -> Fields:
    """Return the fields on which a mesh depends, apart from its cell size.

    magnet : False for a mesh of silicone alone, which depends on the outer lengths only.
    """
    # without a magnet, an edge radius that was left in the shape must not make two equal meshes differ
    plain = shape if shape.has_magnet else shape.without_magnet()
    return _fields(plain, (*LENGTHS, *MAGNET) if magnet else LENGTHS)


def _fields(owner: Design | Shape, names: Iterable[str]) -> Fields:
    # adding 0 turns -0.0 into 0.0: other programs that rewrite the JSON may lose the sign and so change the digest
    values = {name: getattr(owner, name) for name in names}
    return {KEYS[name]: value if isinstance(value, str) else value + 0.0 for name, value in values.items()}


def digest(fields: Mapping[str, Any]) -> str:
    """Return a short hash of the fields; the order of the keys does not change it, nor does 8 in place of 8.0."""
    # from 2**53 on, not every whole number is a float: such a number is hashed as it stands
    values = without_later_defaults(fields)
    plain = {key: float(v) if isinstance(v, int) and abs(v) < 2**53 else v for key, v in values.items()}
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()[:DIGITS]


def label(fields: Fields) -> dict[str, Any]:
    """Return the label of a file: the fields and their digest."""
    return {"digest": digest(fields), "made_for": without_later_defaults(fields)}


def without_later_defaults(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields without those of `LATER` that have their default.

    >>> without_later_defaults({"D_mm": 8.0, "magnet_north": "down"})
    {'D_mm': 8.0}
    """
    return {key: value for key, value in fields.items() if key not in LATER or value != LATER[key]}


def as_numbers(fields: Fields) -> dict[str, float | int]:
    """Return a label as named numbers, without its texts, for files that hold numbers only.

    `from_numbers` is the inverse.
    """
    numbers = {f"{PREFIX}{key}": value for key, value in fields.items() if not isinstance(value, str)}
    return {**numbers, f"{PREFIX}digest": int(digest(fields), 16)}


def from_numbers(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Return the label that named numbers hold; an empty one if they hold none.

    >>> from_numbers(as_numbers({"D_mm": 8.0})) == label({"D_mm": 8.0})
    True
    """
    fields = {name.removeprefix(PREFIX): value for name, value in numbers.items() if name.startswith(PREFIX)}
    code = fields.pop("digest", None)
    made_for = {key: float(value) for key, value in fields.items()}
    return {"digest": f"{int(code):0{DIGITS}x}", "made_for": made_for} if code is not None else {}


def check(header: Mapping[str, Any], needed: Fields, what: str) -> bool:
    """Check that a file was made for this sensor; return False if the file has no label.

    Parameters
    ----------
    header : the file's own description, with or without the keys of `label`.
    needed : fields that the label must hold, with equal values; further fields of the label may differ.
    what : name of the file in messages.

    Raises
    ------
    BadInput
        The file was made for another sensor, or the fields of its label do not match its digest.
    """
    if "made_for" not in header:
        return False
    made = header["made_for"]
    if not isinstance(made, Mapping) or header.get("digest") != digest(made):
        raise BadInput(
            f"{what}: the digest {header.get('digest')!r} does not match the fields in made_for, which were edited "
            f"afterwards: make the file again"
        )
    made = {**LATER, **made}
    differing = [key for key, value in needed.items() if made.get(key) != value]
    if differing:
        # name the fields that both sensors have, such as the law: a parameter that only one law has differs anyway
        differing = [key for key in differing if key in made] or differing
        named = differing[:3]
        more = f" (and {len(differing) - len(named)} more fields differ)" if len(differing) > len(named) else ""
        raise BadInput(
            f"{what} was made for another sensor, with {_shown(made, named)} where this design has "
            f"{_shown(needed, named)}{more}: use that design, or make the file again for this one"
        )
    return True


def _shown(fields: Mapping[str, Any], keys: Iterable[str]) -> str:
    """Return names, values and units of some fields, as a message lists them."""
    texts = []
    for key in keys:
        (name, unit), value = _NAMES[key], fields.get(key)
        text = (
            "not given" if value is None else f"{value:.12g}{unit}" if isinstance(value, float | int) else str(value)
        )
        texts.append(f"{name} {text}")
    return ", ".join(texts)
