from pathlib import Path

import pytest

from geometry.design import Design
from geometry.loads import Load
from studies.web import folder_contents, report_sections

RESULTS = Path(__file__).resolve().parent.parent / "results"


def section(path):
    return report_sections.section(folder_contents.read(path)[0], solve=False)


@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("accuracy", 1),
        ("assumption", 11),
        ("claims", 3),
        ("crosscheck", 1),
        ("demo", 9),
        ("extremes", 1),
        ("field", 1),
        ("friction", 1),
        ("ladder", 1),
        ("stability", 1),
        ("sweep", 5),
        ("trade", 1),
        ("verify", 1),
    ],
)
def test_committed_results_have_their_figures(name, least):
    result = section(RESULTS / name)
    assert len(result.figures) >= least
    assert result.remarks == []
    assert all(figure.caption and figure.source for figure in result.figures)


def test_claims_are_a_table_at_once():
    assert "claims.csv" in section(RESULTS / "claims").sheets


def test_other_table_is_shown_as_it_is(tmp_path):
    (tmp_path / "mine.csv").write_text("a,b\n1,two\n")
    result = section(tmp_path)
    assert list(result.sheets) == ["mine.csv"]
    assert result.figures == []


@pytest.mark.parametrize("name", [known.file for known in report_sections.KNOWN if known.file.endswith(".csv")])
def test_table_without_its_columns_is_named(tmp_path, name):
    (tmp_path / name).write_text("a,b\n1,2\n")
    (remark,) = section(tmp_path).remarks
    assert remark.startswith(f"{name} has no figure: its columns")


@pytest.mark.parametrize(
    "known",
    [known for known in report_sections.KNOWN if known.file.endswith(".csv")],
    ids=lambda known: known.file,
)
def test_table_of_failures_only_spoils_nothing(tmp_path, known):
    row = ",".join("failed" if name == "status" else "" for name in known.columns)
    (tmp_path / known.file).write_text(",".join(known.columns) + f"\n{row}\n")
    (tmp_path / "good.md").write_text("# good\n")
    result = section(tmp_path)
    assert all(len(figure.data) for figure in result.figures)


def test_design_is_that_of_the_run_or_of_the_only_file(tmp_path):
    (tmp_path / "run.json").write_text('{"format": 1, "command": "", "made": "", "design": {"D": 10, "L": 12}}')
    (tmp_path / "PAGE.md").write_text("Made with `magtip demo`\n")
    (contents,) = folder_contents.read(tmp_path)
    assert report_sections.design_of(contents).D == 10
    (tmp_path / "run.json").unlink()
    (contents,) = folder_contents.read(tmp_path)
    assert report_sections.design_of(contents) is None
    (tmp_path / "mine.toml").write_text("D = 9\nL = 11\n")
    (contents,) = folder_contents.read(tmp_path)
    assert report_sections.design_of(contents).D == 9


def test_sensor_of_the_demonstration_is_that_of_the_paper():
    (contents,) = folder_contents.read(RESULTS / "demo")
    assert report_sections.design_of(contents).D == 8


def test_the_state_in_3d_is_one_of_the_study(tmp_path):
    """The record of a sweep names its base design, which an axis may leave out."""
    (tmp_path / "run.json").write_text('{"format": 1, "command": "", "made": "", "design": {"D": 8, "L": 9, "E": 2}}')
    head = "D_mm,L_mm,depth_mm,shear_mm,friction,fem_force_N,status\n"
    rows = ("6,9,0.5,0,,1,ok", "6,9,1,0.25,0.3,1,ok", "10,9,1,0.2,stick,1,ok", "10,9,2,1,stick,,not_converged")
    (tmp_path / "sweep.csv").write_text(head + "\n".join(rows) + "\n")
    (contents,) = folder_contents.read(tmp_path)
    design, load = report_sections.state_of(contents)
    assert (design.D, design.L, design.E) == (6, 9, 2)
    assert load == Load(depth=1.0, shear_x=0.25, friction=0.3)
    (tmp_path / "sweep.csv").write_text(head + "\n".join([*rows, "8,9,0.3,0,,1,ok"]) + "\n")
    (contents,) = folder_contents.read(tmp_path)
    assert report_sections.state_of(contents) == (Design(D=8, L=9, E=2), Load(depth=0.3))


def test_a_study_without_a_load_has_a_design_only():
    (contents,) = folder_contents.read(RESULTS / "demo")
    assert report_sections.state_of(contents)[1].shear_x > 0
    (contents,) = folder_contents.read(RESULTS / "response")
    assert report_sections.state_of(contents)[1] is None
