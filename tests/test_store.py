"""The store of solved states: what is added stays, whatever ends the process; what cannot be used is refused."""

import contextlib
import os
import re
import sqlite3
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest

from studies.mechanics import store
from studies.mechanics.store import State

ROOT = Path(__file__).parent.parent
PATH = {"model": "axisymmetric", "physics": 1, "nu": 0.4998, "lengths": [1.125, 0.5, 0.25]}
NOBODY = 65534
PRESSED = State(0.125, 0.0, "ok", "ok", {"force": 0.1 + 0.2, "tilt": None}, 0.02, "on Python 3")


@pytest.fixture
def file(tmp_path):
    return tmp_path / "deep" / "solved.sqlite"


def test_a_state_comes_back_to_the_last_bit_and_replaces_that_at_the_same_position(file):
    with store.opened(file) as kept:
        kept.add(PATH, [replace(PRESSED, outcome="transient", status="worker_died"), replace(PRESSED, depth=0.25)])
        kept.add(PATH, [PRESSED])
    with store.opened(file) as kept:
        assert kept.states(PATH) == {(0.125, 0.0): PRESSED, (0.25, 0.0): replace(PRESSED, depth=0.25)}
        assert kept.states(PATH | {"physics": 2}) == {}
        assert kept.counts() == (1, 2)


def test_a_killed_worker_takes_no_state_that_another_process_has_solved(file):
    died = replace(PRESSED, outcome="transient", status="worker_died", answer={})
    failed = replace(PRESSED, depth=0.25, outcome="failed", status="no_contact")
    with store.opened(file) as kept:
        kept.add(PATH, [PRESSED, failed, replace(died, depth=0.5)])
        kept.add(PATH, [died, replace(died, depth=0.25), replace(died, depth=0.5, status="out_of_memory")])
        states = kept.states(PATH)
        assert (states[0.125, 0.0], states[0.25, 0.0]) == (PRESSED, failed)
        assert states[0.5, 0.0].status == "out_of_memory"


def test_paths_are_added_in_one_transaction(file):
    with store.opened(file) as kept:
        kept.add_many(({"k": k}, [PRESSED]) for k in range(3))
        with pytest.raises(TypeError, match="plain values only; got object"):
            kept.add_many([({"k": 3}, [PRESSED]), ({"k": object()}, [PRESSED])])
        assert kept.counts() == (3, 3)


def test_numbers_of_an_answer_may_be_unknown_those_of_its_position_may_not(file):
    with store.opened(file) as kept:
        kept.add(PATH, [replace(PRESSED, answer={"force": float("nan"), "shift": [float("inf")]})])
        assert kept.states(PATH)[0.125, 0.0].answer == {"force": None, "shift": [None]}
    with pytest.raises(ValueError, match="must be finite"):
        replace(PRESSED, shear=float("nan"))
    # whole numbers and floats are one case
    assert store.key({"L": 1}) == store.key({"L": 1.0}) != store.key({"L": True})


def test_a_store_that_another_process_blocks_is_read_and_takes_a_state_later(file, monkeypatch, refused):
    monkeypatch.setattr(store, "PATIENCE", 0.05)
    with store.opened(file) as kept:
        with contextlib.closing(sqlite3.connect(file, isolation_level=None)) as other:
            other.execute("BEGIN IMMEDIATE")
            with refused("is locked by another process for more than 0.05 s: wait until it ends"):
                kept.add(PATH, [PRESSED])
            with refused("is locked by another process"), store.opened(file):
                pass
            with store.readable(file) as connection:
                assert connection.execute("SELECT COUNT(*) FROM state").fetchone() == (0,)
        assert kept.states(PATH) == {}
        kept.add(PATH, [PRESSED])
        assert kept.counts() == (1, 1)


FILL = """
import resource, sys
from pathlib import Path
from geometry.design import BadInput
from studies.mechanics import store
with store.opened(Path(sys.argv[1])) as kept:
    # like a full disk: a file can grow to so many bytes; the write-ahead log is the first to fail
    resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, resource.RLIM_INFINITY))
    for k in range(100):
        try:
            kept.add({"k": k}, [store.State(0.1, 0.0, "ok", "ok", {"text": "x" * 1000}, 0.0, "")])
        except BadInput as error:
            print(k, error)
            break
"""


def test_a_full_disk_ends_with_a_sentence_and_keeps_what_was_added(file):
    pytest.importorskip("resource")
    command = [sys.executable, "-c", FILL, str(file)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    number, sentence = done.stdout.strip().split(maxsplit=1)
    assert re.match(r"the (disk of the )?store '.*solved.sqlite' ", sentence)
    assert "\n" not in sentence
    with store.opened(file) as kept:
        assert kept.counts()[0] == int(number) > 10


def changed(file, statement, *values):
    with contextlib.closing(sqlite3.connect(file)) as other, other:
        other.execute(statement, values)


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("answer", '{"force": 99.0, "tilt": null}'),
        ("answer", b"\xff\xfe"),
        ("status", "unstable"),
        ("depth", 0.25),
        ("digest", "0"),
        ("path", 2),
    ],
)
def test_a_state_that_was_changed_in_the_file_is_no_answer(file, column, value, capsys):
    with store.opened(file) as kept:
        kept.add(PATH, [PRESSED])
        kept.add(PATH | {"nu": 0.4}, [])
    text = "CAST(? AS TEXT)" if isinstance(value, bytes) else "?"
    changed(file, f"UPDATE state SET {column} = {text}", value)
    paths = [PATH | {"nu": 0.4}] if column == "path" else [PATH]
    with store.opened(file) as kept:
        assert [kept.states(path) for path in paths] == [{}]
    assert "its digest does not match what it holds" in capsys.readouterr().err


def test_processes_that_make_one_store_at_once_all_keep_their_states(file):
    code = (
        "import sys; from pathlib import Path; from studies.mechanics import store\n"
        "with store.opened(Path(sys.argv[1])) as kept:\n"
        "    kept.add({'k': sys.argv[2]}, [store.State(0.1, 0.0, 'ok', 'ok', {}, 0.0, '')])\n"
    )
    processes = [subprocess.Popen([sys.executable, "-c", code, str(file), str(k)], cwd=ROOT) for k in range(4)]
    assert [process.wait() for process in processes] == [0] * 4
    with store.opened(file) as kept:
        assert kept.counts() == (4, 4)


def test_files_that_are_no_stores_are_refused(file, refused):
    file.parent.mkdir()
    file.write_text("a table\n" * 20)
    with refused("is not a store of magtip"), store.opened(file):
        pass
    file.unlink()
    changed(file, "CREATE TABLE mine (a INTEGER)")
    with refused("is not a store of magtip"), store.opened(file):
        pass
    with refused("cannot be opened"), store.opened(file.parent):
        pass


@pytest.mark.parametrize(
    ("statement", "said"),
    [
        ("UPDATE about SET value = '99'", "has format 99"),
        ("DELETE FROM about", "its format is ''"),
        # answers of earlier formats have no digests, and their failures may be errors of magtip
        ("UPDATE about SET value = '2'", "has format 2 of an earlier version.*move it away"),
    ],
)
def test_a_store_of_another_format_is_refused_and_stays(file, statement, said, refused):
    with store.opened(file):
        pass
    changed(file, statement)
    before = file.read_bytes()
    for context in (store.opened, store.readable):
        with refused(said), context(file):
            pass
    assert file.read_bytes() == before


def test_a_store_of_the_format_before_is_read_and_filled(file):
    """Format 3 had a table more, which a trigger fills."""
    with store.opened(file):
        pass
    changed(file, "CREATE TABLE listed (id INTEGER PRIMARY KEY REFERENCES path (id) ON DELETE CASCADE, nu)")
    listed = "INSERT INTO listed SELECT id, json_extract(content, '$.nu') FROM path WHERE id = new.id"
    changed(file, f"CREATE TRIGGER list_path AFTER INSERT ON path BEGIN {listed}; END")
    changed(file, "UPDATE about SET value = '3'")
    with store.opened(file) as kept:
        kept.add(PATH, [PRESSED])
        assert kept.states(PATH) == {(0.125, 0.0): PRESSED}


def test_reading_makes_no_file_and_changes_none(file, refused):
    with refused("there is no store", "magtip sweep makes one"), store.readable(file):
        pass
    assert not file.exists()
    with store.opened(file):
        pass
    with pytest.raises(ValueError, match="is read-only"), store.readable(file) as connection:
        connection.execute("DELETE FROM state")


@pytest.fixture
def without_rights():
    """A folder in which, while the yielded context lasts, this process has no right to write."""

    @contextlib.contextmanager
    def powerless(*paths):
        modes = {path: path.stat().st_mode for path in paths}
        for path in modes:
            path.chmod(0o555 if path.is_dir() else 0o444)
        root = os.geteuid() == 0
        if root:
            os.seteuid(NOBODY)
        try:
            yield
        finally:
            if root:
                os.seteuid(0)
            for path, mode in modes.items():
                path.chmod(mode)

    # not in pytest's folder, which another user cannot enter
    with tempfile.TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        yield Path(folder), powerless


@pytest.mark.skipif(os.name != "posix", reason="modes of files are those of POSIX")
def test_a_store_in_a_folder_without_rights_is_read_and_not_opened(without_rights, refused):
    folder, powerless = without_rights
    file = folder / "solved.sqlite"
    with store.opened(file) as kept:
        kept.add(PATH, [PRESSED])
    with powerless(folder, file):
        with store.readable(file) as connection:
            assert connection.execute("SELECT COUNT(*) FROM state").fetchone() == (1,)
        with refused("is read-only: make the file and its folder writable"), store.opened(file):
            pass
        with refused("cannot be opened", "Permission denied"), store.opened(folder / "more" / "new.sqlite"):
            pass
        with refused("cannot be opened|cannot be used"), store.opened(folder / "new.sqlite"):
            pass
    assert [path.name for path in folder.iterdir()] == ["solved.sqlite"]
    # a file that cannot be written in a folder that can
    folder.chmod(0o777)
    with powerless(file), refused("is read-only"), store.opened(file):
        pass


@pytest.mark.skipif(os.name != "posix", reason="modes of files are those of POSIX")
def test_the_user_s_store_that_cannot_be_written_is_read_with_one_warning(without_rights, monkeypatch, capsys):
    folder, powerless = without_rights
    file = folder / "solved.sqlite"
    monkeypatch.setenv(store.VARIABLE, str(file))
    with store.opened(None) as kept:
        kept.add(PATH, [PRESSED])
    with powerless(folder, file), store.opened(None) as kept:
        kept.add(PATH, [replace(PRESSED, depth=0.25)])
        assert set(kept.states(PATH)) == {(0.125, 0.0), (0.25, 0.0)}
    assert capsys.readouterr().err.count("is read-only") == 1
    with store.opened(None) as kept:
        assert set(kept.states(PATH)) == {(0.125, 0.0)}


def test_on_a_full_disk_the_user_s_store_forgets_what_is_added(monkeypatch, file, refused, capsys):
    monkeypatch.setenv(store.VARIABLE, str(file))
    for named in (None, file):
        with store.opened(named) as kept:
            # no page more than the file has, as on a disk that is full
            kept._connections[0].execute("PRAGMA max_page_count = 1")
            large = [replace(PRESSED, answer={"x": "y" * 100_000})]
            with refused("the disk of the store") if named else contextlib.nullcontext():
                kept.add(PATH, large)
            assert len(kept.states(PATH)) == (0 if named else 1)
    assert capsys.readouterr().err.count("is not kept") == 1


@pytest.fixture
def large(file):
    """The bytes of a store of many pages."""
    with store.opened(file) as kept:
        kept.add_many(({"k": k}, [PRESSED]) for k in range(400))
    return bytearray(file.read_bytes())


def test_a_damaged_store_is_refused_and_left_alone(file, large, refused):
    large[4096:12288] = bytes(8192)
    file.write_bytes(large)
    with refused("is damaged"), store.opened(file):
        pass
    assert file.read_bytes()[4096:12288] == bytes(8192)
    file.write_bytes(bytes(100) + large[100:])
    for context in (store.opened, store.readable):
        with refused("is not a store of magtip"), context(file):
            pass


def test_damage_of_a_large_store_is_found_where_it_is_read(file, large, refused, monkeypatch):
    monkeypatch.setattr(store, "LARGEST_CHECKED", 1000)
    large[3 * 4096 :] = bytes(len(large) - 3 * 4096)
    file.write_bytes(large)
    with store.opened(file) as kept:
        with refused("is damaged"):
            kept.states({"k": 200})
        with refused("is damaged"):
            kept.add({"k": 900}, [PRESSED])


def test_a_schema_that_is_no_text_is_a_damaged_store(file, refused):
    """SQLite quotes the name of the damaged index in its message."""
    with store.opened(file):
        pass
    with sqlite3.connect(file) as connection:
        connection.execute("PRAGMA journal_mode = DELETE")
    connection.close()
    content = file.read_bytes()
    assert content.count(b"sqlite_autoindex_about_1") == 1
    file.write_bytes(content.replace(b"sqlite_autoindex_about_1", b"sqlite_autoindex_abo\x8ct_1"))
    for context in (store.readable, store.opened):
        with refused("is damaged"), context(file):
            pass
