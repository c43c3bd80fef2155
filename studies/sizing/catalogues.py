"""The parts from which a sensor is sized: shipped catalogues and the user's, less what the requirements leave out.

An entry of a user's file replaces the shipped one of the same name; all others are added. Input that cannot be used
raises a `BadInput` here, whose message is one sentence with the remedy.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from geometry.bad_input import nearest
from geometry.design import LEAST_WALL, BadInput
from studies.fabrication.fabrication_rows import Silicone
from studies.sizing.catalogue_entries import HallPartEntry, MagnetEntry, SiliconeEntry
from studies.sizing.catalogue_files import CatalogueFile, read_catalogue
from studies.sizing.requirements import CATALOGUES, Requirements

FOLDER = Path(__file__).parent
"""Folder of the shipped catalogues."""
TABLES = {"magnets": "magnet", "hall_parts": "hall_part", "silicones": "silicone"}
"""Name of the tables in a file, by the kind of parts."""

Part = TypeVar("Part", MagnetEntry, HallPartEntry, SiliconeEntry)


@dataclass(frozen=True, slots=True)
class Catalogues:
    """The parts in use; there is one or more of each kind."""

    magnets: tuple[MagnetEntry, ...]
    hall_parts: tuple[HallPartEntry, ...]
    silicones: tuple[SiliconeEntry, ...]


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
    return Catalogues(
        magnets,
        _in_use("hall_parts", _merged(file.hall_parts for file in files["hall_parts"]), requirements),
        _in_use("silicones", _merged(file.silicones for file in files["silicones"]), requirements),
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


def mix_of(part: SiliconeEntry) -> Silicone:
    """Return what a casting recipe needs to know of a silicone."""
    assumed = tuple(key for key, name in {"mixed": "mixed", "hours": "cure_hours"}.items() if name in part.assumed)
    return Silicone(part.name, part.mixed, part.cure_hours, part.cure_temperature, part.source, assumed)


def rows(parts: Iterable[MagnetEntry | HallPartEntry | SiliconeEntry]) -> list[dict[str, Any]]:
    """Return a row for each part, with the units in the names of the columns."""
    table = []
    for part in parts:
        row = {COLUMNS.get(name, name): value for name, value in dataclasses.asdict(part).items()}
        if isinstance(part, HallPartEntry):
            row["gain_V_per_mT"] = part.gain / 1000 if part.layout == "three" else None
            row["noise_density_V_per_sqrtHz"] = part.noise_fields().get("hall_noise_density")
        table.append(row | {"assumed": ", ".join(part.assumed)})
    return table


COLUMNS = {
    **{name: f"{name}_mm" for name in ("diameter", "height", "edge_radius", "tolerance", "plate", "width")},
    **{name: f"{name}_C" for name in ("largest_temperature", "cure_temperature")},
    **{name: f"{name}_T" for name in ("remanence_low", "remanence_high", "noise", "step")},
    **{name: f"{name}_MPa" for name in ("E_low", "E", "E_high")},
    "thickness": "thickness_mm",
    "cure_hours": "cure_h",
    "density": "density_kg_per_m3",
    "bandwidth": "bandwidth_Hz",
    "gain": "gain_V_per_mT",
    "noise_density": "noise_density_V_per_sqrtHz",
}
"""Columns that carry a unit, by field. null, low and high have none: V for one-axis parts, T for chips."""


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
