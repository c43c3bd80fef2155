"""Verb report on the command line: bad input, and that nothing is lost by it."""

import base64
import io
import shutil
from pathlib import Path

import pytest
from PIL import Image

from fem.accuracy import QUICK
from geometry.design import Design
from geometry.loads import Load
from studies.web import folder_contents, page_content, report_sections
from studies.web.folder_contents import Contents

RESULTS = Path(__file__).resolve().parent.parent / "results"


@pytest.fixture
def folder(tmp_path):
    path = tmp_path / "folder"
    path.mkdir()
    shutil.copy(RESULTS / "sweep" / "sweep.csv", path)
    return path


def test_page_is_written_beside_the_results(run, folder, strict):
    status, out, _ = run("report", folder, "--json")
    (made,) = strict(out)
    assert status == 0
    assert made["file"] == str(folder / "report.html")
    assert made["figures"] > 3
    text = (folder / "report.html").read_text("utf-8")
    assert f"magtip report {folder}" in text
    # the page itself is no result, and is replaced
    assert run("report", folder)[0] == 0


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["none"], "there is no folder 'none'"),
        (["folder/sweep.csv"], "is a file"),
        (["folder", "--out", "folder/sweep.csv/x.html"], "cannot be made"),
    ],
)
def test_what_is_no_folder_and_what_cannot_be_written_is_refused(refusal, folder, words, part):
    assert part in refusal("report", *words)


def test_folder_without_results_is_refused(refusal, tmp_path):
    (tmp_path / "empty").mkdir()
    assert "holds no results of magtip" in refusal("report", tmp_path / "empty")
    assert list((tmp_path / "empty").iterdir()) == []
    (tmp_path / "empty" / "README.md").write_text("# My notes\n")
    assert "holds no results of magtip" in refusal("report", tmp_path / "empty")


def test_what_cannot_be_read_is_named_and_spoils_nothing(run, folder, strict):
    (folder / "broken.csv").write_text("a,b\n1,2,3\n")
    (folder / "press.csv").write_text("a,b\n1,2\n")
    (folder / "broken.json").write_text("{")
    (folder / "broken.vtu").write_text("no")
    (folder / "broken.png").write_text("no")
    (folder / "table.npy").write_bytes(b"\x93NUMPY")
    status, out, _ = run("report", folder, "--json")
    (made,) = strict(out)
    assert status == 0
    names = ("broken.csv", "press.csv", "broken.json", "broken.vtu", "broken.png", "table.npy")
    for name in names:
        assert [text for text in made["warnings"] if name in text], name
    assert made["figures"] > 3


# Report sections.


def section(path):
    return report_sections.section(folder_contents.read(path)[0], solve=False)


@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("array", 1),
        ("demo", 9),
        ("disturbance", 1),
        ("errors", 3),
        ("field", 1),
        ("formulas", 15),
        ("stability", 1),
        ("sweep", 5),
        ("verify", 3),
    ],
)
def test_committed_results_have_their_figures(name, least):
    result = section(RESULTS / name)
    assert len(result.figures) >= least
    assert result.remarks == []
    assert all(figure.caption and figure.source for figure in result.figures)


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
    "known", [known for known in report_sections.KNOWN if known.file.endswith(".csv")], ids=lambda known: known.file
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


def test_a_winner_is_shown_under_its_required_load(tmp_path, monkeypatch):
    (tmp_path / "winner.toml").write_text("E = 0.8\n[requirements]\nforce_z = 1\nforce_x = 0.2\n")
    (tmp_path / "other.toml").write_text("[requirements]\nforce_z = 'much'\n")
    contents = folder_contents.read(tmp_path)[0]
    assert contents.unread == ["other.toml was not read: " + contents.unread[0].partition("read: ")[2]]
    design, load = report_sections.state_of(contents)
    assert (design.E, load.force, load.shear_force) == (0.8, 1.0, (0.2, 0.0))
    monkeypatch.setattr("fem.accuracy.STANDARD", QUICK)
    caption = report_sections.solved_surface(design, load)["caption"]
    assert "the required load, a press of 1 N and 0.2 N along the plate" in caption
    assert "force 0.2 N along the shear and 1 N in compression" in caption


def test_a_study_without_a_load_has_a_design_only():
    (contents,) = folder_contents.read(RESULTS / "demo")
    assert report_sections.state_of(contents)[1].shear_x > 0
    (contents,) = folder_contents.read(RESULTS / "response")
    assert report_sections.state_of(contents)[1] is None


# Page content.


def test_markup_of_a_page_is_escaped():
    html = str(
        page_content.page_html(
            "<script>x()</script> **bold** [a](javascript:x()) [b](other.md) [c](https://c.org)", {}, set()
        )
    )
    assert "<script" not in html
    assert "<strong>bold</strong>" in html
    assert "javascript" not in html.partition("<a ")[2]
    assert "<span>b</span>" in html
    assert '<a rel="noreferrer" href="https://c.org">c</a>' in html


def test_pictures_are_those_of_the_page():
    used = set()
    html = str(page_content.page_html('![one](a.png) ![two "q"](b.png)', {"a.png": "data:image/png;base64,AA"}, used))
    assert '<img src="data:image/png;base64,AA" alt="one">' in html
    assert "b.png" not in html
    assert used == {"a.png"}


def test_large_pictures_get_smaller_and_those_without_room_or_content_are_named(tmp_path):
    Image.new("RGB", (3000, 1000), "white").save(tmp_path / "a.png")
    (tmp_path / "none.png").write_text("no")

    def sources(name, room):
        remarks = []
        return page_content.sources(Contents(tmp_path, "", pictures=[name]), set(), room, remarks), remarks

    head, _, data = sources("a.png", 10**6)[0]["a.png"].partition(",")
    assert head == "data:image/png;base64"
    assert Image.open(io.BytesIO(base64.b64decode(data))).size == (page_content.WIDTH, 367)
    assert sources("a.png", 10) == ({}, ["a.png is not shown: the page would become too large."])
    found, (remark,) = sources("none.png", 99)
    assert found == {}
    assert remark.startswith("none.png was not read: it is no picture")
