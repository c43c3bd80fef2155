import csv
import dataclasses
import re

import pytest

from fem.accuracy import QUICK
from geometry.design import Design
from studies import demo


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo")
    seen = []
    result = demo.run(
        folder,
        accuracy=QUICK,
        depths=(0.5, 1.0),
        shears=(0.0, 1.0),
        progress=lambda fraction, text: seen.append((fraction, text)),
    )
    return folder, result, seen


def test_the_demo_makes_every_file_that_its_report_names(made):
    folder, result, _ = made
    assert (result["status"], result["message"]) == ("ok", "")
    text = (folder / "REPORT.md").read_text(encoding="utf-8")
    named = [name for name in demo.WRITTEN if name not in ("REPORT.md", "cad/README.md")]
    for name in named:
        assert (folder / name).stat().st_size > 100, name
        assert name in text
    for part in ("beam", "silicone", "magnet", "mold_a", "mold_b"):
        for suffix in ("step", "stl", "3mf"):
            assert (folder / "cad" / f"{part}.{suffix}").stat().st_size > 1000
    assert {path.name for path in folder.glob("[!.]*")} == {*named, "cad", "REPORT.md"}
    for target in re.findall(r"\]\(([^)]+)\)", text):
        assert (folder / target).exists()


def test_the_report_is_plain_and_complete(made):
    folder, _, _ = made
    text = (folder / "REPORT.md").read_text(encoding="utf-8")
    assert "nan" not in text.lower().replace("nanayakkara", "")
    assert str(folder) not in text
    for heading in ("## Press", "## Shear", "## What is assumed", "Made "):
        assert heading in text
    assert "| magnet_height | 2 mm |" in text
    for spec in dataclasses.fields(Design):
        assert spec.metadata["assumed"] == (f"\n| {spec.name} | " in text), spec.name
    assert re.search(r"Mould and base: (\d\d) of \1 checks passed", text)
    assert "scikit-fem" in text


def test_the_tables_hold_one_row_for_each_state(made):
    folder, result, _ = made
    for name in ("press", "shear"):
        with open(folder / f"{name}.csv", newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        assert [row["status"] for row in rows] == ["ok", "ok"]
    assert result["summary"]["missing_states"] == 0


def test_the_fields_can_be_read_back(made):
    import pyvista as pv

    folder, _, _ = made
    mesh = pv.read(folder / "mesh.vtu")
    assert set(mesh.cell_data["region"]) == {0, 1}
    sheared = pv.read(folder / "shear.vtu")
    # the plate moves by 1 mm; under it the rim of the patch has spread a little before
    assert 1.0 <= sheared.point_data["displacement_mm"][:, 0].max() < 1.3


def test_progress_rises_from_0_to_1(made):
    _, _, seen = made
    fractions = [fraction for fraction, _ in seen]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert any("mould" in text for _, text in seen)
