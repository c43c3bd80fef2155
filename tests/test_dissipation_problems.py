"""The sign of the dissipation by both viscoelastic laws at large strain."""

from studies.validation.dissipation_problems import STRETCHES, negative_dissipation, signs


def test_closed_cycles_dissipate_and_no_step_of_the_law_for_large_rates_gains_energy() -> None:
    linear, finite, steps = negative_dissipation(50)
    assert linear == finite == 1
    assert 1 - steps < 3e-3


def test_linear_overstresses_have_steps_of_negative_dissipation_at_large_strain_only() -> None:
    closed, steps = signs("prony", 50)
    assert closed.min() > 0.07
    assert steps[0] > -1e-12
    assert steps[-len(STRETCHES)] > -1e-3
    assert steps[-1] < -1
