"""Linear systems: both libraries against dense algebra, and a reduced basis against full complex solutions."""

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from fem.model.symmetry_models import MeshSpecification
from fem.results.lateral_stiffness import SidewaysModel
from fem.solution import STABLE, UNKNOWN, Stability
from fem.solve import reduced_basis
from fem.solve.direct_solver import SingularMatrixError, Solver, have_pardiso
from fem.solve.path_state import about
from fem.solve.press import solve_press
from fem.solve.reduced_basis import reduce
from geometry.bad_input import SolveFailed
from geometry.design import Design

RNG = np.random.default_rng(3)
LIBRARIES = sorted({False, have_pardiso()})


@pytest.fixture(params=LIBRARIES, ids=lambda pardiso: "pardiso" if pardiso else "qdldl")
def solver(request):
    return Solver(pardiso=request.param)


def saddle():
    """A symmetric matrix (7, 7) with five positive and two negative eigenvalues."""
    A, B = RNG.normal(size=(5, 5)), RNG.normal(size=(2, 5))
    return np.block([[A @ A.T + np.eye(5), B.T], [B, -0.1 * np.eye(2)]])


def upper(matrix):
    """The upper triangle; its pattern has all of the diagonal."""
    return sp.csr_matrix(np.triu(matrix))


def test_an_unsymmetric_matrix_is_taken_whole_and_says_nothing_of_its_eigenvalues(solver):
    matrix, b = saddle() + np.triu(RNG.normal(size=(7, 7))), RNG.normal(size=7)
    solver.factorise(sp.csr_matrix(matrix), symmetric=False)
    np.testing.assert_allclose(solver.solve(b), np.linalg.solve(matrix, b), rtol=1e-9, atol=1e-12)
    assert solver.stability(0).is_unknown


@pytest.fixture(scope="module", params=[0.3, 0.4998, 0.5], ids="nu {}".format)
def buckling(request):
    """Tangents of sideways motions of a slender beam before and beyond its onset, and their number of pressures.

    They are upper triangles (n, n) of saddle points, whose pressures have negative eigenvalues, and the diagonal does
    not dominate most of their rows.
    """
    shape = Design(L=40.0).shape.scaled(1 / 8)
    section = MeshSpecification(shape, request.param, "ignored", 0.3, 0.15, rim=(0.14, 0.02))
    (sideways,), tangents = SidewaysModel(section.build(), section.size).orders, []
    for depth in (0.03, 0.1):
        state, stop = solve_press(section, depth)
        assert not stop
        here = about(state, sideways)
        tangents.append(here.d.system.assemble(here.d.system.state(here.q), here.plate).tangent)
    return tangents, sideways.system.n_pressure


@pytest.mark.parametrize("library", [None, *LIBRARIES], ids=lambda library: f"pardiso {library}")
def test_the_verdict_is_that_of_the_eigenvalues_of_a_saddle_point(buckling, library):
    (before, beyond), pressures = buckling
    solver, counted, eigenvalues = Solver(pardiso=library), [], []
    # from one matrix to the next and back, because qdldl and PARDISO keep the analysis of the first
    for tangent in (before, beyond, before):
        whole = (tangent + sp.triu(tangent, 1).T).toarray()
        assert np.mean(2 * np.abs(whole.diagonal()) < np.abs(whole).sum(axis=1)) > 0.9
        eigenvalues.append(np.count_nonzero(np.linalg.eigvalsh(whole) < 0) - pressures)
        solver.factorise(tangent)
        counted.append(solver.stability(pressures).directions)
    assert counted == eigenvalues
    assert [number > 0 for number in counted] == [False, True, False]


@pytest.mark.parametrize("library", LIBRARIES)
def test_a_condensed_saddle_point_has_the_verdict_of_the_whole(buckling, library):
    tangents, pressures = buckling
    solver, kept, verdicts = Solver(pardiso=library), np.arange(20, 60), []
    for tangent in tangents:
        added = 1e-4 * np.eye(len(kept))
        verdicts.append(solver.stability_with(solver.condense(tangent, kept), added, pressures))
        changed = (tangent + sp.triu(tangent, 1).T).toarray()
        changed[np.ix_(kept, kept)] += added
        assert verdicts[-1].directions == np.count_nonzero(np.linalg.eigvalsh(changed) < 0) - pressures
    assert [verdict.is_unstable for verdict in verdicts] == [False, True]


def test_a_matrix_that_qdldl_does_not_factorise_is_solved_and_its_inertia_is_unknown():
    """An update of qdldl stops at a zero pivot without a word."""
    b, good, solver = RNG.normal(size=(7, 2)), saddle(), Solver(pardiso=False)
    for matrix, known in ((good, True), (pairs_of_pivots(), False), (good, True)):
        solver.factorise(with_diagonal(matrix))
        np.testing.assert_allclose(solver.solve(b), np.linalg.solve(matrix, b), rtol=1e-8, atol=1e-10)
        assert solver.stability(0) == (Stability(2) if known else UNKNOWN)
    condensed = solver.condense(with_diagonal(pairs_of_pivots()), np.array([0, 3, 5]))
    assert condensed is None


def test_what_is_no_count_is_unknown_and_never_a_truth_value(solver):
    solver.factorise(upper(saddle()))
    # fewer negative pivots than pressures
    assert solver.stability(3) == UNKNOWN
    with pytest.raises(TypeError, match="may be unknown"):
        bool(STABLE)
    with pytest.raises(SingularMatrixError, match="not finite"):
        solver.factorise(upper(saddle() * np.nan))


def springs(foundation: float) -> sp.csr_matrix:
    """A chain of 12 000 springs on a foundation, in whose absence it is singular, beside two negative unknowns."""
    n = 12_000
    chain = sp.diags([np.full(n, 2 + foundation), np.full(n - 1, -1.0)], [0, 1]).tolil()
    chain[0, 0] = chain[n - 1, n - 1] = 1 + foundation
    return sp.block_diag([chain, -sp.eye(2)], format="csr")


@pytest.mark.skipif(not have_pardiso(), reason="needs the extra `fast`")
@pytest.mark.parametrize(("foundation", "single"), [(0.1, True), (1e-10, False)])
def test_large_matrices_have_factors_in_single_precision_where_these_are_accurate(foundation, single):
    """2 + 1e-10 is 2 in single precision."""
    matrix, solver = springs(foundation), Solver()
    n = matrix.shape[0]
    b = RNG.normal(size=n)
    # also on a path that becomes too stiff for them
    solver.factorise(springs(0.1), single=True)
    solver.factorise(matrix, single=True)
    x = solver.solve(b)
    residual = matrix @ x + matrix.T @ x - matrix.diagonal() * x - b
    negative, own = solver.stability(0), solver._factors[True].single
    assert np.linalg.norm(residual) < (1e-6 if single else 1e-14) * np.linalg.norm(x)
    assert (negative, own) == (Stability(2), single)


def pairs_of_pivots() -> np.ndarray:
    """A symmetric matrix (7, 7) with a zero diagonal, which has no pivots of single unknowns."""
    A = RNG.normal(size=(7, 7))
    return A + A.T - 2 * np.diag(A.diagonal())


def with_diagonal(matrix: np.ndarray) -> sp.csr_matrix:
    """The upper triangle of a dense matrix, with zeros as entries."""
    n = len(matrix)
    rows, columns = np.triu_indices(n)
    return sp.csr_matrix((matrix[rows, columns], (rows, columns)), shape=(n, n))


KEPT = [(library, saddle) for library in LIBRARIES] + [(True, pairs_of_pivots)] * have_pardiso()


@pytest.mark.parametrize(("pardiso", "matrix_of"), KEPT)
def test_unknowns_that_are_kept_get_the_schur_complement(pardiso, matrix_of):
    solver = Solver(pardiso=pardiso)
    kept, inner = np.array([1, 4, 6]), np.array([0, 2, 3, 5])
    b = RNG.normal(size=7)
    # twice, because the second condensation reuses the analysis of the first
    for matrix in (matrix_of(), matrix_of()):
        schur = solver.condense(with_diagonal(matrix), kept)
        inside = np.linalg.solve(matrix[np.ix_(inner, inner)], matrix[np.ix_(inner, kept)])
        dense = matrix[np.ix_(kept, kept)] - matrix[np.ix_(kept, inner)] @ inside
        np.testing.assert_allclose(schur, dense, rtol=1e-9, atol=1e-12)
        half = solver.forward(b)
        x = solver.backward(half, np.linalg.solve(schur, half[kept]))
        np.testing.assert_allclose(x, np.linalg.solve(matrix, b), rtol=1e-9, atol=1e-12)


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
    assert system.factorisations < len(C) / 4
    y = system.small.solve(C, EIGENVALUES)
    for i in range(len(C)):
        x = full(problem, C[i], EIGENVALUES[i])
        assert np.linalg.norm(system.V @ y[i] - x) < 1e-8 * np.linalg.norm(x)


def test_the_error_bounds_the_tolerance_that_was_asked_for():
    loose, tight = (reduce(chain(), C, EIGENVALUES, tolerance) for tolerance in (1e-3, 1e-9))
    assert loose.error < 1e-3
    assert tight.error < 1e-9
    assert loose.V.shape[1] < tight.V.shape[1]
    # rounding errors end the search
    assert reduce(chain(20), C, EIGENVALUES, 1e-30).error < 1e-12
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


@pytest.mark.parametrize(("eigenvalues", "most"), [(0 * EIGENVALUES, 4), (EIGENVALUES, None)], ids=["slow", "fast"])
def test_an_incompressible_solid_has_solutions_of_full_accuracy(eigenvalues, most):
    """Without mass x = (u / (1 + c), p): slopes by c are pressures alone, unseen by a small system."""
    problem = incompressible()
    system = reduce(problem, C, eigenvalues)
    y = system.small.solve(C, eigenvalues)
    if most:  # the static solutions, and their derivatives by lambda
        assert system.V.shape[1] <= most
        assert np.linalg.cond(system.small.K) < 1e6
    for i in range(len(C)):
        u = full(problem, C[i], eigenvalues[i])[: problem.moving]
        assert np.linalg.norm(system.V[: problem.moving] @ y[i] - u) < 1e-7 * np.linalg.norm(u)
