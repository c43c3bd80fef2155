"""The models of a scene: mesh, symmetries and unknowns of each. All lengths are over D.

axisymmetric : press of a body of revolution; (r, z) section.
harmonic : any load on a body of revolution; Fourier elements on the section. N = 0 is axisymmetric. A load in the
    plane y = 0 needs cosine orders only, any other load sine orders too.
half : load in the plane y = 0; tetrahedra in y >= 0.
full : any load; tetrahedra.
"""

from __future__ import annotations

import functools
import math
import threading
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import skfem

from fem.model import angular_fields, elements
from fem.model.elements import Elements, Surface
from fem.model.gradient_recovery import Recovery, build_recovery
from fem.model.material import Law, neo_hookean
from fem.model.nonlinear_system import System
from fem.model.rigid_inclusion import of_section, of_solid
from fem.scene import Scene
from geometry.arrays import Array, Mask, read_only
from geometry.design import Shape
from geometry.loads import Magnet
from geometry.relaxation import lame
from geometry.section import FILLET, section

Model = Literal["axisymmetric", "harmonic", "half", "full"]


@functools.lru_cache(maxsize=8)
def _section_mesh(shape: Shape, size: float, **settings: Any) -> skfem.MeshTri2:
    return read_only(section(shape, size, **settings))


@functools.lru_cache(maxsize=4)
def _solid_mesh(shape: Shape, size: float, **settings: Any) -> skfem.MeshTet2:
    from geometry.mesh import tetrahedra

    return read_only(tetrahedra(shape, size, **settings))


@dataclass(frozen=True, eq=False)
class Discretisation:
    """A meshed model in units of D and E. What was built from it is kept with it, so two are never equal.

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
        return build_recovery(self.elements, self.shape.H, mirrored=self.mirrored)

    @functools.cached_property
    def folding_points(self) -> Elements:
        """The elements at a grid of points, in which silicone that is inverted between their points is searched for.

        Inversion begins at corners, but a corner on the axis has no 1 / r: the grid stays slightly inside.
        """
        dim = self.elements.dim
        n = 6 // (dim - 1)  # grid steps along the side of a triangle, half as many for a tetrahedron
        grid = np.indices((n + 1,) * dim).reshape(dim, -1)
        points = 1 / (dim + 1) + (1 - 1e-6) * (grid[:, grid.sum(axis=0) <= n] / n - 1 / (dim + 1))
        return elements.build(self.mesh, axisymmetric=self.revolved, angles=self.elements.angles, points=points)

    @property
    def mirrored(self) -> bool:
        """Whether the states are symmetric about the plane y = 0."""
        return self.model != "full" and not self.elements.angles.sines

    @property
    def revolved(self) -> bool:
        """Whether the mesh is a section of revolution."""
        return self.elements.dim == 2


@dataclass(frozen=True, slots=True)
class MeshSpecification:
    """A section of revolution or a solid of tetrahedra with clamped base, its material and its loads.

    Callers vary its fields and then build the model. Lengths are over D.

    Attributes
    ----------
    shape, nu, magnet : shape of the beam, Poisson's ratio, and "rigid" or "ignored".
    size, tip_size : edge lengths of the mesh, and at its tip.
    law : law of the silicone, with stresses over E.
    body : "section", or tetrahedra of "half" the solid (y >= 0) or of the "full" solid.
    fillet : edge length at the magnet's fillet over the fillet's radius, on a section.
    rim : undeformed radius at which the contact area will end, and edge length there; None for no refinement.
    glued : whether the area inside the rim will be glued, see `geometry.section.section`; that of a solid always is.
    push : dead force along x, distributed over the dome, over E D^2; a section requires harmonics.
    harmonics : number of harmonics on a section; 0 is axisymmetric.
    skin_harmonics : number of harmonics that the skin's angles must integrate, if larger than `harmonics`.
    sines : whether the harmonics include sine orders, for a load without a plane of symmetry.
    mesh : tetrahedral mesh in units of D to use instead of a new one (with a hole for a rigid magnet); sizes and rim
        are then ignored.
    coarseness : factor on every edge length of a section.
    """

    shape: Shape
    nu: float
    magnet: Magnet
    size: float
    tip_size: float
    law: Law = neo_hookean
    body: Literal["section", "half", "full"] = "section"
    fillet: float = FILLET
    rim: tuple[float, float] | None = None
    glued: bool = False
    push: float = 0.0
    harmonics: int = 0
    skin_harmonics: int = 0
    sines: bool = False
    mesh: skfem.MeshTet2 | None = None
    coarseness: float = 1.0

    def build(self) -> Discretisation:
        """Build the model; equal axisymmetric sections share one, and specifications with equal sizes one mesh."""
        if self.body == "section" and not self.harmonics:
            return _axisymmetric(self, threading.get_ident())
        return self._build()

    def _build(self) -> Discretisation:
        section, half, shape, harmonics = self.body == "section", self.body == "half", self.shape, self.harmonics
        mesh = self._mesh()
        e = elements.build(mesh, axisymmetric=section, harmonics=harmonics, sines=self.sines)
        fixed = np.zeros((len(e.nodes), e.angles.fields), dtype=bool)
        fixed[elements.boundary_nodes(mesh, "base")] = True
        if section:
            fixed[np.ix_(elements.boundary_nodes(mesh, "axis"), ~on_axis(harmonics, sines=self.sines))] = True
        elif half:
            fixed[elements.boundary_nodes(mesh, "symmetry"), 1] = True
        angles = 4 * max(harmonics, self.skin_harmonics) + 4 if harmonics else None
        order = 5 if section else 4
        skin = elements.surface(mesh, "skin", e, axisymmetric=section, order=order, angles=angles)
        magnet = None
        if self.magnet == "rigid":
            held = elements.boundary_nodes(mesh, "magnet")
            arms = e.nodes[held]
            arms[:, -1] -= shape.H
            magnet = held, of_section(arms, e.angles) if section else of_solid(arms, 3 if half else 6)
        symmetry = 2.0 if half else 1.0
        dead = distribute_push(skin, fixed.shape, shape.H, self.push / symmetry) if self.push else None
        if section and self.glued and self.rim is not None:
            skin = _release_next_point(skin, shape, self.rim[0])
        system = System(e, skin, lame(1.0, self.nu), fixed, magnet, dead, law=self.law)
        model: Model = ("harmonic" if harmonics else "axisymmetric") if self.body == "section" else self.body
        return Discretisation(model, mesh, system, symmetry, shape)

    def _mesh(self) -> skfem.Mesh:
        settings: dict[str, Any] = {
            "tip_size": self.tip_size,
            "rim": self.rim,
            "magnet": "hole" if self.magnet == "rigid" else "none",
        }
        if self.body == "section":
            settings |= {"fillet": self.fillet, "glued": self.glued, "coarseness": self.coarseness}
            return _section_mesh(self.shape, self.size, **settings)
        return self.mesh or _solid_mesh(self.shape, self.size, **settings, half=self.body == "half")


@functools.lru_cache(maxsize=8)
def _axisymmetric(section: MeshSpecification, thread: int) -> Discretisation:
    del thread  # a system holds the strains of its last state: each thread has its own
    model = section._build()
    read_only(vars(model.system))
    return model


def specification(scene: Scene, size: float, tip_size: float | None = None) -> MeshSpecification:
    """Return the specification of a section of a scene's beam with these edge lengths over D; at the tip size / 2."""
    tip, coarseness = tip_size or size / 2, scene.accuracy.coarseness
    return MeshSpecification(scene.shape, scene.design.nu, scene.magnet, size, tip, scene.law, coarseness=coarseness)


def distribute_push(skin: elements.Surface, fields: tuple[int, ...], above: float, force: float) -> Array:
    """Return the nodal forces of a uniform dead traction along x on the skin above a height."""
    weights = np.where(skin.points[..., 2] > above, skin.weights, 0.0)
    along = np.einsum("kq,qf,qn->knf", weights * (force / weights.sum()), skin.E[:, 0], skin.shape)
    dead = np.zeros(fields)
    np.add.at(dead, skin.nodes, along)
    return dead


def on_axis(harmonics: int, *, sines: bool = False) -> Mask:
    """Return which fields of a section may differ from zero on the axis: w_-1, a sideways displacement, and z_0."""
    return np.array([name in (("a", -1), ("b", -1), ("z", 0)) for name in field_names(harmonics, sines=sines)])


def raise_harmonics(low: System, high: System, q: Array) -> Array:
    """Return the unknowns q of a section in a system with more harmonics, or sine orders too, on the same mesh."""
    state = low.state(q)
    from_fields, to_fields = (
        field_names(system.elements.angles.harmonics, sines=system.elements.angles.sines) for system in (low, high)
    )
    u = np.zeros(high.fixed.shape)
    u[:, [to_fields.index(name) for name in from_fields]] = state.u
    from_p, to_p = ([name for name in names if name[0] in "zs"] for names in (from_fields, to_fields))
    p = np.zeros((len(state.p), len(to_p)))
    p[:, [to_p.index(name) for name in from_p]] = state.p
    motion = np.zeros(high.n_rigid)
    motion[[high.components.index(component) for component in low.components]] = low.motion(q)
    return high.unknowns(u, p, motion)


def field_names(harmonics: int, *, sines: bool) -> list[tuple[str, int]]:
    """Return kind and order of each field: a and b, real and imaginary part of w_k; z and s, cosine and sine of u_z.

    The pressures have the kinds and orders of the fields z and s.
    """
    k, n = angular_fields.orders(harmonics), range(harmonics + 1)
    names = [("a", order) for order in k] + [("b", order) for order in k if sines]
    return names + [("z", order) for order in n] + [("s", order) for order in n[1:] if sines]


def _release_next_point(skin: Surface, shape: Shape, radius: float) -> Surface:
    """Return the skin of a section without contact at that point outside a glued area that is next to its edge.

    At the share 0.03 of the facet's length from the edge, the point would touch in the press, by the waves that
    graded elements have there (see `geometry.section`), and hold the skin that should open as soon
    as the plate moves: a small shear of a long sensor would be 5 % too stiff.

    radius : undeformed radius of the area's edge.
    """
    edge = shape.H + math.sqrt(max(shape.R**2 - radius**2, 0.0))
    height = skin.points[:, :: skin.angles, 2]
    outside = np.flatnonzero(height.max(axis=1) < edge)
    if not len(outside):
        return skin
    facet = outside[height[outside].max(axis=1).argmax()]
    weights = skin.weights.copy()
    weights[facet].reshape(-1, skin.angles)[height[facet].argmax()] = 0
    return replace(skin, weights=weights)
