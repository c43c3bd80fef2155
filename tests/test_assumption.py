"""The study of the beam assumption on few cases: the verb, its files and its refusals; the shipped study is sound."""

import math

import pytest

from studies.inputs import study_input
from studies.validation import assumption

SMALL = """
version = 2
design = "paper"
models = ["quick", "paper", "column", "tip", "magnet", "finite"]
quantities = ["force", "shift", "tilt"]
[load]
friction = "stick"
[axes]
L = [9, 16]
[[zipped]]
magnet_diameter = [0, 4]
magnet_height = [0, 2]
magnet_edge_radius = [0, 0.1]
nu = [0.4998, 0.4998]
[[zipped]]
depth = [0.16, 2.4, 0.64]
shear = [0, 0, 0.4]
"""


def test_the_verb(run, tmp_path):
    (tmp_path / "small.toml").write_text(SMALL)
    status, out, err = run("validate", "assumption", "small.toml", "--out", "out", "--workers", "0")
    assert status == 0, err
    assert "formula (5) is within 10 %" in out
    assert {path.name for path in (tmp_path / "out").glob("[!.]*")} == set(assumption.FILES)
    text = (tmp_path / "out" / "ASSUMPTION.md").read_text("utf-8")
    assert "No magnet, press force: formula (5) is within 10 % for L/D 1.12 to 2, d/D 0.3" in text
    assert "Made with `magtip validate assumption small.toml" in text
    assert all(f"]({name})" in text for name in assumption.FILES if name.endswith(".png"))


def test_sizes_of_the_magnet_may_be_fixed_and_the_page_names_the_design(run, tmp_path):
    design = "[design]\nD = 10\nE = 0.6\nmagnet_diameter = 5"
    text = SMALL.replace('design = "paper"\n', "").replace("magnet_diameter = [0, 4]\n", "")
    text = text.replace("magnet_height = [0, 2]", "magnet_height = [1, 2]").replace(
        "magnet_edge_radius = [0, 0.1]\n", ""
    )
    (tmp_path / "own.toml").write_text(text + design + "\n")
    status, _, err = run("validate", "assumption", "own.toml", "--out", "out", "--workers", "0")
    assert status == 0, err
    assert "D is 10 mm and E is 0.6 MPa" in (tmp_path / "out" / "ASSUMPTION.md").read_text("utf-8")


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("L = [9, 16]", "L = [9, 16]\nE = [1, 2]", "has the axis E"),
        ("magnet_height = [0, 2]", "magnet_height = [2, 2]", "12 cases of 6 different"),
        ('"finite"', '"standard"', "one finite-element model and all levels"),
        ("nu = [0.4998, 0.4998]", "", "lacks the axis nu"),
        ('"tilt"', '"readings"', "quantities force, shift and tilt"),
    ],
)
def test_studies_that_lack_something_are_refused(run, tmp_path, old, new, reason):
    (tmp_path / "small.toml").write_text(SMALL.replace(old, new))
    status, _, err = run("validate", "assumption", "small.toml")
    assert status == 2
    assert reason in err


def test_the_shipped_study_covers_the_range():
    axes = study_input.read_study(str(assumption.STUDY)).axes
    plan = assumption.plan_of(assumption.STUDY)
    assert (min(axes["L"]) / 8, max(axes["L"]) / 8) == (0.6, 6)
    assert len(axes["L"]) >= 8
    assert min(axes["magnet_height"]) == 0
    presses = [depth for depth, shear in zip(axes["depth"], axes["shear"], strict=True) if not shear]
    assert (min(presses) / 8, max(presses) / 8) == pytest.approx((0.02, 0.35))
    assert len(set(axes["nu"])) >= 3
    assert plan.count == math.prod(len(axes[name]) for name in ("L", "nu", "depth"))
