"""Floating-point operations and bytes that the linear algebra of a solve needs at least.

- A factorisation L D L^T of a symmetric matrix whose columns of L have c_j entries takes sum c_j^2 operations and
  writes sum c_j numbers. The entries are those of a minimum-degree order.
- An assembly of the tangent sums, over m elements with q points, a nodes, f fields and t angles, the products
  A_JL,fg = sum_theta V_f A V_g and K_afbg = sum_JL D_Ja D_Lb A_JL,fg, of a symmetric matrix:
  m q (9 f^2 t + 9 a f^2 + 3 a^2 f^2) operations, and it reads and writes the derivatives and the matrix once.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from studies.output.records import FlatRow

FLOAT = 8
"""Bytes of a number."""


@dataclass(slots=True)
class Counts:
    """Operations and bytes of the factorisations and assemblies so far."""

    factorisations: int = 0
    assemblies: int = 0
    factor_flops: float = 0.0
    factor_bytes: float = 0.0
    assembly_flops: float = 0.0
    assembly_bytes: float = 0.0
    known: dict[tuple[int, int], tuple[float, float]] = field(default_factory=dict)

    def row(self) -> FlatRow:
        """Return the counts as JSON."""
        return {name: getattr(self, name) for name in self.__slots__ if name != "known"}


@contextlib.contextmanager
def counted() -> Iterator[Counts]:
    """Count factorisations and assemblies of tangents within this context."""
    from fem.model.nonlinear_system import System
    from fem.solve.direct_solver import Solver

    counts = Counts()
    plain = Solver.factorise, Solver.condense, System.assemble

    def factorise(self: Any, matrix: sp.csr_matrix, *args: Any, **named: Any) -> Any:
        _add_factorisation(counts, matrix)
        return plain[0](self, matrix, *args, **named)

    def condense(self: Any, matrix: sp.csr_matrix, *args: Any, **named: Any) -> Any:
        _add_factorisation(counts, matrix)
        return plain[1](self, matrix, *args, **named)

    def assemble(self: Any, *args: Any, **named: Any) -> Any:
        if named.get("tangent", True):
            _add_assembly(counts, self)
        return plain[2](self, *args, **named)

    Solver.factorise, Solver.condense, System.assemble = factorise, condense, assemble  # type: ignore[method-assign]
    try:
        yield counts
    finally:
        Solver.factorise, Solver.condense, System.assemble = plain  # type: ignore[method-assign]


def factorisation(matrix: sp.csr_matrix) -> tuple[float, float]:
    """Return operations and bytes of the factorisation of a symmetric matrix, given as its upper triangle.

    >>> factorisation(sp.csr_matrix(np.triu(np.ones((3, 3)))))
    (14.0, 48.0)
    """
    pattern = (matrix + matrix.T).tocsc()
    pattern.data[:] = -1.0
    # a dominant diagonal: rows are not exchanged, and the entries depend on the pattern alone
    dominant = pattern + sp.diags(np.asarray(abs(pattern).sum(axis=0)).ravel() + 2.0)
    lu = spla.splu(
        dominant.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    columns = np.diff(lu.L.tocsc().indptr).astype(np.float64)
    return float((columns**2).sum()), float(FLOAT * columns.sum())


def _add_factorisation(counts: Counts, matrix: sp.csr_matrix) -> None:
    key = matrix.shape[0], matrix.nnz
    if key not in counts.known:
        counts.known[key] = factorisation(matrix)
    flops, size = counts.known[key]
    counts.factorisations += 1
    counts.factor_flops += flops
    counts.factor_bytes += size


def _add_assembly(counts: Counts, system: Any) -> None:
    e = system.elements
    m, q, _, a = e.D.shape
    f, t = e.angles.fields, len(e.angles.theta)
    counts.assemblies += 1
    counts.assembly_flops += m * q * f * f * (9.0 * t + 9.0 * a + 3.0 * a * a)
    counts.assembly_bytes += FLOAT * (e.D.size + m * (a * f) ** 2 / 2)
