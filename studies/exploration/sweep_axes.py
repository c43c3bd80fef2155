"""Axes of a sweep in its pictures: names with symbol and unit, spacing, positions of text values, edges of cells."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from geometry.arrays import Array, Ints
from studies.output.table_plots import LETTER
from studies.output.text_tables import with_unit

UNITS = {
    "V_per_T": "V/T", "V_per_sqrtHz": "V/√Hz", "kg_per_m3": "kg/m³",
    "mm_per_s": "mm/s", "MPa": "MPa", "mm": "mm", "deg": "°", "rad": "rad", "percent": "%",
    "mT": "mT", "T": "T", "N": "N", "V": "V", "Hz": "Hz", "K": "K",
}  # fmt: skip
"""Units by the last part of a column's name."""

SYMBOLS = {
    "D": "$D$", "L": "$L$", "f": "$f$", "E": "$E$", "c": "$c$", "l0": "$l_0$", "depth": "$d$", "shear": r"$\delta$",
    "nu": r"$\nu$",
}  # fmt: skip
NAMED = {"depth": "depth $d$", "shear": r"shear $\delta$"}
"""Names with the symbol where there is room."""

SAME_RATIO = 0.15
"""Relative spread of the ratios of neighbouring values up to which they are log-spaced; 1, 2, 5, 10 is beyond it."""
LEAST_RATIO = 8.0
"""Ratio of the last to the first value from which a logarithmic axis is of use."""


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis of a sweep.

    Attributes
    ----------
    column : name of its column.
    values : numbers in rising order, or texts in the study's order.
    texts : whether the values are texts; their positions in a picture are 0, 1, 2 ...
    """

    column: str
    values: tuple[Any, ...]
    texts: bool

    def __len__(self) -> int:
        """Return the number of values."""
        return len(self.values)

    @property
    def positions(self) -> Array:
        """Coordinates of the values in a picture, shape (n,)."""
        return np.arange(len(self), dtype=float) if self.texts else np.asarray(self.values, dtype=float)

    @property
    def log(self) -> bool:
        """Whether the values are log-spaced."""
        return not self.texts and log_spaced(self.positions)

    @property
    def label(self) -> str:
        """Name, symbol and unit."""
        name, unit = split(self.column)
        full = NAMED.get(name, symbol(self.column))
        return with_unit(full, unit)

    def text(self, index: int, *, full: bool = False) -> str:
        """Return the symbol, or the name with it, and one of the values."""
        name, unit = split(self.column)
        shown = NAMED.get(name, symbol(self.column)) if full else symbol(self.column)
        return f"{shown} = {self.value(index)}{' ' + unit if unit else ''}"

    def value(self, index: int) -> str:
        """Return one of the values."""
        value = self.values[index]
        return str(value) if self.texts else f"{value:.4g}"

    def edges(self) -> Array:
        """Return the edges of the cells around the values, shape (n + 1,)."""
        at = np.log(self.positions) if self.log else self.positions
        if len(at) == 1:
            half = 0.5 if self.texts or at[0] == 0 else 0.05 * abs(at[0])
            return np.array([at[0] - half, at[0] + half])
        middle = (at[1:] + at[:-1]) / 2
        edges = np.concatenate([[2 * at[0] - middle[0]], middle, [2 * at[-1] - middle[-1]]])
        return np.exp(edges) if self.log else edges


def axis_of(column: str, values: Sequence[float | str]) -> Axis:
    """Return an axis; values that are not all different numbers are texts, which keep their order.

    >>> axis_of("D_mm", [8.0, 6.0]).values, axis_of("friction", [0.3, "stick"]).values
    ((6.0, 8.0), ('0.3', 'stick'))
    """
    numbers = all(isinstance(value, (int, float, np.number)) for value in values)
    if numbers and len(set(values)) == len(values):
        return Axis(column, tuple(sorted(float(value) for value in values)), texts=False)
    labels = [text_of(value) for value in values]
    # a group of zipped axes may repeat a value of its first axis
    counts = {label: labels.count(label) for label in labels}
    shown = [f"{t} (no. {k + 1})" if counts[t] > 1 else t for k, t in enumerate(labels)]
    return Axis(column, tuple(shown), texts=True)


def text_of(value: Any) -> str:
    """Return a value of a text axis as it is shown."""
    return value if isinstance(value, str) else f"{float(value):.6g}"


def index_of(axis: Axis, column: Any) -> Ints:
    """Return the index of each row's value on the axis, shape (n,)."""
    if axis.texts:
        index = {value: k for k, value in enumerate(axis.values)}
        return np.array([index.get(text_of(value), -1) for value in column], dtype=np.int64)
    values = np.asarray(column, dtype=float)
    middle = (axis.positions[1:] + axis.positions[:-1]) / 2
    return np.searchsorted(middle, values).astype(np.int64)


def log_spaced(values: Array) -> bool:
    """Return whether rising values are rather log-spaced than evenly spaced.

    >>> log_spaced(np.array([0.1, 0.3, 1.0, 3.0])), log_spaced(np.array([1.0, 2.0, 3.0]))
    (True, False)
    """
    if len(values) < 3 or not values[0] > 0 or values[-1] / values[0] < LEAST_RATIO:
        return False
    steps = np.diff(np.log(values))
    return bool(np.ptp(steps) <= SAME_RATIO * steps.mean())


def split(column: str) -> tuple[str, str]:
    """Return the name and the unit of a column.

    >>> split("magnet_height_mm"), split("law"), split("hall_gain_V_per_T")
    (('magnet_height', 'mm'), ('law', ''), ('hall_gain', 'V/T'))
    """
    for end, unit in UNITS.items():
        name = column.removesuffix(f"_{end}")
        if name != column:
            return name, unit
    return column, ""


def symbol(column: str) -> str:
    """Return the symbol of an axis, or its name where it has none."""
    name, _ = split(column)
    # the axis of zipped values has symbols in its name
    return SYMBOLS.get(name, name if "$" in name else name.replace("_", " "))


def scale(panel: Any, way: str, axis: Axis, inches: float = 3.0) -> None:
    """Set scale and ticks of the panel's x or y axis, which has this length in inches."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, NullLocator

    side = panel.xaxis if way == "x" else panel.yaxis
    most = max(2, min(6, round(inches / (0.55 if way == "x" else 0.4))))
    if axis.texts:
        side.set_major_locator(FixedLocator(axis.positions.tolist()))
        side.set_major_formatter(FuncFormatter(lambda at, _: axis.values[round(at)] if abs(at % 1) < 1e-9 else ""))
        return
    if axis.log:
        (panel.set_xscale if way == "x" else panel.set_yscale)("log")
        decades = math.log10(axis.values[-1] / axis.values[0])
        steps = (1.0, 2.0, 5.0) if 3 * decades < most + 1 else (1.0, 3.0) if 2 * decades < most + 1 else (1.0,)
        side.set_major_locator(LogLocator(subs=steps))
        side.set_minor_locator(NullLocator())
        side.set_major_formatter(FuncFormatter(lambda at, _: f"{at:g}"))
    elif len(axis) == 1 or (
        len(axis) <= most and np.diff(axis.positions).min() * most > 0.7 * np.ptp(axis.positions)
    ):
        side.set_major_locator(FixedLocator(axis.positions.tolist()))
        side.set_major_formatter(FuncFormatter(lambda at, _: f"{at:.4g}"))
    else:
        side.set_major_locator(MaxNLocator(nbins=most, steps=[1, 2, 5, 10]))


def turn(panel: Any, axis: Axis, inches: float) -> None:
    """Turn the texts of a horizontal axis for which this length has no room."""
    if axis.texts and sum(len(value) + 2 for value in axis.values) * LETTER > inches:
        steep = inches < 2.5
        panel.tick_params(axis="x", labelrotation=90 if steep else 30)
        for text in panel.get_xticklabels():
            text.set(ha="center" if steep else "right", rotation_mode="default" if steep else "anchor")


def wrapped(text: str, inches: float) -> str:
    """Return a text in as many lines as this length needs; a unit or a value stays with its name.

    >>> wrapped("shift of the magnet (mm)", 1.8)
    'shift of the\\nmagnet (mm)'
    """
    kept = text.replace(" (", "\u00a0(").replace(" = ", "\u00a0=\u00a0")
    name, mark, value = kept.partition("=")
    kept = name + mark + value.replace(" ", "\u00a0")
    # the signs $ around symbols are not drawn
    letters = max(8, int(inches / LETTER) + text.count("$"))
    return "\n".join(textwrap.wrap(kept, letters, break_long_words=False)).replace("\u00a0", " ")
