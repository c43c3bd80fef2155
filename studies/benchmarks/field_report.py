"""FIELD.md, and the figures that `studies.benchmarks.field_benchmark` measures for it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from analytic import magnet
from studies.output import records
from studies.output.records import FlatRow

PROMISE = 1e-12
FASTER = 4.0
SECOND_THREAD = 1.6
ONE_POINT_US = 5.0
"""Goals: relative error of B, times as fast as magpylib, as fast with a second thread, us of one point."""


@dataclass(frozen=True, slots=True)
class RegionErrors:
    """The worst relative errors of each program in a region of one magnet; NaN where none was measured."""

    region: str
    height_per_radius: float
    numpy: float = field(metadata={"column": "NumPy"})
    compiled: float
    magpylib: float
    numpy_jacobian: float = field(metadata={"column": "NumPy Jacobian"})
    compiled_jacobian: float = field(metadata={"column": "compiled Jacobian"})

    def row(self) -> FlatRow:
        """Return the columns of field.csv."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class ProgramTimes:
    """CPU and clock time for each of a million points, and clock time of a call with one point and with none, us.

    `faster` is the CPU time of magpylib over that of the program, `shorter` the clock time of one compiled thread.
    """

    program: str
    many_us: float
    clock_us: float
    faster: float
    shorter: float
    one_us: float
    none_us: float


@dataclass(frozen=True, slots=True)
class FirstCall:
    """What a new process waits for, s: the import, the first call in NumPy, the kernel with its first call."""

    process: str
    import_s: float
    first_numpy_s: float
    kernel_s: float


def report(
    errors: Sequence[RegionErrors],
    times: Sequence[ProgramTimes],
    calls: Sequence[FirstCall],
    about: dict[str, str],
    text: str,
) -> str:
    """Return the text of FIELD.md: goals, errors and times, and how they were measured."""
    own = max(max(error.numpy, error.compiled) for error in errors)
    fast, two = times[0], times[1]
    beyond = fast.one_us - fast.none_us
    lines = [
        "# Accuracy and speed of the exact field",
        "",
        "`python -m studies.benchmarks.field_benchmark results/field`",
        "",
    ]
    lines += _table(
        ["goal", "measured", "met"],
        [
            [f"error at most {PROMISE:g} of B", f"{own:.1e}", _met(own <= PROMISE)],
            [
                f"a million points {FASTER:g} times as fast as magpylib",
                f"{fast.faster:.1f} times",
                _met(fast.faster >= FASTER),
            ],
            [
                f"a second thread: {SECOND_THREAD:g} times as fast as one",
                f"{two.shorter:.1f} times",
                _met(two.shorter >= SECOND_THREAD),
            ],
            [f"one point at most {ONE_POINT_US:g} us", f"{beyond:.1f} us", _met(beyond <= ONE_POINT_US)],
        ],
    )
    lines += ["", "## Worst relative error", ""]
    heads = ["region", "NumPy", "compiled", "NumPy Jacobian", "compiled Jacobian", "magpylib"]
    lines += _table(heads, _worst_by_region(errors))
    lines += ["", "Every region of every magnet is in field.csv.", "", "## Time", ""]
    heads = [
        "program",
        "us per point of a million",
        "by the clock",
        "times as fast as magpylib",
        "call with one point, us",
        "call without points, us",
        "difference, us",
    ]
    cells = [
        [
            t.program,
            f"{t.many_us:.3f}",
            f"{t.clock_us:.3f}",
            f"{t.faster:.1f}",
            *map(_us, (t.one_us, t.none_us, t.one_us - t.none_us)),
        ]
        for t in times
    ]
    lines += _table(heads, cells)
    lines += ["", "## First calls", ""]
    heads = ["process", "import analytic.magnet, s", "first call in NumPy, s", "kernel loaded and called, s"]
    cells = [[c.process, f"{c.import_s:.2f}", f"{c.first_numpy_s:.2f}", f"{c.kernel_s:.2f}"] for c in calls]
    lines += _table(heads, cells)
    lines += [
        "",
        f"Calls with {magnet.MIN_COMPILED_POINTS} points or more, and `analytic.magnet.compiled()`, load the kernel.",
        "",
    ]
    lines += ["## How it was measured", "", *text.splitlines(), ""]
    return "\n".join([*lines, *(f"- {name}: {value}" for name, value in about.items())]) + "\n"


def _worst_by_region(errors: Sequence[RegionErrors]) -> list[list[str]]:
    """Cells of each region: its name, and the worst error of each program over all magnets."""
    cells = []
    for region in dict.fromkeys(error.region for error in errors):
        own = [error for error in errors if error.region == region]
        worst = (
            max(error.numpy for error in own),
            max(error.compiled for error in own),
            max(error.numpy_jacobian for error in own),
            max(error.compiled_jacobian for error in own),
            max(error.magpylib for error in own),
        )
        cells.append([region, *map(_error, worst)])
    return cells


def _table(heads: list[str], rows: list[list[str]]) -> list[str]:
    return ["| " + " | ".join(cells) + " |" for cells in (heads, ["---"] * len(heads), *rows)]


def _met(good: bool) -> str:
    return "yes" if good else "**no**"


def _error(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.1e}"


def _us(value: float) -> str:
    return "refused" if math.isnan(value) else f"{value:.2f}"
