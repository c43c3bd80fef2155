"""The surface of a deformed sensor for the page's 3D figure, from a .vtu file or from a solve.

The body is cut along the plane y = 0, so that the magnet shows. A .vtu holds the section of an axisymmetric solution,
half the body or the whole; all three give the same parts: the skin of each half, the cut face, and the magnet, whose
surface is the wall of its pocket in the silicone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from geometry.arrays import Array, Ints
from geometry.design import BadInput, Design
from geometry.loads import Load

SECTORS = 40
"""Number of sectors of half a turn into which a section is revolved: 4.5 degrees, round at the size of the page."""
FLAT = 1e-7
"""Share of the body's size up to which a point lies in the plane y = 0."""
DIGITS = 3
"""Decimals of coordinates, mm."""
MIRROR = np.array([1.0, -1.0, 1.0])

Part = tuple[Array, Array, Ints]
"""Undeformed points (n, 3), displacements (n, 3), mm, and triangles (m, 3)."""


@dataclass(frozen=True, slots=True)
class Surface:
    """Triangles of a deformed sensor.

    Attributes
    ----------
    title, caption : what is shown.
    parts : by name: "front" (y <= 0), "back" (y >= 0), "cut" and "magnet".
    """

    title: str
    caption: str
    parts: dict[str, Part]

    @property
    def largest(self) -> float:
        """Largest displacement, mm."""
        return max(float(np.linalg.norm(u, axis=1).max()) for _, u, _ in self.parts.values())

    def data(self) -> dict[str, Any]:
        """Return the surface as the page's script takes it: lists of deformed points, displacements and triangles."""
        parts = {
            name: {
                "points": np.round(rest + u, DIGITS).ravel().tolist(),
                "value": np.round(np.linalg.norm(u, axis=1), DIGITS).tolist(),
                "triangles": triangles.ravel().tolist(),
            }
            for name, (rest, u, triangles) in self.parts.items()
        }
        return {"title": self.title, "largest": round(self.largest, DIGITS), "parts": parts}


def from_file(path: Path) -> Surface | None:
    """Return the surface of a solution's .vtu file; None if it is a mesh without displacements.

    Raises
    ------
    BadInput
        The file is no .vtu file with cells.
    """
    import pyvista as pv
    from vtkmodules.vtkCommonCore import vtkObject
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    # VTK would print its own messages; the report says in a sentence that the file cannot be read
    vtkObject.GlobalWarningDisplayOff()
    try:
        reader = vtkXMLUnstructuredGridReader()
        reader.SetFileName(str(path))
        reader.Update()
        grid = pv.wrap(reader.GetOutput())
    finally:
        vtkObject.GlobalWarningDisplayOn()
    if not grid.n_cells:
        raise BadInput("it is no .vtu file with cells")
    if "displacement_mm" not in grid.point_data:
        return None
    parts = parts_of(grid)
    return Surface(f"Deformed sensor, {path.name}", _caption(parts, f"the state in {path.name}"), parts)


def solved(design: Design, load: Load | None) -> Surface:
    """Solve for a state by finite elements and return its surface.

    Parameters
    ----------
    load : of the study; None, where it names none, for a press to D/8 and a glued shear of D/8.

    Raises
    ------
    BadInput
        The solve stopped before this state.
    """
    from fem.accuracy import STANDARD
    from studies.mechanics.path_solver import follow
    from studies.output.vtk_files import field_grid

    chosen = load is None
    load = load or Load(depth=design.D / 8, shear_x=design.D / 8, friction="stick")
    (outcome,) = follow(design, [load], STANDARD, "rigid" if design.shape.has_magnet else "ignored")
    if outcome.solution is None:
        raise BadInput(f"the sensor was not solved for its 3D figure ({outcome.status}): {outcome.message}")
    parts = parts_of(field_grid(outcome.solution))
    response = outcome.solution.response
    why = ", for want of a load in the files," if chosen else ""
    caption = (
        f"{_caption(parts, _named_load(load))} Solved{why} for this report, for D = {design.D:.4g} mm and "
        f"L = {design.L:.4g} mm: force {response.force[0]:.3g} N along the shear and "
        f"{response.force[2]:.3g} N in compression; the magnet tilts by {math.degrees(response.tilt):.2g} degrees."
    )
    return Surface("Deformed sensor", caption, parts)


def _named_load(load: Load) -> str:
    """Return what is done to the sensor.

    >>> _named_load(Load(depth=1.0, shear_x=0.5, friction=0.3))
    'a press of 1 mm and a shear of 0.5 mm with a friction coefficient of 0.3'
    """
    parts = [f"a press of {load.depth:.3g} mm" if load.grip is None else f"a grip of {load.grip:.3g} mm"]
    if load.plate_tilt:
        parts.append(f"a plate tilted by {math.degrees(load.plate_tilt):.3g} degrees")
    if load.shear:
        parts.append(f"a shear of {load.shear:.3g} mm")
    contact = {"stick": "with the plate stuck to the tip", "none": "without friction"}
    how = contact.get(str(load.friction), f"with a friction coefficient of {load.friction}")
    return " and ".join(parts) + (f" {how}" if load.shear and load.grip is None else "")


def _caption(parts: dict[str, Part], state: str) -> str:
    """Return what the figure shows."""
    largest = max(float(np.linalg.norm(u, axis=1).max()) for _, u, _ in parts.values())
    magnet = "; the magnet is grey" if "magnet" in parts else ""
    return (
        f"The beam in {state}, at true scale, coloured by its displacement, at most {largest:.3g} mm{magnet}. Drag, "
        "or use the arrow keys, to turn it."
    )


def parts_of(grid: Any) -> dict[str, Part]:
    """Return the parts of a PyVista grid with point data `displacement_mm`, whose points are the deformed ones."""
    moved, u = np.asarray(grid.points, dtype=float), np.asarray(grid.point_data["displacement_mm"], dtype=float)
    rest = moved - u
    size = float(np.ptp(rest, axis=0).max())
    if np.abs(rest[:, 1]).max() < FLAT * size:
        halves = _revolved(grid, rest, u)
        return _joined(halves, _mirrored(halves))
    back = rest[:, 1].min() > -FLAT * size
    front = rest[:, 1].max() < FLAT * size
    if back or front:
        half = _half(_surface(grid), size)
        return _joined(_mirrored(half), half) if front else _joined(half, _mirrored(half))
    sides, whole = [], _flat_cells(grid, rest)
    for sign in (1.0, -1.0):
        clipped = whole.clip(normal=(0.0, -sign, 0.0), origin=(0.0, 0.0, 0.0), invert=True)
        clipped.points = np.asarray(clipped.points) + np.asarray(clipped.point_data["displacement_mm"])
        sides.append(_half(_surface(clipped), size))
    return _joined(*sides)


def _flat_cells(grid: Any, rest: Array) -> Any:
    """Return each curved tetrahedron as eight flat ones, undeformed.

    A plane cuts only some cells, and makes flat ones of them, whose faces a curved neighbour would not share.
    """
    import pyvista as pv

    # nodes 4 to 9 are the middles of the edges 01, 12, 02, 03, 13, 23; the inner octahedron is cut along 6 to 8
    few = [
        (0, 4, 6, 7),
        (4, 1, 5, 8),
        (6, 5, 2, 9),
        (7, 8, 9, 3),
        (6, 8, 4, 5),
        (6, 8, 5, 9),
        (6, 8, 9, 7),
        (6, 8, 7, 4),
    ]
    nodes = np.asarray(grid.cells_dict[pv.CellType.QUADRATIC_TETRA])
    cells = np.concatenate([nodes[:, list(four)] for four in few])
    flat = pv.UnstructuredGrid({pv.CellType.TETRA: cells}, rest)
    flat.point_data["displacement_mm"] = np.asarray(grid.point_data["displacement_mm"])
    return flat


def _joined(back: dict[str, Part], front: dict[str, Part]) -> dict[str, Part]:
    """Return the parts of two halves: skins, the cut face once, and the magnet of both."""
    parts = {"back": back["skin"], "front": front["skin"], "cut": back["cut"]}
    if "magnet" in back:
        parts["magnet"] = _together(back["magnet"], front["magnet"])
    return {name: part for name, part in parts.items() if len(part[2])}


def _together(*parts: Part) -> Part:
    """Return several parts as one."""
    starts = np.cumsum([0, *(len(rest) for rest, _, _ in parts)])[:-1]
    return (
        np.concatenate([rest for rest, _, _ in parts]),
        np.concatenate([u for _, u, _ in parts]),
        np.concatenate([triangles + start for (_, _, triangles), start in zip(parts, starts, strict=True)]),
    )


def _mirrored(half: dict[str, Part]) -> dict[str, Part]:
    """Return the other half of a body that is symmetric about y = 0."""
    return {name: (rest * MIRROR, u * MIRROR, triangles[:, ::-1]) for name, (rest, u, triangles) in half.items()}


def _surface(grid: Any) -> Any:
    """Return the outer triangles of a grid, each curved one as four flat ones."""
    import pyvista as pv
    from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter

    surfaces = vtkDataSetSurfaceFilter()
    surfaces.SetInputData(grid)
    surfaces.SetNonlinearSubdivisionLevel(1)
    surfaces.Update()
    return pv.wrap(surfaces.GetOutput()).triangulate()


def _half(surface: Any, size: float) -> dict[str, Part]:
    """Return skin, cut face and pocket of half a body."""
    points = np.asarray(surface.points, dtype=float)
    u = np.asarray(surface.point_data["displacement_mm"], dtype=float)
    triangles = np.asarray(surface.faces).reshape(-1, 4)[:, 1:]
    rest = points - u
    flat = (np.abs(rest[triangles, 1]) < 1e-5 * size).all(axis=1)
    pieces = _pieces(triangles[~flat], len(points))
    return _named(rest, u, triangles[flat], pieces)


def _named(rest: Array, u: Array, cut: Ints, pieces: Sequence[Ints]) -> dict[str, Part]:
    """Return the parts by name: the piece that reaches farthest from the axis is the skin, others are the magnet."""
    far = [float(np.hypot(rest[piece, 0], rest[piece, 1]).max()) for piece in pieces]
    skin = int(np.argmax(far))
    inner = [piece for k, piece in enumerate(pieces) if k != skin]
    parts = {"skin": _compact(rest, u, pieces[skin]), "cut": _compact(rest, u, cut)}
    if inner:
        parts["magnet"] = _compact(rest, u, np.concatenate(inner))
    return parts


def _compact(rest: Array, u: Array, triangles: Ints) -> Part:
    """Return triangles with only the points that they use."""
    used, numbers = np.unique(triangles, return_inverse=True)
    return rest[used], u[used], np.asarray(numbers.reshape(triangles.shape), dtype=np.int64)


def _pieces(triangles: Ints, count: int) -> list[Ints]:
    """Return the connected pieces of a surface."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]]])
    graph = coo_matrix((np.ones(len(ends)), ends.T), shape=(count, count))
    label = connected_components(graph, directed=False)[1][triangles[:, 0]]
    return [triangles[label == one] for one in np.unique(label)]


def _revolved(grid: Any, rest: Array, u: Array) -> dict[str, Part]:
    """Return skin, cut face and pocket of the half y >= 0 of an axisymmetric section."""
    import pyvista as pv

    nodes = np.asarray(grid.cells_dict[pv.CellType.QUADRATIC_TRIANGLE])
    corners = [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)]
    right = np.concatenate([nodes[:, list(few)] for few in corners])
    flip = np.array([-1.0, 1.0, 1.0])
    cut = (np.concatenate([rest, rest * flip]), np.concatenate([u, u * flip]))
    cut_triangles = np.concatenate([right, right[:, ::-1] + len(rest)])
    # an edge of the outline belongs to one triangle only; those on the axis close the section, not the body
    edges = np.concatenate([nodes[:, [0, 3, 1]], nodes[:, [1, 4, 2]], nodes[:, [2, 5, 0]]])
    _, first, number = np.unique(edges[:, 1], return_index=True, return_counts=True)
    outline = edges[first[number == 1]]
    outline = outline[np.abs(rest[outline, 0]).max(axis=1) > FLAT * np.ptp(rest[:, 2])]
    turns = np.linspace(0.0, math.pi, SECTORS + 1)
    c, s = np.cos(turns)[:, None], np.sin(turns)[:, None]

    def swept(vectors: Array) -> Array:
        x, z = vectors[None, :, 0], np.broadcast_to(vectors[None, :, 2], (len(turns), len(vectors)))
        return np.stack([c * x, s * x, z], axis=2).reshape(-1, 3)

    pairs = np.concatenate([outline[:, :2], outline[:, 1:]])
    n, triangles = len(rest), []
    for k in range(SECTORS):
        a, b = pairs[:, 0] + k * n, pairs[:, 1] + k * n
        triangles += [np.stack([a, b, b + n], axis=1), np.stack([a, b + n, a + n], axis=1)]
    rounds, turned = swept(rest), swept(u)
    # all copies of a node on the axis are one point
    axis = np.flatnonzero(np.abs(rest[:, 0]) < FLAT * np.ptp(rest[:, 2]))
    same = np.arange(len(rounds))
    same[(axis[None, :] + n * np.arange(len(turns))[:, None]).ravel()] = np.tile(axis, len(turns))
    skin = same[np.concatenate(triangles)]
    skin = skin[(skin[:, 0] != skin[:, 1]) & (skin[:, 1] != skin[:, 2]) & (skin[:, 0] != skin[:, 2])]
    parts = _named(rounds, turned, np.zeros((0, 3), dtype=np.int64), _pieces(skin, len(rounds)))
    parts["cut"] = _compact(*cut, cut_triangles)
    return parts
