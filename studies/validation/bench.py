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
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from geometry.design import BadInput, Design, paper
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
TRIANGLES = [
    (size, tip) for size in (0.25, 0.22, 0.2, 0.19, 0.18, 0.16, 0.14, 0.12, 0.1, 0.08, 0.06) for tip in (1.0, 0.6)
]
"""Meshes for FElupe: edge length in units of D, and that at the tip over magtip's."""
CCX_LADDERS = {0.49: (0.3, 0.25, 0.2, 0.16), 0.4998: (0.2, 0.16, 0.14)}
"""Meshes for CalculiX, in units of D, for each Poisson's ratio that it is given; the second is the sensor's."""
LEAST, TIMES = {"FElupe": 12.0, "CalculiX": 4.0}, 10.0
"""Goals: peers' CPU seconds over magtip's, and those of the half model over the harmonic one's under a shear."""
LONG_S = 20.0
"""CPU seconds beyond which a solve is measured once."""
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
    """Options of a run, its rows so far, and the references and chosen accuracies of its cases."""

    quick: bool
    peers: Path
    ccx: str
    say: Callable[[str], None] = lambda text: None
    design: Design = field(default_factory=paper)
    rows: list[Row] = field(default_factory=list)
    versions: dict[str, str] = field(default_factory=dict)
    references: dict[str, list[Sequence[float]]] = field(default_factory=dict)
    chosen: dict[str, Answer] = field(default_factory=dict)

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

    def row_of(self, case: str, setting: str = "") -> Row | None:
        """Return magtip's first row of a case with an answer, and these words in its setting."""
        own = (row for row in self.rows if (row["case"], row["program"], row["status"]) == (case, "magtip", "ok"))
        return next((row for row in own if setting in row["setting"] and row["cpu_s"]), None)


def parts() -> list[tuple[str, Callable[[Bench], None]]]:
    """Return the parts of the bench by name; a peer has the name of its case and follows it."""
    found: list[tuple[str, Callable[[Bench], None]]] = []
    peers = {"press-curve": press_by_felupe, "half-press": press_by_calculix}
    for case in SPECS["case"]:
        found.append((case["key"], functools.partial(measure_case, case=case)))
        found += [(case["key"], peers[case["key"]])] if case["key"] in peers else []
    return found + [(pair["key"], functools.partial(by_turns, pair=pair)) for pair in SPECS["pair"]]


def run(progress: Progress, bench: Bench, cases: Sequence[str] = ()) -> Result:
    """Measure the parts of these names; without names all.

    Raises
    ------
    BadInput
        A case has another name.
    """
    names = list(dict.fromkeys(name for name, _ in parts()))
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


def spec(case: Row, model: str, accuracy: Mapping[str, float]) -> Answer:
    """Return a case as what `studies.validation.bench_worker` is to solve."""
    return {"task": "trace", "magnet": case["magnet"], "loads": case["loads"], "model": model, "accuracy": accuracy}


def measure_case(bench: Bench, case: Row) -> None:
    """Add magtip's row of one case; its reference also judges the peers."""
    name, tolerance = case["name"], case.get("tolerance_percent", math.inf)
    # two models of one scene share its reference; that of a shear takes minutes
    truth = bench.references.get(name)
    if truth is None and "reference" in case and not (bench.quick and case.get("slow_reference")):
        bench.say(f"{name}: reference")
        found = magtip(spec(case, *case["reference"]))
        if found["status"] != "ok":
            lost = {"status": "no reference", "message": f"the reference failed: {found['message']}"}
            bench.add(name, "magtip", "", lost, goal=f"within {tolerance:g} %", met=False)
            return
        truth = bench.references[name] = compared(found)
    bench.say(f"{name}: magtip")
    rung, answer = measured(
        lambda rung: magtip(spec(case, case["model"], rung)), case["ladder"], truth, tolerance, bench.runs
    )
    bench.chosen[name] = spec(case, case["model"], rung)
    limits = [
        (case[key], answer.get(of, math.inf), unit)
        for key, of, unit in (("goal_s", "cpu_s", "s"), ("goal_MB", "peak_MB", "MB"))
        if key in case
    ]
    goals = [(f"at most {limit:g} {unit}", value <= limit) for limit, value, unit in limits]
    faster, half = None, bench.row_of(name, "solid_size")
    if half is not None and answer["status"] == "ok":
        faster = half["cpu_s"] / answer["cpu_s"]
        goals.append((f"{TIMES:g} times faster than the half model", faster >= TIMES))
    met = answer["status"] == "ok" and all(good for _, good in goals)
    goal = ", ".join([text for text, _ in goals] + ([f"within {tolerance:g} %"] if truth else []))
    setting = ", ".join(f"{key} {value:g}{'' if key == 'harmonics' else ' D'}" for key, value in rung.items())
    bench.add(name, "magtip", setting, answer, goal=goal, met=met, faster=faster)


def press_by_felupe(bench: Bench, case: Row = SPECS["case"][0]) -> None:
    """Add FElupe's row of the press curve; magtip and FElupe run by turns."""
    name, python = case["name"], felupe_python(bench.peers)
    goal = f"magtip at least {LEAST['FElupe']:g} times faster"
    if python is None:
        install = f"python3 -m venv {bench.peers} && {bench.peers}/bin/pip install felupe==11.3.0"
        missing = {"status": "not installed", "message": f"FElupe is not installed: {install}"}
        bench.add(name, "FElupe", "", missing, goal=goal)
        return
    bench.say(f"{name}: FElupe")
    solve = functools.partial(felupe, python, bench.design, [load["depth"] for load in case["loads"]])
    truth = bench.references.get(name)
    (size, tip), answer = measured(lambda rung: solve(*rung), TRIANGLES, truth, 0.5, bench.runs)
    bench.versions["FElupe"] = answer.get("version", "")
    setting = f"second-order triangles (u, p, J), size {size:g} D, tip x {tip:g}"
    row = beside(bench, bench.add(name, "FElupe", setting, answer, goal=goal))
    if row["met"] is not None:
        bench.say(f"{name}: magtip and FElupe by turns")
        turns = [(magtip(bench.chosen[name]), solve(size, tip)) for _ in range(bench.runs)]
        row["faster"] = compared_turns(turns, "ratio")
        row["met"] = row["faster"] >= LEAST["FElupe"]


def press_by_calculix(bench: Bench, case: Row = SPECS["case"][1]) -> None:
    """Add CalculiX' rows of the half model's press, one for each Poisson's ratio."""
    from geometry.mesh import tetrahedra

    name, goal = case["name"], f"magtip at least {LEAST['CalculiX']:g} times faster"
    command = shutil.which(bench.ccx)
    if command is None:
        message = "CalculiX is not installed: apt-get install calculix-ccx"
        bench.add(name, "CalculiX", "", {"status": "not installed", "message": message}, goal=goal)
        return
    said = measure([command, "-v"]).out.splitlines()
    bench.versions["CalculiX"] = next((f"ccx {line.split()[-1]}" for line in said if "Version" in line), "")
    design = bench.design
    press = Press(design.E, design.nu, design.L, design.R, case["loads"][0]["depth"])
    for nu, ladder in CCX_LADDERS.items():
        setting = f"C3D10, nu {nu:g}"
        if bench.quick and nu == design.nu:
            bench.add(name, "CalculiX", setting, {"status": "left out", "message": "not part of the quick run"})
            continue
        bench.say(f"{name}: CalculiX with nu {nu:g}")
        given = replace(press, nu=nu)
        if nu == design.nu:
            given = replace(given, contact="NODE TO SURFACE", stiffness=100.0)

        def solve(size: float, given: Press = given) -> Answer:
            edge = size * design.D
            mesh = tetrahedra(design.shape, edge, tip_size=edge / 2, half=True, magnet="none")
            return calculix(command, mesh, given)

        size, answer = measured(solve, ladder, bench.references.get(name), 1.0, bench.runs)
        beside(bench, bench.add(name, "CalculiX", f"{setting}, size {size:g} D", answer, goal=goal))


def beside(bench: Bench, peer: Row) -> Row:
    """Add to a peer's row how many times faster magtip is."""
    own = bench.row_of(peer["case"])
    if own is not None and peer["status"] == "ok" and peer["cpu_s"]:
        peer["faster"] = peer["cpu_s"] / own["cpu_s"]
        peer["met"] = peer["faster"] >= LEAST[peer["program"]]
    return peer


def by_turns(bench: Bench, pair: Row) -> None:
    """Add the rows of tasks that run by turns; the last one is judged, beside the first one or alone."""
    bench.say(pair["name"])
    turns = [[magtip(task) for task in pair["tasks"]] for _ in range(bench.runs)]
    answers = [median(own) for own in zip(*turns, strict=True)]
    programs = pair.get("programs", ["magtip"] * len(answers))
    rows = [bench.add(pair["name"], *place) for place in zip(programs, pair["settings"], answers, strict=True)]
    last, good = rows[-1], all(row["status"] == "ok" for row in rows)
    value = compared_turns(turns, pair["judged"]) if good else math.nan
    met = value >= pair["limit"] if pair.get("at_least") else value <= pair["limit"]
    last |= {"goal": pair["goal"], "met": met, "faster": value if pair.get("at_least") and good else None}
    if "missing" in pair and last["status"] != "ok":
        last |= {"setting": "", "met": None, "status": "not installed", "message": pair["missing"]}
    elif "said" in pair and good:
        last["message"] = f"{value:.2f} {pair['said']}"
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
    known = [a["error_percent"] for a in answers if a.get("error_percent") is not None]
    return found | {"error_percent": max(known, default=None), "runs": len(answers)}


def measured(
    solve: Callable[[Any], Answer],
    ladder: Iterable[Any],
    truth: Sequence[Sequence[float]] | None,
    tolerance: float,
    runs: int,
) -> tuple[Any, Answer]:
    """Return the cheapest rung that is within tolerance (%) in all of several runs, and their medians.

    Each rung is solved once; those within tolerance are repeated, the cheapest first. Where none is, the most
    accurate one counts, and where nothing was solved the last one.
    """

    def judged(rung: Any) -> Answer:
        answer = solve(rung)
        if answer["status"] == "ok" and truth is not None:
            answer["error_percent"] = errors_percent(compared(answer), truth)
        return answer

    tried = [(rung, judged(rung)) for rung in ladder]
    solved = [pair for pair in tried if pair[1]["status"] == "ok"]
    good = [pair for pair in solved if truth is not None and pair[1]["error_percent"] <= tolerance]
    good.sort(key=lambda pair: pair[1]["cpu_s"])
    if truth is None or not solved:
        good = [(solved or tried)[-1]]
    elif not good:
        good = [min(solved, key=lambda pair: pair[1]["error_percent"])]
    for rung, first in good:
        once = first["status"] != "ok" or first["cpu_s"] > LONG_S
        found = median([first] if once else [judged(rung) for _ in range(runs)])
        error = found["error_percent"]
        if found["status"] != "ok" or error is None or error <= tolerance:
            break
        found |= {"status": "inaccurate", "message": f"the error of {error:.2g} % exceeds {tolerance:g} %"}
    return rung, found


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
