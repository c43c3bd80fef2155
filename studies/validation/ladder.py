"""Every level of the formulas beside finite elements: ten designs, presses and shears of a glued plate."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial

from analytic import beam, buckling
from fem import equilibrium
from fem.accuracy import LEVELS
from fem.solution import Solution
from geometry.design import BadInput, Design, paper
from geometry.loads import Load, Magnet, Response
from geometry.messages import Progress
from studies.output.figures import picture
from studies.output.goals import Goal, failures, page_lines
from studies.output.result import Result, Table
from studies.report import verdict_figures
from studies.validation import pages
from studies.validation.pages import Row

FILES = ("LADDER.md", "ladder.csv", "ladder.png")
PRESSES = (0.03, 0.06, 0.12, 0.18, 0.25)
UNDER, SHEARS = (0.06, 0.12, 0.25), (0.05, 0.15, 0.3)
"""Depths of the presses, depths under the shears, and shears, over D."""
ERRORS = ("press_force", "sinking", "press_under_shear", "shear_force", "shift", "tilt")
"""Quantities whose relative error is a column, as ladder.md.j2 defines it; one that does not apply is missing."""
PANELS = ("press force", "sinking", "press under shear", "shear force / k₀ δ", "shift / δ", "tilt R / δ")
REGIONS: dict[str, Callable[[Row], bool]] = {
    "press to 0.06 D": lambda row: not row["shear_over_D"] and row["depth_over_D"] <= 0.06,
    "press to D/4": lambda row: not row["shear_over_D"] and row["depth_over_D"] > 0.06,
    "shear of 0.05 D": lambda row: row["shear_over_D"] == 0.05,
    "shear to 0.3 D": lambda row: row["shear_over_D"] > 0.05,
    "in its own range": lambda row: not row["outside"] and row["level"] != "paper",
}


def designs() -> list[Design]:
    """Return the paper's design and nine others in order of L/D."""
    shapes = (
        *((8.0, 0.8, 0.3, 0.15), (6.0, 1.25, 0.0, 0.0), (10.0, 1.25, 0.4, 0.4), (8.0, 1.6, 0.0, 0.0)),
        *((5.0, 1.75, 0.6, 0.2), (12.0, 2.25, 0.3, 0.15), (8.0, 2.5, 0.45, 0.5), (6.0, 3.5, 0.0, 0.0)),
        (8.0, 3.5, 0.5, 0.25),
    )
    return [paper(), *(_design(*shape) for shape in shapes)]


def _design(D: float, slenderness: float, diameter: float, height: float) -> Design:
    L, edge = slenderness * D, 0.0125 * D if diameter else 0.0
    return Design(
        D=D, L=L, l0=L, f=D, magnet_diameter=diameter * D, magnet_height=height * D, magnet_edge_radius=edge
    )


def run(progress: Progress, accuracy: str, count: int) -> Result:
    """Compare every level with the states of the first `count` designs."""
    most = len(designs())
    if not 1 <= count <= most:
        raise BadInput(f"--count must lie between 1 and {most}; got {count}")
    return pages.collected(_compared(progress, accuracy, count), result)


def _compared(progress: Progress, accuracy: str, count: int) -> Iterator[Row]:
    for number, design in enumerate(designs()[:count]):
        progress(number / count, f"design {number}: L/D = {design.L / design.D:.3g}")
        for load, state in _states(design, accuracy):
            yield from (compare(number, design, load, state, level) for level in beam.LEVELS)


def _states(design: Design, accuracy: str) -> Iterator[tuple[Load, Solution | None]]:
    """Yield each load with its finite-element solution, or None: presses, then shears at three depths."""
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


def compare(number: int, design: Design, load: Load, state: Solution | None, level: str) -> Row:
    """Compare a level of the formulas with the state of the finite elements (None: load not reached)."""
    D, shape = design.D, design.shape
    row: Row = {
        "design": number,
        "D_mm": D,
        "L_over_D": design.L / D,
        "magnet_diameter_over_D": shape.magnet_diameter / D,
        "magnet_height_over_D": shape.magnet_height / D,
        "depth_over_D": round(load.depth / D, 6),
        "shear_over_D": round(load.shear_x / D, 6),
        "level": level,
        "outside": beam.outside(design, load, level),
    }
    if state is None:
        return row | {"status": "not_converged", "message": "the finite elements do not reach this load"}
    try:
        response = beam.solve(design, load, level)
        before = beam.solve(design, Load(depth=load.depth), level).force[2]
    except BadInput as error:
        return row | {"status": "refused", "message": str(error)}
    row |= {"status": "ok", "message": "", **_motion("", response), **_motion("fem_", state.response)}
    return row | {f"{name}_error": e for name, e in _errors(design, load, response, before, state.response).items()}


def _motion(prefix: str, response: Response) -> Row:
    (force_x, _, force_z), (shift_x, _, shift_z) = response.force, response.shift
    values = {"force_x_N": force_x, "force_z_N": force_z, "shift_x_mm": shift_x, "shift_z_mm": shift_z}
    return {f"{prefix}{name}": value for name, value in (values | {"tilt_rad": response.tilt}).items()}


def _errors(design: Design, load: Load, formula: Response, before: float, fem: Response) -> dict[str, float]:
    """Return the relative errors of a formula.

    Parameters
    ----------
    before : press force of the formula before the shear, N.
    """
    sinking = {"sinking": formula.shift[2] / fem.shift[2] - 1}
    if not load.shear_x:
        return sinking | {"press_force": formula.force[2] / fem.force[2] - 1}
    cantilever = buckling.sideways_stiffness(design)
    return sinking | {
        "press_under_shear": (formula.force[2] - fem.force[2]) / before,
        "shear_force": (formula.force[0] - fem.force[0]) / (cantilever * load.shear_x),
        "shift": (formula.shift[0] - fem.shift[0]) / load.shear_x,
        "tilt": (formula.tilt - fem.tilt) * design.R / load.shear_x,
    }


def means(rows: Sequence[Row]) -> Row:
    """Return the root mean squares of the errors of several states, percent; None if no state has the error."""
    return {f"{name}_error_percent": _rms([row.get(f"{name}_error") for row in rows]) for name in ERRORS}


def _rms(shares: Sequence[float | None]) -> float | None:
    values = [share for share in shares if share is not None]
    return 100 * math.sqrt(math.fsum(v * v for v in values) / len(values)) if values else None


def summary(rows: Sequence[Row]) -> list[Row]:
    """Return the errors of each level in each region, and in the level's own range."""
    table = []
    for level in beam.LEVELS:
        for region, inside in REGIONS.items():
            own = [row for row in rows if (row["level"], row["status"]) == (level, "ok") and inside(row)]
            if own:
                table.append({"level": level, "region": region, "states": len(own), **means(own)})
    return table


def by_design(rows: Sequence[Row], level: str) -> list[Row]:
    """Return the errors of one level for each design."""
    sizes = ("design", "D_mm", "L_over_D", "magnet_diameter_over_D", "magnet_height_over_D")
    groups: dict[int, list[Row]] = {}
    for row in rows:
        if (row["level"], row["status"]) == (level, "ok"):
            groups.setdefault(row["design"], []).append(row)
    return [{**{name: own[0][name] for name in sizes}, "states": len(own), **means(own)} for own in groups.values()]


def goals(rows: Sequence[Row]) -> list[Goal]:
    """Return the goals of the study: each level is compared with finite elements in every state that it takes."""
    posed = []
    for level in beam.LEVELS:
        own = [row for row in rows if row["level"] == level and row["status"] != "refused"]
        lost = sum(row["status"] != "ok" for row in own)
        posed.append(Goal(f"level {level}, states without a comparison", lost, 0, len(own)))
    return posed


def result(rows: Sequence[Row]) -> Result:
    """Return the result of compared states."""
    title, posed = "Errors of the formulas, root mean square", goals(rows)
    heads = {f"{name}_error_percent": f"{name.replace('_', ' ')} %" for name in ERRORS}
    regions = {name: name for name in ("level", "region", "states")} | heads
    best = beam.LEVELS[-1]
    designs = by_design(rows, best)
    page = pages.rendered(
        "ladder.md.j2",
        verdict=page_lines(posed),
        summary=summary(rows),
        regions=regions,
        best=best,
        designs=designs,
        heads={name: heads.get(name, name) for name in designs[0]} if designs else {},
        stopped=sorted({f"design {row['design']}: {row['message']}" for row in rows if row["message"]}),
    )
    return Result(
        title=title,
        records=rows,
        shown=[Table(title=title, rows=summary(rows))],
        tables={"ladder": rows},
        files={"ladder.png": partial(picture, rows=rows, draw=verdict_figures.ladder)},
        pages={"LADDER.md": page},
        failures=failures(posed),
    )
