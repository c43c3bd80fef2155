"""Statistics of the errors of the formulas' levels, and the files of `ladder`: ladder.csv, ladder.png, LADDER.md."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from analytic import beam
from studies.output import records
from studies.output.goals import Goal, page_lines
from studies.output.provenance import made
from studies.output.records import FlatRow
from studies.validation import formula_levels
from studies.validation.formula_levels import Comparison, Errors


@dataclass(frozen=True, slots=True)
class Means:
    """Root mean squares of errors, percent; None if no state has this error."""

    press_force_error_percent: float | None
    sinking_error_percent: float | None
    press_under_shear_error_percent: float | None
    shear_force_error_percent: float | None
    shift_error_percent: float | None
    tilt_error_percent: float | None


@dataclass(frozen=True, slots=True)
class RegionErrors:
    """Errors of a level in a region of loads."""

    level: str
    region: str
    states: int
    means: Means = field(metadata={"prefix": ""})

    def row(self) -> FlatRow:
        """Return the columns of the printed table and of LADDER.md."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class DesignErrors:
    """Errors of a level on a design."""

    design: int
    D_mm: float
    L_over_D: float
    magnet_diameter_over_D: float
    magnet_height_over_D: float
    states: int
    means: Means = field(metadata={"prefix": ""})

    def row(self) -> FlatRow:
        """Return the columns of LADDER.md."""
        return records.flat(self)


REGIONS: dict[str, Callable[[Comparison], bool]] = {
    "press to 0.06 D": lambda c: not c.shear_over_D and c.depth_over_D <= 0.06,
    "press to D/4": lambda c: not c.shear_over_D and c.depth_over_D > 0.06,
    "shear of 0.05 D": lambda c: c.shear_over_D == 0.05,
    "shear to 0.3 D": lambda c: c.shear_over_D > 0.05,
}

HEADS = {
    "press_force_error_percent": "press force %",
    "sinking_error_percent": "sinking %",
    "press_under_shear_error_percent": "press under shear %",
    "shear_force_error_percent": "shear force %",
    "shift_error_percent": "shift %",
    "tilt_error_percent": "tilt %",
}
"""Heads in LADDER.md of columns that are not headed by their names."""


def summary(comparisons: Sequence[Comparison]) -> list[RegionErrors]:
    """Return the errors of each level in each region, and in the level's own range."""
    table: list[RegionErrors] = []
    for level in beam.LEVELS:
        own = [c for c in comparisons if c.level == level and c.status == "ok"]
        parts = {region: [c for c in own if within(c)] for region, within in REGIONS.items()}
        parts["in its own range"] = [c for c in own if not c.outside] if level != "paper" else []
        table += [RegionErrors(level, region, len(part), means(part)) for region, part in parts.items() if part]
    return table


def goals(comparisons: Sequence[Comparison]) -> list[Goal]:
    """Return the goals of the study: each level is compared with finite elements in every state that it takes."""
    posed = []
    for level in beam.LEVELS:
        own = [c for c in comparisons if c.level == level and c.status != "refused"]
        lost = sum(c.errors is None for c in own)
        posed.append(Goal(f"level {level}, states without a comparison", lost, 0, len(own)))
    return posed


def means(comparisons: Iterable[Comparison]) -> Means:
    """Return the root mean squares of the errors of several states."""
    errors = [c.errors for c in comparisons if c.errors is not None]
    return Means(
        press_force_error_percent=_root_mean_square(e.press_force_error for e in errors),
        sinking_error_percent=_root_mean_square(e.sinking_error for e in errors),
        press_under_shear_error_percent=_root_mean_square(e.press_under_shear_error for e in errors),
        shear_force_error_percent=_root_mean_square(e.shear_force_error for e in errors),
        shift_error_percent=_root_mean_square(e.shift_error for e in errors),
        tilt_error_percent=_root_mean_square(e.tilt_error for e in errors),
    )


def _root_mean_square(shares: Iterable[float | None]) -> float | None:
    """Return the root mean square of the values that are not None, percent; None if all are None."""
    values = [share for share in shares if share is not None]
    return 100 * math.sqrt(math.fsum(v * v for v in values) / len(values)) if values else None


def by_design(comparisons: Sequence[Comparison], level: str) -> list[DesignErrors]:
    """Return the errors of one level for each design."""
    table: list[DesignErrors] = []
    for number in sorted({c.design for c in comparisons}):
        own = [c for c in comparisons if (c.design, c.level, c.status) == (number, level, "ok")]
        if own:
            first = own[0]
            sizes = first.D_mm, first.L_over_D, first.magnet_diameter_over_D, first.magnet_height_over_D
            table.append(DesignErrors(number, *sizes, len(own), means(own)))
    return table


def write(folder: Path, comparisons: Sequence[Comparison], origin: str, command: str) -> None:
    """Write ladder.csv, ladder.png and LADDER.md."""
    from studies.output.atomic_files import write_text
    from studies.output.csv_tables import write_table

    write_table(folder / "ladder.csv", [c.row() for c in comparisons])
    picture(folder / "ladder.png", comparisons)
    best = beam.LEVELS[-1]
    regions = [errors.row() for errors in summary(comparisons)]
    designs = [errors.row() for errors in by_design(comparisons, best)]
    lines = ["# Levels of the formulas compared with finite elements", "", *page_lines(goals(comparisons)), ""]
    lines += [*formula_levels.ABOUT.splitlines(), ""]
    lines += ["![Errors of the levels](ladder.png)", "", "## By level and region", "", *_markdown(regions), ""]
    lines += [f"## Level {best} by design", "", *_markdown(designs), ""]
    stopped = {f"- design {c.design}: {c.message}" for c in comparisons if c.message}
    write_text(folder / "LADDER.md", "\n".join([*lines, *sorted(stopped), "", made(command, origin)]) + "\n")


def _markdown(table: Sequence[FlatRow]) -> list[str]:
    heads = [HEADS.get(name, name) for name in table[0]]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for row in table:
        cells = ["" if v is None else f"{v:.3g}" if isinstance(v, float) else str(v) for v in row.values()]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


PANELS: tuple[tuple[str, Callable[[Comparison, Errors], float | None]], ...] = (
    ("press force", lambda c, e: e.press_force_error),
    ("sinking", lambda c, e: None if c.shear_over_D else e.sinking_error),
    ("press under shear", lambda c, e: e.press_under_shear_error),
    ("shear force / k₀ δ", lambda c, e: e.shear_force_error),
    ("shift / δ", lambda c, e: e.shift_error),
    ("tilt R / δ", lambda c, e: e.tilt_error),
)
"""Title of each panel of the picture, and the error that it shows."""


def picture(path: Path, comparisons: Sequence[Comparison]) -> None:
    """Plot the error of each level over the depth: root mean square over designs and shears, logarithmic axis."""
    from studies.output.table_plots import COLOURS, sheet

    with sheet(path, 11.0, 6.4, dpi=160) as figure:
        axes = figure.subplots(2, 3, sharex=True).ravel()
        for ax, (title, error) in zip(axes, PANELS, strict=True):
            for colour, level in zip(COLOURS, beam.LEVELS, strict=False):
                own = [c for c in comparisons if c.level == level]
                shares = [(c.depth_over_D, error(c, c.errors)) for c in own if c.errors is not None]
                depths = sorted({depth for depth, share in shares if share is not None})
                rms = [_root_mean_square(share for at, share in shares if at == depth) for depth in depths]
                ax.plot(depths, rms, "o-", color=colour, label=level)
            ax.set(yscale="log", ylim=(0.5, 300), title=title)
            ax.set_yticks([1, 3, 10, 30, 100], ["1", "3", "10", "30", "100"])
        for ax in axes[3:]:
            ax.set_xlabel("depth / D")
        for ax in axes[::3]:
            ax.set_ylabel("error, rms (%)")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=5, frameon=False)
