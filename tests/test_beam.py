"""The paper's mechanics: its numbers, scaling, the closure of the magnet's displacement, friction, bad input."""

import json
import math

import numpy as np
import pytest

from analytic import buckling, press_terms
from analytic.beam import TERMS, cantilever_stiffness, solve
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from studies.cli import entry_point
from studies.simulation import critical_depths
from studies.simulation.critical_depths import COLUMNS, page

approx = pytest.approx


def test_numbers_of_the_paper():
    assert solve(paper(), Load(depth=3)).force == (0, 0, approx(15.708, abs=5e-4))
    assert solve(paper(), Load(depth=1)).force[2] == approx(7 * math.pi / 9, rel=1e-14)
    assert cantilever_stiffness(paper()) == approx(0.827, abs=5e-4)
    sheared = solve(paper(), Load(shear_x=3.1, grip=2))
    assert sheared.force[0] == approx(3.1 * 0.82740, rel=1e-4)


def test_displacement_with_the_assumed_closure():
    """The paper's two relations with l_t = e (1 - d/L)."""
    d, x, e, L = 2.0, 1.3, 4.0, 9.0
    l_t = e * (1 - d / L)
    response = solve(paper(), Load(d, x, -x, "stick"))
    along = x * ((L - d) - l_t) / (L - d)
    assert response.shift == approx((along, -along, -(l_t + d - e)), rel=1e-14)
    assert response.tilt == 0


def test_contact_radius_and_the_end_of_equation_7():
    for d in (0.0, 1.0, 4.0):
        assert solve(paper(), Load(depth=d)).contact_radius == approx(math.sqrt(8 * d - d * d), rel=1e-14)
    with pytest.raises(BadInput, match=r"must not exceed the tip radius D/2 = 4 mm.*got 4.01 mm"):
        solve(paper(), Load(depth=4.01))


def test_friction():
    def under(friction, depth=2.0):
        return solve(paper(), Load(depth, 1.2, -0.9, friction))

    stuck, slid = under("stick"), under("none")
    assert slid.force[:2] == (0, 0)
    assert slid.shift[:2] == (0, 0)
    assert slid.force[2] == stuck.force[2] > 0
    assert math.hypot(*stuck.force[:2]) == approx(1.5 * cantilever_stiffness(paper()))
    assert under(10.0) == stuck
    assert under(0.0) == slid
    slips = under(0.05)
    share = 0.05 * slips.force[2] / math.hypot(*stuck.force[:2])
    assert 0 < share < 1
    assert slips.force[:2] == approx([share * value for value in stuck.force[:2]], rel=1e-13)
    assert slips.shift[:2] == approx([share * value for value in stuck.shift[:2]], rel=1e-13)
    assert under(0.3, depth=0.0).force == (0, 0, 0)


def test_grip_is_shear_without_a_plate():
    gripped = solve(paper(), Load(shear_x=1.2, shear_y=-0.9, grip=3))
    assert gripped == solve(paper(), Load(shear_x=1.2, shear_y=-0.9, friction="stick"))
    assert gripped.contact_radius == gripped.force[2] == 0


def test_bad_input():
    with pytest.raises(BadInput, match=r"level must be one of paper, column, .*; got 'fem'"):
        solve(paper(), Load(depth=1), level="fem")
    with pytest.raises(BadInput, match=r"cannot model a tilted plate: plate tilt must be 0; got 5\.73 degrees"):
        solve(paper(), Load(depth=1, plate_tilt=0.1))
    with pytest.raises(BadInput, match="cannot model an imperfection"):
        solve(paper(), Load(depth=1, imperfection=0.01))
    with pytest.raises(BadInput, match="depth must be less than 9 mm"):
        solve(paper(), Load(depth=9))
    with pytest.raises(BadInput, match="grip must be less than L"):
        solve(paper(), Load(shear_x=1, grip=9))


# The press of the formulas: exact to rounding, in few evaluations.


RNG = np.random.default_rng(7)


def random_press():
    D = 10 ** RNG.uniform(0, 1.5)
    design = Design(
        D=D,
        L=D * RNG.uniform(0.9, 6),
        E=10 ** RNG.uniform(-3, 3),
        nu=RNG.uniform(0.3, 0.5),
        l0=40,
        magnet_diameter=D * RNG.uniform(0.05, 0.6),
        magnet_height=D * RNG.uniform(0.05, 0.5),
        magnet_edge_radius=0,
    )
    return design, D * 10 ** RNG.uniform(-12, -0.31)


@pytest.mark.parametrize("level", TERMS)
def test_dome_and_column_share_the_depth_and_the_force_to_rounding(level):
    for _ in range(200):
        design, depth = random_press()
        pressed = press_terms.press(design, depth, TERMS[level])
        assert pressed.above + pressed.below == pytest.approx(depth, rel=1e-14)
        assert press_terms._dome(design, TERMS[level])(pressed.above) == pressed.force


# Critical loads of a column, and the table of them beside finite elements.


@pytest.mark.parametrize("end", [buckling.FREE, buckling.GUIDED])
def test_haringx_solves_its_equation(end):
    beam = paper()
    P = buckling.haringx(beam, end)
    assert P * (1 + P / buckling.shear_stiffness(beam)) == pytest.approx(buckling.euler(beam, end), rel=1e-12)


def test_shear_softens_and_engesser_softens_more():
    beam = paper()
    assert buckling.engesser(beam) < buckling.haringx(beam) < buckling.euler(beam)


def test_depth_is_hertz_for_a_small_force():
    beam = paper()
    E_star = beam.E / (1 - beam.nu**2)
    d = buckling.depth(beam, 1e-9)
    assert 4 / 3 * E_star * beam.R**0.5 * d**1.5 == pytest.approx(1e-9, rel=1e-2)


def row(ratio, critical, guided=None):
    error = critical and 0.01
    formulas = {name: 1.0 for name in COLUMNS if "critical" not in name and "stable" not in name}
    return dict.fromkeys(COLUMNS) | {
        "L_over_D": ratio,
        "status": "ok",
        "message": "",
        "critical_depth_mm": critical,
        "critical_force_N": critical,
        "stable_to_mm": critical or 4.0,
        "critical_depth_error_estimate": error,
        "critical_force_error_estimate": error,
        "guided_critical_depth_mm": guided,
        "guided_critical_force_N": guided,
        **formulas,
    }


def test_report_says_where_a_formula_holds():
    text = page([row(0.6, None), row(1, 2.0), row(3, 1.05, 1.9)])
    assert "- Haringx's load of a free tip is within 10% at L/D = 3." in text
    assert "| 2 ± 0.02 |" in text
    assert "- No instability of a free tip down to `stable_to_mm` at L/D = 0.6." in text


def test_a_length_that_cannot_be_is_a_row(capsys):
    status = entry_point.main(["stability", "paper", "--slenderness", "0.51", "--json"])
    record = json.loads(capsys.readouterr().out)
    assert (status, record["status"], record["critical_depth_mm"]) == (3, "refused", None)
    assert "L" in record["message"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--slenderness", "1,x"], "slenderness"),
        (["--slenderness", "1", "--depth", "1"], "--depth"),
        (["--out", "somewhere"], "--slenderness"),
    ],
)
def test_bad_requests_are_a_sentence(given, said, capsys):
    assert entry_point.main(["stability", "paper", *given]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert said in shown.err
    assert shown.err.count("\n") == 1


def test_an_interruption_prints_the_lengths_that_are_complete(run, monkeypatch, strict, tmp_path):
    solved = []

    def solve(*_):
        if solved:
            raise KeyboardInterrupt
        solved.append(1)
        return {"status": "ok"}

    monkeypatch.setattr(critical_depths, "_solve", solve)
    status, out, err = run("stability", "paper", "--slenderness", "1,2", "--out", "o", "--json")
    assert (status, [row["L_over_D"] for row in strict(out)]) == (130, [1.0])
    assert "1 of 2 lengths are complete, and no file is written" in err
    assert not (tmp_path / "o").exists()
