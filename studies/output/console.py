"""Output of commands: JSON lines or tables on standard output, progress and warnings on standard error."""

from __future__ import annotations

import contextlib
import importlib
import os
import shutil
import sys
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import replace
from typing import Any, TextIO

from geometry.messages import WARNING, Progress
from studies.output import text_tables
from studies.output.atomic_files import json_line
from studies.output.text_tables import Column

MOST_NAMED = 6
"""Greatest number of records that are listed for a message, and of hidden columns that are named."""
SENTENCES = ("message", "warning", "warnings")
"""Keys of sentences, which verbs print in full below a table; only a wide table has columns for them."""
NUMBER, LIST = 8, 20
"""Initial widths of columns of numbers and of lists, characters, in a table whose rows are printed one by one."""


def room() -> int | None:
    """Return the characters of a line: the environment variable COLUMNS, else the width of the terminal.

    None if standard output is no terminal: a table in a file or a pipe has all its columns.
    """
    columns = os.environ.get("COLUMNS", "")
    if columns.isdecimal() and int(columns) > 0:
        return int(columns)
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


def report(
    records: Sequence[Mapping[str, Any]],
    *,
    as_json: bool,
    title: str = "",
    brief: Sequence[str] = (),
    first: Sequence[str] = (),
    wide: bool = False,
) -> None:
    """Print each record as one line of JSON, or all records as a table.

    A single record is printed with one value to a line. Columns that are empty in all records are hidden. Columns
    that do not fit into a line are hidden too, from right to left, and a note names them. If the columns `first` do
    not all fit, every record is printed with one value to a line.

    Parameters
    ----------
    brief : keys that only a wide table shows.
    first : keys that the table must show; default: those of the leftmost columns.
    wide : whether all columns are shown, however long the lines become.
    """
    if as_json:
        for record in records:
            print(json_line(record), flush=True)
        return
    if len(records) == 1:
        (record,) = records
        shown = {key: value for key, value in record.items() if wide or key not in brief}
        _print_lines(title, text_tables.upright(shown, room()))
    elif records:
        keys, rest = _keys(records, brief, wide=wide)
        columns = {key: text_tables.column(key, [record.get(key) for record in records]) for key in keys}
        space = None if wide else room()
        chosen = text_tables.fitting(columns, first, space)
        if chosen is None:
            blocks = [text_tables.upright({key: record.get(key) for key in keys}, space, 4) for record in records]
            _print_lines(title, [line for block in blocks for line in (*block, "")][:-1])
            chosen = keys
        else:
            _print_lines(title, text_tables.table([columns[key] for key in chosen], space))
        _name_hidden_columns([*(key for key in keys if key not in chosen), *rest])


def _keys(records: Sequence[Mapping[str, Any]], brief: Sequence[str], *, wide: bool) -> tuple[list[str], list[str]]:
    filled = dict.fromkeys(key for record in records for key, value in record.items())
    empty = {key for key in filled if all(record.get(key) in (None, "") for record in records)}
    keys = [key for key in filled if key not in empty]
    rest = [] if wide else [key for key in keys if key in (*brief, *SENTENCES)]
    return [key for key in keys if key not in rest], [key for key in rest if key not in SENTENCES]


def _name_hidden_columns(keys: Sequence[str]) -> None:
    keys = list(dict.fromkeys(keys))
    if keys:
        names = [text_tables.heading(key)[0] for key in keys[:MOST_NAMED]]
        more = f" and {len(keys) - MOST_NAMED} more" if len(keys) > MOST_NAMED else ""
        note(f"Left out: {', '.join(names)}{more}; --wide and --json show all columns.")


class _Stream:
    """A table whose rows are printed one by one; the head is printed again when a value needs a wider column.

    `chosen` are the keys of the columns shown; None if rows are printed with one value to a line.
    """

    def __init__(self, title: str, keys: Sequence[str], first: Sequence[str], space: int | None) -> None:
        self.title, self.keys, self.first, self.space = title, list(keys), first, space
        self.columns: dict[str, Column] = {}
        self.chosen: list[str] | None = []

    def add(self, record: Mapping[str, Any]) -> None:
        """Print a row."""
        new = {key: text_tables.column(key, [record.get(key)]) for key in self.keys}
        if not self.columns or any(new[key].least > self.columns[key].least for key in self.keys):
            self._widen(new, record)
        if self.chosen is None:
            lines = text_tables.upright({key: record.get(key) for key in self.keys}, self.space, 4)
            _print_lines(self.title, lines)
        else:
            widths = [self.columns[key].least for key in self.chosen]
            print("\n".join(text_tables.row([new[key].cells[0] for key in self.chosen], widths)), flush=True)
        self.title = ""

    def _widen(self, new: Mapping[str, Column], record: Mapping[str, Any]) -> None:
        """Widen the columns for a row, and print the head.

        A column is never narrowed, and new columns get spare characters, so that the head is rarely printed again.
        """
        for key, column in new.items():
            value = record.get(key)
            spare = LIST if isinstance(value, (list, tuple)) else NUMBER if isinstance(value, (int, float)) else 0
            before = self.columns[key].cells if key in self.columns else (" " * spare,)
            self.columns[key] = replace(column, cells=(max(*before, *column.cells, key=len),))
        self.chosen = text_tables.fitting(self.columns, self.first, self.space)
        if self.chosen is not None:
            widths = [self.columns[key].least for key in self.chosen]
            lines = text_tables.headed([self.columns[key].head for key in self.chosen], widths)
            print("\n".join(([self.title] if self.title else [""]) + lines), flush=True)

    def end(self, records: Sequence[Mapping[str, Any]]) -> None:
        """Name the columns of the records that the table did not show."""
        if self.chosen is not None:
            print(flush=True)
        chosen = self.keys if self.chosen is None else self.chosen
        keys, _ = _keys(records, (), wide=False)
        _name_hidden_columns([key for key in (*self.keys, *keys) if key not in chosen])


def stream(
    records: Iterable[Mapping[str, Any]],
    *,
    as_json: bool,
    title: str,
    keys: Sequence[str],
    count: int,
    brief: Sequence[str] = (),
    first: Sequence[str] = (),
    wide: bool = False,
) -> list[dict[str, Any]]:
    """Print each record as soon as it is computed, and return all of them.

    Parameters
    ----------
    keys : columns of a table that is not wide.
    count : how many records are expected; a single one is printed with one value to a line.
    """
    printed: list[dict[str, Any]] = []
    rows: _Stream | None = None
    for record in records:
        if as_json or count == 1:
            report([record], as_json=as_json, title=title, brief=brief, wide=wide)
        else:
            if rows is None:
                every = [key for key in record if key not in SENTENCES]
                rows = _Stream(title, every if wide else keys, first, None if wide else room())
            rows.add(record)
        printed.append(dict(record))
    if rows is not None:
        rows.end(printed)
    return printed


def remarks(
    records: Sequence[Mapping[str, Any]], keys: Iterable[str], among: Sequence[Mapping[str, Any]] = ()
) -> list[str]:
    """Return each message once, after the values that identify its records; see `messages`.

    >>> remarks([{"depth_mm": 1.0}, {"depth_mm": 2.0, "message": "buckles"}], ["depth_mm"])
    ['depth 2 mm: buckles']
    """
    return [f"{place}: {message}" for place, message in messages(records, keys, among)]


def messages(
    records: Sequence[Mapping[str, Any]], keys: Iterable[str], among: Sequence[Mapping[str, Any]] = ()
) -> list[tuple[str, str]]:
    """Return the values that identify the records of each message, and the message.

    Parameters
    ----------
    keys : keys that may identify a record; those that vary in the table are used.
    among : all records of the table; default: `records` is the whole table.
    """
    whole = among or records
    present = [key for key in keys if any(key in record for record in whole)]
    varying = [key for key in present if len({record.get(key) for record in whole}) > 1] or present[:1]
    by_message: dict[str, list[Mapping[str, Any]]] = {}
    for record in records:
        if record.get("message"):
            by_message.setdefault(record["message"], []).append(record)
    return [(_places(group, varying), message) for message, group in by_message.items()]


def _places(records: Sequence[Mapping[str, Any]], keys: Sequence[str]) -> str:
    heads = [text_tables.heading(key) for key in keys]
    cells = [[text_tables.shown(key, record.get(key), 4) for key in keys] for record in records[:MOST_NAMED]]
    more = f" and {len(records) - MOST_NAMED} more" if len(records) > MOST_NAMED else ""
    if len(keys) == 1:
        ((name, unit),) = heads
        return f"{name} {', '.join(cell for (cell,) in cells)} {unit}".strip() + more
    each = [[f"{n} {text} {unit}".strip() for (n, unit), text in zip(heads, row, strict=True)] for row in cells]
    return "; ".join(", ".join(parts) for parts in each) + more


def table(title: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table of texts; if its columns do not all fit, print every row with one value to a line."""
    cells = enumerate(zip(heads, *rows, strict=True))
    columns = {str(k): Column(head, tuple(texts), breaks=True) for k, (head, *texts) in cells}
    space = room()
    if text_tables.fitting(columns, list(columns), space):
        lines = text_tables.table(list(columns.values()), space)
    else:
        blocks = [text_tables.named(list(zip(heads, row, strict=True)), space) for row in rows]
        lines = [line for block in blocks for line in (*block, "")][:-1]
    _print_lines(title, lines)


def lines(title: str, rows: Sequence[tuple[str, str]]) -> None:
    """Print names and their values below a title, one to a line."""
    _print_lines(title, text_tables.named(rows, room()))


def note(text: str) -> None:
    """Print a sentence on standard output, wrapped to the width of the terminal."""
    print("\n".join(text_tables.wrapped(text, room())), flush=True)


def _print_lines(title: str, lines: Sequence[str]) -> None:
    heads = text_tables.wrapped(title, room()) if title else []
    print("\n".join([*heads, *lines, ""]), flush=True)


_warned: ContextVar[set[str] | None] = ContextVar("_warned", default=None)
"""Warnings that the current command has printed."""


@contextlib.contextmanager
def warnings_once() -> Iterator[None]:
    """Print each warning of the block once: a verb may read a file for each of its outputs."""
    token = _warned.set(set())
    try:
        yield
    finally:
        _warned.reset(token)


def warn(text: str) -> None:
    """Print a warning on standard error."""
    warned = _warned.get()
    if warned is None or text not in warned:
        say(f"{WARNING}{text}")
    if warned is not None:
        warned.add(text)


def say(text: str) -> None:
    """Print one line on standard error; after an error there, which nobody could read, nothing is said."""
    try:
        print(" ".join(text.split()), file=sys.stderr, flush=True)
    except OSError:
        drop_stream(sys.stderr)


@contextlib.contextmanager
def progress(*, as_json: bool) -> Iterator[Progress]:
    """Yield a callback that takes a fraction (0 to 1) and a text, and shows the progress on standard error.

    A terminal and a notebook show a bar; otherwise each new text is a line, or nothing is shown where the output is
    JSON. The shown fraction never falls: a step that is done again, such as a solve in smaller increments, waits for
    the rest.
    """
    if type(sys.stderr).__module__.startswith("ipykernel"):
        yield _rising(_over_the_last_line, each=True)
        _over_the_last_line(1.0, "done")
        print(file=sys.stderr)
        return
    if not sys.stderr.isatty():
        yield _rising(lambda share, text: None if as_json else say(f"{100 * share:3.0f} %  {text}"), each=False)
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
    )
    # rich would redirect prints to standard error, away from a pipe or a file that standard output leads to
    redirect = sys.stdout.isatty()
    with Bar(*columns, console=Console(stderr=True), transient=True, redirect_stdout=redirect) as bar:
        task = bar.add_task("loading", total=1.0)
        yield _rising(lambda share, text: bar.update(task, completed=share, description=text), each=True)


@contextlib.contextmanager
def chosen_progress(wanted: Progress | bool | None) -> Iterator[Progress | None]:
    """Yield the callback that a caller from Python wants: the bar of `progress` for True, else their own or none."""
    if wanted is True:
        with progress(as_json=False) as bar:
            yield bar
    else:
        yield wanted or None


def _over_the_last_line(share: float, text: str) -> None:
    """Print a bar where no terminal is, but a carriage return leads to the beginning of the line: in a notebook."""
    print(f"\r{bar_of(share)}  {text:60.60}", end="", file=sys.stderr, flush=True)


def bar_of(share: float, width: int = 24) -> str:
    """Return a share, 0 to 1, as a bar and in percent.

    >>> bar_of(0.5, 4)
    '██░░  50 %'
    """
    full = round(share * width)
    return f"{'█' * full}{'░' * (width - full)} {100 * share:3.0f} %"


def _rising(show: Progress, *, each: bool) -> Progress:
    """Return a callback that shows the largest fraction so far, at each call or with each new text only."""
    largest, last = 0.0, ""

    def report(fraction: float, text: str) -> None:
        nonlocal largest, last
        largest = max(largest, fraction)
        if each or text != last:
            show(largest, text)
        last = text

    return report


_loading = threading.Event()
"""Set when `load` starts to import in a thread."""


def load(*names: str) -> None:
    """Import slow modules in a thread of their own, so that Ctrl-C ends the wait for them at once.

    A KeyboardInterrupt that is raised inside a library during its import may be lost or become an error of that
    library. So the thread continues to import, and a process that Ctrl-C ends must not wait for it (see `loaded`).
    """
    if threading.current_thread() is not threading.main_thread() or all(name in sys.modules for name in names):
        for name in names:
            importlib.import_module(name)
        return
    failed: list[BaseException] = []

    def import_all() -> None:
        try:
            for name in names:
                importlib.import_module(name)
        except BaseException as error:
            failed.append(error)

    thread = threading.Thread(target=import_all, daemon=True)
    _loading.set()
    thread.start()
    thread.join()
    if failed:
        raise failed[0]


def loaded() -> bool:
    """Return whether `load` has started imports: Python's own exit may then take seconds or fail."""
    return _loading.is_set()


# Standard streams that are closed, and a standard output that cannot be written


class OutputLost(OSError):
    """Standard output cannot be written: its disk is full, or the process that reads it has ended (EPIPE)."""


class Output:
    """A stream that raises `OutputLost` for its errors, which are thus distinct from errors of files."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with _as_output_lost():
            return self._stream.write(text)

    def flush(self) -> None:
        with _as_output_lost():
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextlib.contextmanager
def _as_output_lost() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputLost(error.errno, error.strerror or str(error)) from None


def complete_streams() -> None:
    """Connect closed standard streams to the null device.

    Otherwise the next files that are opened would get their numbers, and messages would be written into these files.
    """
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            handle = os.open(os.devnull, os.O_RDWR)
            setattr(sys, name, os.fdopen(handle, "r" if name == "stdin" else "w", encoding="utf-8"))


def drop_stream(stream: TextIO) -> None:
    """Connect a standard stream to the null device, so that Python's flush at the exit does not fail again."""
    handle = os.open(os.devnull, os.O_WRONLY)
    os.dup2(handle, stream.fileno())
    os.close(handle)
