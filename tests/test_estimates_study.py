"""Random states of the error study: draws that stay, over the whole range, and their errors."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from fem.accuracy import FINE, QUICK, coarser
from fem.equilibrium import trace
from geometry.bad_input import BadInput
from studies.validation.errors import estimates
from studies.validation.errors.estimates import KINDS, draw, finer, meshes


def test_draws_are_the_same_again_and_cover_the_range():
    drawn = [draw(kind, k) for kind in KINDS for k in range(12)]
    assert drawn[:24] == [draw(kind, k) for kind in list(KINDS)[:2] for k in range(12)]
    designs = [one.design for one in drawn]
    assert {design.law for design in designs} == {"neo-hookean", "mooney-rivlin", "yeoh", "ogden"}
    assert {one.magnet for one in drawn} == {"rigid", "ignored"}
    for values, low, high in (
        ([one.L / one.D for one in designs], 0.65, 4.5),
        ([one.nu for one in designs], 0.05, 0.499),
        ([one.D for one in designs], 1.5, 30.0),
        ([one.load.grip / one.design.L for one in drawn if one.load.grip], 0.1, 0.45),
    ):
        assert min(values) < low
        assert max(values) > high
    assert 0.3 < np.mean([one.unseen for one in drawn]) < 0.35


def test_a_reference_is_finer_than_its_level_and_has_a_coarser_mesh():
    unlike = {"solid_size", "solid_patch", "tolerance_factor"}
    assert replace(coarser(finer(FINE)), **{name: getattr(FINE, name) for name in unlike}) == FINE
    for kind in KINDS:
        found = meshes(draw(kind, 3))
        assert found["reference"].section_size * found["reference"].coarseness < found["standard"].section_size
        assert found["quick coarser"] == coarser(QUICK)


@pytest.fixture(scope="module")
def solved():
    return estimates.solved({"press": 1})


def test_the_study_judges_what_a_user_gets(solved):
    (row,) = estimates.compare(solved).query("level == 'quick'").to_dict("records")
    one = draw("press", 0)
    (state,) = trace(one.design, one.loads, QUICK, magnet=one.magnet)
    for name in ("force", "shift", "contact_radius", "energy", "strain"):
        estimate = getattr(state.estimates, name)
        assert row[f"{name}_estimate"] == pytest.approx(math.nan if estimate is None else estimate, nan_ok=True)
    force = {mesh: values.force_z_N.item() for mesh, values in solved.groupby("mesh")}
    off = abs(force["quick"] - force["reference"]) + 0.8 * abs(force["reference"] - force["reference coarser"])
    assert row["force_error"] == pytest.approx(off / force["reference"])
    assert math.isnan(row["sideways_error"])


def test_a_state_without_an_answer_on_one_mesh_is_listed_without_errors(solved):
    stopped = solved.assign(status=solved.status.mask(solved.mesh == "reference", "failed"))
    rows = estimates.compare(stopped)
    assert set(rows.status) == {"disagrees"}
    assert "force_error" not in rows


def test_states_of_an_earlier_run_are_read_and_those_of_other_physics_refused(solved, tmp_path, monkeypatch):
    table = tmp_path / "random_states.csv"
    solved.to_csv(table, index=False)
    monkeypatch.setattr(estimates, "solve", lambda one: pytest.fail("solved again"))
    again = estimates.solved({"press": 1}, table)
    pd.testing.assert_frame_equal(again[list(estimates.COLUMNS)], solved[list(estimates.COLUMNS)])
    solved.assign(physics="axisymmetric 1").to_csv(table, index=False)
    with pytest.raises(BadInput, match="is of other versions of the physics"):
        estimates.solved({"press": 1}, table)
    table.write_text("a,b\n1,2\n")
    with pytest.raises(BadInput, match="has no column kind"):
        estimates.solved({"press": 1}, table)
