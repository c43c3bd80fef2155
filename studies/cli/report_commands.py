"""The verb that makes a page of results: report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from geometry.messages import Progress
from studies.cli.parameters import AsJson
from studies.cli.printed_command import command
from studies.output.result import Destination, Result, of_record, publish

Results = Annotated[
    Path, Parameter(name="DIR", help="Folder of results that other verbs wrote, with its sub-folders.")
]


def report(folder: Results, /, *, out: Path | None = None, no_solve: bool = False, as_json: AsJson = False) -> int:
    """Make one HTML page of a folder of results, with figures that can be read off and the deformed sensor in 3D.

    The page needs no network. It shows whatever the folder and its sub-folders hold: comparisons, sweeps and their
    error maps, the chart of cost and error, robustness, verification, maps of the beam assumption, claims, sizing
    and uncertainty, with versions and commands. What it leaves out it names.

    Parameters
    ----------
    out
        File of the page, .html; default: report.html in the folder.
    no_solve
        Solve nothing: no figure in 3D where a folder names a sensor but holds no solution; default: solve it.
    """
    command_line = command(report, locals())
    from studies.report import report_page

    def study(progress: Progress) -> Result:
        page = report_page.report(folder, out, command=command_line, solve=not no_solve, progress=progress)
        return of_record("Report", page.row())

    return publish(study, Destination(as_json=as_json))
