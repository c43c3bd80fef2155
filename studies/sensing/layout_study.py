"""The study of `magtip layout`: the map of a layout, better layouts, the paper's claim, and a range of loads."""

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
    from studies.sensing.layout_report import Answer

MOST_CLEARANCE = 100.0
"""mm."""


@dataclass(frozen=True, slots=True)
class Job:
    """Requested parts of the study: the map always, a search over ranges NAME=LOW,HIGH, the claim, and the resolution
    over a range of loads NORMAL,TANGENTIAL.
    """

    design: Design
    basis: Basis
    search: bool
    ranges: Sequence[str]
    count: int
    claim: bool
    force_range: str | None = None


def run(job: Job, progress: Progress, folder: Path | None, command: str) -> Answer:
    """Evaluate the layout, and search and answer the claim if requested; write files if there is a folder.

    Raises
    ------
    BadInput
        The design has no magnet, a layout or range is impossible, or `layout_metrics.mechanics_of` refuses.
    """
    from analytic import survey
    from studies.sensing import force_range, layout_metrics, layout_report, layout_search, layout_uniqueness

    design, basis = job.design, job.basis
    law = layout_metrics.mechanics_of(design, basis.level, basis.responses)
    decode_readings.warn_if_upright(law, ignore_tilt=basis.ignore_tilt)
    if not 0 <= basis.clearance <= MOST_CLEARANCE:
        raise BadInput(f"--clearance must lie between 0 and {MOST_CLEARANCE:g} mm; got {basis.clearance:g}")
    if not 1 <= job.count <= layout_search.MOST_FOUND:
        raise BadInput(f"--count must lie between 1 and {layout_search.MOST_FOUND}; got {job.count}")
    limits = None if job.force_range is None else force_range.parse(job.force_range)
    bounds = layout_search.parse_ranges(design, job.ranges)
    if job.claim:
        layout_uniqueness.check(design)
    coder, noise = layout_metrics.prepare(design, law, basis)
    progress(0.0, "map of the workspace")
    poses = survey.survey(coder, layout_metrics.COUNTS, clearance=basis.clearance)
    name = decode_readings.level_name(basis.level, basis.responses)
    row = layout_metrics.layout_row(coder, poses, noise, name)
    loads = None if limits is None else force_range.loads(coder, *limits, basis.clearance)
    forces = None if loads is None or limits is None else force_range.evaluate(coder, loads, *limits, name)
    search = layout_search.run(design, law, basis, bounds, job.count, progress) if job.search else None
    answer = layout_report.Answer(row, search, layout_uniqueness.run(design, progress) if job.claim else None, forces)
    if folder is not None:
        progress(1.0, "layout.csv, pictures and LAYOUT.md")
        layout_report.write(folder, coder, poses, answer, loads, command, basis.clearance)
    return answer
