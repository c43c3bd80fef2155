"""Cases at the limits of the input ranges, each with a verdict, for the verb extremes. ABOUT has the rules."""

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
Each case lies at a limit of the input ranges. It must end with a correct result, or with a clear status and the last
converged state.

A case passes if it ends with an expected status and its check measures a value within the bound; otherwise it fails.
If nothing can be measured, for example because the solve to compare with stops, the verdict is "not judged", which is
not a pass.

If a path stops before its last load, the last converged state is solved again by a new path. Force and energy of both
must agree to 1e-6 (to 1 % with Coulomb friction). A path that becomes unstable may end in one of several equilibria.
If the check of such a case does not pass, the depth at which the instability begins is compared instead with that on
a mesh with 0.7 times the edge length; they may differ by a tenth. A frictionless press that buckles must have less
energy than the symmetric press. The column `inverted` is the share of the silicone's volume that is inverted (J <= 0)
between the points of integration (section meshes only).
"""


@dataclass(frozen=True, slots=True)
class Result:
    """Result of a case; NaN where there is no number.

    Attributes
    ----------
    status : status of the last state, "bad_input", or "crashed" after an exception.
    check : measured quantity, or the reason why there is no measurement.
    passed : whether the verdict is "pass".
    ends : expected statuses, separated by spaces.
    depth_mm, shear_mm, force_x_N, force_z_N : load and force of the last state.
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
        """Return the columns of extremes.csv and JSON."""
        return records.flat(self)


def run(
    *, quick: bool = False, folder: Path | None = None, command: str = "", progress: Progress | None = None
) -> Iterator[Result]:
    """Yield the result of each case; if a folder is given, write extremes.csv and EXTREMES.md at the end.

    Parameters
    ----------
    command : the command line that the report quotes.
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
    """Return the result of one case; an exception has the status "crashed" and its text as the message."""
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
        # the study exists to find unforeseen failures, so that every exception becomes a row
        status, message = "crashed", f"{type(error).__name__}: {error}"
    return _result(case, measurement, status, message, time.perf_counter() - begin)


def _measured(case: Case) -> Measurement:
    """Return the measurement of a case: its own check if the path reaches its last load, else of the end."""
    states = robustness_checks.path(case)
    end = states[-1]
    reached = end.status == "ok" or (end.status == "unstable" and "ok" in case.ends)
    try:
        measurement = case.measure(case, states) if reached else robustness_ends.stopped(case, end)
    except StoppedError as stop:
        measurement = Measurement(end, f"no comparison: the other solve {stop}", None)
    # beyond the onset of an instability a failed check proves nothing: the path may have taken another branch
    settled = end.status not in case.ends or _verdict(case, measurement, end.status) == "pass"
    if settled or end.facts.onset is None:
        return measurement
    text = _text(measurement.check, measurement.measured, _bound(case, measurement))
    return robustness_ends.onset(case, end, text)


def _bound(case: Case, measurement: Measurement) -> float:
    return case.bound if measurement.bound is None else measurement.bound


def _verdict(case: Case, measurement: Measurement | None, status: str) -> Verdict:
    """Return the verdict on a case: both its status and its measurement must be right."""
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
    """Return the result as a line of text: `pass  deep: ok in 0.5 s; force 0.0002, at most 0.005`."""
    verdict = "FAIL" if result.verdict == "fail" else result.verdict
    message = f"; {result.message}" if result.message else ""
    measured = None if math.isnan(result.measured) else result.measured
    text = _text(result.check, measured, result.bound)
    return f"{verdict}  {result.scene}: {result.status} in {result.seconds:.1f} s; {text}{message}"


def _text(check: str, measured: float | None, bound: float) -> str:
    return check if measured is None else f"{check} {measured:.3g}, at most {bound:.3g}"


def counted(verdicts: Sequence[Verdict]) -> str:
    """Return how many cases have each verdict, as text.

    >>> counted(["pass", "not judged"])
    '1 of 2 cases pass, 0 fail, 1 is not judged'
    """
    passed, failed, not_judged = (verdicts.count(verdict) for verdict in ("pass", "fail", "not judged"))
    verb = "is" if not_judged == 1 else "are"
    return f"{passed} of {len(verdicts)} cases pass, {failed} fail, {not_judged} {verb} not judged"


def write(folder: Path, results: Sequence[Result], origin: str, command: str) -> None:
    """Write extremes.csv with all columns and the report EXTREMES.md."""
    write_table(folder / "extremes.csv", [result.row() for result in results], digits=9)
    heads = ["case", "status", "s", "check", "measured", "bound", "inverted", "verdict", "message"]
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
