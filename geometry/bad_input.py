"""The errors that a user can meet, words of remedies, and the ranges of input fields."""

import dataclasses
import functools
import math
from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

Record = TypeVar("Record")


class BadInput(ValueError):
    """An input value that cannot be used. The text is one sentence with the value, its bound and the remedy."""


class SolveFailed(RuntimeError):
    """A problem that has no answer: a mesh that cannot be made, a solve that does not converge.

    The text is one sentence. Only these errors count as results of a study; every other one is a bug, which ends the
    run with a traceback.
    """


class MeshError(SolveFailed):
    """A mesh or a solid of these dimensions cannot be made, or is not valid."""


class OutOfReach(BadInput):
    """A possible wish that the model cannot reach, which shows only after it has tried."""


def no_effect(names: Sequence[str], reason: str) -> str:
    """Return the warning that some settings have no effect, with the reason.

    >>> no_effect(["f", "c"], "hall_layout is tmag5273a1")
    'f, c have no effect: hall_layout is tmag5273a1'
    """
    return f"{', '.join(names)} {'has' if len(names) == 1 else 'have'} no effect: {reason}"


def nearest(word: str, words: Iterable[str]) -> str:
    """Return the remedy for an unknown word: the most similar known word, or all of them if none is similar.

    >>> nearest("magnet_hieght", ["D", "magnet_height"])
    'did you mean magnet_height?'
    """
    known = list(words)
    close = closest(word, known)
    return f"did you mean {close}?" if close else f"choose one of {', '.join(known)}"


def closest(word: str, words: Iterable[str]) -> str | None:
    """Return the known word that differs in case only, or else the first one of which it is the first part, or else
    the most similar one; None if none is similar.

    >>> closest("d", ["D", "E"]), closest("magnet_hieght", ["D", "magnet_height"]), closest("colour", ["D"])
    ('D', 'magnet_height', None)
    >>> closest("shear", ["shear_x", "shear_y"])
    'shear_x'
    """
    import difflib

    known = list(words)
    # difflib distinguishes case, and would rate "d" and "D" as entirely different
    same = [candidate for candidate in known if candidate.casefold() == word.casefold()]
    same = same or [candidate for candidate in known if word and candidate.startswith(f"{word}_")]
    return next(iter(same or difflib.get_close_matches(word, known, n=1)), None)


def known_fields(record: type[Record]) -> type[Record]:
    """Let a dataclass answer to an unknown field with a TypeError that says what to write."""
    made, names = record.__init__, [spec.name for spec in dataclasses.fields(record)]  # type: ignore[arg-type]

    @functools.wraps(made)
    def checked(self: Record, *values: Any, **fields: Any) -> None:
        for name in fields:
            if name not in names:
                raise TypeError(f"{record.__name__} has no {name}: {nearest(name, names)}")
        made(self, *values, **fields)

    record.__init__ = checked  # type: ignore[assignment, method-assign]
    return record


def words(name: str, text: str) -> str:
    """Return a free text on one line; BadInput for one with letters that steer a terminal or that no file can hold.

    >>> words("silicone", " Ecoflex\\n00-30 ")
    'Ecoflex 00-30'
    """
    line = " ".join(text.split())
    if not line.isprintable():
        raise BadInput(f"{name} must be text that can be printed; got {text!r:.60}: leave out its control characters")
    return line


def quantity(default: float | None, unit: str, low: float, high: float, text: str = "", **about: Any) -> Any:
    """Return a dataclass field of a number from `low` to `high`, both included, in a unit ("1": a pure number).

    text : description. about : further metadata, such as `count`: True for what must be an int.
    """
    metadata = {"unit": unit, "low": low, "high": high, "text": text, **about}
    return dataclasses.field(default=default, metadata=metadata)


def check_ranges(record: Any) -> None:
    """Raise BadInput if a number of a frozen dataclass is out of the range that `quantity` gave it; None is allowed
    where it is the default."""
    for spec in dataclasses.fields(record):
        value: object = getattr(record, spec.name)
        if "low" in spec.metadata and (value is not None or spec.default is not None):
            in_range(spec, value)


def in_range(spec: dataclasses.Field[Any], value: object) -> float:
    """Return the value of a field made by `quantity`; raise BadInput if its type is wrong or it is out of range."""
    about = spec.metadata
    low, high, unit = about["low"], about["high"], "" if about["unit"] == "1" else f" {about['unit']}"
    is_count = about.get("count", False)
    if isinstance(value, bool) or not isinstance(value, int if is_count else (int, float)):
        kind = "whole number" if is_count else "number"
        kind += f" ({about['text']})" if about["text"] else f" from {low:g} to {high:g}{unit}"
        raise BadInput(f"{spec.name} must be a {kind}; got {value!r}")
    try:
        number = float(value)
    except OverflowError:  # a whole number of more than 308 digits
        number = math.inf if value > 0 else -math.inf
    # a NaN fails this comparison, and so is refused as well
    if not low <= number <= high:
        raise BadInput(f"{spec.name} must lie between {low:g} and {high:g}{unit}; got {number:g}{unit}")
    return number
