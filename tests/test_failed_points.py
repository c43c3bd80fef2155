"""Fillings and bounds of failed points: those of every combination of values between the least and the largest."""

import itertools

import numpy as np
import pytest

from studies.sensitivity.failed_points import evaluated, fillings, squared_differences, variances


def test_another_model_replaces_a_failed_value_where_it_has_one():
    values, substitute = np.array([1.0, np.nan, np.nan, 5.0]), np.array([9.0, 2.0, np.nan, 9.0])
    estimate, least, largest = fillings(values, substitute)
    assert estimate.tolist() == [1.0, 2.0, 3.0, 5.0]
    assert least.tolist() == [1.0, 1.0, 1.0, 5.0]
    assert largest.tolist() == [1.0, 5.0, 5.0, 5.0]


def test_values_without_failures_are_their_own_filling_and_failures_alone_have_none():
    assert [one.tolist() for one in fillings(np.array([1.0, 2.0]))] == [[1.0, 2.0]]
    assert fillings(np.full(3, np.nan)) == []


def test_bounds_hold_for_every_filling_and_are_reached():
    one, other = np.array([0.3, np.nan, 0.9, np.nan]), np.array([0.7, 0.4, np.nan, np.nan])
    grid = np.linspace(0, 1, 11)
    differences, spread = [], []
    for a, b, c, d in itertools.product(grid, repeat=4):
        x, y = np.array([0.3, a, 0.9, b]), np.array([0.7, 0.4, c, d])
        differences.append((x - y) ** 2)
        spread.append(np.r_[x, y].var())
    least, most = squared_differences(one, other, 0.0, 1.0)
    assert least == pytest.approx(np.min(differences, axis=0), abs=1e-12)
    assert most == pytest.approx(np.max(differences, axis=0), abs=1e-12)
    low, high = variances(np.r_[one, other], 0.0, 1.0)
    assert low <= min(spread) < low + 1e-3
    assert high == pytest.approx(max(spread))


def test_infinite_values_are_failures():
    assert np.isnan(evaluated(lambda x: np.array([np.inf, np.nan]), np.zeros((2, 1)))).all()
