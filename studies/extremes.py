"""Scenes at the edge of what is allowed: each must end in a right answer, or in a clear status with its state kept.

A right answer is one that its check measures within the bound. Where a scene may stop short, the last good state is
solved again by itself: force and energy must agree to 1e-6, and the message must name the load that was reached.
A path that turns unstable on the way may end in one of several equilibria; it has to name the depth of the onset, and
where it differs from what it is compared with, that is what it is judged by.
A frictionless press that gives way must hold less energy than the symmetric press. The column `inside out` is the
share of the silicone's volume where det F <= 0 between the points of integration (section meshes only).
"""

from __future__ import annotations

import math
import platform
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from geometry.design import BadInput
from studies import judges
from studies.compare import write_table
from studies.files import write_text
from studies.judges import Finding, Scene, StoppedError
from studies.scenes import scenes

Progress = Callable[[float, str], None]
Row = dict[str, Any]

NAN = math.nan


def run(*, quick: bool = False, folder: Path | None = None, progress: Progress | None = None) -> Iterator[Row]:
    """A row for each scene as it ends; at the end extremes.csv and EXTREMES.md are written if told where."""
    rows: list[Row] = []
    origin = versions()
    chosen = scenes(quick=quick)
    for i, scene in enumerate(chosen):
        if progress is not None:
            progress(i / len(chosen), scene.name)
        rows.append(judge(scene))
        yield rows[-1]
    if folder is not None:
        write(folder, rows, origin, quick=quick)


def judge(scene: Scene) -> Row:
    """The row of one scene; an exception is a wrong end like any other, with its text as the message."""
    begin = time.perf_counter()
    finding: Finding | None = None
    status: str
    try:
        finding = _finding(scene)
        status, message = finding.solution.status, finding.solution.message
    except BadInput as error:
        status, message = "bad_input", str(error)
    except StoppedError as stop:
        status, message = stop.solution.status, f"what it is compared with: {stop}"
    except Exception as error:
        # any way to end that nobody meant is what this table is there to find
        status, message = "crashed", f"{type(error).__name__}: {error}"
    return _row(scene, finding, status, message, time.perf_counter() - begin)


def _finding(scene: Scene) -> Finding:
    """What the scene's judge finds, or that of the state where it stopped."""
    try:
        return scene.judge(scene)
    except StoppedError as stop:
        if stop.solution.status not in scene.ends:
            raise
        return judges.stopped(scene, stop.solution)


def _row(scene: Scene, finding: Finding | None, status: str, message: str, seconds: float) -> Row:
    end = finding.solution if finding else None
    measured = finding.measured if finding else NAN
    bound = scene.bound if finding is None or finding.bound is None else finding.bound
    right = measured <= bound if finding else status == "bad_input"
    warned = status in ("unstable", "not_converged") and "unstable since" in message
    response = end.response if end else None
    check = finding.check if finding else "refused, in one sentence" if status == "bad_input" else "none"
    if warned and not right:
        # equilibria part at the onset: what they differ by is told, and not judged
        differs = f" ({check}: {measured:.3g}, not judged beyond it)" if finding else ""
        check, measured, bound = f"the message names the depth of the onset{differs}", NAN, NAN
    return {
        "scene": scene.name,
        "status": status,
        "message": message,
        "seconds": seconds,
        "check": check,
        "measured": measured,
        "bound": bound if finding else NAN,
        "passed": bool((right and status in scene.ends) or warned),
        "model": end.model if end else scene.model,
        "accuracy": scene.accuracy.name,
        "magnet": scene.magnet,
        "depth_mm": end.load.depth if end else NAN,
        "shear_mm": end.load.shear_x if end else NAN,
        "force_x_N": response.force[0] if response else NAN,
        "force_z_N": response.force[2] if response else NAN,
        "inside_out_share": judges.folded_share(end) if end and end.model == "axisymmetric" else NAN,
        "changes": " ".join(f"{name}={value:.9g}" for name, value in scene.changes.items()),
    }


def line(row: Row) -> str:
    """The row for a person to read.

    >>> numbers = {"seconds": 0.52, "measured": 2e-4, "bound": 5e-3}
    >>> texts = {"scene": "deep", "status": "ok", "check": "force", "message": "", "passed": True}
    >>> line(numbers | texts)
    'pass  deep: ok in 0.5 s; force 0.0002, at most 0.005'
    """
    verdict = "pass" if row["passed"] else "FAIL"
    message = f"; {row['message']}" if row["message"] else ""
    return f"{verdict}  {row['scene']}: {row['status']} in {row['seconds']:.1f} s; {_judged(row)}{message}"


def _judged(row: Row) -> str:
    if math.isnan(row["measured"]):
        return str(row["check"])
    return f"{row['check']} {row['measured']:.3g}, at most {row['bound']:.3g}"


def write(folder: Path, rows: Sequence[Row], origin: str, *, quick: bool) -> None:
    """extremes.csv with all columns, EXTREMES.md to read."""
    write_table(folder / "extremes.csv", rows, digits=9)
    command = f"magtip extremes{' --quick' if quick else ''}"
    passed = sum(row["passed"] for row in rows)
    heads = ["scene", "status", "s", "how it was judged", "measured", "bound", "inside out", "", "what happened"]
    lines = ["# Extremes", "", f"`{command}`: {passed} of {len(rows)} scenes end as they should.", ""]
    lines += ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for row in rows:
        numbers = [_number(row[key]) for key in ("measured", "bound", "inside_out_share")]
        verdict = "pass" if row["passed"] else "**fail**"
        cells = [
            row["scene"],
            row["status"],
            f"{row['seconds']:.1f}",
            row["check"],
            *numbers,
            verdict,
            row["message"],
        ]
        lines.append("| " + " | ".join(cells) + " |")
    lines += [
        "",
        *(__doc__ or "").strip().splitlines(),
        "",
        *_designs(rows),
        "",
        f"Made with `{command}`, {origin}.",
    ]
    write_text(folder / "EXTREMES.md", "\n".join(lines) + "\n")


def _designs(rows: Sequence[Row]) -> list[str]:
    samples = [row for row in rows if row["scene"].startswith("sample")]
    return [f"- {row['scene']}: `{row['changes']}`" for row in samples]


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.2g}"


def versions() -> str:
    """Versions, and the commit where the code lies in a repository."""
    names = ("magtip", "numpy", "scipy", "scikit-fem", "pytetwild")
    versions = ", ".join(f"{name} {version(name)}" for name in names)
    described = subprocess.run(
        ["git", "describe", "--always", "--dirty", "--exclude=*"],
        cwd=Path(__file__).parent,
        capture_output=True,
        text=True,
        check=False,
    )
    commit = f" at commit {described.stdout.strip()}" if described.returncode == 0 else ""
    return f"on Python {platform.python_version()} with {versions}{commit}"
