"""Files are whole or absent."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from geometry.design import BadInput
from studies.output import atomic_files, own_files


def half_written(path):
    with atomic_files.atomic(path) as temporary:
        assert (temporary.suffix, temporary.parent.parent) == (path.suffix, path.parent)
        temporary.write_text("half")
        raise ZeroDivisionError


def test_atomic_leaves_nothing_behind(tmp_path):
    with pytest.raises(ZeroDivisionError):
        half_written(tmp_path / "a.vtu")
    assert not list(tmp_path.iterdir())


def test_atomic_keeps_the_old_file_until_the_new_is_whole(tmp_path):
    path = tmp_path / "a.json"
    atomic_files.write_json(path, {"x": 1.0})
    with pytest.raises(ZeroDivisionError):
        half_written(path)
    assert path.read_text() == '{\n  "x": 1.0\n}\n'
    assert sorted(found.name for found in tmp_path.iterdir()) == [own_files.LIST, "a.json"]


def test_output_folder(tmp_path):
    made = atomic_files.output_folder(tmp_path / "a" / "b")
    assert made.is_dir()
    assert not list(made.iterdir())
    with pytest.raises(BadInput, match=r"^cannot write to the folder '/proc/x' .*: choose another folder$"):
        atomic_files.output_folder("/proc/x")


def test_an_output_is_not_an_input_under_another_name(tmp_path):
    file, link, hard = tmp_path / "a.csv", tmp_path / "b.csv", tmp_path / "c.csv"
    file.write_text("mine")
    link.symlink_to(file)
    hard.hardlink_to(file)
    for out in (file, link, hard, tmp_path / "sub" / ".." / "a.csv"):
        (tmp_path / "sub").mkdir(exist_ok=True)
        with pytest.raises(BadInput, match=r"^the output '.*' is also the input '.*a.csv': choose another name$"):
            atomic_files.check_apart([None, out], ["paper", None, file])
    atomic_files.check_apart([tmp_path / "new.csv", None, tmp_path / "sub"], [file, tmp_path / "sub", "paper"])


def test_output_file(tmp_path):
    assert atomic_files.check_output_file(tmp_path / "a.VTU", ".vtu").name == "a.VTU"
    (tmp_path / "b.vtu").mkdir()
    with pytest.raises(BadInput, match="is a folder"):
        atomic_files.check_output_file(tmp_path / "b.vtu", ".vtu")
    new = atomic_files.check_output_file(tmp_path / "new" / "folder" / "a.csv", ".csv")
    assert [found.name for found in tmp_path.iterdir()] == ["b.vtu"]
    atomic_files.write_text(new, "x")
    with pytest.raises(BadInput, match="it or one of its parents is a file"):
        atomic_files.check_output_file(new / "b.csv", ".csv")


def test_what_a_killed_process_left_goes_with_the_next_write(tmp_path):
    code = (
        "import os, signal, sys; from pathlib import Path; from studies.output import atomic_files as files\n"
        "with files.staged(Path(sys.argv[1])) as stage:\n"
        "    (stage / 'part').write_text('half'); os.kill(os.getpid(), signal.SIGKILL)"
    )
    root = Path(__file__).parent.parent
    killed = subprocess.run([sys.executable, "-c", code, str(tmp_path)], cwd=root, check=False)
    assert killed.returncode == -signal.SIGKILL
    (left,) = tmp_path.iterdir()
    elsewhere = tmp_path / ".writing-another-machine-1-abc"
    elsewhere.mkdir()
    with atomic_files.staged(tmp_path) as mine:
        assert not left.exists()
        # who is at work here or elsewhere is not disturbed
        atomic_files._delete_left_folders.cache_clear()
        atomic_files.write_text(tmp_path / "text.txt", "whole")
        assert mine.exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == [own_files.LIST, elsewhere.name, "text.txt"]


def test_files_of_earlier_options_do_not_stay(tmp_path):
    """Of the files that a verb may write, those that it has written again stay; other files are not touched."""
    for name in ("a.csv", "b.csv", "mine.csv"):
        atomic_files.write_text(tmp_path / name, "earlier")
    with atomic_files.results(tmp_path, ("a.csv", "b.csv")) as folder:
        atomic_files.write_text(folder / "a.csv", "earlier")
    assert {file.name for file in tmp_path.glob("[!.]*")} == {"a.csv", "mine.csv"}
    with pytest.raises(ZeroDivisionError), atomic_files.results(tmp_path, ("a.csv",)):
        raise ZeroDivisionError
    assert (tmp_path / "a.csv").exists()
