"""Speed: what the finite elements cost at a given error, beside FElupe and CalculiX, and the field beside magpylib.

bench_cases.toml and PARTS say what is measured and what is promised, templates/bench.md.j2 how.
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

from fem.accuracy import STANDARD
from geometry.design import BadInput, Design, paper
from geometry.messages import Progress
from studies.output import provenance
from studies.output.goals import Goal, failures, page_lines
from studies.output.result import Result, Table
from studies.validation import pages
from studies.validation.bench_programs import Answer, calculix, felupe, felupe_python, half_mesh, magtip, measure
from studies.validation.pages import Row
from studies.validation.peer_calculix import Press

Fields = Mapping[str, float | str]
"""Fields of a load or of an accuracy that differ from the defaults."""

DEPTHS_MM = tuple(0.25 * k for k in range(1, 13))
DEPTH_MM = 1.0
SECTIONS = (0.25, 0.22, 0.2, 0.19, 0.18, 0.16, 0.14, 0.12, 0.1, 0.08, 0.06)
CURVE, HALF = "press curve to 3 mm", "half model, press 1 mm"
"""Names of the cases that have peers."""
CASES = Path(__file__).with_name("bench_cases.toml")


def cases() -> list[Row]:
    """Return what is measured of magtip: rows of CASES, with infinite bounds where there is none."""
    found: list[Row] = tomllib.loads(CASES.read_text("utf-8"))["case"]
    return [dict.fromkeys(("tolerance_percent", "goal_s", "goal_MB"), math.inf) | case for case in found]


TRIANGLES = tuple((size, tip) for size in SECTIONS for tip in (1.0, 0.6))
"""Meshes for FElupe: edge length in units of D, and that at the tip over magtip's."""
CCX_LADDERS = {0.49: (0.3, 0.25, 0.2, 0.16), 0.4998: (0.2, 0.16, 0.14)}
"""Meshes for CalculiX, in units of D, for each Poisson's ratio that it is given; the second is the sensor's."""

LEAST, MORE_S, MODES_S, TIMES, FIELD_TIMES, TILTED = {"FElupe": 12.0, "CalculiX": 4.0}, 0.2, 0.5, 10.0, 4.0, 3.0
"""Goals: peers' CPU seconds over magtip's; CPU seconds of a small shear beyond the press, and of the modes; half over
harmonic model under shear; magpylib's CPU seconds over magtip's; a tilted plate's over those of a shear."""
POINTS = 1_000_000
TILT_DEG, TILTED_DEPTH_MM, SHEAR_MM = 8.0, 0.8, 1.0
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


# A run


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

    def add(self, case: str, program: str, setting: str, answer: Answer | None = None, **more: Any) -> Row:
        """Add a row of the table from the answer of a process and return it."""
        answer = answer or {}
        forces = answer.get("forces_N")
        row = dict.fromkeys(COLUMNS) | {name: answer[name] for name in COLUMNS if name in answer}
        row |= {"case": case, "program": program, "setting": setting, "force_N": forces[-1] if forces else None}
        row |= {"goal": "", "status": answer.get("status", "ok"), "message": answer.get("message", "")} | more
        self.rows.append(row)
        return row


def run(progress: Progress, bench: Bench, cases: Sequence[str] = ()) -> Result:
    """Measure the parts of these names, see `PARTS`; without names all.

    Raises
    ------
    BadInput
        A case has another name.
    """
    if unknown := [name for name in cases if name not in names()]:
        raise BadInput(f"--cases takes {', '.join(names())}; got {unknown[0]}")
    chosen = [part for name, part in PARTS if name in cases or not cases]
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
    about = {**about, **bench.versions}
    page = pages.rendered("bench.md.j2", verdict=page_lines(goals(rows)), tables=tables, about=about)
    return Result(
        title="Speed",
        records=rows,
        shown=[Table(title="Speed", rows=rows, brief=BRIEF)],
        tables={"bench": rows},
        pages={"BENCH.md": page},
        remarks=[f"{row['case']}: {row['message']}" for row in rows if row["message"]],
        failures=failures(goals(rows)),
    )


def names() -> list[str]:
    """Return the names of the parts of the bench."""
    return list(dict.fromkeys(name for name, _ in PARTS))


def spec(model: str, magnet: str, loads: Sequence[Fields], accuracy: Fields) -> Answer:
    """Return what `studies.validation.bench_worker` is to solve."""
    return {"task": "trace", "model": model, "magnet": magnet, "loads": list(loads), "accuracy": accuracy}


def measure_case(bench: Bench, case: Row) -> None:
    """Add magtip's row of one case; its reference also judges the peers."""
    # two models of one scene share its reference; that of a shear takes minutes
    truth = bench.references.get(case["name"])
    if truth is None and "reference" in case and not (bench.quick and case.get("slow_reference")):
        bench.say(f"{case['name']}: reference")
        found = magtip(spec(case["reference"][0], case["magnet"], case["loads"], case["reference"][1]))
        if found["status"] != "ok":
            lost = {"status": "no reference", "message": f"the reference failed: {found['message']}"}
            bench.add(case["name"], "magtip", "", lost, goal=f"within {case['tolerance_percent']:g} %", met=False)
            return
        truth = bench.references[case["name"]] = compared(found)
    bench.say(f"{case['name']}: magtip")

    def solve(accuracy: Fields) -> Answer:
        return magtip(spec(case["model"], case["magnet"], case["loads"], accuracy))

    rung, answer = measured(solve, case["ladder"], truth, case["tolerance_percent"], bench.runs)
    bench.chosen[case["name"]] = spec(case["model"], case["magnet"], case["loads"], rung)
    limits = ((case["goal_s"], "cpu_s", "s"), (case["goal_MB"], "peak_MB", "MB"))
    goals = [
        (f"at most {limit:g} {unit}", answer.get(key, math.inf) <= limit)
        for limit, key, unit in limits
        if math.isfinite(limit)
    ]
    faster = over_half(bench, case, answer)
    if faster is not None:
        goals.append((f"{TIMES:g} times faster than the half model", faster >= TIMES))
    met = answer["status"] == "ok" and all(good for _, good in goals)
    goal = ", ".join([text for text, _ in goals] + ([f"within {case['tolerance_percent']:g} %"] if truth else []))
    setting = ", ".join(f"{name} {value:g}{'' if name == 'harmonics' else ' D'}" for name, value in rung.items())
    bench.add(case["name"], "magtip", setting, answer, goal=goal, met=met, faster=faster)


def over_half(bench: Bench, case: Row, answer: Answer) -> float | None:
    """Return how many times faster than the half model a section answers the same scene; None if not measured."""
    half = next((row for row in bench.rows if row["case"] == case["name"] and "solid_size" in row["setting"]), None)
    if half is None or not half["cpu_s"] or half["status"] != "ok" or answer["status"] != "ok":
        return None
    return float(half["cpu_s"] / answer["cpu_s"])


def press_by_felupe(bench: Bench) -> None:
    """Add FElupe's row of the press curve; magtip and FElupe run by turns."""
    python = felupe_python(bench.peers)
    goal = f"magtip at least {LEAST['FElupe']:g} times faster"
    if python is None:
        install = f"python3 -m venv {bench.peers} && {bench.peers}/bin/pip install felupe==11.3.0"
        missing = {"status": "not installed", "message": f"FElupe is not installed: {install}"}
        bench.add(CURVE, "FElupe", "", missing, goal=goal)
        return
    bench.say(f"{CURVE}: FElupe")
    solve = functools.partial(felupe, python, bench.design, DEPTHS_MM)
    truth = bench.references.get(CURVE)
    (size, tip), answer = measured(lambda rung: solve(*rung), TRIANGLES, truth, 0.5, bench.runs)
    bench.versions["FElupe"] = answer.get("version", "")
    setting = f"second-order triangles (u, p, J), size {size:g} D, tip x {tip:g}"
    row = beside(bench, bench.add(CURVE, "FElupe", setting, answer, goal=goal))
    if row["met"] is not None:
        bench.say(f"{CURVE}: magtip and FElupe by turns")
        turns = [(magtip(bench.chosen[CURVE]), solve(size, tip)) for _ in range(bench.runs)]
        # a run that fails counts as the slowest
        row["faster"] = statistics.median(b.get("cpu_s", 0.0) / a.get("cpu_s", math.inf) for a, b in turns)
        row["met"] = row["faster"] >= LEAST["FElupe"]


def press_by_calculix(bench: Bench) -> None:
    """Add CalculiX' rows of the half model's press, one for each Poisson's ratio."""
    goal, command = f"magtip at least {LEAST['CalculiX']:g} times faster", shutil.which(bench.ccx)
    if command is None:
        message = "CalculiX is not installed: apt-get install calculix-ccx"
        bench.add(HALF, "CalculiX", "", {"status": "not installed", "message": message}, goal=goal)
        return
    said = measure([command, "-v"]).out.splitlines()
    bench.versions["CalculiX"] = next((f"ccx {line.split()[-1]}" for line in said if "Version" in line), "")
    design = bench.design
    press = Press(design.E, design.nu, design.L, design.R, DEPTH_MM)
    for nu, ladder in CCX_LADDERS.items():
        setting = f"C3D10, nu {nu:g}"
        if bench.quick and nu == design.nu:
            left_out = {"status": "left out", "message": "not part of the quick run"}
            bench.add(HALF, "CalculiX", setting, left_out)
            continue
        bench.say(f"{HALF}: CalculiX with nu {nu:g}")
        given = replace(press, nu=nu)
        if nu == design.nu:
            given = replace(given, contact="NODE TO SURFACE", stiffness=100.0)
        meshes = {size: half_mesh(design, size) for size in ladder}
        solve = functools.partial(_by_calculix, command, meshes, given)
        size, answer = measured(solve, ladder, bench.references.get(HALF), 1.0, bench.runs)
        beside(bench, bench.add(HALF, "CalculiX", f"{setting}, size {size:g} D", answer, goal=goal))


def _by_calculix(command: str, meshes: Mapping[float, Any], press: Press, size: float) -> Answer:
    return calculix(command, meshes[size], press)


def beside(bench: Bench, peer: Row) -> Row:
    """Add to a peer's row how many times faster magtip is."""
    own = next((row for row in bench.rows if row["case"] == peer["case"] and row["program"] == "magtip"), None)
    if own is not None and own["status"] == peer["status"] == "ok" and own["cpu_s"] and peer["cpu_s"]:
        peer["faster"] = peer["cpu_s"] / own["cpu_s"]
        peer["met"] = peer["faster"] >= LEAST[peer["program"]]
    return peer


def by_turns(bench: Bench, *tasks: Answer) -> tuple[list[Sequence[Answer]], list[Answer]]:
    """Return the answers of magtip to some tasks, by turns, and their medians."""
    turns = [[magtip(task) for task in tasks] for _ in range(bench.runs)]
    return list(turns), [median(answers) for answers in zip(*turns, strict=True)]


def small_shear(bench: Bench) -> None:
    """Add a small shear about a press beside the press alone, by turns, at level standard."""
    case = "small shear about a press of 1 mm"
    bench.say(case)
    press = spec("axisymmetric", "rigid", ({"depth": DEPTH_MM},), {})
    turns, (alone, sheared) = by_turns(bench, press, {"task": "small shear", "depth": DEPTH_MM})
    more = statistics.median(b.get("cpu_s", math.inf) - a.get("cpu_s", 0.0) for a, b in turns)
    bench.add(case, "magtip", "the press alone", alone)
    goal = f"at most {MORE_S:g} s more"
    bench.add(case, "magtip", "with stiffness and tilt", sheared, goal=goal, met=more <= MORE_S)


def natural_frequencies(bench: Bench) -> None:
    """Add the natural frequencies at level standard."""
    case = "first eight modes, rigid magnet"
    bench.say(case)
    _, (answer,) = by_turns(bench, {"task": "modes", "count": 8})
    met = bool(answer.get("cpu_s", math.inf) <= MODES_S)
    bench.add(case, "magtip", f"level {STANDARD.name}", answer, goal=f"at most {MODES_S:g} s", met=met)


def tilted_plate(bench: Bench) -> None:
    """Add a tilted plate beside a shear, by turns, both at level standard and with the model of `auto`."""
    case = f"plate tilted by {TILT_DEG:g} deg, press {TILTED_DEPTH_MM:g} mm"
    tilt: Fields = {"depth": TILTED_DEPTH_MM, "plate_tilt": math.radians(TILT_DEG)}
    shear: Fields = {"depth": TILTED_DEPTH_MM, "shear_x": SHEAR_MM, "friction": "stick"}
    bench.say(case)
    turns, (sheared, tilted) = by_turns(bench, *(spec("auto", "rigid", (load,), {}) for load in (shear, tilt)))
    bench.add(case, "magtip", f"the same press with a shear of {SHEAR_MM:g} mm instead", sheared)
    goal = f"at most {TILTED:g} times the CPU s of the shear"
    row = bench.add(case, "magtip", "tilted, level standard", tilted, goal=goal)
    if sheared["status"] == tilted["status"] == "ok":
        times = statistics.median(b["cpu_s"] / a["cpu_s"] for a, b in turns)
        row |= {"met": times <= TILTED, "message": f"{times:.2f} times the CPU s of the shear"}


def field_points(bench: Bench) -> None:
    """Add the magnet's field on one thread beside magpylib, by turns."""
    count = POINTS // 10 if bench.quick else POINTS
    case = f"field of {count:,} points".replace(",", " ")
    bench.say(case)
    turns, (own, other) = by_turns(bench, *({"task": task, "points": count} for task in ("field", "magpylib")))
    bench.add(case, "magtip", "one thread", own)
    goal = f"magtip at least {FIELD_TIMES:g} times faster"
    if other["status"] != "ok":
        missing = {"status": "not installed", "message": "magpylib does not run: pip install 'magpylib>=5.1'"}
        bench.add(case, "magpylib", "", missing, goal=goal)
        return
    bench.versions["magpylib"] = other["version"]
    faster = statistics.median(b["cpu_s"] / a["cpu_s"] for a, b in turns) if own["status"] == "ok" else None
    met = faster is not None and faster >= FIELD_TIMES
    bench.add(case, "magpylib", "one thread", other, goal=goal, faster=faster, met=met)


PARTS: list[tuple[str, Callable[[Bench], None]]] = [
    (case["key"], functools.partial(measure_case, case=case)) for case in cases()
]
"""The parts of the bench by name; a peer has the name of its case and follows it."""
PARTS[2:2] = [("half-press", press_by_calculix)]
PARTS[1:1] = [("press-curve", press_by_felupe)]
PARTS += [("tilted-plate", tilted_plate), ("small-shear", small_shear), ("modes", natural_frequencies)]
PARTS += [("field", field_points)]


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
