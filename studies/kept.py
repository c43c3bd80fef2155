"""Solves that a stopped study need not do again: a line of JSON for each in a file, as soon as it is done.

A line holds a digest of the code that made it, what the solve depends on as text, its states, and a digest of all
that. Lines that are damaged, or that other code or another study made, are not read, and stay.
"""

from __future__ import annotations

import functools
import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from studies.files import json_line

NAME = "solves.jsonl"


@dataclass(frozen=True, slots=True)
class Kept:
    """The solves of a file, and of this run where there is no file; `known` holds what was kept by what it is of."""

    file: Path | None
    known: dict[str, Any] = field(default_factory=dict)

    def keep(self, key: str, states: Any) -> None:
        """Remember a solve, in the file too."""
        self.known[key] = states
        if self.file is not None:
            with self.file.open("a", encoding="utf-8", newline="\n") as file:
                file.write(_line(key, states))


def opened(folder: Path | None) -> Kept:
    """What the present code has left in the folder's file; a last line that was cut short is ended."""
    if folder is None:
        return Kept(None)
    file = folder / NAME
    found = Kept(file)
    if not file.exists():
        return found
    text = file.read_bytes().decode("utf-8", errors="replace")
    for line in text.split("\n"):
        try:
            record = json.loads(line)
            key, states = record["key"], record["states"]
        except (ValueError, TypeError, KeyError):
            continue
        if isinstance(key, str) and f"{line}\n" == _line(key, states):
            found.known[key] = states
    if text and not text.endswith("\n"):
        with file.open("a", encoding="utf-8", newline="\n") as end:
            end.write("\n")
    return found


def _line(key: str, states: Any) -> str:
    record = {"code": code(), "key": key, "states": states}
    return json_line(record | {"digest": _digest(json_line(record).encode())}) + "\n"


@functools.cache
def code() -> str:
    """A digest of all modules that a solve and what is written of it come from."""
    root = Path(__file__).parents[1]
    files = sorted(file for folder in ("geometry", "fem") for file in (root / folder).glob("*.py"))
    files += [root / "studies" / name for name in ("compare.py", "sweep.py")]
    return _digest(b"".join(file.read_bytes() for file in files))


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]
