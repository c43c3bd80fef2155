"""What `magtip sweep` is asked for, by a study or by options, and what tables on the screen show of its rows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet
from geometry.messages import Progress
from studies.inputs import user_input
from studies.output import atomic_files, console
from studies.output.records import FlatRow

if TYPE_CHECKING:
    from studies.exploration.sweep_rows import SweepRow

FILES = ("sweep.csv", "sweep.png")
"""What a sweep writes into a folder."""


@dataclass(frozen=True, slots=True)
class Grid:
    """What a sweep is asked for."""

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
    """What a sweep is asked for: by a study, or by axes and a design, with the options that replace its values."""
    if source is not None and design is not None:
        raise BadInput(f"the design is given twice, {source!r} and --design {design!r}: give one of them")
    if source is not None and user_input.is_study(source):
        if axes:
            raise BadInput(f"the study {source!r} has its own axes: leave --axis out, or give a design instead")
        study = user_input.read_study(source)
        depth, accuracy = depth if depth is not None else study.depth, accuracy or study.accuracy
        magnet, values = magnet or study.magnet or "rigid", study.axes
        varied = user_input.study_design(study, sets, magnet=magnet)
    else:
        if not axes:
            raise BadInput(
                "a sweep needs at least one axis: add --axis NAME=a,b,c, or give a study file with a table [axes]"
            )
        magnet, values = magnet or "rigid", user_input.parse_axes(axes)
        varied = user_input.read_design(source or design or "paper", sets, magnet=magnet)
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
    return Grid(varied, values, depth or 0.0, magnet, accuracy or "standard")


def sweep(grid: Grid, out: Path | None, progress: Progress, kept: Path | None = None) -> Iterator[SweepRow]:
    """The rows of a sweep, each as soon as it is solved; `kept` is the store of solved states, or the user's."""
    from fem.accuracy import LEVELS
    from studies.exploration import store
    from studies.exploration import sweep as work

    level = LEVELS[grid.accuracy]
    with store.opened(kept or store.default()) as states, atomic_files.results(out) as folder:
        yield from work.run(
            grid.design,
            grid.axes,
            folder,
            depth=grid.depth,
            magnet=grid.magnet,
            accuracy=level,
            progress=progress,
            kept=states,
        )


CASE = ("D_mm", "L_mm", "f_mm", "E_MPa", "shear_mm", "depth_mm")
"""Keys of what a row of a comparison or a sweep is of."""
COLUMNS = {key.rpartition("_")[0]: key for key in CASE}
"""The same by the axis."""


def show(rows: Sequence[FlatRow], title: str, *, wide: bool) -> None:
    """Print rows of a comparison or a sweep: both models' main answers; files and a wide table have the rest."""
    if not rows:
        return
    judged, errors = _judged(rows[0])
    keys = _main(rows[0])
    varying = [key for key in CASE if len({row.get(key) for row in rows}) > 1]
    first = ("status", *varying, f"fem_{judged[0]}", f"analytic_{judged[0]}", errors[0])
    brief = [key for key in rows[0] if key not in keys]
    console.report(rows, as_json=False, title=title, brief=brief, first=first, wide=wide)


def _judged(row: FlatRow) -> tuple[tuple[str, str], tuple[str, ...]]:
    """The answers that are compared, and their errors."""
    judged = ("force_x_N", "shift_x_mm") if "shear_mm" in row else ("force_N", "shift_z_mm")
    return judged, tuple(name.replace("_N", "_error_percent").replace("_mm", "_error_percent") for name in judged)


def _main(row: FlatRow) -> tuple[str, ...]:
    """Keys of the main figures."""
    judged, errors = _judged(row)
    answers = [f"{model}_{name}" for name in judged for model in ("fem", "fem_homogeneous", "analytic")]
    return (*CASE, *answers, *errors, "fem_tilt_rad", "status")


def in_vain(rows: Sequence[FlatRow], axes: Mapping[str, Sequence[float]], *, whole: bool) -> list[tuple[str, str]]:
    """Axes of a sweep that change none of the figures that are given, and why.

    Parameters
    ----------
    whole : whether all figures are given, as in files, in JSON and in a wide table, or the main ones.
    """
    if not rows:
        return []
    none = _unmoved(rows, axes, rows[0])
    reasons = [(name, "the results are the same for all its values") for name in none]
    hidden = [] if whole else [name for name in _unmoved(rows, axes, _main(rows[0])) if name not in none]
    return reasons + [(name, "it changes only columns that --wide, --json and --out show") for name in hidden]


def _unmoved(rows: Sequence[FlatRow], axes: Mapping[str, Sequence[float]], keys: Iterable[str]) -> list[str]:
    """Axes along which no figure changes, of the cases that are solved and differ in nothing else."""
    columns = {name: COLUMNS[name] for name in axes}
    figures = [key for key in keys if key not in (*columns.values(), "solve", "seconds")]
    unmoved = []
    for name in axes:
        others = [column for axis, column in columns.items() if axis != name]
        seen: dict[tuple[Any, ...], list[str]] = {}
        for row in rows:
            if row.get("status") == "ok":
                # as texts, for a NaN differs from itself
                figure = repr([row.get(key) for key in figures])
                seen.setdefault(tuple(row.get(column) for column in others), []).append(figure)
        if max(map(len, seen.values()), default=0) > 1 and all(len(set(texts)) == 1 for texts in seen.values()):
            unmoved.append(name)
    return unmoved
