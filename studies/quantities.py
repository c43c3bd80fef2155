"""What studies answer: each quantity is declared here, and nowhere else.

A quantity has columns, its *parts*: components of a vector, or numbers that are asked for together. Name and unit of
a part make its column, words and unit the title of its axis. From the list follow the columns of tables, files and
JSON, the names that messages and help state, the figures, and the README's row. There are three kinds:

- of the response: force and pose, which every model answers (`geometry.loads.Response`);
- *stored*: a value that the finite elements leave beside the response, in the dimensionless form in which the store
  keeps it, and the exponents of E and D that turn it into its unit. A new one is an attribute of `fem.solution.Facts`
  and a row here; states that were stored without it are solved again when it is asked for;
- *derived*: a function of the fields and the other answers of one model. A new one is a row here.

A quantity with a `path` has a solve of its own (`studies.mechanics.path_solver`). The parts of readings follow from
the layout (`reading_parts`); here is the one that figures show.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeVar

if TYPE_CHECKING:
    from geometry.arrays import Array

UNITS = {
    "1": "", "percent": "%", "mm": "mm", "um": "µm", "mm2": "mm²", "mm3": "mm³", "deg": "°", "rad": "rad", "N": "N",
    "mN": "mN",
    "MPa": "MPa", "mJ": "mJ", "N/mm": "N/mm", "kg/m3": "kg/m³", "mm/s": "mm/s", "Hz": "Hz", "s": "s", "ms": "ms",
    "us": "µs", "K": "K",
    "degC": "°C", "percent/K": "%/K",
    "T": "T", "mT": "mT", "uT": "µT", "V": "V", "V/T": "V/T", "V/sqrt(Hz)": "V/√Hz", "MB": "MB",
}  # fmt: skip
"""Units by their names, as people read them; the only table of its kind. Those that files of users may state are in
`studies.inputs`."""
FACTORS = {
    "percent": 100.0, "percent/K": 100.0, "um": 1e3, "deg": 180.0 / math.pi, "mN": 1e3, "mT": 1e3, "uT": 1e6,
    "ms": 1e3, "us": 1e6,
}  # fmt: skip
"""Factors to units in which people read what is kept as a fraction, in mm, rad, N, T or s."""
Number = TypeVar("Number", float, "Array")
Path = Literal["critical depth", "modes", "response", "cycle"]


def column_name(name: str, unit: str) -> str:
    """Return the name of a column with its unit.

    >>> column_name("force", "N"), column_name("nu", "1"), column_name("L/D", "1"), column_name("stiffness", "N/mm")
    ('force_N', 'nu', 'L_over_D', 'stiffness_N_per_mm')
    """
    return "_".join(filter(None, (name.replace("/", "_over_"), column_unit(unit))))


def column_unit(unit: str) -> str:
    """Return a unit as the last part of a column's name.

    >>> column_unit("1"), column_unit("mm"), column_unit("V/sqrt(Hz)")
    ('', 'mm', 'V_per_sqrtHz')
    """
    return "" if unit == "1" else unit.replace("/", "_per_").replace("sqrt(Hz)", "sqrtHz")


def shown(value: Any, unit: str = "1", digits: int = 3, nothing: str = "-") -> str:
    """Return a value as text: a number with so many significant digits and its unit, and a text for no value.

    unit : in which it is read, one of `UNITS`; the value is a fraction, or in the unit in which magtip computes.

    >>> shown(0.0123456, "percent"), shown(0.0012, "mN"), shown(1234.5, "Hz"), shown(math.pi / 6, "deg")
    ('1.23 %', '1.2 mN', '1234 Hz', '30°')
    >>> shown(0.123456789, digits=5), shown([2.0, -0.0, None]), shown(True), shown(math.nan, "N", nothing="unknown")
    ('0.12346', '2, 0, -', 'yes', 'unknown')
    """
    symbol = UNITS[unit] if unit == "deg" else f" {UNITS[unit]}".rstrip()
    if isinstance(value, (list, tuple)):
        return ", ".join(shown(each, unit, digits, nothing).removesuffix(symbol) for each in value) + symbol
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or value == "" or value != value:
        return nothing
    value = value * FACTORS[unit] if unit in FACTORS else value
    # no zero has a sign
    text = f"{value + 0.0:.{digits}g}" if isinstance(value, float) else str(value)
    if unit != "1" and "e+0" in text and abs(value) < 1e6:
        text = f"{value:.0f}"
    return text + symbol


def estimate_column(name: str) -> str:
    """Return the column of an estimated error: that of the force, which all models with errors state, has no name.

    >>> estimate_column("force"), estimate_column("shift")
    ('error_estimate', 'shift_error_estimate')
    """
    return "error_estimate" if name == "force" else f"{name}_error_estimate"


@dataclass(frozen=True, slots=True)
class Part:
    """A number of a quantity, with a column for each model.

    Attributes
    ----------
    words : what it is, for titles of axes.
    drawn : whether figures of a sweep show it.
    estimate : name of its estimated relative error (`fem.solution.Estimates`); those of force and shift are errors of
        the vectors.
    error : first part of the column of its error against the reference; default: its name.
    along_shear : whether a beam that gave way has no error of it.
    stored : key of the stored value.
    half_width : key of the stored half width, which has a column too.
    of_change : whether its error is relative to its change from rest.
    factor, scale : on the stored value, and exponents of E, MPa, and D, mm.
    """

    name: str
    unit: str
    words: str
    drawn: bool = True
    estimate: str = ""
    error: str = ""
    along_shear: bool = False
    stored: str = ""
    half_width: str = ""
    factor: float = 1.0
    scale: tuple[int, int] = (0, 0)
    of_change: bool = False

    @property
    def column(self) -> str:
        """Name of its column, behind that of the model."""
        return column_name(self.name, self.unit)

    @property
    def title(self) -> str:
        """Title of an axis.

        >>> Part("loop_gap", "percent", "gap of the loop").title, Part("nu", "1", "Poisson's ratio").title
        ('gap of the loop (%)', "Poisson's ratio")
        """
        return f"{self.words} ({UNITS[self.unit]})" if UNITS[self.unit] else self.words

    @property
    def estimate_column(self) -> str:
        """Name of the column of its estimated error, behind that of the model."""
        return estimate_column(self.name if self.stored else self.estimate)

    @property
    def error_column(self) -> str:
        """Name of the column of its error against the reference, behind that of the model."""
        return f"{self.error or self.name}_error_percent{'_of_change' * self.of_change}"

    def scaled(self, values: Number, E: Number, D: Number) -> Number:
        """Return stored values in the unit of the part."""
        return self.factor * values * E ** self.scale[0] * D ** self.scale[1]


@dataclass(frozen=True, slots=True)
class Quantity:
    """What can be asked for, with its parts; the first part is always shown, others where loads act sideways.

    Attributes
    ----------
    usual : whether studies that name no quantities have it; `sideways`: if loads act sideways.
    of_sensor : whether it needs no load.
    solved : whether only finite elements that are solved answer it, not the surrogate.
    response : places of its parts in the nine numbers of a response: force, shift, tilt, tilt_y, contact radius.
    derive : returns the values of the only part from columns of fields and of the model's answers, shape (n,) each.
    """

    name: str
    parts: tuple[Part, ...]
    usual: Literal["", "always", "sideways"] = ""
    path: Path | None = None
    of_sensor: bool = False
    solved: bool = False
    response: tuple[int, ...] = ()
    derive: Callable[[Mapping[str, Array]], Array] | None = None

    @property
    def compared(self) -> bool:
        """Whether all models answer it, from their responses."""
        return bool(self.response or self.derive)

    def derived(self, of: Mapping[str, Array]) -> Array:
        """Return the values that follow from columns of fields and answers, shape (n,), NaN where none exists."""
        import numpy as np

        assert self.derive is not None
        with np.errstate(divide="ignore", invalid="ignore"):
            found = self.derive(of)
        return np.where(np.isfinite(found), found, np.nan)

    @property
    def of_states(self) -> bool:
        """Whether it is derived, or stored beside the response of a state."""
        return bool(self.derive) or (self.path is None and any(part.stored for part in self.parts))


def _stiffness(of: Mapping[str, Array]) -> Array:
    return of["force_N"] / of["depth_mm"]


_LIST = (
    Quantity(
        "force",
        (
            Part("force", "N", "press force", estimate="force"),
            Part("force_x", "N", "force along the shear", estimate="sideways", along_shear=True),
            Part("force_y", "N", "force along y", drawn=False, estimate="sideways", along_shear=True),
        ),
        response=(2, 0, 1),
        usual="always",
    ),
    Quantity(
        "shift",
        (
            Part("shift_z", "mm", "vertical motion of the magnet", estimate="shift", error="shift"),
            Part("shift_x", "mm", "sideways motion of the magnet", estimate="shift", along_shear=True),
            Part("shift_y", "mm", "motion of the magnet along y", drawn=False, estimate="shift", along_shear=True),
        ),
        response=(5, 3, 4),
        usual="always",
    ),
    Quantity(
        "tilt",
        (
            Part("tilt", "rad", "tilt", estimate="tilt", along_shear=True),
            Part("tilt_y", "rad", "tilt towards y", drawn=False, estimate="tilt", along_shear=True),
        ),
        response=(6, 7),
        usual="sideways",
    ),
    Quantity(
        "contact_radius", (Part("contact_radius", "mm", "contact radius", drawn=False),), "always", response=(8,)
    ),
    Quantity(
        "strain",
        (
            Part(
                "largest_strain",
                "percent",
                "strain of 99.9 % of the silicone",
                stored="largest_strain",
                factor=100.0,
                estimate="strain",
            ),
        ),
    ),
    Quantity(
        "contact_pressure",
        (
            Part(
                "contact_pressure",
                "MPa",
                "largest contact pressure",
                estimate="pressure",
                stored="contact_pressure",
                scale=(1, 0),
            ),
        ),
        solved=True,
    ),
    Quantity(
        "sideways_stiffness",
        (
            Part(
                "sideways_stiffness_ratio",
                "1",
                "sideways stiffness over that of the unpressed beam",
                stored="sideways_stiffness_ratio",
                half_width="sideways_half_width",
            ),
        ),
        solved=True,
    ),
    Quantity(
        "stiffness",
        (Part("stiffness", "N/mm", "press force over depth"),),
        derive=_stiffness,
    ),
    Quantity("readings", (Part("S1", "V", "output of S1"),), usual="always"),
    Quantity(
        "decoded_force_error",
        (
            Part("decoded_force", "N", "decoded press force", drawn=False),
            Part("decoded_force_error", "N", "error of the decoded force", drawn=False),
            Part("decoded_force_error", "percent", "error of the decoded force", drawn=False),
        ),
        solved=True,
    ),
    Quantity(
        "critical_depth",
        (
            Part(
                "critical_depth",
                "mm",
                "critical depth",
                stored="critical_depth_over_D",
                scale=(0, 1),
                estimate="depth",
            ),
            Part("critical_force", "N", "critical force", False, stored="critical_force_over_ED2", scale=(1, 2)),
            Part(
                "stable_to", "mm", "depth down to which it is stable", False, stored="stable_to_over_D", scale=(0, 1)
            ),
        ),
        path="critical depth",
        of_sensor=True,
    ),
    Quantity(
        "modes",
        (
            Part("mode1", "Hz", "first natural frequency"),
            Part("mode2", "Hz", "second natural frequency", drawn=False),
            Part("mode3", "Hz", "third natural frequency", drawn=False),
        ),
        path="modes",
        of_sensor=True,
    ),
    Quantity(
        "response",
        (
            Part("response_gain", "1", "gain of the magnet's shift per N"),
            Part("response_phase", "deg", "phase of the magnet's shift per N", drawn=False),
            Part("response_bandwidth", "Hz", "-3 dB bandwidth per N"),
            Part("response_resonance", "Hz", "first resonance per N"),
            Part("response_Q", "1", "quality factor of the first resonance per N", drawn=False),
        ),
        path="response",
    ),
    Quantity(
        "cycle",
        (
            Part("loop_gap", "percent", "gap of the loop at mid-stroke, of full scale", stored="gap_percent"),
            Part("loop_area", "mJ", "area of the loop", drawn=False, stored="area_over_ED3", scale=(1, 3)),
            Part("loop_largest_force", "N", "largest force", drawn=False, stored="largest_over_ED2", scale=(1, 2)),
        ),
        path="cycle",
    ),
)
QUANTITIES = {each.name: each for each in _LIST}
"""Quantities by name, in the order of their columns."""


def reading_parts(elements: Iterable[str], unit: str) -> tuple[Part, ...]:
    """Return the parts of the readings of a layout: field and output of each element, one after the other.

    >>> [part.column for part in reading_parts(["S1"], "V")], [part.column for part in reading_parts(["chip x"], "T")]
    (['S1_mT', 'S1_V'], ['chip_x_mT', 'chip_x_output_mT'])
    """
    named = [element.replace(" ", "_") for element in elements]
    return tuple(
        part
        for name in named
        for part in (
            Part(name, "mT", f"field at {name}", of_change=True),
            Part(name if unit == "V" else f"{name}_output", unit if unit == "V" else "mT", f"output of {name}"),
        )
    )


def drawn_parts() -> dict[str, Part]:
    """Return the parts that figures of a sweep show, by their columns."""
    return {part.column: part for each in QUANTITIES.values() for part in each.parts if part.drawn}


def response_columns(numbers: Sequence[Number]) -> dict[str, Number]:
    """Return the nine numbers of a response by their columns.

    >>> list(response_columns(range(9)))[:5]
    ['force_N', 'force_x_N', 'force_y_N', 'shift_z_mm', 'shift_x_mm']
    """
    answered = [each for each in QUANTITIES.values() if each.response]
    places = [(part.column, k) for each in answered for part, k in zip(each.parts, each.response, strict=True)]
    return {column: numbers[k] for column, k in places}


def derived_columns(of: Mapping[str, Array]) -> dict[str, Array]:
    """Return the derived quantities of cases by their columns, from those of fields and of a model's answers."""
    return {each.parts[0].column: each.derived(of) for each in QUANTITIES.values() if each.derive}


def stored_parts() -> list[Part]:
    """Return the parts that a state holds beside its response."""
    return [part for part in state_parts() if part.stored]


def state_parts() -> list[Part]:
    """Return the parts that a state holds beside its response, and those that are derived."""
    return [part for each in QUANTITIES.values() if each.of_states for part in each.parts]


def stored_values(names: Iterable[str]) -> tuple[str, ...]:
    """Return the keys of the values that a state holds for quantities: attributes of `fem.solution.Facts`."""
    asked = [part for name in names for part in QUANTITIES[name].parts]
    return tuple(part.stored for part in stored_parts() if part in asked)


def choice() -> str:
    """Return the names of all quantities, and those that are usual, in a sentence for help."""
    usual, sideways = (
        ", ".join(name for name, each in QUANTITIES.items() if each.usual == when) for when in ("always", "sideways")
    )
    return f"Any of {', '.join(QUANTITIES)}; default: {usual}, and {sideways} if a load acts sideways."
