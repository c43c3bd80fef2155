"""The state of a path of loads: one frozen value in units of D and E, which each increment replaces by the next.

The position of plate or grip is v = (depth, shear along x, shear along y). A state holds everything that the next
increment depends on, so equal increments from equal states give equal results.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field, replace

import numpy as np

from fem.model import coulomb_friction, elements, plate_contact, single_order
from fem.model.coulomb_friction import Friction
from fem.model.plate_contact import KAPPA, SECTION_KAPPA, Bond, Plate
from fem.model.symmetry_models import Discretisation, raise_harmonics
from fem.scene import FIRST_TOUCH
from fem.solution import CREASE, STABLE, UNKNOWN, Stability
from geometry.arrays import Array

CLAMP = 0.02
"""Height over D below which the skin is left out of `PathState.crease_ratio`: its strain is singular at the clamp."""


@dataclass(frozen=True, slots=True)
class PastState:
    """An earlier state for extrapolation: position (3,), unknowns, and overlap of the skin's points."""

    position: Array
    q: Array
    overlap: Array


@dataclass(frozen=True)
class PathState:
    """One state of a path.

    Attributes
    ----------
    d : the present model; it changes where a shear begins and the section gains harmonics.
    grip : whether part of the skin is gripped; otherwise there is a plate.
    tilt : tilt of the plate, rad.
    kappa : stiffness number of the plate, see `fem.model.plate_contact`.
    position : (3,) position of plate or grip, over D.
    q, energy : unknowns, and energy stored in the modelled part.
    least_J : least volume ratio J at the integration points; NaN where not computed.
    stability : stable, unstable with a number of directions, or unknown.
    onset : positions (before, after) between which the first unstable direction appeared, or None.
    before_onset : last state before it, or None.
    smooth : whether no increment from rest on has failed or taken long (`fem.solve.load_increments.SMOOTH`).
    sheared : whether plate or grip have ever moved sideways.
    bond : the tied points, or None.
    friction : history of the points in contact; None without Coulomb friction.
    dissipated : energy dissipated by slip in the modelled part.
    direction : (3,) unit vector of the last motion; zeros before the first.
    past : up to two earlier states, oldest first, on the smooth path to this one.
    stiffness : of the plate's springs, over E / D, where it does not follow from kappa and the depth.
    reduced : present state of the predictor; None without a predictor.
    """

    d: Discretisation
    grip: bool
    tilt: float
    kappa: float
    position: Array
    q: Array
    energy: float = 0.0
    least_J: float = math.nan
    stability: Stability = UNKNOWN
    onset: tuple[Array, Array] | None = None
    before_onset: PastState | None = None
    smooth: bool = True
    sheared: bool = False
    bond: Bond | None = None
    friction: Friction | None = None
    dissipated: float = 0.0
    direction: Array = field(default_factory=lambda: np.zeros(3))
    past: tuple[PastState, ...] = ()
    stiffness: float | None = None
    reduced: PathState | None = None

    @property
    def has_history(self) -> bool:
        """Whether the path up to here decides states beyond it: a press without friction is elastic. (With an
        imperfection it has one branch, and follows it.)
        """
        return self.d.model != "axisymmetric" or self.friction is not None or self.sheared

    @property
    def is_sound(self) -> bool:
        """Whether the state is known to be stable, on a smooth path without an onset."""
        return self.smooth and self.stability.is_stable and self.onset is None

    @property
    def is_sound_press(self) -> bool:
        """Whether a press is sound, and has no crease: any such path leads to it."""
        return self.is_sound and self.crease_ratio is not None and self.crease_ratio < CREASE

    @property
    def skin(self) -> elements.Surface:
        return self.d.system.skin

    @property
    def u(self) -> Array:
        """(nodes, fields) nodal displacements."""
        return self.d.system.state(self.q).u

    @functools.cached_property
    def plate(self) -> Plate:
        """The plate (or grip) at the present position, with its tied points."""
        return self.plate_at(self.position)

    def plate_at(self, position: Array) -> Plate:
        """Return the plate (or grip) at another position (3,), with the present tied points."""
        depth, *shear = position
        shape, stiffness = self.d.shape, self.stiffness
        if stiffness is None:
            stiffness = self.kappa / (shape.R if self.grip else math.sqrt(shape.R * max(depth, FIRST_TOUCH)))
        height = None if self.grip else shape.plate_height(depth, self.tilt)
        return Plate(height, stiffness, np.array(shear), self.tilt, self.bond, friction=self.friction)

    @functools.cached_property
    def overlap(self) -> Array:
        """(k, q) overlap of the skin's points with the plate."""
        return plate_contact.overlap(self.skin, self.u, self.plate)

    @functools.cached_property
    def skin_stretches(self) -> tuple[Array, Array]:
        """Stretches along the meridian and around the axis at the points of an axisymmetric skin, (k, q) each."""
        skin, nodes = self.skin, self.d.system.elements.nodes
        before = nodes[skin.nodes]
        after = before + self.u[skin.nodes]
        # the place of a point on its facet, from -1 to 1, is the difference of the corners' quadratic shape functions
        place = skin.shape[:, 1] - skin.shape[:, 0]
        slope = np.stack([place - 0.5, place + 0.5, -2 * place], axis=1)
        along = np.hypot(*np.moveaxis(slope @ after, -1, 0)) / np.hypot(*np.moveaxis(slope @ before, -1, 0))
        return along, (after[..., 0] @ skin.shape.T) / (before[..., 0] @ skin.shape.T)

    @functools.cached_property
    def crease_ratio(self) -> float | None:
        """Largest ratio of the stretches normal to the free skin and along it; None off the axis.

        The free skin has no traction, so that the logarithm of its normal stretch is -nu / (1 - nu) times those along
        it (exact for nu = 0.5). The skin in touch with the plate is left out. The ratio of two meshes agrees up to
        CREASE; beyond, it is that of the crease which the mesh has opened (`fem.results.silicone_limits`).
        """
        if self.d.model != "axisymmetric":
            return None
        along, around = self.skin_stretches
        height = self.d.system.elements.nodes[self.skin.nodes][..., 1] @ self.skin.shape.T
        free = (self.overlap <= 0) & (height > CLAMP)
        nu = 1 / (2 * float(self.d.system.mu[0, 0])) - 1  # E is the unit of stress
        along, around = along[free], around[free]
        return float(((along * around) ** (-nu / (1 - nu)) / np.minimum(along, around)).max(initial=0.0))


def at_rest(
    d: Discretisation,
    grip: float | None = None,
    tilt: float = 0.0,
    mu: float | None = None,
    kappa: float = SECTION_KAPPA,
) -> PathState:
    """Return the undeformed, untouched state; for the parameters see `fem.solve.load_stepping.PathModels`."""
    skin, bond, friction = d.system.skin, None, None
    if grip is not None:
        tied = plate_contact.average_over_facets(skin, skin.points[..., 2]) >= d.shape.L - grip
        bond = Bond(tied, skin.points[..., :2])
    if mu is not None:
        friction = coulomb_friction.at_rest(mu, skin.weights.shape)
    # the stiffer springs suit only sections under an upright plate: tetrahedra are too large, friction would need too
    # many increments, and off the axis many points of the skin touch and separate in every iteration
    if not d.revolved or mu is not None or tilt:
        kappa = KAPPA
    rest = np.zeros(d.system.size)
    return PathState(
        d, grip is not None, tilt, kappa, np.zeros(3), rest, 0.0, 1.0, STABLE, bond=bond, friction=friction
    )


def with_harmonics(state: PathState, d: Discretisation) -> PathState:
    """Return the state of an axisymmetric section in a model with harmonics on the same mesh."""
    return _raised(state, d, raise_harmonics(state.d.system, d.system, state.q))


def about(state: PathState, d: Discretisation) -> PathState:
    """Return the state of an axisymmetric section in a model of one order (`single_order`) on the same mesh."""
    return _raised(state, single_order.linearise(d, state.d.system.state(state.q)), np.zeros(d.system.size))


def _raised(state: PathState, d: Discretisation, q: Array) -> PathState:
    friction = state.friction
    if friction is not None:
        friction = coulomb_friction.revolve(friction, d.system.skin.points)
    # past states have other unknowns and cannot be extrapolated
    return replace(state, d=d, q=q, friction=friction, past=())


def with_predictor(state: PathState, d: Discretisation, low: PathState | None = None) -> PathState:
    """Return the state with a predictor of the model d at the same position.

    low : the same state with at most the predictor's harmonics; None at rest.
    """
    q = np.zeros(d.system.size) if low is None else raise_harmonics(low.d.system, d.system, low.q)
    # its energy and stability follow with its first increment
    reduced = PathState(d, state.grip, state.tilt, state.kappa, state.position, q, least_J=state.least_J)
    return replace(state, reduced=reduced)


def glue(state: PathState, radius: float | None) -> PathState:
    """Return the state with the area within an undeformed radius glued to the plate; None: the contact radius."""
    tied, reduced = (
        plate_contact.choose_glued(state.skin, state.u, state.plate, radius, state.d.shape.H),
        state.reduced,
    )
    if reduced is not None:  # it has its own displacements, and so its own targets
        reduced = replace(reduced, bond=plate_contact.bond_here(reduced.skin, reduced.u, reduced.plate, tied))
    return replace(state, bond=plate_contact.bond_here(state.skin, state.u, state.plate, tied), reduced=reduced)
