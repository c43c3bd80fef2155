"""Comparison of the harmonic model on the section with models of tetrahedra, by their own error estimates."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Literal

from fem import equilibrium
from fem.accuracy import LEVELS, Accuracy
from fem.scene import Model, turns
from fem.solution import Solution
from geometry.design import BadInput
from geometry.loads import Load, Magnet
from geometry.messages import Progress
from studies.output.result import Result, Table
from studies.validation import error_study_cases, pages
from studies.validation.pages import Row

FILES = ("CROSSCHECK.md", "crosscheck.csv")
QUANTITIES = ("force", "shift", "tilt", "sideways")
SHEAR = 0.05
"""Shear of a tilted plate over D: with a coefficient of 0.4 some of the contact area slips, and some sticks."""
Friction = float | Literal["none", "stick"]
TILTED: tuple[tuple[int, float, Friction, bool], ...] = (
    (0, 8, "none", False),
    (0, 8, "stick", True),
    (1, 2, "stick", False),
    (1, 2, "stick", True),
    (2, 5, "none", False),
    (3, 12, "stick", False),
    (4, 20, "none", False),
    (5, 3, 0.4, False),
    (6, 15, "stick", False),
    (7, 10, "none", False),
    (8, 6, 0.4, False),
    (9, 18, "stick", False),
    (10, 4, "none", False),
    (11, 16, 0.4, False),
)
"""Loads of tilted plates: design, tilt in degrees, friction, and whether the shear is across the tilt, along y. A
plate without friction only presses. Each kind of load occurs with and without a rigid magnet."""


def run(progress: Progress, level: str, count: int, *, tilted: bool = False) -> Result:
    """Solve each of the first `count` designs at its largest shear, and under TILTED, with both models."""
    if not 1 <= count <= error_study_cases.DESIGNS:
        raise BadInput(f"--count must lie between 1 and {error_study_cases.DESIGNS}; got {count}")
    cases = [
        (number, error_study_cases.trial(number, magnet_of(number), "stick", "auto").loads[-1])
        for number in range(count)
    ]
    cases += [(case[0], tilted_load(*case)) for case in TILTED if tilted and case[0] < count]
    return pages.collected(_compared(progress, cases, LEVELS[level]), result)


def _compared(progress: Progress, cases: Sequence[tuple[int, Load]], accuracy: Accuracy) -> Iterator[Row]:
    for done, (number, load) in enumerate(cases):
        tilt = f", tilt {math.degrees(load.plate_tilt):.3g} degrees" if load.plate_tilt else ""
        progress(done / len(cases), f"design {number}, magnet {magnet_of(number)}{tilt}")
        yield compare(number, magnet_of(number), accuracy, load)


def magnet_of(number: int) -> Magnet:
    """Return the magnet of a design: alternately rigid and ignored."""
    return "rigid" if number % 2 == 0 else "ignored"


def tilted_load(number: int, tilt: float, friction: Friction, across: bool) -> Load:
    """Return a load of TILTED, at the depth of the design's upright case."""
    depth = error_study_cases.trial(number, magnet_of(number), "stick", "auto").loads[-1].depth
    D = error_study_cases.designs()[number].D
    shear = 0.0 if friction == "none" else error_study_cases.rounded(SHEAR * D)
    x, y = (0.0, shear) if across else (shear, 0.0)
    return Load(depth, x, y, friction, plate_tilt=round(math.radians(tilt), 6))


def compare(number: int, magnet: Magnet, accuracy: Accuracy, load: Load) -> Row:
    """Solve one design under a load by the harmonic model and on tetrahedra, and compare the answers."""
    design = error_study_cases.designs()[number]
    solid: Model = "full" if turns([load]) else "half"
    row: Row = {
        "design": number,
        "magnet": magnet,
        "depth_mm": load.depth,
        "shear_mm": load.shear_x,
        "status": "ok",
        "message": "",
        "agree": False,
        "tilt_deg": round(math.degrees(load.plate_tilt), 3),
        "shear_y_mm": load.shear_y,
        "friction": load.friction,
    }
    harmonic, half = (
        equilibrium.solve(design, load, accuracy, magnet=magnet, model=model) for model in ("harmonic", solid)
    )
    more = replace(accuracy, harmonics=accuracy.harmonics + 1)
    one_more = equilibrium.trace(design, [load], more, magnet=magnet, model="harmonic", estimate=False)[-1]
    for state in (harmonic, half, one_more):
        if state.status != "ok":
            return row | {"status": state.status, "message": f"{state.model}: {state.message}"}
    names = [name for name in QUANTITIES if name != "sideways" or load.shear]
    found = {name: difference(name, harmonic, half, one_more) for name in names}
    cost: Row = {"harmonic_dofs": harmonic.dofs, "half_dofs": half.dofs}
    cost |= {"harmonic_s": harmonic.seconds, "half_s": half.seconds}
    flat = {f"{name}_{key}": value for name, parts in found.items() for key, value in parts.items()}
    return row | flat | {"agree": all(parts["agree"] for parts in found.values())} | cost


def difference(name: str, harmonic: Solution, half: Solution, one_more: Solution) -> Row:
    """Return the difference of the models in one quantity, percent of the harmonic answer, and the estimates.

    They agree if the difference is at most the sum of both error estimates; an estimate is NaN if a model has none.

    Parameters
    ----------
    name : one of QUANTITIES.
    one_more : the harmonic answer with one harmonic more on the same mesh.
    """
    a, b, c = (_vector(state, name) for state in (harmonic, half, one_more))
    size = math.hypot(*a)
    estimates = [getattr(state.estimates, name) for state in (harmonic, half)]
    own, other = (math.nan if estimate is None else float(estimate) for estimate in estimates)
    relative = math.dist(a, b) / size
    return {
        "difference_percent": 100 * relative,
        "harmonic_estimate_percent": 100 * own,
        "half_estimate_percent": 100 * other,
        "one_harmonic_more_percent": 100 * math.dist(a, c) / size,
        "agree": relative <= own + other,
    }


def _vector(state: Solution, name: str) -> tuple[float, ...]:
    response, (x, y) = state.response, state.load.direction
    return {
        "force": response.force,
        "shift": response.shift,
        "tilt": (response.tilt, response.tilt_y),
        "sideways": (x * response.force[0] + y * response.force[1],),
    }[name]


def result(rows: Sequence[Row]) -> Result:
    """Return the result of compared loads."""
    loads = "loads" if any(row["tilt_deg"] for row in rows) else "designs"
    failed = [f"design {row['design']}" for row in rows if not row["agree"]]
    where = ("design", "magnet", "depth_mm", "shear_mm", "shear_y_mm", "tilt_deg", "friction", "status")
    parts = ("difference", "harmonic_estimate", "half_estimate", "one_harmonic_more")
    tables: dict[str, Any] = {}
    for name in QUANTITIES:
        heads = {key: key for key in where}
        heads |= {f"{name}_{part}_percent": part.replace("_", " ") for part in parts} | {f"{name}_agree": "agree"}
        tables[name] = [row for row in rows if f"{name}_agree" in row or row["status"] != "ok"], heads
    brief = [{k: v for k, v in row.items() if not k.endswith(("_agree", "_dofs"))} for row in rows]
    return Result(
        title="Harmonic model against tetrahedra",
        records=rows,
        shown=[Table(title="Harmonic model against tetrahedra", rows=brief, places=("design",))],
        tables={"crosscheck": rows},
        pages={"CROSSCHECK.md": pages.rendered("crosscheck.md.j2", rows=rows, loads=loads, tables=tables)},
        failures=pages.failed(failed, len(rows), f"{loads} disagree", ", "),
    )
