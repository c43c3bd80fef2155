"""Solutions of a linear system at many frequencies, by a reduced basis.

The system is A(c, lambda) x = b with A = K + c R - lambda M: K the stiffness at rest, R its part that relaxes,
c = (g - rest) / rest complex, and lambda real and proportional to the frequency squared. All three matrices are real
and symmetric, so A is complex symmetric. A basis V of a few real vectors carries the solutions of all frequencies:

    x = V y,        (V^T A V) y = V^T b.

V grows until the error is small at every frequency. In each round, Re A is factorised at the frequency with the
largest error. V gains the answers to the residual there (its real and imaginary parts) and their derivatives by c and
by lambda, which are solutions with the same factor. The pressures' equations have no damping, no mass and no load:
every vector satisfies them, so V needs no pressures of its own, and the small system is as stable as the large one.

The error is measured by K^-1 r, the static answer to the residual r = b - A x, over x: unlike r itself it does not
grow with the stiffness of the plate's springs. It is exact for a slow load and of the size of the error elsewhere; at
a resonance the error is larger by the amplification.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray

from fem.solvers.direct_solver import Solver
from geometry.arrays import Array

TOLERANCE, ACCEPTED = 1e-9, 1e-6
"""Largest error at any frequency, see the module docstring, and largest one where rounding errors end its fall."""
MOST_ROUNDS = 40
"""Most rounds, each with one factorisation; a sensor under a plate needs some ten."""
PATIENCE = 3
"""Rounds without a smaller error after which it is one of rounding."""
DEPENDENT = 1e-9
"""Share of a vector's length beyond the span of the basis below which it adds only rounding errors."""

SAMPLED = 300
"""Number of displacements, spread over all, from which the error's norm is computed: all would take as much time as
the solutions."""

Complex = NDArray[np.complex128]


class NotReachedError(ArithmeticError):
    """The basis did not reach the tolerance."""


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """One system.

    Attributes
    ----------
    K, R, M : upper triangles (n, n).
    b : (n, k) right-hand sides.
    moving : number of unknowns that are displacements; the pressures come after them.
    """

    K: sp.csr_matrix
    R: sp.csr_matrix
    M: sp.csr_matrix
    b: Array
    moving: int


@dataclass(frozen=True, slots=True, eq=False)
class ReducedSystem:
    """The system on the span of a basis.

    Attributes
    ----------
    V : (n, m) orthonormal basis.
    K, R, M, b : projected matrices (m, m), and right-hand sides (m, k).
    factorisations : number of factorisations with which the basis was built.
    unstable : number of unstable directions at rest; None where it is not known.
    error : largest error at the frequencies for which it was built.
    """

    V: Array
    K: Array
    R: Array
    M: Array
    b: Array
    factorisations: int
    unstable: int | None
    error: float = np.inf

    def solve(self, c: Complex, eigenvalues: Array) -> Complex:
        """Return y (f, m, k) at frequencies with c (f,) and lambda (f,)."""
        A = self.K + c[:, None, None] * self.R - eigenvalues[:, None, None] * self.M
        return np.asarray(np.linalg.solve(A, np.broadcast_to(self.b, (len(c), *self.b.shape)).astype(complex)))


@dataclass(frozen=True, slots=True, eq=False)
class _Basis:
    """Vectors and their products.

    Attributes
    ----------
    V, KV, RV, MV : orthonormal vectors (n, m), and K, R and M times these.
    W : (n, 2 m) columns of K^-1 R V and -K^-1 M V in turn.
    """

    V: Array
    KV: Array
    RV: Array
    MV: Array
    W: Array

    def extend(self, vectors: Array, whole: Sequence[sp.csr_matrix], at_rest: Solver) -> _Basis:
        """Return the basis with orthonormal vectors (n, j) added; `at_rest` has factorised K."""
        K, R, M = (np.asarray(matrix @ vectors) for matrix in whole)
        answers = _refined(at_rest, whole[0], np.stack([R, -M], axis=2).reshape(len(R), -1))
        new = (vectors, K, R, M, answers)
        old = (self.V, self.KV, self.RV, self.MV, self.W)
        return _Basis(*(np.hstack(pair) for pair in zip(old, new, strict=True)))

    def project(self, b: Array, rounds: int, unstable: int | None) -> ReducedSystem:
        """Return the system for right-hand sides b (n, k) on the span of the basis."""
        V = self.V
        return ReducedSystem(V, V.T @ self.KV, V.T @ self.RV, V.T @ self.MV, V.T @ b, rounds + 1, unstable)

    def residual(self, b: Array, y: Complex, c: complex, eigenvalue: float) -> Array:
        """Return real and imaginary parts (n, 2 k) of b - A V y."""
        r = b - self.KV @ y - c * (self.RV @ y) + eigenvalue * (self.MV @ y)
        return np.hstack([r.real, r.imag])


def reduce(problem: Problem, c: Complex, eigenvalues: Array, tolerance: float = TOLERANCE) -> ReducedSystem:
    """Return the reduced system whose error is below a tolerance at frequencies with c (f,) and lambda (f,).

    Raises
    ------
    NotReachedError
        The basis did not reach the tolerance.
    SingularMatrixError
        K is singular.
    """
    whole = [_whole(matrix) for matrix in (problem.K, problem.R, problem.M)]
    n, residual, worst = len(problem.b), problem.b, 0
    best: ReducedSystem | None = None
    basis = _Basis(*(np.empty((n, 0)) for _ in range(5)))
    sample = np.unique(np.linspace(0, problem.moving - 1, SAMPLED).astype(np.int64))
    at_rest, moving = Solver(), Solver()
    try:
        at_rest.factorise(problem.K)
        static, negative = _refined(at_rest, whole[0], problem.b), at_rest.negative()
        unstable = None if negative is None else negative - (n - problem.moving)
        # with the static solutions the slow limit is exact
        basis = basis.extend(_orthonormal(static, basis.V), whole, at_rest)
        for rounds in range(1, MOST_ROUNDS + 1):
            moving.factorise((problem.K + c[worst].real * problem.R - eigenvalues[worst] * problem.M).tocsr())
            shifted = whole[0] + c[worst].real * whole[1] - eigenvalues[worst] * whole[2]
            vectors = _orthonormal(_local_vectors(moving, shifted, whole, residual), basis.V)
            if vectors.size:
                basis = basis.extend(vectors, whole, at_rest)
            system = basis.project(problem.b, rounds, unstable)
            y = system.solve(c, eigenvalues)
            errors = _errors(static[sample], basis.V[sample], basis.W[sample], y, c, eigenvalues)
            worst = int(np.argmax(errors))
            if best is None or errors[worst] < best.error:
                best = replace(system, error=float(errors[worst]))
            if not vectors.size or best.error < tolerance or rounds >= best.factorisations - 1 + PATIENCE:
                break
            residual = basis.residual(problem.b, y[worst], complex(c[worst]), float(eigenvalues[worst]))
    finally:
        at_rest.close()
        moving.close()
    assert best is not None
    if best.error > max(tolerance, ACCEPTED):
        raise NotReachedError(f"the reduced basis has an error of {best.error:.2g}, above {tolerance:g}")
    return best


def _refined(solver: Solver, A: sp.csr_matrix, b: Array) -> Array:
    """Return the solution of A x = b by the factors of A, with one step of iterative refinement.

    Without it the pressures' equations have rounding errors that an almost incompressible solid amplifies.
    """
    x = solver.solve(b)
    return np.asarray(x + solver.solve(b - A @ x))


def _local_vectors(solver: Solver, A: sp.csr_matrix, whole: Sequence[sp.csr_matrix], b: Array) -> Array:
    """Return the solutions for b (n, k) at the factorised frequency and their derivatives by c and lambda (n, 3 k).

    All are scaled to unit length.
    """
    first = _refined(solver, A, b[:, b.any(axis=0)])  # without damping there is no imaginary part
    second = _refined(solver, A, np.hstack([np.asarray(matrix @ first) for matrix in whole[1:]]))
    return np.hstack([block / np.linalg.norm(block, axis=0) for block in (first, second)])


def _orthonormal(vectors: Array, V: Array) -> Array:
    """Return orthonormal vectors (n, j) that extend an orthonormal basis V (n, m) by the span of `vectors`."""
    for _ in range(2):  # the first pass leaves rounding errors, the second one does not
        vectors = vectors - V @ (V.T @ vectors)
    Q, sizes, _ = scipy.linalg.qr(vectors, mode="economic", pivoting=True)
    Q = Q[:, np.abs(np.diag(sizes)) > DEPENDENT]
    Q -= V @ (V.T @ Q)
    return np.asarray(np.linalg.qr(Q)[0])


def _errors(static: Array, V: Array, W: Array, y: Complex, c: Complex, eigenvalues: Array) -> Array:
    """Return the error at each frequency (f,): the norm of K^-1 r over that of x, the larger one of all columns.

    K^-1 r = K^-1 b - (V + c K^-1 R V - lambda K^-1 M V) y.

    Parameters
    ----------
    static, V, W : rows of K^-1 b (n, k), of the basis (n, m), and of `_Basis.W`, over which the norms are taken.
    y : (f, m, k) solutions.
    """
    (f, m, k), rows = y.shape, len(static)
    columns = np.ascontiguousarray(y.transpose(1, 0, 2).reshape(m, f * k))
    x, relaxing, moving = ((matrix @ columns).reshape(rows, f, k) for matrix in (V, W[:, ::2], W[:, 1::2]))
    rest = static[:, None] - x - c[:, None] * relaxing - eigenvalues[:, None] * moving
    return np.asarray((np.linalg.norm(rest, axis=0) / np.linalg.norm(x, axis=0)).max(axis=1))


def _whole(upper: sp.csr_matrix) -> sp.csr_matrix:
    """Return a symmetric matrix from its upper triangle."""
    return (upper + sp.triu(upper, 1).T).tocsr()
