"""What a printer can make, and a maker may choose: process, ranges, printed side, overhangs. Lengths mm, areas mm².

Parts are printed without supports: a face that looks down may lean by 45° from the vertical at most, unless it lies
on the printer's bed or is the flat roof of a pocket narrow enough to be bridged. The figures are rules of thumb of
filament (fdm) and resin (sla) printing, not of a certain machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from geometry.cad import moved
from geometry.design import BadInput

if TYPE_CHECKING:
    from build123d import Solid


@dataclass(frozen=True, slots=True)
class Process:
    """Defaults of a printing process, mm.

    Attributes
    ----------
    fit : gap between surfaces that slide into each other.
    wall : of a mould.
    bridge : widest flat roof that prints without support.
    detail : thinnest pin or wall that comes out.
    """

    name: str
    fit: float
    wall: float
    bridge: float
    detail: float


PROCESSES = {
    "fdm": Process("filament", fit=0.2, wall=3.0, bridge=10.0, detail=0.8),
    "sla": Process("resin", fit=0.1, wall=2.0, bridge=5.0, detail=0.3),
}

STEEPEST = math.cos(math.radians(45))
"""Downward part of a facet's unit normal from which on it overhangs."""

TURNS = [math.radians(15 * k) for k in range(12)]
"""Directions in which a bridge is looked for."""

FLAT = 1e-4
"""A facet is level, and lies on the bed, within this much of its normal and this share of the part's height."""


@dataclass(frozen=True, slots=True)
class Range:
    """What a maker's choice must lie between, both ends included, in its unit; whether it counts something."""

    low: float
    high: float
    unit: str = "mm"
    whole: bool = False

    def check(self, name: str, value: object) -> None:
        """Raise a BadInput that names the range for a value outside it, or of another kind."""
        unit = f" {self.unit}" if self.unit else ""
        if isinstance(value, bool) or not isinstance(value, int if self.whole else (int, float)):
            kind = "whole number" if self.whole else "number"
            raise BadInput(f"{name} must be a {kind} from {self.low:g} to {self.high:g}{unit}; got {value!r}")
        if not self.low <= value <= self.high:
            raise BadInput(f"{name} must lie between {self.low:g} and {self.high:g}{unit}; got {value:g}{unit}")


@dataclass(frozen=True, slots=True)
class Check:
    """A figure that was measured, and what it must keep to."""

    name: str
    value: float
    bound: str
    unit: str
    passed: bool


def at_most(name: str, value: float, bound: float, unit: str) -> Check:
    return Check(name, value, f"<= {bound:g}", unit, value <= bound)


def at_least(name: str, value: float, bound: float, unit: str = "mm") -> Check:
    return Check(name, value, f">= {bound:g}", unit, value >= bound - 1e-6 * abs(bound))


def standing(solid: Solid, *, upside_down: bool = False) -> Solid:
    """The solid as it is printed: on z = 0, turned over about x if it is printed upside down."""
    import build123d as bd

    turned = solid.rotate(bd.Axis.X, 180) if upside_down else solid
    low = turned.bounding_box(optimal=False)
    bottom = min(vertex.Z for vertex in turned.vertices())
    assert bottom >= low.min.Z - 1e-6, "a part stands on a flat face"
    return moved(turned, (0.0, 0.0, -bottom))


def overhangs(mesh: Any) -> tuple[float, float]:
    """Area that overhangs, mm², and the widest bridge, mm, of a trimesh that is printed as it stands, z upwards.

    A level roof is bridged along the shortest line from wall to wall at each of its points; where every line ends at
    a free edge it hangs in the air, and its width is infinite.
    """
    import numpy as np

    down = -mesh.face_normals[:, 2]
    bottom, height = mesh.vertices[:, 2].min(), np.ptp(mesh.vertices[:, 2])
    on_bed = (mesh.vertices[mesh.faces][:, :, 2] < bottom + FLAT * height).all(axis=1)
    level = (down > 1 - FLAT) & ~on_bed
    steep = (down > STEEPEST + FLAT) & ~on_bed & ~level
    return float(mesh.area_faces[steep].sum()), _widest_bridge(mesh, level) if level.any() else 0.0


def _widest_bridge(mesh: Any, level: Any) -> float:
    import numpy as np

    # an edge of a roof has a wall under it if its other face reaches down
    inside = level[mesh.face_adjacency]
    rims = inside.any(axis=1) & ~inside.all(axis=1)
    ends = mesh.vertices[mesh.face_adjacency_edges[rims]]
    other = np.where(inside[rims, 0], mesh.face_adjacency[rims, 1], mesh.face_adjacency[rims, 0])
    walled = mesh.triangles_center[other, 2] < ends[:, :, 2].mean(axis=1)
    a, along = ends[:, 0, :2], ends[:, 1, :2] - ends[:, 0, :2]
    height = ends[:, 0, 2]
    widest = 0.0
    for x, y, z in mesh.triangles_center[level]:
        near = np.abs(height - z) < FLAT * np.ptp(mesh.vertices[:, 2])
        spans = [_span(a[near] - (x, y), along[near], walled[near], turn) for turn in TURNS]
        widest = max(widest, min(spans))
        if widest == math.inf:
            break
    return widest


def _span(a: Any, along: Any, walled: Any, turn: float) -> float:
    """Length of the line through the origin between the nearest edges a + s along; infinite if one has no wall."""
    import numpy as np

    c, s = math.cos(turn), math.sin(turn)
    cross = c * along[:, 1] - s * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        where = (a[:, 1] * c - a[:, 0] * s) / -cross
        reach = (a[:, 0] * along[:, 1] - a[:, 1] * along[:, 0]) / cross
    hit = (np.abs(cross) > 1e-12) & (where >= 0) & (where <= 1)
    total = 0.0
    for side in (1, -1):
        ahead = np.flatnonzero(hit & (side * reach > 0))
        if not len(ahead):
            return math.inf
        first = ahead[np.argmin(side * reach[ahead])]
        if not walled[first]:
            return math.inf
        total += abs(float(reach[first]))
    return total
