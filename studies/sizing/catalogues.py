"""The parts from which a sensor is sized: magnets, Hall parts and silicones that are sold, with ranges and sources.

A file holds any of the arrays of tables `[[grade]]`, `[[magnet]]`, `[[hall_part]]` and `[[silicone]]`; the shipped
files in this folder are the examples. A magnet stands for one part of each of its grades, such as "4x2 N35". A value
that a table leaves out has its default, and counts as assumed. An entry of a user's file replaces the shipped one of
the same name; all others are added.

Input that cannot be used raises a `BadInput` here, whose message is one sentence with the remedy.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from geometry.bad_input import nearest
from geometry.design import HALL_LAYOUTS, LEAST_WALL, BadInput
from geometry.hall_chips import CHIPS, OWN, HallChip
from studies.fabrication.fabrication_rows import Silicone
from studies.inputs.quantity_input import quantity
from studies.inputs.user_input import check_keys, toml_table
from studies.sizing.requirements import CATALOGUES, Requirements

FILTER = math.pi / 2
"""Bandwidth of white noise over the -3 dB bandwidth of a low pass of first order."""


@dataclass(frozen=True, slots=True)
class MagnetEntry:
    """A cylindrical magnet that is sold, magnetised along its axis.

    Attributes
    ----------
    diameter, height, edge_radius : mm. tolerance : of diameter and height, +- mm.
    remanence_low, remanence_high : range of the grade, T.
    largest_temperature : °C. density : kg/m³.
    source : publication or data sheet. assumed : fields without a source that was read.
    """

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


@dataclass(frozen=True, slots=True)
class HallPartEntry:
    """A Hall part that is sold: one-axis parts, of which a sensor has three, or a 3-axis chip. None is unknown.

    Attributes
    ----------
    layout : `hall_layout` of the designs with this part; "ambient" for a chip whose range is below a magnet's field.
    gain, null, low, high : gain, V/T, output in zero field and rails, V; of a chip in T (gain 1).
    gain_tolerance : largest relative deviation of the gain. gain_drift : of the gain with temperature, 1/K.
    null_tolerance : largest deviation of the null, V; of a chip in T.
    noise_density : white noise of the input up to `bandwidth`, T/sqrt(Hz); None for a chip.
    noise : rms of one output value of a chip at `rate` values a second, T and Hz; None for a one-axis part.
    bandwidth : -3 dB, Hz; None for a chip.
    step : step of a chip's converter, T. plate : side of the Hall plate, mm.
    width, height, thickness : body, mm; of a chip along x, along y and over its board.
    plate_height : of a chip's sensitive volume over its board, mm; None for a one-axis part.
    source : publication or data sheet. assumed : fields without a source that was read.
    """

    name: str
    layout: str
    gain: float
    gain_tolerance: float
    gain_drift: float | None
    null: float
    null_tolerance: float | None
    low: float
    high: float
    noise_density: float | None
    noise: float | None
    rate: float | None
    bandwidth: float | None
    step: float
    plate: float
    width: float
    height: float
    thickness: float
    plate_height: float | None
    source: str
    assumed: tuple[str, ...]

    def fields(self) -> dict[str, float | str]:
        """Return the fields of a `Design` with this part, but for its noise: see `noise_fields`."""
        if self.layout == OWN:
            body = {
                "length": self.width,
                "width": self.height,
                "height": self.thickness,
                "plate": self.plate_height or 0.0,
            }
            own = {"range": self.high, "step": self.step, "noise": self.noise or 0.0, **body}
            return {"hall_layout": OWN, **{f"chip_{name}": value for name, value in own.items()}}
        if self.layout != "three":
            # the noise that a user has measured replaces that of the data sheet
            noise = {"chip_noise": self.noise} if self.noise and self.noise != CHIPS[self.layout].noise else {}
            return {"hall_layout": self.layout, **noise}
        values = {"gain": self.gain, "null": self.null, "low": self.low, "high": self.high, "plate": self.plate}
        return {"hall_layout": "three", **{f"hall_{name}": value for name, value in values.items()}}

    @property
    def unusable(self) -> str:
        """Why no sensor can be sized with this part, "" if one can."""
        if self.layout == AMBIENT:
            return f"it measures the ambient field, and its range of {self.high:g} T is less than a magnet's field"
        if self.layout != "three" and self.noise is None:
            return f'its noise is unknown: state it in a [[hall_part]] of your own with layout = "{self.layout}"'
        return ""

    def noise_fields(self, bandwidth: float | None = None) -> dict[str, float]:
        """Return the fields of a `Design` for the part's white noise; none for a chip, whose noise the layout has.

        Parameters
        ----------
        bandwidth : -3 dB of a low pass of first order before the converter, Hz; default: that of the part, which is
            also the largest.
        """
        if self.noise_density is None or self.bandwidth is None:
            return {}
        band = self.bandwidth if bandwidth is None else min(bandwidth, self.bandwidth)
        return {"hall_noise_density": self.gain * self.noise_density, "hall_bandwidth": FILTER * band}


@dataclass(frozen=True, slots=True)
class SiliconeEntry:
    """A castable silicone.

    Attributes
    ----------
    E_low, E, E_high : least, typical and largest published Young's modulus at small strain, MPa.
    nu_low, nu, nu_high : Poisson's ratio. density : kg/m³.
    cure_temperature, cure_hours : of the data sheet without an oven, °C and h.
    mixed : ratio of the parts.
    source : publication or data sheet. assumed : fields without a source that was read.
    """

    name: str
    E_low: float
    E: float
    E_high: float
    nu_low: float
    nu: float
    nu_high: float
    density: float
    cure_temperature: float
    cure_hours: float
    mixed: str
    source: str
    assumed: tuple[str, ...]

    def fields(self) -> dict[str, float | str]:
        """Return the fields of a `Design` of this silicone, with its typical E and nu."""
        return {"silicone": self.name, "E": self.E, "nu": self.nu, "density": self.density}


@dataclass(frozen=True, slots=True)
class Catalogues:
    """The parts from which a sensor is sized, none of them empty.

    `left_out` are Hall parts from which none can be: those of the ambient field, and chips of unknown noise.
    """

    magnets: tuple[MagnetEntry, ...]
    hall_parts: tuple[HallPartEntry, ...]
    silicones: tuple[SiliconeEntry, ...]
    left_out: tuple[HallPartEntry, ...] = ()


Entry = MagnetEntry | HallPartEntry | SiliconeEntry


@dataclass(frozen=True, slots=True)
class Key:
    """A key of a table: unit and range of its numbers, or text.

    Attributes
    ----------
    unit : one of `studies.inputs.quantity_input.UNITS`; "text" or "names" (a list of texts) for others.
    count : how many numbers, from low to high, or the three sides of a body.
    default : None where the key is needed; NaN where it is then unknown.
    """

    unit: str
    low: float = 0.0
    high: float = 0.0
    count: int = 1
    default: Any = None


_COMMON = {"source": Key("text", default="the user's file"), "assumed": Key("names", default=())}
KEYS: dict[str, dict[str, Key]] = {
    "grade": {
        "name": Key("text"),
        "remanence": Key("T", 0.01, 2.0, 2),
        "largest_temperature": Key("C", 20, 600, default=80.0),
        "source": _COMMON["source"],
    },
    "magnet": {
        "name": Key("text", default=""),
        "diameter": Key("mm", 0.1, 200),
        "height": Key("mm", 0.1, 200),
        "edge_radius": Key("mm", 0, 100, default=0.1),
        "tolerance": Key("mm", 0, 10, default=0.1),
        "density": Key("kg/m3", 100, 25000, default=7500.0),
        "grades": Key("names"),
        **_COMMON,
    },
    "hall_part": {
        "name": Key("text"),
        "layout": Key("text", default="three"),
        "gain": Key("V/T", 1e-3, 1e6, default=math.nan),
        "gain_tolerance": Key("1", 0, 1, default=0.05),
        "gain_drift": Key("1/K", -1, 1, default=math.nan),
        "null": Key("V", 0, 100, default=2.5),
        "null_tolerance": Key("V", 0, 100, default=math.nan),
        "low": Key("V", 0, 100, default=0.2),
        "high": Key("V", 0, 100, default=4.8),
        "noise_density": Key("T/sqrt(Hz)", 0, 1e-3, default=130e-9),
        "bandwidth": Key("Hz", 1, 1e7, default=20e3),
        "plate": Key("mm", 0, 10, default=0.0),
        "range": Key("T", 1e-6, 10, default=math.nan),
        "step": Key("T", 0, 1, default=math.nan),
        "noise": Key("T", 0, 1, default=math.nan),
        "rate": Key("Hz", 1e-3, 1e7, default=math.nan),
        "offset": Key("T", 0, 10, default=math.nan),
        "plate_height": Key("mm", 0, 20, default=math.nan),
        "body": Key("mm", 0.1, 100, 3, default=(4.06, 3.0, 1.57)),
        **_COMMON,
    },
    "silicone": {
        "name": Key("text"),
        "E": Key("MPa", 1e-4, 1e4, 3),
        "nu": Key("1", 0.3, 0.5, 3, default=(0.49, 0.4998, 0.4999)),
        "density": Key("kg/m3", 100, 25000, default=1080.0),
        "cure_temperature": Key("C", 0, 400, default=23.0),
        "cure_hours": Key("h", 0, 1000, default=24.0),
        "mixed": Key("text", default="by its data sheet"),
        **_COMMON,
    },
}
"""Keys of the tables. The defaults of one-axis parts are those of an SS495A, with the noise of a DRV5055."""
OF_CHIP = ("range", "step", "noise", "rate", "offset", "plate_height")
OF_ONE_AXIS = ("gain", "null", "null_tolerance", "low", "high", "noise_density", "bandwidth", "plate")
"""Keys of a Hall part that only a chip of one's own, and only a one-axis part, has."""
ENDS = {2: "[low, high]", 3: "[low, typical, high]"}
"""How a key with several numbers is written."""


@dataclass(frozen=True, slots=True)
class CatalogueFile:
    """What a file holds, each entry by its name; magnets without the values of their grades."""

    path: str
    grades: dict[str, dict[str, Any]]
    magnets: dict[str, dict[str, Any]]
    hall_parts: dict[str, HallPartEntry]
    silicones: dict[str, SiliconeEntry]


def read_catalogue(path: str) -> CatalogueFile:
    """Read and check the entries of a file.

    Raises
    ------
    BadInput
        The file cannot be read or has no entry; a key, unit or name is unknown, missing or given twice; or a value is
        out of range.
    """
    table = toml_table(path, "file")
    check_keys(path, table, KEYS)
    if not any(table.get(name) for name in KEYS):
        raise BadInput(f"{path}: the catalogue is empty: add a table [[magnet]], [[hall_part]] or [[silicone]]")
    named = {name: _by_name(path, name, table.get(name, [])) for name in KEYS}
    return CatalogueFile(
        path,
        named["grade"],
        named["magnet"],
        {name: _hall_part(f"{path}: {name}", entry) for name, entry in named["hall_part"].items()},
        {name: _silicone(entry) for name, entry in named["silicone"].items()},
    )


def _by_name(path: str, array: str, tables: object) -> dict[str, dict[str, Any]]:
    """Return the checked tables of an array by their names."""
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise BadInput(f"{path}: {array} must be an array of tables: write [[{array}]]")
    named: dict[str, dict[str, Any]] = {}
    for number, table in enumerate(tables, 1):
        entry = _entry(path, array, table, number)
        if entry["name"] in named:
            raise BadInput(f"{path}: two tables [[{array}]] have the name {entry['name']!r}: rename or remove one")
        named[entry["name"]] = entry
    return named


def _entry(path: str, array: str, table: Mapping[str, Any], number: int) -> dict[str, Any]:
    """Return the values of a table in the units of magtip; `assumed` also names what the table leaves out."""
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
        unset = (*table, "name", "layout", "source", "assumed")
        # what has no default is unknown, and not assumed
        left_out = [key for key, kind in keys.items() if key not in unset and kind.default == kind.default]
        entry["assumed"] = (*entry["assumed"], *left_out)
    if array == "magnet":
        _check_magnet(where, entry)
        entry["name"] = entry["name"] or f"{entry['diameter']:g}x{entry['height']:g}"
    return entry


def _value(where: str, value: object, key: Key) -> Any:
    """Return a value that has been checked against its key."""
    if key.unit == "text":
        if not isinstance(value, str) or not value.strip():
            raise BadInput(f"{where} must be a text; got {value!r:.60}")
        return value
    if key.unit == "names":
        if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
            raise BadInput(f"{where} must be a list of names; got {value!r:.60}")
        return tuple(value)
    if key.count == 1:
        return quantity(where, value, key.unit, key.low, key.high)
    ends = ENDS[key.count] if not where.endswith("body") else "[width, height, thickness]"
    if not isinstance(value, list) or len(value) != key.count:
        raise BadInput(f"{where} must be {ends}; got {value!r:.60}")
    numbers = tuple(quantity(where, number, key.unit, key.low, key.high) for number in value)
    if list(numbers) != sorted(numbers) and not where.endswith("body"):
        raise BadInput(f"{where} must be {ends}, none above the next; got {', '.join(f'{n:g}' for n in numbers)}")
    return numbers


def _check_magnet(where: str, entry: Mapping[str, Any]) -> None:
    """Raise BadInput for a magnet without a grade, or with an edge that is wider than itself."""
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
    width, height, thickness = known["body"]
    body = {"width": width, "height": height, "thickness": thickness, "plate_height": None}
    values = {key: value for key, value in known.items() if key not in (*OF_CHIP, "body")}
    return HallPartEntry(**values, **body, noise=None, rate=None, step=0.0)


def _of_chip(chip: HallChip, layout: str) -> HallPartEntry:
    width, height, thickness = chip.body
    assumed = chip.assumed if chip.gain_tolerance is not None else (*chip.assumed, "gain_tolerance")
    return HallPartEntry(
        name=chip.name,
        layout=layout,
        gain=1.0,
        gain_tolerance=KEYS["hall_part"]["gain_tolerance"].default
        if chip.gain_tolerance is None
        else chip.gain_tolerance,
        gain_drift=chip.gain_drift,
        null=0.0,
        null_tolerance=chip.offset,
        low=-chip.range,
        high=chip.range,
        noise_density=None,
        noise=chip.noise,
        rate=chip.rate,
        bandwidth=None,
        step=chip.step,
        plate=0.0,
        width=width,
        height=height,
        thickness=thickness,
        plate_height=chip.plate,
        source=chip.source,
        assumed=assumed,
    )


def _silicone(entry: Mapping[str, Any]) -> SiliconeEntry:
    """Return a silicone."""
    values = {key: value for key, value in entry.items() if key not in ("E", "nu")}
    E_low, E, E_high = entry["E"]
    nu_low, nu, nu_high = entry["nu"]
    return SiliconeEntry(**values, E_low=E_low, E=E, E_high=E_high, nu_low=nu_low, nu=nu, nu_high=nu_high)


AMBIENT = "ambient"
"""Layout of a chip that measures the ambient field beside a sensor, and saturates at its magnet."""
FOLDER = Path(__file__).parent
"""Folder of the shipped catalogues."""
TABLES = {"magnets": "magnet", "hall_parts": "hall_part", "silicones": "silicone"}
"""Name of the tables in a file, by the kind of parts."""

Part = TypeVar("Part", MagnetEntry, HallPartEntry, SiliconeEntry)


def catalogues_of(requirements: Requirements) -> Catalogues:
    """Return the parts in use.

    Raises
    ------
    BadInput
        A file cannot be used, two files of the user share a name, a name is unknown, no part of a kind is left, or no
        magnet fits into the largest beam.

    >>> [part.name for part in catalogues_of(Requirements(force_z=5.0, magnets=("4x2 N35",))).magnets]
    ['4x2 N35']
    """
    users = [read_catalogue(path) for path in requirements.catalogues]
    for kind in CATALOGUES:
        _check_apart(kind, users)
    ours = {kind: read_catalogue(str(FOLDER / f"{kind}.toml")) for kind in CATALOGUES}
    grades = {name: grade for file in (ours["magnets"], *users) for name, grade in file.grades.items()}
    files = {kind: ([ours[kind]] if kind in requirements.shipped else []) + users for kind in CATALOGUES}
    magnets = _in_use("magnets", _magnets(files["magnets"], grades), requirements)
    _check_fit(magnets, requirements)
    chips = {chip.name: _of_chip(chip, layout) for layout, chip in CHIPS.items()}
    shipped = [chips] if "hall_parts" in requirements.shipped else []
    hall_parts = _merged([*shipped, *(file.hall_parts for file in files["hall_parts"])])
    unusable = {name: part.unusable for name, part in hall_parts.items() if part.unusable}
    for name in requirements.hall_parts:
        if name in unusable:
            raise BadInput(f"hall_parts: no sensor can be sized with {name}: {unusable[name]}")
    return Catalogues(
        magnets,
        _in_use("hall_parts", {k: part for k, part in hall_parts.items() if k not in unusable}, requirements),
        _in_use("silicones", _merged(file.silicones for file in files["silicones"]), requirements),
        tuple(hall_parts[name] for name in unusable),
    )


def silicone_of(name: str) -> Silicone:
    """Return what a casting recipe needs to know of a silicone of the shipped catalogue.

    Raises
    ------
    BadInput
        There is no silicone of this name.

    >>> silicone_of("Sylgard 184").mixed
    '10A:1B by weight'
    """
    shipped = read_catalogue(str(FOLDER / "silicones.toml")).silicones
    if name not in shipped:
        raise BadInput(f"the catalogue has no silicone {name!r}: {nearest(name, shipped)}")
    return mix_of(shipped[name])


def mix_named(option: str | None, of_design: str) -> Silicone | None:
    """Return what a recipe knows of the silicone that an option names, or else the design; None: no mix is known.

    An option must name a silicone of the shipped catalogue; a design may be of another one.
    """
    shipped = read_catalogue(str(FOLDER / "silicones.toml")).silicones
    if option is None and of_design not in shipped:
        return None
    return silicone_of(of_design if option is None else option)


def mix_of(part: SiliconeEntry) -> Silicone:
    """Return what a casting recipe needs to know of a silicone."""
    keys = {"mixed": "mixed", "hours": "cure_hours", "density": "density"}
    assumed = tuple(key for key, name in keys.items() if name in part.assumed)
    cure, moduli = (part.cure_hours, part.cure_temperature), (part.E_low, part.E_high)
    return Silicone(part.name, part.mixed, *cure, part.density, moduli, part.source, assumed)


def rows(parts: Iterable[MagnetEntry | HallPartEntry | SiliconeEntry]) -> list[dict[str, Any]]:
    """Return a row for each part, with the units in the names of the columns."""
    table = []
    for part in parts:
        row = {COLUMNS.get(name, name): value for name, value in dataclasses.asdict(part).items()}
        if isinstance(part, HallPartEntry):
            row["gain_V_per_mT"] = part.gain / 1000 if part.layout == "three" else None
            row["noise_density_V_per_sqrtHz"] = part.noise_fields().get("hall_noise_density")
            row["left_out"] = part.unusable
        table.append(row | {"assumed": ", ".join(part.assumed)})
    return table


COLUMNS = {
    **{name: f"{name}_mm" for name in ("diameter", "height", "edge_radius", "tolerance", "plate", "width")},
    **{name: f"{name}_C" for name in ("largest_temperature", "cure_temperature")},
    **{name: f"{name}_T" for name in ("remanence_low", "remanence_high", "noise", "step")},
    "rate": "rate_Hz",
    "gain_drift": "gain_drift_per_K",
    "plate_height": "plate_height_mm",
    **{name: f"{name}_MPa" for name in ("E_low", "E", "E_high")},
    "thickness": "thickness_mm",
    "cure_hours": "cure_h",
    "density": "density_kg_per_m3",
    "bandwidth": "bandwidth_Hz",
    "gain": "gain_V_per_mT",
    "noise_density": "noise_density_V_per_sqrtHz",
}
"""Columns that carry a unit, by field. null, low, high and null_tolerance have none: V for one-axis parts, T for
chips."""


def _check_apart(kind: str, users: Sequence[CatalogueFile]) -> None:
    """Raise BadInput if two files of the user have a part of the same name."""
    where: dict[str, str] = {}
    for file in users:
        for name in getattr(file, kind):
            if name in where:
                raise BadInput(f"{file.path}: {where[name]} has a part {name!r} too: rename or remove one of them")
            where[name] = file.path


def _merged(files: Iterable[Mapping[str, Part]]) -> dict[str, Part]:
    """Return the parts of all files by their names; later files replace parts of earlier ones."""
    return {name: part for file in files for name, part in file.items()}


def _magnets(files: Sequence[CatalogueFile], grades: Mapping[str, Mapping[str, Any]]) -> dict[str, MagnetEntry]:
    """Return a magnet for each size and each of its grades, by name."""
    merged: dict[str, MagnetEntry] = {}
    for file in files:
        for size, values in file.magnets.items():
            for name in values["grades"]:
                if name not in grades:
                    raise BadInput(f"{file.path}: {size}: there is no grade {name!r}: {nearest(name, grades)}")
                merged[f"{size} {name}"] = _graded(values, name, grades[name])
    return merged


def _graded(size: Mapping[str, Any], grade_name: str, grade: Mapping[str, Any]) -> MagnetEntry:
    """Return the magnet of a size and a grade."""
    low, high = grade["remanence"]
    values = {key: value for key, value in size.items() if key not in ("grades", "name", "source")}
    return MagnetEntry(
        name=f"{size['name']} {grade_name}",
        grade=grade_name,
        remanence_low=low,
        remanence_high=high,
        largest_temperature=grade["largest_temperature"],
        source=f"{size['source']}; {grade_name}: {grade['source']}",
        **values,
    )


def _in_use(kind: str, parts: Mapping[str, Part], requirements: Requirements) -> tuple[Part, ...]:
    """Return the parts that the requirements name, or all of them."""
    names = getattr(requirements, kind) or tuple(parts)
    if not parts:
        raise BadInput(
            f"the catalogue of {kind} is empty: add {kind} to `shipped`, or tables [[{TABLES[kind]}]] to a file of "
            "`catalogues`"
        )
    for name in names:
        if name not in parts:
            raise BadInput(f"{kind}: the catalogues have no {name!r}: {_close(name, parts)}")
    return tuple(parts[name] for name in names)


def _check_fit(magnets: Sequence[MagnetEntry], requirements: Requirements) -> None:
    """Raise BadInput if no magnet leaves silicone beside it in the largest beam that the requirements allow."""
    widest = min(requirements.D_high or math.inf, requirements.outer_size or math.inf)
    least = min(magnets, key=lambda magnet: magnet.diameter)
    if least.diameter + 2 * LEAST_WALL > widest:
        raise BadInput(
            f"no magnet in use fits into a beam of {widest:g} mm: the smallest one, {least.name}, needs "
            f"{least.diameter + 2 * LEAST_WALL:g} mm with the silicone beside it"
        )


def _close(name: str, parts: Iterable[str]) -> str:
    """Return the remedy for an unknown part; a long list of all parts would hide it."""
    text = nearest(name, parts)
    return text if text.startswith("did") else "`magtip catalogue` lists all parts"
