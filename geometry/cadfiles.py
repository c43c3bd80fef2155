"""Solids as files: STEP for CAD, STL and 3MF for printing; lengths mm.

Triangles keep within an absolute tolerance of the surface, and their volume within 1e-3 of the solid's.
"""

from __future__ import annotations

import ctypes
import functools
import math
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry.design import BadInput

if TYPE_CHECKING:
    from build123d import Solid

LARGEST_ERROR = 1e-3
"""Largest relative volume error of an exported mesh."""

TOLERANCE = 0.004
"""Largest distance of a facet from the surface unless told otherwise, mm; printers make 0.05 mm."""

TOLERANCES = (1e-5, 1.0)
"""Least and greatest tolerance that may be asked for, mm."""

ANGLE = 0.3
"""Largest angle between neighbouring facets, rad, at first."""

TRIALS = 4
"""How often a mesh is made, finer each time, before its volume is given up."""

FACET = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
"""A triangle of a binary STL file, after 80 bytes of header and a count of 4."""

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


def triangulated(solid: Solid, tolerance: float = TOLERANCE, angle: float = ANGLE) -> Any:
    """A closed trimesh of the solid's surface, mm, in single precision as an STL file has it.

    Parameters
    ----------
    tolerance : largest distance from the surface, mm.
    angle : largest angle between neighbouring facets, rad.
    """
    return _read(stl(solid, tolerance, angle))


def stl(solid: Solid, tolerance: float, angle: float) -> bytes:
    """The solid's triangles as the bytes of a binary STL file.

    Faces that have been given finer triangles before keep them, in this solid or in another made from it.
    """
    import numpy as np
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.StlAPI import StlAPI_Writer

    # the kernel's other algorithm, Delabella, is faster but misses the tolerance by up to 1.7 on a sphere
    BRepMesh_IncrementalMesh(solid.wrapped, tolerance, False, angle, False)
    with tempfile.NamedTemporaryFile(suffix=".stl") as file:
        writer = StlAPI_Writer()
        writer.ASCIIMode = False
        if not writer.Write(solid.wrapped, file.name):
            raise OSError(None, "the CAD kernel could not write triangles", file.name)
        text = file.read()
    facets = np.frombuffer(text, dtype=FACET, offset=84)
    # a sphere's pole gives triangles with two corners in one point; they would leave the mesh open
    a, b, c = np.moveaxis(facets["corners"], 1, 0)
    kept = facets[(a != b).any(axis=1) & (b != c).any(axis=1) & (c != a).any(axis=1)]
    return bytes(text[:80] + np.uint32(len(kept)).tobytes() + kept.tobytes())


def _read(text: bytes) -> Any:
    import trimesh

    return trimesh.load_mesh(BytesIO(text), file_type="stl")


def export(
    parts: Mapping[str, Solid],
    folder: str | Path,
    *,
    tolerance: float = TOLERANCE,
    colours: Mapping[str, str] | None = None,
) -> list[Exported]:
    """Write NAME.step, NAME.stl and NAME.3mf into an existing folder for every part; units mm.

    All files are written to a temporary folder inside `folder` and moved only once all are complete, so a failure
    leaves nothing half-written. Where the volume misses by more than 1e-3 the facets are made finer than asked.

    Parameters
    ----------
    tolerance : largest distance of a facet from the surface, mm.
    colours : of the parts in their STEP files, by name, as CSS knows them.

    Raises
    ------
    BadInput
        The tolerance lies outside `TOLERANCES`.
    OSError
        The folder does not exist or cannot be written.
    RuntimeError
        A part's triangles are not watertight, or miss its volume by more than 1e-3.
    """
    check_tolerance(tolerance)
    with tempfile.TemporaryDirectory(prefix=".export-", dir=folder) as temporary:
        written = []
        for name, solid in parts.items():
            Path(temporary, f"{name}.step").write_bytes(step(named(solid, name, (colours or {}).get(name, ""))))
            written.append(_write(name, solid, Path(temporary), tolerance))
        for name in parts:
            for suffix in FORMATS:
                os.replace(Path(temporary) / f"{name}.{suffix}", Path(folder) / f"{name}.{suffix}")
    return written


def check_tolerance(tolerance: float) -> None:
    """Raise a BadInput for a tolerance outside `TOLERANCES`."""
    low, high = TOLERANCES
    if not low <= tolerance <= high:
        raise BadInput(f"tolerance must lie between {low:g} and {high:g} mm; got {tolerance:g} mm")


def step(shape: Any) -> bytes:
    """The text of a STEP file, with the labels and colours of a shape and its children.

    It is made in memory: a disk that is full is then found by whoever writes it, as an OSError.
    """
    import build123d as bd

    text = BytesIO()
    # curves on surfaces can be had from the surfaces: without them the file is half as long, and as exact
    bd.export_step(shape, text, write_pcurves=False)
    return text.getvalue()


def named(solid: Solid, label: str, colour: str) -> Solid:
    """A copy of a solid with a name and a colour (one that CSS knows, or none) for a STEP file."""
    import copy

    import build123d as bd

    # the part may belong to something of another name
    found = copy.copy(solid)
    found.label = label
    found.color = bd.Color(colour) if colour else None
    return found


def assembly(name: str, parts: Mapping[str, tuple[Solid, str]]) -> Any:
    """Solids by name, each with its colour, as one labelled compound."""
    import build123d as bd

    return bd.Compound(label=name, children=[named(solid, label, colour) for label, (solid, colour) in parts.items()])


def _write(name: str, solid: Solid, folder: Path, tolerance: float) -> Exported:
    exact = float(solid.volume)
    path = folder / f"{name}.stl"
    finer, error = 1.0, 1.0
    for _ in range(TRIALS):
        text = stl(solid, tolerance / finer, ANGLE / math.sqrt(finer))
        mesh = _read(text)
        if not mesh.is_volume:
            raise RuntimeError(f"{name}: the {len(mesh.faces)} triangles are not watertight: try another tolerance")
        error = mesh.volume / exact - 1
        if abs(error) <= LARGEST_ERROR:
            break
        # the error goes with the distance, and with the square of the angle
        finer *= 1.5 * abs(error) / LARGEST_ERROR
    else:
        raise RuntimeError(
            f"{name}: the volume of the triangles is off by {error:.2g}, more than {LARGEST_ERROR:g}: "
            f"make tolerance finer than {tolerance:g} mm"
        )
    path.write_bytes(text)
    _write_3mf(name, mesh, folder / f"{name}.3mf")
    return Exported(name, path.name, exact, float(mesh.volume), float(error), True, len(mesh.faces))


def _write_3mf(name: str, mesh: Any, path: Path) -> None:
    import numpy as np
    from lib3mf import Lib3MF

    wrapper = _library()
    model = wrapper.CreateModel()
    model.SetUnit(Lib3MF.ModelUnit.MilliMeter)
    body = model.AddMeshObject()
    body.SetName(name)
    vertices, faces = np.asarray(mesh.vertices, dtype=np.float32), np.asarray(mesh.faces, dtype=np.uint32)
    body.SetGeometry(_packed(Lib3MF.Position, vertices), _packed(Lib3MF.Triangle, faces))
    if not body.IsManifoldAndOriented():
        raise RuntimeError(f"{name}: 3MF refuses the {len(mesh.faces)} triangles: try another tolerance")
    model.AddBuildItem(body, wrapper.GetIdentityTransform())
    writer = model.QueryWriter("3mf")
    writer.SetDecimalPrecision(9)
    try:
        writer.WriteToFile(os.fspath(path))
    except Lib3MF.ELib3MFException as error:
        raise OSError(None, str(error), os.fspath(path)) from None


@functools.cache
def _library() -> Any:
    from lib3mf import Lib3MF

    return Lib3MF.Wrapper()


def _packed(kind: type[ctypes.Structure], rows: Any) -> Any:
    """Rows (n, 3) as an array of the library's own structures."""
    return (kind * len(rows)).from_buffer_copy(rows.tobytes())
