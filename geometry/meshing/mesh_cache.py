"""The cache of meshes on disk: a mesh that was made once is read again, not made again.

The environment variable MAGTIP_CACHE names the folder; default: the platform's folder for caches (on Linux
`$XDG_CACHE_HOME/magtip`, usually `~/.cache/magtip`). `MAGTIP_CACHE=off` disables the cache. MAGTIP_CACHE_MB limits
its size: above the limit, the least recently used files are deleted.

A file holds one line with the SHA-256 of the rest, then an .npz archive without pickles. It is written under a
temporary name and renamed, so any number of processes may read, write and clear at the same time. If two processes
make the same mesh, the file of the later one remains. A file that does not match its checksum is deleted, with a
warning. All other errors (no permission, full disk) cause one warning, and meshes are made without the cache.
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
"""Default of the limit, MB (10^6 bytes)."""
MOST = 2.0**63
"""Largest limit, bytes: more than any disk has, and still an exact integer."""
SUFFIX = ".mesh"
FORGOTTEN_S = 3600.0
"""Age of a temporary file, s, beyond which its process must have died: writing a mesh takes seconds."""

_bypassed: ContextVar[bool] = ContextVar("bypassed", default=False)


@dataclass(frozen=True, slots=True)
class Contents:
    """The contents of the cache.

    Attributes
    ----------
    folder : folder of the files; None if the cache is off.
    files : number of files.
    size, limit : total size of the files and its limit, bytes.
    """

    folder: Path | None
    files: int
    size: int
    limit: int


@contextlib.contextmanager
def bypassed() -> Iterator[None]:
    """Disable the cache within a `with` block, in order to measure the time of meshing or the scatter of meshes."""
    token = _bypassed.set(True)
    try:
        yield
    finally:
        _bypassed.reset(token)


def folder() -> Path | None:
    """Return the folder of the files, which need not exist; None if the cache is off."""
    chosen = os.environ.get(VARIABLE, "")
    if _bypassed.get() or chosen.lower() == OFF:
        return None
    return Path(chosen) if chosen else platformdirs.user_cache_path("magtip", appauthor=False)


def limit() -> int:
    """Return the limit of the total size of all files, bytes.

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
    """Return the name of a mesh: a hash of all that determines it, given as numbers, texts and lists of them.

    >>> key(size=0.1, half=True) == key(half=True, size=0.1) != key(half=True, size=0.2)
    True
    """
    return hashlib.sha256(json.dumps(parts, sort_keys=True, allow_nan=False).encode()).hexdigest()[:40]


def load(name: str) -> Arrays | None:
    """Return the arrays stored under a name, or None if there are none."""
    place = folder()
    if place is None:
        return None
    limit()  # raises BadInput for a bad limit now: `store` would raise it only after the mesh is made
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
        os.utime(file)  # marks the file as the most recently used
    return arrays


def store(name: str, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Store arrays under a name; delete the least recently used files if the limit would be exceeded."""
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
    """Return the contents of the cache."""
    place = folder()
    files = [] if place is None else _files(place)
    return Contents(place, len(files), sum(size for _, size, _ in files), limit())


def clear() -> Contents:
    """Delete all files of the cache and return its contents afterwards."""
    place = folder()
    if place is not None:
        for file, _, _ in _files(place):
            file.unlink(missing_ok=True)
        _forget(place, 0.0)
    return contents()


def _opened(content: bytes) -> Arrays | None:
    """Return the arrays in the content of a file; None if it is damaged."""
    checksum, _, archive = content.partition(b"\n")
    if hashlib.sha256(archive).hexdigest().encode() != checksum:
        return None
    try:
        with np.load(io.BytesIO(archive), allow_pickle=False) as arrays:
            return dict(arrays)
    except (ValueError, OSError, zipfile.BadZipFile):
        return None


def _put_aside(file: Path) -> None:
    """Rename a folder that has the name of a file of the cache; it is not deleted, as it may hold a user's files."""
    other = file.with_name(f"{file.stem}-{time.time_ns()}.folder")
    try:
        file.rename(other)
    except OSError as error:
        warn_once(f"the cached mesh {str(file)!r} is a folder, not a file ({error.strerror}): move it elsewhere")
        return
    warn_once(f"the cached mesh {str(file)!r} was a folder, not a file: it is renamed to {other.name!r}")


def _write(place: Path, name: str, content: bytes) -> None:
    """Write a file under a temporary name and rename it, so that no process ever reads half a file."""
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
    """Return the files with their sizes, bytes, and times of last use, s; the least recently used first."""
    files = []
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        for entry in os.scandir(place):
            if entry.name.endswith(SUFFIX):
                with contextlib.suppress(FileNotFoundError):  # another process may have removed it
                    state = entry.stat()
                    if not entry.is_dir():
                        files.append((Path(entry.path), state.st_size, state.st_mtime))
    return sorted(files, key=lambda file: file[2])


def _prune(place: Path, most: int) -> None:
    """Delete temporary files of dead processes, then the least recently used files until `most` bytes remain."""
    _forget(place, FORGOTTEN_S)
    files = _files(place)
    total = sum(size for _, size, _ in files)
    for file, size, _ in files:
        if total <= most:
            return
        file.unlink(missing_ok=True)
        total -= size


def _forget(place: Path, age: float) -> None:
    """Delete temporary files that are at least `age` seconds old."""
    for file in place.glob(".writing-*"):
        with contextlib.suppress(OSError):
            if time.time() - file.stat().st_mtime >= age:
                file.unlink()
