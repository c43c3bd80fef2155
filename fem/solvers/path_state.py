"""What a path of loads has come to: one frozen value, in units of D and E, that each increment replaces by the next.

The position of plate or grip is v = (depth, shear along x, shear along y). A state holds all that an increment
from it needs, so that the same increment from the same state leads to the same next one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fem.contact import coulomb_friction, plate_contact
from fem.contact.coulomb_friction import Friction
from fem.contact.plate_contact import KAPPA, SECTION_KAPPA, Plate
from fem.discretisation import elements
from fem.discretisation.symmetry_models import Discretisation, raise_harmonics
from geometry.arrays import Array

FIRST_TOUCH = 1e-14
"""Depth over D up to which there is no contact: less is lost in the rounding of the beam's length. The plate's
stiffness goes like depth^(-1/2), and is that of this depth before."""


@dataclass(frozen=True, slots=True)
class Bond:
    """Points of the skin that a grip holds or that are glued to the plate.

    Attributes
    ----------
    tied : (k, q) mask of these points.
    targets : (k, q, 2) their positions along the plate at shear 0.
    gap : (k, q) distance to the plate at which each was glued; None for a grip.
    """

    tied: NDArray[np.bool_]
    targets: Array
    gap: Array | None = None


@dataclass(frozen=True, slots=True)
class PastState:
    """An earlier state, as far as extrapolation needs it: position (3,), unknowns, overlap of the skin's points."""

    position: Array
    q: Array
    overlap: Array


@dataclass(frozen=True, slots=True)
class PathState:
    """One state of a path.

    Attributes
    ----------
    d : the present model; it changes where a shear begins and the section gains harmonics.
    grip : whether a spot of skin is gripped; else there is a plate.
    tilt : of the plate, rad.
    kappa : number of the plate's stiffness, see `fem.contact.plate_contact`.
    position : (3,) where plate or grip is.
    q, energy : unknowns of the model, and what is stored in the modelled part.
    least_J : least volume ratio J at the points of integration.
    unstable : number of unstable directions, None where it is not known.
    onset : positions (before, after) between which the first unstable direction appeared, or None.
    sheared : whether plate or grip have ever moved sideways.
    bond : what is held, or None.
    friction : history of the points in contact, None without Coulomb friction.
    dissipated : energy that slipping has cost in the modelled part.
    direction : (3,) unit vector of the last motion under Coulomb friction, zeros before.
    past : up to two states before, the earlier first, in which the path led here smoothly.
    reduced : the last state of the predictor, which goes ahead of this one; None without a predictor.
    """

    d: Discretisation
    grip: bool
    tilt: float
    kappa: float
    position: Array
    q: Array
    energy: float = 0.0
    least_J: float = 1.0
    unstable: int | None = None
    onset: tuple[Array, Array] | None = None
    sheared: bool = False
    bond: Bond | None = None
    friction: Friction | None = None
    dissipated: float = 0.0
    direction: Array = field(default_factory=lambda: np.zeros(3))
    past: tuple[PastState, ...] = ()
    reduced: PathState | None = None

    @property
    def skin(self) -> elements.Surface:
        assert self.d.system.surface is not None
        return self.d.system.surface

    @property
    def u(self) -> Array:
        """Nodal fields, shape (nodes, fields)."""
        return self.d.system.state(self.q).u

    @property
    def plate(self) -> Plate:
        """The plate (or grip) where it is, with what it holds."""
        return self.plate_at(self.position)

    def plate_at(self, position: Array) -> Plate:
        """The plate (or grip) at another position (3,), with what it holds now."""
        depth, *shear = position
        shape = self.d.shape
        radius = shape.R if self.grip else math.sqrt(shape.R * max(depth, FIRST_TOUCH))
        # a tilted plate touches the dome beside its top
        height = None if self.grip else shape.L - depth + shape.R * (1 / math.cos(self.tilt) - 1)
        tied, targets, gap = (
            (None, None, None) if self.bond is None else (self.bond.tied, self.bond.targets, self.bond.gap)
        )
        stiffness = self.kappa / radius
        return Plate(height, stiffness, np.array(shear), self.tilt, tied, targets, gap, friction=self.friction)

    @property
    def overlap(self) -> Array:
        """How far the skin's points overlap the plate, shape (k, q)."""
        return plate_contact.overlap(self.skin, self.u, self.plate)


def at_rest(
    d: Discretisation,
    grip: float | None = None,
    tilt: float = 0.0,
    mu: float | None = None,
    kappa: float | None = None,
) -> PathState:
    """The undeformed body, which nothing touches yet; parameters as of `fem.solvers.load_stepping.Path`."""
    skin, bond, friction = d.system.surface, None, None
    assert skin is not None
    if grip is not None:
        tied = plate_contact.average_over_facets(skin.points[..., 2]) >= d.shape.L - grip
        bond = Bond(tied, skin.points[..., :2])
    if mu is not None:
        friction = coulomb_friction.at_rest(mu, skin.weights.shape)
    # tetrahedra are too large, and friction takes too many increments, for the stiffer springs of a section
    if not d.revolved or mu is not None:
        kappa = KAPPA
    elif kappa is None:
        kappa = SECTION_KAPPA
    rest = np.zeros(d.system.size)
    return PathState(d, grip is not None, tilt, kappa, np.zeros(3), rest, bond=bond, friction=friction)


def with_harmonics(state: PathState, d: Discretisation) -> PathState:
    """The same state of an axisymmetric section in a model with harmonics on its mesh."""
    q, friction = raise_harmonics(state.d.system, d.system, state.q), state.friction
    if friction is not None:
        assert d.system.surface is not None
        friction = coulomb_friction.revolve(friction, d.system.surface.points)
    # the past has other unknowns
    return replace(state, d=d, q=q, friction=friction, past=())


def with_predictor(state: PathState, d: Discretisation, low: PathState | None = None) -> PathState:
    """The state with a predictor that stands where it does.

    Parameters
    ----------
    d : the predictor's model, with fewer harmonics on the same mesh.
    low : the same state with no more harmonics than that; None for one at rest.
    """
    q = np.zeros(d.system.size) if low is None else raise_harmonics(low.d.system, d.system, low.q)
    # what is stored in it and how stable it is follows with its first increment
    reduced = PathState(d, state.grip, state.tilt, state.kappa, state.position, q)
    return replace(state, reduced=reduced)


def glue(state: PathState, radius: float | None) -> PathState:
    """The state with the patch within an undeformed radius glued to the plate; None: within the contact radius."""
    plate = plate_contact.glue(state.skin, state.u, state.plate, radius, state.d.shape.H)
    assert plate.tied is not None
    assert plate.targets is not None
    return replace(state, bond=Bond(plate.tied, plate.targets - state.position[1:], plate.gap))
