"""Lateral stiffness of a pressed body of revolution, and the depth at which it buckles sideways.

About an axisymmetric state the tangent K of the model with one harmonic decouples into an axisymmetric block and the
block of all displacements that vary like cos theta or sin theta: bending, sideways shear, rocking on the plate. A
dead force along x, distributed over the dome as f, displaces the dome by f . K^-1 f per unit force. The lateral
stiffness is

    k = 1 / (f . K^-1 f) = 1 / sum_i (f . v_i)^2 / lambda_i

with the eigenvalues and vectors of K. It decreases as the press goes deeper, much as that of a column under load, k =
k_0 (1 - F / F_c), and passes through zero with the first eigenvalue: there the press buckles sideways. By Sylvester's
law of inertia the number of negative eigenvalues of K, less those of the pressures and of the axisymmetric model, is
the number of sideways directions in which the press is unstable.

One state is therefore enough to estimate the critical load. With r = k / k_0 the critical force is F / (1 - r). Where
the force grows like d^n, with n = F d / U - 1 from the energy U stored so far, the critical depth is d (1 -
r)^(-1/n). Compared with `fem.stability.critical` on eleven beams (L/D 1 to 6, with and without magnet), estimates
from states at 0.7 to 1.1 of the critical depth, where r is between FAR and PAST, are off by at most 11 % at level
quick and 7 % at standard.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fem.contact import plate_contact
from fem.contact.plate_contact import Plate
from fem.discretisation import symmetry_models
from fem.discretisation.symmetry_models import Discretisation
from fem.solvers.direct_solver import Solver
from fem.solvers.path_state import PathState, with_harmonics
from geometry.arrays import Array

FAR, PAST = 0.5, -0.3
"""Ratios of the lateral stiffness to that at rest between which a critical depth is estimated: the range of the
comparison in the module docstring."""


class SidewaysModel:
    """Model with harmonics in which the axisymmetric presses on one mesh are checked for sideways stability.

    Parameters
    ----------
    build : builds the model at its first use, which most paths never reach.
    """

    def __init__(self, build: Callable[[], Discretisation]) -> None:
        self._build = build

    @functools.cached_property
    def d(self) -> Discretisation:
        return self._build()

    @functools.cached_property
    def stiffness_at_rest(self) -> float:
        """Lateral stiffness of the unloaded beam, in units of E D."""
        return _solve_lateral(self.d, np.zeros(self.d.system.size), None)[0]


@dataclass(frozen=True, slots=True)
class LateralStiffness:
    """Lateral stiffness and stability of an axisymmetric state.

    Attributes
    ----------
    stiffness : k, force over displacement of the dome, in units of E D.
    unstable : number of unstable sideways directions; None where it is not known.
    """

    stiffness: float
    unstable: int | None


def measure_lateral_stiffness(model: SidewaysModel, state: PathState, *, guided: bool = False) -> LateralStiffness:
    """Return the lateral stiffness of a state of an axisymmetric press.

    Parameters
    ----------
    guided : glue the contact area to the plate; otherwise the tip slides freely.
    """
    high = with_harmonics(state, model.d)
    plate = high.plate
    if guided:
        tied = high.overlap > 0
        plate = replace(plate, tied=tied, targets=plate_contact.positions_along_plate(high.skin, high.u, plate))
    stiffness, negative = _solve_lateral(model.d, high.q, plate)
    # the count includes the directions in which the axisymmetric press itself is unstable
    return LateralStiffness(stiffness, None if negative is None else negative - (state.unstable or 0))


@dataclass(frozen=True, slots=True)
class StabilityMargin:
    """Distance of a frictionless press from sideways buckling.

    Attributes
    ----------
    ratio : lateral stiffness over that of the unloaded beam; 0 at the critical depth, negative beyond.
    critical_depth : estimate of that depth, over D; None where `ratio` is not between PAST and FAR.
    unstable : number of unstable sideways directions; None where it is not known.
    """

    ratio: float
    critical_depth: float | None
    unstable: int | None


def estimate_margin(model: SidewaysModel, state: PathState) -> StabilityMargin:
    """Estimate the stability margin of a frictionless axisymmetric press whose tip slides freely."""
    now = measure_lateral_stiffness(model, state)
    ratio, depth = now.stiffness / model.stiffness_at_rest, float(state.position[0])
    growth = integrate_normal_force(state) * depth / state.energy - 1 if state.energy > 0 else 0.0
    near = PAST <= ratio <= FAR and growth > 0
    return StabilityMargin(ratio, depth * math.pow(1 - ratio, -1 / growth) if near else None, now.unstable)


def integrate_normal_force(state: PathState) -> float:
    """Return the normal force of the plate, over E D^2."""
    residual = plate_contact.springs(state.skin, state.u, state.plate).traction
    return float(np.sum(state.skin.weights * residual[..., 2]))


def _solve_lateral(d: Discretisation, q: Array, plate: Plate | None) -> tuple[float, int | None]:
    """Return the stiffness against a force on the dome, and the number of unstable directions."""
    system = d.system
    assert system.surface is not None
    force = np.zeros(system.size)
    force[: system.n_free] = symmetry_models.distribute_push(system.surface, system.fixed.shape, d.shape.H, 1.0)[
        system.free
    ]
    solver = Solver()
    try:
        about = system.assemble(system.state(q), plate)
        solver.factorise(about.tangent, symmetric=about.symmetric)
        compliance, negative = float(force @ solver.solve(force)), solver.negative()
    finally:
        solver.close()
    # each pressure unknown adds one negative eigenvalue: the matrix is that of a saddle point
    return 1 / compliance, None if negative is None else negative - system.n_pressure
