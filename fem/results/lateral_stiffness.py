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
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np

from fem.model import plate_contact, single_order, symmetry_models
from fem.model.plate_contact import Plate
from fem.model.symmetry_models import Discretisation
from fem.solve.direct_solver import Solver, Stability
from fem.solve.path_state import PathState, about

FAR, PAST = 0.5, -0.3
"""Ratios of the lateral stiffness to that at rest between which a critical depth is estimated: the range of the
comparison in the module docstring."""


@dataclass(frozen=True, slots=True)
class StabilityMargin:
    """Distance of a frictionless press from sideways buckling.

    ratio : lateral stiffness over that of the unloaded beam; 0 at the critical depth, negative beyond. None with
        Coulomb friction, which holds the tip.
    critical_depth : estimate of that depth, over D; None where `ratio` is not between PAST and FAR.
    stability : whether it is stable sideways.
    """

    ratio: float | None
    critical_depth: float | None
    stability: Stability


@dataclass
class SidewaysModel:
    """Models of orders 1 to `harmonics`, in which presses of the axisymmetric model `low` are checked sideways."""

    low: Discretisation
    harmonics: int = 1

    @functools.cached_property
    def orders(self) -> list[Discretisation]:
        """The models, built at their first use, which most paths never reach."""
        return [single_order.build(self.low, order) for order in range(1, self.harmonics + 1)]

    @functools.cached_property
    def solvers(self) -> list[Solver]:
        """A solver for each of the models, which keeps the symbolic factorisation."""
        return [Solver() for _ in self.orders]

    @functools.cached_property
    def stiffness_at_rest(self) -> float:
        """Lateral stiffness of the unloaded beam, in units of E D."""
        return _solve_lateral(self.solvers[0], self.orders[0], None)[0]

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
        return StabilityMargin(ratio, depth * math.pow(1 - ratio, -1 / growth) if near else None, stability)


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
