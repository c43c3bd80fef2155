"""The map of a layout of Hall elements as a table: a row for each pose of the magnet."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from geometry.loads import tilts_of
from studies.output import records
from studies.output.records import FlatRow

if TYPE_CHECKING:
    from analytic.decode import Decoder
    from analytic.survey import Survey


def _field_columns(fields_mT: Mapping[str, float]) -> FlatRow:
    return {f"{element}_mT": field for element, field in fields_mT.items()}


@dataclass(frozen=True, slots=True)
class PoseRow:
    """A pose of the map.

    Attributes
    ----------
    fields_mT : reading B.n of each element.
    known, saturated, blocked : 0 or 1; `known` is 1 if the pose lies within the range of the mechanics.
    det_sign : sign of det J.
    multiplicity : number of poses with these readings; None if they were not searched.
    """

    x_mm: float
    y_mm: float
    z_mm: float
    tilt_rad: float
    tilt_y_rad: float
    fields_mT: dict[str, float] = field(metadata={"columns": _field_columns})
    known: int
    blocked: int
    saturated: int
    det_sign: int
    condition: float
    multiplicity: int | None
    alike_apart_mm: float
    noise_um: float
    noise_N: float

    def row(self) -> FlatRow:
        """Return the flat row for layout.csv."""
        return records.flat(self)


def table(coder: Decoder, poses: Survey) -> Iterator[PoseRow]:
    """Return the row of each pose of the map."""
    from analytic.parts import columns

    names = columns(coder.forward.elements)
    known, blocked = poses.weight > 0, poses.blocked
    tilt, tilt_y = tilts_of(*poses.tilt)
    for k in range(len(known)):
        readings = poses.readings[:, k].tolist()
        x, y, z = poses.shift[:, k].tolist()
        yield PoseRow(
            x_mm=x,
            y_mm=y,
            z_mm=z,
            tilt_rad=tilt[k],
            tilt_y_rad=tilt_y[k],
            fields_mT={name: 1e3 * b for name, b in zip(names, readings, strict=True)},
            known=int(known[k]),
            blocked=int(blocked[k]),
            saturated=int(poses.saturated[k]),
            det_sign=int(poses.sign[k]),
            condition=poses.condition[k],
            multiplicity=int(poses.multiplicity[k]) or None,
            alike_apart_mm=poses.alike_mm[k],
            noise_um=1e3 * poses.noise_mm[k],
            noise_N=poses.noise_N[k],
        )
