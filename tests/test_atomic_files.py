"""Files are whole or absent, those of the user are not overwritten, and there is one writer at a time."""

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from geometry.design import BadInput
from studies.output import atomic_files, own_files, provenance
from studies.web import folder_contents


def half_written(path):
    with atomic_files.atomic(path) as temporary:
        assert (temporary.suffix, temporary.parent.parent) == (path.suffix, path.parent)
        temporary.write_text("half")
        raise ZeroDivisionError


def test_atomic_keeps_the_old_file_until_the_new_is_whole(tmp_path):
    path = tmp_path / "a.json"
    atomic_files.write_json(path, {"x": 1.0})
    with pytest.raises(ZeroDivisionError):
        half_written(path)
    assert path.read_text() == '{\n  "x": 1.0\n}\n'
    assert sorted(found.name for found in tmp_path.iterdir()) == [own_files.LIST, "a.json"]


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


# Files of the user, also those that were changed since magtip wrote them, are not overwritten; others are.


RESULTS = Path(__file__).parents[1] / "results"
NAMES = ("REPORT.md", "press.csv", "run.json", "design.toml", "press.png", "sweep-*.png")


@pytest.mark.parametrize("name", ["REPORT.md", "design.toml", "sweep-2.png"])
def test_a_file_that_magtip_has_not_written_or_that_was_changed_since_is_not_overwritten(tmp_path, refused, name):
    atomic_files.write_text(tmp_path / "other.md", "Made with `magtip compare`")
    (tmp_path / name).write_text("mine")
    with refused("was not written by magtip and would be overwritten: choose another folder"):
        own_files.check(tmp_path, NAMES)
    for text in ("first", "# fitted to test.csv\nE = 1.0\n"):
        atomic_files.write_text(tmp_path / name, text)
    own_files.check(tmp_path, NAMES)
    (tmp_path / name).write_text("# fitted to test.csv\nE = 2.0\n")
    with refused("was changed after magtip had written it and would be overwritten"):
        own_files.check(tmp_path, NAMES)


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


@pytest.mark.parametrize("verb", ["demo", "verify", "sizing/fingertip", "sweep"])
def test_results_of_earlier_versions_may_be_made_again(verb):
    names = [file.name for file in (RESULTS / verb).iterdir() if file.is_file()]
    own_files.check(RESULTS / verb, names)


@pytest.mark.parametrize(
    "line",
    [
        "explore paper --export mine.html",
        "store export --out mine.csv",
        "solve paper --depth 1 --out mine.vtu",
        "solve paper --depth 1 --picture mine.png",
        "table paper --step 1 --out mine.npy",
    ],
)
def test_no_verb_overwrites_a_single_file_of_the_user(refusal, tmp_path, line):
    file = tmp_path / line.split()[-1]
    file.write_text("mine")
    assert f"{file.name!r} was not written by magtip and would be overwritten" in refusal(*line.split())
    assert file.read_text() == "mine"


def test_a_folder_in_the_place_of_a_file_is_refused_before_the_work(refusal, tmp_path):
    (tmp_path / "calibration.json").mkdir()
    sentence = refusal("calibrate", "paper", tmp_path / "no_such_bench.csv", "--out", tmp_path)
    assert "calibration.json' is a folder, in the place of a file that is to be written" in sentence


# Folder contents.


def test_files_are_read_by_their_kind(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "t.csv").write_text("x,name,good\n1,one,True\n,two,False\n")
    (tmp_path / "a" / "PAGE.md").write_text("# Title\n")
    (tmp_path / "a" / "design.toml").write_text("D = 10\nL = 12\n")
    (tmp_path / "a" / "cup.png").write_bytes(b"")
    (tmp_path / "a" / "beam.stl").write_bytes(b"")
    (tmp_path / "a" / ".hidden.csv").write_text("x\n")
    (root,) = folder_contents.read(tmp_path)
    assert root.name == "a"
    table = root.tables["t.csv"]
    assert len(table) == 2
    np.testing.assert_array_equal(table["x"], [1, np.nan])
    assert table["good"].tolist() == ["True", "False"]
    assert root.designs["design.toml"].D == 10
    assert root.pictures == ["cup.png"]
    assert list(root.pages) == ["PAGE.md"]
    assert root.unread == []


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("t.csv", "a,b\n1\n", "1 values for 2 columns"),
        ("t.csv", "a;b\n1;2\n", "semicolons"),
        ("t.csv", "", "empty"),
        ("t.json", "{", "is not JSON"),
        ("t.json", "[1]", "no JSON object"),
        ("t.toml", "depth_of_field = 3", "depth_of_field"),
        ("t.parquet", "no", "no Parquet table"),
        ("t.jsonl", "no", "is not JSON"),
        ("t.xyz", "no", "'.xyz'"),
        ("run.json", "{}", "no record"),
    ],
)
def test_what_is_not_read_is_named_in_one_sentence(tmp_path, name, text, reason):
    (tmp_path / name).write_text(text)
    (tmp_path / "good.md").write_text("Made with `magtip demo`\n")
    (folder,) = folder_contents.read(tmp_path)
    (sentence,) = folder.unread
    assert sentence.startswith(name)
    assert reason in sentence
    assert "\n" not in sentence


def test_version_counts_only_in_files_of_magtip(tmp_path, refused):
    (tmp_path / "package.json").write_text('{"version": 9}')
    assert folder_contents.read(tmp_path)[0].records == {"package.json": {"version": 9}}
    (tmp_path / "sizing.json").write_text('{"version": 9}')
    with refused("sizing.json", "format 9", "newer"):
        folder_contents.read(tmp_path)


def test_the_record_of_a_run_comes_back_and_other_files_are_none(tmp_path, refused):
    provenance.write(tmp_path, "magtip compare paper", {"D": 8.0}, "on Python 3.12")
    made = "Made with `magtip compare paper`, on Python 3.12."
    assert provenance.read(tmp_path / provenance.NAME) == provenance.Run("magtip compare paper", made, {"D": 8.0})
    newer = '{"format": 2, "command": "", "made": "", "design": {}}'
    wrong = '{"format": 1, "command": "", "made": "", "design": 5}'
    for text, said in (
        (newer, "format 2.*newer"),
        (wrong, "no record"),
        ("", "no record"),
        ("[" * 9999, "no record"),
    ):
        (tmp_path / "run.json").write_text(text)
        with refused(said):
            provenance.read(tmp_path / "run.json")


# One writer at a time: two processes, one that is killed, and no file that stays.


ROOT = Path(__file__).parent.parent

HOLD = (
    "import sys; from studies.output import atomic_files as files\n"
    "with getattr(files, sys.argv[1])(sys.argv[2]):\n"
    "    print('held', flush=True); sys.stdin.read()"
)


@contextlib.contextmanager
def holder(kind, path):
    """A process that fills a folder, or writes a file, until its standard input ends."""
    code = [sys.executable, "-c", HOLD, kind, str(path)]
    with subprocess.Popen(code, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        yield process
        process.stdin.close()


@pytest.mark.parametrize(("kind", "what"), [("filled", "the folder"), ("sole_writer", "the file")])
def test_the_second_process_is_refused_and_told_who_holds(tmp_path, kind, what):
    path = tmp_path / "new" / "out"
    with holder(kind, path) as process:
        with pytest.raises(BadInput) as refused, getattr(atomic_files, kind)(path):
            pass
        assert str(refused.value).startswith(f"{what} {str(path)!r} is being")
        assert f"by process {process.pid}: wait until it ends" in str(refused.value)
    # nothing was written, so nothing stays
    assert not (tmp_path / "new").exists()
    with getattr(atomic_files, kind)(path):
        pass


def test_a_killed_process_does_not_bind(tmp_path):
    with holder("filled", tmp_path) as process:
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert (tmp_path / atomic_files.LOCK).exists()
    with atomic_files.filled(tmp_path):
        assert (tmp_path / atomic_files.LOCK).read_text().startswith(f"{os.getpid()} ")
    assert not list(tmp_path.iterdir())


def test_a_verb_refuses_a_folder_that_another_process_fills(refusal, tmp_path):
    with holder("filled", tmp_path / "o") as process:
        for tokens in (
            ("sweep", "--axis", "D=6,8", "--depth", 0.5, "--out", "o"),
            ("cad", "paper", "--axis", "D=7,8", "--out", "o"),
            ("cad", "paper", "--out", "o"),
        ):
            assert f"the folder 'o' is being filled by process {process.pid}" in refusal(*tokens)
        assert [file.name for file in (tmp_path / "o").iterdir()] == [atomic_files.LOCK]


def test_a_lock_on_a_file_that_was_removed_meanwhile_is_taken_anew(tmp_path, monkeypatch):
    """The holder ends between the opening of its file here and the lock on it."""
    file, opened = tmp_path / "lock", os.open
    file.write_text("1 elsewhere")

    def slow(path, *rest):
        handle = opened(path, *rest)
        monkeypatch.setattr(atomic_files.os, "open", opened)
        file.unlink()
        return handle

    monkeypatch.setattr(atomic_files.os, "open", slow)
    with atomic_files.only(file):
        with pytest.raises(atomic_files.Held), atomic_files.only(file):
            pass
        assert file.exists()


def test_a_lock_file_that_is_a_link_leads_to_no_file_of_the_user(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    (tmp_path / atomic_files.LOCK).symlink_to("mine.txt")
    with pytest.raises(OSError, match="symbolic links"), atomic_files.filled(tmp_path):
        pass
    assert (tmp_path / "mine.txt").read_text() == "mine"
