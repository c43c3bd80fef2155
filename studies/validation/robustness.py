"""Cases at the limits of the input ranges, each with a verdict, for the verb extremes. ABOUT has the rules."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

from geometry.design import BadInput
from geometry.messages import Progress
from studies.output.csv_tables import write_table
from studies.output.provenance import versions
from studies.validation import pages, robustness_checks
from studies.validation.pages import Row
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


def run(
    *, quick: bool = False, folder: Path | None = None, command: str = "", progress: Progress | None = None
) -> Iterator[Row]:
    """Yield the result of each case; if a folder is given, write extremes.csv and EXTREMES.md at the end.

    Parameters
    ----------
    command : the command line that the report quotes.
    """
    results: list[Row] = []
    origin = versions()
    chosen = cases(quick=quick)
    for i, case in enumerate(chosen):
        if progress is not None:
            progress(i / len(chosen), case.name)
        results.append(examine(case))
        yield results[-1]
    if folder is not None:
        write(folder, results, origin, command)


def examine(case: Case) -> Row:
    """Return the row of one case; an exception has the status "crashed" and its text as the message."""
    begin = time.perf_counter()
    measurement: Measurement | None = None
    status: str
    try:
        measurement = _measured(case)
        end = measurement.solution
        status, message = ("crashed", "") if end is None else (end.status, end.message)
    except BadInput as error:
        status, message = "bad_input", str(error)
        measurement = robustness_checks.refused(case)
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
        measurement = case.measure(case, states) if reached else robustness_checks.stopped(case, end)
    except StoppedError as stop:
        measurement = Measurement(end, f"no comparison: the other solve {stop}", None)
    # beyond the onset of an instability a failed check proves nothing: the path may have taken another branch
    settled = end.status not in case.ends or _verdict(case, measurement, end.status) == "pass"
    if settled or end.facts.onset is None:
        return measurement
    text = _text(measurement.check, measurement.measured, _bound(case, measurement))
    return robustness_checks.onset(case, end, text)


def _bound(case: Case, measurement: Measurement) -> float:
    return case.bound if measurement.bound is None else measurement.bound


def _verdict(case: Case, measurement: Measurement | None, status: str) -> Verdict:
    """Return the verdict on a case: both its status and its measurement must be right."""
    if measurement is None or status not in case.ends:
        return "fail"
    if measurement.measured is None:
        return "not judged"
    return "pass" if measurement.measured <= _bound(case, measurement) else "fail"


def _result(case: Case, measurement: Measurement | None, status: str, message: str, seconds: float) -> Row:
    """Return the columns of extremes.csv and JSON; NaN where there is no number.

    `check` is the measured quantity, or the reason why there is no measurement; `changes` are the fields that differ
    from the paper's design; load and force are those of the last state.
    """
    end = measurement.solution if measurement else None
    measured = measurement.measured if measurement else None
    response = end.response if end else None
    verdict = _verdict(case, measurement, status)
    inside_out = robustness_checks.folded_share(end) if end and end.model == "axisymmetric" else NAN
    row: Row = {"scene": case.name, "verdict": verdict, "status": status, "message": message, "seconds": seconds}
    row |= {"check": measurement.check if measurement else "none", "measured": NAN if measured is None else measured}
    row["bound"] = NAN if measurement is None or measured is None else _bound(case, measurement)
    row |= {"passed": verdict == "pass", "ends": " ".join(case.ends), "model": end.model if end else case.model}
    row |= {"accuracy": case.accuracy.name, "magnet": case.magnet}
    row |= {"depth_mm": end.load.depth if end else NAN, "shear_mm": end.load.shear_x if end else NAN}
    row |= {f"force_{axis}_N": response.force[k] if response else NAN for k, axis in ((0, "x"), (2, "z"))}
    changes = " ".join(f"{name}={value:.9g}" for name, value in case.changes.items())
    return row | {"inside_out_share": inside_out, "changes": changes}


def line(result: Row) -> str:
    """Return the result as a line of text: `pass  deep: ok in 0.5 s; force 0.0002, at most 0.005`."""
    verdict = "FAIL" if result["verdict"] == "fail" else result["verdict"]
    message = f"; {result['message']}" if result["message"] else ""
    measured = None if math.isnan(result["measured"]) else result["measured"]
    text = _text(result["check"], measured, result["bound"])
    return f"{verdict}  {result['scene']}: {result['status']} in {result['seconds']:.1f} s; {text}{message}"


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


def write(folder: Path, results: Sequence[Row], origin: str, command: str) -> None:
    """Write extremes.csv with all columns and the report EXTREMES.md."""
    write_table(folder / "extremes.csv", results, digits=9)
    heads = {"scene": "case", "status": "status", "seconds": "s", "check": "check", "measured": "measured"}
    heads |= {"bound": "bound", "inside_out_share": "inverted", "verdict": "verdict", "message": "message"}
    bold = [row | {"verdict": row["verdict"] if row["passed"] else f"**{row['verdict']}**"} for row in results]
    samples = (f"{row['scene']}: `{row['changes']}`" for row in results if row["scene"].startswith("sample"))
    counts = f"{counted([row['verdict'] for row in results])}."
    blocks = ["# Extremes", counts, pages.markdown(bold, heads, 2), ABOUT, pages.listed(samples, "")]
    pages.write(folder / "EXTREMES.md", blocks, command, origin)
