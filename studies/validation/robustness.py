"""The verb extremes: cases at the edge of what is allowed, each with a verdict. See ABOUT."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from geometry.design import BadInput
from geometry.messages import Progress
from studies.output import records
from studies.output.atomic_files import write_text
from studies.output.csv_tables import write_table
from studies.output.provenance import made, versions
from studies.output.records import FlatRow
from studies.validation import robustness_checks, robustness_ends
from studies.validation.robustness_cases import cases
from studies.validation.robustness_checks import Case, Measurement, StoppedError

NAN = math.nan
Verdict = Literal["pass", "fail", "not judged"]

ABOUT = """\
Cases at the limits of the input ranges: each must end in a right answer, or in a clear status with its state kept.

A case passes if its status is right and its check lies within the bound; otherwise it fails. A case whose check
cannot be measured, for example because the reference stops, is not judged, which does not count as a pass. Where a
case may stop early, its last good state is solved again by itself: force and energy must agree to 1e-6. A path that
becomes unstable may end in one of several equilibria. If its state then differs from the reference, the check
compares the depth of the onset with that on a mesh with edges of 0.7: they may differ by 10 %. A frictionless press
that buckles sideways must store less energy than the symmetric press. The column `inside out` is the share of the
silicone's volume that is inverted (J <= 0) between the integration points (section meshes only).
"""


@dataclass(frozen=True, slots=True)
class Result:
    """How a case ended; NaN where there is no number.

    Attributes
    ----------
    status : of the last state, or "bad_input", or "crashed" where an exception ended it.
    check : what was measured, or why nothing could be.
    passed : the verdict is "pass".
    ends : statuses that are right, separated by spaces.
    depth_mm, shear_mm, force_x_N, force_z_N : of the last state.
    inside_out_share : share of the silicone's volume that is inverted (J <= 0); section meshes only.
    changes : fields that differ from the paper's design.
    """

    scene: str
    verdict: Verdict
    status: str
    message: str
    seconds: float
    check: str
    measured: float
    bound: float
    passed: bool
    ends: str
    model: str
    accuracy: str
    magnet: str
    depth_mm: float
    shear_mm: float
    force_x_N: float
    force_z_N: float
    inside_out_share: float
    changes: str

    def row(self) -> FlatRow:
        """Its columns in extremes.csv and in JSON."""
        return records.flat(self)


def run(
    *, quick: bool = False, folder: Path | None = None, command: str = "", progress: Progress | None = None
) -> Iterator[Result]:
    """A result for each case as it ends; at the end extremes.csv and EXTREMES.md are written if a folder is given.

    Parameters
    ----------
    command : that this is run by.
    """
    results: list[Result] = []
    origin = versions()
    chosen = cases(quick=quick)
    for i, case in enumerate(chosen):
        if progress is not None:
            progress(i / len(chosen), case.name)
        results.append(examine(case))
        yield results[-1]
    if folder is not None:
        write(folder, results, origin, command)


def examine(case: Case) -> Result:
    """The result of one case; an exception is a wrong end like any other, with its text as the message."""
    begin = time.perf_counter()
    measurement: Measurement | None = None
    status: str
    try:
        measurement = _measured(case)
        end = measurement.solution
        status, message = ("crashed", "") if end is None else (end.status, end.message)
    except BadInput as error:
        status, message = "bad_input", str(error)
        measurement = robustness_ends.refused(case)
    except Exception as error:
        # any way to end that nobody meant is what this table is there to find
        status, message = "crashed", f"{type(error).__name__}: {error}"
    return _result(case, measurement, status, message, time.perf_counter() - begin)


def _measured(case: Case) -> Measurement:
    """What is measured of the case: its own measure where it is followed to its end, else of its last state."""
    states = robustness_checks.path(case)
    end = states[-1]
    followed = end.status == "ok" or (end.status == "unstable" and "ok" in case.ends)
    try:
        measurement = case.measure(case, states) if followed else robustness_ends.stopped(case, end)
    except StoppedError as stop:
        measurement = Measurement(end, f"what it is compared with {stop}", None)
    settled = end.status not in case.ends or _verdict(case, measurement, end.status) == "pass"
    if settled or end.facts.onset is None:
        return measurement
    judged = _judged(measurement.check, measurement.measured, _bound(case, measurement))
    return robustness_ends.onset(case, end, judged)


def _bound(case: Case, measurement: Measurement) -> float:
    return case.bound if measurement.bound is None else measurement.bound


def _verdict(case: Case, measurement: Measurement | None, status: str) -> Verdict:
    """Whether a case ended as it should, by its status and by what was measured; both must be right."""
    if measurement is None or status not in case.ends:
        return "fail"
    if measurement.measured is None:
        return "not judged"
    return "pass" if measurement.measured <= _bound(case, measurement) else "fail"


def _result(case: Case, measurement: Measurement | None, status: str, message: str, seconds: float) -> Result:
    end = measurement.solution if measurement else None
    measured = measurement.measured if measurement else None
    response = end.response if end else None
    verdict = _verdict(case, measurement, status)
    return Result(
        scene=case.name,
        verdict=verdict,
        status=status,
        message=message,
        seconds=seconds,
        check=measurement.check if measurement else "none",
        measured=NAN if measured is None else measured,
        bound=NAN if measurement is None or measured is None else _bound(case, measurement),
        passed=verdict == "pass",
        ends=" ".join(case.ends),
        model=end.model if end else case.model,
        accuracy=case.accuracy.name,
        magnet=case.magnet,
        depth_mm=end.load.depth if end else NAN,
        shear_mm=end.load.shear_x if end else NAN,
        force_x_N=response.force[0] if response else NAN,
        force_z_N=response.force[2] if response else NAN,
        inside_out_share=robustness_checks.folded_share(end) if end and end.model == "axisymmetric" else NAN,
        changes=" ".join(f"{name}={value:.9g}" for name, value in case.changes.items()),
    )


def line(result: Result) -> str:
    """The result for a person to read, as `pass  deep: ok in 0.5 s; force 0.0002, at most 0.005`."""
    verdict = "FAIL" if result.verdict == "fail" else result.verdict
    message = f"; {result.message}" if result.message else ""
    measured = None if math.isnan(result.measured) else result.measured
    judged = _judged(result.check, measured, result.bound)
    return f"{verdict}  {result.scene}: {result.status} in {result.seconds:.1f} s; {judged}{message}"


def _judged(check: str, measured: float | None, bound: float) -> str:
    return check if measured is None else f"{check} {measured:.3g}, at most {bound:.3g}"


def counted(verdicts: Sequence[Verdict]) -> str:
    """How many scenes have which verdict.

    >>> counted(["pass", "not judged"])
    '1 of 2 scenes pass, 0 fail, 1 is not judged'
    """
    passed, failed, not_judged = (verdicts.count(verdict) for verdict in ("pass", "fail", "not judged"))
    verb = "is" if not_judged == 1 else "are"
    return f"{passed} of {len(verdicts)} cases pass, {failed} fail, {not_judged} {verb} not judged"


def write(folder: Path, results: Sequence[Result], origin: str, command: str) -> None:
    """extremes.csv with all columns, EXTREMES.md to read."""
    write_table(folder / "extremes.csv", [result.row() for result in results], digits=9)
    heads = ["scene", "status", "s", "how it was judged", "measured", "bound", "inside out", "", "what happened"]
    lines = ["# Extremes", "", f"{counted([result.verdict for result in results])}.", ""]
    lines += ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for result in results:
        cells = [
            result.scene,
            result.status,
            f"{result.seconds:.1f}",
            result.check,
            *(_number(value) for value in (result.measured, result.bound, result.inside_out_share)),
            "pass" if result.passed else f"**{result.verdict}**",
            result.message,
        ]
        lines.append("| " + " | ".join(cells) + " |")
    samples = [f"- {result.scene}: `{result.changes}`" for result in results if result.scene.startswith("sample")]
    lines += ["", *ABOUT.splitlines(), "", *samples, "", made(command, origin)]
    write_text(folder / "EXTREMES.md", "\n".join(lines) + "\n")


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.2g}"
