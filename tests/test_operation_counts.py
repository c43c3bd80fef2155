"""Operations that the linear algebra of a solve needs."""

import numpy as np
import pytest
import scipy.sparse as sp

from fem.accuracy import QUICK
from fem.equilibrium import trace
from geometry.design import paper
from geometry.loads import Load
from studies.validation import operation_counts


def test_a_chain_has_two_entries_a_column():
    n = 50
    flops, size = operation_counts.factorisation(sp.diags([np.ones(n), np.ones(n - 1)], [0, 1]).tocsr())
    assert (flops, size) == (4 * (n - 1) + 1, 8 * (2 * n - 1))


def test_a_press_is_counted():
    with operation_counts.counted() as counts:
        (state,) = trace(paper(), [Load(depth=0.3)], QUICK, magnet="ignored", estimate=False)
    assert 0 < counts.factorisations <= counts.assemblies
    # six nodes with two unknowns each: at least the products of their derivatives at three points of each element
    assert counts.assembly_flops > counts.assemblies * 50 * 3 * 4 * 9 * 6
    assert counts.factor_flops > counts.factorisations * state.dofs * 10
    with operation_counts.counted() as later:
        pass
    assert later.row() == dict.fromkeys(later.row(), 0)


@pytest.mark.parametrize("size", [3, 8])
def test_a_full_matrix_takes_the_sum_of_squares(size):
    flops, _ = operation_counts.factorisation(sp.csr_matrix(np.triu(np.ones((size, size)))))
    assert flops == sum(c * c for c in range(1, size + 1))
