"""Loads at which errors of a disturbed sensor are taken, and what a single one, or an array, reads and tells there.

Rows of readings are those of all beams, beam by beam. In a frame of an array each beam has another load of the range:
the beams go through them one after the other, so that each has all of them. An iron object in front of the tips is
pressed by each of them to its own depth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from analytic import parts
from analytic.array_stream import ArrayStream
from analytic.beam_arrays import of_array, readings_of_array, slopes_of_array, standing
from analytic.decode import Decoder, decode, decoder
from analytic.hall import means_over_plates, plates_of
from analytic.inverse import response_surface
from analytic.inverse.forward_model import Forward, model, readings_at, rotation
from analytic.surroundings import IronPiece, IronPlane, Poses, Surroundings
from geometry.array_design import ArrayDesign
from geometry.arrays import Array
from geometry.design import BadInput

if TYPE_CHECKING:
    from analytic.decode import Status
    from studies.parts.requirements import Requirements

USUAL_DEPTH, USUAL_SHEAR = 3 / 8, 1 / 8
"""Depth and shear over D whose forces are the range of a design that states none."""
WITHIN = 0.95
"""Largest depth of the usual loads over the deepest one that the mechanics know."""
TURNS = (2 * np.pi * np.arange(4) / 4).tolist()
"""Directions of a force along the plate."""


@dataclass(frozen=True, slots=True, eq=False)
class Loads:
    """The loads of a single sensor, rest first: forces (n, 3), N, poses under them, and what reads these.

    left_out : number of loads of the range that the mechanics do not reach.
    """

    force: Array
    poses: Poses
    sensor: Forward
    left_out: int

    @property
    def beams(self) -> int:
        return 1

    @property
    def of_one(self) -> Poses:
        """Poses of one beam under all loads."""
        return self.poses

    def readings(self, shift: Array) -> Array:
        """Return the readings (n, k), T, of the elements at shifts (3, n), mm; NaN where a shift is."""
        found, known = np.full((shift.shape[1], len(self.sensor.elements)), np.nan), np.isfinite(shift).all(axis=0)
        found[known] = readings_at(self.sensor, shift[:, known]).T
        return found

    def change(self, kind: Surroundings) -> Array:
        """Return what surroundings add to the readings (n, k), T."""
        points, owners = plates_of(self.sensor.elements)
        return means_over_plates(kind(points, self.poses).reshape(-1, 3), self.sensor.elements, owners)

    def decode(self, coder: Decoder, readings: Array) -> tuple[Array, Sequence[Status]]:
        """Return forces (m, 3), N, and statuses of rows of readings (m, k), T."""
        found = decode(coder, readings)
        return found.force, found.status

    def price(self, coder: Decoder) -> float:
        """Return by which factor a rejected field makes the noise of the force larger: the median over loads and
        axes; NaN without noise."""
        plain, readings = decoder(coder.forward.design, coder.mechanics), self.readings(self.poses.shift.T)
        return _median(decode(coder, readings).noise_N / decode(plain, readings).noise_N)

    def widened(self, factor: float) -> Loads:
        """Return loads whose elements stand on a base that has grown."""
        return replace(self, sensor=_grown(self.sensor, factor))

    @property
    def warnings(self) -> list[str]:
        """A sentence where loads are left out."""
        said = f"{self.left_out} loads of the range lie beyond the mechanics: their errors are not known"
        return [said] * bool(self.left_out)


def _median(ratio: Array) -> float:
    return float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else math.nan


def _grown(sensor: Forward, factor: float) -> Forward:
    elements = [
        replace(e, position=(e.position[0] * factor, e.position[1] * factor, e.position[2] * factor))
        for e in sensor.elements
    ]
    return model(sensor.design, sensor.tau, elements=elements)


@dataclass(frozen=True, slots=True, eq=False)
class ArrayLoads(Loads):
    """The loads of an array: forces (f n, 3), N, and poses, frame by frame and beam by beam; the first is at rest.

    array : where the beams stand. shared : poses of one beam under all loads.
    ambient : whether a uniform field, the same for all beams, is decoded along.
    """

    array: ArrayDesign
    shared: Poses
    ambient: bool

    @property
    def beams(self) -> int:
        return len(self.array)

    @property
    def of_one(self) -> Poses:
        return self.shared

    def readings(self, shift: Array) -> Array:
        """Return the readings (f, n k), T, of all elements at shifts (3, f n), mm; NaN where a shift is."""
        frames = shift.T.reshape(-1, self.beams, 3)
        read = readings_of_array(of_array(self.sensor, self.array), np.nan_to_num(frames))
        read[np.isnan(frames).any(axis=2)] = np.nan
        return read.reshape(len(frames), -1)

    def change(self, kind: Surroundings) -> Array:
        """Return what surroundings add to the readings (f, n k), T; iron answers to all magnets."""
        elements = parts.of_design(self.array)
        points, owners = plates_of(elements)
        rows = self.poses.shift, self.poses.tilt, self.poses.depth
        poses = [Poses(*(each[k :: self.beams] for each in rows)) for k in range(self.beams)]
        if not isinstance(kind, IronPlane | IronPiece):
            fields = kind(points, poses[0])
        else:
            places = np.column_stack([self.array.places, np.zeros(self.beams)])
            fields = sum(
                pole * kind.seen_from(place)(points - place, own)
                for pole, place, own in zip(self.array.poles, places, poses, strict=True)
            )
        return means_over_plates(fields.reshape(-1, 3), elements, owners)

    def decode(self, coder: Decoder, readings: Array) -> tuple[Array, Sequence[Status]]:
        """Return forces (m n, 3), N, and statuses of rows of readings (m, n k), T, decoded jointly."""
        stream = ArrayStream(coder, standing(coder.forward, self.array, ambient=self.ambient))
        found = [stream.step(row.reshape(self.beams, -1)) for row in readings]
        return np.concatenate([frame.force for frame in found]), [word for frame in found for word in frame.status]

    def price(self, coder: Decoder) -> float:
        """Return the factor of `Loads.price` for forces that are decoded jointly."""
        return math.sqrt(_median(self.noise(coder, ambient=True) / self.noise(coder, ambient=False)))

    def noise(self, coder: Decoder, *, ambient: bool) -> Array:
        """Return variances (f n, 3), N^2, of decoded forces by the readings' noise, to first order."""
        if not coder.sigma.all():
            return np.full_like(self.force, np.nan)
        beams = replace(of_array(self.sensor, self.array), ambient=ambient)
        _, slopes = slopes_of_array(beams, self.poses.shift.reshape(-1, self.beams, 3))
        f, n, k, *_ = slopes.shape
        unknown = [
            slopes.reshape(f, n, k, -1),
            *(np.broadcast_to(N, (f, n, k, 3)) for N in [beams.directions] * ambient),
        ]
        told = np.concatenate(unknown, axis=-1)
        told = (told / coder.sigma[:, None]).reshape(f, n * k, -1)
        of_poses = np.linalg.inv(told.swapaxes(1, 2) @ told)[:, : 3 * n, : 3 * n].reshape(f, n, 3, n, 3)
        each = np.einsum("fiaib->fiab", of_poses).reshape(-1, 3, 3)
        law = coder.mechanics
        assert law is not None
        by_shift = response_surface.forces(law, np.ascontiguousarray(self.poses.shift.T))[1]
        return np.asarray(np.einsum("jim,mjk,kim->mi", by_shift, each, by_shift))

    def widened(self, factor: float) -> Loads:
        """Return loads whose beams and elements stand on a base that has grown."""
        array = replace(self.array, places=factor * self.array.places)
        return replace(self, sensor=_grown(self.sensor, factor), array=array)


def loads_of(
    coder: Decoder,
    needed: Requirements | None,
    array: ArrayDesign | None = None,
    *,
    reject_ambient: bool = False,
) -> tuple[Loads, float, str]:
    """Return the loads, the force of which percentages are, N, and which one it is, in words.

    array : of which the decoder's sensor is one beam; `reject_ambient` is whether it rejects a field in common.
    """
    assert coder.mechanics is not None
    if needed is not None:
        pairs, full, words = needed.loads().tolist(), needed.force_z, "the required press"
    else:
        depth, full, along = _usual_forces(coder)
        pairs = [*([share * full, 0.0] for share in (0.25, 0.5, 1.0)), [full / 2, along], [full, along]]
        words = f"a press of {depth:.3g} mm, for the design states no required one"
    asked = [(0.0, 0.0, 0.0), *((n, t, turn) for n, t in pairs for turn in (TURNS if t else TURNS[:1]))]
    normal, tangential, turn = np.array(asked).T
    shift = shifts_under(coder, normal, tangential, turn)
    known = np.isfinite(shift[2])
    if not known[1:].any():
        raise BadInput(
            f"the mechanics reach no load of the range up to {full:.3g} N: take others by --level, or require less"
        )
    force = np.column_stack([tangential * np.cos(turn), tangential * np.sin(turn), normal])
    loads = Loads(force[known], _poses(coder, shift[:, known]), coder.forward, int((~known).sum()))
    return loads if array is None else _on_array(loads, array, reject_ambient), full, words


def _on_array(loads: Loads, array: ArrayDesign, ambient: bool) -> ArrayLoads:
    """Return the loads on all beams of an array, each with another one in each frame but the first."""
    pressed, n = len(loads.force) - 1, len(array)
    order = np.vstack([np.zeros(n, dtype=int), 1 + np.add.outer(np.arange(pressed), np.arange(n)) % pressed]).ravel()
    one = loads.poses
    poses = Poses(one.shift[order], one.tilt[order], one.depth[order])
    return ArrayLoads(loads.force[order], poses, loads.sensor, loads.left_out, array, one, ambient)


def shifts_under(coder: Decoder, normal: Array, tangential: Array, turn: Array) -> Array:
    """Return the shifts (3, n) of the magnet under forces, the first of which are none; NaN where none is known."""
    law = coder.mechanics
    assert law is not None
    u, w = response_surface.shifts_of_forces(law, coder.low, coder.high, tangential, normal)
    u[0] = w[0] = 0.0
    # rounded, so that a force along an axis has no component of 1e-16 across it
    return np.stack([u * np.round(np.cos(turn), 15), u * np.round(np.sin(turn), 15), w])


def _poses(coder: Decoder, shift: Array) -> Poses:
    law = coder.mechanics
    assert law is not None
    depth = response_surface.force_and_load(law, shift, contact=False)[1][0]
    return Poses(shift.T, rotation(coder.forward.tau, shift).T, np.maximum(depth, 0.0))


def _usual_forces(coder: Decoder) -> tuple[float, float, float]:
    """Return depth, mm, and force, N, of the usual press or of nearly the deepest known one, and the force along the
    plate of the usual shear at it, N."""
    law, D = coder.mechanics, coder.forward.design.D
    assert law is not None
    axes = np.linspace(0, coder.high[0], 81), np.linspace(coder.low[2], 0, 81)
    u, w = (values.ravel() for values in np.meshgrid(*axes))
    force, plate, _ = response_surface.force_and_load(law, np.stack([u, 0 * u, w]), contact=False)
    upright = np.flatnonzero(u == 0)
    # at the end of what is known the least disturbance would leave no force
    deepest = min(USUAL_DEPTH * D, WITHIN * float(np.nanmax(plate[0, upright])))
    press = upright[np.nanargmin(np.abs(plate[0, upright] - deepest))]
    sheared = np.nanargmin(np.hypot(plate[0] - plate[0, press], plate[1] - USUAL_SHEAR * D))
    return float(plate[0, press]), float(force[2, press]), float(abs(force[0, sheared]))
