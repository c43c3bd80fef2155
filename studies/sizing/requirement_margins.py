"""What variants reach, as values and as signed margins of the requirements; outer size, height and printed walls."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from analytic.force_resolution import SINGULAR
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
class ReachedRange:
    """The forces along one axis that n variants reach in each of their required poses, shape (n, k), N.

    NaN stands for a force that is not known: no range is then reached.
    """

    poses: Array

    def force(self, most: Array) -> Array:
        """Return the forces that are reached in all poses, shape (n,), not followed beyond `most`; NaN if unknown.

        >>> ReachedRange(np.array([[1.7, 2.0], [2.0, np.nan], [3.0, 4.0]])).force(np.array([2.0, 2.0, 2.0])).tolist()
        [1.7, nan, 2.0]
        """
        return np.asarray(np.minimum(self.poses.min(axis=1), most))


@dataclass(frozen=True, slots=True, eq=False)
class Performance:
    """What n variants reach, each attribute of shape (n,), at the worse ends of the source's intervals.

    Attributes
    ----------
    range_z : largest press force, N, up to which strain, stability, saturation and the source's range hold, without
        shear, at the least E.
    reach : press force at the largest depth that the source covers, N, at the least E.
    range_x : sideways force that is reached under every required press, at most the required one, N; NaN where one
        of them is not known, and where no range is required.
    depth, depth_stiff : depth under the required press range, over D, at the least and at the largest E.
    range_depth : depth under range_z at the least E, over D.
    shears : shear at the end of the sideways range at the depths of `range_poses.shear_curves` and the least E, over
        D, shape (n, SHEARED_DEPTHS).
    resolution_z, resolution_x : worst standard deviation of the decoded forces, N.
    strain : largest strain of the silicone at the ends of the ranges.
    critical : critical depth over D; inf where a search to its end found none, NaN where it is not known.
    stable_to : depth over D up to which presses are known to be stable; NaN where nothing is known.
    first_mode : Hz, at the least E.
    saturation : least distance of a reading from its rail, over that in zero field; negative at the rail.
    decoding : least det J over the product of its columns' lengths, negative if its sign changes.
    distinct : least distance of the readings of two poses, in standard deviations of their noise.
    clearance : least gap between elements and beam or plate less what is needed, mm.
    outer_size, height, wall : mm.
    margins : signed margins of the requirements by name, relative to their bounds, each of shape (n,).
    """

    range_z: Array
    reach: Array
    range_x: Array
    depth: Array
    depth_stiff: Array
    range_depth: Array
    shears: Array
    resolution_z: Array
    resolution_x: Array
    strain: Array
    critical: Array
    stable_to: Array
    first_mode: Array
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


def margins(result: Performance, requirements: Requirements) -> dict[str, Array]:
    """Return the signed margins of the requirements, relative to their bounds; negative where one is missed."""
    # name in the requirements, value, and +1 for a bound from below or -1 for one from above
    compared = [
        ("force_z", result.range_z, 1),
        ("force_x", result.range_x, 1),
        ("resolution_z", result.resolution_z, -1),
        ("resolution_x", result.resolution_x, -1),
        ("largest_strain", result.strain, -1),
        ("stability_margin", result.stable_to / result.depth, 1),
        ("first_mode", result.first_mode, 1),
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
        signed["unique_decoding"] = np.minimum(result.decoding - SINGULAR, result.distinct - 1)
    signed["clearance"] = result.clearance
    # NaN is no margin, and a large one would hide the others
    return {name: np.clip(np.nan_to_num(value, nan=LEAST), LEAST, MOST) for name, value in signed.items()}


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
