"""Origin of a result: versions of the packages, and the commit of the source where it is known."""

from __future__ import annotations

import platform
import subprocess
import tomllib
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
"""The folder that holds the packages."""
OWN = "magtip"
PACKAGES = ("numpy", "scipy", "scikit-fem", "pytetwild")
"""Packages on which the results of finite elements depend."""
SOURCE = ("geometry", "fem", "analytic", "studies", "pyproject.toml", "constraints.txt")
"""Files that determine results; changes in other files, such as earlier results, do not make a commit dirty."""


def versions(more: Sequence[str] = ()) -> str:
    """State the versions of Python, magtip, `PACKAGES` and `more` packages that are installed, and the commit."""
    numbers = [(name, installed(name)) for name in (OWN, *PACKAGES, *more)]
    named = ", ".join(f"{name} {number}" for name, number in numbers if number)
    at = commit()
    return f"on Python {platform.python_version()} with {named}{f' at commit {at}' if at else ''}"


def made(command: str, origin: str) -> str:
    """Return the last sentence of a page of results, which states its origin.

    Parameters
    ----------
    command : command line from `studies.cli.parameters.command`; empty if a Python function was called.
    origin : text from `versions`, obtained before the results change a file of the repository.

    >>> made("magtip validate verify --quick", "on Python 3.12"), made("", "on Python 3.12")
    ('Made with `magtip validate verify --quick`, on Python 3.12.', 'Made on Python 3.12.')
    """
    return f"Made with `{command}`, {origin}." if command else f"Made {origin}."


def origin_in(page: str) -> str:
    """Return the last paragraph of a page of results if it is the sentence of `made`, else an empty text.

    >>> origin_in("# Title\\n\\n" + made("magtip validate verify", "on Python 3.12") + "\\n")
    'Made with `magtip validate verify`, on Python 3.12.'
    """
    last = page.rstrip().rpartition("\n\n")[2]
    return " ".join(last.split()) if last.startswith(("Made with `", "Made on Python ")) else ""


def installed(name: str) -> str | None:
    """Return the version of a package, None if it is not installed."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


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
    """Run git in a folder and return its output; None if git fails or is not installed."""
    try:
        process = subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, timeout=20, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return process.stdout.strip()
