"""A solution as the page draws it: its section, the sensor in 3D, and the field lines of its magnet.

**Section**, along the shear.
Every triangle of the second-order mesh becomes four flat ones. The series of `angular_fields`
gives the displacement u and its slope v by the angle theta along r, theta and z at theta = 0 and pi. With the unit
tensor 1 the deformation gradient there is

    F = 1 + [du/dr, v/r, du/dz],

on the axis with dv/dr in place of v/r. The stretch shown is the largest principal one.

**Sensor in 3D**: skin of each half, cut face y = 0 and the magnet's pocket. The outline of a section is
swept around the axis with the Fourier series of the solution, which takes milliseconds.
`studies.output.deformed_body` has the same form of a .vtu file.

**Field lines** of the magnet at its pose, in the plane of the section.
In a plane through the axis the lines of B are contours of the flux psi = r A_phi through a disc of radius r; levels
of equal distance enclose equal flux. A cylinder magnet has the B of a coil of its size. With radii over the coil's,
heights zeta above one of its ends, h^2 = 4 r / (1 + r)^2 and k^2 = 4 r / ((1 + r)^2 + zeta^2), the coil's flux is a
factor times the difference over both ends of

    r^(1/2) zeta k [(k^2 + h^2 - h^2 k^2) / (h^2 k^2) K(k) - E(k) / k^2 + (h^2 - 1) / h^2 Pi(h^2, k)]

(Callaghan & Maslen, NASA TN D-465, 1960). The lines belong to the magnet, and move with it.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import special
from skfem import ElementTriP2

from analytic.parts import of_design
from fem.solution import Field, Solution
from geometry.arrays import Array, Ints
from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet
from studies.output.deformed_body import (
    QUARTERS,
    SECTORS,
    Part,
    fourier_fields,
    magnet_outline,
    of_field,
    outer_edges,
)
from studies.output.vtk_files import at_all_nodes

if TYPE_CHECKING:
    from studies.web.explorer_state import Request
    from studies.web.panels import Memory

DIGITS = 4
"""Decimals of coordinates, mm."""
FIELDS = {
    "displacement": ("displacement (mm)", 0.0),
    "pressure": ("pressure (MPa)", 0.0),
    "stretch": ("largest stretch", 1.0),
}
"""Fields of a section: label, and value at rest."""
LEAST_SPAN = 0.01
"""Least difference of the ends of the colours, in the unit of the field."""
NICE = (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10)
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])
"""Nodes of a triangle in its own coordinates: corners, then the middles of the edges 01, 12 and 02."""


def section(design: Design, solution: Solution, magnet: Magnet) -> dict[str, Any]:
    """Return the part `section` of a state; points, fields and triangles are arrays."""
    rest, moved, pressure, stretch, triangles = _sides(solution)
    load, response = solution.load, solution.response
    c, s = plane_of(solution)
    along = c * load.imposed_shear[0] + s * load.imposed_shear[1]
    shift, tilt = c * response.shift[0] + s * response.shift[1], c * response.tilt + s * response.tilt_y
    outline = np.zeros((0, 2))
    if magnet == "rigid":
        outline = magnet_outline(design, shift, response.shift[2], tilt)
    height = design.shape.plate_height(load.depth, load.plate_tilt)
    fields = {
        "displacement": np.round(np.linalg.norm(moved - rest, axis=1), DIGITS),
        "pressure": np.round(pressure, _decimals(pressure)),
        "stretch": np.round(stretch, DIGITS),
    }
    places = element_places(design)
    return {
        "points": np.round(moved, DIGITS),
        "rest": np.round(rest, DIGITS),
        "triangles": triangles,
        "outline": outer_edges(triangles, rest),
        "fields": fields,
        "spans": {name: _span(name, values) for name, values in fields.items()},
        "frame": _frame(design, load, places),
        "magnet": np.round(outline, DIGITS).tolist(),
        "plate": {"z": height, "tilt": math.degrees(load.plate_tilt), "x": along, "depth": load.depth},
        "direction": [c, s],
        "elements": places,
    }


def element_places(design: Design) -> dict[str, tuple[float, float, float]]:
    """Return the positions of the Hall elements by their names; a chip has one position."""
    return {element.name.partition(" ")[0]: element.position for element in of_design(design)}


def _span(name: str, values: Array) -> dict[str, Any]:
    """Return label and ends of the colours, round numbers; few values beyond the 99th percentile stretch no scale."""
    (label, rest), signed = FIELDS[name], name == "pressure"
    sizes = np.sort(np.abs(values - rest))
    most = _rounded_up(max(float(sizes[int(0.99 * (len(sizes) - 1))]), LEAST_SPAN))
    beyond = bool(sizes[-1] > 1.001 * most)
    return {"label": label, "low": -most if signed else rest, "high": rest + most, "beyond": beyond}


def _frame(design: Design, load: Load, places: dict[str, tuple[float, float, float]]) -> dict[str, float]:
    """Return the part of the plane that is shown, mm: that of the design, so that the picture stays under most loads.

    It is wider for a shear beyond a quarter of the diameter.
    """
    x, y, z = np.array(list(places.values())).T
    half = max(0.8 * design.D, float(np.hypot(x, y).max()) + 1.2, 0.55 * design.D + math.hypot(*load.imposed_shear))
    return {"half": half, "low": min(0.0, float(z.min())) - 0.13 * design.D, "high": design.L + 0.2 * design.D}


def _rounded_up(value: float) -> float:
    """Return the next larger round number, so that scales stay while values change a little.

    >>> _rounded_up(0.13), _rounded_up(0.0)
    (0.15, 1.0)
    """
    power = 10.0 ** math.floor(math.log10(value)) if value > 0 else 1.0
    return next(float(f"{step * power:.6g}") for step in NICE if step * power >= 0.999 * value)


def plane_of(solution: Solution) -> tuple[float, float]:
    """Return the unit vector in (x, y) along the section: along the shear, or x for fields in the user's frame."""
    in_frame = solution.model == "full" or solution.body.angles.sines
    return (1.0, 0.0) if in_frame else solution.load.direction


def _decimals(values: Array) -> int:
    """Return the decimals that leave the largest value five digits."""
    largest = float(np.abs(values).max())
    return DIGITS - math.floor(math.log10(largest)) if largest else DIGITS


def _sides(solution: Solution) -> tuple[Array, Array, Array, Array, Ints]:
    """Return rest, moved (n, 2), pressure, stretch (n,) and triangles (m, 3) of both sides of a section."""
    field = solution.body
    x, z = field.mesh.doflocs
    count = len(x)
    nodes = np.asarray(field.mesh.dofs.element_dofs).T
    flat = np.concatenate([nodes[:, list(corners)] for corners in QUARTERS])
    angles = fourier_fields(field, np.array([0.0, math.pi]))
    rest, moved, pressure = [], [], []
    stretch: list[Array] = []
    for k, s in enumerate((1.0, -1.0)):
        u, slope = angles.E[k] @ field.u.T, angles.V[k, :, 1] @ field.u.T
        rest.append(np.stack([s * x, z], axis=1))
        moved.append(np.stack([s * (x + u[0]), z + u[2]], axis=1))
        pressure.append(at_all_nodes(field.mesh, field.vertices, -(field.p @ angles.C[k])))
        # a press has the same stretch on both sides
        repeated = k and solution.model == "axisymmetric"
        stretch.append(stretch[0] if repeated else _largest_stretch(field, nodes, u, slope))
    triangles = np.concatenate([flat, flat[:, ::-1] + count])
    return *(np.concatenate(part) for part in (rest, moved, pressure, stretch)), triangles  # type: ignore[return-value]


def _largest_stretch(field: Field, nodes: Ints, u: Array, slope: Array) -> Array:
    """Return the largest principal stretch at the nodes, shape (n,), the mean of all triangles at a node.

    Parameters
    ----------
    u, slope : displacement and its slope by the angle, along r, theta and z, shape (3, n), mm.
    """
    r, shapes = field.mesh.doflocs[0], _shape_slopes()
    # Jacobian of the curved triangle at its own nodes, and the gradients of six functions there
    jacobian = np.einsum("pad,mac->mpcd", shapes, field.mesh.doflocs.T[nodes])
    values = np.concatenate([u, slope]).T[nodes]
    gradient = np.einsum("pad,maf->mpfd", shapes, values) @ np.linalg.inv(jacobian)
    radius = r[nodes][..., None]
    inner = radius > 1e-9 * r.max()
    around = np.where(inner, slope.T[nodes] / np.where(inner, radius, 1.0), gradient[..., 3:, 0])
    F = np.eye(3) + np.stack([gradient[..., :3, 0], around, gradient[..., :3, 1]], axis=-1)
    each = np.sqrt(np.linalg.eigvalsh(F.swapaxes(-1, -2) @ F)[..., -1])
    number = np.bincount(nodes.ravel(), minlength=len(r))
    return np.asarray(np.bincount(nodes.ravel(), each.ravel(), len(r)) / np.maximum(number, 1))


def _shape_slopes() -> Array:
    """Return the derivatives of the six shape functions at the six nodes, shape (nodes, functions, 2)."""
    return np.stack([ElementTriP2().lbasis(CORNERS.T, k)[1].T for k in range(6)], axis=1)


COARSE_DIGITS = 3
"""Decimals of the coordinates of the skin, mm."""


def surface(solution: Solution, sectors: int = SECTORS) -> dict[str, Any]:
    """Return the part `sensor3d`: parts of a body sheared along x, and the angle by which the page turns it, rad."""
    c, s = plane_of(solution)
    parts = of_field(solution.body, sectors)
    data = surface_data(parts)
    return data | {"scale": _rounded_up(data["largest"]), "turn": math.atan2(s, c)}


def surface_data(parts: dict[str, Part]) -> dict[str, Any]:
    """Return parts as the pages take them, with deformed points, displacements and triangles, and the largest one."""
    data = {
        name: {
            "points": np.round(rest + u, COARSE_DIGITS).ravel(),
            "value": np.round(np.linalg.norm(u, axis=1), COARSE_DIGITS),
            "triangles": triangles.ravel(),
        }
        for name, (rest, u, triangles) in parts.items()
    }
    return {"parts": data, "largest": max(float(part["value"].max()) for part in data.values())}


LINES = 16
"""Field lines on each side."""
INSIDE, GROWTH = 24, 1.08
"""Cells of the grid from the axis to the magnet's edge, and ratio of neighbouring cells beyond it."""
REACH = 4.0
"""Size of the grid over the sum of the magnet's radius and half its height."""
LEAST = 1e-3
"""Least distance of points that are kept, over the size of the grid."""


def field_lines(design: Design, solution: Solution) -> dict[str, Any]:
    """Return lines of points (x, z) of the magnet, and its centre, mm, and tilt in the plane of the shear, rad."""
    radius, half = design.magnet_diameter / 2, design.magnet_height / 2
    lines = _unit_lines(half / radius) if design.shape.has_magnet else ()
    response, (c, s) = solution.response, plane_of(solution)
    along = c * response.shift[0] + s * response.shift[1]
    tilt = c * response.tilt + s * response.tilt_y
    sides = [radius * line * [side, 1.0] for line in lines for side in (1.0, -1.0)]
    return {"lines": sides, "centre": [along, response.shift[2] + design.H], "tilt": tilt}


@functools.lru_cache(maxsize=16)
def _unit_lines(slenderness: float) -> tuple[Array, ...]:
    """Return the lines (n, 2) on the side r > 0 of a magnet of radius 1 and half height `slenderness`."""
    from contourpy import contour_generator

    size = REACH * (1 + slenderness)
    # radii lie beside that of the wall, where terms of the flux cancel
    inner = (np.arange(INSIDE) + 0.5) / INSIDE
    r = np.concatenate([inner, 1 + _growing(0.5 / INSIDE, size - 1)])
    upper = np.concatenate([inner * slenderness, slenderness + _growing(slenderness / INSIDE, size - slenderness)])
    z = np.concatenate([-upper[::-1], upper])
    flux = _flux(r[:, None], z[None, :] + slenderness) - _flux(r[:, None], z[None, :] - slenderness)
    r, flux = np.insert(r, 0, 0.0), np.insert(flux, 0, 0.0, axis=0)
    most = flux.max()
    contours = contour_generator(x=r, y=z, z=flux.T)
    lines = []
    for k in range(LINES):
        for line in contours.lines((k + 0.5) / LINES * most):
            lines.append(_thinned(np.asarray(line), LEAST * size))
    return tuple(lines)


def _flux(r: Array, zeta: Array) -> Array:
    """Return the term of one end of the coil in the flux, at radii and heights above that end, over its factor."""
    k2, h2 = 4 * r / ((1 + r) ** 2 + zeta**2), 4 * r / (1 + r) ** 2
    K, E = special.ellipk(k2), special.ellipe(k2)
    third = K + h2 / 3 * special.elliprj(0.0, 1 - k2, 1.0, 1 - h2)
    bracket = (k2 + h2 - h2 * k2) / (h2 * k2) * K - E / k2 + (h2 - 1) / h2 * third
    return np.asarray(np.sqrt(r * k2) * zeta * bracket)


def _growing(first: float, size: float) -> Array:
    """Return the ends of cells that grow from `first` until they cover `size`."""
    count = math.ceil(math.log1p(size * (GROWTH - 1) / first) / math.log(GROWTH))
    ends = first * (GROWTH ** np.arange(1, count + 1) - 1) / (GROWTH - 1)
    return np.asarray(ends * size / ends[-1])


def _thinned(line: Array, least: float) -> Array:
    """Return a line without points that lie closer than `least` to the one before; its ends stay."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    kept = np.diff(np.floor(length / least), prepend=-1) > 0
    kept[-1] = True
    return np.asarray(line[kept])


# The drawings of a design


def drawing_panel(request: Request, level: str, memory: Memory) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the drawing of all lengths of a design, and then that of its loads too, whose bodies are solved for."""
    from studies.fabrication.symbol_drawings import lengths, loads
    from studies.web.state_answers import mechanics

    design, pictures, said = request.state.design, dict[str, str](), list[str]()
    for name, draw, key in (("lengths", lengths, design), ("loads", loads, mechanics(design))):
        try:
            pictures[name] = memory.results.get((f"drawing of {name}", key), functools.partial(draw, design))
        except (BadInput, SolveFailed) as error:
            said.append(f"There is no drawing of the {name}: {error}.")
        yield level, {"picture": {**pictures}, "rows": [], "message": " ".join(said)}
