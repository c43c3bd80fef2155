"""Paths in time: limits, relaxation at a held depth, errors of the time steps, energies, and bad input."""

from dataclasses import replace

import numpy as np
import pytest

from fem.accuracy import QUICK
from fem.analyses.timed_path import TimeControl, TimedLoad, TimedState, ViscousLaw, follow
from fem.equilibrium import solve, trace
from fem.scene import Model
from geometry.design import BadInput, paper
from geometry.loads import Load

SOFT = replace(paper(), prony="0.3:0.5 0.2:4", modulus="instantaneous")
COARSE = replace(QUICK, section_size=0.3, section_patch=0.1)


def _force(states: list[TimedState]) -> list[float]:
    return [state.solution.response.force[2] for state in states]


def _cycle(law: ViscousLaw, largest_step: float | None = None, *, every_step: bool = False) -> list[TimedState]:
    loads = [TimedLoad(1, Load(1.0)), TimedLoad(2, Load(0.4))]
    return list(
        follow(SOFT, loads, COARSE, law=law, steps=TimeControl(largest_step=largest_step), every_step=every_step)
    )


@pytest.fixture(scope="module")
def cycles() -> dict[ViscousLaw, list[TimedState]]:
    """Every step of a cycle by both laws."""
    laws: tuple[ViscousLaw, ...] = "prony", "finite"
    return {law: _cycle(law, every_step=True) for law in laws}


@pytest.mark.parametrize("law", ["prony", "finite"])
def test_estimate_covers_the_error_of_the_time_steps(law: ViscousLaw, cycles) -> None:
    fine, coarse = _cycle(law, 0.04), [state for state in cycles[law] if state.time in (1, 2)]
    largest = max(_force(fine))
    for exact, state in zip(fine, coarse, strict=True):
        error = abs(state.solution.response.force[2] - exact.solution.response.force[2]) / largest
        assert error < state.time_error + 2e-6


def test_shorter_steps_have_errors_of_second_order() -> None:
    def at_shear(step: float) -> float:
        accuracy = replace(COARSE, harmonics=1)
        (state,) = follow(SOFT, [TimedLoad(1, Load(shear_x=3.0, grip=1.0))], accuracy, steps=TimeControl(0.9, step))
        return state.solution.response.force[0]

    coarse, middle, fine = at_shear(0.0625), at_shear(0.03125), at_shear(0.015625)
    assert np.log2((coarse - middle) / (middle - fine)) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("law", ["prony", "finite"])
def test_work_is_stored_or_dissipated(law: ViscousLaw, cycles) -> None:
    states = cycles[law]
    dissipated = [state.dissipated for state in states]
    assert dissipated == sorted(dissipated)
    assert dissipated[0] > 0
    for state in states:
        assert state.balance == pytest.approx(0.0, abs=6e-4 * max(one.work for one in states))


def test_plate_leaves_the_recovering_skin_and_touches_it_later_again() -> None:
    loads = [TimedLoad(1, Load(1.0)), TimedLoad(1.2, Load(0.0)), TimedLoad(1.3, Load(0.1)), TimedLoad(60, Load(0.1))]
    down, away, near, late = follow(SOFT, loads, COARSE)
    assert down.solution.response.force[2] > 1
    assert away.solution.response.force[2] == near.solution.response.force[2] == 0
    assert away.solution.response.shift[2] < -0.01
    assert late.solution.response.force[2] > 0.01


def test_slip_within_a_step_changes_the_force_by_less_than_two_thousandths() -> None:
    # the docstring of fem.analyses.timed_path and the notes of `magtip cycle` state this bound
    design = replace(paper(), loss_factor=0.25)
    loads = [TimedLoad(t, Load(1.0, x, friction=0.6)) for t, x in ((0.5, 0.0), (1.5, 1.0), (2.0, 0.5))]

    def path(largest_step: float) -> tuple[list[float], list[float]]:
        one = replace(COARSE, harmonics=1)
        states = list(follow(design, loads, one, steps=TimeControl(largest_step=largest_step), every_step=True))
        return [state.time for state in states], [state.solution.response.force[0] for state in states]

    (times, forces), (short_times, short_forces) = path(1 / 12), path(1 / 24)
    differences = np.abs(np.interp(times, short_times, short_forces) - forces)
    assert 0 < differences.max() < 2e-3 * np.abs(short_forces).max()


def test_jump_is_elastic() -> None:
    (state,) = follow(SOFT, [TimedLoad(0.0, Load(0.5))], COARSE)
    assert state.dissipated == pytest.approx(0.0, abs=1e-12)
    assert state.work == pytest.approx(state.solution.energy)


@pytest.mark.parametrize(
    ("loads", "model", "message"),
    [
        ([], "auto", "at least one load"),
        ([TimedLoad(2, Load(1.0)), TimedLoad(1, Load(0.5))], "auto", "got 1 s after 2 s"),
        ([TimedLoad(1, Load(1.0, 0.5, friction="stick"))], "auto", "for the press and a later one for the shear"),
        ([TimedLoad(1, Load(1.0))], "half", "model half has no time steps"),
    ],
)
def test_loads_that_are_no_path_in_time_are_refused(loads: list[TimedLoad], model: Model, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        follow(SOFT, loads, COARSE, model=model)


@pytest.mark.parametrize(
    "loads",
    [
        [
            Load(d, x, y, friction=0.3)
            for d, x, y in ((1.0, 0.0, 0.0), (0.8, 0.0, 0.0), (0.8, 0.3, 0.0), (0.8, 0.3, 0.3))
        ],
        [Load(d, x, friction="stick") for d, x in ((1.2, 0.0), (1.0, 0.0), (1.0, 0.5))],
    ],
    ids=["friction", "stick"],
)
def test_the_model_carries_all_loads_of_a_path_not_only_the_deepest(loads: list[Load]) -> None:
    elastic, rough = replace(paper(), loss_factor=0.0), replace(COARSE, harmonics=1)
    timed = list(follow(elastic, [TimedLoad(k, load) for k, load in enumerate(loads, 1)], rough))[-1]
    static = trace(elastic, loads, rough, estimate=False)[-1]
    # slip depends on the increments
    assert timed.solution.response.force == pytest.approx(
        static.response.force, rel=5e-3 if loads[0].coulomb else 2e-5
    )


def test_states_in_time_have_the_diagnosis_of_static_states() -> None:
    slender = replace(paper(), L=24.0, l0=24.0)
    loads = [TimedLoad(t, Load(d)) for t, d in ((1, 0.5), (2, 3.0), (3, 0.5), (3.1, 0.1))]
    low, deep, back, away = follow(slender, loads, QUICK, magnet="ignored")
    static = solve(slender, Load(3.0), QUICK, magnet="ignored")
    assert (low.solution.status, deep.solution.status, back.solution.status) == ("ok", "unstable", "ok")
    assert deep.solution.message == static.message
    assert deep.solution.facts.sideways_stiffness_ratio == pytest.approx(
        static.facts.sideways_stiffness_ratio, rel=0.02
    )
    assert (away.solution.status, away.solution.facts.remark) == ("ok", "touch_lost")
    assert low.solution.facts.largest_strain > 0
