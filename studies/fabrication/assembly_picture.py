"""Pictures of the assembled sensor, and of the jig that puts its magnet in, cut open along y = 0.

All parts but the magnet show their section. Labels name the Hall elements or the parts of the jig, and small axes
show the sensor's or the mould's frame. The view is from the left and above, so that an element behind the section
appears beside the beam. The leads of such an element are not drawn below the base, because they would seem to belong
to an element in the section.

The import of VTK and pyvista takes as long as the CAD kernel needs for all solids and checks, and a graphics driver
may crash its process. So a process of its own draws, `python -m studies.fabrication.assembly_picture`. It is started
early, imports the libraries meanwhile, and then draws the parts that it receives.
"""

from __future__ import annotations

import contextlib
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING, Any

from studies.output import provenance

if TYPE_CHECKING:
    from build123d import Solid

SIZE = (1200, 900)
"""Width and height of the picture before its white margins are cut, pixels."""

RIM = 20
"""Width of the white margin around the sensor, pixels."""

VIEW = (-1.25, -1.35, 1.35)
"""Direction from the sensor to the camera, in the sensor's frame; its length has no effect."""

WHOLE = ("magnet",)
"""Parts that are drawn whole; the others are cut at y = 0, which shows the elements in their seats."""

FACETS = 600
"""Size of the sensor over the facet tolerance; fine enough for a picture of 1200 pixels."""

COMMAND = (sys.executable, "-m", "studies.fabrication.assembly_picture")
"""Command line of the process that reads lists of parts and writes PNG files."""


Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Part:
    """The triangles of a part and how they are drawn.

    Attributes
    ----------
    vertices, faces : shape (n, 3), mm, and shape (m, 3).
    opened : whether the part is cut at y = 0 and only y > 0 is drawn.
    floor : z below which nothing is drawn, mm; None for no limit.
    label : name, and the point at which its leader line ends, mm; None for no name.
    """

    vertices: Any
    faces: Any
    colour: str
    opened: bool
    floor: float | None = None
    label: tuple[str, Vector] | None = None


class NoPictureError(RuntimeError):
    """The process that draws has failed, such as in a graphics driver."""


Scene = tuple["Mapping[str, tuple[Solid, str]]", Mapping[str, Vector]]
"""What a picture shows: solids by name, each with its colour, and a point for each that gets a label, mm."""

Painter = Callable[[Sequence[Scene]], list[bytes]]
"""Draws scenes; returns the bytes of a PNG file for each."""


@contextlib.contextmanager
def painter() -> Iterator[Painter]:
    """Start a process that draws pictures, and yield a function that sends it the scenes, once.

    The function raises a NoPictureError if the process fails.
    """
    pipe = subprocess.PIPE
    with subprocess.Popen(COMMAND, cwd=provenance.ROOT, stdin=pipe, stdout=pipe, stderr=pipe) as process:

        def draw(scenes: Sequence[Scene]) -> list[bytes]:
            pictures, errors = process.communicate(pickle.dumps([faceted(*scene) for scene in scenes]))
            if process.returncode:
                last = (errors.decode(errors="replace").strip().splitlines() or ["no message"])[-1]
                raise NoPictureError(f"drawing ended with exit code {process.returncode} ({last})")
            drawn: list[bytes] = pickle.loads(pictures)
            return drawn

        try:
            yield draw
        finally:
            process.kill()


def faceted(parts: Mapping[str, tuple[Solid, str]], names: Mapping[str, Vector]) -> list[Part]:
    """Return the parts as triangles; those in `names` get labels at these points, mm."""
    import numpy as np

    from geometry.fabrication.solid_files import triangulated

    first, drawn_parts = parts.get("base", next(iter(parts.values()))), []
    box = first[0].bounding_box(optimal=False)
    size, underside = max(box.size), box.min.Z
    for name, (solid, colour) in parts.items():
        mesh = triangulated(solid, size / FACETS, 0.2)
        vertices = np.asarray(mesh.vertices)
        if name.split()[0] not in WHOLE and vertices[:, 1].max() <= 0:
            continue  # the section cuts it away
        behind, label = name in names and vertices[:, 1].min() > 0, None
        if name in names:
            x, y, z = names[name]
            if behind:
                # the beam hides the rest of an element behind the section: point to its top, near the visible side
                x, z = 0.8 * float(vertices[:, 0].min()) + 0.2 * x, float(vertices[:, 2].max())
            label = name, (x, y, z)
        floor = float(underside) if behind else None
        drawn_parts.append(Part(vertices, np.asarray(mesh.faces), colour, name.split()[0] not in WHOLE, floor, label))
    return drawn_parts


def portrait(parts: Sequence[Part], plotter: Any) -> bytes:
    """Draw one picture and return the bytes of its PNG file; the widest part sets the scale."""
    import numpy as np
    from PIL import Image

    from studies.output import picture_labels

    plotter.clear_actors()
    size = max(float(np.ptp(part.vertices, axis=0).max()) for part in parts if part.opened)
    corners = []
    for part in parts:
        surface = shown(part).compute_normals(split_vertices=True, feature_angle=30)
        plotter.add_mesh(surface, color=part.colour, smooth_shading=True, specular=0.2, ambient=0.25, render=False)
        corners.append(surface.points)
        edges = surface.extract_feature_edges(30, manifold_edges=False)
        if edges.n_cells:
            plotter.add_mesh(edges, color="#222222", line_width=2.0, render=False)
    heights = [float(z) for part in parts for z in (part.vertices[:, 2].min(), part.vertices[:, 2].max())]
    middle = (max(heights) + min(heights)) / 2
    camera = plotter.camera
    camera.focal_point = (0.0, 0.0, middle)
    camera.position = (VIEW[0] * size, VIEW[1] * size, middle + VIEW[2] * size)
    camera.up = (0.0, 0.0, 1.0)
    plotter.reset_camera(render=False)
    # nearer, as far as the whole subject stays in the picture
    view = np.subtract(camera.position, camera.focal_point)
    across = np.cross((0.0, 0.0, 1.0), view)
    axes = np.array(
        [across / np.linalg.norm(across), np.cross(view, across) / np.linalg.norm(np.cross(view, across))]
    )
    reach = np.abs((np.vstack(corners) - camera.focal_point) @ axes.T).max(axis=0)
    camera.parallel_scale = max(camera.parallel_scale / 1.15, 1.1 * max(reach[1], reach[0] * SIZE[1] / SIZE[0]))
    # a second picture would show the view before the zoom
    plotter.render()
    png = BytesIO()
    image = Image.fromarray(plotter.screenshot(return_img=True))
    names = {part.label[0]: _pixel(plotter, part.label[1]) for part in parts if part.label}
    picture_labels.annotate(image, names, _axes(plotter))
    _trimmed(image).save(png, "png", compress_level=3)
    return png.getvalue()


def _pixel(plotter: Any, point: Vector) -> tuple[float, float]:
    """Return the place of a point, mm, in the picture: pixels from its left and upper border."""
    renderer = plotter.renderer
    renderer.SetWorldPoint(*point, 1.0)
    renderer.WorldToDisplay()
    x, y, _ = renderer.GetDisplayPoint()
    return x, SIZE[1] - y


def _axes(plotter: Any) -> dict[str, tuple[float, float]]:
    """Return the directions of the sensor's axes in the picture; an axis in the picture's plane has length 1."""
    # pixels per mm in the picture's plane: VTK defines parallel_scale as half the height of the view, mm
    scale = SIZE[1] / (2 * plotter.camera.parallel_scale)
    x0, y0 = _pixel(plotter, (0.0, 0.0, 0.0))
    ends = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    places = {name: _pixel(plotter, end) for name, end in ends.items()}
    return {name: ((x - x0) / scale, (y - y0) / scale) for name, (x, y) in places.items()}


def shown(part: Part) -> Any:
    """Return the drawn region of a part as a closed PyVista surface."""
    import pyvista as pv

    surface = pv.PolyData.from_regular_faces(part.vertices, part.faces)
    if part.floor is not None:
        surface = surface.clip_closed_surface(normal="z", origin=(0.0, 0.0, part.floor))
    return surface.clip_closed_surface(normal="y", origin=(0.0, 0.0, 0.0)) if part.opened else surface


def _trimmed(picture: Any) -> Any:
    from PIL import ImageOps

    wide, tall = picture.size
    left, top, right, low = ImageOps.invert(picture.convert("L")).getbbox() or (0, 0, wide, tall)
    return picture.crop((max(left - RIM, 0), max(top - RIM, 0), min(right + RIM, wide), min(low + RIM, tall)))


def _plotter() -> Any:
    """Return an empty plotter; its construction takes most of the time of a picture."""
    import pyvista as pv

    from studies.output.solution_pictures import quiet

    quiet()
    plotter = pv.Plotter(off_screen=True, window_size=list(SIZE))
    plotter.set_background("white")
    plotter.enable_anti_aliasing("msaa", multi_samples=4)
    plotter.enable_parallel_projection()
    return plotter


def main() -> None:
    """Read lists of parts from standard input and write their pictures to standard output."""
    # the plotter is made before the parts arrive, which saves most of the waiting time
    plotter = _plotter()
    pictures = [portrait(parts, plotter) for parts in pickle.load(sys.stdin.buffer)]
    sys.stdout.buffer.write(pickle.dumps(pictures))


if __name__ == "__main__":
    main()
