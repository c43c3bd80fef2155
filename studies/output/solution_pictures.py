"""Off-screen PyVista pictures of solutions: the deformed section with its magnet and the plate.

The section lies in the plane of the shear (without a shear y = 0), which a label names; the shear points to the
right. Lengths are in mm.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem.results import revolved_body
from fem.results.revolved_body import Body
from fem.solution import Solution
from geometry.arrays import Array
from geometry.design import Design
from geometry.loads import Magnet
from studies.output.atomic_files import atomic
from studies.output.vtk_files import spatial

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
        high = float(cut.value.max())
        step = _round_length((high if high > 0 else 1.0) / 3)
        ticks = step * np.arange(math.ceil(high / step - 1e-9) + 1, dtype=np.float64)
        actor = self.plotter.add_mesh(
            surface(cut.moved, cut.value),
            scalars="value",
            cmap="viridis",
            clim=(ticks[0], ticks[-1]),
            lighting=False,
            show_scalar_bar=False,
            interpolate_before_map=True,
        )
        self.plotter.add_mesh(lines(cut.edges[:, 0], 0.02), color=_GREY, line_width=3, lighting=False)
        self.plotter.add_mesh(lines(cut.edges[:, 1], 0.03), color=_DARK, line_width=4, lighting=False)
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
        a, b, rho = design.magnet_diameter / 2, design.magnet_height / 2, design.magnet_edge_radius
        turn = np.linspace(0, math.pi / 2, 9)
        arcs = [
            np.stack(
                [sx * (a - rho) + rho * np.cos(turn + start), sz * (b - rho) + rho * np.sin(turn + start)], axis=1
            )
            for sx, sz, start in ((1, 1, 0), (-1, 1, math.pi / 2), (-1, -1, math.pi), (1, -1, 3 * math.pi / 2))
        ]
        (x, z), c, s = np.concatenate(arcs).T, math.cos(response.tilt), math.sin(response.tilt)
        place = np.array([response.shift[0], response.shift[2] + design.H])
        outline = np.stack([c * x + s * z, -s * x + c * z], axis=1) + place
        self._polygon(outline, 0.04, "#e4e4e4")
        self._line(outline, 0.05, 5)
        # the label is drawn only where it fits into the tilted magnet
        c, s, wide, high = abs(c), abs(s), 0.26 * self.reach, 0.1 * self.reach
        if design.magnet_diameter > c * wide + s * high and design.magnet_height > s * wide + c * high:
            self.label(tuple(place.tolist()), "magnet")

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
    load = solution.load
    return design.L - load.depth + design.R * (1 / math.cos(load.plate_tilt) - 1)


def _round_length(length: float) -> float:
    """Return the greatest 1, 2 or 5 times a power of ten that does not exceed a length."""
    power = 10.0 ** math.floor(math.log10(length))
    return max(step * power for step in (1, 2, 5) if step * power <= length * (1 + 1e-9))


# The section as curved triangles, and as the flat ones that VTK draws


PIECES = 6
"""Pieces into which each edge of a curved triangle is divided for drawing."""


class Cut(NamedTuple):
    """The curved triangles in the plane y = 0.

    rest, moved : undeformed and deformed nodes, shape (m, 6, 3), mm.
    value : displacement at the nodes, shape (m, 6), mm.
    edges : outline, undeformed and deformed, three nodes to an edge, shape (k, 2, 3, 3), mm.
    """

    rest: Array
    moved: Array
    value: Array
    edges: Array


def cut_of(solution: Solution) -> Cut:
    """Return the section of the deformed body in the plane of its shear (without a shear y = 0), rotated to y = 0.

    The section of an axisymmetric body is mirrored; the tetrahedra of a body without a plane of symmetry are cut.
    """
    solid = revolved_body.revolve(solution.field)
    if not revolved_body.mirrored(solution):
        x, y = solution.load.direction
        return _sliced(revolved_body.turn(solid, (x, -y)))
    u = spatial(solid.u)
    x = spatial(solid.mesh.doflocs.T)
    nodes = _triangles(solid.mesh)
    sides = np.concatenate([nodes[:, [0, 3, 1]], nodes[:, [1, 4, 2]], nodes[:, [0, 5, 2]]])
    _, first, count = np.unique(sides[:, 1], return_index=True, return_counts=True)
    ends = sides[first[count == 1]]
    edges = np.stack([x[ends], (x + u)[ends]], axis=1)
    rest, moved, values = x[nodes], (x + u)[nodes], np.linalg.norm(u, axis=1)[nodes]
    # an axisymmetric mesh ends at the axis, and its edges there are no outline
    if solid.mesh.dim() == 2:
        mirror = np.array([-1.0, 1.0, 1.0])
        on_axis = np.abs(edges[:, 0, :, 0]).max(axis=1) < 1e-9 * np.abs(x).max()
        edges = np.concatenate([edges[~on_axis], edges[~on_axis] * mirror])
        rest, moved = np.concatenate([rest, rest * mirror]), np.concatenate([moved, moved * mirror])
        values = np.concatenate([values, values])
    return Cut(rest, moved, values, edges)


def _sliced(solid: Body) -> Cut:
    """Return the section of the undeformed tetrahedra with the plane y = 0: one or two triangles in each of them.

    The crossings are computed as if the cells were straight. Neighbours share the barycentric coordinates of a
    crossing, so the section has no gaps.
    """
    nodes = np.asarray(solid.mesh.dofs.element_dofs, dtype=np.int64).T
    x = solid.mesh.doflocs.T
    cell, corners = _crossings(x[nodes[:, :4], 1])
    ends = np.array([(0, 1), (1, 2), (2, 0)])
    middles = corners[:, ends].mean(axis=2)
    points = np.concatenate([corners, middles[:, [0, 1, 2]]], axis=1)
    pairs = np.array([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)])
    # second-order shape functions at the triangles' nodes, with which place and displacement are interpolated
    edge_shapes = 4 * points[..., pairs[:, 0]] * points[..., pairs[:, 1]]
    shapes = np.concatenate([points * (2 * points - 1), edge_shapes], axis=-1)
    rest, u = (np.einsum("kpa,kai->kpi", shapes, nodal[nodes[cell]]) for nodal in (x, solid.u))
    # an edge of the section lies in a face of its cell: both ends have no share of the corner opposite to that face
    opposite = (corners[:, ends] == 0).all(axis=2)
    outer = np.zeros(solid.mesh.facets.shape[1], dtype=bool)
    outer[solid.mesh.boundary_facets()] = True
    on_face = outer[solid.mesh.t2f[[3, 2, 1, 0]].T][cell][:, None, :]
    triangle, side = np.nonzero((opposite & on_face).any(axis=2))
    curve = np.stack([ends[side, 0], side + 3, ends[side, 1]], axis=1)
    moved = rest + u
    edges = np.stack([rest[triangle[:, None], curve], moved[triangle[:, None], curve]], axis=1)
    return Cut(rest, moved, np.linalg.norm(u, axis=2), edges)


def _crossings(y: Array) -> tuple[NDArray[np.int64], Array]:
    """Find the triangles in which linear functions y in tetrahedra are zero.

    `y`: values at the corners of m cells, shape (m, 4).

    Returns
    -------
    Cells, shape (k,), and barycentric coordinates of the triangles' corners, shape (k, 3, 4).
    """
    above = y >= 0
    order = np.argsort(above, axis=1, kind="stable")
    count = above.sum(axis=1)
    cells, coordinates = [], []
    # the cut is a triangle round a single corner, or a quadrilateral of two triangles between two corners and two;
    # numbers are places in `order`, which lists the corners below the plane first
    for number, triangles in (
        (1, [((3, 0), (3, 1), (3, 2))]),
        (3, [((0, 1), (0, 2), (0, 3))]),
        (2, [((0, 2), (0, 3), (1, 3)), ((0, 2), (1, 3), (1, 2))]),
    ):
        cell = np.flatnonzero(count == number)
        for triangle in triangles:
            corners = np.zeros((len(cell), 3, 4))
            for i, (a, b) in enumerate(triangle):
                one, other = order[cell, a], order[cell, b]
                share = y[cell, one] / (y[cell, one] - y[cell, other])
                corners[np.arange(len(cell)), i, one] = 1 - share
                corners[np.arange(len(cell)), i, other] = share
            cells.append(cell)
            coordinates.append(corners)
    return np.concatenate(cells), np.concatenate(coordinates)


def _triangles(mesh: Any) -> NDArray[np.int64]:
    """Return the nodes of the curved triangles in the plane y = 0, shape (m, 6): corners, then edges 01, 12, 02."""
    nodes = np.asarray(mesh.dofs.element_dofs, dtype=np.int64)
    if mesh.dim() == 2:
        return nodes.T
    faces = [[0, 1, 2, 4, 5, 6], [0, 1, 3, 4, 8, 7], [0, 2, 3, 6, 9, 7], [1, 2, 3, 5, 9, 8]]
    sides = np.concatenate([nodes[face] for face in faces], axis=1)
    flat = np.abs(mesh.doflocs[1, sides]).max(axis=0) < 1e-9 * np.abs(mesh.doflocs).max()
    return sides[:, flat].T


def surface(corners: Array, value: Array) -> Any:
    """Divide curved triangles, shape (m, 6, 3), into a PyVista surface of flat ones.

    `value`: values at the nodes, shape (m, 6); the points of the surface get their interpolation.
    """
    import pyvista as pv

    grid = [(i, j) for i in range(PIECES + 1) for j in range(PIECES + 1 - i)]
    number = {pair: k for k, pair in enumerate(grid)}
    a, b = np.array(grid, dtype=float).T / PIECES
    c = 1 - a - b
    shape = np.stack([c * (2 * c - 1), a * (2 * a - 1), b * (2 * b - 1), 4 * c * a, 4 * a * b, 4 * b * c])
    small = [(number[i, j], number[i + 1, j], number[i, j + 1]) for i, j in grid if i + j < PIECES]
    small += [(number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]) for i, j in grid if i + j < PIECES - 1]
    points = np.einsum("kp,mki->mpi", shape, corners).reshape(-1, 3)
    faces = np.array(small) + len(grid) * np.arange(len(corners))[:, None, None]
    surface = pv.PolyData.from_regular_faces(points, faces.reshape(-1, 3))
    surface.point_data["value"] = np.einsum("kp,mk->mp", shape, value).ravel()
    return surface


def lines(edges: Array, towards: float) -> Any:
    """Return the curves through three nodes of each edge, shape (k, 3, 3), moved by `towards` mm to the viewer."""
    import pyvista as pv

    t = np.linspace(0, 1, PIECES + 1)
    shape = np.stack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])
    points = np.einsum("kp,eki->epi", shape, edges) - [0.0, towards, 0.0]
    pairs = np.arange(points.shape[0] * points.shape[1]).reshape(points.shape[:2])
    ends = np.stack([pairs[:, :-1], pairs[:, 1:]], axis=2).reshape(-1, 2)
    return pv.PolyData(points.reshape(-1, 3), lines=np.insert(ends, 0, 2, axis=1).ravel())
