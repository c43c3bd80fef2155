"""Figures of the sweep benchmark, and SCALE.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from studies.output import records
from studies.output.records import FlatRow

ABOUT = """\
Every sweep is a command of its own, with its imports, from its start to its end by the clock on the wall. CPU time
and peak memory are those of the command and its worker processes, of which linear algebra has one thread each. Times
by the clock grow with other work on the machine, CPU time less so: the load before the benchmark is below, and the
goals in seconds are meant for a machine that has nothing else to do. A sweep without files computes all rows; with
files it also writes the table and draws its pictures, which take most of the time of a sweep from the store.

- Presses: D 6 to 11 mm and L 12 to 17 mm in six steps each, six values of f and of E, five depths.
- Presses and shears: the same designs with these presses, and four shears of a glued plate under the last depth.
- A million rows: one design, 20 values of E and f, 20 gains and 25 heights of the Hall elements, five depths; less or
  more rows by 5 or 40 values of E. The pictures hold up to a million rows in memory, and a part of more.
- The gain of two workers is the median of three times by one worker over that by two, by turns.
- The time left is that in the first progress line beyond a fifth of the work, against the time that it then took.
- A killed sweep is started again with its store until it completes, then with an empty store, and so on. Its rows are
  compared with those of a sweep that nobody has killed.
- The estimate for a cluster multiplies the figures above it.
"""


@dataclass(frozen=True, slots=True)
class Figure:
    """A measured figure.

    Attributes
    ----------
    case : what was run.
    quantity : what was measured.
    value, unit : the figure.
    goal : largest value, or least one if `more`; None for a figure without a goal.
    """

    case: str
    quantity: str
    value: float
    unit: str
    goal: float | None = None
    more: bool = False

    @property
    def met(self) -> bool | None:
        """Whether the goal is met; None without a goal."""
        if self.goal is None:
            return None
        return self.value >= self.goal if self.more else self.value <= self.goal

    def row(self) -> FlatRow:
        """Return the row of scale.csv."""
        return records.flat(self) | {"met": self.met}


def number(value: float) -> str:
    """Return a figure with three significant digits, large ones with all digits before the point.

    >>> number(1234567.0), number(0.012345), number(36.0), number(4.0)
    ('1234567', '0.0123', '36', '4')
    """
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def report(figures: Sequence[Figure], about: Mapping[str, str], command: str) -> str:
    """Return the text of SCALE.md: goals, figures of each case, how and where they were measured."""
    judged = [figure for figure in figures if figure.met is not None]
    met = sum(bool(figure.met) for figure in judged)
    lines = ["# Sweeps: workers and scale", "", f"`{command}`", "", f"{met} of {len(judged)} goals are met.", ""]
    rows = [
        (f"{figure.case}: {figure.quantity}", _value(figure), _goal(figure), "yes" if figure.met else "**no**")
        for figure in judged
    ]
    lines += _table(("figure", "measured", "goal", "met"), rows)
    for case in dict.fromkeys(figure.case for figure in figures):
        lines += [f"## {case.capitalize()}", ""]
        own = [(figure.quantity, _value(figure)) for figure in figures if figure.case == case]
        lines += _table(("figure", "measured"), own)
    lines += ["## How it was measured", "", *ABOUT.splitlines(), ""]
    lines += [f"- {name}: {value}" for name, value in about.items()]
    return "\n".join(lines) + "\n"


def _value(figure: Figure) -> str:
    return f"{number(figure.value)} {figure.unit}".rstrip()


def _goal(figure: Figure) -> str:
    assert figure.goal is not None
    return f"at {'least' if figure.more else 'most'} {figure.goal:g} {figure.unit}".rstrip()


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    return [f"| {' | '.join(cells)} |" for cells in (heads, ["---"] * len(heads), *rows)] + [""]
