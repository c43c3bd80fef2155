"""The verb readings, and the export to magpylib."""

import pytest
from numpy.testing import assert_allclose

from analytic import hall
from geometry.design import BadInput, Design, paper
from studies.sensing import field_readings


@pytest.mark.parametrize(
    "tokens",
    [
        ("readings", "paper", "--shift", "1,2,x"),
        ("readings", "paper", "--ambient", "1,2"),
        ("readings", "paper", "--seed", "-1"),
        ("readings", "paper", "--set", "hall_layout=four"),
    ],
)
def test_bad_options_are_a_sentence(run, tokens):
    status, out, err = run(*tokens)
    assert (status, out, err.count("\n")) == (2, "", 1)


def test_readings_as_json(run, strict):
    status, out, err = run("readings", "paper", "--shift", "0.5,0,-1", "--tilt", "0,0.05", "--json")
    assert (status, err) == (0, "")
    (record,) = strict(out)
    expected = hall.readings(paper(), shift=(0.5, 0, -1), tilt=(0, 0.05))
    assert record["readings_T"] == list(expected.B_T)
    assert record["readings_V"] == list(expected.V)
    assert record["elements"] == ["S1", "S2", "S3"]
    assert record["saturated"] == [False] * 3


def test_readings_say_what_is_wrong(run, strict):
    status, out, err = run("readings", "paper", "--shift", "3,0,-2", "--set", "hall_high=3", "--json")
    (record,) = strict(out)
    assert status == 0
    assert any("S2 is saturated" in text for text in record["warnings"])
    assert any("extends over S2" in text for text in record["warnings"])
    assert err.count("warning") == len(record["warnings"])


def test_readings_of_a_chip_and_of_noise(run, strict):
    (chip,) = strict(run("readings", "paper", "--set", "hall_layout=tle493d-p2b6", "--json")[1])
    assert chip["readings_V"] is None
    assert len(chip["output_T"]) == 3
    assert_allclose(chip["noise_of_readings_T"], (1e-4**2 + 1.3e-4**2 / 12) ** 0.5)
    (mean,) = strict(
        run("readings", "paper", "--set", "hall_layout=tle493d-p2b6", "--set", "hall_average=100", "--json")[1]
    )
    # the chip's noise of 0.1 mT dithers its steps of 0.13 mT
    assert_allclose(mean["noise_of_readings_T"], chip["noise_of_readings_T"][0] / 10, rtol=1e-6)
    noisy = [
        strict(run("readings", "paper", "--set", "hall_noise=0.01", "--seed", s, "--json")[1])[0]["readings_V"]
        for s in (1, 1, 2)
    ]
    assert noisy[0] == noisy[1] != noisy[2]


@pytest.mark.parametrize(("layout", "north"), [("three", "down"), ("tmag5273a1", "down"), ("three", "up")])
def test_magpylib_agrees_on_readings(layout, north):
    design, shift, tilt = Design(hall_layout=layout, magnet_north=north), (0.6, -0.3, -1.1), (0.08, 0.15)
    exported = field_readings.to_magpylib(design, shift, tilt)
    (magnet,) = exported.sources
    seen = [sensor.getB(magnet)[2] for sensor in exported.sensors]
    assert_allclose(seen, hall.readings(design, shift=shift, tilt=tilt).B_T, rtol=1e-10, atol=1e-14)
    with pytest.raises(BadInput, match="no magnet"):
        field_readings.to_magpylib(Design(magnet_diameter=0, magnet_height=0))
    assert_allclose(exported.sensors[0].position, [0, 0, -2.2e-3], atol=1e-15)


def test_what_runs_into_a_chip_is_said_once(run, strict):
    tokens = ("--set", "hall_layout=tmag5273a1", "--set", "chip_x=3", "--set", "l0=4", "--json")
    (record,) = strict(run("readings", "paper", *tokens)[1])
    (warning,) = record["warnings"]
    assert warning == "the beam's wall overlaps chip -z by about 1 mm: raise l0 or chip_x"
