"""The report of `magtip stability`: the depth at which a press buckles sideways, and its stiffness in shear."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from analytic import buckling
from geometry.design import BadInput, Design
from geometry.loads import Magnet
from geometry.messages import Progress
from studies.output import records
from studies.output.records import FlatRow

if TYPE_CHECKING:
    from fem.analyses.small_shear import SmallShear


@dataclass(frozen=True, slots=True)
class SmallShearRow:
    """Response of a press to a small shear; all but the depth is None if the press does not reach the depth.

    Attributes
    ----------
    force_N : (x, y, z) of the press alone.
    stiffness_N_per_mm, shift_per_mm, tilt_rad_per_mm : shear force, shift and tilt of the magnet per mm of shear.
    """

    depth_mm: float
    force_N: list[float] | None = None
    contact_radius_mm: float | None = None
    stiffness_N_per_mm: float | None = None
    shift_per_mm: float | None = None
    tilt_rad_per_mm: float | None = None
    stiffness_error_estimate: float | None = None
    shift_error_estimate: float | None = None
    tilt_error_estimate: float | None = None


@dataclass(frozen=True, slots=True)
class StabilityReport:
    """Critical depths and forces of a free and of a guided tip, beside the formulas' loads.

    A critical depth or force is None if the press is stable at every depth searched, which is down to
    `stable_to_mm`. Where a search ended before its last depth, the status is unknown and the message says why.

    Attributes
    ----------
    status : ok; unknown; unstable, where a small shear is asked for at a depth at which even a guided tip gives way;
        not_converged, where the press does not reach that depth.
    small_shear : None if no depth was requested; a row without a depth has no columns for it.
    """

    status: str
    message: str
    critical_depth_mm: float | None
    critical_force_N: float | None
    critical_depth_error_estimate: float | None
    critical_force_error_estimate: float | None
    stable_to_mm: float
    euler_N: float
    haringx_N: float
    haringx_depth_mm: float
    guided_critical_depth_mm: float | None
    guided_critical_force_N: float | None
    guided_critical_depth_error_estimate: float | None
    guided_critical_force_error_estimate: float | None
    guided_stable_to_mm: float
    guided_euler_N: float
    small_shear: SmallShearRow | None = field(default=None, metadata={"prefix": ""})

    def row(self) -> FlatRow:
        """Return the flat row for JSON."""
        return records.flat(self)


def run(design: Design, magnet: Magnet, accuracy: str, depth: float | None, progress: Progress) -> StabilityReport:
    """Find the critical depths of a free and of a guided tip; at a depth, mm, also solve a small shear."""
    from fem.accuracy import LEVELS
    from fem.analyses import small_shear, stability

    # a depth out of range is refused here, before the searches, which take seconds
    if depth is not None:
        small_shear.check_depth(design, depth, magnet)
    level = LEVELS[accuracy]
    progress(0.0, "free tip")
    free = stability.critical(design, magnet, accuracy=level)
    progress(0.4, "guided tip")
    guided = stability.critical(design, magnet, guided=True, accuracy=level)
    report = StabilityReport(
        status="unknown" if free.message or guided.message else "ok",
        # both searches may end for the same reason, which is then named once
        message=_joined(*dict.fromkeys((free.message, guided.message))),
        critical_depth_mm=free.depth,
        critical_force_N=free.force,
        critical_depth_error_estimate=free.estimates.depth,
        critical_force_error_estimate=free.estimates.force,
        stable_to_mm=free.stable_to,
        euler_N=buckling.euler(design),
        haringx_N=buckling.haringx(design),
        haringx_depth_mm=buckling.depth(design, buckling.haringx(design)),
        guided_critical_depth_mm=guided.depth,
        guided_critical_force_N=guided.force,
        guided_critical_depth_error_estimate=guided.estimates.depth,
        guided_critical_force_error_estimate=guided.estimates.force,
        guided_stable_to_mm=guided.stable_to,
        guided_euler_N=buckling.euler(design, buckling.GUIDED),
    )
    if depth is None:
        return report
    progress(0.8, f"shear at depth {depth:g} mm")
    try:
        shear = small_shear.small_shear(design, depth, magnet, accuracy=level)
    except BadInput as error:
        message = _joined(report.message, str(error))
        return dataclasses.replace(report, status="not_converged", message=message, small_shear=SmallShearRow(depth))
    status, sentence = _stability_at(report, depth, shear.stiffness)
    message = _joined(report.message, sentence)
    return dataclasses.replace(report, status=status, message=message, small_shear=_small_shear_row(depth, shear))


def _joined(*sentences: str) -> str:
    return "; ".join(sentence for sentence in sentences if sentence)


def _small_shear_row(depth: float, shear: SmallShear) -> SmallShearRow:
    return SmallShearRow(
        depth_mm=depth,
        force_N=[0.0, 0.0, shear.force],
        contact_radius_mm=shear.contact_radius,
        stiffness_N_per_mm=shear.stiffness,
        shift_per_mm=shear.shift,
        tilt_rad_per_mm=shear.tilt,
        stiffness_error_estimate=shear.estimates.stiffness,
        shift_error_estimate=shear.estimates.shift,
        tilt_error_estimate=shear.estimates.tilt,
    )


def _stability_at(report: StabilityReport, depth: float, stiffness: float) -> tuple[str, str]:
    """Return status and sentence of a press to a depth, mm, whose sheared tip sticks to the plate."""
    free, guided = report.critical_depth_mm, report.guided_critical_depth_mm
    if (guided is not None and depth > guided) or not stiffness > 0:
        return "unstable", f"at depth {depth:g} mm the straight press is unstable even with a guided tip"
    if depth > report.guided_stable_to_mm:
        limit = report.guided_stable_to_mm
        return "unknown", f"at depth {depth:g} mm stability is unknown: the search ended at {limit:.4g} mm"
    if free is not None and depth > free:
        return report.status, (
            f"at depth {depth:g} mm the straight press is unstable if the tip slides freely: stiffness, shift and "
            "tilt hold for a tip that sticks to the plate"
        )
    return report.status, ""


def shown(report: StabilityReport) -> FlatRow:
    """Return the row for the terminal, where "none up to 3.5" stands in place of a missing critical depth."""
    texts = {}
    for name, depth, limit in (
        ("critical_depth_mm", report.critical_depth_mm, report.stable_to_mm),
        ("guided_critical_depth_mm", report.guided_critical_depth_mm, report.guided_stable_to_mm),
    ):
        if depth is None:
            texts[name] = f"none up to {limit:.5g}"
    return report.row() | texts
