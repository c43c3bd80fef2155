"""Decoded readings of built sensors: what their tolerances explain."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from analytic import beam, decode
from analytic.parts import of_design
from geometry.design import paper
from geometry.loads import Load
from studies.sensing import decode_readings
from studies.sensitivity import decode_tolerances
from studies.sensitivity.made_sensors import SPECS, made_readings, made_sensors, nominal_sensor


def field_of(sensors, shift, tilt):
    """What sensors read in a pose, as the decoder of the nominal sensor understands it, shape (n, 3), T."""
    poses = np.broadcast_to(shift, (len(sensors), 1, 3)), np.broadcast_to(tilt, (len(sensors), 1, 2))
    return decode.field_of(of_design(paper()), made_readings(sensors, *poses).output[:, 0])


@pytest.fixture(scope="module")
def coder():
    return decode.decoder(paper(), decode_readings.of_level(paper(), "finite"))


def checked(coder, field):
    return decode_tolerances.check(coder, field, decode.decode(coder, field))


def test_nineteen_of_twenty_built_sensors_at_rest_are_told_to_be_so(coder):
    # other sensors than those of the check
    field = field_of(made_sensors(paper(), count=400, seed=9), np.zeros(3), np.zeros(2))
    found = checked(coder, field)
    assert 0.9 < (found.rest_probability >= decode_tolerances.DOUBTFUL).mean() < 0.98
    told = [status == "uncalibrated" for status in found.status]
    nominal = decode.decode(coder, field)
    with_force = (np.linalg.norm(nominal.force, axis=1) > 0) & (np.array(nominal.status) == "ok")
    assert with_force.sum() > 100
    assert told == (with_force & (found.rest_probability >= decode_tolerances.DOUBTFUL)).tolist()
    (sentence,) = found.warnings(nominal.force)
    assert "of 400 rows may be those of a sensor at rest" in sentence


def test_a_deep_press_is_not_a_sensor_at_rest_and_its_force_has_the_spread_of_built_ones(coder):
    response = beam.solve(paper(), Load(depth=2.0), "finite")
    pose = response.shift, np.zeros(2)
    nominal = field_of(nominal_sensor(paper()), *pose)
    found = checked(coder, nominal)
    assert (found.rest_probability[0], found.status) == (0, ["ok"])
    assert found.warnings(decode.decode(coder, nominal).force) == []
    # independent sensors scatter as much as the check says, where they have a force
    force = decode.decode(coder, field_of(made_sensors(paper(), count=400, seed=9), *pose)).force
    force = force[np.isfinite(force[:, 2])]
    spread = np.sqrt(((force - decode.decode(coder, nominal).force) ** 2).mean(axis=0))
    assert_allclose(found.tolerance_N, spread, rtol=0.2)


def test_rows_without_readings_are_of_no_sensor(coder):
    found = checked(coder, np.array([[np.nan, 0.0, 0.0]]))
    assert np.isnan(found.rest_probability).all()
    assert (found.row, found.tolerance_N, found.warnings(np.full((1, 3), np.nan))) == (None, [], [])


def test_the_verb_tells_forces_that_tolerances_explain(run, strict, tmp_path):
    """A press of 0.3 mm may be a built sensor at rest; with parts as good as a calibration makes them it is not."""
    (load,) = strict(run("analytic", "paper", "--depth", 0.3, "--level", "finite", "--json")[1])
    text = ",".join(map(repr, load["readings_V"]))
    command = ("decode", "paper", "--level", "finite", "--json")
    status, out, _ = run(*command, "--readings", text)
    (record,) = strict(out)
    assert (status, record["status"]) == (0, "uncalibrated")
    assert record["message"].endswith("calibrate the sensor")
    assert_allclose(record["tolerance_N_per_N"], np.array(record["tolerance_N"]) / np.linalg.norm(record["force_N"]))
    assert record["tolerance_N_per_N"][2] > 1
    exact = [word for name in SPECS for word in ("--tolerance", f"{name}=1e-5")]
    (record,) = strict(run(*command, "--readings", text, *exact)[1])
    assert (record["status"], record["message"], record["warnings"], record["rest_probability"]) == ("ok", "", [], 0)
    assert record["tolerance_N_per_N"][2] < 1e-3
    (tmp_path / "r.csv").write_text(f"S1_V,S2_V,S3_V\n{text}\n2.973987,2.903726,2.853713\n")
    status, out, err = run(*command, "--file", "r.csv")
    assert (status, [row["status"] for row in strict(out)]) == (0, ["uncalibrated", "ok"])
    assert "magtip: 1 of 2 rows uncalibrated: the force may be one of the tolerances" in err
    assert run(*command, "--readings", text, "--tolerance", "hall_gain=-1")[0] == 2
