"""Readers of designs, from presets and TOML files, and of the numbers and choices of options.

Input that cannot be used raises a `BadInput` here, whose message is one sentence with the remedy.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

from geometry.bad_input import closest, nearest, no_effect
from geometry.design import PRESETS, BadInput, Design, paper, preset, preset_table
from geometry.loads import Magnet
from studies.output import console
from studies.output.bounded_files import MOST_TOML, text_of, toml_in
from studies.output.literals import toml

AccuracyName = Literal["quick", "standard", "fine"]
Value = float | str
"""Value of a field of `Design`."""
FIELDS = {spec.name: spec for spec in dataclasses.fields(Design)}
_KINDS: dict[str, type] = {name: float if "low" in spec.metadata else str for name, spec in FIELDS.items()}
_MAGNET = ("magnet_diameter", "magnet_height", "magnet_edge_radius")


def read_design(
    source: str, sets: Sequence[str] = (), *, magnet: Magnet = "rigid", unused: Mapping[str, Value] = {}
) -> Design:
    """Read the design of a preset or of a TOML file, with overrides KEY=VALUE.

    A file has fields of `Design`. Other fields have the values of the preset that its key `base` names; default:
    paper. Tables beside them (`BESIDE`) say how the sensor is made, and what was required of it. With magnet
    "ignored", a magnet that does not fit into the beam is removed from the design, so that the beam can be studied.

    unused : values that replace those of fields which do not matter, so that these do not refuse the design.

    >>> read_design("paper", ["D=10", "L=12"]).H
    7.0
    """
    base, values = preset_or_file(source)
    return design_from(base, {**values, **overrides(sets), **unused}, magnet)


def parse_numbers(name: str, text: str) -> list[float]:
    """Return the numbers of a text a,b,c; `name` is for messages."""
    parts = [part.strip() for part in text.split(",")]
    if not text.strip():
        raise BadInput(f"{name} is empty: give numbers, such as 1,2,3")
    return [_number(f"each value of {name}", part) for part in parts]


def parse_tolerance(text: str) -> float:
    """Return the fraction in a text such as 1% or 0.01.

    >>> parse_tolerance("1%"), parse_tolerance("0.01")
    (0.01, 0.01)
    """
    number, sign, rest = text.strip().partition("%")
    try:
        value = float(number) / (100 if sign else 1)
    except ValueError:
        value = math.nan
    if rest or not 0 < value < 1:
        raise BadInput(
            "the tolerance must be a percentage above 0% and below 100%, such as 1%, or a fraction such as 0.01; got "
            f"{text!r}"
        )
    return value


def parse_choices(option: str, texts: Sequence[str], kind: type) -> dict[str, Any]:
    """Return fields of a dataclass from texts KEY=VALUE, as numbers where possible; the class checks their ranges."""
    names = keys_of(kind)
    choices = pairs(option, texts, f"{names[-1]}=2")
    check_keys(option, choices, names)
    found: dict[str, Any] = dict(choices)
    for key, text in choices.items():
        with contextlib.suppress(ValueError):
            value = float(text)
            # a whole number, even if it is written 1e9 or 3.0
            found[key] = int(value) if value.is_integer() else value
    return found


def keys_of(kind: type) -> list[str]:
    """Return the fields of a dataclass that are given as KEY=VALUE."""
    return [spec.name for spec in dataclasses.fields(kind) if "stated" not in spec.metadata]


def pairs(option: str, texts: Sequence[str], example: str) -> dict[str, str]:
    """Return the values of a repeatable option by their keys, from texts KEY=VALUE; a key may occur only once."""
    values: dict[str, str] = {}
    for text in texts:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not key:
            raise BadInput(f"{option} takes KEY=VALUE, such as {example}; got {text!r}")
        if key in values:
            raise BadInput(f"{option} {key} is given twice, as {values[key]} and {value}: give it once")
        values[key] = value
    return values


BESIDE = ("array", "fabrication", "requirements", "tolerances")
"""Tables of a design file beside its fields: an array of such beams, how the sensor is made, what was required of it,
and how far its parts may lie from it."""
FABRICATION = {"process": str, "base": dict, "mold": dict}
"""Keys of the first of them."""


def fabrication_of(source: str) -> dict[str, Any]:
    """Return the table [fabrication] of a design file: process, and settings of base and mould; else nothing."""
    return table_beside(source, "fabrication", FABRICATION)


def table_beside(source: str, name: str, kinds: Mapping[str, Any]) -> dict[str, Any]:
    """Return a table of a design file beside its fields, with keys of these kinds; nothing if it has none."""
    table = toml_table(source, "preset or file").get(name, {})
    if not isinstance(table, dict):
        raise BadInput(f"{source}: {name} must be a table: write [{name}]")
    return checked(f"{source}: {name}", table, kinds) if table else {}


def preset_or_file(source: str) -> tuple[str, dict[str, Value]]:
    """Return the name of the base preset and the fields that the source replaces."""
    return (source, {}) if source in PRESETS else design_table(source, toml_table(source, "preset or file"))


def design_from(base: str, values: Mapping[str, Value], magnet: Magnet) -> Design:
    """Return the design of a preset with other values; see `read_design` for magnet "ignored"."""
    fields: dict[str, Any] = {**dataclasses.asdict(preset(base)), **values}
    try:
        return Design(**fields)
    except BadInput:
        # a magnet with impossible sizes stays an error; only one that does not fit into the beam is removed
        ranges = [(fields[name], FIELDS[name].metadata) for name in _MAGNET]
        if magnet == "rigid" or not all(m["low"] <= value <= m["high"] for value, m in ranges):
            raise
        return Design(**{**fields, **dict.fromkeys(_MAGNET, 0.0)})


def overrides(sets: Sequence[str]) -> dict[str, Value]:
    """Return the fields that --set replaces."""
    texts = pairs("--set", sets, "D=10")
    check_fields("--set", texts, FIELDS)
    return {key: value if _KINDS[key] is str else _number(key, value) for key, value in texts.items()}


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadInput(f"{name} must be a finite number; got {text!r}")
    return value


def design_table(name: str, table: dict[str, Any]) -> tuple[str, dict[str, Value]]:
    """Return the name of the base preset, and the fields that a design's table states."""
    fields = {key: value for key, value in table.items() if key not in BESIDE}
    kinds = {"base": str, **_KINDS}
    check_fields(name, fields, kinds)
    values = checked(name, fields, kinds)
    base = values.pop("base", "paper")
    if base not in PRESETS:
        raise BadInput(f"{name}: there is no preset {base!r} to be the base: {nearest(base, PRESETS)}")
    return base, values


def check_fields(name: str, keys: Iterable[str], valid: Iterable[str]) -> None:
    """Raise BadInput for the first key that is no field of a design, of which there are too many for a message."""
    valid = list(valid)
    for key in keys:
        if key not in valid:
            close = closest(key, valid)
            remedy = f"did you mean {close}?" if close else "`magtip design paper` lists all"
            raise BadInput(f"{name}: there is no key {key!r}: {remedy}")


def check_keys(name: str, keys: Iterable[str], valid: Iterable[str]) -> None:
    """Raise BadInput for the first key that is not valid; `name` is that of the file or option."""
    valid = list(valid)
    for key in keys:
        if key not in valid:
            raise BadInput(f"{name}: there is no key {key!r}: {nearest(key, valid)}")


def checked(name: str, table: Mapping[str, Any], kinds: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a table with optional keys of these kinds; the first wrong one raises BadInput."""
    from studies.inputs import file_models

    return file_models.read(name, table, file_models.model_of(kinds)).stated()


def toml_table(path: str, what: str) -> dict[str, Any]:
    """Read the table in a TOML file, or of a preset where `what`, which names it in messages, allows one."""
    import difflib

    close, more = list[str](), ""
    if what != "file":
        if path in PRESETS:
            return preset_table(path)
        close, more = difflib.get_close_matches(path.casefold(), PRESETS, n=1), f"; presets: {', '.join(PRESETS)}"
    text = text_of(path, "TOML", what, f"did you mean {close[0]}?" if close else "", more, MOST_TOML)
    try:
        return toml_in(text)
    except BadInput as error:
        raise BadInput(f"{path!r} {error}") from None


def warn_of_values(design: Design) -> None:
    """Warn of fields without effect, of values that no silicone has, and of steps that averaging does not reduce."""
    from analytic import parts

    for warning in (*design.value_warnings(), *parts.average_warnings(design)):
        console.warn(warning)


def say_if_array(source: str) -> None:
    """Say of a design file with a table [array] that only one of its beams is taken."""
    if "array" in toml_table(source, "preset or file"):
        console.say(f"{source} is an array: this is one of its beams by itself, without neighbours")


def say_no_effect(what: str, reason: str) -> None:
    """Warn of an option or an axis that has no effect beside other options or with this design."""
    console.warn(no_effect([what], reason))


def changed_fields(design: Design) -> dict[str, float | str]:
    """Return the fields of a design that differ from the preset paper."""
    base = paper()
    names = [spec.name for spec in dataclasses.fields(base)]
    return {name: getattr(design, name) for name in names if getattr(design, name) != getattr(base, name)}


def design_text(design: Design) -> str:
    """Return a design file with every field that differs from the preset.

    >>> print(design_text(Design(D=10, law="yeoh")), end="")
    base = "paper"
    D = 10.0
    law = "yeoh"
    """
    return "\n".join(toml({"base": "paper", **changed_fields(design)})) + "\n"
