"""Comparison of the harmonic model on the section with the half model on tetrahedra (verb crosscheck).

ABOUT, which the report prints, says which loads are compared, and when two answers agree.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from fem import equilibrium
from fem.accuracy import LEVELS
from fem.solution import Solution
from geometry.loads import Magnet, Response
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

QUANTITIES = ("force", "shift", "tilt", "sideways")


@dataclass(frozen=True, slots=True)
class Difference:
    """Difference between half and harmonic model in one quantity, percent of the harmonic answer.

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

    @property
    def differences(self) -> dict[str, Difference | None]:
        """Differences by quantity, in the order of QUANTITIES."""
        return {"force": self.force, "shift": self.shift, "tilt": self.tilt, "sideways": self.sideways}

    def row(self) -> FlatRow:
        """Return the columns of crosscheck.csv and JSON."""
        return records.known(records.flat(self))


def run(level: str, count: int, progress: Progress) -> Iterator[Crosscheck]:
    """Solve each of the first `count` designs with both models, and yield one result per design."""
    for number in range(count):
        magnet: Magnet = "rigid" if number % 2 == 0 else "ignored"
        progress(number / count, f"design {number}, magnet {magnet}")
        yield crosscheck(number, magnet, level)


def crosscheck(number: int, magnet: Magnet, level: str) -> Crosscheck:
    """Solve one design with both models at its largest shear, and compare the answers."""
    trial, accuracy = error_study_cases.trial(number, magnet, "stick", "auto"), LEVELS[level]
    load = trial.loads[-1]
    harmonic, half = (
        equilibrium.solve(trial.design, load, accuracy, magnet=magnet, model=model) for model in ("harmonic", "half")
    )
    more = replace(accuracy, harmonics=accuracy.harmonics + 1)
    one_more = equilibrium.trace(trial.design, [load], more, magnet=magnet, estimate=False)[-1]
    for state in (harmonic, half, one_more):
        if state.status != "ok":
            message = f"{state.model}: {state.message}"
            return Crosscheck(number, magnet, load.depth, load.shear_x, state.status, message)
    force, shift, tilt, sideways = (difference(name, harmonic, half, one_more) for name in QUANTITIES)
    return Crosscheck(
        number,
        magnet,
        load.depth,
        load.shear_x,
        "ok",
        "",
        force,
        shift,
        tilt,
        sideways,
        agree=force.agree and shift.agree and tilt.agree and sideways.agree,
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
    a, b, c = (_vector(state.response, name) for state in (harmonic, half, one_more))
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


def _vector(response: Response, name: str) -> tuple[float, ...]:
    return {
        "force": response.force,
        "shift": response.shift,
        "tilt": (response.tilt,),
        "sideways": response.force[:1],
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
    agree = sum(result.agree for result in results)
    lines = [
        "# Comparison of the harmonic and the half model",
        "",
        f"{agree} of {len(results)} designs agree in all quantities.",
        "",
    ]
    lines += [*ABOUT.splitlines(), ""]
    lines += [
        "Difference of the models, both estimates, and change of the harmonic answer by one harmonic more, percent:"
    ]
    heads = ["design", "magnet", "depth_mm", "shear_mm"]
    heads += ["difference", "harmonic estimate", "half estimate", "one harmonic more", "agree"]
    for name in QUANTITIES:
        lines += ["", f"## {name.capitalize()}", "", f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
        lines += [f"| {' | '.join(_cells(result, result.differences[name]))} |" for result in results]
    stopped = [f"- design {result.design}: {result.message}" for result in results if result.message]
    write_text(folder / "CROSSCHECK.md", "\n".join([*lines, "", *stopped, "", made(command, origin)]) + "\n")


def _cells(result: Crosscheck, difference: Difference | None) -> list[str]:
    """Return the cells of a design in the report's table of one quantity."""
    where = [str(result.design), result.magnet, str(result.depth_mm), str(result.shear_mm)]
    if difference is None:
        return [*where, result.status, "", "", "", "**no**"]
    percent = (
        difference.difference_percent,
        difference.harmonic_estimate_percent,
        difference.half_estimate_percent,
        difference.one_harmonic_more_percent,
    )
    return [*where, *(f"{value:.3g}" for value in percent), "yes" if difference.agree else "**no**"]
