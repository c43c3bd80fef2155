"""What n variants reach at once: forces, resolution, strain, stability, frequency and size, and the margins left.

The E of a silicone is a range, so each bound is held at the end where it is hardest to meet: strain, stability,
saturation and the first mode at the least E, where a force presses deepest, and the resolution at the largest E,
where it moves the magnet least. The remanence is a range too: saturation counts at its high end, resolution at its
low end.

A source's values are uncertain too: those at the least E are of the softer end of its intervals, those at the largest
E of the stiffer end.

The poses of a force range are a grid over press force, sideways force and its direction (`PoseGrid`). They are the
same for the surrogate and for finite elements, see `beam_curves`.

Readings at these poses say how finely the force is resolved, whether they saturate and whether they decode uniquely.
The poses are one table of rows, sensor after sensor, with equally many rows each.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from analytic import force_resolution
from analytic.clearance import wall_gaps
from analytic.force_resolution import SINGULAR, STEP, Loaded
from analytic.hall import batch_readings
from analytic.parts import common_values, of_design
from geometry.arrays import Array, Ints
from geometry.base import LEAST_GAP, Base, outer_size, plan
from geometry.cad import element_positions
from geometry.design import BadInput
from geometry.fabrication.hall_elements import SS495A
from geometry.mold import Mold, sizes
from studies.mechanics import surrogate_range
from studies.mechanics.path_solver import frequency_unit
from studies.sensitivity.made_sensors import MadeSensors, made_readings
from studies.sizing.beam_curves import Beams, PressCurves, ShearCurves, press_curves, shear_curves
from studies.sizing.candidate_variables import Variant
from studies.sizing.requirements import Requirements


class Reader(Protocol):
    """What sensors read at poses; k rows for each sensor."""

    def fields(self, shift: Array, tilt: Array) -> Array:
        """Return the flux densities that the elements measure, shape (n k, 3), T."""

    def slopes(self, loaded: Loaded) -> Array:
        """Return their slopes along depth and shears, shape (n k, 3, 3), T/mm."""

    def rail_margin(self, shift: Array, tilt: Array) -> Array:
        """Return the least distance of a reading from its rail, over that in zero field, shape (n k,)."""

    def noise(self) -> Array:
        """Return the standard deviation of a reading of each sensor, shape (n,), T."""


@dataclass(frozen=True, slots=True)
class NominalReader:
    """Sensors as designed: slopes with the least remanence of the magnet's grade, rails with the largest."""

    variants: Sequence[Variant]

    def fields(self, shift: Array, tilt: Array) -> Array:
        """Return the flux densities with the middle of the remanence's range, shape (n k, 3), T."""
        designs = [each.design for each in self.variants]
        return batch_readings(designs, self._owner(len(shift)), shift, tilt).field_T

    def slopes(self, loaded: Loaded) -> Array:
        """Return the slopes, shape (n k, 3, 3), T/mm."""
        weak = [dataclasses.replace(each.design, remanence=each.magnet.remanence_low) for each in self.variants]
        return force_resolution.reading_slopes(weak, self._owner(len(loaded.shift)), loaded)

    def rail_margin(self, shift: Array, tilt: Array) -> Array:
        """Return the margins, shape (n k,)."""
        strong = [dataclasses.replace(each.design, remanence=each.magnet.remanence_high) for each in self.variants]
        owner = self._owner(len(shift))
        field = batch_readings(strong, owner, shift, tilt).field_T
        gain, null, low, high, *_ = np.array([common_values(design) for design in strong])[owner].T[:, :, None]
        return _margin(null + gain * field, null, low, high)

    def noise(self) -> Array:
        """Return the noise, shape (n,), T."""
        return np.array([of_design(each.design)[0].noise_T for each in self.variants])

    def _owner(self, rows: int) -> Ints:
        return np.repeat(np.arange(len(self.variants)), rows // len(self.variants))


@dataclass(frozen=True, slots=True)
class MadeReader:
    """Sensors as they are made, with their own magnets, gains and displaced parts."""

    sensors: MadeSensors

    def fields(self, shift: Array, tilt: Array) -> Array:
        """Return the flux densities, shape (n k, 3), T."""
        n = len(self.sensors)
        return made_readings(self.sensors, shift.reshape(n, -1, 3), tilt.reshape(n, -1, 2)).field_T.reshape(-1, 3)

    def slopes(self, loaded: Loaded) -> Array:
        """Return the slopes by central differences, as `analytic.force_resolution.reading_slopes` does."""
        half = STEP * self.sensors.nominal.D
        columns = []
        for k in range(3):
            step = half * loaded.shift_slopes[:, :, k], half * loaded.tilt_slopes[:, :, k]
            ahead, behind = (self.fields(loaded.shift + w * step[0], loaded.tilt + w * step[1]) for w in (1, -1))
            columns.append((ahead - behind) / (2 * half))
        return np.stack(columns, axis=2)

    def rail_margin(self, shift: Array, tilt: Array) -> Array:
        """Return the margins, shape (n k,)."""
        sensors, rows = self.sensors, len(shift) // len(self.sensors)
        gain, null, low, high, *_ = common_values(sensors.nominal)
        zero = np.repeat(null + sensors.null_shift, rows, axis=0)
        raw = zero + gain * np.repeat(sensors.gain_factor, rows, axis=0) * self.fields(shift, tilt)
        return _margin(raw, zero, np.full_like(raw, low), np.full_like(raw, high))

    def noise(self) -> Array:
        """Return the noise, shape (n,), T: of the element with the least gain."""
        return np.asarray(of_design(self.sensors.nominal)[0].noise_T / self.sensors.gain_factor.min(axis=1))


def _margin(raw: Array, null: Array, low: Array, high: Array) -> Array:
    """Return the least distance of outputs (n, 3) from their rails, over that of the null, shape (n,)."""
    return np.asarray(np.minimum((high - raw) / (high - null), (raw - low) / (null - low)).min(axis=1))


def decoding(reader: Reader, loaded: Loaded, n: int) -> tuple[Array, Array, Array]:
    """Return the worst standard deviations of the force components, shape (n, 3), N, and how far decoding is unique.

    The latter are the least scaled det J, negative if its sign changes, and the least distance between the readings
    of two poses, in standard deviations of the noise, each of shape (n,). det J is scaled by the lengths of its
    columns.
    """
    noise = np.repeat(reader.noise(), len(loaded.shift) // n)[:, None] * np.ones(3)
    slopes = reader.slopes(loaded)
    sigma = force_resolution.force_resolution(slopes, loaded.force_slopes, noise)
    length = np.linalg.norm(slopes, axis=1)
    columns = slopes / np.where(length == 0, 1.0, length)[:, None, :]
    # where a slope is not known, nor is the determinant
    with np.errstate(invalid="ignore"):
        scaled = np.linalg.det(columns).reshape(n, -1)
    turned = scaled * np.sign(np.median(scaled, axis=1))[:, None]
    values = (reader.fields(loaded.shift, loaded.tilt) / noise).reshape(n, -1, 3)
    apart = np.linalg.norm(values[:, :, None] - values[:, None], axis=3)
    same = np.arange(values.shape[1])
    apart[:, same, same] = np.inf
    return sigma.reshape(n, -1, 3).max(axis=1), turned.min(axis=1), apart.min(axis=(1, 2))


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
    shears : shear at the end of the sideways range at the depths of `beam_curves.shear_curves` and the least E, over
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
        posts = choices.seat_wall if outline.seats.posts else np.inf
        rows.append((2 * outline.half, height, min(2 * mould.pin_radius, mould.wall, posts)))
    size, height, wall = np.array(rows).T
    return size, height, wall


@dataclass(frozen=True, slots=True)
class PoseGrid:
    """Poses of a force range: press forces and sideways forces over the ranges, and directions from x towards y."""

    presses: tuple[float, ...]
    shears: tuple[float, ...]
    directions: int

    @property
    def sideways(self) -> list[tuple[float, float]]:
        """Sideways forces and their directions in degrees, first none."""
        turn = 360 / self.directions
        return [(0.0, 0.0), *((share, turn * k) for share in self.shears for k in range(self.directions))]


SEARCHED = PoseGrid((0.25, 1.0), (1.0,), 8)
"""Poses at which the search rates each candidate."""
CHECKED = PoseGrid((0.25, 0.4, 0.6, 0.8, 1.0), (0.33, 0.67, 1.0), 16)
"""Poses at which the points of a front are checked."""
NO_SHEAR = 0.02
"""Sideways force over the press force that a sensor without a required sideways range is examined at: it is small,
and fixes how the readings change sideways."""
MOST_RANGE = 3.0
"""Range over the required one beyond which more of it has no value, and is not looked for."""
DEEPER = 1.05
"""Depth to which a second source is evaluated over that which the first one says is needed."""


def performance(
    variants: Sequence[Variant],
    beams: Beams,
    requirements: Requirements,
    *,
    caution: float = 1.0,
    estimate: Performance | None = None,
    scales: Array | None = None,
    reader: Reader | None = None,
    grid: PoseGrid = SEARCHED,
) -> Performance:
    """Return what variants reach, of which `beams` gives the responses in the same order.

    Parameters
    ----------
    caution : number of half widths of the source's intervals by which its values are worsened; below 0 improved.
    estimate : what another source says of the same variants: this one is evaluated no deeper than needed to compare,
        and at the same shears.
    scales : factors on the ranges in z and in x of each variant, shape (n, 2), at which the other requirements are
        held against it; default: 1.
    grid : poses of the force range.
    reader : readings of the variants; default: with the ranges of the remanence that the catalogue states.
    """
    D, L, low, high, density, ratio = _columns(variants)
    factors = np.ones((len(D), 2)) if scales is None else scales
    force_z = factors[:, 0] * requirements.force_z
    force_x = NO_SHEAR * force_z if requirements.force_x is None else factors[:, 1] * requirements.force_x
    unit = D**2
    magnet = np.array([(each.design.magnet_diameter, each.design.magnet_height) for each in variants]) / D[:, None]
    limit = surrogate_range.deepest(L / D, *magnet.T)
    if estimate is not None:
        limit = np.minimum(limit, DEEPER * np.maximum(estimate.range_depth, estimate.depth))
    press = press_curves(beams, limit)
    soft, stiff = press.softer(caution), press.softer(-caution)
    depth = soft.depth_of_force((force_z / (low * unit))[:, None])[:, 0]
    depth_stiff = stiff.depth_of_force((force_z / (high * unit))[:, None])[:, 0]
    least = stiff.depth_of_force((grid.presses[0] * force_z / (high * unit))[:, None])[:, 0]
    farthest = surrogate_range.farthest(L / D)
    sheared = requirements.force_x is not None
    # the half widths of a small shear are those of the press, and say nothing of its slopes
    aside = caution if sheared else 0.0
    guess = None if estimate is None else estimate.shears
    shear = shear_curves(beams, press, least, depth, force_x / (low * unit), farthest, guess, aside)
    soft_shear, stiff_shear = shear.softer(aside), shear.softer(-aside)
    cases = [(soft, soft_shear, low), (stiff, stiff_shear, high)]
    # sensors that are made have one modulus each, and not a range of it
    cases = cases[:1] if caution == 0 and (low == high).all() else cases
    poses = [_poses(variants, *case, force_z, force_x, grid, sheared=sheared) for case in cases]
    reader = NominalReader(variants) if reader is None else reader
    figures = _reading_figures(reader, poses, len(variants), worst=caution >= 0)
    stable_to, critical, mode = beams.stable_to(caution), beams.critical_depth(), beams.first_mode(ratio)
    deepest, range_z = _Bounds(D, reader, soft, stable_to, requirements).range(low * unit)
    strain = soft.at("strain", depth[:, None])[:, 0]
    range_x = np.full(len(D), np.nan)
    if sheared:
        strain = np.maximum(strain, soft_shear.strain(force_x / (low * unit)).max(axis=1))
        range_x = _reached_aside(soft, soft_shear, (low * unit, high * unit), force_z, grid).force(force_x)
    # no half width where no critical depth was found, nor where none is asked for
    width = critical.half_width if caution else np.zeros(len(D))
    width = np.where(np.isinf(critical.value), 0.0, width)
    frequency = np.array([frequency_unit(*row) for row in np.stack([D, low, density], axis=1).tolist()])
    size, total, wall = lengths(variants, requirements)
    result = Performance(
        range_z=range_z,
        reach=soft.at("force", press.deepest[:, None])[:, 0] * low * unit,
        range_x=range_x,
        depth=depth,
        depth_stiff=depth_stiff,
        range_depth=deepest,
        shears=shear.shear[:, :, -1],
        resolution_z=figures.resolution[:, 2],
        resolution_x=figures.resolution[:, :2].max(axis=1),
        strain=strain,
        critical=critical.value - caution * width,
        stable_to=stable_to,
        first_mode=(mode.value - caution * mode.half_width) * frequency,
        saturation=figures.rail_margin,
        decoding=figures.signed_det,
        distinct=figures.distinct,
        clearance=_clearance(variants, poses[0], depth * D),
        outer_size=size,
        height=total,
        wall=wall,
        margins={},
    )
    return dataclasses.replace(result, margins=margins(result, requirements))


@dataclass(frozen=True, slots=True, eq=False)
class _ReadingFigures:
    """Figures of the readings of n variants at the worst pose and modulus, see `Performance`.

    Attributes
    ----------
    resolution : along x, y and z, N, shape (n, 3).
    signed_det, distinct, rail_margin : `decoding`, `distinct` and `saturation`, shape (n,).
    """

    resolution: Array
    signed_det: Array
    distinct: Array
    rail_margin: Array


def _reading_figures(reader: Reader, poses: Sequence[Loaded], count: int, *, worst: bool) -> _ReadingFigures:
    """Return the worst figures of the readings at the poses of each modulus; else those of the better modulus."""
    resolution, signed_det, distinct = zip(*(decoding(reader, each, count) for each in poses), strict=True)
    rails = [reader.rail_margin(each.shift, each.tilt).reshape(count, -1).min(axis=1) for each in poses]
    most, least = (np.max, np.min) if worst else (np.min, np.max)
    return _ReadingFigures(
        most(resolution, axis=0), least(signed_det, axis=0), least(distinct, axis=0), least(rails, axis=0)
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Bounds:
    """The bounds that limit the press range."""

    D: Array
    reader: Reader
    press: PressCurves
    stable_to: Array
    requirements: Requirements

    def range(self, unit: Array) -> tuple[Array, Array]:
        """Return the largest depth that keeps all bounds, over D, and its force, N; unit is E D^2, shape (n,)."""
        needed = self.requirements
        # where nothing is known of the stability, no depth is
        stable_to = np.nan_to_num(np.maximum(self.stable_to, 0.0), nan=0.0)
        deepest = np.minimum(self.press.deepest, stable_to / needed.stability_margin)
        enough = self.press.depth_of_force((MOST_RANGE * needed.force_z / unit)[:, None])[:, 0]
        deepest = np.minimum(deepest, enough)
        low = surrogate_range.SHALLOWEST
        depth = low + (np.maximum(deepest, 1.01 * low) - low)[:, None] * np.linspace(0.0, 1.0, 25)[1:]
        slack = self._slack(depth)
        kept = slack >= 0
        # between the last depth before the first one that breaks a bound, and that one, the slack is nearly linear
        count = np.where(kept.all(axis=1), depth.shape[1], kept.argmin(axis=1))
        rows, last = np.arange(len(depth)), np.maximum(count - 1, 0)
        after = np.minimum(count, depth.shape[1] - 1)
        fall = slack[rows, last] - slack[rows, after]
        share = np.where(fall > 0, slack[rows, last] / np.where(fall > 0, fall, 1.0), 0.0)
        chosen = depth[rows, last] + np.where(after > last, share, 0.0) * (depth[rows, after] - depth[rows, last])
        chosen = np.where(count > 0, chosen, low)
        force = self.press.at("force", chosen[:, None])[:, 0] * unit
        return chosen, np.where(count > 0, force, 0.0)

    def _slack(self, depth: Array) -> Array:
        """Return the least margin of strain and saturation at depths (n, k), at most 1; NaN without an answer."""
        slack = np.ones(depth.shape)
        if self.requirements.largest_strain is not None:
            slack = np.minimum(slack, 1 - self.press.at("strain", depth) / self.requirements.largest_strain)
        if self.requirements.no_saturation:
            shift = np.zeros((*depth.shape, 3))
            shift[..., 2] = -self.press.at("shift", depth) * self.D[:, None]
            rail = self.reader.rail_margin(shift.reshape(-1, 3), np.zeros((depth.size, 2)))
            slack = np.minimum(slack, rail.reshape(depth.shape))
        return slack


def _columns(variants: Sequence[Variant]) -> tuple[Array, ...]:
    """Return D, L, least and largest E, density and the ratio of the densities, each of shape (n,)."""
    rows = [
        (
            each.design.D,
            each.design.L,
            each.silicone.E_low,
            each.silicone.E_high,
            each.design.density,
            each.design.magnet_density / each.design.density,
        )
        for each in variants
    ]
    return tuple(np.array(rows).T)


def _poses(
    variants: Sequence[Variant],
    press: PressCurves,
    shear: ShearCurves,
    E: Array,
    force_z: Array,
    force_x: Array,
    grid: PoseGrid,
    *,
    sheared: bool,
) -> Loaded:
    """Return the poses of n variants at moduli E, shape (n,), as one table of rows, variant after variant."""
    D = np.array([each.design.D for each in variants])
    sideways = grid.sideways if sheared else grid.sideways[:1]
    presses = np.repeat(grid.presses, len(sideways))
    shares, azimuth = np.tile(np.array(sideways), (len(grid.presses), 1)).T
    unit = (E * D**2)[:, None]
    depth = press.depth_of_force(presses * force_z[:, None] / unit)
    # near the ends of what the source covers, a required force can lie beyond it: range_x says so
    aside = np.clip(shear.shear_of_force(shares * force_x[:, None] / unit, depth), 0.0, shear.farthest(depth))
    parts = [shear.at(press, name, depth, aside) for name in ("shift_x", "shift_z", "tilt", "force_x", "force_z")]
    # the vertical shift of `turned` is up
    scale = np.stack([D, -D, np.ones_like(D), E * D**2, E * D**2], axis=1)
    plane, by_depth, by_shear = (
        np.stack([part[i] for part in parts], axis=2) * scale[:, None, :] / (D[:, None, None] if i else 1.0)
        for i in range(3)
    )
    return force_resolution.turned(
        plane.reshape(-1, 5),
        by_depth.reshape(-1, 5),
        by_shear.reshape(-1, 5),
        (aside * D[:, None]).ravel(),
        np.tile(np.radians(azimuth), len(D)),
    )


def _reached_aside(
    press: PressCurves, shear: ShearCurves, units: Sequence[Array], force_z: Array, grid: PoseGrid
) -> ReachedRange:
    """Return the sideways forces that are reached under each press of the range, for each E D^2, shape (n,)."""
    parts = []
    for unit in units:
        depth = press.depth_of_force(np.array(grid.presses) * (force_z / unit)[:, None])
        parts.append(shear.reached(depth) * unit[:, None])
    return ReachedRange(np.hstack(parts))


def _clearance(variants: Sequence[Variant], loaded: Loaded, depth: Array) -> Array:
    """Return the least gap of S2 and S3 from the bulging wall and the pressed plate less what is needed, mm."""
    shifts = loaded.shift.reshape(len(variants), -1, 3)
    gaps = np.full(len(variants), np.inf)
    for k, each in enumerate(variants):
        design = each.design
        if design.hall_layout != "three":
            continue
        _, side, other = element_positions(design)
        beside = min(float(wall_gaps(design, place, shifts[k]).min()) for place in (side, other))
        above = design.L - depth[k] - side[2] - SS495A.height / 2
        gaps[k] = min(beside - SS495A.depth, above) - LEAST_GAP
    return gaps
