"""Speed: what the finite elements cost at a given error, beside FElupe and CalculiX, and the field beside magpylib.

bench_cases.toml says what is measured and what is promised, templates/bench.md.j2 how. Programs run in processes of
their own on one thread: magtip, FElupe in its own environment, CalculiX. CPU seconds and peak memory are what the
operating system counts for a process and its descendants.
"""

import functools
import json
import math
import os
import platform
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from geometry.design import BadInput, Design, paper
from geometry.mesh import tetrahedra
from geometry.messages import Progress
from geometry.section import section
from studies.output import provenance
from studies.output.goals import Goal
from studies.output.result import Result
from studies.validation import pages
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
Answer = Row
"""The JSON object that a measured process prints, with what was counted of it."""
Solve = Callable[[], Answer] | str
"""Solves by a peer, or says that it is not installed, and how to install it."""


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
    kinds: tuple[tuple[str, Callable[..., None]], ...] = (("case", measure_case), ("pair", by_turns))
    return [(spec["key"], functools.partial(run, spec=spec)) for kind, run in kinds for spec in SPECS[kind]]


def run(
    progress: Progress,
    *,
    quick: bool = False,
    cases: str | None = None,
    peers: Path = Path("out/peers"),
    ccx: str = "ccx",
) -> Result:
    """Measure time and memory at a given error beside FElupe, CalculiX and magpylib.

    A program that is not installed gets a row with its install command. Missed goals are listed; the exit status is
    then 3, also where a program is not installed.

    Parameters
    ----------
    quick
        Use medians of 3 runs instead of 5, and no references of shears.
    cases
        Run only some cases, with commas between their names: press-curve, half-press, half-press-magnet, half-shear,
        shear, friction, tilted-plate, small-shear, modes, field; default: all.
    peers
        Folder of a Python environment with FElupe: python3 -m venv DIR && DIR/bin/pip install felupe.
    ccx
        Command that runs CalculiX.
    """
    bench, own = Bench(quick, peers, ccx), [] if cases is None else [name.strip() for name in cases.split(",")]
    names = [name for name, _ in parts()]
    if unknown := [name for name in own if name not in names]:
        raise BadInput(f"--cases takes {', '.join(names)}; got {unknown[0]}")
    chosen = [part for name, part in parts() if name in own or not own]

    def measured() -> Iterator[Row]:
        for k, part in enumerate(chosen):
            known = len(bench.rows)
            bench.say = functools.partial(progress, k / len(chosen))
            part(bench)
            yield from bench.rows[known:]

    return pages.collected(measured(), functools.partial(result, bench, machine()))


def result(bench: Bench, about: Mapping[str, str], rows: Sequence[Row]) -> Result:
    """Return the result of measured rows; `about` says on which machine."""
    tables = {}
    for case in dict.fromkeys(row["case"] for row in rows):
        own = [row for row in rows if row["case"] == case]
        filled = [name for name in COLUMNS if name in HEADS and any(row[name] not in (None, "") for row in own)]
        tables[case.capitalize()] = own, {name: HEADS[name] for name in filled}
    page = {"tables": tables, "about": {**about, **bench.versions}}
    remarks = [f"{row['case']}: {row['message']}" for row in rows if row["message"]]
    return pages.study("bench", "Speed", rows, page, look={"brief": BRIEF}, goals=goals(rows), remarks=remarks)


def goals(rows: Sequence[Row]) -> list[Goal]:
    """Return the goals of the bench: answers of all programs, and each promise."""
    lost = sum(row["status"] not in ("ok", "left out") for row in rows)
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


# Cases, and tasks by turns


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
    limits = (("goal_s", "cpu_s", "s"), ("goal_MB", "peak_MB", "MB"))
    goals = [
        (f"at most {spec[key]:g} {unit}", answer.get(of, math.inf) <= spec[key])
        for key, of, unit in limits
        if key in spec
    ]
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
    first, last = (np.array([answers[k].get("cpu_s", math.nan) for answers in turns]) for k in (0, -1))
    # a run that fails makes the result NaN, which meets no goal
    return float(np.median(last / first if judged == "ratio" else last - first if judged == "difference" else last))


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
    answer = answer | {"error_percent": (error := errors_percent(compared(answer), truth))}
    if error <= tolerance:
        return answer
    return answer | {"status": "inaccurate", "message": f"the error of {error:.2g} % exceeds {tolerance:g} %"}


# Processes

THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "CCX_NPROC_EQUATION_SOLVER")
LIMIT_S = 1800.0
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
        """The last line that is not empty, of standard error or else of standard output."""
        return next((line.strip() for line in reversed(f"{self.out}\n{self.err}".splitlines()) if line.strip()), "")


def measure(
    command: Sequence[str], folder: Path | None = None, env: Mapping[str, str] | None = None, limit: float = LIMIT_S
) -> Ended:
    """Run a command on one thread and return what it used; beyond the limit in seconds it is stopped."""
    if os.name != "posix":
        raise BadInput("bench needs Linux or macOS, which count what processes use: run it there")
    with tempfile.TemporaryDirectory() as own:
        report = Path(own, "used.json")
        start = [sys.executable, "-I", "-S", "-c", _LAUNCHER, str(report), str(folder or own), *command]
        given = {**os.environ, **dict.fromkeys(THREADS, "1"), **(env or {})}
        process = subprocess.Popen(
            start, env=given, stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8", errors="replace",
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
    """Return the answer of one task of `studies.validation.bench_worker` in a fresh process."""
    path = os.pathsep.join(filter(None, (str(provenance.ROOT), os.environ.get("PYTHONPATH", ""))))
    # -P: the worker's own folder is no folder of packages
    command = [sys.executable, "-P", str(Path(__file__).with_name("bench_worker.py")), json.dumps(task)]
    return _answer(measure(command, env={"PYTHONPATH": path}))


def _answer(ended: Ended) -> Answer:
    """Return the JSON object that a process printed, with its peak memory; its last words if it failed."""
    if ended.exit or not ended.out.strip():
        return {"status": "failed", "message": ended.last_words or f"exit status {ended.exit}"}
    found: Answer = json.loads(ended.out.strip().splitlines()[-1])
    return found | {"peak_MB": ended.peak_MB}


# FElupe


def felupe_press(bench: Bench, spec: Row, peer: Row) -> tuple[str, Solve]:
    """Return the setting of FElupe, and what solves the press curve by it.

    The mesh has edges of `size` over D, and at the tip `tip` times magtip's.
    """
    python, size, tip = (bench.peers / "bin" / "python").absolute(), peer["size"], peer["tip"]
    if not python.exists() or measure([str(python), "-c", "import felupe"]).exit:
        install = f"python3 -m venv {bench.peers} && {bench.peers}/bin/pip install felupe==11.3.0"
        return "", f"FElupe is not installed: {install}"
    design, depths = paper(), [load["depth"] for load in spec["loads"]]
    numbers = {"E_MPa": design.E, "nu": design.nu, "L_mm": design.L, "R_mm": design.R, "depths_mm": depths}

    def solve() -> Answer:
        with tempfile.TemporaryDirectory() as folder:
            given = Path(folder, "given.npz")
            np.savez(given, **section_arrays(design, size, tip, min(depths)), **numbers)  # type: ignore[arg-type]
            script = str(Path(__file__).with_name("peer_felupe.py"))
            answer = _answer(measure([str(python), "-W", "ignore", script, str(given)]))
        bench.versions["FElupe"] = answer.get("version", "")
        return answer

    return f"second-order triangles (u, p, J), size {size:g} D, tip x {tip:g}", solve


def section_arrays(design: Design, size: float, tip: float, least_depth: float) -> Answer:
    """Return the all-silicone section mesh as arrays for FElupe.

    points (n, 2) r, z in mm; cells (m, 6); nodes of base, axis and edges. Its edge length at the tip is `tip` times
    magtip's, which follows from the contact at the least depth.
    """
    tip *= size / 0.72 * math.sqrt(design.R * least_depth) / design.D
    mesh = section(design.shape, size * design.D, tip_size=min(tip, size) * design.D, magnet="none")
    edges = {
        name: np.column_stack([mesh.facets[:, facets].T, mesh.nvertices + facets])
        for name, facets in mesh.boundaries.items()
    }
    nodes = {name: np.unique(edges[name]) for name in ("base", "axis")}
    return {"points": mesh.doflocs.T, "cells": np.asarray(mesh.dofs.element_dofs).T, **nodes, "edges": edges["skin"]}


# CalculiX

FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
"""Corners of CalculiX' faces S1 to S4."""
TURNED = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]
"""Nodes of a cell after corners 1 and 2 have changed places."""


def calculix_press(bench: Bench, spec: Row, peer: Row) -> tuple[str, Solve]:
    """Return the setting of CalculiX, and what solves the half model's press by it."""
    command, design = shutil.which(bench.ccx), paper()
    if command is None:
        return "", "CalculiX is not installed: apt-get install calculix-ccx"
    said = measure([command, "-v"]).out.splitlines()
    bench.versions["CalculiX"] = next((f"ccx {line.split()[-1]}" for line in said if "Version" in line), "")
    press = {"E": design.E, "L": design.L, "R": design.R, "depth": spec["loads"][0]["depth"]} | peer
    edge = peer["size"] * design.D

    def solve() -> Answer:
        return calculix(command, tetrahedra(design.shape, edge, tip_size=edge / 2, half=True, magnet="none"), press)

    return f"C3D10, nu {peer['nu']:g}, size {peer['size']:g} D", solve


def calculix(ccx: str, mesh: Any, press: Row) -> Answer:
    """Return the half model's press by CalculiX on a tetrahedral mesh in mm."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "press.inp").write_text(deck(mesh, press))
        ended = measure([ccx, "-i", "press"], folder=Path(folder))
        printed = Path(folder, "press.dat")
        text = printed.read_text() if printed.exists() else ""
    answer = {"dofs": 3 * mesh.doflocs.shape[1], "iterations": iterations(ended.out), "import_s": 0.0}
    answer |= {"cpu_s": ended.cpu_s, "peak_MB": ended.peak_MB}
    try:
        time, normal = force(text)
    except ValueError as error:
        return answer | {"status": "failed", "message": f"{error}: {ended.last_words}"}
    if ended.exit or time < 1:
        at = f"stopped at {time:.2g} of the depth: {ended.last_words}"
        return answer | {"status": "not_converged", "message": at}
    return answer | {"status": "ok", "message": "", "forces_N": [[0.0, 0.0, normal]]}


def deck(mesh: Any, press: Row) -> str:
    """Return the input deck for a scikit-fem MeshTet2 with boundaries "base", "skin" and "symmetry".

    `press` has the modulus E, MPa, nu, length L and radius R of the beam and the depth, mm; CalculiX' type of
    `contact` pair, and the `stiffness` of the contact, MPa per mm.
    """
    points, cells = mesh.doflocs.T, np.asarray(mesh.dofs.element_dofs).T
    slopes = points[cells[:, 1:4]] - points[cells[:, :1]]
    cells = np.where(np.linalg.det(slopes)[:, None] < 0, cells[:, TURNED], cells) + 1
    E, nu, L, R = (press[name] for name in ("E", "nu", "L", "R"))
    corners = [(x, y, z) for z in (L, L + 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    base, symmetry = (np.flatnonzero(np.abs(points[:, k]) < 1e-9) + 1 for k in (2, 1))
    return pages.rendered(
        "calculix.inp.j2",
        points=[*points.tolist(), *((1.5 * R * x, 1.5 * R * y, z) for x, y, z in corners)],
        nodes=len(points),
        cells=cells.tolist(),
        base=base.tolist(),
        symmetry=np.setdiff1d(symmetry, base).tolist(),
        faces=_faces(mesh, cells, L, 1.5 * np.sqrt(R * press["depth"])),
        moduli=(E / 4 / (1 + nu), 6 * (1 - 2 * nu) / E),
        press={"contact": "SURFACE TO SURFACE", "stiffness": 300.0} | press,
    )


def _faces(mesh: Any, cells: Any, L: float, reach: float) -> list[str]:
    """Return the faces of the skin that the plate may touch, as CalculiX names them."""
    skin = {tuple(sorted(corners)) for corners in (mesh.facets[:, mesh.boundaries["skin"]].T + 1).tolist()}
    found = []
    for side, local in enumerate(FACES, 1):
        middle = mesh.doflocs.T[cells[:, local] - 1].mean(axis=1)
        near = np.flatnonzero((np.hypot(middle[:, 0], middle[:, 1]) < reach) & (middle[:, 2] > L / 2))
        found += [f"{i + 1}, S{side}" for i in near if tuple(sorted(cells[i, local].tolist())) in skin]
    return found


def force(printed: str) -> tuple[float, float]:
    """Return time and whole force, N, of the last increment in a .dat file; ValueError without any."""
    found = re.findall(r"total force .*time\s+(\S+)\s+\S+\s+\S+\s+(\S+)", printed)
    if not found:
        raise ValueError("CalculiX printed no force")
    time, normal = map(float, found[-1])
    return time, 2 * normal


def iterations(said: str) -> int:
    return len(re.findall(r"^ iteration +\d+", said, flags=re.MULTILINE))
