"""The table of start poses: the bins of readings of each cell."""

import itertools

import numpy as np

from analytic import decode
from analytic.inverse.start_table import BINS, MARGIN
from geometry.design import paper


def test_a_cell_is_listed_in_the_bins_that_its_box_and_its_slabs_reach():
    """Bin by bin: each of the three slabs has the bin's centre nearer than its reach in the bin's direction."""
    table = decode.decoder(paper(), cells=(2, 2, 2)).table
    edges = np.column_stack([table.low.min(axis=0), table.bin_edges, table.high.max(axis=0)])
    listed = {
        (index, int(cell))
        for index in range(BINS**3)
        for cell in table.members[table.first[index] : table.first[index + 1]]
    }
    bins = np.array(list(itertools.product(range(BINS), repeat=3))).T
    low, high = (np.take_along_axis(edges, bins + k, axis=1) for k in (0, 1))
    for cell in range(8):
        near = ((low <= table.high[cell][:, None]) & (high >= table.low[cell][:, None])).all(axis=0)
        for row in table.maps[:, cell]:
            u, reach = row[:3] @ (low + high) / 2 + row[3], np.abs(row[:3]) @ (high - low) / 2
            near &= np.abs(u) <= 0.5 + MARGIN + reach
        assert {(int(index), cell) for index in np.flatnonzero(near)} == {pair for pair in listed if pair[1] == cell}
