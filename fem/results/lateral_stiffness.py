"""Lateral stiffness of a pressed body of revolution, and the depth at which it buckles sideways.

About an axisymmetric state the tangent of a model with harmonics has one block for each order of the angle
(`fem.model.single_order`). The block K of order 1 is that of all displacements that vary like cos theta or
sin theta: bending, sideways shear, rocking on the plate. A dead force along x, distributed over the dome as f,
displaces the dome by f . K^-1 f per unit force. The lateral stiffness is

    k = 1 / (f . K^-1 f) = 1 / sum_i (f . v_i)^2 / lambda_i

with the eigenvalues and vectors of K. It decreases as the press goes deeper, much as that of a column under load, k =
k_0 (1 - F / F_c), and passes through zero with the first eigenvalue: there the press buckles sideways. By Sylvester's
law of inertia the number of negative eigenvalues of the blocks of orders 1, 2, ..., less that of the pressures, is
the number of sideways directions in which the press is unstable.

One state is therefore enough to estimate the critical load. With r = k / k_0 the critical force is F / (1 - r). Where
the force grows like d^n, with n = F d / U - 1 from the energy U stored so far, the critical depth is d (1 -
r)^(-1/n). Compared with `fem.analyses.stability.critical` on eleven beams (L/D 1 to 6, with and without magnet),
estimates from states at 0.7 to 1.1 of the critical depth, where r is between FAR and PAST, are off by at most 11 % at
level quick and 7 % at standard.

The contact ends somewhere between two integration points. How far these are from its edge is random, which changes
the stiffness against rocking on the plate: the ratio scatters from one depth to the next, without a bias. Its half
width

    w = HALF_WIDTH (h / D)^0.9 max(|1 - r|, 0.1)^(3/4) (a / D)^(1/2)

with the edge length h of the section and the contact radius a holds for 95 % of the ratios. Its numbers are those of
45 of 80 random beams (L/D 0.6 to 5, nu 0 to 0.5, all laws, with and without magnet), pressed to 0.2 to 1.12 of the
critical depth. The reference is the mesh of `fem.analyses.stability`, refined where the contact of each press ends.
For the other 35 beams it holds for 146 of 156 ratios at quick, 155 of 158 at standard and 151 of 157 at fine. Within
w of zero nothing is known of the sideways stability: in 996 presses the sign of the ratio contradicted the critical
depth of `fem.analyses.stability` 60 times, a verdict by w once, at 0.999 of that depth.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field, replace

import numpy as np

from fem.model import plate_contact, single_order, symmetry_models
from fem.model.plate_contact import Plate
from fem.model.symmetry_models import Discretisation
from fem.solution import STABLE, UNKNOWN, Stability
from fem.solve.direct_solver import Solver
from fem.solve.path_state import PathState, about

FAR, PAST = 0.5, -0.3
"""Ratios of the lateral stiffness to that at rest between which a critical depth is estimated: the range of the
comparison in the module docstring."""
ROOM_WIDTHS, ROOM_DEPTH = 3.0, 0.8
"""Least ratio over its half width, and largest depth over the estimated critical depth, of a press that shows that
all less deep ones are stable and not close to buckling. Its own ratio may be one half width too large, theirs one too
small, and must be beyond a third; with an error of 10 % the depth is less than `fem.results.diagnostics.NEAR` of the
critical one."""
HALF_WIDTH, LEAST_CHANGE = 1.4, 0.1
"""Factor of the half width of a ratio, and least change of the ratio from 1 in it, see the module docstring."""


@dataclass(frozen=True, slots=True)
class StabilityMargin:
    """Distance of a frictionless press from sideways buckling.

    ratio : lateral stiffness over that of the unloaded beam; 0 at the critical depth, negative beyond. None with
        Coulomb friction, which holds the tip.
    critical_depth : estimate of that depth, over D; None where `ratio` is not between PAST and FAR.
    stability : whether it is stable sideways; unknown where `ratio` is within its half width of zero.
    half_width : of `ratio`; None with it.
    """

    ratio: float | None
    critical_depth: float | None
    stability: Stability
    half_width: float | None = None

    @property
    def is_doubtful(self) -> bool:
        """Whether the mesh does not tell on which side of the critical depth the press is."""
        return self.ratio is not None and self.stability.is_unknown and within(self.ratio, self.half_width)

    def has_room(self, depth: float) -> bool:
        """Whether a press with this margin, to a depth over D, shows that all less deep ones are stable."""
        if self.ratio is None or self.half_width is None or not self.stability.is_stable:
            return False
        far = self.critical_depth is None or depth < ROOM_DEPTH * self.critical_depth
        return far and self.ratio > ROOM_WIDTHS * self.half_width


def ratio_half_width(ratio: float, edge: float, contact_radius: float) -> float:
    """Return the half width of a ratio of lateral stiffnesses, see the module docstring.

    edge, contact_radius : edge length of the section, and contact radius of the press, over D.

    >>> round(ratio_half_width(0.0, 0.09, 0.25), 3)
    0.08
    """
    change = max(abs(1 - ratio), LEAST_CHANGE)
    return HALF_WIDTH * math.pow(edge, 0.9) * math.pow(change, 0.75) * math.sqrt(contact_radius)


def within(ratio: float, half_width: float | None) -> bool:
    """Return whether a ratio is within its half width of zero: then it does not tell a stable from an unstable press.

    A ratio without a half width tells nothing either.
    """
    return half_width is None or not abs(ratio) > half_width


@dataclass
class SidewaysModel:
    """Models of orders 1 to `harmonics`, in which presses of the axisymmetric model `low` are checked sideways.

    edge : edge length of the section, over D.
    """

    low: Discretisation
    edge: float
    harmonics: int = 1
    _stable_to: float = field(default=0.0, init=False)

    @functools.cached_property
    def orders(self) -> list[Discretisation]:
        """The models, built at their first use, which most paths never reach."""
        return [single_order.build(self.low, order) for order in range(1, self.harmonics + 1)]

    @functools.cached_property
    def solvers(self) -> list[Solver]:
        """A solver for each of the models, which keeps the symbolic factorisation."""
        return [Solver() for _ in self.orders]

    @property
    def stiffness_at_rest(self) -> float:
        """Lateral stiffness of the unloaded beam, in units of E D."""
        return _stiffness_at_rest(self.orders[0])

    def measure(self, state: PathState, *, guided: bool = False) -> tuple[float, Stability]:
        """Return lateral stiffness, in units of E D, and sideways stability of a state of an axisymmetric press.

        Parameters
        ----------
        guided : glue the contact area to the plate; otherwise the tip slides freely.
        """
        first, *higher = (_about(d, state, guided=guided) for d in self.orders)
        solver, *higher_solvers = self.solvers
        stiffness, stability = _solve_lateral(solver, *first)
        for solver, (d, plate) in zip(higher_solvers, higher, strict=True):
            _factorise(solver, d, plate)
            stability += solver.stability(d.system.n_pressure)
        return stiffness, stability

    def margin(self, state: PathState) -> StabilityMargin:
        """Estimate the margin of an axisymmetric press whose tip slides freely, or against Coulomb friction."""
        stiffness, stability = self.measure(state)
        if state.friction is not None:
            return StabilityMargin(None, None, stability)
        ratio, depth = stiffness / self.stiffness_at_rest, float(state.position[0])
        growth = integrate_normal_force(state) * depth / state.energy - 1 if state.energy > 0 else 0.0
        near = PAST <= ratio <= FAR and growth > 0
        radius = plate_contact.contact_radius(state.skin, state.u, state.plate)
        half_width = ratio_half_width(ratio, self.edge, radius)
        # several unstable directions are no matter of a ratio near zero
        if within(ratio, half_width) and stability.directions in (0, 1):
            stability = UNKNOWN
        critical = depth * math.pow(1 - ratio, -1 / growth) if near else None
        return StabilityMargin(ratio, critical, stability, half_width)

    def verdict(self, state: PathState) -> StabilityMargin:
        """Return the margin of a press; without its numbers where a deeper one before has shown that it is stable."""
        depth = float(state.position[0])
        if state.friction is None and depth <= self._stable_to:
            return StabilityMargin(None, None, STABLE)
        margin = self.margin(state)
        if margin.has_room(depth):
            self._stable_to = depth
        return margin


def _about(d: Discretisation, state: PathState, *, guided: bool) -> tuple[Discretisation, Plate]:
    """Return the model of one order about a state, and its plate."""
    high = about(state, d)
    plate = high.plate
    if guided:
        plate = replace(plate, bond=plate_contact.bond_here(high.skin, high.u, plate, high.overlap > 0))
    return high.d, plate


def integrate_normal_force(state: PathState) -> float:
    """Return the normal force of the plate, over E D^2."""
    return float(plate_contact.resultant(state.skin, state.u, state.plate)[2])


@functools.lru_cache(maxsize=8)
def _stiffness_at_rest(d: Discretisation) -> float:
    return _solve_lateral(Solver(), d, None)[0]


def _solve_lateral(solver: Solver, d: Discretisation, plate: Plate | None) -> tuple[float, Stability]:
    """Return the stiffness against a force on the dome in the model of order 1, and its stability."""
    system = d.system
    push = symmetry_models.distribute_push(system.skin, system.fixed.shape, d.shape.H, 1.0)
    force = np.zeros(system.size)
    force[: system.n_free] = push[system.free]
    _factorise(solver, d, plate)
    return 1 / float(force @ solver.solve(force)), solver.stability(system.n_pressure)


def _factorise(solver: Solver, d: Discretisation, plate: Plate | None) -> None:
    here = d.system.assemble(d.system.state(np.zeros(d.system.size)), plate)
    solver.factorise(here.tangent, symmetric=here.symmetric)
