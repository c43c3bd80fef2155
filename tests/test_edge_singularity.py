"""Elements at the edge of a glued area: places of their nodes, contact beside them, and errors of a gripped shear."""

import math
from dataclasses import replace

import numpy as np
import pytest
import skfem

from fem.accuracy import QUICK
from fem.equilibrium import solve
from fem.model import elements
from geometry.bad_input import MeshError
from geometry.design import paper
from geometry.loads import Load
from geometry.section import PLACE, section

SHAPE = paper().shape.scaled(1 / 8)
RIM = (0.3, 0.012)


def test_only_sides_at_the_rim_are_graded():
    plain, glued = (section(SHAPE, 0.16, tip_size=0.08, rim=RIM, glued=way) for way in (False, True))
    assert plain.nelements > glued.nelements
    start, end = glued.facets
    middle = glued.doflocs[:, glued.nvertices :]
    length = np.linalg.norm(glued.p[:, end] - glued.p[:, start], axis=0)
    share = np.linalg.norm(middle - glued.p[:, start], axis=0) / length
    at = np.hypot(glued.p[0] - RIM[0], glued.p[1] - SHAPE.H - math.sqrt(0.25 - RIM[0] ** 2)) < 1e-9
    assert np.count_nonzero(at) == 1
    assert share[at[start]] == pytest.approx(PLACE, abs=0.002)
    assert share[at[end]] == pytest.approx(1 - PLACE, abs=0.002)
    assert share[~at[start] & ~at[end]] == pytest.approx(0.5, abs=0.01)


def test_a_gripped_shear_hardly_depends_on_the_elements_at_its_edge():
    """With middle nodes in the middle, the force at 0.024 D is 0.4 % above that at 0.006 D."""
    load = Load(shear_x=2.0, grip=1.0)
    fine, coarse = (
        solve(paper(), load, replace(QUICK, section_patch=patch), model="harmonic").response
        for patch in (0.006, 0.024)
    )
    assert coarse.force[0] == pytest.approx(fine.force[0], rel=2e-3)
    assert coarse.tilt == pytest.approx(fine.tilt, rel=2e-3)


def test_an_inverted_element_is_refused():
    mesh = section(SHAPE, 0.25)
    corner = mesh.t[0, 0]
    places = mesh.doflocs.copy()
    # beyond the opposite side
    places[:, corner] += 3 * (places[:, mesh.t[1:, 0]].mean(axis=1) - places[:, corner])
    with pytest.raises(MeshError, match=r"folded elements, and \d+ pairs of neighbours that overlap"):
        elements.build(type(mesh)(places, mesh.t), axisymmetric=True)
    straight = skfem.MeshTri(places[:, : mesh.nvertices], mesh.t)
    with pytest.raises(MeshError, match=r"has 0 folded elements, and [1-9]\d* pairs"):
        elements.build(skfem.MeshTri2.from_mesh(straight), axisymmetric=True)
