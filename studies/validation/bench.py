"""Speed: what the finite elements cost at a given error, beside FElupe and CalculiX, and the field beside magpylib.

bench_cases.toml says what is measured and what is promised, templates/bench.md.j2 how. Programs run in processes of
their own on one thread: magtip, FElupe in its own environment, CalculiX. CPU seconds and peak memory are what the
operating system counts for a process and its descendants.
"""

import functools
import importlib.util
import itertools
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
from collections.abc import Callable, Mapping, Sequence
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

CASES: list[Row] = tomllib.loads(Path(__file__).with_name("bench_cases.toml").read_text("utf-8"))["case"]
COLUMNS = (
    *("case", "program", "setting", "dofs", "iterations", "runs", "import_s", "cpu_s", "wall_s", "peak_MB"),
    *("force_N", "error_percent", "faster", "goal", "met", "status", "message"),
)
"""Columns of bench.csv; None where a number is not known. force_N is of the last load, error_percent of the worst."""
BRIEF = ("iterations", "runs", "import_s", "wall_s", "force_N", "message")
"""Left out of the printed table."""
LEFT_OUT = {"status": "left out", "message": "not part of the quick run"}
HEADS = {name: name for name in ("program", "setting", "iterations", "runs", "goal", "met", "status", "message")}
HEADS |= {"dofs": "unknowns", "error_percent": "error %", "import_s": "imports s", "cpu_s": "CPU s"}
HEADS |= {"wall_s": "wall s", "peak_MB": "peak MB", "faster": "magtip faster by a factor of"}
"""Heads of the page's columns; those that a case does not fill are left out."""
FILES = ("BENCH.md", "bench.csv")
Answer = Row
"""The JSON object that a measured process prints, with what was counted of it."""
Solve = Callable[[], Answer] | str
"""Solves one run of a case, or says that its program is not installed, and how to install it."""


class Bench(NamedTuple):
    """Options of a study: whether it is quick, the folder of FElupe's environment, and the command of CalculiX."""

    quick: bool
    peers: Path
    ccx: str


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
        Run only some cases, with commas between their names: press-curve, half-press, half-press-magnet, shear,
        friction, tilted-plate, small-shear, modes, field; default: all.
    peers
        Folder of a Python environment with FElupe: python3 -m venv DIR && DIR/bin/pip install felupe.
    ccx
        Command that runs CalculiX.
    """
    asked = [] if cases is None else [name.strip() for name in cases.split(",")]
    names = [case["key"] for case in CASES]
    if unknown := [name for name in asked if name not in names]:
        raise BadInput(f"--cases takes {', '.join(names)}; got {unknown[0]}")
    chosen = pages.told(
        progress, [case for case in CASES if case["key"] in (asked or names)], lambda case: case["name"]
    )
    rows = itertools.chain.from_iterable(measured(case, Bench(quick, peers, ccx)) for case in chosen)
    return pages.collected(rows, functools.partial(result, machine()))


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


# Cases, whose runs take turns


def measured(case: Row, bench: Bench) -> list[Row]:
    truth = None
    if "reference" in case and not (bench.quick and case.get("slow_reference")):
        found = magtip(task(case, case["reference"]))
        if found["status"] != "ok":
            lost = {"status": "no reference", "message": f"the reference failed: {found['message']}", "met": False}
            return [row_of(case, case["runs"][0], lost)]
        truth = compared(found)
    solves = [solve_of(case, one, bench) for one in case["runs"]]
    turns: list[list[Answer]] = [[] for _ in solves]
    for turn in range(3 if bench.quick else 5):
        for answers, solve, one in zip(turns, solves, case["runs"], strict=True):
            if not isinstance(solve, str) and not (one.get("slow") and (bench.quick or turn)):
                answers.append(solve())
    rows = []
    for one, solve, answers in zip(case["runs"], solves, turns, strict=True):
        if answers:
            limit = (case | one).get("tolerance_percent", math.inf)
            answer = judged(median(answers), truth, limit) | beside(turns[0], answers)
            if "goal" in one:
                # what is not known meets no goal
                within = [answer.get(name, math.nan) <= most for name, most in one.get("most", {}).items()]
                beyond = [answer.get(name, math.nan) >= least for name, least in one.get("least", {}).items()]
                answer["met"] = answer["status"] == "ok" and all(within + beyond)
        else:
            answer = {"status": "not installed", "message": solve} if isinstance(solve, str) else dict(LEFT_OUT)
        rows.append(row_of(case, one, answer))
    return rows


def row_of(case: Row, one: Row, answer: Answer) -> Row:
    row = dict.fromkeys(COLUMNS) | {name: answer[name] for name in COLUMNS if name in answer}
    row |= {"case": case["name"], "program": one.get("program", "magtip"), "setting": one["setting"]}
    row |= {"force_N": next(iter(answer.get("forces_N", ())[-1:]), None), "goal": one.get("goal", "")}
    known = "least" in one and answer["status"] == "ok"
    return row | {"faster": answer["faster"] if known else None, "version": answer.get("version", "")}


def solve_of(case: Row, one: Row, bench: Bench) -> Solve:
    if one.get("program") == "FElupe":
        return felupe_press(bench.peers, [load["depth"] for load in case["loads"]], one)
    if one.get("program") == "CalculiX":
        return calculix_press(bench.ccx, case["loads"][0]["depth"], one)
    if one.get("program") == "magpylib" and not importlib.util.find_spec("magpylib"):
        return "magpylib is not installed: pip install 'magpylib>=5.1'"
    return functools.partial(magtip, task(case, one))


def task(case: Row, one: Row) -> Answer:
    """Return a run of a case as a task of `studies.validation.bench_worker`, which reads what it needs."""
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


def felupe_press(peers: Path, depths: Sequence[float], peer: Row) -> Solve:
    """Return what solves a press curve by FElupe.

    The mesh has edges of `size` over D, and at the tip `tip` times magtip's.
    """
    python, design = (peers / "bin" / "python").absolute(), paper()
    if not python.exists() or measure([str(python), "-c", "import felupe"]).exit:
        return f"FElupe is not installed: python3 -m venv {peers} && {peers}/bin/pip install felupe==11.3.0"
    numbers = {"E_MPa": design.E, "nu": design.nu, "L_mm": design.L, "R_mm": design.R, "depths_mm": depths}

    def solve() -> Answer:
        with tempfile.TemporaryDirectory() as folder:
            given = Path(folder, "given.npz")
            np.savez(given, **section_arrays(design, peer["size"], peer["tip"], min(depths)), **numbers)  # type: ignore[arg-type]
            script = str(Path(__file__).with_name("peer_felupe.py"))
            return _answer(measure([str(python), "-W", "ignore", script, str(given)]))

    return solve


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


def calculix_press(ccx: str, depth: float, peer: Row) -> Solve:
    command, design = shutil.which(ccx), paper()
    if command is None:
        return "CalculiX is not installed: apt-get install calculix-ccx"
    said = measure([command, "-v"]).out.splitlines()
    version = next((f"ccx {line.split()[-1]}" for line in said if "Version" in line), "")
    press = {"E": design.E, "L": design.L, "R": design.R, "depth": depth} | peer
    edge = peer["size"] * design.D

    def solve() -> Answer:
        mesh = tetrahedra(design.shape, edge, tip_size=edge / 2, half=True, magnet="none")
        return calculix(command, mesh, press) | {"version": version}

    return solve


def calculix(ccx: str, mesh: Any, press: Row) -> Answer:
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
