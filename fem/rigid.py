"""Finite motion of the rigid magnet, and the nodes that follow it.

A node at X moves with the magnet by u = U + (Q - 1) (X - Xc). The unknowns are

- axisymmetric: U_z;
- half model (mirror plane y = 0): U_x, U_z and phi, the rotation about y that carries z towards x,
  Q = [[c, 0, s], [0, 1, 0], [-s, 0, c]].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RigidBody:
    """Nodes glued to the magnet.

    Attributes
    ----------
    arms : (n, dim) positions relative to the magnet's centre.
    """

    arms: Array

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return 1 if self.arms.shape[1] == 2 else 3

    def displacement(self, q: Array) -> Array:
        """Displacements of the nodes, shape (n, dim)."""
        u = np.zeros_like(self.arms)
        if self.size == 1:
            u[:, 1] = q[0]
            return u
        x, z = self.arms[:, 0], self.arms[:, 2]
        s, c1 = np.sin(q[2]), -2 * np.sin(q[2] / 2) ** 2
        u[:, 0] = q[0] + c1 * x + s * z
        u[:, 2] = q[1] - s * x + c1 * z
        return u

    def derivative(self, q: Array) -> Array:
        """du/dq, shape (n, dim, size)."""
        T = np.zeros((*self.arms.shape, self.size))
        if self.size == 1:
            T[:, 1, 0] = 1
            return T
        x, z = self.arms[:, 0], self.arms[:, 2]
        s, c = np.sin(q[2]), np.cos(q[2])
        T[:, 0, 0] = T[:, 2, 1] = 1
        T[:, 0, 2] = -s * x + c * z
        T[:, 2, 2] = -c * x - s * z
        return T

    def curvature(self, q: Array, force: Array) -> Array:
        """Sum of force times d2u/dq2, shape (size, size), for nodal forces (n, dim)."""
        K = np.zeros((self.size, self.size))
        if self.size == 3:
            x, z = self.arms[:, 0], self.arms[:, 2]
            s, c = np.sin(q[2]), np.cos(q[2])
            K[2, 2] = force[:, 0] @ (-c * x - s * z) + force[:, 2] @ (s * x - c * z)
        return K
