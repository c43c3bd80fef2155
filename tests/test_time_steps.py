"""Integrals over time steps: exact for polynomials, and continued from one motion to the next."""

import numpy as np
import pytest

from fem.analyses.time_steps import TimeIntegral, begin

UNEVEN = (0.0, 0.3, 0.5, 1.1, 1.2, 2.0)


def _integrate(degrees: tuple[int, int], times: tuple[float, ...], start: TimeIntegral | None = None) -> TimeIntegral:
    def values(t: float) -> tuple[np.ndarray, np.ndarray]:
        return np.array([t ** degrees[0], 1.0]), np.array([t ** degrees[1], -2.0])

    integral = begin(times[0], *values(times[0]), total=start.total if start else 0.0)
    for t in times[1:]:
        integral = integral.add(t, *values(t))
    return integral


@pytest.mark.parametrize("degrees", [(0, 1), (1, 1), (1, 2), (2, 3), (3, 3)])
@pytest.mark.parametrize("count", [4, 5, 6])
def test_polynomials_up_to_the_third_degree_are_exact(degrees: tuple[int, int], count: int) -> None:
    a, b = degrees
    end = UNEVEN[count - 1]
    assert _integrate(degrees, UNEVEN[:count]).total == pytest.approx(b / (a + b) * end ** (a + b))


def test_the_first_step_of_a_motion_is_a_trapezoid() -> None:
    assert _integrate((1, 1), (0.0, 2.0)).total == pytest.approx(2.0)
    assert _integrate((2, 1), (0.0, 2.0)).total == pytest.approx(4.0)


def test_a_motion_continues_the_integral_before() -> None:
    first = _integrate((1, 2), UNEVEN[:4])
    second = _integrate((1, 2), UNEVEN[3:], first)
    assert second.total == pytest.approx(2 / 3 * UNEVEN[-1] ** 3, rel=1e-12)


def test_errors_are_of_the_third_order_or_better() -> None:
    def error(n: int) -> float:
        times = np.linspace(0, 1, n + 1)
        integral = begin(0.0, np.array([1.0]), np.array([0.0]))
        for t in times[1:]:
            integral = integral.add(float(t), np.array([np.exp(t)]), np.array([np.sin(3 * t)]))
        exact = (3 * (np.exp(1) * (np.cos(3) + 3 * np.sin(3)) - 1)) / 10
        return abs(integral.total - exact)

    assert np.log2(error(20) / error(40)) > 2.9
