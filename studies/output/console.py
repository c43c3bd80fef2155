"""What a command shows: JSON lines or tables on standard output, progress on standard error."""

from __future__ import annotations

import contextlib
import importlib
import os
import shutil
import sys
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from geometry.messages import WARNING, Progress
from studies.output import text_tables
from studies.output.atomic_files import json_line
from studies.output.text_tables import Column

MOST_NAMED = 6
"""Of the records that a message is of, and of the columns that are left out."""

TOLD = ("message", "warning", "warnings")
"""Keys of sentences, which verbs print in whole below a table: they are in it only if it is wide."""

LEFTMOST = 2
"""Columns that a person needs where a verb does not say which."""

NUMBER, LIST = 8, 20
"""Characters first given to numbers, and to lists of them, in rows that are printed one by one."""


def room() -> int | None:
    """Characters of a line: as the environment's COLUMNS says, else those of the terminal.

    None where standard output is no terminal: no column of a table is left out there for want of room.
    """
    given = os.environ.get("COLUMNS", "")
    if given.isdecimal() and int(given) > 0:
        return int(given)
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
    """Print each record as one line of JSON; or all as a table, one record upright, several one to a row.

    Columns that are empty in all records are left out. So are, from right to left, those that a line has no room for,
    and it is said which; where those in `first` do not all fit, every record stands upright.

    Parameters
    ----------
    brief : keys that the table leaves out unless it is wide.
    first : keys that a person needs most, those of the leftmost columns by default.
    wide : all columns, however long the lines become.
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
        chosen = _fitting(columns, first, space)
        if chosen is None:
            blocks = [text_tables.upright({key: record.get(key) for key in keys}, space, 4) for record in records]
            _print_lines(title, [line for block in blocks for line in (*block, "")][:-1])
            chosen = keys
        else:
            _print_lines(title, text_tables.table([columns[key] for key in chosen], space))
        _say_what_is_left_out([*(key for key in keys if key not in chosen), *rest])


def _keys(records: Sequence[Mapping[str, Any]], brief: Sequence[str], *, wide: bool) -> tuple[list[str], list[str]]:
    """Keys of a table's columns, and of those that only a wide one has."""
    filled = dict.fromkeys(key for record in records for key, value in record.items())
    empty = {key for key in filled if all(record.get(key) in (None, "") for record in records)}
    keys = [key for key in filled if key not in empty]
    rest = [] if wide else [key for key in keys if key in (*brief, *TOLD)]
    return [key for key in keys if key not in rest], [key for key in rest if key not in TOLD]


def _fitting(columns: Mapping[str, Column], first: Sequence[str], space: int | None) -> list[str] | None:
    """Keys of the columns that fit, None where those that are needed do not."""
    keys = list(columns)
    needed = [key for key in first if key in columns] or keys[:LEFTMOST]
    order = [keys.index(key) for key in (*needed, *(key for key in keys if key not in needed))]
    places = text_tables.fitting([columns[key].least for key in keys], len(needed), order, space)
    return None if places is None else [keys[k] for k in places]


def _say_what_is_left_out(keys: Sequence[str]) -> None:
    keys = list(dict.fromkeys(keys))
    if keys:
        names = [text_tables.heading(key)[0] for key in keys[:MOST_NAMED]]
        more = f" and {len(keys) - MOST_NAMED} more" if len(keys) > MOST_NAMED else ""
        note(f"Left out: {', '.join(names)}{more}; --wide and --json show all columns.")


class _Stream:
    """A table whose rows are printed one by one; its head comes again where a value needs a wider column."""

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
        """Make room for a row, and print the head."""
        for key, column in new.items():
            value = record.get(key)
            spare = LIST if isinstance(value, (list, tuple)) else NUMBER if isinstance(value, (int, float)) else 0
            before = self.columns[key].cells if key in self.columns else (" " * spare,)
            self.columns[key] = replace(column, cells=(max(*before, *column.cells, key=len),))
        self.chosen = _fitting(self.columns, self.first, self.space)
        if self.chosen is not None:
            widths = [self.columns[key].least for key in self.chosen]
            lines = text_tables.headed([self.columns[key].head for key in self.chosen], widths)
            print("\n".join(([self.title] if self.title else [""]) + lines), flush=True)

    def end(self, records: Sequence[Mapping[str, Any]]) -> None:
        """Print what is left out of all the records."""
        if self.chosen is not None:
            print(flush=True)
        chosen = self.keys if self.chosen is None else self.chosen
        keys, _ = _keys(records, (), wide=False)
        _say_what_is_left_out([key for key in (*self.keys, *keys) if key not in chosen])


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
    """Print each record as soon as it is there, and return them all.

    Parameters
    ----------
    keys : of the columns of a table that is not wide.
    count : how many records are expected; a single one is printed upright.
    brief, first, wide : as in `report`.
    """
    printed: list[dict[str, Any]] = []
    rows: _Stream | None = None
    for record in records:
        if as_json or count == 1:
            report([record], as_json=as_json, title=title, brief=brief, wide=wide)
        else:
            if rows is None:
                every = [key for key in record if key not in TOLD]
                rows = _Stream(title, every if wide else keys, first, None if wide else room())
            rows.add(record)
        printed.append(dict(record))
    if rows is not None:
        rows.end(printed)
    return printed


def remarks(
    records: Sequence[Mapping[str, Any]], keys: Iterable[str], among: Sequence[Mapping[str, Any]] = ()
) -> list[str]:
    """Each message of the records once, with the records that it belongs to, told apart by those keys that vary.

    Parameters
    ----------
    among : the whole table that the records are of; by default they are all of it.

    >>> remarks([{"depth_mm": 1.0}, {"depth_mm": 2.0, "message": "gives way"}], ["depth_mm"])
    ['depth 2 mm: gives way']
    """
    whole = among or records
    there = [key for key in keys if any(key in record for record in whole)]
    varying = [key for key in there if len({record.get(key) for record in whole}) > 1] or there[:1]
    places: dict[str, list[Mapping[str, Any]]] = {}
    for record in records:
        if record.get("message"):
            places.setdefault(record["message"], []).append(record)
    return [f"{_places(found, varying)}: {message}" for message, found in places.items()]


def _places(records: Sequence[Mapping[str, Any]], keys: Sequence[str]) -> str:
    """The first few of the records by their keys."""
    heads = [text_tables.heading(key) for key in keys]
    cells = [[text_tables.shown(key, record.get(key), 4) for key in keys] for record in records[:MOST_NAMED]]
    more = f" and {len(records) - MOST_NAMED} more" if len(records) > MOST_NAMED else ""
    if len(keys) == 1:
        ((name, unit),) = heads
        return f"{name} {', '.join(cell for (cell,) in cells)} {unit}".strip() + more
    each = [[f"{n} {text} {unit}".strip() for (n, unit), text in zip(heads, row, strict=True)] for row in cells]
    return "; ".join(", ".join(parts) for parts in each) + more


def table(title: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table of texts, each column of it; where they do not fit, row by row upright."""
    columns = [Column(head, tuple(cells), breaks=True) for head, *cells in zip(heads, *rows, strict=True)]
    space = room()
    if text_tables.fitting([column.least for column in columns], len(columns), range(len(columns)), space):
        lines = text_tables.table(columns, space)
    else:
        blocks = [text_tables.named(list(zip(heads, row, strict=True)), space) for row in rows]
        lines = [line for block in blocks for line in (*block, "")][:-1]
    _print_lines(title, lines)


def note(text: str) -> None:
    """A sentence on standard output, in lines that a terminal has room for."""
    print("\n".join(text_tables.wrapped(text, room())), flush=True)


def _print_lines(title: str, lines: Sequence[str]) -> None:
    """A title, if there is one, the lines below it, and an empty one."""
    heads = text_tables.wrapped(title, room()) if title else []
    print("\n".join([*heads, *lines, ""]), flush=True)


def warn(text: str) -> None:
    """A warning on standard error."""
    say(f"{WARNING}{text}")


def say(text: str) -> None:
    """One line on standard error; where that cannot be written, there is nobody to tell."""
    with contextlib.suppress(OSError):
        print(" ".join(text.split()), file=sys.stderr, flush=True)


@contextlib.contextmanager
def progress(*, as_json: bool) -> Iterator[Progress]:
    """A callback that takes a fraction and a text: a bar in a terminal, else a line for each new text.

    With JSON and no terminal there is nothing.
    """
    if not sys.stderr.isatty():
        yield _silent if as_json else _Lines()
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
    # the bar would draw what is meant for a pipe or a file on standard error
    aside = sys.stdout.isatty()
    with Bar(*columns, console=Console(stderr=True), transient=True, redirect_stdout=aside) as bar:
        task = bar.add_task("loading", total=1.0)
        yield lambda fraction, text: bar.update(task, completed=fraction, description=text)


class _Lines:
    """A line for each new text."""

    def __init__(self) -> None:
        self.last = ""

    def __call__(self, fraction: float, text: str) -> None:
        if text != self.last:
            say(f"{100 * fraction:3.0f} %  {text}")
        self.last = text


def _silent(fraction: float, text: str) -> None:
    """No progress."""


_begun = threading.Event()
"""Slow modules are loaded, or about to be."""


def load(*names: str) -> None:
    """Import slow modules, in a thread of their own, so that Ctrl-C ends the wait for them at once.

    Raised within a library that is being loaded, a KeyboardInterrupt becomes an error of that library, or is lost. So
    the thread goes on loading, and a process that is to end now must not wait for it (see `loaded`).
    """
    if threading.current_thread() is not threading.main_thread() or all(name in sys.modules for name in names):
        for name in names:
            importlib.import_module(name)
        return
    failed: list[BaseException] = []

    def work() -> None:
        try:
            for name in names:
                importlib.import_module(name)
        except BaseException as error:
            failed.append(error)

    thread = threading.Thread(target=work, daemon=True)
    _begun.set()
    thread.start()
    thread.join()
    if failed:
        raise failed[0]


def loaded() -> bool:
    """Whether `load` has been at work: Python then takes seconds to end, or fails in what is still being loaded."""
    return _begun.is_set()
