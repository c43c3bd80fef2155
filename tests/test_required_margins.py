"""Margins of requirements on the live page: what a design leaves, where it is worst, and the load it opens at."""

import dataclasses
import re

import pytest

from fem.accuracy import QUICK
from fem.equilibrium import solve
from geometry.design import PRESETS, BadInput, Design, paper
from geometry.loads import Load
from studies.parts.requirements import LIMITS, Requirements, read_requirements
from studies.sizing import sizing_export
from studies.web import required_margins

NEEDED = Requirements(force_z=3.0, force_x=0.6, outer_size=18.0, largest_strain=0.8, bandwidth=100.0)
MOLD_STAR = Design(silicone="Mold Star 30", E=0.867, density=1120.0, hall_noise=1e-3)


def rows_of(design, needed=NEEDED):
    """The rows by the words of their requirement, without the bound."""
    return {row["name"].partition(", at ")[0]: row for row in required_margins.margins(design, needed)["rows"]}


def test_value_bound_and_margin_agree():
    rows = rows_of(MOLD_STAR)
    for row in rows.values():
        words = row["name"].rpartition(" ")[0]
        if not row["half_width"].endswith("%") and not row["half_width"].endswith("% left"):
            continue
        bound, way = float(row["name"].rpartition(" ")[2]), 1 if words.endswith("at least") else -1
        share = way * (row["value"] / bound - 1)
        assert ("missed" in row["half_width"]) == (share < 0), row
        if abs(share) < 1:
            told = float(row["half_width"].removeprefix("missed by ").partition(" ")[0])
            assert told == pytest.approx(100 * abs(share), rel=0.01), row


def test_corners_are_those_of_the_silicone_and_the_load_is_required():
    rows = rows_of(MOLD_STAR)
    assert rows["press force"]["beside"] == "E = 0.662 MPa"
    assert rows["largest strain"]["beside"].startswith("E = 0.662 MPa, 3 N with 0.6 N")
    # an E of one's own has no range
    assert rows_of(paper())["largest strain"]["beside"].startswith("E = 1 MPa, 3 N")


@pytest.mark.parametrize("name", [name for name in PRESETS if name != "paper"])
def test_a_preset_meets_the_requirements_of_its_file(name):
    design, needed = required_margins.sensor_of(name)
    stated = read_requirements(f"studies/examples/sizing/{name}.toml")
    assert [getattr(needed, limit) for limit in LIMITS] == [getattr(stated, limit) for limit in LIMITS]
    rows = rows_of(design, needed)
    assert "press force" in rows
    assert not [row for row in rows.values() if "missed" in row["half_width"]]


def test_a_harder_requirement_leaves_less():
    for name, low, high in (("largest strain", 0.3, 0.5), ("outer size", 16.0, 20.0)):
        field = name.replace(" ", "_")
        values = [rows_of(MOLD_STAR, dataclasses.replace(NEEDED, **{field: bound}))[name] for bound in (low, high)]
        assert values[0]["value"] == values[1]["value"]
        assert values[0]["half_width"] != values[1]["half_width"]


def test_what_is_not_known_is_said():
    needed = dataclasses.replace(NEEDED, resolution_z=0.1)
    # neither elements without noise nor a chip of unknown noise meet a resolution
    for design in (paper(), dataclasses.replace(paper(), hall_layout="mlx90393")):
        found = required_margins.margins(design, needed)
        (row,) = [row for row in found["rows"] if row["name"].startswith("resolution in z")]
        assert (row["value"], row["half_width"]) == (None, "not known: no noise is given")
        assert re.match(r"(\d+ of \d+ requirements missed, )?2 not known, by", found["message"])
    assert "requirements" in required_margins.margins(paper(), None)["message"]
    outside = required_margins.margins(dataclasses.replace(paper(), law="yeoh", yeoh_2=0.1), NEEDED)
    assert not outside["rows"]
    assert outside["message"].endswith(".")


def test_the_page_opens_at_the_required_load():
    depth, shear = required_margins.opening_load(paper(), NEEDED).values()
    force = solve(paper(), Load(depth, shear, friction="stick"), QUICK).response.force
    assert (force[2], force[0]) == pytest.approx((NEEDED.force_z, NEEDED.force_x), rel=0.03)


def test_requirements_of_a_design_file(tmp_path):
    file = tmp_path / "winner.toml"
    sizing_export.write_design(required_margins.variant_of(MOLD_STAR, NEEDED), NEEDED, tmp_path)
    assert required_margins.sensor_of(str(file)) == (MOLD_STAR, NEEDED)
    made = '[fabrication]\nprocess = "sla"\nbase = { shape = "square" }\n'
    file.write_text(f"D = 9.0\nL = 10.0\n{made}[requirements]\nforce_z = 5.0  # N\nouter_size = 20.0\n")
    design, needed = required_margins.sensor_of(str(file), ["E=2"])
    assert (design.D, design.E) == (9.0, 2.0)
    assert (needed.force_z, needed.outer_size, needed.process, needed.outer_shape) == (5.0, 20.0, "sla", "square")
    file.write_text("D = 9.0\n[requirements]\nforce_w = 5.0\n")
    with pytest.raises(BadInput, match="force_w"):
        required_margins.sensor_of(str(file))
    assert required_margins.sensor_of("paper") == (paper(), None)
