"""The harmonic model beside tetrahedra; the two meet in test_equilibrium too."""

import math
from dataclasses import replace

import pandas as pd
import pytest

from fem.accuracy import QUICK
from fem.equilibrium import solve
from fem.scene import turns
from geometry.design import paper
from geometry.loads import Load
from studies.validation import error_study_cases
from studies.validation.errors import crosscheck

LOAD = Load(depth=0.8, shear_x=0.4, friction="stick")


def answers(*solutions):
    """Solved states as the tables of an engine's answers."""
    tables = []
    for one in solutions:
        row = dict(zip(("force_x_N", "force_y_N", "force_N"), one.response.force, strict=True))
        row |= dict(zip(("shift_x_mm", "shift_y_mm", "shift_z_mm"), one.response.shift, strict=True))
        row |= {"tilt_rad": one.response.tilt, "tilt_y_rad": 0.0, "sideways_N": one.response.force[0]}
        row |= {f"{name}_error_estimate": getattr(one.estimates, name) for name in ("shift", "tilt", "sideways")}
        row |= {"error_estimate": one.estimates.force, "status": one.status, "message": "", "seconds": 1.0}
        tables.append(pd.DataFrame([row]))
    return tables


@pytest.fixture(scope="module")
def solutions():
    level = replace(QUICK, section_size=0.16, section_patch=0.03)
    return [solve(paper(), LOAD, replace(level, harmonics=n)) for n in (2, 1, 3)]


def test_answers_agree_within_both_estimates(solutions):
    (row,) = crosscheck.compared([(0, LOAD)], *answers(*solutions)).to_dict("records")
    for name in crosscheck.COMPONENTS:
        both = row[f"{name}_harmonic_estimate_percent"] + row[f"{name}_half_estimate_percent"]
        assert row[f"{name}_agree"] == (row[f"{name}_difference_percent"] <= both)
        assert 0 < row[f"{name}_one_harmonic_more_percent"] < 1
    a, b = (one.response.force for one in solutions[:2])
    assert row["force_difference_percent"] == pytest.approx(100 * math.dist(a, b) / math.hypot(*a))


def test_other_answers_a_failure_and_an_unknown_estimate_are_no_agreement(solutions):
    one, other, richer = answers(*solutions)
    (row,) = crosscheck.compared([(0, LOAD)], one, other.assign(tilt_rad=2 * other.tilt_rad), richer).to_dict(
        "records"
    )
    assert (row["tilt_agree"], row["agree"]) == (False, False)
    assert row["tilt_difference_percent"] == pytest.approx(100, rel=0.1)
    stopped = other.assign(status="not_converged", message="stopped")
    found = crosscheck.result(crosscheck.compared([(0, LOAD)], one, stopped, richer))
    assert found.failures == ["1 of 1 are missed: design 0, tilt 0 deg"]
    assert "0 of 1 designs agree" in found.pages["CROSSCHECK.md"]
    assert "- design 0: tetrahedra: stopped" in found.pages["CROSSCHECK.md"]
    unknown = other.assign(shift_error_estimate=math.nan)
    assert not crosscheck.compared([(0, LOAD)], one, unknown, richer)["agree"].any()


def test_a_tilted_plate_is_compared_with_tetrahedra(tmp_path):
    """Two coarse meshes: their answers agree within their estimates."""
    coarse = replace(QUICK, section_size=0.25, solid_size=0.6, solid_patch=0.2)
    chosen = [(1, Load(depth=1.0, plate_tilt=0.15))]
    table = crosscheck.compared(chosen, *crosscheck.solved(chosen, coarse, tmp_path / "states.sqlite"))
    assert table[["status", "agree"]].to_numpy().tolist() == [["ok", True]]
    assert table["sideways_agree"].isna().all()
    report = crosscheck.result(table).pages["CROSSCHECK.md"]
    assert "1 of 1 loads agree" in report
    assert report.count("| 1 | ignored | 1 | 0 | 0 | 8.594 | none | ok |") == 3


def test_upright_loads_are_those_of_the_accuracy_study_and_tilted_plates_cover_every_kind():
    for number, load in crosscheck.loads()[:12]:
        assert load == error_study_cases.trial(number, crosscheck.magnet_of(number), "stick", "auto").loads[-1]
    numbers, loads = zip(*((n, load) for n, load in crosscheck.loads() if load.plate_tilt), strict=True)
    assert {load.friction for load in loads} == {"none", "stick", 0.4}
    assert set(numbers) == set(range(12))
    assert [turns([load]) for load in loads].count(True) == 2
