"""Files and folders that are written completely or not at all.

A file is written to a temporary folder beside it and renamed when it is complete. The temporary folder's name states
machine and process, so that the next process that writes there can delete what a killed process has left. Only one
process at a time fills an output folder or writes an output file.
"""

from __future__ import annotations

import contextlib
import errno
import functools
import glob
import json
import math
import os
import platform
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from geometry.design import BadInput
from studies.output import own_files

WRITING = ".writing-"
"""Prefix of the name of a temporary folder; machine and process follow."""
LOCK = ".magtip.lock"
"""Name of the lock file in a folder that is being filled, and suffix of the lock file of a single output file."""


@contextlib.contextmanager
def filled(path: str | Path, names: Iterable[str] = ()) -> Iterator[Path]:
    """Yield the output folder, locked for this process; a folder that is made here is deleted if it stays empty.

    `names`: names of all files that the verb may write. Those that it has not written again, when the block ends
    without an error, are of earlier options and are deleted.
    """
    with _folder_made(path) as folder, _locked(folder / LOCK, f"the folder {str(path)!r} is being filled"):
        earlier = {file: _identity(file) for file in (folder / name for name in names) if file.is_file()}
        yield folder
        for file, identity in earlier.items():
            if file.is_file() and _identity(file) == identity:
                file.unlink()


def _identity(file: Path) -> tuple[int, int]:
    """Return what tells a file from another one of its name: each is written to a new file that gets the name."""
    found = file.stat()
    return found.st_ino, found.st_mtime_ns


@contextlib.contextmanager
def sole_writer(*paths: str | Path | None) -> Iterator[None]:
    """Lock these files for this process; a folder that is made for them is deleted if it stays empty."""
    with contextlib.ExitStack() as stack:
        for file in (Path(path) for path in paths if path is not None):
            folder = stack.enter_context(_folder_made(file.parent))
            stack.enter_context(_locked(folder / f".{file.name}{LOCK}", f"the file {str(file)!r} is being written"))
        yield


@contextlib.contextmanager
def _locked(file: Path, what: str) -> Iterator[None]:
    try:
        with only(file):
            yield
    except Held as held:
        raise BadInput(f"{what} by {held.owner}: wait until it ends, or choose another name") from None


@contextlib.contextmanager
def _folder_made(path: str | Path) -> Iterator[Path]:
    """Yield a folder, made if it does not exist, into which files can be written."""
    folder = Path(path)
    new = [each for each in (folder, *folder.parents) if not os.path.lexists(each)]
    try:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except (FileExistsError, NotADirectoryError):
            raise BadInput(
                f"the output folder {str(path)!r} cannot be made, because it or one of its parents is a file: "
                "choose another name"
            ) from None
        except (OSError, ValueError) as error:
            cause = _cause(error)
            raise BadInput(f"cannot write to the folder {str(path)!r} ({cause}): choose another folder") from None
        yield folder
    finally:
        # rmdir refuses a folder that holds anything, so only empty ones go
        for each in new:
            with contextlib.suppress(OSError):
                each.rmdir()


@contextlib.contextmanager
def staged(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder inside `folder`; without an error its files move into `folder`."""
    with _temporary(folder) as temporary, with_file_name(folder):
        yield Path(temporary)
        files = {file.name: file for file in sorted(Path(temporary).iterdir()) if file.name != own_files.LIST}
        own_files.note(folder, files)
        for name, file in files.items():
            os.replace(file, folder / name)


def results(path: str | Path | None, names: Iterable[str] = ()) -> contextlib.AbstractContextManager[Path | None]:
    """Return `filled(path, names)`, or a context that yields None if there is no path."""
    return contextlib.nullcontext() if path is None else filled(path, names)


def check_output_file(path: str | Path, *suffixes: str) -> Path:
    """Check that a file has one of the suffixes and can be written later, and return its path.

    Nothing is written here: a folder that does not exist is made together with the file.
    """
    file = Path(path)
    if file.suffix.lower() not in suffixes:
        raise BadInput(f"the file {str(path)!r} must end in {' or '.join(suffixes)}")
    try:
        if file.is_dir():
            raise BadInput(f"{str(path)!r} is a folder: give a file's name")
        folder = next(parent for parent in file.absolute().parents if os.path.lexists(parent))
        if not folder.is_dir():
            raise BadInput(
                f"the folder {str(file.parent)!r} cannot be made, because it or one of its parents is a file: choose "
                f"another for {file.name!r}"
            )
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        where = str(file.parent)
        raise BadInput(f"cannot write to the folder {where!r} ({_cause(error)}): choose another folder") from None
    own_files.check_file(file)
    return file


def check_apart(outputs: Iterable[Path | None], inputs: Iterable[str | Path | None]) -> None:
    """Check that no output file is also an input file, even under another name or by a link."""
    sources = [path for path in inputs if path is not None and os.path.isfile(path)]
    for out in outputs:
        for path in sources if out is not None and os.path.isfile(out) else ():
            if os.path.samefile(str(out), path):
                raise BadInput(f"the output {str(out)!r} is also the input {str(path)!r}: choose another name")


def inside(folder: Path | None, names: Iterable[str]) -> list[Path]:
    """Return the paths of the files that a verb writes into an output folder; without a folder there are none."""
    names = list(names)
    own_files.check(folder, names)
    return [] if folder is None else [folder / name for name in names]


@contextlib.contextmanager
def atomic(path: str | Path, *, listed: bool = True) -> Iterator[Path]:
    """Yield a temporary path with the suffix of `path`; without an error the file written there replaces `path`.

    The folder is made if it does not exist.

    `listed`: whether to list the file as an output of magtip, see `studies.output.own_files`.
    """
    file = Path(path)
    file.parent.mkdir(parents=True, exist_ok=True)
    with _temporary(file.parent) as folder:
        temporary = Path(folder, f"part{file.suffix}")
        with with_file_name(file):
            yield temporary
            if listed:
                own_files.note(file.parent, {file.name: temporary})
            os.replace(temporary, file)


def _temporary(folder: Path) -> tempfile.TemporaryDirectory[str]:
    """Make a temporary folder inside another one, which is on the same disk, so that renaming is atomic."""
    _delete_left_folders(folder.absolute())
    return tempfile.TemporaryDirectory(prefix=f"{WRITING}{platform.node()}-{os.getpid()}-", dir=folder)


@functools.cache
def _delete_left_folders(folder: Path) -> None:
    """Delete the temporary folders of processes that no longer run; once for each folder and process.

    Temporary folders of other machines stay, because their processes may still be writing.
    """
    for left in folder.glob(f"{WRITING}{glob.escape(platform.node())}-*"):
        process = left.name.rsplit("-", 2)[1]
        try:
            if os.name == "posix" and process.isdecimal():
                os.kill(int(process), 0)
        except ProcessLookupError:
            shutil.rmtree(left, ignore_errors=True)
        except OSError:
            continue  # it runs, as another user's


@contextlib.contextmanager
def with_file_name(path: Path) -> Iterator[None]:
    """Add the file's name to an OSError that has none, such as that of a full disk."""
    try:
        yield
    except OSError as error:
        if error.filename is None:
            error.filename = str(path)
        raise


def write_text(path: str | Path, text: str, *, listed: bool = True) -> None:
    """Write a text file, UTF-8; `listed` is that of `atomic`."""
    with atomic(path, listed=listed) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_json(path: str | Path, record: Mapping[str, Any], *, listed: bool = True) -> None:
    """Write one JSON object, indented; `listed` is that of `atomic`."""
    write_text(path, json.dumps(clean(record), indent=2, allow_nan=False) + "\n", listed=listed)


def json_line(record: Mapping[str, Any]) -> str:
    """Return one JSON object on one line.

    >>> json_line({"force_N": (0.0, math.nan)})
    '{"force_N": [0.0, null]}'
    """
    return json.dumps(clean(record), allow_nan=False)


def clean(value: Any) -> Any:
    """Convert a value to what JSON can hold: tuples and arrays to lists, NumPy scalars to Python's, NaN and inf to
    None.

    A negative zero loses its sign, so that tables do not show -0.
    """
    if isinstance(value, Mapping):
        return {str(key): clean(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [clean(item) for item in value]
    if hasattr(value, "tolist"):
        return clean(value.tolist())
    if isinstance(value, float):
        return value + 0.0 if math.isfinite(value) else None
    return str(value) if isinstance(value, Path) else value


def _cause(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


# Locks: one process writes at a time


PATIENCE = 0.2
"""Time in which a lock file that its last owner has just deleted is made anew, s."""
WITHOUT_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.ENOTSUP)
"""Errors of a file system that has no locks: there one writes without."""


class Held(Exception):
    """Another process, or another part of this one, holds the lock; `owner` names it as far as it is known."""

    def __init__(self, owner: str) -> None:
        super().__init__(owner)
        self.owner = owner


@contextlib.contextmanager
def only(file: Path) -> Iterator[None]:
    """Hold the lock of this lock file, which is deleted afterwards, or raise `Held` if another process holds it."""
    import filelock

    def sign(handle: int) -> None:
        os.ftruncate(handle, 0)
        os.write(handle, f"{os.getpid()} {platform.node()}".encode())

    lock = filelock.FileLock(file, timeout=PATIENCE, on_acquired=sign)
    try:
        lock.acquire()
    except filelock.Timeout:
        raise Held(_owner(file)) from None
    except OSError as error:
        if error.errno not in WITHOUT_LOCKS:
            raise
    try:
        yield
    finally:
        # deleted while the lock is held: later it could already be the lock file of the next process
        with contextlib.suppress(OSError):
            file.unlink()
        lock.release()


def _owner(file: Path) -> str:
    with contextlib.suppress(OSError, ValueError):
        process, _, machine = file.read_text("utf-8").partition(" ")
        if process.isdecimal():
            return f"process {process}" + (f" on {machine}" if machine != platform.node() else "")
    return "another process"
