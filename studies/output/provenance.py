"""What made a result: versions of the packages, and the commit of the source where that can be known."""

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
"""That results of finite elements depend on."""
SOURCE = ("geometry", "fem", "analytic", "studies", "pyproject.toml", "constraints.txt")
"""What results follow from: changes elsewhere, as in the results that were written before, do not count."""


def versions(more: Sequence[str] = ()) -> str:
    """Python, magtip, PACKAGES and more packages with their versions, as far as installed, and the commit."""
    found = [(name, installed(name)) for name in (OWN, *PACKAGES, *more)]
    named = ", ".join(f"{name} {number}" for name, number in found if number)
    at = commit()
    return f"on Python {platform.python_version()} with {named}{f' at commit {at}' if at else ''}"


def made(command: str, origin: str) -> str:
    """The last sentence of a page of results.

    Parameters
    ----------
    command : by `studies.cli.printed_command.command`; empty where Python was asked directly.
    origin : by `versions`, before a file of the repository changes.

    >>> made("magtip verify --quick", "on Python 3.12"), made("", "on Python 3.12")
    ('Made with `magtip verify --quick`, on Python 3.12.', 'Made on Python 3.12.')
    """
    return f"Made with `{command}`, {origin}." if command else f"Made {origin}."


def installed(name: str) -> str | None:
    """The version of an installed package."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def commit() -> str | None:
    """The commit of this source, marked as dirty if it has been changed since; None if it is no checkout of its own.

    An installed copy may lie inside the repository of another project, whose commit says nothing of this code. So git
    must find the folder above this package, it must be the project's, and this file must be tracked there.
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
    """The name in a folder's pyproject.toml."""
    try:
        with (root / "pyproject.toml").open("rb") as file:
            return str(tomllib.load(file)["project"]["name"])
    except (OSError, KeyError, tomllib.TOMLDecodeError):
        return None


def _git(folder: Path, *words: str) -> str | None:
    """What git says of a folder; None where it fails or is not there."""
    try:
        ended = subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, timeout=20, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return ended.stdout.strip()
