"""The three studies: Sobol indices of a formula in closed form, Morris on finite elements through the store."""

import math

import numpy as np
import pytest

from analytic import beam
from fem import equilibrium
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from studies.exploration import store
from studies.exploration.needed_paths import Processes
from studies.sensitivity.sensitivity_study import monte_carlo_study, morris_study, sobol_study, substitutes, summary
from studies.sensitivity.tolerances import Tolerances
from studies.sensitivity.varied_inputs import Press

BARE = Design(magnet_diameter=0.0, magnet_height=0.0)
INLINE = Processes(0)


def morris(kept, ranges, design=BARE, load=Press(1.0), count=2, model="finite"):
    return morris_study(design, ranges, load, model, "quick", count, 0, kept, INLINE)


def test_sobol_indices_of_the_papers_press_have_their_closed_form():
    """F = E g(d) with (5) and (7): the variance of a product of independent factors."""
    rows = sobol_study(paper(), {"E": (0.5, 1.5), "depth": (0.5, 1.5)}, Press(1.0), "paper", 1024, 1).rows
    d = np.linspace(0.5, 1.5, 100_001)
    g = math.pi * (8 * d - d**2) * d / 9
    of_E, of_g = (1 / 12) * g.mean() ** 2, g.var()
    whole = of_E + of_g + g.var() / 12
    first = [row.first_order for row in rows if row.output == "force_N"]
    total = [row.total_order for row in rows if row.output == "force_N"]
    assert first == pytest.approx([of_E / whole, of_g / whole], abs=0.02)
    assert total == pytest.approx([1 - of_g / whole, 1 - of_E / whole], abs=0.02)
    on_shift = [row.total_order for row in rows if row.output == "shift_z_mm"]
    assert on_shift == pytest.approx([0.0, 1.0], abs=0.02)


def test_refused_points_are_counted_and_widen_the_intervals():
    """The surrogate ends at L/D = 4: a quarter of the lengths is refused. No beam buckles under so light a press."""
    study = sobol_study(paper(), {"L": (20.0, 36.0), "E": (0.9, 1.1)}, Press(0.1), "surrogate", 64, 0)
    row = study.rows[0]
    assert row.failed == sum(study.reasons.values())
    assert row.failed_percent == pytest.approx(25, abs=8)
    assert "L/D" in next(iter(study.reasons))
    assert row.total_order_high - row.total_order_low > 0.3


def test_the_error_of_the_surrogate_does_not_depend_on_the_modulus():
    rows = sobol_study(paper(), {"E": (0.9, 1.1), "L": (8.0, 12.0)}, Press(1.0), "surrogate", 64, 0).rows
    (of_shift,) = (row for row in rows if (row.output, row.input) == ("shift_z_mm", "E"))
    assert (of_shift.total_order, of_shift.total_order_high) == (0.0, 0.0)
    assert of_shift.model_error_over_deviation > 0


def test_morris_on_finite_elements_finds_that_force_is_proportional_to_the_modulus(traced):
    with store.in_memory() as kept:
        study = morris(kept, {"E": (0.5, 1.5)})
    (force, *_) = (row for row in study.rows if row.output == "force_N")
    assert force.mu_star == pytest.approx(study.cases[0]["fem_force_N"] / study.cases[0]["E_MPa"], rel=1e-5)
    assert force.sigma == pytest.approx(0.0, abs=1e-6)
    assert force.effect_unit == "N per full range"
    assert len(traced) == 1


def test_morris_that_was_interrupted_continues_from_the_store(traced, monkeypatch, tmp_path):
    ranges = {"L": (9.0, 12.0), "depth": (0.3, 0.6)}
    real, allowed = equilibrium.trace, 2

    def interrupted(*args, **kwargs):
        if len(traced) >= allowed:
            raise KeyboardInterrupt
        return real(*args, **kwargs)

    with store.opened(tmp_path / "solved.sqlite") as kept:
        with monkeypatch.context() as patch:
            patch.setattr(equilibrium, "trace", interrupted)
            with pytest.raises(KeyboardInterrupt, match="2 of 4 solves are kept in"):
                morris(kept, ranges)
        study = morris(kept, ranges)
        assert all(case["status"] == "ok" for case in study.cases)
        again = morris(kept, ranges)
    assert len(traced) == 4
    assert [row.mu_star for row in again.rows] == [row.mu_star for row in study.rows]


def test_failed_cases_of_morris_are_counted_and_bounded():
    with store.in_memory() as kept:
        study = morris(kept, {"L": (3.0, 9.0)}, load=Press(0.3), count=4)
    failed = [case for case in study.cases if case["status"] != "ok"]
    row = study.rows[0]
    assert row.failed == len(failed) > 0
    assert row.mu_star_high > row.mu_star >= row.mu_star_low
    assert next(iter(study.reasons)).startswith("bad_input: L must exceed the tip radius")


def test_unstable_cases_of_morris_keep_their_numbers_and_are_said():
    with store.in_memory() as kept:
        study = morris(kept, {"L": (24.0, 32.0)}, load=Press(3.0), count=4)
    assert not study.reasons
    assert len(study.unstable) == len(study.cases)
    assert "states are unstable, the first one because a beam whose tip slides freely" in study.doubt


def test_a_fast_model_answers_in_place_of_failed_cases():
    points, failed = np.array([[0.5], [1.0], [9.0]]), np.array([False, True, True])
    other = substitutes(paper(), {"depth": (0.5, 9.0)}, Press(1.0), points, "finite", failed)
    assert np.isnan(other["force_N"][[0, 2]]).all()
    assert other["force_N"][1] == beam.solve(paper(), Load(1.0), "finite").force[2]


def test_a_monte_carlo_has_percentiles_of_each_axis_and_a_row_for_each_sensor():
    study = monte_carlo_study(paper(), Press(1.0, 0.3), Tolerances(), "surrogate", 30, 2)
    assert {(row.axis, row.percentile) for row in study.rows} == {(a, p) for a in "zxy" for p in (5, 50, 95)}
    assert len(study.sensors) == 30
    assert {"E_MPa", "z_sensitivity_V_per_N", "x_force_error_N", "element2_gain_factor"} <= study.sensors[0].keys()
    for row in study.rows:
        assert row.low is None or row.low <= row.value
        assert row.high is None or row.high >= row.value


def test_an_input_that_a_study_cannot_vary_is_refused():
    with pytest.raises(BadInput, match="--vary friction"):
        sobol_study(paper(), {"friction": (0.1, 0.5)}, Press(1.0), "finite", 8, 0)


def test_a_summary_names_the_most_frequent_reasons_and_counts_the_others():
    assert summary({}, 10) == ""
    assert summary({"a": 4, "b": 3, "c": 2, "d": 1}, 20).endswith("2 because c, 1 for other reasons")
