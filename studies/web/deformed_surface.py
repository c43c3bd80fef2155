"""The surface of a deformed sensor for the report's 3D figure, from a .vtu file or from a solve.

The body is cut along the plane y = 0, so that the magnet shows. A .vtu holds the section of an axisymmetric solution,
half the body or the whole; all three give the parts of `state_pictures.surface`: the skin of each half, the cut face,
and the magnet, whose surface is the wall of its pocket in the silicone.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from geometry.arrays import Array, Ints
from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, Magnet
from studies.web.state_pictures import Part, connected, joined, mirrored, revolved, surface, surface_data

FLAT = 1e-7
"""Share of the body's size up to which a point lies in the plane y = 0."""

Surface = dict[str, Any]
"""Title, caption, parts and largest displacement, mm."""


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
    return _described(f"Deformed sensor, {path.name}", f"the state in {path.name}", surface_data(parts_of(grid)))


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
    from fem.equilibrium import trace

    why = ", for want of a load in the files," if load is None else ""
    load = load or Load(depth=design.D / 8, shear_x=design.D / 8, friction="stick")
    magnet: Magnet = "rigid" if design.shape.has_magnet else "ignored"
    status: str
    try:
        solution = trace(design, [load], STANDARD, magnet=magnet, estimate=False)[-1]
        status, message = solution.status, solution.message
    except (BadInput, SolveFailed) as error:
        status, message = "bad_input" if isinstance(error, BadInput) else "not_converged", str(error)
    if status not in ANSWERED:
        raise BadInput(f"the sensor was not solved for its 3D figure ({status}): {message}")
    response = solution.response
    return _described(
        "Deformed sensor",
        _named_load(load),
        surface(solution),
        f" Solved{why} for this report, for D = {design.D:.4g} mm and L = {design.L:.4g} mm: force "
        f"{response.force[0]:.3g} N along the shear and {response.force[2]:.3g} N in compression; the magnet tilts "
        f"by {math.degrees(response.tilt):.2g} degrees.",
    )


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


def _described(title: str, state: str, data: dict[str, Any], more: str = "") -> Surface:
    """Return a surface with its title, and with what the figure shows."""
    magnet = "; the magnet is grey" if "magnet" in data["parts"] else ""
    caption = (
        f"The beam in {state}, at true scale, coloured by its displacement, at most {data['largest']:.3g} mm{magnet}."
        f" Drag, or use the arrow keys, to turn it.{more}"
    )
    return {"title": title, "caption": caption, **data}


def parts_of(grid: Any) -> dict[str, Part]:
    """Return the parts of a PyVista grid with point data `displacement_mm`, whose points are the deformed ones."""
    import pyvista as pv

    moved, u = np.asarray(grid.points, dtype=float), np.asarray(grid.point_data["displacement_mm"], dtype=float)
    rest = moved - u
    size = float(np.ptp(rest, axis=0).max())
    if np.abs(rest[:, 1]).max() < FLAT * size:

        def displacement(few: Ints, turn: Array) -> Array:
            c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
            return np.stack([c * u[few, 0], s * u[few, 0], 0 * c + u[few, 2]], axis=2).reshape(-1, 3)

        nodes = np.asarray(grid.cells_dict[pv.CellType.QUADRATIC_TRIANGLE])
        return revolved(rest[:, [0, 2]].T, nodes, displacement, symmetric=True)
    is_back, is_front = rest[:, 1].min() > -FLAT * size, rest[:, 1].max() < FLAT * size
    if is_back or is_front:
        half = _half(_surface(grid), size)
        other = {name: mirrored(part) for name, part in half.items()}
        back, front = (half, other) if is_back else (other, half)
    else:
        whole = _flat_cells(grid, rest)
        back, front = (_half(_surface(_clipped(whole, side)), size) for side in (1.0, -1.0))
    parts = {"back": back["skin"], "front": front["skin"], "cut": back["cut"]}
    return parts | ({"magnet": joined(back["magnet"], front["magnet"])} if "magnet" in back else {})


def _clipped(whole: Any, side: float) -> Any:
    """Return the deformed half of an undeformed body on one side of y = 0."""
    clipped = whole.clip(normal=(0.0, -side, 0.0), origin=(0.0, 0.0, 0.0), invert=True)
    clipped.points = np.asarray(clipped.points) + np.asarray(clipped.point_data["displacement_mm"])
    return clipped


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


def _surface(grid: Any) -> Any:
    """Return the outer triangles of a grid, each curved one as four flat ones."""
    import pyvista as pv
    from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter

    surfaces = vtkDataSetSurfaceFilter()
    surfaces.SetInputData(grid)
    surfaces.SetNonlinearSubdivisionLevel(1)
    surfaces.Update()
    return pv.wrap(surfaces.GetOutput()).triangulate()


def _half(surfaces: Any, size: float) -> dict[str, Part]:
    """Return skin, cut face and pocket of half a body: the skin is the piece that reaches farthest from the axis."""
    u = np.asarray(surfaces.point_data["displacement_mm"], dtype=float)
    rest = np.asarray(surfaces.points, dtype=float) - u
    triangles = np.asarray(surfaces.faces).reshape(-1, 4)[:, 1:]
    flat = (np.abs(rest[triangles, 1]) < 1e-5 * size).all(axis=1)
    walls = triangles[~flat]
    label = connected(np.concatenate([walls[:, :2], walls[:, 1:]]), len(rest))[walls[:, 0]]
    outer = label == label[np.hypot(rest[walls[:, 0], 0], rest[walls[:, 0], 1]).argmax()]
    parts = {"skin": walls[outer], "cut": triangles[flat], "magnet": walls[~outer]}
    return {name: _compact(rest, u, few) for name, few in parts.items() if len(few)}


def _compact(rest: Array, u: Array, triangles: Ints) -> Part:
    """Return triangles with only the points that they use."""
    used, numbers = np.unique(triangles, return_inverse=True)
    return rest[used], u[used], np.asarray(numbers.reshape(triangles.shape), dtype=np.int64)
