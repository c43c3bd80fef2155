"""Which files of an output folder were not written by magtip, so that no verb may overwrite them?

Pages and records state their origin. Tables and pictures cannot: they count as written by magtip where a page or a
record beside them does, or where a killed process of magtip has left its lock file.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from geometry.design import BadInput

ORIGIN = re.compile(
    rb"Made (with `magtip |on Python \d)|\"made\": \"on Python \d|"
    rb"^# fitted to |^# Magnetic force sensor, D = |^\| magtip \| |"
    rb"\A[^\n]*(\bAICc\b|\bstatus,message\b)",
    re.MULTILINE,
)
"""What pages, records and fitted designs say of their origin; the tables of a fit and a sweep have such columns."""

RECORD = "run.json"
"""A record of a run, see `studies.output.run_record`."""

LOCK = ".magtip.lock"
"""Name of the lock file in a folder that is being filled, see `studies.output.atomic_files`."""

STATING = ("*.md", "*.json", "design.toml")
"""Files that always state their origin."""

MOST_BYTES = 20_000_000
"""Part of a file that is searched."""


def check(folder: str | Path | None, names: Iterable[str]) -> None:
    """Check that a verb, which writes these files into a folder, overwrites no file of the user.

    Parameters
    ----------
    folder : None for a verb that writes no files.
    names : names of files, or patterns such as "sweep-*.png".

    Raises
    ------
    BadInput
        The folder has a file of these names that magtip did not write.
    """
    if folder is None or not Path(folder).is_dir():
        return
    where = Path(folder)
    files = sorted({file for name in names for file in where.glob(name) if file.is_file()})
    stated = {file: states_origin(file) for file in files}
    known = any(stated.values()) or states_origin(where / RECORD) or (where / LOCK).exists()
    for file, own in stated.items():
        if not own and (not known or any(map(file.match, STATING))):
            raise BadInput(f"{str(file)!r} was not written by magtip and would be overwritten: choose another folder")


def states_origin(file: Path) -> bool:
    """Return whether a file states that magtip wrote it."""
    if file.suffix not in (".md", ".json", ".toml", ".csv"):
        return False
    try:
        with file.open("rb") as stream:
            return ORIGIN.search(stream.read(MOST_BYTES)) is not None
    except OSError:
        return False
