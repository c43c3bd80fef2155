"""Solutions of a linear system at many frequencies, by a reduced basis.

The system is A(c, lambda) x = b with A = K + c R - lambda M: K the stiffness at rest, R its part that relaxes,
c = (g - rest) / rest complex, and lambda real and proportional to the frequency squared. All three matrices are real
and symmetric, so A is complex symmetric. A basis V of a few real vectors carries the solutions of all frequencies:

    x = V y,        (V^T A V) y = V^T b.

V grows until the error is small at every frequency. In each round, Re A is factorised at the frequency with the
largest error. V gains the answers to the residual there (its real and imaginary parts) and their derivatives by c and
by lambda, which are solutions with the same factor. The pressures' equations have no damping, no mass and no load:
every vector satisfies them, so V needs no pressures of its own, and the small system is as stable as the large one.
For the same reason a vector of pressures alone, by which solutions of an incompressible solid may differ, would have
a row of zeros in the small system: vectors are independent only if their displacements are. The small system does not
depend on errors of the pressures to first order, since the energy is stationary in them.

The error is measured by K^-1 r, the static answer to the residual r = b - A x, over x: unlike r itself it does not
grow with the stiffness of the plate's springs. It is exact for a slow load and of the size of the error elsewhere; at
a resonance the error is larger by the amplification.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray

from fem.solution import Stability
from fem.solve.direct_solver import Solver, multiply
from geometry.arrays import Array, Ints
from geometry.bad_input import SolveFailed

TOLERANCE, ACCEPTED = 1e-9, 1e-6
"""Largest error at any frequency, see the module docstring, and largest one where rounding errors end its fall."""

BATCH = 1 << 17
"""Entries of projected matrices that are solved at a time, in 2 MB."""

Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """One system.

    Attributes
    ----------
    K, R, M : upper triangles (n, n) of one pattern, zeros included, which a solver keeps from its first matrix.
    b : (n, k) right-hand sides.
    moving : number of unknowns that are displacements; the pressures come after them.
    """

    K: sp.csr_matrix
    R: sp.csr_matrix
    M: sp.csr_matrix
    b: Array
    moving: int

    def at(self, c: float, eigenvalue: float) -> sp.csr_matrix:
        """Return the upper triangle of K + c R - lambda M."""
        data = self.K.data + c * self.R.data - eigenvalue * self.M.data
        return sp.csr_matrix((data, self.K.indices, self.K.indptr), shape=self.K.shape)


@dataclass(frozen=True, slots=True, eq=False)
class SmallSystem:
    """The system on the span of a basis of m vectors: projected matrices (m, m), and right-hand sides b (m, k)."""

    K: Array
    R: Array
    M: Array
    b: Array

    def solve(self, c: Complex, eigenvalues: Array) -> Complex:
        """Return y (f, m, k) at frequencies with c (f,) and lambda (f,)."""
        y = np.empty((len(c), *self.b.shape), dtype=np.complex128)
        step = max(BATCH // self.K.size, 1)
        for first in range(0, len(c), step):
            batch = slice(first, first + step)
            A = self.K + c[batch, None, None] * self.R - eigenvalues[batch, None, None] * self.M
            y[batch] = np.linalg.solve(A, self.b.astype(np.complex128))
        return y


@dataclass(frozen=True, slots=True, eq=False)
class ReducedSystem:
    """A basis, the system on its span, and what measures its error.

    V : (n, m) basis, whose displacements are orthonormal.
    small : the system on its span.
    sample : (s,) rows over which the error is measured.
    static, W : (s, k) and (s, 2 m) these rows of K^-1 b, and of the columns of K^-1 R V and -K^-1 M V in turn.
    factorisations : number of factorisations with which the basis was built.
    stability : that of the body at rest.
    error : largest error at the frequencies for which it was built.
    """

    V: Array
    small: SmallSystem
    sample: Ints
    static: Array
    W: Array
    factorisations: int
    stability: Stability
    error: float = np.inf

    def errors(self, c: Complex, eigenvalues: Array, y: Complex | None = None) -> Array:
        """Return the error (f,) at frequencies, see the module docstring; y : solutions there."""
        y = self.small.solve(c, eigenvalues) if y is None else y
        return _errors(self.static, self.V[self.sample], self.W, y, c, eigenvalues)

    def extend(self, vectors: Array, problem: Problem, static_solver: Solver) -> ReducedSystem:
        """Return the system with vectors (n, j) of `_independent` added; `static_solver` has factorised K."""
        V = np.hstack([self.V, vectors])
        K, R, M = (multiply(matrix, vectors) for matrix in (problem.K, problem.R, problem.M))
        loads = np.stack([R, -M], axis=2).reshape(len(V), -1)
        small, b = self.small, V.T @ problem.b
        K, R, M = (_bordered(old, V.T @ columns) for old, columns in ((small.K, K), (small.R, R), (small.M, M)))
        return replace(
            self,
            V=V,
            small=SmallSystem(K, R, M, b),
            W=np.hstack([self.W, _refined(static_solver, problem.K, loads)[self.sample]]),
        )


def reduce(
    problem: Problem, c: Complex, eigenvalues: Array, tolerance: float = TOLERANCE, *, most_rounds: int = 40
) -> ReducedSystem:
    """Return the reduced system whose error is below a tolerance at frequencies with c (f,) and lambda (f,).

    It raises SolveFailed where it does not reach the tolerance, or K is singular.

    most_rounds : rounds, each with one factorisation; a sensor under a plate needs some ten.
    """
    n, residual, worst = len(problem.b), problem.b, 0
    best: ReducedSystem | None = None
    # the error's norm is that of 300 displacements, spread over all: all would take as much time as the solutions
    sample = np.unique(np.linspace(0, problem.moving - 1, 300).astype(np.int64))
    static_solver, moving = Solver(), Solver()
    static_solver.factorise(problem.K)
    static, stability = _refined(static_solver, problem.K, problem.b), static_solver.stability(n - problem.moving)
    none, no_rows = np.empty((0, 0)), np.empty((len(sample), 0))
    small = SmallSystem(none, none, none, none)
    system = ReducedSystem(np.empty((n, 0)), small, sample, static[sample], no_rows, 1, stability)
    # with the static solutions the slow limit is exact
    system = system.extend(_independent(static, system.V, problem.moving), problem, static_solver)
    for rounds in range(1, most_rounds + 1):
        shifted = problem.at(float(c[worst].real), float(eigenvalues[worst]))
        moving.factorise(shifted)
        vectors = _independent(_local_vectors(moving, shifted, problem, residual), system.V, problem.moving)
        if vectors.size:
            system = system.extend(vectors, problem, static_solver)
        y = system.small.solve(c, eigenvalues)
        errors = system.errors(c, eigenvalues, y)
        worst = int(np.argmax(errors))
        if best is None or errors[worst] < best.error:
            best = replace(system, factorisations=rounds + 1, error=float(errors[worst]))
        # after three rounds without a smaller error it is one of rounding
        if not vectors.size or best.error < tolerance or rounds >= best.factorisations + 2:
            break
        residual = _residual(problem, system.V @ y[worst], complex(c[worst]), float(eigenvalues[worst]))
    assert best is not None
    if best.error > max(tolerance, ACCEPTED):
        raise SolveFailed(f"the reduced basis has an error of {best.error:.2g}, above {tolerance:g}")
    return best


def _residual(problem: Problem, x: Complex, c: complex, eigenvalue: float) -> Array:
    """Return real and imaginary parts (n, 2 k) of b - A x."""
    columns, k = np.hstack([x.real, x.imag]), x.shape[1]
    K, R, M = (multiply(matrix, columns) for matrix in (problem.K, problem.R, problem.M))
    r = -K - c.real * R + eigenvalue * M
    r[:, :k] += problem.b + c.imag * R[:, k:]
    r[:, k:] -= c.imag * R[:, :k]
    return r


def _bordered(old: Array, columns: Array) -> Array:
    """Return a symmetric matrix (m + j, m + j) from its first part (m, m) and its last columns (m + j, j)."""
    m = len(old)
    return np.block([[old, columns[:m]], [columns[:m].T, columns[m:]]])


def _refined(solver: Solver, A: sp.csr_matrix, b: Array) -> Array:
    """Return the solution of A x = b by the factors of A, its upper triangle, with one step of iterative refinement.

    Without it the pressures' equations have rounding errors that an almost incompressible solid amplifies.
    """
    x = solver.solve(b)
    return np.asarray(x + solver.solve(b - multiply(A, x)))


def _local_vectors(solver: Solver, A: sp.csr_matrix, problem: Problem, b: Array) -> Array:
    """Return the solutions for b (n, k) at the factorised frequency, and their derivatives by c and lambda."""
    first = _refined(solver, A, b[:, b.any(axis=0)])  # without damping there is no imaginary part
    second = _refined(solver, A, np.hstack([multiply(matrix, first) for matrix in (problem.R, problem.M)]))
    return np.hstack([first, second])


def _independent(vectors: Array, V: Array, moving: int) -> Array:
    """Return vectors (n, j) that extend V (n, m) by the span of `vectors`, with orthonormal displacements.

    Vectors with the same displacements, the first `moving` rows, are one vector here: the projected system says
    nothing about a pressure without displacements, which an incompressible solid has, and would be singular.
    """
    sizes = np.linalg.norm(vectors, axis=0)
    vectors = vectors[:, sizes > 0] / sizes[sizes > 0]
    for _ in range(2):  # the first pass leaves rounding errors, the second one does not
        vectors = vectors - V @ (V[:moving].T @ vectors[:moving])
    for _ in range(2):
        factor, order = scipy.linalg.qr(vectors[:moving], mode="r", pivoting=True, check_finite=False)
        # shorter ones add only rounding errors
        count = np.count_nonzero(np.abs(np.diag(factor)) > TOLERANCE)
        vectors = scipy.linalg.solve_triangular(factor[:count, :count], vectors[:, order[:count]].T, trans="T").T
        vectors = vectors - V @ (V[:moving].T @ vectors[:moving])
    return np.asarray(vectors)


def _errors(static: Array, V: Array, W: Array, y: Complex, c: Complex, eigenvalues: Array) -> Array:
    """Return the error at each frequency (f,): the norm of K^-1 r over that of x, the larger one of all columns.

    K^-1 r = K^-1 b - (V + c K^-1 R V - lambda K^-1 M V) y.

    static, V, W : rows of K^-1 b (n, k), of the basis (n, m), and `ReducedSystem.W`, over which the norms are taken.
    y : (f, m, k) solutions.
    """
    (f, m, k), rows = y.shape, len(static)
    columns = np.ascontiguousarray(y.transpose(1, 0, 2).reshape(m, f * k))
    x, relaxing, moving = ((matrix @ columns).reshape(rows, f, k) for matrix in (V, W[:, ::2], W[:, 1::2]))
    rest = static[:, None] - x - c[:, None] * relaxing - eigenvalues[:, None] * moving
    return np.asarray((np.linalg.norm(rest, axis=0) / np.linalg.norm(x, axis=0)).max(axis=1))
