"""The study of `magtip layout`: the map of a layout, a search for better ones, and the paper's claim."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.inputs.option_groups import Basis
from studies.sensing import decode_readings

if TYPE_CHECKING:
    from studies.output.records import FlatRow
    from studies.sensing.claim_rows import Claim
    from studies.sensing.layout_metrics import LayoutRow
    from studies.sensing.layout_search import SearchRow

MOST_CLEARANCE = 100.0
"""mm."""


@dataclass(frozen=True, slots=True)
class Job:
    """Requested parts of the study: the map always, a search over ranges NAME=LOW,HIGH, and the claim."""

    design: Design
    basis: Basis
    search: bool
    ranges: Sequence[str]
    count: int
    claim: bool


@dataclass(frozen=True, slots=True)
class Answer:
    """Result of the study; search and claim are None if they were not requested."""

    layout: LayoutRow
    search: list[SearchRow] | None
    claim: Claim | None

    def row(self) -> FlatRow:
        """Return the row for JSON, which contains the rows of search and claim."""
        row = self.layout.row()
        if self.search is not None:
            row["search"] = [each.row() for each in self.search]
        return row if self.claim is None else row | {"claim": self.claim.row()}


def run(job: Job, progress: Progress, folder: Path | None, command: str) -> Answer:
    """Evaluate the layout, and search and answer the claim if requested; write files if there is a folder.

    Raises
    ------
    BadInput
        The design has no magnet, a layout or range is impossible, or `layout_metrics.mechanics_of` refuses.
    """
    from analytic import magnet, survey
    from studies.sensing import layout_metrics, layout_report, layout_search, layout_uniqueness

    design, basis = job.design, job.basis
    law = layout_metrics.mechanics_of(design, basis.level, basis.responses)
    decode_readings.warn_if_upright(law, ignore_tilt=basis.ignore_tilt)
    if not 0 <= basis.clearance <= MOST_CLEARANCE:
        raise BadInput(f"--clearance must lie between 0 and {MOST_CLEARANCE:g} mm; got {basis.clearance:g}")
    if not 1 <= job.count <= layout_search.MOST_FOUND:
        raise BadInput(f"--count must lie between 1 and {layout_search.MOST_FOUND}; got {job.count}")
    bounds = layout_search.parse_ranges(design, job.ranges)
    if job.claim:
        layout_uniqueness.check(design)
    coder, noise = layout_metrics.prepare(design, law, basis)
    progress(0.0, "map of the workspace")
    magnet.compiled()
    poses = survey.survey(coder, layout_metrics.COUNTS, clearance=basis.clearance)
    name = decode_readings.level_name(basis.level, basis.responses)
    row = layout_metrics.layout_row(coder, poses, noise, name)
    search = layout_search.run(design, law, basis, bounds, job.count, progress) if job.search else None
    answer = Answer(row, search, layout_uniqueness.run(design, progress) if job.claim else None)
    if folder is not None:
        progress(1.0, "layout.csv, pictures and LAYOUT.md")
        layout_report.write(
            folder, coder, poses, answer.layout, answer.search, answer.claim, command, basis.clearance
        )
    return answer
