"""Results that a stopped study need not compute again: a JSON line for each, written as soon as it is computed.

A line holds a digest of the code that computed the result, its key (a text of everything that it depends on), the
commit, the result, and a digest of these. Lines that are damaged, or that other code or another study has written,
are ignored and stay in the file. Pages name the commits of their results: a commit may change nothing that a result
depends on, so that a run at another commit may continue.
"""

from __future__ import annotations

import functools
import hashlib
import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from studies.output import provenance
from studies.output.atomic_files import json_line
from studies.output.provenance import ROOT


@dataclass(frozen=True, slots=True)
class StoredResults:
    """Results of one version of the code, from a file and from this run.

    Attributes
    ----------
    file : JSON lines; None keeps the results of this run in memory only.
    code : digest of the code.
    known, commits : results by their keys, and the commits that computed them.
    """

    file: Path | None
    code: str
    known: dict[str, Any] = field(default_factory=dict)
    commits: dict[str, str] = field(default_factory=dict)

    def keep(self, key: str, answer: Any) -> None:
        """Add a result, also to the file."""
        self.known[key], self.commits[key] = answer, commit()
        if self.file is not None:
            with self.file.open("a", encoding="utf-8", newline="\n") as file:
                file.write(_line(self.code, key, self.commits[key], answer))

    def commits_of(self, keys: Iterable[str]) -> str:
        """Return the commits of some results, with a hyphen between different ones; "" if there is no result."""
        return " - ".join(sorted({self.commits[key] for key in keys if key in self.commits}))


def opened(file: Path | None, code: str) -> StoredResults:
    """Read the results of this code from a file, which need not exist.

    An incomplete last line gets its line end, so that the next result begins a new line.
    """
    stored = StoredResults(file, code)
    if file is None or not file.exists():
        return stored
    text = file.read_bytes().decode("utf-8", errors="replace")
    for line in text.split("\n"):
        try:
            record = json.loads(line)
            key, commit, answer = record["key"], record["commit"], record["answer"]
        except (ValueError, TypeError, KeyError):
            continue
        if isinstance(key, str) and f"{line}\n" == _line(code, key, commit, answer):
            stored.known[key], stored.commits[key] = answer, commit
    if text and not text.endswith("\n"):
        with file.open("a", encoding="utf-8", newline="\n") as end:
            end.write("\n")
    return stored


def solved_at(commits: Iterable[str]) -> str:
    """Return the sentence that names the commits of results, the most frequent one first; "" without results.

    >>> solved_at(["b", "a", "b"]), solved_at(["a"]), solved_at([])
    ('Computed at commits b (2 results), a (1).', 'Computed at commit a.', '')
    """
    counts = Counter(commits).most_common()
    if len(counts) < 2:
        return f"Computed at commit {counts[0][0]}." if counts else ""
    first, *others = (f"{name} ({count}{' results' if i == 0 else ''})" for i, (name, count) in enumerate(counts))
    return f"Computed at commits {', '.join([first, *others])}."


def digest(files: Iterable[Path]) -> str:
    """Return a digest of the code in these files."""
    return _digest(b"".join(file.read_bytes() for file in files))


def modules(*packages: str, apart: Iterable[str] = ()) -> list[Path]:
    """Return all Python files of packages and sub-packages, except the paths `apart` (relative to the project)."""
    left_out = {ROOT / name for name in apart}
    return sorted(file for package in packages for file in (ROOT / package).rglob("*.py") if file not in left_out)


@functools.cache
def commit() -> str:
    """Return the commit of this code, or its version where the commit is not known."""
    return provenance.commit() or f"version {provenance.installed(provenance.OWN)}"


def _line(code: str, key: str, commit: Any, answer: Any) -> str:
    """Return the line of a result; its digest reveals a damaged line."""
    record = {"code": code, "key": key, "commit": commit, "answer": answer}
    return json_line(record | {"digest": _digest(json_line(record).encode())}) + "\n"


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]
