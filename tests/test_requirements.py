"""Files of requirements: what is read, and one sentence for everything else."""

import dataclasses
import math

import numpy as np
import pytest

from studies.output.goals import Goal, failures
from studies.sizing import conflicts
from studies.sizing.candidate_variables import Space
from studies.sizing.catalogues import catalogues_of
from studies.sizing.conflicts import Conflict, conflict_of, demand, impossible
from studies.sizing.requirements import AT_MOST, LIMITS, Requirements, read_requirements
from studies.sizing.variant_search import Effort, searched, sorted_parts

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


# Requirements without a variant: what a bound proves at once, and advice that holds.


NEEDED = Requirements(
    force_z=5.0,
    force_x=1.5,
    largest_strain=0.3,
    D_low=8.0,
    D_high=12.0,
    magnets=("5x3 N45", "4x4 N45"),
    silicones=("Smooth-Sil 940", "Dragon Skin 30"),
    hall_parts=("DRV5055A2",),
)
PARTS = catalogues_of(NEEDED)
BRIEF = Effort(64, 6)
STRICT = {"largest_strain": 0.02, "resolution_z": 1e-5, "outer_size": 12.0, "first_mode": 1e4}


@pytest.mark.parametrize(("key", "bound"), [("outer_size", 9.0), ("height", 9.0), ("wall", 4.0)])
def test_what_is_impossible_by_a_bound_is_said_at_once(key, bound):
    needed = dataclasses.replace(NEEDED, **{key: bound})
    (text,) = impossible(needed, PARTS)
    assert "impossible" in text
    assert f"{bound:g} mm" in text


def test_no_candidate_is_beyond_a_bound():
    """A bound is a proof: no random candidate has a smaller base or a lower sensor."""
    needed = dataclasses.replace(NEEDED, D_low=None, D_high=None)
    space, random = Space(needed, sorted_parts(PARTS)), np.random.default_rng(2)
    drawn = space.candidates(random.integers([2, 2, 1], size=(4000, 3)), random.random((4000, 5)))
    size, height, _ = (each[drawn.outside() == ""] for each in drawn.sizes())
    for key, least in (("outer_size", size.min()), ("height", height.min())):
        assert not impossible(dataclasses.replace(needed, **{key: float(least)}), PARTS)


def test_possible_requirements_have_no_bound():
    assert impossible(dataclasses.replace(NEEDED, outer_size=30.0, height=40.0), PARTS) == ()


@pytest.fixture(scope="module")
def conflict():
    needed = dataclasses.replace(NEEDED, largest_strain=0.02)
    found = searched(needed, PARTS, BRIEF)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(conflicts, "LEAST_EFFORT", Effort(64, 6))
        patch.setattr(conflicts, "ADVICES", 1)
        points = []

        def solve(chosen, wanted):
            points.append((len(chosen), wanted))
            return []

        return needed, conflict_of(needed, PARTS, BRIEF, found, solve), points


def test_advice_without_finite_elements_is_not_given(conflict):
    """Each advice is searched again and solved: what no solve confirms is not said."""
    needed, found, points = conflict
    assert found.advices == ()
    assert "no requirement was found that could give alone" in found.sentence()
    assert found.sentence().startswith(f"none of {found.candidates} candidates meets all requirements")
    assert points[-1][1].largest_strain > needed.largest_strain


@pytest.mark.parametrize("strict", [1.0, 1e-3])
def test_a_demand_does_not_depend_on_how_much_too_strict_the_requirement_is(strict):
    needed = dataclasses.replace(NEEDED, resolution_z=1e-3 * strict)
    assert 0.02 < demand("resolution_z", needed, PARTS, BRIEF) < 0.2
    forces = dataclasses.replace(NEEDED, force_z=min(50.0 / strict, 1e4), force_x=None)
    assert 5 < demand("force_z", forces, PARTS, BRIEF) < 50


@pytest.mark.parametrize(
    ("name", "other", "bounds"),
    [
        ("largest_strain", "force_x", (2.0, 1.0)),
        ("resolution_z", "height", (16.0, 25.0)),
        ("outer_size", "largest_strain", (0.3, 0.5)),
        ("first_mode", "stability_margin", (2.0, 1.0)),
    ],
)
def test_a_looser_requirement_never_gives_a_larger_demand(name, other, bounds):
    """Of two bounds of another requirement the looser one, which comes last, demands no more."""
    # else a smaller force along the plate is asked for under lighter presses, too
    one = {"magnets": ("5x3 N45",), "silicones": ("Smooth-Sil 940",), name: STRICT[name]}
    base = dataclasses.replace(NEEDED, press_with_shear=2.5, **one)
    parts, effort = catalogues_of(base), Effort(128, 16)
    tight, loose = (demand(name, dataclasses.replace(base, **{other: bound}), parts, effort) for bound in bounds)
    assert loose <= 1.005 * tight if name in AT_MOST else loose >= tight / 1.005


def test_sentence_and_rows():
    advice = {"requirement": "outer_size", "value": 12.0, "unit": "mm", "gives": 1.2, "gives_of_all": 1.2, "to": 13.2}
    missed = ({"requirement": "largest_strain", "value": 0.4, "unit": "1"},)
    found = Conflict((), 1000, None, missed, (advice,))
    assert found.sentence().endswith("a variant was found where outer_size rises to 13.2 mm")
    first, second = found.rows()
    assert first == advice
    assert (second["requirement"], second["gives"]) == ("largest_strain", None)


# Failures that follow from goals.


MET = Goal("error", 0.5, 1.0, 3, "%")


@pytest.mark.parametrize(
    ("posed", "said"),
    [
        ([MET], ""),
        ([], "Nothing was measured"),
        ([MET, Goal("error", 1.5, 1.0, 3, "%")], "error: 1.5 %, goal at most 1 %"),
        ([Goal("error", math.nan, 1.0, 3)], "error: no data"),
        ([Goal("error", None, 1.0, 3)], "error: no data"),
        ([Goal("error", 0.0, 1.0, 0)], "error: no data"),
        ([Goal("share", 0.9, 0.95, 3, at_least=True)], "share: 0.9, goal at least 0.95"),
    ],
)
def test_a_goal_without_data_is_missed(posed, said):
    assert (" ".join(failures(posed)) == "") == (said == "")
    assert said in " ".join(failures(posed))


def test_a_goal_without_a_bound_is_refused():
    with pytest.raises(ValueError, match="finite bound"):
        Goal("error", 0.0, math.inf, 1)
