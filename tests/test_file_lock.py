"""One writer at a time: two processes, one that is killed, folders within folders, and no file that stays."""

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from geometry.design import BadInput
from studies.output import atomic_files

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


def test_the_workers_of_a_batch_that_is_killed_do_not_bind(tmp_path):
    """One of them is at work in a folder of its own when the process that shares out the work is killed."""
    slow = tmp_path / "slow"
    slow.mkdir()
    (slow / "build123d.py").write_text("import time\nprint('held', flush=True)\ntime.sleep(60)\n")
    code = "import sys; from studies.cli import main; sys.exit(main(sys.argv[1:]))"
    tokens = ["cad", "paper", "--out", "o", "--axis", "L=9,10"]
    options = {"cwd": tmp_path, "env": {**os.environ, "PYTHONPATH": os.pathsep.join([str(slow), str(ROOT)])}}
    with subprocess.Popen(
        [sys.executable, "-c", code, *tokens], stderr=subprocess.PIPE, text=True, **options
    ) as process:
        # what a process prints while it makes a variant goes to standard error
        said = []
        for line in process.stderr:
            said.append(line)
            if line == "held\n":
                break
        assert said[-1:] == ["held\n"], said
        assert list((tmp_path / "o").glob(f"L*/{atomic_files.LOCK}"))
        process.kill()
        # the pipe ends when the last process that may write into it is gone
        process.stderr.read()
    with atomic_files.filled(tmp_path / "o" / "L9"), atomic_files.filled(tmp_path / "o" / "L10"):
        pass


def test_a_verb_refuses_a_folder_that_another_process_fills(refusal, tmp_path):
    with holder("filled", tmp_path / "o") as process:
        for tokens in (
            ("sweep", "--axis", "D=6,8", "--depth", 0.5, "--out", "o"),
            ("cad", "paper", "--axis", "D=7,8", "--out", "o"),
            ("cad", "paper", "--out", "o"),
        ):
            assert f"the folder 'o' is being filled by process {process.pid}" in refusal(*tokens)
        assert [file.name for file in (tmp_path / "o").iterdir()] == [atomic_files.LOCK]


def test_a_verb_refuses_a_file_that_another_process_writes(run, tmp_path):
    with holder("sole_writer", tmp_path / "t.npy"):
        status, out, err = run("table", "paper", "--step", 0.5, "--out", "t.npy")
        assert (status, out, err.count("\n")) == (2, "", 1)
        assert "the file 't.npy' is being written by process" in err
        # another file in the same folder is free
        assert run("table", "paper", "--step", 1, "--out", "other.npy")[0] == 0
    assert run("table", "paper", "--step", 1, "--out", "t.npy")[0] == 0
    assert sorted(file.name for file in tmp_path.glob("[!.]*")) == ["other.json", "other.npy", "t.json", "t.npy"]


def test_folders_within_a_folder_have_locks_of_their_own(tmp_path):
    with (
        atomic_files.filled(tmp_path),
        atomic_files.filled(tmp_path / "inner") as inner,
        atomic_files.sole_writer(tmp_path / "a.vtu"),
    ):
        assert (inner / atomic_files.LOCK).exists()
        with pytest.raises(BadInput, match=f"by process {os.getpid()}"), atomic_files.filled(inner):
            pass
    assert not list(tmp_path.iterdir())


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


def test_the_machine_of_a_holder_elsewhere_is_named(tmp_path):
    file = tmp_path / "lock"
    with atomic_files.only(file):
        file.write_text("12 far-away")
        with pytest.raises(atomic_files.Held) as held, atomic_files.only(file):
            pass
        assert held.value.owner == "process 12 on far-away"
        file.write_text("")
        with pytest.raises(atomic_files.Held) as held, atomic_files.only(file):
            pass
        assert held.value.owner == "another process"
