"""The verb response: numbers, files, lines and refusals."""

import csv

import pytest

from studies.simulation.vibration_report import lines, mesh_warnings, read_band

QUICK = ("--accuracy", "quick", "--count", 20)


def test_response_reports_both_motions_and_writes_their_files(run, strict, tmp_path):
    out = tmp_path / "response"
    status, text, _ = run("response", "paper", "--depth", 1, *QUICK, "--out", out, "--json")
    along_z, along_x = strict(text)
    assert status == 0
    assert (along_z["motion"], along_x["motion"]) == ("z", "x")
    assert {path.name for path in out.glob("[!.]*")} == {
        "response.csv", "ladder.csv", "response_z.png", "response_x.png", "run.json"
    }  # fmt: skip
    rows = list(csv.DictReader((out / "response.csv").open()))
    # the resonances come in addition to the 20 frequencies
    (peak,) = [row for row in rows if row["motion"] == "x" and not row["mesh_difference"]]
    assert float(peak["frequency_Hz"]) == pytest.approx(along_x["resonance_per_N_Hz"][0], rel=1e-8)
    assert [row["motion"] for row in rows] == ["z"] * 20 + ["x"] * 21
    assert float(rows[0]["force_N_per_mm"]) == pytest.approx(along_z["stiffness_N_per_mm"], rel=1e-8)
    # the first bending resonance under a force is damped by the assumed loss factor
    assert along_x["resonance_per_N_Q"][0] == pytest.approx(10, rel=0.3)
    assert along_x["reading_V_per_mm"][0] is None  # S1 on the axis does not see a motion along x at first order
    assert along_z["lift_amplitude_mm"] > along_z["kept_amplitude_mm"] > 0
    assert 0 < along_z["mesh_difference"] < 0.01
    assert 1e-3 < along_z["error_estimate"] < 0.02
    assert float(rows[0]["reading_error_estimate"]) > 0


def test_response_says_what_its_numbers_rest_on(run, strict):
    text = run("response", "paper", *QUICK, "--frequencies", "1:100", "--json")[1]
    notes = " ".join(strict(text)[0]["notes"])
    for words in ("long-term modulus", "an assumption", "contact is frozen", "rigid and has no mass"):
        assert words in notes


def test_a_sliding_plate_moves_along_z_only_and_a_free_sensor_has_no_force(run, strict):
    (sliding,) = strict(run("response", "paper", "--friction", "none", *QUICK, "--json")[1])
    assert "transmits nothing" in " ".join(sliding["notes"])
    free = strict(run("response", "paper", "--depth", 0, *QUICK, "--json")[1])
    assert [record["stiffness_N_per_mm"] for record in free] == [None, None]
    assert free[1]["resonance_per_mm_Hz"][0] > free[1]["undamped_Hz"][0]  # the silicone stiffens with the frequency


def test_frequencies_without_data_are_refused_or_marked(run, refusal, strict):
    beyond = ("response", "paper", *QUICK, "--frequencies", "1:1500")
    assert "(extrapolate)" in refusal(*beyond)
    status, out, _ = run(*beyond, "--extrapolate", "--json")
    assert status == 0
    assert "extrapolation" in strict(out)[0]["warnings"][0]


@pytest.mark.parametrize(
    "options",
    [
        ("--frequencies", "0:10"),
        ("--frequencies", "-1:10"),
        ("--frequencies", "100:1"),
        ("--frequencies", "10"),
        ("--frequencies", "1:nan"),
        ("--count", 1),
        ("--depth", -1),
        ("--depth", 0, "--shear", 1),
        ("--shear", 1, "--friction", "none"),
        ("--shear", 1, "--friction", "0"),
        ("--friction", "slide"),
        ("--friction", "nan"),
        ("--grip", 0),
        ("--plate-tilt", "inf"),
        ("--plate-tilt", 90),
        ("--plate-tilt", 5, "--shear-y", 0.1),
        ("--frequencies", "1:9000", "--extrapolate"),
    ],
)
def test_bad_input_is_one_sentence(refusal, options):
    refusal("response", "paper", "--accuracy", "quick", *options)


def test_a_state_that_is_unstable_is_a_failed_solve(run, strict):
    status, out, err = run("response", "paper", "--set", "L=32", "--depth", 6, *QUICK, "--json")
    (record,) = strict(out)
    assert (status, record["status"]) == (3, "failed")
    assert "take a smaller depth" in err


def test_a_band_is_read_from_its_text():
    assert read_band("0.5:20") == (0.5, 20.0)


def test_a_sensor_that_gives_way_under_a_force_says_so(run, strict):
    status, out, _ = run("response", "paper", "--depth", 3.5, *QUICK, "--json")
    along_x = strict(out)[1]
    assert (status, along_x["status"]) == (3, "unstable")
    assert "gives way under a force" in along_x["message"]


def test_an_elastic_sensor_has_resonances_without_a_quality_factor(run, strict):
    along_x = strict(run("response", "paper", "--set", "loss_factor=0", *QUICK, "--json")[1])[1]
    assert along_x["resonance_per_mm_Hz"][0] == pytest.approx(along_x["undamped_Hz"][0], rel=1e-6)
    assert set(along_x["resonance_per_mm_Q"]) == {None}


def test_a_response_beyond_buckling_has_the_status_and_the_message_of_a_solve(run, strict):
    sensor = ("paper", "--set", "L=24", "--magnet", "ignored", "--depth", "3", "--accuracy", "quick")
    told = "a beam whose tip slides freely on the plate buckles sideways"
    status, out, err = run("response", *sensor, "--count", "5", "--json")
    assert status == 3
    assert told in err
    assert {row["status"] for row in strict(out)} == {"unstable"}
    status, out, err = run("modes", *sensor, "--count", "2", "--json")
    assert (status, strict(out)[0]["status"]) == (3, "unstable")
    assert told in err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--depth", "2"), "depth must be 0; got 2 mm"),
        (("--friction", "none"), "--friction has no meaning with --grip"),
        (("--plate-tilt", "5"), "plate tilt must be 0; got 5 degrees"),
    ],
)
def test_a_grip_refuses_what_belongs_to_a_plate(refusal, options, message):
    assert message in refusal("response", "paper", "--grip", "1", "--shear", "0.1", *options)


# Lines of a motion on the screen

PRESS = {
    "status": "ok",
    "message": "at 600 Hz S1 reads half as much",
    "motion": "z",
    "depth_mm": 1.0,
    "shear_mm": 0.0,
    "shear_y_mm": 0.0,
    "force_N": [0.0, 0.0, 4.2],
    "lowest_Hz": 1.0,
    "highest_Hz": 1000.0,
    "stiffness_N_per_mm": 11.0,
    "undamped_Hz": [1294.0, 2627.0],
    "resonance_per_mm_Hz": [],
    "resonance_per_mm_Q": [],
    "resonance_per_N_Hz": [559.0, 900.0],
    "resonance_per_N_Q": [8.23, None],
    "element": ["S1", "S2"],
    "reading_V_per_mm": [0.08, None],
    "reading_V_per_N": [0.007, None],
    "bandwidth_per_mm_Hz": [None, None],
    "bandwidth_per_N_Hz": [812.0, None],
    "accurate_per_N_Hz": [2.2, None],
    "relative_reading_at_600": [0.5, None],
    "phase_at_600_deg": [-7.0, None],
    "kept_amplitude_mm": 0.2,
    "kept_amplitude_Hz": 330.0,
    "lift_amplitude_mm": None,
    "lift_amplitude_Hz": None,
    "mesh_difference": 0.001,
    "largest_mesh_difference": 0.002,
    "error_estimate": 0.003,
    "largest_error_estimate": 0.01,
    "reading_error_estimate": 0.002,
    "largest_reading_error_estimate": None,
    "factorisations": 18,
    "reduced_error": 1e-10,
}


def test_each_line_has_a_name_of_its_own_and_no_bare_unit():
    names = [name for name, _ in lines(PRESS)]
    assert len(set(names)) == len(names)
    assert all(any(letter.isalnum() for letter in value.removesuffix("Hz")) for _, value in lines(PRESS))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("resonances, plate of fixed amplitude", "none in the band"),
        ("resonances, force of fixed amplitude", "559 Hz (Q = 8.23), 900 Hz"),
        ("readings per mm at 1 Hz", "0.08, - V/mm"),
        ("readings per mm are 3 dB lower at", "above 1000, - Hz"),  # - for an element that reads nothing
        ("readings per N are 5 % off at", "2.2, - Hz"),
        ("estimated error of the force", "median 0.3 %, largest 1 %"),
        ("amplitude that opens a quarter of the contact", "0.2 mm, the least, at 330 Hz"),
    ],
)
def test_values_say_what_is_missing(name, value):
    assert dict(lines(PRESS))[name] == value


def test_a_free_sensor_has_no_lines_of_a_force():
    free = PRESS | {"stiffness_N_per_mm": None, "resonance_per_N_Hz": [], "resonance_per_N_Q": []}
    text = " ".join(name for name, _ in lines(free))
    assert "base of fixed amplitude" in text
    assert not any(word in text for word in ("force", "contact", "per N"))


def test_a_shear_across_x_is_told_with_both_components():
    across = PRESS | {"shear_y_mm": 0.5}
    assert dict(lines(across))["shear at rest"] == "0 mm along x, 0.5 mm along y"


@pytest.mark.parametrize(
    ("difference", "said"), [(0.049, ""), (0.37, "differ by 37 %"), (None, "error of the mesh is not known")]
)
def test_a_mesh_that_is_too_coarse_is_warned_of(difference, said):
    warnings = mesh_warnings(PRESS | {"mesh_difference": difference})
    assert said in " ".join(warnings)
    assert bool(warnings) == bool(said)
