"""The result of fabricating one design: parts, checks, outer size, recipe and warnings, as one row."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from studies.output.records import FlatRow

if TYPE_CHECKING:
    from geometry.fabrication.printability import Check
    from geometry.fabrication.solid_files import Exported
    from studies.simulation.design_summary import OuterSize


@dataclass(frozen=True, slots=True)
class Cure:
    """Greatest temperatures of the cures in a mould of one material, °C; `second_cure_C` is None without a magnet."""

    mold_material: str
    mold_limit_C: float
    first_cure_C: float
    second_cure_C: float | None


@dataclass(frozen=True, slots=True)
class Dowels:
    """Pins across the split that align the halves of a mould, in holes wide enough to slide."""

    count: int
    diameter_mm: float
    length_mm: float
    hole_mm: float


@dataclass(frozen=True, slots=True)
class Screws:
    """Screws with nuts that clamp the halves of a split mould; `length_mm` holds two washers and a nut."""

    count: int
    thread: str
    length_mm: float


@dataclass(frozen=True, slots=True)
class Silicone:
    """What a recipe needs to know of a silicone.

    Attributes
    ----------
    mixed : ratio of the parts.
    hours, temperature : of a cure without an oven, h and °C.
    source : data sheet or publication.
    assumed : those of "mixed" and "hours" whose source was not read.
    """

    name: str
    mixed: str
    hours: float
    temperature: float
    source: str
    assumed: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Recipe:
    """Temperatures and dowels of a casting.

    Attributes
    ----------
    magnet_limit_C : working limit of the magnet; None without a magnet.
    cures : one for each material that the mould can be printed from.
    dowels, screws : None if the mould is not split.
    silicone : None where the design names none.
    magnets_apart_mm : distance of the axes from which the magnets of neighbouring cavities stay where they are put;
        None without a magnet.
    """

    magnet_limit_C: float | None
    cures: tuple[Cure, ...]
    dowels: Dowels | None
    screws: Screws | None = None
    silicone: Silicone | None = None
    magnets_apart_mm: float | None = None


@dataclass(frozen=True, slots=True)
class FabricationRow:
    """The result of fabricating one design.

    Attributes
    ----------
    status : ok, failed (a check fails, and no file is written) or bad_input.
    message : reason of a failure; empty if status is ok.
    size, recipe : None if no solids were made.
    variant : fields of the design that vary in a batch, with their values.
    """

    status: str
    message: str
    folder: Path
    parts: tuple[Exported, ...] = ()
    checks: tuple[Check, ...] = ()
    size: OuterSize | None = None
    recipe: Recipe | None = None
    warnings: tuple[str, ...] = ()
    variant: Mapping[str, float] = field(default_factory=dict)

    def row(self) -> FlatRow:
        """Return the flat row that JSON and the terminal show."""
        row: FlatRow = {
            **self.variant,
            "status": self.status,
            "message": self.message,
            "folder": self.folder,
            "parts": [dataclasses.asdict(part) for part in self.parts],
            "checks": [dataclasses.asdict(check) for check in self.checks],
        }
        row |= {"assembled_size_mm": None} if self.size is None else dataclasses.asdict(self.size)
        row |= {} if self.recipe is None else {"recipe": dataclasses.asdict(self.recipe)}
        return row | {"warnings": list(self.warnings)}
