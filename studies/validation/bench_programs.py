"""Programs that the bench measures in processes of their own: magtip, FElupe in its own environment, CalculiX.

CPU seconds and peak memory are what the operating system counts for a process and its descendants. All run on one
thread.

CalculiX gets the half model's press as an input deck (templates/calculix.inp.j2): a second-order tetrahedral mesh of
y >= 0 with clamped base and symmetry plane, pressed by a rigid plate, a single C3D8 all of whose nodes are moved. The
energy of *HYPERELASTIC, NEO HOOKE, C10 (I1 - 3) + (J - 1)^2 / D1, is that of magtip with C10 = mu / 2 and D1 = 2 / K.
What was chosen for CalculiX: C3D10, because C3D10T treats nothing but temperatures otherwise; linear penalty contact
of faces with faces, or of nodes with a face; one increment, which CalculiX shortens where it must; the solver of its
build (SPOOLES in Debian's). C3D10 has no pressure of its own: with the sensor's Poisson's ratio it is too stiff and
wants many iterations, so that a second setting takes a smaller one. That changes the material, and the force with
it, by an amount that counts as error.
"""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from geometry.design import BadInput, Design
from studies.output.provenance import ROOT
from studies.validation import pages

Answer = dict[str, Any]
"""The JSON object that a measured process prints, with what was counted of it."""
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


@dataclass(frozen=True, slots=True)
class Ended:
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
    """Run a command on one thread and return what it used; beyond the limit in seconds it is stopped.

    Raises
    ------
    BadInput
        This system does not count what processes use.
    """
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
        except subprocess.TimeoutExpired:
            _stop(process)
            return Ended(-1, math.nan, math.nan, "", f"stopped after {limit:g} s")
        except BaseException:
            _stop(process)
            raise
        used = json.loads(report.read_text())
    return Ended(out=out, err=err, **used)


def _stop(process: subprocess.Popen[str]) -> None:
    """End the process and all it has started, which are a session of their own."""
    import signal

    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()


def magtip(task: Answer) -> Answer:
    """Return the answer of one task of `studies.validation.bench_worker` in a fresh process."""
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", ""))))
    # -P: the worker's own folder is no folder of packages
    command = [sys.executable, "-P", str(ROOT / "studies/validation/bench_worker.py"), json.dumps(task)]
    return _answer(measure(command, env={"PYTHONPATH": path}))


def _answer(ended: Ended) -> Answer:
    """Return the JSON object that a process printed, with its peak memory; its last words if it failed."""
    if ended.exit or not ended.out.strip():
        return {"status": "failed", "message": ended.last_words or f"exit status {ended.exit}"}
    found: Answer = json.loads(ended.out.strip().splitlines()[-1])
    return found | {"peak_MB": ended.peak_MB}


def felupe_python(peers: Path) -> Path | None:
    """Return the interpreter of a folder that holds FElupe's environment, if it can import it."""
    python = (peers / "bin" / "python").absolute()
    return python if python.exists() and not measure([str(python), "-c", "import felupe"]).exit else None


def felupe(python: Path, design: Design, depths: Sequence[float], size: float, tip: float) -> Answer:
    """Return the press curve by FElupe on a mesh of edge length `size` over D, at the tip `tip` times magtip's."""
    numbers = {"E_MPa": design.E, "nu": design.nu, "L_mm": design.L, "R_mm": design.R, "depths_mm": depths}
    with tempfile.TemporaryDirectory() as folder:
        given = Path(folder, "given.npz")
        np.savez(given, **section_arrays(design, size, tip, min(depths)), **numbers)  # type: ignore[arg-type]
        script = str(ROOT / "studies/validation/peer_felupe.py")
        return _answer(measure([str(python), "-W", "ignore", script, str(given)]))


def section_arrays(design: Design, size: float, tip: float, least_depth: float) -> Answer:
    """Return the all-silicone section mesh as arrays for FElupe.

    points (n, 2) r, z in mm; cells (m, 6); nodes of base, axis and edges. Its edge length at the tip is `tip` times
    magtip's, which follows from the contact at the least depth.
    """
    from geometry.section import section

    tip *= size / 0.72 * math.sqrt(design.R * least_depth) / design.D
    mesh = section(design.shape, size * design.D, tip_size=min(tip, size) * design.D, magnet="none")
    edges = {
        name: np.column_stack([mesh.facets[:, facets].T, mesh.nvertices + facets])
        for name, facets in mesh.boundaries.items()
    }
    return {
        "points": mesh.doflocs.T,
        "cells": np.asarray(mesh.dofs.element_dofs).T,
        "base": np.unique(edges["base"]),
        "axis": np.unique(edges["axis"]),
        "edges": edges["skin"],
    }


# CalculiX

FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
"""Corners of CalculiX' faces S1 to S4."""
TURNED = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]
"""Nodes of a cell after corners 1 and 2 have changed places."""


@dataclass(frozen=True, slots=True)
class Press:
    """What is pressed how far.

    Attributes
    ----------
    E, nu : of the silicone, MPa and 1.
    L, R, depth : length of the beam, its radius and how far the plate comes down, mm.
    contact : CalculiX' type of contact pair.
    stiffness : of the contact, MPa per mm.
    """

    E: float
    nu: float
    L: float
    R: float
    depth: float
    contact: Literal["SURFACE TO SURFACE", "NODE TO SURFACE"] = "SURFACE TO SURFACE"
    stiffness: float = 300.0


def deck(mesh: Any, press: Press) -> str:
    """The input deck for a scikit-fem MeshTet2 with boundaries "base", "skin" and "symmetry"."""
    points, cells = mesh.doflocs.T, np.asarray(mesh.dofs.element_dofs).T
    slopes = points[cells[:, 1:4]] - points[cells[:, :1]]
    cells = np.where(np.linalg.det(slopes)[:, None] < 0, cells[:, TURNED], cells) + 1
    n, reach = len(points), 1.5 * np.sqrt(press.R * press.depth)
    corners = [(x, y, z) for z in (press.L, press.L + 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    plate = [(1.5 * press.R * x, 1.5 * press.R * y, z) for x, y, z in corners]
    base = _on(points[:, 2])
    mu, K = press.E / 2 / (1 + press.nu), press.E / 3 / (1 - 2 * press.nu)
    return pages.rendered(
        "calculix.inp.j2",
        body=_numbered(points, 1),
        plate=_numbered(plate, n + 1),
        cells=[f"{i}, " + ", ".join(map(str, row)) for i, row in enumerate(cells.tolist(), 1)],
        block=f"{len(cells) + 1}, " + ", ".join(str(n + k) for k in range(1, 9)),
        last=len(cells) + 1,
        base=base.tolist(),
        symmetry=np.setdiff1d(_on(points[:, 1]), base).tolist(),
        faces=_faces(mesh, cells, press.L, reach),
        moduli=(mu / 2, 2 / K),
        press=press,
    )


def force(printed: str) -> tuple[float, float]:
    """Time of the last increment in a .dat file and the whole beam's force at it, N; ValueError if there is none."""
    pattern = r"total force .*time\s+(\S+)\s+\S+\s+\S+\s+(\S+)"
    found = re.findall(pattern, printed)
    if not found:
        raise ValueError("CalculiX printed no force")
    time, normal = map(float, found[-1])
    return time, 2 * normal


def iterations(said: str) -> int:
    """How many iterations CalculiX tells of on standard output."""
    return len(re.findall(r"^ iteration +\d+", said, flags=re.MULTILINE))


def _on(coordinate: Any) -> Any:
    """Numbers of the nodes in a plane."""
    return np.flatnonzero(np.abs(coordinate) < 1e-9) + 1


def _numbered(points: Any, first: int) -> list[str]:
    return [f"{i}, {x:.12g}, {y:.12g}, {z:.12g}" for i, (x, y, z) in enumerate(points, first)]


def _faces(mesh: Any, cells: Any, L: float, reach: float) -> list[str]:
    """Faces of the skin that the plate may touch, as CalculiX names them."""
    skin = {tuple(sorted(corners)) for corners in (mesh.facets[:, mesh.boundaries["skin"]].T + 1).tolist()}
    found = []
    for side, local in enumerate(FACES, 1):
        middle = mesh.doflocs.T[cells[:, local] - 1].mean(axis=1)
        near = (np.hypot(middle[:, 0], middle[:, 1]) < reach) & (middle[:, 2] > L / 2)
        for i in np.flatnonzero(near):
            if tuple(sorted(cells[i, local].tolist())) in skin:
                found.append(f"{i + 1}, S{side}")
    return found


def calculix(ccx: str, mesh: Any, press: Press, limit: float = LIMIT_S) -> Answer:
    """Return the half model's press by CalculiX on a tetrahedral mesh in mm."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "press.inp").write_text(deck(mesh, press))
        ended = measure([ccx, "-i", "press"], folder=Path(folder), limit=limit)
        printed = Path(folder, "press.dat")
        text = printed.read_text() if printed.exists() else ""
    answer = {
        "dofs": 3 * mesh.doflocs.shape[1],
        "iterations": iterations(ended.out),
        "import_s": 0.0,
        "cpu_s": ended.cpu_s,
        "peak_MB": ended.peak_MB,
    }
    try:
        time, normal = force(text)
    except ValueError as error:
        return answer | {"status": "failed", "message": f"{error}: {ended.last_words}"}
    if ended.exit or time < 1:
        at = f"stopped at {time:.2g} of the depth: {ended.last_words}"
        return answer | {"status": "not_converged", "message": at}
    return answer | {"status": "ok", "message": "", "forces_N": [[0.0, 0.0, normal]]}
