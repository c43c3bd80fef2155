"""What a study found, as one value, and the one way of it to terminal, JSON, files and exit status.

A verb reads its options, checks what files it may write, and has `publish` run its study:

    @verb("source sets as_json")                             # studies.cli.parameters: DESIGN, --set, --json
    def modes(call: Call, *, count: Whole = 8) -> int:
        return publish(partial(vibration_report.natural_frequencies, call.design(), count), call.here())

The study is a function of a progress callback; it returns a `Result` and prints and writes nothing itself. Values are
records, that is, mappings from column names with their units to values. pandas is imported where a table is written.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry.messages import Progress
from studies.output import atomic_files, console, provenance
from studies.output.provenance import made, versions
from studies.output.records import FlatRow

if TYPE_CHECKING:
    import pandas as pd

GOOD, BAD, FAILED, INTERRUPTED, BROKEN_PIPE = 0, 2, 3, 130, 141
"""Exit statuses of all verbs: success; bad input; a failed solve or check; Ctrl-C; the reader of the output is gone.
1 is a bug."""
Rows = Sequence[Mapping[str, Any]]
Writer = Callable[[Path], None]
"""Writes the file whose path it gets, as an output of magtip (`studies.output.atomic_files.atomic`)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of the terminal; a single row has one value to a line.

    brief, first : keys that only a wide table shows, and those that every table shows.
    places : columns that tell rows apart: the message of each row stands below the table, after their values.
    among : all rows of the study among which `places` tell these apart; default: these rows.
    """

    title: str
    rows: Rows
    brief: Sequence[str] = ()
    first: Sequence[str] = ()
    places: Sequence[str] = ()
    among: Rows = ()


Block = Table | str
"""A part of what the terminal shows; a text is a sentence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What a study found.

    records : the objects that --json prints, one on a line.
    shown : what the terminal shows instead; default: the records as a table.
    tables : rows by the name of their CSV file without suffix; `digits` are significant.
    files : writers of the other files by their names.
    pages : texts in Markdown by the names of their files, to which a sentence with command and versions is added.
    packages : whose versions pages and run.json state besides the usual ones.
    warnings, remarks : sentences on standard error, `remarks` those without the word warning.
    failures : sentences that say why the exit status is 3; without them it is 0.
    design : fields of the design for run.json, empty if there is no single one; None writes no run.json.
    parts : results of which this one consists, printed and written one after the other before its own.
    """

    title: str
    records: Rows
    shown: Sequence[Block] | None = None
    tables: Mapping[str, Rows] = field(default_factory=dict)
    digits: int = 6
    files: Mapping[str, Writer] = field(default_factory=dict)
    pages: Mapping[str, str] = field(default_factory=dict)
    packages: Sequence[str] = ()
    warnings: Sequence[str] = ()
    remarks: Sequence[str] = ()
    failures: Sequence[str] = ()
    design: Mapping[str, Any] | None = None
    parts: Sequence[Result] = ()

    def frame(self, table: str) -> pd.DataFrame:
        """Return one of the tables as a DataFrame."""
        import pandas as pd

        return pd.DataFrame(list(self.tables[table]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Destination:
    """Where a result goes.

    command : command line that makes the result again; empty where no file states it.
    out : folder of the files; None writes none.
    inputs : files that the study reads, which no output may replace.
    names : names of all files that the study may write. What an earlier run left of them, and this one does not
        write, is deleted.
    """

    command: str = ""
    out: Path | None = None
    inputs: Sequence[str | Path | None] = ()
    names: Sequence[str] = ()
    as_json: bool = False
    wide: bool = False


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a study that has a result of what is complete; its text says what that is."""

    def __init__(self, text: str, result: Result) -> None:
        super().__init__(text)
        self.result = result


def collected(rows: Iterable[FlatRow], result: Callable[[list[FlatRow]], Result]) -> Result:
    """Return the result of all rows of a long study; after Ctrl-C `Interrupted` has that of the rows so far."""
    found: list[FlatRow] = []
    try:
        for row in rows:
            found.append(row)
    except KeyboardInterrupt:
        raise Interrupted(f"{len(found)} rows are complete, and no file is written", result(found)) from None
    return result(found)


def publish(study: Callable[[Progress], Result], here: Destination) -> int:
    """Run a study, write its files, print its result, and return the exit status.

    No file replaces an input or a file that magtip has not written. After Ctrl-C what is complete is printed, and no
    file is written.
    """
    check_files(here)
    try:
        with atomic_files.results(here.out, here.names) as folder, console.progress(as_json=here.as_json) as progress:
            result = study(progress)
            if folder is not None:
                progress(1.0, ", ".join(names(result)))
                write(result, folder, here.command)
    except Interrupted as stop:
        show(stop.result, here)
        raise KeyboardInterrupt(str(stop)) from None
    return show(result, here)


def check_files(here: Destination) -> None:
    """Refuse a destination whose files are inputs, or belong to the user."""
    names = (*here.names, provenance.NAME)
    atomic_files.check_apart(atomic_files.inside(here.out, names), here.inputs)


def names(result: Result) -> list[str]:
    """Return the names of the files of a result, but run.json."""
    own = [*(f"{name}.csv" for name in result.tables), *result.files, *result.pages]
    return [name for part in result.parts for name in names(part)] + own


def write(result: Result, folder: Path, command: str) -> None:
    """Write tables, files, pages and run.json into an existing folder."""
    from studies.output.table_files import write_table

    for part in result.parts:
        write(part, folder, command)
    origin = versions(result.packages)
    for name, rows in result.tables.items():
        write_table(folder / f"{name}.csv", rows, result.digits)
    for name, writer in result.files.items():
        writer(folder / name)
    for name, text in result.pages.items():
        atomic_files.write_text(folder / name, f"{text.rstrip()}\n\n{made(command, origin)}\n")
    if result.design is not None:
        provenance.write(folder, command, result.design, origin)


def show(result: Result, here: Destination) -> int:
    """Print a result, and return its exit status."""
    of_parts = [show(part, here) for part in result.parts]
    if here.as_json:
        console.report(result.records, as_json=True)
    else:
        blocks = [Table(title=result.title, rows=result.records)] if result.shown is None else result.shown
        for block in blocks:
            _show_block(block, wide=here.wide)
    for warning in result.warnings:
        console.warn(warning)
    for sentence in (*result.remarks, *result.failures):
        console.say(f"magtip: {sentence}")
    return FAILED if result.failures else max(of_parts, default=GOOD)


def _show_block(block: Block, *, wide: bool) -> None:
    if isinstance(block, str):
        console.note(block)
        return
    console.report(block.rows, as_json=False, title=block.title, brief=block.brief, first=block.first, wide=wide)
    for remark in console.remarks(block.rows, block.places, block.among) if block.places else ():
        console.note(remark)


def of_record(title: str, record: Mapping[str, Any], unshown: Sequence[str] = ()) -> Result:
    """Return the result of one record, which has its warnings; a table leaves these and the keys `unshown` out."""
    shown = {key: value for key, value in record.items() if key not in ("warnings", *unshown)}
    return Result(
        title=title, records=[record], shown=[Table(title=title, rows=[shown])], warnings=record["warnings"]
    )


def failure_of(records: Rows) -> list[str]:
    """Return the sentence of the last record that is not ok; nothing if all are.

    >>> failure_of([{"status": "ok"}, {"status": "failed"}, {"status": "ok"}])
    ['the solve failed: failed']
    """
    failed = [record for record in records if record.get("status", "ok") != "ok"]
    return [failed[-1].get("message") or f"the solve failed: {failed[-1]['status']}"] if failed else []
