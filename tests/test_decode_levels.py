"""What decode says of the force of its level beside that of level finite, and of poses without contact."""

import csv

import numpy as np
import pytest
from numpy.testing import assert_allclose

from analytic import beam
from analytic.decode import decode, decoder
from analytic.inverse import response_surface
from analytic.stream import Stream
from geometry.design import Design, paper
from geometry.loads import Load
from studies.sensing import decode_readings

PRESSED = "2.973987,2.903726,2.853713"
"""Readings of finite elements at a press force of 8.8 N."""
AT_REST = "2.87,2.79,2.79"
"""Readings at rest, rounded to 0.01 V: the magnet seems to stand above its rest."""


def decoded(run, strict, readings, *options):
    status, out, err = run("decode", "paper", "--readings", readings, "--json", *options)
    (record,) = strict(out)
    return status, record, err


def test_the_force_of_the_default_level_is_said_to_be_far_from_that_of_level_finite(run, strict):
    status, record, err = decoded(run, strict, PRESSED)
    assert (status, record["status"], record["level"]) == (0, "ok", "paper")
    assert record["force_N"][2] == pytest.approx(2.98, abs=0.01)
    assert record["finite_force_N"][2] == pytest.approx(9.2, abs=0.3)
    assert err.count("\n") == len(record["warnings"]) == 1
    assert "level paper gives a force of 3.04 N at this pose, level finite 9.29 N (they differ by 67.9 %)" in err
    assert "--level finite" in err
    assert "--responses" in err


def test_level_finite_has_nothing_to_compare(run, strict):
    _, record, err = decoded(run, strict, PRESSED, "--level", "finite")
    assert (record["level"], record["finite_force_N"], record["warnings"], err) == ("finite", None, [], "")


def test_levels_that_nearly_agree_say_nothing_of_each_other(run, strict):
    """At a small press of 0.3 mm level magnet is within a few percent of finite."""
    (load,) = strict(run("analytic", "paper", "--depth", 0.3, "--level", "magnet", "--json")[1])
    _, record, err = decoded(run, strict, ",".join(map(repr, load["readings_V"])), "--level", "magnet")
    assert_allclose(record["force_N"], record["finite_force_N"], rtol=0.1, atol=0.08)
    sigma = ", ".join(f"{value:.2g}" for value in record["tolerance_N"])
    rest = (
        "these readings may be those of a sensor at rest whose parts lie within tolerances, which change the force "
        f"of 0.601 N by {sigma} N along x, y and z (standard deviations; 124 of 400 such sensors have no force there)"
    )
    assert (record["level"], err) == ("magnet", f"magtip: warning: {rest}: calibrate the sensor\n")


def test_a_pose_beyond_level_finite_is_said_to_be_unchecked(run, strict):
    (seen,) = strict(run("readings", "paper", "--shift", "0,0,-2", "--json")[1])
    _, record, err = decoded(run, strict, ",".join(map(repr, seen["readings_V"])))
    assert record["finite_force_N"] == [None] * 3
    assert "outside the range of level finite, so the error of the force of level paper is unknown" in err


def test_a_table_names_its_level_and_the_worst_row(run, strict, tmp_path):
    (tmp_path / "r.csv").write_text(f"S1_V,S2_V,S3_V\n{AT_REST}\n{PRESSED}\n2.5,2.5,2.5\n")
    status, out, err = run("decode", "paper", "--file", "r.csv")
    assert status == 3
    assert [row["level"] for row in csv.DictReader(out.splitlines())] == ["paper"] * 3
    assert "in 1 of 3 rows the force of level paper differs by more than 10 % from that of level finite" in err
    assert "by 67.9 % in row 2 (3.04 N, not 9.29 N)" in err
    # where no pose of this level has the readings, its search takes seconds
    (tmp_path / "r.csv").write_text(f"S1_V,S2_V,S3_V\n{AT_REST}\n{PRESSED}\n")
    records = strict(run("decode", "paper", "--file", "r.csv", "--json", "--level", "finite")[1])
    assert [record["level"] for record in records] == ["finite"] * 2


@pytest.mark.parametrize(("options", "name"), [((), "none"), (("--level", "finite"), "finite")])
def test_a_lookup_table_says_its_level(run, strict, options, name):
    (record,) = strict(run("table", "paper", "--step", 1, "--out", "t.npy", "--json", *options)[1])
    assert record["level"] == name


def test_the_force_beside_is_that_of_the_formulas_where_these_hold():
    """Up to the polynomials' misfit; beyond a depth of D/4 there is none."""
    design = paper()
    law = decode_readings.of_level(design, "finite")
    loads = [Load(depth=d, shear_x=s, friction="stick") for d, s in ((1.0, 0.0), (1.0, 1.0), (1.9, 0.5), (2.4, 0.0))]
    found = [beam.solve(design, load, "finite") for load in loads]
    beside = decode_readings.finite_force(design, law, np.array([one.shift for one in found]))
    assert_allclose(beside[:3], [one.force for one in found[:3]], atol=2 * max(law.errors[1:3]))
    assert np.isnan(beside[3]).all()


def test_a_design_that_level_finite_does_not_know_is_not_compared():
    design = Design(nu=0.4)
    law = decode_readings.of_level(design, "finite")
    assert np.isnan(decode_readings.finite_force(design, law, np.array([[0.0, 0.0, -0.3]]))).all()
    assert np.isnan(decode_readings.finite_force(design, None, np.array([[0.0, 0.0, -0.3]]))).all()


@pytest.mark.parametrize("level", ["paper", "finite"])
def test_a_plate_that_does_not_touch_carries_nothing(run, strict, level):
    status, record, _ = decoded(run, strict, AT_REST, "--level", level)
    assert (status, record["status"], record["contact"]) == (0, "ok", False)
    assert record["force_N"] == [0.0] * 3
    assert (record["depth_mm"], record["shear_mm"], record["shear_y_mm"]) == (0.0, 0.0, 0.0)
    assert record["message"].startswith("the plate does not touch the tip at this pose (depth 0), so the load is 0")


@pytest.mark.parametrize("level", ["paper", "finite"])
def test_a_stream_carries_what_the_decoder_does(level):
    coder = decoder(paper(), decode_readings.of_level(paper(), level))
    readings = decode_readings.in_tesla(coder.forward.elements, [[float(v) for v in AT_REST.split(",")]], "V")
    assert Stream(coder).step(tuple(readings[0])).force == tuple(decode(coder, readings).force[0]) == (0.0, 0.0, 0.0)


def test_a_press_is_never_taken_for_no_contact():
    law = decode_readings.of_level(paper(), "finite")
    sunk = np.array([[0.4, 0.1, 0.0], [0.0, 0.0, 0.0], [-0.02, -0.3, -1.0]])
    force, load, _ = response_surface.force_and_load(law, sunk)
    assert_allclose(force, response_surface.forces(law, sunk)[0])
    assert (load[0] > 0).all()


def test_the_force_of_a_thin_layer_below_a_large_magnet_is_that_of_its_level():
    sensor = Design(D=6.7, L=7.1, magnet_diameter=5.0, magnet_height=3.0, hall_layout="tle493d-p2b6", l0=4.9)
    law = decode_readings.of_level(sensor, "finite")
    for depth in (0.2, 0.5, 0.9, 1.5):
        state = beam.solve(sensor, Load(depth), "finite")
        found = response_surface.force_and_load(law, np.array([state.shift]).T)[0][2, 0]
        assert abs(found / state.force[2] - 1) < 0.05, depth
