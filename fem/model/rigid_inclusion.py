"""Finite motion of the rigid magnet, and of the nodes on its surface.

A node at X moves with the magnet by u = U + (Q - 1) (X - Xc), written as sum_j phi_j(q) B_j with constant fields B_j
and functions phi_j of the few unknowns q:

- axial: q = U_z; with torsion also the angle about z, which moves X by u_r = r (cos q2 - 1), u_theta = r sin q2;
- sideways: q = U_x and the rotation about y, about an axisymmetric state with a given U_z (`single_order`);
- planar (mirror plane y = 0; solids and cosine orders): q = U_x, U_z and the rotation about y that carries z towards
  x, Q = [[c, 0, s], [0, 1, 0], [-s, 0, c]];
- spatial (solids and sine orders): q = U_x, U_y, U_z and three angles, Q = Qy(q3) Qx(q4) Qz(q5), where a positive q4
  carries z towards -y.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem.model.angular_fields import Angles, rotations
from geometry.arrays import Array, read_only

ONE, ZERO = read_only(np.ones((1, 1))), read_only(np.zeros((1, 1, 1)))


@dataclass(frozen=True, slots=True)
class RigidBody:
    """Motion of the nodes on the magnet's surface.

    fields : (j, n, fields) the constant fields B_j.
    components : which of U_x, U_y, U_z and the angles about y, x and z the unknowns are, numbered from 0.
    """

    fields: Array
    components: tuple[int, ...]

    @property
    def size(self) -> int:
        return len(self.components)

    def displacement(self, q: Array) -> Array:
        """Return the fields at the nodes, shape (n, fields)."""
        fields = self.fields
        # the product that tensordot takes several times as long to find
        return np.asarray((_functions(q)[0] @ fields.reshape(len(fields), -1)).reshape(fields.shape[1:]))

    def derivative(self, q: Array) -> Array:
        """Return du/dq, shape (n, fields, size)."""
        fields = self.fields
        return np.asarray(
            (fields.reshape(len(fields), -1).T @ _functions(q)[1]).reshape(*fields.shape[1:], self.size)
        )

    def curvature(self, q: Array, force: Array) -> Array:
        """Return the sum of force times d2u/dq2, shape (size, size), for nodal forces (n, fields)."""
        if not force.any():  # as at rest
            return np.zeros((self.size, self.size))
        of_fields = self.fields.reshape(len(self.fields), -1) @ force.ravel()
        return np.asarray((of_fields @ _functions(q)[2].reshape(len(of_fields), -1)).reshape(self.size, self.size))


def of_solid(arms: Array, size: int) -> RigidBody:
    """Return the motion of a solid's nodes at positions (n, 3) from the magnet's centre; planar (3) or spatial
    (6)."""
    shifts = np.broadcast_to(np.eye(3)[:, None], (3, len(arms), 3))
    if size == 3:
        x, z = arms[:, 0, None], arms[:, 2, None]
        ex, ez = np.eye(3)[[0, 2]]
        return RigidBody(np.stack([shifts[0], shifts[2], z * ex - x * ez, x * ex + z * ez]), (0, 2, 3))
    turned = np.zeros((3, 3, len(arms), 3))
    for i in range(3):
        for J in range(3):
            turned[i, J, :, i] = arms[:, J]
    return RigidBody(np.concatenate([shifts, turned.reshape(9, len(arms), 3)]), tuple(range(6)))


def of_section(arms: Array, angles: Angles) -> RigidBody:
    """Return the motion of a section's nodes at (r, z) (n, 2) from the magnet's centre; axial without harmonics.

    With harmonics the space of the fields contains the motion of a solid, whose fields follow from its displacements
    at all angles.
    """
    r, z = arms.T
    if angles.harmonics == 0:
        B = np.zeros((3 if angles.fields == 3 else 1, len(arms), angles.fields))
        B[0, :, -1] = 1
        if angles.fields == 3:
            B[1, :, 1], B[2, :, 0] = r, r
        return RigidBody(B, (2, 5)[: angles.fields - 1])
    c, s, t = np.cos(angles.theta), np.sin(angles.theta), len(angles.theta)
    around = np.stack(np.broadcast_arrays(r[:, None] * c, r[:, None] * s, z[:, None]), axis=-1)
    body = of_solid(around.reshape(-1, 3), 6 if angles.sines else 3)
    displaced = np.einsum("ijt,tjf->tif", rotations(angles.theta), angles.E).reshape(3 * t, -1)
    fields = body.fields.reshape(len(body.fields), len(arms), 3 * t) @ np.linalg.pinv(displaced).T
    return RigidBody(fields, body.components)


def sideways(arms: Array, angles: Angles) -> RigidBody:
    """Return the motion of a section's nodes in a model of order 1, see `angular_fields.order_fields`."""
    r, z = arms.T
    B = np.zeros((3, len(arms), angles.fields))
    B[0, :, 2] = 1
    B[1, :, 2], B[1, :, 4] = z, -r
    B[2, :, 0], B[2, :, 3] = r / 2, z
    return RigidBody(B, (0, 3))


def _functions(q: Array) -> tuple[Array, Array, Array]:
    """Return phi (j,) and its first (j, size) and second derivatives (j, size, size)."""
    n = len(q)
    if n == 1:
        return q, ONE, ZERO
    if n < 6:  # translations, then one rotation
        s, c = np.sin(q[-1]), np.cos(q[-1])
        first, second = np.zeros((n + 1, n)), np.zeros((n + 1, n, n))
        first[: n - 1, : n - 1] = np.eye(n - 1)
        first[-2:, -1], second[-2:, -1, -1] = (c, -s), (-s, -c)
        # cos q - 1 = -2 sin^2(q / 2) keeps its digits at small angles
        return np.array([*q[:-1], s, -2 * np.sin(q[-1] / 2) ** 2]), first, second
    turns = [_rotation(angle, axis) for angle, axis in zip(q[3:], (1, 0, 2), strict=True)]

    def product(*orders: int) -> Array:
        a, b, c = (turn[order] for turn, order in zip(turns, orders, strict=True))
        return np.asarray(a @ b @ c).ravel()

    first, second = np.zeros((12, 6)), np.zeros((12, 6, 6))
    first[:3, :3] = np.eye(3)
    unit = np.eye(3, dtype=int)
    for i in range(3):
        first[3:, 3 + i] = product(*unit[i])
        for j in range(3):
            second[3:, 3 + i, 3 + j] = product(*(unit[i] + unit[j]))
    return np.concatenate([q[:3], product(0, 0, 0) - np.eye(3).ravel()]), first, second


def _rotation(angle: float, axis: int) -> tuple[Array, Array, Array]:
    """Return the rotation matrix about a coordinate axis, and its first and second derivative by the angle."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrices = []
    for c, s, along in (
        (np.cos(angle), np.sin(angle), 1.0),
        (-np.sin(angle), np.cos(angle), 0.0),
        (-np.cos(angle), -np.sin(angle), 0.0),
    ):
        Q = np.zeros((3, 3))
        Q[axis, axis], Q[i, i], Q[j, j], Q[i, j], Q[j, i] = along, c, c, -s, s
        matrices.append(Q)
    return matrices[0], matrices[1], matrices[2]


def axis(q: Array) -> Array:
    """Return the direction (3,) of the magnet's axis after the motion q."""
    if len(q) == 1:
        return np.array([0.0, 0.0, 1.0])
    if len(q) == 3:
        return np.array([np.sin(q[2]), 0.0, np.cos(q[2])])
    return np.asarray(_rotation(q[3], 1)[0] @ _rotation(q[4], 0)[0] @ np.array([0.0, 0.0, 1.0]))
