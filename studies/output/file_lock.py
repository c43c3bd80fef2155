"""A lock on a file or a folder, so that of several processes one writes at a time.

The lock is the operating system's, on a small hidden file that names the process: it ends with the process, whatever
ends that, and a file that a killed process has left binds nobody. On a file system without locks nobody is refused.
"""

from __future__ import annotations

import contextlib
import os
import platform
import sys
from collections.abc import Iterator
from pathlib import Path

FAR = 1 << 20
"""Where Windows locks a byte: beyond the text, which others must be able to read."""


class Held(Exception):
    """Another process, or another part of this one, has the lock; `owner` says which, as far as it is known."""

    def __init__(self, owner: str) -> None:
        super().__init__(owner)
        self.owner = owner


@contextlib.contextmanager
def only(file: Path) -> Iterator[None]:
    """Hold the lock whose file this is; the file is removed afterwards.

    Raises
    ------
    Held
        It is taken.
    OSError
        The file cannot be made.
    """
    handle = _opened(file)
    try:
        os.ftruncate(handle, 0)
        os.write(handle, f"{os.getpid()} {platform.node()}".encode())
        yield
    finally:
        _released(file, handle)


def _opened(file: Path) -> int:
    """A handle of the lock's file, locked."""
    while True:
        handle = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            if not _locked(handle):
                raise Held(_owner(file))
            # who had it before may have removed the file after it was opened here: then this lock binds nobody
            if _same(file, handle):
                return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)


def _same(file: Path, handle: int) -> bool:
    try:
        return os.path.samestat(os.stat(file), os.fstat(handle))
    except FileNotFoundError:
        return False


def _owner(file: Path) -> str:
    """Who wrote the file."""
    with contextlib.suppress(OSError, ValueError):
        process, _, machine = file.read_text("utf-8").partition(" ")
        if process.isdecimal():
            return f"process {process}" + (f" on {machine}" if machine != platform.node() else "")
    return "another process"


if sys.platform == "win32":
    import msvcrt

    def _locked(handle: int) -> bool:
        os.lseek(handle, FAR, os.SEEK_SET)
        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except PermissionError:
            return False
        finally:
            os.lseek(handle, 0, os.SEEK_SET)
        return True

    def _released(file: Path, handle: int) -> None:
        # an open file cannot be removed; where another process has opened it meanwhile, that one removes it
        os.close(handle)
        with contextlib.suppress(OSError):
            file.unlink()

else:
    import fcntl

    def _locked(handle: int) -> bool:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:
            return True  # this file system knows no locks
        return True

    def _released(file: Path, handle: int) -> None:
        # removed while it is held, or the file of the next process would go
        with contextlib.suppress(OSError):
            file.unlink()
        os.close(handle)
