"""Off-screen PyVista pictures of solutions: the deformed section with its magnet and the plate.

The section lies in the plane of the shear (without a shear y = 0), which a label names; the shear points to the
right. Lengths are in mm.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fem.results import revolved_body
from fem.solution import Solution
from geometry.arrays import Array, Ints
from geometry.design import Design
from geometry.loads import Magnet
from studies.output import deformed_body, vtk_files
from studies.output.atomic_files import atomic

SIZE = (1500, 1200)
"""Width and height of a picture, pixels."""
TEXT = 36
"""Font size, pixels."""
PLATE = 0.06
"""Drawn thickness of the plate over D."""
WIDE = 0.71
"""Share of the picture's width for the section; the scalar bar and its title have the rest."""
NEAR = 0.5
"""The plate is drawn above all silicone that is closer to it than this distance, in units of the tip radius."""
_DARK, _GREY, _PLATE = "#222222", "#8a8a8a", "#c9ced6"


def section_picture(path: str | Path, design: Design, solution: Solution, *, magnet: Magnet = "rigid") -> None:
    """Draw the section of a solution along its shear, or y = 0 without one, into a PNG file.

    Its colour is the magnitude of the displacement.

    `magnet`: "rigid" draws the magnet at its pose; "ignored" draws no magnet.
    """
    picture = _Picture(design, solution)
    if magnet == "rigid":
        picture.add_magnet()
    if solution.load.grip is None:
        picture.add_plate()
    picture.add_ground(plane_name(solution))
    top = design.L + max(0.0, PLATE * design.D - solution.load.depth)
    picture.label((0.0, top + 0.06 * picture.reach), "at rest", _GREY)
    picture.aim()
    with atomic(path) as temporary:
        picture.plotter.screenshot(temporary)
    picture.plotter.close()


class _Picture:
    """The section with the colours of its displacement, to which the other parts are added.

    span : ends of the plate, mm.
    ends : left and right end of what is shown, mm; top : its upper end.
    reach : half the height of the picture, mm: the section fits in height and width, and the lowest 0.28 of it is for
        the base and the scale.
    """

    def __init__(self, design: Design, solution: Solution) -> None:
        import pyvista as pv

        quiet()
        cut = cut_of(solution)
        self.slope = solution.load.direction[0] * math.tan(solution.load.plate_tilt)
        self.design, self.solution = design, _in_plane(solution)
        self.span = plate_span(design, self.solution, cut.moved, self.slope)
        edge, R = 0.05 * design.R, design.R
        self.ends = min(-1.4 * R, self.span[0] - edge), max(1.4 * R, self.span[1] + edge)
        end = design.L - solution.load.depth + 1.25 * R * abs(self.slope)
        highest = max(design.L, end if self.slope else 0.0)
        self.top = max(highest + 0.14 * design.D, 1.06 * highest)
        self.reach = max(0.6 * self.top, (self.ends[1] - self.ends[0]) / 2 / (WIDE * SIZE[0] / SIZE[1]))
        self.plotter = pv.Plotter(off_screen=True, window_size=list(SIZE))
        self.plotter.set_background("white")
        # round numbers from 0 on cover the range of the colours
        value = np.linalg.norm(cut.moved - cut.rest, axis=1)
        high = float(value.max())
        step = _round_length((high if high > 0 else 1.0) / 3)
        ticks = step * np.arange(math.ceil(high / step - 1e-9) + 1, dtype=np.float64)
        surface = pv.PolyData.from_regular_faces(cut.moved, cut.triangles)
        surface.point_data["value"] = value
        actor = self.plotter.add_mesh(
            surface,
            scalars="value",
            cmap="viridis",
            clim=(ticks[0], ticks[-1]),
            lighting=False,
            show_scalar_bar=False,
            interpolate_before_map=True,
        )
        for points, towards, color, width in ((cut.rest, 0.02, _GREY, 3), (cut.moved, 0.03, _DARK, 4)):
            outline = pv.PolyData(points - [0.0, towards, 0.0], lines=np.insert(cut.edges, 0, 2, axis=1).ravel())
            self.plotter.add_mesh(outline, color=color, line_width=width, lighting=False)
        self.plotter.add_scalar_bar(
            "displacement (mm)",
            mapper=actor.mapper,
            vertical=True,
            position_x=0.83,
            position_y=0.16,
            width=0.09,
            height=0.68,
            title_font_size=TEXT,
            label_font_size=TEXT,
            n_labels=len(ticks),
            fmt=" %.3g",
        )

    def add_magnet(self) -> None:
        design, response = self.design, self.solution.response
        outline = deformed_body.magnet_outline(design, response.shift[0], response.shift[2], response.tilt)
        self._polygon(outline, 0.04, "#e4e4e4")
        self._line(outline, 0.05, 5)
        # the label is drawn only where it fits into the tilted magnet
        c, s, wide, high = math.cos(response.tilt), abs(math.sin(response.tilt)), 0.26 * self.reach, 0.1 * self.reach
        if design.magnet_diameter > c * wide + s * high and design.magnet_height > s * wide + c * high:
            self.label((response.shift[0], response.shift[2] + design.H), "magnet")

    def add_plate(self) -> None:
        bottom, thick, R = _bottom(self.design, self.solution), PLATE * self.design.D, self.design.R
        ends = [(x, bottom - self.slope * x) for x in self.span]
        self._polygon(np.array([*ends, *[(x, z + thick) for x, z in reversed(ends)]]), -0.01, _PLATE)
        self._line(np.array(ends), 0.06, 5)
        # the label stands at the end to which the plate moves, clear of the outline of the undeformed body
        half = 0.09 * self.reach
        at = max(self.span[1] - half, R + half)
        if self.solution.load.shear_x < 0:
            at = min(self.span[0] + half, -R - half)
        self.label((at, bottom - self.slope * at + thick + 0.05 * self.reach), "plate")

    def add_ground(self, plane: str) -> None:
        R, thick = self.design.R, 0.053 * self.reach
        ground = np.array([(-1.4 * R, 0.0), (1.4 * R, 0.0), (1.4 * R, -thick), (-1.4 * R, -thick)])
        self._polygon(ground, -0.01, "#dddddd")
        self._line(ground[:2], 0.06, 3)
        length = _round_length(0.35 * self.reach)
        bar = np.array([(-1.4 * R, -2.6 * thick), (-1.4 * R + length, -2.6 * thick)])
        self._line(bar, 0.06, 8)
        self.label((bar[:, 0].mean(), -4.0 * thick), f"{length:g} mm")
        self.label((bar[1, 0] + 0.15 * self.reach, -4.0 * thick), plane, aligned="left")

    def label(self, at: tuple[float, float], text: str, color: str = _DARK, aligned: str = "center") -> None:
        self.plotter.add_point_labels(
            _in_section(np.array([at]), 0.1),
            [text],
            font_size=TEXT,
            text_color=color,
            shape=None,
            show_points=False,
            always_visible=True,
            justification_horizontal=aligned,
            justification_vertical="center",
            bold=False,
        )

    def aim(self) -> None:
        centre = sum(self.ends) / 2 + 0.20 * self.reach * SIZE[0] / SIZE[1]
        height = (self.top - 0.28 * self.reach) / 2
        camera = self.plotter.camera
        self.plotter.enable_parallel_projection()
        camera.focal_point = (centre, 0.0, height)
        camera.position = (centre, -10 * self.design.L, height)
        camera.up = (0.0, 0.0, 1.0)
        camera.parallel_scale = self.reach
        self.plotter.renderer.reset_camera_clipping_range()

    def _polygon(self, outline: Array, towards: float, color: str) -> None:
        import pyvista as pv

        faces = [len(outline), *range(len(outline))]
        self.plotter.add_mesh(pv.PolyData(_in_section(outline, towards), faces=faces), color=color, lighting=False)

    def _line(self, outline: Array, towards: float, width: int) -> None:
        import pyvista as pv

        line = pv.lines_from_points(_in_section(outline, towards), close=True)
        self.plotter.add_mesh(line, color=_DARK, line_width=width, lighting=False)


def _in_section(outline: Array, towards: float) -> Array:
    """Return points (n, 2) of the section in space, `towards` mm nearer to the viewer than the rest."""
    return np.insert(outline, 1, -towards, axis=1)


def _in_plane(solution: Solution) -> Solution:
    """Return the solution with load and pose as components in the section: motion along x, rotation about y."""
    (c, s), load, response = solution.load.direction, solution.load, solution.response
    x, y, z = response.shift
    load = replace(load, shear_x=c * load.shear_x + s * load.shear_y, shear_y=0.0)
    response = replace(
        response, shift=(c * x + s * y, 0.0, z), tilt=c * response.tilt + s * response.tilt_y, tilt_y=0.0
    )
    return replace(solution, load=load, response=response)


def plane_name(solution: Solution) -> str:
    """Name the section by the direction that points to the right, such as "section along 0.6 x - 0.8 y"."""
    c, s = solution.load.direction
    parts = [f"{size:.2g} {axis}".removeprefix("1 ") for size, axis in ((c, "x"), (abs(s), "y")) if size > 0.005]
    return f"section along {(' - ' if s < 0 else ' + ').join(parts)}"


def quiet() -> None:
    """Suppress VTK's warning that there is no display; it then draws without one."""
    from vtkmodules.vtkCommonCore import vtkLogger

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)


def plate_span(design: Design, solution: Solution, moved: Array, slope: float) -> tuple[float, float]:
    """Return the ends of the drawn plate, mm: it covers its middle and all silicone close below it.

    Parameters
    ----------
    solution : with its shear along x.
    moved : places (..., 3) of the section's nodes.
    """
    x, z = moved[..., 0], moved[..., 2]
    close = x[z + slope * x > _bottom(design, solution) - NEAR * design.R]
    middle, half, edge = solution.load.shear_x, 1.25 * design.R, 0.25 * design.R
    low, high = close.min(initial=middle), close.max(initial=middle)
    return min(middle - half, float(low) - edge), max(middle + half, float(high) + edge)


def _bottom(design: Design, solution: Solution) -> float:
    return design.shape.plate_height(solution.load.depth, solution.load.plate_tilt)


def _round_length(length: float) -> float:
    """Return the greatest 1, 2 or 5 times a power of ten that does not exceed a length."""
    power = 10.0 ** math.floor(math.log10(length))
    return max(step * power for step in (1, 2, 5) if step * power <= length * (1 + 1e-9))


class Cut(NamedTuple):
    """The section of the deformed body as flat triangles in the plane y = 0.

    rest, moved : undeformed and deformed points, shape (n, 3), mm.
    triangles, edges : numbers of their points, shape (m, 3) and (k, 2); edges are those of the outline.
    """

    rest: Array
    moved: Array
    triangles: Ints
    edges: Ints


def cut_of(solution: Solution) -> Cut:
    """Return the section in the plane of the shear (without a shear y = 0), rotated to y = 0."""
    solid = revolved_body.revolve(solution.body)
    if not revolved_body.mirrored(solution):
        x, y = solution.load.direction
        solid = revolved_body.turn(solid, (x, -y))
    rest, u, triangles = deformed_body.parts_of(vtk_files.body_grid(solid))["cut"]
    return Cut(rest, rest + u, triangles, deformed_body.outer_edges(triangles, rest[:, [0, 2]]))
