"""The verb demo on few states: its files, and what its report names."""

import contextlib
import dataclasses
import functools
import re

import pytest
from conftest import ROUGH

from geometry.design import Design
from geometry.loads import Load
from studies import demo
from studies.cli import entry_point
from studies.fabrication import assembly_picture


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The folder of a demo, and the text of its report."""
    folder = tmp_path_factory.mktemp("demo")
    with pytest.MonkeyPatch.context() as patch:
        press = [Load(depth=depth) for depth in (0.5, 1.0)]
        shear = [Load(depth=1.0, shear_x=shear, friction="stick") for shear in (0.0, 1.0)]
        few = {"accuracy": ROUGH, "loads": (press, shear)}
        patch.setattr(demo, "run", functools.partial(demo.run, **few))
        patch.setattr(assembly_picture, "painter", contextlib.nullcontext)
        assert entry_point.main(["demo", "--out", str(folder)]) == 0
    return folder, (folder / "REPORT.md").read_text(encoding="utf-8")


def test_the_demo_makes_every_file_that_its_report_names(made):
    folder, text = made
    named = [name for name in demo.WRITTEN if name not in ("REPORT.md", "cad/README.md")]
    assert all((folder / name).stat().st_size > 100 and name in text for name in named)
    assert {path.name for path in folder.glob("[!.]*")} == {*named, "cad", "REPORT.md"}
    assert all((folder / target).exists() for target in re.findall(r"\]\(([^)]+)\)", text))


def test_the_report_is_plain_and_complete(made):
    folder, text = made
    assert "nan" not in text.lower().replace("nanayakkara", "")
    assert str(folder) not in text.partition("Made with")[0]
    for heading in ("## Press", "## Shear", "## What is assumed", "Made with `magtip demo"):
        assert heading in text
    for spec in dataclasses.fields(Design):
        assert spec.metadata["assumed"] == (f"\n| {spec.name} | " in text), spec.name
    assert re.search(r"Mould and base: (\d\d) of \1 checks passed", text)


def test_the_fields_can_be_read_back(made):
    import pyvista as pv

    folder, _ = made
    mesh = pv.read(folder / "mesh.vtu")
    assert set(mesh.cell_data["region"]) == {0, 1}
    sheared = pv.read(folder / "shear.vtu")
    # the plate moves by 1 mm; under it the rim of the patch has spread a little before
    assert 1.0 <= sheared.point_data["displacement_mm"][:, 0].max() < 1.3
