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


@dataclass(frozen=True, slots=True)
class Silicone:
    """What a recipe needs to know of a silicone.

    Attributes
    ----------
    mixed : ratio of the parts.
    hours, temperature : of a cure without an oven, h and °C.
    density : kg/m³. moduli : least and largest Young's modulus, MPa.
    source : data sheet or publication.
    assumed : those of "mixed", "hours" and "density" whose source was not read.
    """

    name: str
    mixed: str
    hours: float
    temperature: float
    density: float
    moduli: tuple[float, float]
    source: str
    assumed: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class FabricationRow:
    """The result of fabricating one design.

    Attributes
    ----------
    status : ok, failed (a check fails, and no file is written) or bad_input.
    message : reason of a failure; empty if status is ok.
    size, recipe : see `design_summary.outer_size` and `casting_recipe.recipe_of`; empty if no solids were made.
    variant : fields of the design that vary in a batch, with their values.
    """

    status: str
    message: str
    folder: Path
    parts: tuple[FlatRow, ...] = ()
    checks: tuple[Check, ...] = ()
    size: FlatRow = field(default_factory=dict)
    recipe: FlatRow = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    variant: Mapping[str, float] = field(default_factory=dict)

    def row(self) -> FlatRow:
        """Return the flat row that JSON and the terminal show."""
        row: FlatRow = {
            **self.variant,
            "status": self.status,
            "message": self.message,
            "folder": self.folder,
            "parts": list(self.parts),
            "checks": [dataclasses.asdict(check) for check in self.checks],
        }
        row |= self.size or {"assembled_size_mm": None}
        return row | ({"recipe": self.recipe} if self.recipe else {}) | {"warnings": list(self.warnings)}
