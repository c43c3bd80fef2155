"""What `magtip design` and `mesh` say of a design, and the file that is written."""

import pytest

from geometry.design import Design


def test_design_json(run, strict):
    status, out, err = run("design", "paper", "--set", "E=2", "--json")
    assert (status, err) == (0, "")
    (record,) = strict(out)
    fields = {key: record.pop(key) for key in Design.__slots__}
    assert Design(**fields).E == 2.0
    assert set(record) == {"derived", "assumed", "warnings"}
    assert "magnet_height" in record["assumed"]
    assert not {"D", "E"} & set(record["assumed"])
    assert record["derived"]["H_mm"] == 5.0
    assert record["derived"]["rest_readings_V"][0] == pytest.approx(2.87, abs=0.01)


def test_design_table_tells_the_source(run):
    out = run("design", "paper", "--set", "E=2", "--set", "l0=4")[1]
    lines = {line.split()[0]: line for line in out.splitlines() if line.split()}
    assert "changed" in lines["E"]
    assert "paper" in lines["D"]
    assert "assumed" in lines["nu"]
    # one limit of l0, that of the base
    assert "l0 must be at least" in " ".join(out.split())
    assert "would lie inside the beam" not in out


def test_design_shows_the_chip_in_use_and_where_averaging_leaves_its_steps(run, strict):
    words = ("--set", "hall_layout=tlv493d-a1b6", "--set", "hall_average=16", "--set", "l0=9")
    (record,) = strict(run("design", "paper", *words, "--json")[1])
    derived = record["derived"]
    assert derived["hall_part"] == "TLV493D-A1B6, a 3-axis chip"
    assert (derived["hall_range_T"], derived["hall_step_T"]) == ([-0.13, 0.13], 98e-6)
    assert derived["hall_reading_noise_T"] == pytest.approx(1e-4 / 4, rel=0.1)
    assert not any("does not dither" in text for text in record["warnings"])
    (record,) = strict(run("design", "paper", *words, "--set", "chip_noise=1e-6", "--json")[1])
    assert any("16 values leaves an error of 0.28 steps" in text for text in record["warnings"])
    table = run("design", "paper", *words)[1]
    assert "unused" in next(line for line in table.splitlines() if "hall_gain" in line)


def test_design_without_magnet_has_nulls(run, strict):
    status, out, _ = run("design", "paper", "--set", "magnet_diameter=0", "--set", "magnet_height=0", "--json")
    (record,) = strict(out)
    assert status == 0
    assert record["derived"]["wall_mm"] is None
    assert record["derived"]["magnet_volume_mm3"] == 0.0
    assert record["derived"]["rest_readings_T"] is None


def test_design_gives_the_outer_size_or_says_why_not(run, strict):
    derived = strict(run("design", "paper", "--json")[1])[0]["derived"]
    assert derived["beam_size_mm"] == [8.0, 8.0, 9.0]
    # L, and a base of the 1.57 mm thick S1 whose plate lies 2.2 mm below z = 0 and 0.5 mm below its marked face
    assert derived["assembled_size_mm"][2] == pytest.approx(9 + 2.2 - 0.5 + 1.57, abs=1e-12)
    assert "assembled size" in run("design", "paper")[1]
    record = strict(run("design", "paper", "--set", "L=12", "--json")[1])[0]
    assert record["derived"]["assembled_size_mm"] is None
    assert any(
        text.startswith("the size of the assembled sensor is unknown: l0 must be at least 9.2")
        for text in record["warnings"]
    )


def test_mesh(run, tmp_path, strict):
    status, out, err = run("mesh", "paper", "--out", "mesh.vtu", "--size", 2, "--json")
    assert (status, err) == (0, "")
    (record,) = strict(out)
    assert (record["status"], record["size_mm"]) == ("ok", 2.0)
    assert max(abs(record[f"{name}_volume_error"]) for name in ("silicone", "magnet")) < 1e-5
    assert abs(record["base_error"]) < 1e-4
    assert record["least_jacobian"] > 0
    assert 0 < record["gap_mm"] < 0.1
    assert [path.name for path in tmp_path.glob("[!.]*")] == ["mesh.vtu"]
