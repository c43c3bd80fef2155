"""Files of the user, also those that were changed since magtip wrote them, are not overwritten; others are."""

from pathlib import Path

import pytest

from geometry.design import BadInput
from studies.output import atomic_files, own_files, run_record

RESULTS = Path(__file__).parents[1] / "results"
NAMES = ("REPORT.md", "press.csv", "run.json", "design.toml", "press.png", "sweep-*.png")


@pytest.mark.parametrize("name", ["REPORT.md", "press.csv", "run.json", "design.toml", "press.png", "sweep-2.png"])
@pytest.mark.parametrize("filled", [False, True])
def test_a_file_of_the_user_is_not_overwritten(tmp_path, name, filled):
    if filled:
        atomic_files.write_text(tmp_path / "other.md", "Made with `magtip compare`")
    (tmp_path / name).write_text("mine")
    with pytest.raises(BadInput, match=r"was not written by magtip and would be overwritten: choose another folder"):
        own_files.check(tmp_path, NAMES)


@pytest.mark.parametrize("name", ["REPORT.md", "press.csv", "run.json", "design.toml", "press.png", "sweep-2.png"])
def test_a_verb_may_write_into_its_own_folder_again_unless_a_file_was_changed(tmp_path, name):
    atomic_files.write_text(tmp_path / name, "first")
    atomic_files.write_text(tmp_path / name, "# fitted to test.csv\nE = 1.0\n")
    own_files.check(tmp_path, NAMES)
    (tmp_path / name).write_text("# fitted to test.csv\nE = 2.0\n")
    with pytest.raises(BadInput, match=r"was changed after magtip had written it and would be overwritten"):
        own_files.check(tmp_path, NAMES)


@pytest.mark.parametrize("table", ["law,AICc\nmine,1\n", "D,status,message\n8,ok,\n"])
def test_a_table_of_the_user_makes_no_folder_of_magtip(tmp_path, table):
    """Tables with the columns of a fit or a sweep were taken for magtip's, and all beside them."""
    (tmp_path / "fit.csv").write_text(table)
    (tmp_path / "design.toml").write_text("# fitted to test.csv\nE = 1.0\n")
    for name in ("fit.csv", "design.toml"):
        with pytest.raises(BadInput, match=r"was not written by magtip"):
            own_files.check(tmp_path, [name])


def test_a_file_that_is_staged_may_be_written_again(tmp_path):
    for text in ("one", "two"):
        own_files.check(tmp_path, ["part.stl", "README.md"])
        with atomic_files.staged(tmp_path) as stage:
            (stage / "part.stl").write_text(text)
            atomic_files.write_text(stage / "README.md", text)
    assert (tmp_path / "part.stl").read_text() == "two"
    (tmp_path / "part.stl").write_text("mine")
    with pytest.raises(BadInput, match=r"part\.stl' was changed"):
        own_files.check(tmp_path, ["part.stl"])


def test_a_process_that_is_killed_leaves_files_that_may_be_written_again(tmp_path, monkeypatch):
    atomic_files.write_text(tmp_path / "a.csv", "old")
    monkeypatch.setattr(atomic_files.os, "replace", lambda *paths: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        atomic_files.write_text(tmp_path / "a.csv", "new")
    assert (tmp_path / "a.csv").read_text() == "old"
    own_files.check(tmp_path, ["a.csv"])
    monkeypatch.undo()
    with (tmp_path / own_files.LIST).open("a") as stream:
        stream.write('{"file": "b.csv", "sh')
    atomic_files.write_text(tmp_path / "b.csv", "new")
    own_files.check(tmp_path, ["a.csv", "b.csv"])


def test_equal_files_are_listed_once(tmp_path):
    for _ in range(3):
        atomic_files.write_text(tmp_path / "a.csv", "same")
    assert len((tmp_path / own_files.LIST).read_text().splitlines()) == 1


def test_other_files_in_the_folder_do_not_matter(tmp_path):
    (tmp_path / "notes.md").write_text("mine")
    own_files.check(tmp_path, ("REPORT.md",))


@pytest.mark.parametrize("verb", ["demo", "verify", "bench", "sizing/fingertip", "cycle", "sweep", "trade", "layout"])
def test_results_of_earlier_versions_may_be_made_again(verb):
    names = [file.name for file in (RESULTS / verb).iterdir() if file.is_file()]
    own_files.check(RESULTS / verb, names)


def test_a_page_of_the_user_beside_results_of_earlier_versions_is_not_overwritten(tmp_path):
    run_record.write(tmp_path, "magtip compare paper", {})
    (tmp_path / own_files.LIST).unlink()
    own_files.check(tmp_path, ("REPORT.md", "run.json"))
    (tmp_path / "REPORT.md").write_text("# Mine\n")
    with pytest.raises(BadInput, match=r"REPORT\.md"):
        own_files.check(tmp_path, ("REPORT.md", "run.json"))


@pytest.mark.parametrize(
    "command",
    [
        ("explore", "paper", "--export", "mine.html"),
        ("store", "export", "--out", "mine.csv"),
        ("solve", "paper", "--depth", "1", "--out", "mine.vtu"),
        ("solve", "paper", "--depth", "1", "--picture", "mine.png"),
        ("table", "paper", "--step", "1", "--out", "mine.npy"),
    ],
)
def test_no_verb_overwrites_a_single_file_of_the_user(refusal, tmp_path, command):
    file = tmp_path / command[-1]
    file.write_text("mine")
    assert f"{file.name!r} was not written by magtip and would be overwritten: choose another name" in refusal(
        *command
    )
    assert file.read_text() == "mine"
