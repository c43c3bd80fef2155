"""Parts of the mould against closed forms, its checks on wrong moulds, collisions and gaps with known answers."""

import itertools
import math

import numpy as np
import pytest

from geometry import cad
from geometry.array_design import ArrayDesign, grid_array
from geometry.design import BadInput, Design, preset
from geometry.fabrication import solid_files
from geometry.fabrication.engraved_marks import mold_marks
from geometry.fabrication.mold_solids import checks, closed_mold, halves, printable
from geometry.fabrication.printability import overhangs, standing
from geometry.mold import Mold, pours, sizes

BARE = {"magnet_diameter": 0, "magnet_height": 0, "magnet_edge_radius": 0}
TINY = Design(D=1, L=0.8, magnet_diameter=0.4, magnet_height=0.2, magnet_edge_radius=0.02)
FLAT, TALL = ({"D": 4, "L": 4.5, "l0": 4.1, "magnet_diameter": size, "magnet_height": size} for size in (1, 2))
CASES = [
    (Design(), Mold(shrink=0.01, pocket_gap=-0.05, fit=0.1, vents=6, marks=1)),
    (Design(magnet_height=4, magnet_edge_radius=2), Mold(shrink=0.1)),
    (TINY, Mold(fit=0.05)),
    (Design(D=50, L=1000, magnet_diameter=20, magnet_height=10, l0=50), Mold(floor=1)),
    (Design(**BARE), Mold(vents=3, vent_diameter=2)),
    (Design(magnet_edge_radius=0.5), Mold(process="sla", shrink=0.02, draft=2, tip_vent=1, pocket_gap=0.05)),
    (Design(), Mold(columns=3, rows=2, shrink=0.01, draft=1)),
    (Design(**TALL), Mold(columns=5, split=1, tip_vent=0.8, marks=1)),
    (Design(**FLAT), Mold()),
    (Design(**FLAT), Mold(process="sla", marks=1)),
]


def test_an_array_is_cast_at_its_places_seen_from_below_or_farther_apart_where_walls_are_thin():
    design, poles = Design(), np.array([1.0, -1.0, 1.0])
    for scale, pitch in ((1.0, 12.0), (0.75, 9.0)):
        array = ArrayDesign(design, scale * np.array([[5.0, 0.0], [17.0, 0.0], [11.0, 16.0]]), poles)
        s = sizes(design, Mold(array=array))
        assert array.pitch == pytest.approx(pitch)
        assert s.pitch == pytest.approx(max(pitch, design.D + s.wall))
        apart = np.array(s.centres) * array.pitch / s.pitch * [1.0, -1.0] - array.places
        assert apart == pytest.approx(np.tile(apart[0], (3, 1)), abs=1e-12)
        # the middle of the mould is that of the outermost axes
        assert np.add(*(end(s.centres, axis=0) for end in (np.min, np.max))) == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(BadInput, match="100 cavities at most; got an array of 121 beams"):
        Mold(array=grid_array(design, 11, 11, 20.0))


def test_the_checks_pass_for_the_mould_of_an_array():
    design = Design()
    mold = Mold(array=ArrayDesign(design, np.array([[0.0, 0.0], [13.0, 2.0]]), np.array([1.0, -1.0])))
    assert failed(design, mold, *closed_mold(design, mold)) == []


def failed(design, mold, A, B, pieces=()):
    return [check.name for check in checks(design, mold, A, B, pieces) if not check.passed]


def not_printable(name, part, mold, *, over=False, tolerance=0.02):
    mesh = solid_files.triangulated(standing(part, upside_down=over), tolerance)
    assert mesh.is_watertight
    return {check.name: check.value for check in printable(name, mesh, mold.printing) if not check.passed}


@pytest.mark.parametrize(("design", "mold"), CASES)
def test_every_check_passes_and_the_pours_add_up_to_the_silicone(design, mold):
    A, B = closed_mold(design, mold)
    assert A.is_valid
    assert B.is_valid
    pieces = list(halves(design, mold, B).values()) if mold.split else []
    assert failed(design, mold, A, B, pieces) == []
    for part, over in ((A, True), *((piece, False) for piece in pieces or [B])):
        assert not_printable("it", part, mold, over=over, tolerance=design.D / 500) == {}
    first, second = pours(design, mold)
    silicone = cad.beam_volume(design.shape) - cad.magnet_volume(design.shape)
    assert (first + second) * (1 - mold.shrink) ** 3 == pytest.approx(silicone, rel=1e-12)
    assert second >= 0
    # the pin is what the first pour leaves out
    s = sizes(design, mold)
    pin = cad.turned(s.pin).volume if s.pin_radius > 0 else 0.0
    assert cad.turned(s.cavity).volume - pin == pytest.approx(first, rel=1e-12)
    assert design.D < 4 or s.vent_diameter >= mold.printing.detail - 1e-9


def test_vents_grow_with_what_the_pin_drives_out_and_with_the_cavities_that_share_the_hand():
    """Hagen and Poiseuille: 20 N of a hand on all cavities drive the pins' volume through the vents in 10 s."""
    design = preset("foot")
    (one, six), pin = (sizes(design, Mold(columns=n)) for n in (1, 6)), math.pi * 4.0**2 * (design.H + 4.0)
    flow = 4 * math.pi * 20.0 / (6 * math.pi * 15.0**2) * six.vent_diameter**4 / (128 * 20e-6 * six.lid)
    assert one.pin_depth == design.H + design.magnet_height / 2 == design.H + 4.0
    assert pin / flow == pytest.approx(10.0)
    assert six.vent_diameter / one.vent_diameter == pytest.approx(6**0.25)
    assert sizes(Design(), Mold(columns=10)).vent_diameter == 1.0


def torus(radius):
    import build123d as bd

    return bd.Solid.make_torus(radius, 0.2, bd.Plane((0, 0, -3)))


def joined(one, other):
    return one.fuse(other).solids()[0]


def ring(low):
    """Silicone that lengthens the skirt of A down to a height."""
    inner = sizes(Design(), Mold()).inner
    return cad.turned([(inner, -2, 0), (inner + 3, -2, 0), (inner + 3, low, 0), (inner, low, 0)])


def plug():
    import build123d as bd

    s = sizes(Design(), Mold())
    return bd.Solid.make_cylinder(s.vent_diameter / 2, s.lid, bd.Plane((s.vent_ring, 0, 0)))


WRONG = {
    "a groove": (
        lambda A, B: (A, cad.cut(B, torus(4))),
        {"overlap while the cast leaves B", "cavity volume against beam minus pin"},
    ),
    "a collar": (lambda A, B: (joined(A, torus(2)), B), {"overlap while A leaves the cast"}),
    "a long skirt": (lambda A, B: (joined(A, ring(-9.1)), B), {"overlap of A and B in the closed mould"}),
    "a tight skirt": (
        lambda A, B: (joined(A, box(1, 1, 1, (sizes(Design(), Mold()).inner - 0.5, 0, -4))), B),
        {"overlap of A and B in the closed mould", "overlap while A leaves B"},
    ),
    "a thin wall": (lambda A, B: (A, cad.cut(B, box(4, 4, 2, (-2, -2, -13)))), {"least wall of B around the cavity"}),
    "a lug without its hole": (
        lambda A, B: (joined(A, box(4, 4, 1, (sizes(Design(), Mold()).reach[1] - 2, -2, 0))), B),
        {"overlap of the screws with A and B"},
    ),
    "a missing vent": (lambda A, B: (joined(A, plug()), B), {"distance from vents to pin and cavity wall"}),
}


@pytest.fixture(scope="module")
def mould():
    return closed_mold(Design(), Mold())


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_mould_fails_its_checks(mould, wrong):
    change, found = WRONG[wrong]
    assert found <= set(failed(Design(), Mold(), *change(*mould)))


def test_a_pocket_that_does_not_fit_is_found(mould):
    loose, other = Mold(pocket_gap=0.5), Design(magnet_height=2.2, magnet_diameter=4.2)
    assert failed(Design(), loose, *closed_mold(Design(), loose)) == ["gap around the magnet in its pocket"]
    found = failed(other, Mold(), *mould)
    assert {"distance of the magnet's end from the pocket's", "share of the magnet outside its pocket"} <= set(found)


def test_a_half_with_an_undercut_is_found():
    import build123d as bd

    design, mold = Design(), Mold(split=1)
    A, B = closed_mold(design, mold)
    one, other = halves(design, mold, B).values()
    assert (one.volume, other.volume) == pytest.approx((B.volume / 2, B.volume / 2), rel=1e-12)
    assert min(vertex.Y for vertex in one.vertices()) == pytest.approx(0, abs=1e-9)
    hook = bd.Solid.make_box(2, 4, 1, bd.Plane((3, -4, -4)))
    found = failed(design, mold, A, B, [one.fuse(hook).solids()[0], other])
    assert found == ["overlap while B1 leaves the cast"]


def holes(part, radius, axis):
    """Places of the round holes with this radius along an axis, measured on the solid."""
    found = [
        face for face in part.faces() if face.geom_type.name == "CYLINDER" and face.radius == pytest.approx(radius)
    ]
    axes = [face.axis_of_rotation for face in found]
    return [axis_of.position for axis_of in axes if abs(axis_of.direction.dot(axis)) > 0.9]


@pytest.mark.parametrize(("D", "columns"), [(8, 10), (8, 1), (12, 7), (40, 2)])
def test_screws_across_the_split_are_close(D, columns):
    """At most 40 mm apart, or the width of a cavity with its walls and the screw where that is more."""
    import build123d as bd

    design, mold = Design(D=D, L=D + 1, l0=D, f=D), Mold(split=1, columns=columns)
    half = halves(design, mold, closed_mold(design, mold)[1])["mold_b1"]
    across = sorted({round(place.X, 6) for place in holes(half, 1.7, bd.Vector(0, 1, 0))})
    s = sizes(design, mold)
    wide = 2 * (s.rim + 0.5 + 3.5)
    assert max(b - a for a, b in itertools.pairwise(across)) <= max(40, wide) + 1e-6
    assert len(s.centres) == columns
    assert min(b[0] - a[0] for a, b in itertools.pairwise(s.centres)) >= 2 * s.R + s.wall - 1e-9 if columns > 1 else 1


@pytest.mark.parametrize("mold", [Mold(), Mold(columns=3, rows=3), Mold(columns=10), Mold(columns=6, split=1)])
def test_lugs_of_A_and_B_share_their_screws(mold):
    import build123d as bd

    A, B = closed_mold(Design(), mold)
    on_a, on_b = ({(round(p.X, 6), round(p.Y, 6)) for p in holes(part, 1.7, bd.Vector(0, 0, 1))} for part in (A, B))
    assert on_a == on_b
    assert len(on_a) == len(sizes(Design(), mold).lugs) >= 2
    # beside A's skirt, and the bottom of B is as flat as before
    assert min(math.hypot(x, y) for x, y in on_a) > sizes(Design(), mold).rim + 3
    assert min(vertex.Z for vertex in B.vertices()) == pytest.approx(sizes(Design(), mold).bottom)


def test_a_plate_repeats_one_cavity():
    import build123d as bd

    design = Design()
    single, plate = (sizes(design, Mold(columns=n, rows=m)) for n, m in ((1, 1), (3, 2)))
    pitch = 2 * plate.R + plate.wall
    assert len(plate.centres) == 6
    assert {x for x, _ in plate.centres} == {-pitch, 0, pitch}
    assert {y for _, y in plate.centres} == {-pitch / 2, pitch / 2}
    for A, B, s in ((*closed_mold(design, Mold()), single), (*closed_mold(design, Mold(columns=3, rows=2)), plate)):
        pins = sum(cad.overlap(A, cad.turned(s.pin).moved(bd.Location((*centre, 0)))) for centre in s.centres)
        assert pins == pytest.approx(len(s.centres) * cad.turned_volume(s.pin), rel=1e-12)
        assert cad.overlap(A, B) == 0


def test_a_mould_printed_the_wrong_way_up_is_found(mould):
    A, B = mould
    assert set(not_printable("A", A, Mold())) == {"overhang of A, as printed", "widest bridge of A"}
    # the part of the dome that leans by more than 45 degrees
    area = not_printable("B", B, Mold(), over=True)["overhang of B, as printed"]
    assert area == pytest.approx(2 * math.pi * 16 * (1 - 0.5**0.5), rel=0.02)


def test_bounds_depend_on_the_design():
    with pytest.raises(BadInput, match=r"draft must not exceed 1\.91 degrees"):
        sizes(Design(L=60, l0=60), Mold(draft=2))
    with pytest.raises(BadInput, match=r"fit must not exceed the 0\.\d+ mm of silicone .* got 0\.35 mm"):
        sizes(TINY, Mold(fit=0.35))


@pytest.mark.parametrize(
    ("choice", "text"),
    [
        ({"shrink": 0.5}, "shrink must lie between 0 and 0.2; got 0.5"),
        ({"wall": float("nan")}, "wall must lie between 0.4 and 100 mm; got nan mm"),
        ({"vents": 2.5}, "vents must be a whole number from 1 to 24; got 2.5"),
        ({"vents": True}, "vents must be a whole number from 1 to 24; got True"),
        ({"vent_diameter": 1.7}, "vent_diameter must not exceed 0.8 of the annulus of 2 mm"),
        ({"vents": 20}, "vents must not exceed 15 for vent_diameter = 1 mm; got 20"),
        ({"pocket_gap": 2.0}, "pocket_gap = 2 mm and pin_edge = 0.1 mm leave -0.102 mm"),
        ({"pocket_gap": -1.5}, "pocket_gap must not be less than -1 mm"),
        ({"pin_edge": 0.3}, "pin_edge must not exceed the magnet's edge radius = 0.1 mm"),
        ({"skirt": 8.5}, "skirt must leave skirt + pry_gap within B's free height = 9 mm"),
        ({"pry_gap": 9.0}, "pry_gap must leave skirt + pry_gap within B's free height = 9 mm"),
        ({"draft": 30}, "draft must lie between 0 and 5 degrees"),
        ({"tip_vent": 9.0}, "tip_vent must not exceed the tip's radius = 4 mm"),
        ({"split": 1, "rows": 2}, "rows must be 1 when split is 1, as B is split along a row; got 2"),
        (
            {"split": 1, "dowel": 9.0},
            "dowel must not exceed 7.8 mm, so that its hole keeps a wall in the ears of 12 mm",
        ),
        ({"process": "cnc"}, "there is no process 'cnc'"),
        ({"columns": 0}, "columns must lie between 1 and 10; got 0"),
        ({"skirt": 9.1, "pry_gap": 0}, "skirt must leave skirt + pry_gap within B's free height = 9 mm"),
    ],
)
def test_bad_parameters(choice, text):
    with pytest.raises(BadInput) as caught:
        sizes(Design(), Mold(**choice))
    assert str(caught.value).startswith(text)


def test_a_mould_without_room_has_no_marks_and_a_warning():
    mold = Mold(marks=1, wall=0.5)
    text = "the mould has no room for legible letters, which are at least 3 mm high"
    assert mold_marks(Design(), mold, sizes(Design(), mold)) == ([], [], text)


# Overhangs and bridges of shapes whose answer is known.


def box(x, y, z, at=(0, 0, 0)):
    import build123d as bd

    return bd.Solid.make_box(x, y, z, bd.Plane(at))


def cut(body, tool):
    return body.cut(tool).solids()[0]


def hanging(solid):
    return overhangs(solid_files.triangulated(solid, 0.01))


def test_a_sphere_overhangs_below_45_degrees():
    import build123d as bd

    area, bridge = hanging(bd.Solid.make_sphere(5))
    assert area == pytest.approx(2 * math.pi * 25 * (1 - math.sqrt(0.5)), rel=5e-3)
    assert bridge == 0


def test_bridges_are_measured_from_wall_to_wall():
    body = box(20, 20, 10)
    assert hanging(body) == (0, 0)
    assert hanging(cut(body, box(4, 8, 3, (8, 6, 0)))) == (0, pytest.approx(4))
    # a channel is open at both ends, and still carried on both sides
    assert hanging(cut(body, box(3, 30, 3, (8, -5, 0)))) == (0, pytest.approx(3))


def test_a_roof_with_a_free_edge_hangs_in_the_air():
    body = box(20, 20, 10)
    assert hanging(cut(body, box(4, 28, 3, (-1, -4, 0)))) == (0, math.inf)
    table = box(2, 2, 8).fuse(box(20, 20, 2, (-9, -9, 8))).solids()[0]
    assert hanging(table) == (0, math.inf)
    assert hanging(standing(table, upside_down=True)) == (0, 0)
