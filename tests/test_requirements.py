"""Files of requirements: what is read, and one sentence for everything else."""

import pytest

from studies.sizing.requirements import LIMITS, Requirements, read_requirements

FULL = """
version = 1
force_z = "5 N"
force_x = "2000 mN"
resolution_z = "5 mN"
resolution_x = 0.005
bandwidth = "0.1 kHz"
samples = 4
converter_noise = "0.2 mV"
converter_step = "0.3 mV"
largest_strain = "60 %"
no_saturation = true
unique_decoding = false
stability_margin = 1.2
first_mode = 100
drift_per_K = "0.2 %"
hysteresis = "8 %"
speed = "0.5 mm/s"
outer_size = "1 cm"
outer_shape = "square"
height = 20
process = "sla"
wall = "500 um"
D = ["6 mm", 10]
catalogues = ["mine.toml"]
shipped = ["magnets"]
magnets = ["4x2 N35"]
hall_parts = ["SS495A"]
silicones = ["Dragon Skin 30"]
seed = 7
[weights]
range = 2
size = 0
"""


def test_every_key(toml, tmp_path):
    assert read_requirements(toml(FULL)) == Requirements(
        force_z=5.0,
        force_x=2.0,
        resolution_z=0.005,
        resolution_x=0.005,
        bandwidth=100.0,
        samples=4,
        converter_noise=0.2e-3,
        converter_step=0.3e-3,
        largest_strain=0.6,
        unique_decoding=False,
        stability_margin=1.2,
        first_mode=100.0,
        drift_per_K=0.002,
        hysteresis=0.08,
        speed=0.5,
        outer_size=10.0,
        outer_shape="square",
        height=20.0,
        process="sla",
        wall=0.5,
        D_low=6.0,
        D_high=10.0,
        catalogues=(str(tmp_path / "mine.toml"),),
        shipped=("magnets",),
        magnets=("4x2 N35",),
        hall_parts=("SS495A",),
        silicones=("Dragon Skin 30",),
        seed=7,
        weight_range=2.0,
        weight_size=0.0,
    )


def test_only_the_range_is_needed(toml):
    requirements = read_requirements(toml("force_z = 5"))
    assert requirements == Requirements(force_z=5.0)
    assert (requirements.no_saturation, requirements.unique_decoding, requirements.stability_margin) == (
        True,
        True,
        1,
    )


def test_one_diameter_is_a_range_of_one(toml):
    requirements = read_requirements(toml('force_z = 5\nD = "8 mm"'))
    assert (requirements.D_low, requirements.D_high) == (8.0, 8.0)


def test_rows_state_what_is_unset():
    states = {row["requirement"]: row["state"] for row in Requirements(force_z=5.0, largest_strain=0.4).rows()}
    assert set(states) == {*LIMITS, "no_saturation", "unique_decoding"}
    assert states["force_z"] == states["largest_strain"] == "set"
    assert states["stability_margin"] == states["no_saturation"] == "default"
    assert states["force_x"] == states["first_mode"] == "unset"


def test_default_wall_is_what_the_process_prints():
    assert Requirements(force_z=1.0, process="sla").printed_wall < Requirements(force_z=1.0).printed_wall
    assert Requirements(force_z=1.0, wall=0.7).printed_wall == 0.7


def test_resolution_without_bandwidth_is_warned_of():
    assert Requirements(force_z=5.0, resolution_z=0.005, bandwidth=100.0).warnings() == []
    assert Requirements(force_z=5.0).warnings() == []
    (text,) = Requirements(force_z=5.0, resolution_z=0.005).warnings()
    assert text.startswith("bandwidth is not set")


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ["sensor.toml: requirements need force_z, the normal force of the press"]),
        ("force_z = 5\nforce_y = 2", ["there is no key 'force_y'", "did you mean force_z"]),
        ("force_z = 5\nlargest_strian = 2", ["'largest_strian'", "did you mean largest_strain"]),
        ('force_z = "5 kg"', ["force_z: 'kg' is no unit for it: choose one of N, mN, kN"]),
        ('force_z = "5 mm"', ["'mm' is no unit", "choose one of N, mN"]),
        ("force_z = true", ["force_z must be a number; got True"]),
        ("force_z = nan", ["force_z must be a finite number; got nan"]),
        ("force_z = 0", ["force_z must lie between 0.001 and 10000 N; got 0 N"]),
        ("force_z = -5", ["force_z must lie between"]),
        ("force_z = [5]", [r"force_z must be a number; got \[5\]"]),
        ("force_z = 5\nlargest_strain = 40", ["must lie between 0.01 and 5; got 40: write 40 % as 0.4"]),
        ("force_z = 5\nresolution_z = 5", ["resolution_z must be below the range force_z = 5 N; got 5 N"]),
        ("force_z = 5\nresolution_x = 1", ["resolution_x = 1 N needs a range: add force_x"]),
        ("force_z = 5\nD = [8, 6]", ["the range must be", "low <= high; got 8 and 6 mm"]),
        ("force_z = 5\nD = [1, 2, 3]", ["D must be one diameter, or a range"]),
        ("force_z = 5\nD = [8, true]", ["D must be a number in mm"]),
        ("force_z = 5\nD = 12\nouter_size = 10", ["outer_size must be at least the diameter D = 12 mm; got 10 mm"]),
        ("force_z = 5\nD = 8\nheight = 6", ["height must exceed 0.75 D = 6 mm", "got 6 mm"]),
        ("force_z = 5\nstability_margin = 0.9", ["stability_margin must lie between 1 and 100; got 0.9"]),
        ("force_z = 5\nsamples = 0", ["samples must lie between 1 and 1000000; got 0"]),
        ("force_z = 5\nsamples = 1000001", ["samples must lie between 1 and 1000000; got 1000001"]),
        ("force_z = 5\nsamples = 1.5", ["samples must be a whole number; got 1.5"]),
        ("force_z = 5\nno_saturation = 1", ["no_saturation must be true or false; got 1"]),
        ("force_z = 5\nseed = -1", ["seed must be 0 or more"]),
        ('force_z = 5\nprocess = "cnc"', ["process must be 'fdm' or 'sla'", "cnc"]),
        ('force_z = 5\nouter_shape = "oval"', ["outer_shape must be 'round' or 'square'"]),
        ('force_z = 5\nshipped = ["magnet"]', ["shipped: there is no key 'magnet'", "did you mean magnets"]),
        ("force_z = 5\nmagnets = []", ["magnets is empty: name one or more"]),
        ('force_z = 5\nsilicones = ["A", "A"]', ["silicones lists 'A' twice"]),
        ("force_z = 5\n[weights]\nrnge = 1", ["weights: there is no key 'rnge'", "did you mean range"]),
        ("force_z = 5\n[weights]\nrange = -1", ["weights: range must lie between 0 and 1e"]),
        ("force_z = 5\n[weights]\nrange = 0\nresolution = 0\nsize = 0", ["weights: all are 0"]),
        ("force_z = 5\nversion = 2", ["the requirements have version 2, and this version of magtip reads version 1"]),
        ("force_z = ", ["not valid TOML"]),
    ],
)
def test_refusal(text, parts, toml, refused):
    with refused(*parts):
        read_requirements(toml(text))


def test_refusal_from_python(refused):
    with refused("force_z must be a number in N"):
        Requirements(force_z=float("nan"))
