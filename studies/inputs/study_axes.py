"""Axes of a study: which fields can vary, in which units, and how their values are written.

An axis is a field of `Design`, `magnet` (rigid or ignored), or a field of the load as the options of `magtip solve`
name it. Values are a list, `lin:START:STOP:COUNT` or `log:START:STOP:COUNT`; in a study file also
`{ linspace = [start, stop, count] }` and `{ logspace = [start, stop, count] }`.

Input that cannot be used raises a `BadInput` here, whose message is one sentence with the remedy.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from geometry.bad_input import nearest
from geometry.design import BadInput
from studies.inputs.user_input import FIELDS, Value

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_VALUES = 1_000_000
"""Largest number of values of an axis; a larger one is taken for a mistake."""

SPACINGS = {"lin": "linspace", "log": "logspace"}
"""Names of evenly spaced values, on the command line and in a study file."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """What an axis can be: unit, range of numbers, and the names that it accepts besides or instead of numbers.

    `open_low` is True where the lower bound itself is refused.
    """

    unit: str
    low: float = -math.inf
    high: float = math.inf
    names: tuple[str, ...] = ()
    is_number: bool = True
    open_low: bool = False


@dataclass(frozen=True, slots=True)
class Factor:
    """Axes that vary together: one axis of a grid, a zipped group, or the axes of a sample.

    Attributes
    ----------
    names : the axes.
    values : for each axis all its values, one for each point; of a table that is given, arrays.
    sampled : whether the points are a sample of a box.
    """

    names: tuple[str, ...]
    values: tuple[tuple[Value, ...] | NDArray[Any], ...]
    sampled: bool = False

    @property
    def count(self) -> int:
        """Number of points."""
        return len(self.values[0])


DESIGN = {
    name: Quantity("1", names=tuple(spec.metadata["choices"]), is_number=False)
    if "choices" in spec.metadata
    else Quantity(spec.metadata["unit"], spec.metadata["low"], spec.metadata["high"])
    for name, spec in FIELDS.items()
    if "choices" in spec.metadata or "low" in spec.metadata
}
"""Fields of a design that can vary; a study's base design states those that are free text."""
LOAD = {
    "depth": Quantity("mm", 0.0, open_low=True),
    "shear": Quantity("mm"),
    "shear_y": Quantity("mm"),
    "plate_tilt": Quantity("deg", -40.0, 40.0),
    "grip": Quantity("mm", 0.0, open_low=True),
    "friction": Quantity("1", 0.0, names=("none", "stick")),
    "imperfection": Quantity("N"),
    "frequency": Quantity("Hz", 0.0, open_low=True),
    "speed": Quantity("mm/s", 0.0, open_low=True),
}
"""Fields of a load, see `geometry.loads.Load`; `shear` is along x, and the tilt of the plate is in degrees. Frequency
and speed say how fast the plate moves (`studies.mechanics.timed_quantities`)."""
METHOD = {"magnet": Quantity("1", names=("rigid", "ignored"), is_number=False)}
"""Choices of the finite elements that can vary. Models are no axis: a study sets them side by side in a row."""
AXES = {**DESIGN, **LOAD, **METHOD}
"""All axes by name."""

COMMON = ("D", "L", "f", "E", "depth", "shear")
"""Axes that messages name as examples."""

UNITS = {"1": "", "V/T": "_V_per_T", "V/sqrt(Hz)": "_V_per_sqrtHz", "kg/m3": "_kg_per_m3", "mm/s": "_mm_per_s"}
"""Last part of a column's name for units that cannot stand there as they are."""


def column(name: str) -> str:
    """Return the name of an axis' column, with its unit.

    >>> column("D"), column("nu"), column("hall_gain"), column("plate_tilt")
    ('D_mm', 'nu', 'hall_gain_V_per_T', 'plate_tilt_deg')
    """
    unit = AXES[name].unit
    return name + UNITS.get(unit, f"_{unit}")


def check_name(name: str) -> None:
    """Raise BadInput unless an axis has this name."""
    if name in AXES:
        return
    if name in FIELDS and name not in DESIGN:
        raise BadInput(f"{name} is a text and no axis: state it in the design, or vary loss_factor")
    remedy = nearest(name, AXES)
    if not remedy.startswith("did you mean"):
        remedy = f"an axis is a field of the design or the load, such as {', '.join(COMMON)}"
    raise BadInput(f"there is no axis {name!r}: {remedy}")


def checked(name: str, values: Sequence[Value]) -> list[Value]:
    """Return the values of an axis, numbers as floats, after a check of their kind and range."""
    if not values:
        raise BadInput(f"axis {name} is empty: give values, such as {name}={_example(name)}")
    numbers = [value if isinstance(value, str) else float(value) for value in values]
    if len(set(numbers)) < len(numbers):
        raise BadInput(f"axis {name} lists a value twice: give each value once")
    for value in numbers:
        _check_value(name, AXES[name], value)
    return numbers


def _check_value(name: str, quantity: Quantity, value: Value) -> None:
    if isinstance(value, str):
        if value not in quantity.names:
            wanted = [*quantity.names, *(["a number"] if quantity.is_number else [])]
            raise BadInput(f"every value of axis {name} must be {_listed(wanted)}; got {value!r}")
        return
    if not quantity.is_number:
        raise BadInput(f"every value of axis {name} must be {_listed(quantity.names)}; got {value:g}")
    if not math.isfinite(value):
        raise BadInput(f"each value of axis {name} must be a finite number; got '{value:g}'")
    low, high, unit = quantity.low, quantity.high, "" if quantity.unit == "1" else f" {quantity.unit}"
    if not low <= value <= high or (quantity.open_low and not value > low):
        bound = (
            f"lie between {low:g} and {high:g}{unit}"
            if math.isfinite(high)
            else f"be {'more than ' if quantity.open_low else 'at least '}{low:g}{unit}"
        )
        raise BadInput(f"every value of axis {name} must {bound}; got {value:g}")


def parse(name: str, text: str) -> list[Value]:
    """Return the values in a text a,b,c, lin:START:STOP:COUNT or log:START:STOP:COUNT.

    >>> parse("D", "6,8"), parse("depth", "lin:1:2:3"), parse("depth", "log:0.1:10:3"), parse("law", "yeoh")
    ([6.0, 8.0], [1.0, 1.5, 2.0], [0.1, 1.0, 10.0], ['yeoh'])
    """
    if not text.strip():
        return checked(name, [])
    kind, colon, rest = text.strip().partition(":")
    if colon:
        parts = [part.strip() for part in rest.split(":")]
        if kind not in SPACINGS or len(parts) != 3:
            raise BadInput(
                f"axis {name} must read a,b,c or lin:START:STOP:COUNT or log:START:STOP:COUNT; got {text!r}"
            )
        return spaced(name, SPACINGS[kind], [_value(name, part) for part in parts])
    return checked(name, [_value(name, part.strip()) for part in text.split(",")])


def _value(name: str, text: str) -> Value:
    try:
        return float(text)
    except ValueError:
        if AXES[name].names:
            return text
        raise BadInput(f"each value of axis {name} must be a finite number; got {text!r}") from None


def spaced(name: str, kind: str, numbers: Sequence[Any]) -> list[Value]:
    """Return the values of `linspace` or `logspace` = [start, stop, count]; both ends are exact."""
    if len(numbers) != 3 or any(isinstance(v, bool) or not isinstance(v, (int, float)) for v in numbers):
        raise BadInput(f"axis {name}: {kind} takes three numbers, start, stop and count; got {list(numbers)!r}")
    start, stop, count = (float(number) for number in numbers)
    if not (count.is_integer() and 2 <= count <= MOST_VALUES):
        raise BadInput(
            f"axis {name}: the count of {kind} must be a whole number from 2 to {MOST_VALUES}; got {count:g}"
        )
    if not (math.isfinite(start) and math.isfinite(stop)):
        raise BadInput(f"axis {name}: start and stop of {kind} must be finite; got {start:g} and {stop:g}")
    if kind == "logspace" and not (start > 0 and stop > 0):
        raise BadInput(f"axis {name}: start and stop of logspace must be more than 0; got {start:g} and {stop:g}")
    import numpy as np

    values = (np.geomspace if kind == "logspace" else np.linspace)(start, stop, int(count))
    # the twelfth digit of such values is rounding: 0.30000000000000004 would be a depth of its own in tables
    return checked(name, [float(f"{value:.12g}") for value in values.tolist()])


def from_table(name: str, value: Any) -> list[Value]:
    """Return the values of an axis in a study file: a list, or a table with `linspace` or `logspace`."""
    if isinstance(value, Mapping):
        kinds = list(SPACINGS.values())
        if len(value) != 1 or next(iter(value)) not in kinds:
            raise BadInput(f"axis {name}: a table has one key, {' or '.join(kinds)}; got {dict(value)!r:.60}")
        ((kind, numbers),) = value.items()
        if not isinstance(numbers, list):
            raise BadInput(f"axis {name}: {kind} takes a list [start, stop, count]; got {numbers!r:.60}")
        return spaced(name, kind, numbers)
    if not isinstance(value, list):
        raise BadInput(f"axis {name} must be a list of values; got {value!r:.60}")
    for one in value:
        named = isinstance(one, str) and bool(AXES[name].names)
        if isinstance(one, bool) or not (named or isinstance(one, (int, float))):
            raise BadInput(f"axis {name} must be a list of {_kind(name)}; got {one!r:.60}")
    return checked(name, value)


def _kind(name: str) -> str:
    quantity = AXES[name]
    names = f"the names {', '.join(quantity.names)}" if quantity.names else ""
    return " or ".join(part for part in ("numbers" if quantity.is_number else "", names) if part)


def _example(name: str) -> str:
    return "1,2,3" if AXES[name].is_number else ",".join(AXES[name].names[:2])


def _listed(words: Sequence[str]) -> str:
    return f"{', '.join(words[:-1])} or {words[-1]}" if len(words) > 1 else words[0]
