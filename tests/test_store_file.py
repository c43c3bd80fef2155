"""The file of the store: formats, files that can only be read, and refusals."""

import contextlib
import os
import sqlite3
import tempfile
from pathlib import Path

import pytest

from studies.mechanics import store, store_file
from studies.mechanics.store import State

CONTENT = {"model": "harmonic", "physics": 1, "law": ["yeoh", 0.1], "nu": 0.45, "shape": {"L": 1.125}}
PRESSED = State(0.125, 0.0, "ok", "ok", {"force": 0.3}, 0.02, "on Python 3")
NOBODY = 65534


@pytest.fixture
def file(tmp_path):
    return tmp_path / "solved.sqlite"


@pytest.mark.parametrize("number", [1, 2])
def test_a_store_of_an_earlier_format_is_refused_and_stays(file, number, refused):
    """Its answers have no digests, and its failures may be errors of magtip."""
    with store.opened(file):
        pass
    with contextlib.closing(sqlite3.connect(file)) as connection, connection:
        connection.execute("UPDATE about SET value = ?", (str(number),))
    before = file.read_bytes()
    with refused(f"has format {number} of an earlier version", "move it away"), store.opened(file):
        pass
    with refused(f"has format {number} of an earlier version", "move it away"), store_file.readable(file):
        pass
    assert file.read_bytes() == before


def test_reading_makes_no_file(file, refused):
    with refused("there is no store", "magtip sweep makes one"), store_file.readable(file):
        pass
    assert not file.exists()


def test_what_is_read_cannot_be_changed(file):
    with store.opened(file) as kept:
        kept.add(CONTENT, [PRESSED])
    with pytest.raises(ValueError, match="is read-only"), store_file.readable(file) as connection:
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
        kept.add(CONTENT, [PRESSED])
    with powerless(folder, file):
        with store_file.readable(file) as connection:
            assert connection.execute("SELECT COUNT(*) FROM state").fetchone() == (1,)
        with refused("is read-only: make the file and its folder writable"), store.opened(file):
            pass
        with refused("cannot be opened", "Permission denied"), store.opened(folder / "more" / "new.sqlite"):
            pass
        with refused("cannot be opened|cannot be used"), store.opened(folder / "new.sqlite"):
            pass
    assert [path.name for path in folder.iterdir()] == ["solved.sqlite"]


@pytest.mark.skipif(os.name != "posix", reason="modes of files are those of POSIX")
def test_a_file_without_rights_in_a_writable_folder_is_refused_to_write(without_rights, refused):
    folder, powerless = without_rights
    file = folder / "solved.sqlite"
    with store.opened(file):
        pass
    folder.chmod(0o777)
    with powerless(file):
        with refused("is read-only"), store.opened(file):
            pass
        with store_file.readable(file) as connection:
            assert connection.execute("SELECT COUNT(*) FROM state").fetchone() == (0,)


def test_a_store_locked_for_too_long_is_refused(file, monkeypatch, refused):
    monkeypatch.setattr(store_file, "PATIENCE", 0.05)
    with store.opened(file), contextlib.closing(sqlite3.connect(file, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        with refused("is locked by another process for more than 0.05 s: wait until it ends"), store.opened(file):
            pass
        with store_file.readable(file) as connection:
            assert connection.execute("SELECT COUNT(*) FROM state").fetchone() == (0,)


@pytest.fixture
def large(file):
    """The bytes of a store of many pages."""
    with store.opened(file) as kept:
        kept.add_many((CONTENT | {"nu": k / 1000}, [PRESSED]) for k in range(400))
    return bytearray(file.read_bytes())


def test_a_store_without_its_header_is_refused(file, large, refused):
    large[:100] = bytes(100)
    file.write_bytes(large)
    with refused("is not a store of magtip"), store.opened(file):
        pass
    with refused("is not a store of magtip"), store_file.readable(file):
        pass


def test_damage_of_a_large_store_is_found_where_it_is_read(file, large, refused, monkeypatch):
    monkeypatch.setattr(store_file, "LARGEST_CHECKED", 1000)
    large[3 * 4096 :] = bytes(len(large) - 3 * 4096)
    file.write_bytes(large)
    with store.opened(file) as kept:
        with refused("is damaged"):
            kept.states(CONTENT | {"nu": 0.2})
        with refused("is damaged"):
            kept.add(CONTENT | {"nu": 0.9}, [PRESSED])
