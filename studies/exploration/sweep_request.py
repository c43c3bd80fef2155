"""The grid of `magtip sweep`, from a study or from options, and the columns that its tables show."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet
from geometry.messages import Progress
from studies.inputs import study_input, user_input
from studies.output import atomic_files, console
from studies.output.records import FlatRow

if TYPE_CHECKING:
    from studies.exploration.sweep_rows import SweepRow

FILES = ("sweep.csv", "sweep.png")
"""Files that a sweep writes into its folder."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Designs, depths and models of a sweep.

    Attributes
    ----------
    design : base design.
    axes : values of each axis.
    depth : depth of the press if it is not an axis, mm; else 0.
    magnet, accuracy : of the finite elements.
    """

    design: Design
    axes: dict[str, list[float]]
    depth: float
    magnet: Magnet
    accuracy: str


def grid_of(
    source: str | None,
    axes: list[str],
    design: str | None,
    depth: float | None,
    magnet: Magnet | None,
    accuracy: str | None,
    sets: list[str],
) -> Grid:
    """Return the grid of a study, or of a design with axes; options replace the study's values."""
    if source is not None and design is not None:
        raise BadInput(f"the design is given twice, {source!r} and --design {design!r}: give one of them")
    if source is not None and study_input.is_study(source):
        if axes:
            raise BadInput(f"the study {source!r} has its own axes: leave --axis out, or give a design instead")
        study = study_input.read_study(source)
        depth, accuracy = depth if depth is not None else study.depth, accuracy or study.accuracy
        magnet, values = magnet or study.magnet or "rigid", study.axes
        base = study_input.study_design(study, sets, magnet=magnet)
    else:
        if not axes:
            raise BadInput(
                "a sweep needs at least one axis: add --axis NAME=a,b,c, or give a study file with a table [axes]"
            )
        magnet, values = magnet or "rigid", study_input.parse_axes(axes)
        base = user_input.read_design(source or design or "paper", sets, magnet=magnet)
    for name, _, value in (text.partition("=") for text in sets):
        if name.strip() in values:
            raise BadInput(f"{name.strip()} is both an axis and set to {value.strip()}: leave one of them out")
    if "depth" in values and depth is not None:
        raise BadInput(
            "depth is given twice, as an axis and as a single value (--depth or the study's): leave one of them out"
        )
    if "depth" not in values and depth is None:
        raise BadInput("a sweep needs a depth: add --depth D in mm, or the axis depth=a,b,c")
    if depth is not None:
        Load(depth=depth)
    return Grid(base, values, depth or 0.0, magnet, accuracy or "standard")


def sweep(grid: Grid, out: Path | None, progress: Progress, kept: Path | None = None) -> Iterator[SweepRow]:
    """Yield the rows of a sweep as soon as they are solved; `kept` is the file of the store, default: the user's."""
    from fem.accuracy import LEVELS
    from studies.exploration import store
    from studies.exploration import sweep as sweep_study

    with store.opened(kept or store.default()) as states, atomic_files.results(out) as folder:
        yield from sweep_study.run(
            grid.design,
            grid.axes,
            folder,
            depth=grid.depth,
            magnet=grid.magnet,
            accuracy=LEVELS[grid.accuracy],
            progress=progress,
            kept=states,
        )


CASE = ("D_mm", "L_mm", "f_mm", "E_MPa", "shear_mm", "depth_mm")
"""Columns that identify the case of a row, in a comparison or a sweep."""
COLUMNS = {key.rpartition("_")[0]: key for key in CASE}
"""These columns by the name of their axis."""


def show(rows: Sequence[FlatRow], title: str, *, wide: bool) -> None:
    """Print the main results of both models; files and a wide table have all columns."""
    if not rows:
        return
    results, errors = _compared(rows[0])
    keys = _main_columns(rows[0])
    varying = [key for key in CASE if len({row.get(key) for row in rows}) > 1]
    first = ("status", *varying, f"fem_{results[0]}", f"analytic_{results[0]}", errors[0])
    brief = [key for key in rows[0] if key not in keys]
    console.report(rows, as_json=False, title=title, brief=brief, first=first, wide=wide)


def _compared(row: FlatRow) -> tuple[tuple[str, str], tuple[str, ...]]:
    """Return the columns' names of the compared results, and the columns of their errors."""
    results = ("force_x_N", "shift_x_mm") if "shear_mm" in row else ("force_N", "shift_z_mm")
    return results, tuple(name.replace("_N", "_error_percent").replace("_mm", "_error_percent") for name in results)


def _main_columns(row: FlatRow) -> tuple[str, ...]:
    """Return the main columns."""
    results, errors = _compared(row)
    answers = [f"{model}_{name}" for name in results for model in ("fem", "fem_homogeneous", "analytic")]
    return (*CASE, *answers, *errors, "fem_tilt_rad", "status")


def idle_axes(rows: Sequence[FlatRow], axes: Mapping[str, Sequence[float]], *, whole: bool) -> list[tuple[str, str]]:
    """Return the axes of a sweep that change no column of the output, each with the reason.

    Parameters
    ----------
    whole : whether the output has all columns (files, JSON, a wide table) or the main ones.
    """
    if not rows:
        return []
    idle = _idle(rows, axes, rows[0])
    reasons = [(name, "the results are the same for all its values") for name in idle]
    hidden = [] if whole else [name for name in _idle(rows, axes, _main_columns(rows[0])) if name not in idle]
    return reasons + [(name, "it changes only columns that --wide, --json and --out show") for name in hidden]


def _idle(rows: Sequence[FlatRow], axes: Mapping[str, Sequence[float]], keys: Iterable[str]) -> list[str]:
    """Return the axes along which none of the columns changes, from solved cases that differ in one axis only."""
    columns = {name: COLUMNS[name] for name in axes}
    figures = [key for key in keys if key not in (*columns.values(), "solve", "seconds")]
    idle = []
    for name in axes:
        others = [column for axis, column in columns.items() if axis != name]
        lines: dict[tuple[Any, ...], list[str]] = {}
        for row in rows:
            if row.get("status") == "ok":
                # compare texts, because a NaN differs from itself
                figure = repr([row.get(key) for key in figures])
                lines.setdefault(tuple(row.get(column) for column in others), []).append(figure)
        if max(map(len, lines.values()), default=0) > 1 and all(len(set(texts)) == 1 for texts in lines.values()):
            idle.append(name)
    return idle
