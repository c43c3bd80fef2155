"""The harmonic model on the section beside the half model on tetrahedra: two codes' worth of difference, one answer.

ABOUT, which the report prints, says how.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from fem import equilibrium
from fem.accuracy import LEVELS
from fem.solution import Solution
from geometry.loads import Magnet, Response
from studies.output.console import Progress
from studies.output.provenance import made
from studies.validation import error_study_cases

ABOUT = """\
Twelve designs, by turns with a rigid magnet and all of silicone, are pressed and sheared with the tip stuck to the
plate, by both models at one level. Each answer carries its own error estimates; two answers agree where they differ
by no more than the sum of both (relative to the harmonic one), in the force, the magnet's shift, its tilt, and
sideways, in the force along the shear alone. The harmonic answer is also held against one with a harmonic more on the
same mesh. Mesh, element, integration, contact and magnet's constraint differ between the models; law and Newton's
method are shared.
"""

Row = dict[str, Any]

QUANTITIES = ("force", "shift", "tilt", "sideways")
WHERE = ("design", "magnet", "depth_mm", "shear_mm")


def run(level: str, count: int, progress: Progress) -> Iterator[Row]:
    """One row for each of `count` designs, as soon as it is there."""
    for number in range(count):
        magnet: Magnet = "rigid" if number % 2 == 0 else "ignored"
        progress(number / count, f"design {number}, magnet {magnet}")
        yield _row(number, magnet, level)


def _row(number: int, magnet: Magnet, level: str) -> Row:
    trial, accuracy = error_study_cases.trial(number, magnet, "stick", "auto"), LEVELS[level]
    load = trial.loads[-1]
    one, other = (
        equilibrium.solve(trial.design, load, accuracy, magnet=magnet, model=model) for model in ("harmonic", "half")
    )
    more = replace(accuracy, harmonics=accuracy.harmonics + 1)
    richer = equilibrium.trace(trial.design, [load], more, magnet=magnet, estimate=False)[-1]
    row: Row = dict(zip(WHERE, (number, magnet, load.depth, load.shear_x), strict=True))
    bad = [s for s in (one, other, richer) if s.status != "ok"]
    if bad:
        return row | {"status": bad[0].status, "message": f"{bad[0].model}: {bad[0].message}", "agree": False}
    row |= {"status": "ok", "message": ""}
    for name in QUANTITIES:
        row |= _compared(name, one, other, richer)
    row["agree"] = all(row[f"{name}_agree"] for name in QUANTITIES)
    return row | {f"{s.model}_dofs": s.dofs for s in (one, other)} | {f"{s.model}_s": s.seconds for s in (one, other)}


def _compared(name: str, one: Solution, other: Solution, richer: Solution) -> Row:
    a, b, c = (_vector(s.response, name) for s in (one, other, richer))
    size = math.hypot(*a)
    estimates = [_estimate(s, name) for s in (one, other)]
    difference = math.dist(a, b) / size
    return {
        f"{name}_difference_percent": 100 * difference,
        f"{name}_harmonic_estimate_percent": 100 * estimates[0],
        f"{name}_half_estimate_percent": 100 * estimates[1],
        f"{name}_one_harmonic_more_percent": 100 * math.dist(a, c) / size,
        f"{name}_agree": difference <= sum(estimates),
    }


def _vector(response: Response, name: str) -> tuple[float, ...]:
    return {
        "force": response.force,
        "shift": response.shift,
        "tilt": (response.tilt,),
        "sideways": response.force[:1],
    }[name]


def _estimate(state: Solution, name: str) -> float:
    found = {
        "force": state.error_estimate,
        "shift": state.shift_error_estimate,
        "tilt": state.tilt_error_estimate,
        "sideways": state.sideways_error_estimate,
    }[name]
    return math.nan if found is None else found


def write(folder: Path, rows: Sequence[Row], origin: str, command: str) -> None:
    """crosscheck.csv and CROSSCHECK.md."""
    from studies.output.atomic_files import write_text
    from studies.output.csv_tables import write_table

    write_table(folder / "crosscheck.csv", rows)
    agree = sum(row["agree"] for row in rows)
    lines = ["# Harmonic against half model", "", f"{agree} of {len(rows)} designs agree in all.", ""]
    lines += [
        *ABOUT.splitlines(),
        "",
        "Differences, both estimates and the answer's change by one",
    ]
    lines[-1] += " harmonic more, all in percent:"
    for name in QUANTITIES:
        parts = ("difference", "harmonic_estimate", "half_estimate", "one_harmonic_more")
        heads = [*WHERE, *(part.replace("_", " ") for part in parts), "agree"]
        lines += ["", f"## {name.capitalize()}", "", f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
        for row in rows:
            cells = [str(row[key]) for key in WHERE]
            if row["status"] == "ok":
                cells += [f"{row[f'{name}_{part}_percent']:.3g}" for part in parts]
                cells.append("yes" if row[f"{name}_agree"] else "**no**")
            else:
                cells += [row["status"], "", "", "", "**no**"]
            lines.append(f"| {' | '.join(cells)} |")
    stopped = [f"- design {row['design']}: {row['message']}" for row in rows if row["message"]]
    write_text(folder / "CROSSCHECK.md", "\n".join([*lines, "", *stopped, "", made(command, origin)]) + "\n")
