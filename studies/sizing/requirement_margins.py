"""What variants reach, as values and as signed margins of the requirements; outer size, height and printed walls."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geometry.arrays import Array
from geometry.base import Base, outer_size, plan
from geometry.design import BadInput
from geometry.mold import Mold, sizes

if TYPE_CHECKING:
    from studies.sizing.candidate_variables import Variant
    from studies.sizing.requirements import Requirements

MOST, LEAST = 1.0, -1e3
"""Bounds of a margin: more than twice a bound is no better, and NaN, where the source has no answer, is the worst."""


@dataclass(frozen=True, slots=True, eq=False)
class Performance:
    """What n variants reach, each attribute of shape (n,).

    Attributes
    ----------
    range_z : largest press force, N, up to which strain, stability, saturation and the source's range hold, without
        shear, at the least E; half_width: of its interval.
    reach : press force at the largest depth that the source covers, N, at the least E.
    range_x : largest sideways force under the whole press range, N, as far as the source reaches.
    depth, depth_stiff : depth under the required press range, over D, at the least and at the largest E.
    range_depth : depth under range_z at the least E, over D.
    shears : shear at the end of the sideways range at the depths of `range_poses.shear_curves` and the least E, over
        D, shape (n, SHEARED_DEPTHS).
    resolution_z, resolution_x : worst standard deviation of the decoded forces, N.
    strain, strain_half_width : largest strain of the silicone at the ends of the ranges.
    critical, critical_half_width : critical depth over D, inf where there is none.
    first_mode, first_mode_half_width : Hz, at the least E.
    saturation : least distance of a reading from its rail, over that in zero field; negative at the rail.
    decoding : least det J over the product of its columns' lengths, negative if its sign changes.
    distinct : least distance of the readings of two poses, in standard deviations of their noise.
    clearance : least gap between elements and beam or plate less what is needed, mm.
    outer_size, height, wall : mm.
    margins : signed margins of the requirements by name, relative to their bounds, each of shape (n,).
    """

    range_z: Array
    range_z_half_width: Array
    reach: Array
    range_x: Array
    depth: Array
    depth_stiff: Array
    range_depth: Array
    shears: Array
    resolution_z: Array
    resolution_x: Array
    strain: Array
    strain_half_width: Array
    critical: Array
    critical_half_width: Array
    first_mode: Array
    first_mode_half_width: Array
    saturation: Array
    decoding: Array
    distinct: Array
    clearance: Array
    outer_size: Array
    height: Array
    wall: Array
    margins: Mapping[str, Array]

    def one(self, k: int) -> dict[str, float]:
        """Return the values of one variant by name, without the margins."""
        names = [spec.name for spec in dataclasses.fields(self) if spec.name not in ("margins", "shears")]
        return {name: float(getattr(self, name)[k]) for name in names}


def margins(result: Performance, requirements: Requirements, caution: float = 1.0) -> dict[str, Array]:
    """Return the signed margins of the requirements, relative to their bounds; negative where one is missed.

    Parameters
    ----------
    caution : number of half widths by which the source's values are worsened first.
    """
    strain = result.strain + caution * result.strain_half_width
    critical = lower(result.critical, result.critical_half_width, caution)
    mode = result.first_mode - caution * result.first_mode_half_width
    # name in the requirements, value, and +1 for a bound from below or -1 for one from above
    compared = [
        ("force_z", result.range_z - caution * result.range_z_half_width, 1),
        ("force_x", result.range_x, 1),
        ("resolution_z", result.resolution_z, -1),
        ("resolution_x", result.resolution_x, -1),
        ("largest_strain", strain, -1),
        ("stability_margin", critical / result.depth, 1),
        ("first_mode", mode, 1),
        ("outer_size", result.outer_size, -1),
        ("height", result.height, -1),
    ]
    signed = {
        name: way * (value / bound - 1)
        for name, value, way in compared
        if (bound := getattr(requirements, name)) is not None
    }
    signed["wall"] = result.wall / requirements.printed_wall - 1
    if requirements.no_saturation:
        signed["no_saturation"] = result.saturation
    if requirements.unique_decoding:
        signed["unique_decoding"] = np.minimum(result.decoding, result.distinct - 1)
    signed["clearance"] = result.clearance
    # NaN is no margin; an inf of a beam that is always stable would hide the others
    return {name: np.clip(np.nan_to_num(value, nan=LEAST), LEAST, MOST) for name, value in signed.items()}


def lower(value: Array, half_width: Array, caution: float = 1.0) -> Array:
    """Return values less half widths; inf, which stands for no such depth, stays."""
    return np.where(np.isinf(value), value, value - caution * np.nan_to_num(half_width, posinf=0.0))


def lengths(variants: Sequence[Variant], requirements: Requirements) -> tuple[Array, Array, Array]:
    """Return outer size, height and thinnest printed wall, each of shape (n,), mm; NaN where no base is possible."""
    shape, process = requirements.outer_shape, requirements.process
    rows, choices = [], Base(shape=shape)
    for each in variants:
        try:
            outline = plan(each.design, choices, process)
            mould = sizes(each.design, Mold(process=process))
        except BadInput:
            rows.append((np.nan, np.nan, np.nan))
            continue
        (_, _, height), _ = outer_size(each.design, outline)
        posts = choices.seat_wall if outline.posts else np.inf
        rows.append((2 * outline.half, height, min(2 * mould.pin_radius, mould.wall, posts)))
    size, height, wall = np.array(rows).T
    return size, height, wall
