"""The models of a scene: mesh, symmetries and unknowns of each. All lengths are over D.

axisymmetric : press of a body of revolution; (r, z) section.
harmonic : load in the plane y = 0 on a body of revolution; Fourier elements on the section. N = 0 is axisymmetric.
half : load in the plane y = 0; tetrahedra in y >= 0.
full : any load; tetrahedra.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Literal

import numpy as np
import skfem
from numpy.typing import NDArray

from fem.discretisation import elements, rigid_inclusion
from fem.discretisation.elements import Elements
from fem.discretisation.gradient_recovery import Recovery, build_recovery
from fem.discretisation.nonlinear_system import NONE, System
from fem.material import Law, lame, neo_hookean
from geometry.arrays import Array
from geometry.design import Shape
from geometry.loads import Magnet
from geometry.meshing.section_grading import FILLET
from geometry.section import section as section_mesh

Model = Literal["axisymmetric", "harmonic", "half", "full"]


@dataclass(frozen=True)
class Discretisation:
    """A meshed model in units of D and E.

    Attributes
    ----------
    model : name of the model.
    mesh : scikit-fem's second-order mesh.
    system : unknowns and equations.
    symmetry : factor from forces on the modelled part to forces on the whole body (1 or 2).
    shape : the beam's shape over D.
    """

    model: Model
    mesh: skfem.Mesh
    system: System
    symmetry: float
    shape: Shape

    @property
    def elements(self) -> Elements:
        return self.system.elements

    @functools.cached_property
    def centre(self) -> Recovery:
        """Recovery of displacement and gradient at the magnet's centre, for a beam that is all silicone."""
        return build_recovery(self.elements, self.shape.H, mirrored=self.model != "full")

    @property
    def revolved(self) -> bool:
        """Whether the mesh is a section of revolution."""
        return self.elements.dim == 2


def section(
    shape: Shape,
    nu: float,
    magnet: Magnet,
    size: float,
    tip_size: float,
    law: Law = neo_hookean,
    *,
    harmonics: int = 0,
    rim: tuple[float, float] | None = None,
    push: float = 0.0,
    around: int = 0,
    fillet: float = FILLET,
) -> Discretisation:
    """Build the model of a section of revolution with clamped base.

    Parameters
    ----------
    size, tip_size : edge lengths of the mesh and at its tip, over D.
    rim : radius and edge length where the contact area will end, see `geometry.section.section`.
    push : dead force along x, distributed over the dome, over E D^2; requires harmonics.
    around : number of harmonics that the skin's angles must integrate, if larger than `harmonics`.
    fillet : see `geometry.section.section`.
    """
    rigid = magnet == "rigid"
    mesh = _section_mesh(shape, size, tip_size, rim, fillet, "hole" if rigid else "none")
    e = elements.build(mesh, axisymmetric=True, harmonics=harmonics)
    fixed = np.zeros((len(e.nodes), e.angles.fields), dtype=bool)
    fixed[elements.boundary_nodes(mesh, "base")] = True
    fixed[np.ix_(elements.boundary_nodes(mesh, "axis"), ~on_axis(harmonics))] = True
    skin = elements.surface(
        mesh, "skin", e, axisymmetric=True, order=5, angles=4 * max(harmonics, around) + 4 if harmonics else None
    )
    glued = elements.boundary_nodes(mesh, "magnet") if rigid else NONE
    body = rigid_inclusion.section(e.nodes[glued] - [0, shape.H], e.angles) if rigid else None
    dead = distribute_push(skin, fixed.shape, shape.H, push) if push else None
    system = System(e, skin, *lame(1.0, nu), fixed, glued, body, dead, law=law)
    return Discretisation("harmonic" if harmonics else "axisymmetric", mesh, system, 1.0, shape)


def solid(
    shape: Shape,
    nu: float,
    magnet: Magnet,
    size: float,
    tip_size: float,
    law: Law = neo_hookean,
    *,
    half: bool,
    rim: tuple[float, float] | None = None,
    push: float = 0.0,
    mesh: skfem.MeshTet2 | None = None,
) -> Discretisation:
    """Build the model of a solid of tetrahedra with clamped base.

    Parameters
    ----------
    size, tip_size : edge lengths of the mesh and at its tip, over D.
    half : model only y >= 0.
    rim : radius and edge length where the contact area will end, see `geometry.mesh.tetrahedra`.
    push : dead force along x, distributed over the dome, over E D^2.
    mesh : mesh in units of D to use instead of a new one (with a hole for a rigid magnet); sizes and rim are then
        ignored.
    """
    rigid = magnet == "rigid"
    mesh = mesh or _solid_mesh(shape, size, tip_size, rim, half, "hole" if rigid else "none")
    e = elements.build(mesh, axisymmetric=False)
    fixed = np.zeros(e.nodes.shape, dtype=bool)
    fixed[elements.boundary_nodes(mesh, "base")] = True
    if half:
        fixed[elements.boundary_nodes(mesh, "symmetry"), 1] = True
    skin = elements.surface(mesh, "skin", e, axisymmetric=False, order=4)
    glued = elements.boundary_nodes(mesh, "magnet") if rigid else NONE
    body = rigid_inclusion.solid(e.nodes[glued] - [0, 0, shape.H], 3 if half else 6) if rigid else None
    symmetry = 2.0 if half else 1.0
    dead = distribute_push(skin, fixed.shape, shape.H, push / symmetry) if push else None
    system = System(e, skin, *lame(1.0, nu), fixed, glued, body, dead, law=law)
    return Discretisation("half" if half else "full", mesh, system, symmetry, shape)


def distribute_push(skin: elements.Surface, fields: tuple[int, ...], above: float, force: float) -> Array:
    """Return the nodal forces of a uniform dead traction along x on the skin above a height."""
    weights = np.where(skin.points[..., 2] > above, skin.weights, 0.0)
    along = np.einsum("kq,qf,qn->knf", weights * (force / weights.sum()), skin.E[:, 0], skin.shape)
    dead = np.zeros(fields)
    np.add.at(dead, skin.nodes, along)
    return dead


def on_axis(harmonics: int) -> NDArray[np.bool_]:
    """Return which fields of a section may differ from zero on the axis: w_-1, a sideways displacement, and z_0."""
    k = list(elements.orders(harmonics))
    return np.array([order == -1 for order in k] + [n == 0 for n in range(harmonics + 1)])


def raise_harmonics(low: System, high: System, q: Array) -> Array:
    """Return the unknowns q of a section in a system with more harmonics on the same mesh."""
    state, a, b = low.state(q), low.elements.angles.harmonics, high.elements.angles.harmonics
    k, k2 = elements.orders(a), elements.orders(b)
    u = np.zeros(high.fixed.shape)
    u[:, [k2.index(order) for order in k]] = state.u[:, : len(k)]
    u[:, len(k2) : len(k2) + a + 1] = state.u[:, len(k) :]
    p = np.zeros((len(state.p), b + 1))
    p[:, : a + 1] = state.p
    motion = low.motion(q)
    if len(motion) == 1:
        motion = np.array([0.0, motion[0], 0.0])
    return high.unknowns(u, p, motion)


@functools.lru_cache(maxsize=8)
def _section_mesh(
    shape: Shape,
    size: float,
    tip_size: float,
    rim: tuple[float, float] | None,
    fillet: float,
    magnet: Literal["hole", "none"],
) -> skfem.MeshTri2:
    return section_mesh(shape, size, tip_size=tip_size, rim=rim, fillet=fillet, magnet=magnet)


@functools.lru_cache(maxsize=4)
def _solid_mesh(
    shape: Shape,
    size: float,
    tip_size: float,
    rim: tuple[float, float] | None,
    half: bool,
    magnet: Literal["hole", "none"],
) -> skfem.MeshTet2:
    from geometry.mesh import tetrahedra

    return tetrahedra(shape, size, tip_size=tip_size, rim=rim, half=half, magnet=magnet)
