"""Limits of printing: processes, overhangs and bridges. Lengths in mm, areas in mm².

Parts are printed without supports. A face that points downwards may lean by at most 45° from the vertical, unless it
lies on the printer's bed or is the level roof of a pocket that is narrow enough to be bridged. The limits are rules
of thumb for filament (fdm) and resin (sla) printing; they do not describe a certain machine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from geometry.cad import moved

if TYPE_CHECKING:
    from build123d import Solid


@dataclass(frozen=True, slots=True)
class Process:
    """Defaults of a printing process, mm.

    Attributes
    ----------
    name : name of the printed material in texts.
    fit : gap between surfaces that slide into each other.
    wall : wall thickness of a mould.
    bridge : width of the widest level roof that prints without support.
    detail : least thickness of a pin or a wall.
    stroke : width of the strokes of marks: of filament one and a half lines of a 0.4 mm nozzle, of resin wide enough
        to wash it out.
    """

    name: str
    fit: float
    wall: float
    bridge: float
    detail: float
    stroke: float


PROCESSES = {
    "fdm": Process("filament", fit=0.2, wall=3.0, bridge=10.0, detail=0.8, stroke=0.6),
    "sla": Process("resin", fit=0.1, wall=2.0, bridge=5.0, detail=0.3, stroke=0.4),
}

FLAT = 1e-4
"""Difference from 1 of the vertical component of a unit normal, up to which a facet is level; also the tolerance of
heights, as a fraction of the part's height."""


@dataclass(frozen=True, slots=True)
class Check:
    """The result of one check: a measured value, its bound as text, its unit, and whether the check passed."""

    name: str
    value: float
    bound: str
    unit: str
    passed: bool


def at_most(name: str, value: float, bound: float, unit: str) -> Check:
    """Check that a value does not exceed its bound."""
    return Check(name, value, f"<= {bound:g}", unit, value <= bound)


def at_least(name: str, value: float, bound: float) -> Check:
    """Check that a length, mm, is at least its bound, less 1e-6 of the bound for the rounding of the CAD kernel."""
    return Check(name, value, f">= {bound:g}", "mm", value >= bound - 1e-6 * abs(bound))


def standing(solid: Solid, *, upside_down: bool = False) -> Solid:
    """Return the solid in the pose in which it is printed: on z = 0, rotated by 180° about x if `upside_down`."""
    import build123d as bd

    turned = solid.rotate(bd.Axis.X, 180) if upside_down else solid
    low = turned.bounding_box(optimal=False)
    bottom = min(vertex.Z for vertex in turned.vertices())
    assert bottom >= low.min.Z - 1e-6, "a part stands on a flat face"
    return moved(turned, (0.0, 0.0, -bottom))


def overhangs(mesh: Any) -> tuple[float, float]:
    """Return the overhanging area, mm², and the width of the widest bridge, mm, of a trimesh in its printed pose.

    A level roof is bridged, at each of its points, along the shortest line from wall to wall. Where every line
    through a point has a free end, nothing supports the roof and its width is infinite.
    """
    import numpy as np

    down = -mesh.face_normals[:, 2]
    bottom, height = mesh.vertices[:, 2].min(), np.ptp(mesh.vertices[:, 2])
    on_bed = (mesh.vertices[mesh.faces][:, :, 2] < bottom + FLAT * height).all(axis=1)
    level = (down > 1 - FLAT) & ~on_bed
    steep = (down > math.cos(math.radians(45)) + FLAT) & ~on_bed & ~level
    return float(mesh.area_faces[steep].sum()), _widest_bridge(mesh, level) if level.any() else 0.0


def _widest_bridge(mesh: Any, level: Any) -> float:
    """Return the width of the widest bridge under the level facets, mm; `level` is a mask, shape (faces,)."""
    import numpy as np

    # an edge of a roof stands on a wall if the other facet at this edge lies lower than the edge
    inside = level[mesh.face_adjacency]
    rims = inside.any(axis=1) & ~inside.all(axis=1)
    ends = mesh.vertices[mesh.face_adjacency_edges[rims]]
    neighbour = np.where(inside[rims, 0], mesh.face_adjacency[rims, 1], mesh.face_adjacency[rims, 0])
    walled = mesh.triangles_center[neighbour, 2] < ends[:, :, 2].mean(axis=1)
    turns = np.radians(15 * np.arange(12))[:, None]
    c, s, widest = np.cos(turns), np.sin(turns), 0.0
    for centre in mesh.triangles_center[level]:
        near = np.abs(ends[:, 0, 2] - centre[2]) < FLAT * np.ptp(mesh.vertices[:, 2])
        # lines through the centre along all turns meet the edges x + t u, 0 <= t <= 1
        (x, y), (u, v) = (ends[near, 0, :2] - centre[:2]).T, (ends[near, 1, :2] - ends[near, 0, :2]).T
        cross = c * v - s * u
        with np.errstate(divide="ignore", invalid="ignore"):
            t, reach = (x * s - y * c) / cross, (x * v - y * u) / cross
        # edges parallel to a line divide by zero above; they never end a bridge
        hit, spans = (np.abs(cross) > 1e-12) & (t >= 0) & (t <= 1), np.zeros(len(turns))
        for side in (1, -1):
            ahead = np.where(hit & (side * reach > 0), side * reach, np.inf)
            # without an edge on this side, or a wall below the closest one, the line has a free end
            spans += np.where(walled[near][ahead.argmin(axis=1)], ahead.min(axis=1), np.inf)
        widest = max(widest, float(spans.min()))
    return widest
