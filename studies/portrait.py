"""A picture of the assembled sensor, the front half of beam and base cut away."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from typing import TYPE_CHECKING, Any

from geometry.cadfiles import triangulated

if TYPE_CHECKING:
    from build123d import Solid

SIZE = (1000, 750)
"""Of the picture, pixels."""

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

    from studies.pictures import quiet

    quiet()
    base = parts["base"][0].bounding_box()
    size = max(base.size)
    plotter = pv.Plotter(off_screen=True, window_size=list(SIZE))
    plotter.set_background("white")
    plotter.enable_anti_aliasing("msaa", multi_samples=4)
    top = 0.0
    for name, (solid, colour) in parts.items():
        shown = _opened(solid, size) if name in ("base", "silicone") else solid
        for piece in shown if isinstance(shown, list) else [shown]:
            mesh = triangulated(piece, size / CLOSE, 0.2)
            top = max(top, float(mesh.vertices[:, 2].max()))
            surface = pv.PolyData.from_regular_faces(np.asarray(mesh.vertices), np.asarray(mesh.faces))
            surface = surface.compute_normals(split_vertices=True, feature_angle=30)
            plotter.add_mesh(surface, color=colour, smooth_shading=True, specular=0.2, ambient=0.25)
            edges = surface.extract_feature_edges(30, boundary_edges=False, manifold_edges=False)
            if edges.n_cells:
                plotter.add_mesh(edges, color="#222222", line_width=1.5)
    low = float(base.min.Z)
    plotter.enable_parallel_projection()
    plotter.camera.focal_point = (0.0, 0.0, (top + low) / 2)
    plotter.camera.position = (0.45 * size, -1.6 * size, (top + low) / 2 + 1.1 * size)
    plotter.camera.up = (0.0, 0.0, 1.0)
    plotter.reset_camera()
    plotter.camera.zoom(1.15)
    pixels = plotter.screenshot(return_img=True)
    plotter.close()
    text = BytesIO()
    Image.fromarray(pixels).save(text, "png")
    return text.getvalue()


def _opened(solid: Solid, size: float) -> list[Any]:
    """What a solid has at y > 0."""
    import build123d as bd

    far = 4 * max(size, *solid.bounding_box().size)
    return list(solid.cut(bd.Solid.make_box(2 * far, far, 2 * far, bd.Plane((-far, -far, -far)))).solids())
