"""The errors that a user can meet: input that cannot be used, and problems without an answer; words of remedies."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


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
    """Return the known word that differs in case only, or else the most similar one; None if none is similar.

    >>> closest("d", ["D", "E"]), closest("magnet_hieght", ["D", "magnet_height"]), closest("colour", ["D"])
    ('D', 'magnet_height', None)
    """
    import difflib

    known = list(words)
    # difflib distinguishes case, and would rate "d" and "D" as entirely different
    same = [other for other in known if other.casefold() == word.casefold()]
    return next(iter(same or difflib.get_close_matches(word, known, n=1)), None)
