"""The jig for the magnet: its checks on right and wrong parts, what it refuses, and what the recipe says of it."""

import dataclasses
import math

import pytest

from geometry import cad
from geometry.array_design import grid_array
from geometry.design import BadInput, Design
from geometry.fabrication import magnet_jig, mold_solids, solid_files
from geometry.fabrication.engraved_marks import MARGIN
from geometry.fabrication.mold_solids import printable
from geometry.fabrication.printability import standing
from geometry.mold import Mold, sizes
from studies.fabrication.casting_recipe import recipe_of
from studies.fabrication.sensor_solids import FabricationChoices

LONG = Design(D=12, L=24, l0=10.5, magnet_diameter=4, magnet_height=10)
FLAT = Design(D=12, L=14, l0=10.5, magnet_diameter=6, magnet_height=1)
BARE = Design(magnet_diameter=0, magnet_height=0, magnet_edge_radius=0)
CASES = [
    (Design(), Mold()),
    (Design(magnet_north="up"), Mold(columns=2, rows=2, shrink=0.01, pocket_gap=-0.1)),
    (LONG, Mold(process="sla", draft=1, shrink=0.02)),
    (Design(), Mold(columns=5, split=1, pocket_gap=0.2)),
]


def parts_of(design, mold):
    jig = magnet_jig.lengths(design, mold)
    return jig, magnet_jig.solids(design, mold, jig), mold_solids.closed_mold(design, mold)[1]


@pytest.fixture(scope="module")
def usual():
    return parts_of(Design(), Mold())


def test_letters_stand_beside_the_bores_whose_poles_they_are():
    design = dataclasses.replace(Design(), magnet_north="up")
    for pitch in (16.0, 11.0):
        mold = Mold(array=grid_array(design, 2, 3, pitch, "checkerboard"))
        s, jig = sizes(design, mold), magnet_jig.lengths(design, mold)
        found = magnet_jig.marks(mold, s, jig)
        # the base looks down at the mould: its north pole up is S here
        assert [letter for letter, _, _ in found] == list("SNSNSN")
        for (_, (x, y), size), (u, v) in zip(found, s.centres, strict=True):
            assert size >= 5 * mold.printing.stroke
            assert y == v
            assert u + jig.collar <= x - 0.33 * size
            near = [math.hypot(max(abs(x - p) - 0.33 * size, 0), max(abs(y - q) - size / 2, 0)) for p, q in s.centres]
            assert min(near) >= jig.collar + MARGIN - 1e-9
    alike = Mold(array=grid_array(design, 2, 3, 16.0))
    assert len(magnet_jig.marks(alike, sizes(design, alike), magnet_jig.lengths(design, alike))) == 1


def failed(parts, B, jig, design=Design()):
    return {check.name for check in magnet_jig.checks(design, Mold(), jig, parts, B) if not check.passed}


@pytest.mark.parametrize(("design", "mold"), CASES)
def test_every_check_passes_and_parts_print_without_support(design, mold):
    jig, parts, B = parts_of(design, mold)
    assert [check for check in magnet_jig.checks(design, mold, jig, parts, B) if not check.passed] == []
    for name, part in parts.items():
        assert part.is_valid
        stood = standing(part, upside_down=name in ("jig", "jig_plunger"))
        mesh = solid_files.facets(name, stood, design.D / 500)
        assert [check for check in printable(name, mesh, mold.printing) if not check.passed] == []


@pytest.mark.parametrize(("design", "mold"), CASES)
def test_the_magnet_lies_where_it_belongs_after_shrinkage(design, mold):
    """The silicone's pocket shrinks and the magnet does not: its centre ends at H of the shrunk beam."""
    jig, s = magnet_jig.lengths(design, mold), sizes(design, mold)
    bottom = (jig.depth + design.magnet_height) * (1 - mold.shrink)
    assert bottom - design.magnet_height / 2 == pytest.approx(design.H, abs=1e-12)
    assert jig.depth < s.pin_depth
    assert jig.pole == ("S" if design.magnet_north == "up" else "N")


def pushed(solid, z):
    return cad.moved(solid, (0.0, 0.0, z))


def test_wrong_parts_are_found(usual):
    import build123d as bd

    jig, parts, B = usual
    assert failed(parts, B, jig) == set()
    low = parts | {"jig_plunger": pushed(parts["jig_plunger"], 0.01)}
    assert failed(low, B, jig) == {
        "plunger's end above the magnet's top",
        "overlap of B, jig, plungers, bar and magnet",
    }
    wide = cad.cut(parts["jig"], bd.Solid.make_cylinder(2.3, 20, bd.Plane((0, 0, -5))))
    assert failed(parts | {"jig": wide}, B, jig) == {
        "gap on each side between magnet and bore",
        "gap on each side between plunger and bore",
        "magnet's diagonal less the bore, or it turns over",
    }
    block = bd.Solid.make_box(4, 4, 1, bd.Plane((sizes(Design(), Mold()).reach[1] - 2, -2, 11)))
    closed = parts | {"jig_bar": parts["jig_bar"].fuse(block).solids()[0]}
    assert failed(closed, B, jig) == {"overlap of the screws with B, jig and bar"}
    hook = bd.Solid.make_box(1, 1, 1, bd.Plane((sizes(Design(), Mold()).inner - 0.5, 0, -4)))
    assert "overlap while the jig leaves B" in failed(parts | {"jig": parts["jig"].fuse(hook).solids()[0]}, B, jig)
    other, taller, _ = parts_of(Design(magnet_height=3), Mold())
    assert "plunger's end above the magnet's top" in failed(taller, B, other)


def test_the_gauge_is_a_tenth_shorter_and_longer_than_the_depth(usual):
    jig, parts, _ = usual
    ends = sorted({round(vertex.Y, 9) for vertex in parts["jig_gauge"].vertices()})
    body = max(2 * jig.bore, 5) + 3
    assert (-ends[0], ends[-1] - body) == pytest.approx((jig.depth - 0.1, jig.depth + 0.1))
    # its tongues go into the pocket: no corner is farther from the axis than the plunger's end
    tongue = [vertex for vertex in parts["jig_gauge"].vertices() if vertex.Y < -0.5]
    thick = max(vertex.Z for vertex in tongue)
    assert math.hypot(max(vertex.X for vertex in tongue), thick / 2) < jig.tip


@pytest.mark.parametrize(
    ("design", "mold", "text"),
    [
        (FLAT, Mold(), r"diagonal of 6.05 mm must exceed the jig's bore of 6.2 mm, .* more than 1.8 mm high"),
        (Design(magnet_height=4, magnet_edge_radius=2), Mold(), "diagonal of 4 mm must exceed"),
        (Design(magnet_diameter=1.5, magnet_height=2), Mold(), "plunger must be 1.5 mm thick at least and is 1.3 mm"),
        (Design(L=5.3, l0=5, magnet_height=2), Mold(), "top must lie 0.5 mm below the base plane at least"),
        (Design(magnet_diameter=7, magnet_height=3), Mold(wall=0.5, columns=2), "set wall to "),
    ],
)
def test_a_jig_that_is_impossible_is_left_out_with_a_reason_or_refused(design, mold, text):
    jig, reason = magnet_jig.planned(design, mold)
    assert jig is None
    assert reason.startswith("no jig for the magnet: ")
    with pytest.raises(BadInput, match=text):
        magnet_jig.lengths(design, mold)
    with pytest.raises(BadInput, match=text):
        magnet_jig.planned(design, dataclasses.replace(mold, jig=1))


def test_the_height_that_the_refusal_names_is_enough():
    for edge in (0.0, 0.1, 0.3):
        thin = Design(D=12, L=14, l0=10.5, magnet_diameter=6, magnet_height=1, magnet_edge_radius=edge)
        with pytest.raises(BadInput) as caught:
            magnet_jig.lengths(thin, Mold())
        least = float(str(caught.value).split("more than ")[1].split()[0])
        enough = Design(D=12, L=14, l0=10.5, magnet_diameter=6, magnet_height=least, magnet_edge_radius=edge)
        assert 0 < magnet_jig.lengths(enough, Mold()).diagonal - 6.2 < 0.1


def test_no_jig_without_a_magnet_or_where_none_is_wanted():
    assert magnet_jig.planned(BARE, Mold()) == (None, "")
    assert magnet_jig.planned(Design(), Mold(jig=0)) == (None, "")
    with pytest.raises(BadInput, match="magnet_diameter must be positive for a jig"):
        magnet_jig.planned(BARE, Mold(jig=1))


def test_screws_of_the_jig_reach_through_bar_and_nut(usual):
    jig, *_ = usual
    found = recipe_of(Design(), FabricationChoices())["jig"]
    assert found["bore_mm"] == pytest.approx(4.2)
    assert found["end_mm"] == pytest.approx(3.8)
    # 3 mm of lug under the joint, 7 of lid, 3 of collar, 5 of bar, and 3.5 for washer, nut and a turn of thread
    assert jig.lid + 3 + jig.bar == 15
    assert found["screw_mm"] >= 3 + 15 + 3.5
