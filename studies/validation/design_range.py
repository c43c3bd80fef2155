"""Solids, moulds and meshes of designs sampled over all input ranges, for the verb range.

ABOUT, which the report prints, describes the samples and checks.
"""

from __future__ import annotations

import functools
import json
import math
import statistics
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from pathlib import Path

from geometry.messages import Progress
from studies.output import checkpoint, records
from studies.output.atomic_files import write_text
from studies.output.goals import Goal
from studies.output.provenance import made
from studies.output.records import FlatRow
from studies.validation import design_range_steps
from studies.validation.design_range_steps import DesignResult, Sample

ABOUT = """\
Solids, mould and meshes are made for designs that are sampled over all input ranges. An impossible design has its
reason in the table.

The samples follow a Sobol sequence over D, L and the magnet's diameter, height / diameter and edge radius. D ranges
from 1 to 50 mm and L from D/2 + 0.05 mm to 10 D. The magnet's diameter ranges from 0.2 mm to the largest that leaves
a wall of 0.15 mm, and its height from 0.1 to 4 times the diameter. The sampling is logarithmic, except for the edge
radius, which is uniform from 0 to half of its largest possible value. For each quantity, a tenth of the samples lies
at each end of the range, so that extremes of several quantities meet in one design.

The section mesh has level standard, with the magnet as a hole. The mesh of tetrahedra has level quick and covers the
half body with its magnet. It is made once without the cache and then read from the cache. A mesh passes if its
volumes are right to 1e-5, its base is right to 1e-4, and no Jacobian is below 0.05. A design is good if each of its
steps passes, or is impossible for a reason that the message names.
"""


SEED, COUNT = 1960, 64
"""Seed of the sequence, and default number of designs."""
WALL, LEAST_STEM = 0.15, 0.05
"""Wall of silicone that the largest magnet leaves, and least L - D/2, mm."""
LEAST_DIAMETER, LEAST_HEIGHT, SLENDER = 0.2, 0.1, (0.1, 4.0)
"""Least diameter and height of a magnet, mm, and limits of its height / diameter."""
END = 0.1
"""Share of the samples at each end of each quantity's range."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Least, median and greatest magnitude of a measured quantity over the designs that have a value."""

    quantity: str
    least: float
    median: float
    greatest: float

    def row(self) -> FlatRow:
        """Return the spread as columns of the printed table."""
        return records.flat(self)


def samples(count: int) -> list[Sample]:
    """Return the sampled designs; a larger count only appends designs."""
    from scipy.stats import qmc

    points = qmc.Sobol(5, seed=SEED).random_base2(math.ceil(math.log2(max(count, 2))))
    return [_sample([min(max((float(x) - END) / (1 - 2 * END), 0.0), 1.0) for x in point]) for point in points][
        :count
    ]


def _sample(x: list[float]) -> Sample:
    """Return the design at a point of the unit cube.

    The coordinates stand for D, the stem L - D/2, and the magnet's diameter, height / diameter and edge radius.
    """
    D = _down(50 ** x[0])
    stem = _down(LEAST_STEM * (9.5 * D / LEAST_STEM) ** x[1])
    ratio = SLENDER[0] * (SLENDER[1] / SLENDER[0]) ** x[3]
    least = max(LEAST_DIAMETER, LEAST_HEIGHT / ratio)
    most = min(2 * (D / 2 - WALL) / math.hypot(1, ratio), 2 * (stem - WALL) / ratio)
    wide = _down(least * (max(most, least) / least) ** x[2])
    tall = _down(ratio * wide)
    return Sample(
        D=D,
        L=round(D / 2 + stem, 6),
        magnet_diameter=wide,
        magnet_height=tall,
        magnet_edge_radius=_down(x[4] * min(wide, tall) / 4) if x[4] else 0.0,
        l0=round(D / 2 + stem + 1, 6),
    )


def _down(value: float) -> float:
    """Return a positive value rounded down to four digits.

    A value that differs from four digits only by floating-point error keeps these digits: hence 1e-9.
    """
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return float(f"{math.floor(value / step + 1e-9) * step:.6g}")


def run(count: int, folder: Path | None, progress: Progress) -> Iterator[DesignResult]:
    """Yield the result of each design; results in the folder's rows.jsonl by the same code are not computed again."""
    store = checkpoint.opened(None if folder is None else folder / "rows.jsonl", code())
    with tempfile.TemporaryDirectory() as cache:
        for number, sample in enumerate(samples(count)):
            progress(number / count, f"design {number}")
            name = json.dumps([number, *astuple(sample)])
            if name not in store.known:
                store.keep(name, design_range_steps.examine(number, sample, Path(cache)).row())
            yield replace(DesignResult(**store.known[name]), commit=store.commits[name])


@functools.cache
def code() -> str:
    """Return a digest of the modules that make solids and meshes, of the accuracy levels, and of this study."""
    study = [Path(__file__), Path(design_range_steps.__file__)]
    return checkpoint.digest([*checkpoint.modules("geometry", "fem"), *study])


MEASURED = (
    *("wall_mm", "solids_s", "section_ms", "triangles", "section_volume_error", "least_angle_rad", "tetrahedra"),
    *("mesh_s", "mesh_cpu_s", "cached_ms", "silicone_volume_error", "magnet_volume_error", "base_error"),
    *("gap_over_D", "least_jacobian", "least_shape", "mean_shape"),
)
"""Fields of a result that are measured numbers."""


def summary(results: Sequence[DesignResult]) -> list[Spread]:
    """Return the spread of each measured quantity; errors enter with their magnitudes."""
    spreads = []
    for name in MEASURED:
        values = [abs(value) for result in results if (value := getattr(result, name)) is not None]
        if values:
            spreads.append(Spread(name, min(values), statistics.median(values), max(values)))
    return spreads


def goals(results: Sequence[DesignResult]) -> list[Goal]:
    """Return the goal of the study: no possible design fails; without a possible design it is missed."""
    failed = [str(result.design) for result in results if result.status == "failed"]
    possible = sum(result.status != "impossible" for result in results)
    named = f" (design {', '.join(failed)})" if failed else ""
    return [Goal(f"designs that fail{named}", len(failed), 0, possible)]


def write(folder: Path, results: Sequence[DesignResult], origin: str, command: str) -> None:
    """Write range.csv with all columns and the report RANGE.md."""
    from studies.output.csv_tables import write_table

    write_table(folder / "range.csv", [result.row() for result in results], digits=6)
    good, impossible, failed = (
        sum(result.status == status for result in results) for status in ("ok", "impossible", "failed")
    )
    counts = f"Of {len(results)} designs, {good} are good, {impossible} are impossible and {failed} failed."
    lines = ["# Range of designs", "", counts, "", *ABOUT.splitlines(), ""]
    lines += ["Least, median and greatest value of each measured quantity (magnitude, for errors):", ""]
    lines += ["| quantity | least | median | greatest |", "|---|---|---|---|"]
    for spread in summary(results):
        numbers = " | ".join(f"{value:.3g}" for value in (spread.least, spread.median, spread.greatest))
        lines.append(f"| {spread.quantity.replace('_', ' ')} | {numbers} |")
    heads = ["design", "D", "L", "magnet", "wall", "status", "tetrahedra", "s", "least Jacobian", "message"]
    lines += ["", f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for result in results:
        magnet = f"{result.magnet_diameter_mm:g} x {result.magnet_height_mm:g}"
        cells = [str(result.design), f"{result.D_mm:g}", f"{result.L_mm:g}", magnet, _text(result.wall_mm)]
        cells += [result.status, _text(result.tetrahedra, 6), _text(result.mesh_s), _text(result.least_jacobian)]
        lines.append(f"| {' | '.join([*cells, result.message])} |")
    lines += ["", checkpoint.solved_at(result.commit for result in results), "", made(command, origin)]
    write_text(folder / "RANGE.md", "\n".join(lines) + "\n")


def _text(value: float | None, digits: int = 3) -> str:
    return "" if value is None else f"{value:.{digits}g}"
