"""Axes of a sweep, from options NAME=a,b,c, and study files in TOML.

Input that cannot be used raises a `BadInput` here, whose message is one sentence with the remedy.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from geometry.design import PRESETS, BadInput, Design, nearest
from geometry.loads import Magnet
from studies.inputs.user_input import (
    FIELDS,
    AccuracyName,
    Value,
    check_keys,
    design_from,
    design_table,
    overrides,
    parse_numbers,
    preset_or_file,
    toml_table,
    validated,
)

AXES = ("D", "L", "f", "E", "depth")
"""Names that can be axes of a sweep: fields of `Design`, and the depth of the press, mm."""

AN_AXIS = "an axis is a list of numbers for D, L, f (mm), E (MPa) or, in a sweep, depth (mm)"
"""Description of an axis, for messages."""


@dataclass(frozen=True, slots=True)
class Study:
    """A sweep as a TOML file describes it; None where the file does not state a value.

    Attributes
    ----------
    design : name of a preset, or path of a design's TOML file, relative to the current folder.
    fields : fields of the design that the study replaces.
    axes : values of each axis, one or more.
    depth : depth of the press where it is not an axis, mm.
    """

    design: str
    fields: dict[str, Value]
    axes: dict[str, list[float]]
    depth: float | None
    magnet: Magnet | None
    accuracy: AccuracyName | None


def study_design(study: Study, sets: Sequence[str] = (), *, magnet: Magnet = "rigid") -> Design:
    """Return the design of a study, with overrides KEY=VALUE."""
    base, values = preset_or_file(study.design)
    return design_from(base, {**values, **study.fields, **overrides(sets)}, magnet)


def parse_axes(axes: Sequence[str]) -> dict[str, list[float]]:
    """Return the axes of a sweep from texts NAME=a,b,c.

    >>> parse_axes(["D=6,8,10", "depth=0.5,1"])
    {'D': [6.0, 8.0, 10.0], 'depth': [0.5, 1.0]}
    """
    parsed: dict[str, list[float]] = {}
    for text in axes:
        name, equals, values = text.partition("=")
        name = name.strip()
        if not equals:
            raise BadInput(f"an axis must read NAME=a,b,c, such as D=6,8,10; got {text!r}")
        _check_axis(name)
        if name in parsed:
            raise BadInput(f"axis {name} is given twice: give all its values at once, {name}=a,b,c")
        parsed[name] = parse_numbers(f"axis {name}", values)
    return _checked_axes(parsed)


def is_study(source: str) -> bool:
    """Return whether a sweep's positional argument names a study, which is a file with axes, or else a design."""
    return source not in PRESETS and "axes" in toml_table(source, "preset or file")


def read_study(path: str) -> Study:
    """Read the study in a TOML file; the path of its design is relative to the file's folder.

    Raises
    ------
    BadInput
        The file cannot be read, a key is unknown, or a value has the wrong type or is out of range.
    """
    table = toml_table(path, "file")
    kinds: dict[str, Any] = {
        "design": str | dict[str, Any],
        "axes": dict[str, list[float]],
        "depth": float | None,
        "magnet": Literal["rigid", "ignored"] | None,
        "accuracy": AccuracyName | None,
    }
    check_keys(path, table, kinds)
    for name in table["axes"] if isinstance(table.get("axes"), dict) else ():
        _check_axis(name)
    if "axes" not in table:
        raise BadInput(f"{path}: a study needs a table [axes], with one or more of {', '.join(AXES)}")
    values = validated(path, table, kinds)
    design: Any = values.get("design", "paper")
    fields: dict[str, Value] = {}
    if isinstance(design, dict):
        design, fields = design_table(f"{path}: design", design)
    elif design not in PRESETS:
        design = str(Path(path).parent / design)
    depth = values.get("depth")
    if depth is not None and not depth > 0:
        raise BadInput(f"{path}: depth must be more than 0 mm; got {depth:g} mm")
    return Study(design, fields, _checked_axes(values["axes"]), depth, values.get("magnet"), values.get("accuracy"))


def _check_axis(name: str) -> None:
    """Raise BadInput unless the name is one of `AXES`; for other fields of the design the remedy is --set."""
    if name in AXES:
        return
    if name not in FIELDS:
        raise BadInput(f"there is no axis {name!r}: {nearest(name, AXES)}; {AN_AXIS}")
    raise BadInput(f"{name} cannot be an axis: {AN_AXIS}; use --set {name}=VALUE, one command for each value")


def _checked_axes(axes: Mapping[str, Sequence[float]]) -> dict[str, list[float]]:
    """Return the axes after a check of their names and of the ranges of their values."""
    if not axes:
        raise BadInput(f"a sweep needs an axis, such as D=6,8,10: choose from {', '.join(AXES)}")
    for name, values in axes.items():
        _check_axis(name)
        if not values:
            raise BadInput(f"axis {name} is empty: give numbers, such as {name}=1,2,3")
        if len(set(values)) < len(values):
            raise BadInput(f"axis {name} lists a value twice: give each value once")
        low, high = (FIELDS[name].metadata[end] for end in ("low", "high")) if name in FIELDS else (0.0, math.inf)
        for value in values:
            if not low <= value <= high or (name == "depth" and not value > 0):
                bound = "be more than 0 mm" if name == "depth" else f"lie between {low:g} and {high:g}"
                raise BadInput(f"every value of axis {name} must {bound}; got {value:g}")
    return {name: [float(value) for value in values] for name, values in axes.items()}
