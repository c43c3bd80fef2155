"""The mould's parts against closed forms, and its checks against moulds that must fail them."""

import pytest

from geometry import cad
from geometry.design import BadInput, Design
from geometry.mold import Mold, checks, parts, pours, sizes

BARE = {"magnet_diameter": 0, "magnet_height": 0, "magnet_edge_radius": 0}
CASES = [
    (Design(), Mold()),
    (Design(), Mold(shrink=0.01, pocket_gap=-0.05, fit=0.1, vents=6)),
    (Design(magnet_edge_radius=0.5), Mold(pocket_gap=0.2, pin_edge=0.3, vents=1)),
    (Design(magnet_height=4, magnet_edge_radius=2), Mold(shrink=0.1)),
    (Design(D=1, L=0.8, magnet_diameter=0.4, magnet_height=0.2, magnet_edge_radius=0.02), Mold(fit=0.05)),
    (Design(D=50, L=25.5, magnet_diameter=20, magnet_height=0.5, l0=50), Mold(wall=5)),
    (Design(D=50, L=1000, magnet_diameter=20, magnet_height=10, l0=50), Mold(floor=1)),
    (Design(D=8, L=4.001, **BARE), Mold()),
    (Design(**BARE), Mold(vents=3, vent_diameter=2)),
]


def failed(design, mold, A, B):
    return [check.name for check in checks(design, mold, A, B) if not check.passed]


@pytest.mark.parametrize(("design", "mold"), CASES)
def test_every_check_passes(design, mold):
    A, B = parts(design, mold)
    assert A.is_valid
    assert B.is_valid
    assert failed(design, mold, A, B) == []


@pytest.mark.parametrize(("design", "mold"), CASES)
def test_pours_add_up_to_the_silicone(design, mold):
    first, second = pours(design, mold)
    silicone = cad.beam_volume(design.shape) - cad.magnet_volume(design.shape)
    assert (first + second) * (1 - mold.shrink) ** 3 == pytest.approx(silicone, rel=1e-12)
    assert second >= 0


def test_pocket_and_pin_fillet():
    design = Design(magnet_edge_radius=0.5)
    plain, gap = sizes(design, Mold()), sizes(design, Mold(pocket_gap=0.1, shrink=0.2))
    assert (plain.pin_radius, plain.pin_depth, plain.pin_edge) == (2, design.H + 1, 0.5)
    assert (gap.pin_radius, gap.pin_depth, gap.R) == pytest.approx((2.1 / 0.8, 6 / 0.8, 5))
    assert gap.inner - gap.outer == pytest.approx(plain.inner - plain.outer)


@pytest.mark.parametrize("edge", [0, 0.3, 1])
def test_the_magnet_fits_the_end_of_the_pocket_exactly(edge):
    import build123d as bd

    design = Design(magnet_edge_radius=edge)
    A, _ = parts(design, Mold())
    magnet = cad.magnet(design).mirror(bd.Plane.XY)
    assert cad.overlap(A, magnet) == pytest.approx(magnet.volume, rel=1e-9)
    low = cad.turned([(0, -design.L, 0), (design.R, -design.L, 0), (design.R, -design.H, 0), (0, -design.H, 0)])
    assert cad.overlap(A, low) == pytest.approx(magnet.volume / 2, rel=1e-9)


def test_rim_lies_in_the_base_plane():
    A, B = parts(Design(), Mold())
    rim = max(B.faces(), key=lambda face: face.center().Z)
    assert all(vertex.Z == 0 for vertex in rim.vertices())
    low, high = (getattr(B.bounding_box(optimal=True), end).Z for end in ("min", "max"))
    assert (high, low) == pytest.approx((0, -12), abs=1e-6)
    assert A.distance_to(B) == pytest.approx(0, abs=1e-9)


def test_parts_export_watertight(tmp_path):
    A, B = parts(Design(), Mold())
    for record in cad.export({"A": A, "B": B}, tmp_path):
        assert record.watertight
        assert abs(record.relative_error) <= 1e-3


def test_an_undercut_is_found():
    import build123d as bd

    design, mold = Design(), Mold()
    A, B = parts(design, mold)
    groove = bd.Solid.make_torus(design.R, 0.2, bd.Plane((0, 0, -3)))
    found = failed(design, mold, A, cad.cut(B, groove))
    assert "overlap while the cast leaves B" in found
    assert "cavity against beam - pin" in found
    collar = bd.Solid.make_torus(design.magnet_diameter / 2, 0.2, bd.Plane((0, 0, -3)))
    assert "overlap while A leaves the cast" in failed(design, mold, A.fuse(collar).solids()[0], B)


def test_a_long_skirt_is_found():
    design, mold = Design(), Mold(skirt=8.9)
    with pytest.raises(BadInput, match="skirt must be shorter than B's free height = 9 mm"):
        parts(design, Mold(skirt=9.1))
    A, B = parts(design, mold)
    assert failed(design, mold, A, B) == []
    s = sizes(design, mold)
    longer = cad.turned([(s.inner, -8, 0), (s.inner + 3, -8, 0), (s.inner + 3, -9.1, 0), (s.inner, -9.1, 0)])
    assert "overlap of A and B, closed" in failed(design, mold, A.fuse(longer).solids()[0], B)


def test_a_tight_skirt_thin_wall_and_missing_vents_are_found():
    import build123d as bd

    design, mold = Design(), Mold()
    A, B = parts(design, mold)
    s = sizes(design, mold)
    key = bd.Solid.make_box(1, 1, 1, bd.Plane((s.inner - 0.5, 0, -4)))
    found = failed(design, mold, A.fuse(key).solids()[0], B)
    assert {"overlap of A and B, closed", "overlap while A leaves B"} <= set(found)
    hollow = bd.Solid.make_box(4, 4, 2, bd.Plane((-2, -2, -13)))
    assert "least wall of B over the cavity" in failed(design, mold, A, cad.cut(B, hollow))
    plug = bd.Solid.make_cylinder(s.vent_diameter / 2, mold.lid, bd.Plane((s.vent_ring, 0, 0)))
    assert failed(design, mold, A.fuse(plug).solids()[0], B) == ["vents to pin and cavity wall"]


def test_a_loose_lid_is_reported_for_a_thin_wall():
    design = Design(D=1, L=0.8, magnet_diameter=0.4, magnet_height=0.2, magnet_edge_radius=0.02)
    mold = Mold(fit=0.3)
    assert failed(design, mold, *parts(design, mold)) == ["the same, A pushed aside by the fit"]


@pytest.mark.parametrize(
    ("choice", "text"),
    [
        ({"shrink": 0.5}, "shrink must lie between 0 and 0.2; got 0.5"),
        ({"wall": float("nan")}, "wall must lie between 0.4 and 100 mm; got nan mm"),
        ({"lid": "3"}, "lid must be a number; got '3'"),
        ({"fit": None}, "fit must be a number; got None"),
        ({"vents": 2.5}, "vents must be a whole number; got 2.5"),
        ({"vents": True}, "vents must be a whole number; got True"),
        ({"vent_diameter": 1.7}, "vent_diameter must not exceed 0.8 of the annulus of 2 mm"),
        ({"vents": 20}, "vents must not exceed 15 for vent_diameter = 1 mm; got 20"),
        ({"pocket_gap": 2.0}, "pocket_gap = 2 mm and pin_edge = 0.1 mm make a pin that leaves -0.102 mm"),
        ({"pocket_gap": -1.5}, "pocket_gap must not be less than -1 mm"),
        ({"pin_edge": 0.3}, "pin_edge must not exceed the magnet's edge radius = 0.1 mm"),
        ({"skirt": 9.0}, "skirt must be shorter than B's free height = 9 mm"),
    ],
)
def test_bad_parameters(choice, text):
    with pytest.raises(BadInput) as caught:
        sizes(Design(), Mold(**choice))
    assert str(caught.value).startswith(text)
