"""Published and closed-form problems, solved on families of meshes and checked against fixed tolerances."""

import math
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from geometry.bad_input import SolveFailed
from geometry.messages import Progress
from studies.output.result import Result
from studies.output.text_tables import cell
from studies.simulation.mesh_convergence import richardson
from studies.validation import pages
from studies.validation.pages import Row
from studies.validation.verify import manufactured_solutions, motion_problems, static_problems

PROBLEMS = Path(__file__).with_name("verify_problems.toml")
"""All targets, with their meshes, published values, tolerances and sources."""
NAN = math.nan
DETAILS = ("judged", "meshes", "source", "message", "note")
PRECISE = ("published", "computed", "extrapolated")
"""Columns that the printed table leaves out, and those that have six digits there."""
FILES = ("VERIFY.md", "verify.csv")


def targets(*, quick: bool = False) -> list[Row]:
    found = tomllib.loads(PROBLEMS.read_text("utf-8"))["target"]
    chosen = [problem | {"meshes": problem.get("quick" if quick else "meshes", [1])} for problem in found]
    return [problem for problem in chosen if problem["meshes"]]


def solved(target: Row, n: int) -> list[float]:
    places = (static_problems, motion_problems, manufactured_solutions)
    function = next(getattr(place, target["solve"]) for place in places if hasattr(place, target["solve"]))
    values: list[float] = []
    for own in target.get("each", [{}]):
        given = target.get("arguments", {}) | own
        given = {name: tuple(value) if isinstance(value, list) else value for name, value in given.items()}
        values += np.atleast_1d(function(n, **given)).tolist()
    return values


def run(progress: Progress, *, quick: bool = False) -> Result:
    """Solve published and closed-form problems and check each against its tolerance.

    Exit status 3 if others fail than studies/validation/expected_misses.toml has, or one of these passes.

    Parameters
    ----------
    quick
        Use coarser meshes: an eighth of the time.
    """
    chosen = targets(quick=quick)
    rows: list[Row] = []
    for i, target in enumerate(chosen):
        rows += evaluate(target, i / len(chosen), progress)
    printed = [row | {name: cell(row[name], 6) for name in PRECISE} for row in rows]
    shown = [row | {"": "pass" if row["passed"] else f"fail {row['message']}".strip()} for row in printed]
    misses = {f"{row['target']} ({row['quantity']})": row["error_percent"] for row in rows if not row["passed"]}
    look = {"brief": DETAILS, "first": ("target", "quantity", "computed", "published", "passed")}
    page, run = {"rows": rows, "shown": shown}, "quick" if quick else "full"
    return pages.study("verify", "Verification", rows, page, printed, look, misses=misses, run=run, digits=12)


def evaluate(target: Row, done: float = 0.0, progress: Progress = lambda share, text: None) -> list[Row]:
    """Return comparisons of one target; a problem that finds no solution fails with the reason in `message`.

    `done` is the share of the targets solved before. `computed` is the value on the finest mesh, or the order of
    convergence if that is checked; `extrapolated` and `order` are limit and order of Richardson's extrapolation; NaN
    where nothing was computed.
    """
    begin, message, meshes = time.perf_counter(), "", target["meshes"]
    values: list[Sequence[float]] = []
    for n in meshes:
        progress(done, target["name"] + (f", mesh {n}" if len(meshes) > 1 else ""))
        try:
            values.append(solved(target, n))
        except SolveFailed as error:
            message, values = f"mesh {n}: {error}", []
            break
    words = {"seconds": time.perf_counter() - begin, "meshes": "-".join(map(str, meshes))}
    words |= {"source": target["source"], "note": target.get("note", ""), "message": message}
    rows, way = [], target.get("judged", "finest")
    for i, (name, published, *given) in enumerate(target["quantities"]):
        family = [answer[i] for answer in values]
        tolerance = given[0] if given else target["relative"] * abs(published)
        computed = family[-1] if family else NAN
        extrapolated, order = richardson(meshes, family)
        if way == "order" and family:
            (n0, n1), (e0, e1) = meshes[-2:], family[-2:]
            computed = order = math.log(e0 / e1) / math.log(n1 / n0)
            extrapolated = NAN
        checked = extrapolated if way == "extrapolated" and math.isfinite(extrapolated) else computed
        row: Row = {"target": target["name"], "quantity": name, "published": published, "computed": computed}
        row |= {"extrapolated": extrapolated, "order": order}
        row |= {"error_percent": 100 * (checked - published) / published}
        row |= {"tolerance_percent": 100 * tolerance / published, "judged": way}
        rows.append(row | {"passed": abs(checked - published) <= tolerance} | words)
    return rows
