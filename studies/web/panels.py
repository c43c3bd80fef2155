"""The panels of numbers of the live page: one row each, from which its sections, their widths, the parts that it asks
for and the order of their answers follow.

The function of a panel takes a request, the level of its answers and what the process keeps, and yields levels with
data as a table takes them: `columns` (names of the values and of what stands beside them), `rows` (made by
`state_answers.number`) and a `message`; one of several tables has these by their names in `tables`. It may yield a
coarse answer before the one at the level of the state.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Literal

from studies.mechanics.store import Store
from studies.mechanics.study_cases import Recent

MOST_RESULTS = 12
"""Most results that depend on the design alone and are kept: decoder, curves and stability of two designs."""

When = Literal["first", "design", "rest", "load"]


@dataclass(frozen=True, slots=True)
class Memory:
    """The store of solved states, and what a process keeps of its answers.

    Attributes
    ----------
    results : what later requests ask for again.
    systems : what takes too much memory to keep for more than one state.
    """

    store: Store
    results: Recent[Any] = field(default_factory=lambda: Recent(MOST_RESULTS))
    systems: Recent[Any] = field(default_factory=lambda: Recent(1))

    def clear(self) -> None:
        """Free everything that is kept outside of the store."""
        self.results.values.clear()
        self.systems.values.clear()


@dataclass(frozen=True, slots=True)
class Panel:
    """A panel with tables of numbers, and perhaps a picture.

    Attributes
    ----------
    function : module of this folder and function that yields the answers, imported when the first one is asked for;
        "" for a table of the part `of`.
    when : at the level of the state, before its pictures are refined (first) or after them (rest); at all levels
        where the design is new, else at that of the state (design); at all levels (load).
    width, compared : columns of the grid, of 12; of the page with two designs.
    offline : whether the page without a server has it, of the design alone.
    tables : names of its tables among those of its data; default: its own, which its data are.
    picture : script of the page that draws a picture of each side from its data.
    of_array : whether only the page of an array has it.
    folded : whether it is answered once it is opened only.
    """

    name: str
    heading: str
    function: str = ""
    when: When = "rest"
    width: Literal[6, 12] = 6
    compared: Literal[6, 12] = 12
    offline: bool = False
    of: str = ""
    tables: tuple[str, ...] = ()
    picture: str = ""
    of_array: bool = False
    folded: bool = False

    @property
    def part(self) -> str:
        """Name of the part of the answers that has its data."""
        return self.of or self.name

    def answers(self, request: Any, level: str, memory: Memory) -> Iterable[tuple[str, dict[str, Any]]]:
        """Return levels and data of a request's answers."""
        module, name = self.function.split(".")
        found: Iterable[tuple[str, dict[str, Any]]] = getattr(importlib.import_module(f"studies.web.{module}"), name)(
            request, level, memory
        )
        return found


PANELS = (
    Panel(
        "array",
        "Array from above",
        "array_answers.array_panel",
        "first",
        width=12,
        tables=("array_forces", "array_readings", "array_errors"),
        picture="array",
        of_array=True,
    ),
    Panel("decoded", "Decoded load", of="state", compared=6, offline=True),
    Panel("stability", "Stability and modes", "state_answers.stability_panel", "design", offline=True),
    Panel("margins", "Requirements", "required_margins.margins_panel", "first", width=12),
    Panel("drawing", "Drawing", "state_pictures.drawing_panel", width=12, picture="drawing", folded=True),
    Panel("vibration", "Vibration", "time_answers.vibration_panel", "rest"),
    Panel("loop", "Loading cycle", "time_answers.loop_panel", "load"),
)
"""All panels that have tables of numbers and no figure, in the order of the page."""
ANSWERED_PANELS = tuple(panel for panel in PANELS if panel.function)
"""Those with a part of their own."""
