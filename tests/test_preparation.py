"""Loading of the compiled loops."""

import numpy as np
import pytest

from fem import material, preparation
from geometry import compiled

pytest.importorskip("numba", reason="the loops need the extra `fast`")


def test_prepared_loops_are_used():
    assert preparation.prepare()
    with compiled.uncompiled():
        assert not preparation.prepare()


def test_the_small_section_has_a_magnet_and_elements_at_it():
    system = preparation.small_section(material.neo_hookean, 1)
    assert system.n_rigid == 3
    assert np.isin(system.elements.cells, system.glued).any()


def test_examples_are_all_laws():
    assert {material.numbered(material.law(*example))[0] for example in preparation.EXAMPLES.items()} == {0, 1, 2, 3}
