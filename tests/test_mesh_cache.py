"""The cache returns stored meshes, detects damage, respects its limit, and never stops a computation."""

import hashlib
import json
import logging
import multiprocessing
import os
import time
from dataclasses import replace

import numpy as np
import pytest
from skfem import MeshTet2

from geometry import mesh as meshing
from geometry import messages
from geometry.design import BadInput, Shape
from geometry.mesh import tetrahedra
from geometry.meshing import mesh_cache

SHAPE = Shape(8, 6, 0, 0, 0)
SOME = {"points": np.arange(12.0).reshape(3, 4), "cells": np.arange(4)}


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder of its own that does not exist yet; warnings of earlier tests are forgotten."""
    monkeypatch.setenv("MAGTIP_CACHE", str(tmp_path / "own"))
    messages.warn_once.cache_clear()
    return tmp_path / "own"


def keep(name, value):
    mesh_cache.store(name, {"value": np.full(1000, value)})


def files(place):
    return sorted(place.glob("*.mesh"))


def test_stored_arrays_are_read_again(place):
    assert mesh_cache.load("a") is None
    mesh_cache.store("a", SOME)
    found = mesh_cache.load("a")
    assert found.keys() == SOME.keys()
    for name, array in SOME.items():
        assert found[name].dtype == array.dtype
        np.testing.assert_array_equal(found[name], array)
    assert [file.name for file in place.iterdir()] == ["a.mesh"]


@pytest.mark.parametrize("harm", ["cut", "flipped", "empty", "other", "pickle"])
def test_a_damaged_file_is_deleted_with_one_warning(place, harm, caplog):
    mesh_cache.store("a", SOME)
    (file,) = files(place)
    content = bytearray(file.read_bytes())
    if harm == "cut":
        content = content[: len(content) // 2]
    elif harm == "flipped":
        content[len(content) // 2] ^= 1
    elif harm == "empty":
        content = b""
    elif harm == "other":
        content = b"not a mesh\n" * 100
    else:
        archive = b"cos\nsystem\n(S'true'\ntR."
        content = hashlib.sha256(archive).hexdigest().encode() + b"\n" + archive
    file.write_bytes(content)
    with caplog.at_level(logging.WARNING):
        assert mesh_cache.load("a") is None
    assert not file.exists()
    assert len(caplog.records) == 1
    assert "is damaged" in caplog.text
    assert str(file) in caplog.text


def test_the_files_used_least_recently_go_first(place, monkeypatch):
    for k, name in enumerate("abc"):
        keep(name, k)
        os.utime(place / f"{name}.mesh", (k, k))
    size = files(place)[0].stat().st_size
    assert mesh_cache.load("a") is not None
    monkeypatch.setenv("MAGTIP_CACHE_MB", str(3.5 * size / 1e6))
    keep("d", 3)
    assert [file.stem for file in files(place)] == ["a", "c", "d"]
    assert mesh_cache.contents().size <= mesh_cache.contents().limit
    monkeypatch.setenv("MAGTIP_CACHE_MB", str(0.5 * size / 1e6))
    keep("e", 4)
    assert not (place / "e.mesh").exists()


@pytest.mark.parametrize("text", ["-1", "nan", "inf", "much"])
def test_a_bad_limit_is_bad_input(place, monkeypatch, text):
    monkeypatch.setenv("MAGTIP_CACHE_MB", text)
    with pytest.raises(BadInput, match=f"MAGTIP_CACHE_MB must be a finite size in MB, 0 or more; got '{text}'"):
        keep("a", 1)


def test_the_largest_limit_keeps_everything(place, monkeypatch):
    monkeypatch.setenv("MAGTIP_CACHE_MB", "1e308")
    keep("a", 1)
    assert mesh_cache.load("a") is not None


def test_a_folder_in_place_of_a_mesh_is_renamed_with_its_files(place, caplog):
    (place / "a.mesh").mkdir(parents=True)
    (place / "a.mesh" / "mine.txt").write_text("mine")
    with caplog.at_level(logging.WARNING):
        assert mesh_cache.contents().files == 0
        assert mesh_cache.clear().files == 0
        for _ in range(2):
            messages.warn_once.cache_clear()  # as a new process would
            mesh_cache.load("a")
            keep("a", 1)
    assert len(caplog.records) == 1
    assert "was a folder, not a file" in caplog.text
    assert mesh_cache.load("a") is not None
    (aside,) = place.glob("*.folder")
    assert (aside / "mine.txt").read_text() == "mine"


def test_off_and_bypassed(place, monkeypatch):
    with mesh_cache.bypassed():
        keep("a", 1)
        assert mesh_cache.folder() is None
    assert not place.exists()
    keep("a", 1)
    with mesh_cache.bypassed():
        assert mesh_cache.load("a") is None
    assert mesh_cache.load("a") is not None
    monkeypatch.setenv("MAGTIP_CACHE", "off")
    assert mesh_cache.load("a") is None
    assert mesh_cache.contents() == mesh_cache.Contents(None, 0, 0, 10**9)


def test_the_platforms_folder(monkeypatch, tmp_path):
    monkeypatch.delenv("MAGTIP_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    if os.name == "posix" and not os.path.isdir("/System/Library"):
        assert mesh_cache.folder() == tmp_path / "magtip"
    assert mesh_cache.folder().name == "magtip"


def test_a_file_in_place_of_the_folder_causes_one_warning(place, caplog):
    place.write_text("")
    with caplog.at_level(logging.WARNING):
        for name in "ab":
            keep(name, 1)
            assert mesh_cache.load(name) is None
    assert len(caplog.records) == 1
    assert "cannot write to the mesh cache" in caplog.text
    assert mesh_cache.contents().files == 0
    assert mesh_cache.clear().files == 0
    assert place.read_text() == ""


def test_a_full_disk_leaves_no_part_behind(place, caplog, monkeypatch):
    place.mkdir()

    def full(handle, mode):
        os.close(handle)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(mesh_cache.os, "fdopen", full)
    with caplog.at_level(logging.WARNING):
        keep("a", 1)
    assert "No space left on device" in caplog.text
    assert list(place.iterdir()) == []


def test_clearing_deletes_meshes_and_temporary_files_only(place):
    keep("a", 1)
    (place / "notes.txt").write_text("mine")
    (place / ".writing-old").write_text("")
    assert mesh_cache.clear().files == 0
    assert [file.name for file in place.iterdir()] == ["notes.txt"]


def test_temporary_files_of_dead_processes_are_deleted(place):
    keep("a", 1)
    for name, age in (("old", 2 * mesh_cache.FORGOTTEN_S), ("new", 0)):
        file = place / f".writing-{name}"
        file.write_text("")
        os.utime(file, 2 * (time.time() - age,))
    keep("b", 1)
    assert sorted(file.name for file in place.glob(".writing*")) == [".writing-new"]


def busy(seed, many):
    random = np.random.default_rng(seed)
    for _ in range(many):
        name = str(random.integers(4))
        found = mesh_cache.load(name)
        if found is not None and not (found["value"] == float(name)).all():
            return 1
        keep(name, float(name))
        if random.random() < 0.1:
            mesh_cache.clear()
    return 0


def test_processes_do_not_disturb_each_other(place, monkeypatch, capfd):
    monkeypatch.setenv("MAGTIP_CACHE_MB", "0.02")
    with multiprocessing.get_context("fork" if hasattr(os, "fork") else "spawn").Pool(3) as pool:
        assert pool.starmap(busy, [(seed, 60) for seed in range(3)]) == [0, 0, 0]
    assert capfd.readouterr().err == ""
    assert all(mesh_cache.load(file.stem) is not None for file in files(place))


def test_different_parts_have_different_keys():
    given = [{"size": 0.1, "half": True}, {"size": 0.1, "half": False}, {"size": 0.1 + 1e-12, "half": True}]
    assert len({mesh_cache.key(**one) for one in given}) == 3
    assert mesh_cache.key(a=1, b=[1.5, "x"]) == mesh_cache.key(b=[1.5, "x"], a=1)
    with pytest.raises(ValueError, match="JSON"):
        mesh_cache.key(a=float("nan"))


@pytest.fixture
def made(monkeypatch):
    """The list of requests to the mesher, which is replaced by a ball of few cells."""
    asked = []

    def build(*request):
        asked.append(request)
        return replace(MeshTet2.init_ball(1), _boundaries={}, _subdomains={})

    monkeypatch.setattr(meshing, "_built", build)
    return asked


def ask(shape=SHAPE, size=2.0, **changed):
    return tetrahedra(shape, size, **({"magnet": "none"} | changed))


def test_a_mesh_comes_back_as_it_was(place, monkeypatch):
    made = ask()
    monkeypatch.setattr(meshing, "_built", None)
    again = ask()
    np.testing.assert_array_equal(again.doflocs, made.doflocs)
    np.testing.assert_array_equal(again.t, made.t)
    for parts in ("boundaries", "subdomains"):
        assert getattr(again, parts).keys() == getattr(made, parts).keys()
        for name, part in getattr(made, parts).items():
            np.testing.assert_array_equal(getattr(again, parts)[name], part)


def test_similar_shapes_share_a_mesh(place, made):
    one, other = ask(), ask(SHAPE.scaled(0.3), 0.6)
    assert len(made) == 1
    np.testing.assert_allclose(other.doflocs, 0.3 * one.doflocs, rtol=0, atol=1e-13)


def test_other_requests_get_other_meshes(place, made):
    changes = [
        {},
        {"size": 1.9},
        {"half": False},
        {"tip_size": 0.7},
        {"rim": (1.0, 0.3)},
        {"shape": Shape(8, 7, 0, 0, 0)},
    ]
    for change in changes * 2:
        ask(**change)
    assert len(made) == len(changes)
    with mesh_cache.bypassed():
        ask()
    assert len(made) == len(changes) + 1


def test_another_library_or_code_makes_another_mesh(place, made, monkeypatch):
    makers = meshing._makers()
    assert any(text.startswith("pytetwild ") for text in makers)
    for k in range(len(makers)):
        ask()
        monkeypatch.setattr(meshing, "_makers", lambda k=k: [*makers[:k], "another", *makers[k + 1 :]])
        ask()
    assert len(made) == len(makers) + 1


def test_a_damaged_mesh_is_made_anew(place, made, caplog):
    ask()
    (file,) = files(place)
    file.write_bytes(file.read_bytes()[:-100])
    with caplog.at_level(logging.WARNING):
        ask()
        ask()
    assert len(made) == 2
    assert caplog.text.count("is damaged") == 1


def test_the_verb_cache_reports_and_clears(place, run, strict):
    keep("a", 1)
    status, out, _ = run("cache", "--json")
    (record,) = strict(out)
    assert status == 0
    assert record["folder"] == str(place)
    assert record["files"] == 1
    assert 0 < record["size_MB"] < 0.1
    assert record["limit_MB"] == 1000
    status, out, _ = run("cache", "--clear", "--json")
    assert (status, json.loads(out)["files"]) == (0, 0)
    assert files(place) == []
    assert run("cache")[0] == 0


def test_the_verb_when_the_cache_is_off(monkeypatch, run):
    monkeypatch.setenv("MAGTIP_CACHE", "off")
    status, out, _ = run("cache")
    assert status == 0
    assert "off" in out
