"""Solids as files: STEP for CAD, STL and 3MF for printing; lengths mm.

Triangles keep within an absolute tolerance of the surface, and their volume within 1e-3 of the solid's.
"""

from __future__ import annotations

import math
import os
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
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

_OPC, _3MF = "http://schemas.openxmlformats.org/package/2006", "http://schemas.microsoft.com/3dmanufacturing"

PACKAGE = {
    "[Content_Types].xml": f"""<?xml version="1.0" encoding="UTF-8"?>
<Types xmlns="{_OPC}/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>
</Types>
""",
    "_rels/.rels": f"""<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="{_OPC}/relationships">
<Relationship Id="rel0" Target="/3D/3dmodel.model" Type="{_3MF}/2013/01/3dmodel"/>
</Relationships>
""",
}
"""What a 3MF file holds beside its model, by path."""

MODEL = f"""<?xml version="1.0" encoding="UTF-8"?>
<model unit="millimeter" xmlns="{_3MF}/core/2015/02">
<resources><object id="1" name="{{name}}" type="model"><mesh>
<vertices>
{{vertices}}</vertices>
<triangles>
{{triangles}}</triangles>
</mesh></object></resources>
<build><item objectid="1"/></build>
</model>
"""


@dataclass(frozen=True, slots=True)
class Exported:
    """What `export` wrote for one part.

    Attributes
    ----------
    name : name of the part; the files are name.step, name.stl and name.3mf.
    file : the STL file, to which the figures below belong; the 3MF file holds the same triangles.
    volume_mm3 : exact volume of the solid.
    stl_volume_mm3, relative_error : volume enclosed by the triangles as read back, and its error.
    watertight : the triangles enclose a volume; always true, since `facets` refuses anything else.
    """

    name: str
    file: str
    volume_mm3: float
    stl_volume_mm3: float
    relative_error: float
    watertight: bool
    triangles: int


@dataclass(frozen=True, slots=True)
class Facets:
    """A solid's surface as triangles, mm, closed.

    Attributes
    ----------
    text : the bytes of a binary STL file.
    mesh : the same as a trimesh, in single precision.
    error : of the volume, relative to the solid's.
    """

    text: bytes
    mesh: Any
    error: float


def facets(name: str, solid: Solid, tolerance: float = TOLERANCE) -> Facets:
    """The surface of a part as triangles, finer than asked where the volume misses by more than 1e-3.

    Parameters
    ----------
    name : of the part, for messages.
    tolerance : largest distance from the surface, mm.

    Raises
    ------
    BadInput
        The tolerance lies outside `TOLERANCES`.
    RuntimeError
        The triangles are not watertight, or miss the volume by more than 1e-3.
    """
    check_tolerance(tolerance)
    exact = float(solid.volume)
    finer, error = 1.0, 1.0
    for _ in range(TRIALS):
        text = stl(solid, tolerance / finer, ANGLE / math.sqrt(finer))
        mesh = _read(text)
        if not mesh.is_volume:
            raise RuntimeError(f"{name}: the {len(mesh.faces)} triangles are not watertight: try another tolerance")
        error = mesh.volume / exact - 1
        if abs(error) <= LARGEST_ERROR:
            return Facets(text, mesh, float(error))
        # the error goes with the distance, and with the square of the angle
        finer *= 1.2 * abs(error) / LARGEST_ERROR
    raise RuntimeError(
        f"{name}: the volume of the triangles is off by {error:.2g}, more than {LARGEST_ERROR:g}: "
        f"make tolerance finer than {tolerance:g} mm"
    )


def triangulated(solid: Solid, tolerance: float = TOLERANCE, angle: float = ANGLE) -> Any:
    """A trimesh of the solid's surface, mm, in single precision as an STL file has it; its volume is not looked at.

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
    import numpy as np
    import trimesh

    corners = np.frombuffer(text, dtype=FACET, offset=84)["corners"].reshape(-1, 3)
    return trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3))


def export(
    parts: Mapping[str, tuple[Solid, Facets]], folder: str | Path, *, colours: Mapping[str, str] | None = None
) -> list[Exported]:
    """Write NAME.step, NAME.stl and NAME.3mf into an existing folder for every part; units mm.

    All files are written to a temporary folder inside `folder` and moved only once all are complete, so a failure
    leaves nothing half-written.

    Parameters
    ----------
    parts : solids by name, each with its facets.
    colours : of the parts in their STEP files, by name, as CSS knows them.

    Raises
    ------
    OSError
        The folder does not exist or cannot be written.
    """
    with tempfile.TemporaryDirectory(prefix=".export-", dir=folder) as temporary:
        written = []
        for name, (solid, surface) in parts.items():
            mesh = surface.mesh
            made = {
                "step": step(named(solid, name, (colours or {}).get(name, ""))),
                "stl": surface.text,
                "3mf": _packed(name, mesh),
            }
            for suffix, content in made.items():
                Path(temporary, f"{name}.{suffix}").write_bytes(content)
            figures = (float(solid.volume), float(mesh.volume), surface.error, True, len(mesh.faces))
            written.append(Exported(name, f"{name}.stl", *figures))
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


def _packed(name: str, mesh: Any) -> bytes:
    """The bytes of a 3MF file (core specification 1.3) of one object, mm; coordinates in single precision."""
    import numpy as np

    vertices, faces = np.asarray(mesh.vertices, dtype=np.float32), np.asarray(mesh.faces)
    corners = '<vertex x="%.9g" y="%.9g" z="%.9g"/>\n' * len(vertices) % tuple(vertices.ravel().tolist())
    sides = '<triangle v1="%d" v2="%d" v3="%d"/>\n' * len(faces) % tuple(faces.ravel().tolist())
    model = MODEL.format(name=escape(name), vertices=corners, triangles=sides)
    text = BytesIO()
    with zipfile.ZipFile(text, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        for path, content in {**PACKAGE, "3D/3dmodel.model": model}.items():
            # without a time of its own the file depends on the part alone
            file.writestr(zipfile.ZipInfo(path), content, zipfile.ZIP_DEFLATED)
    return text.getvalue()
