"""The critical depth of a press over the slenderness L/D, compared with Euler's, Engesser's and Haringx's column.

`ABOUT` is the explanation that STABILITY.md prints.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analytic import buckling
from geometry.design import BadInput, Design
from geometry.loads import Magnet
from geometry.messages import Progress
from studies.output import records
from studies.output.provenance import made
from studies.output.records import FlatRow

if TYPE_CHECKING:
    from fem.analyses.stability import Critical

ABOUT = """\
Each length is solved with a free tip (it slides on a frictionless plate) and with a guided tip (its contact area
sticks to a plate that cannot move sideways). All fields but L are the design's; a length that the magnet does not fit
has a row that says so. Depths and forces are given in mm and N, and made dimensionless in the plot.
The depth of a formula is that of Hertz's contact in series with a uniform column under the formula's load.
"""


@dataclass(frozen=True, slots=True)
class CriticalPoint:
    """Critical depth and force of one tip; both None if the press is stable down to `stable_to_mm`."""

    critical_depth_mm: float | None = None
    critical_force_N: float | None = None
    stable_to_mm: float | None = None
    critical_depth_error_estimate: float | None = None
    critical_force_error_estimate: float | None = None


@dataclass(frozen=True, slots=True)
class ColumnLoad:
    """Buckling load of a column by a formula, and the depth of a press with this force."""

    force_N: float | None = field(default=None, metadata={"column": "N"})
    depth_mm: float | None = None


@dataclass(frozen=True, slots=True)
class SlendernessRow:
    """Critical points and column loads at one L/D; without them if the design of this length is refused.

    Attributes
    ----------
    status : "ok", "refused", or "unknown" where a search ended before its last depth.
    """

    L_over_D: float
    L_mm: float
    magnet: Magnet
    status: str
    free: CriticalPoint = field(default=CriticalPoint(), metadata={"prefix": ""})
    guided: CriticalPoint = field(default=CriticalPoint(), metadata={"prefix": "guided_"})
    euler: ColumnLoad = field(default=ColumnLoad(), metadata={"prefix": "euler_"})
    engesser: ColumnLoad = field(default=ColumnLoad(), metadata={"prefix": "engesser_"})
    haringx: ColumnLoad = field(default=ColumnLoad(), metadata={"prefix": "haringx_"})
    message: str = ""

    def row(self) -> FlatRow:
        """Return the flat row for tables, CSV files and JSON."""
        return records.flat(self)

    @property
    def formulas(self) -> dict[str, ColumnLoad]:
        """Column loads by the name of their formula."""
        return {"euler": self.euler, "engesser": self.engesser, "haringx": self.haringx}


SLENDERNESS = (0.3, 0.6, 1, 2, 3, 5, 10, 20)
"""L/D at which the picture has a number."""
HIGHEST_DEPTH, HIGHEST_FORCE = 1.0, 3.0
"""Upper ends of the picture, depth over L and force over E D^2: formulas of short beams run beyond them."""
NEAR = 0.1
"""Relative difference up to which the report calls a formula close to the finite elements."""

FILES = ("stability.csv", "stability.png", "STABILITY.md")
"""Files that `write` writes into a folder."""


def run(
    design: Design, magnet: Magnet, accuracy: str, slenderness: Sequence[float], progress: Progress
) -> Iterator[SlendernessRow]:
    """Yield the row of each L/D as soon as it is solved."""
    if magnet == "ignored":
        design = replace(design, magnet_diameter=0.0, magnet_height=0.0, magnet_edge_radius=0.0)
    for i, ratio in enumerate(slenderness):
        progress(i / len(slenderness), f"L/D = {ratio:g}")
        length = ratio * design.D
        try:
            yield _solve(replace(design, L=length, l0=length), magnet, accuracy, ratio)
        except BadInput as error:
            yield SlendernessRow(ratio, length, magnet, "refused", message=str(error))


def _solve(beam: Design, magnet: Magnet, accuracy: str, ratio: float) -> SlendernessRow:
    from fem.accuracy import LEVELS
    from fem.analyses import stability

    free, guided = (
        stability.critical(beam, magnet, guided=guided, accuracy=LEVELS[accuracy]) for guided in (False, True)
    )
    euler, engesser, haringx = (
        ColumnLoad(load, buckling.depth(beam, load))
        for load in (buckling.euler(beam), buckling.engesser(beam), buckling.haringx(beam))
    )
    # both searches may end for the same reason, which is then named once
    messages = dict.fromkeys(text for text in (free.message, guided.message) if text)
    return SlendernessRow(
        L_over_D=ratio,
        L_mm=beam.L,
        magnet=magnet,
        status="unknown" if messages else "ok",
        free=_critical_point(free),
        guided=_critical_point(guided),
        euler=euler,
        engesser=engesser,
        haringx=haringx,
        message="; ".join(messages),
    )


def _critical_point(critical: Critical) -> CriticalPoint:
    return CriticalPoint(
        critical.depth,
        critical.force,
        critical.stable_to,
        critical.estimates.depth,
        critical.estimates.force,
    )


def write(folder: Path, design: Design, rows: Sequence[SlendernessRow], origin: str, command: str) -> None:
    """Write stability.csv, stability.png and STABILITY.md into an existing folder."""
    from studies.output.atomic_files import write_text
    from studies.output.csv_tables import write_table

    write_table(folder / "stability.csv", [row.row() for row in rows])
    picture(folder / "stability.png", design, rows)
    lines = ["# Sideways stability of a press over slenderness", "", *ABOUT.splitlines(), ""]
    lines += ["![Critical depth and force over L/D](stability.png)", "", *_table(rows), "", *_sentences(rows), ""]
    write_text(folder / "STABILITY.md", "\n".join([*lines, made(command, origin)]) + "\n")


def _table(rows: Sequence[SlendernessRow]) -> list[str]:
    names = (
        *("critical_depth_mm", "critical_force_N", "guided_critical_depth_mm", "guided_critical_force_N"),
        *("euler_N", "engesser_N", "haringx_N", "haringx_depth_mm", "stable_to_mm"),
    )
    lines = [f"| L/D | {' | '.join(names)} |", "|---" * (len(names) + 1) + "|"]
    for each in rows:
        row = each.row()
        lines.append(f"| {each.L_over_D:g} | {' | '.join(_cell(row, name) for name in names)} |")
    return lines


def _cell(row: FlatRow, name: str) -> str:
    """Format a value, with its estimated error where there is one."""
    if row[name] is None:
        return ""
    error = row.get(f"{name.rpartition('_')[0]}_error_estimate")
    return f"{row[name]:.4g}" + ("" if error is None else f" ± {abs(row[name]) * error:.2g}")


def _sentences(rows: Sequence[SlendernessRow]) -> list[str]:
    """Return where each formula is close to the finite elements, and where no instability was found."""
    sentences = []
    for name in ("euler", "engesser", "haringx"):
        loads = [(row.L_over_D, row.formulas[name].force_N, row.free.critical_force_N) for row in rows]
        depths = [(row.L_over_D, row.formulas[name].depth_mm, row.free.critical_depth_mm) for row in rows]
        for quantity, values in (("load", loads), ("depth", depths)):
            close = [ratio for ratio, formula, fem in values if _close(formula, fem)]
            where = "L/D = " + ", ".join(f"{ratio:g}" for ratio in close) if close else "none of these L/D"
            sentences.append(f"- {name.capitalize()}'s {quantity} of a free tip is within {NEAR:.0%} at {where}.")
    stable = [row.L_over_D for row in rows if row.status == "ok" and row.free.critical_depth_mm is None]
    if stable:
        where = ", ".join(f"{ratio:g}" for ratio in stable)
        sentences.append(f"- No instability of a free tip down to `stable_to_mm` at L/D = {where}.")
    return sentences + [f"- L/D = {row.L_over_D:g}: {row.message}." for row in rows if row.message]


def _close(formula: float | None, fem: float | None) -> bool:
    return formula is not None and fem is not None and abs(formula / fem - 1) <= NEAR


def picture(path: Path, design: Design, rows: Sequence[SlendernessRow]) -> None:
    """Plot critical depth over L, and critical force over E D^2, against L/D."""
    from matplotlib.ticker import NullLocator

    from studies.output.table_plots import ANALYTIC, COLOURS, FEM, HOMOGENEOUS, log_numbers, sheet

    solved = [row for row in rows if row.status != "refused"]
    x = [row.L_over_D for row in solved]
    values = [row.row() for row in solved]
    scale = design.E * design.D**2
    looks: dict[str, Any] = {
        "critical": ("FEM, free tip", {"color": FEM, "marker": "o"}),
        "guided_critical": ("FEM, guided tip", {"color": HOMOGENEOUS, "marker": "s", "markerfacecolor": "white"}),
        "haringx": ("Haringx, free tip", {"color": ANALYTIC, "linestyle": "--"}),
        "euler": ("Euler, free tip", {"color": COLOURS[3], "linestyle": ":"}),
        "engesser": ("Engesser, free tip", {"color": COLOURS[4], "linestyle": "-."}),
    }
    with sheet(path, 7.0, 3.9) as figure:
        left, right = figure.subplots(1, 2, sharex=True)
        for name, (label, look) in looks.items():
            column = f"{name}_force_N" if "critical" in name else f"{name}_N"
            depth = [_over(value[f"{name}_depth_mm"], value["L_mm"]) for value in values]
            force = [_over(value[column], scale) for value in values]
            if any(math.isfinite(value) for value in (*depth, *force)):
                left.plot(x, depth, **look)
                right.plot(x, force, label=label, **look)
        stable = [
            _over(row.free.stable_to_mm if row.free.critical_depth_mm is None else None, row.L_mm) for row in solved
        ]
        if any(map(math.isfinite, stable)):
            look = {"color": FEM, "marker": "^", "markersize": 7, "markerfacecolor": "white", "linestyle": "none"}
            left.plot(x, stable, label="FEM, free tip: stable at least to here", **look)
        left.set_ylabel("critical depth / $L$")
        right.set_ylabel("critical force / ($E D^2$)")
        for axis, highest in ((left, HIGHEST_DEPTH), (right, HIGHEST_FORCE)):
            axis.set(xscale="log", yscale="log", xlabel="slenderness $L/D$")
            axis.set_ylim(top=highest)
            log_numbers(axis, "y")
        low, high = (min(x, default=1) * 0.93, max(x, default=10) * 1.07)
        left.set_xlim(low, high)
        ticks = [tick for tick in SLENDERNESS if low <= tick <= high]
        left.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        left.xaxis.set_minor_locator(NullLocator())
        if right.lines:
            entries = {line.get_label(): line for axis in (right, left) for line in axis.lines}
            named = [entry for name, entry in entries.items() if not name.startswith("_")]
            figure.legend(handles=named, loc="outside upper center", ncols=2, frameon=False)


def _over(value: float | None, scale: float) -> float:
    """Divide a value by its scale; NaN without a value."""
    return math.nan if value is None else value / scale
