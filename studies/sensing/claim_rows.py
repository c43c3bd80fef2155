"""The rows of the claim that readings are unique to each place of the magnet."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field

from studies.output import records
from studies.output.records import FlatRow


@dataclass(frozen=True, slots=True)
class AlikeFigures:
    """Which share of the poses reads alike, and where those are: least and largest shift along each axis, mm."""

    unique_percent: float
    alike_percent: float
    rarer_det_percent: float
    alike_apart_mm: float
    alike_x_mm: list[float] | None
    alike_y_mm: list[float] | None
    alike_z_mm: list[float] | None
    blocked_percent: float
    condition_worst: float


@dataclass(frozen=True, slots=True)
class Difference:
    """The least difference in the readings, over their noise, of two poses that are at least `apart` mm apart."""

    apart: float
    over_noise: float


def _difference_columns(differences: Sequence[Difference]) -> FlatRow:
    return {f"difference_at_{each.apart:.2g}_mm_over_noise": each.over_noise for each in differences}


@dataclass(frozen=True, slots=True)
class FormRow:
    """The design's own layout, for one form of the readings."""

    readings: str
    figures: AlikeFigures = field(metadata={"prefix": ""})
    workspace_mm: list[list[float]]
    differences: tuple[Difference, ...] = field(metadata={"columns": _difference_columns})

    def row(self) -> FlatRow:
        """Return the flat row for JSON."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class HeightRow:
    """One height c of S2 and S3, for one magnet and one form of the readings."""

    magnet_height_mm: float
    l0_mm: float
    c_mm: float
    readings: str
    figures: AlikeFigures = field(metadata={"prefix": ""})

    def row(self) -> FlatRow:
        """Return the flat row for claim.csv and JSON."""
        return records.flat(self)


def _height_columns(name: str, height: HeightRow | None) -> FlatRow:
    return {name: None if height is None else height.row()}


@dataclass(frozen=True, slots=True)
class LimitRow:
    """The range of c, about the design's own, in which readings are unique, and what happens just outside.

    An end is None where the scan ends before. If the readings are not unique at the c nearest the design's, what
    happens there is `below`.
    """

    magnet_height_mm: float
    l0_mm: float
    readings: str
    unique: bool
    unique_from_c_mm: float | None
    below: HeightRow | None = field(metadata={"columns": functools.partial(_height_columns, "below")})
    unique_to_c_mm: float | None
    above: HeightRow | None = field(metadata={"columns": functools.partial(_height_columns, "above")})

    def row(self) -> FlatRow:
        """Return the row for JSON, which contains the rows below and above as objects."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class Claim:
    """The answer to the claim.

    Attributes
    ----------
    forms : one row for each form of the readings, for the design's own layout.
    limits : range of c in which each form is unique.
    heights : one row for each c.
    """

    forms: list[FormRow]
    limits: list[LimitRow]
    heights: list[HeightRow]

    def row(self) -> FlatRow:
        """Return the rows for JSON."""
        return {
            "forms": [row.row() for row in self.forms],
            "limits": [row.row() for row in self.limits],
            "heights": [row.row() for row in self.heights],
        }
