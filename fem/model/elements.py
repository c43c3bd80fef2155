"""Taylor-Hood elements (quadratic displacement, linear continuous pressure) on curved second-order meshes.

One description covers plane strain, sections of revolution with any number of harmonics, and solids. Displacement and
pressure are sums of fields on the mesh times known functions of the angle theta around the axis,

    u_i(X) = sum_f E_if(theta) sum_a N_a u_af,        p(X) = sum_n C_n(theta) sum_c M_c p_cn,

so the displacement gradient at a point is G_iJ = sum_f V_iJf(theta) g_Jf with g_Jf = sum_a D_Ja u_af. A solid or
plane strain has one angle, E_if = delta_if, and D holds the Cartesian derivatives.

The fields of sections of revolution are those of `fem.model.angular_fields`.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import skfem
from numpy.typing import NDArray

from fem.model.angular_fields import Angles, cartesian_fields, fourier_fields, rotations
from geometry.arrays import Array, Ints, Mask, read_only
from geometry.bad_input import MeshError

SAME_PLACE = 1e-9
"""Distance over D up to which two places are one: far above rounding, far below an edge or an increment."""


@dataclass(frozen=True)
class Elements:
    """Finite elements of the silicone.

    Attributes
    ----------
    nodes : (n, dim) coordinates of all displacement nodes, corner nodes first, over D.
    cells : (m, a) nodes of each element, corners first; the pressures belong to the first dim + 1.
    D : (m, q, 3, a) derivatives of the shape functions, see the module docstring.
    weights : (m, q) quadrature weights times the Jacobian (and times r on a section of revolution).
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

    @property
    def dim(self) -> int:
        return int(self.nodes.shape[1])

    @property
    def corners(self) -> Ints:
        return self.cells[:, : self.dim + 1]


@dataclass(frozen=True)
class Surface:
    """Integration points on outer facets, at every angle where there are several.

    nodes : (k, f) nodes of each facet: corners, then the midpoints of its edges (01 or 01, 12, 02).
    shape : (q, f) shape functions of these nodes.
    weights : (k, q) areas, over D^2.
    points : (k, q, 3) reference positions x, y, z, over D.
    E : (q, 3, fields) Cartesian displacement of each field.
    angles : number of angles t; the q points are those of a facet's line, t angles each.
    """

    nodes: Ints
    shape: Array
    weights: Array
    points: Array
    E: Array
    angles: int = 1

    @functools.cached_property
    def spread(self) -> Array:
        """(f fields, q 3) displacements of a facet's points by its nodal fields."""
        f, fields = self.nodes.shape[1], self.E.shape[2]
        return np.asarray(np.einsum("qf,qin->fnqi", self.shape, self.E).reshape(f * fields, -1))

    def displacement(self, u: Array) -> Array:
        """Return the displacements of the points, shape (k, q, 3), for nodal fields (n, fields)."""
        # those of one state are read several times
        last = self.__dict__.get("_last")
        if last is None or last[0] is not u:
            values = u.take(self.nodes, axis=0).reshape(len(self.nodes), len(self.spread))
            last = u, read_only(np.asarray((values @ self.spread).reshape(self.points.shape)))
            if not u.flags.writeable:
                self.__dict__["_last"] = last
        return last[1]

    @functools.cached_property
    def radii(self) -> Array:
        """(k, q) distances of the points from the axis, undeformed."""
        return np.hypot(self.points[..., 0], self.points[..., 1])

    @functools.cached_property
    def reach(self) -> float:
        """Largest distance of the points from the axis, undeformed."""
        return float(self.radii.max())

    @functools.cached_property
    def dome(self) -> Mask:
        """(k, q) mask of the points around the top: within 1.4 times `reach` from the highest point on the axis."""
        return np.asarray(np.hypot(self.radii, self.points[..., 2] - self.points[..., 2].max()) < 1.4 * self.reach)

    @functools.cached_property
    def two_sided(self) -> tuple[bool, bool]:
        """Whether the skin lies on both sides of the planes x = 0 and y = 0."""
        return bool(self.points[..., 0].min() < 0), bool(self.points[..., 1].min() < -SAME_PLACE)

    def stiffness(self, entries: dict[tuple[int, int], NDArray[np.floating]], frame: Array) -> Array:
        """Return the facets' matrices (k, f, fields, f, fields) of springs at the points.

        The integral over the angles comes first, for each point of a facet's line.

        entries : (k, q) stiffness per area between directions i and j, for the (i, j) that are not zero.
        frame : (3, 3) directions as rows.
        """
        (k, f), t, E = self.nodes.shape, self.angles, self.E[: self.angles]
        # most facets of the skin are far from the plate, and have no springs
        touched = np.flatnonzero(sum((C.any(axis=1) for C in entries.values()), np.zeros(k, dtype=bool)))
        N, fields = self.shape[::t], E.shape[2]
        around = np.zeros((len(touched), len(N), fields**2))
        for (i, j), C in entries.items():
            pairs = (frame[i] @ E)[:, :, None] * (frame[j] @ E)[:, None]
            springs = (self.weights[touched] * C[touched]).reshape(-1, t)
            around += (springs @ pairs.reshape(t, -1)).reshape(around.shape)
        along = (N[:, :, None] * N[:, None]).reshape(len(N), -1).T @ around
        matrices = np.zeros((k, f, fields, f, fields))
        matrices[touched] = along.reshape(-1, f, f, fields, fields).transpose(0, 1, 3, 2, 4)
        return matrices

    @functools.cached_property
    def _places(self) -> Ints:
        """Positions of the fields (k, f, fields) of the facets' nodes among those of all nodes."""
        fields = self.E.shape[2]
        return np.asarray(fields * self.nodes[..., None] + np.arange(fields)).ravel()

    def add_up(self, forces: Array, count: int) -> Array:
        """Return the sum (count, fields) at all nodes of forces (k, f, fields) on the nodes of each facet."""
        fields = self.E.shape[2]
        sums = np.bincount(self._places, weights=forces.ravel(), minlength=count * fields)
        return np.asarray(sums, dtype=np.float64).reshape(count, fields)

    def forces(self, traction: Array) -> Array:
        """Return the nodal forces (k, f, fields) of tractions (k, q, 3)."""
        weighted = (self.weights[..., None] * traction).reshape(len(self.nodes), self.spread.shape[1])
        return np.asarray((weighted @ self.spread.T).reshape(*self.nodes.shape, self.E.shape[2]))


_FACET_NODES = {
    2: np.array([[1, 2, 4], [0, 2, 5], [0, 1, 3]]),
    3: np.array([[1, 2, 3, 5, 9, 8], [0, 2, 3, 6, 9, 7], [0, 1, 3, 4, 8, 7], [0, 1, 2, 4, 5, 6]]),
}
"""Local nodes of the facet opposite to each corner. The edges are numbered 01, 12, 02, 03, 13, 23."""


def bases(dim: int) -> tuple[skfem.Element, skfem.Element]:
    return (skfem.ElementTriP2(), skfem.ElementTriP1()) if dim == 2 else (skfem.ElementTetP2(), skfem.ElementTetP1())


@functools.lru_cache
def _facet_functions(dim: int, order: int) -> tuple[Array, Array, Array]:
    """Return weights (q,), shape functions (q, f) and their slopes (q, j, f) for an order of integrals on facets."""
    reference, element = (
        (skfem.MeshLine, skfem.ElementLineP2()) if dim == 2 else (skfem.MeshTri, skfem.ElementTriP2())
    )
    basis = skfem.CellBasis(reference.init_refdom(), element, intorder=order)
    shape, slopes = _functions(basis)
    return read_only((basis.dx[0], shape, slopes[0]))


def _functions(basis: skfem.CellBasis) -> tuple[Array, Array]:
    """Return the shape functions (q, a) of a basis, equal in all its m cells, and their derivatives (m, q, j, a)."""
    shape = np.stack([np.asarray(field).reshape(-1, basis.X.shape[1])[0] for (field,) in basis.basis], axis=-1)
    slopes = np.empty((*basis.dx.shape, basis.X.shape[0], basis.Nbfun))
    for a, (field,) in enumerate(basis.basis):
        slopes[..., a] = field.grad.transpose(1, 2, 0)
    return shape, slopes


def build(
    mesh: skfem.Mesh,
    *,
    axisymmetric: bool,
    harmonics: int = 0,
    sines: bool = False,
    order: int | None = None,
    angles: Angles | None = None,
    points: Array | None = None,
) -> Elements:
    """Build the elements of a second-order mesh: triangles (section of revolution or plane strain) or tetrahedra.

    Parameters
    ----------
    harmonics, sines : number of harmonics of a section of revolution, and whether they include sine orders.
    order : order up to which integrals are exact; default: 4 in triangles (6 points) and 2 in tetrahedra (4 points).
        With order 2 in triangles deep presses find spurious unstable directions and jump between branches.
    angles : fields; default: those of the harmonics, or Cartesian ones.
    points : (dim, q) points of the reference element to evaluate at instead, with equal weights.

    Raises
    ------
    MeshError
        Elements are folded or inverted.
    """
    dim = mesh.p.shape[0]
    order = order or (4 if dim == 2 else 2)
    quadrature = None if points is None else (points, np.ones(points.shape[1]))
    basis = skfem.CellBasis(mesh, bases(dim)[0], intorder=order, quadrature=quadrature)
    shape, grad = _functions(basis)
    # the mesh has the functions and the nodes of the displacements
    cells = mesh.dofs.element_dofs.T
    D = np.zeros((*grad.shape[:2], 3, grad.shape[3]))
    D[:, :, [0, 2] if dim == 2 else [0, 1, 2]] = grad
    determinant = basis.mapping.detDF(basis.X)
    _check_unfolded(mesh, determinant)
    weights = basis.dx
    if axisymmetric:
        radius = mesh.doflocs[0][cells] @ shape.T
        D[:, :, 1] = shape / radius[..., None]
        weights = weights * radius
    return Elements(
        nodes=np.ascontiguousarray(mesh.doflocs.T),
        cells=np.ascontiguousarray(cells).astype(np.int64),
        D=D,
        weights=weights,
        pressure_shape=np.concatenate([1 - basis.X.sum(axis=0, keepdims=True), basis.X]).T,
        shape=shape,
        angles=angles or (fourier_fields(harmonics, sines=sines) if axisymmetric else cartesian_fields(dim)),
    )


def gradient(e: Elements, part: slice, u: Array) -> Array:
    """Return the displacement gradients G, shape (3, 3, m, q t), of nodal fields u (n, fields)."""
    D, V = e.D[part], e.angles.V
    m, q, _, a = D.shape
    t, f = len(V), V.shape[-1]
    g = (D.reshape(m, 3 * q, a) @ u[e.cells[part]]).reshape(m * q, 3, f)
    G = np.empty((3, 3, m * q, t))
    for J in range(3):
        G[:, J] = (g[:, J] @ V[:, :, J].reshape(3 * t, f).T).reshape(m * q, t, 3).transpose(2, 0, 1)
    return G.reshape(3, 3, m, q * t)


def volumes(e: Elements, part: slice = slice(None)) -> Array:
    """Return the weights of the integration points, shape (m, q t)."""
    return np.asarray((e.weights[part][..., None] * e.angles.weights).reshape(len(e.weights[part]), -1))


def _check_unfolded(mesh: skfem.Mesh, determinant: Array) -> None:
    """Refuse elements whose determinants (m, q) have both signs, and neighbours on one side of their common facet."""
    folded = int(np.count_nonzero(~(determinant.min(axis=1) * determinant.max(axis=1) > 0)))
    inner = mesh.f2t[1] >= 0
    facets, pairs = mesh.facets[:, inner].astype(np.int64), mesh.f2t[:, inner]
    first = mesh.p[:, facets[0]]
    opposite = mesh.t.astype(np.int64)[:, pairs].sum(axis=0) - facets.sum(axis=0)
    along = [mesh.p[:, corner] - first for corner in facets[1:]]
    left, right = (
        np.linalg.det(np.stack([*along, mesh.p[:, corner] - first]).transpose(2, 0, 1)) for corner in opposite
    )
    overlapping = int(np.count_nonzero(~(left * right < 0)))
    if folded or overlapping:
        raise MeshError(
            f"the mesh has {folded} folded elements, and {overlapping} pairs of neighbours that overlap: repair it"
        )


def surface(
    mesh: skfem.Mesh, name: str, elements: Elements, *, axisymmetric: bool, order: int, angles: int | None = None
) -> Surface:
    """Return integration points on the named boundary of a mesh.

    order : order up to which integrals over a facet are exact.
    angles : number of angles in (0, pi) on a section of revolution; default: those of the elements.
    """
    dim = elements.dim
    facets = np.asarray(mesh.boundaries[name])
    cell = np.asarray(mesh.f2t)[0, facets]
    corners = np.asarray(mesh.facets)[:, facets].T
    cell_nodes = elements.cells[cell]
    # the one corner of the cell that is not among those of the facet
    opposite = np.argmin((cell_nodes[:, : dim + 1, None] == corners[:, None, :]).any(axis=2), axis=1)
    nodes = np.take_along_axis(cell_nodes, _FACET_NODES[dim][opposite], axis=1)
    w, shape, slopes = _facet_functions(dim, order)
    X = elements.nodes[nodes]
    tangents = np.swapaxes(slopes @ X[:, None], 2, 3)
    normal = tangents[..., 0] if dim == 2 else np.cross(tangents[..., 0], tangents[..., 1])
    weights = np.linalg.norm(normal, axis=-1) * w
    positions = shape @ X
    if dim == 2:
        positions = np.stack([positions[..., 0], np.zeros_like(weights), positions[..., 1]], axis=-1)
    if axisymmetric:
        weights = weights * positions[..., 0]
    around = elements.angles
    if axisymmetric and angles:
        around = fourier_fields(around.harmonics, angles, sines=around.sines)
    return revolve(nodes, shape, weights, positions, around)


def revolve(nodes: Ints, shape: Array, weights: Array, positions: Array, angles: Angles) -> Surface:
    """Return a skin with points at several angles, from weights (k, q) and positions (k, q, 3) in the plane y = 0."""
    turned, t = rotations(angles.theta), len(angles.theta)
    return Surface(
        nodes=nodes,
        shape=np.repeat(shape, t, axis=0),
        weights=(weights[..., None] * angles.weights).reshape(len(nodes), -1),
        points=np.einsum("ijt,kqj->kqti", turned, positions).reshape(len(nodes), -1, 3),
        E=np.tile(np.einsum("ijt,tjf->tif", turned, angles.E), (len(shape), 1, 1)),
        angles=t,
    )


def boundary_nodes(mesh: skfem.Mesh, name: str) -> Ints:
    """Return all displacement nodes on the named boundary, numbered as in `Elements.nodes`."""
    return np.asarray(mesh.dofs.get_facet_dofs(mesh.boundaries[name]).flatten(), dtype=np.int64)
