"""Requirements of a sensor, read from a TOML file, for `magtip size`, and the criteria by which sensors are rated.

A requirement is a field of `Requirements` with its unit, bounds, words and a value for the example. One that bounds
what a sensor reaches has a `Criterion`: the value that is held against its bound, as a function of the figures of n
sensors. Keys of files, `example`, margins, conflicts, yield, tables and pages follow from these rows.

Input that cannot be used raises a `BadInput` here, whose message is one sentence with the remedy.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from analytic.parts import CONVERTER_NOISE, CONVERTER_STEP
from geometry.arrays import Array
from geometry.base import Base
from geometry.design import BadInput, Design
from geometry.fabrication.printability import PROCESSES
from geometry.hall_chips import CIRCLES
from studies.inputs.units import quantity
from studies.inputs.user_input import check_keys, checked, fabrication_of, table_beside, toml_table
from studies.output.literals import literal
from studies.quantities import FACTORS

CONVERTER_RATE = 80e3
"""Values of three channels a second, Hz: the NI 9205 has 250 kS/s for all of its channels."""
VERSION = 1
"""Newest version of the format of requirements."""
CATALOGUES = ("magnets", "hall_parts", "silicones")
"""Kinds of parts, each with a shipped catalogue."""
OBJECTIVES = ("range", "resolution", "size")
"""What the search improves, and the ranking weighs."""
MOST_SAMPLES = int(next(spec for spec in dataclasses.fields(Design) if spec.name == "hall_average").metadata["high"])
"""Largest number of averaged readings of a design."""
LIGHTEST = 0.25
"""Lightest press that counts, over the required one."""
LEAST_SLENDERNESS = 0.75
"""Least L/D of the beams that the search considers."""

SINGULAR = 1e-9
"""Least determinant of the slopes of the readings, over the lengths of its columns, that counts as not zero."""
LEAST_CHIPS = 3
"""Least number of 3-axis chips that tell an ambient field from a pose (`analytic.inverse.ambient_field`)."""
MOST = 1.0
"""Largest margin: more than twice a bound is no better."""
Figures = Mapping[str, Array]
"""Figures of n sensors by name, each of shape (n,), NaN where unknown: see `sizing.candidate_performance`."""


@dataclass(frozen=True, slots=True)
class Criterion:
    """What a requirement asks of the figures of n sensors.

    Attributes
    ----------
    way : 1 if the value must be at least the bound, -1 if it must be at most the bound.
    words : what the value is, in tables.
    value : a figure, or a function of figures and requirements, shape (n,), in the unit of the requirement.
    margin : the signed margin where it is not that of the value, relative to the bound.
    level : bound of a requirement that has no number.
    gives : whether advice may loosen the bound.
    varies : whether the value differs between made sensors of one design.
    softest : whether it is worst at the least E, whatever the load.
    worst : the figure at whose worst load a value that is a function is worst.
    name, unit : of the requirement, and the unit in which values are shown (`studies.quantities.UNITS`).
    """

    way: int
    words: str
    value: str | Callable[[Figures, Requirements], Array]
    margin: Callable[[Figures, Requirements], Array] | None = None
    level: float | None = None
    gives: bool = True
    varies: bool = True
    softest: bool = False
    worst: str = ""
    name: str = ""
    unit: str = "1"

    @property
    def figure(self) -> str:
        """The figure that is the value, "" for a function."""
        return self.value if isinstance(self.value, str) else ""

    @property
    def factor(self) -> float:
        """The value in the shown unit over that in the unit of the requirement."""
        return FACTORS.get(self.unit, 1.0)

    def value_of(self, of: Figures, needed: Requirements) -> Array:
        """Return the value of n sensors, NaN where it is unknown."""
        return of[self.value] if isinstance(self.value, str) else self.value(of, needed)

    def margin_of(self, of: Figures, needed: Requirements, bound: float) -> Array:
        """Return the signed margin of n sensors, negative where the bound is missed."""
        if self.margin is not None:
            return self.margin(of, needed)
        value = self.value_of(of, needed)
        return np.asarray(self.way * (value / bound - 1) if bound else self.way * value)


at_least, at_most = partial(Criterion, 1), partial(Criterion, -1)


def _of_press(of: Figures, needed: Requirements) -> Array:
    reached = np.where(of["range_z"] > 0, of["range_z"] / needed.force_z, np.nan)
    return np.asarray(np.minimum(np.fmax(of["reach"], reached) - 1, MOST))


def _of_decoding(of: Figures, needed: Requirements) -> Array:
    return np.asarray(np.minimum(of["decoding"] - SINGULAR, of["distinct"] - 1))


def _of_ambient(of: Figures, needed: Requirements) -> Array:
    change = needed.ambient_change
    # no field moves no force, also where a field would move it without a bound
    return np.asarray(of["ambient"] * change) if change else np.where(np.isnan(of["ambient"]), np.nan, 0.0)


def _of_neighbours(of: Figures, needed: Requirements) -> Array:
    return np.asarray((of[f"neighbours_{needed.decoder}"] + of["magnets"]) / needed.force_z)


def _key(default: Any, text: str, example: str = "", *, unit: str = "1", **more: Any) -> Any:
    """Return a field: its words, a value for the example, and maybe the unit `shown` and a `criterion`."""
    return field(default=default, metadata={"text": text, "example": example, "unit": unit, **more})


def _number(
    unit: str, low: float, high: float, text: str, example: str = "", *, default: Any = None, **more: Any
) -> Any:
    return _key(default, text, example, unit=unit, low=low, high=high, **more)


@dataclass(frozen=True, slots=True, kw_only=True)
class Requirements:
    """What a sensor must reach; None where a requirement is not set. Units: N, mm, Hz, V; strains are fractions.

    The required loads are presses up to `force_z`, from a quarter of it on or from `least_press`, whichever is less,
    and under each press from `least_press` on all forces along the plate up to `force_x`, in any direction. A load
    outside, such as one that needs more friction, never counts.

    The fields say what they are; `example()` has them all. A resolution is that at the worst pose of the range, a
    strain the largest principal nominal one (stretch - 1), and the stability margin is always a hard bound.
    `least_yield` counts in the ranking, not in the search. Names of parts are empty for all parts.

    >>> Requirements(force_z=5.0, resolution_z=6.0)
    Traceback (most recent call last):
        ...
    geometry.bad_input.BadInput: resolution_z must be below the range force_z = 5 N; got 6 N
    """

    # fmt: off
    force_z: float = _number(
        "N", 1e-3, 1e4, "normal force of the press", '"5 N"', default=dataclasses.MISSING, criterion=
        at_least("press force", lambda of, needed: of["reach"] * needed.force_z, margin=_of_press, softest=True))
    force_x: float | None = _number(
        "N", 1e-3, 1e4, "force along the plate, in any direction", '"2 N"', criterion=
        at_least("force along the plate", lambda of, needed: of["reach_x"] * needed.bound("force_x"),
                 margin=lambda of, _: of["reach_x"] - 1))
    friction: float = _number("1", 0.01, 10, "friction of the plate", "0.8", default=0.8)
    press_with_shear: float | None = _number(
        "N", 1e-3, 1e4, "least press under which force_x is needed; default: force_x / friction", '"2.5 N"')
    range_cap: float | None = _number(
        "1", 1, 1000, "loads beyond so many times the required ones have no value; default: none", "3")
    resolution_z: float | None = _number(
        "N", 1e-9, 1e4, "standard deviation of the decoded force in z at the worst load", '"50 mN"', shown="mN",
        criterion=at_most("resolution in z", "resolution_z"))
    resolution_x: float | None = _number(
        "N", 1e-9, 1e4, "standard deviation of the decoded force in x and y at the worst load", '"50 mN"', shown="mN",
        criterion=at_most("resolution in x and y", "resolution_x"))
    largest_strain: float | None = _number(
        "1", 0.01, 5.0, "largest strain of the silicone, under any load", '"100 %"', shown="percent",
        criterion=at_most("largest strain", "strain"))
    drift_per_K: float | None = _number(
        "1", 1e-7, 1.0, "change of the decoded forces per K, over full scale", '"2 %"', shown="percent",
        criterion=at_most("drift of the forces per K, of full scale", "drift"))
    ambient_error: float | None = _number(
        "N", 1e-9, 1e4, "error of the decoded force by a uniform field, after a turn", '"20 mN"', shown="mN",
        criterion=at_most("error by a uniform field", _of_ambient, worst="ambient"))
    ambient_field: float = _number(
        "T", 0, 1e-2, "of ambient_error; default: that of the earth at most places", '"50 uT"', default=50e-6)
    ambient_turn: float = _number(
        "deg", 0, 180, "by which the sensor turns after taring; 60 for a field that comes after taring", '"180 deg"',
        default=180.0)
    reject_ambient: bool = _key(
        False, "decode a uniform field along with the pose, where a sensor has three chips", "false")
    temperature_error: float | None = _number(
        "N", 1e-9, 1e4, "error of the decoded force by temperature_change, untared", '"1 N"', shown="mN",
        criterion=at_most("error by the temperature",
                          lambda of, needed: of["warming"] * needed.temperature_change, worst="warming"))
    temperature_change: float = _number("K", 0.01, 200, "of temperature_error", '"10 K"', default=10.0)
    hysteresis: float | None = _number(
        "1", 1e-4, 1.0, "gap of loading and unloading at mid-stroke, over full scale", '"10 %"', shown="percent",
        criterion=at_most("hysteresis of a press, of full scale", "hysteresis"))
    speed: float | None = _number("mm/s", 1e-6, 1e6, "speed of the plate, for hysteresis", '"1 mm/s"')
    stability_margin: float = _number(
        "1", 1, 100, "critical depth over the depth of the whole press", "1.2", default=1.0, criterion=
        at_least("critical depth over depth", lambda of, _: of["stable_to"] / of["depth"], softest=True))
    first_mode: float | None = _number(
        "Hz", 0.1, 1e5, "lowest natural frequency of the unloaded sensor", '"50 Hz"',
        criterion=at_least("first mode", "first_mode", softest=True))
    bandwidth: float | None = _number(
        "Hz", 1e-3, 1e6, "of the readings (-3 dB), of which twice as many come a second", '"100 Hz"',
        criterion=at_least("bandwidth of the readings", "bandwidth", gives=False, varies=False))
    outer_size: float | None = _number(
        "mm", 0.1, 1000, "diameter or side of the base", '"20 mm"',
        criterion=at_most("outer size", "outer_size", varies=False))
    height: float | None = _number(
        "mm", 0.1, 5000, "from the underside of the base to the tip", '"30 mm"',
        criterion=at_most("height", "height", varies=False))
    pitch: float | None = _number(
        "mm", 0.5, 500, "of the beams of an array, on one base with 3-axis chips; default: one beam", '"12 mm"',
        criterion=at_most("room that a beam needs in the array", "room", varies=False))
    cross_talk: float | None = _number(
        "1", 1e-6, 0.9, "largest error of the force by the loads of the neighbours, over force_z", '"5 %"',
        shown="percent", criterion=at_most("cross-talk, of the required press", _of_neighbours, varies=False))
    decoder: Literal["ignoring", "subtracting", "jointly"] = _key(
        "subtracting", "of the array, for cross_talk: neighbours are ignored, subtracted once (as firmware does), or "
        "decoded jointly (as magtip stream does)", '"subtracting"')
    polarity: Literal["any", "up", "checkerboard", "rows"] = _key(
        "any", "which way up the magnets of an array lie; any: the one with the least cross-talk", '"any"')
    least_yield: float | None = _number(
        "1", 0.01, 0.99, "least share of made sensors that meet all the others", '"90 %"', shown="percent")
    D_low: float | None = _number("mm", 0.1, 200, "least diameter")
    D_high: float | None = _number("mm", 0.1, 200, "largest diameter")
    wall: float | None = _number(
        "mm", 0.05, 10, "thinnest printed wall or pin; default: that of the process", '"0.5 mm"',
        criterion=at_least("thinnest wall", "wall", varies=False))
    no_saturation: bool = _key(
        True, "no reading reaches a rail", "true", shown="percent",
        criterion=at_least("distance from the rail", "saturation", level=0.0))
    unique_decoding: bool = _key(
        True, "no two loads have the same readings", "true",
        criterion=at_least("readings apart, over noise", "distinct", margin=_of_decoding, level=1.0))
    converter_noise: float = _number(
        "V", 0, 1, "noise (rms) of the converter of one-axis parts; default: NI 9205", '"0.244 mV"',
        default=CONVERTER_NOISE)
    converter_step: float = _number(
        "V", 0, 1, "step of the converter; default: NI 9205", '"0.305 mV"', default=CONVERTER_STEP)
    converter_rate: float = _number(
        "Hz", 1e-3, 1e7, "values of all one-axis parts a second; default: NI 9205", '"80 kHz"',
        default=CONVERTER_RATE)
    samples: int = _key(1, "values of which a reading is the average; fewer where a part has not so many", "16")
    chips: int = _key(1, "largest number of 3-axis chips of a sensor, up to 4", "3")
    outer_shape: Literal["round", "square"] = _key("round", "outline of the base, round or square", '"round"')
    screws: bool = _key(True, "holes for four screws in a square base", "true")
    process: Literal["fdm", "sla"] = _key("fdm", "process that prints mould and base, sla or fdm", '"sla"')
    catalogues: tuple[str, ...] = _key((), "catalogues of the user, see `magtip catalogue`", '["my_parts.toml"]')
    shipped: tuple[str, ...] = _key(CATALOGUES, "shipped catalogues in use; default: all three", '["magnets"]')
    magnets: tuple[str, ...] = _key((), "names of the magnets in use; default: all of the catalogues", '["4x2 N35"]')
    hall_parts: tuple[str, ...] = _key((), "names of the Hall parts in use; default: all", '["SS495A"]')
    silicones: tuple[str, ...] = _key((), "names of the silicones in use; default: all", '["Dragon Skin 30"]')
    seed: int = _key(0, "seed of the search", "0")
    weight_range: float = _key(1.0, "weight of the range in the ranking")
    weight_resolution: float = _key(1.0, "weight of the resolution in the ranking")
    weight_size: float = _key(1.0, "weight of the outer size in the ranking")
    # fmt: on

    @property
    def rated(self) -> tuple[float, float]:
        """Largest press force, and force along the plate, N."""
        return self.force_z, self.force_x or 0.0

    def __post_init__(self) -> None:
        for name, spec in LIMITS.items():
            value = getattr(self, name)
            if value is not None:
                low, high = spec.metadata["low"], spec.metadata["high"]
                object.__setattr__(self, name, quantity(name, value, spec.metadata["unit"], low, high))
        if not 1 <= self.samples <= MOST_SAMPLES:
            raise BadInput(f"samples must lie between 1 and {MOST_SAMPLES}; got {self.samples}")
        if not 1 <= self.chips <= max(CIRCLES):
            raise BadInput(f"chips must lie between 1 and {max(CIRCLES)}; got {self.chips}")
        if self.seed < 0:
            raise BadInput(f"seed must be 0 or more; got {self.seed}")
        weights = {name: getattr(self, f"weight_{name}") for name in OBJECTIVES}
        for name, weight in weights.items():
            quantity(f"weights: {name}", weight, "1", 0.0, 1e6)
        if not any(weights.values()):
            raise BadInput("weights: all are 0, so that nothing ranks the variants: give one of them a value above 0")
        self._check_together()

    def _check_together(self) -> None:
        """Raise BadInput for requirements that no sensor can meet, whatever its parts."""
        for axis in ("z", "x"):
            force, resolution = getattr(self, f"force_{axis}"), getattr(self, f"resolution_{axis}")
            if resolution is None:
                continue
            if force is None:
                raise BadInput(
                    f"resolution_{axis} = {resolution:g} N needs a range: add force_{axis}, or leave it out"
                )
            if not resolution < force:
                raise BadInput(
                    f"resolution_{axis} must be below the range force_{axis} = {force:g} N; got {resolution:g} N"
                )
        if self.hysteresis is not None and self.speed is None:
            raise BadInput('hysteresis needs the speed of the plate: add it, such as speed = "1 mm/s"')
        if self.cross_talk is not None and self.pitch is None:
            raise BadInput('cross_talk is that of an array, and needs its pitch: add it, such as pitch = "12 mm"')
        least, named = self.least_press, self.press_with_shear
        if named is not None and self.force_x is None:
            raise BadInput("press_with_shear needs force_x, the force along the plate: add it, or leave it out")
        if named is not None and self.force_x is not None and not named * self.friction >= self.force_x * (1 - 1e-9):
            raise BadInput(
                f"press_with_shear must be at least force_x / friction = {self.force_x / self.friction:g} N, or the "
                f"plate slips; got {named:g} N"
            )
        if not least <= self.force_z:
            raise BadInput(
                f"force_x needs a press of {least:g} N, above force_z = {self.force_z:g} N: lower force_x, or raise "
                "friction or force_z"
            )
        low, high = self.D_low, self.D_high
        if low is not None and high is not None and not low <= high:
            raise BadInput(f"D: the range must be [low, high] with low <= high; got {low:g} and {high:g} mm")
        least = low or 0.0
        if self.pitch is not None and not self.pitch > least:
            raise BadInput(f"beams overlap: pitch must exceed the diameter D = {least:g} mm; got {self.pitch:g} mm")
        if self.outer_size is not None and not self.outer_size >= least:
            raise BadInput(f"outer_size must be at least the diameter D = {least:g} mm; got {self.outer_size:g} mm")
        if self.height is not None and not self.height > LEAST_SLENDERNESS * least:
            raise BadInput(
                f"height must exceed {LEAST_SLENDERNESS:g} D = {LEAST_SLENDERNESS * least:g} mm, the length of the "
                f"shortest beam; got {self.height:g} mm"
            )

    @property
    def least_press(self) -> float:
        """Least press under which the whole force along the plate is needed, N; 0 where none is required."""
        return self.press_with_shear or (self.force_x or 0.0) / self.friction

    def loads(self, *, dense: bool = False) -> Array:
        """Return the loads at which candidates are rated, normal force and force along the plate, shape (k, 2), N.

        They are the corners and the middle, first those without a force along the plate.

        >>> Requirements(force_z=10.0, force_x=4.0).loads().tolist()
        [[2.5, 0.0], [5.0, 0.0], [10.0, 0.0], [5.0, 4.0], [7.5, 4.0], [10.0, 4.0]]
        """
        top, least, force_x = self.force_z, self.least_press, self.force_x
        light = LIGHTEST * top if force_x is None else min(LIGHTEST * top, least)
        presses = np.linspace(light, top, 5) if dense else np.array([light, max(top / 2, light), top])
        pure = [(press, 0.0) for press in presses.tolist()]
        if force_x is None:
            return np.array(pure)
        shares = (1 / 3, 2 / 3, 1.0) if dense else (1.0,)
        sheared = [(press, share * force_x) for press in np.linspace(least, top, 3).tolist() for share in shares]
        return np.array([*pure, *sheared])

    @property
    def ambient_change(self) -> float:
        """Change of a uniform field by the turn, T: it changes by the chord."""
        return float(self.ambient_field * 2 * np.sin(np.radians(self.ambient_turn) / 2))

    @property
    def fewest_chips(self) -> int:
        """Least number of 3-axis chips with which an ambient field is told from a pose: the beams of an array that is
        decoded jointly have one field in common."""
        return 2 if self.pitch is not None and self.decoder == "jointly" else LEAST_CHIPS

    @property
    def base(self) -> Base:
        """The base; a round one has no holes for screws."""
        return Base(shape=self.outer_shape, screw=None if self.screws else 0.0)

    @property
    def printed_wall(self) -> float:
        """Thinnest wall or pin of mould and base, mm; default: what the process prints."""
        return PROCESSES[self.process].detail if self.wall is None else self.wall

    def bound(self, name: str) -> float:
        """Return the value of a requirement that is set."""
        return float(self.printed_wall if name == "wall" else getattr(self, name))

    def criteria(self) -> list[tuple[Criterion, float]]:
        """Return what is required of the figures of a sensor, each with its bound."""
        found = []
        for name, each in CRITERIA.items():
            value = self.printed_wall if name == "wall" else getattr(self, name, True)
            if value is not None and value is not False:
                found.append((each, value if each.level is None else each.level))
        return found

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each requirement: its value, unit and whether it is set, a default, or unset.

        >>> [(row["requirement"], row["value"]) for row in Requirements(force_z=5.0).rows() if row["state"] == "set"]
        [('force_z', 5.0)]
        """
        rows = []
        for spec in (*LIMITS.values(), *SWITCHES):
            value = getattr(self, spec.name)
            state = "unset" if value is None else "default" if value == spec.default else "set"
            if spec.name == "press_with_shear" and value is None and self.force_x is not None:
                value, state = self.least_press, "default"
            about = {"unit": spec.metadata["unit"], "state": state, "meaning": spec.metadata["text"]}
            rows.append({"requirement": spec.name, "value": value, **about})
        return rows

    def warnings(self) -> list[str]:
        """Return one sentence for each requirement that is set, but probably not meant so."""
        resolution = self.resolution_z is not None or self.resolution_x is not None
        text = (
            "bandwidth is not set, so that resolutions count the noise of Hall parts over their full bandwidth: "
            'set it to what is needed, such as bandwidth = "100 Hz"'
        )
        return [text] if resolution and self.bandwidth is None else []


FIELDS = dataclasses.fields(Requirements)
LIMITS = {spec.name: spec for spec in FIELDS if "low" in spec.metadata}
"""Fields of `Requirements` with a number, a unit and a range, by name."""
SWITCHES = tuple(spec for spec in FIELDS if isinstance(spec.default, bool))
"""Fields of `Requirements` that are required or not."""
SHOWN = {spec.name: spec.metadata.get("shown", spec.metadata["unit"]) for spec in FIELDS}
"""Units in which values of the fields are shown."""
CRITERIA = {
    spec.name: dataclasses.replace(spec.metadata["criterion"], name=spec.name, unit=SHOWN[spec.name])
    for spec in FIELDS
    if "criterion" in spec.metadata
}
CRITERIA["clearance"] = at_least(
    "gap beside the beam", "clearance", level=0.0, varies=False, name="clearance", unit="mm"
)
"""What sensors are rated by, in the order of the fields; the gap beside the beam is always required."""
AT_LEAST, AT_MOST = (
    tuple(name for name, each in CRITERIA.items() if each.way == way and each.level is None and each.gives)
    for way in (1, -1)
)
"""Requirements that bound a variant from below and from above, and can give."""


def full_scale(needed: Requirements | None, largest: float, words: str) -> tuple[float, str]:
    """Return the force of which errors of forces are percentages, N, and which one it is, in words.

    It is the required press; without requirements the largest force of a study, which has these words.

    >>> full_scale(Requirements(force_z=6.0), 35.8, "the largest force")
    (6.0, 'the required press')
    """
    return (largest, words) if needed is None else (needed.force_z, "the required press")


def design_table(needed: Requirements | None) -> str:
    """Return what is required as the table [requirements] of a design file; nothing without requirements.

    >>> print(design_table(Requirements(force_z=6.0)))
    <BLANKLINE>
    [requirements]
    force_z = 6.0  # N
    <BLANKLINE>
    """
    if needed is None:
        return ""
    rows = [row for row in needed.rows() if row["state"] == "set"]
    lines = [f"{row['requirement']} = {literal(row['value'])}  # {row['unit']}" for row in rows]
    if needed.pitch is not None:
        lines += [f"{name} = {literal(getattr(needed, name))}" for name in ("decoder", "polarity")]
    return "\n".join(["", "[requirements]", *lines, ""])


def read_requirements(path: str) -> Requirements:
    """Read the requirements in a TOML file; catalogues are relative to the file's folder."""
    needed = _of_values(path, path, checked(path, toml_table(path, "file"), KINDS))
    fewest = needed.fewest_chips
    if needed.reject_ambient and needed.chips < fewest:
        raise BadInput(
            f"{path}: reject_ambient needs {fewest} chips of three axes, and chips = {needed.chips} allows "
            f"fewer: set chips = {fewest}, or leave it out"
        )
    return needed


def stated_requirements(source: str) -> Requirements | None:
    """Return the requirements in the table [requirements] of a design file, such as winner.toml of `magtip size`.

    How its sensor is made (table [fabrication]) counts as required. None for a preset or a file without this table.
    """
    stated = table_beside(source, "requirements", KINDS | dict.fromkeys(ENDS, _NUMBER))
    if not stated:
        return None
    made = fabrication_of(source)
    fields = {"process": made.get("process"), "outer_shape": made.get("base", {}).get("shape")}
    known = {name: value for name, value in fields.items() if value is not None}
    return _of_values(f"{source}: requirements", source, known | stated)


def _of_values(where: str, path: str, values: dict[str, Any]) -> Requirements:
    """Return the requirements of checked values; `where` names their table in messages."""
    version = values.pop("version", VERSION)
    if version != VERSION:
        raise BadInput(
            f"{where}: the requirements have version {version}, and this version of magtip reads version {VERSION}"
        )
    if "force_z" not in values:
        raise BadInput(f'{where}: requirements need force_z, the normal force of the press, such as force_z = "5 N"')
    try:
        return Requirements(**_fields(path, values))
    except BadInput as error:
        raise BadInput(error.args[0] if str(error).startswith(path) else f"{where}: {error}") from None


ENDS = ("D_low", "D_high")
"""Keys of a design file's table in place of `D`."""
_NUMBER: Any = float | str
KINDS: dict[str, Any] = {
    "version": int,
    **{name: _NUMBER for name in LIMITS if name not in ENDS},
    "D": float | str | list[Any],
    **{spec.name: bool for spec in SWITCHES},
    **dict.fromkeys(("samples", "chips"), int),
    "outer_shape": Literal["round", "square"],
    "process": Literal["fdm", "sla"],
    "decoder": Literal["ignoring", "subtracting", "jointly"],
    "polarity": Literal["any", "up", "checkerboard", "rows"],
    **dict.fromkeys(("catalogues", "shipped", *CATALOGUES), list[str]),
    "seed": int,
    "weights": dict[str, Any],
}
"""Types of all keys of a file."""
IDLE = ("range_cap", "wall", "catalogues", "shipped", *CATALOGUES)
"""Keys that are comments in the example, because they leave parts or variants out."""


def example() -> str:
    """Return a file of requirements with all keys, to edit."""
    text = (
        "# Requirements for `magtip size`. All keys but force_z are optional; a number may be a text with its unit.\n"
    )
    rows = [("version", str(VERSION), "of this format")]
    for spec in FIELDS:
        said, default, unit = spec.metadata["text"], spec.default, spec.metadata["unit"]
        if "default:" not in said and isinstance(default, (int, float, str)):
            value = (
                literal(default)
                if isinstance(default, bool)
                else f"{default:{'' if isinstance(default, str) else 'g'}}"
            )
            said += f"; default: {value} {unit}".removesuffix(" 1")
        rows.append((f"# {spec.name}" if spec.name in IDLE else spec.name, spec.metadata["example"], said))
    rows.append(("# D", '["6 mm", "10 mm"]', "range of the diameter, or one value"))
    text += "".join(f"{f'{key} = {value}':<34} # {said}\n" for key, value, said in rows if value)
    return text + "".join(
        [
            f"{'[weights]':<34} # of the ranking; default: 1 each\n",
            *(f"{name} = 1\n" for name in OBJECTIVES),
        ]
    )


def _fields(path: str, values: Mapping[str, Any]) -> dict[str, Any]:
    fields = {name: value for name, value in values.items() if name not in ("D", "weights")}
    if "D" in values:
        ends = values["D"] if isinstance(values["D"], list) else [values["D"]] * 2
        if len(ends) != 2:
            raise BadInput(f"D must be one diameter, or a range [low, high]; got {ends!r:.60}")
        fields |= {
            name: quantity("D", end, "mm", 0.1, 200) for name, end in zip(("D_low", "D_high"), ends, strict=True)
        }
    weights = values.get("weights", {})
    check_keys(f"{path}: weights", weights, OBJECTIVES)
    fields |= {f"weight_{name}": quantity(f"weights: {name}", weight, "1") for name, weight in weights.items()}
    for name in ("shipped", *CATALOGUES):
        if name in values:
            fields[name] = _names(name, values[name])
    check_keys(f"{path}: shipped", fields.get("shipped", ()), CATALOGUES)
    folder = Path(path).parent
    return fields | {"catalogues": tuple(str(folder / file) for file in values.get("catalogues", ()))}


def _names(key: str, names: Sequence[str]) -> tuple[str, ...]:
    for name in names:
        if names.count(name) > 1:
            raise BadInput(f"{key} lists {name!r} twice: give it once")
    if not names and key in CATALOGUES:
        raise BadInput(f"{key} is empty: name one or more, or leave it out for all")
    return tuple(names)
