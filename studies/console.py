"""What a command shows: JSON lines or tables on standard output, progress on standard error."""

from __future__ import annotations

import contextlib
import io
import shutil
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from studies.files import json_line

Progress = Callable[[float, str], None]

UNITS = {
    "mm": ("mm", 1.0),
    "mm3": ("mm³", 1.0),
    "um": ("µm", 1.0),
    "N": ("N", 1.0),
    "rad": ("rad", 1.0),
    "MPa": ("MPa", 1.0),
    "T": ("mT", 1e3),
    "V": ("V", 1.0),
    "Hz": ("Hz", 1.0),
    "percent": ("%", 1.0),
}
"""Unit that a key's last word stands for, as it is shown, and its size in it."""

TURNS = {
    "tilt_rad": "tilt towards x",
    "tilt_y_rad": "tilt towards y",
    "rotation_rad": "rotation vector rx, ry",
}
"""Names of the magnet's rotations: angles by which its axis leans, or the vector (-tilt_y, tilt) about its centre."""

MOST_NAMED = 6
"""Of the records that a message is of."""

NUMBER = 10
"""Columns of a number such as -0.0001234."""

WIDTH = 160
"""Columns of a table that is not shown in a terminal."""


def report(
    records: Sequence[Mapping[str, Any]], *, as_json: bool, title: str = "", brief: Sequence[str] = ()
) -> None:
    """Print each record as one line of JSON; or all as a table, one record upright, several one to a row.

    Rows leave out the keys in `brief`, and those that are empty in all of them.
    """
    if as_json:
        for record in records:
            print(json_line(record), flush=True)
        return
    if len(records) == 1:
        rows = [[*_heading(key), _text(key, value)] for key, value in records[0].items()]
        table(title, ["", "unit", "value"], [[name, value, unit] for name, unit, value in rows])
    elif records:
        filled = {key for record in records for key, value in record.items() if value not in (None, "")}
        keys = [key for key in records[0] if key in filled and key not in brief]
        table(title, _heads(keys), [[_text(key, record.get(key), 4) for key in keys] for record in records])


def stream(
    records: Iterable[Mapping[str, Any]],
    *,
    as_json: bool,
    title: str,
    keys: Sequence[str],
    count: int,
    brief: Sequence[str] = (),
) -> list[dict[str, Any]]:
    """Print each record as soon as it is there, and return them all.

    Parameters
    ----------
    keys : of the columns of a table.
    count : how many records are expected; a single one is printed upright, without the keys in `brief`.
    """
    printed: list[dict[str, Any]] = []
    widths: list[int] = []
    for record in records:
        if as_json or count == 1:
            shown = {key: value for key, value in record.items() if as_json or key not in brief}
            report([shown], as_json=as_json, title=title)
        else:
            first = not printed
            widths = widths or [_width(key, record.get(key)) for key in keys]
            cells = [_text(key, record.get(key), 4) for key in keys]
            _print_table(title if first else "", _heads(keys), [cells], widths=widths, headed=first, edged=False)
        printed.append(dict(record))
    return printed


def remarks(records: Sequence[Mapping[str, Any]], keys: Iterable[str]) -> list[str]:
    """Each message of the records once, with the records that it belongs to, told apart by those keys that vary.

    >>> remarks([{"depth_mm": 1.0}, {"depth_mm": 2.0, "message": "gives way"}], ["depth_mm"])
    ['depth 2 mm: gives way']
    """
    there = [key for key in keys if any(key in record for record in records)]
    varying = [key for key in there if len({record.get(key) for record in records}) > 1] or there[:1]
    places: dict[str, list[Mapping[str, Any]]] = {}
    for record in records:
        if record.get("message"):
            places.setdefault(record["message"], []).append(record)
    return [f"{_places(found, varying)}: {message}" for message, found in places.items()]


def _places(records: Sequence[Mapping[str, Any]], keys: Sequence[str]) -> str:
    """The first few of the records by their keys."""
    heads = [_heading(key) for key in keys]
    cells = [[_text(key, record.get(key), 4) for key in keys] for record in records[:MOST_NAMED]]
    more = f" and {len(records) - MOST_NAMED} more" if len(records) > MOST_NAMED else ""
    if len(keys) == 1:
        ((name, unit),) = heads
        return f"{name} {', '.join(cell for (cell,) in cells)} {unit}{more}"
    each = [[f"{n} {text} {unit}".strip() for (n, unit), text in zip(heads, row, strict=True)] for row in cells]
    return "; ".join(", ".join(parts) for parts in each) + more


def table(title: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table; the heads ["", "unit", "value"] stand for name, value and unit side by side."""
    headed = list(heads) != ["", "unit", "value"]
    _print_table(title, heads, rows, widths=[None] * len(heads), headed=headed, edged=True)


def _print_table(
    title: str,
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    widths: Sequence[int | None],
    headed: bool,
    edged: bool,
) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    shown = Table(title=title or None, box=box.SIMPLE, show_header=headed, show_edge=edged, title_justify="left")
    words = [" ".join(cells).split() for cells in zip(heads, *rows, strict=True)]
    # a cell may be broken between numbers, not within one
    least = [
        width or min(max(map(len, found), default=1), 2 * NUMBER) for width, found in zip(widths, words, strict=True)
    ]
    for head, width, narrowest in zip(heads, widths, least, strict=True):
        shown.add_column(head, overflow="fold", width=width, min_width=narrowest)
    for row in rows:
        shown.add_row(*map(Text, row))
    terminal = sys.stdout.isatty()
    space = shutil.get_terminal_size().columns if terminal else WIDTH
    text = io.StringIO()
    # columns are not squeezed further: a narrow terminal wraps their rows
    space = max(space, sum(width + 3 for width in least))
    Console(file=text, width=space, force_terminal=terminal, highlight=False).print(shown)
    # a bar on standard error moves aside for what is printed, not for what a console writes
    print(text.getvalue(), end="", flush=True)


def _width(key: str, value: Any) -> int:
    """Columns that a key's values take in rows that are printed one by one."""
    return 13 if key == "status" else 26 if isinstance(value, (list, tuple)) else NUMBER


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
        task = bar.add_task("", total=1.0)
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


def _heads(keys: Iterable[str]) -> list[str]:
    """Names of columns with their units."""
    return [f"{name} ({unit})" if unit else name for name, unit in map(_heading, keys)]


def _heading(key: str) -> tuple[str, str]:
    """What a key names, and the unit its values are shown in.

    >>> _heading("stiffness_N_per_mm"), _heading("shift_per_mm"), _heading("depth_mm")
    (('stiffness', 'N/mm'), ('shift', 'mm/mm'), ('depth', 'mm'))
    """
    if key in TURNS:
        return TURNS[key], UNITS["rad"][0]
    name, _, last = key.rpartition("_")
    if name.endswith("_per"):
        above, unit = _heading(name.removesuffix("_per"))
        return above, f"{unit or last}/{last}"
    if name and last in UNITS:
        return name.replace("_", " "), UNITS[last][0]
    return key.replace("_", " "), ""


def _text(key: str, value: Any, digits: int = 5) -> str:
    factor = UNITS.get(key.rpartition("_")[2], ("", 1.0))[1]
    if isinstance(value, (list, tuple)):
        return ", ".join(_text(key, item, digits) for item in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float) and value == value:
        return f"{factor * value + 0.0:.{digits}g}"
    return "-" if value is None or value == "" or value != value else str(value)


@contextlib.contextmanager
def unbroken() -> Iterator[None]:
    """Ctrl-C takes effect only afterwards: a library that is being loaded would fail with an error of its own."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if came:
        raise KeyboardInterrupt
