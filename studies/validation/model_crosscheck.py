"""Comparison of the harmonic model on the section with models of tetrahedra (verb crosscheck).

ABOUT, which the report prints, says which loads are compared, and when two answers agree.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from fem import equilibrium
from fem.accuracy import LEVELS, Accuracy
from fem.scene import Model, turns
from fem.solution import Solution
from geometry.design import Design
from geometry.loads import Load, Magnet
from geometry.messages import Progress
from studies.output import records
from studies.output.provenance import made
from studies.output.records import FlatRow
from studies.validation import error_study_cases

ABOUT = """\
Twelve designs, alternately with a rigid magnet and entirely of silicone, are pressed and then sheared with the tip
bonded to the plate. Both models solve each design at the same accuracy level, with their own error estimates. Two
answers agree in a quantity if they differ by at most the sum of both estimates, relative to the harmonic answer. The
quantities are the force, the magnet's shift, its tilt, and `sideways`, the force along the shear alone. The harmonic
answer is also compared with one that has one harmonic more on the same mesh. The models differ in mesh, element,
integration, contact and the constraint of the magnet. They share the material law and Newton's method.
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


@dataclass(frozen=True, slots=True)
class Difference:
    """Difference between tetrahedra and harmonic model in one quantity, percent of the harmonic answer.

    Attributes
    ----------
    harmonic_estimate_percent, half_estimate_percent : error estimates of the models; NaN if a model has none.
    one_harmonic_more_percent : change of the harmonic answer with one harmonic more on the same mesh.
    agree : whether the difference is at most the sum of both estimates.
    """

    difference_percent: float
    harmonic_estimate_percent: float
    half_estimate_percent: float
    one_harmonic_more_percent: float
    agree: bool


@dataclass(frozen=True, slots=True)
class Crosscheck:
    """Both models on one design under one load; without differences, unknowns and seconds if a model stopped.

    Attributes
    ----------
    agree : whether the models agree in all quantities.
    tilt_deg, shear_y_mm, friction : further values of the load.
    """

    design: int
    magnet: Magnet
    depth_mm: float
    shear_mm: float
    status: str
    message: str
    force: Difference | None = field(default=None, metadata={"prefix": "force_"})
    shift: Difference | None = field(default=None, metadata={"prefix": "shift_"})
    tilt: Difference | None = field(default=None, metadata={"prefix": "tilt_"})
    sideways: Difference | None = field(default=None, metadata={"prefix": "sideways_"})
    agree: bool = False
    harmonic_dofs: int | None = None
    half_dofs: int | None = None
    harmonic_s: float | None = None
    half_s: float | None = None
    tilt_deg: float = 0.0
    shear_y_mm: float = 0.0
    friction: float | str = "stick"

    @property
    def differences(self) -> dict[str, Difference | None]:
        """Differences by quantity, in the order of QUANTITIES."""
        return {"force": self.force, "shift": self.shift, "tilt": self.tilt, "sideways": self.sideways}

    def row(self) -> FlatRow:
        """Return the columns of crosscheck.csv and JSON."""
        return records.known(records.flat(self))


def run(level: str, count: int, progress: Progress, *, tilted: bool = False) -> Iterator[Crosscheck]:
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


def crosscheck(number: int, magnet: Magnet, level: str) -> Crosscheck:
    """Solve one design with both models at its largest shear, and compare the answers."""
    load = error_study_cases.trial(number, magnet, "stick", "auto").loads[-1]
    return compare(number, magnet, LEVELS[level], load)


def compare(number: int, magnet: Magnet, accuracy: Accuracy, load: Load) -> Crosscheck:
    """Solve one design under a load by the harmonic model and on tetrahedra, and compare the answers."""
    design = error_study_cases.designs()[number]
    solid: Model = "full" if turns([load]) else "half"
    result = Crosscheck(
        number,
        magnet,
        load.depth,
        load.shear_x,
        "ok",
        "",
        tilt_deg=round(math.degrees(load.plate_tilt), 3),
        shear_y_mm=load.shear_y,
        friction=load.friction,
    )
    harmonic, half = (
        equilibrium.solve(design, load, accuracy, magnet=magnet, model=model) for model in ("harmonic", solid)
    )
    more = replace(accuracy, harmonics=accuracy.harmonics + 1)
    one_more = equilibrium.trace(design, [load], more, magnet=magnet, model="harmonic", estimate=False)[-1]
    for state in (harmonic, half, one_more):
        if state.status != "ok":
            return replace(result, status=state.status, message=f"{state.model}: {state.message}")
    differences = {
        name: difference(name, harmonic, half, one_more) for name in QUANTITIES if name != "sideways" or load.shear
    }
    return replace(
        result,
        force=differences["force"],
        shift=differences["shift"],
        tilt=differences["tilt"],
        sideways=differences.get("sideways"),
        agree=all(one.agree for one in differences.values()),
        harmonic_dofs=harmonic.dofs,
        half_dofs=half.dofs,
        harmonic_s=harmonic.seconds,
        half_s=half.seconds,
    )


def difference(name: str, harmonic: Solution, half: Solution, one_more: Solution) -> Difference:
    """Return the difference of the models in one quantity.

    Parameters
    ----------
    name : one of QUANTITIES.
    one_more : the harmonic answer with one harmonic more.
    """
    a, b, c = (_vector(state, name) for state in (harmonic, half, one_more))
    size = math.hypot(*a)
    estimates = _estimate(harmonic, name), _estimate(half, name)
    relative = math.dist(a, b) / size
    return Difference(
        difference_percent=100 * relative,
        harmonic_estimate_percent=100 * estimates[0],
        half_estimate_percent=100 * estimates[1],
        one_harmonic_more_percent=100 * math.dist(a, c) / size,
        agree=relative <= sum(estimates),
    )


def _vector(state: Solution, name: str) -> tuple[float, ...]:
    response, (x, y) = state.response, state.load.direction
    return {
        "force": response.force,
        "shift": response.shift,
        "tilt": (response.tilt, response.tilt_y),
        "sideways": (x * response.force[0] + y * response.force[1],),
    }[name]


def _estimate(state: Solution, name: str) -> float:
    estimate = {
        "force": state.estimates.force,
        "shift": state.estimates.shift,
        "tilt": state.estimates.tilt,
        "sideways": state.estimates.sideways,
    }[name]
    return math.nan if estimate is None else estimate


def write(folder: Path, results: Sequence[Crosscheck], origin: str, command: str) -> None:
    """Write crosscheck.csv and CROSSCHECK.md."""
    from studies.output.atomic_files import write_text
    from studies.output.csv_tables import write_table

    write_table(folder / "crosscheck.csv", [result.row() for result in results])
    agree, tilted = sum(result.agree for result in results), any(result.tilt_deg for result in results)
    lines = [
        "# Comparison of the harmonic and the half model",
        "",
        f"{agree} of {len(results)} {'loads' if tilted else 'designs'} agree in all quantities.",
        "",
    ]
    lines += [*ABOUT.splitlines(), "", *(ABOUT_TILTED.splitlines() if tilted else ()), ""]
    lines += [
        "Difference of the models, both estimates, and change of the harmonic answer by one harmonic more, percent:"
    ]
    heads = ["design", "magnet", "depth_mm", "shear_mm", "shear_y_mm", "tilt_deg", "friction"]
    heads += ["difference", "harmonic estimate", "half estimate", "one harmonic more", "agree"]
    for name in QUANTITIES:
        lines += ["", f"## {name.capitalize()}", "", f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
        rows = [result for result in results if result.differences[name] or not result.force]
        lines += [f"| {' | '.join(_cells(result, result.differences[name]))} |" for result in rows]
    stopped = [f"- design {result.design}: {result.message}" for result in results if result.message]
    write_text(folder / "CROSSCHECK.md", "\n".join([*lines, "", *stopped, "", made(command, origin)]) + "\n")


def _cells(result: Crosscheck, difference: Difference | None) -> list[str]:
    """Return the cells of a design in the report's table of one quantity."""
    where = [str(result.design), result.magnet, str(result.depth_mm), str(result.shear_mm)]
    where += [f"{result.shear_y_mm:g}", f"{result.tilt_deg:g}", str(result.friction)]
    if difference is None:
        return [*where, result.status, "", "", "", "**no**"]
    percent = (
        difference.difference_percent,
        difference.harmonic_estimate_percent,
        difference.half_estimate_percent,
        difference.one_harmonic_more_percent,
    )
    return [*where, *(f"{value:.3g}" for value in percent), "yes" if difference.agree else "**no**"]
