"""Order of the unknowns in a band, and the layout of its rows."""

import numpy as np
import scipy.sparse as sp


def grid(n, m):
    """Upper triangle of the Laplacian of a grid, n by m, whose unknowns are numbered at random."""
    line = [sp.diags([np.ones(k - 1), np.ones(k - 1)], [-1, 1]) for k in (n, m)]
    K = sp.kron(sp.eye(n), line[1]) + sp.kron(line[0], sp.eye(m)) + 5 * sp.eye(n * m)
    p = np.random.default_rng(2).permutation(n * m)
    return sp.triu(K.tocsr()[p][:, p], format="csr")


def test_the_band_of_a_long_grid_is_as_wide_as_the_grid():
    from fem.solvers import band_compiled

    K = grid(30, 4)
    order = band_compiled.order_unknowns(K.indptr, K.indices, 1000)
    position = np.argsort(order)
    entries = K.tocoo()
    assert np.abs(position[entries.row] - position[entries.col]).max() <= 7
    assert sorted(order) == list(range(120))


def test_rows_of_a_panel_end_together_and_later_rows_not_before():
    from fem.solvers import band_compiled

    K = grid(6, 5)
    order = band_compiled.order_unknowns(K.indptr, K.indices, 1000)
    end, start, places = np.empty(32, dtype=np.int64), np.empty(32, dtype=np.int64), np.empty(K.nnz, dtype=np.int64)
    size = band_compiled.lay_out(K.indptr, K.indices, order, end, start, places)
    assert (np.diff(end) >= 0).all()
    assert (end.reshape(8, 4) == end[3::4, None]).all()
    np.testing.assert_array_equal(np.diff(start), (end - np.arange(32) + 1)[:-1])
    assert len(set(places)) == K.nnz
    assert places.max() < size
