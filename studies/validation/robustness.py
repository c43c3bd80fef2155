"""The verb extremes: scenes at the edge of what is allowed, each with a verdict. See ABOUT."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

from geometry.design import BadInput
from studies.output.atomic_files import write_text
from studies.output.csv_tables import write_table
from studies.output.provenance import made, versions
from studies.validation import robustness_checks
from studies.validation.robustness_cases import scenes
from studies.validation.robustness_checks import Finding, Scene, StoppedError

Progress = Callable[[float, str], None]
Row = dict[str, Any]

NAN = math.nan
Verdict = Literal["pass", "fail", "not judged"]

ABOUT = """\
Scenes at the edge of what is allowed: each must end in a right answer, or in a clear status with its state kept.

A scene passes if it ends in a status that is right for it, and if what its check measures is within the bound. It
fails if either is not so. Where nothing could be measured, as where what it is to be compared with stops, it is not
judged, which is no pass. Where a scene may stop short, the last good state is solved again by itself: force and
energy must agree to 1e-6. A path that turns unstable on the way may end in one of several equilibria. So if its state
differs from what it is compared with, the depth of the onset is measured instead, against that on a mesh with edges
of 0.7: they may differ by a tenth. A frictionless press that gives way sideways must hold less energy than the
symmetric press. The column `inside out` is the share of the silicone's volume where det F <= 0 between the points of
integration (section meshes only).
"""


def run(
    *, quick: bool = False, folder: Path | None = None, command: str = "", progress: Progress | None = None
) -> Iterator[Row]:
    """A row for each scene as it ends; at the end extremes.csv and EXTREMES.md are written if told where.

    command : that this is run by.
    """
    rows: list[Row] = []
    origin = versions()
    chosen = scenes(quick=quick)
    for i, scene in enumerate(chosen):
        if progress is not None:
            progress(i / len(chosen), scene.name)
        rows.append(judge(scene))
        yield rows[-1]
    if folder is not None:
        write(folder, rows, origin, command)


def judge(scene: Scene) -> Row:
    """The row of one scene; an exception is a wrong end like any other, with its text as the message."""
    begin = time.perf_counter()
    finding: Finding | None = None
    status: str
    try:
        finding = _finding(scene)
        end = finding.solution
        status, message = ("crashed", "") if end is None else (end.status, end.message)
    except BadInput as error:
        status, message = "bad_input", str(error)
        finding = robustness_checks.refused(scene)
    except Exception as error:
        # any way to end that nobody meant is what this table is there to find
        status, message = "crashed", f"{type(error).__name__}: {error}"
    return _row(scene, finding, status, message, time.perf_counter() - begin)


def _finding(scene: Scene) -> Finding:
    """What is measured of the scene: by its judge, or where it ended otherwise, of the state that was reached."""
    states = robustness_checks.path(scene)
    end = states[-1]
    followed = end.status == "ok" or (end.status == "unstable" and "ok" in scene.ends)
    try:
        finding = scene.judge(scene, states) if followed else robustness_checks.stopped(scene, end)
    except StoppedError as stop:
        finding = Finding(end, f"what it is compared with {stop}", None)
    settled = end.status not in scene.ends or _verdict(scene, finding, end.status) == "pass"
    if settled or end.facts.onset is None:
        return finding
    return robustness_checks.onset(scene, end, _judged(finding.check, finding.measured, _bound(scene, finding)))


def _bound(scene: Scene, finding: Finding) -> float:
    return scene.bound if finding.bound is None else finding.bound


def _verdict(scene: Scene, finding: Finding | None, status: str) -> Verdict:
    """Whether a scene ended as it should, by its status and by what was measured; both must be right."""
    if finding is None or status not in scene.ends:
        return "fail"
    if finding.measured is None:
        return "not judged"
    return "pass" if finding.measured <= _bound(scene, finding) else "fail"


def _row(scene: Scene, finding: Finding | None, status: str, message: str, seconds: float) -> Row:
    end = finding.solution if finding else None
    measured = finding.measured if finding else None
    response = end.response if end else None
    verdict = _verdict(scene, finding, status)
    return {
        "scene": scene.name,
        "verdict": verdict,
        "status": status,
        "message": message,
        "seconds": seconds,
        "check": finding.check if finding else "none",
        "measured": NAN if measured is None else measured,
        "bound": NAN if finding is None or measured is None else _bound(scene, finding),
        "passed": verdict == "pass",
        "ends": " ".join(scene.ends),
        "model": end.model if end else scene.model,
        "accuracy": scene.accuracy.name,
        "magnet": scene.magnet,
        "depth_mm": end.load.depth if end else NAN,
        "shear_mm": end.load.shear_x if end else NAN,
        "force_x_N": response.force[0] if response else NAN,
        "force_z_N": response.force[2] if response else NAN,
        "inside_out_share": robustness_checks.folded_share(end) if end and end.model == "axisymmetric" else NAN,
        "changes": " ".join(f"{name}={value:.9g}" for name, value in scene.changes.items()),
    }


def line(row: Row) -> str:
    """The row for a person to read.

    >>> numbers = {"seconds": 0.52, "measured": 2e-4, "bound": 5e-3}
    >>> texts = {"scene": "deep", "status": "ok", "check": "force", "message": "", "verdict": "pass"}
    >>> line(numbers | texts)
    'pass  deep: ok in 0.5 s; force 0.0002, at most 0.005'
    """
    verdict = "FAIL" if row["verdict"] == "fail" else row["verdict"]
    message = f"; {row['message']}" if row["message"] else ""
    measured = None if math.isnan(row["measured"]) else row["measured"]
    judged = _judged(row["check"], measured, row["bound"])
    return f"{verdict}  {row['scene']}: {row['status']} in {row['seconds']:.1f} s; {judged}{message}"


def _judged(check: str, measured: float | None, bound: float) -> str:
    return check if measured is None else f"{check} {measured:.3g}, at most {bound:.3g}"


def counted(rows: Sequence[Row]) -> str:
    """How many scenes have which verdict.

    >>> counted([{"verdict": "pass"}, {"verdict": "not judged"}])
    '1 of 2 scenes pass, 0 fail, 1 is not judged'
    """
    passed, failed, open_ = (sum(row["verdict"] == v for row in rows) for v in ("pass", "fail", "not judged"))
    verb = "is" if open_ == 1 else "are"
    return f"{passed} of {len(rows)} scenes pass, {failed} fail, {open_} {verb} not judged"


def write(folder: Path, rows: Sequence[Row], origin: str, command: str) -> None:
    """extremes.csv with all columns, EXTREMES.md to read."""
    write_table(folder / "extremes.csv", rows, digits=9)
    heads = ["scene", "status", "s", "how it was judged", "measured", "bound", "inside out", "", "what happened"]
    lines = ["# Extremes", "", f"{counted(rows)}.", ""]
    lines += ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for row in rows:
        numbers = [_number(row[key]) for key in ("measured", "bound", "inside_out_share")]
        cells = [
            row["scene"],
            row["status"],
            f"{row['seconds']:.1f}",
            row["check"],
            *numbers,
            "pass" if row["passed"] else f"**{row['verdict']}**",
            row["message"],
        ]
        lines.append("| " + " | ".join(cells) + " |")
    lines += ["", *ABOUT.splitlines(), "", *_designs(rows), "", made(command, origin)]
    write_text(folder / "EXTREMES.md", "\n".join(lines) + "\n")


def _designs(rows: Sequence[Row]) -> list[str]:
    samples = [row for row in rows if row["scene"].startswith("sample")]
    return [f"- {row['scene']}: `{row['changes']}`" for row in samples]


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.2g}"
