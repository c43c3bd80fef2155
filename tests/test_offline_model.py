"""The model of the page without a server: the surrogate's answer, and what follows from it."""

import math

import numpy as np
import pytest

from analytic import hall
from geometry.design import BadInput, Design
from studies.explorer import offline_model
from studies.explorer.explorer_state import request_of
from studies.surrogate import surrogate_response


def state(design=None, formula_level="finite", **load):
    content = {"design": design or {}, "load": {"friction": "stick" if load.get("shear") else "none"} | load}
    return request_of({"number": 1, "state": content, "formula_level": formula_level}).state


def test_response_is_that_of_the_surrogate():
    one = state(depth=1.0, shear=-1.5, direction=30)
    part, estimate = offline_model.state_part(one), surrogate_response.respond(one.design, one.load)
    assert part["response"]["force"] == pytest.approx(estimate.response.force)
    assert part["response"]["shift"] == pytest.approx(estimate.response.shift)
    assert part["response"]["tilt_y"] == pytest.approx(math.degrees(estimate.response.tilt_y))
    widths = part["estimates"]["force"]
    assert np.linalg.norm(widths) == pytest.approx(estimate.force_error * np.linalg.norm(estimate.response.force))


def test_refusals_are_those_of_the_surrogate():
    one = state({"law": "yeoh"}, depth=1.0)
    with pytest.raises(BadInput, match="the law neo-hookean only; got yeoh: take finite elements"):
        offline_model.state_part(one)


@pytest.mark.parametrize("load", [{"depth": 2.0}, {"depth": 2.0, "shear": 0.5}])
def test_a_press_beyond_buckling_is_refused_and_ends_the_curve(load):
    slender = {"L": 24, "l0": 22}
    with pytest.raises(BadInput, match="the surrogate knows a press to stay stable to"):
        offline_model.state_part(state(slender, **load))
    curve, stability = (
        part(state(slender, **load)) for part in (offline_model.curve_part, offline_model.stability_part)
    )
    assert curve["depth"][-1] == pytest.approx(stability["stable_to"])
    assert stability["stable_to"] < stability["critical_depth"]


def test_half_width_of_a_reading_spans_the_corners_of_the_pose():
    one = state(depth=1.0, shear=1.0)
    plane = offline_model.solve(one)[1]
    part = offline_model.state_part(one)["readings"]
    corners = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T * plane.half_width[:3] + plane.value[:3]
    volts = np.array([hall.readings(one.design, shift=(u, 0, w), tilt=(0, t)).V for u, w, t in corners])
    assert np.abs(volts - part["volts"]).max(axis=0) == pytest.approx(part["half_width"], rel=0.02)


def test_without_steps_the_decoded_force_is_the_force():
    one = state({"hall_noise": 1e-3}, depth=1.0, shear=1.0, direction=20)
    part = offline_model.state_part(one)
    assert part["decoded"]["force"] == pytest.approx(part["response"]["force"])
    twice = offline_model.state_part(state({"hall_noise": 2e-3}, depth=1.0, shear=1.0, direction=20))
    assert twice["decoded"]["noise"] == pytest.approx([2 * noise for noise in part["decoded"]["noise"]])


@pytest.mark.parametrize(
    ("design", "load", "status"),
    [
        ({"hall_high": 2.85}, {"depth": 1.0}, "saturated"),
        ({}, {"depth": 0.1}, "out_of_workspace"),
    ],
)
def test_readings_that_give_no_load_say_so(design, load, status):
    decoded = offline_model.state_part(state(design, **load))["decoded"]
    assert (decoded["status"], decoded["force"]) == (status, None)


def test_curve_passes_through_the_state():
    one = state(depth=1.0)
    curve, part = offline_model.curve_part(one), offline_model.state_part(one)
    assert np.interp(1.0, curve["depth"], curve["force"]) == pytest.approx(part["response"]["force"][2], rel=0.01)
    assert curve["level"]["name"] == "finite"
    assert len(curve["paper"]["shift"]) == len(curve["estimates"]["force"]) == len(curve["depth"])


def test_a_slender_beam_has_a_critical_depth():
    slender = Design(L=24, l0=22)
    part = offline_model.stability_part(state({"L": 24, "l0": 22}, depth=0.5))
    assert 0 < part["critical_depth"] < 0.375 * slender.D
    assert offline_model.stability_part(state(depth=0.5))["critical_depth"] is None


def test_field_lines_follow_the_field():
    one = state(depth=1.0, shear=1.0)
    plane = offline_model.solve(one)[1]
    u, w, t = plane.value[:3]
    for line in offline_model.field_lines_part(one)["lines"]:
        points = np.array(line)
        middle = (points[1:] + points[:-1]) / 2
        where = np.stack([middle[:, 0], 0 * middle[:, 0], middle[:, 1]], axis=1)
        B = hall.field_at(where, one.design, (u, 0.0, w), (0.0, t))[:, [0, 2]]
        along = np.diff(points, axis=0)
        cosine = (along * B).sum(axis=1) / np.linalg.norm(along, axis=1) / np.linalg.norm(B, axis=1)
        assert np.median(cosine) < -0.999
