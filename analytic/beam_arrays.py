"""Arrays of equal beams on one base: the readings of all elements by all magnets, joint decoding, magnets' forces.

Each beam has its own elements below it, those of the design. With the place P_i of beam i, the pole c_j = 1 of beam
j, or -1 where its magnet is cast the other way up, and the shifts s of the magnets, a reading of beam i is

    b_i(s) = sum_j c_j b(s_j; p + P_i - P_j),

where b is the exact field of one magnet along the element at p, its tilt following from its shift as the decoder has
it. Its slopes db_i/ds_j are exact too. What the neighbours add far away is the field of dipoles: the field itself,
which taring removes, falls by (l0/p)^3 with the pitch p, and its change with a shift of the neighbour by (l0/p)^4.

A magnet beyond a `reach` counts as at rest: then the work grows as the number of beams, not as its square, and what
its motion changes is the error.

**Joint decoding** finds the s that have the readings: Gauss and Newton's steps over all beams at once, from poses
decoded one by one (`decoded_alone`), perhaps less what the neighbours add in these (`less_neighbours`). They are
those of `analytic.inverse.joint_poses`.

**Forces.** The faces of a magnet carry the charges +-M, on which the field of all others acts (as in
`analytic.magnet.repulsion`, here for any pose). On beams of stiffness k the magnets at rest shift by u, with
(K - dF/ds) u = F, linear at rest. Where K - dF/ds has an eigenvalue of 0 or less, no rest is stable: neighbours snap
together. Sideways a beam is Timoshenko's cantilever up to the magnet's centre, along z a column. The magnets' torques
are left out. By Earnshaw's theorem dF/ds has no trace: whatever the poles, it softens the beams in some direction.

Lengths in mm, B in T, forces in N, angles in rad.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from analytic import buckling, parts
from analytic.decode import Decoded, Decoder, decode
from analytic.hall import rotated
from analytic.inverse import ambient_field
from analytic.inverse.forward_model import (
    Forward,
    magnets_at,
    model,
    read_poses,
    readings_of_sensors,
    readings_with_slopes,
    rotation,
)
from analytic.inverse.joint_poses import read_placed, read_shifted, solve_frame, stacked
from analytic.inverse.response_surface import forces
from analytic.magnet import MU_0, repulsion
from geometry.array_design import ArrayDesign, grid_array
from geometry.arrays import Array, Ints
from geometry.design import BadInput, Design

PAIRS = 2000
"""Pairs of magnets whose forces are computed at once."""
RADII, ANGLES = 8, 16
"""Gauss points over the radius of a face, and angles: the force is exact to 2e-6 from a gap of two thirds of the
radius on, and to 5e-5 from a third on."""


@dataclass(frozen=True, eq=False)
class BeamArray:
    """Equal beams on one base.

    forward : elements and magnet of each, and the tilt over the shift.
    layout : place of each beam over the pitch, shape (n, 2).
    poles : 1, or -1 for a reversed magnet, shape (n,).
    pitch : distance of the nearest neighbours, mm.
    reach : distance of beams, mm, up to which the motion of a magnet counts at the elements of the other beam.
    made : elements and magnet of each beam, (n,), where they differ as made sensors do; empty where they do not.
    ambient : whether a uniform field, the same for all beams, is unknown beside the poses.
    """

    forward: Forward
    layout: Array
    poles: Array
    pitch: float
    reach: float = math.inf
    made: tuple[Forward, ...] = ()
    ambient: bool = False

    def __len__(self) -> int:
        return len(self.layout)

    @cached_property
    def pairs(self) -> Ints:
        """Beams whose elements read, and whose magnets act, each with itself too: (2, m), the first ascending."""
        apart = self.pitch * np.linalg.norm(self.layout[:, None] - self.layout, axis=-1)
        return np.array(np.nonzero(apart <= self.reach))

    @cached_property
    def offsets(self) -> Array:
        """Where the first beam of each pair lies from the second one, (m, 3), mm."""
        first, second = self.pairs
        flat = self.pitch * (self.layout[first] - self.layout[second])
        return np.column_stack([flat, np.zeros(len(flat))])

    @cached_property
    def far(self) -> Array:
        """Readings of the magnets beyond the reach, at rest, (n, k), T."""
        rest = np.zeros((1, len(self), 3))
        whole = replace(self, reach=math.inf)
        if self.pairs.shape == whole.pairs.shape:
            return np.zeros((len(self), len(self.forward.elements)))
        return np.asarray(np.subtract(*(_summed(*readings_by_pairs(each, rest)[:2])[0] for each in (whole, self))))

    @cached_property
    def arguments(self) -> tuple[Any, ...]:
        """Pairs, offsets, poles and the forward models of all beams, for compiled functions."""
        return self.pairs, self.offsets, self.poles, stacked(self.made or [self.forward])

    @cached_property
    def directions(self) -> Array:
        """Directions N (n, k, 3) of the elements of all beams, which are empty without an ambient field."""
        normals = ambient_field.directions(self.forward.elements)
        return np.tile(normals, (len(self) if self.ambient else 0, 1, 1))

    def obstructed(self) -> str:
        """Return the name of an element that lies in the beam of a neighbour; "" if none does."""
        design = self.forward.design
        for element in self.forward.elements:
            x, y, z = element.position
            apart = np.hypot(*(self.offsets[:, :2] + [x, y]).T)[np.not_equal(*self.pairs)]
            if 0 < z < design.L and (apart < design.R).any():
                return element.name
        return ""


def _sizes(design: Design, count: int) -> Array:
    return np.tile([design.magnet_diameter, design.magnet_height], (count, 1))


def beam_array(forward: Forward, rows: int, columns: int, pitch: float, polarity: str | Sequence[str]) -> BeamArray:
    """Return a square grid of a forward model; refuse what `geometry.array_design.grid_array` refuses."""
    return of_array(forward, grid_array(forward.design, rows, columns, pitch, polarity))


def of_array(forward: Forward, array: ArrayDesign) -> BeamArray:
    """Return the beams of an array with the forward model of its design."""
    return BeamArray(forward, array.places / array.pitch, array.poles, array.pitch)


# Readings


def readings_by_pairs(array: BeamArray, shift: Array, *, slopes: bool = False) -> tuple[Ints, Array, Array]:
    """Return the pairs (2, m), what each magnet adds to each reading, and its slopes along the magnet's shift.

    shift : of the magnets in f frames, (f, n, 3), mm.

    Returns
    -------
    pairs, values, slopes : (2, m), (f, m, k), T, and (f, m, k, 3), T/mm, empty if they are not wanted.

    Raises
    ------
    BadInput
        A point of an element lies on a magnet's rim.
    """
    frames, m, k = len(shift), array.pairs.shape[1], len(array.forward.elements)
    values, along = np.empty((frames, m, k)), np.empty((frames, m if slopes else 0, k, 3))
    for each, found, found_along in zip(np.ascontiguousarray(shift), values, along, strict=True):
        read_shifted(each, array.arguments, found, found_along)
    _check(values)
    return array.pairs, values, along


def _check(values: Array) -> None:
    if np.isnan(values).any():
        raise BadInput(
            "a point of an element lies on a magnet's rim, where the field is infinite: move the point off"
        )


def readings_of_array(array: BeamArray, shift: Array, *, own: bool = True) -> Array:
    """Return the readings (f, n, k), T, of all beams at shifts (f, n, 3), mm; without `own` what neighbours add."""
    pairs, values, _ = readings_by_pairs(array, shift)
    return array.far + _summed(pairs, values if own else values * (pairs[0] != pairs[1])[:, None])


def _summed(pairs: Ints, values: Array) -> Array:
    """Return the sums (f, n, k) of what the magnets add (f, m, k)."""
    starts = np.flatnonzero(np.diff(pairs[0], prepend=-1))
    return np.asarray(np.add.reduceat(values, starts, axis=1))


def standing(forward: Forward, array: ArrayDesign, *, ambient: bool = False) -> BeamArray:
    """Return the beams of an array, which `check_standing` takes; `ambient` as in `BeamArray`."""
    beams = replace(of_array(forward, array), ambient=ambient)
    check_standing(beams)
    return beams


def check_standing(beams: BeamArray) -> None:
    """Refuse beams that cannot be built or read.

    Raises
    ------
    BadInput
        An element lies inside the beam of a neighbour, or the magnets snap together; or the readings are too few for
        an ambient field.
    """
    check_readings(beams)
    if inside := beams.obstructed():
        raise BadInput(
            f"{inside} lies inside the beam of a neighbour at a pitch of {beams.pitch:g} mm: take a larger pitch"
        )
    if not rest(beams).margin > 0:
        raise BadInput(
            f"the magnets of neighbours snap together at a pitch of {beams.pitch:g} mm: take more than "
            f"{critical_pitch(beams):.4g} mm, another polarity, or stiffer beams"
        )


def check_readings(beams: BeamArray) -> None:
    """Refuse beams with an ambient field whose readings are too few for it."""
    n, count = len(beams), len(beams.forward.elements)
    if beams.ambient and n * count < 3 * n + 3:
        raise BadInput(
            f"an ambient field is three more unknowns beside the {3 * n} of {n} poses, which {n * count} readings do "
            "not tell: take two chips of three axes or more for each beam (chip_count)"
        )


def readings_in_poses(array: ArrayDesign, shift: Array, tilt: Array) -> tuple[Array, Array]:
    """Return the readings (n, k), T, of all beams in given poses, and the part of each beam's own magnet.

    shift, tilt : of the magnets, (n, 3), mm, and rotation vectors (n, 2), rad.
    """
    beams, (n, k) = of_array(model(array.design), array), (len(array), len(parts.of_design(array.design)))
    pairs, values = beams.pairs, np.empty((n * n, k))
    axis = rotated(np.array([0.0, 0.0, 1.0]), tilt)
    read_placed(np.asarray(shift, dtype=float), axis, beams.arguments, values, *np.empty((2, 0, k, 3)))
    _check(values)
    return _summed(pairs, values[None])[0], values[pairs[0] == pairs[1]]


def slopes_of_array(array: BeamArray, shift: Array) -> tuple[Array, Array]:
    """Return the readings (f, n, k), T, and their slopes db_i/ds_j (f, n, k, n, 3), T/mm."""
    pairs, values, slopes = readings_by_pairs(array, shift, slopes=True)
    (f, n, _), k = shift.shape, values.shape[2]
    whole = np.zeros((n, n, f, k, 3))
    whole[tuple(pairs)] = slopes.swapaxes(0, 1)
    return array.far + _summed(pairs, values), whole.transpose(2, 0, 3, 1, 4)


# Decoding


Coders = Decoder | Sequence[Decoder]
"""The decoder of each beam: one of all of them, or each its own."""


def coders_of(coder: Coders, n: int) -> list[Decoder]:
    """Return the decoder of each beam."""
    return [coder] * n if isinstance(coder, Decoder) else list(coder)


def shifts_alone(coder: Coders, array: BeamArray, readings: Array, shift: Array) -> Array:
    """Return the shifts (f, n, 3), mm, that each beam's readings (f, n, k), T, have less what the others add in poses
    (f, n, 3), mm; NaN where there is none.

    Where an ambient field is unknown, readings may contradict each other.
    """
    upright = (readings - readings_of_array(array, shift, own=False)) * array.poles[:, None]
    if array.ambient:
        coder = [_any_misfit(each) for each in coders_of(coder, len(array))]
    if isinstance(coder, Decoder):
        return decode(coder, upright.reshape(-1, readings.shape[2])).shift.reshape(shift.shape)
    return np.stack([decode(each, upright[:, k]).shift for k, each in enumerate(coder)], axis=1)


def _any_misfit(coder: Decoder) -> Decoder:
    return replace(coder, goal=coder.goal._replace(tolerance=np.full_like(coder.goal.tolerance, np.inf)))


def decoded_alone(coder: Decoder, array: BeamArray, readings: Array) -> Decoded:
    """Decode readings (f, n, k), T, each beam for itself; rows of the result are beam by beam of each frame.

    What the neighbours add at rest must be taken off before, as taring does.
    """
    upright = readings * array.poles[:, None]
    return decode(coder, upright.reshape(-1, readings.shape[2]))


def at_rest_where_unknown(found: Decoded, shape: tuple[int, ...]) -> Array:
    """Return the decoded shifts in a shape (f, n, 3), mm; 0 for rows without a pose."""
    return np.nan_to_num(found.shift).reshape(shape)


def less_neighbours(coder: Decoder, array: BeamArray, readings: Array, shift: Array) -> Decoded:
    """Decode readings (f, n, k), T, each beam for itself, less what the others add in poses (f, n, 3), mm."""
    return decoded_alone(coder, array, readings - readings_of_array(array, shift, own=False))


def decoded_jointly(coder: Coders, array: BeamArray, readings: Array, start: Array) -> Array:
    """Return the shifts (f, n, 3), mm, that have the readings (f, n, k), T.

    It is the solution to which the start leads; others with the same readings are not searched. It is NaN in frames
    that do not converge, and for beams whose magnet lies outside the decoder's workspace. Beams with a reading that
    is NaN stay at their start, and are NaN.

    A step is shortened so that no magnet moves more than D/16, as near a fold.

    start : of the iteration, (f, n, 3), mm.
    """
    return decoded_with_readings(coder, array, readings, start)[0]


def decoded_with_readings(
    coder: Coders, array: BeamArray, readings: Array, start: Array
) -> tuple[Array, Array, Array]:
    """Return the shifts of `decoded_jointly`, the readings of all magnets there (f, n, k), T, with an ambient field,
    and of each beam's own.

    Those are NaN in frames that do not converge; magnets outside the workspace count where they were found.
    """
    goals, pairs, (f, n, k) = [each.goal for each in coders_of(coder, len(array))], array.pairs, readings.shape
    squares, N = np.square([goal.weights for goal in goals]), array.directions
    lost = np.asarray(~np.isfinite(readings).all(axis=2))
    near, found = np.where(lost[..., None], 0.0, readings - array.far), np.array(start, dtype=float)
    values, solved, fields = np.empty((f, pairs.shape[1], k)), np.empty(f, dtype=bool), np.zeros((f, n, k))
    for q in range(f):
        reading = N * ~lost[q][:, None, None] if array.ambient else N
        S = np.linalg.pinv(np.einsum("iac,ia,iad->cd", reading, squares, reading)) if array.ambient else np.eye(3)
        scale = (squares, reading, S), goals[0].D
        solved[q] = solve_frame(near[q], lost[q], array.arguments, scale, found[q], values[q])
        if array.ambient:
            misfit = near[q] - _summed(pairs, values[q : q + 1])[0]
            fields[q] = N @ (S @ np.einsum("iac,ia,ia->c", reading, squares, misfit))
    _check(values)
    total, own = array.far + _summed(pairs, values) + fields, values[:, pairs[0] == pairs[1]]
    for some in (found, total, own):
        some[~solved] = np.nan
    low, high = (np.array([getattr(goal, name) for goal in goals]) for name in ("low", "high"))
    inside = ((low <= found) & (found <= high)).all(axis=2) & ~lost
    found[~inside] = np.nan
    return found, total, own


# Reach


def errors_by_reach(coder: Decoder, array: BeamArray, shift: Array) -> tuple[Array, Array]:
    """Return the distances of beams, ascending, mm, and the error of the force for each of them as the reach, N.

    That of the worst beam, at the load where its force depends most on its readings, while all magnets beyond the
    reach have loads of their own and count as at rest: its mean and three standard deviations, as each load is as
    likely. What errors of near beams change in each other is left out.

    shift : poses under the loads, (l, 3), mm, the first at rest. The mechanics of the decoder give the forces.
    """
    assert coder.mechanics is not None
    whole, (n, k) = replace(array, reach=math.inf), (len(array), len(array.forward.elements))
    _, chosen, alike = np.unique(np.round(whole.offsets, 9), axis=0, return_index=True, return_inverse=True)
    moved, axis = magnets_at(array.forward, shift.T)
    at, values = moved - whole.offsets[chosen][:, None], np.empty((len(chosen) * len(shift), k))
    along, kernel = np.tile(axis, (len(chosen), 1)), array.forward.kernel
    read_poses(at.reshape(-1, 3), along, kernel, values, *np.empty((2, 0, k, 3)))
    _check(values)
    change = values.reshape(len(chosen), len(shift), k)
    change = change - change[:, :1]
    # forces (l, 3) by readings, at each of the loads
    A = readings_with_slopes(array.forward, shift.T)[1].transpose(2, 1, 0)
    told = np.linalg.solve(A.swapaxes(1, 2) @ _metric(coder) @ A, A.swapaxes(1, 2) @ _metric(coder))
    by_reading = np.einsum("jil,ljk->lik", forces(coder.mechanics, shift.T)[1], told)
    mean = change.mean(axis=1)
    spread = np.einsum("lik,ujk->luji", by_reading, change - mean[:, None])
    variance = (spread**2).sum(axis=3).mean(axis=2).T
    # sums over the magnets of each beam by their distance, then over those beyond
    distances, place = np.unique(np.round(np.linalg.norm(whole.offsets, axis=1), 6), return_inverse=True)
    means, variances = np.zeros((n, len(distances), k)), np.zeros((n, len(distances), len(shift)))
    pair, (first, second) = alike.ravel(), whole.pairs
    np.add.at(means, (first, place.ravel()), array.poles[second][:, None] * mean[pair])
    np.add.at(variances, (first, place.ravel()), variance[pair])
    means, variances = (each.sum(axis=1, keepdims=True) - each.cumsum(axis=1) for each in (means, variances))
    shifted = np.linalg.norm(np.einsum("lik,bdk->bdli", by_reading, means), axis=-1)
    error = (shifted + 3 * np.sqrt(np.maximum(variances, 0.0))).max(axis=(0, 2))
    error[-1] = 0.0
    return distances, error


def _metric(coder: Decoder) -> Array:
    """Return K (k, k) of `analytic.inverse.joint_poses`."""
    weighed = coder.goal.weights[:, None] * (coder.goal.free if len(coder.goal.free) else np.eye(len(coder.sigma)))
    return np.asarray(weighed.T @ weighed)


# Forces


def magnet_forces(array: BeamArray, shift: Array) -> tuple[Array, Array]:
    """Return the forces of the other magnets on each (n, 3), N, and their slopes dF_i/ds_j (n, 3, n, 3), N/mm.

    shift : of the magnets, (n, 3), mm. The slopes are those of motions without a turn.
    """
    n, (moved, axis), leaning = len(array), magnets_at(array.forward, shift.T), rotation(array.forward.tau, shift.T).T
    others = np.not_equal(*array.pairs)
    first, second = array.pairs[:, others]
    offsets, chosen, alike = array.offsets[others], np.arange(len(first)), np.arange(len(first))
    if (shift == shift[0]).all():
        # pairs that lie alike to each other act alike, up to the sign of their poles
        _, chosen, alike = np.unique(np.round(offsets, 9), axis=0, return_index=True, return_inverse=True)
    i, j = first[chosen], second[chosen]
    found = _forces_of_pairs(array, offsets[chosen], (moved[i], leaning[i]), (moved[j], axis[j]))
    poles = (array.poles[first] * array.poles[second])[:, None]
    force, slopes = np.zeros((n, 3)), np.zeros((n, 3, n, 3))
    np.add.at(force, first, poles * found[0][alike.ravel()])
    slopes[first, :, second] = poles[..., None] * found[1][alike.ravel()]
    # a motion of all magnets together changes nothing
    own = -slopes.sum(axis=2)
    slopes[np.arange(n), :, np.arange(n)] = own
    return force, slopes


def _forces_of_pairs(
    array: BeamArray, offsets: Array, on: tuple[Array, Array], by: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return the forces (m, 3), N, on magnets at offsets (m, 3), mm, from others of the same pole, and their slopes
    by motions of those others (m, 3, 3), N/mm.

    on, by : displacements (m, 3), mm, of both, with the rotation vectors (m, 2), rad, of those on which the others
        act, and the axes (m, 3) of the others.
    """
    (moved, leaning), (source, axis) = on, by
    design = array.forward.design
    radius, half, J = design.magnet_diameter / 2, design.magnet_height / 2, design.polarisation
    nodes, weights = np.polynomial.legendre.leggauss(RADII)
    r, turns = radius * (nodes + 1) / 2, 2 * math.pi * (np.arange(ANGLES) + 0.5) / ANGLES
    x, y = np.outer(r, np.cos(turns)).ravel(), np.outer(r, np.sin(turns)).ravel()
    area = np.repeat(r * weights * radius / 2, ANGLES) * 2 * math.pi / ANGLES
    faces = np.concatenate([np.column_stack([x, y, np.full(len(x), z)]) for z in (half, -half)])
    # N/T: the polarisation is along -z
    charge = -1e-6 * J / MU_0 * np.concatenate([area, -area])
    owners, count = np.tile(np.arange(3), len(faces)), len(offsets)
    force, slopes = np.empty((count, 3)), np.empty((count, 3, 3))
    # as many pairs at once as take some 100 MB
    for k in range(0, count, PAIRS):
        part = slice(k, k + PAIRS)
        places = moved[part, None] + rotated(faces, leaning[part, None]) + offsets[part, None]
        # the three components at a point follow each other, for which the field is computed once
        at = np.repeat(places, 3, axis=1)
        normals = np.broadcast_to((charge[:, None, None] * np.eye(3)).reshape(-1, 3), at.shape)
        means, by_shift, _ = readings_of_sensors(
            at, normals, owners, _sizes(design, len(at)), source[part, None], axis[part, None]
        )
        force[part], slopes[part] = J * len(faces) * means[:, 0], J * len(faces) * by_shift[:, 0]
    return force, slopes


def dipole_share(design: Design, distance: float) -> float:
    """Return the force between two dipoles side by side over that of the magnets, at a distance, mm."""
    radius, height, J = design.magnet_diameter / 2, design.magnet_height, design.remanence_now
    moment = J / MU_0 * math.pi * radius**2 * height * 1e-9
    dipoles = 3 * MU_0 * moment**2 / (4 * math.pi * (1e-3 * distance) ** 4)
    return dipoles / repulsion(radius, height, J, distance)


def stiffness(design: Design) -> Array:
    """Return the stiffness of an unpressed beam against forces on its magnet along x, y and z, (3,), N/mm."""
    sideways = buckling.sideways_stiffness(design, design.H)
    return np.array([sideways, sideways, design.E_now * math.pi * design.R**2 / design.H])


@dataclass(frozen=True, slots=True, eq=False)
class Rest:
    """What the magnets do to each other at rest.

    force, shift : of each, (n, 3), N and mm; the shift is NaN where no rest is stable.
    margin : least eigenvalue of the stiffness with the magnets, over that of a beam sideways; stable above 0.
    """

    force: Array
    shift: Array
    margin: float


def rest(array: BeamArray) -> Rest:
    """Return forces and shifts at rest, by the stiffness there."""
    n = len(array)
    force, slopes = magnet_forces(array, np.zeros((n, 3)))
    beams = stiffness(array.forward.design)
    whole = np.diag(np.tile(beams, n)) - slopes.reshape(3 * n, 3 * n)
    margin = float(np.linalg.eigvalsh((whole + whole.T) / 2)[0] / beams[0])
    shift = np.full((n, 3), np.nan)
    if margin > 0:
        shift[:] = np.linalg.solve(whole, force.ravel()).reshape(n, 3)
    return Rest(force, shift, margin)


def critical_pitch(array: BeamArray) -> float:
    """Return the pitch, mm, below which neighbours snap together; NaN if none do down to D."""
    from scipy.optimize import brentq

    D = array.forward.design.D

    def margin(pitch: float) -> float:
        return rest(replace(array, pitch=pitch)).margin

    near, far = D * (1 + 1e-6), 2 * D
    if margin(near) > 0:
        return math.nan
    while margin(far) <= 0:
        far *= 2
    return float(brentq(margin, near, far, rtol=1e-6))
