"""The sensor as exact solids, and solids as files: STEP for CAD, STL and 3MF for printing.

Lengths are mm and volumes mm³, in the sensor's frame (see `geometry.design`). build123d takes seconds to import,
so every function that needs it imports it.
"""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry.design import BadInput, Design, Shape

if TYPE_CHECKING:
    from build123d import Solid

Corner = tuple[float, float, float]
"""A corner of a profile: distance from the axis, height, fillet radius; all mm."""

COINCIDENT = 1e-7
"""Points closer than this are one point to the CAD kernel, mm."""

LARGEST_ERROR = 1e-3
"""Largest relative volume error of an exported mesh."""

FORMATS = ("step", "stl", "3mf")


@dataclass(frozen=True, slots=True)
class Exported:
    """What `export` wrote for one part.

    Attributes
    ----------
    name : name of the part; the files are name.step, name.stl and name.3mf.
    file : the STL file, to which the figures below belong; the 3MF file holds the same triangles.
    volume_mm3 : exact volume of the solid.
    stl_volume_mm3, relative_error : volume enclosed by the triangles as read back, and its error.
    watertight : the triangles enclose a volume; always true, since `export` refuses to write anything else.
    """

    name: str
    file: str
    volume_mm3: float
    stl_volume_mm3: float
    relative_error: float
    watertight: bool
    triangles: int


def turned(profile: Sequence[Corner]) -> Solid:
    """The solid of revolution about z of a profile that starts and ends on the axis.

    Sides must be parallel to the axis or to the base; a side that its fillets use up is dropped. Fillets are exact
    quarter circles: the hemispherical tip is the corner (R, L) with a fillet of radius R.
    """
    import build123d as bd

    points: list[tuple[float, ...]] = []
    edges: list[Any] = []

    def to(x: float, z: float, *, via: tuple[float, float] | None = None) -> None:
        end = (x, 0.0, z)
        if points and math.dist(points[-1], end) < COINCIDENT:
            return
        if points and via:
            edges.append(bd.Edge.make_three_point_arc(points[-1], (via[0], 0.0, via[1]), end))
        elif points:
            edges.append(bd.Edge.make_line(points[-1], end))
        points.append(end)

    to(*profile[0][:2])
    for (x0, z0, _), (x, z, radius), (x2, z2, _) in zip(profile, profile[1:], profile[2:], strict=False):
        back = (_sign(x0 - x), _sign(z0 - z))
        on = (_sign(x2 - x), _sign(z2 - z))
        near = radius * (1 - math.sqrt(0.5))
        to(x + radius * back[0], z + radius * back[1])
        if radius > 0:
            middle = (x + near * (back[0] + on[0]), z + near * (back[1] + on[1]))
            to(x + radius * on[0], z + radius * on[1], via=middle)
    to(*profile[-1][:2])
    edges.append(bd.Edge.make_line(points[-1], points[0]))
    return bd.Solid.revolve(bd.Face(bd.Wire(edges)), 360, bd.Axis.Z)


def _sign(value: float) -> float:
    return math.copysign(1.0, value) if abs(value) > COINCIDENT else 0.0


def cut(body: Solid, *tools: Solid) -> Solid:
    """`body` without `tools`; a RuntimeError if what is left is not one solid."""
    solids = body.cut(*tools).solids() if tools else [body]
    if len(solids) != 1:
        raise RuntimeError(f"a cut must leave one solid; it left {len(solids)}: check the part's dimensions")
    return solids[0]


def common(one: Solid, other: Solid) -> list[Solid]:
    """The solids that two solids share; none where they only touch."""
    found = one.intersect(other)
    shapes = [] if found is None else found if isinstance(found, list) else [found]
    return [solid for shape in shapes for solid in shape.solids()]


def overlap(one: Solid, other: Solid) -> float:
    """Volume that two solids share, mm³."""
    return float(sum(solid.volume for solid in common(one, other)))


def beam(design: Design | Shape) -> Solid:
    """The outer form of the silicone: cylinder and hemisphere, from the base z = 0 to the tip z = L, mm."""
    R = design.D / 2
    return turned([(0, 0, 0), (R, 0, 0), (R, design.L, R), (0, design.L, 0)])


def magnet(design: Design | Shape) -> Solid:
    """The magnet with its rounded edges, centred at z = H, mm.

    Raises
    ------
    BadInput
        The design has no magnet.
    """
    if not design.magnet_diameter > 0:
        raise BadInput("magnet_diameter must be positive to draw the magnet; got 0 mm, a design without one")
    a, b, rho = design.magnet_diameter / 2, design.magnet_height / 2, design.magnet_edge_radius
    low, high = design.H - b, design.H + b
    return turned([(0, low, 0), (a, low, rho), (a, high, rho), (0, high, 0)])


def silicone(design: Design | Shape) -> Solid:
    """The silicone: the beam with a closed void where the magnet is, or the whole beam without a magnet, mm."""
    return cut(beam(design), magnet(design)) if design.magnet_diameter > 0 else beam(design)


def beam_volume(shape: Shape) -> float:
    """Exact volume of the beam, magnet included, in the cube of the shape's unit."""
    return math.pi * shape.R**2 * (shape.H + 2 * shape.R / 3)


def magnet_volume(shape: Shape) -> float:
    """Exact volume of the magnet, 0 without one, in the cube of the shape's unit.

    >>> round(magnet_volume(Shape(8, 9, 4, 4, 2)) / (4 / 3 * math.pi * 2**3), 12)
    1.0
    """
    if not shape.has_magnet:
        return 0.0
    return rounded_cylinder_volume(shape.magnet_diameter / 2, shape.magnet_height, shape.magnet_edge_radius, edges=2)


def rounded_cylinder_volume(radius: float, height: float, fillet: float, *, edges: int) -> float:
    """Exact volume of a cylinder with one or two of its edges rounded (Pappus), in the cube of the unit given."""
    quarter = math.pi * fillet**2 / 4
    square_moment = fillet**2 * (radius - fillet / 2)
    quarter_moment = quarter * (radius - fillet + 4 * fillet / (3 * math.pi))
    return math.pi * radius**2 * height - edges * 2 * math.pi * (square_moment - quarter_moment)


def triangulated(solid: Solid, tolerance: float, angular: float) -> Any:
    """A closed trimesh of the solid's surface, mm.

    `tolerance` is the deviation as a fraction of each edge's length, so it scales with the part; `angular` is the
    angle between neighbouring facets, rad.
    """
    import numpy as np
    import trimesh

    vertices, faces = solid.tessellate(tolerance, angular)
    mesh = trimesh.Trimesh(np.array([tuple(vertex) for vertex in vertices]), np.array(faces), process=False)
    mesh.merge_vertices()
    # a sphere's pole gives triangles with two corners in one point; they would leave the mesh open
    a, b, c = mesh.faces.T
    mesh.update_faces((a != b) & (b != c) & (c != a))
    mesh.remove_unreferenced_vertices()
    return mesh


def export(
    parts: dict[str, Solid], folder: str | Path, *, tolerance: float = 0.005, angular: float = 0.08
) -> list[Exported]:
    """Write NAME.step, NAME.stl and NAME.3mf into an existing folder for every part; units mm.

    All files are written to a temporary folder inside `folder` and moved only once all are complete, so a failure
    leaves nothing half-written. Where the volume misses by more than 1e-3 the facets are made finer.

    Parameters
    ----------
    tolerance : largest deviation of a facet as a fraction of its edge's length.
    angular : largest angle between neighbouring facets, rad.

    Raises
    ------
    OSError
        The folder does not exist or cannot be written.
    RuntimeError
        A part's triangles are not watertight, or miss its volume by more than 1e-3.
    """
    with tempfile.TemporaryDirectory(prefix=".export-", dir=folder) as temporary:
        written = [
            _write(name, solid, Path(temporary), tolerance=tolerance, angular=angular)
            for name, solid in parts.items()
        ]
        for name in parts:
            for suffix in FORMATS:
                os.replace(Path(temporary) / f"{name}.{suffix}", Path(folder) / f"{name}.{suffix}")
    return written


def _write(name: str, solid: Solid, folder: Path, *, tolerance: float, angular: float) -> Exported:
    import build123d as bd
    import trimesh

    exact = float(solid.volume)
    if not bd.export_step(solid, folder / f"{name}.step"):
        raise RuntimeError(f"{name}: the CAD kernel could not write a STEP file")
    path = folder / f"{name}.stl"
    for finer in (1, 2, 4):
        triangulated(solid, tolerance / finer, angular / finer).export(path)
        mesh = trimesh.load_mesh(path)
        if not mesh.is_volume:
            raise RuntimeError(f"{name}: the {len(mesh.faces)} triangles are not watertight: try another tolerance")
        error = mesh.volume / exact - 1
        if abs(error) <= LARGEST_ERROR:
            break
    else:
        raise RuntimeError(
            f"{name}: the volume of the triangles is off by {error:.2g}, more than {LARGEST_ERROR:g}: "
            f"make angular finer than {angular:g} rad"
        )
    _write_3mf(name, mesh, folder / f"{name}.3mf")
    return Exported(name, path.name, exact, float(mesh.volume), float(error), True, len(mesh.faces))


def _write_3mf(name: str, mesh: Any, path: Path) -> None:
    import ctypes

    from lib3mf import Lib3MF

    wrapper = Lib3MF.Wrapper()
    model = wrapper.CreateModel()
    model.SetUnit(Lib3MF.ModelUnit.MilliMeter)
    body = model.AddMeshObject()
    body.SetName(name)
    vector, triple = ctypes.c_float * 3, ctypes.c_uint32 * 3
    body.SetGeometry(
        [Lib3MF.Position(vector(*vertex)) for vertex in mesh.vertices.tolist()],
        [Lib3MF.Triangle(triple(*face)) for face in mesh.faces.tolist()],
    )
    if not body.IsManifoldAndOriented():
        raise RuntimeError(f"{name}: 3MF refuses the {len(mesh.faces)} triangles: try another tolerance")
    model.AddBuildItem(body, wrapper.GetIdentityTransform())
    writer = model.QueryWriter("3mf")
    writer.SetDecimalPrecision(9)
    writer.WriteToFile(os.fspath(path))
