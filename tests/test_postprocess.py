"""What is read from a path: motion of the magnet, and the load that a state really carries."""

from dataclasses import replace

import numpy as np
import pytest

from fem.accuracy import QUICK
from fem.equilibrium import trace
from fem.model import rigid_inclusion
from fem.model.symmetry_models import MeshSpecification
from fem.results.postprocess import read_pose
from fem.solve import load_increments
from geometry.design import paper
from geometry.loads import Load


@pytest.mark.parametrize("model", ["full", "half", "harmonic"])
def test_a_body_that_turns_tilts_by_that_angle(model):
    shape = paper().shape.scaled(1 / 8)
    motion = np.array([0.1, -0.2, 0.3])
    if model == "harmonic":
        d = MeshSpecification(shape, 0.4998, "ignored", 0.16, 0.16, harmonics=2).build()
        u = rigid_inclusion.of_section(d.elements.nodes - [0, shape.H], d.elements.angles).displacement(motion)
    else:
        d = MeshSpecification(shape, 0.4998, "ignored", 0.3, 0.3, body="half" if model == "half" else "full").build()
        u = rigid_inclusion.of_solid(d.elements.nodes - [0, 0, shape.H], 3).displacement(motion)
    shift, tilt = read_pose(d, u, np.zeros(d.system.size))
    np.testing.assert_allclose(shift, [0.1, 0, -0.2], atol=1e-12)
    np.testing.assert_allclose(tilt, [0.3, 0], atol=1e-11)


def test_a_shear_that_a_stopped_press_never_began_is_not_in_its_load(monkeypatch):
    """The plate is glued after the press: a press that stops leaves the tip where the shear is 0."""
    real = load_increments.newton

    def stubborn(system, solver, q, plate, *more, **options):
        answer = real(system, solver, q, plate, *more, **options)
        return answer if plate.height is None or plate.height > 1.1 else replace(answer, reason="no_convergence")

    monkeypatch.setattr(load_increments, "newton", stubborn)
    load = Load(depth=1.0, shear_x=0.5, friction="stick")
    (state,) = trace(paper(), [load], QUICK, magnet="ignored", estimate=False)
    assert (state.status, state.load.shear_x) == ("not_converged", 0.0)
    assert "shear" not in state.message.partition(":")[0]
