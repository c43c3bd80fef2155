"""A result on its way to terminal, JSON, files and exit status."""

import json
from functools import partial
from pathlib import Path

import pandas as pd
import pytest

from geometry.design import BadInput
from studies.output import atomic_files
from studies.output.atomic_files import LOCK, write_text
from studies.output.result import (
    FAILED,
    GOOD,
    Destination,
    Interrupted,
    Lines,
    Result,
    Table,
    Texts,
    failure_of,
    of_record,
    publish,
)

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
        Lines("Lines", [("depth", "1 mm")]),
        Texts("Texts", ["modulus"], [["long-term"], ["instantaneous"]]),
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


def test_files_of_the_user_and_inputs_are_not_replaced(tmp_path):
    (tmp_path / "press.csv").write_text("mine\n")
    for inputs in ((), (tmp_path / "press.csv",)):
        with pytest.raises(BadInput, match=r"press\.csv"):
            run(result(tables={"press": ROWS}), out=tmp_path, names=NAMES, inputs=inputs)
    assert (tmp_path / "press.csv").read_text() == "mine\n"


def test_a_folder_that_another_process_fills_is_refused(tmp_path):
    with atomic_files.only(tmp_path / LOCK), pytest.raises(BadInput, match="is being filled"):
        run(result(), out=tmp_path)


def test_an_interruption_prints_what_is_complete_and_writes_nothing(tmp_path, capsys):
    def study(_):
        raise Interrupted("1 of 2 presses are complete", result(tables={"press": ROWS}))

    with pytest.raises(KeyboardInterrupt, match="1 of 2 presses are complete"):
        publish(study, Destination(out=tmp_path / "new", names=NAMES, as_json=True))
    assert len(capsys.readouterr().out.splitlines()) == 2
    assert list(Path(tmp_path).iterdir()) == []


def test_an_error_leaves_no_folder(tmp_path):
    def study(_):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        publish(study, Destination(out=tmp_path / "new", names=NAMES))
    assert list(tmp_path.iterdir()) == []
