"""Read and check relaxation tests and dynamic tests of a silicone in CSV files.

A relaxation test holds a stretch and records the stress, or the modulus E(t), over the time since the stretch began
to rise. A dynamic test records storage and loss modulus over the frequency. Every column's name carries its unit.
Moduli become Young's moduli: E = 2 (1 + nu) G; a nominal stress at a held stretch becomes E by the neo-Hookean law.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from geometry.design import BadInput
from studies.inputs import table_input
from studies.simulation.law_regression import nominal_stress
from studies.simulation.tensile_test import STRESS, STRETCH, check_strain, column_of, value_of

Kind = Literal["uniaxial", "relaxation", "dynamic"]

TIME = {"time_s": 1.0, "time_ms": 1e-3, "time_min": 60.0, "time_h": 3600.0}
FREQUENCY = {"frequency_Hz": 1.0, "angular_frequency_rad_per_s": 1 / (2 * math.pi)}
RAMP = {"ramp_s": 1.0}
UNITS = {"MPa": 1.0, "kPa": 1e-3, "Pa": 1e-6}
MODULUS = {f"{name}_{unit}": size for name in ("youngs_modulus", "shear_modulus") for unit, size in UNITS.items()}
STORAGE = {
    f"{name}_{unit}": size for name in ("storage_modulus", "shear_storage_modulus") for unit, size in UNITS.items()
}
LOSS = {name.replace("storage", "loss"): size for name, size in STORAGE.items()} | {"tan_delta": 1.0}
KNOWN = {*TIME, *FREQUENCY, *RAMP, *STRETCH, *STRESS, *MODULUS, *STORAGE, *LOSS}

FEWEST = 6
"""Fewest points of a test: one branch has four parameters with the noise, and AICc needs two points more."""
HELD = 0.01
"""Largest relative variation of a strain that counts as held."""

RISE, NOISE = 0.05, 6.0
"""A rise after the ramp, or a fall within it, is refused if it exceeds this share of the largest value, and this many
standard deviations of the noise: the largest and the least of 100 readings of noise differ by five."""


@dataclass(frozen=True, slots=True)
class Test:
    """A relaxation test or a dynamic test.

    Attributes
    ----------
    at : times, s, or frequencies, Hz, rising, shape (n,).
    values : E(t), or E' + i E'' as complex numbers, MPa, shape (n,); the nominal stress where `has_modulus` is False.
    column : name of the values' column.
    has_modulus : False for a stress without the stretch that belongs to it.
    ramp : time in which the stretch rose, s; None if it is not stated.
    counts : number of readings of which each value is the mean, shape (n,); None: one each.
    """

    __test__ = False  # the name is that of the field; pytest collects classes that begin with it

    kind: Literal["relaxation", "dynamic"]
    at: Array
    values: NDArray[Any]
    column: str
    has_modulus: bool = True
    ramp: float | None = None
    counts: Array | None = None

    @property
    def covered(self) -> tuple[float, float]:
        """Shortest and longest time, s, for which the test speaks: a frequency f stands for 1 / (2 pi f)."""
        ends = (float(self.at[0]), float(self.at[-1]))
        if self.kind == "dynamic":
            return 1 / (2 * math.pi * ends[1]), 1 / (2 * math.pi * ends[0])
        return max(ends[0], self.ramp or 0.0), ends[1]


def kind_of(path: str) -> Kind:
    """Return the kind of a test, by the first words in the names of its columns."""
    rows = table_input.csv_rows(Path(path), comments=True)
    line, header = (rows[0][0], [cell.strip() for cell in rows[0][1]]) if rows else (1, [])
    rates = [name for name in header if name.casefold().startswith(("frequency", "angular_frequency"))]
    times = [name for name in header if name.casefold().startswith("time")]
    if rates and times:
        raise BadInput(
            f"{path!r}, line {line}: columns {times[0]} and {rates[0]} belong to a relaxation test and a dynamic "
            "test: keep one of them"
        )
    return "dynamic" if rates else "relaxation" if times else "uniaxial"


def read(path: str, nu: float, stretch: float | None = None, ramp: float | None = None) -> Test:
    """Read the test in a CSV file; # begins a comment.

    Parameters
    ----------
    stretch, ramp : held stretch, and the time in which it rose, s, where the file has no columns of them.

    Raises
    ------
    BadInput
        The file cannot be read, a column is missing, ambiguous or without unit, a value is not possible, the times or
        frequencies do not rise, or there are too few points.
    """
    rows = [(line, [cell.strip() for cell in row]) for line, row in table_input.csv_rows(Path(path), comments=True)]
    table = _Table(path, rows[0][0], rows[0][1], rows[1:])
    return _dynamic(table, nu) if kind_of(path) == "dynamic" else _relaxation(table, nu, stretch, ramp)


@dataclass(frozen=True, slots=True)
class _Table:
    """The header of a file with its line, and its rows with theirs."""

    path: str
    line: int
    header: list[str]
    rows: table_input.Rows

    def values(self, names: Mapping[str, float]) -> tuple[str, Array]:
        """Return the name of the only column among some, and its values in the unit whose factor is 1, shape (n,).

        A missing column is the first thing to say, and a missing row the second.
        """
        # a column of another quantity is not taken for a misspelt one of this
        header = ["" if name in KNOWN and name not in names else name for name in self.header]
        if not any(header) and not self.has(names):
            raise BadInput(
                f"{self.path!r}, line {self.line}: the header needs a column {' or '.join(names)} besides "
                f"{', '.join(self.header)}"
            )
        k = column_of(self.path, self.line, header, tuple(names))
        name = self.header[k]
        table_input.check_rows(self.path, self.rows)
        if len(self.rows) < FEWEST:
            raise BadInput(
                f"{self.path!r} has too few points ({len(self.rows)}): a fit of branches needs at least {FEWEST}"
            )
        return name, names[name] * np.array(
            [value_of(self.path, line, self.header, row, k) for line, row in self.rows]
        )

    def has(self, names: Mapping[str, Any]) -> bool:
        """Return whether a column has one of these names."""
        return any(name in names for name in self.header)

    def refuse(self, bad: NDArray[np.bool_], column: str, what: str, values: Array) -> None:
        """Raise BadInput for the first value that is bad, shape (n,)."""
        if bad.any():
            k = int(np.argmax(bad))
            raise BadInput(f"{self.path!r}, line {self.rows[k][0]}, column {column}: {what}; got {values[k]:g}")

    def rising(self, names: Mapping[str, float], what: str) -> Array:
        """Return times or frequencies, which must be above 0 and rise."""
        column, at = self.values(names)
        self.refuse(at <= 0, column, f"a {what} must be more than 0", at)
        fall = np.concatenate([[False], np.diff(at) <= 0])
        self.refuse(fall, column, f"each {what} must be greater than the one before: sort the rows, drop repeats", at)
        return at


def _dynamic(table: _Table, nu: float) -> Test:
    at = table.rising(FREQUENCY, "frequency")
    column, storage = table.values(STORAGE)
    other, loss = table.values(LOSS)
    table.refuse(storage <= 0, column, "a storage modulus must be more than 0", storage)
    table.refuse(loss < 0, other, "a loss must be 0 or more", loss)
    if other != "tan_delta" and other.startswith("shear") != column.startswith("shear"):
        raise BadInput(
            f"{table.path!r}: columns {column} and {other} must both be Young's moduli or both shear moduli"
        )
    loss = storage * loss if other == "tan_delta" else loss
    return Test("dynamic", at, _youngs(column, nu) * (storage + 1j * loss), column)


def _relaxation(table: _Table, nu: float, stretch: float | None, ramp: float | None) -> Test:
    at = table.rising(TIME, "time")
    ramp = _one_value(table, RAMP, ramp, "--ramp")
    if ramp is not None and not 0 <= ramp < at[-1]:
        raise BadInput(f"the ramp must last 0 s or longer and end before the last time, {at[-1]:g} s; got {ramp:g} s")
    column, stress = table.values(STRESS | MODULUS)
    if column in MODULUS:
        if stretch is not None:
            raise BadInput(f"{table.path!r} has the modulus, which needs no held stretch: leave --stretch out")
        table.refuse(stress <= 0, column, "a modulus must be more than 0", stress)
        _check_ramp(table, at, stress, ramp)
        return Test("relaxation", at, _youngs(column, nu) * stress, column, ramp=ramp)
    held = _held_stretch(table, stretch)
    sign = float(np.sign(stress[0])) if held is None else math.copysign(1.0, held - 1)
    table.refuse(sign * stress <= 0, column, "tension must be positive and compression negative throughout", stress)
    _check_ramp(table, at, np.abs(stress), ramp)
    if held is None:
        return Test("relaxation", at, np.abs(stress), column, has_modulus=False, ramp=ramp)
    if table.has(STRETCH):
        name = next(name for name in table.header if name in STRETCH)
        check_strain(table.path, name, np.full(len(stress), held), stress)
    factor = 2 * (1 + nu) / float(nominal_stress("neo-hookean", (), np.array(held)))
    return Test("relaxation", at, factor * stress, column, ramp=ramp)


def _check_ramp(table: _Table, at: Array, values: Array, ramp: float | None) -> None:
    """Refuse values (n,) that rise after the ramp, or fall within it: no relaxation does so."""
    noise = 1.4826 / math.sqrt(6) * float(np.median(np.abs(np.diff(values, 2))))
    margin, T = max(RISE * float(values.max()), NOISE * noise), ramp or 0.0
    first = int(np.searchsorted(at, T))
    top = first + int(np.argmax(values[first:]))
    if values[top] - values[first] > margin:
        stated = f"the ramp of {T:g} s" if T else "a stretch that rises at once"
        remedy = "state the time of the rise by --ramp" if not T else "state a longer --ramp"
        raise BadInput(
            f"{table.path!r}: the values rise from {at[first]:.4g} s to {at[top]:.4g} s, as they cannot after "
            f"{stated}: {remedy}, or leave out the rows before {at[top]:.4g} s"
        )
    peak = int(np.argmax(values[:first])) if first else 0
    if first and values[peak] - values[peak:first].min() > margin:
        raise BadInput(
            f"{table.path!r}: the values fall from {at[peak]:.4g} s on, as they cannot within the ramp of {T:g} s: "
            "state the time in which the stretch rose, or --ramp 0 if it rose at once"
        )


def _youngs(column: str, nu: float) -> float:
    """Return the factor from a column's modulus to Young's modulus."""
    return 2 * (1 + nu) if column.startswith("shear") else 1.0


def _held_stretch(table: _Table, option: float | None) -> float | None:
    """Return the stretch of a column of `STRETCH` or of the option; None if neither states it."""
    held = option
    if table.has(STRETCH):
        offset = STRETCH[next(name for name in table.header if name in STRETCH)][0]
        strain = _one_value(table, {name: factor for name, (_, factor) in STRETCH.items()}, None, "--stretch")
        held = None if strain is None else offset + strain
        if option is not None:
            raise BadInput(f"{table.path!r} has a column of the held stretch: leave --stretch out")
    if held is not None and not (0.05 <= held <= 20 and held != 1):
        raise BadInput(f"the held stretch must lie between 0.05 and 20 and differ from 1; got {held:g}")
    return held


def _one_value(table: _Table, names: Mapping[str, float], option: float | None, flag: str) -> float | None:
    """Return the value of a column whose values are all equal, or of an option; None if neither states it."""
    if not table.has(names):
        return option
    if option is not None:
        raise BadInput(f"{table.path!r} has a column of what {flag} states: leave {flag} out")
    column, values = table.values(names)
    table.refuse(
        np.abs(values - values[-1]) > HELD * abs(values[-1]), column, f"must be held at {values[-1]:g}", values
    )
    return float(values[-1])
