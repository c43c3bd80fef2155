"""A picture of the assembled sensor, cut open along y = 0 so that all parts but the magnet show their section.

VTK and pyvista take as long to import as the CAD kernel does to make and check everything, and a graphics driver may
take a process down with it. So the picture is drawn by a process of its own, `python -m studies.portrait`: it is
started early, imports meanwhile, and draws what then comes in.
"""

from __future__ import annotations

import contextlib
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from build123d import Solid

SIZE = (1200, 900)
"""Of the picture before its white margins are cut, pixels."""

RIM = 20
"""White that is left around the sensor, pixels."""

WHOLE = ("magnet",)
"""Parts that are shown whole; of all others only y > 0, so that what lies in a seat is seen in it."""

CLOSE = 600
"""The facets' distance from the surface is this much less than the sensor's size."""

COMMAND = (sys.executable, "-m", "studies.portrait")
"""What draws: parts come in, a PNG file goes out."""


@dataclass(frozen=True, slots=True)
class Part:
    """What is drawn of a part: vertices, shape (n, 3), mm; faces, shape (m, 3); colour; only y > 0, or all."""

    vertices: Any
    faces: Any
    colour: str
    opened: bool


@contextlib.contextmanager
def painter() -> Iterator[Callable[[Mapping[str, tuple[Solid, str]]], bytes]]:
    """A process that gets ready to draw one picture, and a function that has it drawn.

    The function takes solids in the sensor's frame by name, each with its colour, and gives the bytes of a PNG file;
    all but the magnet are cut open along y = 0. It raises a RuntimeError if the process fails.
    """
    here, pipe = Path(__file__).parent.parent, subprocess.PIPE
    with subprocess.Popen(COMMAND, cwd=here, stdin=pipe, stdout=pipe, stderr=pipe) as process:

        def drawn(parts: Mapping[str, tuple[Solid, str]]) -> bytes:
            found, said = process.communicate(pickle.dumps(faceted(parts)))
            if process.returncode:
                last = (said.decode(errors="replace").strip().splitlines() or ["no message"])[-1]
                raise RuntimeError(f"drawing ended with exit code {process.returncode} ({last})")
            return found

        try:
            yield drawn
        finally:
            process.kill()


def faceted(parts: Mapping[str, tuple[Solid, str]]) -> list[Part]:
    """The parts as triangles."""
    import numpy as np

    from geometry.cadfiles import triangulated

    size, found = max(parts["base"][0].bounding_box(optimal=False).size), []
    for name, (solid, colour) in parts.items():
        mesh = triangulated(solid, size / CLOSE, 0.2)
        found.append(Part(np.asarray(mesh.vertices), np.asarray(mesh.faces), colour, name not in WHOLE))
    return found


def portrait(parts: Sequence[Part], plotter: Any) -> bytes:
    """The picture as a PNG file's bytes; the size of what is shown is that of the widest part."""
    import numpy as np
    from PIL import Image

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
    camera.position = (0.45 * size, -1.6 * size, middle + 1.1 * size)
    camera.up = (0.0, 0.0, 1.0)
    plotter.reset_camera(render=False)
    camera.zoom(1.15)
    text = BytesIO()
    _trimmed(Image.fromarray(plotter.screenshot(return_img=True))).save(text, "png", compress_level=3)
    return text.getvalue()


def shown(part: Part) -> Any:
    """What is seen of a part, as a closed surface of PyVista."""
    import pyvista as pv

    surface = pv.PolyData.from_regular_faces(part.vertices, part.faces)
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

    from studies.pictures import quiet

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
