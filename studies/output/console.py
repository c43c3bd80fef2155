"""Output of commands: JSON lines or tables on standard output, progress and warnings on standard error."""

from __future__ import annotations

import contextlib
import importlib
import os
import re
import shutil
import sys
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, TextIO

from geometry.messages import WARNING, Progress
from studies.output import text_tables
from studies.output.atomic_files import json_line
from studies.output.literals import one_line

if TYPE_CHECKING:
    from rich.console import RenderableType

UNLIMITED = 1_000_000
"""Characters of a line in a file, in a pipe, or of a table that is wide."""
MOST_NAMED = 6
"""Greatest number of records that are listed for a message, and of hidden columns that are named."""
SENTENCES = ("message", "warning", "warnings")
"""Keys of sentences, which verbs print in full below a table; only a wide table has columns for them."""
VECTOR = re.compile(r"[-+.\de]*(, [-+.\de]+){0,2}")
"""Up to three numbers, which are never broken over lines."""
GAP = 2
"""Space between columns, characters."""
LEFTMOST = 2
"""Number of columns that a table must show if a verb does not name the columns that it needs."""
LEAST_TEXT = 20
"""Least width of a column of texts, characters, unless a word is longer; texts are broken between words only."""
NUMBER = 7
"""Least characters of a number in a table whose rows are printed one by one, so that it is rarely widened."""
RECENT = 3600.0
"""Time over which the progress is measured that gives the time left, s: one solve may take minutes."""


def room() -> int:
    """Return the characters of a line: the environment variable COLUMNS, else the width of the terminal.

    A table in a file or a pipe has all its columns.
    """
    columns = os.environ.get("COLUMNS", "")
    if columns.isdecimal() and int(columns) > 0:
        return int(columns)
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else UNLIMITED


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
        keys = [key for key in records[0] if wide or key not in brief]
        _print([*_titled(title), *_upright(records[0], keys, 5), ""])
    elif records:
        keys, rest = _keys(records, brief, wide=wide)
        table = _Table(title, keys, first, UNLIMITED if wide else room())
        table.add(records)
        table.end(rest)


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
    table: _Table | None = None
    for record in records:
        printed.append(dict(record))
        if as_json or count == 1:
            report([record], as_json=as_json, title=title, brief=brief, wide=wide)
            continue
        if table is None:
            every = [key for key in record if key not in SENTENCES]
            table = _Table(title, every if wide else keys, first, UNLIMITED if wide else room(), NUMBER)
        table.add([record])
    if table is not None:
        table.end(_keys(printed, table.keys, wide=False)[0])
    return printed


def _keys(records: Sequence[Mapping[str, Any]], brief: Sequence[str], *, wide: bool) -> tuple[list[str], list[str]]:
    """Return the keys that have values in a record, and those of them that only a wide table shows."""
    every = dict.fromkeys(key for record in records for key in record)
    keys = [key for key in every if any(record.get(key) not in (None, "") for record in records)]
    rest = [] if wide else [key for key in keys if key in (*brief, *SENTENCES)]
    return [key for key in keys if key not in rest], [key for key in rest if key not in SENTENCES]


class _Table:
    """A table whose records are printed as they come; its head is printed again when a value needs a wider column.

    Parameters
    ----------
    first : keys that the table must show, the most important first; default: the leftmost `LEFTMOST`.
    space : characters of a line.
    number : characters that a column has at least for each number.
    """

    def __init__(self, title: str, keys: Sequence[str], first: Sequence[str], space: int, number: int = 0) -> None:
        self.title, self.keys, self.space, self.number = title, list(keys), space, number
        self.needed = [key for key in first if key in self.keys] or self.keys[:LEFTMOST]
        self.least: dict[str, int] = {}
        self.widths: dict[str, int] | None = {}

    def add(self, records: Sequence[Mapping[str, Any]]) -> None:
        """Print records, as rows of the columns that fit, else with one value to a line."""
        cells = {
            key: [one_line(text_tables.in_unit(key, record.get(key), 4)) for record in records] for key in self.keys
        }
        least = {key: self._least(key, texts) for key, texts in cells.items()}
        title = [] if self.least else _titled(self.title)
        is_wider = any(width > self.least.get(key, 0) for key, width in least.items())
        gap = [""] if is_wider and self.least else []
        if is_wider:
            self.least = {key: max(width, self.least.get(key, 0)) for key, width in least.items()}
            self.widths = self._fitting(cells)
        if self.widths is None:
            for record in records:
                _print([*title, *_upright(record, self.keys, 4), ""])
                title = []
        else:
            _print([*title, *gap, _rows({key: cells[key] for key in self.widths}, self.widths, is_wider)], self.space)

    def _least(self, key: str, cells: Sequence[str]) -> int:
        """Return the least width of a column: no word and no vector is broken."""
        longest = max(map(_width, cells))
        if all(map(VECTOR.fullmatch, cells)):
            longest = max(longest, self.number * (1 + max(cell.count(",") for cell in cells)))
        else:
            longest = max(min(longest, LEAST_TEXT), _longest_word(*cells))
        return max(longest, _longest_word(text_tables.titled(key)))

    def _fitting(self, cells: Mapping[str, Sequence[str]]) -> dict[str, int] | None:
        """Return the widths of the columns that fit into a line, or None if those that are needed do not.

        Texts that would be broken get the unused characters of the line.
        """
        taken, spare = [], self.space + GAP
        for key in dict.fromkeys((*self.needed, *self.keys)):
            if self.least[key] + GAP <= spare:
                taken.append(key)
                spare -= self.least[key] + GAP
            elif key in self.needed:
                return None
        widths = {key: self.least[key] for key in self.keys if key in taken}
        for key in widths:
            more = min(max(map(_width, cells[key])) - widths[key], spare)
            widths[key] += max(more, 0)
            spare -= max(more, 0)
        return widths

    def end(self, rest: Sequence[str]) -> None:
        """Name the columns that the table did not show, and these others."""
        if self.widths is not None:
            print(flush=True)
        keys = [*(key for key in self.keys if self.widths is not None and key not in self.widths), *rest]
        if keys:
            names = [text_tables.heading(key)[0] for key in keys[:MOST_NAMED]]
            more = f" and {len(keys) - MOST_NAMED} more" if len(keys) > MOST_NAMED else ""
            note(f"Left out: {', '.join(names)}{more}; --wide and --json show all columns.")


def _rows(cells: Mapping[str, Sequence[str]], widths: Mapping[str, int], has_head: bool) -> RenderableType:
    """Return a table of these columns; rich breaks texts between words and aligns them.

    Which columns fit is decided before: rich would break numbers, or shorten them.
    """
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    # the box adds one space between columns
    table = Table(box=SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, GAP - 1, 0, 0), show_header=has_head)
    for key, width in widths.items():
        table.add_column(text_tables.titled(key), width=width, overflow="fold")
    for row in zip(*cells.values(), strict=True):
        table.add_row(*row)
    return table


def _upright(record: Mapping[str, Any], keys: Sequence[str], digits: int) -> Iterator[RenderableType]:
    """Yield the lines of a record, each with a name, its value and unit; a long value stands below its name."""
    from rich.padding import Padding

    names = [text_tables.heading(key)[0] for key in keys]
    longest = max(map(_width, names), default=0)
    for key, name in zip(keys, names, strict=True):
        value = one_line(text_tables.with_its_unit(key, record.get(key), digits))
        if longest + GAP + _width(value) <= room():
            yield name + " " * (longest + GAP - _width(name)) + value
        else:
            yield name
            yield Padding.indent(value, GAP)


def note(text: str) -> None:
    """Print a sentence on standard output, wrapped to the width of the terminal."""
    _print([one_line(text)])


def _titled(title: str) -> list[RenderableType]:
    return [one_line(title)] if title else []


def _width(text: str) -> int:
    """Return the characters that a text takes on a terminal: a Chinese one takes two."""
    from rich.cells import cell_len

    return cell_len(text)


def _longest_word(*texts: str) -> int:
    return max((_width(word) for text in texts for word in text.split()), default=0)


def _print(parts: Iterable[RenderableType], width: int = 0) -> None:
    """Print texts and tables on standard output; `width`: characters of a line, default: those of `room`."""
    from rich.console import Console

    screen = Console(width=width or room(), force_jupyter=False, markup=False, emoji=False, highlight=False)
    with screen.capture() as drawn:
        for part in parts:
            screen.print(part)
    # rich fills the cells of the last column with spaces, and would end the process if nobody reads what it prints
    print("\n".join(line.rstrip() for line in drawn.get().split("\n")), end="", flush=True)


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
    cells = [[text_tables.in_unit(key, record.get(key), 4) for key in keys] for record in records[:MOST_NAMED]]
    more = f" and {len(records) - MOST_NAMED} more" if len(records) > MOST_NAMED else ""
    if len(keys) == 1:
        ((name, unit),) = heads
        return f"{name} {', '.join(cell for (cell,) in cells)} {unit}".strip() + more
    each = [[f"{n} {text} {unit}".strip() for (n, unit), text in zip(heads, row, strict=True)] for row in cells]
    return "; ".join(", ".join(parts) for parts in each) + more


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
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("left"),
        TextColumn("{task.description}", markup=False),
    )
    # rich would redirect prints to standard error, away from a pipe or a file that standard output leads to
    redirect = sys.stdout.isatty()
    screen = Console(stderr=True)
    with Bar(*columns, console=screen, transient=True, redirect_stdout=redirect, speed_estimate_period=RECENT) as bar:
        task = bar.add_task("loading", total=1.0)
        # the beginning, from which the speed counts
        bar.update(task, completed=1e-9)
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
    """Print a bar where no terminal is, but a carriage return leads to the beginning of the line: in a notebook.

    There rich needs ipywidgets, which a notebook may not have.
    """
    full = round(24 * share)
    bar = f"{'█' * full}{'░' * (24 - full)} {100 * share:3.0f} %"
    print(f"\r{bar}  {text:60.60}", end="", file=sys.stderr, flush=True)


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
