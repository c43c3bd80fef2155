"""What the user gives, as values: the one reader of designs, of a sweep's axes and of studies.

Everything that cannot be used ends here in a `BadInput` of one sentence.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from geometry.design import PRESETS, BadInput, Design, nearest
from geometry.loads import Magnet

AXES = ("D", "L", "f", "E", "depth")
"""What a sweep can vary: fields of `Design`, and the depth of the press, mm."""

AN_AXIS = "an axis is a list of numbers for D, L, f (mm), E (MPa) or, in a sweep, depth (mm)"
"""What an axis can be, for messages."""

AccuracyName = Literal["quick", "standard", "fine"]

Value = float | str
"""Of a field of `Design`."""

_FIELDS = {spec.name: spec for spec in dataclasses.fields(Design)}
_KINDS: dict[str, type] = {name: str if "choices" in spec.metadata else float for name, spec in _FIELDS.items()}
_MAGNET = ("magnet_diameter", "magnet_height", "magnet_edge_radius")


@dataclass(frozen=True, slots=True)
class Study:
    """A sweep as a TOML file states it; None where the file leaves a choice to the caller.

    Attributes
    ----------
    design : a preset's name, or the path of a design's TOML file as seen from here.
    fields : fields of the design that differ from it.
    axes : values of each axis, one or more.
    depth : depth of the press where it is not an axis, mm.
    """

    design: str
    fields: dict[str, Value]
    axes: dict[str, list[float]]
    depth: float | None
    magnet: Magnet | None
    accuracy: AccuracyName | None


def read_design(source: str, sets: Sequence[str] = (), *, magnet: Magnet = "rigid") -> Design:
    """The design of a preset's name or a TOML file, with overrides KEY=VALUE.

    A file is a flat table of fields of `Design`; those left out take the values of the preset named by its key
    `base`, the paper's by default. With magnet "ignored", a magnet that does not fit is left out of the design, so
    that the beam can still be studied.

    Raises
    ------
    BadInput
        An unknown key, a value that is not a number or not possible, a file that cannot be read.

    >>> read_design("paper", ["D=10", "L=12"]).H
    7.0
    """
    base, values = _preset_or_file(source)
    return _made(base, {**values, **_overrides(sets)}, magnet)


def study_design(study: Study, sets: Sequence[str] = (), *, magnet: Magnet = "rigid") -> Design:
    """The design of a study, with overrides KEY=VALUE."""
    base, values = _preset_or_file(study.design)
    return _made(base, {**values, **study.fields, **_overrides(sets)}, magnet)


def parse_axes(axes: Sequence[str]) -> dict[str, list[float]]:
    """The axes of a sweep from texts NAME=a,b,c.

    >>> parse_axes(["D=6,8,10", "depth=0.5,1"])
    {'D': [6.0, 8.0, 10.0], 'depth': [0.5, 1.0]}
    """
    found: dict[str, list[float]] = {}
    for text in axes:
        name, equals, values = text.partition("=")
        name = name.strip()
        if not equals:
            raise BadInput(f"an axis must read NAME=a,b,c, such as D=6,8,10; got {text!r}")
        _check_axis(name)
        if name in found:
            raise BadInput(f"axis {name} is given twice: give all its values at once, {name}=a,b,c")
        found[name] = parse_numbers(f"axis {name}", values)
    return _checked_axes(found)


def parse_numbers(name: str, text: str) -> list[float]:
    """Numbers from a text a,b,c."""
    parts = [part.strip() for part in text.split(",")]
    if not text.strip():
        raise BadInput(f"{name} is empty: give numbers, such as 1,2,3")
    return [_number(f"each value of {name}", part) for part in parts]


def parse_choices(option: str, texts: Sequence[str], kind: type) -> dict[str, Any]:
    """Fields of a dataclass from texts KEY=VALUE: numbers, and texts that are none, whose ranges the class names."""
    names = [spec.name for spec in dataclasses.fields(kind)]
    given = pairs(option, texts, f"{names[-1]}=2")
    _known(option, given, names)
    return {key: _as_number(value) for key, value in given.items()}


def _as_number(text: str) -> float | str:
    """The number that a text is, a whole one as an int however it is written (1e9, 3.0); else the text."""
    try:
        value = float(text)
    except ValueError:
        return text
    return int(value) if value.is_integer() else value


def pairs(option: str, texts: Sequence[str], example: str) -> dict[str, str]:
    """What an option that is given once for each key says, from texts KEY=VALUE."""
    found: dict[str, str] = {}
    for text in texts:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not key:
            raise BadInput(f"{option} takes KEY=VALUE, such as {example}; got {text!r}")
        if key in found:
            raise BadInput(f"{option} {key} is given twice, as {found[key]} and {value}: give it once")
        found[key] = value
    return found


def is_study(source: str) -> bool:
    """Whether a sweep's positional argument names a study: a file with axes in it."""
    return source not in PRESETS and "axes" in _table(source, "preset or file")


def read_study(path: str) -> Study:
    """The study in a TOML file, its design taken as seen from the file's folder.

    Raises
    ------
    BadInput
        The file cannot be read, a key is unknown, or a value is not what it must be.
    """
    table = _table(path, "file")
    kinds: dict[str, Any] = {
        "design": str | dict[str, Any],
        "axes": dict[str, list[float]],
        "depth": float | None,
        "magnet": Literal["rigid", "ignored"] | None,
        "accuracy": AccuracyName | None,
    }
    _known(path, table, kinds)
    for name in table["axes"] if isinstance(table.get("axes"), dict) else ():
        _check_axis(name)
    if "axes" not in table:
        raise BadInput(f"{path}: a study needs a table [axes], with one or more of {', '.join(AXES)}")
    found = _validated(path, table, kinds)
    design: Any = found.get("design", "paper")
    fields: dict[str, Value] = {}
    if isinstance(design, dict):
        design, fields = _design_table(f"{path}: design", design)
    elif design not in PRESETS:
        design = str(Path(path).parent / design)
    depth = found.get("depth")
    if depth is not None and not depth > 0:
        raise BadInput(f"{path}: depth must be more than 0 mm; got {depth:g} mm")
    return Study(design, fields, _checked_axes(found["axes"]), depth, found.get("magnet"), found.get("accuracy"))


def _preset_or_file(source: str) -> tuple[str, dict[str, Value]]:
    return (source, {}) if source in PRESETS else _design_table(source, _table(source, "preset or file"))


def _made(base: str, values: Mapping[str, Value], magnet: Magnet) -> Design:
    given: dict[str, Any] = {**dataclasses.asdict(PRESETS[base]()), **values}
    try:
        return Design(**given)
    except BadInput:
        ranges = [(given[name], _FIELDS[name].metadata) for name in _MAGNET]
        if magnet == "rigid" or not all(m["low"] <= value <= m["high"] for value, m in ranges):
            raise
        return Design(**{**given, **dict.fromkeys(_MAGNET, 0.0)})


def _overrides(sets: Sequence[str]) -> dict[str, Value]:
    given = pairs("--set", sets, "D=10")
    _known("--set", given, _FIELDS)
    return {key: value if _KINDS[key] is str else _number(key, value) for key, value in given.items()}


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadInput(f"{name} must be a finite number; got {text!r}")
    return value


def _design_table(name: str, table: dict[str, Any]) -> tuple[str, dict[str, Value]]:
    """Name of the base preset, and the fields that a table gives."""
    kinds: dict[str, Any] = {"base": str, **_KINDS}
    _known(name, table, kinds)
    values = _validated(name, table, kinds)
    base = values.pop("base", "paper")
    if base not in PRESETS:
        raise BadInput(f"{name}: there is no preset {base!r} to be the base: {nearest(base, PRESETS)}")
    return base, values


def _known(name: str, keys: Iterable[str], valid: Iterable[str]) -> None:
    valid = list(valid)
    for key in keys:
        if key not in valid:
            raise BadInput(f"{name}: there is no key {key!r}: {nearest(key, valid)}")


def _validated(name: str, table: Mapping[str, Any], kinds: Mapping[str, Any]) -> dict[str, Any]:
    """The table's values, each strictly of its kind."""
    import pydantic

    config = pydantic.ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)
    fields: dict[str, Any] = {key: (kind, None) for key, kind in kinds.items()}
    model = pydantic.create_model("Table", __config__=config, **fields)
    try:
        return dict(model.model_validate(dict(table)).model_dump(exclude_unset=True))
    except pydantic.ValidationError as error:
        first = error.errors()[0]
    path = [str(part) for part in first["loc"] if not str(part).startswith(("dict[", "list["))]
    key = path[0] if path[0] != "axes" or len(path) == 1 else f"axis {path[1]}"
    wanted = {
        "float_type": "a number",
        "finite_number": "a finite number",
        "list_type": "a list of numbers",
        "dict_type": "a table",
        "string_type": "a string",
        "literal_error": first.get("ctx", {}).get("expected", ""),
    }.get(first["type"], first["msg"])
    raise BadInput(f"{name}: {key} must be {wanted}; got {first['input']!r:.60}")


def _table(path: str, what: str) -> dict[str, Any]:
    """The table in a TOML file."""
    import difflib
    import tomllib

    remedy = f"; presets: {', '.join(PRESETS)}" if what != "file" else ""
    text = ""
    try:
        # an editor may have put a byte order mark first, which TOML does not know
        text = Path(path).read_bytes().decode("utf-8-sig")
        return tomllib.loads(text)
    except FileNotFoundError:
        close = difflib.get_close_matches(path.casefold(), PRESETS, n=1)
        hint = f": did you mean {close[0]}?" if close and remedy else f": check its path{remedy}"
        raise BadInput(f"there is no {what} {path!r}{hint}") from None
    except IsADirectoryError:
        raise BadInput(f"{path!r} is a folder: give a TOML file{remedy}") from None
    except UnicodeDecodeError:
        raise BadInput(f"{path!r} is not UTF-8 text: save it as a UTF-8 TOML file") from None
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        cause = str(error) if isinstance(error, tomllib.TOMLDecodeError) else "it is nested too deeply"
        cause = cause.replace("at end of document", f"at the end, line {len(text.splitlines())}")
        raise BadInput(f"{path!r} is not valid TOML: {cause}") from None
    except (OSError, ValueError) as error:
        cause = getattr(error, "strerror", None) or str(error)
        raise BadInput(f"{path!r} cannot be read ({cause}): check its path and permissions") from None


def _check_axis(name: str) -> None:
    """An axis must be one of `AXES`; for other fields of the design there is --set."""
    if name in AXES:
        return
    if name not in _FIELDS:
        raise BadInput(f"there is no axis {name!r}: {nearest(name, AXES)}; {AN_AXIS}")
    raise BadInput(f"{name} cannot be an axis: {AN_AXIS}; use --set {name}=VALUE, one command for each value")


def _checked_axes(axes: Mapping[str, Sequence[float]]) -> dict[str, list[float]]:
    if not axes:
        raise BadInput(f"a sweep needs an axis, such as D=6,8,10: choose from {', '.join(AXES)}")
    for name, values in axes.items():
        _check_axis(name)
        if not values:
            raise BadInput(f"axis {name} is empty: give numbers, such as {name}=1,2,3")
        if len(set(values)) < len(values):
            raise BadInput(f"axis {name} lists a value twice: give each value once")
        low, high = (_FIELDS[name].metadata[end] for end in ("low", "high")) if name in _FIELDS else (0.0, math.inf)
        for value in values:
            if not low <= value <= high or (name == "depth" and not value > 0):
                bound = "be more than 0 mm" if name == "depth" else f"lie between {low:g} and {high:g}"
                raise BadInput(f"every value of axis {name} must {bound}; got {value:g}")
    return {name: [float(value) for value in values] for name, values in axes.items()}
