"""A picture of the assembled sensor, the front half of beam and base cut away."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from io import BytesIO
from typing import TYPE_CHECKING, Any

from geometry.cadfiles import triangulated

if TYPE_CHECKING:
    from build123d import Solid

SIZE = (1200, 900)
"""Of the picture before its white margins are cut, pixels."""

RIM = 20
"""White that is left around the sensor, pixels."""

OPENED = ("base", "silicone")
"""Parts of which only y > 0 is shown."""

CLOSE = 600
"""The facets' distance from the surface is this much less than the sensor's size."""


def portrait(parts: Mapping[str, tuple[Solid, str]]) -> bytes:
    """The picture as a PNG file's bytes.

    Parameters
    ----------
    parts : solids in the sensor's frame, each with its colour; base and silicone are cut open, others shown whole.
    """
    import numpy as np
    import pyvista as pv
    from PIL import Image

    box = parts["base"][0].bounding_box(optimal=False)
    size = max(box.size)
    plotter, top = _plotter(), 0.0
    plotter.clear_actors()
    for name, (solid, colour) in parts.items():
        mesh = triangulated(solid, size / CLOSE, 0.2)
        top = max(top, float(mesh.vertices[:, 2].max()))
        surface = pv.PolyData.from_regular_faces(np.asarray(mesh.vertices), np.asarray(mesh.faces))
        if name in OPENED:
            surface = surface.clip_closed_surface(normal="y", origin=(0.0, 0.0, 0.0))
        surface = surface.compute_normals(split_vertices=True, feature_angle=30)
        plotter.add_mesh(surface, color=colour, smooth_shading=True, specular=0.2, ambient=0.25, render=False)
        edges = surface.extract_feature_edges(30, manifold_edges=False)
        if edges.n_cells:
            plotter.add_mesh(edges, color="#222222", line_width=2.0, render=False)
    middle = (top + float(box.min.Z)) / 2
    camera = plotter.camera
    camera.focal_point = (0.0, 0.0, middle)
    camera.position = (0.45 * size, -1.6 * size, middle + 1.1 * size)
    camera.up = (0.0, 0.0, 1.0)
    plotter.reset_camera(render=False)
    camera.zoom(1.15)
    text = BytesIO()
    _trimmed(Image.fromarray(plotter.screenshot(return_img=True))).save(text, "png", compress_level=3)
    return text.getvalue()


def _trimmed(picture: Any) -> Any:
    """The picture without most of the white around."""
    from PIL import ImageOps

    wide, tall = picture.size
    left, top, right, low = ImageOps.invert(picture.convert("L")).getbbox() or (0, 0, wide, tall)
    return picture.crop((max(left - RIM, 0), max(top - RIM, 0), min(right + RIM, wide), min(low + RIM, tall)))


@functools.cache
def _plotter() -> Any:
    """One plotter for all pictures of a process: most of a picture's time goes into making it."""
    import pyvista as pv

    from studies.pictures import quiet

    quiet()
    plotter = pv.Plotter(off_screen=True, window_size=list(SIZE))
    plotter.set_background("white")
    plotter.enable_anti_aliasing("msaa", multi_samples=4)
    plotter.enable_parallel_projection()
    return plotter
