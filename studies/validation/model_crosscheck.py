"""Comparison of the harmonic model on the section with models of tetrahedra (verb crosscheck).

ABOUT, which the report prints, says which loads are compared, and when two answers agree.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from fem import equilibrium
from fem.accuracy import LEVELS, Accuracy
from fem.scene import Model, turns
from fem.solution import Solution
from geometry.design import Design
from geometry.loads import Load, Magnet
from geometry.messages import Progress
from studies.validation import error_study_cases, pages
from studies.validation.pages import Row

ABOUT = """\
Twelve designs, alternately with a rigid magnet and entirely of silicone, are pressed and then sheared with the tip
bonded to the plate. Both models solve each design at the same accuracy level, with their own error estimates. Two
answers agree in a quantity if they differ by at most the sum of both estimates, relative to the harmonic answer. The
quantities are the force, the magnet's shift, its tilt, and `sideways`, the force along the shear alone. The harmonic
answer is also compared with one that has one harmonic more on the same mesh. The models differ in element,
integration, contact and the constraint of the magnet. They share the material law and Newton's method, and the mesher
of the section, which both use with other edge lengths.
"""
ABOUT_TILTED = """\
With `--tilted` the designs are also loaded by tilted plates: pressed without friction, sheared along the tilt with
the tip bonded or with Coulomb friction, or sheared across the tilt. The last of these have no plane of symmetry:
there the harmonic model has sine orders, and the tetrahedra fill the whole body.
"""

QUANTITIES = ("force", "shift", "tilt", "sideways")


@dataclass(frozen=True, slots=True)
class TiltedCase:
    """Load of a tilted plate on a design, at the depth of the upright cases.

    Attributes
    ----------
    design : number of the design.
    tilt : tilt of the plate, degrees.
    friction : of the plate; a plate without friction only presses, any other one also shears by SHEAR.
    across : whether the plate moves along y, across the tilt; otherwise along x.
    """

    design: int
    tilt: float
    friction: float | Literal["none", "stick"] = "none"
    across: bool = False

    def load(self, design: Design, magnet: Magnet) -> Load:
        """Return the load on its design."""
        depth = error_study_cases.trial(self.design, magnet, "stick", "auto").loads[-1].depth
        shear = 0.0 if self.friction == "none" else error_study_cases.rounded(SHEAR * design.D)
        along, across = (0.0, shear) if self.across else (shear, 0.0)
        return Load(depth, along, across, self.friction, plate_tilt=round(math.radians(self.tilt), 6))


SHEAR = 0.05
"""Shear of a tilted plate over D: with a coefficient of 0.4 some of the contact area slips, and some sticks."""
TILTED = (
    TiltedCase(0, 8),
    TiltedCase(0, 8, "stick", across=True),
    TiltedCase(1, 2, "stick"),
    TiltedCase(1, 2, "stick", across=True),
    TiltedCase(2, 5),
    TiltedCase(3, 12, "stick"),
    TiltedCase(4, 20),
    TiltedCase(5, 3, 0.4),
    TiltedCase(6, 15, "stick"),
    TiltedCase(7, 10),
    TiltedCase(8, 6, 0.4),
    TiltedCase(9, 18, "stick"),
    TiltedCase(10, 4),
    TiltedCase(11, 16, 0.4),
)
"""Tilts of 2 to 20 degrees on the twelve designs; each kind of load with and without a rigid magnet."""


def run(level: str, count: int, progress: Progress, *, tilted: bool = False) -> Iterator[Row]:
    """Solve each of the first `count` designs with both models, and yield one result per load.

    tilted : also solve the cases of TILTED on these designs.
    """
    cases = [case for case in TILTED if tilted and case.design < count]
    for number in range(count):
        magnet = _magnet(number)
        progress(number / (count + len(cases)), f"design {number}, magnet {magnet}")
        yield crosscheck(number, magnet, level)
    for done, case in enumerate(cases, start=count):
        number, magnet = case.design, _magnet(case.design)
        progress(done / (count + len(cases)), f"design {number}, magnet {magnet}, tilt {case.tilt:g} degrees")
        yield compare(number, magnet, LEVELS[level], case.load(error_study_cases.designs()[number], magnet))


def _magnet(number: int) -> Magnet:
    return "rigid" if number % 2 == 0 else "ignored"


def crosscheck(number: int, magnet: Magnet, level: str) -> Row:
    """Solve one design with both models at its largest shear, and compare the answers."""
    load = error_study_cases.trial(number, magnet, "stick", "auto").loads[-1]
    return compare(number, magnet, LEVELS[level], load)


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


def write(folder: Path, rows: Sequence[Row], origin: str, command: str) -> None:
    """Write crosscheck.csv and CROSSCHECK.md."""
    from studies.output.csv_tables import write_table

    write_table(folder / "crosscheck.csv", rows)
    agree, tilted = sum(row["agree"] for row in rows), any(row["tilt_deg"] for row in rows)
    counts = f"{agree} of {len(rows)} {'loads' if tilted else 'designs'} agree in all quantities."
    blocks = ["# Comparison of the harmonic and the half model", counts, ABOUT, ABOUT_TILTED if tilted else ""]
    blocks.append(
        "Difference of the models, both estimates, and change of the harmonic answer by one harmonic more, percent:"
    )
    where = ("design", "magnet", "depth_mm", "shear_mm", "shear_y_mm", "tilt_deg", "friction", "status")
    parts = ("difference", "harmonic_estimate", "half_estimate", "one_harmonic_more")
    for name in QUANTITIES:
        heads = {key: key for key in where}
        heads |= {f"{name}_{part}_percent": part.replace("_", " ") for part in parts} | {f"{name}_agree": "agree"}
        own = [row for row in rows if f"{name}_agree" in row or row["status"] != "ok"]
        blocks += [f"## {name.capitalize()}", pages.markdown(own, heads, 4)]
    stopped = (f"design {row['design']}: {row['message']}" for row in rows if row["message"])
    pages.write(folder / "CROSSCHECK.md", [*blocks, pages.listed(stopped, "")], command, origin)
