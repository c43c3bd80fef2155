"""A lock on a file or a folder, so that only one process writes at a time.

The operating system locks a small hidden file, which names the process that holds the lock. It releases the lock when
that process ends for whatever reason, so a lock file that a killed process has left locks nothing. On a file system
without locks every process may write.
"""

from __future__ import annotations

import contextlib
import os
import platform
import sys
from collections.abc import Iterator
from pathlib import Path

LOCKED_BYTE = 1 << 20
"""Position of the byte that Windows locks: far beyond the text, which other processes must be able to read."""


class Held(Exception):
    """Another process, or another part of this one, holds the lock; `owner` names it as far as it is known."""

    def __init__(self, owner: str) -> None:
        super().__init__(owner)
        self.owner = owner


@contextlib.contextmanager
def only(file: Path) -> Iterator[None]:
    """Hold the lock of this lock file; the file is deleted afterwards.

    Raises
    ------
    Held
        Another process holds the lock.
    OSError
        The lock file cannot be made.
    """
    handle = _locked_handle(file)
    try:
        os.ftruncate(handle, 0)
        os.write(handle, f"{os.getpid()} {platform.node()}".encode())
        yield
    finally:
        _release(file, handle)


def _locked_handle(file: Path) -> int:
    """Open the lock file and lock it; return its handle."""
    while True:
        handle = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            if not _try_lock(handle):
                raise Held(_owner(file))
            # the last owner may have deleted the file between opening and locking: then other processes would lock
            # a new file of this name, so open again
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
    with contextlib.suppress(OSError, ValueError):
        process, _, machine = file.read_text("utf-8").partition(" ")
        if process.isdecimal():
            return f"process {process}" + (f" on {machine}" if machine != platform.node() else "")
    return "another process"


if sys.platform == "win32":
    import msvcrt

    def _try_lock(handle: int) -> bool:
        os.lseek(handle, LOCKED_BYTE, os.SEEK_SET)
        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except PermissionError:
            return False
        finally:
            os.lseek(handle, 0, os.SEEK_SET)
        return True

    def _release(file: Path, handle: int) -> None:
        # Windows deletes no open file; if another process has opened this one meanwhile, that process deletes it
        os.close(handle)
        with contextlib.suppress(OSError):
            file.unlink()

else:
    import fcntl

    def _try_lock(handle: int) -> bool:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:
            return True  # the file system has no locks
        return True

    def _release(file: Path, handle: int) -> None:
        # delete the file while the lock is held: later it could already be the lock file of the next process
        with contextlib.suppress(OSError):
            file.unlink()
        os.close(handle)
