"""Every level of the formulas beside finite elements: ten designs, presses, and shears of a plate that sticks.

ABOUT, which the report prints, says how.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from analytic import beam, buckling
from fem import equilibrium
from fem.accuracy import LEVELS
from fem.solution import Solution
from geometry.design import BadInput, Design, paper
from geometry.loads import Load, Magnet, Response
from studies.output.console import Progress
from studies.output.provenance import made

ABOUT = """\
The designs span D, L/D and the magnet (none, small, wide, tall). Four numbers of the press and two of the shear in
the levels above `column` were fitted to finite elements of 18 designs, L/D 0.75 to 4; of those here, only the paper's
sensor is among them. Errors, as root mean squares over the states of a region:

- press force and, also under a shear, sinking of the magnet, relative to the finite elements';
- press force under the shear, relative to that before it;
- shear force, over that of Timoshenko's cantilever of length L under the same shear, k0 delta (the pressed beam's
  own passes through zero where it would give way sideways);
- shift of the magnet, over the shear;
- tilt of the magnet, times R, over the shear.

A state where a level refuses the load, or the finite elements stop, keeps its row with a message and is in no mean.
"""

Row = dict[str, Any]

PRESSES = (0.03, 0.06, 0.12, 0.18, 0.25)
UNDER, SHEARS = (0.06, 0.12, 0.25), (0.05, 0.15, 0.3)
"""Depths of the presses, depths under the shears, and shears, over D."""
ERRORS = {
    "press_force": "press force",
    "sinking": "sinking",
    "press_under_shear": "press under shear",
    "shear_force": "shear force",
    "shift": "shift",
    "tilt": "tilt",
}

REGIONS: dict[str, Callable[[Row], bool]] = {
    "press to 0.06 D": lambda row: not row["shear_over_D"] and row["depth_over_D"] <= 0.06,
    "press to D/4": lambda row: not row["shear_over_D"] and row["depth_over_D"] > 0.06,
    "shear of 0.05 D": lambda row: row["shear_over_D"] == 0.05,
    "shear to 0.3 D": lambda row: row["shear_over_D"] > 0.05,
}


def designs() -> list[Design]:
    """The ten, in order of L/D after the paper's own."""
    shapes = (
        *((8.0, 0.8, 0.3, 0.15), (6.0, 1.25, 0.0, 0.0), (10.0, 1.25, 0.4, 0.4), (8.0, 1.6, 0.0, 0.0)),
        *((5.0, 1.75, 0.6, 0.2), (12.0, 2.25, 0.3, 0.15), (8.0, 2.5, 0.45, 0.5), (6.0, 3.5, 0.0, 0.0)),
        (8.0, 3.5, 0.5, 0.25),
    )
    return [paper(), *(_design(*shape) for shape in shapes)]


def _design(D: float, slenderness: float, diameter: float, height: float) -> Design:
    edge = 0.0125 * D if diameter else 0.0
    L = slenderness * D
    return Design(
        D=D, L=L, l0=L, f=D, magnet_diameter=diameter * D, magnet_height=height * D, magnet_edge_radius=edge
    )


def run(accuracy: str, count: int, progress: Progress) -> Iterator[Row]:
    """A row for each state and level of the first `count` designs, as soon as it is there."""
    for number, design in enumerate(designs()[:count]):
        progress(number / count, f"design {number}: L/D = {design.L / design.D:.3g}")
        for load, state in _states(design, accuracy):
            for level in beam.LEVELS:
                yield _row(number, design, load, state, level)


def _states(design: Design, accuracy: str) -> Iterator[tuple[Load, Solution | None]]:
    """What the finite elements make of each load: presses, then shears at three depths; None if not reached."""
    D = design.D
    magnet: Magnet = "rigid" if design.shape.has_magnet else "ignored"
    paths = [[Load(depth=share * D) for share in PRESSES]]
    paths += [
        [Load(depth=under * D, shear_x=share * D, friction="stick") for share in (0.0, *SHEARS)] for under in UNDER
    ]
    for path in paths:
        states = equilibrium.trace(design, path, LEVELS[accuracy], magnet=magnet, estimate=False)
        reached = {(s.load.depth, s.load.shear_x): s for s in states if s.status in ("ok", "unstable")}
        for load in path:
            if load.shear_x or load.friction == "none":
                yield load, reached.get((load.depth, load.shear_x))


def _row(number: int, design: Design, load: Load, state: Solution | None, level: str) -> Row:
    shape = design.shape
    row: Row = {
        "design": number,
        "D_mm": design.D,
        "L_over_D": design.L / design.D,
        "magnet_diameter_over_D": shape.magnet_diameter / design.D,
        "magnet_height_over_D": shape.magnet_height / design.D,
        "depth_over_D": round(load.depth / design.D, 6),
        "shear_over_D": round(load.shear_x / design.D, 6),
        "level": level,
        "outside": beam.outside(design, load, level),
        "status": "ok",
        "message": "",
    }
    if state is None:
        return row | {"status": "not_converged", "message": "the finite elements do not reach this load"}
    try:
        found = beam.solve(design, load, level)
        before = beam.solve(design, Load(depth=load.depth), level).force[2]
    except BadInput as error:
        return row | {"status": "refused", "message": str(error)}
    return row | _errors(design, load, found, before, state.response)


def _errors(design: Design, load: Load, found: Response, before: float, truth: Response) -> Row:
    """Forces of both, N; shifts, mm; tilts, rad; errors as shares."""
    row: Row = {}
    for name, response in (("", found), ("fem_", truth)):
        row |= {
            f"{name}force_x_N": response.force[0],
            f"{name}force_z_N": response.force[2],
            f"{name}shift_x_mm": response.shift[0],
            f"{name}shift_z_mm": response.shift[2],
            f"{name}tilt_rad": response.tilt,
        }
    row["sinking_error"] = found.shift[2] / truth.shift[2] - 1
    if not load.shear_x:
        return row | {"press_force_error": found.force[2] / truth.force[2] - 1}
    inertia = math.pi * design.D**4 / 64
    cantilever = 1 / (design.L**3 / (3 * design.E * inertia) + design.L / buckling.shear_stiffness(design))
    return row | {
        "press_under_shear_error": (found.force[2] - truth.force[2]) / before,
        "shear_force_error": (found.force[0] - truth.force[0]) / (cantilever * load.shear_x),
        "shift_error": (found.shift[0] - truth.shift[0]) / load.shear_x,
        "tilt_error": (found.tilt - truth.tilt) * design.R / load.shear_x,
    }


def summary(rows: Sequence[Row]) -> list[Row]:
    """Errors of each level by region, percent; and those of the states in the level's own range."""
    table: list[Row] = []
    for level in beam.LEVELS:
        own = [row for row in rows if row["level"] == level and row["status"] == "ok"]
        parts = {region: [row for row in own if within(row)] for region, within in REGIONS.items()}
        parts["in its own range"] = [row for row in own if not row["outside"]] if level != "paper" else []
        table += [
            {"level": level, "region": region, "states": len(part), **_means(part)}
            for region, part in parts.items()
            if part
        ]
    return table


def _means(rows: Sequence[Row]) -> Row:
    """Root mean squares, percent, None where no row has the error."""
    found: Row = {}
    for name in ERRORS:
        values = [row[f"{name}_error"] for row in rows if f"{name}_error" in row]
        found[f"{name}_error_percent"] = (
            100 * math.sqrt(math.fsum(v * v for v in values) / len(values)) if values else None
        )
    return found


def by_design(rows: Sequence[Row], level: str) -> list[Row]:
    """Errors of one level, design by design, percent."""
    table: list[Row] = []
    for number in sorted({row["design"] for row in rows}):
        own = [row for row in rows if (row["design"], row["level"], row["status"]) == (number, level, "ok")]
        if own:
            keys = ("design", "D_mm", "L_over_D", "magnet_diameter_over_D", "magnet_height_over_D")
            table.append({key: own[0][key] for key in keys} | {"states": len(own)} | _means(own))
    return table


def write(folder: Path, rows: Sequence[Row], origin: str, command: str) -> None:
    """ladder.csv, ladder.png and LADDER.md."""
    from studies.output.atomic_files import write_text
    from studies.output.csv_tables import write_table

    write_table(folder / "ladder.csv", rows)
    picture(folder / "ladder.png", rows)
    best = beam.LEVELS[-1]
    lines = ["# The levels of the formulas beside finite elements", "", *ABOUT.splitlines(), ""]
    lines += ["![Errors of the levels](ladder.png)", "", "## By level and region", "", *_markdown(summary(rows)), ""]
    lines += [f"## Level {best} by design", "", *_markdown(by_design(rows, best)), ""]
    lost = {f"- design {row['design']}: {row['message']}" for row in rows if row["message"]}
    write_text(folder / "LADDER.md", "\n".join([*lines, *sorted(lost), "", made(command, origin)]) + "\n")


def _markdown(table: Sequence[Row]) -> list[str]:
    heads = [f"{ERRORS[key[: -len('_error_percent')]]} %" if key.endswith("_percent") else key for key in table[0]]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for row in table:
        cells = ["" if v is None else f"{v:.3g}" if isinstance(v, float) else str(v) for v in row.values()]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def picture(path: Path, rows: Sequence[Row]) -> None:
    """Error of each level over the depth, root mean square of designs and shears, logarithmic."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from studies.output.atomic_files import atomic
    from studies.output.table_plots import COLOURS, STYLE

    over = {"shear_force": " / k₀ δ", "shift": " / δ", "tilt": " R / δ"}
    with mpl.rc_context(STYLE), atomic(path) as temporary:
        figure = Figure(figsize=(11.0, 6.4), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(2, 3, sharex=True).ravel()
        for ax, (name, label) in zip(axes, ERRORS.items(), strict=True):
            for colour, level in zip(COLOURS, beam.LEVELS, strict=False):
                own = [row for row in rows if row["level"] == level and f"{name}_error" in row]
                own = [row for row in own if name != "sinking" or not row["shear_over_D"]]
                x = sorted({row["depth_over_D"] for row in own})
                y = [_means([row for row in own if row["depth_over_D"] == depth]) for depth in x]
                ax.plot(x, [mean[f"{name}_error_percent"] for mean in y], "o-", color=colour, label=level)
            ax.set(yscale="log", ylim=(0.5, 300), title=f"{label}{over.get(name, '')}")
            ax.set_yticks([1, 3, 10, 30, 100], ["1", "3", "10", "30", "100"])
        for ax in axes[3:]:
            ax.set_xlabel("depth / D (1)")
        for ax in axes[::3]:
            ax.set_ylabel("error, rms (%)")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=5, frameon=False)
        figure.savefig(temporary, dpi=160)
