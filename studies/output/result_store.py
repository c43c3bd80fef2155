"""Answers that a stopped study need not find again: a line of JSON for each in a file, as soon as it is there.

A line holds a digest of the code that found the answer, its key (all that it depends on, as text), the answer, and a
digest of all that. Lines that are damaged, or that other code or another study made, are not read, and stay.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from studies.output.atomic_files import json_line
from studies.output.provenance import ROOT


@dataclass(frozen=True, slots=True)
class Kept:
    """The answers in a file that some code found, and of this run where there is no file; `known` has them by key."""

    file: Path | None
    code: str
    known: dict[str, Any] = field(default_factory=dict)

    def keep(self, key: str, answer: Any) -> None:
        """Remember an answer, in the file too."""
        self.known[key] = answer
        if self.file is not None:
            with self.file.open("a", encoding="utf-8", newline="\n") as file:
                file.write(_line(self.code, key, answer))


def opened(file: Path | None, code: str) -> Kept:
    """What the code has left in a file, which need not exist; a last line that was cut short is ended."""
    found = Kept(file, code)
    if file is None or not file.exists():
        return found
    text = file.read_bytes().decode("utf-8", errors="replace")
    for line in text.split("\n"):
        try:
            record = json.loads(line)
            key, answer = record["key"], record["answer"]
        except (ValueError, TypeError, KeyError):
            continue
        if isinstance(key, str) and f"{line}\n" == _line(code, key, answer):
            found.known[key] = answer
    if text and not text.endswith("\n"):
        with file.open("a", encoding="utf-8", newline="\n") as end:
            end.write("\n")
    return found


def digest(files: Iterable[Path]) -> str:
    """Of the code in some files."""
    return _digest(b"".join(file.read_bytes() for file in files))


def modules(*packages: str, apart: Iterable[str] = ()) -> list[Path]:
    """The files of whole packages with their sub-packages; those of the paths in the project `apart` are left out."""
    left_out = {ROOT / name for name in apart}
    return sorted(file for package in packages for file in (ROOT / package).rglob("*.py") if file not in left_out)


def _line(code: str, key: str, answer: Any) -> str:
    record = {"code": code, "key": key, "answer": answer}
    return json_line(record | {"digest": _digest(json_line(record).encode())}) + "\n"


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]
