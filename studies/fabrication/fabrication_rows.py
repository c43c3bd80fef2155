"""What was made of a design: parts, checks, outer size, recipe and warnings, as one row."""

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
    """How hot the cures in a mould of one material may be, °C; the second one is with the magnet, None without."""

    mold_material: str
    mold_limit_C: float
    first_cure_C: float
    second_cure_C: float | None


@dataclass(frozen=True, slots=True)
class Dowels:
    """Dowels that align the halves of a split mould."""

    count: int
    diameter_mm: float
    length_mm: float


@dataclass(frozen=True, slots=True)
class Recipe:
    """Temperatures and dowels of a casting; None without a magnet, and without a split mould."""

    magnet_limit_C: float | None
    cures: tuple[Cure, ...]
    dowels: Dowels | None


@dataclass(frozen=True, slots=True)
class FabricationRow:
    """What was made of a design.

    Attributes
    ----------
    status : ok, failed (a check fails, and no file is written) or bad_input.
    size, recipe : None where nothing was begun.
    variant : fields in which the design differs from the others of a batch.
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
        """The flat row of JSON and of the terminal."""
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
