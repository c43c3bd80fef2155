"""Cases at the limits of the input ranges, each with a verdict: a correct result, or a clear status."""

from __future__ import annotations

import csv
import functools
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from fem.accuracy import QUICK, STANDARD, Accuracy
from geometry.design import BadInput, paper
from geometry.loads import Load
from geometry.messages import Progress
from studies.output.result import Result
from studies.validation import extreme_checks, pages
from studies.validation.extreme_checks import LENGTHS, Case, Measurement, StoppedError, largest_height, press
from studies.validation.pages import Row

NAN = math.nan
FILES = ("EXTREMES.md", "extremes.csv")
Verdict = Literal["pass", "fail", "not judged"]

CASES = Path(__file__).with_name("extreme_cases.csv")
"""All cases but the random ones: loads, check and bound, changes of the paper's design, expected statuses."""
SEED = 2016
MAY_STOP = ("ok", "not_converged")
"""Expected statuses of a path that need not reach its last load."""
BOUNDS = {
    "quick": {"hertz": 0.02, "bar": 0.01, "mesh": 0.03, "shear": 0.01},
    "standard": {"hertz": 0.005, "bar": 0.005, "mesh": 0.01, "shear": 0.005},
}
"""Bounds of the checks that depend on the mesh, by accuracy level."""
WORK = 2e-3
"""Bound of the work of the force in random cases."""
NO_MAGNET = {"magnet_diameter": 0.0, "magnet_height": 0.0, "magnet_edge_radius": 0.0}
HARMONICS = replace(QUICK, section_size=0.2, harmonics=8)


def cases(*, quick: bool = False) -> list[Case]:
    """Return all cases; if quick, at quick accuracy and without the slow ones."""
    level = QUICK if quick else STANDARD
    with CASES.open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file, delimiter=";") if not (quick and row["run"] == "full")]
    samples = (_sample(i, np.random.default_rng([SEED, i]), level) for i in range(1, (4 if quick else 12) + 1))
    return [*(_case(row, level) for row in rows), *samples]


def _case(row: Row, level: Accuracy) -> Case:
    """Return the case of a row of CASES."""
    check, *numbers = row["check"].split()
    return Case(
        row["scene"],
        _loads(*row["loads"].split(), steps=4 if level is QUICK else 8),
        functools.partial(getattr(extreme_checks, check), *map(float, numbers)),
        BOUNDS[level.name].get(row["bound"]) or float(row["bound"]),
        {"": level, "quick": QUICK, "harmonics": HARMONICS}[row["accuracy"]],
        _changes(row["changes"]),
        row["magnet"],
        row["model"],
        tuple(row["ends"].split()),
    )


def _loads(kind: str, *words: str, steps: int) -> tuple[Load, ...]:
    """Return a path of loads in words: depths of presses; or, before the shear, height of a grip, depth, friction."""
    numbers = [float(word) for word in words]
    if kind == "press":
        return press(*numbers)
    if kind == "rub":
        mu, depth, shear = numbers
        return tuple(Load(depth=depth, shear_x=x, friction=mu) for x in (0.0, shear))
    first, farthest = numbers
    shears = (farthest * i / steps for i in range(steps + 1))
    if kind == "grip":
        return tuple(Load(grip=first, shear_x=x) for x in shears)
    return tuple(Load(depth=first, shear_x=x, friction="stick") for x in shears)


def _changes(words: str) -> dict[str, float]:
    """Return the fields that differ from the paper's design; some words stand for several."""
    changes = {name: float(value) for name, value in (word.split("=") for word in words.split())}
    if factor := changes.pop("all_lengths", None):
        changes |= {name: getattr(paper(), name) * factor for name in LENGTHS}
    if changes.pop("no_magnet", None):
        changes |= NO_MAGNET
    if changes.pop("largest_magnet", None):
        changes["magnet_height"] = largest_height({})
    return changes


def _sample(i: int, rng: np.random.Generator, a: Accuracy) -> Case:
    """Return a random case that combines extremes; every second magnet is the largest that fits."""
    D = _rounded(50 ** rng.uniform())
    L = _rounded(D / 2 + 0.05 + (9.5 * D - 0.05) * 0.01 ** rng.uniform())
    E, nu = _rounded(10 ** rng.uniform(-3, 3)), float(rng.choice([0.3, 0.49, 0.4998, 0.49999, 0.5]))
    shape = {"D": D, "L": L, "l0": L, "magnet_diameter": _rounded(D * rng.uniform(0.1, 0.8))}
    shape["magnet_edge_radius"] = _rounded(0.025 * shape["magnet_diameter"])
    height = largest_height(shape) * (0.99 if i % 2 else rng.uniform(0.1, 0.9))
    fits = height > 2.5 * shape["magnet_edge_radius"]
    shape |= {"magnet_height": _rounded(height)} if fits else NO_MAGNET
    room = min(L - shape["magnet_height"], D)
    depth = _rounded(room * 10 ** rng.uniform(-8, math.log10(0.4)) if i % 3 == 0 else room * rng.uniform(0.05, 0.4))
    return Case(
        f"sample {i}: depth {depth:g} mm",
        press(0.98 * depth, 0.99 * depth, depth),
        extreme_checks.work,
        WORK,
        a,
        {"E": E, "nu": nu, **shape},
        "rigid" if fits else "ignored",
        ends=MAY_STOP,
    )


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")


def run(progress: Progress, *, quick: bool = False) -> Result:
    """Solve and judge all cases."""
    return pages.collected(_examined(progress, cases(quick=quick)), result)


def _examined(progress: Progress, chosen: Sequence[Case]) -> Iterator[Row]:
    for i, case in enumerate(chosen):
        progress(i / len(chosen), case.name)
        yield examine(case)


def result(rows: Sequence[Row]) -> Result:
    """Return the result of judged cases."""
    heads = {"scene": "case", "status": "status", "seconds": "s", "check": "check", "measured": "measured"}
    heads |= {"bound": "bound", "inside_out_share": "inverted", "verdict": "verdict", "message": "message"}
    marked = [row | {"verdict": row["verdict"] if row["passed"] else f"**{row['verdict']}**"} for row in rows]
    counts = counted([row["verdict"] for row in rows])
    failed, unjudged = (
        [row["scene"] for row in rows if row["verdict"] == verdict] for verdict in ("fail", "not judged")
    )
    return Result(
        title="Extremes",
        records=rows,
        shown=[line(row) for row in rows],
        tables={"extremes": rows},
        digits=9,
        pages={"EXTREMES.md": pages.rendered("extremes.md.j2", rows=marked, heads=heads, counts=counts)},
        failures=[
            *pages.failed(unjudged, len(rows), "cases yield no measurement"),
            *pages.failed(failed, len(rows), "cases fail"),
        ],
    )


def examine(case: Case) -> Row:
    """Return the row of one case; an exception has the status "crashed" and its text as the message."""
    begin = time.perf_counter()
    measurement: Measurement | None = None
    status: str
    try:
        measurement = _measured(case)
        end = measurement.solution
        status, message = ("crashed", "") if end is None else (end.status, end.message)
    except BadInput as error:
        status, message = "bad_input", str(error)
        measurement = extreme_checks.refused(case)
    except Exception as error:
        # the study exists to find unforeseen failures, so that every exception becomes a row
        status, message = "crashed", f"{type(error).__name__}: {error}"
    return _result(case, measurement, status, message, time.perf_counter() - begin)


def _measured(case: Case) -> Measurement:
    """Return the measurement of a case: its own check if the path reaches its last load, else of the end."""
    states = extreme_checks.path(case)
    end = states[-1]
    reached = end.status == "ok" or (end.status == "unstable" and "ok" in case.ends)
    try:
        measurement = case.measure(case, states) if reached else extreme_checks.stopped(case, end)
    except StoppedError as stop:
        measurement = Measurement(end, f"no comparison: the other solve {stop}", None)
    # beyond the onset of an instability a failed check proves nothing: the path may have taken another branch
    settled = end.status not in case.ends or _verdict(case, measurement, end.status) == "pass"
    if settled or end.facts.onset is None:
        return measurement
    text = _text(measurement.check, measurement.measured, _bound(case, measurement))
    return extreme_checks.onset(case, end, text)


def _bound(case: Case, measurement: Measurement) -> float:
    return case.bound if measurement.bound is None else measurement.bound


def _verdict(case: Case, measurement: Measurement | None, status: str) -> Verdict:
    """Return the verdict on a case: both its status and its measurement must be right."""
    if measurement is None or status not in case.ends:
        return "fail"
    if measurement.measured is None:
        return "not judged"
    return "pass" if measurement.measured <= _bound(case, measurement) else "fail"


def _result(case: Case, measurement: Measurement | None, status: str, message: str, seconds: float) -> Row:
    """Return the columns of extremes.csv and JSON; NaN where there is no number.

    `check` is the measured quantity, or the reason why there is no measurement; `changes` are the fields that differ
    from the paper's design; load and force are those of the last state.
    """
    end = measurement.solution if measurement else None
    measured = measurement.measured if measurement else None
    response = end.response if end else None
    verdict = _verdict(case, measurement, status)
    inside_out = extreme_checks.folded_share(end) if end and end.model == "axisymmetric" else NAN
    row: Row = {"scene": case.name, "verdict": verdict, "status": status, "message": message, "seconds": seconds}
    row |= {"check": measurement.check if measurement else "none", "measured": NAN if measured is None else measured}
    row["bound"] = NAN if measurement is None or measured is None else _bound(case, measurement)
    row |= {"passed": verdict == "pass", "ends": " ".join(case.ends), "model": end.model if end else case.model}
    row |= {"accuracy": case.accuracy.name, "magnet": case.magnet}
    row |= {"depth_mm": end.load.depth if end else NAN, "shear_mm": end.load.shear_x if end else NAN}
    row |= {f"force_{axis}_N": response.force[k] if response else NAN for k, axis in ((0, "x"), (2, "z"))}
    changes = " ".join(f"{name}={value:.9g}" for name, value in case.changes.items())
    return row | {"inside_out_share": inside_out, "changes": changes}


def line(result: Row) -> str:
    """Return the result as a line of text: `pass  deep: ok in 0.5 s; force 0.0002, at most 0.005`."""
    verdict = "FAIL" if result["verdict"] == "fail" else result["verdict"]
    message = f"; {result['message']}" if result["message"] else ""
    measured = None if math.isnan(result["measured"]) else result["measured"]
    text = _text(result["check"], measured, result["bound"])
    return f"{verdict}  {result['scene']}: {result['status']} in {result['seconds']:.1f} s; {text}{message}"


def _text(check: str, measured: float | None, bound: float) -> str:
    return check if measured is None else f"{check} {measured:.3g}, at most {bound:.3g}"


def counted(verdicts: Sequence[Verdict]) -> str:
    """Return how many cases have each verdict, as text.

    >>> counted(["pass", "not judged"])
    '1 of 2 cases pass, 0 fail, 1 is not judged'
    """
    passed, failed, not_judged = (verdicts.count(verdict) for verdict in ("pass", "fail", "not judged"))
    verb = "is" if not_judged == 1 else "are"
    return f"{passed} of {len(verdicts)} cases pass, {failed} fail, {not_judged} {verb} not judged"
