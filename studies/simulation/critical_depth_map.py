"""The critical depth of a press over the slenderness L/D, beside Euler's, Engesser's and Haringx's column.

ABOUT, which the report prints, says how.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from analytic import buckling
from geometry.design import BadInput, Design
from geometry.loads import Magnet
from geometry.messages import Progress
from studies.output.provenance import made

ABOUT = """\
Each length is solved with a free tip (it slides on a frictionless plate) and with a guided tip (its contact area
sticks to a plate that cannot move sideways). All fields but L are the design's; a length that the magnet does not fit
has a row that says so. Depths and forces are given in mm and N, and made dimensionless in the plot.
The depth of a formula is that of Hertz's contact in series with a uniform column under the formula's load.
"""

Row = dict[str, Any]

FIGURES = (
    *("critical_depth_mm", "critical_force_N", "stable_to_mm"),
    *("critical_depth_error_estimate", "critical_force_error_estimate"),
    *("guided_critical_depth_mm", "guided_critical_force_N", "guided_stable_to_mm"),
    *("guided_critical_depth_error_estimate", "guided_critical_force_error_estimate"),
    *("euler_N", "euler_depth_mm", "engesser_N", "engesser_depth_mm", "haringx_N", "haringx_depth_mm"),
)

NEAR = 0.1

FILES = ("stability.csv", "stability.png", "STABILITY.md")
"""What is written into a folder."""


def run(
    design: Design, magnet: Magnet, accuracy: str, slenderness: Sequence[float], progress: Progress
) -> Iterator[Row]:
    """One row for each L/D, as soon as it is there."""
    if magnet == "ignored":
        design = replace(design, magnet_diameter=0.0, magnet_height=0.0, magnet_edge_radius=0.0)
    for i, ratio in enumerate(slenderness):
        progress(i / len(slenderness), f"L/D = {ratio:g}")
        head: Row = {"L_over_D": ratio, "L_mm": ratio * design.D, "magnet": magnet}
        try:
            beam = replace(design, L=ratio * design.D, l0=ratio * design.D)
            yield head | _row(beam, magnet, accuracy)
        except BadInput as error:
            yield head | {"status": "refused"} | dict.fromkeys(FIGURES) | {"message": str(error)}


def _row(beam: Design, magnet: Magnet, accuracy: str) -> Row:
    from fem import stability
    from fem.accuracy import LEVELS

    found: Row = {"status": "ok"}
    said = []
    for name, guided in (("", False), ("guided_", True)):
        critical = stability.critical(beam, magnet, guided=guided, accuracy=LEVELS[accuracy])
        found |= {
            f"{name}critical_depth_mm": critical.depth,
            f"{name}critical_force_N": critical.force,
            f"{name}stable_to_mm": critical.stable_to,
            f"{name}critical_depth_error_estimate": critical.estimates.depth,
            f"{name}critical_force_error_estimate": critical.estimates.force,
        }
        said.append(critical.message)
    formulas: dict[str, Callable[[Design], float]] = {
        "euler": buckling.euler,
        "engesser": buckling.engesser,
        "haringx": buckling.haringx,
    }
    for name, load in formulas.items():
        found |= {f"{name}_N": load(beam), f"{name}_depth_mm": buckling.depth(beam, load(beam))}
    return found | {"message": "; ".join(dict.fromkeys(text for text in said if text))}


def write(folder: Path, design: Design, rows: Sequence[Row], origin: str, command: str) -> None:
    """stability.csv, stability.png and STABILITY.md."""
    from studies.output.atomic_files import write_text
    from studies.output.csv_tables import write_table

    write_table(folder / "stability.csv", rows)
    picture(folder / "stability.png", design, rows)
    lines = ["# Sideways stability of a press over slenderness", "", *ABOUT.splitlines(), ""]
    lines += ["![Critical depth and force over L/D](stability.png)", "", *_table(rows), "", *_sentences(rows), ""]
    write_text(folder / "STABILITY.md", "\n".join([*lines, made(command, origin)]) + "\n")


def _table(rows: Sequence[Row]) -> list[str]:
    names = (
        *("critical_depth_mm", "critical_force_N", "guided_critical_depth_mm", "guided_critical_force_N"),
        *("euler_N", "engesser_N", "haringx_N", "haringx_depth_mm", "stable_to_mm"),
    )
    lines = [f"| L/D | {' | '.join(names)} |", "|---" * (len(names) + 1) + "|"]
    for row in rows:
        cells = [_cell(row, name) for name in names]
        lines.append(f"| {row['L_over_D']:g} | {' | '.join(cells)} |")
    return lines


def _cell(row: Row, name: str) -> str:
    """A number with its estimated error, if it has one."""
    if row.get(name) is None:
        return ""
    error = row.get(f"{name.rpartition('_')[0]}_error_estimate")
    return f"{row[name]:.4g}" + ("" if error is None else f" ± {abs(row[name]) * error:.2g}")


def _sentences(rows: Sequence[Row]) -> list[str]:
    """Where a formula can be trusted, and what was not found."""
    good = [row for row in rows if row.get("critical_force_N") is not None]
    said = []
    for name in ("euler", "engesser", "haringx"):
        for what, key in (("load", f"{name}_N"), ("depth", f"{name}_depth_mm")):
            found = "critical_force_N" if what == "load" else "critical_depth_mm"
            close = [row["L_over_D"] for row in good if abs(row[key] / row[found] - 1) <= NEAR]
            where = "L/D = " + ", ".join(f"{ratio:g}" for ratio in close) if close else "none of these L/D"
            said.append(f"- {name.capitalize()}'s {what} of a free tip is within {NEAR:.0%} at {where}.")
    stable = [row["L_over_D"] for row in rows if row.get("status") == "ok" and row["critical_depth_mm"] is None]
    if stable:
        where = ", ".join(f"{ratio:g}" for ratio in stable)
        said.append(f"- No instability of a free tip down to `stable_to_mm` at L/D = {where}.")
    return said + [f"- L/D = {row['L_over_D']:g}: {row['message']}." for row in rows if row["message"]]


def picture(path: Path, design: Design, rows: Sequence[Row]) -> None:
    """Critical depth over the length, and critical force over E D^2, against L/D."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from studies.output.atomic_files import atomic
    from studies.output.table_plots import ANALYTIC, COLOURS, FEM, HOMOGENEOUS, STYLE

    good = [row for row in rows if row["status"] == "ok"]
    x = [row["L_over_D"] for row in good]
    scale = design.E * design.D**2
    looks: dict[str, Any] = {
        "critical": ("FEM, free tip", {"color": FEM, "marker": "o"}),
        "guided_critical": ("FEM, guided tip", {"color": HOMOGENEOUS, "marker": "s", "markerfacecolor": "white"}),
        "haringx": ("Haringx, free tip", {"color": ANALYTIC, "linestyle": "--"}),
        "euler": ("Euler, free tip", {"color": COLOURS[3], "linestyle": ":"}),
        "engesser": ("Engesser, free tip", {"color": COLOURS[4], "linestyle": "-."}),
    }
    with mpl.rc_context(STYLE), atomic(path) as temporary:
        figure = Figure(figsize=(9.0, 4.0), layout="constrained")
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2, sharex=True)
        for name, (label, look) in looks.items():
            depth = [_over(row[f"{name}_depth_mm"], row["L_mm"]) for row in good]
            force = [_over(row[f"{name}_force_N" if "critical" in name else f"{name}_N"], scale) for row in good]
            if any(math.isfinite(value) for value in (*depth, *force)):
                left.plot(x, depth, **look)
                right.plot(x, force, label=label, **look)
        left.set(xscale="log", yscale="log", xlabel="L/D (1)", ylabel="critical depth / L (1)")
        right.set(xscale="log", yscale="log", xlabel="L/D (1)", ylabel="critical force / E D² (1)")
        left.set_ylim(top=1)
        right.set_ylim(top=3)
        left.set_xticks([0.6, 1, 2, 3, 5, 10], ["0.6", "1", "2", "3", "5", "10"], minor=False)
        left.minorticks_off()
        right.minorticks_off()
        if right.lines:
            figure.legend(loc="outside upper center", ncols=3, frameon=False)
        figure.savefig(temporary, dpi=200)


def _over(value: float | None, scale: float) -> float:
    return math.nan if value is None else value / scale
