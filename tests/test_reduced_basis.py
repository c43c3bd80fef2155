"""Solutions at many frequencies by a reduced basis, against full complex solutions."""

import tracemalloc

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from fem.solve import reduced_basis
from fem.solve.reduced_basis import reduce
from geometry.bad_input import SolveFailed


def given(K, R, M, b, moving):
    """A problem whose matrices have all entries of an upper triangle, zeros too."""
    at = np.triu_indices(len(b))
    return reduced_basis.Problem(*(sp.csr_matrix((A.toarray()[at], at)) for A in (K, R, M)), b, moving)


def chain(n=60):
    """A chain of masses on springs of which every third one does not relax, pulled at its end and in its middle."""
    stiffness = 1.0 + 0.3 * np.sin(np.arange(n + 1))
    relaxing = np.where(np.arange(n + 1) % 3, stiffness, 0.0)

    def assembled(k):
        return sp.diags([k[:-1] + k[1:], -k[1:-1]], [0, 1], format="csr")

    b = np.zeros((n, 2))
    b[-1, 0], b[n // 2, 1] = 1.0, 1.0
    return given(assembled(stiffness), assembled(relaxing), sp.eye(n, format="csr"), b, n)


def full(problem, c, eigenvalue):
    K, R, M = (matrix + sp.triu(matrix, 1).T for matrix in (problem.K, problem.R, problem.M))
    return spla.spsolve((K + c * R - eigenvalue * M).tocsc(), problem.b.astype(complex))


C = np.geomspace(1e-3, 0.3, 40) + 0.1j
EIGENVALUES = np.linspace(0.0, 0.2, 40)


def test_reduced_solutions_equal_full_ones_at_every_frequency():
    problem = chain()
    system = reduce(problem, C, EIGENVALUES)
    y = system.solve(C, EIGENVALUES)
    for i in range(len(C)):
        x = full(problem, C[i], EIGENVALUES[i])
        assert np.linalg.norm(system.V @ y[i] - x) < 1e-8 * np.linalg.norm(x)


def test_fewer_factorisations_are_made_than_there_are_frequencies():
    assert reduce(chain(), C, EIGENVALUES).factorisations < len(C) / 4


def test_the_error_bounds_the_tolerance_that_was_asked_for():
    loose, tight = (reduce(chain(), C, EIGENVALUES, tolerance) for tolerance in (1e-3, 1e-9))
    assert loose.error < 1e-3
    assert tight.error < 1e-9
    assert loose.V.shape[1] < tight.V.shape[1]


def test_rounding_errors_end_the_search():
    assert reduce(chain(20), C, EIGENVALUES, 1e-30).error < 1e-12


def test_a_basis_that_misses_the_tolerance_is_reported():
    with pytest.raises(SolveFailed, match="above 1e-09"):
        reduce(chain(), C, EIGENVALUES, most_rounds=1)


def test_unstable_directions_at_rest_are_counted():
    problem = chain(20)
    soft = problem.K - 0.03 * sp.eye(20, format="csr")
    lowest = np.linalg.eigvalsh((soft + sp.triu(soft, 1).T).toarray())
    shifted = given(soft.tocsr(), problem.R, problem.M, problem.b, 20)
    unstable = reduce(shifted, C, EIGENVALUES).stability.directions
    assert unstable == np.count_nonzero(lowest < 0) > 0


def incompressible(n=30, pressures=5):
    """A chain all of which relaxes, with constraints on its displacements: its tangent has a block of zeros."""
    whole, rng = chain(n), np.random.default_rng(3)
    B = rng.normal(size=(n, pressures))

    def padded(matrix, constraints):
        return sp.bmat([[matrix, constraints], [None, sp.csr_matrix((pressures, pressures))]], format="csr")

    b = np.vstack([whole.b, np.zeros((pressures, 2))])
    return given(padded(whole.K, B), padded(whole.K, 0 * B), padded(whole.M, 0 * B), b, n)


def test_solutions_that_differ_in_their_pressures_only_are_one_vector():
    # x = (u / (1 + c), p): the derivatives by c are pressures alone, about which the small system would say nothing
    problem = incompressible()
    system = reduce(problem, C, np.zeros(len(C)))
    y = system.solve(C, np.zeros(len(C)))
    assert system.V.shape[1] <= 4  # the static solutions, and their derivatives by lambda
    assert np.linalg.cond(system.K) < 1e6
    for i in range(len(C)):
        u = full(problem, C[i], 0.0)[: problem.moving]
        assert np.linalg.norm(system.V[: problem.moving] @ y[i] - u) < 1e-8 * np.linalg.norm(u)


def test_an_incompressible_solid_with_mass_has_solutions_of_full_accuracy():
    problem = incompressible()
    system = reduce(problem, C, EIGENVALUES)
    y = system.solve(C, EIGENVALUES)
    for i in range(len(C)):
        u = full(problem, C[i], EIGENVALUES[i])[: problem.moving]
        assert np.linalg.norm(system.V[: problem.moving] @ y[i] - u) < 1e-7 * np.linalg.norm(u)


def test_the_small_systems_of_many_frequencies_are_never_held_together():
    system = reduce(chain(), C, EIGENVALUES)
    m, many = len(system.K), 4000
    c, eigenvalues = np.resize(C, many), np.resize(EIGENVALUES, many)
    tracemalloc.start()
    system.solve(c, eigenvalues)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < many * m**2 * 16 / 4
