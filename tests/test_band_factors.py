"""Factors of small matrices in a band, against dense algebra and PARDISO or SuperLU."""

import numpy as np
import pytest
import scipy.sparse as sp
from test_nonlinear_system import plate, smooth

from fem.solvers import band_factors
from fem.solvers.direct_solver import Solver
from fem.solvers.inertia import UNKNOWN, Stability
from fem.solvers.pardiso import SingularMatrixError
from geometry import compiled


def tangent(name="sensor"):
    system, flat = plate(name, 0.02)
    q = smooth(system)
    return system.assemble(system.admissible(q), flat).tangent


def whole(upper):
    return upper.toarray() + np.triu(upper.toarray(), 1).T


@pytest.mark.parametrize("name", ["cylinder", "sensor"])
def test_solutions_and_signs_are_those_of_dense_algebra(name):
    K = tangent(name)
    factors, b = band_factors.band_factors(K), np.random.default_rng(1).normal(size=(K.shape[0], 3))
    assert factors.factorise(K)
    np.testing.assert_allclose(whole(K) @ factors.solve(b), b, atol=1e-9)
    np.testing.assert_array_equal(factors.solve(b[:, 0]), factors.solve(b)[:, 0])
    assert factors.negative == np.count_nonzero(np.linalg.eigvalsh(whole(K)) < 0)


@pytest.mark.parametrize(("n", "width"), [(1, 1), (5, 2), (8, 5), (11, 6), (12, 12), (13, 9)])
def test_rows_of_any_number_and_width_are_eliminated(n, width):
    rng = np.random.default_rng(n)
    K = np.triu(np.tril(rng.normal(size=(n, n)), width - 1)) + 4 * n * np.diag(rng.choice([-1, 1], n))
    factors, b = band_factors.band_factors(sp.csr_matrix(K)), rng.normal(size=n)
    assert factors.factorise(sp.csr_matrix(K))
    np.testing.assert_allclose(factors.solve(b), np.linalg.solve(K + np.triu(K, 1).T, b), rtol=1e-10)


def test_an_unknown_that_is_coupled_with_all_others_lies_outside_the_band():
    n = 40
    K = sp.diags([np.full(n, 4.0), np.full(n - 1, -1.0)], [0, 1]).tolil()
    K[7, 8:] = 0.3
    K[:7, 7] = 0.3
    K[7, 7] = -0.5
    K = K.tocsr()
    factors = band_factors.BandFactors(K)
    assert factors._order[-1] == 7
    assert factors.factorise(K)
    assert factors.negative == 1
    np.testing.assert_allclose(whole(K) @ factors.solve(np.arange(1.0, n + 1)), np.arange(1.0, n + 1), rtol=1e-12)


def test_separate_parts_are_ordered_one_after_the_other():
    K = sp.block_diag([sp.diags([[2.0] * 5, [1.0] * 4], [0, 1]), sp.eye(3), [[3.0, 1.0], [0.0, -2.0]]]).tocsr()
    factors = band_factors.BandFactors(K)
    assert sorted(factors._order) == list(range(10))
    assert factors.factorise(K)
    assert factors.negative == 1
    np.testing.assert_allclose(whole(K) @ factors.solve(np.ones(10)), np.ones(10), rtol=1e-12)


def test_a_matrix_that_needs_other_pivots_is_left_to_the_library():
    K = sp.csr_matrix((np.array([0.0, 1.0, 0.0]), np.array([0, 1, 1]), np.array([0, 2, 3])), shape=(2, 2))
    assert not band_factors.BandFactors(K).factorise(K)
    solver = Solver()
    solver.factorise(K)
    np.testing.assert_allclose(solver.solve(np.array([2.0, 3.0])), [3.0, 2.0])
    assert solver.stability(0) in (Stability(1), UNKNOWN)
    solver.close()


def test_a_singular_matrix_is_refused():
    K = sp.csr_matrix((np.array([1.0, 1.0, 1.0]), np.array([0, 1, 1]), np.array([0, 2, 3])), shape=(2, 2))
    assert not band_factors.BandFactors(K).factorise(K)
    with pytest.raises(SingularMatrixError):
        Solver().factorise(sp.csr_matrix(([np.nan], [0], [0, 1]), shape=(1, 1)))


def test_large_matrices_are_left_to_the_library():
    n = band_factors.MOST_UNKNOWNS
    assert band_factors.band_factors(sp.eye(n + 1, format="csr")) is None
    assert band_factors.band_factors(sp.csr_matrix(np.triu(np.ones((800, 800))))) is None


@pytest.mark.parametrize("corner", [0.0, -0.5, 30.0])
def test_two_unknowns_that_are_coupled_with_all_others_lie_outside_the_band(corner):
    n = 60
    K = sp.diags([np.full(n, 4.0), np.full(n - 1, -1.0)], [0, 1]).tolil()
    for i, value in ((7, 0.3), (20, -0.2)):
        K[i, i + 1 :] = value
        K[:i, i] = value
        K[i, i] = corner
    K = K.tocsr()
    factors = band_factors.BandFactors(K)
    assert sorted(factors._order[-2:]) == [7, 20]
    assert factors.factorise(K)
    assert factors.negative == np.count_nonzero(np.linalg.eigvalsh(whole(K)) < 0)
    b = np.random.default_rng(1).normal(size=(n, 2))
    np.testing.assert_allclose(whole(K) @ factors.solve(b), b, atol=1e-13)
    np.testing.assert_allclose(factors.solve(b[:, 0]), factors.solve(b)[:, 0], atol=1e-13)


def test_a_singular_matrix_with_two_unknowns_outside_the_band_is_refused():
    n = 60
    K = sp.diags([np.full(n, 4.0)], [0]).tolil()
    K[7, 8:] = K[20, 21:] = K[:7, 7] = K[:20, 20] = 1.0
    K[7, 7], K[7, 20] = (n - 2) / 4, (n - 2) / 4
    K[20, 20] = (n - 2) / 4
    K = K.tocsr()
    factors = band_factors.BandFactors(K)
    assert sorted(factors._order[-2:]) == [7, 20]
    assert not factors.factorise(K)


def test_only_the_first_matrices_of_a_larger_pattern_are_factorised_in_a_band():
    n = band_factors.SMALL_UNKNOWNS + 1
    K = sp.diags([np.full(n, 4.0), np.full(n - 1, -1.0)], [0, 1]).tocsr()
    solver, answers = Solver(), []
    for turn in range(1, band_factors.MOST_TURNS + 2):
        solver.factorise(K)
        assert (solver.band is None) == (turn > band_factors.MOST_TURNS)
        answers.append(solver.solve(np.ones(n)))
    solver.close()
    np.testing.assert_allclose(answers[-1], answers[0], rtol=1e-12)


def test_the_solver_takes_the_band_unless_a_library_is_named():
    K = tangent()
    solver, named = Solver(), Solver(pardiso=False)
    with compiled.uncompiled():
        other = Solver()
        other.factorise(K)
    solver.factorise(K)
    named.factorise(K)
    assert solver.band is not None
    assert other.band is named.band is None
    b = np.ones(K.shape[0])
    np.testing.assert_allclose(solver.solve(b), other.solve(b), rtol=1e-7, atol=1e-9 * abs(other.solve(b)).max())
    assert solver.stability(0) == other.stability(0)
    other.close()
