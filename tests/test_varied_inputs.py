"""Inputs of a sensitivity study: ranges from texts and from tolerances, and the cases at points."""

import numpy as np
import pytest

from geometry.design import BadInput, Design, paper
from studies.sensitivity.tolerances import Tolerances
from studies.sensitivity.varied_inputs import Press, check_ranges, parse_ranges, ranges_of_tolerances, sampled_cases


def test_ranges_of_the_tolerances_lie_about_the_design_and_below_their_bounds():
    ranges = ranges_of_tolerances(paper(), Tolerances(E=20.0, nu=0.001, magnet_height=0.0))
    assert ranges["E"] == pytest.approx((0.8, 1.2))
    assert ranges["nu"] == pytest.approx((0.4988, 0.5))
    assert ranges["magnet_diameter"] == pytest.approx((3.95, 4.05))
    assert "magnet_height" not in ranges


def test_cases_have_the_values_of_their_points_and_elements_keep_their_places():
    points = np.array([[8.0, 9.0, 0.5], [8.0, 11.0, 1.5], [20.0, 9.0, 1.0]])
    cases = sampled_cases(paper(), {"D": (4, 20), "L": (8, 12), "depth": (0.5, 1.5)}, points, Press(1.0, 0.2))
    first, longer, impossible = cases.designs
    assert (first.D, first.L, first.l0) == pytest.approx((8.0, 9.0, 7.2))
    assert (longer.L, longer.l0) == (11.0, 9.2)
    assert impossible is None
    assert "L must exceed the tip radius" in cases.refusals[2]
    assert cases.depth.tolist() == [0.5, 1.5, 1.0]
    assert cases.shear.tolist() == [0.2] * 3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("E=1", "--vary E takes low:high, such as E=1:2; got '1'"),
        ("E=2:1", "--vary E takes low:high with low < high; got '2:1'"),
        ("E=1:1e9", "every value of axis E must lie between"),
        ("E=a:b", "each value of axis E must be a finite number; got 'a'"),
        ("law=1:2", "--vary law: its values are names"),
        ("hall_average=1:9", "--vary hall_average: it is a whole number of samples"),
        ("EE=1:2", "there is no axis 'EE'"),
        ("E", "--vary takes KEY=VALUE, such as E=0.6:1; got 'E'"),
    ],
)
def test_impossible_ranges_are_refused(text, message):
    with pytest.raises(BadInput) as error:
        parse_ranges([text])
    assert message in str(error.value)


def test_a_range_that_a_method_cannot_vary_is_refused():
    with pytest.raises(
        BadInput, match="--vary friction: only fields of the design, depth and shear can vary: leave it out"
    ):
        check_ranges({"friction": (0.1, 0.5)}, Press(1.0))
    with pytest.raises(BadInput, match="shear is given twice"):
        check_ranges({"shear": (0.1, 0.5)}, Press(1.0, 0.2))


@pytest.mark.parametrize("load", [(0.0, 0.0), (float("nan"), 0.0), (1.0, -0.1), (1.0, float("inf"))])
def test_impossible_loads_are_refused(load):
    with pytest.raises(BadInput, match="must be a finite number of mm"):
        Press(*load)


def test_a_case_without_a_possible_sensor_keeps_its_place():
    cases = sampled_cases(Design(), {"nu": (0.4, 0.6)}, np.array([[0.45], [0.55]]), Press(1.0))
    assert cases.designs[0].nu == 0.45
    assert cases.designs[1] is None
