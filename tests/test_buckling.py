"""Critical loads of a column, and the table of them beside finite elements."""

import json

import pytest

from analytic import buckling
from geometry.design import paper
from studies.cli import entry_point
from studies.simulation import critical_depths
from studies.simulation.critical_depths import COLUMNS, page


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
