"""Lines of a motion on the screen."""

import pytest

from studies.simulation.motion_report import lines, mesh_warnings

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
