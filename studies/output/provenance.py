"""The record of the run that filled a folder: command, versions and design, for programs and `magtip report`.

Pages of results say the same in a sentence (`made`); a folder of tables has only this file.
"""

from __future__ import annotations

import datetime
import functools
import os
import platform
import subprocess
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

from geometry.design import BadInput
from studies.output import atomic_files
from studies.output.bounded_files import json_object
from studies.output.literals import as_code

NAME = "run.json"
"""Name of the file in a folder."""
FORMAT = 1
"""Version of the file; a folder with a newer one is refused."""


class Newer(BadInput):
    """A file of a newer format than this version reads."""


@dataclass(frozen=True, slots=True)
class Run:
    """What made a folder.

    command : command line; empty if a Python function was called.
    made : the sentence with command, versions and commit.
    design : fields of the design; empty if there is no single one.
    sweep : which columns of a sweep's table are axes and which are those of its models; empty for other runs.
    """

    command: str
    made: str
    design: Mapping[str, Any]
    sweep: Mapping[str, Any] = field(default_factory=dict)


def write(
    folder: Path, command: str, design: Mapping[str, Any], origin: str = "", sweep: Mapping[str, Any] = {}
) -> None:
    """Write the record of a run into its folder.

    `origin`: text from `versions`; default: the present one; `sweep`: as in `Run`.
    """
    sentence = made(command, origin or versions())
    record = {"format": FORMAT, "command": command, "made": sentence, "design": dict(design)}
    record |= {"sweep": dict(sweep)} if sweep else {}
    atomic_files.write_json(folder / NAME, record)


def read(file: Path) -> Run:
    """Read a record; one of a newer format raises `Newer`, and what is no record of a run BadInput."""
    try:
        record = json_object(file)
        check_format(file, record)
        return Run(str(record["command"]), str(record["made"]), dict(record["design"]), dict(record.get("sweep", {})))
    except Newer:
        raise
    except (BadInput, KeyError, TypeError, ValueError):  # dict() of what is none is a TypeError or a ValueError
        raise BadInput(f"{file.name} is no record of a run of magtip") from None


def check_format(file: Path, record: Mapping[str, Any]) -> None:
    """Raise `Newer` for a JSON object whose `format`, or `version`, is above `FORMAT`."""
    number = record.get("format", record.get("version", FORMAT))
    if isinstance(number, (int, float)) and number > FORMAT:
        raise Newer(
            f"{str(file)!r} has format {number:g}, and magtip {installed(OWN) or ''} reads formats up to {FORMAT}: "
            "use the version of magtip that wrote it, or a newer one"
        )


# Origin of a result


ROOT = Path(__file__).resolve().parents[2]
"""The folder that holds the packages."""
OWN = "magtip"
PACKAGES = ("numpy", "scipy", "scikit-fem", "pytetwild")
"""Packages on which the results of finite elements depend."""
SOURCE = ("geometry", "fem", "analytic", "studies", "magtip", "pyproject.toml", "constraints.txt")
"""Files that determine results; changes in other files, such as earlier results, do not make a commit dirty."""


def versions(more: Sequence[str] = ()) -> str:
    """State the versions of Python, magtip, `PACKAGES` and `more` packages that are installed, and the commit."""
    named = ", ".join(f"{name} {number}" for name, number in packages(more).items())
    at = commit()
    return f"on Python {platform.python_version()} with {named}{f' at commit {at}' if at else ''}"


def packages(more: Sequence[str] = ()) -> dict[str, str]:
    """Return the versions of magtip, `PACKAGES` and `more` packages, those that are installed."""
    numbers = {name: installed(name) for name in (OWN, *PACKAGES, *more)}
    return {name: number for name, number in numbers.items() if number}


def made(command: str, origin: str) -> str:
    """Return the last sentence of a page of results, which states its origin.

    Parameters
    ----------
    command : command line from `studies.cli.parameters.command`; empty if a Python function was called.
    origin : text from `versions`, obtained before the results change a file of the repository.

    >>> made("magtip validate verify --quick", "on Python 3.12"), made("", "on Python 3.12")
    ('Made with `magtip validate verify --quick`, on Python 3.12.', 'Made on Python 3.12.')
    """
    return f"Made with {as_code(command)}, {origin}." if command else f"Made {origin}."


def origin_in(page: str) -> str:
    """Return the last paragraph of a page of results if it is the sentence of `made`, else an empty text.

    >>> origin_in("# Title\\n\\n" + made("magtip validate verify", "on Python 3.12") + "\\n")
    'Made with `magtip validate verify`, on Python 3.12.'
    """
    last = page.rstrip().rpartition("\n\n")[2]
    return " ".join(last.split()) if last.startswith(("Made with `", "Made on Python ")) else ""


@functools.cache
def installed(name: str) -> str | None:
    """Return the version of a package, None if it is not installed."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def today() -> datetime.date:
    """Return today's date, or that of SOURCE_DATE_EPOCH, by which a build is repeated to the byte."""
    seconds = os.environ.get("SOURCE_DATE_EPOCH")
    if seconds and not seconds.isdecimal():
        raise BadInput(f"SOURCE_DATE_EPOCH must be a whole number of seconds; got {seconds!r}: set another, or none")
    return datetime.datetime.fromtimestamp(int(seconds), datetime.UTC).date() if seconds else datetime.date.today()


def commit() -> str | None:
    """Return the commit of this source, with "-dirty" if `SOURCE` has changed since; None outside its repository.

    An installed copy may lie inside the repository of another project, whose commit does not describe this code. So
    three conditions must hold: `ROOT` is the top of the repository, its pyproject.toml names magtip, and git tracks
    this file.
    """
    top = _git(ROOT, "rev-parse", "--show-toplevel")
    if top is None or Path(top).resolve() != ROOT or _project(ROOT) != OWN:
        return None
    if _git(ROOT, "ls-files", "--error-unmatch", str(Path(__file__).resolve())) is None:
        return None
    head = _git(ROOT, "rev-parse", "--short", "HEAD")
    changed = _git(ROOT, "status", "--porcelain", "--untracked-files=no", "--", *SOURCE)
    return f"{head}-dirty" if head and changed else head


def _project(root: Path) -> str | None:
    try:
        with (root / "pyproject.toml").open("rb") as file:
            return str(tomllib.load(file)["project"]["name"])
    except (OSError, KeyError, tomllib.TOMLDecodeError):
        return None


def _git(folder: Path, *words: str) -> str | None:
    try:
        process = subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, timeout=20, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return process.stdout.strip()
