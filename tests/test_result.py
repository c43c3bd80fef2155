"""A result on its way to terminal, JSON, tables, files and exit status, and the commit that it names."""

import json
import math
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pyarrow import parquet

from studies.output import provenance
from studies.output.atomic_files import write_text
from studies.output.result import (
    FAILED,
    GOOD,
    Destination,
    Interrupted,
    Result,
    Table,
    failure_of,
    of_record,
    publish,
)
from studies.output.table_files import write_table, writer

NAMES = ("press.csv", "press.txt", "PAGE.md")
ROWS = [
    {"depth_mm": 1.0, "force_N": 2.0, "message": ""},
    {"depth_mm": 2.0, "force_N": None, "message": "stopped at 1.5 mm"},
]


def result(**more):
    return Result(title="Press", records=ROWS, **more)


def run(found, **here):
    return publish(lambda _: found, Destination(**here))


def test_json_has_the_records_and_nothing_else(capsys):
    found = result(shown=["not this"], warnings=["mind"], remarks=["so"])
    assert run(found, as_json=True) == GOOD
    printed = capsys.readouterr()
    assert [json.loads(line) for line in printed.out.splitlines()] == ROWS
    assert printed.err == "magtip: warning: mind\nmagtip: so\n"


def test_the_terminal_has_the_blocks_in_their_order(capsys):
    shown = [
        Table(title="Lines", rows=[{"depth": "1 mm"}]),
        Table(title="Texts", rows=[{"modulus": "long-term"}, {"modulus": "instantaneous"}]),
        Table(title="Table", rows=ROWS, places=("depth_mm",)),
        "A note.",
    ]
    assert run(result(shown=shown)) == GOOD
    out = capsys.readouterr().out
    places = [out.index(text) for text in ("Lines", "Texts", "Table", "depth 2 mm: stopped at 1.5 mm", "A note.")]
    assert places == sorted(places)


def test_records_are_the_default_table(capsys):
    assert run(of_record("Readings", {"S1_V": 2.5, "hidden": 1, "warnings": ["S1 is saturated"]}, ["hidden"])) == GOOD
    printed = capsys.readouterr()
    assert "2.5 V" in printed.out
    assert "hidden" not in printed.out
    assert printed.err == "magtip: warning: S1 is saturated\n"


def test_failures_are_the_exit_status(capsys):
    found = [{"status": "ok"}, {"status": "failed", "message": "it buckles"}]
    assert run(result(failures=failure_of(found)), as_json=True) == FAILED
    assert capsys.readouterr().err == "magtip: it buckles\n"
    assert failure_of(found[:1]) == []


def test_a_folder_has_tables_files_pages_and_the_record_of_the_run(tmp_path):
    out = tmp_path / "o"
    found = result(
        tables={"press": ROWS},
        files={"press.txt": partial(write_text, text="x")},
        pages={"PAGE.md": "# Press\n\n"},
        design={"D": 8.0},
    )
    assert run(found, out=out, names=NAMES, command="magtip press", as_json=True) == GOOD
    assert {path.name for path in out.glob("[!.]*")} == {*NAMES, "run.json"}
    assert pd.read_csv(out / "press.csv")["depth_mm"].tolist() == found.frame("press")["depth_mm"].tolist() == [1, 2]
    assert (out / "PAGE.md").read_text().startswith("# Press\n\nMade with `magtip press`, on Python ")
    assert json.loads((out / "run.json").read_text())["design"] == {"D": 8.0}
    # what earlier options have written, and these do not, goes
    assert run(result(tables={"press": ROWS}), out=out, names=NAMES, as_json=True) == GOOD
    assert {path.name for path in out.glob("[!.]*")} == {"press.csv", "run.json"}


def test_an_interruption_prints_what_is_complete_and_writes_nothing(tmp_path, capsys):
    def study(_):
        raise Interrupted("1 of 2 presses are complete", result(tables={"press": ROWS}))

    with pytest.raises(KeyboardInterrupt, match="1 of 2 presses are complete"):
        publish(study, Destination(out=tmp_path / "new", names=NAMES, as_json=True))
    assert len(capsys.readouterr().out.splitlines()) == 2
    assert list(Path(tmp_path).iterdir()) == []


# Tables written batch by batch: round trips, missing values, memory, refusals.


SUFFIXES = (".csv", ".parquet")
MEMORY = """
import resource, sys
import numpy as np
from studies.output.table_files import writer

def table(batches):
    with writer(sys.argv[1]) as write:
        for start in range(batches):
            write({f"x{k}": np.arange(20_000.0) + 0.1 * k + start for k in range(8)} | {"n": np.arange(20_000)})
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

print(table(6), table(16))
"""


def batch(start, count):
    values = np.arange(start, start + count) / 7
    values[::3] = np.nan
    texts = np.array([None if k % 4 else f"row, {k}" for k in range(start, start + count)], dtype=object)
    return {"force_N": values, "solve": np.arange(start, start + count), "ok": values > 1, "message": texts}


def joined(*batches):
    return pd.DataFrame({name: np.concatenate([b[name] for b in batches]) for name in batches[0]})


def written(path, *batches, **options):
    with writer(path, **options) as write:
        for columns in batches:
            write(columns)
    return path


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_round_trip(tmp_path, suffix):
    batches = batch(0, 5), batch(5, 1), batch(6, 30)
    path = written(tmp_path / f"t{suffix}", *batches, digits=17)
    table = parquet.read_table(path).to_pandas() if suffix == ".parquet" else pd.read_csv(path)
    pd.testing.assert_frame_equal(table, joined(*batches))


def test_parquet_stores_null_for_nan(tmp_path):
    table = parquet.read_table(written(tmp_path / "t.parquet", batch(0, 9)))
    assert (table["force_N"].null_count, table["message"].null_count) == (3, 6)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("columns", [{"x": np.zeros(2), "y": np.zeros(3)}, {"x": np.zeros(2)}])
def test_a_wrong_batch_leaves_the_file_of_before(tmp_path, suffix, columns):
    (tmp_path / f"t{suffix}").write_text("before")
    with pytest.raises((ValueError, KeyError)):
        written(tmp_path / f"t{suffix}", {"x": np.zeros(2), "y": np.ones(2)}, columns)
    assert [path.read_text() for path in tmp_path.glob("[!.]*")] == ["before"]


def test_memory_does_not_grow_with_the_rows(tmp_path):
    pytest.importorskip("resource")
    run = [sys.executable, "-c", MEMORY, str(tmp_path / "t.parquet")]
    first, last = map(int, subprocess.run(run, capture_output=True, text=True, check=True).stdout.split())
    # the 200 000 rows more of the second table have 14 MB
    assert last - first < 5_000


MIXED = [
    {"depth_mm": 0.1, "solve": 1, "ok": True, "message": "", "number": 7},
    {"depth_mm": math.nan, "solve": 2, "ok": False, "message": 'a "b", c', "mixed": "text"},
    {"depth_mm": -1e-7, "solve": 3, "ok": True, "message": None, "mixed": 1.23456789, "number": 12345678},
]


@pytest.mark.parametrize("rows", [MIXED, MIXED[:1], []])
@pytest.mark.parametrize("digits", [3, 6, 12])
def test_text_is_what_pandas_writes(tmp_path, rows, digits):
    write_table(tmp_path / "t.csv", iter(rows), digits=digits)
    expected = pd.DataFrame(rows).to_csv(index=False, float_format=f"%.{digits}g", lineterminator="\n")
    assert (tmp_path / "t.csv").read_bytes() == expected.encode()


def test_minus_zero_is_zero(tmp_path):
    write_table(tmp_path / "t.csv", [{"planned_Fx_N": -0.0}])
    assert (tmp_path / "t.csv").read_text("utf-8") == "planned_Fx_N\n0\n"


# Which commit and which versions a result names.


NAME = ("-c", "user.name=a", "-c", "user.email=a@b.invalid")


def git(folder, *words):
    return subprocess.run(["git", *words], cwd=folder, check=True, capture_output=True, text=True).stdout.strip()


def copied(folder):
    """A copy of the module's package below a folder."""
    package = folder / "studies"
    shutil.copytree(
        Path(provenance.__file__).parent, package / "output", ignore=shutil.ignore_patterns("__pycache__")
    )
    (package / "__init__.py").touch()
    return package


def commit_of(package):
    code = "from studies.output.provenance import commit; print(commit())"
    ended = subprocess.run(
        [sys.executable, "-c", code],
        cwd=package.parent,
        capture_output=True,
        text=True,
        check=True,
        env={"PATH": PATH, "PYTHONPATH": str(provenance.ROOT)},
    )
    return ended.stdout.strip()


PATH = str(Path(shutil.which("git") or "").parent)


@pytest.fixture
def repository(tmp_path):
    """A function that makes a repository of a project, with the package in a folder, committed or not."""

    def made(project, folder, *, committed):
        git(tmp_path, "init", "-q")
        (tmp_path / "pyproject.toml").write_text(f'[project]\nname = "{project}"\n')
        package = copied(tmp_path / folder)
        git(tmp_path, "add", "-A" if committed else "pyproject.toml")
        git(tmp_path, *NAME, "commit", "-qm", "one")
        return package

    return made


@pytest.mark.parametrize(
    ("project", "folder", "committed"),
    [("theirs", "venv/site-packages", False), ("theirs", ".", True), ("magtip", ".", False)],
)
def test_a_copy_that_is_no_checkout_of_the_project_names_no_commit(repository, project, folder, committed):
    assert commit_of(repository(project, folder, committed=committed)) == "None"


def test_a_checkout_of_the_project_names_its_commit_and_whether_it_was_changed(repository, tmp_path):
    package = repository("magtip", ".", committed=True)
    head = git(tmp_path, "rev-parse", "--short", "HEAD")
    assert commit_of(package) == head
    (tmp_path / "README.md").write_text("not a source of results")
    git(tmp_path, "add", "README.md")
    assert commit_of(package) == head
    (package / "__init__.py").write_text("changed = True\n")
    assert commit_of(package) == f"{head}-dirty"


def test_versions_leave_out_what_is_not_installed():
    text = provenance.versions(["numba-that-nobody-has", "altair"])
    assert text.startswith("on Python 3.")
    assert "nobody" not in text
    assert ", altair " in text
