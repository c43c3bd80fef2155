"""Notes below the pictures of a sweep, in sentences: axes without effect, folded axes, failed cases."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.exploration import sweep_lines, sweep_maps
from studies.exploration.sweep_axes import symbol
from studies.exploration.sweep_cube import Cube, effect, failed
from studies.exploration.sweep_views import Section

MOST_NOTED = 100
"""Number of letters beyond which the reason of failed cases is not continued by its next clause."""


def idle(cube: Cube, shown: Sequence[str]) -> list[str]:
    """Name the axes that change none of the columns that are shown."""
    effective = cube.effective(shown)
    names = [symbol(name) for name, axis in cube.axes.items() if len(axis) > 1 and name not in effective]
    if not names or failed(cube.columns).all():
        return []
    return [f"{_list(names)} {'changes' if len(names) == 1 else 'change'} nothing that is shown."]


def of_picture(sections: Sequence[Section]) -> list[str]:
    """State which axes of a picture are folded, and for which axes its errors are the same."""
    notes = []
    for section in sections:
        if section.view.folded:
            how = (
                "the value of greatest magnitude" if section.view.maps
                else "lines at the greatest magnitude, shaded from the least to the greatest value"
            )  # fmt: skip
            names = _list([symbol(name) for name in section.view.folded])
            notes.append(f"{section.subject} over all values of {names}: {how}.")
    notes += [
        f"{section.subject} is the same for every {symbol(section.view.x)}."
        for section in sections
        if not section.error and not section.view.maps and _is_flat(section)
    ]
    for section in (s for s in sections if s.error):
        low, high = sweep_maps.error_limits(section) if section.view.maps else sweep_lines.error_limits(section)
        beyond = section.numbers[(section.numbers < low) | (section.numbers > high)]
        if len(beyond):
            what = "1 error" if len(beyond) == 1 else f"{len(beyond)} errors"
            ends = " to ".join(dict.fromkeys(f"{value:.0f} %" for value in (beyond.min(), beyond.max())))
            notes.append(f"{what} of {section.label} beyond the range of the picture: {ends}.")
        if section.view.maps and len(section.numbers) and abs(section.numbers).min() > sweep_maps.LIMITS[-1]:
            limit = f"{sweep_maps.LIMITS[-1]:g} %"
            notes.append(f"No {section.label} by {section.models[0]} has an error within {limit}.")
        values = [s for s in sections if not s.error and s.label == section.label]
        same = [name for name in (values[0].names if values else []) if name not in section.names]
        if same:
            notes.append(f"The error of {section.label} is the same for every {_list([symbol(n) for n in same])}.")
    return list(dict.fromkeys(notes))


def _is_flat(section: Section) -> bool:
    """Return whether the horizontal axis changes no value of a section of lines, of which each model has several."""
    # a bandwidth outside the band is no number: one number alone cannot be compared
    several = all((np.isfinite(values).sum(axis=-1) > 1).any() for values in section.values)
    return several and all(effect(values, values.ndim - 1) == 0 for values in section.values)


def failures(columns: Mapping[str, NDArray[Any]]) -> list[str]:
    """State how many cases failed and why."""
    lost = failed(columns)
    if not lost.any():
        return []
    kinds = Counter(str(status) for status in np.asarray(columns["status"])[lost])
    causes = ", ".join(f"{count} {status}" if len(kinds) > 1 else status for status, count in kinds.most_common(3))
    text = f"{int(lost.sum())} of {len(lost)} cases failed ({causes})"
    if "message" in columns:
        reasons = Counter(str(message) for message in np.asarray(columns["message"])[lost] if str(message))
        for reason, _ in reasons.most_common(1):
            text += f"; most often: {_first_clauses(reason)}"
    return [text.replace("$", r"\$").rstrip(".") + "."]


def _first_clauses(reason: str) -> str:
    """Return the first clauses of a long reason, none of them cut; the table has the whole of it."""
    first, *others = reason.split("; ")
    for clause in others:
        if len(first) + len(clause) > MOST_NOTED:
            break
        first += f"; {clause}"
    # a long clause ends with a colon and the remedy
    return first if len(first) <= MOST_NOTED else first.rpartition(": ")[0] or first


def _list(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
