"""The parts from which a sensor is sized: magnets, Hall parts and silicones that are sold, with ranges and sources.

A file holds any of the arrays of tables `[[grade]]`, `[[magnet]]`, `[[hall_part]]` and `[[silicone]]`; the shipped
files in this folder are the examples. A magnet stands for one part of each of its grades, such as "4x2 N35". A value
that a table leaves out has its default, and counts as assumed. An entry of a user's file replaces the shipped one of
the same name; all others are added.

Input that cannot be used raises a `BadInput` here, whose message is one sentence with the remedy.
"""

from __future__ import annotations

import csv
import dataclasses
import functools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from geometry.bad_input import nearest, words
from geometry.design import HALL_LAYOUTS, LEAST_WALL, BadInput, Design
from geometry.hall_chips import CHIPS, OWN, HallChip
from studies.fabrication.sensor_solids import Mix
from studies.inputs.user_input import check_keys, quantity, toml_table
from studies.parts.requirements import CATALOGUES, Requirements

FILTER = math.pi / 2
"""Bandwidth of white noise over the -3 dB bandwidth of a low pass of first order."""
SPRING_GAP, PRESS_GAP = 8 / math.pi**2 * 0.915965594177219, 1.15
"""Gap of a linear spring over tan(delta), see `analytic.relaxation_loops`; and that of a press over it, assumed: 1.11
and 1.14 in the second cycle of the paper's sensor by finite elements, 1 and 2.4 mm deep."""


ASSUMED_LOSS = Design().loss_factor
"""Loss factor of a design that states none; of a silicone of unknown loss factor it says nothing."""


@dataclass(frozen=True, slots=True)
class MagnetEntry:
    """A cylindrical magnet that is sold, magnetised along its axis: a size in one grade, see `catalogue_keys.csv`."""

    name: str
    grade: str
    diameter: float
    height: float
    edge_radius: float
    tolerance: float
    remanence_low: float
    remanence_high: float
    largest_temperature: float
    density: float
    source: str
    assumed: tuple[str, ...]

    @property
    def remanence(self) -> float:
        """Middle of the range of the remanence, T."""
        return (self.remanence_low + self.remanence_high) / 2

    def fields(self) -> dict[str, float]:
        """Return the fields of a `Design` with this magnet."""
        return {
            "magnet_diameter": self.diameter,
            "magnet_height": self.height,
            "magnet_edge_radius": self.edge_radius,
            "remanence": self.remanence,
            "magnet_density": self.density,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class HallPartEntry:
    """A Hall part that is sold: one-axis parts, of which a sensor has three, or a 3-axis chip. None is unknown.

    Of a chip the gain is 1, null, its tolerance and rails are in T, and width, height and thickness are its size
    along x, along y and over its board. The others are those of `catalogue_keys.csv`. `count` is the number of such
    chips in a sensor.
    """

    name: str
    layout: str
    count: int = 1
    gain: float = 1.0
    gain_tolerance: float
    gain_drift: float | None = None
    null: float = 0.0
    null_tolerance: float | None = None
    low: float
    high: float
    noise_density: float | None = None
    noise: float | None = None
    rate: float | None = None
    bandwidth: float | None = None
    step: float = 0.0
    plate: float = 0.0
    width: float
    height: float
    thickness: float
    plate_height: float | None = None
    source: str
    assumed: tuple[str, ...]

    def fields(self) -> dict[str, float | str]:
        """Return the fields of a `Design` with this part, but for its noise: see `noise_fields`."""
        if self.layout == "three":
            names = ("gain", "null", "low", "high", "plate")
            return {"hall_layout": "three", **{f"hall_{name}": getattr(self, name) for name in names}}
        values: dict[str, float] = {"count": float(self.count)} if self.count > 1 else {}
        if self.layout == OWN:
            values |= {"range": self.high, "step": self.step, "noise": self.noise or 0.0}
            values |= {"length": self.width, "width": self.height, "height": self.thickness}
            values |= {"plate": self.plate_height or 0.0}
        elif self.noise and self.noise != CHIPS[self.layout].noise:
            # the noise that a user has measured replaces that of the data sheet
            values["noise"] = self.noise
        return {"hall_layout": self.layout, **{f"chip_{name}": value for name, value in values.items()}}

    def is_of(self, design: Design) -> bool:
        """Whether a design has such elements: a chip of this layout, or one-axis parts with these figures."""
        if self.layout == OWN or self.layout != design.hall_layout:
            return False
        names = ("gain", "null", "low", "high", "plate") if self.layout == "three" else ()
        return all(math.isclose(getattr(self, name), getattr(design, f"hall_{name}")) for name in names)

    @property
    def unusable(self) -> str:
        """Why no sensor can be sized with this part, "" if one can."""
        if self.layout == AMBIENT:
            return f"it measures the ambient field, and its range of {self.high:g} T is less than a magnet's field"
        if self.layout != "three" and self.noise is None:
            return f'its noise is unknown: state it in a [[hall_part]] of your own with layout = "{self.layout}"'
        return ""

    def refusal(self, needed: Requirements) -> str:
        """Return why no sensor with these requirements can be sized with this part, "" if one can."""
        if self.unusable or needed.bandwidth is None or self.average(needed) >= 1:
            return self.unusable
        rate = self.sampling(needed)
        if rate is None:
            return (
                f"its rate is unknown, so that nothing says that it reads {needed.bandwidth:g} Hz: state the rate in "
                f'a [[hall_part]] of your own with layout = "{self.layout}"'
            )
        enough = 2 * needed.bandwidth
        return f"it has {rate:g} values a second, and a bandwidth of {needed.bandwidth:g} Hz needs {enough:g}"

    def sampling(self, needed: Requirements) -> float | None:
        """Return how many independent values of all axes come in a second, Hz; None if unknown.

        Of one-axis parts they are those of the converter, at most twice the bandwidth of the part: closer values are
        no independent ones.
        """
        if self.layout != "three":
            return self.rate
        return None if self.bandwidth is None else min(needed.converter_rate, 2 * self.bandwidth)

    def average(self, needed: Requirements) -> int:
        """Return the number of values of which a reading is the average: `samples`, or as many as there are.

        Readings of a bandwidth b are 2 b a second, so that each has the values of 1 / (2 b); 0 where there is none,
        or where the rate is unknown.
        """
        if needed.bandwidth is None:
            return needed.samples
        return min(needed.samples, int((self.sampling(needed) or 0.0) / (2 * needed.bandwidth) * (1 + 1e-12)))

    def largest_bandwidth(self, needed: Requirements, average: int) -> float:
        """Return the bandwidth of readings of which each is an average of so many values, Hz; NaN where unknown."""
        rate = self.sampling(needed)
        return math.nan if rate is None else rate / (2 * average)

    def noise_fields(self, bandwidth: float | None = None, average: int = 1) -> dict[str, float]:
        """Return the fields of a `Design` for the part's white noise; none for a chip, whose noise the layout has.

        bandwidth : -3 dB of readings that are averages of `average` values, Hz. The low pass of first order before
            the converter is so many times wider, at most as wide as the part: an average then leaves the white noise
            of this bandwidth, and less of that of the converter.
        """
        if self.noise_density is None or self.bandwidth is None:
            return {}
        band = min((bandwidth or math.inf) * average, self.bandwidth)
        return {"hall_noise_density": self.gain * self.noise_density, "hall_bandwidth": FILTER * band}


@dataclass(frozen=True, slots=True)
class SiliconeEntry:
    """A castable silicone: least, typical and largest published values, see `catalogue_keys.csv`.

    The loss factors, and the frequencies between which they were measured, Hz, are None where no source has them.
    """

    name: str
    E_low: float
    E: float
    E_high: float
    nu_low: float
    nu: float
    nu_high: float
    density: float
    loss_factor_low: float | None
    loss_factor: float | None
    loss_factor_high: float | None
    loss_low: float | None
    loss_high: float | None
    loss_source: str
    cure_temperature: float
    cure_hours: float
    mixed: str
    source: str
    assumed: tuple[str, ...]

    def fields(self) -> dict[str, float | str]:
        """Return the fields of a `Design` of this silicone, with its typical E and nu."""
        return {"silicone": self.name, "E": self.E, "nu": self.nu, "density": self.density}

    def loss_field(self) -> dict[str, float]:
        """Return the field of a `Design` of this silicone with its typical loss factor, else the assumed one."""
        return {"loss_factor": ASSUMED_LOSS if self.loss_factor is None else self.loss_factor}

    @property
    def loss_words(self) -> str:
        """Loss factor with its range, frequencies and source, or that it is unknown."""
        if self.loss_factor is None:
            return "Loss factor tan(delta): unknown, and assumed where motion is followed"
        bounds = f"{self.loss_factor_low:g} to {self.loss_factor_high:g}"
        bounds = f"{self.loss_factor:g} ({bounds}, {self.loss_low:g} to {self.loss_high:g} Hz)"
        return f"Loss factor tan(delta): {bounds}. Source: {self.loss_source}"

    @property
    def hysteresis(self) -> float:
        """Gap of a press at mid-stroke over the largest force with the largest loss factor; NaN where unknown."""
        return math.nan if self.loss_factor_high is None else PRESS_GAP * SPRING_GAP * self.loss_factor_high

    def refusal(self, needed: Requirements) -> str:
        """Return why no sensor of this silicone can meet these requirements, "" if one can."""
        if needed.hysteresis is None or self.hysteresis <= needed.hysteresis:
            return ""
        if self.loss_factor_high is None:
            return "its loss factor is unknown: state loss_factor in a [[silicone]] of your own, by a test of yours"
        gap, bound = 100 * self.hysteresis, 100 * needed.hysteresis
        return (
            f"its hysteresis is up to {gap:.3g} % (tan(delta) = {self.loss_factor_high:g}); required: {bound:.3g} %"
        )


@dataclass(frozen=True, slots=True)
class Catalogues:
    """The parts from which a sensor is sized, none of them empty.

    `left_out` are Hall parts from which none can be, see `HallPartEntry.refusal`: those of the ambient field, chips
    of unknown noise, and with a bandwidth parts that are slower, or of unknown rate. `silicones_left_out` are those
    that cannot keep a required hysteresis; where none can, all are in use, and `conflicts.impossible` says it.
    """

    magnets: tuple[MagnetEntry, ...]
    hall_parts: tuple[HallPartEntry, ...]
    silicones: tuple[SiliconeEntry, ...]
    left_out: tuple[HallPartEntry, ...] = ()
    silicones_left_out: tuple[SiliconeEntry, ...] = ()


@dataclass(frozen=True, slots=True)
class Key:
    """A key of a table: unit (of `studies.inputs.user_input.UNITS`, text, or names) and range of its numbers, how
    many they are, and its default: None where it is needed, NaN where it is then unknown.
    """

    unit: str
    low: float
    high: float
    count: int
    default: Any


def _keys() -> dict[str, dict[str, Key]]:
    tables: dict[str, dict[str, Key]] = {}
    with (FOLDER / "catalogue_keys.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            low, high = (float(row[end] or math.nan) for end in ("low", "high"))
            unit, count, text = row["unit"], int(row["count"]), row["default"]
            default: Any
            if unit in ("text", "names") or text in ("", "unknown"):
                default = {"": None, "unknown": math.nan, "-": () if unit == "names" else ""}.get(text, text)
            else:
                numbers = tuple(float(number) for number in text.split())
                default = numbers if count > 1 else numbers[0]
            tables.setdefault(row["table"], {})[row["key"]] = Key(unit, low, high, count, default)
    return tables


FOLDER = Path(__file__).parent
"""Folder of the shipped catalogues."""
KEYS = _keys()
"""Keys of the tables of a file, see `catalogue_keys.csv`."""
OF_CHIP = ("range", "step", "noise", "rate", "offset", "plate_height")
OF_ONE_AXIS = ("gain", "null", "null_tolerance", "low", "high", "noise_density", "bandwidth", "plate")
"""Keys of a Hall part that only a chip of one's own, and only a one-axis part, has."""
ENDS = {2: "[low, high]", 3: "[low, typical, high]"}
"""How a key with several numbers is written."""


KINDS = {"grade": "grades", "magnet": "magnets", "hall_part": "hall_parts", "silicone": "silicones"}
"""Kinds of entries by the name of their tables in a file."""
Named = dict[str, dict[str, Any]]
"""Entries by kind and name; magnets without the values of their grades, and these as dictionaries."""


def read_catalogue(path: str) -> Named:
    """Read and check the entries of a file."""
    table = toml_table(path, "file")
    check_keys(path, table, KEYS)
    if not any(table.get(name) for name in KEYS):
        raise BadInput(f"{path}: the catalogue is empty: add a table [[magnet]], [[hall_part]] or [[silicone]]")
    named: Named = {kind: {} for kind in KINDS.values()}
    for array, kind in KINDS.items():
        tables = table.get(array, [])
        if not isinstance(tables, list) or not all(isinstance(each, dict) for each in tables):
            raise BadInput(f"{path}: {array} must be an array of tables: write [[{array}]]")
        for number, each in enumerate(tables, 1):
            name, entry = _entry(path, array, each, number)
            if name in named[kind]:
                raise BadInput(f"{path}: two tables [[{array}]] have the name {name!r}: rename or remove one")
            named[kind][name] = entry
    return named


def _entry(path: str, array: str, table: Mapping[str, Any], number: int) -> tuple[str, Any]:
    """Return the name and the entry of a table; `assumed` also names what the table leaves out."""
    keys, name = KEYS[array], table.get("name")
    where = f"{path}: {name}" if isinstance(name, str) and name else f"{path}: [[{array}]] number {number}"
    check_keys(where, table, keys)
    entry: dict[str, Any] = {}
    for key, kind in keys.items():
        if key in table:
            entry[key] = _value(f"{where}: {key}", table[key], kind)
        elif kind.default is None:
            raise BadInput(f"{where}: {key} is missing")
        else:
            entry[key] = kind.default
    if "assumed" in keys:
        check_keys(f"{where}: assumed", entry["assumed"], keys)
        unset = (*table, "name", "layout", "source", "loss_source", "assumed")
        # what has no default is unknown, and not assumed
        left_out = [key for key, kind in keys.items() if key not in unset and kind.default == kind.default]
        entry["assumed"] = (*entry["assumed"], *left_out)
    if array == "magnet":
        _check_magnet(where, entry)
        entry["name"] = entry["name"] or f"{entry['diameter']:g}x{entry['height']:g}"
    if array == "hall_part":
        return entry["name"], _hall_part(f"{path}: {entry['name']}", entry)
    return entry["name"], _silicone(entry) if array == "silicone" else entry


def _value(where: str, value: object, key: Key) -> Any:
    if key.unit == "text":
        if not isinstance(value, str) or not value.strip():
            raise BadInput(f"{where} must be a text; got {value!r:.60}")
        return words(where, value)
    if key.unit == "names":
        if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
            raise BadInput(f"{where} must be a list of names; got {value!r:.60}")
        return tuple(words(where, name) for name in value)
    if key.count == 1:
        return quantity(where, value, key.unit, key.low, key.high)
    ends = ENDS[key.count] if not where.endswith("body") else "[width, height, thickness]"
    if key.default != key.default and isinstance(value, str | int | float):
        # of what may be unknown, one number is enough
        value = [value] * key.count
    if not isinstance(value, list) or len(value) != key.count:
        raise BadInput(f"{where} must be {ends}; got {value!r:.60}")
    numbers = tuple(quantity(where, number, key.unit, key.low, key.high) for number in value)
    if list(numbers) != sorted(numbers) and not where.endswith("body"):
        raise BadInput(f"{where} must be {ends}, none above the next; got {', '.join(f'{n:g}' for n in numbers)}")
    return numbers


def _check_magnet(where: str, entry: Mapping[str, Any]) -> None:
    if not entry["grades"]:
        raise BadInput(f"{where}: grades is empty: name one or more, such as N35")
    widest = min(entry["diameter"], entry["height"]) / 2
    if not entry["edge_radius"] <= widest:
        raise BadInput(
            f"{where}: edge_radius must not exceed half the magnet's smaller side = {widest:g} mm; got "
            f"{entry['edge_radius']:g} mm"
        )


def _hall_part(where: str, entry: Mapping[str, Any]) -> HallPartEntry:
    layout = entry["layout"]
    layouts = (*HALL_LAYOUTS, AMBIENT)
    if layout not in layouts:
        raise BadInput(f"{where}: there is no layout {layout!r}: {nearest(layout, layouts)}")
    known: dict[str, Any] = {key: None if value != value else value for key, value in entry.items()}
    if layout == "three":
        return _one_axis(where, known)
    if layout in CHIPS:
        given: dict[str, Any] = {
            key: known[key] for key in ("noise", "rate", "offset", "gain_drift") if known[key] is not None
        }
        if "gain_tolerance" not in entry["assumed"]:
            given["gain_tolerance"] = entry["gain_tolerance"]
        chip = dataclasses.replace(CHIPS[layout], name=entry["name"], source=entry["source"], **given)
        return _of_chip(chip, layout)
    for name in ("range", "step"):
        if known[name] is None:
            raise BadInput(f"{where}: {name} is missing")
    high = entry["body"][2]
    plate = high / 2 if known["plate_height"] is None else known["plate_height"]
    if not plate <= high:
        raise BadInput(f"{where}: plate_height must not exceed the body's height = {high:g} mm; got {plate:g} mm")
    names = ("name", "range", "step", "body", "noise", "rate", "offset", "gain_tolerance", "gain_drift", "source")
    assumed = tuple(name for name in entry["assumed"] if name not in OF_ONE_AXIS)
    assumed += () if known["plate_height"] is not None else ("plate_height",)
    return _of_chip(HallChip(plate=plate, assumed=assumed, **{name: known[name] for name in names}), layout)


def _one_axis(where: str, known: Mapping[str, Any]) -> HallPartEntry:
    if known["gain"] is None:
        raise BadInput(f"{where}: gain is missing")
    if not known["low"] < known["null"] < known["high"]:
        raise BadInput(
            f"{where}: null must lie between low = {known['low']:g} V and high = {known['high']:g} V; got "
            f"{known['null']:g} V"
        )
    values = {key: value for key, value in known.items() if key not in (*OF_CHIP, "body")}
    return HallPartEntry(**values, **_body(known["body"]))


def _body(body: tuple[float, ...]) -> dict[str, Any]:
    return dict(zip(("width", "height", "thickness"), body, strict=True))


def _of_chip(chip: HallChip, layout: str) -> HallPartEntry:
    usual = KEYS["hall_part"]["gain_tolerance"].default
    return HallPartEntry(
        name=chip.name,
        layout=layout,
        gain_drift=chip.gain_drift,
        noise=chip.noise,
        rate=chip.rate,
        step=chip.step,
        source=chip.source,
        gain_tolerance=usual if chip.gain_tolerance is None else chip.gain_tolerance,
        null_tolerance=chip.offset,
        low=-chip.range,
        high=chip.range,
        **_body(chip.body),
        plate_height=chip.plate,
        assumed=(*chip.assumed, *(["gain_tolerance"] if chip.gain_tolerance is None else [])),
    )


def _silicone(entry: Mapping[str, Any]) -> SiliconeEntry:
    ranges, known = ("E", "nu", "loss_factor"), isinstance(entry["loss_factor"], tuple)
    values = {key: value for key, value in entry.items() if key not in (*ranges, "loss_frequency")}
    if not known:
        entry = {**entry, "loss_factor": (None,) * 3, "loss_frequency": (None,) * 2}
        values |= {"loss_source": "", "assumed": tuple(key for key in entry["assumed"] if key != "loss_frequency")}
    for name in ranges:
        values |= dict(zip((f"{name}_low", name, f"{name}_high"), entry[name], strict=True))
    values |= dict(zip(("loss_low", "loss_high"), entry["loss_frequency"], strict=True))
    values["loss_source"] = values["loss_source"] or (entry["source"] if known else "")
    return SiliconeEntry(**values)


AMBIENT = "ambient"
"""Layout of a chip that measures the ambient field beside a sensor, and saturates at its magnet."""
Part = TypeVar("Part", MagnetEntry, HallPartEntry, SiliconeEntry)


def catalogues_of(requirements: Requirements) -> Catalogues:
    """Return the parts in use.

    >>> [part.name for part in catalogues_of(Requirements(force_z=5.0, magnets=("4x2 N35",))).magnets]
    ['4x2 N35']
    """
    users = {path: read_catalogue(path) for path in requirements.catalogues}
    for kind in CATALOGUES:
        where: dict[str, str] = {}
        for path, file in users.items():
            for name in file[kind]:
                if name in where:
                    raise BadInput(f"{path}: {where[name]} has a part {name!r} too: rename or remove one of them")
                where[name] = path
    ours = {kind: read_catalogue(str(FOLDER / f"{kind}.toml")) for kind in CATALOGUES}
    grades = {name: grade for file in (ours["magnets"], *users.values()) for name, grade in file["grades"].items()}
    shipped = {kind: ours[kind][kind] if kind in requirements.shipped else {} for kind in CATALOGUES}
    if "hall_parts" in requirements.shipped:
        shipped["hall_parts"] |= {chip.name: _of_chip(chip, layout) for layout, chip in CHIPS.items()}
    magnets = _magnets("magnets.toml", shipped["magnets"], grades)
    for path, file in users.items():
        magnets |= _magnets(path, file["magnets"], grades)
    hall_parts, silicones = (
        shipped[kind] | {name: part for file in users.values() for name, part in file[kind].items()}
        for kind in ("hall_parts", "silicones")
    )
    in_use = _in_use("magnets", magnets, requirements)
    _check_fit(in_use, requirements)
    unusable = {name: why for name, part in hall_parts.items() if (why := part.refusal(requirements))}
    for name in requirements.hall_parts:
        if name in unusable:
            raise BadInput(f"hall_parts: no sensor can be sized with {name}: {unusable[name]}")
    if hall_parts and len(unusable) == len(hall_parts):
        reasons = "; ".join(f"{name}: {why}" for name, why in list(unusable.items())[:3])
        raise BadInput(f"no sensor can be sized with any Hall part of the catalogues, such as {reasons}")
    castable = _in_use("silicones", silicones, requirements)
    lossy = [part for part in castable if part.refusal(requirements)]
    lossy = lossy if len(lossy) < len(castable) else []
    return Catalogues(
        in_use,
        _in_use("hall_parts", {k: part for k, part in hall_parts.items() if k not in unusable}, requirements),
        tuple(part for part in castable if part not in lossy),
        tuple(hall_parts[name] for name in unusable),
        tuple(lossy),
    )


@functools.cache
def shipped_parts() -> tuple[tuple[MagnetEntry, ...], tuple[HallPartEntry, ...], tuple[SiliconeEntry, ...]]:
    """Return all magnets, Hall parts and silicones of the shipped catalogues."""
    ours = {kind: read_catalogue(str(FOLDER / f"{kind}.toml")) for kind in CATALOGUES}
    magnets = _magnets("magnets.toml", ours["magnets"]["magnets"], ours["magnets"]["grades"])
    chips = (_of_chip(chip, layout) for layout, chip in CHIPS.items())
    hall_parts = (*ours["hall_parts"]["hall_parts"].values(), *chips)
    return tuple(magnets.values()), hall_parts, tuple(ours["silicones"]["silicones"].values())


def mix_named(option: str | None, of_design: str = "") -> Mix | None:
    """Return what a recipe knows of the silicone that an option names, or else the design; None: no mix is known.

    A design may be of a silicone that is not in the shipped catalogue, an option may not.

    >>> mix_named("Sylgard 184")["mixed"], mix_named(None, "my own")
    ('10A:1B by weight', None)
    """
    shipped = read_catalogue(str(FOLDER / "silicones.toml"))["silicones"]
    if option is not None and option not in shipped:
        raise BadInput(f"the catalogue has no silicone {option!r}: {nearest(option, shipped)}")
    name = of_design if option is None else option
    return mix_of(shipped[name]) if name in shipped else None


def mix_of(part: SiliconeEntry) -> Mix:
    """Return what a casting recipe needs to know of a silicone."""
    keys = {"mixed": "mixed", "hours": "cure_hours", "density": "density"}
    return {
        "name": part.name,
        "mixed": part.mixed,
        "hours": part.cure_hours,
        "temperature": part.cure_temperature,
        "density": part.density,
        "moduli": (part.E_low, part.E_high),
        "source": part.source,
        "assumed": tuple(key for key, name in keys.items() if name in part.assumed),
    }


def rows(parts: Iterable[MagnetEntry | HallPartEntry | SiliconeEntry]) -> list[dict[str, Any]]:
    """Return a row for each part, with the units in the names of the columns."""
    table = []
    for part in parts:
        row = {COLUMNS.get(name, name): value for name, value in dataclasses.asdict(part).items() if name != "count"}
        if isinstance(part, HallPartEntry):
            row["gain_V_per_mT"] = part.gain / 1000 if part.layout == "three" else None
            row["noise_density_V_per_sqrtHz"] = part.noise_fields().get("hall_noise_density")
            row["left_out"] = part.unusable
        table.append(row | {"assumed": ", ".join(part.assumed)})
    return table


UNITS = {
    "mm": ("diameter", "height", "edge_radius", "tolerance", "plate", "width", "thickness", "plate_height"),
    "C": ("largest_temperature", "cure_temperature"),
    "T": ("remanence_low", "remanence_high", "noise", "step"),
    "MPa": ("E_low", "E", "E_high"),
    "Hz": ("rate", "bandwidth", "loss_low", "loss_high"),
    "per_K": ("gain_drift",),
    "kg_per_m3": ("density",),
    "V_per_mT": ("gain",),
    "V_per_sqrtHz": ("noise_density",),
}
COLUMNS = {name: f"{name}_{unit}" for unit, names in UNITS.items() for name in names} | {"cure_hours": "cure_h"}
"""Columns that carry a unit, by field; the null, its tolerance and the rails are in V, or in T of a chip."""


def _magnets(path: str, sizes: Mapping[str, dict[str, Any]], grades: Mapping[str, Any]) -> dict[str, MagnetEntry]:
    merged: dict[str, MagnetEntry] = {}
    for size, values in sizes.items():
        for name in values["grades"]:
            if name not in grades:
                raise BadInput(f"{path}: {size}: there is no grade {name!r}: {nearest(name, grades)}")
            grade, (low, high) = grades[name], grades[name]["remanence"]
            own: dict[str, Any] = {
                "name": f"{size} {name}",
                "grade": name,
                "remanence_low": low,
                "remanence_high": high,
                "largest_temperature": grade["largest_temperature"],
                "source": f"{values['source']}; {name}: {grade['source']}",
            }
            kept = {key: value for key, value in values.items() if key != "grades"}
            merged[own["name"]] = MagnetEntry(**kept | own)
    return merged


def _in_use(kind: str, parts: Mapping[str, Part], requirements: Requirements) -> tuple[Part, ...]:
    names = getattr(requirements, kind) or tuple(parts)
    if not parts:
        raise BadInput(
            f"the catalogue of {kind} is empty: add {kind} to shipped, or tables [[{kind.removesuffix('s')}]] to a "
            "file of catalogues"
        )
    for name in names:
        if name not in parts:
            # a long list of all parts would hide the remedy
            close = nearest(name, parts)
            remedy = close if close.startswith("did") else "`magtip catalogue` lists all parts"
            raise BadInput(f"{kind}: the catalogues have no {name!r}: {remedy}")
    return tuple(parts[name] for name in names)


def _check_fit(magnets: Sequence[MagnetEntry], requirements: Requirements) -> None:
    widest = min(requirements.D_high or math.inf, requirements.outer_size or math.inf)
    least = min(magnets, key=lambda magnet: magnet.diameter)
    if least.diameter + 2 * LEAST_WALL > widest:
        raise BadInput(
            f"no magnet in use fits into a beam of {widest:g} mm: the smallest one, {least.name}, needs "
            f"{least.diameter + 2 * LEAST_WALL:g} mm with the silicone beside it"
        )
