"""Weights of integrals over time steps: exact for polynomials, and of the third order."""

import numpy as np
import pytest

from fem.analyses.time_steps import product_weights

UNEVEN = (0.3, 0.5, 1.1, 1.2)


@pytest.mark.parametrize("degrees", [(0, 1), (1, 1), (1, 2), (2, 3), (3, 3)])
@pytest.mark.parametrize("first", [0, 2])
def test_polynomials_up_to_the_third_degree_are_exact(degrees: tuple[int, int], first: int) -> None:
    (a, b), times = degrees, np.array(UNEVEN)
    exact = b / (a + b) * (times[-1] ** (a + b) - times[first] ** (a + b))
    assert times**a @ product_weights(UNEVEN, first) @ times**b == pytest.approx(exact)


def test_the_first_step_of_a_motion_is_a_trapezoid() -> None:
    x, y = np.array([0.0, 4.0]), np.array([0.0, 2.0])
    assert x @ product_weights((0.0, 2.0), 0) @ y == pytest.approx(4.0)


def test_errors_of_the_last_steps_are_of_the_fifth_order() -> None:
    def error(step: float) -> float:
        times = np.arange(4) * step
        exact = np.diff([3 * np.exp(t) * (np.cos(3 * t) + 3 * np.sin(3 * t)) / 10 for t in times[2:]])[0]
        return abs(np.exp(times) @ product_weights(tuple(times.tolist()), 2) @ np.sin(3 * times) - exact)

    assert np.log2(error(0.02) / error(0.01)) > 4.5
