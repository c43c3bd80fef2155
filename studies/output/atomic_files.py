"""Files and folders, written whole or not at all.

A file gets a temporary name in its own folder and is renamed when it is complete. The name tells machine and process:
what a process that was killed has left is removed by the next one that writes into the folder. One process at a time
fills a folder, or works for a file.
"""

from __future__ import annotations

import contextlib
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
from studies.output import file_lock

WRITING = ".writing-"
"""How the name of a temporary folder begins; machine and process follow."""

LOCK = ".magtip.lock"
"""The file in a folder that is locked while it is filled; the end of the name of one beside a file."""


def output_folder(path: str | Path) -> Path:
    """The folder, made if it does not exist, and found fit to write into before any work starts.

    Raises
    ------
    BadInput
        It cannot be made or written.
    """
    folder = Path(path)
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
        raise BadInput(f"cannot write to the folder {str(path)!r} ({_cause(error)}): choose another folder") from None
    return folder


@contextlib.contextmanager
def filled(path: str | Path) -> Iterator[Path]:
    """The folder of `output_folder` while it is filled, by this process alone; if made here, it is not left empty.

    Raises
    ------
    BadInput
        It cannot be written, or another process fills it.
    """
    with _made(path) as folder, _alone(folder / LOCK, f"the folder {str(path)!r} is being filled"):
        yield folder


@contextlib.contextmanager
def sole_writer(*paths: str | Path | None) -> Iterator[None]:
    """No other process writes these files meanwhile. A folder that is made for them is not left empty.

    Raises
    ------
    BadInput
        A folder cannot be written, or another process writes one of the files.
    """
    with contextlib.ExitStack() as stack:
        for file in (Path(path) for path in paths if path is not None):
            folder = stack.enter_context(_made(file.parent))
            stack.enter_context(_alone(folder / f".{file.name}{LOCK}", f"the file {str(file)!r} is being written"))
        yield


@contextlib.contextmanager
def _alone(file: Path, what: str) -> Iterator[None]:
    """Hold a lock, or say what is being done, and by whom."""
    try:
        with file_lock.only(file):
            yield
    except file_lock.Held as held:
        raise BadInput(f"{what} by {held.owner}: wait until it ends, or choose another name") from None


@contextlib.contextmanager
def _made(path: str | Path) -> Iterator[Path]:
    """The folder of `output_folder`; if it is made here, it is not left empty."""
    made = [folder for folder in (Path(path), *Path(path).parents) if not os.path.lexists(folder)]
    try:
        yield output_folder(path)
    finally:
        for folder in made:
            with contextlib.suppress(OSError):
                folder.rmdir()


@contextlib.contextmanager
def staged(folder: Path) -> Iterator[Path]:
    """A temporary folder inside `folder`; if all goes well its files move up, over those of the same name."""
    with _temporary(folder) as temporary, _named(folder):
        yield Path(temporary)
        for file in sorted(Path(temporary).iterdir()):
            os.replace(file, folder / file.name)


def results(path: str | Path | None) -> contextlib.AbstractContextManager[Path | None]:
    """`filled`, or None where nothing is to be written."""
    return contextlib.nullcontext() if path is None else filled(path)


def check_output_file(path: str | Path, *suffixes: str) -> Path:
    """A file that can be written later: right ending, and a folder fit to write into, or to make it in.

    Writes nothing: a folder that does not exist is made with the file.

    Raises
    ------
    BadInput
        It cannot be written.
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
    return file


def check_apart(outputs: Iterable[Path | None], inputs: Iterable[str | Path | None]) -> None:
    """Refuse to write over what is read, under whatever name it goes.

    Raises
    ------
    BadInput
        An output is the same file as an input.
    """
    given = [path for path in inputs if path is not None and os.path.isfile(path)]
    for out in outputs:
        for path in given if out is not None and os.path.isfile(out) else ():
            if os.path.samefile(str(out), path):
                raise BadInput(f"the output {str(out)!r} is also the input {str(path)!r}: choose another name")


def inside(folder: Path | None, names: Iterable[str]) -> list[Path]:
    """The paths of files in an output folder; none where nothing is to be written."""
    return [] if folder is None else [folder / name for name in names]


@contextlib.contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """A temporary name of the same ending in the same folder, to be written; it becomes `path` if all goes well.

    The folder is made if it does not exist.
    """
    file = Path(path)
    file.parent.mkdir(parents=True, exist_ok=True)
    with _temporary(file.parent) as folder:
        temporary = Path(folder, f"part{file.suffix}")
        with _named(file):
            yield temporary
            os.replace(temporary, file)


def _temporary(folder: Path) -> tempfile.TemporaryDirectory[str]:
    """A folder for what is being written into another."""
    _tidied(folder.absolute())
    return tempfile.TemporaryDirectory(prefix=f"{WRITING}{platform.node()}-{os.getpid()}-", dir=folder)


@functools.cache
def _tidied(folder: Path) -> None:
    """Remove, once in a process, what processes that are gone have left in a folder.

    Those on other machines may be writing into the same folder: what they write is left alone.
    """
    for left in folder.glob(f"{WRITING}{glob.escape(platform.node())}-*"):
        process = left.name.rsplit("-", 2)[1]
        if process.isdecimal() and not _runs(int(process)):
            shutil.rmtree(left, ignore_errors=True)


def _runs(process: int) -> bool:
    """Whether a process of this number may still run; always, where the system cannot be asked."""
    try:
        if os.name == "posix":
            os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


@contextlib.contextmanager
def _named(path: Path) -> Iterator[None]:
    """An OSError that names no file, as that of a full disk, names this one."""
    try:
        yield
    except OSError as error:
        if error.filename is None:
            error.filename = str(path)
        raise


def write_text(path: str | Path, text: str) -> None:
    """Write a text file, UTF-8."""
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_json(path: str | Path, record: Mapping[str, Any]) -> None:
    """Write one object, indented."""
    write_text(path, json.dumps(clean(record), indent=2, allow_nan=False) + "\n")


def json_line(record: Mapping[str, Any]) -> str:
    """One object on one line.

    >>> json_line({"force_N": (0.0, math.nan)})
    '{"force_N": [0.0, null]}'
    """
    return json.dumps(clean(record), allow_nan=False)


def clean(value: Any) -> Any:
    """The value as JSON can hold it: tuples and arrays as lists, numpy's scalars as Python's, NaN and inf as None.

    A negative zero loses its sign.
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
