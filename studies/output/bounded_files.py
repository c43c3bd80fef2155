"""What files say, read within bounds: bytes, rows, depth of nesting and digits.

Every file that a user may give passes here, so that one without an end, a packed one, or one that is nested without
an end costs a sentence, and no memory and no time.
"""

from __future__ import annotations

import gzip
import json
import math
import re
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from geometry.design import BadInput

MOST_BYTES = 200_000_000
"""Largest file of text, unpacked: ten times the recording of a sensor at 100 Hz over an hour."""
MOST_TOML = 1_000_000
"""Largest file of TOML, whose reader takes a second for a million letters."""
MOST_ROWS = 2_000_000
"""Largest number of rows of a table: half an hour at 1 kHz."""
MOST_DEPTH = 50
"""Deepest nesting of lists and tables."""
MOST_DOTS = 200
"""Largest number of points in a key or a value of TOML: the time of a key a.b.c... grows as their square."""
LARGEST_WHOLE = 2**63
"""Whole numbers of TOML have 64 bits."""
DEEP, LONG = f"is nested more than {MOST_DEPTH} deep", "has a whole number of more than 19 digits"
LARGEST = 1e30
"""Largest size of a number in a table of measurements or states: its fourth power is still a number."""


def bytes_of(path: str | Path, most: int = MOST_BYTES) -> bytes:
    """Return the content of a file, unpacked if it ends in .gz; BadInput for more than so many bytes.

    Raises
    ------
    OSError, EOFError, zlib.error
        The file cannot be read, or is not packed as its name says.
    """
    with gzip.open(path) if Path(path).suffix == ".gz" else open(path, "rb") as stream:
        data = stream.read(most + 1)
    if len(data) > most:
        raise BadInput(
            f"{str(path)!r} has more than {most // 1_000_000} MB, the most that is read: give a part of it"
        )
    return data


def text_of(
    path: str | Path, kind: str, what: str = "file", close: str = "", more: str = "", most: int = MOST_BYTES
) -> str:
    """Return the text of a UTF-8 file, which may be packed (.gz), without the byte order mark that editors may write.

    Parameters
    ----------
    kind : name of the file's format for messages, such as CSV.
    what, close, more : what the path names, what may be meant, and a further remedy, for messages.
    most : largest number of bytes.
    """
    try:
        return bytes_of(path, most).decode("utf-8-sig")
    except BadInput:
        raise
    except FileNotFoundError:
        raise BadInput(f"there is no {what} {str(path)!r}: {close or f'check its path{more}'}") from None
    except IsADirectoryError:
        raise BadInput(f"{str(path)!r} is a folder: give a {kind} file{more}") from None
    except UnicodeDecodeError:
        raise BadInput(f"{str(path)!r} is not UTF-8 text: save it as a UTF-8 {kind} file") from None
    # a path with a NUL, or one that is no text, is a ValueError
    except (OSError, ValueError, EOFError, zlib.error) as error:
        cause = getattr(error, "strerror", None) or str(error)
        raise BadInput(f"{str(path)!r} cannot be read ({cause}): check its path and permissions") from None


def json_in(text: str | bytes, number: Callable[[str], float] = float) -> Any:
    """Return the value in a text of JSON, its floats by `number`; BadInput says what it is, as "is not JSON"."""
    try:
        text = text if isinstance(text, str) else text.decode()
        found = json.loads(text, parse_int=whole, parse_float=number, parse_constant=number)
    except UnicodeDecodeError:
        raise BadInput("is not UTF-8 text") from None
    except json.JSONDecodeError as error:
        raise BadInput(f"is not JSON ({error.msg.lower()}: line {error.lineno}, column {error.colno})") from None
    except RecursionError:
        raise BadInput(DEEP) from None
    # each level begins with one of these
    if text.count("[") + text.count("{") > MOST_DEPTH:
        check_depth(found)
    return found


def json_object(path: Path) -> dict[str, Any]:
    """Return the object in a file of JSON."""
    text = text_of(path, "JSON")
    try:
        found = json_in(text)
    except BadInput as error:
        raise BadInput(f"{str(path)!r} {error}: save it again") from None
    if not isinstance(found, dict):
        raise BadInput(f"{str(path)!r} holds no JSON object, {{...}}")
    return found


def toml_in(text: str) -> dict[str, Any]:
    """Return the table in a text of TOML; BadInput says what it is, as "is not valid TOML"."""
    import tomllib

    if any(len(re.findall(r"\.(?!\.)", part)) > MOST_DOTS for part in re.split(r"[=,\n{\[]", text)):
        raise BadInput(f"has a key or a value with more than {MOST_DOTS} points")
    try:
        found = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        cause = str(error).replace("at end of document", f"at the end, line {len(text.splitlines())}")
        raise BadInput(f"is not valid TOML: {cause}") from None
    except RecursionError:
        raise BadInput(DEEP) from None
    except ValueError:  # Python reads no whole number of more than 4300 digits
        raise BadInput(LONG) from None
    check_depth(found)
    return found


def whole(text: str) -> int:
    """Return a whole number of at most 64 bits; no time is spent on one of thousands of digits."""
    if len(text) > 20 or abs(int(text)) >= LARGEST_WHOLE:
        raise BadInput(LONG)
    return int(text)


def check_depth(value: Any) -> None:
    """Check the depth of a nested value, and the digits of its whole numbers."""
    level: list[Any] = [value]
    for _ in range(MOST_DEPTH):
        deeper: list[Any] = []
        for item in level:
            if isinstance(item, dict):
                deeper.extend(item.values())
            elif isinstance(item, list):
                deeper.extend(item)
            elif isinstance(item, int) and abs(item) >= LARGEST_WHOLE:
                raise BadInput(LONG)
        if not deeper:
            return
        level = deeper
    raise BadInput(DEEP)


def finite(text: str) -> float:
    """Return a number of a state or a measurement."""
    value = float(text)
    if not math.isfinite(value):
        raise BadInput(f"has a number that is not finite, {text:.30}: leave it out")
    if not abs(value) <= LARGEST:
        raise BadInput(f"has a number beyond {LARGEST:g}, {text:.30}: leave it out")
    return value
