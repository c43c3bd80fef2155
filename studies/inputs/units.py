"""Units that users may write: of a value in a file, such as "5 mN", and in the head of a table of measurements."""

from __future__ import annotations

import math
import re

from geometry.bad_input import nearest
from geometry.design import BadInput

IN_VALUES: dict[str, dict[str, float]] = {
    "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "mm": {"mm": 1.0, "um": 1e-3, "µm": 1e-3, "cm": 10.0, "m": 1000.0},
    "MPa": {"MPa": 1.0, "kPa": 1e-3, "Pa": 1e-6},
    "Hz": {"Hz": 1.0, "kHz": 1e3},
    "mm/s": {"mm/s": 1.0, "m/s": 1000.0},
    "T": {"T": 1.0, "mT": 1e-3, "uT": 1e-6, "µT": 1e-6, "nT": 1e-9, "kG": 0.1, "G": 1e-4},
    "V": {"V": 1.0, "mV": 1e-3, "uV": 1e-6, "µV": 1e-6},
    "V/T": {"V/T": 1.0, "mV/mT": 1.0, "mV/G": 10.0},
    "T/sqrt(Hz)": {"T/sqrt(Hz)": 1.0, "nT/sqrt(Hz)": 1e-9, "uT/sqrt(Hz)": 1e-6, "µT/sqrt(Hz)": 1e-6},
    "kg/m3": {"kg/m3": 1.0, "g/cm3": 1000.0},
    "C": {"C": 1.0, "°C": 1.0},
    "1/K": {"1/K": 1.0, "%/K": 0.01, "ppm/K": 1e-6},
    "h": {"h": 1.0, "min": 1 / 60},
    "K": {"K": 1.0},
    "deg": {"deg": 1.0, "°": 1.0},
    "1": {"%": 0.01},
}
"""Units that may be written, by the unit that magtip uses; each with its factor. Unit "1" is that of pure numbers."""
IN_HEADS: dict[str, dict[str, float]] = {
    "V": {"V": 1.0, "mV": 1e-3},
    "T": {"T": 1.0, "mT": 1e-3, "uT": 1e-6, "µT": 1e-6, "G": 1e-4},
    "N": {"N": 1.0, "mN": 1e-3, "g": 9.80665e-3, "gf": 9.80665e-3, "kg": 9.80665},
    "mm": {"mm": 1.0, "um": 1e-3, "µm": 1e-3, "m": 1e3},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0},
    "C": {"C": 1.0, "degC": 1.0, "°C": 1.0, "K": 1.0},
    "MPa": {"MPa": 1.0, "kPa": 1e-3, "Pa": 1e-6},
}
"""Factors of the units that a head may name, by the unit of the values that are read; kelvin also have a shift,
`geometry.design.KELVIN`."""
_TEXT = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(.*)")


def quantity(name: str, value: object, unit: str, low: float = -math.inf, high: float = math.inf) -> float:
    """Return a value in `unit`, from a number in that unit, or from a text with a number and a unit.

    Parameters
    ----------
    unit : one of the keys of `IN_VALUES`; with "1" a number is a fraction, and a text may be in %.
    low, high : least and largest value in `unit`, both allowed.

    >>> quantity("resolution_z", "5 mN", "N"), quantity("largest_strain", "40 %", "1")
    (0.005, 0.4)
    """
    number, factor = math.nan, 1.0
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        number = float(value)
    elif isinstance(value, str) and (match := _TEXT.fullmatch(value.strip())):
        known, named = {"": 1.0, **IN_VALUES[unit]}, match[2].strip()
        if named not in known:
            raise BadInput(f"{name}: {named!r:.40} is no unit for it: {nearest(named[:40], IN_VALUES[unit])}")
        number, factor = float(match[1]), known[named]
    pure = unit == "1"
    if not math.isfinite(number):
        kind = 'a number, such as 0.4 or "40 %"' if pure else f'a number in {unit}, such as 5 or "5 {unit}"'
        raise BadInput(f"{name} must be {kind}; got {value!r:.60}")
    # decimal prefixes must not leave rounding in the last digit: 5 * 1e-3 is 0.005, as 5 / 1000 is
    result = number / round(1 / factor) if factor < 1 else number * factor
    if not low <= result <= high:
        bound = f"lie between {low:g} and {high:g}" if math.isfinite(high) else f"be at least {low:g}"
        after = "" if pure else f" {unit}"
        hint = ': write 40 % as 0.4 or "40 %"' if pure and high < result <= 100 else ""
        raise BadInput(f"{name} must {bound}{after}; got {result:g}{after}{hint}")
    return result
