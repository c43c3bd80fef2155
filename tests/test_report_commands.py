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


def refusal(answer, *parts):
    status, out, error = answer
    assert (status, out) == (2, "")
    assert error.startswith("magtip: ")
    assert error.count("\n") == 1
    assert all(part in error for part in parts)


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


def test_missing_folder_is_refused(run, tmp_path):
    refusal(run("report", tmp_path / "none"), "there is no folder", "none")


def test_file_in_place_of_a_folder_is_refused(run, folder):
    refusal(run("report", folder / "sweep.csv"), "is a file")


def test_folder_without_results_is_refused(run, tmp_path):
    (tmp_path / "empty").mkdir()
    refusal(run("report", tmp_path / "empty"), "holds no results of magtip")
    assert list((tmp_path / "empty").iterdir()) == []
    (tmp_path / "empty" / "README.md").write_text("# My notes\n")
    refusal(run("report", tmp_path / "empty"), "holds no results of magtip")


def test_folder_of_a_newer_format_is_refused(run, folder):
    (folder / "run.json").write_text('{"format": 99, "command": "", "made": "", "design": {}}')
    refusal(run("report", folder), "format 99", "newer")
    assert not (folder / "report.html").exists()


def test_out_that_is_an_input_is_refused(run, folder):
    before = (folder / "sweep.csv").read_bytes()
    refusal(run("report", folder, "--out", folder / "sweep.csv"), "must end in .html")
    (folder / "link.html").symlink_to(folder / "sweep.csv")
    refusal(run("report", folder, "--out", folder / "link.html"), "would be overwritten")
    assert (folder / "sweep.csv").read_bytes() == before


def test_html_file_of_someone_else_is_kept(run, folder):
    (folder / "report.html").write_text("<p>mine</p>")
    refusal(run("report", folder), "was not written by magtip and would be overwritten")
    assert (folder / "report.html").read_text() == "<p>mine</p>"


def test_folder_that_cannot_be_written_is_refused(run, folder):
    refusal(run("report", folder, "--out", folder / "sweep.csv" / "x.html"), "cannot be made")


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
