"""Factorisations of sparse indefinite matrices: both libraries, against dense algebra."""

import pathlib
from importlib import metadata

import numpy as np
import pytest
import scipy.sparse as sp

from fem.model.plate_contact import Plate
from fem.model.symmetry_models import MeshSpecification
from fem.results.lateral_stiffness import SidewaysModel
from fem.solve import direct_solver
from fem.solve.direct_solver import STABLE, UNKNOWN, SingularMatrixError, Solver, Stability, have_pardiso
from fem.solve.path_state import about
from fem.solve.press import solve_press
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


def test_both_linear_solvers_agree():
    system = (
        MeshSpecification(Design().shape.scaled(1 / 8), 0.4998, "rigid", 0.16, 0.08, rim=(0.2, 0.04)).build().system
    )
    q = np.zeros(system.size)
    q[system.n_free + system.n_rigid :] = 0.1 * RNG.normal(size=system.n_pressure)
    here = system.assemble(system.state(q), Plate(1.125 - 0.1, 50.0, np.zeros(2)))
    answers = []
    for library in LIBRARIES:
        solver = Solver(pardiso=library)
        solver.factorise(here.tangent)
        answers.append(solver.solve(here.residual))
    np.testing.assert_allclose(answers[0], answers[-1], atol=1e-9 * np.abs(answers[0]).max())


def test_one_solver_takes_matrices_of_a_pattern_one_after_the_other(solver):
    b = RNG.normal(size=(7, 2))
    for matrix in (saddle(), saddle()):
        solver.factorise(upper(matrix))
        np.testing.assert_allclose(solver.solve(b), np.linalg.solve(matrix, b), rtol=1e-9, atol=1e-12)


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
    (sideways,), tangents = SidewaysModel(section.build()).orders, []
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
    b, good, solver = RNG.normal(size=7), saddle(), Solver(pardiso=False)
    for matrix, known in ((good, True), (pairs_of_pivots(), False), (good, True)):
        solver.factorise(with_diagonal(matrix))
        np.testing.assert_allclose(solver.solve(b), np.linalg.solve(matrix, b), rtol=1e-8, atol=1e-10)
        assert solver.stability(0) == (Stability(2) if known else UNKNOWN)
    condensed = solver.condense(with_diagonal(pairs_of_pivots()), np.array([0, 3, 5]))
    assert condensed is None


def test_fewer_negative_pivots_than_pressures_are_no_count(solver):
    solver.factorise(upper(saddle()))
    assert solver.stability(3) == UNKNOWN


def test_a_stability_has_no_truth_value():
    with pytest.raises(TypeError, match="may be unknown"):
        bool(STABLE)


def test_a_matrix_that_is_not_finite_is_refused(solver):
    matrix = saddle()
    matrix[0, 1] = np.nan
    with pytest.raises(SingularMatrixError, match="not finite"):
        solver.factorise(upper(matrix))


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
    solver.factorise(matrix, single=True)
    x = solver.solve(b)
    residual = matrix @ x + matrix.T @ x - matrix.diagonal() * x - b
    negative, own = solver.stability(0), solver._factors[True].single
    assert np.linalg.norm(residual) < (1e-6 if single else 1e-14) * np.linalg.norm(x)
    assert (negative, own) == (Stability(2), single)


@pytest.mark.skipif(not have_pardiso(), reason="needs the extra `fast`")
def test_a_path_that_becomes_too_stiff_for_single_precision_goes_on_in_double_precision():
    solver = Solver()
    for foundation in (0.1, 1e-10):
        solver.factorise(springs(foundation), single=True)
    assert not solver._factors[True].single


@pytest.mark.skipif(not have_pardiso(), reason="needs the extra `fast`")
def test_factors_are_freed_with_their_solver(monkeypatch):
    freed, real = [], direct_solver._release
    monkeypatch.setattr(direct_solver, "_release", lambda *call: (freed.append(call), real(*call)))
    solver = Solver(pardiso=True)
    solver.factorise(upper(saddle()))
    solver.condense(upper(saddle()), np.array([1, 4]))
    assert not freed
    del solver
    assert len(freed) == 2


def pairs_of_pivots() -> np.ndarray:
    """A symmetric matrix (7, 7) with a zero diagonal, which has no pivots of single unknowns."""
    A = RNG.normal(size=(7, 7))
    return A + A.T - 2 * np.diag(A.diagonal())


def with_diagonal(matrix: np.ndarray) -> sp.csr_matrix:
    """The upper triangle of a dense matrix, with zeros as entries."""
    n = len(matrix)
    rows, columns = np.triu_indices(n)
    return sp.csr_matrix((matrix[rows, columns], (rows, columns)), shape=(n, n))


@pytest.mark.skipif(not have_pardiso(), reason="needs the extra `fast`")
def test_a_matrix_that_needs_pairs_of_pivots_gets_them():
    block, solver, count = pairs_of_pivots(), Solver(pardiso=True), 1500
    b = RNG.normal(size=7 * count)
    blocks = sp.block_diag([with_diagonal(block)] * count, format="csr")
    solver.factorise(blocks, single=True)
    x = solver.solve(b)
    np.testing.assert_allclose((x.reshape(count, 7) @ block).ravel(), b, atol=1e-9)
    assert not solver._factors[True].single


@pytest.mark.skipif(not have_pardiso(), reason="needs the extra `fast`")
def test_kept_unknowns_beside_pairs_of_pivots_get_the_schur_complement():
    matrix, solver, kept, inner = pairs_of_pivots(), Solver(pardiso=True), np.array([0, 3, 5]), [1, 2, 4, 6]
    # twice, because the second condensation reuses the analysis of the first
    for factor in (1, 2):
        schur = solver.condense(with_diagonal(factor * matrix), kept)
        inside = np.linalg.solve(matrix[np.ix_(inner, inner)], matrix[np.ix_(inner, kept)])
        dense = matrix[np.ix_(kept, kept)] - matrix[np.ix_(kept, inner)] @ inside
        np.testing.assert_allclose(schur, factor * dense, rtol=1e-9, atol=1e-12)


@pytest.mark.skipif(not have_pardiso(), reason="needs the extra `fast`")
def test_the_library_is_found_as_the_package_lists_it():
    """The quick look where pip puts it must not find another one."""
    files = [file for file in metadata.files("mkl") or [] if "mkl_rt" in file.name]
    found = direct_solver._library()
    assert found is not None
    assert found.resolve() in [pathlib.Path(str(file.locate())).resolve() for file in files]


def test_unknowns_that_are_kept_get_the_schur_complement(solver):
    kept, inner = np.array([1, 4, 6]), np.array([0, 2, 3, 5])
    b = RNG.normal(size=7)
    # twice, because the second condensation reuses the analysis of the first
    for matrix in (saddle(), saddle()):
        schur = solver.condense(upper(matrix), kept)
        inside = np.linalg.solve(matrix[np.ix_(inner, inner)], matrix[np.ix_(inner, kept)])
        dense = matrix[np.ix_(kept, kept)] - matrix[np.ix_(kept, inner)] @ inside
        np.testing.assert_allclose(schur, dense, rtol=1e-9, atol=1e-12)
        half = solver.forward(b)
        x = solver.backward(half, np.linalg.solve(schur, half[kept]))
        np.testing.assert_allclose(x, np.linalg.solve(matrix, b), rtol=1e-9, atol=1e-12)
