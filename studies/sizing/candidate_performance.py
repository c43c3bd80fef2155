"""What n sensors reach at once: forces, resolution, strain, stability, frequency and size, and the margins left.

The E of a silicone is a range, and so is the remanence of a magnet's grade. A sensor that is made has one value of
each, so whole sensors are evaluated at the corners: with the least E on the softer side of the source's intervals,
and with the largest E on the stiffer one. Fields are proportional to the remanence, so that its worse end is known:
the least one for resolution and unique decoding, the largest one for saturation. Each figure is the worst over
corners and required loads, and `Performance.worst` names where that is. Where a source has no answer a figure is NaN,
and its requirement is missed.

The loads are those of `Requirements.loads`, the same for the surrogate and for finite elements; forces along the
plate act in several directions. The range is the largest common factor of all required loads up to which strain,
stability, saturation and the source's range hold at the least E.

Drift is what a change of the remanence B_r and of the gain does to the decoded forces, over full scale:
|dF/dB . B| (|dB_r/dT| / B_r + |dgain/dT| / gain) per K, where B are the readings; the magnitudes add, because data
sheets give bounds of both signs. Drifts of the null and of the modulus are not in it. The error by a uniform field
B_a is at most |B_a| times the largest singular value of dF/dB N, with the elements' directions N. Where it is
rejected, sensors of nine readings or more decode it along with the pose (`analytic.inverse.ambient_field`): their
readings and slopes count less what a uniform field explains. The error by the temperature is per K: that of drift,
modulus (proportional to the absolute temperature) and the silicone below the magnet, which expands and lifts it;
magnitudes add, and nulls and the base are not in it. Hysteresis is the gap of steady
triangular presses at mid-stroke over the largest force: that of a linear viscoelastic spring with a small constant
tan(delta), 8/pi^2 times Catalan's constant times tan(delta), times `PRESS_GAP`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analytic.clearance import wall_distance
from analytic.hall import rotated
from analytic.inverse.ambient_field import FEWEST
from analytic.inverse.forward_model import readings_of_sensors
from geometry.arrays import Array, Ints
from geometry.base import LEAST_GAP
from geometry.design import KELVIN, REFERENCE_TEMPERATURE
from geometry.fabrication.hall_elements import SS495A
from studies.beam import surrogate_range
from studies.beam.beam_curves import (
    SHEARED_DEPTHS,
    SOLVED_DEPTHS,
    Curves,
    States,
    depths_between,
    pressed_curves,
    with_shears,
)
from studies.beam.beam_model import RatedBeams
from studies.parts.catalogues import PRESS_GAP, SPRING_GAP
from studies.parts.requirements import LEAST_CHIPS, MOST, SINGULAR, Requirements
from studies.sensing.disturbances import SILICONE_EXPANSION
from studies.sizing.beam_neighbours import Poses, estimated
from studies.sizing.sensor_arrays import Sensors

HALF_TURN, WHOLE_TURN = np.radians(45.0 * np.arange(1, -4, -1)), np.radians(45.0 * np.arange(8))
"""Directions of forces along the plate: of sensors that the plane x = y mirrors, and of all others."""
NO_SHEAR = 0.05
"""Shear over D that shows how readings change sideways where no force along the plate is required."""
LEAST = -1e3
"""Least margin: NaN, where the source has no answer, is the worst."""
DEEPER = 1.04
"""Depths and shears to which finite elements are asked, over those of the surrogate; the least depth is divided."""
LEAST_ASKED = 0.02
"""Shallowest press over D under which finite elements are asked for shears: where the surrogate ends, they do not."""
NEODYMIUM_DRIFT = (-1.2e-3, -0.9e-3)
"""Least and largest change of the remanence of NdFeB per K, relative: usual in tables of grades, assumed of all."""
STIFFER = 1 / (KELVIN + REFERENCE_TEMPERATURE)
"""Relative change of the modulus of a rubber per K (`geometry.design.modulus_at`)."""
SCAN = np.array([0.4, 0.7, 1.0])
"""Shares of the range that stability allows at which the bounds are evaluated, before the crossing is refined."""
REFINED = 3
"""Steps of that refinement."""


@dataclass(frozen=True, slots=True, eq=False)
class Performance:
    """What n sensors reach.

    Attributes
    ----------
    values : figures by name, each of shape (n,); NaN where unknown:
        range_z, range_x, N; depth, depth_stiff under the required press, over D, at the least and the largest E;
        resolution_z, resolution_x, N; strain; critical, stable_to, over D; first_mode, Hz; saturation (least distance
        of a reading from its rail, over that in zero field); decoding (least determinant of the slopes over the
        lengths of its columns, negative if its sign changes); drift per K and
        hysteresis, over full scale; ambient, N/T, and warming, N/K (errors of the force by a uniform field and by the
        temperature); distinct (least distance of the readings of two loads,
        in standard deviations of their noise); clearance, outer_size, height, wall, mm; reach and reach_x (largest
        press and force along the plate that the source covers, over the required ones); bandwidth of readings, Hz;
        D and L, mm.
    margins : signed margins of the requirements, relative to their bounds, clipped to LEAST and MOST.
    corner, loads : for each of the p poses the corner (0 the least E, 1 the largest) and normal force, force along
        the plate, N, and its direction, rad, shape (n, p, 3).
    worst : the pose of each of `WORST`, shape (n,); -1 unknown.
    depth, shear : of the poses, over D, shape (n, p).
    ask : deepest press, least and largest depth of shears, and the shears at the depths of `depths_between` to which
        finite elements must be asked, shape (n, 3 + SOLVED_DEPTHS), over D.
    """

    values: Mapping[str, Array]
    margins: Mapping[str, Array]
    corner: Ints
    loads: Array
    worst: Mapping[str, Ints]
    depth: Array
    shear: Array
    ask: Array

    def one(self, k: int) -> dict[str, float]:
        """Return the figures of one sensor."""
        return {name: float(value[k]) for name, value in self.values.items()}


def _poses(loads: Array, sensors: Sensors) -> tuple[Ints, Array]:
    """Return the load of each pose, and the direction of its force along the plate."""
    turns = [HALF_TURN if sensors.mirrored else WHOLE_TURN, np.zeros(1)]
    angles = [turns[int(load[1] == 0)] for load in loads]
    return np.repeat(np.arange(len(loads)), list(map(len, angles))), np.concatenate(angles)


def performance(
    sensors: Sensors,
    beams: RatedBeams,
    needed: Requirements,
    *,
    caution: float = 1.0,
    share: Array | None = None,
    ask: Array | None = None,
    dense: bool = False,
    limit: float | None = None,
) -> Performance:
    """Return what sensors reach, of which `beams` gives the responses in the same order.

    Parameters
    ----------
    caution : number of half widths of the source's intervals by which its values are worsened; below 0 improved.
    share : shares of the required forces in z and x, shape (n, 2), at which the sensors are rated; default: 1.
    ask : `Performance.ask` of the surrogate, for finite elements: they are evaluated no further.
    dense : more loads, for the points of a front.
    limit : for a search, largest `missed` of interest. What misses more under presses alone has no other figures,
        a range beyond the required loads has only what meets all else, and nothing has a `Performance.ask`.
    """
    n = len(sensors)
    share = np.ones((n, 2)) if share is None else share
    loads = needed.loads(dense=dense)
    poses = _poses(loads, sensors)
    p, units = len(poses[0]), np.stack([each * sensors.D**2 for each in (sensors.E_low, sensors.E_high)], axis=1)
    deepest = surrogate_range.deepest(*sensors.beam[:, :3].T) if ask is None else ask[:, 0]
    pressed, stable = pressed_curves(beams, deepest), beams.stable_to(caution)
    known = np.fmin(np.nan_to_num(stable, nan=0.0), deepest)
    part = _Rated(
        sensors, pressed, known, stable, units, share, needed, loads, *poses, caution, limit is not None
    )  # fmt: skip
    top = part.top_force(pressed.softer(caution), known)
    values = {name: np.full(n, np.nan) for name in FIGURES} | {"D": sensors.D, "L": sensors.L}
    values |= {"reach": top / (share[:, 0] * needed.force_z), "stable_to": stable, "outer_size": sensors.size}
    values |= {"critical": _critical(beams, caution), "height": sensors.height, "wall": sensors.wall}
    values |= {"bandwidth": sensors.bandwidth, "room": sensors.room}
    if needed.first_mode is not None or dense:
        unit = np.sqrt(sensors.E_low / sensors.density) / sensors.D
        mode = beams.first_mode(sensors.magnet_density / sensors.density)
        values["first_mode"] = (mode.value - caution * mode.half_width) * unit
    depth, shear, moved = np.full((n, 2 * p), np.nan), np.full((n, 2 * p), np.nan), np.full((n, 2 * p, 3), np.nan)
    worst, asked = {name: np.full(n, -1) for name in WORST}, np.full((n, 3 + SOLVED_DEPTHS), np.nan)
    result = Performance(values, {}, np.repeat([0, 1], p), moved, worst, depth, shear, asked)
    rows = np.flatnonzero(values["reach"] >= 1)
    part = part.take(rows)
    if len(rows) and limit is not None:
        for name, value in part.of_presses().items():
            values[name][rows] = value
        met = {name: np.where(m > LEAST, m, 0.0)[rows] for name, m in margins(values, needed).items()}
        kept = np.flatnonzero(missed(met) <= limit)
        part, rows = part.take(kept), rows[kept]
    if len(rows):
        part.fill(result, rows, beams if len(rows) == n else beams.take(rows), None if ask is None else ask[rows])
    return replace(result, margins=margins(values, needed))


def _critical(beams: RatedBeams, caution: float) -> Array:
    critical = beams.critical_depth()
    # no half width where no critical depth was found, nor where none is asked for
    width = np.where(np.isinf(critical.value), 0.0, critical.half_width) if caution else 0.0
    return np.asarray(critical.value - caution * width)


FIGURES = (
    *("range_z", "range_x", "depth", "depth_stiff", "resolution_z", "resolution_x", "strain", "critical"),
    *("stable_to", "first_mode", "saturation", "decoding", "drift", "hysteresis", "distinct", "clearance"),
    *("outer_size", "height", "wall", "reach", "reach_x", "bandwidth", "ambient", "warming", "room", "magnets"),
    *("neighbours_ignoring", "neighbours_subtracting", "neighbours_jointly"),
)
WORST = (
    *("strain", "resolution_z", "resolution_x", "saturation", "decoding", "drift", "distinct"),
    *("ambient", "warming"),
)
"""Figures of single poses."""


@dataclass(frozen=True, slots=True, eq=False)
class _Rated:
    sensors: Sensors
    pressed: Curves
    known: Array
    stable: Array
    units: Array
    share: Array
    needed: Requirements
    loads: Array
    load: Ints
    angle: Array
    caution: float
    brief: bool

    def take(self, rows: Ints) -> _Rated:
        """Return some of the sensors."""
        parts = {name: getattr(self, name)[rows] for name in ("known", "stable", "units", "share")}
        return replace(self, sensors=self.sensors.take(rows), pressed=self.pressed.take(rows), **parts)

    def top_force(self, soft: Curves, depth: Array) -> Array:
        """Return the normal forces of presses to the largest depths over D (n,), at the least E, N."""
        force = soft.pressed(np.maximum(depth, surrogate_range.SHALLOWEST)[:, None])[0][:, 0, 0]
        return np.asarray(force * self.units[:, 0])

    def of_presses(self) -> dict[str, Array]:
        """Return what presses alone say of strain, saturation, depth and hysteresis."""
        s, strain, saturation, depths = self.sensors, [], [], []
        z = self.share[:, :1] * self.loads[self.loads[:, 1] == 0, 0]
        for k, way in enumerate((1, -1)):
            curve = self.pressed.softer(way * self.caution, sheared=False)
            depth = curve.depth_of_force(z / self.units[:, [k]])
            press, _ = curve.pressed(depth)
            shift = press[..., 1:2] * s.D[:, None, None] * [0.0, 0.0, -1.0]
            axis = np.broadcast_to([0.0, 0.0, 1.0], shift.shape)
            field, _, _ = readings_of_sensors(
                s.points, s.normals, s.owners, s.magnet, _filled(shift), axis, slopes=False
            )
            saturation.append(np.where(np.isnan(depth), np.nan, self._saturation(field)).min(axis=1))
            strain.append(press[..., 2].max(axis=1))
            depths.append(depth[:, -1])
        found = {"strain": np.max(strain, axis=0), "saturation": np.min(saturation, axis=0)}
        return found | {"depth": depths[0], "depth_stiff": depths[1], "hysteresis": self._hysteresis(depths[0])}

    def fill(self, result: Performance, rows: Ints, beams: RatedBeams, ask: Array | None) -> None:
        """Write the figures of these rows."""
        sheared = self.needed.force_x is not None
        curve = self._with_shears(beams, ask, sheared)
        corners = [curve.softer(way * self.caution, sheared=sheared) for way in (1, -1)]
        states = [self._states(corner, k, 1.0) for k, corner in enumerate(corners)]
        top = int(np.flatnonzero(self.loads[:, 1] == 0)[-1])
        soft, stiff = (state.depth[:, top] for state in states)
        values = {"depth": soft, "depth_stiff": stiff, "hysteresis": self._hysteresis(soft)}
        poses = self._poses(states)
        field, slopes, lift = self._readings(poses)
        found = {"strain": (self._at(states, "strain"), 1), "saturation": (self._saturation(field), -1)}
        resolved, neighbours = self._resolutions(states, poses, slopes, field, lift)
        found |= resolved
        known = {}
        for name, (table, way) in found.items():
            values[name] = self._over_corners(table, way)
            known[name] = self._over_corners(np.where(np.isnan(table), -way * np.inf, table), way)
            at = np.argmax(way * np.where(np.isnan(table), -np.inf * way, table), axis=1)
            result.worst[name][rows] = np.where(np.isnan(values[name]), -1, at)
        if self.needed.unique_decoding:
            values["distinct"], result.worst["distinct"][rows] = self._distinct(field)
        values |= {"clearance": self._clearance(states[0]), "reach_x": self._reach_x(corners, states)}
        values |= neighbours | {"room": self._room(states[0])}
        for name, value in values.items():
            result.values[name][rows] = value
        z, x = self._forces(1.0)
        result.depth[rows], result.shear[rows] = (self._at(states, name) for name in ("depth", "shear"))
        for k, part in enumerate((z, x)):
            result.loads[rows, :, k] = np.tile(part[:, self.load], 2)
        result.loads[rows, :, 2] = np.tile(self.angle, 2)
        wanted = np.ones(len(rows), dtype=np.bool_)
        if self.brief:
            met = margins({name: value[rows] for name, value in result.values.items()}, self.needed)
            wanted = np.min(list(met.values()), axis=0) >= 0
        # how far finite elements are asked does not end where one load has no answer, a range does
        factor, deep = self._range(corners[0], known["strain"], known["saturation"], wanted)
        reached = np.where(np.isnan(values["strain"]), np.nan, factor)
        result.values["range_z"][rows] = reached * self.share[:, 0] * self.needed.force_z
        if sheared:
            result.values["range_x"][rows] = reached * self.share[:, 1] * (self.needed.force_x or 0.0)
        if not self.brief:
            result.ask[rows] = self._ask(corners, states, factor, deep, sheared)

    def _over_corners(self, table: Array, way: int) -> Array:
        """Return the worst value of poses (n, p) of both corners, the largest if `way` is 1 and the least if -1.

        Values that are improved are those of the better corner: a made sensor has one E, and its corners differ by
        the source's intervals alone.
        """
        signed = (way * table).reshape(len(table), 2, -1).max(axis=2)
        return np.asarray(way * (signed.max(axis=1) if self.caution >= 0 else signed.min(axis=1)))

    def _at(self, states: Sequence[States], name: str) -> Array:
        return np.concatenate([getattr(each, name)[:, self.load] for each in states], axis=1)

    def _forces(self, factor: Array | float) -> tuple[Array, Array]:
        """Return normal force and force along the plate of all loads times a factor (n,), shape (n, k), N."""
        scale = np.asarray(factor)[..., None] * self.share
        z, x, top, least = *self.loads.T, self.needed.force_z, self.needed.least_press
        # with shares of the forces, presses with a force along the plate still lie between the least and the whole
        along = np.where(x > 0, (z - least) / max(top - least, 1e-9), 0.0)
        under = least * scale[:, 1:] + along * (top * scale[:, :1] - least * scale[:, 1:])
        return np.where(x > 0, under, scale[:, :1] * z), scale[:, 1:] * x

    def _states(self, curve: Curves, corner: int, factor: Array | float) -> States:
        z, x = self._forces(factor)
        unit = self.units[:, [corner]]
        return curve.states(z / unit, x / unit)

    def _with_shears(self, beams: RatedBeams, ask: Array | None, sheared: bool) -> Curves:
        if ask is not None:
            return with_shears(self.pressed, beams, ask[:, 1], ask[:, 2], ask[:, 3:], (0.5, 1.0))
        stiff = self.pressed.softer(-abs(self.caution))
        first = int(np.flatnonzero(self.loads[:, 1] > 0)[0]) if sheared else 0
        z, _ = self._forces(1.0)
        light = stiff.depth_of_force(z[:, [first]] / self.units[:, 1:])[:, 0]
        # a small shear raises the force of a press a little, so that the same force is met by a shallower one
        low = np.fmax(light / DEEPER, surrogate_range.SHALLOWEST_SHEAR)
        # the surrogate knows shears no deeper than presses are surely stable
        high = np.fmin(self.known, np.nan_to_num(beams.stable_to(1.0), nan=0.0))
        high = np.maximum(high, 1.02 * surrogate_range.SHALLOWEST_SHEAR)
        far = np.repeat(surrogate_range.farthest(self.sensors.beam[:, 0])[:, None], SHEARED_DEPTHS, axis=1)
        return with_shears(self.pressed, beams, np.minimum(low, high / 1.02), high, far, surrogate_range.SHEAR_NODES)

    def _poses(self, states: Sequence[States]) -> Poses:
        """Return the poses of the magnets, and their motions along the depth, the shear and across it."""
        s, D = self.sensors, self.sensors.D[:, None]
        angle = np.tile(self.angle, len(states))
        e = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        across = np.stack([-e[:, 1], e[:, 0], e[:, 2]], axis=1)
        up = np.array([0.0, 0.0, 1.0])
        plane, by_depth, by_shear, shear = (self._at(states, n) for n in ("plane", "by_depth", "by_shear", "shear"))
        u, w, t = (plane[..., k, None] for k in range(3))
        shift = D[..., None] * (u * e - w * up)
        sin, cos = np.sin(t), np.cos(t)
        axis = sin * e + cos * up
        ratio = np.where(shear[..., None] > 0, plane / np.where(shear > 0, shear, 1.0)[..., None], by_shear)
        sinc = np.sinc(t / np.pi)
        moves = [slope[..., :1] * e - slope[..., 1:2] * up for slope in (by_depth, by_shear)]
        moves.append(ratio[..., :1] * across)
        # the angular velocity of a lean towards e is along across; one across turns the lean, which is axis x d(axis)
        turns = [slope[..., 2:3] * across for slope in (by_depth, by_shear)]
        turns.append(ratio[..., 2:3] * sinc * np.cross(axis, across))
        if s.turn is not None and s.offset is not None:
            lean = t * across
            offset = rotated(s.offset[:, None], lean[..., :2])
            shift = shift + offset
            axis = rotated(up, lean[..., :2] + s.turn[:, None])
            moves = [move + np.cross(turn, offset) / D[..., None] for move, turn in zip(moves, turns, strict=True)]
        return Poses(shift, axis, np.stack(moves, axis=-1), np.stack(turns, axis=-1))

    def _readings(self, poses: Poses, *, slopes: bool = True) -> tuple[Array, Array, Array]:
        """Return the readings in poses over the remanence, shape (n, p, 3), and their slopes.

        The slopes along the depth, the shear and across it have the shape (n, p, 3, 3), in 1/mm, those by a lift of
        the magnet (n, p, 3).
        """
        s, shift, axis = self.sensors, poses.shift, poses.axis
        field, by_shift, by_turn = readings_of_sensors(
            s.points, s.normals, s.owners, s.magnet, _filled(shift), _filled(axis), slopes=slopes
        )
        field = np.where(np.isnan(shift[..., :1]), np.nan, field)
        if not slopes:
            return field, by_shift, by_shift
        J = by_shift @ poses.moves + by_turn @ poses.turns / s.D[:, None, None, None]
        return field, np.where(np.isnan(shift[..., :1, None]), np.nan, J), by_shift[..., 2]

    def _rails(self, field: Array, end: int) -> Array:
        """Return the distances of the outputs from their rails, over those in zero field."""
        s = self.sensors
        out = s.gain[:, None] * field * s.remanence[:, end, None, None]
        return np.minimum(1 - out / (s.high - s.null)[:, None], 1 + out / (s.null - s.low)[:, None])

    def _saturation(self, field: Array) -> Array:
        return np.asarray(self._rails(field, 1).min(axis=2))

    def _hysteresis(self, depth: Array) -> Array:
        """Return the hysteresis of presses to depths over D, shape (n,); NaN where the loss factor is unknown."""
        frequency = (self.needed.speed or np.nan) / (2 * depth * self.sensors.D)
        loss, low, high = self.sensors.loss.T
        known = (frequency >= low) & (frequency <= high)
        return np.where(known, PRESS_GAP * SPRING_GAP * loss, np.nan)

    def _resolutions(
        self, states: Sequence[States], poses: Poses, slopes: Array, field: Array, lift: Array
    ) -> tuple[dict[str, tuple[Array, int]], dict[str, Array]]:
        """Return standard deviations and drifts of the decoded forces, errors by field and temperature where they are
        required, and scaled determinants, (n, p), and their worse end; and errors by neighbours where required, (n,).

        A saturated reading does not change: no force is decoded.
        """
        s = self.sensors
        J = np.where(self._rails(field, 0)[..., None] > 0, slopes, 0.0) * s.remanence[:, 0, None, None, None]
        B, noises = field * s.remanence[:, 0, None, None], s.noise[:, None]
        lift, weight = lift * s.remanence[:, 0, None, None], np.ones_like(s.noise)[:, None]
        if J.shape[2] > 3:
            # least squares of readings with equal noise; the weight of an element that a sensor has not is 0
            weight = (s.noise[:, :1] / s.noise)[:, None]
            J, B, lift, noises = J * weight[..., None], B * weight, lift * weight, noises[..., :1]
            if self.needed.reject_ambient:
                J = self._free() @ J
            across = np.swapaxes(J, 2, 3)
            inverse, square = adjugate(across @ J)
            inverse, det = inverse @ across, np.sqrt(np.maximum(square, 0.0))
        else:
            inverse, det = adjugate(J)
            square = det
        length = np.linalg.norm(J, axis=2).prod(axis=-1)
        scaled = np.where(length > 0, det / np.where(length > 0, length, 1.0), det * 0)
        turned = scaled * np.sign(np.median(scaled, axis=1, keepdims=True))
        by_depth, by_shear, plane, shear = (self._at(states, n) for n in ("by_depth", "by_shear", "plane", "shear"))
        p = len(self.load)
        unit = np.repeat(self.units, p, axis=1) / s.D[:, None]
        aside = np.where(shear > 0, plane[..., 3] / np.where(shear > 0, shear, 1.0), by_shear[..., 3])

        # what the gain makes up for by its sign does not count
        of_drift = np.max([np.abs(end + s.drift) for end in NEODYMIUM_DRIFT], axis=0)[:, None]
        unknown, known = np.isnan(det), np.abs(scaled) > SINGULAR

        normals = s.normals[:, np.flatnonzero(np.diff(s.owners, prepend=-1))] * np.swapaxes(weight, 1, 2)

        surroundings = self.needed.ambient_error is not None or self.needed.temperature_error is not None

        def deviations(row: Sequence[Array]) -> list[Array]:
            """Return the deviations of a force with these slopes along depth, shear and across, N, and its changes by
            a share of the readings, N; where surroundings count by a lift of the magnet, N/mm, and by fields along x,
            y and z, N/T, too; each (n, p)."""
            vector = np.stack(np.broadcast_arrays(*row), axis=-1)
            parts = (vector[..., None] * inverse).sum(axis=-2)
            sizes = [np.linalg.norm(parts * noises, axis=-1), np.abs((parts * B).sum(axis=-1))]
            if surroundings:
                by_field = (parts[..., None, :] @ normals[:, None])[..., 0, :]
                sizes += [np.abs((parts * lift).sum(axis=-1)), *np.moveaxis(by_field, -1, 0)]
            with np.errstate(divide="ignore", invalid="ignore"):
                return [
                    np.where(unknown, np.nan, np.where(known, unit * size / np.abs(square), np.inf)) for size in sizes
                ]

        angle = np.tile(self.angle, 2)
        cos, sin = np.cos(angle), np.sin(angle)
        rows = (
            [cos * by_depth[..., 3], cos * by_shear[..., 3], -sin * aside],
            [sin * by_depth[..., 3], sin * by_shear[..., 3], cos * aside],
            [by_depth[..., 4], by_shear[..., 4], 0 * aside],
        )
        noise, change, *more = (np.array(each) for each in zip(*map(deviations, rows), strict=True))
        force_x = np.nan if self.needed.force_x is None else self.needed.force_x
        full_z, full_x = (self.share * [self.needed.force_z, force_x]).T[..., None]
        drift = change * of_drift / np.array([full_x, full_x, full_z])
        drift = drift[2] if self.needed.force_x is None else np.maximum.reduce(drift)
        found = {"resolution_z": (noise[2], 1), "resolution_x": (np.maximum(*noise[:2]), 1), "decoding": (turned, -1)}
        found["drift"] = drift, 1
        if self.needed.ambient_error is not None:
            by_field = _largest_singular_value(np.stack(more[1:], axis=-1).transpose(1, 2, 0, 3))
            rejected = np.where(np.isfinite(by_field), 0.0, np.nan)
            found["ambient"] = np.where(self._in_common[:, None], rejected, by_field), 1
        if self.needed.temperature_error is not None:
            forces = [np.tile(each[:, self.load], 2) for each in self._forces(1.0)]
            size = np.abs(np.array([cos * forces[1], sin * forces[1], forces[0]]))
            rise = SILICONE_EXPANSION * (s.L - s.D / 2)[:, None]
            found["warming"] = np.linalg.norm(change * of_drift + size * STIFFER + more[0] * rise, axis=0), 1
        if self.needed.cross_talk is None:
            return found, {}
        # of the least E, at which strokes are largest
        with np.errstate(divide="ignore", invalid="ignore"):
            by_reading = np.where(known[..., None, None], inverse / square[..., None, None], np.nan)
        by_state = np.stack([np.stack(np.broadcast_arrays(*row), axis=-1) for row in rows], axis=-2)
        by_reading, by_state = by_reading * weight[:, :, None], by_state * unit[..., None, None]
        return found, estimated(self.sensors, poses.first(p), by_reading[:, :p], by_state[:, :p], self.needed)

    def _room(self, soft: States) -> Array:
        """Return the pitch of arrays from which on neighbours under all loads do not touch either, mm.

        A pressed beam bulges as a column of constant volume, and the tips of two lean to each other.
        """
        s = self.sensors
        depth, shear = (np.nan_to_num(each).max(axis=1) for each in (soft.depth, soft.shear))
        bulging = 1 / np.sqrt(1 - np.minimum(depth / (s.L / s.D - 0.5), 0.9))
        return np.asarray(np.maximum(s.room, s.D * (bulging + 2 * shear)))

    @property
    def _in_common(self) -> NDArray[np.bool_]:
        """Whether the beams of an array reject a field that is the same for all; it costs the less the more beams."""
        needed = self.needed
        enough = np.isfinite(self.sensors.noise).sum(axis=1) >= 3 * needed.fewest_chips
        return np.asarray(enough & (needed.reject_ambient and needed.fewest_chips < LEAST_CHIPS))

    def _free(self) -> Array:
        """Return (n, 1, k, k) what takes off weighted readings what a uniform field explains; it changes nothing of
        sensors of fewer than nine readings, nor of an array whose beams have the field in common."""
        s = self.sensors
        weight = np.nan_to_num(s.noise[:, :1] / s.noise)
        free = np.tile(np.eye(weight.shape[1]), (len(s), 1, 1))
        rows = np.flatnonzero(((weight > 0).sum(axis=1) >= FEWEST) & ~self._in_common)
        directions = s.normals[rows][:, np.flatnonzero(np.diff(s.owners, prepend=-1))] * weight[rows][..., None]
        free[rows] -= directions @ np.linalg.pinv(directions)
        return free[:, None]

    def _distinct(self, field: Array) -> tuple[Array, Ints]:
        """Return the least distance of the readings of two loads of one sensor, and one of the two poses."""
        s, p = self.sensors, len(self.load)
        values = field * (s.remanence[:, 0, None, None] / s.noise[:, None])
        if self.needed.reject_ambient:
            values = (self._free() @ values[..., None])[..., 0]
        values = values.reshape(len(field), 2, p, -1)
        seen = np.arange(p)
        if s.mirrored:
            # the other half of the directions: x and y change places
            off = np.flatnonzero(np.abs(np.sin(self.angle - np.pi / 4)) > 1e-9)
            off = off[self.loads[self.load[off], 1] > 0]
            values, seen = (
                np.concatenate([values, values[:, :, off][..., [0, 2, 1]]], axis=2),
                np.concatenate([seen, off]),
            )
        square = np.zeros((*values.shape[:3], values.shape[2]))
        for k in range(values.shape[3]):
            square += (values[..., :, None, k] - values[..., None, :, k]) ** 2
        same = np.arange(values.shape[2])
        square[..., same, same] = np.inf
        flat = square.reshape(len(field), -1)
        at = flat.argmin(axis=1)
        corner, first = np.divmod(at // len(same), len(same))
        least = np.sqrt(self._over_corners(flat, -1))
        return least, np.where(np.isnan(least), -1, corner * p + seen[first])

    def _clearance(self, state: States) -> Array:
        """Return the least gap of S2 from bulging wall and pressed plate less what is needed, mm; inf of a chip.

        S3 mirrors S2, and so do the directions.
        """
        s, gaps = self.sensors, np.full(len(self.sensors), np.inf)
        rows = np.flatnonzero(~np.isnan(s.beside[:, 0]))
        if len(rows):
            D, H = s.D[rows, None], (s.L - s.D / 2)[rows, None]
            near = np.cos(self.angle) > 0.5
            at = state.plane[rows][:, self.load[near]]
            u, angle = at[..., 0] * D, self.angle[near]
            centre = np.stack([u * np.cos(angle), u * np.sin(angle), H - at[..., 1] * D], axis=-1)
            face, level = s.beside[rows].T[..., None]
            point = np.stack([face + SS495A.depth, 0 * face, level], axis=-1)
            gap = wall_distance(D / 2, H, point, centre).min(axis=1) - SS495A.depth
            above = s.L[rows] - np.max(state.depth[rows], axis=1) * s.D[rows] - level[:, 0] - SS495A.height / 2
            gaps[rows] = np.minimum(gap, above) - LEAST_GAP
        return gaps

    def _reach_x(self, corners: Sequence[Curves], states: Sequence[States]) -> Array:
        """Return the largest force along the plate under the required presses, over the required one."""
        aside = self.loads[:, 1] > 0
        if not aside.any():
            return np.full(len(self.sensors), np.nan)
        z, x = self._forces(1.0)
        shares = []
        for k, (curve, state) in enumerate(zip(corners, states, strict=True)):
            unit = self.units[:, [k]]
            _, force = curve.reach(curve.depth_of_force(z[:, aside] / unit))
            share = force * unit / x[:, aside]
            # a load that Newton's method has not reached is not reached, whatever the curve under the press says
            shares.append(np.where(np.isnan(state.depth[:, aside]), np.minimum(share, 0.999), np.maximum(share, 1.0)))
        return self._over_corners(np.concatenate(shares, axis=1), -1)

    def _range(
        self, soft: Curves, strain: Array, saturation: Array, wanted: NDArray[np.bool_]
    ) -> tuple[Array, Array]:
        """Return the largest factor on all loads that keeps the bounds, and the depth there.

        It is 0 if 1 does not keep them, and 1 at most where it is not `wanted`. The largest strain and the least
        saturation are those of the loads that have an answer, under all loads of a factor of 1.
        """
        needed = self.needed
        stable = np.minimum(self.known, self.stable / needed.stability_margin)
        top = self.top_force(soft, stable)
        most = np.minimum(top / (self.share[:, 0] * needed.force_z), needed.range_cap or np.inf)
        factor = np.zeros(len(strain))
        good = (strain <= (needed.largest_strain or np.inf)) & ~(needed.no_saturation & (saturation < 0))
        factor[good & ~wanted] = 1.0
        rows = np.flatnonzero(good & wanted & (most >= 1))
        deep = np.full(len(most), np.nan)
        if not len(rows):
            return factor, deep
        # of the presses alone, the largest one comes first to a bound
        ends = self.loads[int(np.flatnonzero(self.loads[:, 1] == 0)[-1]) :]
        load, angle = _poses(ends, self.sensors)
        part = replace(self.take(rows), loads=ends, load=load, angle=angle)
        curve, top_factor = soft.take(rows), most[rows]
        low, low_slack = np.ones(len(rows)), np.full(len(rows), np.nan)
        high, high_slack = np.full(len(rows), np.nan), np.full(len(rows), np.nan)

        def narrow(at: Ints, trial: Array) -> None:
            slack, _ = part.take(at)._slack(curve.take(at), trial)
            good = slack >= 0
            low[at], low_slack[at] = np.where(good, trial, low[at]), np.where(good, slack, low_slack[at])
            high[at], high_slack[at] = np.where(good, high[at], trial), np.where(good, high_slack[at], slack)

        for share in SCAN:
            left = np.flatnonzero(np.isnan(high))
            if len(left):
                narrow(left, 1 + share * (top_factor[left] - 1))
        open_ = np.flatnonzero(~np.isnan(high))
        for _ in range(REFINED if len(open_) else 0):
            a, b, fa, fb = low[open_], high[open_], low_slack[open_], high_slack[open_]
            known = np.isfinite(fa) & np.isfinite(fb) & (fa > fb)
            at = np.where(known, np.clip(fa / np.where(known, fa - fb, 1.0), 0.1, 0.9), 0.5)
            narrow(open_, a + at * (b - a))
        # between the ends that are left the slack is nearly linear; without a slack at the upper one nothing is known
        linear = np.isfinite(high_slack) & np.isfinite(high) & (low_slack > high_slack)
        low = np.where(linear, low + (high - low) * low_slack / np.where(linear, low_slack - high_slack, 1.0), low)
        factor[rows] = low
        if not self.brief:
            deep[rows] = part._slack(curve, low)[1]
        return factor, deep

    def _slack(self, curve: Curves, factor: Array) -> tuple[Array, Array]:
        """Return the least margin of strain and saturation under all loads times a factor, and the largest depth."""
        state = self._states(curve, 0, factor)
        slack = 1 - state.strain / (self.needed.largest_strain or np.inf)
        slack = slack.min(axis=1)
        if self.needed.no_saturation:
            field, _, _ = self._readings(self._poses([state]), slopes=False)
            slack = np.minimum(slack, self._saturation(field).min(axis=1))
        depth = state.depth.max(axis=1)
        return np.where(depth * self.needed.stability_margin <= self.stable * (1 + 1e-9), slack, np.nan), depth

    def _ask(
        self, corners: Sequence[Curves], states: Sequence[States], factor: Array, deep: Array, sheared: bool
    ) -> Array:
        deepest = surrogate_range.deepest(*self.sensors.beam[:, :3].T)
        end = np.fmax(deep, states[0].depth.max(axis=1))
        # a load that is not reached is asked as far as the surrogate goes
        press = np.fmin(DEEPER * end, deepest)
        aside = self.loads[:, 1] > 0 if sheared else np.ones(len(self.loads), dtype=np.bool_)
        low = np.fmax(states[1].depth[:, aside].min(axis=1) / DEEPER, surrogate_range.SHALLOWEST_SHEAR)
        if sheared:
            z, _ = self._forces(1.0)
            light = corners[1].depth_of_force(z[:, aside][:, :1] / self.units[:, 1:])[:, 0]
            low = np.fmax(np.fmin(states[1].depth[:, aside].min(axis=1), light) / DEEPER, LEAST_ASKED)
        high = np.maximum(press, 1.02 * low)
        if not sheared:
            return np.column_stack([press, low, high, np.full((len(low), SOLVED_DEPTHS), NO_SHEAR)])
        depth = depths_between(low, high, SOLVED_DEPTHS)
        force = np.fmax(factor, 1.0) * self.share[:, 1] * (self.needed.force_x or 0.0) / self.units[:, 0]
        soft = corners[0]
        inside = np.clip(depth, soft.low, soft.high)
        shear = soft.shears_of(inside, np.repeat(force[:, None], SOLVED_DEPTHS, axis=1))
        most = surrogate_range.farthest(self.sensors.beam[:, 0])[:, None]
        return np.column_stack([press, low, high, np.fmax(np.fmin(DEEPER * shear, most), 0.01)])


def _largest_singular_value(matrix: Array) -> Array:
    """Return the largest singular values of matrices (..., 3, 3); NaN and infinite ones stay."""
    known = np.asarray(np.isfinite(matrix).all(axis=(-2, -1)))
    square = np.where(known[..., None, None], matrix, 0.0)
    largest = np.sqrt(np.maximum(np.linalg.eigvalsh(square @ np.swapaxes(square, -1, -2))[..., -1], 0.0))
    return np.where(known, largest, np.where(np.isnan(matrix).any(axis=(-2, -1)), np.nan, np.inf))


def adjugate(matrix: Array) -> tuple[Array, Array]:
    """Return the adjugates of matrices (..., 3, 3), which are the inverses times the determinants, and these."""
    rows = [matrix[..., k, :] for k in range(3)]
    result = np.stack([np.cross(rows[k - 2], rows[k - 1]) for k in range(3)], axis=-1)
    return result, (rows[0] * result[..., 0]).sum(axis=-1)


def _filled(values: Array) -> Array:
    """Return values with 1 in place of NaN, for compiled loops."""
    return np.where(np.isnan(values), 1.0, values)


def missed(margins: Mapping[str, Array]) -> Array:
    """Return by how much requirements are missed, shape (n,), as a sum of logarithms: one that is missed by far must
    not hide the others."""
    return np.asarray(np.sum([np.log1p(np.maximum(-margin, 0.0)) for margin in margins.values()], axis=0))


def margins(values: Mapping[str, Array], needed: Requirements) -> dict[str, Array]:
    """Return the signed margins of the requirements, relative to their bounds; negative where one is missed."""
    signed = {each.name: each.margin_of(values, needed, bound) for each, bound in needed.criteria()}
    # a large one would hide the others; what is known is not as bad as what is not
    return {n: np.where(np.isnan(v), LEAST, np.clip(v, 0.999 * LEAST, MOST)) for n, v in signed.items()}
