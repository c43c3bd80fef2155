"""Files of solids: STEP for CAD, STL and 3MF for printing. All lengths are in mm.

The triangles of STL and 3MF stay within an absolute tolerance of the surface. Their volume differs from that of the
solid by at most 1e-3.
"""

from __future__ import annotations

import copy
import errno
import math
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from html import escape
from io import BytesIO
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any

from geometry.bad_input import MeshError
from geometry.design import BadInput

if TYPE_CHECKING:
    from build123d import Solid

TOLERANCE = 0.004
"""Default of the largest distance of a facet from the surface, mm: far below the 0.05 mm that printers resolve."""

ANGLE = 0.3
"""Largest angle between neighbouring facets in the first triangulation, rad."""

PLATE_GAP = 5.0
"""Distance between parts that are printed together, mm."""

PACKAGE = {
    "content_types.xml": "[Content_Types].xml",
    "relationships.xml": "_rels/.rels",
    "model.xml": "3D/3dmodel.model",
}
"""Parts of a 3MF file: the file in the folder `package_3mf` here, and its path in the package."""


def facets(name: str, solid: Solid, tolerance: float = TOLERANCE) -> Any:
    """Triangulate the surface of a part, finer than requested if the volume would be wrong by more than 1e-3.

    Parameters
    ----------
    name : name of the part in messages.
    tolerance : largest distance of a facet from the surface, mm.

    Returns
    -------
    A closed trimesh, mm, in the single precision of STL.

    Raises
    ------
    BadInput
        See `check_tolerance`.
    MeshError
        The triangles are not watertight, or their volume is wrong by more than 1e-3.
    """
    check_tolerance(tolerance)
    exact, largest = float(solid.volume), 1e-3
    finer, error = 1.0, 1.0
    # each finer than the one before, until the volume is accurate enough
    for _ in range(4):
        mesh = triangulated(solid, tolerance / finer, ANGLE / math.sqrt(finer))
        if not mesh.is_volume:
            raise MeshError(f"{name}: the {len(mesh.faces)} triangles are not watertight: try another tolerance")
        error = float(mesh.volume) / exact - 1
        if abs(error) <= largest:
            return mesh
        # the error is proportional to the distance and to the square of the angle; 1.2 is a margin
        finer *= 1.2 * abs(error) / largest
    raise MeshError(
        f"{name}: the volume of the triangles is off by {error:.2g}, more than {largest:g}: "
        f"make tolerance finer than {tolerance:g} mm"
    )


def triangulated(solid: Solid, tolerance: float = TOLERANCE, angle: float = ANGLE) -> Any:
    """Return a trimesh of the solid's surface, mm, in the single precision of STL; its volume is not checked.

    The CAD kernel stores the triangles with the faces. A face that already has finer triangles keeps them, also if it
    got them as part of another solid.

    Parameters
    ----------
    tolerance : largest distance from the surface, mm.
    angle : largest angle between neighbouring facets, rad.
    """
    import numpy as np
    import trimesh
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.StlAPI import StlAPI_Writer

    # the kernel's other algorithm, Delabella, is faster but misses the tolerance by up to 1.7 on a sphere
    BRepMesh_IncrementalMesh(solid.wrapped, tolerance, False, angle, False)
    with tempfile.NamedTemporaryFile(suffix=".stl") as file:
        writer = StlAPI_Writer()
        writer.ASCIIMode = False
        if not writer.Write(solid.wrapped, file.name):
            raise OSError(errno.EIO, "the CAD kernel could not write triangles", file.name)
        mesh = trimesh.load_mesh(file, file_type="stl")
    # at the pole of a sphere two corners of a triangle coincide: such triangles would leave the mesh open
    mesh.update_faces((np.diff(np.sort(mesh.faces)) > 0).all(axis=1))
    return mesh


def export(
    solids: Mapping[str, tuple[Solid, Any]], folder: str | Path, *, colours: Mapping[str, str] | None = None
) -> list[dict[str, Any]]:
    """Write NAME.step, NAME.stl and NAME.3mf of every part into an existing folder; lengths in mm.

    Parameters
    ----------
    solids : by name, each with its `facets`.
    colours : CSS colour names for the STEP files, by the name of the part.

    Returns
    -------
    For each part its name and STL file, exact volume, volume that the triangles enclose in single precision and its
    relative error, whether they are watertight, and their number. The 3MF file holds the same triangles.

    Raises
    ------
    OSError
        The folder does not exist or cannot be written.
    """
    written = []
    for name, (solid, mesh) in solids.items():
        contents = {
            "step": step(named(solid, name, (colours or {}).get(name, ""))),
            "stl": mesh.export(file_type="stl"),
            "3mf": _packed({name: mesh}, [(name, 0.0, 0.0)]),
        }
        for suffix, content in contents.items():
            Path(folder, f"{name}.{suffix}").write_bytes(content)
        exact, enclosed = float(solid.volume), float(mesh.volume)
        record = {"name": name, "file": f"{name}.stl", "volume_mm3": exact}
        record |= {"stl_volume_mm3": enclosed, "relative_error": enclosed / exact - 1}
        written.append(record | {"watertight": bool(mesh.is_volume), "triangles": len(mesh.faces)})
    return written


def check_tolerance(tolerance: float) -> None:
    """Raise BadInput for a tolerance that is not from 1e-5 to 1 mm."""
    low, high = 1e-5, 1.0
    if not low <= tolerance <= high:
        raise BadInput(f"tolerance must lie between {low:g} and {high:g} mm; got {tolerance:g} mm")


def step(shape: Any) -> bytes:
    """Return the bytes of a STEP file of a shape and its children, with their labels and colours.

    The kernel writes to memory, not to a file: so a full disk raises an OSError where the bytes are written.
    """
    import build123d as bd

    text = BytesIO()
    # readers can compute the parametric curves from the surfaces: without them the file is half as long and as exact
    bd.export_step(shape, text, write_pcurves=False)
    return text.getvalue()


def named(solid: Solid, label: str, colour: str) -> Solid:
    """Return a copy of a solid with a label and a colour for a STEP file; `colour` is a CSS name, or "" for none."""
    import build123d as bd

    # a copy, since the same solid may belong to another assembly under another label
    labelled = copy.copy(solid)
    labelled.label = label
    labelled.color = bd.Color(colour) if colour else None
    return labelled


def assembly(name: str, solids: Mapping[str, tuple[Solid, str]]) -> Any:
    """Return one labelled compound of solids, each with its name and its colour."""
    import build123d as bd

    return bd.Compound(
        label=name, children=[named(solid, label, colour) for label, (solid, colour) in solids.items()]
    )


def plate(meshes: Mapping[str, tuple[Any, int]]) -> bytes:
    """Return the bytes of a 3MF file of all parts side by side on z = 0.

    meshes : by name, each a trimesh that stands on z = 0, and how many of it are printed.
    """
    copies = [name for name, (_, count) in meshes.items() for _ in range(count)]
    # rows of parts, the deepest first, on a plate that is about square
    copies.sort(key=lambda name: -meshes[name][0].extents[1])
    widest = max(float(mesh.extents[0]) for mesh, _ in meshes.values())
    area = sum(float(math.prod(meshes[name][0].extents[:2] + PLATE_GAP)) for name in copies)
    width, (x, y, deep) = max(widest, math.sqrt(area)), (0.0, 0.0, 0.0)
    places: list[tuple[str, float, float]] = []
    for name in copies:
        mesh = meshes[name][0]
        wide, high = (float(side) for side in mesh.extents[:2])
        if x and x + wide > width:
            x, y, deep = 0.0, y + deep + PLATE_GAP, 0.0
        left, low = (float(side) for side in mesh.bounds[0][:2])
        places.append((name, x - left, y - low))
        x, deep = x + wide + PLATE_GAP, max(deep, high)
    return _packed({name: mesh for name, (mesh, _) in meshes.items()}, places)


def _packed(meshes: Mapping[str, Any], places: Sequence[tuple[str, float, float]]) -> bytes:
    """Return the bytes of a 3MF file (core specification 1.3), mm, in single precision.

    meshes : the objects by name.
    places : what is built: names, each with the x and y by which the object is moved.
    """
    import numpy as np

    folder, ids = Path(__file__).with_name("package_3mf"), {name: k for k, name in enumerate(meshes, 1)}
    part, objects = Template((folder / "object.xml").read_text("utf-8")), ""
    for name, mesh in meshes.items():
        vertices, faces = np.asarray(mesh.vertices, dtype=np.float32), np.asarray(mesh.faces)
        corners = '<vertex x="%.9g" y="%.9g" z="%.9g"/>\n' * len(vertices) % tuple(vertices.ravel().tolist())
        sides = '<triangle v1="%d" v2="%d" v3="%d"/>\n' * len(faces) % tuple(faces.ravel().tolist())
        objects += part.substitute(id=ids[name], name=escape(name), vertices=corners, triangles=sides)
    items = [
        f'<item objectid="{ids[name]}" transform="1 0 0 0 1 0 0 0 1 {x:.6f} {y:.6f} 0"/>' for name, x, y in places
    ]
    values, text = {"objects": objects, "items": "".join(items)}, BytesIO()
    with zipfile.ZipFile(text, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        for source, path in PACKAGE.items():
            content = Template((folder / source).read_text("utf-8")).substitute(values)
            # a ZipInfo with its default date, not the current time: equal parts then give equal files
            file.writestr(zipfile.ZipInfo(path), content, zipfile.ZIP_DEFLATED)
    return text.getvalue()
