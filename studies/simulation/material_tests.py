"""Read and check tests of a silicone in CSV files: uniaxial tests, relaxation tests and dynamic tests.

A uniaxial test records nominal stress over stretch. A relaxation test holds a stretch and records the stress, or the
modulus E(t), over the time since the stretch began to rise. A dynamic test records storage and loss modulus over the
frequency. Every column's name carries its unit, and # begins a comment. Moduli become Young's moduli: E = 2 (1 + nu)
G; a nominal stress at a held stretch becomes E by the neo-Hookean law.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from geometry.bad_input import closest
from geometry.design import SILICONE_E, BadInput
from studies.inputs import table_input, units

Kind = Literal["uniaxial", "relaxation", "dynamic"]
STRETCH = {"stretch": (0.0, 1.0), "strain": (1.0, 1.0), "strain_percent": (1.0, 0.01)}
"""Columns of the deformation: stretch = first number + second number * value."""
SAME_WORD = {"strain": "strain_percent", "strain_percent": "strain"}
"""Columns that are easily taken for each other: 0.1 and 10 are one strain."""


def _in_units(*names: str, of: str = "MPa") -> dict[str, float]:
    return {f"{name}_{unit}": size for name in names for unit, size in units.IN_HEADS[of].items()}


STRESS = _in_units("nominal_stress")
"""Columns of the force over the first cross-section, and their unit in MPa."""
TRUE_STRESS = _in_units("true_stress")
"""Columns of the force over the cross-section at that moment, and their unit in MPa: in a uniaxial test of an
incompressible bar the nominal stress times the stretch."""
TIME = _in_units("time", of="s")
FREQUENCY = {"frequency_Hz": 1.0, "angular_frequency_rad_per_s": 1 / (2 * math.pi)}
RAMP = {"ramp_s": 1.0}
MODULUS = _in_units("youngs_modulus", "shear_modulus")
STORAGE = _in_units("storage_modulus", "shear_storage_modulus")
LOSS = _in_units("loss_modulus", "shear_loss_modulus") | {"tan_delta": 1.0}
KNOWN = {*TIME, *FREQUENCY, *RAMP, *STRETCH, *STRESS, *TRUE_STRESS, *MODULUS, *STORAGE, *LOSS}

LOWEST, HIGHEST, MOST_STRESS = 0.05, 20.0, 1e5
WRONG_SIGN = 0.2
"""Stress over the largest that may have the other sign than the strain: friction, preload and permanent set stay
below, a compression with a positive stress does not."""
FEWEST = 6
"""Fewest points of a relaxation or dynamic test: one branch has four parameters with the noise, and AICc needs two
points more."""
HELD = 0.01
"""Largest relative variation of a strain that counts as held."""
RISE, NOISE = 0.05, 6.0
"""A rise after the ramp, or a fall within it, is refused if it exceeds this share of the largest value, and this many
standard deviations of the noise: the largest and the least of 100 readings of noise differ by five."""


@dataclass(frozen=True, slots=True)
class Specimen:
    """Points of a uniaxial test, in the file's order: stretch, shape (n,), and nominal stress, shape (n,), MPa.

    `column` is the name of the stress in the file.
    """

    stretch: Array
    stress: Array
    column: str = "nominal_stress_MPa"

    @property
    def telling(self) -> NDArray[np.bool_]:
        """Points with a stretch other than 1: at 1 every law has the stress 0, shape (n,)."""
        return np.asarray(self.stretch != 1)

    @property
    def least_strain(self) -> float:
        """Smallest absolute value of a strain other than 0."""
        return float(np.abs(self.stretch[self.telling] - 1).min())

    def near(self, strain: float) -> NDArray[np.bool_]:
        """Return the points with strains up to this size; if there are none, those with the smallest, shape (n,)."""
        limit = max(strain, self.least_strain)
        return np.asarray(self.telling & (np.abs(self.stretch - 1) <= limit * (1 + 1e-9)))


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
        first, last = float(self.at[0]), float(self.at[-1])
        if self.kind == "dynamic":
            return 1 / (2 * math.pi * last), 1 / (2 * math.pi * first)
        return max(first, self.ramp or 0.0), last


class _Table(table_input.Measured):
    """A test in a CSV file."""

    def column(self, wanted: Iterable[str]) -> str:
        """Return the only column with a wanted name."""
        found = [name for name in self.heads if name in wanted]
        if len(found) == 1:
            return found[0]
        if found:
            raise BadInput(f"{self.where}: columns {' and '.join(found)} give the same quantity: keep one of them")
        # a column of another quantity is not taken for a misspelt one of this
        for name in (name for name in self.heads if name and name not in KNOWN):
            if "%" in name and "strain" in wanted and name.casefold().startswith("strain"):
                raise BadInput(f"{self.where}: there is no column {name!r}: did you mean strain_percent?")
            same = next((other for other in wanted if name.casefold() == other.casefold()), None)
            units = [other for other in wanted if other.casefold().startswith(f"{name.casefold()}_")]
            if units and not same:
                raise BadInput(f"{self.where}: the name of column {name!r} has no unit: call it {' or '.join(units)}")
            if meant := same or misspelt(name, wanted):
                raise BadInput(f"{self.where}: there is no column {name!r}: did you mean {meant}?")
        got = ", ".join(filter(None, self.heads))
        raise BadInput(f"{self.where}: the header needs a column {' or '.join(wanted)}; got {got!r:.80}")

    def values(self, names: Mapping[str, float], fewest: int = FEWEST) -> tuple[str, Array]:
        """Return the name of the only column among some, and its values in the unit whose factor is 1, shape (n,).

        A missing column is the first thing to say, and a missing row the second.
        """
        if all(name in KNOWN for name in self.heads) and not self.has(names):
            raise BadInput(
                f"{self.where}: the header needs a column {' or '.join(names)} besides {', '.join(self.heads)}"
            )
        name = self.column(names)
        table_input.check_rows(self.path, self.rows)
        if len(self.rows) < fewest:
            raise BadInput(
                f"{self.path!r} has too few points ({len(self.rows)}): a fit of branches needs at least {fewest}"
            )
        return name, names[name] * self.numbers(name)

    def has(self, names: Iterable[str]) -> bool:
        return any(name in names for name in self.heads)

    def rising(self, names: Mapping[str, float], what: str) -> Array:
        """Return times or frequencies, which must be above 0 and rise."""
        column, at = self.values(names)
        self.refuse(at <= 0, column, f"a {what} must be more than 0", at)
        fall = np.concatenate([[False], np.diff(at) <= 0])
        self.refuse(fall, column, f"each {what} must be greater than the one before: sort the rows, drop repeats", at)
        return at

    def one_value(self, names: Mapping[str, float], option: float | None, flag: str) -> float | None:
        """Return the value of a column whose values are all equal, or of an option; None if neither states it."""
        if not self.has(names):
            return option
        if option is not None:
            raise BadInput(f"{self.path!r} has a column of what {flag} states: leave {flag} out")
        column, values = self.values(names)
        unequal = np.abs(values - values[-1]) > HELD * abs(values[-1])
        self.refuse(unequal, column, f"must be held at {values[-1]:g}", values)
        return float(values[-1])


def misspelt(name: str, wanted: Iterable[str]) -> str | None:
    """Return the wanted name that is most like another one of the same unit and number of words; None without one.

    Neither another unit nor another quantity is a misspelling.

    >>> misspelt("nominal_stres_kPa", STRESS), misspelt("nominal_stress_psi", STRESS), misspelt("stress_kPa", STRESS)
    ('nominal_stress_kPa', None, None)
    """
    unit, words = name.rpartition("_")[2], name.split("_")

    def alike(other: str) -> bool:
        pairs = zip(words, other.split("_"), strict=False)
        same_length = len(words) == other.count("_") + 1
        return same_length and all(closest(one, [two]) for one, two in pairs) and other.endswith(f"_{unit}")

    return closest(name, [other for other in wanted if alike(other) or "_" not in name])


def kind_of(path: str) -> Kind:
    """Return the kind of a test, by the first words in the names of its columns."""
    table = _Table(path)
    rates = [name for name in table.heads if name.casefold().startswith(("frequency", "angular_frequency"))]
    times = [name for name in table.heads if name.casefold().startswith("time")]
    if rates and times:
        raise BadInput(
            f"{table.where}: columns {times[0]} and {rates[0]} belong to a relaxation test and a dynamic test: keep "
            "one of them"
        )
    return "dynamic" if rates else "relaxation" if times else "uniaxial"


# Uniaxial tests


def read_specimen(path: str) -> Specimen:
    """Read the uniaxial test in a CSV file: one column of `STRETCH` and one of `STRESS` or `TRUE_STRESS`."""
    table = _Table(path)
    if not table.heads:
        raise BadInput(f"{path!r} is empty: give a header, such as stretch,nominal_stress_MPa, and points")
    along, across = table.column(STRETCH), table.column(STRESS | TRUE_STRESS)
    offset, factor = STRETCH[along]
    stretch = offset + table.values({along: factor}, 1)[1]
    stress = table.values({across: (STRESS | TRUE_STRESS)[across]}, 1)[1]
    unit = ": check the column's unit"
    outside = (stretch < LOWEST) | (stretch > HIGHEST)
    table.refuse(outside, along, f"the stretch must lie between {LOWEST:g} and {HIGHEST:g}", stretch, unit)
    large = np.abs(stress) > MOST_STRESS
    table.refuse(large, across, f"the stress must lie within {MOST_STRESS:g} MPa", stress, f" MPa{unit}")
    if across in TRUE_STRESS:
        stress = stress / stretch
    if (stretch == 1).all():
        raise BadInput(f"{path!r} has no data at a stretch other than 1: a fit needs at least one point")
    for name, values in ((along, stretch), (across, stress)):
        if len(values) > 1 and values.min() == values.max():
            raise BadInput(f"{path!r}, column {name}: all {len(values)} values are equal: give a curve")
    wrong = (stretch - 1) * stress < 0
    far = wrong & (np.abs(stress) > WRONG_SIGN * np.abs(stress).max())
    if far.any() and not wrong.all():
        k = int(np.argmax(far))
        raise BadInput(
            f"{path!r}, line {table.rows[k][0]}: at a stretch of {stretch[k]:g} the nominal stress is {stress[k]:g} "
            "MPa: tension must be positive and compression negative in both columns"
        )
    _check_strain(path, along, stretch, stress)
    return Specimen(stretch, stress, across)


def _check_strain(path: str, column: str, stretch: Array, stress: Array) -> None:
    """Refuse strains that give the modulus of no silicone, but would give one if they were fractions or percent.

    The modulus is that of the neo-Hookean law through all points: stress = E / 3 (stretch - stretch^-2).
    """
    if column not in SAME_WORD:
        return
    offset, factor = STRETCH[column]
    otherwise = offset + STRETCH[SAME_WORD[column]][1] / factor * (stretch - offset)
    if not (otherwise > 0).all():
        return
    unit = [(at - at**-2.0) / 3 for at in (stretch, otherwise)]
    stated, other = (float(x @ stress / (x @ x)) for x in unit)
    low, high = SILICONE_E
    if not low <= stated <= high and low <= other <= high:
        raise BadInput(
            f"{path!r}, column {column}: with these strains E would be about {stated:.3g} MPa, beyond the range of "
            f"silicones, {low:g} to {high:g} MPa, and about {other:.3g} MPa if they were those of a column "
            f"{SAME_WORD[column]}: call the column strain if 0.1 is 10 %, strain_percent if 10 is 10 %, or give a "
            "column stretch"
        )


# Relaxation tests and dynamic tests


def read(path: str, nu: float, stretch: float | None = None, ramp: float | None = None) -> Test:
    """Read the relaxation test or dynamic test in a CSV file; stretch and ramp, s, are for a file without them."""
    table = _Table(path)
    return _dynamic(table, nu) if kind_of(path) == "dynamic" else _relaxation(table, nu, stretch, ramp)


def _youngs(column: str, nu: float) -> float:
    return 2 * (1 + nu) if column.startswith("shear") else 1.0


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
    ramp = table.one_value(RAMP, ramp, "--ramp")
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
        _check_strain(table.path, table.column(STRETCH), np.full(len(stress), held), stress)
    # mu (stretch - stretch^-2), the neo-Hookean law, with E = 2 (1 + nu) mu
    return Test("relaxation", at, 2 * (1 + nu) / (held - held**-2.0) * stress, column, ramp=ramp)


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


def _held_stretch(table: _Table, option: float | None) -> float | None:
    held = option
    if table.has(STRETCH):
        strain = table.one_value({name: factor for name, (_, factor) in STRETCH.items()}, None, "--stretch")
        held = None if strain is None else STRETCH[table.column(STRETCH)][0] + strain
        if option is not None:
            raise BadInput(f"{table.path!r} has a column of the held stretch: leave --stretch out")
    if held is not None and not (LOWEST <= held <= HIGHEST and held != 1):
        raise BadInput(f"the held stretch must lie between 0.05 and 20 and differ from 1; got {held:g}")
    return held
