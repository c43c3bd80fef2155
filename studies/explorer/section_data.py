"""The section of a solution along its shear, as points, triangles and fields for the page.

Every triangle of the second-order mesh becomes four flat ones. Along theta = 0 and theta = pi, with s = cos theta = 1
or -1, the amplitudes w_k, z_n and p_n of the Fourier series (`fem.discretisation.elements`) give the displacement

    u_x = sum w_k cos((k + 1) theta),   u_z = sum z_n cos(n theta),   u_y = 0,

and the deformation gradient in the plane and across it,

    F_xx = 1 + s du_x/dr,  F_xz = du_x/dz,  F_zx = s du_z/dr,  F_zz = 1 + du_z/dz,
    F_yy = 1 + s/r sum (k + 1) w_k cos((k + 1) theta),

on the axis with the derivative by r in place of the division. The stretch shown is the largest principal one.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fem.discretisation import elements
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
    """Return the part `section` of a state."""
    parts = _sides(solution) if solution.model in ("axisymmetric", "harmonic") else _cut(solution)
    rest, moved, pressure, stretch, triangles = parts
    load, response = solution.load, solution.response
    c, s = load.direction
    along = c * load.imposed_shear[0] + s * load.imposed_shear[1]
    shift, tilt = c * response.shift[0] + s * response.shift[1], c * response.tilt + s * response.tilt_y
    outline = np.zeros((0, 2))
    if magnet == "rigid":
        outline = magnet_outline(design, shift, response.shift[2], tilt)
    height = design.L - load.depth + design.R * (1 / math.cos(load.plate_tilt) - 1)
    return {
        "points": np.round(moved, DIGITS).tolist(),
        "rest": np.round(rest, DIGITS).tolist(),
        "triangles": triangles.tolist(),
        "fields": {
            "displacement": np.round(np.linalg.norm(moved - rest, axis=1), DIGITS).tolist(),
            "pressure": np.round(pressure, _decimals(pressure)).tolist(),
            "stretch": np.round(stretch, DIGITS).tolist(),
        },
        "magnet": np.round(outline, DIGITS).tolist(),
        "plate": {"z": height, "tilt": math.degrees(load.plate_tilt), "x": along},
        "direction": [c, s],
    }


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
    rest, moved, pressure, stretch = [], [], [], []
    for s in (1.0, -1.0):
        u_x, u_z, hoop, p = amplitudes_at(field, s)
        rest.append(np.stack([s * x, z], axis=1))
        moved.append(np.stack([s * x + u_x, z + u_z], axis=1))
        pressure.append(-_at_all_nodes(field, nodes, p))
        stretch.append(_largest_stretch(field, nodes, s, u_x, u_z, hoop))
    triangles = np.concatenate([flat, flat[:, ::-1] + count])
    return *(np.concatenate(part) for part in (rest, moved, pressure, stretch)), triangles  # type: ignore[return-value]


def amplitudes_at(field: Field, s: float) -> tuple[Array, Array, Array, Array]:
    """Return u_x, u_z and the sum (k + 1) w_k cos((k + 1) theta) at the nodes, mm, and p at the vertices, MPa."""
    N = field.angles.harmonics
    if N == 0:
        u_r, u_z = field.u.T
        # the radial displacement is w_0, of order 1 in the angle
        return s * u_r, u_z, s * u_r, field.p[:, 0]
    order = np.array(elements.orders(N)) + 1
    w, z = field.u[:, : len(order)], field.u[:, len(order) : len(order) + N + 1]
    signs, n = np.where(order % 2, s, 1.0), np.where(np.arange(N + 1) % 2, s, 1.0)
    return w @ signs, z @ n, w @ (order * signs), field.p[:, : N + 1] @ n


def _at_all_nodes(field: Field, nodes: Ints, p: Array) -> Array:
    """Return values at the vertices, linear in each triangle, at all nodes, shape (n,)."""
    values = np.zeros(field.mesh.doflocs.shape[1])
    values[field.vertices] = p
    for middle, first, second in ((3, 0, 1), (4, 1, 2), (5, 0, 2)):
        values[nodes[:, middle]] = (values[nodes[:, first]] + values[nodes[:, second]]) / 2
    return values


def _largest_stretch(field: Field, nodes: Ints, s: float, u_x: Array, u_z: Array, hoop: Array) -> Array:
    """Return the largest principal stretch at the nodes, shape (n,), the mean of all triangles at a node."""
    r = field.mesh.doflocs[0]
    slopes = _shape_slopes()
    # Jacobian of the curved triangle at its own nodes, and the gradients of three functions there
    jacobian = np.einsum("pad,mac->mpcd", slopes, field.mesh.doflocs.T[nodes])
    values = np.stack([u_x, u_z, hoop], axis=1)[nodes]
    gradient = np.einsum("pad,maf->mpfd", slopes, values) @ np.linalg.inv(jacobian)
    xx, xz = 1 + s * gradient[..., 0, 0], gradient[..., 0, 1]
    zx, zz = s * gradient[..., 1, 0], 1 + gradient[..., 1, 1]
    radius = r[nodes]
    inner = radius > 1e-9 * r.max()
    across = 1 + s * np.where(inner, hoop[nodes] / np.where(inner, radius, 1.0), gradient[..., 2, 0])
    # the larger singular value of a 2 x 2 matrix
    half, product = (xx**2 + xz**2 + zx**2 + zz**2) / 2, xx * zz - xz * zx
    plane = np.sqrt(half + np.sqrt(np.maximum(half**2 - product**2, 0.0)))
    each = np.maximum(plane, np.abs(across))
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


def _cut(solution: Solution) -> tuple[Array, Array, Array, Array, Ints]:
    """Return the same of a solution by tetrahedra, cut along its shear; the stretch is not shown there."""
    from studies.output.section_picture import cut_of

    pressure = cut_of(solution, "pressure")
    count = len(pressure.rest)
    numbers = 6 * np.arange(count)[:, None, None] + np.array(FLAT)
    rest, moved = (points[..., [0, 2]].reshape(-1, 2) for points in (pressure.rest, pressure.moved))
    triangles = np.asarray(numbers.reshape(-1, 3), dtype=np.int64)
    return rest, moved, pressure.value.ravel(), np.ones(len(rest)), triangles
