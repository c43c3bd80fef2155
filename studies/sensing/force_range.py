"""Force resolution over a range of loads: which noise each axis has, where it is worst, and what saturates.

The loads form a grid of normal forces, tangential forces and directions of the tangential force round the axis. The
mechanics give the magnet's shift under each load, and a survey of that pose gives the rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from analytic import beam, survey
from analytic.decode import Decoder
from analytic.inverse import response_surface
from analytic.survey import Survey
from geometry.arrays import Array
from geometry.design import BadInput
from geometry.loads import Load
from studies.inputs import user_input
from studies.output.records import FlatRow
from studies.sensing import decode_readings
from studies.sensing.decode_readings import Source
from studies.sensing.layout_metrics import percent_text

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

COUNTS = (11, 9, 16)
"""Numbers of normal forces, of tangential forces and of directions."""
MOST_FORCE = 1e6
"""N."""


@dataclass(frozen=True, slots=True, eq=False)
class Loads:
    """Loads of a range with the survey of their poses.

    force : (F_x, F_y, F_n), shape (3, n), N, with the normal force as the slowest index.
    distinct : False for a load that equals an earlier one of the grid, as without a tangential force, shape (n,).
    poses : survey; the weight of a load that is not reached is 0, and equal loads share theirs.
    plate : depth, shear_x and shear_y, shape (3, n), mm.
    """

    force: Array
    distinct: NDArray[np.bool_]
    poses: Survey
    plate: Array

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Whether the formulas or states reach each load, shape (n,)."""
        return self.poses.weight > 0


def parse(text: str) -> tuple[float, float]:
    """Return the limits of the normal and of the tangential force, N, from a text NORMAL,TANGENTIAL.

    >>> parse("5,2")
    (5.0, 2.0)
    """
    values = user_input.parse_numbers("--force-range", text)
    if len(values) != 2:
        raise BadInput(f"--force-range takes 2 numbers, NORMAL,TANGENTIAL in N; got {len(values)} in {text!r}")
    normal, tangential = values
    if not (0 < normal <= MOST_FORCE and 0 <= tangential <= MOST_FORCE):
        raise BadInput(
            f"--force-range: the normal force must be above 0 and the tangential force 0 or more, both at most "
            f"{MOST_FORCE:g} N; got {normal:g} and {tangential:g} N"
        )
    return normal, tangential


def loads(coder: Decoder, normal: float, tangential: float, clearance: float = 0.0) -> Loads:
    """Return the loads of a range with the survey of their poses; lengths in mm, forces in N."""
    law = coder.mechanics
    assert law is not None
    counts = (COUNTS[0], COUNTS[1] if tangential else 1, COUNTS[2] if tangential else 1)
    F_n, F_t, angle = (
        values.ravel()
        for values in np.meshgrid(
            np.linspace(0, normal, counts[0]),
            np.linspace(0, tangential, counts[1]),
            2 * np.pi * np.arange(counts[2]) / counts[2],
            indexing="ij",
        )
    )
    u, w = response_surface.shifts_of_forces(law, coder.low, coder.high, F_t, F_n)
    # rounded, so that a force along an axis has no component of 1e-16 across it
    e = np.round([np.cos(angle), np.sin(angle)], 15)
    shift = np.stack([u * e[0], u * e[1], w])
    reached, pressed = np.isfinite(w), F_t == 0
    # a load that is not reached keeps its place in the grid, at rest and without weight
    shift[:, ~reached] = 0.0
    plate = response_surface.force_and_load(law, shift, contact=False)[1]
    # a plate that does not touch exerts no force; rounding may lift it a little above rest
    touches = (plate[0] > 0) | ((F_n == 0) & pressed)
    weight = np.where(reached & touches, np.where(pressed, 1 / counts[2], 1.0), 0.0)
    poses = survey.at_poses(coder, shift, weight, counts, clearance=clearance)
    return Loads(np.stack([F_t * e[0], F_t * e[1], F_n]), ~pressed | (angle == 0), poses, plate)


def evaluate(coder: Decoder, grid: Loads, normal: float, tangential: float, source: Source) -> FlatRow:
    """Return the resolution over a range of loads; `source` gives the mechanics.

    Lists of three are along x, y and z, and None without a usable load.

    loads : number of loads of the grid; reached_percent : share of them that the formulas or states reach.
    unique_percent, ambiguous_percent, saturated_percent, blocked_percent : shares of the reached loads, see
        `layout_metrics`; saturated_elements : those that saturate at any reached load.
    folded : whether det J changes its sign between usable loads; the worst resolution is then infinite.
    depth_mm, shear_mm : largest depth and shear of the reached loads.
    rest_N : resolution at rest; median_N, worst_N : median and largest value over the usable loads; worst_N_per_N :
        the largest over the largest force of the range along its axis.
    worst_at_N, worst_at_mm : force (F_x, F_y, F_n) and shift at which the resolution of each axis is worst.
    full_load_N : largest resolution over all directions of the full load, None unless all of these are usable;
        full_load_N_per_N : the same over the size of the full load.
    """
    poses, sigma = grid.poses, grid.poses.axis_noise_N
    reached, usable = grid.reached, grid.poses.usable
    share = 100 * float(reached[grid.distinct].mean())
    at_rest = usable & (np.abs(grid.force).max(axis=0) == 0)
    full = (grid.force[2] == normal) & (np.hypot(*grid.force[:2]) >= tangential * (1 - 1e-12))
    full_load = _largest(sigma[:, full]) if usable[full].all() else None
    size = float(np.hypot(normal, tangential))
    worst = [int(np.flatnonzero(usable)[sigma[k, usable].argmax()]) for k in range(3)] if usable.any() else []
    limits = (tangential, tangential, normal)
    largest = [math.inf if poses.folded else float(sigma[k, at]) for k, at in enumerate(worst)] or None
    many = poses.multiplicity > 1
    shares = [usable & ~many, usable & many, poses.saturated & ~poses.blocked, poses.blocked]
    unique, ambiguous, saturated, blocked = (100 * poses.share(flags) for flags in shares)
    pairs = zip(coder.forward.elements, poses.by_element, strict=True)
    names = [element.name for element, flags in pairs if (flags & reached).any()]
    found: FlatRow = {
        "message": "",
        "normal_N": normal,
        "tangential_N": tangential,
        "loads": int(grid.distinct.sum()),
        "reached_percent": share,
        "unique_percent": unique,
        "ambiguous_percent": ambiguous,
        "saturated_percent": saturated,
        "blocked_percent": blocked,
        "saturated_elements": names,
        "folded": poses.folded,
        "depth_mm": float(grid.plate[0, reached].max()),
        "shear_mm": float(np.hypot(*grid.plate[1:, reached]).max()),
        "rest_N": _largest(sigma[:, at_rest]),
        "median_N": np.median(sigma[:, usable & grid.distinct], axis=1).tolist() if usable.any() else None,
        "worst_N": largest,
        "worst_N_per_N": largest and [s / most if most else None for s, most in zip(largest, limits, strict=True)],
        "worst_at_N": [grid.force[:, at].tolist() for at in worst] or None,
        "worst_at_mm": [poses.shift[:, at].tolist() for at in worst] or None,
        "full_load_N": full_load,
        "full_load_N_per_N": full_load and [s / size for s in full_load],
        "warnings": _force_warnings(coder, grid, source),
    }
    said = decode_readings.sentences("forces", f=found, percent=percent_text)
    return found | {"message": "; ".join(said)}


def _largest(sigma: Array) -> list[float] | None:
    return sigma.max(axis=1).tolist() if sigma.shape[1] else None


def _force_warnings(coder: Decoder, grid: Loads, source: Source) -> list[str]:
    """Return warnings: forces that differ from those of the best level, or loads outside the range of the source."""
    reached, level = grid.reached, source.name
    if not source.is_formula:
        # no plate holds a force along it that does not press, whatever the source
        beyond = ~reached & grid.distinct & (grid.force[2] > 0)
        if not beyond.any():
            return []
        least = float((np.hypot(*grid.force[:2, beyond]) / grid.force[2, beyond]).min())
        held = f", where the plate needs a friction of {least:.2g} or more" if least else ""
        remedy = "solve" if level == decode_readings.RESPONSES else "give states by --responses that go"
        share = percent_text(100 * float(beyond.sum() / grid.distinct.sum()))
        return [f"{share} of the loads lie beyond the {source.kind}{held}: {remedy} deeper or farther sideways"]
    if level == decode_readings.BEST:
        depth, shear = float(grid.plate[0, reached].max()), float(np.hypot(*grid.plate[1:, reached]).max())
        remark = beam.outside(coder.forward.design, Load(depth=depth, shear_x=shear, friction="stick"), level)
        return [f"{remark}: give states solved by finite elements with --responses"] if remark else []
    # the rows of force_range.csv; those that are not reached have no force to compare
    shift, force = (np.where(reached, v, np.nan).T[grid.distinct] for v in (grid.poses.shift, grid.force))
    gap = decode_readings.force_gap(coder, level, shift, force)
    return [] if gap is None else decode_readings.level_warnings(level, gap)


def table(grid: Loads) -> pd.DataFrame:
    """Return the table of the distinct loads of a range; NaN where a load is not reached.

    reached, usable, saturated : 0 or 1; a usable load is reached, and neither blocked nor saturated.
    multiplicity : number of poses with the same readings; NaN where it was not computed.
    resolution_*_N_per_N : over the size of the force; NaN without a force.
    """
    import pandas as pd

    poses, reached = grid.poses, grid.reached
    sigma = np.where(reached, poses.axis_noise_N, np.nan)
    size = np.linalg.norm(grid.force, axis=0)
    flags = {"reached": reached, "usable": poses.usable, "saturated": reached & poses.saturated}
    columns = {
        **_by_axis("force", "N", grid.force),
        **_by_axis("shift", "mm", np.where(reached, poses.shift, np.nan)),
        **{name: flag.astype(int) for name, flag in flags.items()},
        "multiplicity": np.where(poses.multiplicity, poses.multiplicity, np.nan),
        **_by_axis("resolution", "N", sigma),
        **_by_axis("resolution", "N_per_N", sigma / np.where(size, size, np.nan)),
    }
    return pd.DataFrame(columns)[grid.distinct]


def _by_axis(name: str, unit: str, values: Array) -> dict[str, Array]:
    return {f"{name}_{axis}_{unit}": column for axis, column in zip("xyz", values, strict=True)}
