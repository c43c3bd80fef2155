"""Responses of designs by finite elements, as the sizing asks for them."""

import numpy as np
import pytest

from fem.accuracy import QUICK
from fem.equilibrium import trace
from geometry.design import paper
from geometry.loads import Load
from studies.exploration import store
from studies.exploration.needed_paths import Processes, Solver
from studies.exploration.solved_paths import Answer
from studies.sizing.fem_beams import FemBeams


class Stability:
    """Answers of the search for a critical depth: status, critical depth, depth that is known as stable, message."""

    accuracy = QUICK

    def __init__(self, *found):
        self.found = found

    def answers(self, scenes, kind):
        assert kind == "critical depth"
        names = ("critical_depth_over_D", "stable_to_over_D")
        return [
            [Answer(8.0, 1.0, None, status, text, np.nan, 0.0, values=dict(zip(names, values, strict=False)))]
            for status, text, *values in self.found
        ]


def test_a_search_that_stopped_early_is_stable_no_deeper_than_it_came():
    stopped = ("ok", "the press does not converge beyond 1.6 mm; it is stable up to there", None, 0.2)
    answers = Stability(("ok", "", 0.31, 0.309), ("ok", "", None, 0.45), stopped, ("not_converged", "it stopped"))
    beams = FemBeams([paper()] * 4, answers)
    assert beams.critical_depth().value == pytest.approx([0.31, np.inf, np.nan, np.nan], nan_ok=True)
    assert beams.stable_to(0.0) == pytest.approx([0.31, 0.45, 0.2, np.nan], nan_ok=True)


@pytest.fixture(scope="module")
def sheared():
    """Shears of the paper's sensor: in falling order, and one without a depth because its press has failed."""
    depth, shear = np.array([[0.1, 0.1, np.nan]]), np.array([[0.1, 0.05, 0.1]])
    with store.in_memory() as memory:
        yield FemBeams([paper()], Solver(memory, Processes(0), None, QUICK)).shear(depth, shear)


def test_a_load_without_a_depth_has_no_response(sheared):
    assert np.isnan(sheared["force_x"].value).tolist() == [[False, False, True]]


def test_shears_are_those_of_one_path_whatever_their_order(sheared):
    loads = [Load(depth=0.8, shear_x=shear, friction="stick") for shear in (0.4, 0.8)]
    near, far = (state.response for state in trace(paper(), loads, QUICK, model="harmonic"))
    assert sheared["force_x"].value[0, :2] * 64 == pytest.approx([far.force[0], near.force[0]], rel=1e-6)
    assert sheared["shift_z"].value[0, :2] * 8 == pytest.approx([-far.shift[2], -near.shift[2]], rel=1e-6)
