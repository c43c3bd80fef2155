"""The verb stability over slenderness: its picture and page, lengths that cannot be, and an interruption."""

import pytest

from studies.output import figures
from studies.simulation import critical_depths


def row(ratio):
    length = 8.0 * ratio
    return dict.fromkeys(critical_depths.COLUMNS) | {
        "L_over_D": ratio,
        "L_mm": length,
        "status": "ok",
        "critical_depth_mm": None if ratio < 1 else length / ratio**2 / 2,
        "critical_force_N": None if ratio < 1 else 30 / ratio**2,
        "stable_to_mm": length / 2,
        **{f"{formula}_N": 30 / ratio**2 for formula in critical_depths.FORMULAS},
        **{f"{formula}_depth_mm": length / ratio**2 / 2 for formula in critical_depths.FORMULAS},
    }


@pytest.mark.parametrize("ratios", [(0.8, 1.5, 3, 5), (2, 3)])
def test_short_beams_that_stay_stable_are_marked(ratios):
    depth, force = critical_depths.figures(figures.table_of([row(ratio) for ratio in ratios]))
    stable = depth.data["series"] == "finite elements, free tip: stable at least to here"
    assert stable.sum() == sum(ratio < 1 for ratio in ratios)
    assert set(depth.data["L/D"]) == set(ratios)
    # what was not found is not in the legend
    assert not depth.data["series"].str.contains("guided").any()
    assert set(force.data["series"]) == {
        "finite elements, free tip", "Haringx, free tip", "Euler, free tip", "Engesser, free tip"
    }  # fmt: skip


def table_row(ratio, critical, guided=None):
    error = critical and 0.01
    formulas = {name: 1.0 for name in critical_depths.COLUMNS if "critical" not in name and "stable" not in name}
    return dict.fromkeys(critical_depths.COLUMNS) | {
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
    text = critical_depths.page([table_row(0.6, None), table_row(1, 2.0), table_row(3, 1.05, 1.9)])
    assert "- Haringx's load of a free tip is within 10% at L/D = 3." in text
    assert "| 2 ± 0.02 |" in text
    assert "- No instability of a free tip down to `stable_to_mm` at L/D = 0.6." in text


def test_a_length_that_cannot_be_is_a_row(run, strict):
    status, out, _ = run("stability", "paper", "--slenderness", "0.51", "--json")
    (record,) = strict(out)
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
def test_bad_requests_are_a_sentence(given, said, refusal):
    assert said in refusal("stability", "paper", *given)


def test_an_interruption_prints_the_lengths_that_are_complete(run, monkeypatch, strict, tmp_path):
    solved = []

    def row(*given):
        if solved:
            raise KeyboardInterrupt
        solved.append(1)
        return {"L_over_D": given[2], "status": "ok"}

    monkeypatch.setattr(critical_depths, "_row", row)
    status, out, err = run("stability", "paper", "--slenderness", "1,2", "--out", "o", "--json")
    assert (status, [row["L_over_D"] for row in strict(out)]) == (130, [1.0])
    assert "1 of 2 lengths are complete, and no file is written" in err
    assert not (tmp_path / "o").exists()
