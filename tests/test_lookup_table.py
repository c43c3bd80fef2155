"""The look-up table: its entries, its plane, how it goes on after an interruption, and bad input."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from analytic import hall, lookup
from geometry.design import BadInput, paper
from studies.output import own_files
from studies.sensing import lookup_table


def test_entries_are_the_readings(run, strict, tmp_path):
    status, out, _ = run("table", "paper", "--step", 0.5, "--out", "t.npy", "--json")
    assert status == 0
    assert strict(out)[0]["poses"] == 13 * 13 * 7
    table, about = np.load(tmp_path / "t.npy", mmap_mode="r"), json.loads((tmp_path / "t.json").read_text())
    assert list(table.shape) == about["shape"] == [13, 13, 7, 3]
    axes = [[axis["first"] + k * axis["step"] for k in range(axis["count"])] for axis in about["axes"][:3]]
    for i, j, k in ((0, 0, 0), (6, 6, 0), (2, 11, 5), (12, 12, 6)):
        shift = (axes[0][i], axes[1][j], axes[2][k])
        assert_allclose(table[i, j, k], hall.readings(paper(), shift=shift).B_T, rtol=1e-12)
    assert [file.name for file in tmp_path.glob(".*")] == [own_files.LIST]


def test_the_plane_holds_every_reading(run, tmp_path):
    assert run("table", "paper", "--step", 0.1, "--plane", "--out", "p.npy")[0] == 0
    table, about = np.load(tmp_path / "p.npy"), json.loads((tmp_path / "p.json").read_text())
    rho, height = about["axes"][:2]
    # the magnet at (-1, 0, -2): S2, at (5, 0) and 5.2 mm below its rest, is 6 mm aside and 3.2 mm below it
    i, j = round(6 / rho["step"]), round((-3.2 - height["first"]) / height["step"])
    expected = hall.field_at([[5, 0, -0.2]], paper(), (-1, 0, -2))[0]
    assert_allclose(table[i, j], expected[[0, 2]], rtol=1e-10)
    corner = np.hypot(8, 3)
    assert rho["step"] * (rho["count"] - 1) >= corner


def test_an_interrupted_table_goes_on(run, strict, tmp_path, monkeypatch):
    command = ("table", "paper", "--step", 0.25, "--json", "--out")
    assert run(*command, "whole.npy")[0] == 0
    slab = lookup.slab

    def stop(model, grid, i):
        if i == 19:
            raise KeyboardInterrupt
        return slab(model, grid, i)

    monkeypatch.setattr(lookup, "slab", stop)
    status, out, err = run(*command, "t.npy")
    assert (status, out) == (130, "")
    size = (tmp_path / ".t.npy.part").stat().st_size / 1e6
    assert err.splitlines()[-1] == (
        f"magtip: interrupted; 16 of 25 slabs are kept in '.t.npy.part' ({size:.3g} MB); "
        "the same command continues from there"
    )
    assert not (tmp_path / "t.npy").exists()
    monkeypatch.setattr(lookup, "slab", slab)
    status, out, _ = run(*command, "t.npy")
    assert (status, strict(out)[0]["resumed"]) == (0, 16)
    assert (tmp_path / "t.npy").read_bytes() == (tmp_path / "whole.npy").read_bytes()
    assert [file.name for file in tmp_path.glob(".*")] == [own_files.LIST]


def test_a_table_interrupted_at_once_leaves_nothing(run, tmp_path, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(lookup, "slab", stop)
    status, _, err = run("table", "paper", "--step", 0.25, "--json", "--out", "new/t.npy")
    assert (status, err) == (130, "magtip: interrupted; any complete files are kept\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("plane", [(), ("--plane",)])
@pytest.mark.parametrize("name", ["t.npy", "t.json"])
def test_a_foreign_file_is_not_replaced(refusal, tmp_path, plane, name):
    np.save(tmp_path / "mine.npy", np.arange(3.0))
    (tmp_path / "mine.npy").rename(tmp_path / name)
    before = (tmp_path / name).read_bytes()
    assert f"{name!r} was not written by magtip and would be overwritten: choose another name" in refusal(
        "table", "paper", "--step", 1, "--out", "t.npy", *plane
    )
    assert [(file.name, file.read_bytes()) for file in tmp_path.glob("[!.]*")] == [(name, before)]


def test_a_table_of_this_program_is_replaced(run):
    for plane in ((), ("--plane",), ()):
        assert run("table", "paper", "--step", 1, "--out", "t.npy", *plane)[0] == 0


def test_a_table_is_read_back_for_its_own_sensor_only(run, tmp_path, capsys):
    assert run("table", "paper", "--step", 1, "--out", "t.npy")[0] == 0
    table, about = lookup_table.read(tmp_path / "t.npy", replace(paper(), E=2.0, hall_noise=0.1))
    assert table.shape == tuple(about["shape"])
    assert capsys.readouterr().err == ""
    # tables of versions without this field are those of a magnet whose north pole points down
    assert "magnet_north" not in about["made_for"]
    with pytest.raises(BadInput, match="with magnet_north down where this design has magnet_north up"):
        lookup_table.read(tmp_path / "t.npy", replace(paper(), magnet_north="up"))
    with pytest.raises(
        BadInput, match=r"with remanence 1\.2 T, f 5 mm where this design has remanence 1\.1 T, f 6 mm"
    ):
        lookup_table.read(tmp_path / "t.npy", replace(paper(), remanence=1.1, f=6.0))
    kept = {key: value for key, value in about.items() if key not in ("digest", "made_for")}
    (tmp_path / "t.json").write_text(json.dumps(kept))
    lookup_table.read(tmp_path / "t.npy", paper())
    assert "does not say for which sensor" in capsys.readouterr().err
    (tmp_path / "t.json").write_text("{}")
    with pytest.raises(BadInput, match="is not a table"):
        lookup_table.read(tmp_path / "t.npy", paper())


@pytest.mark.parametrize("plane", [(), ("--plane",)])
def test_the_table_of_a_reversed_magnet_has_the_opposite_sign(run, tmp_path, plane):
    for name, sets in (("down", ()), ("up", ("--set", "magnet_north=up"))):
        assert run("table", "paper", "--step", 1, "--out", f"{name}.npy", *plane, *sets)[0] == 0
    assert_array_equal(np.load(tmp_path / "up.npy"), -np.load(tmp_path / "down.npy"))
    lookup_table.read(tmp_path / "up.npy", replace(paper(), magnet_north="up"))
    with pytest.raises(BadInput, match="with magnet_north up where this design has magnet_north down"):
        lookup_table.read(tmp_path / "up.npy", paper())


def test_a_tilted_table_depends_on_the_mechanics(run, tmp_path):
    assert run("table", "paper", "--step", 1, "--level", "finite", "--out", "t.npy")[0] == 0
    with pytest.raises(BadInput, match="with E 1 MPa where this design has E 2 MPa"):
        lookup_table.read(tmp_path / "t.npy", replace(paper(), E=2.0))


def test_a_note_without_its_slabs_is_not_believed(run, strict, tmp_path, monkeypatch):
    command = ("table", "paper", "--step", 0.5, "--out", "t.npy", "--json")
    assert run(*command)[0] == 0
    whole, slab = (tmp_path / "t.npy").read_bytes(), lookup.slab
    monkeypatch.setattr(lookup, "slab", lambda model, grid, i: 1 / 0 if i == 9 else slab(model, grid, i))
    with pytest.raises(ZeroDivisionError):
        run(*command)
    monkeypatch.setattr(lookup, "slab", slab)
    with (tmp_path / ".t.npy.part").open("r+b") as stream:
        stream.truncate(500)
    assert strict(run(*command)[1])[0]["resumed"] == 0
    assert (tmp_path / "t.npy").read_bytes() == whole


def test_another_table_does_not_go_on_from_it(run, strict, tmp_path, monkeypatch):
    slab = lookup.slab
    monkeypatch.setattr(lookup, "slab", lambda model, grid, i: 1 / 0 if i == 9 else slab(model, grid, i))
    with pytest.raises(ZeroDivisionError):
        run("table", "paper", "--step", 0.5, "--out", "t.npy")
    monkeypatch.setattr(lookup, "slab", slab)
    status, out, _ = run("table", "paper", "--step", 0.5, "--set", "l0=8", "--out", "t.npy", "--json")
    assert (status, strict(out)[0]["resumed"]) == (0, 0)


def test_the_papers_grid():
    grid = lookup.Grid(3.0, 3.0, 0.01)
    assert np.prod(grid.shape) == 108_721_501
    assert_allclose(grid.axes()[0][[0, 300, 600]], [-3, 0, 3], atol=1e-15)
    with pytest.raises(BadInput, match="whole number of steps"):
        lookup.Grid(3.0, 3.0, 0.7)


@pytest.mark.parametrize(
    ("tokens", "words"),
    [
        (("--out", "t.csv"), "must end in .npy"),
        (("--out", "t.npy", "--step", 0), "more than 0"),
        (("--out", "t.npy", "--step", "nan"), "more than 0"),
        (("--out", "t.npy", "--step", 4), "at most"),
        (("--out", "t.npy", "--step", 1e-4), "disk"),
        (("--out", "t.npy", "--step", 1e-9), "disk"),
        (("--out", "t.npy", "--level", "best"), "level must be"),
        (("--out", "t.npy", "--set", "l0=3"), "S1 lies inside the beam"),
        (("--out", "t.npy", "--set", "magnet_diameter=0", "--set", "magnet_height=0"), "no magnet"),
    ],
)
def test_bad_input_is_a_sentence(refusal, tokens, words):
    assert words in refusal("table", "paper", *tokens)
