"""The models of a scene: which mesh, which symmetries, which unknowns. All lengths are scaled by D here.

axisymmetric : press of a body of revolution, (r, z) section.
half : load in the plane y = 0, tetrahedra in y >= 0.
The harmonic (Fourier) and full models take their place beside these two.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Literal

import numpy as np
import skfem
from numpy.typing import NDArray

from fem import elements
from fem.elements import Elements
from fem.material import Law, lame, neo_hookean
from fem.system import System
from geometry.design import Shape
from geometry.mesh import tetrahedra
from geometry.scene import Magnet
from geometry.section import section

Array = NDArray[np.float64]
Model = Literal["axisymmetric", "half"]


@dataclass(frozen=True, slots=True)
class Discretisation:
    """A meshed scene in units of D and E.

    Attributes
    ----------
    model : its name.
    mesh : scikit-fem's second-order mesh.
    system : unknowns and equations.
    symmetry : what forces on the modelled part are multiplied by to give those on the whole (1 or 2).
    shape : the scaled shape.
    """

    model: Model
    mesh: skfem.Mesh
    system: System
    symmetry: float
    shape: Shape

    @property
    def elements(self) -> Elements:
        return self.system.elements


def axisymmetric(
    shape: Shape, nu: float, magnet: Magnet, size: float, tip_size: float, law: Law = neo_hookean
) -> Discretisation:
    """Section model with clamped base; size and tip_size are edge lengths in units of D."""
    rigid = magnet == "rigid"
    mesh = section(shape, size, tip_size=tip_size, magnet="hole" if rigid else "none")
    e = elements.build(mesh, axisymmetric=True)
    fixed = np.zeros(e.nodes.shape, dtype=bool)
    fixed[elements.boundary_nodes(mesh, "base")] = True
    fixed[elements.boundary_nodes(mesh, "axis"), 0] = True
    skin = elements.surface(mesh, "skin", e, axisymmetric=True, order=5)
    return _discretise("axisymmetric", mesh, e, skin, fixed, shape, nu, law, rigid, 1.0)


def half(
    shape: Shape, nu: float, magnet: Magnet, size: float, tip_size: float, law: Law = neo_hookean
) -> Discretisation:
    """Tetrahedra in y >= 0 with clamped base; size and tip_size are edge lengths in units of D."""
    rigid = magnet == "rigid"
    mesh = _half_mesh(shape, size, tip_size, "hole" if rigid else "none")
    e = elements.build(mesh, axisymmetric=False)
    fixed = np.zeros(e.nodes.shape, dtype=bool)
    fixed[elements.boundary_nodes(mesh, "base")] = True
    fixed[elements.boundary_nodes(mesh, "symmetry"), 1] = True
    skin = elements.surface(mesh, "skin", e, axisymmetric=False, order=4)
    return _discretise("half", mesh, e, skin, fixed, shape, nu, law, rigid, 2.0)


@functools.lru_cache(maxsize=4)
def _half_mesh(shape: Shape, size: float, tip_size: float, magnet: Literal["hole", "none"]) -> skfem.MeshTet2:
    return tetrahedra(shape, size, tip_size=tip_size, half=True, magnet=magnet)


def _discretise(
    model: Model,
    mesh: skfem.Mesh,
    e: Elements,
    skin: elements.Surface,
    fixed: NDArray[np.bool_],
    shape: Shape,
    nu: float,
    law: Law,
    rigid: bool,
    symmetry: float,
) -> Discretisation:
    mu, inverse_K = lame(1.0, nu)
    centre = np.zeros(e.dim)
    centre[-1] = shape.H
    glued = elements.boundary_nodes(mesh, "magnet") if rigid else np.empty(0, dtype=np.int64)
    system = System(e, skin, mu, inverse_K, fixed, glued, centre, law=law)
    return Discretisation(model, mesh, system, symmetry, shape)
