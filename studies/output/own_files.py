"""Which output files may magtip overwrite? Those that it wrote, if nobody has changed them since.

magtip lists each file that it writes in a hidden file beside it, `LIST`: a line of JSON with the name and the SHA-256
digest of the file, added before the file gets its name, so that a killed process leaves no file unlisted. A file that
is not listed, or has another digest than any that is listed for its name, belongs to the user.

A folder without a list may have been filled by an earlier version, which listed nothing. There a page or a record
that states its origin is magtip's, and so are the tables and pictures beside one.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from geometry.design import BadInput
from studies.output.bounded_files import bytes_of, json_in

LIST = ".magtip.files"
"""Name of the list of the files that magtip wrote into a folder."""
ORIGIN = re.compile(
    rb"Made (with `magtip |on Python \d)|\"made\": \"on Python \d|^# Magnetic force sensor, D = |^\| magtip \| ",
    re.MULTILINE,
)
"""What pages and records of earlier versions say of their origin."""
RECORD = "run.json"
"""A record of a run, see `studies.output.provenance`."""
STATING = ("*.md", "*.json", "design.toml")
"""Files that count as those of an earlier version only if they state their origin; a design states none."""
MOST_BYTES = 20_000_000
"""Part of a file that is searched."""


def note(folder: Path, files: Mapping[str, Path]) -> None:
    """List files that are about to get their names in a folder; hidden files are not listed.

    `files`: for each name the file that will have it.
    """
    listed = _listed(folder) or {}
    entries = {name: _digest(file) for name, file in files.items() if not name.startswith(".")}
    new = {name: digest for name, digest in entries.items() if digest not in listed.get(name, ())}
    if new:
        lines = [json.dumps({"file": name, "sha256": digest}) + "\n" for name, digest in new.items()]
        with (folder / LIST).open("a+b") as stream:
            # the list of a killed process may end within a line
            stream.seek(0)
            end = stream.read()[-1:]
            stream.write(("" if end in (b"", b"\n") else "\n").encode() + "".join(lines).encode())


def check(folder: str | Path | None, names: Iterable[str]) -> None:
    """Check that a verb, which writes these files into a folder, overwrites no file of the user.

    Parameters
    ----------
    folder : None for a verb that writes no files.
    names : names of files, or patterns such as "sweep-*.png".
    """
    if folder is None or not Path(folder).is_dir():
        return
    where = Path(folder)
    found = sorted({file for name in names for file in where.glob(name)})
    if folders := [file for file in found if file.is_dir()]:
        raise BadInput(
            f"{str(folders[0])!r} is a folder, in the place of a file that is to be written: choose another "
            "folder, or move it away"
        )
    files = [file for file in found if file.is_file()]
    # each folder below has its own list
    listed = {place: _listed(place) for place in {file.parent for file in files}}
    unlisted = [file for file in files if listed[file.parent] is None]
    for file in files:
        entries = listed[file.parent]
        if entries is not None:
            _check_listed(file, entries, "another folder")
    stated = {file: states_origin(file) for file in unlisted}
    known = any(stated.values()) or states_origin(where / RECORD)
    for file, own in stated.items():
        if not own and (not known or any(map(file.match, STATING))):
            raise _refusal(file, "was not written by magtip", "another folder")


def check_file(file: Path) -> None:
    """Check that a verb, which writes this file, overwrites no file of the user."""
    if file.is_file():
        _check_listed(file, _listed(file.parent) or {}, "another name")


def remove_empty(folder: Path) -> None:
    """Remove a folder in which magtip has removed its files; one that holds anything else stays."""
    with contextlib.suppress(OSError):
        if [file.name for file in folder.iterdir()] == [LIST]:
            (folder / LIST).unlink()
        folder.rmdir()


def states_origin(file: Path) -> bool:
    """Return whether a page or a record states that magtip wrote it."""
    if file.suffix not in (".md", ".json"):
        return False
    try:
        with file.open("rb") as stream:
            return ORIGIN.search(stream.read(MOST_BYTES)) is not None
    except OSError:
        return False


def _check_listed(file: Path, listed: Mapping[str, set[str]], other: str) -> None:
    if file.name not in listed:
        raise _refusal(file, "was not written by magtip", other)
    if _digest(file) not in listed[file.name]:
        raise _refusal(file, "was changed after magtip had written it", other)


def _refusal(file: Path, reason: str, other: str) -> BadInput:
    return BadInput(f"{str(file)!r} {reason} and would be overwritten: choose {other}, or move the file away")


def _listed(folder: Path) -> dict[str, set[str]] | None:
    try:
        lines = bytes_of(folder / LIST).splitlines()
    except FileNotFoundError:
        return None
    digests: dict[str, set[str]] = {}
    for line in lines:
        # a line that a killed process has not finished lists nothing
        with contextlib.suppress(BadInput, TypeError, KeyError):
            entry = json_in(line)
            digests.setdefault(str(entry["file"]), set()).add(str(entry["sha256"]))
    return digests


def _digest(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
