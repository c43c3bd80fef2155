"""The stand of the curing mould and the fixture of the base on a load cell."""

import dataclasses

import pytest

from geometry.bad_input import BadInput
from geometry.base import Base, base, plan
from geometry.cad import moved
from geometry.design import Design, paper, preset
from geometry.fabrication import bench_parts
from geometry.fabrication.mold_solids import closed_mold, printable
from geometry.fabrication.printability import standing
from geometry.fabrication.solid_files import facets
from geometry.mold import Mold, sizes


@pytest.mark.parametrize(
    ("design", "mold"),
    [(paper(), Mold(columns=2, split=1)), (preset("foot"), Mold(process="sla"))],
    ids=["split", "foot"],
)
def test_a_mould_stands_on_three_pads_in_a_tray_for_all_its_silicone(design, mold):
    s = sizes(design, mold)
    stand, (_, B) = bench_parts.stand(s), closed_mold(design, mold)
    solid = bench_parts.stand_solid(s, stand)
    assert len(solid.solids()) == 1
    assert all(check.passed for check in bench_parts.stand_checks(s, stand, solid, B))
    assert all(check.passed for check in printable("stand", facets("stand", standing(solid), 0.01), mold.printing))
    # the weight lies inside the triangle of the pads, and that of the screws is wider than B
    (a, b), (c, d), (e, f) = stand.pads
    assert a < 0 < c
    assert b == d < 0 < f
    assert a < e < c
    assert stand.screws[1][0] > max(x for x, _ in s.centres) + s.rim


def test_a_stand_without_room_or_under_a_higher_mould_is_noticed():
    s = sizes(paper(), Mold())
    stand, (_, B) = bench_parts.stand(s), closed_mold(paper(), Mold())
    solid = bench_parts.stand_solid(s, stand)
    assert all(check.passed for check in bench_parts.stand_checks(s, stand, solid, B))
    lifted = moved(B, (0.0, 0.0, 0.5))
    assert [check.passed for check in bench_parts.stand_checks(s, stand, solid, lifted)] == [True, False, True]
    flat = dataclasses.replace(stand, rim=0.3)
    assert not bench_parts.stand_checks(s, flat, bench_parts.stand_solid(s, flat), B)[2].passed


@pytest.mark.parametrize(
    ("choices", "cell"),
    [(Base(), ""), (Base(shape="round"), "tal220"), (Base(screw=0.0), ""), (Base(outer=40.0), "")],
    ids=["screws", "round", "square", "large"],
)
def test_a_fixture_holds_the_base_over_the_load_cell(choices, cell):
    """Its screws are beside the base, and its axis over the middle of the cell unless the base is too large."""
    p, process = plan(paper(), choices), Mold().printing
    fixture = bench_parts.fixture(p, process, cell)
    solid = bench_parts.fixture_solid(p, process, fixture)
    assert len(solid.solids()) == 1
    checks = bench_parts.fixture_checks(p, fixture, solid, base(p))
    assert all(check.passed for check in checks), checks
    assert all(check.passed for check in printable("fixture", facets("fixture", standing(solid), 0.01), process))
    assert (fixture.off == 0.0) is (choices.outer is None)
    assert all(x - bench_parts.HEAD * fixture.cell.thread / 2 > p.half for x, _ in fixture.holes)


def test_the_deflection_of_a_fixture_is_that_of_a_cantilever():
    """20 mm long, 17.74 mm wide, 6 mm thick, of 3 GPa: 20^3 / (3 x 3000 x 17.74 x 6^3 / 12) mm for 1 N."""
    fixture = bench_parts.fixture(plan(paper(), Base()), Mold().printing, "tal221")
    assert fixture.compliance == pytest.approx(2.784e-3, rel=1e-3)
    assert (fixture.screw, fixture.cell_screw) == (20, 12)


def test_an_unknown_load_cell_is_named_before_anything_is_made(refusal, tmp_path):
    with pytest.raises(BadInput, match="there is no load cell 'tal22': did you mean tal221"):
        bench_parts.load_cell("tal22")
    out = tmp_path / "out"
    assert "there is no load cell 'x'" in refusal("cad", "paper", "--base", "cell=x", "--out", out)
    assert not out.exists()


def test_a_breakout_board_goes_onto_the_fixture_by_its_holes():
    design = Design(hall_layout="tmag5273a1", l0=8.0)
    p = plan(design, Base(breakout="sparkfun-tmag5273"))
    fixture = bench_parts.fixture(p, Mold().printing, "")
    solid = bench_parts.fixture_solid(p, Mold().printing, fixture)
    assert all(check.passed for check in bench_parts.fixture_checks(p, fixture, solid, base(p)))
