"""Stress that a time step adds to the elements: tangent, compiled loops, and frame invariance."""

import numpy as np
import pytest

from fem.model import viscoelasticity
from fem.model.nonlinear_system import State, System
from fem.model.symmetry_models import MeshSpecification
from fem.model.viscoelasticity import ViscousLaw
from geometry.arrays import Array
from geometry.design import paper
from geometry.relaxation import Relaxation

BRANCHES = Relaxation((0.2, 0.1), (0.5, 5.0))


def _system(harmonics: int) -> System:
    shape = paper().shape.scaled(1 / paper().D)
    return MeshSpecification(shape, 0.49, "rigid", 0.5, 0.5, harmonics=harmonics).build().system


def _deformed(system: System, seed: int, size: float = 2e-4) -> Array:
    return size * np.random.default_rng(seed).standard_normal(system.size)


def _in_step(system: System, law: ViscousLaw) -> System:
    """Return the system in a time step after another one."""
    e = system.elements
    points = len(e.angles.theta), *e.weights.shape
    history = viscoelasticity.at_rest(law, BRANCHES, points, 1 / 0.7)
    before = system.state(_deformed(system, 1))
    history = history.advance(viscoelasticity.measure(e, system.law, system.mu, before.u), 0.3)
    system.viscous = history.overstress(0.4)
    return system


def _admissible(system: System, q: Array) -> State:
    state = system.admissible(q)
    assert state is not None
    return state


@pytest.mark.parametrize("law", ["prony", "finite"])
@pytest.mark.parametrize("harmonics", [0, 1])
def test_tangent_is_the_derivative_of_the_residual(law: ViscousLaw, harmonics: int) -> None:
    system = _in_step(_system(harmonics), law)
    q, along = _deformed(system, 2), _deformed(system, 3, 1.0)
    tangent = system.assemble(_admissible(system, q), None).tangent
    whole = tangent + tangent.T
    whole.setdiag(tangent.diagonal())
    ahead, back = (
        system.assemble(_admissible(system, q + h * along), None, tangent=False).residual for h in (1e-6, -1e-6)
    )
    assert whole @ along == pytest.approx((ahead - back) / 2e-6, rel=1e-5, abs=1e-6 * np.abs(whole @ along).max())


def test_residual_is_the_derivative_of_the_energy() -> None:
    system = _in_step(_system(0), "prony")
    q, along, h = _deformed(system, 2), _deformed(system, 3, 1.0), 1e-6
    ahead, back = (system.assemble(_admissible(system, q + s * along), None).energy for s in (h, -h))
    residual = system.assemble(_admissible(system, q), None).residual
    assert residual @ along == pytest.approx((ahead - back) / (2 * h), rel=1e-6)
