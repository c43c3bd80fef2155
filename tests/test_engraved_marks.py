"""Letters on the mould: they are cut where they belong, print, and leave every check of the mould as it was."""

import pytest

from geometry.design import Design
from geometry.fabrication import solid_files
from geometry.fabrication.engraved_marks import DEPTH, mold_marks
from geometry.fabrication.mold_solids import checks, closed_mold, halves, printable
from geometry.fabrication.printability import standing
from geometry.mold import Mold, sizes

SMALL = Design(D=4, L=4.5, l0=4.1, magnet_diameter=2, magnet_height=2)


@pytest.mark.parametrize(
    ("design", "choices"), [(Design(), {}), (SMALL, {"process": "sla"}), (SMALL, {"columns": 2, "split": 1})], ids=str
)
def test_a_marked_mould_passes_all_checks(design, choices):
    mold = Mold(marks=1, **choices)
    A, B = closed_mold(design, mold)
    plain = closed_mold(design, Mold(**choices))
    pieces = list(halves(design, mold, B).values()) if mold.split else []
    assert [check.name for check in checks(design, mold, A, B, pieces) if not check.passed] == []
    for part, unmarked, over in zip((A, B), plain, (True, False), strict=True):
        assert part.is_valid
        assert unmarked.volume - part.volume > DEPTH
        mesh = solid_files.triangulated(standing(part, upside_down=over), design.D / 500)
        assert mesh.is_watertight
        assert [check.name for check in printable("it", mesh, mold.printing) if not check.passed] == []


def test_the_pole_on_the_foot_follows_the_magnet():
    counts = []
    for design in (Design(), Design(magnet_north="up")):
        mold = Mold(marks=1)
        counts.append(len(mold_marks(design, mold, sizes(design, mold))[1]))
    bare = Design(magnet_diameter=0, magnet_height=0, magnet_edge_radius=0)
    (b,) = {len(mold_marks(bare, Mold(marks=1), sizes(bare, Mold(marks=1)))[1])}
    assert [count - b for count in counts] == [3, 9]


def test_a_mould_without_room_has_no_marks_and_a_warning():
    mold = Mold(marks=1, wall=0.5)
    a, b, text = mold_marks(Design(), mold, sizes(Design(), mold))
    assert (a, b) == ([], [])
    assert text == "the mould has no room for legible letters, which are at least 3 mm high"
