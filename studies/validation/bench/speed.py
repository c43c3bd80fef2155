"""Speed: what the finite elements cost at a given error, and the field beside magpylib.

bench_cases.toml says what is measured and what is promised, templates/bench.md.j2 how. Every run is a process of its
own on one thread; its CPU seconds and peak memory are what the operating system counts for it and its descendants.
"""

import functools
import importlib.util
import itertools
import json
import math
import os
import platform
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from geometry.design import BadInput
from geometry.messages import Progress
from studies.output import provenance
from studies.output.goals import Goal
from studies.output.result import Result, collected
from studies.validation import pages
from studies.validation.pages import Row

CASES: list[Row] = tomllib.loads(Path(__file__).with_name("bench_cases.toml").read_text("utf-8"))["case"]
COLUMNS = (
    *("case", "program", "setting", "dofs", "iterations", "runs", "import_s", "cpu_s", "wall_s", "peak_MB"),
    *("force_N", "error_percent", "faster", "goal", "met", "status", "message"),
)
"""Columns of bench.csv; None where a number is not known. force_N is of the last load, error_percent of the worst."""
BRIEF = ("iterations", "runs", "import_s", "wall_s", "force_N", "message")
"""Left out of the printed table."""
MISSING = "magpylib is not installed: pip install 'magpylib>=5.1'"
HEADS = {name: name for name in ("program", "setting", "iterations", "runs", "goal", "met", "status", "message")}
HEADS |= {"dofs": "unknowns", "error_percent": "error %", "import_s": "imports s", "cpu_s": "CPU s"}
HEADS |= {"wall_s": "wall s", "peak_MB": "peak MB", "faster": "magtip faster by a factor of"}
"""Heads of the page's columns; those that a case does not fill are left out."""
FILES = ("BENCH.md", "bench.csv")
Answer = Row
"""The JSON object that a measured process prints, with what was counted of it."""
THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
LIMIT_S = 1800.0


def run(progress: Progress, *, quick: bool = False, cases: str | None = None) -> Result:
    """Measure time and memory at a given error, and the field beside magpylib; exit status 3 if a goal is missed.

    Parameters
    ----------
    quick
        Use medians of 3 runs instead of 5, and no references of shears.
    cases
        Run only some cases, with commas between their names: press-curve, half-press, half-press-magnet, shear,
        friction, tilted-plate, small-shear, modes, field; default: all.
    """
    asked = [] if cases is None else [name.strip() for name in cases.split(",")]
    names = [case["key"] for case in CASES]
    if unknown := [name for name in asked if name not in names]:
        raise BadInput(f"--cases takes {', '.join(names)}; got {unknown[0]}")
    chosen = pages.told(
        progress, [case for case in CASES if case["key"] in (asked or names)], lambda case: case["name"]
    )
    rows = itertools.chain.from_iterable(measured(case, quick=quick) for case in chosen)
    return collected(rows, functools.partial(result, machine()))


def result(about: Mapping[str, str], rows: Sequence[Row]) -> Result:
    tables = {}
    for case in dict.fromkeys(row["case"] for row in rows):
        own = [row for row in rows if row["case"] == case]
        filled = [name for name in COLUMNS if name in HEADS and any(row[name] not in (None, "") for row in own)]
        tables[case.capitalize()] = own, {name: HEADS[name] for name in filled}
    versions = {row["program"]: row.pop("version") for row in rows}
    page = {"tables": tables, "about": {**about, **versions}}
    remarks = [f"{row['case']}: {row['message']}" for row in rows if row["message"]]
    return pages.study("bench", "Speed", rows, page, look={"brief": BRIEF}, goals=goals(rows), remarks=remarks)


def goals(rows: Sequence[Row]) -> list[Goal]:
    lost = sum(row["status"] != "ok" for row in rows)
    return [Goal("rows without an answer", lost, 0, len(rows))] + [
        Goal(f"{row['case']} ({row['goal']}), promises missed", None if row["met"] is None else not row["met"], 0, 1)
        for row in rows
        if row["goal"]
    ]


def machine() -> dict[str, str]:
    file = Path("/proc/cpuinfo")
    named = re.findall(r"^model name\s*:(.*)", file.read_text("utf-8") if file.exists() else "", flags=re.MULTILINE)
    processor = next(iter(named), platform.processor() or platform.machine())
    found = {"machine": f"{processor}, {os.cpu_count()} cores, {platform.system()} {platform.release()}"}
    if hasattr(os, "getloadavg"):
        found["load before"] = f"{os.getloadavg()[0]:.2f} processes in the last minute"
    return found | {"mkl": provenance.installed("mkl") or "not installed"}


# Cases, whose runs take turns


def measured(case: Row, *, quick: bool) -> list[Row]:
    """Return a row for each run of a case; all but the first are held against the first, in turns."""
    truth = None
    if "reference" in case and not (quick and case.get("slow_reference")):
        found = magtip(task(case, case["reference"]))
        if found["status"] != "ok":
            lost = {"status": "no reference", "message": f"the reference failed: {found['message']}", "met": False}
            return [row_of(case, case["runs"][0], lost)]
        truth = compared(found)
    present = [k for k, one in enumerate(case["runs"]) if installed(one)]
    turns = [[magtip(task(case, case["runs"][k])) for k in present] for _ in range(3 if quick else 5)]
    answers = dict(zip(present, zip(*turns, strict=True), strict=True))
    rows = []
    for k, one in enumerate(case["runs"]):
        if k not in answers:
            rows.append(row_of(case, one, {"status": "not installed", "message": MISSING}))
            continue
        answer = judged(median(answers[k]), truth, (case | one).get("tolerance_percent", math.inf))
        answer |= beside(answers[0], answers[k])
        if "goal" in one:
            # what is not known meets no goal
            within = [answer.get(name, math.nan) <= most for name, most in one.get("most", {}).items()]
            beyond = [answer.get(name, math.nan) >= least for name, least in one.get("least", {}).items()]
            answer["met"] = answer["status"] == "ok" and all(within + beyond)
        rows.append(row_of(case, one, answer))
    return rows


def installed(one: Row) -> bool:
    return one.get("program") != "magpylib" or importlib.util.find_spec("magpylib") is not None


def row_of(case: Row, one: Row, answer: Answer) -> Row:
    row = dict.fromkeys(COLUMNS) | {name: answer[name] for name in COLUMNS if name in answer}
    row |= {"case": case["name"], "program": one.get("program", "magtip"), "setting": one["setting"]}
    row |= {"force_N": next(iter(answer.get("forces_N", ())[-1:]), None), "goal": one.get("goal", "")}
    known = "least" in one and answer["status"] == "ok"
    return row | {"faster": answer["faster"] if known else None, "version": answer.get("version", "")}


def task(case: Row, one: Row) -> Answer:
    """Return a run of a case as a task of `studies.validation.bench.bench_worker`, which reads what it needs."""
    return {"task": "trace", "model": "auto", "accuracy": {}} | {**case, "runs": []} | one


def beside(first: Sequence[Answer], own: Sequence[Answer]) -> dict[str, float]:
    """Return medians over the turns of what the CPU seconds of a run are beside those of the first one.

    A turn that fails makes them NaN.
    """
    turns = [[one.get("cpu_s", math.nan) for one in pair] for pair in zip(first, own, strict=False)]
    a, b = np.array(turns).T
    return {"faster": float(np.median(b / a)), "longer_s": float(np.median(b - a))}


def compared(answer: Answer) -> list[Sequence[float]]:
    """Return what counts for the error of an answer: forces, and tilts under shear where they are known."""
    return [*answer["forces_N"], *answer.get("tilts_rad", ())]


def errors_percent(forces: Sequence[Sequence[float]], truth: Sequence[Sequence[float]]) -> float:
    """Return the largest relative error of the forces (or tilts) of all loads, in %.

    >>> round(errors_percent([(0, 0, 1.0), (0, 0, 2.02)], [(0, 0, 1.0), (0, 0, 2.0)]), 9)
    1.0
    """
    return 100 * float(np.max([math.dist(f, t) / math.hypot(*t) for f, t in zip(forces, truth, strict=True)]))


def median(answers: Sequence[Answer]) -> Answer:
    worst = next((answer for answer in answers if answer["status"] != "ok"), answers[0])
    found = dict(worst)
    for key, value in worst.items():
        if isinstance(value, float) and all(key in answer for answer in answers):
            found[key] = statistics.median(answer[key] for answer in answers)
    return found | {"runs": len(answers)}


def judged(answer: Answer, truth: Sequence[Sequence[float]] | None, tolerance: float) -> Answer:
    if answer["status"] != "ok" or truth is None:
        return answer
    answer = answer | {"error_percent": (error := errors_percent(compared(answer), truth))}
    if error <= tolerance:
        return answer
    return answer | {"status": "inaccurate", "message": f"the error of {error:.2g} % exceeds {tolerance:g} %"}


# Processes

_LAUNCHER = """
import json, os, resource, subprocess, sys
ended = subprocess.run(sys.argv[3:], cwd=sys.argv[2], stdin=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
with open(sys.argv[1], "w") as file:
    json.dump({"exit": ended.returncode, "cpu_s": used.ru_utime + used.ru_stime,
               "peak_MB": used.ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)}, file)
"""
"""Starts a program and notes what it used: Linux counts the memory of whoever starts a process as its own."""


class Ended(NamedTuple):
    """A process that has ended: its exit status, what it used and what it said."""

    exit: int
    cpu_s: float
    peak_MB: float
    out: str
    err: str

    @property
    def last_words(self) -> str:
        return next((line.strip() for line in reversed(f"{self.out}\n{self.err}".splitlines()) if line.strip()), "")


def measure(command: Sequence[str], limit: float = LIMIT_S) -> Ended:
    """Run a Python program on one thread and return what it used; beyond the limit in seconds it is stopped."""
    if os.name != "posix":
        raise BadInput("bench needs Linux or macOS, which count what processes use: run it there")
    path = os.pathsep.join(filter(None, (str(provenance.ROOT), os.environ.get("PYTHONPATH", ""))))
    env = {**os.environ, **dict.fromkeys(THREADS, "1"), "PYTHONPATH": path}
    with tempfile.TemporaryDirectory() as own:
        report = Path(own, "used.json")
        start = [sys.executable, "-I", "-S", "-c", _LAUNCHER, str(report), own, *command]
        process = subprocess.Popen(
            start, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", errors="replace",
            start_new_session=True,
        )  # fmt: skip
        try:
            out, err = process.communicate(timeout=limit)
            return Ended(out=out, err=err, **json.loads(report.read_text()))
        except subprocess.TimeoutExpired:
            return Ended(-1, math.nan, math.nan, "", f"stopped after {limit:g} s")
        finally:
            if process.poll() is None:
                # the process and all it has started are a session of their own
                os.killpg(process.pid, signal.SIGKILL)
                process.communicate()


def magtip(task: Answer) -> Answer:
    """Return the JSON object that a task printed, with its peak memory; its last words if it failed."""
    # -P: the worker's own folder is no folder of packages
    worker = str(Path(__file__).with_name("bench_worker.py"))
    ended = measure([sys.executable, "-P", worker, json.dumps(task)])
    if ended.exit or not ended.out.strip():
        return {"status": "failed", "message": ended.last_words or f"exit status {ended.exit}"}
    found: Answer = json.loads(ended.out.strip().splitlines()[-1])
    return found | {"peak_MB": ended.peak_MB}
