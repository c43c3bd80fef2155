"""Surroundings of a sensor: closed forms, finite elements of an iron block, and errors of decoded forces."""

import json
import math

import numpy as np
import pytest
from scipy.stats import qmc

from analytic import surroundings
from analytic.hall import field_at
from analytic.magnet import MU_0, dipole_field
from analytic.surroundings import IronPiece, IronPlane, Neighbour, Poses
from geometry.design import paper

DESIGN = paper()
POINTS = np.array([[1.0, 2.0, -2.0], [4.5, -3.0, 2.0]])
REST = Poses(np.zeros((1, 3)), np.zeros((1, 2)), np.zeros(1))
MOVED = Poses(np.array([[0.5, 0.2, -1.0]]), np.array([[0.05, 0.1]]), np.array([1.0]))
UP, AWAY = np.array([0.0, 0.0, 1.0]), np.array([-1.0, 0.0, 0.0])


def test_the_image_below_is_a_magnet_of_the_same_pole():
    plane = IronPlane(DESIGN, np.array([0.0, 0.0, -8.0]), UP)
    image = field_at(POINTS, DESIGN, shift=(0.0, 0.0, -16.0 - 2 * DESIGN.H))
    assert plane(POINTS, REST)[0] == pytest.approx(999 / 1001 * image, rel=1e-12, abs=1e-15)


def test_the_image_beside_is_a_magnet_of_the_other_pole():
    plane = IronPlane(DESIGN, np.array([12.0, 0.0, 0.0]), AWAY)
    image = -field_at(POINTS, DESIGN, shift=(24.0, 0.0, 0.0))
    assert plane(POINTS, REST)[0] == pytest.approx(999 / 1001 * image, rel=1e-12, abs=1e-15)


def test_field_and_image_meet_a_perfect_iron_at_right_angles():
    plane = IronPlane(DESIGN, np.array([0.0, 0.0, -8.0]), UP, 1e9)
    on_it = np.array([[1.0, 2.0, -8.0 + 1e-9], [4.0, -1.0, -8.0 + 1e-9]])
    whole = plane(on_it, MOVED)[0] + MOVED.field(DESIGN, on_it)[0]
    assert np.abs(whole[:, :2]).max() < 1e-8 * np.abs(whole[:, 2]).min()


def test_points_in_the_iron_have_no_field():
    assert np.isnan(IronPlane(DESIGN, np.array([0.0, 0.0, -1.0]), UP)(POINTS, REST)[0, 0]).all()


def test_a_small_ball_is_the_dipole_of_its_volume():
    place = np.array([30.0, 0.0, 5.0])
    ball = IronPiece(DESIGN, place, 2.0, 2.0, UP, 1e9)(POINTS, REST)[0]
    B = field_at(place[None], DESIGN)[0]
    # mu0 m = 4 pi a^3 B: the field of a magnet of that moment, along B
    x = POINTS - place
    size = np.linalg.norm(x, axis=1)[:, None]
    along = (x @ B)[:, None]
    assert ball == pytest.approx(3 * x * along / size**5 - B / size**3, rel=1e-6)


def test_a_rod_along_the_field_answers_more_than_a_ball_of_its_volume():
    place = np.array([0.0, 0.0, 40.0])
    rod = IronPiece(DESIGN, place, 1.0, 8.0, UP)(POINTS, REST)
    ball = IronPiece(DESIGN, place, 2.0, 2.0, UP)(POINTS, REST)
    assert np.linalg.norm(rod) > 3 * np.linalg.norm(ball)


def test_a_rod_has_the_field_of_its_volume_magnetised_by_its_mean():
    """Both means over the rod's volume by points spread in it; the rod lies nearer than half its length."""
    place, axis, a, b = np.array([9.0, 0.0, 4.0]), np.array([0.0, 0.6, 0.8]), 8.0, 2.0
    rod = IronPiece(DESIGN, place, 2 * b, 2 * a, axis)(POINTS, REST)[0]
    even = qmc.Sobol(3, seed=0).random(2**14)
    up, turn = 2 * even[:, 1] - 1, 2 * np.pi * even[:, 2]
    flat = np.sqrt(1 - up**2)
    inside = np.cbrt(even[:, :1]) * np.column_stack([flat * np.cos(turn), flat * np.sin(turn), up])
    along = (inside @ axis)[:, None] * axis
    volume = place + a * along + b * (inside - along)
    B0 = field_at(volume, DESIGN).mean(axis=0)
    N, across = surroundings.demagnetising_factors(a / b)
    t = (B0 @ axis) * axis
    J = 999 * (t / (1 + 999 * N) + (B0 - t) / (1 + 999 * across)) * 4 / 3 * math.pi * a * b * b
    x = POINTS[:, None] - volume
    size = np.linalg.norm(x, axis=2)[..., None]
    field = (3 * x * (x @ J)[..., None] / size**5 - J / size**3).mean(axis=1) / (4 * math.pi)
    assert rod == pytest.approx(field, rel=5e-3, abs=1e-3 * np.abs(field).max())


def test_a_rod_far_away_is_the_dipole_of_its_demagnetising_factors():
    place = np.array([0.0, 0.0, 300.0])
    along, across = (
        IronPiece(DESIGN, place, 1.0, 20.0, axis)([[0.0, 0.0, 0.0]], REST)[0, 0, 2] for axis in (UP, AWAY)
    )
    N, N_across = surroundings.demagnetising_factors(20.0)
    assert along == pytest.approx((1 + 999 * N_across) / (1 + 999 * N) * across, rel=0.01)


def test_the_far_field_of_a_motor_is_a_uniform_one_with_its_gradient():
    far = surroundings.motor(np.array([0.0, 0.0, 400.0]), 0.5 * UP)
    middle, step = np.array([[0.0, 0.0, 1.0]]), 1e-2
    G = np.array([
        (far(middle + step * e, REST) - far(middle - step * e, REST))[0, 0] / (2 * step) for e in np.eye(3)
    ])  # fmt: skip
    assert np.trace(G) == pytest.approx(0, abs=1e-6 * np.abs(G).max())
    whole = far(middle, REST) + surroundings.gradient(G, middle[0])(POINTS, REST)
    assert far(POINTS, REST) == pytest.approx(whole, rel=1e-3, abs=1e-3 * np.abs(whole).max())


def test_a_motor_is_a_dipole():
    place, moment = np.array([50.0, 0.0, 0.0]), 0.1
    J = MU_0 * moment / (math.pi * 1e-9)  # of a cylinder of radius and height 1 mm
    found = surroundings.motor(place, moment * UP)(POINTS, REST)[0]
    assert found == pytest.approx(dipole_field(POINTS - place, 1.0, 1.0, J), rel=1e-12)


def test_a_neighbour_has_the_field_of_its_own_pose():
    other = Neighbour(DESIGN, np.array([16.0, 0.0, 0.0]), MOVED.shift[0], MOVED.tilt[0])
    assert other(POINTS, REST)[0] == pytest.approx(MOVED.field(DESIGN, POINTS - [16.0, 0.0, 0.0])[0], rel=1e-12)


def test_two_jaws_see_each_other_alike():
    """The middle between two sensors that face each other has no field along the axis that one would have."""
    other = Neighbour(DESIGN, np.array([0.0, 0.0, 2 * DESIGN.L + 4.0]), np.zeros(3), np.zeros(2), facing=True)
    middle = np.array([[0.0, 0.0, DESIGN.L + 2.0]])
    assert other(middle, REST)[0, 0, 2] == pytest.approx(-field_at(middle, DESIGN)[0, 2], rel=1e-12)


def test_the_reach_of_the_magnet_is_where_its_field_on_the_axis_is_that():
    far = surroundings.reach(DESIGN, 1e-4)
    assert field_at([[0.0, 0.0, DESIGN.H + far]], DESIGN)[0, 2] == pytest.approx(-1e-4, rel=1e-6)


# The verb


def record(run, *words):
    status, out, err = run("disturb", "paper", *words, "--json")
    assert status == 0, err
    return json.loads(out)


def row(found, name):
    return next(each for each in found["disturbances"] if each["disturbance"] == name)


def test_nothing_disturbs_nothing(run):
    found = row(record(run, "--ambient", "0"), "uniform field")
    assert found["change_mT"] == 0
    assert found["error_N"] < 1e-3 * 18


def test_the_error_of_a_weak_field_grows_with_it(run):
    weak, strong = (row(record(run, "--ambient", text), "uniform field") for text in ("10", "20"))
    assert strong["error_N"] == pytest.approx(2 * weak["error_N"], rel=0.05)
    assert strong["tared_N"] == pytest.approx(2 * strong["error_N"], rel=0.05)


def test_a_touched_object_is_not_tared_away(run):
    found = row(record(run), "iron object")
    assert found["tared_N"] == found["error_N"] > 1.0


def test_a_hotter_sensor_is_stiffer_by_the_absolute_temperature(run):
    """A force shifts the magnet less, by which the decoder tells less of it."""
    found = record(run, "--warming", "20")
    modulus = next(each for each in found["warming"] if each["cause"].startswith("modulus"))
    assert modulus["error_N"] == pytest.approx(found["full_scale_N"] * (1 - 293.15 / 313.15), rel=0.02)


def test_per_kelvin_all_is_the_sum_of_its_causes_and_nulls_drift_by_what_is_stated(run):
    found = record(run, "--warming", "1", "--null-drift", "3")["warming"]
    *causes, known, left = [each["press_N_per_K"] for each in found]
    # nulls drift to either side
    assert causes.pop(2) is None
    assert known == pytest.approx(sum(causes), rel=0.01)
    assert min(map(abs, causes)) > 1e-3
    # what the temperature corrects is all but the expansions
    assert left == pytest.approx(sum(causes[-2:]), rel=0.01)
    # taring removes a drift
    assert found[2]["tared_N"] < 1e-3 * found[2]["error_N"]
    # what is not stated is not known, and is in no sum
    unknown = record(run, "--warming", "1")["warming"]
    assert unknown[2]["error_N"] is None
    assert unknown[-2]["press_N_per_K"] == pytest.approx(known, rel=1e-9)
    assert unknown[-2]["error_N"] < found[-2]["error_N"] < unknown[-2]["error_N"] + 1.01 * found[2]["error_N"]


def test_what_the_mechanics_do_not_reach_is_said_and_has_no_error(run, toml):
    """A colder silicone is softer, and its largest press lies beyond what is known; so do required loads of 40 N."""
    cold = record(run, "--warming=-50")
    modulus = next(each for each in cold["warming"] if each["cause"].startswith("modulus"))
    assert modulus["no_force_percent"] > 0
    status, out, err = run("disturb", toml("[requirements]\nforce_z = 40\n"), "--json")
    assert status == 0, err
    assert "loads of the range lie beyond the mechanics" in err
    assert json.loads(out)["loads"] == 2


def test_a_farther_neighbour_disturbs_less(run):
    found = record(run, "--neighbour", "10,0", "--neighbour", "20,0")["disturbances"]
    near, far = (each["tared_N"] for each in found if each["disturbance"] == "second sensor beside")
    assert far < near / 4


def test_files(run, tmp_path):
    assert run("disturb", "paper", "--motor", "0.02,0,60,0", "--out", tmp_path)[0] == 0
    assert {path.name for path in tmp_path.iterdir()} >= {"DISTURB.md", "disturbances.csv", "warming.csv"}
    assert "0.02 A m2" in (tmp_path / "DISTURB.md").read_text("utf-8")


CHIPS = ("--set", "hall_layout=tle493d-w2b6", "--set", "chip_count=3", "--set", "chip_x=5")
CHIPS += ("--set", "chip_noise=0.00005")


def test_three_chips_reject_a_uniform_field_at_the_price_of_noise(run):
    plain, rejected = record(run, *CHIPS), record(run, *CHIPS, "--reject-ambient")
    assert row(rejected, "uniform field")["tared_N"] < 1e-6 < 0.1 < row(plain, "uniform field")["tared_N"]
    assert 1.0 < rejected["noise_factor"] < 3.0
    assert row(rejected, "field gradient")["tared_N"] > 1e-3


def test_decode_rejects_a_uniform_field(run):
    read = run("readings", "paper", *CHIPS, "--shift=0.3,0.1,-0.8", "--ambient", "5e-4,-3e-4,4e-4", "--json")
    readings = ",".join(map(str, json.loads(read[1])["readings_T"]))
    words = ("decode", "paper", *CHIPS, f"--readings={readings}", "--json", "--ignore-tilt")
    with_field, without = (json.loads(run(*words, *more)[1]) for more in ((), ("--reject-ambient",)))
    assert without["status"] in ("ok", "uncalibrated")
    assert without["shift_mm"] == pytest.approx([0.3, 0.1, -0.8], abs=1e-3)
    assert with_field["status"] == "inconsistent"
    field, half = without["ambient_uT"], without["ambient_half_width_uT"]
    assert field == pytest.approx([500, -300, 400], abs=1e-3)
    assert "ambient_uT" not in with_field
    assert 50 < min(half) < max(half) < 500


REFUSALS = {
    "--reject-ambient": "which 3 readings do not tell from a pose: take three chips of three axes or more",
    "--iron up=3": "--iron takes below, beside, front and a distance, such as below=10; got 'up=3'",
    "--iron below=1": "--iron below must lie farther than",
    "--ball 4,5,0,4": "overlaps the beam",
    "--rod 3,50,4,0,5,0,1,0": "--rod 3,50,4,0,5,0,1,0 overlaps the beam: move it out, or turn it",
    "--rod 3,50,16,0,5,0,0,0": "the direction of the axis is 0 or not finite; give one such as 0,1,0",
    "--rod 3,2,16,0,5,0,1,0": "--rod: the length must lie between 3 and 10000 mm; got 2 mm",
    "--gradient=-1": "--gradient must lie between 0 and 1e+06 uT/mm; got -1 uT/mm",
    "--ball 3,4": "--ball takes DIAMETER,X,Y,Z in mm; got '3,4'",
    "--neighbour 3,0": "its axis must be farther away than D = 8 mm",
    "--motor 0.1,5,0,5": "its place must lie D = 8 mm or more off the beam",
    "--motor 0,50,0,0": "the moment must be above 0 and at most 1000 A m2; got 0",
    "--iron beside=4.5": "--iron beside must lie farther than 5",
    "--warming 0": "--warming must not be 0",
    "--ambient=-3": "--ambient must lie between 0 and 1e+06 uT; got -3 uT",
    "--jaw=-1": "--jaw must lie between 0 and 10000 mm; got -1 mm",
}


@pytest.mark.parametrize("words", REFUSALS)
def test_refusals(run, words):
    status, out, err = run("disturb", "paper", *words.split())
    assert (status, out) == (2, "")
    assert REFUSALS[words] in err
