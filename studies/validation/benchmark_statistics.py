"""Medians of repeated runs, the cheapest mesh within a tolerance, and exponents of growth."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from typing import Any

Answer = dict[str, Any]
"""The JSON object that a measured process prints, with what was counted of it."""
Forces = Sequence[Sequence[float]]

LONG_S = 20.0
"""CPU seconds beyond which a solve is measured once."""
NEAR, SHORT_S, REPEATS = 1.7, 1.0, 3
"""CPU seconds over those of the cheapest, and CPU seconds, up to which a solve is repeated before the cheapest is
chosen; and how often: a single short time varies by half."""


def compared(answer: Answer) -> list[Sequence[float]]:
    """What counts for the error of an answer: forces, and tilts under shear where they are known."""
    return [*answer["forces_N"], *answer.get("tilts_rad", ())]


def errors_percent(forces: Forces, truth: Forces) -> float:
    """The largest relative error of the forces (or tilts) of all loads, in %.

    >>> round(errors_percent([(0, 0, 1.0), (0, 0, 2.02)], [(0, 0, 1.0), (0, 0, 2.0)]), 9)
    1.0
    """
    return 100 * max(math.dist(f, t) / math.hypot(*t) for f, t in zip(forces, truth, strict=True))


def median(answers: Sequence[Answer]) -> Answer:
    """Medians of the numbers of several runs; all else from the first that failed, or from the first."""
    worst = next((answer for answer in answers if answer["status"] != "ok"), answers[0])
    found = dict(worst)
    for key, value in worst.items():
        if isinstance(value, float) and all(key in answer for answer in answers):
            found[key] = statistics.median(answer[key] for answer in answers)
    known = [a["error_percent"] for a in answers if a.get("error_percent") is not None]
    return found | {"error_percent": max(known, default=None), "runs": len(answers)}


def power(x: Sequence[float], y: Sequence[float]) -> tuple[float, float]:
    """Factor a and exponent p of y = a x^p by least squares of the logarithms.

    >>> a, p = power([1, 10, 100], [2, 20 * 10**0.5, 2000])
    >>> round(a, 9), round(p, 9)
    (2.0, 1.5)
    """
    fit = statistics.linear_regression([math.log(v) for v in x], [math.log(v) for v in y])
    return math.exp(fit.intercept), fit.slope


def candidates(
    solve: Callable[[Any], Answer], ladder: Iterable[Any], truth: Forces | None, tolerance: float
) -> list[tuple[Any, Answer]]:
    """Each rung solved once: those within tolerance (%), the cheapest first; or else one, the best there is.

    Short solves that cost nearly the same are repeated, and their shortest times decide.
    """
    tried: list[tuple[Any, Answer]] = []
    for rung in ladder:
        answer = solve(rung)
        if answer["status"] == "ok" and truth is not None:
            answer["error_percent"] = errors_percent(compared(answer), truth)
        tried.append((rung, answer))
    solved = [pair for pair in tried if pair[1]["status"] == "ok"]
    if truth is None or not solved:
        return [(solved or tried)[-1]]
    good = [pair for pair in solved if pair[1]["error_percent"] <= tolerance]
    least = min((answer["cpu_s"] for _, answer in good), default=0.0)
    times = {}
    for i, (rung, answer) in enumerate(good):
        times[i] = answer["cpu_s"]
        if answer["cpu_s"] <= NEAR * least and answer["cpu_s"] < SHORT_S:
            again = (solve(rung) for _ in range(REPEATS))
            times[i] = min([times[i], *(other["cpu_s"] for other in again if other["status"] == "ok")])
    good = [good[i] for i in sorted(times, key=times.__getitem__)]
    return good or [min(solved, key=lambda pair: pair[1]["error_percent"])]


def measured(
    solve: Callable[[Any], Answer],
    ladder: Iterable[Any],
    truth: Forces | None,
    tolerance: float,
    runs: int,
) -> tuple[Any, Answer]:
    """The cheapest rung that is within tolerance in all of several runs, and their medians; else the last tried."""
    for rung, first in candidates(solve, ladder, truth, tolerance):
        answers = [first]
        if first["status"] == "ok" and first["cpu_s"] <= LONG_S:
            answers = [solve(rung) for _ in range(runs)]
        for answer in answers:
            if truth is not None and answer["status"] == "ok":
                answer["error_percent"] = errors_percent(compared(answer), truth)
        found = median(answers)
        error = found["error_percent"]
        if found["status"] != "ok" or error is None or error <= tolerance:
            break
        found |= {"status": "inaccurate", "message": f"the error of {error:.2g} % exceeds {tolerance:g} %"}
    return rung, found


def matching_rungs(
    solve: Callable[[Any], Answer], rung: Any, ladder: Iterable[Any], truth: Forces, tolerance: float
) -> list[Any]:
    """The rungs on which another program may be compared at the same error, the one to try first at the front.

    It is `rung` if the program is within tolerance (%) on that one; else its rungs within, the cheapest first, or its
    most accurate one.
    """
    same = solve(rung)
    if same["status"] == "ok" and errors_percent(compared(same), truth) <= tolerance:
        return [rung]
    return [found for found, _ in candidates(solve, ladder, truth, tolerance)]


def exponents(answers: Sequence[Answer]) -> dict[str, tuple[float, float]]:
    """Fits a n^p over the number n of unknowns: of time, of time an iteration, of meshing and of memory."""
    n = [answer["dofs"] for answer in answers]
    solve = [answer["cpu_s"] - answer["mesh_s"] for answer in answers]
    return {
        "CPU s": power(n, solve),
        "CPU s an iteration": power(n, [s / answer["iterations"] for s, answer in zip(solve, answers, strict=True)]),
        "mesher CPU s": power(n, [answer["mesh_s"] for answer in answers]),
        "memory beyond imports, MB": power(n, [answer["peak_MB"] - answer["base_MB"] for answer in answers]),
    }
