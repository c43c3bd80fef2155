"""Meshes kept on disk by what they were made from, so that nobody waits for the same one twice.

The folder is the platform's own for caches (on Linux `$XDG_CACHE_HOME/magtip`, mostly `~/.cache/magtip`), or what the
environment variable MAGTIP_CACHE names; `MAGTIP_CACHE=off` keeps nothing. MAGTIP_CACHE_MB limits its size: beyond it
the files that were not used for longest go.

A file is one line with the SHA-256 of the rest, and the rest is an .npz archive without pickles. It is written under
another name and renamed, so any number of processes may read, write and clear at once; of two that make the same mesh
the last one stays. A file that does not match its checksum is removed and said to be. Whatever else goes wrong here
(no right to write, disk full) is said once, and meshes are made as if there were no cache.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import math
import os
import tempfile
import time
import zipfile
from collections.abc import Iterator, Mapping
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs
from numpy.typing import NDArray

from geometry.design import BadInput
from geometry.messages import warn_once

Arrays = dict[str, NDArray[Any]]

VARIABLE, LIMIT_VARIABLE = "MAGTIP_CACHE", "MAGTIP_CACHE_MB"
OFF = "off"
LIMIT_MB = 1000.0
MOST = 2.0**63
"""Of all limits, bytes: more than any disk has."""
SUFFIX = ".mesh"
FORGOTTEN_S = 3600.0
"""Age of a temporary file whose process must have died."""

_bypassed: ContextVar[bool] = ContextVar("bypassed", default=False)


@dataclass(frozen=True, slots=True)
class Contents:
    """What the cache holds: its folder (None if it is off), number of files, their size and its limit in bytes."""

    folder: Path | None
    files: int
    size: int
    limit: int


@contextlib.contextmanager
def bypassed() -> Iterator[None]:
    """Neither read nor write the cache meanwhile: for whoever measures meshing or the noise of meshes."""
    token = _bypassed.set(True)
    try:
        yield
    finally:
        _bypassed.reset(token)


def folder() -> Path | None:
    """Where the files are, or None if the cache is off. Need not exist."""
    chosen = os.environ.get(VARIABLE, "")
    if _bypassed.get() or chosen.lower() == OFF:
        return None
    return Path(chosen) if chosen else platformdirs.user_cache_path("magtip", appauthor=False)


def limit() -> int:
    """Most bytes that the files may take together.

    Raises
    ------
    BadInput
        MAGTIP_CACHE_MB is not a number of 0 or more.
    """
    text = os.environ.get(LIMIT_VARIABLE, "")
    try:
        size = float(text) if text else LIMIT_MB
    except ValueError:
        size = math.nan
    if not 0 <= size < math.inf:
        raise BadInput(f"{LIMIT_VARIABLE} must be a finite size in MB, 0 or more; got {text!r}")
    return int(min(1e6 * size, MOST))


def key(**parts: Any) -> str:
    """A name for what is made from these parts, numbers, texts and lists of them.

    >>> key(size=0.1, half=True) == key(half=True, size=0.1) != key(half=True, size=0.2)
    True
    """
    return hashlib.sha256(json.dumps(parts, sort_keys=True, allow_nan=False).encode()).hexdigest()[:40]


def load(name: str) -> Arrays | None:
    """The arrays stored under a name, or None. Also refuses a bad limit, which `store` would find too late."""
    place = folder()
    if place is None:
        return None
    limit()
    file = place / f"{name}{SUFFIX}"
    try:
        content = file.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        if file.is_dir():
            _put_aside(file)
            return None
        warn_once(f"cannot read the mesh cache {str(place)!r} ({error.strerror})")
        return None
    arrays = _opened(content)
    if arrays is None:
        warn_once(f"the cached mesh {str(file)!r} is damaged: it is deleted and the mesh is made again")
        with contextlib.suppress(OSError):
            file.unlink()
        return None
    with contextlib.suppress(OSError):
        os.utime(file)  # its turn to go comes last
    return arrays


def store(name: str, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Keep arrays under a name, and let old files go beyond the limit."""
    place = folder()
    if place is None:
        return
    archive = io.BytesIO()
    np.savez(archive, allow_pickle=False, **arrays)
    content = archive.getvalue()
    content = hashlib.sha256(content).hexdigest().encode() + b"\n" + content
    most = limit()
    if len(content) > most:
        return
    try:
        place.mkdir(parents=True, exist_ok=True)
        _prune(place, most - len(content))
        _write(place, f"{name}{SUFFIX}", content)
    except OSError as error:
        cause = error.strerror or str(error)
        warn_once(
            f"cannot write to the mesh cache {str(place)!r} ({cause}); set {VARIABLE} to another folder, or to {OFF}"
        )


def contents() -> Contents:
    """What there is."""
    place = folder()
    found = [] if place is None else _files(place)
    return Contents(place, len(found), sum(size for _, size, _ in found), limit())


def clear() -> Contents:
    """Remove all files, and tell what is left."""
    place = folder()
    if place is not None:
        for file, _, _ in _files(place):
            file.unlink(missing_ok=True)
        _forget(place, 0.0)
    return contents()


def _opened(content: bytes) -> Arrays | None:
    """The arrays in a file, or None if it is not what was written."""
    checksum, _, archive = content.partition(b"\n")
    if hashlib.sha256(archive).hexdigest().encode() != checksum:
        return None
    try:
        with np.load(io.BytesIO(archive), allow_pickle=False) as arrays:
            return dict(arrays)
    except (ValueError, OSError, zipfile.BadZipFile):
        return None


def _put_aside(file: Path) -> None:
    """Rename a folder that stands in the place of a file; it is not removed, for it may hold somebody's files."""
    other = file.with_name(f"{file.stem}-{time.time_ns()}.folder")
    try:
        file.rename(other)
    except OSError as error:
        warn_once(f"the cached mesh {str(file)!r} is a folder, not a file ({error.strerror}): move it elsewhere")
        return
    warn_once(f"the cached mesh {str(file)!r} was a folder, not a file: it is renamed to {other.name!r}")


def _write(place: Path, name: str, content: bytes) -> None:
    handle, temporary = tempfile.mkstemp(prefix=".writing-", dir=place)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.replace(temporary, place / name)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise


def _files(place: Path) -> list[tuple[Path, int, float]]:
    """The files with their sizes and times of last use, the oldest first."""
    found = []
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        for entry in os.scandir(place):
            if entry.name.endswith(SUFFIX):
                with contextlib.suppress(FileNotFoundError):  # another process may have removed it
                    state = entry.stat()
                    if not entry.is_dir():
                        found.append((Path(entry.path), state.st_size, state.st_mtime))
    return sorted(found, key=lambda one: one[2])


def _prune(place: Path, most: int) -> None:
    """Remove the files that were not used for longest until the rest fits, and what dead processes left."""
    _forget(place, FORGOTTEN_S)
    files = _files(place)
    size = sum(one[1] for one in files)
    for file, own, _ in files:
        if size <= most:
            return
        file.unlink(missing_ok=True)
        size -= own


def _forget(place: Path, age: float) -> None:
    """Remove temporary files of at least an age in seconds."""
    for file in place.glob(".writing-*"):
        with contextlib.suppress(OSError):
            if time.time() - file.stat().st_mtime >= age:
                file.unlink()
