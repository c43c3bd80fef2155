"""Files of the user are not overwritten; those of magtip are."""

from pathlib import Path

import pytest

from geometry.design import BadInput
from studies.output import atomic_files, own_files, run_record

RESULTS = Path(__file__).parents[1] / "results"


@pytest.mark.parametrize("name", ["REPORT.md", "press.csv", "run.json", "design.toml", "press.png", "sweep-2.png"])
def test_a_file_of_the_user_is_not_overwritten(tmp_path, name):
    (tmp_path / name).write_text("mine")
    with pytest.raises(BadInput, match=r"was not written by magtip and would be overwritten: choose another folder"):
        own_files.check(tmp_path, ("REPORT.md", "press.csv", "run.json", "design.toml", "press.png", "sweep-*.png"))


def test_a_verb_may_write_into_its_own_folder_again(tmp_path):
    run_record.write(tmp_path, "magtip compare paper", {})
    (tmp_path / "press.csv").write_text("depth_mm\n1\n")
    assert atomic_files.inside(tmp_path, ("press.csv", "run.json")) == [tmp_path / "press.csv", tmp_path / "run.json"]


def test_a_page_of_the_user_beside_results_is_not_overwritten(tmp_path):
    run_record.write(tmp_path, "magtip compare paper", {})
    (tmp_path / "REPORT.md").write_text("# Mine\n")
    with pytest.raises(BadInput, match=r"REPORT\.md"):
        own_files.check(tmp_path, ("REPORT.md", "run.json"))


def test_other_files_in_the_folder_do_not_matter(tmp_path):
    (tmp_path / "notes.md").write_text("mine")
    own_files.check(tmp_path, ("REPORT.md",))


@pytest.mark.parametrize("verb", ["demo", "verify", "bench", "sizing/fingertip", "cycle", "sweep", "trade", "layout"])
def test_results_of_earlier_versions_may_be_made_again(verb):
    own_files.check(RESULTS / verb, [file.name for file in (RESULTS / verb).iterdir() if file.is_file()])


def test_a_killed_run_may_be_repeated(tmp_path):
    (tmp_path / "verify.csv").write_text("case,error\n")
    (tmp_path / own_files.LOCK).write_text("1 machine")
    own_files.check(tmp_path, ["verify.csv"])
