"""A picture of the assembled sensor, cut open along y = 0 so that all parts but the magnet show their section.

The Hall elements bear their names, and small axes show the sensor's frame. It is seen from the left and above, so
that an element behind the section is seen beside the beam; of such an element no leads below the base are drawn, for
they would seem to belong to one in the section.

VTK and pyvista take as long to import as the CAD kernel does to make and check everything, and a graphics driver may
take a process down with it. So the picture is drawn by a process of its own, `python -m
studies.fabrication.assembly_picture`: it is started early, imports meanwhile, and draws what then comes in.
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
"""Of the picture before its white margins are cut, pixels."""

RIM = 20
"""White that is left around the sensor, pixels."""

VIEW = (-1.25, -1.35, 1.35)
"""From where the sensor is seen, in its frame; only the direction counts."""

WHOLE = ("magnet",)
"""Parts that are shown whole; of all others only y > 0, so that what lies in a seat is seen in it."""

CLOSE = 600
"""The facets' distance from the surface is this much less than the sensor's size."""

COMMAND = (sys.executable, "-m", "studies.fabrication.assembly_picture")
"""What draws: parts come in, a PNG file goes out."""


Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Part:
    """What is drawn of a part.

    Attributes
    ----------
    vertices, faces : shape (n, 3), mm, and (m, 3).
    opened : only y > 0 is drawn, or all.
    floor : z below which nothing is drawn, mm; None for no limit.
    label : name and point, mm, that a leader line goes to; None for no name.
    """

    vertices: Any
    faces: Any
    colour: str
    opened: bool
    floor: float | None = None
    label: tuple[str, Vector] | None = None


@contextlib.contextmanager
def painter() -> Iterator[Callable[[Mapping[str, tuple[Solid, str]], Mapping[str, Vector]], bytes]]:
    """A process that gets ready to draw one picture, and a function that has it drawn.

    The function takes solids in the sensor's frame by name, each with its colour, and points in those that are to be
    named, mm, and gives the bytes of a PNG file; all but the magnet are cut open along y = 0. It raises a
    RuntimeError if the process fails.
    """
    pipe = subprocess.PIPE
    with subprocess.Popen(COMMAND, cwd=provenance.ROOT, stdin=pipe, stdout=pipe, stderr=pipe) as process:

        def drawn(parts: Mapping[str, tuple[Solid, str]], names: Mapping[str, Vector]) -> bytes:
            found, said = process.communicate(pickle.dumps(faceted(parts, names)))
            if process.returncode:
                last = (said.decode(errors="replace").strip().splitlines() or ["no message"])[-1]
                raise RuntimeError(f"drawing ended with exit code {process.returncode} ({last})")
            return found

        try:
            yield drawn
        finally:
            process.kill()


def faceted(parts: Mapping[str, tuple[Solid, str]], names: Mapping[str, Vector]) -> list[Part]:
    """The parts as triangles, those in `names` with their names at these points, mm."""
    import numpy as np

    from geometry.fabrication.solid_files import triangulated

    box, found = parts["base"][0].bounding_box(optimal=False), []
    size, underside = max(box.size), box.min.Z
    for name, (solid, colour) in parts.items():
        mesh = triangulated(solid, size / CLOSE, 0.2)
        vertices = np.asarray(mesh.vertices)
        behind, label = name in names and vertices[:, 1].min() > 0, None
        if name in names:
            x, y, z = names[name]
            if behind:
                # on top, near the side that the beam does not hide
                x, z = 0.8 * float(vertices[:, 0].min()) + 0.2 * x, float(vertices[:, 2].max())
            label = name, (x, y, z)
        floor = float(underside) if behind else None
        found.append(Part(vertices, np.asarray(mesh.faces), colour, name not in WHOLE, floor, label))
    return found


def portrait(parts: Sequence[Part], plotter: Any) -> bytes:
    """The picture as a PNG file's bytes; the size of what is shown is that of the widest part."""
    import numpy as np
    from PIL import Image

    from studies.output import picture_labels

    size = max(float(np.ptp(part.vertices, axis=0).max()) for part in parts if part.opened)
    for part in parts:
        surface = shown(part).compute_normals(split_vertices=True, feature_angle=30)
        plotter.add_mesh(surface, color=part.colour, smooth_shading=True, specular=0.2, ambient=0.25, render=False)
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
    camera.zoom(1.15)
    text = BytesIO()
    image = Image.fromarray(plotter.screenshot(return_img=True))
    names = {part.label[0]: _seen(plotter, part.label[1]) for part in parts if part.label}
    picture_labels.annotate(image, names, _axes(plotter))
    _trimmed(image).save(text, "png", compress_level=3)
    return text.getvalue()


def _seen(plotter: Any, point: Vector) -> tuple[float, float]:
    """Where a point, mm, is in the picture: pixels from its left and upper border."""
    renderer = plotter.renderer
    renderer.SetWorldPoint(*point, 1.0)
    renderer.WorldToDisplay()
    x, y, _ = renderer.GetDisplayPoint()
    return x, SIZE[1] - y


def _axes(plotter: Any) -> dict[str, tuple[float, float]]:
    """Directions of the sensor's axes in the picture; one that lies in its plane is 1 long."""
    # of a parallel projection: pixels for a mm in the picture's plane
    scale = SIZE[1] / (2 * plotter.camera.parallel_scale)
    x0, y0 = _seen(plotter, (0.0, 0.0, 0.0))
    ends = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    places = {name: _seen(plotter, end) for name, end in ends.items()}
    return {name: ((x - x0) / scale, (y - y0) / scale) for name, (x, y) in places.items()}


def shown(part: Part) -> Any:
    """What is seen of a part, as a closed surface of PyVista."""
    import pyvista as pv

    surface = pv.PolyData.from_regular_faces(part.vertices, part.faces)
    if part.floor is not None:
        surface = surface.clip_closed_surface(normal="z", origin=(0.0, 0.0, part.floor))
    return surface.clip_closed_surface(normal="y", origin=(0.0, 0.0, 0.0)) if part.opened else surface


def _trimmed(picture: Any) -> Any:
    """The picture without most of the white around."""
    from PIL import ImageOps

    wide, tall = picture.size
    left, top, right, low = ImageOps.invert(picture.convert("L")).getbbox() or (0, 0, wide, tall)
    return picture.crop((max(left - RIM, 0), max(top - RIM, 0), min(right + RIM, wide), min(low + RIM, tall)))


def _plotter() -> Any:
    """An empty stage; most of a picture's time goes into making it."""
    import pyvista as pv

    from studies.output.solution_pictures import quiet

    quiet()
    plotter = pv.Plotter(off_screen=True, window_size=list(SIZE))
    plotter.set_background("white")
    plotter.enable_anti_aliasing("msaa", multi_samples=4)
    plotter.enable_parallel_projection()
    return plotter


def main() -> None:
    """Draw what comes in."""
    plotter = _plotter()
    sys.stdout.buffer.write(portrait(pickle.load(sys.stdin.buffer), plotter))


if __name__ == "__main__":
    main()
