"""Fields of the elements: functions of the angle theta around the axis that multiply fields on the mesh.

`fem.model.elements` defines E, V and C. A solid and plane strain have one angle and Cartesian fields.

Sections of revolution are nonlinear Fourier elements (Wilson 1965; the CAXA elements of Abaqus) in complex form. For
loads that are symmetric about the plane y = 0 they have the fields w_k, k = -N .. N, and z_n, p_n, n = 0 .. N:

    u_r + i u_theta = sum_k w_k exp(i k theta),     u_z = sum_n z_n cos n theta,     p = sum_n p_n cos n theta.

In Cartesian components u_x + i u_y = sum w_k exp(i (k+1) theta). N = 0 is the axisymmetric model. With one harmonic
the field k = -2 is added, so that the space contains finite rotations of a rigid magnet. D holds d/dr, 1/r and d/dz;
the components of G are those along r, theta, z. On the axis only w_-1, z_0 and p_0 differ from zero. The integral
over theta is a midpoint rule with 2 N + 1 angles (at least 4) in (0, pi). It is exact for products of four functions
of the space, such as a pressure times the determinant of F. With fewer angles the displacements do not converge.

Loads without a plane of symmetry need the sine orders too. Then w_k is complex, w_k = a_k + i b_k, and u_z and p gain
z'_n sin n theta and p'_n sin n theta, n = 1 .. N. The fields are in the order a_k, b_k, z_n, z'_n. The angles lie in
(0, 2 pi), twice as many: those in (0, pi) and their mirror images. So a load that is symmetric about y = 0 gives the
same answer in both models, and a rotation of the load about z by a multiple of their distance rotates the answer.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, Ints, read_only


@dataclass(frozen=True, slots=True)
class FieldPairs:
    """Pairs of fields f <= g, and the products V_iJf V_kLg of their gradients.

    fields : (2, pairs) fields of each pair.
    groups : pairs in three groups, of fields that carry some components i and k of the displacement: the first of
        them, and products (9, pairs, i, k, t), with J L first.
    """

    fields: Ints
    groups: tuple[tuple[int, int, Array], ...]


@dataclass(frozen=True)
class Angles:
    """Fields, and the functions of the angle that multiply them.

    Attributes
    ----------
    theta, weights : (t,) angles, and their weights in an integral around the axis (1 in a solid).
    harmonics : number N of harmonics.
    sines : whether there are sine orders: fields that are not symmetric about the plane y = 0.
    E : (t, 3, f) displacement components r, theta, z (x, y, z in a solid) of each field.
    V : (t, 3, 3, f) displacement gradient G_iJ of each derivative J of a field.
    C : (t, n) pressure of each pressure field.
    prescribed : fields that are no unknowns anywhere, nor moved by the magnet's unknowns.
    """

    theta: Array
    weights: Array
    harmonics: int
    E: Array
    V: Array
    C: Array
    sines: bool = False
    prescribed: tuple[int, ...] = ()

    @property
    def fields(self) -> int:
        return int(self.E.shape[2])

    @property
    def pressures(self) -> int:
        return int(self.C.shape[1])

    @property
    def of_one_order(self) -> bool:
        """Whether the fields are those of `order_fields`: two angles, for the cosine and the sine."""
        return len(self.theta) == 2

    @functools.cached_property
    def pairs(self) -> FieldPairs:
        """All pairs of fields f <= g that are not prescribed."""
        across = self.fields - self.pressures
        # fields of the displacement across the axis and along it, and the components that they carry
        families = (slice(0, across), slice(0, 2)), (slice(across, self.fields), slice(2, 3))
        groups, fields = [], np.empty((2, 0), dtype=np.int64)
        for (f, i), (g, k) in itertools.combinations_with_replacement(families, 2):
            pairs = np.indices((self.fields, self.fields))[:, f, g].reshape(2, -1)
            unknown = ~np.isin(pairs, self.prescribed).any(axis=0)
            first, second = pairs[:, unknown & (pairs[0] <= pairs[1])]
            V_f, V_g = self.V[:, i][..., first], self.V[:, k][..., second]
            products = np.ascontiguousarray(np.einsum("tiJs,tkLs->JLsikt", V_f, V_g))
            groups.append((i.start, k.start, products.reshape(9, *products.shape[2:])))
            fields = np.append(fields, [first, second], axis=1)
        return read_only(FieldPairs(fields, tuple(groups)))


def orders(harmonics: int) -> range:
    """Return the orders k of the in-plane fields w_k."""
    return range(-2 if harmonics == 1 else -harmonics, harmonics + 1)


@functools.lru_cache(maxsize=32)
def fourier_fields(harmonics: int, count: int | None = None, *, sines: bool = False) -> Angles:
    """Return the fields of a section of revolution.

    count : number of angles in (0, pi); default: 2 N + 1, at least 4, and 1 for N = 0.
    sines : add the sine orders, with as many angles again in (pi, 2 pi).
    """
    t = count or (1 if harmonics == 0 else max(2 * harmonics + 1, 4))
    theta = np.zeros(1) if t == 1 else (np.arange(2 * t if sines else t) + 0.5) * np.pi / t
    return read_only(fields_at(theta, harmonics, sines=sines))


def fields_at(theta: Array, harmonics: int, *, sines: bool = False) -> Angles:
    """Return the fields of a section of revolution at equally weighted angles (t,)."""
    k, n = np.array(orders(harmonics)), np.arange(harmonics + 1)
    E, V, C = _field_functions(theta, k, n, sines=sines)
    return Angles(theta, np.full(len(theta), 2 * np.pi / len(theta)), harmonics, E, V, C, sines)


def order_fields(order: int) -> Angles:
    """Return the fields w_0, w_n, w_-n, z_0, z_n and p_0, p_n of one order n >= 1, see `single_order`."""
    theta = np.array([0, np.pi / (2 * order)])
    E, V, C = _field_functions(theta, np.array([0, order, -order]), np.array([0, order]))
    return Angles(theta, np.full(2, np.pi), order, E, V, C, prescribed=(0, 3))


def _field_functions(theta: Array, k: Ints, n: Ints, *, sines: bool = False) -> tuple[Array, Array, Array]:
    """Return E, V and C of `Angles` for the fields w_k, z_n and p_n."""
    ck, sk = np.cos(np.outer(theta, k)), np.sin(np.outer(theta, k))
    cn, sn = np.cos(np.outer(theta, n)), np.sin(np.outer(theta, n))
    # u_r, u_theta, u_z of the fields, and what their derivatives by theta add along r, theta, z
    E, along = _components(ck, sk, cn), _components(-(k + 1) * sk, (k + 1) * ck, -n * sn)
    if sines:
        # i w_k exp(i k theta) has u_r = -sin k theta and u_theta = cos k theta; the sine of order 0 is zero
        C, N = np.concatenate([cn, sn[:, 1:]], axis=1), n[1:]
        E = _joined(E, _components(-sk, ck, sn[:, 1:]), len(k))
        along = _joined(along, _components(-(k + 1) * ck, -(k + 1) * sk, N * cn[:, 1:]), len(k))
    else:
        C = cn
    return E, np.stack([E, along, E], axis=2), C


def _components(radial: Array, around: Array, axial: Array) -> Array:
    """Return functions of the angle (t, 3, f): fields of u_r and u_theta (t, k), then fields of u_z (t, n)."""
    k = radial.shape[1]
    fields = np.zeros((len(radial), 3, k + axial.shape[1]))
    fields[:, 0, :k], fields[:, 1, :k], fields[:, 2, k:] = radial, around, axial
    return fields


def _joined(even: Array, odd: Array, k: int) -> Array:
    """Return the fields of both kinds, all of u_r and u_theta (k of each kind) before those of u_z."""
    return np.concatenate([even[..., :k], odd[..., :k], even[..., k:], odd[..., k:]], axis=-1)


def rotations(theta: Array) -> Array:
    """Return the rotations (3, 3, t) about z that carry r, theta, z components at the angles (t,) to x, y, z."""
    c, s, zero = np.cos(theta), np.sin(theta), np.zeros_like(theta)
    return np.stack([np.stack([c, -s, zero]), np.stack([s, c, zero]), np.stack([zero, zero, zero + 1])])


def torsion_fields() -> Angles:
    """Return the fields u_r, u_theta, u_z, independent of the angle: the axisymmetric model with torsion."""
    E = np.eye(3)[None]
    V = np.repeat(E[:, :, None, :], 3, axis=2)
    V[:, :, 1] = 0
    V[0, 1, 1, 0], V[0, 0, 1, 1] = 1, -1
    return Angles(np.zeros(1), np.full(1, 2 * np.pi), 0, E, V, np.ones((1, 1)))


def cartesian_fields(dim: int) -> Angles:
    """Return the fields of a solid, or of plane strain in x and z."""
    E = np.eye(3)[None] if dim == 3 else np.eye(3)[None, :, [0, 2]]
    return Angles(np.zeros(1), np.ones(1), 0, E, np.repeat(E[:, :, None, :], 3, axis=2), np.ones((1, 1)))
