"""Speed: what the finite elements cost at a given error, beside FElupe and CalculiX, and the field beside magpylib.

bench_cases.toml says what is measured and what is promised, templates/bench.md.j2 how.
"""

from __future__ import annotations

import functools
import math
import os
import platform
import shutil
import statistics
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from geometry.design import BadInput, paper
from geometry.messages import Progress
from studies.output import provenance
from studies.output.goals import Goal, failures, page_lines
from studies.output.result import Result, Table
from studies.validation import pages
from studies.validation.bench_programs import (
    Answer,
    Press,
    calculix,
    felupe,
    felupe_python,
    magtip,
    measure,
)
from studies.validation.pages import Row

SPECS: dict[str, list[Row]] = tomllib.loads(Path(__file__).with_name("bench_cases.toml").read_text("utf-8"))
"""The cases, and the pairs of tasks that run by turns."""
TIMES = 10.0
"""Goal: CPU seconds of the half model over the harmonic one's under a shear."""
COLUMNS = (
    *("case", "program", "setting", "dofs", "iterations", "runs", "import_s", "cpu_s", "wall_s", "peak_MB"),
    *("force_N", "error_percent", "faster", "goal", "met", "status", "message"),
)
"""Columns of bench.csv; None where a number is not known. force_N is of the last load, error_percent of the worst."""
BRIEF = ("iterations", "runs", "import_s", "wall_s", "force_N", "message")
"""Left out of the printed table."""
HEADS = {name: name for name in ("program", "setting", "iterations", "runs", "goal", "met", "status", "message")}
HEADS |= {"dofs": "unknowns", "error_percent": "error %", "import_s": "imports s", "cpu_s": "CPU s"}
HEADS |= {"wall_s": "wall s", "peak_MB": "peak MB", "faster": "magtip faster by a factor of"}
"""Heads of the page's columns; those that a case does not fill are left out."""
FILES = ("BENCH.md", "bench.csv")


@dataclass(slots=True)
class Bench:
    """Options of a run, its rows so far, and the references of its cases."""

    quick: bool
    peers: Path
    ccx: str
    say: Callable[[str], None] = lambda text: None
    rows: list[Row] = field(default_factory=list)
    versions: dict[str, str] = field(default_factory=dict)
    references: dict[str, list[Sequence[float]]] = field(default_factory=dict)

    @property
    def runs(self) -> int:
        """Number of runs of which the median counts."""
        return 3 if self.quick else 5

    def add(self, case: str, program: str, setting: str, answer: Answer, **more: Any) -> Row:
        """Add a row of the table from the answer of a process and return it."""
        forces = answer.get("forces_N")
        row = dict.fromkeys(COLUMNS) | {name: answer[name] for name in COLUMNS if name in answer}
        row |= {"case": case, "program": program, "setting": setting, "force_N": forces[-1] if forces else None}
        row |= {"goal": "", "status": answer.get("status", "ok"), "message": answer.get("message", "")} | more
        self.rows.append(row)
        return row


def parts() -> list[tuple[str, Callable[[Bench], None]]]:
    """Return the parts of the bench by name."""
    found: list[tuple[str, Callable[[Bench], None]]] = []
    for kind, measured in (("case", measure_case), ("pair", by_turns)):
        found += [(spec["key"], functools.partial(measured, spec=spec)) for spec in SPECS[kind]]
    return found


def run(progress: Progress, bench: Bench, cases: Sequence[str] = ()) -> Result:
    """Measure the parts of these names; without names all.

    Raises
    ------
    BadInput
        A case has another name.
    """
    names = [name for name, _ in parts()]
    if unknown := [name for name in cases if name not in names]:
        raise BadInput(f"--cases takes {', '.join(names)}; got {unknown[0]}")
    chosen = [part for name, part in parts() if name in cases or not cases]
    return pages.collected(_measured(progress, bench, chosen), functools.partial(result, bench, machine()))


def _measured(progress: Progress, bench: Bench, chosen: Sequence[Callable[[Bench], None]]) -> Iterator[Row]:
    for k, part in enumerate(chosen):
        known = len(bench.rows)
        bench.say = functools.partial(progress, k / len(chosen))
        part(bench)
        yield from bench.rows[known:]


def result(bench: Bench, about: Mapping[str, str], rows: Sequence[Row]) -> Result:
    """Return the result of measured rows; `about` says on which machine."""
    tables = {}
    for case in dict.fromkeys(row["case"] for row in rows):
        own = [row for row in rows if row["case"] == case]
        filled = [name for name in COLUMNS if name in HEADS and any(row[name] not in (None, "") for row in own)]
        tables[case.capitalize()] = own, {name: HEADS[name] for name in filled}
    page = {"verdict": page_lines(goals(rows)), "tables": tables, "about": {**about, **bench.versions}}
    return Result(
        title="Speed",
        records=rows,
        shown=[Table(title="Speed", rows=rows, brief=BRIEF)],
        tables={"bench": rows},
        pages={"BENCH.md": pages.rendered("bench.md.j2", **page)},
        remarks=[f"{row['case']}: {row['message']}" for row in rows if row["message"]],
        failures=failures(goals(rows)),
    )


def task(spec: Row, model: str, accuracy: Mapping[str, float]) -> Answer:
    """Return a case as a task of `studies.validation.bench_worker`."""
    return {"task": "trace", "magnet": spec["magnet"], "loads": spec["loads"], "model": model, "accuracy": accuracy}


def measure_case(bench: Bench, spec: Row) -> None:
    """Add magtip's row of one case, and those of its peers, which run by turns with magtip."""
    name, tolerance = spec["name"], spec.get("tolerance_percent", math.inf)
    # two models of one scene share its reference; that of a shear takes minutes
    truth = bench.references.get(name)
    if truth is None and "reference" in spec and not (bench.quick and spec.get("slow_reference")):
        bench.say(f"{name}: reference")
        found = magtip(task(spec, *spec["reference"]))
        if found["status"] != "ok":
            lost = {"status": "no reference", "message": f"the reference failed: {found['message']}"}
            bench.add(name, "magtip", "", lost, goal=f"within {tolerance:g} %", met=False)
            return
        truth = bench.references[name] = compared(found)
    bench.say(f"{name}: magtip")
    accuracy = spec["accuracy"]
    own = functools.partial(magtip, task(spec, spec["model"], accuracy))
    answer = judged(median([own() for _ in range(bench.runs)]), truth, tolerance)
    limits = [
        (spec[key], answer.get(of, math.inf), unit)
        for key, of, unit in (("goal_s", "cpu_s", "s"), ("goal_MB", "peak_MB", "MB"))
        if key in spec
    ]
    goals = [(f"at most {limit:g} {unit}", value <= limit) for limit, value, unit in limits]
    half = next((row for row in bench.rows if row["case"] == name and "solid_size" in row["setting"]), None)
    faster = None
    if half is not None and half["status"] == answer["status"] == "ok":
        faster = half["cpu_s"] / answer["cpu_s"]
        goals.append((f"{TIMES:g} times faster than the half model", faster >= TIMES))
    met = answer["status"] == "ok" and all(good for _, good in goals)
    goal = ", ".join([text for text, _ in goals] + ([f"within {tolerance:g} %"] if truth else []))
    setting = ", ".join(f"{key} {value:g}{'' if key == 'harmonics' else ' D'}" for key, value in accuracy.items())
    bench.add(name, "magtip", setting, answer, goal=goal, met=met, faster=faster)
    for peer in spec.get("peers", []):
        add_peer(bench, spec, peer, own)


def add_peer(bench: Bench, spec: Row, peer: Row, own: Callable[[], Answer]) -> None:
    """Add the row of a peer, which runs by turns with magtip's `own` solve."""
    name, program, goal = spec["name"], peer["program"], f"magtip at least {peer['least']:g} times faster"
    bench.say(f"{name}: {program} by turns with magtip")
    setting, solve = (felupe_press if program == "FElupe" else calculix_press)(bench, spec, peer)
    if isinstance(solve, str):
        bench.add(name, program, setting, {"status": "not installed", "message": solve}, goal=goal)
    elif bench.quick and peer.get("slow"):
        bench.add(name, program, setting, {"status": "left out", "message": "not part of the quick run"})
    else:
        turns = [(own(), solve()) for _ in range(1 if peer.get("slow") else bench.runs)]
        truth, tolerance = bench.references.get(name), spec["tolerance_percent"]
        answer = judged(median([other for _, other in turns]), truth, tolerance)
        row = bench.add(name, program, setting, answer, goal=goal, faster=compared_turns(turns, "ratio"))
        row["met"] = answer["status"] == "ok" and row["faster"] >= peer["least"]


Solve = Callable[[], Answer] | str
"""Solves by a peer, or says that it is not installed, and how to install it."""


def felupe_press(bench: Bench, spec: Row, peer: Row) -> tuple[str, Solve]:
    """Return the setting of FElupe, and what solves the press curve by it."""
    python, size, tip = felupe_python(bench.peers), peer["size"], peer["tip"]
    if python is None:
        install = f"python3 -m venv {bench.peers} && {bench.peers}/bin/pip install felupe==11.3.0"
        return "", f"FElupe is not installed: {install}"
    depths = [load["depth"] for load in spec["loads"]]

    def solve() -> Answer:
        answer = felupe(python, paper(), depths, size, tip)
        bench.versions["FElupe"] = answer.get("version", "")
        return answer

    return f"second-order triangles (u, p, J), size {size:g} D, tip x {tip:g}", solve


def calculix_press(bench: Bench, spec: Row, peer: Row) -> tuple[str, Solve]:
    """Return the setting of CalculiX, and what solves the half model's press by it."""
    from geometry.mesh import tetrahedra

    command, design = shutil.which(bench.ccx), paper()
    if command is None:
        return "", "CalculiX is not installed: apt-get install calculix-ccx"
    said = measure([command, "-v"]).out.splitlines()
    bench.versions["CalculiX"] = next((f"ccx {line.split()[-1]}" for line in said if "Version" in line), "")
    contact = {name: peer[name] for name in ("contact", "stiffness") if name in peer}
    press = Press(design.E, peer["nu"], design.L, design.R, spec["loads"][0]["depth"], **contact)
    edge = peer["size"] * design.D

    def solve() -> Answer:
        mesh = tetrahedra(design.shape, edge, tip_size=edge / 2, half=True, magnet="none")
        return calculix(command, mesh, press)

    return f"C3D10, nu {peer['nu']:g}, size {peer['size']:g} D", solve


def by_turns(bench: Bench, spec: Row) -> None:
    """Add the rows of tasks that run by turns; the last one is judged, beside the first one or alone."""
    bench.say(spec["name"])
    turns = [[magtip(task) for task in spec["tasks"]] for _ in range(bench.runs)]
    answers = [median(own) for own in zip(*turns, strict=True)]
    programs = spec.get("programs", ["magtip"] * len(answers))
    rows = [bench.add(spec["name"], *place) for place in zip(programs, spec["settings"], answers, strict=True)]
    last, good = rows[-1], all(row["status"] == "ok" for row in rows)
    value = compared_turns(turns, spec["judged"]) if good else math.nan
    met = value >= spec["limit"] if spec.get("at_least") else value <= spec["limit"]
    last |= {"goal": spec["goal"], "met": met, "faster": value if spec.get("at_least") and good else None}
    if "missing" in spec and last["status"] != "ok":
        last |= {"setting": "", "met": None, "status": "not installed", "message": spec["missing"]}
    elif "said" in spec and good:
        last["message"] = f"{value:.2f} {spec['said']}"
    if version := answers[-1].get("version"):
        bench.versions[last["program"]] = version


def compared_turns(turns: Sequence[Sequence[Answer]], judged: str) -> float:
    """Return the median over the turns: ratio or difference of last to first CPU seconds, or those of the last."""
    seconds = [(answers[0].get("cpu_s", math.nan), answers[-1].get("cpu_s", math.nan)) for answers in turns]
    values = {"ratio": [b / a for a, b in seconds], "difference": [b - a for a, b in seconds]}
    # a run that fails makes the result NaN, which meets no goal
    return float(np.median(values.get(judged, [b for _, b in seconds])))


# Statistics


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
    """Return medians of the numbers of several runs; all else is of the first that failed, or of the first."""
    worst = next((answer for answer in answers if answer["status"] != "ok"), answers[0])
    found = dict(worst)
    for key, value in worst.items():
        if isinstance(value, float) and all(key in answer for answer in answers):
            found[key] = statistics.median(answer[key] for answer in answers)
    return found | {"runs": len(answers)}


def judged(answer: Answer, truth: Sequence[Sequence[float]] | None, tolerance: float) -> Answer:
    """Return an answer with its error; one that is beyond the tolerance, %, is inaccurate."""
    if answer["status"] != "ok" or truth is None:
        return answer
    error = errors_percent(compared(answer), truth)
    answer = answer | {"error_percent": error}
    if error <= tolerance:
        return answer
    return answer | {"status": "inaccurate", "message": f"the error of {error:.2g} % exceeds {tolerance:g} %"}


# Page


def goals(rows: Sequence[Row]) -> list[Goal]:
    """Return the goals of the bench: answers of all programs, and each promise."""
    lost = sum(row["status"] not in ("ok", "left out") for row in rows)
    return [Goal("rows without an answer", lost, 0, len(rows))] + [
        Goal(f"{row['case']} ({row['goal']}), promises missed", None if row["met"] is None else not row["met"], 0, 1)
        for row in rows
        if row["goal"]
    ]


def machine() -> dict[str, str]:
    """Return the machine of the measurements: processor, system and load."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    processor = next(iter(named), platform.processor() or platform.machine())
    found = {"machine": f"{processor}, {os.cpu_count()} cores, {platform.system()} {platform.release()}"}
    if hasattr(os, "getloadavg"):
        found["load before"] = f"{os.getloadavg()[0]:.2f} processes in the last minute"
    return found | {"mkl": provenance.installed("mkl") or "not installed"}
