"""Answers of the live page: kept paths as a solve from rest, vibrations, loading cycles, the silicone at a rate."""

import random
import weakref
from dataclasses import replace

import numpy as np
import pytest

from fem.accuracy import QUICK
from fem.analyses.vibration import vibrating_sensor
from fem.equilibrium import solve
from fem.scene import Scene
from fem.solve.load_increments import watched
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from studies.mechanics import path_solver, store
from studies.web import explorer_answers, state_answers, time_answers
from studies.web.explorer_answers import Answers, KeptPaths
from studies.web.explorer_state import request_of
from studies.web.time_answers import rate

COARSE = replace(QUICK, section_size=0.3, section_patch=0.1)
"""A mesh on which kept and fresh paths agree as on finer ones."""


@pytest.fixture
def paths():
    return KeptPaths()


def assert_equal(one, other):
    """Check that two responses agree to rounding: compiled and NumPy's loops may have computed them."""
    for a, b in ((one.force, other.force), (one.shift, other.shift)):
        assert a == pytest.approx(b, rel=1e-9, abs=1e-10)
    assert (one.tilt, one.tilt_y) == pytest.approx((other.tilt, other.tilt_y), rel=1e-9, abs=1e-10)


def test_answers_are_those_of_a_solve_from_rest(paths):
    draw = random.Random(1)
    for k in range(5):
        design = Design(E=draw.uniform(0.5, 2), D=draw.choice([8.0, 9.0]))
        shear = draw.uniform(-0.5, 0.5) if k % 2 else 0.0
        load = Load(depth=0.5 if shear else draw.uniform(0.1, 2), shear_y=shear, friction="stick")
        kept = paths.solve(Scene(design, (load,), COARSE), sideways=True)
        fresh = solve(design, load, COARSE)
        assert_equal(kept.response, fresh.response)
        assert (kept.status, kept.message) == (fresh.status, fresh.message)


def test_friction_and_its_history_start_at_the_kept_press(paths):
    for shear in (0.1, 0.3):
        load = Load(depth=0.3, shear_x=shear, friction=0.4)
        kept = paths.solve(Scene(Design(), (load,), COARSE))
        fresh = solve(Design(), load, COARSE)
        assert kept.response.force == pytest.approx(fresh.response.force, rel=1e-9)
        assert kept.slip_share == pytest.approx(fresh.slip_share)


def increments(paths, design, load):
    """Number of load increments that a state takes."""
    shares = []
    with watched(shares.append):
        paths.solve(Scene(design, (load,), COARSE))
    return len(shares)


def test_changes_that_no_finite_element_sees_cost_no_increment(paths):
    load = Load(depth=1.0)
    assert increments(paths, Design(), load) > 0
    assert increments(paths, Design(E=2.0, f=7.0, remanence=1.0, hall_gain=20.0), load) == 0
    assert increments(paths, Design(nu=0.49), load) > 0


def test_a_shear_reuses_its_press(paths):
    loads = [Load(depth=0.5, shear_x=s, friction="stick") for s in (0.1, 0.11)]
    first, second = (increments(paths, Design(), load) for load in loads)
    assert second < first


def test_few_paths_are_kept(paths, monkeypatch):
    monkeypatch.setattr(explorer_answers, "MOST_PATHS", 2)
    followed = []
    for D in (7.0, 8.0, 9.0):
        paths.solve(Scene(Design(D=D), (Load(depth=0.5),), COARSE))
        followed.append(weakref.ref(list(paths._kept.values())[-1].path))
    assert [path() is None for path in followed] == [True, False, False]


class Abandon(Exception):
    """Ends a path."""


def test_a_path_that_is_ended_is_followed_again(paths):
    load = Load(depth=2.5)

    def end(share):
        if share > 0:
            raise Abandon

    with watched(end), pytest.raises(Abandon):
        paths.solve(Scene(Design(), (load,), COARSE))
    assert_equal(paths.solve(Scene(Design(), (load,), COARSE)).response, solve(Design(), load, COARSE).response)


@pytest.mark.parametrize(("shear", "way"), [(0.0, (1.0, 1.1, 0.8)), (1.0, (1.0, 1.1, 0.9))], ids=["press", "shear"])
def test_a_moving_load_is_followed_from_the_last_state(paths, shear, way):
    for value in way:
        load = Load(
            depth=0.5 if shear else value, shear_y=value if shear else 0.0, friction="stick" if shear else "none"
        )
        moving = paths.solve(Scene(Design(), (load,), QUICK), moving=True)
        solved = solve(Design(), load, QUICK)
        moved, fresh = moving.response, solved.response
        # both are within the tolerance of Newton's method
        assert moved.force == pytest.approx(fresh.force, rel=1e-7, abs=1e-8)
        assert moved.shift == pytest.approx(fresh.shift, rel=1e-7, abs=1e-8)
    assert moving.newton_iterations < solved.newton_iterations
    # a hand that rests gets the path of a solve
    resting = paths.solve(Scene(Design(), (load,), QUICK))
    assert_equal(resting.response, fresh)


def request(parts=("vibration", "loop"), design=None, **load):
    state = {"level": "quick", "design": design or {}, "load": {"depth": 1, **load}}
    return request_of({"parts": list(parts), "state": state})


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    with store.opened(tmp_path_factory.mktemp("answers") / "solved.sqlite") as states:
        yield Answers(states)


def answered(answers, *arguments, **load):
    """Rows and message of each answer, the parts in their order."""
    return [
        (part, level, {row["name"]: (row["value"], row["half_width"]) for row in data["rows"]}, data["message"])
        for part, level, data in filter(None, answers.all_of(request(*arguments, **load), "quick"))
    ]


@pytest.mark.parametrize("friction", ["none", "stick"])
def test_vibration_of_the_page_is_that_of_the_sensor(answers, friction):
    ((_, _, rows, _),) = answered(answers, ["vibration"], frequency=300, friction=friction)
    sensor = vibrating_sensor(paper(), Load(depth=1, friction=friction), (1.0, 1000.0), QUICK)
    force = sensor.at([300.0]).force[0, 0, 1]
    value, half_width = rows["force along z"]
    assert value == pytest.approx(abs(force), rel=1e-6)
    assert 1e-3 * value < half_width < 0.02 * value
    over_static = value / sensor.static_stiffness()["z"]
    assert rows["force along z, over static"][0] == pytest.approx(over_static, rel=1e-6)
    assert rows["phase of force along z"][0] == pytest.approx(np.degrees(np.angle(force)), abs=1e-4)


def test_another_frequency_solves_for_no_other_state(answers):
    answered(answers, ["vibration"], frequency=300)
    (before,) = answers.memory.systems.values.values()
    ((_, _, rows, _),) = answered(answers, ["vibration"], frequency=1)
    assert [*answers.memory.systems.values.values()] == [before]
    assert rows["S1 per N, over static"][0] < 1


def test_loop_is_that_of_a_linear_spring_first(answers):
    (_, first, linear, _), (_, second, rows, _) = answered(answers, ["loop"], speed=2)
    assert (first, second) == ("linear", "quick")
    # a contact that grows with the depth makes more of the loss: a few tenths
    assert 1 < rows["gap at mid-stroke"][0] / linear["gap at mid-stroke"][0] < 1.3
    assert 0 < rows["gap at mid-stroke"][1] < 0.5
    # one that is kept is not preceded by the estimate
    assert [level for _, level, *_ in answered(answers, ["loop"], speed=2)] == ["quick"]


def test_static_state_says_how_it_comes_to_move(answers):
    (_, _, rows, vibration), (_, _, _, loop) = answered(answers)
    assert not rows
    assert "A frequency above 0 Hz" in vibration
    assert "A speed above 0 mm/s" in loop


@pytest.mark.parametrize(
    ("load", "words"),
    [
        ({"frequency": 1e5}, "the vibration is known from 0.01 to 1000 Hz"),
        ({"frequency": 5, "plate_tilt": 3, "shear": 1, "direction": 90}, "plane of symmetry"),
        ({"speed": 1e5}, "the branches speak for"),
        ({"speed": 1, "depth": 0}, "a depth above 0 mm"),
        ({"speed": 1, "plate_tilt": 3}, "upright plate"),
    ],
)
def test_loads_without_an_answer_get_a_sentence(answers, load, words):
    part = "vibration" if "frequency" in load else "loop"
    ((_, _, rows, message),) = answered(answers, [part], **load)
    assert not rows
    assert words in message[:1].lower() + message[1:]


def test_a_single_branch_has_no_band(kept):
    with pytest.raises(BadInput, match="which is no band"):
        time_answers.prepare(replace(paper(), prony="0.2:1"), Load(depth=1), "rigid", "quick", kept)


def test_free_sensor_is_shaken(answers):
    ((_, _, rows, message),) = answered(answers, ["vibration"], depth=0, frequency=400)
    assert rows["first resonance"][0] == pytest.approx(494, rel=0.3)
    assert "base of the free sensor" in message


def test_a_frequency_has_loss_factor_stiffness_and_gap_of_a_linear_loop():
    answer = rate(paper(), 10.0)
    assert answer["loss_factor"] == pytest.approx(0.1, rel=0.02)
    assert answer["gap"] == pytest.approx(10, rel=0.02)
    assert answer["storage"] > 1 > rate(replace(paper(), modulus="instantaneous"), 10.0)["storage"]


def test_an_elastic_silicone_is_as_stiff_as_at_rest():
    answer = rate(replace(paper(), loss_factor=0.0), 10.0)
    assert (answer["loss_factor"], answer["storage"], answer["gap"]) == (0.0, 1.0, 0.0)


@pytest.mark.parametrize("frequency", [0.0, 1e4])
def test_nothing_is_said_without_a_frequency_or_beyond_the_branches(frequency):
    assert rate(paper(), frequency) is None


def test_the_decoded_force_has_the_errors_of_the_decoder_in_its_half_width():
    design, load = paper(), Load(depth=0.8, shear_x=0.3, friction="stick")
    decoder, response = state_answers.build_decoder(design), solve(design, load, COARSE).response
    errors = decoder.mechanics.errors
    exact, unsure = (
        state_answers.decoded(decoder, response, {"shift": [own] * 3})["half_width"] for own in (0, 1e-3)
    )
    assert min(exact) > 0
    assert exact == pytest.approx([errors[1], errors[1], errors[2]])
    assert all(one > own for one, own in zip(unsure, exact, strict=True))


def told(file, parts, **load):
    """What a process with this store says of a state, without pictures and times."""
    with store.opened(file, later=True) as states:
        found = [one for one in Answers(states).all_of(request(parts, **load), "quick") if one is not None]
    return [(part, {key: data[key] for key in data if key not in ("section", "seconds")}) for part, _, data in found]


@pytest.mark.parametrize(
    ("parts", "load"),
    [
        (("state", "curve", "vibration"), {"frequency": 300, "friction": "none"}),
        (("state",), {"shear": 0.2, "direction": 30}),
    ],
    ids=["press", "shear"],
)
def test_another_process_finds_the_numbers_of_a_page_in_the_store(parts, load, tmp_path, monkeypatch):
    tasks, solve = [], path_solver.solved
    monkeypatch.setattr(path_solver, "solved", lambda task, *more: tasks.append(task) or solve(task, *more))
    first = told(tmp_path / "solved.sqlite", parts, **load)
    assert {task.kind for task in tasks} >= {"states"}
    tasks.clear()
    assert told(tmp_path / "solved.sqlite", parts, **load) == first
    assert not tasks


def test_a_state_where_the_path_stops_is_shown_as_it_is_and_not_kept(tmp_path):
    deep = {"design": {"L": 6.5, "l0": 6.0, "magnet_height": 1.0}, "depth": 5.45}
    ((_, data), *_) = told(tmp_path / "solved.sqlite", ["state"], **deep)
    assert data["status"] == "not_converged"
    with store.opened(tmp_path / "solved.sqlite") as states:
        assert states.counts() == (0, 0)
