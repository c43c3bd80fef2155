"""Taylor-Hood elements (quadratic displacement, linear continuous pressure) on curved second-order meshes.

One description serves plane strain, sections of revolution with any number of harmonics, and solids. Displacement
and pressure are sums of fields on the mesh times known functions of the angle theta around the axis,

    u_i(X) = sum_f E_if(theta) sum_a N_a u_af,        p(X) = sum_n C_n(theta) sum_c M_c p_cn,

so that the displacement gradient at a point is G_iJ = sum_f V_iJf(theta) g_Jf with g_Jf = sum_a D_Ja u_af. In a solid
and in plane strain there is one angle, E_if = delta_if and D holds the Cartesian derivatives.

Sections of revolution (nonlinear Fourier elements, Wilson 1965 and the CAXA elements of Abaqus, in a complex form):
fields w_k, k = -N .. N, and z_n, p_n, n = 0 .. N, for loads that are symmetric about the plane y = 0,

    u_r + i u_theta = sum_k w_k exp(i k theta),     u_z = sum_n z_n cos n theta,     p = sum_n p_n cos n theta.

In Cartesian components u_x + i u_y = sum w_k exp(i (k+1) theta). N = 0 is the axisymmetric model. With one harmonic
k = -2 is added, so that finite rotations of a rigid magnet are in the space. D holds d/dr, 1/r and d/dz; components
of G are those along r, theta, z. On the axis only w_-1, z_0 and p_0 differ from zero. The integral over theta is a
midpoint rule with 2 N + 1 angles (4 at least) in (0, pi), which is exact for products of four functions of the space,
as of a pressure with the determinant of F: with fewer angles displacements stop converging.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass

import numpy as np
import skfem
from numpy.typing import NDArray
from skfem.assembly.dofs import Dofs
from skfem.quadrature import get_quadrature

from geometry.arrays import Array, Ints

Family = tuple[slice, slice]
"""A range of fields, and that of the components of the displacement which they alone carry."""


@dataclass(frozen=True, slots=True)
class Pairs:
    """Pairs of fields of two families.

    Attributes
    ----------
    first, second : (s,) fields f and g.
    i, k : components of the displacement that they carry.
    products : (3, 3, i k t, s) products V_iJf V_kLg, J and L first.
    """

    first: Ints
    second: Ints
    i: slice
    k: slice
    products: Array


@dataclass(frozen=True)
class Angles:
    """Fields and the functions of the angle that multiply them.

    Attributes
    ----------
    theta, weights : (t,) angles, and what they stand for in an integral around the axis (1 in a solid).
    harmonics : number N of harmonics.
    E : (t, 3, f) displacement, components along r, theta, z (x, y, z in a solid) per field.
    V : (t, 3, 3, f) displacement gradient G_iJ per derivative J of a field.
    C : (t, n) pressure per field.
    components : positions of the G_iJ that can differ from zero, where they are few and at one angle, or None.
    """

    theta: Array
    weights: Array
    harmonics: int
    E: Array
    V: Array
    C: Array
    components: tuple[int, ...] | None = None

    @property
    def fields(self) -> int:
        return int(self.E.shape[2])

    @property
    def pressures(self) -> int:
        return int(self.C.shape[1])

    @functools.cached_property
    def pairs(self) -> list[Pairs]:
        """All fields f <= g, those of two families after those of others."""
        found = []
        for (f, i), (g, k) in itertools.combinations_with_replacement(self._families, 2):
            first, second = np.meshgrid(np.arange(self.fields)[f], np.arange(self.fields)[g], indexing="ij")
            once = first <= second
            first, second = first[once], second[once]
            product = np.einsum("tiJs,tkLs->JLikts", self.V[:, i][..., first], self.V[:, k][..., second])
            found.append(Pairs(first, second, i, k, product.reshape(3, 3, -1, len(first))))
        return found

    @property
    def _families(self) -> list[Family]:
        """Fields in the plane of the section's turn and those along its axis, or all where they are few."""
        if self.harmonics == 0:
            return [(slice(0, self.fields), slice(0, 3))]
        n = self.fields - self.pressures
        return [(slice(0, n), slice(0, 2)), (slice(n, self.fields), slice(2, 3))]


@dataclass(frozen=True)
class Elements:
    """Silicone as elements.

    Attributes
    ----------
    nodes : (n, dim) coordinates of all displacement nodes, corner nodes first.
    cells : (m, a) nodes of each element, corners first; pressures live on the first dim + 1.
    D : (m, q, 3, a) derivatives of the shape functions, see the module.
    weights : (m, q) quadrature weights times the Jacobian (and r).
    pressure_shape, shape : (q, dim + 1) and (q, a) shape functions of pressure and displacement.
    angles : fields and their functions of the angle.
    """

    nodes: Array
    cells: Ints
    D: Array
    weights: Array
    pressure_shape: Array
    shape: Array
    angles: Angles

    @functools.cached_property
    def components(self) -> Ints:
        """Positions (c,) of the G_iJ that can differ from zero."""
        return np.array(self.angles.components or range(9))

    @functools.cached_property
    def places(self) -> Ints:
        """Where the nodal fields of each element, fields first, are among all (n, fields) in a row: (m, f a)."""
        f = self.angles.fields
        return np.asarray((np.arange(f)[:, None] + f * self.cells[:, None]).reshape(len(self.cells), -1))

    @functools.cached_property
    def B(self) -> Array | None:
        """Where few components of G differ from zero: these per nodal field (fields first), (m, q, c, f a)."""
        if self.angles.components is None:
            return None
        rows, along = np.divmod(self.components, 3)
        m, q = self.weights.shape
        B = self.angles.V[0, rows, along][:, :, None] * self.D[:, :, along, None, :]
        return np.asarray(B.reshape(m, q, len(rows), -1))

    @functools.cached_property
    def D_products(self) -> Array:
        """Products D_Ja D_Lb of a section's elements, shape (m, q 3 3, a a)."""
        m, q, _, a = self.D.shape
        return np.asarray((self.D[:, :, :, None, :, None] * self.D[:, :, None, :, None, :]).reshape(m, 9 * q, a * a))

    @property
    def dim(self) -> int:
        return int(self.nodes.shape[1])

    @property
    def corners(self) -> Ints:
        return self.cells[:, : self.dim + 1]


@dataclass(frozen=True)
class Surface:
    """Integration points on outer facets, at every angle where there are several.

    Attributes
    ----------
    nodes : (k, f) the nodes of each facet: corners, then the middles of its edges (01 or 01, 12, 02).
    shape : (q, f) their shape functions.
    weights : (k, q) areas.
    points : (k, q, 3) reference positions x, y, z.
    E : (q, 3, fields) Cartesian displacement per field.
    """

    nodes: Ints
    shape: Array
    weights: Array
    points: Array
    E: Array

    @functools.cached_property
    def spread(self) -> Array:
        """Displacements of a facet's points by its nodal fields, shape (f fields, q 3)."""
        f, fields = self.nodes.shape[1], self.E.shape[2]
        return np.asarray(np.einsum("qf,qin->fnqi", self.shape, self.E).reshape(f * fields, -1))

    def displacement(self, u: Array) -> Array:
        """Displacements (k, q, 3) of nodal fields (n, fields)."""
        return np.asarray((u[self.nodes].reshape(len(self.nodes), -1) @ self.spread).reshape(self.points.shape))

    def stiffness(self, entries: dict[tuple[int, int], NDArray[np.floating]], frame: Array) -> Array:
        """Matrices (k, fields f, fields f), fields first, of springs at the points.

        Parameters
        ----------
        entries : (k, q) stiffness per area between directions i and j, for those (i, j) that are not zero.
        frame : (3, 3) the directions, as rows.
        """
        k, f = self.nodes.shape
        along = np.swapaxes(self.spread.reshape(f, -1, self.spread.shape[1]), 0, 1).reshape(-1, len(self.shape), 3)
        along = along @ frame.T
        found, n = np.zeros((k, len(along), len(along))), len(along)
        for (i, j), C in entries.items():
            touched = np.flatnonzero(C.any(axis=1))
            pairs = along[:, None, :, i] * along[:, :, j]
            found[touched] += ((self.weights[touched] * C[touched]) @ pairs.reshape(n * n, -1).T).reshape(-1, n, n)
        return found

    def forces(self, traction: Array) -> Array:
        """Nodal forces (k, f, fields) of tractions (k, q, 3)."""
        weighted = (self.weights[..., None] * traction).reshape(len(self.nodes), -1)
        return np.asarray((weighted @ self.spread.T).reshape(*self.nodes.shape, -1))


_FACET_NODES = {
    2: np.array([[1, 2, 4], [0, 2, 5], [0, 1, 3]]),
    3: np.array([[1, 2, 3, 5, 9, 8], [0, 2, 3, 6, 9, 7], [0, 1, 3, 4, 8, 7], [0, 1, 2, 4, 5, 6]]),
}
"""Local nodes of the facet opposite to each corner; edges are numbered 01, 12, 02 and 03, 13, 23."""


def orders(harmonics: int) -> range:
    """The orders k of the in-plane fields w_k."""
    return range(-2 if harmonics == 1 else -harmonics, harmonics + 1)


def fourier_fields(harmonics: int, count: int | None = None) -> Angles:
    """Fields of a section of revolution, at `count` angles (if not told 2 N + 1, at least 4; one for N = 0)."""
    t = count or (1 if harmonics == 0 else max(2 * harmonics + 1, 4))
    theta = np.zeros(1) if t == 1 else (np.arange(t) + 0.5) * np.pi / t
    k, n = np.array(orders(harmonics)), np.arange(harmonics + 1)
    E = np.zeros((t, 3, len(k) + len(n)))
    V = np.zeros((t, 3, 3, len(k) + len(n)))
    ck, sk = np.cos(np.outer(theta, k)), np.sin(np.outer(theta, k))
    cn, sn = np.cos(np.outer(theta, n)), np.sin(np.outer(theta, n))
    E[:, 0, : len(k)], E[:, 1, : len(k)], E[:, 2, len(k) :] = ck, sk, cn
    V[:, :, 0], V[:, :, 2] = E, E
    V[:, 0, 1, : len(k)], V[:, 1, 1, : len(k)] = -(k + 1) * sk, (k + 1) * ck
    V[:, 2, 1, len(k) :] = -n * sn
    few = (0, 2, 4, 6, 8) if t == 1 else None
    return Angles(theta, np.full(t, 2 * np.pi / t), harmonics, E, V, cn, few)


def rotations(theta: Array) -> Array:
    """Rotations (3, 3, t) about z that carry components along r, theta, z at the angles (t,) to x, y, z."""
    c, s, zero = np.cos(theta), np.sin(theta), np.zeros_like(theta)
    return np.stack([np.stack([c, -s, zero]), np.stack([s, c, zero]), np.stack([zero, zero, zero + 1])])


def torsion_fields() -> Angles:
    """Fields u_r, u_theta, u_z that do not depend on the angle: the axisymmetric model with torsion."""
    E = np.eye(3)[None]
    V = np.repeat(E[:, :, None, :], 3, axis=2)
    V[:, :, 1] = 0
    V[0, 1, 1, 0], V[0, 0, 1, 1] = 1, -1
    return Angles(np.zeros(1), np.full(1, 2 * np.pi), 0, E, V, np.ones((1, 1)))


def cartesian_fields(dim: int) -> Angles:
    """Fields of a solid, or of plane strain in x and z."""
    E = np.eye(3)[None] if dim == 3 else np.eye(3)[None, :, [0, 2]]
    one = np.ones(1)
    few = (0, 2, 6, 8) if dim == 2 else None
    return Angles(np.zeros(1), one, 0, E, np.repeat(E[:, :, None, :], 3, axis=2), one[:, None], few)


def bases(dim: int) -> tuple[skfem.Element, skfem.Element]:
    return (skfem.ElementTriP2(), skfem.ElementTriP1()) if dim == 2 else (skfem.ElementTetP2(), skfem.ElementTetP1())


def build(
    mesh: skfem.Mesh,
    *,
    axisymmetric: bool,
    harmonics: int = 0,
    order: int | None = None,
    angles: Angles | None = None,
    points: Array | None = None,
) -> Elements:
    """Elements of a second-order triangle mesh (section of revolution or plane strain) or tetrahedral mesh.

    Integrals are exact to an order, 4 in triangles (6 points) and 2 in tetrahedra (4 points) if not told. Order 2 in
    triangles finds unstable directions that are none of the body's: deep presses jump between them. Instead, `points`
    of the reference element, shape (dim, q), may be given, which then count alike.
    """
    dim = mesh.p.shape[0]
    order = order or (4 if dim == 2 else 2)
    quadratic, linear = bases(dim)
    X, W = get_quadrature(quadratic, order) if points is None else (points, np.full(points.shape[1], 1.0))
    mapping, dofs = mesh.mapping(), Dofs(mesh, quadratic)
    values, slopes = zip(*(quadratic.lbasis(X, i) for i in range(len(dofs.element_dofs))), strict=True)
    inverse = mapping.invDF(X)
    grad = np.stack([np.einsum("ijkl,il->jkl", inverse, slope) for slope in slopes], axis=-1)  # (dim, m, q, a)
    _, m, q, a = grad.shape
    D = np.zeros((m, q, 3, a))
    D[:, :, [0, 2] if dim == 2 else [0, 1, 2]] = np.moveaxis(grad, 0, 2)
    weights = np.abs(mapping.detDF(X)) * W
    shape = np.stack(values, axis=-1)
    if axisymmetric:
        radius = mapping.F(X)[0]
        D[:, :, 1] = shape / radius[..., None]
        weights = weights * radius
    nodes = np.empty((dofs.N, dim))
    nodes[dofs.element_dofs] = mapping.F(quadratic.doflocs.T).T
    return Elements(
        nodes=nodes,
        cells=np.ascontiguousarray(dofs.element_dofs.T).astype(np.int64),
        D=D,
        weights=weights,
        pressure_shape=np.stack([linear.lbasis(X, i)[0] for i in range(dim + 1)], axis=-1),
        shape=shape,
        angles=angles or (fourier_fields(harmonics) if axisymmetric else cartesian_fields(dim)),
    )


def surface(
    mesh: skfem.Mesh, name: str, elements: Elements, *, axisymmetric: bool, order: int, angles: int | None = None
) -> Surface:
    """Integration points on the named boundary of a mesh; on a section of revolution at so many angles."""
    dim = elements.dim
    facets = np.asarray(mesh.boundaries[name])
    cell = np.asarray(mesh.f2t)[0, facets]
    corners = np.asarray(mesh.facets)[:, facets].T
    own = elements.cells[cell]
    opposite = np.argmin((own[:, : dim + 1, None] == corners[:, None, :]).any(axis=2), axis=1)
    nodes = np.take_along_axis(own, _FACET_NODES[dim][opposite], axis=1)
    reference, w = get_quadrature(skfem.refdom.RefLine if dim == 2 else skfem.refdom.RefTri, order)
    quadratic = skfem.ElementLineP2() if dim == 2 else skfem.ElementTriP2()
    basis = [quadratic.lbasis(reference, i) for i in range(nodes.shape[1])]
    shape = np.stack([np.ravel(value) for value, _ in basis], axis=1)
    slope = np.stack([np.reshape(grad, (dim - 1, -1)).T for _, grad in basis], axis=1)  # (q, f, dim - 1)
    X = elements.nodes[nodes]
    tangents = np.einsum("qfs,kfi->kqis", slope, X)
    normal = tangents[..., 0] if dim == 2 else np.cross(tangents[..., 0], tangents[..., 1])
    weights = np.linalg.norm(normal, axis=-1) * w
    located = shape @ X
    a = fourier_fields(elements.angles.harmonics, angles) if axisymmetric and angles else elements.angles
    turned = rotations(a.theta)
    t = len(a.theta)
    if dim == 2:
        located = np.stack([located[..., 0], np.zeros_like(weights), located[..., 1]], axis=-1)
    if axisymmetric:
        weights = weights * located[..., 0]
    points = np.einsum("ijt,kqj->kqti", turned, located).reshape(len(nodes), -1, 3)
    return Surface(
        nodes=nodes,
        shape=np.repeat(shape, t, axis=0),
        weights=(weights[..., None] * a.weights).reshape(len(nodes), -1),
        points=points,
        E=np.tile(np.einsum("ijt,tjf->tif", turned, a.E), (len(shape), 1, 1)),
    )


def boundary_nodes(mesh: skfem.Mesh, name: str) -> Ints:
    """All displacement nodes (corners and mid-edges) on the named boundary, numbered as in `Elements.nodes`."""
    quadratic, _ = bases(mesh.p.shape[0])
    return np.asarray(Dofs(mesh, quadratic).get_facet_dofs(mesh.boundaries[name]).flatten(), dtype=np.int64)
