"""The parts from which a sensor is sized: magnets, Hall parts and silicones that are sold, with ranges and sources.

Files have the form of `catalogue_file`; the shipped ones in this folder are the examples. A magnet stands for one
part of each of its grades, such as "4x2 N35". An entry of a user's file replaces the shipped one of the same name;
all others are added.

Input that cannot be used raises a `BadInput` here, whose message is one sentence with the remedy.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from geometry.bad_input import nearest
from geometry.design import LEAST_WALL, BadInput, Design
from geometry.hall_chips import AMBIENT, CHIPS, OWN, HallChip
from studies.parts.requirements import CATALOGUES, Requirements

if TYPE_CHECKING:
    from studies.parts.catalogue_file import Grade, HallPart, Magnet, Silicone

FILTER = math.pi / 2
"""Bandwidth of white noise over the -3 dB bandwidth of a low pass of first order."""
SPRING_GAP, PRESS_GAP = 8 / math.pi**2 * 0.915965594177219, 1.15
"""Gap of a linear spring over tan(delta), see `analytic.relaxation_loops`; and that of a press over it, assumed: 1.11
and 1.14 in the second cycle of the paper's sensor by finite elements, 1 and 2.4 mm deep."""


Mix = Mapping[str, Any]
"""What a recipe says of a silicone: its name, the ratio in which it is mixed with its source, its pot life, min,
hours and temperature of a cure without an oven, °C, its density, kg/m³, least and largest modulus, MPa, their
source, and which of these are assumed."""
ASSUMED_LOSS = Design().loss_factor
"""Loss factor of a design that states none; of a silicone of unknown loss factor it says nothing."""


@dataclass(frozen=True, slots=True)
class MagnetEntry:
    """A cylindrical magnet that is sold, magnetised along its axis: a size in one grade (`catalogue_file.Magnet`)."""

    name: str
    grade: str
    diameter: float
    height: float
    edge_radius: float
    tolerance: float
    remanence_low: float
    remanence_high: float
    remanence_drift: float
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
            "remanence_drift": 100 * self.remanence_drift,
            "magnet_density": self.density,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class HallPartEntry:
    """A Hall part that is sold: one-axis parts, of which a sensor has three, or a 3-axis chip. None is unknown.

    Of a chip the gain is 1, null, its tolerance and rails are in T, and width, height and thickness are its size
    along x, along y and over its board. The others are those of `catalogue_file.HallPart`. `count` is the number of
    such chips in a sensor.
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
            # a gain whose drift is unknown is taken as constant
            values = {name: getattr(self, name) for name in names} | {"gain_drift": 100 * (self.gain_drift or 0.0)}
            return {"hall_layout": "three", **{f"hall_{name}": value for name, value in values.items()}}
        values = {"count": float(self.count)} if self.count > 1 else {}
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
        if not self.unusable and self.layout == "three" and needed.pitch is not None:
            return "the base of an array is made for chips: leads of one-axis parts run to the edge of their own base"
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
    """A castable silicone: least, typical and largest published values, see `catalogue_file.Silicone`.

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
    mixed_source: str
    pot_life: float | None
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


FOLDER = Path(__file__).parent
"""Folder of the shipped catalogues."""
OF_ONE_AXIS = ("gain", "null", "null_tolerance", "low", "high", "noise_density", "bandwidth", "plate")
"""Values of a Hall part that only a one-axis part has."""
USUAL_GAIN = 0.05
"""Largest relative deviation of the gain of a chip of which none is known."""
Named = dict[str, dict[str, Any]]
"""Grades and magnets as their file has them, Hall parts and silicones, by kind and name."""


def read_catalogue(path: str) -> Named:
    """Read and check the entries of a file."""
    from studies.parts import catalogue_file

    tables = catalogue_file.read(path)
    return {
        "grades": tables["grade"],
        "magnets": tables["magnet"],
        "hall_parts": {name: _hall_part(table) for name, table in tables["hall_part"].items()},
        "silicones": {name: _silicone(table) for name, table in tables["silicone"].items()},
    }


def _hall_part(table: HallPart) -> HallPartEntry:
    assumed = table.all_assumed
    if table.layout == "three":
        names = ("name", "layout", *OF_ONE_AXIS, "gain_tolerance", "gain_drift", "source")
        values = {name: getattr(table, name) for name in names}
        return HallPartEntry(**values, **_body(table.body), assumed=assumed)
    values = {name: getattr(table, name) for name in ("name", "noise", "rate", "offset", "gain_drift", "source")}
    if table.layout in CHIPS:
        values = {name: value for name, value in values.items() if value is not None}
        if "gain_tolerance" not in assumed:
            values["gain_tolerance"] = table.gain_tolerance
        return _of_chip(dataclasses.replace(CHIPS[table.layout], **values), table.layout)
    assert table.range is not None
    assert table.step is not None
    known = table.plate_height is not None
    chip = HallChip(
        **values,
        range=table.range,
        step=table.step,
        body=table.body,
        plate=table.plate_height if table.plate_height is not None else table.body[2] / 2,
        gain_tolerance=table.gain_tolerance,
        assumed=(*(name for name in assumed if name not in OF_ONE_AXIS), *([] if known else ["plate_height"])),
    )
    return _of_chip(chip, table.layout)


def _body(body: tuple[float, ...]) -> dict[str, Any]:
    return dict(zip(("width", "height", "thickness"), body, strict=True))


def _of_chip(chip: HallChip, layout: str) -> HallPartEntry:
    return HallPartEntry(
        name=chip.name,
        layout=layout,
        gain_drift=chip.gain_drift,
        noise=chip.noise,
        rate=chip.rate,
        step=chip.step,
        source=chip.source,
        gain_tolerance=USUAL_GAIN if chip.gain_tolerance is None else chip.gain_tolerance,
        null_tolerance=chip.offset,
        low=-chip.range,
        high=chip.range,
        **_body(chip.body),
        plate_height=chip.plate,
        assumed=(*chip.assumed, *(["gain_tolerance"] if chip.gain_tolerance is None else [])),
    )


def _silicone(table: Silicone) -> SiliconeEntry:
    known = table.loss_factor is not None
    band = table.loss_frequency if known else (None, None)
    values: dict[str, Any] = dict(zip(("loss_low", "loss_high"), band, strict=True))
    for name, numbers in (("E", table.E), ("nu", table.nu), ("loss_factor", table.loss_factor or (None,) * 3)):
        values |= dict(zip((f"{name}_low", name, f"{name}_high"), numbers, strict=True))
    return SiliconeEntry(
        **values,
        name=table.name,
        density=table.density,
        loss_source=(table.loss_source or table.source) if known else "",
        cure_temperature=table.cure_temperature,
        cure_hours=table.cure_hours,
        mixed=table.mixed,
        mixed_source=table.mixed_source or table.source,
        pot_life=table.pot_life,
        source=table.source,
        assumed=tuple(name for name in table.all_assumed if known or name != "loss_frequency"),
    )


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
    keys = {"mixed": "mixed", "hours": "cure_hours", "density": "density", "pot_life": "pot_life"}
    return {
        "name": part.name,
        "mixed": part.mixed,
        "mixed_source": part.mixed_source,
        "pot_life": part.pot_life,
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
    "min": ("pot_life",),
    "T": ("remanence_low", "remanence_high", "noise", "step"),
    "MPa": ("E_low", "E", "E_high"),
    "Hz": ("rate", "bandwidth", "loss_low", "loss_high"),
    "per_K": ("gain_drift", "remanence_drift"),
    "kg_per_m3": ("density",),
    "V_per_mT": ("gain",),
    "V_per_sqrtHz": ("noise_density",),
}
COLUMNS = {name: f"{name}_{unit}" for unit, names in UNITS.items() for name in names} | {"cure_hours": "cure_h"}
"""Columns that carry a unit, by field; the null, its tolerance and the rails are in V, or in T of a chip."""


def _magnets(path: str, sizes: Mapping[str, Magnet], grades: Mapping[str, Grade]) -> dict[str, MagnetEntry]:
    found: dict[str, MagnetEntry] = {}
    for size, table in sizes.items():
        for name in table.grades:
            if name not in grades:
                raise BadInput(f"{path}: {size}: there is no grade {name!r}: {nearest(name, grades)}")
            grade = grades[name]
            found[f"{size} {name}"] = MagnetEntry(
                name=f"{size} {name}",
                grade=name,
                diameter=table.diameter,
                height=table.height,
                edge_radius=table.edge_radius,
                tolerance=table.tolerance,
                remanence_low=grade.remanence[0],
                remanence_high=grade.remanence[1],
                remanence_drift=grade.remanence_drift,
                largest_temperature=grade.largest_temperature,
                density=table.density,
                source=f"{table.source}; {name}: {grade.source}",
                assumed=table.all_assumed,
            )
    return found


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
