"""References by extrapolation, and the true errors against them."""

import pytest

from geometry.design import paper
from geometry.loads import Load, Response
from studies.validation.trade_study import (
    Reference,
    components,
    extrapolate,
    full_scales,
    is_clear,
    true_errors,
)

SIZES = (0.04, 0.02, 0.01)


def test_a_known_limit_and_order_are_recovered():
    answers = [{"force": (2.0 + 3.0 * h**2, 0.0)} for h in SIZES]
    reference = extrapolate(SIZES, answers)
    assert reference.values["force"] == pytest.approx((2.0, 0.0), abs=1e-10)
    assert reference.bars["force"] == pytest.approx((3.0 * SIZES[-1] ** 2, 0.0), abs=1e-10)
    assert reference.orders == pytest.approx([2.0])


@pytest.mark.parametrize("values", [(1.0, 1.2, 1.1), (1.0, 1.1, 1.25), (1.0, 1.1, 1.19)])
def test_without_steady_convergence_the_finest_mesh_is_the_reference_and_the_spread_its_bar(values):
    reference = extrapolate(SIZES, [{"force": (value,)} for value in values])
    assert reference.values["force"] == (values[-1],)
    assert reference.bars["force"] == pytest.approx((max(values) - min(values),))
    assert reference.orders == ()


def test_errors_of_vectors_are_relative_to_the_length_of_the_reference():
    reference = Reference({"force": (3.0, 0.0, 4.0)}, {"force": (0.0, 0.0, 0.01)}, ())
    error = true_errors({"force": (3.0, 0.05, 4.0)}, reference, ())["force"]
    assert error == pytest.approx((1.0, 0.2))
    assert is_clear(*error)


def test_an_error_below_three_bars_is_unclear():
    assert not is_clear(0.29, 0.1)


def test_readings_are_relative_to_full_scale():
    reference = Reference({"readings": (1e-3, 2e-3, 2e-3)}, {"readings": (0.0, 0.0, 0.0)}, ())
    answer = {"readings": (1.1e-3, 2e-3, 2e-3)}
    assert true_errors(answer, reference, (1e-3, 2e-3, 2e-3))["readings"][0] == pytest.approx(10.0)
    assert "readings" not in true_errors(answer, reference, ())


def test_s2_and_s3_share_their_full_scale():
    moved = Response((0.0, 0.0, 1.0), (0.5, 0.0, -0.3), 0.05, 1.0)
    values = components(paper(), Load(depth=0.5, shear_x=0.5, friction="stick"), moved)
    first, second, third = full_scales(paper(), [Reference(values, values, ())])
    assert first > 0
    assert second == third > 0


def test_an_upright_press_has_no_tilt_and_no_force_along_a_shear():
    values = components(paper(), Load(depth=0.5), Response((0.0, 0.0, 1.0), (0.0, 0.0, -0.3), 0.0, 1.0))
    assert set(values) == {"force", "shift", "readings"}


def test_quantities_that_are_nearly_zero_have_no_error():
    reference = Reference({"tilt": (1e-9,)}, {"tilt": (0.0,)}, ())
    assert true_errors({"tilt": (2e-9,)}, reference, ()) == {}
