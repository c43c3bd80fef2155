"""Verb report on the command line: bad input, and that nothing is lost by it."""

import shutil
from pathlib import Path

import pytest

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


def test_folder_of_a_newer_format_is_refused(refusal, folder):
    (folder / "run.json").write_text('{"format": 99, "command": "", "made": "", "design": {}}')
    err = refusal("report", folder)
    assert "format 99" in err
    assert "newer" in err
    assert not (folder / "report.html").exists()


def test_out_that_is_an_input_is_refused(refusal, folder):
    before = (folder / "sweep.csv").read_bytes()
    assert "must end in .html" in refusal("report", folder, "--out", folder / "sweep.csv")
    (folder / "link.html").symlink_to(folder / "sweep.csv")
    assert "would be overwritten" in refusal("report", folder, "--out", folder / "link.html")
    assert (folder / "sweep.csv").read_bytes() == before


def test_html_file_of_someone_else_is_kept(refusal, folder):
    (folder / "report.html").write_text("<p>mine</p>")
    assert "was not written by magtip and would be overwritten" in refusal("report", folder)
    assert (folder / "report.html").read_text() == "<p>mine</p>"


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
