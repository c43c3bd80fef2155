"""Designs sampled over all input ranges: solids, mould and meshes are good, or refused for a reason that is named.

A Sobol sequence spans D, the stem L - D/2, and the magnet's diameter, height / diameter and edge radius, all but the
last one on a log scale; a tenth of the samples lies at each end of each range, so that extremes meet in one design.
"""

import math

import numpy as np
import pytest
import skfem
from scipy.stats import qmc

from fem.accuracy import QUICK, STANDARD
from geometry import cad
from geometry.design import BadInput, Design
from geometry.fabrication import mold_solids
from geometry.mesh import tetrahedra
from geometry.meshing.mesh_quality import quality
from geometry.mold import Mold
from geometry.section import section

WALL, LEAST_STEM, LEAST_DIAMETER, LEAST_HEIGHT, SLENDER = 0.15, 0.05, 0.2, 0.1, (0.1, 4.0)
"""Wall that the largest magnet leaves, least L - D/2, diameter and height of a magnet, mm; height / diameter."""


def sample(x):
    """The fields of the design at a point of the unit cube."""
    D = 50 ** x[0]
    stem = LEAST_STEM * (9.5 * D / LEAST_STEM) ** x[1]
    ratio = SLENDER[0] * (SLENDER[1] / SLENDER[0]) ** x[3]
    least = max(LEAST_DIAMETER, LEAST_HEIGHT / ratio)
    most = min(2 * (D / 2 - WALL) / math.hypot(1, ratio), 2 * (stem - WALL) / ratio)
    wide = least * (max(most, least) / least) ** x[2]
    sizes = {
        "D": D,
        "L": D / 2 + stem,
        "magnet_diameter": wide,
        "magnet_height": ratio * wide,
        "l0": D / 2 + stem + 1,
    }
    return sizes | {"magnet_edge_radius": x[4] * min(wide, ratio * wide) / 4}


def samples(count):
    points = qmc.Sobol(5, seed=1960).random_base2(math.ceil(math.log2(count)))[:count]
    return [sample(x) for x in np.clip((points - 0.1) / 0.8, 0.0, 1.0).tolist()]


FOUND = samples(64)


def test_samples_reach_the_ends_and_half_of_the_designs_are_possible():
    D = [one["D"] for one in FOUND]
    assert (min(D), max(D)) == (1, 50)
    assert max(one["L"] / one["D"] for one in FOUND) == pytest.approx(10)
    assert min(one["magnet_diameter"] for one in FOUND) == LEAST_DIAMETER
    refused = list(filter(None, map(refusal, FOUND)))
    assert len(refused) == 20
    assert all("needs at least 0.1 mm: take a smaller magnet" in said for said in refused)


def refusal(sizes):
    try:
        Design(**sizes)
    except BadInput as error:
        return str(error)
    return ""


@pytest.mark.parametrize("number", [20, 21])
def test_a_design_of_the_range_has_sound_solids_and_meshes(number):
    """A small disc in a beam of 50 mm, and a magnet close to the base."""
    design = Design(**FOUND[number])
    shape, choices = design.shape, Mold()
    beam, magnet = cad.beam_volume(shape), cad.magnet_volume(shape)
    bodies = ((cad.beam(design), beam), (cad.magnet(design), magnet), (cad.silicone(design), beam - magnet))
    for body, volume in bodies:
        assert body.is_valid
        assert body.volume == pytest.approx(volume, rel=1e-9)
    assert all(
        check.passed for check in mold_solids.checks(design, choices, *mold_solids.closed_mold(design, choices))
    )
    mesh = section(shape, STANDARD.section_size * shape.D)
    basis = skfem.Basis(mesh, skfem.ElementTriP2(), intorder=6)
    assert 2 * math.pi * (basis.global_coordinates()[0] * basis.dx).sum() == pytest.approx(beam - magnet, rel=1e-5)
    measured = quality(tetrahedra(shape, QUICK.solid_size * design.D), shape)
    assert max(map(abs, measured["volume_errors"].values())) < 1e-5
    assert abs(measured["base_error"]) < 1e-4
    assert measured["least_jacobian"] > 0.05
