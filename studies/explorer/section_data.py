"""The section of a solution along its shear, as points, triangles and fields for the page.

Every triangle of the second-order mesh becomes four flat ones. The series of `angular_fields`
gives the displacement u and its slope v by the angle theta along r, theta and z at theta = 0 and pi. With the unit
tensor 1 the deformation gradient there is

    F = 1 + [du/dr, v/r, du/dz],

on the axis with dv/dr in place of v/r. The stretch shown is the largest principal one.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fem.model import angular_fields
from fem.solution import Field, Solution
from geometry.arrays import Array, Ints
from geometry.design import Design
from geometry.loads import Magnet

DIGITS = 4
"""Decimals of coordinates, mm."""
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])
"""Nodes of a triangle in its own coordinates: corners, then the middles of the edges 01, 12 and 02."""
FLAT = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))
"""The four flat triangles of a curved one."""
ARC = 7
"""Points on a quarter of the magnet's rounded edge."""


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
    height = design.L - load.depth + design.R * (1 / math.cos(load.plate_tilt) - 1)
    return {
        "points": np.round(moved, DIGITS),
        "rest": np.round(rest, DIGITS),
        "triangles": triangles,
        "fields": {
            "displacement": np.round(np.linalg.norm(moved - rest, axis=1), DIGITS),
            "pressure": np.round(pressure, _decimals(pressure)),
            "stretch": np.round(stretch, DIGITS),
        },
        "magnet": np.round(outline, DIGITS).tolist(),
        "plate": {"z": height, "tilt": math.degrees(load.plate_tilt), "x": along},
        "direction": [c, s],
    }


def plane_of(solution: Solution) -> tuple[float, float]:
    """Return the unit vector in (x, y) along the section: along the shear, or x for fields in the user's frame."""
    in_frame = solution.model == "full" or solution.field.angles.sines
    return (1.0, 0.0) if in_frame else solution.load.direction


def _decimals(values: Array) -> int:
    """Return the decimals that leave the largest value five digits."""
    largest = float(np.abs(values).max())
    return DIGITS - math.floor(math.log10(largest)) if largest else DIGITS


def magnet_outline(design: Design, shift_x: float, shift_z: float, tilt: float) -> Array:
    """Return the outline of the displaced magnet in the plane of the section, shape (n, 2), mm."""
    a, b, rho = design.magnet_diameter / 2, design.magnet_height / 2, design.magnet_edge_radius
    turn = np.linspace(0, math.pi / 2, ARC if rho else 1)
    corners = ((1, 1, 0.0), (-1, 1, math.pi / 2), (-1, -1, math.pi), (1, -1, 3 * math.pi / 2))
    arcs = [
        np.stack([i * (a - rho) + rho * np.cos(turn + t), j * (b - rho) + rho * np.sin(turn + t)], axis=1)
        for i, j, t in corners
    ]
    x, z = np.concatenate(arcs).T
    c, s = math.cos(tilt), math.sin(tilt)
    return np.stack([c * x + s * z + shift_x, c * z - s * x + shift_z + design.H], axis=1)


def _sides(solution: Solution) -> tuple[Array, Array, Array, Array, Ints]:
    """Return rest, moved (n, 2), pressure, stretch (n,) and triangles (m, 3) of both sides of a section."""
    field = solution.field
    x, z = field.mesh.doflocs
    count = len(x)
    nodes = np.asarray(field.mesh.dofs.element_dofs).T
    flat = np.concatenate([nodes[:, list(corners)] for corners in FLAT])
    angles = fourier_fields(field, np.array([0.0, math.pi]))
    rest, moved, pressure = [], [], []
    stretch: list[Array] = []
    for k, s in enumerate((1.0, -1.0)):
        u, slope = angles.E[k] @ field.u.T, angles.V[k, :, 1] @ field.u.T
        rest.append(np.stack([s * x, z], axis=1))
        moved.append(np.stack([s * (x + u[0]), z + u[2]], axis=1))
        pressure.append(-_at_all_nodes(field, nodes, field.p @ angles.C[k]))
        # a press has the same stretch on both sides
        repeated = k and solution.model == "axisymmetric"
        stretch.append(stretch[0] if repeated else _largest_stretch(field, nodes, u, slope))
    triangles = np.concatenate([flat, flat[:, ::-1] + count])
    return *(np.concatenate(part) for part in (rest, moved, pressure, stretch)), triangles  # type: ignore[return-value]


def fourier_fields(field: Field, theta: Array) -> angular_fields.Angles:
    """Return the fields of a section at angles (t,)."""
    return angular_fields.fields_at(theta, field.angles.harmonics, sines=field.angles.sines)


def _at_all_nodes(field: Field, nodes: Ints, p: Array) -> Array:
    """Return values at the vertices, linear in each triangle, at all nodes, shape (n,)."""
    values = np.zeros(field.mesh.doflocs.shape[1])
    values[field.vertices] = p
    for middle, first, second in ((3, 0, 1), (4, 1, 2), (5, 0, 2)):
        values[nodes[:, middle]] = (values[nodes[:, first]] + values[nodes[:, second]]) / 2
    return values


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
    a, b = CORNERS.T
    c = 1 - a - b
    zero = np.zeros(6)
    by_a = [1 - 4 * c, 4 * a - 1, zero, 4 * (c - a), 4 * b, -4 * b]
    by_b = [1 - 4 * c, zero, 4 * b - 1, -4 * a, 4 * a, 4 * (c - b)]
    return np.stack([np.stack(by_a, axis=1), np.stack(by_b, axis=1)], axis=2)
